//! Path tracing in waves (Laine, Karras, Aila 2013): a few thousand paths take each step together, so that rays are
//! traced in batches and loops over paths vectorise.
//!
//! A wave starts at the camera; then each bounce runs through the list of [`stages`], which is the place to start reading.
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
mod medium_segment;
mod mis;
mod radiance_buffer;
pub mod reuse;
mod sampling;
mod scatter;
mod shading_geometry;
mod shading_groups;
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
use crate::film::{AovSet, AovSpace, FilterSampler, MatteIds, Source};
use crate::sampling::sampler::Dimensions;
use direct_light::has_vector_sampler;
use interior::CameraInterior;
use radiance_buffer::Layers;
use reuse::Tiling;
use sampling::{CameraSamples, Purpose};
use shading_groups::{ShadingGroup, groups_of};
use stages::{Bounce, Stages};
use wave::{OptionalState, StateConditions};

/// Options that concern paths.
#[derive(Clone, Debug)]
pub struct PathOptions<'a> {
    /// Largest number of scattering events; 0 shows emission only.
    pub max_depth: u32,
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
    /// Tell what shadow catchers catch. Paths are neither shared nor split then.
    pub catchers: bool,
    /// Make samples transparent that see where nothing is through clear glass.
    pub transparent_glass: bool,
    /// Soften the edge of shadows that shading normals lead past the edges of triangles.
    pub soft_terminator: bool,
    /// Which samples share their paths, if any. Blocks are a wave then, and end where regions do.
    pub reuse: Option<Tiling>,
    /// How many paths go on from the first surface of each sample; a power of two, and 1 where samples share paths.
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
    options: PathOptions<'a>,
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
    /// The stages in use.
    stages: Stages,
}

/// Bounces whose Sobol dimensions are prepared in advance.
const PREPARED_BOUNCES: u32 = 32;

/// Number of bounces between checks for interruption; few paths reach the first.
const STOP_INTERVAL: u32 = 64;

/// Maximum number of scattering events within solids: nearly all paths leave a body without absorption even where it is a
/// hundred mean free paths thick, after some ten thousand steps at most.
const MAX_WALK_STEPS: u32 = 1 << 16;

impl<'a> Integrator<'a> {
    /// Prepares to trace a view of a scene.
    pub fn new(scene: &'a CompiledScene, view: &'a View, options: PathOptions<'a>) -> Integrator<'a> {
        let sets = 1 + 2 * PREPARED_BOUNCES.min(options.max_depth);
        let groups = groups_of(scene);
        let dimensions = (0..sets).map(Dimensions::new).collect();
        let layers = Layers::new(options.aovs, options.light_groups, options.catchers);
        let excluded = scene.materials.iter().map(|m| m.is_of_caught_object()).collect();
        let absent_or_excluded =
            scene.materials.iter().map(|m| m.may_be_absent() || m.is_of_caught_object()).collect();
        let may_be_absent = scene.materials.iter().map(|m| m.may_be_absent()).collect();
        let mut integrator = Integrator {
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
                light_passes: layers.has_passes(),
                caustics: options.caustics.is_some(),
                guiding: options.guide.is_some(),
                transparent_glass: options.transparent_glass,
            }),
            only_light: has_vector_sampler(&scene.lights).then_some(0),
            options,
            dimensions,
            stages: Stages::NONE,
        };
        integrator.stages = Stages::of(&integrator);
        integrator
    }

    /// Traces all samples of a block and passes them to `sink` in order: pixel by pixel, sample by sample. Calls `stop`
    /// once in 64 bounces, so that very long paths can be interrupted; false if they were: then samples are missing.
    #[must_use]
    pub fn trace(
        &self,
        block: &Block,
        w: &mut Workspace,
        stop: &dyn Fn() -> bool,
        mut sink: impl FnMut(&PathSample<'_>),
    ) -> bool {
        let mut samples =
            CameraSamples::new(self.options.plan, block, self.options.branches.trailing_zeros());
        loop {
            self.generate(&mut samples, w);
            if w.pixels.is_empty() {
                return true;
            }
            if self.has_shadow_catchers() {
                self.save_camera_paths(w);
            }
            if !self.trace_wave(block, w, stop)
                || self.has_shadow_catchers() && !self.trace_without_casters(w, stop)
            {
                return false;
            }
            if self.is_spectral() {
                w.radiance_buffer.convert_to_rgb(w.times.all_wavelengths());
            }
            let has_layers = w.radiance_buffer.has_layers();
            for (i, (&[r, g, b, alpha], &pixel)) in
                w.radiance_buffer.samples().iter().zip(&w.pixels).enumerate()
            {
                let (parts, plain) =
                    (if has_layers { w.radiance_buffer.parts(i) } else { &[] }, w.radiance_buffer.plain(i));
                let first_hit = w.first_hits.get(i);
                sink(&PathSample { pixel, rgb: [r, g, b], alpha, first_hit, parts, plain });
            }
        }
    }

    /// Traces the generated wave, with the work of techniques around it; false if `stop` interrupted it.
    fn trace_wave(&self, block: &Block, w: &mut Workspace, stop: &dyn Fn() -> bool) -> bool {
        let Some(tiling) = &self.options.reuse else {
            let is_done = self.trace_paths(w, stop);
            self.make_training_samples(w);
            if is_done && self.options.branches > 1 && self.options.keeps_plain {
                self.join_branches(w);
            }
            return is_done;
        };
        self.begin_reuse(tiling, block, w.pixels.len(), w);
        let is_done = self.trace_paths(w, stop);
        if is_done {
            self.share_paths(tiling, w);
        }
        is_done
    }

    /// Traces the paths of a wave to their ends; false if `stop` interrupted it. See [`stages`] for the steps.
    fn trace_paths(&self, w: &mut Workspace, stop: &dyn Fn() -> bool) -> bool {
        let max_walk_steps = if self.optional.depth { MAX_WALK_STEPS } else { 0 };
        let last = self.options.max_depth.saturating_add(max_walk_steps);
        for number in 0..=last {
            if number % STOP_INTERVAL == STOP_INTERVAL - 1 && stop() {
                return false;
            }
            let mut bounce = Bounce::new(number, number == last);
            self.run_stages(&self.stages.arrive, &mut bounce, w);
            if bounce.vertices.all().is_empty() {
                return true;
            }
            self.run_stages(&self.stages.leave, &mut bounce, w);
            if w.rays.is_empty() {
                return true;
            }
        }
        true
    }

    /// Is the shadow terminator softened: requested, and do shading normals differ from geometric ones?
    fn softens_terminator(&self) -> bool {
        self.options.soft_terminator && self.scene.features.bent_normals
    }

    fn dimensions(&self, bounce: u32, purpose: Purpose) -> Dimensions {
        let set = purpose.dimension_set(bounce);
        self.dimensions.get(set as usize).copied().unwrap_or_else(|| Dimensions::new(set))
    }
}
