//! Storage of EXR files: layout, compression, tiles, types, and which part of the frame they hold.

use crate::color::Primaries;
use crate::film::PixelType;
use crate::math::{DMat4, DVec3};
use exr::meta::attribute::Chromaticities;
use exr::prelude::{Blocks, Compression, Encoding, LineOrder, Vec2};

/// How the channels of an EXR are arranged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrLayout {
    /// One part: R, G, B, A and Z without a layer's name, others in layers of their own. The most compatible.
    #[default]
    Single,
    /// A part for each layer, named after it, the picture itself first: programs read only what they show.
    Multipart,
    /// One part with all channels in one render layer, named as Blender names them: `ViewLayer.Combined.R`.
    Layers,
}

/// How pixels are compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrCompression {
    /// No compression.
    None,
    /// Runs of equal bytes; lossless.
    Rle,
    /// Deflate, 16 lines at a time; lossless.
    #[default]
    Zip,
    /// Deflate line by line; lossless.
    Zips,
    /// Wavelets; lossless, best for grain.
    Piz,
    /// Deflate after 32-bit floats lost 8 bits.
    Pxr24,
    /// Blocks of 4 x 4 half floats in 14 bytes; lossy.
    B44,
    /// B44 with flat blocks in 3 bytes; lossy.
    B44a,
    /// Cosine transform, 32 lines at a time; lossy.
    Dwaa,
    /// Cosine transform, 256 lines at a time; lossy.
    Dwab,
}

impl ExrLayout {
    /// All of them.
    pub const ALL: [ExrLayout; 3] = [ExrLayout::Single, ExrLayout::Multipart, ExrLayout::Layers];

    /// Its name for users.
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// A description, for lists.
    pub fn about(self) -> &'static str {
        self.words().1
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            ExrLayout::Single => ("single", "One part: R, G, B, A and Z without a layer's name"),
            ExrLayout::Multipart => ("multipart", "A part for each layer"),
            ExrLayout::Layers => {
                ("layers", "One part, all in one render layer as Blender names it: ViewLayer.Combined.R")
            }
        }
    }
}

impl ExrCompression {
    /// All of them.
    pub const ALL: [ExrCompression; 10] = [
        ExrCompression::None,
        ExrCompression::Rle,
        ExrCompression::Zip,
        ExrCompression::Zips,
        ExrCompression::Piz,
        ExrCompression::Pxr24,
        ExrCompression::B44,
        ExrCompression::B44a,
        ExrCompression::Dwaa,
        ExrCompression::Dwab,
    ];

    /// Its name for users.
    pub fn name(self) -> &'static str {
        match self {
            ExrCompression::None => "none",
            ExrCompression::Rle => "rle",
            ExrCompression::Zip => "zip",
            ExrCompression::Zips => "zips",
            ExrCompression::Piz => "piz",
            ExrCompression::Pxr24 => "pxr24",
            ExrCompression::B44 => "b44",
            ExrCompression::B44a => "b44a",
            ExrCompression::Dwaa => "dwaa",
            ExrCompression::Dwab => "dwab",
        }
    }

    /// Do 32-bit floats keep all their bits, such as the ids of mattes?
    pub fn keeps_ids(self) -> bool {
        !matches!(self, ExrCompression::Pxr24 | ExrCompression::Dwaa | ExrCompression::Dwab)
    }
}

/// Where the pixels of a file stand in the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExrWindow {
    /// Column and row of the file's first pixel; negative beyond the frame's left and upper edge.
    pub origin: (i32, i32),
    /// Width and height of the frame, the display window, which starts at (0, 0).
    pub frame: (u32, u32),
}

impl ExrWindow {
    /// From normalized device coordinates of a picture with pixels all around the frame to those of the frame; as they are for
    /// any other.
    pub fn frame_from_ndc(&self, width: u32, height: u32) -> DMat4 {
        let ((x, y), (frame_width, frame_height)) = (self.origin, self.frame);
        if width <= frame_width && height <= frame_height {
            return DMat4::IDENTITY;
        }
        let (frame_width, frame_height) = (f64::from(frame_width), f64::from(frame_height));
        let scale = DVec3::new(f64::from(width) / frame_width, f64::from(height) / frame_height, 1.0);
        let offset = DVec3::new(f64::from(x) / frame_width, f64::from(y) / frame_height, 0.0);
        DMat4::from_translation(offset) * DMat4::from_scale(scale)
    }
}

/// How to write EXRs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExrOptions {
    /// Arrangement of channels.
    pub layout: ExrLayout,
    /// Compression of pixels.
    pub compression: ExrCompression,
    /// Edge of square tiles in pixels; scan lines without.
    pub tiles: Option<u32>,
    /// Types of channels or layers by name, in place of their own: half or float.
    pub types: Vec<(String, PixelType)>,
    /// The space of colours.
    pub space: WorkingSpace,
    /// Where the pixels stand; without it they are the frame.
    pub window: Option<ExrWindow>,
}

/// The render layer of [`ExrLayout::Layers`].
const VIEW_LAYER: &str = "ViewLayer";

impl ExrOptions {
    /// Blocks and compression, for the encoder.
    pub(super) fn encoding(&self) -> Encoding {
        let compression = match self.compression {
            ExrCompression::None => Compression::Uncompressed,
            ExrCompression::Rle => Compression::RLE,
            ExrCompression::Zip => Compression::ZIP16,
            ExrCompression::Zips => Compression::ZIP1,
            ExrCompression::Piz => Compression::PIZ,
            ExrCompression::Pxr24 => Compression::PXR24,
            ExrCompression::B44 => Compression::B44,
            ExrCompression::B44a => Compression::B44A,
            ExrCompression::Dwaa => Compression::DWAA(None),
            ExrCompression::Dwab => Compression::DWAB(None),
        };
        let blocks = match self.tiles {
            Some(edge) => Blocks::Tiles(Vec2(edge as usize, edge as usize)),
            None => Blocks::ScanLines,
        };
        Encoding { compression, blocks, line_order: LineOrder::Increasing }
    }

    /// The type of a channel: by its name, else by that of its layer, else its own.
    pub(super) fn type_of(&self, name: &str, own: PixelType) -> PixelType {
        let layer = layer_of(name);
        let given = |wanted: &str| self.types.iter().rev().find(|(n, _)| n == wanted).map(|(_, kind)| *kind);
        let kind = given(name).or_else(|| given(layer)).unwrap_or(own);
        // Integers stay integers.
        if own == PixelType::Uint { own } else { kind }
    }

    /// Names for which types are chosen that are neither channels nor layers of these channels.
    pub(super) fn unknown<'a>(&'a self, channels: &'a [&str]) -> impl Iterator<Item = &'a str> {
        let is_known = |wanted: &str| channels.iter().any(|name| *name == wanted || layer_of(name) == wanted);
        self.types.iter().map(|(name, _)| name.as_str()).filter(move |name| !is_known(name))
    }

    /// The name of a channel in the file.
    pub(super) fn name_of(&self, name: &str) -> String {
        match (self.layout, name) {
            (ExrLayout::Layers, "R" | "G" | "B" | "A") => format!("{VIEW_LAYER}.Combined.{name}"),
            (ExrLayout::Layers, "Z") => format!("{VIEW_LAYER}.Depth.{name}"),
            (ExrLayout::Layers, "samples") => format!("{VIEW_LAYER}.Samples.X"),
            (ExrLayout::Layers, _) => format!("{VIEW_LAYER}.{name}"),
            _ => name.to_string(),
        }
    }

    /// Prefix of the names of mattes.
    pub(super) fn prefix(&self) -> &'static str {
        if self.layout == ExrLayout::Layers { "ViewLayer." } else { "" }
    }

    /// The part that a channel belongs to.
    pub(super) fn part_of(&self, name: &str) -> String {
        match self.layout {
            ExrLayout::Single | ExrLayout::Layers => String::new(),
            ExrLayout::Multipart => layer_of(name).trim_end_matches(|c: char| c.is_ascii_digit()).to_string(),
        }
    }
}

/// The layer of a channel: what stands before its last dot, `rgba` for the picture itself, `depth` for Z.
pub(super) fn layer_of(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((layer, _)) => layer,
        None if matches!(name, "R" | "G" | "B" | "A") => "rgba",
        None if name == "Z" => "depth",
        None => name,
    }
}

// Which channels of EXRs are colours, and their colour space.

/// The space of the colours in EXRs. Pictures are rendered in linear Rec. 709.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WorkingSpace {
    /// Linear Rec. 709.
    #[default]
    Rec709,
    /// ACEScg, converted from the rendering space.
    AcesCg,
}

impl WorkingSpace {
    /// All of them.
    pub const ALL: [WorkingSpace; 2] = [WorkingSpace::Rec709, WorkingSpace::AcesCg];

    /// Its name for users.
    pub fn name(self) -> &'static str {
        match self {
            WorkingSpace::Rec709 => "rec709",
            WorkingSpace::AcesCg => "acescg",
        }
    }

    /// A description, for lists.
    pub fn about(self) -> &'static str {
        match self {
            WorkingSpace::Rec709 => "Linear Rec. 709, in which pictures are rendered",
            WorkingSpace::AcesCg => "ACEScg, converted from it",
        }
    }

    /// Its name in the Color Interop Forum's list.
    pub(super) fn interop_id(self) -> &'static str {
        match self {
            WorkingSpace::Rec709 => "lin_rec709_scene",
            WorkingSpace::AcesCg => "lin_ap1_scene",
        }
    }

    pub(super) fn primaries(self) -> Primaries {
        match self {
            WorkingSpace::Rec709 => Primaries::REC709,
            WorkingSpace::AcesCg => Primaries::AP1,
        }
    }

    /// For the header.
    pub(super) fn chromaticities(self) -> Chromaticities {
        let Primaries { red, green, blue, white } = self.primaries();
        let [red, green, blue, white] = [red, green, blue, white].map(|[x, y]| Vec2(x as f32, y as f32));
        Chromaticities { red, green, blue, white }
    }
}

/// Parts whose channels are no colours.
const COLORLESS: [&str; 17] = [
    "depth",
    "nearest",
    "P",
    "N",
    "Ng",
    "facing",
    "shadow",
    "UV",
    "roughness",
    "object",
    "material",
    "samples",
    "variance",
    "motion",
    "CryptoObject",
    "CryptoMaterial",
    "CryptoAsset",
];

/// Factors on colours, whatever their space.
pub(super) const FACTORS: &str = "ShadowCatcher";

/// Are the channels of a part, or of a layer without its number, colours?
pub fn is_color(part: &str) -> bool {
    !COLORLESS.contains(&part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_follow_the_layout() {
        let of = |layout| ExrOptions { layout, ..ExrOptions::default() };
        let layers = of(ExrLayout::Layers);
        let names = ["R", "Z", "N.X", "samples", "CryptoObject00.R"].map(|name| layers.name_of(name));
        let expected = ["Combined.R", "Depth.Z", "N.X", "Samples.X", "CryptoObject00.R"];
        assert_eq!(names, expected.map(|name| format!("ViewLayer.{name}")));
        let parts = of(ExrLayout::Multipart);
        assert_eq!(parts.name_of("N.X"), "N.X");
        let of_parts =
            ["A", "Z", "N.X", "samples", "CryptoObject01.R", "RGBA_key.G"].map(|n| parts.part_of(n));
        assert_eq!(of_parts, ["rgba", "depth", "N", "samples", "CryptoObject", "RGBA_key"]);
    }

    #[test]
    fn types_are_chosen_by_channel_or_layer() {
        use PixelType::{Float, Half, Uint};
        let types = [("N", Half), ("rgba", Float), ("A", Half), ("object", Half)];
        let types = types.map(|(name, kind)| (name.to_string(), kind)).to_vec();
        let options = ExrOptions { types, ..ExrOptions::default() };
        assert_eq!(options.type_of("N.Y", Float), Half);
        assert_eq!((options.type_of("R", Half), options.type_of("A", Half)), (Float, Half));
        assert_eq!((options.type_of("object.id", Uint), options.type_of("Z", Float)), (Uint, Float));
    }
}
