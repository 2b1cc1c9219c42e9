//! Tables that loops look numbers up in.

use super::line::prefetch_element;

/// A list without a bounds check at each lookup, which would keep loops from being vectorised: an index beyond the end
/// means the last element.
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
    /// A view of a list of at least one element; of very long ones the first 2^32 can be looked up.
    ///
    /// # Panics
    /// If the list is empty.
    #[inline(always)]
    pub fn new(values: &'a [T]) -> Table<'a, T> {
        assert!(!values.is_empty(), "a table has at least one element");
        Table { values, last: u32::try_from(values.len() - 1).unwrap_or(u32::MAX) }
    }

    /// The element at an index, or the last one.
    #[inline(always)]
    pub fn at(self, index: u32) -> T {
        let index = if index < self.last { index } else { self.last };
        // SAFETY: `last` is at most the index of the list's last element, and there is one.
        unsafe { *self.values.get_unchecked(index as usize) }
    }

    /// Asks the CPU to bring the element at an index into its caches. Any index is allowed: it is only a hint.
    #[inline(always)]
    pub fn prefetch(self, index: u32) {
        prefetch_element(self.values, index as usize);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_element_stands_for_all_beyond() {
        let table = Table::new(&[3, 5, 7]);
        assert_eq!([0, 1, 2, 3, u32::MAX].map(|i| table.at(i)), [3, 5, 7, 7, 7]);
        assert_eq!(Table::new(&[9]).at(4), 9);
    }

    #[test]
    #[should_panic(expected = "at least one element")]
    fn there_must_be_a_last_element() {
        Table::<u8>::new(&[]);
    }
}
