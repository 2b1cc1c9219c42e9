//! Tiles of 64 x 64 texels, and their lossless compression.
//!
//! Residuals of a linear predictor (left + above - above left), one plane of bytes a channel, are Huffman coded by `fdeflate`, whose
//! tables are made for residuals of images: twice as fast as DEFLATE's level 1, which gains little on them. Texels lie row by row
//! inside a tile: one of 12 KiB fits into the first level of a cache, where their order makes no difference.

use crate::image::{Image, Pixels};
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

/// Width and height of a tile; those at the right and lower border are smaller.
pub(super) const SIDE: u32 = 64;

/// A level cut into compressed tiles, row by row.
#[derive(Debug)]
pub(super) struct PackedLevel {
    /// Size and format; no pixels.
    like: Image,
    /// Where each tile begins, and where the last one ends.
    starts: Vec<usize>,
    bytes: Vec<u8>,
    /// When it was used last, by the clock of its [store](super::store::Store).
    pub last_use: AtomicU64,
}

impl PackedLevel {
    /// Compresses a level of 8 or 16 bits. Others have no tiles.
    pub fn new(level: &Image) -> PackedLevel {
        PackedLevel::of(level, (0..rows(level)).map(|row| packed_row(level, row)))
    }

    /// The same with the help of other threads.
    pub fn new_by_all_threads(level: &Image) -> PackedLevel {
        let packed: Vec<_> = (0..rows(level)).into_par_iter().map(|row| packed_row(level, row)).collect();
        PackedLevel::of(level, packed.into_iter())
    }

    fn of(level: &Image, packed: impl Iterator<Item = (Vec<usize>, Vec<u8>)>) -> PackedLevel {
        let (mut starts, mut bytes) = (vec![0], Vec::new());
        for (lengths, row) in packed {
            starts.extend(lengths.iter().scan(bytes.len(), |end, length| {
                *end += length;
                Some(*end)
            }));
            bytes.extend(row);
        }
        bytes.shrink_to_fit();
        let pixels = match &*level.pixels {
            Pixels::U16(_) => Pixels::U16(Vec::new()),
            _ => Pixels::U8(Vec::new()),
        };
        let like = Image { pixels: Arc::new(pixels), ..level.clone() };
        PackedLevel { like, starts, bytes, last_use: AtomicU64::new(0) }
    }

    /// A tile, decompressed.
    pub fn tile(&self, tile: u32) -> Image {
        let at = Area::of(tile, self.like.width, self.like.height);
        let n = self.like.channels as usize;
        let is_deep = matches!(*self.like.pixels, Pixels::U16(_));
        let count = (at.width * at.height) as usize * n;
        let packed = &self.bytes[self.starts[tile as usize]..self.starts[tile as usize + 1]];
        let mut residuals = vec![0; count * if is_deep { 2 } else { 1 }];
        let mut decompressor = fdeflate::Decompressor::new();
        decompressor.ignore_adler32();
        // It was compressed here and lacks nothing.
        let done = decompressor.read(packed, &mut residuals, 0, true);
        debug_assert!(done.is_ok_and(|(_, written)| written == residuals.len()));
        let row = at.width as usize * n;
        let pixels = match &*self.like.pixels {
            Pixels::U16(_) => {
                let mut values: Vec<u16> = residuals
                    .chunks_exact(2)
                    .map(|pair| {
                        let folded = u16::from_be_bytes([pair[0], pair[1]]);
                        folded >> 1 ^ 0u16.wrapping_sub(folded & 1)
                    })
                    .collect();
                restore(&mut values, row, n);
                Pixels::U16(values)
            }
            _ => {
                let mut values = residuals;
                restore(&mut values, row, n);
                Pixels::U8(values)
            }
        };
        let pixels = Arc::new(pixels);
        let name = String::new();
        Image { name, width: at.width, height: at.height, pixels, ..self.like }
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        self.bytes.len() + self.starts.len() * size_of::<usize>()
    }
}

/// Compresses the tiles of a row; gives the length of each, and the bytes.
fn packed_row(level: &Image, row: u32) -> (Vec<usize>, Vec<u8>) {
    let (mut lengths, mut bytes, mut residuals) = (Vec::new(), Vec::new(), Vec::new());
    for column in 0..across(level.width) {
        let at = Area::of(row * across(level.width) + column, level.width, level.height);
        residuals.clear();
        match &*level.pixels {
            Pixels::U8(data) => predict(data, level, &at, &mut residuals),
            Pixels::U16(data) => {
                let mut wide = Vec::new();
                predict(data, level, &at, &mut wide);
                // Folded to both sides of 0, so that the upper byte is mostly 0.
                let folded = wide.iter().map(|&r: &u16| r << 1 ^ 0u16.wrapping_sub(r >> 15));
                residuals.extend(folded.flat_map(u16::to_be_bytes));
            }
            Pixels::F32(_) | Pixels::Encoded(_) => {}
        }
        let packed = fdeflate::compress_to_vec(&residuals);
        lengths.push(packed.len());
        bytes.extend(packed);
    }
    (lengths, bytes)
}

/// Tiles in a row.
pub(super) fn across(width: u32) -> u32 {
    width.div_ceil(SIDE)
}

/// Rows of tiles.
fn rows(level: &Image) -> u32 {
    level.height.div_ceil(SIDE)
}

/// The texels of a tile.
struct Area {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl Area {
    fn of(tile: u32, width: u32, height: u32) -> Area {
        let (x, y) = (tile % across(width) * SIDE, tile / across(width) * SIDE);
        Area { x, y, width: (width - x).min(SIDE), height: (height - y).min(SIDE) }
    }
}

/// Whole numbers that wrap around.
trait Code: Copy + Default {
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
}

impl Code for u8 {
    fn plus(self, other: u8) -> u8 {
        self.wrapping_add(other)
    }

    fn minus(self, other: u8) -> u8 {
        self.wrapping_sub(other)
    }
}

impl Code for u16 {
    fn plus(self, other: u16) -> u16 {
        self.wrapping_add(other)
    }

    fn minus(self, other: u16) -> u16 {
        self.wrapping_sub(other)
    }
}

/// Adds what the predictor misses in a tile.
fn predict<T: Code>(data: &[T], level: &Image, at: &Area, out: &mut Vec<T>) {
    let n = level.channels as usize;
    let (stride, row) = (level.width as usize * n, at.width as usize * n);
    // Differences to the line above, then to the left.
    let mut rises = vec![T::default(); row];
    for y in 0..at.height {
        let start = (at.y + y) as usize * stride + at.x as usize * n;
        let here = &data[start..start + row];
        match y {
            0 => rises.copy_from_slice(here),
            _ => {
                let above = &data[start - stride..start - stride + row];
                let pairs = here.iter().zip(above);
                rises.iter_mut().zip(pairs).for_each(|(rise, (here, above))| *rise = here.minus(*above));
            }
        }
        out.extend_from_slice(&rises[..n]);
        out.extend(rises[n..].iter().zip(&rises).map(|(rise, left)| rise.minus(*left)));
    }
}

/// The numbers of a tile from the residuals, in place.
fn restore<T: Code>(values: &mut [T], row: usize, n: usize) {
    match n {
        1 => restore_channels::<T, 1>(values, row),
        2 => restore_channels::<T, 2>(values, row),
        3 => restore_channels::<T, 3>(values, row),
        _ => restore_channels::<T, 4>(values, row),
    }
}

fn restore_channels<T: Code, const N: usize>(values: &mut [T], row: usize) {
    for line in values.chunks_exact_mut(row) {
        let mut left = [T::default(); N];
        for texel in line.chunks_exact_mut(N) {
            for (value, left) in texel.iter_mut().zip(&mut left) {
                *left = left.plus(*value);
                *value = *left;
            }
        }
    }
    for start in (row..values.len()).step_by(row) {
        let (above, here) = values[start - row..start + row].split_at_mut(row);
        here.iter_mut().zip(above).for_each(|(value, above)| *value = value.plus(*above));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Encoding;

    /// A level of some texture with noise, of any numbers.
    fn level(width: u32, height: u32, channels: u32, is_deep: bool) -> Image {
        let count = width * height * channels;
        let value = |i: u32| (i.wrapping_mul(2_654_435_761) >> 20) ^ (i / 7);
        let pixels = match is_deep {
            true => Pixels::U16((0..count).map(|i| (value(i) * 31) as u16).collect()),
            false => Pixels::U8((0..count).map(|i| value(i) as u8).collect()),
        };
        let pixels = Arc::new(pixels);
        Image { name: "a".into(), width, height, channels, encoding: Encoding::Srgb, pixels }
    }

    #[test]
    fn tiles_hold_the_texels_of_their_level() {
        for (width, height) in [(64, 64), (1, 1), (130, 65), (63, 200), (1, 129)] {
            for channels in 1..=4 {
                for is_deep in [false, true] {
                    let level = level(width, height, channels, is_deep);
                    let packed = PackedLevel::new(&level);
                    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                        if (x * 7 + y * 3) % 11 == 0 || x == width - 1 || y == height - 1 {
                            let tile = packed.tile(y / SIDE * across(width) + x / SIDE);
                            assert_eq!(tile.rgba(x % SIDE, y % SIDE), level.rgba(x, y), "{width} {x} {y}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn smooth_images_take_less_room() {
        let codes = (0..256 * 256u32).map(|i| (i % 256 / 8 + i / 2048) as u8).collect();
        let smooth = Image { pixels: Arc::new(Pixels::U8(codes)), ..level(256, 256, 1, false) };
        assert!(PackedLevel::new(&smooth).bytes() < 256 * 256 / 4);
    }
}
