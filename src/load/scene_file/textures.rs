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

const KINDS: [(&str, TextureType); 12] = [
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
    done: HashMap<String, Option<TextureId>>,
    /// Names of textures that use `"own"` and are read again for each use.
    used_with_own: HashSet<String>,
    /// Check keys only: open no files and add nothing to the scene.
    checking: bool,
    /// The current texture `"own"`; `None` outside of a model's materials.
    own: Option<Own>,
}

/// The model's texture that is being replaced.
struct Own {
    texture: Option<TextureId>,
    is_used: bool,
}

impl<'a> Textures<'a> {
    pub fn new(fields: Option<Fields<'a>>) -> Textures<'a> {
        Textures { fields, done: HashMap::new(), used_with_own: HashSet::new(), checking: false, own: None }
    }

    /// Whether only keys are checked.
    pub fn is_check(&self) -> bool {
        self.checking
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

    /// A colour parameter that replaces `own` of a model's material.
    pub fn color_in_place(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        key: &'static str,
        own: ColorSlot,
    ) -> ColorSlot {
        let (found, is_own) = self.in_place(build, fields, key, own.texture);
        let found = found.unwrap_or(own);
        if is_own { ColorSlot { texture: found.texture, ..own } } else { found }
    }

    /// A texture that replaces the number `own` of a model's material; `None` without one.
    pub fn number_in_place(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        key: &'static str,
        own: FloatSlot,
    ) -> Option<FloatSlot> {
        fields.raw(key)?.get_ref().as_str()?;
        let (found, is_own) = self.in_place(build, fields, key, own.texture.map(|(id, _)| id));
        let texture = found?.texture?;
        let channel = own.texture.map_or(0, |(_, channel)| channel);
        Some(match is_own {
            true => FloatSlot { texture: Some((texture, channel)), ..own },
            false => FloatSlot::texture(texture, 0),
        })
    }

    /// Reads a parameter with `texture` as `"own"`; returns whether `"own"` was used.
    fn in_place(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        key: &'static str,
        texture: Option<TextureId>,
    ) -> (Option<ColorSlot>, bool) {
        self.own = Some(Own { texture, is_used: false });
        let found = self.slot(build, fields, key);
        (found, self.own.take().is_some_and(|own| own.is_used))
    }

    /// The texture of a name, read on first use.
    pub fn get(&mut self, build: &mut SceneFileBuilder, name: &str, span: Range<usize>) -> Option<TextureId> {
        if let Some(done) = self.done.get(name) {
            return *done;
        }
        let value = named(self.fields.as_ref(), "texture", name, span, build.problems)?;
        if self.checking {
            // `check_unused` checks its keys.
            return Some(TextureId(0));
        }
        self.done.insert(name.to_string(), None);
        let was_used = self.own.as_mut().is_some_and(|own| std::mem::take(&mut own.is_used));
        let texture = self.read(build, name, value);
        let id = texture.map(|t| push(build, t));
        self.done.insert(name.to_string(), id);
        if let Some(own) = &mut self.own {
            if own.is_used {
                // "own" is another texture at each use.
                self.done.remove(name);
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
        let Some(table) = value.get_ref().as_table() else {
            build.problems.push(value.span(), format!("texture '{name}' must be a table"));
            return None;
        };
        let problems = self.fields.as_ref()?.problems;
        let fields = Fields::new(format!("texture '{name}'"), table, value.span(), problems);
        fields.require("type", fields.string("type"));
        let texture = match fields.choice("type", &KINDS)? {
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
        let even = self.part(build, fields, "even", name);
        let odd = self.part(build, fields, "odd", name);
        let cell_size = fields.number_in("size", 1e-9..1e9, 1.0) as f32;
        let mappings = [("world", Mapping::World), ("uv", Mapping::default())];
        let mapping = fields.choice("mapping", &mappings).unwrap_or(Mapping::World);
        Some(Texture::Checker { even: even?, odd: odd?, cell_size, mapping })
    }

    fn mix(&mut self, build: &mut SceneFileBuilder, fields: &Fields<'a>, name: &str) -> Option<Texture> {
        let [a, b, factor] = ["a", "b", "factor"].map(|key| self.part(build, fields, key, name));
        Some(Texture::Mix { a: a?, b: b?, factor: factor? })
    }

    /// The model's own texture, marked as used.
    fn own(&mut self, build: &mut SceneFileBuilder, fields: &Fields<'a>) -> Option<Texture> {
        if self.checking {
            return Some(Texture::Solid([1.0; 3]));
        }
        let Some(own) = &mut self.own else {
            let message = "there is no model's texture for \"own\" here";
            let help = "\"own\" works in the sidecar of a model, in [materials.NAME] without a 'type', for a material of the model";
            fields.problems.push_help(fields.span(), message, help);
            return None;
        };
        own.is_used = true;
        let texture = own.texture.map(|id| build.loaded.scene.textures[id.index()].clone());
        Some(texture.unwrap_or(Texture::Solid([1.0; 3])))
    }

    fn image(&mut self, build: &mut SceneFileBuilder, fields: &Fields<'a>) -> Option<Texture> {
        let (texture, mapping_key) = image_texture(build, fields, self.checking)?;
        if mapping_key != MappingKey::Own {
            return Some(texture);
        }
        for key in ["wrap", "interpolation"] {
            if fields.has(key) {
                let message =
                    format!("with mapping = \"own\", '{key}' comes from the model's texture: leave it out");
                fields.problems.push(fields.span(), message);
            }
        }
        let (own, Texture::Image { image, .. }) = (self.own(build, fields)?, &texture) else { return None };
        match own {
            Texture::Image { wrap_u, wrap_v, interpolation, mapping, .. } => {
                Some(Texture::Image { image: *image, wrap_u, wrap_v, interpolation, mapping })
            }
            _ if self.checking => Some(texture),
            _ => {
                let message = "the model's material has no image texture here to take the mapping from";
                fields.problems.push_help(fields.span(), message, "leave 'mapping' out");
                None
            }
        }
    }

    fn part(
        &mut self,
        build: &mut SceneFileBuilder,
        fields: &Fields<'a>,
        key: &'static str,
        own: &str,
    ) -> Option<TextureId> {
        let value = fields.require(key, fields.raw(key))?;
        match value.get_ref().as_str() {
            Some(other) => self.other(build, other, own, value.span()),
            None => match color(value.get_ref()) {
                Some(_) if self.checking => Some(TextureId(0)),
                Some(c) => Some(push(build, Texture::Solid(c))),
                None => fields.color(key).and(None),
            },
        }
    }

    /// An input texture of the texture `own`.
    pub fn other(
        &mut self,
        build: &mut SceneFileBuilder,
        name: &str,
        own: &str,
        span: Range<usize>,
    ) -> Option<TextureId> {
        if self.done.get(name) == Some(&None) {
            let message = format!("texture '{own}' contains itself, or '{name}' has a problem");
            build.problems.push(span, ("texture-cycle", message));
            return None;
        }
        self.get(build, name, span)
    }

    /// From here on, only keys are checked.
    pub fn only_check(&mut self) {
        self.checking = true;
    }

    /// Checks the keys of unused textures without opening their images, and reports the textures as unused.
    pub fn check_unused(&mut self, build: &mut SceneFileBuilder) {
        self.checking = true;
        let mut unused: Vec<_> = self.fields.iter().flat_map(|f| f.entries()).collect();
        unused.retain(|(name, _)| !self.done.contains_key(*name) && !self.used_with_own.contains(*name));
        for (name, value) in unused {
            self.read(build, name, value);
            build.loaded.left_out.push(format!("texture '{name}': nothing refers to it"));
        }
    }
}

fn push(build: &mut SceneFileBuilder, texture: Texture) -> TextureId {
    let textures = &mut build.loaded.scene.textures;
    textures.push(texture);
    TextureId(textures.len() as u32 - 1)
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
    checking: bool,
) -> Option<(Texture, MappingKey)> {
    let wraps = [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];
    let wrap = fields.choice("wrap", &wraps).unwrap_or_default();
    let interpolations = [
        ("trilinear", Interpolation::Trilinear),
        ("bilinear", Interpolation::Bilinear),
        ("nearest", Interpolation::Nearest),
    ];
    let interpolation = fields.choice("interpolation", &interpolations).unwrap_or_default();
    let file = fields.require("file", fields.string("file"))?;
    let encodings = [("srgb", Use::Color), ("linear", Use::Data)];
    let purpose = fields.choice("encoding", &encodings).unwrap_or(Use::Color);
    let image = match checking {
        true => ImageId(0),
        false => read_image(build, file.value, file.span, purpose)?,
    };
    let mapping_key = fields.choice("mapping", &MAPPINGS).unwrap_or(MappingKey::Uv);
    let is_triplanar = mapping_key == MappingKey::Triplanar;
    if !is_triplanar && fields.has("size") {
        fields.problems.push(fields.span(), "'size' of an image needs mapping = \"triplanar\"");
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
            fields.problems.push_help(fields.span(), message, help);
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
const MAX: f64 = 1e9;

fn read_spectrum(fields: &Fields) -> Option<Curve> {
    let is_light = fields.flag("light", false);
    let luminance = fields.has("luminance").then(|| fields.number_in("luminance", 0.0..MAX, 1.0));
    let kelvin = fields.has("black_body").then(|| fields.number_in("black_body", 100.0..100_000.0, 5000.0));
    if let Some(kelvin) = kelvin {
        if fields.has("values") {
            fields
                .problems
                .push(fields.span(), "'black_body' and 'values' exclude each other: leave one out");
        }
        return Some(Curve::black_body(kelvin, luminance.unwrap_or(1.0)));
    }
    let values = values(fields)?;
    if is_light {
        return Some(Curve::light(&values, luminance.unwrap_or(1.0)));
    }
    if luminance.is_some() {
        fields.problems.push(fields.span(), "only lights have a 'luminance': add light = true");
    }
    if values.iter().any(|(_, value)| *value > 1.0) {
        let help = "divide by the largest, or add light = true";
        fields.problems.push_help(fields.span(), "values of a reflectance are at most 1", help);
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
        fields.problems.push(fields.span(), message);
        return None;
    };
    let is_ascending = pairs.windows(2).all(|pair| pair[0].0 < pair[1].0);
    if !is_ascending || pairs.iter().any(|(nm, _)| !RANGE_NM.contains(nm)) {
        fields.problems.push(fields.span(), "wavelengths must be ascending, in nanometres, and at least 1");
        return None;
    }
    if pairs.iter().any(|(_, value)| !(0.0..=MAX).contains(value)) {
        fields.problems.push(fields.span(), format!("values of spectra must be from 0 to {MAX}"));
        return None;
    }
    Some(pairs)
}
