//! Rays that node graphs trace: ambient occlusion, and normals around a point for bevels.
//!
//! As in Cycles, ambient occlusion is that of all surfaces visible to shadow rays, whatever their alpha, but not of lamps. Node graphs of
//! shadow rays trace no rays.

use super::Integrator;
use super::sampling::Purpose;
use super::shading_geometry::HitPoint;
use crate::math::{Hit, Ray};
use crate::scene::RayKinds;
use crate::scene::nodes::MAX_NODE_RAYS;
use crate::texture::{Crossing, RayOrigin, RayQueries};

impl Integrator<'_> {
    /// The origin of rays of node graphs at a hit; `None` if the path's random numbers are unknown.
    pub(super) fn ray_origin(&self, at: &HitPoint<'_>) -> Option<RayOrigin<'_>> {
        let HitPoint { surface, hit, time, path, .. } = at;
        let bounce = u32::from(path.bounces);
        Some(RayOrigin {
            scene: self,
            hit: *hit,
            p_error: surface.p_error,
            time: *time,
            sample: path.sample?,
            dimension_sets: [Purpose::AmbientOcclusion, Purpose::Bevel].map(|p| p.dimension_set(bounce)),
            is_sharp: path.is_sharp,
        })
    }

    /// Does a surface occlude ambient light?
    fn is_occluder(&self, hit: &Hit) -> bool {
        let material = &self.scene.materials[self.scene.geometries.material(hit) as usize];
        material.surface_visibility.is_none_or(|v| v.is_obstacle && v.visible_to.contains(RayKinds::SHADOW))
    }
}

impl RayQueries for Integrator<'_> {
    fn count_unoccluded(&self, from: &RayOrigin<'_>, rays: &[Ray], only_local: bool) -> u32 {
        let (accel, time) = (&self.scene.accel, from.time);
        let object = only_local.then(|| self.scene.object_at(&from.hit));
        let occludes = |hit: &Hit| match object {
            Some(object) => self.scene.object_at(hit) == object,
            None => self.is_occluder(hit),
        };
        let mut hits = [Hit::MISS; MAX_NODE_RAYS as usize];
        match accel.uses_times() {
            true => accel.any_in_time(rays, &[time; MAX_NODE_RAYS as usize], &mut hits),
            false => accel.any(rays, &mut hits),
        }
        let is_free = |(ray, hit): &(&Ray, &Hit)| {
            !hit.is_hit()
                || !occludes(hit) && {
                    let closest = accel.closest_one_in_time(ray, time);
                    !self.first_hit_that((ray, closest, time), occludes).is_hit()
                }
        };
        rays.iter().zip(&hits).filter(is_free).count() as u32
    }

    fn visit_crossings(&self, from: &RayOrigin<'_>, ray: &Ray, visit: &mut dyn FnMut(&Crossing)) {
        let (accel, time) = (&self.scene.accel, from.time);
        let object = self.scene.object_at(&from.hit);
        let is_object = |hit: &Hit| self.scene.object_at(hit) == object;
        let mut hit = self.first_hit_that((ray, accel.closest_one_in_time(ray, time), time), is_object);
        for _ in 0..MAX_CROSSINGS {
            if !hit.is_hit() {
                break;
            }
            let surface = self.scene.geometries.surface(ray, &hit, time);
            visit(&Crossing { point: surface.p, ng: surface.ng, ns: surface.ns });
            hit = self.first_hit_that((ray, accel.closest_after(ray, &hit, time), time), is_object);
        }
    }
}

/// Maximum number of crossings of a ray.
const MAX_CROSSINGS: u32 = 64;
