//! Each loss from bytes made here, whole and damaged.

use super::*;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{DynamicImage, ExtendedColorType, ImageEncoder};
use std::path::Path;

/// Half a gigabyte in a length field.
const HUGE: u32 = 1 << 29;

fn said(bytes: &[u8], format: ImageFormat, purpose: Use) -> Vec<String> {
    messages(&Source { bytes, file: Path::new("picture"), pointer: "" }, format, purpose)
}

/// An ICC profile of which only the name counts.
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

/// The same in two languages of version 4.
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

/// An Exif block in either order of bytes that says nothing but how to turn the picture.
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
fn orientation_is_not_lost_silently() {
    let expected = ["asks to be turned (EXIF orientation 6); its pixels are taken as stored"];
    let turned = |bytes: &[u8], format| assert_eq!(said(bytes, format, Use::Data), expected, "{format:?}");
    turned(&jpeg(Vec::new(), exif(6)), ImageFormat::Jpeg);
    turned(&png(&[(b"eXIf", &exif(6))]), ImageFormat::Png);
    turned(&webp(&[(b"EXIF", &exif(6))]), ImageFormat::WebP);
    turned(&tiff(&[&[(256, 2), (274, 6)]]), ImageFormat::Tiff);
    assert!(said(&jpeg(Vec::new(), exif(1)), ImageFormat::Jpeg, Use::Color).is_empty());
}

#[test]
fn colour_profiles_other_than_srgb_are_named() {
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
        assert_eq!(said(&bytes, ImageFormat::Jpeg, Use::Color), expected);
        assert!(said(&bytes, ImageFormat::Jpeg, Use::Data).is_empty());
        assert_eq!(said(&webp(&[(b"ICCP", &profile)]), ImageFormat::WebP, Use::Color), expected);
        let mut png = Vec::new();
        let mut encoder = PngEncoder::new(&mut png);
        encoder.set_icc_profile(profile).expect("room for a profile");
        encoder.write_image(&[9; 12], 2, 2, ExtendedColorType::Rgb8).expect("encoded");
        assert_eq!(said(&png, ImageFormat::Png, Use::Color), expected);
    }
    let gamma = |value: u32| said(&png(&[(b"gAMA", &value.to_be_bytes())]), ImageFormat::Png, Use::Color);
    assert!(gamma(45_455).is_empty());
    assert_eq!(gamma(100_000), ["says that its colours have gamma 1.000, which is ignored"]);
}

#[test]
fn frames_and_pages_are_counted() {
    let frames = "is an animation of 3 frames, of which only the first is used";
    let animated = png(&[(b"acTL", &[0, 0, 0, 3, 0, 0, 0, 0])]);
    assert_eq!(said(&animated, ImageFormat::Png, Use::Color), [frames]);
    let animated = webp(&[(b"ANIM", &[0; 6]), (b"ANMF", &[0; 3]), (b"ANMF", &[0; 4]), (b"ANMF", &[0; 1])]);
    assert_eq!(said(&animated, ImageFormat::WebP, Use::Data), [frames]);
    // The second picture is the first in small.
    let pages = tiff(&[&[(256, 2)], &[(254, 1)], &[(254, 0)]]);
    assert_eq!(
        said(&pages, ImageFormat::Tiff, Use::Data),
        ["holds 2 pictures, of which only the first is used"]
    );
    assert!(said(&tiff(&[&[(256, 2)]]), ImageFormat::Tiff, Use::Data).is_empty());
}

/// Files that end anywhere, whose lengths are beyond them, and whose chains go round in circles.
#[test]
fn damaged_files_do_no_harm() {
    let samples = [
        (jpeg(profile_v4("wide"), exif(3)), ImageFormat::Jpeg),
        (png(&[(b"eXIf", &exif(3)), (b"acTL", &[0, 0])]), ImageFormat::Png),
        (webp(&[(b"EXIF", &exif(3)), (b"ICCP", &profile("wide"))]), ImageFormat::WebP),
        (tiff(&[&[(274, 3), (34675, 40)], &[(254, 1)]]), ImageFormat::Tiff),
    ];
    for (bytes, format) in samples {
        for at in 0..bytes.len() {
            said(&bytes[..at], format, Use::Color);
            for number in [0, 1, HUGE, u32::MAX] {
                let mut broken = bytes.clone();
                broken.splice(at..(at + 4).min(bytes.len()), number.to_be_bytes());
                said(&broken, format, Use::Color);
            }
        }
    }
    let mut circle = tiff(&[&[(256, 2)]]);
    let end = circle.len();
    circle[end - 4..].copy_from_slice(&8u32.to_le_bytes());
    assert!(said(&circle, ImageFormat::Tiff, Use::Data).len() <= 1);
    // What encoders write has nothing to say.
    let mut plain = Cursor::new(Vec::new());
    DynamicImage::new_rgb8(2, 2).write_to(&mut plain, ImageFormat::Png).expect("encoded");
    assert!(said(plain.get_ref(), ImageFormat::Png, Use::Color).is_empty());
}

#[test]
fn files_that_are_read_say_it_as_a_warning() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("turned.jpg");
    std::fs::write(&path, jpeg(profile("Adobe RGB (1998)"), exif(8))).expect("written");
    let mut warnings = Vec::new();
    crate::load::image::read(&path, Use::Color, &mut warnings).expect("it can be read");
    let said: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    assert!(said.len() == 2 && said.iter().all(|text| text.contains("turned.jpg: ")), "{said:?}");
}
