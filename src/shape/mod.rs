//! Shapes, one file each: the box around it, where a ray meets it, what its surface is like there, and points of it as
//! light sources seen from elsewhere.
//!
//! Triangles and [`Quad`]s are met by the same vectorised test, four triangles at a time. All others implement [`Shape`]
//! and are variants of [`Analytic`], by a row of its table; of pieces
//! of curves ([`CurveSegment`]) there are so many that they have packets of their own.

mod analytic;
mod curve;
mod disk;
mod facing_disk;
mod icosphere;
mod point;
mod quad;
mod ray;
mod rectangle;
mod shell;
mod sphere;
mod traits;
pub mod triangle;
mod triangle_light;

pub use analytic::{Analytic, mesh_of};
pub use curve::{CurveSegment, CurveSegments};
pub use disk::Disk;
pub use facing_disk::FacingDisk;
pub use point::{LightPoint, Surface, pdf_solid_angle_of_area};
pub use quad::{Quad, SphericalParallelogram};
pub use ray::PreparedRay;
pub use rectangle::{MIN_RECTANGLE_SOLID_ANGLE, SphericalRectangle};
pub use shell::Shell;
pub use sphere::{Sphere, SphereSampler};
pub use traits::{Packed, Parametrization, Shape};
pub use triangle::{shading_normal, triangle_surface};
pub use triangle_light::{MIN_TRIANGLE_SOLID_ANGLE, SphericalTriangle, uniform_triangle};
