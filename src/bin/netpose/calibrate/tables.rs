//! What is printed: how far off, how sure, and where it fails.

use net_sim::{Extent, Study};

use super::curves;
use super::scene::{Examined, Net};
use crate::reproduce::table::Table;
use crate::stats::{median, quantile};

/// All tables, for answers from `threshold` on.
pub fn all(scenes: &[Examined], threshold: f64) -> Vec<Table> {
    let mut tables = vec![accuracy(scenes, threshold), reliability(scenes), choices(scenes, threshold)];
    tables.push(conditions(scenes, threshold));
    if scenes.iter().any(|s| s.study == Study::Negative) {
        tables.push(negatives(scenes, threshold));
    }
    tables.push(lies(scenes, threshold));
    tables
}

/// Scenes with their outcome counted.
#[derive(Debug, Default)]
struct Tally {
    scenes: usize,
    visible: usize,
    right: usize,
    wrong: usize,
    /// Visible, an estimate within the limits, and yet not answered.
    held_back: usize,
    /// Visible, and not even found.
    missed: usize,
}

impl Tally {
    fn of<'a>(scenes: impl Iterator<Item = &'a Examined>, threshold: f64) -> Self {
        let mut tally = Self::default();
        for s in scenes {
            let answered = s.probability() >= threshold;
            tally.scenes += 1;
            tally.visible += usize::from(s.is_visible());
            tally.right += usize::from(answered && s.is_right());
            tally.wrong += usize::from(answered && !s.is_right());
            tally.held_back += usize::from(s.is_visible() && !answered && s.is_right());
            tally.missed += usize::from(s.is_visible() && !answered && !s.is_right());
        }
        tally
    }

    fn cells(&self) -> Vec<String> {
        let counts = [self.scenes, self.visible, self.right, self.wrong, self.held_back, self.missed];
        counts.iter().map(usize::to_string).collect()
    }
}

const TALLY: [&str; 6] = ["scenes", "visible", "right", "wrong", "right but refused", "not found"];

/// Errors of the right answers, a row per study.
fn accuracy(scenes: &[Examined], threshold: f64) -> Table {
    let head = ["study"].into_iter().chain(TALLY).chain([
        "range %",
        "p95",
        "normal °",
        "p95",
        "crossing °",
        "p95",
        "x-y mm",
        "p95",
        "NEES median",
        "mean",
        "ms",
    ]);
    let note = "Errors are of the right answers: median and 95th percentile. Right: range within 5 %, normal and rotation in the plane \
                within 5°. Visible: at least 40 % of the knots in plain view, contrast at least half the noise, the whole net's picture \
                at least 30 times the noise. NEES: error squared in units of the claimed covariance, per degree of freedom; 1 is right.";
    let mut table = Table::new("The estimator on random scenes", head, note);
    for study in Study::ALL {
        let of: Vec<&Examined> = scenes.iter().filter(|s| s.study == study).collect();
        if of.is_empty() {
            continue;
        }
        let right = of.iter().filter(|s| s.probability() >= threshold && s.is_right());
        let errors: Vec<_> = right.filter_map(|s| s.error).collect();
        let mut row = vec![study.name().to_owned()];
        row.extend(Tally::of(of.iter().copied(), threshold).cells());
        let mut spread = |digits: usize, values: Vec<f64>| {
            row.extend([median(&values), quantile(&values, 0.95)].map(|v| figure(v, digits)));
        };
        spread(4, errors.iter().map(|e| e.pose.range_percent.abs()).collect());
        spread(4, errors.iter().map(|e| e.pose.normal_deg).collect());
        spread(3, errors.iter().map(|e| e.crossing_deg).collect());
        spread(3, errors.iter().map(|e| e.xy_mm).collect());
        let nees: Vec<f64> = errors.iter().map(|e| e.nees).collect();
        let mean = nees.iter().sum::<f64>() / nees.len() as f64;
        let ms: Vec<f64> = of.iter().map(|s| s.ms).collect();
        row.extend([figure(median(&nees), 2), figure(mean, 2), figure(median(&ms), 0)]);
        table.row(row);
    }
    table
}

fn figure(value: f64, digits: usize) -> String {
    if value.is_finite() { format!("{value:.digits$}") } else { "-".to_owned() }
}

/// What a probability is worth.
fn reliability(scenes: &[Examined]) -> Table {
    let note = format!("Brier score {:.4}. Scenes without a net are never right.", curves::brier(scenes));
    let head = ["probability", "scenes", "mean", "right", "95 % interval"];
    let mut table = Table::new("Reliability: how many of those are right", head, &note);
    for bin in curves::reliability(scenes) {
        table.row([
            format!("{:.2} to {:.2}", bin.span[0], bin.span[1]),
            bin.count.to_string(),
            format!("{:.3}", bin.claimed),
            format!("{:.3}", bin.right),
            format!("{:.3} to {:.3}", bin.interval[0], bin.interval[1]),
        ]);
    }
    table
}

/// What refusing costs and buys.
fn choices(scenes: &[Examined], threshold: f64) -> Table {
    let all = curves::risk_coverage(scenes);
    let note = format!(
        "ok means at least {threshold}. Coverage is of the visible nets; answers where there is no net are wrong."
    );
    let head = ["answered from", "coverage", "answers", "wrong", "risk"];
    let mut table = Table::new("Risk and coverage", head, &note);
    for at in [0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99] {
        let choice = curves::at(&all, at);
        table.row([
            format!("{at}"),
            format!("{:.1} %", 100.0 * choice.coverage),
            choice.answers.to_string(),
            choice.wrong.to_string(),
            format!("{:.2} %", 100.0 * choice.risk),
        ]);
    }
    table
}

/// A condition: its name, and which scenes with a net meet it.
type Condition = (&'static str, fn(&Examined, &Net) -> bool);

const CONDITIONS: [Condition; 31] = [
    ("range under 0.5 m", |_, n| n.range_m < 0.5),
    ("range 0.5 to 1 m", |_, n| (0.5..1.0).contains(&n.range_m)),
    ("range 1 to 2 m", |_, n| (1.0..2.0).contains(&n.range_m)),
    ("range 2 to 4 m", |_, n| (2.0..4.0).contains(&n.range_m)),
    ("range 4 m and more", |_, n| n.range_m >= 4.0),
    ("tilt under 20°", |_, n| n.tilt_deg() < 20.0),
    ("tilt 20 to 45°", |_, n| (20.0..45.0).contains(&n.tilt_deg())),
    ("tilt 45 to 60°", |_, n| (45.0..60.0).contains(&n.tilt_deg())),
    ("tilt 60° and more", |_, n| n.tilt_deg() >= 60.0),
    ("meshes under 6 px", |_, n| n.cell_px < 6.0),
    ("meshes 6 to 15 px", |_, n| (6.0..15.0).contains(&n.cell_px)),
    ("meshes 15 to 60 px", |_, n| (15.0..60.0).contains(&n.cell_px)),
    ("meshes 60 px and more", |_, n| n.cell_px >= 60.0),
    ("contrast under noise", |_, n| n.snr < 1.0),
    ("contrast 1 to 3 of noise", |_, n| (1.0..3.0).contains(&n.snr)),
    ("contrast 3 of noise and more", |_, n| n.snr >= 3.0),
    ("signal under 100", |_, n| n.signal < 100.0),
    ("signal 100 and more", |_, n| n.signal >= 100.0),
    ("nothing hidden", |_, n| n.visible_share > 0.97),
    ("up to a third hidden", |_, n| (0.67..=0.97).contains(&n.visible_share)),
    ("more than a third hidden", |_, n| n.visible_share < 0.67),
    ("defocus of 1 px and more", |s, _| s.scenario.scene.sensor.defocus_px >= 1.0),
    ("a lens that distorts", |s, _| !s.scenario.camera.distortion_coefficients.is_empty()),
    ("net ends in view", |s, _| s.scenario.scene.layers.iter().any(|l| l.net.extent != Extent::Full)),
    ("knots 2 % off and more", |s, _| s.scenario.scene.layers.iter().any(|l| l.net.jitter >= 0.02)),
    ("square mesh", |s, _| shape(s) == "square"),
    ("rectangular mesh", |s, _| shape(s) == "rectangle"),
    ("diamond mesh", |s, _| shape(s) == "diamond"),
    ("sheared by 8° and more", |s, _| s.scenario.scene.layers.iter().any(|l| l.net.shear_deg.abs() >= 8.0)),
    ("bent by 0.4 per metre and more", |_, n| bend(n) >= 0.4),
    ("dark twine", |s, _| s.scenario.scene.layers.iter().any(|l| l.net.twine.grey < s.scenario.scene.water.veil_grey)),
];

fn bend(net: &Net) -> f64 {
    net.curvatures_per_m[0].abs().max(net.curvatures_per_m[1].abs())
}

fn shape(scene: &Examined) -> &'static str {
    match scene.scenario.mesh() {
        Ok(mesh) if !mesh.is_right_angled() => "diamond",
        Ok(mesh) if mesh.side1() != mesh.side2() => "rectangle",
        _ => "square",
    }
}

/// Where nets are missed, or taken for others.
fn conditions(scenes: &[Examined], threshold: f64) -> Table {
    let head = ["condition"].into_iter().chain(TALLY).chain(["of the visible answered"]);
    let note = "Scenes with a net, of all studies. Not found: visible, and the best estimate is not right either.";
    let mut table = Table::new("By condition", head, note);
    for (name, meets) in CONDITIONS {
        let of = || scenes.iter().filter(|s| s.truth.as_ref().is_some_and(|n| meets(s, n)));
        let tally = Tally::of(of(), threshold);
        if tally.scenes == 0 {
            continue;
        }
        let answered = of().filter(|s| s.is_visible() && s.probability() >= threshold).count();
        let share = 100.0 * answered as f64 / tally.visible as f64;
        let mut row = vec![name.to_owned()];
        row.extend(tally.cells());
        row.push(if share.is_finite() { format!("{share:.0} %") } else { "-".to_owned() });
        table.row(row);
    }
    table
}

/// What is taken for a net.
fn negatives(scenes: &[Examined], threshold: f64) -> Table {
    let mut kinds: Vec<&str> =
        scenes.iter().filter(|s| s.study == Study::Negative).map(|s| s.scenario.description.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let head = ["no net", "scenes", "false alarms", "greatest probability"];
    let mut table = Table::new("Scenes without a net", head, "");
    for kind in kinds {
        let of = || scenes.iter().filter(|s| s.study == Study::Negative && s.scenario.description == kind);
        let alarms = of().filter(|s| s.probability() >= threshold).count();
        let most = of().map(Examined::probability).fold(0.0, f64::max);
        table.row([kind.to_owned(), of().count().to_string(), alarms.to_string(), format!("{most:.3}")]);
    }
    table
}

/// Every wrong answer, the surest first.
fn lies(scenes: &[Examined], threshold: f64) -> Table {
    const MOST: usize = 20;
    let mut wrong: Vec<&Examined> = scenes.iter().filter(|s| s.probability() >= threshold && !s.is_right()).collect();
    wrong.sort_by(|a, b| b.probability().total_cmp(&a.probability()));
    let note = format!("{} in all; the {MOST} surest are listed.", wrong.len());
    let head = ["scene", "probability", "true range m", "range %", "normal °", "in plane °"];
    let mut table = Table::new("Wrong answers", head, &note);
    for s in wrong.into_iter().take(MOST) {
        let error = |value: fn(&super::scene::Errors) -> f64| s.error.map_or("-".to_owned(), |e| figure(value(&e), 2));
        table.row([
            s.scenario.name.clone(),
            format!("{:.3}", s.probability()),
            s.truth.as_ref().map_or_else(|| s.scenario.description.clone(), |n| format!("{:.3}", n.range_m)),
            error(|e| e.pose.range_percent),
            error(|e| e.pose.normal_deg),
            error(|e| e.pose.inplane_deg),
        ]);
    }
    table
}
