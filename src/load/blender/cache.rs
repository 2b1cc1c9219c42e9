//! The exporter's cache: baked images and grids. Each file of the folder is one of
//! them, named by a hash of all that it was made from (32 hexadecimal digits and `.oscura`), so that none is ever out of
//! date. The exporter deletes those that were not used for longest once there is too much (`cache.py`).

use crate::error::{Error, Result};
use std::env;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The extension of the files.
const EXTENSION: &str = "oscura";

/// Size of the cache.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Kept {
    /// Number of files.
    pub files: u64,
    /// Their size in bytes.
    pub bytes: u64,
}

/// The default cache folder: `oscura/blender` in the system's folder for caches
/// (`XDG_CACHE_HOME` or `~/.cache`, `~/Library/Caches`, `LOCALAPPDATA`); `None` where there is no such folder.
pub fn default_cache() -> Option<PathBuf> {
    let named = |name: &str| env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let parent = match env::consts::OS {
        "windows" => named("LOCALAPPDATA"),
        "macos" => named("HOME").map(|home| home.join("Library/Caches")),
        _ => named("XDG_CACHE_HOME").or_else(|| named("HOME").map(|home| home.join(".cache"))),
    };
    parent.filter(|parent| parent.is_absolute()).map(|parent| parent.join("oscura/blender"))
}

/// Size of a cache folder; 0 if it doesn't exist.
///
/// # Errors
/// An input error for a folder that can't be read.
pub fn kept(folder: &Path) -> Result<Kept> {
    let files = files(folder).map_err(|e| Error::input(folder, format!("can't be read: {e}")))?;
    Ok(Kept { files: files.len() as u64, bytes: files.iter().map(|(_, bytes)| bytes).sum() })
}

/// Deletes what a folder keeps, and no other file; says how much that was.
///
/// # Errors
/// An output error for files that can't be deleted.
pub fn clear(folder: &Path) -> Result<Kept> {
    let before = kept(folder)?;
    let files = files(folder).map_err(|e| Error::input(folder, format!("can't be read: {e}")))?;
    for (path, _) in files {
        fs::remove_file(&path).map_err(|e| Error::output(&path, format!("can't be deleted: {e}")))?;
    }
    Ok(before)
}

/// The files of a folder that the exporter has made, with their sizes.
fn files(folder: &Path) -> io::Result<Vec<(PathBuf, u64)>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut found = Vec::new();
    for entry in entries {
        let entry = entry?;
        let metadata = entry.metadata()?;
        if metadata.is_file() && is_ours(&entry.path()) {
            found.push((entry.path(), metadata.len()));
        }
    }
    Ok(found)
}

fn is_ours(path: &Path) -> bool {
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let is_hash = stem.len() == 32 && stem.bytes().all(|b| b.is_ascii_hexdigit());
    is_hash && path.extension().is_some_and(|extension| extension == EXTENSION)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_the_exporter_made_is_deleted() {
        let folder = tempfile::tempdir().expect("a folder");
        let ours = folder.path().join(format!("{}.oscura", "0123456789abcdef".repeat(2)));
        let others = ["notes.txt", "scene.oscura", "0123.oscura"].map(|name| folder.path().join(name));
        others.iter().chain([&ours]).for_each(|path| fs::write(path, "text").expect("written"));
        assert_eq!(kept(folder.path()).expect("read"), Kept { files: 1, bytes: 4 });
        assert_eq!(clear(folder.path()).expect("cleared"), Kept { files: 1, bytes: 4 });
        assert!(!ours.exists() && others.iter().all(|path| path.exists()));
        assert_eq!(kept(&folder.path().join("missing")).expect("no folder"), Kept::default());
    }
}
