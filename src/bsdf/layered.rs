//! The whole glTF material: sheen and clearcoat over metal, diffuse base and glass, with a film between.
//!
//! Layers follow the glTF 2.0 appendix and its extensions with one deviation: a layer takes from what is below it its
//! directional albedo E(wo) rather than its Fresnel term 1 - F(v.h) for each light, so that layered white returns
//! exactly the light that arrives. From the top: coat, sheen, then the base.
//!
//! The base mixes glass (share transmission (1 - metallic)) with the opaque material of the same interface, of which a part may
//! let light pass diffusely. The inside of a solid sees the base alone, not the layers on the outside: light on its way out is
//! not dimmed by them. Neither side gains or loses energy; the price is that transmission through layers is not
//! reciprocal.

use super::coat::Coat;
use super::dielectric_curve::LayerFresnel;
use super::metal_rough::{MetalRough, MetalRoughClosure};
use super::microsurface::{Facets, Microsurface};
use super::oren_nayar::OrenNayar;
use super::rough_dielectric::{GlassReflectance, RoughDielectric, Walls};
use super::sample::{LEAST_ALBEDO, Refracted};
use super::sheen::Sheen;
use super::thin_film::ThinFilm;
use super::through::DiffuseThrough;
use super::{BsdfEval, BsdfSample, Lobe, Transmissive, ggx};
use crate::color::Rgb;
use crate::math::Vec3;
use std::f32::consts::FRAC_1_PI;

/// Every layer and base that a glTF material may have; absent ones have strength 0.
#[derive(Clone, Copy, Debug)]
pub struct Layered {
    /// Diffuse base under its interface, and metal.
    pub opaque: MetalRough<Microsurface>,
    /// Roughness 0..1 of the diffuse base by [`OrenNayar`]; 0 is Lambert's law.
    pub diffuse_roughness: f32,
    /// Factor on light that leaves diffusely on the other side, under the same interface.
    pub through: Rgb,
    /// Light that passes the interface.
    pub glass: RoughDielectric,
    /// Share of `glass`; the opaque material and `through` have the rest.
    pub glass_share: f32,
    /// A film on the interface.
    pub film: ThinFilm,
    /// Fibres on top.
    pub sheen: Sheen,
    /// The layer above all.
    pub coat: Coat,
}

/// The parts and their weights as one direction sees them. The value of the BSDF is the sum of each part's value times
/// its weight; probabilities add up to 1.
struct LayeredClosure {
    opaque: MetalRough<Microsurface>,
    opaque_closure: MetalRoughClosure,
    above: Vec3,
    glass: RoughDielectric,
    /// The diffuse base where it is rough; the opaque part has none then.
    rough: OrenNayar,
    /// What light takes with it that crosses diffusely.
    crossing: Refracted,
    /// Coat, sheen, opaque, through, rough diffuse base, glass.
    weights: [Rgb; PARTS],
    probabilities: [f32; PARTS],
}

const PARTS: usize = 6;

/// The last part.
const GLASS: usize = 5;

impl Layered {
    #[inline]
    fn closure(&self, wo: Vec3) -> LayeredClosure {
        let above = ggx::above(wo);
        let (mut opaque, mut glass) = (self.opaque, self.glass);
        if self.film.factor > 0.0 {
            opaque.layer_f0 = self.film.f0(opaque.layer_f0, opaque.layer_f90, opaque.layer_fresnel, above.z);
            opaque.metal_f0 = self.film.f0(opaque.metal_f0, 1.0, LayerFresnel::Schlick, above.z);
            let (color, f0, f90) = (glass.reflectance.color(), opaque.layer_f0, opaque.layer_f90);
            glass.reflectance = GlassReflectance::Between { color, f0, f90 };
        }
        let rough = self.take_rough(&mut opaque);
        let opaque_closure = opaque.closure(above);
        // Layers lie on the outside of solids.
        let lets_in = self.glass_share > 0.0 || self.through != Rgb::ZERO;
        let is_inside = wo.z < 0.0 && lets_in && self.glass.walls == Walls::Solid;
        let (mut coat, mut sheen, mut left) = (0.0, Rgb::ZERO, 1.0);
        if !is_inside && self.coat.factor > 0.0 {
            let taken;
            [coat, taken] = self.coat.shares(wo);
            left -= taken;
        }
        if !is_inside && self.sheen.color != Rgb::ZERO {
            let albedo = self.sheen.albedo(above.z);
            sheen = self.sheen.color * (left * albedo);
            left *= 1.0 - self.sheen.color.max_element() * albedo;
        }
        let of_opaque = left * (1.0 - self.glass_share);
        let through = self.through * (opaque_closure.rest * of_opaque);
        let of_rough = opaque_closure.rest * of_opaque;
        // Where light is refracted as well, radiance inside is of the denser medium for all that arrives there.
        let refracts = self.glass_share > 0.0 && self.glass.walls == Walls::Solid;
        let crossing = self.glass.refraction.at(if refracts { self.glass.eta(wo) } else { 1.0 });
        let of_glass = left * self.glass_share;
        let strength = self.coat.factor * f32::from(u8::from(!is_inside));
        let shares = [
            coat,
            sheen.mean(),
            of_opaque * opaque_closure.albedo,
            through.mean(),
            rough.color.mean() * of_rough,
            // Where all light is reflected there is no glass, and its index means nothing.
            if of_glass > 0.0 { of_glass * glass.albedo_estimate(above.z, wo.z < 0.0) } else { 0.0 },
        ];
        let total: f32 = shares.iter().sum();
        let scale = if total > LEAST_ALBEDO { 1.0 / total } else { 0.0 };
        LayeredClosure {
            weights: [
                Rgb::splat(strength),
                sheen,
                Rgb::splat(of_opaque),
                through * crossing.weight,
                Rgb::splat(of_rough),
                Rgb::splat(of_glass),
            ],
            crossing,
            probabilities: shares.map(|s| s * scale),
            opaque,
            opaque_closure,
            above,
            glass,
            rough,
        }
    }

    /// The diffuse base, taken from the opaque part, where it is rough; a black one elsewhere.
    #[inline]
    fn take_rough(&self, opaque: &mut MetalRough<Microsurface>) -> OrenNayar {
        let mut rough = OrenNayar { color: Rgb::ZERO, roughness: self.diffuse_roughness };
        if self.diffuse_roughness > 0.0 {
            std::mem::swap(&mut rough.color, &mut opaque.diffuse);
        }
        rough
    }

    /// The diffuse part of what [`Lobe::eval`] gives: of the base, of sheen, and of what passes diffusely.
    pub(super) fn eval_diffuse(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let closure = self.closure(wo);
        let has = |part: usize| closure.probabilities[part] > 0.0;
        let mut sum = Rgb::ZERO;
        if (wo.z < 0.0) != (wi.z < 0.0) {
            if has(3) {
                sum += closure.weights[3] * DiffuseThrough.eval(wo, wi).f_cos;
            }
            return sum;
        }
        if has(1) {
            sum += closure.weights[1] * self.sheen.eval(wo, wi).f_cos;
        }
        if has(2) {
            sum += closure.weights[2] * closure.opaque_closure.diffuse * (wi.z.abs() * FRAC_1_PI);
        }
        if has(4) {
            sum += closure.weights[4] * closure.rough.eval(wo, wi).f_cos;
        }
        sum
    }

    #[inline]
    fn eval_closure(&self, closure: &LayeredClosure, wo: Vec3, wi: Vec3) -> BsdfEval {
        let mut sum = BsdfEval::ZERO;
        let mut add = |part: usize, e: BsdfEval| {
            sum.f_cos += closure.weights[part] * e.f_cos;
            sum.pdf_solid_angle += closure.probabilities[part] * e.pdf_solid_angle;
        };
        let has = |part: usize| closure.probabilities[part] > 0.0;
        if (wo.z < 0.0) == (wi.z < 0.0) {
            if has(0) {
                add(0, self.coat.eval(wo, wi));
            }
            if has(1) {
                add(1, self.sheen.eval(wo, wi));
            }
            if has(2) {
                add(
                    2,
                    closure.opaque_closure.eval(
                        &closure.opaque.surface,
                        closure.above,
                        Vec3::new(wi.x, wi.y, wi.z.abs()),
                    ),
                );
            }
            if has(4) {
                add(4, closure.rough.eval(wo, wi));
            }
        } else if has(3) {
            add(3, DiffuseThrough.eval(wo, wi));
        }
        if has(GLASS) {
            add(GLASS, closure.glass.eval(wo, wi));
        }
        sum
    }
}

impl Lobe for Layered {
    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 3]) -> BsdfSample {
        let closure = self.closure(wo);
        let (mut part, mut rest) = (0, u[2]);
        while part < PARTS - 1 && rest >= closure.probabilities[part] {
            rest -= closure.probabilities[part];
            part += 1;
        }
        let probability = closure.probabilities[part];
        // Rounding may lead to the last part, whatever its probability.
        if probability <= LEAST_ALBEDO {
            return BsdfSample::ABSORBED;
        }
        let u = [u[0], u[1], (rest / probability).min(1.0f32.next_down())];
        let s = match part {
            0 => self.coat.sample(wo, u),
            1 => self.sheen.sample(wo, u),
            2 => closure.opaque_closure.sample(&closure.opaque.surface, wo, closure.above, u),
            3 => {
                let Refracted { eta, flux, .. } = closure.crossing;
                BsdfSample { eta, flux, ..DiffuseThrough.sample(wo, u) }
            }
            4 => closure.rough.sample(wo, u),
            _ => closure.glass.sample(wo, u),
        };
        if s.is_specular {
            let weight = s.weight * closure.weights[part] / probability;
            return BsdfSample { weight, pdf_solid_angle: s.pdf_solid_angle * probability, ..s };
        }
        if s.pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        let e = self.eval_closure(&closure, wo, s.wi);
        if e.pdf_solid_angle <= 0.0 {
            return BsdfSample::ABSORBED;
        }
        BsdfSample { weight: e.f_cos / e.pdf_solid_angle, pdf_solid_angle: e.pdf_solid_angle, ..s }
    }

    #[inline]
    fn eval(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        self.eval_closure(&self.closure(wo), wo, wi)
    }

    #[inline]
    fn is_specular(&self) -> bool {
        let coat = self.coat.factor == 0.0 || self.coat.is_mirror();
        let opaque = self.glass_share >= 1.0 || (self.opaque.is_specular() && self.through == Rgb::ZERO);
        let glass = self.glass_share <= 0.0 || self.glass.is_smooth();
        coat && opaque && glass && self.sheen.color == Rgb::ZERO
    }

    #[inline]
    fn tinted(mut self, color: Rgb) -> Self {
        self.opaque.diffuse *= color;
        self.opaque.metal_f0 *= color;
        self.glass.tint *= color;
        self
    }

    #[inline]
    fn albedo(&self) -> Rgb {
        let opaque = (self.opaque.albedo() + self.through).min(Rgb::ONE);
        opaque * (1.0 - self.glass_share) + self.glass.tint * self.glass_share
    }
}

impl Transmissive for Layered {
    const SCATTERS_THROUGH: bool = true;
    const REFRACTS: bool = true;
    const TURNS_OVER: bool = false;

    #[inline(always)]
    fn with_ior(mut self, ior: f32) -> Self {
        self.glass.ior = ior;
        self
    }

    #[inline(always)]
    fn crossing_tint(&self) -> Rgb {
        self.glass.tint
    }

    #[inline]
    fn straight(&self, wo: Vec3) -> Rgb {
        let closure = self.closure(wo);
        closure.weights[GLASS] * closure.glass.straight(wo)
    }
}

impl<S: Facets> MetalRough<S> {
    /// The same material on another surface.
    pub fn on<T>(self, surface: T) -> MetalRough<T> {
        MetalRough {
            diffuse: self.diffuse,
            layer_f0: self.layer_f0,
            layer_f90: self.layer_f90,
            layer_fresnel: self.layer_fresnel,
            metal_f0: self.metal_f0,
            metallic: self.metallic,
            surface,
            energy_compensation: self.energy_compensation,
        }
    }
}
