//! Histograms over the square of directions: made, sampled, looked up.

/// Edge of a histogram.
pub const EDGE: usize = 8;

/// Its bins: row by row, a row for each step of the square's first coordinate.
pub const BINS: usize = EDGE * EDGE;

/// A number for each bin.
pub type Bins = [f32; BINS];

/// Upper ends of steps: the last is 1.
pub type Steps = [f32; EDGE];

/// Below 1 by more than rounding up to [`EDGE`] takes.
const BELOW_ONE: f32 = 0.999_999;

/// A histogram, ready to be sampled: what is needed together lies together.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Histogram {
    /// Cumulated shares of the rows.
    pub rows: Steps,
    /// A number that is kept here for the cell.
    pub mean: f32,
    /// In each row, cumulated shares of its bins.
    pub columns: [Steps; EDGE],
}

impl Histogram {
    /// With densities in proportion to positive weights, as far as steps are rounded.
    pub fn new(weights: &Bins, mean: f32) -> Histogram {
        let (rows, _) = weights.as_chunks::<EDGE>();
        let mut histogram = Histogram { rows: [0.0; EDGE], mean, columns: [[0.0; EDGE]; EDGE] };
        let mut sums = [0.0; EDGE];
        for (row, weights) in rows.iter().enumerate() {
            sums[row] = weights.iter().sum();
            histogram.columns[row] = cumulated(weights);
        }
        histogram.rows = cumulated(&sums);
        histogram
    }

    /// The point of the square that two uniform numbers choose, and the density there: 1 on average.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> ([f32; 2], f32) {
        let (row, x, height) = choose(&self.rows, u[0]);
        let (_, y, width) = choose(&self.columns[row], u[1]);
        ([x, y], density(height, width))
    }

    /// The densities of all bins, as [`Histogram::sample`] says.
    pub fn densities(&self) -> Bins {
        let mut bins = [0.0; BINS];
        for row in 0..EDGE {
            for column in 0..EDGE {
                let (height, width) = (share(&self.rows, row), share(&self.columns[row], column));
                bins[row * EDGE + column] = density(height, width);
            }
        }
        bins
    }
}

#[inline(always)]
fn density(height: f32, width: f32) -> f32 {
    height * width * BINS as f32
}

/// Cumulated shares of positive weights.
fn cumulated(weights: &[f32; EDGE]) -> Steps {
    let total: f32 = weights.iter().sum();
    let mut steps = [1.0; EDGE];
    let mut sum = 0.0;
    for k in 0..EDGE - 1 {
        sum += weights[k];
        steps[k] = (sum / total).min(1.0);
    }
    steps
}

/// The share of a step.
#[inline(always)]
fn share(steps: &Steps, k: usize) -> f32 {
    steps[k] - if k > 0 { steps[k - 1] } else { 0.0 }
}

/// Chooses a step by a number in 0..1: which, a coordinate in it, in 0..1 over all steps, and its share.
#[inline(always)]
fn choose(steps: &Steps, u: f32) -> (usize, f32, f32) {
    let mut below = 0;
    for step in &steps[..EDGE - 1] {
        below += usize::from(u >= *step);
    }
    let k = below.min(EDGE - 1);
    let start = if k > 0 { steps[k - 1] } else { 0.0 };
    let share = steps[k] - start;
    let within = (u - start) / share;
    // Not so for steps of no length, which are not chosen but by rounding.
    let within = if within < BELOW_ONE { within } else { BELOW_ONE };
    let within = if within > 0.0 { within } else { 0.0 };
    (k, (k as f32 + within) * (1.0 / EDGE as f32), share)
}

/// The bin of a point of the square.
#[inline(always)]
pub fn bin([u, v]: [f32; 2]) -> u32 {
    let step = |x: f32| {
        let k = (x * EDGE as f32) as i32;
        if k < EDGE as i32 - 1 { k as u32 } else { EDGE as u32 - 1 }
    };
    step(u) * EDGE as u32 + step(v)
}
