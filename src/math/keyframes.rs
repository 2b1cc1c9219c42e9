//! Keyframes at equal steps of the shutter interval, with linear interpolation in between.
//!
//! Transforms are interpolated number by number. Every point then moves along straight lines from key to key, as the vertices
//! of a mesh do that is given by its shapes at the keys, and boxes around what it is at the keys hold it at all times. A
//! rotation by an angle a between two keys draws what it turns nearer by up to 1 - cos(a / 2).

use super::{DAffine3, DMat3};
use std::sync::Arc;

/// Transforms at equal steps of time.
pub type TransformKeys = Arc<[DAffine3]>;

/// The key before a time in 0..1 of `keys` keys, and the share of the way to the next one.
#[inline]
pub fn segment(keys: usize, time: f32) -> (usize, f32) {
    let steps = keys.saturating_sub(1);
    let at = time.clamp(0.0, 1.0) * steps as f32;
    let key = (at as usize).min(steps.saturating_sub(1));
    (key, at - key as f32)
}

/// The interpolated transform at a time in 0..1; the identity without keys.
#[inline]
pub fn transform_at(keys: &[DAffine3], time: f32) -> DAffine3 {
    let (key, share) = segment(keys.len(), time);
    let Some(from) = keys.get(key) else { return DAffine3::IDENTITY };
    let Some(to) = keys.get(key + 1) else { return *from };
    mix(from, to, f64::from(share))
}

/// Linear interpolation of two transforms; exact where they are equal.
#[inline]
pub fn mix(from: &DAffine3, to: &DAffine3, share: f64) -> DAffine3 {
    let (a, b) = (&from.matrix3, &to.matrix3);
    DAffine3 {
        matrix3: DMat3::from_cols(
            a.x_axis + (b.x_axis - a.x_axis) * share,
            a.y_axis + (b.y_axis - a.y_axis) * share,
            a.z_axis + (b.z_axis - a.z_axis) * share,
        ),
        translation: from.translation + (to.translation - from.translation) * share,
    }
}

/// The angle by which one transform is turned from another, radians; of stretched ones that of the axis turned farthest.
pub fn angle_between(from: &DAffine3, to: &DAffine3) -> f64 {
    let (a, b) = (&from.matrix3, &to.matrix3);
    let axes = [(a.x_axis, b.x_axis), (a.y_axis, b.y_axis), (a.z_axis, b.z_axis)];
    axes.into_iter().map(|(a, b)| a.cross(b).length().atan2(a.dot(b))).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DVec3;

    #[test]
    fn times_fall_between_their_keys() {
        assert_eq!(segment(2, 0.25), (0, 0.25));
        assert_eq!(segment(5, 0.25), (1, 0.0));
        assert_eq!(segment(5, 1.0), (3, 1.0));
        assert_eq!(segment(1, 0.7), (0, 0.0));
        let keys = [0.0, 4.0, 6.0].map(|x| DAffine3::from_translation(DVec3::X * x));
        for (time, x) in [(0.0, 0.0), (0.25, 2.0), (0.5, 4.0), (0.75, 5.0), (1.0, 6.0), (2.0, 6.0)] {
            assert_eq!(transform_at(&keys, time).translation.x, x);
        }
        assert_eq!(transform_at(&[], 0.5), DAffine3::IDENTITY);
        let same = DAffine3::from_axis_angle(DVec3::Y, 0.3);
        assert_eq!(transform_at(&[same, same], 0.3), same);
    }

    #[test]
    fn angles_are_those_of_the_rotation() {
        let turned = DAffine3::from_axis_angle(DVec3::Y, 0.3) * DAffine3::from_scale(DVec3::splat(7.0));
        assert!((angle_between(&DAffine3::IDENTITY, &turned) - 0.3).abs() < 1e-12);
    }
}
