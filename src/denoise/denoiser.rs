//! What takes the noise out: this crate, or a library that is loaded for it.

use super::{Color, Denoised, Noisy, denoise};
use crate::error::{Error, Result};
use crate::foreign::oidn::{Oidn, Run};
use std::path::Path;

/// A denoiser.
pub enum Denoiser {
    /// [`denoise`].
    Own,
    /// Open Image Denoise.
    Oidn(Box<Oidn>),
}

impl Denoiser {
    /// Open Image Denoise from a library's file, or from where the system finds it; on as many threads as the current pool
    /// has.
    ///
    /// # Errors
    /// A usage error if it can't be loaded.
    pub fn oidn(library: Option<&Path>) -> Result<Denoiser> {
        Oidn::load(library, rayon::current_num_threads()).map(|oidn| Denoiser::Oidn(Box::new(oidn)))
    }

    /// What it is, with its version, for headers.
    pub fn name(&self) -> String {
        match self {
            Denoiser::Own => concat!("oscura ", env!("CARGO_PKG_VERSION")).to_string(),
            Denoiser::Oidn(oidn) => {
                let (major, minor) = oidn.version();
                format!("Open Image Denoise {major}.{minor}")
            }
        }
    }

    /// Takes the noise out of a picture. Values that are NaN or infinite count as 0.
    ///
    /// Open Image Denoise takes the noise out of albedo and normal first, knows nothing of the noise and of depths, and filters
    /// the picture and each of its parts by themselves: what adds up before hardly does so afterwards.
    ///
    /// # Errors
    /// A usage error with what the library says went wrong.
    ///
    /// # Panics
    /// As [`denoise`].
    pub fn denoise(&self, noisy: &Noisy) -> Result<Denoised> {
        match self {
            Denoiser::Own => Ok(denoise(noisy)),
            Denoiser::Oidn(oidn) => {
                by_oidn(oidn, noisy).map_err(|why| Error::usage(format!("Open Image Denoise failed: {why}")))
            }
        }
    }
}

fn by_oidn(oidn: &Oidn, noisy: &Noisy) -> std::result::Result<Denoised, String> {
    let (width, height) = (noisy.width, noisy.height);
    let filter = |name: &str, color: &Color, guides: &[(&str, &[f32])]| {
        oidn.filter(&Run { width, height, name, pixels: &packed(color), guides })
    };
    let mut guides: Vec<(&str, Vec<f32>)> = Vec::new();
    // Normals help only beside the albedo.
    if let Some(albedo) = &noisy.guides.albedo {
        guides.push(("albedo", filter("albedo", albedo, &[])?));
        if let Some(normal) = &noisy.guides.normal {
            guides.push(("normal", filter("normal", normal, &[])?));
        }
    }
    let guides: Vec<(&str, &[f32])> = guides.iter().map(|(name, pixels)| (*name, &**pixels)).collect();
    let of = |color: &Color| Ok::<_, String>(unpacked(&filter("color", color, &guides)?));
    let parts: std::result::Result<Vec<_>, String> = noisy.parts.iter().map(of).collect();
    Ok(Denoised { color: of(&noisy.color)?, parts: parts? })
}

/// Pixel by pixel.
fn packed(color: &Color) -> Vec<f32> {
    let finite = |v: f32| if v.is_finite() { v } else { 0.0 };
    (0..color[0].len()).flat_map(|i| color.map(|plane| finite(plane[i]))).collect()
}

/// Plane by plane.
fn unpacked(pixels: &[f32]) -> [Vec<f32>; 3] {
    [0, 1, 2].map(|c| pixels.iter().skip(c).step_by(3).copied().collect())
}
