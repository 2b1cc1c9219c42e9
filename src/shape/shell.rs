//! Spheres that each ray intersects once: from outside their near side, from inside the far one. Lamps that stop no light are so:
//! what is within one gets its light from all around, and rays that pass it take its light along once.

use super::point::{LightPoint, Surface};
use super::ray::PreparedRay;
use super::sphere::Sphere;
use super::traits::{Parametrization, Shape};
use crate::math::{Bounds3, Mat3, Ray, Vec2, Vec3};
use crate::scene::{self, Mesh};

/// A sphere that each ray intersects once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shell(pub Sphere);

impl Shell {
    /// That of a scene around `center`.
    pub(super) fn of_scene(shape: &scene::Shape, center: Vec3) -> Shell {
        Shell(Sphere::of_scene(shape, center))
    }

    /// That of packed numbers.
    #[inline(always)]
    pub(super) fn unpack(numbers: &[f32; 6]) -> Shell {
        Shell(Sphere::unpack(numbers))
    }

    /// The unit sphere.
    pub(super) fn mesh() -> Mesh {
        Sphere::mesh()
    }
}

impl Shape for Shell {
    fn center_and_radius(&self) -> (Vec3, f32) {
        self.0.center_and_radius()
    }

    fn bounds(&self) -> Bounds3 {
        self.0.bounds()
    }

    #[inline(always)]
    fn is_flat(&self) -> bool {
        self.0.is_flat()
    }

    #[inline(always)]
    fn normal(&self) -> Option<Vec3> {
        self.0.normal()
    }

    #[inline(always)]
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32> {
        let [near, far] = self.0.roots(ray)?;
        let t = if near > 0.0 { near } else { far } as f32;
        (t > t_min && t <= t_max).then_some(t)
    }

    #[inline(always)]
    fn surface(&self, p: Vec3, origin: Vec3) -> Surface {
        self.0.surface(p, origin)
    }

    #[inline]
    fn texture_coordinates(&self, point: Vec3, normal: Vec3, object_from_world: &Mat3) -> Vec2 {
        self.0.texture_coordinates(point, normal, object_from_world)
    }

    #[inline]
    fn parametrize(&self, normal: Vec3, object_from_world: &Mat3) -> Parametrization {
        self.0.parametrize(normal, object_from_world)
    }

    fn area(&self) -> f32 {
        self.0.area()
    }

    fn largest_projection(&self) -> f32 {
        self.0.largest_projection()
    }

    #[inline(always)]
    fn normal_at(&self, point: Vec3, reference: Vec3) -> Vec3 {
        self.0.normal_at(point, reference)
    }

    fn point_by_area(&self, u: [f32; 2]) -> Vec3 {
        self.0.point_by_area(u)
    }

    #[inline(always)]
    fn sample(&self, reference: Vec3, u: [f32; 2]) -> LightPoint {
        self.0.sample(reference, u)
    }

    #[inline(always)]
    fn pdf_solid_angle(&self, reference: Vec3, point: Vec3) -> f32 {
        self.0.pdf_solid_angle(reference, point)
    }

    /// Light that goes inwards counts within only: beyond, it is that of the near side.
    fn starts_behind(&self, receiver: Vec3, ray: &Ray) -> Option<f32> {
        let Sphere { center, radius } = self.0;
        let goes_inwards = ray.direction.dot(ray.origin - center) < 0.0;
        (!goes_inwards || receiver.distance(center) <= radius).then_some(0.0)
    }

    fn numbers(&self) -> [f32; 6] {
        self.0.numbers()
    }
}
