//! Estimate of the error of a picture from its samples.
//!
//! The samples of a pixel are points of one low-discrepancy sequence, so that their variance says little about the error of their mean.
//! The estimate uses the change of the mean from the first `n / 2` to all `n` samples, with `n` a power of two. The mean `M_n` is the mean
//! of the means `A` and `B` of two halves of a scrambled sequence. These are exchangeable, so `(A - B) / 2` is uncorrelated with `M_n`, and
//!
//! `E[(M_(n/2) - M_n)^2] = V_(n/2) - V_n`
//!
//! is the decrease of the variance `V` by doubling the samples (Owen 1997, "Monte Carlo variance of scrambled net quadrature"). It
//! equals `V_n` for independent samples and is up to `7 V_n` for smooth integrands. `V_n` is the sum of all further decreases, a
//! geometric series.
//!
//! Its ratio differs among pixels. It is one half where fireflies dominate, as these are independent. Elsewhere it is the ratio of the last
//! two decreases. A ratio over all pixels would depend on whether a firefly came before or after the last doubling, so the pixels with
//! the largest changes ([`TAIL`] of all) are summed apart.
//!
//! For `n < m < 2n` samples, the mean is that of `n` samples and of `m - n` others. If these were independent, its variance would be
//! `V_n (2n - m) / m` plus the expected squared change of the mean since `n`. Towards `m = 2n` they become dependent, and the squared
//! change is weighted as a decrease is. So a firefly since `n` is not missed.
//!
//! Errors are relative to the values of pixels, which are estimated as well ([`BrightestPass`]).
//!
//! Light that few paths find, which the estimate of the noise misses.
//!
//! Where a path is improbable but bright, as through glass to a small light, a picture of few samples lacks its light or has it in single
//! pixels. The variance of such pixels is that of the paths that were found, and says nothing of those that weren't. They show by what
//! the brightest pass of a pixel adds to what its other passes and its neighbours have, the excess: its largest values follow a power law,
//! `P(excess > x) ~ x^-a`, whose variance is infinite for `a < 2`. Hill's estimate (1975, "A Simple General Approach to Inference About
//! the Tail of a Distribution") of `a` from the `k` largest is `k / sum(ln(x_i / x_k))`.

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

/// Fraction of pixels, those with the largest changes, in which fireflies are assumed to dominate. A third of it or three times as much
/// changes estimates by a few percent.
const TAIL: f64 = 0.01;

/// Pixels of a run, which is summed in order, and fewest pixels of a thread.
const RUN: usize = 1 << 12;
const MIN_PER_THREAD: usize = RUN;

/// Numbers with equal bits above these (sign, exponent, two bits of the mantissa) share a bin.
const SIZE_SHIFT: u32 = 50;

/// Bytes per pixel: state, and temporary memory of an estimate.
pub(super) const BYTES_PER_PIXEL: u64 = 36 + 60;

/// State of the estimate.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Noise {
    /// Number of samples of `means`: a power of two; 0 at first.
    samples: u32,
    /// RGB means of pixels at that number of samples.
    means: Vec<[f32; 3]>,
    /// Decrease of the picture's mean squared relative error by each doubling so far.
    losses: Vec<Parts>,
    /// Current number of samples.
    now: u32,
    /// Squared relative change of the means since `means`.
    moved: Parts,
    brightest: BrightestPass,
}

/// A sum over pixels: [without the tail, the tail]; see [`TAIL`].
type Parts = [f64; 2];

impl Noise {
    /// Observes a film whose pixels all have this many samples.
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
        self.moved =
            if is_known { split(&squared_changes(&self.means, &means, &values)) } else { Parts::default() };
        if samples.is_power_of_two() {
            if self.samples * 2 == samples && is_known {
                self.losses.push(self.moved);
            }
            (self.samples, self.means, self.moved) = (samples, means, Parts::default());
        }
    }

    /// The estimated relative error of the whole picture now.
    pub fn error(&self) -> Option<f64> {
        Some(self.trend()?.0.sqrt())
    }

    /// Predicted number of samples in `taken` for this error, in whole passes; at least `least` samples are taken in all.
    pub fn samples_for(&self, error: f64, least: u32, taken: Range<u32>) -> Option<u32> {
        let (variance, ratio) = self.trend()?;
        let doublings = (error * error / variance).ln() / ratio.ln();
        // `as` saturates.
        let samples = (f64::from(self.now) * doublings.exp2()).ceil() as u32;
        let end = samples.max(least).min(taken.end).next_multiple_of(INTERVAL);
        Some(end.min(taken.end).saturating_sub(taken.start))
    }

    /// The current variance, and its ratio for twice the samples.
    fn trend(&self) -> Option<(f64, f64)> {
        let last = *self.losses.last()?;
        let before = self.losses.iter().nth_back(1).map_or(0.0, |before| before[0]);
        // After the first decrease, samples count as independent, which overestimates the error of smooth integrands.
        let ratio = if before > 0.0 {
            (last[0] / before).clamp(*RATIOS.start(), *RATIOS.end())
        } else {
            *RATIOS.end()
        };
        let ratios = [ratio, *RATIOS.end()];
        let (n, m) = (f64::from(self.samples), f64::from(self.now));
        let variances: Parts = std::array::from_fn(|i| {
            let of_loss = ratios[i] / (1.0 - ratios[i]);
            let weight = 1.0 + (of_loss - 1.0) * ((m - n) / n);
            last[i] * of_loss * ((2.0 * n - m) / m).max(0.0) + self.moved[i] * weight
        });
        let variance = variances[0] + variances[1];
        let later = variances[0] * ratios[0] + variances[1] * ratios[1];
        Some((variance, if variance > 0.0 { later / variance } else { ratio }))
    }

    /// Light of single bright paths in the picture, whose pixels have these means now.
    pub fn rare_paths(&self, means: &[[f32; 3]], width: usize) -> Option<RarePaths> {
        find(means, &self.brightest.values(means, width, self.now), width)
    }

    /// The state as bytes, for a checkpoint.
    pub fn to_bytes(&self) -> Vec<u8> {
        let BrightestPass { samples, means, sums } = &self.brightest;
        let numbers = [self.samples, self.now, *samples, self.losses.len() as u32];
        let mut bytes: Vec<u8> = numbers.into_iter().flat_map(u32::to_le_bytes).collect();
        let parts = std::iter::once(&self.moved).chain(&self.losses);
        bytes.extend(parts.flatten().flat_map(|loss| loss.to_le_bytes()));
        // A resumed picture without earlier state has means later than passes.
        let none = vec![[0.0f32; 3]; means.len() - self.means.len().min(means.len())];
        for values in [&self.means, &none, means, sums] {
            bytes.extend_from_slice(bytemuck::cast_slice(values));
        }
        bytes
    }

    /// Restores the result of [`Noise::to_bytes`] for this number of pixels; any other bytes give an empty estimate.
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
        let moved = parts.next()?;
        let values: Vec<[f32; 3]> = Some(values)
            .filter(|values| values.len() == 3 * pixels * size_of::<[f32; 3]>())
            .map(bytemuck::pod_collect_to_vec)?;
        let mut values = values.chunks_exact(pixels.max(1)).map(<[_]>::to_vec);
        let mut next = || values.next().unwrap_or_default();
        let means = Some(next()).filter(|_| samples > 0).unwrap_or_default();
        let brightest = BrightestPass { samples: passes_end, means: next(), sums: next() };
        Some(Noise { samples, means, losses: parts.collect(), now, moved, brightest })
    }
}

/// The brightest pass of each pixel.
///
/// Where fireflies dominate, a pixel's mean is no scale for its error: a firefly enlarges both. The mean without the brightest pass is a
/// robust estimate of the value. A light that covers a part of a pixel may have been hit in that pass alone, but then the pixels around
/// are as bright.
#[derive(Clone, Debug, Default, PartialEq)]
struct BrightestPass {
    /// Number of samples of the observed passes.
    samples: u32,
    /// Means of these samples.
    means: Vec<[f32; 3]>,
    /// Sums of the samples of the brightest pass.
    sums: Vec<[f32; 3]>,
}

impl BrightestPass {
    /// Observes the means of this number of samples, if a pass ends there.
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
        // A resumed picture without earlier state: the difference is no pass.
        if samples.saturating_sub(self.samples) == INTERVAL {
            let pixels = self.sums.par_iter_mut().zip(&self.means).zip(means).with_min_len(MIN_PER_THREAD);
            pixels.for_each(|((sum, before), now)| {
                *sum = std::array::from_fn(|c| sum[c].max(m * now[c] - n * before[c]));
            });
        }
        self.means.copy_from_slice(means);
        self.samples = samples;
    }

    /// Robust values of pixels: at most the mean without the brightest pass, or the second largest such mean of the eight neighbours, if
    /// that is larger.
    fn values(&self, means: &[[f32; 3]], width: usize, samples: u32) -> Vec<[f32; 3]> {
        let (m, others) = (samples as f32, samples.saturating_sub(INTERVAL).max(1) as f32);
        // One pass, or none observed: nothing to compare with.
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

/// The second largest of the values of the eight neighbours of a pixel, by channel.
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
            let (moved, value) = (f64::from(now[c]) - f64::from(before[c]), f64::from(value[c]));
            moved * moved / (value * value + FLOOR)
        });
        squares.iter().sum::<f64>() / 3.0
    });
    squares.collect()
}

/// The sum over pixels over their number, with the tail of the largest changes apart. Runs of pixels are summed in order, so that the
/// result depends neither on threads nor on the selection.
fn split(changes: &[f64]) -> Parts {
    let (count, tail) = (changes.len().max(1), (changes.len() as f64 * TAIL) as usize);
    let limit = if tail == 0 { f64::INFINITY } else { nth_smallest(changes, changes.len() - tail) };
    let sums = changes.par_chunks(RUN).map(|run| {
        let mut parts = Parts::default();
        run.iter().for_each(|&moved| parts[usize::from(moved >= limit)] += moved);
        parts
    });
    let sums: Vec<Parts> = sums.collect();
    let both = sums.into_iter().fold(Parts::default(), |a, b| [a[0] + b[0], a[1] + b[1]]);
    both.map(|sum| sum / count as f64)
}

/// The number at an index of the sorted numbers. Threads count them by bin, and only the numbers of one bin are selected from.
fn nth_smallest(numbers: &[f64], mut index: usize) -> f64 {
    // Keys have the order of the numbers.
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
        let is_there = index < count;
        if !is_there {
            index -= count;
        }
        is_there
    });
    let mut same: Vec<f64> =
        numbers.par_iter().copied().filter(|&number| Some(size(number)) == bin_of_index).collect();
    *same.select_nth_unstable_by(index, f64::total_cmp).1
}

/// Share of the pixels, those of the largest excess, that the tail index is estimated from; and the fewest.
const BRIGHT_TAIL: f64 = 0.002;
const MIN_BRIGHT: usize = 16;

/// Tail index below which paths are called rare: the variance is infinite below 2, and the estimate from few values is uncertain.
const HEAVY: f64 = 1.6;

/// Share of the picture's light above which such a tail is reported, and a single pixel whatever the tail.
const MIN_SHARE: f64 = 0.01;

/// Pixels along each side of the parts of a picture that are compared.
const PART: usize = 32;

/// Light of single bright paths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RarePaths {
    /// Its share of the light of the picture, 0 to 1.
    pub share: f64,
    /// Where most of it is: a pixel, from the upper left corner of what was rendered.
    pub pixel: [u32; 2],
    /// Estimate of the tail index of their contributions.
    pub tail_index: f64,
}

/// Looks for rare paths: `means` are the pixels, row by row, and `robust` those without the brightest pass.
pub(super) fn find(means: &[[f32; 3]], robust: &[[f32; 3]], width: usize) -> Option<RarePaths> {
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
    // Where fewer pixels have any, it is as heavy as can be.
    let logarithms: f64 = larger.iter().map(|x| (x / least).ln()).sum();
    let tail_index = if least > 0.0 { count as f64 / logarithms } else { 0.0 };
    let share = larger.iter().sum::<f64>() / light;
    let largest = larger.iter().copied().fold(0.0, f64::max) / light;
    (tail_index < HEAVY && share >= MIN_SHARE || largest >= MIN_SHARE).then(|| {
        let at = brightest(&all, width);
        RarePaths { share, pixel: [(at % width) as u32, (at / width) as u32], tail_index }
    })
}

/// The pixel of the largest excess in the part of the picture that has most of it.
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
    fn what_is_saved_comes_back() {
        let brightest =
            BrightestPass { samples: 24, means: vec![[0.3; 3]; 6], sums: vec![[2.0, 7.0, 0.1]; 6] };
        let noise = Noise {
            samples: 16,
            means: vec![[0.1, 2.0, 3.0]; 6],
            losses: vec![[0.3, 0.1], [0.2, 0.01]],
            now: 24,
            moved: [0.02, 0.03],
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

    /// Independent samples: the error falls by the root of two at each doubling, and the loss is the variance.
    #[test]
    fn of_independent_samples_the_error_is_the_last_move() {
        let losses = vec![[0.02, 0.0], [0.01, 0.0]];
        let noise = Noise { samples: 32, losses, now: 32, ..Noise::default() };
        assert!((noise.error().unwrap() - 0.1).abs() < 1e-12);
        // The mean of half as many more moves by a third of the variance, which falls by a third.
        let later = Noise { now: 48, moved: [0.01 / 3.0, 0.0], ..noise.clone() };
        assert!((later.error().unwrap().powi(2) - 0.01 / 1.5).abs() < 1e-12);
        // Four times the samples for half the error.
        assert_eq!(noise.samples_for(0.05, 0, 0..1000), Some(128));
        assert_eq!(noise.samples_for(0.05, 130, 8..1000), Some(128));
        assert_eq!(noise.samples_for(0.05, 0, 0..100), Some(100));
        // A bright sample: the error is as large as the mean moved.
        let spike = Noise { moved: [0.0, 0.25], ..later };
        assert!(spike.error().unwrap() > 0.5);
        // One decrease alone: as of independent samples.
        assert!((Noise { losses: vec![[0.01, 0.0]], ..noise.clone() }.error().unwrap() - 0.1).abs() < 1e-12);
        assert_eq!(Noise { losses: Vec::new(), ..noise }.error(), None);
    }

    /// Renders 48 x 48 pixels of independent samples between none and twice the pixel's value; `extra` is added to that of
    /// one pixel. Gives after each pass the samples, the estimated error and the true one.
    fn play(seed: u64, extra: impl Fn(u32) -> f32) -> Vec<(u32, f64, f64)> {
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

    /// The estimate for one bright sample is the same from its pass until the end.
    #[test]
    fn a_bright_sample_is_not_forgotten() {
        for (at, seed) in [(70, 1), (100, 2), (130, 3)] {
            let estimates = play(seed, |sample| if sample == at { 2000.0 } else { 0.0 });
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

    /// However many threads look, each pixel counts once and all numbers are the same.
    #[test]
    fn threads_do_not_change_the_estimate() {
        let play_on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| play(7, |sample| if sample == 90 { 700.0 } else { 0.0 }))
        };
        let one = play_on(1);
        assert!(one.len() > 10);
        assert_eq!(play_on(3), one);
        assert_eq!(play_on(40), one);
    }

    #[test]
    fn ranks_are_those_of_sorted_numbers() {
        let mut random = SplitMix64::new(5);
        let mut numbers: Vec<f64> = (0..30_000).map(|_| (random.next_unit() - 0.1).powi(7)).collect();
        numbers.extend([0.0, -0.0, f64::INFINITY, 1e-300, 1.0, 1.0]);
        let mut sorted = numbers.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        for place in [0, 1, 299, 15_000, 29_700, numbers.len() - 1] {
            assert_eq!(nth_smallest(&numbers, place).to_bits(), sorted[place].to_bits(), "{place}");
        }
        // Parts are all of it, by the places of the largest.
        let squares: Vec<f64> = numbers.iter().take(30_000).map(|n| n * n).collect();
        let (parts, count) = (split(&squares), squares.len() as f64);
        let mut largest = squares.clone();
        largest.sort_unstable_by(f64::total_cmp);
        let tail: f64 = largest[largest.len() - 300..].iter().sum();
        assert!((parts[1] - tail / count).abs() < 1e-12 * parts[1]);
        assert!((parts[0] + parts[1] - squares.iter().sum::<f64>() / count).abs() < 1e-12);
    }

    #[test]
    fn one_bright_pass_is_measured_by_the_others_or_the_neighbours() {
        let mut brightest = BrightestPass::default();
        let mut means = vec![[0.5f32; 3]; 25];
        brightest.observe(&means, 8);
        means[12] = [50.5; 3];
        brightest.observe(&means, 16);
        // The pass of eight samples added 800 to a pixel that is dark otherwise.
        let resolved = |brightest: &BrightestPass, means: &[[f32; 3]]| brightest.values(means, 5, 16)[12];
        assert!(resolved(&brightest, &means).iter().all(|v| (v - 0.5).abs() < 1e-3));
        // A lamp that lights two more around, in both passes.
        let mut lit = BrightestPass::default();
        let mut around = vec![[0.5f32; 3]; 25];
        (around[11], around[6]) = ([60.0; 3], [70.0; 3]);
        lit.observe(&around, 8);
        around[12] = [50.5; 3];
        lit.observe(&around, 16);
        assert!(resolved(&lit, &around).iter().all(|v| (v - 50.5).abs() < 1e-3));
        // Rendering that continued from a picture that was not checked.
        let mut late = BrightestPass::default();
        late.observe(&means, 64);
        assert!(late.sums.iter().flatten().all(|sum| *sum == 0.0));
    }

    const WIDTH: usize = 160;
    const HEIGHT: usize = 100;

    /// A grey picture with an excess of each pixel by a number from 0 to 1.
    fn found(seed: u64, excess: impl Fn(f64) -> f64) -> Option<RarePaths> {
        let mut random = SplitMix64::new(seed);
        let robust = vec![[0.5; 3]; WIDTH * HEIGHT];
        let mut mean = || [(0.5 + excess(random.next_unit())) as f32; 3];
        let means: Vec<[f32; 3]> = robust.iter().map(|_| mean()).collect();
        find(&means, &robust, WIDTH)
    }

    /// Power laws with their closed inverses: `x = least u^(-1 / a)`.
    #[test]
    fn heavy_tails_are_found() {
        for seed in 0..20 {
            let heavy = found(seed, |u| 0.01 * u.powf(-1.0)).expect("an infinite variance");
            assert!((0.6..1.6).contains(&heavy.tail_index) && heavy.share > 0.01, "{heavy:?}");
            assert_eq!(found(seed, |u| 0.01 * u.powf(-1.0 / 4.0)), None);
            // Exponential, as the brightest of some passes of plain noise.
            assert_eq!(found(seed, |u| -0.1 * u.ln()), None);
        }
        assert_eq!(found(1, |_| 0.0), None);
    }

    #[test]
    fn one_pixel_may_hold_too_much() {
        let robust = vec![[0.5; 3]; WIDTH * HEIGHT];
        let with = |excess: f32| {
            let mut means = robust.clone();
            means[40 * WIDTH + 30] = [0.5 + excess; 3];
            find(&means, &robust, WIDTH)
        };
        // Of 8,000 in all.
        let found = with(400.0).expect("a twentieth");
        assert!((found.share - 400.0 / 8400.0).abs() < 1e-6 && found.pixel == [30, 40], "{found:?}");
        assert_eq!(with(40.0), None);
    }

    #[test]
    fn the_place_is_where_most_of_it_is() {
        let robust = vec![[0.5; 3]; WIDTH * HEIGHT];
        let mut means = robust.clone();
        let mut random = SplitMix64::new(7);
        for (i, mean) in means.iter_mut().enumerate().filter(|(i, _)| i % 7 == 0) {
            let is_near = (i % WIDTH).abs_diff(110) < 10 && (i / WIDTH).abs_diff(70) < 10;
            let size = if is_near { 1.0 } else { 0.01 };
            *mean = [0.5 + (size * random.next_unit().powf(-1.0)) as f32; 3];
        }
        let found = find(&means, &robust, WIDTH).expect("rare paths");
        assert!(found.pixel[0].abs_diff(110) < 10 && found.pixel[1].abs_diff(70) < 10, "{found:?}");
    }

    #[test]
    fn small_and_black_pictures_have_none() {
        assert_eq!(find(&[], &[], 1), None);
        assert_eq!(find(&[[1.0; 3]; 9], &[[0.0; 3]; 9], 3), None);
        assert_eq!(find(&[[0.0; 3]; 900], &[[0.0; 3]; 900], 30), None);
    }
}
