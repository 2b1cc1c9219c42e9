//! Extensions that add a layer or another way of scattering: rough diffuse reflection, clearcoat, sheen, anisotropy, iridescence, dispersion and
//! diffuse transmission. A layer with a factor of 0 is left out, with its textures.

use super::builder::Builder;
use crate::scene::{Anisotropy, Clearcoat, DiffuseTransmission, Iridescence, PbrMaterial, Sheen};

const UNIT: [f32; 2] = [0.0, 1.0];

impl Builder<'_, '_> {
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
        self.report.warn(at, "KHR_materials_diffuse_roughness is a draft: what is made of it may change");
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
