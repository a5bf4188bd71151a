//! Camera calibrations, from files and from messages, to [`Camera`].
//!
//! | model | names it goes by | coefficients |
//! |---|---|---|
//! | [`Lens::None`] | `none`, or no coefficients at all | 0 |
//! | [`Lens::PlumbBob`] | `plumb_bob`, `radtan`, `radial-tangential` | 4 or 5 |
//! | [`Lens::Rational`] | `rational_polynomial` | 8 |
//! | [`Lens::KannalaBrandt`] | `equidistant`, `fisheye`, `equi`, `kannala_brandt` | 4 |
//!
//! More coefficients than these are accepted if the rest is zero. Whatever else does not fit is refused: a camera that is nearly
//! right gives poses that are wrong.

mod camera_info;
mod kalibr;
mod yaml;

use std::path::{Path, PathBuf};

use net_geometry::{Camera, Lens};

use crate::error::{Error, Result};

/// Largest calibration file that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Name of the calibration that belongs to the images beside it.
pub const CAMERA_YAML: &str = "camera.yaml";

/// The calibration in `folder` that belongs to the images there, not read: [`CAMERA_YAML`], if there is such a file.
pub fn camera_beside(folder: &Path) -> Option<PathBuf> {
    Some(folder.join(CAMERA_YAML)).filter(|path| path.is_file())
}

/// Reads the camera of a ROS `camera_info` YAML, or of a Kalibr camchain YAML of one camera.
///
/// # Errors
/// [`Error::Calibration`] names file, field and value; [`Error::Io`] the path.
pub fn read_camera(path: &Path) -> Result<Camera> {
    read_camera_of(path, None)
}

/// As [`read_camera`]; of a Kalibr file of several cameras it takes the one whose `rostopic` is `topic`.
///
/// # Errors
/// As [`read_camera`], and [`Error::Calibration`] if the file has several cameras and none is for `topic`.
pub fn read_camera_of(path: &Path, topic: Option<&str>) -> Result<Camera> {
    let place = path.display().to_string();
    let length = std::fs::metadata(path).map_err(Error::io("read", path))?.len();
    if length > MAX_BYTES {
        return Err(wrong(&place, "size", format!("{length} bytes"), "a YAML file of a camera's calibration"));
    }
    let bytes = std::fs::read(path).map_err(Error::io("read", path))?;
    parse_camera(&place, &bytes, topic)
}

/// As [`read_camera_of`], from the bytes of a file called `place`.
pub(crate) fn parse_camera(place: &str, bytes: &[u8], topic: Option<&str>) -> Result<Camera> {
    let text = std::str::from_utf8(bytes)
        .map_err(|e| wrong(place, "text", format!("not UTF-8 from byte {}", e.valid_up_to()), "a YAML file"))?;
    if text.lines().any(|line| line.starts_with("cam0:")) {
        return kalibr::parse(place, text, topic);
    }
    camera_info::parse(place, text)
}

/// The numbers of a calibration, wherever they were found.
pub(crate) struct Calibration<'a> {
    /// File or topic, for messages.
    pub place: &'a str,
    pub width: u32,
    pub height: u32,
    /// `fx, fy, cx, cy`, px.
    pub intrinsics: [f64; 4],
    /// The lens model as the file calls it.
    pub model: &'a str,
    /// What the file calls `model` and `coefficients`.
    pub fields: [&'a str; 2],
    pub coefficients: &'a [f64],
}

impl Calibration<'_> {
    pub(crate) fn camera(&self) -> Result<Camera> {
        let [fx, fy, cx, cy] = self.intrinsics;
        let lens = self.lens()?;
        for (name, size) in [("image_width", self.width), ("image_height", self.height)] {
            if size == 0 || u64::from(size) > crate::picture::MAX_SIDE {
                return Err(wrong(self.place, name, size, "the size of the camera's images in pixels"));
            }
        }
        Camera::new(fx, fy, cx, cy, self.width, self.height, lens).map_err(|e| match e {
            net_geometry::Error::Value { field, value, expected } => wrong(self.place, field, value, expected),
            net_geometry::Error::NearlyBlind { expected, .. } => {
                wrong(self.place, self.fields[1], format!("{:?}", self.coefficients), &expected)
            }
            other => wrong(self.place, "camera", "refused", &other.to_string()),
        })
    }

    fn lens(&self) -> Result<Lens> {
        let [model_field, coefficients_field] = self.fields;
        let given = self.coefficients;
        if let Some(bad) = given.iter().find(|k| !k.is_finite()) {
            return Err(wrong(self.place, coefficients_field, bad, "finite numbers"));
        }
        if given.is_empty() {
            return Ok(Lens::None);
        }
        let take = |most: usize, counts: &str| {
            let enough = given.len() >= 4.min(most) && (given.len() <= 5 || given.len() >= most || most <= 5);
            if enough && given.iter().skip(most).all(|&k| k == 0.0) {
                return Ok(given);
            }
            let expected = format!("{counts} numbers for {}", self.model);
            Err(wrong(self.place, coefficients_field, format!("{given:?}"), &expected))
        };
        match self.model.to_ascii_lowercase().as_str() {
            "none" | "" | "pinhole" => take(0, "no").map(|_| Lens::None),
            "plumb_bob" | "radtan" | "radial-tangential" | "radial_tangential" => {
                take(5, "4 or 5").map(|k| Lens::PlumbBob(padded(k)))
            }
            "rational_polynomial" => {
                if given.len() < 8 {
                    let expected = format!("8 numbers for {}", self.model);
                    return Err(wrong(self.place, coefficients_field, format!("{given:?}"), &expected));
                }
                take(8, "8").map(|k| Lens::Rational(padded(k)))
            }
            "equidistant" | "fisheye" | "equi" | "kannala_brandt" => {
                take(4, "4").map(|k| Lens::KannalaBrandt(padded(k)))
            }
            _ => Err(wrong(
                self.place,
                model_field,
                format!("{:?}", self.model),
                "one of none, plumb_bob (radtan), rational_polynomial, equidistant (fisheye, equi)",
            )),
        }
    }
}

/// The first `N` coefficients, zeros behind them.
fn padded<const N: usize>(given: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| given.get(i).copied().unwrap_or(0.0))
}

/// [`Error::Calibration`].
pub(crate) fn wrong(place: &str, field: &str, value: impl ToString, expected: &str) -> Error {
    Error::Calibration {
        place: place.to_owned(),
        field: field.to_owned(),
        value: value.to_string(),
        expected: format!("expected {expected}"),
    }
}

/// `fx, fy, cx, cy` of a row-major 3 x 3 camera matrix, or of the left 3 x 3 of a 3 x 4 projection matrix.
pub(crate) fn intrinsics_of(place: &str, field: &str, data: &[f64]) -> Result<[f64; 4]> {
    let columns = match data.len() {
        9 => 3,
        12 => 4,
        n => return Err(wrong(place, field, format!("of {n} numbers"), "3 x 3 numbers")),
    };
    let at = |row: usize, column: usize| data[row * columns + column];
    for (row, column, expected) in [(0, 1, 0.0), (1, 0, 0.0), (2, 0, 0.0), (2, 1, 0.0), (2, 2, 1.0)] {
        // Some files carry the rounding of a matrix product.
        if (at(row, column) - expected).abs() > 1e-9 || at(row, column).is_nan() {
            // A matrix of zeros is what drivers send for a camera that was never calibrated.
            let expected = format!("{expected}; a pinhole has [fx, 0, cx, 0, fy, cy, 0, 0, 1], with no skew");
            return Err(wrong(place, &format!("{field}, row {row}, column {column}"), at(row, column), &expected));
        }
    }
    Ok([at(0, 0), at(1, 1), at(0, 2), at(1, 2)])
}

#[cfg(test)]
mod tests;
