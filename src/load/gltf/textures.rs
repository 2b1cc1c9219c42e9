//! Textures of materials: samplers, KHR_texture_transform, and the list of images that they need.

use super::document::{Document, pointer};
use super::extensions::is_read;
use super::report::{Report, Sound};
use crate::image::Encoding;
use crate::math::Vec2;
use crate::scene::{ImageId, Interpolation, Mapping, Texture, TextureId, TextureTransform, Wrap};
use gltf::json::extensions::texture::TextureTransform as TransformJson;
use gltf::json::texture::{MagFilter, MinFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use serde_json::Value;
use std::collections::{BTreeMap, HashMap};

/// How a material refers to a texture.
pub(super) struct Reference {
    /// Index of the texture.
    pub texture: usize,
    /// Set of texture coordinates of the file.
    pub uv_set: u32,
    /// Where the mesh keeps that set for this material ([`UvSlots`](super::materials::UvSlots)).
    pub slot: u32,
    /// Applied to the coordinates.
    pub transform: Option<TransformJson>,
    /// JSON pointer of the reference.
    pub at: String,
    /// The texture's alpha is glossiness, and roughness is wanted.
    pub gloss: Option<Gloss>,
}

/// Asks for an image of the roughness 1 - factor * alpha in place of the image itself.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Gloss(u32);

impl Gloss {
    /// With a factor on the glossiness, 0..1.
    pub fn new(factor: f32) -> Gloss {
        Gloss(factor.to_bits())
    }

    /// The factor.
    pub fn factor(self) -> f32 {
        f32::from_bits(self.0)
    }
}

impl Reference {
    /// The reference of a texture info.
    pub fn new(info: &gltf::json::texture::Info, at: String) -> Reference {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
        Reference { texture: info.index.value(), uv_set: info.tex_coord, slot: 0, transform, at, gloss: None }
    }

    /// The set of texture coordinates of the file that counts.
    pub fn effective_uv_set(&self) -> u32 {
        self.transform.as_ref().and_then(|t| t.tex_coord).unwrap_or(self.uv_set)
    }
}

/// An image that some texture needs.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct ImageNeed {
    /// Its index in the file.
    pub index: usize,
    /// sRGB for colours, linear for data.
    pub encoding: Encoding,
    /// It is turned into roughness.
    pub gloss: Option<Gloss>,
}

/// The textures found so far.
#[derive(Default)]
pub(super) struct Textures {
    /// The scene's textures.
    pub list: Vec<Texture>,
    /// The images that they need; their ids count along.
    pub images: Vec<ImageNeed>,
    numbers: HashMap<ImageNeed, usize>,
    /// What is said of images whose bytes are none, by index in the file.
    pub unreadable: BTreeMap<usize, String>,
    known: HashMap<Key, Sound<TextureId>>,
}

/// What makes two references the same texture.
#[derive(PartialEq, Eq, Hash)]
struct Key {
    texture: usize,
    slot: u32,
    transform: [u32; 5],
    is_color: bool,
    gloss: Option<Gloss>,
}

impl Textures {
    /// Forgets all but the images that were needed, and those that can't be read.
    pub fn forget(&mut self) {
        self.list.clear();
        self.known.clear();
    }

    /// The texture that a material refers to, unless it has problems or no image that can be read.
    pub fn get(
        &mut self,
        doc: &Document,
        reference: &Reference,
        encoding: Encoding,
        report: &mut Report,
    ) -> Sound<TextureId> {
        let transform = transform(reference);
        let [o, s] = [transform.offset.to_array(), transform.scale.to_array()];
        let key = Key {
            texture: reference.texture,
            slot: reference.slot,
            transform: [o[0], o[1], s[0], s[1], transform.rotation_rad].map(f32::to_bits),
            is_color: encoding == Encoding::Srgb,
            gloss: reference.gloss,
        };
        if let Some(known) = self.known.get(&key) {
            return *known;
        }
        let id = self.add(doc, reference, transform, encoding, report);
        self.known.insert(key, id);
        id
    }

    fn add(
        &mut self,
        doc: &Document,
        reference: &Reference,
        transform: TextureTransform,
        encoding: Encoding,
        report: &mut Report,
    ) -> Sound<TextureId> {
        let at = pointer("textures", reference.texture);
        let from = format!("{}/index", reference.at);
        let json: gltf::json::Texture = doc.entry("textures", reference.texture, &from, report)?;
        let raw = doc.raw("textures", reference.texture, &from, report)?;
        let Some(index) = source(raw) else {
            return Err(
                report.warn(at, "has no image that can be read; the material's constants are used alone")
            );
        };
        let image = doc.raw("images", index, &format!("{at}/source"), report)?;
        if let Some(why) = self.unreadable.get(&index) {
            return Err(report.warn(pointer("images", index), without_texture(why)));
        }
        let uri = image.get("uri").and_then(Value::as_str);
        if let Some(file) = uri.and_then(|uri| doc.missing_file(uri)) {
            let message =
                format!("the image {} is missing; the material's constants are used alone", file.display());
            return Err(report.warn(pointer("images", index), message));
        }
        let mut wraps = (Wrap::Repeat, Wrap::Repeat);
        let mut interpolation = Interpolation::Bilinear;
        if let Some(sampler) = json.sampler {
            let sampler_index = sampler.value();
            let sampler: Sampler = doc.entry("samplers", sampler_index, &format!("{at}/sampler"), report)?;
            wraps = (wrap(sampler.wrap_s), wrap(sampler.wrap_t));
            interpolation = filter(&sampler);
            let is_known = !matches!(sampler.wrap_s, Checked::Invalid)
                && !matches!(sampler.wrap_t, Checked::Invalid)
                && !matches!(sampler.mag_filter, Some(Checked::Invalid))
                && !matches!(sampler.min_filter, Some(Checked::Invalid));
            if !is_known {
                let message =
                    "has a filter or a way of wrapping that glTF 2.0 does not know; the default is taken";
                report.warn(pointer("samplers", sampler_index), message);
            }
        }
        if !(transform.offset.is_finite()
            && transform.scale.is_finite()
            && transform.rotation_rad.is_finite())
        {
            return Err(report.problem(reference.at.clone(), "has a transform beyond the range of numbers"));
        }
        let mapping = Mapping::Uv { set: reference.slot, transform };
        let image = self.image(ImageNeed { index, encoding, gloss: reference.gloss });
        let (wrap_u, wrap_v) = wraps;
        self.list.push(Texture::Image { image, wrap_u, wrap_v, interpolation, mapping });
        Ok(TextureId(self.list.len() as u32 - 1))
    }

    fn image(&mut self, need: ImageNeed) -> ImageId {
        let index = *self.numbers.entry(need).or_insert_with(|| {
            self.images.push(need);
            self.images.len() - 1
        });
        ImageId(index as u32)
    }
}

/// What is said of a material that refers to an image that can't be decoded.
pub(super) fn without_texture(why: &str) -> String {
    format!("{why}; the material's constants are used alone")
}

/// The image of a texture: that of KHR_texture_basisu, of EXT_texture_webp, or the plain source.
fn source(texture: &Value) -> Option<usize> {
    let of = |name| texture.pointer(&format!("/extensions/{name}/source")).filter(|_| is_read(name));
    let special = of("KHR_texture_basisu").or_else(|| of("EXT_texture_webp"));
    let index = special.or_else(|| texture.get("source"))?.as_u64()?;
    usize::try_from(index).ok()
}

fn wrap(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}

/// The filter for magnification decides; where it is not given, that for minification, which also tells whether ever
/// coarser copies of the image are wanted.
fn filter(sampler: &Sampler) -> Interpolation {
    match (sampler.mag_filter, sampler.min_filter) {
        (Some(Checked::Valid(MagFilter::Nearest)), _) => Interpolation::Nearest,
        (None, Some(Checked::Valid(MinFilter::Nearest | MinFilter::NearestMipmapNearest))) => {
            Interpolation::Nearest
        }
        (_, Some(Checked::Valid(MinFilter::Linear | MinFilter::Nearest))) => Interpolation::Bilinear,
        _ => Interpolation::Trilinear,
    }
}

/// KHR_texture_transform in the scene's terms. Its rotation is counter-clockwise as seen with v growing downwards, which
/// is clockwise in the plane of (u, v).
fn transform(reference: &Reference) -> TextureTransform {
    reference.transform.as_ref().map_or_else(TextureTransform::default, |t| TextureTransform {
        offset: Vec2::from_array(t.offset.0),
        rotation_rad: t.rotation.0,
        scale: Vec2::from_array(t.scale.0),
    })
}
