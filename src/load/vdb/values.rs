//! The values of a node: only those that are active where the file leaves out the others, packed by zlib or Blosc.

use super::blosc;
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
    /// Flags: packed by zlib (1), active values only (2), packed by Blosc (4).
    pub compression: u32,
    /// The value where nothing is.
    pub background: f64,
}

/// The inactive values of a node, which it may omit.
mod inactive {
    /// They are the background; negated it is 1.
    pub const MINUS_BACKGROUND: u8 = 1;
    pub const ONE: u8 = 2;
    pub const MASKED_SIGNS: u8 = 3;
    pub const MASKED_ONE: u8 = 4;
    pub const MASKED_TWO: u8 = 5;
    /// All are there.
    pub const ALL: u8 = 6;
}

impl Values {
    /// One number in full width.
    pub fn single(&self, from: &mut Bytes) -> Result<f64, String> {
        match self.number {
            Number::Double => from.f64(),
            Number::Half | Number::Float => Ok(f64::from(f32::from_bits(from.u32()?))),
        }
    }

    /// The values of a node, as many as its mask has bits.
    pub fn read(&self, from: &mut Bytes, active: &Mask) -> Result<Vec<f32>, String> {
        let kind = from.u8()?;
        if kind > inactive::ALL {
            return Err(format!("has values of the unknown kind {kind}"));
        }
        let mut others = [self.background, self.background];
        if kind == inactive::MINUS_BACKGROUND || kind == inactive::MASKED_SIGNS {
            others[0] = -self.background;
        }
        if [inactive::ONE, inactive::MASKED_ONE, inactive::MASKED_TWO].contains(&kind) {
            others[0] = self.single(from)?;
        }
        if kind == inactive::MASKED_TWO {
            others[1] = self.single(from)?;
        }
        let is_masked = [inactive::MASKED_SIGNS, inactive::MASKED_ONE, inactive::MASKED_TWO].contains(&kind);
        let selection = if is_masked { Some(Mask::read(from, active.len())?) } else { None };
        let leaves_out = self.compression & ACTIVE_MASK != 0 && kind != inactive::ALL;
        let stored = self.numbers(from, if leaves_out { active.count_on() } else { active.len() })?;
        if !leaves_out {
            return Ok(stored);
        }
        let mut stored = stored.into_iter();
        let value = |index: usize| match active.is_on(index) {
            true => stored.next().unwrap_or(0.0),
            false => {
                let is_second = selection.as_ref().is_some_and(|mask| mask.is_on(index));
                others[usize::from(is_second)] as f32
            }
        };
        Ok((0..active.len()).map(value).collect())
    }

    /// Numbers as they are packed.
    fn numbers(&self, from: &mut Bytes, count: usize) -> Result<Vec<f32>, String> {
        let width = match self.number {
            Number::Half => 2,
            Number::Float => 4,
            Number::Double => 8,
        };
        if count == 0 && self.number == Number::Half {
            return Ok(Vec::new());
        }
        let bytes = self.unpacked(from, count * width)?;
        let numbers = bytes.chunks_exact(width);
        Ok(match self.number {
            Number::Half => numbers.map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()).collect(),
            Number::Float => numbers.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect(),
            Number::Double => numbers
                .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]) as f32)
                .collect(),
        })
    }

    fn unpacked(&self, from: &mut Bytes, wanted: usize) -> Result<Vec<u8>, String> {
        if self.compression & (BLOSC | ZIP) == 0 {
            return Ok(from.take(wanted)?.to_vec());
        }
        // Incompressible data is stored raw, after its negated length.
        let length = from.i64()?;
        if length <= 0 {
            let stored = from.take(usize::try_from(-(length as i128)).unwrap_or(usize::MAX))?;
            return match stored.len() == wanted {
                true => Ok(stored.to_vec()),
                false => Err(format!("holds {} bytes where {wanted} should be", stored.len())),
            };
        }
        let packed = from.take(usize::try_from(length).unwrap_or(usize::MAX))?;
        if self.compression & BLOSC != 0 {
            return blosc::unpack(packed, wanted);
        }
        let mut bytes = Vec::with_capacity(wanted);
        let unpacked = ZlibDecoder::new(packed).take(wanted as u64 + 1).read_to_end(&mut bytes);
        match unpacked {
            Ok(length) if length == wanted => Ok(bytes),
            _ => Err("holds values that zlib can't unpack".into()),
        }
    }
}

// Numbers from a file in memory, one after another.

/// The unread bytes. Every read is bounds-checked; errors are messages.
pub(super) struct Bytes<'a> {
    all: &'a [u8],
    at: usize,
}

impl<'a> Bytes<'a> {
    pub fn new(all: &'a [u8]) -> Bytes<'a> {
        Bytes { all, at: 0 }
    }

    /// Skips to an offset from the beginning that does not lie before what has been read.
    pub fn skip_to(&mut self, to: i64) -> Result<(), String> {
        if usize::try_from(to).is_ok_and(|to| to < self.at) {
            return Err("names a place that lies before its own".into());
        }
        self.seek(to)
    }

    /// Goes on at an offset from the beginning.
    pub fn seek(&mut self, to: i64) -> Result<(), String> {
        let to = usize::try_from(to).ok().filter(|&to| to <= self.all.len());
        self.at = to.ok_or("names a place beyond its end")?;
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

    /// A length and as many bytes of text.
    pub fn text(&mut self) -> Result<String, String> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }
}

/// Bits, the lowest of each byte first.
pub(super) struct Mask<'a>(&'a [u8]);

impl<'a> Mask<'a> {
    /// A mask of `bits` bits, a multiple of eight.
    pub fn read(from: &mut Bytes<'a>, bits: usize) -> Result<Mask<'a>, String> {
        Ok(Mask(from.take(bits / 8)?))
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

    /// The bits that are on.
    pub fn on(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.len()).filter(|&index| self.is_on(index))
    }
}
