//! Glass of any roughness, solid and as a thin sheet.

use super::glass_table::{LEAST_SPREAD, Place, Reflecting};
use super::microsurface::{Facets, Microsurface};
use super::{BsdfEval, BsdfSample, fresnel, ggx, mean};
use crate::math::Vec3;
use crate::scene::Microfacet;

/// What is behind the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Walls {
    /// A solid: light is refracted.
    Solid,
    /// A thin sheet: light passes on without being bent, blurred by the same facets.
    Thin,
}

/// Reflectance of the interface as KHR_materials_specular changes it: Fresnel's equations, stretched to run from `f0` to
/// `f90`. Total reflection stays total.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GlassReflectance {
    /// As physics says.
    Plain,
    /// From `f0` at normal to `f90` at grazing incidence.
    Between {
        /// Reflectance at normal incidence.
        f0: Vec3,
        /// Reflectance at grazing incidence.
        f90: f32,
    },
}

/// Glass with GGX facets (Walter, Marschner, Li, Torrance 2007, eq. 20 and 21), by visible normals (Dupuy, Benyoub 2023).
/// z above 0 is outside.
///
/// Reflection is shadowed by the height-correlated Smith term as metals are, transmission by the separable one, which is
/// nearer to the exact beta function of Heitz et al. 2016, eq. 20. With [`Microfacet::Multi`] value
/// and samples are divided by the directional albedo of single scattering (Turquin 2019, section 4), so that white glass
/// keeps all energy from all directions on both sides. A facet of glass with changed reflectance passes what its brightest
/// channel does not reflect, so that channel keeps all energy as well, and the others less by what it alone reflects.
/// Solids of two roughnesses are not compensated: of light on alphas 0.5 and 0.125 (index 1.5, cosines 0.2 to 0.9) they lose
/// 2 to 20 % outside and 16 to 36 % inside. Their albedo depends on five numbers, and total reflection makes it steep in them:
/// tried, and lost, a table of its ratio to that of isotropic facets as rough as those along the azimuth; 84,000
/// numbers a side, cubic, left errors of 1 % outside and 5 % inside.
#[derive(Clone, Copy, Debug)]
pub struct RoughDielectric {
    /// Its facets; smooth ones give single directions.
    pub surface: Microsurface,
    /// Index of refraction of the inside (or the sheet) over the outside.
    pub ior: f32,
    /// Solid or thin.
    pub walls: Walls,
    /// Factor on transmitted light at each crossing.
    pub tint: Vec3,
    /// Reflectance.
    pub reflectance: GlassReflectance,
    /// Single or multiple scattering.
    pub microfacet: Microfacet,
}

/// A facet as seen under one angle.
#[derive(Clone, Copy)]
struct Facet {
    reflected: Vec3,
    transmitted: Vec3,
    /// Chance of sampling the reflection.
    p_reflected: f32,
    /// Chance of sampling the transmission; on its own, so that a tiny one does not round to 0.
    p_transmitted: f32,
    cos_transmitted: f32,
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
    fn facet(&self, c: f32, eta: f32) -> Facet {
        let interface = fresnel::exact(c, eta);
        let total = interface.cos_transmitted <= 0.0 && interface.reflectance > 0.0;
        let mut reflected = match self.reflectance {
            GlassReflectance::Plain => Vec3::splat(interface.reflectance),
            GlassReflectance::Between { .. } if total => Vec3::ONE,
            GlassReflectance::Between { f0, f90 } => {
                let normal = fresnel::f0_from_eta(eta);
                let rise = (interface.reflectance - normal) / (1.0 - normal).max(1e-6);
                (f0 + (Vec3::splat(f90) - f0) * rise).clamp(Vec3::ZERO, Vec3::ONE)
            }
        };
        if self.walls == Walls::Thin {
            // All reflections between the two faces: R + T^2 R / (1 - R^2).
            reflected = reflected * 2.0 / (Vec3::ONE + reflected);
        }
        let passes = if total { 0.0 } else { 1.0 - reflected.max_element() };
        let transmitted = self.tint * passes;
        let (r, t) = (mean(reflected), mean(transmitted));
        let sum = r + t;
        let [p_reflected, p_transmitted] = [r, t].map(|x| x / if sum > 0.0 { sum } else { 1.0 });
        Facet {
            reflected,
            transmitted,
            p_reflected,
            p_transmitted,
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
            mean(facet.reflected) + mean(facet.transmitted)
        };
        let estimate = 0.5 * (share(cosine) + share(cosine.max(0.5)));
        // From within, facets may reflect everything where their mean does not: they must not be starved.
        let least = if is_inside && !self.is_smooth() { 0.01 } else { 0.0 };
        if estimate > least { estimate } else { least }
    }

    /// What makes up for the light that single scattering loses.
    #[inline(always)]
    fn compensation(&self, above: Vec3, is_inside: bool) -> f32 {
        match (self.microfacet, self.walls, self.surface.isotropic_alpha()) {
            (Microfacet::Single, ..) | (_, Walls::Solid, None) => 1.0,
            (_, Walls::Thin, _) => 1.0 / self.surface.directional_albedo(above).full,
            (_, Walls::Solid, Some(alpha)) => {
                let place = Place::new(above.z, alpha, self.ior, is_inside);
                let albedo = match self.reflectance {
                    GlassReflectance::Plain => place.albedo(Reflecting::Plain),
                    GlassReflectance::Between { f0, f90 } => {
                        let full = self.surface.directional_albedo(above).full;
                        self.changed_albedo(&place, full, [f0.max_element(), f90])
                    }
                };
                1.0 / albedo
            }
        }
    }

    /// Albedo of the brightest channel of changed reflectance, which is linear in `f0` and `f90` and known for three
    /// pairs: those of Fresnel's equations, both 1 (`full`) and both 0.
    #[inline]
    fn changed_albedo(&self, place: &Place, full: f32, [f0, f90]: [f32; 2]) -> f32 {
        // In doubt too much, as in the table of glass.
        let full = full * 1.001;
        let clear = place.albedo(Reflecting::Clear);
        let at = |f: f32| clear + (full - clear) * f;
        let normal = fresnel::f0_from_eta(self.ior);
        if normal > 0.5 {
            // Errors would grow without bounds.
            return at(f0).max(at(f90));
        }
        let plain = place.albedo(Reflecting::Plain);
        at(f90) + (plain - full) * ((f90 - f0) / (1.0 - normal))
    }

    /// See [`super::Bsdf::sample`].
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        if self.is_smooth() {
            return self.sample_smooth(wo, u[2]);
        }
        let above = ggx::above(wo);
        let normal = self.surface.sample_visible_normal(above, [u[0], u[1]]);
        let c = above.dot(normal).clamp(0.0, 1.0);
        let eta = self.eta(wo);
        let facet = self.facet(c, eta);
        let is_transmission = u[2] >= facet.p_reflected;
        let wi = if !is_transmission || self.walls == Walls::Thin {
            let mirrored = normal * (2.0 * c) - above;
            if is_transmission { Vec3::new(mirrored.x, mirrored.y, -mirrored.z) } else { mirrored }
        } else {
            (normal * (c / eta - facet.cos_transmitted) - above / eta).normalize()
        };
        let outward = if wo.z < 0.0 { Vec3::new(wi.x, wi.y, -wi.z) } else { wi };
        let value = self.eval(wo, outward);
        if (wi.z < 0.0) != is_transmission || wi.z == 0.0 || value.pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        let bends = is_transmission && self.walls == Walls::Solid;
        BsdfSample {
            wi: outward,
            weight: value.f_cos / value.pdf_solid_angle,
            pdf_solid_angle: value.pdf_solid_angle,
            eta: if bends { eta } else { 1.0 },
            is_specular: false,
            is_transmission,
        }
    }

    /// The limit of no roughness.
    #[inline(always)]
    fn sample_smooth(&self, wo: Vec3, u: f32) -> BsdfSample {
        let eta = self.eta(wo);
        let facet = self.facet(wo.z.abs().min(1.0), eta);
        let p = facet.p_reflected;
        if u < p {
            return BsdfSample::mirror(wo, facet.reflected / p, p);
        }
        if p >= 1.0 || facet.transmitted == Vec3::ZERO {
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
        BsdfSample {
            wi,
            weight: weight * (1.0 / (eta * eta)),
            pdf_solid_angle: 1.0 - p,
            eta,
            is_specular: true,
            is_transmission: true,
        }
    }

    /// See [`super::Bsdf::eval`].
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if self.is_smooth() || wi.z == 0.0 {
            return BsdfEval::ZERO;
        }
        let above = ggx::above(wo);
        let crosses = (wo.z < 0.0) != (wi.z < 0.0);
        let unflipped = Vec3::new(wi.x, wi.y, if wo.z < 0.0 { -wi.z } else { wi.z });
        let eta = self.eta(wo);
        let e = if crosses && self.walls == Walls::Solid {
            self.eval_refracted(above, unflipped, eta)
        } else {
            let r = self.surface.reflection(above, Vec3::new(wi.x, wi.y, wi.z.abs()));
            let facet = self.facet(r.cos_half.min(1.0), eta);
            let (factor, chance) = match crosses {
                true => (facet.transmitted, facet.p_transmitted),
                false => (facet.reflected, facet.p_reflected),
            };
            BsdfEval { f_cos: factor * r.f_cos, pdf_solid_angle: chance * r.pdf_solid_angle }
        };
        BsdfEval { f_cos: e.f_cos * self.compensation(above, wo.z < 0.0), ..e }
    }

    /// Light that crosses a solid's surface; `wo` has z above 0, `wi` below.
    #[inline(always)]
    fn eval_refracted(&self, wo: Vec3, wi: Vec3, eta: f32) -> BsdfEval {
        let (wo, wi) = (self.surface.to_axis(wo), self.surface.to_axis(wi));
        // Walter et al. 2007, eq. 16, turned to the side of wo: wo + eta wi, so that the digits stay for eta near 1.
        let half = ((wo + wi) + wi * (eta - 1.0)) * if eta > 1.0 { -1.0 } else { 1.0 };
        let length = half.length();
        if half.z <= 0.0 || length == 0.0 {
            return BsdfEval::ZERO;
        }
        let (cos_o, cos_i) = (wo.dot(half) / length, wi.dot(half) / length);
        if cos_o <= 0.0 || cos_i >= 0.0 {
            return BsdfEval::ZERO;
        }
        let facet = self.facet(cos_o.min(1.0), eta);
        let (zo, zi) = (wo.z, (-wi.z).max(ggx::MIN_COS));
        let (root_o, root_i) = (self.surface.smith_root(wo), self.surface.smith_root(wi));
        // D |wo.h| / wo.z times dh / dwi = eta^2 |wi.h| / |wo + eta wi|^2, times G1(wo).
        let stretch = cos_o * -cos_i / (length * length);
        let common = self.surface.distribution(half) * 2.0 / (zo + root_o) * stretch;
        let masked_i = 2.0 * zi / (zi + root_i);
        BsdfEval {
            // The 1 / eta^2 of radiance undoes the measure's eta^2.
            f_cos: facet.transmitted * (common * masked_i),
            pdf_solid_angle: facet.p_transmitted * common * (eta * eta),
        }
    }
}
