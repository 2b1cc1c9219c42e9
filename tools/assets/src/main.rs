//! Writes the project's own assets.
//!
//! ```text
//! oscura-assets cornell FILE.gltf              the Cornell box, as committed in assets/
//! oscura-assets reed FILE.gltf                 an animated reed that uses most of glTF, as committed in assets/
//! oscura-assets mesh FOLDER [TRIANGLES]        a wavy torus as mesh.ply, mesh.obj and mesh.glb; 1,300,000 triangles
//! oscura-assets ply FILE.ply [TRIANGLES]       the torus as PLY alone; 1,000,000 triangles
//! oscura-assets quads FILE.obj                 the torus of scenes/million-triangles.toml, before it is subdivided
//! oscura-assets fur FILE.hair [STRANDS]        a ball of fur; 10,000 strands
//! oscura-assets scenes FOLDER                  the generated scenes, textures and meshes of scenes/
//! ```

use oscura_assets::{cornell, fur, mesh, reed, write_scenes};
use std::path::Path;
use std::process::ExitCode;

const USAGE: &str = "usage: oscura-assets cornell FILE.gltf | reed FILE.gltf | mesh FOLDER [TRIANGLES] | ply FILE.ply [TRIANGLES] | quads FILE.obj | fur FILE.hair [STRANDS] | \
scenes FOLDER";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["cornell", file] => std::fs::write(file, cornell::gltf()).map_err(|e| format!("{file}: {e}")),
        ["reed", file] => std::fs::write(file, reed::gltf()).map_err(|e| format!("{file}: {e}")),
        ["mesh", folder] => mesh::write_all(Path::new(folder), 1_300_000),
        ["mesh", folder, n] => triangles(n).and_then(|n| mesh::write_all(Path::new(folder), n)),
        ["ply", file] => mesh::write_ply(Path::new(file), 1_000_000),
        ["ply", file, n] => triangles(n).and_then(|n| mesh::write_ply(Path::new(file), n)),
        ["fur", file] => fur::write(Path::new(file), 10_000),
        ["quads", file] => mesh::write_quads(Path::new(file)),
        ["fur", file, n] => triangles(n).and_then(|n| fur::write(Path::new(file), n)),
        ["scenes", folder] => write_scenes(Path::new(folder)),
        _ => Err(USAGE.to_string()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::from(if message == USAGE { 2 } else { 4 })
        }
    }
}

fn triangles(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n @ 8..=1_000_000_000) => Ok(n),
        _ => Err(format!("'{text}' is no number between 8 and 1,000,000,000")),
    }
}
