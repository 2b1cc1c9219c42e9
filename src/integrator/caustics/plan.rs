//! Setup of light tracing, the state of a light path, and statistics of light paths' contributions.

use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::{CausticRole, CompiledScene};
use crate::integrator::interior::Interior;
use crate::light::{LightPathSampler, Lights};
use crate::math::{Ray, Vec3};
use crate::sampling::sampler::SobolPoint;

/// Setup of light tracing.
#[derive(Clone, Debug)]
pub struct CausticPlan {
    /// Caustic role by material.
    pub(super) roles: Vec<CausticRole>,
    /// Number of lights that emit light paths: all but the environment, which is the last.
    pub(super) light_count: u32,
    /// Samples emitted rays.
    pub(super) emission: LightPathSampler,
    pub(super) seed: u32,
    /// Number of light paths per sample of the whole picture.
    pub(super) paths: u32,
}

impl CausticPlan {
    /// The plan for a scene; `None` without casters or without lights other than the environment.
    pub fn new(scene: &CompiledScene, seed: u32, paths: u32) -> Option<CausticPlan> {
        let roles = scene.roles();
        let targets = scene.targets(&roles);
        let light_count = (scene.lights.area().len() + scene.lights.punctual().len()) as u32;
        let emission =
            LightPathSampler::new(&scene.lights, &scene.textures, targets, scene.bounding_radius())?;
        Some(CausticPlan { roles, light_count, emission, seed, paths: paths.max(1) })
    }

    /// This plan with another number of paths.
    #[must_use]
    pub fn with_paths(self, paths: u32) -> CausticPlan {
        CausticPlan { paths: paths.max(1), ..self }
    }

    /// This plan with other random numbers.
    #[must_use]
    pub fn with_seed(self, seed: u32) -> CausticPlan {
        CausticPlan { seed, ..self }
    }

    /// Number of light paths per sample of the whole picture.
    pub fn paths(&self) -> u32 {
        self.paths
    }

    /// Does this light emit light paths? Not if its emission depends on the hit.
    #[inline(always)]
    pub(super) fn emits_from(&self, lights: &Lights, light: u32) -> bool {
        light < self.light_count && !lights.light_emits_by_hit(light)
    }

    #[inline(always)]
    pub(super) fn role(&self, material: u32) -> CausticRole {
        self.roles[material as usize]
    }
}

/// The state of a light path.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightPath {
    pub ray: Ray,
    /// Direction at the light, unit length.
    pub start: Vec3,
    /// Radiance along the ray; intensity (point lights) or irradiance (directional lights).
    pub radiance: Rgb,
    /// Flux for a radiance of 1.
    pub scale: f32,
    /// Solids around the ray.
    pub interior: Interior,
    pub point: SobolPoint,
    /// Random numbers for the lens points of connections.
    pub lens: [f32; 2],
    /// Number of scattering vertices.
    pub bounces: u32,
    /// Have all scattering vertices been casters or receivers?
    pub has_only_caustic_roles: bool,
    /// Has the path only passed panes without deviation? Then shadow rays through panes sample the same light.
    pub is_straight: bool,
    /// Index of the light.
    pub light: u32,
    /// The light is a delta light and the first surface perfectly specular: no camera path samples this light.
    pub has_no_camera_path: bool,
    /// Random number of the hero wavelength, 0 to 1, in spectral rendering.
    pub hero: Option<f32>,
}

impl LightPath {
    /// The path's wavelengths in spectral rendering.
    #[inline]
    pub fn wavelengths(&self) -> Option<Wavelengths> {
        self.hero.map(Wavelengths::sample)
    }
}

/// Statistics of light paths' contributions, to estimate their efficiency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CausticStats {
    /// Sum of the luminances of contributions, for a filter weight of 1.
    pub sum: f64,
    /// Sum of squared luminances.
    pub squares: f64,
    /// Expected sum of squared luminances of camera paths with one sample per pixel; infinite if camera paths can't sample the light.
    pub squares_from_camera: f64,
    /// Number of rays traced.
    pub rays: u64,
}

impl CausticStats {
    pub(super) fn add(&mut self, value: f32, value_from_camera: f32) {
        let value = f64::from(value);
        self.sum += value;
        self.squares += value * value;
        self.squares_from_camera += value * f64::from(value_from_camera);
    }

    /// The sum of two sets of statistics.
    pub fn plus(self, other: CausticStats) -> CausticStats {
        CausticStats {
            sum: self.sum + other.sum,
            squares: self.squares + other.squares,
            squares_from_camera: self.squares_from_camera + other.squares_from_camera,
            rays: self.rays + other.rays,
        }
    }
}
