//! What was found against the truth.

use std::collections::{BTreeMap, BTreeSet};

use net_geometry::JunctionState;
use net_geometry::nalgebra::Vector2;
use net_junction::{LatticeMap, NetAdjuster, Twine, TwineState};

use crate::sample::{Edge, Index, Sample};

/// Farther from the true knot of its name than this, a junction is wrong, px.
const RIGHT_PX: f64 = 2.0;
/// False rate at which missing twines are counted.
const FALSE_RATE: f64 = 1e-4;
/// Holes closer to the picture's end than this are not asked for, px.
const MARGIN_PX: f64 = 4.0;
/// Cells, px, from which on single twines are counted apart.
pub const SIZES_PX: [f64; 2] = [8.0, 12.0];

/// Sums over pictures.
#[derive(Debug, Default)]
pub struct Score {
    pub pictures: usize,
    /// True knots whose cells are large enough.
    pub in_view: usize,
    pub visible: usize,
    pub found: usize,
    pub seen: usize,
    pub right: usize,
    /// Squared distances, less each picture's mean, and as they are, px².
    pub squares: [f64; 2],
    pub cells_px: f64,
    /// Log likelihood ratios of twines by what they are.
    pub missing: Vec<f32>,
    pub intact: Vec<f32>,
    /// Found and true holes of two twines or more, and of one.
    pub large: [usize; 2],
    pub single: [usize; 2],
    /// The same by size of cells: below the first of [`SIZES_PX`], between them, and above.
    pub single_by_size: [[usize; 2]; 3],
    pub false_holes: usize,
    /// Twines that are there and are called missing.
    pub false_missing: usize,
}

impl Score {
    pub fn add(&mut self, other: Self) {
        self.pictures += 1;
        self.in_view += other.in_view;
        self.visible += other.visible;
        self.found += other.found;
        self.seen += other.seen;
        self.right += other.right;
        for k in 0..2 {
            self.squares[k] += other.squares[k];
            self.large[k] += other.large[k];
            self.single[k] += other.single[k];
            for (sum, more) in self.single_by_size.iter_mut().zip(other.single_by_size) {
                sum[k] += more[k];
            }
        }
        self.cells_px += other.cells_px;
        self.missing.extend(other.missing);
        self.intact.extend(other.intact);
        self.false_holes += other.false_holes;
        self.false_missing += other.false_missing;
    }
    pub fn rmse(&self) -> f64 {
        (self.squares[0] / self.right.max(1) as f64).sqrt()
    }
    pub fn rmse_as_is(&self) -> f64 {
        (self.squares[1] / self.right.max(1) as f64).sqrt()
    }
    pub fn recall(&self) -> f64 {
        self.found as f64 / self.visible.max(1) as f64
    }
    pub fn precision(&self) -> f64 {
        self.right as f64 / self.seen.max(1) as f64
    }
    pub fn cell_px(&self) -> f64 {
        self.cells_px / self.in_view.max(1) as f64
    }

    /// Area under the curve of missing against intact twines, the share of the missing ones found at [`FALSE_RATE`], and the log likelihood ratio
    /// at which that is.
    pub fn missing_twines(&self) -> (f64, f64, f32) {
        let mut intact = self.intact.clone();
        intact.sort_by(f32::total_cmp);
        let below: usize = self.missing.iter().map(|m| intact.partition_point(|x| x <= m)).sum();
        let auc = 1.0 - below as f64 / (self.missing.len() * intact.len()).max(1) as f64;
        let allowed = (FALSE_RATE * intact.len() as f64) as usize;
        let threshold = intact.get(allowed).copied().unwrap_or(f32::MIN);
        let found = self.missing.iter().filter(|m| **m < threshold).count();
        (auc, found as f64 / self.missing.len().max(1) as f64, threshold)
    }
}

impl std::fmt::Display for Score {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (auc, found, _) = self.missing_twines();
        write!(
            f,
            "cells {:4.1} px, {:4} visible, recall {:.3}, precision {:.4}, RMSE {:.3} ({:.3}), false holes {}, twines {}",
            self.cell_px(),
            self.visible,
            self.recall(),
            self.precision(),
            self.rmse(),
            self.rmse_as_is(),
            self.false_holes,
            self.false_missing
        )?;
        if !self.missing.is_empty() {
            write!(
                f,
                ", {} missing: AUC {auc:.4}, {found:.2}, holes {:?}, single {:?}",
                self.missing.len(),
                self.large,
                self.single
            )?;
        }
        Ok(())
    }
}

/// From found to true indices: a symmetry of the lattice and a shift.
type Naming = ([[i32; 2]; 2], Index);

fn renamed((turn, shift): &Naming, (i, j): Index) -> Index {
    (turn[0][0] * i + turn[0][1] * j + shift.0, turn[1][0] * i + turn[1][1] * j + shift.1)
}

/// The true name of a twine.
fn renamed_edge(naming: &Naming, twine: &Twine) -> Edge {
    let (i, j) = twine.index;
    let other = if twine.direction == 0 { (i + 1, j) } else { (i, j + 1) };
    let (a, b) = (renamed(naming, twine.index), renamed(naming, other));
    (a.min(b), usize::from(a.0 == b.0))
}

/// The one symmetry and shift under which most junctions have their names.
fn naming(adjuster: &NetAdjuster, sample: &Sample) -> Naming {
    let turns = [
        [[1, 0], [0, 1]],
        [[0, -1], [1, 0]],
        [[-1, 0], [0, -1]],
        [[0, 1], [-1, 0]],
        [[0, 1], [1, 0]],
        [[1, 0], [0, -1]],
        [[-1, 0], [0, 1]],
        [[0, -1], [-1, 0]],
    ];
    let mut votes: BTreeMap<Naming, usize> = BTreeMap::new();
    for junction in adjuster.junctions() {
        let Some(index) = junction.index else { continue };
        let near = sample.knots.iter().find(|k| (k.pixel - junction.pixel).norm() <= RIGHT_PX);
        let Some(knot) = near else { continue };
        for turn in turns {
            let (i, j) = renamed(&(turn, (0, 0)), index);
            *votes.entry((turn, (knot.index.0 - i, knot.index.1 - j))).or_default() += 1;
        }
    }
    votes.into_iter().max_by_key(|v| v.1).map_or((turns[0], (0, 0)), |v| v.0)
}

/// Compares the last adjustment with the truth; `rename` if the indices are another count's.
pub fn score(adjuster: &NetAdjuster, sample: &Sample, truth: &impl LatticeMap, least_px: f64, rename: bool) -> Score {
    let naming = if rename { naming(adjuster, sample) } else { ([[1, 0], [0, 1]], (0, 0)) };
    let mut score = Score { pictures: 1, ..Score::default() };
    let mut asked = BTreeSet::new();
    for knot in &sample.knots {
        let cell = cell_px(truth, knot.index).unwrap_or(0.0);
        if cell >= least_px {
            score.in_view += 1;
            score.cells_px += cell;
            score.visible += usize::from(knot.visible);
            asked.insert(knot.index);
        }
    }
    let knots: BTreeMap<_, _> = sample.knots.iter().map(|k| (k.index, k)).collect();
    let mut errors = Vec::new();
    for junction in adjuster.junctions().iter().filter(|j| j.state == JunctionState::Seen) {
        score.seen += 1;
        let knot = junction.index.and_then(|index| knots.get(&renamed(&naming, index)));
        let Some(knot) = knot.filter(|k| (k.pixel - junction.pixel).norm() <= RIGHT_PX) else { continue };
        score.right += 1;
        score.found += usize::from(knot.visible && asked.contains(&knot.index));
        errors.push(junction.pixel - knot.pixel);
    }
    let mean = errors.iter().sum::<Vector2<f64>>() / errors.len().max(1) as f64;
    score.squares = [mean, Vector2::zeros()].map(|m| errors.iter().map(|e| (e - m).norm_squared()).sum());

    let size = Vector2::new(sample.image.width() as f64, sample.image.height() as f64);
    let inside = |index: &Index| {
        knots.get(index).is_some_and(|k| {
            k.pixel.x > MARGIN_PX
                && k.pixel.y > MARGIN_PX
                && k.pixel.x < size.x - MARGIN_PX
                && k.pixel.y < size.y - MARGIN_PX
        })
    };
    let ends = |((i, j), direction): &Edge| [(*i, *j), if *direction == 0 { (i + 1, *j) } else { (*i, j + 1) }];
    // The twines that can be judged: both ends in the picture and not covered.
    let fair = |edge: &Edge| {
        ends(edge).iter().all(|n| asked.contains(n) && inside(n) && knots.get(n).is_some_and(|k| !k.covered))
    };
    let mut judged = BTreeMap::new();
    for twine in adjuster.twines() {
        let edge = renamed_edge(&naming, twine);
        // Where nothing can be told nothing is called missing.
        let untold = twine.state == TwineState::Unknown && twine.llr < 0.0 || !twine.llr.is_finite();
        judged.insert(edge, if untold { 0.0 } else { twine.llr });
    }
    let evidence = |edge: &Edge| judged.get(edge).copied().unwrap_or(f32::MAX);
    score.missing.extend(sample.missing.iter().filter(|e| fair(e)).map(evidence));
    score.intact.extend(judged.iter().filter(|(e, _)| fair(e) && !sample.missing.contains(e)).map(|(_, llr)| *llr));

    let found = adjuster.twines().iter().filter(|t| t.state == TwineState::Missing);
    let found: BTreeSet<_> = found.map(|t| renamed_edge(&naming, t)).collect();
    score.false_missing = found.difference(&sample.missing).count();
    score.false_holes = holes(&found).iter().filter(|hole| hole.is_disjoint(&sample.missing)).count();
    for hole in holes(&sample.missing) {
        if !hole.iter().all(fair) {
            continue;
        }
        let hit = usize::from(!hole.is_disjoint(&found));
        if let (1, Some(twine)) = (hole.len(), hole.first()) {
            let cell = cell_px(truth, twine.0).unwrap_or(0.0);
            let size = &mut score.single_by_size[SIZES_PX.iter().filter(|&&s| cell >= s).count()];
            size[0] += hit;
            size[1] += 1;
        }
        let counts = if hole.len() == 1 { &mut score.single } else { &mut score.large };
        counts[0] += hit;
        counts[1] += 1;
    }
    score
}

/// Distance between parallel twines at a node, the lesser of the two, px.
fn cell_px(map: &impl LatticeMap, (i, j): Index) -> Option<f64> {
    let at = |di: f64, dj: f64| map.pixel(f64::from(i) + di, f64::from(j) + dj);
    let (a, b) = (at(0.5, 0.0)? - at(-0.5, 0.0)?, at(0.0, 0.5)? - at(0.0, -0.5)?);
    Some(a.perp(&b).abs() / a.norm().max(b.norm()))
}

/// Missing twines joined by the meshes beside them.
fn holes(missing: &BTreeSet<Edge>) -> Vec<BTreeSet<Edge>> {
    let mut holes: Vec<(BTreeSet<Index>, BTreeSet<Edge>)> = Vec::new();
    for &edge in missing {
        let ((i, j), direction) = edge;
        let mut cells = BTreeSet::from([(i, j), if direction == 0 { (i, j - 1) } else { (i - 1, j) }]);
        let mut twines = BTreeSet::from([edge]);
        let (touching, apart): (Vec<_>, Vec<_>) = holes.into_iter().partition(|h| !h.0.is_disjoint(&cells));
        holes = apart;
        for (more_cells, more_twines) in touching {
            cells.extend(more_cells);
            twines.extend(more_twines);
        }
        holes.push((cells, twines));
    }
    holes.into_iter().map(|h| h.1).collect()
}
