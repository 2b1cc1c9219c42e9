//! The environment.

use super::findings::{Findings, Place};
use super::images::DECODED;
use crate::scene::{Backdrop, Environment, LightKind, Scene};

/// Most texels of an environment's image: tables over it have 32-bit indices.
const MOST_TEXELS: u64 = 1 << 29;

/// Places of portals, metres.
const FARTHEST: f64 = 1e18;

const PLACE: &str = "environment";

pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    if let Some(Backdrop::Color(rgb)) = &scene.backdrop {
        findings.require_color(rgb, "backdrop", "Color");
    }
    if let Some(sun) = scene.environment_sun {
        let kind = scene.lights.get(sun as usize).map(|light| light.kind);
        let is_met = matches!(kind, Some(LightKind::Sun { .. }));
        findings.require(is_met, PLACE, "sun", sun, "one of the scene's lights, a sun");
    }
    for (index, portal) in scene.portals.iter().enumerate() {
        let place = Place { list: "portals", index, name: &portal.name };
        let [u, v] = [portal.edge_u, portal.edge_v];
        let is_finite = portal.corner.is_finite() && portal.corner.length() < FARTHEST;
        findings.require(is_finite, place, "corner", portal.corner, "a finite point");
        let is_rectangle = [u, v].iter().all(|e| (1e-9..FARTHEST).contains(&e.length()))
            && u.normalize_or_zero().dot(v.normalize_or_zero()).abs() < 1e-3;
        let rule = "edges at right angles, longer than 0";
        findings.require(is_rectangle, place, "edge_u, edge_v", [u, v], rule);
    }
    check_light(scene, &scene.environment, PLACE, findings);
    if let Some(seen) = &scene.camera_environment {
        check_light(scene, seen, "camera_environment", findings);
    }
}

fn check_light(scene: &Scene, environment: &Environment, place: &'static str, findings: &mut Findings) {
    match environment {
        Environment::Black => {}
        Environment::Constant(rgb) => findings.require_color(rgb, place, "Constant"),
        Environment::Gradient { nadir, zenith } => {
            findings.require_color(nadir, place, "nadir");
            findings.require_color(zenith, place, "zenith");
        }
        Environment::Image { image, strength, rotation_rad } => {
            let is_met = strength.is_finite() && *strength >= 0.0;
            findings.require(is_met, place, "strength", strength, "a finite number from 0 up");
            let is_met = rotation_rad.is_finite();
            findings.require(is_met, place, "rotation_rad", rotation_rad, "a finite number");
            let Some(map) = scene.images.get(image.index()) else {
                return findings.reject(place, "image", image, "one of the scene's images");
            };
            let texels = u64::from(map.width) * u64::from(map.height);
            let is_met = texels <= MOST_TEXELS;
            findings.require(is_met, place, "texels of the image", texels, "at most 2^29");
            findings.require(!map.is_encoded(), place, "pixels of the image", "encoded", DECODED);
        }
    }
}
