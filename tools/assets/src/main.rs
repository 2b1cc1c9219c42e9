//! Writes the project's own assets.
//!
//! ```text
//! oscura-assets cornell FILE.gltf              the Cornell box, as committed in assets/
//! oscura-assets reed FILE.gltf                 an animated reed that uses most of glTF, as committed in assets/
//! oscura-assets mesh FOLDER [TRIANGLES]        a knotted torus as mesh.ply, mesh.obj and mesh.glb; 1,300,000 triangles
//! ```

mod base64;
mod cornell;
mod json;
mod mesh;
mod reed;

use std::path::Path;
use std::process::ExitCode;

const USAGE: &str = "usage: oscura-assets cornell FILE.gltf | oscura-assets reed FILE.gltf | oscura-assets mesh FOLDER [TRIANGLES]";
const TRIANGLES: usize = 1_300_000;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["cornell", file] => std::fs::write(file, cornell::gltf()).map_err(|e| format!("{file}: {e}")),
        ["reed", file] => std::fs::write(file, reed::gltf()).map_err(|e| format!("{file}: {e}")),
        ["mesh", folder] => mesh::write_all(Path::new(folder), TRIANGLES),
        ["mesh", folder, triangles] => match triangles.parse() {
            Ok(n @ 8..=1_000_000_000) => mesh::write_all(Path::new(folder), n),
            _ => Err(format!("'{triangles}' is no number of triangles between 8 and 1,000,000,000")),
        },
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
