//! What the levels that are not in memory have in common: the tiles in use, how much of everything may be there, and counts.

use super::tile::PackedLevel;
use crate::error::Warning;
use crate::image::{Damage, Image};
use std::collections::HashMap;
use std::fmt::Debug;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};

/// Parts of the tiles in use that have a lock each, so that threads seldom meet.
const SHARDS: usize = 64;

/// Who keeps compressed levels.
pub(super) trait KeepsLevels: Debug + Send + Sync {
    /// Forgets the compressed tiles of a level.
    fn forget(&self, level: usize);
}

/// Names a tile among all of all images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct TileKey {
    pub level: u64,
    pub tile: u32,
}

/// Tiles and compressed levels, of which the least recently used go where there are too many.
#[derive(Debug)]
pub(super) struct Store {
    /// Most bytes of the tiles of a shard.
    most_of_shard: usize,
    /// Most bytes of compressed levels.
    most_packed: usize,
    /// Most bytes of images that are decoded at the same time; one may be larger.
    most_decoding: usize,
    shards: Vec<Mutex<Shard>>,
    packed: Mutex<Packed>,
    /// Bytes of the images that are being decoded.
    decoding: Mutex<usize>,
    decoded: Condvar,
    /// Counts uses, so that the latest are known.
    clock: AtomicU64,
    counts: Counts,
    damaged: Mutex<Vec<(String, Warning)>>,
}

#[derive(Debug, Default)]
struct Counts {
    decodes: AtomicU64,
    tiles: AtomicU64,
    evicted_tiles: AtomicU64,
    evicted_levels: AtomicU64,
}

/// What happened on demand while pictures were rendered.
#[derive(Clone, Debug, Default)]
pub struct TexturesOnDemand {
    /// Images that were decoded; each as often as it was.
    pub decodes: u64,
    /// Tiles that were decompressed.
    pub tiles: u64,
    /// Tiles that had to go since there were too many.
    pub evicted_tiles: u64,
    /// Compressed levels that had to go.
    pub evicted_levels: u64,
    /// Bytes of the tiles and the compressed levels that are there now.
    pub bytes: u64,
    /// Images that could not be decoded any more.
    pub warnings: Vec<Warning>,
}

impl Store {
    /// A store that keeps about `bytes`, in tiles and compressed levels, and decodes images of up to `decoding` bytes together.
    pub fn new(bytes: u64, decoding: u64) -> Store {
        let half = usize::try_from(bytes / 2).unwrap_or(usize::MAX);
        Store {
            most_of_shard: half / SHARDS,
            most_packed: half,
            most_decoding: usize::try_from(decoding).unwrap_or(usize::MAX),
            shards: (0..SHARDS).map(|_| Mutex::default()).collect(),
            packed: Mutex::default(),
            decoding: Mutex::new(0),
            decoded: Condvar::new(),
            clock: AtomicU64::new(1),
            counts: Counts::default(),
            damaged: Mutex::default(),
        }
    }

    fn shard(&self, key: TileKey) -> MutexGuard<'_, Shard> {
        let mixed = (key.level << 20 ^ u64::from(key.tile)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        lock(&self.shards[(mixed >> 32) as usize % SHARDS])
    }

    /// A tile that is there.
    pub fn tile(&self, key: TileKey) -> Option<Arc<Image>> {
        self.shard(key).get(key)
    }

    /// Adds a tile; others go where there are too many.
    pub fn add_tile(&self, key: TileKey, tile: Arc<Image>) {
        self.counts.tiles.fetch_add(1, Relaxed);
        let evicted = self.shard(key).add(key, tile, self.most_of_shard);
        self.counts.evicted_tiles.fetch_add(evicted, Relaxed);
    }

    /// Notes that a compressed level is used.
    pub fn touch(&self, level: &PackedLevel) {
        level.last_use.store(self.clock.fetch_add(1, Relaxed), Relaxed);
    }

    /// Is there room for so many bytes more of compressed levels?
    pub fn has_room(&self, bytes: usize) -> bool {
        lock(&self.packed).bytes.saturating_add(bytes) <= self.most_packed
    }

    /// Counts a compressed level of an image; others go where there are too many. Must be called without any lock.
    pub fn keep(&self, of: Arc<dyn KeepsLevels>, level: usize, packed: &Arc<PackedLevel>) {
        self.touch(packed);
        let entry = KeptLevel {
            of: Arc::downgrade(&of),
            level,
            packed: Arc::downgrade(packed),
            bytes: packed.bytes(),
        };
        let evicted = lock(&self.packed).add(entry, self.most_packed);
        for KeptLevel { of, level, .. } in &evicted {
            of.upgrade().into_iter().for_each(|image| image.forget(*level));
        }
        self.counts.evicted_levels.fetch_add(evicted.len() as u64, Relaxed);
    }

    /// Decodes an image of so many bytes, when others leave room for it.
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
    pub fn tell_damage(&self, image: &Image, damage: Damage) {
        let mut damaged = lock(&self.damaged);
        if damaged.iter().all(|(name, _)| *name != image.name) {
            let said = "a coarse copy of the image, or black, was shown where its finer texels were needed";
            let warning = match damage {
                Damage::LeftOut(Warning { file, place, .. }) => {
                    Warning { file, place, ..Warning::general(String::new()) }
                }
                Damage::Fatal(_) => Warning::general(String::new()),
            };
            let message = format!("{}: {said}", image.name);
            damaged.push((image.name.clone(), Warning { message, ..warning }));
        }
    }

    /// What happened so far.
    pub fn on_demand(&self) -> TexturesOnDemand {
        let Counts { decodes, tiles, evicted_tiles, evicted_levels } = &self.counts;
        let of_tiles: usize = self.shards.iter().map(|shard| lock(shard).bytes).sum();
        TexturesOnDemand {
            decodes: decodes.load(Relaxed),
            tiles: tiles.load(Relaxed),
            evicted_tiles: evicted_tiles.load(Relaxed),
            evicted_levels: evicted_levels.load(Relaxed),
            bytes: (of_tiles + lock(&self.packed).bytes) as u64,
            warnings: lock(&self.damaged).iter().map(|(_, warning)| warning.clone()).collect(),
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
    texels: Arc<Image>,
    is_used: bool,
}

impl Shard {
    fn get(&mut self, key: TileKey) -> Option<Arc<Image>> {
        let tile = &mut self.tiles[*self.places.get(&key)?];
        tile.is_used = true;
        Some(tile.texels.clone())
    }

    /// Adds a tile and gives how many went for it.
    fn add(&mut self, key: TileKey, texels: Arc<Image>, most: usize) -> u64 {
        if self.places.contains_key(&key) {
            // Two threads made the same.
            return 0;
        }
        let mut evicted = 0;
        while !self.tiles.is_empty() && self.bytes + texels.bytes() > most {
            self.evict();
            evicted += 1;
        }
        self.bytes += texels.bytes();
        self.places.insert(key, self.tiles.len());
        self.tiles.push(Tile { key, texels, is_used: false });
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
        self.bytes -= gone.texels.bytes();
        if let Some(moved) = self.tiles.get(self.hand) {
            self.places.insert(moved.key, self.hand);
        }
    }
}

/// All compressed levels.
#[derive(Debug, Default)]
struct Packed {
    levels: Vec<KeptLevel>,
    bytes: usize,
}

#[derive(Debug)]
struct KeptLevel {
    of: Weak<dyn KeepsLevels>,
    level: usize,
    packed: Weak<PackedLevel>,
    bytes: usize,
}

impl KeptLevel {
    fn last_use(&self) -> u64 {
        self.packed.upgrade().map_or(0, |packed| packed.last_use.load(Relaxed))
    }
}

impl Packed {
    /// Adds a level and takes out those that have to go for it.
    fn add(&mut self, entry: KeptLevel, most: usize) -> Vec<KeptLevel> {
        let mut evicted = Vec::new();
        while self.bytes + entry.bytes > most
            && let Some(oldest) = (0..self.levels.len()).min_by_key(|&i| self.levels[i].last_use())
        {
            let gone = self.levels.swap_remove(oldest);
            self.bytes -= gone.bytes;
            evicted.push(gone);
        }
        self.bytes += entry.bytes;
        self.levels.push(entry);
        evicted
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
