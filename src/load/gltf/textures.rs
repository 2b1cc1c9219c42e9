//! Textures of materials: samplers, KHR_texture_transform, and decoding of their images.

use super::buffers::FetchedFile;
use super::document::{Document, is_supported, name_of, pointer};
use super::report::{Report, Valid};
use crate::error::{Error, Problem, Warning};
use crate::image::{Damage, Encoding, Image, Pixels};
use crate::load::image::{ImageFile, OnDamage, Use, decode, for_texture, metadata_warnings};
use crate::math::Vec2;
use crate::scene::{ImageId, Interpolation, Mapping, Texture, TextureId, TextureTransform, Wrap};
use gltf::json::extensions::texture::TextureTransform as TransformJson;
use gltf::json::texture::{MagFilter, MinFilter, Sampler, WrappingMode};
use gltf::json::validation::Checked;
use rayon::prelude::*;
use serde_json::Value;
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

/// A material's reference to a texture.
pub(super) struct Reference {
    /// Index of the texture.
    pub texture: usize,
    /// Index of the UV set in the file.
    pub uv_set: u32,
    /// Slot of the UV set in meshes with this material ([`UvSlots`](super::materials::UvSlots)).
    pub slot: u32,
    /// Transform of the coordinates.
    pub transform: Option<TransformJson>,
    /// JSON pointer of the reference.
    pub at: String,
    /// Conversion of the texture's alpha from glossiness to roughness.
    pub gloss: Option<Gloss>,
}

/// Conversion of an image to the roughness 1 - factor * alpha; holds the bits of the factor.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Gloss(u32);

impl Gloss {
    /// Conversion with a factor on the glossiness, 0..1.
    pub fn new(factor: f32) -> Gloss {
        Gloss(factor.to_bits())
    }

    pub fn factor(self) -> f32 {
        f32::from_bits(self.0)
    }
}

impl Reference {
    pub fn new(info: &gltf::json::texture::Info, at: String) -> Reference {
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.clone());
        Reference { texture: info.index.value(), uv_set: info.tex_coord, slot: 0, transform, at, gloss: None }
    }

    /// Index of the UV set, which the texture transform may override.
    pub fn effective_uv_set(&self) -> u32 {
        self.transform.as_ref().and_then(|t| t.tex_coord).unwrap_or(self.uv_set)
    }
}

/// An image that a texture needs.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct ImageNeed {
    /// Index in the file.
    pub index: usize,
    /// sRGB for colours, linear for data.
    pub encoding: Encoding,
    /// Conversion to roughness.
    pub gloss: Option<Gloss>,
}

/// The textures built so far.
#[derive(Default)]
pub(super) struct Textures {
    /// The scene's textures.
    pub list: Vec<Texture>,
    /// The images that they need, by [`ImageId`].
    pub images: Vec<ImageNeed>,
    /// Index in `images` of each need.
    positions: HashMap<ImageNeed, usize>,
    /// Messages about images that can't be read, by index in the file.
    pub unreadable: BTreeMap<usize, String>,
    known: HashMap<TextureKey, Valid<TextureId>>,
}

/// The identity of a texture reference.
#[derive(PartialEq, Eq, Hash)]
struct TextureKey {
    texture: usize,
    slot: u32,
    transform: [u32; 5],
    is_color: bool,
    gloss: Option<Gloss>,
}

impl Textures {
    /// Removes all textures; the lists of needed and of unreadable images are kept.
    pub fn forget(&mut self) {
        self.list.clear();
        self.known.clear();
    }

    /// The texture of a reference, built on first use.
    pub fn get(
        &mut self,
        doc: &Document,
        reference: &Reference,
        encoding: Encoding,
        report: &mut Report,
    ) -> Valid<TextureId> {
        let transform = transform(reference);
        let [o, s] = [transform.offset.to_array(), transform.scale.to_array()];
        let key = TextureKey {
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
    ) -> Valid<TextureId> {
        let at = pointer("textures", reference.texture);
        let from = format!("{}/index", reference.at);
        let json: gltf::json::Texture = doc.entry("textures", reference.texture, &from, report)?;
        let raw = doc.raw("textures", reference.texture, &from, report)?;
        let Some(index) = source(raw) else {
            return Err(report
                .warn(at, (TEXTURE_MISSING, "has no readable image; only the material's factors are used")));
        };
        let image = doc.raw("images", index, &format!("{at}/source"), report)?;
        if let Some(why) = self.unreadable.get(&index) {
            return Err(report.warn(pointer("images", index), (TEXTURE_MISSING, without_texture(why))));
        }
        if let Some(uri) = image.get("uri").and_then(Value::as_str).filter(|uri| !uri.starts_with("data:"))
            && let Err(why) = doc.locate(uri, &format!("{}/uri", pointer("images", index)), report)
        {
            return Err(report.warn(pointer("images", index), (TEXTURE_MISSING, without_texture(&why))));
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
                    "has a filter or a wrap mode that glTF 2.0 does not define; the default is used";
                report.warn(pointer("samplers", sampler_index), message);
            }
        }
        if !(transform.offset.is_finite()
            && transform.scale.is_finite()
            && transform.rotation_rad.is_finite())
        {
            return Err(report.problem(reference.at.clone(), "has a transform that is not finite"));
        }
        let mapping = Mapping::Uv { set: reference.slot, transform };
        let image = self.image(ImageNeed { index, encoding, gloss: reference.gloss });
        let (wrap_u, wrap_v) = wraps;
        self.list.push(Texture::Image { image, wrap_u, wrap_v, interpolation, mapping });
        Ok(TextureId(self.list.len() as u32 - 1))
    }

    fn image(&mut self, need: ImageNeed) -> ImageId {
        let index = *self.positions.entry(need).or_insert_with(|| {
            self.images.push(need);
            self.images.len() - 1
        });
        ImageId(index as u32)
    }
}

/// Code of the warnings about materials that lose a texture.
const TEXTURE_MISSING: &str = "texture-missing";

/// The warning about a material without its texture.
pub(super) fn without_texture(why: &str) -> String {
    format!("{why}; only the material's factors are used")
}

/// Index of the image of a texture: of KHR_texture_basisu or EXT_texture_webp, else the core source.
fn source(texture: &Value) -> Option<usize> {
    let source_of =
        |name| texture.pointer(&format!("/extensions/{name}/source")).filter(|_| is_supported(name));
    let special = source_of("KHR_texture_basisu").or_else(|| source_of("EXT_texture_webp"));
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

/// Interpolation by the magnification filter, if any, else by the minification filter, which also selects mip mapping.
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

/// Converts KHR_texture_transform. Its rotation is counter-clockwise for v pointing down, so clockwise in the plane of (u, v).
fn transform(reference: &Reference) -> TextureTransform {
    reference.transform.as_ref().map_or_else(TextureTransform::default, |t| TextureTransform {
        offset: Vec2::from_array(t.offset.0),
        rotation_rad: t.rotation.0,
        scale: Vec2::from_array(t.scale.0),
    })
}

// Images: fetched sequentially, once each; small ones are decoded in parallel, large ones stay encoded.

/// An image before decoding.
struct EncodedImage<'d> {
    /// The first need of this image; others may differ in encoding and gloss.
    need: ImageNeed,
    name: String,
    fetched: FetchedFile<'d>,
    /// Maximum size of the decoded pixels, bytes.
    memory_limit: Option<u64>,
    /// Handler for damage that deferred decoding finds.
    on_damage: OnDamage,
}

/// Decodes images in the order of `needs`. Images with problems, which are reported, are missing in the result.
pub(super) fn read(doc: &Document, needs: &[ImageNeed], report: &mut Report) -> Vec<Image> {
    let (images, unreadable) = read_images(doc, needs, false, report);
    unreadable.into_iter().for_each(|(_, problem)| {
        report.add(problem);
    });
    images.into_iter().flatten().collect()
}

/// Reads the images of textures in the order of `needs`. Unreadable images are replaced by a white pixel; their indices in
/// the file are returned with messages.
pub(super) fn read_textures(
    doc: &Document,
    needs: &[ImageNeed],
    report: &mut Report,
) -> (Vec<Image>, Vec<(usize, String)>) {
    let (images, unreadable) = read_images(doc, needs, true, report);
    let blank = || Image {
        name: String::new(),
        width: 1,
        height: 1,
        channels: 1,
        encoding: Encoding::Linear,
        pixels: Arc::new(Pixels::U8(vec![255])),
    };
    let images = images.into_iter().map(|image| image.unwrap_or_else(blank)).collect();
    (images, unreadable.into_iter().map(|(index, problem)| (index, message_with_help(problem))).collect())
}

fn message_with_help(problem: Problem) -> String {
    match problem.help {
        Some(help) => format!("{} ({help})", problem.message),
        None => problem.message,
    }
}

/// Size of the encoded images to be decoded in one parallel batch, bytes.
const BATCH_BYTES: usize = 256 << 20;

/// Reads images in the order of `needs`; also returns the problems of unreadable images by index in the file. Large
/// images stay encoded if `is_deferred`.
fn read_images(
    doc: &Document,
    needs: &[ImageNeed],
    is_deferred: bool,
    report: &mut Report,
) -> (Vec<Option<Image>>, Vec<(usize, Problem)>) {
    // Positions in `decoded` by index in the file. Conversion to roughness needs decoded pixels.
    let mut positions: HashMap<usize, usize> = HashMap::new();
    let is_gloss: HashSet<usize> = needs.iter().filter(|n| n.gloss.is_some()).map(|n| n.index).collect();
    let (mut decoded, mut unreadable, mut pending, mut bytes) = (Vec::new(), Vec::new(), Vec::new(), 0);
    let path = doc.path;
    let mut decode = |sources: &mut Vec<EncodedImage>, report: &mut Report| {
        let read = |source: &EncodedImage| {
            let is_deferred = is_deferred && !is_gloss.contains(&source.need.index);
            decode_source(path, source, is_deferred)
        };
        let images: Vec<Decoded> = sources.par_iter().map(read).collect();
        for (source, Decoded { image, warnings, notes }) in sources.drain(..).zip(images) {
            report.extend(&warnings);
            report.extend_notes(&notes);
            decoded.push(image.map_err(|problem| unreadable.push((source.need.index, problem))).ok());
        }
    };
    let mut lost = Vec::new();
    for &need in needs {
        if positions.contains_key(&need.index) {
            continue;
        }
        match report.optional(|report| fetch(doc, need, report)) {
            Ok(source) => {
                bytes += source.fetched.bytes.len();
                pending.push(source);
                positions.insert(need.index, positions.len());
            }
            Err(problem) => lost.push((need.index, problem)),
        }
        if bytes > BATCH_BYTES {
            decode(&mut pending, report);
            bytes = 0;
        }
    }
    decode(&mut pending, report);
    unreadable.append(&mut lost);
    let image = |need: &ImageNeed| {
        let image = decoded.get(*positions.get(&need.index)?)?.as_ref()?;
        let encoding = if image.is_float() { Encoding::Linear } else { need.encoding };
        let image = Image { encoding, ..image.clone() };
        Some(match need.gloss {
            Some(gloss) => roughness(&image, gloss.factor()),
            None => image,
        })
    };
    (needs.iter().map(image).collect(), unreadable)
}

/// Converts glossiness in alpha to the roughness 1 - factor * alpha, an image of one channel.
fn roughness(image: &Image, factor: f32) -> Image {
    let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    let rough = |(x, y)| {
        let [.., alpha] = image.rgba(x, y);
        ((1.0 - factor * alpha) * 65535.0).round().clamp(0.0, 65535.0) as u16
    };
    Image {
        name: format!("{} (roughness)", image.name),
        channels: 1,
        encoding: Encoding::Linear,
        pixels: Arc::new(Pixels::U16(pixels.map(rough).collect())),
        ..image.clone()
    }
}

fn fetch<'d>(doc: &'d Document, need: ImageNeed, report: &mut Report) -> Valid<EncodedImage<'d>> {
    let at = pointer("images", need.index);
    let json: gltf::json::Image = doc.entry("images", need.index, &at, report)?;
    let name = name_of(doc.raw("images", need.index, &at, report)?, "image", need.index);
    let mut fetched = match (json.uri, json.buffer_view) {
        (Some(uri), _) => doc.fetch(&uri, &format!("{at}/uri"), report)?,
        (None, Some(view)) => match doc.view(view.value(), &format!("{at}/bufferView"), report) {
            Ok(view) => FetchedFile { bytes: view.bytes.into(), mime: None, file: None },
            Err(_) => {
                return Err(report.problem(at, "has no bytes that can be read"));
            }
        },
        (None, None) => {
            return Err(report.problem(at, "has neither a uri nor a bufferView"));
        }
    };
    fetched.mime = json.mime_type.map(|m| m.0).or(fetched.mime);
    let on_damage = on_damage(doc, name.clone(), at);
    Ok(EncodedImage { need, name, fetched, memory_limit: doc.memory_limit, on_damage })
}

/// A decoded image and its messages.
struct Decoded {
    image: Result<Image, Problem>,
    warnings: Vec<Warning>,
    /// Metadata that are ignored, as glTF requires.
    notes: Vec<Warning>,
}

fn decode_source(asset: &Path, source: &EncodedImage, is_deferred: bool) -> Decoded {
    let FetchedFile { bytes, mime, file } = &source.fetched;
    let purpose = if source.need.encoding == Encoding::Srgb { Use::Color } else { Use::Data };
    let at = pointer("images", source.need.index);
    let mut warnings = Vec::new();
    let place = match file {
        Some(file) => (file.as_path(), ""),
        None => (asset, at.as_str()),
    };
    let (own_file, mime) = (file.as_deref(), mime.as_deref());
    let image_file =
        ImageFile { bytes: Cow::Borrowed(bytes), own_file, place, mime, memory_limit: source.memory_limit };
    let image = match is_deferred {
        true => for_texture(&image_file, purpose, &mut warnings, source.on_damage.clone()),
        false => decode(&image_file, purpose, &mut warnings),
    };
    let image = match image {
        Ok(image) => Ok(Image { name: source.name.clone(), ..image }),
        Err(error) => Err(problem(error, &source.name, &at)),
    };
    let notes = if image.is_ok() { metadata_warnings(bytes, place.0, place.1, purpose) } else { Vec::new() };
    Decoded { image, warnings, notes }
}

/// Converts the error of an image to a problem of the asset.
fn problem(error: Error, name: &str, at: &str) -> Problem {
    let messages: Vec<String> = error.problems.iter().map(|p| p.message.clone()).collect();
    let help = error.problems.into_iter().find_map(|p| p.help);
    Problem { help, ..Problem::new(at, format!("'{name}' {}", messages.join("; "))) }
}

/// The handler by which deferred decoding reports a damaged image.
fn on_damage(doc: &Document, name: String, at: String) -> OnDamage {
    let file = doc.path.to_path_buf();
    let in_names = doc.in_names(&at);
    Arc::new(move |error| {
        let why = without_texture(&message_with_help(problem(error, &name, &at)));
        Damage::LeftOut(Warning::new(&file, in_names.as_str(), (TEXTURE_MISSING, why)))
    })
}
