//! Missing twines joined to holes.

use std::collections::{BTreeMap, BTreeSet};

use crate::config::Config;
use crate::error::{Error, Result};
use crate::mapper::Mapper;
use crate::store::TileStore;

/// Most missing twines that are joined: some hundred megabytes.
const LIMIT: usize = 1_000_000;
/// Twines of the second rule, and how many it takes.
const SEVERAL: (f32, usize) = (-2.0, 3);
/// Most twines in a row that are missing because those on both sides of them are.
const BRIDGED: i32 = 3;

/// A hole: meshes that missing twines join.
#[derive(Debug, Clone, PartialEq)]
pub struct Hole {
    /// Number of the count of cells.
    pub track: u32,
    /// The meshes, each named after its first node, in order.
    pub cells: Vec<(i32, i32)>,
    /// Missing twines: node at the first end, and direction.
    pub twines: Vec<((i32, i32), usize)>,
    /// Its outer outline in lattice coordinates: corners, each joined to the next and the last to the first.
    pub outline: Vec<(i32, i32)>,
    /// Log likelihood ratio, present to missing, of its twines together.
    pub llr: f64,
    /// Of the twine that is surest to be missing.
    pub least_llr: f64,
    /// Looks at its twines, the most of any.
    pub looks: u32,
    /// First and last frame that called one of its twines missing.
    pub first_frame: u32,
    /// See `first_frame`.
    pub last_frame: u32,
}

#[derive(Debug, Clone, Copy)]
struct Missing {
    index: (i32, i32),
    direction: usize,
    llr: f32,
    contrast: f32,
    looks: u32,
    frames: (u32, u32),
}

impl Missing {
    /// The meshes on both sides.
    fn beside(&self) -> [(i32, i32); 2] {
        let (i, j) = self.index;
        [(i, j), if self.direction == 0 { (i, j - 1) } else { (i - 1, j) }]
    }

    /// What names it: node and direction.
    fn name(&self) -> Name {
        (self.index, self.direction)
    }

    /// The name of the parallel twine that is `k` meshes aside.
    fn aside(&self, k: i32) -> Name {
        let (i, j) = self.index;
        (if self.direction == 0 { (i, j + k) } else { (i + k, j) }, self.direction)
    }
}

/// A twine's first node and direction.
type Name = ((i32, i32), usize);

/// Adds to missing twines those of doubtful ones that have missing ones on both sides: a slit cuts one twine after the other.
fn bridge(missing: &mut Vec<Missing>, doubtful: &[Missing]) {
    let names = |twines: &[Missing]| twines.iter().map(Missing::name).collect::<BTreeSet<_>>();
    let (gone, perhaps) = (names(missing), names(doubtful));
    // Meshes to the next missing twine on one side, over doubtful ones.
    let reach = |twine: &Missing, side: i32| {
        let end = (1..=BRIDGED).find(|k| !perhaps.contains(&twine.aside(side * k)))?;
        gone.contains(&twine.aside(side * end)).then_some(end)
    };
    let between = |twine: &&Missing| {
        reach(twine, -1).zip(reach(twine, 1)).is_some_and(|(before, after)| before + after <= BRIDGED + 1)
    };
    missing.extend(doubtful.iter().filter(between));
}

impl<S: TileStore> Mapper<S> {
    /// The holes of the map, in order of track and place.
    ///
    /// # Errors
    /// [`Error::TooManyMissing`], [`Error::Store`], [`Error::Tile`].
    pub fn holes(&mut self) -> Result<Vec<Hole>> {
        // Missing and doubtful twines by track.
        let mut twines_of: BTreeMap<u32, [Vec<Missing>; 2]> = BTreeMap::new();
        let mut count = 0;
        let keys: Vec<_> = self.keys().iter().copied().collect();
        let config = self.config.clone();
        for key in keys {
            let tile = self.tile(key)?;
            for (place, twines) in tile.twines.iter().enumerate() {
                for (direction, t) in twines.iter().enumerate() {
                    let llr = t.llr(&config);
                    let gone = f64::from(llr) < config.missing_llr && t.is_gap();
                    if gone || f64::from(llr) < config.bridge_llr && t.fouled == 0 {
                        let frames = if gone { (t.first_missing, t.last_missing) } else { (u32::MAX, 0) };
                        let (contrast, looks) = (t.contrast, t.looks);
                        let index = key.cell(place);
                        let known = Missing { index, direction, llr, contrast, looks, frames };
                        twines_of.entry(key.track).or_default()[usize::from(!gone)].push(known);
                        count += 1;
                        if count > LIMIT {
                            return Err(Error::TooManyMissing { limit: LIMIT });
                        }
                    }
                }
            }
        }
        let mut holes = Vec::new();
        for (track, [mut missing, doubtful]) in twines_of {
            bridge(&mut missing, &doubtful);
            holes.extend(join(track, &missing, &config));
        }
        holes.sort_by(|a, b| (a.track, &a.cells).cmp(&(b.track, &b.cells)));
        Ok(holes)
    }
}

/// Meshes that are joined, and the twines that join them.
type Group<'a> = (BTreeSet<(i32, i32)>, Vec<&'a Missing>);

/// Union-find over the meshes beside missing twines; groups that are certain enough.
fn join(track: u32, missing: &[Missing], config: &Config) -> Vec<Hole> {
    let mut number: BTreeMap<(i32, i32), usize> = BTreeMap::new();
    for cell in missing.iter().flat_map(Missing::beside) {
        let next = number.len();
        number.entry(cell).or_insert(next);
    }
    let mut parent: Vec<usize> = (0..number.len()).collect();
    fn root(parent: &mut [usize], mut k: usize) -> usize {
        while parent[k] != k {
            parent[k] = parent[parent[k]];
            k = parent[k];
        }
        k
    }
    for twine in missing {
        let [a, b] = twine.beside().map(|cell| root(&mut parent, number[&cell]));
        // The smaller number stays: the same groups in any order.
        parent[a.max(b)] = a.min(b);
    }
    let mut groups: BTreeMap<usize, Group> = BTreeMap::new();
    for twine in missing {
        let [a, b] = twine.beside();
        let group = groups.entry(root(&mut parent, number[&a])).or_default();
        group.0.extend([a, b]);
        group.1.push(twine);
    }
    groups
        .into_values()
        .filter(|(_, twines)| is_hole(twines, config))
        .map(|(cells, twines)| hole(track, cells, &twines))
        .collect()
}

fn is_hole(twines: &[&Missing], config: &Config) -> bool {
    let certain = twines
        .iter()
        .any(|t| f64::from(t.llr) < config.hole_one_llr && f64::from(t.contrast) > config.certain_contrast);
    let sum: f64 = twines.iter().map(|t| f64::from(t.llr)).sum();
    let several = twines.iter().filter(|t| t.llr < SEVERAL.0).count() >= SEVERAL.1;
    certain || (several && sum < config.hole_sum_llr)
}

fn hole(track: u32, cells: BTreeSet<(i32, i32)>, twines: &[&Missing]) -> Hole {
    let mut names: Vec<_> = twines.iter().map(|t| (t.index, t.direction)).collect();
    names.sort_unstable();
    Hole {
        track,
        outline: outline(&cells),
        cells: cells.into_iter().collect(),
        twines: names,
        llr: twines.iter().map(|t| f64::from(t.llr)).sum(),
        least_llr: twines.iter().map(|t| f64::from(t.llr)).fold(0.0, f64::min),
        looks: twines.iter().map(|t| t.looks).max().unwrap_or(0),
        first_frame: twines.iter().map(|t| t.frames.0).min().unwrap_or(0),
        last_frame: twines.iter().map(|t| t.frames.1).max().unwrap_or(0),
    }
}

/// Outer outline of joined meshes, straight stretches without corners in between.
fn outline(cells: &BTreeSet<(i32, i32)>) -> Vec<(i32, i32)> {
    // Sides that no other mesh of the hole shares, each with the hole on the same hand: along, up, back, down.
    let mut next: BTreeMap<(i32, i32), Vec<(i32, i32)>> = BTreeMap::new();
    for &(i, j) in cells {
        let sides = [
            ((i, j - 1), (i, j), (i + 1, j)),
            ((i + 1, j), (i + 1, j), (i + 1, j + 1)),
            ((i, j + 1), (i + 1, j + 1), (i, j + 1)),
            ((i - 1, j), (i, j + 1), (i, j)),
        ];
        for (neighbour, from, to) in sides {
            if !cells.contains(&neighbour) {
                next.entry(from).or_default().push(to);
            }
        }
    }
    // The first corner in order of i, then j, is on the outer outline, and it has one way on.
    let Some(&start) = next.keys().next() else { return Vec::new() };
    let (mut here, mut came) = (start, (0, -1));
    let mut corners = Vec::new();
    loop {
        let Some(ways) = next.get_mut(&here).filter(|w| !w.is_empty()) else { return corners };
        // Where two meshes touch at a corner only, turn so that each is gone round on its own side: keep to the hole.
        let turn = |to: (i32, i32)| {
            let go = (to.0 - here.0, to.1 - here.1);
            came.0 * go.1 - came.1 * go.0
        };
        let best = (0..ways.len()).max_by_key(|&k| turn(ways[k])).unwrap_or(0);
        let to = ways.swap_remove(best);
        let go = (to.0 - here.0, to.1 - here.1);
        if go != came || corners.is_empty() {
            corners.push(here);
        }
        (here, came) = (to, go);
        if here == start {
            return corners;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(cells: &[(i32, i32)]) -> BTreeSet<(i32, i32)> {
        cells.iter().copied().collect()
    }

    #[test]
    fn outlines_go_round() {
        assert_eq!(outline(&set(&[(0, 0)])), [(0, 0), (1, 0), (1, 1), (0, 1)]);
        assert_eq!(outline(&set(&[(2, 3), (3, 3)])), [(2, 3), (4, 3), (4, 4), (2, 4)]);
        // An L.
        let corners = outline(&set(&[(0, 0), (1, 0), (0, 1)]));
        assert_eq!(corners, [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]);
        // A ring: the outer outline alone.
        let ring: Vec<_> = (0..9).map(|k| (k % 3, k / 3)).filter(|c| *c != (1, 1)).collect();
        assert_eq!(outline(&set(&ring)), [(0, 0), (3, 0), (3, 3), (0, 3)]);
        assert!(outline(&set(&[])).is_empty());
    }

    fn gone(index: (i32, i32), direction: usize, llr: f32) -> Missing {
        Missing { index, direction, llr, contrast: 5.0, looks: 1, frames: (3, 7) }
    }

    #[test]
    fn twines_join_the_meshes_beside_them() {
        let config = Config::default();
        // All four twines of node (5, 5): four meshes. One far away, not sure enough.
        let twines = [
            gone((5, 5), 0, -7.0),
            gone((4, 5), 0, -3.0),
            gone((5, 5), 1, -3.0),
            gone((5, 4), 1, -3.0),
            gone((20, 20), 0, -2.0),
        ];
        let holes = join(1, &twines, &config);
        assert_eq!(holes.len(), 1);
        assert_eq!(holes[0].cells, [(4, 4), (4, 5), (5, 4), (5, 5)]);
        assert_eq!(holes[0].outline, [(4, 4), (6, 4), (6, 6), (4, 6)]);
        assert_eq!((holes[0].twines.len(), holes[0].first_frame, holes[0].last_frame), (4, 3, 7));
        assert!((holes[0].llr + 16.0).abs() < 1e-9);
        // A slit: of six twines in a row two look missing without being certain of it. One with a sound twine beside it does not count.
        let mut row: Vec<Missing> = [0, 1, 4, 5].map(|i| gone((i, 0), 1, -3.2)).to_vec();
        assert!(join(0, &row, &config).is_empty(), "two and two");
        let doubtful = [2, 3, 6].map(|i| gone((i, 0), 1, -1.0));
        bridge(&mut row, &doubtful);
        assert_eq!(row.len(), 6);
        assert_eq!(join(0, &row, &config)[0].cells.len(), 7);
        // Three together are as good as one that is certain.
        let weak = [gone((0, 0), 0, -5.0), gone((1, 0), 1, -5.0), gone((1, 0), 0, -5.0)];
        assert_eq!(join(0, &weak, &config).len(), 1);
        assert!(join(0, &weak[..2], &config).is_empty());
    }
}
