//! The default scenes: five of the project's, ten generated.

pub mod many;
pub mod models;
mod plants;
pub mod rooms;

use oscura::error::{Error, Result};
use oscura::output::write_atomically;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Number of lights of the hall.
const LAMPS: u32 = 1000;

/// A folder for generated files, removed with its contents when dropped.
pub struct Generated {
    folder: TempDir,
}

impl Generated {
    /// Writes the generated scenes.
    ///
    /// # Errors
    /// An output error if the system's temporary folder takes no files.
    pub fn new() -> Result<Generated> {
        let folder = tempfile::Builder::new().prefix("oscura-bench-").tempdir();
        let failed = |e| Error::output(&std::env::temp_dir(), format!("no folder can be made: {e}"));
        let generated = Generated { folder: folder.map_err(failed)? };
        generated.write("sky.hdr", &models::sky())?;
        generated.write("model.ply", &models::torus(models::RINGS, models::SIDES))?;
        generated.write("tree.ply", &models::torus(60, 30))?;
        generated.write("leaf.png", &plants::leaf_png()?)?;
        generated.write("leaf.bin", &plants::leaf_bin())?;
        generated.write("leaf.gltf", plants::LEAF.as_bytes())?;
        let scenes = [
            ("environment.toml", models::ENVIRONMENT.to_string()),
            ("model.toml", models::MODEL.to_string()),
            ("rough-metal.toml", models::METAL.to_string()),
            ("textured.toml", models::TEXTURED.to_string()),
            ("far-from-origin.toml", models::FAR.to_string()),
            ("hall-of-lamps.toml", rooms::hall(LAMPS)),
            ("slit.toml", rooms::slit()),
            ("interior.toml", rooms::interior()),
            ("foliage.toml", plants::foliage()),
            ("forest.toml", plants::forest()),
        ];
        scenes.iter().try_for_each(|(name, text)| generated.write(name, text.as_bytes()).map(drop))?;
        Ok(generated)
    }

    /// Writes another file into the folder; returns its path.
    ///
    /// # Errors
    /// An output error if the folder takes no more.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf> {
        let path = self.folder.path().join(name);
        write_atomically(&path, bytes).map(|()| path)
    }

    /// Boxes and spheres, environments, many lights, light through a slit, caustics, alpha, instances, many materials, large
    /// coordinates.
    pub fn scenes(&self) -> Vec<PathBuf> {
        let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let own = [
            "assets/cornell-box.gltf",
            "scenes/cornell-spheres.toml",
            "scenes/thesis/final-scene.toml",
            "scenes/thesis/glass-light-behind.toml",
            "scenes/thesis/mirror-ball.toml",
        ];
        let made = [
            "environment.toml",
            "model.toml",
            "rough-metal.toml",
            "textured.toml",
            "hall-of-lamps.toml",
            "slit.toml",
            "interior.toml",
            "foliage.toml",
            "forest.toml",
            "far-from-origin.toml",
        ];
        let own = own.map(|name| project.join(name));
        own.into_iter().chain(made.map(|name| self.folder.path().join(name))).collect()
    }
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
        let model =
            load(generated.folder.path().join("model.ply"), &LoadOptions::default()).expect("a model");
        assert_eq!(model.scene.meshes[0].triangles.len(), 160_000);
        let folder = generated.folder.path().to_path_buf();
        drop(generated);
        assert!(!folder.exists());
    }
}
