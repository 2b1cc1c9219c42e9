//! The types of files that hold models or scenes, by their extensions: the one table.

use super::{LoadOptions, Loaded, gltf, obj, ply};
use crate::error::Result;
use std::path::Path;

/// A type of file that holds a model.
pub(super) struct ModelFormat {
    /// Extensions of its files, in lower case.
    extensions: &'static [&'static str],
    /// Reads a file.
    pub load: fn(&Path, &LoadOptions) -> Result<Loaded>,
    /// Is it glTF, which choices about glTF assets are about, and which has moments?
    pub is_gltf: bool,
    /// Files don't say which of their axes points up.
    pub leaves_up_open: bool,
}

/// All of them.
const MODELS: &[ModelFormat] = &[
    ModelFormat { extensions: &["gltf", "glb"], load: gltf::load, is_gltf: true, leaves_up_open: false },
    ModelFormat { extensions: &["obj"], load: obj::load, is_gltf: false, leaves_up_open: true },
    ModelFormat { extensions: &["ply"], load: ply::load, is_gltf: false, leaves_up_open: true },
];

/// The extension of scene files.
const SCENE_FILE: &str = "toml";

/// The extension of Blender's files.
const BLENDER: &str = "blend";

/// The format by the extension of a file.
pub(super) enum Format {
    /// A model.
    Model(&'static ModelFormat),
    /// A scene file.
    SceneFile,
    /// A file of Blender.
    Blender,
    /// Nothing that can be rendered.
    Other,
}

/// The format by the extension of a file, case-insensitive.
pub(super) fn of(path: &Path) -> Format {
    let extension = extension(path);
    if extension == SCENE_FILE {
        return Format::SceneFile;
    }
    if extension == BLENDER {
        return Format::Blender;
    }
    let model = MODELS.iter().find(|format| format.extensions.contains(&extension.as_str()));
    model.map_or(Format::Other, Format::Model)
}

/// A file's extension in lower case; empty without one.
pub(super) fn extension(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// The extensions of models and last those of scene files and of Blender's.
pub fn extensions() -> impl Iterator<Item = &'static str> {
    model_extensions().chain([SCENE_FILE, BLENDER])
}

/// `.gltf, .glb, ...`: the extensions of models for a message.
pub(super) fn models_in_words() -> String {
    model_extensions().map(|extension| format!(".{extension}")).collect::<Vec<_>>().join(", ")
}

fn model_extensions() -> impl Iterator<Item = &'static str> {
    MODELS.iter().flat_map(|format| format.extensions).copied()
}
