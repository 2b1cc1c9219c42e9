//! The scenes that are measured when none are named: two of the project's, two made on the spot.

use oscura::error::{Error, Result};
use oscura::output::write_atomically;
use std::path::{Path, PathBuf};

/// Rings of the model and vertices of each: 2 * 400 * 200 = 160,000 triangles.
const RINGS: u32 = 400;
const SIDES: u32 = 200;

/// Size of the environment picture.
const SKY: (u32, u32) = (256, 128);

/// A folder for generated files, removed with its contents when dropped.
pub struct Generated {
    folder: PathBuf,
}

impl Drop for Generated {
    fn drop(&mut self) {
        // A folder left behind in the system's temporary one does no harm.
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

impl Generated {
    /// Writes the generated scenes.
    ///
    /// # Errors
    /// An output error if the system's temporary folder takes no files.
    pub fn new() -> Result<Generated> {
        let folder = std::env::temp_dir().join(format!("oscura-bench-{}", std::process::id()));
        std::fs::create_dir_all(&folder)
            .map_err(|e| Error::output(&folder, format!("can't be created: {e}")))?;
        let generated = Generated { folder };
        let write = |name: &str, bytes: &[u8]| write_atomically(generated.folder.join(name), bytes);
        write("sky.hdr", &sky())?;
        write("environment.toml", ENVIRONMENT.as_bytes())?;
        write("model.ply", &torus())?;
        write("model.toml", MODEL.as_bytes())?;
        Ok(generated)
    }

    /// The Cornell box, glass and metal in it, an environment picture with a small sun, and a model under a sky.
    pub fn scenes(&self) -> Vec<PathBuf> {
        let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        vec![
            project.join("assets/cornell-box.gltf"),
            project.join("scenes/cornell-spheres.toml"),
            self.folder.join("environment.toml"),
            self.folder.join("model.toml"),
        ]
    }
}

const ENVIRONMENT: &str = r#"
environment = { image = "sky.hdr" }
camera = { look_from = [3, 1.5, 5], look_at = [0, 0.7, 0], vfov = 35, aspect_ratio = 1.5 }

[materials]
ground = { type = "lambert", color = 0.5 }
gold = { type = "metal", color = [1, 0.77, 0.34], roughness = 0.3 }
plastic = { type = "pbr", base_color = [0.1, 0.3, 0.6], roughness = 0.4 }

[[objects]]
sphere = { center = [-1.1, 1, 0], radius = 1 }
material = "gold"

[[objects]]
sphere = { center = [1.1, 1, 0], radius = 1 }
material = "plastic"

[[objects]]
quad = { corner = [-20, 0, 20], u = [40, 0, 0], v = [0, 0, -40] }
material = "ground"
"#;

const MODEL: &str = r#"
environment = { sky = {} }
camera = { look_from = [1.5, 2.5, 3], look_at = [0, 0, 0], vfov = 40, aspect_ratio = 1.5 }

[materials]
clay = { type = "lambert", color = [0.7, 0.5, 0.4] }

[[objects]]
mesh = "model.ply"
material = "clay"
"#;

/// A waving torus of radii 1 and 0.4 as binary PLY.
fn torus() -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        RINGS * SIDES,
        2 * RINGS * SIDES
    );
    let mut bytes = header.into_bytes();
    let turn = |i: u32, n: u32| f64::from(i) / f64::from(n) * std::f64::consts::TAU;
    for (i, j) in (0..RINGS).flat_map(|i| (0..SIDES).map(move |j| (i, j))) {
        let (u, v) = (turn(i, RINGS), turn(j, SIDES));
        let radius = 0.4 + 0.05 * (9.0 * u).sin() * (5.0 * v).cos();
        let ring = 1.0 + radius * v.cos();
        for x in [ring * u.cos(), radius * v.sin(), -ring * u.sin()] {
            bytes.extend((x as f32).to_le_bytes());
        }
    }
    let at = |i: u32, j: u32| (i % RINGS) * SIDES + j % SIDES;
    for (i, j) in (0..RINGS).flat_map(|i| (0..SIDES).map(move |j| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        for corner in [[a, b, c], [a, c, d]] {
            bytes.push(3);
            bytes.extend(corner.iter().flat_map(|v| v.to_le_bytes()));
        }
    }
    bytes
}

/// A blue sky over grey ground with a sun of 4 texels, 2000 times as bright as the sky, as Radiance HDR without run
/// lengths.
fn sky() -> Vec<u8> {
    let (width, height) = SKY;
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        // A value is mantissa * 2^(exponent - 136).
        let sun = (30..32).contains(&y) && (60..62).contains(&x);
        bytes.extend(match sun {
            true => [250, 225, 190, 139],
            false if 2 * y < height => [100, 140, 220, 128],
            false => [80, 75, 70, 127],
        });
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use oscura::load::{LoadOptions, load};

    #[test]
    fn the_default_scenes_load_without_warnings() {
        let generated = Generated::new().unwrap_or_else(|e| panic!("{e}"));
        for path in generated.scenes() {
            let loaded = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
            assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        }
        let model = load(generated.folder.join("model.ply"), &LoadOptions::default()).expect("a model");
        assert_eq!(model.scene.meshes[0].triangles.len(), 160_000);
        let folder = generated.folder.clone();
        drop(generated);
        assert!(!folder.exists());
    }
}
