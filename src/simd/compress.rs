//! Lanes moved to the front.

#[cfg(target_arch = "x86_64")]
use core::arch::x86_64::*;

/// For each mask of lanes the numbers of its lanes, in order, one a byte; then [`NO_LANE`].
pub static LANES_OF_MASK: [u64; 256] = lanes_of_masks();

/// Stands behind the last lane: its last three bits are those of lane 0, and four times it is beyond the bytes of eight lanes.
const NO_LANE: u64 = 32;

const fn lanes_of_masks() -> [u64; 256] {
    let mut table = [0x0101_0101_0101_0101 * NO_LANE; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0u32, 0u32);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                table[mask] ^= (lane as u64 ^ NO_LANE) << (8 * count);
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
}

/// Moves the lanes of a mask to the front; the others become `fill` (AVX-512) or anything (AVX2).
///
/// # Safety
/// The CPU must have AVX2 (`AVX512`: AVX-512 VL too).
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub unsafe fn compress<const AVX512: bool>(x: __m256i, mask: u32) -> __m256i {
    // SAFETY: the caller's level has these instructions; the table has an entry for each 8-bit mask.
    unsafe {
        if AVX512 {
            _mm256_maskz_compress_epi32(mask as u8, x)
        } else {
            let order = _mm_cvtsi64_si128(LANES_OF_MASK[(mask & 255) as usize] as i64);
            _mm256_permutevar8x32_epi32(x, _mm256_cvtepu8_epi32(order))
        }
    }
}
