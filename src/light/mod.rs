//! Light sources: emissive surfaces, lights without a surface (a table in `table.rs`), the environment, and the choice of one of
//! them. All implement [`LightSource`].

mod area;
mod distant;
mod environment;
mod light_paths;
mod light_tree;
mod lights;
mod point;
mod portals;
mod table;
mod traits;

pub use area::{
    AreaLight, AreaShape, Beam, Edges, LightDirection, RECTANGLE_NUMBERS, Radiance, UniformRectangle,
};
pub use distant::Sun;
pub use environment::{EnvironmentLight, EnvironmentSample, ImageMap, TexelPosition, solid_angle_density};
pub use light_paths::{EmittedRay, LightPathSampler, TargetSphere, TargetSpheres};
pub use light_tree::{Descent, LightTree, Receiver};
pub use lights::{LightMotions, Lights, MovingLight, SelectedLight, SelectedSun};
pub use table::PunctualLight;
pub use traits::{LightBounds, LightOrigin, LightSample, LightSource, PunctualSource};
