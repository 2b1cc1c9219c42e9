//! The opaque glTF 2.0 material: a GGX layer over a diffuse base, mixed with metal.

use super::albedo_table::DirectionalAlbedo;
use super::microsurface::{Facets, Isotropic};
use super::{BsdfEval, BsdfSample, LEAST_ALBEDO, fresnel, ggx, mean};
use crate::math::Vec3;
use crate::scene::Microfacet;
use std::f32::consts::FRAC_1_PI;

/// The glTF metallic-roughness material (glTF 2.0, appendix B; KHR_materials_specular).
///
/// Dielectric and metal share their microfacets, so both reflections are one lobe with f0 and f90 mixed by the
/// metalness, each part with its own compensation (Turquin 2019, eq. 16). Deviation from the appendix: the base gets what
/// the dielectric layer's directional albedo leaves rather than 1 - F(v.h), which can exceed the light that arrives
/// (albedo scaling, as the appendix allows).
#[derive(Clone, Copy, Debug)]
pub struct MetalRough<S = Isotropic> {
    /// Diffuse colour: base colour (1 - metallic).
    pub diffuse: Vec3,
    /// Reflectance of the dielectric layer at normal incidence.
    pub layer_f0: Vec3,
    /// The same at grazing incidence.
    pub layer_f90: f32,
    /// Reflectance of the metal at normal incidence; it rises to 1.
    pub metal_f0: Vec3,
    /// Share of metal.
    pub metallic: f32,
    /// The facets of its surface.
    pub surface: S,
    /// Single or multiple scattering.
    pub microfacet: Microfacet,
}

/// What depends on `wo` alone.
#[derive(Clone, Copy)]
pub(super) struct View {
    diffuse: Vec3,
    /// What the dielectric layer leaves to what is below it.
    pub rest: f32,
    /// Reflectance of the microfacets at normal and at grazing incidence, compensation included.
    f0: Vec3,
    f90: Vec3,
    /// Mean albedo.
    pub albedo: f32,
    /// Chances of the lobes; each on its own, so that a tiny one does not round to 0.
    p_specular: f32,
    p_diffuse: f32,
}

impl<S: Facets> MetalRough<S> {
    /// Has it no lobe of finite width?
    #[inline(always)]
    pub fn is_specular(&self) -> bool {
        self.surface.is_mirror() && self.diffuse == Vec3::ZERO
    }

    /// Diffuse colour and reflection at normal incidence, clamped.
    #[inline(always)]
    pub fn albedo(&self) -> Vec3 {
        let reflected = self.layer_f0 * (1.0 - self.metallic) + self.metal_f0 * self.metallic;
        (self.diffuse + reflected).min(Vec3::ONE)
    }

    /// What a direction above the surface sees.
    #[inline(always)]
    pub(super) fn view(&self, above: Vec3) -> View {
        // A mirror returns everything, its grazing share is Schlick's weight of the one cosine.
        let table = if self.surface.is_mirror() {
            DirectionalAlbedo { full: 1.0, grazing: fresnel::schlick_weight(above.z) }
        } else {
            self.surface.directional_albedo(above)
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
        let diffuse = self.diffuse * rest;
        let (s, d) = (mean(specular), mean(diffuse));
        let albedo = s + d;
        let whole = if albedo > LEAST_ALBEDO { albedo } else { 1.0 };
        View { diffuse, rest, f0, f90, albedo, p_specular: s / whole, p_diffuse: d / whole }
    }

    /// See [`super::Bsdf::sample`].
    #[inline(always)]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let above = Vec3::new(wo.x, wo.y, wo.z.abs().max(ggx::MIN_COS));
        self.sample_seen(&self.view(above), wo, above, u)
    }

    /// As [`MetalRough::sample`], with the view of `above`.
    #[inline(always)]
    pub(super) fn sample_seen(&self, view: &View, wo: Vec3, above: Vec3, u: [f32; 3]) -> BsdfSample {
        if view.albedo <= LEAST_ALBEDO {
            return BsdfSample::ABSORBED;
        }
        let choose_specular = u[2] < view.p_specular;
        if choose_specular && self.surface.is_mirror() {
            let reflectance = fresnel::schlick(view.f0, view.f90, above.z);
            return BsdfSample::mirror(wo, reflectance / view.p_specular, view.p_specular);
        }
        let wi = if choose_specular {
            let normal = self.surface.sample_visible_normal(above, [u[0], u[1]]);
            normal * (2.0 * above.dot(normal)) - above
        } else {
            crate::sampling::warp::cosine_hemisphere([u[0], u[1]])
        };
        let value = self.eval_above(view, above, wi);
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

    /// See [`super::Bsdf::eval`].
    #[inline(always)]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        let above = Vec3::new(wo.x, wo.y, wo.z.abs().max(ggx::MIN_COS));
        self.eval_above(&self.view(above), above, Vec3::new(wi.x, wi.y, wi.z.abs()))
    }

    /// The value for directions above the surface.
    #[inline(always)]
    pub(super) fn eval_above(&self, view: &View, wo: Vec3, wi: Vec3) -> BsdfEval {
        if wi.z <= 0.0 {
            return BsdfEval::ZERO;
        }
        let cosine = wi.z * FRAC_1_PI;
        let diffuse = BsdfEval { f_cos: view.diffuse * cosine, pdf_solid_angle: view.p_diffuse * cosine };
        if self.surface.is_mirror() {
            return diffuse;
        }
        let r = self.surface.reflection(wo, wi);
        let factor = fresnel::schlick(view.f0, view.f90, r.cos_half);
        BsdfEval {
            f_cos: diffuse.f_cos + factor * r.f_cos,
            pdf_solid_angle: diffuse.pdf_solid_angle + view.p_specular * r.pdf_solid_angle,
        }
    }
}
