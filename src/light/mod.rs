//! Light sources: emissive surfaces, lights without a surface (a table in this file), the environment, and the choice of one of
//! them. All implement [`LightSource`].

mod area;
mod environment;
mod light_paths;
mod light_tree;
mod lights;
mod portals;
mod punctual;
mod traits;
mod volume;

use crate::color::Rgb;
use crate::math::{DVec3, Vec3};
use crate::scene::{self, LightKind};
use crate::texture::CompiledTextures;
pub use area::{
    AreaLight, AreaShape, Beam, Edges, LightDirection, RECTANGLE_NUMBERS, Radiance, UniformRectangle,
};
pub use environment::{EnvironmentLight, EnvironmentSample, ImageMap, TexelPosition, solid_angle_density};
pub use light_paths::{EmittedRay, LightPathSampler, LightPlace, SmallLight, TargetSphere, TargetSpheres};
pub use light_tree::{Descent, LightTree, Receiver};
pub use lights::{LightMotions, Lights, MovingLight, SelectedLight, SelectedSun};
pub use punctual::Sun;
use punctual::{Directional, Point, Profiled, Spot};
pub use traits::{LightBounds, LightOrigin, LightSample, LightSource, PunctualSource};
pub use volume::VolumeLight;

// The table of lights without a surface (KHR_lights_punctual, measured profiles and suns).

/// Makes [`PunctualLight`] of a table: the type of each light, named like its kind in scenes, and the fields of that kind. The
/// type implements [`PunctualSource`] and has `of_scene`, which gets the scene's light, the world's new origin and the fields.
macro_rules! lights {
    ($($light:ident { $($field:ident),* },)*) => {
        /// A light without a surface, ready for rendering.
        #[derive(Clone, Debug)]
        pub enum PunctualLight {
            $(#[doc = concat!("A `", stringify!($light), "`.")] $light($light),)*
        }

        impl PunctualLight {
            /// Prepares a light; the world's origin moves to `world_origin`.
            pub fn new(light: &scene::Light, world_origin: DVec3) -> PunctualLight {
                match light.kind {
                    $(LightKind::$light { $($field),* } => {
                        PunctualLight::$light($light::of_scene(light, world_origin, $($field),*))
                    })*
                }
            }
        }

        /// Does the same with each light.
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

            fn interpolate(&self, other: &PunctualLight, share: f32) -> PunctualLight {
                match (self, other) {
                    $((PunctualLight::$light(a), PunctualLight::$light(b)) => {
                        PunctualLight::$light(a.interpolate(b, share))
                    })*
                    // A light keeps its kind.
                    _ => self.clone(),
                }
            }
        }
    };
}

lights! {
    Point { position },
    Spot { position, direction, inner_angle_rad, outer_angle_rad, fade },
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
    /// The light as a sun, which BSDF samples find too.
    pub fn sun(&self) -> Option<&Sun> {
        if let PunctualLight::Sun(sun) = self { Some(sun) } else { None }
    }

    /// Its position; `None` for a light at infinity.
    pub fn position(&self) -> Option<Vec3> {
        if let LightOrigin::Point(position) = self.origin() { Some(position) } else { None }
    }

    /// Luminance of the irradiance of a surface that faces it, if it is at infinity.
    pub fn irradiance(&self) -> Option<f32> {
        match self.origin() {
            LightOrigin::Point(_) => None,
            LightOrigin::Direction(_) | LightOrigin::Cone => Some(self.intensity(Vec3::ZERO).luminance()),
        }
    }
}
