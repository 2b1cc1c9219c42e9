//! The interface of techniques: ways to trace paths that lower the noise of some pictures and are decided on automatically.
//!
//! A technique says what prevents it for a scene, tries whether the picture gains by it, and adds to the options of the paths.
//! `techniques.rs` lists them and runs their trials.

use super::options::RenderOptions;
use super::progress::{Listener, Progress, Statistics, Stopwatch, task};
use crate::compile::{CompiledScene, View};
use crate::error::Warning;
use crate::film::{AovSet, AovSpace, FilterSampler, MatteIds};
use crate::integrator::{IntegratorOptions, SamplePlan, Workspace};
use crate::sampling::ZSobolOrder;
use std::cell::RefCell;

thread_local! {
    pub(super) static WORKSPACE: RefCell<Workspace> = RefCell::new(Workspace::new());
}

/// Setting of a technique by the options.
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
    /// The setting by the options.
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

    /// Adds what it does to the statistics.
    fn report(&self, statistics: &mut Statistics);
}

/// The warning where a technique was asked for and is not used.
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
            let done = task(stage, group, || work(w));
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
        terminator: options.terminator,
        reuse: None,
        branches: 1,
        keeps_plain: false,
        caustics: None,
        guide: None,
        records_training: false,
    }
}
