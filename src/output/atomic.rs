//! Atomic writing of files and folders, and the formats of pictures by file extension.

use crate::error::{Error, Result, Warning};
use std::ffi::OsString;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;
use std::{fs, io};
use tempfile::NamedTempFile;

/// Checks in advance whether a file can be written: its folder must exist and be writable.
///
/// # Errors
/// An output error with the reason.
pub fn check_target(path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
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

/// Do two paths refer to the same file? Folders are canonicalised, so `a.png` equals `./a.png`, also through symbolic links;
/// file names are compared literally on all systems.
pub fn is_same_target(a: &Path, b: &Path) -> bool {
    let folder = |path| fs::canonicalize(folder_of(path)).unwrap_or_else(|_| folder_of(path).to_path_buf());
    a == b || (a.file_name() == b.file_name() && folder(a) == folder(b))
}

/// Writes a file under a temporary name in the same folder, syncs it to the disk, and renames it.
///
/// # Errors
/// An output error with the reason; the temporary file is then removed and an existing file unchanged.
pub fn write_atomically(path: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
    write_with(path.as_ref(), &mut |writer| writer.write_all(bytes))
}

/// [`write_atomically`] with a writer function.
///
/// # Errors
/// As for [`write_atomically`].
pub(super) fn write_with(path: &Path, write: &mut dyn FnMut(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let mut temporary = create(path)?;
    let mut writer = BufWriter::with_capacity(1 << 18, temporary.as_file_mut());
    let written = write(&mut writer).and_then(|()| writer.flush());
    drop(writer);
    written.map_err(|e| failure(path, &e))?;
    persist(temporary, path)
}

/// Syncs a file of [`create`] to the disk and renames it to its target.
///
/// # Errors
/// As for [`write_atomically`].
pub(super) fn persist(temporary: NamedTempFile, path: &Path) -> Result<()> {
    let path = &resolve_links(path);
    let synced = temporary.as_file().sync_all();
    synced.and_then(|()| Ok(temporary.persist(path)?)).map_err(|e| failure(path, &e))?;
    // Syncing the folder makes the rename durable; systems that can't sync folders return an error, which is ignored.
    let _ = File::open(folder_of(path)).and_then(|folder| folder.sync_all());
    Ok(())
}

/// Removes a file; `false` if there was none.
///
/// # Errors
/// An output error with the reason.
pub fn remove_file(path: &Path) -> Result<bool> {
    match fs::remove_file(path) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(Error::output(path, format!("can't be removed: {error}"))),
    }
}

/// Removes temporary files of a target left by killed runs. Files of the last hour are kept, since another run may be writing them.
pub fn remove_leftovers(path: &Path) {
    const MIN_AGE: Duration = Duration::from_secs(3600);
    let Some((prefix, folder)) = hidden_prefix(path).zip(fs::read_dir(folder_of(path)).ok()) else { return };
    for entry in folder.flatten() {
        let name = entry.file_name();
        let is_leftover =
            name.to_string_lossy().strip_prefix(&*prefix.to_string_lossy()).is_some_and(|rest| {
                rest.strip_suffix(SUFFIX).is_some_and(|id| id.chars().all(|c| c.is_ascii_alphanumeric()))
            });
        let age =
            entry.metadata().and_then(|data| data.modified()).map(|time| time.elapsed().unwrap_or_default());
        if is_leftover && age.is_ok_and(|age| age >= MIN_AGE) {
            // A failure is harmless.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Suffix of temporary files.
const SUFFIX: &str = ".tmp";

/// Prefix of temporary files for a target.
fn hidden_prefix(path: &Path) -> Option<OsString> {
    let mut hidden = OsString::from(".");
    let name = path.file_name()?;
    if name.len() <= MAX_NAME_BYTES {
        hidden.push(name);
    } else {
        // The name of the temporary file must not exceed the maximum length.
        let name = name.to_string_lossy();
        let end = (0..=MAX_NAME_BYTES).rev().find(|&at| name.is_char_boundary(at)).unwrap_or(0);
        hidden.push(&name[..end]);
    }
    hidden.push(".");
    Some(hidden)
}

/// Maximum number of bytes of the target's name in the temporary file's name. (Most systems allow names of 255 bytes.)
const MAX_NAME_BYTES: usize = 200;

/// Resolves symbolic links, so that the link is kept and its target replaced.
fn resolve_links(path: &Path) -> PathBuf {
    /// Maximum length of a chain of links.
    const MAX_LINKS: usize = 40;
    let mut path = path.to_path_buf();
    for _ in 0..MAX_LINKS {
        let Ok(link) = fs::read_link(&path) else { break };
        path = folder_of(&path).join(link);
    }
    path
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A temporary file in the folder of the target, removed when dropped, with default permissions (by the umask) for the final file.
pub(super) fn create(path: &Path) -> Result<NamedTempFile> {
    let path = &resolve_links(path);
    let hidden = hidden_prefix(path).ok_or_else(|| Error::output(path, "is not a file name"))?;
    tempfile::Builder::new()
        .prefix(&hidden)
        .suffix(SUFFIX)
        .make_in(folder_of(path), |candidate| File::create_new(candidate))
        .map_err(|e| failure(path, &e))
}

fn failure(path: &Path, error: &io::Error) -> Error {
    Error::output(path, format!("can't be written: {error}"))
}

// Folders.

/// Checks a target folder: its parent must exist, and it must be new or empty unless `replaces`.
///
/// # Errors
/// A usage error for a folder that isn't empty, an output error for one that can't be created.
pub fn check_folder(folder: &Path, replaces: bool) -> Result<()> {
    let parent = folder.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !parent.is_dir() {
        let message = format!("the folder {} does not exist", parent.display());
        return Err(Error::output(folder, message).with_help("create it first"));
    }
    if folder.exists() && !folder.is_dir() {
        return Err(Error::output(folder, "is a file, not a folder").with_help("choose another name"));
    }
    let is_filled = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if is_filled && !replaces {
        let message = format!("{} is not empty", folder.display());
        return Err(Error::usage(message).with_help("choose another name"));
    }
    Ok(())
}

/// Creates a folder and its parents if they don't exist.
///
/// # Errors
/// An output error with the reason.
pub fn make_folder(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).map_err(|e| Error::output(folder, format!("can't be created: {e}")))
}

/// Moves the files of a folder to another one on the same disk: atomically if the target doesn't exist or is empty, else one by one.
/// Returns their names, sorted.
///
/// # Errors
/// An output error with the reason.
pub fn move_folder(files: &Path, folder: &Path) -> Result<Vec<String>> {
    let names = || -> io::Result<Vec<String>> {
        let entries = fs::read_dir(files)?.collect::<io::Result<Vec<_>>>()?;
        let mut names: Vec<String> =
            entries.iter().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        Ok(names)
    };
    let moved = names().and_then(|names| {
        // Fails if the folder isn't empty.
        let can_rename = !folder.exists() || fs::remove_dir(folder).is_ok();
        if can_rename {
            fs::rename(files, folder)?;
        } else {
            names.iter().try_for_each(|name| fs::rename(files.join(name), folder.join(name)))?;
        }
        Ok(names)
    });
    moved.map_err(|e| Error::output(folder, format!("can't be written: {e}")))
}

/// An encoded picture, with warnings about losses.
#[derive(Clone, Debug)]
pub struct EncodedPicture {
    /// The whole file.
    pub bytes: Vec<u8>,
    /// Warnings about values that the format can't represent.
    pub warnings: Vec<Warning>,
}

/// Picture formats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// OpenEXR: linear, scene-referred.
    Exr,
    /// PNG: 8 or 16 bits, display-referred.
    Png,
    /// JPEG: 8 bits, display-referred, without alpha.
    Jpeg,
    /// TIFF: 8 or 16 bits, display-referred.
    Tiff,
    /// WebP: 8 bits, display-referred, lossless.
    WebP,
    /// Radiance HDR: linear, without alpha and further channels.
    Hdr,
}

impl Format {
    /// Maximum width and height in pixels, if the format has a limit.
    pub fn max_edge(self) -> Option<u32> {
        match self {
            Format::WebP => Some(16_383),
            Format::Jpeg => Some(65_535),
            Format::Exr | Format::Png | Format::Tiff | Format::Hdr => None,
        }
    }

    /// The format by the extension of a file name.
    ///
    /// # Errors
    /// A usage error if the extension is unknown or missing.
    pub fn of(path: impl AsRef<Path>) -> Result<Format> {
        let path = path.as_ref();
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let format = match extension.as_str() {
            "exr" => Format::Exr,
            "png" => Format::Png,
            "jpg" | "jpeg" => Format::Jpeg,
            "tif" | "tiff" => Format::Tiff,
            "webp" => Format::WebP,
            "hdr" => Format::Hdr,
            _ => {
                let what = match extension.as_str() {
                    "" if path.is_dir() || path.as_os_str().to_string_lossy().ends_with('/') => {
                        return Err(Error::usage(format!("{} is a folder", path.display())).with_help(
                            "name the picture in it, such as -o FOLDER/room.png or -o 'FOLDER/{stem}.png'",
                        ));
                    }
                    "" => "has no extension, which determines the format of the picture".to_string(),
                    other => format!("pictures can't be written as '.{other}'"),
                };
                return Err(Error::usage(format!("{}: {what}", path.display()))
                    .with_help("end the name in .exr, .png, .jpg, .tif, .webp or .hdr"));
            }
        };
        let is_missing = match format {
            Format::Tiff => !cfg!(feature = "tiff"),
            Format::WebP => !cfg!(feature = "webp"),
            _ => false,
        };
        if is_missing {
            let message = format!("{}: this build can't write {}", path.display(), format.name());
            return Err(
                Error::usage(message).with_help("build it with the feature 'decoders', or write .png")
            );
        }
        Ok(format)
    }

    /// Name for users.
    pub fn name(self) -> &'static str {
        match self {
            Format::Exr => "EXR",
            Format::Png => "PNG",
            Format::Jpeg => "JPEG",
            Format::Tiff => "TIFF",
            Format::WebP => "WebP",
            Format::Hdr => "HDR",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::SystemTime;

    #[test]
    fn old_temporary_files_of_a_target_are_removed() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        let old = SystemTime::now() - Duration::from_secs(7200);
        for name in [".c.part.a1B2.tmp", ".c.part.new.tmp", ".d.part.a1.tmp", "c.part", ".c.part.a.b.tmp"] {
            let file = File::create(at(name)).expect("a file");
            if name != ".c.part.new.tmp" {
                file.set_modified(old).expect("a time");
            }
        }
        remove_leftovers(&at("c.part"));
        let left = [".c.part.new.tmp", ".d.part.a1.tmp", "c.part", ".c.part.a.b.tmp"];
        assert!(left.iter().all(|name| at(name).exists()) && !at(".c.part.a1B2.tmp").exists());
    }

    #[test]
    fn long_names_and_symbolic_links_are_supported() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["a".repeat(251) + ".png", "\u{e4}".repeat(125) + ".png"] {
            let path = folder.path().join(&name);
            check_target(&path).unwrap_or_else(|e| panic!("{e}"));
            write_atomically(&path, b"1").unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(fs::read(&path).expect("there"), b"1");
        }
        if cfg!(unix) {
            fs::create_dir(folder.path().join("real")).expect("made");
            fs::write(folder.path().join("real/a.png"), b"old").expect("written");
            for (link, target) in [("link.png", "real/a.png"), ("new.png", "real/b.png")] {
                let (link, target) = (folder.path().join(link), folder.path().join(target));
                #[cfg(unix)]
                std::os::unix::fs::symlink(target.strip_prefix(folder.path()).expect("inside"), &link)
                    .expect("linked");
                write_atomically(&link, b"new").unwrap_or_else(|e| panic!("{e}"));
                assert!(link.is_symlink() && fs::read(&target).expect("there") == b"new");
            }
        }
    }
}
