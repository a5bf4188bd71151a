//! Which openings are meshes of the net: size, shape and foreshortening.

use net_geometry::nalgebra::Vector2;

use crate::contour::config::{Config, Shape};
use crate::contour::expectation::ExpectedCell;
use crate::contour::outline::{Huller, Outline};
use crate::contour::quadrilateral::{Quadrilateral, fit_quadrilateral};
use crate::contour::rectangle::{min_area_parallelogram, min_area_rectangle};

/// Why an opening was taken for a mesh of the net, or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// A mesh.
    Accepted,
    /// The picture's end cuts it.
    Cut,
    /// No net can be seen here, by the expectation.
    NotExpected,
    /// Its area is below the window.
    TooSmall,
    /// Its area is above the window: meshes run together where twine is not seen.
    TooLarge,
    /// No rectangle or quadrilateral fits it.
    NoShape,
    /// Too oblong where no pose says what a cell looks like.
    NotSquare,
    /// A side is too short or too long for the expected cell.
    WrongSides,
    /// Its sides do not run along the expected cell's.
    Skewed,
    /// It fills too little or too much of the shape around it.
    NotFilled,
    /// Its outline strays from straight sides.
    Ragged,
    /// Twine of the other polarity closes a mesh here already.
    OtherPolarity,
}

/// An opening with the shape around it.
#[derive(Debug, Clone, PartialEq)]
pub struct CellBox {
    /// Corners of the rectangle or quadrilateral in the sense from u to v, px; of rejected ones possibly of a bounding box.
    pub corners: [Vector2<f64>; 4],
    /// Area inside the outline, px².
    pub area: f64,
    /// Area of a whole cell expected here, px², from knot to knot; zero where none can be.
    pub expected_area: f64,
    /// Least distance between neighbouring junctions expected here, px.
    pub(crate) spacing: f64,
    /// Root mean square distance of the outline from the shape's sides, px; zero if it was not fitted.
    pub rms_px: f64,
    /// Whether the twine around it is lighter than its surroundings.
    pub light: bool,
    /// Accepted, or the reason against it.
    pub verdict: Verdict,
    /// Where its outline begins in the kept points, and how many there are.
    pub(crate) outline: (usize, usize),
}

impl CellBox {
    /// Mean of the corners, px.
    pub fn centre(&self) -> Vector2<f64> {
        self.corners.iter().sum::<Vector2<f64>>() * 0.25
    }
}

/// Buffers of this stage.
#[derive(Debug, Default)]
pub(crate) struct Shaper {
    huller: Huller,
    /// The outline's points, px.
    points: Vec<Vector2<f64>>,
    heights: Vec<f64>,
}

impl Shaper {
    /// Makes room for outlines of up to `longest` crossings.
    pub fn reserve(&mut self, longest: usize) {
        self.huller.reserve(longest);
        self.points.clear();
        self.points.reserve(longest);
    }

    /// Lays the shape around an outline and judges it. `cell` is what is expected at the outline's middle.
    pub fn judge(&mut self, outline: &Outline, cell: Option<ExpectedCell>, light: bool, config: &Config) -> CellBox {
        let mut found = CellBox {
            corners: [Vector2::zeros(); 4],
            area: outline.area,
            expected_area: cell.map_or(0.0, |c| c.area),
            spacing: cell.map_or(0.0, |c| c.spacing()),
            rms_px: 0.0,
            light,
            verdict: Verdict::Accepted,
            outline: (0, 0),
        };
        found.verdict = match cell {
            _ if outline.cut => Verdict::Cut,
            None => Verdict::NotExpected,
            Some(cell) if outline.area < config.area_min * cell.area => Verdict::TooSmall,
            Some(cell) if outline.area > config.area_max * cell.area => Verdict::TooLarge,
            Some(cell) => self.fit(outline, &cell, config, &mut found),
        };
        if found.verdict != Verdict::Accepted && found.corners[0] == found.corners[2] {
            found.corners = bounding_box(outline);
        }
        found
    }

    fn fit(&mut self, outline: &Outline, cell: &ExpectedCell, config: &Config, found: &mut CellBox) -> Verdict {
        let Some(quad) = self.shape(outline, cell, config) else { return Verdict::NoShape };
        found.corners = quad.corners;
        if cell.basis.is_none() {
            first_side_along_u(&mut found.corners);
        }
        found.rms_px = quad.rms;
        let [a, b, c, d] = found.corners;
        let side1 = (b - a + c - d) * 0.5;
        let side2 = (d - a + c - b) * 0.5;
        let (long, short) = (side1.norm().max(side2.norm()), side1.norm().min(side2.norm()));
        let area = 0.5 * (c - a).perp(&(d - b));
        if !(area > 0.0 && short > 0.0) {
            return Verdict::NoShape;
        }
        let verdict = match (config.shape, cell.basis) {
            (Shape::Quadrilateral, Some(basis)) => against_cell(side1, side2, basis, config),
            _ if short < config.squareness_min * long => Verdict::NotSquare,
            _ => Verdict::Accepted,
        };
        let fill = found.area / area;
        if verdict != Verdict::Accepted {
            verdict
        } else if !(config.fill_min..=config.fill_max).contains(&fill) {
            Verdict::NotFilled
        } else if quad.rms > config.ragged_max * area.sqrt() {
            Verdict::Ragged
        } else {
            Verdict::Accepted
        }
    }

    fn shape(&mut self, outline: &Outline, cell: &ExpectedCell, config: &Config) -> Option<Quadrilateral> {
        if config.shape == Shape::Quadrilateral {
            self.points.clear();
            self.points.extend(outline.pixels());
        }
        match (config.shape, cell.basis) {
            (Shape::Rectangle, _) => {
                let rectangle = min_area_rectangle(self.huller.hull(outline))?;
                Some(Quadrilateral { corners: rectangle.corners(), rms: 0.0 })
            }
            (Shape::Quadrilateral, Some(basis)) => {
                let b2 = if basis.cell_area() > 0.0 { basis.b2 } else { -basis.b2 };
                fit_quadrilateral(&self.points, basis.b1, b2)
            }
            (Shape::Quadrilateral, None) => {
                let (_, half1, half2) = min_area_parallelogram(self.huller.hull(outline), &mut self.heights)?;
                fit_quadrilateral(&self.points, half1, half2)
            }
        }
    }
}

/// Turns the order of the corners so that the first side is the one nearest to the u axis: neighbours are then labelled alike.
fn first_side_along_u(corners: &mut [Vector2<f64>; 4]) {
    let [a, b, c, d] = *corners;
    let (side1, side2) = (b - a + c - d, d - a + c - b);
    let steep = |s: Vector2<f64>| s.y.abs() / s.norm();
    let turns = match (steep(side1) <= steep(side2), side1.x >= 0.0, side2.x >= 0.0) {
        (true, true, _) => 0,
        (true, false, _) => 2,
        // Corner d becomes the first, and the side from d to c the first side.
        (false, _, true) => 3,
        (false, _, false) => 1,
    };
    corners.rotate_left(turns);
}

/// Holds an opening's sides against the expected cell's: in the cell's own coordinates an opening is an upright square, however tilted.
fn against_cell(side1: Vector2<f64>, side2: Vector2<f64>, basis: net_geometry::Basis, config: &Config) -> Verdict {
    let cross = basis.b1.perp(&basis.b2);
    let in_cell = |s: Vector2<f64>| (s.perp(&basis.b2) / cross, basis.b1.perp(&s) / cross);
    let ((along1, off1), (off2, along2)) = (in_cell(side1), in_cell(side2));
    let (along1, along2) = (along1.abs(), along2.abs());
    if along1.min(along2) < config.side_min || along1.max(along2) > config.side_max {
        Verdict::WrongSides
    } else if off1.abs() > config.skew_max * along1 || off2.abs() > config.skew_max * along2 {
        Verdict::Skewed
    } else {
        Verdict::Accepted
    }
}

fn bounding_box(outline: &Outline) -> [Vector2<f64>; 4] {
    let bounds = outline.pixels().map(|p| (p, p)).reduce(|(low, high), (p, _)| (low.inf(&p), high.sup(&p)));
    let Some((low, high)) = bounds else { return [Vector2::zeros(); 4] };
    [low, Vector2::new(high.x, low.y), high, Vector2::new(low.x, high.y)]
}

#[cfg(test)]
mod tests {
    use net_geometry::Basis;

    use super::*;
    use crate::contour::outline::Crossing;

    fn outline_of(corners: [(f64, f64); 4]) -> Vec<Crossing> {
        let corners = corners.map(|(x, y)| Vector2::new(x, y) * f64::from(Crossing::PARTS));
        let points = (0..4).flat_map(|k| {
            (0..20).map(move |i| corners[k] + (corners[(k + 1) % 4] - corners[k]) * (f64::from(i) / 20.0))
        });
        points.map(|p| Crossing { x: p.x.round() as i32, y: p.y.round() as i32 }).collect()
    }

    fn judge(corners: [(f64, f64); 4], basis: Option<Basis>, config: &Config) -> Verdict {
        let crossings = outline_of(corners);
        let outline = Outline::of(&crossings, false, false);
        let area = basis.map_or(400.0, |b| b.cell_area().abs());
        Shaper::default().judge(&outline, Some(ExpectedCell { area, basis }), true, config).verdict
    }

    fn basis(b1: (f64, f64), b2: (f64, f64)) -> Option<Basis> {
        Some(Basis { b1: Vector2::new(b1.0, b1.1), b2: Vector2::new(b2.0, b2.1) })
    }

    #[test]
    fn a_foreshortened_mesh_is_a_mesh_where_the_pose_says_so() {
        // 60 degrees of tilt: half as wide as high.
        let opening = [(0.0, 0.0), (8.0, 0.0), (8.0, 17.0), (0.0, 17.0)];
        assert_eq!(judge(opening, basis((10.0, 0.0), (0.0, 20.0)), &Config::default()), Verdict::Accepted);
        assert_eq!(judge(opening, basis((20.0, 0.0), (0.0, 20.0)), &Config::default()), Verdict::Accepted);
        assert_eq!(judge(opening, basis((25.0, 0.0), (0.0, 10.0)), &Config::default()), Verdict::WrongSides);
        let thesis = Config { area_min: 0.1, ..Config::thesis() };
        assert_eq!(judge(opening, None, &thesis), Verdict::NotSquare);
    }

    #[test]
    fn a_diamond_is_no_square_of_the_same_area() {
        let diamond = [(10.0, 0.0), (20.0, 10.0), (10.0, 20.0), (0.0, 10.0)];
        assert_eq!(judge(diamond, basis((11.0, 11.0), (-11.0, 11.0)), &Config::default()), Verdict::Accepted);
        assert_ne!(judge(diamond, basis((16.0, 0.0), (0.0, 16.0)), &Config::default()), Verdict::Accepted);
    }

    #[test]
    fn sizes_have_their_reasons() {
        let square = |s: f64| [(0.0, 0.0), (s, 0.0), (s, s), (0.0, s)];
        let cell = basis((20.0, 0.0), (0.0, 20.0));
        assert_eq!(judge(square(5.0), cell, &Config::default()), Verdict::TooSmall);
        assert_eq!(judge(square(17.0), cell, &Config::default()), Verdict::Accepted);
        assert_eq!(judge(square(37.0), cell, &Config::default()), Verdict::TooLarge);
        // A triangle fills half of its quadrilateral.
        let triangle = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (10.0, 10.0)];
        assert_ne!(judge(triangle, cell, &Config::default()), Verdict::Accepted);
    }
}
