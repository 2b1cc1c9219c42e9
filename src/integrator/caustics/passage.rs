//! Light from lamps among surfaces that may be absent. A ray of light goes the way of a ray from the camera, in the other
//! direction: what that one meets from behind, light meets from the front. So it both arrives at the front of a one-sided
//! surface and goes on behind it, where paths from the camera come from behind; it ends at the back.

use super::super::Integrator;
use super::super::workspace::Workspace;
use crate::compile::Presence;
use crate::math::{Hit, Ray};
use crate::sampling::hash::{hash32, unit};
use crate::scene::RayKinds;

/// What light does at a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passage {
    /// It goes on as if nothing was there.
    pub passes: bool,
    /// It meets the surface.
    pub meets: bool,
}

/// Nothing moves where light is followed from lamps.
pub(super) const STILL: f32 = 0.0;

impl Integrator<'_> {
    /// What light does where its ray hit; `salt` decides whether partly transparent surfaces are there.
    pub(super) fn passage(&self, ray: &Ray, hit: &Hit, salt: u32, is_seen: bool) -> Passage {
        let index = self.scene.geometries.material(hit) as usize;
        if !self.may_be_absent[index] {
            return Passage { passes: false, meets: true };
        }
        let material = &self.scene.materials[index];
        let is_seen_as_such = |presence: Presence| {
            presence.is_obstacle && (!is_seen || presence.visible_to.contains(RayKinds::CAMERA))
        };
        let is_present = material.presence.is_none_or(is_seen_as_such)
            && unit(hash32(salt)) < self.presence(ray, hit, STILL, material);
        if !material.is_absent_from_behind {
            return Passage { passes: !is_present, meets: is_present };
        }
        let is_front = !self.scene.geometries.is_back(ray, hit, STILL);
        Passage { passes: is_front || !is_present, meets: is_front && is_present }
    }

    /// Takes a ray of light past a surface. Behind the front of a one-sided sheet, what lies at the same place still counts:
    /// another sheet that is turned away from it.
    pub(super) fn past(&self, ray: &Ray, hit: &Hit) -> Ray {
        let is_another = hit.t > ray.t_min.next_up();
        if is_another && self.scene.geometries.is_back_of_flat(ray, hit, STILL) == Some(false) {
            return Ray { t_min: hit.t.next_down(), origin_primitive: hit.into(), ..*ray };
        }
        Ray { t_min: hit.t, ..*ray }
    }

    /// Which of some segments intersect something, with `are_seen` on their way to the camera; `salts` decide about partly
    /// transparent surfaces.
    pub(super) fn blocked(
        &self,
        segments: &[Ray],
        salts: &[u32],
        are_seen: bool,
        w: &mut Workspace,
    ) -> Vec<bool> {
        let mut blocked = vec![false; segments.len()];
        w.ray_counts.all += segments.len() as u64;
        if !self.scene.features.alpha {
            self.scene.accel.occluded(segments, &mut blocked);
            return blocked;
        }
        let mut pending: Vec<(usize, Ray)> = segments.iter().copied().enumerate().collect();
        let mut hits = Vec::new();
        for pass in 0..MOST_PASSES {
            let rays: Vec<Ray> = pending.iter().map(|(_, ray)| *ray).collect();
            hits.clear();
            hits.resize(rays.len(), Hit::MISS);
            self.scene.accel.closest(&rays, &mut hits);
            let mut next = Vec::new();
            for ((k, ray), hit) in pending.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
                let salt = hash32(salts[*k].wrapping_add(pass));
                match self.passage(ray, hit, salt, are_seen).passes {
                    true => next.push((*k, self.past(ray, hit))),
                    false => blocked[*k] = true,
                }
            }
            w.ray_counts.all += next.len() as u64;
            if next.is_empty() {
                break;
            }
            pending = next;
        }
        blocked
    }
}

/// Surfaces in a row that light may pass; a guard against endless stacks.
pub(super) const MOST_PASSES: u32 = 4096;
