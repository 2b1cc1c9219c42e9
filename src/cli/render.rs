//! `oscura render`: load, compile, render, write, report.

use super::Outcome;
use super::args::RenderArgs;
use super::frames::Frames;
use super::process::{peak_memory, stop_flag};
use super::progress::Progress;
use super::report::{self, Run};
use super::settings::{Settled, apply_environment, settle};
use oscura::compile::{CompileOptions, CompileReport, compile};
use oscura::error::{Error, ErrorKind, Problem, Result, Warning};
use oscura::film::Film;
use oscura::load::{LoadOptions, load};
use oscura::output::{Format, Metadata, OutputOptions, check_target, encode, write_atomically};
use oscura::render::{Statistics, render};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Instant, SystemTime};

pub(crate) fn run(args: &RenderArgs) -> Result<Outcome> {
    let stop = stop_flag()?;
    let Some(frames) = args.frames else { return run_one(args, stop) };
    for number in frames.numbers() {
        let mut frame = args.clone();
        frame.output = args.output.iter().map(|path| Frames::file(path, number)).collect();
        frame.asset.time = Some(f64::from(number) / args.fps);
        match run_one(&frame, stop)? {
            Outcome::Done => {}
            other => return Ok(other),
        }
    }
    Ok(Outcome::Done)
}

/// Renders one picture.
fn run_one(args: &RenderArgs, stop: &AtomicBool) -> Result<Outcome> {
    let formats = args.output.iter().map(|p| Format::of(p)).collect::<Result<Vec<Format>>>()?;
    for (i, path) in args.output.iter().enumerate() {
        if args.output[..i].contains(path) {
            return Err(Error::usage(format!("-o {} is given twice", path.display())));
        }
        check_target(path)?;
    }

    let start = Instant::now();
    let options = LoadOptions {
        allow_external: args.allow_external,
        brings_environment: args.env.is_some(),
        gltf: args.asset.options(),
        point_radius: args.point_radius,
        no_sidecar: args.no_sidecar,
        ..LoadOptions::default()
    };
    let mut loaded = load(&args.scene, &options)?;
    let mut warnings = std::mem::take(&mut loaded.warnings);
    warnings.extend(apply_environment(args, &mut loaded.scene)?);
    let load_s = start.elapsed().as_secs_f64();

    let settled = settle(args, &loaded.scene)?;
    let (compiled, mut build) = compile(&loaded.scene, &compile_options(&settled))?;
    drop(loaded.scene);
    warnings.append(&mut build.warnings);
    let mut left_out = std::mem::take(&mut loaded.left_out);
    left_out.append(&mut build.left_out);
    if !args.quiet {
        report::warnings(&warnings);
        if args.explain {
            left_out.iter().for_each(|what| eprintln!("left out: {what}"));
        }
    }
    refuse_warnings(args, &warnings, ErrorKind::Input)?;
    stop_before_pixels(stop)?;

    let progress = Progress::new(args.quiet);
    let (film, statistics) = render(&compiled, &settled.render, stop, &|event| progress.show(&event));
    progress.finish();

    let start = Instant::now();
    let late = write(args, &formats, &film, &settled, &build, &statistics, &warnings)?;
    let write_s = start.elapsed().as_secs_f64();
    if !args.quiet {
        report::warnings(&late);
    }
    warnings.extend(late);

    let run = Run {
        load_s,
        write_s,
        width: settled.render.width,
        height: settled.render.height,
        seed: settled.render.seed,
        compiled: build,
        statistics,
        peak_memory: peak_memory(),
        outputs: args.output.iter().map(|p| p.display().to_string()).collect(),
        warnings,
        left_out,
    };
    if !args.quiet {
        run.print();
    }
    if args.json {
        report::print_line(&run.to_json().to_string());
    }
    Ok(if run.statistics.interrupted { Outcome::Interrupted } else { Outcome::Done })
}

fn compile_options(settled: &Settled) -> CompileOptions {
    CompileOptions {
        microfacet: settled.microfacet,
        camera: settled.camera,
        width: settled.render.width,
        height: settled.render.height,
        needs: settled.render.aovs,
    }
}

/// Encodes all pictures, then writes them: an encoder's refusal leaves no file at all. Returns the warnings that came
/// up after the scene was built.
fn write(
    args: &RenderArgs,
    formats: &[Format],
    film: &Film,
    settled: &Settled,
    build: &CompileReport,
    statistics: &Statistics,
    earlier: &[Warning],
) -> Result<Vec<Warning>> {
    let mut late = Vec::new();
    if statistics.invalid_samples > 0 {
        let n = statistics.invalid_samples;
        late.push(Warning::general(format!("{n} samples were NaN or infinite and were left out")));
    }
    let timed = !args.reproducible;
    let options = OutputOptions {
        float: args.float,
        png: settled.png,
        metadata: Metadata {
            samples: statistics.samples_per_pixel.floor() as u32,
            seed: settled.render.seed,
            owner: args.owner.clone(),
            render_s: timed.then_some(statistics.render_s),
            captured: timed.then(SystemTime::now),
            world_to_camera: Some(build.world_to_camera),
            warnings: earlier.iter().chain(&late).map(Warning::to_string).collect(),
        },
    };
    let mut files: Vec<(&Path, Vec<u8>)> = Vec::new();
    for (path, &format) in args.output.iter().zip(formats) {
        let mut encoded = encode(film, format, &options, path)?;
        for warning in encoded.warnings.drain(..) {
            late.push(Warning { file: Some(path.clone()), ..warning });
        }
        files.push((path, encoded.bytes));
    }
    refuse_warnings(args, &late, ErrorKind::Output)?;
    for (path, bytes) in files {
        write_atomically(path, &bytes)?;
    }
    Ok(late)
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
fn stop_before_pixels(stop: &AtomicBool) -> Result<()> {
    if stop.load(Ordering::SeqCst) {
        let message = "stopped by a signal before the first sample; nothing was written";
        return Err(Error { kind: ErrorKind::Interrupted, ..Error::usage(message) });
    }
    Ok(())
}
