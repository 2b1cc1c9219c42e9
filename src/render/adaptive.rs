//! Adaptive sampling: more samples in noisy pixels, by the errors after the first pass.
//!
//! The number of samples of a pixel must not depend on its own samples, or its expected value would: it would get few where the first
//! ones happened to agree. So it follows from the errors of its neighbours alone. (Its own samples are among the hundreds of a tile
//! that measure the cost of a sample, and among all that normalise the sum: their part in its number is far below one sample.)

use super::options::{Adaptive, RenderOptions};
use super::progress::Statistics;
use super::schedule::Pass;
use super::technique::{ErrorMap, Request, Target, Technique, first_reason};
use crate::integrator::{IntegratorOptions, SamplePlan};
use crate::sampling::AdaptiveSampleMap;
use rayon::prelude::*;

/// Radius in pixels of each of the two averages over neighbours.
const RADIUS: usize = 1;

/// Part of the mean squared error that every pixel is taken to have besides its own: what it has not shown yet.
const UNSEEN: f64 = 0.01;

/// Maximum number of samples of a pixel, relative to the average.
const MAX: f64 = 8.0;

/// Minimum numbers of samples of the average pixel and of pixels of a picture.
const MIN_SAMPLES: u32 = 16;
const MIN_PIXELS: u32 = 128 * 128;

/// The work for a given error must fall by this factor. (What is predicted is not quite reached: points that are evenly
/// spread over a pixel make its error fall faster than their number grows. Of a predicted 2.0, 1.4 were measured.)
const MIN_GAIN: f64 = 1.4;

/// How often the interval is halved in which the number of samples is found that an error gets.
const HALVINGS: u32 = 50;

/// Samples that follow the errors of pixels after the first pass.
#[derive(Default)]
pub(super) struct AdaptiveSampling {
    /// Where the samples after the first pass go, once that is decided.
    allotment: Option<AdaptiveSampleMap>,
}

impl AdaptiveSampling {
    /// Do pixels get different numbers of samples?
    pub fn is_allotted(&self) -> bool {
        self.allotment.is_some()
    }
}

impl Technique for AdaptiveSampling {
    fn request(&self, options: &RenderOptions) -> Request {
        match options.adaptive {
            Adaptive::Off => Request::Off,
            Adaptive::Auto => Request::Auto,
        }
    }

    fn refusal(&self) -> &'static str {
        "all pixels get the same number of samples"
    }

    fn obstacle(&self, target: &Target<'_>) -> Option<&'static str> {
        let options = target.options;
        first_reason(&[
            (options.time_limit.is_some(), "rendering has a time limit"),
            (options.samples < MIN_SAMPLES, "there are too few samples"),
            (options.width * options.height < MIN_PIXELS, "the picture has too few pixels"),
        ])
    }

    fn configure<'a>(&'a self, paths: &mut IntegratorOptions<'a>) {
        if let Some(allotment) = &self.allotment {
            paths.plan = SamplePlan::Allotted(allotment);
        }
    }

    fn learns_from(&self, target: &Target<'_>, pass: Pass, shares_paths: bool) -> bool {
        self.request(target.options) == Request::Auto
            && self.obstacle(target).is_none()
            && pass.first_sample == 0
            && !shares_paths
    }

    fn learn(&mut self, options: &RenderOptions, pass: Pass, errors: &ErrorMap) {
        self.allotment = errors.allot(options, pass.samples);
    }

    fn report(&self, statistics: &mut Statistics) {
        statistics.is_adaptive = self.is_allotted();
    }
}

impl ErrorMap {
    /// Distributes the remaining samples so that the sum of squared errors is least, if that gains enough: all pixels have `earlier`
    /// samples, and the average one will have those of the options.
    fn allot(&self, options: &RenderOptions, earlier: u32) -> Option<AdaptiveSampleMap> {
        let total = options.samples;
        let errors = self.of_neighbours();
        let mean = errors.iter().map(|&e| f64::from(e)).sum::<f64>() / errors.len() as f64;
        if mean <= 0.0 || !mean.is_finite() {
            return None;
        }
        let costs = averages(&self.costs, self.width);
        let scale = |(&e, &c): (&f32, &f32)| ((f64::from(e) + UNSEEN * mean) / f64::from(c)).sqrt();
        let scales: Vec<f64> = errors.par_iter().zip(&costs).map(scale).collect();
        let least = f64::from(earlier.max(options.least_samples.min(total)));
        let most = (MAX * f64::from(total)).min(f64::from(options.most_samples.max(total)));
        // The least sum of e / n for a given sum of c n has n in proportion to the root of e / c.
        let sum_at = |factor: f64| scales.iter().map(|s| (factor * s).clamp(least, most)).sum::<f64>();
        let wanted = f64::from(total) * scales.len() as f64;
        let largest = scales.iter().fold(0.0f64, |a, &b| a.max(b));
        let low = bisected((0.0, most * scales.len() as f64 / largest), |factor| sum_at(factor) < wanted);
        let counts: Vec<f32> = scales.par_iter().map(|s| (low * s).clamp(least, most) as f32).collect();
        let work = |n: &dyn Fn(usize) -> f32| {
            let sum = |of: &dyn Fn(usize) -> f32| (0..errors.len()).map(|i| f64::from(of(i))).sum::<f64>();
            sum(&|i| errors[i] / n(i)) * sum(&|i| costs[i] * n(i))
        };
        let (even, after) = (work(&|_| total as f32), work(&|i| counts[i]));
        let extra: Vec<f32> = counts.iter().map(|n| n - earlier as f32).collect();
        (even >= MIN_GAIN * after).then(|| {
            AdaptiveSampleMap::new(options.seed, self.width as u32, earlier, total - earlier, &extra)
        })
    }

    /// Averages over the neighbours of each pixel, itself left out, with weights that fall with the distance.
    fn of_neighbours(&self) -> Vec<f32> {
        let (width, height) = (self.width, self.errors.len() / self.width);
        let averages = averages(&self.errors, width);
        // The part of a pixel in the average around it.
        let share = |at: usize, size: usize| {
            let overlap = |at: usize| (at.min(RADIUS) + (size - 1 - at).min(RADIUS) + 1) as f32;
            let around = at.saturating_sub(RADIUS)..(at + RADIUS + 1).min(size);
            around.map(|k| 1.0 / overlap(k)).sum::<f32>() / overlap(at)
        };
        let others = |i: usize| {
            let share = share(i % width, width) * share(i / width, height);
            ((averages[i] - share * self.errors[i]) / (1.0 - share)).max(0.0)
        };
        (0..averages.len()).into_par_iter().map(others).collect()
    }
}

/// The lower end of an interval that was halved many times, where the upper half is kept if the middle is below what is looked for.
/// Threads that have nothing else to do look at the middles that may come next.
fn bisected((mut low, mut high): (f64, f64), is_below: impl Fn(f64) -> bool + Sync) -> f64 {
    let ahead = (rayon::current_num_threads() + 1).ilog2().clamp(1, 4);
    let mut left = HALVINGS;
    while left > 0 {
        let halvings = ahead.min(left);
        let mut intervals = vec![(low, high)];
        let mut middles = Vec::new();
        for i in 0..(1usize << halvings) - 1 {
            let (low, high): (f64, f64) = intervals[i];
            let middle = 0.5 * (low + high);
            middles.push(middle);
            intervals.extend([(low, middle), (middle, high)]);
        }
        let are_below: Vec<bool> = middles.par_iter().map(|&middle| is_below(middle)).collect();
        let chosen = (0..halvings).fold(0, |at, _| 2 * at + 1 + usize::from(are_below[at]));
        (low, high) = intervals[chosen];
        left -= halvings;
    }
    low
}

/// Averages over the neighbours of each pixel, with weights that fall with the distance.
fn averages(values: &[f32], width: usize) -> Vec<f32> {
    let height = values.len() / width;
    let mut averages = values.to_vec();
    for _ in 0..2 {
        averages = transposed(&of_rows(&averages, width), width);
        averages = transposed(&of_rows(&averages, height), height);
    }
    averages
}

/// Averages over the neighbours in a row.
fn of_rows(values: &[f32], width: usize) -> Vec<f32> {
    let average = |i: usize| {
        let (row, x) = (&values[i - i % width..][..width], i % width);
        let around = &row[x.saturating_sub(RADIUS)..(x + RADIUS + 1).min(width)];
        around.iter().sum::<f32>() / around.len() as f32
    };
    (0..values.len()).into_par_iter().map(average).collect()
}

fn transposed(values: &[f32], width: usize) -> Vec<f32> {
    let height = values.len() / width;
    (0..values.len()).into_par_iter().map(|i| values[i % height * width + i / height]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looking_ahead_changes_nothing() {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| [0.3, 1e-9, 6.999, 8.0].map(|wanted| bisected((0.0, 7.0), |x| x * x < wanted)))
        };
        let one = with(1);
        assert!((one[0] - 0.3f64.sqrt()).abs() < 1e-12);
        assert_eq!([with(3), with(40)], [one; 2]);
    }
}
