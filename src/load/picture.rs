//! Reads linear pictures (EXR, Radiance HDR) for comparing them and for environments.

use crate::error::{Error, Result};
use crate::image::Image;
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers};
use std::fs;
use std::io::Cursor;
use std::path::Path;

/// Most pixels that a picture may have.
const PIXEL_LIMIT: u64 = 1 << 28;

/// Reads red, green and blue of an EXR or HDR file, told apart by content. Alpha and other channels are not read into
/// the result; a layered EXR gives its first layer with R, G and B.
///
/// # Errors
/// An input error if the file is missing, broken, too large or holds no colour.
pub fn load_linear_rgb(path: &Path) -> Result<Image> {
    let bytes = fs::read(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
    match bytes.get(..4) {
        Some([0x76, 0x2f, 0x31, 0x01]) => read_exr(path, &bytes),
        Some([b'#', b'?', ..]) => read_hdr(path, &bytes),
        _ => Err(Error::input(path, "is neither an EXR nor a Radiance HDR file")
            .with_help("linear pictures come as .exr or .hdr")),
    }
}

fn read_exr(path: &Path, bytes: &[u8]) -> Result<Image> {
    let broken = |e: exr::error::Error| Error::input(path, format!("is not a readable EXR: {e}"));
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    for header in &meta.headers {
        check_size(path, header.layer_size.0 as u64, header.layer_size.1 as u64)?;
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    for layer in &image.layer_data {
        let find = |letter: &str| {
            let suffix = format!(".{letter}");
            let list = &layer.channel_data.list;
            let named = |exact: bool| {
                list.iter().find(|c| {
                    let name = c.name.to_string();
                    if exact { name == letter } else { name.ends_with(&suffix) }
                })
            };
            named(true).or_else(|| named(false)).map(|c| to_f32(&c.sample_data))
        };
        let (Some(r), Some(g), Some(b)) = (find("R"), find("G"), find("B")) else { continue };
        let rgb = r.iter().zip(&g).zip(&b).flat_map(|((&r, &g), &b)| [r, g, b]).collect();
        let name = path.display().to_string();
        return Ok(Image::from_linear_rgb(&name, layer.size.0 as u32, layer.size.1 as u32, rgb));
    }
    Err(Error::input(path, "has no layer with channels R, G and B"))
}

fn to_f32(samples: &FlatSamples) -> Vec<f32> {
    samples.values_as_f32().collect()
}

fn read_hdr(path: &Path, bytes: &[u8]) -> Result<Image> {
    let broken = |e: image::ImageError| Error::input(path, format!("is not a readable HDR: {e}"));
    let decoder = image::codecs::hdr::HdrDecoder::new(Cursor::new(bytes)).map_err(broken)?;
    let size = decoder.metadata();
    check_size(path, u64::from(size.width), u64::from(size.height))?;
    let picture = image::DynamicImage::from_decoder(decoder).map_err(broken)?.to_rgb32f();
    let (width, height) = picture.dimensions();
    Ok(Image::from_linear_rgb(&path.display().to_string(), width, height, picture.into_raw()))
}

fn check_size(path: &Path, width: u64, height: u64) -> Result<()> {
    match width.checked_mul(height) {
        Some(0) | None => Err(Error::input(path, "has no pixels")),
        Some(pixels) if pixels > PIXEL_LIMIT => {
            Err(Error::input(path, format!("has {pixels} pixels; at most {PIXEL_LIMIT} are supported")))
        }
        Some(_) => Ok(()),
    }
}
