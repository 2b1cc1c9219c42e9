//! Subsurface scattering by random walks, from where a path enters a solid to where it hits a surface.
//!
//! Shadow rays can't reach the inside of such a solid, and no light lies within: its surface scatters, refracts or absorbs. So one stage
//! follows each path through all scattering events of a walk: it samples direction and distance, guided to the surface by a
//! [`WalkGuide`], and intersects the ray. The last segment, which hits a surface, is left to the following stages. Emission hit by a walk
//! has MIS weight 1.
//!
//! Random walks of subsurface scattering intersect the object where they entered only, as in Cycles; other objects inside the body are
//! ignored.

use super::Integrator;
use super::medium_segment::MediumSegment;
use super::mis::DirectionPdf;
use super::sampling::{RandomChoice, survival};
use super::walk_guide::WalkGuide;
use super::wave::{get, get_rgb, set, set_rgb};
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::compile::ObjectId;
use crate::math::{Hit, NO_HIT, OriginPrimitive, Ray, Vec3};
use crate::sampling::hash::SplitMix64;
use crate::scene::RayKinds;

/// Maximum number of scattering events of a walk: even without absorption and at a thickness of a hundred mean free paths, nearly all
/// paths exit within some ten thousand steps.
pub(super) const MAX_STEPS: u32 = 1 << 16;

/// Maximum number of surfaces of other objects that a segment of a walk or a ray of a node graph passes.
const MAX_PASSED: usize = 256;

/// Throughput below which Russian roulette applies: steps are cheap compared with the bounces after a walk.
const ROULETTE_THROUGHPUT: f32 = 0.1;

impl Integrator<'_> {
    /// Follows the random walks of all paths up to the segments that hit surfaces.
    pub(super) fn follow_random_walks(&self, bounce: u32, w: &mut Workspace) {
        let mut walking = std::mem::take(&mut w.pending);
        walking.clear();
        walking.extend((0..w.rays.len() as u32).filter(|&i| bounce > 0 && self.is_in_body(i as usize, w)));
        w.walk_objects.resize(w.rays.len(), None);
        for i in walking.iter().map(|&i| i as usize) {
            w.walk_objects[i] = self.object_of_body(i, w);
            w.hits[i] = self.hit_of_body(i, w.hits[i], w);
        }
        walking.retain(|&i| self.scatters_within(i as usize, w));
        for &i in &walking {
            self.begin_random_walk(i as usize, w);
        }
        let most = self.options.bounces.subsurface.saturating_sub(1).min(MAX_STEPS);
        for step in 0..most {
            if walking.is_empty() {
                break;
            }
            walking.retain(|&i| self.take_step((bounce, step), i as usize, w));
            self.intersect_steps(&walking, w);
            walking.retain(|&i| self.scatters_within(i as usize, w));
        }
        for &i in &walking {
            end_walk(i as usize, w);
        }
        w.pending = walking;
    }

    /// Is path `i` within a body that random walks scatter in?
    #[inline(always)]
    fn is_in_body(&self, i: usize, w: &Workspace) -> bool {
        let segment = &w.medium_segments[i];
        self.random_walks.guide(segment.medium).is_some() && segment.is_alone()
    }

    /// Is the next event of path `i` a scattering event of a random walk?
    #[inline(always)]
    fn scatters_within(&self, i: usize, w: &Workspace) -> bool {
        !w.hits[i].is_hit() && w.medium_segments[i].scatter_t.is_finite() && self.is_in_body(i, w)
    }

    /// The object that path `i` just entered, if its medium is subsurface scattering.
    fn object_of_body(&self, i: usize, w: &Workspace) -> Option<ObjectId> {
        let medium = self.scene.media[usize::from(w.medium_segments[i].medium)].scattering.as_ref()?;
        let OriginPrimitive { prim, instance } = w.rays[i].origin_primitive;
        let is_known = medium.is_subsurface && prim != NO_HIT;
        is_known.then(|| self.scene.object_at(&Hit { prim, instance, ..Hit::MISS }))
    }

    /// The first hit from `hit` on of the surface of the body that path `i` is in.
    fn hit_of_body(&self, i: usize, hit: Hit, w: &Workspace) -> Hit {
        let Some(object) = w.walk_objects[i] else { return hit };
        let time = w.time(i);
        self.first_hit_that((&w.rays[i], hit, time), |hit| self.scene.object_at(hit) == object)
    }

    /// The first hit of a ray, from `hit` on, for which a predicate holds.
    pub(super) fn first_hit_that(
        &self,
        (ray, mut hit, time): (&Ray, Hit, f32),
        holds: impl Fn(&Hit) -> bool,
    ) -> Hit {
        for _ in 0..MAX_PASSED {
            if !hit.is_hit() || holds(&hit) {
                return hit;
            }
            hit = self.scene.accel.closest_after(ray, &hit, time);
        }
        Hit::MISS
    }

    /// Resets path state that depends on the vertex before the walk, and sets the axis of guiding.
    fn begin_random_walk(&self, i: usize, w: &mut Workspace) {
        let (paths, optional) = (&mut w.arriving, self.optional);
        let (normal, direction) = (get(&paths.entry_normal, i), w.rays[i].direction);
        // After vertices in media (the camera may be inside a solid) there is no normal.
        let outwards =
            if normal == Vec3::ZERO { direction } else { normal * -normal.dot(direction).signum() };
        set(&mut paths.entry_normal, i, outwards);
        paths.state.pdf[i] = DirectionPdf::SPECULAR;
        if optional.receiver_normal {
            set(&mut paths.receiver_normal, i, Vec3::ZERO);
        }
        if optional.visibility {
            paths.visibility[i] = paths.visibility[i].with_kind(RayKinds::VOLUME);
        }
        if optional.caustic_chains {
            paths.caustic_chains[i] = 0;
        }
        if optional.only_mirrors {
            paths.only_mirrors[i] = 0;
        }
    }

    /// Scatters path `i` at the end of its segment and samples the next one; false if Russian roulette ends the path.
    fn take_step(&self, (bounce, step): (u32, u32), i: usize, w: &mut Workspace) -> bool {
        let (segment, ray, path) = (w.medium_segments[i], w.rays[i], &mut w.arriving.state);
        let wavelengths = w.times.wavelengths(path.radiance_index[i]);
        let Some(medium) = &self.scene.media[usize::from(segment.medium)].scattering else { return false };
        if !self.counts_step(medium, i, &mut w.arriving) {
            end_walk(i, w);
            return false;
        }
        let path = &mut w.arriving.state;
        let medium = &*medium.at_wavelengths(wavelengths);
        let key = RandomChoice::RandomWalk.hash(path, i, bounce);
        let mut random = SplitMix64::new(u64::from(key) << u32::BITS | u64::from(step));
        let throughput = get_rgb(&path.throughput, i) * segment.weight_of_scattering(medium);
        let [roulette, distance] = random.next_pair();
        let (survives, scale) =
            survival(throughput, path.roulette_scale[i] / ROULETTE_THROUGHPUT, roulette, true);
        if !survives {
            end_walk(i, w);
            return false;
        }
        let throughput = throughput * scale;
        set_rgb(&mut path.throughput, i, throughput);
        let [strategy, channel] = random.next_pair();
        let own = wavelengths.map(|_| WalkGuide::of(medium));
        let Some(guide) = own.as_ref().or(self.random_walks.guide(segment.medium)) else { return false };
        let axis = get(&w.arriving.entry_normal, i);
        let (wi, next) = MediumSegment::sample_step(
            (segment.medium, medium),
            (-ray.direction, axis),
            guide,
            throughput,
            ([strategy, channel, distance], random.next_pair()),
        );
        let ray = Ray::new(ray.at(segment.scatter_t), wi);
        w.rays[i] = Ray { t_max: next.scatter_t.min(ray.t_max), ..ray };
        w.medium_segments[i] = next;
        true
    }

    /// Intersects the current segments of the walks.
    fn intersect_steps(&self, walking: &[u32], w: &mut Workspace) {
        let Workspace { pending_rays, pending_hits, rays, hits, times, arriving, .. } = w;
        pending_rays.clear();
        pending_rays.extend(walking.iter().map(|&i| rays[i as usize]));
        pending_hits.clear();
        pending_hits.resize(walking.len(), Hit::MISS);
        let samples = walking.iter().map(|&i| arriving.state.radiance_index[i as usize]);
        times.closest(&self.scene.accel, pending_rays, samples, pending_hits);
        w.ray_counts.all += walking.len() as u64;
        for (&i, hit) in walking.iter().zip(&*pending_hits) {
            hits[i as usize] = *hit;
        }
        for i in walking.iter().map(|&i| i as usize) {
            w.hits[i] = self.hit_of_body(i, w.hits[i], w);
        }
    }
}

/// Ends path `i` within a solid.
fn end_walk(i: usize, w: &mut Workspace) {
    set_rgb(&mut w.arriving.state.throughput, i, Rgb::ZERO);
    w.medium_segments[i] = MediumSegment::unscattered(w.medium_segments[i].medium, [0.0, f32::INFINITY]);
}
