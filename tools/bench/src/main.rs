//! Time against error: renders scenes at a ladder of sample counts, measures time and error against a converged
//! reference, and writes a CSV, a markdown table and an SVG plot.
//!
//! `oscura-bench FOLDER [SCENE...] [--quick] [--width W] [--ladder 1,4,16,64] [--reference N] [--depth N] [--threads N] [--noise]`
//!
//! Without scenes it measures the Cornell box, glass and metal, an environment picture, and a model of 160,000 triangles.
//! `--quick` sets a width of 96, the ladder 1,4,16 and a reference of 256 samples: a try in seconds. Results go into
//! FOLDER, which must exist.
//!
//! `--noise` measures instead how well the estimate of `oscura render --noise` holds: scenes are rendered to the last step of the
//! ladder with `--seeds N` seeds (3), and after each pass the estimated error stands beside the true one.
//!
//! The reference is made here, by two renders with other seeds whose difference tells its own noise.

mod calibrate;
mod measure;
mod scenes;
mod tables;

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
    /// Seeds of the calibration, where that is what is measured.
    seeds: Option<u32>,
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
    let generated;
    let scenes = if arguments.scenes.is_empty() {
        generated = scenes::Generated::new()?;
        generated.scenes()
    } else {
        arguments.scenes.clone()
    };
    let setup = &arguments.setup;
    if let Some(seeds) = arguments.seeds {
        let texts = |runs: &[calibrate::Run]| {
            let (csv, table) = (calibrate::csv(runs), calibrate::markdown(runs));
            write(arguments, &[("noise.csv", csv), ("noise.md", table.clone())]).map(|()| table)
        };
        return of_all(&scenes, setup, |scene| calibrate(scene, setup, seeds), texts);
    }
    let texts = |points: &[Point]| {
        let table = tables::markdown(points);
        let texts = [
            ("time-to-error.csv", tables::csv(points)),
            ("time-to-error.md", table.clone()),
            ("time-to-error.svg", tables::svg(points)),
        ];
        write(arguments, &texts).map(|()| table)
    };
    of_all(&scenes, setup, |scene| measure(scene, setup), texts)
}

/// Measures all scenes, one after another. After each, `write` writes down all that there is until then, and gives a table,
/// the last of which is printed.
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
    let mut setup =
        Setup { width: 256, ladder: vec![1, 4, 16, 64, 256], reference: 4096, depth: 100, threads: None };
    let (mut paths, mut seeds): (Vec<PathBuf>, Option<u32>) = (Vec::new(), None);
    while let Some(argument) = arguments.next() {
        if !argument.starts_with("--") {
            paths.push(argument.into());
            continue;
        }
        if argument == "--noise" {
            seeds = seeds.or(Some(3));
            continue;
        }
        if argument == "--quick" {
            setup = Setup { width: 96, ladder: vec![1, 4, 16], reference: 256, ..setup };
            continue;
        }
        let value = arguments.next().ok_or_else(|| Error::usage(format!("{argument} needs a value")))?;
        match argument.as_str() {
            "--width" => setup.width = number(&argument, &value)?,
            "--reference" => setup.reference = number(&argument, &value)?,
            "--depth" => setup.depth = number(&argument, &value)?,
            "--seeds" => seeds = Some(number(&argument, &value)?),
            "--threads" => setup.threads = Some(number(&argument, &value)? as usize),
            "--ladder" => {
                setup.ladder =
                    value.split(',').map(|v| number(&argument, v)).collect::<Result<Vec<u32>>>()?;
            }
            _ => return Err(Error::usage(format!("unknown option {argument}"))),
        }
    }
    if paths.is_empty() {
        return Err(Error::usage("needs a folder for the results"));
    }
    let folder = paths.remove(0);
    std::fs::create_dir_all(&folder).map_err(|e| Error::output(&folder, format!("can't be created: {e}")))?;
    oscura::output::check_target(folder.join("time-to-error.csv"))?;
    Ok(Arguments { folder, scenes: paths, setup, seeds })
}

fn number(option: &str, text: &str) -> Result<u32> {
    let valid = text.trim().parse().ok().filter(|&n: &u32| n > 0);
    valid.ok_or_else(|| Error::usage(format!("{option}: '{text}' is not a whole number above 0")))
}
