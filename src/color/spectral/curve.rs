//! Measured spectra.

use super::wavelengths::{FIRST_NM, LAST_NM, daylight, rgb_of};
use crate::color::luminance;

/// Nanometres from one value to the next.
const STEP_NM: f32 = 1.0;
const VALUES: usize = ((LAST_NM - FIRST_NM) / STEP_NM) as usize + 1;

/// Second radiation constant, nanometres times kelvins (CODATA 2018).
pub const SECOND_RADIATION_CONSTANT: f64 = 1.438_776_877e7;

/// A measured spectrum: straight between the values measured, and constant beyond the first and the last. That of a light is
/// relative to D65.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// At every nanometre of the visible.
    values: Vec<f32>,
    rgb: [f32; 3],
}

/// The value at a wavelength of a list of wavelengths, in order, with values.
fn between(measured: &[(f64, f64)], nm: f64) -> f64 {
    let above = measured.partition_point(|(at, _)| *at <= nm);
    match (above.checked_sub(1).map(|i| measured[i]), measured.get(above)) {
        (Some((a, from)), Some(&(b, to))) => from + (to - from) * (nm - a) / (b - a),
        (Some((_, value)), None) => value,
        (None, first) => first.map_or(0.0, |(_, value)| *value),
    }
}

impl Curve {
    /// A reflectance by wavelength, in nanometres and in rising order.
    pub fn share(measured: &[(f64, f64)]) -> Curve {
        Curve::new(|nm| between(measured, nm))
    }

    /// The power of a light by wavelength in any unit, with the luminance that the light has.
    pub fn light(measured: &[(f64, f64)], of_luminance: f64) -> Curve {
        Curve::new(|nm| between(measured, nm) / daylight(nm)).of_luminance(of_luminance)
    }

    /// The light of a black body of a temperature in kelvins (Planck's law).
    pub fn black_body(kelvin: f64, of_luminance: f64) -> Curve {
        const C2: f64 = SECOND_RADIATION_CONSTANT;
        // Relative to 560 nm, where it neither over- nor underflows.
        let power =
            |nm: f64| (560.0 / nm).powi(5) * (C2 / (560.0 * kelvin)).exp_m1() / (C2 / (nm * kelvin)).exp_m1();
        Curve::new(|nm| power(nm) / daylight(nm)).of_luminance(of_luminance)
    }

    /// By a function of the wavelength.
    pub(super) fn new(value: impl Fn(f64) -> f64) -> Curve {
        let values = (0..VALUES).map(|i| value(f64::from(FIRST_NM) + i as f64 * f64::from(STEP_NM)) as f32);
        let curve = Curve { values: values.collect(), rgb: [0.0; 3] };
        let rgb = rgb_of(|nm| curve.at(nm as f32).into()).map(|v| v as f32);
        Curve { rgb, ..curve }
    }

    fn of_luminance(self, wanted: f64) -> Curve {
        let own = f64::from(luminance(self.rgb));
        let scale = if own > 0.0 { (wanted / own) as f32 } else { 0.0 };
        Curve { values: self.values.iter().map(|v| v * scale).collect(), rgb: self.rgb.map(|v| v * scale) }
    }

    /// Its value at a wavelength in nanometres.
    #[inline]
    pub fn at(&self, nm: f32) -> f32 {
        let at = ((nm - FIRST_NM) * (1.0 / STEP_NM)).clamp(0.0, (VALUES - 1) as f32);
        let i = (at as usize).min(VALUES - 2);
        let share = at - i as f32;
        self.values[i] * (1.0 - share) + self.values[i + 1] * share
    }

    /// What it looks like, linear Rec. 709: of a reflectance in daylight. Negative beyond the gamut.
    pub fn rgb(&self) -> [f32; 3] {
        self.rgb
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_straight_between_and_constant_beyond() {
        let curve = Curve::share(&[(400.0, 0.2), (500.0, 0.4), (600.0, 0.0)]);
        for (nm, value) in
            [(380.0, 0.2), (400.0, 0.2), (450.5, 0.301), (500.0, 0.4), (575.0, 0.1), (700.0, 0.0)]
        {
            assert!((curve.at(nm) - value).abs() < 1e-6, "{nm}: {}", curve.at(nm));
        }
    }

    /// The illuminant A (CIE 015: x = 0.44758, y = 0.40745), a black body of 2856 K but for newer constants.
    #[test]
    fn black_bodies_have_their_colour() {
        let a = Curve::black_body(2855.5, 3.0);
        let [r, g, b] = a.rgb().map(f64::from);
        let to = crate::color::Primaries::REC709.xyz_from_rgb().expect("a space");
        let [x, y, z] = to.map(|row| row[0] * r + row[1] * g + row[2] * b);
        assert!((y - 3.0).abs() < 1e-3, "{y}");
        let (x, y) = (x / (x + y + z), y / (x + y + z));
        assert!((x - 0.44758).abs() < 5e-4 && (y - 0.40745).abs() < 5e-4, "{x} {y}");
    }
}
