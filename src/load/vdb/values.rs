//! The values of a node: all, or only the active ones; uncompressed, or compressed by zlib or Blosc.
//!
//! Blosc buffers (formats 1 and 2) consist of blocks that are byte-shuffled, split into one stream for each byte of a number, and
//! compressed with LZ4.

use crate::math::DVec3;
use flate2::read::ZlibDecoder;
use half::f16;
use std::io::Read;

const ZIP: u32 = 1;
const ACTIVE_MASK: u32 = 2;
const BLOSC: u32 = 4;

/// The storage format of a grid's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    Half,
    Float,
    Double,
}

/// The parameters for reading values of a grid.
pub(super) struct Values {
    pub number: Number,
    /// Flags: compressed by zlib (1), active values only (2), compressed by Blosc (4).
    pub compression: u32,
    /// The background value.
    pub background: f64,
}

/// Encodings of the inactive values of a node; 0: all are the background.
mod inactive {
    /// All are the negative background.
    pub const MINUS_BACKGROUND: u8 = 1;
    /// All are one stored value.
    pub const ONE: u8 = 2;
    /// A mask selects the background or its negative.
    pub const MASKED_SIGNS: u8 = 3;
    /// A mask selects the background or one stored value.
    pub const MASKED_ONE: u8 = 4;
    /// A mask selects one of two stored values.
    pub const MASKED_TWO: u8 = 5;
    /// All values are stored.
    pub const ALL: u8 = 6;
}

impl Values {
    /// One number; f16 grids store it as f32.
    pub fn single(&self, reader: &mut Bytes) -> Result<f64, String> {
        match self.number {
            Number::Double => reader.f64(),
            Number::Half | Number::Float => Ok(f64::from(f32::from_bits(reader.u32()?))),
        }
    }

    /// The values of a node, as many as its mask has bits.
    pub fn read(&self, reader: &mut Bytes, active: &Mask) -> Result<Vec<f32>, String> {
        let kind = reader.u8()?;
        if kind > inactive::ALL {
            return Err(format!("has values of the unknown encoding {kind}"));
        }
        let mut inactive_values = [self.background, self.background];
        if kind == inactive::MINUS_BACKGROUND || kind == inactive::MASKED_SIGNS {
            inactive_values[0] = -self.background;
        }
        if [inactive::ONE, inactive::MASKED_ONE, inactive::MASKED_TWO].contains(&kind) {
            inactive_values[0] = self.single(reader)?;
        }
        if kind == inactive::MASKED_TWO {
            inactive_values[1] = self.single(reader)?;
        }
        let is_masked = [inactive::MASKED_SIGNS, inactive::MASKED_ONE, inactive::MASKED_TWO].contains(&kind);
        let selection = if is_masked { Some(Mask::read(reader, active.len())?) } else { None };
        let is_active_only = self.compression & ACTIVE_MASK != 0 && kind != inactive::ALL;
        let stored = self.numbers(reader, if is_active_only { active.count_on() } else { active.len() })?;
        if !is_active_only {
            return Ok(stored);
        }
        let mut stored = stored.into_iter();
        let value = |index: usize| match active.is_on(index) {
            true => stored.next().unwrap_or(0.0),
            false => {
                let is_second = selection.as_ref().is_some_and(|mask| mask.is_on(index));
                inactive_values[usize::from(is_second)] as f32
            }
        };
        Ok((0..active.len()).map(value).collect())
    }

    /// Decompresses `count` numbers.
    fn numbers(&self, reader: &mut Bytes, count: usize) -> Result<Vec<f32>, String> {
        let width = match self.number {
            Number::Half => 2,
            Number::Float => 4,
            Number::Double => 8,
        };
        if count == 0 && self.number == Number::Half {
            return Ok(Vec::new());
        }
        let bytes = self.decompressed(reader, count * width)?;
        let numbers = bytes.chunks_exact(width);
        Ok(match self.number {
            Number::Half => numbers.map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()).collect(),
            Number::Float => numbers.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
            Number::Double => numbers
                .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]) as f32)
                .collect(),
        })
    }

    fn decompressed(&self, reader: &mut Bytes, size: usize) -> Result<Vec<u8>, String> {
        if self.compression & (BLOSC | ZIP) == 0 {
            return Ok(reader.take(size)?.to_vec());
        }
        // Incompressible data is stored raw, after its negated length.
        let length = reader.i64()?;
        if length <= 0 {
            let stored = reader.take(usize::try_from(-(length as i128)).unwrap_or(usize::MAX))?;
            return match stored.len() == size {
                true => Ok(stored.to_vec()),
                false => Err(format!("holds {} bytes instead of {size}", stored.len())),
            };
        }
        let packed = reader.take(usize::try_from(length).unwrap_or(usize::MAX))?;
        if self.compression & BLOSC != 0 {
            return unpack(packed, size);
        }
        let mut bytes = Vec::with_capacity(size);
        let unpacked = ZlibDecoder::new(packed).take(size as u64 + 1).read_to_end(&mut bytes);
        match unpacked {
            Ok(length) if length == size => Ok(bytes),
            _ => Err("has invalid zlib data".into()),
        }
    }
}

/// A reader of little-endian data in memory. Every read is bounds-checked; errors are messages.
pub(super) struct Bytes<'a> {
    all: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    pub fn new(all: &'a [u8]) -> Bytes<'a> {
        Bytes { all, at: 0 }
    }

    /// Skips forward to an offset from the start.
    pub fn skip_to(&mut self, to: i64) -> Result<(), String> {
        if usize::try_from(to).is_ok_and(|to| to < self.at) {
            return Err("has an entry that refers to a position before itself".into());
        }
        self.seek(to)
    }

    /// Moves to an offset from the start.
    pub fn seek(&mut self, to: i64) -> Result<(), String> {
        let to = usize::try_from(to).ok().filter(|&to| to <= self.all.len());
        self.at = to.ok_or("has an offset beyond its end")?;
        Ok(())
    }

    pub fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(count).filter(|&end| end <= self.all.len());
        let Some(end) = end else {
            return Err(format!("ends too early: {count} bytes are missing at byte {}", self.at));
        };
        let found = &self.all[self.at..end];
        self.at = end;
        Ok(found)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    pub fn u8(&mut self) -> Result<u8, String> {
        Ok(self.array::<1>()?[0])
    }

    pub fn u32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub fn i32(&mut self) -> Result<i32, String> {
        Ok(i32::from_le_bytes(self.array()?))
    }

    pub fn i64(&mut self) -> Result<i64, String> {
        Ok(i64::from_le_bytes(self.array()?))
    }

    pub fn f64(&mut self) -> Result<f64, String> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    pub fn vector(&mut self) -> Result<DVec3, String> {
        Ok(DVec3::new(self.f64()?, self.f64()?, self.f64()?))
    }

    pub fn coordinates(&mut self) -> Result<[i32; 3], String> {
        Ok([self.i32()?, self.i32()?, self.i32()?])
    }

    /// A length-prefixed string.
    pub fn text(&mut self) -> Result<String, String> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }
}

/// A bit mask, lowest bit of each byte first.
pub(super) struct Mask<'a>(&'a [u8]);

impl<'a> Mask<'a> {
    /// A mask of `bits` bits, a multiple of eight.
    pub fn read(reader: &mut Bytes<'a>, bits: usize) -> Result<Mask<'a>, String> {
        Ok(Mask(reader.take(bits / 8)?))
    }

    pub fn is_on(&self, index: usize) -> bool {
        self.0[index / 8] >> (index % 8) & 1 != 0
    }

    pub fn count_on(&self) -> usize {
        self.0.iter().map(|byte| byte.count_ones() as usize).sum()
    }

    pub fn len(&self) -> usize {
        8 * self.0.len()
    }

    /// Indices of the bits that are on.
    pub fn on(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.len()).filter(|&index| self.is_on(index))
    }
}

/// Size of a Blosc header, bytes.
const HEADER: usize = 16;
const SHUFFLED: u8 = 1;
const STORED: u8 = 2;
const BITS_SHUFFLED: u8 = 4;
const UNSPLIT: u8 = 0x10;
/// Maximum size of numbers in split blocks, bytes.
const WIDEST_SPLIT: usize = 16;
/// Minimum count of numbers in split blocks.
const SHORTEST_SPLIT: usize = 128;

/// Decompresses a Blosc buffer to `size` bytes; errors are messages.
pub(super) fn unpack(packed: &[u8], size: usize) -> Result<Vec<u8>, String> {
    if packed.len() < HEADER {
        return Err(DAMAGED.into());
    }
    let (flags, width) = (packed[2], usize::from(packed[3]).max(1));
    let [length, block] = [4, 8].map(|at| word(packed, at).unwrap_or(0) as usize);
    if length != size || block == 0 {
        return Err(DAMAGED.into());
    }
    if flags & STORED != 0 {
        let stored = packed.get(HEADER..HEADER + length).ok_or(DAMAGED)?;
        return Ok(stored.to_vec());
    }
    let codec = flags >> 5;
    if codec != 1 || flags & BITS_SHUFFLED != 0 {
        let name = ["BloscLZ", "LZ4", "Snappy", "zlib", "Zstandard"].get(usize::from(codec));
        let name = name.copied().unwrap_or("an unknown codec");
        return Err(format!("is compressed by {name} within Blosc: only LZ4 with byte shuffle is supported"));
    }
    let mut unpacked = Vec::with_capacity(length);
    for (number, start) in (0..length).step_by(block).enumerate() {
        let size = block.min(length - start);
        let at = word(packed, HEADER + 4 * number).ok_or(DAMAGED)? as usize;
        let is_split = flags & UNSPLIT == 0
            && width <= WIDEST_SPLIT
            && block / width >= SHORTEST_SPLIT
            && size == block
            && size.is_multiple_of(width);
        let bytes = unpack_block(packed, at, size, if is_split { width } else { 1 })?;
        match flags & SHUFFLED != 0 && width > 1 {
            true => unshuffle(&bytes, width, &mut unpacked),
            false => unpacked.extend(bytes),
        }
    }
    Ok(unpacked)
}

const DAMAGED: &str = "holds a damaged Blosc buffer";

fn word(packed: &[u8], at: usize) -> Option<u32> {
    let bytes = packed.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(bytes.try_into().ok()?))
}

/// Decompresses a block of `pieces` length-prefixed streams.
fn unpack_block(packed: &[u8], mut at: usize, size: usize, pieces: usize) -> Result<Vec<u8>, String> {
    let piece = size / pieces;
    let mut bytes = Vec::with_capacity(size);
    for _ in 0..pieces {
        let length = word(packed, at).ok_or(DAMAGED)? as usize;
        let end = (at + 4).checked_add(length).ok_or(DAMAGED)?;
        let source = packed.get(at + 4..end).ok_or(DAMAGED)?;
        let target = bytes.len() + piece;
        match length == piece {
            true => bytes.extend_from_slice(source),
            false => unpack_lz4(source, target, &mut bytes).ok_or(DAMAGED)?,
        }
        at = end;
    }
    Ok(bytes)
}

/// Appends a decompressed LZ4 block ("LZ4 Block Format Description") until `out` has `target` bytes; `None` if it is invalid.
fn unpack_lz4(mut source: &[u8], target: usize, out: &mut Vec<u8>) -> Option<()> {
    let first = out.len();
    let byte = |source: &mut &[u8]| {
        let (&first, rest) = source.split_first()?;
        *source = rest;
        Some(first)
    };
    loop {
        let token = byte(&mut source)?;
        let length = |nibble: u8, source: &mut &[u8]| {
            let mut length = usize::from(nibble);
            if nibble == 15 {
                loop {
                    let more = byte(source)?;
                    length += usize::from(more);
                    if more != 255 {
                        break;
                    }
                }
            }
            Some(length)
        };
        let literals = length(token >> 4, &mut source)?;
        if literals > source.len() || out.len() + literals > target {
            return None;
        }
        let (now, rest) = source.split_at(literals);
        out.extend_from_slice(now);
        source = rest;
        if source.is_empty() {
            return (out.len() == target).then_some(());
        }
        let (low, rest) = source.split_first_chunk::<2>()?;
        source = rest;
        let back = usize::from(u16::from_le_bytes(*low));
        let count = length(token & 15, &mut source)? + 4;
        if back == 0 || back > out.len() - first || out.len() + count > target {
            return None;
        }
        for _ in 0..count {
            out.push(out[out.len() - back]);
        }
    }
}

/// Reverses the byte shuffle. Trailing bytes beyond the last whole number are copied.
fn unshuffle(bytes: &[u8], width: usize, out: &mut Vec<u8>) {
    let count = bytes.len() / width;
    for i in 0..count {
        out.extend((0..width).map(|k| bytes[k * count + i]));
    }
    out.extend_from_slice(&bytes[count * width..]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lz4_blocks_are_decompressed() {
        // Three literals, an overlapping match of seven, and two literals.
        let packed = [0x33, b'a', b'b', b'c', 3, 0, 0x20, b'x', b'y'];
        let mut out = Vec::new();
        unpack_lz4(&packed, 12, &mut out).expect("a block");
        assert_eq!(out, b"abcabcabcaxy");
        for length in 0..packed.len() {
            assert!(unpack_lz4(&packed[..length], 12, &mut Vec::new()).is_none(), "{length}");
        }
        let mut far = packed;
        far[4] = 4;
        assert!(unpack_lz4(&far, 12, &mut Vec::new()).is_none(), "a match before the beginning");
        // A long run of literals.
        let long: Vec<u8> = [0xf0, 255, 5].into_iter().chain((0..275).map(|i| i as u8)).collect();
        let mut out = Vec::new();
        unpack_lz4(&long, 275, &mut out).expect("a block");
        assert_eq!(out.len(), 275);
    }

    #[test]
    fn the_byte_shuffle_is_reversed() {
        let mut out = Vec::new();
        unshuffle(&[1, 2, 3, 11, 12, 13, 9], 2, &mut out);
        assert_eq!(out, [1, 11, 2, 12, 3, 13, 9]);
    }

    #[test]
    fn stored_buffers_are_copied_and_unsupported_codecs_reported() {
        let header = |flags: u8| [2, 1, flags, 4, 4, 0, 0, 0, 4, 0, 0, 0, 20, 0, 0, 0];
        let stored = [&header(STORED)[..], &[1, 2, 3, 4]].concat();
        assert_eq!(unpack(&stored, 4).expect("stored"), [1, 2, 3, 4]);
        assert!(unpack(&stored, 5).is_err() && unpack(&stored[..19], 4).is_err());
        let other = [&header(4 << 5)[..], &[0; 8]].concat();
        assert!(unpack(&other, 4).expect_err("an unsupported codec").contains("Zstandard"));
    }
}
