//! Pictures for people: the frame with what was found in it.

mod canvas;
mod net;
mod spectrum;
mod text;

use std::path::Path;

use anyhow::Result;
use net_image::GrayView;
use netpose::{Camera, Junction, Mesh, NetPose, Status, Twine};

pub use canvas::{Canvas, Colour};

const GOOD: Colour = [150, 255, 150];
const NO_NET: Colour = [255, 190, 120];

/// What a picture is to show.
#[derive(Debug, Clone, Copy)]
pub struct Shown<'a> {
    pub status: Status,
    pub probability: f64,
    pub net: Option<&'a NetPose>,
    pub junctions: &'a [Junction],
    pub twines: &'a [Twine],
    pub latency_ms: f64,
}

/// Draws frames of one camera and one mesh.
#[derive(Debug)]
pub struct Overlay {
    pub camera: Camera,
    pub mesh: Mesh,
}

impl Overlay {
    /// The frame with lattice, junctions, axes and a status line that begins with `name`.
    pub fn draw(&self, gray: GrayView<'_>, name: &str, shown: &Shown<'_>) -> Canvas {
        let mut canvas = Canvas::from_gray(gray);
        let named = net::draw_twine(&mut canvas, shown.junctions, shown.twines);
        let lattice = shown.net.map(|net| (&net.pose, self.mesh_as_it_hangs(net)));
        if let Some((pose, mesh)) = lattice.filter(|_| !named) {
            net::draw_lattice(&mut canvas, &self.camera, &mesh, pose);
        }
        for junction in shown.junctions {
            net::draw_junction(&mut canvas, junction);
        }
        if let Some((pose, mesh)) = lattice {
            net::draw_axes(&mut canvas, &self.camera, &mesh, pose);
        }
        let colour = if shown.status == Status::Ok { GOOD } else { NO_NET };
        canvas.status(&status_lines(name, shown), colour);
        canvas
    }

    /// The frame's spectrum with its peaks, and the lattice's wave vectors where there is a pose.
    pub fn spectrum(&self, gray: GrayView<'_>, shown: &Shown<'_>) -> Option<Canvas> {
        let net = shown.net.map(|net| (net.pose, self.mesh_as_it_hangs(net)));
        spectrum::draw_spectrum(gray, net.as_ref().map(|(pose, mesh)| (&self.camera, mesh, pose)))
    }

    /// Writes both pictures as JPEG: `stem.jpg` and `stem_spectrum.jpg`.
    pub fn write(&self, gray: GrayView<'_>, name: &str, shown: &Shown<'_>, dir: &Path, stem: &str) -> Result<()> {
        self.draw(gray, name, shown).write_jpeg(&dir.join(format!("{stem}.jpg")))?;
        match self.spectrum(gray, shown) {
            Some(spectrum) => spectrum.write_jpeg(&dir.join(format!("{stem}_spectrum.jpg"))),
            None => Ok(()),
        }
    }

    /// The mesh with the crossing angle that was estimated, if one was.
    fn mesh_as_it_hangs(&self, net: &NetPose) -> Mesh {
        let sheared =
            |sheet: netpose::Sheet| Mesh::oblique(self.mesh.side1(), self.mesh.side2(), sheet.crossing_angle).ok();
        net.sheet.and_then(sheared).unwrap_or(self.mesh)
    }
}

fn status_lines(name: &str, shown: &Shown<'_>) -> Vec<String> {
    let mut lines = vec![format!(
        "{name}  {}  p {:.2}  {} junctions  {:.0} ms",
        shown.status.as_str(),
        shown.probability,
        shown.junctions.len(),
        shown.latency_ms
    )];
    if let Some(net) = shown.net {
        let n = net.normal;
        lines.push(format!(
            "range {:.3} m  tilt {:.1} deg (about x {:+.1}, about y {:+.1})",
            net.range_m,
            n.xy().norm().atan2(n.z).to_degrees(),
            (-n.y).atan2(n.z).to_degrees(),
            n.x.atan2(n.z).to_degrees(),
        ));
    }
    lines
}

#[cfg(test)]
mod tests {
    use net_geometry::nalgebra::{Matrix6, Rotation3, Vector2, Vector3};
    use netpose::{JunctionState, Lens, Pose};

    use super::*;

    /// The status is read against any picture, and hides no more of it than its letters and their edges.
    #[test]
    fn the_status_hides_the_picture_behind_its_letters_only() {
        for grey in [0, 255] {
            let plain = net_image::Image::from_vec(vec![grey; 848 * 60], 848, 60).unwrap();
            let mut canvas = Canvas::from_gray(plain.view().unwrap());
            canvas.status(&["frame 7  ok".to_owned(), "range 1.200 m".to_owned()], GOOD);
            let count = |wanted: Colour| {
                let pixels = (0..60).flat_map(|v| (0..848).map(move |u| (u, v)));
                pixels.filter(|&(u, v)| canvas.pixel(u, v) == wanted).count()
            };
            let (letters, untouched) = (count(GOOD), count([grey; 3]));
            assert!(letters > 300, "{letters}");
            // 24 characters of 9 x 18 px and their edges; all the rest is the picture.
            assert!((848 * 60 - 24 * 11 * 20..848 * 60).contains(&untouched), "{untouched}");
            assert_eq!(canvas.pixel(840, 3), [grey; 3]);
        }
    }

    /// A missing twine is red from knot to knot, one that looks gone in dashes: neither is drawn like one that is there.
    #[test]
    fn twines_have_the_colour_of_their_state() {
        let camera = Camera::new(600.0, 600.0, 99.5, 99.5, 200, 200, Lens::None).unwrap();
        let knot = |k: i32| Junction {
            pixel: Vector2::new(f64::from(65 + 50 * k), 150.0),
            index: Some((k, 0)),
            sigma_px: 0.1,
            state: JunctionState::Seen,
        };
        let twine =
            |k: i32, state| Twine { index: (k - 1, 0), direction: 0, state, llr: 0.0, contrast: 5.0, width_px: None };
        let states = [netpose::TwineState::Present, netpose::TwineState::Missing, netpose::TwineState::Doubtful];
        let twines = &[0, 1, 2].map(|k| twine(k, states[k as usize]));
        let junctions = &[knot(-1), knot(0), knot(1), knot(2)];
        let shown = Shown { status: Status::Ok, probability: 0.9, net: None, junctions, twines, latency_ms: 5.0 };
        let dark = net_image::Image::<u8>::new(200, 200);
        let overlay = Overlay { camera, mesh: Mesh::square(0.05).unwrap() };
        let canvas = overlay.draw(dark.view().unwrap(), "frame 7", &shown);
        // Between the rings.
        let row = |from: usize| (from..from + 26).map(|u| canvas.pixel(u, 150)).collect::<Vec<Colour>>();
        let red = |c: &&Colour| c[0] > 200 && c[2] < 60;
        let [present, missing, doubtful] = [row(27), row(77), row(127)];
        assert!(present.iter().all(|c| c[2] > 100 && c[0] < 60), "{present:?}");
        assert_eq!(missing.iter().filter(red).count(), 26, "{missing:?}");
        let (dashes, gaps) = (doubtful.iter().filter(red).count(), doubtful.iter().filter(|c| c[0] < 60).count());
        assert!(dashes > 5 && gaps > 12 && doubtful.iter().all(|c| c[2] < 60), "{doubtful:?}");
    }

    /// The lattice is drawn where the pose says: bright lines on the nodes, nothing in the middle of the cells.
    #[test]
    fn the_lattice_is_drawn_where_the_pose_says() {
        let camera = Camera::new(600.0, 600.0, 423.5, 239.5, 848, 480, Lens::None).unwrap();
        let mesh = Mesh::rectangular(0.05, 0.04).unwrap();
        let rotation = Rotation3::from_euler_angles(0.5, -0.2, 0.3);
        let pose = Pose { rotation, translation: Vector3::new(0.03, 0.01, 0.9) };
        let plane = pose.plane();
        let net = NetPose {
            pose,
            covariance: Matrix6::zeros(),
            range_m: plane.range().unwrap(),
            distance_m: plane.distance,
            normal: plane.normal,
            sigma_range_m: 0.0,
            sigma_tilt: 0.0,
            sigma_xy_m: 0.0,
            sheet: None,
        };
        let hidden =
            Junction { pixel: Vector2::new(700.0, 400.0), index: None, sigma_px: 0.1, state: JunctionState::Hidden };
        let junctions = &[hidden];
        let shown =
            Shown { status: Status::Ok, probability: 0.9, net: Some(&net), junctions, twines: &[], latency_ms: 5.0 };
        let dark = net_image::Image::<u8>::new(848, 480);
        let canvas = Overlay { camera, mesh }.draw(dark.view().unwrap(), "frame 7", &shown);
        let light = |i: f64, j: f64| {
            let node = mesh.node(i, j);
            let p = camera.pixel_from_point(pose.transform(Vector3::new(node.x, node.y, 0.0))).unwrap();
            let at = (p.x.round() as usize, p.y.round() as usize);
            (at.0 < 848 && (60..480).contains(&at.1))
                .then(|| canvas.pixel(at.0, at.1).map(u32::from).iter().sum::<u32>())
        };
        // Beyond the axes, which are two cells long.
        let cells = || {
            (-6..6)
                .flat_map(|i| (-6..6).map(move |j| (f64::from(i), f64::from(j))))
                .filter(|&(i, j)| i < -1.0 || j > 3.0)
        };
        let on: Vec<u32> = cells().filter_map(|(i, j)| light(i, j)).collect();
        let off: Vec<u32> = cells().filter_map(|(i, j)| light(i + 0.5, j + 0.5)).collect();
        assert!(on.len() > 20 && on.iter().all(|&g| g > 150), "{on:?}");
        assert!(off.len() > 20 && off.iter().all(|&g| g == 0), "{off:?}");
    }
}
