//! The kinds of files of pictures, by their names; and what encoders return.

use crate::error::{Error, Result, Warning};
use std::path::Path;

/// A picture as the bytes of its file, and what was lost on the way.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The whole file.
    pub bytes: Vec<u8>,
    /// Values that the format can't hold.
    pub warnings: Vec<Warning>,
}

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
    /// Maximum number of pixels that a side can have, where the format sets a limit that pictures may reach.
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
                let what = match extension.as_str() {
                    "" => "has no extension, which gives the format of the picture".to_string(),
                    other => format!("pictures can't be written as '.{other}'"),
                };
                return Err(Error::usage(format!("{}: {what}", path.display()))
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
