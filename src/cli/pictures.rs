//! The pictures that a run writes: where they go, what their headers say.

use super::args::RenderArgs;
use super::terms;
use oscura::error::{Error, Result, Warning};
use oscura::output::{
    Format, OutputOptions, PngOptions, check_target, encode, is_same_target, write_atomically,
};
use oscura::render::Picture;
use std::path::{Path, PathBuf};

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
        paths.iter().try_for_each(check_target)?;
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
        picture: &Picture,
        png: PngOptions,
        earlier: &[Warning],
    ) -> Result<Pictures<'a>> {
        let mut warnings = picture.warnings().to_vec();
        let shown = earlier.iter().chain(&warnings).map(Warning::to_string).collect();
        let mut metadata = picture.output_options().metadata.clone();
        metadata.owner.clone_from(&args.owner);
        metadata.warnings = shown;
        if picture.statistics().interrupted {
            metadata.stopped_by = Some("signal".to_string());
        }
        if args.reproducible {
            (metadata.render_s, metadata.captured) = (None, None);
        }
        let options = OutputOptions { float: args.float, png, metadata };
        let mut files = Vec::new();
        for (path, format) in &targets.0 {
            let mut encoded = encode(picture.film(), *format, &options, path)?;
            for warning in encoded.warnings.drain(..) {
                warnings.push(Warning { file: Some(path.clone()), ..warning });
            }
            files.push((path.as_path(), encoded.bytes));
        }
        terms::in_warnings(&mut warnings);
        Ok(Pictures { files, warnings })
    }

    /// Writes them.
    pub fn write(&self) -> Result<()> {
        self.files.iter().try_for_each(|(path, bytes)| write_atomically(path, bytes))
    }
}
