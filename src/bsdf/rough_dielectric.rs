//! Glass of any roughness, solid and as a thin sheet.

use super::dielectric::tint_of_crossing;
use super::microsurface::{Facets, Microsurface, MicrosurfaceProgram};
use super::{LocalFrame, MaterialProgram, Refraction, Slots, fresnel};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::{ColorSlot, EnergyCompensation, GlassReflection};

/// Alpha times (ior - 1) below which refraction spreads light by less than single precision can tell from a single
/// direction: the surface counts as smooth.
const LEAST_SPREAD: f32 = 1e-4;

/// What is behind the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Walls {
    /// A solid: light is refracted.
    Solid,
    /// A thin sheet: light passes on without being bent, blurred by the same facets.
    Thin,
}

/// What the interface reflects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GlassReflectance {
    /// As physics says.
    Plain,
    /// The same share of another colour.
    Colored(GlassReflection),
    /// As KHR_materials_specular changes it: Fresnel's equations, stretched to run from `f0` at normal to `f90` at grazing
    /// incidence. Total reflection stays total.
    Between {
        /// Its colour.
        color: GlassReflection,
        /// Reflectance at normal incidence.
        f0: Rgb,
        /// Reflectance at grazing incidence.
        f90: f32,
    },
}

/// Glass with GGX facets (Walter, Marschner, Li, Torrance 2007, eq. 20 and 21), by visible normals (Dupuy, Benyoub 2023).
/// z above 0 is outside.
///
/// A facet splits light by Fresnel's equations between a mirrored and a refracted direction. Other facets shadow both:
/// reflection by the height-correlated Smith term as on metals, transmission by the separable one, which is nearer to the
/// exact beta function of Heitz et al. 2016, "Multiple-Scattering Microfacet BSDFs with the Smith Model", eq. 20. With
/// [`EnergyCompensation::Off`] what is shadowed is lost.
///
/// With [`EnergyCompensation::On`] it is not. On walks among facets (the model of that paper) most of it ends in the denser
/// medium, where total reflection holds it. So of what is shadowed on the rarer side a share stays there, and the rest joins
/// what the same facet sends to the denser side, tinted by one crossing more; what is mirrored against the surface from
/// within leaves through it in a share, and is turned back otherwise. Wherever it ends, it is turned away from the horizon,
/// where facets would shadow it again. No view direction of white glass loses or gains light, whatever the roughnesses,
/// index and reflectance; no table is needed, value and density are in closed form, and samples weigh exactly 1. As with
/// other compensation the price is reciprocity: under light from everywhere, directions give between 0.5 and 1.9 times as
/// much as they get (alphas of 0.1 to 1, indices of 1.33 to 2; the most near the horizon within).
///
/// Beside walks, for alphas of 0.1 to 1 and indices of 1.05 to 2.4, the share of light from either side is wrong by 0.013 on
/// average, by up to 0.22 near the horizon within glass of an index near 1, and balls show 3 % of the light elsewhere.
/// Dividing by the albedo of single scattering (Turquin 2019, section 4) gives 0.05 and 11 %; within, near the horizon,
/// that spreads the light more like walks do.
///
/// Thin sheets divide by the directional albedo. Colours of what is reflected, as Cycles' Glass BSDF has them, change no share: they
/// multiply what a facet mirrors, and the sum of all reflections within a thin sheet. A facet of glass with changed reflectance passes what its brightest
/// channel does not reflect, so that channel keeps all energy as well, and the others less by what it alone reflects.
#[derive(Clone, Copy, Debug)]
pub struct RoughDielectric {
    /// Its facets; smooth ones give single directions.
    pub surface: Microsurface,
    /// Index of refraction of the inside (or the sheet) over the outside.
    pub ior: f32,
    /// Solid or thin.
    pub walls: Walls,
    /// What becomes of radiance where it enters a solid.
    pub refraction: Refraction,
    /// Factor on transmitted light at each crossing.
    pub tint: Rgb,
    /// Reflectance.
    pub reflectance: GlassReflectance,
    /// Whether the energy that single scattering loses is given back.
    pub energy_compensation: EnergyCompensation,
}

impl GlassReflectance {
    /// That of the index of refraction, of a colour.
    pub fn colored(color: GlassReflection) -> GlassReflectance {
        match color {
            GlassReflection::White => GlassReflectance::Plain,
            _ => GlassReflectance::Colored(color),
        }
    }

    /// Its colour.
    #[inline(always)]
    pub fn color(&self) -> GlassReflection {
        match *self {
            GlassReflectance::Plain => GlassReflection::White,
            GlassReflectance::Colored(color) | GlassReflectance::Between { color, .. } => color,
        }
    }
}

/// A facet as seen under one angle.
#[derive(Clone, Copy)]
pub(super) struct Facet {
    pub reflected: Rgb,
    pub transmitted: Rgb,
    /// Probability of sampling the reflection.
    pub probability_reflected: f32,
    /// Probability of sampling the transmission; on its own, so that a tiny one does not round to 0.
    pub probability_transmitted: f32,
    pub cos_transmitted: f32,
}

impl RoughDielectric {
    /// Are all its samples single directions?
    #[inline(always)]
    pub fn is_smooth(&self) -> bool {
        let [a, b] = self.surface.alpha();
        self.surface.is_mirror()
            || (self.walls == Walls::Solid && a.min(b) * (self.ior - 1.0).abs() < LEAST_SPREAD)
    }

    /// Index of refraction of the other side over the side of `wo`.
    #[inline(always)]
    pub(super) fn eta(&self, wo: Vec3) -> f32 {
        if self.walls == Walls::Solid && wo.z < 0.0 { 1.0 / self.ior } else { self.ior }
    }

    /// Splits the light on a facet under the cosine `c`.
    #[inline(always)]
    pub(super) fn facet(&self, c: f32, eta: f32) -> Facet {
        let interface = fresnel::exact(c, eta);
        let total = interface.cos_transmitted <= 0.0 && interface.reflectance > 0.0;
        let mut reflected = match self.reflectance {
            GlassReflectance::Plain | GlassReflectance::Colored(_) => Rgb::splat(interface.reflectance),
            GlassReflectance::Between { .. } if total => Rgb::ONE,
            GlassReflectance::Between { f0, f90, .. } => {
                let normal = fresnel::f0_from_eta(eta);
                let rise = (interface.reflectance - normal) / (1.0 - normal).max(1e-6);
                (f0 + (Rgb::splat(f90) - f0) * rise).clamp(Rgb::ZERO, Rgb::ONE)
            }
        };
        if self.walls == Walls::Thin {
            // All reflections between the two faces: R + T^2 R / (1 - R^2).
            reflected = reflected * 2.0 / (Rgb::ONE + reflected);
        }
        let mut passes = if total { 0.0 } else { 1.0 - reflected.max_element() };
        match self.reflectance.color() {
            GlassReflection::White => {}
            GlassReflection::Tinted => reflected *= self.tint,
            GlassReflection::None => (reflected, passes) = (Rgb::ZERO, if total { 0.0 } else { 1.0 }),
        }
        let transmitted = self.tint * passes;
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

    /// Share of light that is not absorbed, roughly: the mean of a facet seen under the view cosine and of one that is
    /// turned to the viewer, as some facets of rough glass are.
    #[inline(always)]
    pub(super) fn albedo_estimate(&self, cosine: f32, is_inside: bool) -> f32 {
        let eta = if is_inside && self.walls == Walls::Solid { 1.0 / self.ior } else { self.ior };
        let share = |c: f32| {
            let facet = self.facet(c.min(1.0), eta);
            facet.reflected.mean() + facet.transmitted.mean()
        };
        let estimate = 0.5 * (share(cosine) + share(cosine.max(0.5)));
        // From the denser side, facets may reflect everything where their mean does not: they must not be starved.
        let least = if eta < 1.0 && !self.is_smooth() { 0.01 } else { 0.0 };
        if estimate > least { estimate } else { least }
    }
}

/// The parameters of a [`RoughDielectric`] that reflects the share that its index says.
#[derive(Clone, Copy, Debug)]
pub struct RoughDielectricProgram {
    /// See [`RoughDielectric::surface`].
    pub facets: MicrosurfaceProgram,
    /// See [`RoughDielectric::ior`].
    pub ior: f32,
    /// See [`RoughDielectric::walls`].
    pub walls: Walls,
    /// See [`RoughDielectric::refraction`].
    pub refraction: Refraction,
    /// See [`RoughDielectric::tint`].
    pub tint: ColorSlot,
    /// The tint is that of both crossings of a solid together.
    pub tints_once: bool,
    /// Colour of what it reflects.
    pub reflection: GlassReflection,
    /// See [`RoughDielectric::energy_compensation`].
    pub energy_compensation: EnergyCompensation,
}

impl MaterialProgram for RoughDielectricProgram {
    type Lobe = RoughDielectric;

    #[inline]
    fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> RoughDielectric {
        RoughDielectric {
            surface: self.facets.evaluate(slots, frame),
            ior: self.ior,
            walls: self.walls,
            refraction: self.refraction,
            tint: tint_of_crossing(slots.share_by_channel(&self.tint), self.tints_once),
            reflectance: GlassReflectance::colored(self.reflection),
            energy_compensation: self.energy_compensation,
        }
    }
}
