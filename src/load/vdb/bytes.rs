//! Numbers from a file in memory, one after another.

use crate::math::DVec3;

/// What is left to read. Every read checks that it is there; an error is a sentence.
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
