//! Rays, hits, and robust ray origins (Pharr, Jakob, Humphreys 2023, "Physically Based Rendering", section 6.8).

use super::Vec3;
use bytemuck::{Pod, Zeroable};

/// `origin + t * direction` for `t_min < t < t_max`. The direction need not have unit length.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
pub struct Ray {
    pub origin: Vec3,
    /// Hits at or before this parameter are ignored; at least 0.
    pub t_min: f32,
    /// Direction, of any length.
    pub direction: Vec3,
    /// Hits at or after this parameter are ignored; may be infinite.
    pub t_max: f32,
    /// The primitive on which the ray starts.
    pub origin_primitive: OriginPrimitive,
}

const _: () = assert!(size_of::<Ray>() == 40);

/// The primitive on which a ray starts. If it is flat (a triangle or quad), the ray can't hit it, and the intersection test is skipped.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
pub struct OriginPrimitive {
    /// Primitive id as in [`Hit`].
    pub prim: u32,
    /// Instance id as in [`Hit`].
    pub instance: u32,
}

impl OriginPrimitive {
    pub const NONE: OriginPrimitive = OriginPrimitive { prim: NO_HIT, instance: 0 };

    /// The primitive if it belongs to `instance`, else [`NO_HIT`].
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
    /// An infinite ray.
    #[inline(always)]
    pub fn new(origin: Vec3, direction: Vec3) -> Ray {
        Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY, origin_primitive: OriginPrimitive::NONE }
    }

    /// A ray that ends at `origin + direction`, exclusive.
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

/// Primitive id of a miss.
pub const NO_HIT: u32 = u32::MAX;

/// The nearest intersection of a ray.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable, PartialEq)]
pub struct Hit {
    /// Ray parameter; infinite for a miss.
    pub t: f32,
    /// First surface parameter: barycentric weight of vertex 1 of a triangle, coordinate along edge 1 of a quad; 0 on spheres.
    pub u: f32,
    /// Second surface parameter: barycentric weight of vertex 2 of a triangle, coordinate along edge 2 of a quad; 0 on spheres.
    pub v: f32,
    /// Primitive id (see `accel`), or [`NO_HIT`].
    pub prim: u32,
    /// Instance id; 0 for world geometry.
    pub instance: u32,
}

impl Hit {
    pub const MISS: Hit = Hit { t: f32::INFINITY, u: 0.0, v: 0.0, prim: NO_HIT, instance: 0 };

    /// Did the ray hit anything?
    #[inline(always)]
    pub fn is_hit(&self) -> bool {
        self.prim != NO_HIT
    }
}

/// Unit roundoff: half the distance from 1 to the next f32, the largest relative error of one rounding.
pub const MACHINE_EPSILON: f32 = f32::EPSILON * 0.5;

/// Bound on the relative error of `n` successive roundings (Higham 2002, "Accuracy and Stability of Numerical Algorithms", lemma 3.1).
#[inline(always)]
pub const fn gamma(n: u32) -> f32 {
    (n as f32 * MACHINE_EPSILON) / (1.0 - n as f32 * MACHINE_EPSILON)
}

/// Offsets a point along the geometric normal `n`, to the side of `w`, just outside the error box `p +- p_error` (Pharr et al. 2023,
/// section 6.8.6).
#[inline(always)]
pub fn offset_ray_origin(p: Vec3, p_error: Vec3, n: Vec3, w: Vec3) -> Vec3 {
    let side = if w.dot(n) < 0.0 { -1.0 } else { 1.0 };
    offset_along(p, n * side, n.abs().dot(p_error))
}

/// Offsets a point by a distance along the unit vector `n`, rounded outward.
#[inline(always)]
pub fn offset_along(p: Vec3, n: Vec3, distance: f32) -> Vec3 {
    let offset = n * distance;
    let moved = p + offset;
    Vec3::new(
        push_outward(moved.x, offset.x),
        push_outward(moved.y, offset.y),
        push_outward(moved.z, offset.z),
    )
}

/// Moves a coordinate by one ulp in the direction of its offset. Branch-free, so that loops vectorise.
#[inline(always)]
fn push_outward(coordinate: f32, offset: f32) -> f32 {
    let bits = coordinate.to_bits() as i32;
    // Larger in magnitude if the offset points away from zero, else smaller.
    let away = (bits ^ offset.to_bits() as i32) >= 0;
    let stepped = f32::from_bits((if away { bits + 1 } else { bits - 1 }) as u32);
    if offset == 0.0 || coordinate == 0.0 { coordinate } else { stepped }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_points_to_the_side_of_the_direction() {
        for (n, w) in [(Vec3::Y, Vec3::Y), (Vec3::Y, -Vec3::Y), (Vec3::new(0.6, 0.8, 0.0), -Vec3::X)] {
            for p in [Vec3::ZERO, Vec3::splat(1e3), Vec3::new(-5.0, 1e-3, 7e5)] {
                let o = offset_ray_origin(p, p.abs() * gamma(7) + Vec3::splat(1e-30), n, w);
                assert!((o - p).dot(n) * w.dot(n) >= 0.0, "{n} {w} {p} {o}");
            }
        }
    }

    #[test]
    fn push_outward_matches_next_up_and_down() {
        for x in [1.0f32, -1.0, 3.5e-30, -7e20] {
            assert_eq!(push_outward(x, 1e-9), x.next_up());
            assert_eq!(push_outward(x, -1e-9), x.next_down());
        }
    }
}
