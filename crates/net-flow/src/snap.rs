//! Stage 6b, optional: tracks put on the nearest detected junction, as the thesis proposes against drift (section 6.5).
//!
//! It helps a track that drifts and harms a good one: detected junctions scatter by more than a match with the key frame does.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::Vector2;

/// Moves each of `pixels` to the nearest of `junctions` within `radius_px`; how many moved. Junctions that are not finite are left out. Choose the radius
/// well below half a cell. (The tree is built anew for each call: this stage allocates.)
pub fn snap(pixels: &mut [Vector2<f64>], junctions: &[Vector2<f64>], radius_px: f64) -> usize {
    let finite = |p: &Vector2<f64>| p.x.is_finite() && p.y.is_finite();
    let places: Vec<[f64; 2]> = junctions.iter().filter(|p| finite(p)).map(|p| [p.x, p.y]).collect();
    if places.is_empty() {
        return 0;
    }
    let Ok(tree) = ImmutableKdTree::<f64, 2>::new_from_slice(&places) else { return 0 };
    let mut moved = 0;
    for pixel in pixels.iter_mut().filter(|p| finite(p)) {
        let nearest = tree.query(&[pixel.x, pixel.y]).nearest_one::<SquaredEuclidean<f64>>().execute();
        if nearest.distance <= radius_px * radius_px
            && let Some(&[u, v]) = usize::try_from(nearest.item).ok().and_then(|i| places.get(i))
        {
            *pixel = Vector2::new(u, v);
            moved += 1;
        }
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moves_what_is_near_and_only_that() {
        let junctions: Vec<_> = (0..400)
            .map(|i| Vector2::new(f64::from(i % 20) * 30.0, f64::from(i / 20) * 30.0))
            .chain([Vector2::new(f64::NAN, 0.0)])
            .collect();
        let mut pixels = [Vector2::new(61.5, 28.0), Vector2::new(75.0, 45.0), Vector2::new(f64::NAN, 1.0)];
        assert_eq!(snap(&mut pixels, &junctions, 9.0), 1);
        assert_eq!(pixels[0], Vector2::new(60.0, 30.0));
        assert_eq!(pixels[1], Vector2::new(75.0, 45.0));
        assert_eq!(snap(&mut pixels, &[], 9.0), 0);
    }

    #[test]
    fn a_column_of_equal_coordinates_is_no_obstacle() {
        // Trees split by coordinates; junctions of a straight net share many.
        let junctions: Vec<_> = (0..500).map(|i| Vector2::new(10.0, f64::from(i))).collect();
        let mut pixels = [Vector2::new(10.4, 250.2)];
        assert_eq!(snap(&mut pixels, &junctions, 1.0), 1);
        assert_eq!(pixels[0], Vector2::new(10.0, 250.0));
    }
}
