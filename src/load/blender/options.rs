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
    /// The view layer to show, by its name; else the first that is rendered.
    pub view_layer: Option<String>,
    /// Largest edge of pictures that node trees are baked to, pixels; else 4096.
    pub bake: Option<u32>,
    /// A folder in which exported meshes and baked pictures are kept for the next time, made if it is missing; `None`
    /// keeps nothing.
    pub cache: Option<PathBuf>,
}
