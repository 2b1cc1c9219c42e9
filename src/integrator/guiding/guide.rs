//! The path guide: directional histograms and mean radiance by cell of position and normal, and the training data for them.

use crate::integrator::cells::{CELLS_PER_PARENT, Grid, KeyIndices, key_of, parent};
use crate::sampling::hash::mix64;
use crate::simd::Table;

/// Weight of the uniform distribution mixed into all histograms (defensive sampling).
const UNIFORM_FRACTION: f32 = 0.25;

/// Weight of the prior, in effective training samples.
const PRIOR: f32 = 256.0;

/// Cells with fewer training samples use their parent's.
const MIN_COUNT: u32 = 8;

/// Index of the cell for points without training data, with a uniform histogram.
pub const UNKNOWN: u32 = 0;

/// Mean of cells without training data.
pub const NO_MEAN: f32 = -1.0;

/// Lower bound of the reference of Russian roulette, as a fraction of the picture's mean luminance.
const MIN_FRACTION: f64 = 0.2;

/// A path guide: by cell of position and normal, a pdf of directions relative to the cosine lobe's, and the mean incident radiance.
#[derive(Clone, Debug)]
pub struct Guide {
    pub(super) grid: Grid,
    indices: KeyIndices,
    /// By cell. `mean` is of indirect incident luminance times the cosine over pi; [`NO_MEAN`] without training data.
    pub(super) histograms: Vec<Histogram>,
    /// Densities of all bins of all cells, [`BINS`] per cell.
    pub(super) densities: Vec<f32>,
    /// Minimum reference luminance of Russian roulette.
    pub(super) min_reference: f32,
}

impl Guide {
    /// A guide without training data.
    pub fn blank() -> Guide {
        let mut guide = Guide {
            grid: Grid::new(1.0),
            indices: KeyIndices::default(),
            histograms: Vec::new(),
            densities: Vec::new(),
            min_reference: 0.0,
        };
        guide.push(Histogram::new(&[1.0; BINS], NO_MEAN));
        guide
    }

    /// A guide from training data; `luminance` is the mean of the picture.
    pub fn new(trained: &TrainedCells, luminance: f64) -> Guide {
        let mut guide =
            Guide { grid: trained.grid, min_reference: (MIN_FRACTION * luminance) as f32, ..Guide::blank() };
        let (mut indices, mut parents) = (KeyIndices::default(), Vec::<CellSums>::new());
        for cell in trained.cells() {
            let key = parent(cell.key);
            let index = indices.insert(key) as usize;
            if index == parents.len() {
                parents.push(CellSums::new(key));
            }
            parents[index].add(cell);
        }
        let uniform = CellEstimate { weights: [1.0; BINS], mean: 0.0 };
        let of_parents: Vec<CellEstimate> =
            parents.iter().map(|cell| CellEstimate::new(cell, &uniform, 1.0 / CELLS_PER_PARENT)).collect();
        for (cell, estimate) in parents.iter().zip(&of_parents) {
            guide.add(cell.key, estimate);
        }
        for cell in trained.cells().filter(|cell| cell.count >= MIN_COUNT) {
            let prior = indices.get(parent(cell.key)).map_or(&uniform, |index| &of_parents[index as usize]);
            guide.add(cell.key, &CellEstimate::new(cell, prior, 1.0));
        }
        guide
    }

    fn add(&mut self, key: u64, estimate: &CellEstimate) {
        // Index 0 is the cell without training data.
        let index = self.indices.insert(key) + 1;
        debug_assert_eq!(index as usize, self.histograms.len());
        let mut weights = estimate.weights;
        for weight in &mut weights {
            *weight = UNIFORM_FRACTION + (1.0 - UNIFORM_FRACTION) * *weight;
        }
        self.push(Histogram::new(&weights, estimate.mean));
    }

    fn push(&mut self, histogram: Histogram) {
        self.densities.extend(histogram.densities());
        self.histograms.push(histogram);
    }

    /// Index of the cell with a key of these halves, else of its parent cell, else [`UNKNOWN`].
    #[inline]
    pub(super) fn find(&self, low: u32, high: u32) -> u32 {
        let key = key_of(low, high);
        let index = self.indices.get(key).or_else(|| self.indices.get(parent(key)));
        index.map_or(UNKNOWN, |index| index + 1)
    }

    /// Densities of all bins of all cells.
    pub(in super::super) fn densities(&self) -> Table<'_, f32> {
        Table::new(&self.densities)
    }

    /// Number of cells with training data.
    pub fn cells(&self) -> usize {
        self.histograms.len() - 1
    }
}

/// Posterior of a cell: training data blended with a prior.
struct CellEstimate {
    /// Histogram with a mean of 1.
    weights: Bins,
    mean: f32,
}

impl CellEstimate {
    /// The posterior of a cell; the prior's weight is [`PRIOR`] times `trust`.
    fn new(cell: &CellSums, prior: &CellEstimate, trust: f32) -> CellEstimate {
        let prior_weight = PRIOR * trust;
        // Effective number of training samples.
        let effective = if cell.squares > 0.0 { (cell.sum * cell.sum / cell.squares) as f32 } else { 0.0 };
        let own = effective / (effective + prior_weight);
        let scale = BINS as f64 / cell.sum;
        let mean = ((cell.sum + f64::from(prior_weight * prior.mean))
            / f64::from(cell.count as f32 + prior_weight)) as f32;
        // After overflow, only the prior is used.
        let is_known = own > 0.0 && scale.is_finite() && cell.bins.iter().all(|bin| bin.is_finite());
        let own = if is_known { own } else { 0.0 };
        let weights = std::array::from_fn(|k| match is_known {
            true => own * (scale * f64::from(cell.bins[k])) as f32 + (1.0 - own) * prior.weights[k],
            false => prior.weights[k],
        });
        CellEstimate { weights, mean: if mean.is_finite() { mean } else { prior.mean } }
    }
}

// Histograms over the unit square, which the cosine-hemisphere map takes to directions.

/// Bins per side of a histogram.
pub const EDGE: usize = 8;

/// Number of bins; index = row * [`EDGE`] + column, with the row along the square's first coordinate.
pub const BINS: usize = EDGE * EDGE;

/// A value per bin.
pub type Bins = [f32; BINS];

/// Cumulative distribution; the last value is 1.
pub type Cdf = [f32; EDGE];

/// Largest number whose product with [`EDGE`] doesn't round up to [`EDGE`].
const BELOW_ONE: f32 = 0.999_999;

/// Marginal and conditional distributions of a histogram, in one block for few cache misses.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Histogram {
    /// Marginal distribution of the rows.
    pub rows: Cdf,
    /// The cell's mean, stored here for locality.
    pub mean: f32,
    /// Conditional distribution of the bins of each row.
    pub columns: [Cdf; EDGE],
}

impl Histogram {
    /// A histogram with densities proportional to positive weights, up to rounding.
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

    /// Samples a point of the unit square; returns the point and its pdf (mean 1).
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> ([f32; 2], f32) {
        let (row, x, height) = sample_cdf(&self.rows, u[0]);
        let (_, y, width) = sample_cdf(&self.columns[row], u[1]);
        ([x, y], density(height, width))
    }

    /// The pdf of all bins, equal to that of [`Histogram::sample`] to the bit.
    pub fn densities(&self) -> Bins {
        let mut bins = [0.0; BINS];
        for row in 0..EDGE {
            for column in 0..EDGE {
                let (height, width) = (probability(&self.rows, row), probability(&self.columns[row], column));
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

/// Cumulative distribution of positive weights.
fn cumulated(weights: &[f32; EDGE]) -> Cdf {
    let total: f32 = weights.iter().sum();
    let mut steps = [1.0; EDGE];
    let mut sum = 0.0;
    for k in 0..EDGE - 1 {
        sum += weights[k];
        steps[k] = (sum / total).min(1.0);
    }
    steps
}

/// The probability of interval `k`.
#[inline(always)]
fn probability(steps: &Cdf, k: usize) -> f32 {
    steps[k] - if k > 0 { steps[k - 1] } else { 0.0 }
}

/// Samples a cumulative distribution: the interval, the coordinate in 0..1 over all intervals, and the interval's probability.
#[inline(always)]
fn sample_cdf(steps: &Cdf, u: f32) -> (usize, f32, f32) {
    let mut below = 0;
    for step in &steps[..EDGE - 1] {
        below += usize::from(u >= *step);
    }
    let k = below.min(EDGE - 1);
    let start = if k > 0 { steps[k - 1] } else { 0.0 };
    let probability = steps[k] - start;
    let within = (u - start) / probability;
    // Also handles NaN: rounding may select intervals of probability 0.
    let within = if within < BELOW_ONE { within } else { BELOW_ONE };
    let within = if within > 0.0 { within } else { 0.0 };
    (k, (k as f32 + within) * (1.0 / EDGE as f32), probability)
}

/// The bin of a point of the unit square.
#[inline(always)]
pub fn bin([u, v]: [f32; 2]) -> u32 {
    let step = |x: f32| {
        let k = (x * EDGE as f32) as i32;
        if k < EDGE as i32 - 1 { k as u32 } else { EDGE as u32 - 1 }
    };
    step(u) * EDGE as u32 + step(v)
}

// Training data: incident luminance by point and direction, summed by cell.

/// Incident luminance at a path vertex.
#[derive(Clone, Copy, Debug)]
pub struct TrainingSample {
    /// Position, metres.
    pub p: [f32; 3],
    /// Shading normal.
    pub n: [f32; 3],
    /// Bin of the sampled direction.
    pub bin: u32,
    /// Incident luminance over the pdf of the direction relative to the cosine lobe's. Its expectation is the irradiance over pi,
    /// without light samples.
    pub value: f32,
}

/// A path vertex before its incident luminance is known.
#[derive(Clone, Copy, Debug)]
pub struct VertexRecord {
    /// Training sample with a value of 0.
    pub training_sample: TrainingSample,
    /// Index of the path's sample in the radiance buffer.
    pub sample: u32,
    /// Luminance of the sample when the path scattered here.
    pub before: f32,
    /// Contribution to the sample's luminance for a training value of 1.
    pub throughput_luminance: f32,
    /// Mean of the cell by the guide; negative if unknown.
    pub expected: f32,
    /// Did the path end here?
    pub ends: bool,
}

/// A training sample with the key of its cell.
#[derive(Clone, Copy, Debug)]
pub struct CellSample {
    key: u64,
    bin: u32,
    value: f32,
}

/// Number of shards of the cells, which are updated in parallel.
const SHARDS: usize = 16;

/// The samples of a block, by shard.
pub type CellSamples = [Vec<CellSample>; SHARDS];

impl Grid {
    /// Sorts samples into shards, with the keys of their cells.
    pub fn cell_samples(self, samples: &[TrainingSample]) -> CellSamples {
        let mut cell_samples: CellSamples = Default::default();
        for sample in samples {
            let key = self.key(sample.p.into(), sample.n.into());
            // The high bits; the hash map uses the low ones.
            let shard = (mix64(key) >> 60) as usize;
            cell_samples[shard].push(CellSample { key, bin: sample.bin, value: sample.value });
        }
        cell_samples
    }
}

/// Sums of the training samples of a cell.
#[derive(Clone, Copy, Debug)]
pub struct CellSums {
    pub key: u64,
    /// Sum of values by bin.
    pub bins: Bins,
    /// Sum of all values.
    pub sum: f64,
    /// Sum of squared values.
    pub squares: f64,
    /// Number of samples.
    pub count: u32,
}

impl CellSums {
    pub fn new(key: u64) -> CellSums {
        CellSums { key, bins: [0.0; BINS], sum: 0.0, squares: 0.0, count: 0 }
    }

    /// Adds the sums of another cell.
    pub fn add(&mut self, other: &CellSums) {
        for (sum, bin) in self.bins.iter_mut().zip(&other.bins) {
            *sum += bin;
        }
        self.sum += other.sum;
        self.squares += other.squares;
        self.count = self.count.saturating_add(other.count);
    }
}

/// A shard of the cells, selected by a hash of the key.
#[derive(Clone, Debug, Default)]
pub struct CellShard {
    indices: KeyIndices,
    cells: Vec<CellSums>,
}

impl CellShard {
    /// Adds samples. Rounding depends on their order.
    pub fn learn(&mut self, cell_samples: &[CellSample]) {
        for cell_sample in cell_samples {
            let index = self.indices.insert(cell_sample.key) as usize;
            if index == self.cells.len() {
                self.cells.push(CellSums::new(cell_sample.key));
            }
            let cell = &mut self.cells[index];
            cell.bins[cell_sample.bin as usize % BINS] += cell_sample.value;
            let value = f64::from(cell_sample.value);
            cell.sum += value;
            cell.squares += value * value;
            cell.count = cell.count.saturating_add(1);
        }
    }
}

/// Training data summed by cell.
#[derive(Clone, Debug)]
pub struct TrainedCells {
    pub grid: Grid,
    pub shards: [CellShard; SHARDS],
}

impl TrainedCells {
    /// Without training data.
    pub fn new(grid: Grid) -> TrainedCells {
        TrainedCells { grid, shards: Default::default() }
    }

    /// The cells, in an order that does not depend on threads.
    pub fn cells(&self) -> impl Iterator<Item = &CellSums> {
        self.shards.iter().flat_map(|shard| &shard.cells)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Frame, Vec3};
    use crate::sampling::chi2::{Chi2, Random, SphericalDomain};
    use crate::sampling::warp;

    /// Random weights; every fifth bin is nearly 0.
    fn weights(random: &mut Random) -> [f32; BINS] {
        std::array::from_fn(|k| if k % 5 == 0 { 1e-6 } else { random.next() + 0.01 })
    }

    #[test]
    fn histograms_pass_chi_square() {
        let mut random = Random::new(4);
        for _ in 0..4 {
            let histogram = Histogram::new(&weights(&mut random), 0.0);
            let densities = histogram.densities();
            Chi2::new("histogram", 4).assert(
                |u| Some(histogram.sample([u[0], u[1]]).0.map(f64::from)),
                |p| f64::from(densities[bin(p.map(|x| x as f32)) as usize]),
            );
        }
    }

    #[test]
    fn guided_directions_pass_chi_square() {
        let mut random = Random::new(5);
        let histogram = Histogram::new(&weights(&mut random), 0.0);
        let densities = histogram.densities();
        let frame = Frame::from_normal(Vec3::new(0.48, -0.6, 0.64));
        let of = |w: Vec3| densities[bin(warp::invert_cosine_hemisphere(frame.to_local(w))) as usize];
        Chi2::new("guided directions", 1).assert_directions(
            &SphericalDomain::sphere(),
            |u| Some(frame.to_world(warp::cosine_hemisphere(histogram.sample([u[0], u[1]]).0))),
            |w| warp::cosine_hemisphere_pdf_solid_angle(frame.to_local(w).z) * of(w),
        );
    }

    #[test]
    fn sampled_pdf_equals_that_of_the_bin() {
        let mut random = Random::new(6);
        let histogram = Histogram::new(&weights(&mut random), 0.0);
        let densities = histogram.densities();
        let below_one = 1.0f32.next_down();
        let corners = [[0.0, 0.0], [below_one, below_one], [0.0, below_one], [0.5, 0.25]];
        let many = (0..20_000).map(|_| [random.next(), random.next()]);
        for u in corners.into_iter().chain(many) {
            let (point, density) = histogram.sample(u);
            assert!(point.iter().all(|x| (0.0..1.0).contains(x)), "{u:?} {point:?}");
            assert_eq!(densities[bin(point) as usize], density, "{u:?}");
        }
        assert!((densities.iter().sum::<f32>() / BINS as f32 - 1.0).abs() < 1e-5);
    }

    #[test]
    fn keys_are_indexed_in_order_of_insertion() {
        let mut indices = KeyIndices::default();
        assert_eq!(indices.get(7), None);
        let keys: Vec<u64> = (1..5000u64).map(|k| k.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1).collect();
        for (index, &key) in keys.iter().enumerate() {
            assert_eq!(indices.insert(key), index as u32);
            assert_eq!(indices.insert(keys[index / 2]), (index / 2) as u32);
        }
        assert!(keys.iter().enumerate().all(|(index, &key)| indices.get(key) == Some(index as u32)));
        assert_eq!(indices.get(2), None);
    }

    fn training_sample(p: Vec3, n: Vec3, bin: u32, value: f32) -> TrainingSample {
        TrainingSample { p: p.to_array(), n: n.to_array(), bin, value }
    }

    #[test]
    fn cell_size_matches_the_wanted_sample_count() {
        let mut random = Random::new(7);
        let floor =
            |random: &mut Random| Vec3::new(random.next() * 4.0 - 2.0, 0.0, random.next() * 4.0 - 2.0);
        let samples: Vec<TrainingSample> =
            (0..20_000).map(|_| training_sample(floor(&mut random), Vec3::Y, 0, 1.0)).collect();
        for wanted in [500.0, 2000.0] {
            let places: Vec<[Vec3; 2]> = samples.iter().map(|l| [l.p.into(), l.n.into()]).collect();
            let grid = Grid::suited_to(&places, 320_000.0, wanted).expect("samples");
            let mut keys: Vec<u64> = samples.iter().map(|l| grid.key(l.p.into(), l.n.into())).collect();
            keys.sort_unstable();
            keys.dedup();
            let mean = 320_000.0 / keys.len() as f64;
            assert!((0.5 * wanted..4.0 * wanted).contains(&mean), "{wanted}: {mean}");
        }
        assert!(Grid::suited_to(&[], 1.0, 100.0).is_none());
        let grid = Grid::new(0.5);
        let (a, b) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.9, 0.2, 0.3));
        assert_ne!(grid.key(a, Vec3::Y), grid.key(a, Vec3::X));
        assert_ne!(grid.key(a, Vec3::Y), grid.key(b, Vec3::Y));
        assert_eq!(parent(grid.key(a, Vec3::Y)), parent(grid.key(b, Vec3::Y)));
    }

    /// The histogram peaks in the trained direction, the mean is estimated, and cells without training data are unknown.
    #[test]
    fn guide_reproduces_its_training_data() {
        let (mut random, grid) = (Random::new(8), Grid::new(1.0));
        let here = Vec3::new(0.1, 0.0, 0.1);
        let found: Vec<TrainingSample> = (0..4000)
            .map(|_| {
                let bin = (random.next() * BINS as f32) as u32;
                training_sample(here, Vec3::Y, bin, if bin == 20 { 64.0 } else { 0.0 })
            })
            .collect();
        let mut trained = TrainedCells::new(grid);
        let cell_samples = grid.cell_samples(&found);
        for (shard, cell_samples) in trained.shards.iter_mut().zip(&cell_samples) {
            shard.learn(cell_samples);
        }
        let guide = Guide::new(&trained, 1.0);
        let key = grid.key(here, Vec3::Y);
        let cell = guide.find(key as u32, (key >> 32) as u32) as usize;
        assert_ne!(cell as u32, UNKNOWN);
        let densities = &guide.densities[cell * BINS..(cell + 1) * BINS];
        assert!(densities[20] > 20.0 && densities.iter().all(|d| *d > 0.2), "{densities:?}");
        let mean = guide.histograms[cell].mean;
        assert!((0.8..1.2).contains(&mean), "{mean}");
        let elsewhere = grid.key(Vec3::splat(50.0), Vec3::Y);
        assert_eq!(guide.find(elsewhere as u32, (elsewhere >> 32) as u32), UNKNOWN);
        // A neighbouring cell falls back to the common parent.
        let beside = grid.key(Vec3::new(1.3, 0.0, 0.1), Vec3::Y);
        let found = guide.find(beside as u32, (beside >> 32) as u32);
        assert!(found != UNKNOWN && found as usize != cell);
        assert_eq!(guide.cells(), 2);
    }

    /// Extreme values keep the guide valid: sums that overflow are ignored.
    #[test]
    fn extreme_training_values_keep_the_guide_valid() {
        let (mut random, grid) = (Random::new(9), Grid::new(1.0));
        let here = Vec3::new(0.1, 0.0, 0.1);
        for size in [1e-38, 1e-20, 1e20, 1e30, 1e38, f32::INFINITY] {
            let found: Vec<TrainingSample> = (0..4000)
                .map(|_| {
                    let bin = (random.next() * BINS as f32) as u32;
                    training_sample(here, Vec3::Y, bin, if bin == 20 { size } else { 0.0 })
                })
                .collect();
            let mut trained = TrainedCells::new(grid);
            for (shard, samples) in trained.shards.iter_mut().zip(&grid.cell_samples(&found)) {
                shard.learn(samples);
            }
            let guide = Guide::new(&trained, 1.0);
            let is_valid = |density: &f32| (0.2..=BINS as f32).contains(density);
            assert!(guide.densities.iter().all(is_valid), "{size}: {:?}", guide.densities);
            for densities in guide.densities.chunks(BINS) {
                assert!(
                    (densities.iter().sum::<f32>() / BINS as f32 - 1.0).abs() < 1e-4,
                    "{size}: {densities:?}"
                );
            }
            assert!(guide.histograms.iter().all(|h| h.mean.is_finite()), "{size}");
        }
    }
}
