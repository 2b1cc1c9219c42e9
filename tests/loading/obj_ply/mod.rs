//! OBJ and PLY: real models, corner cases of the formats, and damaged files.

mod damage;
mod large_coordinates;
mod mtl;
mod obj;
mod ply;
mod repairs;
mod splats;

use crate::files::load_files;
use crate::skip::skip;
use oscura::error::Error;
use oscura::load::{LoadOptions, Loaded, load};
use oscura::scene::Scene;
use std::path::{Path, PathBuf};

/// The scene of an OBJ file alone.
fn obj_scene(text: impl AsRef<[u8]>) -> Scene {
    load_files(&[("a.obj", text.as_ref())]).unwrap_or_else(|e| panic!("{e}")).scene
}

fn load_ply(content: &[u8]) -> Result<Loaded, Error> {
    load_files(&[("a.ply", content)])
}

/// A parallelogram with colours, texture coordinates, and an unused element and property.
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
fn triangle_counts_of_real_models() {
    let shared = std::env::var_os("OSCURA_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    for (name, triangles) in [("stanford-bunny.obj", 69_451), ("spot.obj", 5_856), ("teapot.ply", 2_256)] {
        let path = shared.join("data/models").join(name);
        if !path.is_file() {
            skip("shared", &format!("{} is absent", path.display()));
            continue;
        }
        let loaded = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let total: usize = loaded.scene.meshes.iter().map(|m| m.triangles.len()).sum();
        assert_eq!(total, triangles, "{name}");
    }
}
