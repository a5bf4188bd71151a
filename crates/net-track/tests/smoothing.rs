//! Smoothing against exact truth.

mod synthetic;

use net_geometry::nalgebra::{Matrix6, Vector2, Vector3, Vector6};
use net_track::{Answer, Config, Error, FixedLag, GapReason, Increment, Origin, Smoothed, Verdict, smooth};
use synthetic::{Run, knows};

/// Part of the raw error that is left. At 10 Hz and 0.2 m/s² per root Hz the filter's memory is three to four frames each way, so about half of the noise goes.
const LEFT: f64 = 0.75;
/// Mean of six squared normal numbers, and how far the mean over some hundred correlated frames may be from it.
const NEES: (f64, f64) = (6.0, 1.5);
/// Two ways to the same optimum: parts of a deviation (1 mm).
const SAME_M: f64 = 2e-4;

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for v in values {
        (sum, n) = (sum + v * v, n + 1.0);
    }
    (sum / f64::max(n, 1.0)).sqrt()
}

fn known(poses: &[Option<Smoothed>]) -> impl Iterator<Item = (usize, &Smoothed)> {
    poses.iter().enumerate().filter_map(|(k, p)| p.as_ref().map(|p| (k, p)))
}

fn raw_errors(run: &Run) -> impl Iterator<Item = (f64, f64)> + '_ {
    run.samples.iter().enumerate().filter_map(|(k, s)| s.measurement.map(|m| run.error(k, &m.pose)))
}

#[test]
fn noise_goes_and_what_is_left_is_as_large_as_said() {
    let config = Config::default();
    let (mut raw, mut smoothed, mut nees) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..2 {
        let run = Run::new(200, Vector3::new(0.2, 0.0, 0.0), &config, seed);
        let out = smooth(&run.samples, &config, |_| Answer::UNKNOWN).expect("sound input");
        assert!(out.repairs.is_empty() && out.gaps.is_empty(), "{:?}", out.repairs);
        raw.extend(raw_errors(&run));
        for (k, s) in known(&out.poses) {
            assert!(s.velocity.norm() <= config.speed_max_m_s + 1e-6);
            smoothed.push(run.error(k, &s.pose));
            let (turn, shift) = s.pose.perturbation_to(&run.truth[k]);
            let e = Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
            let information: Matrix6<f64> = s.covariance.try_inverse().expect("positive definite");
            nees.push(e.dot(&(information * e)));
        }
    }
    assert_eq!(smoothed.len(), 400);
    let (turn, place) = (rms(smoothed.iter().map(|e| e.0)), rms(smoothed.iter().map(|e| e.1)));
    let (raw_turn, raw_place) = (rms(raw.iter().map(|e| e.0)), rms(raw.iter().map(|e| e.1)));
    println!("turn {raw_turn:.5} -> {turn:.5} rad, place {raw_place:.5} -> {place:.5} m");
    assert!(turn < LEFT * raw_turn && place < LEFT * raw_place);
    let mean = nees.iter().sum::<f64>() / nees.len() as f64;
    println!("NEES {mean:.2}");
    assert!((mean - NEES.0).abs() < NEES.1, "NEES {mean}");
}

#[test]
fn planted_slips_are_found_to_the_frame_and_none_invented() {
    let config = Config::default();
    // What has to be added to the count: the opposite of what is planted.
    let slips = [(40, (1, 0)), (41 + 60, (0, -1)), (150, (-1, 1)), (190, (2, 0)), (191, (0, 1))];
    for seed in 10..12 {
        let mut run = Run::new(240, Vector3::new(0.3, 0.1, 0.0), &config, seed);
        slips.iter().for_each(|&(frame, (i, j))| run.slip(frame, (i, j)));
        let out = smooth(&run.samples, &config, knows(&slips)).expect("sound input");
        let found: Vec<_> = out.repairs.iter().map(|r| (r.suspect.sample, r.suspect.cells)).collect();
        assert_eq!(found, slips, "seed {seed}");
        assert!(out.repairs.iter().all(|r| r.answer.verdict == Verdict::Confirmed && r.suspect.gain > 12.0));
        let worst = known(&out.poses).map(|(k, s)| run.error(k, &s.pose).1).fold(0.0, f64::max);
        // Half a cell would be a slip; noise is a few millimetres.
        assert!(worst < 0.015, "seed {seed}: {worst} m");
        assert!(known(&out.poses).all(|(_, s)| s.segment == 0));
    }
}

#[test]
fn a_slip_that_nobody_confirms_parts_the_run_and_is_not_applied() {
    let config = Config::default();
    let mut run = Run::new(120, Vector3::new(0.3, 0.0, 0.0), &config, 20);
    run.slip(60, (1, 0));
    let out = smooth(&run.samples, &config, |_| Answer::UNKNOWN).expect("sound input");
    assert_eq!(out.repairs.len(), 1);
    assert_eq!((out.repairs[0].suspect.sample, out.repairs[0].suspect.cells), (60, (1, 0)));
    assert_eq!(out.gaps.len(), 1);
    assert_eq!((out.gaps[0].before, out.gaps[0].after, out.gaps[0].reason), (59, 60, GapReason::Slip));
    for (k, s) in known(&out.poses) {
        assert_eq!((s.segment, s.correction), (u32::from(k >= 60), (0, 0)));
        // Neither side bends towards the other.
        let measured = run.samples[k].measurement.expect("all measured").pose;
        assert!((s.pose.camera_in_net() - measured.camera_in_net()).norm() < 0.015);
    }
    assert_eq!(known(&out.poses).count(), 120);
}

#[test]
fn outliers_have_little_say() {
    let config = Config::default();
    let mut run = Run::new(150, Vector3::new(0.2, 0.0, 0.0), &config, 30);
    let wrong = [25, 50, 51, 90, 120];
    wrong.iter().for_each(|&k| run.outlier(k));
    let out = smooth(&run.samples, &config, knows(&[])).expect("sound input");
    for (k, s) in known(&out.poses) {
        assert_eq!(s.origin == Origin::Outlier, wrong.contains(&k), "frame {k}: residual {}", s.residual);
        let (turn, place) = run.error(k, &s.pose);
        // Two frames in a row are bridged by prediction; a wrong pose that counts would be off by 0.1 rad and 0.1 m.
        assert!(turn < 0.02 && place < 0.02, "frame {k}: {turn} rad, {place} m");
    }
    assert!(out.repairs.is_empty(), "{:?}", out.repairs);
}

#[test]
fn short_gaps_are_bridged_and_long_ones_part() {
    let config = Config::default();
    let mut run = Run::new(120, Vector3::new(0.1, 0.0, 0.0), &config, 40);
    (0..2).chain(30..35).chain(70..85).chain(118..120).for_each(|k| run.lose(k));
    run.samples[100..].iter_mut().filter_map(|s| s.measurement.as_mut()).for_each(|m| m.track = 1);
    let out = smooth(&run.samples, &config, knows(&[])).expect("sound input");
    let gaps: Vec<_> = out.gaps.iter().map(|g| (g.before, g.after, g.reason)).collect();
    assert_eq!(gaps, [(69, 85, GapReason::Time), (99, 100, GapReason::Track)]);
    for (k, pose) in out.poses.iter().enumerate() {
        let expected = match k {
            0..2 | 70..85 | 118.. => None,
            30..35 => Some(Origin::Interpolated),
            _ => Some(Origin::Smoothed),
        };
        assert_eq!(pose.map(|p| p.origin), expected, "frame {k}");
    }
    let sigma = |k: usize| out.poses[k].expect("known").covariance.trace().sqrt();
    assert!(sigma(32) > 1.5 * sigma(20), "the middle of a gap is less sure");
    let segments = [20, 60, 90, 110].map(|k| out.poses[k].expect("known").segment);
    assert_eq!(segments, [0, 0, 1, 2]);
}

#[test]
fn a_doubtful_pose_is_no_measurement() {
    let config = Config::default();
    let mut run = Run::new(40, Vector3::zeros(), &config, 50);
    run.outlier(20);
    run.samples[20].measurement.as_mut().expect("measured").probability = 0.4;
    let out = smooth(&run.samples, &config, knows(&[])).expect("sound input");
    assert_eq!(out.poses[20].map(|p| p.origin), Some(Origin::Interpolated));
}

#[test]
fn a_steady_alias_shows_against_increments_only() {
    let config = Config::default();
    let mut run = Run::new(60, Vector3::new(0.4, 0.0, 0.0), &config, 60);
    // From frame 20 to 29 every frame loses a cell: a velocity.
    (20..30).for_each(|k| run.slip(k, (1, 0)));
    let slips: Vec<_> = (20..30).map(|k| (k, (1, 0))).collect();
    for k in 1..60 {
        let moved = run.truth[k].camera_in_net() - run.truth[k - 1].camera_in_net();
        let covariance = Vector2::repeat(0.005f64.powi(2));
        run.samples[k].increment = Some(Increment {
            shift: moved.xy(),
            covariance: net_geometry::nalgebra::Matrix2::from_diagonal(&covariance),
        });
    }
    let out = smooth(&run.samples, &config, knows(&slips)).expect("sound input");
    let found: Vec<_> = out.repairs.iter().map(|r| (r.suspect.sample, r.suspect.cells)).collect();
    assert_eq!(found, slips);
}

#[test]
fn speed_is_bounded() {
    let config = Config { speed_max_m_s: 0.1, ..Config::default() };
    let run = Run::new(40, Vector3::new(0.4, 0.0, 0.0), &Config::default(), 70);
    let out = smooth(&run.samples, &config, knows(&[])).expect("sound input");
    // The solver's tolerance.
    assert!(known(&out.poses).all(|(_, s)| s.velocity.norm() <= 0.1 + 1e-6));
}

#[test]
fn windows_and_repetition_change_nothing() {
    let run = Run::new(150, Vector3::new(0.2, 0.0, 0.0), &Config::default(), 80);
    let whole = Config { window: 150, ..Config::default() };
    let parts = Config { window: 60, ..Config::default() };
    let a = smooth(&run.samples, &whole, knows(&[])).expect("sound input");
    let b = smooth(&run.samples, &parts, knows(&[])).expect("sound input");
    assert_eq!(b, smooth(&run.samples, &parts, knows(&[])).expect("sound input"));
    for ((k, a), (_, b)) in known(&a.poses).zip(known(&b.poses)) {
        let apart = (a.pose.camera_in_net() - b.pose.camera_in_net()).norm();
        assert!(apart < SAME_M, "frame {k}: {apart} m");
    }
}

#[test]
fn online_gives_every_frame_once_and_finds_the_slips() {
    let config = Config::default();
    let mut run = Run::new(80, Vector3::new(0.3, 0.0, 0.0), &config, 90);
    let slips = [(20, (1, 0)), (45, (0, -1))];
    slips.iter().for_each(|&(frame, cells)| run.slip(frame, cells));
    run.outlier(32);
    (55..70).for_each(|k| run.lose(k));
    let mut smoother = FixedLag::new(&config).expect("default");
    let (mut poses, mut repairs, mut gaps) = (Vec::new(), Vec::new(), Vec::new());
    for (k, sample) in run.samples.iter().enumerate() {
        let ready = smoother.push(sample, knows(&slips)).expect("sound input");
        assert!(ready.poses.iter().all(|(n, _)| *n <= k));
        poses.extend(ready.poses);
        repairs.extend(ready.repairs.iter().map(|r| (r.suspect.sample, r.suspect.cells)));
        gaps.extend(ready.gaps.iter().map(|g| (g.before, g.after, g.reason)));
    }
    poses.extend(smoother.flush(knows(&slips)).expect("sound input").poses);
    assert_eq!(repairs, slips);
    assert_eq!(gaps, [(54, 70, GapReason::Time)]);
    assert!(poses.iter().map(|(n, _)| *n).eq(0..80), "every frame, in order");
    for (k, pose) in &poses {
        assert_eq!(pose.is_none(), (55..70).contains(k), "frame {k}");
        let Some(pose) = pose else { continue };
        let (_, place) = run.error(*k, &pose.pose);
        assert!(place < 0.015, "frame {k}: {place} m");
    }
}

#[test]
fn bad_input_is_named() {
    let config = Config::default();
    let good = Run::new(5, Vector3::zeros(), &config, 1).samples;
    let fails = |change: &dyn Fn(&mut Vec<net_track::Sample>)| {
        let mut samples = good.clone();
        change(&mut samples);
        smooth(&samples, &config, |_| Answer::UNKNOWN).expect_err("bad input").to_string()
    };
    let order = fails(&|s| s[2].timestamp_ns = s[1].timestamp_ns);
    assert!(order.contains("sample 2: timestamp_ns"), "{order}");
    let nan = fails(&|s| s[3].measurement.as_mut().expect("measured").pose.translation.x = f64::NAN);
    assert!(nan.contains("sample 3: pose is NaN"), "{nan}");
    let singular = fails(&|s| s[1].measurement.as_mut().expect("measured").covariance = Matrix6::zeros());
    assert!(singular.contains("sample 1: covariance is 0"), "{singular}");
    let skewed = fails(&|s| s[1].measurement.as_mut().expect("measured").covariance[(0, 1)] = 1.0);
    assert!(skewed.contains("sample 1: covariance is 1"), "{skewed}");
    let odds = fails(&|s| s[0].measurement.as_mut().expect("measured").probability = 1.5);
    assert!(odds.contains("sample 0: probability is 1.5"), "{odds}");
    let flat = fails(&|s| s[0].measurement.as_mut().expect("measured").lattice[1] = Vector2::new(0.1, 0.0));
    assert!(flat.contains("sample 0: lattice"), "{flat}");
    let config = Config { overlap: 100, ..Config::default() };
    let error = smooth(&good, &config, |_| Answer::UNKNOWN).expect_err("bad parameter");
    assert!(matches!(error, Error::Parameter { field: "overlap", .. }));
}

#[test]
fn nothing_and_next_to_nothing() {
    let config = Config::default();
    let out = smooth(&[], &config, |_| Answer::UNKNOWN).expect("nothing is sound");
    assert!(out.poses.is_empty());
    let run = Run::new(1, Vector3::zeros(), &config, 2);
    let out = smooth(&run.samples, &config, |_| Answer::UNKNOWN).expect("one frame");
    let only = out.poses[0].expect("measured");
    assert!((only.pose.translation - run.samples[0].measurement.expect("measured").pose.translation).norm() < SAME_M);
    let none = [net_track::Sample { timestamp_ns: 0, measurement: None, increment: None }];
    assert_eq!(smooth(&none, &config, |_| Answer::UNKNOWN).expect("no net").poses, [None]);
    // Frames a nanosecond apart.
    let mut run = Run::new(3, Vector3::zeros(), &config, 3);
    run.samples.iter_mut().enumerate().for_each(|(k, s)| s.timestamp_ns = k as i64);
    smooth(&run.samples, &config, |_| Answer::UNKNOWN).expect("close together");
}
