//! Extensions that add a layer or a lobe: rough diffuse reflection, clearcoat, sheen, anisotropy, iridescence, dispersion and
//! diffuse transmission. A layer with a factor of 0 is left out, with its textures.

use super::{Base, MaterialBuilder};
use crate::scene::{
    Anisotropy, Clearcoat, ColorSlot, DiffuseTransmission, FloatSlot, Iridescence, Medium, PbrMaterial,
    Sheen, coefficients,
};
use serde_json::Value;

const UNIT: [f32; 2] = [0.0, 1.0];

impl MaterialBuilder<'_, '_> {
    /// Adds all that the material has.
    pub fn add_layers(&mut self, model: &mut PbrMaterial) {
        self.diffuse_roughness(model);
        model.clearcoat = self.clearcoat();
        model.sheen = self.sheen();
        model.anisotropy = self.anisotropy();
        model.iridescence = self.iridescence();
        model.diffuse_transmission = self.diffuse_transmission();
        if let Some((extension, place)) = self.extension("KHR_materials_dispersion") {
            model.dispersion = self.number((extension, &place), "dispersion", 0.0, [0.0, f32::MAX]);
        }
    }

    /// A draft, too: a roughness in the sense of Oren and Nayar, times red of its texture.
    fn diffuse_roughness(&mut self, model: &mut PbrMaterial) {
        let Some((extension, place)) = self.extension("KHR_materials_diffuse_roughness") else { return };
        let from = (extension, place.as_str());
        let at = format!("{}{place}", self.at);
        self.report.warn(
            at,
            ("extension-draft", "KHR_materials_diffuse_roughness is a draft: its support may change"),
        );
        let factor = self.number(from, "diffuseRoughnessFactor", 0.0, UNIT);
        if factor == 0.0 {
            return;
        }
        let texture = self.info(from, "diffuseRoughnessTexture");
        let at = format!("{place}/diffuseRoughnessTexture");
        model.diffuse_roughness = self.float(factor, texture.as_ref(), 0, &at);
    }

    fn clearcoat(&mut self) -> Option<Clearcoat> {
        let (extension, place) = self.extension("KHR_materials_clearcoat")?;
        let from = (extension, place.as_str());
        let factor = self.number(from, "clearcoatFactor", 0.0, UNIT);
        if factor == 0.0 {
            return None;
        }
        let roughness = self.number(from, "clearcoatRoughnessFactor", 0.0, UNIT);
        let texture = self.info(from, "clearcoatTexture");
        let factor = self.float(factor, texture.as_ref(), 0, &format!("{place}/clearcoatTexture"));
        let texture = self.info(from, "clearcoatRoughnessTexture").filter(|_| roughness > 0.0);
        let at = format!("{place}/clearcoatRoughnessTexture");
        let roughness = self.float(roughness, texture.as_ref(), 1, &at);
        let normal_map = self.normal_map_at(&format!("{place}/clearcoatNormalTexture"));
        Some(Clearcoat { factor, roughness, normal_map })
    }

    fn sheen(&mut self) -> Option<Sheen> {
        let (extension, place) = self.extension("KHR_materials_sheen")?;
        let from = (extension, place.as_str());
        let color = self.numbers(from, "sheenColorFactor", [0.0; 3]);
        if color == [0.0; 3] {
            return None;
        }
        let roughness = self.number(from, "sheenRoughnessFactor", 0.0, UNIT);
        let texture = self.info(from, "sheenColorTexture");
        let color = self.color(color, texture.as_ref(), &format!("{place}/sheenColorTexture"));
        let texture = self.info(from, "sheenRoughnessTexture").filter(|_| roughness > 0.0);
        let roughness = self.float(roughness, texture.as_ref(), 3, &format!("{place}/sheenRoughnessTexture"));
        Some(Sheen { color, roughness })
    }

    fn anisotropy(&mut self) -> Option<Anisotropy> {
        let (extension, place) = self.extension("KHR_materials_anisotropy")?;
        let from = (extension, place.as_str());
        let strength = self.number(from, "anisotropyStrength", 0.0, UNIT);
        if strength == 0.0 {
            return None;
        }
        let rotation_rad = self.number(from, "anisotropyRotation", 0.0, [f32::MIN, f32::MAX]);
        let texture = self.data_texture(from, "anisotropyTexture");
        // The direction is that of the tangents, which come from the first set of texture coordinates.
        self.needs.uv_slots.take(0);
        Some(Anisotropy { strength, rotation_rad, texture })
    }

    fn iridescence(&mut self) -> Option<Iridescence> {
        let (extension, place) = self.extension("KHR_materials_iridescence")?;
        let from = (extension, place.as_str());
        let factor = self.number(from, "iridescenceFactor", 0.0, UNIT);
        if factor == 0.0 {
            return None;
        }
        let ior = self.number(from, "iridescenceIor", 1.3, [1.0, f32::MAX]);
        let thickness_min_nm = self.number(from, "iridescenceThicknessMinimum", 100.0, [0.0, f32::MAX]);
        let thickness_max_nm = self.number(from, "iridescenceThicknessMaximum", 400.0, [0.0, f32::MAX]);
        let texture = self.info(from, "iridescenceTexture");
        let factor = self.float(factor, texture.as_ref(), 0, &format!("{place}/iridescenceTexture"));
        let thickness_texture = self.data_texture(from, "iridescenceThicknessTexture").map(|id| (id, 1));
        Some(Iridescence { factor, ior, thickness_min_nm, thickness_max_nm, thickness_texture })
    }

    fn diffuse_transmission(&mut self) -> Option<DiffuseTransmission> {
        let (extension, place) = self.extension("KHR_materials_diffuse_transmission")?;
        let from = (extension, place.as_str());
        let factor = self.number(from, "diffuseTransmissionFactor", 0.0, UNIT);
        if factor == 0.0 {
            return None;
        }
        let color = self.numbers(from, "diffuseTransmissionColorFactor", [1.0; 3]);
        let texture = self.info(from, "diffuseTransmissionTexture");
        let at = format!("{place}/diffuseTransmissionTexture");
        let factor = self.float(factor, texture.as_ref(), 3, &at);
        let texture = self.info(from, "diffuseTransmissionColorTexture");
        let color = self.color(color, texture.as_ref(), &format!("{place}/diffuseTransmissionColorTexture"));
        Some(DiffuseTransmission { factor, color })
    }
}

// Drafts of scattering inside of things: `KHR_materials_volume_scatter`, in solids, and `KHR_materials_scatter`, which replaces it,
// in solids and thin sheets.

const NEW: &str = "KHR_materials_scatter";
const OLD: &str = "KHR_materials_volume_scatter";
/// Maximum mean cosine of the scattering of media.
const MAX_ANISOTROPY: f32 = 0.999;

/// What the newer extension says.
struct Scatter {
    /// Its JSON pointer.
    at: String,
    strength: f32,
    color: ColorSlot,
    anisotropy: f32,
}

impl MaterialBuilder<'_, '_> {
    /// What scatters in the solid. Thin sheets that scatter become such that transmit diffusely.
    pub fn scattering(&mut self, model: &mut PbrMaterial) -> Option<Medium> {
        let is_solid = self.raw.pointer("/extensions/KHR_materials_volume/thicknessFactor");
        let is_solid = is_solid.and_then(Value::as_f64).is_some_and(|thickness| thickness > 0.0);
        let Some(scatter) = self.scatter(is_solid) else { return self.volume_scatter(model) };
        if scatter.strength == 0.0 {
            return None;
        }
        if is_solid {
            let color = scatter.color.factor.map(|c| c.min(1.0) * scatter.strength);
            return self.solid(model, color, scatter.anisotropy, &scatter.at);
        }
        if model.transmission.factor == 0.0 {
            let message = "scatters nothing: it needs KHR_materials_transmission with a factor above 0";
            self.report.warn(&*scatter.at, message);
            return None;
        }
        self.sheet(model, &scatter);
        None
    }

    fn draft(&mut self, name: &str, at: &str) {
        self.report.warn(at, ("extension-draft", format!("{name} is a draft: its support may change")));
    }

    fn scatter(&mut self, is_solid: bool) -> Option<Scatter> {
        let (extension, place) = self.extension(NEW)?;
        let from = (extension, place.as_str());
        let at = format!("{}{place}", self.at);
        self.draft(NEW, &at);
        let strength = self.number(from, "scatterStrengthFactor", 0.0, [0.0, 1.0]);
        let color = self.numbers(from, "multiscatterColorFactor", [1.0; 3]);
        let anisotropy = self.number(from, "scatterAnisotropy", 0.0, [-1.0, 1.0]);
        if extension.get("scatterStrengthTexture").is_some() {
            let message = "scatterStrengthTexture is not read: its factor alone counts";
            self.report.warn(&*at, message);
        }
        let texture = match extension.get("multiscatterColorTexture") {
            Some(_) if is_solid => {
                let message = "multiscatterColorTexture is not read: a solid is the same throughout";
                self.report.warn(&*at, message);
                None
            }
            _ => self.info(from, "multiscatterColorTexture").filter(|_| strength > 0.0),
        };
        let color = self.color(color, texture.as_ref(), &format!("{place}/multiscatterColorTexture"));
        Some(Scatter { at, strength, color, anisotropy })
    }

    /// The older extension: its colour has had three names.
    fn volume_scatter(&mut self, model: &mut PbrMaterial) -> Option<Medium> {
        let (extension, place) = self.extension(OLD)?;
        let from = (extension, place.as_str());
        let names = ["multiscatterColorFactor", "multiscatterColor", "scatterAlbedo"];
        let name = names.into_iter().find(|name| extension.get(name).is_some()).unwrap_or(names[0]);
        let color = self.numbers(from, name, [0.0; 3]);
        let anisotropy = self.number(from, "scatterAnisotropy", 0.0, [-MAX_ANISOTROPY, MAX_ANISOTROPY]);
        let at = format!("{}{place}", self.at);
        self.draft(OLD, &at);
        self.solid(model, color.map(|c| c.min(1.0)), anisotropy, &at)
    }

    /// The medium of a solid: its attenuation is taken as that of scattering and absorption together, its colour as that of
    /// [`Medium::subsurface`].
    fn solid(
        &mut self,
        model: &mut PbrMaterial,
        color: [f32; 3],
        anisotropy: f32,
        at: &str,
    ) -> Option<Medium> {
        let (attenuation, distance) = (model.attenuation_color, model.attenuation_distance);
        let extinction = coefficients(attenuation, distance).filter(|_| model.has_volume);
        let Some(extinction) = extinction else {
            let message =
                "scatters nothing: it needs KHR_materials_volume with a thickness and an attenuation";
            self.report.warn(at, message);
            return None;
        };
        if color == [0.0; 3] {
            return None;
        }
        model.attenuation_distance = f32::INFINITY;
        let anisotropy = anisotropy.clamp(-MAX_ANISOTROPY, MAX_ANISOTROPY);
        Some(Medium { extinction, ..Medium::subsurface(color, [1.0; 3], anisotropy) })
    }

    /// A thin sheet: of the share of light that is transmitted, a part continues and the rest, `strength`, is scattered diffusely, a share
    /// (1 + g) / 2 of it to the other side. The shares of the sum are those of [`PbrMaterial`], whose diffuse
    /// reflection has one colour: that of both reflections together.
    fn sheet(&mut self, model: &mut PbrMaterial, scatter: &Scatter) {
        let (transmission, straight) =
            (model.transmission.factor, model.transmission.factor * (1.0 - scatter.strength));
        let scattered = transmission * scatter.strength;
        let onwards = scattered * (1.0 + scatter.anisotropy) / 2.0;
        let backwards = scattered - onwards;
        let share = onwards / (1.0 - straight);
        let reflected = 1.0 - transmission + backwards;
        let is_constant = [&model.base_color, &scatter.color].iter().all(|slot| slot.texture.is_none());
        let is_even = model.transmission.texture.is_none();
        let is_alike = model.base_color == scatter.color;
        if !is_alike && reflected > 0.0 {
            let of_base = (1.0 - transmission) / reflected;
            let mixed = |(a, b): (f32, f32)| a * of_base + b * (1.0 - of_base);
            let (base, inside) = (model.base_color.factor, scatter.color.factor);
            model.base_color = match of_base {
                0.0 => scatter.color,
                _ if is_constant => ColorSlot::constant(std::array::from_fn(|i| mixed((base[i], inside[i])))),
                share if share < 0.5 => scatter.color,
                _ => model.base_color,
            };
            if straight > 0.0 || !is_even || !(is_constant || of_base == 0.0) {
                let message = "has another colour than the base, and neither scatters all that is transmitted nor is it the same \
                               everywhere: the colours are mixed";
                self.report.warn(&*scatter.at, message);
            }
        }
        let texture = model.transmission.texture;
        model.transmission = FloatSlot { factor: straight, texture: texture.filter(|_| straight > 0.0) };
        model.diffuse_transmission = (share > 0.0).then_some(DiffuseTransmission {
            factor: FloatSlot { factor: share, texture },
            color: scatter.color,
        });
        // It is thin, whatever glass like it would be.
        (model.has_volume, model.tints_once, self.needs.body) = (false, false, false);
        self.needs.glass &= straight > 0.0;
    }
}

// KHR_materials_pbrSpecularGlossiness, the older model, in terms of the newer one: a dielectric whose reflection has
// the specular colour, over the diffuse colour, with the roughness 1 - glossiness.

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
    /// The material in terms of the metallic-roughness model.
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

impl MaterialBuilder<'_, '_> {
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
