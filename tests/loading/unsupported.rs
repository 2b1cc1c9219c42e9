//! Unsupported contents of files are reported.

use crate::files::{load_files, load_files_by};
use oscura::load::{LoadOptions, Loaded, load};
use oscura::scene::Model;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// Loads the first of some files in one folder; points of point clouds get a radius.
fn open(files: &[(&str, &str)]) -> Result<Loaded, String> {
    let options = LoadOptions { point_radius: Some(0.25), ..LoadOptions::default() };
    load_files_by(files, &options).map_err(|e| e.to_string())
}

fn loaded(files: &[(&str, &str)]) -> Loaded {
    open(files).unwrap_or_else(|e| panic!("{e}"))
}

/// The warnings of a model, without those about default camera and lights.
fn warnings_of(loaded: &Loaded) -> Vec<(&str, &str)> {
    let is_default = |message: &str| ["no camera", "no light"].iter().any(|start| message.starts_with(start));
    let all = loaded.warnings.iter().filter(|w| !is_default(&w.message));
    all.map(|w| (w.place.as_str(), w.message.as_str())).collect()
}

/// The warnings of an OBJ file with a material library.
fn warnings_of_material(statements: &str) -> Vec<String> {
    let obj = format!("mtllib a.mtl\n{TRIANGLE}usemtl a\nf 1 2 3\n");
    let loaded = loaded(&[("a.obj", &obj), ("a.mtl", &format!("newmtl a\n{statements}"))]);
    warnings_of(&loaded).into_iter().map(|(_, message)| message.to_string()).collect()
}

#[test]
fn incomplete_obj_vertex_colours() {
    let with = |first: &str| {
        let text = format!("v 0 0 0{first}\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        loaded(&[("a.obj", &text)])
    };
    let expected = ("line 1", "1 colours of vertices that are not three numbers: left out");
    for broken in [" 0.5 0.5", " 0.5 x 0.5"] {
        assert_eq!(warnings_of(&with(broken)), [expected], "{broken}");
    }
    for sound in ["", " 1", " 0.5 0.5 0.5", " # a comment of words"] {
        assert!(warnings_of(&with(sound)).is_empty(), "{sound}");
    }
}

#[test]
fn ignored_mtl_statements() {
    for (statements, expected) in [
        ("Kd 1.5 0 0\nPr 2", vec!["material 'a': 'Kd', 'Pr' outside 0 to 1: clamped"]),
        ("Ks 1 1 1\nNi 0", vec!["material 'a': 'Ni' 0 is not an index of refraction from 1 to 10: ignored"]),
        ("Kd 1 0 0\nNi 1.5\nd 1\nKs 0 0 0", vec![]),
        (
            "illum 4\nNi 1.5\nmap_Kd a.png",
            vec!["material 'a': 'map_Kd' is ignored: the material is smooth glass by its 'illum'"],
        ),
        ("Kd 1 0 0\nnewmtl a\nKd 0 1 0", vec!["material 'a' is defined repeatedly: the first is used"]),
    ] {
        assert_eq!(warnings_of_material(statements), expected, "{statements}");
    }
    let options = warnings_of_material("map_Kd -bm high -clamp maybe a.png");
    assert!(options.iter().any(|w| w.contains("-bm") && w.contains("-clamp")), "{options:?}");
    let maps = warnings_of_material("norm a.png\nbump b.png");
    assert!(maps.iter().any(|w| w.contains("'bump'") && w.contains("'norm'")), "{maps:?}");
}

/// A triangle as PLY, with properties of vertices and faces and their values.
fn ply(comment: &str, vertex: &str, vertex_values: &str, face: &str, face_values: &str) -> String {
    let rows: String = ["0 0 0", "1 0 0", "0 1 0"].iter().map(|p| format!("{p} {vertex_values}\n")).collect();
    format!(
        "ply\nformat ascii 1.0\n{comment}element vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
         {vertex}element face 1\nproperty list uchar int vertex_index\n{face}end_header\n{rows}3 0 1 2 {face_values}\n"
    )
}

#[test]
fn ignored_ply_properties() {
    let said = |text: String| {
        let loaded = loaded(&[("a.ply", &text)]);
        let warnings: Vec<String> = warnings_of(&loaded).into_iter().map(|(_, m)| m.to_string()).collect();
        (warnings, loaded.left_out)
    };
    let channel = |name: &str| format!("property uchar {name}\n");
    let red = channel("red");
    let color: String = ["red", "green", "blue", "alpha"].into_iter().map(channel).collect();
    assert_eq!(said(ply("", "", "", &red, "9")).0, ["property 'red' of 'face': left out"]);
    let wedges = "property list uchar float texcoord\n";
    let textured = said(ply("comment TextureFile wall.png\n", "", "", wedges, "2 0.5 0.5"));
    assert_eq!(
        textured.0,
        [
            "the texture 'wall.png' of a comment: left out, 'wall.png' does not exist",
            "texture coordinates of 1 faces, whose length is not two numbers per corner: left out"
        ]
    );
    let coordinates = "property float s\nproperty float t\n";
    let missing = said(ply("comment TextureFile wall.png\n", coordinates, "0.5 0.5", "", ""));
    assert_eq!(missing.0, ["the texture 'wall.png' of a comment: left out, 'wall.png' does not exist"]);
    let stray = said(ply("made by hand\n", "", "", "", ""));
    assert!(stray.0.len() == 1 && stray.0[0].contains("line 3") && stray.0[0].contains("'made by hand'"));
    let quality = said(ply("", "property float quality\n", "0.5", "", ""));
    assert!(quality.0.is_empty());
    assert_eq!(quality.1, ["property 'quality' of 'vertex': has no effect on pictures"]);
    assert!(said(ply("", &color, "1 2 3 255", "", "")).0.is_empty());
    let clear = said(ply("", &color, "1 2 3 100", "", ""));
    assert_eq!(clear.0, ["the alpha of 3 vertex colours, which are taken as opaque: left out"]);
}

/// MeshLab names the texture in a comment.
#[test]
fn ply_texture_comment() {
    let coordinates = "property float s\nproperty float t\n";
    let text = ply("comment TextureFile wall.tga\n", coordinates, "0.5 0.5", "", "");
    let picture = [0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0, 10, 20, 30];
    let loaded = load_files(&[("a.ply", text.as_bytes()), ("wall.tga", &picture)]);
    let loaded = loaded.unwrap_or_else(|e| panic!("{e}"));
    assert!(!loaded.warnings.iter().any(|w| w.message.contains("wall")), "{:?}", loaded.warnings);
    let Model::Lambert { albedo } = &loaded.scene.materials[0].model else { panic!("not diffuse") };
    assert!(albedo.texture.is_some() && loaded.scene.images[0].width == 1);
}

/// Two squares with a shared edge, each with its own texture and per-corner texture coordinates, as MeshLab writes them: ascii,
/// and binary.
#[test]
fn ply_per_face_texture_coordinates() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, blue) in [("a.tga", 10), ("b.tga", 200)] {
        let picture = [0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0, blue, 20, 30];
        std::fs::write(folder.path().join(name), picture).expect("written");
    }
    let head = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment TextureFile a.tga\ncomment TextureFile b.tga\n\
             element vertex 6\nproperty float x\nproperty float y\nproperty float z\nelement face 3\n\
             property list uchar int vertex_indices\nproperty list uchar float texcoord\n\
             property int texnumber\nend_header\n"
        )
    };
    let vertices = [
        [0.0f32, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [1.0, 1.0, 0.0],
        [2.0, 1.0, 0.0],
    ];
    let faces: [(&[i32], &[f32], i32); 3] = [
        (&[1, 2, 5, 4], &[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0], 1),
        (&[0, 1, 4], &[0.0, 0.0, 0.5, 0.0, 0.5, 1.0], 0),
        (&[0, 4, 3], &[0.0, 0.0, 0.5, 1.0, 0.0, 1.0], 0),
    ];
    let (mut text, mut binary) = (head("ascii"), head("binary_little_endian").into_bytes());
    for v in vertices {
        text += &format!("{} {} {}\n", v[0], v[1], v[2]);
        v.iter().for_each(|x| binary.extend(x.to_le_bytes()));
    }
    for (corners, wedges, picture) in faces {
        text += &format!("{}", corners.len());
        corners.iter().for_each(|i| text += &format!(" {i}"));
        text += &format!(" {}", wedges.len());
        wedges.iter().for_each(|x| text += &format!(" {x}"));
        text += &format!(" {picture}\n");
        binary.push(corners.len() as u8);
        corners.iter().for_each(|i| binary.extend(i.to_le_bytes()));
        binary.push(wedges.len() as u8);
        wedges.iter().for_each(|x| binary.extend(x.to_le_bytes()));
        binary.extend(picture.to_le_bytes());
    }
    std::fs::write(folder.path().join("text.ply"), text).expect("written");
    std::fs::write(folder.path().join("binary.ply"), binary).expect("written");
    for name in ["text.ply", "binary.ply"] {
        let loaded = load(folder.path().join(name), &LoadOptions::default()).expect("loaded");
        assert!(loaded.warnings.iter().all(|w| w.code == "default-sky"), "{:?}", loaded.warnings);
        let mesh = &loaded.scene.meshes[0];
        let parts: Vec<(u32, u32)> =
            mesh.parts.iter().map(|p| (p.first_triangle, p.triangle_count)).collect();
        assert_eq!(parts, [(0, 2), (2, 2)]);
        // Vertices 1 and 4 lie on the seam.
        assert_eq!(mesh.positions.len(), 8);
        let of = |triangle: usize| mesh.triangles[triangle].map(|i| mesh.uv_sets[0][i as usize]);
        assert_eq!(of(0), [[0.0, 1.0], [0.5, 1.0], [0.5, 0.0]]);
        let corner = |i: u32| (mesh.positions[i as usize], mesh.uv_sets[0][i as usize]);
        let right: Vec<_> = mesh.triangles[2..].as_flattened().iter().map(|&i| corner(i)).collect();
        assert!(right.iter().all(|(p, uv)| uv[0] == p[0] - 1.0 && uv[1] == 1.0 - p[1]), "{right:?}");
        for (part, blue) in mesh.parts.iter().zip([10, 200]) {
            let Model::Lambert { albedo } = &loaded.scene.materials[part.material.index()].model else {
                panic!("not diffuse")
            };
            let texture = &loaded.scene.textures[albedo.texture.expect("a texture").index()];
            let oscura::scene::Texture::Image { image, .. } = texture else { panic!("no image") };
            let texel = loaded.scene.images[image.index()].rgba(0, 0);
            assert!(
                (texel[2] - oscura::color::linear_from_srgb(blue as f32 / 255.0)).abs() < 1e-4,
                "{texel:?}"
            );
        }
    }
}

/// Files of vertices only are point clouds; vertices of line drawings are not.
#[test]
fn obj_files_of_vertices_alone_are_point_clouds() {
    let cloud = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nvn 0 0 1\n";
    let read = loaded(&[("a.obj", cloud)]);
    assert_eq!((read.scene.shapes.len(), read.scene.meshes.len(), read.scene.materials.len()), (3, 0, 3));
    let far = "v 512345.25 4512345.75 1\nv 512346.25 4512345.75 1\nv 512345.25 4512346.75 1\n";
    assert_eq!(loaded(&[("a.obj", far)]).scene.shapes[1].center.x, 512346.25);
    for text in ["v 0 0 0\nv 1 0 0\nl 1 2\n", "vn 0 0 1\n", "o name\n"] {
        let error = load_files(&[("a.obj", text)]).expect_err("no surface");
        assert!(error.problems[0].code == "no-surface", "{error}");
    }
}

const SCENE: &str = "camera = { look_from = [0, 0, 5], look_at = [0, 0, 0] }\n\
                     materials.default = { type = \"lambert\" }\n[[objects]]\n";
const CLOUD: &str = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
                     end_header\n0 0 0\n1 2 3\n";

#[test]
fn point_clouds_in_scene_files() {
    let place = |rest: &str| {
        open(&[("s.toml", &format!("{SCENE}mesh = \"cloud.ply\"\n{rest}")), ("cloud.ply", CLOUD)])
    };
    let scene = place("transform = [{ scale = 2 }]").expect("it loads").scene;
    assert_eq!((scene.shapes.len(), scene.shapes[1].center.to_array()), (2, [2.0, 4.0, 6.0]));
    assert_eq!(
        (scene.shapes[1].radius, scene.materials[scene.shapes[1].material.index()].name.as_str()),
        (0.5, "point")
    );
    let own = place("material = \"default\"").expect("it loads").scene;
    assert_eq!(own.materials[own.shapes[0].material.index()].name, "default");
    let bent = place("transform = [{ scale = [1, 2, 1] }]").expect_err("spheres would be bent");
    assert!(bent.contains("line 4"), "{bent}");
}

#[test]
fn ignored_lights_of_mesh_files_are_reported() {
    let model = r#"{"asset": {"version": "2.0"}, "extensionsUsed": ["KHR_lights_punctual", "ACME_unknown"],
        "scenes": [{"nodes": [0, 1]}], "scene": 0, "cameras": [{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}],
        "nodes": [{"camera": 0, "extensions": {"ACME_unknown": {}}}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}}"#;
    let placed = loaded(&[
        (
            "s.toml",
            &format!(
                "{SCENE}mesh = \"a.gltf\"\n[[objects]]\nsphere = {{ center = [0, 0, 0], radius = 1 }}\n"
            ),
        ),
        ("a.gltf", model),
    ]);
    assert!(placed.notes.iter().any(|n| n.code == "lights-left-out"), "{:?}", placed.notes);
    let scene = "camera = { from = \"a.gltf\" }\nmaterials.default = { type = \"lambert\" }\n\
                 [[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\n";
    let lent = loaded(&[("s.toml", scene), ("a.gltf", model)]);
    assert!(lent.warnings.iter().any(|w| w.message.contains("ACME_unknown")), "{:?}", lent.warnings);
}

#[test]
fn scene_file_keys_without_effect() {
    let refusal = |camera: &str, material: &str| {
        let text = format!(
            "camera = {{ look_from = [0, 0, 5], look_at = [0, 0, 0]{camera} }}\n\
             materials.default = {{ type = \"pbr\"{material} }}\nmaterials.b = {{ type = \"lambert\" }}\n\
             [[objects]]\nsphere = {{ center = [0, 0, 0], radius = 1 }}\n"
        );
        open(&[("s.toml", &text)]).err().unwrap_or_default()
    };
    assert_eq!(refusal("", ""), "");
    assert!(refusal(", focal_length = 35", "").contains("'f_stop'"));
    assert!(refusal(", focus_distance = 3", "").contains("'defocus_angle'"));
    assert_eq!(refusal(", focus_distance = 3, defocus_angle = 0", ""), "");
    assert!(refusal("", ", clearcoat_roughness = 0.5").contains("'clearcoat_roughness'"));
    assert!(refusal("", ", iridescence_ior = 1.5").contains("'iridescence_ior'"));
    let color = ", transmission = 1, volume = true, attenuation_color = [1, 2, 1], attenuation_distance = 1";
    assert!(refusal("", color).contains("'attenuation_color'"));
    let filled = ", volume = true, medium = { density = 5 }";
    assert!(refusal("", filled).contains("'medium'"));
    assert_eq!(refusal("", &format!("{filled}, transmission = 1")), "");
    let faces = "box = { min = [0, 0, 0], max = [1, 1, 1] }\nmaterial = \"default\"\n\
                 materials = [\"default\", \"default\", \"default\", \"default\", \"default\", \"default\"]\n";
    let both = open(&[("s.toml", &format!("{SCENE}{faces}"))]).expect_err("one of them would be lost");
    assert!(both.contains("'materials'"), "{both}");
}
