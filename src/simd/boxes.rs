//! Scalar data and kernels of BVH traversal: the slab test of boxes, and lane compaction.

use bytemuck::{Pod, Zeroable};

#[cfg(target_arch = "aarch64")]
use core::arch::aarch64::*;
#[cfg(target_arch = "x86_64")]
use core::arch::x86_64::*;

/// The lanes whose triangle, given by its vertices in sheared space, has no edge functions of opposite signs.
/// (Minimum and maximum propagate NaN here, unlike on x86, so that lanes match the scalar reference.)
#[cfg(target_arch = "aarch64")]
#[inline(always)]
pub(super) fn edge_signs_agree(
    a: (float32x4_t, float32x4_t),
    b: (float32x4_t, float32x4_t),
    c: (float32x4_t, float32x4_t),
) -> uint32x4_t {
    // SAFETY: registers only, and NEON is part of the AArch64 baseline.
    unsafe {
        let u = vsubq_f32(vmulq_f32(a.0, b.1), vmulq_f32(a.1, b.0));
        let v = vsubq_f32(vmulq_f32(b.0, c.1), vmulq_f32(b.1, c.0));
        let w = vsubq_f32(vmulq_f32(c.0, a.1), vmulq_f32(c.1, a.0));
        let least = vminq_f32(vminq_f32(u, v), w);
        let greatest = vmaxq_f32(vmaxq_f32(u, v), w);
        vorrq_u32(vcgezq_f32(least), vclezq_f32(greatest))
    }
}

/// Bounds of eight boxes: min x, max x, min y, max y, min z, max z.
pub type Planes = [[f32; 8]; 6];

/// A ray prepared for the slab test: it intersects plane p of an axis at `p * inverse + offset`, with one rounding where the
/// CPU has fused multiply-adds. `offset` is `-origin / direction`, decreased for the near planes and increased for the far
/// ones by a bound on its own error, which leaves a few roundings relative to the result.
#[derive(Clone, Copy, Debug)]
pub struct BoxRay {
    pub(super) inverse: [f32; 3],
    pub(super) near_offset: [f32; 3],
    pub(super) far_offset: [f32; 3],
    /// Byte offsets of the near planes in [`Planes`]: 64 per axis, plus 32 where the direction is negative. The far planes
    /// are at `near ^ 32`. (The fourth is padding.)
    pub(super) near: [u8; 4],
    /// The world axes of x, y, z in sheared space; a permutation of 0, 1, 2. (The fourth is padding.)
    pub(super) axes: [u8; 4],
}

/// Smaller direction components are replaced by this magnitude, with their sign.
const SMALLEST: f32 = 1.0 / (1u128 << 80) as f32;

/// [`BoxRay::near`] for each combination of signs.
const NEAR: [[u8; 4]; 8] = {
    let mut table = [[0, 64, 128, 0]; 8];
    let mut signs = 0;
    while signs < 8 {
        table[signs][0] += 32 * (signs as u8 & 1);
        table[signs][1] += 32 * (signs as u8 >> 1 & 1);
        table[signs][2] += 32 * (signs as u8 >> 2);
        signs += 1;
    }
    table
};

/// [`BoxRay::axes`] for each dominant axis of the direction.
const AXES: [[u8; 4]; 3] = [[1, 2, 0, 0], [2, 0, 1, 0], [0, 1, 2, 0]];

/// The world axes of x, y, z in sheared space: z is the dominant axis of the direction.
#[inline(always)]
fn axes(direction: [f32; 3]) -> [u8; 4] {
    let [x, y, z] = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
    // Branch-free: a branch would be unpredictable.
    let is_z = usize::from((z >= x) & (z >= y));
    AXES[2 * is_z + (usize::from(y >= x) & (1 - is_z))]
}

/// Axes as indices. Without `map`, which would be compiled for the baseline CPU level.
#[inline(always)]
fn indices(axes: [u8; 4]) -> [usize; 3] {
    [usize::from(axes[0].min(2)), usize::from(axes[1].min(2)), usize::from(axes[2].min(2))]
}

/// A ray in the space sheared along it, for triangle intersection.
#[derive(Clone, Copy, Debug)]
pub struct ShearedLine {
    /// The world axes of x, y, z in sheared space; a permutation of 0, 1, 2.
    pub(super) axes: [usize; 3],
    /// The ray's origin, in that order of axes.
    pub origin: [f32; 3],
    /// Shift of x and y per unit of z.
    pub shear: [f32; 2],
}

impl ShearedLine {
    /// A placeholder in unused slots.
    pub const NONE: ShearedLine = ShearedLine { axes: [0, 1, 2], origin: [0.0; 3], shear: [0.0; 2] };

    /// The world axes of x, y, z in sheared space; a permutation of 0, 1, 2.
    #[inline(always)]
    pub fn axes(&self) -> [usize; 3] {
        self.axes
    }

    /// For a direction whose largest component lies in [1, 2).
    #[inline(always)]
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> ShearedLine {
        let [kx, ky, kz] = indices(axes(direction));
        let inverse = 1.0 / direction[kz];
        ShearedLine {
            axes: [kx, ky, kz],
            origin: [origin[kx], origin[ky], origin[kz]],
            shear: [direction[kx] * inverse, direction[ky] * inverse],
        }
    }
}

impl BoxRay {
    /// A placeholder in unused slots.
    pub const NONE: BoxRay = BoxRay {
        inverse: [1.0; 3],
        near_offset: [0.0; 3],
        far_offset: [0.0; 3],
        near: NEAR[0],
        axes: AXES[2],
    };

    /// For a direction whose largest component lies in [1, 2), and boxes within `reach` of the coordinates' origin.
    #[inline(always)]
    pub fn set(&mut self, origin: [f32; 3], direction: [f32; 3], reach: f32) {
        let max_distance = (origin[0].abs() + origin[1].abs()) + (origin[2].abs() + reach);
        // Four lanes, the last one padding, so that the loop vectorises.
        let (o, d) =
            ([origin[0], origin[1], origin[2], 0.0], [direction[0], direction[1], direction[2], 1.0]);
        let (mut inverse, mut near, mut far) = ([0.0; 4], [0.0; 4], [0.0; 4]);
        for k in 0..4 {
            let length: f32 = f32::abs(d[k]);
            let tiny = length < SMALLEST;
            inverse[k] = 1.0 / (if tiny { SMALLEST } else { length }).copysign(d[k]);
            let offset: f32 = -(o[k] * inverse[k]);
            // Two roundings of the offset are a relative error of 2^-23. A replaced component displaces the ray by less than
            // SMALLEST times the parameter, which is at most `max_distance`.
            let replaced = if tiny { 2.0 * max_distance } else { 0.0 };
            let error = offset.abs() * (1.0 / 4_194_304.0) + replaced;
            near[k] = offset - error;
            far[k] = offset + error;
        }
        self.inverse = [inverse[0], inverse[1], inverse[2]];
        self.near_offset = [near[0], near[1], near[2]];
        self.far_offset = [far[0], far[1], far[2]];
        let sign = |k: usize| (direction[k].to_bits() >> 31) as usize;
        self.near = NEAR[sign(0) | (sign(1) << 1) | (sign(2) << 2)];
        self.axes = axes(direction);
    }

    /// The reciprocal of a component of the direction, clamped for tiny ones.
    #[inline(always)]
    pub fn inverse(&self, axis: usize) -> f32 {
        self.inverse[axis]
    }

    /// The components of a vector in the order of axes of sheared space.
    #[inline(always)]
    pub fn permute(&self, v: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = self.axes();
        [v[x], v[y], v[z]]
    }

    /// The sheared line of the ray with its origin and shear.
    #[inline(always)]
    pub fn line(&self, origin: [f32; 3], shear: [f32; 2]) -> ShearedLine {
        ShearedLine { axes: self.axes(), origin: self.permute(origin), shear }
    }

    /// The world axes of x, y, z in sheared space.
    #[inline(always)]
    pub fn axes(&self) -> [usize; 3] {
        indices(self.axes)
    }
}

/// An entry of a traversal stack: a reference and the distance to its box.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Entry {
    /// Node or leaf.
    pub reference: u32,
    /// The ray's parameter where it enters the box.
    pub distance: f32,
}

/// The indices of the lanes of each mask, in order, one per byte, padded with [`NO_LANE`].
pub static LANES_OF_MASK: [u64; 256] = lanes_of_masks();

/// Padding after the last lane: its low three bits are those of lane 0, and as a byte offset (times four) it is out of range.
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

/// Compacts the lanes of a mask to the front; the rest is 0 (AVX-512) or unspecified (AVX2).
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

/// Applies a function to each element of an array, always inlined: the standard library's `map` is seldom inlined into
/// functions with target features.
#[inline(always)]
#[allow(clippy::needless_range_loop)]
pub fn map_each<T: Copy, U: Copy + Default, const N: usize>(values: [T; N], f: impl Fn(T) -> U) -> [U; N] {
    let mut mapped = [U::default(); N];
    for i in 0..N {
        mapped[i] = f(values[i]);
    }
    mapped
}
