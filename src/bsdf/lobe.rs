//! The interface of BSDFs: [`Lobe`] scatters at a point, [`MaterialProgram`] evaluates its parameters at a hit.

use super::fresnel::f0_from_eta;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::math::{Vec2, Vec3};
use crate::scene::{ColorSlot, FloatSlot};

/// One BSDF with its parameters at a point. Directions as in [`super::Bsdf`]; their z is never -0.
pub trait Lobe: Copy {
    /// Samples a direction by three numbers in 0..1: `u[2]` chooses among component lobes, `u[0]` and `u[1]` the direction.
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample;

    /// Value and density of a pair of directions; specular components count as zero.
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval;

    /// Are all samples specular, so that light sampling contributes nothing?
    #[inline(always)]
    fn is_specular(&self) -> bool {
        false
    }

    /// Is all of it a diffuse base, which bends with a surface's bumps and which layers leave out of the light from behind?
    fn is_base(&self) -> bool {
        false
    }

    /// With its base colour multiplied (by the colour of vertices).
    fn tinted(self, color: Rgb) -> Self;

    /// A plain colour for the albedo output: reflectance at normal incidence, white for clear glass.
    fn albedo(&self) -> Rgb;

    /// Colours and roughness for the AOVs of compositing.
    fn appearance(&self) -> Appearance;

    /// The diffuse part of [`Lobe::eval`] for these directions, for the AOVs of direct and indirect diffuse light. Sheen and
    /// diffuse transmission count as diffuse, as in Cycles.
    fn diffuse_part(&self, _wo: Vec3, _wi: Vec3) -> Rgb {
        Rgb::ZERO
    }
}

/// Colours and roughness of a surface, independent of the light: for AOVs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// Diffuse colour.
    pub diffuse: Rgb,
    /// Reflectance of the microfacets at normal incidence.
    pub glossy: Rgb,
    /// Colour of transmitted light.
    pub transmission: Rgb,
    /// Perceptual roughness: the square root of the GGX alpha (of the geometric mean of two); 1 without microfacets.
    pub roughness: f32,
}

impl Appearance {
    /// The appearance of a surface that scatters nothing.
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

    /// The perceptual roughness of two GGX alphas.
    pub(super) fn roughness([a, b]: [f32; 2]) -> f32 {
        (a * b).sqrt().sqrt()
    }
}

/// A [`Lobe`] that may transmit.
pub trait Transmissive: Lobe {
    /// Does it have a non-specular transmission component?
    const SCATTERS_THROUGH: bool;

    /// May it refract?
    const REFRACTS: bool;

    /// May its sides be exchanged, so that glass of a lower index than its surroundings becomes glass of the inverse index seen from
    /// inside? False for BSDFs with layers on the outside.
    const TURNS_OVER: bool;

    /// With another index of refraction: that of one wavelength of a dispersive material, or relative to another medium.
    fn with_ior(self, ior: f32) -> Self;

    /// Factor on the light that crosses the surface, whatever is reflected.
    fn crossing_tint(&self) -> Rgb;

    /// Transmittance straight on (a delta component along `-wo`); zero if light is refracted or scattered.
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
    /// Density per solid angle; for specular samples the probability of having chosen this direction.
    pub pdf_solid_angle: f32,
    /// Index of refraction on the side of `wi` over that on the side of `wo`, by whose square the weight is divided; 1 unless
    /// refracted, and where radiance keeps its value.
    pub eta: f32,
    /// Factor on the weight for light tracing (importance instead of radiance; Veach 1997, section 5.2).
    pub flux: f32,
    /// From a delta component, which [`super::Bsdf::eval`] leaves out.
    pub is_specular: bool,
    /// To the other side of the surface.
    pub is_transmission: bool,
}

/// Scaling of radiance by refraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refraction {
    /// Radiance is divided by the square of the index of the side where the light comes from over that of the viewer's.
    Scales,
    /// Nothing, as in Cycles: it is flux then that changes, by the square of the index of the side where it comes from over that
    /// of the side where it goes.
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
    /// At an index of refraction on the side of the light over that on the viewer's side.
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
    /// The path is absorbed.
    pub const ABSORBED: BsdfSample = BsdfSample {
        wi: Vec3::Z,
        weight: Rgb::ZERO,
        pdf_solid_angle: 0.0,
        eta: 1.0,
        flux: 1.0,
        is_specular: false,
        is_transmission: false,
    };

    /// A sampled reflected direction, weighted by value over density; the path ends where that is 0.
    #[inline(always)]
    pub(super) fn reflected(wi: Vec3, eval: BsdfEval) -> BsdfSample {
        let BsdfEval { f_cos, pdf_solid_angle } = eval;
        if pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        BsdfSample { wi, weight: f_cos / pdf_solid_angle, pdf_solid_angle, ..BsdfSample::ABSORBED }
    }

    /// The mirror image of `wo`, chosen with a probability.
    #[inline(always)]
    pub(super) fn mirror(wo: Vec3, weight: Rgb, probability: f32) -> BsdfSample {
        BsdfSample {
            wi: Vec3::new(-wo.x, -wo.y, wo.z),
            weight,
            pdf_solid_angle: probability,
            eta: 1.0,
            flux: 1.0,
            is_specular: true,
            is_transmission: false,
        }
    }
}

/// The value of a BSDF for two directions.
#[derive(Clone, Copy, Debug)]
pub struct BsdfEval {
    /// f times |cos| of `wi`; without specular lobes.
    pub f_cos: Rgb,
    /// Density per solid angle with which sampling finds `wi`.
    pub pdf_solid_angle: f32,
}

impl BsdfEval {
    /// No light that way.
    pub const ZERO: BsdfEval = BsdfEval { f_cos: Rgb::ZERO, pdf_solid_angle: 0.0 };
}

/// Albedos below this count as black: a guard against division by zero.
pub(super) const MIN_ALBEDO: f32 = 1e-30;

/// With a z of -0 turned to 0, so that its sign says the same as a comparison.
#[inline(always)]
pub(super) fn with_side(v: Vec3) -> Vec3 {
    Vec3::new(v.x, v.y, v.z + 0.0)
}

/// The parameters of one BSDF: constants, and textures with factors.
pub trait MaterialProgram {
    /// The BSDF.
    type Lobe: Lobe;

    /// The BSDF where the slots have these values.
    fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> Self::Lobe;

    /// May light pass [straight on](super::Bsdf::straight)? Not asked of textures: false where only a texture makes a thin sheet smooth.
    fn may_pass_straight(&self) -> bool {
        false
    }

    /// Is it smooth glass, whatever its textures hold?
    fn is_smooth_glass(&self) -> bool {
        false
    }

    /// Does the BSDF depend on the wavelength other than by its colours?
    fn depends_on_wavelength(&self) -> bool {
        false
    }
}

/// Where the values of a material's slots come from at a hit.
pub trait Slots {
    /// A colour.
    fn color(&self, slot: &ColorSlot) -> Rgb;
    /// A number.
    fn number(&self, slot: &FloatSlot) -> f32;

    /// The wavelengths of the three channels in spectral rendering; `None` for red, green and blue.
    #[inline(always)]
    fn wavelengths(&self) -> Option<&Wavelengths> {
        None
    }

    /// A colour within 0..1.
    #[inline(always)]
    fn share_by_channel(&self, slot: &ColorSlot) -> Rgb {
        self.color(slot).clamp(Rgb::ZERO, Rgb::ONE)
    }

    /// A number within 0..1.
    #[inline(always)]
    fn share(&self, slot: &FloatSlot) -> f32 {
        self.number(slot).clamp(0.0, 1.0)
    }

    /// The GGX alpha of a perceptual roughness: its square.
    #[inline(always)]
    fn alpha(&self, slot: &FloatSlot) -> f32 {
        let roughness = self.share(slot);
        roughness * roughness
    }
}

/// The constant factors alone, as if every texture were white.
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

/// Directions at a hit that some materials depend on, in the frame whose z is the shading normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalFrame {
    /// Where texture coordinate u grows, in the tangent plane.
    pub tangent: Vec2,
    /// The bitangent of normal maps, in the tangent plane.
    pub bitangent: Vec2,
    /// Normal of the clearcoat.
    pub coat_normal: Vec3,
}

impl LocalFrame {
    /// Tangents along x and y, the coat's normal the surface's.
    pub const STRAIGHT: LocalFrame =
        LocalFrame { tangent: Vec2::X, bitangent: Vec2::Y, coat_normal: Vec3::Z };
}

/// Is the slot this number whatever its texture says? A factor of 0 needs no texture.
pub(super) fn always(slot: &FloatSlot, value: f32) -> bool {
    slot.factor == value && (slot.texture.is_none() || value == 0.0)
}
