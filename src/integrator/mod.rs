//! Path tracing in waves (Laine, Karras, Aila 2013): a few thousand paths take each step together, so that rays are
//! traced in batches and loops over paths vectorise.
//!
//! A wave starts at the camera; then each bounce is one turn of a loop:
//!
//! ```text
//! intersect -> surfaces (emission, sorted vertices) -> light samples -> direct light (shadow rays) -> scatter -> next rays
//! ```
//!
//! Light that arrives directly is found in two ways, by sampling lights and by hitting them after scattering, weighted
//! by the power heuristic (Veach 1997, section 9.2). Where paths are shared, they are cut at surfaces on their way and
//! connected to each other at the end of the wave: see [`reuse`]. Results depend on nothing but the scene, the options and the
//! sample (and its group, where paths are shared): neither on threads nor on how samples are grouped into waves.

mod caustics;
mod direct_light;
mod emission;
mod first_hit;
mod generate;
mod guiding;
mod interfaces;
mod interior;
mod medium_segment;
mod radiance_buffer;
pub mod reuse;
mod sampling;
mod scatter;
mod shading_geometry;
mod shading_groups;
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
pub use sampling::Block;
pub use sampling::SamplePlan;
pub use wave::WAVE;
pub use workspace::RayCounts;
pub use workspace::Workspace;

use crate::compile::{CompiledScene, View};
use crate::film::{AovSet, AovSpace, FilterSampler, MatteIds, Source};
use crate::sampling::sampler::Dimensions;
use direct_light::has_vector_sampler;
use interior::CameraInterior;
use radiance_buffer::Layers;
use reuse::Tiling;
use sampling::CameraSamples;
use shading_groups::{ShadingGroup, SortedVertices, groups_of};
use wave::PathParts;

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

/// One finished path.
#[derive(Clone, Copy, Debug)]
pub struct PathSample<'a> {
    /// Pixel of the block, row by row.
    pub pixel: u32,
    /// Radiance, linear.
    pub rgb: [f32; 3],
    /// 1 where something was seen, less where that was glass before nothing.
    pub alpha: f32,
    /// What the AOVs asked for show of the first surface, if it hit one: their components one after another, in the
    /// order of the table of AOVs.
    pub first_hit: Option<&'a [f32]>,
    /// The light passes asked for, then the groups of lights.
    pub parts: &'a [[f32; 3]],
    /// The radiance that the sample has alone, without sharing and splitting, where that is kept.
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
    /// By material: is it left out where what shadow catchers catch is told?
    excluded: Vec<bool>,
    /// By material: that, or may its surfaces be absent?
    absent_or_excluded: Vec<bool>,
    /// Those of the AOVs that show first hits.
    first_hits: AovSet,
    /// Layers of the radiance that are kept.
    layers: Layers,
    /// Solids around the camera.
    camera_interior: CameraInterior,
    /// What paths carry.
    parts: PathParts,
    /// The scene's light, where it has one that is sampled without a choice.
    only_light: Option<u32>,
    /// Sobol dimensions of the camera and of each bounce, as far as most paths go.
    dimensions: Vec<Dimensions>,
}

/// Bounces whose Sobol dimensions are prepared in advance.
const PREPARED_BOUNCES: u32 = 32;

/// The set of dimensions of the time: far from those of all bounces.
const TIME_SET: u32 = 1 << 31;

/// The set of dimensions of the wavelengths.
const WAVELENGTH_SET: u32 = TIME_SET - 1;

/// Bounces between two questions whether to stop; few paths see the first.
const STOP_INTERVAL: u32 = 64;

/// What paths may scatter within solids besides: a body that absorbs nothing is left by nearly all paths even where it is a
/// hundred mean free paths thick, which take some ten thousand steps at most.
const MAX_WALK_STEPS: u32 = 1 << 16;

/// Which of a path's sets of four Sobol dimensions is for what.
#[derive(Clone, Copy)]
enum Purpose {
    /// Film x and y, lens.
    Camera,
    /// Point on the light (2), choice of the light.
    Light,
    /// Direction (2), lobe, roulette.
    Scatter,
    /// How far a path flies through a medium (2), the lamp that guides it (2).
    MediumSegment,
    /// When it looks at the scene (1).
    Time,
    /// Which wavelengths it carries (1).
    Wavelength,
}

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
            parts: PathParts::of(
                &scene.features,
                scene.lights.use_tree(),
                layers.has_passes(),
                options.caustics.is_some(),
                options.guide.is_some(),
                options.transparent_glass,
            ),
            only_light: has_vector_sampler(&scene.lights).then_some(0),
            options,
            dimensions,
        }
    }

    /// Traces all samples of a block and hands them on in order: pixel by pixel, sample by sample. Asks `stop` once in
    /// 64 bounces, so that paths which hardly ever end can be stopped; false if they were, and then the
    /// samples handed on are not all.
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
                w.sink.convert_to_rgb(w.times.all_wavelengths());
            }
            let has_layers = w.sink.has_layers();
            for (i, (&[r, g, b, alpha], &pixel)) in w.sink.samples().iter().zip(&w.pixels).enumerate() {
                let (parts, plain) = (if has_layers { w.sink.parts(i) } else { &[] }, w.sink.plain(i));
                let first_hit = w.first_hits.get(i);
                sink(&PathSample { pixel, rgb: [r, g, b], alpha, first_hit, parts, plain });
            }
        }
    }

    /// Traces the wave that was generated; false if `stop` said so.
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

    /// Traces the paths of a wave to their ends; false if `stop` said so.
    fn trace_paths(&self, w: &mut Workspace, stop: &dyn Fn() -> bool) -> bool {
        let shares = self.options.reuse.is_some();
        let most = self.options.max_depth.saturating_add(if self.parts.depths { MAX_WALK_STEPS } else { 0 });
        for bounce in 0..=most {
            if bounce % STOP_INTERVAL == STOP_INTERVAL - 1 && stop() {
                return false;
            }
            if self.scene.features.scattering {
                self.start_medium_segments(bounce, w);
            }
            w.intersect(&self.scene.accel);
            self.arrive_in_chains(w);
            if self.scene.features.alpha {
                self.skip_absent_surfaces(bounce, w);
                if bounce == 0 {
                    self.find_camera_exceptions(w);
                }
            }
            let is_last = bounce == most;
            let sorted = self.surfaces(bounce, is_last, w);
            if bounce == 0 {
                self.set_alpha(&sorted, w);
            }
            if sorted.all().is_empty() {
                return true;
            }
            self.find_cells(bounce, &sorted, w);
            if shares {
                self.cut_paths(bounce, &sorted, w);
            }
            self.connect_to_lights(bounce, &sorted, w);
            let sorted = if self.branches(bounce) > 1 { self.split(&sorted, w) } else { sorted };
            self.scatter(bounce, &sorted, w);
            if self.parts.clear {
                self.update_clear_paths(&sorted, w);
            }
            self.end_stretched_chains(bounce, &sorted, w);
            if self.options.records_training {
                self.record_vertices(&sorted, w);
            }
            if bounce == 0 && self.parts.first_bounces {
                self.record_first_bounces(&sorted, w);
            }
            if self.parts.kinds {
                self.choose_ray_kinds(bounce, &sorted, w);
            }
            if shares {
                self.divide_lobes(bounce, &sorted, w);
            }
            self.spawn_rays(&sorted, w);
            if w.rays.is_empty() {
                return true;
            }
        }
        true
    }

    /// Takes light samples, and adds what arrives of them.
    fn connect_to_lights(&self, bounce: u32, sorted: &SortedVertices, w: &mut Workspace) {
        if self.scene.lights.is_empty() {
            return;
        }
        let count = self.light_samples(bounce);
        for number in 0..count {
            Self::number_light_samples(&mut w.wave.paths.carried, sorted, number, count);
            self.sample_lights(bounce, sorted, w);
            if self.is_spectral() {
                self.uplift_light_samples(sorted, w);
            }
            self.leave_light_samples(bounce, sorted, w);
            self.direct_light(bounce, sorted, w);
        }
        Self::end_light_samples(&mut w.wave.paths.carried, sorted, count);
    }

    /// Are there normals that make the remedy necessary, and is it wanted?
    fn softens_terminator(&self) -> bool {
        self.options.soft_terminator && self.scene.features.bent_normals
    }

    fn dimensions(&self, bounce: u32, purpose: Purpose) -> Dimensions {
        let set = match purpose {
            Purpose::Camera => 0,
            Purpose::Light => 1 + 2 * bounce,
            Purpose::Scatter => 2 + 2 * bounce,
            // Behind those of all bounces.
            Purpose::MediumSegment => u32::MAX - bounce,
            Purpose::Time => TIME_SET,
            Purpose::Wavelength => WAVELENGTH_SET,
        };
        self.dimensions.get(set as usize).copied().unwrap_or_else(|| Dimensions::new(set))
    }
}
