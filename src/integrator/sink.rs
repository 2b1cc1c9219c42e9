//! Where the radiance of paths arrives.

use super::lanes::WAVE;
use crate::color::Rgb;

/// Index of a light in the scene's lights, by which outputs for groups of lights can tell them apart; `None` for
/// emitters that light sampling does not know.
pub type LightIndex = Option<u32>;

/// Radiance and alpha of the samples of a wave.
pub struct Sink {
    samples: Vec<[f32; 4]>,
    /// Samples of the wave; behind them are radiances that are shared later.
    count: usize,
    /// What the samples had before paths were shared; empty where none are.
    unshared: Vec<[f32; 3]>,
}

impl Sink {
    /// Without samples.
    pub fn new() -> Sink {
        Sink { samples: Vec::with_capacity(WAVE), count: 0, unshared: Vec::new() }
    }

    /// Begins a wave of `count` samples: black and transparent.
    pub fn begin(&mut self, count: usize) {
        self.samples.clear();
        self.samples.resize(count, [0.0; 4]);
        self.count = count;
        self.unshared.clear();
    }

    /// Takes further indices below `count` for radiances that are no sample.
    pub fn add_parts(&mut self, count: usize) {
        self.samples.resize(count, [0.0; 4]);
    }

    /// Remembers what the samples have alone; further radiances follow by [`Sink::add_unshared`].
    pub fn keep_unshared(&mut self) {
        self.unshared.clear();
        self.unshared.extend(self.samples[..self.count].iter().map(|&[r, g, b, _]| [r, g, b]));
    }

    /// Adds to what a sample has alone.
    pub fn add_unshared(&mut self, sample: u32, value: Rgb) {
        let sum = &mut self.unshared[sample as usize];
        *sum = (Rgb::from_array(*sum) + value).to_array();
    }

    /// What a sample has alone.
    pub fn unshared(&self, sample: usize) -> [f32; 3] {
        self.unshared.get(sample).copied().unwrap_or_default()
    }

    /// The radiance that arrived at an index so far.
    pub fn radiance(&self, index: u32) -> Rgb {
        let [r, g, b, _] = self.samples[index as usize];
        Rgb::new(r, g, b)
    }

    /// Adds what a light contributes to a sample, all weights included: the only way for radiance into the picture.
    #[inline(always)]
    pub fn contribute(&mut self, sample: u32, _light: LightIndex, value: Rgb) {
        let sum = &mut self.samples[sample as usize];
        let [r, g, b] = value.to_array();
        sum[0] += r;
        sum[1] += g;
        sum[2] += b;
    }

    /// Makes a sample opaque: something is there.
    #[inline(always)]
    pub fn cover(&mut self, sample: u32) {
        self.samples[sample as usize][3] = 1.0;
    }

    /// Red, green, blue and alpha of all samples.
    pub fn samples(&self) -> &[[f32; 4]] {
        &self.samples[..self.count]
    }
}
