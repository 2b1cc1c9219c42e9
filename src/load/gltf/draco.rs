//! KHR_draco_mesh_compression: vertices and indices of a primitive in one compressed stream, which replaces the contents
//! of the primitive's accessors.

#[cfg(feature = "draco")]
use super::document::DecodedAccessor;
use super::document::{Document, pointer};
use super::report::{Report, Valid};
#[cfg(feature = "draco")]
use crate::error::Problem;
#[cfg(feature = "draco")]
use crate::load::decoders;
#[cfg(feature = "draco")]
use draco_core::{
    DataType, DecodeLimits, DecoderBuffer, FaceIndex, Mesh, MeshDecoder, PointAttribute, PointIndex,
};
#[cfg(feature = "draco")]
use gltf::json::accessor::ComponentType;
use gltf::json::mesh::Primitive;
#[cfg(feature = "draco")]
use serde_json::Value;

/// The extension's name.
const DRACO: &str = "KHR_draco_mesh_compression";

/// A compressed primitive.
struct Compressed<'p, 'd> {
    doc: &'p Document<'d>,
    primitive: &'p Primitive,
    /// JSON pointer of the extension.
    at: String,
}

/// Decompresses a primitive into its accessors; false for uncompressed primitives.
pub(super) fn unpack(doc: &Document, primitive: &Primitive, at: &str, report: &mut Report) -> Valid<bool> {
    let at = format!("{at}/extensions/{DRACO}");
    match doc.json.pointer(&at) {
        Some(extension) => Compressed { doc, primitive, at }.unpack(extension, report),
        None => Ok(false),
    }
}

impl Compressed<'_, '_> {
    /// Whether the primitive has an uncompressed fallback for all attributes.
    fn has_fallback(&self) -> bool {
        self.primitive
            .attributes
            .values()
            .chain(&self.primitive.indices)
            .all(|i| self.is_uncompressed(i.value()))
    }

    /// Whether an accessor has uncompressed data; true for missing accessors.
    fn is_uncompressed(&self, index: usize) -> bool {
        let accessor = self.doc.json.pointer(&pointer("accessors", index));
        accessor.is_none_or(|a| a.get("bufferView").is_some() || a.get("sparse").is_some())
    }

    /// Without a decoder only the uncompressed fallback can be read.
    #[cfg(not(feature = "draco"))]
    fn unpack(self, _: &serde_json::Value, report: &mut Report) -> Valid<bool> {
        use crate::error::Problem;
        use crate::load::decoders::Decoder;
        if self.has_fallback() {
            return Ok(false);
        }
        // A required extension was already reported as a problem.
        if self.doc.options.force || self.doc.extension_required(DRACO) {
            let message = format!("{}: left out", Decoder::Draco.missing_message());
            return Err(report.warn(self.at, message));
        }
        Err(report
            .add(Problem::new(self.at, Decoder::Draco.missing_message()).with_help(Decoder::Draco.remedy())))
    }
}

// The compressed stream of a primitive, by `draco-core`.

/// Maximum number of points and faces: a constant plus a multiple of the stream's bytes. The multiple is large because
/// constant attributes take no space.
#[cfg(feature = "draco")]
const FREE: u64 = 1 << 16;
#[cfg(feature = "draco")]
const PER_BYTE: u64 = 64;

#[cfg(feature = "draco")]
impl Compressed<'_, '_> {
    /// Stores the decoded stream in the accessors; false if the stream is broken and the uncompressed fallback is to be read.
    pub(super) fn unpack(self, extension: &Value, report: &mut Report) -> Valid<bool> {
        let (doc, primitive) = (self.doc, self.primitive);
        let indices = primitive.indices.iter().map(|i| ("indices".to_string(), i.value()));
        let accessors: Vec<(String, usize)> = indices.chain(self.attribute_accessors(extension)).collect();
        let is_compressed = |index: usize| accessors.iter().any(|a| a.1 == index);
        let used = primitive.attributes.values().chain(&primitive.indices).map(|i| i.value());
        let empty = used.filter(|&i| !is_compressed(i) && !self.is_uncompressed(i)).count();
        if empty > 0 {
            let message = format!(
                "{empty} accessors of the primitive have neither compressed nor uncompressed data: all zeros"
            );
            report.warn(&*self.at, message);
        }
        // Another primitive with the same accessors may have been decoded.
        if accessors.iter().all(|(_, i)| doc.accessors.get(*i).is_some_and(|cell| cell.get().is_some())) {
            return Ok(true);
        }
        if let Err(problem) = self.fill(extension, &accessors, report) {
            if self.has_fallback() {
                let message = format!("{}; its uncompressed fallback is read", problem.message);
                report.warn(problem.place, message);
                return Ok(false);
            }
            return Err(report.add(problem.with_help("export the model without mesh compression")));
        }
        Ok(true)
    }

    /// Decodes the stream into the accessors: all of them or, on an error, none.
    fn fill(
        &self,
        extension: &Value,
        accessors: &[(String, usize)],
        report: &mut Report,
    ) -> Result<(), Problem> {
        let Compressed { doc, at, .. } = self;
        let problem = |message: String| Problem::new(&**at, message);
        if !extension.get("attributes").is_some_and(Value::is_object) {
            return Err(problem("has no attributes".to_string()));
        }
        let view = extension.get("bufferView").and_then(Value::as_u64).and_then(|v| usize::try_from(v).ok());
        let view = view.ok_or_else(|| problem("has no bufferView".to_string()))?;
        let view = doc.view(view, &format!("{at}/bufferView"), report);
        let bytes = view.map_err(|_| problem("has no bytes that can be read".to_string()))?.bytes;
        let mesh = decode(bytes).map_err(|message| problem(format!("can't be decompressed: {message}")))?;
        let points = mesh.num_points() as u64;
        if !doc.may_decode(points.saturating_mul(64) + mesh.num_faces() as u64 * 12) {
            return Err(problem(format!("{points} vertices are more than the size of the file justifies")));
        }
        let mut contents = Vec::new();
        for (name, accessor) in accessors {
            let unpacked = match name.as_str() {
                "indices" => indices(&mesh),
                _ => attribute(&mesh, extension, name).map_err(|m| problem(format!("{name} {m}")))?,
            };
            contents.push((*accessor, unpacked));
        }
        for (accessor, unpacked) in contents {
            // Missing accessors are reported when they are opened. A cell already set belongs to an accessor that another
            // compressed primitive shares, with the same data.
            let _ = doc.accessors.get(accessor).map(|cell| cell.set(unpacked));
        }
        Ok(())
    }

    /// Names and accessors of the compressed attributes.
    fn attribute_accessors(&self, extension: &Value) -> Vec<(String, usize)> {
        let primitive = self.at.strip_suffix(&format!("/extensions/{DRACO}")).unwrap_or_default();
        let accessor = |name: &String| {
            let index = self.doc.json.pointer(&format!("{primitive}/attributes/{name}"))?.as_u64()?;
            Some((name.clone(), usize::try_from(index).ok()?))
        };
        let names = extension.get("attributes").and_then(Value::as_object);
        names.into_iter().flatten().filter_map(|(name, _)| accessor(name)).collect()
    }
}

/// Decodes a stream; errors and panics of the decoder become messages.
#[cfg(feature = "draco")]
fn decode(bytes: &[u8]) -> Result<Mesh, String> {
    let max_count = FREE + (bytes.len() as u64).saturating_mul(PER_BYTE);
    let limits = DecodeLimits::default()
        .with_max_points(max_count)
        .with_max_faces(max_count)
        .with_max_decoded_bytes(max_count.saturating_mul(64));
    let decode = || {
        let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
        let mut mesh = Mesh::new();
        MeshDecoder::new().decode(&mut buffer, &mut mesh).map(|()| mesh).map_err(|e| e.to_string())
    };
    let mesh = decoders::catch_panic(decode)??;
    if mesh.num_points() as u64 > max_count {
        return Err(format!("it declares {} vertices in {} bytes", mesh.num_points(), bytes.len()));
    }
    Ok(mesh)
}

#[cfg(feature = "draco")]
fn indices(mesh: &Mesh) -> DecodedAccessor {
    let faces = (0..mesh.num_faces() as u32).map(|i| mesh.face(FaceIndex(i)));
    let corners = faces.flat_map(|face| face.map(|point| point.0.to_le_bytes()));
    let bytes: Vec<u8> = corners.flatten().collect();
    DecodedAccessor { count: mesh.num_faces() * 3, bytes, component: ComponentType::U32 }
}

/// The values of an attribute for all points in order.
///
/// # Errors
/// A message that follows the attribute's name.
#[cfg(feature = "draco")]
fn attribute(mesh: &Mesh, extension: &Value, name: &str) -> Result<DecodedAccessor, String> {
    let id = extension.pointer(&format!("/attributes/{name}")).and_then(Value::as_u64);
    let id = id.and_then(|id| u32::try_from(id).ok());
    let attribute = id.and_then(|id| mesh.attribute_by_unique_id(id));
    let attribute = attribute.ok_or("is not in the compressed stream")?;
    let component = match attribute.data_type() {
        DataType::Int8 => ComponentType::I8,
        DataType::Uint8 => ComponentType::U8,
        DataType::Int16 => ComponentType::I16,
        DataType::Uint16 => ComponentType::U16,
        DataType::Uint32 => ComponentType::U32,
        DataType::Float32 => ComponentType::F32,
        other => return Err(format!("is compressed as {other:?}, which glTF does not know")),
    };
    let count = mesh.num_points();
    let element = component.size() * usize::from(attribute.num_components());
    let bytes = gather(attribute, count, element).ok_or("lacks values in the compressed stream")?;
    Ok(DecodedAccessor { bytes, count, component })
}

/// One element of `element` bytes per point; `None` if the stream lacks a value for a point.
#[cfg(feature = "draco")]
fn gather(attribute: &PointAttribute, count: usize, element: usize) -> Option<Vec<u8>> {
    let stride = usize::try_from(attribute.byte_stride()).ok()?;
    let data = attribute.buffer().data();
    let mut bytes = Vec::with_capacity(count.checked_mul(element)?);
    for point in 0..u32::try_from(count).ok()? {
        let value = attribute.mapped_index(PointIndex(point)).0 as usize;
        let start = value.checked_mul(stride)?;
        bytes.extend_from_slice(data.get(start..start.checked_add(element)?)?);
    }
    Some(bytes)
}
