//! The binary container (GLB) and the JSON text in it or by itself.

use crate::error::{Error, Result};
use crate::load::words::is_utf_16;
use gltf::{Glb, binary};
use serde_json::Value;
use std::borrow::Cow;
use std::path::Path;

/// First four bytes of a GLB file.
const MAGIC: &[u8] = b"glTF";
/// Bytes of the file's header.
const HEADER: usize = 12;

/// The parts of a glTF file.
pub(super) struct Parts<'a> {
    /// The JSON document, an object.
    pub json: Value,
    /// The binary chunk of a GLB.
    pub binary: Option<Cow<'a, [u8]>>,
}

/// Takes a `.gltf` or `.glb` apart, told apart by content.
///
/// # Errors
/// An input error if the container or its JSON is broken.
pub(super) fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<Parts<'a>> {
    if bytes.is_empty() {
        return Err(Error::input(path, "is empty"));
    }
    let (text, binary) = if bytes.starts_with(MAGIC) { chunks(path, bytes)? } else { (bytes.into(), None) };
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&text);
    if is_utf_16(text) {
        return Err(Error::input(path, "is UTF-16 text").with_help("save the file as UTF-8"));
    }
    let json: Value = serde_json::from_slice(text)
        .map_err(|e| Error::input(path, format!("is not a glTF file: its JSON can't be read: {e}")))?;
    if !json.is_object() {
        return Err(Error::input(path, "is not a glTF file: its JSON is not an object"));
    }
    Ok(Parts { json, binary })
}

/// The JSON chunk and the binary chunk.
type Chunks<'a> = (Cow<'a, [u8]>, Option<Cow<'a, [u8]>>);

/// Takes a GLB apart (glTF 2.0, section 4.4). Chunks behind these two are skipped, as it demands; so is one of unknown type
/// in the second's place, which the crate refuses.
fn chunks<'a>(path: &Path, bytes: &'a [u8]) -> Result<Chunks<'a>> {
    let fail = |message: String| Error::input(path, format!("is a broken GLB: {message}"));
    // The crate subtracts its header's length from this without a look, and reads on behind the file's end by it.
    let length = bytes.get(8..HEADER).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let Some(length) = length.map(|length| length as usize) else {
        return Err(fail(format!("it ends after {} bytes, inside its header", bytes.len())));
    };
    if length > bytes.len() {
        let held = bytes.len();
        return Err(fail(format!(
            "its header promises {length} bytes, but there are {held}: it was cut off"
        )));
    }
    if length < HEADER {
        return Err(fail(format!("its header promises {length} bytes, fewer than its own")));
    }
    let file = &bytes[..length];
    let error = match Glb::from_slice(file) {
        Ok(glb) => return Ok((glb.json, glb.bin)),
        Err(gltf::Error::Binary(error)) => error,
        Err(other) => return Err(fail(other.to_string())),
    };
    Err(match error {
        binary::Error::Version(version) => Error::input(path, format!("is a GLB of version {version}"))
            .with_help("only glTF 2.0 is read; convert the file"),
        binary::Error::UnknownChunkType(_) if file.get(16..20) == Some(b"JSON") => {
            let end = file[12..16].try_into().map_or(0, u32::from_le_bytes) as usize;
            return Ok((file[20..20 + end].into(), None));
        }
        binary::Error::UnknownChunkType(kind) => {
            fail(format!("its first chunk has the type '{}', not JSON", kind.escape_ascii()))
        }
        binary::Error::ChunkLength { ty, length, length_read } => {
            fail(format!("its {ty:?} chunk promises {length} bytes, but {length_read} are left"))
        }
        binary::Error::ChunkType(ty) => fail(format!("a {ty:?} chunk is out of place")),
        binary::Error::Io(_) => fail(format!("it ends after {length} bytes, inside the header of a chunk")),
        other => fail(other.to_string()),
    })
}
