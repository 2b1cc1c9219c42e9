//! Rays, bounds, frames, transforms and error-bounded arithmetic, on top of glam.

mod bounds;
mod frame;
mod offset;
pub mod poly;
mod ray;

pub use bounds::Bounds3;
pub use frame::{Frame, orthonormal_basis};
pub use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Mat3, Vec2, Vec3, Vec4};
pub use offset::{MACHINE_EPSILON, gamma, next_down, next_up, offset_along, offset_ray_origin};
pub use ray::{Hit, NO_HIT, Ray};
