//! Image files to pixels for OBJ materials and scene files.

use crate::error::{Error, Result, Warning};
use crate::image::{Encoding, Image, Pixels};
use image::{DynamicImage, ImageReader};
use std::path::Path;
use std::sync::Arc;

/// What an image is for, which decides how its numbers are understood.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// Colour: integers are sRGB-encoded.
    Color,
    /// Surroundings: integers are sRGB-encoded, floats radiance.
    Environment,
}

/// Largest number of pixels that are decoded.
const MOST_PIXELS: u64 = 1 << 30;

/// Reads an image file. Floats that are not finite become 0 and are counted in a warning.
pub(super) fn read(path: &Path, purpose: Use, warnings: &mut Vec<Warning>) -> Result<Image> {
    let fail = |e: &dyn std::fmt::Display| Error::input(path, format!("can't be read as an image: {e}"));
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
        return read_exr(path, warnings);
    }
    let reader = ImageReader::open(path).and_then(ImageReader::with_guessed_format).map_err(|e| fail(&e))?;
    let decoded = reader.decode().map_err(|e| fail(&e))?;
    let (width, height) = (decoded.width(), decoded.height());
    if width == 0 || height == 0 {
        return Err(fail(&"it has no pixels"));
    }
    if purpose == Use::Environment && u64::from(width) != 2 * u64::from(height) {
        let message = format!("is {width} x {height}; an equirectangular image is twice as wide as high");
        warnings.push(Warning::new(path, "", message));
    }
    let (pixels, channels, encoding) = match decoded {
        DynamicImage::ImageLuma8(i) => (Pixels::U8(i.into_raw()), 1, Encoding::Srgb),
        DynamicImage::ImageLumaA8(i) => (Pixels::U8(i.into_raw()), 2, Encoding::Srgb),
        DynamicImage::ImageRgb8(i) => (Pixels::U8(i.into_raw()), 3, Encoding::Srgb),
        DynamicImage::ImageRgba8(i) => (Pixels::U8(i.into_raw()), 4, Encoding::Srgb),
        DynamicImage::ImageLuma16(i) => (Pixels::U16(i.into_raw()), 1, Encoding::Srgb),
        DynamicImage::ImageLumaA16(i) => (Pixels::U16(i.into_raw()), 2, Encoding::Srgb),
        DynamicImage::ImageRgb16(i) => (Pixels::U16(i.into_raw()), 3, Encoding::Srgb),
        DynamicImage::ImageRgba16(i) => (Pixels::U16(i.into_raw()), 4, Encoding::Srgb),
        DynamicImage::ImageRgb32F(i) => {
            (Pixels::F32(finite(path, i.into_raw(), warnings)), 3, Encoding::Linear)
        }
        other => (Pixels::F32(finite(path, other.into_rgba32f().into_raw(), warnings)), 4, Encoding::Linear),
    };
    let name = path.display().to_string();
    Ok(Image { name, width, height, channels, encoding, pixels: Arc::new(pixels) })
}

fn finite(path: &Path, mut data: Vec<f32>, warnings: &mut Vec<Warning>) -> Vec<f32> {
    let mut bad = 0usize;
    for v in data.iter_mut().filter(|v| !v.is_finite()) {
        *v = 0.0;
        bad += 1;
    }
    if bad > 0 {
        warnings.push(Warning::new(path, "", format!("{bad} numbers that are not finite became 0")));
    }
    data
}

/// The first RGB(A) layer of an EXR file.
fn read_exr(path: &Path, warnings: &mut Vec<Warning>) -> Result<Image> {
    let fail = |e: String| Error::input(path, format!("can't be read as an EXR image: {e}"));
    let meta = exr::meta::MetaData::read_from_file(path, false).map_err(|e| fail(e.to_string()))?;
    let largest =
        meta.headers.iter().map(|h| h.layer_size.width() as u64 * h.layer_size.height() as u64).max();
    if largest.is_none_or(|n| n == 0 || n > MOST_PIXELS) {
        return Err(fail("its size is zero or beyond 2^30 pixels".to_string()));
    }
    let read = exr::prelude::read_first_rgba_layer_from_file(
        path,
        |size, _| (size.width(), vec![0f32; size.width() * size.height() * 3]),
        |(width, data), at, (r, g, b, _): (f32, f32, f32, f32)| {
            let i = (at.y() * *width + at.x()) * 3;
            data[i..i + 3].copy_from_slice(&[r, g, b]);
        },
    );
    let layer = read.map_err(|e| fail(e.to_string()))?.layer_data;
    let size = layer.size;
    let data = finite(path, layer.channel_data.pixels.1, warnings);
    let side = |n: usize| u32::try_from(n).map_err(|_| fail("its size is too large".to_string()));
    Ok(Image::from_linear_rgb(&path.display().to_string(), side(size.width())?, side(size.height())?, data))
}
