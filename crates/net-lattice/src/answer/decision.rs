//! Is it a net, and is the answer right? Statistics that a flexible fit cannot raise, and a probability from them.

use serde::Serialize;

use crate::answer::fold::Fold;
use crate::lock::lockin::Measurement;
use crate::numeric::median;
use crate::picture::window::Window;

/// Tiles of which a mean says nothing.
const FEW: usize = 5;
/// Cells per px of the picture from which the second harmonic is too near to the pixels' own limit (half a cycle per px).
const FINEST: f64 = 1.0 / 4.4;

/// A sheet whose tangent on the axis and mean plane differ by less than this, rad, is flat but for rounding.
const FLAT: f64 = 1e-6;

/// Coherence of the phases left over in the tiles.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Evidence {
    /// Coherence of the fundamental per family: sqrt(2/N) times the sum of the cosines of the residual phases. Without a net about N(0, 1), a
    /// little more after a flexible fit.
    pub v: [f64; 2],
    /// The same of the second harmonic, which is never fitted: of all tiles, or of those whose fundamentals agree (what hides the others says nothing of
    /// it), whichever is clearer. Zero where hardly a tile resolves it.
    pub v2: [f64; 2],
    /// Share of tiles with both residual phases below 1 rad, of those that are not hidden.
    pub good: f64,
    /// The same among the tiles about the optical axis that are not empty (at least four tenths of them), where range and normal are
    /// claimed; zero without such tiles.
    pub good_near: f64,
    /// Coherence per family of where four harmonics together have the twines, as `v`: about N(0, 1) without a net.
    pub comb: [f64; 2],
    /// Share of tiles whose twines are within 1 rad of the fundamental from the lattice by four harmonics together, of those that are not hidden.
    pub comb_good: f64,
    /// The same among the tiles about the optical axis that are not empty, as `good_near`.
    pub comb_near: f64,
    /// Angle, rad, between the tangent plane on the axis and the mean plane about it. Where a sheet bends by more than the tolerance
    /// inside the view, "the" normal means little.
    pub bend: f64,
    /// How far the twines of the tiles that agree are scattered about the sheet's lattice per family, cells, one standard deviation, less what the tiles' noise
    /// makes of it. Lines at random scatter, and so does a net that bends otherwise than the sheet.
    pub scatter: [f64; 2],
    /// Angle, rad, by which bumps of the sheet too short for its polynomial may turn the normal on the axis; zero of a flat one.
    pub bumps: f64,
    /// Of a sheet with a relief, how unlikely its bumps, and what its threads stray, are: sums of squared standard deviations of the prior. A sheet that settled a cycle off somewhere
    /// needs more of both. Zero without a relief.
    pub strain: [f64; 2],
    /// Share of the average cell's variance that two families of straight twine can make: a sum of functions of one lattice coordinate each.
    pub separable: f64,
    /// Share of the variance of two by two average cells in which the four differ.
    pub unlike: f64,
    /// Variance of the average cell along the weaker family over that along the stronger.
    pub balance: f64,
    /// Variance of the average cell over that of noise: below about 1 the two above mean nothing.
    pub cell_snr: f64,
    /// Share of the tiles with strong waves whose phases contradict the lattice.
    pub dissent: f64,
    /// Share of the tiles in which something else than a net hides what could agree or contradict.
    pub hidden: f64,
    /// How far the search's candidate stood above other hypotheses of its depth, standard deviations; zero in a followed picture.
    pub above: f64,
    /// Tiles about the optical axis that counted, of those there are.
    pub near: [usize; 2],
    /// Tiles that counted.
    pub tiles: usize,
    /// Tiles that counted for the second harmonic.
    pub tiles2: usize,
}

/// What the tiles look like in which the lattice is.
#[derive(Debug, Clone, Copy)]
struct Usual {
    amplitude: [f64; 2],
    power: f64,
}

impl Usual {
    /// Medians over the tiles that agree; `None` for a handful of them.
    fn new(measurements: &[Measurement], scratch: &mut Vec<f64>) -> Option<Self> {
        let mut of = |value: &dyn Fn(&Measurement) -> f64| {
            scratch.clear();
            scratch.extend(measurements.iter().filter(|m| m.aligned()).map(value));
            (scratch.len() >= 6).then(|| median(scratch))
        };
        Some(Self { amplitude: [of(&|m| m.amplitude[0])?, of(&|m| m.amplitude[1])?], power: of(&|m| m.power)? })
    }

    /// A tile that does not agree, yet contradicts nothing: what is in it is far stronger than twine is elsewhere, or there are no waves
    /// at all where they should be. Fish do both. Waves as strong as elsewhere and out of step do not count as hidden.
    fn hides(&self, m: &Measurement) -> bool {
        const LOUD: f64 = 8.0;
        const FAINT: f64 = 0.3;
        let faint = (0..2).all(|f| m.amplitude[f] < FAINT * self.amplitude[f]);
        !m.aligned() && (m.power > LOUD * self.power || faint)
    }
}

/// Of both families' coherence of the second harmonic, whose sign motion blur turns.
fn weaker(v2: [f64; 2]) -> f64 {
    v2[0].abs().min(v2[1].abs())
}

impl Evidence {
    /// From the tiles within a window; those within `near` of the optical axis are where range and normal are claimed.
    pub(crate) fn new(measurements: &[Measurement], near: Window, within: Window, scratch: &mut Vec<f64>) -> Self {
        let usual = Usual::new(measurements, scratch);
        let mut e = Self::default();
        let mut sum = [0.0; 2];
        // Of the second harmonic: of all tiles that resolve it, and of those of them that agree.
        let (mut sum2, mut tiles2) = ([[0.0; 2]; 2], [0usize; 2]);
        let (mut off, mut square) = ([0.0; 2], [0.0; 2]);
        let (mut aligned, mut hidden) = (0usize, 0usize);
        let (mut strong, mut against) = (0usize, 0usize);
        let (mut aligned_near, mut silent_near) = (0usize, 0usize);
        for m in measurements {
            let hides = m.good && usual.is_some_and(|u| u.hides(m));
            if near.holds(m.site.pixel) {
                e.near[1] += 1;
                e.near[0] += usize::from(m.good);
                silent_near += usize::from(m.empty || hides);
                aligned_near += usize::from(m.aligned());
            }
            if !m.good || !within.holds(m.site.pixel) {
                continue;
            }
            e.tiles += 1;
            hidden += usize::from(hides);
            aligned += usize::from(m.aligned());
            let resolved = m.k[0].max(m.k[1]) < FINEST;
            let second = [resolved, resolved && m.aligned()];
            tiles2.iter_mut().zip(second).for_each(|(n, counts)| *n += usize::from(counts));
            for f in 0..2 {
                let loud = m.snr[f] > 12.0 && !hides;
                strong += usize::from(loud);
                against += usize::from(loud && m.phase[f].abs() > 1.2);
                sum[f] += m.phase[f].cos();
                sum2.iter_mut().zip(second).filter(|(_, c)| *c).for_each(|(s, _)| s[f] += m.phase2[f].cos());
                if m.aligned() {
                    off[f] += m.phase[f];
                    square[f] += m.phase[f].powi(2) - 0.5 / m.snr[f].max(1.0);
                }
            }
        }
        if e.tiles > 0 {
            e.v = sum.map(|s| s * f64::sqrt(2.0 / e.tiles as f64));
            e.hidden = hidden as f64 / e.tiles as f64;
            e.good = aligned as f64 / (e.tiles - hidden).max(1) as f64;
        }
        let count = aligned.max(1) as f64;
        let deviation = |f: usize| (square[f] / count - (off[f] / count).powi(2)).max(0.0).sqrt();
        e.scatter = std::array::from_fn(|f| deviation(f) / std::f64::consts::TAU);
        e.dissent = against as f64 / strong.max(1) as f64;
        for (sum, count) in sum2.into_iter().zip(tiles2).filter(|(_, n)| *n > FEW) {
            let v2 = sum.map(|s| s * f64::sqrt(2.0 / count as f64));
            if weaker(v2) > weaker(e.v2) {
                (e.v2, e.tiles2) = (v2, count);
            }
        }
        // Where the net ends in view there may be few tiles about the axis, but not next to none.
        let all = e.near[1].max(1) as f64;
        e.good_near = aligned_near as f64 / (all - silent_near as f64).max(0.4 * all);
        e
    }

    /// Whether the sheet has a relief.
    fn has_relief(&self) -> bool {
        self.strain != [0.0; 2]
    }

    /// Adds what all harmonics together say.
    pub(crate) fn with_comb(mut self, all: &Self) -> Self {
        (self.comb, self.comb_good, self.comb_near) = (all.v, all.good, all.good_near);
        self.scatter = all.scatter;
        self
    }

    /// Adds what the average cell looks like.
    pub(crate) fn folded(mut self, fold: Fold) -> Self {
        self.separable = fold.separable;
        self.balance = fold.balance;
        self.unlike = fold.unlike;
        self.cell_snr = fold.snr;
        self
    }

    /// What the average cell looked like.
    pub(crate) fn fold(&self) -> Fold {
        Fold { separable: self.separable, balance: self.balance, unlike: self.unlike, snr: self.cell_snr }
    }

    /// Adds the angle between tangent and mean plane of a sheet whose cells have these sides and which is this deep on the axis, m, and what bumps of `length` m may do.
    pub(crate) fn bent(mut self, angle: f64, sides: [f64; 2], depth: f64, length: f64) -> Self {
        self.bend = angle;
        self.bumps = if angle > FLAT { self.bumps_of(sides, depth, length) } else { 0.0 };
        self
    }

    /// Angle, rad, by which bumps of `length` m may turn the normal that scatter the twines so: one that moves twines seen a `length` off the axis by `d` is `d depth / length` high,
    /// and its slope is that over the length.
    pub(crate) fn bumps_of(&self, sides: [f64; 2], depth: f64, length: f64) -> f64 {
        f64::max(self.scatter[0] * sides[0], self.scatter[1] * sides[1]) * depth / (length * length)
    }

    /// Probability that there is a net, with range within 5 %, normal and in-plane rotation within 5 degrees.
    ///
    /// That of its lattice, times the chances that tangent and mean plane are the same thing, and that the normal's error is below 5 degrees, were its standard deviation `tilt_sigma`
    /// (rad) true but for a factor.
    pub fn probability(&self, tilt_sigma: f64) -> f64 {
        // A bend that nearly every tile agrees on is the net's, and may be as large as the answer's tolerance; else it may be the fit's alone.
        let agreed = ((self.comb_good - 0.7) / 0.2).clamp(0.0, 1.0);
        let straight = logistic((3.5 + 1.5 * agreed - self.bend.to_degrees()) / 0.4);
        // Rayleigh, both axes alike: where sheets are bent, errors of the worst are twice what the covariance says; less where a relief follows the bends: of 180 one in a hundred is
        // off by 3.8 deviations, which 1.25 times as large ones are as often.
        let worst = if self.has_relief() { 1.25 } else { 2.0 };
        let sigma = (worst * tilt_sigma).max(1e-6);
        let normal = 1.0 - (-0.5 * (5f64.to_radians() / sigma).powi(2)).exp();
        self.lattice_probability() * straight * normal
    }

    /// Probability that there is a net and that its meshes are where the lattice has them in the picture, however well its normal is known.
    ///
    /// A logistic rule of the second harmonic's coherence, which counts up to a point, and of the share of tiles that agree by all harmonics; less, of a sheet that
    /// bends, the share of those that do not agree: it can settle a cycle off where tiles are missing. Then the chances that twines are where the lattice has
    /// them but for noise, that the tiles about the axis bear the bend and strong waves do not contradict it, that the pattern is one of two families of twine, and
    /// that all its cells are alike (bricks repeat in two cells, and one family of their joints is the weaker; lines at random are never quite alike).
    ///
    /// The weights are a logistic regression with weights of one sign on 635 scenes of the simulator's studies (`net_sim::Study`), 270 of them without a net, half of
    /// those patterns much like one, wrong claims counted eightfold, the constant then raised by a half by hand; see the examples `study` and `score` for what they lead to.
    pub fn lattice_probability(&self) -> f64 {
        // Nothing but the second harmonic was not fitted: without one nothing is vouched for, and one deviation is what noise has. Motion blur turns its sign in
        // one family; in both it is turned where the pattern is no twine (scales).
        let weaker = weaker(self.v2);
        let second = if self.v2[0] < 0.0 && self.v2[1] < 0.0 { 0.0 } else { (weaker - 1.0).clamp(0.0, 5.0) };
        let bend_deg = self.bend.to_degrees();
        let whole = self.comb_good.min(0.8);
        let unsettled = (1.0 - self.comb_good.min(1.0)) * bend_deg.min(1.0);
        let there = logistic(-5.5 + 0.95 * second + 5.8 * whole - 4.9 * unsettled);
        // Of 276 right poses of the studies that the rest vouches for none has more than 0.044 of a cell; lines, cells and noise at random that are in step with a
        // lattice in more than half of the tiles hardly ever have less than 0.04. What is scattered by bumps keeps its second harmonic in step.
        let regular = ((weaker / f64::sqrt(2.0 * self.tiles2.max(1) as f64) - 0.7) / 0.1).clamp(0.0, 1.0);
        let scatter = self.scatter[0].hypot(self.scatter[1]) / std::f64::consts::SQRT_2;
        let steady = logistic((0.044 + 0.016 * regular - scatter) / 0.002);
        // A sheet may bend freely where no tile says otherwise. No right pose of bent sheets in the studies has less than 0.44 of the tiles about the axis, and the more
        // one bends, the more of them there must be: two wrong ones of 420 bent nets had 0.57 and 3 degrees.
        let least_near = 0.4 + 0.08 * bend_deg.min(4.0);
        let borne = if self.bend > FLAT { logistic((self.comb_near - least_near) / 0.015) } else { 1.0 };
        // What bends otherwise than the sheet contradicts it with strong waves: one of 60 bent nets that three tiles in eight did not agree with was 6 degrees off, and a fourth of
        // the waves were against it. Of 246 right ones six have as much.
        let uncontradicted = if self.bend > FLAT { logistic((0.235 - self.dissent) / 0.01) } else { 1.0 };
        // Knots of real nets take it down to 0.94. Where meshes are too small to show a second harmonic they show no knots either: there no right pose of the
        // studies has less than 0.97, unless noise has a tenth of the cell's power, but scales and cells at random places reach 0.92.
        let snr = self.cell_snr.max(1e-6);
        let least = (0.955 - 0.035 * (weaker - 3.0).max(0.0) - 0.5 / snr).max(0.82);
        let twine = logistic((self.separable - least) / 0.01);
        // Of bricks the weaker family has a sixth to a third of the power of the stronger, and a twentieth to a sixth differs. Noise makes cells differ as well, and so
        // do the pixels of a clean net, whose second harmonic is strong; where it is not, cells must be more alike.
        let strong = ((weaker - 5.0) / 5.0).clamp(0.0, 1.0);
        let differs = 0.02 + 0.03 * strong + (1.5 - 0.3 * strong) / snr;
        let limit = (0.01 + 0.15 * self.balance).min(differs).min(0.1);
        let alike = logistic((limit - self.unlike) / 0.006);
        // Unlikely bumps and unlikely threads together: of 180 right ones that the rest vouches for one has as much, and so had a sheet that settled a third of a cell off behind a fish.
        let likely = logistic(35.0 - (self.strain[0] * self.strain[1]).sqrt());
        there * steady * borne * uncontradicted * twine * alike * likely
    }
}

fn logistic(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    #[test]
    fn nothing_is_vouched_for_without_a_second_harmonic_of_twine() {
        let ask = Config::default().probability_threshold;
        // Every tile agrees, nothing contradicts, the average cell is two crossing twines.
        let perfect = Evidence {
            v: [16.0; 2],
            v2: [16.0; 2],
            comb_good: 1.0,
            comb_near: 1.0,
            separable: 1.0,
            balance: 1.0,
            cell_snr: 1000.0,
            tiles: 144,
            tiles2: 144,
            ..Evidence::default()
        };
        let with = |v2: [f64; 2]| Evidence { v2, ..perfect }.probability(0.001);
        assert!(with([16.0, 16.0]) > ask);
        assert!(with([-16.0, 16.0]) > ask, "one family blurred");
        assert!(with([0.0, 0.0]) < ask, "meshes too small for one");
        assert!(with([0.5, 16.0]) < ask, "one family has none");
        assert!(with([-16.0, -16.0]) < ask, "turned in both");
        let bent = |comb_near: f64| Evidence { v2: [16.0; 2], bend: 0.005, comb_near, ..perfect }.probability(0.001);
        assert!(bent(0.5) > ask, "a bend that half of the tiles about the axis bear");
        assert!(bent(0.35) < ask, "a bend that a third of them bears");
        let against = |dissent: f64| {
            Evidence { v2: [16.0; 2], bend: 0.005, comb_near: 1.0, dissent, ..perfect }.probability(0.001)
        };
        assert!(against(0.15) > ask, "a bend that few strong waves contradict");
        assert!(against(0.25) < ask, "one that a fourth of them contradicts");
    }

    #[test]
    fn nothing_is_vouched_for_that_scatters_or_bends_beyond_its_fit() {
        let ask = Config::default().probability_threshold;
        let sound = Evidence {
            v2: [16.0; 2],
            tiles2: 144,
            comb_good: 1.0,
            comb_near: 1.0,
            separable: 1.0,
            balance: 1.0,
            cell_snr: 1000.0,
            ..Evidence::default()
        };
        let p = |e: Evidence| e.probability(0.001);
        assert!(p(Evidence { scatter: [0.03; 2], ..sound }) > ask, "knots some per cent of a side off");
        assert!(p(Evidence { scatter: [0.05; 2], ..sound }) > ask, "bumps that leave the second harmonic in step");
        let random = Evidence { scatter: [0.05; 2], v2: [8.0; 2], ..sound };
        assert!(p(random) < ask, "lines at random places");
        let bend = |degrees: f64, comb_good: f64| Evidence { bend: degrees.to_radians(), comb_good, ..sound };
        assert!(p(bend(4.3, 0.95)) > ask, "a bend that nearly every tile agrees on");
        assert!(p(bend(4.3, 0.75)) < ask, "one that a quarter of them does not");
        let unsure = |degrees: f64| bend(1.0, 1.0).probability(degrees.to_radians());
        assert!(unsure(1.2) > ask, "a normal that is known well enough");
        assert!(unsure(2.5) < ask, "errors as large as the answer may be off");
        assert!(bend(1.0, 1.0).lattice_probability() > ask, "where the meshes are does not hang on the normal");
        assert!(random.lattice_probability() < ask, "nor is there a lattice where there is none");
    }
}
