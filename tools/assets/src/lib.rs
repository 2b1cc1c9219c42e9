//! The project's own assets as code: meshes, textures and scene files with many objects.

pub mod bricks;
pub mod cornell;
pub mod fur;
mod json;
pub mod mesh;
pub mod random;
pub mod reed;
pub mod scenes;
pub mod world_map;

use std::path::Path;

/// Writes the generated files of `scenes/`: scenes, their textures, and a mesh without texture coordinates.
pub fn write_scenes(folder: &Path) -> Result<(), String> {
    let failed = |path: &Path, e: &dyn std::fmt::Display| format!("{}: {e}", path.display());
    for name in ["thesis", "textures", "meshes"] {
        let path = folder.join(name);
        std::fs::create_dir_all(&path).map_err(|e| failed(&path, &e))?;
    }
    for (name, text) in [
        ("thesis/random-spheres.toml", scenes::random_spheres()),
        ("thesis/final-scene.toml", scenes::everything()),
        ("many-lights.toml", scenes::many_lights()),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|e| failed(&path, &e))?;
    }
    for (name, size, pixels) in [
        ("textures/world-map.png", world_map::SIZE, world_map::pixels()),
        ("textures/bricks.png", bricks::SIZE, bricks::pixels()),
    ] {
        let path = folder.join(name);
        image::save_buffer(&path, &pixels, size, size, image::ExtendedColorType::Rgb8)
            .map_err(|e| failed(&path, &e))?;
    }
    mesh::write_ply(&folder.join("meshes/torus.ply"), 6000)
}
