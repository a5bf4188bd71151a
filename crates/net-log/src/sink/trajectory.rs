//! `trajectory.tum`: `timestamp_s tx ty tz qx qy qz qw` of the camera in the net frame.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use net_geometry::Pose;

use crate::error::{Error, Result};

/// Writes `trajectory.tum`, a line for every frame with a pose.
#[derive(Debug)]
pub struct TrajectoryTum {
    path: PathBuf,
    writer: BufWriter<File>,
}

impl TrajectoryTum {
    /// Starts a new file.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(Error::io("create", path))?;
        Ok(Self { path: path.to_owned(), writer: BufWriter::new(file) })
    }

    /// Goes on behind the first `lines` lines of an earlier run. `None` if there are fewer.
    pub(crate) fn resume_behind(path: &Path, lines: usize) -> Result<Option<Self>> {
        let mut reader = match File::open(path) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            other => BufReader::new(other.map_err(Error::io("read", path))?),
        };
        let (mut end, mut line) = (0, Vec::new());
        for _ in 0..lines {
            line.clear();
            end += reader.read_until(b'\n', &mut line).map_err(Error::io("read", path))? as u64;
            if line.last() != Some(&b'\n') {
                return Ok(None);
            }
        }
        let mut file = OpenOptions::new().write(true).open(path).map_err(Error::io("write", path))?;
        file.set_len(end).and_then(|()| file.seek(SeekFrom::End(0))).map_err(Error::io("write", path))?;
        Ok(Some(Self { path: path.to_owned(), writer: BufWriter::new(file) }))
    }

    /// Adds where the camera was at `timestamp_ns`, given the net's pose in its frame. The line is in the file on return.
    ///
    /// # Errors
    /// [`Error::Io`] names the path.
    pub fn write(&mut self, timestamp_ns: i64, camera_from_net: &Pose) -> Result<()> {
        let line = line(timestamp_ns, camera_from_net);
        self.writer
            .write_all(line.as_bytes())
            .and_then(|()| self.writer.flush())
            .map_err(Error::io("write", &self.path))
    }
}

/// The time keeps all nine decimals: a double of seconds since 1970 would round it to 0.2 µs.
fn line(timestamp_ns: i64, camera_from_net: &Pose) -> String {
    let sign = if timestamp_ns < 0 { "-" } else { "" };
    let ns = timestamp_ns.unsigned_abs();
    let t = camera_from_net.camera_in_net();
    let net_from_camera = Pose { rotation: camera_from_net.rotation.inverse(), translation: t };
    let q = net_from_camera.quaternion();
    let (s, ns) = (ns / 1_000_000_000, ns % 1_000_000_000);
    format!("{sign}{s}.{ns:09} {} {} {} {} {} {} {}\n", t.x, t.y, t.z, q.i, q.j, q.k, q.w)
}

#[cfg(test)]
mod tests {
    use net_geometry::nalgebra::{Rotation3, Vector3};

    use super::*;

    #[test]
    fn the_camera_in_the_net_frame_with_every_nanosecond() {
        // The net 2 m ahead, turned by a right angle about the optical axis; its origin 1 m to the right.
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let pose = Pose { rotation, translation: Vector3::new(1.0, 0.0, 2.0) };
        let text = line(1_700_000_000_123_456_789, &pose);
        let numbers: Vec<f64> = text.split_whitespace().map(|n| n.parse().expect("a number")).collect();
        assert!(text.starts_with("1700000000.123456789 ") && text.ends_with('\n'), "{text}");
        // X_net = Rᵀ (0 - t): the camera sits at y = +1 of the net, 2 m before it, turned back by the same angle.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        for (found, truth) in numbers[1..].iter().zip([0.0, 1.0, -2.0, 0.0, 0.0, -half, half]) {
            assert!((found - truth).abs() < 1e-15, "{text}");
        }
        assert!(line(-1_500_000_000, &pose).starts_with("-1.500000000 "));
        assert!(line(5, &pose).starts_with("0.000000005 "));
    }
}
