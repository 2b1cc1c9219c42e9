//! What is decided about caustics before paths are traced.

use crate::compile::{CompiledScene, Role};
use crate::light::Emission;

/// Which light is left to paths from lamps, and how these start.
#[derive(Clone, Debug)]
pub struct CausticPlan {
    /// Role of each material.
    pub(super) roles: Vec<Role>,
    /// The lights before this one are lamps, of which light is left to these paths; the environment follows.
    pub(super) lamps: u32,
    /// How light leaves them.
    pub(super) emission: Emission,
    /// Seed of these paths.
    pub(super) seed: u32,
    /// How many stand for one sample of each pixel.
    pub(super) paths: u32,
}

impl CausticPlan {
    /// For a scene; `None` if it has no lamps, or nothing that sends their light on.
    pub fn new(scene: &CompiledScene, seed: u32, paths: u32) -> Option<CausticPlan> {
        let roles = scene.roles();
        let targets = scene.targets(&roles);
        let lamps = (scene.lights.area().len() + scene.lights.punctual().len()) as u32;
        let emission = Emission::new(&scene.lights, &scene.textures, targets, scene.reach())?;
        Some(CausticPlan { roles, lamps, emission, seed, paths: paths.max(1) })
    }

    /// The same with another number of paths.
    #[must_use]
    pub fn with_paths(self, paths: u32) -> CausticPlan {
        CausticPlan { paths: paths.max(1), ..self }
    }

    /// How many paths stand for one sample of each pixel.
    pub fn paths(&self) -> u32 {
        self.paths
    }

    /// Is light of this lamp taken?
    #[inline(always)]
    pub(super) fn takes(&self, light: u32) -> bool {
        light < self.lamps
    }

    /// Role of a material.
    #[inline(always)]
    pub(super) fn role(&self, material: u32) -> Role {
        self.roles[material as usize]
    }
}
