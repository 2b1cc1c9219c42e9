//! Whole EXR files: all parts, channels and attributes as they are.

use super::bytes::{guarded, read_bytes, signature};
use super::openexr::{check_sizes, primaries};
use super::source::Source;
use crate::color::Primaries;
use crate::error::Result;
use exr::image::{AnyChannels, Blocks, FlatSamples, Layers};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Chromaticities, Text};
use exr::prelude::{ReadChannels, ReadLayers, f16};
use image::ImageFormat;
use std::io::Cursor;
use std::path::Path;

/// An EXR file in memory.
#[derive(Clone, Debug)]
pub struct Layered {
    file: exr::image::Image<Layers<AnyChannels<FlatSamples>>>,
}

/// What is known about a channel.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelInfo {
    /// Its name with that of its layer: `albedo.R`.
    pub name: String,
    /// `half`, `float` or `uint`.
    pub kind: &'static str,
}

impl Layered {
    /// Parts of the file.
    pub fn len(&self) -> usize {
        self.file.layer_data.len()
    }

    /// Has it none?
    pub fn is_empty(&self) -> bool {
        self.file.layer_data.is_empty()
    }

    /// Width and height of a part's pixels.
    pub fn size(&self, part: usize) -> [usize; 2] {
        let size = self.file.layer_data[part].size;
        [size.0, size.1]
    }

    /// The channels of a part.
    pub fn channels(&self, part: usize) -> Vec<ChannelInfo> {
        let kind = |samples: &FlatSamples| match samples {
            FlatSamples::F16(_) => "half",
            FlatSamples::F32(_) => "float",
            FlatSamples::U32(_) => "uint",
        };
        let list = self.file.layer_data[part].channel_data.list.iter();
        list.map(|c| ChannelInfo { name: c.name.to_string(), kind: kind(&c.sample_data) }).collect()
    }

    /// The name of a part, if it has one.
    pub fn name(&self, part: usize) -> Option<String> {
        self.file.layer_data[part].attributes.layer_name.as_ref().map(Text::to_string)
    }

    /// How a part's pixels are stored: `scan lines, ZIP16`.
    pub fn compression(&self, part: usize) -> String {
        let encoding = &self.file.layer_data[part].encoding;
        let blocks = match encoding.blocks {
            Blocks::ScanLines => "scan lines".to_string(),
            Blocks::Tiles(size) => format!("tiles of {} x {}", size.0, size.1),
        };
        format!("{blocks}, {:?}", encoding.compression)
    }

    /// The attributes of a part's header that say something about the picture, as text, by name.
    pub fn attributes(&self, part: usize) -> Vec<(String, String)> {
        let (file, own) = (&self.file.attributes, &self.file.layer_data[part].attributes);
        let window = file.display_window;
        let mut list = vec![
            ("dataWindow".to_string(), rectangle(own.layer_position, self.file.layer_data[part].size)),
            ("displayWindow".to_string(), rectangle(window.position, window.size)),
        ];
        let mut add = |name: &str, value: Option<String>| list.extend(value.map(|v| (name.to_string(), v)));
        let chromaticities = |c: Chromaticities| {
            let pair = |v: Vec2<f32>| format!("{} {}", v.0, v.1);
            format!("{}, {}, {}, white {}", pair(c.red), pair(c.green), pair(c.blue), pair(c.white))
        };
        add("chromaticities", file.chromaticities.map(chromaticities));
        for (name, value) in [
            ("software", &own.software_name),
            ("owner", &own.owner),
            ("capDate", &own.capture_date),
            ("comments", &own.comments),
            ("view", &own.view_name),
        ] {
            add(name, value.as_ref().map(Text::to_string));
        }
        add("worldToCamera", own.world_to_camera.map(|m| format!("{m:?}")));
        add("worldToNDC", own.world_to_normalized_device.map(|m| format!("{m:?}")));
        for (name, value) in file.other.iter().chain(&own.other) {
            add(&name.to_string(), Some(shown(value)));
        }
        list.sort();
        list
    }

    /// The space of the file's colours, if it says one.
    pub fn primaries(&self) -> Option<Primaries> {
        self.file.attributes.chromaticities.map(|c| primaries(&c))
    }

    /// The name of a channel without the render layer that Blender, and files laid out as its are, write before it:
    /// `albedo.R` for `ViewLayer.albedo.R`, `R` for `ViewLayer.Combined.R`. Others stay as they are.
    pub fn plain_name(&self, part: usize, name: &str) -> String {
        plain_name(self.render_layer(part).as_deref(), name).to_string()
    }

    /// What stands before the names of a part's channels, with its dot, if that is a render layer.
    fn render_layer(&self, part: usize) -> Option<String> {
        let list = &self.file.layer_data[part].channel_data.list;
        let layer =
            |name: String| name.strip_suffix("Combined.R").filter(|l| l.ends_with('.')).map(str::to_string);
        list.iter().find_map(|c| layer(c.name.to_string()))
    }

    /// Where in its part's list a channel is: by its name, or by its [plain name](Layered::plain_name).
    fn index_of(&self, part: usize, name: &str) -> Option<usize> {
        let list = &self.file.layer_data[part].channel_data.list;
        let as_it_is = list.iter().position(|c| c.name == *name);
        as_it_is.or_else(|| {
            let layer = self.render_layer(part)?;
            list.iter().position(|c| plain_name(Some(&layer), &c.name.to_string()) == name)
        })
    }

    /// The first part with a channel, of those that are as large as part `like`; that one before others.
    pub fn part_with(&self, like: usize, name: &str) -> Option<usize> {
        let others = (0..self.len()).filter(|&part| part != like && self.size(part) == self.size(like));
        std::iter::once(like).chain(others).find(|&part| self.index_of(part, name).is_some())
    }

    /// The values of a channel, by its name or its [plain name](Layered::plain_name), row by row from the top, integers as
    /// floats. `None` if there is no such channel.
    pub fn values(&self, part: usize, name: &str) -> Option<Vec<f32>> {
        let channel = &self.file.layer_data[part].channel_data.list[self.index_of(part, name)?];
        Some(channel.sample_data.values_as_f32().collect())
    }

    /// Puts other values in place of a channel's, in the channel's type, half floats within their range. Does nothing if there
    /// is no such channel.
    ///
    /// # Panics
    /// If there are not as many as before.
    pub fn set_values(&mut self, part: usize, name: &str, values: &[f32]) {
        let Some(index) = self.index_of(part, name) else { return };
        let channel = &mut self.file.layer_data[part].channel_data.list[index];
        assert_eq!(channel.sample_data.len(), values.len(), "another number of pixels");
        let half = |v: &f32| f16::from_f32(v.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()));
        match &mut channel.sample_data {
            FlatSamples::F16(old) => *old = values.iter().map(half).collect(),
            FlatSamples::F32(old) => *old = values.to_vec(),
            FlatSamples::U32(old) => *old = values.iter().map(|v| *v as u32).collect(),
        }
    }

    /// Sets a text attribute of a part. Text has the first 256 code points only; nothing is set for other text.
    pub fn set_attribute(&mut self, part: usize, name: &str, value: &str) {
        if let (Some(name), Some(value)) = (Text::new_or_none(name), Text::new_or_none(value)) {
            let other = &mut self.file.layer_data[part].attributes.other;
            other.insert(name, AttributeValue::Text(value));
        }
    }

    /// Three channels of a part, if it has them all.
    pub fn triple(&self, part: usize, names: [&str; 3]) -> Option<[Vec<f32>; 3]> {
        let [a, b, c] = names.map(|name| self.values(part, name));
        Some([a?, b?, c?])
    }

    /// The file in the types of the crate that writes it.
    pub(crate) fn file(&self) -> &exr::image::Image<Layers<AnyChannels<FlatSamples>>> {
        &self.file
    }
}

/// The name of a channel without that of the render layer before it.
fn plain_name<'a>(layer: Option<&str>, name: &'a str) -> &'a str {
    match layer.and_then(|layer| name.strip_prefix(layer)) {
        None => name,
        Some("Depth.Z") => "Z",
        Some("Samples.X") => "samples",
        Some(below) => below.strip_prefix("Combined.").unwrap_or(below),
    }
}

/// Corner and size.
fn rectangle(position: Vec2<i32>, size: Vec2<usize>) -> String {
    format!("{} x {} at {}, {}", size.0, size.1, position.0, position.1)
}

/// The value of an attribute as text.
fn shown(value: &AttributeValue) -> String {
    match value {
        AttributeValue::Text(text) => text.to_string(),
        AttributeValue::F64(number) => number.to_string(),
        AttributeValue::F32(number) => number.to_string(),
        AttributeValue::I32(number) => number.to_string(),
        other => format!("{other:?}"),
    }
}

/// Reads an EXR file with all that is in it; of pictures in several resolutions the largest.
///
/// # Errors
/// An input error if the file is missing, no EXR, broken, or larger than its length can justify.
pub fn load_layered(path: &Path) -> Result<Layered> {
    let bytes = read_bytes(path)?;
    let source = Source { bytes: &bytes, file: path, pointer: "" };
    if signature(&bytes) != Some(ImageFormat::OpenExr) {
        return Err(source.error("is no EXR file"));
    }
    let broken = |e: exr::error::Error| source.error(format!("can't be read as an EXR image: {e}"));
    guarded(&source, || {
        let meta = MetaData::read_from_buffered(Cursor::new(bytes.as_slice()), false).map_err(broken)?;
        check_sizes(&source, &meta)?;
        exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_buffered(Cursor::new(bytes.as_slice()))
            .map(|file| Layered { file })
            .map_err(broken)
    })
}
