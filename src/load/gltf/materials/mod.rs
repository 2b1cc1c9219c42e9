//! Materials: the metallic-roughness model with its extensions, and the specular-glossiness model converted to it.
//! Materials are built on demand of visible primitives.

mod extensions;

use super::document::{Document, name_of, number_of, numbers_of, pointer};
use super::lights;
use super::report::{Report, Valid};
use super::textures::{Gloss, Reference, Textures};
use crate::image::Encoding;
use crate::load::options::Glass;
use crate::scene::{
    AlphaMode, ColorSlot, Emission, FloatSlot, Material, MaterialId, Model, NormalMap, PbrMaterial, TextureId,
};
use gltf::json::extensions::material as ext;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::AlphaMode as AlphaModeJson;
use gltf::json::texture::Info;
use gltf::json::validation::Checked;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::HashMap;

/// The materials built so far.
#[derive(Default)]
pub(super) struct Materials {
    /// The scene's materials.
    pub list: Vec<Material>,
    /// Their textures.
    pub textures: Textures,
    /// The caller replaces all materials: all are the default material.
    pub geometry_only: bool,
    /// Losses of the exporter, parallel to `list`.
    pub export_losses: Vec<ExportLosses>,
    needs: Vec<MaterialNeeds>,
    /// Materials of panes that became thin sheets.
    panes: Vec<MaterialId>,
    /// The material of Gaussian splats, if any.
    splats: Option<MaterialId>,
    /// Built materials by index in the file; `None` is the default material.
    known: HashMap<Option<usize>, Valid<MaterialId>>,
}

impl Materials {
    /// The material at an index, or glTF's default; `from` is the JSON pointer of the reference to it.
    pub fn get(
        &mut self,
        doc: &Document,
        index: Option<usize>,
        from: &str,
        report: &mut Report,
    ) -> Valid<MaterialId> {
        let index = index.filter(|_| !self.geometry_only);
        if let Some(known) = self.known.get(&index) {
            return *known;
        }
        let built = match index {
            Some(index) => report.lasting(|report| build(doc, index, from, &mut self.textures, report)),
            None => Ok((default_material(), MaterialNeeds::default(), ExportLosses::default())),
        };
        let id = built.map(|(material, needs, export_losses)| {
            self.list.push(material);
            self.export_losses.push(export_losses);
            self.needs.push(needs);
            MaterialId(self.list.len() as u32 - 1)
        });
        self.known.insert(index, id);
        id
    }

    /// The material of Gaussian splats.
    pub fn of_splats(&mut self) -> MaterialId {
        *self.splats.get_or_insert_with(|| {
            self.list.push(crate::load::splats::material());
            self.export_losses.push(ExportLosses::default());
            self.needs.push(MaterialNeeds::default());
            MaterialId(self.list.len() as u32 - 1)
        })
    }

    /// Removes everything but the cached images.
    pub fn forget(&mut self) {
        let mut textures = std::mem::take(&mut self.textures);
        textures.forget();
        *self = Materials { textures, geometry_only: self.geometry_only, ..Materials::default() };
    }

    /// The attributes that a material needs from its meshes.
    pub fn needs(&self, material: MaterialId) -> MaterialNeeds {
        self.needs[material.index()]
    }

    /// Makes a material use vertex colours.
    pub fn use_vertex_colors(&mut self, material: MaterialId) {
        self.list[material.index()].use_vertex_colors = true;
    }

    /// Number of materials of the file in use.
    pub fn used(&self) -> usize {
        self.known.keys().flatten().count()
    }
}

/// The priority of a material's medium where solids overlap: the custom property `priority` in the `extras`.
fn priority(raw: &Value, at: &str, report: &mut Report) -> i32 {
    let Some(value) = raw.get("extras").and_then(|extras| extras.get("priority")) else { return 0 };
    let integer = value.as_f64().filter(|v| v.fract() == 0.0 && v.abs() <= 1000.0);
    if integer.is_none() {
        report.warn(format!("{at}/extras/priority"), "is not a whole number from -1000 to 1000; ignored");
    }
    integer.unwrap_or(0.0) as i32
}

/// The default material of glTF.
fn default_material() -> Material {
    let model = Model::Pbr(Box::default());
    Material { double_sided: false, ..Material::new("default", model) }
}

/// Materials of a scene that stand in for missing ones: those equal to the default material.
pub(super) fn default_materials(materials: &[Material]) -> Vec<MaterialId> {
    let default = default_material();
    let is_default =
        |m: &Material| m.name == default.name && m.model == default.model && m.emission.is_none();
    (0u32..).zip(materials).filter(|(_, m)| is_default(m)).map(|(i, _)| MaterialId(i)).collect()
}

fn build(
    doc: &Document,
    index: usize,
    from: &str,
    textures: &mut Textures,
    report: &mut Report,
) -> Valid<(Material, MaterialNeeds, ExportLosses)> {
    let json: gltf::json::Material = doc.entry("materials", index, from, report)?;
    let raw = doc.raw("materials", index, from, report)?;
    let name = name_of(raw, "material", index);
    let at = pointer("materials", index);
    let mut builder = MaterialBuilder { doc, raw, at, textures, report, needs: MaterialNeeds::default() };
    let extensions = json.extensions.clone().unwrap_or_default();
    let specular_glossiness = builder.specular_glossiness();
    let base = match &specular_glossiness {
        Some(specular_glossiness) => specular_glossiness.diffuse,
        None => builder.base_color(&json),
    };
    let mut material = Material {
        double_sided: json.double_sided,
        alpha: FloatSlot { factor: base.alpha, texture: base.color.texture.map(|texture| (texture, 3)) },
        ..Material::new(name, Model::Black)
    };
    material.light_group = lights::light_group(raw, &builder.at, builder.report).unwrap_or_default();
    material.priority = priority(raw, &builder.at, builder.report);
    material.alpha_mode = builder.alpha_mode(&json);
    if material.alpha_mode == AlphaMode::Opaque {
        material.alpha = FloatSlot::constant(1.0);
    }
    if extensions.unlit.is_some() {
        builder.report.warn(&*builder.at, "is unlit: it emits its base colour and reflects no light");
        material.emission = Some(Emission { radiance: base.color, two_sided: json.double_sided });
    } else {
        material.emission = builder.emission(&json, &extensions);
        let mut model = match &specular_glossiness {
            Some(specular_glossiness) => specular_glossiness.model(),
            None => builder.model(&json, base.color, &extensions),
        };
        builder.add_layers(&mut model);
        material.medium = builder.scattering(&mut model);
        material.model = Model::Pbr(Box::new(model));
        material.normal_map = builder.normal_map(&json);
    }
    let tangents = match &material.model {
        Model::Pbr(p) => p.anisotropy.is_some() || p.clearcoat.is_some_and(|c| c.normal_map.is_some()),
        _ => false,
    };
    let needs = MaterialNeeds { tangents: tangents || material.normal_map.is_some(), ..builder.needs };
    let export_losses = ExportLosses::of(&builder, base.color, material.alpha_mode);
    Ok((material, needs, export_losses))
}

// Slots, numbers and textures of one material, validated on reading.

/// Maximum factor on the slopes of a normal map.
const MAX_NORMAL_SCALE: f32 = 1000.0;

/// Colour and opacity of a surface.
#[derive(Clone, Copy)]
struct Base {
    pub color: ColorSlot,
    /// Opacity; a factor on the alpha of the colour's texture.
    pub alpha: f32,
}

/// One material being built.
struct MaterialBuilder<'b, 'a> {
    pub doc: &'b Document<'a>,
    /// The material's raw JSON.
    pub raw: &'b Value,
    /// The material's JSON pointer.
    pub at: String,
    /// The textures of all materials.
    pub textures: &'b mut Textures,
    /// Problems and warnings.
    pub report: &'b mut Report,
    /// Mesh attributes that the material needs.
    pub needs: MaterialNeeds,
}

impl<'b> MaterialBuilder<'b, '_> {
    /// An extension of the material and its JSON pointer relative to the material.
    pub fn extension(&self, name: &str) -> Option<(&'b Value, String)> {
        let extension = self.raw.get("extensions")?.get(name)?;
        Some((extension, format!("/extensions/{name}")))
    }

    fn texture(&mut self, reference: Reference, encoding: Encoding) -> Valid<TextureId> {
        let (mut slots, set) = (self.needs.uv_slots, reference.effective_uv_set());
        let Some(slot) = slots.take(set) else {
            let message =
                format!("uses the texture coordinates {set}, a third set for its material; left out");
            return Err(self.report.warn(reference.at.clone(), message));
        };
        let reference = Reference { slot, ..reference };
        let id = self.textures.get(self.doc, &reference, encoding, self.report)?;
        self.needs.uv_slots = slots;
        Ok(id)
    }

    /// A colour slot; JSON pointers are relative to the material.
    pub fn color(&mut self, factor: [f32; 3], info: Option<&Info>, place: &str) -> ColorSlot {
        let reference = info.map(|info| Reference::new(info, format!("{}{place}", self.at)));
        ColorSlot { factor, texture: reference.and_then(|r| self.texture(r, Encoding::Srgb).ok()) }
    }

    /// A scalar slot: a channel of a texture times a factor.
    pub fn float(&mut self, factor: f32, info: Option<&Info>, channel: u8, place: &str) -> FloatSlot {
        let reference = info.map(|info| Reference::new(info, format!("{}{place}", self.at)));
        let texture = reference.and_then(|r| self.texture(r, Encoding::Linear).ok());
        FloatSlot { factor, texture: texture.map(|id| (id, channel)) }
    }

    /// Roughness from a glossiness texture and its factor.
    pub fn roughness_of_gloss(&mut self, factor: f32, info: &Info, place: &str) -> FloatSlot {
        let at = format!("{}{place}", self.at);
        let reference = Reference { gloss: Some(Gloss::new(factor)), ..Reference::new(info, at) };
        match self.texture(reference, Encoding::Linear) {
            Ok(id) => FloatSlot { factor: 1.0, texture: Some((id, 0)) },
            Err(_) => FloatSlot::constant(1.0 - factor),
        }
    }

    /// Clamps a factor to 0..1, with a warning.
    pub fn unit(&mut self, value: f32, place: &str) -> f32 {
        self.clamped(value, 0.0, 1.0, place)
    }

    /// Clamps a number to a range, with a warning.
    pub fn clamped(&mut self, value: f32, least: f32, most: f32, place: &str) -> f32 {
        if !(least..=most).contains(&value) {
            let message = format!("{value} is not in {least}..{most} and was clamped");
            self.report.warn(format!("{}{place}", self.at), message);
        }
        value.max(least).min(most)
    }

    /// A number of an extension, clamped to a range.
    pub fn number(&mut self, from: (&Value, &str), key: &str, default: f32, range: [f32; 2]) -> f32 {
        let (extension, place) = from;
        let number = number_of(extension, key, &format!("{}{place}", self.at), self.report);
        let value = number.unwrap_or(None).map_or(default, |n| n as f32);
        self.clamped(value, range[0], range[1], &format!("{place}/{key}"))
    }

    /// A colour of an extension, clamped to 0..1.
    pub fn numbers<const N: usize>(
        &mut self,
        from: (&Value, &str),
        key: &str,
        default: [f32; N],
    ) -> [f32; N] {
        let (extension, place) = from;
        let numbers = numbers_of::<N>(extension, key, &format!("{}{place}", self.at), self.report);
        let value = numbers.unwrap_or(None).map_or(default, |n| n.map(|v| v as f32));
        value.map(|v| self.unit(v, &format!("{place}/{key}")))
    }

    /// A texture reference of an extension; `None` if invalid, which is reported.
    pub fn info(&mut self, from: (&Value, &str), key: &str) -> Option<Info> {
        let (extension, place) = from;
        let raw = extension.get(key)?;
        parsed(raw, &format!("{}{place}/{key}", self.at), self.report).ok()
    }

    /// A linear (non-colour) texture of an extension.
    pub fn data_texture(&mut self, from: (&Value, &str), key: &str) -> Option<TextureId> {
        let info = self.info(from, key)?;
        let reference = Reference::new(&info, format!("{}{}/{key}", self.at, from.1));
        self.texture(reference, Encoding::Linear).ok()
    }

    /// The normal map at a JSON pointer in the material; `None` if invalid, which is reported.
    pub fn normal_map_at(&mut self, place: &str) -> Option<NormalMap> {
        let raw = self.raw.pointer(place)?;
        self.normal_map_of(raw, place).ok()
    }

    fn normal_map_of(&mut self, raw: &Value, place: &str) -> Valid<NormalMap> {
        let at = format!("{}{place}", self.at);
        let info: Info = parsed(raw, &at, self.report)?;
        // The crate doesn't parse the texture transform of these references.
        let key = "/extensions/KHR_texture_transform";
        let transform: Option<TextureTransform> = match raw.pointer(key) {
            Some(raw) => Some(parsed(raw, &format!("{at}{key}"), self.report)?),
            None => None,
        };
        let reference = Reference { transform, ..Reference::new(&info, at.clone()) };
        let texture = self.texture(reference, Encoding::Linear)?;
        let scale = number_of(raw, "scale", &at, self.report)?.map_or(1.0, |s| s as f32);
        let scale = self.clamped(scale, -MAX_NORMAL_SCALE, MAX_NORMAL_SCALE, &format!("{place}/scale"));
        Ok(NormalMap { texture, scale })
    }
}

/// Parses a JSON value as a type of the `gltf` crate.
fn parsed<T: DeserializeOwned>(raw: &Value, at: &str, report: &mut Report) -> Valid<T> {
    T::deserialize(raw).map_err(|e| report.problem(at, format!("can't be parsed: {e}")))
}

// The metallic-roughness model; emission, alpha and normal maps of all models.

impl MaterialBuilder<'_, '_> {
    /// The base colour, white by default.
    pub fn base_color(&mut self, json: &gltf::json::Material) -> Base {
        let pbr = &json.pbr_metallic_roughness;
        let place = "/pbrMetallicRoughness/baseColorFactor";
        let [r, g, b, alpha] = pbr.base_color_factor.0.map(|c| self.unit(c, place));
        let texture = pbr.base_color_texture.as_ref();
        Base { color: self.color([r, g, b], texture, "/pbrMetallicRoughness/baseColorTexture"), alpha }
    }

    pub fn alpha_mode(&mut self, json: &gltf::json::Material) -> AlphaMode {
        match json.alpha_mode {
            Checked::Valid(AlphaModeJson::Opaque) => AlphaMode::Opaque,
            Checked::Valid(AlphaModeJson::Blend) => AlphaMode::Blend,
            Checked::Valid(AlphaModeJson::Mask) => {
                AlphaMode::Mask { cutoff: json.alpha_cutoff.map_or(0.5, |c| c.0) }
            }
            Checked::Invalid => {
                let at = format!("{}/alphaMode", self.at);
                self.report.problem(at, "must be OPAQUE, MASK or BLEND");
                AlphaMode::Opaque
            }
        }
    }

    /// Radiance is emissiveFactor * emissiveStrength * texture; `None` for a factor of 0.
    pub fn emission(&mut self, json: &gltf::json::Material, extensions: &ext::Material) -> Option<Emission> {
        let strength = extensions.emissive_strength.as_ref().map_or(1.0, |e| e.emissive_strength.0);
        let place = "/extensions/KHR_materials_emissive_strength/emissiveStrength";
        let strength = self.clamped(strength, 0.0, f32::MAX, place);
        let factor = json.emissive_factor.0.map(|c| self.clamped(c, 0.0, f32::MAX, "/emissiveFactor"));
        let factor = factor.map(|c| (c * strength).min(f32::MAX));
        if factor == [0.0; 3] {
            return None;
        }
        let radiance = self.color(factor, json.emissive_texture.as_ref(), "/emissiveTexture");
        if json.emissive_texture.is_some() && radiance.texture.is_none() {
            let place = format!("{}/emissiveTexture", self.at);
            self.report.warn(place, "can't be read: the material emits no light");
            return None;
        }
        Some(Emission { radiance, two_sided: json.double_sided })
    }

    /// The normal map of the base layer.
    pub fn normal_map(&mut self, json: &gltf::json::Material) -> Option<NormalMap> {
        json.normal_texture.as_ref()?;
        self.normal_map_at("/normalTexture")
    }

    /// The metallic-roughness model with the extensions that change its parameters.
    pub fn model(
        &mut self,
        json: &gltf::json::Material,
        base_color: ColorSlot,
        extensions: &ext::Material,
    ) -> PbrMaterial {
        let pbr = &json.pbr_metallic_roughness;
        if self.doc.is_from_blender() && self.has_no_surface() {
            return self.lost_nodes(base_color);
        }
        let texture = pbr.metallic_roughness_texture.as_ref();
        let metallic = self.unit(pbr.metallic_factor.0, "/pbrMetallicRoughness/metallicFactor");
        let roughness = self.unit(pbr.roughness_factor.0, "/pbrMetallicRoughness/roughnessFactor");
        let place = "/pbrMetallicRoughness/metallicRoughnessTexture";
        let mut model = PbrMaterial {
            base_color,
            metallic: self.float(metallic, texture.filter(|_| metallic > 0.0), 2, place),
            roughness: self.float(roughness, texture.filter(|_| roughness > 0.0), 1, place),
            ..PbrMaterial::default()
        };
        if let Some(ior) = &extensions.ior {
            model.ior = self.ior(ior.ior.0);
        }
        if let Some(specular) = &extensions.specular {
            self.specular(specular, &mut model);
        }
        if let Some(transmission) = &extensions.transmission {
            let place = "/extensions/KHR_materials_transmission";
            let factor =
                self.unit(transmission.transmission_factor.0, &format!("{place}/transmissionFactor"));
            let texture = transmission.transmission_texture.as_ref().filter(|_| factor > 0.0);
            model.transmission = self.float(factor, texture, 0, &format!("{place}/transmissionTexture"));
        }
        if let Some(volume) = &extensions.volume {
            let place = "/extensions/KHR_materials_volume";
            model.has_volume = volume.thickness_factor.0 > 0.0;
            model.attenuation_color =
                volume.attenuation_color.0.map(|c| self.unit(c, &format!("{place}/attenuationColor")));
            let distance = volume.attenuation_distance.0;
            let place = format!("{place}/attenuationDistance");
            model.attenuation_distance = self.clamped(distance, f32::MIN_POSITIVE, f32::INFINITY, &place);
        }
        if model.transmission.factor > 0.0 {
            self.glass(&mut model);
        }
        model
    }

    /// Whether the material lacks all surface parameters.
    pub fn has_no_surface(&self) -> bool {
        let extensions = self.raw.get("extensions").and_then(Value::as_object);
        let is_emission = |name: &String| name == "KHR_materials_emissive_strength";
        self.raw.get("pbrMetallicRoughness").is_none()
            && extensions.is_none_or(|all| all.keys().all(is_emission))
    }

    /// The material in place of one without surface parameters, which Blender writes for shader nodes that glTF can't express. By
    /// the specification it would be a white metal.
    fn lost_nodes(&mut self, base_color: ColorSlot) -> PbrMaterial {
        let message = "has no pbrMetallicRoughness: Blender could not export its nodes (only Principled BSDF is supported); \
        taken as white and diffuse";
        self.report.warn(&*self.at, message);
        PbrMaterial {
            base_color,
            metallic: FloatSlot::constant(0.0),
            specular: FloatSlot::constant(0.0),
            ..PbrMaterial::default()
        }
    }

    /// Decides whether a transparent material is solid or a thin wall.
    fn glass(&mut self, model: &mut PbrMaterial) {
        self.needs.is_glass = true;
        match self.doc.options.glass {
            Glass::Solid => make_solid(model),
            Glass::Auto | Glass::Panes if !model.has_volume && self.doc.is_from_blender() => {
                self.needs.solid_if_closed = true;
                make_solid(model);
            }
            Glass::Thin | Glass::Auto | Glass::Panes => {}
        }
    }

    fn specular(&mut self, specular: &ext::Specular, model: &mut PbrMaterial) {
        let place = "/extensions/KHR_materials_specular";
        let factor = self.unit(specular.specular_factor.0, &format!("{place}/specularFactor"));
        let texture = specular.specular_texture.as_ref().filter(|_| factor > 0.0);
        model.specular = self.float(factor, texture, 3, &format!("{place}/specularTexture"));
        let at = format!("{place}/specularColorFactor");
        let color = specular.specular_color_factor.0.map(|c| self.clamped(c, 0.0, f32::MAX, &at));
        let texture = specular.specular_color_texture.as_ref().filter(|_| factor > 0.0);
        model.specular_color = self.color(color, texture, &format!("{place}/specularColorTexture"));
    }

    /// The index of refraction: 0 (Fresnel reflectance 1) or at least 1.
    fn ior(&mut self, ior: f32) -> f32 {
        if ior == 0.0 { 0.0 } else { self.clamped(ior, 1.0, f32::MAX, "/extensions/KHR_materials_ior/ior") }
    }
}

/// Makes glass solid. Glass without a volume in the file then tints light once per passage through the solid, not at each
/// of its two interfaces.
fn make_solid(model: &mut PbrMaterial) {
    model.tints_once |= !model.has_volume;
    model.has_volume = true;
}

// Attributes that materials need from their meshes.

/// The two UV sets that a mesh stores for a material, of any number in the file.
#[derive(Clone, Copy, Default)]
pub(in crate::load::gltf) struct UvSlots {
    /// UV set of the file in each slot; `None` if unused.
    pub sets: [Option<u32>; 2],
}

impl UvSlots {
    /// The slot of a UV set, allocated on first use; `None` if both slots hold others. Set 0 goes into slot 0, which
    /// materials of scene files use; others preferably go into slot 1.
    pub fn take(&mut self, set: u32) -> Option<u32> {
        let order: &[usize] = if set == 0 { &[0] } else { &[1, 0] };
        let slot = self.sets.iter().position(|s| *s == Some(set));
        let slot = slot.or_else(|| order.iter().copied().find(|&slot| self.sets[slot].is_none()))?;
        self.sets[slot] = Some(set);
        Some(slot as u32)
    }
}

/// Attributes that a material needs from a mesh.
#[derive(Clone, Copy, Default)]
pub(in crate::load::gltf) struct MaterialNeeds {
    /// UV sets of its textures.
    pub uv_slots: UvSlots,
    pub tangents: bool,
    /// The material is glass that is solid in closed meshes and thin in others.
    pub solid_if_closed: bool,
    /// The material is glass, and its meshes may be panes.
    pub is_glass: bool,
}

/// Losses of one material by Blender's exporter.
#[derive(Clone, Copy, Default)]
pub(in crate::load::gltf) struct ExportLosses {
    /// All surface parameters are missing.
    pub is_lost: bool,
    /// Opaque, pure white and without a texture.
    pub is_white: bool,
    /// A metal of roughness 1 without a texture, and not black.
    pub is_rough_metal: bool,
    /// The base colour texture of an opaque material, whose alpha is ignored.
    pub ignores_alpha_of: Option<TextureId>,
}

impl ExportLosses {
    /// Detects the losses; none in files of other exporters.
    fn of(builder: &MaterialBuilder, base: ColorSlot, alpha: AlphaMode) -> ExportLosses {
        let extension = |name: &str| builder.raw.get("extensions").is_some_and(|e| e.get(name).is_some());
        if !builder.doc.is_from_blender() || extension("KHR_materials_unlit") {
            return ExportLosses::default();
        }
        let pbr = builder.raw.get("pbrMetallicRoughness");
        let has = |key: &str| pbr.and_then(|pbr| pbr.get(key)).is_some_and(|v| *v != Value::Null);
        ExportLosses {
            is_lost: builder.has_no_surface(),
            is_white: pbr.is_some()
                && !has("baseColorFactor")
                && !has("baseColorTexture")
                && !extension("KHR_materials_transmission"),
            is_rough_metal: pbr.is_some()
                && base.factor != [0.0; 3]
                && !["metallicFactor", "roughnessFactor", "metallicRoughnessTexture"].into_iter().any(has),
            ignores_alpha_of: base.texture.filter(|_| alpha == AlphaMode::Opaque),
        }
    }
}
