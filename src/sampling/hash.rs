//! Integer hashes and random numbers made of them: the same on every machine.

/// A well mixed hash of 32 bits that does not map zero to zero (the mixer is Wellons' lowbias32).
#[inline(always)]
pub fn hash32(mut x: u32) -> u32 {
    x ^= 0xe6fe_3beb;
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A number in [0, 1) from the upper 24 bits of a hash.
#[inline(always)]
pub fn unit(hash: u32) -> f32 {
    // Through i32, which every CPU converts in one step.
    (hash >> 8) as i32 as f32 * (1.0 / 16_777_216.0)
}

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014): mixes 64 bits, and maps zero to zero.
#[inline(always)]
pub fn mix64(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The generator SplitMix64: a small stream of numbers.
#[derive(Clone, Debug)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// The stream of a seed.
    pub fn new(seed: u64) -> SplitMix64 {
        SplitMix64(seed)
    }

    /// The next 64 bits.
    #[inline]
    pub fn next_bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix64(self.0)
    }

    /// The next two numbers, uniform in [0, 1) with 24 bits.
    #[inline]
    pub fn next_pair(&mut self) -> [f32; 2] {
        let bits = self.next_bits();
        [unit(bits as u32), unit((bits >> u32::BITS) as u32)]
    }

    /// The next number, uniform in [0, 1) with 53 bits.
    #[inline]
    pub fn next_unit(&mut self) -> f64 {
        (self.next_bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }
}

/// Point `i` of a sequence that fills the unit square evenly, however many are taken, as fractions of 2^32 (the R2 sequence
/// of Roberts 2018).
#[inline(always)]
pub fn r2_sequence(i: u32) -> [u32; 2] {
    [i.wrapping_mul(0xc13f_a9a9), i.wrapping_mul(0x91e1_0da5)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first numbers of the reference implementation for the seed 1234567.
    #[test]
    fn split_mix_gives_the_published_numbers() {
        let mut random = SplitMix64::new(1_234_567);
        assert_eq!(random.next_bits(), 6_457_827_717_110_365_317);
        assert_eq!(random.next_bits(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn units_stay_below_one() {
        assert_eq!(unit(0), 0.0);
        assert_eq!(unit(1 << 31), 0.5);
        assert!(unit(u32::MAX) < 1.0);
    }
}
