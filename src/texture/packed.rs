//! Lossless compression of mip levels with random access to texels.
//
// A level is cut into tiles of 64 x 64 texels, and a tile into blocks of 8 x 8. A block stores the minimum of each channel and the
// differences from it, each in as many bits as the largest needs ("frame of reference": Goldstein, Ramakrishnan, Shaft 1998, "Compressing
// Relations and Indexes"). Floats are stored by their bit patterns, without the trailing zero bits common to a block: many, if they were
// converted from half floats or Radiance files. Photographs are compressed to 30 to 70 %, smooth images to 4 to 10 %; a texel is decoded by a
// few additions, without its neighbours. Tried and rejected: Huffman codes of predicted residuals, which are 0 to 15 % smaller, but take
// 15 us to decode a tile before its first texel is known.
//
// Layout of a tile, little-endian: 64 offsets of blocks from the start of the tile as u16, in bytes (floats: in units of 8 bytes); the
// blocks; 8 zero bytes, so that eight bytes can be read at each difference, even at zero-bit differences after the last block. Layout
// of a block: for each channel the minimum (1, 2 or 4 bytes) and the number of bits of a difference (1 byte), for floats also the
// number of omitted zero bits (1 byte) and 2 zero bytes; then 64 differences for each channel, row by row.

use super::pyramid::Threads;
use super::store::{Store, TileKey, TileRow};
use crate::image::{Codes, Encoding, Image, Pixels, spread};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Width and height of a tile, texels; tiles at the right and lower border are smaller.
pub(super) const SIDE: u32 = 64;

/// Width and height of a block, texels.
const BLOCK: u32 = 8;

const BLOCK_TEXELS: usize = (BLOCK * BLOCK) as usize;

/// Blocks along a side of a tile.
const BLOCKS_ACROSS: u32 = SIDE / BLOCK;

/// Size of the offsets of a tile's blocks, bytes.
const OFFSETS_BYTES: usize = (BLOCKS_ACROSS * BLOCKS_ACROSS) as usize * 2;

/// The type of a stored component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Component {
    U8,
    U16,
    F32,
}

impl Component {
    const fn bytes(self) -> usize {
        match self {
            Component::U8 => 1,
            Component::U16 => 2,
            Component::F32 => 4,
        }
    }

    /// Size of a channel's header in a block, bytes.
    const fn header(self) -> usize {
        match self {
            Component::U8 => 2,
            Component::U16 => 3,
            Component::F32 => 8,
        }
    }

    /// Unit of the offsets of blocks, bytes.
    const fn step(self) -> usize {
        if matches!(self, Component::F32) { 8 } else { 1 }
    }
}

/// Channels, component type and encoding of texels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Format {
    channels: u32,
    component: Component,
    encoding: Encoding,
}

impl Format {
    /// The format of a decoded image.
    fn of(image: &Image) -> Format {
        let component = match *image.pixels {
            Pixels::U8(_) | Pixels::Encoded(_) => Component::U8,
            Pixels::U16(_) => Component::U16,
            Pixels::F32(_) => Component::F32,
        };
        Format { channels: image.channels, component, encoding: image.encoding }
    }

    /// Linear RGBA of the texel at a position in a tile; black if bytes are missing.
    #[inline]
    pub fn texel(self, tile: &[u8], x: u32, y: u32) -> [f32; 4] {
        let n = self.channels as usize;
        match self.component {
            Component::U8 => {
                let codes = self.codes::<{ Component::U8.bytes() }>(tile, x, y).unwrap_or_default();
                Codes::U8(&codes.map(|code| code as u8)[..n]).rgba(self.encoding)
            }
            Component::U16 => {
                let codes = self.codes::<{ Component::U16.bytes() }>(tile, x, y).unwrap_or_default();
                Codes::U16(&codes.map(|code| code as u16)[..n]).rgba(self.encoding)
            }
            Component::F32 => {
                let codes = self.codes::<{ Component::F32.bytes() }>(tile, x, y).unwrap_or_default();
                spread(&codes.map(f32::from_bits)[..n])
            }
        }
    }

    /// The components of a texel, of `BYTES` bytes each, floats as bit patterns; `None` if bytes are missing.
    #[inline]
    fn codes<const BYTES: usize>(self, tile: &[u8], x: u32, y: u32) -> Option<[u32; 4]> {
        let (channels, header) = (self.channels as usize, self.component.header());
        let block = (y / BLOCK * BLOCKS_ACROSS + x / BLOCK) as usize;
        let texel = (y % BLOCK * BLOCK + x % BLOCK) as usize;
        let offset = u16::from_le_bytes(tile.get(block * 2..block * 2 + 2)?.try_into().ok()?);
        let start = usize::from(offset) * self.component.step();
        let mut bits = start + channels * header;
        let headers = tile.get(start..bits)?;
        let mut codes = [0; 4];
        for (code, header) in codes.iter_mut().zip(headers.chunks_exact(header)) {
            let minimum =
                header[..BYTES].iter().rev().fold(0u32, |minimum, &byte| minimum << 8 | u32::from(byte));
            let width = usize::from(header[BYTES].min(BYTES as u8 * 8));
            let zeros = if BYTES == 4 { u32::from(header[5].min(31)) } else { 0 };
            let bit = texel * width;
            let at = bits + bit / 8;
            let chunk = u64::from_le_bytes(tile.get(at..at + 8)?.try_into().ok()?);
            let difference = (chunk >> (bit % 8) & ((1 << width) - 1)) as u32;
            *code = minimum.wrapping_add(difference << zeros);
            bits += width * BLOCK_TEXELS / 8;
        }
        Some(codes)
    }
}

/// A compressed level.
#[derive(Debug)]
pub(super) struct PackedLevel {
    format: Format,
    /// Rows of tiles, from the top down.
    rows: Vec<PackedRow>,
}

/// A row of compressed tiles.
#[derive(Debug)]
struct PackedRow {
    /// End of each tile in the row's bytes.
    ends: Vec<u32>,
    bytes: TileRow,
}

impl PackedRow {
    fn tile(&self, column: u32) -> Range<usize> {
        let end = |column: u32| self.ends[column as usize] as usize;
        column.checked_sub(1).map_or(0, end)..end(column)
    }
}

/// Compresses a float level while its rows are added, from the top down.
#[derive(Debug)]
pub(super) struct Packing {
    /// Size and format of the level; the pixels are the rows of the next, still incomplete row of tiles.
    waiting: Image,
    rows: Vec<PackedRow>,
}

impl Packing {
    /// Starts a level with the size and the format of `level`, whose pixels are ignored.
    pub fn new(level: Image) -> Packing {
        Packing { waiting: Image { pixels: Arc::new(Pixels::F32(Vec::new())), ..level }, rows: Vec::new() }
    }

    /// Adds whole rows.
    pub fn add(&mut self, mut numbers: &[f32], threads: Threads, store: &Store) {
        let Image { width, height, channels, .. } = self.waiting;
        let row_length = width as usize * channels as usize;
        while !numbers.is_empty() {
            let missing = (height - self.rows.len() as u32 * SIDE).min(SIDE) as usize * row_length;
            let Some(Pixels::F32(waiting)) = Arc::get_mut(&mut self.waiting.pixels) else { return };
            let (now, later) = numbers.split_at((missing - waiting.len()).min(numbers.len()));
            waiting.extend(now);
            numbers = later;
            if waiting.len() == missing {
                self.rows.push(packed_strip(&self.waiting, threads, store));
                if let Some(Pixels::F32(waiting)) = Arc::get_mut(&mut self.waiting.pixels) {
                    waiting.clear();
                }
            }
        }
    }

    /// The level, after all its rows have been added.
    pub fn finish(self) -> PackedLevel {
        PackedLevel { format: Format::of(&self.waiting), rows: self.rows }
    }
}

/// Compresses a row of tiles. The pixels of `strip` are only those of this row, although its height is that of the level.
fn packed_strip(strip: &Image, threads: Threads, store: &Store) -> PackedRow {
    let rows = match &*strip.pixels {
        Pixels::F32(numbers) => numbers.len() / (strip.width * strip.channels) as usize,
        _ => 0,
    };
    let strip = Image { height: rows as u32, ..strip.clone() };
    if threads == Threads::This {
        return packed_row(&strip, 0, store);
    }
    let columns = (0..strip.width.div_ceil(SIDE)).into_par_iter().with_min_len(8);
    let tiles: Vec<Vec<u8>> = columns.map(|column| packed_tile(&strip, [column, 0])).collect();
    let ends = tiles.iter().scan(0, |end, tile| {
        *end += tile.len() as u32;
        Some(*end)
    });
    PackedRow { ends: ends.collect(), bytes: store.keep(tiles.concat()) }
}

fn packed_tile(level: &Image, tile: [u32; 2]) -> Vec<u8> {
    let mut bytes = Vec::new();
    pack(level, tile, &mut bytes);
    bytes
}

impl PackedLevel {
    /// Compresses a level (an encoded one to black) into a store, on this thread.
    pub fn new(level: &Image, store: &Store) -> PackedLevel {
        let rows = (0..level.height.div_ceil(SIDE)).map(|row| packed_row(level, row, store)).collect();
        PackedLevel { format: Format::of(level), rows }
    }

    /// Compresses a level into a store, on all threads.
    pub fn new_by_all_threads(level: &Image, store: &Store) -> PackedLevel {
        let rows = 0..level.height.div_ceil(SIDE);
        let rows = rows.into_par_iter().map(|row| packed_row(level, row, store)).collect();
        PackedLevel { format: Format::of(level), rows }
    }

    /// Linear RGBA of the texel at a position; `id` identifies the level in the store.
    #[inline]
    pub fn texel(&self, x: u32, y: u32, id: u64, store: &Store) -> [f32; 4] {
        let (column, row) = (x / SIDE, y / SIDE);
        let found = &self.rows[row as usize];
        let texel = |tile: &[u8]| self.format.texel(tile, x % SIDE, y % SIDE);
        match &found.bytes {
            TileRow::Memory(bytes) => texel(&bytes[found.tile(column)]),
            TileRow::File(start) => {
                let key = TileKey { level: id, row, column };
                let Range { start: first, end } = found.tile(column);
                store.with_tile(key, start + first as u64, end - first, texel)
            }
        }
    }

    /// Size in memory, bytes.
    pub fn bytes(&self) -> usize {
        let of_row = |row: &PackedRow| match &row.bytes {
            TileRow::Memory(bytes) => bytes.len() + row.ends.len() * size_of::<u32>(),
            TileRow::File(_) => row.ends.len() * size_of::<u32>(),
        };
        self.rows.iter().map(of_row).sum()
    }
}

fn packed_row(level: &Image, row: u32, store: &Store) -> PackedRow {
    let (mut ends, mut bytes) = (Vec::new(), Vec::new());
    for column in 0..level.width.div_ceil(SIDE) {
        pack(level, [column, row], &mut bytes);
        ends.push(bytes.len() as u32);
    }
    PackedRow { ends, bytes: store.keep(bytes) }
}

/// Appends a compressed tile to its row; nothing for an encoded level.
fn pack(level: &Image, tile: [u32; 2], out: &mut Vec<u8>) {
    match &*level.pixels {
        Pixels::U8(data) => pack_tile(data, level, tile, |v| v.into(), out),
        Pixels::U16(data) => pack_tile(data, level, tile, |v| v.into(), out),
        Pixels::F32(data) => pack_tile(data, level, tile, f32::to_bits, out),
        Pixels::Encoded(_) => {}
    }
}

/// Appends a compressed tile to its row; `code` gives the bits of a component.
fn pack_tile<T: Copy>(data: &[T], level: &Image, tile: [u32; 2], code: impl Fn(T) -> u32, out: &mut Vec<u8>) {
    match level.channels {
        1 => pack_tile_of::<T, 1>(data, level, tile, code, out),
        2 => pack_tile_of::<T, 2>(data, level, tile, code, out),
        3 => pack_tile_of::<T, 3>(data, level, tile, code, out),
        _ => pack_tile_of::<T, 4>(data, level, tile, code, out),
    }
}

/// Appends a compressed tile of `N` channels to its row.
fn pack_tile_of<T: Copy, const N: usize>(
    data: &[T],
    level: &Image,
    [column, row]: [u32; 2],
    code: impl Fn(T) -> u32,
    out: &mut Vec<u8>,
) {
    let component = Format::of(level).component;
    let texels = data.as_chunks::<N>().0;
    let start = out.len();
    out.resize(start + OFFSETS_BYTES, 0);
    let side = |at: u32, size: u32| (size - at * SIDE).min(SIDE);
    let (width, height) = (side(column, level.width), side(row, level.height));
    for y in (0..height).step_by(BLOCK as usize) {
        for x in (0..width).step_by(BLOCK as usize) {
            let block = (y / BLOCK * BLOCKS_ACROSS + x / BLOCK) as usize;
            let offset = (((out.len() - start) / component.step()) as u16).to_le_bytes();
            out[start + block * 2..start + block * 2 + 2].copy_from_slice(&offset);
            let first = (row * SIDE + y) as usize * level.width as usize + (column * SIDE + x) as usize;
            let size = [(width - x).min(BLOCK), (height - y).min(BLOCK)].map(|n| n as usize);
            let values = block_of(&texels[first..], level.width as usize, size, &code);
            pack_block(&values, component, out);
        }
    }
    out.extend([0; 8]);
}

/// The components of a block by channel; its first texel is the first of `texels`. Texels beyond the border of a level repeat the first
/// one.
#[inline]
fn block_of<T: Copy, const N: usize>(
    texels: &[[T; N]],
    row_length: usize,
    [width, height]: [usize; 2],
    code: impl Fn(T) -> u32,
) -> [[u32; BLOCK_TEXELS]; N] {
    let mut values = texels[0].map(|value| [code(value); BLOCK_TEXELS]);
    for line in 0..height {
        let from = &texels[line * row_length..][..width];
        for (column, texel) in from.iter().enumerate() {
            for c in 0..N {
                values[c][line * BLOCK as usize + column] = code(texel[c]);
            }
        }
    }
    values
}

fn pack_block<const N: usize>(channels: &[[u32; BLOCK_TEXELS]; N], component: Component, out: &mut Vec<u8>) {
    let frames = channels.each_ref().map(|values| Frame::of(values, component));
    for frame in &frames {
        out.extend(&frame.minimum.to_le_bytes()[..component.bytes()]);
        out.extend(&[frame.width as u8, frame.zeros as u8, 0, 0][..component.header() - component.bytes()]);
    }
    for (values, frame) in channels.iter().zip(&frames) {
        pack_bits(values, frame, out);
    }
}

/// The frame of reference of a channel in a block: differences from `minimum` are stored.
struct Frame {
    minimum: u32,
    /// Component of lowest bits that are omitted, since they are equal in all values; 0 except for floats.
    zeros: u32,
    /// Bits of a stored difference.
    width: u32,
}

impl Frame {
    fn of(values: &[u32; BLOCK_TEXELS], component: Component) -> Frame {
        let (mut minimum, mut maximum, mut differing) = (u32::MAX, 0, 0);
        for &value in values {
            (minimum, maximum) = (value.min(minimum), value.max(maximum));
            differing |= value ^ values[0];
        }
        let zeros = if component == Component::F32 { differing.trailing_zeros().min(31) } else { 0 };
        Frame { minimum, zeros, width: u32::BITS - ((maximum - minimum) >> zeros).leading_zeros() }
    }
}

/// Appends the differences from the minimum, with the number of bits of the frame of reference.
fn pack_bits(values: &[u32; BLOCK_TEXELS], &Frame { minimum, zeros, width }: &Frame, out: &mut Vec<u8>) {
    // Eight differences at a time fill whole bytes.
    for chunk in values.chunks_exact(8).filter(|_| width > 0) {
        let (mut packed, mut at) = ([0; 40], 0);
        let (mut bits, mut count) = (0u64, 0);
        for &value in chunk {
            bits |= u64::from((value - minimum) >> zeros) << count;
            count += width;
            if count >= 32 {
                packed[at..at + 4].copy_from_slice(&(bits as u32).to_le_bytes());
                (bits, count, at) = (bits >> 32, count - 32, at + 4);
            }
        }
        packed[at..at + 8].copy_from_slice(&bits.to_le_bytes());
        out.extend(&packed[..width as usize]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COMPONENTS: [Component; 3] = [Component::U8, Component::U16, Component::F32];

    /// A level with a noisy pattern.
    fn level(width: u32, height: u32, channels: u32, component: Component) -> Image {
        let count = width * height * channels;
        let value = |i: u32| (i.wrapping_mul(2_654_435_761) >> 20) ^ (i / 7);
        let pixels = match component {
            Component::U8 => Pixels::U8((0..count).map(|i| value(i) as u8).collect()),
            Component::U16 => Pixels::U16((0..count).map(|i| (value(i) * 31) as u16).collect()),
            // Of both signs, some with exponents far apart, some with few significant bits.
            Component::F32 => Pixels::F32((0..count).map(|i| float(i, value(i))).collect()),
        };
        let pixels = Arc::new(pixels);
        Image { name: "a".into(), width, height, channels, encoding: Encoding::Srgb, pixels }
    }

    fn float(i: u32, value: u32) -> f32 {
        match i / 1000 % 4 {
            0 => value as f32 / 7.0,
            1 => value as f32 / 16.0,
            2 => (value as f32 - 2000.0) * 1e30,
            _ => f32::from_bits(i.wrapping_mul(2_654_435_761) & !(1 << 30)),
        }
    }

    /// A store with a memory limit.
    fn store(bytes: u64) -> Store {
        Store::new(bytes, 1 << 20)
    }

    #[test]
    fn packed_texels_equal_those_of_the_level() {
        // Ids are unique among the levels of all tests.
        let mut ids = 1 << 32..;
        for (width, height) in [(64, 64), (1, 1), (130, 65), (63, 200), (1, 129)] {
            for (channels, component) in (1..=4).flat_map(|n| COMPONENTS.map(|component| (n, component))) {
                let level = level(width, height, channels, component);
                for room in [0, 60_000, 1 << 40] {
                    let (store, id) = (store(room), ids.next().expect("there are more"));
                    let packed = PackedLevel::new(&level, &store);
                    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                        let found = packed.texel(x, y, id, &store);
                        assert_eq!(found, level.rgba(x, y), "{width} {channels} {room} {x} {y}");
                    }
                }
            }
        }
    }

    #[test]
    fn differences_of_all_widths_are_lossless() {
        for bits in 0..=16u32 {
            let maximum = ((1u32 << bits) - 1) as u16;
            let value =
                |i: u32| 7u16.saturating_add(if i % 3 == 1 { maximum } else { maximum & (i * 977) as u16 });
            let pixels = Arc::new(Pixels::U16((0..64).map(value).collect()));
            let level = Image { pixels, ..level(8, 8, 1, Component::U16) };
            let store = store(1 << 20);
            let packed = PackedLevel::new(&level, &store);
            (0..64).for_each(|i| {
                assert_eq!(packed.texel(i % 8, i / 8, 0, &store), level.rgba(i % 8, i / 8), "{bits} {i}");
            });
        }
    }

    #[test]
    fn smooth_images_are_compressed_more() {
        let codes = (0..256 * 256u32).map(|i| (i % 256 / 8 + i / 2048) as u8).collect();
        let smooth = Image { pixels: Arc::new(Pixels::U8(codes)), ..level(256, 256, 1, Component::U8) };
        assert!(PackedLevel::new(&smooth, &store(1 << 20)).bytes() < 256 * 256 / 6);
    }

    #[test]
    fn texels_with_missing_bytes_are_black() {
        for (component, tile) in
            COMPONENTS.into_iter().flat_map(|n| [&[][..], &[0; 40], &[255; 200]].map(|tile| (n, tile)))
        {
            let format = Format { channels: 3, component, encoding: Encoding::Srgb };
            let [.., alpha] = format.texel(tile, 63, 63);
            assert_eq!(alpha, 1.0);
            assert_eq!(format.texel(&[0; 200], 5, 5), [0.0, 0.0, 0.0, 1.0]);
        }
    }
}
