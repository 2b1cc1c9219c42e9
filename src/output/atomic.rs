//! Files that appear whole or not at all.

use crate::error::{Error, Result};
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Removes its file when dropped, unless told that the file has moved.
struct Temporary {
    path: PathBuf,
    armed: bool,
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if self.armed {
            // Nothing better can be done with a failure here: the error that led here is already on its way.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Finds out, before any work, whether a file of this name can be written: its folder must exist and take new files.
///
/// # Errors
/// An output error with the reason.
pub fn check_target(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::output(path, "is a folder, not a file").with_help("give a file name in it"));
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        return Err(Error::output(path, format!("the folder {} does not exist", folder.display()))
            .with_help("create it first"));
    }
    create(path).map(drop)
}

/// Would both paths be the same file? Folders are compared as they really are, so `a.png` is `./a.png`, also through
/// links; names that differ are different files, on every system.
pub fn is_same_target(a: &Path, b: &Path) -> bool {
    let folder = |path| fs::canonicalize(folder_of(path)).unwrap_or_else(|_| folder_of(path).to_path_buf());
    a == b || (a.file_name() == b.file_name() && folder(a) == folder(b))
}

/// Writes a file under a temporary name in the same folder, makes sure that it is on the disk, and renames it.
///
/// # Errors
/// An output error with the reason; the temporary file is gone then and an older file of that name unharmed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    let (mut temporary, mut file) = create(path)?;
    let failed = |e: std::io::Error| Error::output(path, format!("can't be written: {e}"));
    file.write_all(bytes).and_then(|()| file.sync_all()).map_err(failed)?;
    drop(file);
    fs::rename(&temporary.path, path).map_err(failed)?;
    temporary.armed = false;
    // The rename itself becomes durable with the folder; some systems can't sync folders, and lose nothing else by it.
    let _ = File::open(folder_of(path)).and_then(|folder| folder.sync_all());
    Ok(())
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn create(path: &Path) -> Result<(Temporary, File)> {
    let name = path.file_name().ok_or_else(|| Error::output(path, "is not a file name"))?;
    let mut last = None;
    for attempt in 0..100 {
        let mut hidden = OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{}-{attempt}.tmp", std::process::id()));
        let candidate = folder_of(path).join(hidden);
        match OpenOptions::new().write(true).create_new(true).open(&candidate) {
            Ok(file) => return Ok((Temporary { path: candidate, armed: true }, file)),
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => last = Some(e),
            Err(e) => return Err(Error::output(path, format!("can't be written: {e}"))),
        }
    }
    let reason = last.map_or_else(String::new, |e| e.to_string());
    Err(Error::output(path, format!("no free name for a temporary file: {reason}")))
}
