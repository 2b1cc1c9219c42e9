//! Arguments about what takes the noise out.

use clap::{Args, ValueEnum};
use oscura::denoise::Denoiser;
use oscura::error::{Error, Result};
use std::path::PathBuf;

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
