//! Random walks within bodies: what scatters light beneath its surface, from where a path enters it to where it hits a surface.
//!
//! No light sample reaches the inside of such a body: its surface scatters, refracts or absorbs, and no light lies within. So nothing
//! happens between two surfaces but scattering, and a stage of its own follows each path through all its scattering events: it samples a
//! direction and a distance, often by a [`WalkGuide`] to the surface, and traces the ray up to there. The last segment, which hits a
//! surface, is left to the stages that follow. Emission that a walk hits counts in full.

use super::Integrator;
use super::medium_segment::MediumSegment;
use super::mis::DirectionPdf;
use super::sampling::{RandomChoice, survival};
use super::walk_guide::WalkGuide;
use super::wave::{get, get_rgb, set, set_rgb};
use super::workspace::Workspace;
use crate::color::Rgb;
use crate::math::{Hit, Ray, Vec3};
use crate::sampling::hash::SplitMix64;
use crate::scene::RayKinds;

/// Maximum number of scattering events of a walk: nearly all paths leave a body without absorption even where it is a
/// hundred mean free paths thick, after some ten thousand steps at most.
pub(super) const MAX_STEPS: u32 = 1 << 16;

/// Throughput below which Russian roulette begins: steps cost little beside what follows a walk.
const FAINT: f32 = 0.1;

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

    /// Does path `i` scatter next within one of the bodies?
    #[inline(always)]
    fn scatters_within(&self, i: usize, w: &Workspace) -> bool {
        let segment = &w.medium_segments[i];
        !w.hits[i].is_hit()
            && segment.scatter_t.is_finite()
            && self.random_walks.guide(segment.medium).is_some()
            && segment.is_alone()
    }

    /// What follows a walk doesn't depend on the vertex before it.
    fn begin_random_walk(&self, i: usize, w: &mut Workspace) {
        let (paths, optional) = (&mut w.arriving, self.optional);
        let (normal, direction) = (get(&paths.entry_normal, i), w.rays[i].direction);
        // Vertices in media have no normal: cameras may be within bodies.
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
        let (survives, scale) = survival(throughput, path.roulette_scale[i] / FAINT, roulette, true);
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
        let (wi, next) = MediumSegment::draw_step(
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
