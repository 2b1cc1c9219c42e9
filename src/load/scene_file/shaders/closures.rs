//! Converts Blender's shader nodes to materials: closures of Cycles 5.0 to the equivalent BSDF models.
//!
//! The radius of Blender's Random Walk (Skin) is converted by the diffuse reflectance of a half space in the dipole model of Jensen,
//! Marschner, Levoy, Hanrahan 2001, "A Practical Model for Subsurface Light Transport".

use super::{ClosureList, Shader};
use crate::math::poly;
use crate::scene::nodes::{MathOperation, NodeInput, NodeKind};
use crate::scene::{
    Anisotropy, Clearcoat, ColorSlot, DiffuseTransmission, EnergyCompensation, FloatSlot, GlassReflection,
    Iridescence, Material, Medium, Model, PbrMaterial, Sheen, SubsurfaceEntry,
};
use std::f32::consts::PI;

const NONE: FloatSlot = FloatSlot::constant(0.0);
const WHITE: [f32; 3] = [1.0; 3];

/// Opaque surfaces with a lower index of refraction are total reflectors: they would reflect at least 96 % of uniform
/// illumination. An index of 0 is valid in Cycles.
const MAX_TOTAL_REFLECTION_IOR: f32 = 0.2;

/// Default index of refraction of glass.
const DEFAULT_IOR: f32 = 1.5;

/// Subsurface scattering with a smaller weight becomes diffuse reflection.
const MIN_SUBSURFACE_WEIGHT: f32 = 0.5;

/// Mean path length of light through a coat, relative to its thickness.
const COAT_PATH: f32 = 1.1;

/// A material without any lobes.
fn without_lobes() -> PbrMaterial {
    PbrMaterial {
        base_color: ColorSlot::constant([0.0; 3]),
        metallic: NONE,
        specular: NONE,
        ..PbrMaterial::default()
    }
}

fn is_black(slot: &ColorSlot) -> bool {
    slot.texture.is_none() && slot.factor.iter().all(|c| *c <= 0.0)
}

/// The index of refraction with `factor` times the reflectance at normal incidence of `ior`.
fn scaled_ior(ior: f32, factor: f32) -> f32 {
    let root = (ior - 1.0) / (ior + 1.0);
    let root = (root * root * factor).clamp(0.0, 0.99).sqrt();
    (1.0 + root) / (1.0 - root)
}

impl ClosureList<'_, '_, '_> {
    /// Adds the closures of a shader other than mix and add.
    pub(super) fn add_closure(&mut self, index: usize, weight: NodeInput) {
        let model = match self.shaders[index].shader {
            Shader::Principled => return self.principled(index, weight),
            Shader::Emission => {
                let (color, strength) =
                    (self.color(index, "color", WHITE), self.number(index, "strength", 1.0));
                let radiance = self.product(color, strength);
                return self.add_emission(weight, radiance);
            }
            Shader::Transparent => return self.transparent(index, weight),
            Shader::Subsurface => return self.subsurface(index, weight),
            Shader::Diffuse => self.diffuse(index),
            Shader::Glossy => self.glossy(index),
            Shader::Metallic => self.metal(index),
            Shader::Glass => self.glass(index, GlassReflection::Tinted),
            Shader::Refraction => self.glass(index, GlassReflection::None),
            Shader::Translucent => {
                let color = self.color(index, "color", [0.8; 3]);
                let color = self.color_slot(color);
                let through =
                    DiffuseTransmission { factor: FloatSlot::constant(1.0), color, subsurface: None };
                Model::Pbr(Box::new(PbrMaterial { diffuse_transmission: Some(through), ..without_lobes() }))
            }
            Shader::Sheen => {
                let color = self.color(index, "color", [0.8; 3]);
                let color = self.color_slot(color);
                let roughness = self.number(index, "roughness", 0.5);
                let roughness = self.float_slot(roughness);
                Model::Pbr(Box::new(PbrMaterial {
                    sheen: Some(Sheen { color, roughness }),
                    ..without_lobes()
                }))
            }
            Shader::Velvet => {
                let (color, deviation) =
                    (self.color(index, "color", [0.8; 3]), self.number(index, "roughness", 1.0));
                Model::Velvet { color: self.color_slot(color), deviation: self.float_slot(deviation) }
            }
            Shader::Toon => {
                let (color, size, smooth) = self.toon(index);
                Model::Toon { color, size, smooth }
            }
            Shader::ToonHighlight => {
                let (color, size, smooth) = self.toon(index);
                Model::ToonHighlight { color, size, smooth }
            }
            Shader::Mix | Shader::Add => return,
        };
        self.add_component(index, weight, Material::new(self.material, model));
    }

    fn add_component(&mut self, index: usize, weight: NodeInput, mut material: Material) {
        let normal = self.color(index, "normal", [0.0; 3]);
        material.normal = self.vector_texture(normal);
        material.bumped_normal = self.vector_texture(self.bumps);
        if weight != NodeInput::Value([0.0; 3]) {
            self.components.push((weight, material));
        }
    }

    fn diffuse(&mut self, index: usize) -> Model {
        let color = self.color(index, "color", [0.8; 3]);
        let color = self.color_slot(color);
        let roughness = self.number(index, "roughness", 0.0);
        match self.float_slot(roughness) {
            NONE => Model::Lambert { albedo: color },
            roughness => Model::OrenNayar { color, roughness },
        }
    }

    /// Colour, size and smoothness of a toon shader.
    fn toon(&mut self, index: usize) -> (ColorSlot, FloatSlot, FloatSlot) {
        let color = self.color(index, "color", [0.8; 3]);
        let (size, smooth) = (self.number(index, "size", 0.5), self.number(index, "smooth", 0.0));
        (self.color_slot(color), self.float_slot(size), self.float_slot(smooth))
    }

    /// A reflection lobe with constant reflectance over all angles.
    fn glossy(&mut self, index: usize) -> Model {
        let color = self.color(index, "color", [0.8; 3]);
        let color = self.color_slot(color);
        let is_isotropic = self.number(index, "anisotropy", 0.0) == NodeInput::Value([0.0; 3]);
        if is_isotropic && self.constant(index, "beckmann", 0.0) > 0.0 {
            let roughness = self.number(index, "roughness", 0.2);
            return Model::Beckmann { color, roughness: self.float_slot(roughness) };
        }
        let mut pbr = PbrMaterial {
            ior: 0.0,
            specular: if is_black(&color) { NONE } else { FloatSlot::constant(1.0) },
            specular_color: color,
            has_constant_reflectance: true,
            energy_compensation: self.energy_compensation(index),
            ..without_lobes()
        };
        self.set_roughness(index, &mut pbr, "anisotropy", "rotation");
        Model::Pbr(Box::new(pbr))
    }

    fn metal(&mut self, index: usize) -> Model {
        let color = self.color(index, "base_color", [0.617, 0.577, 0.540]);
        let tint = self.constant_color(index, "edge_tint", [0.695, 0.726, 0.770]);
        let mut pbr = PbrMaterial {
            metallic: FloatSlot::constant(1.0),
            base_color: self.f82_color(color, tint, 1.0),
            energy_compensation: self.energy_compensation(index),
            ..without_lobes()
        };
        self.set_roughness(index, &mut pbr, "anisotropy", "rotation");
        Model::Pbr(Box::new(pbr))
    }

    /// Schlick base colour of a metal with the same directional-hemispherical albedo as the F82-tint model (Kutz et al. 2021).
    fn f82_color(&mut self, color: NodeInput, tint: [f32; 3], metallic: f32) -> ColorSlot {
        let NodeInput::Value(base) = color else { return self.color_slot(color) };
        let cosine: f32 = 1.0 / 7.0;
        let edged = [0, 1, 2].map(|c| {
            let schlick_f82 = base[c] + (1.0 - base[c]) * (1.0 - cosine).powi(5);
            let factor = schlick_f82 * (1.0 - tint[c]) / (cosine * (1.0 - cosine).powi(6));
            // The cosine-weighted mean of cosine (1 - cosine)^6 is 1 / 126, that of Schlick's term base + (1 - base) / 21.
            let schlick_base = base[c] - factor / 126.0 * 21.0 / 20.0;
            (base[c] + metallic * (schlick_base - base[c])).max(0.0)
        });
        ColorSlot::constant(edged)
    }

    /// Multiple scattering between microfacets; `None`: the render setting `microfacet`.
    fn energy_compensation(&mut self, index: usize) -> Option<EnergyCompensation> {
        match self.constant(index, "multiscatter", -1.0) {
            unset if unset < 0.0 => None,
            0.0 => Some(EnergyCompensation::Off),
            _ => Some(EnergyCompensation::On),
        }
    }

    /// Roughness and anisotropy. Blender's alphas along and across are roughness^2 / aspect and roughness^2 * aspect with
    /// aspect = sqrt(1 - 0.9 anisotropy); glTF's alpha across is roughness^2.
    fn set_roughness(&mut self, index: usize, pbr: &mut PbrMaterial, anisotropy: &str, rotation: &str) {
        let default = if anisotropy == "anisotropic" { 0.5 } else { 0.2 };
        let roughness = self.number(index, "roughness", default);
        pbr.roughness = self.float_slot(roughness);
        let anisotropic = self.constant(index, anisotropy, 0.0);
        if anisotropic == 0.0 {
            return;
        }
        let rotation = self.constant(index, rotation, 0.0);
        let NodeInput::Value([roughness, ..]) = roughness else {
            return self.warn("anisotropy needs a constant roughness: it is left out".to_string());
        };
        let aspect = (1.0 - 0.9 * anisotropic.abs().min(1.0)).sqrt();
        let (along, across) = (roughness * roughness / aspect, roughness * roughness * aspect);
        let strength = ((along.min(1.0) - across) / (1.0 - across).max(1e-6)).max(0.0).sqrt().min(1.0);
        pbr.roughness = FloatSlot::constant(across.sqrt());
        let rotation_rad = 2.0 * PI * rotation + if anisotropic < 0.0 { 0.5 * PI } else { 0.0 };
        pbr.anisotropy = (strength > 0.0).then_some(Anisotropy { strength, rotation_rad, texture: None });
    }

    fn glass(&mut self, index: usize, reflection: GlassReflection) -> Model {
        let color = self.color(index, "color", WHITE);
        let roughness = self.number(index, "roughness", 0.0);
        let index_of_refraction = self.number(index, "ior", DEFAULT_IOR);
        let slot = self.float_slot(index_of_refraction);
        let (ior, varying_ior) = match slot.texture {
            Some(_) => (DEFAULT_IOR, Some(slot)),
            None => (slot.factor.max(PbrMaterial::MIN_GLASS_IOR), None),
        };
        let is_white = color == NodeInput::Value(WHITE) && reflection == GlassReflection::Tinted;
        Model::Pbr(Box::new(PbrMaterial {
            base_color: self.color_slot(color),
            roughness: self.float_slot(roughness),
            ior,
            varying_ior,
            specular: FloatSlot::constant(1.0),
            transmission: FloatSlot::constant(1.0),
            glass_reflection: if is_white { GlassReflection::White } else { reflection },
            energy_compensation: self.energy_compensation(index),
            is_beckmann: self.constant(index, "beckmann", 0.0) > 0.0,
            ..self.interface()
        }))
    }

    /// A dielectric interface as in Cycles: refraction doesn't scale radiance, and surfaces that bound no solid refract, too.
    fn interface(&self) -> PbrMaterial {
        PbrMaterial { has_volume: self.is_solid, keeps_radiance: true, ..without_lobes() }
    }

    fn transparent(&mut self, index: usize, weight: NodeInput) {
        let color = self.color(index, "color", WHITE);
        self.only_mixes &= color == NodeInput::Value(WHITE);
        self.is_tinted |= !matches!(color, NodeInput::Value([r, g, b]) if r == g && g == b);
        self.add_transparency(weight, color);
    }

    fn subsurface(&mut self, index: usize, weight: NodeInput) {
        let color = self.color(index, "color", [0.8; 3]);
        let (albedo, tint) = self.albedo_and_tint(index, color, "body");
        let scale = self.constant(index, "scale", 0.05);
        let radius = self.constant_color(index, "radius", [1.0, 0.2, 0.1]);
        let anisotropy = self.constant(index, "anisotropy", 0.0);
        let skin_ior = self.constant(index, "skin_ior", 0.0);
        let paths = mean_free_paths(radius.map(|r| r * scale), albedo, skin_ior);
        let entry = Self::subsurface_entry(skin_ior, self.constant(index, "ior", 1.4));
        let mut material = Material::new(self.material, Model::Black);
        let mut pbr = without_lobes();
        let roughness = self.number(index, "roughness", 1.0);
        pbr.roughness = self.float_slot(roughness);
        set_subsurface(&mut material, pbr, entry, (albedo, tint), paths, anisotropy);
        self.add_component(index, weight, material);
    }

    /// How light enters a body: refracted (Random Walk); half of it diffusely, with an index of refraction of its own (Random
    /// Walk (Skin)); or diffusely where the index is 0 (Christensen-Burley).
    fn subsurface_entry(skin_ior: f32, ior: f32) -> SubsurfaceEntry {
        let clamped = |ior: f32| ior.clamp(MIN_BODY_IOR, MAX_BODY_IOR);
        match skin_ior > 0.0 {
            true => SubsurfaceEntry::Skin { ior: clamped(skin_ior) },
            false if ior <= 0.0 => SubsurfaceEntry::Diffuse,
            false => SubsurfaceEntry::Refraction { ior: clamped(ior) },
        }
    }

    /// Splits a subsurface colour into a constant albedo of the body, the input `key`, and a tint of its surface. The tint
    /// applies on entry and exit, and is the square root of colour over albedo.
    fn albedo_and_tint(&mut self, index: usize, color: NodeInput, key: &str) -> ([f32; 3], ColorSlot) {
        if let NodeInput::Value(color) = color {
            return (color, ColorSlot::constant(WHITE));
        }
        if self.color(index, key, WHITE) == NodeInput::Value(WHITE) {
            self.warn(format!("subsurface scattering with a textured colour is that of a white body: '{key}' sets its colour"));
        }
        let body = self.constant_color(index, key, WHITE).map(|c| c.clamp(1e-3, 1.0));
        let ratio = self.product(color, NodeInput::Value(body.map(|c| 1.0 / c)));
        let ratio = self.push(NodeKind::SeparateXyz {}, &[ratio]);
        let NodeInput::Link { node, .. } = ratio else { return (body, ColorSlot::constant(WHITE)) };
        let roots = [0, 1, 2].map(|output| {
            let channel = self.clamped(NodeInput::Link { node, output });
            self.push(NodeKind::Math { operation: MathOperation::Sqrt, use_clamp: false }, &[channel])
        });
        let tint = self.push(NodeKind::CombineXyz {}, &roots);
        (body, self.color_slot(tint))
    }

    fn principled(&mut self, index: usize, weight: NodeInput) {
        let alpha = self.number(index, "alpha", 1.0);
        let alpha = self.clamped(alpha);
        let transparency = self.complement(alpha);
        let transparency = self.product(weight, transparency);
        self.add_transparency(transparency, NodeInput::Value(WHITE));
        let weight = self.product(weight, alpha);
        let (mut pbr, coat_tint) = self.principled_lobes(index);
        self.principled_emission(index, weight, coat_tint);
        let mut material = Material::new(self.material, Model::Black);
        let subsurface = self.constant(index, "subsurface_weight", 0.0);
        let is_opaque = pbr.metallic == NONE && pbr.transmission == NONE;
        if subsurface >= MIN_SUBSURFACE_WEIGHT && is_opaque {
            let radius = self.constant_color(index, "subsurface_radius", [1.0, 0.2, 0.1]);
            let scale = self.constant(index, "subsurface_scale", 0.05);
            let anisotropy = self.constant(index, "subsurface_anisotropy", 0.0);
            let skin_ior = self.constant(index, "subsurface_skin_ior", 0.0);
            if scale > 0.0 {
                let color = match pbr.base_color.texture {
                    None => NodeInput::Value(pbr.base_color.factor),
                    Some(_) => self.color(index, "base_color", [0.8; 3]),
                };
                let (albedo, tint) = self.albedo_and_tint(index, color, "subsurface_body");
                pbr.base_color = ColorSlot::constant([0.0; 3]);
                let paths = mean_free_paths(radius.map(|r| r * scale), albedo, skin_ior);
                let ior = self.constant(index, "ior", 1.5);
                let entry = Self::subsurface_entry(skin_ior, self.constant(index, "subsurface_ior", ior));
                set_subsurface(&mut material, pbr, entry, (albedo, tint), paths, anisotropy);
                return self.add_component(index, weight, material);
            }
        }
        material.model = Model::Pbr(Box::new(pbr));
        self.add_component(index, weight, material);
    }

    /// The lobes of the Principled shader, and the coat's tint of the lobes and emission below it.
    fn principled_lobes(&mut self, index: usize) -> (PbrMaterial, [f32; 3]) {
        let mut pbr = self.interface();
        let base = self.color(index, "base_color", [0.8; 3]);
        pbr.tints_once = true;
        pbr.energy_compensation = self.energy_compensation(index);
        let number = |closures: &mut Self, key, default| {
            let input = closures.number(index, key, default);
            closures.float_slot(input)
        };
        pbr.metallic = number(self, "metallic", 0.0);
        pbr.diffuse_roughness = number(self, "diffuse_roughness", 0.0);
        pbr.transmission = number(self, "transmission_weight", 0.0);
        let level = number(self, "specular_ior_level", 0.5);
        (pbr.ior, pbr.specular) = self.dielectric(index, level, pbr.transmission == NONE);
        self.set_roughness(index, &mut pbr, "anisotropic", "anisotropic_rotation");
        let tint = self.color(index, "specular_tint", WHITE);
        pbr.base_color = self.color_slot(base);
        if pbr.metallic == NONE {
            pbr.specular_color = self.color_slot(tint);
        } else if tint != NodeInput::Value(WHITE) {
            let tint = self.constant_color(index, "specular_tint", WHITE);
            pbr.base_color = self.f82_color(base, tint, pbr.metallic.factor);
        }
        let coat_tint = self.principled_layers(index, &mut pbr);
        pbr.base_color.factor = [0, 1, 2].map(|c| pbr.base_color.factor[c] * coat_tint[c]);
        (pbr, coat_tint)
    }

    /// The index of refraction of the Principled shader, and the factor on its reflection.
    fn dielectric(&mut self, index: usize, level: FloatSlot, is_opaque: bool) -> (f32, FloatSlot) {
        let given = self.constant(index, "ior", 1.5);
        if is_opaque && (MAX_TOTAL_REFLECTION_IOR..1.0).contains(&given) && level.factor > 0.0 {
            self.warn("an opaque surface with an index of refraction below 1 has no reflection".to_string());
        }
        let ior = given.max(if is_opaque { 1.0 } else { PbrMaterial::MIN_GLASS_IOR });
        match level.texture {
            // In glTF, an index of 0 is total reflection.
            None if is_opaque && given < MAX_TOTAL_REFLECTION_IOR && level.factor >= 0.5 => {
                (0.0, FloatSlot::constant(1.0))
            }
            None if is_opaque && level.factor <= 0.0 => (ior, NONE),
            None if is_opaque => (scaled_ior(ior, 2.0 * level.factor), FloatSlot::constant(1.0)),
            None => (ior, FloatSlot::constant(2.0 * level.factor.min(0.5))),
            Some(_) => (ior, FloatSlot { factor: 2.0 * level.factor, ..level }),
        }
    }

    /// Sets coat, sheen and thin film; returns the coat's tint of the lobes below it.
    fn principled_layers(&mut self, index: usize, pbr: &mut PbrMaterial) -> [f32; 3] {
        let weight = self.number(index, "coat_weight", 0.0);
        let mut tint_below = WHITE;
        if weight != NodeInput::Value([0.0; 3]) {
            let ior = self.constant(index, "coat_ior", 1.5).max(1.0);
            let tint = self.constant_color(index, "coat_tint", WHITE);
            let reflectance = ((ior - 1.0) / (ior + 1.0)).powi(2) / 0.04;
            let roughness = self.number(index, "coat_roughness", 0.03);
            let slot = self.float_slot(weight);
            let factor = FloatSlot { factor: slot.factor * reflectance.min(1.0), ..slot };
            let roughness = self.float_slot(roughness);
            pbr.clearcoat = Some(Clearcoat { factor, roughness, normal_map: None });
            let coverage = if slot.texture.is_none() { slot.factor.min(1.0) } else { 1.0 };
            tint_below = tint.map(|t| 1.0 + (poly::exp(COAT_PATH * poly::ln(t.max(1e-6))) - 1.0) * coverage);
        }
        let weight = self.number(index, "sheen_weight", 0.0);
        if weight != NodeInput::Value([0.0; 3]) {
            let tint = self.color(index, "sheen_tint", WHITE);
            let color = self.product(tint, weight);
            let color = self.color_slot(color);
            let roughness = self.number(index, "sheen_roughness", 0.5);
            let roughness = self.float_slot(roughness);
            pbr.sheen = (!is_black(&color)).then_some(Sheen { color, roughness });
        }
        let thickness = self.constant(index, "thin_film_thickness", 0.0);
        if thickness > 0.0 {
            pbr.iridescence = Some(Iridescence {
                factor: FloatSlot::constant(1.0),
                ior: self.constant(index, "thin_film_ior", 1.33).max(1.0),
                thickness_min_nm: thickness,
                thickness_max_nm: thickness,
                thickness_texture: None,
            });
        }
        tint_below
    }

    fn principled_emission(&mut self, index: usize, weight: NodeInput, coat_tint: [f32; 3]) {
        let color = self.color(index, "emission_color", WHITE);
        let strength = self.number(index, "emission_strength", 0.0);
        let radiance = self.product(color, strength);
        let radiance = self.product(radiance, NodeInput::Value(coat_tint));
        self.add_emission(weight, radiance);
    }
}

/// Reduced mean free paths, metres, from the radii of a shader: of Random Walk, or with `skin_ior` above 0 of Random Walk
/// (Skin).
fn mean_free_paths(radius: [f32; 3], albedo: [f32; 3], skin_ior: f32) -> [f32; 3] {
    if skin_ior <= 0.0 {
        return radius.map(|r| r / (4.0 * PI));
    }
    [0, 1, 2].map(|c| {
        radius[c] * free_path_per_diffusion_length(albedo[c], skin_ior.clamp(MIN_BODY_IOR, MAX_BODY_IOR))
    })
}

/// Adds subsurface scattering to a material; `paths`: reduced mean free paths of the body, metres.
fn set_subsurface(
    material: &mut Material,
    mut pbr: PbrMaterial,
    entry: SubsurfaceEntry,
    (albedo, tint): ([f32; 3], ColorSlot),
    paths: [f32; 3],
    anisotropy: f32,
) {
    let anisotropy = anisotropy.clamp(0.0, MAX_BODY_ANISOTROPY);
    let paths = paths.map(|path| (path * (1.0 - anisotropy)).max(1e-6));
    let mut medium = Medium::subsurface(albedo.map(|c| c.clamp(0.0, 1.0)), paths, anisotropy);
    // Albedos below the minimum are represented by a surface tint, which applies on entry and exit; it also attenuates
    // unscattered light.
    let factor = medium.albedo.map(|albedo| (albedo / MIN_ALBEDO).min(1.0).sqrt());
    medium.albedo = medium.albedo.map(|albedo| albedo.max(MIN_ALBEDO));
    let color = ColorSlot { factor: [0, 1, 2].map(|c| tint.factor[c] * factor[c]), ..tint };
    pbr.has_volume = true;
    pbr.diffuse_transmission =
        Some(DiffuseTransmission { factor: FloatSlot::constant(1.0), color, subsurface: Some(entry) });
    material.model = Model::Pbr(Box::new(pbr));
    material.medium = Some(medium);
}

/// Range of the index of refraction of a body, as in Cycles.
const MIN_BODY_IOR: f32 = 1.01;
const MAX_BODY_IOR: f32 = 3.8;

/// Maximum anisotropy of a body, as in Cycles; the minimum is 0.
const MAX_BODY_ANISOTROPY: f32 = 0.9;

/// Minimum single-scattering albedo of subsurface scattering, as in Cycles.
const MIN_ALBEDO: f32 = 0.2;

/// Steps of the bisection, as many as in Cycles: the error of 2^-12 changes the mean free paths of bright bodies by up to a tenth.
const BISECTION_STEPS: i32 = 11;

/// Bodies of at least this colour count as white, with this complement of the reduced albedo.
const NEARLY_WHITE: (f32, f64) = (0.995, 1e-6);

/// Reduced mean free path relative to the diffusion length 1 / sqrt(3 sigma_a sigma_t'), for a body of a colour and index of
/// refraction.
fn free_path_per_diffusion_length(color: f32, ior: f32) -> f32 {
    let absorption = if color >= NEARLY_WHITE.0 {
        NEARLY_WHITE.1
    } else {
        absorption_of_color(f64::from(color), extrapolation(ior))
    };
    (3.0 * absorption).sqrt() as f32
}

/// 4 A D of the dipole model in reduced mean free paths: 4 A / 3.
fn extrapolation(ior: f32) -> f64 {
    let eta = f64::from(ior);
    let diffuse_fresnel = -1.440 / (eta * eta) + 0.710 / eta + 0.668 + 0.0636 * eta;
    4.0 / 3.0 * (1.0 + diffuse_fresnel) / (1.0 - diffuse_fresnel)
}

/// One minus the reduced albedo of a half space with a diffuse reflectance of `color`.
fn absorption_of_color(color: f64, extrapolation: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..BISECTION_STEPS {
        let middle = 0.5 * (low + high);
        if reflectance(middle, extrapolation) > color { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// Diffuse reflectance of a half space; `absorption` is one minus the reduced albedo.
fn reflectance(absorption: f64, extrapolation: f64) -> f64 {
    let root = (3.0 * absorption).sqrt();
    0.5 * (1.0 - absorption) * (1.0 + (-extrapolation * root).exp()) * (-root).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inversion_recovers_the_color() {
        for ior in [1.01, 1.4, 2.0] {
            for color in [0.05, 0.3, 0.8, 0.99] {
                let absorption = f64::from(free_path_per_diffusion_length(color, ior)).powi(2) / 3.0;
                let error = 0.5f64.powi(BISECTION_STEPS + 1);
                let [least, most] = [absorption + error, (absorption - error).max(0.0)]
                    .map(|absorption| reflectance(absorption, extrapolation(ior)) as f32);
                assert!((least..=most).contains(&color), "{ior} {color}: {least} {most}");
            }
        }
    }

    /// Mean free paths fall with the colour; the maximum, for black, is sqrt(3) diffusion lengths.
    #[test]
    fn mean_free_paths_fall_with_the_color() {
        let paths = [0.0, 0.1, 0.5, 0.9, 0.999].map(|color| free_path_per_diffusion_length(color, 1.4));
        assert!(paths.is_sorted_by(|a, b| a > b), "{paths:?}");
        assert!((paths[0] - 3.0f32.sqrt()).abs() < 1e-3, "{paths:?}");
    }
}
