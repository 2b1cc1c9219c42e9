//! Time against error: renders scenes at a ladder of sample counts, measures time and error against a converged
//! reference, and writes a CSV, a markdown table and an SVG plot.
//!
//! `oscura-bench FOLDER SCENE... [--width W] [--ladder 1,4,16,64] [--reference N] [--depth N] [--threads N]`
//!
//! The reference is made here, by two renders with other seeds whose difference tells its own noise.

mod measure;
mod tables;

use measure::{Point, Setup, measure};
use oscura::error::{Error, Result};
use std::path::PathBuf;
use std::process::ExitCode;

struct Arguments {
    folder: PathBuf,
    scenes: Vec<PathBuf>,
    setup: Setup,
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
    let mut points: Vec<Point> = Vec::new();
    for scene in &arguments.scenes {
        eprintln!("{}", scene.display());
        points.extend(measure(scene, &arguments.setup)?);
    }
    let texts = [
        ("time-to-error.csv", tables::csv(&points)),
        ("time-to-error.md", tables::markdown(&points)),
        ("time-to-error.svg", tables::svg(&points)),
    ];
    for (name, text) in texts {
        oscura::output::write_atomically(&arguments.folder.join(name), text.as_bytes())?;
    }
    Ok(())
}

fn parse(mut arguments: impl Iterator<Item = String>) -> Result<Arguments> {
    let mut setup =
        Setup { width: 256, ladder: vec![1, 4, 16, 64, 256], reference: 4096, depth: 100, threads: None };
    let mut paths: Vec<PathBuf> = Vec::new();
    while let Some(argument) = arguments.next() {
        if !argument.starts_with("--") {
            paths.push(argument.into());
            continue;
        }
        let value = arguments.next().ok_or_else(|| Error::usage(format!("{argument} needs a value")))?;
        match argument.as_str() {
            "--width" => setup.width = number(&argument, &value)?,
            "--reference" => setup.reference = number(&argument, &value)?,
            "--depth" => setup.depth = number(&argument, &value)?,
            "--threads" => setup.threads = Some(number(&argument, &value)? as usize),
            "--ladder" => {
                setup.ladder =
                    value.split(',').map(|v| number(&argument, v)).collect::<Result<Vec<u32>>>()?;
            }
            _ => return Err(Error::usage(format!("unknown option {argument}"))),
        }
    }
    if paths.len() < 2 {
        return Err(Error::usage("needs a folder for the results and at least one scene"));
    }
    let folder = paths.remove(0);
    oscura::output::check_target(&folder.join("time-to-error.csv"))?;
    Ok(Arguments { folder, scenes: paths, setup })
}

fn number(option: &str, text: &str) -> Result<u32> {
    let valid = text.trim().parse().ok().filter(|&n: &u32| n > 0);
    valid.ok_or_else(|| Error::usage(format!("{option}: '{text}' is not a whole number above 0")))
}
