//! Light of black bodies of any temperature, relative to one.

use super::curve::C2;
use super::wavelengths::{FIRST_NM, LAST_NM, daylight, rgb_of};
use crate::color::luminance;
use crate::math::poly;

/// Relative to a wavelength where nothing over- or underflows, nanometres.
const MIDDLE_NM: f32 = 560.0;
const STEP_NM: f32 = 5.0;
const NODES: usize = ((LAST_NM - FIRST_NM) / STEP_NM) as usize + 1;

/// The light of black bodies by Planck's law, relative to D65 and to the luminance of one of a reference temperature.
#[derive(Clone, Debug, PartialEq)]
pub struct BlackBodies {
    /// What the exponential of a wavelength is taken times, every few nanometres.
    scale: [f32; NODES],
}

/// 1 / (exp(x) - 1).
fn occupation(x: f32) -> f32 {
    // The polynomial ends at the least normal number.
    if x > 87.0 { 0.0 } else { poly::exp(-x) / (1.0 - poly::exp(-x)).max(f32::MIN_POSITIVE) }
}

impl BlackBodies {
    /// Those whose luminance is 1 at a temperature in kelvins.
    pub fn relative_to(kelvin: f64) -> BlackBodies {
        let power =
            |nm: f64| (f64::from(MIDDLE_NM) / nm).powi(5) / (C2 / (nm * kelvin)).exp_m1() / daylight(nm);
        let own = f64::from(luminance(rgb_of(power).map(|v| v as f32)));
        let node = |i: usize| {
            let nm = f64::from(FIRST_NM) + f64::from(STEP_NM) * i as f64;
            ((f64::from(MIDDLE_NM) / nm).powi(5) / daylight(nm) / own) as f32
        };
        BlackBodies { scale: std::array::from_fn(node) }
    }

    /// At a wavelength in nanometres and a temperature in kelvins; nothing at 0.
    #[inline]
    pub fn at(&self, nm: f32, kelvin: f32) -> f32 {
        let at = ((nm - FIRST_NM) * (1.0 / STEP_NM)).clamp(0.0, (NODES - 1) as f32);
        let i = (at as usize).min(NODES - 2);
        let share = at - i as f32;
        let scale = self.scale[i] * (1.0 - share) + self.scale[i + 1] * share;
        if kelvin > 0.0 { scale * occupation(C2 as f32 / (nm * kelvin)) } else { 0.0 }
    }

    /// What one of a temperature looks like, linear Rec. 709; what is beyond the gamut is 0.
    pub fn rgb(&self, kelvin: f32) -> [f32; 3] {
        rgb_of(|nm| f64::from(self.at(nm as f32, kelvin))).map(|v| v.max(0.0) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::super::curve::Curve;
    use super::*;

    #[test]
    fn light_is_that_of_curves_and_grows_by_planck() {
        let bodies = BlackBodies::relative_to(1500.0);
        for kelvin in [900.0, 1500.0, 2500.0, 6500.0] {
            let curve = Curve::black_body(kelvin, 1.0);
            let own = luminance(bodies.rgb(kelvin as f32));
            for nm in [420.0, 507.0, 561.0, 650.0] {
                let ratio = bodies.at(nm, kelvin as f32) / own / curve.at(nm);
                // Between nodes D65 is straight, and so is its inverse here: nearly.
                assert!((ratio - 1.0).abs() < 1.5e-2, "{kelvin} K, {nm} nm: {ratio}");
            }
        }
        assert!((luminance(bodies.rgb(1500.0)) - 1.0).abs() < 5e-3);
        // Radiances at one wavelength: exp(C2 / (l T)) decides.
        let wanted = (C2 / (600.0 * 1500.0)).exp_m1() / (C2 / (600.0 * 2000.0)).exp_m1();
        let found = bodies.at(600.0, 2000.0) / bodies.at(600.0, 1500.0);
        assert!((f64::from(found) / wanted - 1.0).abs() < 1e-5, "{found} {wanted}");
        assert_eq!(bodies.at(600.0, 0.0), 0.0);
        assert!(bodies.at(780.0, 1e6).is_finite() && bodies.at(380.0, 1.0) == 0.0);
    }
}
