//! Arguments about pictures after rendering, and of the commands that read them.

use super::parsers::{FRAME_RATE, Frames, frames_per_second, number, stops};
use clap::builder::{PossibleValue, PossibleValuesParser, StringValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use oscura::error::Warning;
use oscura::output::{ViewTransform, read_view};
use oscura::render::{Caustics, setting_help};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// View transforms by name, or the file of a table.
pub(super) fn views() -> Views {
    Views
}

/// Parses what [`views`] says.
#[derive(Clone)]
pub(super) struct Views;

impl TypedValueParser for Views {
    type Value = ViewTransform;

    fn parse_ref(
        &self,
        command: &clap::Command,
        argument: Option<&clap::Arg>,
        value: &OsStr,
    ) -> Result<ViewTransform, clap::Error> {
        let is_file = value.to_str().is_some_and(ViewTransform::is_file);
        match is_file {
            true => {
                let read = |name: String| read_view(Path::new(&name));
                StringValueParser::new().try_map(read).parse_ref(command, argument, value)
            }
            false => {
                let named = |name: String| ViewTransform::from_name(&name).ok_or("is no such view");
                PossibleValuesParser::new(named_views()).try_map(named).parse_ref(command, argument, value)
            }
        }
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(named_views()))
    }
}

fn named_views() -> impl Iterator<Item = PossibleValue> {
    ViewTransform::NAMED.into_iter().map(|(_, name, about)| PossibleValue::new(name).help(about))
}

#[derive(Args, Clone, Debug)]
pub(crate) struct PictureArgs {
    #[arg(long, help = setting_help("caustics"), value_name = "C", default_value = "auto")]
    pub caustics: Caustics,
    /// Denoise the finished image, its light passes and light groups.
    ///
    /// Images of --save-every stay noisy and contain the guides for 'oscura denoise'; .part files are denoised by 'oscura
    /// merge'.
    #[arg(long)]
    pub denoise: bool,
    /// Do not denoise, even if the scene file asks for it.
    #[arg(long, conflicts_with = "denoise")]
    pub no_denoise: bool,
    #[command(flatten)]
    pub denoiser: DenoiserArgs,
    /// White balance of PNG and other display-referred output: colour temperature that looks white, kelvin (1667 to
    /// 25000; daylight is 6500).
    #[arg(long, value_name = "K", value_parser = kelvin, allow_negative_numbers = true)]
    pub white_balance: Option<f32>,
    /// Write PNGs and TIFFs with 16 bits per channel.
    #[arg(long)]
    pub deep: bool,
}

fn kelvin(text: &str) -> Result<f32, String> {
    let fits = |v| (1667.0..=25_000.0).contains(&v);
    number(text, fits, "a number of kelvin from 1667 to 25000").map(|v| v as f32)
}

#[derive(Args, Debug)]
pub(crate) struct DenoiseArgs {
    /// Image to denoise (.exr) with R, G, B; better with the guides albedo.R, .G, .B and N.X, .Y, .Z (--aov albedo,normal).
    /// With #### in place of its number, all frames of a sequence, each averaged with its neighbours by motion vectors
    /// (--aov motion).
    pub picture: PathBuf,
    /// Output file (.exr), of sequences with ####: all channels of the input, its colour and light passes denoised.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Frames of the sequence to denoise, such as 7, 1-10 or 1-10x2 [default: all]. Two frames before and after are read, too, if
    /// they are there.
    #[arg(long, value_name = "A-B")]
    pub frames: Option<Frames>,
    /// The same image rendered with another seed: both are averaged, and their difference estimates the noise. Without
    /// it, the noise is estimated from the channels variance.R, .G, .B (--aov variance), else from the image itself.
    #[arg(long, value_name = "FILE")]
    pub other_seed: Option<PathBuf>,
    #[command(flatten)]
    pub denoiser: DenoiserArgs,
    /// Number of threads [default: one per core]. The image does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Args, Debug)]
pub(crate) struct InfoArgs {
    /// Image (.exr).
    pub picture: PathBuf,
    /// Print one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ConvertArgs {
    /// Image (.exr); with #### in place of its number all frames of a sequence.
    pub picture: PathBuf,
    /// Output file: .png, .jpg, .tif, .webp or .hdr; of sequences with ####, or one .gif, .apng, .mp4 or .webm.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Frame rate of .gif, .apng, .mp4 and .webm, frames per second.
    #[arg(long, value_name = "N", default_value_t = FRAME_RATE, value_parser = frames_per_second, allow_negative_numbers = true)]
    pub fps: f64,
    /// Layer, part or channel to convert instead of the combined image: N, DiffDir, Z, ...
    #[arg(long, value_name = "LAYER")]
    pub layer: Option<String>,
    /// Contact sheet: thumbnails of all layers with their names; data channels are scaled to their ranges.
    #[arg(long, conflicts_with_all = ["layer", "dither", "deep"])]
    pub sheet: bool,
    /// View transform: a name, or a lookup table (cinespace, .csp).
    #[arg(long, value_name = "VIEW", default_value = "srgb", value_parser = views())]
    pub view: ViewTransform,
    /// Exposure in stops, -100 to 100.
    #[arg(long, value_name = "STOPS", default_value = "0", allow_negative_numbers = true, value_parser = stops)]
    pub exposure: f32,
    /// White balance: colour temperature that looks white, kelvin (1667 to 25000; daylight is 6500).
    #[arg(long, value_name = "K", value_parser = kelvin, allow_negative_numbers = true)]
    pub white_balance: Option<f32>,
    /// Dither 8-bit output.
    #[arg(long)]
    pub dither: bool,
    /// Write PNGs and TIFFs with 16 bits per channel.
    #[arg(long)]
    pub deep: bool,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}

// Options of earlier versions about the denoiser.

/// What denoises.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DenoiserArg {
    /// The only denoiser.
    Own,
    /// The same: the network of Open Image Denoise is built in.
    Oidn,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct DenoiserArgs {
    /// What denoises; there is one denoiser.
    #[arg(long, value_name = "DENOISER", hide = true)]
    pub denoiser: Option<DenoiserArg>,
    /// The library of Open Image Denoise, whose network is built in.
    #[arg(long, value_name = "FILE", hide = true)]
    pub oidn_library: Option<PathBuf>,
}

impl DenoiserArgs {
    /// What is to be said of options that have no effect.
    pub fn notes(&self) -> Vec<Warning> {
        let is_given = self.denoiser == Some(DenoiserArg::Oidn) || self.oidn_library.is_some();
        let message =
            "the network of Open Image Denoise is built in: --denoiser and --oidn-library have no effect";
        is_given.then(|| Warning::general(message)).into_iter().collect()
    }
}
