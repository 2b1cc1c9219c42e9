//! How surfaces scatter light: one file a lobe, and the closed [`Bsdf`] over them, which the table in this file makes.
//!
//! Directions are unit vectors in the local frame whose z is the shading normal; both leave the surface. z of `wo` may
//! be negative: opaque lobes reflect on either side alike, dielectrics tell the inside (negative z) from the outside.
//! Weights are for paths that start at the camera: radiance transmitted into a denser medium is scaled by
//! 1 / eta^2 and back on the way out (as in pbrt and Mitsuba); [`BsdfSample::eta`] lets a roulette undo it.

pub mod albedo_table;
pub mod anisotropic_table;
mod coat;
mod conductor;
mod dielectric;
mod dispatch;
pub mod fresnel;
pub mod ggx;
mod lambert;
mod layered;
mod lobe;
mod metal_rough;
mod microsurface;
mod oren_nayar;
mod phong;
mod program;
mod program_pbr;
#[cfg(test)]
mod reference;
#[cfg(test)]
mod reference_walk;
mod rough_dielectric;
mod sample;
mod schlick_metal;
mod sheen;
#[allow(clippy::approx_constant, reason = "a number of the table happens to be near a sixth of pi")]
mod sheen_data;
mod solid_glass;
mod thin_film;
mod through;

pub use albedo_table::DirectionalAlbedo;
pub use coat::Coat;
pub use conductor::Conductor;
pub use dielectric::{Dielectric, ThinDielectric};
pub use ggx::above;
pub use lambert::Lambert;
pub use layered::Layered;
pub use lobe::{Lobe, Transmissive};
pub use metal_rough::{MetalRough, MetalRoughClosure};
pub use microsurface::{Facets, Isotropic, Microsurface};
pub use oren_nayar::OrenNayar;
pub use phong::Phong;
pub use program::{Factors, LocalFrame, MaterialProgram, Slots};
pub use rough_dielectric::{GlassReflectance, RoughDielectric, Walls};
pub use sample::{BsdfEval, BsdfSample};
pub use schlick_metal::SchlickMetal;
pub use sheen::Sheen;
pub use thin_film::ThinFilm;
pub use through::DiffuseThrough;

use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::{EnergyCompensation, Model};
use program::always;
use sample::{LEAST_ALBEDO, with_side};

dispatch::bsdfs! {
    opaque {
        /// Ideal diffuse reflection.
        Lambert(lambert::LambertProgram),
        /// Rough diffuse reflection.
        OrenNayar(oren_nayar::OrenNayarProgram),
        /// The modified Phong model.
        Phong(phong::PhongProgram),
        /// A metal of a colour, with Schlick's Fresnel term.
        SchlickMetal(schlick_metal::SchlickMetalProgram),
        /// A metal of a complex index of refraction.
        Conductor(conductor::ConductorProgram),
        /// The opaque glTF material.
        MetalRough(program_pbr::MetalRoughProgram),
    }
    transmissive {
        /// Smooth solid glass.
        Dielectric(dielectric::DielectricProgram),
        /// A smooth thin sheet of glass.
        ThinDielectric(dielectric::ThinDielectricProgram),
        /// Glass of any roughness, solid or thin.
        RoughDielectric(rough_dielectric::RoughDielectricProgram),
        /// The glTF material with all layers.
        Layered(program_pbr::LayeredProgram),
    }
}

impl BsdfProgram {
    /// The program of the cheapest BSDF that is equivalent to a model, wherever its textures are looked up.
    pub fn of(model: &Model, energy_compensation: EnergyCompensation) -> BsdfProgram {
        match model {
            Model::Black => BsdfProgram::Black,
            Model::Lambert { albedo } => lambert::LambertProgram { albedo: *albedo }.into(),
            Model::OrenNayar { color, roughness } if always(roughness, 0.0) => {
                lambert::LambertProgram { albedo: *color }.into()
            }
            Model::OrenNayar { color, roughness } => {
                oren_nayar::OrenNayarProgram { color: *color, roughness: *roughness }.into()
            }
            Model::Phong { diffuse, specular, exponent } => {
                phong::PhongProgram { diffuse: *diffuse, specular: *specular, exponent: *exponent }.into()
            }
            Model::SchlickMetal { color, roughness } => schlick_metal::SchlickMetalProgram {
                color: *color,
                roughness: *roughness,
                energy_compensation,
            }
            .into(),
            Model::Conductor { eta, k, roughness } => conductor::ConductorProgram {
                eta: Rgb::from_array(*eta),
                k: Rgb::from_array(*k),
                roughness: *roughness,
                energy_compensation,
            }
            .into(),
            Model::Dielectric { ior, tint, fresnel } => {
                dielectric::DielectricProgram { ior: *ior, tint: *tint, tints_once: false, fresnel: *fresnel }
                    .into()
            }
            Model::Glass { ior, tint, roughness, is_thin: true } if always(roughness, 0.0) => {
                dielectric::ThinDielectricProgram { ior: *ior, tint: *tint }.into()
            }
            Model::Glass { ior, tint, roughness, is_thin } => rough_dielectric::RoughDielectricProgram {
                facets: microsurface::MicrosurfaceProgram { roughness: *roughness, anisotropy: None },
                ior: *ior,
                walls: if *is_thin { Walls::Thin } else { Walls::Solid },
                tint: *tint,
                tints_once: false,
                energy_compensation,
            }
            .into(),
            Model::Pbr(pbr) => program_pbr::program_of(pbr, energy_compensation),
        }
    }
}
