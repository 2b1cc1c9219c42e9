//! The pictures that a run writes: where they go, what their headers say.

use super::args::RenderArgs;
use super::moving::is_moving;
use super::terms;
use oscura::error::{Error, Result, Warning};
use oscura::film::Film;
use oscura::output::{
    ExrOptions, ExrWindow, Format, Metadata, OutputOptions, PngOptions, check_target, encode, is_same_target,
    write_atomically,
};
use oscura::render::{Picture, Rendering};
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// The extension of files of sums.
const PART: &str = "part";

/// Files to write, checked before any work.
pub(crate) struct Targets {
    pictures: Vec<(PathBuf, Format)>,
    parts: Vec<PathBuf>,
}

impl Targets {
    /// # Errors
    /// A usage error for unknown formats and for one file given twice; an output error for one that can't be written.
    pub fn check(paths: &[PathBuf]) -> Result<Targets> {
        let mut targets = Targets { pictures: Vec::new(), parts: Vec::new() };
        for (at, path) in paths.iter().enumerate() {
            if let Some(earlier) = paths[..at].iter().find(|earlier| is_same_target(earlier, path)) {
                let message = format!("-o {} is given twice", path.display());
                let same = format!("it is the same file as -o {}", earlier.display());
                return Err(Error::usage(message).with_help(same));
            }
            if is_moving(path) {
                let message = format!("{}: there is one picture only, and no moving one", path.display());
                return Err(Error::usage(message).with_help("--orbit N or --frames A-B make more"));
            }
            match path.extension().is_some_and(|e| e.eq_ignore_ascii_case(PART)) {
                true => targets.parts.push(path.clone()),
                false => targets.pictures.push((path.clone(), Format::of(path)?)),
            }
        }
        paths.iter().try_for_each(check_target)?;
        Ok(targets)
    }

    /// Can they hold a picture of this size?
    ///
    /// # Errors
    /// A usage error for the first that can't.
    pub fn check_size(&self, width: u32, height: u32) -> Result<()> {
        self.pictures.iter().try_for_each(|(path, format)| match format.largest_edge() {
            Some(largest) if width.max(height) > largest => {
                let message = format!("{}: {width} x {height} is too large", path.display());
                let help =
                    format!("files of this kind have at most {largest} pixels a side; write .exr or .png");
                Err(Error::usage(message).with_help(help))
            }
            _ => Ok(()),
        })
    }

    /// Is any of them an EXR, or may it become one?
    pub fn has_exr(&self) -> bool {
        !self.parts.is_empty() || self.pictures.iter().any(|(_, format)| *format == Format::Exr)
    }

    /// Is any of them encoded for displays?
    pub fn has_shown(&self) -> bool {
        self.pictures.iter().any(|(_, format)| !matches!(format, Format::Exr | Format::Hdr))
    }

    /// Are there others than those that hold sums?
    pub fn has_pictures(&self) -> bool {
        !self.pictures.is_empty()
    }

    /// Those that hold sums.
    pub fn parts(&self) -> &[PathBuf] {
        &self.parts
    }

    /// Names of those that are written: parts only `with_parts`.
    pub fn names(&self, with_parts: bool) -> Vec<String> {
        let pictures = self.pictures.iter().map(|(path, _)| path);
        let parts = self.parts.iter().filter(|_| with_parts);
        pictures.chain(parts).map(|path| path.display().to_string()).collect()
    }
}

/// How files are written, whatever picture they show.
pub(crate) struct How {
    /// Whose picture it is.
    pub owner: Option<String>,
    /// Leave times and dates out.
    pub reproducible: bool,
    /// Write 32-bit colours.
    pub float: bool,
    /// How EXRs lie on the disk.
    pub exr: ExrOptions,
}

impl How {
    /// As the arguments say, of pixels that stand so in the frame.
    pub fn of(args: &RenderArgs, window: Option<ExrWindow>) -> How {
        let exr = args.exr.format.options(window);
        How { owner: args.owner.clone(), reproducible: args.reproducible, float: args.float, exr }
    }
}

/// A picture before it is encoded: when all is rendered, or on the way.
pub(crate) struct Shot<'a> {
    pub film: Cow<'a, Film>,
    pub warnings: Vec<Warning>,
    pub metadata: Metadata,
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
    /// Each with its bytes, or with why its encoder refused.
    files: Vec<(&'a Path, Result<Vec<u8>>)>,
    /// What came up since the scene was built.
    pub warnings: Vec<Warning>,
}

impl<'a> Pictures<'a> {
    /// Encodes all pictures. One that an encoder refuses keeps no other from being written.
    pub fn encode(
        how: &How,
        targets: &'a Targets,
        shot: Shot,
        png: &PngOptions,
        earlier: &[Warning],
    ) -> Pictures<'a> {
        let Shot { film, mut warnings, mut metadata } = shot;
        metadata.owner.clone_from(&how.owner);
        metadata.warnings = earlier.iter().chain(&warnings).map(Warning::to_string).collect();
        if let Some(window) = how.exr.window {
            let frame_from_ndc = window.frame_from_ndc(film.width(), film.height());
            metadata.world_to_ndc = metadata.world_to_ndc.map(|ndc| frame_from_ndc * ndc);
        }
        if how.reproducible {
            (metadata.render_s, metadata.captured) = (None, None);
        }
        let options = OutputOptions { float: how.float, exr: how.exr.clone(), png: png.clone(), metadata };
        let mut files = Vec::new();
        for (path, format) in &targets.pictures {
            let bytes = encode(&film, *format, &options, path).map(|encoded| {
                for warning in encoded.warnings {
                    warnings.push(Warning { file: Some(path.clone()), ..warning });
                }
                encoded.bytes
            });
            files.push((path.as_path(), bytes));
        }
        terms::in_warnings(&mut warnings);
        Pictures { files, warnings }
    }

    /// Writes all that can be written.
    ///
    /// # Errors
    /// An output error that says of all others why they were not.
    pub fn write(self) -> Result<()> {
        let written = self.files.into_iter().map(|(path, bytes)| write_atomically(path, &bytes?));
        let mut failed = written.filter_map(Result::err);
        let Some(mut first) = failed.next() else { return Ok(()) };
        failed.for_each(|error| first.append(error));
        Err(first)
    }
}
