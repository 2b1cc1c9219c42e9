//! Folders of files that appear whole.

use crate::error::{Error, Result};
use std::fs;
use std::io;
use std::path::Path;

/// Can a folder of files be put there? It must be new or empty, unless `replaces`, and its parent must exist.
///
/// # Errors
/// A usage error for a folder that holds something, an output error for one that can't be made.
pub fn check(folder: &Path, replaces: bool) -> Result<()> {
    let parent = folder.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !parent.is_dir() {
        let message = format!("the folder {} does not exist", parent.display());
        return Err(Error::output(folder, message).with_help("create it first"));
    }
    if folder.exists() && !folder.is_dir() {
        return Err(Error::output(folder, "is a file, not a folder").with_help("choose another name"));
    }
    let holds_something = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if holds_something && !replaces {
        let message = format!("{} is not empty", folder.display());
        return Err(Error::usage(message).with_help("choose another name"));
    }
    Ok(())
}

/// Makes a folder with those above it, unless it is there.
///
/// # Errors
/// An output error if that can't be done.
pub fn make(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).map_err(|e| Error::output(folder, format!("can't be made: {e}")))
}

/// Moves the files of one folder to another on the same disk: at once where that doesn't exist or is empty, else one by
/// one. Gives their names in order.
///
/// # Errors
/// An output error with the reason.
pub fn place(files: &Path, folder: &Path) -> Result<Vec<String>> {
    let names = || -> io::Result<Vec<String>> {
        let entries = fs::read_dir(files)?.collect::<io::Result<Vec<_>>>()?;
        let mut names: Vec<String> =
            entries.iter().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        Ok(names)
    };
    let moved = names().and_then(|names| {
        // Fails where it holds something.
        let is_gone = !folder.exists() || fs::remove_dir(folder).is_ok();
        if is_gone {
            fs::rename(files, folder)?;
        } else {
            names.iter().try_for_each(|name| fs::rename(files.join(name), folder.join(name)))?;
        }
        Ok(names)
    });
    moved.map_err(|e| Error::output(folder, format!("can't be written: {e}")))
}
