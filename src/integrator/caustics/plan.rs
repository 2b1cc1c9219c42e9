//! Which light paths from lights find, the state of such a path, and what the paths bring.

use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::{CompiledScene, Role};
use crate::integrator::interior::Interior;
use crate::light::Emission;
use crate::math::Ray;
use crate::sampling::sampler::SobolPoint;

/// Which light is left to paths from lamps, and how these start.
#[derive(Clone, Debug)]
pub struct CausticPlan {
    /// Role of each material.
    pub(super) roles: Vec<Role>,
    /// The lights before this one are lamps, of which light is left to these paths; the environment follows.
    pub(super) lamps: u32,
    /// How light leaves them.
    pub(super) emission: Emission,
    /// Seed of these paths.
    pub(super) seed: u32,
    /// How many stand for one sample of each pixel.
    pub(super) paths: u32,
}

impl CausticPlan {
    /// For a scene; `None` if it has no lamps, or nothing that sends their light on.
    pub fn new(scene: &CompiledScene, seed: u32, paths: u32) -> Option<CausticPlan> {
        let roles = scene.roles();
        let targets = scene.targets(&roles);
        let lamps = (scene.lights.area().len() + scene.lights.punctual().len()) as u32;
        let emission = Emission::new(&scene.lights, &scene.textures, targets, scene.reach())?;
        Some(CausticPlan { roles, lamps, emission, seed, paths: paths.max(1) })
    }

    /// The same with another number of paths.
    #[must_use]
    pub fn with_paths(self, paths: u32) -> CausticPlan {
        CausticPlan { paths: paths.max(1), ..self }
    }

    /// How many paths stand for one sample of each pixel.
    pub fn paths(&self) -> u32 {
        self.paths
    }

    /// Is light of this lamp taken?
    #[inline(always)]
    pub(super) fn takes(&self, light: u32) -> bool {
        light < self.lamps
    }

    /// Role of a material.
    #[inline(always)]
    pub(super) fn role(&self, material: u32) -> Role {
        self.roles[material as usize]
    }
}

/// A path from a lamp.
#[derive(Clone, Copy, Debug)]
pub(super) struct LampPath {
    pub ray: Ray,
    /// Radiance that arrives along the ray; of lamps without a size, what they have in its place.
    pub radiance: Rgb,
    /// Flux for a radiance of 1.
    pub scale: f32,
    /// Solids around it.
    pub interior: Interior,
    /// Its random numbers, and those that choose the point of the lens.
    pub point: SobolPoint,
    pub lens: [f32; 2],
    /// Surfaces that sent it on or scattered it.
    pub bounces: u32,
    /// All of them have a role.
    pub has_roles: bool,
    /// The lamp.
    pub light: u32,
    /// It has no size, and where its light went first is perfectly smooth: no path from the camera finds it.
    pub is_only_way: bool,
    /// Where in the distribution of wavelengths its hero is, if it carries wavelengths; else NaN.
    pub hero: f32,
}

impl LampPath {
    /// The wavelengths that it carries.
    #[inline]
    pub fn waves(&self) -> Option<Wavelengths> {
        (!self.hero.is_nan()).then(|| Wavelengths::draw(self.hero))
    }
}

/// What paths from lamps have brought, to judge them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CausticTally {
    /// Sum of luminances, in the unit of a pixel that gets all of it.
    pub sum: f64,
    /// Sum of their squares.
    pub squares: f64,
    /// The sum of the squares that paths from the camera would have brought for one sample of each pixel; infinite where such
    /// paths find nothing.
    pub squares_from_camera: f64,
    /// Rays that were traced.
    pub rays: u64,
}

impl CausticTally {
    pub(super) fn add(&mut self, value: f32, brought_from_camera: f32) {
        let value = f64::from(value);
        self.sum += value;
        self.squares += value * value;
        self.squares_from_camera += value * f64::from(brought_from_camera);
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
