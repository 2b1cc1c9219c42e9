//! Display-referred formats, with straight alpha unless opaque: PNG, JPEG, TIFF and WebP; and Radiance HDR, which is linear.

use super::atomic::{EncodedPicture, Format};
use crate::color::{ViewTransform, white_balance};
use crate::film::Film;
use image::codecs::hdr::HdrEncoder;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, Rgb};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// JPEG quality, 0..100.
const JPEG_QUALITY: u8 = 92;

/// Options of display-referred formats.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PngOptions {
    /// The view transform.
    pub view: ViewTransform,
    /// Exposure, stops.
    pub exposure: f32,
    /// Colour temperature of light that appears white, kelvin.
    pub white_balance: Option<f32>,
    /// Ordered dithering of 8-bit values with an 8x8 pattern (Bayer 1973).
    pub dither: bool,
    /// 16 bits per channel instead of 8, in PNG and TIFF.
    pub deep: bool,
    /// Composite over black, without alpha.
    pub opaque: bool,
}

/// Linear pixels with premultiplied alpha, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub struct Linear<'a> {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Red, green, blue, alpha.
    pub rgba: &'a [[f32; 4]],
}

/// Encodes a film as PNG: RGB if the picture is completely opaque, else RGBA.
///
/// # Errors
/// The message of the encoder.
pub fn encode_png(film: &Film, options: &PngOptions) -> Result<EncodedPicture, String> {
    let picture = Linear { width: film.width(), height: film.height(), rgba: &film.rgba() };
    Ok(EncodedPicture { bytes: encode_display_png(&picture, Format::Png, options)?, warnings: vec![] })
}

/// Encodes pixels in a display-referred format or as HDR. Without alpha in the format pixels are composited over black.
///
/// # Errors
/// The message of the encoder.
pub fn encode_display_png(picture: &Linear, format: Format, options: &PngOptions) -> Result<Vec<u8>, String> {
    if format == Format::Hdr {
        return encode_hdr(picture, options);
    }
    let alpha = match format {
        Format::Jpeg => false,
        _ if options.opaque => false,
        _ => picture.rgba.iter().any(|pixel| byte(pixel[3]) != 255),
    };
    let depth = if options.deep && matches!(format, Format::Png | Format::Tiff) { 65535.0 } else { 255.0 };
    let layout = PixelLayout { alpha, straight: format != Format::Jpeg && !options.opaque, white: depth };
    let codes = codes(picture, options, layout);
    let (data, kind) = match (depth > 255.0, alpha) {
        (false, false) => (to_bytes(&codes), ExtendedColorType::Rgb8),
        (false, true) => (to_bytes(&codes), ExtendedColorType::Rgba8),
        (true, false) => (bytemuck::cast_slice(&codes).to_vec(), ExtendedColorType::Rgb16),
        (true, true) => (bytemuck::cast_slice(&codes).to_vec(), ExtendedColorType::Rgba16),
    };
    encode(&data, picture.width, picture.height, kind, format)
}

/// 8-bit pixels of a film: RGBA with straight alpha, row by row from the top.
pub fn rgba8(film: &Film, options: &PngOptions) -> Vec<u8> {
    straight8(&Linear { width: film.width(), height: film.height(), rgba: &film.rgba() }, options)
}

/// 8-bit RGBA pixels of a linear picture, with straight alpha.
pub(super) fn straight8(picture: &Linear, options: &PngOptions) -> Vec<u8> {
    let mut rgba = to_bytes(&codes(
        picture,
        options,
        PixelLayout { alpha: true, straight: !options.opaque, white: 255.0 },
    ));
    if options.opaque {
        rgba.as_chunks_mut::<4>().0.iter_mut().for_each(|pixel| pixel[3] = 255);
    }
    rgba
}

/// 8-bit RGBA pixels of a linear picture, with colours composited over black (premultiplied).
pub fn display_rgba8(picture: &Linear, options: &PngOptions) -> Vec<u8> {
    to_bytes(&codes(picture, options, PixelLayout { alpha: true, straight: false, white: 255.0 }))
}

/// Length of a PNG's signature and first chunk (IHDR), bytes.
const PNG_HEAD: usize = 8 + 12 + 13;

/// Inserts a text (chunk `tEXt`) after the header of a PNG. Non-ASCII characters of keyword and text become question marks.
pub fn with_png_text(mut png: Vec<u8>, keyword: &str, text: &str) -> Vec<u8> {
    let ascii =
        |text: &str| text.chars().map(|c| if c.is_ascii() { c as u8 } else { b'?' }).collect::<Vec<_>>();
    let data = [&ascii(keyword)[..], &[0], &ascii(text)].concat();
    let typed = [b"tEXt", &data[..]].concat();
    let (length, check) = ((data.len() as u32).to_be_bytes(), crc32fast::hash(&typed).to_be_bytes());
    let at = PNG_HEAD.min(png.len());
    png.splice(at..at, [&length[..], &typed, &check].concat());
    png
}

/// The text inserted by [`with_png_text`] for a keyword; `None` for other files.
pub fn png_text(path: &Path, keyword: &str) -> Option<String> {
    /// Maximum length of the text chunk, bytes.
    const MAX_CHUNK: u64 = 4096;
    let mut start = Vec::new();
    File::open(path).ok()?.take(PNG_HEAD as u64 + 8 + MAX_CHUNK).read_to_end(&mut start).ok()?;
    let (head, rest) = start.split_at_checked(PNG_HEAD)?;
    let (length, rest) = rest.split_first_chunk::<4>()?;
    let data = rest.strip_prefix(b"tEXt")?.get(..u32::from_be_bytes(*length) as usize)?;
    let text = data.strip_prefix(keyword.as_bytes())?.strip_prefix(&[0])?;
    let is_png = head.starts_with(b"\x89PNG\r\n\x1a\n");
    is_png.then(|| String::from_utf8_lossy(text).into_owned())
}

/// Layout of integer pixel values.
struct PixelLayout {
    /// RGBA instead of RGB.
    alpha: bool,
    /// Straight instead of premultiplied alpha.
    straight: bool,
    /// The integer for 1.0.
    white: f32,
}

/// Converts to display-referred integers.
fn codes(picture: &Linear, options: &PngOptions, layout: PixelLayout) -> Vec<u16> {
    let PixelLayout { alpha, straight, white } = layout;
    let pixels = (0..picture.height).flat_map(|y| (0..picture.width).map(move |x| (x, y)));
    let mut data = Vec::with_capacity(picture.rgba.len() * 4);
    let balance = Balance::of(options);
    for ((x, y), &[r, g, b, a]) in pixels.zip(picture.rgba) {
        let divisor = if straight && a > 0.0 && a < 1.0 { a } else { 1.0 };
        let threshold = if options.dither && white < 256.0 { bayer(x, y) } else { 0.5 };
        let shown = options.view.encode(balance.apply([r, g, b], divisor));
        data.extend(shown.map(|v| code(v, white, threshold)));
        if alpha {
            data.push(code(a, white, 0.5));
        }
    }
    data
}

/// Exposure and white balance.
struct Balance {
    gain: f32,
    matrix: Option<[[f32; 3]; 3]>,
}

impl Balance {
    fn of(options: &PngOptions) -> Balance {
        let matrix = options.white_balance.map(|kelvin| white_balance(f64::from(kelvin)));
        Balance { gain: options.exposure.exp2(), matrix }
    }

    /// Applies both to a colour divided by `divisor`.
    fn apply(&self, rgb: [f32; 3], divisor: f32) -> [f32; 3] {
        let [r, g, b] = rgb.map(|v| v * (self.gain / divisor));
        match &self.matrix {
            Some(rows) => rows.map(|row| row[0] * r + row[1] * g + row[2] * b),
            None => [r, g, b],
        }
    }
}

/// Encodes 8-bit RGB pixels in a format other than EXR and HDR.
///
/// # Errors
/// The message of the encoder.
pub fn encode_rgb8(data: &[u8], width: u32, height: u32, format: Format) -> Result<Vec<u8>, String> {
    encode(data, width, height, ExtendedColorType::Rgb8, format)
}

fn encode(
    data: &[u8],
    width: u32,
    height: u32,
    kind: ExtendedColorType,
    format: Format,
) -> Result<Vec<u8>, String> {
    let expected = width as usize * height as usize * usize::from(kind.bits_per_pixel() / 8);
    if data.len() != expected {
        return Err(format!("{} bytes of pixels instead of {expected}", data.len()));
    }
    let mut bytes = std::io::Cursor::new(Vec::new());
    let written = match format {
        Format::Jpeg => {
            JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).write_image(data, width, height, kind)
        }
        #[cfg(feature = "tiff")]
        Format::Tiff => {
            image::codecs::tiff::TiffEncoder::new(&mut bytes).write_image(data, width, height, kind)
        }
        #[cfg(feature = "webp")]
        Format::WebP => {
            image::codecs::webp::WebPEncoder::new_lossless(&mut bytes).write_image(data, width, height, kind)
        }
        Format::Png => {
            PngEncoder::new_with_quality(&mut bytes, CompressionType::Default, FilterType::Adaptive)
                .write_image(data, width, height, kind)
        }
        other => return Err(format!("this build can't write {}", other.name())),
    };
    written.map_err(|e| e.to_string())?;
    Ok(bytes.into_inner())
}

fn encode_hdr(picture: &Linear, options: &PngOptions) -> Result<Vec<u8>, String> {
    let balance = Balance::of(options);
    let shown = |&[r, g, b, _]: &[f32; 4]| Rgb(balance.apply([r, g, b], 1.0).map(|v| v.max(0.0)));
    let pixels: Vec<Rgb<f32>> = picture.rgba.iter().map(shown).collect();
    let mut bytes = Vec::new();
    HdrEncoder::new(&mut bytes)
        .encode(&pixels, picture.width as usize, picture.height as usize)
        .map_err(|e| e.to_string())?;
    Ok(bytes)
}

fn to_bytes(codes: &[u16]) -> Vec<u8> {
    codes.iter().map(|&code| code as u8).collect()
}

fn byte(value: f32) -> u8 {
    code(value, 255.0, 0.5) as u8
}

fn code(value: f32, white: f32, threshold: f32) -> u16 {
    // `as` saturates and maps NaN to 0.
    ((value * white + threshold).floor() as u16).min(white as u16)
}

/// The 8x8 ordered-dither threshold in 0..1: interleaved, reversed bits of x ^ y and y.
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
    fn dither_thresholds_are_distinct_and_centred() {
        let mut thresholds: Vec<u32> = (0..64).map(|i| (bayer(i % 8, i / 8) * 64.0) as u32).collect();
        thresholds.sort_unstable();
        assert_eq!(thresholds, (0..64).collect::<Vec<_>>());
    }

    #[test]
    fn png_texts_are_read_back_and_pixels_unchanged() {
        let rgba = [[0.2, 0.5, 0.8, 1.0]; 4 * 3];
        let picture = Linear { width: 4, height: 3, rgba: &rgba };
        let plain = encode_display_png(&picture, Format::Png, &PngOptions::default()).expect("encoded");
        let file = tempfile::NamedTempFile::new().expect("a file");
        let text_of = |bytes: &[u8], keyword: &str| {
            std::fs::write(file.path(), bytes).expect("written");
            png_text(file.path(), keyword)
        };
        let with_text = with_png_text(plain.clone(), "key", "the text");
        assert_eq!(text_of(&with_text, "key").as_deref(), Some("the text"));
        let decoded = |bytes: &[u8]| image::load_from_memory(bytes).expect("a picture").into_rgb8();
        assert_eq!(decoded(&with_text), decoded(&plain));
        for other in [&plain[..], &with_text[..40], b"", b"key\0the text"] {
            assert_eq!(text_of(other, "key"), None);
        }
        assert_eq!(text_of(&with_text, "ke"), None);
    }

    #[test]
    fn bytes_saturate() {
        assert_eq!([f32::NAN, -1.0, 0.0, 0.5, 1.0, 9.0].map(byte), [0, 0, 0, 128, 255, 255]);
    }

    #[test]
    fn all_formats_are_decoded_to_the_picture() {
        let rgba = [[0.2, 0.5, 0.8, 1.0]; 16 * 9];
        let picture = Linear { width: 16, height: 9, rgba: &rgba };
        for (format, deep, tolerance) in [
            (Format::Png, false, 1),
            (Format::Png, true, 1),
            (Format::Jpeg, false, 3),
            (Format::Tiff, true, 1),
            (Format::WebP, false, 1),
        ] {
            let options = PngOptions { deep, ..PngOptions::default() };
            let bytes = encode_display_png(&picture, format, &options).expect("encoded");
            let read = image::load_from_memory(&bytes).expect("a picture");
            assert_eq!(read.color().bytes_per_pixel(), if deep { 6 } else { 3 }, "{format:?}");
            let expected = [0.2, 0.5, 0.8].map(|v| byte(ViewTransform::Srgb.encode([v; 3])[0]));
            let pixel = read.to_rgb8().get_pixel(7, 4).0;
            assert!(
                pixel.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= tolerance),
                "{format:?} {pixel:?}"
            );
        }
        let hdr =
            encode_display_png(&picture, Format::Hdr, &PngOptions { exposure: 1.0, ..PngOptions::default() });
        let read = image::load_from_memory(&hdr.expect("encoded")).expect("a picture").to_rgb32f();
        let pixel = read.get_pixel(3, 3).0;
        assert!(pixel.iter().zip([0.4, 1.0, 1.6]).all(|(a, b)| (a - b).abs() < 0.01), "{pixel:?}");
    }
}
