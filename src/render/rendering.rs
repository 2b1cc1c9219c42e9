//! Rendering: takes one pass at a time and has a picture after each, or takes several without a pause.

use super::cancel::CancelHandle;
use super::caustics::{self, CausticChoice};
use super::clock::{Spent, Stopwatch};
use super::guiding::GuidingChoice;
use super::labels::Labels;
use super::layout::layout;
use super::noise::Noise;
use super::options::RenderOptions;
use super::picture::{self, Picture};
use super::progress::{Event, Listener, Progress};
use super::schedule::Schedule;
use super::settle::Look;
use super::statistics::{PassOutcome, Statistics};
use super::technique::Choice;
use super::warnings::of_film;
use crate::compile::{CompiledScene, View};
use crate::error::{Result, Warning};
use crate::film::{Film, FilterSampler};
use crate::integrator::CausticPlan;
use crate::math::DVec3;
use crate::output::OutputOptions;
use crate::sampling::Allotment;
use crate::scene::{Backdrop, Camera};
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

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
    /// What came up before the first pass.
    earlier: Vec<Warning>,
    pub(super) look: Look,
    /// What lies behind the picture.
    backdrop: Option<Backdrop>,
    /// How far from the world's origin the scene's coordinates have theirs.
    pub(super) world_offset: DVec3,
    /// How noise was taken out of the film, if it was.
    pub(super) denoised: Option<String>,
    pub(super) choice: Choice,
    /// Whether caustics are found from the lamp.
    pub(super) caustics: CausticChoice,
    /// What guides paths.
    pub(super) guiding: GuidingChoice,
    pub(super) allotment: Option<Allotment>,
    /// Passes are finished even when it is cancelled or late.
    pub(super) finishes_passes: bool,
    /// How noisy the picture is, where that is asked for.
    pub(super) noise: Option<Noise>,
}

/// Passes that are taken without a pause, at most.
const MOST_AT_ONCE: usize = 64;

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

    /// The same with the names that files show, [`Labels::of`] the scene. Without, mattes show nothing, and there are no groups of
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
        options.check_share()?;
        let region = options.pixels();
        let film = Film::of_layout(region.width(), region.height(), layout)?.at(region.x0, region.y0);
        let scene = scene.into();
        let view = View::new(&scene, camera, options.width, options.height);
        let stopwatch = Stopwatch::start(Spent::default());
        let pixels = u64::from(region.width()) * u64::from(region.height());
        let samples = options.taken();
        Ok(Rendering {
            choice: Choice::new(&scene, &options),
            caustics: CausticChoice::default(),
            guiding: GuidingChoice::default(),
            allotment: None,
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
            look: Look::default(),
            backdrop: None,
            world_offset: DVec3::ZERO,
            denoised: None,
            finishes_passes: false,
            noise: options.noise.map(|_| Noise::default()),
            options,
        })
    }

    /// The same with what a [`Renderer`](super::Renderer) knows.
    pub(super) fn with(
        self,
        earlier: Vec<Warning>,
        look: Look,
        cancel: CancelHandle,
        listener: Option<Box<Listener>>,
    ) -> Rendering {
        Rendering { earlier, look, cancel, listener, ..self }
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

    /// Calls `listener` with the progress several times a second, from any thread, in place of an earlier listener.
    #[must_use]
    pub fn on_event(self, listener: impl Fn(Event) + Send + Sync + 'static) -> Rendering {
        Rendering { listener: Some(Box::new(listener)), ..self }
    }

    /// A handle that stops it from any thread.
    pub fn cancel_handle(&self) -> CancelHandle {
        self.cancel.clone()
    }

    /// Takes the next samples of all pixels, at most eight per pixel. Does nothing once all are taken or it was stopped.
    pub fn next_pass(&mut self) -> PassOutcome {
        self.next_passes(1, &|| true)
    }

    /// Takes passes until `is_due` says that the picture is to be looked at, which is asked before each but the first, from any thread;
    /// until all samples are taken, or it is stopped. Without a time limit and a noise that is asked for, threads that have nothing left
    /// to do in a pass go on with the next one: what few passes at a time cost on many threads is saved.
    pub fn run_until(&mut self, is_due: impl Fn() -> bool + Sync) -> PassOutcome {
        // What is gone on from lies before a pass that ends within a block.
        let is_last = |own: &Rendering| own.finishes_passes && own.ends_within_block();
        while self.next_passes(MOST_AT_ONCE, &is_due) == PassOutcome::Progressed {
            if is_due() || is_last(self) {
                break;
            }
        }
        self.outcome
    }

    /// Takes passes until all samples are taken or it is stopped.
    pub fn run(&mut self) -> PassOutcome {
        while self.run_until(|| false) == PassOutcome::Progressed {}
        self.outcome
    }

    /// Takes so many passes at most.
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

    /// The picture so far, as files show it: with what lies behind it.
    pub fn shown(&self) -> Cow<'_, Film> {
        if self.backdrop.is_none() && !self.options.catchers {
            return Cow::Borrowed(&self.film);
        }
        let mut film = self.film.clone();
        film.settle_catchers(self.options.caught);
        self.backdrop.iter().for_each(|backdrop| film.lay_behind(backdrop));
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

    /// The same with other options than [`Rendering::output_options`].
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
        self.film.settle_catchers(self.options.caught);
        self.backdrop.iter().for_each(|backdrop| self.film.lay_behind(backdrop));
        Picture { film: self.film, statistics, warnings, output }
    }

    /// What was ignored, approximated or repaired on the way from the file to the picture so far.
    pub fn warnings(&self) -> Vec<Warning> {
        // Between passes all pixels have the same number.
        let has_stopped = self.outcome != PassOutcome::Progressed;
        let mut warnings = self.earlier.clone();
        warnings.extend(self.choice.warning(&self.scene, &self.options));
        warnings.extend(caustics::warning(&self.scene, &self.view, &self.options));
        warnings.extend(self.guiding.warning(&self.scene, &self.options));
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
        Statistics {
            render_s: self.spent.wall.as_secs_f64(),
            render_cpu_s: self.spent.cpu.as_secs_f64(),
            rays: self.progress.rays(),
            samples,
            samples_per_pixel: samples as f64 / pixels,
            path_reuse: self.choice.now.shape(),
            branches: self.choice.now.branches(),
            is_adaptive: self.allotment.is_some(),
            lamp_paths: self.caustics.plan().map(CausticPlan::paths),
            guide_cells: self.guiding.guide().map(|guide| guide.cells() as u32),
            images_on_demand: on_demand.decodes,
            tiles_on_demand: on_demand.tiles,
            invalid_samples: self.film.invalid_samples(),
            interrupted: self.outcome == PassOutcome::Cancelled,
            timed_out: self.outcome == PassOutcome::TimedOut,
            error: self.noise.as_ref().and_then(Noise::error),
        }
    }
}
