//! The opaque glTF 2.0 material: a dielectric GGX layer over a diffuse base, mixed with metal.

use super::fresnel::{DielectricCurve, LayerFresnel};
use super::ggx::DirectionalAlbedo;
use super::lobe::MIN_ALBEDO;
use super::microsurface::{Facets, Isotropic};
use super::{Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots, fresnel, ggx};
use crate::color::Rgb;
use crate::math::{Vec3, select};
use crate::sampling::warp;
use crate::scene::{ColorSlot, EnergyCompensation, FloatSlot, PbrMaterial, ShadingModel};
use std::f32::consts::FRAC_1_PI;

/// The glTF metallic-roughness material (glTF 2.0, appendix B; KHR_materials_specular).
///
/// Dielectric and metal share their microfacets, so both reflections are one lobe with a Fresnel term mixed by `metallic` and energy
/// compensation for each (Turquin 2019, eq. 16). Deviations from the appendix: the Fresnel term of the layer may be the exact curve
/// (see [`LayerFresnel`]) instead of Schlick's approximation; and the base is attenuated by the layer's directional albedo (albedo
/// scaling, as the appendix allows) rather than by 1 - F(v.h), which may gain energy.
#[derive(Clone, Copy, Debug)]
pub struct MetalRough<S = Isotropic> {
    /// Diffuse albedo: base colour times (1 - metallic).
    pub diffuse: Rgb,
    /// Reflectance of the dielectric layer at normal incidence.
    pub layer_f0: Rgb,
    /// Fresnel reflectance of the layer at grazing incidence.
    pub layer_f90: f32,
    /// Fresnel term between `layer_f0` and `layer_f90`.
    pub layer_fresnel: LayerFresnel,
    /// Reflectance of the metal at normal incidence; Schlick's Fresnel term.
    pub metal_f0: Rgb,
    /// Weight of the metal, 0..1.
    pub metallic: f32,
    /// Microfacet distribution.
    pub surface: S,
    /// Energy compensation of single scattering.
    pub energy_compensation: EnergyCompensation,
}

/// The closure of a [`MetalRough`] for one view direction.
#[derive(Clone, Copy, Debug, Default)]
pub struct MetalRoughClosure {
    /// Diffuse albedo, attenuated by the dielectric layer.
    pub diffuse: Rgb,
    /// Transmittance of the dielectric layer to the base, 0..1.
    pub layer_transmittance: f32,
    /// Reflectance of the microfacets at normal incidence, compensation included.
    pub f0: Rgb,
    /// F90 - F0, compensation included, of the part of the reflectance that is interpolated by Schlick's weight.
    pub schlick_rise: Rgb,
    /// F90 - F0, compensation included, of the part that is interpolated by the weight of `curve`.
    pub exact_rise: Rgb,
    /// The exact Fresnel curve of the dielectric layer.
    pub curve: DielectricCurve,
    /// Directional albedo, mean of the channels.
    pub albedo: f32,
    /// Probability of sampling the microfacets. Both probabilities are computed separately, so that a tiny one does not round to 0.
    pub probability_specular: f32,
    /// Probability of sampling diffuse reflection.
    pub probability_diffuse: f32,
}

impl MetalRough {
    /// A black surface.
    pub const BLACK: MetalRough = MetalRough {
        diffuse: Rgb::ZERO,
        layer_f0: Rgb::ZERO,
        layer_f90: 0.0,
        layer_fresnel: LayerFresnel::Schlick,
        metal_f0: Rgb::ZERO,
        metallic: 0.0,
        surface: Isotropic { alpha: 1.0 },
        energy_compensation: EnergyCompensation::Off,
    };
}

impl<S: Facets> MetalRough<S> {
    /// Removes the dielectric layer and the metal.
    pub fn remove_reflection(&mut self) {
        (self.layer_f0, self.layer_f90) = (Rgb::ZERO, 0.0);
        (self.metal_f0, self.metallic) = (Rgb::ZERO, 0.0);
    }

    /// The closure for a view direction above the surface.
    #[inline(always)]
    pub fn closure(&self, above: Vec3) -> MetalRoughClosure {
        let table = self.surface.directional_albedo(above);
        let layer_grazing = match self.layer_fresnel {
            LayerFresnel::Schlick => table.grazing,
            LayerFresnel::Exact(curve) => self.surface.dielectric_grazing(above, table, curve),
        };
        self.closure_by(table, layer_grazing, above)
    }

    /// The closure from the directional albedo of the facets. `layer_grazing`: that albedo weighted by the layer's Fresnel term, from 0
    /// at normal to 1 at grazing incidence.
    #[inline(always)]
    pub fn closure_by(&self, table: DirectionalAlbedo, layer_grazing: f32, above: Vec3) -> MetalRoughClosure {
        // Mirrors have an albedo of 1 and the Fresnel weight of a single cosine.
        let is_mirror = self.surface.is_mirror();
        let full = if is_mirror { 1.0 } else { table.full };
        let grazing = if is_mirror { fresnel::schlick_weight(above.z) } else { table.grazing };
        let layer_grazing = if is_mirror { self.layer_fresnel.weight(above.z) } else { layer_grazing };
        let table = DirectionalAlbedo { full, grazing };
        let layer_table = DirectionalAlbedo { full, grazing: layer_grazing };
        let is_compensated = self.energy_compensation == EnergyCompensation::On;
        let compensation = |f0| Rgb::select(is_compensated, table.compensation(f0), Rgb::ONE);
        let (layer_compensation, metal_compensation) =
            (compensation(self.layer_f0), compensation(self.metal_f0));
        let layer =
            (layer_table.reflectance(self.layer_f0, self.layer_f90) * layer_compensation).max_element();
        // Without compensation, energy lost between facets must not go to the base. (With Schlick's weight it does, so that
        // existing pictures stay the same.)
        let withholds_lost_energy = matches!(
            (self.energy_compensation, self.layer_fresnel),
            (EnergyCompensation::Off, LayerFresnel::Exact(_))
        );
        let blocked = if withholds_lost_energy { layer / full } else { layer };
        let layer_transmittance = if blocked < 1.0 { 1.0 - blocked } else { 0.0 };
        let layer_factor = layer_compensation * (1.0 - self.metallic);
        let metal_factor = metal_compensation * self.metallic;
        let f0 = self.layer_f0 * layer_factor + self.metal_f0 * metal_factor;
        let (schlick_rise, exact_rise, curve, specular);
        match self.layer_fresnel {
            LayerFresnel::Schlick => {
                let f90 = layer_factor * self.layer_f90 + metal_factor;
                (schlick_rise, exact_rise, curve) = (f90 - f0, Rgb::ZERO, DielectricCurve::default());
                specular = f0 * (full - grazing) + f90 * grazing;
            }
            LayerFresnel::Exact(exact) => {
                schlick_rise = metal_factor * (Rgb::ONE - self.metal_f0);
                exact_rise = layer_factor * (Rgb::splat(self.layer_f90) - self.layer_f0);
                curve = exact;
                specular = f0 * full + schlick_rise * grazing + exact_rise * layer_grazing;
            }
        }
        let diffuse = self.diffuse * layer_transmittance;
        let (s, d) = (specular.mean(), diffuse.mean());
        let albedo = s + d;
        let normalization = if albedo > MIN_ALBEDO { albedo } else { 1.0 };
        MetalRoughClosure {
            diffuse,
            layer_transmittance,
            f0,
            schlick_rise,
            exact_rise,
            curve,
            albedo,
            probability_specular: s / normalization,
            probability_diffuse: d / normalization,
        }
    }
}

impl<S: Facets> Lobe for MetalRough<S> {
    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let above = ggx::to_upper_side(wo);
        self.closure(above).sample(&self.surface, wo, above, u)
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        let above = ggx::to_upper_side(wo);
        self.closure(above).eval(&self.surface, above, Vec3::new(wi.x, wi.y, wi.z.abs()))
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        self.surface.is_mirror() && self.diffuse == Rgb::ZERO
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        MetalRough { diffuse: self.diffuse * color, metal_f0: self.metal_f0 * color, ..self }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        let reflected = self.layer_f0 * (1.0 - self.metallic) + self.metal_f0 * self.metallic;
        (self.diffuse + reflected).min(Rgb::ONE)
    }

    fn appearance(&self) -> Appearance {
        let glossy = self.layer_f0 * (1.0 - self.metallic) + self.metal_f0 * self.metallic;
        let roughness = Appearance::roughness(self.surface.alpha());
        Appearance { diffuse: self.diffuse, glossy: glossy.min(Rgb::ONE), roughness, ..Appearance::BLACK }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let is_reflected = (wo.z < 0.0) == (wi.z < 0.0);
        let diffuse = self.closure(ggx::to_upper_side(wo)).diffuse;
        diffuse * if is_reflected { FRAC_1_PI * wi.z.abs() } else { 0.0 }
    }
}

// Without data-dependent branches, so that loops over many hits vectorise.
impl MetalRoughClosure {
    /// Compensated Fresnel reflectance of facets at a cosine.
    #[inline(always)]
    fn reflectance(&self, cosine: f32) -> Rgb {
        let by_schlick = self.f0 + self.schlick_rise * fresnel::schlick_weight(cosine);
        by_schlick + self.exact_rise * self.curve.weight(cosine)
    }

    /// See [`super::Bsdf::sample`]; `above` is `wo` on the upper side.
    #[inline(always)]
    pub fn sample(&self, surface: &impl Facets, wo: Vec3, above: Vec3, u: [f32; 3]) -> BsdfSample {
        let chosen = self.sample_lobe(surface, above, u);
        let sample = self.sample_of(surface, above, &chosen, (chosen.wi, chosen.wi.z));
        let wi = chosen.wi;
        BsdfSample { wi: Vec3::new(wi.x, wi.y, wi.z.copysign(wo.z)), ..sample }
    }

    /// Samples a lobe and a direction around that lobe's normal, for a viewer above the surface.
    #[inline(always)]
    pub fn sample_lobe(&self, surface: &impl Facets, above: Vec3, u: [f32; 3]) -> SampledLobe {
        let is_specular = u[2] < self.probability_specular;
        let normal = surface.sample_visible_normal(above, [u[0], u[1]]);
        let reflected = normal * (2.0 * above.dot(normal)) - above;
        let diffuse = warp::cosine_hemisphere([u[0], u[1]]);
        SampledLobe { wi: select(is_specular, reflected, diffuse), is_specular }
    }

    /// The sample of a lobe's direction: `wi` in the frame of the facets, and its cosine to the normal of the diffuse base.
    #[inline(always)]
    pub fn sample_of(
        &self,
        surface: &impl Facets,
        above: Vec3,
        lobe: &SampledLobe,
        (wi, base_cosine): (Vec3, f32),
    ) -> BsdfSample {
        let is_mirror = lobe.is_specular & surface.is_mirror();
        let value = self.eval_around(surface, above, wi, base_cosine);
        let of_mirror = self.reflectance(above.z) / self.probability_specular;
        let weight = Rgb::select(is_mirror, of_mirror, value.f_cos / value.pdf_solid_angle);
        let pdf = if is_mirror { self.probability_specular } else { value.pdf_solid_angle };
        let is_above = (wi.z > 0.0) | (base_cosine > 0.0) & !is_mirror;
        let continues = (self.albedo > MIN_ALBEDO) & is_above & (pdf > 0.0);
        BsdfSample {
            wi,
            weight: Rgb::select(continues, weight, Rgb::ZERO),
            pdf_solid_angle: if continues { pdf } else { 0.0 },
            eta: 1.0,
            flux: 1.0,
            is_specular: is_mirror,
            is_transmission: false,
        }
    }

    /// Value and pdf for directions above the surface.
    #[inline(always)]
    pub fn eval(&self, surface: &impl Facets, wo: Vec3, wi: Vec3) -> BsdfEval {
        self.eval_around(surface, wo, wi, wi.z)
    }

    /// Value and pdf for directions in the frame of the facets; `base_cosine` is that of `wi` to the normal of the diffuse base.
    #[inline(always)]
    pub fn eval_around(&self, surface: &impl Facets, wo: Vec3, wi: Vec3, base_cosine: f32) -> BsdfEval {
        let cosine = (if base_cosine > 0.0 { base_cosine } else { 0.0 }) * FRAC_1_PI;
        let r = surface.reflection(wo, wi);
        let factor = self.reflectance(r.cos_half);
        let is_glossy = !surface.is_mirror() & (wi.z > 0.0);
        let glossy_pdf = if is_glossy { self.probability_specular * r.pdf_solid_angle } else { 0.0 };
        BsdfEval {
            f_cos: self.diffuse * cosine + Rgb::select(is_glossy, factor * r.f_cos, Rgb::ZERO),
            pdf_solid_angle: self.probability_diffuse * cosine + glossy_pdf,
        }
    }
}

/// A sampled lobe of a [`MetalRoughClosure`].
#[derive(Clone, Copy, Debug)]
pub struct SampledLobe {
    /// Direction around the lobe's normal.
    pub wi: Vec3,
    /// Is it the lobe of the facets?
    pub is_specular: bool,
}

/// The parameters of a [`MetalRough`].
#[derive(Clone, Copy, Debug)]
pub struct MetalRoughProgram {
    base_color: ColorSlot,
    metallic: FloatSlot,
    roughness: FloatSlot,
    specular: FloatSlot,
    specular_color: ColorSlot,
    /// Reflectance of the dielectric layer at normal incidence by its index of refraction.
    ior_f0: f32,
    layer_fresnel: LayerFresnel,
    pub(super) energy_compensation: EnergyCompensation,
}

impl MetalRoughProgram {
    /// Weight of the metal.
    pub fn metallic(&self) -> FloatSlot {
        self.metallic
    }

    /// Perceptual roughness.
    pub fn roughness(&self) -> FloatSlot {
        self.roughness
    }

    pub(super) fn new(pbr: &PbrMaterial, shading: ShadingModel) -> MetalRoughProgram {
        MetalRoughProgram {
            base_color: pbr.base_color,
            metallic: pbr.metallic,
            roughness: pbr.roughness,
            specular: pbr.specular,
            specular_color: pbr.specular_color,
            // KHR_materials_ior: 0 means total reflection.
            ior_f0: if pbr.ior == 0.0 { 1.0 } else { fresnel::f0_from_eta(pbr.ior) },
            layer_fresnel: if pbr.has_constant_reflectance {
                LayerFresnel::CONSTANT
            } else {
                LayerFresnel::new(shading.fresnel, pbr.ior)
            },
            energy_compensation: shading.energy_compensation,
        }
    }

    /// A diffuse surface.
    pub(super) fn diffuse(albedo: ColorSlot) -> MetalRoughProgram {
        MetalRoughProgram {
            base_color: albedo,
            metallic: FloatSlot::constant(0.0),
            roughness: FloatSlot::constant(1.0),
            specular: FloatSlot::constant(0.0),
            specular_color: ColorSlot::constant([1.0; 3]),
            ior_f0: 0.0,
            layer_fresnel: LayerFresnel::Schlick,
            energy_compensation: EnergyCompensation::Off,
        }
    }

    /// A metal with Schlick's Fresnel term.
    pub(super) fn metal(
        color: ColorSlot,
        roughness: FloatSlot,
        energy_compensation: EnergyCompensation,
    ) -> MetalRoughProgram {
        let metallic = FloatSlot::constant(1.0);
        MetalRoughProgram { metallic, roughness, energy_compensation, ..MetalRoughProgram::diffuse(color) }
    }
}

impl MaterialProgram for MetalRoughProgram {
    type Lobe = MetalRough;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> MetalRough {
        let base = slots.reflectance(&self.base_color);
        let (metallic, specular) =
            (slots.clamped_number(&self.metallic), slots.clamped_number(&self.specular));
        let alpha = slots.alpha(&self.roughness);
        let tint = slots.color(&self.specular_color).max(Rgb::ZERO);
        MetalRough {
            diffuse: base * (1.0 - metallic),
            // KHR_materials_specular: f0 is clamped before multiplication by the factor.
            layer_f0: (tint * self.ior_f0).min(Rgb::ONE) * specular,
            layer_f90: specular,
            layer_fresnel: self.layer_fresnel,
            metal_f0: base,
            metallic,
            surface: Isotropic { alpha },
            energy_compensation: self.energy_compensation,
        }
    }
}
