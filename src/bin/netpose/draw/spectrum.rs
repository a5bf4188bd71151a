//! The picture's spectrum with its peaks, and where the pose says that they should be.

use net_fft::{Bins, HalfSpectrum, PeakConfig, PeakFinder, SpectrumImage, SpectrumImageConfig, SpectrumPlan, Window};
use net_geometry::Basis;
use net_geometry::nalgebra::{Matrix2, Vector2, Vector3};
use net_image::GrayView;
use netpose::{Camera, Mesh, Pose};

use super::canvas::{Canvas, Colour};

const PEAK: Colour = [255, 190, 40];
const WAVES: [Colour; 2] = [[255, 70, 70], [70, 230, 70]];
/// Peaks drawn at most, the strongest.
const MOST_PEAKS: usize = 80;

/// The log magnitude of the whole picture's spectrum, zero in the middle, strong peaks ringed; with a pose, the two wave vectors of the lattice where the
/// optical axis meets it. `None` for a picture too small to have a spectrum.
pub fn draw_spectrum(gray: GrayView<'_>, net: Option<(&Camera, &Mesh, &Pose)>) -> Option<Canvas> {
    let (width, height) = (gray.width(), gray.height());
    let mut plan = SpectrumPlan::new(width, height, Window::default()).ok()?;
    let (mut half, mut image) = (HalfSpectrum::default(), SpectrumImage::default());
    plan.transform(gray, &mut half).ok()?;
    image.draw(&half, Bins::All, SpectrumImageConfig::default());
    let view = image.view()?;
    let zero = image.constant_bin();
    let centre = Vector2::new(zero.0 as f64, zero.1 as f64);
    let mut canvas = Canvas::from_gray(view);
    let mut finder = PeakFinder::default();
    let mut peaks = finder.find(view, zero, &PeakConfig::default()).to_vec();
    peaks.sort_by(|a, b| b.level.total_cmp(&a.level));
    for peak in peaks.iter().take(MOST_PEAKS) {
        canvas.ring(centre + peak.bin, 4.0, 1.2, PEAK, 0.9);
    }
    let waves = net.and_then(|(camera, mesh, pose)| wave_vectors(camera, mesh, pose));
    for (wave, colour) in waves.into_iter().flatten().zip(WAVES) {
        // Cycles per pixel to cycles per width and per height.
        let bin = Vector2::new(wave.x * width as f64, wave.y * height as f64);
        canvas.line(centre, centre + bin, 2.0, colour, 0.9);
    }
    Some(canvas)
}

/// Wave vectors, cycles per pixel, of the lattice where the optical axis meets it.
fn wave_vectors(camera: &Camera, mesh: &Mesh, pose: &Pose) -> Option<[Vector2<f64>; 2]> {
    let foot = pose.inverse_transform(Vector3::z() * pose.plane().range()?);
    let pixel =
        |offset: Vector2<f64>| camera.pixel_from_point(pose.transform(foot + Vector3::new(offset.x, offset.y, 0.0)));
    // Differences over a hundredth of a cell: the lattice vectors there, not their mean over a cell.
    let step = 0.01;
    let along = |a: Vector2<f64>| Some((pixel(a * step)? - pixel(-a * step)?) / (2.0 * step));
    let lattice = Matrix2::from_columns(&[along(mesh.a1())?, along(mesh.a2())?]);
    let basis = Basis { b1: lattice.column(0).into_owned(), b2: lattice.column(1).into_owned() };
    basis.wave_vectors().ok().map(|(k1, k2)| [k1, k2])
}

#[cfg(test)]
mod tests {
    use net_geometry::nalgebra::Rotation3;
    use netpose::Lens;

    use super::*;

    /// A net straight ahead, 30 px a cell: one wave in 30 px along u and one along v.
    #[test]
    fn wave_vectors_are_the_inverse_of_the_cells() {
        let camera = Camera::new(600.0, 600.0, 424.0, 240.0, 848, 480, Lens::None).unwrap();
        let mesh = Mesh::rectangular(0.05, 0.04).unwrap();
        let pose = Pose { rotation: Rotation3::identity(), translation: Vector3::new(0.3, 0.1, 1.0) };
        let [k1, k2] = wave_vectors(&camera, &mesh, &pose).unwrap();
        assert!((k1 - Vector2::new(1.0 / 30.0, 0.0)).norm() < 1e-12, "{k1}");
        assert!((k2 - Vector2::new(0.0, 1.0 / 24.0)).norm() < 1e-12, "{k2}");
    }

    #[test]
    fn a_single_pixel_does_no_harm() {
        let image = net_image::Image::<u8>::new(1, 1);
        assert!(draw_spectrum(image.view().unwrap(), None).is_none_or(|canvas| canvas.width() == 1));
    }
}
