//! The metallic-roughness model, and what all models share: emission, alpha, normal maps.

use super::builder::{Base, Builder};
use crate::load::gltf::options::Glass;
use crate::scene::{AlphaMode, ColorSlot, Emission, FloatSlot, NormalMap, PbrMaterial};
use gltf::json::extensions::material as ext;
use gltf::json::material::AlphaMode as AlphaModeJson;
use gltf::json::validation::Checked;
use serde_json::Value;

impl Builder<'_, '_> {
    /// The base colour, white where nothing is said.
    pub fn base_color(&mut self, json: &gltf::json::Material) -> Base {
        let pbr = &json.pbr_metallic_roughness;
        let place = "/pbrMetallicRoughness/baseColorFactor";
        let [r, g, b, alpha] = pbr.base_color_factor.0.map(|c| self.unit(c, place));
        let texture = pbr.base_color_texture.as_ref();
        Base { color: self.color([r, g, b], texture, "/pbrMetallicRoughness/baseColorTexture"), alpha }
    }

    /// What alpha does.
    pub fn alpha_mode(&mut self, json: &gltf::json::Material) -> AlphaMode {
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
            self.report.warn(place, "is lost: the material does not shine, rather than everywhere alike");
            return None;
        }
        Some(Emission { radiance, two_sided: json.double_sided })
    }

    /// The normal map of the base.
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
        if self.doc.is_from_blender() && self.says_nothing() {
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

    /// Does the material say nothing about how its surface scatters?
    pub fn says_nothing(&self) -> bool {
        let extensions = self.raw.get("extensions").and_then(Value::as_object);
        let emits_at_most = |name: &String| name == "KHR_materials_emissive_strength";
        self.raw.get("pbrMetallicRoughness").is_none()
            && extensions.is_none_or(|all| all.keys().all(emits_at_most))
    }

    /// A material by Blender that says nothing about its surface: the exporter writes that for shader nodes that glTF
    /// has no words for. By the specification it would be a white metal.
    fn lost_nodes(&mut self, base_color: ColorSlot) -> PbrMaterial {
        let message = "has no pbrMetallicRoughness: Blender could not export its nodes (only Principled BSDF \
                       goes over); taken as white and diffuse";
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
        self.needs.glass = true;
        match self.doc.options.glass {
            Glass::Solid => make_solid(model),
            Glass::Auto if self.doc.is_our_export() => make_solid(model),
            Glass::Auto | Glass::Panes if !model.has_volume && self.doc.is_from_blender() => {
                self.needs.body = true;
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

    /// The index of refraction is 0 (total reflection) or at least 1.
    fn ior(&mut self, ior: f32) -> f32 {
        if ior == 0.0 { 0.0 } else { self.clamped(ior, 1.0, f32::MAX, "/extensions/KHR_materials_ior/ior") }
    }
}

/// Gives a body to glass that has none in the file. Its exporters mean a solid whose colour shows once in light that has
/// passed all of it.
fn make_solid(model: &mut PbrMaterial) {
    model.tints_once |= !model.has_volume;
    model.has_volume = true;
}
