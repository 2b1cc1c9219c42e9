//! Shapes: bounds, ray intersection, the surface at a hit, and sampling as light sources.
//!
//! Triangles and [`Quad`]s share a vectorised test of four triangles at a time. All other shapes implement [`Shape`] and are
//! rows of the table of [`Analytic`]; curve segments ([`CurveSegment`]) and Gaussian splats
//! ([`SplatCloud`]) have packets of their own.

use crate::math::{Bounds3, Mat3, Ray, Vec2, Vec3};
use crate::scene;
use crate::scene::{Mesh, ShapeKind};
pub use curve::{CurveSegment, CurveSegments};
pub use disk::{Disk, FacingDisk};
pub use quad::{MIN_RECTANGLE_SOLID_ANGLE, Quad, SphericalParallelogram, SphericalRectangle};
pub use sphere::{Shell, Sphere, SphereSampler};
pub use splat::{MAX_SQUARED_RADIUS, Splat, SplatCloud, SplatLanes, from_octahedral, octahedral};
pub use traits::{LightPoint, Packed, Parametrization, PreparedRay, Shape, Surface, pdf_solid_angle_of_area};
pub use triangle::{
    MIN_TRIANGLE_SOLID_ANGLE, SphericalTriangle, shading_normal, triangle_surface, uniform_triangle,
};

mod curve;
mod disk;
mod quad;
mod sphere;
mod splat;
mod traits;
pub mod triangle;

/// Generates [`Analytic`] and its dispatch from a table: the type of each shape, named like its kind in scenes, and the parameters of
/// that kind. In addition to [`Shape`] the type implements `of_scene`, `unpack` and `mesh`.
macro_rules! shapes {
    ($($shape:ident,)*) => {
        /// An analytic shape.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Analytic {
            $(#[doc = concat!("A [`", stringify!($shape), "`].")] $shape($shape),)*
        }

        impl Analytic {
            /// Converts a shape of a scene; `center` is in the space of its geometry, metres.
            pub fn of_scene(shape: &scene::Shape, center: Vec3) -> Analytic {
                match shape.kind {
                    $(ShapeKind::$shape => Analytic::$shape($shape::of_scene(shape, center)),)*
                }
            }

            /// Unpacks a shape; `None` for an unknown kind, such as 0.
            #[inline(always)]
            pub fn unpack(packed: &Packed) -> Option<Analytic> {
                $(if packed.kind == packed_kind(ShapeKind::$shape) {
                    return Some(Analytic::$shape($shape::unpack(&packed.parameters)));
                })*
                None
            }

            /// The kind of shape.
            pub fn kind(&self) -> ShapeKind {
                match self {
                    $(Analytic::$shape(_) => ShapeKind::$shape,)*
                }
            }
        }

        /// Tessellation of a shape of a kind, with radius 1, centred at the origin and not rotated; without materials.
        pub fn mesh_of(kind: ShapeKind) -> Mesh {
            match kind {
                $(ShapeKind::$shape => $shape::mesh(),)*
            }
        }

        /// Static dispatch to the shape.
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
    Sphere,
    Disk,
    FacingDisk,
    Shell,
}

/// The kind of a packed shape, above 0.
const fn packed_kind(kind: ShapeKind) -> u8 {
    kind as u8 + 1
}

impl Analytic {
    /// The form stored in leaves of the BVH.
    pub fn pack(&self) -> Packed {
        Packed { kind: packed_kind(self.kind()), parameters: self.parameters() }
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
    fn normal(&self) -> Option<Vec3> {
        each!(self, shape => shape.normal())
    }

    #[inline(always)]
    fn intersect(&self, ray: &PreparedRay, t_min: f32, t_max: f32) -> Option<f32> {
        each!(self, shape => shape.intersect(ray, t_min, t_max))
    }

    #[inline(always)]
    fn surface(&self, p: Vec3, origin: Vec3) -> Surface {
        each!(self, shape => shape.surface(p, origin))
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
    fn normal_at(&self, point: Vec3, reference: Vec3) -> Vec3 {
        each!(self, shape => shape.normal_at(point, reference))
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

    fn is_facing(&self) -> bool {
        each!(self, shape => shape.is_facing())
    }

    fn emission_offset(&self, receiver: Vec3, ray: &Ray) -> Option<f32> {
        each!(self, shape => shape.emission_offset(receiver, ray))
    }

    fn parameters(&self) -> [f32; 6] {
        each!(self, shape => shape.parameters())
    }
}
