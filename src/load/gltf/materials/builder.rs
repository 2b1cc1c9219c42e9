//! Slots, numbers and textures of one material, checked while they are taken from the file.

use super::needs::Needs;
use crate::image::Encoding;
use crate::load::gltf::document::{Document, number_of, numbers_of};
use crate::load::gltf::report::{Report, Sound};
use crate::load::gltf::textures::{Gloss, Reference, Textures};
use crate::scene::{ColorSlot, FloatSlot, NormalMap, TextureId};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::texture::Info;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// Largest factor on a normal map's slopes; beyond, the surface is a comb of vertical walls.
const MOST_NORMAL_SCALE: f32 = 1000.0;

/// Colour and opacity of a surface.
#[derive(Clone, Copy)]
pub(super) struct Base {
    /// Its colour.
    pub color: ColorSlot,
    /// Factor on the alpha of the colour's texture.
    pub alpha: f32,
}

/// One material being built.
pub(super) struct Builder<'b, 'a> {
    /// The file.
    pub doc: &'b Document<'a>,
    /// The material as it stands in the file.
    pub raw: &'b Value,
    /// The material's JSON pointer.
    pub at: String,
    /// The textures of all materials.
    pub textures: &'b mut Textures,
    /// Problems and warnings.
    pub report: &'b mut Report,
    /// What it needs from meshes.
    pub needs: Needs,
}

impl<'b> Builder<'b, '_> {
    /// An extension of the material, with its place.
    pub fn extension(&self, name: &str) -> Option<(&'b Value, String)> {
        let extension = self.raw.get("extensions")?.get(name)?;
        Some((extension, format!("/extensions/{name}")))
    }

    fn texture(&mut self, reference: Reference, encoding: Encoding) -> Sound<TextureId> {
        let (mut slots, set) = (self.needs.uv_slots, reference.effective_uv_set());
        let Some(slot) = slots.take(set) else {
            let message =
                format!("uses the texture coordinates {set}, the third set of its material; left out");
            return Err(self.report.warn(reference.at.clone(), message));
        };
        let reference = Reference { slot, ..reference };
        let id = self.textures.get(self.doc, &reference, encoding, self.report)?;
        self.needs.uv_slots = slots;
        Ok(id)
    }

    /// A colour slot; places are relative to the material.
    pub fn color(&mut self, factor: [f32; 3], info: Option<&Info>, place: &str) -> ColorSlot {
        let reference = info.map(|info| Reference::new(info, format!("{}{place}", self.at)));
        ColorSlot { factor, texture: reference.and_then(|r| self.texture(r, Encoding::Srgb).ok()) }
    }

    /// A slot of a number that stands in a channel of a texture.
    pub fn float(&mut self, factor: f32, info: Option<&Info>, channel: u8, place: &str) -> FloatSlot {
        let reference = info.map(|info| Reference::new(info, format!("{}{place}", self.at)));
        let texture = reference.and_then(|r| self.texture(r, Encoding::Linear).ok());
        FloatSlot { factor, texture: texture.map(|id| (id, channel)) }
    }

    /// The roughness that a texture of glossiness and its factor mean.
    pub fn roughness_of_gloss(&mut self, factor: f32, info: &Info, place: &str) -> FloatSlot {
        let at = format!("{}{place}", self.at);
        let reference = Reference { gloss: Some(Gloss::new(factor)), ..Reference::new(info, at) };
        match self.texture(reference, Encoding::Linear) {
            Ok(id) => FloatSlot { factor: 1.0, texture: Some((id, 0)) },
            Err(_) => FloatSlot::constant(1.0 - factor),
        }
    }

    /// A factor that should be in 0..1; clamped with a warning.
    pub fn unit(&mut self, value: f32, place: &str) -> f32 {
        self.clamped(value, 0.0, 1.0, place)
    }

    /// A number that should be in a range; clamped with a warning.
    pub fn clamped(&mut self, value: f32, least: f32, most: f32, place: &str) -> f32 {
        if !(least..=most).contains(&value) {
            let message = format!("{value} is not in {least}..{most} and was clamped");
            self.report.warn(format!("{}{place}", self.at), message);
        }
        value.max(least).min(most)
    }

    /// A number of an extension within a range.
    pub fn number(&mut self, from: (&Value, &str), key: &str, default: f32, range: [f32; 2]) -> f32 {
        let (extension, place) = from;
        let number = number_of(extension, key, &format!("{}{place}", self.at), self.report);
        let value = number.unwrap_or(None).map_or(default, |n| n as f32);
        self.clamped(value, range[0], range[1], &format!("{place}/{key}"))
    }

    /// A colour of an extension within 0..1.
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

    /// A reference to a texture in an extension; none if it has a problem, which is noted.
    pub fn info(&mut self, from: (&Value, &str), key: &str) -> Option<Info> {
        let (extension, place) = from;
        let raw = extension.get(key)?;
        understood(raw, &format!("{}{place}/{key}", self.at), self.report).ok()
    }

    /// A texture of an extension that holds numbers.
    pub fn data_texture(&mut self, from: (&Value, &str), key: &str) -> Option<TextureId> {
        let info = self.info(from, key)?;
        let reference = Reference::new(&info, format!("{}{}/{key}", self.at, from.1));
        self.texture(reference, Encoding::Linear).ok()
    }

    /// The normal map at a place in the material; none if it has a problem, which is noted.
    pub fn normal_map_at(&mut self, place: &str) -> Option<NormalMap> {
        let raw = self.raw.pointer(place)?;
        self.normal_map_of(raw, place).ok()
    }

    fn normal_map_of(&mut self, raw: &Value, place: &str) -> Sound<NormalMap> {
        let at = format!("{}{place}", self.at);
        let info: Info = understood(raw, &at, self.report)?;
        // The crate leaves the transform of these references to the extensions that it does not know.
        let key = "/extensions/KHR_texture_transform";
        let transform: Option<TextureTransform> = match raw.pointer(key) {
            Some(raw) => Some(understood(raw, &format!("{at}{key}"), self.report)?),
            None => None,
        };
        let reference = Reference { transform, ..Reference::new(&info, at.clone()) };
        let texture = self.texture(reference, Encoding::Linear)?;
        let scale = number_of(raw, "scale", &at, self.report)?.map_or(1.0, |s| s as f32);
        let scale = self.clamped(scale, -MOST_NORMAL_SCALE, MOST_NORMAL_SCALE, &format!("{place}/scale"));
        Ok(NormalMap { texture, scale })
    }
}

/// A part of the file as a type of the `gltf` crate.
fn understood<T: DeserializeOwned>(raw: &Value, at: &str, report: &mut Report) -> Sound<T> {
    T::deserialize(raw).map_err(|e| report.problem(at, format!("can't be understood: {e}")))
}
