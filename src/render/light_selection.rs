//! Learned light selection: before the first pass, the light samples of some paths show which lights are occluded where. These paths are
//! spread over the whole picture and discarded, so that all parts of a picture select lights with the same probabilities.

use super::options::{LightSelection, RenderOptions};
use super::progress::{Statistics, new_task_group};
use super::technique::{
    Request, Stopped, Target, Technique, Trial, first_reason, planned_samples, spread_paths,
};
use crate::integrator::{Integrator, IntegratorOptions, LightSampleRecord, LightVisibility, SamplePlan};
use rayon::prelude::*;

/// Number of paths, as a fraction of the planned samples.
const PATH_FRACTION: f64 = 1.0 / 256.0;
/// Minimum and maximum number of paths.
const PATHS: [u64; 2] = [1 << 11, 1 << 16];

/// Maximum expected ratio of the variance of light selection, with weights and without, for automatic use.
const MAX_RATIO: f32 = 0.5;

/// Decorrelates these paths from pictures with the same seed.
const SEED: u32 = 0x3c6e_f372;

/// Learned light selection.
#[derive(Clone, Debug, Default)]
pub(super) struct LearnedSelection {
    visibility: Option<LightVisibility>,
    is_learned: bool,
}

impl Technique for LearnedSelection {
    fn request(&self, options: &RenderOptions) -> Request {
        match options.light_selection {
            LightSelection::Estimated => Request::Off,
            LightSelection::Auto => Request::Auto,
            LightSelection::Learned => Request::On,
        }
    }

    fn unused_warning(&self) -> &'static str {
        "light selection is not learned"
    }

    fn prevented_by(&self, target: &Target<'_>) -> Option<&'static str> {
        let Target { scene, options, .. } = target;
        first_reason(&[
            (scene.features.links, "lights of the scene are linked to some objects only"),
            (scene.lights.count_groups() < 2, "there is nothing to select"),
            (options.max_depth == 0, "without bounces there is no light on surfaces"),
            (planned(options) < min_planned(options), "there are too few samples"),
        ])
    }

    fn trial_failure(&self, _options: &RenderOptions) -> Option<&'static str> {
        (self.is_learned && self.visibility.is_none()).then_some("no path found a lit surface")
    }

    fn try_before_first_pass(&mut self, trial: &Trial<'_>) -> Result<(), Stopped> {
        let learned = LightVisibility::learn(&trace_light_samples(trial)?);
        let is_requested = trial.target.options.light_selection == LightSelection::Learned;
        let pays = |ratio: f32| is_requested || ratio <= MAX_RATIO;
        self.visibility = learned.filter(|&(_, ratio)| pays(ratio)).map(|(visibility, _)| visibility);
        self.is_learned = true;
        Ok(())
    }

    fn configure<'a>(&'a self, paths: &mut IntegratorOptions<'a>) {
        paths.light_visibility = self.visibility.as_ref();
    }

    fn report(&self, statistics: &mut Statistics) {
        statistics.light_cells = self.visibility.as_ref().map(|visibility| visibility.cells() as u32);
    }
}

/// Number of planned samples of the whole picture.
fn planned(options: &RenderOptions) -> u64 {
    u64::from(planned_samples(options, true)) * u64::from(options.width) * u64::from(options.height)
}

/// Minimum number of planned samples: automatic learning takes at most a 128th of them.
fn min_planned(options: &RenderOptions) -> u64 {
    PATHS[0] * if options.light_selection == LightSelection::Auto { 128 } else { 2 }
}

/// Light samples of some camera paths, in an order that doesn't depend on threads.
fn trace_light_samples(trial: &Trial<'_>) -> Result<Vec<LightSampleRecord>, Stopped> {
    let paths = ((PATH_FRACTION * planned(trial.target.options) as f64) as u64).clamp(PATHS[0], PATHS[1]);
    let (samples, blocks) = spread_paths(trial.target.options, SEED, paths);
    let options = IntegratorOptions {
        plan: SamplePlan::Uneven(&samples),
        records_light_samples: true,
        ..trial.paths.clone()
    };
    let integrator = Integrator::new(trial.target.scene, trial.target.view, options);
    let group = new_task_group();
    let of_block = |block| {
        trial.run(("light selection", group), trial.stop, |w| {
            integrator.trace_light_samples(block, w, &trial.stop)
        })
    };
    let found: Result<Vec<Vec<LightSampleRecord>>, Stopped> = blocks.par_iter().map(of_block).collect();
    Ok(found?.concat())
}
