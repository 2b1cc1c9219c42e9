//! EXT_meshopt_compression and KHR_meshopt_compression: compressed buffer views. The bit streams are those of the
//! latter's specification (appendix A; filters in appendix B), of which the former has version 0 only.
//!
//! Decoders check each read: a damaged stream is an error, whatever it holds.

mod attributes;
mod filters;
mod indices;
mod stream;

use super::document::{index_of, required};
use super::report::{Report, Sound};
use crate::error::Problem;
use serde_json::Value;

/// The extensions' names, which differ in nothing else.
const NAMES: [&str; 2] = ["KHR_meshopt_compression", "EXT_meshopt_compression"];

/// The extension of the buffer view at a pointer, with its own pointer.
pub(super) fn packed<'v>(json: &'v Value, at: &str) -> Option<(String, &'v Value)> {
    let extensions = json.pointer(&format!("{at}/extensions"))?;
    let name = NAMES.iter().find(|name| extensions.get(name).is_some())?;
    Some((format!("{at}/extensions/{name}"), extensions.get(name)?))
}

/// What kind of stream it is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// What happens to the elements after decoding.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Filter {
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// What the JSON says about a compressed view.
pub(super) struct Layout {
    /// The buffer with the stream.
    pub buffer: usize,
    /// The stream's first byte.
    pub offset: u64,
    /// Its length.
    pub length: u64,
    /// Number of elements.
    pub count: usize,
    stride: usize,
    mode: Mode,
    filter: Filter,
}

impl Layout {
    /// Reads and checks it.
    pub fn new(packed: &Value, at: &str, report: &mut Report) -> Sound<Layout> {
        let mut whole = |key: &str| required(index_of(packed, key, at, report), key, at, report);
        let (buffer, length) = (whole("buffer"), whole("byteLength"));
        let (stride, count) = (whole("byteStride"), whole("count"));
        let offset = index_of(packed, "byteOffset", at, report);
        let mode = match packed.get("mode").and_then(Value::as_str) {
            Some("ATTRIBUTES") => Mode::Attributes,
            Some("TRIANGLES") => Mode::Triangles,
            Some("INDICES") => Mode::Indices,
            _ => {
                return Err(
                    report.problem(format!("{at}/mode"), "is none of ATTRIBUTES, TRIANGLES and INDICES")
                );
            }
        };
        let filter = match packed.get("filter").map(|f| f.as_str().unwrap_or_default()) {
            None | Some("NONE") => Filter::None,
            Some("OCTAHEDRAL") => Filter::Octahedral,
            Some("QUATERNION") => Filter::Quaternion,
            Some("EXPONENTIAL") => Filter::Exponential,
            Some("COLOR") => Filter::Color,
            Some(other) => {
                let problem = Problem::new(format!("{at}/filter"), format!("'{other}' is not known"));
                return Err(report.add(problem.with_help("export the model without mesh compression")));
            }
        };
        let (stride, count) = (stride?, count?);
        let (offset, length) = (offset?.unwrap_or(0) as u64, length? as u64);
        let layout = Layout { buffer: buffer?, offset, length, count, stride, mode, filter };
        if !layout.is_sound() {
            return Err(report
                .problem(at, format!("{count} elements of {stride} bytes don't fit its mode and filter")));
        }
        Ok(layout)
    }

    /// The rules for strides and counts.
    fn is_sound(&self) -> bool {
        let stride = self.stride;
        let by_mode = match self.mode {
            Mode::Attributes => stride.is_multiple_of(4) && (4..=256).contains(&stride),
            Mode::Triangles => matches!(stride, 2 | 4) && self.count.is_multiple_of(3),
            Mode::Indices => matches!(stride, 2 | 4),
        };
        let by_filter = match self.filter {
            Filter::None => true,
            Filter::Octahedral | Filter::Color => matches!(stride, 4 | 8),
            Filter::Quaternion => stride == 8,
            Filter::Exponential => stride.is_multiple_of(4),
        };
        by_mode && by_filter && (self.filter == Filter::None || self.mode == Mode::Attributes)
    }

    /// Bytes after decoding.
    pub fn size(&self) -> u64 {
        (self.count as u64).saturating_mul(self.stride as u64)
    }

    /// Decodes a stream into `count` elements.
    ///
    /// # Errors
    /// Says what is wrong with the stream.
    pub fn decode(&self, stream: &[u8]) -> Result<Vec<u8>, String> {
        let mut bytes = match self.mode {
            Mode::Attributes => attributes::decode(stream, self.count, self.stride)?,
            Mode::Triangles => narrowed(indices::triangles(stream, self.count)?, self.stride),
            Mode::Indices => narrowed(indices::indices(stream, self.count)?, self.stride),
        };
        match (self.filter, self.stride) {
            (Filter::None, _) => {}
            (Filter::Octahedral, 4) => filters::octahedral8(&mut bytes),
            (Filter::Octahedral, _) => filters::octahedral16(&mut bytes),
            (Filter::Quaternion, _) => filters::quaternion(&mut bytes),
            (Filter::Exponential, _) => filters::exponential(&mut bytes),
            (Filter::Color, 4) => filters::color8(&mut bytes),
            (Filter::Color, _) => filters::color16(&mut bytes),
        }
        Ok(bytes)
    }
}

/// Indices as bytes of their size; what does not fit 16 bits wraps around, as the specification demands.
fn narrowed(indices: Vec<u32>, stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|i| i.to_le_bytes().into_iter().take(stride)).collect()
}

#[cfg(test)]
mod tests;
