//! KHR_draco_mesh_compression: primitives whose vertices and indices are one compressed stream. Its contents replace
//! those of the primitive's accessors.

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

// The compressed stream of a primitive, by `draco-core`.

/// Points and faces that a stream of any size may hold, and for each of its bytes. A constant attribute takes no room
/// in a stream, so the ratio is wide.
#[cfg(feature = "draco")]
const FREE: u64 = 1 << 16;
#[cfg(feature = "draco")]
const PER_BYTE: u64 = 64;

#[cfg(feature = "draco")]
impl Compressed<'_, '_> {
    /// Stores the decoded stream as contents of the accessors; false where the uncompressed fallback of a broken stream is read.
    pub(super) fn unpack(self, extension: &Value, report: &mut Report) -> Valid<bool> {
        let (doc, primitive) = (self.doc, self.primitive);
        let indices = primitive.indices.iter().map(|i| ("indices".to_string(), i.value()));
        let accessors: Vec<(String, usize)> = indices.chain(self.attribute_accessors(extension)).collect();
        let is_compressed = |index: usize| accessors.iter().any(|a| a.1 == index);
        let used = primitive.attributes.values().chain(&primitive.indices).map(|i| i.value());
        let empty = used.filter(|&i| !is_compressed(i) && !self.is_plain(i)).count();
        if empty > 0 {
            let message =
                format!("{empty} accessors of the primitive are neither compressed nor plain: all zeros");
            report.warn(&*self.at, message);
        }
        // Another primitive may share them.
        if accessors.iter().all(|(_, i)| doc.accessors.get(*i).is_some_and(|cell| cell.get().is_some())) {
            return Ok(true);
        }
        if let Err(problem) = self.fill(extension, &accessors, report) {
            if self.has_plain_copies() {
                let message = format!("{}; the plain copy beside it is read", problem.message);
                report.warn(problem.place, message);
                return Ok(false);
            }
            return Err(report.add(problem.with_help("export the model without mesh compression")));
        }
        Ok(true)
    }

    /// Decodes the stream and hands its contents to the accessors: to all or, on an error, to none.
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
            // Opening an accessor that does not exist will name that problem. A cell that is full belongs to an accessor
            // that another compressed primitive shares: the same data.
            let _ = doc.accessors.get(accessor).map(|cell| cell.set(unpacked));
        }
        Ok(())
    }

    /// The accessors of the attributes that are compressed, by the attributes' names.
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

/// Decodes a stream. The decoder returns errors for damaged streams; should it panic all the same, that is one, too.
#[cfg(feature = "draco")]
fn decode(bytes: &[u8]) -> Result<Mesh, String> {
    let most = FREE + (bytes.len() as u64).saturating_mul(PER_BYTE);
    let limits = DecodeLimits::default()
        .with_max_points(most)
        .with_max_faces(most)
        .with_max_decoded_bytes(most.saturating_mul(64));
    let decode = || {
        let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
        let mut mesh = Mesh::new();
        MeshDecoder::new().decode(&mut buffer, &mut mesh).map(|()| mesh).map_err(|e| e.to_string())
    };
    let mesh = decoders::catch(decode)??;
    if mesh.num_points() as u64 > most {
        return Err(format!("it claims {} vertices in {} bytes", mesh.num_points(), bytes.len()));
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

/// The values of an attribute for all points in order; an error says what is wrong with it.
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

/// The bytes of one element a point; `None` if the stream has no value for some point.
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
