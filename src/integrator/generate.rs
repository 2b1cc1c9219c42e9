//! Paths start: camera rays.

use super::wave::{Paths, Vertices, WAVE, Workspace, get, set};
use super::{Block, Integrator, Purpose};
use crate::math::Vec3;
use crate::sampling::sampler::{Dimensions, SobolPoint, pixel_seed};
use crate::simd::{Kernel, dispatch};

impl Integrator<'_> {
    /// Starts samples `first .. first + count` of a block, counted pixel by pixel.
    pub(super) fn generate(&self, block: &Block, first: u64, count: usize, w: &mut Workspace) {
        w.rays.clear();
        w.radiance.clear();
        w.radiance.resize(count, [0.0; 4]);
        w.aovs.clear();
        if self.options.aovs {
            w.aovs.resize(count, None);
        }
        let (paths, numbers) = (&mut *w.arriving, &mut w.wave.vertices);
        self.number_samples(block, first, count, paths);
        let dimensions = self.dimensions(0, Purpose::Camera);
        dispatch(StartPaths { paths, numbers, count, dimensions: &dimensions });
        if self.scene.features.footprints {
            let (width, spread) = self.scene.camera.pixel_cone();
            paths.cone_width[..count].fill(width);
            paths.cone_spread[..count].fill(spread);
        }
        if self.scene.features.media {
            paths.interior[..count].fill(self.camera_interior);
        }
        let samples = u64::from(block.samples);
        let mut at = Cursor::new(block, first);
        for i in 0..count {
            let film = get(&numbers.light, i);
            let x = at.x as f32 + 0.5 + self.options.filter.sample(film.x);
            let y = at.y as f32 + 0.5 + self.options.filter.sample(film.y);
            w.rays.push(self.scene.camera.ray(x, y, [film.z, numbers.light_pdf[i]]));
            at.advance(samples);
        }
    }

    /// Gives each path its pixel's seed and its sample's number.
    fn number_samples(&self, block: &Block, first: u64, count: usize, paths: &mut Paths) {
        let mut at = Cursor::new(block, first);
        let mut seed = pixel_seed(at.x, at.y, self.options.seed);
        for i in 0..count {
            if at.sample == 0 {
                seed = pixel_seed(at.x, at.y, self.options.seed);
            }
            paths.seed[i] = seed;
            paths.shuffled[i] = block.first_sample + at.sample as u32;
            paths.sample[i] = i as u32;
            at.advance(u64::from(block.samples));
        }
    }
}

/// Walks through the samples of a block, pixel by pixel.
struct Cursor {
    x: u32,
    y: u32,
    sample: u64,
    x0: u32,
    x1: u32,
}

impl Cursor {
    fn new(block: &Block, first: u64) -> Cursor {
        let samples = u64::from(block.samples);
        let (pixel, width) = (first / samples, u64::from(block.width));
        Cursor {
            x: block.x0 + (pixel % width) as u32,
            y: block.y0 + (pixel / width) as u32,
            sample: first % samples,
            x0: block.x0,
            x1: block.x0 + block.width,
        }
    }

    #[inline(always)]
    fn advance(&mut self, samples: u64) {
        self.sample += 1;
        if self.sample == samples {
            self.sample = 0;
            self.x += 1;
            if self.x == self.x1 {
                (self.x, self.y) = (self.x0, self.y + 1);
            }
        }
    }
}

/// Starts paths from their pixels' seeds and samples' numbers. The camera's four random numbers go to `numbers.light`
/// and `numbers.light_pdf`.
struct StartPaths<'a> {
    paths: &'a mut Paths,
    numbers: &'a mut Vertices,
    count: usize,
    dimensions: &'a Dimensions,
}

impl Kernel for StartPaths<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let StartPaths { paths, numbers, .. } = self;
        for i in 0..self.count.min(WAVE) {
            let point = SobolPoint::new(paths.seed[i], paths.shuffled[i]);
            let [film_x, film_y, lens_u, lens_v] = point.sample_4d(self.dimensions);
            set(&mut numbers.light, i, Vec3::new(film_x, film_y, lens_u));
            numbers.light_pdf[i] = lens_v;
            set(&mut paths.throughput, i, Vec3::ONE);
            paths.pdf[i] = 0.0;
            paths.eta_squared[i] = 1.0;
            (paths.seed[i], paths.shuffled[i]) = point.to_parts();
        }
    }
}
