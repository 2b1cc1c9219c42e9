//! Time against error: renders scenes at a ladder of sample counts, measures time and error against a converged
//! reference, and writes a CSV, a markdown table and an SVG plot.
//!
//! `oscura-bench FOLDER [SCENE...] [--quick] [--width W] [--ladder 1,2,4,8] [--reference N] [--depth N] [--threads N]
//! [--against CSV] [--noise | --techniques | --growth | --scaling]`
//!
//! Without scenes it measures fifteen: boxes, environments, a thousand lights, light through a slit, caustics, alpha-masked
//! leaves, ten thousand instances, thirty materials, a position far from the origin. `--quick` sets a width of 96, the ladder
//! 1,4,16 and a reference of 256 samples. `--against` compares with the `time-to-error.csv` of another build. Results are
//! written to FOLDER, which is created if missing.
//!
//! `--noise` measures the accuracy of the error estimate of `oscura render --noise` instead: scenes are rendered to the last
//! step of the ladder with `--seeds N` seeds (3), and the estimated and true errors of each pass are listed.
//!
//! `--techniques` measures the efficiency of each technique instead, with `--seeds N` seeds (3) at the middle step of the
//! ladder.
//!
//! `--growth` measures how time and memory scale with meshes, instances, materials, textures, lights and so on instead, one at a
//! time, in renders of `--program PATH` (target/release/oscura). The exit code is 1 where a cost grows with an exponent above
//! 1.1. `--only WORD` selects axes by name, `--seconds N` (60) ends an axis where the next size would take longer.
//!
//! `--scaling` times the tasks of rendering on one thread, at the last step of the ladder, and simulates their schedule on up to
//! 64: the idle time with a barrier after each pass and with overlapping passes.
//!
//! The reference is the mean of two renders with other seeds, whose difference gives its own noise.

mod calibrate;
mod growth;
mod measure;
mod scaling;
mod scenes;
mod tables;
mod techniques;
mod trends;

use calibrate::calibrate;
use measure::{Point, Setup, measure};
use oscura::error::{Error, Result};
use oscura::output::write_atomically;
use oscura::render::in_pool;
use std::path::PathBuf;
use std::process::ExitCode;

struct Arguments {
    folder: PathBuf,
    scenes: Vec<PathBuf>,
    setup: Setup,
    what: What,
    /// Seeds of the calibration and of techniques.
    seeds: u32,
    /// Limits of `--growth`.
    growth: growth::Limits,
    /// Results of another build, to compare with.
    against: Option<PathBuf>,
}

/// What is measured.
#[derive(Clone, Copy, PartialEq)]
enum What {
    Ladder,
    Noise,
    Techniques,
    Growth,
    Scaling,
}

fn main() -> ExitCode {
    match parse(std::env::args().skip(1)).and_then(|arguments| run(&arguments)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let (setup, seeds) = (&arguments.setup, arguments.seeds);
    if arguments.what == What::Growth {
        return grow(arguments);
    }
    let generated;
    let scenes = if arguments.scenes.is_empty() {
        generated = scenes::Generated::new()?;
        generated.scenes()
    } else {
        arguments.scenes.clone()
    };
    match arguments.what {
        What::Noise => {
            let texts = |runs: &[calibrate::Run]| {
                let (csv, table) = (calibrate::csv(runs), calibrate::markdown(runs));
                write(arguments, &[("noise.csv", csv), ("noise.md", table.clone())]).map(|()| table)
            };
            of_all(&scenes, setup, |scene| calibrate(scene, setup, seeds), texts)
        }
        What::Techniques => {
            let texts = |all: &[techniques::Comparison]| {
                let (csv, table) = (techniques::csv(all), techniques::markdown(all));
                write(arguments, &[("techniques.csv", csv), ("techniques.md", table.clone())]).map(|()| table)
            };
            of_all(&scenes, setup, |scene| techniques::compare(scene, setup, seeds), texts)
        }
        What::Scaling => {
            let one = Setup { threads: Some(1), ladder: setup.ladder.clone(), ..*setup };
            let texts = |all: &[scaling::Timed]| {
                let (csv, table) = (scaling::csv(all), scaling::markdown(all));
                write(arguments, &[("scaling.csv", csv), ("scaling.md", table.clone())]).map(|()| table)
            };
            of_all(&scenes, &one, |scene| scaling::time(scene, &one), texts)
        }
        What::Ladder | What::Growth => climb(arguments, &scenes),
    }
}

/// Scaling of cost.
fn grow(arguments: &Arguments) -> Result<()> {
    let growth::Growth { rows, failures } = growth::measure(&arguments.growth)?;
    let table = growth::markdown(&rows);
    write(arguments, &[("growth.csv", growth::csv(&rows)), ("growth.md", table.clone())])?;
    print!("{table}");
    let steep = rows.iter().filter(|row| row.is_too_steep());
    let mut problems: Vec<String> =
        steep.map(|row| format!("{} grows faster than in proportion", row.name())).collect();
    problems.extend(failures);
    match problems.is_empty() {
        true => Ok(()),
        false => Err(Error::usage(problems.join("\n"))),
    }
}

/// Time against error.
fn climb(arguments: &Arguments, scenes: &[PathBuf]) -> Result<()> {
    let (setup, against) = (&arguments.setup, &arguments.against);
    let earlier = against.as_ref().map(trends::read).transpose()?;
    let texts = |points: &[Point]| {
        let table = format!("{}\n{}", tables::markdown(points), trends::markdown(points, earlier.as_ref()));
        let texts = [
            ("time-to-error.csv", tables::csv(points)),
            ("time-to-error.md", table.clone()),
            ("time-to-error.svg", tables::svg(points)),
        ];
        write(arguments, &texts).map(|()| table)
    };
    of_all(scenes, setup, |scene| measure(scene, setup), texts)
}

/// Measures all scenes in order. After each, `write` writes all results so far, and returns a table, the last of which is
/// printed.
fn of_all<T: Send>(
    scenes: &[PathBuf],
    setup: &Setup,
    measure: impl Fn(&PathBuf) -> Result<Vec<T>> + Sync,
    write: impl Fn(&[T]) -> Result<String>,
) -> Result<()> {
    let (mut all, mut table) = (Vec::new(), String::new());
    for scene in scenes {
        eprintln!("{}", scene.display());
        all.extend(in_pool(setup.threads, || measure(scene))??);
        table = write(&all)?;
    }
    print!("{table}");
    Ok(())
}

fn write(arguments: &Arguments, texts: &[(&str, String)]) -> Result<()> {
    texts.iter().try_for_each(|(name, text)| write_atomically(arguments.folder.join(name), text.as_bytes()))
}

fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Arguments> {
    let setup = Setup {
        width: 256,
        ladder: vec![1, 2, 4, 8, 16, 32, 64, 128, 256],
        reference: 1024,
        depth: 100,
        threads: None,
    };
    let mut all = Arguments {
        folder: PathBuf::new(),
        scenes: Vec::new(),
        setup,
        what: What::Ladder,
        seeds: 3,
        growth: growth::Limits::default(),
        against: None,
    };
    while let Some(argument) = arguments.next() {
        let setup = &mut all.setup;
        match argument.as_str() {
            "--noise" => all.what = What::Noise,
            "--techniques" => all.what = What::Techniques,
            "--growth" => all.what = What::Growth,
            "--scaling" => all.what = What::Scaling,
            "--quick" => (setup.width, setup.ladder, setup.reference) = (96, vec![1, 4, 16], 256),
            option if option.starts_with("--") => {
                let value =
                    arguments.next().ok_or_else(|| Error::usage(format!("{argument} needs a value")))?;
                set(&mut all, option, &value)?;
            }
            path => all.scenes.push(path.into()),
        }
    }
    if all.scenes.is_empty() {
        return Err(Error::usage("needs a folder for the results"));
    }
    all.folder = all.scenes.remove(0);
    let failed = |e| Error::output(&all.folder, format!("can't be created: {e}"));
    std::fs::create_dir_all(&all.folder).map_err(failed)?;
    oscura::output::check_target(all.folder.join("time-to-error.csv"))?;
    Ok(all)
}

/// Parses an option with a value.
fn set(all: &mut Arguments, option: &str, value: &str) -> Result<()> {
    let setup = &mut all.setup;
    match option {
        "--width" => setup.width = number(option, value)?,
        "--reference" => setup.reference = number(option, value)?,
        "--depth" => setup.depth = number(option, value)?,
        "--threads" => setup.threads = Some(number(option, value)? as usize),
        "--ladder" => setup.ladder = value.split(',').map(|v| number(option, v)).collect::<Result<_>>()?,
        "--seeds" => all.seeds = number(option, value)?,
        "--program" => all.growth.program = value.into(),
        "--only" => all.growth.only = value.into(),
        "--seconds" => all.growth.seconds = number(option, value)?.into(),
        "--against" => all.against = Some(value.into()),
        _ => return Err(Error::usage(format!("unknown option {option}"))),
    }
    Ok(())
}

fn number(option: &str, text: &str) -> Result<u32> {
    let valid = text.trim().parse().ok().filter(|&n: &u32| n > 0);
    valid.ok_or_else(|| Error::usage(format!("{option}: '{text}' is not a whole number above 0")))
}
