//! PLY files.

use super::{binary_ply, load_ply};
use crate::files::load_files_by;
use oscura::load::subdivide::Subdivision;
use oscura::load::{LoadOptions, Loaded};

#[test]
fn ply_byte_orders_and_truncation() {
    for big in [false, true] {
        let whole = binary_ply(big);
        let scene = load_ply(&whole).unwrap_or_else(|e| panic!("{e}")).scene;
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.positions[2], [2.0, 1.0, 0.0]);
        assert_eq!(mesh.triangles.len(), 2);
        assert_eq!(mesh.uv_sets[0][0], [0.5, 0.75]);
        assert!(mesh.colors[0][0] == 1.0 && (mesh.colors[0][2] - 0.502_886).abs() < 1e-5);
        for length in 0..whole.len() {
            assert!(load_ply(&whole[..length]).is_err(), "{length} bytes");
        }
    }
}

#[test]
fn ply_ascii_strips_and_errors() {
    let head =
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
    let points = "0 0 0\n\n1E0 0 0\n0 1 0\n1 1 0\n";
    let strips = "element tristrips 1\nproperty list int int vertex_indices\nend_header\n";
    let text = format!("{head}{strips}{points}7 0 1 2 3 -1 0 1\n");
    let scene = load_ply(text.as_bytes()).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2], [2, 1, 3]]);
    let fails = |text: String, part: &str| {
        let shown = load_ply(text.as_bytes()).expect_err(part).to_string();
        assert!(shown.contains(part), "'{part}' is not in: {shown}");
    };
    let faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    fails(format!("{head}{faces}{points}3 0 1 9\n"), "refers to vertex 9");
    fails(format!("{head}{faces}{points}3 0 1\n"), "line 15");
    fails(format!("{head}{faces}0 0 0\n"), "truncated");
    fails(head.replace("vertex 4", "vertex 18446744073709551616"), "too large");
    fails(format!("{}{faces}{points}", head.replace("vertex 4", "vertex 4000000000000")), "truncated");
    fails("plx".to_string(), "not a PLY file");
}

#[test]
fn ignored_ply_contents_are_reported() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                property float nx\nproperty uchar red\nproperty uchar green\nproperty float s\n\
                element face 3\nproperty list uchar int vertex_indices\nelement edge 2\nproperty int vertex1\n\
                end_header\n0 0 0 1 9 9 0\n1 0 0 1 9 9 0\n0 1 0 1 9 9 0\n3 0 1 2\n2 0 1\n0\n0\n1\n";
    let loaded = load_ply(text.as_bytes()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.scene.meshes[0].triangles.len(), 1);
    let messages: Vec<String> = loaded.warnings.iter().map(|w| w.message.clone()).collect();
    for part in
        ["normals", "texture coordinates", "colours", "2 faces", "2 rows of the unsupported element 'edge'"]
    {
        assert!(messages.iter().any(|w| w.starts_with(part)), "{part}: {messages:?}");
    }
}

#[test]
fn ply_type_names_and_unusual_text() {
    let head = "ply\rformat ascii 1.0\rcomment caf\u{e9}\r";
    let latin1 = |text: String| -> Vec<u8> { text.chars().map(|c| c as u8).collect() };
    let faces = "element face 1\rproperty list uchar int vertex_indices\rend_header\r";
    for (u, v) in [("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t")] {
        let text = latin1(format!(
            "{head}element vertex 3\rproperty double x\rproperty float64 y\rproperty float32 z\r\
             property float nx\rproperty float ny\rproperty float nz\rproperty float {u}\rproperty float {v}\r\
             property uchar diffuse_red\rproperty uint8 diffuse_green\rproperty uchar diffuse_blue\r{faces}\
             0 0 0 0 0 2 0 0.25 255 0 0\r\r1e0 0 0 0 0 1 0 0 255 0 0\r0 1E0 0 0 0 1 0 0 255 0 0\r3 0 1 2\r"
        ));
        let scene = load_ply(&text).unwrap_or_else(|e| panic!("{e}")).scene;
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        assert_eq!((mesh.uv_sets[0][0], mesh.normals[0]), ([0.0, 0.75], [0.0, 0.0, 1.0]));
        assert_eq!(mesh.colors[1], [1.0, 0.0, 0.0, 1.0]);
    }
}

#[test]
fn colours_as_floats_are_linear() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                property float red\nproperty float green\nproperty float blue\nproperty float alpha\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n\
                0 0 0 0.5 0.25 2 0.5\n1 0 0 0 0 0 1\n0 nan 0 0 0 0 1\n3 0 1 2\n";
    let error = load_ply(text.as_bytes()).map(|l| l.warnings.len());
    // The triangle's vertex is NaN, so it is dropped, the alpha is unused, and 2 is too bright; the file itself is valid.
    assert_eq!(error.expect("it can be read"), 4);
    let scene = load_ply(text.replace("nan", "1").as_bytes()).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!(scene.meshes[0].colors[0], [0.5, 0.25, 1.0, 0.5], "no more light than comes");
}

#[test]
fn point_clouds_become_spheres_of_the_given_radius() {
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n\
                0 0 0 255 255 255\n1 0 0 0 0 0\n0 2 0 255 255 255\nnan 0 0 9 9 9\n";
    // Few points stay small.
    let by_spacing = load_ply(text.as_bytes()).unwrap_or_else(|e| panic!("{e}"));
    assert!((by_spacing.scene.shapes[0].radius - 0.02 * 5f64.sqrt()).abs() < 1e-9);
    let messages: Vec<String> = by_spacing.notes.iter().map(ToString::to_string).collect();
    assert!(
        by_spacing.notes[0].code == "point-cloud" && messages[0].contains("point_radius"),
        "{messages:?}"
    );
    let with = |radius| {
        load_files_by(
            &[("a.ply", text)],
            &LoadOptions { point_radius: Some(radius), ..LoadOptions::default() },
        )
    };
    let loaded = with(0.25).unwrap_or_else(|e| panic!("{e}"));
    let scene = &loaded.scene;
    assert_eq!((scene.shapes.len(), scene.materials.len()), (3, 2));
    assert!(scene.shapes.iter().all(|s| s.radius == 0.25));
    assert_eq!(scene.shapes[0].material, scene.shapes[2].material);
    assert_eq!(scene.shapes[2].center.y, 2.0);
    assert!(
        loaded.warnings.iter().any(|w| w.code == "points-not-finite" && w.message.starts_with("1 ")),
        "{:?}",
        loaded.warnings
    );
    assert!(with(0.0).is_err() && with(f64::NAN).is_err());
}

/// Two triangles with two attributes and materials of their own, ascii.
const WITH_ATTRIBUTES: &str = "ply\nformat ascii 1.0\ncomment oscura attribute 3 2 zweite Karte é\n\
    comment oscura attribute 0 1 weight\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property float a3_0\nproperty float a3_1\nproperty uchar a0_0\nelement face 2\n\
    property list uchar int vertex_indices\nproperty uchar material_index\nend_header\n\
    0 0 0 0.5 -1 0\n1 0 0 0.25 2 255\n0 1 0 3 4 51\n1 1 0 5 6 0\n3 0 1 2 1\n3 2 1 3 0\n";

fn load_with(content: &[u8], options: &LoadOptions) -> Loaded {
    load_files_by(&[("a.ply", content)], options).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn ply_reads_attributes_by_name_and_materials_of_faces() {
    let scene = load_ply(WITH_ATTRIBUTES.as_bytes()).unwrap_or_else(|e| panic!("{e}")).scene;
    let mesh = &scene.meshes[0];
    let [map, weight] = &mesh.attributes[..] else { panic!("{:?}", mesh.attributes) };
    assert_eq!((map.name.as_str(), map.width, map.of(2)), ("zweite Karte é", 2, &[3.0, 4.0][..]));
    assert_eq!((weight.name.as_str(), weight.width), ("weight", 1));
    assert_eq!(weight.values, [0.0, 1.0, 0.2, 0.0]);
    // Faces are grouped by material.
    assert_eq!(mesh.triangles, [[2, 1, 3], [0, 1, 2]]);
    assert_eq!(mesh.parts.iter().map(|part| part.material.0).collect::<Vec<_>>(), [0, 1]);
    let options = LoadOptions { smooth_rad: Some(1.0), ..LoadOptions::default() };
    let smooth = load_with(WITH_ATTRIBUTES.as_bytes(), &options);
    assert_eq!(smooth.scene.meshes[0].attributes, mesh.attributes);
}

#[test]
fn ply_subdivides_attributes_with_their_vertices() {
    let how = Subdivision { levels: 2, has_round_corners: false };
    let options = LoadOptions { subdivision: Some(how), ..LoadOptions::default() };
    // An attribute equal to the texture coordinates stays so.
    let text = WITH_ATTRIBUTES
        .replace("property uchar a0_0", "property uchar a0_0\nproperty float s\nproperty float t")
        .replace("0 0 0 0.5 -1 0\n", "0 0 0 0.5 -1 0 0.5 -1\n")
        .replace("1 0 0 0.25 2 255\n", "1 0 0 0.25 2 255 0.25 2\n")
        .replace("0 1 0 3 4 51\n", "0 1 0 3 4 51 3 4\n")
        .replace("1 1 0 5 6 0\n", "1 1 0 5 6 0 5 6\n");
    let fine = load_with(text.as_bytes(), &options).scene;
    let mesh = &fine.meshes[0];
    assert!(mesh.positions.len() > 16 && mesh.attributes[0].values.len() == 2 * mesh.positions.len());
    for (vertex, uv) in mesh.uv_sets[0].iter().enumerate() {
        let map = mesh.attributes[0].of(vertex);
        assert!((map[0] - uv[0]).abs() < 1e-5 && (map[1] - (1.0 - uv[1])).abs() < 1e-5, "{map:?} {uv:?}");
    }
}

#[test]
fn damaged_attributes_of_ply_are_reported() {
    for (from, to, part) in [
        ("attribute 0 1 weight", "attribute 0 2 weight", "needs the property 'a0_1'"),
        ("attribute 0 1 weight", "attribute 0 7 weight", "COUNT NAME"),
        ("attribute 0 1 weight", "attribute x 1 weight", "line 4"),
        ("2 1 3 0\n", "2 1 3 -1\n", "material_index"),
    ] {
        let text = WITH_ATTRIBUTES
            .replace(from, to)
            .replace("property uchar material_index", "property int material_index");
        let shown = load_ply(text.as_bytes()).expect_err(part).to_string();
        assert!(shown.contains(part), "'{part}' is not in: {shown}");
    }
    let odd = WITH_ATTRIBUTES.replace("0.25 2 255", "nan 2 255");
    let loaded = load_ply(odd.as_bytes()).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.warnings.iter().any(|w| w.code == "attributes-not-finite"));
}
