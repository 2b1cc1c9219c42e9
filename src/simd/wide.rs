//! The vector operations of BVH traversal as a trait, with a scalar reference implementation; those for x86 and NEON are in
//! files of their own. Levels may differ in false positives of conservative tests, never in hits, which are decided by code
//! that rounds identically on all levels.
//!
//! Also vectors of sixteen floats with fused multiply-adds, for convolutions, bit-identical on all levels.

use super::boxes::{BoxRay, Entry, Planes, map_each};

/// The factor by which box tests widen the exit distance (Ize 2013, "Robust BVH Ray Traversal"): 32 roundings. The box test
/// itself has at most four on either side; the shear of the triangle test displaces vertices by at most five more.
pub const WIDEN: f32 = 1.0 + 1.0 / 524_288.0;

/// A bound on [`WIDEN`] in ulps, for floats compared as integers.
pub(super) const WIDEN_UNITS: i32 = 32;

/// A CPU level's vectors of 8 floats, and the steps of traversal on them.
pub trait Wide: Copy {
    /// Eight floats.
    type F8: Copy;

    /// The boxes that a ray may intersect between `t_min` and `t_max`, and the entry distances (at least `t_min`).
    /// Conservative if intersections with the contents have an error of at most 16 roundings; levels may differ in false
    /// positives within that error. Boxes with inverted infinite planes are missed.
    fn boxes(self, planes: &Planes, ray: &BoxRay, t_min: f32, t_max: f32) -> (u32, Self::F8);
    /// Stores the children of the lanes in `mask` with their distances (at least 0), farthest first. Distances that differ in
    /// the low three bits only are ordered by lane. Entries after the last are unspecified.
    fn store_sorted(self, mask: u32, distance: Self::F8, child: &[u32; 8], to: &mut [Entry; 8]);
    /// Stores the children of the lanes in `mask` in lane order. Distances, and entries after the last, are unspecified.
    fn store_masked(self, mask: u32, child: &[u32; 8], to: &mut [Entry; 8]);
    /// The triangles whose edge functions along the ray don't have opposite signs: see `accel::triangle`. `rows` are those of
    /// a packet: for each axis, vertices 0, 1, 2 of four triangles and other data.
    fn candidates(self, rows: &[[f32; 4]; 12], ray: &BoxRay, origin: &[f32; 3], shear: &[f32; 2]) -> u32;
    /// The lanes with these bits.
    fn equal(self, row: &[f32; 4], number: u32) -> u32;
    /// The ray's parameters at the planes of four triangles, `n . (a - o) / n . d` in f64, rounded once, bit-identical on all
    /// levels; NaN where the ray is parallel to the plane, and where all of `lanes` are behind, to save the division.
    fn plane_parameters(
        self,
        rows: &[[f32; 4]; 12],
        origin: &[f32; 3],
        direction: &[f32; 3],
        lanes: u32,
    ) -> [f32; 4];
}

/// A loop over [`Wide`] vectors that is compiled once per CPU level.
pub trait WideKernel {
    /// The result.
    type Output;
    /// Runs the loop. Implementations, and all functions that it calls, must be `#[inline(always)]`.
    fn run<W: Wide>(self, wide: W) -> Self::Output;
}

/// The scalar reference implementation, lane by lane.
#[derive(Clone, Copy, Debug)]
pub struct ScalarWide;

#[inline(always)]
fn map<const N: usize>(a: [f32; N], b: [f32; N], f: impl Fn(f32, f32) -> f32) -> [f32; N] {
    std::array::from_fn(|i| f(a[i], b[i]))
}

#[inline(always)]
fn bits<const N: usize>(test: impl Fn(usize) -> bool) -> u32 {
    (0..N).fold(0, |mask, i| mask | (u32::from(test(i)) << i))
}

/// The sort key of a child: the bits of its distance with the lane in the low three.
#[inline(always)]
fn sort_key(distance: f32, lane: usize) -> u32 {
    (distance.to_bits() & 0x7fff_fff8) | lane as u32
}

impl Wide for ScalarWide {
    type F8 = [f32; 8];

    #[inline(always)]
    fn boxes(self, planes: &Planes, ray: &BoxRay, t_min: f32, t_max: f32) -> (u32, [f32; 8]) {
        let (mut near, mut far) = ([t_min; 8], [t_max; 8]);
        for axis in 0..3 {
            let at = usize::from(ray.near[axis] / 32).min(5);
            let entry = map_each(planes[at], |p| p * ray.inverse[axis] + ray.near_offset[axis]);
            let exit = map_each(planes[at ^ 1], |p| p * ray.inverse[axis] + ray.far_offset[axis]);
            near = map(entry, near, |a, b| if a > b { a } else { b });
            far = map(exit, far, |a, b| if a < b { a } else { b });
        }
        (bits::<8>(|i| near[i] <= far[i] * WIDEN), near)
    }

    #[inline(always)]
    fn store_sorted(self, mask: u32, distance: [f32; 8], child: &[u32; 8], to: &mut [Entry; 8]) {
        let mut keys = [0u32; 8];
        let mut count = 0;
        for lane in (0..8).filter(|lane| mask >> lane & 1 == 1) {
            let key = sort_key(distance[lane], lane);
            let mut position = count;
            while position > 0 && keys[position - 1] < key {
                keys[position] = keys[position - 1];
                position -= 1;
            }
            keys[position] = key;
            count += 1;
        }
        for (key, to) in keys.iter().zip(to).take(count) {
            let lane = (key & 7) as usize;
            *to = Entry { reference: child[lane], distance: distance[lane] };
        }
    }

    #[inline(always)]
    fn store_masked(self, mask: u32, child: &[u32; 8], to: &mut [Entry; 8]) {
        let mut count = 0;
        for (lane, child) in child.iter().enumerate() {
            to[count & 7].reference = *child;
            count += (mask >> lane & 1) as usize;
        }
    }

    #[inline(always)]
    fn candidates(self, rows: &[[f32; 4]; 12], ray: &BoxRay, origin: &[f32; 3], shear: &[f32; 2]) -> u32 {
        let [kx, ky, kz] = ray.axes();
        let [shear_x, shear_y] = *shear;
        let o = ray.permute(*origin);
        let vertex = |k: usize| {
            let z = map_each(rows[4 * kz + k], |z| z - o[2]);
            let shear = |row: [f32; 4], o: f32, s: f32| map(row, z, |p, z| (p - o) - s * z);
            (shear(rows[4 * kx + k], o[0], shear_x), shear(rows[4 * ky + k], o[1], shear_y))
        };
        let (a, b, c) = (vertex(0), vertex(1), vertex(2));
        let edge = |p: ([f32; 4], [f32; 4]), q: ([f32; 4], [f32; 4])| {
            map(map(p.0, q.1, |x, y| x * y), map(p.1, q.0, |y, x| y * x), |l, r| l - r)
        };
        let (u, v, w) = (edge(a, b), edge(b, c), edge(c, a));
        bits::<4>(|i| {
            ((u[i] >= 0.0) & (v[i] >= 0.0) & (w[i] >= 0.0)) | ((u[i] <= 0.0) & (v[i] <= 0.0) & (w[i] <= 0.0))
        })
    }

    #[inline(always)]
    fn equal(self, row: &[f32; 4], number: u32) -> u32 {
        bits::<4>(|i| row[i].to_bits() == number)
    }

    #[inline(always)]
    fn plane_parameters(
        self,
        rows: &[[f32; 4]; 12],
        origin: &[f32; 3],
        direction: &[f32; 3],
        lanes: u32,
    ) -> [f32; 4] {
        std::array::from_fn(|lane| {
            let at = |axis: usize, vertex: usize| f64::from(rows[4 * axis + vertex][lane]);
            let edge = |axis: usize, vertex: usize| at(axis, vertex) - at(axis, 0);
            let [e, f] = [1, 2].map(|k| [edge(0, k), edge(1, k), edge(2, k)]);
            let n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
            let [o, d] = [*origin, *direction].map(|v| v.map(f64::from));
            let denominator = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
            let numerator = n[0] * (at(0, 0) - o[0]) + n[1] * (at(1, 0) - o[1]) + n[2] * (at(2, 0) - o[2]);
            let is_requested = lanes >> lane & 1 == 1;
            if is_requested & (denominator != 0.0) { (numerator / denominator) as f32 } else { f32::NAN }
        })
    }
}

/// A CPU level's vectors of 16 floats. Lanes are independent; a fused multiply-add rounds once.
pub trait Lanes: Copy {
    /// Sixteen floats.
    type F16: Copy;

    /// Are there registers for 24 vectors and the operands of operations on them (otherwise for 6)?
    const HAS_MANY_REGISTERS: bool;

    /// Loads a vector.
    fn load(self, from: &[f32; 16]) -> Self::F16;
    /// Broadcasts a value to all lanes.
    fn splat(self, number: f32) -> Self::F16;
    /// `a * b + c`, rounded once.
    fn mul_add(self, a: Self::F16, b: Self::F16, c: Self::F16) -> Self::F16;
    fn add(self, a: Self::F16, b: Self::F16) -> Self::F16;
    fn sub(self, a: Self::F16, b: Self::F16) -> Self::F16;
    /// Stores a vector.
    fn store(self, v: Self::F16, to: &mut [f32; 16]);
    /// Stores the positive lanes, and 0 for all others (NaN included).
    fn store_positive(self, v: Self::F16, to: &mut [f32; 16]);
}

/// A loop over [`Lanes`] that is compiled once per CPU level.
pub trait LanesKernel {
    /// The result.
    type Output;
    /// Runs the loop. Implementations, and all functions that it calls, must be `#[inline(always)]`.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// The scalar level: slow without hardware fused multiply-adds, which the standard library then emulates.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScalarLanes;

impl Lanes for ScalarLanes {
    type F16 = [f32; 16];

    const HAS_MANY_REGISTERS: bool = false;

    #[inline(always)]
    fn load(self, from: &[f32; 16]) -> [f32; 16] {
        *from
    }

    #[inline(always)]
    fn splat(self, number: f32) -> [f32; 16] {
        [number; 16]
    }

    #[inline(always)]
    fn mul_add(self, a: [f32; 16], b: [f32; 16], c: [f32; 16]) -> [f32; 16] {
        std::array::from_fn(|i| a[i].mul_add(b[i], c[i]))
    }

    #[inline(always)]
    fn add(self, a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        std::array::from_fn(|i| a[i] + b[i])
    }

    #[inline(always)]
    fn sub(self, a: [f32; 16], b: [f32; 16]) -> [f32; 16] {
        std::array::from_fn(|i| a[i] - b[i])
    }

    #[inline(always)]
    fn store(self, v: [f32; 16], to: &mut [f32; 16]) {
        *to = v;
    }

    #[inline(always)]
    fn store_positive(self, v: [f32; 16], to: &mut [f32; 16]) {
        *to = v.map(|v| if v > 0.0 { v } else { 0.0 });
    }
}
