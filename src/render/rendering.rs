//! Rendering pass by pass, with a picture after each pass, or several passes at a time.

use super::noise::{Noise, RarePaths};
use super::options::{DisplaySettings, RenderOptions};
use super::pass::{PassWork, take_all};
use super::picture;
use super::picture::{Labels, Picture, denoise_film, layout, of_film, shows_alpha};
use super::progress::{
    CancelHandle, Event, Listener, PassOutcome, Progress, Spent, Statistics, Stopwatch, divided,
};
use super::schedule::{Pass, SAMPLE_BLOCK, Schedule};
use super::technique::{Target, Trial, plain_paths};
use super::techniques::Techniques;
use crate::compile::{CompiledScene, View};
use crate::error::{Result, Warning};
use crate::film::{AovSet, Film, FilterSampler, MatteIds};
use crate::math::DVec3;
use crate::output::{Metadata, OutputOptions, PngOptions};
use crate::scene::{Backdrop, Camera};
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

/// Renders a scene, pass by pass, on the current rayon pool (see [`in_pool`](super::in_pool)).
///
/// Between passes the film is a picture of the samples so far. With a time limit, passes are planned so that all pixels
/// have the same number of samples; where a pass takes longer than it should, and when rendering is cancelled, the film
/// has the tiles that were finished until then: pixels may differ in their number of samples, by one pass after
/// [`Rendering::next_pass`] and by a few after [`Rendering::run`]. No sample is chosen by its value, so such a picture has the
/// same mean.
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
    /// Warnings from before the first pass.
    earlier: Vec<Warning>,
    pub(super) display: DisplaySettings,
    /// Composited behind the picture.
    backdrop: Option<Backdrop>,
    /// Offset of the origin of the scene's coordinates in the world, metres.
    pub(super) world_offset: DVec3,
    /// Name of the denoiser, if the film was denoised.
    pub(super) denoised: Option<String>,
    pub(super) techniques: Techniques,
    /// Passes are finished even when it is cancelled or late.
    pub(super) finishes_passes: bool,
    /// Estimate of the error, where rendering stops by it.
    pub(super) noise: Option<Noise>,
}

/// Maximum number of passes that overlap.
const MAX_AT_ONCE: usize = 64;

impl Rendering {
    /// The picture of a compiled scene by one of its description's cameras, with no sample yet. Scenes may be shared by
    /// `Arc`.
    ///
    /// # Errors
    /// A usage error if there is no memory for the film. Once that is there, rendering can't fail.
    #[doc(hidden)]
    pub fn new(
        scene: impl Into<Arc<CompiledScene>>,
        camera: &Camera,
        options: RenderOptions,
    ) -> Result<Rendering> {
        Rendering::labelled(scene, Labels::default(), camera, options)
    }

    /// A rendering with the names that files show, [`Labels::of`] the scene. Without, mattes show nothing, and there are no groups of
    /// lights.
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
        let samples = options.taken();
        Ok(Rendering {
            techniques: Techniques::new(&Target { scene: &scene, view: &view, options: &options }),
            scene,
            view,
            labels,
            filter: FilterSampler::new(options.filter),
            film,
            progress: Progress::new(pixels * samples.len() as u64),
            schedule: Schedule::new(samples, options.time_limit),
            spent: stopwatch.stop(),
            outcome: PassOutcome::Progressed,
            cancel: CancelHandle::new(),
            listener: None,
            earlier: Vec::new(),
            display: DisplaySettings::default(),
            backdrop: None,
            world_offset: DVec3::ZERO,
            denoised: None,
            finishes_passes: false,
            noise: options.noise.map(|_| Noise::default()),
            options,
        })
    }

    /// A rendering of the compiled scene of a [`Renderer`](super::Renderer).
    pub(super) fn with(
        self,
        earlier: Vec<Warning>,
        display: DisplaySettings,
        cancel: CancelHandle,
        listener: Option<Box<Listener>>,
    ) -> Rendering {
        Rendering { earlier, display, cancel, listener, ..self }
    }

    /// Lays a backdrop behind its pictures where they are transparent, and says in headers how far from the world's origin
    /// the scene's coordinates have theirs.
    #[must_use]
    pub fn placed(self, backdrop: Option<Backdrop>, world_offset: DVec3) -> Rendering {
        Rendering { backdrop, world_offset, ..self }
    }

    /// Lets an existing handle stop it, in place of its own.
    #[must_use]
    pub fn with_cancel_handle(self, cancel: CancelHandle) -> Rendering {
        Rendering { cancel, ..self }
    }

    /// Calls `listener` with the progress several times per second, from any thread, in place of an earlier listener.
    #[must_use]
    pub fn on_event(self, listener: impl Fn(Event) + Send + Sync + 'static) -> Rendering {
        Rendering { listener: Some(Box::new(listener)), ..self }
    }

    /// A handle that stops it from any thread.
    pub fn cancel_handle(&self) -> CancelHandle {
        self.cancel.clone()
    }

    /// Renders the next samples of all pixels, at most eight per pixel. Does nothing once all samples are rendered or it was stopped.
    pub fn next_pass(&mut self) -> PassOutcome {
        self.next_passes(1, &|| true)
    }

    /// Takes passes until `is_due` says that the picture is to be looked at, which is asked before each but the first, from any thread;
    /// until all samples are taken, or it is stopped. Without a time limit and a noise that is asked for, threads that have nothing left
    /// to do in a pass continue with the next one: what few passes at a time cost on many threads is saved.
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

    /// Renders passes until all samples are rendered or it is stopped.
    pub fn run(&mut self) -> PassOutcome {
        while self.run_until(|| false) == PassOutcome::Progressed {}
        self.outcome
    }

    /// Renders at most this many passes.
    fn next_passes(&mut self, most: usize, is_due: &(dyn Fn() -> bool + Sync)) -> PassOutcome {
        if self.outcome == PassOutcome::Progressed {
            let stopwatch = Stopwatch::start(self.spent);
            self.outcome = self.take_passes(most, is_due, &stopwatch);
            self.spent = stopwatch.stop();
        }
        self.outcome
    }

    /// The samples so far.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// The picture so far, composited over its background, as in files.
    pub fn shown(&self) -> Cow<'_, Film> {
        if self.backdrop.is_none() && !self.options.catchers {
            return Cow::Borrowed(&self.film);
        }
        let mut film = self.film.clone();
        film.resolve_catchers(self.options.caught);
        self.backdrop.iter().for_each(|backdrop| film.composite_over(backdrop));
        Cow::Owned(film)
    }

    /// Writes the picture so far as an EXR or a PNG, by the extension. Returns warnings about values that the file
    /// can't hold.
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

    /// Ends rendering with the picture as it is now.
    pub fn into_picture(mut self) -> Picture {
        let (statistics, warnings) = (self.statistics(), self.warnings());
        let output = self.options_with(&warnings);
        self.film.resolve_catchers(self.options.caught);
        self.backdrop.iter().for_each(|backdrop| self.film.composite_over(backdrop));
        Picture { film: self.film, statistics, warnings, output }
    }

    /// Parts of the scene that were ignored, approximated or repaired so far.
    pub fn warnings(&self) -> Vec<Warning> {
        // Between passes all pixels have the same number.
        let has_stopped = self.outcome != PassOutcome::Progressed;
        let mut warnings = self.earlier.clone();
        warnings.extend(self.techniques.warnings(&self.target()));
        warnings.extend(of_film(&self.film, has_stopped));
        warnings.extend(self.scene.textures.on_demand().warnings);
        warnings
    }

    /// How many samples each pixel is to have, unless a time limit ends it before.
    pub fn samples(&self) -> u32 {
        self.options.samples
    }

    /// Are all samples there, or as many as the noise asked for?
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
            error: self.noise.as_ref().and_then(Noise::error),
            ..Statistics::default()
        };
        self.techniques.report(&mut statistics);
        statistics
    }

    /// Light of single bright paths, where the noise is estimated: the estimate can't know of more of them.
    pub fn rare_paths(&self) -> Option<RarePaths> {
        self.noise.as_ref()?.rare_paths(&self.film.means(), self.film.width() as usize)
    }

    /// How [`Rendering::save`] writes the picture so far.
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
                opaque: !shows_alpha(&self.scene, &self.options),
                ..PngOptions::default()
            },
            metadata,
            ..OutputOptions::default()
        }
    }

    /// Denoises the picture so far, its light passes and groups of lights, which add up to it afterwards as before. It should
    /// have what `denoising_guides` names, and the halves of its samples apart
    /// ([`Renderer::halves`](super::Renderer::halves)). Alpha stays. AOVs that are not in `keep` are left out afterwards.
    pub fn denoise(&mut self, keep: AovSet) {
        self.denoised = Some(denoise_film(&mut self.film, keep));
    }
}

// Passes: decisions before them, their overlap, and updates after them.

impl Rendering {
    /// Renders at most this many passes, until `is_due` asks to begin no more.
    pub(super) fn take_passes(
        &mut self,
        most: usize,
        is_due: &(dyn Fn() -> bool + Sync),
        stopwatch: &Stopwatch,
    ) -> PassOutcome {
        if self.has_converged() {
            return PassOutcome::Converged;
        }
        if !self.try_techniques(stopwatch) || !self.try_in_pass(stopwatch) {
            return PassOutcome::Cancelled;
        }
        let passes = self.plan_passes(most, stopwatch);
        let Some(first) = passes.first() else {
            return if self.schedule.is_complete() { PassOutcome::Done } else { PassOutcome::TimedOut };
        };
        let start = Instant::now();
        let (begun, is_finished) = self.trace(&passes, Takes::All, is_due, stopwatch);
        if let Some(next) = passes.get(begun) {
            self.schedule.go_back_to(next.first_sample);
        }
        if begun == 1 {
            self.schedule.finished(*first, start.elapsed());
        }
        if is_finished && let Some(noise) = &mut self.noise {
            divided("noise", || noise.observe(&self.film, self.schedule.next_sample()));
            self.forecast();
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

    /// The next passes: several where they may overlap and trials are done.
    fn plan_passes(&mut self, most: usize, stopwatch: &Stopwatch) -> Vec<Pass> {
        let overlap = self.options.time_limit.is_none()
            && self.noise.is_none()
            && !self.techniques.separate_passes()
            && self.schedule.next_sample() >= SAMPLE_BLOCK;
        let most = if overlap { most } else { 1 };
        let mut passes = Vec::new();
        while passes.len() < most {
            // Checkpoints are resumed at the end of a block.
            if !passes.is_empty() && self.finishes_passes && self.ends_within_block() {
                break;
            }
            let Some(pass) = self.schedule.next(stopwatch.wall()) else { break };
            passes.push(pass);
        }
        passes
    }

    /// The picture, for techniques.
    pub(super) fn target(&self) -> Target<'_> {
        Target { scene: &self.scene, view: &self.view, options: &self.options }
    }

    /// Runs the trials before the first pass. False if they were stopped.
    fn try_techniques(&mut self, stopwatch: &Stopwatch) -> bool {
        if self.schedule.is_complete() {
            return true;
        }
        let mattes = MatteIds::default();
        let trial = Trial {
            // Not by a method: the techniques are borrowed mutably.
            target: Target { scene: &self.scene, view: &self.view, options: &self.options },
            paths: plain_paths(&self.options, &self.filter, &mattes),
            progress: &self.progress,
            listener: self.listener.as_deref(),
            stopwatch,
            // The picture loses nothing by that.
            stop: &|| self.cancel.is_cancelled(),
        };
        self.techniques.prepare(&trial).is_ok()
    }

    /// Predicts the number of samples for the requested error.
    fn forecast(&self) {
        let Some((noise, wanted)) = self.noise.as_ref().zip(self.options.noise) else { return };
        let (least, taken) = (self.options.least_samples, self.options.taken());
        if let Some((error, samples)) = noise.error().zip(noise.samples_for(f64::from(wanted), least, taken))
        {
            let pixels = u64::from(self.film.width()) * u64::from(self.film.height());
            self.progress.expect(pixels * u64::from(samples), error);
        }
    }

    /// Has the error reached the requested one?
    fn has_converged(&self) -> bool {
        if self.schedule.next_sample() < self.options.least_samples {
            return false;
        }
        let error = self.noise.as_ref().and_then(Noise::error);
        error.zip(self.options.noise).is_some_and(|(error, wanted)| error <= f64::from(wanted))
    }

    /// Runs the trials of the picture's first pass for a partial render of later samples, before its first pass. False if it was stopped.
    fn try_in_pass(&mut self, stopwatch: &Stopwatch) -> bool {
        let first = self.options.taken().start;
        if first == 0 || self.schedule.next_sample() > first || !self.techniques.are_open() {
            return true;
        }
        let Some(pass) = Schedule::new(0..self.options.samples, None).next(stopwatch.wall()) else {
            return true;
        };
        self.trace(&[pass], Takes::TrialsOnly, &|| false, stopwatch).1
    }

    /// Renders consecutive passes until `is_due` asks to begin no more. Returns how many were begun, and false if it was stopped.
    fn trace(
        &mut self,
        passes: &[Pass],
        takes: Takes,
        is_due: &(dyn Fn() -> bool + Sync),
        stopwatch: &Stopwatch,
    ) -> (usize, bool) {
        let layout = self.film.layout().clone();
        // Trials alone have no film.
        let mut film = Film::empty(&layout);
        if takes == Takes::All {
            std::mem::swap(&mut film, &mut self.film);
        }
        let film = film.into_shared();
        let stop = || {
            let is_over = || self.cancel.is_cancelled() || self.schedule.is_late(stopwatch.wall());
            !self.finishes_passes && is_over()
        };
        let work = |(number, &pass): (usize, &Pass)| PassWork {
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
        let works: Vec<PassWork<'_>> = passes.iter().enumerate().map(work).collect();
        let is_due = || is_due() || self.cancel.is_cancelled();
        let taken = match takes {
            Takes::All => take_all(&works, &is_due),
            Takes::TrialsOnly => (1, self.techniques.try_in_pass(&works[0]).is_some()),
        };
        drop(works);
        let film = film.into_film();
        if takes == Takes::All {
            self.film = film;
        }
        taken
    }
}

/// Which samples of a pass are rendered.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Takes {
    All,
    /// The trials; the picture gets no samples of them.
    TrialsOnly,
}
