//! Coordinates far from the origin, such as those of maps: single floats keep seven digits, of which a distance of
//! millions of metres leaves none for the model. Meshes are kept around an origin of their own then, which is subtracted in
//! double precision before anything is rounded, and added again, in double precision, where they are placed.

use super::Loaded;
use crate::error::Warning;
use crate::math::DVec3;
use std::path::Path;

/// Maximum distance of a model from the origin in multiples of its size: beyond, f32 resolves less than a part in 2^18 of
/// its size.
const FARTHEST: f64 = 32.0;

/// The origin that meshes with these corners, as read into single floats, need: whole metres, on the axes that are far;
/// zero where that is none.
pub(super) fn origin<'a>(positions: impl Iterator<Item = &'a [f32; 3]>) -> DVec3 {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for p in positions {
        let p = DVec3::from(p.map(f64::from));
        if p.is_finite() {
            (min, max) = (min.min(p), max.max(p));
        }
    }
    if !(min.is_finite() && max.is_finite()) {
        return DVec3::ZERO;
    }
    let (size, middle) = ((max - min).length(), ((min + max) * 0.5).round());
    let far =
        |axis: usize| min[axis].abs().max(max[axis].abs()) > FARTHEST * size && middle[axis].abs() >= 256.0;
    DVec3::from_array([0, 1, 2].map(|axis| if far(axis) { middle[axis] } else { 0.0 }))
}

/// Places what was read around an origin where the file has it, and says so.
pub(super) fn place(path: &Path, origin: DVec3, loaded: &mut Loaded) {
    if origin == DVec3::ZERO {
        return;
    }
    for instance in &mut loaded.scene.instances {
        instance.world_from_object.translation += origin;
    }
    loaded.offset = origin;
    let [x, y, z] = origin.to_array();
    let message = format!(
        "the coordinates are finer than single floats: they are kept relative to ({x}, {y}, {z}); cameras are where the \
         file's coordinates say"
    );
    loaded.notes.push(Warning::new(path, "", message));
}
