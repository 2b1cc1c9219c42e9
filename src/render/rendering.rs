//! Rendering pass by pass, or several passes at a time.

use super::error_estimate::ErrorEstimate;
use super::noise::RarePaths;
use super::options::{DisplaySettings, RenderOptions};
use super::pass::{PassContext, render_all};
use super::picture;
use super::picture::{
    Labels, Picture, denoise_film_with, denoised_color, has_visible_alpha, layout, sample_warnings,
};
use super::progress::{
    CancelHandle, Event, Listener, PassOutcome, Progress, Spent, Statistics, Stopwatch, parallel_task,
};
use super::schedule::{Pass, SAMPLE_BLOCK, Schedule};
use super::technique::{Target, Trial, radiance_only_options};
use super::techniques::Techniques;
use super::validation::Validation;
use crate::compile::{CompiledScene, View};
use crate::denoise::slices;
use crate::error::{Result, Warning};
use crate::film::{AovSet, Film, FilterSampler, MatteIds};
use crate::integrator::IntegratorOptions;
use crate::math::DVec3;
use crate::output::{Metadata, OutputOptions, PngOptions};
use crate::scene::{Backdrop, Camera};
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

/// Renders a scene, pass by pass, on the current rayon pool (see [`in_pool`](super::in_pool)).
///
/// Between passes, the film is a picture of the samples so far. With a time limit, passes are planned so that all pixels have the same
/// number of samples. If a pass takes longer than planned, or rendering is cancelled, the film contains the tiles finished until then:
/// sample counts of pixels may differ, by one pass after [`Rendering::next_pass`] and by a few after [`Rendering::run`]. This is unbiased,
/// since it doesn't depend on the samples' values.
///
/// ```
/// use oscura::{Renderer, render::PassOutcome};
/// let scene = oscura::load("assets/cornell-box.gltf")?;
/// let mut rendering = Renderer::new(scene).size(16, 16).samples(20).start()?;
/// while rendering.next_pass() == PassOutcome::Progressed {
///     let centre = rendering.film().mean_rgba(8, 8);
///     println!("{:.0} samples: {centre:?}", rendering.statistics().samples_per_pixel);
/// }
/// assert_eq!(rendering.statistics().samples_per_pixel, 20.0);
/// # Ok::<(), oscura::Error>(())
/// ```
pub struct Rendering {
    pub(super) scene: Arc<CompiledScene>,
    pub(super) view: View,
    pub(super) labels: Labels,
    pub(super) options: RenderOptions,
    pub(super) filter: FilterSampler,
    pub(super) film: Film,
    pub(super) schedule: Schedule,
    pub(super) progress: Progress,
    pub(super) spent: Spent,
    pub(super) outcome: PassOutcome,
    pub(super) cancel: CancelHandle,
    pub(super) listener: Option<Box<Listener>>,
    /// Warnings of loading and compiling.
    scene_warnings: Vec<Warning>,
    pub(super) display: DisplaySettings,
    /// Background picture or colour, composited behind the film.
    backdrop: Option<Backdrop>,
    /// Offset of the origin of the scene's coordinates in the world, metres.
    pub(super) world_offset: DVec3,
    /// Name of the denoiser, if the film was denoised.
    pub(super) denoised: Option<String>,
    pub(super) techniques: Techniques,
    /// Are passes finished even when cancelled or past the time limit?
    pub(super) finishes_passes: bool,
    /// With a noise threshold.
    pub(super) error_estimate: Option<ErrorEstimate>,
    /// Colour of the denoised picture of the current samples, if it was needed.
    denoised_color: Option<[Vec<f32>; 3]>,
}

/// Maximum number of passes that overlap.
const MAX_AT_ONCE: usize = 64;

impl Rendering {
    /// A rendering of a compiled scene with a camera of its description, without samples. Scenes may be shared by `Arc`.
    ///
    /// # Errors
    /// A usage error if there is not enough memory for the film. Afterwards, rendering can't fail.
    #[doc(hidden)]
    pub fn new(
        scene: impl Into<Arc<CompiledScene>>,
        camera: &Camera,
        options: RenderOptions,
    ) -> Result<Rendering> {
        Rendering::labelled(scene, Labels::default(), camera, options)
    }

    /// A rendering with names for files, [`Labels::of`] the scene. Without labels, Cryptomattes are empty, and there are no light groups.
    ///
    /// # Errors
    /// As for [`Rendering::new`].
    #[doc(hidden)]
    pub fn labelled(
        scene: impl Into<Arc<CompiledScene>>,
        labels: Labels,
        camera: &Camera,
        options: RenderOptions,
    ) -> Result<Rendering> {
        let layout = layout(&options, &labels);
        options.check_partial_render()?;
        let region = options.pixels();
        let film = Film::of_layout(region.width(), region.height(), layout)?.at(region.x0, region.y0);
        let scene = scene.into();
        let view = View::new(&scene, camera, options.width, options.height);
        let stopwatch = Stopwatch::start(Spent::default());
        let pixels = u64::from(region.width()) * u64::from(region.height());
        let samples = options.samples_to_render();
        Ok(Rendering {
            techniques: Techniques::new(&Target { scene: &scene, view: &view, options: &options }),
            scene,
            view,
            labels,
            filter: FilterSampler::new(options.filter, options.filter_radius),
            film,
            progress: Progress::new(pixels * samples.len() as u64),
            schedule: Schedule::new(samples, options.time_limit),
            spent: stopwatch.stop(),
            outcome: PassOutcome::Progressed,
            cancel: CancelHandle::new(),
            listener: None,
            scene_warnings: Vec::new(),
            display: DisplaySettings::default(),
            backdrop: None,
            world_offset: DVec3::ZERO,
            denoised: None,
            finishes_passes: false,
            error_estimate: ErrorEstimate::new(&options),
            denoised_color: None,
            options,
        })
    }

    /// Sets warnings, display settings, cancel handle and listener of a [`Renderer`](super::Renderer).
    pub(super) fn with(
        self,
        scene_warnings: Vec<Warning>,
        display: DisplaySettings,
        cancel: CancelHandle,
        listener: Option<Box<Listener>>,
    ) -> Rendering {
        Rendering { scene_warnings, display, cancel, listener, ..self }
    }

    /// Sets the backdrop behind transparent pixels, and the offset of the scene's origin in the world, metres, for file headers.
    #[must_use]
    pub fn placed(self, backdrop: Option<Backdrop>, world_offset: DVec3) -> Rendering {
        Rendering { backdrop, world_offset, ..self }
    }

    /// Replaces the cancel handle.
    #[must_use]
    pub fn with_cancel_handle(self, cancel: CancelHandle) -> Rendering {
        Rendering { cancel, ..self }
    }

    /// Calls `listener` with the progress several times per second, from any thread. Replaces an earlier listener.
    #[must_use]
    pub fn on_event(self, listener: impl Fn(Event) + Send + Sync + 'static) -> Rendering {
        Rendering { listener: Some(Box::new(listener)), ..self }
    }

    /// A handle that cancels the rendering from any thread.
    pub fn cancel_handle(&self) -> CancelHandle {
        self.cancel.clone()
    }

    /// Renders the next samples of all pixels, at most eight per pixel. Does nothing once all samples are rendered or rendering was stopped.
    pub fn next_pass(&mut self) -> PassOutcome {
        self.next_passes(1, &|| true)
    }

    /// Renders passes until `is_due`, called before each pass but the first and from any thread, returns true, all samples are rendered, or
    /// rendering is stopped. Without a time limit and a noise threshold, passes overlap: threads without work left in a pass continue with
    /// the next one.
    pub fn run_until(&mut self, is_due: impl Fn() -> bool + Sync) -> PassOutcome {
        // Checkpoints are resumed at the end of a block.
        let is_last = |own: &Rendering| own.finishes_passes && own.ends_within_block();
        while self.next_passes(MAX_AT_ONCE, &is_due) == PassOutcome::Progressed {
            if is_due() || is_last(self) {
                break;
            }
        }
        self.outcome
    }

    /// Renders passes until all samples are rendered or rendering is stopped.
    pub fn run(&mut self) -> PassOutcome {
        while self.run_until(|| false) == PassOutcome::Progressed {}
        self.outcome
    }

    /// Renders at most `max_passes` passes and measures the time.
    fn next_passes(&mut self, max_passes: usize, is_due: &(dyn Fn() -> bool + Sync)) -> PassOutcome {
        if self.outcome == PassOutcome::Progressed {
            let stopwatch = Stopwatch::start(self.spent);
            self.outcome = self.render_passes(max_passes, is_due, &stopwatch);
            self.spent = stopwatch.stop();
        }
        self.outcome
    }

    /// The film so far.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// The picture so far as in files: shadow catchers resolved, composited over the backdrop.
    pub fn shown(&self) -> Cow<'_, Film> {
        if self.backdrop.is_none() && !self.options.catchers {
            return Cow::Borrowed(&self.film);
        }
        let mut film = self.film.clone();
        film.resolve_catchers(self.options.caught);
        self.backdrop.iter().for_each(|backdrop| film.composite_over(backdrop));
        Cow::Owned(film)
    }

    /// Writes the picture so far as an EXR or a PNG, by the extension. Returns warnings about values that the file can't represent.
    ///
    /// # Errors
    /// As for [`Picture::save`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<Vec<Warning>> {
        picture::save(&self.shown(), path.as_ref(), &self.output_options())
    }

    /// [`Rendering::save`] with other options than [`Rendering::output_options`].
    ///
    /// # Errors
    /// As for [`Picture::save`].
    pub fn save_with(&self, path: impl AsRef<Path>, options: &OutputOptions) -> Result<Vec<Warning>> {
        picture::save(&self.shown(), path.as_ref(), options)
    }

    /// Ends rendering; returns the picture so far.
    pub fn into_picture(mut self) -> Picture {
        let (statistics, warnings) = (self.statistics(), self.warnings());
        let output = self.options_with(&warnings);
        self.film.resolve_catchers(self.options.caught);
        self.backdrop.iter().for_each(|backdrop| self.film.composite_over(backdrop));
        Picture { film: self.film, statistics, warnings, output }
    }

    /// Parts of the scene that were ignored, approximated or repaired so far.
    pub fn warnings(&self) -> Vec<Warning> {
        // Only a stopped pass leaves pixels without samples.
        let has_stopped = self.outcome != PassOutcome::Progressed;
        let mut warnings = self.scene_warnings.clone();
        warnings.extend(self.techniques.warnings(&self.target()));
        warnings.extend(sample_warnings(&self.film, has_stopped));
        warnings.extend(self.scene.textures.on_demand().warnings);
        warnings
    }

    /// Number of samples per pixel, unless rendering is stopped before.
    pub fn samples(&self) -> u32 {
        self.options.samples
    }

    /// Are all samples rendered, or is the noise threshold reached?
    pub fn is_complete(&self) -> bool {
        matches!(self.outcome, PassOutcome::Done | PassOutcome::Converged)
    }

    /// Time, samples and rays so far.
    pub fn statistics(&self) -> Statistics {
        let samples = self.progress.samples();
        let pixels = f64::from(self.film.width()) * f64::from(self.film.height());
        let on_demand = self.scene.textures.on_demand();
        let mut statistics = Statistics {
            render_s: self.spent.wall.as_secs_f64(),
            render_cpu_s: self.spent.cpu.as_secs_f64(),
            rays: self.progress.rays(),
            samples,
            samples_per_pixel: samples as f64 / pixels,
            images_on_demand: on_demand.decodes,
            tiles_on_demand: on_demand.tiles,
            invalid_samples: self.film.invalid_samples(),
            interrupted: self.outcome == PassOutcome::Cancelled,
            timed_out: self.outcome == PassOutcome::TimedOut,
            error: self.error_estimate.as_ref().and_then(ErrorEstimate::error),
            ..Statistics::default()
        };
        self.techniques.report(&mut statistics);
        statistics
    }

    /// Rare bright paths, with a noise threshold: the error estimate misses those that no sample has found.
    pub fn rare_paths(&self) -> Option<RarePaths> {
        let noise = &self.error_estimate.as_ref()?.noise;
        noise.rare_paths(&self.film.means(), self.film.width() as usize)
    }

    /// The options of [`Rendering::save`] for the picture so far.
    pub fn output_options(&self) -> OutputOptions {
        self.options_with(&self.warnings())
    }

    pub(super) fn options_with(&self, warnings: &[Warning]) -> OutputOptions {
        let statistics = self.statistics();
        let stopped_by = match statistics {
            Statistics { interrupted: true, .. } => Some("cancelled"),
            Statistics { timed_out: true, .. } => Some("time limit"),
            _ => None,
        };
        let metadata = Metadata {
            samples: statistics.samples_per_pixel,
            seed: self.options.seed,
            owner: None,
            render_s: Some(statistics.render_s),
            captured: Some(SystemTime::now()),
            world_to_camera: Some(self.view.camera_from_world),
            world_to_ndc: self.view.ndc_from_world,
            pixel_aspect: Some(self.view.pixel_aspect),
            aov_space: self.options.aov_space,
            denoised: self.denoised.clone(),
            mattes: self.labels.mattes.clone(),
            world_offset: Some(self.world_offset).filter(|o| *o != DVec3::ZERO),
            stopped_by: stopped_by.map(str::to_string),
            warnings: warnings.iter().map(Warning::to_string).collect(),
        };
        OutputOptions {
            png: PngOptions {
                exposure: self.display.exposure,
                view: self.display.view.clone(),
                white_balance: self.display.white_balance,
                opaque: !has_visible_alpha(&self.scene, &self.options),
                ..PngOptions::default()
            },
            metadata,
            ..OutputOptions::default()
        }
    }

    /// Denoises the picture so far, and its light passes and light groups, which still sum to it. The AOVs of `denoising_guides` and separate
    /// halves ([`Renderer::halves`](super::Renderer::halves)) should be recorded. Alpha is unchanged. Removes guide AOVs that are not in
    /// `keep`.
    pub fn denoise(&mut self, keep: AovSet) {
        self.denoised = Some(denoise_film_with(&mut self.film, keep, self.denoised_color.take()));
    }
}

// Passes: trials before them, their overlap, and updates after them.

impl Rendering {
    /// Renders at most `max_passes` passes; begins no further pass once `is_due` returns true.
    pub(super) fn render_passes(
        &mut self,
        max_passes: usize,
        is_due: &(dyn Fn() -> bool + Sync),
        stopwatch: &Stopwatch,
    ) -> PassOutcome {
        if self.has_converged() {
            return PassOutcome::Converged;
        }
        if !self.try_techniques(stopwatch) || !self.try_in_pass(stopwatch) {
            return PassOutcome::Cancelled;
        }
        let passes = self.plan_passes(max_passes, stopwatch);
        let Some(first) = passes.first() else {
            return if self.schedule.is_complete() { PassOutcome::Done } else { PassOutcome::TimedOut };
        };
        let start = Instant::now();
        self.denoised_color = None;
        let (begun, is_finished) = self.trace(&passes, Scope::All, is_due, stopwatch);
        if let Some(next) = passes.get(begun) {
            self.schedule.go_back_to(next.first_sample);
        }
        if begun == 1 {
            self.schedule.finished(*first, start.elapsed());
        }
        if is_finished && !self.observe_error(stopwatch) {
            return PassOutcome::Cancelled;
        }
        let is_cancelled = self.cancel.is_cancelled();
        match is_finished {
            true if self.schedule.is_complete() => PassOutcome::Done,
            true if self.has_converged() => PassOutcome::Converged,
            true if !(self.finishes_passes && is_cancelled) => PassOutcome::Progressed,
            _ if is_cancelled => PassOutcome::Cancelled,
            _ => PassOutcome::TimedOut,
        }
    }

    /// The next passes: several if passes may overlap and trials are finished.
    fn plan_passes(&mut self, max_passes: usize, stopwatch: &Stopwatch) -> Vec<Pass> {
        let overlap = self.options.time_limit.is_none()
            && self.error_estimate.is_none()
            && !self.techniques.separate_passes()
            && self.schedule.next_sample() >= SAMPLE_BLOCK;
        let max_passes = if overlap { max_passes } else { 1 };
        let mut passes = Vec::new();
        while passes.len() < max_passes {
            // Checkpoints are resumed at the end of a block.
            if !passes.is_empty() && self.finishes_passes && self.ends_within_block() {
                break;
            }
            let Some(pass) = self.schedule.next(stopwatch.wall()) else { break };
            passes.push(pass);
        }
        passes
    }

    /// Scene, view and options, for techniques.
    pub(super) fn target(&self) -> Target<'_> {
        Target { scene: &self.scene, view: &self.view, options: &self.options }
    }

    /// Runs the trials before the first pass. False if stopped.
    fn try_techniques(&mut self, stopwatch: &Stopwatch) -> bool {
        if self.schedule.is_complete() {
            return true;
        }
        let mattes = MatteIds::default();
        let trial = Trial {
            // Not `self.target()`, since `self.techniques` is borrowed mutably.
            target: Target { scene: &self.scene, view: &self.view, options: &self.options },
            paths: radiance_only_options(&self.options, &self.filter, &mattes),
            progress: &self.progress,
            listener: self.listener.as_deref(),
            stopwatch,
            // The time limit doesn't stop trials before the first pass.
            stop: &|| self.cancel.is_cancelled(),
        };
        self.techniques.prepare(&trial).is_ok()
    }

    /// Updates the error estimate and the expected number of samples. False if stopped.
    fn observe_error(&mut self, stopwatch: &Stopwatch) -> bool {
        let Some(mut estimate) = self.error_estimate.take() else { return true };
        parallel_task("noise", || estimate.noise.observe(&self.film, self.schedule.next_sample()));
        let is_done = estimate.validation.as_mut().is_none_or(|v| self.validate(v, stopwatch));
        self.expect_samples(&estimate);
        self.error_estimate = Some(estimate);
        is_done
    }

    /// Measures the error of the denoised picture, if that is due. False if stopped.
    fn validate(&mut self, validation: &mut Validation, stopwatch: &Stopwatch) -> bool {
        let samples = self.schedule.next_sample();
        if !validation.is_due(samples, self.schedule.is_complete()) {
            return true;
        }
        let is_done = self.render_validation(validation, samples, stopwatch);
        if is_done {
            let color = parallel_task("denoise", || denoised_color(&self.film));
            let wanted = f64::from(self.options.noise.unwrap_or_default());
            validation.measure(slices(&color), self.options.pixels(), samples, wanted * wanted);
            self.denoised_color = Some(color);
        }
        is_done
    }

    /// Renders both reference pictures of the validation until a number of samples per pixel. False if stopped.
    fn render_validation(&self, validation: &mut Validation, samples: u32, stopwatch: &Stopwatch) -> bool {
        let mattes = MatteIds::default();
        let last = Pass { first_sample: samples.saturating_sub(1), samples: 1 };
        let render = |(number, options): (usize, &RenderOptions)| {
            let mut paths = IntegratorOptions {
                catchers: options.catchers,
                transparent_glass: options.transparent_glass,
                ..radiance_only_options(options, &self.filter, &mattes)
            };
            self.techniques.configure(&mut paths);
            self.techniques.configure_pass(last, options, &mut paths);
            let trial = Trial {
                target: Target { scene: &self.scene, view: &self.view, options },
                paths: IntegratorOptions { reuse: None, ..paths },
                progress: &self.progress,
                listener: self.listener.as_deref(),
                stopwatch,
                stop: &|| self.cancel.is_cancelled(),
            };
            validation.render(number, samples, &trial).is_ok()
        };
        Validation::options(&self.options).iter().enumerate().all(render)
    }

    /// Reports the predicted number of samples for the noise threshold to the progress.
    fn expect_samples(&self, estimate: &ErrorEstimate) {
        let wanted = f64::from(self.options.noise.unwrap_or_default());
        let (least, range) = (self.options.min_samples, self.options.samples_to_render());
        if let Some((error, samples)) = estimate.error().zip(estimate.samples_for(wanted, least, range)) {
            let pixels = u64::from(self.film.width()) * u64::from(self.film.height());
            self.progress.expect(pixels * u64::from(samples), error);
        }
    }

    /// Is the estimated error below the noise threshold?
    fn has_converged(&self) -> bool {
        if self.schedule.next_sample() < self.options.min_samples {
            return false;
        }
        let error = self.error_estimate.as_ref().and_then(ErrorEstimate::error);
        error.zip(self.options.noise).is_some_and(|(error, wanted)| error <= f64::from(wanted))
    }

    /// For a partial render of later samples: runs the trials of the picture's first pass beforehand. False if stopped.
    fn try_in_pass(&mut self, stopwatch: &Stopwatch) -> bool {
        let first = self.options.samples_to_render().start;
        if first == 0 || self.schedule.next_sample() > first || !self.techniques.have_pending_trials() {
            return true;
        }
        let Some(pass) = Schedule::new(0..self.options.samples, None).next(stopwatch.wall()) else {
            return true;
        };
        self.trace(&[pass], Scope::TrialsOnly, &|| false, stopwatch).1
    }

    /// Renders consecutive passes; begins no further pass once `is_due` returns true. Returns the number of passes begun, and false if
    /// stopped.
    fn trace(
        &mut self,
        passes: &[Pass],
        scope: Scope,
        is_due: &(dyn Fn() -> bool + Sync),
        stopwatch: &Stopwatch,
    ) -> (usize, bool) {
        let layout = self.film.layout().clone();
        // Trials only: the samples are discarded.
        let mut film = Film::empty(&layout);
        if scope == Scope::All {
            std::mem::swap(&mut film, &mut self.film);
        }
        let film = film.into_shared();
        let stop = || {
            let is_over = || self.cancel.is_cancelled() || self.schedule.is_late(stopwatch.wall());
            !self.finishes_passes && is_over()
        };
        let work = |(number, &pass): (usize, &Pass)| PassContext {
            target: self.target(),
            labels: &self.labels,
            filter: &self.filter,
            pass,
            number,
            layout: &layout,
            film: &film,
            techniques: &self.techniques,
            progress: &self.progress,
            listener: self.listener.as_deref(),
            stopwatch,
            stop: &stop,
        };
        let contexts: Vec<PassContext<'_>> = passes.iter().enumerate().map(work).collect();
        let is_due = || is_due() || self.cancel.is_cancelled();
        let result = match scope {
            Scope::All => render_all(&contexts, &is_due),
            Scope::TrialsOnly => (1, self.techniques.try_in_pass(&contexts[0]).is_some()),
        };
        drop(contexts);
        let film = film.into_film();
        if scope == Scope::All {
            self.film = film;
        }
        result
    }
}

/// The samples of a pass that are rendered.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Scope {
    All,
    /// The trials only, whose samples are discarded.
    TrialsOnly,
}
