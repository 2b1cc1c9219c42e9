//! Path tracing in waves (Laine, Karras, Aila 2013): a few thousand paths take each step together, so that rays are
//! traced in batches and loops over paths vectorise.
//!
//! A wave starts at the camera; then each bounce runs through the list of `stages`, which is the place to start reading.
//!
//! Light that arrives directly is found in two ways, by sampling lights and by hitting them after scattering, weighted
//! by the power heuristic (Veach 1997, section 9.2). Where paths are shared, they are cut at surfaces on their way and
//! connected to each other at the end of the wave: see [`reuse`]. Results depend on nothing but the scene, the options
//! and the sample (and its group, where paths are shared): neither on threads nor on how samples are grouped into
//! waves.

mod caustics;
mod direct_light;
mod emission;
mod first_hit;
mod generate;
mod guiding;
mod interfaces;
mod interior;
mod limits;
mod medium_segment;
mod mis;
mod mixes;
mod panes;
mod radiance_buffer;
mod refracted_lights;
pub mod reuse;
mod sampling;
mod scatter;
mod shading_geometry;
mod shading_groups;
mod slabs;
mod stages;
mod surface;
#[cfg(test)]
mod tests;
mod transparency;
mod visibility;
mod volumes;
mod wave;
mod workspace;

pub use caustics::{CausticPlan, CausticTally};
pub use guiding::{BlockSamples, CellSamples, Grid, Guide, TrainedCells, TrainingSample};
pub use sampling::{Block, SamplePlan};

pub use wave::WAVE;
pub use workspace::{RayCounts, Workspace};

use crate::compile::{CompiledScene, View};
use crate::film::{Aov, AovSet, AovSpace, FilterSampler, MatteIds, Source};
use crate::sampling::sampler::Dimensions;
use crate::scene::{BounceLimits, Clamp, SkippedCaustics};
use interior::CameraInterior;
use radiance_buffer::Layers;
use reuse::Tiling;
use sampling::Purpose;
use shading_geometry::Terminator;
use shading_groups::{ShadingGroup, groups_of};
use wave::{OptionalState, StateConditions};

/// Options that concern paths.
#[derive(Clone, Debug)]
pub struct IntegratorOptions<'a> {
    /// Largest number of scattering events; 0 shows emission only.
    pub max_depth: u32,
    /// Maximum numbers of scattering events by kind.
    pub bounces: BounceLimits,
    /// Clamping of the light of single paths.
    pub clamp: Clamp,
    /// Strength of the glossy filter; 0 without it.
    pub filter_glossy: f32,
    /// Caustics that are left out.
    pub skip_caustics: SkippedCaustics,
    /// How many samples pixels take, and which random points.
    pub plan: SamplePlan<'a>,
    /// Reconstruction filter.
    pub filter: &'a FilterSampler,
    /// AOVs of first hits and light passes that are asked for.
    pub aovs: AovSet,
    /// Which space those of places and directions are in.
    pub aov_space: AovSpace,
    /// The ids that mattes show.
    pub mattes: &'a MatteIds,
    /// How many of the scene's groups of lights are kept apart: all or none.
    pub light_groups: usize,
    /// Record the light on shadow catchers with and without shadow casters. Paths are neither shared nor split then.
    pub catchers: bool,
    /// Make samples transparent that see where nothing is through clear glass.
    pub transparent_glass: bool,
    /// Soften the edge of shadows that shading normals lead past the edges of triangles.
    pub soft_terminator: bool,
    /// Which samples share their paths, if any. Blocks are a wave then, and end where regions do.
    pub reuse: Option<Tiling>,
    /// How many paths continue from the first surface of each sample; a power of two, and 1 where samples share paths.
    pub branches: u32,
    /// Keep what samples have alone, without sharing and splitting.
    pub keeps_plain: bool,
    /// Which light is left to paths from lamps, if any.
    pub caustics: Option<&'a CausticPlan>,
    /// Guides the paths, if any.
    pub guide: Option<&'a Guide>,
    /// Record what paths find, to train a guide: with one, blank or not. Paths are neither shared nor split then.
    pub records_training: bool,
}

/// A finished sample.
#[derive(Clone, Copy, Debug)]
pub struct PathSample<'a> {
    /// Pixel of the block, row by row.
    pub pixel: u32,
    /// Radiance, linear.
    pub rgb: [f32; 3],
    /// Alpha, 0 to 1: 1 where the ray hit an object, less behind clear glass.
    pub alpha: f32,
    /// Components of the requested AOVs of the first surface, if there is one, one after another in the
    /// order of the table of AOVs.
    pub first_hit: Option<&'a [f32]>,
    /// The requested light passes, then the light groups.
    pub parts: &'a [[f32; 3]],
    /// The radiance without path sharing and splitting, where that is recorded.
    pub plain: [f32; 3],
}

/// Traces paths through a scene.
pub struct Integrator<'a> {
    scene: &'a CompiledScene,
    view: &'a View,
    options: IntegratorOptions<'a>,
    /// Shading group of each material.
    groups: Vec<ShadingGroup>,
    /// By material: may its surfaces be absent in places?
    may_be_absent: Vec<bool>,
    /// By material: is it excluded when shadow catchers are rendered without their casters?
    excluded: Vec<bool>,
    /// By material: either of the two?
    absent_or_excluded: Vec<bool>,
    /// AOVs of first hits.
    first_hits: AovSet,
    /// Layers of the radiance that are recorded.
    layers: Layers,
    /// Solids around the camera.
    camera_interior: CameraInterior,
    /// Optional path state in use.
    optional: OptionalState,
    /// The scene's light, where it has a single one with a vectorised sampler.
    only_light: Option<u32>,
    /// Prepared Sobol dimensions of the camera and of the first bounces.
    dimensions: Vec<Dimensions>,
}

/// Bounces whose Sobol dimensions are prepared in advance.
const PREPARED_BOUNCES: u32 = 32;

impl<'a> Integrator<'a> {
    /// Prepares to trace a view of a scene.
    pub fn new(scene: &'a CompiledScene, view: &'a View, options: IntegratorOptions<'a>) -> Integrator<'a> {
        let sets = 1 + 2 * PREPARED_BOUNCES.min(options.max_depth);
        let groups = groups_of(scene, options.filter_glossy > 0.0);
        let dimensions = (0..sets).map(Dimensions::new).collect();
        let layers = Layers::new(options.aovs, options.light_groups, options.catchers);
        let excluded = scene.materials.iter().map(|m| m.is_of_caught_object()).collect();
        let absent_or_excluded =
            scene.materials.iter().map(|m| m.may_be_absent() || m.is_of_caught_object()).collect();
        let may_be_absent = scene.materials.iter().map(|m| m.may_be_absent()).collect();
        Integrator {
            scene,
            view,
            groups,
            may_be_absent,
            excluded,
            absent_or_excluded,
            first_hits: options.aovs.of(Source::FirstHit),
            layers,
            camera_interior: CameraInterior::of(scene, view),
            optional: OptionalState::of(&StateConditions {
                features: &scene.features,
                selects_by_normal: scene.lights.use_tree(),
                bounce_limits: options.bounces != BounceLimits::NONE,
                filter_glossy: options.filter_glossy > 0.0,
                skips_caustics: options.skip_caustics != SkippedCaustics::NONE,
                light_passes: layers.has_passes(),
                caustics: options.caustics.is_some(),
                guiding: options.guide.is_some(),
                transparent_glass: options.transparent_glass,
                denoising_guides: options.aovs.contains(Aov::DenoisingAlbedo)
                    || options.aovs.contains(Aov::DenoisingNormal),
            }),
            only_light: scene.lights.is_vectorised().then_some(0),
            options,
            dimensions,
        }
    }

    /// Is the shadow terminator softened: requested, and do shading normals differ from geometric ones?
    fn softens_terminator(&self) -> bool {
        self.options.soft_terminator && self.scene.features.bent_normals
    }

    /// What shading normals do to light near the horizon.
    fn terminator(&self) -> Terminator {
        match self.softens_terminator() {
            false => Terminator::Sharp,
            true if self.scene.features.mapped_normals => Terminator::Relief,
            true => Terminator::Soft,
        }
    }

    fn dimensions(&self, bounce: u32, purpose: Purpose) -> Dimensions {
        let set = purpose.dimension_set(bounce);
        self.dimensions.get(set as usize).copied().unwrap_or_else(|| Dimensions::new(set))
    }
}
