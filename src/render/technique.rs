//! The interface of techniques: variance reduction that is useful for some pictures and enabled automatically.
//!
//! A technique checks whether a scene prevents it, runs a trial of its efficiency, and configures the integrator. `techniques.rs` lists the
//! techniques and runs their trials.

use super::options::RenderOptions;
use super::progress::{Listener, Progress, Statistics, Stopwatch, task};
use super::schedule::Pass;
use crate::compile::{CompiledScene, View};
use crate::error::Warning;
use crate::film::{AovSet, AovSpace, FilterSampler, MatteIds};
use crate::integrator::{Block, IntegratorOptions, PathSample, RayCounts, SamplePlan, WAVE, Workspace};
use crate::sampling::hash::hash32;
use crate::sampling::{AdaptiveSamples, MAX_Z_ORDER_SPP, ZSobolOrder};
use std::cell::RefCell;

thread_local! {
    pub(super) static WORKSPACE: RefCell<Workspace> = RefCell::new(Workspace::new());
}

/// The user's setting of a technique.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Request {
    /// Not used.
    Off,
    /// Decided by a trial.
    Auto,
    /// Used if possible; else a warning names the reason.
    On,
}

/// The picture to which a technique is applied.
#[derive(Clone, Copy)]
pub(super) struct Target<'a> {
    pub scene: &'a CompiledScene,
    pub view: &'a View,
    pub options: &'a RenderOptions,
}

/// A technique. Decisions depend only on the scene, the view and the options, so that all parts of a distributed render use the same
/// techniques.
pub(super) trait Technique {
    /// The user's setting.
    fn request(&self, options: &RenderOptions) -> Request;

    /// Why the technique can't be used with this scene and these options, for a warning.
    fn prevented_by(&self, target: &Target<'_>) -> Option<&'static str>;

    /// The beginning of the warning, such as "paths are not guided".
    fn unused_warning(&self) -> &'static str;

    /// Why the trial of a requested technique failed, for a warning.
    fn trial_failure(&self, _options: &RenderOptions) -> Option<&'static str> {
        None
    }

    /// Trial before the first pass, by paths that don't contribute to the picture. Runs unless the technique is off or prevented.
    fn try_before_first_pass(&mut self, _trial: &Trial<'_>) -> Result<(), Stopped> {
        Ok(())
    }

    /// Is a trial within the first pass pending?
    fn has_pending_trial(&self) -> bool {
        false
    }

    /// Trial within the first pass, on squares of the picture. Returns the squares that need not be rendered again; `None` if stopped.
    fn try_in_pass(&self, _pass: &dyn PassTrial) -> Option<Vec<Block>> {
        Some(Vec::new())
    }

    fn configure<'a>(&'a self, _paths: &mut IntegratorOptions<'a>) {}

    /// Configures the integrator for the camera paths of a pass.
    fn configure_pass(&self, _pass: Pass, _options: &RenderOptions, _paths: &mut IntegratorOptions<'_>) {}

    /// Must a pass end before the next one begins?
    fn separates_passes(&self) -> bool {
        false
    }

    /// Adds the technique's statistics.
    fn report(&self, statistics: &mut Statistics);
}

/// The warning about a technique that was requested and is not used.
pub(super) fn warning(technique: &dyn Technique, target: &Target<'_>) -> Option<Warning> {
    if technique.request(target.options) != Request::On {
        return None;
    }
    let reason = technique.prevented_by(target).or_else(|| technique.trial_failure(target.options))?;
    Some(Warning::general(("technique-unused", format!("{}: {reason}", technique.unused_warning()))))
}

/// The first reason whose condition holds.
pub(super) fn first_reason(reasons: &[(bool, &'static str)]) -> Option<&'static str> {
    reasons.iter().find(|(holds, _)| *holds).map(|(_, reason)| *reason)
}

/// A trial was stopped.
pub(super) struct Stopped;

/// The context of a trial before the first pass.
pub(super) struct Trial<'a> {
    pub target: Target<'a>,
    /// Integrator options for radiance only, configured by the techniques before this one.
    pub paths: IntegratorOptions<'a>,
    pub progress: &'a Progress,
    pub listener: Option<&'a Listener>,
    pub stopwatch: &'a Stopwatch,
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

impl Trial<'_> {
    /// Runs a task of a group on this thread and counts its rays. `work` returns `None` if stopped.
    pub fn run<T>(
        &self,
        (stage, group): (&'static str, u32),
        stop: &(dyn Fn() -> bool + Sync),
        work: impl FnOnce(&mut Workspace) -> Option<T>,
    ) -> Result<T, Stopped> {
        if stop() {
            return Err(Stopped);
        }
        WORKSPACE.with(|workspace| {
            let w = &mut *workspace.borrow_mut();
            let before = w.ray_counts;
            let done = task(stage, group, || work(w));
            self.progress.add(0, w.ray_counts.since(before).all, self.stopwatch.wall(), self.listener);
            done.filter(|_| !stop()).ok_or(Stopped)
        })
    }
}

/// Integrator options for radiance only, without techniques.
pub(super) fn radiance_only_options<'a>(
    options: &RenderOptions,
    filter: &'a FilterSampler,
    mattes: &'a MatteIds,
) -> IntegratorOptions<'a> {
    IntegratorOptions {
        max_depth: options.max_depth,
        bounces: options.bounces,
        clamp: options.clamp,
        filter_glossy: options.filter_glossy,
        skip_caustics: options.skip_caustics,
        plan: SamplePlan::Even(ZSobolOrder::new(options.seed, options.samples.max(options.planned), 1)),
        filter,
        aovs: AovSet::NONE,
        aov_space: AovSpace::World,
        mattes,
        light_groups: 0,
        catchers: false,
        transparent_glass: false,
        terminator: options.terminator,
        reuse: None,
        branches: 1,
        records_baseline: false,
        caustics: None,
        single_pixel_splats: options.halves,
        guide: None,
        light_visibility: None,
        records_light_samples: false,
        records_training: false,
    }
}

// Paths of trials before the first pass.

/// Samples per pixel assumed with a noise threshold.
const PLANNED_BY_NOISE: u32 = 64;

/// Number of planned samples per pixel, a power of two; not more than a sample pattern has, since rendering may be resumed with more
/// samples. `assumes`: with a noise threshold a number is assumed.
pub(super) fn planned_samples(options: &RenderOptions, assumes: bool) -> u32 {
    let most = if assumes && options.noise.is_some() { PLANNED_BY_NOISE } else { MAX_Z_ORDER_SPP };
    options.samples.max(options.planned).min(most).next_power_of_two()
}

/// Paths spread evenly over the whole picture: their samples, decorrelated by `salt`, and square blocks of about one wave of paths each.
pub(super) fn spread_paths(options: &RenderOptions, salt: u32, paths: u64) -> (AdaptiveSamples, Vec<Block>) {
    let RenderOptions { width, height, seed, .. } = *options;
    let pixels = width as usize * height as usize;
    let per_pixel = paths as f64 / pixels as f64;
    let samples = AdaptiveSamples::new(hash32(seed ^ salt), width, &vec![per_pixel as f32; pixels]);
    let edge = ((WAVE as f64 / per_pixel).sqrt() as u32).clamp(8, 1024);
    let rows = (0..height).step_by(edge as usize);
    let square = |(x0, y0): (u32, u32)| Block {
        x0,
        y0,
        width: edge.min(width - x0),
        height: edge.min(height - y0),
        first_sample: 0,
        samples: 1,
    };
    let corners = rows.flat_map(|y| (0..width).step_by(edge as usize).map(move |x| (x, y)));
    (samples, corners.map(square).collect())
}

// Trials within the first pass.

/// Edge of the squares of trials, pixels.
pub(super) const EDGE: u32 = 32;

/// The first pass, which renders squares for trials.
pub(super) trait PassTrial {
    fn target(&self) -> Target<'_>;

    fn pass(&self) -> Pass;

    /// Renders squares with integrator options changed by `configure`.
    fn render(
        &self,
        squares: &[Block],
        configure: &dyn Fn(&mut IntegratorOptions<'_>),
    ) -> RenderedSquares<'_>;
}

/// Squares rendered for a trial.
pub(super) struct RenderedSquares<'a> {
    /// `None` if stopped.
    pub errors: Option<Errors>,
    pub add_to_film: Box<dyn FnOnce() + 'a>,
}

/// Sums of the samples of a pixel, with the tried strategy and without.
#[derive(Clone, Copy, Default)]
struct PixelSums {
    tried: HalfSums,
    baseline: HalfSums,
    count: u32,
}

/// Sums of the samples of a block, and its rays.
pub(super) struct BlockSums {
    pixels: Vec<PixelSums>,
    /// Half the number of samples per pixel.
    half: u32,
    rays: RayCounts,
}

impl BlockSums {
    pub fn new(block: &Block) -> BlockSums {
        let pixels = vec![PixelSums::default(); (block.width * block.height) as usize];
        BlockSums { pixels, half: block.samples / 2, rays: RayCounts::default() }
    }

    pub fn add(&mut self, sample: &PathSample<'_>) {
        let pixel = &mut self.pixels[sample.pixel as usize];
        let half = pixel.count / self.half;
        pixel.count += 1;
        pixel.tried.add(half, sample.rgb);
        pixel.baseline.add(half, sample.baseline);
    }

    /// Adds ray counts.
    pub fn count(&mut self, rays: RayCounts) {
        self.rays = self.rays.plus(rays);
    }

    /// The sums of squared errors.
    pub fn errors(&self) -> Errors {
        let mut errors = Errors { rays: self.rays, ..Errors::default() };
        for pixel in &self.pixels {
            errors.tried += pixel.tried.squared_error(self.half, &pixel.tried);
            errors.baseline += pixel.baseline.squared_error(self.half, &pixel.tried);
        }
        errors
    }
}

/// Sums of relative squared errors of pixels, with the tried strategy and without, and ray counts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Errors {
    pub tried: f64,
    pub baseline: f64,
    pub rays: RayCounts,
    pub light_paths: LightPathCost,
}

/// Squared error and time of light paths, relative to plain camera paths. Splitting doesn't change them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LightPathCost {
    pub error: f64,
    pub time: f64,
}

impl Errors {
    pub fn plus(self, other: Errors) -> Errors {
        Errors {
            tried: self.tried + other.tried,
            baseline: self.baseline + other.baseline,
            rays: self.rays.plus(other.rays),
            light_paths: self.light_paths,
        }
    }
}

// Error estimates of pixels by the difference of the means of two halves of their samples.

/// Maximum relative error of a pixel, against the influence of a few fireflies.
const LARGEST_ERROR: f64 = 3.0;

/// Sums over the first and the second half of a pixel's samples.
#[derive(Clone, Copy, Default)]
struct HalfSums([[f64; 3]; 2]);

impl HalfSums {
    /// Adds a sample to half 0 or 1; ignored for other values.
    pub fn add(&mut self, half: u32, rgb: [f32; 3]) {
        if let Some(sum) = self.0.get_mut(half as usize) {
            sum.iter_mut().zip(rgb).for_each(|(sum, v)| *sum += f64::from(v));
        }
    }

    /// Squared difference of the means of the halves, of `half` samples each, relative to the squared mean of `whole`; summed over the
    /// channels.
    pub fn squared_error(&self, half: u32, whole: &HalfSums) -> f64 {
        let scale = 1.0 / f64::from(half);
        let of_channel = |c: usize| {
            let mean = 0.5 * scale * (whole.0[0][c] + whole.0[1][c]);
            let difference = (self.0[0][c] - self.0[1][c]) * scale;
            let squared = difference * difference / (mean * mean + 0.01);
            // NaN becomes 0.
            if squared > 0.0 { squared.min(LARGEST_ERROR * LARGEST_ERROR) } else { 0.0 }
        };
        (0..3).map(of_channel).sum()
    }
}
