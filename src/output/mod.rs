//! Writing pictures: EXR for compositing, PNG and the like for looking at. Everything is encoded in memory first, then written to a
//! temporary file beside the target and renamed, so that a half-written picture never has the target's name.

mod atomic;
mod exr;
mod exr_options;
pub mod part;
mod png;
mod video;

pub use crate::color::{ViewTable, ViewTransform};
use crate::error::{Error, Result, Warning};
use crate::film::Film;
pub use atomic::{
    check_folder, check_target, is_same_target, make_folder, move_folder, remove_file, remove_leftovers,
    write_atomically,
};
pub use exr::{DENOISED, Matte, Metadata, encode_exr, encode_layered};
pub use exr_options::{ExrCompression, ExrLayout, ExrOptions, ExrWindow, WorkingSpace, is_color};
pub use png::{Linear, PngOptions, encode_png, encode_png_rgb8, encode_rgb8, encode_shown, rgba8, shown8};
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
        Format::Exr => encode_exr(film, options.float, &options.exr, &options.metadata),
        Format::Png => encode_png(film, &options.png),
        other => {
            let picture = Linear { width: film.width(), height: film.height(), rgba: &film.rgba() };
            encode_shown(&picture, other, &options.png).map(|bytes| Encoded { bytes, warnings: vec![] })
        }
    };
    encoded.map_err(|message| Error::output(path.as_ref(), message))
}

// What encoders return.

/// A picture as the bytes of its file, and what was lost on the way.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The whole file.
    pub bytes: Vec<u8>,
    /// Values that the format can't hold.
    pub warnings: Vec<Warning>,
}

// The kinds of files of pictures, by their names.

/// The kinds of files that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// OpenEXR: linear, scene-referred.
    Exr,
    /// PNG: 8 or 16 bits, display-referred.
    Png,
    /// JPEG: 8 bits, display-referred, without alpha.
    Jpeg,
    /// TIFF: 8 or 16 bits, display-referred.
    Tiff,
    /// WebP: 8 bits, display-referred, lossless.
    WebP,
    /// Radiance HDR: linear, without alpha and further channels.
    Hdr,
}

impl Format {
    /// Most pixels that a side can have, where the format sets a limit that pictures may reach.
    pub fn largest_edge(self) -> Option<u32> {
        match self {
            Format::WebP => Some(16_383),
            Format::Jpeg => Some(65_535),
            Format::Exr | Format::Png | Format::Tiff | Format::Hdr => None,
        }
    }

    /// The format that a file name asks for by its extension.
    ///
    /// # Errors
    /// A usage error if the extension is unknown or missing.
    pub fn of(path: impl AsRef<Path>) -> Result<Format> {
        let path = path.as_ref();
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let format = match extension.as_str() {
            "exr" => Format::Exr,
            "png" => Format::Png,
            "jpg" | "jpeg" => Format::Jpeg,
            "tif" | "tiff" => Format::Tiff,
            "webp" => Format::WebP,
            "hdr" => Format::Hdr,
            _ => {
                return Err(Error::usage(format!(
                    "{}: can't tell the format of the picture from its name",
                    path.display()
                ))
                .with_help("end the name in .exr, .png, .jpg, .tif, .webp or .hdr"));
            }
        };
        let lacks = match format {
            Format::Tiff => !cfg!(feature = "tiff"),
            Format::WebP => !cfg!(feature = "webp"),
            _ => false,
        };
        if lacks {
            let message = format!("{}: this build can't write {}", path.display(), format.name());
            return Err(
                Error::usage(message).with_help("build it with the feature 'decoders', or write .png")
            );
        }
        Ok(format)
    }

    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            Format::Exr => "EXR",
            Format::Png => "PNG",
            Format::Jpeg => "JPEG",
            Format::Tiff => "TIFF",
            Format::WebP => "WebP",
            Format::Hdr => "HDR",
        }
    }
}
