//! Paths start: camera rays.

use super::wave::{Workspace, set};
use super::{Block, Integrator, Purpose};
use crate::math::Vec3;
use crate::sampling::sampler::{SobolPoint, pixel_seed};

impl Integrator<'_> {
    /// Starts samples `first .. first + count` of a block, counted pixel by pixel.
    pub(super) fn generate(&self, block: &Block, first: u64, count: usize, w: &mut Workspace) {
        let dimensions = self.dimensions(0, Purpose::Camera);
        let samples = u64::from(block.samples);
        w.rays.clear();
        w.radiance.clear();
        w.radiance.resize(count, [0.0; 4]);
        w.aovs.clear();
        if self.options.aovs {
            w.aovs.resize(count, None);
        }
        let paths = &mut *w.arriving;
        let (mut pixel, mut sample) = (first / samples, (first % samples) as u32);
        for i in 0..count {
            let x = block.x0 + (pixel % u64::from(block.width)) as u32;
            let y = block.y0 + (pixel / u64::from(block.width)) as u32;
            let seed = pixel_seed(x, y, self.options.seed);
            let point = SobolPoint::new(seed, block.first_sample + sample);
            let [u, v, lens_u, lens_v] = point.sample_4d(&dimensions);
            let film_x = x as f32 + 0.5 + self.options.filter.sample(u);
            let film_y = y as f32 + 0.5 + self.options.filter.sample(v);
            w.rays.push(self.scene.camera.ray(film_x, film_y, [lens_u, lens_v]));
            set(&mut paths.throughput, i, Vec3::ONE);
            paths.pdf[i] = 0.0;
            paths.eta_squared[i] = 1.0;
            (paths.seed[i], paths.shuffled[i]) = point.to_parts();
            paths.sample[i] = i as u32;
            sample += 1;
            if u64::from(sample) == samples {
                (pixel, sample) = (pixel + 1, 0);
            }
        }
    }
}
