//! Choices about files of Blender.

use std::path::PathBuf;

/// What the user may choose about files of Blender.
#[derive(Clone, Debug, Default)]
pub struct BlenderOptions {
    /// Blender's program, or a Python that has `bpy`; else what the environment variable `OSCURA_BLENDER` names, else
    /// what is found.
    pub program: Option<PathBuf>,
    /// The frame to show, by Blender's numbers; else that of the moment that is asked for, else the file's current one.
    pub frame: Option<u32>,
}
