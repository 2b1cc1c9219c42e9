//! Lights: emissive surfaces, lights without a surface (a table in this file), emissive media, the environment, and light selection. All
//! implement [`LightSource`].

mod area;
mod environment;
mod light_paths;
mod light_tree;
mod lights;
mod portals;
mod punctual;
mod traits;
mod uniform;
mod volume;

use crate::color::Rgb;
use crate::math::{DVec3, Vec3};
use crate::scene::{self, LightKind};
use crate::texture::CompiledTextures;
pub use area::{AreaLight, AreaShape, Beam, Edges, Radiance};
pub use environment::{EnvironmentLight, EnvironmentSample, ImageMap, TexelPosition, solid_angle_density};
pub use light_paths::{EmittedRay, LightPathSampler, LightPosition, SmallLight, TargetSphere, TargetSpheres};
pub use light_tree::{Descent, LIGHT_GROUPS, LightTree, LightWeights, Receiver};
pub use lights::{LightMotions, Lights, MovingLight, SelectedLight, SelectedSun};
pub use punctual::Sun;
use punctual::{Directional, Point, Profiled, Spot};
pub use traits::{LightBounds, LightDirection, LightOrigin, LightSample, LightSource, PunctualSource};
pub use uniform::{
    PACKED_LENGTH, UniformDisk, UniformKind, UniformLight, UniformLights, UniformRectangle, UniformShape,
    UniformTriangle,
};
pub use volume::VolumeLight;

// The table of lights without a surface (KHR_lights_punctual, measured profiles and suns).

/// Generates [`PunctualLight`] from a table: the type of each light, named like its [`LightKind`], and the fields of that kind. The type
/// implements [`PunctualSource`] and has a constructor `of_scene(light, world_origin, fields...)`.
macro_rules! lights {
    ($($light:ident { $($field:ident),* },)*) => {
        /// A compiled light without a surface.
        #[derive(Clone, Debug)]
        pub enum PunctualLight {
            $(#[doc = concat!("A `", stringify!($light), "`.")] $light($light),)*
        }

        impl PunctualLight {
            /// Compiles a light; positions become relative to `world_origin`.
            pub fn new(light: &scene::Light, world_origin: DVec3) -> PunctualLight {
                match light.kind {
                    $(LightKind::$light { $($field),* } => {
                        PunctualLight::$light($light::of_scene(light, world_origin, $($field),*))
                    })*
                }
            }
        }

        /// Evaluates an expression with the light of any kind.
        macro_rules! each {
            ($punctual:expr, $inner:ident => $result:expr) => {
                match $punctual {
                    $(PunctualLight::$light($inner) => $result,)*
                }
            };
        }

        impl PunctualSource for PunctualLight {
            fn origin(&self) -> LightOrigin {
                each!(self, light => light.origin())
            }

            fn intensity(&self, direction: Vec3) -> Rgb {
                each!(self, light => light.intensity(direction))
            }

            fn interpolate(&self, other: &PunctualLight, t: f32) -> PunctualLight {
                match (self, other) {
                    $((PunctualLight::$light(a), PunctualLight::$light(b)) => {
                        PunctualLight::$light(a.interpolate(b, t))
                    })*
                    // Keyframes of a light have the same kind.
                    _ => self.clone(),
                }
            }
        }
    };
}

lights! {
    Point { position },
    Spot { position, direction, inner_angle_rad, outer_angle_rad, falloff },
    Profiled { position, rotation, cone },
    Directional { direction },
    Sun { direction, angle_rad },
}

impl LightSource for PunctualLight {
    #[inline]
    fn sample(&self, textures: &CompiledTextures, reference: Vec3, u: [f32; 2]) -> LightSample {
        each!(self, light => light.sample(textures, reference, u))
    }

    fn pdf_solid_angle(&self, reference: Vec3, to: Vec3) -> f32 {
        each!(self, light => light.pdf_solid_angle(reference, to))
    }

    fn radiance(&self, textures: &CompiledTextures, reference: Vec3, to: Vec3) -> Rgb {
        each!(self, light => light.radiance(textures, reference, to))
    }

    fn power(&self, textures: &CompiledTextures) -> f32 {
        each!(self, light => light.power(textures))
    }

    fn bounds(&self, textures: &CompiledTextures) -> Option<LightBounds> {
        each!(self, light => light.bounds(textures))
    }
}

impl PunctualLight {
    /// The light as a sun, the only kind that BSDF sampling can hit.
    pub fn sun(&self) -> Option<&Sun> {
        if let PunctualLight::Sun(sun) = self { Some(sun) } else { None }
    }

    /// Position; `None` for lights at infinity.
    pub fn position(&self) -> Option<Vec3> {
        if let LightOrigin::Point(position) = self.origin() { Some(position) } else { None }
    }

    /// Luminance of the irradiance on a surface that faces a light at infinity; `None` for other lights.
    pub fn irradiance(&self) -> Option<f32> {
        match self.origin() {
            LightOrigin::Point(_) => None,
            LightOrigin::Direction(_) | LightOrigin::Cone => Some(self.intensity(Vec3::ZERO).luminance()),
        }
    }
}
