//! Light of black bodies of any temperature, relative to one.

use crate::color::luminance;
use crate::color::spectral::{Curve, SECOND_RADIATION_CONSTANT, rgb_of};
use crate::math::poly;

const C2: f32 = SECOND_RADIATION_CONSTANT as f32;

/// The light of black bodies by Planck's law, relative to D65 and to the luminance of one of a reference temperature.
#[derive(Clone, Debug, PartialEq)]
pub struct BlackBodies {
    reference: Curve,
    kelvin: f32,
}

/// 1 / (exp(x) - 1).
fn occupation(x: f32) -> f32 {
    // The polynomial ends at the least normal number.
    if x > 87.0 { 0.0 } else { poly::exp(-x) / (1.0 - poly::exp(-x)).max(f32::MIN_POSITIVE) }
}

impl BlackBodies {
    /// Cooler ones, of which next to nothing is seen, have the colour of this, in kelvins.
    pub const COOLEST: f32 = 800.0;

    /// Those whose luminance is 1 at a temperature in kelvins.
    pub fn relative_to(kelvin: f32) -> BlackBodies {
        BlackBodies { reference: Curve::black_body(kelvin.into(), 1.0), kelvin }
    }

    /// At a wavelength in nanometres and a temperature in kelvins; nothing at 0.
    #[inline]
    pub fn at(&self, nm: f32, kelvin: f32) -> f32 {
        if kelvin <= 0.0 {
            return 0.0;
        }
        self.reference.at(nm) * (occupation(C2 / (nm * kelvin)) / occupation(C2 / (nm * self.kelvin)))
    }

    /// What takes one of a temperature to a luminance that goes by the fourth power of the temperature, 1 at the reference; beside
    /// [`BlackBodies::at`] of the same temperature, or of `COOLEST` below that.
    pub fn power_over_luminance(&self, kelvin: f32) -> f32 {
        let seen = kelvin.max(BlackBodies::COOLEST);
        let luminance = luminance(rgb_of(|nm| f64::from(self.at(nm as f32, seen))).map(|v| v as f32));
        (kelvin / self.kelvin).powi(4) / luminance
    }

    /// What one of a temperature looks like, linear Rec. 709; what is beyond the gamut is 0.
    pub fn rgb(&self, kelvin: f32) -> [f32; 3] {
        rgb_of(|nm| f64::from(self.at(nm as f32, kelvin))).map(|v| v.max(0.0) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_that_of_curves_and_grows_by_planck() {
        let bodies = BlackBodies::relative_to(1500.0);
        for kelvin in [900.0, 1500.0, 2500.0, 6500.0] {
            let curve = Curve::black_body(kelvin, 1.0);
            let own =
                luminance(rgb_of(|nm| f64::from(bodies.at(nm as f32, kelvin as f32))).map(|v| v as f32));
            for nm in [420.0, 507.0, 561.0, 650.0] {
                let ratio = bodies.at(nm, kelvin as f32) / own / curve.at(nm);
                assert!((ratio - 1.0).abs() < 1e-3, "{kelvin} K, {nm} nm: {ratio}");
            }
        }
        // Radiances at one wavelength: exp(C2 / (l T)) decides.
        let c2 = SECOND_RADIATION_CONSTANT;
        let wanted = (c2 / (600.0 * 1500.0)).exp_m1() / (c2 / (600.0 * 2000.0)).exp_m1();
        let found = bodies.at(600.0, 2000.0) / bodies.at(600.0, 1500.0);
        assert!((f64::from(found) / wanted - 1.0).abs() < 1e-5, "{found} {wanted}");
        assert_eq!(bodies.at(600.0, 0.0), 0.0);
        for (kelvin, seen, wanted) in [(1500.0, 1500.0, 1.0), (3000.0, 3000.0, 16.0), (150.0, 800.0, 1e-4)] {
            let own = luminance(rgb_of(|nm| f64::from(bodies.at(nm as f32, seen))).map(|v| v as f32));
            let power = bodies.power_over_luminance(kelvin) * own;
            assert!((power / wanted - 1.0).abs() < 1e-3, "{kelvin} K: {power}");
        }
        assert!(bodies.at(780.0, 1e6).is_finite() && bodies.at(380.0, 1.0) == 0.0);
    }
}
