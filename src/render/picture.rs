//! What comes out of rendering.

use super::statistics::Statistics;
use crate::error::{Result, Warning};
use crate::film::Film;
use crate::output::{Format, OutputOptions, encode, write_atomically};
use std::path::Path;

/// A rendered picture with its warnings and statistics.
#[derive(Clone, Debug)]
pub struct Picture {
    pub(super) film: Film,
    pub(super) statistics: Statistics,
    pub(super) warnings: Vec<Warning>,
    pub(super) output: OutputOptions,
}

impl Picture {
    /// Writes an EXR or a PNG, by the extension: see [`Picture::output_options`] for what is written, and
    /// [`Picture::save_with`] for other choices. Returns warnings about values that the file can't hold, such as those
    /// beyond 16-bit floats.
    ///
    /// # Errors
    /// A usage error for other extensions; an output error if the file can't be written, in which case an existing file
    /// of that name stays as it was.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<Vec<Warning>> {
        self.save_with(path, &self.output)
    }

    /// Writes it with these options, in the format of the extension.
    ///
    /// Begin with a clone of [`Picture::output_options`]: it holds what the header says about the picture.
    ///
    /// # Errors
    /// As for [`Picture::save`].
    pub fn save_with(&self, path: impl AsRef<Path>, options: &OutputOptions) -> Result<Vec<Warning>> {
        save(&self.film, path.as_ref(), options)
    }

    /// How [`Picture::save`] writes: 16-bit colour in EXRs, the scene's exposure, view and white balance in PNGs, and in the header how the
    /// picture was made.
    pub fn output_options(&self) -> &OutputOptions {
        &self.output
    }

    /// The pixels: [`Film::rgba`] has their colours, [`Film::plane`] one component of an AOV by its name in files.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// The film, without the rest.
    pub fn into_film(self) -> Film {
        self.film
    }

    /// Time, samples and rays that rendering took.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// What was ignored, approximated or repaired on the way from the file to the picture.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }
}

/// Writes a film.
pub(super) fn save(film: &Film, path: &Path, options: &OutputOptions) -> Result<Vec<Warning>> {
    let encoded = encode(film, Format::of(path)?, options, path)?;
    write_atomically(path, &encoded.bytes)?;
    let named = |warning| Warning { file: Some(path.to_path_buf()), ..warning };
    Ok(encoded.warnings.into_iter().map(named).collect())
}
