//! Light that arrives at pixels from elsewhere than their own samples: paths from lamps, which end at whatever pixel shows
//! where they do. Its mean is added to that of the pixels' samples.

use super::accumulator::reciprocal;
use super::exact::HalfSum;

/// Light that a path from a lamp brings to a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// Column and row in the picture.
    pub x: u32,
    /// See `x`.
    pub y: u32,
    /// Radiance, linear, as its share of the mean over all paths from lamps that stand for one sample of each pixel.
    pub rgb: [f32; 3],
}

/// The sums of splats by pixel. Each counts for itself, so that their order does not matter.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Splats {
    /// Over all samples.
    pub all: Vec<HalfSum>,
    /// Over those of the first half; empty where halves are not kept apart.
    pub first_half: Vec<HalfSum>,
}

impl Splats {
    /// None yet.
    pub fn new(pixels: usize, has_halves: bool) -> Splats {
        let zeros = |count| vec![HalfSum::default(); count];
        Splats { all: zeros(pixels), first_half: zeros(if has_halves { pixels } else { 0 }) }
    }

    /// Both lists.
    pub fn lists(&mut self) -> [&mut Vec<HalfSum>; 2] {
        [&mut self.all, &mut self.first_half]
    }

    /// Mean of a pixel.
    pub fn mean(&self, pixel: usize) -> [f64; 3] {
        let HalfSum { rgb, count, .. } = self.all[pixel];
        rgb.map(|sum| sum * reciprocal(count))
    }

    /// Means of a pixel over the first half of the samples and over the second.
    pub fn halves(&self, pixel: usize) -> [[f64; 3]; 2] {
        let (all, first) = (&self.all[pixel], &self.first_half[pixel]);
        let second =
            std::array::from_fn(|c| (all.rgb[c] - first.rgb[c]) * reciprocal(all.count - first.count));
        [first.rgb.map(|sum| sum * reciprocal(first.count)), second]
    }
}
