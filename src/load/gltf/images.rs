//! The images that textures need: fetched one after the other, decoded in parallel, each once.

use super::document::{Document, Report, name_of, pointer};
use super::textures::ImageNeed;
use crate::image::{Encoding, Image, Pixels};
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::Arc;

/// An image before decoding.
struct Source<'d> {
    index: usize,
    name: String,
    bytes: Cow<'d, [u8]>,
    mime: Option<String>,
}

/// Decodes what is needed, in the order of the needs. Problems are noted; the list is complete only without any.
pub(super) fn read(doc: &Document, needs: &[ImageNeed], report: &mut Report) -> Vec<Image> {
    let mut sources: Vec<Source> = Vec::new();
    for need in needs {
        if !sources.iter().any(|s| s.index == need.index) {
            sources.extend(fetch(doc, need.index, report));
        }
    }
    let decoded: Vec<_> = sources.par_iter().map(decode).collect();
    let mut images = Vec::with_capacity(needs.len());
    for (source, result) in sources.iter().zip(&decoded) {
        if let Err(message) = result {
            report.problem(pointer("images", source.index), message.clone());
        }
    }
    for need in needs {
        let found = sources.iter().position(|s| s.index == need.index);
        if let Some(Ok(image)) = found.and_then(|at| decoded.get(at)) {
            let encoding = match *image.pixels {
                Pixels::F32(_) => Encoding::Linear,
                Pixels::U8(_) | Pixels::U16(_) => need.encoding,
            };
            images.push(Image { encoding, ..image.clone() });
        }
    }
    images
}

fn fetch<'d>(doc: &'d Document, index: usize, report: &mut Report) -> Option<Source<'d>> {
    let at = pointer("images", index);
    let json: gltf::json::Image = doc.entry("images", index, &at, report)?;
    let name = name_of(doc.raw("images", index, &at, report)?, "image", index);
    let (bytes, stated) = match (json.uri, json.buffer_view) {
        (Some(uri), _) => doc.fetch(&uri, &format!("{at}/uri"), report)?,
        (None, Some(view)) => {
            (Cow::Borrowed(doc.view(view.value(), &format!("{at}/bufferView"), report)?.bytes), None)
        }
        (None, None) => {
            report.problem(at, "has neither a uri nor a bufferView");
            return None;
        }
    };
    Some(Source { index, name, bytes, mime: json.mime_type.map(|m| m.0).or(stated) })
}

/// Most bytes that decoding one image may take.
const MOST_BYTES: u64 = 1 << 32;

fn decode(source: &Source) -> Result<Image, String> {
    let broken = |e: image::ImageError| {
        let stated = source.mime.as_ref().map_or(String::new(), |m| format!(", stated to be {m},"));
        format!("the image '{}'{stated} can't be decoded: {e}", source.name)
    };
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(MOST_BYTES);
    let mut reader = image::ImageReader::new(std::io::Cursor::new(&*source.bytes));
    if let Some(format) = source.mime.as_ref().and_then(image::ImageFormat::from_mime_type) {
        reader.set_format(format);
    }
    let mut reader = reader.with_guessed_format().map_err(|e| broken(e.into()))?;
    reader.limits(limits);
    let decoded = reader.decode().map_err(broken)?;
    let (width, height) = (decoded.width(), decoded.height());
    let (pixels, channels) = match decoded {
        image::DynamicImage::ImageLuma8(i) => (Pixels::U8(i.into_raw()), 1),
        image::DynamicImage::ImageLumaA8(i) => (Pixels::U8(i.into_raw()), 2),
        image::DynamicImage::ImageRgb8(i) => (Pixels::U8(i.into_raw()), 3),
        image::DynamicImage::ImageRgba8(i) => (Pixels::U8(i.into_raw()), 4),
        image::DynamicImage::ImageLuma16(i) => (Pixels::U16(i.into_raw()), 1),
        image::DynamicImage::ImageLumaA16(i) => (Pixels::U16(i.into_raw()), 2),
        image::DynamicImage::ImageRgb16(i) => (Pixels::U16(i.into_raw()), 3),
        image::DynamicImage::ImageRgba16(i) => (Pixels::U16(i.into_raw()), 4),
        other => (Pixels::F32(other.into_rgba32f().into_raw()), 4),
    };
    let name = source.name.clone();
    Ok(Image { name, width, height, channels, encoding: Encoding::Srgb, pixels: Arc::new(pixels) })
}
