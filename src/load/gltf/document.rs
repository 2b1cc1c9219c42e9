//! The JSON document. Objects are parsed one by one into types of the `gltf` crate, on demand: broken objects that
//! nothing visible uses do no harm, and each problem has its JSON pointer.

use super::report::{Report, Valid};
use crate::error::{Choice, Error, Problem, Result};
use crate::load::decoders::Decoder;
use crate::load::options::GltfOptions;
use crate::load::words::{is_nan_word, is_utf_16};
use crate::load::{LoadOptions, WatchedFiles};
use gltf::json::accessor::ComponentType;
use gltf::{Glb, binary};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::borrow::Cow;
use std::cell::{Cell, OnceCell};
use std::collections::BTreeMap;
use std::path::Path;

/// A glTF file in memory.
pub(super) struct Document<'a> {
    /// Path of the file.
    pub path: &'a Path,
    /// The whole JSON.
    pub json: Value,
    /// The binary chunk of a GLB.
    pub binary: Option<Cow<'a, [u8]>>,
    /// Whether URIs may refer to files outside the asset's folder.
    pub allow_external: bool,
    /// Records the files read.
    pub files: &'a WatchedFiles,
    pub options: &'a GltfOptions,
    /// Maximum size of one decoded image, bytes.
    pub memory_limit: Option<u64>,
    /// The contents of each buffer, once read.
    pub(super) buffers: Vec<OnceCell<Valid<Cow<'a, [u8]>>>>,
    /// The contents of compressed buffer views, once decoded.
    pub(super) views: Vec<OnceCell<Valid<Vec<u8>>>>,
    /// The elements of accessors of compressed primitives, once decoded.
    pub(super) accessors: Vec<OnceCell<DecodedAccessor>>,
    /// Bytes read from all files so far.
    read: Cell<u64>,
    /// Bytes of accessors decoded so far.
    decoded: Cell<u64>,
}

/// The elements of an accessor of a compressed primitive, tightly packed.
pub(super) struct DecodedAccessor {
    pub bytes: Vec<u8>,
    /// Number of elements.
    pub count: usize,
    /// Type of the stored components.
    pub component: ComponentType,
}

/// Decoding budget of any file, bytes.
const FREE_BUDGET: u64 = 1 << 28;
/// Additional decoding budget per byte read. Limits small files that use their accessors many times.
const BUDGET_PER_BYTE: u64 = 64;

impl<'a> Document<'a> {
    /// Creates the document of a file of `size` bytes.
    pub fn new(path: &'a Path, parts: Parts<'a>, size: usize, options: &'a LoadOptions) -> Document<'a> {
        let Parts { json, binary, .. } = parts;
        let count = |list: &str| json.get(list).and_then(Value::as_array).map_or(0, Vec::len);
        let buffers = (0..count("buffers")).map(|_| OnceCell::new()).collect();
        let views = (0..count("bufferViews")).map(|_| OnceCell::new()).collect();
        let accessors = (0..count("accessors")).map(|_| OnceCell::new()).collect();
        let (read, decoded) = (Cell::new(size as u64), Cell::new(0));
        let (allow_external, memory_limit) = (options.allow_external, options.memory_limit);
        let (files, options) = (&options.files, &options.gltf);
        Document {
            path,
            json,
            binary,
            allow_external,
            files,
            options,
            memory_limit,
            buffers,
            views,
            accessors,
            read,
            decoded,
        }
    }

    /// Counts the bytes of another file.
    pub fn note_read(&self, bytes: usize) {
        self.read.set(self.read.get().saturating_add(bytes as u64));
    }

    /// Bytes read from all files so far.
    pub fn bytes_read(&self) -> u64 {
        self.read.get()
    }

    /// Reserves bytes of the decoding budget; false if it is exhausted.
    pub fn may_decode(&self, bytes: u64) -> bool {
        let total = self.decoded.get().saturating_add(bytes);
        let allowed = FREE_BUDGET.saturating_add(self.read.get().saturating_mul(BUDGET_PER_BYTE));
        if total <= allowed {
            self.decoded.set(total);
        }
        total <= allowed
    }

    /// Begins another time sample with a new decoding budget.
    pub fn begin_time(&self) {
        self.decoded.set(0);
    }

    /// Whether Blender's exporter wrote the file.
    pub fn is_from_blender(&self) -> bool {
        let generator = self.json.pointer("/asset/generator").and_then(Value::as_str);
        generator.is_some_and(|g| g.contains("Blender I/O"))
    }

    /// Describes a JSON pointer by the name of the object that it refers to, if there is one: `material 'a', field`.
    pub fn in_names(&self, pointer: &str) -> String {
        const LISTS: [(&str, &str); 8] = [
            ("/materials/", "material"),
            ("/nodes/", "node"),
            ("/meshes/", "mesh"),
            ("/images/", "image"),
            ("/cameras/", "camera"),
            ("/animations/", "animation"),
            ("/extensions/KHR_lights_punctual/lights/", "light"),
            ("/extensions/EXT_lights_area/lights/", "area light"),
        ];
        let named = LISTS.iter().find_map(|(list, kind)| {
            let rest = pointer.strip_prefix(list)?;
            let (index, inside) = rest.split_once('/').unwrap_or((rest, ""));
            let name =
                self.json.pointer(&format!("{list}{index}/name"))?.as_str().filter(|n| !n.is_empty())?;
            Some(match inside {
                "" => format!("{kind} '{name}'"),
                inside => format!("{kind} '{name}', {inside}"),
            })
        });
        named.unwrap_or_else(|| pointer.to_string())
    }

    /// Number of entries of a list; `list` is its JSON pointer without the leading slash.
    pub fn count(&self, list: &str) -> usize {
        self.list(list).map_or(0, Vec::len)
    }

    fn list(&self, list: &str) -> Option<&Vec<Value>> {
        self.json.pointer(&format!("/{list}")).and_then(Value::as_array)
    }

    /// The raw JSON object at an index of a list; `from` is the JSON pointer of the reference to it.
    pub fn raw(&self, list: &str, index: usize, from: &str, report: &mut Report) -> Valid<&Value> {
        match self.list(list).and_then(|l| l.get(index)) {
            Some(value) if value.is_object() => Ok(value),
            Some(_) => Err(report.problem(pointer(list, index), "is not an object")),
            None => {
                let message = format!("refers to /{list}/{index}, but there are {}", self.count(list));
                Err(report.problem(from, message))
            }
        }
    }

    /// The object at an index of a list as a type of the `gltf` crate.
    pub fn entry<T: DeserializeOwned>(
        &self,
        list: &str,
        index: usize,
        from: &str,
        report: &mut Report,
    ) -> Valid<T> {
        let raw = self.raw(list, index, from, report)?;
        T::deserialize(raw).map_err(|e| report.problem(pointer(list, index), format!("can't be parsed: {e}")))
    }
}

/// The names of all entries of a list; empty for unnamed ones.
pub(super) fn names_of(doc: &Document, list: &str) -> Vec<String> {
    let name = |entry: &Value| entry.get("name").and_then(Value::as_str).unwrap_or_default().to_string();
    doc.list(list).into_iter().flatten().map(name).collect()
}

/// The JSON pointer of an entry of a list.
pub(super) fn pointer(list: &str, index: usize) -> String {
    format!("/{list}/{index}")
}

/// A list of indices of an object; invalid entries are reported.
pub(super) fn list_of_indices(object: &Value, key: &str, at: &str, report: &mut Report) -> Vec<usize> {
    let Some(value) = object.get(key) else { return Vec::new() };
    let Some(list) = value.as_array() else {
        report.problem(format!("{at}/{key}"), "is not a list of indices");
        return Vec::new();
    };
    let mut indices = Vec::with_capacity(list.len());
    for (i, value) in list.iter().enumerate() {
        match value.as_u64().and_then(|v| usize::try_from(v).ok()) {
            Some(index) => indices.push(index),
            None => {
                report.problem(format!("{at}/{key}/{i}"), "is not an index");
            }
        }
    }
    indices
}

/// An optional index of an object.
pub(super) fn index_of(object: &Value, key: &str, at: &str, report: &mut Report) -> Valid<Option<usize>> {
    let index = |v: &Value| v.as_u64().and_then(|i| usize::try_from(i).ok());
    optional(object, key, at, "an index", index, report)
}

/// An optional list of N numbers of an object, in f64.
pub(super) fn numbers_of<const N: usize>(
    object: &Value,
    key: &str,
    at: &str,
    report: &mut Report,
) -> Valid<Option<[f64; N]>> {
    let numbers = |value: &Value| {
        let list = value.as_array().filter(|a| a.len() == N)?;
        let mut numbers = [0.0; N];
        for (number, value) in numbers.iter_mut().zip(list) {
            *number = value.as_f64()?;
        }
        Some(numbers)
    };
    optional(object, key, at, &format!("a list of {N} numbers"), numbers, report)
}

/// An optional number of an object.
pub(super) fn number_of(object: &Value, key: &str, at: &str, report: &mut Report) -> Valid<Option<f64>> {
    optional(object, key, at, "a number", Value::as_f64, report)
}

fn optional<T>(
    object: &Value,
    key: &str,
    at: &str,
    what: &str,
    convert: impl Fn(&Value) -> Option<T>,
    report: &mut Report,
) -> Valid<Option<T>> {
    let Some(value) = object.get(key) else { return Ok(None) };
    let value = convert(value);
    if value.is_none() {
        return Err(report.problem(format!("{at}/{key}"), format!("is not {what}")));
    }
    Ok(value)
}

/// Makes an optional value, as of [`index_of`], required.
pub(super) fn required<T>(value: Valid<Option<T>>, key: &str, at: &str, report: &mut Report) -> Valid<T> {
    value?.ok_or_else(|| report.problem(format!("{at}/{key}"), "is missing"))
}

/// The name of an object; if unnamed, its kind and index.
pub(super) fn name_of(object: &Value, kind: &str, index: usize) -> String {
    match object.get("name").and_then(Value::as_str).filter(|n| !n.is_empty()) {
        Some(name) => name.to_string(),
        None => format!("{kind} {index}"),
    }
}

// The binary container (GLB) and the JSON text.

/// First four bytes of a GLB file.
const MAGIC: &[u8] = b"glTF";
/// Size of the file header, bytes.
const HEADER: usize = 12;

/// The parts of a glTF file.
pub(super) struct Parts<'a> {
    /// The JSON document, an object.
    pub json: Value,
    /// The binary chunk of a GLB.
    pub binary: Option<Cow<'a, [u8]>>,
    /// Number of invalid numbers (`NaN`, `Infinity`) that were replaced by 0.
    pub repaired: usize,
}

/// Replaces words for non-finite numbers in JSON (`NaN`, `-nan(ind)`, `1.#QNAN`, `Infinity`) by 0; returns their number.
fn replace_non_finite(text: &[u8]) -> (Vec<u8>, usize) {
    let (mut out, mut count, mut at) = (Vec::with_capacity(text.len()), 0, 0);
    let is_end = |b: &u8| b.is_ascii_whitespace() || b",]}:{[\"".contains(b);
    while let Some(&byte) = text.get(at) {
        let length = match byte {
            b'"' => string_length(&text[at..]),
            _ if is_end(&byte) => 1,
            _ => text[at..].iter().position(is_end).unwrap_or(text.len() - at),
        };
        let word = &text[at..at + length];
        let unsigned = word.strip_prefix(b"-").unwrap_or(word).to_ascii_lowercase();
        let is_non_finite = is_nan_word(word) || matches!(&unsigned[..], b"infinity" | b"inf" | b"1.#inf");
        count += usize::from(is_non_finite);
        out.extend(if is_non_finite { b"0" } else { word });
        at += length;
    }
    (out, count)
}

/// Length of a JSON string, quotation marks included.
fn string_length(text: &[u8]) -> usize {
    let mut at = 1;
    while let Some(&byte) = text.get(at) {
        at += if byte == b'\\' { 2 } else { 1 };
        if byte == b'"' {
            break;
        }
    }
    at.min(text.len())
}

/// Splits a `.gltf` or `.glb` file, distinguished by content, into JSON and binary chunk.
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
    let (json, repaired): (Value, usize) = match serde_json::from_slice(text) {
        Ok(json) => (json, 0),
        Err(e) => {
            let (repaired, count) = replace_non_finite(text);
            let json = serde_json::from_slice(&repaired).ok().filter(|_| count > 0);
            let broken = || Error::input(path, format!("is not a glTF file: its JSON can't be read: {e}"));
            (json.ok_or_else(broken)?, count)
        }
    };
    if !json.is_object() {
        return Err(Error::input(path, "is not a glTF file: its JSON is not an object"));
    }
    Ok(Parts { json, binary, repaired })
}

/// The JSON chunk and the binary chunk.
type Chunks<'a> = (Cow<'a, [u8]>, Option<Cow<'a, [u8]>>);

/// Splits a GLB into its chunks (glTF 2.0, section 4.4). Further chunks are skipped, as the specification requires; so is
/// a second chunk of unknown type, which the crate rejects.
fn chunks<'a>(path: &Path, bytes: &'a [u8]) -> Result<Chunks<'a>> {
    let fail = |message: String| Error::input(path, format!("is a damaged GLB: {message}"));
    // The crate doesn't check this length: it underflows below the header's size and reads beyond the end of the file.
    let length = bytes.get(8..HEADER).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let Some(length) = length.map(|length| length as usize) else {
        return Err(fail(format!("it ends after {} bytes, inside its header", bytes.len())));
    };
    if length > bytes.len() {
        let held = bytes.len();
        return Err(fail(format!(
            "its header declares {length} bytes, but there are {held}: it is truncated"
        )));
    }
    if length < HEADER {
        return Err(fail(format!("its header declares {length} bytes, fewer than the header itself")));
    }
    let file = &bytes[..length];
    let error = match Glb::from_slice(file) {
        Ok(glb) => return Ok((glb.json, glb.bin)),
        Err(gltf::Error::Binary(error)) => error,
        Err(other) => return Err(fail(other.to_string())),
    };
    Err(match error {
        binary::Error::Version(version) => Error::input(path, format!("is a GLB of version {version}"))
            .with_help("only glTF 2.0 is supported; convert the file"),
        binary::Error::UnknownChunkType(_) if file.get(16..20) == Some(b"JSON") => {
            let end = file[12..16].try_into().map_or(0, u32::from_le_bytes) as usize;
            return Ok((file[20..20 + end].into(), None));
        }
        binary::Error::UnknownChunkType(kind) => {
            fail(format!("its first chunk has the type '{}', not JSON", kind.escape_ascii()))
        }
        binary::Error::ChunkLength { ty, length, length_read } => {
            fail(format!("its {ty:?} chunk declares {length} bytes, but {length_read} are left"))
        }
        binary::Error::ChunkType(ty) => fail(format!("a {ty:?} chunk is out of place")),
        binary::Error::Io(_) => fail(format!("it ends after {length} bytes, inside the header of a chunk")),
        other => fail(other.to_string()),
    })
}

// Versions and extensions.

/// Supported extensions; some need an optional decoder.
const SUPPORTED: &[&str] = &[
    "EXT_lights_area",
    "EXT_lights_ies",
    "EXT_lights_image_based",
    "EXT_mesh_gpu_instancing",
    "EXT_mesh_primitive_restart",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_gaussian_splatting",
    "KHR_gaussian_splatting_compression_spz",
    "KHR_gaussian_splatting_compression_spz_2",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_roughness",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_scatter",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_materials_volume_scatter",
    "KHR_mesh_primitive_restart",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_spz_gaussian_splats_compression",
    "KHR_texture_basisu",
    "KHR_texture_transform",
];

/// Unsupported extensions that may be required: the picture doesn't depend on them. With the effect of ignoring them.
const HARMLESS: &[(&str, &str)] = &[("KHR_xmp_json_ld", "metadata is ignored")];

/// Extensions for interaction, ignored without a warning.
const INTERACTIVITY: &[&str] = &["KHR_interactivity", "KHR_node_hoverability", "KHR_node_selectability"];

impl Document<'_> {
    /// Whether the file declares the use of an extension.
    pub fn extension_used(&self, name: &str) -> bool {
        self.lists("extensionsUsed", name)
    }

    /// Whether the file requires an extension.
    #[cfg(not(feature = "draco"))]
    pub fn extension_required(&self, name: &str) -> bool {
        self.lists("extensionsRequired", name)
    }

    fn lists(&self, key: &str, name: &str) -> bool {
        let list = self.json.get(key).and_then(Value::as_array);
        list.is_some_and(|list| list.iter().any(|v| v.as_str() == Some(name)))
    }
}

/// Whether this build supports an extension.
pub(super) fn is_supported(name: &str) -> bool {
    SUPPORTED.contains(&name) && missing_decoder(name).is_none()
}

/// The decoder that an extension needs and this build lacks.
fn missing_decoder(name: &str) -> Option<Decoder> {
    let decoder = match name {
        "EXT_texture_webp" => Decoder::WebP,
        "KHR_draco_mesh_compression" => Decoder::Draco,
        "KHR_texture_basisu" => Decoder::Ktx2,
        _ => return None,
    };
    (!decoder.is_built_in()).then_some(decoder)
}

/// Checks the version and the required extensions.
pub(super) fn check(doc: &Document, report: &mut Report) {
    let asset = doc.json.get("asset").unwrap_or(&Value::Null);
    let major = |key: &str| asset.get(key).and_then(Value::as_str).map(|v| v.split('.').next() == Some("2"));
    match (major("version"), asset.get("minVersion").and_then(Value::as_str)) {
        (Some(true), None | Some("2.0")) => {}
        (None, _) => {
            report.problem("/asset/version", "is missing: this is not a glTF 2.0 file");
        }
        _ => {
            let problem = Problem::new("/asset/version", "is not 2.0");
            report.add(problem.with_help("only glTF 2.0 is supported; convert the file"));
        }
    }
    let Some(required) = doc.json.get("extensionsRequired") else { return };
    let Some(required) = required.as_array() else {
        report.problem("/extensionsRequired", "is not a list of names");
        return;
    };
    for (i, name) in required.iter().enumerate() {
        let at = pointer("extensionsRequired", i);
        match name.as_str() {
            None => {
                report.problem(at, "is not a name");
            }
            Some(name) if is_supported(name) || HARMLESS.iter().any(|(h, _)| *h == name) => {}
            Some(name) if INTERACTIVITY.contains(&name) => {}
            Some(name) => {
                let (reason, remedy) = match missing_decoder(name) {
                    Some(decoder) => (format!(": {}", decoder.missing_message()), decoder.remedy()),
                    None => (", which is not supported".into(), "export it without this extension".into()),
                };
                let message = format!("the file requires {name}{reason}");
                if doc.options.force {
                    report.warn(at, format!("{message}; ignored by {}", Choice::Force));
                } else {
                    let help = format!("{remedy}, or ignore it by {}", Choice::Force);
                    report.add(Problem::new(at, message).with_help(help));
                }
            }
        }
    }
}

/// Reports an object's `extensions`, or supported extensions therein, that aren't JSON objects.
pub(super) fn check_shape(object: &Value, at: &str, report: &mut Report) {
    let Some(extensions) = object.get("extensions") else { return };
    let Some(all) = extensions.as_object() else {
        report.problem(format!("{at}/extensions"), "is not an object");
        return;
    };
    for (name, _) in all.iter().filter(|(name, e)| SUPPORTED.contains(&name.as_str()) && !e.is_object()) {
        report.problem(format!("{at}/extensions/{name}"), "is not an object");
    }
}

/// Warns of each unsupported extension, with the number of uses.
pub(super) fn warn_of_unsupported(doc: &Document, report: &mut Report) {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    count(&doc.json, &mut counts);
    for (name, places) in counts.into_iter().filter(|(name, _)| needs_warning(name)) {
        let harmless = HARMLESS.iter().find(|(h, _)| *h == name).map(|(_, effect)| effect.to_string());
        let lack = || {
            missing_decoder(name)
                .map(|decoder| format!("{}; {}", decoder.missing_message(), decoder.remedy()))
        };
        let effect = harmless.or_else(lack).map_or(String::new(), |effect| format!(": {effect}"));
        let times = if places == 1 { "one place".to_string() } else { format!("{places} places") };
        report.warn("", format!("{name} is not supported, in {times}{effect}"));
    }
}

/// Whether ignoring an extension needs a warning.
fn needs_warning(name: &str) -> bool {
    !is_supported(name) && !INTERACTIVITY.contains(&name)
}

/// Counts the extensions in objects; the parser bounds the depth.
fn count<'v>(value: &'v Value, counts: &mut BTreeMap<&'v str, usize>) {
    match value {
        Value::Object(object) => {
            for (key, child) in object {
                match child.as_object().filter(|_| key == "extensions") {
                    Some(extensions) => {
                        for (name, extension) in extensions {
                            *counts.entry(name).or_default() += 1;
                            count(extension, counts);
                        }
                    }
                    None if key == "extras" => {}
                    None => count(child, counts),
                }
            }
        }
        Value::Array(list) => list.iter().for_each(|child| count(child, counts)),
        _ => {}
    }
}
