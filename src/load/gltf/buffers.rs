//! Buffers, buffer views, accessors and URIs, with bounds checks.

use super::document::{DecodedAccessor, Document, pointer};
use super::meshopt;
use super::report::{Report, Valid};
use crate::error::Choice;
use crate::load::files;
use base64::engine::{DecodePaddingMode, Engine, GeneralPurpose, GeneralPurposeConfig};
use base64::{DecodeError, alphabet};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Buffer, accessor, buffer};
use percent_encoding::percent_decode;
use serde_json::Value;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The bytes of a buffer view.
#[derive(Clone, Copy)]
pub(super) struct BufferView<'d> {
    /// The whole view.
    pub bytes: &'d [u8],
    /// Bytes between elements, if the view has a `byteStride`.
    pub stride: Option<usize>,
}

impl<'a> Document<'a> {
    /// The bounds-checked bytes of a buffer view; `from` is the JSON pointer of the reference to it.
    pub fn view(&self, index: usize, from: &str, report: &mut Report) -> Valid<BufferView<'_>> {
        let view: buffer::View = self.entry("bufferViews", index, from, report)?;
        let at = pointer("bufferViews", index);
        let stride = view.byte_stride.map(|s| s.0);
        if stride.is_some_and(|s| !(4..=252).contains(&s)) {
            return Err(report.problem(format!("{at}/byteStride"), "is not in 4..252"));
        }
        if let Some((place, packed)) = meshopt::packed(&self.json, &at) {
            let unpack = || report.lasting(|report| self.unpack(packed, &place, report));
            // `entry` has checked the index.
            let bytes = self.views[index].get_or_init(unpack).as_ref().map_err(|reported| *reported)?;
            if view.byte_length.0 != bytes.len() as u64 {
                let (declared, held) = (view.byte_length.0, bytes.len());
                return Err(
                    report.problem(place, format!("holds {held} bytes for a bufferView of {declared}"))
                );
            }
            return Ok(BufferView { bytes, stride });
        }
        let (offset, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        let bytes = self.range(view.buffer.value(), offset, length, &at, report)?;
        Ok(BufferView { bytes, stride })
    }

    /// A range of a buffer's bytes; `at` is the JSON pointer of the reference to it.
    fn range(&self, buffer: usize, offset: u64, length: u64, at: &str, report: &mut Report) -> Valid<&[u8]> {
        let bytes = self.buffer(buffer, &format!("{at}/buffer"), report)?;
        let range = offset.checked_add(length).filter(|&end| end <= bytes.len() as u64);
        let Some(end) = range else {
            let size = bytes.len();
            return Err(report.problem(
                at,
                (
                    "range-beyond-buffer",
                    format!("spans {length} bytes from byte {offset}, but its buffer has {size}"),
                ),
            ));
        };
        Ok(&bytes[offset as usize..end as usize])
    }

    /// Decompresses a buffer view.
    fn unpack(&self, packed: &Value, at: &str, report: &mut Report) -> Valid<Vec<u8>> {
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

    /// The contents of a buffer, read on first use.
    fn buffer(&self, index: usize, from: &str, report: &mut Report) -> Valid<&[u8]> {
        let Some(cell) = self.buffers.get(index) else {
            let message = format!("refers to /buffers/{index}, but there are {}", self.buffers.len());
            return Err(report.problem(from, message));
        };
        let read = cell.get_or_init(|| report.lasting(|report| self.read_buffer(index, from, report)));
        read.as_deref().map_err(|reported| *reported)
    }

    fn read_buffer(&self, index: usize, from: &str, report: &mut Report) -> Valid<Cow<'a, [u8]>> {
        let at = pointer("buffers", index);
        let buffer: Buffer = self.entry("buffers", index, from, report)?;
        let bytes: Cow<'a, [u8]> = match (&buffer.uri, &self.binary) {
            (Some(uri), _) => self.fetch(uri, &format!("{at}/uri"), report)?.bytes,
            (None, Some(binary)) if index == 0 => binary.clone(),
            (None, _) => {
                // Valid glTF: the application supplies the data.
                return Err(report.warn(
                    at,
                    "has no data (no uri and no binary chunk); everything that uses it is ignored",
                ));
            }
        };
        let (declared, held) = (buffer.byte_length.0, bytes.len());
        if declared > held as u64 {
            return Err(report.problem(
                format!("{at}/byteLength"),
                format!("declares {declared} bytes, but there are {held}"),
            ));
        }
        // Bytes beyond byteLength are padding of a GLB chunk.
        Ok(match bytes {
            Cow::Borrowed(b) => Cow::Borrowed(&b[..declared as usize]),
            Cow::Owned(mut b) => {
                b.truncate(declared as usize);
                Cow::Owned(b)
            }
        })
    }

    /// Reads the target of a URI.
    pub fn fetch(&self, uri: &str, at: &str, report: &mut Report) -> Valid<FetchedFile<'a>> {
        match self.locate(uri, at, report) {
            Ok(Target::Embedded { mime, bytes }) => Ok(FetchedFile { bytes: bytes.into(), mime, file: None }),
            Ok(Target::File(path)) => match files::read(&path, files::MAX_DATA) {
                Ok(bytes) => {
                    self.note_read(bytes.len());
                    Ok(FetchedFile { bytes: bytes.into(), mime: None, file: Some(path) })
                }
                Err(message) => Err(report.problem(at, format!("the file {} {message}", path.display()))),
            },
            Err(message) => Err(report.problem(at, message)),
        }
    }

    /// Resolves a URI and records its file among the files of the scene.
    ///
    /// # Errors
    /// A message why it can't be resolved.
    pub fn locate(&self, uri: &str, at: &str, report: &mut Report) -> Result<Target, String> {
        let target = resolve_uri(uri, self.path, self.allow_external);
        match &target {
            Ok(Target::Embedded { .. }) => {}
            Ok(Target::File(path)) => {
                self.files.note(path);
                let is_plain =
                    path.components().eq(files::relative_to(self.path, &decoded_path(uri)).components());
                if !is_plain {
                    let message = format!("'{}' is taken to mean {}", shortened(uri), path.display());
                    report.note(at, ("uri-guessed", message));
                }
            }
            // Watch for the file: it may be created later.
            Err(_) => self.files.note(files::relative_to(self.path, &decoded_path(uri))),
        }
        target
    }
}

/// Contents of a URI's target.
pub(super) struct FetchedFile<'a> {
    pub bytes: Cow<'a, [u8]>,
    /// The media type of a `data:` URI, if given.
    pub mime: Option<String>,
    /// The file; `None` for `data:` URIs.
    pub file: Option<PathBuf>,
}

// Accessors: typed arrays in buffers. [`Accessor::open`] checks everything, reading can't fail.

/// Maximum number of elements of an accessor without a buffer view (zeros or sparse), in addition to one per byte read.
const FREE_ZEROS: u64 = 1 << 16;

/// A checked accessor.
pub(super) struct Accessor<'d> {
    /// Its JSON pointer.
    pub pointer: String,
    /// Number of elements.
    pub count: usize,
    /// Scalar, vector or matrix.
    pub kind: Type,
    /// Type of the stored components.
    pub component: ComponentType,
    /// Whether integers are normalized to 0..1 or -1..1.
    pub normalized: bool,
    /// Elements in a buffer; `None` for zeros.
    dense: Option<Elements<'d>>,
    sparse: Option<Sparse<'d>>,
}

/// Strided elements: `bytes` starts at the first and ends with the last.
#[derive(Clone, Copy)]
struct Elements<'d> {
    bytes: &'d [u8],
    stride: usize,
}

/// Sparse substitutions.
struct Sparse<'d> {
    /// Strictly increasing and below the accessor's count.
    indices: Vec<u32>,
    values: Elements<'d>,
}

impl<'d> Accessor<'d> {
    /// Opens an accessor; `from` is the JSON pointer of the reference to it.
    pub fn open(doc: &'d Document, index: usize, from: &str, report: &mut Report) -> Valid<Accessor<'d>> {
        let json: gltf::json::Accessor = doc.entry("accessors", index, from, report)?;
        let at = pointer("accessors", index);
        let Checked::Valid(accessor::GenericComponentType(component)) = json.component_type else {
            return Err(report.problem(format!("{at}/componentType"), "is not a component type of glTF 2.0"));
        };
        let Checked::Valid(kind) = json.type_ else {
            return Err(report.problem(format!("{at}/type"), "is not a type of glTF 2.0"));
        };
        let mut accessor = Accessor {
            count: usize::try_from(json.count.0)
                .map_err(|_| report.problem(format!("{at}/count"), "exceeds the address space"))?,
            kind,
            component,
            normalized: json.normalized,
            dense: None,
            sparse: None,
            pointer: at.clone(),
        };
        if let Some(unpacked) = doc.accessors.get(index).and_then(|cell| cell.get()) {
            accessor.dense = Some(accessor.open_unpacked(unpacked, report)?);
        } else if let Some(view) = json.buffer_view {
            let place = ElementLayout {
                view: view.value(),
                offset: json.byte_offset.unwrap_or_default().0,
                element: accessor.element_size(),
                count: accessor.count,
            };
            accessor.dense = Some(place.elements(doc, &at, report)?);
        } else if accessor.count as u64 > FREE_ZEROS.saturating_add(doc.bytes_read()) {
            let message =
                format!("{} elements without a bufferView are more than the file justifies", accessor.count);
            return Err(report.problem(at, message));
        }
        if let Some(sparse) = json.sparse {
            accessor.sparse = Some(accessor.open_sparse(doc, &sparse, report)?);
        }
        Ok(accessor)
    }

    /// The elements decoded from a compressed primitive, whose count and component type take precedence.
    fn open_unpacked(&mut self, unpacked: &'d DecodedAccessor, report: &mut Report) -> Valid<Elements<'d>> {
        if unpacked.count != self.count {
            let (declared, held) = (self.count, unpacked.count);
            let message =
                format!("has {declared} elements, but the compressed primitive {held}; the latter is used");
            report.warn(self.pointer.clone(), message);
        }
        (self.count, self.component) = (unpacked.count, unpacked.component);
        let stride = self.element_size();
        if unpacked.count.checked_mul(stride) != Some(unpacked.bytes.len()) {
            let message = format!("holds {}, unlike the compressed primitive", self.contents());
            return Err(report.problem(self.pointer.clone(), message));
        }
        Ok(Elements { bytes: &unpacked.bytes, stride })
    }

    fn open_sparse(
        &self,
        doc: &'d Document,
        sparse: &accessor::sparse::Sparse,
        report: &mut Report,
    ) -> Valid<Sparse<'d>> {
        let at = format!("{}/sparse", self.pointer);
        let count = usize::try_from(sparse.count.0).ok().filter(|&n| n <= self.count);
        let Some(count) = count else {
            let message = format!("replaces {} of {} elements", sparse.count.0, self.count);
            return Err(report.problem(format!("{at}/count"), message));
        };
        let Checked::Valid(accessor::IndexComponentType(component)) = sparse.indices.component_type else {
            return Err(report.problem(format!("{at}/indices/componentType"), "is not an index type"));
        };
        let places = ElementLayout {
            view: sparse.indices.buffer_view.value(),
            offset: sparse.indices.byte_offset.0,
            element: component.size(),
            count,
        };
        let places = places.elements(doc, &format!("{at}/indices"), report);
        let values = ElementLayout {
            view: sparse.values.buffer_view.value(),
            offset: sparse.values.byte_offset.0,
            element: self.element_size(),
            count,
        };
        let values = values.elements(doc, &format!("{at}/values"), report);
        let mut indices = vec![0; count];
        read_integers(places?, component, &mut indices);
        let increasing = indices.windows(2).all(|w| w[0] < w[1]);
        if !increasing || indices.last().is_some_and(|&last| last as usize >= self.count) {
            let message = format!("are not increasing and below {}", self.count);
            return Err(report.problem(format!("{at}/indices"), message));
        }
        Ok(Sparse { indices, values: values? })
    }

    /// Element type for messages: `VEC3 of U8`.
    pub fn contents(&self) -> String {
        format!("{} of {:?}", format!("{:?}", self.kind).to_uppercase(), self.component)
    }

    /// Bytes of one element, without the column padding of small integer matrices: only matrices of f32 are read.
    fn element_size(&self) -> usize {
        self.kind.multiplicity() * self.component.size()
    }

    /// Reads elements of N components as floats; `out` must have the length `count`.
    pub fn read_floats<const N: usize>(&self, out: &mut [[f32; N]]) {
        debug_assert!(self.kind.multiplicity() == N && out.len() == self.count);
        if let Some(dense) = self.dense {
            read_floats(dense, self.component, self.normalized, out);
        }
        if let Some(sparse) = &self.sparse {
            let mut values = vec![[0.0; N]; sparse.indices.len()];
            read_floats(sparse.values, self.component, self.normalized, &mut values);
            for (&at, value) in sparse.indices.iter().zip(values) {
                out[at as usize] = value;
            }
        }
    }

    /// Reads the first elements of a scalar accessor of unsigned integers; `out` has at most the length `count`.
    pub fn read_indices(&self, out: &mut [u32]) {
        debug_assert!(self.kind == Type::Scalar && out.len() <= self.count);
        if let Some(dense) = self.dense {
            read_integers(dense, self.component, out);
        }
        if let Some(sparse) = &self.sparse {
            let mut values = vec![0; sparse.indices.len()];
            read_integers(sparse.values, self.component, &mut values);
            for (&at, value) in sparse.indices.iter().zip(values) {
                if let Some(out) = out.get_mut(at as usize) {
                    *out = value;
                }
            }
        }
    }
}

/// Location of elements in a buffer view, bytes.
struct ElementLayout {
    view: usize,
    offset: u64,
    element: usize,
    count: usize,
}

impl ElementLayout {
    /// The bounds-checked elements.
    fn elements<'d>(&self, doc: &'d Document, at: &str, report: &mut Report) -> Valid<Elements<'d>> {
        let view = doc.view(self.view, &format!("{at}/bufferView"), report)?;
        let stride = view.stride.unwrap_or(self.element);
        if stride < self.element {
            let message = format!("elements of {} bytes don't fit a byteStride of {stride}", self.element);
            return Err(report.problem(at, message));
        }
        let last = (self.count as u64).checked_sub(1);
        let length = match last {
            None => Some(0),
            Some(last) => last.checked_mul(stride as u64).and_then(|n| n.checked_add(self.element as u64)),
        };
        let end =
            length.and_then(|n| n.checked_add(self.offset)).filter(|&end| end <= view.bytes.len() as u64);
        let Some(end) = end else {
            let message = format!(
                "{} elements of {} bytes from byte {} on reach beyond their bufferView of {} bytes",
                self.count,
                self.element,
                self.offset,
                view.bytes.len()
            );
            return Err(report.problem(at, message));
        };
        Ok(Elements { bytes: &view.bytes[self.offset.min(end) as usize..end as usize], stride })
    }
}

/// Converts components to floats (glTF 2.0, section 3.11 for normalised integers).
fn read_floats<const N: usize>(
    from: Elements,
    component: ComponentType,
    normalized: bool,
    out: &mut [[f32; N]],
) {
    let part_of = |x: f32, largest: f32| if normalized { (x / largest).max(-1.0) } else { x };
    match component {
        ComponentType::F32 if cfg!(target_endian = "little") && from.stride == N * 4 => {
            bytemuck::cast_slice_mut::<f32, u8>(out.as_flattened_mut()).copy_from_slice(from.bytes);
        }
        ComponentType::F32 => fill(from, out, f32::from_le_bytes),
        ComponentType::U8 => fill(from, out, |[b]| part_of(f32::from(b), 255.0)),
        ComponentType::I8 => fill(from, out, |b| part_of(f32::from(i8::from_le_bytes(b)), 127.0)),
        ComponentType::U16 => fill(from, out, |b| part_of(f32::from(u16::from_le_bytes(b)), 65535.0)),
        ComponentType::I16 => fill(from, out, |b| part_of(f32::from(i16::from_le_bytes(b)), 32767.0)),
        ComponentType::U32 => fill(from, out, |b| u32::from_le_bytes(b) as f32),
    }
}

fn fill<const N: usize, const S: usize>(
    from: Elements,
    out: &mut [[f32; N]],
    decode: impl Fn([u8; S]) -> f32,
) {
    for (element, out) in from.bytes.chunks(from.stride).zip(out) {
        for (component, out) in element.as_chunks::<S>().0.iter().zip(out) {
            *out = decode(*component);
        }
    }
}

/// Reads unsigned integers; other component types were rejected earlier.
fn read_integers(from: Elements, component: ComponentType, out: &mut [u32]) {
    let elements = from.bytes.chunks(from.stride).zip(out.iter_mut());
    match component {
        ComponentType::U8 => elements.for_each(|(b, out)| *out = u32::from(b[0])),
        ComponentType::U16 => {
            elements.for_each(|(b, out)| *out = u32::from(u16::from_le_bytes([b[0], b[1]])))
        }
        ComponentType::U32 if cfg!(target_endian = "little") && from.stride == 4 => {
            let length = out.len() * 4;
            bytemuck::cast_slice_mut::<_, u8>(out).copy_from_slice(&from.bytes[..length]);
        }
        ComponentType::U32 => {
            elements.for_each(|(b, out)| *out = u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        }
        ComponentType::I8 | ComponentType::I16 | ComponentType::F32 => {}
    }
}

// URIs: `data:` URIs are decoded, relative references become paths relative to the asset. There is no network access.

/// The target of a URI.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// A `data:` URI, decoded.
    Embedded {
        /// The media type, if given.
        mime: Option<String>,
        /// The decoded bytes.
        bytes: Vec<u8>,
    },
    File(PathBuf),
}

/// Resolves a URI reference of the file `asset` to data, or to a file that exists: in the asset's folder unless
/// `allow_external`. Exporters also write plain paths, paths of other systems and absolute paths of other machines.
///
/// # Errors
/// A message with a remedy.
pub(super) fn resolve_uri(uri: &str, asset: &Path, allow_external: bool) -> Result<Target, String> {
    if let Some(rest) = strip_scheme(uri, "data:") {
        return embedded(rest);
    }
    let missing = match files::find_any(asset, &path_candidates(uri), allow_external) {
        Ok(path) => return Ok(Target::File(path)),
        Err(message) => message,
    };
    // Windows drive letters look like schemes of one letter.
    if let Some(scheme) = scheme(uri).filter(|scheme| scheme.len() > 1) {
        return Err(format!(
            "'{}' has the scheme '{scheme}:', but only files in the asset's folder and data: URIs are supported; \
             download the file to that folder",
            shortened(uri)
        ));
    }
    let path = decoded_path(uri);
    if path.is_empty() || path.contains('\0') {
        return Err(format!("'{}' is not a file name", shortened(uri)));
    }
    if !allow_external && files::leads_outside(Path::new(&path)) {
        return Err(format!(
            "'{}' is outside the asset's folder; move the file next to the asset, or permit it by {}",
            shortened(uri),
            Choice::AllowExternal
        ));
    }
    let is_text = percent_decoded(uri.as_bytes()).is_none_or(|bytes| String::from_utf8(bytes).is_ok());
    Err(match is_text {
        true => format!("the file {} is missing", files::relative_to(asset, &path).display()),
        false => format!("'{}' is not UTF-8 after percent decoding, and {missing}", shortened(uri)),
    })
}

/// The percent-decoded path of a URI; text that is no valid URI is returned unchanged.
fn decoded_path(uri: &str) -> String {
    percent_decoded(uri.as_bytes()).and_then(|b| String::from_utf8(b).ok()).unwrap_or_else(|| uri.to_string())
}

/// Paths that a URI may mean, the likeliest first: percent-decoded, as a plain path, and both without query and fragment
/// (`a.png?v=1`, `a.png#x`).
fn path_candidates(uri: &str) -> Vec<String> {
    let path = uri.split(['?', '#']).next().unwrap_or_default();
    let mut interpretations = vec![decoded_path(uri), uri.to_string(), decoded_path(path), path.to_string()];
    interpretations.dedup();
    interpretations
}

/// The URI, truncated for messages.
pub(super) fn shortened(uri: &str) -> String {
    match uri.char_indices().nth(60) {
        Some((cut, _)) => format!("{}...", &uri[..cut]),
        None => uri.to_string(),
    }
}

fn strip_scheme<'a>(uri: &'a str, scheme: &str) -> Option<&'a str> {
    let head = uri.get(..scheme.len())?;
    head.eq_ignore_ascii_case(scheme).then(|| &uri[scheme.len()..])
}

/// The scheme of an absolute URI (RFC 3986, section 3.1).
fn scheme(uri: &str) -> Option<&str> {
    let (scheme, _) = uri.split_once(':')?;
    let mut letters = scheme.chars();
    let starts = letters.next().is_some_and(|c| c.is_ascii_alphabetic());
    (starts && letters.all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))).then_some(scheme)
}

/// The data after `data:` (RFC 2397).
fn embedded(rest: &str) -> Result<Target, String> {
    let (head, payload) = rest.split_once(',').ok_or("the data: URI has no comma before its data")?;
    let (mime, is_base64) = match head.strip_suffix(";base64") {
        Some(mime) => (mime, true),
        None => (head, false),
    };
    let bytes = if is_base64 {
        // Some exporters wrap lines and percent-encode characters.
        let text = percent_decoded(payload.as_bytes()).unwrap_or_else(|| payload.into());
        let text: Vec<u8> = text.into_iter().filter(|byte| !byte.is_ascii_whitespace()).collect();
        base64_decoded(&text).map_err(|e| format!("the data: URI is not valid base64: {e}"))?
    } else {
        percent_decoded(payload.as_bytes()).ok_or("the data: URI has a broken percent sequence")?
    };
    let mime = mime.split(';').next().filter(|m| !m.is_empty()).map(str::to_string);
    Ok(Target::Embedded { mime, bytes })
}

/// Decodes percent sequences (`%41`); `None` for incomplete ones, which the crate would keep.
fn percent_decoded(text: &[u8]) -> Option<Vec<u8>> {
    let has_digits = |rest: &[u8]| rest.get(..2).is_some_and(|d| d.iter().all(u8::is_ascii_hexdigit));
    let is_valid = text.split(|&b| b == b'%').skip(1).all(has_digits);
    is_valid.then(|| percent_decode(text).collect())
}

/// Decodes base64 with or without padding, in the standard or the URL-safe alphabet (RFC 4648, sections 4 and 5).
/// Trailing bits of the last digit are ignored: encoders differ there.
fn base64_decoded(text: &[u8]) -> Result<Vec<u8>, DecodeError> {
    let config = GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true);
    let is_url_safe = text.iter().any(|b| b"-_".contains(b));
    let alphabet = if is_url_safe { &alphabet::URL_SAFE } else { &alphabet::STANDARD };
    GeneralPurpose::new(alphabet, config).decode(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn embedded_bytes(uri: &str) -> Result<Vec<u8>, String> {
        match resolve_uri(uri, Path::new("a.gltf"), false)? {
            Target::Embedded { bytes, .. } => Ok(bytes),
            Target::File(path) => Err(path.display().to_string()),
        }
    }

    #[test]
    fn base64_data_uris_are_decoded() {
        // RFC 4648, section 10.
        let cases = [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg", "foob")];
        for (text, plain) in cases {
            let bytes = embedded_bytes(&format!("data:a/b;base64,{text}")).expect(text);
            assert_eq!(bytes, plain.as_bytes());
        }
        assert_eq!(embedded_bytes("DATA:;base64,_-8="), Ok(vec![0xff, 0xef]));
        assert_eq!(embedded_bytes("data:;base64,Zm9v\r\n Ym%3D%3d\n"), Ok(b"foob".to_vec()));
        for broken in ["data:;base64,Z", "data:;base64,Zm9*", "data:;base64", "data:,%4", "data:;base64,Zm=v"]
        {
            assert!(embedded_bytes(broken).is_err(), "{broken}");
        }
    }

    #[test]
    fn plain_data_uris_have_a_media_type() {
        let target = resolve_uri("data:text/plain;charset=utf-8,a%20b", Path::new("a"), false);
        let mime = Some("text/plain".to_string());
        assert_eq!(target, Ok(Target::Embedded { mime, bytes: b"a b".to_vec() }));
    }

    #[test]
    fn plain_and_foreign_paths_are_resolved() {
        let outer = tempfile::tempdir().expect("a folder");
        let folder = outer.path().join("model");
        std::fs::create_dir_all(folder.join("b c")).expect("made");
        for name in ["b c/d.bin", "50%off.png", "a+b#c.png", "Case.PNG", "../secret.bin"] {
            std::fs::write(folder.join(name), "").expect("written");
        }
        let asset = folder.join("a.gltf");
        let found = |uri: &str| resolve_uri(uri, &asset, false);
        for (uri, name) in [
            ("b%20c/d.bin", "b c/d.bin"),
            ("b%20c/../b c/d.bin", "b c/../b c/d.bin"),
            ("b%20c\\d.bin", "b c/d.bin"),
            ("b c%5Cd.bin", "b c/d.bin"),
            ("b c/d.bin?v=1", "b c/d.bin"),
            ("b%20c/d.bin#x", "b c/d.bin"),
            ("a+b#c.png", "a+b#c.png"),
            ("50%off.png", "50%off.png"),
            ("case.png", "Case.PNG"),
            ("file:///C:/proj/b%20c/d.bin", "b c/d.bin"),
            ("C:\\proj\\b c\\d.bin", "b c/d.bin"),
            ("/home/me/proj/case.png", "Case.PNG"),
            ("../elsewhere/50%off.png", "50%off.png"),
        ] {
            assert_eq!(found(uri), Ok(Target::File(folder.join(name))), "{uri}");
        }
        for (uri, why) in [
            ("../secret.bin", "outside"),
            ("%2e%2e/secret.bin", "outside"),
            ("/etc/passwd", "outside"),
            ("http://a/b", "scheme 'http:'"),
            ("file:///b", "scheme 'file:'"),
            ("%ff", "not UTF-8"),
            ("%zz", "is missing"),
            ("", "is not a file name"),
        ] {
            assert!(found(uri).expect_err(uri).contains(why), "{uri}");
        }
        assert!(resolve_uri("../secret.bin", &asset, true).is_ok());
    }
}
