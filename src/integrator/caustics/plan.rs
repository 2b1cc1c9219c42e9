//! Which light paths from lights find, the state of such a path, and a tally of their contributions.

use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::{CausticRole, CompiledScene};
use crate::integrator::interior::Interior;
use crate::light::{LightPathSampler, Lights};
use crate::math::{Ray, Vec3};
use crate::sampling::sampler::SobolPoint;

/// Which light paths from lights find, and how these paths start.
#[derive(Clone, Debug)]
pub struct CausticPlan {
    /// The role of each material.
    pub(super) roles: Vec<CausticRole>,
    /// Paths start at the lights before this index; the environment follows.
    pub(super) light_count: u32,
    /// Distribution of the paths' starts.
    pub(super) emission: LightPathSampler,
    /// Seed of these paths.
    pub(super) seed: u32,
    /// Number of paths for one sample of each pixel.
    pub(super) paths: u32,
}

impl CausticPlan {
    /// For a scene; `None` if it has no lights but the environment, or no casters.
    pub fn new(scene: &CompiledScene, seed: u32, paths: u32) -> Option<CausticPlan> {
        let roles = scene.roles();
        let targets = scene.targets(&roles);
        let light_count = (scene.lights.area().len() + scene.lights.punctual().len()) as u32;
        let emission = LightPathSampler::new(&scene.lights, &scene.textures, targets, scene.reach())?;
        Some(CausticPlan { roles, light_count, emission, seed, paths: paths.max(1) })
    }

    /// This plan with another number of paths.
    #[must_use]
    pub fn with_paths(self, paths: u32) -> CausticPlan {
        CausticPlan { paths: paths.max(1), ..self }
    }

    /// Number of paths for one sample of each pixel.
    pub fn paths(&self) -> u32 {
        self.paths
    }

    /// Do paths start at this one of the scene's lights? Not where its emission depends on the hit.
    #[inline(always)]
    pub(super) fn takes(&self, lights: &Lights, light: u32) -> bool {
        light < self.light_count && !lights.light_emits_by_hit(light)
    }

    /// The role of a material.
    #[inline(always)]
    pub(super) fn role(&self, material: u32) -> CausticRole {
        self.roles[material as usize]
    }
}

/// A path from a light.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightPath {
    pub ray: Ray,
    /// Its direction at the light, of unit length.
    pub start: Vec3,
    /// Radiance along the ray; intensity or irradiance of point and directional lights.
    pub radiance: Rgb,
    /// Flux for a radiance of 1.
    pub scale: f32,
    /// Solids around it.
    pub interior: Interior,
    /// Its random numbers, and those that choose the point of the lens.
    pub point: SobolPoint,
    pub lens: [f32; 2],
    /// Number of surfaces that scattered it.
    pub bounces: u32,
    /// All of them are casters or receivers.
    pub has_roles: bool,
    /// It passed panes straight on and hit nothing else: light samples find its light.
    pub is_straight: bool,
    /// The light where it starts.
    pub light: u32,
    /// The light is a point or a direction, and the first surface perfectly specular: no path from the camera finds this light.
    pub is_only_way: bool,
    /// Position of the hero wavelength in the distribution of wavelengths, 0 to 1, in spectral rendering.
    pub hero: Option<f32>,
}

impl LightPath {
    /// The wavelengths that it carries.
    #[inline]
    pub fn wavelengths(&self) -> Option<Wavelengths> {
        self.hero.map(Wavelengths::draw)
    }
}

/// Contributions of paths from lights, to estimate their efficiency.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CausticTally {
    /// Sum of luminances, each as for a pixel that gets all of it.
    pub sum: f64,
    /// Sum of their squares.
    pub squares: f64,
    /// Expected sum of squares for paths from the camera, with one sample of each pixel; infinite where such paths find nothing.
    pub squares_from_camera: f64,
    /// Rays that were traced.
    pub rays: u64,
}

impl CausticTally {
    pub(super) fn add(&mut self, value: f32, value_from_camera: f32) {
        let value = f64::from(value);
        self.sum += value;
        self.squares += value * value;
        self.squares_from_camera += value * f64::from(value_from_camera);
    }

    /// Both together.
    pub fn plus(self, other: CausticTally) -> CausticTally {
        CausticTally {
            sum: self.sum + other.sum,
            squares: self.squares + other.squares,
            squares_from_camera: self.squares_from_camera + other.squares_from_camera,
            rays: self.rays + other.rays,
        }
    }
}
