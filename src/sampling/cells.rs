//! A piecewise constant pdf on the unit cube, by grid cells.
//!
//! Cells are sampled by descending a mip pyramid of sums, one axis after another (hierarchical sample warping: Clarberg et al. 2005,
//! "Wavelet Importance Sampling", section 4.1, here in three dimensions), which preserves stratification along each axis.

/// One level of the pyramid, in groups of eight cells that share a cell of the next coarser level.
#[derive(Clone, Debug, PartialEq)]
struct Level {
    /// Number of groups along each axis.
    groups: [usize; 3],
    /// Sums of the cells by group, x fastest.
    sums: Vec<[f32; 8]>,
}

impl Level {
    /// The group of a cell, and the cell's index in the group.
    #[inline]
    fn position(&self, [x, y, z]: [usize; 3]) -> (usize, usize) {
        (self.group([x / 2, y / 2, z / 2]), x % 2 + y % 2 * 2 + z % 2 * 4)
    }

    #[inline]
    fn group(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.groups[1] + y) * self.groups[0] + x
    }

    /// A level of `size` cells with values `of(cell)`.
    fn new(size: [usize; 3], of: impl Fn([usize; 3]) -> f32) -> Level {
        let groups = size.map(|n| n.div_ceil(2));
        let mut level = Level { groups, sums: vec![[0.0; 8]; groups.iter().product()] };
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let (group, index) = level.position([x, y, z]);
                    level.sums[group][index] = of([x, y, z]);
                }
            }
        }
        level
    }
}

/// A piecewise constant pdf on the unit cube, by grid cells.
#[derive(Clone, Debug, PartialEq)]
pub struct CellDistribution {
    size: [usize; 3],
    /// Sum of all weights.
    sum: f64,
    /// From single cells to a single group.
    levels: Vec<Level>,
}

impl CellDistribution {
    /// From one weight per cell, x fastest; negative and non-finite weights count as 0. `None` if no weight is positive.
    pub fn new(size: [usize; 3], weights: &[f32]) -> Option<CellDistribution> {
        let sum: f64 = weights.iter().filter(|w| w.is_finite() && **w > 0.0).map(|w| f64::from(*w)).sum();
        if sum <= 0.0 || weights.len() != size.iter().product::<usize>() {
            return None;
        }
        let probability = |[x, y, z]: [usize; 3]| {
            let weight = weights[(z * size[1] + y) * size[0] + x];
            if weight.is_finite() && weight > 0.0 { (f64::from(weight) / sum) as f32 } else { 0.0 }
        };
        let mut levels = vec![Level::new(size, probability)];
        while let Some(last) = levels.last().filter(|level| level.sums.len() > 1) {
            let coarser = Level::new(last.groups, |cell| last.sums[last.group(cell)].iter().sum());
            levels.push(coarser);
        }
        Some(CellDistribution { size, sum, levels })
    }

    /// The sum of all positive weights.
    pub fn sum(&self) -> f64 {
        self.sum
    }

    /// Cells along each axis.
    pub fn size(&self) -> [usize; 3] {
        self.size
    }

    #[inline]
    pub fn probability(&self, cell: [usize; 3]) -> f32 {
        let (group, index) = self.levels[0].position(cell);
        self.levels[0].sums[group][index]
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|level| size_of_val(&level.sums[..])).sum()
    }

    /// The pdf at a point of the unit cube; 0 outside.
    #[inline]
    pub fn pdf_volume(&self, point: [f32; 3]) -> f32 {
        let mut cell = [0; 3];
        for axis in 0..3 {
            if !(0.0..=1.0).contains(&point[axis]) {
                return 0.0;
            }
            cell[axis] = ((point[axis] * self.size[axis] as f32) as usize).min(self.size[axis] - 1);
        }
        self.probability(cell) * self.size.iter().product::<usize>() as f32
    }

    /// Samples a point of the unit cube by three random numbers in 0..1.
    #[inline]
    pub fn sample(&self, mut u: [f32; 3]) -> [f32; 3] {
        let mut cell = [0; 3];
        for level in self.levels.iter().rev() {
            let of = &level.sums[level.group(cell)];
            let rows = [of[0] + of[1], of[2] + of[3], of[4] + of[5], of[6] + of[7]];
            let z = select_half(&mut u[2], rows[0] + rows[1], rows[2] + rows[3]);
            let y = select_half(&mut u[1], rows[2 * z], rows[2 * z + 1]);
            let first = 4 * z + 2 * y;
            let x = select_half(&mut u[0], of[first], of[first + 1]);
            cell = [2 * cell[0] + x, 2 * cell[1] + y, 2 * cell[2] + z];
        }
        std::array::from_fn(|axis| (cell[axis] as f32 + u[axis]) / self.size[axis] as f32)
    }
}

/// Selects 0 or 1 in proportion to `a` and `b`, and rescales the random number to 0..1 for reuse.
#[inline(always)]
fn select_half(u: &mut f32, a: f32, b: f32) -> usize {
    let probability = if a + b > 0.0 { a / (a + b) } else { 1.0 };
    let is_first = *u < probability;
    *u = if is_first { *u / probability } else { (*u - probability) / (1.0 - probability) };
    *u = u.min(1.0f32.next_down());
    usize::from(!is_first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Random;

    fn uneven(size: [usize; 3]) -> CellDistribution {
        let mut random = Random::new(5);
        let weight = |_| (random.next() * 2.0 - 0.6).max(0.0).powi(3);
        let mut weights: Vec<f32> = (0..size.iter().product()).map(weight).collect();
        weights[0] = 0.5;
        CellDistribution::new(size, &weights).expect("some are positive")
    }

    #[test]
    fn sampling_passes_chi_square() {
        const N: u32 = 200_000;
        for size in [[1, 1, 1], [5, 1, 1], [3, 4, 2], [1, 7, 3]] {
            let (cells, mut random) = (uneven(size), Random::new(9));
            let mut counts = vec![0u32; size.iter().product()];
            for _ in 0..N {
                let p = cells.sample([random.next(), random.next(), random.next()]);
                let at: [usize; 3] = std::array::from_fn(|a| (p[a] * size[a] as f32) as usize);
                counts[(at[2] * size[1] + at[1]) * size[0] + at[0]] += 1;
                assert!(cells.pdf_volume(p) > 0.0, "{p:?}");
            }
            // The chi-square statistic has a mean equal to the degrees of freedom and a variance of twice that.
            let mut statistic = 0.0;
            for (at, &count) in counts.iter().enumerate() {
                let cell = [at % size[0], at / size[0] % size[1], at / (size[0] * size[1])];
                let expected = f64::from(cells.probability(cell)) * f64::from(N);
                let off = f64::from(count) - expected;
                statistic += if expected > 0.0 { off * off / expected } else { f64::from(count) * 1e9 };
            }
            let freedom = counts.len() as f64;
            assert!(statistic < freedom + 5.0 * (2.0 * freedom).sqrt(), "{size:?}: {statistic}");
        }
    }

    #[test]
    fn pdf_integrates_to_one_and_vanishes_outside() {
        let cells = uneven([6, 5, 4]);
        let centers = (0..6 * 5 * 4).map(|i| {
            let at = [i % 6, i / 6 % 5, i / 30].map(|c| c as f32 + 0.5);
            cells.pdf_volume([at[0] / 6.0, at[1] / 5.0, at[2] / 4.0])
        });
        let mean = centers.map(f64::from).sum::<f64>() / 120.0;
        assert!((mean - 1.0).abs() < 1e-5, "{mean}");
        assert_eq!(cells.pdf_volume([0.5, 1.1, 0.5]), 0.0);
        assert_eq!(cells.pdf_volume([-0.1, 0.5, 0.5]), 0.0);
        assert_eq!(CellDistribution::new([2, 1, 1], &[0.0, f32::NAN]), None);
    }
}
