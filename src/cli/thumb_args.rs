//! Arguments of the commands about small pictures.

use super::stage_args::StageArgs;
use clap::Args;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(crate) struct ThumbArgs {
    /// The models or scenes: .gltf, .glb, .obj, .ply, .toml or .blend.
    #[arg(required = true, value_name = "MODEL")]
    pub models: Vec<PathBuf>,
    /// Folder for the pictures, MODEL.png each [default: beside each model].
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,
    /// The picture of the only model: a PNG, whatever its name is.
    #[arg(long, value_name = "FILE", conflicts_with = "output")]
    pub file: Option<PathBuf>,
    /// Longer side in pixels.
    #[arg(long, value_name = "N", default_value = "512", value_parser = clap::value_parser!(u32).range(1..=8192), allow_negative_numbers = true)]
    pub size: u32,
    /// Samples a pixel; their noise is taken out.
    #[arg(long, value_name = "N", default_value = "4", value_parser = clap::value_parser!(u32).range(1..), allow_negative_numbers = true)]
    pub spp: u32,
    /// Threads [default: one a core].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Let glTF and OBJ files refer to files outside their folder.
    #[arg(long)]
    pub allow_external: bool,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
    #[command(flatten)]
    pub stage: StageArgs,
}

#[derive(Args, Debug)]
pub(crate) struct ThumbnailerArgs {
    /// Print what would be written, and where, and write nothing.
    #[arg(long, conflicts_with = "remove")]
    pub print: bool,
    /// Remove what was written.
    #[arg(long)]
    pub remove: bool,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}
