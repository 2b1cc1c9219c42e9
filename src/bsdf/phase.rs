//! The phase function of media (Henyey, Greenstein 1941, "Diffuse radiation in the galaxy").
//!
//! Directions point away from the scattering point, `wo` to the previous path vertex, `wi` to the next one. Forward scattering is
//! `wi = -wo`, with a cosine of the scattering angle of 1.

use crate::math::{Frame, Vec3, poly};
use std::f32::consts::PI;

/// |g| below which sampling is isotropic: the inversion divides by g.
const MIN_ANISOTROPY: f32 = 1e-3;

/// Value and solid-angle pdf of the phase function for the cosine of the scattering angle.
#[inline(always)]
pub fn henyey_greenstein(anisotropy: f32, cosine: f32) -> f32 {
    let g = anisotropy;
    // 1 + g^2 - 2 g cosine without cancellation.
    let d = (1.0 - g) * (1.0 - g) + 2.0 * g * (1.0 - cosine);
    let d = if d > 1e-12 { d } else { 1e-12 };
    (1.0 - g * g) / (4.0 * PI * d * d.sqrt())
}

/// Samples `wi` by two random numbers in 0..1, with the pdf [`henyey_greenstein`].
#[inline(always)]
pub fn sample_henyey_greenstein(anisotropy: f32, wo: Vec3, u: [f32; 2]) -> Vec3 {
    let g = anisotropy;
    let cosine = if g.abs() < MIN_ANISOTROPY {
        1.0 - 2.0 * u[0]
    } else {
        let s = (1.0 - g * g) / (1.0 - g + 2.0 * g * u[0]);
        (1.0 + g * g - s * s) / (2.0 * g)
    };
    direction_around(-wo, cosine.clamp(-1.0, 1.0), u[1])
}

/// The direction at a cosine (-1..1) to a unit axis, with an azimuth in turns.
#[inline(always)]
pub fn direction_around(axis: Vec3, cosine: f32, turns: f32) -> Vec3 {
    let sine = (1.0 - cosine * cosine).sqrt();
    let (sin_phi, cos_phi) = poly::sin_cos_turns(turns);
    Frame::from_normal(axis).to_world(Vec3::new(sine * cos_phi, sine * sin_phi, cosine))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integral_is_one_and_mean_cosine_is_the_anisotropy() {
        for g in [-0.95f32, -0.5, 0.0, 0.3, 0.8, 0.95] {
            let n = 2_000_000;
            let (mut integral, mut mean) = (0.0, 0.0);
            for i in 0..n {
                let cosine = (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
                let value = f64::from(henyey_greenstein(g, cosine as f32)) * 4.0 * std::f64::consts::PI;
                integral += value / f64::from(n);
                mean += value * cosine / f64::from(n);
            }
            assert!(
                (integral - 1.0).abs() < 1e-4 && (mean - f64::from(g)).abs() < 1e-4,
                "{g}: {integral} {mean}"
            );
        }
    }
}
