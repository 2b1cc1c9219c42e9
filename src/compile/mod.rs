//! From what the user described to what the renderer needs: flat geometry with its accelerator, folded materials and
//! textures, lights. Whatever the picture does not need is left out, and said so.

mod bake;
mod blur;
mod caustics;
mod classes;
mod compiler;
mod content;
mod curves;
mod density;
mod emitters;
mod flat;
mod fold;
mod geometry;
mod groups;
mod material;
mod media;
mod medium;
mod moving;
mod moving_emitters;
mod objects;
mod placement;
mod plan;
mod reuse;
mod run;
mod scattering;
mod scene;
mod spectral;
mod tangents;
mod tree;
mod uplift;
mod vectors;
mod view;

pub use caustics::Role;
pub use compiler::Compiler;
pub use content::{Fingerprint, of_curves, of_mesh};
pub use density::{DensityGrid, GridRay};
pub use geometry::{Corners, Geometries, Placement, Space, SurfaceCoordinates, TextureCorners, Transform};
pub use material::{Alpha, CompiledEmission, CompiledMaterial, Presence};
pub use medium::Medium;
pub use objects::ObjectId;
pub use run::compile;
pub use scattering::{Ball, Scattering};
pub use scene::{CompileOptions, CompileReport, CompiledScene, Features};
pub use tree::Tree;
pub use vectors::{Vectors, Way};
pub use view::{View, choose_camera};
