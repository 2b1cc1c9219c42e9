//! Splats arrive at a film.

use super::Film;
use super::channel::Source;
use super::rect::Rect;
use super::splats::Splat;

impl Film {
    /// Adds splats, in any order. Those outside the film are left out; those that are not finite, too, and counted as invalid
    /// samples. [`Film::count_splats`] says of how many samples they are.
    ///
    /// # Panics
    /// If there is no memory for them.
    pub fn add_splats(&mut self, splats: &[Splat], is_of_first_half: bool) {
        let place = self.place();
        for splat in splats {
            for number in place.bands_over(Rect::new((splat.x, splat.y), (1, 1))) {
                let one = std::slice::from_ref(splat);
                let band = &mut self.bands[number];
                self.invalid_samples +=
                    band.add_splats(place.band(number), one, is_of_first_half, &self.layout);
            }
        }
    }

    /// Counts samples of each pixel all splats of which were added.
    pub fn count_splats(&mut self, samples: u32, is_of_first_half: bool) {
        for band in &mut self.bands {
            band.splats(&self.layout).count(samples, is_of_first_half);
        }
    }

    /// Which of the channels whose source is a part of colour this one is.
    pub(super) fn layer_of(&self, index: usize) -> usize {
        self.channels()[..index].iter().filter(|channel| channel.source == Source::PartOfColor).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Aov, AovSet, FilmTile, SplatPart, Values};

    /// All of it belongs to the first layer, half of it to the third.
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
    fn splats_are_means_beside_those_of_samples() {
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
    fn parts_make_the_whole() {
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
    fn layers_have_their_parts() {
        let mut film = Film::new(2, 1, layered());
        film.add_splats(&[splat(0, 0, 3.0), splat(0, 0, 1.0)], false);
        film.count_splats(2, false);
        let plane = |film: &Film, name: &str| film.plane(name).expect("it is kept").into_floats();
        let of = |film: &Film, aov: Aov| -> Vec<Vec<f32>> {
            film.aov(aov).expect("it is kept").into_iter().map(Values::into_floats).collect()
        };
        assert_eq!(of(&film, Aov::DiffuseDirect), [[2.0, 0.0], [1.0, 0.0], [0.0, 0.0]]);
        assert_eq!(of(&film, Aov::DiffuseIndirect), [[0.0; 2]; 3]);
        assert_eq!(of(&film, Aov::GlossyDirect), [[1.0, 0.0], [0.5, 0.0], [0.0, 0.0]]);
        // Without samples of the pixel it is unknown; then (9 + 1) / 4, for samples that are all the same.
        assert_eq!(of(&film, Aov::Variance)[0][0], f32::INFINITY);
        let mut tile = FilmTile::new(0, 0, 2, 1, film.layout());
        for pixel in [0, 0, 1, 1] {
            tile.add_with_parts(pixel, [0.0; 3], 1.0, None, &[[0.0; 3]; 3], false);
        }
        film.merge(tile);
        assert_eq!(of(&film, Aov::Variance), [[2.5, 0.0], [0.625, 0.0], [0.0, 0.0]]);
        // What is put in place of colour and of a layer leaves the others.
        film.set_color([&[5.0; 2]; 3]);
        let first = Aov::DiffuseDirect.info().names[0];
        film.set_means(first, [&[7.0; 2]; 3]);
        assert_eq!((plane(&film, "R"), plane(&film, first)), (vec![5.0; 2], vec![7.0; 2]));
        assert_eq!(of(&film, Aov::GlossyDirect)[0], [1.0, 0.0]);
        film.forget([Aov::DiffuseIndirect]);
        assert_eq!(of(&film, Aov::GlossyDirect)[0], [1.0, 0.0]);
        // A file keeps them.
        let mut bytes = Vec::new();
        film.write_sums(&mut bytes).unwrap();
        let layout = layered().channels().filter(|c| c.names != Aov::DiffuseIndirect.info().names);
        let mut read = Film::try_new(2, 1, layout).unwrap();
        read.read_sums(&mut bytes.as_slice()).unwrap();
        assert_eq!(read, film);
        assert_eq!(of(&film.pixel(0, 0).unwrap(), Aov::GlossyDirect)[0], [1.0]);
    }
}
