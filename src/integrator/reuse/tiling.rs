//! Which samples of a picture share their paths.

use super::super::Block;
use super::super::generate::Cursor;
use super::super::lanes::{LENGTH, WAVE};
use crate::sampling::hash::hash32;

/// Samples between two changes of the groups.
const INTERVAL: u32 = 8;

/// The shape of groups of pixels that share their paths.
///
/// A group has `width` by `height` pixels, one of each cell of `spacing` by `spacing` pixels, so that `spacing * spacing`
/// groups lie within each other. With a spacing of 1, a group is a solid block. With a larger one, the pixels of each cell
/// belong to different groups: what groups have in common is spread over a larger area, and what differs between them is
/// noise of high frequency, which the eye and denoisers take away easily.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroupShape {
    width: u32,
    height: u32,
    spacing: u32,
}

impl GroupShape {
    /// Largest edge of a group with what is within it, in pixels.
    pub const MOST_EDGE: u32 = 32;

    /// Groups of `width` by `height` pixels; `None` unless these and `spacing` are powers of two, a group has from 2 to
    /// 64 pixels, and `spacing` times its edges is at most 32.
    pub fn new(width: u32, height: u32, spacing: u32) -> Option<GroupShape> {
        let is_shape = [width, height, spacing].iter().all(|v| v.is_power_of_two());
        let edge = width.max(height).checked_mul(spacing)?;
        let is_possible = edge <= GroupShape::MOST_EDGE && (2..=64).contains(&(width * height));
        (is_shape && is_possible).then_some(GroupShape { width, height, spacing })
    }

    /// Pixels of a group.
    pub fn pixels(self) -> u32 {
        self.width * self.height
    }

    /// Edge of the squares of pixels whose samples are traced together: a multiple of the groups.
    fn region(self) -> u32 {
        (self.width.max(self.height) * self.spacing).max(16)
    }
}

/// The groups of some samples: a grid of square regions, each divided alike. The grid is shifted and the groups change from
/// pass to pass, so that no two pixels are always apart.
#[derive(Clone, Debug)]
pub struct Tiling {
    /// Edge of a region in pixels.
    region: u32,
    /// How far the regions are shifted to the left and up, in pixels below the edge.
    shift: (u32, u32),
    /// Pixels of a group.
    group: usize,
    /// By pixel of a region, row by row: the place of its samples among those of the region with the same index. The
    /// members of a group follow each other.
    places: Vec<u16>,
}

impl Tiling {
    /// The groups of the samples from `first_sample` to the next multiple of 8.
    pub fn new(shape: GroupShape, first_sample: u32) -> Tiling {
        let pass = first_sample / INTERVAL;
        let region = shape.region();
        let places = (0..region * region).map(|i| place(shape, pass, i % region, i / region)).collect();
        Tiling { region, shift: shift(pass, region), group: shape.pixels() as usize, places }
    }

    /// Edge of a region in pixels. Blocks begin and end where regions do, or the picture does.
    pub fn region(&self) -> u32 {
        self.region
    }

    /// How far the regions are shifted to the left and up, in pixels.
    pub fn shift(&self) -> (u32, u32) {
        self.shift
    }

    /// Pixels of a group.
    pub fn group(&self) -> usize {
        self.group
    }

    /// The places of all samples of a block that is one wave. Members of a group have places that follow each other, from
    /// a multiple of their number on; places of pixels beyond the block stay empty.
    pub(super) fn number(&self, block: &Block, count: usize, places: &mut [u16; LENGTH]) {
        let (edge, (left, top)) = (self.region, self.shift);
        let column_of = |x: u32| (x + left) / edge;
        let (first_column, first_row) = (column_of(block.x0), (block.y0 + top) / edge);
        let columns = column_of(block.x0 + block.width - 1) - first_column + 1;
        let mut at = Cursor::new(block, 0);
        for place in &mut places[..count.min(WAVE)] {
            let (x, y) = (at.x + left, at.y + top);
            let region = (y / edge - first_row) * columns + x / edge - first_column;
            let pixel = self.places[(y % edge * edge + x % edge) as usize];
            let first = (region * block.samples + at.sample as u32) * edge * edge;
            *place = first as u16 + pixel;
            at.advance(u64::from(block.samples));
        }
    }
}

/// The place of a pixel of a region.
fn place(shape: GroupShape, pass: u32, x: u32, y: u32) -> u16 {
    let GroupShape { width, height, spacing } = shape;
    let (column, row) = (x / spacing, y / spacing);
    let columns = shape.region() / spacing;
    // The pixels of each cell are dealt to the groups in an order of its own.
    let key = hash32(pass.wrapping_mul(0x9e37_79b9) ^ hash32(row * columns + column));
    let (dx, dy) = (x % spacing ^ key % spacing, y % spacing ^ (key >> 8) % spacing);
    let (dx, dy) = if key >> 16 & 1 == 0 { (dx, dy) } else { (dy, dx) };
    let block = row / height * (columns / width) + column / width;
    let group = (block * spacing + dy) * spacing + dx;
    let member = row % height * width + column % width;
    (group * shape.pixels() + member) as u16
}

/// How far the regions are shifted in a pass: points of the plane that fill it evenly (the R2 sequence of Roberts 2018).
fn shift(pass: u32, region: u32) -> (u32, u32) {
    let step = |increment: u32| pass.wrapping_mul(increment) >> (32 - region.trailing_zeros());
    (step(0xc13f_a9a9), step(0x91e1_0da5))
}
