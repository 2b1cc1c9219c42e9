//! Smooth spectra between 0 and 1.

use super::wavelengths::{FIRST_NM, LAST_NM};

const MIDDLE_NM: f32 = 0.5 * (FIRST_NM + LAST_NM);
const HALF_NM: f32 = 0.5 * (LAST_NM - FIRST_NM);

/// A sigmoid of a polynomial of degree two (Jakob, Hanika 2019, equations 4 and 5): 1/2 + x / (2 sqrt(1 + x^2)) with
/// x = a t^2 + b t + c, where t goes from -1 to 1 over the visible wavelengths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sigmoid(pub [f32; 3]);

impl Sigmoid {
    /// Its value at a wavelength, 0..1.
    #[inline(always)]
    pub fn at(&self, nm: f32) -> f32 {
        let [a, b, c] = self.0;
        let t = (nm - MIDDLE_NM) * (1.0 / HALF_NM);
        let x = (a * t + b) * t + c;
        // Without a difference of nearly equal numbers where it is dark.
        let s = (1.0 + x * x).sqrt();
        let tail = 0.5 / (s * (s + x.abs()));
        if x < 0.0 { tail } else { 1.0 - tail }
    }
}

/// The place of a wavelength between -1 and 1.
pub(super) fn place(nm: f64) -> f64 {
    (nm - f64::from(MIDDLE_NM)) / f64::from(HALF_NM)
}
