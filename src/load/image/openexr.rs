//! EXR to pixels: the first layer with colour.

use super::limits;
use super::source::Source;
use crate::color::{Primaries, converted};
use crate::error::{Result, Warning};
use crate::image::{Encoding, Image, Pixels};
use exr::image::{AnyChannel, AnyChannels, FlatSamples, Layer};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::Chromaticities;
use exr::prelude::{ReadChannels, ReadLayers};
use half::slice::HalfFloatSliceExt;
use std::borrow::Cow;
use std::io::Cursor;
use std::sync::Arc;

/// Most unused layers and channels that are named.
const LISTED: usize = 8;

/// Decodes the first layer with channels R, G and B, or else with Y (grey). Where `alpha` is wanted and there is a
/// channel A, colour, which EXR stores multiplied by alpha, is divided by it. Where the numbers are colours (`is_color`), those of
/// another space that the header names become linear Rec. 709. Warns of other layers and channels.
pub(super) fn decode(
    source: &Source,
    is_color: bool,
    alpha: bool,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    let broken = |e: exr::error::Error| source.error(format!("can't be read as an EXR image: {e}"));
    let meta = MetaData::read_from_buffered(Cursor::new(source.bytes), false).map_err(broken)?;
    check_sizes(source, &meta)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(source.bytes))
        .map_err(broken)?;
    let layers = &image.layer_data;
    let chosen = layers.iter().enumerate().find_map(|(i, layer)| Some((i, Colour::find(layer)?)));
    let Some((index, colour)) = chosen else {
        return Err(source.error("has no layer with channels R, G and B or Y"));
    };
    if let Some(message) = colour.left_out(layers, index) {
        warnings.push(source.warning(message));
    }
    let planes = colour.planes(alpha);
    let mut values = interleave(&planes);
    let space = image.attributes.chromaticities.filter(|_| is_color && colour.color.len() == 3);
    if let Some(matrix) = space.and_then(|c| primaries(&c).to_rec709()) {
        for pixel in values.chunks_exact_mut(planes.len()) {
            let color = converted(&matrix, [pixel[0], pixel[1], pixel[2]]);
            pixel[..3].copy_from_slice(&color);
        }
    }
    Ok(Image {
        name: source.name(),
        width: layers[index].size.0 as u32,
        height: layers[index].size.1 as u32,
        channels: planes.len() as u32,
        encoding: Encoding::Linear,
        pixels: Arc::new(Pixels::F32(values)),
    })
}

/// The space that a header names.
pub(super) fn primaries(of: &Chromaticities) -> Primaries {
    let pair = |v: Vec2<f32>| [f64::from(v.0), f64::from(v.1)];
    Primaries { red: pair(of.red), green: pair(of.green), blue: pair(of.blue), white: pair(of.white) }
}

/// The channels of a layer that make a picture.
struct Colour<'a> {
    /// R, G and B, or Y.
    color: Vec<&'a AnyChannel<FlatSamples>>,
    alpha: Option<&'a AnyChannel<FlatSamples>>,
    /// What stands before their letters (`diffuse.` of `diffuse.R`).
    prefix: String,
}

impl<'a> Colour<'a> {
    /// Channels of plain letters, or else the first whose names have a part before them; colour before grey.
    fn find(layer: &'a Layer<AnyChannels<FlatSamples>>) -> Option<Colour<'a>> {
        let names: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
        let prefixed = names.iter().filter_map(|name| Some(name[..=name.rfind('.')?].to_string()));
        let prefixes: Vec<String> = std::iter::once(String::new()).chain(prefixed).collect();
        let channel = |prefix: &str, letter: &str| {
            let found = names.iter().position(|name| name.strip_prefix(prefix) == Some(letter))?;
            Some(&layer.channel_data.list[found])
        };
        [&["R", "G", "B"][..], &["Y"]].into_iter().find_map(|letters| {
            prefixes.iter().find_map(|prefix| {
                let color = letters.iter().map(|letter| channel(prefix, letter)).collect::<Option<_>>()?;
                // Grey comes without.
                let alpha = channel(prefix, "A").filter(|_| letters.len() == 3);
                Some(Colour { color, alpha, prefix: prefix.clone() })
            })
        })
    }

    fn planes(&self, alpha: bool) -> Vec<&'a FlatSamples> {
        let alpha = self.alpha.filter(|_| alpha);
        self.color.iter().copied().chain(alpha).map(|c| &c.sample_data).collect()
    }

    /// Says which layers and channels are not used, if there are any; alpha has its own rules.
    fn left_out(&self, layers: &[Layer<AnyChannels<FlatSamples>>], index: usize) -> Option<String> {
        let layer_name = |i: usize| match &layers[i].attributes.layer_name {
            Some(name) => format!("layer '{name}'"),
            None => format!("layer {}", i + 1),
        };
        let is_used = |channel: &AnyChannel<FlatSamples>| {
            self.color.iter().copied().chain(self.alpha).any(|c| std::ptr::eq(c, channel))
        };
        let others = (0..layers.len()).filter(|&i| i != index).map(layer_name);
        let unused = layers[index].channel_data.list.iter().filter(|c| !is_used(c));
        let all: Vec<String> = others.chain(unused.map(|c| format!("channel '{}'", c.name))).collect();
        if all.is_empty() {
            return None;
        }
        let mut listed = all.iter().take(LISTED).map(String::as_str).collect::<Vec<_>>().join(", ");
        if all.len() > LISTED {
            listed += &format!(" and {} more", all.len() - LISTED);
        }
        let layer = if layers.len() > 1 { format!(" of {}", layer_name(index)) } else { String::new() };
        let letters = if self.color.len() == 3 { "RGB" } else { "Y" };
        Some(format!("is taken from the channels {}{letters}{layer}; left out: {listed}", self.prefix))
    }
}

/// Compares what the header claims with the bytes that the file holds, before the parser allocates for it.
pub(super) fn check_sizes(source: &Source, meta: &MetaData) -> Result<()> {
    let mut samples = 0u64;
    for header in &meta.headers {
        let (width, height) = (header.layer_size.0 as u64, header.layer_size.1 as u64);
        limits::check(source, width, height)?;
        samples += width * height * header.channels.list.len() as u64;
        // Each chunk has an offset of 8 bytes in a table and a header of at least 8.
        if (header.chunk_count as u64).saturating_mul(16) > source.bytes.len() as u64 {
            return Err(source.error(format!(
                "promises {} blocks of pixels, but the file has only {} bytes: it is cut short",
                header.chunk_count,
                source.bytes.len()
            )));
        }
    }
    // Channels make numbers many: a large file may hold as many as it has bits.
    let bytes = source.bytes.len();
    if samples > limits::pixels(bytes).saturating_mul(4).max(bytes as u64 * 8) {
        return Err(source.error(format!("claims {samples} numbers in {bytes} bytes, which is too many")));
    }
    Ok(())
}

fn interleave(planes: &[&FlatSamples]) -> Vec<f32> {
    let count = planes.len();
    let mut out = vec![0f32; planes.first().map_or(0, |p| p.len()) * count];
    for (c, plane) in planes.iter().enumerate() {
        let values = numbers(plane);
        out.iter_mut().skip(c).step_by(count).zip(values.iter()).for_each(|(o, v)| *o = *v);
    }
    if count == 4 {
        for pixel in out.chunks_exact_mut(4) {
            let alpha = pixel[3];
            if alpha > 0.0 {
                pixel[..3].iter_mut().for_each(|v| *v /= alpha);
            }
        }
    }
    out
}

/// The samples of a channel; half floats are converted many at a time.
fn numbers(plane: &FlatSamples) -> Cow<'_, [f32]> {
    match plane {
        FlatSamples::F32(values) => values.into(),
        FlatSamples::F16(values) => {
            let mut numbers = vec![0.0; values.len()];
            values.convert_to_f32_slice(&mut numbers);
            numbers.into()
        }
        FlatSamples::U32(values) => values.iter().map(|&v| v as f32).collect(),
    }
}
