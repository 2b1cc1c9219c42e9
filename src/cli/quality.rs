//! `--quality`: how many samples a picture gets and whether it is denoised, in one word.

use clap::ValueEnum;
use serde::Serialize;

/// A quality. Without `--quality` it is `Normal`, unless the user or the scene says how many samples to take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Quality {
    /// 8 samples per pixel, denoised: a look at composition and light.
    Draft,
    /// Noise below 12 % before denoising.
    Normal,
    /// Noise below 3 % before denoising.
    High,
    /// Noise below 1 %, not denoised: the error is that of the samples alone.
    Final,
}

/// The settings of a quality.
pub(crate) struct Preset {
    /// Noise threshold, percent; without one, all samples are taken.
    pub noise: Option<f32>,
    /// Maximum number of samples per pixel.
    pub samples: u32,
    pub denoise: bool,
}

impl Quality {
    pub fn preset(self) -> Preset {
        match self {
            Quality::Draft => Preset { noise: None, samples: 8, denoise: true },
            Quality::Normal => Preset { noise: Some(12.0), samples: 256, denoise: true },
            Quality::High => Preset { noise: Some(3.0), samples: 2048, denoise: true },
            Quality::Final => Preset { noise: Some(1.0), samples: 65_536, denoise: false },
        }
    }

    /// True if the picture's error is promised to be below the noise threshold.
    pub fn promises_error(self) -> bool {
        !self.preset().denoise
    }
}
