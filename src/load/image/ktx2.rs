//! KTX2: Basis Universal textures (ETC1S, UASTC and variants, KHR_texture_basisu) by the crate `basisu`, and uncompressed
//! 8-bit pixels, also with Zstandard or ZLIB supercompression. Reads mip level 0 of the first layer and face.

use super::source;
use super::source::{Layout, Source, Use};
use crate::error::{Result, Warning};
use crate::image::{Encoding, Image, Pixels};
#[cfg(feature = "ktx2")]
pub(super) use decoder::{channels, transcode};
use std::sync::Arc;
#[cfg(not(feature = "ktx2"))]
pub(super) use without_decoder::{channels, transcode};

/// The first bytes of KTX2 files.
const IDENTIFIER: [u8; 12] = *b"\xabKTX 20\xbb\r\n\x1a\n";
/// Size of the header before the level index, bytes.
const HEADER: usize = 80;

/// Whether it is a KTX2 file.
pub(super) fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(&IDENTIFIER)
}

/// The header (KTX 2.0, sections 3.1 to 3.9).
struct Header {
    /// VkFormat; 0 for Basis Universal.
    format: u32,
    width: u32,
    height: u32,
    depth: u32,
    layers: u32,
    faces: u32,
    supercompression: u32,
    /// Mip level 0: offset, length, and length without supercompression, bytes.
    level: [u64; 3],
}

/// The layout of the image that [`decode`] returns; `None` for floats and damaged files.
///
/// # Errors
/// The errors of [`decode`] that concern the header.
pub(super) fn layout(source: &Source, warnings: &mut Vec<Warning>) -> Result<Option<Layout>> {
    let header = checked_header(source, warnings)?;
    let size = [header.width, header.height.max(1)];
    let plain = plain_channels(header.format);
    let channels = match plain {
        Some(channels) => Some(channels),
        None => channels(source)?,
    };
    // Truncated files are reported by decoding.
    let [offset, length, inflated] = header.level;
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    let min_size = match (plain, header.supercompression) {
        (Some(channels), _) => pixels * u64::from(channels),
        // The size of BasisLZ data is unknown; other formats have at least 16 bytes per 6 x 6 pixels.
        (None, BASIS_LZ) => 0,
        (None, _) => pixels * 16 / 36,
    };
    if offset.saturating_add(length) > source.bytes.len() as u64 || inflated < min_size {
        return Ok(None);
    }
    Ok(channels.map(|channels| Layout { size, channels, bits: 8, rows: None }))
}

/// Decodes mip level 0 of the first layer and face; warns of further layers and faces.
pub(super) fn decode(source: &Source, purpose: Use, warnings: &mut Vec<Warning>) -> Result<Image> {
    let header = checked_header(source, warnings)?;
    let (width, height) = (header.width, header.height.max(1));
    let (channels, pixels) = match plain_channels(header.format) {
        Some(channels) => (channels, plain(source, &header, channels)?),
        None => transcode(source, u64::from(width) * u64::from(height))?,
    };
    let is_linear = purpose == Use::Data || matches!(pixels, Pixels::F32(_));
    let encoding = if is_linear { Encoding::Linear } else { Encoding::Srgb };
    Ok(Image { name: source.name(), width, height, channels, encoding, pixels: Arc::new(pixels) })
}

/// The header, with validated sizes; warns of further layers and faces.
fn checked_header(source: &Source, warnings: &mut Vec<Warning>) -> Result<Header> {
    let header = Header::read(source.bytes)
        .ok_or_else(|| source.error("is a KTX2 file that ends within its header"))?;
    if header.depth > 0 {
        return Err(source.error("is a KTX2 file with a volume, not an image"));
    }
    // A height of 0 marks a one-dimensional texture.
    let (width, height) = (u64::from(header.width), u64::from(header.height.max(1)));
    source::check(source, width, height)?;
    let channels = plain_channels(header.format).map_or(4, u64::from);
    source::check_memory(source, width, height, width * height * channels)?;
    if header.level[2] > 16 * width * height + 4096 {
        return Err(source.error(format!("declares {} bytes for {width} x {height} pixels", header.level[2])));
    }
    // 0 layers: not an array texture.
    if header.layers > 1 || header.faces > 1 {
        let (layers, faces) = (header.layers.max(1), header.faces);
        warnings.push(
            source.warning(("image-list", format!("holds {layers} x {faces} images; the first is used"))),
        );
    }
    Ok(header)
}

impl Header {
    fn read(bytes: &[u8]) -> Option<Header> {
        let word = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
        let long = |at: usize| Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?));
        Some(Header {
            format: word(12)?,
            width: word(20)?,
            height: word(24)?,
            depth: word(28)?,
            layers: word(32)?,
            faces: word(36)?,
            supercompression: word(44)?,
            level: [long(HEADER)?, long(HEADER + 8)?, long(HEADER + 16)?],
        })
    }
}

/// Number of channels of uncompressed 8-bit formats, UNORM and SRGB: R, RGB and RGBA. RG is unsupported, as two channels
/// mean grey and alpha.
fn plain_channels(format: u32) -> Option<u32> {
    match format {
        9 | 15 => Some(1),
        23 | 29 => Some(3),
        37 | 43 => Some(4),
        _ => None,
    }
}

/// Uncompressed pixels, after undoing supercompression.
fn plain(source: &Source, header: &Header, channels: u32) -> Result<Pixels> {
    let [offset, length, _] = header.level;
    let size = u64::from(header.width) * u64::from(header.height.max(1)) * u64::from(channels);
    let range = usize::try_from(offset).ok().zip(usize::try_from(length).ok());
    let held = range.and_then(|(start, length)| source.bytes.get(start..start.checked_add(length)?));
    let missing = || source.error(format!("declares {size} bytes of pixels that are missing"));
    let (held, size) = (held.ok_or_else(missing)?, usize::try_from(size).map_err(|_| missing())?);
    let mut pixels = match header.supercompression {
        0 => held.to_vec(),
        ZSTANDARD => unzstd(source, held, size)?,
        ZLIB => miniz_oxide::inflate::decompress_to_vec_zlib_with_limit(held, size)
            .map_err(|e| source.error(format!("holds ZLIB data that can't be decompressed: {e}")))?,
        other => {
            return Err(source.error(format!(
                "is a KTX2 file of uncompressed pixels with the unknown supercompression {other}"
            )));
        }
    };
    if pixels.len() < size {
        return Err(missing());
    }
    pixels.truncate(size);
    Ok(Pixels::U8(pixels))
}

/// Schemes of supercompression (KTX 2.0, section 3.9).
const BASIS_LZ: u32 = 1;
const ZSTANDARD: u32 = 2;
const ZLIB: u32 = 3;

/// Decompresses Zstandard data, up to `size` bytes.
#[cfg(feature = "ktx2")]
fn unzstd(source: &Source, held: &[u8], size: usize) -> Result<Vec<u8>> {
    use std::io::Read;
    let broken = |e: String| source.error(format!("holds Zstandard data that can't be decompressed: {e}"));
    let decoder = ruzstd::StreamingDecoder::new(held).map_err(|e| broken(e.to_string()))?;
    let mut pixels = Vec::new();
    decoder.take(size as u64).read_to_end(&mut pixels).map_err(|e| broken(e.to_string()))?;
    Ok(pixels)
}

#[cfg(not(feature = "ktx2"))]
fn unzstd(source: &Source, _: &[u8], _: usize) -> Result<Vec<u8>> {
    Err(source.missing_decoder_error(crate::load::decoders::Decoder::Ktx2))
}

#[cfg(feature = "ktx2")]
mod decoder {
    use super::{Pixels, Result, Source};
    use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};
    use half::f16;

    /// Number of channels of an 8-bit texture: RGB or RGBA; `None` for floats.
    ///
    /// # Errors
    /// An input error if the texture is broken.
    pub fn channels(source: &Source) -> Result<Option<u32>> {
        let texture = Transcoder::new(source.bytes).map_err(|e| broken(source, format!("{e:?}")))?;
        Ok((!is_hdr(&texture)).then(|| kept_channels(&texture)))
    }

    /// Number of channels (RGB or RGBA) and pixels, 8-bit or float.
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
            return Err(source.error(format!("holds {found} bytes of pixels instead of {expected}")));
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
        Err(source.missing_decoder_error(Decoder::Ktx2))
    }

    pub fn transcode(source: &Source, _: u64) -> Result<(u32, Pixels)> {
        Err(source.missing_decoder_error(Decoder::Ktx2))
    }
}
