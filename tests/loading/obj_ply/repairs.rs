//! Minor errors of programs that write OBJ, MTL and PLY files.

use super::{load_files, load_ply};
use oscura::color::linear_from_srgb;
use oscura::load::Loaded;
use oscura::scene::{Material, Model};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n";
/// A PNG of one black pixel.
const PIXEL: &[u8] = include_bytes!("pixel.png");

/// The warnings about the file.
fn messages(loaded: &Loaded) -> String {
    loaded.warnings.iter().filter(|w| w.file.is_some()).map(|w| format!("{w} [{}]\n", w.code)).collect()
}

fn obj(text: &str) -> Loaded {
    load_files(&[("a.obj", text.as_bytes())]).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn byte_colours_in_float_properties_are_reported() {
    let bytes = obj("v 0 0 0 255 0 0\nv 1 0 0 0 188 0\nv 0 1 0 0 0 0\nf 1 2 3\n");
    let colors = &bytes.scene.meshes[0].colors;
    assert!(
        colors[0] == [1.0, 0.0, 0.0, 1.0] && (colors[1][1] - linear_from_srgb(188.0 / 255.0)).abs() < 1e-6
    );
    assert!(messages(&bytes).contains("[vertex-colors-bytes]"), "{}", messages(&bytes));
    let bright = obj("v 0 0 0 2.5 0 0\nv 1 0 0 0 0.5 0\nv 0 1 0 0 0 0\nf 1 2 3\n");
    assert_eq!(bright.scene.meshes[0].colors[0], [1.0, 0.0, 0.0, 1.0]);
    assert!(messages(&bright).contains("[vertex-colors-clamped]"), "{}", messages(&bright));
    let paint = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\n#MRGB ffff0000ff00ff00ff0000ff\nf 1 2 3\n");
    assert_eq!(paint.scene.meshes[0].colors[1], [0.0, 1.0, 0.0, 1.0]);
    for kind in ["int", "float", "ushort"] {
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty \
             {kind} red\nproperty {kind} green\nproperty {kind} blue\nelement face 1\nproperty list uchar int \
             vertex_indices\nend_header\n0 0 0 255 0 0\n1 0 0 255 0 0\n0 1 0 255 188 0\n3 0 1 2\n"
        );
        let ply = load_ply(text.as_bytes()).unwrap_or_else(|e| panic!("{e}"));
        let color = ply.scene.meshes[0].colors[2];
        // 16-bit colours have their own range.
        let expected = if kind == "ushort" {
            linear_from_srgb(188.0 / 65535.0)
        } else {
            linear_from_srgb(188.0 / 255.0)
        };
        assert!((color[1] - expected).abs() < 1e-6, "{kind}: {color:?}");
    }
}

#[test]
fn face_colours_load() {
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement \
                face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\nproperty uchar \
                blue\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n";
    let loaded = load_ply(text.as_bytes()).unwrap_or_else(|e| panic!("{e}"));
    let mesh = &loaded.scene.meshes[0];
    for (triangle, color) in mesh.triangles.iter().zip([[1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0]]) {
        assert!(triangle.iter().all(|&v| mesh.colors[v as usize] == color), "{:?}", mesh.colors);
    }
    assert!(
        loaded.scene.materials[0].use_vertex_colors && messages(&loaded).is_empty(),
        "{}",
        messages(&loaded)
    );
}

#[test]
fn invalid_numbers_are_repaired() {
    let normals = "vn -nan(ind) 1.#QNAN -1.#IND\nvn 0 0 1\n";
    let loaded =
        obj(&format!("{TRIANGLE}vt 1.#IND 0\n{normals}v 1 1 1.#INF\nf 1/1/1 2/2/2 3/1/2\nf 1 2 4\n"));
    assert_eq!(loaded.scene.meshes.iter().map(|m| m.triangles.len()).sum::<usize>(), 1);
    for part in ["[corners-not-finite]", "[attributes-not-finite]", "[normals-not-finite]"] {
        assert!(messages(&loaded).contains(part), "{part}: {}", messages(&loaded));
    }
    let commas =
        load_files(&[("a.obj", b"v 0,5 1,0 2,0\nf 1 1 1\n")]).expect_err("it is refused").to_string();
    assert!(commas.contains("LC_NUMERIC=C"), "{commas}");
}

#[test]
fn faces_with_missing_vertices_are_dropped() {
    let loaded = obj(&format!("{TRIANGLE}f 1 2 3\nf 1 2 9\nf 0 1 2\n"));
    assert_eq!(loaded.scene.meshes[0].triangles.len(), 1);
    assert!(messages(&loaded).contains("line 6: 2 "), "{}", messages(&loaded));
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement \
                face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 1 7\n";
    let loaded = load_ply(text.as_bytes()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.scene.meshes[0].triangles.len(), 1);
    assert!(messages(&loaded).contains("face 1: "), "{}", messages(&loaded));
}

fn with_library(library: &str) -> (Material, String) {
    let model = format!("mtllib a.mtl\n{TRIANGLE}usemtl a\nf 1/1 2/1 3/1\n");
    let files = [("a.obj", model.as_bytes()), ("a.mtl", library.as_bytes()), ("my map.png", PIXEL)];
    let mut loaded = load_files(&files).unwrap_or_else(|e| panic!("{e}"));
    let messages = messages(&loaded);
    (loaded.scene.materials.remove(0), messages)
}

#[test]
fn textures_are_found_in_any_notation() {
    for map in [
        "my map.png -bm 1",
        "\"my map.png\"",
        "my\\ map.png",
        "-colorspace sRGB my map.png -s 2 2",
        "C:\\x\\My Map.PNG",
    ] {
        let (material, messages) = with_library(&format!("newmtl a\nmap_Kd {map}\n"));
        let Model::Lambert { albedo } = material.model else { panic!("{map}") };
        assert!(albedo.texture.is_some() && messages.is_empty(), "{map}: {messages}");
    }
    let (material, messages) = with_library("newmtl a\nmap_Ka my map.png\n");
    let Model::Lambert { albedo } = material.model else { panic!("not diffuse") };
    assert!(albedo.texture.is_some() && messages.contains("'map_Ka'"), "{messages}");
    // Next to a colour it is ignored: silently if it is the same image, as most exporters write it.
    let both = |ambient: &str| with_library(&format!("newmtl a\nmap_Kd my map.png\nmap_Ka {ambient}\n")).1;
    assert_eq!(both("-s 2 2 my map.png"), "");
    assert!(both("occlusion.png").contains("'map_Ka' is ignored"), "{}", both("occlusion.png"));
}

/// MeshLab writes opacity as transparency; a value that hides the whole model is not intended.
#[test]
fn inverted_transparency_is_detected() {
    for library in [
        "# Converted by Meshlab Group\nnewmtl a\nTr 1.000000\nnewmtl b\nTr 0.5\n",
        "newmtl a\nTr 1\nnewmtl b\nTr 1.0\n",
    ] {
        let (material, messages) = with_library(library);
        assert_eq!(material.alpha.factor, 1.0, "{library}");
        assert!(messages.contains("'Tr' of 2 "), "{messages}");
    }
    let (material, messages) = with_library("newmtl a\nTr 1\nnewmtl b\nTr 0\n");
    assert!(material.alpha.factor == 0.0 && messages.contains("'Tr 1'"), "{messages}");
}

#[test]
fn unreferenced_mtl_files_are_reported() {
    let faces = "f 1 2 3\n";
    let library = b"newmtl a\nKd 0.25 0.5 0.75\n";
    let load =
        |text: String| load_files(&[("a.obj", text.as_bytes()), ("a.mtl", library)]).expect("it loads");
    let unnamed = load(format!("{TRIANGLE}usemtl a\n{faces}"));
    let Model::Lambert { albedo } = unnamed.scene.materials[0].model else { panic!("not diffuse") };
    assert!(
        albedo.factor == [0.25, 0.5, 0.75] && messages(&unnamed).contains("[library-guessed]"),
        "{}",
        messages(&unnamed)
    );
    let unused = load(format!("mtllib a.mtl\n{TRIANGLE}{faces}"));
    assert!(messages(&unused).contains("[materials-unused]"), "{}", messages(&unused));
    let neither = load(format!("{TRIANGLE}{faces}"));
    assert!(messages(&neither).contains("[library-unused]"), "{}", messages(&neither));
}
