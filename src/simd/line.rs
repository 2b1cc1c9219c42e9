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

/// Makes room for `additional` more lines, on huge pages where the system has them for the asking: a walk through much
/// memory then misses fewer address translations.
pub fn reserve_lines(lines: &mut Vec<Line>, additional: usize) {
    lines.reserve_exact(additional);
    #[cfg(target_os = "linux")]
    {
        // Advice is for whole huge pages that hold nothing yet: what is written already keeps its small pages.
        let room = lines.spare_capacity_mut();
        let first = room.as_mut_ptr().cast::<u8>();
        let skip = first.align_offset(HUGE_PAGE);
        let length = size_of_val(room).saturating_sub(skip) / HUGE_PAGE * HUGE_PAGE;
        if length > 0 {
            // SAFETY: the range lies in memory that the vector owns; the advice changes how it is mapped, not what it holds.
            // Failure (an old kernel, say) is as good as no advice.
            unsafe { libc::madvise(first.wrapping_add(skip).cast(), length, libc::MADV_HUGEPAGE) };
        }
    }
}

/// The size of a huge page on x86-64, and on AArch64 with small pages of 4 KiB.
#[cfg(target_os = "linux")]
const HUGE_PAGE: usize = 2 << 20;

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
