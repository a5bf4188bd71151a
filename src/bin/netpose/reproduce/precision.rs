//! How precise each stage is, and how precise any estimator could be.

use anyhow::{Context, Result};
use net_geometry::Pose;
use net_geometry::nalgebra::Vector3;
use net_lattice::LatticeEstimator;
use net_sim::{LayerTruth, Simulator, Study};
use netpose::{Config, Method};

use super::bound::{Bound, Errors};
use super::reading::{Picture, Reading};
use super::table::Table;
use crate::eval::PoseError;
use crate::progress::Progress;
use crate::stats::{median, quantile};

/// Seed of the first scene: no other study of this house has come near it.
const FIRST_SEED: u64 = 700_000;

/// A row of the table.
#[derive(Default)]
struct Row {
    name: &'static str,
    /// Of the answers that are right.
    errors: Vec<Errors>,
    /// Each error over the one that half of the draws at the bound exceed in the same picture.
    ratios: Vec<Errors>,
    wrong: usize,
    /// Whether the place along the net is known to it.
    has_place: bool,
}

impl Row {
    fn new(name: &'static str, has_place: bool) -> Self {
        Self { name, has_place, ..Self::default() }
    }

    fn add(&mut self, pose: &Pose, net: &LayerTruth, limit: &Errors) -> Result<()> {
        match errors(pose, net)? {
            Some(errors) => {
                self.errors.push(errors);
                self.ratios.push(std::array::from_fn(|k| errors[k] / limit[k]));
            }
            None => self.wrong += 1,
        }
        Ok(())
    }

    fn cells(&self, pictures: u32) -> Vec<String> {
        let of = |values: &[Errors], k: usize| values.iter().map(|e| e[k]).collect::<Vec<f64>>();
        let mut cells = vec![self.name.to_owned(), format!("{}/{pictures}", self.errors.len()), self.wrong.to_string()];
        for k in 0..3 {
            if k == 2 && !self.has_place || self.errors.is_empty() {
                cells.extend(["-".to_owned(), "-".to_owned()]);
                continue;
            }
            let errors = of(&self.errors, k);
            cells.push(format!("{:.4} / {:.4}", median(&errors), quantile(&errors, 0.95)));
            let ratios = of(&self.ratios, k);
            cells.push(format!("{:.2}", median(&ratios)));
        }
        cells
    }
}

/// The table over so many random scenes: flat square nets and noise, nothing else amiss ([`Study::Noise`]).
pub fn run(pictures: u32, progress: &mut Progress) -> Result<Table> {
    let thesis = Config { method: Method::Thesis, ..Config::default() };
    let lattice = Config::default().lattice;
    let mut rows = [
        Row::new("thesis", false),
        Row::new("wave vectors", false),
        Row::new("lock-in", true),
        Row::new("likelihood", true),
    ];
    let mut limit: Vec<Errors> = Vec::new();
    for seed in FIRST_SEED..FIRST_SEED + u64::from(pictures) {
        let scenario = Study::Noise.scenario(seed);
        let frame = scenario.frame(0)?;
        let camera = scenario.camera()?;
        let mut simulator = Simulator::new(camera);
        let draws = Bound::new(&mut simulator, &frame.scene).with_context(|| scenario.name.clone())?.draws();
        let middle: Errors = std::array::from_fn(|k| median(&draws.iter().map(|d| d[k]).collect::<Vec<f64>>()));
        limit.extend(draws);

        let picture = super::reading::draw(&scenario, 0)?;
        let Picture { image, net, .. } = &picture;
        if let Some((claim, _)) = Reading::new(&thesis, &scenario, &picture)?.net {
            rows[0].add(&claim.pose, net, &middle)?;
        }
        let mut estimator = LatticeEstimator::new(&camera, &scenario.mesh()?, &lattice)?;
        let found = estimator.estimate(image.view().context("a picture without pixels")?)?;
        let claim = found.filter(|e| e.probability >= lattice.probability_threshold);
        if let (Some(claim), Some(stages)) = (claim, estimator.stages()) {
            for (row, pose) in rows[1..].iter_mut().zip([&stages.wave_vectors, &stages.lock_in, &claim.pose]) {
                row.add(pose, net, &middle)?;
            }
        }
        progress.step(String::new);
    }
    let mut table = Table::new(
        "Precision by stage, and the limit",
        ["", "right", "wrong", "range %", "over bound", "normal °", "over bound", "x-y mm", "over bound"],
        &format!(
            "{pictures} random pictures of flat 50 mm nets, 0.4 to 4 m, tilt to 55°, contrast over noise 1 to 10 (`net_sim::Study::Noise` from \
             seed {FIRST_SEED}). Median / 95th percentile over the right answers; x-y modulo one cell. Bound: Cramér and Rao's for the pose, everything \
             else known, as errors of an estimator that reaches it. Over bound: median over the pictures of the error, each in units of what half of the \
             errors at its bound exceed; 1 is the best there is. Wave vectors and lock-in are stages of the answers that the likelihood gave and claimed."
        ),
    );
    for row in &rows {
        table.row(row.cells(pictures));
    }
    let bound = Row { name: "bound", errors: limit, has_place: true, ..Row::default() };
    let mut cells = bound.cells(pictures);
    for k in [1, 2, 4, 6, 8] {
        cells[k] = "-".into();
    }
    table.row(cells);
    Ok(table)
}

/// Range %, normal °, place along the net on the axis, mm, modulo a cell; `None` for a wrong pose.
fn errors(pose: &Pose, net: &LayerTruth) -> Result<Option<Errors>> {
    let axis = net.axis.context("the axis misses the net")?;
    let range = pose.plane().range().unwrap_or(f64::NAN);
    let error = PoseError::new(pose, range, &net.pose, axis.range_m, &net.mesh);
    if error.is_wrong() {
        return Ok(None);
    }
    let truth = net.lattice_at_axis().context("the axis misses the net")?.following(pose);
    let truth = truth.anchored_at(pose.translation)?.0;
    let at = |pose: &Pose, range: f64| pose.inverse_transform(Vector3::z() * range).xy();
    let aside = at(pose, range) - at(&truth.pose, axis.range_m);
    Ok(Some([error.range_percent.abs(), error.normal_deg, 1e3 * aside.norm()]))
}
