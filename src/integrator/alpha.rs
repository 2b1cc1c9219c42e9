//! Surfaces that are partly absent: rays pass there at random. Unbiased for paths and shadow rays alike. Lamps that stop
//! no light are absent for all rays, which take what they emit along. One-sided surfaces are absent for rays that come
//! from behind: shadow rays start at the eye's side of a path, so that they and scattered rays see the same ones. What
//! smooth thin sheets do is in [`super::sheets`].

use super::Integrator;
use super::hit_point::HitPoint;
use super::kinds::OF_LIGHT_SAMPLES;
use super::lanes::{get_rgb, set_rgb};
use super::times::Times;
use super::wave::{Vertices, Wave};
use super::workspace::Workspace;
use crate::compile::CompiledMaterial;
use crate::math::{Hit, Ray, Vec3};
use crate::sampling::hash::{hash32, unit};
use crate::scene::RayKinds;
use crate::shape::Surface;

/// Surfaces in a row that a ray may pass; a guard against endless stacks.
const MAX_PASSES: u32 = 4096;

impl Integrator<'_> {
    /// Moves hits on absent surfaces to the next present one, and finds the materials of all.
    pub(super) fn pass_absent_surfaces(&self, bounce: u32, w: &mut Workspace) {
        self.find_materials(w);
        for pass in 0..MAX_PASSES {
            let Workspace { pending, rays, hits, arriving, without, times, .. } = &mut *w;
            pending.retain(|&i| {
                let i = i as usize;
                if self.is_left_out(*without, &hits[i]) {
                    return true;
                }
                let carried = &arriving.carried;
                let salt = hash32(carried.seed[i] ^ hash32(carried.shuffled[i]) ^ (bounce << 16));
                let salt = salt.wrapping_add(pass);
                let time = times.of(carried.sample[i]);
                match self.response(&rays[i], &hits[i], time, self.kind(bounce, i, arriving), || salt) {
                    Response::Stops => {
                        self.passes_sheet(i, &rays[i], &hits[i], time, salt, &mut arriving.carried)
                    }
                    Response::Passes => true,
                    Response::PassesUnseen(others) => {
                        self.pass_unseen(i, others, arriving);
                        true
                    }
                }
            });
            if pending.is_empty() {
                return;
            }
            self.take_light_along(bounce, w);
            if self.scene.features.boundaries {
                self.cross_boundaries(bounce, pass, w);
            }
            let Workspace {
                pending, pending_rays, pending_hits, rays, hits, materials, arriving, times, ..
            } = &mut *w;
            let sample = |&i: &u32| arriving.carried.sample[i as usize];
            let mut crowded = Vec::new();
            pending_rays.clear();
            pending_rays.extend(pending.iter().enumerate().map(|(k, &i)| {
                let time = times.of(sample(&i));
                let i = i as usize;
                if self.step_past(&mut rays[i], &hits[i], time) {
                    crowded.push((k, hits[i], time));
                }
                rays[i]
            }));
            self.next_hits((times, pending.iter().map(sample)), pending_rays, &mut crowded, pending_hits);
            for (&i, &hit) in pending.iter().zip(&*pending_hits) {
                hits[i as usize] = hit;
                materials[i as usize] = if hit.is_hit() { self.scene.geometries.material(&hit) } else { 0 };
            }
            w.ray_counts.all += w.pending.len() as u64;
        }
    }

    /// Finds the materials of all hits; those that may be absent are pending.
    fn find_materials(&self, w: &mut Workspace) {
        let doubtful = self.doubtful(w.without);
        w.pending.clear();
        w.materials.clear();
        for (i, hit) in w.hits.iter().enumerate() {
            let mut material = 0;
            if hit.is_hit() {
                material = self.scene.geometries.material(hit);
                if doubtful[material as usize] {
                    w.pending.push(i as u32);
                }
            }
            w.materials.push(material);
        }
    }

    /// Adds the light of the lamps that pending rays are about to pass.
    fn take_light_along(&self, bounce: u32, w: &mut Workspace) {
        for k in 0..w.pending.len() {
            let i = w.pending[k] as usize;
            let hit = w.hits[i];
            if self.is_left_out(w.without, &hit) {
                continue;
            }
            let material = &self.scene.materials[self.scene.geometries.material(&hit) as usize];
            let kind = self.kind(bounce, i, &w.arriving);
            if material.emission.is_none()
                || !material.presence.is_some_and(|p| !p.is_obstacle && p.visible_to.contains(kind))
            {
                continue;
            }
            let time = w.times.of(w.arriving.carried.sample[i]);
            let surface = self.scene.geometries.surface(&w.rays[i], &hit, time);
            let is_back = surface.ng.dot(w.rays[i].direction) > 0.0;
            let throughput = get_rgb(&w.arriving.carried.throughput, i);
            let left = self.left_on_the_way(i, hit.t, w);
            set_rgb(&mut w.arriving.carried.throughput, i, throughput * left);
            self.emit(bounce, i, &HitPoint { surface, hit, material, is_back, time }, w);
            set_rgb(&mut w.arriving.carried.throughput, i, throughput);
        }
    }

    /// Any-hit for shadow rays among surfaces that may be absent.
    pub(super) fn occluded_by_present_surfaces(&self, bounce: u32, w: &mut Workspace) {
        self.find_doubtful(w);
        let Workspace { wave, shadow_rays, shadow_vertices, occluded, ray_counts, without, times, .. } = w;
        let (pending, pending_rays, pending_hits) =
            (&mut w.pending, &mut w.pending_rays, &mut w.pending_hits);
        let (shadow_ways, passed_kinds) = (&mut w.shadow_ways, &mut w.passed_kinds);
        let Wave { paths, vertices: Vertices { light, .. }, .. } = &mut **wave;
        let sample = |&vertex: &u32| paths.carried.sample[vertex as usize];
        let mut crowded: Vec<(usize, Hit, f32)> = Vec::new();
        for pass in 0..MAX_PASSES {
            if pending.is_empty() {
                return;
            }
            pending_rays.clear();
            pending_rays.extend(pending.iter().map(|&k| shadow_rays[k as usize]));
            let samples = pending.iter().map(|&k| sample(&shadow_vertices[k as usize]));
            self.next_hits((times, samples), pending_rays, &mut crowded, pending_hits);
            ray_counts.all += pending.len() as u64;
            let (mut at, mut kept) = (0, 0);
            let mut step_past = |ray: &mut Ray, hit: Hit, time: f32| {
                if self.step_past(ray, &hit, time) {
                    crowded.push((kept, hit, time));
                }
                kept += 1;
            };
            pending.retain(|&k| {
                let (hit, k) = (pending_hits[at], k as usize);
                at += 1;
                if !hit.is_hit() {
                    return false;
                }
                let i = shadow_vertices[k] as usize;
                let (path, time) = (&paths.carried, times.of(paths.carried.sample[i]));
                if self.is_left_out(*without, &hit) || self.lets_pass(i as u32, &hit, light) {
                    step_past(&mut shadow_rays[k], hit, time);
                    return true;
                }
                let salt = || hash32(path.seed[i] ^ hash32(!path.shuffled[i]) ^ (bounce << 16));
                match self
                    .response(&shadow_rays[k], &hit, time, OF_LIGHT_SAMPLES, || salt().wrapping_add(pass))
                {
                    Response::Stops if self.light_passes_sheet(i, &shadow_rays[k], &hit, time, light) => {}
                    Response::Stops => {
                        occluded[k] = true;
                        return false;
                    }
                    Response::Passes => {}
                    Response::PassesUnseen(others) => {
                        if let Some(passed) = passed_kinds.get_mut(k) {
                            *passed = passed.with(others);
                        }
                    }
                }
                let (way, waves) = (shadow_ways.get_mut(k), times.waves(path.sample[i]));
                self.cross_with_light(i, &shadow_rays[k], (&hit, time), way, light, waves);
                step_past(&mut shadow_rays[k], hit, time);
                true
            });
        }
    }

    /// Finds the shadow rays that hit what may be absent; of others it is known whether they are occluded.
    fn find_doubtful(&self, w: &mut Workspace) {
        let Workspace { wave, shadow_rays, shadow_vertices, occluded, ray_counts, without, times, .. } = w;
        let (pending, pending_hits) = (&mut w.pending, &mut w.pending_hits);
        let sample = |&vertex: &u32| wave.paths.carried.sample[vertex as usize];
        if pending_hits.len() < shadow_rays.len() {
            pending_hits.resize(shadow_rays.len(), Hit::MISS);
        }
        times.any(&self.scene.accel, shadow_rays, shadow_vertices.iter().map(sample), pending_hits);
        ray_counts.all += shadow_rays.len() as u64;
        let doubtful = self.doubtful(*without);
        // Most hit nothing, or something that is there.
        pending.clear();
        for (k, (hit, occluded)) in pending_hits.iter().zip(&mut **occluded).enumerate() {
            let vertex = shadow_vertices[k];
            let is_front = || self.is_surely_front(&shadow_rays[k], hit, times.of(sample(&vertex)));
            let may_be_absent =
                || doubtful[self.scene.geometries.material(hit) as usize] && (*without || !is_front());
            let is_doubtful =
                hit.is_hit() && (may_be_absent() || self.lets_pass(vertex, hit, &wave.vertices.light));
            *occluded = hit.is_hit() && !is_doubtful;
            if is_doubtful {
                pending.push(k as u32);
            }
        }
    }

    /// Is there a hit, on a surface that may be absent?
    #[inline(always)]
    pub(super) fn is_doubtful(&self, hit: &Hit) -> bool {
        hit.is_hit() && self.may_be_absent[self.scene.geometries.material(hit) as usize]
    }

    /// Is the hit on the front of a surface that is absent from behind only, wherever it hit the primitive?
    #[inline(always)]
    fn is_surely_front(&self, ray: &Ray, hit: &Hit, time: f32) -> bool {
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        material.alpha.is_none()
            && material.presence.is_none()
            && !material.passes_straight
            && !material.is_boundary
            && self.scene.geometries.is_back_of_flat(ray, hit, time) == Some(false)
    }

    /// Takes a ray past a surface that isn't there. Its origin stays what densities refer to. Is another surface perhaps at the same
    /// place that only [`Integrator::next_hits`] finds?
    ///
    /// A sheet that has another material on either side is often two at the same place, turned away from each other:
    /// behind a back that isn't there, what lies at the same distance still counts. So it does at flat boundaries of media:
    /// bodies of fog touch each other and stand on floors. And so it does where another surface at the same place is there
    /// for other kinds of rays. Of many at one place two are found by leaving out the first; round boundaries are not left out.
    fn step_past(&self, ray: &mut Ray, hit: &Hit, time: f32) -> bool {
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        let is_for_some = material.visible_to() != RayKinds::ALL;
        let may_have_neighbours = material.is_boundary || material.is_absent_from_behind || is_for_some;
        let is_back =
            if may_have_neighbours { self.scene.geometries.is_back_of_flat(ray, hit, time) } else { None };
        let has_neighbours = is_back.is_some_and(|is_back| is_back || material.is_boundary || is_for_some);
        let is_another = hit.t > ray.t_min.next_up();
        if has_neighbours && is_another {
            (ray.t_min, ray.origin_primitive) = (hit.t.next_down(), hit.into());
            return false;
        }
        let is_crowded = material.is_boundary && (has_neighbours || self.scene.features.overlaps);
        ray.t_min = hit.t;
        is_crowded
    }

    /// Finds the nearest hits of rays whose paths have these samples; of those past places where others may lie, by their number, what
    /// lies there as well. None of them is left.
    fn next_hits(
        &self,
        (times, samples): (&mut Times, impl Iterator<Item = u32>),
        rays: &[Ray],
        crowded: &mut Vec<(usize, Hit, f32)>,
        hits: &mut Vec<Hit>,
    ) {
        hits.clear();
        hits.resize(rays.len(), Hit::MISS);
        times.closest(&self.scene.accel, rays, samples, hits);
        for (k, hit, time) in crowded.drain(..) {
            hits[k] = self.scene.accel.next_one(&rays[k], &hit, time);
        }
    }

    /// What a ray of a kind does where it hit. Nothing hit stops it: there is nothing to pass.
    #[inline(always)]
    fn response(&self, ray: &Ray, hit: &Hit, time: f32, kind: RayKinds, salt: impl Fn() -> u32) -> Response {
        if !hit.is_hit() {
            return Response::Stops;
        }
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        let is_absent = material.is_boundary
            || material.is_absent_from_behind && self.scene.geometries.is_back(ray, hit, time);
        let is_there = !is_absent && self.is_present(material, ray, hit, time, salt);
        match material.presence {
            _ if !is_there => Response::Passes,
            None => Response::Stops,
            Some(presence) if !presence.is_obstacle => Response::Passes,
            Some(presence) if presence.visible_to.contains(kind) => Response::Stops,
            Some(presence) => Response::PassesUnseen(presence.visible_to),
        }
    }

    /// Does alpha say that the surface is there?
    #[inline(always)]
    fn is_present(
        &self,
        material: &CompiledMaterial,
        ray: &Ray,
        hit: &Hit,
        time: f32,
        salt: impl Fn() -> u32,
    ) -> bool {
        material.alpha.is_none() || unit(hash32(salt())) < self.presence(ray, hit, time, material)
    }

    /// The probability that a surface of a material is there where a ray hit it.
    pub(super) fn presence(&self, ray: &Ray, hit: &Hit, time: f32, material: &CompiledMaterial) -> f32 {
        let Some(alpha) = material.alpha else { return 1.0 };
        let surface: Surface = self.scene.geometries.surface(ray, hit, time);
        let at = self.scene.geometries.coordinates(&surface, hit, false, time);
        let vertex_alpha = if material.uses_vertex_colors { at.color[3] } else { 1.0 };
        // Those of shadow rays are as long as their way.
        let wo = if alpha.depends_on_viewer { -ray.direction.normalize() } else { Vec3::ZERO };
        alpha.presence(&self.slots(&at, &surface, wo, 0.0), vertex_alpha)
    }
}

/// What a ray does where it hit a surface.
enum Response {
    /// It ends there.
    Stops,
    /// It goes on: nothing is there, or what only takes its light along.
    Passes,
    /// It goes on, but rays of these kinds end there.
    PassesUnseen(RayKinds),
}
