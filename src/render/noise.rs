//! How noisy a picture is: an estimate of its error from what its samples show.
//!
//! Samples of a pixel are points of one well spread sequence, so that their variance says little about the error of their mean.
//! What tells is how far the mean still moves: the means of the first `n / 2` and of all `n` samples, where `n` is a power of
//! two. Runs of a scrambled sequence of such lengths are complementary: the mean of `n` samples is the mean of two halves `A`
//! and `B` that are exchangeable, so that `(A - B) / 2` is uncorrelated with it, and
//!
//! `E[(M_(n/2) - M_n)^2] = V_(n/2) - V_n`
//!
//! is what the variance `V` loses by doubling the samples (Owen 1997, "Monte Carlo variance of scrambled net quadrature":
//! scrambled nets have a variance for each such block). For independent samples that is `V_n` itself; for smooth integrands it
//! is more, up to `7 V_n`. So what is left, `V_n`, is the sum of all further losses, which fall by a factor each time that the
//! samples are doubled: the factor that the last two losses show, of the whole picture.
//!
//! Between two such numbers, `n < m < 2n`, the mean of `m` samples is that of `n` and of `m - n` others. Were these independent,
//! its variance would be `V_n (2n - m) / m` and the expected square of how far the mean moved since `n`. They are the less so,
//! the nearer `m` is to `2n`: there, the square counts as a loss does. So a bright sample that came since then is not missed.

use crate::film::Film;
use crate::integrator::reuse::INTERVAL;
use std::ops::Range;

/// Samples below which nothing is estimated.
const LEAST: u32 = 8;

/// What is added to squares of values so that black has a relative error.
const FLOOR: f64 = 0.01;

/// How losses fall when the samples are doubled: by half where samples are as good as independent, by an eighth at best.
const RATIOS: std::ops::RangeInclusive<f64> = 0.125..=0.5;

/// What estimates go by.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Noise {
    /// Samples that the means are of: a power of two; 0 before there are any.
    samples: u32,
    /// The means then, red, green and blue, pixel by pixel.
    means: Vec<[f32; 3]>,
    /// What the whole picture's mean squared relative error lost by each doubling so far.
    losses: Vec<f64>,
    /// Samples now.
    now: u32,
    /// By how much the means have moved since they were taken down: as a loss is measured.
    moved: f64,
}

impl Noise {
    /// Takes down a film whose pixels all have so many samples.
    pub fn observe(&mut self, film: &Film, samples: u32) {
        self.now = samples;
        if samples < LEAST {
            return;
        }
        let means: Vec<[f32; 3]> = film.rgba().into_iter().map(|[r, g, b, _]| [r, g, b]).collect();
        let is_known = self.means.len() == means.len() && self.samples < samples;
        let (width, numbers) = (film.width() as usize, [self.samples, samples]);
        let moments = Moments { before: &self.means, now: &means, samples: numbers, width };
        self.moved = if is_known { moments.loss() } else { 0.0 };
        if samples.is_power_of_two() {
            if self.samples * 2 == samples && is_known {
                self.losses.push(self.moved);
            }
            (self.samples, self.means, self.moved) = (samples, means, 0.0);
        }
    }

    /// The estimated relative error of the whole picture now.
    pub fn error(&self) -> Option<f64> {
        Some(self.trend()?.0.sqrt())
    }

    /// About how many of the samples that may be taken it takes to get to this error, if it goes on falling as it did, in whole
    /// passes; `least` of all are taken anyway.
    pub fn samples_for(&self, error: f64, least: u32, taken: Range<u32>) -> Option<u32> {
        let (variance, ratio) = self.trend()?;
        let doublings = (error * error / variance).ln() / ratio.ln();
        // `as` saturates.
        let samples = (f64::from(self.now) * doublings.exp2()).ceil() as u32;
        let end = samples.max(least).min(taken.end).next_multiple_of(INTERVAL);
        Some(end.min(taken.end).saturating_sub(taken.start))
    }

    /// The variance now, and by what it falls when the samples are doubled.
    fn trend(&self) -> Option<(f64, f64)> {
        let [.., before, last] = self.losses[..] else { return None };
        let ratio = if before > 0.0 { (last / before).clamp(*RATIOS.start(), *RATIOS.end()) } else { 0.5 };
        let of_loss = ratio / (1.0 - ratio);
        let (n, m) = (f64::from(self.samples), f64::from(self.now));
        let weight = 1.0 + (of_loss - 1.0) * ((m - n) / n);
        Some((last * of_loss * ((2.0 * n - m) / m).max(0.0) + self.moved * weight, ratio))
    }

    /// All of it, for a file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        bytes.extend(
            [self.samples, self.now, self.losses.len() as u32].into_iter().flat_map(u32::to_le_bytes),
        );
        bytes.extend(self.moved.to_le_bytes());
        bytes.extend(self.losses.iter().flat_map(|loss| loss.to_le_bytes()));
        bytes.extend_from_slice(bytemuck::cast_slice(&self.means));
        bytes
    }

    /// Goes on from what [`Noise::to_bytes`] gave for so many pixels; begins anew with anything else.
    pub fn go_on(&mut self, bytes: &[u8], pixels: usize) {
        *self = Noise::read(bytes, pixels).unwrap_or_default();
    }

    fn read(bytes: &[u8], pixels: usize) -> Option<Noise> {
        let (head, rest) = bytes.split_at_checked(12)?;
        let (moved, rest) = rest.split_first_chunk::<8>()?;
        let [samples, now, count] =
            [0, 4, 8].map(|at| u32::from_le_bytes([0, 1, 2, 3].map(|i| head[at + i])));
        let (losses, means) = rest.split_at_checked((count as usize).checked_mul(8)?)?;
        let losses = losses.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        let means: Vec<[f32; 3]> = bytemuck::try_cast_slice::<u8, u8>(means)
            .ok()
            .filter(|means| means.len() == pixels * size_of::<[f32; 3]>() || means.is_empty())
            .map(bytemuck::pod_collect_to_vec)?;
        Some(Noise { samples, means, losses, now, moved: f64::from_le_bytes(*moved) })
    }
}

/// Means of pixels at two moments, and of how many samples they are.
struct Moments<'a> {
    before: &'a [[f32; 3]],
    now: &'a [[f32; 3]],
    samples: [u32; 2],
    width: usize,
}

impl Moments<'_> {
    /// The mean over pixels and colours of how far means moved, relative to the values.
    fn loss(&self) -> f64 {
        let height = self.now.len() / self.width.max(1);
        let mut sum = 0.0;
        for y in 0..height {
            let mut of_row = 0.0;
            for x in 0..self.width {
                let at = y * self.width + x;
                let value = self.settled(x, y);
                for (c, value) in value.into_iter().enumerate() {
                    let moved = f64::from(self.now[at][c]) - f64::from(self.before[at][c]);
                    of_row += moved * moved / (value * value + FLOOR);
                }
            }
            sum += of_row;
        }
        sum / (3 * self.now.len()).max(1) as f64
    }

    /// The value of a pixel, as far as its neighbours or its later samples bear it out: within the range of the eight around it,
    /// their outermost left out, and of the means of its earlier and its later samples. A pixel that one bright sample decides would
    /// have a small relative error else.
    fn settled(&self, x: usize, y: usize) -> [f64; 3] {
        let (width, height) = (self.width, self.now.len() / self.width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let (mut low, mut high) = ([[f32::INFINITY; 2]; 3], [[f32::NEG_INFINITY; 2]; 3]);
        for (row, column) in rows.flat_map(|row| columns.clone().map(move |column| (row, column))) {
            if (column, row) == (x, y) {
                continue;
            }
            for (c, &value) in self.now[row * width + column].iter().enumerate() {
                let [least, second] = &mut low[c];
                (*least, *second) = (least.min(value), second.min(least.max(value)));
                let [most, second] = &mut high[c];
                (*most, *second) = (most.max(value), second.max(most.min(value)));
            }
        }
        let at = y * width + x;
        let [n, m] = self.samples.map(f64::from);
        std::array::from_fn(|c| {
            let (own, earlier) = (f64::from(self.now[at][c]), f64::from(self.before[at][c]));
            let later = (m * own - n * earlier) / (m - n);
            let (low, high) = (f64::from(low[c][1]), f64::from(high[c][1]));
            let (low, high) = (low.min(earlier.max(later)), high.max(earlier.min(later)));
            if low <= high { own.clamp(low, high) } else { own }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_saved_comes_back() {
        let noise = Noise {
            samples: 16,
            means: vec![[0.1, 2.0, 3.0]; 6],
            losses: vec![0.3, 0.1],
            now: 24,
            moved: 0.02,
        };
        let mut other = Noise::default();
        other.go_on(&noise.to_bytes(), 6);
        assert_eq!(other, noise);
        for length in 0..noise.to_bytes().len() {
            other.go_on(&noise.to_bytes()[..length], 6);
            assert_ne!(other, noise);
        }
        other.go_on(&noise.to_bytes(), 7);
        assert_eq!(other, Noise::default());
    }

    /// Independent samples: the error falls by the root of two at each doubling, and the loss is the variance.
    #[test]
    fn of_independent_samples_the_error_is_the_last_move() {
        let noise = Noise { samples: 32, means: Vec::new(), losses: vec![0.02, 0.01], now: 32, moved: 0.0 };
        assert!((noise.error().unwrap() - 0.1).abs() < 1e-12);
        // The mean of half as many more moves by a third of the variance, which falls by a third.
        let later = Noise { now: 48, moved: 0.01 / 3.0, ..noise.clone() };
        assert!((later.error().unwrap().powi(2) - 0.01 / 1.5).abs() < 1e-12);
        // Four times the samples for half the error.
        assert_eq!(noise.samples_for(0.05, 0, 0..1000), Some(128));
        assert_eq!(noise.samples_for(0.05, 130, 8..1000), Some(128));
        assert_eq!(noise.samples_for(0.05, 0, 0..100), Some(100));
        // A bright sample: the error is as large as the mean moved.
        let spike = Noise { moved: 0.25, ..later };
        assert!(spike.error().unwrap() > 0.5);
        assert_eq!(Noise { losses: vec![0.01], ..noise }.error(), None);
    }

    #[test]
    fn one_bright_pixel_is_measured_by_its_neighbours() {
        let mut now = vec![[0.5f32; 3]; 25];
        now[12] = [100.0; 3];
        now[11] = [90.0; 3];
        let mut before = vec![[0.5f32; 3]; 25];
        let settled = |before: &[[f32; 3]], x, y| {
            Moments { before, now: &now, samples: [32, 64], width: 5 }.settled(x, y)
        };
        assert_eq!(settled(&before, 2, 2), [0.5; 3]);
        assert_eq!(settled(&before, 0, 0), [0.5; 3]);
        // A small lamp is as bright in the later samples as in the earlier ones.
        before[12] = [98.0; 3];
        assert_eq!(settled(&before, 2, 2), [98.0; 3]);
    }
}
