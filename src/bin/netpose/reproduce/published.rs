//! Figures in print.

/// One cell of the thesis's tables 5.3 to 5.5: distance in cm, angle in degrees.
pub type Published = (f64, f64);

/// Rows of tables 5.3 (tilt 0), 5.4 (20) and 5.5 (40 degrees).
pub struct TiltRow {
    /// True tilt, degrees.
    pub tilt_deg: f64,
    /// True distance, cm.
    pub distance_cm: f64,
    /// Schellewald, Stahl and Kelasidi 2021.
    pub schellewald: Published,
    /// Strandenes 2023.
    pub thesis: Published,
}

const fn row(tilt_deg: f64, distance_cm: f64, schellewald: Published, thesis: Published) -> TiltRow {
    TiltRow { tilt_deg, distance_cm, schellewald, thesis }
}

/// Tables 5.3, 5.4 and 5.5. The thesis does not say whether the angle is an estimate or an error, nor about which axis the net is
/// turned; read as estimates they fit.
pub const TILT_TABLES: [TiltRow; 12] = [
    row(0.0, 80.0, (78.56, 4.9), (77.3, 4.2)),
    row(0.0, 120.0, (118.2, 4.7), (118.8, 0.2)),
    row(0.0, 160.0, (156.15, 6.6), (159.7, 0.05)),
    row(0.0, 200.0, (198.5, 5.2), (201.7, 1.5)),
    row(20.0, 80.0, (80.06, 16.0), (84.4, 22.3)),
    row(20.0, 120.0, (119.21, 11.6), (120.4, 22.8)),
    row(20.0, 160.0, (158.75, 1.6), (160.8, 16.98)),
    row(20.0, 200.0, (200.76, 4.2), (199.6, 13.78)),
    row(40.0, 80.0, (79.13, 5.3), (73.8, 21.7)),
    row(40.0, 120.0, (119.05, 2.8), (104.2, 18.7)),
    row(40.0, 160.0, (153.38, 5.9), (149.0, 32.5)),
    row(40.0, 200.0, (197.51, 6.2), (179.5, 33.5)),
];

/// Section 5.2.1 and 5.2.2: true distance, m, the scenario that draws it, and what the thesis says of it.
pub const RANGES: [(f64, &str, &str); 4] = [
    (0.6, "fig-5.3", "0.598 m"),
    (3.0, "fig-5.4", "3.003 m (confidence 1.37, 1.29)"),
    (4.0, "fig-5.5", "misread (confidence 1.15, 1.02)"),
    (6.0, "far-6m", "-"),
];

/// Section 5.2.3 and 6.3: junctions found in the grid of 30 x 50 lines at 3 m and 30 degrees, with clusters of 6 and of 3 px.
pub const JUNCTIONS_EPS_6: u32 = 878;
/// See [`JUNCTIONS_EPS_6`].
pub const JUNCTIONS_EPS_3: u32 = 1201;

/// Section 5.5: where the tracked junction ended and should have ended, px: after 99 summed flows, straight from the first to the
/// last frame, and after the loop of 125 frames.
pub const TRACKING: [(&str, [f64; 2], [f64; 2]); 3] = [
    ("99 flows summed", [171.0, 167.0], [177.0, 170.0]),
    ("first to last frame at once", [176.0, 171.0], [177.0, 170.0]),
    ("loop of 125 frames", [278.0, 45.0], [287.0, 55.0]),
];
