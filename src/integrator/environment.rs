//! The environment: paths that leave the scene, and light samples where nothing else shines.

use super::Integrator;
use super::surface::add;
use super::wave::{Vertices, WAVE, Wave, Workspace, get, get_rgb, set, set_rgb};
use crate::light::{EnvironmentLight, ImageMap, solid_angle_density};
use crate::math::{Ray, Vec3};
use crate::sampling::power_heuristic;
use crate::sampling::sampler::{Dimensions, SobolPoint};
use crate::simd::{Kernel, dispatch};

impl Integrator<'_> {
    /// Adds what the paths see that left the scene, weighted against sampling the environment.
    pub(super) fn escape(&self, bounce: u32, w: &mut Workspace) {
        let Some(environment) = self.scene.lights.environment() else { return };
        let count = w.escaped.len();
        look_up(environment, &w.rays, &w.escaped, &w.arriving.pdf, &mut w.wave.vertices);
        let pdf_discrete = self.scene.lights.environment_pdf_discrete();
        let (v, paths) = (&w.wave.vertices, &w.arriving);
        for k in 0..count {
            let i = w.escaped[k] as usize;
            let weight = match paths.pdf[i] {
                scattered if scattered > 0.0 => power_heuristic(scattered, v.light_pdf[k] * pdf_discrete),
                _ => 1.0,
            };
            let sum = &mut w.radiance[paths.sample[i] as usize];
            add(sum, get_rgb(&paths.throughput, i) * get_rgb(&v.light, k) * weight);
            if bounce == 0 {
                sum[3] = 1.0;
            }
        }
    }

    /// The picture around the scene, if nothing else shines.
    pub(super) fn only_environment(&self) -> Option<&ImageMap> {
        let lights = &self.scene.lights;
        lights.environment().filter(|_| lights.len() == 1).and_then(EnvironmentLight::image_map)
    }
}

/// Radiance (to `numbers.light`) and, for rays with a density of their own, density (to `numbers.light_pdf`) of the
/// directions in which rays left.
fn look_up(
    environment: &EnvironmentLight,
    rays: &[Ray],
    escaped: &[u32],
    pdfs: &[f32],
    numbers: &mut Vertices,
) {
    if let Some(map) = environment.image_map() {
        return dispatch(LookUp { map, rays, escaped, pdfs, numbers });
    }
    for (k, &i) in escaped.iter().enumerate() {
        let direction = rays[i as usize].direction;
        set_rgb(&mut numbers.light, k, environment.radiance(direction));
        numbers.light_pdf[k] = environment.pdf_solid_angle(direction);
    }
}

struct LookUp<'a> {
    map: &'a ImageMap,
    rays: &'a [Ray],
    escaped: &'a [u32],
    pdfs: &'a [f32],
    numbers: &'a mut Vertices,
}

impl Kernel for LookUp<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let LookUp { map, numbers: v, .. } = self;
        let count = self.escaped.len().min(WAVE);
        for (k, &i) in self.escaped.iter().enumerate() {
            set(&mut v.wi, k, self.rays[i as usize].direction);
        }
        for k in 0..count {
            let [x, y] = map.uv(get(&v.wi, k));
            (v.target[0][k], v.target[1][k]) = (x, y);
        }
        for (k, &i) in self.escaped.iter().enumerate() {
            let uv = [v.target[0][k], v.target[1][k]];
            set_rgb(&mut v.light, k, map.lookup(uv));
            if self.pdfs[i as usize] > 0.0 {
                v.light_pdf[k] = map.pdf_solid_angle(uv, get(&v.wi, k));
            }
        }
    }
}

/// Light samples that are chosen together; what is beyond the last vertex counts for nothing.
const LANES: usize = 16;

const _: () = assert!(WAVE.is_multiple_of(LANES));

/// Light samples of a scene in which nothing shines but a picture around it.
pub(super) struct SampleEnvironment<'a> {
    pub wave: &'a mut Wave,
    pub count: usize,
    pub dimensions: &'a Dimensions,
    pub map: &'a ImageMap,
}

impl Kernel for SampleEnvironment<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Wave { paths, vertices: v } = self.wave;
        let (map, count) = (self.map, self.count.min(WAVE));
        for i in 0..count {
            let point = SobolPoint::from_parts(paths.seed[i], paths.shuffled[i]);
            let [a, b, ..] = point.sample_4d(self.dimensions);
            set(&mut v.target, i, Vec3::new(a, b, 0.0));
        }
        for first in (0..count).step_by(LANES) {
            let [x, y, _] = &mut v.target;
            let at = first..first + LANES;
            let mut u = [[0.0; LANES]; 2];
            u[0].copy_from_slice(&x[at.clone()]);
            u[1].copy_from_slice(&y[at.clone()]);
            let chosen = map.sample_many_uv(u);
            x[at.clone()].copy_from_slice(&chosen.u);
            y[at.clone()].copy_from_slice(&chosen.v);
            v.light_pdf[at].copy_from_slice(&chosen.pdf_area);
        }
        for i in 0..count {
            set_rgb(&mut v.light, i, map.lookup([v.target[0][i], v.target[1][i]]));
        }
        for i in 0..count {
            let direction = map.direction([v.target[0][i], v.target[1][i]]);
            v.light_pdf[i] *= solid_angle_density(direction);
            set(&mut v.wi, i, direction);
            v.is_infinite[i] = 1.0;
        }
    }
}
