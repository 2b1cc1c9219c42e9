//! Rays, bounds, frames, transforms and error-bounded arithmetic, on top of glam.
//!
//! Motion is defined by keyframes at equal steps of the shutter interval. Transforms are interpolated linearly per element, so points move
//! along straight lines between keys, like the vertices of a deforming mesh, and the union of the bounds at two keys contains an object
//! between them. A rotation by an angle a between two keys shrinks an object by a fraction of up to 1 - cos(a / 2).

pub use glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, DVec4, Mat3, Quat, Vec2, Vec3, Vec4};
pub use ray::{Hit, MACHINE_EPSILON, NO_HIT, OriginPrimitive, Ray, gamma, offset_along, offset_ray_origin};
use std::sync::Arc;
pub use tangent_frame::{frame_from_tangent, normal_matrix, uv_frame};

pub mod poly;
mod ray;
mod tangent_frame;

/// Selects one of two vectors without a branch, so that loops vectorise.
#[inline(always)]
pub fn select(condition: bool, yes: Vec3, no: Vec3) -> Vec3 {
    let pick = |a: f32, b: f32| if condition { a } else { b };
    Vec3::new(pick(yes.x, no.x), pick(yes.y, no.y), pick(yes.z, no.z))
}

/// Are all numbers finite? Compares exponents without branches, so that the loop vectorises.
pub fn all_finite(numbers: &[f32]) -> bool {
    const EXPONENT: u32 = f32::INFINITY.to_bits();
    let is_bad = |x: &f32| u32::from(x.to_bits() & EXPONENT == EXPONENT);
    numbers.iter().fold(0, |bad, x| bad | is_bad(x)) == 0
}

/// Number of NaN and infinite values.
pub fn count_not_finite(numbers: &[f32]) -> usize {
    numbers.iter().filter(|x| !x.is_finite()).count()
}

/// Two unit vectors that complete the unit vector `n` to a right-handed frame, branch-free (Duff et al. 2017, "Building an Orthonormal
/// Basis, Revisited").
#[inline(always)]
pub fn orthonormal_basis(n: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0f32.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let s = Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    let t = Vec3::new(b, sign + n.y * n.y * a, -n.y);
    (s, t)
}

/// An orthonormal frame; local z is the normal.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Local x in world space.
    pub s: Vec3,
    /// Local y in world space.
    pub t: Vec3,
    /// Local z in world space.
    pub n: Vec3,
}

impl Frame {
    /// A frame around a unit normal.
    #[inline(always)]
    pub fn from_normal(n: Vec3) -> Frame {
        let (s, t) = orthonormal_basis(n);
        Frame { s, t, n }
    }

    /// World to local.
    #[inline(always)]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Local to world.
    #[inline(always)]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

/// An axis-aligned box; empty when any `min` exceeds its `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds3 {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Bounds3 {
    /// The empty box.
    pub const EMPTY: Bounds3 = Bounds3 { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The bounding box of points.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Bounds3 {
        points.into_iter().fold(Bounds3::EMPTY, Bounds3::with)
    }

    /// Extended to contain a point.
    #[inline(always)]
    pub fn with(self, p: Vec3) -> Bounds3 {
        Bounds3 { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The smallest box that contains both.
    #[inline(always)]
    pub fn union(self, other: Bounds3) -> Bounds3 {
        Bounds3 { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Is the box empty?
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Edge lengths; zero for an empty box.
    pub fn extent(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { self.max - self.min }
    }

    /// The eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            Vec3::new(
                if i & 1 == 0 { self.min.x } else { self.max.x },
                if i & 2 == 0 { self.min.y } else { self.max.y },
                if i & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }
}

/// Transform keyframes at equal time steps.
pub type TransformKeys = Arc<[DAffine3]>;

/// Index of the key before a time in 0..1, among `keys` keys at equal time steps, and the interpolation weight of the next key.
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
    let (key, weight) = segment(keys.len(), time);
    let Some(from) = keys.get(key) else { return DAffine3::IDENTITY };
    let Some(to) = keys.get(key + 1) else { return *from };
    mix(from, to, f64::from(weight))
}

/// Linear interpolation of two transforms; exact if they are equal.
#[inline]
pub fn mix(from: &DAffine3, to: &DAffine3, weight: f64) -> DAffine3 {
    let (a, b) = (&from.matrix3, &to.matrix3);
    DAffine3 {
        matrix3: DMat3::from_cols(
            a.x_axis + (b.x_axis - a.x_axis) * weight,
            a.y_axis + (b.y_axis - a.y_axis) * weight,
            a.z_axis + (b.z_axis - a.z_axis) * weight,
        ),
        translation: from.translation + (to.translation - from.translation) * weight,
    }
}

/// The rotation angle between two transforms, radians: the largest angle between corresponding axes.
pub fn angle_between(from: &DAffine3, to: &DAffine3) -> f64 {
    let (a, b) = (&from.matrix3, &to.matrix3);
    let axes = [(a.x_axis, b.x_axis), (a.y_axis, b.y_axis), (a.z_axis, b.z_axis)];
    axes.into_iter().map(|(a, b)| a.cross(b).length().atan2(a.dot(b))).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn basis_is_orthonormal_and_right_handed() {
        for n in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Z, Vec3::Z, Vec3::new(0.6, -0.48, -0.64)] {
            let (s, t) = orthonormal_basis(n);
            assert!((s.cross(t) - n).length() < 1e-6, "{n}");
            assert!(s.dot(t).abs() < 1e-6 && (s.length() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn nan_and_infinity_are_found_at_any_position() {
        for bad in [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for at in 0..37 {
                let mut list = [f32::MAX, -f32::MAX, 1e-45, -0.0].repeat(10);
                assert!(all_finite(&list) && count_not_finite(&list) == 0);
                list[at] = bad;
                assert!(!all_finite(&list) && count_not_finite(&list) == 1, "{bad} at {at}");
            }
        }
        assert!(all_finite(&[]));
    }

    #[test]
    fn transforms_are_interpolated_between_keys() {
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
    fn angle_ignores_uniform_scale() {
        let rotated = DAffine3::from_axis_angle(DVec3::Y, 0.3) * DAffine3::from_scale(DVec3::splat(7.0));
        assert!((angle_between(&DAffine3::IDENTITY, &rotated) - 0.3).abs() < 1e-12);
    }
}
