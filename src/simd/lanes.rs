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

#[cfg(target_arch = "x86_64")]
pub(super) mod x86 {
    use super::Lanes;
    use core::arch::x86_64::*;

    /// AVX2 and FMA: two registers a vector. A value exists only inside a function compiled for the level.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx2(());

    /// AVX-512 F: a register a vector. A value exists only inside a function compiled for the level.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx512(());

    impl Avx2 {
        /// # Safety
        /// The CPU must have AVX2 and FMA.
        #[inline(always)]
        pub unsafe fn new() -> Avx2 {
            Avx2(())
        }
    }

    impl Avx512 {
        /// # Safety
        /// The CPU must have AVX-512 F.
        #[inline(always)]
        pub unsafe fn new() -> Avx512 {
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
        fn store_positive(self, v: __m512, to: &mut [f32; 16]) {
            // SAFETY: see above. Where one of two is NaN, the second operand is the result.
            unsafe { _mm512_storeu_ps(to.as_mut_ptr(), _mm512_max_ps(v, _mm512_setzero_ps())) }
        }
    }
}

#[cfg(target_arch = "aarch64")]
pub(super) mod neon {
    use super::Lanes;
    use core::arch::aarch64::*;

    /// NEON, which every AArch64 program is compiled with: four registers a vector.
    #[derive(Clone, Copy, Debug)]
    pub struct NeonLanes(());

    impl NeonLanes {
        /// # Safety
        /// The CPU must have NEON.
        #[inline(always)]
        pub unsafe fn new() -> NeonLanes {
            NeonLanes(())
        }
    }

    // SAFETY: `self` exists, so the CPU has NEON; loads and stores go through references to arrays of the vector's size.
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
}
