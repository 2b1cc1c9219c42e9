//! Smooth glass, solid and thin-walled.

use super::{
    Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Refraction, Slots, Transmissive,
    fresnel,
};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::{ColorSlot, FloatSlot, FresnelModel, PbrMaterial};

/// The interface of a smooth solid dielectric; z > 0 is the outside.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Relative index of refraction: inside over outside.
    pub ior: f32,
    /// Scaling of radiance by refraction.
    pub refraction: Refraction,
    /// Transmission tint, applied at each crossing.
    pub tint: Rgb,
    /// Fresnel term.
    pub fresnel: FresnelModel,
    /// Distribution of rough variants: Beckmann instead of GGX.
    pub is_beckmann: bool,
}

/// Reflection and refraction at a smooth interface, without the scaling of radiance by refraction.
#[derive(Clone, Copy, Debug)]
pub struct SmoothInterface {
    /// Reflectance.
    pub reflected: Rgb,
    /// Transmittance.
    pub transmitted: Rgb,
    /// Cosine of the refracted direction; 0 for total reflection.
    pub cos_transmitted: f32,
}

impl Dielectric {
    /// Reflection and refraction for an incident cosine in 0..1, from inside or from outside.
    pub(super) fn interface(&self, cos_o: f32, is_inside: bool) -> SmoothInterface {
        let eta = if is_inside { 1.0 / self.ior } else { self.ior };
        let fresnel::Interface { reflectance, cos_transmitted } = match self.fresnel {
            FresnelModel::Exact => fresnel::exact(cos_o, eta),
            FresnelModel::Schlick => fresnel::schlick_dielectric(cos_o, eta),
        };
        let transmitted = self.tint * (1.0 - reflectance);
        SmoothInterface { reflected: Rgb::splat(reflectance), transmitted, cos_transmitted }
    }
}

impl Lobe for Dielectric {
    /// Reflects with a probability equal to the reflectance, else refracts.
    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let eta = if wo.z < 0.0 { 1.0 / self.ior } else { self.ior };
        let cos_o = wo.z.abs().min(1.0);
        let side = match self.fresnel {
            FresnelModel::Exact => fresnel::exact(cos_o, eta),
            FresnelModel::Schlick => fresnel::schlick_dielectric(cos_o, eta),
        };
        if u[2] < side.reflectance {
            return BsdfSample::mirror(wo, Rgb::ONE, side.reflectance);
        }
        let inverse = 1.0 / eta;
        let refracted = self.refraction.at(eta);
        let wi = Vec3::new(-wo.x * inverse, -wo.y * inverse, (-side.cos_transmitted).copysign(-wo.z));
        BsdfSample {
            wi: wi.normalize(),
            weight: self.tint * refracted.weight,
            pdf_solid_angle: 1.0 - side.reflectance,
            eta: refracted.eta,
            flux: refracted.flux,
            is_specular: true,
            is_transmission: true,
        }
    }

    #[inline(always)]
    fn eval(&self, _wo: Vec3, _wi: Vec3) -> BsdfEval {
        BsdfEval::ZERO
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        true
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        Dielectric { tint: self.tint * color, ..self }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.tint
    }

    fn appearance(&self) -> Appearance {
        Appearance::of_glass(self.ior, self.tint, 0.0)
    }
}

/// Smooth thin-walled glass: transmits without refraction; interreflections between both faces are summed in closed form.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Index of refraction.
    pub ior: f32,
    /// Transmission tint.
    pub tint: Rgb,
}

impl ThinDielectric {
    /// Reflectance of both faces: R + T^2 R / (1 - R^2) = 2 R / (1 + R) (Pharr, Jakob, Humphreys 2023, section 9.5).
    #[inline(always)]
    pub fn reflectance(&self, cos_o: f32) -> f32 {
        let r = fresnel::exact(cos_o.abs().min(1.0), self.ior).reflectance;
        2.0 * r / (1.0 + r)
    }
}

impl Lobe for ThinDielectric {
    #[inline(always)]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let reflectance = self.reflectance(wo.z);
        if u[2] < reflectance {
            return BsdfSample::mirror(wo, Rgb::ONE, reflectance);
        }
        BsdfSample {
            wi: -wo,
            weight: self.tint,
            pdf_solid_angle: 1.0 - reflectance,
            is_specular: true,
            is_transmission: true,
            ..BsdfSample::ABSORBED
        }
    }

    #[inline(always)]
    fn eval(&self, _wo: Vec3, _wi: Vec3) -> BsdfEval {
        BsdfEval::ZERO
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        true
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        ThinDielectric { tint: self.tint * color, ..self }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.tint
    }

    fn appearance(&self) -> Appearance {
        Appearance::of_glass(self.ior, self.tint, 0.0)
    }
}

impl Transmissive for Dielectric {
    const HAS_SCATTERED_TRANSMISSION: bool = false;
    const REFRACTS: bool = true;
    const SIDES_MAY_SWAP: bool = true;

    #[inline(always)]
    fn with_ior(self, ior: f32) -> Self {
        Dielectric { ior, ..self }
    }

    #[inline(always)]
    fn transmission_tint(&self) -> Rgb {
        self.tint
    }
}

impl Transmissive for ThinDielectric {
    const HAS_SCATTERED_TRANSMISSION: bool = false;
    const REFRACTS: bool = false;
    const SIDES_MAY_SWAP: bool = true;

    #[inline(always)]
    fn with_ior(self, _ior: f32) -> Self {
        // Thin walls have no dispersion.
        self
    }

    #[inline(always)]
    fn transmission_tint(&self) -> Rgb {
        self.tint
    }

    #[inline(always)]
    fn straight(&self, wo: Vec3) -> Rgb {
        self.tint * (1.0 - self.reflectance(wo.z))
    }
}

/// The parameters of a [`Dielectric`].
#[derive(Clone, Copy, Debug)]
pub struct DielectricProgram {
    pub ior: f32,
    /// That index where it varies over the surface.
    pub varying_ior: Option<FloatSlot>,
    pub refraction: Refraction,
    pub tint: ColorSlot,
    /// Whether `tint` is the total of two crossings (entry and exit); see `tint_of_crossing`.
    pub tints_once: bool,
    pub fresnel: FresnelModel,
    pub is_beckmann: bool,
}

impl DielectricProgram {
    /// A solid GGX dielectric with the tint applied at each crossing.
    pub(super) fn new(ior: f32, tint: ColorSlot, fresnel: FresnelModel) -> DielectricProgram {
        let refraction = Refraction::Scales;
        let (tints_once, is_beckmann) = (false, false);
        DielectricProgram { ior, varying_ior: None, refraction, tint, tints_once, fresnel, is_beckmann }
    }
}

impl MaterialProgram for DielectricProgram {
    type Lobe = Dielectric;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> Dielectric {
        let tint = tint_of_crossing(slots.clamped_color(&self.tint), self.tints_once);
        let ior = ior_at(self.ior, self.varying_ior.as_ref(), slots);
        let (refraction, fresnel, is_beckmann) = (self.refraction, self.fresnel, self.is_beckmann);
        Dielectric { ior, refraction, tint, fresnel, is_beckmann }
    }

    fn is_smooth_glass(&self) -> bool {
        true
    }
}

/// The index of refraction at a point.
#[inline(always)]
pub(super) fn ior_at(ior: f32, varying: Option<&FloatSlot>, slots: &impl Slots) -> f32 {
    varying.map_or(ior, |slot| slots.number(slot).max(PbrMaterial::MIN_GLASS_IOR))
}

/// The parameters of a [`ThinDielectric`].
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectricProgram {
    pub ior: f32,
    pub tint: ColorSlot,
}

impl MaterialProgram for ThinDielectricProgram {
    type Lobe = ThinDielectric;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, _frame: &LocalFrame) -> ThinDielectric {
        ThinDielectric { ior: self.ior, tint: slots.clamped_color(&self.tint) }
    }

    fn may_transmit_unscattered(&self) -> bool {
        true
    }

    fn is_smooth_glass(&self) -> bool {
        true
    }
}

/// The transmission tint of one crossing of a surface.
///
/// KHR_materials_transmission multiplies transmitted light by the base colour at each crossing, so a closed solid has its square; with
/// `tints_once` the colour is for the whole solid and each crossing has its square root. Absorption within the volume is up to the
/// integrator.
#[inline(always)]
pub(super) fn tint_of_crossing(color: Rgb, tints_once: bool) -> Rgb {
    if tints_once { color.map(f32::sqrt) } else { color }
}
