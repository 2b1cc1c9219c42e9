//! What shines: emitting surfaces, lights without a surface, the environment, and the choice among them.

mod area;
mod beam;
mod bounds;
mod choice;
mod cone;
mod emission;
mod environment;
mod moving;
mod portals;
mod profiled;
mod punctual;
mod rectangles;
mod select;
mod sun;
mod targets;
mod tree;

pub use area::{AreaLight, AreaShape, Edges, Radiance};
pub use beam::Beam;
pub use bounds::LightBounds;
pub use choice::Selected;
pub use emission::{Emission, Emitted};
pub use environment::{EnvironmentLight, EnvironmentSample, ImageMap, TexelPosition, solid_angle_density};
pub use moving::{LightMotions, MovingLight};
pub use punctual::{PunctualLight, Source};
pub use rectangles::{EvenRectangle, LightDirection, RECTANGLE_NUMBERS};
pub use select::{Lights, SelectedSun};
pub use sun::Sun;
pub use targets::{Ball, Targets};
pub use tree::{Descent, LightTree, Receiver};

use crate::color::Rgb;
use crate::math::Vec3;

/// Light that may reach a reference point from one point or direction of a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Towards the light, unit length.
    pub wi: Vec3,
    /// Where a shadow ray ends: just in front of the light. Ignored for [`LightSample::is_infinite`].
    pub target: Vec3,
    /// The light is infinitely far away.
    pub is_infinite: bool,
    /// No other strategy finds this light: it has no size.
    pub is_delta: bool,
    /// Radiance towards the reference point; for delta lights the irradiance of a surface that faces the light.
    pub radiance: Rgb,
    /// Density per solid angle at the reference point, given the light; 1 for delta lights, 0 for no contribution.
    pub pdf_solid_angle: f32,
}

impl LightSample {
    /// No light.
    pub const NONE: LightSample = LightSample {
        wi: Vec3::Z,
        target: Vec3::ZERO,
        is_infinite: false,
        is_delta: false,
        radiance: Rgb::ZERO,
        pdf_solid_angle: 0.0,
    };
}
