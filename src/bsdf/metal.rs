//! Metals: microfacets with Schlick's Fresnel term, a constant reflectance, or the exact Fresnel term of a complex index of refraction.

use super::microsurface::{BeckmannFacets, Facets, Isotropic, Microsurface};
use super::{Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Slots, fresnel, ggx};
use crate::color::Rgb;
use crate::color::spectral::{Metal, Wavelengths};
use crate::math::Vec3;
use crate::scene::{ColorSlot, EnergyCompensation, FloatSlot};

/// A GGX metal with Schlick's Fresnel term; two-sided.
///
/// With [`EnergyCompensation::On`] the energy lost by single scattering is restored by a factor 1 + f0 (1 - E) / E, with E the directional
/// albedo for a reflectance of 1 (Turquin 2019, "Practical multiple scattering compensation for microfacet models", eq. 16). For
/// f0 = 1 energy is conserved up to the table's error of 0.04 %; the result is not reciprocal.
#[derive(Clone, Copy, Debug)]
pub struct SchlickMetal {
    /// Reflectance at normal incidence; 1 at grazing incidence.
    pub f0: Rgb,
    /// GGX alpha 0..1; below [`super::ggx::MIN_ALPHA`] an exact mirror.
    pub alpha: f32,
    /// Energy compensation of single scattering.
    pub energy_compensation: EnergyCompensation,
}

impl SchlickMetal {
    #[inline(always)]
    fn lobe(&self) -> FacetReflection<Isotropic, impl Fn(f32) -> Rgb> {
        let SchlickMetal { f0, alpha, energy_compensation } = *self;
        let reflectance = move |cosine| fresnel::schlick(f0, Rgb::ONE, cosine);
        FacetReflection { facets: Isotropic { alpha }, f0, reflectance, energy_compensation }
    }

    /// Whether it is an exact mirror.
    #[inline(always)]
    pub fn is_mirror(&self) -> bool {
        self.lobe().is_mirror()
    }
}

impl Lobe for SchlickMetal {
    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        self.lobe().sample(wo, u)
    }

    #[inline(always)]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        self.lobe().eval(wo, wi)
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        self.is_mirror()
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        SchlickMetal { f0: self.f0 * color, ..self }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.f0
    }

    fn appearance(&self) -> Appearance {
        Appearance { glossy: self.f0, roughness: Appearance::roughness([self.alpha; 2]), ..Appearance::BLACK }
    }
}

/// The parameters of a [`SchlickMetal`].
#[derive(Clone, Copy, Debug)]
pub struct SchlickMetalProgram {
    /// See [`SchlickMetal::f0`].
    pub color: ColorSlot,
    /// Perceptual roughness.
    pub roughness: FloatSlot,
    pub energy_compensation: EnergyCompensation,
}

impl MaterialProgram for SchlickMetalProgram {
    type Lobe = SchlickMetal;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> SchlickMetal {
        SchlickMetal {
            f0: slots.reflectance(&self.color),
            alpha: slots.alpha(&self.roughness),
            energy_compensation: self.energy_compensation,
        }
    }
}

/// Beckmann facets of constant reflectance; two-sided, without energy compensation.
#[derive(Clone, Copy, Debug)]
pub struct Beckmann {
    /// Reflectance of a facet.
    pub color: Rgb,
    /// Root mean square slope, 0..1; below [`super::ggx::MIN_ALPHA`] an exact mirror.
    pub alpha: f32,
}

impl Beckmann {
    #[inline(always)]
    fn lobe(&self) -> FacetReflection<BeckmannFacets, impl Fn(f32) -> Rgb> {
        let Beckmann { color, alpha } = *self;
        FacetReflection {
            facets: BeckmannFacets(Isotropic { alpha }),
            f0: color,
            reflectance: move |_| color,
            energy_compensation: EnergyCompensation::Off,
        }
    }
}

impl Lobe for Beckmann {
    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        self.lobe().sample(wo, u)
    }

    #[inline]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        self.lobe().eval(wo, wi)
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        self.lobe().is_mirror()
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        Beckmann { color: self.color * color, ..self }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.color
    }

    fn appearance(&self) -> Appearance {
        Appearance {
            glossy: self.color,
            roughness: Appearance::roughness([self.alpha; 2]),
            ..Appearance::BLACK
        }
    }
}

/// The parameters of [`Beckmann`].
#[derive(Clone, Copy, Debug)]
pub struct BeckmannProgram {
    pub color: ColorSlot,
    /// Perceptual roughness.
    pub roughness: FloatSlot,
}

impl MaterialProgram for BeckmannProgram {
    type Lobe = Beckmann;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Beckmann {
        Beckmann { color: slots.reflectance(&self.color), alpha: slots.alpha(&self.roughness) }
    }
}

/// A metal with the exact Fresnel term of a complex index of refraction; two-sided. Energy compensation as for [`super::SchlickMetal`],
/// with the reflectance at normal incidence as f0.
#[derive(Clone, Copy, Debug)]
pub struct Conductor {
    /// Real part of the index of refraction by channel.
    pub eta: Rgb,
    /// Extinction coefficient by channel.
    pub k: Rgb,
    /// GGX facets.
    pub surface: Microsurface,
    /// Energy compensation of single scattering.
    pub energy_compensation: EnergyCompensation,
}

impl Conductor {
    /// Fresnel reflectance at a cosine.
    #[inline]
    pub fn reflectance(&self, cosine: f32) -> Rgb {
        let (eta, k) = (self.eta.to_array(), self.k.to_array());
        Rgb::from_array([0, 1, 2].map(|c| fresnel::conductor(cosine, eta[c], k[c])))
    }

    /// The energy compensation factor.
    #[inline(always)]
    fn compensation(&self, above: Vec3) -> Rgb {
        match self.energy_compensation {
            EnergyCompensation::On => {
                self.surface.directional_albedo(above).compensation(self.reflectance(1.0))
            }
            EnergyCompensation::Off => Rgb::ONE,
        }
    }
}

impl Lobe for Conductor {
    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let above = ggx::to_upper_side(wo);
        if self.surface.is_mirror() {
            return BsdfSample::mirror(wo, self.reflectance(above.z), 1.0);
        }
        let normal = self.surface.sample_visible_normal(above, [u[0], u[1]]);
        let wi = normal * (2.0 * above.dot(normal)) - above;
        let outward = Vec3::new(wi.x, wi.y, wi.z.copysign(wo.z));
        let value = self.eval(wo, outward);
        if wi.z <= 0.0 || value.pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        BsdfSample {
            wi: outward,
            weight: value.f_cos / value.pdf_solid_angle,
            pdf_solid_angle: value.pdf_solid_angle,
            ..BsdfSample::ABSORBED
        }
    }

    #[inline]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if self.surface.is_mirror() || (wo.z < 0.0) != (wi.z < 0.0) || wi.z == 0.0 {
            return BsdfEval::ZERO;
        }
        let above = ggx::to_upper_side(wo);
        let r = self.surface.reflection(above, Vec3::new(wi.x, wi.y, wi.z.abs()));
        let factor = self.reflectance(r.cos_half.min(1.0)) * self.compensation(above);
        BsdfEval { f_cos: factor * r.f_cos, pdf_solid_angle: r.pdf_solid_angle }
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        self.surface.is_mirror()
    }

    #[inline(always)]
    fn tinted(self, _color: Rgb) -> Self {
        // Vertex colours don't apply to measured metals.
        self
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.reflectance(1.0)
    }

    fn appearance(&self) -> Appearance {
        Appearance {
            glossy: self.albedo(),
            roughness: Appearance::roughness(self.surface.alpha()),
            ..Appearance::BLACK
        }
    }
}

/// The parameters of a [`Conductor`].
#[derive(Clone, Copy, Debug)]
pub struct ConductorProgram {
    pub eta: Rgb,
    pub k: Rgb,
    /// The metal, if its index of refraction is tabulated by wavelength.
    pub metal: Option<Metal>,
    /// Perceptual roughness.
    pub roughness: FloatSlot,
    pub energy_compensation: EnergyCompensation,
}

/// Interpolates an index given by channel to other wavelengths: linear between the dominant wavelengths of the Rec. 709 primaries
/// (464.2, 549.1 and 611.4 nm), constant beyond.
fn interpolate_channels(index: Rgb, waves: &Wavelengths) -> Rgb {
    let mix = |from: f32, to: f32, t: f32| from + (to - from) * t.clamp(0.0, 1.0);
    waves.map(|nm| match nm {
        nm if nm < 549.1 => mix(index.b, index.g, (nm - 464.2) / (549.1 - 464.2)),
        nm => mix(index.g, index.r, (nm - 549.1) / (611.4 - 549.1)),
    })
}

impl MaterialProgram for ConductorProgram {
    type Lobe = Conductor;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Conductor {
        let [eta, k] = match (slots.wavelengths(), self.metal) {
            (None, _) => [self.eta, self.k],
            (Some(waves), Some(metal)) => metal.index(waves),
            (Some(waves), None) => [self.eta, self.k].map(|index| interpolate_channels(index, waves)),
        };
        Conductor {
            eta,
            k,
            surface: Microsurface::isotropic(slots.alpha(&self.roughness)),
            energy_compensation: self.energy_compensation,
        }
    }

    fn depends_on_wavelength(&self) -> bool {
        true
    }
}

/// Reflection by microfacets with any Fresnel term; two-sided. The lobe of [`SchlickMetal`], [`Beckmann`] and the clearcoat.
pub(super) struct FacetReflection<F: Facets, R: Fn(f32) -> Rgb> {
    /// Microfacet distribution.
    pub facets: F,
    /// Reflectance at normal incidence, for energy compensation (Turquin 2019, eq. 16).
    pub f0: Rgb,
    /// Fresnel reflectance as a function of the cosine at the facet.
    pub reflectance: R,
    /// Energy compensation of single scattering.
    pub energy_compensation: EnergyCompensation,
}

impl<F: Facets, R: Fn(f32) -> Rgb> FacetReflection<F, R> {
    /// Whether it is an exact mirror.
    #[inline(always)]
    pub fn is_mirror(&self) -> bool {
        self.facets.is_mirror()
    }

    /// The energy compensation factor.
    #[inline(always)]
    fn compensation(&self, above: Vec3) -> Rgb {
        match self.energy_compensation {
            EnergyCompensation::On => self.facets.directional_albedo(above).compensation(self.f0),
            EnergyCompensation::Off => Rgb::ONE,
        }
    }

    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let above = ggx::to_upper_side(wo);
        if self.is_mirror() {
            return BsdfSample::mirror(wo, (self.reflectance)(above.z), 1.0);
        }
        let normal = self.facets.sample_visible_normal(above, [u[0], u[1]]);
        let wi = normal * (2.0 * above.dot(normal)) - above;
        let lost = wi.z <= 0.0;
        let r = self.facets.reflection(above, wi);
        let factor = (self.reflectance)(r.cos_half) * self.compensation(above);
        let weight = factor * (r.f_cos / r.pdf_solid_angle.max(f32::MIN_POSITIVE));
        BsdfSample {
            wi: Vec3::new(wi.x, wi.y, wi.z.copysign(wo.z)),
            weight: if lost { Rgb::ZERO } else { weight },
            pdf_solid_angle: if lost { 0.0 } else { r.pdf_solid_angle },
            ..BsdfSample::ABSORBED
        }
    }

    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if self.is_mirror() || (wo.z < 0.0) != (wi.z < 0.0) || wi.z == 0.0 {
            return BsdfEval::ZERO;
        }
        let above = ggx::to_upper_side(wo);
        let r = self.facets.reflection(above, Vec3::new(wi.x, wi.y, wi.z.abs()));
        let factor = (self.reflectance)(r.cos_half) * self.compensation(above);
        BsdfEval { f_cos: factor * r.f_cos, pdf_solid_angle: r.pdf_solid_angle }
    }
}
