//! ZIP archives (PKWARE, "APPNOTE.TXT", 6.3.10), of which stored and deflated entries are read.

use super::files;
use crate::error::{Error, Result};
use flate2::read::DeflateDecoder;
use std::io::Read;
use std::path::Path;

/// Maximum number of entries of an archive, and of bytes of all together.
const MAX_ENTRIES: usize = 1 << 16;
pub(super) const MAX_BYTES: u64 = 1 << 33;
/// Largest compression ratio of deflate.
const MAX_RATIO: u64 = 1032;

/// Does a file begin like an archive?
pub(super) fn is_archive(start: &[u8]) -> bool {
    start.starts_with(b"PK\x03\x04")
}

/// An archive in memory, whose files are read one by one.
pub(super) struct Archive {
    bytes: Vec<u8>,
    entries: Vec<Entry>,
}

impl Archive {
    /// Reads an archive and the list of its files.
    ///
    /// # Errors
    /// An input error if it can't be read, or its list is broken.
    pub fn open(path: &Path) -> Result<Archive> {
        let bytes = files::read(path, MAX_BYTES).map_err(|message| Error::input(path, message))?;
        let damaged =
            || Error::input(path, ("zip-damaged", "is a damaged ZIP archive: its list of files is broken"));
        let entries = entries(&bytes).ok_or_else(damaged)?;
        Ok(Archive { bytes, entries })
    }

    /// Its entries.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The bytes of an entry, up to a maximum.
    ///
    /// # Errors
    /// A message that follows the name of the archive.
    pub fn data(&self, entry: &Entry, most: u64) -> std::result::Result<Vec<u8>, String> {
        entry.data(&self.bytes, most)
    }

    /// Bytes of the archive itself.
    pub fn size(&self) -> usize {
        self.bytes.len()
    }

    /// The bytes of one of its files; names are compared as those of packages are (ECMA-376, part 2): capitals don't count, and they may
    /// begin with a slash.
    ///
    /// # Errors
    /// A message that follows the name of the archive.
    pub fn file(&self, name: &str) -> std::result::Result<Vec<u8>, String> {
        let plain = |name: &str| name.trim_start_matches('/').replace('\\', "/");
        let wanted = plain(name);
        let entry = self.entries.iter().find(|entry| plain(&entry.name).eq_ignore_ascii_case(&wanted));
        entry.ok_or("is not in the archive")?.data(&self.bytes, MAX_BYTES)
    }
}

/// A file of an archive.
pub(super) struct Entry {
    pub name: String,
    is_encrypted: bool,
    method: u16,
    packed: u64,
    size: u64,
    /// Offset of its local header.
    at: u64,
}

impl Entry {
    /// Its bytes; the error says what is wrong with it.
    fn data(&self, archive: &[u8], most: u64) -> std::result::Result<Vec<u8>, String> {
        let cut = || "is cut short".to_string();
        if self.is_encrypted {
            return Err("is encrypted: unpack the archive first".into());
        }
        if self.size > most || self.size > self.packed.saturating_mul(MAX_RATIO).saturating_add(64) {
            return Err(format!(
                "claims {} bytes, more than its {} packed ones justify",
                self.size, self.packed
            ));
        }
        let at = usize::try_from(self.at).map_err(|_| cut())?;
        let header = archive.get(at..).filter(|h| h.starts_with(b"PK\x03\x04")).ok_or_else(cut)?;
        let skipped = [26, 28].map(|place| number(header, place, 2));
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
                Err(format!("is packed by method {method}, which is not read: unpack the archive first"))
            }
        }
    }
}

/// A little-endian number of up to eight bytes.
fn number(bytes: &[u8], at: usize, length: usize) -> Option<u64> {
    let bytes = bytes.get(at..at.checked_add(length)?)?;
    Some(bytes.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte)))
}

/// The files of an archive by its central directory; `None` if that is broken. Archives beyond 4 GiB (ZIP64) have their numbers
/// in extra fields.
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
        let lengths = [28, 30, 32].map(|place| number(header, place, 2));
        let [name, extra, comment] = [lengths[0]? as usize, lengths[1]? as usize, lengths[2]? as usize];
        let mut entry = Entry {
            name: String::from_utf8_lossy(header.get(46..46 + name)?).into_owned(),
            is_encrypted: number(header, 8, 2)? & 1 != 0,
            method: number(header, 10, 2)? as u16,
            packed: number(header, 20, 4)?,
            size: number(header, 24, 4)?,
            at: number(header, 42, 4)?,
        };
        entry.widen(header.get(46 + name..46 + name + extra)?);
        entries.push(entry);
        at += 46 + name + extra + comment;
    }
    Some(entries)
}

impl Entry {
    /// Takes numbers of eight bytes from the extra field of ZIP64 where the header has no room for them.
    fn widen(&mut self, mut extra: &[u8]) {
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
