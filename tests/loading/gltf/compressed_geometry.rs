//! Compressed, quantised and instanced geometry.
// Tests of optional decoders use some of this.
#![cfg_attr(not(feature = "decoders"), allow(unused_imports, dead_code))]

use super::asset::{floats, load_with, triangle, triangle_bytes, triangle_with};
use oscura::load::Loaded;
use oscura::math::DVec3;
use serde_json::{Value, json};

/// A version 0 attribute stream with all deltas as whole bytes.
fn attribute_stream(elements: &[u8], stride: usize) -> Vec<u8> {
    let mut stream = vec![0xa0];
    for k in 0..stride {
        let mut last = 0u8;
        let mut deltas = Vec::new();
        for element in elements.chunks(stride) {
            let d = element[k].wrapping_sub(last);
            deltas.push(if d < 128 { d << 1 } else { !(d << 1) });
            last = element[k];
        }
        deltas.resize(16, 0);
        stream.push(3);
        stream.extend(deltas);
    }
    stream.extend(vec![0; stride.max(32)]);
    stream
}

/// The triangle with meshopt-compressed vertices and indices, under one of the extension's two names.
fn meshopt(name: &str) -> (Value, Vec<u8>) {
    let corners = attribute_stream(&triangle_bytes()[..36], 12);
    // Indices 0, 1, 2: deltas 0, 1, 1.
    let indices = [0xd1, 0, 4, 4, 0, 0, 0, 0];
    let mut asset = triangle();
    let packed = |offset: usize, length: usize, stride: usize, mode: &str| {
        json!({name: {"buffer": 0, "byteOffset": offset, "byteLength": length, "byteStride": stride,
                      "count": 3, "mode": mode}})
    };
    asset["extensionsRequired"] = json!([name]);
    let bytes = [&corners[..], &indices].concat();
    asset["buffers"] = json!([{"byteLength": bytes.len(), "uri": "a.bin"}, {"byteLength": 42}]);
    asset["bufferViews"] = json!([
        {"buffer": 1, "byteLength": 36, "byteStride": 12,
         "extensions": packed(0, corners.len(), 12, "ATTRIBUTES")},
        {"buffer": 1, "byteOffset": 36, "byteLength": 6,
         "extensions": packed(corners.len(), indices.len(), 2, "INDICES")}
    ]);
    (asset, bytes)
}

fn same_triangle(loaded: &Loaded) {
    let mesh = &loaded.scene.meshes[0];
    assert_eq!(mesh.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
}

#[test]
fn meshopt_views_match_uncompressed_ones() {
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let (asset, bytes) = meshopt(name);
        same_triangle(&load_with(&asset, &[("a.bin", &bytes)]).unwrap_or_else(|e| panic!("{e}")));
    }
}

#[test]
fn damaged_meshopt_views_are_reported() {
    let (asset, bytes) = meshopt("EXT_meshopt_compression");
    let at = "/bufferViews/0/extensions/EXT_meshopt_compression";
    type Change = fn(&mut Value);
    let cases: &[(Change, &str)] = &[
        (|p| p["byteLength"] = json!(100), "decompressed"),
        (|p| p["byteLength"] = json!(10_000), "its buffer has"),
        (|p| p["buffer"] = json!(7), "/buffers/7"),
        (|p| p["count"] = json!(1u64 << 40), "justifies"),
        (|p| p["count"] = json!(16), "for a bufferView of 36"),
        (|p| p["byteStride"] = json!(10), "don't fit"),
        (|p| p["mode"] = json!("TRIANGLES"), "don't fit"),
        (|p| p["mode"] = json!("NONE"), "/mode"),
        (|p| p["filter"] = json!("OCTAHEDRAL"), "don't fit"),
        (|p| p["filter"] = json!("ACME"), "ACME"),
        // Required properties, missing or not numbers.
        (|p| drop(p.as_object_mut().expect("an object").remove("buffer")), "/buffer: is missing"),
        (|p| drop(p.as_object_mut().expect("an object").remove("byteLength")), "/byteLength: is missing"),
        (|p| drop(p.as_object_mut().expect("an object").remove("byteStride")), "/byteStride: is missing"),
        (|p| drop(p.as_object_mut().expect("an object").remove("count")), "/count: is missing"),
        (|p| p["count"] = json!("many"), "/count: is not an index"),
        (|p| p["byteOffset"] = json!(-4), "/byteOffset: is not an index"),
    ];
    for (change, word) in cases {
        let mut asset = asset.clone();
        change(asset.pointer_mut(at).expect("the extension"));
        let message = load_with(&asset, &[("a.bin", &bytes)]).expect_err("it is broken").to_string();
        assert!(
            message.contains(word) && message.contains("/bufferViews/0"),
            "'{word}' is not in: {message}"
        );
    }
    // Each byte changed: an error or a triangle, never a panic.
    for at in 0..bytes.len() {
        let mut bytes = bytes.clone();
        bytes[at] ^= 0x5a;
        let _ = load_with(&asset, &[("a.bin", &bytes)]);
    }
}

/// A grid of 8 x 8 squares with texture coordinates: vertices at integer x and y, and coordinates of an eighth of those. The
/// file was encoded by draco-core 2.3.3 with its default options; building that encoder for the tests would build the program a
/// second time.
#[cfg(feature = "draco")]
fn draco() -> (Value, Vec<u8>, usize) {
    let bytes = include_bytes!("grid.drc").to_vec();
    let (count, faces) = (81, 128);
    let asset = triangle_with(|a| {
        a["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
        a["accessors"] = json!([
            {"componentType": 5126, "type": "VEC3", "count": count},
            {"componentType": 5123, "type": "SCALAR", "count": faces * 3},
            {"componentType": 5126, "type": "VEC2", "count": count}
        ]);
        a["bufferViews"] = json!([{"buffer": 0, "byteLength": bytes.len()}]);
        a["buffers"] = json!([{"byteLength": bytes.len(), "uri": "a.bin"}]);
        a["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(2);
        a["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression":
            {"bufferView": 0, "attributes": {"POSITION": 0, "TEXCOORD_0": 1}}});
    });
    (asset, bytes, faces)
}

#[cfg(feature = "draco")]
#[test]
fn draco_primitives_match_uncompressed_ones() {
    let (asset, bytes, faces) = draco();
    let loaded = load_with(&asset, &[("a.bin", &bytes)]).unwrap_or_else(|e| panic!("{e}"));
    let mesh = &loaded.scene.meshes[0];
    assert_eq!((mesh.triangles.len(), mesh.positions.len()), (faces, 81));
    // All faces look along z, and together they cover 8 x 8; texture coordinates follow the vertices.
    let corner = |i: u32| DVec3::from_array(mesh.positions[i as usize].map(f64::from));
    let mut area = 0.0;
    for &[a, b, c] in &mesh.triangles {
        let normal = (corner(b) - corner(a)).cross(corner(c) - corner(a));
        assert!(normal.z > 0.4 && normal.truncate().length() < 1e-6);
        area += normal.z / 2.0;
    }
    // Quantised: 11 bits over 8 units by default.
    assert!((area - 64.0).abs() < 0.1, "{area}");
    for (p, uv) in mesh.positions.iter().zip(&mesh.uv_sets[0]) {
        assert!((p[0] / 8.0 - uv[0]).abs() < 2e-3 && (p[1] / 8.0 - uv[1]).abs() < 2e-3);
    }
}

#[cfg(feature = "draco")]
#[test]
fn damaged_draco_streams_never_panic() {
    let (asset, bytes, _) = draco();
    let mut refused = 0;
    for at in 0..bytes.len() {
        let mut bytes = bytes.clone();
        bytes[at] ^= 0xff;
        refused += usize::from(load_with(&asset, &[("a.bin", &bytes)]).is_err());
    }
    assert!(refused > 10, "{refused} of {} changes are noticed", bytes.len());
    let mut cut = asset.clone();
    cut["bufferViews"][0]["byteLength"] = json!(bytes.len() / 2);
    let message = load_with(&cut, &[("a.bin", &bytes)]).expect_err("it is cut off").to_string();
    assert!(message.contains("KHR_draco_mesh_compression") && message.contains("decompressed"), "{message}");
}

/// Normals in bytes are of unit length to their precision only, which is expected: no warning.
#[test]
fn quantised_normals_are_unit_vectors() {
    let mut bytes = triangle_bytes();
    let normal = [90i8, 90, 0, 0];
    for _ in 0..3 {
        bytes.extend(normal.map(|b| b as u8));
    }
    let asset = triangle_with(|a| {
        a["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        a["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
        a["buffers"][0]["byteLength"] = json!(bytes.len());
        let views = a["bufferViews"].as_array_mut().expect("a list");
        views.push(json!({"buffer": 0, "byteOffset": 44, "byteLength": 12, "byteStride": 4}));
        let accessors = a["accessors"].as_array_mut().expect("a list");
        accessors.push(
            json!({"bufferView": 2, "componentType": 5120, "normalized": true, "type": "VEC3", "count": 3}),
        );
        a["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(2);
    });
    let loaded = load_with(&asset, &[("a.bin", &bytes)]).unwrap_or_else(|e| panic!("{e}"));
    let s = std::f32::consts::FRAC_1_SQRT_2;
    for [x, y, z] in &loaded.scene.meshes[0].normals {
        assert!((x - s).abs() < 1e-6 && (y - s).abs() < 1e-6 && *z == 0.0);
    }
    assert!(loaded.warnings.iter().all(|w| !w.message.contains("normals")), "{:?}", loaded.warnings);
}

#[test]
fn gpu_instancing_attributes() {
    let numbers = [1.0, 0.0, 0.0, 0.0, 0.0, 7.0, 2.0, 2.0, 2.0, 1.0, 1.0, -1.0];
    let mut bytes = triangle_bytes();
    bytes.extend(floats(&numbers));
    let asset = triangle_with(|a| {
        a["buffers"][0]["byteLength"] = json!(bytes.len());
        let views = a["bufferViews"].as_array_mut().expect("a list");
        views.push(json!({"buffer": 0, "byteOffset": 44, "byteLength": 24}));
        views.push(json!({"buffer": 0, "byteOffset": 68, "byteLength": 24}));
        let accessors = a["accessors"].as_array_mut().expect("a list");
        accessors.push(json!({"bufferView": 2, "componentType": 5126, "type": "VEC3", "count": 2}));
        accessors.push(json!({"bufferView": 3, "componentType": 5126, "type": "VEC3", "count": 2}));
        a["nodes"][0]["translation"] = json!([0, 10, 0]);
        a["nodes"][0]["extensions"] =
            json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2, "SCALE": 3}}});
        a["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    });
    let loaded = load_with(&asset, &[("a.bin", &bytes)]).unwrap_or_else(|e| panic!("{e}"));
    let scene = &loaded.scene;
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
    let [first, second] = [0, 1].map(|i| scene.instances[i].world_from_object);
    assert_eq!((first.translation, first.matrix3.x_axis), (DVec3::new(1.0, 10.0, 0.0), DVec3::X * 2.0));
    assert_eq!((second.translation, second.matrix3.z_axis), (DVec3::new(0.0, 10.0, 7.0), -DVec3::Z));
    let mut broken = asset.clone();
    broken["accessors"][3]["count"] = json!(1);
    let message = load_with(&broken, &[("a.bin", &bytes)]).expect_err("it is broken").to_string();
    assert!(message.contains("/accessors/3") && message.contains(" 2 "), "{message}");
}
