//! Writing of rendered pictures: at once, or after temporal denoising with their neighbouring frames.

use super::args::RenderArgs;
use super::pictures::{AnimationFiles, EncodeOptions, Pictures, Targets, UnencodedPicture};
use super::preview::Preview;
use super::process::{Outcome, peak_memory};
use super::report::{PrintedMessages, Run};
use super::{json, show};
use oscura::compile::Compiler;
use oscura::denoise::temporal::{Averaged, Sequence};
use oscura::error::{Error, ErrorKind, Problem, Result, Warning};
use oscura::film::AovSet;
use oscura::output::PngOptions;
use oscura::render::Picture;
use std::time::Instant;

/// State shared by all pictures of a run.
pub(super) struct RunState {
    pub printed: PrintedMessages,
    pub compiler: Compiler,
    /// Animation files to which frames are added.
    pub animations: Option<AnimationFiles>,
    pub preview: Option<Preview>,
    /// Frames to denoise together with their neighbours.
    pub sequence: Sequence<RenderedPicture>,
}

impl RunState {
    /// Opens the preview.
    ///
    /// # Errors
    /// The preview can't be opened.
    pub fn new(args: &RenderArgs, compiler: Compiler) -> Result<RunState> {
        let preview = args.preview.as_ref().map(|how| Preview::open(args, how)).transpose()?;
        Ok(RunState {
            printed: PrintedMessages::default(),
            compiler,
            animations: None,
            preview,
            sequence: Sequence::default(),
        })
    }

    /// Writes pending frames and the animation files.
    pub fn finish(mut self, args: &RenderArgs) -> Result<()> {
        let pending = self.sequence.finish();
        pending.into_iter().try_for_each(|frame| self.write(frame))?;
        self.animations.map_or(Ok(()), |animations| animations.finish(args.quiet))
    }

    /// Writes a frame averaged with its neighbours.
    pub fn write(&mut self, frame: Averaged<RenderedPicture>) -> Result<()> {
        let Averaged { item: mut rendered, picture, frames, .. } = frame;
        rendered.picture.set_denoised(&picture, &frames, rendered.output_aovs);
        rendered.write(&mut self.printed, self.animations.as_mut()).map(drop)
    }

    /// Reports files that are not written because the run ended early.
    pub fn print_unfinished(&self, args: &RenderArgs) {
        let pending: Vec<String> = self.sequence.waiting().map(|number| number.to_string()).collect();
        if !args.quiet && !pending.is_empty() {
            say!("frames whose neighbours are missing are not written: {}", pending.join(", "));
        }
        self.animations.iter().for_each(|animations| animations.print_unfinished(args));
    }
}

/// A rendered picture to write, with its report.
pub(super) struct RenderedPicture {
    pub args: RenderArgs,
    pub targets: Targets,
    pub encoding: EncodeOptions,
    pub png: PngOptions,
    pub output_aovs: AovSet,
    pub picture: Picture,
    /// Denoised together with neighbouring frames.
    pub is_averaged: bool,
    /// Result of writing the checkpoint.
    pub checkpoint: Result<()>,
    /// Warnings and notes of loading and building, for metadata.
    pub messages: Vec<Warning>,
    pub run: Run,
}

impl RenderedPicture {
    /// Writes the files, adds the picture to animation files, and reports it.
    pub fn write(
        self,
        printed: &mut PrintedMessages,
        animations: Option<&mut AnimationFiles>,
    ) -> Result<Outcome> {
        let RenderedPicture { args, targets, encoding, png, picture, checkpoint, messages, mut run, .. } =
            self;
        let start = Instant::now();
        let pictures =
            Pictures::encode(&encoding, &targets, UnencodedPicture::from(&picture), &png, &messages);
        print_pictures(&args, printed, &pictures, picture.statistics().interrupted)?;
        run.warnings.extend(pictures.warnings.iter().cloned());
        pictures.write()?;
        checkpoint?; // after the pictures, which may fit on a disk that was too full for the checkpoint
        animations.map_or(Ok(()), |animations| animations.add_film(picture.film(), &png))?;
        run.write_s = start.elapsed().as_secs_f64();
        run.total_s += run.write_s;
        run.peak_memory = peak_memory();
        show::draw(&args, picture.film(), &png);
        Ok(print_run(&args, &run))
    }
}

/// Reports warnings of encoding. `--strict` does not apply to interrupted runs.
fn print_pictures(
    args: &RenderArgs,
    printed: &mut PrintedMessages,
    pictures: &Pictures,
    is_interrupted: bool,
) -> Result<()> {
    if !args.quiet {
        printed.warnings(&pictures.warnings);
    }
    if is_interrupted { Ok(()) } else { refuse_warnings(args, &pictures.warnings, ErrorKind::Output) }
}

/// Prints the report of a run and returns its outcome.
fn print_run(args: &RenderArgs, run: &Run) -> Outcome {
    if args.verbose {
        run.print_details();
    }
    if !args.quiet {
        run.print_end(args.frame.as_ref().map(|frame| frame.label.as_str()));
    }
    if args.json {
        json::print(&json::of_run(run));
    }
    if run.statistics.interrupted { Outcome::Interrupted } else { Outcome::Done }
}

/// With `--strict`, returns an error with the warnings as problems.
pub(super) fn refuse_warnings(args: &RenderArgs, warnings: &[Warning], kind: ErrorKind) -> Result<()> {
    if !args.strict || warnings.is_empty() {
        return Ok(());
    }
    let problems = warnings.iter().map(|w| Problem::new("", w.to_string())).collect();
    let error = Error { kind, file: Some(args.scene.clone()), problems, source_text: None };
    Err(error.with_help("--strict treats warnings as errors"))
}
