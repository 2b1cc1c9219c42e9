//! Paths start: camera rays.

use super::wave::{Paths, Vertices, WAVE, Workspace, get, set, set_rgb};
use super::{Block, Integrator, Purpose};
use crate::camera::Camera;
use crate::color::Rgb;
use crate::film::FilterSampler;
use crate::math::Ray;
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
        let (paths, vertices) = (&mut *w.arriving, &mut w.wave.vertices);
        self.number_samples(block, first, count, paths, vertices);
        let (dimensions, scene) = (self.dimensions(0, Purpose::Camera), self.scene);
        let (camera, filter) = (&scene.camera, self.options.filter);
        dispatch(StartPaths { paths, vertices, count, dimensions: &dimensions, camera, filter });
        if scene.features.footprints {
            let (width, spread) = camera.pixel_cone();
            paths.cone_width[..count].fill(width);
            paths.cone_spread[..count].fill(spread);
        }
        if scene.features.media {
            paths.interior[..count].fill(self.camera_interior);
        }
        let start = |i| Ray::new(get(&vertices.origin, i), get(&vertices.direction, i));
        w.rays.extend((0..count).map(start));
    }

    /// Gives each path its pixel's seed and its sample's number, and `vertices.p` the pixel's corner.
    fn number_samples(
        &self,
        block: &Block,
        first: u64,
        count: usize,
        paths: &mut Paths,
        vertices: &mut Vertices,
    ) {
        let mut at = Cursor::new(block, first);
        let mut seed = pixel_seed(at.x, at.y, self.options.seed);
        for i in 0..count {
            if at.sample == 0 {
                seed = pixel_seed(at.x, at.y, self.options.seed);
            }
            paths.seed[i] = seed;
            paths.shuffled[i] = block.first_sample + at.sample as u32;
            paths.sample[i] = i as u32;
            (vertices.p[0][i], vertices.p[1][i]) = (at.x as f32, at.y as f32);
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

/// Starts paths from their pixels' seeds, samples' numbers and pixels' corners; the rays go to `vertices.origin` and
/// `vertices.direction`.
struct StartPaths<'a> {
    paths: &'a mut Paths,
    vertices: &'a mut Vertices,
    count: usize,
    dimensions: &'a Dimensions,
    camera: &'a Camera,
    filter: &'a FilterSampler,
}

impl Kernel for StartPaths<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let StartPaths { paths, vertices: v, camera, filter, .. } = self;
        let count = self.count.min(WAVE);
        // Loops of one kind each vectorise; together they don't.
        for i in 0..count {
            let point = SobolPoint::new(paths.seed[i], paths.shuffled[i]);
            let [film_x, film_y, lens_u, lens_v] = point.sample_4d(self.dimensions);
            (v.light[0][i], v.light[1][i]) = (film_x, film_y);
            (v.weights[0][i], v.weights[1][i]) = (lens_u, lens_v);
            set_rgb(&mut paths.throughput, i, Rgb::ONE);
            paths.pdf[i] = 0.0;
            paths.eta_squared[i] = 1.0;
            (paths.seed[i], paths.shuffled[i]) = point.to_parts();
        }
        for i in 0..count {
            v.p[0][i] = v.p[0][i] + 0.5 + filter.sample(v.light[0][i]);
            v.p[1][i] = v.p[1][i] + 0.5 + filter.sample(v.light[1][i]);
        }
        for i in 0..count {
            let ray = camera.ray(v.p[0][i], v.p[1][i], [v.weights[0][i], v.weights[1][i]]);
            set(&mut v.origin, i, ray.origin);
            set(&mut v.direction, i, ray.direction);
        }
    }
}
