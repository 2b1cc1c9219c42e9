//! The glTF 2.0 material: a GGX layer over a diffuse or transmissive base, mixed with metal.

use super::albedo_table::DirectionalAlbedo;
use super::ggx::{self, MIN_ALPHA};
use super::{BsdfEval, BsdfSample, fresnel};
use crate::math::Vec3;
use crate::scene::Microfacet;
use std::f32::consts::FRAC_1_PI;

/// How the transmitted share passes the surface. It is smooth even where the reflection is rough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transmission {
    /// Straight on.
    Thin,
    /// Refracted; the index of the inside over the outside.
    Solid(f32),
}

/// The glTF metallic-roughness material (glTF 2.0, appendix B; KHR_materials_specular, KHR_materials_transmission).
///
/// Dielectric and metal share their microfacets, so both reflections are one lobe with f0 and f90 mixed by the
/// metalness, each part with its own compensation (Turquin 2019, eq. 16). Deviation from the appendix: the base gets what the dielectric layer's directional albedo leaves rather
/// than 1 - F(v.h), which can exceed the light that arrives (albedo scaling, as the appendix allows).
#[derive(Clone, Copy, Debug)]
pub struct MetalRough {
    /// Diffuse colour: base colour (1 - metallic) (1 - transmission).
    pub diffuse: Vec3,
    /// Factor on transmitted light: base colour (1 - metallic) transmission.
    pub transmitted: Vec3,
    /// Reflectance of the dielectric layer at normal incidence.
    pub layer_f0: Vec3,
    /// The same at grazing incidence.
    pub layer_f90: f32,
    /// Reflectance of the metal at normal incidence; it rises to 1.
    pub metal_f0: Vec3,
    /// Share of metal.
    pub metallic: f32,
    /// GGX alpha; below [`MIN_ALPHA`] an exact mirror.
    pub alpha: f32,
    /// How light is transmitted.
    pub transmission: Transmission,
    /// Single or multiple scattering.
    pub microfacet: Microfacet,
}

/// What depends on `wo` alone.
#[derive(Clone, Copy)]
struct View {
    diffuse: Vec3,
    transmitted: Vec3,
    /// Reflectance of the microfacets at normal and at grazing incidence, compensation included.
    f0: Vec3,
    f90: Vec3,
    /// Chances of the lobes; they add up to 1 (or are all 0).
    p_specular: f32,
    p_diffuse: f32,
    p_transmitted: f32,
}

impl MetalRough {
    #[inline(always)]
    fn is_mirror(&self) -> bool {
        self.alpha < MIN_ALPHA
    }

    /// Has it no lobe of finite width?
    #[inline(always)]
    pub fn is_specular(&self) -> bool {
        self.is_mirror() && self.diffuse == Vec3::ZERO
    }

    /// Diffuse colour and reflection at normal incidence, clamped.
    #[inline(always)]
    pub fn albedo(&self) -> Vec3 {
        let reflected = self.layer_f0 * (1.0 - self.metallic) + self.metal_f0 * self.metallic;
        (self.diffuse + self.transmitted + reflected).min(Vec3::ONE)
    }

    #[inline(always)]
    fn view(&self, cos_o: f32) -> View {
        // A mirror returns everything, its grazing share is Schlick's weight of the one cosine.
        let table = if self.is_mirror() {
            DirectionalAlbedo { full: 1.0, grazing: fresnel::schlick_weight(cos_o) }
        } else {
            DirectionalAlbedo::at(cos_o, self.alpha)
        };
        let compensation = |f0| match self.microfacet {
            Microfacet::Multi => table.compensation(f0),
            Microfacet::Single => Vec3::ONE,
        };
        let (of_layer, of_metal) = (compensation(self.layer_f0), compensation(self.metal_f0));
        let layer = (table.reflectance(self.layer_f0, self.layer_f90) * of_layer).max_element();
        let (of_layer, of_metal) = (of_layer * (1.0 - self.metallic), of_metal * self.metallic);
        let f0 = self.layer_f0 * of_layer + self.metal_f0 * of_metal;
        let f90 = of_layer * self.layer_f90 + of_metal;
        let specular = f0 * (table.full - table.grazing) + f90 * table.grazing;
        let rest = if layer < 1.0 { 1.0 - layer } else { 0.0 };
        let (diffuse, transmitted) = (self.diffuse * rest, self.transmitted * rest);
        let mean = |v: Vec3| (v.x + v.y + v.z) * (1.0 / 3.0);
        let (s, d, t) = (mean(specular), mean(diffuse), mean(transmitted));
        let total = s + d + t;
        let scale = 1.0 / if total > 0.0 { total } else { 1.0 };
        View {
            diffuse,
            transmitted,
            f0,
            f90,
            p_specular: s * scale,
            p_diffuse: d * scale,
            p_transmitted: t * scale,
        }
    }

    /// See [`super::Bsdf::sample`].
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let above = Vec3::new(wo.x, wo.y, wo.z.abs().max(ggx::MIN_COS));
        let view = self.view(above.z);
        if u[2] < view.p_transmitted {
            return self.transmit(wo, &view);
        }
        let choose_specular = u[2] - view.p_transmitted < view.p_specular;
        if choose_specular && self.is_mirror() {
            let reflectance = fresnel::schlick(view.f0, view.f90, above.z);
            return BsdfSample::mirror(wo, reflectance / view.p_specular, view.p_specular);
        }
        let wi = if choose_specular {
            let normal = ggx::sample_visible_normal(above, self.alpha, [u[0], u[1]]);
            normal * (2.0 * above.dot(normal)) - above
        } else {
            crate::sampling::warp::cosine_hemisphere([u[0], u[1]])
        };
        let value = self.eval_above(&view, above, wi);
        if wi.z <= 0.0 || value.pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        BsdfSample {
            wi: Vec3::new(wi.x, wi.y, wi.z.copysign(wo.z)),
            weight: value.f_cos / value.pdf_solid_angle,
            pdf_solid_angle: value.pdf_solid_angle,
            eta: 1.0,
            is_specular: false,
            is_transmission: false,
        }
    }

    /// The transmitted lobe; total reflection inside a solid returns all of it.
    #[inline(always)]
    fn transmit(&self, wo: Vec3, view: &View) -> BsdfSample {
        let chance = view.p_transmitted;
        let weight = view.transmitted / chance;
        let eta = match self.transmission {
            Transmission::Thin => 1.0,
            Transmission::Solid(ior) if wo.z < 0.0 => 1.0 / ior,
            Transmission::Solid(ior) => ior,
        };
        let side = fresnel::exact(wo.z.abs().min(1.0), eta);
        if eta != 1.0 && side.reflectance >= 1.0 {
            return BsdfSample::mirror(wo, weight, chance);
        }
        let inverse = 1.0 / eta;
        let wi = Vec3::new(-wo.x * inverse, -wo.y * inverse, side.cos_transmitted.copysign(-wo.z));
        BsdfSample {
            wi: if eta == 1.0 { -wo } else { wi.normalize() },
            weight: weight * (inverse * inverse),
            pdf_solid_angle: chance,
            eta,
            is_specular: true,
            is_transmission: true,
        }
    }

    /// See [`super::Bsdf::eval`].
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        let above = Vec3::new(wo.x, wo.y, wo.z.abs().max(ggx::MIN_COS));
        self.eval_above(&self.view(above.z), above, Vec3::new(wi.x, wi.y, wi.z.abs()))
    }

    #[inline(always)]
    fn eval_above(&self, view: &View, wo: Vec3, wi: Vec3) -> BsdfEval {
        if wi.z <= 0.0 {
            return BsdfEval::ZERO;
        }
        let cosine = wi.z * FRAC_1_PI;
        let diffuse = BsdfEval { f_cos: view.diffuse * cosine, pdf_solid_angle: view.p_diffuse * cosine };
        if self.is_mirror() {
            return diffuse;
        }
        let r = ggx::reflection(wo, wi, self.alpha);
        let factor = fresnel::schlick(view.f0, view.f90, r.cos_half);
        BsdfEval {
            f_cos: diffuse.f_cos + factor * r.f_cos,
            pdf_solid_angle: diffuse.pdf_solid_angle + view.p_specular * r.pdf_solid_angle,
        }
    }
}
