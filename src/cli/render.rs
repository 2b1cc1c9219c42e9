//! `oscura render`: load, compile, render, write, report.

use super::args::{RenderArgs, SequenceFrame};
use super::checkpoint::CheckpointWriter;
use super::parsers::Frames;
use super::picture_args::Quality;
use super::pictures::{
    self, AnimationFiles, Denoising, FinishedPicture, Pictures, Targets, check_stdout, still,
};
use super::preview::Preview;
use super::process::{Outcome, cancel_by_signals, exit_code};
use super::progress::{Progress, ProgressTarget, StageProgress, StopCriteria};
use super::report::{PrintedMessages, Run, name_options_in_error};
use super::scene_args::check_scene_path;
use super::settings::{
    EnvironmentOverride, PictureUse, Prepared, averages_frames, check_memory_before_loading, completed,
    idle_option_notes, memory_limit, prepare, requested, unused_option_warnings, watch_memory,
};
use super::shot::{RunState, Shot, refuse_warnings};
use super::{checkpoint, json, report, show};
use oscura::compile::Compiler;
use oscura::denoise::temporal::with_neighbours;
use oscura::error::{Error, ErrorKind, Result, Warning};
use oscura::film::{Aov, Film};
use oscura::load::stage::{Background, Turntable, middle};
use oscura::load::{LoadOptions, Loaded, is_of_blender, load, load_frames};
use oscura::output::is_same_target;
use oscura::render::{CancelHandle, PassOutcome, RarePaths, RenderOptions, Rendering, Statistics, in_pool};
use oscura::scene::{Camera, Keyframes, Scene};
use std::f64::consts::TAU;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Renders the scene of the arguments on its own thread pool.
fn run_scene(args: &RenderArgs, cancel: &CancelHandle) -> Result<Outcome> {
    in_pool(args.threads.map(usize::from), || run_all(args, cancel))?
}

/// Renders a still, a turntable or an animation.
fn run_all(args: &RenderArgs, cancel: &CancelHandle) -> Result<Outcome> {
    requested(args).check_size()?;
    checkpoint::check(args)?;
    if let Some(count) = args.orbit {
        return run_turntable(args, count, cancel);
    }
    match args.frames {
        None => run_picture(args, cancel),
        Some(frames) => run_frames(args, frames, cancel),
    }
}

/// Renders a still.
fn run_picture(args: &RenderArgs, cancel: &CancelHandle) -> Result<Outcome> {
    let targets = Targets::check(&args.output)?;
    let start = Instant::now();
    check_scene_path(&args.scene)?;
    check_memory_before_loading(args)?;
    let environment = EnvironmentOverride::load(args)?;
    let options = load_options(args)?;
    let mut loaded = load_scene(args, cancel, &options)?;
    print_default_output(args);
    if args.mark.is_some() {
        let parts = options.files.paths();
        let refuse = |target: &PathBuf| pictures::refuse_part(&args.scene, target, &parts, ELSEWHERE);
        args.output.iter().try_for_each(refuse)?;
    }
    let mut kept = RunState::new(args, Compiler::single())?;
    run_one(args, cancel, targets, Some(&environment), &mut loaded, start, &mut kept)
}

/// Help where a picture without -o would overwrite another file.
const ELSEWHERE: &str = "name the picture by -o FILE, which may replace a file";

/// Says where a picture without `-o` goes, and what else could be done.
fn print_default_output(args: &RenderArgs) {
    if args.mark.is_some() && !args.quiet {
        let (file, scene) = (args.output[0].display(), args.scene.display().to_string());
        let scene = if scene.contains(' ') { format!("\"{scene}\"") } else { scene };
        say!("note: without -o, the picture is {file} ('oscura view {scene}' shows it live in a browser)");
    }
}

/// Renders the frames of an animation; with --resume, those whose files are missing.
fn run_frames(args: &RenderArgs, frames: Frames, cancel: &CancelHandle) -> Result<Outcome> {
    let moving = Some(AnimationFiles::of(args)?);
    let still = still(&args.output);
    let file = |number| still.iter().map(|path| Frames::file(path, number)).collect::<Vec<_>>();
    for number in frames.numbers() {
        Targets::check(&file(number))?;
    }
    // Without numbered files (only --show or video output) all frames are rendered.
    let is_missing =
        |number: u32| !args.long.resume || still.is_empty() || !file(number).iter().all(|path| path.exists());
    let all: Vec<u32> = frames.numbers().collect();
    let missing: Vec<u32> = all.iter().copied().filter(|&number| is_missing(number)).collect();
    print_existing(args, all.len() - missing.len());
    // Frames averaged with a missing one are rendered again.
    let is_averaged = averages_frames(args);
    let rendered =
        if is_averaged { with_neighbours(&all, |n| missing.contains(&n)) } else { missing.clone() };
    if let Some(checkpoint) = &args.long.checkpoint {
        rendered
            .iter()
            .try_for_each(|&number| checkpoint::check_file(args, &Frames::file(checkpoint, number)))?;
    }
    let (mut start, mut numbers, mut outcome) = (Instant::now(), rendered.iter().copied(), Outcome::Done);
    let mut kept = RunState { moving, ..RunState::new(args, Compiler::sequence())? };
    check_scene_path(&args.scene)?;
    check_memory_before_loading(args)?;
    let environment = EnvironmentOverride::load(args)?;
    // While a frame is rendered, its own limits count.
    let mut watchdog = Some(watch_memory(args));
    let mut result =
        load_frames(&args.scene, &load_options(args)?, rendered.iter().copied(), args.fps, &mut |loaded| {
            watchdog = None;
            let Some(number) = numbers.next() else { return Ok(ControlFlow::Break(())) };
            let targets = Targets::check(&file(number))?;
            let mut args = args.clone();
            let label = match is_of_blender(&args.scene) {
                true => format!("frame    {number}"),
                false => format!("frame    {number}, {:.3} s", f64::from(number) / args.fps),
            };
            let is_neighbour = !missing.contains(&number);
            args.frame = Some(SequenceFrame { number, label, is_averaged, is_neighbour });
            args.long.checkpoint = args.long.checkpoint.map(|file| Frames::file(&file, number));
            outcome = run_one(&args, cancel, targets, Some(&environment), loaded, start, &mut kept)?;
            start = Instant::now();
            watchdog = Some(watch_memory(&args));
            Ok(match outcome {
                Outcome::Done => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            })
        });
    drop(watchdog);
    match (&result, &outcome) {
        (Ok(()), Outcome::Done) => result = kept.finish(args),
        _ => kept.print_unfinished(args),
    }
    result.map(|()| outcome)
}

/// Reports how many frames are skipped.
fn print_existing(args: &RenderArgs, frames: usize) {
    if !args.quiet && frames > 0 {
        say!("resume   {frames} frames exist and are left out");
    }
}

// `oscura render` of one scene or of several, one after another.

/// Placeholders for the scene's name in file names.
const STEMS: [&str; 2] = ["{stem}", "{name}"];

/// Renders all scenes. Failures are listed at the end; the highest exit code is returned.
pub(crate) fn run(args: &RenderArgs) -> Result<Outcome> {
    let shots: Vec<RenderArgs> = args.scenes.iter().map(|scene| of_scene(args, scene)).collect();
    check(&shots)?;
    check_stdout(args)?;
    show::check(args)?;
    let cancel = cancel_by_signals()?;
    match &shots[..] {
        [only] => run_scene(only, &cancel),
        _ => all(args, &shots, &cancel),
    }
}

/// The arguments for one of the scenes: file names with placeholders replaced, and the default name of the picture.
fn of_scene(args: &RenderArgs, scene: &Path) -> RenderArgs {
    let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
    let has_stem = |path: &PathBuf| STEMS.iter().any(|mark| path.to_string_lossy().contains(mark));
    let named = |path: &PathBuf| match has_stem(path) {
        true => PathBuf::from(
            STEMS.iter().fold(path.to_string_lossy().into_owned(), |name, mark| name.replace(mark, &stem)),
        ),
        false => path.clone(),
    };
    let mut own = args.clone();
    own.scene = scene.to_path_buf();
    own.output = args.output.iter().map(named).collect();
    own.long.checkpoint = args.long.checkpoint.as_ref().map(named);
    let is_sequence = args.frames.is_some() || args.orbit.is_some();
    if own.output.is_empty() && own.show.is_none() && !is_sequence {
        own.output.push(format!("{stem}.png").into());
        own.mark = Some(pictures::mark("render", scene));
    }
    own
}

/// Checks that all output files can be written and that no two scenes write the same file.
fn check(shots: &[RenderArgs]) -> Result<()> {
    for shot in shots {
        // A scene that isn't there is reported as such.
        if let Some(mark) = shot.mark.as_ref().filter(|_| shot.scene.exists()) {
            let check = |target: &PathBuf| pictures::check(target, mark, ELSEWHERE);
            shot.output.iter().try_for_each(check)?;
        }
        if shot.output.is_empty() && shot.show.is_none() {
            return Err(Error::usage("frames need an output")
                .with_help("such as -o turn.gif, -o turn.mp4, or -o turn.####.png for numbered files"));
        }
    }
    for shot in shots.iter().filter(|shot| shot.frames.is_none() && shot.orbit.is_none()) {
        Targets::check(&shot.output)?;
    }
    for (at, shot) in shots.iter().enumerate() {
        for earlier in &shots[..at] {
            let files = |args: &RenderArgs| -> Vec<PathBuf> {
                args.output.iter().chain(&args.long.checkpoint).cloned().collect()
            };
            let theirs = files(earlier);
            let same =
                files(shot).into_iter().find(|own| theirs.iter().any(|file| is_same_target(own, file)));
            if let Some(file) = same {
                let (a, b) = (earlier.scene.display(), shot.scene.display());
                let message = format!("{a} and {b} would both write {}", file.display());
                return Err(Error::usage(message)
                    .with_help("put {stem} into the names of files, such as -o '{stem}.exr'"));
            }
        }
    }
    Ok(())
}

fn all(args: &RenderArgs, shots: &[RenderArgs], cancel: &CancelHandle) -> Result<Outcome> {
    let mut failures: Vec<(&Path, u8)> = Vec::new();
    for shot in shots {
        if !args.quiet {
            say!("scene    {}", shot.scene.display());
        }
        match run_scene(shot, cancel) {
            Ok(Outcome::Interrupted) => return Ok(Outcome::Interrupted),
            Ok(Outcome::Failed(code)) => failures.push((&shot.scene, code)),
            Ok(_) => {}
            Err(error) => {
                let error = name_options_in_error(error);
                let code = exit_code(&error);
                report::error(&error);
                if args.json {
                    json::print(&json::of_error(&error, code));
                }
                failures.push((&shot.scene, code));
            }
        }
        if cancel.is_cancelled() {
            return Ok(Outcome::Interrupted);
        }
    }
    let Some(worst) = failures.iter().map(|(_, code)| *code).max() else { return Ok(Outcome::Done) };
    say!("{} of {} scenes failed:", failures.len(), shots.len());
    failures.iter().for_each(|(scene, code)| say!("  {} (exit code {code})", scene.display()));
    Ok(Outcome::Failed(worst))
}

// One picture of `oscura render`: load, compile, render, write, report.

/// Loads the scene, with progress reports if it takes long.
pub(super) fn load_scene(args: &RenderArgs, cancel: &CancelHandle, options: &LoadOptions) -> Result<Loaded> {
    print_export(args);
    let target = ProgressTarget::of(args.quiet, args.long.progress);
    let waiting = StageProgress::new(target, "load", &options.counter);
    let watchdog = watch_memory(args);
    let loaded = load(&args.scene, options);
    drop((waiting, watchdog));
    // A signal also ends Blender: its failure is not reported then.
    stop_before_pixels(cancel)?;
    loaded
}

/// Prints that Blender exports the scene.
fn print_export(args: &RenderArgs) {
    if !args.quiet && is_of_blender(&args.scene) {
        say!("export   {} by Blender", args.scene.display());
    }
}

/// Are motion vectors needed?
fn has_vectors(args: &RenderArgs) -> bool {
    averages_frames(args) || args.aov.iter().any(|aovs| aovs.contains(Aov::Motion))
}

pub(super) fn load_options(args: &RenderArgs) -> Result<LoadOptions> {
    let aspect = args.width.zip(args.height).map(|(w, h)| f64::from(w) / f64::from(h));
    let mut stage = args.stage.options(aspect, memory_limit(args), &mut Vec::new())?;
    if args.transparent {
        stage.background = Some(Background::Transparent);
    }
    Ok(LoadOptions {
        allow_external: args.allow_external,
        brings_environment: args.env.is_some(),
        gltf: args.asset.options(),
        shutter: args.shutter.options(args.fps, has_vectors(args)),
        point_radius: args.point_radius,
        up: args.stage.up,
        smooth_rad: args.stage.smooth.map(f64::to_radians),
        subdivision: args.stage.subdivision(),
        stage,
        no_sidecar: args.no_sidecar,
        blender: args.blender.options(),
        memory_limit: memory_limit(args),
        ..LoadOptions::default()
    })
}

/// Renders one picture of a scene that began to load at `start`; `environment` is what the arguments put in place of the
/// scene's, unless that has been done.
pub(super) fn run_one(
    args: &RenderArgs,
    cancel: &CancelHandle,
    targets: Targets,
    environment: Option<&EnvironmentOverride>,
    loaded: &mut Loaded,
    start: Instant,
    state: &mut RunState,
) -> Result<Outcome> {
    let mut shot = match shoot(args, cancel, targets, environment, loaded, start, state)? {
        ControlFlow::Continue(shot) => shot,
        ControlFlow::Break(outcome) => return Ok(outcome),
    };
    let Some(frame) = shot.args.frame.clone().filter(|_| shot.is_averaged) else {
        return shot.write(&mut state.printed, state.moving.as_mut());
    };
    let denoising = Instant::now();
    let alone = shot.picture.frame()?;
    let seconds = denoising.elapsed().as_secs_f64();
    shot.run.denoise_s = Some(seconds);
    shot.run.total_s += seconds;
    let done = state.sequence.push(frame.number, alone, (!frame.is_neighbour).then_some(shot));
    done.into_iter().try_for_each(|frame| state.write(frame))?;
    Ok(Outcome::Done)
}

/// Renders one picture; breaks with how the run ended if there is none.
fn shoot(
    args: &RenderArgs,
    cancel: &CancelHandle,
    targets: Targets,
    environment: Option<&EnvironmentOverride>,
    loaded: &mut Loaded,
    start: Instant,
    RunState { printed, compiler, moving, preview, .. }: &mut RunState,
) -> Result<ControlFlow<Outcome, Shot>> {
    let (given, args) = (args, completed(args, &loaded.scene.settings));
    let prepared = prepare_files((given, &args), &targets, environment, loaded, start, compiler)?;
    let Prepared { scene, labels, camera, resolved, how, kept_aovs, png, build, load_s, .. } = prepared;
    let Prepared { mut notes, mut warnings, left_out, .. } = prepared;
    let log: Vec<Warning> = warnings.iter().chain(&build.notes).cloned().collect();
    check_size(&targets, moving.as_ref(), &resolved.options)?;
    begin(&args, cancel, printed, (&notes, &warnings, &left_out))?;
    let denoising = Denoising::of(&args, &targets, kept_aovs);
    let encode = |shot: FinishedPicture| Pictures::encode(&how, &targets, shot, &png, &log);
    let mut keeper = CheckpointWriter::new(&args, &targets, loaded, &resolved, &png, &log, denoising.kept())?;
    let rendering = Rendering::labelled(scene, labels, &camera, resolved.options)?;
    let rendering = keeper.begin(rendering.placed(loaded.scene.backdrop.clone(), loaded.offset))?;
    preview.iter_mut().for_each(|shown| shown.begin(&rendering, &png, &camera, build.triangles, printed));
    let (mut rendering, kept) =
        take_picture(&args, cancel, rendering, &mut keeper, &encode, printed, preview.as_mut())?;
    if let Some(ended) = end_without_picture(&args, &rendering, &resolved.options) {
        return kept.and(ended).map(ControlFlow::Break);
    }
    warnings.extend(error_warnings(&args, &rendering, printed));
    let (denoise_s, is_averaged) = (denoising.run(&mut rendering, printed), denoising.is_over_frames());
    let (outputs, picture) = (targets.names(rendering.is_complete()), rendering.into_picture());
    notes.extend(dark_note(&args, picture.film(), png.exposure, &loaded.scene, printed));
    let run = Run {
        total_s: start.elapsed().as_secs_f64(),
        load_s,
        denoise_s,
        write_s: 0.0,
        size: (resolved.options.width, resolved.options.height),
        seed: resolved.options.seed,
        quality: args.quality,
        compiled: build,
        statistics: *picture.statistics(),
        peak_memory: None,
        outputs,
        notes,
        warnings,
        left_out,
    };
    Ok(ControlFlow::Continue(Shot {
        args,
        targets,
        how,
        png,
        kept_aovs,
        picture,
        is_averaged,
        kept,
        log,
        run,
    }))
}

/// Prints the notes and warnings of loading and what was left out; ends where warnings or a signal do.
fn begin(
    args: &RenderArgs,
    cancel: &CancelHandle,
    printed: &mut PrintedMessages,
    found: (&[Warning], &[Warning], &[String]),
) -> Result<()> {
    print_scene(args, printed, found);
    refuse_warnings(args, found.1, ErrorKind::Input)?;
    stop_before_pixels(cancel)
}

/// Checks that the outputs can store pictures of this size.
fn check_size(targets: &Targets, moving: Option<&AnimationFiles>, options: &RenderOptions) -> Result<()> {
    let RenderOptions { width, height, .. } = *options;
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
    if let Some(frame) = args.frame.as_ref().filter(|_| args.verbose) {
        say!("{}", frame.label);
    }
    let wants = PictureUse::of_files(args, targets.has_exr());
    let mut prepared = prepare(args, wants, environment, loaded, start, compiler)?;
    if let Some(frame) = args.frame.as_ref().filter(|_| args.animate_seed) {
        let options = &mut prepared.resolved.options;
        *options = options.seed(options.seed.wrapping_add(frame.number));
    }
    prepared.warnings.extend(unused_option_warnings(given, &loaded.scene, &prepared));
    prepared.notes.extend(idle_option_notes(given, &loaded.scene));
    Ok(prepared)
}

/// How a run ends whose picture is not written: `None` if it is.
fn end_without_picture(
    args: &RenderArgs,
    rendering: &Rendering,
    options: &RenderOptions,
) -> Option<Result<Outcome>> {
    if is_unfinished_frame(args, rendering) {
        return Some(Ok(Outcome::Interrupted));
    }
    is_incomplete(rendering, options).then(|| Err(nothing_written()))
}

/// True where a signal came before each pixel had a sample: pixels without one are black. Those outside of a region have none.
fn is_incomplete(rendering: &Rendering, options: &RenderOptions) -> bool {
    let film = rendering.film();
    let all = u64::from(film.width()) * u64::from(film.height());
    let wanted = options.region.map_or(all, |region| u64::from(region.width()) * u64::from(region.height()));
    rendering.statistics().interrupted && film.unsampled_pixels() > all.saturating_sub(wanted)
}

/// True for an interrupted frame of an animation: it is not written, since --resume would take it for a finished one.
fn is_unfinished_frame(args: &RenderArgs, rendering: &Rendering) -> bool {
    let is_unfinished = args.frames.is_some() && rendering.statistics().interrupted;
    if is_unfinished {
        say!("the frame that was being rendered is not written");
    }
    is_unfinished
}

/// Notes that the picture is nearly black.
fn dark_note(
    args: &RenderArgs,
    film: &Film,
    exposure: f32,
    scene: &Scene,
    printed: &mut PrintedMessages,
) -> Option<Warning> {
    let note = report::darkness_note(film, exposure, scene, &args.scene)?;
    if !args.quiet {
        printed.notes(std::slice::from_ref(&note));
    }
    Some(note)
}

/// Warns where the error may be larger than asked for or than it seems.
fn error_warnings(args: &RenderArgs, rendering: &Rendering, printed: &mut PrintedMessages) -> Vec<Warning> {
    let (rare, noise) = (rendering.rare_paths(), noise_warning(args, &rendering.statistics()));
    let warnings: Vec<Warning> = rare.map(rare_warning).into_iter().chain(noise).collect();
    if !args.quiet {
        printed.warnings(&warnings);
    }
    warnings
}

/// Warns of light that few paths carry, of which the estimate of the noise knows too little.
fn rare_warning(RarePaths { share, pixel: [x, y], .. }: RarePaths) -> Warning {
    Warning::general(format!(
        "rare bright paths remain: single samples hold {:.0} % of the picture's light, most of it near pixel {x}, {y}, and more may be \
         missing than the estimated noise shows; more samples, --caustics on (light through glass and off mirrors) or --guiding on find it, --clamp \
         cuts it off",
        (share * 100.0).max(1.0)
    ))
    .with_code("rare-paths")
}

/// Warns if the noise threshold was not reached.
fn noise_warning(args: &RenderArgs, statistics: &Statistics) -> Option<Warning> {
    let is_promised = args.quality.is_none_or(Quality::promises_error);
    let asked = args.long.noise.filter(|_| is_promised && !statistics.interrupted)?;
    let message = match statistics.error {
        Some(error) if error <= f64::from(asked) / 100.0 => return None,
        Some(error) => {
            format!("the noise is {:.2} %, not the {asked} % asked for", error * 100.0)
        }
        None => "there are too few samples to estimate the noise: at least 16 a pixel are needed".to_string(),
    };
    Some(Warning::general(("noise-not-reached", message)))
}

/// Prints the notes and warnings of loading, and with --explain what was left out.
fn print_scene(
    args: &RenderArgs,
    printed: &mut PrintedMessages,
    (notes, warnings, left_out): (&[Warning], &[Warning], &[String]),
) {
    if args.quiet {
        return;
    }
    printed.notes(notes);
    printed.warnings(warnings);
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
    keeper: &mut CheckpointWriter,
    encode: &dyn Fn(FinishedPicture) -> Pictures<'a>,
    printed: &mut PrintedMessages,
    mut preview: Option<&mut Preview>,
) -> Result<(Rendering, Result<()>)> {
    let ends = StopCriteria { limit: args.long.time_limit, by_noise: args.long.noise.is_some() };
    let progress = Progress::new(
        args.quiet,
        args.long.progress,
        ends,
        args.frame.as_ref().map(|frame| frame.label.as_str()),
    );
    let progress = Arc::new(progress);
    let shown = progress.clone();
    let mut rendering =
        rendering.with_cancel_handle(cancel.clone()).on_event(move |event| shown.show(&event));
    let mut saved = Instant::now();
    loop {
        keeper.before_pass(&mut rendering, printed);
        let due = [
            keeper.next_write(),
            preview.as_ref().and_then(|shown| shown.next_show()),
            args.long.save_every.and_then(|pause| saved.checked_add(pause)),
        ];
        let due = due.into_iter().flatten().min();
        if rendering.run_until(|| due.is_some_and(|due| Instant::now() >= due)) != PassOutcome::Progressed {
            break;
        }
        preview.iter_mut().for_each(|shown| shown.show(&rendering, false, printed));
        if args.long.save_every.is_some_and(|pause| saved.elapsed() >= pause) {
            // A full disk only costs this intermediate picture.
            if let Err(error) = encode(FinishedPicture::from(&rendering)).write() {
                printed.warnings(&[Warning::general(format!("the picture so far was not written: {error}"))]);
            }
            saved = Instant::now();
        }
    }
    preview.iter_mut().for_each(|shown| shown.show(&rendering, true, printed));
    progress.finish(rendering.is_complete());
    let kept = keeper.finish(&mut rendering);
    Ok((rendering, kept))
}

/// Interrupted before each pixel has a sample: nothing is written, and a picture that is there stays.
fn stop_before_pixels(cancel: &CancelHandle) -> Result<()> {
    if cancel.is_cancelled() { Err(nothing_written()) } else { Ok(()) }
}

fn nothing_written() -> Error {
    let message = "stopped by a signal before each pixel had a sample; no picture was written";
    Error { kind: ErrorKind::Interrupted, ..Error::usage(message) }
}

// `oscura render --orbit N`: turntables.

/// Renders all frames of a turntable, counter-clockwise seen from above, starting at the camera's position.
fn run_turntable(args: &RenderArgs, count: u32, cancel: &CancelHandle) -> Result<Outcome> {
    let still = still(&args.output);
    let files = |k: u32| still.iter().map(|path| Frames::file(path, k)).collect::<Vec<_>>();
    (0..count).try_for_each(|k| Targets::check(&files(k)).map(drop))?;
    let moving = Some(AnimationFiles::of(args)?);
    let mut start = Instant::now();
    check_scene_path(&args.scene)?;
    let environment = EnvironmentOverride::load(args)?;
    let mut options = load_options(args)?;
    options.stage.is_orbit = true;
    let mut loaded = load_scene(args, cancel, &options)?;
    let warnings = environment.apply(args, &mut loaded.scene);
    loaded.warnings.extend(warnings);
    let number = requested(args).resolve(&loaded.scene)?.camera.unwrap_or(0);
    let first = loaded.scene.cameras.get(number).cloned();
    let first = first.ok_or_else(|| Error::input(&args.scene, "has no camera"))?;
    let table = turntable(&loaded);
    let mut kept = RunState { moving, ..RunState::new(args, Compiler::sequence())? };
    for k in 0..count {
        let frame = Some(SequenceFrame {
            number: k,
            label: format!("frame    {k} of {count}"),
            is_averaged: averages_frames(args),
            is_neighbour: false,
        });
        let args = &RenderArgs { frame, ..args.clone() };
        let angle = |frame: f64| frame / f64::from(count) * TAU;
        let now = f64::from(k);
        let neighbours =
            [now - 1.0, now + 1.0].map(|frame| table.camera(&first, angle(frame)).world_from_camera);
        let motion = has_vectors(args).then(|| Keyframes { keys: Vec::new(), neighbours: Some(neighbours) });
        loaded.scene.cameras[number] = Camera { motion, ..table.camera(&first, angle(now)) };
        table.light(&mut loaded.scene, angle(now));
        let targets = Targets::check(&files(k))?;
        let outcome = run_one(args, cancel, targets, None, &mut loaded, start, &mut kept);
        if !matches!(outcome, Ok(Outcome::Done)) {
            kept.print_unfinished(args);
            return outcome;
        }
        start = Instant::now();
    }
    kept.finish(args)?;
    Ok(Outcome::Done)
}

/// Turntable around the framed model, else around the centre of the scene.
fn turntable(loaded: &Loaded) -> Turntable {
    loaded.turntable.unwrap_or_else(|| Turntable::new(middle(loaded), false))
}
