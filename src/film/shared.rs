//! A film to which several threads add concurrently.
//!
//! Each band has a lock with hardly any contention: tiles are ordered column by column, so that concurrent tiles are mostly in different
//! bands. A tile of a later pass is queued in each of its bands until the current pass is complete there, so the samples of a pixel
//! are added in a fixed order.

use super::band::Band;
use super::picture::Film;
use super::splats::Splat;
use super::tile::{FilmTile, Rect};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

/// A film in bands, to which threads add concurrently.
pub struct SharedFilm {
    /// The film without its bands.
    film: Film,
    rect: Rect,
    bands: Vec<Mutex<SharedBand>>,
    /// Number of discarded non-finite samples.
    invalid: AtomicU64,
}

struct SharedBand {
    band: Band,
    rect: Rect,
    /// The current pass, and the number of its missing pixels.
    pass: usize,
    missing: u64,
    /// Tiles of later passes, with their passes.
    waiting: Vec<(usize, Arc<FilmTile>)>,
}

impl Film {
    /// Converts to a shared film, until [`SharedFilm::into_film`].
    pub fn into_shared(mut self) -> SharedFilm {
        let rect = self.rect();
        let shared = |(number, band): (usize, _)| {
            let rect = rect.band(number);
            Mutex::new(SharedBand { band, rect, pass: 0, missing: rect.area(), waiting: Vec::new() })
        };
        let bands = std::mem::take(&mut self.bands).into_iter().enumerate().map(shared).collect();
        SharedFilm { film: self, rect, bands, invalid: AtomicU64::new(0) }
    }
}

impl SharedFilm {
    /// Adds the part of a tile within the film. Passes count from 0; the tiles of a pass cover every pixel once. Returns the tile for reuse
    /// unless it is queued.
    ///
    /// # Panics
    /// If the tile has other channels.
    pub fn merge(&self, pass: usize, tile: FilmTile) -> Option<FilmTile> {
        let is_ours = Arc::ptr_eq(&tile.layout, &self.film.layout) || tile.layout == self.film.layout;
        assert!(is_ours, "a tile has other channels than the film");
        self.invalid.fetch_add(tile.invalid_samples, Ordering::Relaxed);
        let tile = Arc::new(tile);
        for band in &self.bands[self.rect.overlapping_bands(tile.rect())] {
            lock(band).add_or_queue(pass, &tile);
        }
        Arc::into_inner(tile)
    }

    /// Number of pixels of a rectangle that are within the film.
    pub fn pixels_within(&self, x0: u32, y0: u32, width: u32, height: u32) -> u64 {
        self.rect.intersection(Rect::new((x0, y0), (width, height))).area()
    }

    /// Adds all splats of one sample per pixel, in lists sorted by [`SharedFilm::sort`].
    pub fn add_splats(&self, lists: &[Vec<Splat>], is_of_first_half: bool) {
        self.bands.par_iter().for_each(|band| {
            let SharedBand { band, rect, .. } = &mut *lock(band);
            let mut invalid = 0;
            for splats in lists {
                let from = splats.partition_point(|splat| splat.y < rect.y0);
                let until = from + splats[from..].partition_point(|splat| splat.y < rect.y1);
                invalid += band.add_splats(*rect, &splats[from..until], is_of_first_half, &self.film.layout);
            }
            band.splats(&self.film.layout).count(1, is_of_first_half);
            self.invalid.fetch_add(invalid, Ordering::Relaxed);
        });
    }

    /// Sorts splats by row; stable.
    pub fn sort(splats: &mut [Splat]) {
        splats.sort_by_key(|splat| splat.y);
    }

    /// Joins the bands to a film. After rendering was stopped early, queued tiles are added pass by pass.
    pub fn into_film(self) -> Film {
        let SharedFilm { mut film, bands, invalid, .. } = self;
        film.invalid_samples += invalid.into_inner();
        film.bands = bands.into_par_iter().map(SharedBand::finish).collect();
        film
    }
}

impl SharedBand {
    fn finish(band: Mutex<SharedBand>) -> Band {
        let band = band.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
        let SharedBand { mut band, rect, mut waiting, .. } = band;
        waiting.sort_by_key(|(pass, tile)| (*pass, tile.y0, tile.x0));
        waiting.iter().for_each(|(_, tile)| band.add_tile(rect, tile));
        band
    }

    /// Adds a tile of the current pass, and queued tiles of passes that become current; queues a tile of a later pass.
    fn add_or_queue(&mut self, pass: usize, tile: &Arc<FilmTile>) {
        if pass != self.pass {
            self.waiting.push((pass, tile.clone()));
            return;
        }
        self.add(tile);
        while self.missing == 0 {
            (self.pass, self.missing) = (self.pass + 1, self.rect.area());
            let pass = self.pass;
            for (_, tile) in self.waiting.extract_if(.., |(of, _)| *of == pass).collect::<Vec<_>>() {
                self.add(&tile);
            }
        }
    }

    fn add(&mut self, tile: &FilmTile) {
        self.band.add_tile(self.rect, tile);
        self.missing = self.missing.saturating_sub(self.rect.intersection(tile.rect()).area());
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::{Aov, AovSet};

    /// A tile of a pass at a position, with colours and material ids that encode the pass.
    fn tile(film: &SharedFilm, pass: usize, (x0, y0): (u32, u32)) -> FilmTile {
        let mut tile = FilmTile::new(x0, y0, 16, 16, film.film.layout());
        for pixel in 0..256 {
            let id = f32::from_bits(1 + pass as u32);
            // Large enough for sums to depend on the order.
            let value = [1e9, 0.1, 1e17][pass % 3];
            tile.add_with_first_hit(pixel, [value; 3], 1.0, Some(&[id]));
        }
        tile
    }

    fn film() -> Film {
        Film::new(50, 70, AovSet::from([Aov::MaterialId])).at(3, 5)
    }

    fn positions() -> Vec<(u32, u32)> {
        (0..6).flat_map(|y| (0..4).map(move |x| (16 * x, 16 * y))).collect()
    }

    #[test]
    fn passes_are_added_in_order_for_any_order_of_tiles() {
        let mut one_by_one = film();
        let shared = film().into_shared();
        let order: Vec<(usize, (u32, u32))> =
            (0..4).flat_map(|pass| positions().into_iter().map(move |position| (pass, position))).collect();
        order.iter().for_each(|(pass, position)| one_by_one.merge(tile(&shared, *pass, *position)));
        // A permutation.
        let mixed = (0..order.len()).map(|i| order[(i * 41 + 17) % order.len()]);
        mixed.for_each(|(pass, position)| drop(shared.merge(pass, tile(&shared, pass, position))));
        let waits = |band: &Mutex<SharedBand>| !lock(band).waiting.is_empty();
        assert!(!shared.bands.iter().any(waits));
        assert_eq!(shared.into_film(), one_by_one);
    }

    #[test]
    fn tiles_queued_behind_an_incomplete_pass_are_added_at_the_end() {
        let shared = film().into_shared();
        let mut one_by_one = film();
        for (pass, position) in [(2, (16, 16)), (1, (32, 16)), (0, (16, 16)), (1, (16, 16))] {
            shared.merge(pass, tile(&shared, pass, position));
        }
        for (pass, position) in [(0, (16, 16)), (1, (16, 16)), (2, (16, 16)), (1, (32, 16))] {
            one_by_one.merge(tile(&shared, pass, position));
        }
        assert_eq!(shared.into_film(), one_by_one);
    }

    /// Tiles of other bands can be added while a band is locked.
    #[test]
    fn bands_are_locked_independently() {
        let shared = Film::new(64, 64, AovSet::NONE).into_shared();
        let held = lock(&shared.bands[1]);
        let layout = shared.film.layout();
        for y0 in [0, 32, 48] {
            assert!(shared.merge(0, FilmTile::new(0, y0, 64, 16, layout)).is_some());
        }
        drop(held);
        let locks = |y0, height| shared.rect.overlapping_bands(Rect::new((0, y0), (16, height))).len();
        assert_eq!(
            [locks(0, 16), locks(48, 16), locks(8, 16), locks(32, 32), locks(64, 16)],
            [1, 1, 2, 2, 0]
        );
    }
}
