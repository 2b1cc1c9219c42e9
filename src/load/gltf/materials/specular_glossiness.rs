//! KHR_materials_pbrSpecularGlossiness, the older model, in terms of the newer one: a dielectric whose reflection has
//! the specular colour, over the diffuse colour, with the roughness 1 - glossiness.

use super::builder::{Base, Builder};
use crate::scene::{ColorSlot, FloatSlot, PbrMaterial};

/// Reflectance at normal incidence of an index of refraction of 1.5, which KHR_materials_specular multiplies by its
/// colour: dividing by it gives any specular colour.
const NORMAL_REFLECTANCE: f32 = 0.04;

/// The model's parameters.
pub(super) struct SpecularGlossiness {
    /// Diffuse colour and opacity.
    pub diffuse: Base,
    specular_color: ColorSlot,
    roughness: FloatSlot,
}

impl SpecularGlossiness {
    /// The same in the newer model's terms.
    pub fn model(&self) -> PbrMaterial {
        PbrMaterial {
            base_color: self.diffuse.color,
            metallic: FloatSlot::constant(0.0),
            roughness: self.roughness,
            specular_color: self.specular_color,
            ..PbrMaterial::default()
        }
    }
}

impl Builder<'_, '_> {
    /// The older model, if the material has it.
    pub fn specular_glossiness(&mut self) -> Option<SpecularGlossiness> {
        let (extension, place) = self.extension("KHR_materials_pbrSpecularGlossiness")?;
        let from = (extension, place.as_str());
        let [r, g, b, alpha] = self.numbers(from, "diffuseFactor", [1.0; 4]);
        let specular = self.numbers(from, "specularFactor", [1.0; 3]);
        let glossiness = self.number(from, "glossinessFactor", 1.0, [0.0, 1.0]);
        let texture = self.info(from, "diffuseTexture");
        let color = self.color([r, g, b], texture.as_ref(), &format!("{place}/diffuseTexture"));
        let texture = self.info(from, "specularGlossinessTexture");
        let at = format!("{place}/specularGlossinessTexture");
        let roughness = match texture.as_ref().filter(|_| glossiness > 0.0) {
            Some(info) => self.roughness_of_gloss(glossiness, info, &at),
            None => FloatSlot::constant(1.0 - glossiness),
        };
        let specular = specular.map(|s| s / NORMAL_REFLECTANCE);
        let specular_color = self.color(specular, texture.as_ref(), &at);
        Some(SpecularGlossiness { diffuse: Base { color, alpha }, specular_color, roughness })
    }
}
