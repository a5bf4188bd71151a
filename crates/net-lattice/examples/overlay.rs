//! Finds the net in single pictures and draws it.
//!
//!     cargo run --release -p net-lattice --example overlay -- FX FY CX CY MESH DIR IMAGE...

mod draw;
mod evidence;

use std::path::{Path, PathBuf};
use std::time::Instant;

use net_geometry::{Camera, Lens, Mesh};
use net_image::GrayView;
use net_lattice::{Config, LatticeEstimator};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |k: usize| args.get(k).and_then(|a| a.parse::<f64>().ok());
    let (Some(fx), Some(fy), Some(cx), Some(cy)) = (number(0), number(1), number(2), number(3)) else {
        eprintln!("usage: overlay FX FY CX CY MESH DIR IMAGE...");
        std::process::exit(2);
    };
    let Some(mesh) = args.get(4).and_then(|m| m.parse::<Mesh>().ok()) else {
        eprintln!("MESH: 50mm, 27.5mm, 60x40mm");
        std::process::exit(2);
    };
    let dir = PathBuf::from(args.get(5).map_or(".", String::as_str));
    for file in args.iter().skip(6) {
        let gray = match image::open(file) {
            Ok(i) => i.to_luma8(),
            Err(error) => {
                eprintln!("{file}: {error}");
                continue;
            }
        };
        let (w, h) = gray.dimensions();
        let Ok(camera) = Camera::new(fx, fy, cx, cy, w, h, Lens::None) else { continue };
        let Ok(view) = GrayView::packed(gray.as_raw(), w as usize, h as usize) else { continue };
        let Ok(mut estimator) = LatticeEstimator::new(&camera, &mesh, &Config::default()) else { continue };
        let start = Instant::now();
        let found = estimator.estimate(view);
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let quickest = |estimator: &mut LatticeEstimator, predicted: Option<&net_geometry::Pose>| {
            let once = |_| {
                let start = Instant::now();
                let done = match predicted {
                    Some(pose) => estimator.update(view, pose),
                    None => estimator.estimate(view),
                };
                done.map_or(f64::NAN, |_| start.elapsed().as_secs_f64() * 1e3)
            };
            (0..8).map(once).fold(f64::INFINITY, f64::min)
        };
        if let Ok(Some(e)) = &found {
            let cold = quickest(&mut estimator, None);
            let followed = quickest(&mut estimator, Some(&e.pose));
            println!("quickest of 8: cold start {cold:.1} ms, followed {followed:.1} ms");
        }
        let name = Path::new(file).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        match found {
            Ok(Some(e)) => {
                println!(
                    "{name:44} p {:.2} range {:.3} m distance {:.3} tilt {:.1} crossing {:.1} (sd {:.2}) curvatures {:.2?}{} {ms:.0} ms",
                    e.probability,
                    e.range,
                    e.pose.plane().distance,
                    e.pose.plane().tilt().to_degrees(),
                    e.crossing_angle.to_degrees(),
                    e.crossing_angle_sigma.unwrap_or_default().to_degrees(),
                    e.curvatures,
                    evidence::line(&e)
                );
                draw::overlay(&dir.join(format!("{name}.png")), &gray, &camera, &e);
            }
            Ok(None) => println!("{name:44} nothing periodic, {ms:.0} ms"),
            Err(error) => eprintln!("{name}: {error}"),
        }
    }
}
