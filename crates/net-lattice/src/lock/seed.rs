//! Where a lock-in starts, and how the twine looks there: the sums of the tiles read by every look, and the clearest taken.

use crate::lock::comb::{LOOKS, Looks};
use crate::lock::lockin::Measurement;
use crate::picture::window::Window;
use crate::sheet::surface::Surface;
use crate::workspace::Workspace;

/// Standard deviation of the window in which a lock-in starts, px of an 848 x 480 px picture.
const SEED: f64 = 110.0;
/// The same of how much less a place counts for starting the farther off the axis it is.
const CENTRAL: f64 = 500.0;
/// Power of a wave over that of noise from which it is clear.
const LOUD: f64 = 12.0;
/// How clear and in step waves of a rival period are at least, of what clear waves in perfect step are.
const THERE: f64 = 0.08;

/// Where a lock-in starts, full-resolution px, and how the twine looks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seed {
    pub centre: [f64; 2],
    pub looks: Looks,
}

impl Workspace {
    /// Where in the picture the waves of a predicted sheet are seen best: there a lock-in starts. The sheet is moved to fit there. A fish on
    /// the optical axis hides no net beside it.
    pub(crate) fn seed(&mut self, surface: &mut Surface) -> Seed {
        surface.offset = [0.0; 2];
        let place = (self.coarse_scale_for(surface.depth).0, 0);
        let gain = self.demodulate(surface, place, &Window::ALL);
        self.read_looks(surface, place, gain);
        let mut best = (f64::NEG_INFINITY, Seed { centre: self.view.centre, looks: [0.0; 2] }, [0.0; 2]);
        for place in self.tools.looks[0].iter().filter(|m| m.good) {
            let window = Window { centre: place.pixel, radius: SEED * self.view.size };
            let clearest = self.clearest(|_, m| window.weight(m.pixel));
            // Range and normal are those on the axis: the nearer the better.
            let clear = clearest[0].0.min(clearest[1].0);
            let score = clear * self.window(CENTRAL).weight(place.pixel);
            if score > best.0 {
                let seed = Seed { centre: place.pixel, looks: clearest.map(|c| c.1) };
                best = (score, seed, clearest.map(|c| c.2));
            }
        }
        surface.offset = best.2;
        best.1
    }

    /// Reads the last sums by all looks.
    fn read_looks(&mut self, surface: &Surface, place: (usize, usize), gain: f32) {
        for (k, look) in LOOKS.into_iter().enumerate() {
            self.comb(surface, place, [1.0; 2], [look; 2], gain);
            let t = &mut self.tools;
            t.looks[k].clear();
            t.looks[k].extend(t.measurements.iter().map(Said::new));
        }
    }

    /// Of each family how clear and in step its clearest look is in the tiles weighted so, that look, and where it has the twine, cycles.
    fn clearest(&self, weight: impl Fn(usize, &Said) -> f64) -> [(f64, f64, f64); 2] {
        let mut best = [(f64::NEG_INFINITY, 0.0, 0.0); 2];
        for (look, said) in LOOKS.into_iter().zip(&self.tools.looks) {
            for (best, z) in best.iter_mut().zip(together(said, &weight)) {
                let clear = z[0].hypot(z[1]);
                if clear > best.0 {
                    *best = (clear, look, cycles(z));
                }
            }
        }
        best
    }

    /// Moves a sheet that is right but for its period along itself, to where the twines of the tiles in the mask are. Returns how they
    /// look; `None` if waves of that period are not there at all.
    pub(crate) fn slide(&mut self, surface: &mut Surface) -> Option<Looks> {
        surface.offset = [0.0; 2];
        let place = (self.coarse_scale_for(surface.depth).0, self.tools.tiling);
        let gain = self.demodulate(surface, place, &Window::ALL);
        self.read_looks(surface, place, gain);
        let t = &self.tools;
        let say = |k: usize, _: &Said| f64::from(t.mask.get(k).copied().unwrap_or(true));
        let all: f64 = t.looks[0].iter().enumerate().map(|(k, m)| say(k, m) * LOUD.sqrt()).sum();
        let clearest = self.clearest(say);
        surface.offset = clearest.map(|c| c.2);
        (clearest[0].0.min(clearest[1].0) > THERE * all).then_some(clearest.map(|c| c.1))
    }
}

/// What a tile says by one look.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Said {
    /// Middle of the tile, full-resolution px.
    pub pixel: [f64; 2],
    pub good: bool,
    /// Unit vectors of both families' phases, with as much say as their waves are clear; how strong they are says more of fish.
    z: [[f64; 2]; 2],
}

impl Said {
    fn new(m: &Measurement) -> Self {
        let z = |f: usize| {
            let say = m.snr[f].min(LOUD).sqrt();
            let (sin, cos) = m.phase[f].sin_cos();
            [say * cos, say * sin]
        };
        let z = if m.good { [z(0), z(1)] } else { [[0.0; 2]; 2] };
        Self { pixel: m.site.pixel, good: m.good, z }
    }
}

/// Weighted sum of what the good tiles say.
fn together(said: &[Said], weight: &impl Fn(usize, &Said) -> f64) -> [[f64; 2]; 2] {
    let mut sum = [[0.0; 2]; 2];
    for (k, s) in said.iter().enumerate().filter(|(_, s)| s.good) {
        let w = weight(k, s);
        for (sum, z) in sum.iter_mut().zip(&s.z) {
            sum[0] += w * z[0];
            sum[1] += w * z[1];
        }
    }
    sum
}

/// Direction of such a sum, cycles.
fn cycles(z: [f64; 2]) -> f64 {
    z[1].atan2(z[0]) / std::f64::consts::TAU
}
