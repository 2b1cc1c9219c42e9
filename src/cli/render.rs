//! `oscura render`: load, compile, render, write, report.

use super::args::{RenderArgs, SequenceFrame};
use super::checkpoint::CheckpointWriter;
use super::parsers::Frames;
use super::picture_args::Quality;
use super::pictures::{
    self, AnimationFiles, Denoising, Pictures, Targets, UnencodedPicture, check_stdout, stills,
};
use super::preview::Preview;
use super::process::{Outcome, cancel_by_signals, exit_code};
use super::progress::{Progress, ProgressTarget, StageProgress, StopCriteria};
use super::rendered_picture::{RenderedPicture, RunState, refuse_warnings};
use super::report::{PrintedMessages, Run, name_options_in_error};
use super::scene_args::check_scene_path;
use super::settings::{
    EnvironmentOverride, PictureUse, Prepared, averages_frames, check_memory_before_loading, completed,
    ineffective_option_notes, memory_limit, prepare, requested, unused_option_warnings, watch_memory,
};
use super::{checkpoint, json, report, show};
use oscura::compile::Compiler;
use oscura::denoise::temporal::with_neighbours;
use oscura::error::{Error, ErrorKind, Result, Warning};
use oscura::film::{Aov, Film};
use oscura::load::stage::{Background, Turntable, scene_center};
use oscura::load::{LoadOptions, Loaded, is_blender_file, load, load_frames};
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
        let files = options.files.paths();
        let refuse = |target: &PathBuf| pictures::refuse_scene_file(&args.scene, target, &files, OUTPUT_HELP);
        args.output.iter().try_for_each(refuse)?;
    }
    let mut state = RunState::new(args, Compiler::single())?;
    run_one(args, cancel, targets, Some(&environment), &mut loaded, start, &mut state)
}

/// Help if the default output would overwrite another file.
const OUTPUT_HELP: &str = "choose the output with -o FILE, which overwrites existing files";

/// Prints the default output file and suggests `oscura view`.
fn print_default_output(args: &RenderArgs) {
    if args.mark.is_some() && !args.quiet {
        let (file, scene) = (args.output[0].display(), args.scene.display().to_string());
        let scene = if scene.contains(' ') { format!("\"{scene}\"") } else { scene };
        say!("note: the default output is {file} ('oscura view {scene}' shows the scene live in a browser)");
    }
}

/// Renders the frames of an animation; with `--resume`, only frames whose files are missing.
fn run_frames(args: &RenderArgs, frames: Frames, cancel: &CancelHandle) -> Result<Outcome> {
    let animations = Some(AnimationFiles::of(args)?);
    let stills = stills(&args.output);
    let files = |number| stills.iter().map(|path| Frames::file(path, number)).collect::<Vec<_>>();
    for number in frames.numbers() {
        Targets::check(&files(number))?;
    }
    // Without numbered files (only --show or video output) all frames are rendered.
    let is_missing = |number: u32| {
        !args.long.resume || stills.is_empty() || !files(number).iter().all(|path| path.exists())
    };
    let all: Vec<u32> = frames.numbers().collect();
    let missing: Vec<u32> = all.iter().copied().filter(|&number| is_missing(number)).collect();
    print_existing(args, all.len() - missing.len());
    // Neighbours of missing frames are rendered again, for temporal denoising.
    let is_averaged = averages_frames(args);
    let rendered =
        if is_averaged { with_neighbours(&all, |n| missing.contains(&n)) } else { missing.clone() };
    if let Some(checkpoint) = &args.long.checkpoint {
        rendered
            .iter()
            .try_for_each(|&number| checkpoint::check_file(args, &Frames::file(checkpoint, number)))?;
    }
    let (mut start, mut numbers, mut outcome) = (Instant::now(), rendered.iter().copied(), Outcome::Done);
    let mut state = RunState { animations, ..RunState::new(args, Compiler::sequence())? };
    check_scene_path(&args.scene)?;
    check_memory_before_loading(args)?;
    let environment = EnvironmentOverride::load(args)?;
    // Only runs while loading: rendering has its own memory checks.
    let mut watchdog = Some(watch_memory(args));
    let mut result =
        load_frames(&args.scene, &load_options(args)?, rendered.iter().copied(), args.fps, &mut |loaded| {
            watchdog = None;
            let Some(number) = numbers.next() else { return Ok(ControlFlow::Break(())) };
            let targets = Targets::check(&files(number))?;
            let mut args = args.clone();
            let label = match is_blender_file(&args.scene) {
                true => format!("frame    {number}"),
                false => format!("frame    {number}, {:.3} s", f64::from(number) / args.fps),
            };
            let is_neighbour = !missing.contains(&number);
            args.frame = Some(SequenceFrame { number, label, is_averaged, is_neighbour });
            args.long.checkpoint = args.long.checkpoint.map(|file| Frames::file(&file, number));
            outcome = run_one(&args, cancel, targets, Some(&environment), loaded, start, &mut state)?;
            start = Instant::now();
            watchdog = Some(watch_memory(&args));
            Ok(match outcome {
                Outcome::Done => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            })
        });
    drop(watchdog);
    match (&result, &outcome) {
        (Ok(()), Outcome::Done) => result = state.finish(args),
        _ => state.print_unfinished(args),
    }
    result.map(|()| outcome)
}

/// Prints the number of skipped frames.
fn print_existing(args: &RenderArgs, frames: usize) {
    if !args.quiet && frames > 0 {
        say!("resume   {frames} frames exist and are skipped");
    }
}

// `oscura render` of one or more scenes.

/// Placeholders in file names for the scene's file stem.
const STEM_PLACEHOLDERS: [&str; 2] = ["{stem}", "{name}"];

/// Renders all scenes one after another. Failures are listed at the end; the highest exit code is returned.
pub(crate) fn run(args: &RenderArgs) -> Result<Outcome> {
    let jobs: Vec<RenderArgs> = args.scenes.iter().map(|scene| args_for_scene(args, scene)).collect();
    check(&jobs)?;
    check_stdout(args)?;
    show::check(args)?;
    let cancel = cancel_by_signals()?;
    match &jobs[..] {
        [only] => run_scene(only, &cancel),
        _ => run_scenes(args, &jobs, &cancel),
    }
}

/// The arguments for one scene: placeholders in file names are replaced and the default output is set.
fn args_for_scene(args: &RenderArgs, scene: &Path) -> RenderArgs {
    let stem = scene.file_stem().unwrap_or_default().to_string_lossy();
    let has_placeholder =
        |path: &PathBuf| STEM_PLACEHOLDERS.iter().any(|text| path.to_string_lossy().contains(text));
    let with_stem = |path: &PathBuf| match has_placeholder(path) {
        true => PathBuf::from(
            STEM_PLACEHOLDERS
                .iter()
                .fold(path.to_string_lossy().into_owned(), |name, text| name.replace(text, &stem)),
        ),
        false => path.clone(),
    };
    let mut own = args.clone();
    own.scene = scene.to_path_buf();
    own.output = args.output.iter().map(with_stem).collect();
    own.long.checkpoint = args.long.checkpoint.as_ref().map(with_stem);
    let is_sequence = args.frames.is_some() || args.orbit.is_some();
    if own.output.is_empty() && own.show.is_none() && !is_sequence {
        own.output.push(format!("{stem}.png").into());
        own.mark = Some(pictures::mark("render", scene));
    }
    own
}

/// Checks that all output files can be written and that no two scenes write the same file.
fn check(jobs: &[RenderArgs]) -> Result<()> {
    for job in jobs {
        // Missing files and files that aren't scenes are reported later.
        if let Some(mark) = job.mark.as_ref().filter(|_| check_scene_path(&job.scene).is_ok()) {
            let check = |target: &PathBuf| pictures::check(target, mark, OUTPUT_HELP);
            job.output.iter().try_for_each(check)?;
        }
        if job.output.is_empty() && job.show.is_none() {
            return Err(Error::usage("frames need an output")
                .with_help("such as -o turn.gif, -o turn.mp4, or -o turn.####.png for numbered files"));
        }
    }
    for job in jobs.iter().filter(|job| job.frames.is_none() && job.orbit.is_none()) {
        Targets::check(&job.output)?;
    }
    for (index, job) in jobs.iter().enumerate() {
        for earlier in &jobs[..index] {
            let files = |args: &RenderArgs| -> Vec<PathBuf> {
                args.output.iter().chain(&args.long.checkpoint).cloned().collect()
            };
            let earlier_files = files(earlier);
            let duplicate = (files(job).into_iter())
                .find(|own| earlier_files.iter().any(|file| is_same_target(own, file)));
            if let Some(file) = duplicate {
                let (a, b) = (earlier.scene.display(), job.scene.display());
                let message = format!("{a} and {b} would both write {}", file.display());
                return Err(
                    Error::usage(message).with_help("use {stem} in file names, such as -o '{stem}.exr'")
                );
            }
        }
    }
    Ok(())
}

fn run_scenes(args: &RenderArgs, jobs: &[RenderArgs], cancel: &CancelHandle) -> Result<Outcome> {
    let mut failures: Vec<(&Path, u8)> = Vec::new();
    for job in jobs {
        if !args.quiet {
            say!("scene    {}", job.scene.display());
        }
        match run_scene(job, cancel) {
            Ok(Outcome::Interrupted) => return Ok(Outcome::Interrupted),
            Ok(Outcome::Failed(code)) => failures.push((&job.scene, code)),
            Ok(_) => {}
            Err(error) => {
                let error = name_options_in_error(error);
                let code = exit_code(&error);
                report::error(&error);
                if args.json {
                    json::print(&json::of_error(&error, code));
                }
                failures.push((&job.scene, code));
            }
        }
        if cancel.is_cancelled() {
            return Ok(Outcome::Interrupted);
        }
    }
    let Some(worst) = failures.iter().map(|(_, code)| *code).max() else { return Ok(Outcome::Done) };
    say!("{} of {} scenes failed:", failures.len(), jobs.len());
    failures.iter().for_each(|(scene, code)| say!("  {} (exit code {code})", scene.display()));
    Ok(Outcome::Failed(worst))
}

// One picture of `oscura render`: load, compile, render, write, report.

/// Loads the scene and reports progress.
pub(super) fn load_scene(args: &RenderArgs, cancel: &CancelHandle, options: &LoadOptions) -> Result<Loaded> {
    print_export(args);
    let target = ProgressTarget::of(args.quiet, args.long.progress);
    let progress = StageProgress::new(target, "load", &options.counter);
    let watchdog = watch_memory(args);
    let loaded = load(&args.scene, options);
    drop((progress, watchdog));
    // A signal also ends Blender: don't report that as a failure of Blender.
    check_interrupted(cancel)?;
    loaded
}

/// Prints that Blender exports the scene.
fn print_export(args: &RenderArgs) {
    if !args.quiet && is_blender_file(&args.scene) {
        say!("export   {} by Blender", args.scene.display());
    }
}

/// Whether motion vectors are needed.
fn needs_motion_vectors(args: &RenderArgs) -> bool {
    averages_frames(args) || args.aov.iter().any(|aovs| aovs.contains(Aov::Motion))
}

pub(super) fn load_options(args: &RenderArgs) -> Result<LoadOptions> {
    let aspect = args.width.zip(args.height).map(|(w, h)| f64::from(w) / f64::from(h));
    let mut stage = args.stage.options(aspect, memory_limit(args), &mut Vec::new())?;
    if args.transparent {
        stage.background = Some(Background::Transparent);
    }
    Ok(LoadOptions {
        allow_external: args.source.allow_external,
        overrides_environment: args.env.is_some(),
        gltf: args.asset.options(),
        shutter: args.shutter.options(args.fps, needs_motion_vectors(args)),
        point_radius: args.source.point_radius,
        up: args.stage.up,
        smooth_rad: args.stage.smooth.map(f64::to_radians),
        subdivision: args.stage.subdivision(),
        stage,
        no_sidecar: args.source.no_sidecar,
        blender: args.blender.options(),
        memory_limit: memory_limit(args),
        ..LoadOptions::default()
    })
}

/// Renders and writes one picture of a scene whose loading began at `start`. `environment` overrides the scene's; `None` if
/// already applied.
pub(super) fn run_one(
    args: &RenderArgs,
    cancel: &CancelHandle,
    targets: Targets,
    environment: Option<&EnvironmentOverride>,
    loaded: &mut Loaded,
    start: Instant,
    state: &mut RunState,
) -> Result<Outcome> {
    let mut rendered = match render_picture(args, cancel, targets, environment, loaded, start, state)? {
        ControlFlow::Continue(rendered) => rendered,
        ControlFlow::Break(outcome) => return Ok(outcome),
    };
    let Some(frame) = rendered.args.frame.clone().filter(|_| rendered.is_averaged) else {
        return rendered.write(&mut state.printed, state.animations.as_mut());
    };
    let denoising_start = Instant::now();
    let denoised = rendered.picture.frame()?;
    let seconds = denoising_start.elapsed().as_secs_f64();
    rendered.run.denoise_s = Some(seconds);
    rendered.run.total_s += seconds;
    let finished = state.sequence.push(frame.number, denoised, (!frame.is_neighbour).then_some(rendered));
    finished.into_iter().try_for_each(|frame| state.write(frame))?;
    Ok(Outcome::Done)
}

/// Renders one picture; breaks with the run's outcome if there is no picture.
fn render_picture(
    args: &RenderArgs,
    cancel: &CancelHandle,
    targets: Targets,
    environment: Option<&EnvironmentOverride>,
    loaded: &mut Loaded,
    start: Instant,
    RunState { printed, compiler, animations, preview, .. }: &mut RunState,
) -> Result<ControlFlow<Outcome, RenderedPicture>> {
    let (given, args) = (args, completed(args, &loaded.scene.settings));
    let prepared = prepare_files((given, &args), &targets, environment, loaded, start, compiler)?;
    let Prepared { camera, resolved, encoding, png, build, mut notes, mut warnings, left_out, .. } = prepared;
    let messages: Vec<Warning> = warnings.iter().chain(&build.notes).cloned().collect();
    check_size(&targets, animations.as_ref(), &resolved.options)?;
    report_loading(&args, cancel, printed, (&notes, &warnings, &left_out))?;
    let denoising = Denoising::of(&args, &targets, prepared.output_aovs);
    let encode = |picture: UnencodedPicture| Pictures::encode(&encoding, &targets, picture, &png, &messages);
    let mut checkpoint =
        CheckpointWriter::new(&args, &targets, loaded, &resolved, &png, &messages, denoising.output_aovs())?;
    let rendering = Rendering::labelled(prepared.scene, prepared.labels, &camera, resolved.options)?;
    let rendering = checkpoint.begin(rendering.placed(loaded.scene.backdrop.clone(), loaded.offset))?;
    preview.iter_mut().for_each(|preview| preview.begin(&rendering, &png, &camera, build.triangles, printed));
    let (mut rendering, checkpoint) =
        render_passes(&args, cancel, rendering, &mut checkpoint, &encode, printed, preview.as_mut())?;
    if let Some(ended) = end_without_picture(&args, &targets, &rendering) {
        return checkpoint.and(ended).map(ControlFlow::Break);
    }
    warnings.extend(error_warnings(&args, &rendering, printed));
    let (denoise_s, is_averaged) = (denoising.run(&mut rendering, printed), denoising.is_temporal());
    let (outputs, picture) = (targets.names(rendering.is_complete()), rendering.into_picture());
    notes.extend(dark_note(&args, picture.film(), png.exposure, &loaded.scene, printed));
    let run = Run {
        total_s: start.elapsed().as_secs_f64(),
        load_s: prepared.load_s,
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
    Ok(ControlFlow::Continue(RenderedPicture {
        args,
        targets,
        encoding,
        png,
        output_aovs: prepared.output_aovs,
        picture,
        is_averaged,
        checkpoint,
        messages,
        run,
    }))
}

/// Prints the messages of loading.
///
/// # Errors
/// With `--strict`, if there are warnings; if a signal arrived.
fn report_loading(
    args: &RenderArgs,
    cancel: &CancelHandle,
    printed: &mut PrintedMessages,
    (notes, warnings, left_out): (&[Warning], &[Warning], &[String]),
) -> Result<()> {
    print_messages(args, printed, (notes, warnings, left_out));
    refuse_warnings(args, warnings, ErrorKind::Input)?;
    check_interrupted(cancel)
}

/// Checks that the outputs can store pictures of this size.
fn check_size(targets: &Targets, animations: Option<&AnimationFiles>, options: &RenderOptions) -> Result<()> {
    let RenderOptions { width, height, .. } = *options;
    targets.check_size(width, height)?;
    animations.map_or(Ok(()), |animations| animations.check_size(width, height))
}

/// Prepares a scene for output files and warns of options without effect. `given` are the arguments as given, `args` those
/// completed by the scene's settings.
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
    let usage = PictureUse::of_files(args, targets.has_exr());
    let mut prepared = prepare(args, usage, environment, loaded, start, compiler)?;
    if let Some(frame) = args.frame.as_ref().filter(|_| args.animate_seed) {
        let options = &mut prepared.resolved.options;
        *options = options.seed(options.seed.wrapping_add(frame.number));
    }
    prepared.warnings.extend(unused_option_warnings(given, &loaded.scene, &prepared));
    prepared.notes.extend(ineffective_option_notes(given, &loaded.scene));
    Ok(prepared)
}

/// Outcome of a run whose picture is not written; `None` if it is written.
fn end_without_picture(
    args: &RenderArgs,
    targets: &Targets,
    rendering: &Rendering,
) -> Option<Result<Outcome>> {
    if is_unfinished_frame(args, rendering) {
        return Some(Ok(Outcome::Interrupted));
    }
    // After a signal, a picture with unsampled pixels is written, unless it would replace an earlier picture.
    let (statistics, film) = (rendering.statistics(), rendering.film());
    let is_unwritten = statistics.interrupted
        && (statistics.samples == 0 || targets.existing().is_some() && film.unsampled_pixels() > 0);
    is_unwritten.then(|| Err(nothing_written(targets.existing())))
}

/// True for an interrupted frame of an animation, which is not written: `--resume` would treat it as finished.
fn is_unfinished_frame(args: &RenderArgs, rendering: &Rendering) -> bool {
    let is_unfinished = args.frames.is_some() && rendering.statistics().interrupted;
    if is_unfinished {
        say!("the interrupted frame is not written");
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

/// Warns if the error exceeds the threshold or may be underestimated.
fn error_warnings(args: &RenderArgs, rendering: &Rendering, printed: &mut PrintedMessages) -> Vec<Warning> {
    let (rare, noise) = (rendering.rare_paths(), noise_warning(args, &rendering.statistics()));
    let warnings: Vec<Warning> = rare.map(rare_warning).into_iter().chain(noise).collect();
    if !args.quiet {
        printed.warnings(&warnings);
    }
    warnings
}

/// Warns of rare bright paths, which the noise estimate underestimates.
fn rare_warning(RarePaths { share, pixel: [x, y], .. }: RarePaths) -> Warning {
    Warning::general(format!(
        "rare bright paths remain: single samples contribute {:.0} % of the picture's light, most of it near pixel {x}, {y}, so \
         the noise may be underestimated; more samples, --caustics on (light through glass and off mirrors) or --guiding on \
         help, and --clamp removes them",
        (share * 100.0).max(1.0)
    ))
    .with_code("rare-paths")
}

/// Warns if the noise threshold was not reached.
fn noise_warning(args: &RenderArgs, statistics: &Statistics) -> Option<Warning> {
    let is_promised = args.quality.is_none_or(Quality::warns_of_noise);
    let threshold = args.long.noise.filter(|_| is_promised && !statistics.interrupted)?;
    let message = match statistics.error {
        Some(error) if error <= f64::from(threshold) / 100.0 => return None,
        Some(error) => {
            let what = if args.picture.denoise { "error of the denoised picture" } else { "noise" };
            format!("the {what} is {:.2} %, above the threshold of {threshold} %", error * 100.0)
        }
        None => {
            "there are too few samples to estimate the noise: at least 16 per pixel are needed".to_string()
        }
    };
    Some(Warning::general(("noise-not-reached", message)))
}

/// Prints the notes and warnings of loading, and with `--explain` what was left out.
fn print_messages(
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
        left_out.iter().for_each(|item| say!("left out: {item}"));
    }
}

/// Renders until finished or stopped. With `--save-every`, writes intermediate pictures encoded by `encode`. Also returns the
/// result of writing the checkpoint.
fn render_passes<'a>(
    args: &RenderArgs,
    cancel: &CancelHandle,
    rendering: Rendering,
    checkpoint: &mut CheckpointWriter,
    encode: &dyn Fn(UnencodedPicture) -> Pictures<'a>,
    printed: &mut PrintedMessages,
    mut preview: Option<&mut Preview>,
) -> Result<(Rendering, Result<()>)> {
    let criteria = StopCriteria { time_limit: args.long.time_limit, by_noise: args.long.noise.is_some() };
    let progress = Progress::new(
        args.quiet,
        args.long.progress,
        criteria,
        args.frame.as_ref().map(|frame| frame.label.as_str()),
    );
    let progress = Arc::new(progress);
    let event_progress = progress.clone();
    let mut rendering =
        rendering.with_cancel_handle(cancel.clone()).on_event(move |event| event_progress.show(&event));
    let mut saved = Instant::now();
    loop {
        checkpoint.before_pass(&mut rendering, printed);
        let due = [
            checkpoint.next_write(),
            preview.as_ref().and_then(|preview| preview.next_show()),
            args.long.save_every.and_then(|interval| saved.checked_add(interval)),
        ];
        let due = due.into_iter().flatten().min();
        if rendering.run_until(|| due.is_some_and(|due| Instant::now() >= due)) != PassOutcome::Progressed {
            break;
        }
        preview.iter_mut().for_each(|preview| preview.show(&rendering, false, printed));
        if args.long.save_every.is_some_and(|interval| saved.elapsed() >= interval) {
            // Errors such as a full disk don't end rendering.
            if let Err(error) = encode(UnencodedPicture::from(&rendering)).write() {
                let message = format!("the intermediate picture was not written: {error}");
                printed.warnings(&[Warning::general(message)]);
            }
            saved = Instant::now();
        }
    }
    preview.iter_mut().for_each(|preview| preview.show(&rendering, true, printed));
    progress.finish(rendering.is_complete());
    let checkpoint = checkpoint.finish(&mut rendering);
    Ok((rendering, checkpoint))
}

/// Error if a signal arrived before rendering. Existing pictures are not overwritten.
fn check_interrupted(cancel: &CancelHandle) -> Result<()> {
    if cancel.is_cancelled() { Err(nothing_written(None)) } else { Ok(()) }
}

/// The error after a signal; `existing` is a picture that was kept.
fn nothing_written(existing: Option<&Path>) -> Error {
    let message = match existing {
        Some(path) => format!(
            "stopped by a signal before each pixel had a sample; {} is kept as it was",
            path.display()
        ),
        None => "stopped by a signal before the first sample; no picture was written".to_string(),
    };
    Error { kind: ErrorKind::Interrupted, ..Error::usage(message) }
}

/// `oscura render --orbit N`: renders all frames of a turntable, counter-clockwise seen from above, starting at the camera's
/// position.
fn run_turntable(args: &RenderArgs, count: u32, cancel: &CancelHandle) -> Result<Outcome> {
    let stills = stills(&args.output);
    let files = |k: u32| stills.iter().map(|path| Frames::file(path, k)).collect::<Vec<_>>();
    (0..count).try_for_each(|k| Targets::check(&files(k)).map(drop))?;
    let animations = Some(AnimationFiles::of(args)?);
    let mut start = Instant::now();
    check_scene_path(&args.scene)?;
    check_memory_before_loading(args)?;
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
    let mut state = RunState { animations, ..RunState::new(args, Compiler::sequence())? };
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
        let motion =
            needs_motion_vectors(args).then(|| Keyframes { keys: Vec::new(), neighbours: Some(neighbours) });
        loaded.scene.cameras[number] = Camera { motion, ..table.camera(&first, angle(now)) };
        table.light(&mut loaded.scene, angle(now));
        let targets = Targets::check(&files(k))?;
        let outcome = run_one(args, cancel, targets, None, &mut loaded, start, &mut state);
        if !matches!(outcome, Ok(Outcome::Done)) {
            state.print_unfinished(args);
            return outcome;
        }
        start = Instant::now();
    }
    state.finish(args)?;
    Ok(Outcome::Done)
}

/// Turntable around the framed model, else around the centre of the scene.
fn turntable(loaded: &Loaded) -> Turntable {
    loaded.turntable.unwrap_or_else(|| Turntable::new(scene_center(loaded), false))
}
