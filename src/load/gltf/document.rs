//! The JSON document: its objects are taken as the types of the `gltf` crate one by one, when something that is seen
//! needs them. So a broken object that nothing uses does no harm, and each problem has its JSON pointer.

use super::container::Parts;
use super::options::GltfOptions;
use super::report::{Report, Sound};
use crate::load::{LoadOptions, SavedFiles};
use gltf::json::accessor::ComponentType;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::borrow::Cow;
use std::cell::{Cell, OnceCell};
use std::path::Path;

/// A glTF file in memory.
pub(super) struct Document<'a> {
    /// The file.
    pub path: &'a Path,
    /// The whole JSON.
    pub json: Value,
    /// The binary chunk of a GLB.
    pub binary: Option<Cow<'a, [u8]>>,
    /// May URIs lead out of the asset's folder?
    pub allow_external: bool,
    /// Is told which files are read.
    pub files: &'a SavedFiles,
    /// What the user chose.
    pub options: &'a GltfOptions,
    /// The contents of each buffer, once read.
    pub(super) buffers: Vec<OnceCell<Sound<Cow<'a, [u8]>>>>,
    /// The contents of compressed buffer views, once decoded.
    pub(super) views: Vec<OnceCell<Sound<Vec<u8>>>>,
    /// The contents of accessors that compressed primitives bring along, once decoded.
    pub(super) accessors: Vec<OnceCell<Unpacked>>,
    /// Bytes of all the files read so far.
    read: Cell<u64>,
    /// Bytes that accessors were decoded into.
    decoded: Cell<u64>,
}

/// What a compressed primitive holds for an accessor: elements without gaps.
pub(super) struct Unpacked {
    /// The elements.
    pub bytes: Vec<u8>,
    /// Their number.
    pub count: usize,
    /// What their components are stored as.
    pub component: ComponentType,
}

/// Decoded bytes that any file may take.
const FREE_BUDGET: u64 = 1 << 28;
/// Decoded bytes for each byte read: accessors may be used again, which must not let a small file fill the memory.
const BUDGET_PER_BYTE: u64 = 64;

impl<'a> Document<'a> {
    /// A document of a file of `size` bytes.
    pub fn new(path: &'a Path, parts: Parts<'a>, size: usize, options: &'a LoadOptions) -> Document<'a> {
        let Parts { json, binary } = parts;
        let count = |list: &str| json.get(list).and_then(Value::as_array).map_or(0, Vec::len);
        let buffers = (0..count("buffers")).map(|_| OnceCell::new()).collect();
        let views = (0..count("bufferViews")).map(|_| OnceCell::new()).collect();
        let accessors = (0..count("accessors")).map(|_| OnceCell::new()).collect();
        let (read, decoded) = (Cell::new(size as u64), Cell::new(0));
        let (allow_external, files, options) = (options.allow_external, &options.files, &options.gltf);
        Document {
            path,
            json,
            binary,
            allow_external,
            files,
            options,
            buffers,
            views,
            accessors,
            read,
            decoded,
        }
    }

    /// Notes that another file of this many bytes was read.
    pub fn note_read(&self, bytes: usize) {
        self.read.set(self.read.get().saturating_add(bytes as u64));
    }

    /// Bytes of all the files read so far.
    pub fn bytes_read(&self) -> u64 {
        self.read.get()
    }

    /// Announces that accessors are decoded into this many bytes; false if the file can't justify them.
    pub fn may_decode(&self, bytes: u64) -> bool {
        let total = self.decoded.get().saturating_add(bytes);
        let allowed = FREE_BUDGET.saturating_add(self.read.get().saturating_mul(BUDGET_PER_BYTE));
        if total <= allowed {
            self.decoded.set(total);
        }
        total <= allowed
    }

    /// Starts with another moment of the file: what the last one decoded is gone, or kept and not decoded again.
    pub fn begin_moment(&self) {
        self.decoded.set(0);
    }

    /// Is the file written by Blender's exporter?
    pub fn is_from_blender(&self) -> bool {
        let generator = self.json.pointer("/asset/generator").and_then(Value::as_str);
        generator.is_some_and(|g| g.contains("Blender I/O"))
    }

    /// Is it what oscura exported of a file of Blender? Nothing was lost then, and all glass is solid but for what says otherwise.
    pub fn is_our_export(&self) -> bool {
        let generator = self.json.pointer("/asset/generator").and_then(Value::as_str);
        self.is_from_blender() && generator.is_some_and(|g| g.ends_with("oscura"))
    }

    /// A JSON pointer in words, where it leads to something that has a name, or into it.
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

    /// How many entries a list of the document has; `list` is its pointer without the leading slash.
    pub fn count(&self, list: &str) -> usize {
        self.list(list).map_or(0, Vec::len)
    }

    fn list(&self, list: &str) -> Option<&Vec<Value>> {
        self.json.pointer(&format!("/{list}")).and_then(Value::as_array)
    }

    /// The object at an index of a list, as it stands in the file; `from` points to what refers to it.
    pub fn raw(&self, list: &str, index: usize, from: &str, report: &mut Report) -> Sound<&Value> {
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
    ) -> Sound<T> {
        let raw = self.raw(list, index, from, report)?;
        T::deserialize(raw)
            .map_err(|e| report.problem(pointer(list, index), format!("can't be understood: {e}")))
    }
}

/// The names of all entries of a list; empty for those without.
pub(super) fn names_of(doc: &Document, list: &str) -> Vec<String> {
    let name = |entry: &Value| entry.get("name").and_then(Value::as_str).unwrap_or_default().to_string();
    doc.list(list).into_iter().flatten().map(name).collect()
}

/// The JSON pointer of an entry of a list.
pub(super) fn pointer(list: &str, index: usize) -> String {
    format!("/{list}/{index}")
}

/// A list of indices held by an object; entries that are none are problems.
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

/// An optional index held by an object of the document.
pub(super) fn index_of(object: &Value, key: &str, at: &str, report: &mut Report) -> Sound<Option<usize>> {
    let index = |v: &Value| v.as_u64().and_then(|i| usize::try_from(i).ok());
    optional(object, key, at, "an index", index, report)
}

/// Optional numbers held by an object, in full precision.
pub(super) fn numbers_of<const N: usize>(
    object: &Value,
    key: &str,
    at: &str,
    report: &mut Report,
) -> Sound<Option<[f64; N]>> {
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

/// An optional number held by an object.
pub(super) fn number_of(object: &Value, key: &str, at: &str, report: &mut Report) -> Sound<Option<f64>> {
    optional(object, key, at, "a number", Value::as_f64, report)
}

fn optional<T>(
    object: &Value,
    key: &str,
    at: &str,
    what: &str,
    convert: impl Fn(&Value) -> Option<T>,
    report: &mut Report,
) -> Sound<Option<T>> {
    let Some(value) = object.get(key) else { return Ok(None) };
    let value = convert(value);
    if value.is_none() {
        return Err(report.problem(format!("{at}/{key}"), format!("is not {what}")));
    }
    Ok(value)
}

/// What an object must hold: the value of [`index_of`] and its like.
pub(super) fn required<T>(value: Sound<Option<T>>, key: &str, at: &str, report: &mut Report) -> Sound<T> {
    value?.ok_or_else(|| report.problem(format!("{at}/{key}"), "is missing"))
}

/// The name of an object, or a stand-in made of its kind and index.
pub(super) fn name_of(object: &Value, kind: &str, index: usize) -> String {
    match object.get("name").and_then(Value::as_str).filter(|n| !n.is_empty()) {
        Some(name) => name.to_string(),
        None => format!("{kind} {index}"),
    }
}
