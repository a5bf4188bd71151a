//! Estimates as plain numbers and words, and back: what `pickle` and `copy` carry from process to process.

use net_geometry::nalgebra::{Matrix3, Matrix6, Rotation3, Vector2, Vector3};
use net_geometry::{Junction, JunctionState, Plane, Pose};
use netpose::{Connection, Layer, NetPose, Sheet, Status, Twine, TwineState};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// `u, v`, indices, sigma in px, state.
pub type JunctionNumbers = (f64, f64, Option<(i32, i32)>, f64, String);
/// Indices and direction, state, log likelihood ratio, contrast, width in px.
pub type TwineNumbers = (i32, i32, usize, String, f32, f32, Option<f32>);
/// The net, its probability, whether it is followed.
pub type LayerNumbers = (Vec<f64>, f64, bool);

/// Rotation and translation, covariance, range, distance, normal and sigmas, in their order in [`NetPose`].
const WITHOUT_SHEET: usize = 9 + 3 + 36 + 2 + 3 + 3;
/// The same, and the numbers of the sheet behind them; NaN for what was held.
const WITH_SHEET: usize = WITHOUT_SHEET + 11;

/// A net's pose as numbers.
pub fn from_net(net: &NetPose) -> Vec<f64> {
    let mut numbers = Vec::with_capacity(WITH_SHEET);
    numbers.extend(net.pose.rotation.matrix().iter());
    numbers.extend(net.pose.translation.iter());
    numbers.extend(net.covariance.iter());
    numbers.extend([net.range_m, net.distance_m]);
    numbers.extend(net.normal.iter());
    numbers.extend([net.sigma_range_m, net.sigma_tilt, net.sigma_xy_m]);
    if let Some(sheet) = &net.sheet {
        numbers.extend([sheet.crossing_angle, sheet.sigma_crossing_angle.unwrap_or(f64::NAN)]);
        numbers.extend(sheet.curvatures_per_m);
        numbers.extend(sheet.sigma_curvatures_per_m.unwrap_or([f64::NAN; 2]));
        numbers.extend(sheet.mean_plane.normal.iter());
        numbers.extend([sheet.mean_plane.distance, sheet.cell_margin]);
    }
    numbers
}

/// The pose that [`from_net`] took apart.
pub fn to_net(numbers: &[f64]) -> PyResult<NetPose> {
    if ![WITHOUT_SHEET, WITH_SHEET].contains(&numbers.len()) {
        return Err(foreign(numbers.len()));
    }
    let mut rest = numbers;
    let mut take = |count: usize| {
        let (taken, behind) = rest.split_at(count);
        rest = behind;
        taken
    };
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_column_slice(take(9)));
    let pose = Pose { rotation, translation: Vector3::from_column_slice(take(3)) };
    let covariance = Matrix6::from_column_slice(take(36));
    let (range_m, distance_m) = (take(1)[0], take(1)[0]);
    let normal = Vector3::from_column_slice(take(3));
    let (sigma_range_m, sigma_tilt, sigma_xy_m) = (take(1)[0], take(1)[0], take(1)[0]);
    let sheet = (numbers.len() == WITH_SHEET).then(|| Sheet {
        crossing_angle: take(1)[0],
        sigma_crossing_angle: Some(take(1)[0]).filter(|sigma| !sigma.is_nan()),
        curvatures_per_m: [take(1)[0], take(1)[0]],
        sigma_curvatures_per_m: Some([take(1)[0], take(1)[0]]).filter(|[sigma, _]| !sigma.is_nan()),
        mean_plane: Plane { normal: Vector3::from_column_slice(take(3)), distance: take(1)[0] },
        cell_margin: take(1)[0],
    });
    Ok(NetPose { pose, covariance, range_m, distance_m, normal, sigma_range_m, sigma_tilt, sigma_xy_m, sheet })
}

/// A junction as numbers.
pub fn from_junction(junction: &Junction) -> JunctionNumbers {
    let Junction { pixel, index, sigma_px, state } = junction;
    (pixel.x, pixel.y, *index, *sigma_px, state.as_str().to_owned())
}

/// The junction that [`from_junction`] took apart.
pub fn to_junction((u, v, index, sigma_px, state): JunctionNumbers) -> PyResult<Junction> {
    let known = JunctionState::ALL.into_iter().find(|known| known.as_str() == state);
    Ok(Junction { pixel: Vector2::new(u, v), index, sigma_px, state: known.ok_or_else(|| foreign(state))? })
}

/// A twine as numbers.
pub fn from_twine(twine: &Twine) -> TwineNumbers {
    let Twine { index, direction, state, llr, contrast, width_px } = twine;
    (index.0, index.1, *direction, state.as_str().to_owned(), *llr, *contrast, *width_px)
}

/// The twine that [`from_twine`] took apart.
pub fn to_twine((i, j, direction, state, llr, contrast, width_px): TwineNumbers) -> PyResult<Twine> {
    let state = TwineState::ALL.into_iter().find(|known| known.as_str() == state).ok_or_else(|| foreign(state))?;
    Ok(Twine { index: (i, j), direction, state, llr, contrast, width_px })
}

/// A layer as numbers.
pub fn from_layer(layer: &Layer) -> LayerNumbers {
    (from_net(&layer.net), layer.probability, layer.followed)
}

/// The layer that [`from_layer`] took apart.
pub fn to_layer((net, probability, followed): &LayerNumbers) -> PyResult<Layer> {
    Ok(Layer { net: to_net(net)?, probability: *probability, followed: *followed })
}

/// The word of a status.
pub fn to_status(word: &str) -> PyResult<&'static str> {
    let known = [Status::Ok, Status::NoNet].into_iter().map(Status::as_str);
    known.into_iter().find(|&known| known == word).ok_or_else(|| foreign(word))
}

/// The word of a connection.
pub fn to_connection(word: &str) -> PyResult<&'static str> {
    use Connection::{Doubted, Followed, Recognised, Restarted, Settled, Started};
    let known = [Started, Followed, Doubted, Settled, Recognised, Restarted].into_iter().map(Connection::as_str);
    known.into_iter().find(|&known| known == word).ok_or_else(|| foreign(word))
}

fn foreign(what: impl std::fmt::Debug) -> PyErr {
    PyValueError::new_err(format!("this was pickled by another version of netpose_rs: {what:?} is not known"))
}
