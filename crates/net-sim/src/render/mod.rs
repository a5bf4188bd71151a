//! From a scene to a picture, in the order light goes: backdrop, nets from back to front, sensor.

pub(crate) mod layer;
pub(crate) mod profile;
pub(crate) mod sensor;
pub(crate) mod stroke;
