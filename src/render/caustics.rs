//! Whether caustics are found from the lamp, and by how many paths: what some of them bring decides.

use super::options::{Adaptive, Caustics, RenderOptions};
use crate::compile::{CompiledScene, View};
use crate::error::Warning;
use crate::film::{AovSet, AovSpace, FilterSampler, MatteIds};
use crate::integrator::{
    Block, CausticPlan, CausticTally, Integrator, PathOptions, PathSample, SamplePlan, Workspace,
};
use crate::sampling::Arrangement;
use crate::sampling::hash::r2_sequence;
use std::sync::Arc;

/// Paths from lamps that are tried.
const TRIED_PATHS: u32 = 1 << 13;

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

    /// Decides, once.
    pub fn decide(
        &mut self,
        scene: &CompiledScene,
        view: &View,
        options: &RenderOptions,
        filter: &FilterSampler,
    ) {
        if !std::mem::replace(&mut self.is_decided, true)
            && options.caustics != Caustics::Off
            && obstacle(scene, view, options).is_none()
        {
            self.plan =
                Trial { scene, view, options, filter, mattes: MatteIds::default() }.plan().map(Arc::new);
        }
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
    mattes: MatteIds,
}

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

    fn plan(&self) -> Option<CausticPlan> {
        // As many as pixels, to begin with.
        let plan = CausticPlan::new(self.scene, self.options.seed, self.pixels() as u32)?;
        let mut w = Workspace::new();
        let tried = self.tried(TRIED_PATHS);
        let tally = self.integrator(&plan).trace_from_lamps(u32::MAX, 0..tried, &mut w, &mut Vec::new());
        if tally.sum <= 0.0 {
            return None;
        }
        let rest = self.rest(&plan, &mut w);
        let (share, gain) = best_share(&scaled(tally, self.pixels() / f64::from(tried)), &rest);
        let is_wanted = self.options.caustics == Caustics::On || gain >= LEAST_GAIN;
        let paths = (share * self.pixels()).round().max(1.0);
        is_wanted.then(|| plan.with_paths(paths as u32))
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
    fn rest(&self, plan: &CausticPlan, w: &mut Workspace) -> Rest {
        let integrator = self.integrator(plan);
        let (width, height) = (EDGE.min(self.view.width), EDGE.min(self.view.height));
        let place = |fraction: u32, room: u32| ((u64::from(fraction) * u64::from(room + 1)) >> 32) as u32;
        let (mut squares, mut light, before) = (Vec::new(), 0.0, w.ray_counts.all);
        for [x, y] in (0..self.tried(SQUARES)).map(r2_sequence) {
            let (x0, y0) = (place(x, self.view.width - width), place(y, self.view.height - height));
            let block = Block { x0, y0, width, height, first_sample: 0, samples: 2 };
            let mut first = 0.0;
            let mut is_second = false;
            let _ = integrator.trace(&block, w, &|| false, |sample: &PathSample<'_>| {
                let value = f64::from(crate::color::luminance(sample.rgb));
                light += 0.5 * value;
                if is_second {
                    squares.push(0.5 * (value - first).powi(2));
                }
                (first, is_second) = (value, !is_second);
            });
        }
        let count = squares.len().max(1) as f64;
        squares.sort_by(f64::total_cmp);
        let kept = (count * (1.0 - LEFT_OUT)).ceil() as usize;
        squares.truncate(kept.min(squares.len().saturating_sub(LEAST_LEFT_OUT)));
        let scale = self.pixels() / count;
        let rays = (w.ray_counts.all - before) as f64 * 0.5 * scale;
        Rest { squares: squares.iter().sum::<f64>() * scale, light: light * scale, rays }
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
