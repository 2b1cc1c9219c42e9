//! Sixteen triangles against the line of a ray, one lane a triangle.

#[cfg(target_arch = "aarch64")]
use super::compress::LANES_OF_MASK;
#[cfg(target_arch = "x86_64")]
use super::compress::compress;
use super::slab::ShearedLine;
#[cfg(target_arch = "aarch64")]
use core::arch::aarch64::*;
#[cfg(target_arch = "x86_64")]
use core::arch::x86_64::*;

/// Sixteen triangles. Unused lanes are NaN, which no line meets.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct TriangleBlock {
    /// For axis k: vertices 0, 1, 2 in rows 3k to 3k + 2.
    pub rows: [[f32; 16]; 9],
    /// Primitive ids.
    pub ids: [u32; 16],
}

/// What a block is asked for: the triangles that a line meets.
#[derive(Clone, Copy, Debug)]
pub struct BlockQuery<'a> {
    /// The line.
    pub line: &'a ShearedLine,
    /// Triangles with this id are left out.
    pub ignored: u32,
    /// Number of the first lane.
    pub first: u32,
}

impl TriangleBlock {
    /// A block without triangles.
    pub const EMPTY: TriangleBlock = TriangleBlock { rows: [[f32::NAN; 16]; 9], ids: [u32::MAX; 16] };
}

/// [`super::Wide::list_candidates`], one lane after the other.
#[inline(always)]
pub(super) fn list(block: &TriangleBlock, query: &BlockQuery, to: &mut [u32; 16]) -> usize {
    let BlockQuery { line, ignored, first } = *query;
    let ShearedLine { axes: [kx, ky, kz], origin: [ox, oy, oz], shear: [sx, sy] } = *line;
    let vertex = |k: usize, lane: usize| {
        let z = block.rows[3 * kz + k][lane] - oz;
        ((block.rows[3 * kx + k][lane] - ox) - sx * z, (block.rows[3 * ky + k][lane] - oy) - sy * z)
    };
    let edge = |p: (f32, f32), q: (f32, f32)| p.0 * q.1 - p.1 * q.0;
    let mut count = 0;
    for lane in 0..16 {
        let (a, b, c) = (vertex(0, lane), vertex(1, lane), vertex(2, lane));
        let (u, v, w) = (edge(a, b), edge(b, c), edge(c, a));
        let is_met = ((u >= 0.0) & (v >= 0.0) & (w >= 0.0)) | ((u <= 0.0) & (v <= 0.0) & (w <= 0.0));
        to[count & 15] = first + lane as u32;
        count += usize::from(is_met & (block.ids[lane] != ignored));
    }
    count
}

/// The smallest and the largest edge function of the triangles from lane `$lane` on.
#[cfg(target_arch = "x86_64")]
macro_rules! edge_functions {
    ($block:ident, $line:ident, $lane:expr, $load:ident, $set:ident, $sub:ident, $mul:ident, $min:ident, $max:ident) => {{
        let rows = $block.rows.as_ptr().cast::<f32>().add($lane);
        let (axes, o, s) = ($line.axes, $line.origin, $line.shear);
        let (xs, ys, zs) = (rows.add(48 * axes[0]), rows.add(48 * axes[1]), rows.add(48 * axes[2]));
        let (ox, oy, oz, sx, sy) = ($set(o[0]), $set(o[1]), $set(o[2]), $set(s[0]), $set(s[1]));
        macro_rules! vertex {
            ($k:expr) => {{
                let z = $sub($load(zs.add(16 * $k)), oz);
                let x = $sub($sub($load(xs.add(16 * $k)), ox), $mul(sx, z));
                let y = $sub($sub($load(ys.add(16 * $k)), oy), $mul(sy, z));
                (x, y)
            }};
        }
        let (a, b, c) = (vertex!(0), vertex!(1), vertex!(2));
        let u = $sub($mul(a.0, b.1), $mul(a.1, b.0));
        let v = $sub($mul(b.0, c.1), $mul(b.1, c.0));
        let w = $sub($mul(c.0, a.1), $mul(c.1, a.0));
        ($min($min(u, v), w), $max($max(u, v), w))
    }};
}

/// The same with AVX-512.
///
/// # Safety
/// The CPU must have it, and `line.axes` must be below 3.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(super) unsafe fn list16(block: &TriangleBlock, query: &BlockQuery, to: &mut [u32; 16]) -> usize {
    let BlockQuery { line, ignored, first } = *query;
    // SAFETY: the caller's level has these instructions. An axis has 48 floats; other loads and stores are of whole arrays.
    unsafe {
        let (least, greatest) = edge_functions!(
            block,
            line,
            0,
            _mm512_loadu_ps,
            _mm512_set1_ps,
            _mm512_sub_ps,
            _mm512_mul_ps,
            _mm512_min_ps,
            _mm512_max_ps
        );
        let zero = _mm512_setzero_ps();
        let met =
            _mm512_cmp_ps_mask::<_CMP_GE_OQ>(least, zero) | _mm512_cmp_ps_mask::<_CMP_LE_OQ>(greatest, zero);
        let ids = _mm512_loadu_si512(block.ids.as_ptr().cast());
        let mask = _mm512_mask_cmpneq_epi32_mask(met, ids, _mm512_set1_epi32(ignored as i32));
        let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
        let numbers = _mm512_add_epi32(lanes, _mm512_set1_epi32(first as i32));
        _mm512_storeu_si512(to.as_mut_ptr().cast(), _mm512_maskz_compress_epi32(mask, numbers));
        mask.count_ones() as usize
    }
}

/// The same with AVX2.
///
/// # Safety
/// The CPU must have it, and `line.axes` must be below 3.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(super) unsafe fn list8_twice(block: &TriangleBlock, query: &BlockQuery, to: &mut [u32; 16]) -> usize {
    let BlockQuery { line, ignored, first } = *query;
    let mut count = 0;
    for half in [0, 8] {
        // SAFETY: as above; at most 8 numbers come before the last 8.
        unsafe {
            let (least, greatest) = edge_functions!(
                block,
                line,
                half,
                _mm256_loadu_ps,
                _mm256_set1_ps,
                _mm256_sub_ps,
                _mm256_mul_ps,
                _mm256_min_ps,
                _mm256_max_ps
            );
            let zero = _mm256_setzero_ps();
            let met = _mm256_or_ps(
                _mm256_cmp_ps::<_CMP_GE_OQ>(least, zero),
                _mm256_cmp_ps::<_CMP_LE_OQ>(greatest, zero),
            );
            let ids = _mm256_loadu_si256(block.ids.as_ptr().add(half).cast());
            let same = _mm256_cmpeq_epi32(ids, _mm256_set1_epi32(ignored as i32));
            let mask = _mm256_movemask_ps(_mm256_andnot_ps(_mm256_castsi256_ps(same), met)) as u32;
            let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
            let numbers = _mm256_add_epi32(lanes, _mm256_set1_epi32((first + half as u32) as i32));
            _mm256_storeu_si256(to.as_mut_ptr().add(count).cast(), compress::<false>(numbers, mask));
            count += mask.count_ones() as usize;
        }
    }
    count
}

/// The lanes of triangles, by their vertices in the sheared space, whose edge functions are all at least 0 or all at most 0.
/// (The least of numbers with a NaN among them is NaN here, which it is not on x86: this is what the scalar twin finds.)
#[cfg(target_arch = "aarch64")]
#[inline(always)]
pub(super) fn meets(
    a: (float32x4_t, float32x4_t),
    b: (float32x4_t, float32x4_t),
    c: (float32x4_t, float32x4_t),
) -> uint32x4_t {
    // SAFETY: registers only, and every program for AArch64 is compiled with NEON.
    unsafe {
        let u = vsubq_f32(vmulq_f32(a.0, b.1), vmulq_f32(a.1, b.0));
        let v = vsubq_f32(vmulq_f32(b.0, c.1), vmulq_f32(b.1, c.0));
        let w = vsubq_f32(vmulq_f32(c.0, a.1), vmulq_f32(c.1, a.0));
        let least = vminq_f32(vminq_f32(u, v), w);
        let greatest = vmaxq_f32(vmaxq_f32(u, v), w);
        vorrq_u32(vcgezq_f32(least), vclezq_f32(greatest))
    }
}

/// The same with NEON.
///
/// # Safety
/// `line.axes` must be below 3.
#[cfg(target_arch = "aarch64")]
#[inline(always)]
pub(super) unsafe fn list4_four_times(
    block: &TriangleBlock,
    query: &BlockQuery,
    to: &mut [u32; 16],
) -> usize {
    let BlockQuery { line, ignored, first } = *query;
    let ([kx, ky, kz], [ox, oy, oz], [sx, sy]) = (line.axes, line.origin, line.shear);
    // SAFETY: every program for AArch64 is compiled with NEON. An axis has 48 floats; at most 8 numbers come before the last 8.
    unsafe {
        let rows = block.rows.as_ptr().cast::<f32>();
        let mut met = [vdupq_n_u32(0); 4];
        for (quarter, met) in met.iter_mut().enumerate() {
            let load = |axis: usize, k: usize| vld1q_f32(rows.add(48 * axis + 16 * k + 4 * quarter));
            let vertex = |k: usize| {
                let z = vsubq_f32(load(kz, k), vdupq_n_f32(oz));
                let x = vsubq_f32(vsubq_f32(load(kx, k), vdupq_n_f32(ox)), vmulq_n_f32(z, sx));
                let y = vsubq_f32(vsubq_f32(load(ky, k), vdupq_n_f32(oy)), vmulq_n_f32(z, sy));
                (x, y)
            };
            let ids = vld1q_u32(block.ids.as_ptr().add(4 * quarter));
            let left_out = vceqq_u32(ids, vdupq_n_u32(ignored));
            *met = vbicq_u32(meets(vertex(0), vertex(1), vertex(2)), left_out);
        }
        let mask = mask_of_16(met);
        let mut count = 0;
        for half in [0, 8] {
            let mask = mask >> half & 255;
            let lanes = vmovl_u8(vcreate_u8(LANES_OF_MASK[mask as usize]));
            let from = vdupq_n_u32(first + half);
            let to = to.as_mut_ptr().add(count);
            vst1q_u32(to, vaddw_u16(from, vget_low_u16(lanes)));
            vst1q_u32(to.add(4), vaddw_high_u16(from, lanes));
            count += mask.count_ones() as usize;
        }
        count
    }
}

/// The lanes whose bits are all set, of lanes whose bits are all alike.
#[cfg(target_arch = "aarch64")]
#[inline(always)]
fn mask_of_16(lanes: [uint32x4_t; 4]) -> u32 {
    // SAFETY: registers only, and every program for AArch64 is compiled with NEON.
    unsafe {
        let narrow =
            |a: uint32x4_t, b: uint32x4_t| vuzp1q_u16(vreinterpretq_u16_u32(a), vreinterpretq_u16_u32(b));
        let (low, high) = (narrow(lanes[0], lanes[1]), narrow(lanes[2], lanes[3]));
        let bytes = vuzp1q_u8(vreinterpretq_u8_u16(low), vreinterpretq_u8_u16(high));
        let bit = vreinterpretq_u8_u64(vdupq_n_u64(0x8040_2010_0804_0201));
        // Neighbours are added until each half is a byte.
        let bits = vandq_u8(bytes, bit);
        let bits = vpaddq_u8(bits, bits);
        let bits = vpaddq_u8(bits, bits);
        let bits = vpaddq_u8(bits, bits);
        u32::from(vgetq_lane_u16::<0>(vreinterpretq_u16_u8(bits)))
    }
}
