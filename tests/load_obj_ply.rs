//! OBJ and PLY files: real models, the formats' corners, and damaged files.

use oscura::error::Error;
use oscura::load::{LoadOptions, Loaded, load};
use oscura::scene::{Model, Scene};
use std::path::{Path, PathBuf};

fn load_files(files: &[(&str, &[u8])]) -> Result<Loaded, Error> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, content) in files {
        std::fs::write(folder.path().join(name), content).expect("written");
    }
    load(&folder.path().join(files[0].0), &LoadOptions::default())
}

fn obj(text: &str) -> Scene {
    load_files(&[("a.obj", text.as_bytes())]).unwrap_or_else(|e| panic!("{e}")).scene
}

fn ply(content: &[u8]) -> Result<Loaded, Error> {
    load_files(&[("a.ply", content)])
}

#[test]
fn real_models_have_their_triangles() {
    let shared = std::env::var_os("OSCURA_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    for (name, triangles) in [("stanford-bunny.obj", 69_451), ("spot.obj", 5_856), ("teapot.ply", 2_256)] {
        let path = shared.join("data/models").join(name);
        if !path.is_file() {
            println!("skipped: {} is absent", path.display());
            continue;
        }
        let loaded = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let total: usize = loaded.scene.meshes.iter().map(|m| m.triangles.len()).sum();
        assert_eq!(total, triangles, "{name}");
    }
}

#[test]
fn obj_corners() {
    // A byte order mark, a continued line, negative indices, and a quad.
    let scene = obj("\u{feff}v 0 0 0\nv 1 0 \\\n0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n");
    assert_eq!(scene.meshes[0].triangles.len(), 2);
    assert!(scene.meshes[0].normals.is_empty());
    // v grows downwards here, upwards in the file.
    let scene = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 0.75\nvn 0 0 2\nf 1/1/1 2/2/1 3/3/1\n");
    assert_eq!(scene.meshes[0].uv_sets[0][2], [0.0, 0.25]);
    assert_eq!(scene.meshes[0].normals[0], [0.0, 0.0, 1.0]);
    // Vertex colours are sRGB-encoded.
    let scene = obj("v 0 0 0 1 0.5 0\nv 1 0 0 1 0.5 0\nv 0 1 0 1 0.5 0\nf 1 2 3\n");
    assert!((scene.meshes[0].colors[0][1] - 0.214_041).abs() < 1e-5);
    assert!(scene.materials[0].use_vertex_colors);
}

#[test]
fn obj_materials() {
    let mtl = b"newmtl a\nKd 0.1 0.2 0.3\nnewmtl b\nKd 1 1 1\nPr 0.4\nPm 1\nnewmtl c\nKe 3 2 1\nnewmtl g\nNi 1.45\nillum 7\n";
    let text = b"mtllib missing.mtl\nmtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\n\
                 f 1 2 3\nusemtl c\nf 1 2 3\nusemtl g\nf 1 2 3\n";
    let loaded = load_files(&[("a.obj", text), ("m.mtl", mtl)]).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.warnings.iter().any(|w| w.message.contains("missing.mtl")), "{:?}", loaded.warnings);
    let by_name = |n: &str| loaded.scene.materials.iter().find(|m| m.name == n).expect("the material");
    assert!(matches!(by_name("a").model, Model::Lambert { albedo } if albedo.factor == [0.1, 0.2, 0.3]));
    assert!(
        matches!(&by_name("b").model, Model::Pbr(p) if p.roughness.factor == 0.4 && p.metallic.factor == 1.0)
    );
    assert_eq!(by_name("c").emission.expect("it shines").radiance.factor, [3.0, 2.0, 1.0]);
    assert!(matches!(by_name("g").model, Model::Dielectric { ior, .. } if ior == 1.45));
}

#[test]
fn obj_errors_name_the_line() {
    let error = load_files(&[("a.obj", b"v 0 0 0\nv 1 x 0\n")]).expect_err("a bad number");
    assert_eq!(error.problems[0].place, "line 2");
    assert!(load_files(&[("a.obj", b"v 0 0 0\n")]).expect_err("no faces").to_string().contains("no faces"));
    assert!(load_files(&[("a.obj", b"v 0 0 0\nf 1 2 3\n")]).is_err());
}

/// A parallelogram with colours, texture coordinates, an element and a property that nobody needs.
fn binary_ply(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut out = format!(
        "ply\r\nformat binary_{order}_endian 1.0\r\nelement vertex 4\r\nproperty double x\r\nproperty float y\r\n\
         property float z\r\nproperty uchar red\r\nproperty uchar green\r\nproperty uchar blue\r\n\
         property float s\r\nproperty float t\r\nelement extra 2\r\nproperty list uchar short what\r\n\
         element face 1\r\nproperty uchar flags\r\nproperty list uchar uint vertex_index\r\nend_header\r\n"
    )
    .into_bytes();
    let mut put = |le: &[u8]| {
        let mut bytes = le.to_vec();
        if big {
            bytes.reverse();
        }
        out.extend(bytes);
    };
    for (x, y) in [(0f64, 0f32), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)] {
        put(&x.to_le_bytes());
        put(&y.to_le_bytes());
        put(&[0; 4]);
        [255u8, 0, 188].iter().for_each(|c| put(&[*c]));
        put(&0.5f32.to_le_bytes());
        put(&0.25f32.to_le_bytes());
    }
    put(&[1]);
    put(&7i16.to_le_bytes());
    [0u8, 9, 4].iter().for_each(|c| put(&[*c]));
    (0..4u32).for_each(|i| put(&i.to_le_bytes()));
    out
}

#[test]
fn ply_reads_both_byte_orders_alike_and_refuses_every_truncation() {
    for big in [false, true] {
        let whole = binary_ply(big);
        let scene = ply(&whole).unwrap_or_else(|e| panic!("{e}")).scene;
        let mesh = &scene.meshes[0];
        assert_eq!(mesh.positions[2], [2.0, 1.0, 0.0]);
        assert_eq!(mesh.triangles.len(), 2);
        assert_eq!(mesh.uv_sets[0][0], [0.5, 0.75]);
        assert!(mesh.colors[0][0] == 1.0 && (mesh.colors[0][2] - 0.502_886).abs() < 1e-5);
        for length in 0..whole.len() {
            assert!(ply(&whole[..length]).is_err(), "{length} bytes");
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
    let scene = ply(text.as_bytes()).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!(scene.meshes[0].triangles, [[0, 1, 2], [2, 1, 3]]);
    let fails = |text: String, part: &str| {
        let shown = ply(text.as_bytes()).expect_err(part).to_string();
        assert!(shown.contains(part), "'{part}' is not in: {shown}");
    };
    let faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    fails(format!("{head}end_header\n{points}"), "point cloud");
    fails(format!("{head}{faces}{points}3 0 1 9\n"), "refers to vertex 9");
    fails(format!("{head}{faces}{points}3 0 1\n"), "line 15");
    fails(format!("{head}{faces}0 0 0\n"), "cut short");
    fails(head.replace("vertex 4", "vertex 18446744073709551616"), "too large");
    fails(format!("{}{faces}{points}", head.replace("vertex 4", "vertex 4000000000000")), "cut short");
    fails("plx".to_string(), "not a PLY file");
}

/// A small generator for damaged files: the same ones on every run (splitmix64).
fn random(state: &mut u64) -> usize {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 1) as usize
}

#[test]
fn damaged_files_never_panic() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = b"o x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\ns 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -1 -2 -3\n";
    let ascii = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let seeds = [
        ("a.obj", text.to_vec()),
        ("b.ply", ascii.to_vec()),
        ("c.ply", binary_ply(false)),
        ("d.ply", binary_ply(true)),
    ];
    let (mut state, mut refused) = (2, 0);
    for (name, original) in &seeds {
        let path = folder.path().join(name);
        for _ in 0..1500 {
            let mut bytes = original.clone();
            for _ in 0..1 + random(&mut state) % 3 {
                let at = random(&mut state) % bytes.len();
                let usual = b"-/ 0123456789.\n"[random(&mut state) % 15];
                match random(&mut state) % 4 {
                    0 => bytes[at] = random(&mut state) as u8,
                    1 => bytes[at] = usual,
                    2 => bytes.insert(at, usual),
                    _ => bytes.truncate(at.max(1)),
                }
            }
            std::fs::write(&path, &bytes).expect("written");
            refused += usize::from(load(&path, &LoadOptions::default()).is_err());
        }
    }
    assert!(refused > 2000, "only {refused} of 6000 were refused");
}
