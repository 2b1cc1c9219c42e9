//! Caustics by light tracing: a trial that decides whether light tracing is used, and with how many light paths.

use super::options::{Caustics, RenderOptions};
use super::progress::{Statistics, new_task_group};
use super::technique::{LightPathCost, Request, Stopped, Target, Technique, Trial, first_reason};
use crate::integrator::{
    Block, CausticPlan, CausticStats, Integrator, IntegratorOptions, PathSample, SamplePlan,
};
use crate::sampling::ZSobolOrder;
use crate::sampling::hash::r2_sequence;
use rayon::prelude::*;

/// Number of light paths of a trial.
const TRIED_PATHS: u32 = 1 << 13;

/// Sample index of a trial, which no picture uses.
const TRIAL_SAMPLE: u32 = u32::MAX;

/// Light paths per task.
const PATHS_PER_TASK: u32 = 1 << 7;

/// Number of pixel squares for measuring the noise of camera paths, with two samples per pixel.
const SQUARES: u32 = 128;
/// Edge of these squares, pixels.
const EDGE: u32 = 4;

/// Number of pixels below which trials are smaller in proportion, down to the fraction [`MIN_TRIED`].
const ALL_PIXELS: f64 = 65_536.0;
const MIN_TRIED: f64 = 1.0 / 4.0;

/// Fraction of pixels, the noisiest ones, excluded from the noise of camera paths.
const EXCLUDED: f64 = 0.01;

/// Minimum number of excluded pixels.
const MIN_EXCLUDED: usize = 12;

/// Candidates for the number of light paths per pixel and sample.
const PATHS_PER_PIXEL: [f64; 6] = [0.0625, 0.125, 0.25, 0.5, 1.0, 2.0];

/// Minimum ratio of the efficiency with light tracing to that without.
const MIN_GAIN: f64 = 1.3;

/// Minimum fraction of the picture's luminance from light paths.
const MIN_LIGHT: f64 = 1e-5;

/// Time per ray of a light path, including shading, relative to a ray of a camera path. (Glass and metal balls in a box: 1.41 times the
/// processor time for 1.13 times the rays.)
const RAY_COST: f64 = 3.0;

/// Light tracing of caustics.
#[derive(Clone, Debug, Default)]
pub(super) struct LightTracing {
    /// `None` if the technique is not used.
    plan: Option<CausticPlan>,
    cost: LightPathCost,
}

impl LightTracing {
    /// Squared error and time of light paths, relative to camera paths.
    pub fn light_path_cost(&self) -> LightPathCost {
        self.cost
    }

    /// The plan, if the technique is used.
    pub fn plan(&self) -> Option<&CausticPlan> {
        self.plan.as_ref()
    }
}

impl Technique for LightTracing {
    fn request(&self, options: &RenderOptions) -> Request {
        match options.caustics {
            Caustics::Off => Request::Off,
            Caustics::Auto => Request::Auto,
            Caustics::On => Request::On,
        }
    }

    fn unused_warning(&self) -> &'static str {
        "caustics are not traced from the lights"
    }

    fn prevented_by(&self, target: &Target<'_>) -> Option<&'static str> {
        let Target { scene, view, options } = target;
        let features = &scene.features;
        let is_moving = scene.is_moving() || view.moving.is_some();
        first_reason(&[
            (features.scattering, "the scene has media that scatter or have no surface"),
            (
                scene.materials.iter().any(|m| m.is_transparent_to_shadow_rays),
                "the scene has thin sheets of glass",
            ),
            (is_moving, "something moves in the scene, or the camera does"),
            (features.links, "lights of the scene are linked to some objects only"),
            (features.ray_kinds, "objects or lights of the scene are visible to some ray kinds only"),
            (features.holdouts || options.catchers, "the scene has holdouts or shadow catchers"),
            (
                options.limits_paths() || options.bounces.transparent < u32::MAX && features.transparency,
                "bounces are limited by kind, light is clamped, glossy surfaces are filtered, or caustics are left out",
            ),
            (options.max_depth < 2, "there is no indirect light with so few bounces"),
        ])
    }

    fn try_before_first_pass(&mut self, trial: &Trial<'_>) -> Result<(), Stopped> {
        if let Some((plan, cost)) = LightTrial(trial).plan()? {
            (self.plan, self.cost) = (Some(plan), cost);
        }
        Ok(())
    }

    fn configure<'a>(&'a self, paths: &mut IntegratorOptions<'a>) {
        paths.caustics = self.plan();
    }

    // The splats of a pass are merged before the next pass begins.
    fn separates_passes(&self) -> bool {
        self.plan.is_some()
    }

    fn report(&self, statistics: &mut Statistics) {
        statistics.light_paths = self.plan().map(CausticPlan::paths);
    }
}

/// The trial of light tracing.
struct LightTrial<'a>(&'a Trial<'a>);

/// Measurements of camera paths without the light that light paths sample, for one sample per pixel of the whole picture.
struct CameraPaths {
    /// Sum of squared errors of luminance.
    squares: f64,
    /// Sum of luminances.
    light: f64,
    /// Number of rays.
    rays: f64,
}

impl LightTrial<'_> {
    fn pixels(&self) -> f64 {
        f64::from(self.0.target.view.width) * f64::from(self.0.target.view.height)
    }

    /// Size of the trial for this picture; `most` is that for large pictures.
    fn trial_size(&self, most: u32) -> u32 {
        (f64::from(most) * (self.pixels() / ALL_PIXELS).clamp(MIN_TRIED, 1.0)) as u32
    }

    fn plan(&self) -> Result<Option<(CausticPlan, LightPathCost)>, Stopped> {
        // One light path per pixel.
        let plan = CausticPlan::new(self.0.target.scene, self.0.target.options.seed, self.pixels() as u32);
        let Some(plan) = plan else { return Ok(None) };
        let tried = self.trial_size(TRIED_PATHS);
        let stats = self.try_paths(&plan, tried)?;
        if stats.sum <= 0.0 {
            return Ok(None);
        }
        let camera = self.measure_camera_paths(&plan)?;
        let one = scaled(stats, self.pixels() / f64::from(tried));
        let (paths_per_pixel, gain) = best_path_count(&one, &camera);
        let is_wanted = self.0.target.options.caustics == Caustics::On || gain >= MIN_GAIN;
        let paths = (paths_per_pixel * self.pixels()).round().max(1.0);
        Ok(is_wanted
            .then(|| (plan.with_paths(paths as u32), light_path_cost(&one, &camera, paths_per_pixel))))
    }

    /// Traces `tried` light paths.
    fn try_paths(&self, plan: &CausticPlan, tried: u32) -> Result<CausticStats, Stopped> {
        let integrator = self.integrator(plan);
        let group = new_task_group();
        let starts: Vec<u32> = (0..tried).step_by(PATHS_PER_TASK as usize).collect();
        let stats = starts.into_par_iter().map(|start| {
            let paths = start..tried.min(start + PATHS_PER_TASK);
            self.0.run(("caustics", group), self.0.stop, |w| {
                Some(integrator.trace_light_paths(TRIAL_SAMPLE, paths, w, &mut Vec::new()))
            })
        });
        let stats = stats.collect::<Result<Vec<CausticStats>, Stopped>>()?;
        // Summed in order, independently of threads.
        Ok(stats.into_iter().fold(CausticStats::default(), CausticStats::plus))
    }

    fn integrator<'a>(&'a self, plan: &'a CausticPlan) -> Integrator<'a> {
        let Target { scene, view, options } = self.0.target;
        let samples = SamplePlan::Even(ZSobolOrder::new(options.seed, 2, 1));
        Integrator::new(
            scene,
            view,
            IntegratorOptions { plan: samples, caustics: Some(plan), ..self.0.paths.clone() },
        )
    }

    /// Measures the noise of camera paths without the light that light paths sample.
    fn measure_camera_paths(&self, plan: &CausticPlan) -> Result<CameraPaths, Stopped> {
        let integrator = self.integrator(plan);
        let (width, height) = (EDGE.min(self.0.target.view.width), EDGE.min(self.0.target.view.height));
        let scaled = |fraction: u32, range: u32| ((u64::from(fraction) * u64::from(range + 1)) >> 32) as u32;
        let group = new_task_group();
        let square = |[x, y]: [u32; 2]| {
            let (x0, y0) =
                (scaled(x, self.0.target.view.width - width), scaled(y, self.0.target.view.height - height));
            let block = Block { x0, y0, width, height, first_sample: 0, samples: 2 };
            self.0.run(("caustics", group), self.0.stop, |w| {
                let (mut values, before) = (Vec::new(), w.ray_counts.all);
                let _ = integrator.trace(&block, w, &self.0.stop, |sample: &PathSample<'_>| {
                    values.push(f64::from(crate::color::luminance(sample.rgb)));
                });
                Some((values, w.ray_counts.all - before))
            })
        };
        let positions: Vec<[u32; 2]> = (0..self.trial_size(SQUARES)).map(r2_sequence).collect();
        let found = positions.into_par_iter().map(square).collect::<Result<Vec<_>, Stopped>>()?;
        let (mut squares, mut light, mut rays) = (Vec::new(), 0.0, 0);
        for (values, of_square) in &found {
            values.iter().for_each(|value| light += 0.5 * value);
            // The two samples of a pixel are consecutive.
            squares.extend(values.as_chunks::<2>().0.iter().map(|[a, b]| 0.5 * (b - a).powi(2)));
            rays += of_square;
        }
        let count = squares.len().max(1) as f64;
        squares.sort_by(f64::total_cmp);
        let kept = (count * (1.0 - EXCLUDED)).ceil() as usize;
        squares.truncate(kept.min(squares.len().saturating_sub(MIN_EXCLUDED)));
        let scale = self.pixels() / count;
        let rays = rays as f64 * 0.5 * scale;
        Ok(CameraPaths { squares: squares.iter().sum::<f64>() * scale, light: light * scale, rays })
    }
}

fn scaled(stats: CausticStats, factor: f64) -> CausticStats {
    CausticStats {
        sum: stats.sum * factor,
        squares: stats.squares * factor,
        squares_from_camera: stats.squares_from_camera * factor,
        rays: (stats.rays as f64 * factor) as u64,
    }
}

/// The best number of light paths per pixel and sample, and the ratio of the efficiency with light tracing to that without. `one` is the
/// measurement for one light path per pixel.
fn best_path_count(one: &CausticStats, camera: &CameraPaths) -> (f64, f64) {
    let candidate = |paths_per_pixel: f64| {
        let error = camera.squares + one.squares / paths_per_pixel;
        let cost = 1.0 + light_path_cost(one, camera, paths_per_pixel).time;
        let gain = (camera.squares + one.squares_from_camera) / (error * cost).max(1e-300);
        (paths_per_pixel, gain, error * cost)
    };
    let candidates = PATHS_PER_PIXEL.map(candidate);
    let (paths_per_pixel, gain, _) =
        candidates.into_iter().fold(candidates[0], |best, next| if next.2 < best.2 { next } else { best });
    let is_visible = one.sum >= MIN_LIGHT * (camera.light + one.sum);
    (paths_per_pixel, if is_visible { gain } else { 0.0 })
}

/// Squared error and time of `paths_per_pixel` light paths per pixel and sample, relative to camera paths.
fn light_path_cost(one: &CausticStats, camera: &CameraPaths, paths_per_pixel: f64) -> LightPathCost {
    LightPathCost {
        error: one.squares / paths_per_pixel / camera.squares.max(1e-300),
        time: paths_per_pixel * RAY_COST * one.rays as f64 / camera.rays.max(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::{CompileOptions, View, choose_camera, compile};
    use crate::film::{FilterSampler, MatteIds};
    use crate::render::progress::{Progress, Spent, Stopwatch};
    use crate::render::technique::radiance_only_options;
    use std::path::Path;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Runs a trial that is stopped after `calls_before` calls of `stop`; returns the number of calls, whether the trial was finished, and
    /// the number of light paths of the plan.
    fn run_trial(calls_before: u32, threads: usize) -> (u32, bool, Option<u32>) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-spheres.toml");
        let scene = crate::load::load(&path, &Default::default()).expect("the scene loads").scene;
        let (compiled, _) = compile(&scene, &CompileOptions::default()).expect("it is valid");
        let options = RenderOptions::default().size(64, 64).caustics(Caustics::On);
        let view = View::new(&compiled, choose_camera(&scene, None).expect("a camera"), 64, 64);
        let (filter, mattes, calls) = (
            FilterSampler::new(options.filter, options.filter_radius),
            MatteIds::default(),
            AtomicU32::new(0),
        );
        let trial = Trial {
            target: Target { scene: &compiled, view: &view, options: &options },
            paths: radiance_only_options(&options, &filter, &mattes),
            progress: &Progress::new(0),
            listener: None,
            stopwatch: &Stopwatch::start(Spent::default()),
            stop: &|| calls.fetch_add(1, Ordering::Relaxed) >= calls_before,
        };
        let mut technique = LightTracing::default();
        let decide = || technique.try_before_first_pass(&trial).is_ok();
        let is_done = crate::render::in_pool(Some(threads), decide).expect("the threads start");
        (calls.into_inner(), is_done, technique.plan().map(CausticPlan::paths))
    }

    #[test]
    fn stopped_trials_end_soon() {
        let (calls, is_done, plan) = run_trial(u32::MAX, 3);
        assert!(is_done && plan.is_some());
        // Each task calls `stop` twice; one thread begins one more task.
        let (calls_then, is_done, plan) = run_trial(5, 1);
        assert!(!is_done && plan.is_none());
        assert!(calls_then < 8 && calls > 60, "{calls_then} of {calls}");
    }

    #[test]
    fn threads_do_not_change_the_trial() {
        let of_one = run_trial(u32::MAX, 1);
        assert_eq!([run_trial(u32::MAX, 3), run_trial(u32::MAX, 40)], [of_one; 2]);
    }
}
