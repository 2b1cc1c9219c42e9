//! Correction of the network's bias: at each scale of a pyramid, from coarse (where noise is small) to fine, the residual (noisy
//! picture minus prediction) is added back where it is significant against the noise of that scale. So regions keep their brightness
//! at any number of samples, and the result converges to the noisy picture as the noise vanishes.
//!
//! This is shrinkage towards the prediction (James, Stein 1961, "Estimation with Quadratic Loss"; for wavelets, Donoho, Johnstone 1995,
//! "Adapting to Unknown Smoothness via Wavelet Shrinkage"). With `r^2` the power of the residual around a pixel and `v` that of the
//! noise, a fraction `max(0, 1 - 3 (v / r^2)^2)` of the residual is kept. For a prediction of squared bias `x v` and an error
//! independent of the noise, `r^2 = (1 + x) v`, and the squared error of the result is below `v`, that of the noisy picture, for all
//! `x`. The square instead of James and Stein's `1 - v / r^2` keeps less random noise. But predictions follow the noise
//! somewhat, which hides part of their bias: therefore at least `b / (b + v)` is kept, with an assumed small bias `b`, which
//! grows with the contrast around a pixel, since networks blur textures and edges.
//!
//! Little noise comes from low-discrepancy samples of smooth integrands: half buffers, which are less well stratified, overestimate it
//! (`render/noise.rs`), and it varies between pixels, so it is averaged over smaller squares.
//!
//! The pyramid has means of 2x2 pixels (Burt, Adelson 1983, "The Laplacian Pyramid as a Compact Image Code") of the residual relative to
//! the prediction, weighted by the prediction: the mean of a region is its relative loss of light, and dark objects in front of a
//! bright background stay dark. The same pyramid of the deviations gives the noise of each scale, including its correlation between
//! pixels.

use rayon::prelude::*;
use std::ops::Deref;

/// Factor of `(v / r^2)^2` in the kept fraction, which is 0 if `r^2` is below `v` times the square root of this.
const SHRINKAGE: f32 = 3.0;
/// Added to [`SHRINKAGE`] for powers of a single pixel; for means over several pixels, divided by their number.
const SHRINKAGE_OF_PIXEL: f32 = 5.0;
/// Added to [`SHRINKAGE`] times the relative power of the noise, up to 1, since strong noise comes from few bright samples.
const SHRINKAGE_BY_NOISE: f32 = 12.0;
/// Added to [`SHRINKAGE`] times the excess over 1 of the relative power of the noise in wide squares. Such noise is sparse: it comes from
/// few bright samples, and pixels with one in each half buffer by chance have no apparent noise, so that some would count as details.
/// Their noise is replaced by that of the wide square.
const SHRINKAGE_BY_SPARSITY: f32 = 8.0;
/// A speck is a pixel with a rare bright sample in both half buffers by chance. It is assumed where the power of a pixel's residual is
/// more than [`MIN_SPECK_RATIO`] times that of its noise and of its neighbours' residuals beyond their noise, and most of the noise of
/// the wide square is in at least [`MIN_SPARSE_PIXELS`] pixels with noise of a similar power (the speck's over [`SPARSE_POWER_RATIO`]):
/// a fraction of [`MIN_SPARSE_FRACTION`], or of [`MIN_FRACTION_OF_FEW`] if these are at most a fraction of [`MAX_FEW_PIXELS`] of the
/// pixels. A bright sample in one half buffer has a quarter of the power of one in both. In Gaussian noise 12 % of the pixels have 49 %
/// of it, and 40 % of them 87 %.
const MIN_SPECK_RATIO: f32 = 4.0;
const MIN_SPARSE_PIXELS: usize = 3;
const SPARSE_POWER_RATIO: f32 = 16.0;
const MIN_SPARSE_FRACTION: f32 = 0.85;
const MAX_FEW_PIXELS: f32 = 0.12;
const MIN_FRACTION_OF_FEW: f32 = 0.5;
/// Assumed power of the prediction's relative bias, summed over the channels: 0.7 % in each.
const MIN_BIAS: f32 = 3.0 * 0.007 * 0.007;
/// Level of large regions, 32 x 32 pixels of the picture. From it on, the means of regions are kept within their noise, and the assumed
/// bias is 5 % in each channel instead of [`MIN_BIAS`]: predictions darken large regions lit by few bright samples.
const REGION_LEVEL: u32 = 5;
const MIN_BIAS_OF_REGIONS: f32 = 3.0 * 0.05 * 0.05;
/// Assumed bias of the prediction relative to the contrast around a pixel, at the finest [`CONTRAST_LEVELS`] levels, and maximum power
/// of the contrast, summed over the channels.
const BIAS_PER_CONTRAST: f32 = 0.15;
const CONTRAST_LEVELS: u32 = 2;
const MAX_CONTRAST: f32 = 0.3;
/// Radius of the box blur of powers, pixels of the level, applied twice for a tent filter; for low noise, a single blur with the narrow
/// radius.
const TENT_RADIUS: usize = 2;
const NARROW_RADIUS: usize = 1;
/// Radius of the box in which lost light is averaged, pixels of the level.
const LOSS_RADIUS: usize = 3;
/// Relative power of the noise, summed over the channels, below which noise counts as low, and the factor on the half buffers' estimate
/// as the noise goes to 0.
const LOW_NOISE: f32 = 0.004;
const MIN_NOISE_FACTOR: f32 = 1.0 / 7.0;
/// Radius of wide squares, pixels of the level, and the fraction of their noise assumed at least for each of their pixels: pixels whose
/// samples are all 0 by chance have no apparent noise.
const WIDE_RADIUS: usize = 12;
const MIN_FRACTION_OF_WIDE: f32 = 0.25;
/// Lost light (prediction minus noisy picture), relative to the prediction and summed over the channels, from which on
/// [`MIN_FRACTION_OF_WIDE`] applies in full; proportionally less for smaller losses, since pixels without a loss have been sampled.
const FULL_LOSS: f32 = 3.0 * 0.3;
/// Maximum power of the noise in wide squares, a limit for fireflies: times [`MIN_FRACTION_OF_WIDE`] it is the power of black pixels.
const MAX_WIDE_NOISE: f32 = 3.0 / MIN_FRACTION_OF_WIDE;
/// Radius of the squares next to a pixel that may be free of noise, pixels of the level, at the finest level; [`QUIET_STEP`] less at each
/// coarser one, down to [`MIN_QUIET_RADIUS`].
const QUIET_RADIUS: usize = 8;
const QUIET_STEP: usize = 2;
const MIN_QUIET_RADIUS: usize = 2;
/// A pixel counts as noisy if the power of its residual times this exceeds the power kept from coarser levels.
const DISAGREEMENT: f32 = 2.0;
/// A square without noise is no evidence of a smooth surface if, with evenly distributed noise, fewer noisy pixels than this were
/// expected in it: then few bright samples make up the noise. Full evidence from twice this number.
const MIN_NOISY_PIXELS: f32 = 2.0;
/// Relative values are divided by the prediction plus this fraction of the picture's mean.
const MIN_PREDICTION: f32 = 0.02;

/// The prediction plus the significant part of the residual.
pub(super) fn corrected(
    width: usize,
    height: usize,
    noisy: Color,
    mut deviation: [Vec<f32>; 3],
    predicted: [Vec<f32>; 3],
) -> [Vec<f32>; 3] {
    let mean = |plane: &&[f32]| plane.iter().map(|v| f64::from(*v)).sum::<f64>() / plane.len() as f64;
    let least = (MIN_PREDICTION as f64 * noisy.iter().map(mean).sum::<f64>() / 3.0) as f32;
    let least = least.max(1e-20);
    let residual = [0, 1, 2].map(|c| {
        let pixels = noisy[c].par_iter().zip(&predicted[c]).with_min_len(MIN_PER_THREAD);
        pixels.map(|(noisy, predicted)| (noisy - predicted) / (predicted + least)).collect::<Vec<f32>>()
    });
    for (plane, predicted) in deviation.iter_mut().zip(&predicted) {
        let pixels = plane.par_iter_mut().zip(predicted).with_min_len(MIN_PER_THREAD);
        pixels.for_each(|(v, predicted)| *v /= predicted + least);
    }
    let independent = each(width * height, |i| power_at(&deviation, i));
    let contrast = contrast(width, height, &predicted, least);
    let first = Scale {
        level: 0,
        width,
        height,
        residual,
        deviation,
        weight: predicted,
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

/// Contrast around each pixel: local variance over local power, summed over the channels.
fn contrast(width: usize, height: usize, predicted: &[Vec<f32>; 3], least: f32) -> Vec<f32> {
    let mut sum = vec![0.0f32; width * height];
    for plane in predicted {
        let values = each(width * height, |i| plane[i] + least);
        let mean = smoothed(width, height, &values, NARROW_RADIUS);
        let squares = each(width * height, |i| values[i] * values[i]);
        drop(values);
        let power = smoothed(width, height, &squares, NARROW_RADIUS);
        let pixels = sum.par_iter_mut().zip(mean.par_iter().zip(&power)).with_min_len(MIN_PER_THREAD);
        pixels.for_each(|(sum, (mean, power))| *sum += (1.0 - mean * mean / power).max(0.0));
    }
    sum.iter_mut().for_each(|v| *v = v.min(MAX_CONTRAST));
    sum
}

/// A level of the pyramid.
struct Scale {
    /// A pixel of the level covers `2^level` by `2^level` pixels of the picture.
    level: u32,
    width: usize,
    height: usize,
    /// Weighted means of relative residuals and deviations.
    residual: [Vec<f32>; 3],
    deviation: [Vec<f32>; 3],
    /// Sums of weights; `least` is to be added: see [`Scale::weight_at`].
    weight: [Vec<f32>; 3],
    least: f32,
    /// Power of the deviations, summed over the channels, if they were independent between pixels.
    independent: Vec<f32>,
    /// Mean contrast; empty from level [`CONTRAST_LEVELS`] on.
    contrast: Vec<f32>,
}

impl Scale {
    fn weight_at(&self, c: usize, i: usize) -> f32 {
        self.weight[c][i] + self.least
    }

    /// Power of a pixel's noise, summed over the channels.
    fn noise_at(&self, i: usize) -> f32 {
        power_at(&self.deviation, i).max(self.independent[i])
    }

    /// Sums over squares of 2x2 pixels, the pixels of the next level.
    fn sums(&self, value: &(dyn Fn(usize) -> f32 + Sync)) -> Vec<f32> {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let of = |at: usize| {
            let (x, y) = (2 * (at % width), 2 * (at / width));
            let rows = y..(y + 2).min(self.height);
            let row = |y: usize| y * self.width + x..y * self.width + (x + 2).min(self.width);
            rows.map(|y| row(y).map(value).sum::<f32>()).sum()
        };
        each(width * height, of)
    }

    /// Weighted means of a channel over squares of 2x2 pixels; `weight` are the sums of the weights.
    fn means(&self, c: usize, plane: &[f32], weight: &[f32]) -> Vec<f32> {
        let mut means = self.sums(&|i| self.weight_at(c, i) * plane[i]);
        means.iter_mut().zip(weight).for_each(|(v, weight)| *v /= weight);
        means
    }

    /// The next level, of half the resolution.
    fn halved(&self) -> Scale {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let of = |i: usize| self.weight_at(0, i) + self.weight_at(1, i) + self.weight_at(2, i);
        let (all, squared) = (self.sums(&of), self.sums(&|i| of(i) * of(i) * self.independent[i]));
        let independent = squared.iter().zip(&all).map(|(v, weight)| v / (weight * weight)).collect();
        let contrast = match self.level + 1 < CONTRAST_LEVELS {
            true => self.sums(&|i| of(i) * self.contrast[i]).iter().zip(&all).map(|(v, w)| v / w).collect(),
            false => Vec::new(),
        };
        let weight = [0, 1, 2].map(|c| self.sums(&|i| self.weight_at(c, i)));
        let means = |value: &[Vec<f32>; 3]| [0, 1, 2].map(|c| self.means(c, &value[c], &weight[c]));
        let (residual, deviation) = (means(&self.residual), means(&self.deviation));
        let level = self.level + 1;
        Scale { level, width, height, residual, deviation, weight, least: 0.0, independent, contrast }
    }

    /// A channel of the next level at this one's resolution. Interpolation alone would not conserve the means over squares where weights
    /// vary: their differences are interpolated and added (iterative back-projection: Irani, Peleg 1991, "Improving Resolution by
    /// Image Registration").
    fn refined(&self, next: &Scale, c: usize, plane: &[f32]) -> Vec<f32> {
        let mut fine = next.doubled(plane, self.width, self.height);
        for _ in 0..BACK_PROJECTIONS {
            let mut lost = self.means(c, &fine, &next.weight[c]);
            lost.iter_mut().zip(plane).for_each(|(mean, wanted)| *mean = wanted - *mean);
            let correction = next.doubled(&lost, self.width, self.height);
            let pixels = fine.par_iter_mut().zip(&correction).with_min_len(MIN_PER_THREAD);
            pixels.for_each(|(v, correction)| *v += correction);
        }
        fine
    }

    /// The kept residual of this level and all coarser ones.
    fn kept(&self) -> [Vec<f32>; 3] {
        let mut kept = [0, 1, 2].map(|_| vec![0.0; self.width * self.height]);
        if self.width > 1 || self.height > 1 {
            let next = self.halved();
            for (c, plane) in next.kept().iter().enumerate() {
                kept[c] = self.refined(&next, c, plane);
            }
        }
        let own_signal = each(self.width * self.height, |i| {
            (0..3).map(|c| (self.residual[c][i] - kept[c][i]) * (self.residual[c][i] - kept[c][i])).sum()
        });
        let own_noise = each(own_signal.len(), |i| self.noise_at(i));
        let clean_signal = self.without_specks(&own_signal, &own_noise);
        let powers = self.powers(&clean_signal, &own_noise);
        let Powers { signal, noise, wide } = self.without_halos(&clean_signal, &own_noise, &kept, powers);
        drop((clean_signal, own_noise));
        let side = |length: usize| length.min(2 * LOSS_RADIUS + 1) as f32;
        let shrinkage = SHRINKAGE + SHRINKAGE_OF_PIXEL / (side(self.width) * side(self.height));
        let bias = if self.level < REGION_LEVEL { MIN_BIAS } else { MIN_BIAS_OF_REGIONS };
        // Brightness is conserved: what is left of the residual of a large region is at most its noise.
        let bound = |i: usize| match self.level < REGION_LEVEL {
            true => 0.0,
            false => 1.0 - (self.noise_at(i) / own_signal[i].max(1e-30)).sqrt(),
        };
        let share = each(signal.len(), |i| {
            let rare = (wide[i] - 1.0).max(0.0);
            let (signal, noise) = (signal[i], noise[i].max(rare));
            let ratio = noise / signal.max(1e-30);
            let of_contrast = self.contrast.get(i).map_or(0.0, |v| BIAS_PER_CONTRAST * BIAS_PER_CONTRAST * v);
            let bias = bias + of_contrast;
            let least = bias / (bias + noise);
            let shrinkage = shrinkage + SHRINKAGE_BY_NOISE * noise.min(1.0) + SHRINKAGE_BY_SPARSITY * rare;
            (1.0 - shrinkage * ratio * ratio).max(least).max(bound(i))
        });
        drop((own_signal, signal, noise, wide));
        for (kept, residual) in kept.iter_mut().zip(&self.residual) {
            let pixels = kept.par_iter_mut().zip(residual).zip(&share).with_min_len(MIN_PER_THREAD);
            pixels.for_each(|((kept, residual), share)| *kept += share * (residual - *kept));
        }
        kept
    }

    /// The power of the residual of each pixel; of specks that of their apparent noise.
    fn without_specks(&self, signal: &[f32], noise: &[f32]) -> Vec<f32> {
        let square = |i: usize, radius: usize| {
            let (x, y) = (i % self.width, i / self.width);
            let (from, until) = (x.saturating_sub(radius), (x + radius + 1).min(self.width));
            let rows = y.saturating_sub(radius)..(y + radius + 1).min(self.height);
            rows.flat_map(move |y| y * self.width + from..y * self.width + until)
        };
        each(signal.len(), |i| {
            let own = signal[i];
            let significant = |j: usize| signal[j] - 2.0 * noise[j];
            let neighbours = square(i, 1).filter(|j| *j != i).map(significant);
            let near = neighbours.fold(noise[i], f32::max);
            if own <= MIN_SPECK_RATIO * near {
                return own;
            }
            let wide: Vec<f32> = square(i, WIDE_RADIUS).map(|j| noise[j]).collect();
            let rare: Vec<f32> =
                wide.iter().copied().filter(|noise| noise * SPARSE_POWER_RATIO >= own).collect();
            let are_few = rare.len() as f32 <= MAX_FEW_PIXELS * wide.len() as f32;
            let share = rare.iter().sum::<f32>() / wide.iter().sum::<f32>().max(1e-30);
            let is_speck = rare.len() >= MIN_SPARSE_PIXELS
                && share >= if are_few { MIN_FRACTION_OF_FEW } else { MIN_SPARSE_FRACTION };
            if is_speck { noise[i] } else { own }
        })
    }

    /// Local powers, from the powers of the residual and the noise of each pixel.
    fn powers(&self, signal: &[f32], own_noise: &[f32]) -> Powers {
        let mean = |plane: &[f32], radius: usize| smoothed(self.width, self.height, plane, radius);
        let noise = mean(&mean(own_noise, TENT_RADIUS), TENT_RADIUS);
        let wide = mean(&each(noise.len(), |i| noise[i].min(MAX_WIDE_NOISE)), WIDE_RADIUS);
        // From 0 for little to 1 for much noise.
        let much = |wide: f32| wide / (wide + LOW_NOISE);
        let near = |mut near: Vec<f32>, plane: &[f32]| {
            if self.level == 0 {
                let narrow = mean(plane, NARROW_RADIUS);
                let pixels = near.par_iter_mut().zip(&narrow).zip(&wide).with_min_len(MIN_PER_THREAD);
                pixels.for_each(|((near, narrow), wide)| *near = narrow + much(*wide) * (*near - narrow));
            }
            near
        };
        let mut noise = near(noise, own_noise);
        let lost = mean(
            &each(signal.len(), |i| -self.residual.iter().map(|plane| plane[i]).sum::<f32>()),
            LOSS_RADIUS,
        );
        let pixels = noise.par_iter_mut().zip(&wide).zip(&lost).with_min_len(MIN_PER_THREAD);
        pixels.for_each(|((near, wide), lost)| {
            let much = much(*wide);
            let least = MIN_FRACTION_OF_WIDE * wide * much * (lost / FULL_LOSS).clamp(0.0, 1.0);
            *near = near.max(least) * (MIN_NOISE_FACTOR + (1.0 - MIN_NOISE_FACTOR) * much);
        });
        let signal = near(mean(&mean(signal, TENT_RADIUS), TENT_RADIUS), signal);
        Powers { signal, noise, wide }
    }

    /// Avoids halos around noisy objects: the local powers of a pixel of a smooth surface include pixels of a noisy one nearby, whose
    /// light, kept at coarse scales, would remain as a halo. Where the residual is small compared with what is kept of coarser scales
    /// (the pixel has its light), the powers are replaced by those of the least noisy of eight squares that touch the pixel, unless
    /// the noise is that of few bright samples.
    fn without_halos(
        &self,
        signal: &[f32],
        own_noise: &[f32],
        kept: &[Vec<f32>; 3],
        mut around: Powers,
    ) -> Powers {
        let radius = QUIET_RADIUS.saturating_sub(QUIET_STEP * self.level as usize).max(MIN_QUIET_RADIUS);
        let mean = |plane: &[f32], radius: usize| smoothed(self.width, self.height, plane, radius);
        let own = mean(own_noise, NARROW_RADIUS);
        let evidence = self.expected_noisy_pixels(own_noise, (2 * radius + 1) * (2 * radius + 1));
        let (noise, signal) = (mean(own_noise, radius), mean(signal, radius));
        let power = |planes: &[Vec<f32>; 3]| {
            let means = planes.each_ref().map(|plane| mean(plane, NARROW_RADIUS));
            each(noise.len(), |i| power_at(&means, i))
        };
        let (residual, kept) = (power(&self.residual), power(kept));
        let moved =
            |at: usize, by: isize, size: usize| at.saturating_add_signed(by * radius as isize).min(size - 1);
        let quietest = |i: usize| {
            let (x, y) = (i % self.width, i / self.width);
            let of =
                |(dx, dy): (isize, isize)| moved(y, dy, self.height) * self.width + moved(x, dx, self.width);
            NEIGHBOURS.into_iter().map(of).min_by(|a, b| noise[*a].total_cmp(&noise[*b])).unwrap_or(i)
        };
        let blend = |i: usize, powers: [&mut f32; 3]| {
            let place = quietest(i);
            let quiet = noise[place].max(own[i]);
            let agreement = (1.0 - DISAGREEMENT * residual[i] / kept[i].max(1e-30)).max(0.0);
            let t = agreement * agreement * (evidence[i] / MIN_NOISY_PIXELS - 1.0).clamp(0.0, 1.0);
            if t == 0.0 || quiet >= *powers[1] {
                return;
            }
            let quiet = [signal[place], quiet, quiet.min(*powers[2])];
            for (near, quiet) in powers.into_iter().zip(quiet) {
                // Weighted harmonic mean.
                *near = *near * quiet / ((1.0 - t) * quiet + t * *near).max(1e-30);
            }
        };
        let near = around.signal.par_iter_mut().zip(&mut around.noise).zip(&mut around.wide);
        let pixels = near.enumerate().with_min_len(MIN_PER_THREAD);
        pixels.for_each(|(i, ((signal, noise), wide))| blend(i, [signal, noise, wide]));
        around
    }

    /// Expected number of noisy pixels among `pixels` of the wide square around each pixel: the squared mean of the noise over the mean of
    /// its square is the fraction of noisy pixels.
    fn expected_noisy_pixels(&self, noise: &[f32], pixels: usize) -> Vec<f32> {
        let mean = |plane: &[f32]| smoothed(self.width, self.height, plane, WIDE_RADIUS);
        let (means, squares) = (mean(noise), mean(&each(noise.len(), |i| noise[i] * noise[i])));
        each(noise.len(), |i| pixels as f32 * means[i] * means[i] / squares[i].max(1e-30))
    }

    /// Bilinear upsampling of a plane of this level to the resolution of the finer one.
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

/// Local powers of a level, by pixel, summed over the channels: of the residual, of the noise, and of the noise in wide squares.
struct Powers {
    signal: Vec<f32>,
    noise: Vec<f32>,
    wide: Vec<f32>,
}

/// Directions of the eight neighbours of a pixel.
const NEIGHBOURS: [(isize, isize); 8] =
    [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];

/// Rounds of back-projection: see [`Scale::refined`].
const BACK_PROJECTIONS: usize = 2;

/// Minimum number of pixels per parallel task.
const MIN_PER_THREAD: usize = 4096;

/// Computes a plane pixel by pixel.
fn each(pixels: usize, value: impl Fn(usize) -> f32 + Sync + Send) -> Vec<f32> {
    (0..pixels).into_par_iter().with_min_len(MIN_PER_THREAD).map(value).collect()
}

/// Squares of a pixel's values, summed over the channels.
fn power_at(values: &[Vec<f32>; 3], i: usize) -> f32 {
    values.iter().map(|plane| plane[i] * plane[i]).sum()
}

/// Planes of red, green and blue, row by row from the top.
pub type Color<'a> = [&'a [f32]; 3];

/// Three planes as a [`Color`].
pub fn slices<P: Deref<Target = [f32]>>(planes: &[P; 3]) -> [&[f32]; 3] {
    planes.each_ref().map(P::deref)
}

/// Box blur: means over squares of a radius in pixels, clipped to the picture.
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

    /// A square picture of mean 1 from two half buffers, in which few pixels are lit, and the deviation of the halves.
    fn rare_samples(size: usize, probability: f64, seed: u64) -> [Vec<f32>; 2] {
        let mut random = SplitMix64::new(seed);
        let mut half = || -> Vec<f32> {
            let mut value =
                || if random.next_unit() < probability { (1.0 / probability) as f32 } else { 0.0 };
            (0..size * size).map(|_| value()).collect()
        };
        let (a, b) = (half(), half());
        [1.0, -1.0].map(|sign| a.iter().zip(&b).map(|(a, b)| 0.5 * (a + sign * b)).collect())
    }

    /// A channel of [`corrected`], for equal channels.
    fn corrected_gray(size: usize, noisy: &[f32], deviation: &[f32], predicted: &[f32]) -> Vec<f32> {
        let three = |plane: &[f32]| [0; 3].map(|_| plane.to_vec());
        let [result, ..] = corrected(size, size, [noisy; 3], three(deviation), three(predicted));
        result
    }

    /// Pixels with a rare bright sample in both half buffers have no apparent noise; clusters of them must not be kept as details.
    #[test]
    fn rare_bright_samples_leave_no_specks() {
        const SIZE: usize = 192;
        for seed in 0..3 {
            let [noisy, deviation] = rare_samples(SIZE, 0.065, seed);
            let result = corrected_gray(SIZE, &noisy, &deviation, &vec![1.0; SIZE * SIZE]);
            let (least, largest) = result.iter().fold((f32::MAX, 0.0f32), |(l, h), v| (l.min(*v), h.max(*v)));
            assert!(least > 0.7 && largest < 1.4, "{seed}: {least} to {largest}");
            let mean = |plane: &[f32]| plane.iter().sum::<f32>() / (SIZE * SIZE) as f32;
            assert!((mean(&result) - mean(&noisy)).abs() < 0.01, "{seed}: {}", mean(&result));
        }
    }

    /// Noise of a normal distribution in two half buffers, and in each a bright sample at a few pixels.
    fn noise_with_rare_samples(truth: &[f32], noise: f64, probability: f64, seed: u64) -> [Vec<f32>; 2] {
        let mut random = SplitMix64::new(seed);
        let mut half = || -> Vec<f32> {
            let mut value = |truth: f32| {
                let uniform: f64 = (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
                let bright = if random.next_unit() < probability { 3.0 } else { 0.0 };
                truth * (1.0 + noise * std::f64::consts::SQRT_2 * uniform + bright) as f32
            };
            truth.iter().map(|truth| value(*truth)).collect()
        };
        let (a, b) = (half(), half());
        [1.0, -1.0].map(|sign| a.iter().zip(&b).map(|(a, b)| 0.5 * (a + sign * b)).collect())
    }

    /// In pictures of little noise, rare bright samples leave no specks either, and single pixels that differ from the prediction are
    /// kept where there are none.
    #[test]
    fn specks_are_removed_and_details_kept() {
        const SIZE: usize = 192;
        let flat = vec![1.0; SIZE * SIZE];
        let is_detail = |i: usize| i % SIZE % 16 == 7 && i / SIZE % 16 == 9;
        let detailed: Vec<f32> = (0..SIZE * SIZE).map(|i| if is_detail(i) { 2.0 } else { 1.0 }).collect();
        for seed in 0..6 {
            let [noisy, deviation] = noise_with_rare_samples(&flat, 0.05, 0.01, seed);
            let specks = noisy.iter().zip(&deviation).filter(|(v, d)| **v > 3.0 && d.abs() < 0.3).count();
            let result = corrected_gray(SIZE, &noisy, &deviation, &flat);
            let (least, largest) = result.iter().fold((f32::MAX, 0.0f32), |(l, h), v| (l.min(*v), h.max(*v)));
            println!("{specks} specks: {least} to {largest}");
            assert!(least > 0.8 && largest < 1.3, "{seed}: {specks} specks, {least} to {largest}");
            let [noisy, deviation] = noise_with_rare_samples(&detailed, 0.1, 0.0, seed);
            let result = corrected_gray(SIZE, &noisy, &deviation, &flat);
            let kept: Vec<f32> = (0..SIZE * SIZE).filter(|i| is_detail(*i)).map(|i| result[i]).collect();
            let mean = kept.iter().sum::<f32>() / kept.len() as f32;
            println!("details: {mean}");
            assert!(mean > 1.75 && mean < 2.05, "{seed}: details of 2 have {mean}");
        }
    }

    /// The prediction invents bright spots on black, where rare samples light everything evenly: the means of regions are still those of
    /// the noisy picture, within its noise.
    #[test]
    fn regions_under_an_uneven_prediction_keep_their_means() {
        const SIZE: usize = 192;
        const BLOCK: usize = 32;
        let [noisy, deviation] = rare_samples(SIZE, 0.02, 7);
        let spot = |i: usize| (i % SIZE / 5 + 3 * (i / SIZE / 7)).is_multiple_of(7);
        let predicted: Vec<f32> = (0..SIZE * SIZE).map(|i| if spot(i) { 2.0 } else { 0.02 }).collect();
        let result = corrected_gray(SIZE, &noisy, &deviation, &predicted);
        for block in 0..(SIZE / BLOCK) * (SIZE / BLOCK) {
            let (x0, y0) = (block % (SIZE / BLOCK) * BLOCK, block / (SIZE / BLOCK) * BLOCK);
            let places = || (y0..y0 + BLOCK).flat_map(|y| (x0..x0 + BLOCK).map(move |x| y * SIZE + x));
            let difference: f32 = places().map(|i| result[i] - noisy[i]).sum();
            let noise = places().map(|i| deviation[i] * deviation[i]).sum::<f32>().sqrt();
            assert!(difference.abs() < 2.5 * noise, "{x0}, {y0}: {difference} +- {noise}");
        }
    }
}
