//! Paths from the camera leave to those from lamps what these take.

use super::super::Integrator;
use super::super::shading_geometry::bent_normal;
use super::super::shading_groups::SortedVertices;
use super::super::wave::{Vertices, get};
use super::super::workspace::Workspace;
use crate::compile::Role;
use crate::math::Vec3;
use crate::shape::Surface;

// What a path's chain tells of where it came from, and in higher bits of where it goes on.

/// It came by a surface that catches light, the first that it met, and then by such ones and by ones that send it on.
const CAME: u32 = 1;
/// And the last of them sends light on.
const CAME_BY_SENDER: u32 = 2;
/// How many bits these are.
const BITS: u32 = 2;
/// The same with the surface where it is.
const GOES: u32 = CAME << BITS;
const GOES_BY_SENDER: u32 = CAME_BY_SENDER << BITS;

impl Integrator<'_> {
    /// Paths arrive: what held where they are going holds where they came.
    pub(in super::super) fn arrive_in_chains(&self, w: &mut Workspace) {
        if self.parts.chains {
            w.arriving.chains[..w.rays.len()].iter_mut().for_each(|chain| *chain >>= BITS);
        }
    }

    /// Goes on with what paths carry along, by the materials that they hit.
    pub(in super::super) fn follow_chains(&self, bounce: u32, w: &mut Workspace) {
        let Some(plan) = self.options.caustics else { return };
        for (i, hit) in w.hits.iter().enumerate() {
            let role = if hit.is_hit() { plan.role(w.materials[i]) } else { Role::Neither };
            let chain = &mut w.arriving.chains[i];
            let came = *chain & (CAME | CAME_BY_SENDER);
            let is_taken = bounce == 0 || came != 0;
            *chain = match role {
                Role::Catches if is_taken => came | GOES,
                Role::Sends if came != 0 => came | GOES | GOES_BY_SENDER,
                _ => came,
            };
        }
    }

    /// Where the normal of a surface was bent for the viewer, paths from lamps don't know it.
    pub(in super::super) fn end_chain_if_bent(
        &self,
        bounce: u32,
        i: usize,
        surface: &Surface,
        wo: Vec3,
        chains: &mut [u32],
    ) {
        if bounce >= 1
            && self.scene.features.bent_normals
            && chains[i] & GOES_BY_SENDER != 0
            && bent_normal(surface.ns, surface.ng, wo).1
        {
            chains[i] &= !(GOES | GOES_BY_SENDER);
        }
    }

    /// The same for sorted vertices whose normals are bent already.
    pub(in super::super) fn end_bent_chains(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if bounce >= 1 && self.parts.chains && self.scene.features.bent_normals {
            for i in sorted.metal_rough() {
                let chain = &mut w.wave.paths.chains[i];
                if w.wave.vertices.is_bent[i] != 0.0 && *chain & GOES_BY_SENDER != 0 {
                    *chain &= !(GOES | GOES_BY_SENDER);
                }
            }
        }
    }

    /// Where paths went on in ways that those from lamps don't take.
    pub(in super::super) fn end_stretched_chains(
        &self,
        bounce: u32,
        sorted: &SortedVertices,
        w: &mut Workspace,
    ) {
        if bounce >= 1 && self.parts.chains && self.scene.features.bent_normals {
            for i in sorted.all() {
                let is_sender = w.wave.paths.chains[i] & GOES_BY_SENDER != 0;
                if is_sender && is_stretched_at(&w.wave.vertices, i, get(&w.wave.vertices.next_direction, i))
                {
                    w.wave.paths.chains[i] &= !(GOES | GOES_BY_SENDER);
                }
            }
        }
    }

    /// Is light of a lamp that arriving path `i` has found left to paths from lamps?
    #[inline(always)]
    pub(in super::super) fn is_left_to_lamps(
        &self,
        bounce: u32,
        i: usize,
        light: Option<u32>,
        w: &Workspace,
    ) -> bool {
        let Some(plan) = self.options.caustics else { return false };
        bounce >= 2
            && w.arriving.chains[i] & CAME_BY_SENDER != 0
            && light.is_some_and(|light| plan.takes(light))
    }

    /// Takes back the light samples that are left to paths from lamps.
    pub(in super::super) fn leave_light_samples(
        &self,
        bounce: u32,
        sorted: &SortedVertices,
        w: &mut Workspace,
    ) {
        let Some(plan) = self.options.caustics.filter(|_| bounce >= 1) else { return };
        let (chains, v) = (&w.wave.paths.chains, &mut w.wave.vertices);
        for i in sorted.lit() {
            let is_left =
                chains[i] & GOES_BY_SENDER != 0 && plan.takes(self.only_light.unwrap_or(v.light.index[i]));
            if is_left && !is_stretched_at(v, i, get(&v.light.wi, i)) {
                v.light.pdf[i] = 0.0;
            }
        }
    }
}

/// Does a path with this chain at a surface leave light to paths from lamps that the next surface scatters?
#[inline(always)]
pub(in super::super) fn leaves_light(chain: u32) -> bool {
    chain & GOES != 0
}

/// Largest [`stretch`] of the light that paths from lamps take.
const MOST_STRETCH: f32 = 3.0;

/// By how much more a path from a lamp counts, beside one from the camera, behind a surface that is shaded with `ns` and sends
/// light from `wi` to `wo` (Veach 1997, section 5.3). 1 where the normals are the same. Few paths from lamps meet a surface
/// at grazing angles, and each counts much where `ns` does not lie so: the variance of that has no bound.
fn stretch(ns: Vec3, ng: Vec3, wo: Vec3, wi: Vec3) -> f32 {
    ((wi.dot(ns) * wo.dot(ng)) / (wo.dot(ns) * wi.dot(ng))).abs()
}

/// Is light from `wi` to `wo` left to paths from the camera?
pub(super) fn is_stretched(ns: Vec3, ng: Vec3, wo: Vec3, wi: Vec3) -> bool {
    ns != ng && stretch(ns, ng, wo, wi) > MOST_STRETCH
}

fn is_stretched_at(v: &Vertices, i: usize, wi: Vec3) -> bool {
    is_stretched(get(&v.ns, i), get(&v.ng, i), get(&v.wo, i), wi)
}
