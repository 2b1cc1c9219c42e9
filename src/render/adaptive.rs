//! Where a picture needs more samples than elsewhere: errors of its pixels after the first pass tell.
//!
//! A pixel's number of samples must not depend on its own, or its expected value would: few where the first ones happened
//! to agree. So it follows from the errors of its neighbours alone. (Its own samples are among the hundreds of a tile that
//! tell what a sample costs, and among all that tell how many there are to share: their part in its number is far below the
//! step from one sample to the next.)

use super::options::{Adaptive, RenderOptions};
use super::pilot::Change;
use super::schedule::Pass;
use super::technique::Choice;
use crate::integrator::Block;
use crate::sampling::Allotment;
use rayon::prelude::*;

/// Radius in pixels of each of the two averages over neighbours.
const RADIUS: usize = 1;

/// Part of the mean squared error that every pixel is taken to have besides its own: what it has not shown yet.
const UNSEEN: f64 = 0.01;

/// What a sample costs whose camera ray hits nothing, in further rays with all that belongs to them. (Before a textured helmet
/// that fills two fifths of a picture: hardly anything beside the others.)
const COST_OF_MISS: f32 = 0.05;

/// Most samples of a pixel, for each that the average one has.
const MOST: f64 = 8.0;

/// Fewest samples of the average pixel and fewest pixels of a picture.
const LEAST_SAMPLES: u32 = 16;
const LEAST_PIXELS: u32 = 128 * 128;

/// The work for a given error must fall by this factor. (What is predicted is not quite reached: points that are evenly
/// spread over a pixel make its error fall faster than their number grows. Of a predicted 2.0, 1.4 were measured.)
const LEAST_GAIN: f64 = 1.4;

/// How often the interval is halved in which the number of samples is found that an error gets.
const HALVINGS: u32 = 50;

/// Squared errors of the pixels of a picture, row by row, and what a sample costs there.
pub(super) struct ErrorMap {
    width: usize,
    values: Vec<f32>,
    costs: Vec<f32>,
}

impl ErrorMap {
    /// The map of a pass after which samples may be allotted.
    pub fn wanted(options: &RenderOptions, choice: Choice, pass: Pass) -> Option<ErrorMap> {
        let is_wanted = options.adaptive == Adaptive::Auto
            && options.time_limit.is_none()
            && options.samples >= LEAST_SAMPLES
            && options.width * options.height >= LEAST_PIXELS
            && pass.first_sample == 0
            && choice.now.shape().is_none();
        is_wanted.then(|| ErrorMap::new(options.width, options.height))
    }

    fn new(width: u32, height: u32) -> ErrorMap {
        let zeros = vec![0.0; width as usize * height as usize];
        ErrorMap { width: width as usize, costs: zeros.clone(), values: zeros }
    }

    /// Sets the errors of a block's pixels, and the rays of a sample there.
    pub fn set(&mut self, block: &Block, errors: &[f32], rays: f64) {
        let cost = COST_OF_MISS + (rays as f32 - 1.0).max(0.0);
        for (row, errors) in errors.chunks(block.width as usize).enumerate() {
            let from = (block.y0 as usize + row) * self.width + block.x0 as usize;
            self.values[from..from + errors.len()].copy_from_slice(errors);
            self.costs[from..from + errors.len()].fill(cost);
        }
    }

    /// Changes the errors and costs of a block's pixels.
    pub fn change(&mut self, block: &Block, change: Change) {
        for row in block.y0 as usize..(block.y0 + block.height) as usize {
            let from = row * self.width + block.x0 as usize;
            let pixels = from..from + block.width as usize;
            self.values[pixels.clone()].iter_mut().for_each(|error| *error *= change.error as f32);
            self.costs[pixels].iter_mut().for_each(|cost| *cost *= change.cost as f32);
        }
    }

    /// Allots the samples that are left so that the sum of squared errors is least, where that gains enough: all pixels have
    /// `earlier` samples, and the average one is to have those of the options.
    pub fn allot(&self, options: &RenderOptions, earlier: u32) -> Option<Allotment> {
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
        let most = (MOST * f64::from(total)).min(f64::from(options.most_samples.max(total)));
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
        (even >= LEAST_GAIN * after)
            .then(|| Allotment::new(options.seed, self.width as u32, earlier, total - earlier, &extra))
    }

    /// Averages over the neighbours of each pixel, itself left out, with weights that fall with the distance.
    fn of_neighbours(&self) -> Vec<f32> {
        let (width, height) = (self.width, self.values.len() / self.width);
        let averages = averages(&self.values, width);
        // The part of a pixel in the average around it.
        let share = |at: usize, size: usize| {
            let overlap = |at: usize| (at.min(RADIUS) + (size - 1 - at).min(RADIUS) + 1) as f32;
            let around = at.saturating_sub(RADIUS)..(at + RADIUS + 1).min(size);
            around.map(|k| 1.0 / overlap(k)).sum::<f32>() / overlap(at)
        };
        let others = |i: usize| {
            let share = share(i % width, width) * share(i / width, height);
            ((averages[i] - share * self.values[i]) / (1.0 - share)).max(0.0)
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
