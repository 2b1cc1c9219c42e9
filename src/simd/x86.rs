//! The x86 levels of [`Wide`] and [`Lanes`].

use super::boxes::{BoxRay, Entry, Planes, compress};
use super::wide::{Lanes, WIDEN_UNITS, Wide};
use core::arch::x86_64::*;

/// AVX2 vectors; if `AVX512`, with mask registers, compression and wider vectors of AVX-512. The intrinsics below are sound
/// since values exist only inside functions compiled for the level.
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

/// A stage of a sorting network on four keys: lanes are compared by `$shuffle`, those in `$low` keep the minimum.
macro_rules! stage4 {
    ($x:ident, $shuffle:literal, $low:literal) => {{
        let other = _mm_shuffle_epi32::<$shuffle>($x);
        $x = _mm_blend_epi32::<$low>(_mm_max_epi32($x, other), _mm_min_epi32($x, other));
    }};
}

/// A stage of a sorting network on eight keys.
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

/// The lanes of a packet whose three edge functions, four lanes each, don't have opposite signs.
#[inline(always)]
fn same_sign(not_negative: u32, not_positive: u32) -> u32 {
    // Both tests at once: bits shifted from one half into the other are not used.
    let both = not_negative | (not_positive << 16);
    let all = both & (both >> 4) & (both >> 8);
    (all | (all >> 16)) & 15
}

type Vector = (__m256d, __m256d, __m256d);

/// Four dot products.
///
/// # Safety
/// As for [`X86::new`].
#[inline(always)]
unsafe fn dot(a: Vector, b: Vector) -> __m256d {
    // SAFETY: the caller's level has these instructions, which touch registers only.
    unsafe {
        let xy = _mm256_add_pd(_mm256_mul_pd(a.0, b.0), _mm256_mul_pd(a.1, b.1));
        _mm256_add_pd(xy, _mm256_mul_pd(a.2, b.2))
    }
}

// SAFETY (all blocks): `self` exists, so the CPU has the level. `BoxRay` keeps its plane offsets (`near`, `near ^ 32`:
// below 192, multiples of 32) and axes (below 3) in range. Other loads and stores go through references to arrays of the
// vector's size, with instructions that need no alignment.
impl<const AVX512: bool> Wide for X86<AVX512> {
    type F8 = __m256;

    #[inline(always)]
    fn boxes(self, planes: &Planes, ray: &BoxRay, t_min: f32, t_max: f32) -> (u32, __m256) {
        // SAFETY: see above.
        unsafe {
            let (mut near, mut far) = (_mm256_set1_ps(t_min), _mm256_set1_ps(t_max));
            for axis in 0..3 {
                let inverse = _mm256_set1_ps(ray.inverse[axis]);
                let at = usize::from(ray.near[axis]);
                let near_planes = _mm256_loadu_ps(planes.as_ptr().byte_add(at).cast());
                let far_planes = _mm256_loadu_ps(planes.as_ptr().byte_add(at ^ 32).cast());
                let entry = _mm256_fmadd_ps(near_planes, inverse, _mm256_set1_ps(ray.near_offset[axis]));
                let exit = _mm256_fmadd_ps(far_planes, inverse, _mm256_set1_ps(ray.far_offset[axis]));
                // An overflowed offset gives NaN: then the result is the second operand.
                near = _mm256_max_ps(entry, near);
                far = _mm256_min_ps(exit, far);
            }
            // Compared as integers, which has lower latency: `near` is at least 0, and negative floats are negative integers.
            let from = _mm256_castps_si256(near);
            let to = _mm256_add_epi32(_mm256_castps_si256(far), _mm256_set1_epi32(WIDEN_UNITS));
            let mask = if AVX512 {
                u32::from(_mm256_cmple_epi32_mask(from, to))
            } else {
                !_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(from, to))) as u32 & 255
            };
            (mask, near)
        }
    }

    #[inline(always)]
    fn store_sorted(self, mask: u32, distance: __m256, child: &[u32; 8], to: &mut [Entry; 8]) {
        // SAFETY: see above. `permutevar` uses only the low three bits of a key, which are its lane.
        unsafe {
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let keys = _mm256_or_si256(
                _mm256_and_si256(_mm256_castps_si256(distance), _mm256_set1_epi32(0x7fff_fff8)),
                lanes,
            );
            let count = mask.count_ones() as i32;
            let mut keys = compress::<AVX512>(keys, mask);
            if !AVX512 {
                // Keys are not negative, so -1 sorts last. (AVX-512 fills with 0, which does so too.)
                keys = _mm256_or_si256(keys, _mm256_cmpgt_epi32(lanes, _mm256_set1_epi32(count - 1)));
            }
            let children = _mm256_loadu_si256(child.as_ptr().cast());
            let to: *mut __m128i = to.as_mut_ptr().cast();
            if count <= 4 {
                let order = _mm256_castsi128_si256(sort4(_mm256_castsi256_si128(keys)));
                let refs = _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(children, order));
                let distances = _mm256_permutevar8x32_ps(distance, order);
                let distances = _mm_castps_si128(_mm256_castps256_ps128(distances));
                _mm_storeu_si128(to, _mm_unpacklo_epi32(refs, distances));
                _mm_storeu_si128(to.add(1), _mm_unpackhi_epi32(refs, distances));
            } else {
                let order = sort8(keys);
                let refs = _mm256_permutevar8x32_epi32(children, order);
                let distances = _mm256_castps_si256(_mm256_permutevar8x32_ps(distance, order));
                let (even, odd) =
                    (_mm256_unpacklo_epi32(refs, distances), _mm256_unpackhi_epi32(refs, distances));
                _mm_storeu_si128(to, _mm256_castsi256_si128(even));
                _mm_storeu_si128(to.add(1), _mm256_castsi256_si128(odd));
                _mm_storeu_si128(to.add(2), _mm256_extracti128_si256::<1>(even));
                _mm_storeu_si128(to.add(3), _mm256_extracti128_si256::<1>(odd));
            }
        }
    }

    #[inline(always)]
    fn store_masked(self, mask: u32, child: &[u32; 8], to: &mut [Entry; 8]) {
        // SAFETY: see above.
        unsafe {
            let refs = compress::<AVX512>(_mm256_loadu_si256(child.as_ptr().cast()), mask);
            let to: *mut __m256i = to.as_mut_ptr().cast();
            _mm256_storeu_si256(to, _mm256_cvtepu32_epi64(_mm256_castsi256_si128(refs)));
            _mm256_storeu_si256(to.add(1), _mm256_cvtepu32_epi64(_mm256_extracti128_si256::<1>(refs)));
        }
    }

    #[inline(always)]
    fn candidates(self, rows: &[[f32; 4]; 12], ray: &BoxRay, origin: &[f32; 3], shear: &[f32; 2]) -> u32 {
        // SAFETY: see above: an axis has 16 floats.
        unsafe {
            let rows = rows.as_ptr().cast::<f32>();
            let [kx, ky, kz, _] = ray.axes;
            let (xs, ys, zs) = (
                rows.add(16 * usize::from(kx)),
                rows.add(16 * usize::from(ky)),
                rows.add(16 * usize::from(kz)),
            );
            let ox = *origin.get_unchecked(usize::from(kx));
            let oy = *origin.get_unchecked(usize::from(ky));
            let oz = *origin.get_unchecked(usize::from(kz));
            let [sx, sy] = *shear;
            if AVX512 {
                // All vertices at once. The fourth row of each axis is not a vertex; its results are not used.
                let x = _mm512_sub_ps(_mm512_loadu_ps(xs), _mm512_set1_ps(ox));
                let y = _mm512_sub_ps(_mm512_loadu_ps(ys), _mm512_set1_ps(oy));
                let z = _mm512_sub_ps(_mm512_loadu_ps(zs), _mm512_set1_ps(oz));
                let x = _mm512_sub_ps(x, _mm512_mul_ps(_mm512_set1_ps(sx), z));
                let y = _mm512_sub_ps(y, _mm512_mul_ps(_mm512_set1_ps(sy), z));
                let next_x = _mm512_shuffle_f32x4::<0b11_00_10_01>(x, x);
                let next_y = _mm512_shuffle_f32x4::<0b11_00_10_01>(y, y);
                let edges = _mm512_sub_ps(_mm512_mul_ps(x, next_y), _mm512_mul_ps(y, next_x));
                let zero = _mm512_setzero_ps();
                same_sign(
                    u32::from(_mm512_cmp_ps_mask::<_CMP_GE_OQ>(edges, zero)),
                    u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(edges, zero)),
                )
            } else {
                let x = _mm256_sub_ps(_mm256_loadu_ps(xs), _mm256_set1_ps(ox));
                let y = _mm256_sub_ps(_mm256_loadu_ps(ys), _mm256_set1_ps(oy));
                let z = _mm256_sub_ps(_mm256_loadu_ps(zs), _mm256_set1_ps(oz));
                let x = _mm256_sub_ps(x, _mm256_mul_ps(_mm256_set1_ps(sx), z));
                let y = _mm256_sub_ps(y, _mm256_mul_ps(_mm256_set1_ps(sy), z));
                let (ax, bx) = (_mm256_castps256_ps128(x), _mm256_extractf128_ps::<1>(x));
                let (ay, by) = (_mm256_castps256_ps128(y), _mm256_extractf128_ps::<1>(y));
                let cx = _mm_sub_ps(_mm_loadu_ps(xs.add(8)), _mm_set1_ps(ox));
                let cy = _mm_sub_ps(_mm_loadu_ps(ys.add(8)), _mm_set1_ps(oy));
                let cz = _mm_sub_ps(_mm_loadu_ps(zs.add(8)), _mm_set1_ps(oz));
                let cx = _mm_sub_ps(cx, _mm_mul_ps(_mm_set1_ps(sx), cz));
                let cy = _mm_sub_ps(cy, _mm_mul_ps(_mm_set1_ps(sy), cz));
                let u = _mm_sub_ps(_mm_mul_ps(ax, by), _mm_mul_ps(ay, bx));
                let v = _mm_sub_ps(_mm_mul_ps(bx, cy), _mm_mul_ps(by, cx));
                let w = _mm_sub_ps(_mm_mul_ps(cx, ay), _mm_mul_ps(cy, ax));
                let zero = _mm_setzero_ps();
                let positive = _mm_cmpge_ps(_mm_min_ps(_mm_min_ps(u, v), w), zero);
                let negative = _mm_cmple_ps(_mm_max_ps(_mm_max_ps(u, v), w), zero);
                _mm_movemask_ps(_mm_or_ps(positive, negative)) as u32
            }
        }
    }

    #[inline(always)]
    fn equal(self, row: &[f32; 4], number: u32) -> u32 {
        // SAFETY: see above.
        unsafe {
            let (row, number) = (_mm_loadu_si128(row.as_ptr().cast()), _mm_set1_epi32(number as i32));
            if AVX512 {
                u32::from(_mm_cmpeq_epi32_mask(row, number))
            } else {
                _mm_movemask_ps(_mm_castsi128_ps(_mm_cmpeq_epi32(row, number))) as u32
            }
        }
    }

    #[inline(always)]
    fn plane_parameters(
        self,
        rows: &[[f32; 4]; 12],
        origin: &[f32; 3],
        direction: &[f32; 3],
        lanes: u32,
    ) -> [f32; 4] {
        // SAFETY: see above.
        unsafe {
            macro_rules! row {
                ($k:expr) => {
                    _mm256_cvtps_pd(_mm_loadu_ps(rows[$k].as_ptr()))
                };
            }
            macro_rules! cross {
                ($ex:ident, $fx:ident, $ey:ident, $fy:ident) => {
                    _mm256_sub_pd(_mm256_mul_pd($ex, $fy), _mm256_mul_pd($ey, $fx))
                };
            }
            let (ax, ay, az) = (row!(0), row!(4), row!(8));
            let (ex, ey, ez) =
                (_mm256_sub_pd(row!(1), ax), _mm256_sub_pd(row!(5), ay), _mm256_sub_pd(row!(9), az));
            let (fx, fy, fz) =
                (_mm256_sub_pd(row!(2), ax), _mm256_sub_pd(row!(6), ay), _mm256_sub_pd(row!(10), az));
            let (nx, ny, nz) = (cross!(ey, fy, ez, fz), cross!(ez, fz, ex, fx), cross!(ex, fx, ey, fy));
            // Broadcast before the conversion: from memory that is one instruction.
            macro_rules! splat {
                ($x:expr) => {
                    _mm256_cvtps_pd(_mm_set1_ps($x))
                };
            }
            let n = (nx, ny, nz);
            let denominator = dot(n, (splat!(direction[0]), splat!(direction[1]), splat!(direction[2])));
            let px = _mm256_sub_pd(ax, splat!(origin[0]));
            let py = _mm256_sub_pd(ay, splat!(origin[1]));
            let pz = _mm256_sub_pd(az, splat!(origin[2]));
            let numerator = dot(n, (px, py, pz));
            let behind = _mm256_movemask_pd(_mm256_xor_pd(numerator, denominator)) as u32;
            if lanes & !behind == 0 {
                return [f32::NAN; 4];
            }
            let parallel = _mm256_cmp_pd::<_CMP_EQ_OQ>(denominator, _mm256_setzero_pd());
            // All ones are a NaN.
            let t = _mm256_cvtpd_ps(_mm256_or_pd(_mm256_div_pd(numerator, denominator), parallel));
            let mut out = [0.0; 4];
            _mm_storeu_ps(out.as_mut_ptr(), t);
            out
        }
    }
}

/// AVX2 and FMA: two registers per vector. Values exist only inside functions compiled for the level.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

/// AVX-512 F: one register per vector. Values exist only inside functions compiled for the level.
#[derive(Clone, Copy, Debug)]
pub struct Avx512(());

impl Avx2 {
    /// # Safety
    /// The CPU must have AVX2 and FMA.
    #[inline(always)]
    pub(super) unsafe fn new() -> Avx2 {
        Avx2(())
    }
}

impl Avx512 {
    /// # Safety
    /// The CPU must have AVX-512 F.
    #[inline(always)]
    pub(super) unsafe fn new() -> Avx512 {
        Avx512(())
    }
}

// SAFETY (both implementations): `self` exists, so the CPU has the level; loads and stores go through references to
// arrays of the vector's size, with instructions that need no alignment.
impl Lanes for Avx2 {
    type F16 = (__m256, __m256);

    const HAS_MANY_REGISTERS: bool = false;

    #[inline(always)]
    fn load(self, from: &[f32; 16]) -> Self::F16 {
        // SAFETY: see above.
        unsafe { (_mm256_loadu_ps(from.as_ptr()), _mm256_loadu_ps(from.as_ptr().add(8))) }
    }

    #[inline(always)]
    fn splat(self, number: f32) -> Self::F16 {
        // SAFETY: see above.
        let lanes = unsafe { _mm256_set1_ps(number) };
        (lanes, lanes)
    }

    #[inline(always)]
    fn mul_add(self, a: Self::F16, b: Self::F16, c: Self::F16) -> Self::F16 {
        // SAFETY: see above.
        unsafe { (_mm256_fmadd_ps(a.0, b.0, c.0), _mm256_fmadd_ps(a.1, b.1, c.1)) }
    }

    #[inline(always)]
    fn add(self, a: Self::F16, b: Self::F16) -> Self::F16 {
        // SAFETY: see above.
        unsafe { (_mm256_add_ps(a.0, b.0), _mm256_add_ps(a.1, b.1)) }
    }

    #[inline(always)]
    fn sub(self, a: Self::F16, b: Self::F16) -> Self::F16 {
        // SAFETY: see above.
        unsafe { (_mm256_sub_ps(a.0, b.0), _mm256_sub_ps(a.1, b.1)) }
    }

    #[inline(always)]
    fn store(self, v: Self::F16, to: &mut [f32; 16]) {
        // SAFETY: see above.
        unsafe {
            _mm256_storeu_ps(to.as_mut_ptr(), v.0);
            _mm256_storeu_ps(to.as_mut_ptr().add(8), v.1);
        }
    }

    #[inline(always)]
    fn store_positive(self, v: Self::F16, to: &mut [f32; 16]) {
        // SAFETY: see above. Where one of two is NaN, the second operand is the result.
        unsafe {
            let zero = _mm256_setzero_ps();
            _mm256_storeu_ps(to.as_mut_ptr(), _mm256_max_ps(v.0, zero));
            _mm256_storeu_ps(to.as_mut_ptr().add(8), _mm256_max_ps(v.1, zero));
        }
    }
}

impl Lanes for Avx512 {
    type F16 = __m512;

    const HAS_MANY_REGISTERS: bool = true;

    #[inline(always)]
    fn load(self, from: &[f32; 16]) -> __m512 {
        // SAFETY: see above.
        unsafe { _mm512_loadu_ps(from.as_ptr()) }
    }

    #[inline(always)]
    fn splat(self, number: f32) -> __m512 {
        // SAFETY: see above.
        unsafe { _mm512_set1_ps(number) }
    }

    #[inline(always)]
    fn mul_add(self, a: __m512, b: __m512, c: __m512) -> __m512 {
        // SAFETY: see above.
        unsafe { _mm512_fmadd_ps(a, b, c) }
    }

    #[inline(always)]
    fn add(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: see above.
        unsafe { _mm512_add_ps(a, b) }
    }

    #[inline(always)]
    fn sub(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: see above.
        unsafe { _mm512_sub_ps(a, b) }
    }

    #[inline(always)]
    fn store(self, v: __m512, to: &mut [f32; 16]) {
        // SAFETY: see above.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), v) }
    }

    #[inline(always)]
    fn store_positive(self, v: __m512, to: &mut [f32; 16]) {
        // SAFETY: see above. Where one of two is NaN, the second operand is the result.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), _mm512_max_ps(v, _mm512_setzero_ps())) }
    }
}
