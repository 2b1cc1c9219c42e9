//! What guides paths is learned before the first pass, from the whole picture, by samples that are thrown away: so it depends on
//! the scene, the view and the options alone, and parts of a picture are guided alike.

use super::clock::Stopwatch;
use super::options::{Guiding, RenderOptions};
use super::progress::{Listener, Progress};
use super::work::WORKSPACE;
use crate::bsdf::BsdfClass;
use crate::compile::{CompiledScene, View};
use crate::error::Warning;
use crate::film::{AovSet, FilterSampler, MatteIds};
use crate::integrator::{
    Block, CausticPlan, Grid, Guide, Integrator, Learnt, Lesson, Lessons, Notes, PathOptions, SamplePlan,
    WAVE,
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
        let is_wanted = school.options.guiding == Guiding::On;
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
    pub progress: &'a Progress,
    pub listener: Option<&'a Listener>,
    pub stopwatch: &'a Stopwatch,
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

impl School<'_> {
    /// A guide; none if paths found no diffuse surface.
    fn teach(&self) -> Result<Option<Guide>, Stopped> {
        let part = part(self.options);
        let mut guide = Guide::blank();
        let (mut lessons, mut luminance, mut samples) = (None, 0.0, 0);
        let chunks =
            PASSES.into_iter().enumerate().flat_map(|(pass, parts)| (0..parts).map(move |k| (pass, k)));
        let mut last = 0;
        for (number, (pass, _)) in chunks.enumerate() {
            if self.is_late() {
                break;
            }
            if pass != last
                && let Some(lessons) = &lessons
            {
                guide = Guide::new(lessons, luminance / f64::max(1.0, samples as f64));
            }
            last = pass;
            let learnt = self.trace(&guide, part, number as u32)?;
            luminance += learnt.iter().map(|l| l.luminance).sum::<f64>();
            samples += learnt.iter().map(|l| l.samples).sum::<u64>();
            if lessons.is_none() {
                let all: Vec<Lesson> = learnt.iter().flat_map(|l| &l.lessons).copied().collect();
                let total = all.len() as f64 * PARTS as f64;
                let Some(grid) = Grid::suited_to(&all, total, LESSONS_OF_CELL) else {
                    return Ok(None);
                };
                lessons = Some(Lessons::new(grid));
            }
            if let Some(lessons) = &mut lessons {
                learn(lessons, &learnt);
            }
        }
        Ok(lessons.map(|lessons| Guide::new(&lessons, luminance / f64::max(1.0, samples as f64))))
    }

    fn is_late(&self) -> bool {
        let limit = self.options.time_limit;
        limit.is_some_and(|limit| self.stopwatch.wall().as_secs_f64() > SHARE_OF_TIME * limit.as_secs_f64())
    }

    /// What a part of the paths finds.
    fn trace(&self, guide: &Guide, part: u64, number: u32) -> Result<Vec<Learnt>, Stopped> {
        let RenderOptions { width, height, seed, max_depth, soft_terminator, .. } = *self.options;
        let pixels = width as usize * height as usize;
        let per_pixel = part as f64 / pixels as f64;
        let seed = hash32(seed ^ hash32(SEED ^ number));
        let allotment = Allotment::new(seed, width, 0, 1, &vec![per_pixel as f32; pixels]);
        let mattes = MatteIds::default();
        let paths = PathOptions {
            max_depth,
            plan: SamplePlan::Allotted(&allotment),
            filter: self.filter,
            aovs: AovSet::NONE,
            mattes: &mattes,
            light_groups: 0,
            catchers: false,
            soft_terminator,
            reuse: None,
            branches: 1,
            keeps_plain: false,
            caustics: self.caustics,
            guide: Some(guide),
            teaches: true,
        };
        let integrator = Integrator::new(self.scene, self.view, paths);
        let one = |block: &Block| {
            WORKSPACE.with(|workspace| {
                let w = &mut *workspace.borrow_mut();
                let before = w.ray_counts;
                let learnt = integrator.learn(block, w, &self.stop);
                self.progress.add(0, w.ray_counts.since(before).all, self.stopwatch.wall(), self.listener);
                learnt.filter(|_| !(self.stop)()).ok_or(Stopped)
            })
        };
        blocks(width, height, per_pixel).par_iter().map(one).collect()
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

/// Learns, in the order of the blocks, by shares of the cells.
fn learn(lessons: &mut Lessons, learnt: &[Learnt]) {
    let grid = lessons.grid;
    let notes: Vec<Notes> = learnt.par_iter().map(|l| grid.notes(&l.lessons)).collect();
    lessons
        .shares
        .par_iter_mut()
        .enumerate()
        .for_each(|(k, share)| notes.iter().for_each(|n| share.learn(&n[k])));
}
