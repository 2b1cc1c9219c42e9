//! OBJ files.

use super::{load_files, obj_scene};
use crate::codes::code_of;
use oscura::math::Vec3;
use oscura::scene::{Mesh, Scene};

#[test]
fn corners() {
    // A byte order mark, a continued line, negative indices, and a quad.
    let scene = obj_scene("\u{feff}v 0 0 0\nv 1 0 \\\n0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n");
    assert_eq!(scene.meshes[0].triangles.len(), 2);
    assert!(scene.meshes[0].normals.is_empty());
    // v points down here, up in the file.
    let scene =
        obj_scene("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 0.75\nvn 0 0 2\nf 1/1/1 2/2/1 3/3/1\n");
    assert_eq!(scene.meshes[0].uv_sets[0][2], [0.0, 0.25]);
    assert_eq!(scene.meshes[0].normals[0], [0.0, 0.0, 1.0]);
    // Vertex colours are sRGB-encoded.
    let scene = obj_scene("v 0 0 0 1 0.5 0\nv 1 0 0 1 0.5 0\nv 0 1 0 1 0.5 0\nf 1 2 3\n");
    assert!((scene.meshes[0].colors[0][1] - 0.214_041).abs() < 1e-5);
    assert!(scene.materials[0].use_vertex_colors);
}

#[test]
fn errors_name_the_line() {
    let error = load_files(&[("a.obj", b"v 0 0 0\nv 1 x 0\n")]).expect_err("a bad number");
    assert_eq!(error.problems[0].place, "line 2");
    assert_eq!(code_of(&load_files(&[("a.obj", b"vn 0 0 1\n")]).expect_err("no faces")), "no-surface");
    assert!(load_files(&[("a.obj", b"v 0 0 0\nf 1 2 3\n")]).is_err());
}

#[test]
fn utf_16_is_reported() {
    for mark in [[0xff, 0xfe], [0xfe, 0xff]] {
        let text = [&mark[..], b"v\0 \0"].concat();
        let error = load_files(&[("a.obj", &text)]).expect_err("it is no text that is read");
        assert_eq!(code_of(&error), "utf-16");
    }
    // Without a byte order mark there is a zero next to each letter.
    let text = "# a triangle\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    for bytes in [u16::to_le_bytes, u16::to_be_bytes] {
        let text: Vec<u8> = text.encode_utf16().flat_map(bytes).collect();
        let error = load_files(&[("a.obj", &text)]).expect_err("it is no text that is read").to_string();
        assert!(error.contains("UTF-16") && !error.contains('\0'), "{error}");
    }
    // Also for material libraries, and for other text files.
    let encoded = |text: &str| {
        [&[0xff, 0xfe], &text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>()[..]].concat()
    };
    let (mtl, obj) =
        (encoded("newmtl a\nKd 1 0 0\n"), "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
    let loaded = load_files(&[("a.obj", obj.as_bytes()), ("a.mtl", &mtl)]).expect("it is grey");
    let warned: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    assert!(
        warned[0].contains("'a.mtl'") && warned[0].contains("UTF-16") && !warned.concat().contains('\0'),
        "{warned:?}"
    );
    for (name, text) in
        [("a.ply", "ply\nformat ascii 1.0\n"), ("a.gltf", "{\"asset\": {\"version\": \"2.0\"}}")]
    {
        let error = load_files(&[(name, &encoded(text))]).expect_err(name).to_string();
        assert!(error.contains("UTF-16"), "{error}");
    }
}

#[test]
fn all_problems_come_at_once() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1\nv 0 1 0\nf 1 2 9\nf 1 0 2\nf a b c\nvn 1 0\nf 1 2 -4\n";
    let error = load_files(&[("a.obj", text.as_bytes())]).expect_err("it is broken");
    let places: Vec<&str> = error.problems.iter().map(|p| p.place.as_str()).collect();
    assert_eq!(places, ["line 3", "line 7", "line 8"], "{error}");
    let missing =
        load_files(&[("a.obj", b"v 0 0 0\nf 1 2 3\nf 1 0 1\n")]).expect_err("no face is left").to_string();
    assert!(missing.contains("line 2"), "{missing}");
    let many = format!("v 0 0 0\n{}", "f 1 x 3\n".repeat(1000));
    let error = load_files(&[("a.obj", many.as_bytes())]).expect_err("it is broken");
    assert_eq!(error.problems.len(), 11);
    assert!(error.to_string().contains("990"), "{error}");
}

fn area(mesh: &Mesh) -> f32 {
    let corner = |i: u32| Vec3::from(mesh.positions[i as usize]);
    let signed = |t: &[u32; 3]| 0.5 * (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).z;
    mesh.triangles.iter().map(signed).sum()
}

#[test]
fn concave_polygons_are_triangulated_correctly() {
    // An arrow whose third vertex is reflex: a fan from the first vertex would leave the outline.
    let scene = obj_scene("v 2 2 0\nv 0 1 0\nv -2 2 0\nv 0 0 0\nf 4 1 2 3\n");
    let mesh = &scene.meshes[0];
    assert!((area(mesh) - 2.0).abs() < 1e-6);
    let every_front = mesh.triangles.iter().all(|t| {
        let one = Mesh { triangles: vec![*t], ..mesh.clone() };
        area(&one) > 0.0
    });
    assert!(every_front);
}

#[test]
fn line_ends_comments_and_encodings_of_other_systems() {
    let expected = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let unix = "# caf\u{e9} C:\\models\\\nv 0 0 0 # origin\nv 1 \\\n 0 0\n\n  v 0 1 0\nf 1 \\\n2 3";
    let latin1: Vec<u8> = unix.chars().map(|c| c as u8).collect();
    for text in [unix.as_bytes().to_vec(), unix.replace('\n', "\r\n").into_bytes(), latin1] {
        assert_eq!(obj_scene(&text).meshes[0].positions, expected, "{}", String::from_utf8_lossy(&text));
    }
    let mac = "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r";
    assert_eq!(obj_scene(mac).meshes[0].positions, expected);
    let error = load_files(&[("a.obj", b"v 0 0 0\rv 1 0 0\rv 0 x 0\r")]).expect_err("a bad number");
    assert_eq!(error.problems[0].place, "line 3");
}

/// A roof: two squares that meet at a ridge along x.
const ROOF: &str = "v 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 0 -1\nv 1 0 -1\n";

#[test]
fn smoothing_groups_cross_edges_and_objects() {
    let (left, right) = ("f 1 3 4 2\n", "f 1 2 6 5\n");
    let normal_at = |scene: &Scene, mesh: usize, position: [f32; 3]| -> Vec<Vec3> {
        let mesh = &scene.meshes[mesh];
        let at = mesh.positions.iter().zip(&mesh.normals).filter(|(p, _)| **p == position);
        at.map(|(_, n)| Vec3::from(*n)).collect()
    };
    let (ridge, foot) = ([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let slope = Vec3::new(0.0, 1.0, 1.0).normalize();
    // One group, also across two objects.
    for between in ["", "o other\n", "g roof\nusemtl a\n"] {
        let scene = obj_scene(format!("{ROOF}s 1\n{left}{between}{right}"));
        let normals = normal_at(&scene, 0, ridge);
        assert!(normals.len() == 1 && normals[0].distance(Vec3::Y) < 1e-6, "{normals:?}");
        assert!(normal_at(&scene, 0, foot)[0].distance(slope) < 1e-6);
    }
    // Two groups: the ridge is a crease with two normals.
    let scene = obj_scene(format!("{ROOF}s 1\n{left}s 2\n{right}"));
    let normals = normal_at(&scene, 0, ridge);
    assert_eq!(normals.len(), 2);
    assert!(normals.iter().all(|n| n.distance(Vec3::Y) > 0.5));
    // Off: flat, without normals.
    assert!(obj_scene(format!("{ROOF}s off\n{left}s 0\n{right}")).meshes[0].normals.is_empty());
    // A flat face next to a smooth one has its own vertices.
    let scene = obj_scene(format!("{ROOF}s 1\n{left}s off\n{right}"));
    let normals = normal_at(&scene, 0, ridge);
    assert!(normals.iter().all(|n| (n.y - slope.y).abs() < 1e-6), "{normals:?}");
    assert!(normals.iter().any(|n| n.z > 0.5) && normals.iter().any(|n| n.z < -0.5));
}

#[test]
fn file_normals_override_smoothing_groups() {
    let scene = obj_scene(format!("{ROOF}vn 1 0 0\ns 1\nf 1//1 3//1 4//-1\nf 1 2 6\n"));
    let mesh = &scene.meshes[0];
    let given = mesh.normals.iter().filter(|n| **n == [1.0, 0.0, 0.0]).count();
    assert_eq!((mesh.positions.len(), given), (6, 3));
    assert!(mesh.normals.iter().all(|n| (Vec3::from(*n).length() - 1.0).abs() < 1e-6));
}

#[test]
fn objects_become_instances_and_materials_parts() {
    let points = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let face = "f 1 2 3\n";
    let text = format!(
        "{points}o table\ng legs\nusemtl wood\n{face}usemtl steel\n{face}usemtl wood\n{face}g top\n{face}o lamp\n"
    );
    let loaded = load_files(&[("a.obj", text.as_bytes())]).unwrap_or_else(|e| panic!("{e}"));
    let scene = loaded.scene;
    let names: Vec<&str> = scene.instances.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["table/legs", "table/top"]);
    let parts: Vec<(u32, u32)> =
        scene.meshes[0].parts.iter().map(|p| (p.first_triangle, p.triangle_count)).collect();
    assert_eq!(parts, [(0, 2), (2, 1)]);
    assert_eq!(scene.materials.len(), 2);
    let warned = |name: &str| loaded.warnings.iter().any(|w| w.message.contains(name) && !w.place.is_empty());
    assert!(warned("'wood'") && warned("'steel'"), "{:?}", loaded.warnings);
}

#[test]
fn ignored_statements_are_counted_with_their_location() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 nan 0\nl 1 2\np 1\nf 1 2\nf 1 2 2\nf 1/7 2/7 3/7\nf 1//1 2 3\nf 1 2 4\n\
                curv 0 1 1 2\nxyz 1\n";
    let loaded = load_files(&[("a.obj", text.as_bytes())]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((loaded.scene.meshes[0].triangles.len(), loaded.scene.shapes.len()), (2, 1));
    let shown: Vec<String> = loaded.warnings.iter().map(|w| format!("{}: {}", w.place, w.message)).collect();
    for part in [
        "line 5: 1 lines, which have no surface",
        "line 7: 2 faces of fewer than three corners",
        "line 9: 3 references to texture coordinates",
        "line 10: 1 references to normals",
        "line 12: 1 statements of free-form",
        "line 13: 1 statements 'xyz'",
        "1 triangles with corners that are not finite",
    ] {
        assert!(shown.iter().any(|w| w.contains(part)), "'{part}' is not in {shown:?}");
    }
    let error = load_files(&[("a.obj", b"xyz 1\n\xff\xfe")]).expect_err("no OBJ");
    assert!(code_of(&error) == "no-surface", "{error}");
}

/// Where `tobj` divides by zero, uses another vertex, or applies a value to the whole object.
#[test]
fn cases_that_tobj_misreads() {
    let points = "v 0 0 0 2\nv 4 0 0 2\nv 0 4 0 2\nv 4 4 0 2\nvt 0.5 0.5\nvt 1\nvn 0 0 1\nvn 0 0 -1\n";
    let mesh =
        &obj_scene(format!("{points}f 1/1/1 2/2/1 3/1/1\nf 2//2 4//2 3//2\nf 2/1 4/1 3/1\n")).meshes[0];
    assert!(mesh.positions.contains(&[4.0, 4.0, 0.0]), "{:?}", mesh.positions);
    let corner = |t: usize, k: usize| mesh.triangles[t][k] as usize;
    let (uv, normal) = (|t, k| mesh.uv_sets[0][corner(t, k)], |t, k| mesh.normals[corner(t, k)][2]);
    assert_eq!((uv(0, 0), uv(0, 1), uv(1, 0), uv(2, 0)), ([0.5; 2], [1.0, 1.0], [0.0, 1.0], [0.5; 2]));
    assert_eq!((normal(0, 0), normal(1, 0), normal(2, 0)), (1.0, -1.0, 1.0));
    // Corners of one face with different kinds of references violate the format.
    let text = format!("{points}f 1/1/1 2//1 3/1/1\n");
    let loaded = load_files(&[("a.obj", text.as_bytes())]).unwrap_or_else(|e| panic!("{e}"));
    let messages: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    assert!(messages.iter().any(|w| w.contains(": 1 ")), "{messages:?}");
    assert!(loaded.scene.meshes[0].uv_sets.is_empty() && loaded.scene.meshes[0].normals.len() == 3);
    for (broken, line) in [("vt x\n", 1), ("vt 0 x\n", 1), ("v 1 2\n", 1), ("vn 0 0\n", 1)] {
        let error = load_files(&[("a.obj", format!("{broken}{points}f 1 2 3\n").as_bytes())]);
        assert_eq!(error.expect_err(broken).problems[0].place, format!("line {line}"));
    }
    for face in ["f 1 2 3/", "f +1 02 003", "f 1// 2// 3//", "f -4 -3 -2", "f 1 2 3 3", "f 1 1 2 3 1 # 4"] {
        let mesh = &obj_scene(format!("{points}{face}\n")).meshes[0];
        assert_eq!((mesh.positions.len(), mesh.triangles.len()), (3, 1), "{face}");
    }
    for face in ["f 1/1/1/1 2 3", "f 1 /2 3", "f 1 2 9999999999999999999", "f 1 2 -9223372036854775808"] {
        let error = load_files(&[("a.obj", format!("{points}{face}\n").as_bytes())]);
        assert_eq!(error.expect_err(face).problems[0].place, "line 9");
    }
}

/// More faces than passed to `tobj` at a time; chunks start in the middle of a material and of a smoothing group.
#[test]
fn many_faces_give_one_mesh() {
    use std::fmt::Write;
    let rows = 200;
    let mut text = String::from("s 1\nusemtl a\n");
    for i in 0..rows * rows {
        writeln!(text, "v {} {} 0", i % rows, i / rows).expect("written");
    }
    let mut faces = 0;
    for i in (0..rows * (rows - 1)).filter(|i| i % rows < rows - 1) {
        writeln!(text, "f {} {} {} {}", i + 1, i + 2, i + rows + 2, i + rows + 1).expect("written");
        faces += 1;
    }
    let scene = obj_scene(&text);
    let mesh = &scene.meshes[0];
    assert_eq!((scene.meshes.len(), mesh.parts.len(), mesh.triangles.len()), (1, 1, 2 * faces));
    assert!(mesh.normals.iter().all(|n| *n == [0.0, 0.0, 1.0]) && mesh.normals.len() == mesh.positions.len());
    assert!((area(mesh) - faces as f32).abs() < 0.5);
}

#[test]
fn missing_vertex_colours_are_white() {
    let scene = obj_scene("v 0 0 0\nv 1 0 0 0 0 0\nv 0 1 0\nv 1 1 0 1.0\nf 1 2 3\nf 2 4 3\n");
    let mesh = &scene.meshes[0];
    let color = |p: [f32; 3]| mesh.colors[mesh.positions.iter().position(|q| *q == p).expect("it is there")];
    assert_eq!(color([1.0, 0.0, 0.0]), [0.0, 0.0, 0.0, 1.0]);
    assert_eq!((color([0.0, 0.0, 0.0]), color([1.0, 1.0, 0.0])), ([1.0; 4], [1.0; 4]));
}

/// Indices count through the whole file, and vertices may follow the faces that use them.
#[test]
fn faces_may_precede_their_vertices() {
    let vertices = "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.25\nvn 0 0 1\n";
    let faces = "usemtl late\nf 1/1/1 2/1/1 3/1/1\n";
    let (usual, turned) = (obj_scene(format!("{vertices}{faces}")), obj_scene(format!("{faces}{vertices}")));
    let all = |s: &Scene| format!("{:?} {:?}", s.meshes, s.materials);
    assert_eq!(all(&turned), all(&usual));
    // Negative indices are relative to their line: the second face uses the vertices before it.
    let mixed = obj_scene("f 4 5 6\nv 9 0 0\nv 8 0 0\nv 9 1 0\nf -3 -2 -1\nv 0 0 0\nv 1 0 0\nv 0 1 0\n");
    let mesh = &mixed.meshes[0];
    let corners: Vec<f32> =
        mesh.triangles.as_flattened().iter().map(|&i| mesh.positions[i as usize][0]).collect();
    assert_eq!(corners, [0.0, 1.0, 0.0, 9.0, 8.0, 9.0]);
    let error = load_files(&[("a.obj", b"f 1 2 3\nf 1 2 4\nf x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 1 2\n")]);
    let error = error.expect_err("two indices lead nowhere, and one is none").to_string();
    assert!(error.contains("line 3: 'x'"), "{error}");
}
