//! How a picture is divided among threads.

use super::schedule::Pass;
use crate::compile::View;
use crate::integrator::Block;
use crate::integrator::reuse::Tiling;

/// The tiles of a pass.
pub(super) struct Tiles {
    width: u32,
    height: u32,
    /// How far their grid is shifted to the left and up.
    shift: (u32, u32),
    /// Samples of a tile that are traced at a time.
    samples: u32,
}

impl Tiles {
    pub fn of(pass: Pass, reuse: Option<&Tiling>) -> Tiles {
        let (samples, shift) = (pass.samples, reuse.map_or((0, 0), Tiling::shift));
        let ((width, height), samples) = match reuse {
            None => (pass.tile(), samples),
            Some(tiling) => pass.tile_of_regions(tiling.region()),
        };
        Tiles { width, height, shift, samples }
    }

    /// Samples of a tile that are traced at a time.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// The tiles of a whole picture.
    pub fn blocks(&self, view: &View, pass: Pass) -> Vec<Block> {
        let Pass { first_sample, samples } = pass;
        let all = Block { x0: 0, y0: 0, width: view.width, height: view.height, first_sample, samples };
        self.divide(all).collect()
    }

    /// The tiles of a block which begins where one of them does, row by row.
    pub fn divide(&self, block: Block) -> impl Iterator<Item = Block> {
        let (left, top) = self.shift;
        let width = self.width;
        let row = move |(y, height)| {
            let columns = starts(block.width, width, left);
            columns.map(move |(x, width)| Block {
                x0: block.x0 + x,
                y0: block.y0 + y,
                width,
                height,
                ..block
            })
        };
        starts(block.height, self.height, top).flat_map(row)
    }
}

/// Divides a length into steps, the first of which is shorter by `shift`: starts and lengths.
fn starts(length: u32, step: u32, shift: u32) -> impl Iterator<Item = (u32, u32)> {
    let ends = (step - shift..length + step).step_by(step as usize);
    ends.map(move |end| {
        let start = end.saturating_sub(step);
        (start, end.min(length) - start)
    })
}

/// A block in parts of some samples each.
pub(super) fn parts(block: &Block, samples: u32) -> impl Iterator<Item = Block> {
    let block = *block;
    (0..block.samples).step_by(samples as usize).map(move |skipped| Block {
        first_sample: block.first_sample + skipped,
        samples: samples.min(block.samples - skipped),
        ..block
    })
}
