//! Generation of camera rays, with times and wavelengths.

use super::Integrator;
use super::interior::{CameraInterior, Interior};
use super::mis::DirectionPdf;
use super::sampling::{CameraSamples, Purpose};
use super::wave::{
    BounceCounts, PathState, RayVisibility, Scratch, Vertices, WAVE, get, get_rgb, set, set_rgb,
};
use super::workspace::Workspace;
use crate::camera::Camera;
use crate::color::Rgb;
use crate::film::FilterSampler;
use crate::math::{Hit, Ray};
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::simd::{Kernel, dispatch};

impl Integrator<'_> {
    /// Generates camera rays for the next wave of samples of a block; none at the end of the block.
    pub(super) fn generate(&self, samples: &mut CameraSamples<'_>, w: &mut Workspace) {
        self.start_camera_samples(samples, w);
        let count = w.pixels.len();
        w.begin_wave();
        w.rays.clear();
        w.radiance_buffer.begin(count, self.layers, self.clamp_of_branches());
        w.first_hits.reset(count, self.first_hits);
        let (paths, vertices, scratch) = (&mut *w.arriving, &mut w.wave.vertices, &mut w.wave.scratch);
        let dimensions = self.dimensions(0, Purpose::Camera);
        let (camera, filter) = (&self.view.camera, self.options.filter);
        let (path, branch_bits) = (&mut paths.state, self.options.branches.trailing_zeros());
        let start =
            StartPaths { path, vertices, scratch, count, branch_bits, dimensions: &dimensions, filter };
        if camera.is_panorama() {
            start.panoramic(camera);
        } else if camera.has_lens() {
            dispatch(StartRays::<true> { camera, start });
        } else {
            dispatch(StartRays::<false> { camera, start });
        }
        if self.is_moving() || self.scene.accel.uses_times() {
            self.start_times(w);
        }
        if self.is_spectral() {
            self.start_wavelengths(w);
        }
        let is_clipped = camera.is_clipped();
        if is_clipped {
            self.clip_ray_starts(count, w);
        }
        self.start_optional_state(count, w);
        let vertices = &w.wave.vertices;
        let start = |i| Ray::new(get(&vertices.next_origin, i), get(&vertices.next_direction, i));
        w.rays.extend((0..count).map(start));
        if is_clipped {
            self.clip_ray_ends(count, w);
        }
        if camera.is_panorama() {
            end_rays_outside_image_circle(&w.arriving.state, &mut w.rays);
        }
    }

    /// Clip distances along a camera ray, metres.
    fn range(&self, w: &Workspace, i: usize) -> [f32; 2] {
        let direction = get(&w.wave.vertices.next_direction, i);
        match &self.view.moving {
            Some(moving) => moving.at(w.time(i)).range(direction),
            None => self.view.camera.range(direction),
        }
    }

    /// Distance along a camera ray between the clip planes, metres.
    pub(super) fn clip_length(&self, w: &Workspace, i: usize) -> f32 {
        let [near, far] = self.range(w, i);
        far - near
    }

    /// Moves the origins of camera rays to the near clip distance.
    fn clip_ray_starts(&self, count: usize, w: &mut Workspace) {
        for i in 0..count {
            let [near, _] = self.range(w, i);
            let vertices = &mut w.wave.vertices;
            let start = get(&vertices.next_origin, i) + get(&vertices.next_direction, i) * near;
            set(&mut vertices.next_origin, i, start);
        }
    }

    /// Ends camera rays at the far clip distance, and widens their footprints to those at the near clip distance.
    fn clip_ray_ends(&self, count: usize, w: &mut Workspace) {
        for i in 0..count {
            let [near, far] = self.range(w, i);
            w.rays[i].t_max = far - near;
            if self.optional.footprints {
                let footprints = &mut w.arriving.footprints;
                footprints.width[i] += footprints.spread[i] * near;
            }
        }
    }

    /// Initialises the optional state of paths.
    fn start_optional_state(&self, count: usize, w: &mut Workspace) {
        let (paths, vertices) = (&mut *w.arriving, &w.wave.vertices);
        if self.optional.footprints {
            let (width, spread) = self.view.camera.pixel_cone();
            paths.footprints.width[..count].fill(width);
            paths.footprints.spread[..count].fill(spread);
        }
        if self.optional.interior {
            match self.camera_interior {
                CameraInterior::Constant(interior) => paths.interior[..count].fill(interior),
                CameraInterior::PerRay => {
                    for i in 0..count {
                        let origin = get(&vertices.next_origin, i);
                        paths.interior[i] =
                            Interior::around(self.scene, origin, w.times.of(paths.state.radiance_index[i]));
                    }
                }
            }
        }
        if self.optional.depth {
            paths.depth[..count].fill(0);
        }
        if self.optional.transparent_count {
            paths.transparent_count[..count].fill(0);
        }
        if self.optional.bounce_counts {
            paths.bounce_counts[..count].fill(BounceCounts::default());
        }
        if self.optional.min_pdf {
            paths.min_pdf[..count].fill(f32::INFINITY);
        }
        if self.optional.visibility {
            paths.visibility[..count].fill(RayVisibility::camera());
        }
        if self.optional.caustic_chains {
            paths.caustic_chains[..count].fill(0);
            paths.caustic_chain_fraction.iter_mut().for_each(|channel| channel[..count].fill(1.0));
        }
        if self.optional.roulette_reference {
            paths.roulette_reference[..count].fill(0.0);
        }
    }

    /// Sets each path's seed and sample index, and the corner of its pixel in the first two scratch arrays.
    fn start_camera_samples(&self, samples: &mut CameraSamples<'_>, w: &mut Workspace) {
        let (path, [film_x, film_y, ..]) = (&mut w.arriving.state, &mut w.wave.scratch);
        w.pixels.clear();
        for (i, sample) in samples.take(self.samples_per_wave()).enumerate() {
            w.pixels.push(sample.pixel);
            (path.seed[i], path.index_rev[i]) = (sample.seed, sample.index);
            path.radiance_index[i] = i as u32;
            (film_x[i], film_y[i]) = (sample.x as f32, sample.y as f32);
        }
    }
}

/// Generates camera rays from seeds, sample indices and pixel corners, in `vertices.next_origin` and
/// `vertices.next_direction`.
struct StartPaths<'a> {
    path: &'a mut PathState,
    vertices: &'a mut Vertices,
    scratch: &'a mut Scratch,
    count: usize,
    branch_bits: u32,
    dimensions: &'a Dimensions,
    filter: &'a FilterSampler,
}

impl StartPaths<'_> {
    /// Rays of panoramas. Throughput is zero outside the image circle.
    fn panoramic(self, camera: &Camera) {
        let count = self.count.min(WAVE);
        draw::<true>(self.path, self.scratch, self.dimensions, self.branch_bits, count);
        sample_filter(self.scratch, self.filter, count);
        let [film_x, film_y, _, _, lens_u, lens_v, ..] = &*self.scratch;
        for i in 0..count {
            let lens = [lens_u[i], lens_v[i]];
            let ray = camera.panoramic_ray(film_x[i], film_y[i], lens).unwrap_or_else(|| {
                set_rgb(&mut self.path.throughput, i, Rgb::ZERO);
                camera.ray(film_x[i], film_y[i], lens)
            });
            set(&mut self.vertices.next_origin, i, ray.origin);
            set(&mut self.vertices.next_direction, i, ray.direction);
        }
    }
}

/// Sets `t_max` to 0 for rays of zero throughput, which lie outside the image circle of a panorama, so that they hit nothing.
fn end_rays_outside_image_circle(path: &PathState, rays: &mut [Ray]) {
    for (i, ray) in rays.iter_mut().enumerate() {
        if get_rgb(&path.throughput, i) == Rgb::ZERO {
            ray.t_max = 0.0;
        }
    }
}

/// Rays of cameras other than panoramas. Pinhole cameras (`LENS` is false) need half of the random numbers.
struct StartRays<'a, const LENS: bool> {
    camera: &'a Camera,
    start: StartPaths<'a>,
}

impl<const LENS: bool> Kernel for StartRays<'_, LENS> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let StartRays { camera, start } = self;
        let count = start.count.min(WAVE);
        draw::<LENS>(start.path, start.scratch, start.dimensions, start.branch_bits, count);
        sample_filter(start.scratch, start.filter, count);
        generate_rays::<LENS>(start.vertices, start.scratch, camera, count);
    }
}

// Separate loops vectorise; one loop over all steps does not. They are functions since references as arguments don't alias, so that the
// compiler may assume that loop data doesn't change.

/// Initialises paths, and draws film and lens samples into scratch arrays 2 to 5.
#[inline(always)]
fn draw<const LENS: bool>(
    path: &mut PathState,
    scratch: &mut Scratch,
    dimensions: &Dimensions,
    branch_bits: u32,
    count: usize,
) {
    let [_, _, filter_u, filter_v, lens_u, lens_v, ..] = scratch;
    for i in 0..count {
        let point = SobolPoint::of_branches(path.seed[i], path.index_rev[i], branch_bits);
        let [a, b, c, d] = point.sample_4d(dimensions);
        (filter_u[i], filter_v[i]) = (a, b);
        if LENS {
            (lens_u[i], lens_v[i]) = (c, d);
        }
        set_rgb(&mut path.throughput, i, Rgb::ONE);
        path.pdf[i] = DirectionPdf::SPECULAR;
        path.roulette_scale[i] = 1.0;
        path.set_sobol_point(i, point);
    }
}

/// Maps pixel corners, in the first two scratch arrays, to film points sampled by the pixel filter.
#[inline(always)]
fn sample_filter(scratch: &mut Scratch, filter: &FilterSampler, count: usize) {
    let [film_x, film_y, filter_u, filter_v, ..] = scratch;
    for i in 0..count {
        film_x[i] = film_x[i] + 0.5 + filter.sample(filter_u[i]);
        film_y[i] = film_y[i] + 0.5 + filter.sample(filter_v[i]);
    }
}

/// Generates the rays through film points.
#[inline(always)]
fn generate_rays<const LENS: bool>(v: &mut Vertices, scratch: &Scratch, camera: &Camera, count: usize) {
    let [film_x, film_y, _, _, lens_u, lens_v, ..] = scratch;
    for i in 0..count {
        let ray = if LENS {
            camera.lens_ray(film_x[i], film_y[i], [lens_u[i], lens_v[i]])
        } else {
            camera.pinhole_ray(film_x[i], film_y[i])
        };
        set(&mut v.next_origin, i, ray.origin);
        set(&mut v.next_direction, i, ray.direction);
    }
}

impl Integrator<'_> {
    /// Does anything move while the shutter is open?
    pub(super) fn is_moving(&self) -> bool {
        self.scene.is_moving() || self.view.moving.is_some()
    }

    /// Tests the occlusion of shadow rays in scenes without alpha.
    #[inline]
    pub(super) fn occluded(&self, w: &mut Workspace) {
        let Workspace { wave, shadow_rays, shadow_vertices, occluded, pending_hits, times, .. } = w;
        if !self.scene.accel.uses_times() {
            return self.scene.accel.occluded(shadow_rays, occluded);
        }
        pending_hits.clear();
        pending_hits.resize(shadow_rays.len(), Hit::MISS);
        let sample = |&vertex: &u32| wave.paths.state.radiance_index[vertex as usize];
        times.any(&self.scene.accel, shadow_rays, shadow_vertices.iter().map(sample), pending_hits);
        for (occluded, hit) in occluded.iter_mut().zip(&*pending_hits) {
            *occluded = hit.is_hit();
        }
    }

    /// Samples a time for each new path, and regenerates the rays of a moving camera at these times.
    #[cold]
    pub(super) fn start_times(&self, w: &mut Workspace) {
        let Workspace { times, arriving, wave, pixels, .. } = w;
        let dimensions = self.dimensions(0, Purpose::Time);
        let path = &arriving.state;
        let draw = |i: usize| path.sobol_point(i).sample_4d(&dimensions)[0];
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
