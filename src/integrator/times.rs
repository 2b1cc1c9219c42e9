//! When each path looks at the scene, where something moves: a time in 0..1, from the opening of the shutter to its closing.
//! It belongs to a path's sample, so that all of a path's rays, vertices and branches have the same. So do the wavelengths of paths,
//! where pictures are rendered by wavelength.

use super::lanes::WAVE;
use crate::accel::Accel;
use crate::color::spectral::Wavelengths;
use crate::math::{Hit, Ray};

/// The times of a wave; empty where nothing moves.
#[derive(Default)]
pub(super) struct Times {
    by_sample: Vec<f32>,
    /// Empty where paths carry red, green and blue.
    waves: Vec<Wavelengths>,
    /// Paths that go on from the first surface of each sample, and have indices of their own.
    branches: u32,
    /// Of the rays that are traced next.
    of_rays: Vec<f32>,
}

impl Times {
    /// Begins with new samples.
    pub fn start(&mut self, times: impl Iterator<Item = f32>, branches: u32) {
        self.by_sample.clear();
        self.by_sample.extend(times);
        self.branches = branches;
    }

    /// Begins with the wavelengths of new samples.
    pub fn start_waves(&mut self, waves: impl Iterator<Item = Wavelengths>, branches: u32) {
        self.waves.clear();
        self.waves.extend(waves);
        self.branches = branches;
    }

    /// The wavelengths of all samples.
    pub fn all_waves(&self) -> &[Wavelengths] {
        &self.waves
    }

    /// The wavelengths of a sample, by the index that its path carries; `None` where paths carry red, green and blue.
    #[inline(always)]
    pub fn waves(&self, sample: u32) -> Option<&Wavelengths> {
        if self.waves.is_empty() { None } else { self.known_waves(sample) }
    }

    #[cold]
    fn known_waves(&self, sample: u32) -> Option<&Wavelengths> {
        let of_branch =
            || sample.checked_sub(WAVE as u32).and_then(|k| self.waves.get((k / self.branches) as usize));
        self.waves.get(sample as usize).or_else(of_branch)
    }

    /// All samples are traced once more, under the indices behind those of all.
    pub fn repeat(&mut self) {
        self.by_sample.extend_from_within(..);
        self.waves.extend_from_within(..);
    }

    /// The times of all samples.
    pub fn all(&self) -> &[f32] {
        &self.by_sample
    }

    /// The time of a sample, by the index that its path carries; 0 where nothing moves.
    #[inline(always)]
    pub fn of(&self, sample: u32) -> f32 {
        if self.by_sample.is_empty() { 0.0 } else { self.known(sample) }
    }

    #[cold]
    fn known(&self, sample: u32) -> f32 {
        let of = |sample: u32| self.by_sample.get(sample as usize).copied();
        let of_branch = || sample.checked_sub(WAVE as u32).and_then(|branch| of(branch / self.branches));
        of(sample).or_else(of_branch).unwrap_or(0.0)
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
