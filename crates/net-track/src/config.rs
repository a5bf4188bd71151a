use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Parameters of the smoother.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// How restless the vehicle's speed is: density of white acceleration, m/s² per root of a hertz, 0.001 to 100. In a second the speed changes by about so many m/s.
    /// Default 0.2, an inspection vehicle in waves. Higher follows the measurements more closely and hides slips in motion.
    pub acceleration_density: f64,
    /// The same of turning, rad/s² per root of a hertz, 0.001 to 100. Default 0.15.
    pub turning_density: f64,
    /// No faster than this, m/s, 0.01 to 100: a bound. Default 2.
    pub speed_max_m_s: f64,
    /// No change of speed beyond this, m/s², 0.01 to 1000: a bound. Default 3.
    pub acceleration_max_m_s2: f64,
    /// Deviations beyond which a measurement's cost grows linearly (Huber, over all six numbers together), 1 to 100. Default 4: of six
    /// normal numbers one in a hundred is longer. A measurement that is still farther off in the end has no say at all. Lower resists outliers more.
    pub huber_deviations: f64,
    /// Price of a slip of one cell in the convex program, in half squared deviations, 1 to 1000. Default 10. Lower proposes more slips, and more wrong ones.
    pub slip_price: f64,
    /// Least gain in log likelihood of a slip of whole cells before it is handed to the verifier, 1 to 10000. Default 12.
    pub slip_min_gain: f64,
    /// Largest distance of a slip, as estimated, from whole cells, 0.05 to 0.5. Default 0.35.
    pub slip_max_rounding_cells: f64,
    /// Measurements of a lower probability do not count, 0 to 1. Default 0.5.
    pub min_probability: f64,
    /// Longest time without a measurement over which the motion is carried, s, 0.001 to 60. Default 1. Longer gaps part the run.
    pub longest_gap_s: f64,
    /// Samples of one convex program, 8 to 2000. Default 120. Time grows with it in proportion.
    pub window: usize,
    /// Samples that neighbouring programs share, 4 to half of `window`. Default 30. It must be longer than the smoother's memory.
    pub overlap: usize,
    /// Samples after a sample that the online smoother waits for, 1 to 500. Default 10.
    pub lag: usize,
    /// Samples of the online smoother's program, the lag included: more than `lag`, at most 2000. Default 30.
    pub online_window: usize,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            acceleration_density: 0.2,
            turning_density: 0.15,
            speed_max_m_s: 2.0,
            acceleration_max_m_s2: 3.0,
            huber_deviations: 4.0,
            slip_price: 10.0,
            slip_min_gain: 12.0,
            slip_max_rounding_cells: 0.35,
            min_probability: 0.5,
            longest_gap_s: 1.0,
            window: 120,
            overlap: 30,
            lag: 10,
            online_window: 30,
        }
    }
}

impl Config {
    /// Refuses values out of range.
    ///
    /// # Errors
    /// [`Error::Parameter`] names the field and the value.
    pub fn validate(&self) -> Result<()> {
        let within = |field, value: f64, low: f64, high: f64, expected| {
            if value >= low && value <= high { Ok(()) } else { Err(Error::Parameter { field, value, expected }) }
        };
        within("acceleration_density", self.acceleration_density, 1e-3, 100.0, "0.001 to 100")?;
        within("turning_density", self.turning_density, 1e-3, 100.0, "0.001 to 100")?;
        within("speed_max_m_s", self.speed_max_m_s, 0.01, 100.0, "0.01 to 100 m/s")?;
        within("acceleration_max_m_s2", self.acceleration_max_m_s2, 0.01, 1000.0, "0.01 to 1000 m/s²")?;
        within("huber_deviations", self.huber_deviations, 1.0, 100.0, "1 to 100 deviations")?;
        within("slip_price", self.slip_price, 1.0, 1000.0, "1 to 1000")?;
        within("slip_min_gain", self.slip_min_gain, 1.0, 1e4, "1 to 10000")?;
        within("slip_max_rounding_cells", self.slip_max_rounding_cells, 0.05, 0.5, "0.05 to 0.5 cells")?;
        within("min_probability", self.min_probability, 0.0, 1.0, "0 to 1")?;
        within("longest_gap_s", self.longest_gap_s, 1e-3, 60.0, "0.001 to 60 s")?;
        within("window", self.window as f64, 8.0, 2000.0, "8 to 2000 samples")?;
        within("overlap", self.overlap as f64, 4.0, (self.window / 2) as f64, "4 to half of the window")?;
        within("lag", self.lag as f64, 1.0, 500.0, "1 to 500 samples")?;
        within("online_window", self.online_window as f64, (self.lag + 1) as f64, 2000.0, "more than lag, at most 2000")
    }
}
