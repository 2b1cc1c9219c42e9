//! Blender files (.blend) and the formats that Blender imports (USD, FBX, Alembic, Collada). Blender without a window, or Python
//! with the module `bpy`, runs the exporter `tools/blender/oscura_blender`, which writes a scene file and the files that it refers to.
//!
//! Such files can hold scripts. They are opened with scripts off, with Blender's factory settings and offline.
//!
//! The exporter caches baked images and grids in a folder, one file each, named by a hash of its inputs (32 hexadecimal
//! digits and `.oscura`). Above a maximum size it deletes the least recently used files (`cache.py`).

pub use super::options::BlenderOptions;
use super::{LoadOptions, Loaded, WatchedFiles, formats, gltf, scene_file, unpack};
use crate::error::{Error, Result, Warning};
use crate::scene::{Environment, Settings};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{env, fs, io};
use tempfile::TempDir;

mod coincident_faces;
mod process;

/// An export in a temporary folder; dropping the struct deletes the folder.
#[derive(Debug)]
pub struct Exported {
    /// The folder of the exported files.
    pub folder: PathBuf,
    /// Path of the exported scene file (.toml).
    pub scene: PathBuf,
    /// Warnings about losses of the export.
    pub warnings: Vec<Warning>,
    /// Notes about the export.
    pub notes: Vec<Warning>,
    parent: Arc<TempDir>,
}

/// Exports a Blender file into a new folder within `parent`.
///
/// # Errors
/// An input error if there is no Blender, or Blender's own error.
pub fn export(path: &Path, options: &LoadOptions, parent: &Path) -> Result<Exported> {
    export_with(path, options, parent, false)
}

/// As [`export`]; if `links` is set, images are symbolic links instead of copies.
fn export_with(path: &Path, options: &LoadOptions, parent: &Path, links: bool) -> Result<Exported> {
    // Blender runs in another working directory.
    let path = fs::canonicalize(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
    let host = process::find(&path, options.blender.program.as_deref())?;
    let temporary = tempfile::Builder::new().prefix(".oscura-").tempdir_in(parent).and_then(|work| {
        let folder = work.path().join("export");
        fs::create_dir(&folder).map(|()| (work, folder))
    });
    let (work, folder) =
        temporary.map_err(|e| Error::output(parent, format!("can't hold a temporary folder: {e}")))?;
    let exported = process::run(&host, &path, options, work.path(), &folder, links)?;
    let warning = |(place, message): (String, String)| Warning::new(&path, place, message);
    Ok(Exported {
        scene: folder.join(process::NAME).with_extension("toml"),
        folder,
        warnings: exported.warnings.into_iter().map(warning).collect(),
        notes: exported.notes.into_iter().map(warning).collect(),
        parent: Arc::new(work),
    })
}

/// Exports a Blender file and loads the result. Coincident faces are searched in the first frame of a sequence only.
pub(super) fn load(path: &Path, options: &LoadOptions, is_first_frame: bool) -> Result<Loaded> {
    options.files.note(path);
    let exported = export_with(path, options, &env::temp_dir(), true)?;
    // Blender has applied these options already: frame 0 of the scene file is the rendered frame.
    let gltf_options = gltf::GltfOptions { time_s: None, scene: None, ..options.gltf.clone() };
    let inner = LoadOptions { gltf: gltf_options, files: WatchedFiles::default(), ..options.clone() };
    let is_temporary =
        |file: &Option<PathBuf>| file.as_ref().is_some_and(|f| f.starts_with(&exported.folder));
    let mut loaded =
        scene_file::load(&exported.scene, &inner).map_err(|error| match is_temporary(&error.file) {
            true => Error { file: Some(path.to_path_buf()), ..error }
                .with_help("the error is in the exported scene; 'oscura export' writes it to a folder"),
            false => error,
        })?;
    unpack::keep_for(&exported.parent, &mut loaded);
    // The user didn't write the scene file: no notes about it.
    loaded.notes.retain(|note| note.file.as_ref() != Some(&exported.scene));
    for warning in loaded.warnings.iter_mut().chain(&mut loaded.notes) {
        if is_temporary(&warning.file) {
            warning.file = Some(path.to_path_buf());
        }
    }
    match formats::is_imported_by_blender(path) {
        true => remove_blender_defaults(&mut loaded),
        false if is_first_frame => coincident_faces::add_note(path, &mut loaded),
        false => {}
    }
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let with_path = |w: &Warning| Warning { file: Some(path.to_path_buf()), ..w.clone() };
    loaded.warnings.splice(0..0, exported.warnings.iter().map(with_path));
    loaded.notes.splice(0..0, exported.notes.iter().map(with_path));
    Ok(loaded)
}

/// Removes the black world and the render settings of Blender's empty scene from an imported file.
fn remove_blender_defaults(loaded: &mut Loaded) {
    let scene = &mut loaded.scene;
    if scene.environment == Environment::Constant([0.0; 3]) {
        scene.environment = Environment::Black;
    }
    scene.settings = Settings::default();
}

/// Extension of cache files.
const EXTENSION: &str = "oscura";

/// Size of the exporter's cache.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CacheSize {
    /// Number of files.
    pub files: u64,
    /// Total size, bytes.
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
pub fn cache_size(folder: &Path) -> Result<CacheSize> {
    let files = cache_files(folder).map_err(|e| Error::input(folder, format!("can't be read: {e}")))?;
    Ok(CacheSize { files: files.len() as u64, bytes: files.iter().map(|(_, bytes)| bytes).sum() })
}

/// Deletes the exporter's files of a cache folder; returns their number and size.
///
/// # Errors
/// An output error for files that can't be deleted.
pub fn clear_cache(folder: &Path) -> Result<CacheSize> {
    let before = cache_size(folder)?;
    let files = cache_files(folder).map_err(|e| Error::input(folder, format!("can't be read: {e}")))?;
    for (path, _) in files {
        fs::remove_file(&path).map_err(|e| Error::output(&path, format!("can't be deleted: {e}")))?;
    }
    Ok(before)
}

/// Cache files in a folder, with their sizes in bytes.
fn cache_files(folder: &Path) -> io::Result<Vec<(PathBuf, u64)>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut found = Vec::new();
    for entry in entries {
        let entry = entry?;
        let metadata = entry.metadata()?;
        if metadata.is_file() && is_cache_file(&entry.path()) {
            found.push((entry.path(), metadata.len()));
        }
    }
    Ok(found)
}

fn is_cache_file(path: &Path) -> bool {
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let is_hash = stem.len() == 32 && stem.bytes().all(|b| b.is_ascii_hexdigit());
    is_hash && path.extension().is_some_and(|extension| extension == EXTENSION)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clearing_the_cache_keeps_other_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let ours = folder.path().join(format!("{}.oscura", "0123456789abcdef".repeat(2)));
        let others = ["notes.txt", "scene.oscura", "0123.oscura"].map(|name| folder.path().join(name));
        others.iter().chain([&ours]).for_each(|path| fs::write(path, "text").expect("written"));
        assert_eq!(cache_size(folder.path()).expect("read"), CacheSize { files: 1, bytes: 4 });
        assert_eq!(clear_cache(folder.path()).expect("cleared"), CacheSize { files: 1, bytes: 4 });
        assert!(!ours.exists() && others.iter().all(|path| path.exists()));
        assert_eq!(cache_size(&folder.path().join("missing")).expect("no folder"), CacheSize::default());
    }
}
