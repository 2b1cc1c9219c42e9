//! A scene in the making.

use super::fields::Problems;
use super::linked_sets::Linking;
use super::node_paths::NodeIndex;
use crate::load::{LoadOptions, Loaded, ShutterOptions};
use std::path::{Path, PathBuf};

/// Everything that the parts of a scene file are built into.
pub(super) struct Build<'a> {
    /// The scene file, for relative paths and messages.
    pub file: &'a Path,
    /// What the user chose.
    pub options: &'a LoadOptions,
    /// What is wrong with the file.
    pub problems: &'a Problems<'a>,
    /// When the shutter is open: what the user chose, else what the file says.
    pub shutter: ShutterOptions,
    /// The file lies beside a model, whose parts it may change.
    pub is_beside_model: bool,
    /// What lights are linked to.
    pub linking: Linking,
    /// The nodes of the model by their names.
    pub nodes: NodeIndex,
    /// The scene so far.
    pub loaded: Loaded,
}

impl Build<'_> {
    /// The path of a file that the scene file names.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.file.parent().unwrap_or(self.file).join(name)
    }

    /// The picture's moment, frames.
    pub fn frame(&self) -> f64 {
        self.options.gltf.time_s.map_or(0.0, |time_s| time_s * self.shutter.fps)
    }
}
