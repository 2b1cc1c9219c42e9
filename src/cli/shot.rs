//! One picture of `oscura render`: load, compile, render, write, report.

use super::Outcome;
use super::args::RenderArgs;
use super::checkpoint::Keeper;
use super::denoising::Denoising;
use super::environment::EnvironmentOverride;
use super::moving::MovingPictures;
use super::pictures::{Pictures, Shot, Targets};
use super::prepared::{Prepared, Wants, prepare};
use super::preview::Preview;
use super::process::peak_memory;
use super::progress::{Ends, Progress};
use super::report::{Run, Said};
use super::waiting::{Telling, Waiting};
use super::{idle, json, of_scene, report_json, show};
use oscura::compile::Compiler;
use oscura::error::{Error, ErrorKind, Problem, Result, Warning};
use oscura::film::Aov;
use oscura::load::stage::Background;
use oscura::load::{LoadOptions, Loaded, is_of_blender, load};
use oscura::render::{CancelHandle, PassOutcome, Rendering, Statistics};
use std::sync::Arc;
use std::time::Instant;

/// Loads the scene; says so if it takes a while.
pub(super) fn load_scene(args: &RenderArgs, cancel: &CancelHandle, options: &LoadOptions) -> Result<Loaded> {
    say_export(args);
    let telling = Telling::of(args.quiet, args.long.progress);
    let waiting = Waiting::new(telling, "load", &options.gauge);
    let loaded = load(&args.scene, options);
    drop(waiting);
    // A signal ends Blender, too, whose failure is then no news.
    stop_before_pixels(cancel)?;
    loaded
}

/// Says what takes a while.
fn say_export(args: &RenderArgs) {
    if !args.quiet && is_of_blender(&args.scene) {
        say!("export   {} by Blender", args.scene.display());
    }
}

pub(super) fn load_options(args: &RenderArgs) -> Result<LoadOptions> {
    let aspect = args.width.zip(args.height).map(|(w, h)| f64::from(w) / f64::from(h));
    let mut stage = args.stage.options(aspect, &mut Vec::new())?;
    if args.transparent {
        stage.background = Some(Background::Transparent);
    }
    Ok(LoadOptions {
        allow_external: args.allow_external,
        brings_environment: args.env.is_some(),
        gltf: args.asset.options(),
        shutter: args.shutter.options(args.fps, args.aov.iter().any(|aovs| aovs.contains(Aov::Motion))),
        point_radius: args.point_radius,
        up: args.stage.up,
        smooth_rad: args.stage.smooth.map(f64::to_radians),
        subdivision: args.stage.subdivision(),
        stage,
        no_sidecar: args.no_sidecar,
        blender: args.blender.options(),
        ..LoadOptions::default()
    })
}

/// What outlives a picture.
pub(super) struct Kept {
    pub said: Said,
    pub compiler: Compiler,
    /// Moving pictures so far, where there are to be any.
    pub moving: Option<MovingPictures>,
    /// What shows it on the way.
    pub preview: Option<Preview>,
}

impl Kept {
    /// At the start of a run.
    ///
    /// # Errors
    /// If what is to show it isn't there.
    pub fn new(args: &RenderArgs, compiler: Compiler) -> Result<Kept> {
        let preview = args.preview.as_ref().map(|how| Preview::open(args, how)).transpose()?;
        Ok(Kept { said: Said::default(), compiler, moving: None, preview })
    }
}

/// Renders one picture of a scene that began to load at `start`; `environment` is what the arguments put in place of the
/// scene's, unless that has been done.
pub(super) fn run_one(
    args: &RenderArgs,
    cancel: &CancelHandle,
    targets: &Targets,
    environment: Option<&EnvironmentOverride>,
    loaded: &mut Loaded,
    start: Instant,
    Kept { said, compiler, moving, preview }: &mut Kept,
) -> Result<Outcome> {
    let (given, args) = (args, &of_scene::completed(args, &loaded.scene.settings));
    let prepared = prepare_files((given, args), targets, environment, loaded, start, compiler)?;
    // Files tell of all that is not in the picture, be it as it must.
    let Prepared { scene, labels, camera, settled, how, kept_aovs, png, build, load_s, .. } = prepared;
    let Prepared { notes, mut warnings, left_out, .. } = prepared;
    let told: Vec<Warning> = warnings.iter().chain(&build.notes).cloned().collect();
    let (width, height) = (settled.options.width, settled.options.height);
    check_size(targets, moving.as_ref(), (width, height))?;
    say_scene(args, said, (&notes, &warnings, &left_out));
    refuse_warnings(args, &warnings, ErrorKind::Input)?;
    stop_before_pixels(cancel)?;

    let denoising = Denoising::of(args, targets, kept_aovs)?;
    let encode = |shot: Shot| Pictures::encode(&how, targets, shot, &png, &told);
    let mut keeper = Keeper::new(args, targets, loaded, &settled, &png, &told, denoising.kept())?;
    let rendering = Rendering::labelled(scene, labels, &camera, settled.options)?;
    let rendering = keeper.begin(rendering.placed(loaded.scene.backdrop.clone(), loaded.offset))?;
    preview.iter_mut().for_each(|shown| shown.begin(&rendering, &png, &camera, build.triangles, said));
    let (mut rendering, kept) =
        take_picture(args, cancel, rendering, &mut keeper, &encode, said, preview.as_mut())?;
    if is_unfinished_frame(args, &rendering) {
        return Ok(Outcome::Interrupted);
    }
    let (denoise_s, noisy) = denoising.run(&mut rendering, said);
    let outputs = targets.names(rendering.is_complete());
    let picture = rendering.into_picture();
    let start = Instant::now();
    let pictures = encode(Shot::from(&picture));
    say_pictures(args, said, &pictures, picture.statistics().interrupted)?;
    warnings.extend(pictures.warnings.iter().cloned().chain(noisy));
    warnings.extend(noise_warning(args, picture.statistics(), said));
    pictures.write()?;
    kept?; // after the pictures: who runs out of space for the one may have some for the others
    moving.iter_mut().try_for_each(|moving| moving.add(picture.film(), &png))?;
    let run = Run {
        load_s,
        denoise_s,
        write_s: start.elapsed().as_secs_f64(),
        width,
        height,
        seed: settled.options.seed,
        compiled: build,
        statistics: *picture.statistics(),
        peak_memory: peak_memory(),
        outputs,
        notes,
        warnings,
        left_out,
    };
    show::draw(args, picture.film(), &png);
    say_run(args, &run);
    Ok(if run.statistics.interrupted { Outcome::Interrupted } else { Outcome::Done })
}

/// Are files for pictures of this size?
fn check_size(targets: &Targets, moving: Option<&MovingPictures>, (width, height): (u32, u32)) -> Result<()> {
    targets.check_size(width, height)?;
    moving.map_or(Ok(()), |moving| moving.check_size(width, height))
}

/// Prepares a scene for files, and looks for options that these have no use for; the arguments are those that were given, and
/// those with what the scene says.
fn prepare_files(
    (given, args): (&RenderArgs, &RenderArgs),
    targets: &Targets,
    environment: Option<&EnvironmentOverride>,
    loaded: &mut Loaded,
    start: Instant,
    compiler: &mut Compiler,
) -> Result<Prepared> {
    let wants = Wants::of_files(args, targets.has_exr());
    let mut prepared = prepare(args, wants, environment, loaded, start, compiler)?;
    prepared.warnings.extend(idle::warnings(given, &loaded.scene, &prepared));
    Ok(prepared)
}

/// Was a frame of a sequence interrupted? With --resume it would pass for a finished one, so it is not written, which is said.
fn is_unfinished_frame(args: &RenderArgs, rendering: &Rendering) -> bool {
    let is_unfinished = args.frames.is_some() && rendering.statistics().interrupted;
    if is_unfinished {
        say!("the frame that was being rendered is not written");
    }
    is_unfinished
}

/// Says what came up while pictures were encoded. Who stops a run wants what is there, `--strict` or not.
fn say_pictures(args: &RenderArgs, said: &mut Said, pictures: &Pictures, is_interrupted: bool) -> Result<()> {
    if !args.quiet {
        said.warnings(&pictures.warnings);
    }
    if is_interrupted { Ok(()) } else { refuse_warnings(args, &pictures.warnings, ErrorKind::Output) }
}

/// Where the noise is not known to be as low as was asked for, that is said.
fn noise_warning(args: &RenderArgs, statistics: &Statistics, said: &mut Said) -> Option<Warning> {
    let asked = args.long.noise.filter(|_| !statistics.interrupted)?;
    let message = match statistics.error {
        Some(error) if error <= f64::from(asked) / 100.0 => return None,
        Some(error) => {
            format!("the noise is {:.2} %, not the {asked} % asked for", error * 100.0)
        }
        None => "there are too few samples to tell the noise: at least 32 a pixel are needed".to_string(),
    };
    let warning = Warning::general(message);
    if !args.quiet {
        said.warnings(std::slice::from_ref(&warning));
    }
    Some(warning)
}

/// Says how a run went.
fn say_run(args: &RenderArgs, run: &Run) {
    if !args.quiet {
        run.print();
    }
    if args.json {
        json::print(&report_json::of_run(run));
    }
}

/// Says what there is to say about a scene that was loaded: notes, warnings, and what was left out, if that is asked for.
fn say_scene(
    args: &RenderArgs,
    said: &mut Said,
    (notes, warnings, left_out): (&[Warning], &[Warning], &[String]),
) {
    if args.quiet {
        return;
    }
    said.notes(notes);
    said.warnings(warnings);
    if args.explain {
        left_out.iter().for_each(|what| say!("left out: {what}"));
    }
}

/// Renders until all samples are taken or something stops it; writes what `encode` makes of the picture so far as often as
/// it is wanted.
fn take_picture<'a>(
    args: &RenderArgs,
    cancel: &CancelHandle,
    rendering: Rendering,
    keeper: &mut Keeper,
    encode: &dyn Fn(Shot) -> Pictures<'a>,
    said: &mut Said,
    mut preview: Option<&mut Preview>,
) -> Result<(Rendering, Result<()>)> {
    let ends = Ends { limit: args.long.time_limit, by_noise: args.long.noise.is_some() };
    let progress = Arc::new(Progress::new(args.quiet, args.long.progress, ends));
    let shown = progress.clone();
    let mut rendering =
        rendering.with_cancel_handle(cancel.clone()).on_event(move |event| shown.show(&event));
    let mut saved = Instant::now();
    loop {
        keeper.before_pass(&mut rendering, said);
        let due = [
            keeper.next_write(),
            preview.as_ref().and_then(|shown| shown.next_show()),
            args.long.save_every.and_then(|pause| saved.checked_add(pause)),
        ];
        let due = due.into_iter().flatten().min();
        if rendering.run_until(|| due.is_some_and(|due| Instant::now() >= due)) != PassOutcome::Progressed {
            break;
        }
        preview.iter_mut().for_each(|shown| shown.show(&rendering, false, said));
        if args.long.save_every.is_some_and(|pause| saved.elapsed() >= pause) {
            // A disk that is full for a while is no reason to lose the rest.
            if let Err(error) = encode(Shot::from(&rendering)).write() {
                said.warnings(&[Warning::general(format!("the picture so far was not written: {error}"))]);
            }
            saved = Instant::now();
        }
    }
    preview.iter_mut().for_each(|shown| shown.show(&rendering, true, said));
    progress.finish(rendering.is_complete());
    let kept = keeper.finish(&mut rendering);
    Ok((rendering, kept))
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
