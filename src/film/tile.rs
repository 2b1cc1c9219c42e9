//! The part of a film that one thread fills.

use super::{AovSample, AovSet, Sums};

/// A rectangle of a film with its own sums. Pixels are counted row by row from the tile's top left corner.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmTile {
    /// Left column in the film.
    pub x0: u32,
    /// Top row in the film.
    pub y0: u32,
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    pub(super) aovs: AovSet,
    pub(super) sums: Sums,
    pub(super) invalid_samples: u64,
}

impl FilmTile {
    /// An empty tile.
    pub fn new(x0: u32, y0: u32, width: u32, height: u32, aovs: AovSet) -> FilmTile {
        let sums = Sums::new(width as usize * height as usize, aovs);
        FilmTile { x0, y0, width, height, aovs, sums, invalid_samples: 0 }
    }

    /// Adds a sample to the pixel `pixel` of the tile: premultiplied linear colour and alpha. A sample with NaN or an
    /// infinity is left out and counted.
    #[inline(always)]
    pub fn add(&mut self, pixel: u32, rgb: [f32; 3], alpha: f32) {
        let [r, g, b] = rgb;
        // One test for all four: a product with zero is zero unless a factor is NaN or infinite.
        if r * 0.0 + g * 0.0 + b * 0.0 + alpha * 0.0 != 0.0 {
            self.invalid_samples += 1;
            return;
        }
        let pixel = pixel as usize;
        let sum = &mut self.sums.rgba[pixel];
        sum[0] += f64::from(r);
        sum[1] += f64::from(g);
        sum[2] += f64::from(b);
        sum[3] += f64::from(alpha);
        self.sums.count[pixel] += 1;
    }

    /// Adds what the first surface of a sample looks like; `None` when it hit nothing. To be called once for each
    /// [`add`](FilmTile::add); does nothing for AOVs that nobody asked for. Non-finite values count as a miss.
    pub fn add_aovs(&mut self, pixel: u32, sample: Option<AovSample>) {
        let Some(sample) = sample else { return };
        let numbers = [sample.normal, sample.albedo];
        if !self.aovs.any()
            || !sample.depth.is_finite()
            || !numbers.as_flattened().iter().all(|v| v.is_finite())
        {
            return;
        }
        let pixel = pixel as usize;
        self.sums.hits[pixel] += 1;
        if let Some(sum) = self.sums.depth.get_mut(pixel) {
            *sum += f64::from(sample.depth);
        }
        for (list, value) in [(&mut self.sums.normal, sample.normal), (&mut self.sums.albedo, sample.albedo)]
        {
            if let Some(sum) = list.get_mut(pixel) {
                for c in 0..3 {
                    sum[c] += f64::from(value[c]);
                }
            }
        }
    }
}
