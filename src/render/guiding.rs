//! Path guiding: training before the first pass, by samples of the whole picture that are discarded. So a guide depends only on the scene,
//! the view and the options, and all parts of a picture use the same guide.
//!
//! Automatic guiding is decided by the noise of incident radiance at diffuse vertices: some trial paths measure it first, and the first
//! training passes must lower it. (Guides can't lower noise by direct light or mirrors.)

use super::options::{Guiding, RenderOptions};
use super::progress::{Statistics, new_task_group, parallel_task};
use super::technique::{
    Request, Stopped, Target, Technique, Trial, first_reason, planned_samples, spread_paths,
};
use crate::bsdf::BsdfClass;
use crate::integrator::{
    Block, BlockSamples, CellSamples, Grid, Guide, Integrator, IntegratorOptions, SamplePlan, TrainedCells,
    TrainingSample, WAVE,
};
use crate::math::Vec3;
use crate::sampling::hash::hash32;
use rayon::prelude::*;

/// Fraction of the planned samples spent on training.
const TRAINING_FRACTION: f64 = 0.2;

/// Sizes of the training passes, in parts; each pass is guided by the results of the earlier ones.
const PASSES: [u64; 5] = [1, 1, 2, 4, 8];
/// Sum of [`PASSES`].
const PARTS: u64 = 16;

/// Ratio of the number of paths of a part to that of the trial before training.
const TRIAL_DIVISOR: u64 = 4;
/// Minimum number of paths of the trial.
const MIN_TRIAL_PATHS: u64 = 1 << 10;

/// Minimum noise of incident radiance (see [`IncidentNoise`]) for automatic training.
///
/// Among fifty scenes at 128 x 128 pixels with 64 samples, five had 4 or more: rooms lit through a gap of a door, a slit and a window (1000,
/// 330 and 6 to 12), which with guiding are 4.3, 3.1 and 1.3 times as efficient (including training), and two with caustics (43 and 10),
/// which don't gain. The others, with 3 or less, are 0.64 to 0.88 times as efficient.
const MIN_NOISE: f64 = 4.0;

/// Maximum ratio of the noise of a training pass to that of the first one, for continuing. It was 0.06 to 0.6 and 0.05 to 0.54 in the
/// rooms, 0.77 and 0.42 in one with glossy walls, 0.4 to 2 and 0.45 to 0.8 in the scenes with caustics.
const MAX_NOISE_RATIO: [f64; PASSES.len()] = [f64::INFINITY, 0.9, 0.5, f64::INFINITY, f64::INFINITY];

/// Number of parts after which a guide is accepted.
const MIN_PARTS: u32 = 4;

/// Lower bound of the luminance that scales noise, as a fraction of the picture's mean luminance.
const MIN_LUMINANCE: f64 = 0.2;

/// Maximum number of pixels of the whole picture for automatic training, which needs 12 bytes per pixel.
const MAX_PIXELS: f64 = (1u64 << 27) as f64;

/// Minimum number of paths of a part if guiding is requested.
const MIN_PART: u64 = 1 << 9;
/// Maximum number of paths of a part.
const MAX_PART: u64 = 1 << 18;

/// Target for the final number of training samples per cell.
const SAMPLES_PER_CELL: f64 = 2000.0;

/// Maximum fraction of a time limit for training.
const MAX_TIME_FRACTION: f64 = 0.1;

/// Blocks of a step, spread over the picture. The first step determines the cell size.
const BLOCKS: usize = 16;

/// Bound on the number of vertices of most paths, for the memory estimate.
const MAX_VERTICES: u32 = 64;
/// Bytes of a training sample while cells are updated.
const CELL_SAMPLE_BYTES: usize = 24;

/// Decorrelates training from pictures with the same seed.
const SEED: u32 = 0x7c15_9e37;

/// Part number of the trial.
const TRIAL_PART: u32 = u32::MAX;

#[derive(Clone, Debug, Default)]
pub(super) struct PathGuiding {
    guide: Option<Guide>,
    is_trained: bool,
}

impl Technique for PathGuiding {
    fn request(&self, options: &RenderOptions) -> Request {
        match options.guiding {
            Guiding::Off => Request::Off,
            Guiding::Auto => Request::Auto,
            Guiding::On => Request::On,
        }
    }

    fn unused_warning(&self) -> &'static str {
        "paths are not guided"
    }

    fn prevented_by(&self, target: &Target<'_>) -> Option<&'static str> {
        let Target { scene, options, .. } = target;
        let is_diffuse = |class: BsdfClass| matches!(class, BsdfClass::Lambert | BsdfClass::MetalRough);
        first_reason(&[
            (scene.shading.spectral, "paths carry wavelengths"),
            (!scene.materials.iter().any(|m| is_diffuse(m.class)), "no surface of the scene is diffuse"),
            (options.max_depth < 2, "there is no indirect light with so few bounces"),
            (part(options) < min_part(options), "there are too few samples for training"),
        ])
    }

    fn trial_failure(&self, options: &RenderOptions) -> Option<&'static str> {
        let reason = match options.time_limit {
            None => "no path found a diffuse surface",
            Some(_) => "no path found a diffuse surface in the time for training",
        };
        (self.is_trained && self.guide.is_none()).then_some(reason)
    }

    fn try_before_first_pass(&mut self, trial: &Trial<'_>) -> Result<(), Stopped> {
        self.guide = Training(trial).train()?;
        self.is_trained = true;
        Ok(())
    }

    fn configure<'a>(&'a self, paths: &mut IntegratorOptions<'a>) {
        paths.guide = self.guide.as_ref();
    }

    fn report(&self, statistics: &mut Statistics) {
        statistics.guide_cells = self.guide.as_ref().map(|guide| guide.cells() as u32);
    }
}

/// Upper bound of the memory of training, bytes.
pub fn guiding_bytes(options: &RenderOptions) -> u64 {
    if options.guiding == Guiding::Off || part(options) < min_part(options) {
        return 0;
    }
    let pixels = u64::from(options.width) * u64::from(options.height);
    // Paths of the current update, and paths traced at the same time.
    let paths = part(options).min((2 * steps_at_once() * BLOCKS * WAVE) as u64);
    let vertices = paths * u64::from(options.max_depth.min(MAX_VERTICES));
    // Sample counts of pixels, and training samples.
    pixels * 12 + vertices * (size_of::<TrainingSample>() + CELL_SAMPLE_BYTES) as u64
}

/// Number of steps whose blocks are traced concurrently: at least two blocks per thread, so that few threads idle.
fn steps_at_once() -> usize {
    (2 * rayon::current_num_threads()).div_ceil(BLOCKS)
}

/// Number of paths of a part of training. Depends on the number of samples only as the sample pattern does, since rendering may be resumed
/// with more samples.
fn part(options: &RenderOptions) -> u64 {
    let planned = planned_samples(options, options.guiding == Guiding::Auto);
    let pixels = f64::from(options.width) * f64::from(options.height);
    if options.guiding == Guiding::Auto && pixels > MAX_PIXELS {
        return 0;
    }
    let paths = TRAINING_FRACTION * f64::from(planned) * pixels;
    ((paths / PARTS as f64) as u64).min(MAX_PART)
}

/// Minimum number of paths of a part.
fn min_part(options: &RenderOptions) -> u64 {
    if options.guiding == Guiding::Auto { TRIAL_DIVISOR * MIN_TRIAL_PATHS } else { MIN_PART }
}

/// Trains a guide.
struct Training<'a>(&'a Trial<'a>);

impl Training<'_> {
    /// Trains a guide; `None` if no path hits a diffuse surface, or if guiding isn't worthwhile.
    fn train(&self) -> Result<Option<Guide>, Stopped> {
        let mut state =
            TrainingState { is_accepted: self.0.target.options.guiding == Guiding::On, ..Default::default() };
        let ends = self
            .0
            .target
            .options
            .time_limit
            .map(|limit| self.0.stopwatch.wall() + limit.mul_f64(MAX_TIME_FRACTION));
        let is_late = || ends.is_some_and(|end| self.0.stopwatch.wall() > end);
        let trained = self.train_passes(&mut state, &|| is_late() || (self.0.stop)());
        // Training that is ended by the time limit keeps its results.
        if trained.is_err() && (self.0.stop)() { Err(Stopped) } else { Ok(state.accepted_guide()) }
    }

    fn train_passes(
        &self,
        state: &mut TrainingState,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), Stopped> {
        if !state.is_accepted && !self.is_noisy(stop)? {
            return Ok(());
        }
        let (mut number, mut noise_of_first) = (0, None);
        for (parts, max_ratio) in PASSES.into_iter().zip(MAX_NOISE_RATIO) {
            let guide = state.guide().unwrap_or_else(Guide::blank);
            state.noise = IncidentNoise::default();
            for _ in 0..parts {
                self.train_part(&guide, number, part(self.0.target.options), state, stop)?;
                number += 1;
            }
            let noise = state.noise.per_sample();
            if self.0.target.options.guiding == Guiding::Auto {
                let ratio = noise / *noise_of_first.get_or_insert(noise);
                // False for NaN.
                let continues = ratio <= max_ratio;
                if !continues {
                    return Ok(());
                }
                state.is_accepted = number >= MIN_PARTS;
            }
        }
        Ok(())
    }

    /// The trial: is incident radiance at diffuse vertices so noisy that guiding may be worthwhile?
    fn is_noisy(&self, stop: &(dyn Fn() -> bool + Sync)) -> Result<bool, Stopped> {
        let mut state = TrainingState::default();
        self.train_part(
            &Guide::blank(),
            TRIAL_PART,
            part(self.0.target.options) / TRIAL_DIVISOR,
            &mut state,
            stop,
        )?;
        Ok(state.noise.per_sample() >= MIN_NOISE)
    }

    /// Trains with `paths` paths.
    fn train_part(
        &self,
        guide: &Guide,
        number: u32,
        paths: u64,
        state: &mut TrainingState,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<(), Stopped> {
        let (samples, blocks) = spread_paths(self.0.target.options, hash32(SEED ^ number), paths);
        let integrator = self.integrator(SamplePlan::Uneven(&samples), guide);
        let (steps, at_once) = (blocks.len().div_ceil(BLOCKS), steps_at_once());
        let trace = |first: usize| -> Result<Vec<BlockSamples>, Stopped> {
            let of_steps = first..(first + at_once).min(steps);
            let group = new_task_group();
            let one =
                |block: &Block| self.0.run(("guiding", group), stop, |w| integrator.learn(block, w, &stop));
            // The blocks of a step are spread over the picture.
            let of_all: Vec<&Block> =
                of_steps.flat_map(|step| blocks[step..].iter().step_by(steps)).collect();
            of_all.into_par_iter().map(one).collect()
        };
        let mut learn = |first: usize, mut found: Vec<BlockSamples>| {
            // In the order of steps, independently of threads.
            for step in first..(first + at_once).min(steps) {
                let of_step = found.drain(..blocks[step..].iter().step_by(steps).len()).collect();
                state.learn(of_step, PARTS * steps as u64);
            }
        };
        let mut traced: Option<(usize, Vec<BlockSamples>)> = None;
        for first in (0..steps).step_by(at_once) {
            // Updates cells with the previous steps while other threads trace.
            let last = traced.take();
            let (found, ()) = rayon::join(
                || trace(first),
                || last.into_iter().for_each(|(first, found)| learn(first, found)),
            );
            traced = Some((first, found?));
        }
        traced.into_iter().for_each(|(first, found)| learn(first, found));
        Ok(())
    }

    fn integrator<'a>(&'a self, plan: SamplePlan<'a>, guide: &'a Guide) -> Integrator<'a> {
        let paths =
            IntegratorOptions { plan, guide: Some(guide), records_training: true, ..self.0.paths.clone() };
        Integrator::new(self.0.target.scene, self.0.target.view, paths)
    }
}

/// The training data so far.
#[derive(Default)]
struct TrainingState {
    cells: Option<TrainedCells>,
    /// Sum of the luminances of the samples.
    luminance: f64,
    /// Number of samples.
    samples: u64,
    /// Noise of incident radiance in the current pass.
    noise: IncidentNoise,
    /// Is the guide used: worthwhile or requested?
    is_accepted: bool,
}

impl TrainingState {
    /// Updates the cells with the blocks of one of `steps` steps, in order. The first step determines the cell size.
    fn learn(&mut self, found: Vec<BlockSamples>, steps: u64) {
        parallel_task("learning", || self.learn_from(&found, steps));
    }

    fn learn_from(&mut self, found: &[BlockSamples], steps: u64) {
        self.luminance += found.iter().map(|block| block.luminance).sum::<f64>();
        self.samples += found.iter().map(|block| block.samples).sum::<u64>();
        let mean = self.luminance / self.samples.max(1) as f64;
        found.iter().for_each(|block| self.noise.add(block, mean));
        if self.cells.is_none() {
            let samples = found.iter().flat_map(|block| &block.training_samples);
            let all: Vec<[Vec3; 2]> = samples.map(|s| [s.p.into(), s.n.into()]).collect();
            let total = all.len() as f64 * steps as f64;
            self.cells = Grid::suited_to(&all, total, SAMPLES_PER_CELL).map(TrainedCells::new);
        }
        let Some(cells) = &mut self.cells else { return };
        let grid = cells.grid;
        let cell_samples: Vec<CellSamples> =
            found.par_iter().map(|block| grid.cell_samples(&block.training_samples)).collect();
        let shards = cells.shards.par_iter_mut().enumerate();
        shards.for_each(|(k, shard)| {
            cell_samples.iter().for_each(|cell_samples| shard.learn(&cell_samples[k]))
        });
    }

    /// The guide, if it is accepted.
    fn accepted_guide(&self) -> Option<Guide> {
        self.guide().filter(|_| self.is_accepted)
    }

    /// The guide; `None` if no path has hit a diffuse surface.
    fn guide(&self) -> Option<Guide> {
        let mean = self.luminance / self.samples.max(1) as f64;
        self.cells.as_ref().map(|cells| Guide::new(cells, mean))
    }
}

/// Noise of incident radiance at diffuse vertices: squared contribution of a vertex to its sample's luminance, over the squared mean
/// luminance of the block; summed over samples.
#[derive(Clone, Copy, Debug, Default)]
struct IncidentNoise {
    squares: f64,
    samples: f64,
}

impl IncidentNoise {
    /// Adds a block of training paths; `mean` is the mean luminance of the picture.
    fn add(&mut self, found: &BlockSamples, mean: f64) {
        let samples = found.samples as f64;
        let around = found.luminance / samples.max(1.0);
        let scale = around * around + (MIN_LUMINANCE * mean).powi(2);
        self.squares += if scale > 0.0 { found.squares / scale } else { 0.0 };
        self.samples += samples;
    }

    /// Mean per sample.
    fn per_sample(&self) -> f64 {
        self.squares / self.samples.max(1.0)
    }
}
