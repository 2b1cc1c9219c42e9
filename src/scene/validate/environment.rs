//! The environment.

use super::findings::Findings;
use crate::scene::{Backdrop, Environment, Scene};

/// Most texels of an environment's image: tables over it have 32-bit indices.
const MOST_TEXELS: u64 = 1 << 29;

const PLACE: &str = "environment";

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    if let Some(Backdrop::Color(rgb)) = &scene.backdrop {
        findings.require_color(rgb, "backdrop", "Color");
    }
    match &scene.environment {
        Environment::Black => {}
        Environment::Constant(rgb) => findings.require_color(rgb, PLACE, "Constant"),
        Environment::Gradient { nadir, zenith } => {
            findings.require_color(nadir, PLACE, "nadir");
            findings.require_color(zenith, PLACE, "zenith");
        }
        Environment::Image { image, strength, rotation_rad } => {
            let is_met = strength.is_finite() && *strength >= 0.0;
            findings.require(is_met, PLACE, "strength", strength, "a finite number from 0 up");
            let is_met = rotation_rad.is_finite();
            findings.require(is_met, PLACE, "rotation_rad", rotation_rad, "a finite number");
            let Some(map) = scene.images.get(image.index()) else {
                return findings.reject(PLACE, "image", image, "one of the scene's images");
            };
            let texels = u64::from(map.width) * u64::from(map.height);
            let is_met = texels <= MOST_TEXELS;
            findings.require(is_met, PLACE, "texels of the image", texels, "at most 2^29");
        }
    }
}
