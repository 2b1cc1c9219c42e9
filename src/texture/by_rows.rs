//! Builds mip levels of a float image while its rows are decoded: the whole image is never in memory.

use super::packed::{PackedLevel, Packing, SIDE};
use super::pyramid::{Threads, covered, halved_rows, sizes};
use super::store::Store;
use crate::image::{Image, Pixels};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Builds selected mip levels of an image from its rows.
pub(super) struct LevelsByRows<'a> {
    levels: Vec<PartialLevel>,
    fallback: NearestTexels,
    threads: Threads,
    store: &'a Store,
}

/// The mip levels built from an image.
pub(super) struct BuiltLevels {
    /// Compressed levels with their mip level indices.
    pub packed: Vec<(usize, PackedLevel)>,
    /// The level that stays in memory uncompressed.
    pub resident: Option<Image>,
    /// A copy of at most [`SIDE`] x [`SIDE`] texels, sampled by nearest neighbour.
    pub fallback: Image,
}

impl LevelsByRows<'_> {
    /// For an encoded image: the levels `packed` are compressed, the level `resident` is kept uncompressed.
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
                false => Storage::Discarded,
            };
            PartialLevel { pending: Vec::new(), first: 0, arrived: 0, next: 0, image, storage }
        };
        let levels = sizes(image.width, image.height).take(last + 1).enumerate().map(level).collect();
        LevelsByRows { levels, fallback: NearestTexels::new(image), threads, store }
    }

    /// Adds the next whole rows of the image, from the top down.
    pub fn add(&mut self, values: &[f32]) {
        self.fallback.add(values);
        let last = self.levels.len() - 1;
        let mut built = self.levels[0].add(values, last > 0, self.threads, self.store);
        for (i, level) in self.levels.iter_mut().enumerate().skip(1) {
            let Some(values) = built else { break };
            built = level.add(&values, i < last, self.threads, self.store);
        }
    }

    /// The levels, after all rows of the image have been added.
    pub fn finish(self) -> BuiltLevels {
        let mut built = BuiltLevels { packed: Vec::new(), resident: None, fallback: self.fallback.image };
        built.fallback.pixels = Arc::new(Pixels::F32(self.fallback.values));
        for (index, level) in self.levels.into_iter().enumerate() {
            match level.storage {
                Storage::Discarded => {}
                Storage::Packed(packing) => built.packed.push((index, packing.finish())),
                Storage::Raw(values) => {
                    built.resident = Some(Image { pixels: Arc::new(Pixels::F32(values)), ..level.image });
                }
            }
        }
        built
    }
}

/// Components in a row of an image.
fn row_length(image: &Image) -> usize {
    image.width as usize * image.channels as usize
}

/// A mip level whose rows up to `arrived` are known.
struct PartialLevel {
    /// Size and format of the level; its pixels are unused.
    image: Image,
    /// Rows from `first` on that are still needed for the next coarser level.
    pending: Vec<f32>,
    first: u32,
    /// Number of rows added so far.
    arrived: u32,
    /// The next row of the next coarser level to compute.
    next: u32,
    storage: Storage,
}

/// Where the rows of a level go.
enum Storage {
    Discarded,
    Packed(Packing),
    Raw(Vec<f32>),
}

impl PartialLevel {
    /// Adds rows; returns the rows of the next coarser level that can be computed now, if `wants_next`.
    fn add(&mut self, values: &[f32], wants_next: bool, threads: Threads, store: &Store) -> Option<Vec<f32>> {
        match &mut self.storage {
            Storage::Discarded => {}
            Storage::Packed(packing) => packing.add(values, threads, store),
            Storage::Raw(raw) => raw.extend_from_slice(values),
        }
        if !wants_next {
            return None;
        }
        let (length, height) = (row_length(&self.image), self.image.height);
        self.arrived += (values.len() / length) as u32;
        self.pending.extend_from_slice(values);
        let all = (height / 2).max(1);
        let is_available = |row: &u32| covered(*row, height).end <= self.arrived;
        let end = (self.next..all).take_while(is_available).last()? + 1;
        let pending = Arc::new(Pixels::F32(std::mem::take(&mut self.pending)));
        let fine = Image { height: self.arrived - self.first, pixels: pending, ..self.image.clone() };
        let built = halved_rows(&fine, [self.first, height], self.next..end, threads);
        let first = if end < all { covered(end, height).start } else { self.arrived };
        self.pending = values_of(fine);
        self.pending.drain(..(first - self.first) as usize * length);
        (self.first, self.next) = (first, end);
        Some(values_of(built))
    }
}

/// The components of a float image with a single owner; empty for others.
fn values_of(image: Image) -> Vec<f32> {
    match Arc::into_inner(image.pixels) {
        Some(Pixels::F32(values)) => values,
        _ => Vec::new(),
    }
}

/// Downsamples an image by nearest neighbour, row by row, with the result of [`super::levels::resized`].
struct NearestTexels {
    image: Image,
    /// Size of the source image, texels.
    source: [u32; 2],
    values: Vec<f32>,
    /// Number of source rows added so far.
    arrived: u64,
}

impl NearestTexels {
    fn new(source: &Image) -> NearestTexels {
        let (width, height) = (source.width.min(SIDE), source.height.min(SIDE));
        let image = Image { width, height, ..source.clone() };
        NearestTexels { image, source: [source.width, source.height], values: Vec::new(), arrived: 0 }
    }

    fn add(&mut self, values: &[f32]) {
        let n = self.image.channels as usize;
        let length = self.source[0] as usize * n;
        let end = self.arrived + (values.len() / length) as u64;
        let source_index = |i: u32, to: u32, from: u32| u64::from(i) * u64::from(from) / u64::from(to);
        let [width, height] = [self.image.width, self.image.height];
        for y in (self.values.len() / (width as usize * n)) as u32..height {
            let row = source_index(y, height, self.source[1]);
            if row >= end {
                break;
            }
            let row = &values[(row - self.arrived) as usize * length..][..length];
            for x in 0..width {
                let at = source_index(x, width, self.source[0]) as usize * n;
                self.values.extend(&row[at..at + n]);
            }
        }
        self.arrived = end;
    }
}

#[cfg(test)]
mod tests {
    use super::super::levels::resized;
    use super::super::pyramid::mip_levels;
    use super::*;
    use crate::image::Encoding;

    fn image(width: u32, height: u32, channels: u32) -> Image {
        let value = |i: u32| (i.wrapping_mul(2_654_435_761) >> 18) as f32 / 321.0 - 7.0;
        let values = (0..width * height * channels).map(value).collect();
        let pixels = Arc::new(Pixels::F32(values));
        Image { name: "a".into(), width, height, channels, encoding: Encoding::Linear, pixels }
    }

    fn bits(image: &Image) -> Vec<u32> {
        let Pixels::F32(values) = &*image.pixels else { panic!("not floats") };
        values.iter().map(|v| v.to_bits()).collect()
    }

    #[test]
    fn levels_built_by_rows_equal_those_of_the_whole_image() {
        let mut ids = 1 << 40..;
        for (width, height) in [(200, 130), (64, 64), (1, 77), (77, 1), (131, 257), (3, 2), (33, 129)] {
            for (channels, step) in [(1, 1), (2, 7), (3, 64), (4, 1000)] {
                let whole = image(width, height, channels);
                let expected: Vec<Image> = mip_levels(Some(whole.clone())).collect();
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
                        let Pixels::F32(values) = &*whole.pixels else { panic!("not floats") };
                        values.chunks(step * row_length(&whole)).for_each(|rows| levels.add(rows));
                        let built = levels.finish();
                        assert_eq!(built.packed.len(), packed.len());
                        for (level, found) in built.packed {
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
                        let found = built.resident.as_ref().map(bits);
                        assert!(found == resident.map(|level| bits(&expected[level])), "{width} x {height}");
                        let side = |size: u32| size.min(SIDE);
                        let nearest = resized(&whole, side(width), side(height), Encoding::Linear);
                        assert!(bits(&built.fallback) == bits(&nearest), "{width} x {height}");
                    }
                }
            }
        }
    }

    #[test]
    fn rows_are_dropped_once_the_next_level_has_used_them() {
        let whole = image(64, 4096, 1);
        let store = Store::new(1 << 30, 1 << 20);
        let packed = (0..13).collect();
        let mut levels = LevelsByRows::new(&whole, &packed, None, Threads::This, &store);
        let Pixels::F32(values) = &*whole.pixels else { panic!("not floats") };
        for rows in values.chunks(5 * 64) {
            levels.add(rows);
            let pending: usize = levels.levels.iter().map(|level| level.pending.len()).sum();
            assert!(pending <= 3 * 64 * 2, "{pending}");
        }
        assert_eq!(levels.finish().packed.len(), 13);
    }
}
