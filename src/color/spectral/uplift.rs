//! Spectral uplift of Rec. 709 colours by sigmoids of quadratic polynomials (Jakob, Hanika 2019, "A Low-Dimensional Function Space
//! for Efficient Spectral Upsampling"), and the enum of all kinds of spectra.

use super::{Curve, FIRST_NM, LAST_NM, Wavelengths, quadrature};
use crate::color::Rgb;
use rayon::prelude::*;
use std::sync::{Arc, OnceLock};

const MIDDLE_NM: f32 = 0.5 * (FIRST_NM + LAST_NM);
const HALF_NM: f32 = 0.5 * (LAST_NM - FIRST_NM);

/// A sigmoid of a polynomial of degree two (Jakob, Hanika 2019, equations 4 and 5): 1/2 + x / (2 sqrt(1 + x^2)) with
/// x = a t^2 + b t + c, where t goes from -1 to 1 over the visible wavelengths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sigmoid(pub [f32; 3]);

impl Sigmoid {
    /// The value, 0..1, at a wavelength in nanometres.
    #[inline(always)]
    pub fn at(&self, nm: f32) -> f32 {
        let [a, b, c] = self.0;
        let t = (nm - MIDDLE_NM) * (1.0 / HALF_NM);
        let x = (a * t + b) * t + c;
        // Avoids cancellation where the sigmoid is close to 0.
        let s = (1.0 + x * x).sqrt();
        let tail = 0.5 / (s * (s + x.abs()));
        if x < 0.0 { tail } else { 1.0 - tail }
    }
}

/// A wavelength in nanometres mapped to -1..1.
pub(super) fn normalized(nm: f64) -> f64 {
    (nm - f64::from(MIDDLE_NM)) / f64::from(HALF_NM)
}

// Fit of a sigmoid to a colour.

/// The fit stops at this error, relative to the brightest channel.
const TARGET_ERROR: f64 = 1e-6;
const MAX_STEPS: usize = 60;
/// Largest polynomial coefficient: with larger ones a spectrum is a step between two wavelengths.
const MAX_COEFFICIENT: f64 = 300.0;

/// Linear Rec. 709 of a sigmoid reflectance under D65, and its Jacobian with respect to the coefficients.
fn color_of([a, b, c]: [f64; 3]) -> ([f64; 3], [[f64; 3]; 3]) {
    let (mut rgb, mut slopes) = ([0.0; 3], [[0.0; 3]; 3]);
    for (nm, weight) in quadrature() {
        let t = normalized(*nm);
        let x = (a * t + b) * t + c;
        let s = (1.0 + x * x).sqrt();
        let tail = 0.5 / (s * (s + x.abs()));
        let value = if x < 0.0 { tail } else { 1.0 - tail };
        let slope = 0.5 / (s * s * s);
        for i in 0..3 {
            rgb[i] += weight[i] * value;
            let by_c = weight[i] * slope;
            slopes[i][0] += by_c * t * t;
            slopes[i][1] += by_c * t;
            slopes[i][2] += by_c;
        }
    }
    (rgb, slopes)
}

fn error(found: [f64; 3], wanted: [f64; 3], scale: f64) -> f64 {
    (0..3).map(|i| ((found[i] - wanted[i]) * scale).powi(2)).sum::<f64>().sqrt()
}

/// Fits the coefficients of a sigmoid to a colour in 0..1 under D65, by the Levenberg-Marquardt method from `start`. Also returns the
/// error relative to the brightest channel.
pub(super) fn fit(rgb: [f64; 3], start: [f64; 3]) -> ([f64; 3], f64) {
    let scale = 1.0 / rgb.into_iter().fold(1e-9, f64::max);
    let mut best = start;
    let (mut found, mut slopes) = color_of(best);
    let (mut current_error, mut damping) = (error(found, rgb, scale), 1e-6);
    for _ in 0..MAX_STEPS {
        if current_error < TARGET_ERROR {
            break;
        }
        let Some(step) = step(&slopes, found, rgb, damping) else { break };
        let next = [0, 1, 2].map(|i| (best[i] - step[i]).clamp(-MAX_COEFFICIENT, MAX_COEFFICIENT));
        let (found_next, slopes_next) = color_of(next);
        let error_next = error(found_next, rgb, scale);
        if error_next < current_error {
            (best, found, slopes, current_error) = (next, found_next, slopes_next, error_next);
            damping = f64::max(damping * 0.2, 1e-12);
        } else {
            damping *= 8.0;
            if damping > 1e6 {
                break;
            }
        }
    }
    (best, current_error)
}

/// Solves the damped normal equations.
fn step(slopes: &[[f64; 3]; 3], found: [f64; 3], wanted: [f64; 3], damping: f64) -> Option<[f64; 3]> {
    let mut m = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    for (i, row) in m.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            *value = (0..3).map(|c| slopes[c][i] * slopes[c][j]).sum();
        }
        row[i] *= 1.0 + damping;
        right[i] = (0..3).map(|c| slopes[c][i] * (found[c] - wanted[c])).sum();
    }
    let minor = |a: usize, b: usize, c: usize, d: usize| m[a][b] * m[c][d] - m[a][d] * m[c][b];
    let inverse = [
        [minor(1, 1, 2, 2), minor(0, 2, 2, 1), minor(0, 1, 1, 2)],
        [minor(1, 2, 2, 0), minor(0, 0, 2, 2), minor(0, 2, 1, 0)],
        [minor(1, 0, 2, 1), minor(0, 1, 2, 0), minor(0, 0, 1, 1)],
    ];
    let determinant: f64 = (0..3).map(|i| m[0][i] * inverse[i][0]).sum();
    let solved = inverse.map(|row| (0..3).map(|i| row[i] * right[i]).sum::<f64>() / determinant);
    solved.iter().all(|v| v.is_finite()).then_some(solved)
}

// Table of sigmoids over the Rec. 709 gamut, interpolated at each texture lookup.

/// Table nodes along each axis.
const NODES: usize = 32;

/// Sigmoids indexed by the brightest channel, its value, and the ratios of the others to it (Jakob, Hanika 2019, section 4).
pub(super) struct Table {
    /// Values of the brightest channel, denser towards 0 and 1, where sigmoids change most.
    levels: [f32; NODES],
    /// Ratios to the brightest channel, also denser towards 0 and 1.
    ratios: [f32; NODES],
    /// By brightest channel, level, ratio of the channel after the next, ratio of the next channel (fastest).
    sigmoids: Vec<Sigmoid>,
}

fn smooth(x: f64) -> f64 {
    x * x * (3.0 - 2.0 * x)
}

fn levels() -> [f64; NODES] {
    std::array::from_fn(|i| smooth(smooth(i as f64 / (NODES - 1) as f64)))
}

fn ratios() -> [f64; NODES] {
    std::array::from_fn(|i| smooth(i as f64 / (NODES - 1) as f64))
}

/// The table; the first call computes it, in some tenths of a second.
pub(super) fn table() -> &'static Table {
    static TABLE: OnceLock<Table> = OnceLock::new();
    TABLE.get_or_init(|| {
        let (levels, ratios) = (levels(), ratios());
        let rows: Vec<(usize, usize)> = (0..3).flat_map(|m| (0..NODES).map(move |y| (m, y))).collect();
        let columns: Vec<Vec<Sigmoid>> = rows
            .into_par_iter()
            .flat_map_iter(|(m, y)| (0..NODES).map(move |x| column(&levels, m, ratios[y], ratios[x])))
            .collect();
        // Transposes columns of all levels to planes of one level.
        let at = |i: usize| {
            let (m, level, rest) = (i / NODES.pow(3), i / NODES.pow(2) % NODES, i % NODES.pow(2));
            columns[m * NODES.pow(2) + rest][level]
        };
        let sigmoids = (0..3 * NODES.pow(3)).map(at).collect();
        let single = |nodes: [f64; NODES]| nodes.map(|node| node as f32);
        Table { levels: single(levels), ratios: single(ratios), sigmoids }
    })
}

/// The sigmoids of one chromaticity at all levels. From the middle level outwards, each fit starts at its neighbour's solution.
fn column(levels: &[f64; NODES], brightest: usize, y: f64, x: f64) -> Vec<Sigmoid> {
    let solve = |level: f64, start: [f64; 3]| {
        let mut rgb = [0.0; 3];
        rgb[brightest] = level;
        rgb[(brightest + 1) % 3] = level * x;
        rgb[(brightest + 2) % 3] = level * y;
        fit(rgb, start).0
    };
    let mut found = vec![Sigmoid::default(); NODES];
    let single = |c: [f64; 3]| Sigmoid(c.map(|v| v as f32));
    let middle = NODES / 2;
    let first = solve(levels[middle], [0.0; 3]);
    let mut last = first;
    for i in middle..NODES {
        last = solve(levels[i], last);
        found[i] = single(last);
    }
    last = first;
    for i in (1..middle).rev() {
        last = solve(levels[i], last);
        found[i] = single(last);
    }
    // Never interpolated: `Table::look_up` clamps to the second level.
    found[0] = found[1];
    found
}

impl Table {
    /// The interpolated sigmoid of a colour in 0..1 that is not black, and a factor on it: below 1 only for colours darker than the
    /// second level.
    #[inline]
    pub fn look_up(&self, rgb: [f32; 3]) -> (Sigmoid, f32) {
        let [r, g, b] = rgb;
        let m = if r >= g && r >= b { 0 } else { 1 + usize::from(b > g) };
        let max = rgb[m];
        // The node below a value, and the interpolation weight of the node above.
        let split = |nodes: &[f32; NODES], value: f32| {
            let i = nodes.partition_point(|&node| node <= value).clamp(1, NODES - 1) - 1;
            (i, (value - nodes[i]) / (nodes[i + 1] - nodes[i]))
        };
        let (x, u) = split(&self.ratios, rgb[(m + 1) % 3] / max);
        let (y, v) = split(&self.ratios, rgb[(m + 2) % 3] / max);
        let level = max.clamp(self.levels[1], 1.0);
        let (z, w) = split(&self.levels, level);
        let mut sum = [0.0; 3];
        for (k, of_level) in [(z, 1.0 - w), (z + 1, w)] {
            for (j, of_row) in [(y, 1.0 - v), (y + 1, v)] {
                let first = ((m * NODES + k) * NODES + j) * NODES + x;
                for (i, of_column) in [(first, 1.0 - u), (first + 1, u)] {
                    let weight = of_level * of_row * of_column;
                    let Sigmoid(c) = &self.sigmoids[i];
                    (0..3).for_each(|n| sum[n] += weight * c[n]);
                }
            }
        }
        (Sigmoid(sum), max / level)
    }
}

/// A reflectance spectrum, or an emission spectrum relative to D65.
#[derive(Clone, Debug, PartialEq)]
pub enum Spectrum {
    /// The same value at all wavelengths.
    Grey(f32),
    /// The smooth spectrum of an RGB colour.
    Uplifted {
        /// The colour, linear Rec. 709.
        rgb: Rgb,
        /// Factor on the sigmoid.
        scale: f32,
        /// Spectrum before scaling.
        shape: Sigmoid,
    },
    /// A measured spectrum.
    Measured(Arc<Curve>),
}

/// Emission colours are fitted with their brightest channel scaled to this value, where sigmoids are smoothest.
const EMISSION_LEVEL: f32 = 0.5;

/// Divisor that scales a colour with brightest channel `max` into 0..1; 1 for reflectances.
#[inline(always)]
fn reflectance_scale(max: f32) -> f32 {
    if max > 1.0 { max / EMISSION_LEVEL } else { 1.0 }
}

impl Spectrum {
    /// The spectrum of a reflectance or another colour in 0..1.
    pub fn of_reflectance(rgb: Rgb) -> Spectrum {
        Spectrum::of(rgb, reflectance_scale(rgb.max_element()))
    }

    /// The emission spectrum of a light's colour, relative to D65.
    pub fn of_light(rgb: Rgb) -> Spectrum {
        Spectrum::of(rgb, rgb.max_element() / EMISSION_LEVEL)
    }

    fn of(rgb: Rgb, scale: f32) -> Spectrum {
        let rgb = rgb.max(Rgb::ZERO);
        let [r, g, b] = rgb.to_array();
        if r == g && g == b {
            return Spectrum::Grey(r);
        }
        let within = (rgb / scale).to_array();
        let (start, level) = table().look_up(within);
        let wanted = within.map(|c| f64::from(c) / f64::from(level));
        let (fitted, _) = fit(wanted, start.0.map(f64::from));
        Spectrum::Uplifted { rgb, scale: scale * level, shape: Sigmoid(fitted.map(|c| c as f32)) }
    }

    /// Values at a path's wavelengths.
    #[inline]
    pub fn at(&self, waves: &Wavelengths) -> Rgb {
        match self {
            Spectrum::Grey(value) => Rgb::splat(*value),
            Spectrum::Uplifted { scale, shape, .. } => waves.map(|nm| shape.at(nm) * scale),
            Spectrum::Measured(curve) => waves.map(|nm| curve.at(nm)),
        }
    }

    /// Linear Rec. 709 of the spectrum, for a reflectance under D65.
    pub fn rgb(&self) -> Rgb {
        match self {
            Spectrum::Grey(value) => Rgb::splat(*value),
            Spectrum::Uplifted { rgb, .. } => *rgb,
            Spectrum::Measured(curve) => Rgb::from_array(curve.rgb()),
        }
    }
}

#[inline]
fn uplifted(rgb: Rgb, scale: f32, waves: &Wavelengths) -> Rgb {
    let (shape, level) = table().look_up((rgb / scale).to_array());
    waves.map(|nm| shape.at(nm) * (scale * level))
}

/// The uplifted spectrum of a reflectance or transmittance at a path's wavelengths, interpolated in the table: mean error below 1e-3,
/// at most 1e-2 (test `table_round_trips_colours_approximately`).
#[inline]
pub fn uplift_reflectance(rgb: Rgb, waves: &Wavelengths) -> Rgb {
    let rgb = rgb.max(Rgb::ZERO);
    let (min, max) = (rgb.min_element(), rgb.max_element());
    if min == max { rgb } else { uplifted(rgb, reflectance_scale(max), waves) }
}

/// The uplifted emission spectrum of a light's colour at a path's wavelengths, interpolated in the table.
#[inline]
pub fn uplift_emission(rgb: Rgb, waves: &Wavelengths) -> Rgb {
    let rgb = rgb.max(Rgb::ZERO);
    let (min, max) = (rgb.min_element(), rgb.max_element());
    // Infinite emission stays infinite, so that the film counts the sample as invalid.
    if min == max || !max.is_finite() { rgb } else { uplifted(rgb, max / EMISSION_LEVEL, waves) }
}

#[cfg(test)]
mod tests {
    use super::super::rgb_of;
    use super::*;

    /// Mean and maximum error of the colours of a grid after conversion to spectra and back.
    fn round_trip(steps: u32, convert: impl Fn([f32; 3]) -> [f64; 3]) -> (f64, f64, [f32; 3]) {
        let (mut sum, mut most, mut worst) = (0.0, 0.0, [0.0; 3]);
        let level = |i: u32| (i as f32 + 0.5) / steps as f32;
        for i in 0..steps.pow(3) {
            let rgb = [i % steps, i / steps % steps, i / steps / steps].map(level);
            let found = convert(rgb);
            let error = (0..3).map(|c| (found[c] - f64::from(rgb[c])).abs()).fold(0.0, f64::max);
            sum += error;
            if error > most {
                (most, worst) = (error, rgb);
            }
        }
        (sum / f64::from(steps.pow(3)), most, worst)
    }

    #[test]
    fn fit_round_trips_colours() {
        let convert = |rgb: [f32; 3]| match Spectrum::of_reflectance(Rgb::from_array(rgb)) {
            Spectrum::Uplifted { scale, shape, .. } => {
                rgb_of(|nm| f64::from(shape.at(nm as f32)) * f64::from(scale))
            }
            other => other.rgb().to_array().map(f64::from),
        };
        let (mean, most, worst) = round_trip(11, convert);
        println!("fitted: mean {mean:.2e} most {most:.2e} at {worst:?}");
        assert!(mean < 2e-6 && most < 2e-4, "{mean} {most} {worst:?}");
    }

    #[test]
    fn table_round_trips_colours_approximately() {
        let convert = |rgb: [f32; 3]| {
            let (shape, scale) = table().look_up(rgb);
            rgb_of(|nm| f64::from(shape.at(nm as f32) * scale))
        };
        let (mean, most, worst) = round_trip(23, convert);
        println!("table: mean {mean:.2e} most {most:.2e} at {worst:?}");
        assert!(mean < 1e-3 && most < 1e-2, "{mean} {most} {worst:?}");
    }

    #[test]
    fn greys_have_constant_spectra() {
        let waves = Wavelengths::sample(0.3);
        for value in [0.0, 1e-6, 0.18, 1.0, 40.0] {
            let grey = Rgb::splat(value);
            assert_eq!(uplift_reflectance(grey, &waves), grey);
            assert_eq!(uplift_emission(grey, &waves), grey);
            assert_eq!(Spectrum::of_light(grey).at(&waves), grey);
        }
    }

    #[test]
    fn emission_spectra_scale_with_intensity() {
        let waves = Wavelengths::sample(0.1);
        let dim = uplift_emission(Rgb::new(0.02, 0.01, 0.004), &waves);
        let bright = uplift_emission(Rgb::new(20.0, 10.0, 4.0), &waves);
        let off = (bright / 1000.0 - dim).abs().max_element();
        assert!(off < 1e-6, "{dim} {bright}");
    }
}
