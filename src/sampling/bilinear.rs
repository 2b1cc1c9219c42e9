//! Positions in a texture with a density proportional to its bilinear interpolant: wrapped along u, clamped along v.
//!
//! A density that is constant per texel under a bilinear lookup misses the light that a bright texel spreads over its
//! neighbours and is a large source of noise on skies with a sun; this one matches the lookup everywhere.

/// Texels per entry of the coarse distribution function: one cache line of values.
const BLOCK: usize = 16;

/// A position with its density.
#[derive(Clone, Copy, Debug)]
pub struct MapSample {
    /// Position in 0..1 along both axes.
    pub uv: [f32; 2],
    /// Density per area of the unit square.
    pub pdf_area: f32,
}

/// A density on the unit square, interpolated bilinearly between values at texel centres `((i + 0.5) / width,
/// (j + 0.5) / height)`.
///
/// Along v the density's marginal is linear between row centres and constant in the outer half rows; at a given v the
/// density along u is linear between column centres, a blend of the two rows. Both are inverted exactly and
/// monotonically, so stratified numbers stay stratified.
#[derive(Clone, Debug)]
pub struct BilinearMap {
    width: usize,
    height: usize,
    /// Values scaled to a mean of 1, row by row, each row with its first value repeated at the end.
    values: Vec<f32>,
    /// For each row the integral from its first texel centre up to every [`BLOCK`]th one, and to the end, in texels.
    coarse: Vec<f32>,
    /// Row means; the marginal's values at row centres.
    rows: Vec<f32>,
    /// Integral of the marginal at its breakpoints 0, 0.5, 1.5, .., height - 0.5, height, divided by the height.
    row_cumulative: Vec<f32>,
    /// Where the search for a block starts: the largest power of two below their number.
    first_step: usize,
}

impl BilinearMap {
    /// From one weight a texel, row by row; negative and non-finite ones count as 0. All zero gives the uniform
    /// density. `weights` must hold `width * height` values, both at least 1.
    pub fn new(width: usize, height: usize, weights: &[f32]) -> BilinearMap {
        assert!(width > 0 && height > 0 && weights.len() == width * height, "a weight for every texel");
        let clean = |w: f32| if w.is_finite() && w > 0.0 { f64::from(w) } else { 0.0 };
        let total: f64 = weights.iter().map(|&w| clean(w)).sum();
        let mean = total / weights.len() as f64;
        let scaled = |w: f32| if total > 0.0 { (clean(w) / mean) as f32 } else { 1.0 };
        let blocks = width.div_ceil(BLOCK);
        let mut values = Vec::with_capacity((width + 1) * height);
        let mut coarse = Vec::with_capacity((blocks + 1) * height);
        let mut rows = Vec::with_capacity(height);
        for row in weights.chunks_exact(width) {
            let start = values.len();
            values.extend(row.iter().map(|&w| scaled(w)));
            values.push(values[start]);
            let mut sum = 0.0f64;
            for (i, pair) in values[start..].windows(2).enumerate() {
                if i % BLOCK == 0 {
                    coarse.push(sum as f32);
                }
                sum += 0.5 * (f64::from(pair[0]) + f64::from(pair[1]));
            }
            coarse.push(sum as f32);
            rows.push((sum / width as f64) as f32);
        }
        let row_cumulative = cumulative_of_rows(&rows);
        let first_step = blocks.next_power_of_two() / 2;
        BilinearMap { width, height, values, coarse, rows, row_cumulative, first_step }
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        4 * (self.values.len() + self.coarse.len() + self.rows.len() + self.row_cumulative.len())
    }

    /// Density per area of the unit square at a position in 0..1.
    #[inline(always)]
    pub fn pdf_area(&self, uv: [f32; 2]) -> f32 {
        let y = uv[1] * self.height as f32 - 0.5;
        let (low, high, t) = self.row_pair(y);
        let x = uv[0] * self.width as f32 - 0.5;
        let x = if x < 0.0 { x + self.width as f32 } else { x };
        let i = (x as usize).min(self.width - 1);
        let s = x - i as f32;
        let (a, b) = (self.blend(low, high, t, i), self.blend(low, high, t, i + 1));
        a + s * (b - a)
    }

    /// A position with density proportional to the interpolant.
    #[inline(always)]
    pub fn sample(&self, u: [f32; 2]) -> MapSample {
        let y = self.sample_row(u[1]);
        let (low, high, t) = self.row_pair(y);
        let (x, pdf_area) = self.sample_column(u[0], low, high, t);
        let x = x + 0.5;
        let x = if x >= self.width as f32 { x - self.width as f32 } else { x };
        MapSample { uv: [x / self.width as f32, (y + 0.5) / self.height as f32], pdf_area }
    }

    /// The rows around a position in texel centres, and the second one's share.
    #[inline(always)]
    fn row_pair(&self, y: f32) -> (usize, usize, f32) {
        let last = self.height - 1;
        let y = if y > 0.0 { y } else { 0.0 };
        let low = (y as usize).min(last);
        (low, (low + 1).min(last), y - low as f32)
    }

    #[inline(always)]
    fn blend(&self, low: usize, high: usize, t: f32, i: usize) -> f32 {
        let stride = self.width + 1;
        let (a, b) = (self.values[low * stride + i], self.values[high * stride + i]);
        a + t * (b - a)
    }

    /// Inverts the marginal along v: a position in texel centres, -0.5 to height - 0.5.
    #[inline(always)]
    fn sample_row(&self, u: f32) -> f32 {
        let target = u * self.row_cumulative[self.height + 1];
        let piece = (self.row_cumulative.partition_point(|&c| c <= target).max(1) - 1).min(self.height);
        let rest = (target - self.row_cumulative[piece]) * self.height as f32;
        let (a, b) = (self.rows[piece.max(1) - 1], self.rows[piece.min(self.height - 1)]);
        // The outer pieces are half a row long and constant.
        let outer = piece == 0 || piece == self.height;
        let length = if outer { 0.5 } else { 1.0 };
        let start = if piece == 0 { -0.5 } else { piece as f32 - 1.0 };
        let t = invert_linear(a * length, b * length, rest) * length;
        (start + t).min(self.height as f32 - 0.5)
    }

    /// Inverts the density along u at a blend of two rows: a position in texel centres, 0 to width, and the density.
    #[inline(always)]
    fn sample_column(&self, u: f32, low: usize, high: usize, t: f32) -> (f32, f32) {
        let blocks = self.width.div_ceil(BLOCK);
        let row = |j: usize| &self.coarse[j * (blocks + 1)..][..blocks + 1];
        let (c0, c1) = (row(low), row(high));
        let at = |k: usize| c0[k] + t * (c1[k] - c0[k]);
        let target = u * at(blocks);
        // The last block whose start is at or before the target; by sums, since branches would be mispredicted.
        let (mut block, mut step) = (0, self.first_step);
        while step > 0 {
            let next = (block + step).min(blocks);
            let is_before = (next < blocks) & (at(next) <= target);
            block += step * usize::from(is_before);
            step /= 2;
        }
        let mut rest = target - at(block);
        let last = ((block + 1) * BLOCK).min(self.width) - 1;
        let mut i = block * BLOCK;
        let mut a = self.blend(low, high, t, i);
        let mut b = self.blend(low, high, t, i + 1);
        while i < last && rest >= 0.5 * (a + b) {
            rest -= 0.5 * (a + b);
            i += 1;
            a = b;
            b = self.blend(low, high, t, i + 1);
        }
        let s = invert_linear(a, b, rest);
        (i as f32 + s, a + s * (b - a))
    }
}

/// Integrals of the marginal along v at its breakpoints, over the height.
fn cumulative_of_rows(rows: &[f32]) -> Vec<f32> {
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

/// Where in 0..1 the integral of the function that goes linearly from `a` to `b` reaches `area`: the root of
/// (b - a) t^2 / 2 + a t = area in the form that does not cancel.
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

    fn noise(width: usize, height: usize) -> Vec<f32> {
        let mut random = Random::new(7);
        (0..width * height).map(|_| random.next().powi(3)).collect()
    }

    fn check(name: &str, map: &BilinearMap, cells: [usize; 2]) {
        let test = Chi2::new(name, 6).cells(cells[0], cells[1]);
        test.assert(
            |u| Some(map.sample([u[0], u[1]]).uv.map(f64::from)),
            |p| f64::from(map.pdf_area([p[0] as f32, p[1] as f32])),
        );
        let mut random = Random::new(3);
        for _ in 0..20_000 {
            let s = map.sample([random.next(), random.next()]);
            let again = map.pdf_area(s.uv);
            assert!(s.pdf_area > 0.0, "{name}: {s:?}");
            assert!((s.pdf_area - again).abs() <= 2e-3 * s.pdf_area + 1e-3, "{name}: {s:?} {again}");
        }
    }

    #[test]
    fn maps_pass_chi_square() {
        check("noise", &BilinearMap::new(40, 20, &noise(40, 20)), [40, 20]);
        check("odd sizes", &BilinearMap::new(17, 5, &noise(17, 5)), [34, 20]);
        let mut sun = vec![1e-3; 64 * 32];
        sun[9 * 64] = 1e3;
        check("sun at the seam", &BilinearMap::new(64, 32, &sun), [64, 32]);
        check("one texel", &BilinearMap::new(1, 1, &[3.0]), [8, 8]);
        check("one row", &BilinearMap::new(9, 1, &noise(9, 1)), [18, 4]);
        let mut top = vec![0.0; 12];
        top[1] = 1.0;
        check("only the top row", &BilinearMap::new(4, 3, &top), [16, 24]);
    }

    #[test]
    fn nothing_anywhere_is_uniform() {
        let map = BilinearMap::new(3, 2, &[0.0, f32::NAN, -1.0, 0.0, 0.0, 0.0]);
        assert_eq!(map.pdf_area([0.3, 0.9]), 1.0);
        assert!(map.bytes() < 200);
    }
}
