//! Image reader: PNG, JPEG, WebP, GIF, BMP, TGA and TIFF by the crate `image`, Radiance HDR, EXR, and KTX2.
//!
//! 8-bit images stay 8-bit. The format is recognised by the content; TGA, which has no signature, by its media
//! type or name. Sizes are checked against the file's length before allocation (`source::check`).

mod deferred;
mod exr_rows;
mod ktx2;
mod metadata;
mod openexr;
mod radiance;
mod source;

pub(crate) use deferred::{OnDamage, for_texture, read_for_texture};
pub use openexr::{ChannelInfo, Layered, load_layered};
pub(crate) use source::{ImageFile, Use};

use crate::error::{Result, Warning};
use crate::image::{Encoding, Image, Pixels};
use crate::load::decoders::Decoder;
use crate::load::files;
use crate::load::files::Content;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use source::{Repair, Source, catching_panics, read_bytes, signature};
use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

/// The warning about a truncated JPEG file.
const TRUNCATED_JPEG: &str = "the JPEG lacks its end marker: missing parts are grey";

/// Reads an image file for display, applying its orientation (EXIF) and colour profile (ICC). `memory_limit` is the maximum
/// size of its pixels, bytes.
///
/// # Errors
/// As for [`load_environment`].
pub fn load_picture(path: &Path, memory_limit: Option<u64>, warnings: &mut Vec<Warning>) -> Result<Image> {
    read(path, Use::Picture, memory_limit, warnings)
}

/// Reads an image file for a use.
///
/// # Errors
/// An input error if the file is missing, of an unknown format, damaged, or declares more pixels than its length or
/// `memory_limit` (bytes) permits.
pub(crate) fn read(
    path: &Path,
    purpose: Use,
    memory_limit: Option<u64>,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    let bytes = read_bytes(path, memory_limit)?;
    let source = Source::new(&bytes, (path, ""), memory_limit);
    let image = decode_source(&source, None, purpose, warnings)?;
    warnings.extend(metadata_warnings(&bytes, path, "", purpose));
    Ok(image)
}

/// Warnings about metadata that [`decode`] ignores, and about further frames and pages.
pub(crate) fn metadata_warnings(bytes: &[u8], file: &Path, pointer: &str, purpose: Use) -> Vec<Warning> {
    let source = Source::new(bytes, (file, pointer), None);
    let format = signature(bytes);
    let messages = format.map_or(Vec::new(), |format| metadata::messages(&source, format, purpose));
    messages.into_iter().map(|message| source.warning(message)).collect()
}

/// Decodes an image inside a file.
///
/// # Errors
/// As for [`read`].
pub(crate) fn decode(of: &ImageFile, purpose: Use, warnings: &mut Vec<Warning>) -> Result<Image> {
    decode_source(&of.source(), of.mime, purpose, warnings)
}

/// [`decode`] for a source with its declared media type, if any.
fn decode_source(
    source: &Source,
    mime: Option<&str>,
    purpose: Use,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    let mut image = catching_panics(source, || {
        if ktx2::is_ktx2(source.bytes) {
            return ktx2::decode(source, purpose, warnings);
        }
        match format_of(source, mime, warnings)? {
            ImageFormat::OpenExr => {
                openexr::displayed(source, purpose != Use::Data, purpose.has_alpha(), warnings)
            }
            format => decode_common(source, format, purpose, warnings),
        }
    })?;
    if let Some(Pixels::F32(numbers)) = Arc::get_mut(&mut image.pixels) {
        let mut repair = Repair::new(purpose);
        repair.apply(numbers);
        repair.warn(source, warnings);
    }
    if purpose == Use::Environment && u64::from(image.width) != 2 * u64::from(image.height) {
        let (width, height) = (image.width, image.height);
        let hint =
            if is_cube(width, height) { ", and this may be a cube map, which must be converted" } else { "" };
        let message =
            format!("is {width} x {height}; an equirectangular image is twice as wide as high{hint}");
        warnings.push(source.warning(message));
    }
    Ok(image)
}

/// Reads an environment image: NaN, infinite and negative values become 0, with a warning.
///
/// # Errors
/// An input error if the file is missing, damaged, or declares more pixels than its length permits.
pub fn load_environment(path: &Path, warnings: &mut Vec<Warning>) -> Result<Image> {
    load_environment_within(path, None, warnings)
}

/// [`load_environment`] with a maximum size of the pixels, bytes.
///
/// # Errors
/// As for [`load_environment`], and if the pixels exceed the limit.
pub fn load_environment_within(
    path: &Path,
    memory_limit: Option<u64>,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    read(path, Use::Environment, memory_limit, warnings)
}

/// Reads red, green and blue of an EXR or HDR file (by content), including NaN and negative values. Colours of an EXR with
/// other primaries are converted to linear Rec. 709. Of a layered EXR the first layer with R, G and B is read.
///
/// # Errors
/// An input error if the file is missing, damaged, has no colour, or declares more pixels than its length permits.
pub fn load_linear_rgb(path: &Path) -> Result<Image> {
    let bytes = read_bytes(path, None)?;
    let source = Source::new(&bytes, (path, ""), None);
    let image = catching_panics(&source, || match signature(&bytes) {
        Some(ImageFormat::OpenExr) => openexr::decode(&source, true, false, &mut Vec::new()),
        Some(ImageFormat::Hdr) => decode_common(&source, ImageFormat::Hdr, Use::Environment, &mut Vec::new()),
        _ => Err(source
            .error(("image-not-linear", "is neither an .exr nor a .hdr file (OpenEXR, Radiance HDR)"))
            .with_help("convert the picture to .exr or .hdr")),
    })?;
    if image.channels == 3 { Ok(image) } else { Err(source.error("has no layer with channels R, G and B")) }
}

/// Whether an image has the aspect ratio of an unfolded cube map: a cross, a row or a column.
fn is_cube(width: u32, height: u32) -> bool {
    let is = |w: u64, h: u64| u64::from(width) * h == u64::from(height) * w;
    is(4, 3) || is(3, 4) || is(6, 1) || is(1, 6) || is(3, 2)
}

fn format_of(source: &Source, mime: Option<&str>, warnings: &mut Vec<Warning>) -> Result<ImageFormat> {
    let declared = mime.and_then(|m| match m {
        "image/tga" | "image/x-tga" | "image/x-targa" => Some(ImageFormat::Tga),
        _ => ImageFormat::from_mime_type(m),
    });
    let format = match signature(source.bytes) {
        Some(found) => {
            if declared.is_some_and(|d| d != found) {
                let (declared, found) = (mime.unwrap_or_default(), found.to_mime_type());
                warnings
                    .push(source.warning(format!("is declared as {declared}, but its content is {found}")));
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
        return Err(source.missing_decoder_error(lacking));
    }
    let readable = |f: &ImageFormat| f.reading_enabled() || *f == ImageFormat::OpenExr;
    format.filter(readable).ok_or_else(|| match files::content_of(source.bytes) {
        Some(Content { what, remedy }) => source.error(format!("is {what}")).with_help(remedy),
        None => source
            .error(("image-format-unknown", "is not an image of a known format"))
            .with_help("oscura reads PNG, JPEG, WebP, KTX2, GIF, BMP, TGA, TIFF, HDR and EXR"),
    })
}

/// Decodes all formats but EXR and KTX2.
fn decode_common(
    source: &Source,
    format: ImageFormat,
    purpose: Use,
    warnings: &mut Vec<Warning>,
) -> Result<Image> {
    if format == ImageFormat::Hdr {
        let radiance::Radiance { width, height, rgb } = radiance::decode(source, warnings)?;
        let pixels = Arc::new(Pixels::F32(rgb));
        return Ok(Image {
            name: source.name(),
            width,
            height,
            channels: 3,
            encoding: Encoding::Linear,
            pixels,
        });
    }
    let broken = |e: image::ImageError| radiance::broken(source, &e);
    let mut reader = ImageReader::with_format(Cursor::new(source.bytes), format);
    reader.limits(source::decoder_limits(source));
    let decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    source::check(source, width.into(), height.into())?;
    source::check_memory(source, width.into(), height.into(), decoder.total_bytes())?;
    let mut decoded = DynamicImage::from_decoder(decoder).map_err(broken)?;
    if purpose.is_photograph() {
        let metadata = metadata::of(source.bytes, format);
        if let Some(profile) = metadata.color_profile() {
            match profile.apply(&decoded) {
                Some(profiled) => decoded = profiled,
                None => warnings.push(source.warning(
                    "has a grey colour profile for a colour image, or the reverse, which is ignored",
                )),
            }
        }
        decoded = metadata::oriented(decoded, metadata.orientation);
    }
    if format == ImageFormat::Jpeg && !jpeg_is_complete(source.bytes) {
        warnings.push(source.warning(("image-cut-short", TRUNCATED_JPEG)));
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

/// Whether an end-of-image marker follows the last scan. The decoder silently fills missing parts with grey. In scan data 0xff
/// is always followed by 0, so markers are unambiguous.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    let end = bytes.windows(2).rposition(|w| w == [0xff, 0xd9]);
    end.is_some_and(|end| bytes[end..].windows(2).all(|w| w != [0xff, 0xda]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Choice;
    use exr::image::{AnyChannel, AnyChannels, FlatSamples};
    use exr::meta::attribute::IntegerBounds;
    use exr::meta::header::{ImageAttributes, LayerAttributes};
    use exr::prelude::WritableImage;
    use image::{GrayImage, ImageBuffer, ImageEncoder, Luma, RgbImage, RgbaImage};

    const NAMELESS: &str = "picture";

    fn encode(picture: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        picture.into().write_to(&mut out, format).expect("encoded");
        out.into_inner()
    }

    /// Lossless 8-bit formats that this build reads.
    fn lossless() -> impl Iterator<Item = ImageFormat> {
        let all = [ImageFormat::Png, ImageFormat::WebP, ImageFormat::Bmp, ImageFormat::Tiff];
        all.into_iter().filter(ImageFormat::reading_enabled)
    }

    fn rgb() -> RgbImage {
        RgbImage::from_fn(4, 2, |x, y| image::Rgb([x as u8 * 60, y as u8 * 200, 7]))
    }

    fn file<'a>(
        bytes: &'a [u8],
        (path, pointer): (&'a str, &'a str),
        mime: Option<&'a str>,
    ) -> ImageFile<'a> {
        let place = (Path::new(path), pointer);
        ImageFile { bytes: bytes.into(), own_file: None, place, mime, memory_limit: None }
    }

    /// Decodes bytes without a name or media type; returns the warnings as text.
    fn decoded(bytes: &[u8], purpose: Use) -> (Result<Image>, Vec<String>) {
        let mut warnings = Vec::new();
        let image = decode(&file(bytes, (NAMELESS, "/images/3"), None), purpose, &mut warnings);
        (image, warnings.iter().map(ToString::to_string).collect())
    }

    fn good(bytes: &[u8], purpose: Use) -> Image {
        let (image, warnings) = decoded(bytes, purpose);
        assert!(warnings.is_empty(), "{warnings:?}");
        image.expect("it can be read")
    }

    fn error(bytes: &[u8]) -> String {
        let text = decoded(bytes, Use::Color).0.expect_err("it can't be read").to_string();
        assert!(text.starts_with("picture: /images/3: "), "{text}");
        text
    }

    fn exr(
        width: usize,
        height: usize,
        pixel: impl Sync + Fn(usize, usize) -> (f32, f32, f32, f32),
    ) -> Vec<u8> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr");
        exr::prelude::write_rgba_file(&path, width, height, pixel).expect("written");
        std::fs::read(path).expect("read")
    }

    /// A Radiance HDR file without run lengths.
    fn hdr(width: u32, height: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
        let mut bytes =
            format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
        bytes.extend(pixels.as_flattened());
        bytes
    }

    #[test]
    fn lossless_formats_are_exact_and_stay_8_bit() {
        for format in lossless() {
            let image = good(&encode(rgb(), format), Use::Color);
            assert_eq!((image.width, image.height, image.channels), (4, 2, 3), "{format:?}");
            assert_eq!(image.encoding, Encoding::Srgb);
            let Pixels::U8(numbers) = &*image.pixels else { panic!("{format:?} is not 8-bit") };
            assert_eq!(*numbers, rgb().into_raw(), "{format:?}");
            assert_eq!(image.name, "picture#/images/3");
        }
    }

    #[test]
    fn grey_alpha_and_16_bit_keep_their_format() {
        let grey = good(&encode(GrayImage::from_pixel(3, 1, Luma([9])), ImageFormat::Png), Use::Data);
        assert_eq!((grey.channels, grey.encoding), (1, Encoding::Linear));
        let alpha = encode(RgbaImage::from_pixel(1, 1, image::Rgba([1, 2, 3, 128])), ImageFormat::Png);
        assert!((good(&alpha, Use::Color).rgba(0, 0)[3] - 128.0 / 255.0).abs() < 1e-6);
        let deep: ImageBuffer<Luma<u16>, Vec<u16>> = ImageBuffer::from_pixel(2, 2, Luma([40_000]));
        let deep = good(&encode(deep, ImageFormat::Png), Use::Data);
        assert!(matches!(&*deep.pixels, Pixels::U16(v) if v[..] == [40_000; 4]));
    }

    #[test]
    fn truncated_jpegs_are_reported() {
        let flat = RgbImage::from_pixel(64, 64, image::Rgb([200, 100, 50]));
        let bytes = encode(flat, ImageFormat::Jpeg);
        let texel = good(&bytes, Use::Data).rgba(60, 60).map(|v| v * 255.0);
        assert!((texel[0] - 200.0).abs() < 4.0 && (texel[2] - 50.0).abs() < 4.0, "{texel:?}");
        let (image, warnings) = decoded(&bytes[..bytes.len() - 12], Use::Color);
        match image {
            Ok(_) => assert!(warnings.iter().any(|w| w.contains("JPEG")), "{warnings:?}"),
            Err(e) => assert_eq!(e.problems[0].place, "/images/3"),
        }
    }

    #[test]
    fn the_memory_limit_is_checked_by_the_header() {
        let mut files: Vec<Vec<u8>> = lossless().map(|format| encode(rgb(), format)).collect();
        files.extend([ImageFormat::Jpeg, ImageFormat::Gif].map(|format| encode(rgb(), format)));
        files.extend([hdr(4, 2, &[[9, 2, 3, 129]; 8]), exr(4, 2, |_, _| (0.0, 0.0, 0.0, 1.0))]);
        for bytes in files {
            let read = |memory_limit| {
                let image_file = ImageFile { memory_limit, ..file(&bytes, (NAMELESS, ""), None) };
                decode(&image_file, Use::Color, &mut Vec::new())
            };
            let image = read(Some(1 << 20)).unwrap_or_else(|e| panic!("{e}"));
            let error = read(Some(20)).expect_err("it takes 24 bytes or more").to_string();
            assert!(error.contains("4 x 2") && error.contains("1 MiB"), "{error}");
            assert!(error.contains(&Choice::MemoryLimit.to_string()), "{error}");
            assert!(read(Some(image.bytes() as u64 - 1)).is_err());
        }
        // Files without pixels: the check precedes decoding.
        let claims = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2000 +X 2000\n";
        let image_file = ImageFile { memory_limit: Some(1000), ..file(claims, (NAMELESS, ""), None) };
        let error =
            decode(&image_file, Use::Color, &mut Vec::new()).expect_err("it is too large").to_string();
        assert!(error.contains("2000 x 2000") && error.contains("46 MiB"), "{error}");
        let large = encode(RgbImage::new(700, 700), ImageFormat::Png);
        let image_file = ImageFile { memory_limit: Some(1 << 20), ..file(&large, (NAMELESS, ""), None) };
        let on_damage: OnDamage = Arc::new(crate::image::Damage::Fatal);
        assert!(for_texture(&image_file, Use::Color, &mut Vec::new(), on_damage).is_err());
    }

    #[test]
    fn orientation_and_profile_are_applied_to_photographs() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("photograph.png");
        let mut bytes = Vec::new();
        let mut encoder = image::codecs::png::PngEncoder::new(&mut bytes);
        let exif = b"MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
        encoder.set_icc_profile(metadata::test_profiles::display_p3()).expect("room for a profile");
        encoder.set_exif_metadata(exif.to_vec()).expect("room for Exif");
        let red = RgbImage::from_fn(4, 2, |x, _| image::Rgb([if x == 0 { 255 } else { 0 }, 0, 0]));
        encoder.write_image(red.as_raw(), 4, 2, image::ExtendedColorType::Rgb8).expect("encoded");
        std::fs::write(&path, bytes).expect("written");
        for purpose in [Use::Environment, Use::Picture] {
            let mut warnings = Vec::new();
            let image = read(&path, purpose, None, &mut warnings).expect("it can be read");
            assert_eq!((image.width, image.height, image.encoding), (2, 4, Encoding::Linear));
            assert!(image.rgba(0, 0)[0] > 1.2 && image.rgba(1, 0)[0] > 1.2, "{:?}", image.rgba(0, 0));
            assert!(
                !warnings.iter().any(|w| w.message.contains("profile") || w.message.contains("orientation"))
            );
        }
        // Textures ignore both.
        let mut warnings = Vec::new();
        let image = read(&path, Use::Color, None, &mut warnings).expect("it can be read");
        assert_eq!((image.width, image.height, image.encoding), (4, 2, Encoding::Srgb));
        assert!((image.rgba(0, 1)[0] - 1.0).abs() < 1e-6 && warnings.len() == 2, "{warnings:?}");
    }

    #[test]
    fn tga_is_recognized_by_media_type_or_name() {
        let bytes = encode(rgb(), ImageFormat::Tga);
        let mut warnings = Vec::new();
        let mut read = |path: &str, mime| decode(&file(&bytes, (path, ""), mime), Use::Color, &mut warnings);
        for image in [read("a.tga", None), read("a", Some("image/x-tga"))] {
            assert!(
                matches!(&*image.expect("it can be read").pixels, Pixels::U8(v) if *v == rgb().into_raw())
            );
        }
        assert!(read("a", None).is_err() && read("a.png", None).is_err());
    }

    #[test]
    fn a_wrong_media_type_is_a_warning() {
        let mut warnings = Vec::new();
        let bytes = encode(rgb(), ImageFormat::Png);
        let mime = Some("image/jpeg");
        decode(&file(&bytes, ("a.glb", "/images/0"), mime), Use::Color, &mut warnings)
            .expect("content decides");
        assert_eq!(
            warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
            ["a.glb: /images/0: is declared as image/jpeg, but its content is image/png"]
        );
    }

    #[test]
    fn hdr_values_are_radiance() {
        // Mantissa and exponent: 128 * 2^(e - 136).
        let image = good(&hdr(2, 1, &[[128, 64, 0, 130], [128, 128, 128, 129]]), Use::Environment);
        assert_eq!(image.encoding, Encoding::Linear);
        assert_eq!(image.rgba(0, 0), [2.0, 1.0, 0.0, 1.0]);
        assert_eq!(image.rgba(1, 0), [1.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn exr_colour_is_unpremultiplied_only_if_alpha_is_kept() {
        let bytes = exr(4, 2, |x, _| if x == 0 { (0.5, 0.25, 4.0, 0.5) } else { (1.0, 2.0, 3.0, 1.0) });
        let colour = good(&bytes, Use::Color);
        assert_eq!((colour.channels, colour.rgba(0, 1)), (4, [1.0, 0.5, 8.0, 0.5]));
        let data = good(&bytes, Use::Data);
        assert_eq!((data.channels, data.rgba(0, 1)), (3, [0.5, 0.25, 4.0, 1.0]));
        assert_eq!(data.rgba(3, 0), [1.0, 2.0, 3.0, 1.0]);
    }

    /// A layer with a constant value per channel.
    fn layer(name: Option<&str>, channels: &[(&str, f32)]) -> exr::image::Layer<AnyChannels<FlatSamples>> {
        let channel = |&(name, value)| AnyChannel::new(name, FlatSamples::F32(vec![value; 8]));
        let attributes = name.map_or(LayerAttributes::default(), LayerAttributes::named);
        let channels = AnyChannels::sort(channels.iter().map(channel).collect());
        exr::image::Layer::new((4, 2), attributes, exr::image::Encoding::UNCOMPRESSED, channels)
    }

    fn layered(layers: Vec<exr::image::Layer<AnyChannels<FlatSamples>>>) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        let attributes = ImageAttributes::new(IntegerBounds::from_dimensions((4, 2)));
        let image = exr::image::Image::from_layers(attributes, exr::image::Layers::from(layers));
        image.write().non_parallel().to_buffered(&mut bytes).expect("written");
        bytes.into_inner()
    }

    #[test]
    fn unused_layers_and_channels_of_an_exr_are_listed() {
        let beauty = || layer(Some("beauty"), &[("R", 1.0), ("G", 2.0), ("B", 3.0), ("A", 1.0)]);
        let (image, warnings) = decoded(&layered(vec![beauty()]), Use::Environment);
        assert_eq!((image.expect("it can be read").rgba(0, 0), warnings.len()), ([1.0, 2.0, 3.0, 1.0], 0));
        let first = layer(Some("depth"), &[("Z", 9.0)]);
        let (image, warnings) = decoded(&layered(vec![first, beauty()]), Use::Environment);
        assert_eq!(image.expect("it can be read").rgba(0, 0), [1.0, 2.0, 3.0, 1.0]);
        let place = "picture: /images/3: is taken from the channels";
        assert_eq!(warnings, [format!("{place} RGB of layer 'beauty'; left out: layer 'depth'")]);
        // One part with several passes: channels of a single pass are used.
        let passes = [("a.B", 1.0), ("a.Z", 1.0), ("b.R", 4.0), ("b.G", 5.0), ("b.B", 6.0), ("c.R", 7.0)];
        let (image, warnings) = decoded(&layered(vec![layer(None, &passes)]), Use::Color);
        assert_eq!(image.expect("it can be read").rgba(0, 0), [4.0, 5.0, 6.0, 1.0]);
        assert_eq!(
            warnings,
            [format!("{place} b.RGB; left out: channel 'a.B', channel 'a.Z', channel 'c.R'")]
        );
    }

    /// An EXR with different data and display windows, and a NaN.
    fn large_exr() -> Vec<u8> {
        let (width, height) = (400, 300);
        let values = |seed: u32| {
            let value = |i: u32| (i.wrapping_mul(2_654_435_761 + seed) >> 20) as f32 / 64.0;
            let mut values: Vec<f32> = (0..width * height).map(value).collect();
            values[70_000] = f32::NAN;
            FlatSamples::F32(values)
        };
        let names = ["R", "G", "B", "A", "Z"];
        let channels = names.iter().zip(0..).map(|(name, seed)| AnyChannel::new(*name, values(seed)));
        let channels = AnyChannels::sort(channels.collect());
        let mut attributes = LayerAttributes::named("beauty");
        attributes.layer_position = exr::math::Vec2(20, -10);
        let size = (width as usize, height as usize);
        let layer = exr::image::Layer::new(size, attributes, exr::image::Encoding::FAST_LOSSLESS, channels);
        let attributes = ImageAttributes::new(IntegerBounds::from_dimensions((380, 310)));
        let layers = exr::image::Layers::from(vec![layer]);
        let mut bytes = Cursor::new(Vec::new());
        let image = exr::image::Image::from_layers(attributes, layers);
        image.write().non_parallel().to_buffered(&mut bytes).expect("written");
        bytes.into_inner()
    }

    #[test]
    fn deferred_float_textures_decode_to_the_same_bits() {
        let body: Vec<u8> =
            (0..400 * 300u32).flat_map(|i| [(i >> 8) as u8, i as u8, 9, 126 + (i % 5) as u8]).collect();
        let rotated =
            [b"#?RADIANCE\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n+X 400 +Y 300\n", &body[..]].concat();
        for (bytes, purpose, size) in [
            (large_exr(), Use::Color, [380, 310, 4]),
            (large_exr(), Use::Data, [380, 310, 3]),
            (rotated, Use::Color, [400, 300, 3]),
        ] {
            let (at_once, expected) = decoded(&bytes, purpose);
            let at_once = at_once.expect("it can be read");
            let (mut early, mut late) = (Vec::new(), Vec::new());
            let image_file = file(&bytes, (NAMELESS, "/images/3"), None);
            let image = for_texture(&image_file, purpose, &mut early, Arc::new(crate::image::Damage::Fatal));
            let image = image.expect("its header is read");
            assert!(image.is_encoded() && image.is_float() && early.is_empty(), "{early:?}");
            assert_eq!([image.width, image.height, image.channels], size);
            assert_eq!((image.encoding, image.bytes()), (at_once.encoding, at_once.bytes()));
            let image = image.decoded(&mut late).unwrap_or_else(|damage| panic!("{damage:?}"));
            let bits = |image: &Image| match &*image.pixels {
                Pixels::F32(numbers) => numbers.iter().map(|v| v.to_bits()).collect::<Vec<u32>>(),
                other => panic!("{other:?}"),
            };
            assert!(bits(&image) == bits(&at_once));
            assert_eq!(late.iter().map(ToString::to_string).collect::<Vec<_>>(), expected);
            assert!(!expected.is_empty());
            // The same bits by rows, from memory and from a file whose head alone was read.
            let folder = tempfile::tempdir().expect("a folder");
            let path = folder.path().join("a");
            std::fs::write(&path, &bytes).expect("written");
            let on_damage: OnDamage = Arc::new(crate::image::Damage::Fatal);
            let from_file = read_for_texture(&path, purpose, None, &mut early, on_damage.clone());
            let from_file = from_file.expect("its header is read");
            let from_memory =
                for_texture(&image_file, purpose, &mut early, on_damage).expect("its header is read");
            for (image, in_parallel) in [(&from_file, true), (&from_file, false), (&from_memory, false)] {
                assert_eq!(image.rows().is_some(), bytes[0] != b'#', "rotated files are decoded as a whole");
                let Pixels::Encoded(encoded) = &*image.pixels else { panic!("decoded") };
                let (mut found, mut late) = (Vec::new(), Vec::new());
                let take = &mut |rows: &[f32]| found.extend(rows.iter().map(|v| v.to_bits()));
                encoded.source.decode_rows(in_parallel, &mut late, take).unwrap_or_else(|d| panic!("{d:?}"));
                assert!(found == bits(&at_once) && late.len() == expected.len(), "{late:?}");
            }
        }
        let cut = &large_exr()[..200_000];
        let image_file = file(cut, (NAMELESS, ""), None);
        let image =
            for_texture(&image_file, Use::Color, &mut Vec::new(), Arc::new(crate::image::Damage::Fatal));
        assert!(image.is_err() || image.is_ok_and(|image| image.decoded(&mut Vec::new()).is_err()));
    }

    #[test]
    fn missing_decoders_are_reported_with_a_remedy() {
        for (decoder, bytes, feature) in [
            (Decoder::WebP, &b"RIFF\x10\0\0\0WEBPVP8 "[..], "webp"),
            (Decoder::Tiff, b"II*\0\x08\0\0\0", "tiff"),
        ] {
            let message = error(bytes);
            let remedy = format!("build it with `--features {feature}`, or convert the image");
            assert_eq!(message.contains(&remedy), !decoder.is_built_in(), "{message}");
        }
    }

    #[test]
    fn invalid_texels_of_an_environment_become_0_and_are_counted() {
        let bytes = exr(4, 2, |x, y| match (x, y) {
            (0, 0) => (f32::NAN, 1.0, f32::INFINITY, 1.0),
            (1, 0) => (-1.0, 1.0, -0.5, 1.0),
            (2, 1) => (1.0, 1.0, -2.0, 1.0),
            _ => (1.0, 1.0, 1.0, 1.0),
        });
        let (image, warnings) = decoded(&bytes, Use::Environment);
        let image = image.expect("it can be read");
        assert_eq!((image.rgba(0, 0), image.rgba(1, 0)), ([0.0, 1.0, 0.0, 1.0], [0.0, 1.0, 0.0, 1.0]));
        assert_eq!(
            warnings,
            [
                "picture: /images/3: 2 of 24 numbers are NaN or infinite and became 0",
                "picture: /images/3: 3 of 24 numbers are negative and became 0"
            ]
        );
        // Data may be negative.
        assert_eq!(decoded(&bytes, Use::Data).0.expect("it can be read").rgba(2, 1)[2], -2.0);
    }

    #[test]
    fn environments_of_other_aspect_ratios_are_a_warning() {
        let (image, warnings) = decoded(&encode(RgbImage::new(4, 4), ImageFormat::Png), Use::Environment);
        assert!(image.is_ok());
        assert_eq!(
            warnings,
            ["picture: /images/3: is 4 x 4; an equirectangular image is twice as wide as high"]
        );
    }

    #[test]
    fn truncated_files_are_reported_and_never_panic() {
        let noise =
            RgbImage::from_fn(40, 30, |x, y| image::Rgb([(x * 97 + y * 31) as u8, (x * y) as u8, x as u8]));
        let mut files: Vec<(String, Vec<u8>)> =
            lossless().map(|f| (format!("{f:?}"), encode(noise.clone(), f))).collect();
        files.push(("exr".into(), exr(40, 30, |x, y| (x as f32, y as f32, (x * y) as f32, 1.0))));
        files.push(("hdr".into(), hdr(4, 4, &[[9, 9, 9, 130]; 16])));
        for (name, bytes) in files {
            for keep in (0..16).map(|k| bytes.len() * k / 16).chain([bytes.len() / 2 + 1]) {
                let (image, warnings) = decoded(&bytes[..keep], Use::Color);
                assert!(image.is_err() || !warnings.is_empty(), "{name} cut to {keep} of {}", bytes.len());
            }
        }
        assert!(error(b"").contains("is empty"));
        let unknown = decoded(b"hello, this is text", Use::Color).0.expect_err("no image");
        assert_eq!(unknown.problems[0].code, "image-format-unknown");
        assert!(error(b"hello, this is text").contains("PNG, JPEG"));
        assert!(error(b"GIF89a......").contains("can't be read as an image"));
    }

    #[test]
    fn implausible_sizes_are_rejected() {
        let mut png = encode(rgb(), ImageFormat::Png);
        png[16..20].copy_from_slice(&32_768u32.to_be_bytes());
        png[20..24].copy_from_slice(&32_768u32.to_be_bytes());
        let crc = crc32(&png[12..29]);
        png[29..33].copy_from_slice(&crc.to_be_bytes());
        assert!(error(&png).contains("32768 x 32768"), "{}", error(&png));
        assert!(error(&hdr(32_768, 32_768, &[])).contains("32768 x 32768"));
        let mut bmp = encode(rgb(), ImageFormat::Bmp);
        bmp[18..22].copy_from_slice(&32_768u32.to_le_bytes());
        bmp[22..26].copy_from_slice(&32_767u32.to_le_bytes());
        assert!(error(&bmp).contains("declares"), "{}", error(&bmp));
        let mut wide = exr(4, 2, |_, _| (1.0, 1.0, 1.0, 1.0));
        let window = b"dataWindow\0box2i\0";
        let at =
            wide.windows(window.len()).position(|w| w == window).expect("a data window") + window.len() + 4;
        wide[at + 8..at + 16].copy_from_slice(&[0xff, 0x7f, 0, 0, 0xff, 0x7f, 0, 0]);
        assert!(error(&wide).contains("32768 x 32768"), "{}", error(&wide));
    }

    /// The checksum of PNG chunks, bit by bit (PNG specification, annex D).
    fn crc32(bytes: &[u8]) -> u32 {
        let step = |c: u32| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
        let fold = |c: u32, &b: &u8| (0..8).fold(c ^ u32::from(b), |c, _| step(c));
        !bytes.iter().fold(!0, fold)
    }

    #[test]
    fn load_linear_rgb_keeps_all_values() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).expect("written");
            path
        };
        let path = file("a.exr", &exr(2, 1, |x, _| (f32::NAN, -1.0, x as f32, 0.5)));
        let image = load_linear_rgb(&path).expect("it can be read");
        let Pixels::F32(numbers) = &*image.pixels else { panic!("not floats") };
        assert!(numbers[0].is_nan() && numbers[1] == -1.0 && numbers[5] == 1.0 && image.channels == 3);
        assert!(load_linear_rgb(&file("b.hdr", &hdr(1, 1, &[[128, 128, 128, 129]]))).is_ok());
        let refused =
            load_linear_rgb(&file("c.png", &encode(rgb(), ImageFormat::Png))).expect_err("not linear");
        assert!(refused.problems[0].code == "image-not-linear");
        let missing = load_linear_rgb(&folder.path().join("none.exr")).expect_err("missing");
        assert!(missing.file.is_some_and(|file| file.ends_with("none.exr")));
    }
}
