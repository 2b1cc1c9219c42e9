//! The binary container (GLB) and the JSON text in it or by itself.

use crate::error::{Error, Result};
use serde_json::Value;
use std::path::Path;

/// First four bytes of a GLB file.
const MAGIC: &[u8] = b"glTF";
/// Bytes of the file's header and of a chunk's.
const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;
const JSON_CHUNK: u32 = 0x4e4f_534a;
const BINARY_CHUNK: u32 = 0x004e_4942;

/// The parts of a glTF file.
pub(super) struct Parts<'a> {
    /// The JSON document, an object.
    pub json: Value,
    /// The binary chunk of a GLB.
    pub binary: Option<&'a [u8]>,
}

/// Takes a `.gltf` or `.glb` apart, told apart by content.
///
/// # Errors
/// An input error if the container or its JSON is broken.
pub(super) fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<Parts<'a>> {
    if bytes.is_empty() {
        return Err(Error::input(path, "is empty"));
    }
    let (text, binary) = if bytes.starts_with(MAGIC) { chunks(path, bytes)? } else { (bytes, None) };
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let json: Value = serde_json::from_slice(text)
        .map_err(|e| Error::input(path, format!("is not a glTF file: its JSON can't be read: {e}")))?;
    if !json.is_object() {
        return Err(Error::input(path, "is not a glTF file: its JSON is not an object"));
    }
    Ok(Parts { json, binary })
}

/// The JSON chunk and the binary chunk of a GLB (glTF 2.0, section 4.4). Unknown chunks are skipped, as it demands.
fn chunks<'a>(path: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let fail = |message: String| Err(Error::input(path, format!("is a broken GLB: {message}")));
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return fail(format!("it ends after {} bytes, inside its header", bytes.len()));
    };
    if version != 2 {
        return Err(Error::input(path, format!("is a GLB of version {version}"))
            .with_help("only glTF 2.0 is read; convert the file"));
    }
    let length = length as usize;
    if length > bytes.len() {
        return fail(format!(
            "its header promises {length} bytes, but there are {}: it was cut off",
            bytes.len()
        ));
    }
    let (mut json, mut binary, mut at, mut number) = (None, None, HEADER, 0);
    while at < length {
        let (Some(size), Some(kind)) = (word(bytes, at), word(bytes, at + 4)) else {
            return fail(format!("chunk {number} ends inside its header"));
        };
        let start = at + CHUNK_HEADER;
        let Some(end) = start.checked_add(size as usize).filter(|&end| end <= length) else {
            return fail(format!(
                "chunk {number} promises {size} bytes, but {} are left",
                length.saturating_sub(start)
            ));
        };
        let chunk = &bytes[start..end];
        match (number, kind) {
            (0, JSON_CHUNK) => json = Some(chunk),
            (0, _) => return fail(format!("its first chunk has the type {kind:#010x}, not JSON")),
            (1, BINARY_CHUNK) => binary = Some(chunk),
            (_, JSON_CHUNK | BINARY_CHUNK) => {
                return fail(format!("chunk {number} is a JSON or BIN chunk out of place"));
            }
            _ => {}
        }
        (at, number) = (end, number + 1);
    }
    match json {
        Some(json) => Ok((json, binary)),
        None => fail("it has no chunks".to_string()),
    }
}

/// The little-endian word at a place.
fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at.checked_add(4)?)?.try_into().ok().map(u32::from_le_bytes)
}
