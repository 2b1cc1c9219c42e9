//! Rays, bounds, frames, transforms and error-bounded arithmetic, on top of glam.

mod bounds;
mod finite;
mod frame;
mod keys;
mod offset;
pub mod poly;
mod ray;

pub use bounds::Bounds3;
pub use finite::{all_finite, count_not_finite};
pub use frame::{Frame, orthonormal_basis};
pub use glam::{DAffine3, DMat3, DMat4, DQuat, DVec2, DVec3, DVec4, Mat3, Quat, Vec2, Vec3, Vec4};
pub use keys::{TransformKeys, angle_between, mix, segment, transform_at};
pub use offset::{MACHINE_EPSILON, gamma, next_down, next_up, offset_along, offset_ray_origin};
pub use ray::{Hit, NO_HIT, OriginPrimitive, Ray};

/// One of two vectors, without a branch: loops that choose vectorise.
#[inline(always)]
pub fn select(condition: bool, yes: Vec3, no: Vec3) -> Vec3 {
    let pick = |a: f32, b: f32| if condition { a } else { b };
    Vec3::new(pick(yes.x, no.x), pick(yes.y, no.y), pick(yes.z, no.z))
}
