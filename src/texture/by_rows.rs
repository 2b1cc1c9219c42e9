//! Levels of an image of floats, made while its rows are decoded: the whole image is never in memory.

use super::packed::{PackedLevel, Packing, SIDE};
use super::pyramid::{Threads, covered, halved_rows, sizes};
use super::store::Store;
use crate::image::{Image, Pixels};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Makes some levels of an image.
pub(super) struct LevelsByRows<'a> {
    levels: Vec<RowLevel>,
    fallback: NearestTexels,
    threads: Threads,
    store: &'a Store,
}

/// The levels made of an image.
pub(super) struct MadeLevels {
    /// Compressed levels, by their numbers.
    pub packed: Vec<(usize, PackedLevel)>,
    /// The level that is to stay in memory as it is.
    pub resident: Option<Image>,
    /// A small version by nearest texels.
    pub fallback: Image,
}

impl LevelsByRows<'_> {
    /// Makes the levels of an image, which is encoded, that are to be compressed, and one that stays as it is.
    pub fn new<'a>(
        image: &Image,
        packed: &BTreeSet<usize>,
        resident: Option<usize>,
        threads: Threads,
        store: &'a Store,
    ) -> LevelsByRows<'a> {
        let last = packed.last().copied().max(resident).unwrap_or(0);
        let level = |(level, [width, height]): (usize, [u32; 2])| {
            let pixels = Arc::new(Pixels::F32(Vec::new()));
            let image = Image { width, height, pixels, ..image.clone() };
            let storage = match resident == Some(level) {
                true => Storage::Raw(Vec::with_capacity(row_length(&image) * height as usize)),
                false if packed.contains(&level) => Storage::Packed(Packing::new(image.clone())),
                false => Storage::Nothing,
            };
            RowLevel { waiting: Vec::new(), first: 0, arrived: 0, next: 0, image, storage }
        };
        let levels = sizes(image.width, image.height).take(last + 1).enumerate().map(level).collect();
        LevelsByRows { levels, fallback: NearestTexels::new(image), threads, store }
    }

    /// Adds the next rows of the image.
    pub fn add(&mut self, numbers: &[f32]) {
        self.fallback.add(numbers);
        let last = self.levels.len() - 1;
        let mut made = self.levels[0].add(numbers, last > 0, self.threads, self.store);
        for (i, level) in self.levels.iter_mut().enumerate().skip(1) {
            let Some(numbers) = made else { break };
            made = level.add(&numbers, i < last, self.threads, self.store);
        }
    }

    /// The levels, once all rows of the image were added.
    pub fn finish(self) -> MadeLevels {
        let mut made = MadeLevels { packed: Vec::new(), resident: None, fallback: self.fallback.image };
        made.fallback.pixels = Arc::new(Pixels::F32(self.fallback.numbers));
        for (number, level) in self.levels.into_iter().enumerate() {
            match level.storage {
                Storage::Nothing => {}
                Storage::Packed(packing) => made.packed.push((number, packing.finish())),
                Storage::Raw(numbers) => {
                    made.resident = Some(Image { pixels: Arc::new(Pixels::F32(numbers)), ..level.image });
                }
            }
        }
        made
    }
}

/// Numbers of a row.
fn row_length(image: &Image) -> usize {
    image.width as usize * image.channels as usize
}

/// A level some of whose rows have arrived.
struct RowLevel {
    /// Its size and format.
    image: Image,
    /// Rows from `first` on that the next level is yet to be made of.
    waiting: Vec<f32>,
    first: u32,
    /// Rows that have arrived.
    arrived: u32,
    /// The next row of the next level.
    next: u32,
    storage: Storage,
}

/// Storage of a level.
enum Storage {
    Nothing,
    Packed(Packing),
    Raw(Vec<f32>),
}

impl RowLevel {
    /// Adds rows; gives rows of the next level where they are wanted and can be made.
    fn add(
        &mut self,
        numbers: &[f32],
        wants_next: bool,
        threads: Threads,
        store: &Store,
    ) -> Option<Vec<f32>> {
        match &mut self.storage {
            Storage::Nothing => {}
            Storage::Packed(packing) => packing.add(numbers, threads, store),
            Storage::Raw(raw) => raw.extend_from_slice(numbers),
        }
        if !wants_next {
            return None;
        }
        let (length, height) = (row_length(&self.image), self.image.height);
        self.arrived += (numbers.len() / length) as u32;
        self.waiting.extend_from_slice(numbers);
        let all = (height / 2).max(1);
        let is_there = |row: &u32| covered(*row, height).end <= self.arrived;
        let end = (self.next..all).take_while(is_there).last()? + 1;
        let waiting = Arc::new(Pixels::F32(std::mem::take(&mut self.waiting)));
        let fine = Image { height: self.arrived - self.first, pixels: waiting, ..self.image.clone() };
        let made = halved_rows(&fine, [self.first, height], self.next..end, threads);
        let first = if end < all { covered(end, height).start } else { self.arrived };
        self.waiting = numbers_of(fine);
        self.waiting.drain(..(first - self.first) as usize * length);
        (self.first, self.next) = (first, end);
        Some(numbers_of(made))
    }
}

/// The numbers of an image of floats that nothing else has.
fn numbers_of(image: Image) -> Vec<f32> {
    match Arc::into_inner(image.pixels) {
        Some(Pixels::F32(numbers)) => numbers,
        _ => Vec::new(),
    }
}

/// A small image of the nearest texels of a large one, as [`super::levels::resized`] makes it.
struct NearestTexels {
    image: Image,
    /// Size of the large one.
    of: [u32; 2],
    numbers: Vec<f32>,
    /// Rows of the large one that have arrived.
    arrived: u64,
}

impl NearestTexels {
    fn new(of: &Image) -> NearestTexels {
        let (width, height) = (of.width.min(SIDE), of.height.min(SIDE));
        let image = Image { width, height, ..of.clone() };
        NearestTexels { image, of: [of.width, of.height], numbers: Vec::new(), arrived: 0 }
    }

    fn add(&mut self, numbers: &[f32]) {
        let n = self.image.channels as usize;
        let length = self.of[0] as usize * n;
        let end = self.arrived + (numbers.len() / length) as u64;
        let place = |i: u32, to: u32, from: u32| u64::from(i) * u64::from(from) / u64::from(to);
        let [width, height] = [self.image.width, self.image.height];
        for y in (self.numbers.len() / (width as usize * n)) as u32..height {
            let row = place(y, height, self.of[1]);
            if row >= end {
                break;
            }
            let row = &numbers[(row - self.arrived) as usize * length..][..length];
            for x in 0..width {
                let at = place(x, width, self.of[0]) as usize * n;
                self.numbers.extend(&row[at..at + n]);
            }
        }
        self.arrived = end;
    }
}

#[cfg(test)]
mod tests {
    use super::super::levels::resized;
    use super::super::pyramid::halved;
    use super::*;
    use crate::image::Encoding;

    fn image(width: u32, height: u32, channels: u32) -> Image {
        let value = |i: u32| (i.wrapping_mul(2_654_435_761) >> 18) as f32 / 321.0 - 7.0;
        let numbers = (0..width * height * channels).map(value).collect();
        let pixels = Arc::new(Pixels::F32(numbers));
        Image { name: "a".into(), width, height, channels, encoding: Encoding::Linear, pixels }
    }

    fn bits(image: &Image) -> Vec<u32> {
        let Pixels::F32(numbers) = &*image.pixels else { panic!("not floats") };
        numbers.iter().map(|v| v.to_bits()).collect()
    }

    #[test]
    fn levels_made_by_rows_are_those_of_the_whole_image() {
        let mut ids = 1 << 40..;
        for (width, height) in [(200, 130), (64, 64), (1, 77), (77, 1), (131, 257), (3, 2), (33, 129)] {
            for (channels, step) in [(1, 1), (2, 7), (3, 64), (4, 1000)] {
                let whole = image(width, height, channels);
                let next = |finer: &Image| ((finer.width, finer.height) != (1, 1)).then(|| halved(finer));
                let expected: Vec<Image> = std::iter::successors(Some(whole.clone()), next).collect();
                let count = expected.len();
                for (packed, resident) in [
                    ((0..count).collect::<BTreeSet<usize>>(), None),
                    ((1..count.min(3)).collect(), Some(count - 1)),
                    (BTreeSet::new(), Some(0)),
                ] {
                    let store = Store::new(1 << 30, 1 << 20);
                    for threads in [Threads::This, Threads::All] {
                        let packed =
                            packed.iter().copied().filter(|&level| Some(level) != resident).collect();
                        let mut levels = LevelsByRows::new(&whole, &packed, resident, threads, &store);
                        let Pixels::F32(numbers) = &*whole.pixels else { panic!("not floats") };
                        numbers.chunks(step * row_length(&whole)).for_each(|rows| levels.add(rows));
                        let made = levels.finish();
                        assert_eq!(made.packed.len(), packed.len());
                        for (level, found) in made.packed {
                            let (level, id) = (&expected[level], ids.next().expect("there are more"));
                            for (x, y) in
                                (0..level.height).flat_map(|y| (0..level.width).map(move |x| (x, y)))
                            {
                                let texel = found.texel(x, y, id, &store).map(f32::to_bits);
                                assert_eq!(
                                    texel,
                                    level.rgba(x, y).map(f32::to_bits),
                                    "{width} x {height}: {x} {y}"
                                );
                            }
                        }
                        let found = made.resident.as_ref().map(bits);
                        assert!(found == resident.map(|level| bits(&expected[level])), "{width} x {height}");
                        let side = |size: u32| size.min(SIDE);
                        let nearest = resized(&whole, side(width), side(height), Encoding::Linear);
                        assert!(bits(&made.fallback) == bits(&nearest), "{width} x {height}");
                    }
                }
            }
        }
    }

    #[test]
    fn rows_wait_no_longer_than_the_next_level_needs_them() {
        let whole = image(64, 4096, 1);
        let store = Store::new(1 << 30, 1 << 20);
        let packed = (0..13).collect();
        let mut levels = LevelsByRows::new(&whole, &packed, None, Threads::This, &store);
        let Pixels::F32(numbers) = &*whole.pixels else { panic!("not floats") };
        for rows in numbers.chunks(5 * 64) {
            levels.add(rows);
            let waiting: usize = levels.levels.iter().map(|level| level.waiting.len()).sum();
            assert!(waiting <= 3 * 64 * 2, "{waiting}");
        }
        assert_eq!(levels.finish().packed.len(), 13);
    }
}
