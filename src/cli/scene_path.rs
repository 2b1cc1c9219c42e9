//! What was given in the place of a scene: a file that isn't there, or a folder.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use oscura::error::{Error, Result};
use oscura::load::{extensions, is_named_as_scene};
use std::path::Path;

/// Most files that a message lists.
const LISTED: usize = 8;

/// Extensions of files that may have been meant as the picture to write.
const PICTURES: [&str; 5] = ["exr", "hdr", "png", "jpg", "jpeg"];

/// Is there a file? Loading it tells what else may be wrong with it.
///
/// # Errors
/// An input error with its remedy where there is none.
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
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if PICTURES.contains(&extension.as_str()) {
        let message = format!("files of type '.{extension}' can't be rendered");
        let help = "it is a picture; the scene comes first: oscura render scene.glb -o picture.png";
        return Err(Error::input(path, message).with_help(help));
    }
    Ok(())
}

/// Adds what to type where a scene stands in the place of a command.
pub(crate) fn explain(mut error: clap::Error) -> clap::Error {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else { return error };
    if error.kind() == ErrorKind::InvalidSubcommand && is_named_as_scene(Path::new(word)) {
        let tip = format!("to render it: oscura render {word} -o picture.png");
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
}

/// Names the scenes in a folder.
fn scenes_in(folder: &Path) -> String {
    let entries = folder.read_dir().into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .map(|entry| entry.file_name())
        .filter(|name| is_named_as_scene(Path::new(name)))
        .map(|name| name.to_string_lossy().into_owned())
        .collect();
    names.sort();
    let more = names.len().saturating_sub(LISTED);
    names.truncate(LISTED);
    match (names.is_empty(), more) {
        (true, _) => {
            let types: Vec<String> = extensions().map(|extension| format!(".{extension}")).collect();
            format!("there are no scenes ({}) in this folder", types.join(", "))
        }
        (false, 0) => format!("the scenes there: {}", names.join(", ")),
        (false, more) => format!("the scenes there: {}, and {more} more", names.join(", ")),
    }
}
