//! Compiles a scene description for rendering: flat geometry and its BVH, materials with folded constants, textures, lights,
//! media. Invisible parts of the scene are omitted and reported.

mod box_tree;
mod build_geometry;
mod caustics;
mod coincident_surfaces;
mod compiler;
mod curves;
mod density_grid;
mod emitters;
mod fingerprint;
mod geometry;
mod hit_reader;
mod inside_out;
mod light_tables;
mod limits;
mod material;
mod media;
mod medium;
mod motion;
mod objects;
mod panes;
mod plan;
mod reuse;
mod scene;
mod texture_needs;

pub use caustics::CausticRole;
pub use compiler::{Compiler, compile};
pub use density_grid::{BlackBodies, CompiledEmissionGrid, DensityGrid, GridRay};
pub use fingerprint::{Fingerprint, of_curves, of_mesh};
pub use geometry::{Corners, Geometries, Placement, Space, SurfaceCoordinates, TextureCorners, Transform};
pub use hit_reader::{HitReader, SurfaceHit, point_reader, texture_point};
pub use light_tables::MAX_RECEIVER_CLASSES;
pub use material::{
    Alpha, CompiledComponent, CompiledEmission, CompiledMaterial, SurfaceVisibility, color_at_wavelengths,
};
pub use media::OVERLAP_LIMIT;
pub use medium::{Ball, Density, GridMedium, Medium, Scattering};
pub use motion::{MotionVectors, PointMotion};
pub use objects::ObjectId;
pub use panes::{RefractedLights, Refractor, Side};
pub use plan::BvhPolicy;
pub use scene::{
    CompileOptions, CompileReport, CompiledScene, ExpectedPicture, Features, MemoryPart, View, choose_camera,
};
pub use texture_needs::texture_memory_for;
