//! The glTF material with all layers: clearcoat and sheen over an optional thin film over metal, diffuse base and glass.
//!
//! Layers follow the glTF 2.0 appendix and its extensions with one deviation: a layer attenuates the layers below by 1 - E(wo), with E
//! its directional albedo, rather than by the Fresnel term 1 - F(v.h), so that a white layered surface conserves energy exactly.
//! From the top: coat, sheen, base.
//!
//! The base mixes glass, of weight transmission * (1 - metallic), with the opaque material of the same interface, which may include
//! diffuse transmission. From the inside of a solid only the base counts: light on its way out is not attenuated by the layers.
//! Energy is conserved on both sides, but transmission through layers is not reciprocal.

use super::dielectric::tint_of_crossing;
use super::diffuse::{LambertTransmission, OrenNayar};
use super::fresnel::LayerFresnel;
use super::ggx::DirectionalAlbedo;
use super::lobe::{LocalFrame, MIN_ALBEDO, MaterialProgram, Refracted, Slots, is_always};
use super::metal::FacetReflection;
use super::metal_rough::{MetalRough, MetalRoughClosure, MetalRoughProgram};
use super::microsurface::{Facets, Isotropic, Microsurface, MicrosurfaceProgram};
use super::rough_dielectric::{GlassReflectance, RoughDielectric, Walls};
use super::sheen::Sheen;
use super::subsurface::SubsurfaceBoundary;
use super::thin_film::ThinFilm;
use super::{Appearance, BsdfEval, BsdfSample, Lobe, Refraction, Transmissive, ggx};
use crate::color::Rgb;
use crate::math::{Frame, Vec3};
use crate::scene::{
    Clearcoat, ColorSlot, DiffuseTransmission, EnergyCompensation, FloatSlot, FresnelModel, GlassReflection,
    Iridescence, PbrMaterial, ShadingModel, SkippedCaustics,
};
use std::f32::consts::FRAC_1_PI;

/// All layers and bases of a glTF material; absent ones have weight 0.
#[derive(Clone, Copy, Debug)]
pub struct Layered {
    /// Diffuse base under the dielectric interface, and metal.
    pub opaque: MetalRough<Microsurface>,
    /// Roughness 0..1 of the diffuse base by [`OrenNayar`]; 0 is Lambert's law.
    pub diffuse_roughness: f32,
    /// Albedo of diffuse transmission, under the same interface.
    pub transmission_albedo: Rgb,
    /// The body that scatters the transmitted light; `None` without subsurface scattering.
    pub body: Option<SubsurfaceBoundary>,
    /// Glass of the same interface.
    pub glass: RoughDielectric,
    /// Weight of `glass`, 0..1; the opaque material and `transmission_albedo` have weight 1 - `glass_share`.
    pub glass_share: f32,
    /// Thin film on the interface.
    pub film: ThinFilm,
    /// Sheen above the base.
    pub sheen: Sheen,
    /// Clearcoat above all.
    pub coat: Coat,
}

/// The components for one view direction. The BSDF's value is the sum of the components' values times their weights; selection
/// probabilities add up to 1.
struct LayeredClosure {
    opaque: MetalRough<Microsurface>,
    opaque_closure: MetalRoughClosure,
    above: Vec3,
    glass: RoughDielectric,
    /// The diffuse base if it is rough; then `opaque` has none.
    rough: OrenNayar,
    /// Scaling of diffusely transmitted light by refraction.
    crossing: Refracted,
    /// Weights of the components, from [`COAT`] to [`GLASS`].
    weights: [Rgb; PARTS],
    probabilities: [f32; PARTS],
}

/// Number of components.
const PARTS: usize = 6;

// Indices of the components.
const COAT: usize = 0;
const SHEEN: usize = 1;
const OPAQUE: usize = 2;
const DIFFUSE_TRANSMISSION: usize = 3;
const ROUGH_DIFFUSE: usize = 4;
const GLASS: usize = 5;

impl Layered {
    /// Removes glossy reflection or transmission; sheen and diffuse components remain.
    pub(super) fn remove_lobes(&mut self, skipped: SkippedCaustics) {
        if skipped.reflective {
            self.opaque.remove_reflection();
            (self.coat.factor, self.film.factor) = (0.0, 0.0);
        }
        self.glass.remove_lobes(skipped);
    }

    /// Value of diffuse transmission, or of the subsurface boundary, for a `transmission_albedo` of 1.
    #[inline(always)]
    fn eval_transmission(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        self.body.map_or_else(|| LambertTransmission.eval(wo, wi), |body| body.eval(wo, wi))
    }

    /// The opaque and the refracting base with the reflectance of the thin film, for a cosine of the direction.
    #[inline(always)]
    fn coated_by_film(&self, cos: f32) -> (MetalRough<Microsurface>, RoughDielectric) {
        let (mut opaque, mut glass) = (self.opaque, self.glass);
        if self.film.factor > 0.0 {
            opaque.layer_f0 = self.film.f0(opaque.layer_f0, opaque.layer_f90, opaque.layer_fresnel, cos);
            opaque.metal_f0 = self.film.f0(opaque.metal_f0, 1.0, LayerFresnel::Schlick, cos);
            let (color, f0, f90) = (glass.reflectance.color(), opaque.layer_f0, opaque.layer_f90);
            glass.reflectance = GlassReflectance::Remapped { color, f0, f90 };
        }
        (opaque, glass)
    }

    #[inline]
    fn closure(&self, wo: Vec3) -> LayeredClosure {
        let above = ggx::to_upper_side(wo);
        let (mut opaque, glass) = self.coated_by_film(above.z);
        let rough = self.take_rough(&mut opaque);
        let opaque_closure = opaque.closure(above);
        // Layers lie on the outside of solids.
        let transmits_light = self.glass_share > 0.0 || self.transmission_albedo != Rgb::ZERO;
        let is_inside = wo.z < 0.0 && transmits_light && self.glass.walls == Walls::Solid;
        let (mut coat, mut sheen, mut remaining) = (0.0, Rgb::ZERO, 1.0);
        if !is_inside && self.coat.factor > 0.0 {
            let attenuation;
            [coat, attenuation] = self.coat.albedo_and_attenuation(wo);
            remaining -= attenuation;
        }
        if !is_inside && self.sheen.color != Rgb::ZERO {
            let albedo = self.sheen.albedo(above.z);
            sheen = self.sheen.color * (remaining * albedo);
            // The weight of sheen may be above 1.
            remaining *= (1.0 - self.sheen.color.max_element() * albedo).max(0.0);
        }
        let opaque_weight = remaining * (1.0 - self.glass_share);
        // As in Cycles, light leaves the body of subsurface scattering without reflection.
        let leaves_body = is_inside && self.body.is_some();
        let (opaque_weight, crossing_weight) = match leaves_body {
            true => (0.0, opaque_weight),
            false => (opaque_weight, opaque_closure.layer_transmittance * opaque_weight),
        };
        let transmitted = self.transmission_albedo * crossing_weight;
        let rough_weight = opaque_closure.layer_transmittance * opaque_weight;
        // If the surface also refracts, radiance inside is scaled by the squared index.
        let refracts = self.glass_share > 0.0 && self.glass.walls == Walls::Solid;
        let crossing = self.glass.refraction.at(if refracts { self.glass.eta(wo) } else { 1.0 });
        let glass_weight = remaining * self.glass_share;
        let coat_weight = self.coat.factor * f32::from(u8::from(!is_inside));
        // Estimated albedo of each component, the unnormalised selection probability.
        let albedos = [
            coat,
            sheen.mean(),
            opaque_weight * opaque_closure.albedo,
            transmitted.mean(),
            rough.color.mean() * rough_weight,
            // Without glass the index may be invalid.
            if glass_weight > 0.0 { glass_weight * glass.albedo_estimate(above.z, wo.z < 0.0) } else { 0.0 },
        ];
        let total: f32 = albedos.iter().sum();
        let scale = if total > MIN_ALBEDO { 1.0 / total } else { 0.0 };
        LayeredClosure {
            weights: [
                Rgb::splat(coat_weight),
                sheen,
                Rgb::splat(opaque_weight),
                transmitted * crossing.weight,
                Rgb::splat(rough_weight),
                Rgb::splat(glass_weight),
            ],
            crossing,
            probabilities: albedos.map(|albedo| albedo * scale),
            opaque,
            opaque_closure,
            above,
            glass,
            rough,
        }
    }

    /// The diffuse base as attenuated by the layers above for `wo`, and its fraction of the directional albedo.
    pub(super) fn base(&self, wo: Vec3) -> (OrenNayar, f32) {
        let LayeredClosure { opaque_closure, rough, weights, probabilities, .. } = self.closure(wo);
        if self.diffuse_roughness > 0.0 {
            return (
                OrenNayar { color: rough.color * weights[ROUGH_DIFFUSE], ..rough },
                probabilities[ROUGH_DIFFUSE],
            );
        }
        let color = opaque_closure.diffuse * weights[OPAQUE];
        (OrenNayar { color, roughness: 0.0 }, probabilities[OPAQUE] * opaque_closure.probability_diffuse)
    }

    /// Moves a rough diffuse base out of the opaque component; black if the base is Lambertian.
    #[inline]
    fn take_rough(&self, opaque: &mut MetalRough<Microsurface>) -> OrenNayar {
        let mut rough = OrenNayar { color: Rgb::ZERO, roughness: self.diffuse_roughness };
        if self.diffuse_roughness > 0.0 {
            std::mem::swap(&mut rough.color, &mut opaque.diffuse);
        }
        rough
    }

    /// The diffuse components of [`Lobe::eval`]: base, sheen and diffuse transmission.
    pub(super) fn eval_diffuse(&self, wo: Vec3, wi: Vec3) -> Rgb {
        let closure = self.closure(wo);
        let has = |part: usize| closure.probabilities[part] > 0.0;
        let mut sum = Rgb::ZERO;
        if (wo.z < 0.0) != (wi.z < 0.0) {
            if has(DIFFUSE_TRANSMISSION) {
                sum += closure.weights[DIFFUSE_TRANSMISSION] * self.eval_transmission(wo, wi).f_cos;
            }
            return sum;
        }
        if has(SHEEN) {
            sum += closure.weights[SHEEN] * self.sheen.eval(wo, wi).f_cos;
        }
        if has(OPAQUE) {
            sum += closure.weights[OPAQUE] * closure.opaque_closure.diffuse * (wi.z.abs() * FRAC_1_PI);
        }
        if has(ROUGH_DIFFUSE) {
            sum += closure.weights[ROUGH_DIFFUSE] * closure.rough.eval(wo, wi).f_cos;
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
            if has(COAT) {
                add(COAT, self.coat.eval(wo, wi));
            }
            if has(SHEEN) {
                add(SHEEN, self.sheen.eval(wo, wi));
            }
            if has(OPAQUE) {
                add(
                    OPAQUE,
                    closure.opaque_closure.eval(
                        &closure.opaque.surface,
                        closure.above,
                        Vec3::new(wi.x, wi.y, wi.z.abs()),
                    ),
                );
            }
            if has(ROUGH_DIFFUSE) {
                add(ROUGH_DIFFUSE, closure.rough.eval(wo, wi));
            }
        } else if has(DIFFUSE_TRANSMISSION) {
            add(DIFFUSE_TRANSMISSION, self.eval_transmission(wo, wi));
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
        let (mut part, mut rest) = (COAT, u[2]);
        while part < PARTS - 1 && rest >= closure.probabilities[part] {
            rest -= closure.probabilities[part];
            part += 1;
        }
        let probability = closure.probabilities[part];
        // Rounding may select the last component even if its probability is 0.
        if probability <= MIN_ALBEDO {
            return BsdfSample::ABSORBED;
        }
        let u = [u[0], u[1], (rest / probability).min(1.0f32.next_down())];
        let s = match part {
            COAT => self.coat.sample(wo, u),
            SHEEN => self.sheen.sample(wo, u),
            OPAQUE => closure.opaque_closure.sample(&closure.opaque.surface, wo, closure.above, u),
            DIFFUSE_TRANSMISSION => {
                let Refracted { eta, flux, .. } = closure.crossing;
                let sample =
                    self.body.map_or_else(|| LambertTransmission.sample(wo, u), |body| body.sample(wo, u));
                BsdfSample { eta, flux, ..sample }
            }
            ROUGH_DIFFUSE => closure.rough.sample(wo, u),
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
        let opaque =
            self.glass_share >= 1.0 || (self.opaque.is_specular() && self.transmission_albedo == Rgb::ZERO);
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
        let opaque = (self.opaque.albedo() + self.transmission_albedo).min(Rgb::ONE);
        opaque * (1.0 - self.glass_share) + self.glass.tint * self.glass_share
    }

    fn appearance(&self) -> Appearance {
        let opaque = self.opaque.appearance();
        let glass = self.glass.appearance();
        let mix = |a: Rgb, b: Rgb| (a * (1.0 - self.glass_share) + b * self.glass_share).min(Rgb::ONE);
        Appearance {
            diffuse: mix(opaque.diffuse + self.transmission_albedo + self.sheen.color, Rgb::ZERO),
            glossy: mix(opaque.glossy, glass.glossy),
            transmission: mix(Rgb::ZERO, glass.transmission),
            roughness: opaque.roughness,
        }
    }

    fn diffuse_part(&self, wo: Vec3, wi: Vec3) -> Rgb {
        self.eval_diffuse(wo, wi)
    }
}

impl Transmissive for Layered {
    const HAS_SCATTERED_TRANSMISSION: bool = true;
    const REFRACTS: bool = true;
    const SIDES_MAY_SWAP: bool = false;

    #[inline(always)]
    fn with_ior(mut self, ior: f32) -> Self {
        self.glass.ior = ior;
        self
    }

    #[inline(always)]
    fn transmission_tint(&self) -> Rgb {
        self.glass.tint
    }

    #[inline]
    fn straight(&self, wo: Vec3) -> Rgb {
        let closure = self.closure(wo);
        closure.weights[GLASS] * closure.glass.straight(wo)
    }
}

impl<S: Facets> MetalRough<S> {
    /// The same material with another microfacet distribution.
    pub fn with_surface<T>(self, surface: T) -> MetalRough<T> {
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

// Programs of glTF materials, and the conditions under which a simpler BSDF is equivalent.

/// Whether the material may have glass. (An index of refraction of 0 means total reflection.)
pub(super) fn transmits(pbr: &PbrMaterial) -> bool {
    !is_always(&pbr.transmission, 0.0) && pbr.ior > 0.0 && !is_always(&pbr.metallic, 1.0)
}

/// Whether the dielectric's reflectance follows from its index of refraction alone (no KHR_materials_specular).
pub(super) fn has_default_specular(pbr: &PbrMaterial) -> bool {
    is_always(&pbr.specular, 1.0) && pbr.specular_color == ColorSlot::constant([1.0; 3])
}

/// Whether the material needs [`Layered`].
pub(super) fn is_layered(pbr: &PbrMaterial) -> bool {
    pbr.clearcoat.is_some()
        || pbr.sheen.is_some()
        || pbr.iridescence.is_some()
        || pbr.diffuse_transmission.is_some()
}

/// Whether there may be a diffuse base that isn't Lambertian.
pub(super) fn is_rough_diffuse(pbr: &PbrMaterial) -> bool {
    !is_always(&pbr.diffuse_roughness, 0.0) && !is_always(&pbr.metallic, 1.0)
}

/// The microfacets of a material.
pub(super) fn facets(pbr: &PbrMaterial) -> MicrosurfaceProgram {
    MicrosurfaceProgram { roughness: pbr.roughness, anisotropy: pbr.anisotropy }
}

/// Whether the material is solid or thin-walled. Cycles' glass, which keeps radiance, refracts as a solid even without a volume.
pub(super) fn walls(pbr: &PbrMaterial) -> Walls {
    if pbr.has_volume || pbr.keeps_radiance { Walls::Solid } else { Walls::Thin }
}

/// Scaling of radiance by refraction.
pub(super) fn refraction(pbr: &PbrMaterial) -> Refraction {
    if pbr.keeps_radiance { Refraction::KeepsRadiance } else { Refraction::Scales }
}

/// The parameters of a [`Layered`].
#[derive(Clone, Copy, Debug)]
pub struct LayeredProgram {
    opaque: MetalRoughProgram,
    facets: MicrosurfaceProgram,
    diffuse_roughness: FloatSlot,
    /// Transmission weight; `None` without glass.
    transmission: Option<FloatSlot>,
    ior: f32,
    walls: Walls,
    refraction: Refraction,
    tints_once: bool,
    /// Colour of the glass's reflection.
    reflection: GlassReflection,
    /// See [`has_default_specular`].
    has_default_specular: bool,
    coat_fresnel: LayerFresnel,
    clearcoat: Option<Clearcoat>,
    sheen: Option<crate::scene::Sheen>,
    iridescence: Option<Iridescence>,
    diffuse_transmission: Option<DiffuseTransmission>,
}

impl LayeredProgram {
    pub(super) fn new(pbr: &PbrMaterial, shading: ShadingModel) -> LayeredProgram {
        LayeredProgram {
            opaque: MetalRoughProgram::new(pbr, shading),
            facets: facets(pbr),
            diffuse_roughness: pbr.diffuse_roughness,
            transmission: transmits(pbr).then_some(pbr.transmission),
            ior: pbr.ior,
            walls: walls(pbr),
            refraction: refraction(pbr),
            tints_once: pbr.tints_once,
            reflection: pbr.glass_reflection,
            has_default_specular: has_default_specular(pbr),
            coat_fresnel: Coat::fresnel(shading.fresnel),
            clearcoat: pbr.clearcoat,
            sheen: pbr.sheen,
            iridescence: pbr.iridescence,
            diffuse_transmission: pbr.diffuse_transmission,
        }
    }

    /// The body of subsurface scattering, with the facets of the surface.
    fn body(&self, facets: Microsurface) -> Option<SubsurfaceBoundary> {
        let through = self.diffuse_transmission.as_ref()?;
        through.subsurface.map(|entry| SubsurfaceBoundary::new(entry, facets))
    }

    /// Whether there may be glass.
    pub fn has_glass(&self) -> bool {
        self.transmission.is_some()
    }
}

impl MaterialProgram for LayeredProgram {
    type Lobe = Layered;

    fn evaluate(&self, slots: &impl Slots, frame: &LocalFrame) -> Layered {
        let energy_compensation = self.opaque.energy_compensation;
        let surface = self.facets.evaluate(slots, frame);
        let metal_rough = self.opaque.evaluate(slots, frame);
        // As reflectance of the metal it is not yet scaled by weights.
        let base_color = metal_rough.metal_f0;
        let mut opaque = metal_rough.with_surface(surface);
        let reflectance = match self.has_default_specular {
            true => GlassReflectance::colored(self.reflection),
            false => GlassReflectance::Remapped {
                color: self.reflection,
                f0: opaque.layer_f0,
                f90: opaque.layer_f90,
            },
        };
        let dielectric = 1.0 - opaque.metallic;
        let transmission = self.transmission.as_ref().map_or(0.0, |slot| slots.clamped_number(slot));
        let glass_share = dielectric * transmission;
        // Normalises weights to the part that is not glass.
        let rest = 1.0 / (1.0 - glass_share).max(f32::MIN_POSITIVE);
        let diffuse = (dielectric * (1.0 - transmission) * rest).min(1.0);
        opaque.metallic = (opaque.metallic * rest).min(1.0);
        let (diffuse_transmission, color) = self
            .diffuse_transmission
            .as_ref()
            .map_or((0.0, Rgb::ZERO), |d| (slots.clamped_number(&d.factor), slots.reflectance(&d.color)));
        opaque.diffuse = base_color * (diffuse * (1.0 - diffuse_transmission));
        let tint = tint_of_crossing(base_color, self.tints_once);
        let (ior, walls, refraction) = (self.ior, self.walls, self.refraction);
        Layered {
            opaque,
            diffuse_roughness: slots.clamped_number(&self.diffuse_roughness),
            transmission_albedo: color * (diffuse * diffuse_transmission),
            body: self.body(surface),
            glass: RoughDielectric {
                surface,
                ior,
                walls,
                refraction,
                tint,
                reflectance,
                energy_compensation,
                is_beckmann: false,
            },
            glass_share,
            film: self.iridescence.as_ref().map_or(ThinFilm::NONE, |i| film(i, slots)),
            sheen: self.sheen.as_ref().map_or(Sheen::NONE, |s| Sheen {
                color: slots.clamped_color(&s.color),
                roughness: slots.clamped_number(&s.roughness),
            }),
            coat: self.clearcoat.as_ref().map_or(Coat::NONE, |c| Coat {
                factor: slots.clamped_number(&c.factor),
                alpha: slots.alpha(&c.roughness),
                normal: frame.coat_normal,
                fresnel: self.coat_fresnel,
                energy_compensation,
            }),
        }
    }

    fn may_transmit_unscattered(&self) -> bool {
        self.transmission.is_some() && self.walls == Walls::Thin && is_always(&self.facets.roughness, 0.0)
    }

    fn depends_on_wavelength(&self) -> bool {
        self.iridescence.is_some()
    }
}

fn film(iridescence: &Iridescence, slots: &impl Slots) -> ThinFilm {
    let Iridescence { factor, ior, thickness_min_nm, thickness_max_nm, thickness_texture } = *iridescence;
    let blend = slots.clamped_number(&FloatSlot { factor: 1.0, texture: thickness_texture });
    let thickness_nm = thickness_min_nm + (thickness_max_nm - thickness_min_nm) * blend;
    ThinFilm {
        factor: slots.clamped_number(&factor),
        ior: ior.max(1.0),
        thickness_nm: thickness_nm.max(0.0),
        wavelengths_nm: slots.wavelengths().map_or([0.0; 3], |waves| waves.nm),
    }
}

/// Index of refraction of the coat, fixed by KHR_materials_clearcoat.
const IOR: f32 = 1.5;

/// Reflectance of the coat at normal incidence.
const F0: Rgb = Rgb::splat(0.04);

/// A clear dielectric layer on top of the others (KHR_materials_clearcoat), with a normal of its own. Its transmittance is one minus
/// its directional albedo.
#[derive(Clone, Copy, Debug)]
pub struct Coat {
    /// Weight, 0..1; 0 for no coat.
    pub factor: f32,
    /// GGX alpha; below [`super::ggx::MIN_ALPHA`] an exact mirror.
    pub alpha: f32,
    /// Unit normal in the frame of the BSDF, z above 0.
    pub normal: Vec3,
    /// Fresnel term between 0.04 and 1; see [`Coat::fresnel`].
    pub fresnel: LayerFresnel,
    /// Energy compensation of single scattering.
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

    /// The coat's Fresnel term by a Fresnel model.
    #[inline(always)]
    pub fn fresnel(model: FresnelModel) -> LayerFresnel {
        LayerFresnel::new(model, IOR)
    }

    /// The reflection lobe of a coat of weight 1, in the coat's frame.
    #[inline(always)]
    fn lobe(&self) -> FacetReflection<Isotropic, impl Fn(f32) -> Rgb> {
        let Coat { alpha, fresnel, energy_compensation, .. } = *self;
        let reflectance = move |cosine| fresnel.reflectance(F0, Rgb::ONE, cosine);
        FacetReflection { facets: Isotropic { alpha }, f0: F0, reflectance, energy_compensation }
    }

    /// Whether the coat is an exact mirror.
    #[inline(always)]
    pub fn is_mirror(&self) -> bool {
        self.lobe().is_mirror()
    }

    /// The coat's directional albedo, and the fraction of light by which it attenuates the layers below, both times its weight. They
    /// are equal except without energy compensation, where light lost between facets must not reach the layers below either (as in
    /// [`super::MetalRough`]).
    #[inline(always)]
    pub fn albedo_and_attenuation(&self, wo: Vec3) -> [f32; 2] {
        let cosine = wo.dot(self.normal).abs().clamp(ggx::MIN_COS, 1.0);
        let mut white_albedo = 1.0;
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
                white_albedo = table.full;
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
        [albedo, albedo / white_albedo].map(|fraction| (self.factor * fraction).min(1.0))
    }

    /// See [`super::Bsdf::sample`], for a coat of weight 1. Reflections below the surface of the base are lost.
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

    /// See [`super::Bsdf::eval`], for a coat of weight 1.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::{Bsdf, Isotropic};
    use crate::sampling::chi2::Random;

    /// [`Lobe::diffuse_part`] is the difference between the material and its glossy lobe.
    #[test]
    fn diffuse_and_glossy_parts_add_up() {
        let m = MetalRough {
            diffuse: Rgb::new(0.5, 0.3, 0.1),
            layer_f0: Rgb::splat(0.04),
            layer_f90: 1.0,
            layer_fresnel: LayerFresnel::Schlick,
            metal_f0: Rgb::ZERO,
            metallic: 0.0,
            surface: Isotropic { alpha: 0.3 },
            energy_compensation: EnergyCompensation::On,
        };
        let layered = Layered {
            opaque: m.with_surface(Microsurface::isotropic(0.3)),
            diffuse_roughness: 0.0,
            transmission_albedo: Rgb::ZERO,
            body: None,
            glass: RoughDielectric {
                surface: Microsurface::isotropic(0.3),
                ior: 1.5,
                walls: Walls::Thin,
                refraction: Refraction::Scales,
                tint: Rgb::ONE,
                reflectance: GlassReflectance::Plain,
                energy_compensation: EnergyCompensation::On,
                is_beckmann: false,
            },
            glass_share: 0.0,
            film: ThinFilm::NONE,
            sheen: Sheen::NONE,
            coat: Coat::NONE,
        };
        let mut random = Random::new(5);
        for _ in 0..1000 {
            let (mut wo, mut wi) = (random.direction(), random.direction());
            (wo.z, wi.z) = (wo.z.abs(), wi.z.abs());
            let all = m.eval(wo, wi).f_cos.to_array();
            let facets = MetalRough { diffuse: Rgb::ZERO, ..m }.eval(wo, wi).f_cos.to_array();
            let diffuse = Bsdf::MetalRough(m).diffuse_part(wo, wi).to_array();
            let other = Bsdf::Layered(layered).diffuse_part(wo, wi).to_array();
            for c in 0..3 {
                assert!((all[c] - facets[c] - diffuse[c]).abs() < 1e-5 * all[c].max(1.0), "{wo} {wi}");
                assert!((diffuse[c] - other[c]).abs() < 1e-5, "{wo} {wi}");
            }
        }
        assert_eq!(m.appearance().diffuse, m.diffuse);
        assert!((m.appearance().roughness - 0.3f32.sqrt()).abs() < 1e-6);
    }
}
