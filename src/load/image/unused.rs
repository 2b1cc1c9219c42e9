//! What an image file says about its pixels that they are taken without: how to turn them, a colour profile; and further
//! frames and pages.
//!
//! Pixels are taken as they are stored. glTF demands it (2.0, section 3.8.2: embedded ICC profiles, gamma and animation "MUST
//! be ignored", and JPEG is JFIF, which knows no orientation), and the texture coordinates of OBJ files and scene files were
//! made by programs that do the same. Applying an orientation in some formats only would turn the same picture differently
//! on the same mesh. Layouts: ISO 10918-1 (JPEG), PNG third edition, RFC 9649 (WebP), TIFF 6.0 and BigTIFF, ICC.1:2022.

use super::source::{Source, Use};
use image::codecs::png::PngDecoder;
use image::metadata::Orientation;
use image::{ImageDecoder, ImageFormat};
use std::borrow::Cow;
use std::io::Cursor;

/// What stands before the pixels of a file.
#[derive(Default)]
struct Unused<'a> {
    orientation: Option<Orientation>,
    profile: Option<Cow<'a, [u8]>>,
    /// Exponent that encoded the colours, where no profile says more.
    gamma: Option<f64>,
    /// Frames of an animation; 0 for a still picture.
    frames: usize,
    /// Pictures in the file, smaller versions of one left out.
    pages: usize,
}

/// What is not used of an image file, in words. Colour profiles mean nothing for data.
pub(super) fn messages(source: &Source, format: ImageFormat, purpose: Use) -> Vec<String> {
    let bytes = source.bytes;
    let found = match format {
        ImageFormat::Jpeg => of_jpeg(bytes),
        ImageFormat::Png => of_png(bytes),
        ImageFormat::WebP => of_webp(bytes),
        ImageFormat::Tiff => of_tiff(bytes).unwrap_or_default(),
        _ => return Vec::new(),
    };
    let mut messages = Vec::new();
    if let Some(orientation) = found.orientation.filter(|o| *o != Orientation::NoTransforms) {
        let number = orientation.to_exif();
        messages
            .push(format!("asks to be turned (EXIF orientation {number}); its pixels are taken as stored"));
    }
    if purpose != Use::Data {
        messages.extend(profile_message(&found));
    }
    if found.frames > 1 {
        messages.push(format!("is an animation of {} frames, of which only the first is used", found.frames));
    }
    if found.pages > 1 {
        messages.push(format!("holds {} pictures, of which only the first is used", found.pages));
    }
    messages
}

/// Colours are taken as sRGB: says so where a file means others.
fn profile_message(found: &Unused) -> Option<String> {
    let Some(profile) = &found.profile else {
        // 1 / 2.2 stands for sRGB (PNG third edition, annex on gamma).
        let gamma = found.gamma.filter(|gamma| (gamma - 1.0 / 2.2).abs() > 0.01)?;
        return Some(format!("says that its colours have gamma {gamma:.3}, which is ignored"));
    };
    match description(profile) {
        Some(name) if name.to_ascii_lowercase().contains("srgb") => None,
        Some(name) => Some(format!("has the colour profile '{name}', which is ignored")),
        None => Some("has a colour profile without a name, which is ignored".to_string()),
    }
}

fn of_jpeg(bytes: &[u8]) -> Unused<'_> {
    let (mut found, mut at) = (Unused::default(), 2);
    while let Some(&[0xff, marker]) = bytes.get(at..at + 2) {
        at += match marker {
            0xff => 1,
            // Scans begin; or the end.
            0xda | 0xd9 => break,
            0x01 | 0xd0..=0xd7 => 2,
            _ => {
                let Some(length) = be(bytes, at + 2, 2) else { break };
                let segment = bytes.get(at + 4..at + 2 + length).unwrap_or_default();
                if let Some(exif) = segment.strip_prefix(b"Exif\0\0").filter(|_| marker == 0xe1) {
                    found.orientation = Orientation::from_exif_chunk(exif);
                }
                // A long profile goes on in further segments; its name is in the first.
                let profile = segment.strip_prefix(b"ICC_PROFILE\0\x01").filter(|_| marker == 0xe2);
                if let Some(profile) = profile.and_then(|p| p.get(1..)) {
                    found.profile = Some(profile.into());
                }
                2 + length.max(2)
            }
        };
    }
    found
}

fn of_png(bytes: &[u8]) -> Unused<'_> {
    let (mut found, mut at, mut is_srgb) = (Unused::default(), 8, false);
    while let (Some(length), Some(kind)) = (be(bytes, at, 4), bytes.get(at + 4..at + 8)) {
        let data = bytes.get(at + 8..at + 8 + length).unwrap_or_default();
        match kind {
            b"IDAT" | b"IEND" => break,
            b"sRGB" => is_srgb = true,
            b"gAMA" => found.gamma = be(data, 0, 4).map(|gamma| gamma as f64 / 100_000.0),
            b"acTL" => found.frames = be(data, 0, 4).unwrap_or(0),
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

fn of_webp(bytes: &[u8]) -> Unused<'_> {
    let (mut found, mut at) = (Unused::default(), 12);
    while let (Some(kind), Some(length)) = (bytes.get(at..at + 4), le(bytes, at + 4, 4)) {
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

/// `None` where a directory lies outside the file.
fn of_tiff(bytes: &[u8]) -> Option<Unused<'_>> {
    let number = if bytes.starts_with(b"II") { le } else { be };
    // Bytes of an offset, of the number of entries, and of an entry.
    let (offset, count, entry) = if number(bytes, 2, 2)? == 43 { (8, 8, 20) } else { (4, 2, 12) };
    let mut found = Unused::default();
    let mut at = number(bytes, if offset == 8 { 8 } else { 4 }, offset)?;
    // Each directory takes room of its own, so that no more fit in; a chain that bites its tail ends here, too.
    for index in 0..bytes.len() / (count + offset) {
        let entries = number(bytes, at, count)?;
        let mut is_smaller_version = false;
        for i in 0..entries.min(4096) {
            let field = at + count + i * entry;
            let value = field + entry - offset;
            match number(bytes, field, 2)? {
                // NewSubfileType.
                254 => is_smaller_version = number(bytes, value, 4)? & 1 == 1,
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
        found.pages += usize::from(!is_smaller_version);
        at = number(bytes, at.checked_add(entries.checked_mul(entry)?)?.checked_add(count)?, offset)?;
        if at == 0 {
            break;
        }
    }
    Some(found)
}

/// The name of an ICC profile: its `desc` tag, as text (version 2) or in the first of its languages (version 4).
fn description(profile: &[u8]) -> Option<String> {
    let tags = be(profile, 128, 4)?.min(1024);
    let tag = (0..tags).map(|i| 132 + 12 * i).find(|at| profile.get(*at..at + 4) == Some(b"desc"))?;
    let data = profile.get(be(profile, tag + 4, 4)?..)?;
    let text = match data.get(..4)? {
        b"desc" => {
            let length = be(data, 8, 4)?.min(256);
            data.get(12..12 + length)?.iter().map(|&b| char::from(b)).collect::<String>()
        }
        b"mluc" => {
            let (length, start) = (be(data, 20, 4)?.min(512), be(data, 24, 4)?);
            let units = data.get(start..start.checked_add(length)?)?.chunks_exact(2);
            let units: Vec<u16> = units.map(|unit| u16::from_be_bytes([unit[0], unit[1]])).collect();
            String::from_utf16_lossy(&units)
        }
        _ => return None,
    };
    let text: String = text.chars().filter(|c| !c.is_control()).collect();
    Some(text.trim().to_string()).filter(|text| !text.is_empty())
}

/// A number of so many bytes, the most significant first.
fn be(bytes: &[u8], at: usize, length: usize) -> Option<usize> {
    let digits = bytes.get(at..at.checked_add(length)?)?;
    usize::try_from(digits.iter().fold(0u64, |n, &b| n << 8 | u64::from(b))).ok()
}

/// A number of so many bytes, the least significant first.
fn le(bytes: &[u8], at: usize, length: usize) -> Option<usize> {
    let digits = bytes.get(at..at.checked_add(length)?)?;
    usize::try_from(digits.iter().rfold(0u64, |n, &b| n << 8 | u64::from(b))).ok()
}

#[cfg(test)]
mod tests;
