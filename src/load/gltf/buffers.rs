//! Buffers and buffer views, checked before anything looks into them.

use super::document::{Document, pointer};
use super::meshopt;
use super::report::{Report, Sound};
use crate::load::uri::{self, Target};
use gltf::json::{Buffer, buffer};
use serde_json::Value;
use std::borrow::Cow;
use std::path::PathBuf;

/// The bytes of a buffer view.
#[derive(Clone, Copy)]
pub(super) struct BufferView<'d> {
    /// All its bytes.
    pub bytes: &'d [u8],
    /// From one element to the next, if the file says so.
    pub stride: Option<usize>,
}

impl<'a> Document<'a> {
    /// The bytes of a buffer view, inside its buffer for certain; `from` points to what refers to it.
    pub fn view(&self, index: usize, from: &str, report: &mut Report) -> Sound<BufferView<'_>> {
        let view: buffer::View = self.entry("bufferViews", index, from, report)?;
        let at = pointer("bufferViews", index);
        let stride = view.byte_stride.map(|s| s.0);
        if stride.is_some_and(|s| !(4..=252).contains(&s)) {
            return Err(report.problem(format!("{at}/byteStride"), "is not in 4..252"));
        }
        if let Some((place, packed)) = meshopt::packed(&self.json, &at) {
            let unpack = || report.lasting(|report| self.unpack(packed, &place, report));
            // `entry` found the view, so that it has a cell.
            let bytes = self.views[index].get_or_init(unpack).as_ref().map_err(|noted| *noted)?;
            if view.byte_length.0 != bytes.len() as u64 {
                let (says, holds) = (view.byte_length.0, bytes.len());
                return Err(report.problem(place, format!("holds {holds} bytes for a bufferView of {says}")));
            }
            return Ok(BufferView { bytes, stride });
        }
        let (offset, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        let bytes = self.range(view.buffer.value(), offset, length, &at, report)?;
        Ok(BufferView { bytes, stride })
    }

    /// Bytes of a buffer; `at` points to what asks for them.
    fn range(&self, buffer: usize, offset: u64, length: u64, at: &str, report: &mut Report) -> Sound<&[u8]> {
        let bytes = self.buffer(buffer, &format!("{at}/buffer"), report)?;
        let range = offset.checked_add(length).filter(|&end| end <= bytes.len() as u64);
        let Some(end) = range else {
            let size = bytes.len();
            return Err(report.problem(
                at,
                format!("reaches from byte {offset} over {length} bytes, but its buffer has {size}"),
            ));
        };
        Ok(&bytes[offset as usize..end as usize])
    }

    /// Decompresses a buffer view.
    fn unpack(&self, packed: &Value, at: &str, report: &mut Report) -> Sound<Vec<u8>> {
        let layout = meshopt::Layout::new(packed, at, report)?;
        let bytes = self.range(layout.buffer, layout.offset, layout.length, at, report)?;
        if !self.may_decode(layout.size()) {
            return Err(report.problem(
                at,
                format!("{} elements are more than the size of the file justifies", layout.count),
            ));
        }
        match layout.decode(bytes) {
            Ok(bytes) => Ok(bytes),
            Err(message) => Err(report.problem(at, format!("can't be decompressed: {message}"))),
        }
    }

    /// The contents of a buffer, read when first asked for.
    fn buffer(&self, index: usize, from: &str, report: &mut Report) -> Sound<&[u8]> {
        let Some(cell) = self.buffers.get(index) else {
            let message = format!("refers to /buffers/{index}, but there are {}", self.buffers.len());
            return Err(report.problem(from, message));
        };
        let read = cell.get_or_init(|| report.lasting(|report| self.read_buffer(index, from, report)));
        read.as_deref().map_err(|noted| *noted)
    }

    fn read_buffer(&self, index: usize, from: &str, report: &mut Report) -> Sound<Cow<'a, [u8]>> {
        let at = pointer("buffers", index);
        let buffer: Buffer = self.entry("buffers", index, from, report)?;
        let bytes: Cow<'a, [u8]> = match (&buffer.uri, &self.binary) {
            (Some(uri), _) => self.fetch(uri, &format!("{at}/uri"), report)?.bytes,
            (None, Some(binary)) if index == 0 => binary.clone(),
            (None, _) => {
                // Allowed: such a buffer is filled by agreement between programs.
                return Err(
                    report.warn(at, "has no data (no uri and no binary chunk); what uses it is left out")
                );
            }
        };
        let (promised, held) = (buffer.byte_length.0, bytes.len());
        if promised > held as u64 {
            return Err(report.problem(
                format!("{at}/byteLength"),
                format!("promises {promised} bytes, but there are {held}"),
            ));
        }
        // What lies beyond (padding of a GLB's chunk) belongs to no view.
        Ok(match bytes {
            Cow::Borrowed(b) => Cow::Borrowed(&b[..promised as usize]),
            Cow::Owned(mut b) => {
                b.truncate(promised as usize);
                Cow::Owned(b)
            }
        })
    }

    /// The bytes that a URI leads to.
    pub fn fetch(&self, uri: &str, at: &str, report: &mut Report) -> Sound<Fetched<'a>> {
        match uri::resolve(uri, self.path, self.allow_external) {
            Ok(Target::Embedded { mime, bytes }) => Ok(Fetched { bytes: bytes.into(), mime, file: None }),
            Ok(Target::File(path)) => {
                self.files.note(&path);
                match std::fs::read(&path) {
                    Ok(bytes) => {
                        self.note_read(bytes.len());
                        Ok(Fetched { bytes: bytes.into(), mime: None, file: Some(path) })
                    }
                    Err(e) => {
                        let message = format!("the file {} can't be read: {e}", path.display());
                        Err(report.problem(at, message))
                    }
                }
            }
            Err(message) => Err(report.problem(at, message)),
        }
    }

    /// The file that a URI leads to, if it is not there.
    pub fn missing_file(&self, uri: &str) -> Option<PathBuf> {
        match uri::resolve(uri, self.path, self.allow_external) {
            Ok(Target::File(path)) if !path.exists() => {
                self.files.note(&path);
                Some(path)
            }
            _ => None,
        }
    }
}

/// What a URI leads to.
pub(super) struct Fetched<'a> {
    /// The bytes.
    pub bytes: Cow<'a, [u8]>,
    /// Their media type, if the URI states it.
    pub mime: Option<String>,
    /// The file that they come from; `None` for data in the URI itself.
    pub file: Option<PathBuf>,
}
