//! Writing pictures: EXR for compositing, PNG for looking at. Everything is encoded in memory first, then written to a
//! temporary file beside the target and renamed, so that a half-written picture never has the target's name.

mod animation;
mod atomic;
mod encoded;
mod exr;
mod exr_header;
mod matte;
pub mod place_folder;
mod png;
mod tone;

pub use animation::{Animation, AnimationFormat};
pub use atomic::{check_target, is_same_target, write_atomically};
pub use encoded::Encoded;
pub use exr::{Metadata, encode_exr, encode_layered};
pub use matte::Matte;
pub use png::{PngOptions, encode_png, encode_png_rgb8};
pub use tone::ViewTransform;

use crate::error::{Error, Result};
use crate::film::Film;
use std::path::Path;

/// The kinds of files that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// OpenEXR: linear, scene-referred.
    Exr,
    /// PNG: 8 bits, display-referred.
    Png,
}

impl Format {
    /// The format that a file name asks for by its extension.
    ///
    /// # Errors
    /// A usage error if the extension is unknown or missing.
    pub fn of(path: impl AsRef<Path>) -> Result<Format> {
        let path = path.as_ref();
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        match extension.as_str() {
            "exr" => Ok(Format::Exr),
            "png" => Ok(Format::Png),
            _ => Err(Error::usage(format!(
                "{}: can't tell the format of the picture from its name",
                path.display()
            ))
            .with_help("end the name in .exr or .png")),
        }
    }
}

/// How to write pictures.
#[derive(Clone, Debug, Default)]
pub struct OutputOptions {
    /// 32-bit floats for the EXR's colour instead of 16-bit ones.
    pub float: bool,
    /// How PNGs look.
    pub png: PngOptions,
    /// What goes into the EXR's header.
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
        Format::Exr => encode_exr(film, options.float, &options.metadata),
        Format::Png => encode_png(film, &options.png),
    };
    encoded.map_err(|message| Error::output(path.as_ref(), message))
}
