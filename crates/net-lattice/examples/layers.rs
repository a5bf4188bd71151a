//! Nets behind nets: are both found, and is none claimed where there is only one?
//!
//!     cargo run --release -p net-lattice --example layers -- STUDY [SCENES] [SEED]
//!
//! STUDY: `layers` (two nets), or any study of single nets ([`net_sim::Study`]): then every second net is a false one. A line per
//! scene in which the first net was claimed, then the sums.

mod evidence;

use net_image::Image;
use net_lattice::{Config, LatticeEstimate, LatticeEstimator};
use net_sim::{LayerTruth, Simulator, Study};

/// Range within 5 %, normal and in-plane rotation within 5 degrees.
fn is_right(net: &LayerTruth, e: &LatticeEstimate) -> Option<(f64, f64)> {
    let axis = net.axis?;
    let lattice = net.lattice_at_axis()?.following(&e.pose);
    let range = 100.0 * (e.range / axis.range_m - 1.0);
    let normal = axis.normal.angle(&e.pose.normal()).to_degrees();
    let turn = (e.pose.rotation * lattice.pose.rotation.inverse()).scaled_axis().dot(&axis.normal).abs().to_degrees();
    (range.abs() <= 5.0 && normal <= 5.0 && turn <= 5.0).then_some((range, normal))
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize, default: u64| args.get(k).and_then(|a| a.parse().ok()).unwrap_or(default);
    let Some(study) = Study::ALL.into_iter().find(|s| args.first().is_some_and(|a| a == s.name())) else {
        eprintln!("{:?}: no such study", args.first());
        std::process::exit(2);
    };
    let config = Config::default();
    let (mut first_claimed, mut first_wrong, mut claimed, mut right, mut withheld) = (0, 0, 0, 0, 0);
    let (mut ranges, mut normals) = (Vec::new(), Vec::new());
    for seed in number(2, 1)..number(2, 1) + number(1, 50) {
        let scenario = study.scenario(seed);
        let (Ok(camera), Ok(mesh), Ok(frame)) = (scenario.camera(), scenario.mesh(), scenario.frame(0)) else {
            continue;
        };
        let mut image = Image::default();
        let mut simulator = Simulator::new(camera);
        let Ok(truth) = simulator.render(&frame.scene, frame.seed, &mut image) else { continue };
        let (Some(view), Ok(mut estimator)) = (image.view(), LatticeEstimator::new(&camera, &mesh, &config)) else {
            continue;
        };
        let found = estimator.estimate(view).ok().flatten().filter(|e| e.probability >= config.probability_threshold);
        let Some(first) = found else { continue };
        let which = truth.layers.iter().position(|net| is_right(net, &first).is_some());
        first_claimed += 1;
        first_wrong += u32::from(which.is_none());
        let started = std::time::Instant::now();
        let second = estimator.another(view, &first).ok().flatten();
        let ms = started.elapsed().as_millis();
        let others = truth.layers.iter().enumerate().filter(|(k, _)| Some(*k) != which);
        let hit = second.as_ref().and_then(|e| others.clone().find_map(|(_, net)| is_right(net, e)));
        let sure = second.as_ref().is_some_and(|e| e.probability >= config.probability_threshold);
        claimed += u32::from(sure);
        let verdict = match (sure, hit.is_some()) {
            (true, true) => {
                right += 1;
                if let Some((range, normal)) = hit {
                    ranges.push(range.abs());
                    normals.push(normal);
                }
                "right"
            }
            (true, false) => "FALSE",
            (false, true) => {
                withheld += 1;
                "withheld"
            }
            (false, false) => "none",
        };
        let ranges: Vec<String> =
            truth.layers.iter().filter_map(|l| l.axis).map(|a| format!("{:.3}", a.range_m)).collect();
        println!(
            "{:20} first {:.3} m p {:.2} ({which:?}) true {} snr {:.1} | {verdict:8} {ms} ms {}",
            scenario.name,
            first.range,
            first.probability,
            ranges.join(" "),
            truth.layers.first().map_or(0.0, |l| l.contrast_grey.abs()) / truth.noise_grey.max(1e-9),
            second.map_or(String::new(), |e| {
                let before = e.evidence.probability(e.tilt_sigma);
                format!("{:.3} m p {:.3} before {before:.3}{}", e.range, e.probability, evidence::line(&e))
            })
        );
    }
    println!(
        "first nets claimed {first_claimed} (wrong {first_wrong}); second nets claimed {claimed}, right {right}, right but withheld {withheld}"
    );
    for (name, mut values) in [("range %", ranges), ("normal deg", normals)] {
        values.sort_by(f64::total_cmp);
        let at = |q: f64| {
            values.get((values.len().saturating_sub(1) as f64 * q).round() as usize).copied().unwrap_or(f64::NAN)
        };
        println!("{name}: median {:.4}, 95th percentile {:.4}", at(0.5), at(0.95));
    }
}
