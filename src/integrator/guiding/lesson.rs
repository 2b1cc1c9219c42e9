//! What paths teach: how much light came to a point from a direction, by cells.

use super::grid::{Grid, Numbers};
use super::histogram::{BINS, Bins};
use crate::sampling::hash::mix64;

/// What a path found where it had scattered.
#[derive(Clone, Copy, Debug)]
pub struct Lesson {
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
pub struct Pending {
    /// All but the value.
    pub lesson: Lesson,
    pub sample: u32,
    /// Luminance that its sample had so far.
    pub before: f32,
    /// Luminance that a value of 1 brings to the sample.
    pub carried: f32,
    /// Mean of such values that is expected there; negative where that is not known.
    pub expected: f32,
    pub ends: bool,
}

/// A lesson for a cell.
#[derive(Clone, Copy, Debug)]
pub struct Note {
    key: u64,
    bin: u32,
    value: f32,
}

/// Lessons by which the size of cells is chosen, at most.
const TRIED: usize = 1 << 15;

/// Parts of the cells, which may learn at the same time.
const SHARES: usize = 16;

/// The notes of a block, by the share of cells that they are for.
pub type Notes = [Vec<Note>; SHARES];

impl Grid {
    /// Cells so large that at least half of the lessons are in cells with `wanted` of them once there are `total`, and as
    /// small as that allows; `None` without lessons.
    pub fn suited_to(lessons: &[Lesson], total: f64, wanted: f64) -> Option<Grid> {
        let step = lessons.len().div_ceil(TRIED).max(1);
        let tried: Vec<&Lesson> = lessons.iter().step_by(step).collect();
        let farthest = tried.iter().flat_map(|l| l.p).fold(0.0f32, |most, x| most.max(x.abs()));
        if tried.is_empty() || farthest <= 0.0 || !farthest.is_finite() {
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

    /// Sorts lessons.
    pub fn notes(self, lessons: &[Lesson]) -> Notes {
        let mut notes: Notes = Default::default();
        for lesson in lessons {
            let key = self.key(lesson.p.into(), lesson.n.into());
            // By other bits than those by which tables are sorted.
            let share = (mix64(key) >> 60) as usize;
            notes[share].push(Note { key, bin: lesson.bin, value: lesson.value });
        }
        notes
    }
}

/// What a cell has learned.
#[derive(Clone, Copy, Debug)]
pub struct CellSums {
    pub key: u64,
    /// Sums of values by bin.
    pub bins: Bins,
    /// Of all values and of their squares, and how many there are.
    pub sum: f32,
    pub squares: f32,
    pub count: f32,
}

impl CellSums {
    /// Nothing yet.
    pub fn new(key: u64) -> CellSums {
        CellSums { key, bins: [0.0; BINS], sum: 0.0, squares: 0.0, count: 0.0 }
    }

    /// Adds what another has learned.
    pub fn add(&mut self, other: &CellSums) {
        for (sum, bin) in self.bins.iter_mut().zip(&other.bins) {
            *sum += bin;
        }
        self.sum += other.sum;
        self.squares += other.squares;
        self.count += other.count;
    }
}

/// A share of the cells.
#[derive(Clone, Debug, Default)]
pub struct Share {
    numbers: Numbers,
    cells: Vec<CellSums>,
}

impl Share {
    /// Learns. Sums depend on the order of the notes.
    pub fn learn(&mut self, notes: &[Note]) {
        for note in notes {
            let number = self.numbers.insert(note.key) as usize;
            if number == self.cells.len() {
                self.cells.push(CellSums::new(note.key));
            }
            let cell = &mut self.cells[number];
            cell.bins[note.bin as usize % BINS] += note.value;
            cell.sum += note.value;
            cell.squares += note.value * note.value;
            cell.count += 1.0;
        }
    }
}

/// All that was learned.
#[derive(Clone, Debug)]
pub struct Lessons {
    pub grid: Grid,
    pub shares: [Share; SHARES],
}

impl Lessons {
    /// None yet.
    pub fn new(grid: Grid) -> Lessons {
        Lessons { grid, shares: Default::default() }
    }

    /// The cells, in an order that does not depend on threads.
    pub fn cells(&self) -> impl Iterator<Item = &CellSums> {
        self.shares.iter().flat_map(|share| &share.cells)
    }
}
