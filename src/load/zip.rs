//! ZIP archives (PKWARE, "APPNOTE.TXT", 6.3.10), with stored and deflated entries.

use super::files;
use crate::error::{Error, Result};
use flate2::read::DeflateDecoder;
use std::io::Read;
use std::path::Path;

/// Maximum number of entries of an archive.
const MAX_ENTRIES: usize = 1 << 16;
/// Maximum size of all entries together, bytes.
pub(super) const MAX_BYTES: u64 = 1 << 33;
/// Maximum compression ratio of deflate.
const MAX_RATIO: u64 = 1032;

/// Whether a file starts with the signature of a ZIP archive.
pub(super) fn is_archive(start: &[u8]) -> bool {
    start.starts_with(b"PK\x03\x04")
}

/// A ZIP archive in memory.
pub(super) struct Archive {
    bytes: Vec<u8>,
    entries: Vec<Entry>,
}

impl Archive {
    /// Reads an archive and its central directory.
    ///
    /// # Errors
    /// An input error if the file can't be read or the directory is damaged.
    pub fn open(path: &Path) -> Result<Archive> {
        let bytes = files::read(path, MAX_BYTES).map_err(|message| Error::input(path, message))?;
        let damaged =
            || Error::input(path, ("zip-damaged", "is a damaged ZIP archive: its list of files is broken"));
        let entries = entries(&bytes).ok_or_else(damaged)?;
        Ok(Archive { bytes, entries })
    }

    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The bytes of an entry of at most `max` bytes.
    ///
    /// # Errors
    /// A message that follows the name of the entry.
    pub fn data(&self, entry: &Entry, max: u64) -> std::result::Result<Vec<u8>, String> {
        entry.data(&self.bytes, max)
    }

    /// Size of the archive, bytes.
    pub fn size(&self) -> usize {
        self.bytes.len()
    }

    /// The bytes of a file by name; names are case-insensitive and may start with a slash (ECMA-376, part 2).
    ///
    /// # Errors
    /// A message that follows the name of the file.
    pub fn file(&self, name: &str) -> std::result::Result<Vec<u8>, String> {
        let normalized = |name: &str| name.trim_start_matches('/').replace('\\', "/");
        let name = normalized(name);
        let entry = self.entries.iter().find(|entry| normalized(&entry.name).eq_ignore_ascii_case(&name));
        entry.ok_or("is not in the archive")?.data(&self.bytes, MAX_BYTES)
    }
}

/// A file of an archive.
pub(super) struct Entry {
    pub name: String,
    is_encrypted: bool,
    /// Compression method: 0 stored, 8 deflated.
    method: u16,
    /// Compressed size, bytes.
    packed: u64,
    /// Uncompressed size, bytes.
    size: u64,
    /// Offset of the local header, bytes.
    at: u64,
}

impl Entry {
    /// The uncompressed bytes; errors are messages that follow the name.
    fn data(&self, archive: &[u8], max: u64) -> std::result::Result<Vec<u8>, String> {
        let cut = || "is truncated".to_string();
        if self.is_encrypted {
            return Err("is encrypted: unpack the archive first".into());
        }
        if self.size > max || self.size > self.packed.saturating_mul(MAX_RATIO).saturating_add(64) {
            return Err(format!(
                "declares {} bytes, which is too large for its {} compressed bytes",
                self.size, self.packed
            ));
        }
        let at = usize::try_from(self.at).map_err(|_| cut())?;
        let header = archive.get(at..).filter(|h| h.starts_with(b"PK\x03\x04")).ok_or_else(cut)?;
        let skipped = [26, 28].map(|at| number(header, at, 2));
        let [Some(name), Some(extra)] = skipped else { return Err(cut()) };
        let start = 30 + (name + extra) as usize;
        let packed = header.get(start..).and_then(|rest| rest.get(..self.packed as usize)).ok_or_else(cut)?;
        match self.method {
            0 => Ok(packed.to_vec()),
            8 => {
                let mut bytes = Vec::new();
                let read = DeflateDecoder::new(packed).take(self.size).read_to_end(&mut bytes);
                read.map_err(|e| format!("can't be unpacked: {e}"))?;
                if bytes.len() as u64 == self.size { Ok(bytes) } else { Err(cut()) }
            }
            method => {
                Err(format!("has the unsupported compression method {method}: unpack the archive first"))
            }
        }
    }
}

/// A little-endian number of up to eight bytes.
fn number(bytes: &[u8], at: usize, length: usize) -> Option<u64> {
    let bytes = bytes.get(at..at.checked_add(length)?)?;
    Some(bytes.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte)))
}

/// The entries of an archive's central directory; `None` if it is damaged. ZIP64 archives (beyond 4 GiB) have large numbers in
/// extra fields.
fn entries(bytes: &[u8]) -> Option<Vec<Entry>> {
    let tail = bytes.len().saturating_sub(22 + usize::from(u16::MAX));
    let end = bytes[tail..].windows(4).rposition(|w| w == b"PK\x05\x06")? + tail;
    let (mut count, mut at) = (number(bytes, end + 10, 2)?, number(bytes, end + 16, 4)?);
    let locator = end.checked_sub(20).filter(|&at| bytes.get(at..at + 4) == Some(b"PK\x06\x07"));
    if let Some(locator) = locator {
        let end = usize::try_from(number(bytes, locator + 8, 8)?).ok()?;
        (count, at) = (number(bytes, end.checked_add(32)?, 8)?, number(bytes, end.checked_add(48)?, 8)?);
    }
    let count = usize::try_from(count).ok().filter(|&n| n <= MAX_ENTRIES)?;
    let (mut at, mut entries) = (usize::try_from(at).ok()?, Vec::new());
    for _ in 0..count {
        let header = bytes.get(at..).filter(|h| h.starts_with(b"PK\x01\x02"))?;
        let lengths = [28, 30, 32].map(|at| number(header, at, 2));
        let [name, extra, comment] = [lengths[0]? as usize, lengths[1]? as usize, lengths[2]? as usize];
        let mut entry = Entry {
            name: String::from_utf8_lossy(header.get(46..46 + name)?).into_owned(),
            is_encrypted: number(header, 8, 2)? & 1 != 0,
            method: number(header, 10, 2)? as u16,
            packed: number(header, 20, 4)?,
            size: number(header, 24, 4)?,
            at: number(header, 42, 4)?,
        };
        entry.read_zip64_field(header.get(46 + name..46 + name + extra)?);
        entries.push(entry);
        at += 46 + name + extra + comment;
    }
    Some(entries)
}

impl Entry {
    /// Replaces saturated 32-bit numbers by the 64-bit numbers of the ZIP64 extra field.
    fn read_zip64_field(&mut self, mut extra: &[u8]) {
        const FULL: u64 = 0xffff_ffff;
        while let (Some(kind), Some(length)) = (number(extra, 0, 2), number(extra, 2, 2)) {
            let Some(data) = extra.get(4..4 + length as usize) else { return };
            if kind == 1 {
                let mut at = 0;
                for field in [&mut self.size, &mut self.packed, &mut self.at] {
                    if *field == FULL
                        && let Some(value) = number(data, at, 8)
                    {
                        *field = value;
                        at += 8;
                    }
                }
            }
            extra = &extra[4 + length as usize..];
        }
    }
}
