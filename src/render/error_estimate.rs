//! The estimated relative error of a picture, with a noise threshold.

use super::noise::Noise;
use super::options::RenderOptions;
use super::validation::Validation;
use std::ops::Range;

/// Estimates of a picture's error: from its samples, and, if it will be denoised, by measurements of the denoised picture.
pub(super) struct ErrorEstimate {
    pub noise: Noise,
    pub validation: Option<Validation>,
}

impl ErrorEstimate {
    /// The state before the first sample; `None` without a noise threshold.
    pub fn new(options: &RenderOptions) -> Option<ErrorEstimate> {
        let validation = options.denoises.then(|| Validation::new(options));
        options.noise.map(|_| ErrorEstimate { noise: Noise::default(), validation })
    }

    /// The relative error: of the denoised picture if it will be denoised.
    pub fn error(&self) -> Option<f64> {
        match &self.validation {
            Some(validation) => validation.error(),
            None => self.noise.error(),
        }
    }

    /// Predicted number of samples per pixel within `range`, at least `least` in all, for the error `wanted` or the next measurement.
    pub fn samples_for(&self, wanted: f64, least: u32, range: Range<u32>) -> Option<u32> {
        match &self.validation {
            Some(validation) => Some(validation.next().min(range.end).saturating_sub(range.start)),
            None => self.noise.samples_for(wanted, least, range),
        }
    }

    /// The state as bytes, for a checkpoint: the sample count of the next measurement, then [`Noise::to_bytes`].
    pub fn to_bytes(&self) -> Vec<u8> {
        let next = self.validation.as_ref().map_or(0u32, Validation::next);
        [&next.to_le_bytes(), self.noise.to_bytes().as_slice()].concat()
    }

    /// Restores the state from [`ErrorEstimate::to_bytes`] for this number of pixels.
    pub fn restore(&mut self, bytes: &[u8], pixels: usize) {
        let (next, noise) = bytes.split_first_chunk::<4>().unwrap_or((&[0; 4], &[]));
        if let Some(validation) = &mut self.validation {
            validation.resume(u32::from_le_bytes(*next));
        }
        self.noise.restore(noise, pixels);
    }
}
