//! MTL materials to the renderer's own.
//!
//! | MTL | Becomes |
//! |---|---|
//! | `Kd`, `map_Kd` | base colour (linear), the image sRGB-decoded; a black `Kd` beside a map counts as white |
//! | `Ke`, `map_Ke` | emission, from both sides |
//! | `Pr`, `Pm`, `map_Pr`, `map_Pm` | roughness, metalness of the glTF model; a map replaces the number |
//! | `Ps`, `Pc`, `Pcr`, `aniso`, `anisor` | sheen (of roughness 0.3), clearcoat and its roughness, anisotropy and its turn |
//! | `Ns` (without `Pr`) | GGX alpha sqrt(2 / (Ns + 2)) (Walter et al. 2007, eq. 50), roughness its square root; not the Phong model, which loses most light at grazing incidence (a scene file can ask for it) |
//! | `Ks` black or absent, or `illum` 0, 1, and no PBR key | no specular reflection: Lambertian |
//! | `Ks` with a black `Kd` and no PBR key | a metal of that colour |
//! | `Ks`, `map_Ks` otherwise | dielectric reflection of index `Ni` (1.5) in the hue of `Ks`; the glTF model |
//! | `illum` 4, 6, 7, 9 with `Ni` above 1 | smooth glass of index `Ni`, tinted by `Tf` |
//! | `d` or 1 - `Tr` below 1, `map_d` | alpha; the map's alpha channel if it has one |
//! | `norm`, `bump` | normal map; a `bump` of grey heights is converted |
//! | other maps | ignored, with a warning |

use super::maps::Maps;
use super::mtl::Mtl;
use crate::error::Warning;
use crate::load::Loaded;
use crate::load::image::Use;
use crate::scene::{
    AlphaMode, Anisotropy, Clearcoat, ColorSlot, Emission, FloatSlot, FresnelModel, Material, Model,
    PbrMaterial, Sheen,
};
use std::path::Path;

/// Roughness of `Ps`, which has none of its own.
const SHEEN_ROUGHNESS: f32 = 0.3;

/// Converts one material of the library `library`, reading its images.
pub(super) fn convert(source: &Mtl, library: &Path, maps: &mut Maps, loaded: &mut Loaded) -> Material {
    let mut convert = Conversion { source, library, maps, loaded };
    convert.warn_of_maps();
    let opacity = source.number("d").or(source.number("tr").map(|t| 1.0 - t)).map_or(1.0, unit);
    let model = convert.model();
    let is_glass = matches!(model, Model::Dielectric { .. });
    let mut material = Material::new(&source.name, model);
    material.emission = convert.emission();
    material.normal_map = convert.normal_map();
    if is_glass {
        return material;
    }
    let map = convert.number_map("d", true);
    if opacity < 1.0 || map.is_some() {
        material.alpha_mode = AlphaMode::Blend;
        material.alpha = FloatSlot { factor: opacity, texture: map };
    }
    material
}

struct Conversion<'a, 'm> {
    source: &'a Mtl,
    library: &'a Path,
    maps: &'a mut Maps<'m>,
    loaded: &'a mut Loaded,
}

impl Conversion<'_, '_> {
    fn model(&mut self) -> Model {
        let source = self.source;
        let number = |key| source.number(key);
        let illum = number("illum").map(|n| n as i32);
        let ior = number("ni").filter(|n| (1.0..=10.0).contains(n));
        if let (Some(4 | 6 | 7 | 9), Some(ior)) = (illum, ior.filter(|n| *n > 1.0)) {
            let tint = ColorSlot::constant(source.tf.map_or([1.0; 3], colour));
            return Model::Dielectric { ior, tint, fresnel: FresnelModel::Exact };
        }
        let is_pbr = ["pr", "pm", "ps", "pc"]
            .iter()
            .any(|k| source.numbers.contains_key(k) || source.maps.contains_key(k));
        let ks = source.ks.map_or([0.0; 3], colour);
        let shines = illum.is_none_or(|i| i > 1) && (ks != [0.0; 3] || source.maps.contains_key("ks"));
        let roughness = number("pr").or(number("ns").map(roughness_of_exponent)).map_or(1.0, unit);
        let base_color = self.color("kd", source.kd.unwrap_or([0.8; 3]), true);
        if !is_pbr && !shines {
            return Model::Lambert { albedo: base_color };
        }
        let no_diffuse = base_color.factor == [0.0; 3] && base_color.texture.is_none();
        if !is_pbr && no_diffuse && ks != [0.0; 3] {
            let color = self.color("ks", ks, false);
            return Model::SchlickMetal { color, roughness: FloatSlot::constant(roughness) };
        }
        let brightest = ks.into_iter().fold(0.0, f32::max);
        let hue = if brightest > 0.0 { ks.map(|c| c / brightest) } else { [1.0; 3] };
        Model::Pbr(Box::new(PbrMaterial {
            base_color,
            metallic: self.share("pm", number("pm").map_or(0.0, unit)),
            roughness: self.share("pr", roughness),
            ior: ior.unwrap_or(1.5),
            specular_color: self.color("ks", hue, true),
            clearcoat: self.clearcoat(),
            sheen: self.sheen(),
            anisotropy: self.anisotropy(),
            ..PbrMaterial::default()
        }))
    }

    fn clearcoat(&self) -> Option<Clearcoat> {
        let factor = self.source.number("pc").map(unit).filter(|c| *c > 0.0)?;
        let roughness = self.source.number("pcr").map_or(0.0, unit);
        let (factor, roughness) = (FloatSlot::constant(factor), FloatSlot::constant(roughness));
        Some(Clearcoat { factor, roughness, normal_map: None })
    }

    fn sheen(&mut self) -> Option<Sheen> {
        let strength = self.source.number("ps").map(unit);
        let mut color = ColorSlot::constant([strength.unwrap_or(0.0); 3]);
        color.texture = self.color_map("ps");
        if color.texture.is_some() && color.factor == [0.0; 3] {
            color.factor = [1.0; 3];
        }
        let roughness = FloatSlot::constant(SHEEN_ROUGHNESS);
        (color.factor != [0.0; 3]).then_some(Sheen { color, roughness })
    }

    fn anisotropy(&self) -> Option<Anisotropy> {
        let strength = self.source.number("aniso").map(unit).filter(|a| *a > 0.0)?;
        let turns = self.source.number("anisor").filter(|r| r.is_finite()).unwrap_or(0.0);
        Some(Anisotropy { strength, rotation_rad: turns * std::f32::consts::TAU, texture: None })
    }

    fn emission(&mut self) -> Option<Emission> {
        let factor = self.source.ke.unwrap_or([0.0; 3]);
        let factor = factor.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 });
        let mut radiance = ColorSlot { factor, texture: self.color_map("ke") };
        if radiance.texture.is_some() && factor == [0.0; 3] {
            radiance.factor = [1.0; 3];
        }
        (radiance.factor != [0.0; 3]).then_some(Emission { radiance, two_sided: true })
    }

    fn normal_map(&mut self) -> Option<crate::scene::NormalMap> {
        let (map, is_height) = match (self.source.maps.get("norm"), self.source.maps.get("bump")) {
            (Some(map), _) => (map, false),
            (None, Some(map)) => (map, true),
            (None, None) => return None,
        };
        self.maps.normal(map, self.library, is_height, self.loaded)
    }

    /// A colour with its map; a black factor beside a map is white if `lift`.
    fn color(&mut self, key: &str, factor: [f32; 3], lift: bool) -> ColorSlot {
        let mut slot = ColorSlot { factor: colour(factor), texture: self.color_map(key) };
        if lift && slot.texture.is_some() && slot.factor == [0.0; 3] {
            slot.factor = [1.0; 3];
        }
        slot
    }

    fn color_map(&mut self, key: &str) -> Option<crate::scene::TextureId> {
        let map = self.source.maps.get(key)?;
        self.maps.texture(map, self.library, Use::Color, self.loaded)
    }

    /// A number that its map replaces.
    fn share(&mut self, key: &str, value: f32) -> FloatSlot {
        match self.number_map(key, false) {
            Some(texture) => FloatSlot { factor: 1.0, texture: Some(texture) },
            None => FloatSlot::constant(value),
        }
    }

    fn number_map(&mut self, key: &str, alpha_first: bool) -> Option<(crate::scene::TextureId, u8)> {
        let map = self.source.maps.get(key)?;
        self.maps.number(map, self.library, alpha_first, self.loaded)
    }

    fn warn_of_maps(&mut self) {
        for key in ["ns", "tr", "disp", "decal", "refl", "rma"] {
            let Some(map) = self.source.maps.get(key) else { continue };
            let message =
                format!("material '{}': the map of '{key}' is not supported, ignored", self.source.name);
            self.loaded.warnings.push(Warning::new(self.library, format!("line {}", map.line), message));
        }
    }
}

/// The roughness whose GGX alpha suits a Phong exponent (Walter et al. 2007, eq. 50).
fn roughness_of_exponent(ns: f32) -> f32 {
    (2.0 / (ns.max(0.0) + 2.0)).sqrt().sqrt()
}

fn unit(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) }
}

fn colour(rgb: [f32; 3]) -> [f32; 3] {
    rgb.map(unit)
}
