//! Storage of compressed mip levels: in memory up to a limit, then in a temporary file, with a cache of the tiles read from it.

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

/// Number of shards of the tile cache, each with its own lock to reduce contention.
const SHARDS: usize = 64;

/// Number of tiles in the cache of each thread.
const THREAD_CACHE_TILES: usize = 64;

/// A compressed tile and its key.
type CachedTile = (TileKey, Arc<[u8]>);

thread_local! {
    /// A direct-mapped cache of the tiles that a thread read last, without a lock.
    static THREAD_CACHE: RefCell<Vec<Option<CachedTile>>> = const { RefCell::new(Vec::new()) };
}

/// Identifies a tile among those of all images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct TileKey {
    /// Id of the level, unique among those of all stores.
    pub level: u64,
    pub row: u32,
    pub column: u32,
}

/// A row of compressed tiles.
#[derive(Debug)]
pub(super) enum TileRow {
    /// The bytes in memory.
    Memory(Box<[u8]>),
    /// Position of the first byte in the temporary file.
    File(u64),
}

/// Stores compressed levels, and limits the memory of concurrent decoding.
#[derive(Debug)]
pub(super) struct Store {
    /// Bytes still free for compressed levels in memory.
    free_bytes: AtomicU64,
    scratch: OnceLock<Option<ScratchFile>>,
    /// Maximum size of the tiles of a shard, bytes.
    shard_limit: usize,
    shards: Vec<Mutex<Shard>>,
    /// Maximum size of images that are decoded at the same time, bytes; a single image may be larger.
    decoding_limit: usize,
    /// Size of the images that are being decoded, bytes.
    decoding: Mutex<usize>,
    decoded: Condvar,
    counts: StoreCounts,
    /// Warnings by subject (an image or the temporary file), one for each.
    warnings: Mutex<Vec<(String, Warning)>>,
}

#[derive(Debug, Default)]
struct StoreCounts {
    decodes: AtomicU64,
    tiles: AtomicU64,
    evicted_tiles: AtomicU64,
    file_bytes: AtomicU64,
}

/// Statistics of decoding on demand during rendering.
#[derive(Clone, Debug, Default)]
pub struct TexturesOnDemand {
    /// Number of decoded images, counting repetitions.
    pub decodes: u64,
    /// Number of tiles read from the temporary file.
    pub tiles: u64,
    /// Number of tiles evicted from the cache.
    pub evicted_tiles: u64,
    /// Size of the cached tiles, bytes.
    pub bytes: u64,
    /// Size of the temporary file, bytes.
    pub file_bytes: u64,
    /// Images that could no longer be decoded, and errors of the temporary file.
    pub warnings: Vec<Warning>,
}

impl Store {
    /// A store with a memory limit of about `bytes`. `decoding`: maximum size of images that are decoded at the same time. The tile cache
    /// takes a quarter; compressed levels take `bytes` minus `decoding`, between one and three quarters.
    pub fn new(bytes: u64, decoding: u64) -> Store {
        let quarter = bytes / 4;
        let free_bytes = bytes.saturating_sub(decoding.max(quarter)).max(quarter);
        let usize_of = |bytes| usize::try_from(bytes).unwrap_or(usize::MAX);
        Store {
            free_bytes: AtomicU64::new(free_bytes),
            scratch: OnceLock::new(),
            shard_limit: usize_of(quarter) / SHARDS,
            shards: (0..SHARDS).map(|_| Mutex::default()).collect(),
            decoding_limit: usize_of(decoding),
            decoding: Mutex::new(0),
            decoded: Condvar::new(),
            counts: StoreCounts::default(),
            warnings: Mutex::default(),
        }
    }

    /// Stores a row of compressed tiles.
    pub fn keep(&self, row: Vec<u8>) -> TileRow {
        let length = row.len() as u64;
        if self.free_bytes.fetch_update(Relaxed, Relaxed, |free_bytes| free_bytes.checked_sub(length)).is_ok()
        {
            return TileRow::Memory(row.into());
        }
        match self.write(&row) {
            Ok(start) => {
                self.counts.file_bytes.fetch_add(length, Relaxed);
                TileRow::File(start)
            }
            Err(error) => {
                let folder = folder();
                let message = format!(
                    "textures exceed their memory limit: the temporary file in {} can't be written: {error}",
                    folder.display()
                );
                self.warn("written", || Warning::general(message));
                TileRow::Memory(row.into())
            }
        }
    }

    fn write(&self, row: &[u8]) -> io::Result<u64> {
        let mut error = None;
        let scratch = self.scratch.get_or_init(|| ScratchFile::new().map_err(|e| error = Some(e)).ok());
        match scratch {
            Some(scratch) => scratch.append(row),
            None => Err(error.unwrap_or_else(|| io::Error::other("it could not be created"))),
        }
    }

    /// Runs `read` on a tile of the temporary file, of `length` bytes from `start` on; it is empty if the file can't be read.
    pub fn with_tile<T>(&self, key: TileKey, start: u64, length: usize, read: impl FnOnce(&[u8]) -> T) -> T {
        // Neighbouring tiles of a level never share a slot.
        let slot =
            ((key.column % 8 + key.row % 8 * 8) as usize + key.level as usize * 11) % THREAD_CACHE_TILES;
        THREAD_CACHE.with_borrow_mut(|cache| {
            if cache.is_empty() {
                cache.resize(THREAD_CACHE_TILES, None);
            }
            let cached = &mut cache[slot];
            if cached.as_ref().is_none_or(|(known, _)| *known != key) {
                *cached = Some((key, self.tile(key, start, length)));
            }
            read(cached.as_ref().map_or(&[], |(_, tile)| tile))
        })
    }

    /// A tile from the shared cache or the temporary file; empty if it can't be read.
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
        let evicted = self.shard(key).add(key, tile.clone(), self.shard_limit);
        self.counts.evicted_tiles.fetch_add(evicted, Relaxed);
        tile
    }

    fn shard(&self, key: TileKey) -> MutexGuard<'_, Shard> {
        let slot = u64::from(key.row) << 20 ^ u64::from(key.column);
        let mixed = (key.level << 40 ^ slot).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        lock(&self.shards[(mixed >> 32) as usize % SHARDS])
    }

    /// Runs `work`, which decodes an image of this many bytes, once the memory for it is free.
    pub fn decode<T>(&self, bytes: usize, work: impl FnOnce() -> T) -> T {
        let is_too_much = |decoding: &mut usize| *decoding > 0 && *decoding + bytes > self.decoding_limit;
        let waiting = self.decoded.wait_while(lock(&self.decoding), is_too_much);
        *waiting.unwrap_or_else(PoisonError::into_inner) += bytes;
        self.counts.decodes.fetch_add(1, Relaxed);
        let result = work();
        *lock(&self.decoding) -= bytes;
        self.decoded.notify_all();
        result
    }

    /// Records a warning that an image can no longer be decoded.
    pub fn warn_of_damage(&self, image: &Image, damage: Damage) {
        self.warn(&image.name, || {
            let message =
                "a coarse copy of the image, or black, was used instead of mip levels that could not be decoded";
            let warning = match damage {
                Damage::LeftOut(Warning { file, place, .. }) => {
                    Warning { file, place, ..Warning::general(String::new()) }
                }
                Damage::Fatal(_) => Warning::general(String::new()),
            };
            Warning { message: format!("{}: {message}", image.name), ..warning }
        });
    }

    /// Records warnings of decoding an image.
    pub fn add_warnings(&self, warnings: Vec<Warning>) {
        for warning in warnings {
            self.warn(&warning.to_string(), || warning.clone());
        }
    }

    /// Records a warning, unless there is one about the same subject.
    fn warn(&self, about: &str, warning: impl FnOnce() -> Warning) {
        let mut warnings = lock(&self.warnings);
        if warnings.iter().all(|(known, _)| known != about) {
            warnings.push((about.to_string(), warning()));
        }
    }

    /// Statistics of decoding on demand so far.
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

/// A part of the tile cache, with second-chance (clock) replacement.
#[derive(Debug, Default)]
struct Shard {
    indices: HashMap<TileKey, usize>,
    tiles: Vec<Tile>,
    /// The clock hand, an index of `tiles`: the next candidate for eviction, spared once if it was used since the hand passed it.
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
        let tile = &mut self.tiles[*self.indices.get(&key)?];
        tile.is_used = true;
        Some(tile.packed.clone())
    }

    /// Adds a tile, evicts others down to `max_bytes`, and returns their number.
    fn add(&mut self, key: TileKey, packed: Arc<[u8]>, max_bytes: usize) -> u64 {
        if self.indices.contains_key(&key) {
            // Another thread has added it.
            return 0;
        }
        let mut evicted = 0;
        while !self.tiles.is_empty() && self.bytes + packed.len() > max_bytes {
            self.evict();
            evicted += 1;
        }
        self.bytes += packed.len();
        self.indices.insert(key, self.tiles.len());
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
        let evicted = self.tiles.swap_remove(self.hand);
        self.indices.remove(&evicted.key);
        self.bytes -= evicted.packed.len();
        if let Some(moved) = self.tiles.get(self.hand) {
            self.indices.insert(moved.key, self.hand);
        }
    }
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

// An unnamed temporary file for data that does not fit into memory; the system deletes it when the process ends.

/// An append-only temporary file that several threads may read at the same time.
#[derive(Debug)]
pub(super) struct ScratchFile {
    file: File,
    /// Size of the file, bytes.
    length: Mutex<u64>,
}

impl ScratchFile {
    /// Creates a file in [`folder`].
    ///
    /// # Errors
    /// The file can't be created.
    pub fn new() -> io::Result<ScratchFile> {
        let file = tempfile::tempfile_in(folder())?;
        Ok(ScratchFile { file, length: Mutex::new(0) })
    }

    /// Appends bytes and returns the position of the first.
    ///
    /// # Errors
    /// Writing fails, such as on a full disk; the next append then overwrites the bytes.
    pub fn append(&self, bytes: &[u8]) -> io::Result<u64> {
        let mut length = lock(&self.length);
        let start = *length;
        let mut file = &self.file;
        file.seek(SeekFrom::Start(start))?;
        file.write_all(bytes)?;
        *length += bytes.len() as u64;
        Ok(start)
    }

    /// Fills `into` with appended bytes from `start` on.
    ///
    /// # Errors
    /// The bytes can't be read.
    pub fn read(&self, start: u64, into: &mut [u8]) -> io::Result<()> {
        #[cfg(unix)]
        {
            std::os::unix::fs::FileExt::read_exact_at(&self.file, into, start)
        }
        #[cfg(not(unix))]
        {
            use std::io::Read;
            let _alone = lock(&self.length);
            let mut file = &self.file;
            file.seek(SeekFrom::Start(start))?;
            file.read_exact(into)
        }
    }
}

/// The folder of temporary files: `TMPDIR` if set, else `/var/tmp`, since `/tmp` is in memory on many systems.
pub(super) fn folder() -> PathBuf {
    let large = PathBuf::from("/var/tmp");
    if std::env::var_os("TMPDIR").is_none() && large.is_dir() { large } else { std::env::temp_dir() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn appended_bytes_are_read_back() {
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
