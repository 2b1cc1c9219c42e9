//! BSDFs: one file for each lobe or family of lobes, and the enum [`Bsdf`] over them, generated from the table in this file.
//!
//! Directions are unit vectors in the local frame with the shading normal as z; both point away from the surface. z of `wo` may be
//! negative: opaque lobes are two-sided, for dielectrics negative z is the inside. Weights are for camera paths: radiance transmitted
//! into a denser medium is scaled by 1 / eta^2, and back on the way out (as in pbrt and Mitsuba); [`BsdfSample::eta`] lets Russian
//! roulette undo this scaling.

/// The little-endian numbers of a file as nested arrays, the last axis contiguous.
macro_rules! table_file {
    ($number:ty, $file:literal) => {{
        const BYTES: &[[u8; size_of::<$number>()]] = include_bytes!($file).as_chunks().0;
        let mut numbers = [0 as $number; BYTES.len()];
        let mut i = 0;
        while i < numbers.len() {
            numbers[i] = <$number>::from_le_bytes(BYTES[i]);
            i += 1;
        }
        bytemuck::must_cast(numbers)
    }};
}

pub mod anisotropic_table;
mod blend;
mod dielectric;
pub mod dielectric_table;
mod diffuse;
mod dispatch;
mod empirical;
pub mod fresnel;
pub mod ggx;
mod hair;
mod layered;
mod lobe;
mod metal;
mod metal_rough;
mod microsurface;
pub mod phase;
#[cfg(test)]
mod reference;
mod rough_dielectric;
mod sheen;
mod subsurface;
mod thin_film;

pub use crate::scene::ShadingModel;
pub use dielectric::SmoothInterface;
pub use dielectric_table::mean_cosine;
pub use diffuse::LambertTransmission;
pub use fresnel::{DielectricCurve, LayerFresnel};
pub use ggx::{DirectionalAlbedo, to_upper_side};
pub use layered::Coat;
pub use lobe::{
    Appearance, BsdfEval, BsdfSample, Factors, Lobe, LocalFrame, MaterialProgram, Refraction, Slots,
    Transmissive,
};
pub use metal_rough::MetalRoughClosure;
pub use microsurface::{Facets, Isotropic, Microsurface};
pub use rough_dielectric::{GlassReflectance, Walls};
pub use sheen::Sheen;
pub use thin_film::ThinFilm;

use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::{
    ColorSlot, EnergyCompensation, FresnelModel, GlassReflection, Model, PbrMaterial, SkippedCaustics,
};
use lobe::{is_always, without_negative_zero};

dispatch::bsdfs! {
    opaque {
        /// Ideal diffuse reflection.
        diffuse::Lambert(diffuse::LambertProgram),
        /// Rough diffuse reflection.
        diffuse::OrenNayar(diffuse::OrenNayarProgram),
        /// The modified Phong model.
        empirical::Phong(empirical::PhongProgram),
        /// Ashikhmin's velvet.
        empirical::Velvet(empirical::VelvetProgram),
        /// Toon shading.
        empirical::Toon(empirical::ToonProgram),
        /// A metal with Schlick's Fresnel term.
        metal::SchlickMetal(metal::SchlickMetalProgram),
        /// Beckmann facets of constant reflectance.
        metal::Beckmann(metal::BeckmannProgram),
        /// A metal with a complex index of refraction.
        metal::Conductor(metal::ConductorProgram),
        /// The opaque glTF material.
        metal_rough::MetalRough(metal_rough::MetalRoughProgram),
        /// The weighted sum of two diffuse or glossy materials.
        blend::Blend(blend::BlendProgram),
    }
    transmissive {
        /// Smooth solid glass.
        dielectric::Dielectric(dielectric::DielectricProgram),
        /// Smooth thin-walled glass.
        dielectric::ThinDielectric(dielectric::ThinDielectricProgram),
        /// Glass of any roughness, solid or thin-walled.
        rough_dielectric::RoughDielectric(rough_dielectric::RoughDielectricProgram),
        /// The glTF material with all layers.
        layered::Layered(layered::LayeredProgram),
        /// A hair fibre.
        hair::Hair(hair::HairProgram),
    }
}

impl Bsdf {
    /// Whether it is specular and opaque.
    pub fn is_mirror(&self) -> bool {
        self.is_specular() && self.appearance().transmission == Rgb::ZERO
    }

    /// Index of refraction, reflection and refraction of a smooth interface of solid glass at an incident cosine, from inside or from
    /// outside; `None` for other BSDFs.
    pub fn specular_interface(&self, cosine: f32, is_inside: bool) -> Option<(f32, SmoothInterface)> {
        match self {
            Bsdf::Dielectric(glass) => Some((glass.ior, glass.interface(cosine, is_inside))),
            Bsdf::RoughDielectric(glass) => Some((glass.ior, glass.specular_interface(cosine, is_inside)?)),
            _ => None,
        }
    }

    /// Index of refraction and alpha (0 if smooth) of an interface of solid glass; `None` for other BSDFs.
    pub fn solid_ior_and_alpha(&self) -> Option<(f32, f32)> {
        match self {
            Bsdf::Dielectric(glass) => Some((glass.ior, 0.0)),
            Bsdf::RoughDielectric(glass) => glass.solid_ior_and_alpha(),
            _ => None,
        }
    }

    /// The BSDF without its [straight transmission](Bsdf::straight).
    pub fn without_straight(self) -> Bsdf {
        let without = |glass: RoughDielectric| RoughDielectric { tint: Rgb::ZERO, ..glass };
        match self {
            Bsdf::ThinDielectric(ThinDielectric { ior, .. }) => Bsdf::RoughDielectric(without(
                single_scattering_glass(ior, Walls::Thin, Refraction::Scales, 0.0),
            )),
            Bsdf::RoughDielectric(glass) => Bsdf::RoughDielectric(without(glass)),
            Bsdf::Layered(layered) => Bsdf::Layered(Layered { glass: without(layered.glass), ..layered }),
            other => other,
        }
    }

    /// Splits the BSDF for `wo`: the diffuse base as attenuated by the layers above it; the layers; and the fraction (0..1) of the
    /// directional albedo that is the base's.
    pub fn split_layers(self, wo: Vec3) -> (Bsdf, Bsdf, f32) {
        match self {
            base if base.is_diffuse_base() => (base, Bsdf::Black, 1.0),
            Bsdf::MetalRough(material) => {
                let closure = material.closure(to_upper_side(wo));
                let base = Bsdf::Lambert(Lambert { albedo: closure.diffuse });
                (base, self.without_base(), closure.probability_diffuse)
            }
            Bsdf::Blend(blend) => {
                let (albedo, fraction) = blend.base(wo);
                (Bsdf::Lambert(Lambert { albedo }), self.without_base(), fraction)
            }
            Bsdf::Layered(layered) => {
                let (base, fraction) = layered.base(wo);
                let base = match base.roughness > 0.0 {
                    true => Bsdf::OrenNayar(base),
                    false => Bsdf::Lambert(Lambert { albedo: base.color }),
                };
                (base, self.without_base(), fraction)
            }
            other => (Bsdf::Black, other, 0.0),
        }
    }

    /// Whether there is a diffuse base, or diffuse transmission.
    pub fn has_base(&self) -> bool {
        match self {
            Bsdf::Phong(_) => true,
            Bsdf::Toon(toon) => !toon.is_glossy,
            Bsdf::MetalRough(material) => material.diffuse != Rgb::ZERO,
            Bsdf::Blend(blend) => blend.parts.iter().any(|part| part.diffuse != Rgb::ZERO),
            Bsdf::Layered(layered) => {
                layered.opaque.diffuse != Rgb::ZERO || layered.transmission_albedo != Rgb::ZERO
            }
            other => other.is_diffuse_base(),
        }
    }

    /// The BSDF without its diffuse base.
    pub fn without_base(self) -> Bsdf {
        match self {
            base if base.is_diffuse_base() => Bsdf::Black,
            Bsdf::MetalRough(material) => Bsdf::MetalRough(MetalRough { diffuse: Rgb::ZERO, ..material }),
            Bsdf::Blend(mut blend) => {
                blend.modify_parts(|part| part.diffuse = Rgb::ZERO);
                Bsdf::Blend(blend)
            }
            Bsdf::Layered(mut layered) => {
                layered.opaque.diffuse = Rgb::ZERO;
                Bsdf::Layered(layered)
            }
            other => other,
        }
    }

    /// Removes glossy and specular reflection or transmission, for skipped caustics. In glass that keeps one of the two lobes, that
    /// lobe still includes the light that energy compensation has moved into it from the removed one.
    pub fn remove_lobes(&mut self, skipped: SkippedCaustics) {
        let SkippedCaustics { reflective, refractive } = skipped;
        match self {
            Bsdf::SchlickMetal(_) | Bsdf::Beckmann(_) | Bsdf::Conductor(_) if reflective => {
                *self = Bsdf::Black
            }
            Bsdf::Phong(phong) if reflective => phong.specular = Rgb::ZERO,
            Bsdf::Toon(toon) if reflective && toon.is_glossy => *self = Bsdf::Black,
            Bsdf::MetalRough(material) if reflective => material.remove_reflection(),
            Bsdf::Blend(blend) if reflective => blend.modify_parts(MetalRough::remove_reflection),
            Bsdf::Dielectric(_) | Bsdf::ThinDielectric(_) | Bsdf::RoughDielectric(_)
                if reflective && refractive =>
            {
                *self = Bsdf::Black;
            }
            Bsdf::RoughDielectric(glass) => glass.remove_lobes(skipped),
            Bsdf::Layered(layered) => layered.remove_lobes(skipped),
            _ => {}
        }
    }

    /// Whether light crosses the surface into or out of a body with subsurface scattering.
    pub fn has_subsurface(&self) -> bool {
        matches!(self, Bsdf::Layered(layered) if layered.body.is_some())
    }

    /// Raises the alpha of all facets to a minimum, including exact mirrors and smooth solid glass.
    pub fn roughen(&mut self, min_alpha: f32) {
        if min_alpha < ggx::MIN_ALPHA {
            return;
        }
        match self {
            Bsdf::SchlickMetal(metal) => metal.alpha = metal.alpha.max(min_alpha),
            Bsdf::Beckmann(facets) => facets.alpha = facets.alpha.max(min_alpha),
            Bsdf::Conductor(metal) => metal.surface.roughen(min_alpha),
            Bsdf::MetalRough(material) => material.surface.alpha = material.surface.alpha.max(min_alpha),
            Bsdf::Blend(blend) => {
                blend.modify_parts(|part| part.surface.alpha = part.surface.alpha.max(min_alpha))
            }
            Bsdf::RoughDielectric(glass) => glass.roughen(min_alpha),
            Bsdf::Dielectric(glass) if glass.ior != 1.0 => {
                let rough = single_scattering_glass(glass.ior, Walls::Solid, glass.refraction, min_alpha);
                *self = Bsdf::RoughDielectric(RoughDielectric {
                    tint: glass.tint,
                    is_beckmann: glass.is_beckmann,
                    ..rough
                });
            }
            Bsdf::Layered(layered) => {
                layered.opaque.surface.roughen(min_alpha);
                layered.glass.roughen(min_alpha);
                layered.coat.alpha = layered.coat.alpha.max(min_alpha);
            }
            _ => {}
        }
    }
}

/// Colourless glass without energy compensation.
fn single_scattering_glass(ior: f32, walls: Walls, refraction: Refraction, alpha: f32) -> RoughDielectric {
    RoughDielectric {
        surface: Microsurface::isotropic(alpha),
        ior,
        walls,
        refraction,
        tint: Rgb::ONE,
        reflectance: GlassReflectance::Plain,
        energy_compensation: EnergyCompensation::Off,
        is_beckmann: false,
    }
}

impl BsdfProgram {
    /// The program of the cheapest BSDF that is equivalent to a material model for all values of its textures.
    pub fn of(model: &Model, shading: ShadingModel) -> BsdfProgram {
        let energy_compensation = shading.energy_compensation;
        match model {
            // Mixes are resolved to a component at each hit.
            Model::Black | Model::Mix { .. } => BsdfProgram::Black,
            Model::Lambert { albedo } => LambertProgram { albedo: *albedo }.into(),
            Model::OrenNayar { color, roughness } if is_always(roughness, 0.0) => {
                LambertProgram { albedo: *color }.into()
            }
            Model::OrenNayar { color, roughness } => {
                OrenNayarProgram { color: *color, roughness: *roughness }.into()
            }
            Model::Phong { diffuse, specular, exponent } => {
                PhongProgram { diffuse: *diffuse, specular: *specular, exponent: *exponent }.into()
            }
            Model::Velvet { color, deviation } => {
                VelvetProgram { color: *color, deviation: *deviation }.into()
            }
            Model::Toon { color, size, smooth } | Model::ToonHighlight { color, size, smooth } => {
                let is_glossy = matches!(model, Model::ToonHighlight { .. });
                ToonProgram { color: *color, size: *size, smooth: *smooth, is_glossy }.into()
            }
            Model::SchlickMetal { color, roughness } => {
                SchlickMetalProgram { color: *color, roughness: *roughness, energy_compensation }.into()
            }
            Model::Beckmann { color, roughness } => {
                BeckmannProgram { color: *color, roughness: *roughness }.into()
            }
            Model::Conductor { eta, k, metal, roughness } => ConductorProgram {
                metal: *metal,
                eta: Rgb::from_array(*eta),
                k: Rgb::from_array(*k),
                roughness: *roughness,
                energy_compensation,
            }
            .into(),
            Model::Dielectric { ior, tint, fresnel } => DielectricProgram::new(*ior, *tint, *fresnel).into(),
            // The index-matched boundary of a medium.
            Model::Boundary {} => {
                let tint = ColorSlot::constant([1.0; 3]);
                DielectricProgram::new(1.0, tint, FresnelModel::Exact).into()
            }
            Model::Glass { ior, tint, roughness, is_thin: true } if is_always(roughness, 0.0) => {
                ThinDielectricProgram { ior: *ior, tint: *tint }.into()
            }
            Model::Glass { ior, tint, roughness, is_thin } => RoughDielectricProgram {
                walls: if *is_thin { Walls::Thin } else { Walls::Solid },
                ..RoughDielectricProgram::new(*ior, *tint, *roughness, energy_compensation)
            }
            .into(),
            Model::Hair { color, roughness, radial_roughness, ior, tilt_rad, coat } => HairProgram {
                color: *color,
                roughness: *roughness,
                radial_roughness: *radial_roughness,
                ior: *ior,
                tilt_rad: *tilt_rad,
                coat: *coat,
            }
            .into(),
            Model::Pbr(pbr) => BsdfProgram::of_pbr(pbr, shading),
        }
    }

    /// The weighted sum of two programs; `None` if [`Blend`] doesn't support them.
    pub fn blend(weights: [ColorSlot; 2], programs: [&BsdfProgram; 2]) -> Option<BsdfProgram> {
        let [a, b] = programs.map(BsdfProgram::as_metal_rough);
        Some(BlendProgram { weights, parts: [a?, b?] }.into())
    }

    /// An equivalent metallic-roughness program, if there is one.
    fn as_metal_rough(&self) -> Option<MetalRoughProgram> {
        match self {
            BsdfProgram::Lambert(diffuse) => Some(MetalRoughProgram::diffuse(diffuse.albedo)),
            BsdfProgram::SchlickMetal(metal) => {
                Some(MetalRoughProgram::metal(metal.color, metal.roughness, metal.energy_compensation))
            }
            BsdfProgram::MetalRough(program) => Some(*program),
            _ => None,
        }
    }

    fn of_pbr(pbr: &PbrMaterial, shading: ShadingModel) -> BsdfProgram {
        let energy_compensation = pbr.energy_compensation.unwrap_or(shading.energy_compensation);
        // `MetalRough` is shaded in vectorised loops with one Fresnel model for all hits.
        let is_vectorisable = !pbr.has_constant_reflectance || shading.fresnel == FresnelModel::Exact;
        let shading = ShadingModel { energy_compensation, ..shading };
        let layered = || LayeredProgram::new(pbr, shading).into();
        let is_dielectric = is_always(&pbr.metallic, 0.0);
        let is_rough = layered::is_rough_diffuse(pbr);
        if layered::is_layered(pbr) {
            return layered();
        }
        if layered::transmits(pbr) {
            let is_clear =
                is_dielectric && is_always(&pbr.transmission, 1.0) && layered::has_default_specular(pbr);
            return if is_clear { BsdfProgram::of_glass(pbr, energy_compensation) } else { layered() };
        }
        if is_dielectric && is_always(&pbr.specular, 0.0) {
            // Without specular reflection the roughness has no effect.
            let black = pbr.base_color.texture.is_none() && pbr.base_color.factor == [0.0; 3];
            return match (black, is_rough) {
                (true, _) => BsdfProgram::Black,
                (_, false) => LambertProgram { albedo: pbr.base_color }.into(),
                (_, true) => {
                    OrenNayarProgram { color: pbr.base_color, roughness: pbr.diffuse_roughness }.into()
                }
            };
        }
        if pbr.anisotropy.is_some() || is_rough || !is_vectorisable {
            return layered();
        }
        if is_always(&pbr.metallic, 1.0) && is_always(&pbr.roughness, 0.0) {
            let (color, roughness) = (pbr.base_color, pbr.roughness);
            return SchlickMetalProgram { color, roughness, energy_compensation }.into();
        }
        // Also for rough metals, since its loops are vectorised.
        MetalRoughProgram::new(pbr, shading).into()
    }

    /// The program of pure glass.
    fn of_glass(pbr: &PbrMaterial, energy_compensation: EnergyCompensation) -> BsdfProgram {
        let (ior, varying_ior, tint, tints_once) = (pbr.ior, pbr.varying_ior, pbr.base_color, pbr.tints_once);
        let (walls, refraction, is_beckmann) =
            (layered::walls(pbr), layered::refraction(pbr), pbr.is_beckmann);
        let (reflection, is_white) = (pbr.glass_reflection, pbr.glass_reflection == GlassReflection::White);
        if !is_always(&pbr.roughness, 0.0) || pbr.anisotropy.is_some() || !is_white {
            let facets = layered::facets(pbr);
            return RoughDielectricProgram {
                facets,
                ior,
                varying_ior,
                walls,
                refraction,
                tint,
                tints_once,
                reflection,
                energy_compensation,
                is_beckmann,
            }
            .into();
        }
        match walls {
            Walls::Solid => {
                let fresnel = FresnelModel::Exact;
                DielectricProgram { ior, varying_ior, refraction, tint, tints_once, fresnel, is_beckmann }
                    .into()
            }
            Walls::Thin => ThinDielectricProgram { ior, tint }.into(),
        }
    }
}
