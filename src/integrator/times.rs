//! When each path looks at the scene, where something moves: a time in 0..1, from the opening of the shutter to its closing.
//! It belongs to a path's sample, so that all of a path's rays, vertices and branches have the same.

use super::lanes::{WAVE, set};
use super::workspace::Workspace;
use super::{Integrator, Purpose};
use crate::accel::Accel;
use crate::math::{Hit, Ray};
use crate::sampling::sampler::SobolPoint;

/// The times of a wave; empty where nothing moves.
#[derive(Default)]
pub(super) struct Times {
    by_sample: Vec<f32>,
    /// Paths that go on from the first surface of each sample, and have indices of their own.
    branches: u32,
    /// Of the rays that are traced next.
    of_rays: Vec<f32>,
}

impl Times {
    /// The time of a sample, by the index that its path carries; 0 where nothing moves.
    #[inline(always)]
    pub fn of(&self, sample: u32) -> f32 {
        if self.by_sample.is_empty() { 0.0 } else { self.known(sample) }
    }

    #[cold]
    fn known(&self, sample: u32) -> f32 {
        let sample = match sample.checked_sub(WAVE as u32) {
            Some(branch) => branch / self.branches,
            None => sample,
        };
        self.by_sample.get(sample as usize).copied().unwrap_or(0.0)
    }

    /// The nearest hits of rays whose paths have these samples.
    #[inline]
    pub fn closest(
        &mut self,
        accel: &Accel,
        rays: &[Ray],
        samples: impl Iterator<Item = u32>,
        hits: &mut [Hit],
    ) {
        if !accel.is_moving() {
            return accel.closest(rays, hits);
        }
        self.gather(samples);
        accel.closest_in_time(rays, &self.of_rays, hits);
    }

    /// Some hits of rays whose paths have these samples.
    #[inline]
    pub fn any(&mut self, accel: &Accel, rays: &[Ray], samples: impl Iterator<Item = u32>, hits: &mut [Hit]) {
        if !accel.is_moving() {
            return accel.any(rays, hits);
        }
        self.gather(samples);
        accel.any_in_time(rays, &self.of_rays, hits);
    }

    fn gather(&mut self, samples: impl Iterator<Item = u32>) {
        let mut of_rays = std::mem::take(&mut self.of_rays);
        of_rays.clear();
        of_rays.extend(samples.map(|sample| self.of(sample)));
        self.of_rays = of_rays;
    }
}

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
        times.by_sample.clear();
        times.by_sample.extend((0..pixels.len()).map(draw));
        times.branches = self.options.branches;
        let Some(moving) = &self.view.moving else { return };
        let [x, y, _, _, lens_u, lens_v, ..] = &wave.scratch;
        for (i, &time) in times.by_sample.iter().enumerate() {
            let ray = moving.at(time).ray(x[i], y[i], [lens_u[i], lens_v[i]]);
            set(&mut wave.vertices.next_origin, i, ray.origin);
            set(&mut wave.vertices.next_direction, i, ray.direction);
        }
    }
}
