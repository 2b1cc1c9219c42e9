//! Integer hashes and pseudo-random numbers, reproducible on every platform.

/// A 32-bit hash with good avalanche that doesn't map zero to zero (Wellons' lowbias32 of an offset argument).
#[inline(always)]
pub fn hash32(mut x: u32) -> u32 {
    x ^= 0xe6fe_3beb;
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// The finaliser of MurmurHash3 (Appleby), a bijection of 32 bits that maps zero to zero.
#[inline(always)]
pub fn murmur32(x: u32) -> u32 {
    let x = (x ^ (x >> 16)).wrapping_mul(0x85eb_ca6b);
    let x = (x ^ (x >> 13)).wrapping_mul(0xc2b2_ae35);
    x ^ (x >> 16)
}

/// A number in [0, 1) from the upper 24 bits of a hash.
#[inline(always)]
pub fn unit(hash: u32) -> f32 {
    // Through i32, whose conversion is one instruction on every CPU.
    (hash >> 8) as i32 as f32 * (1.0 / 16_777_216.0)
}

/// The finaliser of SplitMix64 (Steele, Lea, Flood 2014), a 64-bit hash that maps zero to zero.
#[inline(always)]
pub fn mix64(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The pseudo-random number generator SplitMix64.
#[derive(Clone, Debug)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> SplitMix64 {
        SplitMix64(seed)
    }

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

/// Point `i` of R2, a low-discrepancy sequence in the unit square (Roberts 2018), in units of 2^-32.
#[inline(always)]
pub fn r2_sequence(i: u32) -> [u32; 2] {
    [i.wrapping_mul(0xc13f_a9a9), i.wrapping_mul(0x91e1_0da5)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of the reference implementation.
    #[test]
    fn split_mix_matches_the_reference_implementation() {
        let mut random = SplitMix64::new(1_234_567);
        assert_eq!(random.next_bits(), 6_457_827_717_110_365_317);
        assert_eq!(random.next_bits(), 3_203_168_211_198_807_973);
    }

    #[test]
    fn unit_is_below_one() {
        assert_eq!(unit(0), 0.0);
        assert_eq!(unit(1 << 31), 0.5);
        assert!(unit(u32::MAX) < 1.0);
    }
}
