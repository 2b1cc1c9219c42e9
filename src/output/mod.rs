//! Writing pictures: EXR for compositing, PNG and the like for looking at. Everything is encoded in memory first, then written to a
//! temporary file beside the target and renamed, so that a half-written picture never has the target's name.

mod atomic;
mod exr;
mod exr_options;
pub mod part;
mod png;
mod video;

pub use crate::color::{ViewTable, ViewTransform};
use crate::error::{Error, Result};
use crate::film::Film;
pub use atomic::{
    Encoded, Format, check_folder, check_target, is_same_target, make_folder, move_folder, remove_file,
    remove_leftovers, write_atomically,
};
pub use exr::{DENOISED, Matte, Metadata, encode_exr, encode_layered};
pub use exr_options::{ExrCompression, ExrLayout, ExrOptions, ExrWindow, WorkingSpace, is_color};
pub use png::{
    Linear, PngOptions, encode_png, encode_png_rgb8, encode_rgb8, encode_shown, png_text, rgba8, shown8,
    with_png_text,
};
use std::path::Path;
pub use video::{Animation, AnimationFormat, Video, VideoFormat};

/// Reads the file of a view (cinespace, `.csp`; or `.view`, of the exporter for Blender).
///
/// # Errors
/// Where it can't be read, and where it holds no such table, with the line.
pub fn read_view(path: &Path) -> std::result::Result<ViewTransform, String> {
    let bytes = std::fs::read(path).map_err(|error| format!("can't be read: {error}"))?;
    ViewTransform::from_table(&bytes, path)
}

/// How to write pictures.
#[derive(Clone, Debug, Default)]
pub struct OutputOptions {
    /// 32-bit floats for the EXR's colour instead of 16-bit ones.
    pub float: bool,
    /// How EXRs lie on the disk.
    pub exr: ExrOptions,
    /// How PNGs and the like look.
    pub png: PngOptions,
    /// The metadata of the EXR's header.
    pub metadata: Metadata,
}

/// Encodes a film for a format.
///
/// # Errors
/// An output error, naming `path`, if the encoder refuses.
pub fn encode(
    film: &Film,
    format: Format,
    options: &OutputOptions,
    path: impl AsRef<Path>,
) -> Result<Encoded> {
    let encoded = match format {
        Format::Exr => encode_exr(film, options.float, &options.exr, &options.metadata),
        Format::Png => encode_png(film, &options.png),
        other => {
            let picture = Linear { width: film.width(), height: film.height(), rgba: &film.rgba() };
            encode_shown(&picture, other, &options.png).map(|bytes| Encoded { bytes, warnings: vec![] })
        }
    };
    encoded.map_err(|message| Error::output(path.as_ref(), message))
}
