//! Whole cycles of the phases left over. A lock-in knows them only modulo one; from tile to tile they change by little, so they are counted
//! outwards from where the lattice is right (region growing, as in quality-guided phase unwrapping: Ghiglia and Pritt 1998).

use crate::lockin::Measurement;

/// Largest difference, cycles, between what neighbours foretell and what is found.
const SURPRISE: f64 = 0.22;
/// Power of both waves over that of noise from which a tile takes part.
const CLEAR: f64 = 4.0;

/// Residuals in cycles of both families per tile of a grid `nx` wide, cycles counted; `None` where no path of clear tiles leads.
#[derive(Debug, Default)]
pub(crate) struct Unwrapper {
    pub cycles: Vec<Option<[f64; 2]>>,
}

impl Unwrapper {
    /// Counts outwards from the tile with the most agreeing neighbours. Returns how many tiles were reached.
    pub(crate) fn run(&mut self, measurements: &[Measurement], nx: usize) -> usize {
        self.cycles.clear();
        self.cycles.resize(measurements.len(), None);
        let ny = measurements.len() / nx.max(1);
        let clear = |t: usize| measurements[t].good && measurements[t].snr[0].min(measurements[t].snr[1]) > CLEAR;
        let phase = |t: usize| measurements[t].phase.map(|p| p / std::f64::consts::TAU);
        let agreeing = |t: &usize| {
            let (x, y) = (t % nx, t / nx);
            let near = (y.saturating_sub(1)..(y + 2).min(ny))
                .flat_map(|b| (x.saturating_sub(1)..(x + 2).min(nx)).map(move |a| b * nx + a));
            near.filter(|n| measurements[*n].aligned()).count()
        };
        let seeds = (0..nx * ny).filter(|t| clear(*t) && measurements[*t].aligned());
        let Some(seed) = seeds.max_by_key(agreeing) else { return 0 };
        self.cycles[seed] = Some(phase(seed));
        let mut reached = 1;
        // The least surprising tile beside those reached is next.
        loop {
            let mut next: Option<(f64, usize, [f64; 2])> = None;
            for t in (0..nx * ny).filter(|t| self.cycles[*t].is_none() && clear(*t)) {
                let Some(foretold) = self.foretold(t % nx, t / nx, nx, ny) else { continue };
                let found: [f64; 2] = std::array::from_fn(|f| {
                    let p = phase(t)[f];
                    p + (foretold[f] - p).round()
                });
                let surprise = (found[0] - foretold[0]).abs().max((found[1] - foretold[1]).abs());
                if surprise < next.map_or(SURPRISE, |n| n.0) {
                    next = Some((surprise, t, found));
                }
            }
            let Some((_, t, found)) = next else { return reached };
            self.cycles[t] = Some(found);
            reached += 1;
        }
    }

    /// What the neighbours say: in each direction the line through the next two, or the next alone.
    fn foretold(&self, x: usize, y: usize, nx: usize, ny: usize) -> Option<[f64; 2]> {
        let at = |dx: isize, dy: isize| {
            let (a, b) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
            if a < nx && b < ny { self.cycles[b * nx + a] } else { None }
        };
        let (mut sum, mut n) = ([0.0; 2], 0.0);
        for dy in -1..=1isize {
            for dx in -1..=1isize {
                let Some(one) = at(dx, dy) else { continue };
                let two = at(2 * dx, 2 * dy);
                // Two in a row say more than one.
                let w = if two.is_some() { 2.0 } else { 1.0 };
                for f in 0..2 {
                    sum[f] += w * two.map_or(one[f], |two| 2.0 * one[f] - two[f]);
                }
                n += w;
            }
        }
        (n > 0.0).then(|| sum.map(|s| s / n))
    }
}
