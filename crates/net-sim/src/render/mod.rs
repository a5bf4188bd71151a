//! From a scene to a picture, in the order light goes: open water, backdrop, nets and objects from back to front, snow, lens, sensor.

pub(crate) mod backdrop;
pub(crate) mod blur;
pub(crate) mod jpeg;
pub(crate) mod layer;
pub(crate) mod object;
pub(crate) mod profile;
pub(crate) mod sensor;
pub(crate) mod snow;
mod spot;
pub(crate) mod stroke;
mod twine;
pub(crate) mod water;
