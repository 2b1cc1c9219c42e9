//! Accessors, primitives and buffers.

use super::asset::{
    corners, floats, glb, load_triangle, load_with, scene, triangle, triangle_bytes, triangle_with,
};
use crate::files::load_files;
use serde_json::json;

#[test]
fn one_triangle() {
    let scene = scene(&triangle(), &triangle_bytes());
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions, [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert!(mesh.normals.is_empty() && mesh.uv_sets.is_empty() && mesh.colors.is_empty());
    assert_eq!((mesh.parts.len(), scene.instances.len(), scene.materials.len()), (1, 1, 1));
}

#[test]
fn glb_loads_the_same_scene() {
    let mut asset = triangle();
    asset["buffers"][0].as_object_mut().expect("an object").remove("uri");
    let scene = load_files(&[("a.glb", glb(&asset, &triangle_bytes()))]).expect("it loads").scene;
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2]]);
}

#[test]
fn buffers_in_data_uris_and_escaped_file_names() {
    let embedded = triangle_with(|a| {
        a["buffers"][0] = json!({"byteLength": 42, "uri": "data:application/octet-stream;base64,\
            AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIA"});
    });
    assert_eq!(load_with(&embedded, &[]).expect("it loads").scene.meshes[0].triangles, [[0, 1, 2]]);
    let percent = triangle_with(|a| a["buffers"][0]["uri"] = json!("a%20folder/%C3%A9.bin"));
    let files: &[(&str, &[u8])] = &[("a folder/\u{e9}.bin", &triangle_bytes())];
    assert!(load_with(&percent, files).is_ok());
}

#[test]
fn strips_fans_and_unindexed_triangles() {
    let square = floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.]);
    for (mode, expected) in
        [(4, vec![[0, 1, 2]]), (5, vec![[0, 1, 2], [1, 3, 2]]), (6, vec![[1, 2, 0], [2, 3, 0]])]
    {
        let mut asset = corners(4, 48);
        asset["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        assert_eq!(scene(&asset, &square).meshes[0].triangles, expected, "mode {mode}");
    }
}

/// Eight vertices: two strips or fans of a square each, separated by the restart index of the type.
fn restarted(mode: u8, component: u32, indices: &[u32], extension: &str) -> Result<Vec<[u32; 3]>, String> {
    let mut bytes: Vec<u8> = (0..8).flat_map(|i| floats(&[(i % 2) as f32, (i / 2) as f32, 0.0])).collect();
    for &index in indices {
        let size = match component {
            5121 => 1,
            5123 => 2,
            _ => 4,
        };
        bytes.extend(&index.to_le_bytes()[..size]);
    }
    let asset = triangle_with(|a| {
        a["accessors"][0]["count"] = json!(8);
        a["accessors"][1] =
            json!({"bufferView": 1, "componentType": component, "type": "SCALAR", "count": indices.len()});
        a["bufferViews"] = json!([
            {"buffer": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": bytes.len() - 96}
        ]);
        a["buffers"][0]["byteLength"] = json!(bytes.len());
        a["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        if !extension.is_empty() {
            (a["extensionsUsed"], a["extensionsRequired"]) = (json!([extension]), json!([extension]));
        }
    });
    let loaded = load_with(&asset, &[("a.bin", &bytes)]).map_err(|e| e.to_string())?;
    if let Some(warning) = loaded.warnings.iter().find(|w| w.file.is_some()) {
        return Err(warning.to_string());
    }
    Ok(loaded.scene.meshes.into_iter().flat_map(|mesh| mesh.triangles).collect())
}

/// KHR_mesh_primitive_restart, and EXT_mesh_primitive_restart in files that use it that way.
#[test]
fn primitive_restart() {
    let two = |restart: u32| [0, 1, 2, 3, restart, 4, 5, 6, 7];
    for (component, restart) in [(5121, 255), (5123, 65535), (5125, u32::MAX)] {
        for extension in ["KHR_mesh_primitive_restart", "EXT_mesh_primitive_restart"] {
            let strips = restarted(5, component, &two(restart), extension).expect("strips");
            assert_eq!(strips, [[0, 1, 2], [1, 3, 2], [4, 5, 6], [5, 7, 6]], "{component}");
            let fans = restarted(6, component, &two(restart), extension).expect("fans");
            assert_eq!(fans, [[1, 2, 0], [2, 3, 0], [5, 6, 4], [6, 7, 4]], "{component}");
        }
        let undeclared = restarted(5, component, &two(restart), "").expect_err("a vertex that is not there");
        assert!(
            undeclared.contains(&format!("holds the index {restart}"))
                && undeclared.contains("KHR_mesh_primitive_restart"),
            "{undeclared}"
        );
        // Triangle lists have no restarts.
        let list = [0, 1, 2, restart, 4, 5];
        assert!(restarted(4, component, &list, "KHR_mesh_primitive_restart").is_err());
    }
    // Segments without a triangle, consecutive restarts and at the ends; an index that equals the restart of a smaller type.
    let odd = [255, 255, 0, 1, 255, 2, 3, 4, 255, 255, 5, 255];
    let odd = restarted(5, 5121, &odd, "KHR_mesh_primitive_restart");
    assert_eq!(odd.expect("it loads"), [[2, 3, 4]]);
    assert!(restarted(5, 5123, &two(255), "KHR_mesh_primitive_restart").is_err());
}

/// EXT_mesh_primitive_restart as published: groups of primitives that may be drawn as one. They load one by one, whatever is
/// wrong with a group.
#[test]
fn primitive_restart_groups_load_one_by_one() {
    for group in [json!({"primitives": [0], "indices": 1}), json!({"primitives": [7, 7], "indices": 99})] {
        let asset = triangle_with(|a| {
            a["extensionsUsed"] = json!(["EXT_mesh_primitive_restart"]);
            a["meshes"][0]["primitives"][0]["mode"] = json!(5);
            a["meshes"][0]["extensions"] =
                json!({"EXT_mesh_primitive_restart": {"primitiveGroups": [group]}});
        });
        let loaded = load_triangle(&asset).expect("it loads");
        assert_eq!(loaded.scene.meshes[0].triangles, [[0, 1, 2]]);
        assert!(loaded.warnings.iter().all(|w| w.file.is_none()), "{:?}", loaded.warnings);
    }
}

#[test]
fn points_and_lines_are_not_triangles() {
    for (mode, bodies) in [(0, [3, 0]), (1, [0, 1]), (2, [0, 1]), (3, [0, 1])] {
        let asset = triangle_with(|a| a["meshes"][0]["primitives"][0]["mode"] = json!(mode));
        let loaded = load_triangle(&asset).expect("it loads");
        assert!(loaded.scene.meshes.is_empty() && loaded.scene.instances.is_empty());
        let strands: usize = loaded.scene.curves.iter().map(|curves| curves.strands.len()).sum();
        assert_eq!([loaded.scene.shapes.len(), strands], bodies);
    }
}

#[test]
fn interleaved_elements_and_normalised_integers() {
    // Each vertex: position (12 bytes), texture coordinates as u16 (4 bytes), colour as u8 with padding (4 bytes).
    let mut bytes = Vec::new();
    for (x, y, u) in [(0.0, 0.0, 0u16), (1.0, 0.0, 65535), (0.0, 1.0, 13107)] {
        bytes.extend(floats(&[x, y, 0.0]));
        bytes.extend([u.to_le_bytes(), 0u16.to_le_bytes()].concat());
        bytes.extend([255, 51, 0, 99]);
    }
    let asset = triangle_with(|a| {
        a["bufferViews"] = json!([{"buffer": 0, "byteLength": 60, "byteStride": 20}]);
        a["buffers"][0]["byteLength"] = json!(60);
        a["accessors"] = json!([
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3},
            {"bufferView": 0, "byteOffset": 12, "componentType": 5123, "normalized": true, "type": "VEC2", "count": 3},
            {"bufferView": 0, "byteOffset": 16, "componentType": 5121, "normalized": true, "type": "VEC3", "count": 3}
        ]);
        a["meshes"][0]["primitives"][0] =
            json!({"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2}, "material": 0});
    });
    let scene = scene(&asset, &bytes);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions[1], [1.0, 0.0, 0.0]);
    assert_eq!(mesh.uv_sets[0], [[0.0, 0.0], [1.0, 0.0], [0.2, 0.0]]);
    assert_eq!(mesh.colors[2], [1.0, 0.2, 0.0, 1.0]);
    assert!(scene.materials[0].use_vertex_colors);
}

#[test]
fn sparse_accessors() {
    let mut bytes = triangle_bytes();
    bytes.extend([2, 0, 0, 0]);
    bytes.extend(floats(&[5.0, 6.0, 7.0]));
    let sparse = json!({
        "count": 1,
        "indices": {"bufferView": 2, "componentType": 5121},
        "values": {"bufferView": 3}
    });
    let mut asset = triangle_with(|a| {
        a["accessors"][0]["sparse"] = sparse;
        a["buffers"][0]["byteLength"] = json!(60);
        let views = a["bufferViews"].as_array_mut().expect("a list");
        views.push(json!({"buffer": 0, "byteOffset": 44, "byteLength": 1}));
        views.push(json!({"buffer": 0, "byteOffset": 48, "byteLength": 12}));
    });
    let positions = scene(&asset, &bytes).meshes[0].positions.clone();
    assert_eq!(positions, [[0.0; 3], [1.0, 0.0, 0.0], [5.0, 6.0, 7.0]]);
    // Without a bufferView the others are zeros.
    asset["accessors"][0].as_object_mut().expect("an object").remove("bufferView");
    assert_eq!(scene(&asset, &bytes).meshes[0].positions, [[0.0; 3], [0.0; 3], [5.0, 6.0, 7.0]]);
    bytes[44] = 3;
    let error = load_with(&asset, &[("a.bin", &bytes)]).expect_err("the index is beyond the last");
    assert!(error.to_string().contains("/accessors/0/sparse/indices"), "{error}");
}

#[test]
fn primitives_become_parts_with_shared_vertices() {
    let asset = triangle_with(|a| {
        let primitive = json!({"attributes": {"POSITION": 0}, "indices": 1});
        a["meshes"][0]["primitives"].as_array_mut().expect("a list").push(primitive);
    });
    let scene = scene(&asset, &triangle_bytes());
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.positions.len(), mesh.triangles.len(), mesh.parts.len()), (3, 2, 2));
    assert_ne!(mesh.parts[0].material, mesh.parts[1].material);
}

#[test]
fn a_mesh_with_and_without_normals_becomes_two() {
    let mut bytes = triangle_bytes();
    bytes.extend(floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0]));
    let asset = triangle_with(|a| {
        a["buffers"][0]["byteLength"] = json!(80);
        a["bufferViews"]
            .as_array_mut()
            .expect("a list")
            .push(json!({"buffer": 0, "byteOffset": 44, "byteLength": 36}));
        let normals = json!({"bufferView": 2, "componentType": 5126, "type": "VEC3", "count": 3});
        a["accessors"].as_array_mut().expect("a list").push(normals);
        let primitive = json!({"attributes": {"POSITION": 0, "NORMAL": 2}, "indices": 1});
        a["meshes"][0]["primitives"].as_array_mut().expect("a list").push(primitive);
    });
    let scene = scene(&asset, &bytes);
    assert_eq!((scene.meshes.len(), scene.instances.len()), (2, 2));
    assert!(scene.meshes[0].normals.is_empty());
    // The second normal is normalised, the third computed from its triangle.
    assert_eq!(scene.meshes[1].normals, [[0.0, 0.0, 1.0]; 3]);
}

#[test]
fn triangles_with_invalid_vertices_are_dropped() {
    let mut numbers = vec![0., 0., 0., 1., 0., 0., 0., 1., 0.];
    numbers.extend([f32::NAN, 0., 0., 1., 0., 0., 0., 1., 0.]);
    let loaded = load_with(&corners(6, 72), &[("a.bin", &floats(&numbers))]).expect("it loads");
    let mesh = &loaded.scene.meshes[0];
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert_eq!(mesh.parts[0].triangle_count, 1);
    assert!(loaded.warnings.iter().any(|w| w.message.starts_with("1 ")));
}
