//! The traits of BSDFs: [`Lobe`] is a BSDF at a hit, [`MaterialProgram`] evaluates its parameters there.

use super::fresnel::f0_from_eta;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::math::{Vec2, Vec3};
use crate::scene::{ColorSlot, FloatSlot};

/// A BSDF with its parameters at a hit. Directions as in [`super::Bsdf`]; their z is never -0.
pub trait Lobe: Copy {
    /// Samples a direction by three random numbers in 0..1: `u[2]` selects the component lobe, `u[0]` and `u[1]` the direction.
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample;

    /// Value and pdf of a pair of directions; specular components count as zero.
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval;

    /// Whether all samples are specular, so that light sampling contributes nothing.
    #[inline(always)]
    fn is_specular(&self) -> bool {
        false
    }

    /// Whether the BSDF is diffuse reflection alone: a base without layers ([`super::Bsdf::split_layers`]).
    fn is_diffuse_base(&self) -> bool {
        false
    }

    /// Multiplies the base colour (by vertex colours).
    fn tinted(self, color: Rgb) -> Self;

    /// Albedo for the denoiser's AOV: about the reflectance at normal incidence, white for clear glass.
    fn albedo(&self) -> Rgb;

    /// Colours and roughness for compositing AOVs.
    fn appearance(&self) -> Appearance;

    /// The diffuse part of [`Lobe::eval`], for the AOVs of direct and indirect diffuse light. Sheen and diffuse transmission count as
    /// diffuse, as in Cycles.
    fn diffuse_part(&self, _wo: Vec3, _wi: Vec3) -> Rgb {
        Rgb::ZERO
    }
}

/// Colours and roughness of a surface for AOVs, independent of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// Diffuse colour.
    pub diffuse: Rgb,
    /// Reflectance of the microfacets at normal incidence.
    pub glossy: Rgb,
    /// Colour of transmitted light.
    pub transmission: Rgb,
    /// Perceptual roughness: square root of the GGX alpha (if anisotropic of the geometric mean of both); 1 without microfacets.
    pub roughness: f32,
}

impl Appearance {
    /// The appearance of a black surface.
    pub const BLACK: Appearance =
        Appearance { diffuse: Rgb::ZERO, glossy: Rgb::ZERO, transmission: Rgb::ZERO, roughness: 1.0 };

    pub(super) fn of_glass(ior: f32, tint: Rgb, roughness: f32) -> Appearance {
        Appearance {
            glossy: Rgb::splat(f0_from_eta(ior)),
            transmission: tint,
            roughness,
            ..Appearance::BLACK
        }
    }

    /// Perceptual roughness from two GGX alphas.
    pub(super) fn roughness([a, b]: [f32; 2]) -> f32 {
        (a * b).sqrt().sqrt()
    }
}

/// A [`Lobe`] that may transmit.
pub trait Transmissive: Lobe {
    /// Whether there may be a non-specular transmission lobe.
    const HAS_SCATTERED_TRANSMISSION: bool;

    /// Whether there may be refraction.
    const REFRACTS: bool;

    /// Whether inside and outside may be swapped: glass of a relative index below 1 is replaced by glass of the inverse index seen from
    /// the inside. False for BSDFs with layers on the outside.
    const SIDES_MAY_SWAP: bool;

    /// Replaces the index of refraction, by that of one wavelength of a dispersive material or relative to another medium.
    fn with_ior(self, ior: f32) -> Self;

    /// Transmission tint, without the Fresnel term.
    fn transmission_tint(&self) -> Rgb;

    /// Transmittance of the delta component along `-wo`; zero if light is refracted or scattered.
    #[inline(always)]
    fn straight(&self, _wo: Vec3) -> Rgb {
        Rgb::ZERO
    }
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub struct BsdfSample {
    /// Direction of incident light, unit length.
    pub wi: Vec3,
    /// f |cos| / pdf; zero if the path is absorbed.
    pub weight: Rgb,
    /// Solid-angle pdf; for specular samples the discrete probability of the direction.
    pub pdf_solid_angle: f32,
    /// Index of refraction on the side of `wi` over that on the side of `wo`; the weight is divided by its square. 1 unless refracted,
    /// and with [`Refraction::KeepsRadiance`].
    pub eta: f32,
    /// Factor from the weight of camera paths to that of light paths: refraction is not symmetric (Veach 1997, section 5.2).
    pub flux: f32,
    /// Whether the sample is from a delta component, which [`super::Bsdf::eval`] excludes.
    pub is_specular: bool,
    /// Whether `wi` is on the other side of the surface.
    pub is_transmission: bool,
}

/// Scaling of radiance by refraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refraction {
    /// Physical: radiance along `wo` is divided by the squared relative index (side of `wi` over side of `wo`).
    Scales,
    /// No scaling of radiance, as in Cycles; instead the flux of light paths is scaled by a squared relative index.
    KeepsRadiance,
}

/// Factors of a refraction.
#[derive(Clone, Copy, Debug)]
pub struct Refracted {
    /// Factor on radiance.
    pub weight: f32,
    /// See [`BsdfSample::eta`].
    pub eta: f32,
    /// See [`BsdfSample::flux`].
    pub flux: f32,
}

impl Refraction {
    /// Factors for a relative index of refraction `eta`: side of `wi` over side of `wo`.
    #[inline(always)]
    pub fn at(self, eta: f32) -> Refracted {
        let inverse = 1.0 / eta;
        match self {
            Refraction::Scales => Refracted { weight: inverse * inverse, eta, flux: eta * eta },
            Refraction::KeepsRadiance => Refracted { weight: 1.0, eta: 1.0, flux: inverse * inverse },
        }
    }
}

impl BsdfSample {
    /// Sample of an absorbed path.
    pub const ABSORBED: BsdfSample = BsdfSample {
        wi: Vec3::Z,
        weight: Rgb::ZERO,
        pdf_solid_angle: 0.0,
        eta: 1.0,
        flux: 1.0,
        is_specular: false,
        is_transmission: false,
    };

    /// Sample of a reflected direction with weight value / pdf; absorbed if the pdf is 0.
    #[inline(always)]
    pub(super) fn reflected(wi: Vec3, eval: BsdfEval) -> BsdfSample {
        let BsdfEval { f_cos, pdf_solid_angle } = eval;
        if pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        BsdfSample { wi, weight: f_cos / pdf_solid_angle, pdf_solid_angle, ..BsdfSample::ABSORBED }
    }

    /// Sample of the mirror direction of `wo`, selected with a probability.
    #[inline(always)]
    pub(super) fn mirror(wo: Vec3, weight: Rgb, probability: f32) -> BsdfSample {
        BsdfSample {
            wi: Vec3::new(-wo.x, -wo.y, wo.z),
            weight,
            pdf_solid_angle: probability,
            is_specular: true,
            ..BsdfSample::ABSORBED
        }
    }
}

/// The value of a BSDF for a pair of directions, without specular lobes.
#[derive(Clone, Copy, Debug)]
pub struct BsdfEval {
    /// f times |cos| of `wi`.
    pub f_cos: Rgb,
    /// Solid-angle pdf of sampling `wi`.
    pub pdf_solid_angle: f32,
}

impl BsdfEval {
    /// Zero value and pdf.
    pub const ZERO: BsdfEval = BsdfEval { f_cos: Rgb::ZERO, pdf_solid_angle: 0.0 };
}

/// Albedo below which a BSDF counts as black, to avoid division by zero.
pub(super) const MIN_ALBEDO: f32 = 1e-30;

/// Replaces a z of -0 by 0, so that its sign bit agrees with the comparison `z < 0`.
#[inline(always)]
pub(super) fn without_negative_zero(v: Vec3) -> Vec3 {
    Vec3::new(v.x, v.y, v.z + 0.0)
}

/// The parameters of a BSDF before texture look-ups: constants, and textures with factors.
pub trait MaterialProgram {
    /// Type of the BSDF.
    type Lobe: Lobe;

    /// Evaluates the parameters at a hit.
    fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> Self::Lobe;

    /// Whether there may be [straight transmission](super::Bsdf::straight), decided without textures: false if only a texture makes
    /// thin glass smooth.
    fn may_transmit_unscattered(&self) -> bool {
        false
    }

    /// Whether it is smooth glass for all values of the textures.
    fn is_smooth_glass(&self) -> bool {
        false
    }

    /// Whether the BSDF depends on the wavelength other than by its colours.
    fn depends_on_wavelength(&self) -> bool {
        false
    }
}

/// Upper bound of reflectances.
const MAX_REFLECTANCE: f32 = 100.0;

/// Evaluates the slots (factor times texture) of a material at a hit.
pub trait Slots {
    /// Value of a colour slot, unclamped.
    fn color(&self, slot: &ColorSlot) -> Rgb;
    /// Value of a number slot, unclamped.
    fn number(&self, slot: &FloatSlot) -> f32;

    /// The wavelengths of the three channels in spectral rendering; `None` for red, green and blue.
    #[inline(always)]
    fn wavelengths(&self) -> Option<&Wavelengths> {
        None
    }

    /// A reflectance. Textures may exceed 1, as in Cycles, up to a bound that keeps paths finite.
    #[inline(always)]
    fn reflectance(&self, slot: &ColorSlot) -> Rgb {
        self.color(slot).clamp(Rgb::ZERO, Rgb::splat(MAX_REFLECTANCE))
    }

    /// A colour clamped to 0..1.
    #[inline(always)]
    fn clamped_color(&self, slot: &ColorSlot) -> Rgb {
        self.color(slot).clamp(Rgb::ZERO, Rgb::ONE)
    }

    /// A number clamped to 0..1.
    #[inline(always)]
    fn clamped_number(&self, slot: &FloatSlot) -> f32 {
        self.number(slot).clamp(0.0, 1.0)
    }

    /// The GGX alpha of a perceptual roughness: the square of its value clamped to 0..1.
    #[inline(always)]
    fn alpha(&self, slot: &FloatSlot) -> f32 {
        let roughness = self.clamped_number(slot);
        roughness * roughness
    }
}

/// [`Slots`] without textures: the constant factors.
#[derive(Clone, Copy, Debug)]
pub struct Factors;

impl Slots for Factors {
    #[inline(always)]
    fn color(&self, slot: &ColorSlot) -> Rgb {
        Rgb::from_array(slot.factor)
    }

    #[inline(always)]
    fn number(&self, slot: &FloatSlot) -> f32 {
        slot.factor
    }
}

/// Directions at a hit that some materials need, in the frame with the shading normal as z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalFrame {
    /// Direction of increasing texture coordinate u, in the tangent plane.
    pub tangent: Vec2,
    /// The bitangent of normal maps, in the tangent plane.
    pub bitangent: Vec2,
    /// Normal of the clearcoat.
    pub coat_normal: Vec3,
}

impl LocalFrame {
    /// Tangents along x and y, and the coat normal equal to the shading normal.
    pub const DEFAULT: LocalFrame = LocalFrame { tangent: Vec2::X, bitangent: Vec2::Y, coat_normal: Vec3::Z };
}

/// Whether a slot has this value for all values of its texture. (With a factor of 0 the texture doesn't matter.)
pub(super) fn is_always(slot: &FloatSlot, value: f32) -> bool {
    slot.factor == value && (slot.texture.is_none() || value == 0.0)
}
