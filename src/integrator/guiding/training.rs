//! What guides learn from: how much light came to a point from a direction, by cells.

use super::grid::{Grid, Numbers};
use super::histogram::{BINS, Bins};
use crate::sampling::hash::mix64;

/// What a path found where it had scattered.
#[derive(Clone, Copy, Debug)]
pub struct TrainingSample {
    /// The point, metres.
    pub p: [f32; 3],
    /// Its shading normal.
    pub n: [f32; 3],
    /// Where in the square of directions the path went.
    pub bin: u32,
    /// Luminance that came from there over the density of the direction, in units of the cosine lobe's density: its mean over
    /// directions is the irradiance over pi, but for what light samples find.
    pub value: f32,
}

/// A vertex of a path of which it is not yet known what it will find.
#[derive(Clone, Copy, Debug)]
pub struct VertexRecord {
    /// All but the value.
    pub training_sample: TrainingSample,
    pub sample: u32,
    /// Luminance that its sample had so far.
    pub before: f32,
    /// Luminance that a value of 1 brings to the sample.
    pub carried: f32,
    /// Mean of such values that is expected there; negative where that is not known.
    pub expected: f32,
    pub ends: bool,
}

/// A training sample for a cell.
#[derive(Clone, Copy, Debug)]
pub struct CellSample {
    key: u64,
    bin: u32,
    value: f32,
}

/// Training samples by which the size of cells is chosen, at most.
const TRIED: usize = 1 << 15;

/// Parts of the cells, which may learn at the same time.
const SHARES: usize = 16;

/// The samples of a block, by the share of cells that they are for.
pub type CellSamples = [Vec<CellSample>; SHARES];

impl Grid {
    /// Cells so large that at least half of the samples are in cells with `wanted` of them once there are `total`, and as
    /// small as that allows; `None` without samples.
    pub fn suited_to(samples: &[TrainingSample], total: f64, wanted: f64) -> Option<Grid> {
        let step = samples.len().div_ceil(TRIED).max(1);
        let tried: Vec<&TrainingSample> = samples.iter().step_by(step).collect();
        // As far as most are: a few on the horizon don't count.
        let mut distances: Vec<f32> =
            tried.iter().map(|l| l.p.iter().fold(0.0f32, |most, x| most.max(x.abs()))).collect();
        distances.sort_unstable_by(f32::total_cmp);
        let farthest = *distances.get(distances.len() * 9 / 10)?;
        if farthest <= 0.0 || !farthest.is_finite() {
            return None;
        }
        // Of those tried, a cell must have so many; a few at least, or chance decides.
        let least = (wanted * tried.len() as f64 / total).max(4.0) as usize;
        let mut edge = farthest / 8192.0;
        loop {
            let grid = Grid::new(edge);
            let mut keys: Vec<u64> = tried.iter().map(|l| grid.key(l.p.into(), l.n.into())).collect();
            keys.sort_unstable();
            let full: usize = keys.chunk_by(|a, b| a == b).map(<[u64]>::len).filter(|n| *n >= least).sum();
            if 2 * full >= tried.len() || edge > farthest {
                return Some(grid);
            }
            edge *= std::f32::consts::SQRT_2;
        }
    }

    /// Sorts samples by cells.
    pub fn cell_samples(self, samples: &[TrainingSample]) -> CellSamples {
        let mut cell_samples: CellSamples = Default::default();
        for sample in samples {
            let key = self.key(sample.p.into(), sample.n.into());
            // By other bits than those by which tables are sorted.
            let share = (mix64(key) >> 60) as usize;
            cell_samples[share].push(CellSample { key, bin: sample.bin, value: sample.value });
        }
        cell_samples
    }
}

/// What a cell has learned.
#[derive(Clone, Copy, Debug)]
pub struct CellSums {
    pub key: u64,
    /// Sums of values by bin.
    pub bins: Bins,
    /// Of all values and of their squares, and how many there are.
    pub sum: f64,
    pub squares: f64,
    pub count: u32,
}

impl CellSums {
    /// Nothing yet.
    pub fn new(key: u64) -> CellSums {
        CellSums { key, bins: [0.0; BINS], sum: 0.0, squares: 0.0, count: 0 }
    }

    /// Adds what another has learned.
    pub fn add(&mut self, other: &CellSums) {
        for (sum, bin) in self.bins.iter_mut().zip(&other.bins) {
            *sum += bin;
        }
        self.sum += other.sum;
        self.squares += other.squares;
        self.count = self.count.saturating_add(other.count);
    }
}

/// A share of the cells.
#[derive(Clone, Debug, Default)]
pub struct Share {
    numbers: Numbers,
    cells: Vec<CellSums>,
}

impl Share {
    /// Learns. Sums depend on the order of the samples.
    pub fn learn(&mut self, cell_samples: &[CellSample]) {
        for cell_sample in cell_samples {
            let number = self.numbers.insert(cell_sample.key) as usize;
            if number == self.cells.len() {
                self.cells.push(CellSums::new(cell_sample.key));
            }
            let cell = &mut self.cells[number];
            cell.bins[cell_sample.bin as usize % BINS] += cell_sample.value;
            let value = f64::from(cell_sample.value);
            cell.sum += value;
            cell.squares += value * value;
            cell.count = cell.count.saturating_add(1);
        }
    }
}

/// All that was learned.
#[derive(Clone, Debug)]
pub struct TrainedCells {
    pub grid: Grid,
    pub shares: [Share; SHARES],
}

impl TrainedCells {
    /// None yet.
    pub fn new(grid: Grid) -> TrainedCells {
        TrainedCells { grid, shares: Default::default() }
    }

    /// The cells, in an order that does not depend on threads.
    pub fn cells(&self) -> impl Iterator<Item = &CellSums> {
        self.shares.iter().flat_map(|share| &share.cells)
    }
}
