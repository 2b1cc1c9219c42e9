//! From a file to its bytes, and from them to what they hold.

use super::source::Source;
use crate::error::{Error, Result};
use crate::load::guard;
use image::ImageFormat;
use std::path::Path;

/// Decoders return errors for damaged files; should one panic all the same, that is an error, too.
pub(super) fn guarded<T>(source: &Source, decode: impl FnOnce() -> Result<T>) -> Result<T> {
    let broken = |message| source.error(format!("can't be read as an image: {message}"));
    guard::catch(decode).map_err(broken)?
}

/// A file's bytes.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))
}

/// The format that the first bytes tell.
pub(super) fn signature(bytes: &[u8]) -> Option<ImageFormat> {
    if bytes.starts_with(b"#?") { Some(ImageFormat::Hdr) } else { image::guess_format(bytes).ok() }
}
