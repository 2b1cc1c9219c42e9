//! Spectra for spectral rendering.
//!
//! Spectra are relative to the CIE illuminant D65 (daylight): the constant 1 is the white of Rec. 709. A path has [`LANES`]
//! wavelengths in place of red, green and blue (Wilkie et al. 2014, "Hero Wavelength Spectral Sampling"). Spectral radiance is
//! converted to linear Rec. 709 by the CIE 1931 observer ([`Wavelengths::rgb`]). Rec. 709 colours are uplifted to smooth spectra,
//! [`Sigmoid`]s (Jakob, Hanika 2019, "A Low-Dimensional Function Space for Efficient Spectral Upsampling").

mod metals;
mod uplift;

pub use metals::Metal;
pub use uplift::{Sigmoid, Spectrum, uplift_emission, uplift_reflectance};

use crate::color::{Primaries, Rgb, luminance};
use std::sync::OnceLock;

/// The shortest visible wavelength, nanometres.
pub const FIRST_NM: f32 = 380.0;
/// The longest visible wavelength, nanometres.
pub const LAST_NM: f32 = 780.0;
/// Number of wavelengths of a path.
pub const LANES: usize = 3;

/// Spacing of the nodes of [`MATCHING`] and [`D65`], nanometres.
const STEP_NM: f32 = 5.0;
const NODES: usize = MATCHING.len();

/// Added to the sampling density of all wavelengths, as a fraction of the mean response.
const MIN_DENSITY: f64 = 0.05;

/// Response of the CIE 1931 observer and the density of wavelength sampling, tabulated; linear between nodes.
struct Observer {
    /// Linear Rec. 709 per nanometre of a spectrum of 1 relative to D65.
    rgb: [[f32; 3]; NODES],
    /// Sampling pdf, per nanometre.
    density: [f32; NODES],
    /// Cumulative distribution function of `density`.
    cumulative: [f32; NODES],
}

/// Linear Rec. 709 per nanometre of a spectrum of 1 relative to D65, at the nodes. Normalized so that the integral is white: a
/// change of some 1e-4, since the white point of Rec. 709 is rounded.
fn rgb_at_nodes() -> [[f64; 3]; NODES] {
    // Never `None` for Rec. 709.
    let matrix = Primaries::REC709.rgb_from_xyz().unwrap_or_default();
    let mut rgb = [[0.0; 3]; NODES];
    for (rgb, (xyz, power)) in rgb.iter_mut().zip(MATCHING.iter().zip(D65)) {
        *rgb = matrix.map(|row| (0..3).map(|c| row[c] * f64::from(xyz[c]) * f64::from(power)).sum());
    }
    let white = [0, 1, 2].map(|c| trapezoid(rgb.iter().map(|rgb| rgb[c])));
    rgb.map(|rgb| [0, 1, 2].map(|c| rgb[c] / white[c]))
}

/// Linear Rec. 709 of monochromatic light by the CIE 1931 observer; black outside [`FIRST_NM`]..[`LAST_NM`].
pub fn rgb_of_wavelength(nm: f32) -> [f32; 3] {
    static TABLE: OnceLock<[[f32; 3]; NODES]> = OnceLock::new();
    let table = TABLE.get_or_init(|| {
        let matrix = Primaries::REC709.rgb_from_xyz().unwrap_or_default();
        MATCHING.map(|xyz| matrix.map(|row| (0..3).map(|c| row[c] * f64::from(xyz[c])).sum::<f64>() as f32))
    });
    let at = (nm - FIRST_NM) / STEP_NM;
    if !(0.0..(NODES - 1) as f32).contains(&at) {
        return [0.0; 3];
    }
    let (a, b, fraction) = (table[at as usize], table[at as usize + 1], at.fract());
    std::array::from_fn(|i| a[i] + fraction * (b[i] - a[i]))
}

fn trapezoid(values: impl Iterator<Item = f64>) -> f64 {
    let ends = |i: usize| if i == 0 || i == NODES - 1 { 0.5 } else { 1.0 };
    f64::from(STEP_NM) * values.enumerate().map(|(i, value)| value * ends(i)).sum::<f64>()
}

fn observer() -> &'static Observer {
    static OBSERVER: OnceLock<Observer> = OnceLock::new();
    OBSERVER.get_or_init(|| {
        let rgb = rgb_at_nodes();
        // Importance sampling by the observer's response, for the least variance of white light.
        let lengths = rgb.map(|[r, g, b]| (r * r + g * g + b * b).sqrt());
        let mean = lengths.iter().sum::<f64>() / NODES as f64;
        let weights = lengths.map(|length| length + MIN_DENSITY * mean);
        let sum = trapezoid(weights.into_iter());
        let density = weights.map(|weight| weight / sum);
        let mut cumulative = [0.0; NODES];
        for i in 1..NODES {
            cumulative[i] = cumulative[i - 1] + 0.5 * f64::from(STEP_NM) * (density[i - 1] + density[i]);
        }
        Observer {
            rgb: rgb.map(|rgb| rgb.map(|v| v as f32)),
            density: density.map(|v| v as f32),
            cumulative: cumulative.map(|v| v as f32),
        }
    })
}

/// Quadrature by Simpson's rule: wavelengths in nanometres (nodes and midpoints) with weights in linear Rec. 709. The weighted sum
/// of a spectrum's values, relative to D65, is its colour.
pub(super) fn quadrature() -> &'static [(f64, [f64; 3])] {
    static POINTS: OnceLock<Vec<(f64, [f64; 3])>> = OnceLock::new();
    POINTS.get_or_init(|| {
        let rgb = rgb_at_nodes();
        let step = f64::from(STEP_NM);
        let mut points = Vec::with_capacity(2 * NODES - 1);
        for i in 0..NODES {
            let nm = f64::from(FIRST_NM) + step * i as f64;
            let weight = if i == 0 || i == NODES - 1 { 1.0 } else { 2.0 };
            points.push((nm, rgb[i].map(|v| v * weight * step / 6.0)));
            if let Some(next) = rgb.get(i + 1) {
                points.push((nm + 0.5 * step, [0, 1, 2].map(|c| (rgb[i][c] + next[c]) * step / 3.0)));
            }
        }
        points
    })
}

/// Linear Rec. 709 of a spectrum relative to D65; for a reflectance, its colour under D65. Components are negative outside the gamut.
pub fn rgb_of(spectrum: impl Fn(f64) -> f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (nm, weight) in quadrature() {
        let value = spectrum(*nm);
        (0..3).for_each(|c| sum[c] += weight[c] * value);
    }
    sum
}

/// Relative power of D65 at a wavelength in nanometres, 100 at 560 nm.
pub(super) fn daylight(nm: f64) -> f64 {
    let at = ((nm - f64::from(FIRST_NM)) / f64::from(STEP_NM)).clamp(0.0, (NODES - 1) as f64);
    let i = (at as usize).min(NODES - 2);
    let fraction = at - i as f64;
    f64::from(D65[i]) * (1.0 - fraction) + f64::from(D65[i + 1]) * fraction
}

/// The wavelengths of a path: the hero wavelength and two rotated by one and two thirds of the cumulative distribution.
#[derive(Clone, Copy, Debug)]
pub struct Wavelengths {
    /// Wavelength per lane, nanometres.
    pub nm: [f32; LANES],
    /// Per lane: linear Rec. 709 of unit radiance at the wavelength, divided by the pdf and [`LANES`].
    rgb: [[f32; 3]; LANES],
}

impl Wavelengths {
    /// Samples a hero wavelength, and the others from it, by a random number in 0..1.
    #[inline]
    pub fn sample(u: f32) -> Wavelengths {
        let observer = observer();
        let mut sampled = Wavelengths { nm: [0.0; LANES], rgb: [[0.0; 3]; LANES] };
        for lane in 0..LANES {
            let rotated = u + lane as f32 / LANES as f32;
            let at = if rotated >= 1.0 { rotated - 1.0 } else { rotated };
            (sampled.nm[lane], sampled.rgb[lane]) = observer.sample(at);
        }
        sampled
    }

    /// Unbiased estimate of the linear Rec. 709 colour from a path's spectral contribution per lane.
    #[inline]
    pub fn rgb(&self, [a, b, c]: [f32; LANES]) -> [f32; 3] {
        let [x, y, z] = &self.rgb;
        [0, 1, 2].map(|i| a * x[i] + b * y[i] + c * z[i])
    }

    /// A function of the wavelength in each lane.
    #[inline(always)]
    pub fn map(&self, f: impl Fn(f32) -> f32) -> Rgb {
        Rgb::new(f(self.nm[0]), f(self.nm[1]), f(self.nm[2]))
    }
}

impl Observer {
    /// The wavelength, nanometres, at a value of the cumulative distribution, and its linear Rec. 709 divided by the pdf and [`LANES`].
    #[inline]
    fn sample(&self, u: f32) -> (f32, [f32; 3]) {
        let above = self.cumulative.partition_point(|&c| c <= u);
        let i = above.clamp(1, NODES - 1) - 1;
        let (from, to) = (self.cumulative[i], self.cumulative[i + 1]);
        let fraction = ((u - from) / (to - from)).clamp(0.0, 1.0);
        // Inverts the integral of the linear pdf between two nodes.
        let (p, q) = (self.density[i], self.density[i + 1]);
        let t = (fraction * (p + q) / (p + (p * p + (q * q - p * p) * fraction).sqrt())).min(1.0);
        let density = p + (q - p) * t;
        let (a, b) = (&self.rgb[i], &self.rgb[i + 1]);
        let scale = 1.0 / (LANES as f32 * density);
        let nm = FIRST_NM + STEP_NM * (i as f32 + t);
        (nm, [0, 1, 2].map(|c| (a[c] + (b[c] - a[c]) * t) * scale))
    }
}

// Measured spectra.

/// Spacing of the values of a curve, nanometres.
const CURVE_STEP_NM: f32 = 1.0;
const VALUES: usize = ((LAST_NM - FIRST_NM) / CURVE_STEP_NM) as usize + 1;

/// Second radiation constant, nanometres times kelvins (CODATA 2018).
pub const SECOND_RADIATION_CONSTANT: f64 = 1.438_776_877e7;

/// A measured spectrum, resampled: linear between the measured values and constant beyond the first and the last. Spectra of lights
/// are relative to D65.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Every [`CURVE_STEP_NM`], from [`FIRST_NM`] to [`LAST_NM`].
    values: Vec<f32>,
    /// Linear Rec. 709.
    rgb: [f32; 3],
}

/// Linear interpolation in a list of (wavelength, value), sorted by wavelength.
fn interpolated(measured: &[(f64, f64)], nm: f64) -> f64 {
    let above = measured.partition_point(|(at, _)| *at <= nm);
    match (above.checked_sub(1).map(|i| measured[i]), measured.get(above)) {
        (Some((a, from)), Some(&(b, to))) => from + (to - from) * (nm - a) / (b - a),
        (Some((_, value)), None) => value,
        (None, first) => first.map_or(0.0, |(_, value)| *value),
    }
}

impl Curve {
    /// A reflectance from (wavelength in nanometres, value) in ascending order.
    pub fn reflectance(measured: &[(f64, f64)]) -> Curve {
        Curve::new(|nm| interpolated(measured, nm))
    }

    /// An emission spectrum from (wavelength in nanometres, relative power), scaled to the luminance `target_luminance`.
    pub fn light(measured: &[(f64, f64)], target_luminance: f64) -> Curve {
        Curve::new(|nm| interpolated(measured, nm) / daylight(nm)).with_luminance(target_luminance)
    }

    /// The emission of a black body at a temperature in kelvins (Planck's law), scaled to the luminance `target_luminance`.
    pub fn black_body(kelvin: f64, target_luminance: f64) -> Curve {
        const C2: f64 = SECOND_RADIATION_CONSTANT;
        // Relative to 560 nm, against over- and underflow.
        let power =
            |nm: f64| (560.0 / nm).powi(5) * (C2 / (560.0 * kelvin)).exp_m1() / (C2 / (nm * kelvin)).exp_m1();
        Curve::new(|nm| power(nm) / daylight(nm)).with_luminance(target_luminance)
    }

    /// Samples a function of the wavelength in nanometres.
    pub(super) fn new(value: impl Fn(f64) -> f64) -> Curve {
        let values =
            (0..VALUES).map(|i| value(f64::from(FIRST_NM) + i as f64 * f64::from(CURVE_STEP_NM)) as f32);
        let curve = Curve { values: values.collect(), rgb: [0.0; 3] };
        let rgb = rgb_of(|nm| curve.at(nm as f32).into()).map(|v| v as f32);
        Curve { rgb, ..curve }
    }

    fn with_luminance(self, target: f64) -> Curve {
        let own = f64::from(luminance(self.rgb));
        let scale = if own > 0.0 { (target / own) as f32 } else { 0.0 };
        Curve { values: self.values.iter().map(|v| v * scale).collect(), rgb: self.rgb.map(|v| v * scale) }
    }

    /// The value at a wavelength in nanometres.
    #[inline]
    pub fn at(&self, nm: f32) -> f32 {
        let at = ((nm - FIRST_NM) * (1.0 / CURVE_STEP_NM)).clamp(0.0, (VALUES - 1) as f32);
        let i = (at as usize).min(VALUES - 2);
        let fraction = at - i as f32;
        self.values[i] * (1.0 - fraction) + self.values[i + 1] * fraction
    }

    /// Linear Rec. 709 of the spectrum, for a reflectance under D65. Components are negative outside the gamut.
    pub fn rgb(&self) -> [f32; 3] {
        self.rgb
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: u32 = 100_000;

    fn mean(spectrum: impl Fn(f32) -> f32) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for i in 0..COUNT {
            let sampled = Wavelengths::sample((i as f32 + 0.5) / COUNT as f32);
            let rgb = sampled.rgb(sampled.nm.map(&spectrum));
            (0..3).for_each(|c| sum[c] += f64::from(rgb[c]) / f64::from(COUNT));
        }
        sum
    }

    #[test]
    fn constant_spectrum_of_one_is_white() {
        for (sampled, integral) in mean(|_| 1.0).into_iter().zip(rgb_of(|_| 1.0)) {
            assert!((integral - 1.0).abs() < 1e-9, "{integral}");
            assert!((sampled - 1.0).abs() < 1e-4, "{sampled}");
        }
    }

    #[test]
    fn sampled_wavelengths_estimate_the_integral() {
        let hump = |nm: f64| (-((nm - 530.0) / 60.0).powi(2)).exp();
        let slope = |nm: f64| (nm - 380.0) / 400.0;
        for spectrum in [&hump as &dyn Fn(f64) -> f64, &slope] {
            let (sampled, exact) = (mean(|nm| spectrum(nm.into()) as f32), rgb_of(spectrum));
            for c in 0..3 {
                assert!((sampled[c] - exact[c]).abs() < 1e-4, "{sampled:?} {exact:?}");
            }
        }
    }

    /// CIE 015: chromaticities of monochromatic light of 520 nm and of the illuminant E.
    #[test]
    fn chromaticities_of_a_line_and_of_equal_energy_match_cie() {
        let xyz = |spectrum: &dyn Fn(f64) -> f64| {
            let [r, g, b] = rgb_of(spectrum);
            let to = Primaries::REC709.xyz_from_rgb().expect("not degenerate");
            let [x, y, z] = to.map(|row| row[0] * r + row[1] * g + row[2] * b);
            [x / (x + y + z), y / (x + y + z)]
        };
        let line = |nm: f64| f64::from(u8::from((nm - 520.0).abs() < 0.1)) / daylight(nm);
        for (found, expected) in
            [(xyz(&line), [0.0743, 0.8338]), (xyz(&|nm| 1.0 / daylight(nm)), [1.0 / 3.0; 2])]
        {
            assert!((0..2).all(|c| (found[c] - expected[c]).abs() < 6e-4), "{found:?} {expected:?}");
        }
    }
}

#[cfg(test)]
mod curve_tests {
    use super::*;

    #[test]
    fn curves_are_linear_between_nodes_and_constant_beyond() {
        let curve = Curve::reflectance(&[(400.0, 0.2), (500.0, 0.4), (600.0, 0.0)]);
        for (nm, value) in
            [(380.0, 0.2), (400.0, 0.2), (450.5, 0.301), (500.0, 0.4), (575.0, 0.1), (700.0, 0.0)]
        {
            assert!((curve.at(nm) - value).abs() < 1e-6, "{nm}: {}", curve.at(nm));
        }
    }

    /// The illuminant A (CIE 015: x = 0.44758, y = 0.40745) is a black body of 2856 K by an older value of the second radiation
    /// constant, 2855.5 K by today's.
    #[test]
    fn black_body_matches_illuminant_a() {
        let a = Curve::black_body(2855.5, 3.0);
        let [r, g, b] = a.rgb().map(f64::from);
        let to = Primaries::REC709.xyz_from_rgb().expect("not degenerate");
        let [x, y, z] = to.map(|row| row[0] * r + row[1] * g + row[2] * b);
        assert!((y - 3.0).abs() < 1e-3, "{y}");
        let (x, y) = (x / (x + y + z), y / (x + y + z));
        assert!((x - 0.44758).abs() < 5e-4 && (y - 0.40745).abs() < 5e-4, "{x} {y}");
    }
}

// CIE 1931 standard observer and illuminant D65, every 5 nm from 380 to 780 nm (CIE 015:2018, tables 1 and 5).
// Generated by `tools/spectra/tables.py`.

/// CIE 1931 colour matching functions: X, Y and Z.
pub const MATCHING: [[f32; 3]; 81] = [
    [0.001_368, 0.000_039, 0.006_450_001],
    [0.002_236, 0.000_064, 0.010_549_99],
    [0.004_243, 0.00012, 0.020_050_01],
    [0.00765, 0.000_217, 0.03621],
    [0.01431, 0.000_396, 0.067_850_01],
    [0.02319, 0.00064, 0.1102],
    [0.04351, 0.00121, 0.2074],
    [0.07763, 0.00218, 0.3713],
    [0.13438, 0.004, 0.6456],
    [0.21477, 0.0073, 1.039_050_1],
    [0.2839, 0.0116, 1.3856],
    [0.3285, 0.01684, 1.62296],
    [0.34828, 0.023, 1.74706],
    [0.34806, 0.0298, 1.7826],
    [0.3362, 0.038, 1.77211],
    [0.3187, 0.048, 1.7441],
    [0.2908, 0.06, 1.6692],
    [0.2511, 0.0739, 1.5281],
    [0.19536, 0.09098, 1.28764],
    [0.1421, 0.1126, 1.0419],
    [0.09564, 0.13902, 0.812_950_1],
    [0.057_950_01, 0.1693, 0.6162],
    [0.03201, 0.20802, 0.46518],
    [0.0147, 0.2586, 0.3533],
    [0.0049, 0.323, 0.272],
    [0.0024, 0.4073, 0.2123],
    [0.0093, 0.503, 0.1582],
    [0.0291, 0.6082, 0.1117],
    [0.06327, 0.71, 0.078_249_99],
    [0.1096, 0.7932, 0.057_250_01],
    [0.1655, 0.862, 0.04216],
    [0.225_749_9, 0.914_850_1, 0.02984],
    [0.2904, 0.954, 0.0203],
    [0.3597, 0.9803, 0.0134],
    [0.433_449_9, 0.994_950_1, 0.008_749_999],
    [0.512_050_1, 1.0, 0.005_749_999],
    [0.5945, 0.995, 0.0039],
    [0.6784, 0.9786, 0.002_749_999],
    [0.7621, 0.952, 0.0021],
    [0.8425, 0.9154, 0.0018],
    [0.9163, 0.87, 0.001_650_001],
    [0.9786, 0.8163, 0.0014],
    [1.0263, 0.757, 0.0011],
    [1.0567, 0.6949, 0.001],
    [1.0622, 0.631, 0.0008],
    [1.0456, 0.5668, 0.0006],
    [1.0026, 0.503, 0.00034],
    [0.9384, 0.4412, 0.00024],
    [0.854_449_9, 0.381, 0.00019],
    [0.7514, 0.321, 0.0001],
    [0.6424, 0.265, 0.000_049_999_99],
    [0.5419, 0.217, 0.00003],
    [0.4479, 0.175, 0.00002],
    [0.3608, 0.1382, 0.00001],
    [0.2835, 0.107, -0.000_000_000_000_000_000_001_905_824_1],
    [0.2187, 0.0816, 0.0],
    [0.1649, 0.061, 0.0],
    [0.1212, 0.04458, 0.0],
    [0.0874, 0.032, 0.0],
    [0.0636, 0.0232, 0.0],
    [0.04677, 0.017, 0.0],
    [0.0329, 0.01192, 0.0],
    [0.0227, 0.00821, 0.0],
    [0.01584, 0.005_723, 0.0],
    [0.011_359_16, 0.004_102, 0.0],
    [0.008_110_916, 0.002_929, 0.0],
    [0.005_790_346, 0.002_091, 0.0],
    [0.004_109_457, 0.001_484, 0.0],
    [0.002_899_327, 0.001_047, 0.0],
    [0.002_049_19, 0.00074, 0.0],
    [0.001_439_971, 0.00052, 0.0],
    [0.000_999_949_3, 0.000_361_1, 0.0],
    [0.000_690_078_6, 0.000_249_2, 0.0],
    [0.000_476_021_3, 0.000_171_9, 0.0],
    [0.000_332_301_1, 0.00012, 0.0],
    [0.000_234_826_1, 0.000_084_8, 0.0],
    [0.000_166_150_5, 0.00006, 0.0],
    [0.000_117_413, 0.000_042_4, 0.0],
    [0.000_083_075_27, 0.00003, 0.0],
    [0.000_058_706_52, 0.000_021_2, 0.0],
    [0.000_041_509_94, 0.000_014_99, 0.0],
];

/// Relative spectral power of the illuminant D65, 100 at 560 nm.
pub const D65: [f32; 81] = [
    49.9755, 52.3118, 54.6482, 68.7015, 82.7549, 87.1204, 91.486, 92.4589, 93.4318, 90.057, 86.6823, 95.7736,
    104.865, 110.936, 117.008, 117.41, 117.812, 116.336, 114.861, 115.392, 115.923, 112.367, 108.811,
    109.082, 109.354, 108.578, 107.802, 106.296, 104.79, 106.239, 107.689, 106.047, 104.405, 104.225,
    104.046, 102.023, 100.0, 98.1671, 96.3342, 96.0611, 95.788, 92.2368, 88.6856, 89.3459, 90.0062, 89.8026,
    89.5991, 88.6489, 87.6987, 85.4936, 83.2886, 83.4939, 83.6992, 81.863, 80.0268, 80.1207, 80.2146,
    81.2462, 82.2778, 80.281, 78.2842, 74.0027, 69.7213, 70.6652, 71.6091, 72.979, 74.349, 67.9765, 61.604,
    65.7448, 69.8856, 72.4863, 75.087, 69.3398, 63.5927, 55.0054, 46.4182, 56.6118, 66.8054, 65.0941,
    63.3828,
];
