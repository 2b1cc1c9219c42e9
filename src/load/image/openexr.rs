//! EXR to pixels: the first layer with colour.

use super::limits;
use super::source::Source;
use crate::error::Result;
use crate::image::{Encoding, Image, Pixels};
use exr::image::{AnyChannels, FlatSamples, Layer};
use exr::meta::MetaData;
use exr::prelude::{ReadChannels, ReadLayers};
use std::io::Cursor;
use std::sync::Arc;

/// Decodes the first layer with channels R, G and B, or else with Y (grey). Where `alpha` is wanted and there is a
/// channel A, colour, which EXR stores multiplied by alpha, is divided by it.
pub(super) fn decode(source: &Source, alpha: bool) -> Result<Image> {
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
    for layer in &image.layer_data {
        let colour = [find(layer, "R"), find(layer, "G"), find(layer, "B")];
        let planes: Vec<&FlatSamples> = match colour {
            [Some(r), Some(g), Some(b)] => match find(layer, "A").filter(|_| alpha) {
                Some(a) => vec![r, g, b, a],
                None => vec![r, g, b],
            },
            _ => match find(layer, "Y") {
                Some(y) => vec![y],
                None => continue,
            },
        };
        return Ok(Image {
            name: source.name(),
            width: layer.size.0 as u32,
            height: layer.size.1 as u32,
            channels: planes.len() as u32,
            encoding: Encoding::Linear,
            pixels: Arc::new(Pixels::F32(interleave(&planes))),
        });
    }
    Err(source.error("has no layer with channels R, G and B or Y"))
}

/// Compares what the header claims with the bytes that the file holds, before the parser allocates for it.
fn check_sizes(source: &Source, meta: &MetaData) -> Result<()> {
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
    if samples > limits::pixels(source.bytes.len()).saturating_mul(4) {
        let bytes = source.bytes.len();
        return Err(source.error(format!("claims {samples} numbers in {bytes} bytes, which is too many")));
    }
    Ok(())
}

/// The channel of that name, or else one whose name ends in it (`diffuse.R`).
fn find<'a>(layer: &'a Layer<AnyChannels<FlatSamples>>, letter: &str) -> Option<&'a FlatSamples> {
    let list = &layer.channel_data.list;
    let suffix = format!(".{letter}");
    let exact = list.iter().find(|c| c.name.to_string() == letter);
    exact.or_else(|| list.iter().find(|c| c.name.to_string().ends_with(&suffix))).map(|c| &c.sample_data)
}

fn interleave(planes: &[&FlatSamples]) -> Vec<f32> {
    let count = planes.len();
    let mut out = vec![0f32; planes.first().map_or(0, |p| p.len()) * count];
    for (c, plane) in planes.iter().enumerate() {
        out.iter_mut().skip(c).step_by(count).zip(plane.values_as_f32()).for_each(|(o, v)| *o = v);
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
