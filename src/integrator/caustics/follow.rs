//! Paths from the camera leave to those from lamps what these take.

use super::super::Integrator;
use super::super::group::{Group, Sorted};
use super::super::normals::bent_normal;
use super::super::workspace::Workspace;
use crate::compile::Role;
use crate::math::Vec3;
use crate::shape::Surface;

/// The path came here by a surface that catches caustics, the first that it met, and then by ones that send light on only.
const CAME: u32 = 1;
/// The same, with the surface where it is.
const GOES: u32 = 2;

impl Integrator<'_> {
    /// Paths arrive: what held where they are going holds where they came.
    pub(in super::super) fn arrive_in_chains(&self, w: &mut Workspace) {
        if self.parts.chains {
            w.arriving.chains[..w.rays.len()].iter_mut().for_each(|chain| *chain >>= 1);
        }
    }

    /// Goes on with what paths carry along, by the materials that they hit.
    pub(in super::super) fn follow_chains(&self, bounce: u32, w: &mut Workspace) {
        let Some(plan) = self.options.caustics else { return };
        for (i, hit) in w.hits.iter().enumerate() {
            let role = if hit.is_hit() { plan.role(w.materials[i]) } else { Role::Neither };
            let chain = &mut w.arriving.chains[i];
            let goes = match bounce {
                0 => role == Role::Catches,
                _ => role == Role::Sends && *chain & CAME != 0,
            };
            *chain = (*chain & CAME) | if goes { GOES } else { 0 };
        }
    }

    /// Where the normal of a perfectly smooth surface was bent for the viewer, paths from lamps don't know it.
    pub(in super::super) fn end_chain_if_bent(
        &self,
        i: usize,
        material: u32,
        surface: &Surface,
        wo: Vec3,
        chains: &mut [u32],
    ) {
        if self.scene.features.bent_normals
            && chains[i] & GOES != 0
            && self.groups[material as usize] == Group::Specular
            && bent_normal(surface.ns, surface.ng, wo).1
        {
            chains[i] &= !GOES;
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
        bounce >= 2 && w.arriving.chains[i] & CAME != 0 && light.is_some_and(|light| plan.takes(light))
    }

    /// Takes back the light samples that are left to paths from lamps.
    pub(in super::super) fn leave_light_samples(&self, bounce: u32, sorted: &Sorted, w: &mut Workspace) {
        let Some(plan) = self.options.caustics.filter(|_| bounce >= 1) else { return };
        let (chains, light) = (&w.wave.paths.chains, &mut w.wave.vertices.light);
        for i in sorted.lit() {
            if chains[i] & GOES != 0 && plan.takes(self.only_light.unwrap_or(light.index[i])) {
                light.pdf[i] = 0.0;
            }
        }
    }
}
