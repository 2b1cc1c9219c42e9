//! Taking the noise out of what was rendered.

use super::args::RenderArgs;
use super::pictures::Targets;
use super::report::Said;
use super::waiting::{Telling, Waiting};
use oscura::denoise::Denoiser;
use oscura::error::{Result, Warning};
use oscura::film::AovSet;
use oscura::gauge::Gauge;
use oscura::render::Rendering;
use std::time::Instant;

/// What is to be done about the noise.
pub(super) struct Denoising<'a> {
    args: &'a RenderArgs,
    denoiser: Denoiser,
    /// AOVs that the files are to have.
    kept: AovSet,
    /// Parts keep the noise.
    has_pictures: bool,
}

impl<'a> Denoising<'a> {
    /// As the arguments say, of files that are to have these AOVs.
    ///
    /// # Errors
    /// A usage error if the denoiser is not there.
    pub fn of(args: &'a RenderArgs, targets: &Targets, kept: AovSet) -> Result<Denoising<'a>> {
        let denoiser = args.picture.denoiser.load()?;
        Ok(Denoising { args, denoiser, kept, has_pictures: targets.has_pictures() })
    }

    /// The AOVs that stay when the noise is taken out, if it is to be.
    pub fn kept(&self) -> Option<AovSet> {
        self.args.picture.denoise.then_some(self.kept)
    }

    /// Takes the noise out if that is asked for; returns how long it took, seconds. A picture whose noise can't be taken out is
    /// kept as it is.
    pub fn run(&self, rendering: &mut Rendering, said: &mut Said) -> (Option<f64>, Option<Warning>) {
        let Some(kept) = self.kept().filter(|_| self.has_pictures) else { return (None, None) };
        let start = Instant::now();
        let telling = Telling::of(self.args.quiet, self.args.long.progress);
        let waiting = Waiting::new(telling, "denoise", &Gauge::default());
        let done = rendering.denoise_by(&self.denoiser, kept);
        drop(waiting);
        let failed = |error| Warning::general(format!("the picture keeps its noise: {error}"));
        let warning = done.err().map(failed);
        if !self.args.quiet {
            said.warnings(warning.as_slice());
        }
        (Some(start.elapsed().as_secs_f64()), warning)
    }
}
