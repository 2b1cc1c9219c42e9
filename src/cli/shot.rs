//! Rendered pictures that are to be written: at once, or once the frames around them are there.

use super::args::RenderArgs;
use super::pictures::{AnimationFiles, EncodeOptions, FinishedPicture, Pictures, Targets};
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
    /// Animation files that frames are added to.
    pub moving: Option<AnimationFiles>,
    /// Preview window.
    pub preview: Option<Preview>,
    /// Frames that are denoised with those around them.
    pub sequence: Sequence<Shot>,
}

impl RunState {
    /// Opens the preview and starts with an empty compiler.
    ///
    /// # Errors
    /// If the preview can't be opened.
    pub fn new(args: &RenderArgs, compiler: Compiler) -> Result<RunState> {
        let preview = args.preview.as_ref().map(|how| Preview::open(args, how)).transpose()?;
        Ok(RunState {
            printed: PrintedMessages::default(),
            compiler,
            moving: None,
            preview,
            sequence: Sequence::default(),
        })
    }

    /// Writes pending frames, and the animation files.
    pub fn finish(mut self, args: &RenderArgs) -> Result<()> {
        let last = self.sequence.finish();
        last.into_iter().try_for_each(|frame| self.write(frame))?;
        self.moving.map_or(Ok(()), |moving| moving.finish(args.quiet))
    }

    /// Writes a frame that was averaged with its neighbours.
    pub fn write(&mut self, frame: Averaged<Shot>) -> Result<()> {
        let Averaged { item: mut shot, picture, frames, .. } = frame;
        shot.picture.set_denoised(&picture, &frames, shot.kept_aovs);
        shot.write(&mut self.printed, self.moving.as_mut()).map(drop)
    }

    /// Reports files that are not written because the run ended early.
    pub fn print_unfinished(&self, args: &RenderArgs) {
        let waiting: Vec<String> = self.sequence.waiting().map(|number| number.to_string()).collect();
        if !args.quiet && !waiting.is_empty() {
            say!("frames that wait for their neighbours are not written: {}", waiting.join(", "));
        }
        self.moving.iter().for_each(|moving| moving.print_unfinished(args));
    }
}

/// A picture to write, with its entry in the report.
pub(super) struct Shot {
    pub args: RenderArgs,
    pub targets: Targets,
    pub how: EncodeOptions,
    pub png: PngOptions,
    pub kept_aovs: AovSet,
    pub picture: Picture,
    /// To be denoised with the frames around it.
    pub is_averaged: bool,
    /// How the checkpoint was written.
    pub kept: Result<()>,
    /// Everything that is not in the picture.
    pub log: Vec<Warning>,
    pub run: Run,
}

impl Shot {
    /// Writes the files, adds the picture to animation files, and reports it.
    pub fn write(
        self,
        printed: &mut PrintedMessages,
        moving: Option<&mut AnimationFiles>,
    ) -> Result<Outcome> {
        let Shot { args, targets, how, png, picture, kept, log, mut run, .. } = self;
        let writing = Instant::now();
        let pictures = Pictures::encode(&how, &targets, FinishedPicture::from(&picture), &png, &log);
        print_pictures(&args, printed, &pictures, picture.statistics().interrupted)?;
        run.warnings.extend(pictures.warnings.iter().cloned());
        pictures.write()?;
        kept?; // after the pictures: who runs out of space for the one may have some for the others
        moving.map_or(Ok(()), |moving| moving.add_film(picture.film(), &png))?;
        run.write_s = writing.elapsed().as_secs_f64();
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

/// Prints the report of a run, and gives how it ended.
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

/// With `--strict`, warnings are problems.
pub(super) fn refuse_warnings(args: &RenderArgs, warnings: &[Warning], kind: ErrorKind) -> Result<()> {
    if !args.strict || warnings.is_empty() {
        return Ok(());
    }
    let problems = warnings.iter().map(|w| Problem::new("", w.to_string())).collect();
    let error = Error { kind, file: Some(args.scene.clone()), problems, source_text: None };
    Err(error.with_help("--strict makes warnings errors"))
}
