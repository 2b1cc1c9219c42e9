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

/// Factor of `(v / r^2)^2` in the kept fraction: 0 is kept if `r^2` is below `v` times the root of this.
const CAUTION: f32 = 3.0;
/// Added to [`CAUTION`] for powers of a single pixel, divided by the number of pixels for means of several.
const CAUTION_OF_ONE: f32 = 5.0;
/// Added to [`CAUTION`] times the relative power of the noise, up to 1, since then few bright samples dominate.
const CAUTION_OF_NOISE: f32 = 12.0;
/// Added to [`CAUTION`] times the excess over 1 of the relative power of the noise in wide squares. Such light comes from few samples,
/// and pixels with one in each half buffer by chance have no apparent noise, so a few of them would pass for a detail. Their noise is
/// replaced by that of the wide square.
const CAUTION_OF_RARE: f32 = 8.0;
/// A speck, a pixel with a rare bright sample in both half buffers by chance, is assumed where the power of a pixel's residual exceeds
/// [`STANDS_OUT`] times that of its noise and of its neighbours' residuals beyond their noise, and in the wide square at least
/// [`FEWEST_RARE`] pixels with noise of a similar power, the speck's over [`RARE_FACTOR`], have most of the noise: a fraction of
/// [`SHARE_OF_RARE`], or of [`SHARE_OF_FEW`] if at most a fraction of [`MOST_RARE`] of the pixels has it. A bright sample in one half
/// buffer has a quarter of the power of one in both. In Gaussian noise 12 % of the pixels have 49 % of it, and 40 % of them 87 %.
const STANDS_OUT: f32 = 4.0;
const FEWEST_RARE: usize = 3;
const RARE_FACTOR: f32 = 16.0;
const SHARE_OF_RARE: f32 = 0.85;
const MOST_RARE: f32 = 0.12;
const SHARE_OF_FEW: f32 = 0.5;
/// Assumed power of the prediction's relative bias, summed over the channels: 0.7 % in each.
const MIN_BIAS: f32 = 3.0 * 0.007 * 0.007;
/// Level of large regions (32 x 32 pixels of the picture), whose means are kept within their noise, and [`MIN_BIAS`] from it on: 5 % in
/// each channel, by which predictions darken large regions lit by few bright samples. The noise of such means is small.
const LARGE_SCALE: u32 = 5;
const MIN_BIAS_OF_LARGE: f32 = 3.0 * 0.05 * 0.05;
/// Assumed bias of the prediction relative to the contrast around a pixel, at the finest [`SCALES`] levels, and maximum power of the
/// contrast, summed over the channels.
const SHARE_OF_CONTRAST: f32 = 0.15;
const SCALES: u32 = 2;
const LARGEST_CONTRAST: f32 = 0.3;
/// Radius of the box blur of powers, pixels of the scale, applied twice for a tent filter; where noise is little, a single blur with the
/// narrow radius.
const TENT: usize = 2;
const NARROW: usize = 1;
/// Radius of the box in which lost light is averaged, pixels of the scale.
const RADIUS: usize = 3;
/// Relative power of the noise, summed over the channels, below which noise counts as little, and the factor on the half buffers'
/// estimate as the noise goes to 0.
const LITTLE: f32 = 0.004;
const LEAST_SHARE_OF_HALVES: f32 = 1.0 / 7.0;
/// Radius of wide squares, pixels of the scale, and the fraction of their noise assumed for each of their pixels: pixels whose samples
/// are all 0 by chance have no apparent noise.
const WIDE: usize = 12;
const SHARE_OF_WIDE: f32 = 0.25;
/// Lost light (prediction minus noisy picture), relative to the prediction and summed over the channels, from which on
/// [`SHARE_OF_WIDE`] is applied in full; proportionally less for smaller losses, since pixels without a loss have been sampled.
const ALL_LOST: f32 = 3.0 * 0.3;
/// Maximum power of the noise in wide squares, a limit for fireflies: times [`SHARE_OF_WIDE`] it is the power of black pixels.
const LARGEST_WIDE: f32 = 3.0 / SHARE_OF_WIDE;
/// Radius of the squares beside a pixel that may be free of noise, pixels of the scale, at the finest level; [`QUIET_STEP`] less at each
/// coarser one, down to [`LEAST_QUIET`].
const QUIET: usize = 8;
const QUIET_STEP: usize = 2;
const LEAST_QUIET: usize = 2;
/// Factor on the power of the residual relative to that kept from coarser scales, above the inverse of which a pixel isn't taken for one
/// without noise.
const DISAGREEMENT: f32 = 2.0;
/// Number of noisy pixels expected in such a square if the noise were even, below which a square without noise is no evidence: few
/// bright samples make up the noise. Full evidence from twice this number.
const EVIDENCE: f32 = 2.0;
/// Relative values are divided by the prediction plus this fraction of the picture's mean.
const MIN: f32 = 0.02;

/// The prediction plus the significant part of the residual.
pub(super) fn restored(
    width: usize,
    height: usize,
    noisy: Color,
    mut deviation: [Vec<f32>; 3],
    predicted: [Vec<f32>; 3],
) -> [Vec<f32>; 3] {
    let mean = |plane: &&[f32]| plane.iter().map(|v| f64::from(*v)).sum::<f64>() / plane.len() as f64;
    let least = (MIN as f64 * noisy.iter().map(mean).sum::<f64>() / 3.0) as f32;
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
    /// Mean contrast; empty from level [`SCALES`] on.
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
        let contrast = match self.level + 1 < SCALES {
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
        let clean_signal = self.without_specks(&own_signal);
        let Powers { signal, noise, wide } =
            self.beside_noise(&clean_signal, &kept, self.powers(&clean_signal));
        drop(clean_signal);
        let side = |length: usize| length.min(2 * RADIUS + 1) as f32;
        let caution = CAUTION + CAUTION_OF_ONE / (side(self.width) * side(self.height));
        let bias = if self.level < LARGE_SCALE { MIN_BIAS } else { MIN_BIAS_OF_LARGE };
        // Brightness is conserved: what is left of the residual of a large region is at most its noise.
        let bound = |i: usize| match self.level < LARGE_SCALE {
            true => 0.0,
            false => 1.0 - (self.noise_at(i) / own_signal[i].max(1e-30)).sqrt(),
        };
        let share = each(signal.len(), |i| {
            let rare = (wide[i] - 1.0).max(0.0);
            let (signal, noise) = (signal[i], noise[i].max(rare));
            let ratio = noise / signal.max(1e-30);
            let of_contrast = self.contrast.get(i).map_or(0.0, |v| SHARE_OF_CONTRAST * SHARE_OF_CONTRAST * v);
            let bias = bias + of_contrast;
            let least = bias / (bias + noise);
            let caution = caution + CAUTION_OF_NOISE * noise.min(1.0) + CAUTION_OF_RARE * rare;
            (1.0 - caution * ratio * ratio).max(least).max(bound(i))
        });
        drop((own_signal, signal, noise, wide));
        for (kept, residual) in kept.iter_mut().zip(&self.residual) {
            let pixels = kept.par_iter_mut().zip(residual).zip(&share).with_min_len(MIN_PER_THREAD);
            pixels.for_each(|((kept, residual), share)| *kept += share * (residual - *kept));
        }
        kept
    }

    /// The power of the residual of each pixel; of specks that of their apparent noise.
    fn without_specks(&self, signal: &[f32]) -> Vec<f32> {
        let square = |i: usize, radius: usize| {
            let (x, y) = (i % self.width, i / self.width);
            let (from, until) = (x.saturating_sub(radius), (x + radius + 1).min(self.width));
            let rows = y.saturating_sub(radius)..(y + radius + 1).min(self.height);
            rows.flat_map(move |y| y * self.width + from..y * self.width + until)
        };
        each(signal.len(), |i| {
            let own = signal[i];
            let significant = |j: usize| signal[j] - 2.0 * self.noise_at(j);
            let neighbours = square(i, 1).filter(|j| *j != i).map(significant);
            let near = neighbours.fold(self.noise_at(i), f32::max);
            if own <= STANDS_OUT * near {
                return own;
            }
            let wide: Vec<f32> = square(i, WIDE).map(|j| self.noise_at(j)).collect();
            let rare: Vec<f32> = wide.iter().copied().filter(|noise| noise * RARE_FACTOR >= own).collect();
            let are_few = rare.len() as f32 <= MOST_RARE * wide.len() as f32;
            let share = rare.iter().sum::<f32>() / wide.iter().sum::<f32>().max(1e-30);
            let is_speck =
                rare.len() >= FEWEST_RARE && share >= if are_few { SHARE_OF_FEW } else { SHARE_OF_RARE };
            if is_speck { self.noise_at(i) } else { own }
        })
    }

    /// Local powers, from the power of the residual of each pixel.
    fn powers(&self, signal: &[f32]) -> Powers {
        let mean = |plane: &[f32], radius: usize| smoothed(self.width, self.height, plane, radius);
        let deviations = each(signal.len(), |i| self.noise_at(i));
        let noise = mean(&mean(&deviations, TENT), TENT);
        let wide = mean(&each(noise.len(), |i| noise[i].min(LARGEST_WIDE)), WIDE);
        // From 0 for little to 1 for much noise.
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
        let signal = near(mean(&mean(signal, TENT), TENT), signal);
        Powers { signal, noise, wide }
    }

    /// The local powers beside noisy objects: around a pixel of a smooth surface, they include pixels of a noisy one, whose light, kept at
    /// coarse scales, would remain as a halo. Where the residual is small beside what is kept of coarser scales (the pixel has its light),
    /// the powers are those of the least noisy square of eight that touch the pixel, unless the noise is that of few bright samples.
    fn beside_noise(&self, signal: &[f32], kept: &[Vec<f32>; 3], mut around: Powers) -> Powers {
        let radius = QUIET.saturating_sub(QUIET_STEP * self.level as usize).max(LEAST_QUIET);
        let mean = |plane: &[f32], radius: usize| smoothed(self.width, self.height, plane, radius);
        let deviations = each(signal.len(), |i| self.noise_at(i));
        let own = mean(&deviations, NARROW);
        let evidence = self.evenness(&deviations, (2 * radius + 1) * (2 * radius + 1));
        let (noise, signal) = (mean(&deviations, radius), mean(signal, radius));
        drop(deviations);
        let power = |planes: &[Vec<f32>; 3]| {
            let means = planes.each_ref().map(|plane| mean(plane, NARROW));
            each(noise.len(), |i| power_at(&means, i))
        };
        let (residual, kept) = (power(&self.residual), power(kept));
        let moved =
            |at: usize, by: isize, size: usize| at.saturating_add_signed(by * radius as isize).min(size - 1);
        let quietest = |i: usize| {
            let (x, y) = (i % self.width, i / self.width);
            let of =
                |(dx, dy): (isize, isize)| moved(y, dy, self.height) * self.width + moved(x, dx, self.width);
            AROUND.into_iter().map(of).min_by(|a, b| noise[*a].total_cmp(&noise[*b])).unwrap_or(i)
        };
        let blend = |i: usize, powers: [&mut f32; 3]| {
            let place = quietest(i);
            let quiet = noise[place].max(own[i]);
            let agreement = (1.0 - DISAGREEMENT * residual[i] / kept[i].max(1e-30)).max(0.0);
            let t = agreement * agreement * (evidence[i] / EVIDENCE - 1.0).clamp(0.0, 1.0);
            if t == 0.0 || quiet >= *powers[1] {
                return;
            }
            let beside = [signal[place], quiet, quiet.min(*powers[2])];
            for (near, beside) in powers.into_iter().zip(beside) {
                // Weighted harmonic mean.
                *near = *near * beside / ((1.0 - t) * beside + t * *near).max(1e-30);
            }
        };
        let near = around.signal.par_iter_mut().zip(&mut around.noise).zip(&mut around.wide);
        let pixels = near.enumerate().with_min_len(MIN_PER_THREAD);
        pixels.for_each(|(i, ((signal, noise), wide))| blend(i, [signal, noise, wide]));
        around
    }

    /// Expected number of noisy pixels among `pixels` of the wide square around each pixel: the squared mean of the noise over the mean of
    /// its square is the fraction of noisy pixels.
    fn evenness(&self, noise: &[f32], pixels: usize) -> Vec<f32> {
        let mean = |plane: &[f32]| smoothed(self.width, self.height, plane, WIDE);
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
const AROUND: [(isize, isize); 8] = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];

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

    /// A channel of [`restored`], for equal channels.
    fn restored_gray(size: usize, noisy: &[f32], deviation: &[f32], predicted: &[f32]) -> Vec<f32> {
        let three = |plane: &[f32]| [0; 3].map(|_| plane.to_vec());
        let [result, ..] = restored(size, size, [noisy; 3], three(deviation), three(predicted));
        result
    }

    /// Pixels with a rare bright sample in both half buffers have no apparent noise; clusters of them must not be kept as details.
    #[test]
    fn rare_bright_samples_leave_no_specks() {
        const SIZE: usize = 192;
        for seed in 0..3 {
            let [noisy, deviation] = rare_samples(SIZE, 0.065, seed);
            let result = restored_gray(SIZE, &noisy, &deviation, &vec![1.0; SIZE * SIZE]);
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
    fn specks_are_told_from_details() {
        const SIZE: usize = 192;
        let flat = vec![1.0; SIZE * SIZE];
        let is_detail = |i: usize| i % SIZE % 16 == 7 && i / SIZE % 16 == 9;
        let detailed: Vec<f32> = (0..SIZE * SIZE).map(|i| if is_detail(i) { 2.0 } else { 1.0 }).collect();
        for seed in 0..6 {
            let [noisy, deviation] = noise_with_rare_samples(&flat, 0.05, 0.01, seed);
            let specks = noisy.iter().zip(&deviation).filter(|(v, d)| **v > 3.0 && d.abs() < 0.3).count();
            let result = restored_gray(SIZE, &noisy, &deviation, &flat);
            let (least, largest) = result.iter().fold((f32::MAX, 0.0f32), |(l, h), v| (l.min(*v), h.max(*v)));
            println!("{specks} specks: {least} to {largest}");
            assert!(least > 0.8 && largest < 1.3, "{seed}: {specks} specks, {least} to {largest}");
            let [noisy, deviation] = noise_with_rare_samples(&detailed, 0.1, 0.0, seed);
            let result = restored_gray(SIZE, &noisy, &deviation, &flat);
            let kept: Vec<f32> = (0..SIZE * SIZE).filter(|i| is_detail(*i)).map(|i| result[i]).collect();
            let mean = kept.iter().sum::<f32>() / kept.len() as f32;
            println!("details: {mean}");
            assert!(mean > 1.75 && mean < 2.05, "{seed}: details of 2 have {mean}");
        }
    }

    /// The prediction invents bright spots on black, where rare samples light everything alike: the means of regions are still those of
    /// the noisy picture, within its noise.
    #[test]
    fn regions_under_an_uneven_prediction_keep_their_means() {
        const SIZE: usize = 192;
        const BLOCK: usize = 32;
        let [noisy, deviation] = rare_samples(SIZE, 0.02, 7);
        let spot = |i: usize| (i % SIZE / 5 + 3 * (i / SIZE / 7)).is_multiple_of(7);
        let predicted: Vec<f32> = (0..SIZE * SIZE).map(|i| if spot(i) { 2.0 } else { 0.02 }).collect();
        let result = restored_gray(SIZE, &noisy, &deviation, &predicted);
        for block in 0..(SIZE / BLOCK) * (SIZE / BLOCK) {
            let (x0, y0) = (block % (SIZE / BLOCK) * BLOCK, block / (SIZE / BLOCK) * BLOCK);
            let places = || (y0..y0 + BLOCK).flat_map(|y| (x0..x0 + BLOCK).map(move |x| y * SIZE + x));
            let difference: f32 = places().map(|i| result[i] - noisy[i]).sum();
            let noise = places().map(|i| deviation[i] * deviation[i]).sum::<f32>().sqrt();
            assert!(difference.abs() < 2.5 * noise, "{x0}, {y0}: {difference} +- {noise}");
        }
    }
}
