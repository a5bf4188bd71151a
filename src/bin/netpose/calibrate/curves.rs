//! How often a probability keeps its word, and what refusing buys.

use super::scene::Examined;

/// Scenes whose probability is nearly the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bin {
    /// Probabilities from here to there.
    pub span: [f64; 2],
    pub count: usize,
    /// Mean probability.
    pub claimed: f64,
    /// Share of them that is right.
    pub right: f64,
    /// 95 % of such draws have their true share in here (Wilson 1927).
    pub interval: [f64; 2],
}

/// Bounds of the bins: fine where decisions are made.
const BOUNDS: [f64; 11] = [0.0, 0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.98, 1.0];

/// Shares of right answers by probability, bins without a scene left out.
pub fn reliability(scenes: &[Examined]) -> Vec<Bin> {
    let answers: Vec<(f64, bool)> = scenes.iter().map(|s| (s.probability(), s.is_right())).collect();
    bins(&answers)
}

fn bins(answers: &[(f64, bool)]) -> Vec<Bin> {
    let pairs = BOUNDS.windows(2).map(|w| [w[0], w[1]]);
    pairs
        .filter_map(|[low, high]| {
            let inside = |p: f64| p >= low && (p < high || high == 1.0);
            let of: Vec<&(f64, bool)> = answers.iter().filter(|a| inside(a.0)).collect();
            let count = of.len();
            let share = |sum: f64| sum / count as f64;
            (count > 0).then(|| {
                let right = of.iter().filter(|a| a.1).count();
                Bin {
                    span: [low, high],
                    count,
                    claimed: share(of.iter().map(|a| a.0).sum()),
                    right: share(right as f64),
                    interval: wilson(right, count),
                }
            })
        })
        .collect()
}

/// 95 % interval of a share of which `hits` of `count` draws are known.
fn wilson(hits: usize, count: usize) -> [f64; 2] {
    const Z: f64 = 1.96;
    let (n, p) = (count as f64, hits as f64 / count as f64);
    let centre = p + Z * Z / (2.0 * n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
    [(centre - half) / (1.0 + Z * Z / n), (centre + half) / (1.0 + Z * Z / n)]
}

/// What a threshold gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    pub threshold: f64,
    /// Share of the visible nets that are answered.
    pub coverage: f64,
    /// Share of the answers that are wrong, answers where there is no net among them.
    pub risk: f64,
    /// Answers, and the wrong ones among them.
    pub answers: usize,
    pub wrong: usize,
}

/// What every threshold worth choosing gives, from the surest answer to the least sure.
pub fn risk_coverage(scenes: &[Examined]) -> Vec<Choice> {
    let answers: Vec<(f64, bool, bool)> = scenes
        .iter()
        .filter(|s| s.estimate.is_some())
        .map(|s| (s.probability(), s.is_right(), s.is_visible()))
        .collect();
    let visible = scenes.iter().filter(|s| s.is_visible()).count();
    choices(answers, visible)
}

fn choices(mut answers: Vec<(f64, bool, bool)>, visible: usize) -> Vec<Choice> {
    answers.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (mut wrong, mut answered) = (0, 0);
    let mut choices: Vec<Choice> = Vec::new();
    for (k, &(threshold, right, is_visible)) in answers.iter().enumerate() {
        wrong += usize::from(!right);
        answered += usize::from(is_visible);
        // Equal probabilities are answered together.
        if answers.get(k + 1).is_some_and(|next| next.0 == threshold) {
            continue;
        }
        let coverage = answered as f64 / visible.max(1) as f64;
        choices.push(Choice { threshold, coverage, risk: wrong as f64 / (k + 1) as f64, answers: k + 1, wrong });
    }
    choices
}

/// What `threshold` gives.
pub fn at(choices: &[Choice], threshold: f64) -> Choice {
    let last = choices.iter().rev().find(|c| c.threshold >= threshold).copied();
    let none = Choice { threshold, coverage: 0.0, risk: 0.0, answers: 0, wrong: 0 };
    Choice { threshold, ..last.unwrap_or(none) }
}

/// Mean square of probability less outcome: 0 for an oracle, 0.25 for a coin.
pub fn brier(scenes: &[Examined]) -> f64 {
    let squares = scenes.iter().map(|s| (s.probability() - f64::from(u8::from(s.is_right()))).powi(2));
    squares.sum::<f64>() / scenes.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_hold_what_belongs_to_them() {
        let answers = [(0.0, false), (0.01, false), (0.95, true), (0.97, false), (1.0, true)];
        let bins = bins(&answers);
        assert_eq!(bins.iter().map(|b| b.count).collect::<Vec<_>>(), [2, 2, 1]);
        assert_eq!((bins[0].right, bins[1].right, bins[2].right), (0.0, 0.5, 1.0));
        assert!((bins[1].claimed - 0.96).abs() < 1e-12);
        assert!(bins.iter().all(|b| b.interval[0] - 1e-12 <= b.right && b.right <= b.interval[1] + 1e-12));
        // Wilson's own example of none in ten: up to 0.278.
        assert!((wilson(0, 10)[1] - 0.2775).abs() < 1e-3 && wilson(0, 10)[0].abs() < 1e-12);
    }

    #[test]
    fn refusing_the_unsure_lowers_risk_and_coverage() {
        // Probability, right, visible: the last two are answers without a visible net.
        let answers =
            vec![(0.9, true, true), (0.8, true, true), (0.4, false, true), (0.4, false, false), (0.1, false, false)];
        let all = choices(answers, 4);
        assert_eq!(all.iter().map(|c| (c.answers, c.wrong)).collect::<Vec<_>>(), [(1, 0), (2, 0), (4, 2), (5, 3)]);
        assert_eq!((at(&all, 0.5).coverage, at(&all, 0.5).risk), (0.5, 0.0));
        assert_eq!((at(&all, 0.3).coverage, at(&all, 0.3).risk), (0.75, 0.5));
        assert_eq!(at(&all, 0.95).answers, 0);
    }
}
