//! Draws the fitted lattice over a picture, twice as large: X-family green, the other orange.

use std::path::Path;

use net_geometry::Camera;
use net_geometry::nalgebra::Vector2;
use net_lattice::LatticeEstimate;

/// Writes the overlay; says so on standard error if it cannot.
pub fn overlay(path: &Path, gray: &image::GrayImage, camera: &Camera, e: &LatticeEstimate) {
    let up = 2u32;
    let (w, h) = gray.dimensions();
    let mut out = image::RgbImage::new(w * up, h * up);
    let at = |u: u32, v: u32| {
        let p = Vector2::new((f64::from(u) + 0.5) / f64::from(up) - 0.5, (f64::from(v) + 0.5) / f64::from(up) - 0.5);
        e.lattice_from_pixel(camera, p)
    };
    let mut above: Vec<Option<Vector2<f64>>> = vec![None; (w * up) as usize];
    for v in 0..h * up {
        let mut left: Option<Vector2<f64>> = None;
        for u in 0..w * up {
            let g = gray.get_pixel(u / up, v / up).0[0];
            let mut rgb = [g, g, g];
            let here = at(u, v);
            if let (Some(a), Some(b), Some(c)) = (here, left, above[u as usize]) {
                let crosses = |f: usize| a[f].floor() != b[f].floor() || a[f].floor() != c[f].floor();
                let wide = |f: usize| (a[f] - b[f]).abs().max((a[f] - c[f]).abs()) < 0.15;
                if crosses(0) && wide(0) {
                    rgb = [0, 255, 0];
                } else if crosses(1) && wide(1) {
                    rgb = [255, 80, 0];
                }
            }
            out.put_pixel(u, v, image::Rgb(rgb));
            left = here;
            above[u as usize] = here;
        }
    }
    if let Err(error) = out.save(path) {
        eprintln!("{}: {error}", path.display());
    }
}
