//! Programs of the glTF material, and what tells which one is the simplest that is equivalent to it.

use super::dielectric::tint_of_crossing;
use super::dielectric_curve::LayerFresnel;
use super::layered::Layered;
use super::metal_rough::MetalRough;
use super::microsurface::{Isotropic, MicrosurfaceProgram};
use super::program::{LocalFrame, MaterialProgram, Slots, always};
use super::rough_dielectric::{GlassReflectance, RoughDielectric, Walls};
use super::{Coat, Refraction, Sheen, ThinFilm, fresnel};
use crate::color::Rgb;
use crate::scene::{
    Clearcoat, ColorSlot, DiffuseTransmission, EnergyCompensation, FloatSlot, GlassReflection, Iridescence,
    PbrMaterial, ShadingModel,
};

/// Can light pass the interface? An index of refraction of 0 means that all is reflected.
pub(super) fn transmits(pbr: &PbrMaterial) -> bool {
    !always(&pbr.transmission, 0.0) && pbr.ior > 0.0 && !always(&pbr.metallic, 1.0)
}

/// Is the dielectric's reflectance that of its index of refraction?
pub(super) fn is_plain(pbr: &PbrMaterial) -> bool {
    always(&pbr.specular, 1.0) && pbr.specular_color == ColorSlot::constant([1.0; 3])
}

/// Is there something that only [`Layered`] has?
pub(super) fn is_layered(pbr: &PbrMaterial) -> bool {
    pbr.clearcoat.is_some()
        || pbr.sheen.is_some()
        || pbr.iridescence.is_some()
        || pbr.diffuse_transmission.is_some()
}

/// Is there a diffuse base that doesn't follow Lambert's law?
pub(super) fn is_rough_diffuse(pbr: &PbrMaterial) -> bool {
    !always(&pbr.diffuse_roughness, 0.0) && !always(&pbr.metallic, 1.0)
}

/// Its facets.
pub(super) fn facets(pbr: &PbrMaterial) -> MicrosurfaceProgram {
    MicrosurfaceProgram { roughness: pbr.roughness, anisotropy: pbr.anisotropy }
}

/// What is behind its surface.
pub(super) fn walls(pbr: &PbrMaterial) -> Walls {
    if pbr.has_volume || pbr.keeps_radiance { Walls::Solid } else { Walls::Thin }
}

/// What becomes of radiance where light enters it.
pub(super) fn refraction(pbr: &PbrMaterial) -> Refraction {
    if pbr.keeps_radiance { Refraction::KeepsRadiance } else { Refraction::Scales }
}

/// The parameters of a [`MetalRough`].
#[derive(Clone, Copy, Debug)]
pub struct MetalRoughProgram {
    base_color: ColorSlot,
    metallic: FloatSlot,
    roughness: FloatSlot,
    specular: FloatSlot,
    specular_color: ColorSlot,
    /// Reflectance of the dielectric layer at normal incidence, as its index of refraction gives it.
    normal: f32,
    layer_fresnel: LayerFresnel,
    energy_compensation: EnergyCompensation,
}

impl MetalRoughProgram {
    /// Share of metal.
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
            // KHR_materials_ior: 0 means that all light is reflected.
            normal: if pbr.ior == 0.0 { 1.0 } else { fresnel::f0_from_eta(pbr.ior) },
            layer_fresnel: LayerFresnel::new(shading.fresnel, pbr.ior),
            energy_compensation: shading.energy_compensation,
        }
    }
}

impl MaterialProgram for MetalRoughProgram {
    type Lobe = MetalRough;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> MetalRough {
        let base = slots.share_by_channel(&self.base_color);
        let (metallic, specular) = (slots.share(&self.metallic), slots.share(&self.specular));
        let alpha = slots.alpha(&self.roughness);
        let tint = slots.color(&self.specular_color).max(Rgb::ZERO);
        MetalRough {
            diffuse: base * (1.0 - metallic),
            // KHR_materials_specular: f0 is clamped before the factor.
            layer_f0: (tint * self.normal).min(Rgb::ONE) * specular,
            layer_f90: specular,
            layer_fresnel: self.layer_fresnel,
            metal_f0: base,
            metallic,
            surface: Isotropic { alpha },
            energy_compensation: self.energy_compensation,
        }
    }
}

/// The parameters of a [`Layered`].
#[derive(Clone, Copy, Debug)]
pub struct LayeredProgram {
    opaque: MetalRoughProgram,
    facets: MicrosurfaceProgram,
    diffuse_roughness: FloatSlot,
    /// Share of light that passes the interface, where it lets light pass.
    transmission: Option<FloatSlot>,
    ior: f32,
    walls: Walls,
    refraction: Refraction,
    tints_once: bool,
    /// Colour of what the glass reflects.
    reflection: GlassReflection,
    /// The glass reflects what its index of refraction says.
    is_plain: bool,
    coat_fresnel: LayerFresnel,
    clearcoat: Option<Clearcoat>,
    sheen: Option<crate::scene::Sheen>,
    iridescence: Option<Iridescence>,
    diffuse_transmission: Option<DiffuseTransmission>,
}

impl LayeredProgram {
    pub(super) fn new(pbr: &PbrMaterial, shading: ShadingModel) -> LayeredProgram {
        LayeredProgram {
            opaque: MetalRoughProgram::new(pbr, shading),
            facets: facets(pbr),
            diffuse_roughness: pbr.diffuse_roughness,
            transmission: transmits(pbr).then_some(pbr.transmission),
            ior: pbr.ior,
            walls: walls(pbr),
            refraction: refraction(pbr),
            tints_once: pbr.tints_once,
            reflection: pbr.glass_reflection,
            is_plain: is_plain(pbr),
            coat_fresnel: Coat::fresnel(shading.fresnel),
            clearcoat: pbr.clearcoat,
            sheen: pbr.sheen,
            iridescence: pbr.iridescence,
            diffuse_transmission: pbr.diffuse_transmission,
        }
    }
}

impl LayeredProgram {
    /// Is there a thin film?
    pub(super) fn has_film(&self) -> bool {
        self.iridescence.is_some()
    }

    /// Is it a thin wall that light passes without being blurred?
    pub(super) fn is_smooth_sheet(&self) -> bool {
        self.transmission.is_some() && self.walls == Walls::Thin && always(&self.facets.roughness, 0.0)
    }
}

impl MaterialProgram for LayeredProgram {
    type Lobe = Layered;

    fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> Layered {
        let energy_compensation = self.opaque.energy_compensation;
        let surface = self.facets.evaluate(slots, frame);
        let plain = self.opaque.evaluate(slots, frame);
        let base = plain.metal_f0;
        let mut opaque = plain.on(surface);
        let reflectance = match self.is_plain {
            true => GlassReflectance::colored(self.reflection),
            false => GlassReflectance::Between {
                color: self.reflection,
                f0: opaque.layer_f0,
                f90: opaque.layer_f90,
            },
        };
        let dielectric = 1.0 - opaque.metallic;
        let transmission = self.transmission.as_ref().map_or(0.0, |slot| slots.share(slot));
        let glass_share = dielectric * transmission;
        // Shares of what is not glass.
        let rest = 1.0 / (1.0 - glass_share).max(f32::MIN_POSITIVE);
        let diffuse = (dielectric * (1.0 - transmission) * rest).min(1.0);
        opaque.metallic = (opaque.metallic * rest).min(1.0);
        let (passing, color) = self
            .diffuse_transmission
            .as_ref()
            .map_or((0.0, Rgb::ZERO), |d| (slots.share(&d.factor), slots.share_by_channel(&d.color)));
        opaque.diffuse = base * (diffuse * (1.0 - passing));
        let tint = tint_of_crossing(base, self.tints_once);
        let (ior, walls, refraction) = (self.ior, self.walls, self.refraction);
        Layered {
            opaque,
            diffuse_roughness: slots.share(&self.diffuse_roughness),
            through: color * (diffuse * passing),
            glass: RoughDielectric {
                surface,
                ior,
                walls,
                refraction,
                tint,
                reflectance,
                energy_compensation,
            },
            glass_share,
            film: self.iridescence.as_ref().map_or(ThinFilm::NONE, |i| film(i, slots)),
            sheen: self.sheen.as_ref().map_or(Sheen::NONE, |s| Sheen {
                color: slots.share_by_channel(&s.color),
                roughness: slots.share(&s.roughness),
            }),
            coat: self.clearcoat.as_ref().map_or(Coat::NONE, |c| Coat {
                factor: slots.share(&c.factor),
                alpha: slots.alpha(&c.roughness),
                normal: frame.coat_normal,
                fresnel: self.coat_fresnel,
                energy_compensation,
            }),
        }
    }
}

fn film(iridescence: &Iridescence, slots: &impl Slots) -> ThinFilm {
    let Iridescence { factor, ior, thickness_min_nm, thickness_max_nm, thickness_texture } = *iridescence;
    let blend = slots.share(&FloatSlot { factor: 1.0, texture: thickness_texture });
    let thickness_nm = thickness_min_nm + (thickness_max_nm - thickness_min_nm) * blend;
    ThinFilm {
        factor: slots.share(&factor),
        ior: ior.max(1.0),
        thickness_nm: thickness_nm.max(0.0),
        wavelengths_nm: slots.wavelengths().map_or([0.0; 3], |waves| waves.nm),
    }
}
