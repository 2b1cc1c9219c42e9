//! Rays, bounds, frames, transforms and error-bounded arithmetic, on top of glam.

mod keyframes;
pub mod poly;
mod ray;

pub use glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, DVec4, Mat3, Quat, Vec2, Vec3, Vec4};
pub use keyframes::{TransformKeys, angle_between, mix, segment, transform_at};
pub use ray::{Hit, NO_HIT, OriginPrimitive, Ray};
pub use ray::{MACHINE_EPSILON, gamma, next_down, next_up, offset_along, offset_ray_origin};

/// Selects one of two vectors without a branch, so that loops vectorise.
#[inline(always)]
pub fn select(condition: bool, yes: Vec3, no: Vec3) -> Vec3 {
    let pick = |a: f32, b: f32| if condition { a } else { b };
    Vec3::new(pick(yes.x, no.x), pick(yes.y, no.y), pick(yes.z, no.z))
}

/// Are all numbers finite? Those that are not have the exponent of infinity. There is no branch, so that many are looked at
/// in one step.
pub fn all_finite(numbers: &[f32]) -> bool {
    const EXPONENT: u32 = f32::INFINITY.to_bits();
    let is_bad = |x: &f32| u32::from(x.to_bits() & EXPONENT == EXPONENT);
    numbers.iter().fold(0, |bad, x| bad | is_bad(x)) == 0
}

/// How many are NaN or infinite.
pub fn count_not_finite(numbers: &[f32]) -> usize {
    numbers.iter().filter(|x| !x.is_finite()).count()
}

/// Two unit vectors that complete unit `n` to a right-handed frame, without a branch on its direction
/// (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
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
    /// The box that holds nothing.
    pub const EMPTY: Bounds3 = Bounds3 { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around some points.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Bounds3 {
        points.into_iter().fold(Bounds3::EMPTY, Bounds3::with)
    }

    /// Grown to hold a point.
    #[inline(always)]
    pub fn with(self, p: Vec3) -> Bounds3 {
        Bounds3 { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The smallest box that holds both.
    #[inline(always)]
    pub fn union(self, other: Bounds3) -> Bounds3 {
        Bounds3 { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Does it hold no point?
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The middle.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_and_infinity_are_found_wherever_they_are() {
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
}

#[cfg(test)]
mod frame_tests {
    use super::*;

    #[test]
    fn basis_is_orthonormal_and_right_handed() {
        for n in [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Z, Vec3::Z, Vec3::new(0.6, -0.48, -0.64)] {
            let (s, t) = orthonormal_basis(n);
            assert!((s.cross(t) - n).length() < 1e-6, "{n}");
            assert!(s.dot(t).abs() < 1e-6 && (s.length() - 1.0).abs() < 1e-6);
        }
    }
}
