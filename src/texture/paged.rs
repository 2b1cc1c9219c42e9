//! Levels of images that are not in memory: their texels are found in tiles, which are decoded when somebody asks for them.
//!
//! A lookup looks into a small cache of its thread first, which takes no lock; then into the tiles that the [`Store`] shares; then
//! into the compressed tiles of the image. If those are not there either, the whole image is decoded, since JPEG and PNG can't be read
//! in parts, and the level that is asked for is cut into compressed tiles, with the coarser ones that are not in memory. Whatever
//! has not been used for longest goes when there is too much of it. All of this finds the very texels that a level in memory has.
//!
//! Nothing here waits for other work of the thread pool: a thread that waits there may begin another tile of the picture and ask for
//! what it holds itself.

use super::pyramid::{halved_by_one_thread, sizes};
use super::store::{KeepsLevels, Store, TileKey};
use super::tile::{PackedLevel, SIDE, across};
use crate::image::{Encoding, Image, Pixels};
use std::cell::RefCell;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Tiles that each thread keeps at hand.
const AT_HAND: usize = 64;

/// A tile and what it is of.
type KnownTile = (TileKey, Arc<Image>);

thread_local! {
    /// The tiles that a thread looked into last, each in a place that follows from where it lies.
    static LATEST: RefCell<Vec<Option<KnownTile>>> = const { RefCell::new(Vec::new()) };
}

/// A level whose texels are decoded on demand.
#[derive(Debug)]
pub(super) struct PagedLevel {
    /// No other level of any image has it.
    id: u64,
    level: usize,
    width: u32,
    of: Arc<PagedImage>,
}

impl PagedLevel {
    /// Level `level` of an image.
    pub fn new(of: &Arc<PagedImage>, level: usize, width: u32) -> PagedLevel {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        PagedLevel { id: NEXT.fetch_add(1, Ordering::Relaxed), level, width, of: of.clone() }
    }

    /// The texel at a position in the level, counted row by row, as linear RGBA.
    #[inline(never)]
    pub fn texel(&self, at: usize) -> [f32; 4] {
        let width = self.width as usize;
        let (x, y) = ((at % width) as u32, (at / width) as u32);
        let (column, row) = (x / SIDE, y / SIDE);
        let key = TileKey { level: self.id, tile: row * across(self.width) + column };
        // Neighbouring tiles never share a place.
        let place = ((column % 8 + row % 8 * 8) as usize + self.id as usize * 11) % AT_HAND;
        LATEST.with_borrow_mut(|latest| {
            if latest.is_empty() {
                latest.resize(AT_HAND, None);
            }
            match &latest[place] {
                Some((known, tile)) if *known == key => tile.rgba(x % SIDE, y % SIDE),
                _ => {
                    let tile = self.of.tile(self, key);
                    let texel = tile.rgba(x % SIDE, y % SIDE);
                    latest[place] = Some((key, tile));
                    texel
                }
            }
        })
    }
}

/// An image some of whose levels are not in memory.
#[derive(Debug)]
pub(super) struct PagedImage {
    /// Still encoded.
    image: Image,
    /// By level: compressed tiles.
    packed: Mutex<Vec<Option<Arc<PackedLevel>>>>,
    /// Levels from here on are in memory.
    resident_from: usize,
    /// Shown where the image can't be decoded any more: a coarse copy.
    stand_in: Image,
    store: Arc<Store>,
}

impl PagedImage {
    /// An image with `levels` levels, of which the ones from `resident_from` on are in memory.
    pub fn new(
        image: Image,
        levels: usize,
        resident_from: usize,
        stand_in: Image,
        store: &Arc<Store>,
    ) -> PagedImage {
        let packed = Mutex::new(vec![None; levels]);
        PagedImage { image, packed, resident_from, stand_in, store: store.clone() }
    }

    /// Keeps the texels of a level, compressed, as if it had been asked for.
    pub fn keep(self: &Arc<Self>, level: usize, packed: PackedLevel) {
        let packed = Arc::new(packed);
        lock(&self.packed)[level] = Some(packed.clone());
        self.store.keep(self.clone(), level, &packed);
    }

    fn tile(self: &Arc<Self>, level: &PagedLevel, key: TileKey) -> Arc<Image> {
        if let Some(tile) = self.store.tile(key) {
            return tile;
        }
        let packed = self.packed(level.level);
        self.store.touch(&packed);
        let tile = Arc::new(packed.tile(key.tile));
        self.store.add_tile(key, tile.clone());
        tile
    }

    /// The compressed tiles of a level. Threads that ask for an image which is being decoded wait for that.
    fn packed(self: &Arc<Self>, level: usize) -> Arc<PackedLevel> {
        let mut all = lock(&self.packed);
        if let Some(packed) = &all[level] {
            return packed.clone();
        }
        let made = self.store.decode(self.image.bytes(), || self.levels_from(level));
        for (level, packed) in &made {
            all[*level] = Some(packed.clone());
        }
        drop(all);
        // The one that is asked for last: it stays longest.
        for (level, packed) in made.iter().rev() {
            self.store.keep(self.clone(), *level, packed);
        }
        made[0].1.clone()
    }

    /// Decodes the image and compresses a level, the first of the list, and the coarser ones that are not in memory.
    fn levels_from(&self, asked: usize) -> Vec<(usize, Arc<PackedLevel>)> {
        let packed = |image: &Image| Arc::new(PackedLevel::new(image));
        let mut image = match self.image.decoded() {
            Ok(image) => Image { encoding: self.image.encoding, ..image },
            Err(damage) => {
                self.store.tell_damage(&self.image, damage);
                return vec![(asked, packed(&self.stand_in(asked)))];
            }
        };
        for _ in 0..asked {
            image = halved_by_one_thread(&image);
        }
        let mut made = vec![(asked, packed(&image))];
        for level in asked + 1..self.resident_from {
            image = halved_by_one_thread(&image);
            made.push((level, packed(&image)));
        }
        made
    }

    /// A level made of the coarse copy.
    fn stand_in(&self, level: usize) -> Image {
        let [width, height] = sizes(self.image.width, self.image.height).nth(level).unwrap_or([1, 1]);
        resized(&self.stand_in, width, height, self.image.encoding)
    }
}

impl KeepsLevels for PagedImage {
    fn forget(&self, level: usize) {
        lock(&self.packed)[level] = None;
    }
}

/// An image of another size with the nearest texels.
pub(super) fn resized(image: &Image, width: u32, height: u32, encoding: Encoding) -> Image {
    let n = image.channels as usize;
    let place = |i: u32, to: u32, from: u32| (u64::from(i) * u64::from(from) / u64::from(to)) as usize;
    let texels = (0..height).flat_map(|y| {
        (0..width).map(move |x| {
            (place(y, height, image.height) * image.width as usize + place(x, width, image.width)) * n
        })
    });
    let pixels = match &*image.pixels {
        Pixels::U8(data) => Pixels::U8(texels.flat_map(|at| data[at..at + n].iter().copied()).collect()),
        Pixels::U16(data) => Pixels::U16(texels.flat_map(|at| data[at..at + n].iter().copied()).collect()),
        Pixels::F32(data) => Pixels::F32(texels.flat_map(|at| data[at..at + n].iter().copied()).collect()),
        Pixels::Encoded(_) => Pixels::U8(vec![0; width as usize * height as usize * n]),
    };
    Image { width, height, encoding, pixels: Arc::new(pixels), ..image.clone() }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
