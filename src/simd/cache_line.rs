//! Cache lines, huge pages, prefetching, and lookup tables without bounds checks.

use bytemuck::{Pod, Zeroable};
use std::mem::MaybeUninit;
use std::sync::atomic::{AtomicUsize, Ordering};

/// One cache line. A `Vec<Line>` is aligned to 64 bytes.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Line(pub [u32; 16]);

impl Line {
    pub const ZERO: Line = Line([0; 16]);
}

const _: () = assert!(size_of::<Line>() == 64 && align_of::<Line>() == 64);

/// Reserves capacity for `additional` more elements, on huge pages where the system offers them: random accesses to large
/// lists then cause fewer TLB misses. Growth is amortised, as for [`Vec::reserve`].
pub fn reserve_on_huge_pages<T>(list: &mut Vec<T>, additional: usize) {
    if list.capacity() - list.len() < additional {
        list.reserve(additional);
        prefer_huge_pages(list);
    }
}

/// The spare capacity of a list, handed out in parts by [`append_claims`].
pub struct Claims<'a> {
    spare: &'a mut [MaybeUninit<Line>],
    claimed: &'a AtomicUsize,
    filled: &'a AtomicUsize,
}

/// A claimed part of that capacity.
pub struct Claim<'a> {
    spare: &'a mut [MaybeUninit<Line>],
    filled: &'a AtomicUsize,
}

/// Lets threads append to a list concurrently within its capacity: consecutive claims that any thread may fill. If a claim
/// is not filled, nothing is appended.
pub fn append_claims<R>(lines: &mut Vec<Line>, work: impl FnOnce(Claims) -> R) -> R {
    let before = lines.len();
    let (claimed, filled) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let spare = lines.spare_capacity_mut();
    let result = work(Claims { spare, claimed: &claimed, filled: &filled });
    let (claimed, filled) = (claimed.into_inner(), filled.into_inner());
    if filled == claimed {
        // SAFETY: claims are consecutive parts of the spare capacity, `claimed` lines in total. `fill` consumes a claim and
        // counts it once all of its lines are initialised. No claim outlives the call.
        unsafe { lines.set_len(before + claimed) };
    }
    result
}

impl<'a> Claims<'a> {
    /// Claims the next lines; `None` if they exceed the capacity, and for all further claims.
    pub fn claim(&mut self, count: usize) -> Option<Claim<'a>> {
        let spare = std::mem::take(&mut self.spare);
        let (own, rest) = spare.split_at_mut_checked(count)?;
        self.spare = rest;
        self.claimed.fetch_add(count, Ordering::Relaxed);
        Some(Claim { spare: own, filled: self.filled })
    }
}

impl Claim<'_> {
    /// Copies lines into the claim.
    ///
    /// # Panics
    /// If their number differs from the claim's.
    pub fn fill(self, lines: &[Line]) {
        assert_eq!(self.spare.len(), lines.len());
        for (to, from) in self.spare.iter_mut().zip(lines) {
            to.write(*from);
        }
        self.filled.fetch_add(lines.len(), Ordering::Relaxed);
    }
}

/// Advises the system to back a list's capacity with huge pages, which also reduces page faults on first touch to one per
/// 2 MiB. Contents are unaffected.
pub fn prefer_huge_pages<T>(list: &mut Vec<T>) {
    #[cfg(target_os = "linux")]
    {
        let first = list.as_mut_ptr().cast::<u8>();
        let skip = first.align_offset(HUGE_PAGE);
        let size = list.capacity().saturating_mul(size_of::<T>());
        let length = size.saturating_sub(skip) / HUGE_PAGE * HUGE_PAGE;
        if length > 0 {
            // SAFETY: the range is memory that the vector owns; the advice changes its mapping, not its contents. Failure is
            // ignored (old kernels).
            unsafe { libc::madvise(first.wrapping_add(skip).cast(), length, libc::MADV_HUGEPAGE) };
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = list;
}

/// The size of a huge page on x86-64, and on AArch64 with a page size of 4 KiB.
#[cfg(target_os = "linux")]
const HUGE_PAGE: usize = 2 << 20;

/// Prefetches `N` lines from `index` on into the L1 cache. Any index is allowed.
#[inline(always)]
pub fn prefetch_lines<const N: usize>(lines: &[Line], index: usize) {
    let first = lines.as_ptr().wrapping_add(index);
    for i in 0..N {
        prefetch(first.wrapping_add(i).cast());
    }
}

/// Prefetches an element of a list into the L1 cache. Any index is allowed.
#[inline(always)]
pub fn prefetch_element<T>(values: &[T], index: usize) {
    let first = values.as_ptr().wrapping_add(index).cast::<u8>();
    for offset in (0..size_of::<T>()).step_by(size_of::<Line>()) {
        prefetch(first.wrapping_add(offset));
    }
}

/// Prefetches the cache line at an address into the L1 cache.
#[inline(always)]
fn prefetch(address: *const u8) {
    // SAFETY: a prefetch has no architectural effect and never faults, whatever the address.
    #[cfg(target_arch = "x86_64")]
    unsafe {
        core::arch::x86_64::_mm_prefetch::<{ core::arch::x86_64::_MM_HINT_T0 }>(address.cast());
    }
    // SAFETY: as above. (The intrinsic is not stable yet.)
    #[cfg(target_arch = "aarch64")]
    unsafe {
        core::arch::asm!("prfm pldl1keep, [{0}]", in(reg) address.addr(), options(nomem, nostack, preserves_flags));
    }
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let _ = address;
}

/// A slice whose indices are clamped to the last element instead of bounds-checked, so that loops vectorise.
#[derive(Debug)]
pub struct Table<'a, T> {
    values: &'a [T],
    last: u32,
}

impl<T> Clone for Table<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Table<'_, T> {}

impl<'a, T: Copy> Table<'a, T> {
    /// A view of a slice; only the first 2^32 elements are accessible.
    ///
    /// # Panics
    /// If the list is empty.
    #[inline(always)]
    pub fn new(values: &'a [T]) -> Table<'a, T> {
        assert!(!values.is_empty(), "a table has at least one element");
        Table { values, last: u32::try_from(values.len() - 1).unwrap_or(u32::MAX) }
    }

    /// The element at an index, clamped to the last one.
    #[inline(always)]
    pub fn at(self, index: u32) -> T {
        let index = if index < self.last { index } else { self.last };
        // SAFETY: the slice isn't empty, and `last` is at most the index of its last element.
        unsafe { *self.values.get_unchecked(index as usize) }
    }

    /// Prefetches the element at an index. Any index is allowed.
    #[inline(always)]
    pub fn prefetch(self, index: u32) {
        prefetch_element(self.values, index as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_are_clamped_to_the_last_element() {
        let table = Table::new(&[3, 5, 7]);
        assert_eq!([0, 1, 2, 3, u32::MAX].map(|i| table.at(i)), [3, 5, 7, 7, 7]);
        assert_eq!(Table::new(&[9]).at(4), 9);
    }

    #[test]
    #[should_panic(expected = "at least one element")]
    fn empty_tables_panic() {
        Table::<u8>::new(&[]);
    }
}
