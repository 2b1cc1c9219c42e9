//! What fills spaces: fog and the insides of solids.

use super::findings::Findings;
use crate::scene::{Fog, Medium, Scene};
use std::fmt::Display;

/// Flights in denser media are shorter than positions are precise.
const MOST_EXTINCTION: f32 = 1e9;

pub(super) fn check_medium(medium: &Medium, place: impl Display + Copy, findings: &mut Findings) {
    let is_met = medium.extinction.iter().all(|x| (0.0..=MOST_EXTINCTION).contains(x));
    findings.require(is_met, place, "extinction", medium.extinction, "numbers from 0 to 1e9 per metre");
    let is_met = medium.albedo.iter().all(|x| (0.0..=1.0).contains(x));
    findings.require(is_met, place, "albedo", medium.albedo, "numbers from 0 to 1");
    let is_met = medium.anisotropy.abs() < 1.0;
    findings.require(is_met, place, "anisotropy", medium.anisotropy, "above -1 and below 1");
    findings.require_color(&medium.emission, place, "emission");
}

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    const PLACE: &str = "fog";
    let Some(Fog { medium, center, radius }) = &scene.fog else { return };
    check_medium(medium, PLACE, findings);
    findings.require(center.is_finite(), PLACE, "center", center, "finite numbers");
    let is_met = *radius > 0.0;
    findings.require(is_met, PLACE, "radius", radius, "above 0, or infinite");
    let channels = medium.emission.iter().zip(&medium.extinction);
    let is_bounded = radius.is_finite() || channels.into_iter().all(|(e, x)| *e == 0.0 || *x > 0.0);
    findings.require(is_bounded, PLACE, "emission", medium.emission, "0 where fog without an end is clear");
}
