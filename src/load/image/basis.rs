//! Basis Universal textures in KTX2 files (ETC1S, UASTC and their relatives), by `basisu`.

use super::source::Source;
use crate::error::Result;
use crate::image::Pixels;
#[cfg(feature = "ktx2")]
pub(super) use decoder::{channels, transcode};
#[cfg(not(feature = "ktx2"))]
pub(super) use without_decoder::{channels, transcode};

#[cfg(feature = "ktx2")]
mod decoder {
    use super::{Pixels, Result, Source};
    use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
    use half::f16;

    /// Channels of a texture of 8 bits: red, green, blue, and alpha if there is any; `None` where it holds floats.
    ///
    /// # Errors
    /// An input error if the texture is broken.
    pub fn channels(source: &Source) -> Result<Option<u32>> {
        let texture = Transcoder::new(source.bytes).map_err(|e| broken(source, format!("{e:?}")))?;
        Ok((!is_hdr(&texture)).then(|| kept_channels(&texture)))
    }

    /// Red, green, blue, and alpha if there is any, 8-bit or float: the number of channels and the pixels.
    ///
    /// # Errors
    /// An input error if the texture is broken or doesn't have that many pixels.
    pub fn transcode(source: &Source, pixels: u64) -> Result<(u32, Pixels)> {
        let texture = Transcoder::new(source.bytes).map_err(|e| broken(source, format!("{e:?}")))?;
        let (is_hdr, kept) = (is_hdr(&texture), kept_channels(&texture));
        let target = if is_hdr { TargetFormat::RgbaHalf } else { TargetFormat::Rgba32 };
        let bytes = texture.transcode_image(0, 0, 0, target, DecodeFlags::NONE);
        let bytes = bytes.map_err(|e| broken(source, format!("{e:?}")))?;
        let expected = pixels * if is_hdr { 8 } else { 4 };
        if bytes.len() as u64 != expected {
            let found = bytes.len();
            return Err(source.error(format!("holds {found} bytes of pixels in place of {expected}")));
        }
        let pixels = if is_hdr {
            let halves = bytes.as_chunks::<8>().0.iter().flat_map(|pixel| {
                let channel =
                    |c: u32| f16::from_le_bytes([pixel[2 * c as usize], pixel[2 * c as usize + 1]]).to_f32();
                (0..kept).map(channel)
            });
            Pixels::F32(halves.collect())
        } else if kept == 4 {
            Pixels::U8(bytes)
        } else {
            Pixels::U8(bytes.as_chunks::<4>().0.iter().flat_map(|p| [p[0], p[1], p[2]]).collect())
        };
        Ok((kept, pixels))
    }

    fn is_hdr(texture: &Transcoder) -> bool {
        let format = texture.source_format();
        matches!(format, SourceFormat::UastcHdr4x4 | SourceFormat::AstcHdr6x6 | SourceFormat::UastcHdr6x6)
    }

    fn kept_channels(texture: &Transcoder) -> u32 {
        if texture.has_alpha() { 4 } else { 3 }
    }

    fn broken(source: &Source, error: String) -> crate::error::Error {
        source.error(format!("can't be read as a Basis Universal texture: {error}"))
    }
}

#[cfg(not(feature = "ktx2"))]
mod without_decoder {
    use super::{Pixels, Result, Source};
    use crate::load::decoders::Decoder;

    pub fn channels(source: &Source) -> Result<Option<u32>> {
        Err(source.lacks(Decoder::Ktx2))
    }

    pub fn transcode(source: &Source, _: u64) -> Result<(u32, Pixels)> {
        Err(source.lacks(Decoder::Ktx2))
    }
}
