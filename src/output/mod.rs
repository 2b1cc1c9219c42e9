//! Writing pictures: EXR, and display-referred formats such as PNG. Pictures are encoded in memory, written to a temporary file in the
//! target's folder and renamed, so that targets are replaced atomically.

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
    EncodedPicture, Format, check_folder, check_target, is_same_target, make_folder, move_folder,
    remove_file, remove_leftovers, write_atomically,
};
pub use exr::{DENOISED, Matte, Metadata, encode_exr, encode_layered};
pub use exr_options::{ExrCompression, ExrLayout, ExrOptions, ExrWindow, WorkingSpace, is_color};
pub use png::{
    Linear, PngOptions, display_rgba8, encode_display_png, encode_png, encode_rgb8, png_text, rgba8,
    with_png_text,
};
use std::path::Path;
pub use video::{Animation, AnimationFormat, Video, VideoFormat};

/// Reads a view transform from a LUT file (cinespace, `.csp`; or `.view`, from the Blender exporter).
///
/// # Errors
/// If it can't be read or parsed, with the line.
pub fn read_view(path: &Path) -> std::result::Result<ViewTransform, String> {
    let bytes = std::fs::read(path).map_err(|error| format!("can't be read: {error}"))?;
    ViewTransform::from_table(&bytes, path)
}

/// Options of picture files.
#[derive(Clone, Debug, Default)]
pub struct OutputOptions {
    /// 32-bit instead of 16-bit floats for colour in EXRs.
    pub float: bool,
    /// Options of EXRs.
    pub exr: ExrOptions,
    /// Options of display-referred formats.
    pub png: PngOptions,
    /// Metadata of the EXR header.
    pub metadata: Metadata,
}

/// Encodes a film in a format.
///
/// # Errors
/// An output error with `path` and the message of the encoder.
pub fn encode(
    film: &Film,
    format: Format,
    options: &OutputOptions,
    path: impl AsRef<Path>,
) -> Result<EncodedPicture> {
    let encoded = match format {
        Format::Exr => encode_exr(film, options.float, &options.exr, &options.metadata),
        Format::Png => encode_png(film, &options.png),
        other => {
            let picture = Linear { width: film.width(), height: film.height(), rgba: &film.rgba() };
            encode_display_png(&picture, other, &options.png)
                .map(|bytes| EncodedPicture { bytes, warnings: vec![] })
        }
    };
    encoded.map_err(|message| Error::output(path.as_ref(), message))
}
