//! Surfaces that are partly absent: rays pass there at random. Unbiased for paths and shadow rays alike. Lamps that stop
//! no light are absent for all rays, which take what they emit along. One-sided surfaces are absent for rays that come
//! from behind: shadow rays start at the eye's side of a path, so that they and scattered rays see the same ones. What
//! smooth thin sheets do is in [`super::sheets`].

use super::Integrator;
use super::lanes::{get_rgb, set_rgb};
use super::surface::HitPoint;
use super::wave::{Vertices, Wave};
use super::workspace::Workspace;
use crate::math::{Hit, Ray};
use crate::sampling::hash::{hash32, unit};
use crate::shape::Surface;

/// Surfaces in a row that a ray may pass; a guard against endless stacks.
const MAX_PASSES: u32 = 4096;

impl Integrator<'_> {
    /// Moves hits on absent surfaces to the next present one, and finds the materials of all.
    pub(super) fn pass_absent_surfaces(&self, bounce: u32, w: &mut Workspace) {
        w.pending.clear();
        w.materials.clear();
        for (i, hit) in w.hits.iter().enumerate() {
            let mut material = 0;
            if hit.is_hit() {
                material = self.scene.geometries.material(hit);
                if self.may_be_absent[material as usize] {
                    w.pending.push(i as u32);
                }
            }
            w.materials.push(material);
        }
        for pass in 0..MAX_PASSES {
            let Workspace { pending, rays, hits, arriving, .. } = &mut *w;
            pending.retain(|&i| {
                let i = i as usize;
                let carried = &mut arriving.carried;
                let salt = hash32(carried.seed[i] ^ hash32(carried.shuffled[i]) ^ (bounce << 16));
                let salt = salt.wrapping_add(pass);
                !self.is_present(&rays[i], &hits[i], bounce == 0, || salt)
                    || self.passes_sheet(i, &rays[i], &hits[i], salt, carried)
            });
            if pending.is_empty() {
                return;
            }
            self.take_light_along(bounce, w);
            if self.scene.features.boundaries {
                self.cross_boundaries(bounce, pass, w);
            }
            let Workspace { pending, pending_rays, pending_hits, rays, hits, materials, .. } = &mut *w;
            pending_rays.clear();
            pending_rays.extend(pending.iter().map(|&i| {
                let i = i as usize;
                self.step_past(&mut rays[i], &hits[i]);
                rays[i]
            }));
            pending_hits.clear();
            pending_hits.resize(pending.len(), Hit::MISS);
            self.scene.accel.closest(pending_rays, pending_hits);
            for (&i, &hit) in pending.iter().zip(&*pending_hits) {
                hits[i as usize] = hit;
                materials[i as usize] = if hit.is_hit() { self.scene.geometries.material(&hit) } else { 0 };
            }
            w.ray_counts.all += w.pending.len() as u64;
        }
    }

    /// Adds the light of the lamps that pending rays are about to pass.
    fn take_light_along(&self, bounce: u32, w: &mut Workspace) {
        for k in 0..w.pending.len() {
            let i = w.pending[k] as usize;
            let hit = w.hits[i];
            let material = &self.scene.materials[self.scene.geometries.material(&hit) as usize];
            if material.emission.is_none()
                || !material.lamp.is_some_and(|l| l.visible_to_camera || bounce > 0)
            {
                continue;
            }
            let surface = self.scene.geometries.surface(&w.rays[i], &hit);
            let is_back = surface.ng.dot(w.rays[i].direction) > 0.0;
            let throughput = get_rgb(&w.arriving.carried.throughput, i);
            let left = self.left_on_the_way(i, hit.t, w);
            set_rgb(&mut w.arriving.carried.throughput, i, throughput * left);
            self.emit(bounce, i, &HitPoint { surface, hit, material, is_back }, w);
            set_rgb(&mut w.arriving.carried.throughput, i, throughput);
        }
    }

    /// Any-hit for shadow rays among surfaces that may be absent.
    pub(super) fn occluded_by_present_surfaces(&self, bounce: u32, w: &mut Workspace) {
        let Workspace {
            wave,
            shadow_rays,
            shadow_vertices,
            occluded,
            ray_counts,
            pending,
            pending_rays,
            pending_hits,
            shadow_ways,
            ..
        } = &mut *w;
        if pending_hits.len() < shadow_rays.len() {
            pending_hits.resize(shadow_rays.len(), Hit::MISS);
        }
        self.scene.accel.any(shadow_rays, pending_hits);
        ray_counts.all += shadow_rays.len() as u64;
        // Most hit nothing, or something that is there.
        pending.clear();
        for (k, (hit, occluded)) in pending_hits.iter().zip(&mut **occluded).enumerate() {
            let is_doubtful = self.is_doubtful(hit) && !self.is_surely_front(&shadow_rays[k], hit);
            *occluded = hit.is_hit() && !is_doubtful;
            if is_doubtful {
                pending.push(k as u32);
            }
        }
        let Wave { paths, vertices: Vertices { light, .. }, .. } = &mut **wave;
        for pass in 0..MAX_PASSES {
            if pending.is_empty() {
                return;
            }
            pending_rays.clear();
            pending_rays.extend(pending.iter().map(|&k| shadow_rays[k as usize]));
            pending_hits.clear();
            pending_hits.resize(pending.len(), Hit::MISS);
            self.scene.accel.closest(pending_rays, pending_hits);
            ray_counts.all += pending.len() as u64;
            let mut at = 0;
            pending.retain(|&k| {
                let hit = pending_hits[at];
                at += 1;
                let k = k as usize;
                if !hit.is_hit() {
                    return false;
                }
                let i = shadow_vertices[k] as usize;
                let path = &paths.carried;
                let salt = || hash32(path.seed[i] ^ hash32(!path.shuffled[i]) ^ (bounce << 16));
                if self.is_present(&shadow_rays[k], &hit, false, || salt().wrapping_add(pass))
                    && !self.light_passes_sheet(i, &shadow_rays[k], &hit, light)
                {
                    occluded[k] = true;
                    return false;
                }
                self.cross_with_light(i, &shadow_rays[k], &hit, shadow_ways.get_mut(k), light);
                self.step_past(&mut shadow_rays[k], &hit);
                true
            });
        }
    }

    /// Is there a hit, on a surface that may be absent?
    #[inline(always)]
    pub(super) fn is_doubtful(&self, hit: &Hit) -> bool {
        hit.is_hit() && self.may_be_absent[self.scene.geometries.material(hit) as usize]
    }

    /// Is the hit on the front of a surface that is absent from behind only, wherever it hit the primitive?
    #[inline(always)]
    fn is_surely_front(&self, ray: &Ray, hit: &Hit) -> bool {
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        material.alpha.is_none()
            && material.lamp.is_none()
            && !material.passes_straight
            && !material.is_boundary
            && self.scene.geometries.is_back_of_flat(ray, hit) == Some(false)
    }

    /// Takes a ray past a surface that isn't there. Its origin stays what densities refer to.
    ///
    /// A sheet that has another material on either side is often two at the same place, turned away from each other:
    /// behind a back that isn't there, what lies at the same distance still counts. So it does at flat boundaries of media:
    /// bodies of fog touch each other and stand on floors. Of several at one place two are met.
    fn step_past(&self, ray: &mut Ray, hit: &Hit) {
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        let may_have_neighbours = material.is_boundary || material.is_absent_from_behind;
        let is_back =
            if may_have_neighbours { self.scene.geometries.is_back_of_flat(ray, hit) } else { None };
        let has_neighbours = is_back.is_some_and(|is_back| is_back || material.is_boundary);
        let is_another = hit.t > ray.t_min.next_up();
        if has_neighbours && is_another {
            ray.t_min = hit.t.next_down();
            ray.origin_primitive = hit.into();
        } else {
            ray.t_min = hit.t;
        }
    }

    /// Is the surface there? Nothing hit counts as present: there is nothing to pass.
    #[inline(always)]
    fn is_present(&self, ray: &Ray, hit: &Hit, is_of_camera: bool, salt: impl Fn() -> u32) -> bool {
        if !hit.is_hit() {
            return true;
        }
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        if material.is_boundary || material.is_absent_from_behind && self.scene.geometries.is_back(ray, hit) {
            return false;
        }
        if let Some(lamp) = material.lamp {
            return lamp.is_obstacle && (lamp.visible_to_camera || !is_of_camera);
        }
        let Some(alpha) = material.alpha else { return true };
        let surface: Surface = self.scene.geometries.surface(ray, hit);
        let at = self.scene.geometries.coordinates(&surface, hit, false);
        let vertex_alpha = if material.uses_vertex_colors { at.color[3] } else { 1.0 };
        let presence = alpha.presence(&self.slots(&at, &surface, 0.0), vertex_alpha);
        unit(hash32(salt())) < presence
    }
}
