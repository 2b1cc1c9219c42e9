//! KHR_draco_mesh_compression: primitives whose vertices and indices are one compressed stream. Its contents replace
//! those of the primitive's accessors.

#[cfg(feature = "draco")]
mod stream;

use super::document::{Document, pointer};
use super::report::{Report, Valid};
use gltf::json::mesh::Primitive;

/// The extension's name.
const DRACO: &str = "KHR_draco_mesh_compression";

/// A primitive that is compressed.
struct Compressed<'p, 'd> {
    doc: &'p Document<'d>,
    primitive: &'p Primitive,
    /// JSON pointer of the extension.
    at: String,
}

/// Unpacks a primitive, if it is compressed, so that its accessors can be read; says whether it is.
pub(super) fn unpack(doc: &Document, primitive: &Primitive, at: &str, report: &mut Report) -> Valid<bool> {
    let at = format!("{at}/extensions/{DRACO}");
    match doc.json.pointer(&at) {
        Some(extension) => Compressed { doc, primitive, at }.unpack(extension, report),
        None => Ok(false),
    }
}

impl Compressed<'_, '_> {
    /// Has the primitive uncompressed data for all its attributes, too?
    fn has_plain_copies(&self) -> bool {
        self.primitive.attributes.values().chain(&self.primitive.indices).all(|i| self.is_plain(i.value()))
    }

    /// Has an accessor, if there is one, data of its own?
    fn is_plain(&self, index: usize) -> bool {
        let accessor = self.doc.json.pointer(&pointer("accessors", index));
        accessor.is_none_or(|a| a.get("bufferView").is_some() || a.get("sparse").is_some())
    }

    /// Without a decoder the extension is one that is not read: the plain copy counts, or nothing is there.
    #[cfg(not(feature = "draco"))]
    fn unpack(self, _: &serde_json::Value, report: &mut Report) -> Valid<bool> {
        use crate::error::Problem;
        use crate::load::decoders::Decoder;
        if self.has_plain_copies() {
            return Ok(false);
        }
        // A file that demands the extension has had its problem, unless the user wants what can be read.
        if self.doc.options.force || self.doc.extension_required(DRACO) {
            let message = format!("{}: left out", Decoder::Draco.lack());
            return Err(report.warn(self.at, message));
        }
        Err(report.add(Problem::new(self.at, Decoder::Draco.lack()).with_help(Decoder::Draco.remedy())))
    }
}
