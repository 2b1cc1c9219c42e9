//! The trait of analytic shapes, and its data types.

use crate::math::{Bounds3, Mat3, Ray, Vec2, Vec3};
use crate::simd::{BoxRay, ShearedLine};

/// An analytic shape. Lengths are in metres, in the space of its geometry.
pub trait Shape {
    /// Centre and radius of a bounding sphere. Shapes with a radius not above 0 are dropped.
    fn center_and_radius(&self) -> (Vec3, f32);

    /// Bounding box, up to rounding.
    fn bounds(&self) -> Bounds3 {
        let (center, radius) = self.center_and_radius();
        Bounds3 { min: center - Vec3::splat(radius), max: center + Vec3::splat(radius) }
    }

    /// Is it impossible for rays that start on the shape to hit it again?
    #[inline(always)]
    fn is_flat(&self) -> bool {
        self.normal().is_some()
    }

    /// Unit normal of the front, if it is constant.
    #[inline(always)]
    fn normal(&self) -> Option<Vec3> {
        None
    }

    /// The smallest ray parameter of an intersection in `t_min < t <= t_max`.
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32>;

    /// The surface at the intersection `p` of a ray from `origin`.
    fn surface(&self, p: Vec3, origin: Vec3) -> Surface;

    /// Texture coordinates at a point with the front normal `normal`; `object_from_world` rotates to object space.
    fn texture_coordinates(&self, point: Vec3, normal: Vec3, object_from_world: &Mat3) -> Vec2;

    /// The texture parametrization at a point with the front normal `normal`.
    fn parametrize(&self, normal: Vec3, object_from_world: &Mat3) -> Parametrization;

    /// Area of the front, square metres.
    fn area(&self) -> f32;

    /// Area of the largest orthographic projection, square metres.
    fn largest_projection(&self) -> f32;

    /// Unit normal of the front at a point; `reference` is the view point, used by shapes that face it ([`Shape::is_facing`]).
    fn normal_at(&self, point: Vec3, reference: Vec3) -> Vec3;

    /// Samples a point uniformly by area; on the bounding sphere if the shape faces each ray's origin.
    fn point_by_area(&self, u: [f32; 2]) -> Vec3;

    /// Samples a point of the shape as a light for `reference`.
    fn sample(&self, reference: Vec3, u: [f32; 2]) -> LightPoint;

    /// Solid-angle pdf of [`Shape::sample`] for a point visible from `reference`.
    fn pdf_solid_angle(&self, reference: Vec3, point: Vec3) -> f32;

    /// Does the shape turn to face each ray's origin, like a billboard?
    fn is_facing(&self) -> bool {
        false
    }

    /// For an emitted ray that reaches a receiver: the distance, metres, from the point where a ray from the receiver would hit the
    /// shape to the emitted ray's origin in front of it; `None` if that ray would miss the shape or hit
    /// it elsewhere. Not 0 for shapes that face the receiver.
    fn emission_offset(&self, _receiver: Vec3, _ray: &Ray) -> Option<f32> {
        Some(0.0)
    }

    /// Parameters of the shape, packed for the BVH.
    fn parameters(&self) -> [f32; 6];
}

/// Parametrization of a surface by texture coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Parametrization {
    /// Direction of increasing u on the surface; any length.
    pub tangent: Vec3,
    /// 1 if the up direction of images is `n x tangent`, else -1.
    pub handedness: f32,
    /// Change of texture coordinates per metre.
    pub uv_per_metre: f32,
}

/// A shape in the form stored in the BVH.
#[derive(Clone, Copy, Debug)]
pub struct Packed {
    /// Kind of the shape, above 0.
    pub kind: u8,
    /// Parameters ([`Shape::parameters`]).
    pub parameters: [f32; 6],
}

/// Dot product in double precision.
#[inline(always)]
pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// A point on a surface.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Position.
    pub p: Vec3,
    /// Error bound of the position by axis.
    pub p_error: Vec3,
    /// Unit geometric normal on the front.
    pub ng: Vec3,
    /// Unit shading normal, on the same side as `ng`.
    pub ns: Vec3,
    /// Material index.
    pub material: u32,
}

/// A point on a light, sampled from a reference point.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Position, in the space of the light's geometry.
    pub point: Vec3,
    /// Solid-angle pdf at the reference point; 0 if the light is seen edge-on, in which case the sample contributes nothing.
    pub pdf_solid_angle: f32,
}

/// Solid-angle pdf of a uniformly sampled point on a flat light of area `area`; `to_point` is the vector from the reference point, and
/// `unit_normal` the light's normal (either side). 0 if the light is seen edge-on.
#[inline(always)]
pub fn pdf_solid_angle_of_area(to_point: Vec3, unit_normal: Vec3, area: f32) -> f32 {
    let distance_squared = to_point.length_squared();
    // cos / distance * area, all over distance^2.
    let projected = to_point.dot(unit_normal).abs() * area;
    let pdf = distance_squared * distance_squared.sqrt() / if projected > 0.0 { projected } else { 1.0 };
    let is_visible = projected > 0.0 && pdf < f32::MAX;
    if is_visible { pdf } else { 0.0 }
}

/// A ray with its direction scaled by a power of two to a largest component in [1, 2). Ray parameters are in units of this direction. The
/// scaling is exact, so results don't depend on the direction's length.
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay {
    pub origin: [f32; 3],
    /// Scaled direction.
    pub direction: [f32; 3],
    /// Shear constants `Sx`, `Sy` of the triangle test (Woop, Benthin, Wald 2013, section 3.1).
    pub shear: [f32; 2],
    /// Factor (a power of two) from parameters of this ray to those of the original ray.
    pub unscale: f32,
}

impl PreparedRay {
    /// A ray that hits nothing, for unused slots.
    pub const NONE: PreparedRay =
        PreparedRay { origin: [0.0; 3], direction: [0.0; 3], shear: [0.0; 2], unscale: 1.0 };

    /// Prepares a ray in place, for geometry with absolute coordinates up to `reach`, and returns its parameter range; `None` if it can't
    /// hit anything: empty range, zero direction, or a non-finite component. (In place, since vector copies would stall on store
    /// forwarding of the scalar stores before them.)
    #[inline(always)]
    pub fn set(&mut self, boxes: &mut BoxRay, ray: &Ray, reach: f32) -> Option<(f32, f32)> {
        let range = self.set_scaled(ray)?;
        boxes.set(self.origin, self.direction, reach);
        let [kx, ky, kz] = boxes.axes();
        let sz = boxes.inverse(kz);
        self.shear = [self.direction[kx] * sz, self.direction[ky] * sz];
        Some(range)
    }

    /// [`PreparedRay::set`] without box tests; also returns the sheared line.
    #[inline(always)]
    pub fn set_line(&mut self, ray: &Ray) -> Option<((f32, f32), ShearedLine)> {
        let range = self.set_scaled(ray)?;
        let line = ShearedLine::new(self.origin, self.direction);
        self.shear = line.shear;
        Some((range, line))
    }

    /// Sets all but the shear, and returns the parameter range.
    #[inline(always)]
    fn set_scaled(&mut self, ray: &Ray) -> Option<(f32, f32)> {
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        let largest = d[0].abs().max(d[1].abs()).max(d[2].abs());
        // NaN if any component is infinite or NaN, else 0.
        let zero = (o[0] * 0.0 + o[1] * 0.0 + o[2] * 0.0) + (d[0] * 0.0 + d[1] * 0.0 + d[2] * 0.0);
        let t_min = if ray.t_min > 0.0 { ray.t_min } else { 0.0 };
        if !((zero == 0.0) & (largest > 0.0) & (t_min < ray.t_max)) {
            return None;
        }
        let (scale, unscale) = power_of_two_scale(largest);
        self.origin = o;
        self.direction = [d[0] * unscale, d[1] * unscale, d[2] * unscale];
        self.unscale = unscale;
        Some((t_min * scale, ray.t_max * scale))
    }
}

/// `(2^e, 2^-e)` for a positive `x` in [2^e, 2^(e+1)), with e clamped so that both are normal numbers.
#[inline(always)]
fn power_of_two_scale(x: f32) -> (f32, f32) {
    let e = ((x.to_bits() >> 23) as i32 - 127).clamp(-126, 126);
    (f32::from_bits(((127 + e) as u32) << 23), f32::from_bits(((127 - e) as u32) << 23))
}
