//! Conversion of MTL materials.
//!
//! | MTL | Becomes |
//! |---|---|
//! | `Kd`, `map_Kd` | base colour (linear), the image sRGB-decoded; a black `Kd` with a map is taken as white |
//! | `Ke`, `map_Ke` | emission, from both sides |
//! | `Pr`, `Pm`, `map_Pr`, `map_Pm` | roughness, metalness of the glTF model; a map replaces the number |
//! | `Ps`, `Pc`, `Pcr`, `aniso`, `anisor` | sheen (roughness 0.3), clearcoat and its roughness, anisotropy and its rotation |
//! | `Ns` (without `Pr`) | GGX alpha sqrt(2 / (Ns + 2)) (Walter et al. 2007, eq. 50), roughness its square root; not the Phong model, which loses most light at grazing incidence (available in scene files) |
//! | `Ks` black or absent, or `illum` 0, 1, and no PBR key | no specular reflection: Lambertian |
//! | `Ks` with a black `Kd` and no PBR key | a metal of that colour |
//! | `Ks`, `map_Ks` otherwise | glTF model: dielectric of index `Ni` (default 1.5), specular colour with the hue of `Ks` |
//! | `illum` 4, 6, 7, 9 with `Ni` above 1 | smooth glass of index `Ni`, tinted by `Tf` |
//! | `d` or 1 - `Tr` below 1, `map_d` | alpha; the map's alpha channel if it has one |
//! | `disp` with `-bm` | displacement from 0 (black) to `-bm` (white); ignored with a warning without `-bm` |
//! | `norm`, `bump` | normal map; a `bump` with grey heights is converted |
//! | `map_Ka` | the colour, with a warning, without `map_Kd`; else ignored, with a warning if it is another image |
//! | other maps | ignored, with a warning |

use super::mtl::{Map, Mtl};
use crate::error::{Error, Warning};
use crate::image::Damage;
use crate::load::displace::{BUMP_HEIGHT, holds_normals, normals_of_heights};
use crate::load::files::find;
use crate::load::image::Use;
use crate::load::{LoadOptions, Loaded, image};
use crate::math::Vec2;
use crate::scene::{
    AlphaMode, Anisotropy, Clearcoat, ColorSlot, Displacement, DisplacementKind, Emission, FloatSlot,
    FresnelModel, ImageId, Interpolation, Mapping, Material, Model, NormalMap, PbrMaterial, Scene, Sheen,
    Texture, TextureId, TextureTransform, Wrap,
};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Valid indices of refraction.
const IORS: std::ops::RangeInclusive<f32> = 1.0..=10.0;

/// Roughness of the sheen of `Ps`, which MTL does not define.
const SHEEN_ROUGHNESS: f32 = 0.3;

/// Converts a material of the file `library` and reads its images.
pub(super) fn convert(source: &Mtl, library: &Path, maps: &mut Maps, loaded: &mut Loaded) -> Material {
    let mut convert = Conversion { source, library, maps, loaded };
    convert.warn_of_maps();
    convert.warn_of_ranges();
    let opacity = source.number("d").or(source.number("Tr").map(|t| 1.0 - t)).map_or(1.0, unit);
    let model = convert.model();
    let is_glass = matches!(model, Model::Dielectric { .. });
    let mut material = Material::new(&source.name, model);
    material.emission = convert.emission();
    material.normal_map = convert.normal_map();
    if is_glass {
        convert.warn_of_glass();
        return material;
    }
    material.displacement = convert.displacement();
    let map = convert.number_map("map_d", true);
    if opacity <= 0.0 && map.is_none() {
        let statement = if source.number("d").is_some() { "d 0" } else { "Tr 1" };
        convert.warn("", format!("'{statement}' makes it invisible; remove it if that is not intended"));
    }
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
        let ior = number("Ni").filter(|n| IORS.contains(n));
        if let (Some(4 | 6 | 7 | 9), Some(ior)) = (illum, ior.filter(|n| *n > 1.0)) {
            let tint = ColorSlot::constant(source.color("Tf").map_or([1.0; 3], clamped));
            return Model::Dielectric { ior, tint, fresnel: FresnelModel::Exact };
        }
        let is_given = |key| number(key).is_some() || source.map(&format!("map_{key}")).is_some();
        let is_pbr = ["Pr", "Pm", "Ps", "Pc"].into_iter().any(is_given);
        let ks = source.color("Ks").map_or([0.0; 3], clamped);
        let is_glossy = illum.is_none_or(|i| i > 1) && (ks != [0.0; 3] || source.map("map_Ks").is_some());
        let roughness = number("Pr").or(number("Ns").map(roughness_of_exponent)).map_or(1.0, unit);
        let base_map = if self.has_only_ambient_map() { "map_Ka" } else { "map_Kd" };
        let base_color = self.color(base_map, source.color("Kd").unwrap_or([0.8; 3]), true);
        if !is_pbr && !is_glossy {
            return Model::Lambert { albedo: base_color };
        }
        let no_diffuse = base_color.factor == [0.0; 3] && base_color.texture.is_none();
        if !is_pbr && no_diffuse && ks != [0.0; 3] {
            let color = self.color("map_Ks", ks, false);
            return Model::SchlickMetal { color, roughness: FloatSlot::constant(roughness) };
        }
        let brightest = ks.into_iter().fold(0.0, f32::max);
        let hue = if brightest > 0.0 { ks.map(|c| c / brightest) } else { [1.0; 3] };
        Model::Pbr(Box::new(PbrMaterial {
            base_color,
            metallic: self.scalar("map_Pm", number("Pm").map_or(0.0, unit)),
            roughness: self.scalar("map_Pr", roughness),
            ior: ior.unwrap_or(1.5),
            specular_color: self.color("map_Ks", hue, true),
            clearcoat: self.clearcoat(),
            sheen: self.sheen(),
            anisotropy: self.anisotropy(),
            ..PbrMaterial::default()
        }))
    }

    /// Whether there is a `map_Ka` without a `map_Kd`.
    fn has_only_ambient_map(&self) -> bool {
        self.source.map("map_Kd").is_none() && self.source.map("map_Ka").is_some()
    }

    /// Whether `map_Kd` has the file of this map.
    fn is_color_map(&self, map: &Map) -> bool {
        self.source.map("map_Kd").is_some_and(|color| color.file == map.file)
    }

    fn clearcoat(&self) -> Option<Clearcoat> {
        let factor = self.source.number("Pc").map(unit).filter(|c| *c > 0.0)?;
        let roughness = self.source.number("Pcr").map_or(0.0, unit);
        let (factor, roughness) = (FloatSlot::constant(factor), FloatSlot::constant(roughness));
        Some(Clearcoat { factor, roughness, normal_map: None })
    }

    fn sheen(&mut self) -> Option<Sheen> {
        let strength = self.source.number("Ps").map(unit);
        let mut color = ColorSlot::constant([strength.unwrap_or(0.0); 3]);
        color.texture = self.color_map("map_Ps");
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
        let factor = self.source.color("Ke").unwrap_or([0.0; 3]);
        let factor = factor.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 });
        let mut radiance = ColorSlot { factor, texture: self.color_map("map_Ke") };
        if radiance.texture.is_some() && factor == [0.0; 3] {
            radiance.factor = [1.0; 3];
        }
        (radiance.factor != [0.0; 3]).then_some(Emission { radiance, two_sided: true })
    }

    fn normal_map(&mut self) -> Option<NormalMap> {
        let (map, is_height) = match (self.source.map("norm"), self.source.map("bump")) {
            (Some(map), _) => (map, false),
            (None, Some(map)) => (map, true),
            (None, None) => return None,
        };
        self.maps.normal(&map, self.library, is_height, self.loaded)
    }

    /// A colour with its map; if `black_is_white`, a black factor with a map becomes white.
    fn color(&mut self, key: &str, factor: [f32; 3], black_is_white: bool) -> ColorSlot {
        let mut slot = ColorSlot { factor: clamped(factor), texture: self.color_map(key) };
        if black_is_white && slot.texture.is_some() && slot.factor == [0.0; 3] {
            slot.factor = [1.0; 3];
        }
        slot
    }

    fn color_map(&mut self, key: &str) -> Option<TextureId> {
        let map = self.source.map(key)?;
        self.maps.texture(&map, self.library, Use::Color, self.loaded)
    }

    /// A number, or the map that replaces it.
    fn scalar(&mut self, key: &str, value: f32) -> FloatSlot {
        match self.number_map(key, false) {
            Some(texture) => FloatSlot { factor: 1.0, texture: Some(texture) },
            None => FloatSlot::constant(value),
        }
    }

    fn number_map(&mut self, key: &str, alpha_first: bool) -> Option<(TextureId, u8)> {
        let map = self.source.map(key)?;
        self.maps.number(&map, self.library, alpha_first, self.loaded)
    }

    /// Displacement with the height of `-bm`; black is not displaced.
    fn displacement(&mut self) -> Option<Displacement> {
        let scale = self.source.map("disp").filter(|map| map.has_bump)?.bump;
        let texture = self.number_map("disp", false)?;
        Some(Displacement { texture, kind: DisplacementKind::Heights { scale, midlevel: 0.0, edge: 0.0 } })
    }

    fn warn_of_maps(&mut self) {
        if self.source.map("disp").is_some_and(|map| !map.has_bump) {
            let message =
                "is ignored: '-bm', the height of white above black in units of the model, is missing";
            self.warn_of_map("disp", message);
        }
        for key in ["map_Ns", "map_Tr", "decal", "refl", "map_RMA"] {
            self.warn_of_map(key, "is not supported: ignored");
        }
        if self.has_only_ambient_map() {
            self.warn_of_map("map_Ka", "is taken as the colour, as there is no 'map_Kd'");
        } else if self.source.map("map_Ka").is_some_and(|ambient| !self.is_color_map(&ambient)) {
            self.warn_of_map("map_Ka", "is ignored: it is for ambient light, which path tracing replaces");
        }
        if self.source.map("norm").is_some() {
            self.warn_of_map("bump", "is ignored, as there is a 'norm'");
        }
    }

    /// Warns of maps of smooth glass, which has only a tint.
    fn warn_of_glass(&mut self) {
        for key in ["map_Kd", "map_Ks", "map_d", "map_Pr", "map_Pm", "map_Ps"] {
            self.warn_of_map(key, "is ignored: the material is smooth glass by its 'illum'");
        }
    }

    /// Warns of values that are clamped to 0..1, and of an invalid index of refraction.
    fn warn_of_ranges(&mut self) {
        let source = self.source;
        let is_in_unit_range = |x: &f32| (0.0..=1.0).contains(x);
        let colors = ["Kd", "Ks", "Tf"]
            .into_iter()
            .filter(|k| source.color(k).is_some_and(|c| !c.iter().all(is_in_unit_range)));
        let numbers = ["d", "Tr", "Pr", "Pm", "Ps", "Pc", "Pcr", "aniso"].into_iter();
        let numbers = numbers.filter(|k| source.number(k).is_some_and(|n| !is_in_unit_range(&n)));
        let clamped: Vec<String> = colors.chain(numbers).map(|key| format!("'{key}'")).collect();
        if !clamped.is_empty() {
            self.warn("", format!("{} outside 0 to 1: clamped", clamped.join(", ")));
        }
        if let Some(ior) = source.number("Ni").filter(|n| !IORS.contains(n)) {
            self.warn("", format!("'Ni' {ior} is not an index of refraction from 1 to 10: ignored"));
        }
    }

    fn warn_of_map(&mut self, key: &str, why: &str) {
        if let Some(map) = self.source.map(key) {
            self.warn(&format!("line {}", map.line), format!("'{key}' {why}"));
        }
    }

    fn warn(&mut self, place: &str, message: String) {
        let message = format!("material '{}': {message}", self.source.name);
        self.loaded.warnings.push(Warning::new(self.library, place, message));
    }
}

/// Roughness from a Phong exponent: GGX alpha = sqrt(2 / (ns + 2)) (Walter et al. 2007, eq. 50).
fn roughness_of_exponent(ns: f32) -> f32 {
    (2.0 / (ns.max(0.0) + 2.0)).sqrt().sqrt()
}

fn unit(x: f32) -> f32 {
    if x.is_nan() { 0.0 } else { x.clamp(0.0, 1.0) }
}

fn clamped(rgb: [f32; 3]) -> [f32; 3] {
    rgb.map(unit)
}

/// Images of MTL materials as textures; each file is read once per use.
pub(super) struct Maps<'a> {
    pub options: &'a LoadOptions,
    /// By file and use; `None` for unreadable images.
    images: HashMap<(PathBuf, Use), Option<ImageId>>,
    /// Normal maps converted from height maps, by file and bits of `-bm`; `None` for files that are normal maps already.
    bumps: HashMap<(PathBuf, u32), Option<ImageId>>,
}

impl<'a> Maps<'a> {
    pub fn new(options: &'a LoadOptions) -> Maps<'a> {
        Maps { options, images: HashMap::new(), bumps: HashMap::new() }
    }

    /// The texture of a statement in the file `library`; `None`, with a warning, for missing or damaged files.
    pub fn texture(
        &mut self,
        map: &Map,
        library: &Path,
        purpose: Use,
        loaded: &mut Loaded,
    ) -> Option<TextureId> {
        let (_, image) = self.image(map, library, purpose, loaded)?;
        Some(push_texture(&mut loaded.scene, map, image))
    }

    /// A data texture and its channel: that of `-imfchan`, else alpha if `alpha_first` and the image has alpha, else red.
    pub fn number(
        &mut self,
        map: &Map,
        library: &Path,
        alpha_first: bool,
        loaded: &mut Loaded,
    ) -> Option<(TextureId, u8)> {
        let (_, image) = self.image(map, library, Use::Data, loaded)?;
        let channels = loaded.scene.images[image.index()].channels;
        let has_alpha = channels == 2 || channels == 4;
        let channel = map.channel.unwrap_or(if alpha_first && has_alpha { 3 } else { 0 });
        Some((push_texture(&mut loaded.scene, map, image), channel))
    }

    /// A normal map. `is_height`: the statement is for height maps, but the image may still be a normal map.
    pub fn normal(
        &mut self,
        map: &Map,
        library: &Path,
        is_height: bool,
        loaded: &mut Loaded,
    ) -> Option<NormalMap> {
        let (path, image) = self.image(map, library, Use::Data, loaded)?;
        let unconverted =
            |scene: &mut Scene| NormalMap { texture: push_texture(scene, map, image), scale: map.bump };
        if !is_height {
            return Some(unconverted(&mut loaded.scene));
        }
        let key = (path, map.bump.to_bits());
        let id = match self.bumps.get(&key) {
            Some(known) => *known,
            None => {
                let made = match loaded.scene.images[image.index()].decoded(&mut loaded.warnings) {
                    Ok(heights) if holds_normals(&heights) => None,
                    Ok(heights) => Some(normals_of_heights(&heights, map.bump * BUMP_HEIGHT)),
                    Err(Damage::LeftOut(warning)) => {
                        loaded.warnings.push(warning);
                        return None;
                    }
                    // Damaged texture files are never fatal.
                    Err(Damage::Fatal(_)) => return None,
                };
                let id = made.map(|normals| loaded.scene.add_image(normals));
                *self.bumps.entry(key).or_insert(id)
            }
        };
        Some(match id {
            Some(id) => NormalMap { texture: push_texture(&mut loaded.scene, map, id), scale: 1.0 },
            None => unconverted(&mut loaded.scene),
        })
    }

    fn image(
        &mut self,
        map: &Map,
        library: &Path,
        purpose: Use,
        loaded: &mut Loaded,
    ) -> Option<(PathBuf, ImageId)> {
        let mut warn = |message: String| {
            let place = format!("line {}", map.line);
            loaded.warnings.push(Warning::new(
                library,
                place,
                ("texture-left-out", format!("texture left out: {message}")),
            ));
        };
        let path = match find(library, &map.file, self.options) {
            Ok(path) => path,
            Err(message) => {
                warn(message);
                return None;
            }
        };
        let cached = self.images.get(&(path.clone(), purpose)).copied();
        let id = cached.unwrap_or_else(|| {
            let (library, place) = (library.to_path_buf(), format!("line {}", map.line));
            let warning = move |e: Error| {
                Warning::new(&library, place.as_str(), ("texture-left-out", format!("texture left out: {e}")))
            };
            let later = warning.clone();
            let on_damage = Arc::new(move |e| Damage::LeftOut(later(e)));
            match image::read_for_texture(
                &path,
                purpose,
                self.options.memory_limit,
                &mut loaded.warnings,
                on_damage,
            ) {
                Ok(image) => Some(loaded.scene.add_image(image)),
                Err(e) => {
                    loaded.warnings.push(warning(e));
                    None
                }
            }
        });
        self.images.insert((path.clone(), purpose), id);
        Some((path, id?))
    }
}

/// Adds a texture with the options of a statement. As v is flipped to point down, `v s + o` becomes `v s + 1 - s - o`.
fn push_texture(scene: &mut Scene, map: &Map, image: ImageId) -> TextureId {
    let ([u, v], [ou, ov]) = (map.scale, map.offset);
    let transform = TextureTransform {
        offset: Vec2::new(ou, 1.0 - v - ov),
        scale: Vec2::new(u, v),
        ..TextureTransform::default()
    };
    let wrap = if map.clamp { Wrap::Clamp } else { Wrap::Repeat };
    scene.textures.push(Texture::Image {
        image,
        wrap_u: wrap,
        wrap_v: wrap,
        interpolation: Interpolation::Bilinear,
        mapping: Mapping::Uv { set: 0, transform },
    });
    TextureId(scene.textures.len() as u32 - 1)
}
