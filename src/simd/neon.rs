//! The NEON level of [`Wide`] and [`Lanes`]: eight lanes are two registers of four. Results don't depend on masked lanes, and
//! of [`Wide`] only the box test has fused multiply-adds.

use super::boxes::{self, BoxRay, Entry, LANES_OF_MASK, Planes};
use super::wide::{Lanes, WIDEN_UNITS, Wide};
use core::arch::aarch64::*;

/// NEON vectors. The intrinsics below are sound since NEON is part of the AArch64 baseline.
#[derive(Clone, Copy, Debug)]
pub struct Neon(());

impl Neon {
    /// # Safety
    /// The CPU must have NEON, and memory must be little-endian.
    #[inline(always)]
    pub(super) unsafe fn new() -> Self {
        Neon(())
    }
}

/// Eight lanes.
type Pair<T> = (T, T);

/// A vector of four constants.
#[inline(always)]
fn four(numbers: [u32; 4]) -> uint32x4_t {
    // SAFETY: the array has the vector's size.
    unsafe { vld1q_u32(numbers.as_ptr()) }
}

/// The bit mask of a comparison result, whose lanes are all ones or all zeros.
#[inline(always)]
fn mask_of(lanes: uint32x4_t) -> u32 {
    // SAFETY: registers only.
    unsafe { vaddvq_u32(vandq_u32(lanes, four([1, 2, 4, 8]))) }
}

/// The mask of eight lanes.
#[inline(always)]
fn mask_of_pair(lanes: Pair<uint32x4_t>) -> u32 {
    // SAFETY: registers only.
    unsafe {
        let low = vandq_u32(lanes.0, four([1, 2, 4, 8]));
        let high = vandq_u32(lanes.1, four([16, 32, 64, 128]));
        vaddvq_u32(vorrq_u32(low, high))
    }
}

/// Permutes the bytes of eight lanes by byte indices; 0 where an index is out of range.
#[inline(always)]
fn permute_bytes(lanes: Pair<uint32x4_t>, indices: uint8x16_t) -> uint32x4_t {
    // SAFETY: registers only.
    unsafe {
        let bytes = uint8x16x2_t(vreinterpretq_u8_u32(lanes.0), vreinterpretq_u8_u32(lanes.1));
        vreinterpretq_u32_u8(vqtbl2q_u8(bytes, indices))
    }
}

/// The byte indices that compact the lanes of a mask to the front; out of range after the last.
#[inline(always)]
fn compaction(mask: u32) -> Pair<uint8x16_t> {
    // SAFETY: registers only; the table has an entry for each 8-bit mask.
    unsafe {
        let lanes = vcreate_u8(LANES_OF_MASK[(mask & 255) as usize]);
        let lanes = vcombine_u8(lanes, lanes);
        let twice = vzip1q_u8(lanes, lanes);
        let byte = vreinterpretq_u8_u32(vdupq_n_u32(0x0302_0100));
        // Four times the lane, with the byte's index in the low two bits.
        let low = vsliq_n_u8::<2>(byte, vzip1q_u8(twice, twice));
        (low, vsliq_n_u8::<2>(byte, vzip2q_u8(twice, twice)))
    }
}

/// Four keys, largest first (Batcher 1968, odd-even merge: 5 comparisons in 3 stages).
#[inline(always)]
fn sort4(x: uint32x4_t) -> uint32x4_t {
    // SAFETY: registers only.
    unsafe {
        let other = vrev64q_u32(x);
        let x = vtrn1q_u32(vmaxq_u32(x, other), vminq_u32(x, other));
        let other = vextq_u32::<2>(x, x);
        let x = low_halves(vmaxq_u32(x, other), vminq_u32(x, other));
        // The middle two.
        let other = vzip1q_u32(x, vextq_u32::<2>(x, x));
        let (larger, smaller) = (vmaxq_u32(x, other), vminq_u32(x, other));
        vcombine_u32(vget_low_u32(larger), vget_high_u32(smaller))
    }
}

#[inline(always)]
fn low_halves(a: uint32x4_t, b: uint32x4_t) -> uint32x4_t {
    // SAFETY: registers only.
    unsafe { vreinterpretq_u32_u64(vzip1q_u64(vreinterpretq_u64_u32(a), vreinterpretq_u64_u32(b))) }
}

#[inline(always)]
fn high_halves(a: uint32x4_t, b: uint32x4_t) -> uint32x4_t {
    // SAFETY: registers only.
    unsafe { vreinterpretq_u32_u64(vzip2q_u64(vreinterpretq_u64_u32(a), vreinterpretq_u64_u32(b))) }
}

/// Eight keys, largest first: two sorted halves, merged as a bitonic sequence (ibid.).
#[inline(always)]
fn sort8(keys: Pair<uint32x4_t>) -> Pair<uint32x4_t> {
    let (a, b) = (sort4(keys.0), sort4(keys.1));
    // SAFETY: registers only.
    unsafe {
        let rising = vrev64q_u32(vextq_u32::<2>(b, b));
        let (a, b) = (vmaxq_u32(a, rising), vminq_u32(a, rising));
        let (first, second) = (low_halves(a, b), high_halves(a, b));
        let (a, b) = (vmaxq_u32(first, second), vminq_u32(first, second));
        let (first, second) = (vtrn1q_u32(a, b), vtrn2q_u32(a, b));
        let (a, b) = (vmaxq_u32(first, second), vminq_u32(first, second));
        (vzip1q_u32(a, b), vzip2q_u32(a, b))
    }
}

/// Stores the entries of the lanes in the low three bits of four keys.
///
/// # Safety
/// `to` must have space for four entries.
#[inline(always)]
unsafe fn store(keys: uint32x4_t, children: Pair<uint32x4_t>, distances: Pair<uint32x4_t>, to: *mut Entry) {
    // SAFETY: the caller provides the space.
    unsafe {
        let lanes = vandq_u32(keys, vdupq_n_u32(7));
        let indices = vmlaq_u32(vdupq_n_u32(0x0302_0100), lanes, vdupq_n_u32(0x0404_0404));
        let indices = vreinterpretq_u8_u32(indices);
        let (child, distance) = (permute_bytes(children, indices), permute_bytes(distances, indices));
        vst2q_u32(to.cast(), uint32x4x2_t(child, distance));
    }
}

/// Loads eight lanes.
#[inline(always)]
fn load_pair(numbers: &[u32; 8]) -> Pair<uint32x4_t> {
    // SAFETY: the array has eight.
    unsafe { (vld1q_u32(numbers.as_ptr()), vld1q_u32(numbers.as_ptr().add(4))) }
}

/// Four lanes in double precision.
#[derive(Clone, Copy)]
struct Doubles(float64x2_t, float64x2_t);

impl Doubles {
    #[inline(always)]
    fn of(row: &[f32; 4]) -> Doubles {
        // SAFETY: the row has the vector's size.
        unsafe {
            let row = vld1q_f32(row.as_ptr());
            Doubles(vcvt_f64_f32(vget_low_f32(row)), vcvt_high_f64_f32(row))
        }
    }

    #[inline(always)]
    fn splat(x: f32) -> Doubles {
        // SAFETY: registers only.
        unsafe {
            let x = vdupq_n_f64(f64::from(x));
            Doubles(x, x)
        }
    }

    #[inline(always)]
    fn sub(self, b: Doubles) -> Doubles {
        // SAFETY: registers only.
        unsafe { Doubles(vsubq_f64(self.0, b.0), vsubq_f64(self.1, b.1)) }
    }

    #[inline(always)]
    fn mul(self, b: Doubles) -> Doubles {
        // SAFETY: registers only.
        unsafe { Doubles(vmulq_f64(self.0, b.0), vmulq_f64(self.1, b.1)) }
    }

    /// A dot product.
    #[inline(always)]
    fn dot(a: [Doubles; 3], b: [Doubles; 3]) -> Doubles {
        let [x, y, z] = [a[0].mul(b[0]), a[1].mul(b[1]), a[2].mul(b[2])];
        // SAFETY: registers only.
        unsafe { Doubles(vaddq_f64(vaddq_f64(x.0, y.0), z.0), vaddq_f64(vaddq_f64(x.1, y.1), z.1)) }
    }

    /// The lanes with equal sign bits.
    #[inline(always)]
    fn same_signs(self, b: Doubles) -> u32 {
        // SAFETY: registers only.
        unsafe {
            let x = veorq_u64(vreinterpretq_u64_f64(self.0), vreinterpretq_u64_f64(b.0));
            let y = veorq_u64(vreinterpretq_u64_f64(self.1), vreinterpretq_u64_f64(b.1));
            let upper = vuzp2q_u32(vreinterpretq_u32_u64(x), vreinterpretq_u32_u64(y));
            mask_of(vcgezq_s32(vreinterpretq_s32_u32(upper)))
        }
    }

    /// The quotients in single precision; NaN where the divisor is 0.
    #[inline(always)]
    fn quotients(self, b: Doubles) -> [f32; 4] {
        let mut out = [0.0; 4];
        // SAFETY: the array has the vector's size.
        unsafe {
            let quotient = |numerator: float64x2_t, denominator: float64x2_t| {
                // All ones are a NaN.
                let bits = vreinterpretq_u64_f64(vdivq_f64(numerator, denominator));
                vreinterpretq_f64_u64(vorrq_u64(bits, vceqzq_f64(denominator)))
            };
            let low = vcvt_f32_f64(quotient(self.0, b.0));
            vst1q_f32(out.as_mut_ptr(), vcvt_high_f32_f64(low, quotient(self.1, b.1)));
        }
        out
    }
}

// SAFETY (all blocks): `BoxRay` keeps its plane offsets (`near`, `near ^ 32`: below 192, multiples of 32) and axes (below 3) in
// range. Other loads and stores go through references to arrays of the vector's size, with instructions that need no alignment.
impl Wide for Neon {
    type F8 = Pair<float32x4_t>;

    #[inline(always)]
    fn boxes(self, planes: &Planes, ray: &BoxRay, t_min: f32, t_max: f32) -> (u32, Self::F8) {
        // SAFETY: see above.
        unsafe {
            let (mut near, mut far) = ([vdupq_n_f32(t_min); 2], [vdupq_n_f32(t_max); 2]);
            for axis in 0..3 {
                let at = usize::from(ray.near[axis]);
                let near_planes: *const f32 = planes.as_ptr().byte_add(at).cast();
                let far_planes: *const f32 = planes.as_ptr().byte_add(at ^ 32).cast();
                let near_offset = vdupq_n_f32(ray.near_offset[axis]);
                let far_offset = vdupq_n_f32(ray.far_offset[axis]);
                for half in 0..2 {
                    let (entry, exit) =
                        (vld1q_f32(near_planes.add(4 * half)), vld1q_f32(far_planes.add(4 * half)));
                    let entry = vfmaq_n_f32(near_offset, entry, ray.inverse[axis]);
                    let exit = vfmaq_n_f32(far_offset, exit, ray.inverse[axis]);
                    // An overflowed offset gives NaN: then the result is the other operand.
                    near[half] = vmaxnmq_f32(near[half], entry);
                    far[half] = vminnmq_f32(far[half], exit);
                }
            }
            // Compared as integers, which has lower latency: `near` is at least 0, and negative floats are negative integers.
            let is_hit = |near: float32x4_t, far: float32x4_t| {
                let to = vaddq_s32(vreinterpretq_s32_f32(far), vdupq_n_s32(WIDEN_UNITS));
                vcleq_s32(vreinterpretq_s32_f32(near), to)
            };
            let mask = mask_of_pair((is_hit(near[0], far[0]), is_hit(near[1], far[1])));
            (mask, (near[0], near[1]))
        }
    }

    #[inline(always)]
    fn store_sorted(self, mask: u32, distance: Self::F8, child: &[u32; 8], to: &mut [Entry; 8]) {
        // SAFETY: see above.
        unsafe {
            let children = load_pair(child);
            let distances = (vreinterpretq_u32_f32(distance.0), vreinterpretq_u32_f32(distance.1));
            let lane_bits = vdupq_n_u32(0x8000_0007);
            let keys = (
                vbslq_u32(lane_bits, four([0, 1, 2, 3]), distances.0),
                vbslq_u32(lane_bits, four([4, 5, 6, 7]), distances.1),
            );
            // Masked lanes become 0, which sorts last. (Keys are unique otherwise.)
            if mask.count_ones() <= 4 {
                let keys = sort4(permute_bytes(keys, compaction(mask).0));
                store(keys, children, distances, to.as_mut_ptr());
            } else {
                let all = vdupq_n_u32(mask);
                let low = vandq_u32(keys.0, vtstq_u32(all, four([1, 2, 4, 8])));
                let high = vandq_u32(keys.1, vtstq_u32(all, four([16, 32, 64, 128])));
                let keys = sort8((low, high));
                store(keys.0, children, distances, to.as_mut_ptr());
                store(keys.1, children, distances, to.as_mut_ptr().add(4));
            }
        }
    }

    #[inline(always)]
    fn store_masked(self, mask: u32, child: &[u32; 8], to: &mut [Entry; 8]) {
        let children = load_pair(child);
        let (low, high) = compaction(mask);
        let (low, high) = (permute_bytes(children, low), permute_bytes(children, high));
        let to: *mut u32 = to.as_mut_ptr().cast();
        // SAFETY: see above.
        unsafe {
            vst2q_u32(to, uint32x4x2_t(low, low));
            vst2q_u32(to.add(8), uint32x4x2_t(high, high));
        }
    }

    #[inline(always)]
    fn candidates(self, rows: &[[f32; 4]; 12], ray: &BoxRay, origin: &[f32; 3], shear: &[f32; 2]) -> u32 {
        // SAFETY: see above: an axis has 16 floats.
        unsafe {
            let rows = rows.as_ptr().cast::<f32>();
            let [kx, ky, kz, _] = ray.axes;
            let axis =
                |k: u8| (rows.add(16 * usize::from(k)), vdupq_n_f32(*origin.get_unchecked(usize::from(k))));
            let ((xs, ox), (ys, oy), (zs, oz)) = (axis(kx), axis(ky), axis(kz));
            let [sx, sy] = *shear;
            let vertex = |k: usize| {
                let z = vsubq_f32(vld1q_f32(zs.add(4 * k)), oz);
                let x = vsubq_f32(vsubq_f32(vld1q_f32(xs.add(4 * k)), ox), vmulq_n_f32(z, sx));
                let y = vsubq_f32(vsubq_f32(vld1q_f32(ys.add(4 * k)), oy), vmulq_n_f32(z, sy));
                (x, y)
            };
            mask_of(boxes::edge_signs_agree(vertex(0), vertex(1), vertex(2)))
        }
    }

    #[inline(always)]
    fn equal(self, row: &[f32; 4], number: u32) -> u32 {
        // SAFETY: see above.
        unsafe { mask_of(vceqq_u32(vld1q_u32(row.as_ptr().cast()), vdupq_n_u32(number))) }
    }

    #[inline(always)]
    fn plane_parameters(
        self,
        rows: &[[f32; 4]; 12],
        origin: &[f32; 3],
        direction: &[f32; 3],
        lanes: u32,
    ) -> [f32; 4] {
        let row = |k: usize| Doubles::of(&rows[k]);
        let a = [row(0), row(4), row(8)];
        let e = [row(1).sub(a[0]), row(5).sub(a[1]), row(9).sub(a[2])];
        let f = [row(2).sub(a[0]), row(6).sub(a[1]), row(10).sub(a[2])];
        let cross = |i: usize, j: usize| e[i].mul(f[j]).sub(e[j].mul(f[i]));
        let n = [cross(1, 2), cross(2, 0), cross(0, 1)];
        let splat = |k: usize| Doubles::splat(direction[k]);
        let denominator = Doubles::dot(n, [splat(0), splat(1), splat(2)]);
        let from = |k: usize| a[k].sub(Doubles::splat(origin[k]));
        let numerator = Doubles::dot(n, [from(0), from(1), from(2)]);
        // (Lanes above the fourth request the quotients unconditionally.)
        if lanes & (numerator.same_signs(denominator) | !15) == 0 {
            return [f32::NAN; 4];
        }
        numerator.quotients(denominator)
    }
}

/// NEON: four registers per vector.
#[derive(Clone, Copy, Debug)]
pub struct NeonLanes(());

impl NeonLanes {
    /// # Safety
    /// The CPU must have NEON.
    #[inline(always)]
    pub(super) unsafe fn new() -> NeonLanes {
        NeonLanes(())
    }
}

// SAFETY: NEON is part of the AArch64 baseline; loads and stores go through references to arrays of the vector's size.
impl Lanes for NeonLanes {
    type F16 = [float32x4_t; 4];

    const HAS_MANY_REGISTERS: bool = false;

    #[inline(always)]
    fn load(self, from: &[f32; 16]) -> Self::F16 {
        // SAFETY: see above.
        std::array::from_fn(|k| unsafe { vld1q_f32(from.as_ptr().add(4 * k)) })
    }

    #[inline(always)]
    fn splat(self, number: f32) -> Self::F16 {
        // SAFETY: registers only.
        [unsafe { vdupq_n_f32(number) }; 4]
    }

    #[inline(always)]
    fn mul_add(self, a: Self::F16, b: Self::F16, c: Self::F16) -> Self::F16 {
        // SAFETY: registers only.
        std::array::from_fn(|k| unsafe { vfmaq_f32(c[k], a[k], b[k]) })
    }

    #[inline(always)]
    fn add(self, a: Self::F16, b: Self::F16) -> Self::F16 {
        // SAFETY: registers only.
        std::array::from_fn(|k| unsafe { vaddq_f32(a[k], b[k]) })
    }

    #[inline(always)]
    fn sub(self, a: Self::F16, b: Self::F16) -> Self::F16 {
        // SAFETY: registers only.
        std::array::from_fn(|k| unsafe { vsubq_f32(a[k], b[k]) })
    }

    #[inline(always)]
    fn store(self, v: Self::F16, to: &mut [f32; 16]) {
        // SAFETY: see above.
        (0..4).for_each(|k| unsafe { vst1q_f32(to.as_mut_ptr().add(4 * k), v[k]) });
    }

    #[inline(always)]
    fn store_positive(self, v: Self::F16, to: &mut [f32; 16]) {
        // SAFETY: see above.
        unsafe {
            let zero = vdupq_n_f32(0.0);
            for k in 0..4 {
                let positive = vbslq_f32(vcgtq_f32(v[k], zero), v[k], zero);
                vst1q_f32(to.as_mut_ptr().add(4 * k), positive);
            }
        }
    }
}
