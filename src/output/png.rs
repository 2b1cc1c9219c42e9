//! PNG: 8 bits, display-referred, with straight alpha where the picture has holes.

use super::encoded::Encoded;
use super::tone::ViewTransform;
use crate::film::Film;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

/// How a PNG looks.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PngOptions {
    /// The view transform.
    pub view: ViewTransform,
    /// Stops: colours are multiplied by 2 to this power.
    pub exposure: f32,
    /// Hides the steps between 8-bit values with an 8x8 ordered pattern (Bayer 1973).
    pub dither: bool,
}

/// Encodes a film: RGB where the picture is opaque everywhere, else RGBA.
///
/// # Errors
/// What the encoder objects to.
pub fn encode_png(film: &Film, options: &PngOptions) -> Result<Encoded, String> {
    let mut data = rgba8(film, options);
    let opaque = data.as_chunks::<4>().0.iter().all(|pixel| pixel[3] == 255);
    if opaque {
        data = data.as_chunks::<4>().0.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect();
    }
    let kind = if opaque { ExtendedColorType::Rgb8 } else { ExtendedColorType::Rgba8 };
    Ok(Encoded { bytes: encode(&data, film.width(), film.height(), kind)?, warnings: vec![] })
}

/// The pixels as displays take them: RGBA with straight alpha, row by row from the top.
pub fn rgba8(film: &Film, options: &PngOptions) -> Vec<u8> {
    let places = (0..film.height()).flat_map(|y| (0..film.width()).map(move |x| (x, y)));
    let rgba = film.rgba();
    let gain = options.exposure.exp2();
    let mut data = Vec::with_capacity(rgba.len() * 4);
    for ((x, y), [r, g, b, alpha]) in places.zip(rgba) {
        let straight = if alpha > 0.0 && alpha < 1.0 { gain / alpha } else { gain };
        let threshold = if options.dither { bayer(x, y) } else { 0.5 };
        data.extend([r, g, b].map(|v| to_byte(options.view.encode(v * straight), threshold)));
        data.push(to_byte(alpha, 0.5));
    }
    data
}

/// Encodes `width * height` pixels of 8-bit RGB.
///
/// # Errors
/// What the encoder objects to.
pub fn encode_png_rgb8(data: &[u8], width: u32, height: u32) -> Result<Vec<u8>, String> {
    encode(data, width, height, ExtendedColorType::Rgb8)
}

fn encode(data: &[u8], width: u32, height: u32, kind: ExtendedColorType) -> Result<Vec<u8>, String> {
    let expected = width as usize * height as usize * usize::from(kind.channel_count());
    if data.len() != expected {
        return Err(format!("{} bytes of pixels where {expected} belong", data.len()));
    }
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
        .write_image(data, width, height, kind)
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

fn to_byte(value: f32, threshold: f32) -> u8 {
    // `as` saturates and maps NaN to 0.
    (value * 255.0 + threshold).floor() as u8
}

/// The 8x8 ordered-dither threshold in 0..1: bits of x ^ y and y interleaved, most significant last.
fn bayer(x: u32, y: u32) -> f32 {
    let mixed = x ^ y;
    let mut value = 0;
    for bit in 0..3 {
        value = value << 2 | (mixed >> bit & 1) << 1 | y >> bit & 1;
    }
    (value as f32 + 0.5) / 64.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dither_thresholds_are_all_different_and_centred() {
        let mut seen: Vec<u32> = (0..64).map(|i| (bayer(i % 8, i / 8) * 64.0) as u32).collect();
        seen.sort_unstable();
        assert_eq!(seen, (0..64).collect::<Vec<_>>());
    }

    #[test]
    fn bytes_saturate() {
        assert_eq!([f32::NAN, -1.0, 0.0, 0.5, 1.0, 9.0].map(|v| to_byte(v, 0.5)), [0, 0, 0, 128, 255, 255]);
    }
}
