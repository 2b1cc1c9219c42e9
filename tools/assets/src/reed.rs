//! A reed bending in the wind, as glTF: a small file with an animated skin, a morph target, instancing, quantised vertices,
//! material variants, lights, two cameras and a hidden node.

use crate::json;
use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::{Value, json};
use std::f64::consts::PI;

const FLOAT: u32 = 5126;
const SHORT: u32 = 5122;
const BYTE: u32 = 5121;
const UNSIGNED_SHORT: u32 = 5123;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// Rings of vertices around the stalk, and vertices per ring.
const RINGS: usize = 13;
const SIDES: usize = 8;
/// Height of the stalk, metres; its upper joint is halfway up.
const HEIGHT: f64 = 1.2;
const LEAVES: usize = 6;

/// The buffer with its views and accessors.
#[derive(Default)]
struct Data {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Data {
    /// Adds an accessor with its own bytes; returns its index. Vertices are aligned to four bytes.
    fn add(&mut self, bytes: &[u8], stride: Option<usize>, mut accessor: Value) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        if let Some(stride) = stride {
            view["byteStride"] = json!(stride);
        }
        self.bytes.extend(bytes);
        accessor["bufferView"] = json!(self.views.len());
        self.views.push(view);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Sets the target of a buffer view to vertices or indices.
    fn aim(&mut self, accessor: usize, target: u32) -> usize {
        self.views[accessor]["target"] = json!(target);
        accessor
    }

    /// Vertex data as floats.
    fn vertices<const N: usize>(&mut self, elements: &[[f64; N]]) -> usize {
        let accessor = self.floats(elements);
        self.aim(accessor, VERTICES)
    }

    /// Floats, N per element.
    fn floats<const N: usize>(&mut self, elements: &[[f64; N]]) -> usize {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"].get(N - 1).copied().unwrap_or("MAT4");
        let bytes: Vec<u8> = elements.as_flattened().iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
        let mut accessor = json!({ "componentType": FLOAT, "type": kind, "count": elements.len() });
        if matches!(N, 1 | 3) {
            let extreme = |pick: fn(f32, f32) -> f32| -> Vec<f64> {
                let column = |k: usize| elements.iter().map(move |e| e[k] as f32).reduce(pick);
                (0..N).filter_map(column).map(f64::from).collect()
            };
            accessor["min"] = json!(extreme(f32::min));
            accessor["max"] = json!(extreme(f32::max));
        }
        self.add(&bytes, None, accessor)
    }

    fn indices(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let accessor = json!({ "componentType": UNSIGNED_SHORT, "type": "SCALAR", "count": indices.len() });
        let index = self.add(&bytes, None, accessor);
        self.aim(index, INDICES)
    }
}

/// The asset.
pub fn gltf() -> String {
    let mut data = Data::default();
    let meshes = json!([stalk(&mut data), leaf(&mut data), ground(&mut data)]);
    let bind = inverse_binds(&mut data);
    let instances = leaf_instances(&mut data);
    let animation = animation(&mut data);
    json::pretty(&json!({
        "asset": { "version": "2.0", "generator": "oscura-assets" },
        "extensionsUsed": ["EXT_mesh_gpu_instancing", "KHR_lights_punctual", "KHR_materials_sheen",
            "KHR_materials_variants", "KHR_mesh_quantization", "KHR_node_visibility"],
        "extensionsRequired": ["EXT_mesh_gpu_instancing", "KHR_mesh_quantization"],
        "extensions": {
            "KHR_lights_punctual": { "lights": [
                { "type": "directional", "intensity": 2000 },
                { "type": "spot", "intensity": 1500, "color": [1, 0.8, 0.5],
                  "spot": { "innerConeAngle": 0.3, "outerConeAngle": 0.5 } },
            ] },
            "KHR_materials_variants": { "variants": [{ "name": "summer" }, { "name": "autumn" }] },
        },
        "scene": 0,
        "scenes": [
            { "name": "reed", "nodes": [0, 1, 3, 4, 5, 6, 7, 8], "extras": { "width": 320, "height": 480 } },
            { "name": "leaves", "nodes": [3] },
        ],
        "nodes": [
            { "name": "stalk", "mesh": 0, "skin": 0 },
            { "name": "lower joint", "children": [2] },
            { "name": "upper joint", "translation": [0, HEIGHT / 2.0, 0] },
            { "name": "leaves", "mesh": 1, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": instances } } },
            { "name": "ground", "mesh": 2 },
            { "name": "hidden", "mesh": 2, "translation": [0, 1, 0],
              "extensions": { "KHR_node_visibility": { "visible": false } } },
            { "name": "sun", "rotation": [-0.5, 0.2, 0, 0.842_614_977_317_636],
              "extensions": { "KHR_lights_punctual": { "light": 0 } } },
            { "name": "front", "camera": 0, "translation": [0, 0.65, 2.6] },
            { "name": "top", "camera": 1, "translation": [0, 5, 0],
              "rotation": [-(PI / 4.0).sin(), 0, 0, (PI / 4.0).cos()],
              "extensions": { "KHR_lights_punctual": { "light": 1 } } },
        ],
        "cameras": [
            { "name": "front", "type": "perspective", "perspective": { "yfov": 0.6, "znear": 0.01 } },
            { "name": "top", "type": "orthographic",
              "orthographic": { "xmag": 1, "ymag": 1, "znear": 0, "zfar": 10 } },
        ],
        "meshes": meshes,
        "materials": [
            matte("green", [0.2, 0.45, 0.1]),
            matte("straw", [0.7, 0.5, 0.2]),
            { "name": "felt", "pbrMetallicRoughness":
                { "baseColorFactor": [0.5, 0.4, 0.35, 1], "metallicFactor": 0, "roughnessFactor": 0.9 },
              "extensions": { "KHR_materials_sheen":
                { "sheenColorFactor": [0.3, 0.3, 0.4], "sheenRoughnessFactor": 0.5 } } },
        ],
        "skins": [{ "joints": [1, 2], "skeleton": 1, "inverseBindMatrices": bind }],
        "animations": [animation],
        "accessors": data.accessors,
        "bufferViews": data.views,
        "buffers": [{
            "byteLength": data.bytes.len(),
            "uri": format!("data:application/octet-stream;base64,{}", BASE64_STANDARD.encode(&data.bytes)),
        }],
    }))
}

fn matte(name: &str, [r, g, b]: [f64; 3]) -> Value {
    json!({
        "name": name, "doubleSided": true,
        "pbrMetallicRoughness": { "baseColorFactor": [r, g, b, 1], "metallicFactor": 0, "roughnessFactor": 0.8 },
    })
}

/// Replaced by straw in the variant "autumn".
fn in_variants() -> Value {
    json!({ "KHR_materials_variants": { "mappings": [
        { "material": 0, "variants": [0] }, { "material": 1, "variants": [1] },
    ] } })
}

/// A tapered tube with skin weights from the lower to the upper joint. The morph target is a bulge near the tip.
fn stalk(data: &mut Data) -> Value {
    let (mut positions, mut normals, mut bulge, mut joints, mut weights) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for ring in 0..RINGS {
        let t = ring as f64 / (RINGS - 1) as f64;
        let radius = 0.05 * (1.0 - 0.7 * t);
        let upper = ((t - 0.4) / 0.2).clamp(0.0, 1.0);
        for side in 0..SIDES {
            let turn = side as f64 / SIDES as f64 * 2.0 * PI;
            let out = [turn.cos(), 0.0, -turn.sin()];
            positions.push([radius * out[0], HEIGHT * t, radius * out[2]]);
            normals.push(out);
            let swell = 0.06 * (-((t - 0.85) / 0.08).powi(2)).exp();
            bulge.push(out.map(|x| x * swell));
            joints.extend([0u8, u8::from(upper > 0.0), 0, 0]);
            weights.push([1.0 - upper, upper, 0.0, 0.0]);
        }
    }
    let mut indices = Vec::new();
    for ring in 0..RINGS - 1 {
        for side in 0..SIDES {
            let at = |r: usize, s: usize| (r * SIDES + s % SIDES) as u16;
            let [a, b, c, d] =
                [at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)];
            indices.extend([a, b, c, a, c, d]);
        }
    }
    let vertices = positions.len();
    let joints =
        data.add(&joints, Some(4), json!({ "componentType": BYTE, "type": "VEC4", "count": vertices }));
    let joints = data.aim(joints, VERTICES);
    json!({
        "name": "stalk",
        "weights": [0],
        "primitives": [{
            "attributes": {
                "POSITION": data.vertices(&positions), "NORMAL": data.vertices(&normals),
                "JOINTS_0": joints, "WEIGHTS_0": data.vertices(&weights),
            },
            "indices": data.indices(&indices),
            "targets": [{ "POSITION": data.vertices(&bulge) }],
            "material": 0,
            "extensions": in_variants(),
        }],
    })
}

/// A flat leaf along x as a strip of triangles, in normalised 16-bit integers.
fn leaf(data: &mut Data) -> Value {
    let outline = [[0.0, 0.0], [0.2, 0.06], [0.2, -0.06], [0.6, 0.05], [0.6, -0.05], [1.0, 0.0]];
    let short = |x: f64| ((x * 32767.0).round() as i16).to_le_bytes();
    // Eight bytes per element: three components and two bytes of padding.
    let element = |[x, z]: [f64; 2]| [short(x), short(0.15 * x * x), short(z), [0; 2]].concat();
    let bytes: Vec<u8> = outline.into_iter().flat_map(element).collect();
    let positions = data.add(
        &bytes,
        Some(8),
        json!({ "componentType": SHORT, "normalized": true, "type": "VEC3", "count": outline.len(),
                "min": [0, 0, -1966], "max": [32767, 4915, 1966] }),
    );
    let positions = data.aim(positions, VERTICES);
    json!({
        "name": "leaf",
        "primitives": [{
            "attributes": { "POSITION": positions }, "mode": 5, "material": 0, "extensions": in_variants(),
        }],
    })
}

fn ground(data: &mut Data) -> Value {
    let corners = [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
    json!({
        "name": "ground",
        "primitives": [{
            "attributes": { "POSITION": data.vertices(&corners), "NORMAL": data.vertices(&[[0.0, 1.0, 0.0]; 4]) },
            "indices": data.indices(&[0, 1, 2, 0, 2, 3]), "material": 2,
        }],
    })
}

/// Inverse bind matrices of the joints.
fn inverse_binds(data: &mut Data) -> usize {
    let down = |y: f64| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -y, 0.0, 1.0];
    data.floats(&[down(0.0), down(HEIGHT / 2.0)])
}

/// Leaves around the base of the stalk, each rotated and slightly higher and smaller than the last.
fn leaf_instances(data: &mut Data) -> Value {
    let steps: Vec<f64> = (0..LEAVES).map(|i| i as f64).collect();
    let places: Vec<_> = steps.iter().map(|i| [0.0, 0.05 + 0.06 * i, 0.0]).collect();
    let turns: Vec<_> = steps.iter().map(|i| 2.4 * i / 2.0).map(|a| [0.0, a.sin(), 0.0, a.cos()]).collect();
    let sizes: Vec<_> = steps.iter().map(|i| [0.7 - 0.06 * i; 3]).collect();
    json!({
        "TRANSLATION": data.floats(&places), "ROTATION": data.floats(&turns), "SCALE": data.floats(&sizes),
    })
}

/// Two seconds: the upper joint bends to the right and back, and the bulge grows and shrinks.
fn animation(data: &mut Data) -> Value {
    let bend = |angle: f64| [0.0, 0.0, -(angle / 2.0).sin(), (angle / 2.0).cos()];
    let times = data.floats(&[[0.0], [1.0], [2.0]]);
    let rotations = data.floats(&[bend(0.0), bend(0.9), bend(0.0)]);
    // In-tangent, value and out-tangent of each key.
    let weights = data.floats(&[[0.0], [0.0], [0.0], [0.0], [1.0], [0.0], [0.0], [0.0], [0.0]]);
    json!({
        "name": "wind",
        "channels": [
            { "sampler": 0, "target": { "node": 2, "path": "rotation" } },
            { "sampler": 1, "target": { "node": 0, "path": "weights" } },
        ],
        "samplers": [
            { "input": times, "output": rotations, "interpolation": "LINEAR" },
            { "input": times, "output": weights, "interpolation": "CUBICSPLINE" },
        ],
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn committed_file_is_up_to_date() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/reed.gltf");
        let committed = std::fs::read_to_string(&path).expect("the asset is there");
        assert!(
            committed == super::gltf(),
            "{} differs; write it anew: cargo run -p oscura-assets -- reed assets/reed.gltf",
            path.display()
        );
    }
}
