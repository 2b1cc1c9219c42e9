//! All memory that tracing takes.

use super::first_hit::FirstHits;
use super::flight::{Flight, ShadowWay};
use super::group::Group;
use super::guiding::training::{TrainingSample, VertexRecord};
use super::lanes::WAVE;
use super::ray_counts::RayCounts;
use super::reuse::state::Reuse;
use super::sink::Sink;
use super::times::Times;
use super::wave::{Paths, Wave};
use crate::accel::Accel;
use crate::bsdf::Bsdf;
use crate::color::Rgb;
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
    pub(super) groups: Vec<Group>,
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
    pub(super) unblocked: Vec<Rgb>,
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
    pub(super) times: Times,
    /// Results by sample.
    pub(super) sink: Sink,
    /// What outputs besides colour show, by sample.
    pub(super) first_hits: FirstHits,
    /// For surfaces that are partly absent.
    pub(super) pending: Vec<u32>,
    pub(super) pending_rays: Vec<Ray>,
    pub(super) pending_hits: Vec<Hit>,
    /// How the paths fly through media, and shadow rays cross them; where some scatter.
    pub(super) flights: Vec<Flight>,
    /// Flights through media that fill the same place as others.
    pub(super) flights_beside: Vec<Flight>,
    pub(super) shadow_ways: Vec<ShadowWay>,
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
            unblocked: Vec::new(),
            passed_kinds: Vec::new(),
            uncovered: Vec::new(),
            caught: Vec::new(),
            without: false,
            starts: None,
            start_rays: Vec::new(),
            times: Times::default(),
            sink: Sink::new(),
            first_hits: FirstHits::default(),
            pending: Vec::new(),
            pending_rays: Vec::new(),
            pending_hits: Vec::new(),
            flights: Vec::new(),
            flights_beside: Vec::new(),
            shadow_ways: Vec::new(),
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
