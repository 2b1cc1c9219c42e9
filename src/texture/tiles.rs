//! Compressed tiles of mip levels, and the cache of tiles that all threads share.

use crate::error::Warning;
use crate::image::{Damage, Image, Pixels};
use rayon::prelude::*;
use std::collections::HashMap;
use std::fmt::Debug;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak};

// Tiles of 64 x 64 texels, and their lossless compression.
//
// Residuals of a linear predictor (left + above - above left), one plane of bytes a channel, are Huffman coded by `fdeflate`, whose
// tables are made for residuals of images: twice as fast as DEFLATE's level 1, which gains little on them. Texels lie row by row
// inside a tile: one of 12 KiB fits into the first level of a cache, where their order makes no difference.

/// Width and height of a tile; those at the right and lower border are smaller.
pub(super) const SIDE: u32 = 64;

/// A level cut into compressed tiles, row by row.
#[derive(Debug)]
pub(super) struct PackedLevel {
    /// Size and format; no pixels.
    like: Image,
    /// Where each tile begins, and where the last one ends.
    starts: Vec<usize>,
    bytes: Vec<u8>,
    /// When it was used last, by the clock of its [store](super::tiles::Store).
    pub last_use: AtomicU64,
}

impl PackedLevel {
    /// Compresses a level of 8 or 16 bits. Others have no tiles.
    pub fn new(level: &Image) -> PackedLevel {
        PackedLevel::of(level, (0..rows(level)).map(|row| packed_row(level, row)))
    }

    /// The same with the help of other threads.
    pub fn new_by_all_threads(level: &Image) -> PackedLevel {
        let packed: Vec<_> = (0..rows(level)).into_par_iter().map(|row| packed_row(level, row)).collect();
        PackedLevel::of(level, packed.into_iter())
    }

    fn of(level: &Image, packed: impl Iterator<Item = (Vec<usize>, Vec<u8>)>) -> PackedLevel {
        let (mut starts, mut bytes) = (vec![0], Vec::new());
        for (lengths, row) in packed {
            starts.extend(lengths.iter().scan(bytes.len(), |end, length| {
                *end += length;
                Some(*end)
            }));
            bytes.extend(row);
        }
        bytes.shrink_to_fit();
        let pixels = match &*level.pixels {
            Pixels::U16(_) => Pixels::U16(Vec::new()),
            _ => Pixels::U8(Vec::new()),
        };
        let like = Image { pixels: Arc::new(pixels), ..level.clone() };
        PackedLevel { like, starts, bytes, last_use: AtomicU64::new(0) }
    }

    /// A tile, decompressed.
    pub fn tile(&self, tile: u32) -> Image {
        let at = TileRect::of(tile, self.like.width, self.like.height);
        let n = self.like.channels as usize;
        let is_deep = matches!(*self.like.pixels, Pixels::U16(_));
        let count = (at.width * at.height) as usize * n;
        let packed = &self.bytes[self.starts[tile as usize]..self.starts[tile as usize + 1]];
        let mut residuals = vec![0; count * if is_deep { 2 } else { 1 }];
        let mut decompressor = fdeflate::Decompressor::new();
        decompressor.ignore_adler32();
        // It was compressed here and lacks nothing.
        let done = decompressor.read(packed, &mut residuals, 0, true);
        debug_assert!(done.is_ok_and(|(_, written)| written == residuals.len()));
        let row = at.width as usize * n;
        let pixels = match &*self.like.pixels {
            Pixels::U16(_) => {
                let mut values: Vec<u16> = residuals
                    .chunks_exact(2)
                    .map(|pair| {
                        let folded = u16::from_be_bytes([pair[0], pair[1]]);
                        folded >> 1 ^ 0u16.wrapping_sub(folded & 1)
                    })
                    .collect();
                restore(&mut values, row, n);
                Pixels::U16(values)
            }
            _ => {
                let mut values = residuals;
                restore(&mut values, row, n);
                Pixels::U8(values)
            }
        };
        let pixels = Arc::new(pixels);
        let name = String::new();
        Image { name, width: at.width, height: at.height, pixels, ..self.like }
    }

    /// Bytes of memory.
    pub fn bytes(&self) -> usize {
        self.bytes.len() + self.starts.len() * size_of::<usize>()
    }
}

/// Compresses the tiles of a row; gives the length of each, and the bytes.
fn packed_row(level: &Image, row: u32) -> (Vec<usize>, Vec<u8>) {
    let (mut lengths, mut bytes, mut residuals) = (Vec::new(), Vec::new(), Vec::new());
    for column in 0..across(level.width) {
        let at = TileRect::of(row * across(level.width) + column, level.width, level.height);
        residuals.clear();
        match &*level.pixels {
            Pixels::U8(data) => predict(data, level, &at, &mut residuals),
            Pixels::U16(data) => {
                let mut wide = Vec::new();
                predict(data, level, &at, &mut wide);
                // Folded to both sides of 0, so that the upper byte is mostly 0.
                let folded = wide.iter().map(|&r: &u16| r << 1 ^ 0u16.wrapping_sub(r >> 15));
                residuals.extend(folded.flat_map(u16::to_be_bytes));
            }
            Pixels::F32(_) | Pixels::Encoded(_) => {}
        }
        let packed = fdeflate::compress_to_vec(&residuals);
        lengths.push(packed.len());
        bytes.extend(packed);
    }
    (lengths, bytes)
}

/// Tiles in a row.
pub(super) fn across(width: u32) -> u32 {
    width.div_ceil(SIDE)
}

/// Rows of tiles.
fn rows(level: &Image) -> u32 {
    level.height.div_ceil(SIDE)
}

/// The texels of a tile.
struct TileRect {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl TileRect {
    fn of(tile: u32, width: u32, height: u32) -> TileRect {
        let (x, y) = (tile % across(width) * SIDE, tile / across(width) * SIDE);
        TileRect { x, y, width: (width - x).min(SIDE), height: (height - y).min(SIDE) }
    }
}

/// Whole numbers that wrap around.
trait Code: Copy + Default {
    fn plus(self, other: Self) -> Self;
    fn minus(self, other: Self) -> Self;
}

impl Code for u8 {
    fn plus(self, other: u8) -> u8 {
        self.wrapping_add(other)
    }

    fn minus(self, other: u8) -> u8 {
        self.wrapping_sub(other)
    }
}

impl Code for u16 {
    fn plus(self, other: u16) -> u16 {
        self.wrapping_add(other)
    }

    fn minus(self, other: u16) -> u16 {
        self.wrapping_sub(other)
    }
}

/// Adds what the predictor misses in a tile.
fn predict<T: Code>(data: &[T], level: &Image, at: &TileRect, out: &mut Vec<T>) {
    let n = level.channels as usize;
    let (stride, row) = (level.width as usize * n, at.width as usize * n);
    // Differences to the line above, then to the left.
    let mut rises = vec![T::default(); row];
    for y in 0..at.height {
        let start = (at.y + y) as usize * stride + at.x as usize * n;
        let here = &data[start..start + row];
        match y {
            0 => rises.copy_from_slice(here),
            _ => {
                let above = &data[start - stride..start - stride + row];
                let pairs = here.iter().zip(above);
                rises.iter_mut().zip(pairs).for_each(|(rise, (here, above))| *rise = here.minus(*above));
            }
        }
        out.extend_from_slice(&rises[..n]);
        out.extend(rises[n..].iter().zip(&rises).map(|(rise, left)| rise.minus(*left)));
    }
}

/// The numbers of a tile from the residuals, in place.
fn restore<T: Code>(values: &mut [T], row: usize, n: usize) {
    match n {
        1 => restore_channels::<T, 1>(values, row),
        2 => restore_channels::<T, 2>(values, row),
        3 => restore_channels::<T, 3>(values, row),
        _ => restore_channels::<T, 4>(values, row),
    }
}

fn restore_channels<T: Code, const N: usize>(values: &mut [T], row: usize) {
    for line in values.chunks_exact_mut(row) {
        let mut left = [T::default(); N];
        for texel in line.chunks_exact_mut(N) {
            for (value, left) in texel.iter_mut().zip(&mut left) {
                *left = left.plus(*value);
                *value = *left;
            }
        }
    }
    for start in (row..values.len()).step_by(row) {
        let (above, here) = values[start - row..start + row].split_at_mut(row);
        here.iter_mut().zip(above).for_each(|(value, above)| *value = value.plus(*above));
    }
}

// The shared cache of decoded tiles and compressed levels, with limits and counters.

/// Shards of the tile cache, each with a lock, to reduce contention.
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
    /// StoreCounts uses, so that the latest are known.
    clock: AtomicU64,
    counts: StoreCounts,
    damaged: Mutex<Vec<(String, Warning)>>,
}

#[derive(Debug, Default)]
struct StoreCounts {
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
            counts: StoreCounts::default(),
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

    /// StoreCounts a compressed level of an image; others go where there are too many. Must be called without any lock.
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
        let StoreCounts { decodes, tiles, evicted_tiles, evicted_levels } = &self.counts;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Encoding;

    /// A level of some texture with noise, of any numbers.
    fn level(width: u32, height: u32, channels: u32, is_deep: bool) -> Image {
        let count = width * height * channels;
        let value = |i: u32| (i.wrapping_mul(2_654_435_761) >> 20) ^ (i / 7);
        let pixels = match is_deep {
            true => Pixels::U16((0..count).map(|i| (value(i) * 31) as u16).collect()),
            false => Pixels::U8((0..count).map(|i| value(i) as u8).collect()),
        };
        let pixels = Arc::new(pixels);
        Image { name: "a".into(), width, height, channels, encoding: Encoding::Srgb, pixels }
    }

    #[test]
    fn tiles_hold_the_texels_of_their_level() {
        for (width, height) in [(64, 64), (1, 1), (130, 65), (63, 200), (1, 129)] {
            for channels in 1..=4 {
                for is_deep in [false, true] {
                    let level = level(width, height, channels, is_deep);
                    let packed = PackedLevel::new(&level);
                    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                        if (x * 7 + y * 3) % 11 == 0 || x == width - 1 || y == height - 1 {
                            let tile = packed.tile(y / SIDE * across(width) + x / SIDE);
                            assert_eq!(tile.rgba(x % SIDE, y % SIDE), level.rgba(x, y), "{width} {x} {y}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn smooth_images_take_less_room() {
        let codes = (0..256 * 256u32).map(|i| (i % 256 / 8 + i / 2048) as u8).collect();
        let smooth = Image { pixels: Arc::new(Pixels::U8(codes)), ..level(256, 256, 1, false) };
        assert!(PackedLevel::new(&smooth).bytes() < 256 * 256 / 4);
    }
}
