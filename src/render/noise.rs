//! Estimate of the error of a picture from its samples.
//!
//! The samples of a pixel are points of one low-discrepancy sequence, so their variance overestimates the error of the mean. The estimate
//! uses the change of the mean from the first `n / 2` to all `n` samples, with `n` a power of two. The mean `M_n` is the mean of the means
//! `A` and `B` of two halves of a scrambled sequence. These are exchangeable, so `(A - B) / 2` is uncorrelated with `M_n`, and
//!
//! `E[(M_(n/2) - M_n)^2] = V_(n/2) - V_n`
//!
//! is the decrease of the variance `V` by doubling the samples (Owen 1997, "Monte Carlo variance of scrambled net quadrature"). It
//! equals `V_n` for independent samples and is up to `7 V_n` for smooth integrands. `V_n` is the sum of all further decreases, a
//! geometric series.
//!
//! The ratio of the series differs among pixels. It is one half where fireflies dominate, since these are independent, and elsewhere the
//! ratio of the last two decreases. A ratio over all pixels would depend on whether a firefly occurred before or after the last doubling,
//! so the pixels with the largest changes (the fraction [`TAIL`]) are summed separately.
//!
//! For `n < m < 2n` samples, the mean is that of `n` samples and `m - n` others. If these were independent, its variance would be
//! `V_n (2n - m) / m` plus the expected squared change of the mean since `n`. Towards `m = 2n` they become dependent, and the squared
//! change is weighted like a decrease. So a firefly since `n` is included.
//!
//! Errors are relative to robust estimates of the pixels' values ([`BrightestPass`]).
//!
//! Rare paths ([`RarePaths`]), which the error estimate misses: if a path is improbable but bright, as through glass to a small light, a
//! picture of few samples has its light in single pixels or not at all, and the variance of the samples doesn't include the missing paths.
//! They are detected by the excess of a pixel, the contribution of its brightest pass beyond its other passes and its neighbours: the
//! largest excesses follow a power law `P(excess > x) ~ x^-a`, whose variance is infinite for `a < 2`. Hill's estimate (1975, "A Simple
//! General Approach to Inference About the Tail of a Distribution") of `a` from the `k` largest is `k / sum(ln(x_i / x_k))`.

use crate::color::luminance;
use crate::film::Film;
use crate::integrator::reuse::INTERVAL;
use rayon::prelude::*;
use std::ops::Range;

/// Minimum number of samples for an estimate.
const MIN: u32 = 8;

/// Added to squared values, so that the relative error of black is finite.
const FLOOR: f64 = 0.01;

/// Range of the ratio of successive decreases: one half for independent samples, one eighth for smooth integrands.
const RATIOS: std::ops::RangeInclusive<f64> = 0.125..=0.5;

/// Fraction of pixels, those with the largest changes, in which fireflies are assumed to dominate. A third or three times this value
/// changes estimates by a few percent.
const TAIL: f64 = 0.01;

/// Number of pixels that one thread sums in order.
const RUN: usize = 1 << 12;
const MIN_PER_THREAD: usize = RUN;

/// Low bits of an f64 that bins ignore; sign, exponent and two bits of the mantissa remain.
const SIZE_SHIFT: u32 = 50;

/// Bytes per pixel of the state and of the temporary memory of an estimate.
pub(super) const BYTES_PER_PIXEL: u64 = 36 + 60;

/// State of the estimate.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Noise {
    /// Number of samples of `means`: a power of two; 0 at first.
    samples: u32,
    /// RGB means of pixels at that number of samples.
    means: Vec<[f32; 3]>,
    /// Decrease of the picture's mean squared relative error by each doubling so far.
    decreases: Vec<Parts>,
    /// Current number of samples.
    now: u32,
    /// Squared relative change of the means since `means`.
    change: Parts,
    brightest: BrightestPass,
}

/// Sums over the pixels outside and inside the tail; see [`TAIL`].
type Parts = [f64; 2];

impl Noise {
    /// Updates the estimate with a film whose pixels all have this many samples.
    pub fn observe(&mut self, film: &Film, samples: u32) {
        if samples < MIN {
            self.now = samples;
            return;
        }
        self.observe_means(film.means(), film.width() as usize, samples);
    }

    fn observe_means(&mut self, means: Vec<[f32; 3]>, width: usize, samples: u32) {
        self.now = samples;
        if samples < MIN {
            return;
        }
        self.brightest.observe(&means, samples);
        let is_known = self.means.len() == means.len() && self.samples < samples;
        let values = self.brightest.values(&means, width, samples);
        self.change =
            if is_known { split(&squared_changes(&self.means, &means, &values)) } else { Parts::default() };
        if samples.is_power_of_two() {
            if self.samples * 2 == samples && is_known {
                self.decreases.push(self.change);
            }
            (self.samples, self.means, self.change) = (samples, means, Parts::default());
        }
    }

    /// The estimated relative error of the whole picture.
    pub fn error(&self) -> Option<f64> {
        Some(self.trend()?.0.sqrt())
    }

    /// Predicted number of samples, within `range` and in whole passes, for this error; at least `least` in all.
    pub fn samples_for(&self, error: f64, least: u32, range: Range<u32>) -> Option<u32> {
        let (variance, ratio) = self.trend()?;
        let doublings = (error * error / variance).ln() / ratio.ln();
        // `as` saturates.
        let samples = (f64::from(self.now) * doublings.exp2()).ceil() as u32;
        let end = samples.max(least).min(range.end).next_multiple_of(INTERVAL);
        Some(end.min(range.end).saturating_sub(range.start))
    }

    /// The current variance, and the factor on it by doubling the samples.
    fn trend(&self) -> Option<(f64, f64)> {
        let last = *self.decreases.last()?;
        let before = self.decreases.iter().nth_back(1).map_or(0.0, |before| before[0]);
        // After the first decrease, samples count as independent, which overestimates the error of smooth integrands.
        let ratio = if before > 0.0 {
            (last[0] / before).clamp(*RATIOS.start(), *RATIOS.end())
        } else {
            *RATIOS.end()
        };
        let ratios = [ratio, *RATIOS.end()];
        let (n, m) = (f64::from(self.samples), f64::from(self.now));
        let variances: Parts = std::array::from_fn(|i| {
            let series = ratios[i] / (1.0 - ratios[i]);
            let weight = 1.0 + (series - 1.0) * ((m - n) / n);
            last[i] * series * ((2.0 * n - m) / m).max(0.0) + self.change[i] * weight
        });
        let variance = variances[0] + variances[1];
        let later = variances[0] * ratios[0] + variances[1] * ratios[1];
        Some((variance, if variance > 0.0 { later / variance } else { ratio }))
    }

    /// Detects rare paths in the picture with these pixel means, row-major.
    pub fn rare_paths(&self, means: &[[f32; 3]], width: usize) -> Option<RarePaths> {
        find_rare_paths(means, &self.brightest.values(means, width, self.now), width)
    }

    /// The state as bytes, for a checkpoint.
    pub fn to_bytes(&self) -> Vec<u8> {
        let BrightestPass { samples, means, sums } = &self.brightest;
        let numbers = [self.samples, self.now, *samples, self.decreases.len() as u32];
        let mut bytes: Vec<u8> = numbers.into_iter().flat_map(u32::to_le_bytes).collect();
        let parts = std::iter::once(&self.change).chain(&self.decreases);
        bytes.extend(parts.flatten().flat_map(|part| part.to_le_bytes()));
        // `self.means` is empty in a picture resumed without earlier state.
        let none = vec![[0.0f32; 3]; means.len() - self.means.len().min(means.len())];
        for values in [&self.means, &none, means, sums] {
            bytes.extend_from_slice(bytemuck::cast_slice(values));
        }
        bytes
    }

    /// Restores the state from [`Noise::to_bytes`] for this number of pixels; from other bytes, an empty state.
    pub fn restore(&mut self, bytes: &[u8], pixels: usize) {
        *self = Noise::read(bytes, pixels).unwrap_or_default();
    }

    fn read(bytes: &[u8], pixels: usize) -> Option<Noise> {
        let (head, rest) = bytes.split_at_checked(16)?;
        let [samples, now, passes_end, count] =
            [0, 4, 8, 12].map(|at| u32::from_le_bytes([0, 1, 2, 3].map(|i| head[at + i])));
        let (parts, values) = rest.split_at_checked((count as usize).checked_add(1)?.checked_mul(16)?)?;
        let number = |bytes: &[u8; 8]| f64::from_le_bytes(*bytes);
        let mut parts =
            parts.as_chunks::<8>().0.as_chunks::<2>().0.iter().map(|[a, b]| [number(a), number(b)]);
        let change = parts.next()?;
        let values: Vec<[f32; 3]> = Some(values)
            .filter(|values| values.len() == 3 * pixels * size_of::<[f32; 3]>())
            .map(bytemuck::pod_collect_to_vec)?;
        let mut values = values.chunks_exact(pixels.max(1)).map(<[_]>::to_vec);
        let mut next = || values.next().unwrap_or_default();
        let means = Some(next()).filter(|_| samples > 0).unwrap_or_default();
        let brightest = BrightestPass { samples: passes_end, means: next(), sums: next() };
        Some(Noise { samples, means, decreases: parts.collect(), now, change, brightest })
    }
}

/// The brightest pass of each pixel.
///
/// Where fireflies dominate, a pixel's mean is no suitable scale for its error, since a firefly enlarges both. The mean without the
/// brightest pass is a robust estimate of the value. A light that covers a part of a pixel may have been hit in that pass only, but then
/// neighbouring pixels are as bright.
#[derive(Clone, Debug, Default, PartialEq)]
struct BrightestPass {
    /// Number of samples at the last observed pass.
    samples: u32,
    /// Pixel means at that number of samples.
    means: Vec<[f32; 3]>,
    /// Per pixel and channel: sum of the samples of the brightest pass.
    sums: Vec<[f32; 3]>,
}

impl BrightestPass {
    /// Updates the state with the means at a number of samples, if it is the end of a pass.
    fn observe(&mut self, means: &[[f32; 3]], samples: u32) {
        if !samples.is_multiple_of(INTERVAL) {
            return;
        }
        if self.means.len() != means.len() {
            *self = BrightestPass {
                samples: 0,
                means: vec![[0.0; 3]; means.len()],
                sums: vec![[0.0; 3]; means.len()],
            };
        }
        let [n, m] = [self.samples, samples].map(|count| count as f32);
        // In a picture resumed without earlier state, the first difference is more than a pass.
        if samples.saturating_sub(self.samples) == INTERVAL {
            let pixels = self.sums.par_iter_mut().zip(&self.means).zip(means).with_min_len(MIN_PER_THREAD);
            pixels.for_each(|((sum, before), now)| {
                *sum = std::array::from_fn(|c| sum[c].max(m * now[c] - n * before[c]));
            });
        }
        self.means.copy_from_slice(means);
        self.samples = samples;
    }

    /// Robust values of pixels: the mean, but at most the mean without the brightest pass or the second largest such mean of the eight
    /// neighbours, whichever is larger.
    fn values(&self, means: &[[f32; 3]], width: usize, samples: u32) -> Vec<[f32; 3]> {
        let (m, others) = (samples as f32, samples.saturating_sub(INTERVAL).max(1) as f32);
        // At most one pass was observed.
        if samples <= INTERVAL || self.sums.len() != means.len() {
            return means.to_vec();
        }
        let without = |(now, sum): (&[f32; 3], &[f32; 3])| -> [f32; 3] {
            std::array::from_fn(|c| ((m * now[c] - sum[c]) / others).max(0.0))
        };
        let pixels = means.par_iter().zip(&self.sums).with_min_len(MIN_PER_THREAD);
        let rest: Vec<[f32; 3]> = pixels.map(without).collect();
        let value = |(at, now): (usize, &[f32; 3])| {
            let around = second_brightest_around(&rest, width, at);
            std::array::from_fn(|c| now[c].min(rest[at][c].max(around[c])))
        };
        means.par_iter().enumerate().with_min_len(MIN_PER_THREAD).map(value).collect()
    }
}

/// The second largest value of a pixel's eight neighbours, per channel.
fn second_brightest_around(values: &[[f32; 3]], width: usize, at: usize) -> [f32; 3] {
    let (x, y, height) = (at % width, at / width, values.len() / width);
    let columns = x.saturating_sub(1)..(x + 2).min(width);
    let mut most = [[f32::NEG_INFINITY; 2]; 3];
    for row in y.saturating_sub(1)..(y + 2).min(height) {
        for other in columns.clone().map(|column| row * width + column).filter(|&other| other != at) {
            for ([most, second], &value) in most.iter_mut().zip(&values[other]) {
                (*most, *second) = (most.max(value), second.max(most.min(value)));
            }
        }
    }
    most.map(|[_, second]| second)
}

/// Squared relative changes of the means of pixels; the mean over channels.
fn squared_changes(before: &[[f32; 3]], now: &[[f32; 3]], values: &[[f32; 3]]) -> Vec<f64> {
    let pixels = before.par_iter().zip(now).zip(values).with_min_len(MIN_PER_THREAD);
    let squares = pixels.map(|((before, now), value)| {
        let squares = [0, 1, 2].map(|c| {
            let (change, value) = (f64::from(now[c]) - f64::from(before[c]), f64::from(value[c]));
            change * change / (value * value + FLOOR)
        });
        squares.iter().sum::<f64>() / 3.0
    });
    squares.collect()
}

/// Sums over pixels, divided by their number, with the tail of the largest changes separate. Runs of pixels are summed in order, so that
/// the result is independent of threads.
fn split(changes: &[f64]) -> Parts {
    let (count, tail) = (changes.len().max(1), (changes.len() as f64 * TAIL) as usize);
    let limit = if tail == 0 { f64::INFINITY } else { nth_smallest(changes, changes.len() - tail) };
    let sums = changes.par_chunks(RUN).map(|run| {
        let mut parts = Parts::default();
        run.iter().for_each(|&change| parts[usize::from(change >= limit)] += change);
        parts
    });
    let sums: Vec<Parts> = sums.collect();
    let both = sums.into_iter().fold(Parts::default(), |a, b| [a[0] + b[0], a[1] + b[1]]);
    both.map(|sum| sum / count as f64)
}

/// The number at an index in sorted order. Threads build a histogram, and selection is limited to one bin.
fn nth_smallest(numbers: &[f64], mut index: usize) -> f64 {
    // Integer keys in the order of the numbers.
    let key = |number: f64| {
        let bits = number.to_bits();
        if bits >> 63 == 0 { bits | 1 << 63 } else { !bits }
    };
    let size = |number: f64| (key(number) >> SIZE_SHIFT) as usize;
    let counted = numbers.par_chunks(RUN).fold(
        || vec![0usize; 1 << (64 - SIZE_SHIFT)],
        |mut counts, run| {
            run.iter().for_each(|&number| counts[size(number)] += 1);
            counts
        },
    );
    let counts = counted.reduce(Vec::new, |mut a, b| {
        a.resize(b.len().max(a.len()), 0);
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        a
    });
    let bin_of_index = counts.iter().position(|&count| {
        let is_in_bin = index < count;
        if !is_in_bin {
            index -= count;
        }
        is_in_bin
    });
    let mut same: Vec<f64> =
        numbers.par_iter().copied().filter(|&number| Some(size(number)) == bin_of_index).collect();
    *same.select_nth_unstable_by(index, f64::total_cmp).1
}

/// Fraction of pixels, those of the largest excess, from which the tail index is estimated.
const BRIGHT_TAIL: f64 = 0.002;
/// Minimum number of these pixels.
const MIN_BRIGHT: usize = 16;

/// Tail index below which paths are rare. The variance is infinite below 2; lower, since the estimate is uncertain.
const MAX_TAIL_INDEX: f64 = 1.6;

/// Minimum fraction of the picture's light in a heavy tail, or in a single pixel, that is reported.
const MIN_SHARE: f64 = 0.01;

/// Edge of the square regions, pixels; the one with the largest excess is reported.
const PART: usize = 32;

/// Rare paths: light of single bright paths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RarePaths {
    /// Fraction of the light of the picture, 0 to 1.
    pub share: f64,
    /// A bright pixel in the region with most of this light, from the top left corner of the rendered pixels.
    pub pixel: [u32; 2],
    /// Estimated tail index of the contributions.
    pub tail_index: f64,
}

/// Detects rare paths: `means` are the pixels, row-major, and `robust` their robust values.
pub(super) fn find_rare_paths(means: &[[f32; 3]], robust: &[[f32; 3]], width: usize) -> Option<RarePaths> {
    let excess =
        |(mean, robust): (&[f32; 3], &[f32; 3])| f64::from(luminance(*mean) - luminance(*robust)).max(0.0);
    let all: Vec<f64> = means.iter().zip(robust).map(excess).collect();
    let light: f64 = means.iter().map(|mean| f64::from(luminance(*mean)).max(0.0)).sum();
    let count = ((all.len() as f64 * BRIGHT_TAIL) as usize).max(MIN_BRIGHT);
    if all.len() <= count || light <= 0.0 {
        return None;
    }
    let mut tail = all.clone();
    let (_, &mut least, larger) = tail.select_nth_unstable_by(all.len() - 1 - count, f64::total_cmp);
    // With fewer pixels of positive excess, the tail is as heavy as possible.
    let logarithms: f64 = larger.iter().map(|x| (x / least).ln()).sum();
    let tail_index = if least > 0.0 { count as f64 / logarithms } else { 0.0 };
    let share = larger.iter().sum::<f64>() / light;
    let largest = larger.iter().copied().fold(0.0, f64::max) / light;
    (tail_index < MAX_TAIL_INDEX && share >= MIN_SHARE || largest >= MIN_SHARE).then(|| {
        let at = brightest(&all, width);
        RarePaths { share, pixel: [(at % width) as u32, (at / width) as u32], tail_index }
    })
}

/// The pixel of largest excess in the region of the picture with the largest sum of excess.
fn brightest(excess: &[f64], width: usize) -> usize {
    let columns = width.div_ceil(PART);
    let part = |at: usize| at / width / PART * columns + at % width / PART;
    let mut sums = vec![0.0; excess.len().div_ceil(width).div_ceil(PART) * columns];
    excess.iter().enumerate().for_each(|(at, x)| sums[part(at)] += x);
    let most = (0..sums.len()).max_by(|&a, &b| sums[a].total_cmp(&sums[b]));
    let inside = (0..excess.len()).filter(|&at| Some(part(at)) == most);
    inside.max_by(|&a, &b| excess[a].total_cmp(&excess[b])).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::SplitMix64;

    #[test]
    fn state_round_trips_through_bytes() {
        let brightest =
            BrightestPass { samples: 24, means: vec![[0.3; 3]; 6], sums: vec![[2.0, 7.0, 0.1]; 6] };
        let noise = Noise {
            samples: 16,
            means: vec![[0.1, 2.0, 3.0]; 6],
            decreases: vec![[0.3, 0.1], [0.2, 0.01]],
            now: 24,
            change: [0.02, 0.03],
            brightest,
        };
        let mut other = Noise::default();
        other.restore(&noise.to_bytes(), 6);
        assert_eq!(other, noise);
        for length in 0..noise.to_bytes().len() {
            other.restore(&noise.to_bytes()[..length], 6);
            assert_ne!(other, noise);
        }
        other.restore(&noise.to_bytes(), 7);
        assert_eq!(other, Noise::default());
        let late = Noise { samples: 0, means: Vec::new(), ..noise };
        other.restore(&late.to_bytes(), 6);
        assert_eq!(other, late);
    }

    /// For independent samples, the error falls by the square root of two at each doubling, and the decrease equals the variance.
    #[test]
    fn error_of_independent_samples_is_the_last_change() {
        let decreases = vec![[0.02, 0.0], [0.01, 0.0]];
        let noise = Noise { samples: 32, decreases, now: 32, ..Noise::default() };
        assert!((noise.error().unwrap() - 0.1).abs() < 1e-12);
        // With half as many samples more, the squared change of the mean is a third of the variance, which falls by a third.
        let later = Noise { now: 48, change: [0.01 / 3.0, 0.0], ..noise.clone() };
        assert!((later.error().unwrap().powi(2) - 0.01 / 1.5).abs() < 1e-12);
        // Half the error takes four times the samples.
        assert_eq!(noise.samples_for(0.05, 0, 0..1000), Some(128));
        assert_eq!(noise.samples_for(0.05, 130, 8..1000), Some(128));
        assert_eq!(noise.samples_for(0.05, 0, 0..100), Some(100));
        // A firefly: the error is at least the change of the mean.
        let firefly = Noise { change: [0.0, 0.25], ..later };
        assert!(firefly.error().unwrap() > 0.5);
        // A single decrease: samples count as independent.
        assert!(
            (Noise { decreases: vec![[0.01, 0.0]], ..noise.clone() }.error().unwrap() - 0.1).abs() < 1e-12
        );
        assert_eq!(Noise { decreases: Vec::new(), ..noise }.error(), None);
    }

    /// Simulates 48 x 48 pixels with independent samples, uniform between 0 and twice the pixel's value; `extra` is added to the samples
    /// of one pixel. Returns number of samples, estimated error and true error after each pass.
    fn simulate(seed: u64, extra: impl Fn(u32) -> f32) -> Vec<(u32, f64, f64)> {
        let (width, mut random) = (48, SplitMix64::new(seed));
        let real: Vec<f32> = (0..width * width).map(|i| 0.5 + (i % 7) as f32 * 0.02).collect();
        let (mut sums, mut noise, mut estimates) = (vec![0.0f32; real.len()], Noise::default(), Vec::new());
        for sample in 0..256 {
            for (at, (sum, real)) in sums.iter_mut().zip(&real).enumerate() {
                let more = if at == 20 * width + 31 { extra(sample) } else { 0.0 };
                *sum += 2.0 * real * random.next_unit() as f32 + more;
            }
            let samples = sample + 1;
            if samples % INTERVAL == 0 {
                let means: Vec<[f32; 3]> = sums.iter().map(|sum| [sum / samples as f32; 3]).collect();
                let squares = means.iter().zip(&real).map(|(mean, real)| {
                    (f64::from(mean[0] - real) / (f64::from(*real).powi(2) + FLOOR).sqrt()).powi(2)
                });
                let error = (squares.sum::<f64>() / real.len() as f64).sqrt();
                noise.observe_means(means, width, samples);
                estimates.extend(noise.error().map(|estimated| (samples, estimated, error)));
            }
        }
        estimates
    }

    /// The estimate includes a firefly from its pass until the end.
    #[test]
    fn fireflies_are_not_forgotten() {
        for (at, seed) in [(70, 1), (100, 2), (130, 3)] {
            let estimates = simulate(seed, |sample| if sample == at { 2000.0 } else { 0.0 });
            let (before, after): (Vec<_>, Vec<_>) =
                estimates.into_iter().partition(|(samples, ..)| *samples <= at);
            assert!(before.iter().all(|(_, _, real)| *real < 0.2), "{before:?}");
            assert!(after.iter().all(|(_, _, real)| *real > 0.2), "{after:?}");
            let judged = before.into_iter().chain(after).filter(|(samples, ..)| *samples >= 64);
            for (samples, estimated, real) in judged {
                let ratio = estimated / real;
                assert!((0.85..1.2).contains(&ratio), "{samples}: {estimated} for {real}");
            }
        }
    }

    #[test]
    fn threads_do_not_change_the_estimate() {
        let simulate_on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| simulate(7, |sample| if sample == 90 { 700.0 } else { 0.0 }))
        };
        let one = simulate_on(1);
        assert!(one.len() > 10);
        assert_eq!(simulate_on(3), one);
        assert_eq!(simulate_on(40), one);
    }

    #[test]
    fn selection_matches_sorting() {
        let mut random = SplitMix64::new(5);
        let mut numbers: Vec<f64> = (0..30_000).map(|_| (random.next_unit() - 0.1).powi(7)).collect();
        numbers.extend([0.0, -0.0, f64::INFINITY, 1e-300, 1.0, 1.0]);
        let mut sorted = numbers.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        for rank in [0, 1, 299, 15_000, 29_700, numbers.len() - 1] {
            assert_eq!(nth_smallest(&numbers, rank).to_bits(), sorted[rank].to_bits(), "{rank}");
        }
        // The tail has the largest numbers, and both parts sum to the whole.
        let squares: Vec<f64> = numbers.iter().take(30_000).map(|n| n * n).collect();
        let (parts, count) = (split(&squares), squares.len() as f64);
        let mut largest = squares.clone();
        largest.sort_unstable_by(f64::total_cmp);
        let tail: f64 = largest[largest.len() - 300..].iter().sum();
        assert!((parts[1] - tail / count).abs() < 1e-12 * parts[1]);
        assert!((parts[0] + parts[1] - squares.iter().sum::<f64>() / count).abs() < 1e-12);
    }

    #[test]
    fn robust_values_use_other_passes_or_neighbours() {
        let mut brightest = BrightestPass::default();
        let mut means = vec![[0.5f32; 3]; 25];
        brightest.observe(&means, 8);
        means[12] = [50.5; 3];
        brightest.observe(&means, 16);
        // The second pass added 800 to a dark pixel.
        let resolved = |brightest: &BrightestPass, means: &[[f32; 3]]| brightest.values(means, 5, 16)[12];
        assert!(resolved(&brightest, &means).iter().all(|v| (v - 0.5).abs() < 1e-3));
        // A light that also covers two neighbours, in both passes.
        let mut lit = BrightestPass::default();
        let mut around = vec![[0.5f32; 3]; 25];
        (around[11], around[6]) = ([60.0; 3], [70.0; 3]);
        lit.observe(&around, 8);
        around[12] = [50.5; 3];
        lit.observe(&around, 16);
        assert!(resolved(&lit, &around).iter().all(|v| (v - 50.5).abs() < 1e-3));
        // Resumed without earlier state.
        let mut late = BrightestPass::default();
        late.observe(&means, 64);
        assert!(late.sums.iter().flatten().all(|sum| *sum == 0.0));
    }

    const WIDTH: usize = 160;
    const HEIGHT: usize = 100;

    /// Rare paths in a grey picture; `excess` maps a random number in 0..1 to a pixel's excess.
    fn found(seed: u64, excess: impl Fn(f64) -> f64) -> Option<RarePaths> {
        let mut random = SplitMix64::new(seed);
        let robust = vec![[0.5; 3]; WIDTH * HEIGHT];
        let mut mean = || [(0.5 + excess(random.next_unit())) as f32; 3];
        let means: Vec<[f32; 3]> = robust.iter().map(|_| mean()).collect();
        find_rare_paths(&means, &robust, WIDTH)
    }

    /// Power laws by their inverse distribution: `x = least u^(-1 / a)`.
    #[test]
    fn heavy_tails_are_found() {
        for seed in 0..20 {
            let heavy = found(seed, |u| 0.01 * u.powf(-1.0)).expect("an infinite variance");
            assert!((0.6..1.6).contains(&heavy.tail_index) && heavy.share > 0.01, "{heavy:?}");
            assert_eq!(found(seed, |u| 0.01 * u.powf(-1.0 / 4.0)), None);
            // Exponential: the maximum of passes of ordinary noise.
            assert_eq!(found(seed, |u| -0.1 * u.ln()), None);
        }
        assert_eq!(found(1, |_| 0.0), None);
    }

    #[test]
    fn a_single_bright_pixel_is_found() {
        let robust = vec![[0.5; 3]; WIDTH * HEIGHT];
        let with = |excess: f32| {
            let mut means = robust.clone();
            means[40 * WIDTH + 30] = [0.5 + excess; 3];
            find_rare_paths(&means, &robust, WIDTH)
        };
        // The total is 8,000.
        let found = with(400.0).expect("a twentieth");
        assert!((found.share - 400.0 / 8400.0).abs() < 1e-6 && found.pixel == [30, 40], "{found:?}");
        assert_eq!(with(40.0), None);
    }

    #[test]
    fn the_reported_pixel_is_in_the_brightest_region() {
        let robust = vec![[0.5; 3]; WIDTH * HEIGHT];
        let mut means = robust.clone();
        let mut random = SplitMix64::new(7);
        for (i, mean) in means.iter_mut().enumerate().filter(|(i, _)| i % 7 == 0) {
            let is_near = (i % WIDTH).abs_diff(110) < 10 && (i / WIDTH).abs_diff(70) < 10;
            let size = if is_near { 1.0 } else { 0.01 };
            *mean = [0.5 + (size * random.next_unit().powf(-1.0)) as f32; 3];
        }
        let found = find_rare_paths(&means, &robust, WIDTH).expect("rare paths");
        assert!(found.pixel[0].abs_diff(110) < 10 && found.pixel[1].abs_diff(70) < 10, "{found:?}");
    }

    #[test]
    fn small_and_black_pictures_have_no_rare_paths() {
        assert_eq!(find_rare_paths(&[], &[], 1), None);
        assert_eq!(find_rare_paths(&[[1.0; 3]; 9], &[[0.0; 3]; 9], 3), None);
        assert_eq!(find_rare_paths(&[[0.0; 3]; 900], &[[0.0; 3]; 900], 30), None);
    }
}
