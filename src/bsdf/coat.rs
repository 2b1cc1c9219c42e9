//! A clear dielectric layer on top of everything else (KHR_materials_clearcoat).

use super::albedo_table::DirectionalAlbedo;
use super::dielectric_curve::LayerFresnel;
use super::facet_reflection::FacetReflection;
use super::microsurface::{Facets, Isotropic};
use super::{BsdfEval, BsdfSample};
use crate::color::Rgb;
use crate::math::{Frame, Vec3};
use crate::scene::{EnergyCompensation, FresnelModel};

/// Index of refraction, as the extension fixes it.
const IOR: f32 = 1.5;

/// Reflectance of that index at normal incidence.
const F0: Rgb = Rgb::splat(0.04);

/// The reflection of the layer, with a normal of its own. What it lets pass is one minus its directional albedo.
#[derive(Clone, Copy, Debug)]
pub struct Coat {
    /// Its strength 0..1; 0 for none.
    pub factor: f32,
    /// GGX alpha; below [`super::ggx::MIN_ALPHA`] an exact mirror.
    pub alpha: f32,
    /// Its unit normal in the frame of the BSDF, z above 0.
    pub normal: Vec3,
    /// How its reflectance rises from 0.04 to 1; see [`Coat::fresnel`].
    pub fresnel: LayerFresnel,
    /// Whether the energy that single scattering loses is given back.
    pub energy_compensation: EnergyCompensation,
}

impl Coat {
    /// No layer.
    pub const NONE: Coat = Coat {
        factor: 0.0,
        alpha: 0.0,
        normal: Vec3::Z,
        fresnel: LayerFresnel::Schlick,
        energy_compensation: EnergyCompensation::On,
    };

    /// The Fresnel term of a model for the index of the layer.
    #[inline(always)]
    pub fn fresnel(model: FresnelModel) -> LayerFresnel {
        LayerFresnel::new(model, IOR)
    }

    /// The reflecting lobe of a layer of full strength, in its own frame.
    #[inline(always)]
    fn lobe(&self) -> FacetReflection<impl Fn(f32) -> Rgb> {
        let Coat { alpha, fresnel, energy_compensation, .. } = *self;
        let reflectance = move |cosine| fresnel.reflectance(F0, Rgb::ONE, cosine);
        FacetReflection { alpha, f0: F0, reflectance, energy_compensation }
    }

    /// Is its reflection a single direction?
    #[inline(always)]
    pub fn is_mirror(&self) -> bool {
        self.lobe().is_mirror()
    }

    /// Share of light from a direction that the layer reflects, and share that it takes from what is below, its strength
    /// included. Without compensation it takes more: light that facets mirror into each other is lost (as in
    /// [`super::MetalRough`]).
    #[inline(always)]
    pub fn shares(&self, wo: Vec3) -> [f32; 2] {
        let cosine = wo.dot(self.normal).abs().clamp(super::ggx::MIN_COS, 1.0);
        let mut loss = 1.0;
        let albedo = if self.is_mirror() {
            self.fresnel.reflectance(F0, Rgb::ONE, cosine).r
        } else {
            let table = DirectionalAlbedo::at(cosine, self.alpha);
            let gain = match self.energy_compensation {
                EnergyCompensation::On => table.compensation(F0).r,
                EnergyCompensation::Off => 1.0,
            };
            if matches!(self.fresnel, LayerFresnel::Exact(_))
                && self.energy_compensation == EnergyCompensation::Off
            {
                loss = table.full;
            }
            let grazing = match self.fresnel {
                LayerFresnel::Schlick => table.grazing,
                LayerFresnel::Exact(curve) => {
                    let surface = Isotropic { alpha: self.alpha };
                    surface.dielectric_grazing(Vec3::new(0.0, 0.0, cosine), table, curve)
                }
            };
            DirectionalAlbedo { full: table.full, grazing }.reflectance(F0, 1.0).r * gain
        };
        [albedo, albedo / loss].map(|share| (self.factor * share).min(1.0))
    }

    /// See [`super::Bsdf::sample`], for a layer of full strength. Reflections to below the base's surface are lost.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        if self.normal == Vec3::Z {
            return self.lobe().sample(wo, u);
        }
        let frame = Frame::from_normal(self.normal);
        let mut s = self.lobe().sample(frame.to_local(wo), u);
        s.wi = frame.to_world(s.wi).normalize();
        if (s.wi.z < 0.0) == (wo.z < 0.0) { s } else { BsdfSample::ABSORBED }
    }

    /// See [`super::Bsdf::eval`], for a layer of full strength.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if (wo.z < 0.0) != (wi.z < 0.0) {
            return BsdfEval::ZERO;
        }
        if self.normal == Vec3::Z {
            return self.lobe().eval(wo, wi);
        }
        let frame = Frame::from_normal(self.normal);
        self.lobe().eval(frame.to_local(wo), frame.to_local(wi))
    }
}
