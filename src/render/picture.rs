//! What comes out of rendering.

use super::statistics::Statistics;
use crate::error::{Result, Warning};
use crate::film::Film;
use crate::image::Image;
use crate::math::DVec3;
use crate::output::{Format, OutputOptions, encode, write_atomically};
use crate::scene::Backdrop;
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

    /// How [`Picture::save`] writes: 16-bit colour in EXRs, the scene's exposure in PNGs, and in the header how the
    /// picture was made.
    pub fn output_options(&self) -> &OutputOptions {
        &self.output
    }

    /// The pixels: [`Film::rgba`] has their colours, [`Film::plane`] one component of an AOV by its name in files.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// Lays a scene's backdrop behind the pixels that are transparent.
    pub fn put_behind(&mut self, backdrop: &Backdrop) {
        put_behind(&mut self.film, backdrop);
    }

    /// Says in headers how far from the world's origin the scene's coordinates have theirs; zero is not said.
    pub fn set_world_offset(&mut self, offset: DVec3) {
        self.output.metadata.world_offset = Some(offset).filter(|o| *o != DVec3::ZERO);
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

/// Lays a scene's backdrop behind the pixels of a film that are transparent.
pub fn put_behind(film: &mut Film, backdrop: &Backdrop) {
    let (width, height) = (film.width(), film.height());
    match backdrop {
        Backdrop::Color(color) => film.put_behind(|_, _| *color),
        Backdrop::Picture(image) => {
            let scale =
                (f64::from(image.width) / f64::from(width)).min(f64::from(image.height) / f64::from(height));
            film.put_behind(|x, y| {
                let place = |p: u32, own: u32, of: u32| {
                    let from_middle = f64::from(p) + 0.5 - f64::from(own) / 2.0;
                    f64::from(of) / 2.0 + scale * from_middle
                };
                bilinear(image, place(x, width, image.width), place(y, height, image.height))
            });
        }
    }
}

/// The colour of an image at a place in pixels from its corner, blended from the four around it.
fn bilinear(image: &Image, x: f64, y: f64) -> [f32; 3] {
    let low = |v: f64, size: u32| (v - 0.5).clamp(0.0, f64::from(size - 1));
    let (x, y) = (low(x, image.width), low(y, image.height));
    let (x0, y0) = (x as u32, y as u32);
    let (x1, y1) = ((x0 + 1).min(image.width - 1), (y0 + 1).min(image.height - 1));
    let (u, v) = (x.fract() as f32, y.fract() as f32);
    let [a, b, c, d] = [(x0, y0), (x1, y0), (x0, y1), (x1, y1)].map(|(x, y)| image.rgba(x, y));
    std::array::from_fn(|k| (a[k] * (1.0 - u) + b[k] * u) * (1.0 - v) + (c[k] * (1.0 - u) + d[k] * u) * v)
}

/// Writes a film.
pub(super) fn save(film: &Film, path: &Path, options: &OutputOptions) -> Result<Vec<Warning>> {
    let encoded = encode(film, Format::of(path)?, options, path)?;
    write_atomically(path, &encoded.bytes)?;
    let named = |warning| Warning { file: Some(path.to_path_buf()), ..warning };
    Ok(encoded.warnings.into_iter().map(named).collect())
}
