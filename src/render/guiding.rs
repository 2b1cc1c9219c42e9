//! What guides paths is learned before the first pass, from the whole picture, by samples that are thrown away: so it depends on
//! the scene, the view and the options alone, and parts of a picture are guided alike.

use super::clock::Stopwatch;
use super::options::{Guiding, RenderOptions};
use super::progress::{Listener, Progress};
use super::work::WORKSPACE;
use crate::bsdf::BsdfClass;
use crate::compile::{CompiledScene, View};
use crate::error::Warning;
use crate::film::{AovSet, AovSpace, FilterSampler, MatteIds};
use crate::integrator::{
    Block, CausticPlan, Grid, Guide, Integrator, Learnt, Lesson, Lessons, Notes, PathOptions, SamplePlan,
    WAVE, Workspace,
};
use crate::sampling::hash::hash32;
use crate::sampling::{Allotment, MOST_ARRANGED};
use rayon::prelude::*;
use std::sync::Arc;

/// Share of the planned samples that are taken to learn from.
const SHARE: f64 = 0.2;

/// Sizes of the passes that learn, in parts of all: each is guided by what the earlier ones learned.
const PASSES: [u64; 5] = [1, 1, 2, 4, 8];
const PARTS: u64 = 16;

/// Fewest and most paths of a part.
const LEAST_PART: u64 = 1 << 9;
const MOST_PART: u64 = 1 << 18;

/// Lessons that cells are to have in the end.
const LESSONS_OF_CELL: f64 = 2000.0;

/// Share of a time limit after which no further pass begins.
const SHARE_OF_TIME: f64 = 0.1;

/// What separates the random numbers here from those of pictures with the same seed.
const SEED: u32 = 0x7c15_9e37;

/// What is decided about guiding.
#[derive(Clone, Debug, Default)]
pub(super) struct GuidingChoice {
    is_decided: bool,
    guide: Option<Arc<Guide>>,
}

impl GuidingChoice {
    /// The guide, if there is one.
    pub fn guide(&self) -> Option<&Guide> {
        self.guide.as_deref()
    }

    /// Decides, once. False if it was stopped.
    pub fn decide(&mut self, school: &School<'_>) -> bool {
        let is_wanted = school.options.guiding != Guiding::Off;
        if self.is_decided || !is_wanted || obstacle(school.scene, school.options).is_some() {
            return true;
        }
        let Ok(guide) = school.teach() else { return false };
        self.is_decided = true;
        self.guide = guide.map(Arc::new);
        true
    }
}

/// What is said where paths were to be guided and are not.
pub(super) fn warning(scene: &CompiledScene, options: &RenderOptions) -> Option<Warning> {
    let reason = obstacle(scene, options).filter(|_| options.guiding == Guiding::On)?;
    Some(Warning::general(format!("paths are not guided: {reason}")))
}

/// Why they can't be.
fn obstacle(scene: &CompiledScene, options: &RenderOptions) -> Option<&'static str> {
    let is_diffuse = |class: BsdfClass| class == BsdfClass::Lambert;
    let reasons = [
        (!scene.materials.iter().any(|m| is_diffuse(m.class)), "no surface of the scene is ideally diffuse"),
        (options.max_depth < 2, "there is no indirect light with so few bounces"),
        (part(options) < LEAST_PART, "there are too few samples to learn from"),
    ];
    reasons.into_iter().find(|(holds, _)| *holds).map(|(_, reason)| reason)
}

/// Paths of a part of those that learn. (It may not depend on the number of samples but as their arrangement does: rendering may
/// go on to more.)
fn part(options: &RenderOptions) -> u64 {
    let planned = options.samples.max(options.planned).min(MOST_ARRANGED).next_power_of_two();
    let pixels = f64::from(options.width) * f64::from(options.height);
    let paths = SHARE * f64::from(planned) * pixels;
    ((paths / PARTS as f64) as u64).min(MOST_PART)
}

/// Learning was stopped.
struct Stopped;

/// Where paths teach a guide.
pub(super) struct School<'a> {
    pub scene: &'a CompiledScene,
    pub view: &'a View,
    pub options: &'a RenderOptions,
    pub filter: &'a FilterSampler,
    pub caustics: Option<&'a CausticPlan>,
    pub mattes: MatteIds,
    pub progress: &'a Progress,
    pub listener: Option<&'a Listener>,
    pub stopwatch: &'a Stopwatch,
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

impl School<'_> {
    /// A guide; none if paths found no diffuse surface.
    fn teach(&self) -> Result<Option<Guide>, Stopped> {
        let part = part(self.options);
        let (mut known, mut number) = (Known::default(), 0);
        for parts in PASSES {
            let guide = known.guide().unwrap_or_else(Guide::blank);
            for _ in 0..parts {
                if self.is_late() {
                    return Ok(known.guide());
                }
                known.learn(&self.trace(&guide, part, number)?);
                number += 1;
            }
        }
        Ok(known.guide())
    }

    fn is_late(&self) -> bool {
        let limit = self.options.time_limit;
        limit.is_some_and(|limit| self.stopwatch.wall().as_secs_f64() > SHARE_OF_TIME * limit.as_secs_f64())
    }

    /// What a part of the paths finds.
    fn trace(&self, guide: &Guide, part: u64, number: u32) -> Result<Vec<Learnt>, Stopped> {
        let RenderOptions { width, height, seed, .. } = *self.options;
        let pixels = width as usize * height as usize;
        let per_pixel = part as f64 / pixels as f64;
        let seed = hash32(seed ^ hash32(SEED ^ number));
        let allotment = Allotment::new(seed, width, 0, 1, &vec![per_pixel as f32; pixels]);
        let integrator = self.integrator(SamplePlan::Allotted(&allotment), Some(guide));
        let one = |block: &Block| self.in_workspace(|w| integrator.learn(block, w, &self.stop));
        blocks(width, height, per_pixel).par_iter().map(one).collect()
    }

    fn integrator<'a>(&'a self, plan: SamplePlan<'a>, guide: Option<&'a Guide>) -> Integrator<'a> {
        let paths = PathOptions {
            max_depth: self.options.max_depth,
            plan,
            filter: self.filter,
            aovs: AovSet::NONE,
            aov_space: AovSpace::World,
            mattes: &self.mattes,
            light_groups: 0,
            catchers: false,
            transparent_glass: false,
            soft_terminator: self.options.soft_terminator,
            reuse: None,
            branches: 1,
            keeps_plain: false,
            caustics: self.caustics,
            guide,
            teaches: true,
        };
        Integrator::new(self.scene, self.view, paths)
    }

    /// Does some work of a thread and counts its rays.
    fn in_workspace<T>(&self, work: impl FnOnce(&mut Workspace) -> Option<T>) -> Result<T, Stopped> {
        WORKSPACE.with(|workspace| {
            let w = &mut *workspace.borrow_mut();
            let before = w.ray_counts;
            let done = work(w);
            self.progress.add(0, w.ray_counts.since(before).all, self.stopwatch.wall(), self.listener);
            done.filter(|_| !(self.stop)()).ok_or(Stopped)
        })
    }
}

/// Squares of the picture with about a wave of paths each.
fn blocks(width: u32, height: u32, per_pixel: f64) -> Vec<Block> {
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
    rows.flat_map(|y| (0..width).step_by(edge as usize).map(move |x| (x, y))).map(square).collect()
}

/// What paths have taught so far.
#[derive(Default)]
struct Known {
    lessons: Option<Lessons>,
    /// Sum of the luminances of the samples, and how many there are.
    luminance: f64,
    samples: u64,
}

impl Known {
    /// Takes in what a part of the paths found, in the order of the blocks, by shares of the cells. The first part decides how
    /// large cells are.
    fn learn(&mut self, learnt: &[Learnt]) {
        self.luminance += learnt.iter().map(|l| l.luminance).sum::<f64>();
        self.samples += learnt.iter().map(|l| l.samples).sum::<u64>();
        if self.lessons.is_none() {
            let all: Vec<Lesson> = learnt.iter().flat_map(|l| &l.lessons).copied().collect();
            let total = all.len() as f64 * PARTS as f64;
            self.lessons = Grid::suited_to(&all, total, LESSONS_OF_CELL).map(Lessons::new);
        }
        let Some(lessons) = &mut self.lessons else { return };
        let grid = lessons.grid;
        let notes: Vec<Notes> = learnt.par_iter().map(|l| grid.notes(&l.lessons)).collect();
        let shares = lessons.shares.par_iter_mut().enumerate();
        shares.for_each(|(k, share)| notes.iter().for_each(|notes| share.learn(&notes[k])));
    }

    /// A guide that knows it; none if no path found a diffuse surface.
    fn guide(&self) -> Option<Guide> {
        let mean = self.luminance / self.samples.max(1) as f64;
        self.lessons.as_ref().map(|lessons| Guide::new(lessons, mean))
    }
}
