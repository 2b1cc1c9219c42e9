//! Planes of floats with mirrored edges, so that windows need no bounds.

use crate::sampling::hash::hash32;

/// Radius of the window of pixels that a pixel is made from.
pub(super) const RADIUS: usize = 9;
/// Radius of the patches by which pixels are compared.
pub(super) const PATCH: usize = 3;
/// Edge of the squares that are worked on at a time, pixels.
pub(super) const TILE: usize = 32;
/// Pixels beyond the edges that exist on the left and above; on the right and below as many beyond the last tile.
const BORDER: usize = RADIUS + PATCH;
/// Pixels that are worked on together.
pub(super) const LANES: usize = 16;
/// A number for each of them.
pub(super) type Lanes = [f32; LANES];
/// Whole vectors that lie in cache lines of their own.
#[repr(align(64))]
pub(super) struct Aligned<T>(pub T);
/// Loops run over whole vectors and read a bit beyond what they need.
const SLACK: usize = LANES;

/// Values are kept within this, so that squares are finite.
const LARGEST: f32 = 1e15;

/// Some planes of one picture, each with a border.
#[derive(Clone, Debug)]
pub(super) struct Planes {
    pub width: usize,
    pub height: usize,
    pub count: usize,
    stride: usize,
    rows: usize,
    data: Vec<f32>,
}

impl Planes {
    /// Zeros.
    pub fn new(width: usize, height: usize, count: usize) -> Planes {
        let stride = width.next_multiple_of(TILE) + 2 * BORDER + SLACK;
        let rows = height.next_multiple_of(TILE) + 2 * BORDER;
        Planes { width, height, count, stride, rows, data: vec![0.0; stride * rows * count] }
    }

    /// Of lists of `width * height` values, rows from the top.
    pub fn of(width: usize, height: usize, lists: &[&[f32]]) -> Planes {
        let mut planes = Planes::new(width, height, lists.len());
        for (plane, list) in lists.iter().enumerate() {
            for (y, row) in list.chunks_exact(width).enumerate() {
                let at = planes.place(plane, 0, y as isize);
                let to = &mut planes.data[at..at + width];
                to.iter_mut().zip(row).for_each(|(to, v)| *to = finite(*v));
            }
        }
        planes.mirror();
        planes
    }

    /// Where a pixel stands in [`Planes::data`]; up to the border beyond the picture.
    #[inline(always)]
    pub fn place(&self, plane: usize, x: isize, y: isize) -> usize {
        let row = (y + BORDER as isize) as usize + plane * self.rows;
        row * self.stride + (x + BORDER as isize) as usize
    }

    /// How far apart the planes' values of a pixel stand.
    #[inline(always)]
    pub fn plane_length(&self) -> usize {
        self.rows * self.stride
    }

    /// The place of the pixel at an offset from that at a place.
    #[inline(always)]
    pub fn moved(&self, place: usize, dx: isize, dy: isize) -> usize {
        (place as isize + dy * self.stride as isize + dx) as usize
    }

    /// All values of all planes.
    #[inline(always)]
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// A row of a plane without its border.
    pub fn row(&self, plane: usize, y: usize) -> &[f32] {
        let at = self.place(plane, 0, y as isize);
        &self.data[at..at + self.width]
    }

    /// The same to write; call [`Planes::mirror`] afterwards.
    pub fn row_mut(&mut self, plane: usize, y: usize) -> &mut [f32] {
        let at = self.place(plane, 0, y as isize);
        &mut self.data[at..at + self.width]
    }

    /// The values of a plane without its border.
    pub fn list(&self, plane: usize) -> Vec<f32> {
        (0..self.height).flat_map(|y| self.row(plane, y)).copied().collect()
    }

    /// A function of each value of some of this picture's planes and of others.
    pub fn zip(&self, other: &Planes, f: impl Fn(f32, f32) -> f32) -> Planes {
        let mut result = self.clone();
        result.data.iter_mut().zip(&other.data).for_each(|(a, b)| *a = f(*a, *b));
        result
    }

    /// Averages over squares of this radius, at most that of windows.
    pub fn smoothed(&self, radius: usize) -> Planes {
        let side = 2 * radius + 1;
        let mut result = self.clone();
        let mut sums = vec![0.0f32; self.width + 2 * radius];
        for plane in 0..self.count {
            for y in 0..self.height {
                sums.fill(0.0);
                for k in 0..side {
                    let y = (y + k) as isize - radius as isize;
                    let from = self.place(plane, -(radius as isize), y);
                    let row = &self.data[from..from + sums.len()];
                    sums.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
                }
                for (x, value) in result.row_mut(plane, y).iter_mut().enumerate() {
                    *value = sums[x..x + side].iter().sum::<f32>() / (side * side) as f32;
                }
            }
        }
        result.mirror();
        result
    }

    /// All values, each with a sign of its own that has no pattern.
    pub fn with_random_signs(mut self) -> Planes {
        for (i, value) in self.data.iter_mut().enumerate() {
            *value = if hash32(i as u32) >> 31 == 0 { *value } else { -*value };
        }
        self.mirror();
        self
    }

    /// The same, but for values of others where those of lists, which these were made from, are not finite.
    pub fn with_gaps_from(mut self, lists: &[&[f32]], others: &Planes) -> Planes {
        for (plane, list) in lists.iter().enumerate() {
            for (y, row) in list.chunks_exact(self.width).enumerate() {
                let filled = self.row_mut(plane, y).iter_mut().zip(others.row(plane, y)).zip(row);
                filled.filter(|(_, given)| !given.is_finite()).for_each(|((own, other), _)| *own = *other);
            }
        }
        self.mirror();
        self
    }

    /// Adds the planes of others behind these.
    pub fn append(&mut self, others: &Planes) {
        self.data.extend_from_slice(&others.data);
        self.count += others.count;
    }

    /// Some of the planes.
    pub fn part(&self, planes: std::ops::Range<usize>) -> Planes {
        let length = self.plane_length();
        let data = self.data[planes.start * length..planes.end * length].to_vec();
        Planes { count: planes.len(), data, ..*self }
    }

    /// Fills the borders with what the picture shows on the other side of its edges.
    pub fn mirror(&mut self) {
        let (width, height, stride) = (self.width, self.height, self.stride);
        let source = |k: usize, size: usize| mirrored(k as isize - BORDER as isize, size) + BORDER;
        let columns: Vec<usize> = (0..stride).map(|k| source(k, width)).collect();
        for plane in self.data.chunks_exact_mut(stride * self.rows) {
            for y in BORDER..BORDER + height {
                let row = &mut plane[y * stride..(y + 1) * stride];
                for k in (0..BORDER).chain(BORDER + width..stride) {
                    row[k] = row[columns[k]];
                }
            }
            for y in (0..BORDER).chain(BORDER + height..self.rows) {
                let from = source(y, height) * stride;
                plane.copy_within(from..from + stride, y * stride);
            }
        }
    }
}

/// What can be squared.
fn finite(value: f32) -> f32 {
    if value.is_finite() { value.clamp(-LARGEST, LARGEST) } else { 0.0 }
}

/// As many values as a vector has.
#[inline(always)]
pub(super) fn lanes(data: &[f32], at: usize) -> &Lanes {
    data[at..at + LANES].first_chunk().expect("as many")
}

/// As many values as a tile's row with its patches has.
#[inline(always)]
pub(super) fn wide(data: &[f32], at: usize) -> &[f32; TILE + LANES] {
    data[at..at + TILE + LANES].first_chunk().expect("as many")
}

/// The pixel that is seen at a place beyond the edges.
fn mirrored(place: isize, size: usize) -> usize {
    let period = 2 * size as isize;
    let place = place.rem_euclid(period);
    (if place < size as isize { place } else { period - 1 - place }) as usize
}
