//! Arguments about pictures after rendering, and of the commands that read them.

use clap::Args;
use std::path::PathBuf;

#[derive(Args, Clone, Debug)]
pub(crate) struct PictureArgs {
    /// Take the noise out of the finished picture, its light passes and light groups. (Pictures on the way, of --save-every,
    /// keep it.)
    #[arg(long)]
    pub denoise: bool,
}

#[derive(Args, Debug)]
pub(crate) struct DenoiseArgs {
    /// The picture (.exr) with R, G, B; better with albedo.R, .G, .B, N.X, .Y, .Z and Z (--aov albedo,normal,depth).
    pub picture: PathBuf,
    /// File to write, .exr: all that the picture has, its colour and light passes without noise.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// The same picture with another seed: both are averaged, and their difference tells the noise. Without it, the channels
    /// variance.R, .G, .B do (--aov variance), or else the picture's finest details.
    #[arg(long, value_name = "FILE")]
    pub other_seed: Option<PathBuf>,
    /// Threads [default: one a core]. The picture doesn't depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}
