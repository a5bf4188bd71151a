//! `poses.csv`: the contract's columns to the letter, and going on after a stop.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use net_geometry::Pose;
use net_geometry::nalgebra::{Rotation3, Vector3};
use net_log::{Error, NetColumns, POSES_HEADER, PoseRow, PosesCsv, RowStatus, read_poses};
use proptest::prelude::*;

fn ok_row(frame: u64, seed: f64) -> PoseRow {
    let rotation = Rotation3::from_euler_angles(0.1 * seed, -0.2, 0.3);
    let pose = Pose { rotation, translation: Vector3::new(0.1 + seed, -1.0 / 3.0, 1e-7) };
    PoseRow {
        frame,
        file: format!("frame, {frame}.png"),
        timestamp_ns: Some(1_700_000_000_123_456_789 + frame as i64),
        status: RowStatus::Ok,
        probability: Some(0.987_654_321),
        net: Some(NetColumns {
            range_m: 1.25,
            distance_m: 1.2 + seed,
            normal: pose.normal(),
            pose,
            sigma_range_m: 1e-4,
            sigma_tilt_deg: 0.25,
            sigma_xy_m: f64::NAN,
        }),
        junctions: Some(321),
        latency_ms: Some(12.5),
        appended: Vec::new(),
    }
}

fn no_net(frame: u64) -> PoseRow {
    PoseRow {
        status: RowStatus::NoNet,
        probability: Some(0.125),
        junctions: Some(0),
        latency_ms: Some(3.5),
        ..PoseRow::unreadable(frame, "b.png", Some(5))
    }
}

fn write(path: &Path, rows: &[PoseRow]) {
    let mut csv = PosesCsv::create(path, &[]).unwrap();
    rows.iter().for_each(|r| csv.write(r).unwrap());
}

#[test]
fn columns_and_cells_are_the_contract_s() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("poses.csv");
    write(&path, &[ok_row(0, 0.0), no_net(1), PoseRow::unreadable(2, "c.png", None)]);
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[0],
        "frame,file,timestamp_ns,status,probability,range_m,distance_m,normal_x,normal_y,normal_z,\
         tx,ty,tz,qw,qx,qy,qz,sigma_range_m,sigma_tilt_deg,sigma_xy_m,junctions,latency_ms"
    );
    assert!(lines[1].starts_with("0,\"frame, 0.png\",1700000000123456789,ok,0.987654321,1.25,1.2,"), "{}", lines[1]);
    assert!(lines[1].contains(",0.1,-0.3333333333333333,0.0000001,"), "{}", lines[1]);
    assert!(lines[1].ends_with(",0.0001,0.25,,321,12.5"), "{}", lines[1]);
    assert_eq!(lines[2], "1,b.png,5,no_net,0.125,,,,,,,,,,,,,,,,0,3.5");
    assert_eq!(lines[3], "2,c.png,,unreadable,,,,,,,,,,,,,,,,,,");
    assert!(lines[2..].iter().all(|l| l.matches(',').count() == POSES_HEADER.matches(',').count()));
}

#[test]
fn rows_read_back_as_they_were_written() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("poses.csv");
    let rows = [ok_row(3, 0.7), no_net(4), PoseRow::unreadable(5, "c", Some(-9)), ok_row(6, -0.4)];
    write(&path, &rows);
    let back = read_poses(&path).unwrap();
    assert_eq!(back.len(), rows.len());
    for (a, b) in rows.iter().zip(&back) {
        assert_eq!((a.frame, &a.file, a.timestamp_ns, a.status), (b.frame, &b.file, b.timestamp_ns, b.status));
        assert_eq!((a.probability, a.junctions, a.latency_ms), (b.probability, b.junctions, b.latency_ms));
        assert_eq!(a.net.is_some(), b.net.is_some());
        let (Some(a), Some(b)) = (&a.net, &b.net) else { continue };
        assert_eq!(
            (a.range_m, a.distance_m, a.normal, a.pose.translation),
            (b.range_m, b.distance_m, b.normal, b.pose.translation)
        );
        assert!(b.sigma_xy_m.is_nan());
        // The rotation goes through a quaternion: a few roundings.
        assert!(a.pose.rotation.angle_to(&b.pose.rotation) < 1e-7);
    }
}

#[test]
fn what_may_not_be_written() {
    let dir = tempfile::tempdir().unwrap();
    let mut csv = PosesCsv::create(&dir.path().join("poses.csv"), &[]).unwrap();
    let mut nan = ok_row(0, 0.0);
    nan.net.as_mut().unwrap().pose.translation.x = f64::NAN;
    let without = PoseRow { net: None, ..ok_row(0, 0.0) };
    let with = PoseRow { status: RowStatus::NoNet, ..ok_row(0, 0.0) };
    let certain = PoseRow { probability: Some(1.5), ..no_net(0) };
    let more = PoseRow { appended: vec![1.0], ..no_net(0) };
    for row in [nan, without, with, certain, more] {
        assert!(matches!(csv.write(&row), Err(Error::Value { .. })), "{row:?}");
    }
    let text = PosesCsv::create(Path::new("/nowhere/poses.csv"), &[]).unwrap_err().to_string();
    assert!(text.starts_with("cannot create /nowhere/poses.csv: "), "{text}");
}

#[test]
fn a_full_disk_names_the_file() {
    if !Path::new("/dev/full").exists() {
        eprintln!("skipped: no /dev/full here");
        return;
    }
    let text = PosesCsv::create(Path::new("/dev/full"), &[]).unwrap_err().to_string();
    assert!(text.starts_with("cannot write /dev/full: "), "{text}");
}

#[test]
fn columns_can_be_appended() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("poses.csv");
    let mut csv = PosesCsv::create(&path, &["crossing_deg", "layer"]).unwrap();
    csv.write(&PoseRow { appended: vec![82.5, 1.0], ..ok_row(0, 0.0) }).unwrap();
    csv.write(&no_net(1)).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.lines().next().unwrap().ends_with(",junctions,latency_ms,crossing_deg,layer"), "{text}");
    assert!(text.lines().nth(1).unwrap().ends_with(",321,12.5,82.5,1") && text.ends_with(",0,3.5,,\n"), "{text}");
    let rows = read_poses(&path).unwrap();
    assert_eq!(rows[0].appended, [82.5, 1.0]);
    assert!(rows[1].appended.iter().all(|v| v.is_nan()));
    drop(csv);
    let (_, resumed) = PosesCsv::resume(&path, &["crossing_deg", "layer"]).unwrap();
    assert_eq!((resumed.rows, resumed.last_frame), (2, Some(1)));
    let text = PosesCsv::resume(&path, &[]).unwrap_err().to_string();
    assert!(text.contains("poses.csv, line 1: the columns are not those of this version"), "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Stopped after any byte: what is complete stays, and the run goes on behind it to the same file as if never stopped.
    #[test]
    fn stopped_anywhere(cut in 0.0..1.0f64) {
        let dir = tempfile::tempdir().unwrap();
        let (whole, torn) = (dir.path().join("whole.csv"), dir.path().join("torn.csv"));
        let rows = [ok_row(0, 0.5), no_net(2), PoseRow::unreadable(4, "c.png", None), ok_row(6, 0.25)];
        write(&whole, &rows);
        let bytes = std::fs::read(&whole).unwrap();
        let cut = (cut * bytes.len() as f64) as usize;
        std::fs::write(&torn, &bytes[..cut]).unwrap();
        if bytes[..cut].contains(&b'\n') {
            let complete = bytes[..cut].iter().filter(|&&b| b == b'\n').count() - 1;
            prop_assert_eq!(read_poses(&torn).unwrap().len(), complete);
        }
        let (mut csv, resumed) = PosesCsv::resume(&torn, &[]).unwrap();
        prop_assert_eq!(resumed.last_frame, resumed.rows.checked_sub(1).map(|i| rows[i as usize].frame));
        for row in &rows[resumed.rows as usize..] {
            csv.write(row).unwrap();
        }
        prop_assert_eq!(std::fs::read(&torn).unwrap(), bytes);
    }

    /// Any text: rows or an error, never a panic.
    #[test]
    fn any_text(text in "(frame|[0-9,.eE+-]{0,40}|ok|no_net|\n|\"|NaN|inf){0,30}", header: bool) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("poses.csv");
        let text = if header { format!("{POSES_HEADER}\n{text}") } else { text };
        std::fs::write(&path, text).unwrap();
        if let Ok(rows) = read_poses(&path) {
            for row in rows {
                prop_assert_eq!(row.net.is_some(), row.status == RowStatus::Ok);
            }
        }
    }
}
