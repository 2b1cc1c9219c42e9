//! Arguments about pictures after rendering, and of the commands that read them.

use super::parsers::{number, stops};
use clap::builder::{PossibleValue, PossibleValuesParser, StringValueParser, TypedValueParser};
use clap::{Args, ValueEnum};
use oscura::denoise::Denoiser;
use oscura::error::{Error, Result};
use oscura::output::{ViewTransform, read_view};
use oscura::render::Caustics;
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
    /// Find caustics from the lamp, by smooth glass, mirrors and polished metal, and what they light in turn, on diffuse surfaces that
    /// the camera sees directly: auto where the picture gains by it; on; off. Nothing else finds what points, spots and suns without
    /// a size send so.
    #[arg(long, value_name = "C", default_value = "auto")]
    pub caustics: Caustics,
    /// Take the noise out of the finished picture, its light passes and light groups. (Pictures on the way, of --save-every,
    /// keep it, and have what 'oscura denoise' needs; parts are for 'oscura merge', which takes it out.)
    #[arg(long)]
    pub denoise: bool,
    /// Leave the noise in, though the scene's file asks for the contrary.
    #[arg(long, conflicts_with = "denoise")]
    pub no_denoise: bool,
    #[command(flatten)]
    pub denoiser: DenoiserArgs,
    /// Light of this temperature looks white in PNGs and the like, kelvin (1667 to 25000; daylight is 6500).
    #[arg(long, value_name = "K", value_parser = kelvin, allow_negative_numbers = true)]
    pub white_balance: Option<f32>,
    /// Write PNGs and TIFFs with 16 bits a channel.
    #[arg(long)]
    pub deep: bool,
}

fn kelvin(text: &str) -> std::result::Result<f32, String> {
    let fits = |v| (1667.0..=25_000.0).contains(&v);
    number(text, fits, "a number of kelvin from 1667 to 25000").map(|v| v as f32)
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
    #[command(flatten)]
    pub denoiser: DenoiserArgs,
    /// Threads [default: one a core]. The picture doesn't depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), allow_negative_numbers = true)]
    pub threads: Option<u16>,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Args, Debug)]
pub(crate) struct InfoArgs {
    /// The picture (.exr).
    pub picture: PathBuf,
    /// Print one JSON object on standard output.
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ConvertArgs {
    /// The picture (.exr).
    pub picture: PathBuf,
    /// File to write: .png, .jpg, .tif, .webp or .hdr.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// A layer, a part or a channel instead of the picture itself: N, DiffDir, Z, ...
    #[arg(long, value_name = "LAYER")]
    pub layer: Option<String>,
    /// All layers beside each other, small, with their names: colours as they look, other values by their ranges.
    #[arg(long, conflicts_with_all = ["layer", "dither", "deep"])]
    pub sheet: bool,
    /// How it looks: a name, or a table (cinespace, .csp).
    #[arg(long, value_name = "VIEW", default_value = "srgb", value_parser = views())]
    pub view: ViewTransform,
    /// Exposure in stops, -100 to 100.
    #[arg(long, value_name = "STOPS", default_value = "0", allow_negative_numbers = true, value_parser = stops)]
    pub exposure: f32,
    /// Light of this temperature looks white, kelvin (1667 to 25000; daylight is 6500).
    #[arg(long, value_name = "K", value_parser = kelvin, allow_negative_numbers = true)]
    pub white_balance: Option<f32>,
    /// Hide the steps between 8-bit values.
    #[arg(long)]
    pub dither: bool,
    /// 16 bits a channel in PNGs and TIFFs.
    #[arg(long)]
    pub deep: bool,
    /// Print errors only.
    #[arg(long)]
    pub quiet: bool,
}

// Arguments about what takes the noise out.

/// The variable that names the library.
const VARIABLE: &str = "OSCURA_OIDN";

/// What takes the noise out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum DenoiserArg {
    /// What the program brings: light passes and light groups add up afterwards.
    Own,
    /// Intel's Open Image Denoise, if its library is there.
    Oidn,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct DenoiserArgs {
    /// What takes the noise out [default: own].
    #[arg(long, value_name = "DENOISER")]
    pub denoiser: Option<DenoiserArg>,
    /// The library of --denoiser oidn, libOpenImageDenoise [default: what OSCURA_OIDN names, else the system's].
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

    /// Is there a choice where nothing is denoised?
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
