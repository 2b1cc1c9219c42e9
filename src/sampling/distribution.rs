//! Tabulated distributions: discrete ones by alias tables, 2D ones with bilinearly interpolated densities.

use crate::simd::Table;

/// One entry of an [`AliasTable`].
#[derive(Clone, Copy, Debug)]
struct AliasEntry {
    /// Probability of keeping this index.
    threshold: f32,
    /// The alternative index.
    alias: u32,
    /// Probability of this index.
    pdf_discrete: f32,
}

/// A sampled index with a remapped random number.
#[derive(Clone, Copy, Debug)]
pub struct DiscreteSample {
    pub index: usize,
    /// Its probability.
    pub pdf_discrete: f32,
    /// Uniform in [0, 1), independent of the index (with fewer bits than the random number had).
    pub remapped: f32,
}

/// An alias table: samples a discrete distribution in constant time (Walker 1974, constructed as in Vose 1991).
#[derive(Clone, Debug)]
pub struct AliasTable {
    entries: Vec<AliasEntry>,
}

impl AliasTable {
    /// From weights; negative and non-finite ones count as 0. The distribution is uniform if all are 0.
    pub fn new(weights: &[f32]) -> AliasTable {
        let sanitized = sanitized(weights);
        let total: f64 = sanitized.iter().sum();
        let n = sanitized.len();
        let mut scaled: Vec<f64> = sanitized.iter().map(|w| w / total * n as f64).collect();
        let mut entries: Vec<AliasEntry> = sanitized
            .iter()
            .enumerate()
            .map(|(i, w)| AliasEntry { threshold: 1.0, alias: i as u32, pdf_discrete: (w / total) as f32 })
            .collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..n).partition(|&i| scaled[i] < 1.0);
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            entries[s].threshold = scaled[s] as f32;
            entries[s].alias = l as u32;
            scaled[l] -= 1.0 - scaled[s];
            if scaled[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        AliasTable { entries }
    }

    /// Number of outcomes.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Always false: a table has at least one outcome.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Samples an index.
    #[inline]
    pub fn sample(&self, u: f32) -> DiscreteSample {
        let n = self.entries.len();
        let scaled = u * n as f32;
        let at = (scaled as usize).min(n - 1);
        let rest = scaled - at as f32;
        let entry = self.entries[at];
        let stays = rest < entry.threshold;
        let index = if stays { at } else { entry.alias as usize };
        let remapped = if stays {
            rest / entry.threshold
        } else {
            (rest - entry.threshold) / (1.0 - entry.threshold).max(f32::MIN_POSITIVE)
        };
        DiscreteSample {
            index,
            pdf_discrete: self.entries[index].pdf_discrete,
            remapped: remapped.min(1.0f32.next_down()),
        }
    }

    /// Probability of an index.
    #[inline]
    pub fn pdf_discrete(&self, index: usize) -> f32 {
        self.entries[index].pdf_discrete
    }
}

/// Weights as f64, with 0 for negative and non-finite ones; all 1 if none is positive. Never empty.
fn sanitized(weights: &[f32]) -> Vec<f64> {
    let clean: Vec<f64> =
        weights.iter().map(|&w| if w.is_finite() && w > 0.0 { f64::from(w) } else { 0.0 }).collect();
    if clean.iter().sum::<f64>() > 0.0 { clean } else { vec![1.0; weights.len().max(1)] }
}

// Sampling of images under bilinear filtering, which repeats along u and clamps along v.
//
// A piecewise-constant density undersamples the neighbours of bright texels, a large source of noise for skies with a sun;
// the bilinear density is proportional to the filtered image.

/// Texels per entry of the coarse CDF.
const BLOCK: u32 = 4;

/// Positions with their densities.
#[derive(Clone, Copy, Debug)]
pub struct DistributionSamples<const N: usize> {
    /// In 0..1, along u.
    pub u: [f32; N],
    /// In 0..1, along v.
    pub v: [f32; N],
    /// Densities per area of the unit square.
    pub pdf_area: [f32; N],
}

/// A position with its density.
#[derive(Clone, Copy, Debug)]
pub struct DistributionSample {
    /// Position in 0..1 along both axes.
    pub uv: [f32; 2],
    /// Density per area of the unit square.
    pub pdf_area: f32,
}

/// A density on the unit square: the bilinear interpolant of values at texel centres `((i + 0.5) / width,
/// (j + 0.5) / height)`.
///
/// The marginal along v is piecewise linear between row centres and constant in the outer half rows; the conditional density
/// along u is piecewise linear between column centres. Both CDFs are inverted exactly and monotonically, which preserves
/// stratification.
#[derive(Clone, Debug)]
pub struct BilinearDistribution {
    width: u32,
    height: u32,
    /// Values normalised to a mean of 1, row by row, each row with its first value repeated at the end.
    values: Vec<f32>,
    /// The unnormalised CDF of each row at every [`BLOCK`]th texel centre and at the end, in texels.
    coarse: Vec<f32>,
    /// Row means: the marginal density at row centres.
    rows: Vec<f32>,
    /// The marginal CDF at the knots 0, 0.5, 1.5, .., height - 0.5, height, divided by the height.
    row_cumulative: Vec<f32>,
    /// Initial step of the binary search for a block: the largest power of two below their number.
    first_step: u32,
    /// Initial step of the binary search for an interval of the marginal.
    first_row_step: u32,
}

impl BilinearDistribution {
    /// From one weight per texel, row by row; negative and non-finite ones count as 0. The density is uniform if all are 0.
    ///
    /// # Panics
    /// If `weights` doesn't have `width * height` elements, or none.
    pub fn new(width: usize, height: usize, weights: &[f32]) -> BilinearDistribution {
        assert!(width > 0 && height > 0 && weights.len() == width * height, "a weight for every texel");
        assert!((width + 1) * height < u32::MAX as usize, "an image of at most 2^32 texels");
        let clean = |w: f32| if w.is_finite() && w > 0.0 { f64::from(w) } else { 0.0 };
        let total: f64 = weights.iter().map(|&w| clean(w)).sum();
        let mean = total / weights.len() as f64;
        let scaled = |w: f32| if total > 0.0 { (clean(w) / mean) as f32 } else { 1.0 };
        let blocks = width.div_ceil(BLOCK as usize);
        let mut values = Vec::with_capacity((width + 1) * height);
        let mut coarse = Vec::with_capacity((blocks + 1) * height);
        let mut rows = Vec::with_capacity(height);
        for row in weights.chunks_exact(width) {
            let start = values.len();
            values.extend(row.iter().map(|&w| scaled(w)));
            values.push(values[start]);
            let mut sum = 0.0f64;
            for (i, pair) in values[start..].windows(2).enumerate() {
                if i % BLOCK as usize == 0 {
                    coarse.push(sum as f32);
                }
                sum += 0.5 * (f64::from(pair[0]) + f64::from(pair[1]));
            }
            coarse.push(sum as f32);
            rows.push((sum / width as f64) as f32);
        }
        let row_cumulative = marginal_cdf(&rows);
        let first_step = (blocks.next_power_of_two() / 2) as u32;
        let first_row_step = ((height + 1).next_power_of_two() / 2) as u32;
        let (width, height) = (width as u32, height as u32);
        BilinearDistribution {
            width,
            height,
            values,
            coarse,
            rows,
            row_cumulative,
            first_step,
            first_row_step,
        }
    }

    /// Columns and rows.
    pub fn size(&self) -> [usize; 2] {
        [self.width as usize, self.height as usize]
    }

    /// The density at the texel centres of a row; the first value is repeated at the end.
    pub fn row(&self, y: usize) -> &[f32] {
        let stride = self.width as usize + 1;
        &self.values[y * stride..(y + 1) * stride]
    }

    /// Memory in bytes.
    pub fn bytes(&self) -> usize {
        4 * (self.values.len() + self.coarse.len() + self.rows.len() + self.row_cumulative.len())
    }

    /// Density per area of the unit square at a position in 0..1.
    #[inline(always)]
    pub fn pdf_area(&self, uv: [f32; 2]) -> f32 {
        let rows = self.row_pair(uv[1] * self.height as f32 - 0.5);
        let x = uv[0] * self.width as f32 - 0.5;
        let x = if x < 0.0 { x + self.width as f32 } else { x };
        let i = (x as u32).min(self.width - 1);
        let s = x - i as f32;
        let (a, b) = (self.lerp_rows(&rows, i), self.lerp_rows(&rows, i + 1));
        a + s * (b - a)
    }

    /// Samples a position.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> DistributionSample {
        let many = self.sample_many([[u[0]], [u[1]]]);
        DistributionSample { uv: [many.u[0], many.v[0]], pdf_area: many.pdf_area[0] }
    }

    /// Samples `N` positions from `N` pairs of random numbers, in structure-of-arrays layout: branch-free, so that loops
    /// vectorise.
    #[inline(always)]
    pub fn sample_many<const N: usize>(&self, u: [[f32; N]; 2]) -> DistributionSamples<N> {
        let y = self.sample_rows(u[1]);
        let mut rows = [RowPair::default(); N];
        for i in 0..N {
            rows[i] = self.row_pair(y[i]);
        }
        let (mut x, pdf_area) = self.sample_columns(u[0], &rows);
        let mut v = [0.0; N];
        for i in 0..N {
            let shifted = x[i] + 0.5;
            let wrapped = if shifted >= self.width as f32 { shifted - self.width as f32 } else { shifted };
            x[i] = wrapped / self.width as f32;
            v[i] = (y[i] + 0.5) / self.height as f32;
        }
        DistributionSamples { u: x, v, pdf_area }
    }

    /// The rows of the interpolation at a position relative to the first row's centre.
    #[inline(always)]
    fn row_pair(&self, y: f32) -> RowPair {
        let last = self.height - 1;
        let y = if y > 0.0 { y } else { 0.0 };
        let low = (y as u32).min(last);
        RowPair { low, high: (low + 1).min(last), fraction: y - low as f32 }
    }

    /// Column `i`, interpolated between the rows.
    #[inline(always)]
    fn lerp_rows(&self, rows: &RowPair, i: u32) -> f32 {
        let (values, stride) = (Table::new(&self.values), self.width + 1);
        let (a, b) = (values.at(rows.low * stride + i), values.at(rows.high * stride + i));
        a + rows.fraction * (b - a)
    }

    /// Inverts the marginal CDF along v: positions relative to the first row's centre, -0.5 to height - 0.5.
    #[inline(always)]
    fn sample_rows<const N: usize>(&self, u: [f32; N]) -> [f32; N] {
        let (cumulative, values) = (Table::new(&self.row_cumulative), Table::new(&self.rows));
        let total = cumulative.at(self.height + 1);
        // Branch-free binary search for the last interval that starts at or before the target.
        let mut intervals = [0u32; N];
        let mut step = self.first_row_step;
        while step > 0 {
            for i in 0..N {
                let next = intervals[i] + step;
                let is_before = (next <= self.height) & (cumulative.at(next) <= u[i] * total);
                intervals[i] += if is_before { step } else { 0 };
            }
            step /= 2;
        }
        let mut y = [0.0; N];
        for i in 0..N {
            let interval = intervals[i];
            let rest = (u[i] * total - cumulative.at(interval)) * self.height as f32;
            let first = if interval > 0 { interval - 1 } else { 0 };
            let (a, b) = (values.at(first), values.at(interval));
            // The outer intervals are half a row long and constant.
            let outer = (interval == 0) | (interval == self.height);
            let length = if outer { 0.5 } else { 1.0 };
            let start = if interval == 0 { -0.5 } else { interval as f32 - 1.0 };
            let t = invert_linear(a * length, b * length, rest) * length;
            let end = self.height as f32 - 0.5;
            y[i] = if start + t < end { start + t } else { end };
        }
        y
    }

    /// Inverts the conditional CDFs along u: positions relative to the first column's centre, 0 to width, and the densities.
    #[inline(always)]
    fn sample_columns<const N: usize>(&self, u: [f32; N], rows: &[RowPair; N]) -> ([f32; N], [f32; N]) {
        let coarse = Table::new(&self.coarse);
        let blocks = self.width.div_ceil(BLOCK);
        let stride = blocks + 1;
        let cdf = |rows: &RowPair, block: u32| {
            let (a, b) = (coarse.at(rows.low * stride + block), coarse.at(rows.high * stride + block));
            a + rows.fraction * (b - a)
        };
        let (mut targets, mut block) = ([0.0; N], [0u32; N]);
        for i in 0..N {
            targets[i] = u[i] * cdf(&rows[i], blocks);
        }
        // Branch-free binary search for the last block that starts at or before the target.
        let mut step = self.first_step;
        while step > 0 {
            for i in 0..N {
                let next = block[i] + step;
                let next = if next < blocks { next } else { blocks };
                let is_before = (next < blocks) & (cdf(&rows[i], next) <= targets[i]);
                block[i] += if is_before { step } else { 0 };
            }
            step /= 2;
        }
        let (mut x, mut density) = ([0.0; N], [0.0; N]);
        for i in 0..N {
            (x[i], density[i]) = self.sample_block(targets[i] - cdf(&rows[i], block[i]), &rows[i], block[i]);
        }
        (x, density)
    }

    /// Inverts the CDF within a block of texels; `rest` is the integral from its start.
    #[inline(always)]
    fn sample_block(&self, rest: f32, rows: &RowPair, block: u32) -> (f32, f32) {
        let (mut rest, mut i) = (rest, block * BLOCK);
        let (mut a, mut b) = (self.lerp_rows(rows, i), self.lerp_rows(rows, i + 1));
        let mut is_searching = true;
        for k in 2..=BLOCK {
            let area = 0.5 * (a + b);
            is_searching &= (rest >= area) & (i + 1 < self.width);
            let next = self.lerp_rows(rows, block * BLOCK + k);
            rest -= if is_searching { area } else { 0.0 };
            i += u32::from(is_searching);
            a = if is_searching { b } else { a };
            b = if is_searching { next } else { b };
        }
        let s = invert_linear(a, b, rest);
        (i as f32 + s, a + s * (b - a))
    }
}

/// Two adjacent rows, and the interpolation weight of the second.
#[derive(Clone, Copy, Default)]
struct RowPair {
    low: u32,
    high: u32,
    fraction: f32,
}

/// The marginal CDF along v at its knots, divided by the height.
fn marginal_cdf(rows: &[f32]) -> Vec<f32> {
    let n = rows.len() as f64;
    let (first, last) = (f64::from(rows[0]), f64::from(rows[rows.len() - 1]));
    let mut sum = 0.5 * first / n;
    let mut cumulative = vec![0.0, sum as f32];
    for pair in rows.windows(2) {
        sum += 0.5 * (f64::from(pair[0]) + f64::from(pair[1])) / n;
        cumulative.push(sum as f32);
    }
    cumulative.push((sum + 0.5 * last / n) as f32);
    cumulative
}

/// The `t` in 0..1 where the integral of the linear function from `a` to `b` is `area`: the root of
/// (b - a) t^2 / 2 + a t = area, without cancellation.
#[inline(always)]
fn invert_linear(a: f32, b: f32, area: f32) -> f32 {
    let discriminant = a * a + 2.0 * (b - a) * area;
    let root = if discriminant > 0.0 { discriminant } else { 0.0 }.sqrt();
    let denominator = a + root;
    let t = 2.0 * area / if denominator > 0.0 { denominator } else { 1.0 };
    let t = if t > 0.0 { t } else { 0.0 };
    if t < 1.0 { t } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::{Chi2, Random};

    const WEIGHTS: [f32; 7] = [0.0, 3.0, 0.1, 0.0, 5.0, 1.0, 0.0];

    #[test]
    fn alias_table_and_remapped_number_pass_chi_square() {
        let table = AliasTable::new(&WEIGHTS);
        let n = table.len() as f64;
        Chi2::new("alias table", 1).cells(7, 8).assert(
            |u| {
                let s = table.sample(u[0]);
                assert_eq!(s.pdf_discrete, table.pdf_discrete(s.index));
                Some([(s.index as f64 + 0.5) / n, f64::from(s.remapped)])
            },
            |p| f64::from(table.pdf_discrete((p[0] * n) as usize)) * n,
        );
    }

    #[test]
    fn invalid_weights_give_the_uniform_distribution() {
        let weights = [0.0, f32::NAN, -1.0, f32::INFINITY];
        assert_eq!(AliasTable::new(&weights).pdf_discrete(2), 0.25);
        assert_eq!(AliasTable::new(&[]).sample(0.5).index, 0);
    }

    fn noise(width: usize, height: usize) -> Vec<f32> {
        let mut random = Random::new(7);
        (0..width * height).map(|_| random.next().powi(3)).collect()
    }

    fn check(name: &str, map: &BilinearDistribution, cells: [usize; 2]) {
        let test = Chi2::new(name, 6).cells(cells[0], cells[1]);
        test.assert(
            |u| Some(map.sample([u[0], u[1]]).uv.map(f64::from)),
            |p| f64::from(map.pdf_area([p[0] as f32, p[1] as f32])),
        );
        let mut random = Random::new(3);
        for _ in 0..20_000 {
            let s = map.sample([random.next(), random.next()]);
            let evaluated = map.pdf_area(s.uv);
            assert!(s.pdf_area > 0.0, "{name}: {s:?}");
            assert!((s.pdf_area - evaluated).abs() <= 2e-3 * s.pdf_area + 1e-3, "{name}: {s:?} {evaluated}");
        }
    }

    #[test]
    fn maps_pass_chi_square() {
        check("noise", &BilinearDistribution::new(40, 20, &noise(40, 20)), [40, 20]);
        check("odd sizes", &BilinearDistribution::new(17, 5, &noise(17, 5)), [34, 20]);
        let mut sun = vec![1e-3; 64 * 32];
        sun[9 * 64] = 1e3;
        check("sun at the seam", &BilinearDistribution::new(64, 32, &sun), [64, 32]);
        check("one texel", &BilinearDistribution::new(1, 1, &[3.0]), [8, 8]);
        check("one row", &BilinearDistribution::new(9, 1, &noise(9, 1)), [18, 4]);
        let mut top = vec![0.0; 12];
        top[1] = 1.0;
        check("only the top row", &BilinearDistribution::new(4, 3, &top), [16, 24]);
    }

    #[test]
    fn invalid_weights_give_the_uniform_density() {
        let map = BilinearDistribution::new(3, 2, &[0.0, f32::NAN, -1.0, 0.0, 0.0, 0.0]);
        assert_eq!(map.pdf_area([0.3, 0.9]), 1.0);
        assert!(map.bytes() < 200);
    }
}
