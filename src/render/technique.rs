//! The interface of techniques: ways to trace paths that lower the noise of some pictures and are decided on automatically.
//!
//! A technique says what prevents it for a scene, tries whether the picture gains by it, adds to the options of the paths, and may
//! learn from a pass. `techniques.rs` lists them and runs their trials.

use super::options::RenderOptions;
use super::progress::{Listener, Progress, Statistics, Stopwatch};
use super::schedule::Pass;
use super::timeline;
use crate::compile::{CompiledScene, View};
use crate::error::Warning;
use crate::film::{AovSet, AovSpace, FilterSampler, MatteIds};
use crate::integrator::{Block, IntegratorOptions, SamplePlan, Workspace};
use crate::sampling::ZSobolOrder;
use std::cell::RefCell;

thread_local! {
    pub(super) static WORKSPACE: RefCell<Workspace> = RefCell::new(Workspace::new());
}

/// What the options say about a technique.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Request {
    /// It is not used.
    Off,
    /// Its trial decides.
    Auto,
    /// It is used wherever that is possible; else a warning gives the reason.
    On,
}

/// The picture that a technique is for.
#[derive(Clone, Copy)]
pub(super) struct Target<'a> {
    pub scene: &'a CompiledScene,
    pub view: &'a View,
    pub options: &'a RenderOptions,
}

/// A technique. Decisions depend on the scene, the view and the options alone, so that partial renders decide alike.
pub(super) trait Technique {
    /// What the options ask for.
    fn request(&self, options: &RenderOptions) -> Request;

    /// The first reason that prevents the technique, for a warning.
    fn obstacle(&self, target: &Target<'_>) -> Option<&'static str>;

    /// The first words of the warning, such as "paths are not guided".
    fn refusal(&self) -> &'static str;

    /// Why the trial found no use for a technique that was asked for, for a warning.
    fn failure(&self, _options: &RenderOptions) -> Option<&'static str> {
        None
    }

    /// Decides before the first pass, by paths that don't contribute to the picture. Runs only where the technique is asked for and
    /// nothing prevents it.
    fn try_before_first_pass(&mut self, _trial: &Trial<'_>) -> Result<(), Stopped> {
        Ok(())
    }

    /// Adds to the options of the paths what was decided.
    fn configure<'a>(&'a self, paths: &mut IntegratorOptions<'a>);

    /// Must the film be complete between two passes?
    fn separates_passes(&self) -> bool {
        false
    }

    /// Does it learn from the errors of the pixels after this pass, in which pixels share paths or don't?
    fn learns_from(&self, _target: &Target<'_>, _pass: Pass, _shares_paths: bool) -> bool {
        false
    }

    /// Learns from the errors of the pixels after a pass.
    fn learn(&mut self, _options: &RenderOptions, _pass: Pass, _errors: &ErrorMap) {}

    /// Adds what it does to the statistics.
    fn report(&self, statistics: &mut Statistics);
}

/// What a warning says if a technique was asked for and is not used.
pub(super) fn warning(technique: &dyn Technique, target: &Target<'_>) -> Option<Warning> {
    if technique.request(target.options) != Request::On {
        return None;
    }
    let reason = technique.obstacle(target).or_else(|| technique.failure(target.options))?;
    Some(Warning::general(("technique-unused", format!("{}: {reason}", technique.refusal()))))
}

/// The first of some reasons that holds.
pub(super) fn first_reason(reasons: &[(bool, &'static str)]) -> Option<&'static str> {
    reasons.iter().find(|(holds, _)| *holds).map(|(_, reason)| *reason)
}

/// A trial was stopped.
pub(super) struct Stopped;

/// The context of a trial before the first pass.
pub(super) struct Trial<'a> {
    pub target: Target<'a>,
    /// Options of paths that record radiance alone, with what the techniques before this one add.
    pub paths: IntegratorOptions<'a>,
    pub progress: &'a Progress,
    pub listener: Option<&'a Listener>,
    pub stopwatch: &'a Stopwatch,
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

impl Trial<'_> {
    /// Does one task of a group on this thread and counts its rays. `work` returns `None` if it was stopped.
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
            let done = timeline::item(stage, group, || work(w));
            self.progress.add(0, w.ray_counts.since(before).all, self.stopwatch.wall(), self.listener);
            done.filter(|_| !stop()).ok_or(Stopped)
        })
    }
}

/// Options of paths that record radiance alone, without any technique.
pub(super) fn plain_paths<'a>(
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
        soft_terminator: options.soft_terminator,
        reuse: None,
        branches: 1,
        keeps_plain: false,
        caustics: None,
        guide: None,
        records_training: false,
    }
}

/// Relative squared errors of the pixels of a picture and the costs of a sample there, row by row.
pub(super) struct ErrorMap {
    pub width: usize,
    pub errors: Vec<f32>,
    /// Rays of a sample after its camera ray, plus [`COST_OF_MISS`].
    pub costs: Vec<f32>,
}

/// Cost of a sample whose camera ray hits nothing, in units of a further ray with its shading. (Measured in front of a textured
/// helmet that fills two fifths of a picture: hardly anything compared with the others.)
const COST_OF_MISS: f32 = 0.05;

impl ErrorMap {
    /// Zeros.
    pub fn new(width: u32, height: u32) -> ErrorMap {
        let zeros = vec![0.0; width as usize * height as usize];
        ErrorMap { width: width as usize, costs: zeros.clone(), errors: zeros }
    }

    /// Sets the errors of a block's pixels, and the rays of a sample there.
    pub fn set(&mut self, block: &Block, errors: &[f32], rays_per_sample: f64) {
        let cost = COST_OF_MISS + (rays_per_sample as f32 - 1.0).max(0.0);
        for (row, errors) in errors.chunks(block.width as usize).enumerate() {
            let from = (block.y0 as usize + row) * self.width + block.x0 as usize;
            self.errors[from..from + errors.len()].copy_from_slice(errors);
            self.costs[from..from + errors.len()].fill(cost);
        }
    }

    /// Multiplies the errors and the costs of a block's pixels.
    pub fn scale(&mut self, block: &Block, error: f32, cost: f32) {
        for row in block.y0 as usize..(block.y0 + block.height) as usize {
            let from = row * self.width + block.x0 as usize;
            let pixels = from..from + block.width as usize;
            self.errors[pixels.clone()].iter_mut().for_each(|e| *e *= error);
            self.costs[pixels].iter_mut().for_each(|c| *c *= cost);
        }
    }
}
