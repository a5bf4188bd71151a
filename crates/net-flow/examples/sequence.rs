//! Draws a scenario of the simulator as binary PGM pictures, with the knots that stay in view as `truth.csv` (`frame,point,u,v`).
//!
//! ```text
//! sequence SCENARIO FOLDER [FRAMES]
//! ```

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write as _;
use std::path::PathBuf;

use net_sim::{Image, Scenario, Simulator};

/// Points nearer to the border than this are left out, px.
const MARGIN_PX: f64 = 40.0;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let usage = "sequence SCENARIO FOLDER [FRAMES]";
    let (name, folder) = (args.first().ok_or(usage)?, PathBuf::from(args.get(1).ok_or(usage)?));
    let scenario = Scenario::by_name(name)?;
    let frames = args.get(2).map_or(Ok(scenario.frames), |n| n.parse())?;
    std::fs::create_dir_all(&folder)?;
    let mut simulator = Simulator::new(scenario.camera()?);
    let mut image = Image::default();
    let mut tracks: BTreeMap<(i32, i32), Vec<(f64, f64)>> = BTreeMap::new();
    for k in 0..frames {
        let frame = scenario.frame(k)?;
        let truth = simulator.render(&frame.scene, frame.seed, &mut image)?;
        let (width, height) = (image.width() as f64, image.height() as f64);
        for node in truth.layers.first().map_or(&[][..], |layer| &layer.nodes) {
            let p = node.pixel;
            let inside = p.x > MARGIN_PX && p.y > MARGIN_PX && p.x < width - MARGIN_PX && p.y < height - MARGIN_PX;
            if inside {
                tracks.entry(node.index).or_default().push((p.x, p.y));
            }
        }
        let mut bytes = format!("P5\n{} {}\n255\n", image.width(), image.height()).into_bytes();
        bytes.extend_from_slice(image.data());
        std::fs::write(folder.join(format!("{k:05}.pgm")), bytes)?;
    }
    tracks.retain(|_, track| track.len() == frames as usize);
    let mut csv = String::from("frame,point,u,v\n");
    for k in 0..frames as usize {
        for (i, track) in tracks.values().enumerate() {
            writeln!(csv, "{k},{i},{},{}", track[k].0, track[k].1)?;
        }
    }
    std::fs::write(folder.join("truth.csv"), csv)?;
    eprintln!("{frames} frames of {name}, {} knots that stay in view", tracks.len());
    Ok(())
}
