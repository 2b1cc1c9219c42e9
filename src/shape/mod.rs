//! Shapes: bounds, ray intersection, the surface at a hit, and sampling as light sources.
//!
//! Triangles and [`Quad`]s share a vectorised test of four triangles at a time. All other shapes implement [`Shape`] and are
//! rows of the table of [`Analytic`]; curve segments ([`CurveSegment`]) and Gaussian splats
//! ([`SplatCloud`]) have packets of their own.

mod analytic;
mod curve;
mod disk;
mod quad;
mod sphere;
mod splat;
mod traits;
pub mod triangle;

pub use analytic::{Analytic, mesh_of};
pub use curve::{CurveSegment, CurveSegments};
pub use disk::{Disk, FacingDisk};
pub use quad::{MIN_RECTANGLE_SOLID_ANGLE, Quad, SphericalParallelogram, SphericalRectangle};
pub use sphere::{Shell, Sphere, SphereSampler};
pub use splat::{LARGEST_SQUARED, Splat, SplatCloud, SplatLanes, from_octahedral, octahedral};
pub use traits::{LightPoint, Packed, Parametrization, PreparedRay, Shape, Surface, pdf_solid_angle_of_area};
pub use triangle::{
    MIN_TRIANGLE_SOLID_ANGLE, SphericalTriangle, shading_normal, triangle_surface, uniform_triangle,
};
