//! Whether caustics are found from the lamp, and by how many paths: what some of them bring decides.

use super::options::{Adaptive, Caustics, RenderOptions};
use super::timeline;
use super::work::WORKSPACE;
use crate::compile::{CompiledScene, View};
use crate::error::Warning;
use crate::film::{AovSet, AovSpace, FilterSampler, MatteIds};
use crate::integrator::{
    Block, CausticPlan, CausticTally, Integrator, PathOptions, PathSample, SamplePlan, Workspace,
};
use crate::sampling::Arrangement;
use crate::sampling::hash::r2_sequence;
use rayon::prelude::*;
use std::sync::Arc;

/// Paths from lamps that are tried.
const TRIED_PATHS: u32 = 1 << 13;

/// So many of them by one thread at a time.
const PATHS_AT_A_TIME: u32 = 1 << 7;

/// Squares of so many pixels, with this edge and two samples a pixel, tell how noisy the rest of the picture is.
const SQUARES: u32 = 128;
const EDGE: u32 = 4;

/// In pictures of fewer pixels, as much less is tried of both, and at least one part in so many.
const ALL_PIXELS: f64 = 65_536.0;
const LEAST_TRIED: f64 = 1.0 / 4.0;

/// The share of pixels, the noisiest, that don't count there: what is left to paths from the camera is noisy enough.
const LEFT_OUT: f64 = 0.01;

/// So many are left out at least.
const LEAST_LEFT_OUT: usize = 12;

/// Numbers of paths from lamps for each pixel and sample.
const SHARES: [f64; 6] = [0.0625, 0.125, 0.25, 0.5, 1.0, 2.0];

/// They must make the picture more efficient by this factor.
const LEAST_GAIN: f64 = 1.3;

/// Where nothing else finds the light, it must be this part of the picture's.
const LEAST_LIGHT: f64 = 1e-5;

/// Time of a ray from a lamp with all that belongs to it, as a part of that of one from the camera. (Glass and metal balls in a
/// box: 1.41 times the processor time for 1.13 times the rays.)
const RAY_COST: f64 = 3.0;

/// What is decided about caustics.
#[derive(Clone, Debug, Default)]
pub(super) struct CausticChoice {
    is_decided: bool,
    plan: Option<Arc<CausticPlan>>,
}

impl CausticChoice {
    /// The plan, if there is one.
    pub fn plan(&self) -> Option<&CausticPlan> {
        self.plan.as_deref()
    }

    /// Decides, once. False if it was stopped.
    pub fn decide(
        &mut self,
        scene: &CompiledScene,
        view: &View,
        options: &RenderOptions,
        filter: &FilterSampler,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> bool {
        if self.is_decided {
            return true;
        }
        if options.caustics != Caustics::Off && obstacle(scene, view, options).is_none() {
            let trial = Trial { scene, view, options, filter, stop, mattes: MatteIds::default() };
            let Ok(plan) = trial.plan() else { return false };
            self.plan = plan.map(Arc::new);
        }
        self.is_decided = true;
        true
    }
}

/// What is said where caustics were to be found from the lamp and are not.
pub(super) fn warning(scene: &CompiledScene, view: &View, options: &RenderOptions) -> Option<Warning> {
    if options.caustics != Caustics::On {
        return None;
    }
    let reason = obstacle(scene, view, options)?;
    Some(Warning::general(format!("caustics are not found from the lamp: {reason}")))
}

/// Why they can't be.
fn obstacle(scene: &CompiledScene, view: &View, options: &RenderOptions) -> Option<&'static str> {
    let reasons = [
        (scene.features.scattering, "the scene has media that scatter or end where no surface is"),
        (scene.materials.iter().any(|m| m.passes_straight), "the scene has thin sheets of glass"),
        (scene.is_moving() || view.moving.is_some(), "something moves in the scene, or the camera does"),
        (scene.features.links, "lights of the scene are linked to some objects only"),
        (scene.features.ray_kinds, "objects or lights of the scene are visible to some kinds of rays only"),
        (scene.features.holdouts || options.catchers, "the scene has holdouts or shadow catchers"),
        (options.adaptive != Adaptive::Off, "pixels get different numbers of samples"),
        (options.max_depth < 2, "there is no indirect light with so few bounces"),
    ];
    reasons.into_iter().find(|(holds, _)| *holds).map(|(_, reason)| reason)
}

/// Tries paths from lamps.
struct Trial<'a> {
    scene: &'a CompiledScene,
    view: &'a View,
    options: &'a RenderOptions,
    filter: &'a FilterSampler,
    stop: &'a (dyn Fn() -> bool + Sync),
    mattes: MatteIds,
}

/// The trial was stopped.
struct Stopped;

/// What paths from the camera have shown, for one sample of each pixel.
struct Rest {
    /// Sum of the squared errors of luminances.
    squares: f64,
    /// Sum of luminances.
    light: f64,
    rays: f64,
}

impl Trial<'_> {
    fn pixels(&self) -> f64 {
        f64::from(self.view.width) * f64::from(self.view.height)
    }

    /// How much of what is tried in large pictures is worth while in this one.
    fn tried(&self, most: u32) -> u32 {
        (f64::from(most) * (self.pixels() / ALL_PIXELS).clamp(LEAST_TRIED, 1.0)) as u32
    }

    fn plan(&self) -> Result<Option<CausticPlan>, Stopped> {
        // As many as pixels, to begin with.
        let plan = CausticPlan::new(self.scene, self.options.seed, self.pixels() as u32);
        let Some(plan) = plan else { return Ok(None) };
        let tried = self.tried(TRIED_PATHS);
        let tally = self.try_paths(&plan, tried)?;
        if tally.sum <= 0.0 {
            return Ok(None);
        }
        let rest = self.rest(&plan)?;
        let (share, gain) = best_share(&scaled(tally, self.pixels() / f64::from(tried)), &rest);
        let is_wanted = self.options.caustics == Caustics::On || gain >= LEAST_GAIN;
        let paths = (share * self.pixels()).round().max(1.0);
        Ok(is_wanted.then(|| plan.with_paths(paths as u32)))
    }

    /// Tries so many paths from lamps.
    fn try_paths(&self, plan: &CausticPlan, tried: u32) -> Result<CausticTally, Stopped> {
        let integrator = self.integrator(plan);
        let group = timeline::group();
        let starts: Vec<u32> = (0..tried).step_by(PATHS_AT_A_TIME as usize).collect();
        let tallies = starts.into_par_iter().map(|start| {
            let paths = start..tried.min(start + PATHS_AT_A_TIME);
            self.in_workspace("caustics", group, |w| {
                integrator.trace_from_lamps(u32::MAX, paths, w, &mut Vec::new())
            })
        });
        let tallies = tallies.collect::<Result<Vec<CausticTally>, Stopped>>()?;
        // In their order, so that the sums don't depend on threads.
        Ok(tallies.into_iter().fold(CausticTally::default(), |sum, of_some| CausticTally {
            sum: sum.sum + of_some.sum,
            squares: sum.squares + of_some.squares,
            squares_from_camera: sum.squares_from_camera + of_some.squares_from_camera,
            rays: sum.rays + of_some.rays,
        }))
    }

    /// Does some work of a thread, unless it was stopped.
    fn in_workspace<T>(
        &self,
        stage: &'static str,
        group: u32,
        work: impl FnOnce(&mut Workspace) -> T,
    ) -> Result<T, Stopped> {
        if (self.stop)() {
            return Err(Stopped);
        }
        let done = WORKSPACE.with(|w| timeline::item(stage, group, || work(&mut w.borrow_mut())));
        if (self.stop)() { Err(Stopped) } else { Ok(done) }
    }

    fn integrator<'a>(&'a self, plan: &'a CausticPlan) -> Integrator<'a> {
        let paths = PathOptions {
            max_depth: self.options.max_depth,
            plan: SamplePlan::Even(Arrangement::new(self.options.seed, 2, 1)),
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
            caustics: Some(plan),
            guide: None,
            records_training: false,
        };
        Integrator::new(self.scene, self.view, paths)
    }

    /// How noisy the picture is without the light that is taken.
    fn rest(&self, plan: &CausticPlan) -> Result<Rest, Stopped> {
        let integrator = self.integrator(plan);
        let (width, height) = (EDGE.min(self.view.width), EDGE.min(self.view.height));
        let place = |fraction: u32, room: u32| ((u64::from(fraction) * u64::from(room + 1)) >> 32) as u32;
        let group = timeline::group();
        let square = |[x, y]: [u32; 2]| {
            let (x0, y0) = (place(x, self.view.width - width), place(y, self.view.height - height));
            let block = Block { x0, y0, width, height, first_sample: 0, samples: 2 };
            self.in_workspace("caustics", group, |w| {
                let (mut values, before) = (Vec::new(), w.ray_counts.all);
                let _ = integrator.trace(&block, w, &self.stop, |sample: &PathSample<'_>| {
                    values.push(f64::from(crate::color::luminance(sample.rgb)));
                });
                (values, w.ray_counts.all - before)
            })
        };
        let places: Vec<[u32; 2]> = (0..self.tried(SQUARES)).map(r2_sequence).collect();
        let found = places.into_par_iter().map(square).collect::<Result<Vec<_>, Stopped>>()?;
        let (mut squares, mut light, mut rays) = (Vec::new(), 0.0, 0);
        for (values, of_square) in &found {
            values.iter().for_each(|value| light += 0.5 * value);
            // The two samples of each pixel follow each other.
            squares.extend(values.as_chunks::<2>().0.iter().map(|[a, b]| 0.5 * (b - a).powi(2)));
            rays += of_square;
        }
        let count = squares.len().max(1) as f64;
        squares.sort_by(f64::total_cmp);
        let kept = (count * (1.0 - LEFT_OUT)).ceil() as usize;
        squares.truncate(kept.min(squares.len().saturating_sub(LEAST_LEFT_OUT)));
        let scale = self.pixels() / count;
        let rays = rays as f64 * 0.5 * scale;
        Ok(Rest { squares: squares.iter().sum::<f64>() * scale, light: light * scale, rays })
    }
}

fn scaled(tally: CausticTally, factor: f64) -> CausticTally {
    CausticTally {
        sum: tally.sum * factor,
        squares: tally.squares * factor,
        squares_from_camera: tally.squares_from_camera * factor,
        rays: (tally.rays as f64 * factor) as u64,
    }
}

/// How many paths from lamps for each pixel and sample are best, and how many times more efficient the picture is by them; `one`
/// is what one for each pixel brings.
fn best_share(one: &CausticTally, rest: &Rest) -> (f64, f64) {
    let way = |share: f64| {
        let error = rest.squares + one.squares / share;
        let cost = 1.0 + share * RAY_COST * one.rays as f64 / rest.rays.max(1.0);
        let gain = (rest.squares + one.squares_from_camera) / (error * cost).max(1e-300);
        (share, gain, error * cost)
    };
    let ways = SHARES.map(way);
    let (share, gain, _) =
        ways.into_iter().fold(ways[0], |best, next| if next.2 < best.2 { next } else { best });
    let is_seen = one.sum >= LEAST_LIGHT * (rest.light + one.sum);
    (share, if is_seen { gain } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::{CompileOptions, choose_camera, compile};
    use std::path::Path;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Stops a trial when that was asked for so many times whether it is to stop. How often it was asked in all, and whether something
    /// was decided.
    fn tried(asked_before: u32, threads: usize) -> (u32, bool, Option<u32>) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-spheres.toml");
        let scene = crate::load::load(&path, &Default::default()).expect("the scene loads").scene;
        let (compiled, _) = compile(&scene, &CompileOptions::default()).expect("it is valid");
        let options = RenderOptions::default().size(64, 64).caustics(Caustics::On);
        let view = View::new(&compiled, choose_camera(&scene, None).expect("a camera"), 64, 64);
        let (filter, asked) = (FilterSampler::new(options.filter), AtomicU32::new(0));
        let stop = || asked.fetch_add(1, Ordering::Relaxed) >= asked_before;
        let mut choice = CausticChoice::default();
        let decide = || choice.decide(&compiled, &view, &options, &filter, &stop);
        let is_done = super::super::in_pool(Some(threads), decide).expect("the threads start");
        (asked.into_inner(), is_done, choice.plan().map(CausticPlan::paths))
    }

    #[test]
    fn a_trial_ends_when_it_is_stopped() {
        let (asked, is_done, plan) = tried(u32::MAX, 3);
        assert!(is_done && plan.is_some());
        // Of all its parts, each of which asks twice, one thread begins one more.
        let (asked_then, is_done, plan) = tried(5, 1);
        assert!(!is_done && plan.is_none());
        assert!(asked_then < 8 && asked > 60, "{asked_then} of {asked}");
    }

    #[test]
    fn threads_do_not_change_the_trial() {
        let of_one = tried(u32::MAX, 1);
        assert_eq!([tried(u32::MAX, 3), tried(u32::MAX, 40)], [of_one; 2]);
    }
}
