//! The chi-square goodness-of-fit test of samplers against their densities.
//!
//! Samples are binned in cells of the unit square; the expected counts are the density's integrals over the cells, by
//! adaptive quadrature. Cells are pooled until each pool expects [`MIN_EXPECTED`] samples. Absorbed samples and samples
//! outside of the square have a cell of their own, so that the density's integral is tested as well. The
//! significance is corrected for the number of tests in a group (Sidak). Seeds are fixed.

use crate::math::{DVec3, Vec3};
use std::f64::consts::{PI, TAU};

/// Family-wise significance level: the probability that a group of tests fails although all of its samplers are correct.
pub const SIGNIFICANCE: f64 = 0.01;
/// Minimum expected count of a pool of cells.
pub const MIN_EXPECTED: f64 = 8.0;
/// Absolute tolerance of the quadrature, relative to the area of a cell. The error at a discontinuity inside a cell is of
/// this size, and the integral must be accurate to a few samples.
const LEAF_ERROR: f64 = 2e-5;
/// Maximum number of splits of a cell.
const MAX_SPLITS: u32 = 20;
/// Ratio of a split: the golden section.
const SPLIT: f64 = 0.381_966_011_250_105_15;

/// The result of a passed test.
#[derive(Clone, Copy, Debug)]
pub struct Chi2Report {
    /// Probability of a statistic at least this large under the null hypothesis.
    pub p_value: f64,
    pub degrees_of_freedom: usize,
    /// The density's integral over the square.
    pub integral: f64,
}

/// An area-preserving map (up to a constant) between directions and the unit square.
#[derive(Clone, Copy, Debug)]
pub struct SphericalDomain {
    axes: [DVec3; 3],
    one_minus_cos_max: f64,
}

impl SphericalDomain {
    /// All directions, by azimuth about z and z (the Lambert cylindrical projection).
    pub fn sphere() -> SphericalDomain {
        SphericalDomain::cap(Vec3::Z, 2.0)
    }

    /// The spherical cap around an axis up to an angle, given as 1 - cos.
    pub fn cap(axis: Vec3, one_minus_cos_max: f64) -> SphericalDomain {
        let z = axis.as_dvec3().normalize();
        let x = z.any_orthonormal_vector();
        let x = if z == DVec3::Z { DVec3::X } else { x };
        SphericalDomain { axes: [x, z.cross(x), z], one_minus_cos_max }
    }

    /// Solid angle of the square's image.
    pub fn solid_angle(&self) -> f64 {
        TAU * self.one_minus_cos_max
    }

    /// The point of a direction; components may be outside 0..1.
    pub fn point(&self, w: DVec3) -> [f64; 2] {
        let l = self.axes.map(|axis| w.dot(axis));
        let sin_squared = l[0] * l[0] + l[1] * l[1];
        // Without cancellation near the axis.
        let omc = if l[2] > 0.0 { sin_squared / (w.length() + l[2]) } else { 1.0 - l[2] / w.length() };
        [l[1].atan2(l[0]) / TAU + 0.5, omc / self.one_minus_cos_max]
    }

    /// The direction at a point of the square.
    pub fn direction(&self, p: [f64; 2]) -> DVec3 {
        let omc = p[1] * self.one_minus_cos_max;
        let sine = (omc * (2.0 - omc)).max(0.0).sqrt();
        let (s, c) = ((p[0] - 0.5) * TAU).sin_cos();
        self.axes[0] * (sine * c) + self.axes[1] * (sine * s) + self.axes[2] * (1.0 - omc)
    }
}

/// A test.
#[derive(Clone, Debug)]
pub struct Chi2 {
    name: String,
    tests: usize,
    cells: [usize; 2],
    samples: usize,
    min_splits: u32,
}

impl Chi2 {
    /// A test of a group of `tests`.
    pub fn new(name: &str, tests: usize) -> Chi2 {
        Chi2 { name: name.to_string(), tests, cells: [24, 24], samples: 200_000, min_splits: 0 }
    }

    /// Sets the grid (24 x 24 by default).
    pub fn cells(mut self, columns: usize, rows: usize) -> Chi2 {
        self.cells = [columns, rows];
        self
    }

    /// Sets the number of samples (200,000 by default).
    pub fn samples(mut self, samples: usize) -> Chi2 {
        self.samples = samples;
        self
    }

    /// Sets the minimum number of splits of a cell along both axes (0 by default), for densities with features smaller than
    /// a cell.
    pub fn min_splits(mut self, splits: u32) -> Chi2 {
        self.min_splits = splits;
        self
    }

    /// Runs the test on points of the unit square; `density` is per area of the square. A sample of `None` counts as
    /// absorbed. Describes the failure if the samples don't follow the density.
    pub fn run(
        &self,
        mut sample: impl FnMut([f32; 3]) -> Option<[f64; 2]>,
        density: impl Fn([f64; 2]) -> f64,
    ) -> Result<Chi2Report, String> {
        let n = self.cells[0] * self.cells[1];
        let mut expected = self.expected(&density);
        let integral: f64 = expected.iter().sum();
        if !(-1e-9..=1.003).contains(&integral) {
            return Err(format!("{}: the density integrates to {integral}", self.name));
        }
        expected.push((1.0 - integral).max(0.0));
        let mut observed = vec![0u32; n + 1];
        let mut random = Random::new(0x9e37_79b9);
        for _ in 0..self.samples {
            let u = [random.next(), random.next(), random.next()];
            observed[sample(u).and_then(|p| self.cell(p)).unwrap_or(n)] += 1;
        }
        let count = self.samples as f64;
        let impossible: u32 =
            observed.iter().zip(&expected).filter(|(_, e)| **e * count < 1e-6).map(|(o, _)| *o).sum();
        if f64::from(impossible) > 2e-5 * count {
            return Err(format!("{}: {impossible} samples where the density is 0", self.name));
        }
        let cells = expected.iter().map(|e| e * count).zip(observed.iter().map(|&o| f64::from(o))).collect();
        let (statistic, pools) = pooled_statistic(cells);
        let degrees_of_freedom = pools.saturating_sub(1);
        let p_value = if degrees_of_freedom == 0 {
            1.0
        } else {
            upper_gamma(degrees_of_freedom as f64 / 2.0, statistic / 2.0)
        };
        let report = Chi2Report { p_value, degrees_of_freedom, integral };
        // Corrected for the number of tests (Sidak).
        let limit = 1.0 - (1.0 - SIGNIFICANCE).powf(1.0 / self.tests as f64);
        if p_value >= limit { Ok(report) } else { Err(self.describe(report, limit, &expected, &observed)) }
    }

    /// As [`Chi2::run`], over directions in the square's image with a density per solid angle.
    pub fn run_directions(
        &self,
        square: &SphericalDomain,
        mut sample: impl FnMut([f32; 3]) -> Option<Vec3>,
        pdf_solid_angle: impl Fn(Vec3) -> f32,
    ) -> Result<Chi2Report, String> {
        self.run(
            |u| sample(u).map(|w| square.point(w.as_dvec3())),
            |p| f64::from(pdf_solid_angle(square.direction(p).as_vec3())) * square.solid_angle(),
        )
    }

    /// Panics with the failure of [`Chi2::run`].
    pub fn assert(
        &self,
        sample: impl FnMut([f32; 3]) -> Option<[f64; 2]>,
        density: impl Fn([f64; 2]) -> f64,
    ) -> Chi2Report {
        self.run(sample, density).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Panics with the failure of [`Chi2::run_directions`].
    pub fn assert_directions(
        &self,
        square: &SphericalDomain,
        sample: impl FnMut([f32; 3]) -> Option<Vec3>,
        pdf_solid_angle: impl Fn(Vec3) -> f32,
    ) -> Chi2Report {
        self.run_directions(square, sample, pdf_solid_angle).unwrap_or_else(|error| panic!("{error}"))
    }

    fn cell(&self, p: [f64; 2]) -> Option<usize> {
        // Rounding may move a sample across the boundary.
        let tolerance = 1e-6;
        if !p.iter().all(|x| (-tolerance..=1.0 + tolerance).contains(x)) {
            return None;
        }
        let [x, y] = [0, 1].map(|i| ((p[i] * self.cells[i] as f64) as usize).min(self.cells[i] - 1));
        Some(y * self.cells[0] + x)
    }

    /// The density's integral over each cell.
    fn expected(&self, density: &impl Fn([f64; 2]) -> f64) -> Vec<f64> {
        let [columns, rows] = self.cells;
        let size = [1.0 / columns as f64, 1.0 / rows as f64];
        let tolerance = LEAF_ERROR / (columns * rows) as f64;
        (0..columns * rows)
            .map(|i| {
                let low = [(i % columns) as f64 * size[0], (i / columns) as f64 * size[1]];
                let whole = lobatto(density, low, size);
                refine(density, low, size, whole, tolerance, [2 * self.min_splits, MAX_SPLITS])
            })
            .collect()
    }

    fn describe(&self, report: Chi2Report, limit: f64, expected: &[f64], observed: &[u32]) -> String {
        let count = self.samples as f64;
        let mut worst: Vec<_> = expected
            .iter()
            .zip(observed)
            .enumerate()
            .map(|(i, (e, &o))| (i, e * count, o, (f64::from(o) - e * count).powi(2) / (e * count).max(1.0)))
            .collect();
        worst.sort_by(|a, b| b.3.total_cmp(&a.3));
        let mut text =
            format!("{}: p = {:.2e} < {limit:.2e}, {report:?}; worst cells:", self.name, report.p_value);
        for (i, e, o, _) in worst.iter().take(5) {
            let (x, y) = (i % self.cells[0], i / self.cells[0]);
            text += &format!("\n  ({x}, {y}) of {:?}: expected {e:.1}, observed {o}", self.cells);
        }
        text
    }
}

/// Gauss-Lobatto quadrature with 5 x 5 nodes (exact to degree 7). Its boundary nodes detect discontinuities between the
/// boundary and the next node; they are slightly inside the cell, to evaluate one-sided limits.
fn lobatto(f: &impl Fn([f64; 2]) -> f64, low: [f64; 2], size: [f64; 2]) -> f64 {
    const INSET: f64 = 1e-5;
    const X: [f64; 5] = [INSET, 0.172_673_164_646_011_43, 0.5, 0.827_326_835_353_988_6, 1.0 - INSET];
    const W: [f64; 5] = [1.0 / 20.0, 49.0 / 180.0, 16.0 / 45.0, 49.0 / 180.0, 1.0 / 20.0];
    let mut sum = 0.0;
    for (x, wx) in X.iter().zip(W) {
        for (y, wy) in X.iter().zip(W) {
            sum += wx * wy * f([low[0] + x * size[0], low[1] + y * size[1]]);
        }
    }
    sum * size[0] * size[1]
}

/// Adaptive quadrature: bisects a cell until the sum of the parts converges, along the axis of the larger error, so that an
/// axis-aligned discontinuity is refined across itself only. `least` and `most` bound the number of splits.
///
/// The parts are unequal: for a discontinuity near the centre, the errors of a symmetric rule and of its two halves cancel.
fn refine(
    f: &impl Fn([f64; 2]) -> f64,
    low: [f64; 2],
    size: [f64; 2],
    whole: f64,
    tolerance: f64,
    [least, most]: [u32; 2],
) -> f64 {
    let parts = [0, 1].map(|axis| {
        let (mut first, mut second, mut corner) = (size, size, low);
        first[axis] *= SPLIT;
        second[axis] -= first[axis];
        corner[axis] += first[axis];
        [(low, first), (corner, second)].map(|(low, size)| (low, size, lobatto(f, low, size)))
    });
    let errors = parts.map(|[a, b]| (a.2 + b.2 - whole).abs());
    let axis = match least {
        0 => usize::from(errors[1] > errors[0]),
        _ => least as usize % 2,
    };
    if most == 0 || (least == 0 && errors[axis] <= tolerance) {
        return parts[axis].map(|part| part.2).iter().sum();
    }
    let depths = [least.saturating_sub(1), most - 1];
    parts[axis].map(|(low, size, whole)| refine(f, low, size, whole, tolerance, depths)).iter().sum()
}

/// The chi-square statistic of pooled (expected, observed) pairs, and the number of pools.
fn pooled_statistic(mut cells: Vec<(f64, f64)>) -> (f64, usize) {
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut statistic, mut pools) = (0.0, 0);
    let (mut expected, mut observed) = (0.0, 0.0);
    for (e, o) in cells {
        expected += e;
        observed += o;
        if expected >= MIN_EXPECTED {
            statistic += (observed - expected) * (observed - expected) / expected;
            pools += 1;
            (expected, observed) = (0.0, 0.0);
        }
    }
    (statistic, pools)
}

/// ln of the gamma function for x > 0 (Stirling's series after shifting x above 10).
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 10.0 {
        shift += x.ln();
        x += 1.0;
    }
    let i = 1.0 / (x * x);
    let series = (1.0 / 12.0 - i * (1.0 / 360.0 - i * (1.0 / 1260.0 - i / 1680.0))) / x;
    (x - 0.5) * x.ln() - x + 0.5 * TAU.ln() + series - shift
}

/// The regularised upper incomplete gamma function Q(a, x): series or Lentz's continued fraction (NIST DLMF 8.7.3,
/// 8.9.2).
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-15 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return (1.0 - front * sum).clamp(0.0, 1.0);
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut h = d;
    for i in 1..10_000 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-14 {
            break;
        }
    }
    (front * h).clamp(0.0, 1.0)
}

/// Pseudo-random numbers for tests (PCG-RXS-M-XS 64, O'Neill 2014).
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// The sequence of a seed.
    pub fn new(seed: u64) -> Random {
        Random { state: seed.wrapping_mul(0x5851_f42d_4c95_7f2d) ^ 0x1405_7b7e_f767_814f }
    }

    /// The next number, uniform in [0, 1) with 24 bits.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> f32 {
        self.state =
            self.state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let word =
            ((self.state >> ((self.state >> 59) + 5)) ^ self.state).wrapping_mul(0xaef1_7502_108e_f2d9);
        let word = (word >> 43) ^ word;
        (word >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    /// The next direction, uniform on the sphere.
    pub fn direction(&mut self) -> Vec3 {
        let z = 1.0 - 2.0 * f64::from(self.next());
        let (s, c) = (f64::from(self.next()) * 2.0 * PI).sin_cos();
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * c, r * s, z).as_vec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn incomplete_gamma_against_known_values() {
        // Critical values of chi-square at 5 % for 1, 10 and 100 degrees of freedom.
        for (k, x) in [(1.0, 3.841_458_821), (10.0, 18.307_038_05), (100.0, 124.342_113_4)] {
            assert!((upper_gamma(k / 2.0, x / 2.0) - 0.05).abs() < 1e-8, "{k}");
        }
        assert!((ln_gamma(0.5) - 0.5 * PI.ln()).abs() < 1e-10);
    }

    #[test]
    fn discontinuities_within_cells_are_integrated_accurately() {
        for i in 0..200 {
            let step = 0.4 + f64::from(i) / 1000.0;
            let test = Chi2::new("step", 1).cells(4, 4);
            for axis in [0, 1] {
                let integral: f64 =
                    test.expected(&|p: [f64; 2]| f64::from(u8::from(p[axis] < step))).iter().sum();
                assert!((integral - step).abs() < 5e-5, "{axis} {step}: {integral}");
            }
        }
    }

    #[test]
    fn wrong_samplers_fail() {
        let square = |u: [f32; 3]| Some([f64::from(u[0]), f64::from(u[1])]);
        let test = Chi2::new("x", 1);
        test.assert(square, |_| 1.0);
        // An integral above and below 1, a gradient of +-6 % (which raises the statistic by 240, 7 standard deviations),
        // samples of zero density.
        assert!(test.run(square, |_| 1.02).is_err());
        assert!(test.run(square, |_| 0.98).is_err());
        assert!(test.run(square, |p| 0.94 + 0.12 * p[0]).is_err());
        assert!(test.run(square, |p| if p[0] < 0.5 { 2.0 } else { 0.0 }).is_err());
        // Absorption consistent with the density passes.
        test.assert(|u| if u[2] < 0.3 { None } else { square(u) }, |_| 0.7);
    }
}
