//! From what the user described to what the renderer needs: flat geometry with its accelerator, folded materials and
//! textures, lights. Whatever the picture does not need is left out, and said so.

mod bake;
mod box_tree;
mod caustics;
mod coincident_surfaces;
mod compiler;
mod curves;
mod density_grid;
mod emitters;
mod fingerprint;
mod geometry;
mod inside_out;
mod light_tables;
mod limits;
mod material;
mod media;
mod medium;
mod motion;
mod objects;
mod plan;
mod reuse;
mod scene;
mod texture_needs;

pub use caustics::Role;
pub use compiler::{Compiler, compile};
pub use density_grid::{BlackBodies, DensityGrid, Glow, GridRay};
pub use fingerprint::{Fingerprint, of_curves, of_mesh};
pub use geometry::{Corners, Geometries, Placement, Space, SurfaceCoordinates, TextureCorners, Transform};
pub use light_tables::MOST_CLASSES;
pub use material::{Alpha, CompiledEmission, CompiledMaterial, Presence};
pub use media::MOST_AROUND;
pub use medium::{Ball, Medium, Scattering};
pub use motion::{Vectors, Way};
pub use objects::ObjectId;
pub use scene::{
    CompileOptions, CompileReport, CompiledScene, ExpectedPicture, Features, MemoryPart, Tree, View,
    choose_camera,
};
