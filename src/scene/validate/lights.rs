//! Lights without a surface.

use super::findings::{Findings, Place};
use crate::math::{DQuat, DVec3};
use crate::scene::{LightKind, Scene};
use std::f64::consts::PI;
use std::mem::discriminant;

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    for (index, light) in scene.lights.iter().enumerate() {
        let place = Place { list: "lights", index, name: &light.name };
        findings.require_color(&light.intensity, place, "intensity");
        check_kind(&light.kind, place, findings);
        let is_profiled = matches!(light.kind, LightKind::Profiled { .. });
        let is_met = match &light.profile {
            Some(profile) => is_profiled && profile.is_sound(),
            None => !is_profiled,
        };
        findings.require(
            is_met,
            place,
            "profile",
            light.profile.is_some(),
            "a sound one where the kind needs it",
        );
        let Some(moving) = &light.motion else { continue };
        let is_same = moving.all().all(|key| discriminant(key) == discriminant(&light.kind));
        findings.require(is_same, place, "motion", moving.keys.len(), "lights of the same kind");
        moving.all().for_each(|kind| check_kind(kind, place, findings));
    }
    for (index, profile) in scene.profiles.iter().enumerate() {
        let place = Place { list: "profiles", index, name: "" };
        findings.require(profile.is_sound(), place, "values", profile.values.len(), "a sound profile");
    }
}

fn check_kind(kind: &LightKind, place: Place, findings: &mut Findings) {
    match *kind {
        LightKind::Point { position } => check_position(position, place, findings),
        LightKind::Spot { position, direction, inner_angle_rad, outer_angle_rad, .. } => {
            check_position(position, place, findings);
            check_direction(direction, place, findings);
            let (inner, outer) = (inner_angle_rad, outer_angle_rad);
            let is_cone = outer > 0.0 && outer <= PI;
            findings.require(is_cone, place, "outer_angle_rad", outer, "above 0 and at most pi");
            // Said once where the outer angle is no angle.
            let is_inside = (0.0..=if is_cone { outer } else { PI }).contains(&inner);
            findings.require(is_inside, place, "inner_angle_rad", inner, "from 0 to the outer angle");
        }
        LightKind::Profiled { position, rotation, cone } => {
            check_position(position, place, findings);
            check_aim(rotation, cone, place, findings);
        }
        LightKind::Directional { direction } => check_direction(direction, place, findings),
        LightKind::Sun { direction, angle_rad } => {
            check_direction(direction, place, findings);
            let is_met = (LEAST_SUN_RAD..=PI).contains(&angle_rad);
            findings.require(is_met, place, "angle_rad", angle_rad, "from 1e-5 to pi");
        }
    }
}

/// How a profile is turned and cut.
pub(super) fn check_aim(rotation: DQuat, cone: Option<[f64; 2]>, place: Place, findings: &mut Findings) {
    findings.require(rotation.is_normalized(), place, "rotation", rotation, "a unit quaternion");
    let [inner, outer] = cone.unwrap_or([0.0, 1.0]);
    let is_cone = 0.0 <= inner && inner <= outer && outer > 0.0 && outer <= PI;
    findings.require(is_cone, place, "cone", outer, "angles of which the outer is above 0 and at most pi");
}

/// Smaller suns are no different from parallel light, but for rounding.
const LEAST_SUN_RAD: f64 = 1e-5;

fn check_position(position: DVec3, place: Place, findings: &mut Findings) {
    findings.require(position.is_finite(), place, "position", position, "finite");
}

fn check_direction(direction: DVec3, place: Place, findings: &mut Findings) {
    let is_met = direction.try_normalize().is_some();
    findings.require(is_met, place, "direction", direction, "a finite vector of a length above 0");
}
