//! How glass of any roughness scatters: solid, thin and smooth.

use super::microsurface::Facets;
use super::rough_dielectric::{RoughDielectric, Walls};
use super::solid_glass::SolidGlassClosure;
use super::{BsdfEval, BsdfSample, Lobe, Transmissive, ggx};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::EnergyCompensation;

impl RoughDielectric {
    /// A direction from a thin sheet; z below 0 is behind it. None where light is lost.
    #[inline(always)]
    fn sample_thin(&self, above: Vec3, u: [f32; 3]) -> Option<Vec3> {
        let normal = self.surface.sample_visible_normal(above, [u[0], u[1]]);
        let c = above.dot(normal).clamp(0.0, 1.0);
        let mirrored = normal * (2.0 * c) - above;
        let is_transmission = u[2] >= self.facet(c, self.ior).probability_reflected;
        let side = if is_transmission { -1.0 } else { 1.0 };
        (mirrored.z > 0.0).then(|| Vec3::new(mirrored.x, mirrored.y, mirrored.z * side))
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

    /// A thin sheet, which reflects and transmits the mirrored direction alike, from a direction with z above 0.
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
