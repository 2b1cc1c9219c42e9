//! Lights that are linked to some objects only: what they light, and what casts shadows in their light.
//!
//! The last vertex of a path is what receives light, found by light samples or by the path's next ray, in mirrors, too. For each
//! class of receivers light samples choose among the lights that are linked to it.
//!
//! Where a light's blockers are named, its shadow rays pass all else. Scattered rays, which nothing lets pass, would find
//! another amount of its light: so it is left to light samples, but for mirrors and cameras, which show it as it stands.

use super::Integrator;
use super::wave::{LightLanes, Paths};
use super::workspace::Workspace;
use crate::compile::{CompiledMaterial, MOST_CLASSES};
use crate::math::Hit;
use crate::scene::{LightLinks, Link};

/// Where the class of receivers begins in the words that tell of the kinds of rays.
const CLASS_SHIFT: u32 = 17;
/// What those words hold besides.
const OTHERS: u32 = (1 << CLASS_SHIFT) - 1;
const _: () = assert!(MOST_CLASSES <= 1 << (u32::BITS - CLASS_SHIFT));

/// A word with the class of another one.
pub(super) fn with_class_of(word: u32, other: u32) -> u32 {
    word & OTHERS | other & !OTHERS
}

/// The class of the vertex of path `i`, or of that where its ray began.
#[inline(always)]
pub(super) fn class(i: usize, paths: &Paths, are_linked: bool) -> u32 {
    if are_linked { paths.kinds[i] >> CLASS_SHIFT } else { 0 }
}

impl Integrator<'_> {
    /// Takes down the class of vertex `k`, which arriving path `i` found.
    pub(super) fn keep_class(&self, i: usize, k: usize, w: &mut Workspace) {
        let class = if w.hits[i].is_hit() { self.scene.links.class_of(w.materials[i]) } else { 0 };
        let kinds = &mut w.wave.paths.kinds[k];
        *kinds = *kinds & OTHERS | class << CLASS_SHIFT;
    }

    /// Does emission with such links reach what arriving path `i` came from, and is it left to its ray?
    pub(super) fn finds_linked(&self, bounce: u32, i: usize, links: LightLinks, arriving: &Paths) -> bool {
        if bounce == 0 || links == LightLinks::ALL {
            return true;
        }
        let is_left_to_samples = !links.blockers.is_all() && arriving.carried.pdf[i] > 0.0;
        !is_left_to_samples && self.scene.links.reach(links, class(i, arriving, true))
    }

    /// The links of what a material emits. Light samples pass what casts no shadow, but not all surfaces are sampled.
    pub(super) fn links_of(&self, material: &CompiledMaterial, is_sampled: bool) -> LightLinks {
        match (self.scene.features.links, is_sampled) {
            (false, _) => LightLinks::ALL,
            (true, true) => material.links(),
            (true, false) => LightLinks { blockers: Link::All, ..material.links() },
        }
    }

    /// Is the light of the sample of vertex `i` there, and linked to it?
    pub(super) fn is_lit_by(&self, i: usize, w: &Workspace) -> bool {
        let index = self.only_light.unwrap_or(w.wave.vertices.light.index[i]);
        let is_left_out = w.without && self.scene.is_caught_light(index);
        let class = class(i, &w.wave.paths, self.scene.features.links);
        !is_left_out && self.scene.links.reach(self.scene.links.of_light(index), class)
    }

    /// Does what the shadow ray of a vertex hit cast no shadow in the light of its sample?
    #[inline(always)]
    pub(super) fn lets_pass(&self, vertex: u32, hit: &Hit, light: &LightLanes) -> bool {
        self.scene.features.links && {
            let index = self.only_light.unwrap_or_else(|| light.index[vertex as usize]);
            let links = self.scene.links.of_light(index);
            !self.scene.links.block(links, self.scene.geometries.material(hit))
        }
    }
}
