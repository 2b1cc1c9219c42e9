//! Whole EXR files: all parts, channels and attributes as they are.

use super::openexr::check_sizes;
use super::source::Source;
use super::{guarded, read_bytes, signature};
use crate::error::Result;
use exr::image::{AnyChannels, FlatSamples, Layers};
use exr::meta::MetaData;
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

    /// The values of a channel, row by row from the top, integers as floats. `None` if there is no such channel.
    pub fn values(&self, part: usize, name: &str) -> Option<Vec<f32>> {
        let channel = self.file.layer_data[part].channel_data.list.iter().find(|c| c.name == *name)?;
        Some(channel.sample_data.values_as_f32().collect())
    }

    /// Puts other values in place of a channel's, in the channel's type, half floats within their range. Does nothing if there
    /// is no such channel.
    ///
    /// # Panics
    /// If there are not as many as before.
    pub fn set_values(&mut self, part: usize, name: &str, values: &[f32]) {
        let list = &mut self.file.layer_data[part].channel_data.list;
        let Some(channel) = list.iter_mut().find(|c| c.name == *name) else { return };
        assert_eq!(channel.sample_data.len(), values.len(), "another number of pixels");
        let half = |v: &f32| f16::from_f32(v.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()));
        match &mut channel.sample_data {
            FlatSamples::F16(old) => *old = values.iter().map(half).collect(),
            FlatSamples::F32(old) => *old = values.to_vec(),
            FlatSamples::U32(old) => *old = values.iter().map(|v| *v as u32).collect(),
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
        let meta = MetaData::read_from_buffered(Cursor::new(&bytes), false).map_err(broken)?;
        check_sizes(&source, &meta)?;
        exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_buffered(Cursor::new(&bytes))
            .map(|file| Layered { file })
            .map_err(broken)
    })
}
