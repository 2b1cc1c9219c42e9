//! The pictures that a run writes: where they go, what their headers say.

use super::args::RenderArgs;
use super::terms;
use oscura::error::{Error, Result, Warning};
use oscura::film::Film;
use oscura::output::{
    Format, Metadata, OutputOptions, PngOptions, check_target, encode, is_same_target, write_atomically,
};
use oscura::render::{Picture, Rendering};
use std::borrow::Cow;
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

/// A picture before it is encoded: when all is rendered, or on the way.
pub(crate) struct Shot<'a> {
    film: Cow<'a, Film>,
    warnings: Vec<Warning>,
    metadata: Metadata,
}

impl<'a> From<&'a Picture> for Shot<'a> {
    fn from(picture: &'a Picture) -> Shot<'a> {
        let mut metadata = picture.output_options().metadata.clone();
        if picture.statistics().interrupted {
            metadata.stopped_by = Some("signal".to_string());
        }
        Shot { film: Cow::Borrowed(picture.film()), warnings: picture.warnings().to_vec(), metadata }
    }
}

impl<'a> From<&'a Rendering> for Shot<'a> {
    /// The picture so far.
    fn from(rendering: &'a Rendering) -> Shot<'a> {
        let metadata = rendering.output_options().metadata;
        let stopped_by = Some("not finished".to_string());
        Shot {
            film: rendering.shown(),
            warnings: rendering.warnings(),
            metadata: Metadata { stopped_by, ..metadata },
        }
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
        shot: Shot,
        png: PngOptions,
        earlier: &[Warning],
    ) -> Result<Pictures<'a>> {
        let Shot { film, mut warnings, mut metadata } = shot;
        metadata.owner.clone_from(&args.owner);
        metadata.warnings = earlier.iter().chain(&warnings).map(Warning::to_string).collect();
        if args.reproducible {
            (metadata.render_s, metadata.captured) = (None, None);
        }
        let options = OutputOptions { float: args.float, png, metadata };
        let mut files = Vec::new();
        for (path, format) in &targets.0 {
            let mut encoded = encode(&film, *format, &options, path)?;
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
