//! Checkpoints and partial renders.

use super::args::RenderArgs;
use super::pictures::{Targets, is_part};
use super::report::PrintedMessages;
use oscura::error::{Error, Result, Warning};
use oscura::film::AovSet;
use oscura::load::Loaded;
use oscura::output::part::{Identity, OutputSettings, Region, read_header, read_part};
use oscura::output::{PngOptions, check_target, is_same_target, remove_leftovers};
use oscura::render::{Rendering, ResolvedOptions, identity};
use oscura::scene::Backdrop;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Writes checkpoints and partial renders, if requested.
pub(super) struct CheckpointWriter<'a> {
    args: &'a RenderArgs,
    parts: &'a [PathBuf],
    identity: Identity,
    output_settings: OutputSettings,
    backdrop: Option<Backdrop>,
    /// When the last checkpoint was written, or rendering started.
    written: Instant,
}

impl<'a> CheckpointWriter<'a> {
    /// A writer for a loaded scene. `aovs_after_denoising`: the AOVs to keep after denoising; `None` without denoising.
    /// Fingerprints are computed only if something will be written.
    pub fn new(
        args: &'a RenderArgs,
        targets: &'a Targets,
        loaded: &mut Loaded,
        resolved: &ResolvedOptions,
        png: &PngOptions,
        warnings: &[Warning],
        aovs_after_denoising: Option<AovSet>,
    ) -> Result<CheckpointWriter<'a>> {
        let writes_parts = args.long.checkpoint.is_some() || !targets.parts().is_empty();
        let identity = if writes_parts { identity(&mut loaded.scene, resolved)? } else { Identity::new() };
        let offset = loaded.offset.to_array();
        let output_settings = OutputSettings {
            world_offset: (offset != [0.0; 3]).then_some(offset.map(f64::to_bits)),
            warnings: warnings.iter().map(Warning::to_string).collect(),
            denoise: aovs_after_denoising
                .map(|aovs| aovs.iter().map(|aov| aov.info().option.to_string()).collect()),
            owner: args.owner.clone(),
            float: args.float,
            reproducible: args.reproducible,
            view: png.view.name().into_owned(),
            white_balance: png.white_balance.map(f32::to_bits),
            deep: png.deep,
            exposure: png.exposure.to_bits(),
            dither: png.dither,
            opaque: png.opaque,
            ..OutputSettings::default()
        };
        let backdrop = if writes_parts { loaded.scene.backdrop.clone() } else { None };
        Ok(CheckpointWriter {
            args,
            parts: targets.parts(),
            identity,
            output_settings,
            backdrop,
            written: Instant::now(),
        })
    }

    /// Resumes from the checkpoint with --resume, if it exists.
    pub fn begin(&self, rendering: Rendering) -> Result<Rendering> {
        let writes_parts = self.args.long.checkpoint.is_some() || !self.parts.is_empty();
        let mut rendering = if writes_parts { rendering.with_whole_passes() } else { rendering };
        let Some(file) = &self.args.long.checkpoint else { return Ok(rendering) };
        if !file.exists() {
            return Ok(rendering);
        }
        rendering.resume(file, read_part(file)?, &self.identity).map_err(plan_help)?;
        if !self.args.quiet {
            let samples = rendering.film().samples(0, 0);
            say!("resume   {} from {samples} samples per pixel", file.display());
        }
        Ok(rendering)
    }

    /// When the next checkpoint is due.
    pub fn next_write(&self) -> Option<Instant> {
        self.args.long.checkpoint.as_ref()?;
        self.written.checked_add(self.args.long.checkpoint_interval)
    }

    /// Writes the checkpoint if it is due. A failure, such as a full disk, is a warning.
    pub fn before_pass(&mut self, rendering: &mut Rendering, printed: &mut PrintedMessages) {
        let is_due = self.written.elapsed() >= self.args.long.checkpoint_interval;
        // Checkpoints must end at a block boundary: write one before an incomplete last block.
        if (is_due || rendering.ends_within_block()) && rendering.is_between_blocks() {
            if let Err(error) = self.write_checkpoint(rendering) {
                let message =
                    format!("the checkpoint was not written; the previous one is unchanged: {error}");
                printed.warnings(&[Warning::general(message)]);
            }
            self.written = Instant::now();
        }
    }

    /// Writes the last checkpoint and, if all samples are done, the partial renders.
    pub fn finish(&self, rendering: &mut Rendering) -> Result<()> {
        let checkpoint = match rendering.is_between_blocks() {
            true => self.write_checkpoint(rendering),
            false => Ok(()),
        };
        if rendering.is_complete() {
            for path in self.parts {
                rendering.write_part(path, &self.identity, &self.output_settings, self.backdrop.as_ref())?;
            }
        }
        checkpoint
    }

    fn write_checkpoint(&self, rendering: &mut Rendering) -> Result<()> {
        let Some(file) = &self.args.long.checkpoint else { return Ok(()) };
        rendering.write_part(file, &self.identity, &self.output_settings, self.backdrop.as_ref())
    }
}

/// Adds help to the error about resuming with more samples than planned.
fn plan_help(error: Error) -> Error {
    match error.problems.iter().any(|problem| problem.code == "other-sample-plan") {
        true => error.with_help("resume to at most the planned number of samples; start with --plan N, or with more than 256 samples, to resume to more"),
        false => error,
    }
}

/// Checks that the options of long renders are consistent and that the files can be written.
pub(super) fn check(args: &RenderArgs) -> Result<()> {
    let long = &args.long;
    let is_sequence = args.frames.is_some() || args.orbit.is_some();
    if long.resume && args.frames.is_none() && long.checkpoint.is_none() {
        let help = "give --checkpoint FILE to resume from, or --frames";
        return Err(Error::usage("--resume has nothing to resume from").with_help(help));
    }
    if long.resume && args.frames.is_some() && long.save_every.is_some() {
        let message = "--save-every and --resume can't be used together for a sequence";
        return Err(Error::usage(message)
            .with_help("--resume skips frames that have a picture, even an unfinished one"));
    }
    if args.orbit.is_some() && (long.checkpoint.is_some() || long.sample_range.is_some() || parts(args) > 0) {
        return Err(Error::usage("--orbit can't be used with checkpoints or partial renders"));
    }
    if args.frames.is_some()
        && long.checkpoint.as_ref().is_some_and(|file| !file.to_string_lossy().contains('#'))
    {
        let message = "each frame of a sequence needs its own checkpoint";
        return Err(
            Error::usage(message).with_help("use a name with ####, such as --checkpoint frame.####.part")
        );
    }
    check_limits(args)?;
    check_parts(args)?;
    match &long.checkpoint {
        Some(file) if !is_sequence => check_file(args, file),
        _ => Ok(()),
    }
}

/// Number of partial renders among the outputs.
fn parts(args: &RenderArgs) -> usize {
    args.output.iter().filter(|path| is_part(path)).count()
}

/// Crop rectangle of a picture; partial renders store their own region.
pub(super) fn cropped(args: &RenderArgs) -> Option<Region> {
    args.exr.crop.or(args.long.region.filter(|_| parts(args) == 0))
}

/// Checks that the options of partial renders and of pictures match the outputs.
fn check_parts(args: &RenderArgs) -> Result<()> {
    let (parts, outputs) = (parts(args), args.output.len());
    if args.long.sample_range.is_some() && (outputs == 0 || parts < outputs) {
        let message = "a range of samples is written as a .part file";
        return Err(Error::usage(message).with_help("use -o NAME.part; 'oscura merge' merges parts"));
    }
    if args.long.region.is_some() && parts > 0 && parts < outputs {
        let message = "--region makes either a picture or a .part file";
        return Err(Error::usage(message).with_help("render them in two runs"));
    }
    let equal_samples = "parts of an image need the same number of samples:";
    if parts > 0 && (args.long.noise.is_some() || args.quality.is_some()) {
        let message = format!("{equal_samples} --noise and --quality can't be used with .part files");
        return Err(Error::usage(message).with_help("use --spp, or render the part to an image"));
    }
    if parts > 0 && args.long.region.is_some() && args.long.time_limit.is_some() {
        let message = format!("{equal_samples} --time-limit can't be used with --region and .part files");
        return Err(Error::usage(message).with_help("use --spp, or render the region to an image"));
    }
    if args.exr.overscan.is_some() && parts > 0 {
        return Err(Error::usage("--overscan is for pictures, not for .part files"));
    }
    if args.exr.format.is_given() && outputs > 0 && parts == outputs {
        let message = "--exr-layout and similar options are for EXR files, not for .part files";
        return Err(Error::usage(message).with_help("use them with 'oscura merge', which writes the EXR"));
    }
    Ok(())
}

/// Checks --min-spp and --max-spp.
fn check_limits(args: &RenderArgs) -> Result<()> {
    let (min, max) = (args.long.min_spp, args.long.max_spp);
    if min.is_none() && max.is_none() {
        return Ok(());
    }
    if args.spp.is_some() && args.long.noise.is_none() {
        let message = "--min-spp and --max-spp have no effect: all pixels get the same number of samples";
        return Err(Error::usage(message).with_help("use --noise or --quality with them"));
    }
    if args.long.noise.is_some() && args.spp.is_some() && max.is_some() {
        let message = "with --noise, --spp and --max-spp mean the same";
        return Err(Error::usage(message).with_help("leave one out"));
    }
    let in_order = |a: Option<u32>, b: Option<u32>| a.zip(b).is_none_or(|(a, b)| a <= b);
    if !(in_order(min, max) && in_order(min, args.spp)) {
        return Err(Error::usage("--min-spp must not be above --spp and --max-spp"));
    }
    Ok(())
}

/// Checks that a checkpoint can be written without overwriting another file.
///
/// # Errors
/// A usage error if the path is the scene, an output, or a file other than a checkpoint; an output error if it can't be
/// written.
pub(super) fn check_file(args: &RenderArgs, file: &Path) -> Result<()> {
    if is_same_target(&args.scene, file) || args.output.iter().any(|output| is_same_target(output, file)) {
        let message = format!("--checkpoint {} is also the scene or an output", file.display());
        return Err(Error::usage(message).with_help("use another name, such as NAME.part"));
    }
    if file.is_file() && read_header(file).is_err() {
        let message =
            format!("--checkpoint {} would replace a file that is not a checkpoint", file.display());
        return Err(Error::usage(message).with_help("use another name, or delete the file first"));
    }
    if file.exists() && !args.long.resume {
        let message = format!("the checkpoint {} exists already", file.display());
        return Err(
            Error::usage(message).with_help("use --resume to resume from it, or delete it to start over")
        );
    }
    check_target(file)?;
    remove_leftovers(file);
    Ok(())
}
