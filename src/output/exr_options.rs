//! Options of EXR files: layout, compression, tiles, pixel types, colour space and data window.

use crate::color::Primaries;
use crate::film::PixelType;
use crate::math::{DMat4, DVec3};
use exr::meta::attribute::Chromaticities;
use exr::prelude::{Blocks, Compression, Encoding, LineOrder, Vec2};

named_enum! {
    /// Arrangement of channels in an EXR.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    ExrLayout {
        /// One part: R, G, B, A and Z without a layer name, others with one. The most compatible.
        #[default]
        Single = "single",
        /// A part for each layer, named after it, the picture first: programs can read layers selectively.
        Multipart = "multipart",
        /// One part with Blender's channel names in one view layer: `ViewLayer.Combined.R`.
        Layers = "layers",
    }
}

named_enum! {
    /// Compression of pixels.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    ExrCompression {
        /// No compression.
        None = "none",
        /// Run-length encoding; lossless.
        Rle = "rle",
        /// Deflate, 16 lines at a time; lossless.
        #[default]
        Zip = "zip",
        /// Deflate line by line; lossless.
        Zips = "zips",
        /// Wavelets; lossless, best for noisy pictures.
        Piz = "piz",
        /// Deflate after truncation of 32-bit floats to 24 bits; lossy.
        Pxr24 = "pxr24",
        /// Blocks of 4 x 4 half floats in 14 bytes; lossy.
        B44 = "b44",
        /// B44 with flat blocks in 3 bytes; lossy.
        B44a = "b44a",
        /// Discrete cosine transform, 32 lines at a time; lossy.
        Dwaa = "dwaa",
        /// Discrete cosine transform, 256 lines at a time; lossy.
        Dwab = "dwab",
    }
}

impl ExrLayout {
    /// A description, for lists.
    pub fn about(self) -> &'static str {
        match self {
            ExrLayout::Single => "One part: R, G, B, A and Z without a layer name",
            ExrLayout::Multipart => "A part for each layer",
            ExrLayout::Layers => {
                "One part, with Blender's channel names in one view layer: ViewLayer.Combined.R"
            }
        }
    }
}

impl ExrCompression {
    /// Are 32-bit floats lossless, as needed for Cryptomatte ids?
    pub fn preserves_ids(self) -> bool {
        !matches!(self, ExrCompression::Pxr24 | ExrCompression::Dwaa | ExrCompression::Dwab)
    }
}

/// Position of the data window in the frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExrWindow {
    /// Column and row of the data window's first pixel; negative beyond the frame's left or upper edge.
    pub origin: (i32, i32),
    /// Width and height of the display window, which starts at (0, 0), pixels.
    pub frame: (u32, u32),
}

impl ExrWindow {
    /// Converts normalized device coordinates of a picture with overscan to those of the frame; identity without overscan.
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

/// Options of EXR files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExrOptions {
    /// Arrangement of channels.
    pub layout: ExrLayout,
    /// Compression of pixels.
    pub compression: ExrCompression,
    /// Edge length of square tiles, pixels; scan lines if `None`.
    pub tiles: Option<u32>,
    /// Pixel types by channel or layer name (half or float), overriding the defaults.
    pub types: Vec<(String, PixelType)>,
    /// Colour space.
    pub space: WorkingSpace,
    /// Data window; the whole frame if `None`.
    pub window: Option<ExrWindow>,
}

/// The view layer of [`ExrLayout::Layers`].
const VIEW_LAYER: &str = "ViewLayer";

impl ExrOptions {
    /// The crate's encoding options.
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

    /// The pixel type of a channel: by its name, else by its layer, else its default.
    pub(super) fn type_of(&self, name: &str, default: PixelType) -> PixelType {
        let layer = layer_of(name);
        let given = |wanted: &str| self.types.iter().rev().find(|(n, _)| n == wanted).map(|(_, kind)| *kind);
        let kind = given(name).or_else(|| given(layer)).unwrap_or(default);
        // Integers are not converted.
        if default == PixelType::Uint { default } else { kind }
    }

    /// Names in `types` that match neither a channel nor a layer.
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

    /// Name prefix of Cryptomattes.
    pub(super) fn prefix(&self) -> &'static str {
        if self.layout == ExrLayout::Layers { "ViewLayer." } else { "" }
    }

    /// The part of a channel.
    pub(super) fn part_of(&self, name: &str) -> String {
        match self.layout {
            ExrLayout::Single | ExrLayout::Layers => String::new(),
            ExrLayout::Multipart => layer_of(name).trim_end_matches(|c: char| c.is_ascii_digit()).to_string(),
        }
    }
}

/// The layer of a channel: the name up to the last dot, `rgba` for the picture, `depth` for Z.
pub(super) fn layer_of(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((layer, _)) => layer,
        None if matches!(name, "R" | "G" | "B" | "A") => "rgba",
        None if name == "Z" => "depth",
        None => name,
    }
}

// Colour space.

named_enum! {
    /// Colour space of EXRs. Pictures are rendered in linear Rec. 709.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    WorkingSpace {
        /// Linear Rec. 709.
        #[default]
        Rec709 = "rec709",
        /// ACEScg, converted from the rendering space.
        AcesCg = "acescg",
    }
}

impl WorkingSpace {
    /// A description, for lists.
    pub fn about(self) -> &'static str {
        match self {
            WorkingSpace::Rec709 => "Linear Rec. 709, in which pictures are rendered",
            WorkingSpace::AcesCg => "ACEScg, converted from linear Rec. 709",
        }
    }

    /// Identifier of the Color Interop Forum.
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

    /// The header attribute.
    pub(super) fn chromaticities(self) -> Chromaticities {
        let Primaries { red, green, blue, white } = self.primaries();
        let [red, green, blue, white] = [red, green, blue, white].map(|[x, y]| Vec2(x as f32, y as f32));
        Chromaticities { red, green, blue, white }
    }
}

/// Layers of data other than colours.
const DATA_LAYERS: [&str; 17] = [
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

/// Layer of factors on colours, which are not converted between colour spaces.
pub(super) const FACTORS: &str = "ShadowCatcher";

/// Are the channels of a part or layer (without its number) colours?
pub fn is_color(part: &str) -> bool {
    !DATA_LAYERS.contains(&part)
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
    fn pixel_types_are_overridden_by_channel_or_layer() {
        use PixelType::{Float, Half, Uint};
        let types = [("N", Half), ("rgba", Float), ("A", Half), ("object", Half)];
        let types = types.map(|(name, kind)| (name.to_string(), kind)).to_vec();
        let options = ExrOptions { types, ..ExrOptions::default() };
        assert_eq!(options.type_of("N.Y", Float), Half);
        assert_eq!((options.type_of("R", Half), options.type_of("A", Half)), (Float, Half));
        assert_eq!((options.type_of("object.id", Uint), options.type_of("Z", Float)), (Uint, Float));
    }
}
