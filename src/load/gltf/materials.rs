//! Materials: the metallic-roughness model with the extensions that the scene's model knows. Each is built when the
//! first primitive that is seen asks for it.

use super::document::{Document, Report, name_of, pointer};
use super::textures::{LAST_UV_SET, Reference, Textures};
use crate::image::Encoding;
use crate::scene::{
    AlphaMode, ColorSlot, Emission, FloatSlot, Material, MaterialId, Model, NormalMap, PbrMaterial,
};
use gltf::json::extensions::material as ext;
use gltf::json::material::AlphaMode as AlphaModeJson;
use gltf::json::texture::Info;
use gltf::json::validation::Checked;
use std::collections::HashMap;

/// What a material needs from a mesh.
#[derive(Clone, Copy, Default)]
pub(super) struct Needs {
    /// Which sets of texture coordinates its textures use.
    pub uv_sets: [bool; LAST_UV_SET as usize + 1],
    /// Tangents.
    pub tangents: bool,
}

/// Largest factor on a normal map's slopes; beyond, the surface is a comb of vertical walls.
const MOST_NORMAL_SCALE: f32 = 1000.0;

/// The materials found so far.
#[derive(Default)]
pub(super) struct Materials {
    /// The scene's materials.
    pub list: Vec<Material>,
    /// Their textures.
    pub textures: Textures,
    /// The caller replaces all materials: none is read, and the default stands for each.
    pub geometry_only: bool,
    needs: Vec<Needs>,
    known: HashMap<Option<usize>, Option<MaterialId>>,
}

impl Materials {
    /// The material of an index, or glTF's default; `from` points to what refers to it. Problems are noted.
    pub fn get(
        &mut self,
        doc: &Document,
        index: Option<usize>,
        from: &str,
        report: &mut Report,
    ) -> Option<MaterialId> {
        let index = index.filter(|_| !self.geometry_only);
        if let Some(known) = self.known.get(&index) {
            return *known;
        }
        let built = match index {
            Some(index) => build(doc, index, from, &mut self.textures, report),
            None => {
                // Whatever replaces it may need the first set.
                let mut needs = Needs::default();
                needs.uv_sets[0] = self.geometry_only;
                Some((default_material(), needs))
            }
        };
        let id = built.map(|(material, needs)| {
            self.list.push(material);
            self.needs.push(needs);
            MaterialId(self.list.len() as u32 - 1)
        });
        self.known.insert(index, id);
        id
    }

    /// What a material needs from the meshes that it is on.
    pub fn needs(&self, material: MaterialId) -> Needs {
        self.needs[material.index()]
    }

    /// A mesh with this material has vertex colours.
    pub fn use_vertex_colors(&mut self, material: MaterialId) {
        self.list[material.index()].use_vertex_colors = true;
    }

    /// How many materials of the file are in use.
    pub fn used(&self) -> usize {
        self.known.keys().flatten().count()
    }
}

/// What glTF gives to primitives without a material.
fn default_material() -> Material {
    let model = Model::Pbr(Box::default());
    Material { double_sided: false, ..Material::new("default", model) }
}

fn build(
    doc: &Document,
    index: usize,
    from: &str,
    textures: &mut Textures,
    report: &mut Report,
) -> Option<(Material, Needs)> {
    let json: gltf::json::Material = doc.entry("materials", index, from, report)?;
    let name = name_of(doc.raw("materials", index, from, report)?, "material", index);
    let at = pointer("materials", index);
    let mut builder = Builder { doc, at, textures, report, needs: Needs::default() };
    let pbr = &json.pbr_metallic_roughness;
    let base = builder.base_color(&json);
    let extensions = json.extensions.clone().unwrap_or_default();
    let unlit = extensions.unlit.is_some();
    let mut material = Material {
        double_sided: json.double_sided,
        alpha: FloatSlot {
            factor: builder.unit(pbr.base_color_factor.0[3], "/pbrMetallicRoughness/baseColorFactor"),
            texture: base.texture.map(|texture| (texture, 3)),
        },
        ..Material::new(name, Model::Black)
    };
    material.alpha_mode = builder.alpha_mode(&json);
    if material.alpha_mode == AlphaMode::Opaque {
        material.alpha = FloatSlot::constant(1.0);
    }
    if unlit {
        builder.report.warn(&*builder.at, "is unlit: it shines with its base colour, whatever lights it");
        material.emission = Some(Emission { radiance: base, two_sided: json.double_sided });
    } else {
        material.emission = builder.emission(&json, &extensions);
        material.model = Model::Pbr(Box::new(builder.model(&json, base, &extensions)));
        material.normal_map = builder.normal_map(&json);
    }
    let needs = Needs { tangents: material.normal_map.is_some(), ..builder.needs };
    Some((material, needs))
}

/// One material being built.
struct Builder<'b, 'a> {
    doc: &'b Document<'a>,
    /// The material's JSON pointer.
    at: String,
    textures: &'b mut Textures,
    report: &'b mut Report,
    needs: Needs,
}

impl Builder<'_, '_> {
    fn texture(&mut self, reference: &Reference, encoding: Encoding) -> Option<crate::scene::TextureId> {
        let id = self.textures.get(self.doc, reference, encoding, self.report)?;
        if let Some(used) = self.needs.uv_sets.get_mut(reference.effective_uv_set() as usize) {
            *used = true;
        }
        Some(id)
    }

    fn color(&mut self, factor: [f32; 3], info: Option<&Info>, place: &str) -> ColorSlot {
        let reference = info.map(|info| Reference::new(info, format!("{}{place}", self.at)));
        ColorSlot { factor, texture: reference.and_then(|r| self.texture(&r, Encoding::Srgb)) }
    }

    fn float(&mut self, factor: f32, info: Option<&Info>, channel: u8, place: &str) -> FloatSlot {
        let reference = info.map(|info| Reference::new(info, format!("{}{place}", self.at)));
        let texture = reference.and_then(|r| self.texture(&r, Encoding::Linear));
        FloatSlot { factor, texture: texture.map(|id| (id, channel)) }
    }

    /// A factor that should be in 0..1; clamped with a warning.
    fn unit(&mut self, value: f32, place: &str) -> f32 {
        self.clamped(value, 0.0, 1.0, place)
    }

    fn clamped(&mut self, value: f32, least: f32, most: f32, place: &str) -> f32 {
        if !(least..=most).contains(&value) {
            let message = format!("{value} is not in {least}..{most} and was clamped");
            self.report.warn(format!("{}{place}", self.at), message);
        }
        value.max(least).min(most)
    }

    fn base_color(&mut self, json: &gltf::json::Material) -> ColorSlot {
        let pbr = &json.pbr_metallic_roughness;
        let place = "/pbrMetallicRoughness/baseColorFactor";
        let [r, g, b, _] = pbr.base_color_factor.0;
        let factor = [r, g, b].map(|c| self.unit(c, place));
        self.color(factor, pbr.base_color_texture.as_ref(), "/pbrMetallicRoughness/baseColorTexture")
    }

    fn alpha_mode(&mut self, json: &gltf::json::Material) -> AlphaMode {
        match json.alpha_mode {
            Checked::Valid(AlphaModeJson::Opaque) => AlphaMode::Opaque,
            Checked::Valid(AlphaModeJson::Blend) => AlphaMode::Blend,
            Checked::Valid(AlphaModeJson::Mask) => {
                AlphaMode::Mask { cutoff: json.alpha_cutoff.map_or(0.5, |c| c.0) }
            }
            Checked::Invalid => {
                let at = format!("{}/alphaMode", self.at);
                self.report.problem(at, "is none of OPAQUE, MASK and BLEND");
                AlphaMode::Opaque
            }
        }
    }

    /// Radiance is emissiveFactor * emissiveStrength * texture; `None` for a factor of 0.
    fn emission(&mut self, json: &gltf::json::Material, extensions: &ext::Material) -> Option<Emission> {
        let strength = extensions.emissive_strength.as_ref().map_or(1.0, |e| e.emissive_strength.0);
        let place = "/extensions/KHR_materials_emissive_strength/emissiveStrength";
        let strength = self.clamped(strength, 0.0, f32::MAX, place);
        let factor = json.emissive_factor.0.map(|c| self.clamped(c, 0.0, f32::MAX, "/emissiveFactor"));
        let factor = factor.map(|c| (c * strength).min(f32::MAX));
        if factor == [0.0; 3] {
            return None;
        }
        let radiance = self.color(factor, json.emissive_texture.as_ref(), "/emissiveTexture");
        Some(Emission { radiance, two_sided: json.double_sided })
    }

    fn normal_map(&mut self, json: &gltf::json::Material) -> Option<NormalMap> {
        let normal = json.normal_texture.as_ref()?;
        let at = format!("{}/normalTexture", self.at);
        let raw = normal.extensions.as_ref().and_then(|e| e.others.get("KHR_texture_transform"));
        let transform = match raw.map(|t| serde_json::from_value(t.clone())) {
            None => None,
            Some(Ok(transform)) => Some(transform),
            Some(Err(e)) => {
                let at = format!("{at}/extensions/KHR_texture_transform");
                self.report.problem(at, format!("can't be understood: {e}"));
                None
            }
        };
        let reference = Reference { texture: normal.index.value(), uv_set: normal.tex_coord, transform, at };
        let texture = self.texture(&reference, Encoding::Linear)?;
        let scale = self.clamped(normal.scale, -MOST_NORMAL_SCALE, MOST_NORMAL_SCALE, "/normalTexture/scale");
        Some(NormalMap { texture, scale })
    }

    fn model(
        &mut self,
        json: &gltf::json::Material,
        base_color: ColorSlot,
        extensions: &ext::Material,
    ) -> PbrMaterial {
        let pbr = &json.pbr_metallic_roughness;
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
            model.has_volume = true;
            model.attenuation_color =
                volume.attenuation_color.0.map(|c| self.unit(c, &format!("{place}/attenuationColor")));
            let distance = volume.attenuation_distance.0;
            let place = format!("{place}/attenuationDistance");
            model.attenuation_distance = self.clamped(distance, f32::MIN_POSITIVE, f32::INFINITY, &place);
        }
        model
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

    /// The index of refraction is 0 (total reflection) or at least 1.
    fn ior(&mut self, ior: f32) -> f32 {
        if ior == 0.0 { 0.0 } else { self.clamped(ior, 1.0, f32::MAX, "/extensions/KHR_materials_ior/ior") }
    }
}
