//! Splats: contributions of light paths to arbitrary pixels (light tracing). Their mean is added to the mean of camera samples.

use super::channel::{Layout, Reduction, reciprocal};
use super::exact_sum::{RgbSum, SumList, add_exact, round_to_grid};

/// Contribution of a light path to a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Splat {
    /// Column in the picture.
    pub x: u32,
    /// Row in the picture.
    pub y: u32,
    /// Linear radiance; a pixel's value is the sum of its splats divided by the number of samples per pixel.
    pub rgb: [f32; 3],
    /// Contributions to layers: at most two light passes and one light group.
    pub parts: Option<Box<[SplatPart; 3]>>,
}

/// Contribution of a splat to a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatPart {
    /// Index among the channels of `Source::PartOfColor`; ignored if out of range.
    pub layer: u16,
    /// See [`Splat::rgb`].
    pub rgb: [f32; 3],
}

impl SplatPart {
    /// A contribution to no layer.
    pub const NONE: SplatPart = SplatPart { layer: u16::MAX, rgb: [0.0; 3] };
}

/// Exact sums of splats by pixel, independent of their order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Splats {
    /// Sums over all samples.
    pub all: Vec<RgbSum>,
    /// Sums over the first half of the samples; empty if the film has no half buffers.
    pub first_half: Vec<RgbSum>,
    /// RGB sums of each layer.
    pub layers: Vec<SumList>,
    /// RGB sums of squares, if the film has a variance channel.
    pub squares: Option<SumList>,
}

impl Splats {
    /// Empty sums. Panics if memory runs out.
    pub fn new(pixels: usize, layout: &Layout) -> Splats {
        let zeros = |count| vec![RgbSum::default(); count];
        let has_variance = layout.extra().iter().any(|c| c.reduction == Reduction::VarianceOfMean);
        Splats {
            all: zeros(pixels),
            first_half: zeros(if layout.has_halves() { pixels } else { 0 }),
            layers: (0..layout.parts).map(|_| Splats::list(pixels)).collect(),
            squares: has_variance.then(|| Splats::list(pixels)),
        }
    }

    /// An empty list of RGB sums.
    pub fn list(pixels: usize) -> SumList {
        SumList::try_new(3 * pixels, true).expect("there is memory for splats")
    }

    /// Adds a splat to a pixel; returns `false` and adds nothing if a value is not finite.
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

    /// Adds to the number of samples per pixel over which splats are averaged.
    pub fn count(&mut self, samples: u32, is_of_first_half: bool) {
        let halves = if is_of_first_half { &mut self.first_half[..] } else { &mut [] };
        for sum in self.all.iter_mut().chain(halves) {
            sum.count = sum.count.saturating_add(samples);
        }
    }

    /// Adds the sums of pixel `from` of other splats of the same layout.
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

    /// Clears the sums of colour, after the colour was replaced.
    pub fn clear_color(&mut self) {
        let zero = |sum: &mut RgbSum| *sum = RgbSum { count: sum.count, ..RgbSum::default() };
        self.all.iter_mut().for_each(zero);
        self.first_half.iter_mut().for_each(zero);
    }

    /// Mean RGB of a pixel.
    pub fn mean(&self, pixel: usize) -> [f64; 3] {
        let RgbSum { rgb, count, .. } = self.all[pixel];
        rgb.map(|sum| sum * reciprocal(count))
    }

    /// Mean RGB of a layer by pixel.
    pub fn means_of_layer(&self, layer: usize) -> Option<impl Iterator<Item = [f64; 3]>> {
        let sums = self.layers.get(layer)?;
        Some(self.all.iter().zip(sums.high.as_chunks::<3>().0).map(|(all, sums)| {
            let scale = reciprocal(all.count);
            sums.map(|sum| sum * scale)
        }))
    }

    /// Variances of the means by pixel: sums of squares over the squared count, for rare and independent splats. `None` without a variance
    /// channel.
    pub fn variances(&self) -> Option<impl Iterator<Item = [f64; 3]>> {
        let squares = self.squares.as_ref()?;
        Some(self.all.iter().zip(squares.high.as_chunks::<3>().0).map(|(all, squares)| {
            let scale = reciprocal(all.count);
            squares.map(|square| square * scale * scale)
        }))
    }

    /// Mean RGB of a pixel over the first and the second half of the samples.
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
    sums.zip(values).for_each(|((sum, low), value)| add_exact(sum, low, round_to_grid(value)));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Aov, AovSet, Film, FilmTile, Values};

    /// A splat that contributes fully to the first layer and by half to the third.
    fn splat(x: u32, y: u32, value: f32) -> Splat {
        let rgb = [value, 0.5 * value, 0.0];
        let part = |layer, share: f32| SplatPart { layer, rgb: rgb.map(|v| share * v) };
        Splat { x, y, rgb, parts: Some(Box::new([part(0, 1.0), part(2, 0.5), SplatPart::NONE])) }
    }

    /// Three light passes, and the variance.
    fn layered() -> AovSet {
        AovSet::from([Aov::DiffuseDirect, Aov::DiffuseIndirect, Aov::GlossyDirect, Aov::Variance])
    }

    #[test]
    fn means_of_splats_are_added_to_means_of_samples() {
        let mut film = Film::new(4, 2, AovSet::NONE).at(10, 20);
        let mut tile = FilmTile::new(10, 20, 4, 2, film.layout());
        for pixel in 0..8 {
            tile.add(pixel, [1.0, 1.0, 1.0], 1.0);
        }
        film.merge(tile);
        film.add_splats(
            &[splat(11, 21, 3.0), splat(11, 21, 1.0), splat(9, 21, 7.0), splat(14, 20, 7.0)],
            false,
        );
        film.count_splats(2, false);
        assert_eq!(film.mean_rgba(1, 1), [3.0, 2.0, 1.0, 1.0]);
        assert_eq!(film.mean_rgba(0, 1), [1.0; 4]);
    }

    #[test]
    fn merging_ranges_of_samples_or_regions_equals_the_whole() {
        let all: Vec<Splat> = (0..64u32).map(|i| splat(i % 8, i / 16, 1.0 / (i as f32 + 3.0))).collect();
        let mut whole = Film::new(8, 4, layered());
        whole.add_splats(&all, false);
        whole.count_splats(4, false);
        // In two ranges of samples, and in two regions.
        let mut samples = Film::new(8, 4, layered());
        let mut second = samples.clone();
        samples.add_splats(&all[40..], false);
        samples.count_splats(3, false);
        second.add_splats(&all[..40], false);
        second.count_splats(1, false);
        samples.merge_film(&second);
        let mut regions = Film::new(8, 4, layered());
        for x0 in [4, 0] {
            let mut region = Film::new(4, 4, layered()).at(x0, 0);
            region.add_splats(&all, false);
            region.count_splats(4, false);
            regions.merge_film(&region);
        }
        assert_eq!(samples, whole);
        assert_eq!(regions, whole);
    }

    #[test]
    fn parts_of_splats_are_added_to_their_layers() {
        let mut film = Film::new(2, 1, layered());
        film.add_splats(&[splat(0, 0, 3.0), splat(0, 0, 1.0)], false);
        film.count_splats(2, false);
        let plane = |film: &Film, name: &str| film.plane(name).expect("the plane exists").into_floats();
        let of = |film: &Film, aov: Aov| -> Vec<Vec<f32>> {
            film.aov(aov).expect("the AOV exists").into_iter().map(Values::into_floats).collect()
        };
        assert_eq!(of(&film, Aov::DiffuseDirect), [[2.0, 0.0], [1.0, 0.0], [0.0, 0.0]]);
        assert_eq!(of(&film, Aov::DiffuseIndirect), [[0.0; 2]; 3]);
        assert_eq!(of(&film, Aov::GlossyDirect), [[1.0, 0.0], [0.5, 0.0], [0.0, 0.0]]);
        // Infinite without camera samples; then (9 + 1) / 4, with constant camera samples.
        assert_eq!(of(&film, Aov::Variance)[0][0], f32::INFINITY);
        let mut tile = FilmTile::new(0, 0, 2, 1, film.layout());
        for pixel in [0, 0, 1, 1] {
            tile.add_with_parts(pixel, [0.0; 3], 1.0, None, &[[0.0; 3]; 3], false);
        }
        film.merge(tile);
        assert_eq!(of(&film, Aov::Variance), [[2.5, 0.0], [0.625, 0.0], [0.0, 0.0]]);
        // Replacing colour and a layer leaves the others.
        film.set_color([&[5.0; 2]; 3]);
        let first = Aov::DiffuseDirect.info().names[0];
        film.set_means(first, [&[7.0; 2]; 3]);
        assert_eq!((plane(&film, "R"), plane(&film, first)), (vec![5.0; 2], vec![7.0; 2]));
        assert_eq!(of(&film, Aov::GlossyDirect)[0], [1.0, 0.0]);
        film.remove_aovs([Aov::DiffuseIndirect]);
        assert_eq!(of(&film, Aov::GlossyDirect)[0], [1.0, 0.0]);
        // Serialization.
        let mut bytes = Vec::new();
        film.write_sums(&mut bytes).unwrap();
        let layout = layered().channels().filter(|c| c.names != Aov::DiffuseIndirect.info().names);
        let mut read = Film::try_new(2, 1, layout).unwrap();
        read.read_sums(&mut bytes.as_slice()).unwrap();
        assert_eq!(read, film);
        assert_eq!(of(&film.pixel(0, 0).unwrap(), Aov::GlossyDirect)[0], [1.0]);
    }
}
