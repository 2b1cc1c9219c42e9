//! How large an image may be, judged by the file that claims it.

use super::source::Source;
use crate::error::Result;
use image::Limits;

/// Pixels that any file may claim: some codecs store a uniform picture of any size in a few bytes.
const ALWAYS: u64 = 1 << 24;
/// Pixels that a byte can stand for: deflate packs at most 1032 bytes into one, and a byte holds 8 bilevel pixels.
const PER_BYTE: u64 = 1032 * 8;
/// Most pixels of an image, whatever its file: 32,768 x 16,384.
const MOST: u64 = 1 << 29;

/// Most pixels that a file of this length can justify.
pub(super) fn pixels(file_length: usize) -> u64 {
    (file_length as u64).saturating_mul(PER_BYTE).clamp(ALWAYS, MOST)
}

/// Refuses sizes of zero and beyond what the file's length can justify.
pub(super) fn check(source: &Source, width: u64, height: u64) -> Result<()> {
    let most = pixels(source.bytes.len());
    match width.checked_mul(height) {
        Some(0) => Err(source.error("has no pixels")),
        Some(n) if n <= most && width.max(height) <= u64::from(u32::MAX) => Ok(()),
        _ => {
            let bytes = source.bytes.len();
            let claim = format!("claims {width} x {height} pixels in {bytes} bytes; at most {most} pixels");
            Err(source.error(format!("{claim} are accepted for a file of that length")))
        }
    }
}

/// The same limit for the buffers that decoders allocate: 16 bytes a pixel.
pub(super) fn for_decoder(source: &Source) -> Limits {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(pixels(source.bytes.len()) * 16);
    limits
}
