//! Table of model and scene file formats, by file extension.

use super::{LoadOptions, Loaded, gltf, obj, ply, splats, stl, threemf};
use crate::error::Result;
use std::path::Path;

/// A model file format.
pub(super) struct ModelFormat {
    /// File extensions, lower case.
    extensions: &'static [&'static str],
    /// Reads a file.
    pub load: fn(&Path, &LoadOptions) -> Result<Loaded>,
    /// Whether it is glTF, which has animations and its own options.
    pub is_gltf: bool,
    /// Whether the format leaves the up axis undefined.
    pub has_ambiguous_up: bool,
}

const MODELS: &[ModelFormat] = &[
    ModelFormat {
        extensions: &["gltf", "glb", "vrm"],
        load: gltf::load,
        is_gltf: true,
        has_ambiguous_up: false,
    },
    ModelFormat { extensions: &["obj"], load: obj::load, is_gltf: false, has_ambiguous_up: true },
    ModelFormat { extensions: &["ply"], load: ply::load, is_gltf: false, has_ambiguous_up: true },
    ModelFormat { extensions: &["spz"], load: splats::load, is_gltf: false, has_ambiguous_up: true },
    ModelFormat { extensions: &[THREE_MF], load: threemf::load, is_gltf: false, has_ambiguous_up: true },
    ModelFormat { extensions: &["stl"], load: stl::load, is_gltf: false, has_ambiguous_up: true },
];

/// The extension of 3MF files, which are ZIP archives.
const THREE_MF: &str = "3mf";

/// The extension of scene files.
const SCENE_FILE: &str = "toml";

/// The extension of Blender's files.
const BLENDER: &str = "blend";

/// Extensions of formats that Blender imports.
const IMPORTED_BY_BLENDER: [&str; 7] = ["usd", "usda", "usdc", "usdz", "fbx", "abc", "dae"];

/// The extension of archives that hold models.
const ARCHIVE: &str = "zip";

/// The extension of compressed models, after the model's own: `scan.ply.gz`.
const GZIP: &str = "gz";

/// The format of a file.
pub(super) enum Format {
    Model(&'static ModelFormat),
    SceneFile,
    /// A Blender file, or a format that Blender imports.
    Blender,
    /// An unsupported format.
    Other,
}

/// The format by the extension of a file, case-insensitive.
pub(super) fn of(path: &Path) -> Format {
    let extension = extension(path);
    if extension == SCENE_FILE {
        return Format::SceneFile;
    }
    if extension == BLENDER || IMPORTED_BY_BLENDER.contains(&extension.as_str()) {
        return Format::Blender;
    }
    let model = MODELS.iter().find(|format| format.extensions.contains(&extension.as_str()));
    model.map_or(Format::Other, Format::Model)
}

/// A file's extension in lower case, or empty; for compressed files (`.gz`) the extension before it.
pub(super) fn extension(path: &Path) -> String {
    let last =
        |path: &Path| path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match last(path) {
        gzip if gzip == GZIP => {
            let inner = last(Path::new(path.file_stem().unwrap_or_default()));
            if inner.is_empty() { gzip } else { inner }
        }
        extension => extension,
    }
}

/// Whether Blender imports files of this extension.
pub(super) fn is_imported_by_blender(path: &Path) -> bool {
    IMPORTED_BY_BLENDER.contains(&extension(path).as_str())
}

/// Whether a file is a ZIP archive, by its extension.
pub(super) fn is_named_as_archive(path: &Path) -> bool {
    extension(path) == ARCHIVE
}

/// Whether a file is an archive of a single model (3MF), by its extension.
pub(super) fn is_package(path: &Path) -> bool {
    extension(path) == THREE_MF
}

/// Rank of a file among the models of an archive, best first; `None` for files that aren't models.
pub(super) fn rank_in_archives(path: &Path) -> Option<usize> {
    let extension = extension(path);
    MODELS.iter().position(|format| format.extensions.contains(&extension.as_str()))
}

/// All extensions: models, archives, scene files, Blender files, and formats that Blender imports.
pub fn extensions() -> impl Iterator<Item = &'static str> {
    model_extensions().chain([ARCHIVE, SCENE_FILE, BLENDER]).chain(IMPORTED_BY_BLENDER)
}

/// The model extensions as text for messages: `.gltf, .glb, ...`.
pub(super) fn models_in_words() -> String {
    model_extensions().map(|extension| format!(".{extension}")).collect::<Vec<_>>().join(", ")
}

fn model_extensions() -> impl Iterator<Item = &'static str> {
    MODELS.iter().flat_map(|format| format.extensions).copied()
}
