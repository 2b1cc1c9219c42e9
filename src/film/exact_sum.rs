//! Order-independent sums: adding parts of a picture in any order gives the same bits.
//!
//! A sum is a pair: the sum rounded to f64, and the rounding error. The pair is exact and unique if addends are multiples of a grid and
//! sums stay below [`LARGEST`]. Addends are first rounded to the grid, whose spacing is below the precision of an f32 of 1e-6. Sums
//! above [`LARGEST`] depend on the order in the last digit of an f64.

use crate::simd::{Kernel, dispatch};
use bytemuck::{Pod, Zeroable};

/// Number of fractional bits of the grid.
const GRID_BITS: i32 = 44;

/// Adding and subtracting this rounds numbers below [`ROUNDED`] to the grid.
const ROUNDER: f64 = 1.5 * (1u64 << (52 - GRID_BITS)) as f64;

/// Magnitude from which f64 values are not rounded, since they have no bits finer than half the grid.
const ROUNDED: f64 = (1u64 << (51 - GRID_BITS)) as f64;

/// Upper limit of exact sums.
#[cfg(test)]
const LARGEST: f64 = (1u64 << (76 - GRID_BITS)) as f64;

/// Rounds a number to the grid.
#[inline(always)]
pub(super) fn round_to_grid(value: f64) -> f64 {
    if value.abs() < ROUNDED { (value + ROUNDER) - ROUNDER } else { value }
}

/// Adds to an exact sum (two-sum of Knuth 1969; Dekker 1971, "A Floating-Point Technique for Extending the Available Precision").
#[inline(always)]
pub(super) fn add_exact(high: &mut f64, low: &mut f32, value: f64) {
    let sum = *high + value;
    let of_value = sum - *high;
    let error = (*high - (sum - of_value)) + (value - of_value);
    let rest = f64::from(*low) + error;
    *high = sum + rest;
    *low = (rest - (*high - sum)) as f32;
}

/// A list of exact sums; in tiles, where samples have a fixed order, of plain f64 sums.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SumList {
    pub high: Vec<f64>,
    /// Rounding errors of `high`; empty in tiles.
    pub low: Vec<f32>,
}

impl SumList {
    /// Zeros; `None` if memory runs out.
    pub fn try_new(count: usize, is_exact: bool) -> Option<SumList> {
        let low = if is_exact { count } else { 0 };
        Some(SumList {
            high: bytemuck::try_zeroed_vec(count).ok()?,
            low: bytemuck::try_zeroed_vec(low).ok()?,
        })
    }

    /// Adds plain sums of a tile: a slice for each of consecutive pixels.
    pub fn add_strided<'a>(&mut self, mut at: usize, pixels: impl Iterator<Item = &'a [f64]>) {
        let mut values = [0.0; BUFFER];
        let mut count = 0;
        for numbers in pixels {
            if count + numbers.len() > BUFFER {
                self.add_all(at, &values[..count]);
                (at, count) = (at + count, 0);
            }
            values[count..count + numbers.len()].iter_mut().zip(numbers).for_each(|(to, from)| *to = *from);
            count += numbers.len();
        }
        self.add_all(at, &values[..count]);
    }

    /// Adds plain sums to those from index `at` on.
    fn add_all(&mut self, at: usize, values: &[f64]) {
        let here = at..at + values.len();
        dispatch(AddAll { high: &mut self.high[here.clone()], low: &mut self.low[here], values });
    }

    /// Adds `count` plain or exact sums of another list.
    pub fn merge(&mut self, at: usize, other: &SumList, from: usize, count: usize) {
        let highs = &other.high[from..from + count];
        if other.low.is_empty() {
            self.add_all(at, highs);
            return;
        }
        let (high, low) = (&mut self.high[at..at + count], &mut self.low[at..at + count]);
        let sums = high.iter_mut().zip(low);
        let others = highs.iter().zip(&other.low[from..from + count]);
        for ((high, low), (value, rest)) in sums.zip(others) {
            add_exact(high, low, *value);
            add_exact(high, low, f64::from(*rest));
        }
    }
}

/// Size of the buffer of [`SumList::add_strided`].
const BUFFER: usize = 96;

/// Adds plain sums to exact ones.
struct AddAll<'a> {
    high: &'a mut [f64],
    low: &'a mut [f32],
    values: &'a [f64],
}

impl Kernel for AddAll<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let sums = self.high.iter_mut().zip(self.low).zip(self.values);
        sums.for_each(|((high, low), value)| add_exact(high, low, round_to_grid(*value)));
    }
}

/// Sums of red, green and blue over some samples of a pixel, and the number of these samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct RgbSum {
    pub rgb: [f64; 3],
    /// Rounding errors of `rgb`.
    pub low: [f32; 3],
    pub count: u32,
}

impl RgbSum {
    /// Adds a sample, in a tile.
    pub fn add(&mut self, rgb: [f32; 3]) {
        self.rgb.iter_mut().zip(rgb).for_each(|(sum, v)| *sum += f64::from(v));
        self.count += 1;
    }

    /// Adds a value to the exact sum without changing the count.
    pub fn add_exactly(&mut self, rgb: [f32; 3]) {
        for ((sum, low), value) in self.rgb.iter_mut().zip(&mut self.low).zip(rgb) {
            add_exact(sum, low, round_to_grid(f64::from(value)));
        }
    }

    /// Adds the plain sum of a tile, or an exact sum.
    pub fn merge(&mut self, other: &RgbSum, is_of_tile: bool) {
        for c in 0..3 {
            let value = if is_of_tile { round_to_grid(other.rgb[c]) } else { other.rgb[c] };
            add_exact(&mut self.rgb[c], &mut self.low[c], value);
            if !is_of_tile {
                add_exact(&mut self.rgb[c], &mut self.low[c], f64::from(other.low[c]));
            }
        }
        self.count = self.count.saturating_add(other.count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::SplitMix64;

    /// Numbers of very different magnitudes, as in sums over tiles.
    fn numbers(seed: u64, count: usize) -> Vec<f64> {
        let mut random = SplitMix64::new(seed);
        let size = |random: &mut SplitMix64| 2f64.powf(60.0 * random.next_unit() - 45.0);
        let sums = (0..count).map(|_| (0..8).map(|_| size(&mut random) * random.next_unit()).sum());
        sums.collect()
    }

    fn summed(values: &[f64]) -> SumList {
        let mut sum = SumList::try_new(1, true).expect("one number");
        for &value in values {
            sum.merge(0, &SumList { high: vec![value], low: Vec::new() }, 0, 1);
        }
        sum
    }

    #[test]
    fn sums_do_not_depend_on_order_or_grouping() {
        for seed in 0..50 {
            let mut values = numbers(seed, 250);
            let whole = summed(&values);
            assert!(whole.high[0] < LARGEST);
            let mut random = SplitMix64::new(seed);
            for at in (1..values.len()).rev() {
                values.swap(at, (random.next_unit() * (at + 1) as f64) as usize);
            }
            assert_eq!(summed(&values), whole, "{seed}: another order");
            let mut grouped = SumList::try_new(1, true).expect("one number");
            values.chunks(37).rev().for_each(|chunk| grouped.merge(0, &summed(chunk), 0, 1));
            assert_eq!(grouped, whole, "{seed}: in groups");
        }
    }

    /// Shows that the test above is sensitive.
    #[test]
    fn plain_sums_depend_on_the_order() {
        let differs = |seed: &u64| {
            let values = numbers(*seed, 250);
            values.iter().sum::<f64>() != values.iter().rev().sum::<f64>()
        };
        assert!((0..50).filter(differs).count() > 20);
    }

    #[test]
    fn grid_is_finer_than_single_precision_of_samples() {
        for value in [1e-6f32, 3.7e-4, 0.1, 5.0, 127.9, 128.1, 1e9] {
            let value = f64::from(value);
            assert_eq!(round_to_grid(value), value, "{value}");
        }
        assert!((round_to_grid(1e-9) / 1e-9 - 1.0).abs() < 1e-4);
    }
}
