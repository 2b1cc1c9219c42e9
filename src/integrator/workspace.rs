//! All memory of a thread: the wave, queues of rays and hits, results, times and wavelengths, ray counts.

use super::first_hit::FirstHits;
use super::guiding::guide::{TrainingSample, VertexRecord};
use super::medium_segment::{MediumSegment, ShadowSegment};
use super::radiance_buffer::RadianceBuffer;
use super::reuse::state::Reuse;
use super::shading_groups::ShadingGroup;
use super::wave::{Paths, WAVE, Wave};
use crate::accel::Accel;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::math::{Hit, Ray};
use crate::scene::RayKinds;

/// All memory that tracing a block of pixels takes; made once a thread.
pub struct Workspace {
    pub(super) wave: Box<Wave>,
    /// Paths in the order of their rays, before their vertices are sorted.
    pub(super) arriving: Box<Paths>,
    /// The pixel of each sample of the wave.
    pub(super) pixels: Vec<u32>,
    pub(super) rays: Vec<Ray>,
    pub(super) hits: Vec<Hit>,
    /// Shading group of each hit.
    pub(super) groups: Vec<ShadingGroup>,
    /// Paths that left the scene.
    pub(super) escaped: Vec<u32>,
    /// Material of each hit.
    pub(super) materials: Vec<u32>,
    /// BSDFs of the vertices without a vectorised class.
    pub(super) bsdfs: Vec<Bsdf>,
    pub(super) shadow_rays: Vec<Ray>,
    /// Vertex of each shadow ray.
    pub(super) shadow_vertices: Vec<u32>,
    pub(super) occluded: Vec<bool>,
    /// What each would bring unblocked; where shadows are shown.
    pub(super) unoccluded: Vec<Rgb>,
    /// By shadow ray: the kinds of rays that stop at what it passed; where kinds differ.
    pub(super) passed_kinds: Vec<RayKinds>,
    /// Samples whose camera rays hit what is transparent in the picture.
    pub(super) uncovered: Vec<u32>,
    /// Those among them that hit shadow catchers.
    pub(super) caught: Vec<u32>,
    /// Objects that catchers catch the shadows of are left out now.
    pub(super) without: bool,
    /// How the paths of the wave started; where there are catchers.
    pub(super) starts: Option<Box<Paths>>,
    pub(super) start_rays: Vec<Ray>,
    /// When samples look at the scene, where something moves.
    pub(super) times: SampleTimes,
    /// Results by sample.
    pub(super) sink: RadianceBuffer,
    /// What outputs besides colour show, by sample.
    pub(super) first_hits: FirstHits,
    /// For surfaces that are partly absent.
    pub(super) pending: Vec<u32>,
    pub(super) pending_rays: Vec<Ray>,
    pub(super) pending_hits: Vec<Hit>,
    /// How the paths fly through media, and shadow rays cross them; where some scatter.
    pub(super) medium_segments: Vec<MediumSegment>,
    /// Flights through media that fill the same place as others.
    pub(super) overlapping_segments: Vec<MediumSegment>,
    pub(super) shadow_segments: Vec<ShadowSegment>,
    /// Where paths are shared.
    pub(super) reuse: Option<Box<Reuse>>,
    /// Rays that had been traced when the samples of the wave split, if they did.
    pub(super) rays_before_split: Option<u64>,
    /// Where paths train a guide: vertices of the wave, and what all paths have found.
    pub(super) vertex_records: Vec<VertexRecord>,
    pub(super) training_samples: Vec<TrainingSample>,
    /// Squares of the luminances that vertices brought to samples.
    pub(super) brought_squares: f64,
    /// Rays traced so far.
    pub ray_counts: RayCounts,
}

impl Workspace {
    /// Empty memory, about a megabyte.
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
            bsdfs: Vec::new(),
            shadow_rays: Vec::with_capacity(WAVE),
            shadow_vertices: Vec::with_capacity(WAVE),
            occluded: Vec::with_capacity(WAVE),
            unoccluded: Vec::new(),
            passed_kinds: Vec::new(),
            uncovered: Vec::new(),
            caught: Vec::new(),
            without: false,
            starts: None,
            start_rays: Vec::new(),
            times: SampleTimes::default(),
            sink: RadianceBuffer::new(),
            first_hits: FirstHits::default(),
            pending: Vec::new(),
            pending_rays: Vec::new(),
            pending_hits: Vec::new(),
            medium_segments: Vec::new(),
            overlapping_segments: Vec::new(),
            shadow_segments: Vec::new(),
            reuse: None,
            rays_before_split: None,
            vertex_records: Vec::new(),
            training_samples: Vec::new(),
            brought_squares: 0.0,
            ray_counts: RayCounts::default(),
        }
    }

    /// Finds the nearest hits of `rays`.
    pub(super) fn intersect(&mut self, accel: &Accel) {
        self.begin_hits();
        let samples = self.arriving.carried.sample[..self.rays.len()].iter().copied();
        self.times.closest(accel, &self.rays, samples, &mut self.hits);
    }

    /// Finds the nearest hits of `rays`, of any number, that belong to no samples: nothing moves then.
    pub(super) fn intersect_still(&mut self, accel: &Accel) {
        self.begin_hits();
        accel.closest(&self.rays, &mut self.hits);
    }

    /// Makes room for the hits of `rays`, and counts these.
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

/// How many rays there were.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// All together.
    pub all: u64,
    /// Those of them that connected shared paths, each tested alone.
    pub single: u64,
    /// The same, tested together with the others to the same suffix.
    pub in_fans: u64,
    /// Those of them that belong to several paths of one sample.
    pub in_branches: u64,
}

impl RayCounts {
    /// Both together.
    pub fn plus(self, other: RayCounts) -> RayCounts {
        RayCounts {
            all: self.all + other.all,
            single: self.single + other.single,
            in_fans: self.in_fans + other.in_fans,
            in_branches: self.in_branches + other.in_branches,
        }
    }

    /// What came since an earlier count.
    pub fn since(self, before: RayCounts) -> RayCounts {
        RayCounts {
            all: self.all - before.all,
            single: self.single - before.single,
            in_fans: self.in_fans - before.in_fans,
            in_branches: self.in_branches - before.in_branches,
        }
    }
}

/// The times of a wave; empty where nothing moves.
#[derive(Default)]
pub(super) struct SampleTimes {
    by_sample: Vec<f32>,
    /// Empty where paths carry red, green and blue.
    waves: Vec<Wavelengths>,
    /// Paths that go on from the first surface of each sample, and have indices of their own.
    branches: u32,
    /// Of the rays that are traced next.
    of_rays: Vec<f32>,
}

impl SampleTimes {
    /// Begins with new samples.
    pub fn start(&mut self, times: impl Iterator<Item = f32>, branches: u32) {
        self.by_sample.clear();
        self.by_sample.extend(times);
        self.branches = branches;
    }

    /// Begins with the wavelengths of new samples.
    pub fn start_wavelengths(&mut self, waves: impl Iterator<Item = Wavelengths>, branches: u32) {
        self.waves.clear();
        self.waves.extend(waves);
        self.branches = branches;
    }

    /// The wavelengths of all samples.
    pub fn all_wavelengths(&self) -> &[Wavelengths] {
        &self.waves
    }

    /// The wavelengths of a sample, by the index that its path carries; `None` where paths carry red, green and blue.
    #[inline(always)]
    pub fn waves(&self, sample: u32) -> Option<&Wavelengths> {
        if self.waves.is_empty() { None } else { self.sample_wavelengths(sample) }
    }

    #[cold]
    fn sample_wavelengths(&self, sample: u32) -> Option<&Wavelengths> {
        let of_branch =
            || sample.checked_sub(WAVE as u32).and_then(|k| self.waves.get((k / self.branches) as usize));
        self.waves.get(sample as usize).or_else(of_branch)
    }

    /// All samples are traced once more, under the indices behind those of all.
    pub fn repeat(&mut self) {
        self.by_sample.extend_from_within(..);
        self.waves.extend_from_within(..);
    }

    /// The times of all samples.
    pub fn all(&self) -> &[f32] {
        &self.by_sample
    }

    /// The time of a sample, by the index that its path carries; 0 where nothing moves.
    #[inline(always)]
    pub fn of(&self, sample: u32) -> f32 {
        if self.by_sample.is_empty() { 0.0 } else { self.known(sample) }
    }

    #[cold]
    fn known(&self, sample: u32) -> f32 {
        let of = |sample: u32| self.by_sample.get(sample as usize).copied();
        let of_branch = || sample.checked_sub(WAVE as u32).and_then(|branch| of(branch / self.branches));
        of(sample).or_else(of_branch).unwrap_or(0.0)
    }

    /// The nearest hits of rays whose paths have these samples.
    #[inline]
    pub fn closest(
        &mut self,
        accel: &Accel,
        rays: &[Ray],
        samples: impl Iterator<Item = u32>,
        hits: &mut [Hit],
    ) {
        if !accel.is_moving() {
            return accel.closest(rays, hits);
        }
        self.gather(samples);
        accel.closest_in_time(rays, &self.of_rays, hits);
    }

    /// Some hits of rays whose paths have these samples.
    #[inline]
    pub fn any(&mut self, accel: &Accel, rays: &[Ray], samples: impl Iterator<Item = u32>, hits: &mut [Hit]) {
        if !accel.is_moving() {
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
