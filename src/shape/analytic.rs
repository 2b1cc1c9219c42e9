//! The closed list of shapes that are no triangles.

use super::disk::Disk;
use super::point::{LightPoint, Surface};
use super::ray::PreparedRay;
use super::sphere::Sphere;
use super::traits::{Packed, Parametrization, Shape};
use crate::math::{Bounds3, Mat3, Vec2, Vec3};

/// Makes [`Analytic`], and what is done with each shape alike, of a table: the name of each and its type.
macro_rules! shapes {
    ($($name:literal $shape:ident,)*) => {
        /// A shape that is no triangle.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Analytic {
            $(#[doc = concat!("A ", $name, ".")] $shape($shape),)*
        }

        impl Analytic {
            /// What the kinds of shapes are called.
            pub const NAMES: &[&str] = &[$($name),*];

            const KINDS: &[u8] = &[$($shape::KIND),*];

            /// The shape of a packed one; `None` for an unknown kind, such as 0.
            #[inline(always)]
            pub fn unpack(packed: &Packed) -> Option<Analytic> {
                match packed.kind {
                    $($shape::KIND => Some(Analytic::$shape($shape::unpack(&packed.numbers))),)*
                    _ => None,
                }
            }
        }

        /// Does the same with each shape.
        macro_rules! each {
            ($analytic:expr, $inner:ident => $result:expr) => {
                match $analytic {
                    $(Analytic::$shape($inner) => $result,)*
                }
            };
        }
    };
}

shapes! {
    "sphere" Sphere,
    "disk" Disk,
}

// Kinds count from 1 in the order of the table.
const _: () = {
    let mut i = 0;
    while i < Analytic::KINDS.len() {
        assert!(Analytic::KINDS[i] as usize == i + 1, "the kinds of shapes are not those of their places");
        i += 1;
    }
};

impl Analytic {
    /// Which of [`Analytic::NAMES`] it is.
    pub fn kind_index(&self) -> usize {
        usize::from(self.pack().kind - 1)
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
