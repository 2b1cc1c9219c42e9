//! `oscura render`: load, compile, render, write, report.

use super::Outcome;
use super::args::{RenderArgs, UpArg};
use super::environment::EnvironmentOverride;
use super::frames::Frames;
use super::pictures::{Pictures, Shot, Targets};
use super::process::{cancel_by_signals, peak_memory};
use super::progress::Progress;
use super::report::{Run, Said};
use super::scene_path;
use super::settings::{choices, png, without_exr};
use super::{json, report_json, terms};
use oscura::compile::{CompileReport, CompiledScene, Compiler};
use oscura::error::{Error, ErrorKind, Problem, Result, Warning};
use oscura::film::Aov;
use oscura::load::{LoadOptions, Loaded, is_of_blender, load, load_frames};
use oscura::render::{CancelHandle, Labels, PassOutcome, Picture, Rendering, Settled, in_pool};
use oscura::scene::Camera;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

pub(crate) fn run(args: &RenderArgs) -> Result<Outcome> {
    let cancel = cancel_by_signals()?;
    in_pool(args.threads.map(usize::from), || run_all(args, &cancel))
        .map_err(|error| error.with_help("ask for fewer with --threads"))?
}

/// Renders one picture, or each of a sequence.
fn run_all(args: &RenderArgs, cancel: &CancelHandle) -> Result<Outcome> {
    choices(args).check_size()?;
    let Some(frames) = args.frames else {
        let targets = Targets::check(&args.output)?;
        let start = Instant::now();
        scene_path::check(&args.scene)?;
        let environment = EnvironmentOverride::load(args)?;
        say_export(args);
        let loaded = load(&args.scene, &load_options(args));
        // A signal ends Blender, too, whose failure is then no news.
        stop_before_pixels(cancel)?;
        let mut loaded = loaded?;
        let mut kept = Kept { said: Said::default(), compiler: Compiler::single() };
        return run_one(args, cancel, &targets, &environment, &mut loaded, start, &mut kept);
    };
    let file = |number| args.output.iter().map(|path| Frames::file(path, number)).collect::<Vec<_>>();
    for number in frames.numbers() {
        Targets::check(&file(number))?;
    }
    let is_missing = |&number: &u32| !args.resume || !file(number).iter().all(|path| path.exists());
    let missing: Vec<u32> = frames.numbers().filter(is_missing).collect();
    say_existing(args, frames.numbers().count() - missing.len());
    let (mut start, mut numbers, mut outcome) = (Instant::now(), missing.iter().copied(), Outcome::Done);
    let mut kept = Kept { said: Said::default(), compiler: Compiler::sequence() };
    scene_path::check(&args.scene)?;
    let environment = EnvironmentOverride::load(args)?;
    load_frames(&args.scene, &load_options(args), missing.iter().copied(), args.fps, &mut |loaded| {
        let Some(number) = numbers.next() else { return Ok(ControlFlow::Break(())) };
        let targets = Targets::check(&file(number))?;
        if !args.quiet {
            match is_of_blender(&args.scene) {
                true => eprintln!("frame    {number}"),
                false => eprintln!("frame    {number}, {:.3} s", f64::from(number) / args.fps),
            }
        }
        outcome = run_one(args, cancel, &targets, &environment, loaded, start, &mut kept)?;
        start = Instant::now();
        Ok(match outcome {
            Outcome::Done => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        })
    })?;
    Ok(outcome)
}

/// Says how many frames are not rendered again.
fn say_existing(args: &RenderArgs, frames: usize) {
    if !args.quiet && frames > 0 {
        eprintln!("resume   {frames} frames exist and are left out");
    }
}

/// Says what takes a while.
fn say_export(args: &RenderArgs) {
    if !args.quiet && is_of_blender(&args.scene) {
        eprintln!("export   {} by Blender", args.scene.display());
    }
}

fn load_options(args: &RenderArgs) -> LoadOptions {
    LoadOptions {
        allow_external: args.allow_external,
        brings_environment: args.env.is_some(),
        gltf: args.asset.options(),
        point_radius: args.point_radius,
        z_up: args.up == UpArg::Z,
        no_sidecar: args.no_sidecar,
        blender: args.blender.options(),
        ..LoadOptions::default()
    }
}

/// What outlives a picture.
struct Kept {
    said: Said,
    compiler: Compiler,
}

/// Renders one picture of a scene that began to load at `start`.
fn run_one(
    args: &RenderArgs,
    cancel: &CancelHandle,
    targets: &Targets,
    environment: &EnvironmentOverride,
    loaded: &mut Loaded,
    start: Instant,
    Kept { said, compiler }: &mut Kept,
) -> Result<Outcome> {
    let Prepared { scene, labels, camera, settled, build, load_s, notes, mut warnings, left_out } =
        prepare(args, targets.has_exr(), environment, loaded, start, compiler)?;
    if !args.quiet {
        said.notes(&notes);
        said.warnings(&warnings);
        if args.explain {
            left_out.iter().for_each(|what| eprintln!("left out: {what}"));
        }
    }
    refuse_warnings(args, &warnings, ErrorKind::Input)?;
    stop_before_pixels(cancel)?;

    let encode = |shot: Shot| Pictures::encode(args, targets, shot, png(args, settled.exposure), &warnings);
    let rendering = Rendering::labelled(scene, labels, &camera, settled.options)?;
    let picture = take_picture(args, cancel, rendering, &encode, said)?;
    if args.resume && picture.statistics().interrupted {
        // Else it would pass for a finished one the next time.
        return Ok(Outcome::Interrupted);
    }

    let start = Instant::now();
    let pictures = encode(Shot::from(&picture))?;
    if !args.quiet {
        said.warnings(&pictures.warnings);
    }
    // Who stops a run wants what is there.
    if !picture.statistics().interrupted {
        refuse_warnings(args, &pictures.warnings, ErrorKind::Output)?;
    }
    pictures.write()?;
    let write_s = start.elapsed().as_secs_f64();
    warnings.extend(pictures.warnings);

    let run = Run {
        load_s,
        write_s,
        width: settled.options.width,
        height: settled.options.height,
        seed: settled.options.seed,
        compiled: build,
        statistics: *picture.statistics(),
        peak_memory: peak_memory(),
        outputs: targets.names(),
        notes,
        warnings,
        left_out,
    };
    if !args.quiet {
        run.print();
    }
    if args.json {
        json::print(&report_json::of_run(&run));
    }
    Ok(if run.statistics.interrupted { Outcome::Interrupted } else { Outcome::Done })
}

/// Renders until all samples are taken or something stops it; writes what `encode` makes of the picture so far as often as
/// it is wanted.
fn take_picture<'a>(
    args: &RenderArgs,
    cancel: &CancelHandle,
    rendering: Rendering,
    encode: &dyn Fn(Shot) -> Result<Pictures<'a>>,
    said: &mut Said,
) -> Result<Picture> {
    let progress = Arc::new(Progress::new(args.quiet, args.time_limit));
    let shown = progress.clone();
    let mut rendering =
        rendering.with_cancel_handle(cancel.clone()).on_event(move |event| shown.show(&event));
    let mut saved = Instant::now();
    while rendering.next_pass() == PassOutcome::Progressed {
        if args.save_every.is_some_and(|pause| saved.elapsed() >= pause) {
            // A disk that is full for a while is no reason to lose the rest.
            if let Err(error) = encode(Shot::from(&rendering))?.write() {
                said.warnings(&[Warning::general(format!("the picture so far was not written: {error}"))]);
            }
            saved = Instant::now();
        }
    }
    progress.finish();
    Ok(rendering.into_picture())
}

/// All that rendering needs.
struct Prepared {
    scene: Arc<CompiledScene>,
    labels: Labels,
    camera: Camera,
    settled: Settled,
    build: CompileReport,
    load_s: f64,
    notes: Vec<Warning>,
    warnings: Vec<Warning>,
    left_out: Vec<String>,
}

/// Settles options and compiles what was loaded since `start`; `has_exr` tells whether anything can hold AOVs.
fn prepare(
    args: &RenderArgs,
    has_exr: bool,
    environment: &EnvironmentOverride,
    loaded: &mut Loaded,
    start: Instant,
    compiler: &mut Compiler,
) -> Result<Prepared> {
    terms::in_loaded(loaded);
    let mut warnings = std::mem::take(&mut loaded.warnings);
    let mut choices = choices(args);
    if !has_exr {
        choices = without_exr(args, choices, &mut warnings);
        loaded.scene.settings.aovs = None;
    }
    let settled = choices.settle(&loaded.scene)?;
    warnings.extend(environment.apply(args, &mut loaded.scene));
    loaded.scene.is_environment_hidden |= args.transparent;
    let load_s = start.elapsed().as_secs_f64();

    let camera = settled.camera(&loaded.scene)?.clone();
    let size = (settled.options.width, settled.options.height);
    compiler.set_tree(settled.tree(args.frames.map_or(1, |frames| frames.numbers().count() as u64)));
    compiler.keep_uv(settled.options.aovs.contains(Aov::Uv));
    let (scene, mut build) = compiler.compile(&loaded.scene, settled.shading, &camera, size)?;
    warnings.append(&mut build.warnings);
    let (notes, mut left_out) = (std::mem::take(&mut loaded.notes), std::mem::take(&mut loaded.left_out));
    left_out.append(&mut build.left_out);
    let labels = Labels::of(&loaded.scene, &settled.options);
    Ok(Prepared { scene, labels, camera, settled, build, load_s, notes, warnings, left_out })
}

/// With `--strict`, warnings are problems.
fn refuse_warnings(args: &RenderArgs, warnings: &[Warning], kind: ErrorKind) -> Result<()> {
    if !args.strict || warnings.is_empty() {
        return Ok(());
    }
    let problems = warnings.iter().map(|w| Problem::new("", w.to_string())).collect();
    let error = Error { kind, file: Some(args.scene.clone()), problems, source_text: None };
    Err(error.with_help("--strict makes warnings errors"))
}

/// A signal before the first sample: there is nothing to write.
fn stop_before_pixels(cancel: &CancelHandle) -> Result<()> {
    if cancel.is_cancelled() {
        let message = "stopped by a signal before the first sample; nothing was written";
        return Err(Error { kind: ErrorKind::Interrupted, ..Error::usage(message) });
    }
    Ok(())
}
