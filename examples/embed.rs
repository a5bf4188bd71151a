//! The tracker inside a vehicle: a camera driver hands over frames, the control loop gets the net. No file, no decoder, no thread.
//!
//! ```text
//! cargo run --release --no-default-features --example embed
//! ```
//!
//! In a vehicle's `Cargo.toml`: `netpose = { path = "...", default-features = false }`.

use netpose::{Camera, Config, GrayView, Lens, Mesh, Status, Tracker};

/// What the vehicle knows of its net after a frame.
enum NetSight {
    /// Where it is: keep the stand-off, face it, follow it along.
    Here { range_m: f64, sigma_range_m: f64, tilt_deg: f64, along_m: [f64; 2], count: u32 },
    /// Nothing that could be vouched for: hold what was known, slow down, do not steer by guesses.
    NotNow,
}

/// The part that goes into a vehicle stack.
struct NetSensor {
    tracker: Tracker,
}

impl NetSensor {
    /// Once, at start: all buffers are made here and in the first frames.
    fn new(camera: Camera, mesh: Mesh) -> Result<Self, netpose::Error> {
        Ok(Self { tracker: Tracker::new(camera, mesh, &Config::default())? })
    }

    /// For every frame: the driver's own buffer is borrowed, its rows may have padding behind them.
    fn on_frame(&mut self, pixels: &[u8], stride: usize, timestamp_ns: i64) -> Result<NetSight, netpose::Error> {
        let view = GrayView::new(pixels, 848, 480, stride)?;
        let estimate = self.tracker.update(view, timestamp_ns)?;
        let Some(net) = estimate.net.filter(|_| estimate.status == Status::Ok) else { return Ok(NetSight::NotNow) };
        let camera = net.pose.camera_in_net();
        Ok(NetSight::Here {
            range_m: net.range_m,
            sigma_range_m: net.sigma_range_m,
            tilt_deg: net.normal.xy().norm().atan2(net.normal.z).to_degrees(),
            along_m: [camera.x, camera.y],
            count: estimate.track,
        })
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // From the calibration and from the net's papers.
    let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None)?;
    let mut sensor = NetSensor::new(camera, Mesh::square(0.05)?)?;

    let mut driver = Driver::new(camera)?;
    while let Some(frame) = driver.next_frame()? {
        match sensor.on_frame(frame.pixels, frame.stride, frame.timestamp_ns) {
            Ok(NetSight::Here { range_m, sigma_range_m, tilt_deg, along_m: [x, y], count }) => println!(
                "net at {range_m:.3} ± {sigma_range_m:.3} m, tilted {tilt_deg:.1}°; along it {x:+.3}, {y:+.3} m (count {count})"
            ),
            Ok(NetSight::NotNow) => println!("no net that could be vouched for"),
            // A frame out of order or of another size: the tracker is as it was before.
            Err(error) => eprintln!("frame refused: {error}"),
        }
    }
    Ok(())
}

/// A frame in the driver's buffer.
struct DriverFrame<'a> {
    /// Grey, row by row.
    pixels: &'a [u8],
    /// Values from one row to the next.
    stride: usize,
    timestamp_ns: i64,
}

/// Stands in for the camera: a simulated dive along a net.
struct Driver {
    dive: net_sim::Scenario,
    simulator: net_sim::Simulator,
    picture: net_sim::Image<u8>,
    next: u32,
}

impl Driver {
    fn new(camera: Camera) -> Result<Self, net_sim::Error> {
        let mut dive = net_sim::Scenario::by_name("strafe-slow")?;
        dive.frames = 20;
        Ok(Self { dive, simulator: net_sim::Simulator::new(camera), picture: net_sim::Image::default(), next: 0 })
    }

    /// `None` when the dive is over.
    fn next_frame(&mut self) -> Result<Option<DriverFrame<'_>>, net_sim::Error> {
        if self.next == self.dive.frames {
            return Ok(None);
        }
        let frame = self.dive.frame(self.next)?;
        self.next += 1;
        self.simulator.render(&frame.scene, frame.seed, &mut self.picture)?;
        let stride = self.picture.width();
        Ok(Some(DriverFrame { pixels: self.picture.data(), stride, timestamp_ns: frame.timestamp_ns }))
    }
}
