//! Error of the denoised picture, measured against independent reference pictures.
//!
//! For some squares of pixels, two reference pictures `X` and `Y` are rendered, with other seeds and as many samples as the picture
//! has. Their noise is independent of each other and of the denoised picture `D`, so that
//!
//! `E[(D - X) (D - Y)] = E[(D - T)^2]`
//!
//! with the converged picture `T`, for any denoiser: bias, lost detail and remaining noise are all included. The bound is the mean over
//! the squares plus [`MARGIN`] times its standard error, which follows from the variance between squares. Light that no sample has found
//! is missing in all three pictures: see `noise.rs` for rare paths.
//!
//! A few bright samples in `X` or `Y` would dominate the mean of the products. Values of both are clamped to [`BRIGHTEST`] times the
//! brightness around the pixel. If the denoiser kept the clamped light in `D`, this enlarges the measured error.

use super::options::RenderOptions;
use super::progress::new_task_group;
use super::schedule::{SAMPLE_BLOCK, whole_blocks};
use super::technique::{Stopped, Trial};
use crate::film::Splat;
use crate::integrator::{Block, CausticPlan, Integrator, IntegratorOptions, WAVE};
use crate::output::part::Region;
use crate::sampling::hash::hash32;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;

/// Edge of the squares, pixels.
const EDGE: u32 = 8;
/// Number of squares as a fraction of those of the whole picture; a few more in small pictures, whose error is less certain.
const SHARE: f64 = 1.0 / 32.0;
const MIN_SQUARES: usize = 64;
const MAX_SHARE: f64 = 0.25;
/// Number of standard errors that the bound adds to the mean.
const MARGIN: f64 = 1.5;
/// Maximum pixel value of a reference picture, relative to the brightness around the pixel plus [`DARK`].
const BRIGHTEST: f64 = 10.0;
const DARK: f64 = 0.02;
/// Added to squared values, so that the relative error of black is finite.
const FLOOR: f64 = 0.01;
/// Minimum number of samples per pixel for a measurement.
const MIN_SAMPLES: u32 = 16;
/// Range of the number of samples of the next measurement, relative to the last one. The squared error falls at least as slowly as one
/// over the number of samples, so it is extrapolated by that.
const NEXT: [f64; 2] = [1.25, 4.0];
/// Decorrelates the squares and the reference pictures from the picture.
const SEED: u32 = 0x7f4a_7c15;

/// A square of pixels, and the sums of its samples in both reference pictures.
struct Square {
    block: Block,
    sums: [Vec<[f64; 3]>; 2],
}

impl Square {
    fn new(block: Block) -> Square {
        let sums = vec![[0.0; 3]; (block.width * block.height) as usize];
        Square { block, sums: [sums.clone(), sums] }
    }

    fn add(&mut self, number: usize, pixel: usize, rgb: [f32; 3], weight: f64) {
        if rgb.iter().all(|v| v.is_finite()) {
            let sum = &mut self.sums[number][pixel];
            (0..3).for_each(|c| sum[c] += weight * f64::from(rgb[c]));
        }
    }
}

/// Measurements of the denoised picture's error.
pub(super) struct Validation {
    squares: Vec<Square>,
    /// Number of samples per pixel of the reference pictures.
    samples: u32,
    /// Number of samples per pixel at which the next measurement is due.
    next: u32,
    /// Bound of the squared relative error, by the last measurement.
    bound: Option<f64>,
}

impl Validation {
    pub fn new(options: &RenderOptions) -> Validation {
        let squares = blocks(options).into_iter().map(Square::new).collect();
        Validation { squares, samples: 0, next: MIN_SAMPLES, bound: None }
    }

    /// Number of samples per pixel at which the next measurement is due.
    pub fn next(&self) -> u32 {
        self.next
    }

    /// Continues a rendering whose next measurement was due at this number of samples.
    pub fn resume(&mut self, next: u32) {
        self.next = next.max(MIN_SAMPLES);
    }

    /// The bound of the relative error, by the last measurement.
    pub fn error(&self) -> Option<f64> {
        self.bound.map(f64::sqrt)
    }

    /// Is a measurement due at this number of samples per pixel? Only after whole blocks of samples, and at the last sample.
    pub fn is_due(&self, samples: u32, is_last: bool) -> bool {
        samples >= MIN_SAMPLES && (is_last || samples >= self.next && samples.is_multiple_of(SAMPLE_BLOCK))
    }

    /// Options of the reference pictures: their seeds differ.
    pub fn options(options: &RenderOptions) -> [RenderOptions; 2] {
        [1, 2].map(|number: u32| options.seed(hash32(options.seed ^ SEED.wrapping_mul(number))))
    }

    /// Renders the samples of a reference picture (0 or 1) before `until`.
    pub fn render(&mut self, number: usize, until: u32, trial: &Trial<'_>) -> Result<(), Stopped> {
        let from = self.samples;
        if let Some(plan) = trial.paths.caustics {
            let seeded = plan.clone().with_seed(trial.target.options.seed);
            self.add_light_paths(number, from..until, trial, &seeded)?;
        }
        let integrator = Integrator::new(trial.target.scene, trial.target.view, trial.paths.clone());
        let group = new_task_group();
        let trace = |square: &mut Square| {
            trial.run(("validation", group), trial.stop, |workspace| {
                let mut starts = (from..until).step_by(SAMPLE_BLOCK as usize);
                let is_done = starts.all(|first_sample| {
                    let samples = SAMPLE_BLOCK.min(until - first_sample);
                    let block = Block { first_sample, samples, ..square.block };
                    integrator.trace(&block, workspace, &trial.stop, |sample| {
                        square.add(number, sample.pixel as usize, sample.rgb, 1.0);
                    })
                });
                is_done.then_some(())
            })
        };
        self.squares.par_iter_mut().map(trace).collect()
    }

    /// Traces light paths for one sample of each block and weights them by the block's number of samples.
    fn add_light_paths(
        &mut self,
        number: usize,
        samples: Range<u32>,
        trial: &Trial<'_>,
        plan: &CausticPlan,
    ) -> Result<(), Stopped> {
        let paths = IntegratorOptions { caustics: Some(plan), ..trial.paths.clone() };
        let integrator = Integrator::new(trial.target.scene, trial.target.view, paths);
        let (group, pixels) = (new_task_group(), self.pixels());
        let traced = samples.clone().step_by(SAMPLE_BLOCK as usize);
        let starts = || (0..plan.paths()).step_by(WAVE);
        let waves: Vec<(u32, u32)> = traced.flat_map(|s| starts().map(move |start| (s, start))).collect();
        let trace = |&(sample, start): &(u32, u32)| {
            trial.run(("validation", group), trial.stop, |workspace| {
                let mut splats = Vec::new();
                let paths = start..plan.paths().min(start.saturating_add(WAVE as u32));
                integrator.trace_light_paths(sample, paths, workspace, &mut splats);
                splats.retain(|splat| pixels.contains_key(&(splat.x, splat.y)));
                Some((f64::from(SAMPLE_BLOCK.min(samples.end - sample)), splats))
            })
        };
        let traced: Vec<(f64, Vec<Splat>)> = waves.par_iter().map(trace).collect::<Result<_, Stopped>>()?;
        for (weight, splats) in &traced {
            for splat in splats {
                if let Some(&(square, pixel)) = pixels.get(&(splat.x, splat.y)) {
                    self.squares[square].add(number, pixel, splat.rgb, *weight);
                }
            }
        }
        Ok(())
    }

    /// Square and index of each pixel.
    fn pixels(&self) -> HashMap<(u32, u32), (usize, usize)> {
        let of_square = |(square, Square { block, .. }): (usize, &Square)| {
            let Block { x0, y0, width, height, .. } = *block;
            let pixels = (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
            pixels.map(move |(x, y)| ((x0 + x, y0 + y), (square, (y * width + x) as usize)))
        };
        self.squares.iter().enumerate().flat_map(of_square).collect()
    }

    /// Compares the denoised picture of a region with both reference pictures, which have `samples` samples per pixel. Plans the next
    /// measurement for when the squared error may have fallen to `wanted`.
    pub fn measure(&mut self, denoised: [&[f32]; 3], region: Region, samples: u32, wanted: f64) {
        self.samples = samples;
        let picture = Picture { planes: denoised, region };
        let products: Vec<(f64, f64)> =
            self.squares.par_iter().map(|square| square.squared_error(&picture, samples)).collect();
        let pixels: f64 = products.iter().map(|(_, pixels)| pixels).sum();
        let mean = products.iter().map(|(sum, _)| sum).sum::<f64>() / pixels.max(1.0);
        let spread: f64 = products.iter().map(|(sum, pixels)| (sum - mean * pixels).powi(2)).sum();
        let bound = mean.max(0.0) + MARGIN * spread.sqrt() / pixels.max(1.0);
        self.bound = Some(bound);
        let factor = (bound / wanted).clamp(NEXT[0], NEXT[1]);
        // `as` saturates.
        self.next = whole_blocks((f64::from(samples) * factor) as u32);
    }
}

/// A denoised picture.
struct Picture<'a> {
    planes: [&'a [f32]; 3],
    region: Region,
}

impl Picture<'_> {
    /// The value of a pixel, and the mean of its neighbours.
    fn value_and_surroundings(&self, c: usize, x: u32, y: u32) -> (f64, f64) {
        let (x, y) = (x - self.region.x0, y - self.region.y0);
        let (width, height) = (self.region.width(), self.region.height());
        let at = |x: u32, y: u32| f64::from(self.planes[c][y as usize * width as usize + x as usize]);
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let count = columns.len() * rows.len() - 1;
        let sum: f64 = rows.flat_map(|y| columns.clone().map(move |x| at(x, y))).sum();
        let own = at(x, y);
        (own, (sum - own) / count.max(1) as f64)
    }
}

impl Square {
    /// Sum over the pixels of the estimated squared relative error, the mean of the channels, and the number of pixels.
    fn squared_error(&self, picture: &Picture<'_>, samples: u32) -> (f64, f64) {
        let Block { x0, y0, width, .. } = self.block;
        let [first, second] = &self.sums;
        let mut sum = 0.0;
        for (pixel, (a, b)) in first.iter().zip(second).enumerate() {
            let (x, y) = (x0 + pixel as u32 % width, y0 + pixel as u32 / width);
            for c in 0..3 {
                let (value, around) = picture.value_and_surroundings(c, x, y);
                let largest = BRIGHTEST * (value.max(around) + DARK);
                let [a, b] = [a[c], b[c]].map(|sum| (sum / f64::from(samples)).min(largest));
                // Remaining fireflies are brighter than their neighbours.
                let scale = value.min(around);
                sum += (value - a) * (value - b) / (scale * scale + FLOOR) / 3.0;
            }
        }
        (sum, first.len() as f64)
    }
}

/// The squares: one at random from each of equal parts of the list of all squares (stratified).
fn blocks(options: &RenderOptions) -> Vec<Block> {
    let Region { x0, y0, x1, y1 } = options.pixels();
    let columns = (x1 - x0).div_ceil(EDGE);
    let all = columns as usize * (y1 - y0).div_ceil(EDGE) as usize;
    let most = ((all as f64 * MAX_SHARE) as usize).max(1);
    let count = ((all as f64 * SHARE) as usize).max(MIN_SQUARES).min(most);
    let chosen = (0..count).map(|i| {
        let (from, until) = (i * all / count, (i + 1) * all / count);
        let random = hash32(options.seed ^ SEED ^ hash32(i as u32)) as usize;
        (from + random % (until - from).max(1)) as u32
    });
    let block = |square: u32| {
        let (x, y) = (x0 + square % columns * EDGE, y0 + square / columns * EDGE);
        let (width, height) = (EDGE.min(x1 - x), EDGE.min(y1 - y));
        Block { x0: x, y0: y, width, height, first_sample: 0, samples: 0 }
    };
    chosen.map(block).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::SplitMix64;

    const WIDTH: u32 = 256;
    const HEIGHT: u32 = 128;

    /// The bound for a picture of 1 whose values are off by up to `error`, by reference pictures with this noise.
    fn measured(error: f64, noise: f64, seed: u32) -> Validation {
        let options = RenderOptions::default().size(WIDTH, HEIGHT).seed(seed);
        let (mut validation, mut random) = (Validation::new(&options), SplitMix64::new(seed.into()));
        for square in &mut validation.squares {
            for sum in square.sums.iter_mut().flatten() {
                *sum = [0; 3].map(|_| 16.0 * (1.0 + noise * (2.0 * random.next_unit() - 1.0)));
            }
        }
        let values: Vec<f32> =
            (0..WIDTH * HEIGHT).map(|i| if i % 2 == 0 { 1.0 + error as f32 } else { 1.0 }).collect();
        validation.measure([&values; 3], options.pixels(), 16, 0.05 * 0.05);
        validation
    }

    #[test]
    fn the_error_is_found_below_the_noise() {
        for seed in 0..10 {
            for error in [0.0, 0.02, 0.1] {
                // Half of the values are off.
                let (bound, truth) =
                    (measured(error, 0.3, seed).error().expect("a bound"), error / 2.0f64.sqrt());
                // Of the mean of the products of both noises, whose variances are a third of the squared range.
                let deviation = 0.3 * 0.3 / 3.0 / f64::from(3 * 64 * EDGE * EDGE).sqrt();
                println!("{error}: {bound} {truth}");
                assert!(bound >= 0.95 * truth, "{seed}: {bound} for {truth}");
                assert!(bound * bound < truth * truth + 5.0 * deviation, "{seed}: {bound} for {truth}");
            }
        }
    }

    #[test]
    fn larger_errors_postpone_the_next_measurement() {
        let next = [0.0, 0.1, 1.0].map(|error| measured(error, 0.1, 1).next());
        assert_eq!(next, [24, 32, 64]);
    }

    #[test]
    fn squares_are_distinct_and_within_the_region() {
        let region = Region { x0: 3, y0: 5, x1: 90, y1: 70 };
        for options in
            [RenderOptions::default().size(100, 80).region(region), RenderOptions::default().size(5, 3)]
        {
            let Region { x0, y0, x1, y1 } = options.pixels();
            let validation = Validation::new(&options);
            let pixels = validation.pixels();
            let count: usize = validation.squares.iter().map(|square| square.sums[0].len()).sum();
            assert!(count > 0 && pixels.len() == count);
            assert!(pixels.keys().all(|(x, y)| (x0..x1).contains(x) && (y0..y1).contains(y)));
        }
    }
}
