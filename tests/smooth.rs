//! Smoothing as frames come in, from pictures to poses.

use net_sim::{Image, Scenario, Simulator};
use netpose::smooth::{Answer, Config, FixedLag, Origin, Smoothed};
use netpose::{Mesh, Tracker};

/// Frames of a strafe, of which some in the middle show nothing.
const FRAMES: u32 = 24;
const DARK: std::ops::Range<u32> = 12..14;

#[test]
fn poses_come_out_some_frames_late_and_over_gaps() {
    let scenario = Scenario::by_name("strafe").expect("a scenario of this name");
    let (camera, mesh): (_, Mesh) = (scenario.camera().expect("sound"), scenario.mesh().expect("sound"));
    let mut tracker = Tracker::new(camera, mesh, &netpose::Config::default()).expect("sound");
    let config = Config::default();
    let mut smoother = FixedLag::new(&config).expect("sound");
    let mut simulator = Simulator::new(camera);
    let mut image = Image::default();
    let mut places = Vec::new();
    let mut smoothed: Vec<(usize, Option<Smoothed>)> = Vec::new();
    for k in 0..FRAMES {
        let frame = scenario.frame(k).expect("sound");
        let truth = simulator.render(&frame.scene, frame.seed, &mut image).expect("sound");
        places.push(truth.layers[0].pose.camera_in_net());
        if DARK.contains(&k) {
            (0..image.height()).for_each(|v| image.row_mut(v).fill(30));
        }
        let estimate = tracker.update(image.view().expect("drawn"), frame.timestamp_ns).expect("in order");
        let sample = estimate.sample(frame.timestamp_ns, &mesh);
        assert_eq!(sample.measurement.is_none(), DARK.contains(&k), "frame {k}");
        let ready = smoother.push(&sample, |_| Answer::UNKNOWN).expect("sound");
        // None earlier than `lag` frames after it.
        assert!(ready.poses.iter().all(|(frame, _)| frame + config.lag <= k as usize), "frame {k}");
        smoothed.extend(ready.poses);
    }
    smoothed.extend(smoother.flush(|_| Answer::UNKNOWN).expect("sound").poses);
    let frames: Vec<usize> = smoothed.iter().map(|(frame, _)| *frame).collect();
    assert_eq!(frames, (0..FRAMES as usize).collect::<Vec<_>>());
    let poses: Vec<Smoothed> = smoothed.into_iter().filter_map(|(_, pose)| pose).collect();
    assert_eq!(poses.len(), places.len());
    let first = (poses[0].pose.camera_in_net(), places[0]);
    for (k, (pose, place)) in poses.iter().zip(&places).enumerate() {
        assert_eq!(pose.origin == Origin::Interpolated, DARK.contains(&(k as u32)), "frame {k}");
        // Distances on the net do not depend on which knot is the origin. A centimetre is a fifth of a cell; two frames without a pose at a tenth of a second each add no more.
        let (way, true_way) = ((pose.pose.camera_in_net() - first.0).norm(), (place - first.1).norm());
        assert!((way - true_way).abs() < 0.01, "frame {k}: {way} of {true_way} m");
    }
}
