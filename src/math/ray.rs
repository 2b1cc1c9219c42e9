//! Rays and what they hit: the data that all traversal kernels exchange.

use super::Vec3;
use bytemuck::{Pod, Zeroable};

/// `origin + t * direction` for `t_min < t < t_max`. The direction need not have unit length.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
pub struct Ray {
    /// Where the ray starts.
    pub origin: Vec3,
    /// Hits at or before this parameter don't count; at least 0.
    pub t_min: f32,
    /// Where it goes.
    pub direction: Vec3,
    /// Hits at or after this parameter don't count; may be infinite.
    pub t_max: f32,
    /// The primitive that it starts on.
    pub origin_primitive: OriginPrimitive,
}

const _: () = assert!(size_of::<Ray>() == 40);

/// The primitive that a ray starts on. A triangle or quad, which is flat, can't be hit by such a ray and needs no test. (A sphere
/// can.)
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
pub struct OriginPrimitive {
    /// Primitive id as in [`Hit`].
    pub prim: u32,
    /// Instance id as in [`Hit`].
    pub instance: u32,
}

impl OriginPrimitive {
    /// Nothing in particular.
    pub const NONE: OriginPrimitive = OriginPrimitive { prim: NO_HIT, instance: 0 };

    /// The primitive, where it belongs to an instance, else [`NO_HIT`].
    #[inline(always)]
    pub fn prim_of(&self, instance: u32) -> u32 {
        if self.instance == instance { self.prim } else { NO_HIT }
    }
}

impl From<&Hit> for OriginPrimitive {
    #[inline(always)]
    fn from(hit: &Hit) -> OriginPrimitive {
        OriginPrimitive { prim: hit.prim, instance: hit.instance }
    }
}

impl Ray {
    /// A ray without an end.
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3) -> Ray {
        Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY, origin_primitive: OriginPrimitive::NONE }
    }

    /// A ray that counts hits strictly before the point `origin + direction`.
    #[inline(always)]
    pub fn segment(origin: Vec3, direction: Vec3) -> Ray {
        Ray { t_max: 1.0, ..Ray::new(origin, direction) }
    }

    /// The point at parameter `t`.
    #[inline(always)]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// Primitive id of a [`Hit`] that hit nothing.
pub const NO_HIT: u32 = u32::MAX;

/// The nearest intersection of a ray.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
pub struct Hit {
    /// Ray parameter; infinite when nothing was hit.
    pub t: f32,
    /// First parameter on the primitive: weight of vertex 1 of a triangle, along edge 1 of a quad; 0 on spheres.
    pub u: f32,
    /// Second parameter: weight of vertex 2 of a triangle, along edge 2 of a quad; 0 on spheres.
    pub v: f32,
    /// Primitive id in its kind's order (see `accel`), or [`NO_HIT`].
    pub prim: u32,
    /// Instance id; 0 for geometry that is not instanced.
    pub instance: u32,
}

impl Hit {
    /// A ray that hit nothing.
    pub const MISS: Hit = Hit { t: f32::INFINITY, u: 0.0, v: 0.0, prim: NO_HIT, instance: 0 };

    /// Did the ray hit anything?
    #[inline(always)]
    pub fn is_hit(&self) -> bool {
        self.prim != NO_HIT
    }
}
