//! Glass of any roughness, solid or thin-walled.

use super::dielectric::{SmoothInterface, ior_at, tint_of_crossing};
use super::microsurface::{Facets, Microsurface, MicrosurfaceProgram, beckmann_lambda, beckmann_over_ggx};
use super::{
    Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Refraction, Slots, Transmissive,
    fresnel, ggx,
};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::{ColorSlot, EnergyCompensation, FloatSlot, GlassReflection, SkippedCaustics};

/// Alpha times |ior - 1| below which solid glass counts as smooth: single precision can't resolve the refraction lobe.
const MIN_SPREAD: f32 = 1e-4;

/// Geometry behind the surface: solid or thin-walled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Walls {
    /// A solid: light is refracted.
    Solid,
    /// Thin-walled: transmitted light is scattered by the microfacets, without refraction.
    Thin,
}

/// Reflectance of a glass interface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GlassReflectance {
    /// Fresnel's equations.
    Plain,
    /// Fresnel's equations with a colour on the reflection.
    Colored(GlassReflection),
    /// KHR_materials_specular: Fresnel's equations remapped to `f0` at normal and `f90` at grazing incidence. Total internal reflection
    /// stays 1.
    Remapped {
        /// Colour of the reflection.
        color: GlassReflection,
        /// Reflectance at normal incidence.
        f0: Rgb,
        /// Reflectance at grazing incidence.
        f90: f32,
    },
}

/// Glass with GGX facets (Walter, Marschner, Li, Torrance 2007, eq. 20 and 21), sampled by visible normals (Dupuy, Benyoub 2023).
/// z > 0 is the outside.
///
/// A facet splits light between reflection and refraction. Both are shadowed by other facets: reflection by the height-correlated
/// Smith term as for metals, refraction by the separable one, which is closer to the exact beta function of Heitz et al. 2016,
/// "Multiple-Scattering Microfacet BSDFs with the Smith Model", eq. 20. With [`EnergyCompensation::Off`] shadowed light is lost.
///
/// With [`EnergyCompensation::On`] shadowed light of solid glass is redirected as in random walks among facets (the model of that
/// paper), where most of it ends in the denser medium, trapped by total internal reflection. Of the light shadowed in the rarer
/// medium, a fraction stays in that medium; the rest is added to the lobe in the denser medium, tinted by one more crossing. Of the
/// light from inside the glass that a facet reflects below the horizon, a fraction is transmitted; the rest is reflected back
/// inside. Redirected light is lifted away from the horizon, where it would be shadowed again. White glass conserves energy exactly
/// for all view directions, alphas, indices and reflectances; value and pdf are closed forms without tables, and all samples have
/// weight 1. As with other compensation reciprocity is lost: under uniform illumination the outgoing radiance is 0.5 to 1.9 times
/// the incident (alphas of 0.1 to 1, indices of 1.33 to 2; extremes at grazing angles inside the glass).
///
/// Compared with random walks for alphas of 0.1 to 1 and indices of 1.05 to 2.4, the reflected fraction is wrong by 0.013 on
/// average and up to 0.22 at grazing angles inside glass of an index near 1, and 3 % of the light through a ball has a wrong
/// direction. Division by the single-scattering albedo (Turquin 2019, section 4) has errors of 0.05 and 11 %, but is closer at
/// grazing angles inside.
///
/// Thin-walled glass is compensated by division by the directional albedo. Reflection colours (as of Cycles' Glass BSDF) multiply
/// the reflected light alone: that of a facet, or in thin glass the sum of all interreflections. Transmission is unchanged. With a
/// remapped reflectance a facet transmits one minus the reflectance of its brightest channel, so only that channel conserves energy
/// exactly.
#[derive(Clone, Copy, Debug)]
pub struct RoughDielectric {
    /// GGX facets; specular if smooth.
    pub surface: Microsurface,
    /// Relative index of refraction: inside (or thin wall) over outside.
    pub ior: f32,
    /// Solid or thin.
    pub walls: Walls,
    /// Scaling of radiance by refraction of a solid.
    pub refraction: Refraction,
    /// Transmission tint, applied at each crossing.
    pub tint: Rgb,
    /// Reflectance of a facet.
    pub reflectance: GlassReflectance,
    /// Energy compensation of single scattering.
    pub energy_compensation: EnergyCompensation,
    /// Whether facets of a solid are Beckmann instead of GGX; these have no energy compensation.
    pub is_beckmann: bool,
}

impl GlassReflectance {
    /// Fresnel's equations with a reflection colour.
    pub fn colored(color: GlassReflection) -> GlassReflectance {
        match color {
            GlassReflection::White => GlassReflectance::Plain,
            _ => GlassReflectance::Colored(color),
        }
    }

    /// The reflection colour.
    #[inline(always)]
    pub fn color(&self) -> GlassReflection {
        match *self {
            GlassReflectance::Plain => GlassReflection::White,
            GlassReflectance::Colored(color) | GlassReflectance::Remapped { color, .. } => color,
        }
    }
}

/// Reflection and refraction of a facet at one angle.
#[derive(Clone, Copy)]
pub(super) struct Facet {
    pub reflected: Rgb,
    pub transmitted: Rgb,
    /// Probability of sampling reflection.
    pub probability_reflected: f32,
    /// Probability of sampling transmission; computed separately, so that a tiny one does not round to 0.
    pub probability_transmitted: f32,
    pub cos_transmitted: f32,
}

impl RoughDielectric {
    /// Raises the alphas of solid glass to a minimum. (Not of thin glass, which transmits without refraction.)
    pub(super) fn roughen(&mut self, min_alpha: f32) {
        if self.walls == Walls::Solid && self.surface.alpha.iter().any(|alpha| *alpha < min_alpha) {
            self.surface.roughen(min_alpha);
            // The energy loss of the additional roughness is not compensated, as in Cycles.
            self.energy_compensation = EnergyCompensation::Off;
        }
    }

    /// Removes reflection or transmission, for skipped caustics.
    pub(super) fn remove_lobes(&mut self, skipped: SkippedCaustics) {
        if skipped.refractive {
            self.tint = Rgb::ZERO;
        }
        if skipped.reflective {
            self.reflectance = GlassReflectance::Colored(GlassReflection::None);
        }
    }

    /// Whether all samples are specular.
    #[inline(always)]
    pub fn is_smooth(&self) -> bool {
        let [a, b] = self.surface.alpha();
        self.surface.is_mirror()
            || (self.walls == Walls::Solid && a.min(b) * (self.ior - 1.0).abs() < MIN_SPREAD)
    }

    /// Relative index of refraction: far side over the side of `wo`.
    #[inline(always)]
    pub(super) fn eta(&self, wo: Vec3) -> f32 {
        if self.walls == Walls::Solid && wo.z < 0.0 { 1.0 / self.ior } else { self.ior }
    }

    /// Reflection and transmission of a facet at a cosine `c`.
    #[inline(always)]
    pub(super) fn facet(&self, c: f32, eta: f32) -> Facet {
        let interface = fresnel::exact(c, eta);
        let total = interface.cos_transmitted <= 0.0 && interface.reflectance > 0.0;
        let mut reflected = match self.reflectance {
            GlassReflectance::Plain | GlassReflectance::Colored(_) => Rgb::splat(interface.reflectance),
            GlassReflectance::Remapped { .. } if total => Rgb::ONE,
            GlassReflectance::Remapped { f0, f90, .. } => {
                let f0_of_ior = fresnel::f0_from_eta(eta);
                let weight = (interface.reflectance - f0_of_ior) / (1.0 - f0_of_ior).max(1e-6);
                (f0 + (Rgb::splat(f90) - f0) * weight).clamp(Rgb::ZERO, Rgb::ONE)
            }
        };
        if self.walls == Walls::Thin {
            // Interreflections between both faces: R + T^2 R / (1 - R^2).
            reflected = reflected * 2.0 / (Rgb::ONE + reflected);
        }
        let mut transmittance = if total { 0.0 } else { 1.0 - reflected.max_element() };
        match self.reflectance.color() {
            GlassReflection::White => {}
            GlassReflection::Tinted => reflected *= self.tint,
            GlassReflection::None => (reflected, transmittance) = (Rgb::ZERO, if total { 0.0 } else { 1.0 }),
        }
        let transmitted = self.tint * transmittance;
        let (r, t) = (reflected.mean(), transmitted.mean());
        let sum = r + t;
        let [probability_reflected, probability_transmitted] =
            [r, t].map(|x| x / if sum > 0.0 { sum } else { 1.0 });
        Facet {
            reflected,
            transmitted,
            probability_reflected,
            probability_transmitted,
            cos_transmitted: interface.cos_transmitted,
        }
    }

    /// Estimate of the directional albedo: the mean of a facet at the view cosine and of one tilted to the viewer.
    #[inline(always)]
    pub(super) fn albedo_estimate(&self, cosine: f32, is_inside: bool) -> f32 {
        let eta = if is_inside && self.walls == Walls::Solid { 1.0 / self.ior } else { self.ior };
        let facet_albedo = |c: f32| {
            let facet = self.facet(c.min(1.0), eta);
            facet.reflected.mean() + facet.transmitted.mean()
        };
        let estimate = 0.5 * (facet_albedo(cosine) + facet_albedo(cosine.max(0.5)));
        // From the denser side, some facets may reflect totally although the mean facet does not: keep a minimum probability.
        let least = if eta < 1.0 && !self.is_smooth() { 0.01 } else { 0.0 };
        if estimate > least { estimate } else { least }
    }
}

/// The parameters of a [`RoughDielectric`] whose reflectance follows from its index of refraction.
#[derive(Clone, Copy, Debug)]
pub struct RoughDielectricProgram {
    /// See [`RoughDielectric::surface`].
    pub facets: MicrosurfaceProgram,
    pub ior: f32,
    /// That index where it varies over the surface.
    pub varying_ior: Option<FloatSlot>,
    pub walls: Walls,
    pub refraction: Refraction,
    pub tint: ColorSlot,
    /// Whether `tint` is the total of two crossings (entry and exit).
    pub tints_once: bool,
    /// Colour of the reflection.
    pub reflection: GlassReflection,
    pub energy_compensation: EnergyCompensation,
    pub is_beckmann: bool,
}

impl RoughDielectricProgram {
    /// Isotropic solid glass.
    pub fn new(
        ior: f32,
        tint: ColorSlot,
        roughness: FloatSlot,
        energy_compensation: EnergyCompensation,
    ) -> RoughDielectricProgram {
        RoughDielectricProgram {
            facets: MicrosurfaceProgram { roughness, anisotropy: None },
            ior,
            varying_ior: None,
            walls: Walls::Solid,
            refraction: Refraction::Scales,
            tint,
            tints_once: false,
            reflection: GlassReflection::White,
            energy_compensation,
            is_beckmann: false,
        }
    }
}

impl MaterialProgram for RoughDielectricProgram {
    type Lobe = RoughDielectric;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> RoughDielectric {
        RoughDielectric {
            surface: self.facets.evaluate(slots, frame),
            ior: ior_at(self.ior, self.varying_ior.as_ref(), slots),
            walls: self.walls,
            refraction: self.refraction,
            tint: tint_of_crossing(slots.clamped_color(&self.tint), self.tints_once),
            reflectance: GlassReflectance::colored(self.reflection),
            energy_compensation: self.energy_compensation,
            is_beckmann: self.is_beckmann,
        }
    }

    fn may_transmit_unscattered(&self) -> bool {
        self.walls == Walls::Thin && self.facets.is_always_smooth()
    }

    fn is_smooth_glass(&self) -> bool {
        self.facets.is_always_smooth()
    }
}

impl RoughDielectric {
    /// Samples thin-walled glass; z < 0 is transmission. `None` if the light is absorbed.
    #[inline(always)]
    fn sample_thin(&self, above: Vec3, u: [f32; 3]) -> Option<Vec3> {
        let normal = self.surface.sample_visible_normal(above, [u[0], u[1]]);
        let c = above.dot(normal).clamp(0.0, 1.0);
        let mirrored = normal * (2.0 * c) - above;
        let is_transmission = u[2] >= self.facet(c, self.ior).probability_reflected;
        let side = if is_transmission { -1.0 } else { 1.0 };
        (mirrored.z > 0.0).then(|| Vec3::new(mirrored.x, mirrored.y, mirrored.z * side))
    }

    /// Reflection and refraction of smooth solid glass; `None` otherwise.
    pub(super) fn specular_interface(&self, cosine: f32, is_inside: bool) -> Option<SmoothInterface> {
        if self.walls != Walls::Solid || !self.is_smooth() {
            return None;
        }
        let eta = if is_inside { 1.0 / self.ior } else { self.ior };
        let Facet { reflected, transmitted, .. } = self.facet(cosine, eta);
        let cos_transmitted = fresnel::exact(cosine, eta).cos_transmitted;
        Some(SmoothInterface { reflected, transmitted, cos_transmitted })
    }

    /// Index of refraction and larger alpha (0 if smooth) of solid glass; `None` if thin-walled.
    pub(super) fn solid_ior_and_alpha(&self) -> Option<(f32, f32)> {
        let [a, b] = self.surface.alpha();
        (self.walls == Walls::Solid).then_some((self.ior, if self.is_smooth() { 0.0 } else { a.max(b) }))
    }

    /// Samples smooth glass.
    #[inline(always)]
    fn sample_smooth(&self, wo: Vec3, u: f32) -> BsdfSample {
        let eta = self.eta(wo);
        // The same cosine as in `albedo_estimate`.
        let facet = self.facet(ggx::to_upper_side(wo).z.min(1.0), eta);
        let p = facet.probability_reflected;
        if u < p {
            return BsdfSample::mirror(wo, facet.reflected / p, p);
        }
        if p >= 1.0 || facet.transmitted == Rgb::ZERO {
            return BsdfSample::ABSORBED;
        }
        let weight = facet.transmitted / (1.0 - p);
        let (wi, eta) = match self.walls {
            Walls::Thin => (-wo, 1.0),
            Walls::Solid => {
                let z = facet.cos_transmitted.copysign(-wo.z);
                (Vec3::new(-wo.x / eta, -wo.y / eta, z).normalize(), eta)
            }
        };
        let refracted = self.refraction.at(eta);
        BsdfSample {
            wi,
            weight: weight * refracted.weight,
            pdf_solid_angle: 1.0 - p,
            eta: refracted.eta,
            flux: refracted.flux,
            is_specular: true,
            is_transmission: true,
        }
    }

    /// Value and pdf of thin-walled glass for `wo` with z > 0; the transmission lobe is the mirror image of the reflection lobe.
    #[inline]
    fn eval_thin(&self, above: Vec3, wi: Vec3) -> BsdfEval {
        let r = self.surface.reflection(above, Vec3::new(wi.x, wi.y, wi.z.abs()));
        let facet = self.facet(r.cos_half.min(1.0), self.ior);
        let (color, probability) = match wi.z < 0.0 {
            true => (facet.transmitted, facet.probability_transmitted),
            false => (facet.reflected, facet.probability_reflected),
        };
        let albedo = match self.energy_compensation {
            EnergyCompensation::Off => 1.0,
            EnergyCompensation::On => self.surface.directional_albedo(above).full,
        };
        BsdfEval { f_cos: color * (r.f_cos / albedo), pdf_solid_angle: probability * r.pdf_solid_angle }
    }
}

impl Lobe for RoughDielectric {
    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        if self.is_smooth() {
            return self.sample_smooth(wo, u[2]);
        }
        let (above, eta) = (ggx::to_upper_side(wo), self.eta(wo));
        let sampled = match self.walls {
            Walls::Solid => {
                let closure = SolidGlassClosure::new(self, above, eta);
                closure.sample(u).map(|wi| (wi, closure.eval(wi)))
            }
            Walls::Thin => self.sample_thin(above, u).map(|wi| (wi, self.eval_thin(above, wi))),
        };
        let Some((wi, value)) = sampled else {
            return BsdfSample::ABSORBED;
        };
        if wi.z == 0.0 || value.pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        let is_transmission = wi.z < 0.0;
        let is_refraction = is_transmission && self.walls == Walls::Solid;
        let refracted = self.refraction.at(if is_refraction { eta } else { 1.0 });
        BsdfSample {
            wi: if wo.z < 0.0 { Vec3::new(wi.x, wi.y, -wi.z) } else { wi },
            weight: value.f_cos / value.pdf_solid_angle,
            pdf_solid_angle: value.pdf_solid_angle,
            eta: refracted.eta,
            flux: refracted.flux,
            is_specular: false,
            is_transmission,
        }
    }

    #[inline]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if self.is_smooth() || wi.z == 0.0 {
            return BsdfEval::ZERO;
        }
        let above = ggx::to_upper_side(wo);
        let wi = Vec3::new(wi.x, wi.y, if wo.z < 0.0 { -wi.z } else { wi.z });
        match self.walls {
            Walls::Solid => SolidGlassClosure::new(self, above, self.eta(wo)).eval(wi),
            Walls::Thin => self.eval_thin(above, wi),
        }
    }

    #[inline(always)]
    fn is_specular(&self) -> bool {
        self.is_smooth()
    }

    #[inline(always)]
    fn tinted(self, color: Rgb) -> Self {
        RoughDielectric { tint: self.tint * color, ..self }
    }

    #[inline(always)]
    fn albedo(&self) -> Rgb {
        self.tint
    }

    fn appearance(&self) -> Appearance {
        let plain = Appearance::of_glass(self.ior, self.tint, Appearance::roughness(self.surface.alpha()));
        let color = match self.reflectance.color() {
            GlassReflection::White => Rgb::ONE,
            GlassReflection::Tinted => self.tint,
            GlassReflection::None => Rgb::ZERO,
        };
        Appearance { glossy: plain.glossy * color, ..plain }
    }
}

impl Transmissive for RoughDielectric {
    const HAS_SCATTERED_TRANSMISSION: bool = true;
    const REFRACTS: bool = true;
    const SIDES_MAY_SWAP: bool = true;

    #[inline(always)]
    fn with_ior(self, ior: f32) -> Self {
        RoughDielectric { ior, ..self }
    }

    #[inline(always)]
    fn transmission_tint(&self) -> Rgb {
        self.tint
    }

    #[inline(always)]
    fn straight(&self, wo: Vec3) -> Rgb {
        if self.walls != Walls::Thin || !self.is_smooth() {
            return Rgb::ZERO;
        }
        self.facet(ggx::to_upper_side(wo).z.min(1.0), self.ior).transmitted
    }
}

// Rough solid glass, with shadowed light redirected as an approximation of multiple scattering.

/// The closure of solid glass for one view direction.
pub struct SolidGlassClosure<'a> {
    glass: &'a RoughDielectric,
    /// The view direction with z > 0, in the frame with x along the anisotropy direction.
    wo: Vec3,
    /// [`Microsurface::smith_root`] of `wo`.
    root: f32,
    /// Relative index of refraction: far side over the side of `wo`.
    eta: f32,
    /// Redirection of shadowed light; `None` without energy compensation.
    redirection: Option<Redirection>,
}

/// Redirection of shadowed light for one view direction.
#[derive(Clone, Copy)]
struct Redirection {
    /// Fraction of the light shadowed on the rarer side that stays on that side.
    fraction_staying: f32,
    /// Of the light from inside that a facet reflects below the horizon, the fraction that is transmitted.
    fraction_transmitted: f32,
    /// Lift on the rarer side.
    rarer: Lift,
    /// Lift on the denser side.
    denser: Lift,
}

impl Redirection {
    /// From the rarer side, the fraction that stays is the reflectance of a second facet at normal incidence. From the denser side, odds
    /// were fitted to random walks for alphas of 0.3 to 1, indices of 1.02 to 2.4 and cosines of 0.4 to 0.95 (most errors below 0.07;
    /// larger for views near the normal from inside an index near 1), as a function of alpha and of the view cosine relative to the
    /// cosine of the critical angle, whose square is near 2 (n - 1). Lifts were chosen so that uniform illumination is nearly preserved.
    #[inline(always)]
    fn new(cosine: f32, eta: f32, surface: &Microsurface) -> Redirection {
        let [a, b] = surface.alpha();
        let alpha = 0.5 * (a + b);
        let (rarer, denser) = (Lift { reach: 0.5 * alpha }, Lift { reach: 4.0 * alpha });
        if eta >= 1.0 {
            return Redirection {
                fraction_staying: fresnel::f0_from_eta(eta),
                fraction_transmitted: 0.0,
                rarer,
                denser,
            };
        }
        let relative_cos_squared = cosine * cosine * eta / (2.0 * (1.0 - eta)).max(1e-9);
        let odds = relative_cos_squared * relative_cos_squared + 1.0 / 6.0;
        let fraction = |odds: f32| odds / (1.0 + odds);
        Redirection {
            fraction_staying: fraction(odds * (0.6 + 0.8 * alpha)),
            fraction_transmitted: fraction(odds * (0.075 + 0.375 * alpha)),
            rarer,
            denser,
        }
    }
}

/// Lifts directions from the horizon: cosine z to z' with z'^2 = z (z + reach) / (1 + reach). Hardly any effect on z far above `reach`;
/// below, a density uniform in z becomes proportional to z'.
#[derive(Clone, Copy)]
struct Lift {
    reach: f32,
}

impl Lift {
    #[inline(always)]
    fn up(self, v: Vec3) -> Vec3 {
        let (a, z) = (self.reach, v.z.abs());
        let tangential_scale = ((1.0 + z + a) / ((1.0 + a) * (1.0 + z))).sqrt();
        let lifted = (z * (z + a) / (1.0 + a)).sqrt();
        Vec3::new(v.x * tangential_scale, v.y * tangential_scale, lifted.copysign(v.z)).normalize()
    }

    /// Inverse of [`Lift::up`], and the density factor dz / dz'.
    #[inline(always)]
    fn down(self, v: Vec3) -> (Vec3, f32) {
        let (a, lifted) = (self.reach, v.z.abs());
        let root = (a * a + 4.0 * (1.0 + a) * lifted * lifted).sqrt();
        let z = 2.0 * (1.0 + a) * lifted * lifted / (a + root);
        let tangential_scale = ((1.0 + z) * (1.0 + a) / (1.0 + z + a)).sqrt();
        let low = Vec3::new(v.x * tangential_scale, v.y * tangential_scale, z.copysign(v.z));
        (low, 2.0 * (1.0 + a) * lifted / root)
    }
}

/// Part of the light scattered by a facet.
#[derive(Clone, Copy)]
struct FacetLight {
    color: Rgb,
    /// Probability of sampling this part.
    probability: f32,
}

impl FacetLight {
    const NONE: FacetLight = FacetLight { color: Rgb::ZERO, probability: 0.0 };

    #[inline(always)]
    fn plus(self, other: FacetLight) -> FacetLight {
        FacetLight { color: self.color + other.color, probability: self.probability + other.probability }
    }

    #[inline(always)]
    fn times(self, factor: f32) -> FacetLight {
        FacetLight { color: self.color * factor, probability: self.probability * factor }
    }

    #[inline(always)]
    fn tinted(self, tint: Rgb) -> FacetLight {
        FacetLight { color: self.color * tint, ..self }
    }
}

/// Light reflected or refracted by a facet.
#[derive(Clone, Copy)]
struct FacetLobe {
    direction: Vec3,
    /// Unshadowed light along `direction`.
    unshadowed: FacetLight,
    /// Redirected light along the lifted `direction`.
    lifted: FacetLight,
}

impl SolidGlassClosure<'_> {
    /// The closure for a view direction with z > 0.
    #[inline(always)]
    pub fn new(glass: &RoughDielectric, above: Vec3, eta: f32) -> SolidGlassClosure<'_> {
        let wo = glass.surface.to_axis(above);
        let redirection = (glass.energy_compensation == EnergyCompensation::On && !glass.is_beckmann)
            .then(|| Redirection::new(wo.z, eta, &glass.surface));
        SolidGlassClosure { glass, wo, root: glass.surface.smith_root(wo), eta, redirection }
    }

    /// Light reflected and refracted by a facet. `known` are the reflected and refracted directions if the caller has them in full
    /// precision.
    #[inline(always)]
    fn split(&self, normal: Vec3, known: [Option<Vec3>; 2]) -> [FacetLobe; 2] {
        let (wo, eta) = (self.wo, self.eta);
        let c = wo.dot(normal).clamp(0.0, 1.0);
        let facet = self.glass.facet(c, eta);
        let part = |direction, color, probability| FacetLobe {
            direction,
            unshadowed: FacetLight { color, probability },
            lifted: FacetLight::NONE,
        };
        let mut mirrored =
            part(known[0].unwrap_or(normal * (2.0 * c) - wo), facet.reflected, facet.probability_reflected);
        let mut refracted = part(
            known[1].unwrap_or(normal * (c / eta - facet.cos_transmitted) - wo / eta),
            facet.transmitted,
            facet.probability_transmitted,
        );
        let unshadowed =
            [self.unshadowed_reflection(mirrored.direction), self.unshadowed_refraction(refracted.direction)];
        match &self.redirection {
            None => {
                mirrored.unshadowed.color *= unshadowed[0];
                refracted.unshadowed.color *= unshadowed[1];
            }
            Some(redirection) if eta >= 1.0 => {
                self.redirect(redirection, (&mut mirrored, unshadowed[0]), (&mut refracted, unshadowed[1]));
            }
            Some(redirection) => {
                self.redirect(redirection, (&mut refracted, unshadowed[1]), (&mut mirrored, unshadowed[0]));
            }
        }
        [mirrored, refracted]
    }

    /// Splits the lobes of a facet on the rarer and the denser side into unshadowed and redirected light; arguments are lobes with their
    /// unshadowed fraction.
    #[inline(always)]
    fn redirect(
        &self,
        redirection: &Redirection,
        rarer: (&mut FacetLobe, f32),
        denser: (&mut FacetLobe, f32),
    ) {
        let ((rarer, unshadowed), (denser, unshadowed_denser)) = (rarer, denser);
        // A facet may reflect to the far side or refract to the near side (unshadowed fraction 0): nothing stays on the rarer side.
        let stays = if unshadowed > 0.0 { redirection.fraction_staying } else { 0.0 };
        let shadowed = rarer.unshadowed.times(1.0 - unshadowed);
        rarer.lifted = shadowed.times(stays);
        rarer.unshadowed = rarer.unshadowed.times(unshadowed);
        // Tinted by one more crossing of the interface.
        let redirected = shadowed.times(1.0 - stays).tinted(self.glass.tint);
        denser.lifted = denser.unshadowed.times(1.0 - unshadowed_denser).plus(redirected);
        denser.unshadowed = denser.unshadowed.times(unshadowed_denser);
    }

    /// Unshadowed fraction of reflection along `v`: G2 / G1(wo).
    #[inline(always)]
    fn unshadowed_reflection(&self, v: Vec3) -> f32 {
        if v.z <= 0.0 {
            return 0.0;
        }
        let root = self.glass.surface.smith_root(v);
        if self.glass.is_beckmann {
            let lambda = beckmann_lambda(self.wo.z, self.root) + beckmann_lambda(v.z, root);
            return (self.wo.z + self.root) / (2.0 * self.wo.z * (1.0 + lambda));
        }
        (v.z * (self.wo.z + self.root) / (v.z * self.root + self.wo.z * root)).min(1.0)
    }

    /// Unshadowed fraction of refraction along `v`: G1(v).
    #[inline(always)]
    fn unshadowed_refraction(&self, v: Vec3) -> f32 {
        if v.z >= 0.0 {
            return 0.0;
        }
        if self.glass.is_beckmann {
            let (root, wo) = (self.glass.surface.smith_root(v), self.wo.z);
            let inverse_g2 = (1.0 + beckmann_lambda(wo, self.root)) * (1.0 + beckmann_lambda(-v.z, root));
            return (wo + self.root) / (2.0 * wo * inverse_g2);
        }
        (2.0 * v.z / (v.z - self.glass.surface.smith_root(v))).min(1.0)
    }

    /// The lift on the far side (`crosses`) or on the side of `wo`.
    #[inline(always)]
    fn lift(&self, redirection: &Redirection, crosses: bool) -> Lift {
        if (self.eta >= 1.0) == crosses { redirection.denser } else { redirection.rarer }
    }

    /// Samples a direction; z < 0 is transmission. `None` if the light is lost.
    #[inline]
    pub fn sample(&self, u: [f32; 3]) -> Option<Vec3> {
        let surface = &self.glass.surface;
        let normal = ggx::sample_visible_normal(self.wo, surface.alpha(), [u[0], u[1]]);
        let [mirrored, refracted] = self.split(normal, [None; 2]);
        let mut rest = u[2];
        for (part, is_reflection) in [(mirrored, true), (refracted, false)] {
            if rest < part.unshadowed.probability {
                let is_on_its_side = (part.direction.z > 0.0) == is_reflection;
                return is_on_its_side.then(|| surface.from_axis(part.direction.normalize()));
            }
            rest -= part.unshadowed.probability;
            if rest < part.lifted.probability {
                let (redirection, mut wi) = (self.redirection?, part.direction.normalize());
                if is_reflection
                    && wi.z <= 0.0
                    && rest >= part.lifted.probability * redirection.fraction_transmitted
                {
                    wi.z = -wi.z;
                }
                return Some(surface.from_axis(self.lift(&redirection, wi.z < 0.0).up(wi)));
            }
            rest -= part.lifted.probability;
        }
        None
    }

    /// Value and pdf of a direction; z < 0 is transmission.
    #[inline]
    pub fn eval(&self, wi: Vec3) -> BsdfEval {
        let wi = self.glass.surface.to_axis(wi);
        let crosses = wi.z < 0.0;
        let light_along = |v: Vec3| if crosses { self.refracted_light(v) } else { self.reflected_light(v) };
        let [mut light, _] = light_along(wi);
        if let Some(redirection) = &self.redirection {
            let (low, stretch) = self.lift(redirection, crosses).down(wi);
            let [_, mut lifted] = light_along(low);
            if self.eta < 1.0 && low.z.abs() < self.wo.z {
                let [_, below_horizon] = self.reflected_light(Vec3::new(low.x, low.y, -low.z.abs()));
                lifted = lifted.plus(match crosses {
                    true => below_horizon.times(redirection.fraction_transmitted).tinted(self.glass.tint),
                    false => below_horizon.times(1.0 - redirection.fraction_transmitted),
                });
            }
            light = light.plus(lifted.times(stretch));
        }
        // Scaling of radiance by refraction.
        let scale = if crosses { self.glass.refraction.at(self.eta).weight } else { 1.0 };
        BsdfEval { f_cos: light.color * scale, pdf_solid_angle: light.probability }
    }

    /// Multiplies by the ratio of Beckmann to GGX densities, since Beckmann facets are sampled by GGX.
    #[inline(always)]
    fn with_beckmann_ratio(&self, mut lobe: FacetLobe, half: Vec3) -> FacetLobe {
        if self.glass.is_beckmann {
            lobe.unshadowed.color *= beckmann_over_ggx(half, self.glass.surface.alpha());
        }
        lobe
    }

    /// Unshadowed and redirected light reflected along `wi`, which may be below the horizon.
    #[inline(always)]
    fn reflected_light(&self, wi: Vec3) -> [FacetLight; 2] {
        let half = self.wo + wi;
        if half.z <= 0.0 {
            return [FacetLight::NONE; 2];
        }
        let [part, _] = self.split(half.normalize(), [Some(wi), None]);
        let density = self.glass.surface.distribution(half) * 0.5 / (self.wo.z + self.root);
        let part = self.with_beckmann_ratio(part, half);
        [part.unshadowed.times(density), part.lifted.times(density)]
    }

    /// Unshadowed and redirected light refracted along `wi`.
    #[inline(always)]
    fn refracted_light(&self, wi: Vec3) -> [FacetLight; 2] {
        let Some((normal, density)) = self.glass.surface.refraction((self.wo, self.root), wi, self.eta)
        else {
            return [FacetLight::NONE; 2];
        };
        let [_, part] = self.split(normal, [None, Some(wi)]);
        let part = self.with_beckmann_ratio(part, normal);
        [part.unshadowed.times(density), part.lifted.times(density)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::ggx::MIN_ALPHA;
    use crate::sampling::chi2::Random;

    #[test]
    fn lift_down_is_the_inverse_of_up() {
        let mut random = Random::new(6);
        for reach in [0.5 * MIN_ALPHA, 0.01, 0.3, 4.0] {
            let lift = Lift { reach };
            for _ in 0..1000 {
                let v = random.direction();
                let up = lift.up(v);
                let (low, stretch) = lift.down(up);
                assert!(
                    (low - v).length() < 1e-5 && up.z.abs() >= v.z.abs() - 1e-6,
                    "{reach} {v} {up} {low}"
                );
                // The density factor dz / dz' by finite differences.
                let step = 1e-3f32.copysign(up.z);
                let next = if up.z.abs() < 0.9 { up.z + step } else { up.z - step };
                let tangent = (1.0 - next * next).max(0.0).sqrt();
                let other = lift.down(Vec3::new(tangent, 0.0, next)).0;
                let slope = (other.z - low.z) / (next - up.z);
                assert!(
                    (slope - stretch).abs() < 0.02 || up.z.abs() < 0.05,
                    "{reach} {v}: {slope} {stretch}"
                );
            }
        }
    }
}
