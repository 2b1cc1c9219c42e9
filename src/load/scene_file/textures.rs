//! `[textures.NAME]`, each with a `type`; unused ones are not loaded.
//!
//! | `type` | Keys |
//! |---|---|
//! | `"solid"` | `color` |
//! | `"image"` | `file`; `wrap` = `repeat`, `mirror` or `clamp`; `interpolation` = `trilinear`, `bilinear` or `nearest`; `encoding` = `srgb` or `linear` of integer formats; `mapping` = `uv`, `triplanar` with the `size` of the image (1 m), or `own`: mapping, `wrap` and `interpolation` of the texture `"own"` |
//! | `"checker"` | `even`, `odd` (colours or names of textures); `size` of a cell; `mapping` = `world` (cubes) or `uv` |
//! | `"mix"` | `a`, `b`, `factor` (colours, numbers or names of textures): `a + factor (b - a)` per channel; alpha uses the mean of the factor's channels |
//! | `"own"` | none: in a sidecar, the model's own texture of the material parameter that this texture, or one made from it, replaces; white if there is none. The model's factor and channel are kept |
//! | `"normal"` | none: the world-space normal n as a colour, (n + 1) / 2 |
//! | `"facing"` | `colors`, at least two colours or numbers, evenly spaced over the cosine of the angle between view direction and normal, from 0 (grazing) to 1 (head on), with linear interpolation |
//! | `"nodes"` | `nodes`, a table of nodes by name, and `result`, an output of one of them; the guide has a section on textures of nodes |
//! | `"spectrum"` | a measured spectrum, see `spectra` |
//! | `"perlin"`, `"turbulence"`, `"marble"` | `frequency` (cells per metre; 1), `octaves` (1 to 16; 7), `low`, `high` colours, `seed` |
//!
//! Textures of `type = "spectrum"`: measured spectra, for spectral rendering (`spectral` in `[render]`, or `--spectral`). RGB rendering
//! uses their colour.
//!
//! | Key | Meaning |
//! |---|---|
//! | `values` | a list of pairs of wavelength (nm, ascending) and value; or of values only |
//! | `from`, `to` | with values only: wavelengths of the first and the last, evenly spaced (nm) |
//! | `light` | `true`: relative spectral power of a light, for `radiance` and `emission`; `false`: reflectance, 0 to 1 (`false`) |
//! | `black_body` | instead of `values`: emission of a black body at this temperature, 100 to 100,000 kelvin |
//! | `luminance` | of a light: luminance of its radiance, relative to white of radiance 1 (1) |
//!
//! Spectra are interpolated linearly, are constant beyond the first and the last value, and are sampled from 380 to 780 nm in steps of 1 nm.

use super::builder::SceneFileBuilder;
use super::fields::{Fields, color, named, number, numbers};
use crate::color::spectral::Curve;
use crate::error::Error;
use crate::image::{Damage, Encoding, Image, Pixels};
use crate::load::image;
use crate::load::image::Use;
use crate::scene::{
    ColorSlot, FloatSlot, ImageId, Interpolation, Mapping, NoiseKind, Texture, TextureId, Wrap,
};
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::Arc;
use toml::Spanned;
use toml::de::DeValue;

/// Wrap modes of images.
pub(super) const WRAPS: [(&str, Wrap); 3] =
    [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];

#[derive(Clone, Copy)]
enum TextureType {
    Solid,
    Image,
    Checker,
    Mix,
    Own,
    Normal,
    Facing,
    Nodes,
    Spectrum,
    Noise(NoiseKind),
}

const TEXTURE_TYPES: [(&str, TextureType); 12] = [
    ("solid", TextureType::Solid),
    ("image", TextureType::Image),
    ("checker", TextureType::Checker),
    ("mix", TextureType::Mix),
    ("own", TextureType::Own),
    ("normal", TextureType::Normal),
    ("facing", TextureType::Facing),
    ("nodes", TextureType::Nodes),
    ("spectrum", TextureType::Spectrum),
    ("perlin", TextureType::Noise(NoiseKind::Perlin)),
    ("turbulence", TextureType::Noise(NoiseKind::Turbulence)),
    ("marble", TextureType::Noise(NoiseKind::Marble)),
];

/// The named textures; each is read on first use.
pub(super) struct Textures<'a> {
    fields: Option<Fields<'a>>,
    /// `None` while a texture is being read, and after a problem.
    ids: HashMap<String, Option<TextureId>>,
    /// Names of textures that use `"own"`, which are read again for each use.
    used_with_own: HashSet<String>,
    /// Check keys only: open no files and add nothing to the scene.
    checks_only: bool,
    /// The current texture `"own"`; `None` outside of a model's materials.
    model_texture: Option<ModelTexture>,
}

/// The model's texture that is being replaced.
struct ModelTexture {
    texture: Option<TextureId>,
    is_used: bool,
}

impl<'a> Textures<'a> {
    pub fn new(fields: Option<Fields<'a>>) -> Textures<'a> {
        Textures {
            fields,
            ids: HashMap::new(),
            used_with_own: HashSet::new(),
            checks_only: false,
            model_texture: None,
        }
    }

    /// Whether only keys are checked.
    pub fn checks_only(&self) -> bool {
        self.checks_only
    }

    /// A colour parameter: a constant, or the name of a texture.
    pub fn slot(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        key: &'static str,
    ) -> Option<ColorSlot> {
        let value = fields.raw(key)?;
        match value.get_ref().as_str() {
            Some(name) => self.get(build, name, value.span()).map(ColorSlot::texture),
            None => fields.color(key).map(|c| ColorSlot::constant(c.value)),
        }
    }

    /// A colour parameter that replaces `model_value` of a model's material.
    pub fn adjust_color(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        key: &'static str,
        model_value: ColorSlot,
    ) -> ColorSlot {
        let (found, uses_model) = self.adjust(build, fields, key, model_value.texture);
        let found = found.unwrap_or(model_value);
        if uses_model { ColorSlot { texture: found.texture, ..model_value } } else { found }
    }

    /// A texture that replaces the number `model_value` of a model's material; `None` without one.
    pub fn adjust_number(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        key: &'static str,
        model_value: FloatSlot,
    ) -> Option<FloatSlot> {
        fields.raw(key)?.get_ref().as_str()?;
        let (found, uses_model) = self.adjust(build, fields, key, model_value.texture.map(|(id, _)| id));
        let texture = found?.texture?;
        let channel = model_value.texture.map_or(0, |(_, channel)| channel);
        Some(match uses_model {
            true => FloatSlot { texture: Some((texture, channel)), ..model_value },
            false => FloatSlot::texture(texture, 0),
        })
    }

    /// Reads a parameter with `texture` as `"own"`; returns whether `"own"` was used.
    fn adjust(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        key: &'static str,
        texture: Option<TextureId>,
    ) -> (Option<ColorSlot>, bool) {
        self.model_texture = Some(ModelTexture { texture, is_used: false });
        let found = self.slot(build, fields, key);
        (found, self.model_texture.take().is_some_and(|texture| texture.is_used))
    }

    /// The texture of a name, read on first use.
    pub fn get(&mut self, build: &mut SceneFileBuilder, name: &str, span: Range<usize>) -> Option<TextureId> {
        if let Some(id) = self.ids.get(name) {
            return *id;
        }
        let value = named(self.fields.as_ref(), "texture", name, span, build.problems)?;
        if self.checks_only {
            // `check_unused` checks its keys.
            return Some(TextureId(0));
        }
        self.ids.insert(name.to_string(), None);
        let was_used = self.model_texture.as_mut().is_some_and(|own| std::mem::take(&mut own.is_used));
        let texture = self.read(build, name, value);
        let id = texture.map(|texture| build.loaded.scene.add_texture(texture));
        self.ids.insert(name.to_string(), id);
        if let Some(own) = &mut self.model_texture {
            if own.is_used {
                // "own" is another texture at each use.
                self.ids.remove(name);
                self.used_with_own.insert(name.to_string());
            }
            own.is_used |= was_used;
        }
        id
    }

    fn read(
        &mut self,
        build: &mut SceneFileBuilder,
        name: &str,
        value: &'a Spanned<DeValue<'a>>,
    ) -> Option<Texture> {
        let problems = self.fields.as_ref()?.problems;
        let fields = Fields::of_value(format!("texture '{name}'"), value, problems)?;
        fields.require("type", fields.string("type"));
        let texture = match fields.choice("type", &TEXTURE_TYPES)? {
            TextureType::Solid => {
                fields.require("color", fields.color("color")).map(|c| Texture::Solid(c.value))
            }
            TextureType::Image => self.image(build, &fields),
            TextureType::Checker => self.checker(build, &fields, name),
            TextureType::Mix => self.mix(build, &fields, name),
            TextureType::Own => self.own(build, &fields),
            TextureType::Normal => Some(Texture::Normal),
            TextureType::Facing => facing(&fields),
            TextureType::Nodes => self.nodes(build, &fields, name),
            TextureType::Spectrum => read_spectrum(&fields).map(|curve| Texture::Spectrum(Arc::new(curve))),
            TextureType::Noise(kind) => Some(noise(&fields, kind)),
        };
        fields.finish();
        texture
    }

    fn checker(&mut self, build: &mut SceneFileBuilder, fields: &Fields<'a>, name: &str) -> Option<Texture> {
        let even = self.input(build, fields, "even", name);
        let odd = self.input(build, fields, "odd", name);
        let cell_size = fields.number_in("size", 1e-9..1e9, 1.0) as f32;
        let mappings = [("world", Mapping::World), ("uv", Mapping::default())];
        let mapping = fields.choice("mapping", &mappings).unwrap_or(Mapping::World);
        Some(Texture::Checker { even: even?, odd: odd?, cell_size, mapping })
    }

    fn mix(&mut self, build: &mut SceneFileBuilder, fields: &Fields<'a>, name: &str) -> Option<Texture> {
        let [a, b, factor] = ["a", "b", "factor"].map(|key| self.input(build, fields, key, name));
        Some(Texture::Mix { a: a?, b: b?, factor: factor? })
    }

    /// The model's own texture, marked as used.
    fn own(&mut self, build: &mut SceneFileBuilder, fields: &Fields<'a>) -> Option<Texture> {
        if self.checks_only {
            return Some(Texture::Solid([1.0; 3]));
        }
        let Some(own) = &mut self.model_texture else {
            let message = "\"own\" has no model texture to refer to here";
            let help = "\"own\" works in the sidecar of a model, in [materials.NAME] without a 'type', for a material of the model";
            fields.report_help(message, help);
            return None;
        };
        own.is_used = true;
        let texture = own.texture.map(|id| build.loaded.scene.textures[id.index()].clone());
        Some(texture.unwrap_or(Texture::Solid([1.0; 3])))
    }

    fn image(&mut self, build: &mut SceneFileBuilder, fields: &Fields<'a>) -> Option<Texture> {
        let (texture, mapping_key) = image_texture(build, fields, self.checks_only)?;
        if mapping_key != MappingKey::Own {
            return Some(texture);
        }
        for key in ["wrap", "interpolation"] {
            if fields.has(key) {
                let message =
                    format!("with mapping = \"own\", '{key}' comes from the model's texture: leave it out");
                fields.report(message);
            }
        }
        let (own, Texture::Image { image, .. }) = (self.own(build, fields)?, &texture) else { return None };
        match own {
            Texture::Image { wrap_u, wrap_v, interpolation, mapping, .. } => {
                Some(Texture::Image { image: *image, wrap_u, wrap_v, interpolation, mapping })
            }
            _ if self.checks_only => Some(texture),
            _ => {
                let message = "the model's material has no image texture here to take the mapping from";
                fields.report_help(message, "leave 'mapping' out");
                None
            }
        }
    }

    /// An input of the texture `name`: a colour or the name of another texture.
    fn input(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        key: &'static str,
        name: &str,
    ) -> Option<TextureId> {
        let value = fields.require(key, fields.raw(key))?;
        match value.get_ref().as_str() {
            Some(input) => self.input_by_name(build, input, name, value.span()),
            None => match color(value.get_ref()) {
                Some(_) if self.checks_only => Some(TextureId(0)),
                Some(c) => Some(build.loaded.scene.add_texture(Texture::Solid(c))),
                None => fields.color(key).and(None),
            },
        }
    }

    /// The texture `input`, used by the texture `name`.
    pub fn input_by_name(
        &mut self,
        build: &mut SceneFileBuilder,
        input: &str,
        name: &str,
        span: Range<usize>,
    ) -> Option<TextureId> {
        if self.ids.get(input) == Some(&None) {
            let message = format!("texture '{name}' contains itself, or '{input}' has a problem");
            build.problems.push(span, ("texture-cycle", message));
            return None;
        }
        self.get(build, input, span)
    }

    /// From here on, only keys are checked.
    pub fn only_check(&mut self) {
        self.checks_only = true;
    }

    /// Checks the keys of unused textures without opening their images, and reports the textures as unused.
    pub fn check_unused(&mut self, build: &mut SceneFileBuilder) {
        self.checks_only = true;
        let mut unused: Vec<_> = self.fields.iter().flat_map(|f| f.entries()).collect();
        unused.retain(|(name, _)| !self.ids.contains_key(*name) && !self.used_with_own.contains(*name));
        for (name, value) in unused {
            self.read(build, name, value);
            build.loaded.left_out.push(format!("texture '{name}': nothing refers to it"));
        }
    }
}

/// Values of `mapping`.
#[derive(Clone, Copy, PartialEq)]
enum MappingKey {
    Uv,
    Triplanar,
    Own,
}

const MAPPINGS: [(&str, MappingKey); 3] =
    [("uv", MappingKey::Uv), ("triplanar", MappingKey::Triplanar), ("own", MappingKey::Own)];

fn image_texture(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    checks_only: bool,
) -> Option<(Texture, MappingKey)> {
    let wrap = fields.choice("wrap", &WRAPS).unwrap_or_default();
    let interpolations = [
        ("trilinear", Interpolation::Trilinear),
        ("bilinear", Interpolation::Bilinear),
        ("nearest", Interpolation::Nearest),
    ];
    let interpolation = fields.choice("interpolation", &interpolations).unwrap_or_default();
    let file = fields.require("file", fields.string("file"))?;
    let encodings = [("srgb", Use::Color), ("linear", Use::Data)];
    let purpose = fields.choice("encoding", &encodings).unwrap_or(Use::Color);
    let image = match checks_only {
        true => ImageId(0),
        false => read_image(build, file.value, file.span, purpose)?,
    };
    let mapping_key = fields.choice("mapping", &MAPPINGS).unwrap_or(MappingKey::Uv);
    let is_triplanar = mapping_key == MappingKey::Triplanar;
    if !is_triplanar && fields.has("size") {
        fields.report("'size' of an image needs mapping = \"triplanar\"");
    }
    let mapping = match is_triplanar {
        true => Mapping::Triplanar { size: fields.number_in("size", 1e-9..1e9, 1.0) as f32 },
        false => Mapping::default(),
    };
    Some((Texture::Image { image, wrap_u: wrap, wrap_v: wrap, interpolation, mapping }, mapping_key))
}

/// Maximum number of colours of a facing texture.
const MAX_COLORS: usize = 65_536;

fn facing(fields: &Fields) -> Option<Texture> {
    let list = fields.require("colors", fields.list("colors"))?;
    let colors: Option<Vec<[f32; 3]>> = list.iter().map(|v| color(v.get_ref())).collect();
    match colors.filter(|colors| (2..=MAX_COLORS).contains(&colors.len())) {
        Some(colors) => Some(Texture::Facing(colors.into())),
        None => {
            let message = "'colors' of a facing texture must be a list of 2 to 65536 colours or numbers";
            let help = "evenly spaced over the cosine of the view angle, from 0 (grazing) to 1 (head on)";
            fields.report_help(message, help);
            None
        }
    }
}

fn noise(fields: &Fields, kind: NoiseKind) -> Texture {
    Texture::Noise {
        kind,
        frequency: fields.number_in("frequency", 1e-6..1e6, 1.0) as f32,
        octaves: fields.unsigned("octaves", 1, 16).unwrap_or(7),
        low: fields.color("low").map_or([0.0; 3], |c| c.value),
        high: fields.color("high").map_or([1.0; 3], |c| c.value),
        seed: fields.unsigned("seed", 0, u32::MAX).unwrap_or(0),
    }
}

/// Reads an image file, relative to the scene file, into the scene.
pub(super) fn read_image(
    build: &mut SceneFileBuilder,
    name: &str,
    span: Range<usize>,
    purpose: Use,
) -> Option<ImageId> {
    let path = build.readable_path(name, span.clone())?;
    let images = &mut build.loaded.scene.images;
    // Textures share an image if its encoding is the same.
    let path_name = path.display().to_string();
    let is_same = |i: &Image| {
        let encoding = if purpose == Use::Data { Encoding::Linear } else { Encoding::Srgb };
        i.name == path_name && (i.encoding == encoding || matches!(*i.pixels, Pixels::F32(_)))
    };
    if let Some(i) = images.iter().position(is_same) {
        return Some(ImageId(i as u32));
    }
    build.options.files.note(&path);
    let memory_limit = build.options.memory_limit;
    let warnings = &mut build.loaded.warnings;
    let image = match purpose {
        Use::Environment | Use::Picture => image::read(&path, purpose, memory_limit, warnings),
        Use::Color | Use::Data => {
            let error = build.problems.deferred_error(build.file, span.clone());
            let on_damage = move |e: Error| Damage::Fatal(error(e.to_string()));
            image::read_for_texture(&path, purpose, memory_limit, warnings, Arc::new(on_damage))
        }
    };
    match image {
        Ok(image) => {
            images.push(image);
            Some(ImageId(images.len() as u32 - 1))
        }
        Err(e) => {
            build.problems.push_of_file(span, &path, e.to_string());
            None
        }
    }
}

/// Like [`read_image`], and decodes the pixels.
pub(super) fn read_pixels(
    build: &mut SceneFileBuilder,
    name: &str,
    span: Range<usize>,
    purpose: Use,
) -> Option<ImageId> {
    let id = read_image(build, name, span.clone(), purpose)?;
    let image = &mut build.loaded.scene.images[id.index()];
    match image.decoded(&mut build.loaded.warnings) {
        Ok(decoded) => *image = decoded,
        Err(Damage::LeftOut(warning)) => build.problems.push(span, warning.message),
        Err(Damage::Fatal(error)) => {
            error.problems.into_iter().for_each(|p| build.problems.push(span.clone(), p.message));
        }
    }
    (!image.is_encoded()).then_some(id)
}

/// Range of wavelengths, nanometres.
const RANGE_NM: Range<f64> = 1.0..1e6;

/// Maximum luminance and value.
const MAX_VALUE: f64 = 1e9;

fn read_spectrum(fields: &Fields) -> Option<Curve> {
    let is_light = fields.flag("light", false);
    let luminance = fields.has("luminance").then(|| fields.number_in("luminance", 0.0..MAX_VALUE, 1.0));
    let kelvin = fields.has("black_body").then(|| fields.number_in("black_body", 100.0..100_000.0, 5000.0));
    if let Some(kelvin) = kelvin {
        fields.exclusive(["black_body", "values"]);
        return Some(Curve::black_body(kelvin, luminance.unwrap_or(1.0)));
    }
    let values = values(fields)?;
    if is_light {
        return Some(Curve::light(&values, luminance.unwrap_or(1.0)));
    }
    if luminance.is_some() {
        fields.report("only lights have a 'luminance': add light = true");
    }
    if values.iter().any(|(_, value)| *value > 1.0) {
        let help = "divide by the largest, or add light = true";
        fields.report_help("values of a reflectance are at most 1", help);
    }
    Some(Curve::reflectance(&values))
}

/// Pairs of wavelength, nanometres, and value.
fn values(fields: &Fields) -> Option<Vec<(f64, f64)>> {
    let list = fields.require("values", fields.list("values"))?;
    let ends = ["from", "to"].map(|key| fields.has(key).then(|| fields.number_in(key, RANGE_NM, 0.0)));
    let pairs: Option<Vec<(f64, f64)>> = match ends {
        [Some(from), Some(to)] => {
            let step = (to - from) / (list.len().max(2) - 1) as f64;
            let at = |i: usize| from + step * i as f64;
            list.iter().enumerate().map(|(i, v)| Some((at(i), number(v.get_ref())?))).collect()
        }
        _ => list.iter().map(|v| numbers::<2>(v.get_ref()).map(|[nm, value]| (nm, value))).collect(),
    };
    let Some(pairs) = pairs.filter(|pairs| !pairs.is_empty()) else {
        let message =
            "'values' must be a list of pairs of a wavelength and a value, or of values with 'from' and 'to'";
        fields.report(message);
        return None;
    };
    let is_ascending = pairs.windows(2).all(|pair| pair[0].0 < pair[1].0);
    if !is_ascending || pairs.iter().any(|(nm, _)| !RANGE_NM.contains(nm)) {
        fields.report("wavelengths must be ascending, in nanometres, and at least 1");
        return None;
    }
    if pairs.iter().any(|(_, value)| !(0.0..=MAX_VALUE).contains(value)) {
        fields.report(format!("values of spectra must be from 0 to {MAX_VALUE}"));
        return None;
    }
    Some(pairs)
}
