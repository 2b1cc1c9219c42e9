//! Coordinates beyond single precision and point clouds of OBJ files.

use super::*;
use crate::files::load_files_by;
use oscura::Renderer;
use oscura::glam::DVec3;
use oscura::load::stage::StageOptions;

/// Vertices of a roof, in metres; exact in single precision near the origin.
const ROOF: [[f64; 3]; 6] = [
    [0.25, 0.0, 0.125],
    [9.75, -0.375, 0.0],
    [9.5, 7.8125, 0.25],
    [-0.5, 8.0, 0.0625],
    [-0.25, 4.0, 5.5],
    [9.25, 3.75, 5.625],
];
const FACES: [&[u32]; 5] = [&[0, 1, 5, 4], &[2, 3, 4, 5], &[3, 0, 4], &[1, 2, 5], &[3, 2, 1, 0]];
/// A file of it at a position.
type Content = fn(DVec3) -> Vec<u8>;

/// A typical UTM position.
const PLACE: DVec3 = DVec3::new(512_345.0, 4_512_345.0, 0.0);

fn obj(place: DVec3) -> Vec<u8> {
    let mut text = String::new();
    for corner in ROOF {
        let [x, y, z] = (DVec3::from(corner) + place).to_array();
        text += &format!("v {x} {y} {z}\n");
    }
    for face in FACES {
        let corners: Vec<String> = face.iter().map(|i| (i + 1).to_string()).collect();
        text += &format!("f {}\n", corners.join(" "));
    }
    text.into_bytes()
}

/// Binary with doubles, or ascii declared as floats.
fn ply(place: DVec3, is_binary: bool) -> Vec<u8> {
    let (format, kind) = if is_binary { ("binary_big_endian", "double") } else { ("ascii", "float") };
    let mut out = format!(
        "ply\nformat {format} 1.0\nelement vertex 6\nproperty {kind} x\nproperty {kind} y\nproperty {kind} z\n\
         element face 5\nproperty list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    for corner in ROOF {
        let p = (DVec3::from(corner) + place).to_array();
        match is_binary {
            true => p.iter().for_each(|v| out.extend(v.to_be_bytes())),
            false => out.extend(format!("{} {} {}\n", p[0], p[1], p[2]).bytes()),
        }
    }
    for face in FACES {
        match is_binary {
            true => {
                out.push(face.len() as u8);
                face.iter().for_each(|i| out.extend(i.to_be_bytes()));
            }
            false => {
                let corners: Vec<String> = face.iter().map(ToString::to_string).collect();
                out.extend(format!("{} {}\n", face.len(), corners.join(" ")).bytes());
            }
        }
    }
    out
}

fn on_stage(name: &str, content: &[u8]) -> Loaded {
    let options = LoadOptions {
        up: oscura::load::Up::Z,
        stage: StageOptions { aspect: Some(1.0), ..StageOptions::studio() },
        ..LoadOptions::default()
    };
    load_files_by(&[(name, content)], &options).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn distant_models_match_near_ones_bitwise() {
    let files: [(&str, Content); 3] =
        [("a.obj", obj), ("b.ply", |p| ply(p, true)), ("c.ply", |p| ply(p, false))];
    for (name, content) in files {
        let (far, near) = (on_stage(name, &content(PLACE)), on_stage(name, &content(DVec3::ZERO)));
        // Rotated upright with the model.
        assert!((far.offset - DVec3::new(512_350.0, 0.0, -4_512_349.0)).length() < 10.0, "{}", far.offset);
        assert_eq!(near.offset, DVec3::ZERO);
        assert!(far.notes.iter().any(|n| n.message.contains("(5123")), "{name}: {:?}", far.notes);
        // The centre is rounded to whole metres: the nearby file around the same origin.
        let middle = DVec3::new(far.offset.x, -far.offset.z, 0.0) - PLACE;
        let around = on_stage(name, &content(-middle));
        assert_eq!(far.scene.meshes[0].positions, around.scene.meshes[0].positions, "{name}");
        let picture = |loaded: Loaded| {
            let picture = Renderer::new(loaded).size(24, 24).samples(4).render().expect("a picture");
            let offset = picture.output_options().metadata.world_offset;
            (picture.film().rgba(), offset)
        };
        let offset = far.offset;
        let (far, near) = (picture(far), picture(around));
        assert_eq!((far.1, near.1), (Some(offset), None), "{name}");
        assert!(far.0 == near.0, "{name}: the pictures differ");
    }
}

#[test]
fn moderately_distant_models_are_unchanged() {
    let loaded = on_stage("a.obj", &obj(DVec3::new(100.0, -200.0, 50.0)));
    assert_eq!(loaded.offset, DVec3::ZERO);
}

#[test]
fn obj_points_are_coloured_spheres() {
    let text = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 1 0 0\nv 9 9 9\np 1 2\np -2/1\n";
    let loaded = load_files(&[("a.obj", text.as_bytes())]).unwrap_or_else(|e| panic!("{e}"));
    let scene = &loaded.scene;
    assert_eq!((scene.shapes.len(), scene.materials.len()), (3, 2));
    assert_eq!(scene.shapes[2].center, DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(scene.shapes[0].material, scene.shapes[2].material);
    assert_eq!(loaded.notes[0].code, "point-cloud", "{:?}", loaded.notes);
    let wrong = load_files(&[("a.obj", b"v 0 0 0\np 2\n")]).expect_err("no such vertex");
    assert!(wrong.problems[0].code == "no-surface" && wrong.to_string().contains("line 2"), "{wrong}");
}
