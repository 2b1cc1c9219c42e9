//! Glass of any roughness, solid and thin-walled.

use super::dielectric::{SmoothInterface, tint_of_crossing};
use super::microsurface::{Facets, Microsurface, MicrosurfaceProgram, beckmann_hidden, beckmann_over_ggx};
use super::{
    Appearance, BsdfEval, BsdfSample, Lobe, LocalFrame, MaterialProgram, Refraction, Slots, Transmissive,
    fresnel, ggx,
};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::{ColorSlot, EnergyCompensation, FloatSlot, GlassReflection, SkippedCaustics};

/// Alpha times (ior - 1) below which refraction spreads light by less than single precision resolves from a single
/// direction: the surface counts as smooth.
const MIN_SPREAD: f32 = 1e-4;

/// The medium behind the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Walls {
    /// A solid: light is refracted.
    Solid,
    /// Thin-walled: transmitted light is not refracted, but scattered by the same microfacets.
    Thin,
}

/// Reflectance of the interface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GlassReflectance {
    /// As physics says.
    Plain,
    /// A reflectance by colour instead of the index of refraction.
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
/// [`EnergyCompensation::Off`] shadowed light is lost.
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
    /// Scaling of radiance where it enters a solid.
    pub refraction: Refraction,
    /// Factor on transmitted light at each crossing.
    pub tint: Rgb,
    /// Reflectance.
    pub reflectance: GlassReflectance,
    /// Whether the energy that single scattering loses is given back.
    pub energy_compensation: EnergyCompensation,
    /// The facets of a solid are those of Beckmann, not of GGX, and lose that energy.
    pub is_beckmann: bool,
}

impl GlassReflectance {
    /// The reflectance by the index of refraction, tinted by a colour.
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
    /// Makes the facets of solid glass at least this rough, GGX alpha; thin glass lets light straight through.
    pub(super) fn roughen(&mut self, least: f32) {
        if self.walls == Walls::Solid && self.surface.alpha.iter().any(|alpha| *alpha < least) {
            self.surface.roughen(least);
            // The loss of single scattering by that remains a loss, as in Cycles.
            self.energy_compensation = EnergyCompensation::Off;
        }
    }

    /// Takes reflection or transmission away.
    pub(super) fn leave_out(&mut self, lobes: SkippedCaustics) {
        if lobes.refractive {
            self.tint = Rgb::ZERO;
        }
        if lobes.reflective {
            self.reflectance = GlassReflectance::Colored(GlassReflection::None);
        }
    }

    /// Are all its samples single directions?
    #[inline(always)]
    pub fn is_smooth(&self) -> bool {
        let [a, b] = self.surface.alpha();
        self.surface.is_mirror()
            || (self.walls == Walls::Solid && a.min(b) * (self.ior - 1.0).abs() < MIN_SPREAD)
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
    /// Colour of its reflection.
    pub reflection: GlassReflection,
    /// See [`RoughDielectric::energy_compensation`].
    pub energy_compensation: EnergyCompensation,
    /// See [`RoughDielectric::is_beckmann`].
    pub is_beckmann: bool,
}

impl RoughDielectricProgram {
    /// Isotropic glass of a solid.
    pub fn new(
        ior: f32,
        tint: ColorSlot,
        roughness: FloatSlot,
        energy_compensation: EnergyCompensation,
    ) -> RoughDielectricProgram {
        RoughDielectricProgram {
            facets: MicrosurfaceProgram { roughness, anisotropy: None },
            ior,
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
            ior: self.ior,
            walls: self.walls,
            refraction: self.refraction,
            tint: tint_of_crossing(slots.share_by_channel(&self.tint), self.tints_once),
            reflectance: GlassReflectance::colored(self.reflection),
            energy_compensation: self.energy_compensation,
            is_beckmann: self.is_beckmann,
        }
    }

    fn may_pass_straight(&self) -> bool {
        self.walls == Walls::Thin && self.facets.is_always_smooth()
    }

    fn is_smooth_glass(&self) -> bool {
        self.facets.is_always_smooth()
    }
}

impl RoughDielectric {
    /// Samples thin-walled glass; z below 0 is transmission. `None` if the light is absorbed.
    #[inline(always)]
    fn sample_thin(&self, above: Vec3, u: [f32; 3]) -> Option<Vec3> {
        let normal = self.surface.sample_visible_normal(above, [u[0], u[1]]);
        let c = above.dot(normal).clamp(0.0, 1.0);
        let mirrored = normal * (2.0 * c) - above;
        let is_transmission = u[2] >= self.facet(c, self.ior).probability_reflected;
        let side = if is_transmission { -1.0 } else { 1.0 };
        (mirrored.z > 0.0).then(|| Vec3::new(mirrored.x, mirrored.y, mirrored.z * side))
    }

    /// Reflection and refraction at a smooth face of a solid.
    pub(super) fn smooth_interface(&self, cosine: f32, is_inside: bool) -> Option<SmoothInterface> {
        if self.walls != Walls::Solid || !self.is_smooth() {
            return None;
        }
        let eta = if is_inside { 1.0 / self.ior } else { self.ior };
        let Facet { reflected, transmitted, .. } = self.facet(cosine, eta);
        let cos_transmitted = fresnel::exact(cosine, eta).cos_transmitted;
        Some(SmoothInterface { reflected, transmitted, cos_transmitted })
    }

    /// The index of refraction and the larger alpha of a solid's face.
    pub(super) fn solid_face(&self) -> Option<(f32, f32)> {
        let [a, b] = self.surface.alpha();
        (self.walls == Walls::Solid).then_some((self.ior, if self.is_smooth() { 0.0 } else { a.max(b) }))
    }

    /// The limit of no roughness.
    #[inline(always)]
    fn sample_smooth(&self, wo: Vec3, u: f32) -> BsdfSample {
        let eta = self.eta(wo);
        // The cosine that the estimate of its albedo sees as well.
        let facet = self.facet(ggx::above(wo).z.min(1.0), eta);
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

    /// Evaluates thin-walled glass, whose transmission lobe mirrors its reflection lobe, for a direction with z above 0.
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
        let (above, eta) = (ggx::above(wo), self.eta(wo));
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
        let bends = is_transmission && self.walls == Walls::Solid;
        let refracted = self.refraction.at(if bends { eta } else { 1.0 });
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
        let above = ggx::above(wo);
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
    const SCATTERS_THROUGH: bool = true;
    const REFRACTS: bool = true;
    const TURNS_OVER: bool = true;

    #[inline(always)]
    fn with_ior(self, ior: f32) -> Self {
        RoughDielectric { ior, ..self }
    }

    #[inline(always)]
    fn crossing_tint(&self) -> Rgb {
        self.tint
    }

    #[inline(always)]
    fn straight(&self, wo: Vec3) -> Rgb {
        if self.walls != Walls::Thin || !self.is_smooth() {
            return Rgb::ZERO;
        }
        self.facet(ggx::above(wo).z.min(1.0), self.ior).transmitted
    }
}

// The rough surface of solid glass, with multiple scattering: light shadowed by other microfacets is redirected.

/// The closure of solid glass for one view direction.
pub struct SolidGlassClosure<'a> {
    glass: &'a RoughDielectric,
    /// The direction, with z above 0, in the frame of the facets' axis.
    wo: Vec3,
    /// Its root in Smith's masking.
    root: f32,
    /// Index of refraction of the other side over that of its own.
    eta: f32,
    shadowed: Option<Shadowed>,
}

/// Where shadowed light goes.
#[derive(Clone, Copy)]
struct Shadowed {
    /// Share of what is shadowed on the rarer side that stays there.
    stays: f32,
    /// Share of what the inside mirrors against the surface that leaves through it.
    passes: f32,
    rarer: Lift,
    denser: Lift,
}

impl Shadowed {
    /// From the rarer side, what stays is what a second facet would mirror at normal incidence. From the denser side, odds of
    /// leaving were fitted to walks for alphas of 0.3 to 1, indices of 1.02 to 2.4 and cosines of 0.4 to 0.95 (errors of
    /// most shares below 0.07; more for steep views within an index near 1): by the view's cosine beside that of total
    /// reflection, whose square is near 2 (n - 1), and by how rough the facets are. Lifts were chosen so that light from everywhere leaves nearly evenly.
    #[inline(always)]
    fn new(cosine: f32, eta: f32, surface: &Microsurface) -> Shadowed {
        let [a, b] = surface.alpha();
        let alpha = 0.5 * (a + b);
        let (rarer, denser) = (Lift { reach: 0.5 * alpha }, Lift { reach: 4.0 * alpha });
        if eta >= 1.0 {
            return Shadowed { stays: fresnel::f0_from_eta(eta), passes: 0.0, rarer, denser };
        }
        let steep = cosine * cosine * eta / (2.0 * (1.0 - eta)).max(1e-9);
        let odds = steep * steep + 1.0 / 6.0;
        let share = |odds: f32| odds / (1.0 + odds);
        Shadowed {
            stays: share(odds * (0.6 + 0.8 * alpha)),
            passes: share(odds * (0.075 + 0.375 * alpha)),
            rarer,
            denser,
        }
    }
}

/// Turns directions of cosine z to z' with z'^2 = z (z + reach) / (1 + reach): those far above `reach` hardly, those below
/// so that light spread evenly over z falls off at the horizon as the cosine.
#[derive(Clone, Copy)]
struct Lift {
    reach: f32,
}

impl Lift {
    #[inline(always)]
    fn up(self, v: Vec3) -> Vec3 {
        let (a, z) = (self.reach, v.z.abs());
        let tangent = ((1.0 + z + a) / ((1.0 + a) * (1.0 + z))).sqrt();
        let lifted = (z * (z + a) / (1.0 + a)).sqrt();
        Vec3::new(v.x * tangent, v.y * tangent, lifted.copysign(v.z)).normalize()
    }

    /// The direction that [`Lift::up`] turns to this one, and how much denser directions lie there: dz / dz'.
    #[inline(always)]
    fn down(self, v: Vec3) -> (Vec3, f32) {
        let (a, lifted) = (self.reach, v.z.abs());
        let root = (a * a + 4.0 * (1.0 + a) * lifted * lifted).sqrt();
        let z = 2.0 * (1.0 + a) * lifted * lifted / (a + root);
        let tangent = ((1.0 + z) * (1.0 + a) / (1.0 + z + a)).sqrt();
        let low = Vec3::new(v.x * tangent, v.y * tangent, z.copysign(v.z));
        (low, 2.0 * (1.0 + a) * lifted / root)
    }
}

/// Some of a facet's light.
#[derive(Clone, Copy)]
struct FacetLight {
    color: Rgb,
    /// Probability of sampling it.
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

/// Values that a facet scatters along one direction, and along that direction lifted.
#[derive(Clone, Copy)]
struct FacetLobe {
    direction: Vec3,
    open: FacetLight,
    lifted: FacetLight,
}

impl SolidGlassClosure<'_> {
    /// A direction with z above 0, in the surface's frame.
    #[inline(always)]
    pub fn new(glass: &RoughDielectric, above: Vec3, eta: f32) -> SolidGlassClosure<'_> {
        let wo = glass.surface.to_axis(above);
        let shadowed = (glass.energy_compensation == EnergyCompensation::On && !glass.is_beckmann)
            .then(|| Shadowed::new(wo.z, eta, &glass.surface));
        SolidGlassClosure { glass, wo, root: glass.surface.smith_root(wo), eta, shadowed }
    }

    /// Values that a facet scatters along its mirrored and its refracted direction. `known` are these directions where they are at
    /// hand, with all their digits.
    #[inline(always)]
    fn split(&self, normal: Vec3, known: [Option<Vec3>; 2]) -> [FacetLobe; 2] {
        let (wo, eta) = (self.wo, self.eta);
        let c = wo.dot(normal).clamp(0.0, 1.0);
        let facet = self.glass.facet(c, eta);
        let part = |direction, color, probability| FacetLobe {
            direction,
            open: FacetLight { color, probability },
            lifted: FacetLight::NONE,
        };
        let mut mirrored =
            part(known[0].unwrap_or(normal * (2.0 * c) - wo), facet.reflected, facet.probability_reflected);
        let mut refracted = part(
            known[1].unwrap_or(normal * (c / eta - facet.cos_transmitted) - wo / eta),
            facet.transmitted,
            facet.probability_transmitted,
        );
        let open = [self.open_mirrored(mirrored.direction), self.open_refracted(refracted.direction)];
        match &self.shadowed {
            None => {
                mirrored.open.color *= open[0];
                refracted.open.color *= open[1];
            }
            Some(shadowed) if eta >= 1.0 => {
                self.redirect(shadowed, (&mut mirrored, open[0]), (&mut refracted, open[1]));
            }
            Some(shadowed) => {
                self.redirect(shadowed, (&mut refracted, open[1]), (&mut mirrored, open[0]));
            }
        }
        [mirrored, refracted]
    }

    /// Leaves a facet's parts the light that no other facet shadows, and shares out the rest.
    #[inline(always)]
    fn redirect(&self, shadowed: &Shadowed, rarer: (&mut FacetLobe, f32), denser: (&mut FacetLobe, f32)) {
        let ((rarer, open), (denser, open_denser)) = (rarer, denser);
        // Directions to the wrong side are lost.
        let stays = if open > 0.0 { shadowed.stays } else { 0.0 };
        let hidden = rarer.open.times(1.0 - open);
        rarer.lifted = hidden.times(stays);
        rarer.open = rarer.open.times(open);
        // It crosses once more than it would have.
        let joining = hidden.times(1.0 - stays).tinted(self.glass.tint);
        denser.lifted = denser.open.times(1.0 - open_denser).plus(joining);
        denser.open = denser.open.times(open_denser);
    }

    /// Share of light along a mirrored direction that no facet shadows, G2 / G1(wo).
    #[inline(always)]
    fn open_mirrored(&self, v: Vec3) -> f32 {
        if v.z <= 0.0 {
            return 0.0;
        }
        let root = self.glass.surface.smith_root(v);
        if self.glass.is_beckmann {
            let hidden = beckmann_hidden(self.wo.z, self.root) + beckmann_hidden(v.z, root);
            return (self.wo.z + self.root) / (2.0 * self.wo.z * (1.0 + hidden));
        }
        (v.z * (self.wo.z + self.root) / (v.z * self.root + self.wo.z * root)).min(1.0)
    }

    /// Share of light along a refracted direction that no facet shadows, G1(wi).
    #[inline(always)]
    fn open_refracted(&self, v: Vec3) -> f32 {
        if v.z >= 0.0 {
            return 0.0;
        }
        if self.glass.is_beckmann {
            let (root, wo) = (self.glass.surface.smith_root(v), self.wo.z);
            let open = (1.0 + beckmann_hidden(wo, self.root)) * (1.0 + beckmann_hidden(-v.z, root));
            return (wo + self.root) / (2.0 * wo * open);
        }
        (2.0 * v.z / (v.z - self.glass.surface.smith_root(v))).min(1.0)
    }

    /// How light is lifted on the other side, or on this one.
    #[inline(always)]
    fn lift(&self, shadowed: &Shadowed, crosses: bool) -> Lift {
        if (self.eta >= 1.0) == crosses { shadowed.denser } else { shadowed.rarer }
    }

    /// Chooses a direction; z below 0 is the other side. None where light is lost.
    #[inline]
    pub fn sample(&self, u: [f32; 3]) -> Option<Vec3> {
        let surface = &self.glass.surface;
        let normal = ggx::sample_visible_normal(self.wo, surface.alpha(), [u[0], u[1]]);
        let [mirrored, refracted] = self.split(normal, [None; 2]);
        let mut rest = u[2];
        for (part, mirrors) in [(mirrored, true), (refracted, false)] {
            if rest < part.open.probability {
                let is_seen = (part.direction.z > 0.0) == mirrors;
                return is_seen.then(|| surface.from_axis(part.direction.normalize()));
            }
            rest -= part.open.probability;
            if rest < part.lifted.probability {
                let (shadowed, mut wi) = (self.shadowed?, part.direction.normalize());
                if mirrors && wi.z <= 0.0 && rest >= part.lifted.probability * shadowed.passes {
                    wi.z = -wi.z;
                }
                return Some(surface.from_axis(self.lift(&shadowed, wi.z < 0.0).up(wi)));
            }
            rest -= part.lifted.probability;
        }
        None
    }

    /// Value and density for a direction; z below 0 is the other side.
    #[inline]
    pub fn eval(&self, wi: Vec3) -> BsdfEval {
        let wi = self.glass.surface.to_axis(wi);
        let crosses = wi.z < 0.0;
        let toward = |v: Vec3| if crosses { self.refracted(v) } else { self.mirrored(v) };
        let [mut light, _] = toward(wi);
        if let Some(shadowed) = &self.shadowed {
            let (low, stretch) = self.lift(shadowed, crosses).down(wi);
            let [_, mut lifted] = toward(low);
            if self.eta < 1.0 && low.z.abs() < self.wo.z {
                let [_, against] = self.mirrored(Vec3::new(low.x, low.y, -low.z.abs()));
                lifted = lifted.plus(match crosses {
                    true => against.times(shadowed.passes).tinted(self.glass.tint),
                    false => against.times(1.0 - shadowed.passes),
                });
            }
            light = light.plus(lifted.times(stretch));
        }
        // Radiance of the other medium.
        let scale = if crosses { self.glass.refraction.at(self.eta).weight } else { 1.0 };
        BsdfEval { f_cos: light.color * scale, pdf_solid_angle: light.probability }
    }

    /// A lobe of facets of Beckmann, sampled as if they were of GGX, of which there are about as many: at most 4 / e times.
    #[inline(always)]
    fn by_distribution(&self, mut lobe: FacetLobe, half: Vec3) -> FacetLobe {
        if self.glass.is_beckmann {
            lobe.open.color *= beckmann_over_ggx(half, self.glass.surface.alpha());
        }
        lobe
    }

    /// Open and lifted light that facets mirror along a direction, which may lead below the surface.
    #[inline(always)]
    fn mirrored(&self, wi: Vec3) -> [FacetLight; 2] {
        let half = self.wo + wi;
        if half.z <= 0.0 {
            return [FacetLight::NONE; 2];
        }
        let [part, _] = self.split(half.normalize(), [Some(wi), None]);
        let density = self.glass.surface.distribution(half) * 0.5 / (self.wo.z + self.root);
        let part = self.by_distribution(part, half);
        [part.open.times(density), part.lifted.times(density)]
    }

    /// Open and lifted light that facets refract along a direction.
    #[inline(always)]
    fn refracted(&self, wi: Vec3) -> [FacetLight; 2] {
        let Some((normal, density)) = self.glass.surface.refraction((self.wo, self.root), wi, self.eta)
        else {
            return [FacetLight::NONE; 2];
        };
        let [_, part] = self.split(normal, [None, Some(wi)]);
        let part = self.by_distribution(part, normal);
        [part.open.times(density), part.lifted.times(density)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::ggx::MIN_ALPHA;
    use crate::sampling::chi2::Random;

    #[test]
    fn lifts_are_undone() {
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
                // Directions as dense as the measure says: dz / dz'.
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
