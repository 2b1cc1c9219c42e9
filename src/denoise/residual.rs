//! Errors of the network are corrected: at each scale, the residual (noisy picture minus proposal) is kept where
//! it stands out from the noise of that scale, from large scales, where noise is small, to pixels. So regions keep their
//! brightness at any number of samples, and the result tends to the noisy picture as the noise vanishes.
//!
//! This is shrinkage towards the proposal (James and Stein 1961, "Estimation with Quadratic Loss"; of wavelets, Donoho and
//! Johnstone 1995, "Adapting to Unknown Smoothness via Wavelet Shrinkage"). With `r^2` the power of the residual around a pixel
//! and `v` that of the noise, a share `max(0, 1 - 3 (v / r^2)^2)` is kept. For a proposal of squared bias `x v` whose error
//! has nothing to do with the noise, `r^2 = (1 + x) v`, and the error of the result is below `v` for all
//! `x`: it does not exceed that of the noisy picture. The square instead of James and Stein's
//! `1 - v / r^2` keeps less of what is noise by chance. But proposals follow the noise somewhat, which hides as much of their bias:
//! a share of at least `b / (b + v)` is kept, with a small bias `b` that is taken for granted. It grows with the contrast around
//! a pixel, since networks blur textures and edges.
//!
//! Where there is little noise, low-discrepancy samples of smooth integrands make it: the halves, which are less evenly spread,
//! overestimate it (`render/noise.rs`), and it differs from pixel to pixel, so that it is averaged over smaller squares.
//!
//! Scales are those of a pyramid of means of four pixels (Burt and Adelson 1983, "The Laplacian Pyramid as a Compact Image
//! Code"), of the residual relative to the proposal and weighted by it: the mean of a region is the share of light that it
//! lost, and what is dark before a bright ground stays dark. The same pyramid of the deviations measures the noise of each
//! scale, which may be correlated between pixels.

use rayon::prelude::*;
use std::ops::Deref;

/// How much more than noise a residual must be: by the root of this it is not kept at all.
const CAUTION: f32 = 3.0;
/// Added to [`CAUTION`] where powers are those of one pixel, less where they are means of several.
const CAUTION_OF_ONE: f32 = 5.0;
/// Added to [`CAUTION`] where there is more noise than light: few bright samples decide there.
const CAUTION_OF_NOISE: f32 = 12.0;
/// Added to [`CAUTION`] for each power of the noise above 1 in wide squares. Such light comes from few samples, and some pixels have
/// one in each half by chance: they show no noise, and a handful of them looks like a detail. There the noise of the wide
/// square counts in place of theirs.
const CAUTION_OF_RARE: f32 = 8.0;
/// The power of the proposal's relative bias, summed over the channels, that is taken for granted: 0.7 % of each.
const MIN_BIAS: f32 = 3.0 * 0.007 * 0.007;
/// [`MIN_BIAS`] from this scale on, where a pixel has 32 x 32 of the picture: 5 % of each channel. Proposals darken large regions by
/// as much where few samples are bright, and the noise of such means is small.
const LARGE_SCALE: u32 = 5;
const MIN_BIAS_OF_LARGE: f32 = 3.0 * 0.05 * 0.05;
/// The share of the contrast around a pixel that the proposal is taken to be off by, at the smallest [`SCALES`], and the largest
/// power of the contrast, summed over the channels.
const SHARE_OF_CONTRAST: f32 = 0.15;
const SCALES: u32 = 2;
const LARGEST_CONTRAST: f32 = 0.3;
/// Powers are averaged over squares of this radius, pixels of the scale, twice: what counts less with its distance leaves no edges. Where
/// pixels have little noise they are averaged once, over narrow squares.
const TENT: usize = 2;
const NARROW: usize = 1;
/// Radius of the squares in which light may be lost.
const RADIUS: usize = 3;
/// The relative power of the noise, summed over the channels, below which it is little, and the least share of the halves'
/// differences that it is taken for there.
const LITTLE: f32 = 0.004;
const LEAST_SHARE_OF_HALVES: f32 = 1.0 / 7.0;
/// Radius of larger squares, and the share of their noise that there is everywhere in them: samples that are all 0 by chance
/// show no noise.
const WIDE: usize = 12;
const SHARE_OF_WIDE: f32 = 0.25;
/// The light that is lost there, relative to the proposal and summed over the channels, from which on it is that much, and less of it where
/// less is lost: what has its light has been sampled.
const ALL_LOST: f32 = 3.0 * 0.3;
/// Larger powers, of fireflies, count as this, with which the share is the power of pixels that are black by chance.
const LARGEST_WIDE: f32 = 3.0 / SHARE_OF_WIDE;
/// Values are compared relative to themselves and this fraction of the picture's mean.
const MIN: f32 = 0.02;

/// The proposal plus the significant part of the residual.
pub(super) fn restored(
    width: usize,
    height: usize,
    noisy: Color,
    mut deviation: [Vec<f32>; 3],
    proposed: [Vec<f32>; 3],
) -> [Vec<f32>; 3] {
    let mean = |plane: &&[f32]| plane.iter().map(|v| f64::from(*v)).sum::<f64>() / plane.len() as f64;
    let least = (MIN as f64 * noisy.iter().map(mean).sum::<f64>() / 3.0) as f32;
    let least = least.max(1e-20);
    let residual = [0, 1, 2].map(|c| {
        let pixels = noisy[c].par_iter().zip(&proposed[c]).with_min_len(MIN_PER_THREAD);
        pixels.map(|(noisy, proposed)| (noisy - proposed) / (proposed + least)).collect::<Vec<f32>>()
    });
    for (plane, proposed) in deviation.iter_mut().zip(&proposed) {
        let pixels = plane.par_iter_mut().zip(proposed).with_min_len(MIN_PER_THREAD);
        pixels.for_each(|(v, proposed)| *v /= proposed + least);
    }
    let independent = each(width * height, |i| power_at(&deviation, i));
    let contrast = contrast(width, height, &proposed, least);
    let first = Scale {
        level: 0,
        width,
        height,
        residual,
        deviation,
        weight: proposed,
        least,
        independent,
        contrast,
    };
    let correction = first.kept();
    let mut result = first.weight;
    for (plane, correction) in result.iter_mut().zip(&correction) {
        let pixels = plane.par_iter_mut().zip(correction).with_min_len(MIN_PER_THREAD);
        pixels.for_each(|(to, k)| *to = (*to + (*to + least) * k).max(0.0));
    }
    result
}

/// The variance of the values around each pixel, relative to their power, summed over the channels.
fn contrast(width: usize, height: usize, proposed: &[Vec<f32>; 3], least: f32) -> Vec<f32> {
    let mut sum = vec![0.0f32; width * height];
    for plane in proposed {
        let values = each(width * height, |i| plane[i] + least);
        let mean = smoothed(width, height, &values, NARROW);
        let squares = each(width * height, |i| values[i] * values[i]);
        drop(values);
        let power = smoothed(width, height, &squares, NARROW);
        let pixels = sum.par_iter_mut().zip(mean.par_iter().zip(&power)).with_min_len(MIN_PER_THREAD);
        pixels.for_each(|(sum, (mean, power))| *sum += (1.0 - mean * mean / power).max(0.0));
    }
    sum.iter_mut().for_each(|v| *v = v.min(LARGEST_CONTRAST));
    sum
}

/// Sums of the pixels of a scale.
struct Scale {
    /// 0 for the pixels of the picture; a pixel of the scale has `2^level` by `2^level` of them.
    level: u32,
    width: usize,
    height: usize,
    /// Relative residuals and deviations: weighted means.
    residual: [Vec<f32>; 3],
    deviation: [Vec<f32>; 3],
    /// Sums of weights, less this number: [`Scale::weight_at`].
    weight: [Vec<f32>; 3],
    least: f32,
    /// The power of the deviations, summed over the channels, if those of pixels had nothing to do with each other.
    independent: Vec<f32>,
    /// Mean contrast; empty from [`SCALES`] on.
    contrast: Vec<f32>,
}

impl Scale {
    fn weight_at(&self, c: usize, i: usize) -> f32 {
        self.weight[c][i] + self.least
    }

    /// The next one, of half the resolution.
    fn halved(&self) -> Scale {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let sums = |value: &(dyn Fn(usize) -> f32 + Sync)| -> Vec<f32> {
            let of = |at: usize| {
                let (x, y) = (2 * (at % width), 2 * (at / width));
                let rows = y..(y + 2).min(self.height);
                let row = |y: usize| y * self.width + x..y * self.width + (x + 2).min(self.width);
                rows.map(|y| row(y).map(value).sum::<f32>()).sum()
            };
            each(width * height, of)
        };
        let of = |i: usize| self.weight_at(0, i) + self.weight_at(1, i) + self.weight_at(2, i);
        let (all, squared) = (sums(&of), sums(&|i| of(i) * of(i) * self.independent[i]));
        let independent = squared.iter().zip(&all).map(|(v, weight)| v / (weight * weight)).collect();
        let contrast = match self.level + 1 < SCALES {
            true => sums(&|i| of(i) * self.contrast[i]).iter().zip(&all).map(|(v, w)| v / w).collect(),
            false => Vec::new(),
        };
        let weight = [0, 1, 2].map(|c| sums(&|i| self.weight_at(c, i)));
        let means = |value: &[Vec<f32>; 3]| {
            [0, 1, 2].map(|c| {
                let mut plane = sums(&|i| self.weight_at(c, i) * value[c][i]);
                plane.iter_mut().zip(&weight[c]).for_each(|(v, weight)| *v /= weight);
                plane
            })
        };
        let (residual, deviation) = (means(&self.residual), means(&self.deviation));
        let level = self.level + 1;
        Scale { level, width, height, residual, deviation, weight, least: 0.0, independent, contrast }
    }

    /// The accepted residual at this scale and all larger ones.
    fn kept(&self) -> [Vec<f32>; 3] {
        let mut kept = [0, 1, 2].map(|_| vec![0.0; self.width * self.height]);
        if self.width > 1 || self.height > 1 {
            let next = self.halved();
            kept = next.kept().map(|plane| next.doubled(&plane, self.width, self.height));
        }
        let signal = each(self.width * self.height, |i| {
            (0..3).map(|c| (self.residual[c][i] - kept[c][i]) * (self.residual[c][i] - kept[c][i])).sum()
        });
        let (signal, noise, wide) = self.powers(&signal);
        let side = |length: usize| length.min(2 * RADIUS + 1) as f32;
        let caution = CAUTION + CAUTION_OF_ONE / (side(self.width) * side(self.height));
        let bias = if self.level < LARGE_SCALE { MIN_BIAS } else { MIN_BIAS_OF_LARGE };
        let share = each(signal.len(), |i| {
            let rare = (wide[i] - 1.0).max(0.0);
            let (signal, noise) = (signal[i], noise[i].max(rare));
            let ratio = noise / signal.max(1e-30);
            let of_contrast = self.contrast.get(i).map_or(0.0, |v| SHARE_OF_CONTRAST * SHARE_OF_CONTRAST * v);
            let bias = bias + of_contrast;
            let least = bias / (bias + noise);
            let caution = caution + CAUTION_OF_NOISE * noise.min(1.0) + CAUTION_OF_RARE * rare;
            (1.0 - caution * ratio * ratio).max(least)
        });
        drop((signal, noise, wide));
        for (kept, residual) in kept.iter_mut().zip(&self.residual) {
            let pixels = kept.par_iter_mut().zip(residual).zip(&share).with_min_len(MIN_PER_THREAD);
            pixels.for_each(|((kept, residual), share)| *kept += share * (residual - *kept));
        }
        kept
    }

    /// The powers of the residual and of the noise around each pixel, and that of the noise in wide squares, from the
    /// residual's of each pixel.
    fn powers(&self, signal: &[f32]) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
        let mean = |plane: &[f32], radius: usize| smoothed(self.width, self.height, plane, radius);
        let deviations = each(signal.len(), |i| power_at(&self.deviation, i).max(self.independent[i]));
        let noise = mean(&mean(&deviations, TENT), TENT);
        let wide = mean(&each(noise.len(), |i| noise[i].min(LARGEST_WIDE)), WIDE);
        let much = |wide: f32| wide / (wide + LITTLE);
        let near = |mut near: Vec<f32>, plane: &[f32]| {
            if self.level == 0 {
                let narrow = mean(plane, NARROW);
                let pixels = near.par_iter_mut().zip(&narrow).zip(&wide).with_min_len(MIN_PER_THREAD);
                pixels.for_each(|((near, narrow), wide)| *near = narrow + much(*wide) * (*near - narrow));
            }
            near
        };
        let mut noise = near(noise, &deviations);
        drop(deviations);
        let lost =
            mean(&each(signal.len(), |i| -self.residual.iter().map(|plane| plane[i]).sum::<f32>()), RADIUS);
        let pixels = noise.par_iter_mut().zip(&wide).zip(&lost).with_min_len(MIN_PER_THREAD);
        pixels.for_each(|((near, wide), lost)| {
            let much = much(*wide);
            let least = SHARE_OF_WIDE * wide * much * (lost / ALL_LOST).clamp(0.0, 1.0);
            *near = near.max(least) * (LEAST_SHARE_OF_HALVES + (1.0 - LEAST_SHARE_OF_HALVES) * much);
        });
        (near(mean(&mean(signal, TENT), TENT), signal), noise, wide)
    }

    /// A plane of this scale at the resolution of the one before: linear between the middles of its pixels.
    fn doubled(&self, plane: &[f32], width: usize, height: usize) -> Vec<f32> {
        let near = |at: usize, size: usize| {
            let other =
                if at.is_multiple_of(2) { (at / 2).saturating_sub(1) } else { (at / 2 + 1).min(size - 1) };
            (at / 2, other)
        };
        let mut out = vec![0.0; width * height];
        out.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            let (y0, y1) = near(y, self.height);
            let (near_row, far_row) = (&plane[y0 * self.width..], &plane[y1 * self.width..]);
            for (x, to) in row.iter_mut().enumerate() {
                let (x0, x1) = near(x, self.width);
                let at = |x: usize| 0.75 * near_row[x] + 0.25 * far_row[x];
                *to = 0.75 * at(x0) + 0.25 * at(x1);
            }
        });
        out
    }
}

/// Fewest pixels of a thread.
const MIN_PER_THREAD: usize = 4096;

/// A plane of values by pixel.
fn each(pixels: usize, value: impl Fn(usize) -> f32 + Sync + Send) -> Vec<f32> {
    (0..pixels).into_par_iter().with_min_len(MIN_PER_THREAD).map(value).collect()
}

/// The power of a pixel's values, summed over the channels.
fn power_at(values: &[Vec<f32>; 3], i: usize) -> f32 {
    values.iter().map(|plane| plane[i] * plane[i]).sum()
}

/// Red, green and blue of all pixels, row by row from the top.
pub type Color<'a> = [&'a [f32]; 3];

/// Three planes as a [`Color`].
pub fn slices<P: Deref<Target = [f32]>>(planes: &[P; 3]) -> [&[f32]; 3] {
    planes.each_ref().map(P::deref)
}

/// Box blur: means over squares of a radius, of the pixels inside of the picture.
pub(super) fn smoothed(width: usize, height: usize, plane: &[f32], radius: usize) -> Vec<f32> {
    let mut out = vec![0.0; width * height];
    out.par_chunks_mut(width).enumerate().for_each_init(
        || vec![0.0f32; width],
        |sums, (y, row)| {
            let (y0, y1) = (y.saturating_sub(radius), (y + radius + 1).min(height));
            sums.fill(0.0);
            for from in plane[y0 * width..y1 * width].chunks_exact(width) {
                sums.iter_mut().zip(from).for_each(|(sum, v)| *sum += v);
            }
            for (x, to) in row.iter_mut().enumerate() {
                let inside = &sums[x.saturating_sub(radius)..(x + radius + 1).min(width)];
                *to = inside.iter().sum::<f32>() / (inside.len() * (y1 - y0)) as f32;
            }
        },
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::SplitMix64;

    /// Pixels that have rare light in both halves by chance show no noise: a few of them close together are no detail.
    #[test]
    fn light_that_few_samples_find_leaves_no_specks() {
        const SIZE: usize = 192;
        const SHARE: f64 = 0.065;
        for seed in 0..3 {
            let mut random = SplitMix64::new(seed);
            let mut half = || -> Vec<f32> {
                let mut value = || if random.next_unit() < SHARE { (1.0 / SHARE) as f32 } else { 0.0 };
                (0..SIZE * SIZE).map(|_| value()).collect()
            };
            let (a, b) = (half(), half());
            let combined =
                |sign: f32| -> Vec<f32> { a.iter().zip(&b).map(|(a, b)| 0.5 * (a + sign * b)).collect() };
            let (noisy, deviation) = (combined(1.0), combined(-1.0));
            let proposed = vec![1.0; SIZE * SIZE];
            let three = |plane: &Vec<f32>| [0; 3].map(|_| plane.clone());
            let [result, ..] =
                restored(SIZE, SIZE, [&noisy; 3].map(Vec::as_slice), three(&deviation), three(&proposed));
            let (least, largest) = result.iter().fold((f32::MAX, 0.0f32), |(l, h), v| (l.min(*v), h.max(*v)));
            assert!(least > 0.7 && largest < 1.4, "{seed}: {least} to {largest}");
            let mean = |plane: &[f32]| plane.iter().sum::<f32>() / (SIZE * SIZE) as f32;
            assert!((mean(&result) - mean(&noisy)).abs() < 0.01, "{seed}: {}", mean(&result));
        }
    }
}
