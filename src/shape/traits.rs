//! What a shape that is no triangle must know of itself.

use super::point::{LightPoint, Surface};
use super::ray::PreparedRay;
use crate::math::{Bounds3, Mat3, Ray, Vec2, Vec3};

/// What a shape must know of itself. Lengths are in metres, in the space of its geometry.
pub trait Shape {
    /// Middle and radius of a sphere around it. A shape whose radius is not above 0 is left out.
    fn center_and_radius(&self) -> (Vec3, f32);

    /// The box around it, but for rounding to nearest.
    fn bounds(&self) -> Bounds3;

    /// Has it two sides, and no ray that leaves it meets it again?
    fn is_flat(&self) -> bool;

    /// The front's unit normal, if it is the same everywhere.
    fn normal(&self) -> Option<Vec3>;

    /// The smallest parameter in `t_min < t <= t_max` at which a ray meets it.
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32>;

    /// The surface where a ray from `origin` met it, from the ray's point there.
    fn surface(&self, p: Vec3, origin: Vec3) -> Surface;

    /// Texture coordinates at a point of the surface where the front's normal is `normal`; `object_from_world` turns
    /// them.
    fn texture_coordinates(&self, point: Vec3, normal: Vec3, object_from_world: &Mat3) -> Vec2;

    /// How textures lie on the surface where the front's normal is `normal`.
    fn parametrize(&self, normal: Vec3, object_from_world: &Mat3) -> Parametrization;

    /// Area of the front, square metres.
    fn area(&self) -> f32;

    /// Area of its largest projection: of what it looks like from the direction from which most is seen.
    fn largest_projection(&self) -> f32;

    /// The front's unit normal at a point; `reference`, from where it is seen, counts for shapes that turn.
    fn normal_at(&self, point: Vec3, reference: Vec3) -> Vec3;

    /// A point of the surface, uniform by area; of shapes that turn, one of the sphere around it.
    fn point_by_area(&self, u: [f32; 2]) -> Vec3;

    /// A point of it as a light seen from `reference`.
    fn sample(&self, reference: Vec3, u: [f32; 2]) -> LightPoint;

    /// Density per solid angle with which [`Shape::sample`] returns a point that is seen from `reference`.
    fn pdf_solid_angle(&self, reference: Vec3, point: Vec3) -> f32;

    /// Is it a disk across whatever direction light leaves it in?
    fn turns(&self) -> bool {
        false
    }

    /// How far behind its origin a ray of light leaves the surface, as seen from a receiver on the ray; nothing, if the line
    /// doesn't intersect the surface as seen from there.
    fn starts_behind(&self, _receiver: Vec3, _ray: &Ray) -> Option<f32> {
        Some(0.0)
    }

    /// The numbers that it follows from.
    fn numbers(&self) -> [f32; 6];
}

/// Where textures lie on a surface.
#[derive(Clone, Copy, Debug)]
pub struct Parametrization {
    /// Where u grows, along the surface; any length.
    pub tangent: Vec3,
    /// 1 if the image's up is `n x tangent`, else -1.
    pub handedness: f32,
    /// How much the coordinates change over a metre.
    pub uv_per_metre: f32,
}

/// A shape as numbers.
#[derive(Clone, Copy, Debug)]
pub struct Packed {
    /// Which shape: above 0.
    pub kind: u8,
    /// What it follows from.
    pub numbers: [f32; 6],
}
