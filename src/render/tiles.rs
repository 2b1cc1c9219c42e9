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
    pub fn of(pass: Pass, reuse: Option<&Tiling>, allotted: bool) -> Tiles {
        let (samples, shift) = (pass.samples, reuse.map_or((0, 0), Tiling::shift));
        let ((width, height), samples) = match reuse {
            None if allotted => ((32, 32), samples),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrator::WAVE;
    use crate::integrator::reuse::GroupShape;

    #[test]
    fn tiles_cover_every_pixel_once() {
        let shapes = [None, Some("2x2/1"), Some("4x4/4"), Some("8x8/4")];
        let passes = [(0, 8), (8, 1), (16, 2), (40, 3), (80, 5), (800, 7)];
        let sizes = [(1, 1), (31, 50), (64, 64), (100, 33)];
        for ((first_sample, samples), shape) in passes.iter().flat_map(|p| shapes.map(|s| (*p, s))) {
            let pass = Pass { first_sample, samples };
            let reuse = shape.map(|s| Tiling::new(s.parse::<GroupShape>().unwrap(), first_sample));
            let tiles = Tiles::of(pass, reuse.as_ref(), false);
            for (width, height) in sizes {
                let mut counts = vec![0; (width * height) as usize];
                for tile in tiles.divide(Block { x0: 0, y0: 0, width, height, first_sample, samples }) {
                    let of_parts: u32 = parts(&tile, tiles.samples()).map(|part| part.samples).sum();
                    assert_eq!(of_parts, samples);
                    let is_wave = tile.width * tile.height * tiles.samples() <= WAVE as u32;
                    assert!(is_wave || reuse.is_none(), "{shape:?} {pass:?}");
                    for (x, y) in (0..tile.height).flat_map(|y| (0..tile.width).map(move |x| (x, y))) {
                        counts[((tile.y0 + y) * width + tile.x0 + x) as usize] += 1;
                    }
                }
                assert!(counts.iter().all(|&n| n == 1), "{shape:?} {pass:?} {width} {height}");
            }
        }
    }
}
