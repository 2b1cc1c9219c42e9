//! Checks that a scene can be compiled: that its lists refer to each other correctly, and that its numbers are such that
//! the stages after them need no checks. Loaders run it last, and `compile` first, so scenes that were built in code get
//! the same answers as files.
//!
//! What is repaired on the way to a picture is no problem here: shares beyond 0..1 (clamped), normals of any length
//! (normalised), primitives without area or farther away than 1e18 m and placements that flatten (left out, with a warning).

mod findings;
mod geometry;
mod lights;
mod materials;
#[cfg(test)]
mod tests;

use super::{BounceLimits, Camera, Clamp, Scene, Settings};
use crate::error::Problem;
use findings::Findings;

impl Scene {
    /// Everything that is wrong with the scene: broken references and impossible numbers, each with the place
    /// (`lights[3] 'lamp', intensity`), what is there and what is allowed. Problems of one kind are listed a few times,
    /// then counted. An empty list means that the scene compiles, unless it has more triangles or vertices than can be
    /// addressed.
    pub fn validate(&self) -> Vec<Problem> {
        let mut findings = Findings::default();
        geometry::check_meshes(self, &mut findings);
        geometry::check_objects(self, &mut findings);
        geometry::check_curves(self, &mut findings);
        materials::check_materials(self, &mut findings);
        materials::check_textures(self, &mut findings);
        materials::check_images(self, &mut findings);
        lights::check_lights(self, &mut findings);
        lights::check_environment(self, &mut findings);
        materials::check_media(self, &mut findings);
        lights::check_groups(self, &mut findings);
        geometry::check_motion(self, &mut findings);
        for (i, camera) in self.cameras.iter().enumerate() {
            lights::check_camera(camera, i, &mut findings);
        }
        check_settings(&self.settings, &mut findings);
        findings.into_problems()
    }
}

impl Camera {
    /// [`Scene::validate`] for a camera outside a scene.
    pub fn validate(&self) -> Vec<Problem> {
        let mut findings = Findings::default();
        lights::check_camera(self, 0, &mut findings);
        findings.into_problems()
    }
}

// Settings of rendering.

const PLACE: &str = "settings";

fn check_settings(settings: &Settings, findings: &mut Findings) {
    let counts = [("width", settings.width), ("height", settings.height), ("samples", settings.samples)];
    for (field, count) in counts {
        if let Some(count) = count {
            findings.require(count > 0, PLACE, field, count, "at least 1");
        }
    }
    for (field, value) in [("noise", settings.noise), ("white_balance", settings.white_balance)] {
        if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
            findings.require(false, PLACE, field, value, "a number above 0");
        }
    }
    if let Some(BounceLimits { diffuse, glossy, transmission, volume }) = settings.bounces {
        for (field, limit) in [
            ("bounces.diffuse", diffuse),
            ("bounces.glossy", glossy),
            ("bounces.transmission", transmission),
            ("bounces.volume", volume),
        ] {
            findings.require(limit > 0, PLACE, field, limit, "at least 1");
        }
    }
    if let Some(Clamp { direct, indirect }) = settings.clamp {
        for (field, limit) in [("clamp.direct", direct), ("clamp.indirect", indirect)] {
            findings.require(limit > 0.0, PLACE, field, limit, "a number above 0");
        }
    }
    if let Some(strength) = settings.filter_glossy {
        let is_valid = strength.is_finite() && strength >= 0.0;
        findings.require(is_valid, PLACE, "filter_glossy", strength, "a finite number of at least 0");
    }
    if let Some(exposure) = settings.exposure {
        findings.require(exposure.is_finite(), PLACE, "exposure", exposure, "a finite number");
    }
}
