//! The interface of shapes other than triangles, and the data that it exchanges.

use crate::math::{Bounds3, Mat3, Ray, Vec2, Vec3};
use crate::simd::{BoxRay, ShearedLine};

/// A shape other than a triangle. Lengths are in metres, in the space of its geometry.
pub trait Shape {
    /// Center and radius of a bounding sphere. A shape whose radius is not above 0 is dropped.
    fn center_and_radius(&self) -> (Vec3, f32);

    /// Its bounding box, up to rounding to nearest.
    fn bounds(&self) -> Bounds3 {
        let (center, radius) = self.center_and_radius();
        Bounds3 { min: center - Vec3::splat(radius), max: center + Vec3::splat(radius) }
    }

    /// Has it two sides, so that no ray that leaves it intersects it again?
    #[inline(always)]
    fn is_flat(&self) -> bool {
        self.normal().is_some()
    }

    /// The front's unit normal, if it is the same everywhere.
    #[inline(always)]
    fn normal(&self) -> Option<Vec3> {
        None
    }

    /// The smallest parameter in `t_min < t <= t_max` at which a ray intersects it.
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32>;

    /// The surface where a ray from `origin` intersects it, from the ray's point there.
    fn surface(&self, p: Vec3, origin: Vec3) -> Surface;

    /// Texture coordinates at a point of the surface where the front's normal is `normal`; `object_from_world` turns
    /// them.
    fn texture_coordinates(&self, point: Vec3, normal: Vec3, object_from_world: &Mat3) -> Vec2;

    /// The parametrization of textures where the front's normal is `normal`.
    fn parametrize(&self, normal: Vec3, object_from_world: &Mat3) -> Parametrization;

    /// Area of the front, square metres.
    fn area(&self) -> f32;

    /// Area of its largest orthographic projection, square metres.
    fn largest_projection(&self) -> f32;

    /// The front's unit normal at a point; `reference`, from where it is seen, counts for facing shapes.
    fn normal_at(&self, point: Vec3, reference: Vec3) -> Vec3;

    /// A point of the surface, uniform by area; of facing shapes, of the sphere around it.
    fn point_by_area(&self, u: [f32; 2]) -> Vec3;

    /// Samples a point of it as a light that illuminates `reference`.
    fn sample(&self, reference: Vec3, u: [f32; 2]) -> LightPoint;

    /// Density per solid angle with which [`Shape::sample`] returns a point that is seen from `reference`.
    fn pdf_solid_angle(&self, reference: Vec3, point: Vec3) -> f32;

    /// Does it face each ray, as a disk perpendicular to the direction of its light?
    fn is_facing(&self) -> bool {
        false
    }

    /// Distance behind its origin at which an emitted ray leaves the surface as seen from a receiver on the ray; `None` if the line
    /// does not intersect the surface as seen from there.
    fn emission_offset(&self, _receiver: Vec3, _ray: &Ray) -> Option<f32> {
        Some(0.0)
    }

    /// Its parameters.
    fn numbers(&self) -> [f32; 6];
}

/// Parametrization of a surface by texture coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Parametrization {
    /// Direction of increasing u on the surface; any length.
    pub tangent: Vec3,
    /// 1 if the image's up is `n x tangent`, else -1.
    pub handedness: f32,
    /// Change of the coordinates per metre.
    pub uv_per_metre: f32,
}

/// A shape as a kind and parameters.
#[derive(Clone, Copy, Debug)]
pub struct Packed {
    /// Kind of the shape, above 0.
    pub kind: u8,
    /// Its parameters.
    pub numbers: [f32; 6],
}

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// The point.
    pub p: Vec3,
    /// The true point lies within this box around it.
    pub p_error: Vec3,
    /// Unit geometric normal on the front.
    pub ng: Vec3,
    /// Unit shading normal, on the same side as `ng`.
    pub ns: Vec3,
    /// Its material.
    pub material: u32,
}

/// A point on a light, chosen as seen from a reference point.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Position, in the space of the light's corners.
    pub point: Vec3,
    /// Density per solid angle at the reference point; 0 where the light can't be seen (edge on): such a sample counts
    /// as no contribution.
    pub pdf_solid_angle: f32,
}

/// Density per solid angle of a uniform point on a flat light of area `area`.
/// `to_point` leads from the reference point to the light, `unit_normal` is the light's (either side).
/// 0 where the light is seen exactly edge on.
#[inline(always)]
pub fn pdf_solid_angle_of_area(to_point: Vec3, unit_normal: Vec3, area: f32) -> f32 {
    let distance_squared = to_point.length_squared();
    // cos / distance * area, all over distance^2.
    let projected = to_point.dot(unit_normal).abs() * area;
    let pdf = distance_squared * distance_squared.sqrt() / if projected > 0.0 { projected } else { 1.0 };
    let visible = projected > 0.0 && pdf < f32::MAX;
    if visible { pdf } else { 0.0 }
}

/// A ray whose direction is scaled by a power of two so that its largest component lies in [1, 2). All parameters are
/// in units of this direction; the scaling is exact, so directions of any length behave alike.
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay {
    /// Origin.
    pub origin: [f32; 3],
    /// Scaled direction.
    pub direction: [f32; 3],
    /// Shear of the space in which triangles are seen along the ray (Woop, Benthin, Wald 2013, section 3.1, `Sx`, `Sy`).
    pub shear: [f32; 2],
    /// Parameters in the caller's units are ours times this power of two.
    pub unscale: f32,
}

impl PreparedRay {
    /// Never hits anything; fills unused slots.
    pub const NONE: PreparedRay =
        PreparedRay { origin: [0.0; 3], direction: [0.0; 3], shear: [0.0; 2], unscale: 1.0 };

    /// Prepares a ray in place, for geometry within `reach` of the coordinates' origin, and returns its bounds of the
    /// parameter; `None` where it can hit nothing: an empty range, a zero direction, or a component that is infinite or NaN.
    /// (In place, since copies in whole vectors would wait for the narrow stores before them.)
    #[inline(always)]
    pub fn set(&mut self, boxes: &mut BoxRay, ray: &Ray, reach: f32) -> Option<(f32, f32)> {
        let range = self.set_scaled(ray)?;
        boxes.set(self.origin, self.direction, reach);
        let [kx, ky, kz] = boxes.axes();
        let sz = boxes.inverse(kz);
        self.shear = [self.direction[kx] * sz, self.direction[ky] * sz];
        Some(range)
    }

    /// [`PreparedRay::set`] for a ray that is tested without boxes; also returns its line.
    #[inline(always)]
    pub fn set_line(&mut self, ray: &Ray) -> Option<((f32, f32), ShearedLine)> {
        let range = self.set_scaled(ray)?;
        let line = ShearedLine::new(self.origin, self.direction);
        self.shear = line.shear;
        Some((range, line))
    }

    /// Sets all but the shear, and returns the bounds of the parameter.
    #[inline(always)]
    fn set_scaled(&mut self, ray: &Ray) -> Option<(f32, f32)> {
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        let largest = d[0].abs().max(d[1].abs()).max(d[2].abs());
        // Zero times anything but infinity and NaN is zero.
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

/// `(2^e, 2^-e)` for a positive `x` in [2^e, 2^(e+1)), with e kept where both are normal numbers.
#[inline(always)]
fn power_of_two_scale(x: f32) -> (f32, f32) {
    let e = ((x.to_bits() >> 23) as i32 - 127).clamp(-126, 126);
    (f32::from_bits(((127 + e) as u32) << 23), f32::from_bits(((127 - e) as u32) << 23))
}
