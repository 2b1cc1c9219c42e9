//! Small generated files.

use crate::files::load_files_by;
use oscura::error::Error;
use oscura::load::{LoadOptions, Loaded, load};
use oscura::scene::Scene;
use serde_json::{Value, json};
use std::path::Path;

/// Three positions as floats, then the indices 0 1 2 as 16-bit integers and two bytes of padding: 44 bytes.
pub fn triangle_bytes() -> Vec<u8> {
    let mut bytes = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    bytes.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    bytes
}

pub fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// One triangle in `a.bin`, referenced by one node.
pub fn triangle() -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"name": "grey"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 3}
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6}
        ],
        "buffers": [{"byteLength": 44, "uri": "a.bin"}]
    })
}

/// The triangle, modified.
pub fn triangle_with(change: impl FnOnce(&mut Value)) -> Value {
    let mut asset = triangle();
    change(&mut asset);
    asset
}

/// A mesh without indices over the floats and more bytes of `a.bin`.
pub fn corners(count: usize, bytes: usize) -> Value {
    triangle_with(|a| {
        a["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0}});
        a["accessors"][0]["count"] = json!(count);
        a["bufferViews"][0]["byteLength"] = json!(count * 12);
        a["bufferViews"][1]["byteOffset"] = json!(0);
        a["buffers"][0]["byteLength"] = json!(bytes);
    })
}

/// Loads `a.gltf` with files next to it.
pub fn load_with(asset: &Value, files: &[(&str, &[u8])]) -> Result<Loaded, Error> {
    load_by(asset, files, &LoadOptions::default())
}

/// The same with options.
pub fn load_by(asset: &Value, files: &[(&str, &[u8])], options: &LoadOptions) -> Result<Loaded, Error> {
    let text = asset.to_string();
    load_files_by(&[&[("a.gltf", text.as_bytes())], files].concat(), options)
}

/// Loads an asset over the triangle's bytes.
pub fn load_triangle(asset: &Value) -> Result<Loaded, Error> {
    load_with(asset, &[("a.bin", &triangle_bytes())])
}

/// The scene of an asset that must load.
pub fn scene(asset: &Value, bytes: &[u8]) -> Scene {
    load_with(asset, &[("a.bin", bytes)]).unwrap_or_else(|e| panic!("{e}")).scene
}

/// The message of an asset that must not load.
pub fn refusal(asset: &Value) -> String {
    match load_triangle(asset) {
        Ok(_) => panic!("it loads: {asset}"),
        Err(e) => format!("{e} [{}]", e.problems[0].code),
    }
}

pub fn open(path: &Path) -> Result<Loaded, Error> {
    load(path, &LoadOptions::default())
}

/// The binary container around an asset and its buffer.
pub fn glb(asset: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = asset.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + text.len() + 8 + binary.len();
    let mut bytes = b"glTF".to_vec();
    let word = |n: usize| (n as u32).to_le_bytes();
    bytes.extend([word(2), word(total), word(text.len())].concat());
    bytes.extend(b"JSON");
    bytes.extend(text);
    bytes.extend(word(binary.len()));
    bytes.extend(b"BIN\0");
    bytes.extend(binary);
    bytes
}
