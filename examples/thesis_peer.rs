//! Draws pictures, times the thesis's stages on them and finds their poses: the half in Rust of `benches/peer/thesis.py`, which does the same on OpenCV.
//!
//! `cargo run --release --no-default-features --example thesis_peer -- FOLDER WIDTH HEIGHT` writes `NAME.pgm` and prints lines of comma-separated fields:
//! `truth,NAME,range_m,nx,ny,nz`, `pose,NAME,METHOD,range_m,nx,ny,nz,probability` (empty without a net) and `time,NAME,STAGE,microseconds` (on a core).
//! After each picture it prints `done,NAME` and waits for a line: the other half has its turn, under the same load of the machine.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use net_fft::{
    Bins, HalfSpectrum, PeakFinder, RealFft2, SectionAnalyser, SectionConfig, SectionSpectrum, SpectrumImage,
    SpectrumImageConfig, SpectrumPlan, ThesisConfig, ThesisEstimate, ThesisEstimator, Window,
};
use net_geometry::{Camera, Lens, Mesh};
use net_image::{Image, View};
use net_junction::{CellArea, Expectation, JunctionDetector, Polarity};
use net_sim::{Layer, NetPose, Scene, Simulator};

/// Runs go on for so long, on a core.
const ENOUGH_SECONDS: f64 = 0.1;
/// So many times.
const ROUNDS: usize = 3;
/// Focal length, parts of the picture's width: 600 px of 848.
const FOCAL: f64 = 600.0 / 848.0;
/// Range, m, and tilts about x and y, degrees.
const SCENES: [(f64, f64, f64); 12] = [
    (0.4, 0.0, 0.0),
    (0.6, 3.0, -5.0),
    (0.8, 0.0, 20.0),
    (1.2, 0.0, 0.0),
    (1.2, 20.0, 0.0),
    (1.2, 0.0, -40.0),
    (1.6, -30.0, 15.0),
    (2.0, 0.0, 20.0),
    (2.0, 0.0, 40.0),
    (3.0, 10.0, 0.0),
    (4.0, 0.0, 5.0),
    (6.0, 0.0, -10.0),
];

/// Mean of many runs, microseconds of this thread's time on a core: the kernel counts it by ticks, so that one run shows nothing. The least of [`ROUNDS`] such means, for others
/// on the core make it longer.
fn mean_time<T>(mut stage: impl FnMut() -> T) -> f64 {
    std::hint::black_box(stage());
    let begin = Instant::now();
    let mut mean = || {
        let (start, mut runs) = (cpu_seconds(begin), 0);
        loop {
            std::hint::black_box(stage());
            runs += 1;
            let time = cpu_seconds(begin) - start;
            if time > ENOUGH_SECONDS {
                return time / f64::from(runs) * 1e6;
            }
        }
    };
    (0..ROUNDS).map(|_| mean()).fold(f64::INFINITY, f64::min)
}

/// Time of this thread on a core, where the kernel tells (Linux); otherwise time since `begin`.
fn cpu_seconds(begin: Instant) -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split(' ').next().and_then(|first| first.parse::<f64>().ok());
    nanoseconds.map_or_else(|| begin.elapsed().as_secs_f64(), |nanoseconds| nanoseconds * 1e-9)
}

fn write_pgm(path: &Path, picture: &Image<u8>) -> std::io::Result<()> {
    let mut bytes = format!("P5\n{} {}\n255\n", picture.width(), picture.height()).into_bytes();
    bytes.extend_from_slice(picture.data());
    std::fs::write(path, bytes)
}

fn print_pose(name: &str, method: &str, found: Option<&ThesisEstimate>) {
    match found {
        Some(found) => {
            let n = found.plane.normal;
            println!("pose,{name},{method},{},{},{},{},{}", found.range(), n.x, n.y, n.z, found.probability);
        }
        None => println!("pose,{name},{method},,,,,0"),
    }
}

/// The thesis's whole frame: four sections, the plane, the cells' area all over it, junctions from contours.
struct WholeFrame {
    camera: Camera,
    sections: ThesisEstimator,
    contours: JunctionDetector,
}

impl WholeFrame {
    fn new(camera: &Camera, mesh: &Mesh) -> Result<Self, Box<dyn Error>> {
        // The drawn twine is light, and Algorithm 4 looks for light twine only, as the peer does.
        let config = net_junction::Config { polarity: Polarity::Light, ..net_junction::Config::thesis() };
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        let contours = JunctionDetector::new(width, height, &config)?;
        Ok(Self {
            camera: *camera,
            sections: ThesisEstimator::new(camera, mesh, &ThesisConfig::thesis(false))?,
            contours,
        })
    }

    /// Number of junctions; `None` without a plane.
    fn run(&mut self, picture: View<'_, u8>) -> Result<Option<usize>, Box<dyn Error>> {
        let Some(found) = self.sections.estimate(picture)? else { return Ok(None) };
        let area = CellArea::on_plane(found.axis_cell_area, found.plane, self.camera);
        Ok(Some(self.contours.detect(picture, Some(&Expectation::Area(area)))?.len()))
    }
}

/// Times every stage of `picture`.
fn time_stages(name: &str, picture: View<'_, u8>) -> Result<(), Box<dyn Error>> {
    let time = |stage: &str, microseconds: f64| println!("time,{name},{stage},{microseconds}");
    let numbers: Vec<f32> = picture.rows().flat_map(|row| row.iter().map(|&level| f32::from(level))).collect();
    let numbers = View::packed(&numbers, picture.width(), picture.height())?;
    let (mut fft, mut half) = (RealFft2::new(picture.width(), picture.height())?, HalfSpectrum::default());
    time("real 2-D transform of the picture", mean_time(|| fft.forward(numbers, &mut half)));

    let (width, height) = (picture.width() / 2, picture.height() / 2);
    let section = picture.crop(0, 0, width, height).ok_or("no section")?;
    let (mut plan, mut drawn) = (SpectrumPlan::new(width, height, Window::Hann)?, SpectrumImage::default());
    time(
        "spectrum of a section",
        mean_time(|| {
            let done = plan.transform(section, &mut half);
            drawn.draw(&half, Bins::All, SpectrumImageConfig::default());
            done
        }),
    );
    let config = SectionConfig::thesis(false);
    let (mut finder, view) = (PeakFinder::default(), drawn.view().ok_or("no spectrum")?);
    time("peaks of a section", mean_time(|| finder.find(view, drawn.constant_bin(), &config.peaks).len()));
    let mut analyser = SectionAnalyser::new(width, height, &config)?;
    let mut spectrum = SectionSpectrum::default();
    time("section to scored wave vectors", mean_time(|| analyser.analyse(section, &mut spectrum)));
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let [folder, width, height] = arguments.as_slice() else { return Err("FOLDER WIDTH HEIGHT".into()) };
    let (width, height): (u32, u32) = (width.parse()?, height.parse()?);
    let (wide, high) = (f64::from(width), f64::from(height));
    let camera = Camera::new(FOCAL * wide, FOCAL * wide, wide / 2.0, high / 2.0, width, height, Lens::None)?;
    let mesh = Mesh::square(0.05)?;
    let mut simulator = Simulator::new(camera);
    let mut thesis = ThesisEstimator::new(&camera, &mesh, &ThesisConfig::thesis(false))?;
    let mut together = ThesisEstimator::new(&camera, &mesh, &ThesisConfig::default())?;
    let mut frame = WholeFrame::new(&camera, &mesh)?;
    let mut picture = Image::default();
    for (seed, (range_m, tilt_x_deg, tilt_y_deg)) in SCENES.into_iter().enumerate() {
        let name = format!("{range_m} m {tilt_x_deg} {tilt_y_deg}");
        let pose = NetPose { range_m, tilt_x_deg, tilt_y_deg, roll_deg: 4.0, x_m: 0.013, y_m: -0.007 };
        let scene = Scene { layers: vec![Layer::planar(&mesh, pose)], ..Scene::default() };
        let truth = simulator.render(&scene, seed as u64, &mut picture)?;
        let axis = truth.layers.first().and_then(|layer| layer.axis).ok_or("no truth")?;
        write_pgm(&Path::new(folder).join(format!("{name}.pgm")), &picture)?;
        println!("truth,{name},{},{},{},{}", axis.range_m, axis.normal.x, axis.normal.y, axis.normal.z);
        let view = picture.view().ok_or("no picture")?;
        time_stages(&name, view)?;
        println!("time,{name},four sections to the plane,{}", mean_time(|| thesis.estimate(view).is_ok()));
        println!("time,{name},whole frame with junctions,{}", mean_time(|| frame.run(view).is_ok()));
        println!("junctions,{name},{}", frame.run(view)?.unwrap_or_default());
        println!("time,{name},default: all sections together,{}", mean_time(|| together.estimate(view).is_ok()));
        print_pose(&name, "thesis", thesis.estimate(view)?.as_ref());
        print_pose(&name, "default", together.estimate(view)?.as_ref());
        println!("done,{name}");
        std::io::stdin().read_line(&mut String::new())?;
    }
    Ok(())
}
