//! The memory of a thread: the wave, queues of rays and hits, results, times and wavelengths, ray counts.

use super::first_hit::FirstHits;
use super::guiding::guide::{TrainingSample, VertexRecord};
use super::light_lobes::LightLobes;
use super::light_samples::VerticesByLight;
use super::light_visibility::LightSampleRecord;
use super::medium_segment::{MediumSegment, ShadowSegment};
use super::pane_refraction::{RayCrossings, ShadowCrossings};
use super::radiance_buffer::RadianceBuffer;
use super::reuse::Reuse;
use super::shading_geometry::HitGraphs;
use super::shading_groups::ShadingGroup;
use super::wave::{Paths, WAVE, Wave};
use crate::accel::Accel;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::compile::ObjectId;
use crate::math::{Hit, Ray};
use crate::scene::RayKinds;

/// The memory for tracing a block of pixels; one per thread.
pub struct Workspace {
    pub(super) wave: Box<Wave>,
    /// Paths in the order of `rays`, before sorting by shading group.
    pub(super) arriving: Box<Paths>,
    /// The pixel of each sample of the wave.
    pub(super) pixels: Vec<u32>,
    pub(super) rays: Vec<Ray>,
    pub(super) hits: Vec<Hit>,
    /// Shading group of each hit.
    pub(super) groups: Vec<ShadingGroup>,
    /// Arriving paths that left the scene.
    pub(super) escaped: Vec<u32>,
    /// Material of each hit.
    pub(super) materials: Vec<u32>,
    /// Results of node graphs at the hits.
    pub(super) graphs: HitGraphs,
    /// Weight and importance of each component of the current mix.
    pub(super) components: Vec<(Rgb, f32)>,
    /// BSDFs of the vertices without a vectorised class.
    pub(super) bsdfs: Vec<Bsdf>,
    pub(super) shadow_rays: Vec<Ray>,
    /// Vertex of each shadow ray.
    pub(super) shadow_vertices: Vec<u32>,
    pub(super) occluded: Vec<bool>,
    /// By shadow ray: unoccluded contribution, for the shadow AOV.
    pub(super) unoccluded: Vec<Rgb>,
    /// By shadow ray: ray kinds to which passed objects are visible.
    pub(super) passed_kinds: Vec<RayKinds>,
    /// Samples whose camera rays hit holdouts or shadow catchers.
    pub(super) holdout_samples: Vec<u32>,
    /// Samples whose camera rays hit shadow catchers.
    pub(super) catcher_samples: Vec<u32>,
    /// Is this the second pass of shadow catchers, without shadow casters?
    pub(super) excludes_casters: bool,
    /// Camera paths of the wave, for the second pass of shadow catchers.
    pub(super) camera_paths: Option<Box<Paths>>,
    pub(super) camera_rays: Vec<Ray>,
    /// Times and wavelengths of the samples.
    pub(super) times: SampleTimes,
    /// Radiance, alpha and layers by sample.
    pub(super) radiance_buffer: RadianceBuffer,
    /// AOVs by sample.
    pub(super) first_hits: FirstHits,
    /// Indices of rays that passed surfaces and are traced again.
    pub(super) pending: Vec<u32>,
    pub(super) pending_rays: Vec<Ray>,
    pub(super) pending_hits: Vec<Hit>,
    /// Objects of the bodies that random walks are in, by path; `None` for bodies that may contain others.
    pub(super) walk_objects: Vec<Option<ObjectId>>,
    /// Panes passed by arriving rays; empty in scenes without panes.
    pub(super) crossings: Vec<RayCrossings>,
    /// Panes passed by shadow rays.
    pub(super) shadow_crossings: Vec<ShadowCrossings>,
    /// Vertices with lobes towards refracted lights.
    pub(super) light_lobes: Vec<LightLobes>,
    /// By arriving path: segment in scattering media.
    pub(super) medium_segments: Vec<MediumSegment>,
    /// Segments in overlapping media: see [`MediumSegment::overlapping`].
    pub(super) overlapping_segments: Vec<MediumSegment>,
    /// By shadow ray: current segment.
    pub(super) shadow_segments: Vec<ShadowSegment>,
    /// State of path reuse.
    pub(super) reuse: Option<Box<Reuse>>,
    /// Number of rays traced before path splitting, if the wave was split.
    pub(super) rays_before_split: Option<u64>,
    /// Recorded vertices of the wave, to train a guide.
    pub(super) vertex_records: Vec<VertexRecord>,
    /// Recorded light samples.
    pub(super) light_sample_records: Vec<LightSampleRecord>,
    /// The vertices by the kind of their selected light.
    pub(super) vertices_by_light: VerticesByLight,
    /// Finished training samples.
    pub(super) training_samples: Vec<TrainingSample>,
    /// Sum over recorded vertices of the squared contribution to the sample's luminance.
    pub(super) contribution_squares: f64,
    /// Rays traced so far.
    pub ray_counts: RayCounts,
}

impl Workspace {
    /// An empty workspace, about a megabyte.
    pub fn new() -> Workspace {
        Workspace {
            wave: bytemuck::zeroed_box(),
            arriving: bytemuck::zeroed_box(),
            pixels: Vec::with_capacity(WAVE),
            rays: Vec::with_capacity(WAVE),
            hits: Vec::with_capacity(WAVE),
            groups: Vec::with_capacity(WAVE),
            escaped: Vec::with_capacity(WAVE),
            materials: Vec::with_capacity(WAVE),
            graphs: HitGraphs::default(),
            components: Vec::new(),
            bsdfs: Vec::new(),
            shadow_rays: Vec::with_capacity(WAVE),
            shadow_vertices: Vec::with_capacity(WAVE),
            occluded: Vec::with_capacity(WAVE),
            unoccluded: Vec::new(),
            passed_kinds: Vec::new(),
            holdout_samples: Vec::new(),
            catcher_samples: Vec::new(),
            excludes_casters: false,
            camera_paths: None,
            camera_rays: Vec::new(),
            times: SampleTimes::default(),
            radiance_buffer: RadianceBuffer::new(),
            first_hits: FirstHits::default(),
            pending: Vec::new(),
            pending_rays: Vec::new(),
            pending_hits: Vec::new(),
            walk_objects: Vec::new(),
            crossings: Vec::new(),
            shadow_crossings: Vec::new(),
            light_lobes: Vec::new(),
            medium_segments: Vec::new(),
            overlapping_segments: Vec::new(),
            shadow_segments: Vec::new(),
            reuse: None,
            rays_before_split: None,
            vertex_records: Vec::new(),
            light_sample_records: Vec::new(),
            vertices_by_light: VerticesByLight::default(),
            training_samples: Vec::new(),
            contribution_squares: 0.0,
            ray_counts: RayCounts::default(),
        }
    }

    /// Begins a wave of camera paths: clears memory that only some scenes fill, since threads reuse it for other scenes.
    pub(super) fn begin_wave(&mut self) {
        self.unoccluded.clear();
        self.passed_kinds.clear();
        self.holdout_samples.clear();
        self.catcher_samples.clear();
        self.crossings.clear();
        self.shadow_crossings.clear();
        self.light_lobes.clear();
        self.medium_segments.clear();
        self.overlapping_segments.clear();
        self.shadow_segments.clear();
        self.rays_before_split = None;
        self.graphs.clear(0);
    }

    /// Time of arriving path `i`, 0 to 1.
    #[inline(always)]
    pub(super) fn time(&self, i: usize) -> f32 {
        self.times.of(self.arriving.state.radiance_index[i])
    }

    /// Wavelengths of arriving path `i`; `None` in RGB rendering.
    #[inline(always)]
    pub(super) fn wavelengths(&self, i: usize) -> Option<&Wavelengths> {
        self.times.wavelengths(self.arriving.state.radiance_index[i])
    }

    /// Finds the nearest hits of `rays`.
    pub(super) fn intersect(&mut self, accel: &Accel) {
        self.begin_hits();
        let samples = self.arriving.state.radiance_index[..self.rays.len()].iter().copied();
        self.times.closest(accel, &self.rays, samples, &mut self.hits);
    }

    /// Finds the nearest hits of any number of `rays` at time 0.
    pub(super) fn intersect_static(&mut self, accel: &Accel) {
        self.begin_hits();
        accel.closest(&self.rays, &mut self.hits);
    }

    /// Allocates the hits of `rays` and counts the rays.
    fn begin_hits(&mut self) {
        self.hits.clear();
        self.hits.resize(self.rays.len(), Hit::MISS);
        self.ray_counts.all += self.rays.len() as u64;
    }
}

impl Default for Workspace {
    fn default() -> Self {
        Workspace::new()
    }
}

/// Counts of traced rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// All rays.
    pub all: u64,
    /// Visibility tests of path reuse, each traced alone.
    pub single: u64,
    /// Visibility tests of path reuse, traced together to a common suffix.
    pub point_visibility: u64,
    /// Rays after path splitting.
    pub in_branches: u64,
}

impl RayCounts {
    /// The sum of two counts.
    pub fn plus(self, other: RayCounts) -> RayCounts {
        RayCounts {
            all: self.all + other.all,
            single: self.single + other.single,
            point_visibility: self.point_visibility + other.point_visibility,
            in_branches: self.in_branches + other.in_branches,
        }
    }

    /// The difference from an earlier count.
    pub fn since(self, before: RayCounts) -> RayCounts {
        RayCounts {
            all: self.all - before.all,
            single: self.single - before.single,
            point_visibility: self.point_visibility - before.point_visibility,
            in_branches: self.in_branches - before.in_branches,
        }
    }
}

/// Times (0 at shutter open to 1 at shutter close) and wavelengths of the samples of a wave, common to all rays of a sample.
#[derive(Default)]
pub(super) struct SampleTimes {
    /// Times; empty without motion.
    by_sample: Vec<f32>,
    /// Empty in RGB rendering.
    wavelengths: Vec<Wavelengths>,
    /// Number of branches per sample, for radiance indices of branches.
    branches: u32,
    /// Scratch memory: times of rays.
    of_rays: Vec<f32>,
}

impl SampleTimes {
    /// Sets the times of new samples.
    pub fn start(&mut self, times: impl Iterator<Item = f32>, branches: u32) {
        self.by_sample.clear();
        self.by_sample.extend(times);
        self.branches = branches;
    }

    /// Sets the wavelengths of new samples.
    pub fn start_wavelengths(&mut self, wavelengths: impl Iterator<Item = Wavelengths>, branches: u32) {
        self.wavelengths.clear();
        self.wavelengths.extend(wavelengths);
        self.branches = branches;
    }

    /// The wavelengths of all samples.
    pub fn all_wavelengths(&self) -> &[Wavelengths] {
        &self.wavelengths
    }

    /// Wavelengths by radiance index; `None` in RGB rendering.
    #[inline(always)]
    pub fn wavelengths(&self, sample: u32) -> Option<&Wavelengths> {
        if self.wavelengths.is_empty() { None } else { self.sample_wavelengths(sample) }
    }

    #[cold]
    fn sample_wavelengths(&self, sample: u32) -> Option<&Wavelengths> {
        let of_branch = || {
            sample.checked_sub(WAVE as u32).and_then(|k| self.wavelengths.get((k / self.branches) as usize))
        };
        self.wavelengths.get(sample as usize).or_else(of_branch)
    }

    /// Duplicates all samples, for the second pass of shadow catchers.
    pub fn repeat(&mut self) {
        self.by_sample.extend_from_within(..);
        self.wavelengths.extend_from_within(..);
    }

    /// The times of all samples.
    pub fn all(&self) -> &[f32] {
        &self.by_sample
    }

    /// Time by radiance index, 0 to 1; 0 without motion.
    #[inline(always)]
    pub fn of(&self, sample: u32) -> f32 {
        if self.by_sample.is_empty() { 0.0 } else { self.sample_time(sample) }
    }

    #[cold]
    fn sample_time(&self, sample: u32) -> f32 {
        let of = |sample: u32| self.by_sample.get(sample as usize).copied();
        let of_branch = || sample.checked_sub(WAVE as u32).and_then(|branch| of(branch / self.branches));
        of(sample).or_else(of_branch).unwrap_or(0.0)
    }

    /// Finds the nearest hits of rays at the times of `samples` (radiance indices).
    #[inline]
    pub fn closest(
        &mut self,
        accel: &Accel,
        rays: &[Ray],
        samples: impl Iterator<Item = u32>,
        hits: &mut [Hit],
    ) {
        if !accel.uses_times() {
            return accel.closest(rays, hits);
        }
        self.gather(samples);
        accel.closest_in_time(rays, &self.of_rays, hits);
    }

    /// Finds any hits of rays at the times of `samples` (radiance indices).
    #[inline]
    pub fn any(&mut self, accel: &Accel, rays: &[Ray], samples: impl Iterator<Item = u32>, hits: &mut [Hit]) {
        if !accel.uses_times() {
            return accel.any(rays, hits);
        }
        self.gather(samples);
        accel.any_in_time(rays, &self.of_rays, hits);
    }

    fn gather(&mut self, samples: impl Iterator<Item = u32>) {
        let mut of_rays = std::mem::take(&mut self.of_rays);
        of_rays.clear();
        of_rays.extend(samples.map(|sample| self.of(sample)));
        self.of_rays = of_rays;
    }
}
