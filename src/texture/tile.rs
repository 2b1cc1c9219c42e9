//! Tiles of 64 x 64 texels, and their lossless compression.
//!
//! Residuals of a linear predictor (left + above - above left), one plane of bytes a channel, are Huffman coded by `fdeflate`, whose
//! tables are made for residuals of images: twice as fast as DEFLATE's level 1, which gains little on them. Texels lie row by row
//! inside a tile: one of 12 KiB fits into the first level of a cache, where their order makes no difference.

use crate::image::{Image, Pixels};
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
        let (mut starts, mut bytes) = (vec![0], Vec::new());
        let mut residuals = Vec::new();
        for tile in 0..count(level.width, level.height) {
            let at = Area::of(tile, level.width, level.height);
            residuals.clear();
            match &*level.pixels {
                Pixels::U8(data) => predict(data, level, &at, &mut residuals, |residual, out| out.push(residual)),
                Pixels::U16(data) => predict(data, level, &at, &mut residuals, |residual, out| {
                    // Around 0 on both sides, so that the upper byte is mostly 0.
                    let [low, high] = (residual << 1 ^ 0u16.wrapping_sub(residual >> 15)).to_le_bytes();
                    out.extend([high, low]);
                }),
                Pixels::F32(_) | Pixels::Encoded(_) => {}
            }
            bytes.extend(fdeflate::compress_to_vec(&residuals));
            starts.push(bytes.len());
        }
        bytes.shrink_to_fit();
        let like = Image { pixels: Arc::new(Pixels::U8(Vec::new())), ..level.clone() };
        let like = match &*level.pixels {
            Pixels::U16(_) => Image { pixels: Arc::new(Pixels::U16(Vec::new())), ..like },
            _ => like,
        };
        PackedLevel { like, starts, bytes, last_use: AtomicU64::new(0) }
    }

    /// A tile, decompressed.
    pub fn tile(&self, tile: u32) -> Image {
        let at = Area::of(tile, self.like.width, self.like.height);
        let n = self.like.channels as usize;
        let count = (at.width * at.height) as usize * n;
        let packed = &self.bytes[self.starts[tile as usize]..self.starts[tile as usize + 1]];
        // What was compressed here can be decompressed; nothing else is in the way of an empty tile becoming black.
        let residuals = fdeflate::decompress_to_vec(packed).unwrap_or_default();
        let row = at.width as usize * n;
        let pixels = match &*self.like.pixels {
            Pixels::U16(_) => {
                let mut values: Vec<u16> = residuals
                    .chunks_exact(2)
                    .map(|pair| {
                        let folded = u16::from_le_bytes([pair[1], pair[0]]);
                        folded >> 1 ^ 0u16.wrapping_sub(folded & 1)
                    })
                    .collect();
                values.resize(count, 0);
                restore(&mut values, row, n);
                Pixels::U16(values)
            }
            _ => {
                let mut values = residuals;
                values.resize(count, 0);
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

/// Tiles in a row.
pub(super) fn across(width: u32) -> u32 {
    width.div_ceil(SIDE)
}

/// Tiles of a level.
fn count(width: u32, height: u32) -> u32 {
    across(width) * across(height)
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

/// What the predictor misses in a tile, each number handed to `write`.
fn predict<T: Code>(
    data: &[T],
    level: &Image,
    at: &Area,
    out: &mut Vec<u8>,
    write: impl Fn(T, &mut Vec<u8>),
) {
    let n = level.channels as usize;
    let (stride, row) = (level.width as usize * n, at.width as usize * n);
    let line = |y: u32| {
        let start = (at.y + y) as usize * stride + at.x as usize * n;
        &data[start..start + row]
    };
    // Differences to the line above, then to the left.
    let mut rises = vec![T::default(); row];
    for y in 0..at.height {
        let here = line(y);
        match y {
            0 => rises.copy_from_slice(here),
            _ => {
                let above = line(y - 1);
                (0..row).for_each(|i| rises[i] = here[i].minus(above[i]));
            }
        }
        (0..row).for_each(|i| write(if i < n { rises[i] } else { rises[i].minus(rises[i - n]) }, out));
    }
}

/// The numbers of a tile from the residuals, in place.
fn restore<T: Code>(values: &mut [T], row: usize, n: usize) {
    for line in values.chunks_exact_mut(row) {
        (n..row).for_each(|i| line[i] = line[i].plus(line[i - n]));
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
        let value = |i: u32| i.wrapping_mul(2_654_435_761) >> 20 ^ i / 7;
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
        let codes = (0..256 * 256u32).map(|i| ((i % 256 + i / 256) / 2) as u8).collect();
        let smooth = Image { pixels: Arc::new(Pixels::U8(codes)), ..level(256, 256, 1, false) };
        assert!(PackedLevel::new(&smooth).bytes() < 256 * 256 / 4);
    }
}
