//! `oscura render`: load, compile, render, write, report.

use super::args::RenderArgs;
use super::environment::EnvironmentOverride;
use super::frames::Frames;
use super::moving::{MovingPictures, still};
use super::pictures::Targets;
use super::settings::choices;
use super::shot::{Kept, load_options, load_scene, run_one};
use super::{Outcome, checkpoint, limits, orbit, scene_path};
use oscura::compile::Compiler;
use oscura::error::Result;
use oscura::load::{is_of_blender, load_frames};
use oscura::render::{CancelHandle, in_pool};
use std::ops::ControlFlow;
use std::time::Instant;

/// Renders what the arguments say of their scene.
pub(super) fn run(args: &RenderArgs, cancel: &CancelHandle) -> Result<Outcome> {
    in_pool(args.threads.map(usize::from), || run_all(args, cancel))?
}

/// Renders one picture, or each of a sequence.
fn run_all(args: &RenderArgs, cancel: &CancelHandle) -> Result<Outcome> {
    choices(args).check_size()?;
    checkpoint::check(args)?;
    if let Some(count) = args.orbit {
        return orbit::run(args, count, cancel);
    }
    match args.frames {
        None => run_picture(args, cancel),
        Some(frames) => run_frames(args, frames, cancel),
    }
}

/// Renders one picture.
fn run_picture(args: &RenderArgs, cancel: &CancelHandle) -> Result<Outcome> {
    let targets = Targets::check(&args.output)?;
    let start = Instant::now();
    scene_path::check(&args.scene)?;
    limits::before_loading(args)?;
    let environment = EnvironmentOverride::load(args)?;
    let mut loaded = load_scene(args, cancel, &load_options(args)?)?;
    let mut kept = Kept::new(args, Compiler::single())?;
    run_one(args, cancel, &targets, Some(&environment), &mut loaded, start, &mut kept)
}

/// Renders the frames of a sequence that are missing.
fn run_frames(args: &RenderArgs, frames: Frames, cancel: &CancelHandle) -> Result<Outcome> {
    let moving = Some(MovingPictures::new(args)?);
    let still = still(&args.output);
    let file = |number| still.iter().map(|path| Frames::file(path, number)).collect::<Vec<_>>();
    for number in frames.numbers() {
        Targets::check(&file(number))?;
    }
    // A sequence that is shown or becomes a moving picture has no files that tell which frames exist.
    let is_missing = |&number: &u32| {
        !args.long.resume || still.is_empty() || !file(number).iter().all(|path| path.exists())
    };
    let missing: Vec<u32> = frames.numbers().filter(is_missing).collect();
    if let Some(checkpoint) = &args.long.checkpoint {
        missing
            .iter()
            .try_for_each(|&number| checkpoint::check_file(args, &Frames::file(checkpoint, number)))?;
    }
    say_existing(args, frames.numbers().count() - missing.len());
    let (mut start, mut numbers, mut outcome) = (Instant::now(), missing.iter().copied(), Outcome::Done);
    let mut kept = Kept { moving, ..Kept::new(args, Compiler::sequence())? };
    scene_path::check(&args.scene)?;
    limits::before_loading(args)?;
    let environment = EnvironmentOverride::load(args)?;
    let rendered =
        load_frames(&args.scene, &load_options(args)?, missing.iter().copied(), args.fps, &mut |loaded| {
            let Some(number) = numbers.next() else { return Ok(ControlFlow::Break(())) };
            let targets = Targets::check(&file(number))?;
            if !args.quiet {
                match is_of_blender(&args.scene) {
                    true => say!("frame    {number}"),
                    false => say!("frame    {number}, {:.3} s", f64::from(number) / args.fps),
                }
            }
            let mut args = args.clone();
            args.long.checkpoint = args.long.checkpoint.map(|file| Frames::file(&file, number));
            outcome = run_one(&args, cancel, &targets, Some(&environment), loaded, start, &mut kept)?;
            start = Instant::now();
            Ok(match outcome {
                Outcome::Done => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            })
        });
    match (&rendered, &outcome) {
        (Ok(()), Outcome::Done) => kept.moving.map_or(Ok(()), |moving| moving.finish(args))?,
        _ => kept.moving.iter().for_each(|moving| moving.say_unfinished(args)),
    }
    rendered.map(|()| outcome)
}

/// Says how many frames are not rendered again.
fn say_existing(args: &RenderArgs, frames: usize) {
    if !args.quiet && frames > 0 {
        say!("resume   {frames} frames exist and are left out");
    }
}
