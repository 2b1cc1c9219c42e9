//! Random walks within bodies: what scatters light beneath its surface, from where a path enters it to where it hits a surface.
//!
//! No light sample reaches the inside of such a body: its surface scatters, refracts or absorbs, and no light lies within. So nothing
//! happens between two surfaces but scattering, and a stage of its own follows each path through all its scattering events: it samples a
//! direction and a distance, and traces the ray up to there. The last segment, which hits a surface, is left to the stages that follow. What
//! is emitted from within such a body and yet found counts in full.

use super::Integrator;
use super::interior::Interior;
use super::medium_segment::MediumSegment;
use super::mis::DirectionPdf;
use super::sampling::{RandomChoice, survival};
use super::wave::{get_rgb, set, set_rgb};
use super::workspace::Workspace;
use crate::bsdf::phase::sample_henyey_greenstein;
use crate::color::Rgb;
use crate::compile::{CompiledScene, Density, Scattering};
use crate::light::{LightBounds, LightSource};
use crate::math::{Hit, Ray, Vec3};
use crate::sampling::hash::SplitMix64;
use crate::scene::RayKinds;

/// Maximum number of scattering events of a walk: nearly all paths leave a body without absorption even where it is a
/// hundred mean free paths thick, after some ten thousand steps at most.
pub(super) const MAX_STEPS: u32 = 1 << 16;

/// Maximum number of emissive surfaces that are tested for lying within a body. More light is sampled by hits alone there.
const TESTED_AREA_LIGHTS: usize = 256;

/// The media whose scattering events this stage follows.
#[derive(Clone, Debug, Default)]
pub(super) struct RandomWalks {
    /// By medium; empty if there are none.
    by_medium: Vec<bool>,
}

impl RandomWalks {
    /// Those of a scene.
    pub fn of(scene: &CompiledScene) -> RandomWalks {
        let is_walked = |s: &Scattering| {
            s.is_enclosed && s.density == Density::Homogeneous && s.emission.max_element() <= 0.0
        };
        let mut by_medium: Vec<bool> =
            scene.media.iter().map(|m| m.scattering.as_ref().is_some_and(is_walked)).collect();
        if by_medium.contains(&true) {
            leave_out_lit(scene, &mut by_medium);
        }
        if !by_medium.contains(&true) {
            by_medium.clear();
        }
        RandomWalks { by_medium }
    }

    /// Are there any?
    pub fn exist(&self) -> bool {
        !self.by_medium.is_empty()
    }

    /// Is this one of the media?
    #[inline(always)]
    fn contain(&self, medium: u16) -> bool {
        self.by_medium[usize::from(medium)]
    }
}

/// Leaves out media that have lights in them.
fn leave_out_lit(scene: &CompiledScene, by_medium: &mut [bool]) {
    let lights = &scene.lights;
    let middle = |bounds: LightBounds| bounds.bounds.center();
    let points = lights.punctual().iter().filter_map(|light| light.bounds(&scene.textures)).map(middle);
    let points: Vec<Vec3> = points.collect();
    if !points.is_empty() && scene.is_moving() {
        // They may come in at any time.
        return by_medium.fill(false);
    }
    let area = lights.area();
    let step = area.len().div_ceil(TESTED_AREA_LIGHTS).max(1);
    let middles = area.iter().step_by(step).filter_map(|light| light.bounds(&scene.textures)).map(middle);
    for p in points.into_iter().chain(middles) {
        let around = Interior::around(scene, p, 0.0);
        by_medium
            .iter_mut()
            .enumerate()
            .for_each(|(m, walks)| *walks &= m == 0 || !around.contains(m as u16));
    }
}

impl Integrator<'_> {
    /// Follows the paths within bodies to the surfaces that they hit.
    pub(super) fn follow_random_walks(&self, bounce: u32, w: &mut Workspace) {
        let mut walking = std::mem::take(&mut w.pending);
        walking.clear();
        walking
            .extend((0..w.rays.len() as u32).filter(|&i| bounce > 0 && self.scatters_within(i as usize, w)));
        for &i in &walking {
            self.begin_random_walk(i as usize, w);
        }
        for step in 0..MAX_STEPS {
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

    /// Does path `i` scatter next within one of the bodies?
    #[inline(always)]
    fn scatters_within(&self, i: usize, w: &Workspace) -> bool {
        let segment = &w.medium_segments[i];
        !w.hits[i].is_hit()
            && segment.scatter_t.is_finite()
            && self.random_walks.contain(segment.medium)
            && segment.is_alone()
    }

    /// What follows a walk doesn't depend on the vertex before it.
    fn begin_random_walk(&self, i: usize, w: &mut Workspace) {
        let (paths, optional) = (&mut w.arriving, self.optional);
        paths.state.pdf[i] = DirectionPdf::SPECULAR;
        if optional.receiver_normal {
            set(&mut paths.receiver_normal, i, Vec3::ZERO);
        }
        if optional.visibility {
            paths.visibility[i] = paths.visibility[i].with_kind(RayKinds::VOLUME);
        }
        if optional.chains {
            paths.chains[i] = 0;
        }
        if optional.mirrored {
            paths.mirrored[i] = 0;
        }
    }

    /// Scatters path `i` at the end of its segment and samples the next one; false where Russian roulette ends it.
    fn take_step(&self, (bounce, step): (u32, u32), i: usize, w: &mut Workspace) -> bool {
        let (segment, ray, path) = (w.medium_segments[i], w.rays[i], &mut w.arriving.state);
        let wavelengths = w.times.wavelengths(path.radiance_index[i]);
        let Some(medium) = &self.scene.media[usize::from(segment.medium)].scattering else { return false };
        let medium = &*medium.in_lanes(wavelengths);
        let key = RandomChoice::RandomWalk.hash(path, i, bounce);
        let mut random = SplitMix64::new(u64::from(key) << u32::BITS | u64::from(step));
        let throughput = get_rgb(&path.throughput, i) * segment.weight_of_scattering(medium);
        let [roulette, distance] = random.next_pair();
        let (survives, scale) = survival(throughput, path.roulette_scale[i], roulette, true);
        if !survives {
            end_walk(i, w);
            return false;
        }
        let throughput = throughput * scale;
        set_rgb(&mut path.throughput, i, throughput);
        let wi = sample_henyey_greenstein(medium.anisotropy, -ray.direction, random.next_pair());
        let ray = Ray::new(ray.at(segment.scatter_t), wi);
        let in_medium = (segment.medium, medium, wavelengths);
        let line = (ray.origin, wi);
        let [channel, _] = random.next_pair();
        let next = MediumSegment::draw(in_medium, line, 0.0, throughput, None, [distance, channel]);
        w.rays[i] = Ray { t_max: next.scatter_t.min(ray.t_max), ..ray };
        w.medium_segments[i] = next;
        true
    }

    /// Traces the rays of walking paths.
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
    }
}

/// Ends path `i` within a body.
fn end_walk(i: usize, w: &mut Workspace) {
    set_rgb(&mut w.arriving.state.throughput, i, Rgb::ZERO);
    w.medium_segments[i] = MediumSegment::straight(w.medium_segments[i].medium, [0.0, f32::INFINITY]);
}
