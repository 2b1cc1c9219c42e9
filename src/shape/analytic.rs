//! The closed list of shapes that are no triangles.

use super::disk::Disk;
use super::point::{LightPoint, Surface};
use super::ray::PreparedRay;
use super::sphere::Sphere;
use super::traits::{Packed, Parametrization, Shape};
use crate::math::{Bounds3, Mat3, Vec2, Vec3};

/// A shape that is no triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Analytic {
    /// A sphere.
    Sphere(Sphere),
    /// A flat disk.
    Disk(Disk),
}

/// Does the same with each shape.
macro_rules! each {
    ($analytic:expr, $shape:ident => $result:expr) => {
        match $analytic {
            Analytic::Sphere($shape) => $result,
            Analytic::Disk($shape) => $result,
        }
    };
}

impl Analytic {
    /// What the kinds of shapes are called.
    pub const NAMES: [&str; 2] = ["sphere", "disk"];

    /// Which of [`Analytic::NAMES`] it is.
    pub fn kind_index(&self) -> usize {
        usize::from(self.pack().kind - 1)
    }

    /// The shape of a packed one; `None` for an unknown kind, such as 0.
    #[inline(always)]
    pub fn unpack(packed: &Packed) -> Option<Analytic> {
        match packed.kind {
            Sphere::KIND => Some(Analytic::Sphere(Sphere::unpack(&packed.numbers))),
            Disk::KIND => Some(Analytic::Disk(Disk::unpack(&packed.numbers))),
            _ => None,
        }
    }
}

impl Shape for Analytic {
    fn center_and_radius(&self) -> (Vec3, f32) {
        each!(self, shape => shape.center_and_radius())
    }

    fn bounds(&self) -> Bounds3 {
        each!(self, shape => shape.bounds())
    }

    #[inline(always)]
    fn is_flat(&self) -> bool {
        each!(self, shape => shape.is_flat())
    }

    #[inline(always)]
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32> {
        each!(self, shape => shape.intersect(ray, t_min, t_max))
    }

    #[inline(always)]
    fn surface(&self, p: Vec3) -> Surface {
        each!(self, shape => shape.surface(p))
    }

    #[inline]
    fn texture_coordinates(&self, point: Vec3, normal: Vec3, object_from_world: &Mat3) -> Vec2 {
        each!(self, shape => shape.texture_coordinates(point, normal, object_from_world))
    }

    #[inline]
    fn parametrize(&self, normal: Vec3, object_from_world: &Mat3) -> Parametrization {
        each!(self, shape => shape.parametrize(normal, object_from_world))
    }

    fn area(&self) -> f32 {
        each!(self, shape => shape.area())
    }

    fn largest_projection(&self) -> f32 {
        each!(self, shape => shape.largest_projection())
    }

    #[inline(always)]
    fn normal_at(&self, point: Vec3) -> Vec3 {
        each!(self, shape => shape.normal_at(point))
    }

    fn point_by_area(&self, u: [f32; 2]) -> Vec3 {
        each!(self, shape => shape.point_by_area(u))
    }

    #[inline(always)]
    fn sample(&self, reference: Vec3, u: [f32; 2]) -> LightPoint {
        each!(self, shape => shape.sample(reference, u))
    }

    #[inline(always)]
    fn pdf_solid_angle(&self, reference: Vec3, point: Vec3) -> f32 {
        each!(self, shape => shape.pdf_solid_angle(reference, point))
    }

    fn pack(&self) -> Packed {
        each!(self, shape => shape.pack())
    }
}
