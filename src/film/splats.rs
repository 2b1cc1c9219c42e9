//! Light that arrives at pixels from elsewhere than their own samples: paths from lamps, which end at whatever pixel shows
//! where they do. Its mean is added to that of the pixels' samples.

use super::accumulator::reciprocal;
use super::channel::Reduction;
use super::exact::{self, HalfSum, SumList};
use super::layout::Layout;

/// Light that a path from a lamp brings to a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Splat {
    /// Column and row in the picture.
    pub x: u32,
    /// See `x`.
    pub y: u32,
    /// Radiance, linear, as its share of the mean over all paths from lamps that stand for one sample of each pixel.
    pub rgb: [f32; 3],
    /// The parts of it that belong to layers, if there are some: two light passes at most, and a group of lights.
    pub parts: Option<Box<[SplatPart; 3]>>,
}

/// What a layer has of a splat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatPart {
    /// Which of the channels whose source is `Source::PartOfColor`, in their order; beyond them: none.
    pub layer: u16,
    /// See [`Splat::rgb`].
    pub rgb: [f32; 3],
}

impl SplatPart {
    /// Of no layer.
    pub const NONE: SplatPart = SplatPart { layer: u16::MAX, rgb: [0.0; 3] };
}

/// The sums of splats by pixel. Each counts for itself, so that their order does not matter.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Splats {
    /// Over all samples.
    pub all: Vec<HalfSum>,
    /// Over those of the first half; empty where halves are not kept apart.
    pub first_half: Vec<HalfSum>,
    /// What each layer has, three numbers a pixel.
    pub layers: Vec<SumList>,
    /// Sums of squares, three numbers a pixel, where the film keeps a variance.
    pub squares: Option<SumList>,
}

impl Splats {
    /// None yet. Panics if there is no memory for them.
    pub fn new(pixels: usize, layout: &Layout) -> Splats {
        let zeros = |count| vec![HalfSum::default(); count];
        let has_variance = layout.further().iter().any(|c| c.reduction == Reduction::VarianceOfMean);
        Splats {
            all: zeros(pixels),
            first_half: zeros(if layout.has_halves() { pixels } else { 0 }),
            layers: (0..layout.parts).map(|_| Splats::list(pixels)).collect(),
            squares: has_variance.then(|| Splats::list(pixels)),
        }
    }

    /// Sums of three numbers a pixel.
    pub fn list(pixels: usize) -> SumList {
        SumList::try_new(3 * pixels, true).expect("there is memory for light from lamps")
    }

    /// Adds one to a pixel; nothing if one of its numbers is not finite, which is told by `false`.
    pub fn add(&mut self, pixel: usize, splat: &Splat, is_of_first_half: bool) -> bool {
        let of_layers = splat.parts.iter().flat_map(|parts| &**parts);
        let parts = of_layers.clone().flat_map(|part| &part.rgb);
        if splat.rgb.iter().chain(parts).any(|value| !value.is_finite()) {
            return false;
        }
        self.all[pixel].add_exactly(splat.rgb);
        if let Some(sum) = self.first_half.get_mut(pixel).filter(|_| is_of_first_half) {
            sum.add_exactly(splat.rgb);
        }
        for part in of_layers {
            if let Some(layer) = self.layers.get_mut(usize::from(part.layer)) {
                add(layer, pixel, part.rgb.map(f64::from));
            }
        }
        if let Some(squares) = &mut self.squares {
            add(squares, pixel, splat.rgb.map(|value| f64::from(value).powi(2)));
        }
        true
    }

    /// Counts samples of each pixel all splats of which were added.
    pub fn count(&mut self, samples: u32, is_of_first_half: bool) {
        let halves = if is_of_first_half { &mut self.first_half[..] } else { &mut [] };
        for sum in self.all.iter_mut().chain(halves) {
            sum.count = sum.count.saturating_add(samples);
        }
    }

    /// Adds a pixel of others, which are of the same layout.
    pub fn merge(&mut self, pixel: usize, other: &Splats, from: usize) {
        self.all[pixel].merge(&other.all[from], false);
        if let Some((sum, more)) = self.first_half.get_mut(pixel).zip(other.first_half.get(from)) {
            sum.merge(more, false);
        }
        let (at, from) = (pixel * 3, from * 3);
        for (layer, more) in self.layers.iter_mut().zip(&other.layers) {
            layer.merge(at, more, from, 3);
        }
        if let Some((sum, more)) = self.squares.as_mut().zip(other.squares.as_ref()) {
            sum.merge(at, more, from, 3);
        }
    }

    /// Forgets the light of colour, in place of which other values were put.
    pub fn clear_color(&mut self) {
        let zero = |sum: &mut HalfSum| *sum = HalfSum { count: sum.count, ..HalfSum::default() };
        self.all.iter_mut().for_each(zero);
        self.first_half.iter_mut().for_each(zero);
    }

    /// Mean of a pixel.
    pub fn mean(&self, pixel: usize) -> [f64; 3] {
        let HalfSum { rgb, count, .. } = self.all[pixel];
        rgb.map(|sum| sum * reciprocal(count))
    }

    /// Means of a layer, three numbers a pixel.
    pub fn means_of_layer(&self, layer: usize) -> Option<impl Iterator<Item = [f64; 3]>> {
        let sums = self.layers.get(layer)?;
        Some(self.all.iter().zip(sums.high.as_chunks::<3>().0).map(|(all, sums)| {
            let scale = reciprocal(all.count);
            sums.map(|sum| sum * scale)
        }))
    }

    /// Variances of the means: sums of squares of splats that are rare and independent. `None` where they are not kept.
    pub fn variances(&self) -> Option<impl Iterator<Item = [f64; 3]>> {
        let squares = self.squares.as_ref()?;
        Some(self.all.iter().zip(squares.high.as_chunks::<3>().0).map(|(all, squares)| {
            let scale = reciprocal(all.count);
            squares.map(|square| square * scale * scale)
        }))
    }

    /// Means of a pixel over the first half of the samples and over the second.
    pub fn halves(&self, pixel: usize) -> [[f64; 3]; 2] {
        let (all, first) = (&self.all[pixel], &self.first_half[pixel]);
        let second =
            std::array::from_fn(|c| (all.rgb[c] - first.rgb[c]) * reciprocal(all.count - first.count));
        [first.rgb.map(|sum| sum * reciprocal(first.count)), second]
    }
}

fn add(list: &mut SumList, pixel: usize, values: [f64; 3]) {
    let at = 3 * pixel..3 * pixel + 3;
    let sums = list.high[at.clone()].iter_mut().zip(&mut list.low[at]);
    sums.zip(values).for_each(|((sum, low), value)| exact::add(sum, low, exact::on_grid(value)));
}
