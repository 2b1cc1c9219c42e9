//! Lights that are linked to some objects only: what they light, and what casts shadows in their light.
//!
//! The last vertex of a path is what receives light, found by light samples or by the path's next ray, in mirrors, too. For each
//! class of receivers light samples choose among the lights that are linked to it.
//!
//! Where a light's blockers are named, its shadow rays pass all else. Scattered rays, which nothing lets pass, would find
//! another amount of its light: so it is left to light samples, but for mirrors and cameras, which show it as it stands.

use super::Integrator;
use super::lanes::get;
use super::wave::Paths;
use super::workspace::Workspace;
use crate::compile::{CompiledMaterial, MOST_CLASSES};
use crate::light::Receiver;
use crate::math::{Hit, Vec3};
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
    /// The receiver where the ray of arriving path `i` began.
    #[inline(always)]
    pub(super) fn receiver(&self, i: usize, p: Vec3, arriving: &Paths) -> Receiver {
        let normal = get(&arriving.receiver_normal, i);
        Receiver { p, normal, class: class(i, arriving, self.scene.features.links) }
    }

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

    /// Does the light of the sample of vertex `i` light it?
    #[inline(always)]
    pub(super) fn is_lit_by(&self, i: usize, light: u32, paths: &Paths) -> bool {
        !self.scene.features.links || {
            let links = self.scene.links.of_light(light);
            self.scene.links.reach(links, class(i, paths, true))
        }
    }

    /// Does what a shadow ray to a light hit cast no shadow in its light?
    #[inline(always)]
    pub(super) fn lets_pass(&self, light: u32, hit: &Hit) -> bool {
        self.scene.features.links && {
            let links = self.scene.links.of_light(light);
            !self.scene.links.block(links, self.scene.geometries.material(hit))
        }
    }
}
