//! Paths of a wave get their times, and shadow rays theirs, where something moves.

use super::lanes::set;
use super::workspace::Workspace;
use super::{Integrator, Purpose};
use crate::math::Hit;
use crate::sampling::sampler::SobolPoint;

impl Integrator<'_> {
    /// Does anything move while the picture is taken?
    pub(super) fn is_moving(&self) -> bool {
        self.scene.is_moving() || self.view.moving.is_some()
    }

    /// Finds which of the shadow rays are occluded, where all surfaces are there.
    #[inline]
    pub(super) fn occluded(&self, w: &mut Workspace) {
        let Workspace { wave, shadow_rays, shadow_vertices, occluded, pending_hits, times, .. } = w;
        if !self.scene.accel.is_moving() {
            return self.scene.accel.occluded(shadow_rays, occluded);
        }
        pending_hits.clear();
        pending_hits.resize(shadow_rays.len(), Hit::MISS);
        let sample = |&vertex: &u32| wave.paths.carried.sample[vertex as usize];
        times.any(&self.scene.accel, shadow_rays, shadow_vertices.iter().map(sample), pending_hits);
        for (occluded, hit) in occluded.iter_mut().zip(&*pending_hits) {
            *occluded = hit.is_hit();
        }
    }

    /// Draws a time for each new path; where the camera moves, its ray is that of the camera at that time.
    #[cold]
    pub(super) fn start_times(&self, w: &mut Workspace) {
        let Workspace { times, arriving, wave, pixels, .. } = w;
        let dimensions = self.dimensions(0, Purpose::Time);
        let path = &arriving.carried;
        let draw =
            |i: usize| SobolPoint::from_parts(path.seed[i], path.shuffled[i]).sample_4d(&dimensions)[0];
        times.start((0..pixels.len()).map(draw), self.options.branches);
        let Some(moving) = &self.view.moving else { return };
        let [x, y, _, _, lens_u, lens_v, ..] = &wave.scratch;
        for (i, &time) in times.all().iter().enumerate() {
            let ray = moving.at(time).ray(x[i], y[i], [lens_u[i], lens_v[i]]);
            set(&mut wave.vertices.next_origin, i, ray.origin);
            set(&mut wave.vertices.next_direction, i, ray.direction);
        }
    }
}
