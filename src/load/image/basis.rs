//! Basis Universal textures in KTX2 files (ETC1S, UASTC and their relatives), by `basisu`.

use super::source::Source;
use crate::error::Result;
use crate::image::Pixels;
use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
use half::f16;

/// Red, green, blue, and alpha if there is any, 8-bit or float: the number of channels and the pixels.
///
/// # Errors
/// An input error if the texture is broken or doesn't have that many pixels.
pub(super) fn transcode(source: &Source, pixels: u64) -> Result<(u32, Pixels)> {
    let transcode = || {
        let texture = Transcoder::new(source.bytes).map_err(|e| format!("{e:?}"))?;
        let is_hdr = matches!(
            texture.source_format(),
            SourceFormat::UastcHdr4x4 | SourceFormat::AstcHdr6x6 | SourceFormat::UastcHdr6x6
        );
        let target = if is_hdr { TargetFormat::RgbaHalf } else { TargetFormat::Rgba32 };
        let bytes =
            texture.transcode_image(0, 0, 0, target, DecodeFlags::NONE).map_err(|e| format!("{e:?}"))?;
        Ok((is_hdr, texture.has_alpha(), bytes))
    };
    let (is_hdr, has_alpha, bytes) = transcode()
        .map_err(|e: String| source.error(format!("can't be read as a Basis Universal texture: {e}")))?;
    let expected = pixels * if is_hdr { 8 } else { 4 };
    if bytes.len() as u64 != expected {
        let found = bytes.len();
        return Err(source.error(format!("holds {found} bytes of pixels in place of {expected}")));
    }
    let kept = if has_alpha { 4 } else { 3 };
    let pixels = if is_hdr {
        let halves = bytes.as_chunks::<8>().0.iter().flat_map(|pixel| {
            let channel = |c: usize| f16::from_le_bytes([pixel[2 * c], pixel[2 * c + 1]]).to_f32();
            (0..kept).map(channel)
        });
        Pixels::F32(halves.collect())
    } else if has_alpha {
        Pixels::U8(bytes)
    } else {
        Pixels::U8(bytes.as_chunks::<4>().0.iter().flat_map(|p| [p[0], p[1], p[2]]).collect())
    };
    Ok((kept as u32, pixels))
}
