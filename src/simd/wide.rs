//! The vector operations that traversal needs, behind one trait: a scalar twin here, x86 registers in [`super::x86`].
//! Every operation gives the same bits on every level: single IEEE operations, no contraction, and `min`/`max` that
//! return the second operand when either is NaN (as the x86 instructions do).

/// A CPU level's vectors of 8 and 4 floats.
pub trait Wide: Copy {
    /// Eight floats.
    type F8: Copy;
    /// Four floats.
    type F4: Copy;

    /// Eight floats from memory.
    fn load8(self, from: &[f32; 8]) -> Self::F8;
    /// Eight times the same float.
    fn splat8(self, x: f32) -> Self::F8;
    /// `a - b`.
    fn sub8(self, a: Self::F8, b: Self::F8) -> Self::F8;
    /// `a * b`.
    fn mul8(self, a: Self::F8, b: Self::F8) -> Self::F8;
    /// `a < b ? a : b`: the second where either is NaN.
    fn min8(self, a: Self::F8, b: Self::F8) -> Self::F8;
    /// `a > b ? a : b`: the second where either is NaN.
    fn max8(self, a: Self::F8, b: Self::F8) -> Self::F8;
    /// One bit for each lane where `a <= b`.
    fn le8(self, a: Self::F8, b: Self::F8) -> u32;
    /// Writes the children of the lanes in `mask` with their distances (at least 0), farthest first. Distances that
    /// agree in all but their last three bits are ordered by lane. What follows the last one is unspecified.
    fn store_sorted(
        self,
        mask: u32,
        distance: Self::F8,
        child: &[u32; 8],
        refs: &mut [u32; 8],
        distances: &mut [f32; 8],
    );
    /// Writes the children of the lanes in `mask` in the order of lanes. What follows the last one is unspecified.
    fn store_masked(self, mask: u32, child: &[u32; 8], refs: &mut [u32; 8]);

    /// Four floats from memory.
    fn load4(self, from: &[f32; 4]) -> Self::F4;
    /// Four times the same float.
    fn splat4(self, x: f32) -> Self::F4;
    /// `a - b`.
    fn sub4(self, a: Self::F4, b: Self::F4) -> Self::F4;
    /// `a * b`.
    fn mul4(self, a: Self::F4, b: Self::F4) -> Self::F4;
    /// One bit for each lane where `a`, `b` and `c` are all at least 0 or all at most 0.
    fn same_sign4(self, a: Self::F4, b: Self::F4, c: Self::F4) -> u32;
}

/// A loop over [`Wide`] vectors that is compiled once per CPU level.
pub trait WideKernel {
    /// What it returns.
    type Output;
    /// The work; mark the implementation and all that its loops call `#[inline(always)]`.
    fn run<W: Wide>(self, wide: W) -> Self::Output;
}

/// The twin of all vector levels, one lane after the other.
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

/// The key that orders children: the distance's bits with the lane in the last three.
#[inline(always)]
fn sort_key(distance: f32, lane: usize) -> u32 {
    (distance.to_bits() & 0x7fff_fff8) | lane as u32
}

impl Wide for ScalarWide {
    type F8 = [f32; 8];
    type F4 = [f32; 4];

    #[inline(always)]
    fn load8(self, from: &[f32; 8]) -> [f32; 8] {
        *from
    }
    #[inline(always)]
    fn splat8(self, x: f32) -> [f32; 8] {
        [x; 8]
    }
    #[inline(always)]
    fn sub8(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul8(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn min8(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max8(self, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        map(a, b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn le8(self, a: [f32; 8], b: [f32; 8]) -> u32 {
        bits::<8>(|i| a[i] <= b[i])
    }

    #[inline(always)]
    fn store_sorted(
        self,
        mask: u32,
        distance: [f32; 8],
        child: &[u32; 8],
        refs: &mut [u32; 8],
        distances: &mut [f32; 8],
    ) {
        let mut keys = [0u32; 8];
        let mut count = 0;
        for lane in (0..8).filter(|lane| mask >> lane & 1 == 1) {
            let key = sort_key(distance[lane], lane);
            let mut place = count;
            while place > 0 && keys[place - 1] < key {
                keys[place] = keys[place - 1];
                place -= 1;
            }
            keys[place] = key;
            count += 1;
        }
        for i in 0..count {
            let lane = (keys[i] & 7) as usize;
            refs[i] = child[lane];
            distances[i] = distance[lane];
        }
    }

    #[inline(always)]
    fn store_masked(self, mask: u32, child: &[u32; 8], refs: &mut [u32; 8]) {
        let mut count = 0;
        for (lane, child) in child.iter().enumerate() {
            refs[count & 7] = *child;
            count += (mask >> lane & 1) as usize;
        }
    }

    #[inline(always)]
    fn load4(self, from: &[f32; 4]) -> [f32; 4] {
        *from
    }
    #[inline(always)]
    fn splat4(self, x: f32) -> [f32; 4] {
        [x; 4]
    }
    #[inline(always)]
    fn sub4(self, a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
        map(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul4(self, a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
        map(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn same_sign4(self, a: [f32; 4], b: [f32; 4], c: [f32; 4]) -> u32 {
        bits::<4>(|i| {
            (a[i] >= 0.0 && b[i] >= 0.0 && c[i] >= 0.0) || (a[i] <= 0.0 && b[i] <= 0.0 && c[i] <= 0.0)
        })
    }
}
