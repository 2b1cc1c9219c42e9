//! Files of Blender (.blend), and those of other programs that it imports (USD, FBX, Alembic, Collada): Blender itself, or a Python that has its module `bpy`, runs the program's own exporter
//! (`tools/blender/oscura_blender`) without a window, which writes a `.glb` and an `.oscura.toml` beside it.
//!
//! Such files can hold scripts. They are opened with scripts off, with Blender's factory settings and offline.
//!
//! The exporter keeps baked images and grids in a cache. Each file of the folder is one of
//! them, named by a hash of all that it was made from (32 hexadecimal digits and `.oscura`), so that none is ever out of
//! date. The exporter deletes those that were not used for longest once there is too much (`cache.py`).

pub use super::options::BlenderOptions;
use super::scene_file::{Sidecar, sidecar_text};
use super::{LoadOptions, Loaded, SavedFiles, ShutterOptions, formats, gltf, unpack};
use crate::error::{Error, Result, Warning};
use crate::scene::{Environment, Settings};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::{env, fs, io};
use tempfile::TempDir;

mod coincident_faces;
mod process;

/// An export in a temporary folder, which is deleted when this is dropped.
#[derive(Debug)]
pub struct Exported {
    /// The folder of the exported files.
    pub folder: PathBuf,
    /// The model among them.
    pub model: PathBuf,
    /// Warnings about losses of the export.
    pub warnings: Vec<Warning>,
    /// Notes of the export.
    pub notes: Vec<Warning>,
    /// The picture's time in the model's animations, seconds, if something moves.
    pub time_s: Option<f64>,
    /// Frames per second of the animations.
    pub fps: Option<f64>,
    parent: Arc<TempDir>,
}

/// Exports a file of Blender into a new folder within `parent`.
///
/// # Errors
/// An input error if there is no Blender, or Blender's own error.
pub fn export(path: &Path, options: &LoadOptions, parent: &Path) -> Result<Exported> {
    exported(path, options, parent, false)
}

/// As [`export`]; with `links`, images are symbolic links instead of copies.
fn exported(path: &Path, options: &LoadOptions, parent: &Path, links: bool) -> Result<Exported> {
    // Blender runs in another working directory.
    let path = fs::canonicalize(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
    let host = process::find(&path, options.blender.program.as_deref())?;
    let made = tempfile::Builder::new().prefix(".oscura-").tempdir_in(parent).and_then(|work| {
        let folder = work.path().join("export");
        fs::create_dir(&folder).map(|()| (work, folder))
    });
    let (work, folder) =
        made.map_err(|e| Error::output(parent, format!("can't hold a temporary folder: {e}")))?;
    let exported = process::run(&host, &path, options, work.path(), &folder, links)?;
    let of_file = |(place, message): (String, String)| Warning::new(&path, place, message);
    Ok(Exported {
        model: folder.join(process::MODEL).with_extension("glb"),
        folder,
        warnings: exported.warnings.into_iter().map(of_file).collect(),
        notes: exported.notes.into_iter().map(of_file).collect(),
        time_s: exported.moment,
        fps: exported.fps,
        parent: Arc::new(work),
    })
}

/// Exports a file of Blender and reads the result.
pub(super) fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    options.files.note(path);
    let exported = exported(path, options, &env::temp_dir(), true)?;
    // Blender has applied these options already.
    let chosen = gltf::GltfOptions { time_s: exported.time_s, scene: None, ..options.gltf.clone() };
    // The exported files are temporary.
    let fps = exported.fps.filter(|fps| *fps > 0.0).unwrap_or(options.shutter.fps);
    let shutter = ShutterOptions { fps, ..options.shutter };
    let inner = LoadOptions { gltf: chosen, files: SavedFiles::default(), shutter, ..options.clone() };
    let is_temporary =
        |file: &Option<PathBuf>| file.as_ref().is_some_and(|f| f.starts_with(&exported.folder));
    let mut loaded = read(&exported, &inner).map_err(|error| match is_temporary(&error.file) {
        true => Error { file: Some(path.to_path_buf()), ..error }
            .with_help("this is about what Blender exported; 'oscura export' keeps it"),
        false => error,
    })?;
    unpack::keep_for(&exported.parent, &mut loaded);
    for warning in loaded.warnings.iter_mut().chain(&mut loaded.notes) {
        if is_temporary(&warning.file) {
            warning.file = Some(path.to_path_buf());
        }
    }
    match formats::is_imported_by_blender(path) {
        true => leave_out_defaults(&mut loaded),
        false => coincident_faces::tell(path, &mut loaded),
    }
    loaded.scene.name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let given = |w: &Warning| Warning { file: Some(path.to_path_buf()), ..w.clone() };
    loaded.warnings.splice(0..0, exported.warnings.iter().map(given));
    loaded.notes.splice(0..0, exported.notes.iter().map(given));
    Ok(loaded)
}

/// Removes the defaults of Blender's empty scene from an import: a black world, and render settings.
fn leave_out_defaults(loaded: &mut Loaded) {
    let scene = &mut loaded.scene;
    if scene.environment == Environment::Constant([0.0; 3]) {
        scene.environment = Environment::Black;
    }
    scene.settings = Settings::default();
}

fn read(exported: &Exported, options: &LoadOptions) -> Result<Loaded> {
    // The exporter itself wrote these paths.
    let options = &LoadOptions { allow_external: true, ..options.clone() };
    let text = sidecar_text(&exported.model, options)?;
    let sidecar = text.as_ref().map(Sidecar::parse);
    let options = &sidecar.as_ref().map_or_else(|| options.clone(), |s| s.reader_options(options));
    let mut loaded = gltf::load(&exported.model, options)?;
    if let Some(sidecar) = sidecar {
        let notes = loaded.notes.len();
        sidecar.apply(options, &mut loaded)?;
        // The user didn't write that file: no note about it.
        loaded.notes.truncate(notes);
    }
    Ok(loaded)
}

/// The extension of the files.
const EXTENSION: &str = "oscura";

/// Size of a cache of the exporter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CacheSize {
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
pub fn cache_size(folder: &Path) -> Result<CacheSize> {
    let files = files(folder).map_err(|e| Error::input(folder, format!("can't be read: {e}")))?;
    Ok(CacheSize { files: files.len() as u64, bytes: files.iter().map(|(_, bytes)| bytes).sum() })
}

/// Deletes the files of a cache and no others; returns their number and size.
///
/// # Errors
/// An output error for files that can't be deleted.
pub fn clear_cache(folder: &Path) -> Result<CacheSize> {
    let before = cache_size(folder)?;
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
        assert_eq!(cache_size(folder.path()).expect("read"), CacheSize { files: 1, bytes: 4 });
        assert_eq!(clear_cache(folder.path()).expect("cleared"), CacheSize { files: 1, bytes: 4 });
        assert!(!ours.exists() && others.iter().all(|path| path.exists()));
        assert_eq!(cache_size(&folder.path().join("missing")).expect("no folder"), CacheSize::default());
    }
}
