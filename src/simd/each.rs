//! Functions of arrays for loops that are compiled once per CPU level.

/// The same function of each number of an array. Such loops must contain all that they call, and the standard library's
/// `map` is seldom inlined.
#[inline(always)]
#[allow(clippy::needless_range_loop)]
pub fn map_each<T: Copy, U: Copy + Default, const N: usize>(values: [T; N], f: impl Fn(T) -> U) -> [U; N] {
    let mut mapped = [U::default(); N];
    for i in 0..N {
        mapped[i] = f(values[i]);
    }
    mapped
}
