//! Arguments of `oscura merge`.

use super::denoiser_args::DenoiserArgs;
use super::exr_args::ExrFormatArgs;
use super::numbers::stops;
use super::picture_args::views;
use clap::Args;
use oscura::output::ViewTransform;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(crate) struct MergeArgs {
    /// The parts, in any order: .part files of one picture.
    #[arg(required = true, value_name = "PART")]
    pub parts: Vec<PathBuf>,
    /// File to write, .exr or .png; may be given several times.
    #[arg(short, long, required = true, value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// Write the picture even where parts are missing: pixels have fewer samples there, or none.
    #[arg(long)]
    pub allow_missing: bool,
    /// Take the noise out of the picture, its light passes and light groups, as when the parts were rendered with --denoise;
    /// of other parts better with --aov albedo,normal,depth,variance.
    #[arg(long)]
    pub denoise: bool,
    #[command(flatten)]
    pub denoiser: DenoiserArgs,
    /// Write the EXR's colour as 32-bit floats, as when the parts were rendered so.
    #[arg(long)]
    pub float: bool,
    #[command(flatten)]
    pub exr: ExrFormatArgs,
    /// How PNGs and the like look: a name, or a table (cinespace, .csp) [default: as when the parts were rendered].
    #[arg(long, value_name = "VIEW", value_parser = views())]
    pub view: Option<ViewTransform>,
    /// Exposure of PNGs and the like in stops, -100 to 100 [default: as when the parts were rendered].
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true, value_parser = stops)]
    pub exposure: Option<f32>,
    /// Leave times and dates out of the files, as when the parts were rendered so.
    #[arg(long)]
    pub reproducible: bool,
    /// Whose picture it is, for the EXR's header [default: as the parts say].
    #[arg(long, value_name = "NAME")]
    pub owner: Option<String>,
    /// Threads [default: one a core].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
    /// Print one JSON object about the run on standard output.
    #[arg(long)]
    pub json: bool,
}
