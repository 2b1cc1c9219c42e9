//! Arguments about files of Blender, the same for all commands that load them.

use clap::Args;
use oscura::load::blender::{BlenderOptions, default_cache};
use std::path::PathBuf;

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Blender files")]
pub(crate) struct BlenderArgs {
    /// Blender's program, or a Python that has bpy [default: OSCURA_BLENDER, else what is found].
    #[arg(long, value_name = "PATH")]
    pub blender: Option<PathBuf>,
    /// View layer by name [default: the first that is rendered].
    #[arg(long, value_name = "LAYER")]
    pub view_layer: Option<String>,
    /// Largest edge of pictures that node trees are baked to, 16 to 16384 pixels; each is as large as its mesh appears
    /// [default: 4096].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(16..=16384), allow_negative_numbers = true)]
    pub bake: Option<u32>,
    /// Folder that keeps meshes and baked pictures for the next time [default: see 'oscura cache'].
    #[arg(long, value_name = "FOLDER", conflicts_with = "no_cache")]
    pub cache: Option<PathBuf>,
    /// Keep nothing, and use nothing that was kept.
    #[arg(long)]
    pub no_cache: bool,
}

impl BlenderArgs {
    /// What they choose.
    pub(crate) fn options(&self) -> BlenderOptions {
        let cache = self.cache.clone().or_else(default_cache).filter(|_| !self.no_cache);
        BlenderOptions {
            program: self.blender.clone(),
            view_layer: self.view_layer.clone(),
            bake: self.bake,
            cache,
            frame: None,
        }
    }
}
