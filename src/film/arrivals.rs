//! Splats arrive at a film.

use super::Film;
use super::exact::{self, HalfSum};
use super::splats::{Splat, Splats};

impl Film {
    /// Adds splats, in any order. Those outside the film are left out; those that are not finite, too, and counted as invalid
    /// samples. [`Film::count_splats`] says of how many samples they are.
    ///
    /// # Panics
    /// If there is no memory for them.
    pub fn add_splats(&mut self, splats: &[Splat], is_of_first_half: bool) {
        let (width, height, (x0, y0)) = (self.width, self.height, self.origin);
        let mut invalid = 0;
        for Splat { x, y, rgb } in splats {
            let (x, y) = (x.wrapping_sub(x0), y.wrapping_sub(y0));
            if x >= width || y >= height {
                continue;
            }
            if rgb.iter().any(|value| !value.is_finite()) {
                invalid += 1;
                continue;
            }
            for list in self.splat_lists(is_of_first_half) {
                let Some(sum) = list.get_mut(y as usize * width as usize + x as usize) else { continue };
                for ((sum, low), &value) in sum.rgb.iter_mut().zip(&mut sum.low).zip(rgb) {
                    exact::add(sum, low, exact::on_grid(f64::from(value)));
                }
            }
        }
        self.invalid_samples += invalid;
    }

    /// Counts samples of each pixel all splats of which were added.
    pub fn count_splats(&mut self, samples: u32, is_of_first_half: bool) {
        for list in self.splat_lists(is_of_first_half) {
            list.iter_mut().for_each(|sum| sum.count = sum.count.saturating_add(samples));
        }
    }

    fn splat_lists(&mut self, is_of_first_half: bool) -> impl Iterator<Item = &mut Vec<HalfSum>> {
        let (pixels, has_halves) = (self.sums.count.len(), self.layout.has_halves());
        let [all, first_half] = self.splats.get_or_insert_with(|| Splats::new(pixels, has_halves)).lists();
        [Some(all), Some(first_half).filter(|_| is_of_first_half)].into_iter().flatten()
    }

    /// Adds the splats of another film, as far as they are within this one.
    pub(super) fn merge_splats(&mut self, other: &Film) {
        let Some(theirs) = &other.splats else { return };
        let (pixels, has_halves) = (self.sums.count.len(), self.layout.has_halves());
        let ours = self.splats.get_or_insert_with(|| Splats::new(pixels, has_halves));
        for (list, from) in ours.lists().into_iter().zip([&theirs.all, &theirs.first_half]) {
            for (at, sum) in from.iter().enumerate() {
                let (x, y) =
                    (at as u32 % other.width + other.origin.0, at as u32 / other.width + other.origin.1);
                let (x, y) = (x.wrapping_sub(self.origin.0), y.wrapping_sub(self.origin.1));
                if x < self.width
                    && y < self.height
                    && let Some(own) = list.get_mut(y as usize * self.width as usize + x as usize)
                {
                    own.merge(sum, false);
                }
            }
        }
    }

    /// The mean of a pixel's splats.
    pub(super) fn splat(&self, pixel: usize) -> [f64; 3] {
        self.splats.as_ref().map_or([0.0; 3], |splats| splats.mean(pixel))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{AovSet, FilmTile};

    fn splat(x: u32, y: u32, value: f32) -> Splat {
        Splat { x, y, rgb: [value, 0.5 * value, 0.0] }
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
        let mut whole = Film::new(8, 4, AovSet::NONE);
        whole.add_splats(&all, false);
        whole.count_splats(4, false);
        // In two ranges of samples, and in two regions.
        let mut samples = Film::new(8, 4, AovSet::NONE);
        let mut second = samples.clone();
        samples.add_splats(&all[40..], false);
        samples.count_splats(3, false);
        second.add_splats(&all[..40], false);
        second.count_splats(1, false);
        samples.merge_film(&second);
        let mut regions = Film::new(8, 4, AovSet::NONE);
        for x0 in [4, 0] {
            let mut region = Film::new(4, 4, AovSet::NONE).at(x0, 0);
            region.add_splats(&all, false);
            region.count_splats(4, false);
            regions.merge_film(&region);
        }
        assert_eq!(samples, whole);
        assert_eq!(regions, whole);
    }
}
