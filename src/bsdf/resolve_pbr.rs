//! From the glTF material to the simplest BSDF that is equivalent to it.

use super::resolve::{BsdfClass, LocalFrame, ShadingModel, Slots, always};
use super::{
    Bsdf, Coat, Dielectric, GlassReflectance, Isotropic, Lambert, LayerFresnel, Layered, MetalRough,
    Microsurface, RoughDielectric, SchlickMetal, Sheen, ThinDielectric, ThinFilm, Walls, fresnel,
};
use crate::color::Rgb;
use crate::math::{Vec2, poly};
use crate::scene::{ColorSlot, EnergyCompensation, FloatSlot, FresnelModel, PbrMaterial};

/// Can light pass the interface? An index of refraction of 0 means that all is reflected.
fn transmits(pbr: &PbrMaterial) -> bool {
    !always(&pbr.transmission, 0.0) && pbr.ior > 0.0 && !always(&pbr.metallic, 1.0)
}

/// Is the dielectric's reflectance that of its index of refraction?
fn is_plain(pbr: &PbrMaterial) -> bool {
    always(&pbr.specular, 1.0) && pbr.specular_color == ColorSlot::constant([1.0; 3])
}

/// Is there something that only [`Layered`] has?
fn is_layered(pbr: &PbrMaterial) -> bool {
    pbr.clearcoat.is_some()
        || pbr.sheen.is_some()
        || pbr.iridescence.is_some()
        || pbr.diffuse_transmission.is_some()
}

/// See [`super::class_of`].
pub(super) fn class_of_pbr(pbr: &PbrMaterial) -> BsdfClass {
    let is_dielectric = always(&pbr.metallic, 0.0);
    if is_layered(pbr) {
        return BsdfClass::Layered;
    }
    if transmits(pbr) {
        let is_clear = is_dielectric && always(&pbr.transmission, 1.0) && is_plain(pbr);
        return match (is_clear, always(&pbr.roughness, 0.0) && pbr.anisotropy.is_none(), pbr.has_volume) {
            (true, true, true) => BsdfClass::Dielectric,
            (true, true, false) => BsdfClass::ThinDielectric,
            (true, false, _) => BsdfClass::RoughDielectric,
            (false, ..) => BsdfClass::Layered,
        };
    }
    if is_dielectric && always(&pbr.specular, 0.0) {
        // Without a reflection on top, roughness means nothing.
        let black = pbr.base_color.texture.is_none() && pbr.base_color.factor == [0.0; 3];
        return if black { BsdfClass::Black } else { BsdfClass::Lambert };
    }
    match (pbr.anisotropy.is_some(), always(&pbr.metallic, 1.0)) {
        (true, _) => BsdfClass::Layered,
        (false, true) => BsdfClass::SchlickMetal,
        (false, false) => BsdfClass::MetalRough,
    }
}

/// See [`super::resolve`].
#[inline]
pub(super) fn resolve_pbr(
    pbr: &PbrMaterial,
    slots: &impl Slots,
    frame: &LocalFrame,
    shading: ShadingModel,
) -> Bsdf {
    let base = slots.color(&pbr.base_color).clamp(Rgb::ZERO, Rgb::ONE);
    match class_of_pbr(pbr) {
        BsdfClass::Black => Bsdf::Black,
        BsdfClass::Lambert => Bsdf::Lambert(Lambert { albedo: base }),
        BsdfClass::SchlickMetal => {
            let roughness = slots.number(&pbr.roughness).clamp(0.0, 1.0);
            Bsdf::SchlickMetal(SchlickMetal {
                f0: base,
                alpha: roughness * roughness,
                energy_compensation: shading.energy_compensation,
            })
        }
        BsdfClass::Dielectric => {
            Bsdf::Dielectric(Dielectric { ior: pbr.ior, tint: tint(pbr, base), fresnel: FresnelModel::Exact })
        }
        BsdfClass::ThinDielectric => Bsdf::ThinDielectric(ThinDielectric { ior: pbr.ior, tint: base }),
        BsdfClass::RoughDielectric => {
            let surface = microsurface(pbr, slots, frame);
            Bsdf::RoughDielectric(glass(
                pbr,
                base,
                surface,
                GlassReflectance::Plain,
                shading.energy_compensation,
            ))
        }
        BsdfClass::MetalRough => Bsdf::MetalRough(metal_rough(pbr, base, slots, shading)),
        _ => Bsdf::Layered(layered(pbr, base, slots, frame, shading)),
    }
}

#[inline]
fn metal_rough(pbr: &PbrMaterial, base: Rgb, slots: &impl Slots, shading: ShadingModel) -> MetalRough {
    let number = |slot| slots.number(slot).clamp(0.0, 1.0);
    let (metallic, specular) = (number(&pbr.metallic), number(&pbr.specular));
    let roughness = number(&pbr.roughness);
    // KHR_materials_ior: 0 means that all light is reflected. KHR_materials_specular: f0 is clamped before the factor.
    let normal = if pbr.ior == 0.0 { 1.0 } else { fresnel::f0_from_eta(pbr.ior) };
    let tint = slots.color(&pbr.specular_color).max(Rgb::ZERO);
    MetalRough {
        diffuse: base * (1.0 - metallic),
        layer_f0: (tint * normal).min(Rgb::ONE) * specular,
        layer_f90: specular,
        layer_fresnel: LayerFresnel::new(shading.fresnel, pbr.ior),
        metal_f0: base,
        metallic,
        surface: Isotropic { alpha: roughness * roughness },
        energy_compensation: shading.energy_compensation,
    }
}

/// The facets, stretched by KHR_materials_anisotropy.
fn microsurface(pbr: &PbrMaterial, slots: &impl Slots, frame: &LocalFrame) -> Microsurface {
    let roughness = slots.number(&pbr.roughness).clamp(0.0, 1.0);
    let alpha = roughness * roughness;
    let Some(anisotropy) = pbr.anisotropy else { return Microsurface::isotropic(alpha) };
    let (mut strength, mut direction) = (anisotropy.strength, Vec2::X);
    if let Some(id) = anisotropy.texture {
        let t = slots.color(&ColorSlot::texture(id));
        direction = Vec2::new(2.0 * t.r - 1.0, 2.0 * t.g - 1.0).try_normalize().unwrap_or(Vec2::X);
        strength *= t.b;
    }
    let (sine, cosine) = poly::sin_cos(anisotropy.rotation_rad);
    let turned =
        Vec2::new(direction.x * cosine - direction.y * sine, direction.x * sine + direction.y * cosine);
    let axis = (frame.tangent * turned.x + frame.bitangent * turned.y).try_normalize().unwrap_or(Vec2::X);
    let strength = strength.clamp(0.0, 1.0);
    let along = alpha + (1.0 - alpha) * strength * strength;
    Microsurface::new([along, alpha], axis.to_array())
}

/// The factor on transmitted light at one crossing of the surface.
#[inline(always)]
fn tint(pbr: &PbrMaterial, base: Rgb) -> Rgb {
    if pbr.tints_once { base.map(f32::sqrt) } else { base }
}

fn glass(
    pbr: &PbrMaterial,
    base: Rgb,
    surface: Microsurface,
    reflectance: GlassReflectance,
    energy_compensation: EnergyCompensation,
) -> RoughDielectric {
    let walls = if pbr.has_volume { Walls::Solid } else { Walls::Thin };
    RoughDielectric { surface, ior: pbr.ior, walls, tint: tint(pbr, base), reflectance, energy_compensation }
}

fn layered(
    pbr: &PbrMaterial,
    base: Rgb,
    slots: &impl Slots,
    frame: &LocalFrame,
    shading: ShadingModel,
) -> Layered {
    let number = |slot| slots.number(slot).clamp(0.0, 1.0);
    let surface = microsurface(pbr, slots, frame);
    let mut opaque = metal_rough(pbr, base, slots, shading).on(surface);
    let reflectance = match is_plain(pbr) {
        true => GlassReflectance::Plain,
        false => GlassReflectance::Between { f0: opaque.layer_f0, f90: opaque.layer_f90 },
    };
    let dielectric = 1.0 - opaque.metallic;
    let transmission = if transmits(pbr) { number(&pbr.transmission) } else { 0.0 };
    let glass_share = dielectric * transmission;
    // Shares of what is not glass.
    let rest = 1.0 / (1.0 - glass_share).max(f32::MIN_POSITIVE);
    let diffuse = (dielectric * (1.0 - transmission) * rest).min(1.0);
    opaque.metallic = (opaque.metallic * rest).min(1.0);
    let (passing, color) = pbr
        .diffuse_transmission
        .as_ref()
        .map_or((0.0, Rgb::ZERO), |d| (number(&d.factor), slots.color(&d.color).clamp(Rgb::ZERO, Rgb::ONE)));
    opaque.diffuse = base * (diffuse * (1.0 - passing));
    Layered {
        opaque,
        through: color * (diffuse * passing),
        glass: glass(pbr, base, surface, reflectance, shading.energy_compensation),
        glass_share,
        film: pbr.iridescence.as_ref().map_or(ThinFilm::NONE, |i| {
            let blend = FloatSlot { factor: 1.0, texture: i.thickness_texture };
            let blend = slots.number(&blend).clamp(0.0, 1.0);
            let thickness_nm = i.thickness_min_nm + (i.thickness_max_nm - i.thickness_min_nm) * blend;
            ThinFilm { factor: number(&i.factor), ior: i.ior.max(1.0), thickness_nm: thickness_nm.max(0.0) }
        }),
        sheen: pbr.sheen.as_ref().map_or(Sheen::NONE, |s| Sheen {
            color: slots.color(&s.color).clamp(Rgb::ZERO, Rgb::ONE),
            roughness: number(&s.roughness),
        }),
        coat: pbr.clearcoat.as_ref().map_or(Coat::NONE, |c| {
            let roughness = number(&c.roughness);
            Coat {
                factor: number(&c.factor),
                alpha: roughness * roughness,
                normal: frame.coat_normal,
                fresnel: Coat::fresnel(shading.fresnel),
                energy_compensation: shading.energy_compensation,
            }
        }),
    }
}
