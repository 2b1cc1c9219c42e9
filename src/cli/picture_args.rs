//! Arguments about pictures after rendering, and of the commands that read them.

use super::parsers::{number, stops};
use clap::builder::{PossibleValue, PossibleValuesParser, StringValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use oscura::denoise::Denoiser;
use oscura::error::{Error, Result};
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
    ) -> std::result::Result<ViewTransform, clap::Error> {
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
    /// Denoise the finished image, its light passes and light groups. (Images of --save-every stay noisy and contain the
    /// guides for 'oscura denoise'; .part files are denoised by 'oscura merge'.)
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

fn kelvin(text: &str) -> std::result::Result<f32, String> {
    let fits = |v| (1667.0..=25_000.0).contains(&v);
    number(text, fits, "a number of kelvin from 1667 to 25000").map(|v| v as f32)
}

#[derive(Args, Debug)]
pub(crate) struct DenoiseArgs {
    /// Image to denoise (.exr) with R, G, B; better with the guides albedo.R, .G, .B, N.X, .Y, .Z and Z (--aov
    /// albedo,normal,depth).
    pub picture: PathBuf,
    /// Output file (.exr): all channels of the input, its colour and light passes denoised.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
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
    /// Image (.exr).
    pub picture: PathBuf,
    /// Output file: .png, .jpg, .tif, .webp or .hdr.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
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

// Arguments about what takes the noise out.

/// Environment variable with the path of the library.
const VARIABLE: &str = "OSCURA_OIDN";

/// Denoisers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DenoiserArg {
    /// The built-in denoiser: denoised light passes and light groups still add up.
    Own,
    /// Intel Open Image Denoise, if its library is installed.
    Oidn,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct DenoiserArgs {
    /// Denoiser [default: own].
    #[arg(long, value_name = "DENOISER")]
    pub denoiser: Option<DenoiserArg>,
    /// Path of the library libOpenImageDenoise for --denoiser oidn [default: OSCURA_OIDN, else the system's].
    #[arg(long, value_name = "FILE", requires = "denoiser")]
    pub oidn_library: Option<PathBuf>,
}

impl DenoiserArgs {
    /// The denoiser.
    ///
    /// # Errors
    /// A usage error if its library can't be loaded, or isn't asked for.
    pub fn load(&self) -> Result<Denoiser> {
        match (self.denoiser, &self.oidn_library) {
            (Some(DenoiserArg::Oidn), given) => {
                let named = || std::env::var_os(VARIABLE).filter(|name| !name.is_empty()).map(PathBuf::from);
                let library = given.clone().or_else(named);
                Denoiser::oidn(library.as_deref()).map_err(|error| {
                    error.with_help(format!(
                        "name libOpenImageDenoise by --oidn-library or {VARIABLE} (the wheel 'pyoidn' has it), or leave out --denoiser"
                    ))
                })
            }
            (_, Some(_)) => Err(Error::usage("--oidn-library has no effect without --denoiser oidn")),
            (_, None) => Ok(Denoiser::Own),
        }
    }

    /// Checks that no denoiser is chosen where nothing is denoised.
    ///
    /// # Errors
    /// A usage error then.
    pub fn check(&self, denoises: bool) -> Result<()> {
        match self.denoiser.is_some() && !denoises {
            true => Err(Error::usage("--denoiser has no effect without --denoise")),
            false => Ok(()),
        }
    }
}
