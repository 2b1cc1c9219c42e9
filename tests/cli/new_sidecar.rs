//! `oscura new --sidecar`: a settings file proposed for a model.

use crate::program::*;
use std::fs;
use std::path::Path;

/// A room as Blender's exporter writes it: a light exported as an empty node, a white material, and a lost one on a box that
/// encloses the camera.
const ROOM: &str = r#"{
    "asset": {"version": "2.0", "generator": "Khronos glTF Blender I/O v5.0.21"}, "scene": 0,
    "scenes": [{"nodes": [0, 1, 2, 3]}],
    "nodes": [
        {"name": "Table", "mesh": 0}, {"name": "Fog box", "mesh": 1, "scale": [9, 9, 9], "translation": [-3, -3, -3], "rotation": [0.5, 0.5, 0.1, 0.7]},
        {"name": "Area \"soft\"", "translation": [0, 3, 0], "rotation": [-0.70710678, 0, 0, 0.70710678]},
        {"name": "Camera", "camera": 0, "translation": [0, 0, 1]}
    ],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
    "materials": [{"name": "Wood.001", "pbrMetallicRoughness": {"metallicFactor": 0}}, {"name": "Fog"}],
    "meshes": [
        {"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]},
        {"primitives": [{"attributes": {"POSITION": 0}, "material": 1}]}
    ],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]
}"#;

fn renders(folder: &Path, more: &[&str]) -> String {
    let args = [&["render", "room.gltf", "-o", "room.png", "--width", "16", "--spp", "1"], more].concat();
    let output = run(folder, &args, 0);
    stderr(&output)
}

#[test]
fn sidecar_is_generated_and_used() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("room.gltf"), ROOM).unwrap();
    let before = renders(folder, &[]);
    for words in ["oscura new --sidecar", "'Area \"soft\"'", "'Wood.001'", "'Fog box'"] {
        assert!(before.contains(words), "'{words}' is not in {before}");
    }
    run(folder, &["new", "--sidecar", "room.gltf"], 0);
    let path = folder.join("room.oscura.toml");
    let text = fs::read_to_string(&path).unwrap();
    for line in [
        "area = { node = \"Area \\\"soft\\\"\", size = [1.0, 1.0], power = 100.0 }",
        "#[materials.\"Wood.001\"]",
        "[objects.\"Fog box\"]\nhidden = true",
        "#name = \"Camera\"",
        "#[environment]",
    ] {
        assert!(text.contains(line), "'{line}' is not in\n{text}");
    }
    // Its light is restored, its fog removed, and comments explain the rest.
    let after = renders(folder, &[]);
    assert!(after.contains("room.oscura.toml"), "{after}");
    for words in ["encloses", "area lights", "pure white", "no light"] {
        assert!(!after.contains(words), "'{words}' is in {after}");
    }

    // With every proposal accepted it is a valid sidecar, too.
    let taken: Vec<&str> = text
        .lines()
        .map(|line| match line.strip_prefix('#') {
            Some(proposal) if !proposal.starts_with(' ') => proposal,
            _ => line,
        })
        .collect();
    fs::write(&path, taken.join("\n")).unwrap();
    renders(folder, &[]);

    fs::write(&path, "precious").unwrap();
    run(folder, &["new", "--sidecar", "room.gltf"], 2);
    assert_eq!(fs::read_to_string(&path).unwrap(), "precious");
    run(folder, &["new", "--sidecar", "room.gltf", "--force", "--quiet"], 0);
    run(folder, &["new", "--sidecar", "none.glb"], 3);
    run(folder, &["new", "--sidecar", "room.oscura.toml"], 2);
    run(folder, &["new"], 2);
}

/// A scan without camera gets proposals for a camera, a light and its material, all valid.
#[test]
fn scans_get_a_camera_a_light_and_a_material() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("scan.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n").unwrap();
    run(folder, &["new", "--sidecar", "scan.obj"], 0);
    let path = folder.join("scan.oscura.toml");
    let text = fs::read_to_string(&path).unwrap();
    for line in
        ["#[camera]\n#look_from = [", "#[[lights]]", "#[materials.default]\n#type = \"pbr\"\n#base_color"]
    {
        assert!(text.contains(line), "'{line}' is not in\n{text}");
    }
    fs::write(&path, text.replace("\n#", "\n").replace("\n ", "\n# ")).unwrap();
    let args = ["render", "scan.obj", "-o", "a.png", "--width", "16", "--spp", "1", "--strict"];
    let output = run(folder, &args, 0);
    assert!(stderr(&output).contains("scan.oscura.toml"), "{}", stderr(&output));
    assert!(!stderr(&output).contains("stage"), "{}", stderr(&output));
}
