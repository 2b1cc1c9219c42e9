//! A compressed stream, read byte by byte.

/// A stream read from its start; reading beyond its end is an error.
pub(super) struct Stream<'s> {
    /// What is left.
    pub bytes: &'s [u8],
}

impl<'s> Stream<'s> {
    /// The next bytes.
    pub fn take(&mut self, count: usize) -> Result<&'s [u8], String> {
        let (head, rest) = self.bytes.split_at_checked(count).ok_or("the stream ends too early")?;
        self.bytes = rest;
        Ok(head)
    }

    /// The next byte.
    pub fn byte(&mut self) -> Result<u8, String> {
        Ok(self.take(1)?[0])
    }

    /// An unsigned number of seven bits a byte, the lowest first, at most five bytes long.
    pub fn varint(&mut self) -> Result<u32, String> {
        let mut value = 0u32;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err("a number is longer than five bytes".to_string())
    }

    /// Splits the last bytes off.
    pub fn tail(&mut self, count: usize) -> Result<&'s [u8], String> {
        let at = self.bytes.len().checked_sub(count).ok_or("the stream is too short")?;
        let (rest, tail) = self.bytes.split_at(at);
        self.bytes = rest;
        Ok(tail)
    }

    /// All must have been read.
    pub fn finish(self) -> Result<(), String> {
        match self.bytes.len() {
            0 => Ok(()),
            left => Err(format!("{left} bytes are left over")),
        }
    }
}
