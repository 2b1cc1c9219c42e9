//! Reconstruction filters by importance sampling: instead of weighting samples by the filter, their positions are drawn from it (Ernst,
//! Stamminger, Greiner 2006, "Filter Importance Sampling"). All samples then have weight 1 and belong to a single pixel, so tiles
//! need no border.

use crate::scene::Filter;
use crate::simd::Table;

/// Cells per table.
const CELLS: usize = 256;
/// Ranges of the tail probability (of both tails) covered by the tables, from the filter's centre to its edge: thin tails need finer
/// cells.
const RANGES: [(f32, f32); 3] = [(1.0, 1.0 / 16.0), (1.0 / 16.0, 1.0 / 256.0), (1.0 / 256.0, 0.0)];
/// Intervals of the table of filter values.
const VALUES: usize = 512;
/// Steps of the numerical integration of a filter over its radius, for offsets accurate to 2e-7 pixels. Eight times as many would
/// dominate the time to the first ray of a small scene.
const STEPS: usize = 1 << 12;

/// Samples offsets from the pixel centre along one axis (all filters are separable and symmetric).
///
/// The inverse cumulative distribution is tabulated over the positive half and interpolated linearly. It is monotonic, so stratified
/// numbers stay stratified.
#[derive(Clone, Debug)]
pub struct FilterSampler {
    /// Offsets in pixels, by range.
    tables: [[f32; CELLS + 1]; RANGES.len()],
    /// Radius of the filter, pixels.
    radius: f32,
    /// Filter values from the centre to the edge, per pixel, normalised to an integral of 1.
    values: [f32; VALUES + 1],
}

impl FilterSampler {
    /// Tabulates a filter of a radius in pixels; 0 stands for the filter's default.
    pub fn new(filter: Filter, radius: f32) -> FilterSampler {
        let radius = f64::from(if radius > 0.0 { radius } else { filter.default_radius() });
        match filter {
            Filter::Box => FilterSampler::tabulate(radius, |_| 1.0),
            // The radius is three standard deviations: exp(-x^2 / (2 sigma^2)).
            Filter::Gaussian => {
                FilterSampler::tabulate(radius, |x| exp_of_negative(4.5 * (x / radius) * (x / radius)))
            }
            Filter::BlackmanHarris => FilterSampler::tabulate(radius, |x| blackman_harris(x / radius)),
        }
    }

    /// Samples an offset in pixels by a number `u` in 0..1, with the filter as pdf.
    #[inline(always)]
    pub fn sample(&self, u: f32) -> f32 {
        let signed = 2.0 * u - 1.0;
        let outside = 1.0 - signed.abs();
        // Without branches and bounds checks, so that loops over samples vectorise.
        let (in_first, in_second) = (outside >= RANGES[0].1, outside >= RANGES[1].1);
        let (from, scale) = if in_second { (RANGES[1].0, scale_of(1)) } else { (RANGES[2].0, scale_of(2)) };
        let (from, scale) = if in_first { (RANGES[0].0, scale_of(0)) } else { (from, scale) };
        let range = u32::from(!in_first) + u32::from(!in_second);
        let position = (from - outside) * scale;
        let cell = (position as u32).min(CELLS as u32 - 1);
        let fraction = position - cell as f32;
        let (table, at) = (Table::new(self.tables.as_flattened()), range * (CELLS as u32 + 1) + cell);
        let offset = table.at(at) + fraction * (table.at(at + 1) - table.at(at));
        if signed < 0.0 { -offset } else { offset }
    }

    /// Tabulates a filter by its unnormalised density, symmetric and non-negative on `-radius..radius`.
    fn tabulate(radius: f64, density: impl Fn(f64) -> f64) -> FilterSampler {
        let step = radius / STEPS as f64;
        let mut cumulative = Vec::with_capacity(STEPS + 1);
        cumulative.push(0.0f64);
        let mut sum = 0.0;
        for i in 0..STEPS {
            sum += density((i as f64 + 0.5) * step);
            cumulative.push(sum);
        }
        let inverse = |probability: f64| {
            let target = probability * sum;
            let above = cumulative.partition_point(|&c| c < target).clamp(1, STEPS);
            let (low, high) = (cumulative[above - 1], cumulative[above]);
            let fraction = if high > low { (target - low) / (high - low) } else { 0.0 };
            ((above as f64 - 1.0 + fraction) * step).clamp(0.0, radius) as f32
        };
        let tables = RANGES.map(|(from, to)| {
            let (from, to) = (f64::from(from), f64::from(to));
            std::array::from_fn(|i| inverse(1.0 - (from + (to - from) * i as f64 / CELLS as f64)))
        });
        let scale = 1.0 / (2.0 * sum * step);
        let values = std::array::from_fn(|i| (density(i as f64 / VALUES as f64 * radius) * scale) as f32);
        FilterSampler { tables, radius: radius as f32, values }
    }

    /// Radius of the filter, pixels: maximum offset.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Value of the normalised filter at an offset in pixels, for splats, whose positions are not drawn from the filter.
    #[inline]
    pub fn value(&self, offset: f32) -> f32 {
        let position = offset.abs() / self.radius * VALUES as f32;
        if position < VALUES as f32 {
            let cell = (position as usize).min(VALUES - 1);
            let fraction = position - cell as f32;
            self.values[cell] + fraction * (self.values[cell + 1] - self.values[cell])
        } else {
            0.0
        }
    }

    /// The pixels along an axis whose filter covers a film point, with their filter values.
    #[inline]
    pub fn covered_pixels(&self, at: f32) -> impl Iterator<Item = (f32, f32)> + use<'_> {
        let (first, last) = ((at - 0.5 - self.radius).ceil(), (at - 0.5 + self.radius).floor());
        let count = (last - first + 1.0).max(0.0) as u32;
        (0..count).map(move |k| {
            let pixel = first + k as f32;
            (pixel, self.value(at - (pixel + 0.5)))
        })
    }

    /// Chooses one of the pixels along an axis whose filter covers a film point, with probabilities proportional to their filter
    /// values, by a number `u` in 0..1. Returns the pixel and its weight, the sum of these values, so that the expected weight of a
    /// pixel is its filter value.
    #[inline]
    pub fn choose_pixel(&self, at: f32, u: f32) -> (f32, f32) {
        let sum = self.covered_pixels(at).map(|(_, value)| value).sum::<f32>();
        let (mut left, mut chosen) = (u * sum, 0.0);
        for (pixel, value) in self.covered_pixels(at).filter(|(_, value)| *value > 0.0) {
            chosen = pixel;
            left -= value;
            if left < 0.0 {
                break;
            }
        }
        (chosen, sum)
    }
}

/// Cells per unit of probability in a range.
const fn scale_of(range: usize) -> f32 {
    let (from, to) = RANGES[range];
    CELLS as f32 / (from - to)
}

/// The 4-term Blackman-Harris window (Harris 1978, "On the Use of Windows", table I, -92 dB) at `x` in -1..1.
fn blackman_harris(x: f64) -> f64 {
    // cos(2 t) and cos(3 t) in terms of cos(t).
    let c = cosine(std::f64::consts::PI * x);
    0.35875 + 0.48829 * c + 0.14128 * (2.0 * c * c - 1.0) + 0.01168 * (4.0 * c * c - 3.0) * c
}

/// cos(x) by its Taylor series, for |x| below 10. (Library functions differ in the last bit between platforms, and so would pictures.)
fn cosine(x: f64) -> f64 {
    let (mut term, mut sum) = (1.0, 1.0);
    for n in 1..=30 {
        let k = f64::from(2 * n);
        term *= -x * x / (k * (k - 1.0));
        sum += term;
    }
    sum
}

/// exp(-x) for 0 <= x < 10 as the reciprocal of the series of exp(x); for the reason see [`cosine`].
fn exp_of_negative(x: f64) -> f64 {
    let (mut term, mut sum) = (1.0, 1.0);
    for n in 1..=60 {
        term *= x / f64::from(n);
        sum += term;
    }
    1.0 / sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::hash::{SplitMix64, unit};

    const FILTERS: [Filter; 3] = [Filter::Box, Filter::Gaussian, Filter::BlackmanHarris];

    /// Unnormalised filter value, independent of the tables.
    fn density(filter: Filter, x: f64) -> f64 {
        let inside = |r: f64| f64::from(x.abs() < r);
        let t = std::f64::consts::TAU * (x + 1.5) / 3.0;
        match filter {
            Filter::Box => inside(0.5),
            Filter::Gaussian => (-x * x / 0.5).exp() * inside(1.5),
            Filter::BlackmanHarris => {
                (0.35875 - 0.48829 * t.cos() + 0.14128 * (2.0 * t).cos() - 0.01168 * (3.0 * t).cos())
                    * inside(1.5)
            }
        }
    }

    /// Integral of x^power times the filter from a to b, by the midpoint rule.
    fn moment(filter: Filter, power: i32, a: f64, b: f64) -> f64 {
        let n = 20_000;
        let h = (b - a) / f64::from(n);
        (0..n).map(|i| a + (f64::from(i) + 0.5) * h).map(|x| x.powi(power) * density(filter, x)).sum::<f64>()
            * h
    }

    #[test]
    fn series_agree_with_the_standard_library() {
        for i in 0..=1000 {
            let x = f64::from(i) / 1000.0;
            assert!((cosine(9.5 * x) - (9.5 * x).cos()).abs() < 1e-11);
            assert!((exp_of_negative(4.5 * x) - (-4.5 * x).exp()).abs() < 1e-15);
        }
    }

    #[test]
    fn chosen_pixels_share_a_point_by_their_filter_values() {
        for filter in FILTERS {
            for (radius, at) in [0.0f32, 0.6, 4.5]
                .into_iter()
                .flat_map(|r| [7.03f32, 7.25, 7.5, 7.71, 7.999].map(|at| (r, at)))
            {
                let sampler = FilterSampler::new(filter, radius);
                let n = 1 << 16;
                let mut shares = [0.0f64; 16];
                for i in 0..n {
                    let (pixel, weight) = sampler.choose_pixel(at, (i as f32 + 0.5) / n as f32);
                    shares[pixel as usize] += f64::from(weight) / f64::from(n);
                }
                for (pixel, share) in shares.into_iter().enumerate() {
                    let expected = f64::from(sampler.value(at - (pixel as f32 + 0.5)));
                    assert!(
                        (share - expected).abs() < 1e-4,
                        "{filter:?} at {at}: pixel {pixel} has {share}, not {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn moments_of_stratified_samples_equal_those_of_the_filter() {
        for filter in FILTERS {
            let sampler = FilterSampler::new(filter, 0.0);
            let n = 1 << 20;
            let mass = moment(filter, 0, -1.5, 1.5);
            for power in 1..=4 {
                let mean: f64 = (0..n)
                    .map(|i| f64::from(sampler.sample((i as f32 + 0.5) / n as f32)).powi(power))
                    .sum::<f64>()
                    / f64::from(n);
                let expected = moment(filter, power, -1.5, 1.5) / mass;
                assert!((mean - expected).abs() < 2e-5, "{filter:?} moment {power}: {mean} {expected}");
            }
        }
    }

    /// A filter of another radius is the default one, scaled.
    #[test]
    fn radii_scale_the_filter() {
        for filter in FILTERS {
            let (sampler, radius) = (FilterSampler::new(filter, 0.0), filter.default_radius());
            for scale in [0.01f32, 0.5, 2.0] {
                let scaled = FilterSampler::new(filter, radius * scale);
                for i in 0..1000 {
                    let u = (i as f32 + 0.5) / 1000.0;
                    let (offset, expected) = (scaled.sample(u), sampler.sample(u) * scale);
                    assert!(
                        (offset - expected).abs() < 1e-5 * scale,
                        "{filter:?} {scale}: {offset} {expected}"
                    );
                    let (value, expected) = (scaled.value(offset), sampler.value(sampler.sample(u)) / scale);
                    assert!(
                        (value - expected).abs() < 1e-3 / scale,
                        "{filter:?} {scale}: {value} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn samples_pass_a_chi_square_test() {
        const BINS: usize = 60;
        for (k, filter) in FILTERS.into_iter().enumerate() {
            let sampler = FilterSampler::new(filter, 0.0);
            let mut counts = [0u64; BINS];
            let n = 4_000_000u64;
            let mut random = SplitMix64::new(0x9E37_79B9_7F4A_7C15 ^ k as u64);
            for _ in 0..n {
                let u = unit((random.next_bits() >> 32) as u32);
                let x = f64::from(sampler.sample(u));
                counts[((x + 1.5) / 3.0 * BINS as f64).clamp(0.0, BINS as f64 - 1.0) as usize] += 1;
            }
            let mass = moment(filter, 0, -1.5, 1.5);
            let (mut chi2, mut freedom) = (0.0, -1.0);
            for (i, &count) in counts.iter().enumerate() {
                let a = -1.5 + 3.0 * i as f64 / BINS as f64;
                let expected = moment(filter, 0, a, a + 3.0 / BINS as f64) / mass * n as f64;
                if expected < 5.0 {
                    assert!(count < 30, "{filter:?}: {count} samples in an empty bin");
                    continue;
                }
                chi2 += (count as f64 - expected).powi(2) / expected;
                freedom += 1.0;
            }
            // Mean k, variance 2k; the skewed tail beyond 4.5 sigma has a probability of about 1e-4.
            assert!(chi2 < freedom + 4.5 * (2.0f64 * freedom).sqrt(), "{filter:?}: chi2 {chi2} of {freedom}");
        }
    }

    #[test]
    fn values_equal_the_normalized_density() {
        for filter in FILTERS {
            let sampler = FilterSampler::new(filter, 0.0);
            let mass = moment(filter, 0, -1.5, 1.5);
            for i in -1000..=1000 {
                let x = f64::from(i) * 2e-3 + 1e-4;
                let expected = density(filter, x) / mass;
                let value = f64::from(sampler.value(x as f32));
                assert!((value - expected).abs() < 2e-4, "{filter:?} {x}: {value} {expected}");
            }
        }
    }

    #[test]
    fn sampling_is_monotonic_and_symmetric() {
        for filter in FILTERS {
            let sampler = FilterSampler::new(filter, 0.0);
            let mut last = f32::NEG_INFINITY;
            for i in 0..=1 << 18 {
                let u = i as f32 / (1 << 18) as f32;
                let x = sampler.sample(u);
                assert!(x >= last && x.abs() <= 1.5);
                assert_eq!(x, -sampler.sample(1.0 - u));
                last = x;
            }
            assert_eq!(sampler.sample(0.5), 0.0);
        }
    }
}
