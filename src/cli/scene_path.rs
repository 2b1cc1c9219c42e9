//! What was given in the place of a scene: a file that isn't there, a folder, a file of another program.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use oscura::error::{Error, Result};
use std::path::Path;

/// Endings of the files that can be rendered.
const SCENES: [&str; 5] = ["gltf", "glb", "obj", "ply", "toml"];
/// Most files that a message lists.
const LISTED: usize = 8;

/// Is there a file that may be a scene?
///
/// # Errors
/// An input error with its remedy where there is none, or its ending is that of something else.
pub(crate) fn check(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::input(path, "is a folder").with_help(scenes_in(path)));
    }
    // What else may be wrong with a path, reading it tells.
    if matches!(path.try_exists(), Ok(false)) {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let (message, help) = match folder.is_dir() {
            true => ("there is no such file".to_string(), scenes_in(folder)),
            false => {
                (format!("the folder {} does not exist", folder.display()), "check the path".to_string())
            }
        };
        return Err(Error::input(path, message).with_help(help));
    }
    let extension = extension(path);
    match foreign(&extension) {
        Some(help) => {
            Err(Error::input(path, format!("files of type '.{extension}' can't be rendered")).with_help(help))
        }
        None => Ok(()),
    }
}

/// Adds what to type where a scene stands in the place of a command.
pub(crate) fn explain(mut error: clap::Error) -> clap::Error {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else { return error };
    if error.kind() == ErrorKind::InvalidSubcommand && SCENES.contains(&extension(Path::new(word)).as_str()) {
        let tip = format!("to render it: oscura render {word} -o picture.png");
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
}

/// The way to a scene from a file of another program, by its ending.
fn foreign(extension: &str) -> Option<&'static str> {
    Some(match extension {
        "blend" => {
            "export it from Blender as glTF (File > Export > glTF 2.0), with cameras and punctual lights"
        }
        "fbx" | "dae" | "3ds" | "max" | "ma" | "mb" | "c4d" | "abc" | "usd" | "usda" | "usdc" | "usdz"
        | "stl" => "import it into Blender and export it as glTF (.glb)",
        "exr" | "hdr" | "png" | "jpg" | "jpeg" => {
            "it is a picture; the scene comes first: oscura render scene.glb -o picture.png"
        }
        _ => return None,
    })
}

/// Names the scenes in a folder.
fn scenes_in(folder: &Path) -> String {
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .map(|entry| entry.file_name())
        .filter(|name| SCENES.contains(&extension(Path::new(name)).as_str()))
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    names.sort();
    let more = names.len().saturating_sub(LISTED);
    names.truncate(LISTED);
    match (names.is_empty(), more) {
        (true, _) => "there are no scenes (.gltf, .glb, .obj, .ply, .toml) in this folder".to_string(),
        (false, 0) => format!("the scenes there: {}", names.join(", ")),
        (false, more) => format!("the scenes there: {}, and {more} more", names.join(", ")),
    }
}

fn extension(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}
