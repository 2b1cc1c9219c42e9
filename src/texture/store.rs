//! Where compressed levels are kept: in memory as long as there is room, else in a temporary file; and the tiles that were read back.

use crate::error::Warning;
use crate::image::{Damage, Image};
use std::cell::RefCell;
use std::collections::HashMap;
use std::fs::File;
use std::io;
use std::io::{Seek, SeekFrom, Write};
use std::path::PathBuf;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};

/// Shards of the tile cache, each with a lock, to reduce contention.
const SHARDS: usize = 64;

/// Tiles in the cache of each thread.
const AT_HAND: usize = 64;

/// A tile, its level and its position.
type KnownTile = (TileKey, Arc<[u8]>);

thread_local! {
    /// The tiles that a thread read last, each in a place that follows from where it lies; a lookup among them takes no lock.
    static LATEST: RefCell<Vec<Option<KnownTile>>> = const { RefCell::new(Vec::new()) };
}

/// Names a tile among all of all images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct TileKey {
    /// No two levels have the same, whatever their store.
    pub level: u64,
    pub row: u32,
    pub column: u32,
}

/// A row of compressed tiles.
#[derive(Debug)]
pub(super) enum TileRow {
    /// In memory.
    Memory(Box<[u8]>),
    /// From a position of the temporary file on.
    File(u64),
}

/// Keeps compressed levels, and limits concurrent decoding.
#[derive(Debug)]
pub(super) struct Store {
    /// Bytes of compressed tiles that may yet stay in memory.
    room: AtomicU64,
    scratch: OnceLock<Option<ScratchFile>>,
    /// Maximum number of bytes of the tiles of a shard.
    most_of_shard: usize,
    shards: Vec<Mutex<Shard>>,
    /// Maximum number of bytes of images that are decoded at the same time; one may be larger.
    most_decoding: usize,
    /// Bytes of the images that are being decoded.
    decoding: Mutex<usize>,
    decoded: Condvar,
    counts: StoreCounts,
    /// By subject: an image, or the temporary file.
    warnings: Mutex<Vec<(String, Warning)>>,
}

#[derive(Debug, Default)]
struct StoreCounts {
    decodes: AtomicU64,
    tiles: AtomicU64,
    evicted_tiles: AtomicU64,
    file_bytes: AtomicU64,
}

/// Decoding on demand during rendering.
#[derive(Clone, Debug, Default)]
pub struct TexturesOnDemand {
    /// Images that were decoded; each as often as it was.
    pub decodes: u64,
    /// Tiles that were read back from the temporary file.
    pub tiles: u64,
    /// Tiles that had to go since there were too many.
    pub evicted_tiles: u64,
    /// Bytes of those that are in memory now.
    pub bytes: u64,
    /// Bytes in the temporary file.
    pub file_bytes: u64,
    /// Images that could not be decoded any more, and trouble with the temporary file.
    pub warnings: Vec<Warning>,
}

impl Store {
    /// A store that takes about `bytes`, and decodes images of up to `decoding` bytes together. A quarter is for tiles that are read
    /// back; compressed levels take what images leave that are being decoded, but at least a quarter, too.
    pub fn new(bytes: u64, decoding: u64) -> Store {
        let quarter = bytes / 4;
        let room = bytes.saturating_sub(decoding.max(quarter)).max(quarter);
        let usize_of = |bytes| usize::try_from(bytes).unwrap_or(usize::MAX);
        Store {
            room: AtomicU64::new(room),
            scratch: OnceLock::new(),
            most_of_shard: usize_of(quarter) / SHARDS,
            shards: (0..SHARDS).map(|_| Mutex::default()).collect(),
            most_decoding: usize_of(decoding),
            decoding: Mutex::new(0),
            decoded: Condvar::new(),
            counts: StoreCounts::default(),
            warnings: Mutex::default(),
        }
    }

    /// Keeps a row of tiles.
    pub fn keep(&self, row: Vec<u8>) -> TileRow {
        let length = row.len() as u64;
        if self.room.fetch_update(Relaxed, Relaxed, |room| room.checked_sub(length)).is_ok() {
            return TileRow::Memory(row.into());
        }
        match self.written(&row) {
            Ok(start) => {
                self.counts.file_bytes.fetch_add(length, Relaxed);
                TileRow::File(start)
            }
            Err(error) => {
                let folder = folder();
                let message = format!(
                    "textures take more memory than they should: the temporary file in {} can't be written: {error}",
                    folder.display()
                );
                self.warn("written", || Warning::general(message));
                TileRow::Memory(row.into())
            }
        }
    }

    fn written(&self, row: &[u8]) -> io::Result<u64> {
        let mut error = None;
        let scratch = self.scratch.get_or_init(|| ScratchFile::new().map_err(|e| error = Some(e)).ok());
        match scratch {
            Some(scratch) => scratch.append(row),
            None => Err(error.unwrap_or_else(|| io::Error::other("it could not be created"))),
        }
    }

    /// Lets `look` look into a tile of the temporary file, of `length` bytes from `start` on.
    pub fn with_tile<T>(&self, key: TileKey, start: u64, length: usize, look: impl FnOnce(&[u8]) -> T) -> T {
        // Neighbouring tiles never share a place.
        let place = ((key.column % 8 + key.row % 8 * 8) as usize + key.level as usize * 11) % AT_HAND;
        LATEST.with_borrow_mut(|latest| {
            if latest.is_empty() {
                latest.resize(AT_HAND, None);
            }
            let at_hand = &mut latest[place];
            if at_hand.as_ref().is_none_or(|(known, _)| *known != key) {
                *at_hand = Some((key, self.tile(key, start, length)));
            }
            look(at_hand.as_ref().map_or(&[], |(_, tile)| tile))
        })
    }

    /// A tile of the temporary file; empty where it can't be read.
    fn tile(&self, key: TileKey, start: u64, length: usize) -> Arc<[u8]> {
        if let Some(tile) = self.shard(key).get(key) {
            return tile;
        }
        self.counts.tiles.fetch_add(1, Relaxed);
        let mut bytes = vec![0; length];
        let scratch = self.scratch.get().and_then(Option::as_ref);
        let read = scratch.map_or(Ok(()), |scratch| scratch.read(start, &mut bytes));
        if let Err(error) = read {
            let message = format!("textures are partly black: the temporary file can't be read: {error}");
            self.warn("read", || Warning::general(message));
            bytes.clear();
        }
        let tile: Arc<[u8]> = bytes.into();
        let evicted = self.shard(key).add(key, tile.clone(), self.most_of_shard);
        self.counts.evicted_tiles.fetch_add(evicted, Relaxed);
        tile
    }

    fn shard(&self, key: TileKey) -> MutexGuard<'_, Shard> {
        let place = u64::from(key.row) << 20 ^ u64::from(key.column);
        let mixed = (key.level << 40 ^ place).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        lock(&self.shards[(mixed >> 32) as usize % SHARDS])
    }

    /// Decodes an image of this many bytes, once the memory for it is free.
    pub fn decode<T>(&self, bytes: usize, work: impl FnOnce() -> T) -> T {
        let is_too_much = |decoding: &mut usize| *decoding > 0 && *decoding + bytes > self.most_decoding;
        let waiting = self.decoded.wait_while(lock(&self.decoding), is_too_much);
        *waiting.unwrap_or_else(PoisonError::into_inner) += bytes;
        self.counts.decodes.fetch_add(1, Relaxed);
        let result = work();
        *lock(&self.decoding) -= bytes;
        self.decoded.notify_all();
        result
    }

    /// Notes that an image can't be decoded any more.
    pub fn warn_of_damage(&self, image: &Image, damage: Damage) {
        self.warn(&image.name, || {
            let message =
                "a coarse copy of the image, or black, was shown where its finer texels were needed";
            let warning = match damage {
                Damage::LeftOut(Warning { file, place, .. }) => {
                    Warning { file, place, ..Warning::general(String::new()) }
                }
                Damage::Fatal(_) => Warning::general(String::new()),
            };
            Warning { message: format!("{}: {message}", image.name), ..warning }
        });
    }

    /// Notes warnings about an image that was decoded.
    pub fn add_warnings(&self, warnings: Vec<Warning>) {
        for warning in warnings {
            self.warn(&warning.to_string(), || warning.clone());
        }
    }

    /// Keeps a warning, unless there is one about the same.
    fn warn(&self, about: &str, warning: impl FnOnce() -> Warning) {
        let mut warnings = lock(&self.warnings);
        if warnings.iter().all(|(known, _)| known != about) {
            warnings.push((about.to_string(), warning()));
        }
    }

    /// Decoding on demand so far.
    pub fn on_demand(&self) -> TexturesOnDemand {
        let StoreCounts { decodes, tiles, evicted_tiles, file_bytes } = &self.counts;
        TexturesOnDemand {
            decodes: decodes.load(Relaxed),
            tiles: tiles.load(Relaxed),
            evicted_tiles: evicted_tiles.load(Relaxed),
            bytes: self.shards.iter().map(|shard| lock(shard).bytes as u64).sum(),
            file_bytes: file_bytes.load(Relaxed),
            warnings: lock(&self.warnings).iter().map(|(_, warning)| warning.clone()).collect(),
        }
    }
}

/// Some of the tiles in use.
#[derive(Debug, Default)]
struct Shard {
    places: HashMap<TileKey, usize>,
    tiles: Vec<Tile>,
    /// The next tile that may have to go ("second chance": those that were used since it passed stay for another round).
    hand: usize,
    bytes: usize,
}

#[derive(Debug)]
struct Tile {
    key: TileKey,
    packed: Arc<[u8]>,
    is_used: bool,
}

impl Shard {
    fn get(&mut self, key: TileKey) -> Option<Arc<[u8]>> {
        let tile = &mut self.tiles[*self.places.get(&key)?];
        tile.is_used = true;
        Some(tile.packed.clone())
    }

    /// Adds a tile and gives how many went for it.
    fn add(&mut self, key: TileKey, packed: Arc<[u8]>, most: usize) -> u64 {
        if self.places.contains_key(&key) {
            // Two threads made the same.
            return 0;
        }
        let mut evicted = 0;
        while !self.tiles.is_empty() && self.bytes + packed.len() > most {
            self.evict();
            evicted += 1;
        }
        self.bytes += packed.len();
        self.places.insert(key, self.tiles.len());
        self.tiles.push(Tile { key, packed, is_used: false });
        evicted
    }

    fn evict(&mut self) {
        loop {
            self.hand %= self.tiles.len();
            if !std::mem::take(&mut self.tiles[self.hand].is_used) {
                break;
            }
            self.hand += 1;
        }
        let gone = self.tiles.swap_remove(self.hand);
        self.places.remove(&gone.key);
        self.bytes -= gone.packed.len();
        if let Some(moved) = self.tiles.get(self.hand) {
            self.places.insert(moved.key, self.hand);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

// An unnamed temporary file for data that does not fit into memory; it disappears with the process.

/// A temporary file that grows; several threads read it at once.
#[derive(Debug)]
pub(super) struct ScratchFile {
    file: File,
    /// Bytes written.
    length: Mutex<u64>,
}

impl ScratchFile {
    /// A new one in [`folder`].
    ///
    /// # Errors
    /// That of the system.
    pub fn new() -> io::Result<ScratchFile> {
        let file = tempfile::tempfile_in(folder())?;
        Ok(ScratchFile { file, length: Mutex::new(0) })
    }

    /// Appends bytes and gives the position of the first.
    ///
    /// # Errors
    /// That of the system, such as a full disk; what was written of the bytes is written over then.
    pub fn append(&self, bytes: &[u8]) -> io::Result<u64> {
        let mut length = self.length.lock().unwrap_or_else(PoisonError::into_inner);
        let start = *length;
        let mut file = &self.file;
        file.seek(SeekFrom::Start(start))?;
        file.write_all(bytes)?;
        *length += bytes.len() as u64;
        Ok(start)
    }

    /// Reads appended data.
    ///
    /// # Errors
    /// That of the system.
    pub fn read(&self, start: u64, into: &mut [u8]) -> io::Result<()> {
        #[cfg(unix)]
        {
            std::os::unix::fs::FileExt::read_exact_at(&self.file, into, start)
        }
        #[cfg(not(unix))]
        {
            use std::io::Read;
            let _alone = self.length.lock().unwrap_or_else(PoisonError::into_inner);
            let mut file = &self.file;
            file.seek(SeekFrom::Start(start))?;
            file.read_exact(into)
        }
    }
}

/// The folder of temporary files: that of the variable `TMPDIR`; else `/var/tmp`, since `/tmp` is in memory on many systems.
pub(super) fn folder() -> PathBuf {
    let large = PathBuf::from("/var/tmp");
    if std::env::var_os("TMPDIR").is_none() && large.is_dir() { large } else { std::env::temp_dir() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let file = ScratchFile::new().expect("the folder can be written");
        let parts: Vec<Vec<u8>> = (0..20u8).map(|i| vec![i; 100 * usize::from(i)]).collect();
        let starts: Vec<u64> = parts.iter().map(|part| file.append(part).expect("there is room")).collect();
        for (part, start) in parts.iter().zip(starts) {
            let mut found = vec![0; part.len()];
            file.read(start, &mut found).expect("it was written");
            assert_eq!(*part, found);
        }
        assert!(file.read(1 << 40, &mut [0; 4]).is_err());
    }
}
