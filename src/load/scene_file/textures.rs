//! `[textures.NAME]`, each with a `type`; read when something refers to it.
//!
//! | `type` | Keys |
//! |---|---|
//! | `"solid"` | `color` |
//! | `"image"` | `file`; `wrap` = `repeat`, `mirror` or `clamp`; `interpolation` = `trilinear`, `bilinear` or `nearest`; `mapping` = `uv`, or `triplanar` with the `size` that the image covers (1 m) |
//! | `"checker"` | `even`, `odd` (colours or names of textures); `size` of a cell; `mapping` = `world` (cubes) or `uv` |
//! | `"normal"` | none: the surface's normal n in world space as a colour, (n + 1) / 2 |
//! | `"facing"` | `colors`, a list of colours or numbers by the cosine of the angle between the view and the normal, evenly spaced from 0 (seen at grazing angles) to 1 (head on), linear between; at least two |
//! | `"spectrum"` | a measured spectrum, see `spectra` |
//! | `"perlin"`, `"turbulence"`, `"marble"` | `frequency` (cells a metre; 1), `octaves` (1 to 16; 7), `low`, `high` colours, `seed` |

use super::build::Build;
use super::fields::{Fields, color, named};
use super::spectra;
use crate::image::{Encoding, Image, Pixels};
use crate::load::image::{self, Use};
use crate::scene::{ColorSlot, ImageId, Interpolation, Mapping, NoiseKind, Texture, TextureId, Wrap};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;
use toml::Spanned;
use toml::de::DeValue;

#[derive(Clone, Copy)]
enum Kind {
    Solid,
    Image,
    Checker,
    Normal,
    Facing,
    Spectrum,
    Noise(NoiseKind),
}

const KINDS: [(&str, Kind); 9] = [
    ("solid", Kind::Solid),
    ("image", Kind::Image),
    ("checker", Kind::Checker),
    ("normal", Kind::Normal),
    ("facing", Kind::Facing),
    ("spectrum", Kind::Spectrum),
    ("perlin", Kind::Noise(NoiseKind::Perlin)),
    ("turbulence", Kind::Noise(NoiseKind::Turbulence)),
    ("marble", Kind::Noise(NoiseKind::Marble)),
];

/// The named textures and which of them have been read.
pub(super) struct Textures<'a> {
    fields: Option<Fields<'a>>,
    /// `None` while a texture is being read, and for one that has problems.
    done: HashMap<String, Option<TextureId>>,
    /// Only the keys are checked: nothing is opened and nothing added to the scene.
    checking: bool,
}

impl<'a> Textures<'a> {
    pub fn new(fields: Option<Fields<'a>>) -> Textures<'a> {
        Textures { fields, done: HashMap::new(), checking: false }
    }

    /// Are only keys checked?
    pub fn is_check(&self) -> bool {
        self.checking
    }

    /// A colour: constant, or the name of a texture.
    pub fn slot(&mut self, build: &mut Build, fields: &Fields<'a>, key: &'static str) -> Option<ColorSlot> {
        let value = fields.raw(key)?;
        match value.get_ref().as_str() {
            Some(name) => self.get(build, name, value.span()).map(ColorSlot::texture),
            None => fields.color(key).map(|c| ColorSlot::constant(c.value)),
        }
    }

    /// The texture of a name, read now if it hasn't been.
    pub fn get(&mut self, build: &mut Build, name: &str, span: Range<usize>) -> Option<TextureId> {
        if let Some(done) = self.done.get(name) {
            return *done;
        }
        let value = named(self.fields.as_ref(), "texture", name, span, build.problems)?;
        if self.checking {
            // Its own keys have their turn in `check_unused`.
            return Some(TextureId(0));
        }
        self.done.insert(name.to_string(), None);
        let texture = self.read(build, name, value);
        let id = texture.map(|t| push(build, t));
        self.done.insert(name.to_string(), id);
        id
    }

    fn read(&mut self, build: &mut Build, name: &str, value: &'a Spanned<DeValue<'a>>) -> Option<Texture> {
        let Some(table) = value.get_ref().as_table() else {
            build.problems.push(value.span(), format!("texture '{name}' must be a table"));
            return None;
        };
        let problems = self.fields.as_ref()?.problems;
        let fields = Fields::new(format!("texture '{name}'"), table, value.span(), problems);
        fields.require("type", fields.string("type"));
        let texture = match fields.choice("type", &KINDS)? {
            Kind::Solid => fields.require("color", fields.color("color")).map(|c| Texture::Solid(c.value)),
            Kind::Image => image_texture(build, &fields, self.checking),
            Kind::Checker => self.checker(build, &fields, name),
            Kind::Normal => Some(Texture::Normal),
            Kind::Facing => facing(&fields),
            Kind::Spectrum => spectra::read(&fields).map(|curve| Texture::Spectrum(Arc::new(curve))),
            Kind::Noise(kind) => Some(noise(&fields, kind)),
        };
        fields.finish();
        texture
    }

    fn checker(&mut self, build: &mut Build, fields: &Fields<'a>, name: &str) -> Option<Texture> {
        let even = self.cell(build, fields, "even", name);
        let odd = self.cell(build, fields, "odd", name);
        let cell_size = fields.number_in("size", 1e-9..1e9, 1.0) as f32;
        let mappings = [("world", Mapping::World), ("uv", Mapping::default())];
        let mapping = fields.choice("mapping", &mappings).unwrap_or(Mapping::World);
        Some(Texture::Checker { even: even?, odd: odd?, cell_size, mapping })
    }

    fn cell(
        &mut self,
        build: &mut Build,
        fields: &Fields<'a>,
        key: &'static str,
        own: &str,
    ) -> Option<TextureId> {
        let value = fields.require(key, fields.raw(key))?;
        match value.get_ref().as_str() {
            Some(other) if self.done.get(other) == Some(&None) => {
                let message = format!("texture '{own}' contains itself, or '{other}' has a problem");
                build.problems.push(value.span(), message);
                None
            }
            Some(other) => self.get(build, other, value.span()),
            None => match color(value.get_ref()) {
                Some(_) if self.checking => Some(TextureId(0)),
                Some(c) => Some(push(build, Texture::Solid(c))),
                None => fields.color(key).and(None),
            },
        }
    }

    /// From here on, textures are only looked up: what refers to them is itself not needed.
    pub fn only_check(&mut self) {
        self.checking = true;
    }

    /// Notes textures that nothing refers to. Their keys are checked, but their images not opened.
    pub fn check_unused(&mut self, build: &mut Build) {
        self.checking = true;
        let mut unused: Vec<_> = self.fields.iter().flat_map(|f| f.entries()).collect();
        unused.retain(|(name, _)| !self.done.contains_key(*name));
        for (name, value) in unused {
            self.read(build, name, value);
            build.loaded.left_out.push(format!("texture '{name}': nothing refers to it"));
        }
    }
}

fn push(build: &mut Build, texture: Texture) -> TextureId {
    let textures = &mut build.loaded.scene.textures;
    textures.push(texture);
    TextureId(textures.len() as u32 - 1)
}

fn image_texture(build: &mut Build, fields: &Fields, checking: bool) -> Option<Texture> {
    let wraps = [("repeat", Wrap::Repeat), ("mirror", Wrap::Mirror), ("clamp", Wrap::Clamp)];
    let wrap = fields.choice("wrap", &wraps).unwrap_or_default();
    let interpolations = [
        ("trilinear", Interpolation::Trilinear),
        ("bilinear", Interpolation::Bilinear),
        ("nearest", Interpolation::Nearest),
    ];
    let interpolation = fields.choice("interpolation", &interpolations).unwrap_or_default();
    let file = fields.require("file", fields.string("file"))?;
    let image = match checking {
        true => ImageId(0),
        false => read_image(build, file.value, file.span, Use::Color)?,
    };
    let mappings = [("uv", 0), ("triplanar", 1)];
    let is_triplanar = fields.choice("mapping", &mappings) == Some(1);
    if !is_triplanar && fields.has("size") {
        fields.problems.push(fields.span(), "'size' of an image needs mapping = \"triplanar\"");
    }
    let mapping = match is_triplanar {
        true => Mapping::Triplanar { size: fields.number_in("size", 1e-9..1e9, 1.0) as f32 },
        false => Mapping::default(),
    };
    Some(Texture::Image { image, wrap_u: wrap, wrap_v: wrap, interpolation, mapping })
}

/// Largest number of colours.
const MOST_COLORS: usize = 65_536;

fn facing(fields: &Fields) -> Option<Texture> {
    let list = fields.require("colors", fields.list("colors"))?;
    let colors: Option<Vec<[f32; 3]>> = list.iter().map(|v| color(v.get_ref())).collect();
    match colors.filter(|colors| (2..=MOST_COLORS).contains(&colors.len())) {
        Some(colors) => Some(Texture::Facing(colors.into())),
        None => {
            let message = "'colors' of a texture by facing must be a list of 2 to 65536 colours or numbers";
            let help = "evenly spaced by the cosine of the angle of view, from 0 (grazing) to 1 (head on)";
            fields.problems.push_help(fields.span(), message, help);
            None
        }
    }
}

fn noise(fields: &Fields, kind: NoiseKind) -> Texture {
    Texture::Noise {
        kind,
        frequency: fields.number_in("frequency", 1e-6..1e6, 1.0) as f32,
        octaves: fields.integer("octaves", 1, 16).unwrap_or(7),
        low: fields.color("low").map_or([0.0; 3], |c| c.value),
        high: fields.color("high").map_or([1.0; 3], |c| c.value),
        seed: fields.integer("seed", 0, u32::MAX).unwrap_or(0),
    }
}

/// Reads an image file, named relative to the scene file, into the scene.
pub(super) fn read_image(build: &mut Build, name: &str, span: Range<usize>, purpose: Use) -> Option<ImageId> {
    let path = build.file.parent().unwrap_or(build.file).join(name);
    let images = &mut build.loaded.scene.images;
    // One file serves several textures, but colours are other numbers than heights.
    let known = path.display().to_string();
    let is_same = |i: &Image| {
        let encoding = if purpose == Use::Data { Encoding::Linear } else { Encoding::Srgb };
        i.name == known && (i.encoding == encoding || matches!(*i.pixels, Pixels::F32(_)))
    };
    if let Some(i) = images.iter().position(is_same) {
        return Some(ImageId(i as u32));
    }
    build.options.files.note(&path);
    match image::read(&path, purpose, &mut build.loaded.warnings) {
        Ok(image) => {
            images.push(image);
            Some(ImageId(images.len() as u32 - 1))
        }
        Err(e) => {
            build.problems.push(span, e.to_string());
            None
        }
    }
}
