//! The x86 levels of [`Wide`]: the same registers and instructions, but for AVX-512's compression.

use super::wide::Wide;
use core::arch::x86_64::*;

/// Vectors of AVX2, with AVX-512's masks where `AVX512`. A value exists only inside a function compiled for the level:
/// that is why the intrinsics below are sound.
#[derive(Clone, Copy, Debug)]
pub struct X86<const AVX512: bool>(());

impl<const AVX512: bool> X86<AVX512> {
    /// # Safety
    /// The CPU must have AVX2 and FMA (`AVX512`: AVX-512 F, VL, DQ, BW and CD too).
    #[inline(always)]
    pub(super) unsafe fn new() -> Self {
        X86(())
    }
}

/// For each mask of lanes the numbers of its lanes, in order, one a byte.
static LANES_OF_MASK: [u64; 256] = lanes_of_masks();

const fn lanes_of_masks() -> [u64; 256] {
    let mut table = [0u64; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut lane, mut count) = (0u32, 0u32);
        while lane < 8 {
            if mask >> lane & 1 == 1 {
                table[mask] |= (lane as u64) << (8 * count);
                count += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
}

/// Moves the lanes of a mask to the front; the others become `fill` (AVX-512) or anything (AVX2: see `keep_first`).
///
/// # Safety
/// As for [`X86::new`].
#[inline(always)]
unsafe fn compress<const AVX512: bool>(x: __m256i, mask: u32) -> __m256i {
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

/// One stage of a sorting network on four keys: lanes are exchanged by `$shuffle`, those in `$low` keep the smaller.
macro_rules! stage4 {
    ($x:ident, $shuffle:literal, $low:literal) => {{
        let other = _mm_shuffle_epi32::<$shuffle>($x);
        $x = _mm_blend_epi32::<$low>(_mm_max_epi32($x, other), _mm_min_epi32($x, other));
    }};
}

/// The same on eight keys.
macro_rules! stage8 {
    ($x:ident, [$($from:literal),*], $low:literal) => {{
        let other = _mm256_permutevar8x32_epi32($x, _mm256_setr_epi32($($from),*));
        $x = _mm256_blend_epi32::<$low>(_mm256_max_epi32($x, other), _mm256_min_epi32($x, other));
    }};
}

/// Four keys, largest first (Batcher 1968, odd-even merge: 5 comparisons in 3 stages).
///
/// # Safety
/// As for [`X86::new`].
#[inline(always)]
unsafe fn sort4(keys: __m128i) -> __m128i {
    let mut x = keys;
    // SAFETY: the caller's level has these instructions, which touch registers only.
    unsafe {
        stage4!(x, 0b10_11_00_01, 0b1010);
        stage4!(x, 0b01_00_11_10, 0b1100);
        stage4!(x, 0b11_01_10_00, 0b0100);
    }
    x
}

/// Eight keys, largest first (ibid.: 19 comparisons in 6 stages).
///
/// # Safety
/// As for [`X86::new`].
#[inline(always)]
unsafe fn sort8(keys: __m256i) -> __m256i {
    let mut x = keys;
    // SAFETY: the caller's level has these instructions, which touch registers only.
    unsafe {
        stage8!(x, [1, 0, 3, 2, 5, 4, 7, 6], 0b1010_1010);
        stage8!(x, [2, 3, 0, 1, 6, 7, 4, 5], 0b1100_1100);
        stage8!(x, [0, 2, 1, 3, 4, 6, 5, 7], 0b0100_0100);
        stage8!(x, [4, 5, 6, 7, 0, 1, 2, 3], 0b1111_0000);
        stage8!(x, [0, 1, 4, 5, 2, 3, 6, 7], 0b0011_0000);
        stage8!(x, [0, 2, 1, 4, 3, 6, 5, 7], 0b0101_0100);
    }
    x
}

impl<const AVX512: bool> Wide for X86<AVX512> {
    type F8 = __m256;
    type F4 = __m128;

    // SAFETY (all blocks): `self` exists, so the CPU has the level; loads and stores go through references to arrays of
    // the vector's size, with instructions that need no alignment.
    #[inline(always)]
    fn load8(self, from: &[f32; 8]) -> __m256 {
        // SAFETY: see above.
        unsafe { _mm256_loadu_ps(from.as_ptr()) }
    }
    #[inline(always)]
    fn splat8(self, x: f32) -> __m256 {
        // SAFETY: see above.
        unsafe { _mm256_set1_ps(x) }
    }
    #[inline(always)]
    fn sub8(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: see above.
        unsafe { _mm256_sub_ps(a, b) }
    }
    #[inline(always)]
    fn mul8(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: see above.
        unsafe { _mm256_mul_ps(a, b) }
    }
    #[inline(always)]
    fn min8(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: see above.
        unsafe { _mm256_min_ps(a, b) }
    }
    #[inline(always)]
    fn max8(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: see above.
        unsafe { _mm256_max_ps(a, b) }
    }
    #[inline(always)]
    fn le8(self, a: __m256, b: __m256) -> u32 {
        // SAFETY: see above.
        unsafe {
            if AVX512 {
                u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(a, b))
            } else {
                _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32
            }
        }
    }

    #[inline(always)]
    fn store_sorted(
        self,
        mask: u32,
        distance: __m256,
        child: &[u32; 8],
        refs: &mut [u32; 8],
        distances: &mut [f32; 8],
    ) {
        // SAFETY: see above. `permutevar` uses the last three bits of a key only, which are its lane.
        unsafe {
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let keys = _mm256_or_si256(
                _mm256_and_si256(_mm256_castps_si256(distance), _mm256_set1_epi32(0x7fff_fff8)),
                lanes,
            );
            let count = mask.count_ones() as i32;
            // Keys are not negative, so -1 sorts behind them.
            let unused = _mm256_cmpgt_epi32(lanes, _mm256_set1_epi32(count - 1));
            let keys = _mm256_or_si256(compress::<AVX512>(keys, mask), unused);
            let children = _mm256_loadu_si256(child.as_ptr().cast());
            if count <= 4 {
                let order = _mm256_castsi128_si256(sort4(_mm256_castsi256_si128(keys)));
                let sorted = _mm256_permutevar8x32_epi32(children, order);
                _mm_storeu_si128(refs.as_mut_ptr().cast(), _mm256_castsi256_si128(sorted));
                let sorted = _mm256_permutevar8x32_ps(distance, order);
                _mm_storeu_ps(distances.as_mut_ptr(), _mm256_castps256_ps128(sorted));
            } else {
                let order = sort8(keys);
                _mm256_storeu_si256(refs.as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(children, order));
                _mm256_storeu_ps(distances.as_mut_ptr(), _mm256_permutevar8x32_ps(distance, order));
            }
        }
    }

    #[inline(always)]
    fn store_masked(self, mask: u32, child: &[u32; 8], refs: &mut [u32; 8]) {
        // SAFETY: see above.
        unsafe {
            let children = _mm256_loadu_si256(child.as_ptr().cast());
            _mm256_storeu_si256(refs.as_mut_ptr().cast(), compress::<AVX512>(children, mask));
        }
    }

    #[inline(always)]
    fn load4(self, from: &[f32; 4]) -> __m128 {
        // SAFETY: see above.
        unsafe { _mm_loadu_ps(from.as_ptr()) }
    }
    #[inline(always)]
    fn splat4(self, x: f32) -> __m128 {
        // SAFETY: see above.
        unsafe { _mm_set1_ps(x) }
    }
    #[inline(always)]
    fn sub4(self, a: __m128, b: __m128) -> __m128 {
        // SAFETY: see above.
        unsafe { _mm_sub_ps(a, b) }
    }
    #[inline(always)]
    fn mul4(self, a: __m128, b: __m128) -> __m128 {
        // SAFETY: see above.
        unsafe { _mm_mul_ps(a, b) }
    }
    #[inline(always)]
    fn same_sign4(self, a: __m128, b: __m128, c: __m128) -> u32 {
        // SAFETY: see above.
        unsafe {
            let zero = _mm_setzero_ps();
            let positive =
                _mm_and_ps(_mm_and_ps(_mm_cmpge_ps(a, zero), _mm_cmpge_ps(b, zero)), _mm_cmpge_ps(c, zero));
            let negative =
                _mm_and_ps(_mm_and_ps(_mm_cmple_ps(a, zero), _mm_cmple_ps(b, zero)), _mm_cmple_ps(c, zero));
            _mm_movemask_ps(_mm_or_ps(positive, negative)) as u32
        }
    }
}
