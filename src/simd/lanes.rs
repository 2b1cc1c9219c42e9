//! Sixteen floats with fused multiply-adds, for convolutions: the same operations in the same order on all levels, so the
//! same bits.

/// A CPU level's vectors of 16 floats. Lanes are independent; a fused multiply-add rounds once.
pub trait Lanes: Copy {
    /// Sixteen floats.
    type F16: Copy;

    /// Do 24 vectors, and as many as operations on them need, fit in the registers? (Else 6 do.)
    const HAS_MANY_REGISTERS: bool;

    /// A vector from memory.
    fn load(self, from: &[f32; 16]) -> Self::F16;
    /// One number in all lanes.
    fn splat(self, number: f32) -> Self::F16;
    /// `a * b + c`, rounded once.
    fn mul_add(self, a: Self::F16, b: Self::F16, c: Self::F16) -> Self::F16;
    /// Writes what is above 0, and 0 in all other lanes (NaN too).
    fn store_positive(self, v: Self::F16, to: &mut [f32; 16]);
}

/// A loop over [`Lanes`] that is compiled once per CPU level.
pub trait LanesKernel {
    /// What it returns.
    type Output;
    /// The work; mark the implementation and all that its loops call `#[inline(always)]`.
    fn run<L: Lanes>(self, lanes: L) -> Self::Output;
}

/// The scalar level: slow where the CPU has no fused multiply-add, which the standard library computes then.
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
    fn store_positive(self, v: [f32; 16], to: &mut [f32; 16]) {
        *to = v.map(|v| if v > 0.0 { v } else { 0.0 });
    }
}
