//! The one reader of images: PNG, JPEG, WebP, BMP, TGA and TIFF by the crate `image`, Radiance HDR, EXR, and KTX2.
//!
//! What was 8-bit in the file stays 8-bit. The format is told by the content; TGA, which has no signature, by its media
//! type or name. Sizes are compared with the file's length before anything is allocated (`limits`).

#[cfg(feature = "ktx2")]
mod basis;
mod bytes;
mod deferred;
mod ktx2;
mod layered;
mod limits;
mod openexr;
mod source;
mod unused;

pub(crate) use deferred::{ImageFile, OnDamage, for_texture, read_for_texture};
pub use layered::{ChannelInfo, Layered, load_layered};
pub(crate) use source::Use;

use crate::error::{Result, Warning};
use crate::image::{Encoding, Image, Pixels};
use crate::load::decoders::Decoder;
use bytes::{guarded, read_bytes, signature};
use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use source::Source;
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

/// What is said of a JPEG file without its end.
const CUT_SHORT: &str = "the JPEG lacks its end, so that a part of it may be missing; the rest is grey";

/// Reads an image file as a picture to look at.
///
/// # Errors
/// As for [`load_environment`].
pub fn load_picture(path: &Path, warnings: &mut Vec<Warning>) -> Result<Image> {
    read(path, Use::Color, warnings)
}

/// Reads an image file for a use.
///
/// # Errors
/// An input error that names the file if it is missing, of an unknown format, broken, or larger than its length can
/// justify.
pub(crate) fn read(path: &Path, purpose: Use, warnings: &mut Vec<Warning>) -> Result<Image> {
    let bytes = read_bytes(path)?;
    let image = decode(&bytes, path, "", None, purpose, warnings)?;
    warnings.extend(unused(&bytes, path, "", purpose));
    Ok(image)
}

/// What an image that [`decode`] has read says about its pixels that they are taken without, and further frames and
/// pages.
pub(crate) fn unused(bytes: &[u8], file: &Path, pointer: &str, purpose: Use) -> Vec<Warning> {
    let source = Source { bytes, file, pointer };
    let format = signature(bytes);
    let messages = format.map_or(Vec::new(), |format| unused::messages(&source, format, purpose));
    messages.into_iter().map(|message| source.warning(message)).collect()
}

/// Decodes an image that lies inside `file` at `pointer` (a JSON pointer; empty for the whole file). `mime` is its
/// declared media type, if any.
///
/// # Errors
/// As for [`read`]; file and pointer are named.
pub(crate) fn decode(
    bytes: &[u8],
    file: &Path,
    pointer: &str,
    mime: Option<&str>,
    purpose: Use,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    let source = Source { bytes, file, pointer };
    let mut image = guarded(&source, || {
        if ktx2::is_ktx2(bytes) {
            return ktx2::decode(&source, purpose, warnings);
        }
        match format_of(&source, mime, warnings)? {
            ImageFormat::OpenExr => {
                openexr::decode(&source, purpose != Use::Data, purpose == Use::Color, warnings)
            }
            format => decode_common(&source, format, purpose, warnings),
        }
    })?;
    if let Some(Pixels::F32(numbers)) = Arc::get_mut(&mut image.pixels) {
        repair(&source, numbers, purpose, warnings);
    }
    if purpose == Use::Environment && u64::from(image.width) != 2 * u64::from(image.height) {
        let (width, height) = (image.width, image.height);
        let message = format!("is {width} x {height}; an equirectangular image is twice as wide as high");
        warnings.push(source.warning(message));
    }
    Ok(image)
}

/// Reads an image as the scene's environment: NaN, infinite and negative texels become 0, with a warning that counts
/// them.
///
/// # Errors
/// An input error if the file is missing, broken or larger than its length can justify.
pub fn load_environment(path: &Path, warnings: &mut Vec<Warning>) -> Result<Image> {
    read(path, Use::Environment, warnings)
}

/// Reads red, green and blue of an EXR or HDR file, told apart by content, every number as it is in the file, but for colours of
/// another space that an EXR names, which become linear Rec. 709. Alpha and
/// other channels are left out; a layered EXR gives its first layer with R, G and B.
///
/// # Errors
/// An input error if the file is missing, broken, larger than its length can justify, or holds no colour.
pub fn load_linear_rgb(path: &Path) -> Result<Image> {
    let bytes = read_bytes(path)?;
    let source = Source { bytes: &bytes, file: path, pointer: "" };
    let image = guarded(&source, || match signature(&bytes) {
        Some(ImageFormat::OpenExr) => openexr::decode(&source, true, false, &mut Vec::new()),
        Some(ImageFormat::Hdr) => decode_common(&source, ImageFormat::Hdr, Use::Environment, &mut Vec::new()),
        _ => Err(source
            .error("is neither an EXR nor a Radiance HDR file")
            .with_help("linear pictures come as .exr or .hdr")),
    })?;
    if image.channels == 3 { Ok(image) } else { Err(source.error("has no layer with channels R, G and B")) }
}

fn format_of(source: &Source, mime: Option<&str>, warnings: &mut Vec<Warning>) -> Result<ImageFormat> {
    let declared = mime.and_then(|m| match m {
        "image/tga" | "image/x-tga" | "image/x-targa" => Some(ImageFormat::Tga),
        _ => ImageFormat::from_mime_type(m),
    });
    let format = match signature(source.bytes) {
        Some(found) => {
            if declared.is_some_and(|d| d != found) {
                let (says, is) = (mime.unwrap_or_default(), found.to_mime_type());
                warnings.push(source.warning(format!("is declared as {says}, but its content is {is}")));
            }
            Some(found)
        }
        None => {
            declared.or_else(|| ImageFormat::from_path(source.file).ok()).filter(|f| *f == ImageFormat::Tga)
        }
    };
    let decoder = match format {
        Some(ImageFormat::Tiff) => Some(Decoder::Tiff),
        Some(ImageFormat::WebP) => Some(Decoder::WebP),
        _ => None,
    };
    if let Some(lacking) = decoder.filter(|d| !d.is_built_in()) {
        return Err(source.lacks(lacking));
    }
    // GIF is for writing.
    let is_known = |f: &ImageFormat| f.reading_enabled() && *f != ImageFormat::Gif;
    let readable = |f: &ImageFormat| is_known(f) || *f == ImageFormat::OpenExr;
    format.filter(readable).ok_or_else(|| {
        source
            .error(if source.bytes.is_empty() { "is empty" } else { "is not an image of a known format" })
            .with_help("oscura reads PNG, JPEG, WebP, KTX2, BMP, TGA, TIFF, HDR and EXR")
    })
}

/// Everything but EXR.
fn decode_common(
    source: &Source,
    format: ImageFormat,
    purpose: Use,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    let broken = |e: image::ImageError| source.error(format!("can't be read as an image: {e}"));
    let decoded = if format == ImageFormat::Hdr {
        let decoder = HdrDecoder::new_nonstrict(Cursor::new(source.bytes)).map_err(broken)?;
        let size = decoder.metadata();
        limits::check(source, size.width.into(), size.height.into())?;
        DynamicImage::from_decoder(decoder).map_err(broken)?
    } else {
        let mut reader = ImageReader::with_format(Cursor::new(source.bytes), format);
        reader.limits(limits::for_decoder(source));
        let decoder = reader.into_decoder().map_err(broken)?;
        let (width, height) = decoder.dimensions();
        limits::check(source, width.into(), height.into())?;
        DynamicImage::from_decoder(decoder).map_err(broken)?
    };
    if format == ImageFormat::Jpeg && !jpeg_is_complete(source.bytes) {
        warnings.push(source.warning(CUT_SHORT));
    }
    let (width, height) = (decoded.width(), decoded.height());
    let (pixels, channels) = match decoded {
        DynamicImage::ImageLuma8(i) => (Pixels::U8(i.into_raw()), 1),
        DynamicImage::ImageLumaA8(i) => (Pixels::U8(i.into_raw()), 2),
        DynamicImage::ImageRgb8(i) => (Pixels::U8(i.into_raw()), 3),
        DynamicImage::ImageRgba8(i) => (Pixels::U8(i.into_raw()), 4),
        DynamicImage::ImageLuma16(i) => (Pixels::U16(i.into_raw()), 1),
        DynamicImage::ImageLumaA16(i) => (Pixels::U16(i.into_raw()), 2),
        DynamicImage::ImageRgb16(i) => (Pixels::U16(i.into_raw()), 3),
        DynamicImage::ImageRgba16(i) => (Pixels::U16(i.into_raw()), 4),
        DynamicImage::ImageRgb32F(i) => (Pixels::F32(i.into_raw()), 3),
        other => (Pixels::F32(other.into_rgba32f().into_raw()), 4),
    };
    let linear = purpose == Use::Data || matches!(pixels, Pixels::F32(_));
    let encoding = if linear { Encoding::Linear } else { Encoding::Srgb };
    Ok(Image { name: source.name(), width, height, channels, encoding, pixels: Arc::new(pixels) })
}

/// Does an end-of-image marker follow the last scan? The decoder fills what is missing with grey and says nothing.
/// Inside a scan's data a 0xff is always followed by 0, so markers can't be mistaken.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    let end = bytes.windows(2).rposition(|w| w == [0xff, 0xd9]);
    end.is_some_and(|end| bytes[end..].windows(2).all(|w| w != [0xff, 0xda]))
}

/// Sets numbers that no picture can use to 0 and counts them.
fn repair(source: &Source, numbers: &mut [f32], purpose: Use, warnings: &mut Vec<Warning>) {
    let (mut not_finite, mut negative) = (0usize, 0usize);
    for v in numbers.iter_mut() {
        if !v.is_finite() {
            not_finite += 1;
            *v = 0.0;
        } else if *v < 0.0 && purpose == Use::Environment {
            negative += 1;
            *v = 0.0;
        }
    }
    let total = numbers.len();
    if not_finite > 0 {
        warnings.push(
            source.warning(format!("{not_finite} of {total} numbers are NaN or infinite and became 0")),
        );
    }
    if negative > 0 {
        warnings.push(source.warning(format!("{negative} of {total} numbers are negative and became 0")));
    }
}

#[cfg(test)]
mod tests;
