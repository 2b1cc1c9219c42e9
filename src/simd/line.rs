//! Memory in cache lines, and the hint that one will be needed soon.

use bytemuck::{Pod, Zeroable};

/// One cache line. A `Vec<Line>` is aligned to 64 bytes.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Line(pub [u32; 16]);

impl Line {
    /// A line of zeros.
    pub const ZERO: Line = Line([0; 16]);
}

const _: () = assert!(size_of::<Line>() == 64 && align_of::<Line>() == 64);

/// Asks the CPU to bring `N` lines from `index` on into its first cache. Any index is allowed: it is only a hint.
#[inline(always)]
pub fn prefetch_lines<const N: usize>(lines: &[Line], index: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        let first = lines.as_ptr().wrapping_add(index);
        for i in 0..N {
            // SAFETY: a prefetch reads nothing that the program can see and never faults, whatever the address.
            unsafe {
                core::arch::x86_64::_mm_prefetch::<{ core::arch::x86_64::_MM_HINT_T0 }>(
                    first.wrapping_add(i).cast(),
                );
            }
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (lines, index);
}
