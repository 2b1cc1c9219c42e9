//! Checks that a scene can be compiled: that its lists refer to each other correctly, and that its numbers are such that
//! the stages after them need no checks. Loaders run it last, and `compile` first, so scenes that were built in code get
//! the same answers as files.
//!
//! What is repaired on the way to a picture is no problem here: shares beyond 0..1 (clamped), normals of any length
//! (normalised), primitives without area or farther away than 1e18 m and placements that flatten (left out, with a warning).

mod cameras;
mod curves;
mod environment;
mod findings;
mod groups;
mod images;
mod lights;
mod materials;
mod media;
mod meshes;
mod motion;
mod objects;
mod settings;
#[cfg(test)]
mod tests;
mod textures;

use super::{Camera, Scene};
use crate::error::Problem;
use findings::Findings;

impl Scene {
    /// Everything that is wrong with the scene: broken references and impossible numbers, each with the place
    /// (`lights[3] 'lamp', intensity`), what is there and what is allowed. Problems of one kind are listed a few times,
    /// then counted. An empty list means that the scene compiles, unless it has more triangles or vertices than can be
    /// addressed.
    pub fn validate(&self) -> Vec<Problem> {
        let mut findings = Findings::default();
        meshes::check(self, &mut findings);
        objects::check(self, &mut findings);
        curves::check(self, &mut findings);
        materials::check(self, &mut findings);
        textures::check(self, &mut findings);
        images::check(self, &mut findings);
        lights::check(self, &mut findings);
        environment::check(self, &mut findings);
        media::check(self, &mut findings);
        groups::check(self, &mut findings);
        motion::check(self, &mut findings);
        for (i, camera) in self.cameras.iter().enumerate() {
            cameras::check(camera, i, &mut findings);
        }
        settings::check(&self.settings, &mut findings);
        findings.into_problems()
    }
}

impl Camera {
    /// The same for a camera that is in no scene.
    pub fn validate(&self) -> Vec<Problem> {
        let mut findings = Findings::default();
        cameras::check(self, 0, &mut findings);
        findings.into_problems()
    }
}
