//! The pictures that a run writes: where they go, what their headers say.

use super::args::RenderArgs;
use super::settings::Settled;
use oscura::compile::View;
use oscura::error::{Error, Result, Warning};
use oscura::film::Film;
use oscura::output::{
    Format, Metadata, OutputOptions, check_target, encode, is_same_target, write_atomically,
};
use oscura::render::Statistics;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Files to write, checked before any work.
pub(crate) struct Targets(Vec<(PathBuf, Format)>);

impl Targets {
    /// # Errors
    /// A usage error for unknown formats and for one file given twice; an output error for one that can't be written.
    pub fn check(paths: &[PathBuf]) -> Result<Targets> {
        let mut targets: Vec<(PathBuf, Format)> = Vec::new();
        for path in paths {
            let format = Format::of(path)?;
            if let Some((earlier, _)) = targets.iter().find(|(t, _)| is_same_target(t, path)) {
                let message = format!("-o {} is given twice", path.display());
                let same = format!("it is the same file as -o {}", earlier.display());
                return Err(Error::usage(message).with_help(same));
            }
            targets.push((path.clone(), format));
        }
        paths.iter().try_for_each(|path| check_target(path))?;
        Ok(Targets(targets))
    }

    /// Is any of them an EXR?
    pub fn has_exr(&self) -> bool {
        self.0.iter().any(|(_, format)| *format == Format::Exr)
    }

    /// Their names.
    pub fn names(&self) -> Vec<String> {
        self.0.iter().map(|(path, _)| path.display().to_string()).collect()
    }
}

/// Pictures as the bytes of their files, not written yet.
pub(crate) struct Pictures<'a> {
    files: Vec<(&'a Path, Vec<u8>)>,
    /// What came up since the scene was built.
    pub warnings: Vec<Warning>,
}

impl<'a> Pictures<'a> {
    /// Encodes all pictures, so that an encoder's refusal leaves no file at all.
    pub fn encode(
        args: &RenderArgs,
        targets: &'a Targets,
        film: &Film,
        settled: &Settled,
        view: &View,
        statistics: &Statistics,
        earlier: &[Warning],
    ) -> Result<Pictures<'a>> {
        let mut warnings = film_warnings(film, statistics);
        let shown = earlier.iter().chain(&warnings).map(Warning::to_string).collect();
        let options = OutputOptions {
            float: args.float,
            png: settled.png,
            metadata: metadata(args, settled, view, statistics, shown),
        };
        let mut files = Vec::new();
        for (path, format) in &targets.0 {
            let mut encoded = encode(film, *format, &options, path)?;
            for warning in encoded.warnings.drain(..) {
                warnings.push(Warning { file: Some(path.clone()), ..warning });
            }
            files.push((path.as_path(), encoded.bytes));
        }
        Ok(Pictures { files, warnings })
    }

    /// Writes them.
    pub fn write(&self) -> Result<()> {
        self.files.iter().try_for_each(|(path, bytes)| write_atomically(path, bytes))
    }
}

/// What is wrong with a film.
fn film_warnings(film: &Film, statistics: &Statistics) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let mut warn = |count: u64, message: String| {
        if count > 0 {
            warnings.push(Warning::general(message));
        }
    };
    let invalid = statistics.invalid_samples;
    warn(invalid, format!("{invalid} samples were NaN or infinite and were left out"));
    let unsampled = film.unsampled_pixels();
    let all = u64::from(film.width()) * u64::from(film.height());
    warn(unsampled, format!("{unsampled} of {all} pixels have no sample and are black and transparent"));
    warnings
}

fn metadata(
    args: &RenderArgs,
    settled: &Settled,
    view: &View,
    statistics: &Statistics,
    warnings: Vec<String>,
) -> Metadata {
    let timed = !args.reproducible;
    let stopped_by = match statistics {
        Statistics { interrupted: true, .. } => Some("signal"),
        Statistics { timed_out: true, .. } => Some("time limit"),
        _ => None,
    };
    Metadata {
        samples: statistics.samples_per_pixel,
        seed: settled.render.seed,
        owner: args.owner.clone(),
        render_s: timed.then_some(statistics.render_s),
        captured: timed.then(SystemTime::now),
        world_to_camera: Some(view.camera_from_world),
        stopped_by: stopped_by.map(str::to_string),
        warnings,
    }
}
