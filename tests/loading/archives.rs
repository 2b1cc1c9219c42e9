//! Compressed models, models in archives, and unsupported files.

use crate::codes::code_of;
use crate::files::{load_files, refused_copies};
use flate2::Compression;
use flate2::write::{DeflateEncoder, GzEncoder};
use oscura::error::Error;
use oscura::load::Loaded;
use std::io::Write;
use std::path::Path;

const OBJ: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";
const PLY: &[u8] = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                     element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

fn read(name: &str, bytes: &[u8]) -> Result<Loaded, Error> {
    load_files(&[(name, bytes)])
}

fn triangles(loaded: &Result<Loaded, Error>) -> usize {
    let loaded = loaded.as_ref().unwrap_or_else(|e| panic!("{e}"));
    loaded.scene.meshes.iter().map(|mesh| mesh.triangles.len()).sum()
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("packed")
}

/// A ZIP archive with deflated entries.
pub fn zip(files: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, content) in files {
        let mut encoder = DeflateEncoder::new(Vec::new(), Compression::fast());
        let packed = encoder.write_all(content).and_then(|()| encoder.finish()).expect("packed");
        let mut common = [[20, 0], [0, 0], [8, 0], [0, 0], [0, 0]].concat();
        common.extend(crc32fast::hash(content).to_le_bytes());
        common.extend((packed.len() as u32).to_le_bytes());
        common.extend((content.len() as u32).to_le_bytes());
        common.extend((name.len() as u16).to_le_bytes());
        // Extra field, comment, disk and attributes are empty; the offset comes last.
        directory.extend([&b"PK\x01\x02\x14\0"[..], &common, &[0; 12]].concat());
        directory.extend((bytes.len() as u32).to_le_bytes());
        directory.extend(name.as_bytes());
        bytes.extend([&b"PK\x03\x04"[..], &common, &[0; 2], name.as_bytes(), &packed].concat());
    }
    let at = bytes.len() as u32;
    let count = (files.len() as u16).to_le_bytes();
    bytes.extend(&directory);
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend([count, count].concat());
    bytes.extend((directory.len() as u32).to_le_bytes());
    bytes.extend(at.to_le_bytes());
    bytes.extend([0, 0]);
    bytes
}

#[test]
fn compressed_models_load() {
    assert_eq!(triangles(&read("a.ply.gz", &gzip(PLY))), 1);
    assert_eq!(triangles(&read("a.obj.gz", &gzip(OBJ))), 1);
    // Detected by content, not by name.
    assert_eq!(triangles(&read("a.ply", &gzip(PLY))), 1);
    let cut = read("a.ply.gz", &gzip(PLY)[..40]).expect_err("it is cut");
    assert!(cut.to_string().contains("gzip"), "{cut}");
}

#[test]
fn archives_contain_a_model_with_its_files() {
    let picture = include_bytes!("obj_ply/pixel.png");
    let library = b"newmtl a\nmap_Kd maps/a.png\n";
    let files =
        [("readme.txt", &b"?"[..]), ("m/a.obj", OBJ), ("m/a.mtl", library), ("m/maps/a.png", picture)];
    for name in ["a.zip", "a.obj"] {
        let loaded = read(name, &zip(&files));
        assert_eq!((triangles(&loaded), loaded.expect("it loads").scene.images.len()), (1, 1));
    }
    // glTF takes precedence.
    let both = read("a.zip", &zip(&[("a.ply", PLY), ("z.gltf", b"{}")])).expect_err("the glTF is none");
    assert!(both.to_string().contains("/asset/version"), "{both}");
}

/// Images that are decoded later stay available as long as the scene.
#[test]
fn deferred_images_of_archives_stay_available() {
    let mut picture = std::io::Cursor::new(Vec::new());
    let noisy = image::RgbImage::from_fn(700, 700, |x, y| image::Rgb([(x * y) as u8, x as u8, y as u8]));
    noisy.write_to(&mut picture, image::ImageFormat::Png).expect("encoded");
    let picture = picture.into_inner();
    let files = [("a.obj", OBJ), ("a.mtl", &b"newmtl a\nmap_Kd a.png\n"[..]), ("a.png", &picture[..])];
    let loaded = read("a.zip", &zip(&files)).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.scene.images[0].is_encoded(), "small ones are decoded at once");
    let decoded =
        loaded.scene.images[0].decoded(&mut Vec::new()).unwrap_or_else(|damage| panic!("{damage:?}"));
    assert_eq!((decoded.width, decoded.height), (700, 700));
}

#[test]
fn invalid_and_hostile_archives_are_refused() {
    let whole = zip(&[("a.obj", OBJ)]);
    let refusal = |bytes: &[u8]| code_of(&read("a.zip", bytes).expect_err("it is refused"));
    assert_eq!(refusal(&whole[..whole.len() - 30]), "zip-damaged");
    assert_eq!(refusal(&zip(&[("a.txt", b"?")])), "zip-without-model");
    let other = read("a.zip", &zip(&[("b/a.mb", b"?")])).expect_err("it is refused").to_string();
    assert!(other.contains("holds 'b/a.mb'"), "{other}");
    let renamed = read("a.obj", b"ply\nformat ascii 1.0\n").expect_err("it is refused").to_string();
    assert!(renamed.contains("is a PLY model"), "{renamed}");
    assert_eq!(refusal(&zip(&[("../a.obj", OBJ)])), "path-outside");
    assert_eq!(refusal(b"no archive"), "zip-missing");
    let mut claims = whole.clone();
    let at = claims.windows(4).position(|w| w == b"PK\x01\x02").expect("a directory");
    claims[at + 24..at + 28].copy_from_slice(&0x7fff_ffffu32.to_le_bytes());
    let error = read("a.zip", &claims).expect_err("it is refused").to_string();
    assert!(error.contains("'a.obj'"), "{error}");
    // The last two bytes are the length of a comment.
    for cut in 0..whole.len() - 2 {
        assert!(read("a.zip", &whole[..cut]).is_err());
    }
}

#[test]
fn unsupported_files_are_reported_with_a_hint() {
    for (name, bytes, what, remedy) in [
        ("a.glb", &b"version https://git-lfs.github.com/spec/v1\noid"[..], "Git LFS", "git lfs pull"),
        ("a.glb", b"<!DOCTYPE html><html>", "web page", "download"),
        ("a.ply", b"\n<html><body>", "web page", "download"),
        ("a.obj", b"Rar!\x1a\x07\0", "RAR", "unpack"),
        ("a.obj", b"glTF\x02\0\0\0", "glTF", ".glb"),
        ("a.stl", b"", "empty", "again"),
    ] {
        let error = read(name, bytes).expect_err(what).to_string();
        assert!(error.contains(what) && error.contains(remedy), "{error}");
    }
}

/// VRM avatars are glTF with another extension.
#[test]
fn vrm_files_are_gltf() {
    let error = read("a.vrm", b"{}").expect_err("it is empty").to_string();
    assert!(error.contains("/asset/version"), "{error}");
}

/// Models often come in archives with their textures.
#[test]
fn warnings_name_the_archive() {
    let loaded = read("a.zip", &zip(&[("a.obj", OBJ)])).expect("it loads");
    let files: Vec<&Path> = loaded.warnings.iter().filter_map(|w| w.file.as_deref()).collect();
    assert!(files.iter().all(|file| file.ends_with("a.zip")) && !files.is_empty(), "{files:?}");
}

/// Binary and ASCII STL, a compressed PLY and an archive with random damage: errors or valid scenes, never a panic.
#[test]
fn damaged_files_never_panic() {
    let mut stl = vec![0; 80];
    stl.extend(2u32.to_le_bytes());
    for _ in 0..2 {
        let numbers = [0.0f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        stl.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        stl.extend([0xff, 0x83]);
    }
    let text = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    let seeds = [
        ("a.stl", stl),
        ("b.stl", text.to_vec()),
        ("c.ply.gz", gzip(PLY)),
        ("d.zip", zip(&[("a.obj", OBJ), ("a.mtl", b"newmtl a\n")])),
    ];
    let refused: usize = seeds
        .iter()
        .map(|(name, original)| {
            refused_copies(original, b"\xff\0 1e.", 2500, |bytes| read(name, bytes).is_err())
        })
        .sum();
    assert!(refused > 3000, "only {refused} of 10000 were refused");
}
