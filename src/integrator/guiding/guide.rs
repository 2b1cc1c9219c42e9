//! What was learned, fixed: histograms to choose directions by, and how much light to expect.

use super::grid::{CELLS_OF_PARENT, Grid, Numbers, key_of, parent};
use super::histogram::{BINS, Bins, Histogram};
use super::training::{CellSums, TrainedCells};
use crate::simd::Table;

/// The part of all histograms that is uniform, so that no direction is left out (defensive sampling).
const UNIFORM_FRACTION: f32 = 0.25;

/// So many training samples of equal value count as much as what is expected without.
const PRIOR: f32 = 256.0;

/// Cells with fewer training samples are left to the larger ones around them.
const LEAST_COUNT: u32 = 8;

/// The number of the cell for all places of which nothing is known: with an even histogram.
pub const UNKNOWN: u32 = 0;

/// What is expected where nothing is known.
pub const NO_MEAN: f32 = -1.0;

/// Least share of a picture's mean luminance that roulette judges paths against: darker places need no better.
const LEAST_SHARE: f64 = 0.2;

/// Guides paths: by cells of space and normals, a density of directions over the cosine lobe, and the light that comes on average.
#[derive(Clone, Debug)]
pub struct Guide {
    pub(super) grid: Grid,
    numbers: Numbers,
    /// By cell. Their means are of the luminance that comes to a vertex by scattering, times the cosine over pi; [`NO_MEAN`] where
    /// that is not known.
    pub(super) histograms: Vec<Histogram>,
    /// Of all bins of all cells.
    pub(super) densities: Vec<f32>,
    /// Luminance against which paths are judged at least.
    pub(super) floor: f32,
}

impl Guide {
    /// One that knows nothing.
    pub fn blank() -> Guide {
        let mut guide = Guide {
            grid: Grid::new(1.0),
            numbers: Numbers::default(),
            histograms: Vec::new(),
            densities: Vec::new(),
            floor: 0.0,
        };
        guide.push(Histogram::new(&[1.0; BINS], NO_MEAN));
        guide
    }

    /// What training found, for a picture of this mean luminance.
    pub fn new(trained: &TrainedCells, luminance: f64) -> Guide {
        let mut guide =
            Guide { grid: trained.grid, floor: (LEAST_SHARE * luminance) as f32, ..Guide::blank() };
        let (mut numbers, mut parents) = (Numbers::default(), Vec::<CellSums>::new());
        for cell in trained.cells() {
            let key = parent(cell.key);
            let number = numbers.insert(key) as usize;
            if number == parents.len() {
                parents.push(CellSums::new(key));
            }
            parents[number].add(cell);
        }
        let even = CellEstimate { weights: [1.0; BINS], mean: 0.0 };
        let of_parents: Vec<CellEstimate> =
            parents.iter().map(|cell| CellEstimate::new(cell, &even, 1.0 / CELLS_OF_PARENT)).collect();
        for (cell, learned) in parents.iter().zip(&of_parents) {
            guide.add(cell.key, learned);
        }
        for cell in trained.cells().filter(|cell| cell.count >= LEAST_COUNT) {
            let above = numbers.get(parent(cell.key)).map_or(&even, |number| &of_parents[number as usize]);
            guide.add(cell.key, &CellEstimate::new(cell, above, 1.0));
        }
        guide
    }

    fn add(&mut self, key: u64, learned: &CellEstimate) {
        // Those of which nothing is known come first.
        let number = self.numbers.insert(key) + 1;
        debug_assert_eq!(number as usize, self.histograms.len());
        let mut weights = learned.weights;
        for weight in &mut weights {
            *weight = UNIFORM_FRACTION + (1.0 - UNIFORM_FRACTION) * *weight;
        }
        self.push(Histogram::new(&weights, learned.mean));
    }

    fn push(&mut self, histogram: Histogram) {
        self.densities.extend(histogram.densities());
        self.histograms.push(histogram);
    }

    /// The number of the cell of a key by its halves, or of a larger one around it.
    #[inline]
    pub(super) fn find(&self, low: u32, high: u32) -> u32 {
        let key = key_of(low, high);
        let number = self.numbers.get(key).or_else(|| self.numbers.get(parent(key)));
        number.map_or(UNKNOWN, |number| number + 1)
    }

    /// The densities of all bins of all cells.
    pub(in super::super) fn densities(&self) -> Table<'_, f32> {
        Table::new(&self.densities)
    }

    /// How many cells it knows something of.
    pub fn cells(&self) -> usize {
        self.histograms.len() - 1
    }
}

/// What a cell has learned, beside what was expected.
struct CellEstimate {
    /// 1 on average.
    weights: Bins,
    mean: f32,
}

impl CellEstimate {
    /// Of a cell in a larger one; what that says counts `trust` times as much as usual.
    fn new(cell: &CellSums, above: &CellEstimate, trust: f32) -> CellEstimate {
        let prior = PRIOR * trust;
        // Training samples of equal value that would be as good.
        let effective = if cell.squares > 0.0 { (cell.sum * cell.sum / cell.squares) as f32 } else { 0.0 };
        let own = effective / (effective + prior);
        let scale = BINS as f64 / cell.sum;
        let mean = ((cell.sum + f64::from(prior * above.mean)) / f64::from(cell.count as f32 + prior)) as f32;
        // Beyond the range of floats nothing is known.
        let is_known = own > 0.0 && scale.is_finite() && cell.bins.iter().all(|bin| bin.is_finite());
        let own = if is_known { own } else { 0.0 };
        let weights = std::array::from_fn(|k| match is_known {
            true => own * (scale * f64::from(cell.bins[k])) as f32 + (1.0 - own) * above.weights[k],
            false => above.weights[k],
        });
        CellEstimate { weights, mean: if mean.is_finite() { mean } else { above.mean } }
    }
}
