//! Rendering: takes one pass at a time, and has a picture after each.

use super::cancel::CancelHandle;
use super::clock::{Spent, Stopwatch};
use super::options::{PathReuse, RenderOptions};
use super::picture::{self, Picture};
use super::pilot;
use super::progress::{Event, Listener, Progress};
use super::schedule::Schedule;
use super::statistics::{PassOutcome, Statistics};
use super::work::PassWork;
use crate::compile::{CompiledScene, View};
use crate::error::{Result, Warning};
use crate::film::{Film, FilterSampler};
use crate::integrator::PathOptions;
use crate::integrator::reuse::GroupShape;
use crate::output::{Metadata, OutputOptions, PngOptions};
use crate::sampling::Arrangement;
use crate::scene::Camera;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Instant, SystemTime};

/// Renders a scene, pass by pass, on the current rayon pool (see [`in_pool`](super::in_pool)).
///
/// Between passes the film is a picture of the samples so far. With a time limit, passes are planned so that all pixels
/// have the same number of samples; where a pass takes longer than it should, and when rendering is cancelled, the film
/// has the tiles that were finished until then: pixels may differ in their number of samples by one pass. No sample is
/// chosen by its value, so such a picture has the same mean.
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
    scene: Arc<CompiledScene>,
    view: View,
    options: RenderOptions,
    filter: FilterSampler,
    film: Film,
    schedule: Schedule,
    progress: Progress,
    spent: Spent,
    outcome: PassOutcome,
    cancel: CancelHandle,
    listener: Option<Box<Listener>>,
    /// What came up before the first pass.
    earlier: Vec<Warning>,
    exposure: f32,
    sharing: Sharing,
}

/// In which groups pixels share paths, if they do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sharing {
    /// A pass with enough samples will tell.
    Undecided,
    Decided(Option<GroupShape>),
}

/// Are there surfaces that some paths pass, by chance?
fn has_random_surfaces(scene: &CompiledScene) -> bool {
    scene.materials.iter().any(|material| material.alpha.is_some() || material.passes_straight)
}

impl Sharing {
    fn new(scene: &CompiledScene, options: &RenderOptions) -> Sharing {
        // Surfaces that are absent at random let visibility be known at random only.
        let is_possible = !has_random_surfaces(scene) && options.max_depth >= 2;
        match options.path_reuse {
            PathReuse::Auto if is_possible => Sharing::Undecided,
            PathReuse::Groups(shape) if is_possible => Sharing::Decided(Some(shape)),
            _ => Sharing::Decided(None),
        }
    }

    fn shape(self) -> Option<GroupShape> {
        match self {
            Sharing::Undecided => None,
            Sharing::Decided(shape) => shape,
        }
    }
}

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
        let film = Film::try_new(options.width, options.height, options.aovs.channels())?;
        let scene = scene.into();
        let view = View::new(&scene, camera, options.width, options.height);
        let stopwatch = Stopwatch::start(Spent::default());
        let pixels = u64::from(view.width) * u64::from(view.height);
        Ok(Rendering {
            sharing: Sharing::new(&scene, &options),
            scene,
            view,
            filter: FilterSampler::new(options.filter),
            film,
            schedule: Schedule::new(options.samples, options.time_limit),
            progress: Progress::new(pixels * u64::from(options.samples)),
            spent: stopwatch.stop(),
            outcome: PassOutcome::Progressed,
            cancel: CancelHandle::new(),
            listener: None,
            earlier: Vec::new(),
            exposure: 0.0,
            options,
        })
    }

    /// The same with what a [`Renderer`](super::Renderer) knows.
    pub(super) fn with(
        self,
        earlier: Vec<Warning>,
        exposure: f32,
        cancel: CancelHandle,
        listener: Option<Box<Listener>>,
    ) -> Rendering {
        Rendering { earlier, exposure, cancel, listener, ..self }
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
        if self.outcome == PassOutcome::Progressed {
            let stopwatch = Stopwatch::start(self.spent);
            self.outcome = self.take_pass(&stopwatch);
            self.spent = stopwatch.stop();
        }
        self.outcome
    }

    /// Takes passes until all samples are taken or it is stopped.
    pub fn run(&mut self) -> PassOutcome {
        while self.next_pass() == PassOutcome::Progressed {}
        self.outcome
    }

    /// The samples so far.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// Writes the picture so far as an EXR or a PNG, by the extension. Returns warnings about values that the file
    /// can't hold.
    ///
    /// # Errors
    /// As for [`Picture::save`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<Vec<Warning>> {
        picture::save(&self.film, path.as_ref(), &self.output_options())
    }

    /// The same with other options than [`Rendering::output_options`].
    ///
    /// # Errors
    /// As for [`Picture::save`].
    pub fn save_with(&self, path: impl AsRef<Path>, options: &OutputOptions) -> Result<Vec<Warning>> {
        picture::save(&self.film, path.as_ref(), options)
    }

    /// Ends rendering with the picture as it is now.
    pub fn into_picture(self) -> Picture {
        let (statistics, warnings) = (self.statistics(), self.warnings());
        let output = self.options_with(&warnings);
        Picture { film: self.film, statistics, warnings, output }
    }

    /// What was ignored, approximated or repaired on the way from the file to the picture so far.
    pub fn warnings(&self) -> Vec<Warning> {
        let invalid = self.film.invalid_samples();
        // Between passes all pixels have the same number.
        let has_stopped = self.outcome != PassOutcome::Progressed;
        let unsampled = if has_stopped { self.film.unsampled_pixels() } else { 0 };
        let all = u64::from(self.film.width()) * u64::from(self.film.height());
        let mut warnings = self.earlier.clone();
        let mut warn = |count: u64, message: String| {
            if count > 0 {
                warnings.push(Warning::general(message));
            }
        };
        if let (PathReuse::Groups(_), Sharing::Decided(None)) = (self.options.path_reuse, self.sharing) {
            let reason = if has_random_surfaces(&self.scene) {
                "the scene has surfaces that are partly transparent"
            } else {
                "there is no indirect light with so few bounces"
            };
            warn(1, format!("paths are not shared between pixels: {reason}"));
        }
        warn(invalid, format!("{invalid} samples were NaN or infinite and were left out"));
        warn(unsampled, format!("{unsampled} of {all} pixels have no sample and are black and transparent"));
        warnings
    }

    /// How [`Rendering::save`] writes the picture so far.
    pub fn output_options(&self) -> OutputOptions {
        self.options_with(&self.warnings())
    }

    fn options_with(&self, warnings: &[Warning]) -> OutputOptions {
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
            world_offset: None,
            stopped_by: stopped_by.map(str::to_string),
            warnings: warnings.iter().map(Warning::to_string).collect(),
        };
        OutputOptions {
            png: PngOptions { exposure: self.exposure, ..PngOptions::default() },
            metadata,
            ..OutputOptions::default()
        }
    }

    /// Time, samples and rays so far.
    pub fn statistics(&self) -> Statistics {
        let samples = self.progress.samples();
        let pixels = f64::from(self.film.width()) * f64::from(self.film.height());
        Statistics {
            render_s: self.spent.wall.as_secs_f64(),
            render_cpu_s: self.spent.cpu.as_secs_f64(),
            rays: self.progress.rays(),
            samples,
            samples_per_pixel: samples as f64 / pixels,
            path_reuse: self.sharing.shape(),
            invalid_samples: self.film.invalid_samples(),
            interrupted: self.outcome == PassOutcome::Cancelled,
            timed_out: self.outcome == PassOutcome::TimedOut,
        }
    }

    fn take_pass(&mut self, stopwatch: &Stopwatch) -> PassOutcome {
        let Some(pass) = self.schedule.next(stopwatch.wall()) else {
            return if self.schedule.is_complete() { PassOutcome::Done } else { PassOutcome::TimedOut };
        };
        let start = Instant::now();
        let paths = PathOptions {
            max_depth: self.options.max_depth,
            arrangement: Arrangement::new(self.options.seed, self.options.samples),
            filter: &self.filter,
            aovs: self.options.aovs.of_first_hits(),
            soft_terminator: self.options.soft_terminator,
            reuse: None,
            keeps_unshared: false,
        };
        let layout = self.film.layout().clone();
        let work = PassWork {
            scene: &self.scene,
            view: &self.view,
            paths,
            pass,
            layout: &layout,
            film: Mutex::new(&mut self.film),
            progress: &self.progress,
            listener: self.listener.as_deref(),
            stopwatch,
            stop: &|| self.cancel.is_cancelled() || self.schedule.is_late(stopwatch.wall()),
        };
        let is_finished = match self.sharing {
            Sharing::Decided(shape) => work.run(shape, &[]),
            Sharing::Undecided => {
                let mut trials = pilot::trials(&self.view, pass);
                let best = work.try_all(&mut trials);
                if !trials.is_empty() {
                    self.sharing = Sharing::Decided(best.flatten());
                }
                best.is_some_and(|best| work.run(best, &trials))
            }
        };
        self.schedule.finished(pass, start.elapsed());
        match is_finished {
            true if self.schedule.is_complete() => PassOutcome::Done,
            true => PassOutcome::Progressed,
            false if self.cancel.is_cancelled() => PassOutcome::Cancelled,
            false => PassOutcome::TimedOut,
        }
    }
}
