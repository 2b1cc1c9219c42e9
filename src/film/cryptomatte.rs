//! Cryptomatte: coverage of pixels by ids, and ids as hashes of names.

use crate::sampling::hash::murmur32;
use std::ops::Range;

/// Sample counts of ids by pixel, as linked lists in one array: most pixels have a single id.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Coverage {
    /// Index plus one of the first entry of each pixel's list; 0: empty.
    pub heads: Vec<u32>,
    pub entries: Vec<Entry>,
}

#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Entry {
    id: u32,
    /// Number of samples with the id.
    count: u32,
    /// Index plus one of the pixel's next entry; 0: end.
    next: u32,
}

impl Coverage {
    /// Empty lists; `None` if memory runs out.
    pub fn try_new(pixels: usize) -> Option<Coverage> {
        Some(Coverage { heads: bytemuck::try_zeroed_vec(pixels).ok()?, entries: Vec::new() })
    }

    /// Adds samples of an id to a pixel.
    pub fn add(&mut self, pixel: usize, id: u32, count: u32) {
        let mut at = self.heads[pixel];
        while let Some(entry) = self.entries.get_mut((at as usize).wrapping_sub(1)) {
            if entry.id == id {
                entry.count = entry.count.saturating_add(count);
                return;
            }
            at = entry.next;
        }
        self.entries.push(Entry { id, count, next: self.heads[pixel] });
        self.heads[pixel] = u32::try_from(self.entries.len()).expect("fewer than 2^32 ids on all pixels");
    }

    /// Adds the list of pixel `from` of other lists to pixel `pixel`.
    pub fn merge(&mut self, pixel: usize, other: &Coverage, from: usize) {
        other.of(from).for_each(|entry| self.add(pixel, entry.id, entry.count));
    }

    /// The ids of a pixel with their numbers of samples, sorted by decreasing number, then by id.
    pub fn ranked(&self, pixel: usize) -> Vec<(u32, u32)> {
        let mut list: Vec<(u32, u32)> = self.of(pixel).map(|entry| (entry.id, entry.count)).collect();
        list.sort_unstable_by_key(|&(id, count)| (std::cmp::Reverse(count), id));
        list
    }

    /// Concatenates the lists of consecutive ranges of pixels.
    pub fn joined(parts: &[&Coverage]) -> Coverage {
        let mut all = Coverage::default();
        for part in parts {
            let before = u32::try_from(all.entries.len()).expect("fewer than 2^32 ids on all pixels");
            let shifted = |index: u32| if index == 0 { 0 } else { index + before };
            all.heads.extend(part.heads.iter().map(|&head| shifted(head)));
            all.entries
                .extend(part.entries.iter().map(|entry| Entry { next: shifted(entry.next), ..*entry }));
        }
        all
    }

    /// The lists of a range of pixels.
    pub fn of_pixels(&self, pixels: Range<usize>) -> Coverage {
        let mut part = Coverage { heads: vec![0; pixels.len()], entries: Vec::new() };
        for (own, pixel) in pixels.enumerate() {
            let chain: Vec<&Entry> = self.of(pixel).collect();
            // New entries are inserted at the front.
            chain.iter().rev().for_each(|entry| part.add(own, entry.id, entry.count));
        }
        part
    }

    /// Whether all lists end and no entry is shared: entries only link to earlier ones, and each is linked to at most once.
    pub fn is_valid(&self) -> bool {
        let mut is_linked = vec![false; self.entries.len()];
        let nexts = self.entries.iter().enumerate().map(|(at, entry)| (entry.next, at));
        let heads = self.heads.iter().map(|&head| (head, self.entries.len()));
        heads.chain(nexts).filter(|(index, _)| *index > 0).all(|(index, behind)| {
            let at = index as usize - 1;
            at < behind && !std::mem::replace(&mut is_linked[at], true)
        })
    }

    fn of(&self, pixel: usize) -> impl Iterator<Item = &Entry> {
        let entry = |at: u32| self.entries.get((at as usize).wrapping_sub(1));
        std::iter::successors(entry(self.heads[pixel]), move |last| entry(last.next))
    }
}

/// The id of a name: its hash, changed where necessary so that as a float it is neither subnormal, infinite nor NaN (Friedman, Jones
/// 2015, "Fully automatic id mattes with support for motion blur and transparency"; Psyop's Cryptomatte specification 1.2.0).
pub fn matte_id(name: &str) -> u32 {
    let hash = murmur3_32(name.as_bytes());
    match hash >> 23 & 255 {
        0 | 255 => hash ^ 1 << 23,
        _ => hash,
    }
}

/// The key of a Cryptomatte in file headers: seven hexadecimal digits.
pub fn matte_key(kind: &str) -> String {
    let digits = format!("{:08x}", murmur3_32(kind.as_bytes()));
    digits[..7].to_string()
}

/// MurmurHash3_x86_32 (Appleby) with seed 0.
fn murmur3_32(bytes: &[u8]) -> u32 {
    let scrambled = |k: u32| k.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (words, rest) = bytes.as_chunks::<4>();
    let mut hash = 0u32;
    for word in words {
        hash ^= scrambled(u32::from_le_bytes(*word));
        hash = hash.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    let rest = rest.iter().rev().fold(0, |k, &byte| k << 8 | u32::from(byte));
    murmur32(hash ^ scrambled(rest) ^ bytes.len() as u32)
}

/// Cryptomatte ids of a scene; lists that no AOV needs are empty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MatteIds {
    /// Ids by object.
    pub objects: Vec<u32>,
    /// Ids by material.
    pub materials: Vec<u32>,
    /// Ids of the assets by object.
    pub assets: Vec<u32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_or_cyclic_lists_are_invalid() {
        let mut lists = Coverage::try_new(3).expect("three pixels");
        (0..3).for_each(|pixel| (0..3).for_each(|id| lists.add(pixel, id, 1)));
        assert!(lists.is_valid());
        let mut shared = lists.clone();
        shared.heads[1] = shared.heads[0];
        assert!(!shared.is_valid());
        let mut joined = lists.clone();
        joined.entries[8].next = 5;
        assert!(!joined.is_valid());
        lists.entries[3].next = 9;
        assert!(!lists.is_valid(), "link to a later entry");
    }

    #[test]
    fn ranking_does_not_depend_on_the_order_of_samples() {
        let samples = [(0, 7), (1, 9), (0, 3), (0, 7), (0, 5), (1, 9), (0, 5)];
        let mut lists = Coverage::try_new(3).expect("three pixels");
        samples.iter().for_each(|&(pixel, id)| lists.add(pixel, id, 1));
        let mut backwards = Coverage::try_new(3).expect("three pixels");
        samples.iter().rev().for_each(|&(pixel, id)| backwards.add(pixel, id, 1));
        for lists in [&lists, &backwards] {
            assert_eq!(lists.ranked(0), [(5, 2), (7, 2), (3, 1)]);
            assert_eq!((lists.ranked(1), lists.ranked(2)), (vec![(9, 2)], vec![]));
        }
        let mut both = lists.clone();
        both.merge(0, &backwards, 0);
        both.merge(2, &backwards, 1);
        assert_eq!((both.ranked(0), both.ranked(2)), (vec![(5, 4), (7, 4), (3, 2)], vec![(9, 2)]));
    }

    /// Published test vectors of MurmurHash3, and keys from the specification and from files by Blender.
    #[test]
    fn hashes_equal_published_values() {
        for (text, hash) in [
            ("", 0),
            ("test", 0xba6b_d213),
            ("Hello, world!", 0xc036_3e43),
            ("The quick brown fox jumps over the lazy dog", 0x2e4f_f723),
        ] {
            assert_eq!(murmur3_32(text.as_bytes()), hash, "{text}");
        }
        assert_eq!(matte_key("crypto_asset"), "28322e9");
        assert_eq!(matte_key("ViewLayer.CryptoObject"), "542cafa");
    }

    #[test]
    fn ids_are_normal_floats() {
        let mut changed = 0;
        for i in 0..20_000 {
            let (name, id) = (format!("object {i}"), matte_id(&format!("object {i}")));
            assert!(f32::from_bits(id).is_normal(), "{name}");
            changed += u32::from(id != murmur3_32(name.as_bytes()));
        }
        assert!((100..220).contains(&changed), "{changed}: 2 of 256 exponents are invalid");
    }
}
