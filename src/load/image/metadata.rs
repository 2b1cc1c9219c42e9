//! Metadata of image files: orientation, colour profile, and warnings about ignored features such as further frames.
//!
//! Textures ignore orientation and colour profile, as glTF requires (2.0, section 3.8.2: embedded ICC profiles, gamma and
//! animation "MUST be ignored", and JPEG is JFIF, which has no orientation); texture coordinates of other formats were also
//! made by programs that ignore them. Environments and backgrounds are photographs: both are applied.
//!
//! Formats: ISO 10918-1 (JPEG), PNG third edition, RFC 9649 (WebP), TIFF 6.0 and BigTIFF, ICC.1:2022. Supported profiles are
//! three primaries with tone curves (cameras, phones, displays) or one curve for grey; tables (`A2B0`, printers) are not.

use super::source::{Source, Use, big_endian};
use crate::color::converted;
use image::codecs::png::PngDecoder;
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, Rgb32FImage, Rgba32FImage};
use moxcms::{ColorProfile, DataColorSpace, ToneCurveEvaluator, ToneReprCurve};
use std::borrow::Cow;
use std::io::Cursor;

/// Metadata in the header of an image file.
#[derive(Default)]
pub(super) struct Metadata<'a> {
    pub orientation: Option<Orientation>,
    profile: Option<Cow<'a, [u8]>>,
    /// Encoding gamma, for files without a profile.
    gamma: Option<f64>,
    /// Number of frames of an animation; 0 for still images.
    frames: usize,
    /// Number of images in the file, without reduced-resolution versions.
    pages: usize,
}

/// The metadata of an image file; empty for formats without.
pub(super) fn of(bytes: &[u8], format: ImageFormat) -> Metadata<'_> {
    match format {
        ImageFormat::Jpeg => of_jpeg(bytes),
        ImageFormat::Png => of_png(bytes),
        ImageFormat::WebP => of_webp(bytes),
        ImageFormat::Tiff => of_tiff(bytes).unwrap_or_default(),
        _ => Metadata::default(),
    }
}

/// Warnings about ignored metadata of an image file. Colour profiles are irrelevant for data and applied to photographs.
pub(super) fn messages(source: &Source, format: ImageFormat, purpose: Use) -> Vec<String> {
    let found = of(source.bytes, format);
    let mut messages = Vec::new();
    let is_ignored = |o: &Orientation| *o != Orientation::NoTransforms && !purpose.is_photograph();
    if let Some(orientation) = found.orientation.filter(is_ignored) {
        messages.push(format!("has the EXIF orientation {}, which is ignored", orientation.to_exif()));
    }
    if purpose != Use::Data {
        messages.extend(found.profile_message(purpose));
    }
    if found.frames > 1 {
        messages.push(format!("is an animation of {} frames: only the first is used", found.frames));
    }
    if found.pages > 1 {
        messages.push(format!("holds {} images: only the first is used", found.pages));
    }
    messages
}

impl Metadata<'_> {
    /// The warning about an ignored colour profile or gamma other than sRGB.
    fn profile_message(&self, purpose: Use) -> Option<String> {
        let Some(profile) = &self.profile else {
            // 1 / 2.2 means sRGB (PNG third edition, annex on gamma).
            let gamma = self.gamma.filter(|gamma| (gamma - 1.0 / 2.2).abs() > 0.01)?;
            return Some(format!("has the gamma {gamma:.3}, which is ignored"));
        };
        if is_srgb(profile) || purpose.is_photograph() && Profile::read(profile).is_some() {
            return None;
        }
        Some(match description(profile) {
            Some(name) => format!("has the colour profile '{name}', which is ignored"),
            None => "has a colour profile without a name, which is ignored".to_string(),
        })
    }

    /// The colour profile, if it isn't sRGB and is supported.
    pub fn color_profile(&self) -> Option<Profile> {
        self.profile.as_ref().filter(|profile| !is_srgb(profile)).and_then(|profile| Profile::read(profile))
    }
}

/// Whether a profile is sRGB, by its name.
fn is_srgb(profile: &[u8]) -> bool {
    description(profile).is_some_and(|name| name.to_ascii_lowercase().contains("srgb"))
}

fn of_jpeg(bytes: &[u8]) -> Metadata<'_> {
    let (mut found, mut at) = (Metadata::default(), 2);
    while let Some(&[0xff, marker]) = bytes.get(at..at + 2) {
        at += match marker {
            0xff => 1,
            // Start of scan, or end of image.
            0xda | 0xd9 => break,
            0x01 | 0xd0..=0xd7 => 2,
            _ => {
                let Some(length) = big_endian(bytes, at + 2, 2) else { break };
                let segment = bytes.get(at + 4..at + 2 + length).unwrap_or_default();
                if let Some(exif) = segment.strip_prefix(b"Exif\0\0").filter(|_| marker == 0xe1) {
                    found.orientation = Orientation::from_exif_chunk(exif);
                }
                // Long profiles are split into segments numbered from 1.
                let part = segment.strip_prefix(b"ICC_PROFILE\0").filter(|_| marker == 0xe2);
                if let Some([number, _, part @ ..]) = part {
                    match &mut found.profile {
                        Some(profile) if *number > 1 => profile.to_mut().extend(part),
                        _ => found.profile = Some(part.into()),
                    }
                }
                2 + length.max(2)
            }
        };
    }
    found
}

fn of_png(bytes: &[u8]) -> Metadata<'_> {
    let (mut found, mut at, mut is_srgb) = (Metadata::default(), 8, false);
    while let (Some(length), Some(kind)) = (big_endian(bytes, at, 4), bytes.get(at + 4..at + 8)) {
        let data = bytes.get(at + 8..at + 8 + length).unwrap_or_default();
        match kind {
            b"IDAT" | b"IEND" => break,
            b"sRGB" => is_srgb = true,
            b"gAMA" => found.gamma = big_endian(data, 0, 4).map(|gamma| gamma as f64 / 100_000.0),
            b"acTL" => found.frames = big_endian(data, 0, 4).unwrap_or(0),
            b"eXIf" => found.orientation = Orientation::from_exif_chunk(data),
            b"iCCP" => {
                let decoder = PngDecoder::new(Cursor::new(bytes));
                let profile = decoder.ok().and_then(|mut d| d.icc_profile().ok().flatten());
                found.profile = profile.map(Cow::from);
            }
            _ => {}
        }
        at += 12 + length;
    }
    if is_srgb {
        (found.gamma, found.profile) = (None, None);
    }
    found
}

fn of_webp(bytes: &[u8]) -> Metadata<'_> {
    let (mut found, mut at) = (Metadata::default(), 12);
    while let (Some(kind), Some(length)) = (bytes.get(at..at + 4), little_endian(bytes, at + 4, 4)) {
        let data = bytes.get(at + 8..at + 8 + length).unwrap_or_default();
        match kind {
            b"ICCP" => found.profile = Some(data.into()),
            b"ANMF" => found.frames += 1,
            b"EXIF" => {
                let exif = data.strip_prefix(b"Exif\0\0").unwrap_or(data);
                found.orientation = Orientation::from_exif_chunk(exif);
            }
            _ => {}
        }
        at += 8 + length + length % 2;
    }
    found
}

/// `None` if a directory is outside the file.
fn of_tiff(bytes: &[u8]) -> Option<Metadata<'_>> {
    let number = if bytes.starts_with(b"II") { little_endian } else { big_endian };
    // Sizes of an offset, of the number of entries, and of an entry, bytes.
    let (offset, count, entry) = if number(bytes, 2, 2)? == 43 { (8, 8, 20) } else { (4, 2, 12) };
    let mut found = Metadata::default();
    let mut at = number(bytes, if offset == 8 { 8 } else { 4 }, offset)?;
    // Bounds the number of directories by the file size, also for cyclic chains.
    for index in 0..bytes.len() / (count + offset) {
        let entries = number(bytes, at, count)?;
        let mut is_reduced = false;
        for i in 0..entries.min(4096) {
            let field = at + count + i * entry;
            let value = field + entry - offset;
            match number(bytes, field, 2)? {
                // NewSubfileType.
                254 => is_reduced = number(bytes, value, 4)? & 1 == 1,
                274 if index == 0 => {
                    let exif = u8::try_from(number(bytes, value, 2)?).ok();
                    found.orientation = exif.and_then(Orientation::from_exif);
                }
                34675 if index == 0 => {
                    let (length, start) = (number(bytes, field + 4, offset)?, number(bytes, value, offset)?);
                    found.profile = bytes.get(start..start.checked_add(length)?).map(Cow::from);
                }
                _ => {}
            }
        }
        found.pages += usize::from(!is_reduced);
        at = number(bytes, at.checked_add(entries.checked_mul(entry)?)?.checked_add(count)?, offset)?;
        if at == 0 {
            break;
        }
    }
    Some(found)
}

/// The name of an ICC profile: its `desc` tag, as text (version 2) or in its first language (version 4).
fn description(profile: &[u8]) -> Option<String> {
    let tags = big_endian(profile, 128, 4)?.min(1024);
    let tag = (0..tags).map(|i| 132 + 12 * i).find(|at| profile.get(*at..at + 4) == Some(b"desc"))?;
    let data = profile.get(big_endian(profile, tag + 4, 4)?..)?;
    let text = match data.get(..4)? {
        b"desc" => {
            let length = big_endian(data, 8, 4)?.min(256);
            data.get(12..12 + length)?.iter().map(|&b| char::from(b)).collect::<String>()
        }
        b"mluc" => {
            let (length, start) = (big_endian(data, 20, 4)?.min(512), big_endian(data, 24, 4)?);
            let units = data.get(start..start.checked_add(length)?)?.chunks_exact(2);
            let units: Vec<u16> = units.map(|unit| u16::from_be_bytes([unit[0], unit[1]])).collect();
            String::from_utf16_lossy(&units)
        }
        _ => return None,
    };
    let text: String = text.chars().filter(|c| !c.is_control()).collect();
    Some(text.trim().to_string()).filter(|text| !text.is_empty())
}

/// A little-endian number of `length` bytes.
fn little_endian(bytes: &[u8], at: usize, length: usize) -> Option<usize> {
    let digits = bytes.get(at..at.checked_add(length)?)?;
    usize::try_from(digits.iter().rfold(0u64, |n, &b| n << 8 | u64::from(b))).ok()
}

/// XYZ of the profile connection space (white D50) to linear Rec. 709 (white D65), with Bradford adaptation (ICC.1:2022,
/// annex E).
const REC709_FROM_PCS: [[f64; 3]; 3] = [
    [3.133_856_1, -1.616_866_7, -0.490_614_6],
    [-0.978_768_4, 1.916_141_5, 0.033_454_0],
    [0.071_945_3, -0.228_991_4, 1.405_242_7],
];

/// Applies an EXIF orientation.
pub(super) fn oriented(mut picture: DynamicImage, orientation: Option<Orientation>) -> DynamicImage {
    picture.apply_orientation(orientation.unwrap_or(Orientation::NoTransforms));
    picture
}

/// Conversion of stored colours to linear Rec. 709.
pub(super) struct Profile {
    /// Tone curve of each channel; three equal ones for grey.
    curves: [Box<dyn ToneCurveEvaluator + Send + Sync>; 3],
    rec709_from_device: [[f64; 3]; 3],
    is_grey: bool,
}

impl Profile {
    /// Parses a profile; `None` for unsupported and damaged ones.
    pub fn read(bytes: &[u8]) -> Option<Profile> {
        let profile = ColorProfile::new_from_slice(bytes).ok()?;
        let curve = |of: &Option<ToneReprCurve>| of.as_ref()?.make_linear_evaluator().ok();
        match profile.color_space {
            DataColorSpace::Gray => {
                let curve = || curve(&profile.gray_trc);
                let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
                Some(Profile {
                    curves: [curve()?, curve()?, curve()?],
                    rec709_from_device: identity,
                    is_grey: true,
                })
            }
            DataColorSpace::Rgb if profile.colorant_matrix().determinant()? != 0.0 => {
                let columns = profile.colorant_matrix().v;
                let product =
                    |row: usize, c: usize| (0..3).map(|k| REC709_FROM_PCS[row][k] * columns[k][c]).sum();
                Some(Profile {
                    curves: [curve(&profile.red_trc)?, curve(&profile.green_trc)?, curve(&profile.blue_trc)?],
                    rec709_from_device: std::array::from_fn(|row| std::array::from_fn(|c| product(row, c))),
                    is_grey: false,
                })
            }
            _ => None,
        }
    }

    /// Converts a picture to linear Rec. 709, clamping negative values to 0; `None` for floats and if only one of profile and
    /// picture is grey.
    pub fn apply(&self, picture: &DynamicImage) -> Option<DynamicImage> {
        let color = picture.color();
        if color.has_color() == self.is_grey || matches!(color, ColorType::Rgb32F | ColorType::Rgba32F) {
            return None;
        }
        // Tables are faster: integers have few distinct values.
        let levels = if color.bytes_per_pixel() / color.channel_count() == 1 { 256 } else { 65_536 };
        let tables = self.curves.each_ref().map(|curve| {
            let linear = |level: usize| {
                let y = curve.evaluate_value(level as f32 / (levels - 1) as f32);
                if y.is_finite() { y.clamp(0.0, 1.0) } else { 0.0 }
            };
            (0..levels).map(linear).collect::<Vec<f32>>()
        });
        let pixel = |rgb: [f32; 3]| {
            let level = |c: usize| tables[c][(rgb[c] * (levels - 1) as f32).round() as usize];
            converted(&self.rec709_from_device, [level(0), level(1), level(2)]).map(|v| v.max(0.0))
        };
        Some(if color.has_alpha() {
            let mut linear: Rgba32FImage = picture.to_rgba32f();
            linear.pixels_mut().for_each(|p| {
                let [r, g, b, _] = p.0;
                p.0[..3].copy_from_slice(&pixel([r, g, b]));
            });
            DynamicImage::ImageRgba32F(linear)
        } else {
            let mut linear: Rgb32FImage = picture.to_rgb32f();
            linear.pixels_mut().for_each(|p| p.0 = pixel(p.0));
            DynamicImage::ImageRgb32F(linear)
        })
    }
}

#[cfg(test)]
pub(super) mod test_profiles {
    use super::*;
    use image::{GrayImage, RgbImage};

    /// Display P3 with the curve of sRGB.
    pub fn display_p3() -> Vec<u8> {
        ColorProfile::new_display_p3().encode().expect("its parts are known")
    }

    #[test]
    fn display_p3_is_converted_to_rec_709() {
        let profile = Profile::read(&display_p3()).expect("primaries and curves");
        let linear = |rgb: [u8; 3]| {
            let picture = DynamicImage::ImageRgb8(RgbImage::from_pixel(1, 1, image::Rgb(rgb)));
            profile.apply(&picture).expect("a picture in colour").into_rgb32f()[(0, 0)].0
        };
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3);
        assert!(near(linear([255; 3]), [1.0; 3]), "{:?}", linear([255; 3]));
        // 1.2249, -0.0420, -0.0197 by the primaries (SMPTE EG 432-1), clamped at 0.
        assert!(near(linear([255, 0, 0]), [1.2249, 0.0, 0.0]), "{:?}", linear([255, 0, 0]));
        assert!(near(linear([128; 3]), [0.2159; 3]), "{:?}", linear([128; 3]));
    }

    #[test]
    fn unsupported_profiles_are_rejected() {
        let grey = ColorProfile::new_gray_with_gamma(1.0).encode().expect("its parts are known");
        let grey = Profile::read(&grey).expect("a curve");
        let picture = DynamicImage::ImageLuma8(GrayImage::from_pixel(1, 1, image::Luma([51])));
        let linear = grey.apply(&picture).expect("grey").into_rgb32f()[(0, 0)].0;
        assert!(linear.iter().all(|v| (v - 0.2).abs() < 1e-6), "{linear:?}");
        assert!(grey.apply(&DynamicImage::new_rgb8(1, 1)).is_none());
        let profile = display_p3();
        let mut without_curves = ColorProfile::new_srgb();
        without_curves.red_trc = None;
        assert!(Profile::read(&without_curves.encode().expect("its parts are known")).is_none());
        for length in 0..profile.len() {
            let _ = Profile::read(&profile[..length]);
        }
    }

    #[test]
    fn exif_orientation_is_applied() {
        let picture = || {
            let mut picture = GrayImage::new(2, 1);
            picture[(0, 0)] = image::Luma([9]);
            DynamicImage::ImageLuma8(picture)
        };
        let upright = oriented(picture(), Some(Orientation::Rotate90)).into_luma8();
        assert_eq!((upright.dimensions(), upright[(0, 0)].0), ((1, 2), [9]));
        assert_eq!(oriented(picture(), None).into_luma8().dimensions(), (2, 1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::jpeg::JpegEncoder;
    use image::codecs::png::PngEncoder;
    use image::{DynamicImage, ExtendedColorType, ImageEncoder};
    use std::path::Path;

    /// Value for length fields: 512 MiB.
    const HUGE: u32 = 1 << 29;

    fn messages_of(bytes: &[u8], format: ImageFormat, purpose: Use) -> Vec<String> {
        messages(&Source::new(bytes, (Path::new("picture"), ""), None), format, purpose)
    }

    /// An ICC profile with nothing but a name.
    fn profile(name: &str) -> Vec<u8> {
        let mut bytes = vec![0; 128];
        bytes.extend(1u32.to_be_bytes());
        bytes.extend(b"desc");
        bytes.extend(144u32.to_be_bytes());
        bytes.extend(100u32.to_be_bytes());
        bytes.extend(b"desc\0\0\0\0");
        bytes.extend((name.len() as u32 + 1).to_be_bytes());
        bytes.extend(name.as_bytes());
        bytes.push(0);
        bytes
    }

    /// An ICC profile of version 4 with nothing but a name.
    fn profile_v4(name: &str) -> Vec<u8> {
        let mut bytes = profile("")[..144].to_vec();
        let units: Vec<u8> = name.encode_utf16().flat_map(u16::to_be_bytes).collect();
        bytes.extend(b"mluc\0\0\0\0");
        for number in [1, 12] {
            bytes.extend(u32::to_be_bytes(number));
        }
        bytes.extend(b"enUS");
        bytes.extend((units.len() as u32).to_be_bytes());
        bytes.extend(28u32.to_be_bytes());
        bytes.extend(units);
        bytes
    }

    /// A big-endian Exif block with nothing but the orientation.
    fn exif(orientation: u8) -> Vec<u8> {
        let mut bytes = b"MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".to_vec();
        bytes.extend([orientation, 0, 0, 0, 0, 0, 0]);
        bytes
    }

    fn jpeg(profile: Vec<u8>, exif: Vec<u8>) -> Vec<u8> {
        let mut out = Vec::new();
        let mut encoder = JpegEncoder::new(&mut out);
        encoder.set_icc_profile(profile).expect("room for a profile");
        encoder.set_exif_metadata(exif).expect("room for Exif");
        encoder.write_image(&[9; 12], 2, 2, ExtendedColorType::Rgb8).expect("encoded");
        out
    }

    /// A PNG with chunks after its header.
    fn png(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut out = Vec::new();
        PngEncoder::new(&mut out).write_image(&[9; 12], 2, 2, ExtendedColorType::Rgb8).expect("encoded");
        let rest = out.split_off(33);
        for (kind, data) in chunks {
            out.extend((data.len() as u32).to_be_bytes());
            out.extend(*kind);
            out.extend(*data);
            out.extend([0; 4]);
        }
        out.extend(rest);
        out
    }

    fn webp(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut out = b"RIFF\0\0\0\0WEBP".to_vec();
        for (kind, data) in chunks {
            out.extend(*kind);
            out.extend((data.len() as u32).to_le_bytes());
            out.extend(*data);
            out.resize(out.len().next_multiple_of(2), 0);
        }
        out
    }

    /// A TIFF of directories with entries of one number each.
    fn tiff(directories: &[&[(u16, u16)]]) -> Vec<u8> {
        let mut out = b"II*\0\x08\0\0\0".to_vec();
        for (i, entries) in directories.iter().enumerate() {
            out.extend((entries.len() as u16).to_le_bytes());
            for (tag, value) in *entries {
                out.extend(tag.to_le_bytes());
                out.extend([3, 0, 1, 0, 0, 0]);
                out.extend(u32::from(*value).to_le_bytes());
            }
            let next = if i + 1 == directories.len() { 0 } else { out.len() as u32 + 4 };
            out.extend(next.to_le_bytes());
        }
        out
    }

    #[test]
    fn ignored_orientation_is_reported() {
        let expected = ["has the EXIF orientation 6, which is ignored"];
        let check =
            |bytes: &[u8], format| assert_eq!(messages_of(bytes, format, Use::Data), expected, "{format:?}");
        check(&jpeg(Vec::new(), exif(6)), ImageFormat::Jpeg);
        check(&png(&[(b"eXIf", &exif(6))]), ImageFormat::Png);
        check(&webp(&[(b"EXIF", &exif(6))]), ImageFormat::WebP);
        check(&tiff(&[&[(256, 2), (274, 6)]]), ImageFormat::Tiff);
        assert!(messages_of(&jpeg(Vec::new(), exif(1)), ImageFormat::Jpeg, Use::Color).is_empty());
    }

    #[test]
    fn ignored_colour_profiles_are_reported() {
        let wide = "has the colour profile 'Adobe RGB (1998)', which is ignored";
        for (profile, expected) in [
            (profile("Adobe RGB (1998)"), Some(wide)),
            (profile_v4("Adobe RGB (1998)"), Some(wide)),
            (profile("sRGB IEC61966-2.1"), None),
            (profile_v4("sRGB built-in"), None),
            (vec![1; 300], Some("has a colour profile without a name, which is ignored")),
        ] {
            let expected: Vec<&str> = expected.into_iter().collect();
            let bytes = jpeg(profile.clone(), Vec::new());
            assert_eq!(messages_of(&bytes, ImageFormat::Jpeg, Use::Color), expected);
            assert!(messages_of(&bytes, ImageFormat::Jpeg, Use::Data).is_empty());
            assert_eq!(messages_of(&webp(&[(b"ICCP", &profile)]), ImageFormat::WebP, Use::Color), expected);
            let mut png = Vec::new();
            let mut encoder = PngEncoder::new(&mut png);
            encoder.set_icc_profile(profile).expect("room for a profile");
            encoder.write_image(&[9; 12], 2, 2, ExtendedColorType::Rgb8).expect("encoded");
            assert_eq!(messages_of(&png, ImageFormat::Png, Use::Color), expected);
        }
        let gamma =
            |value: u32| messages_of(&png(&[(b"gAMA", &value.to_be_bytes())]), ImageFormat::Png, Use::Color);
        assert!(gamma(45_455).is_empty());
        assert_eq!(gamma(100_000), ["has the gamma 1.000, which is ignored"]);
    }

    #[test]
    fn frames_and_pages_are_counted() {
        let frames = "is an animation of 3 frames: only the first is used";
        let animated = png(&[(b"acTL", &[0, 0, 0, 3, 0, 0, 0, 0])]);
        assert_eq!(messages_of(&animated, ImageFormat::Png, Use::Color), [frames]);
        let animated =
            webp(&[(b"ANIM", &[0; 6]), (b"ANMF", &[0; 3]), (b"ANMF", &[0; 4]), (b"ANMF", &[0; 1])]);
        assert_eq!(messages_of(&animated, ImageFormat::WebP, Use::Data), [frames]);
        // The second image is a reduced-resolution version of the first.
        let pages = tiff(&[&[(256, 2)], &[(254, 1)], &[(254, 0)]]);
        assert_eq!(
            messages_of(&pages, ImageFormat::Tiff, Use::Data),
            ["holds 2 images: only the first is used"]
        );
        assert!(messages_of(&tiff(&[&[(256, 2)]]), ImageFormat::Tiff, Use::Data).is_empty());
    }

    /// Truncated files, wrong lengths and cyclic chains.
    #[test]
    fn damaged_files_never_panic() {
        let samples = [
            (jpeg(profile_v4("wide"), exif(3)), ImageFormat::Jpeg),
            (png(&[(b"eXIf", &exif(3)), (b"acTL", &[0, 0])]), ImageFormat::Png),
            (webp(&[(b"EXIF", &exif(3)), (b"ICCP", &profile("wide"))]), ImageFormat::WebP),
            (tiff(&[&[(274, 3), (34675, 40)], &[(254, 1)]]), ImageFormat::Tiff),
        ];
        for (bytes, format) in samples {
            for at in 0..bytes.len() {
                messages_of(&bytes[..at], format, Use::Color);
                for number in [0, 1, HUGE, u32::MAX] {
                    let mut broken = bytes.clone();
                    broken.splice(at..(at + 4).min(bytes.len()), number.to_be_bytes());
                    messages_of(&broken, format, Use::Color);
                }
            }
        }
        let mut circle = tiff(&[&[(256, 2)]]);
        let end = circle.len();
        circle[end - 4..].copy_from_slice(&8u32.to_le_bytes());
        assert!(messages_of(&circle, ImageFormat::Tiff, Use::Data).len() <= 1);
        // Valid files cause no warnings.
        let mut plain = Cursor::new(Vec::new());
        DynamicImage::new_rgb8(2, 2).write_to(&mut plain, ImageFormat::Png).expect("encoded");
        assert!(messages_of(plain.get_ref(), ImageFormat::Png, Use::Color).is_empty());
    }

    #[test]
    fn reading_a_file_returns_metadata_warnings() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("turned.jpg");
        std::fs::write(&path, jpeg(profile("Adobe RGB (1998)"), exif(8))).expect("written");
        let mut warnings = Vec::new();
        crate::load::image::read(&path, Use::Color, None, &mut warnings).expect("it can be read");
        let messages: Vec<String> = warnings.iter().map(ToString::to_string).collect();
        assert!(
            messages.len() == 2 && messages.iter().all(|text| text.contains("turned.jpg: ")),
            "{messages:?}"
        );
    }
}
