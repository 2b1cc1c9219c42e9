//! How a rendering takes passes: what is decided before them, which are taken without a pause, and what is made of them.

use super::adaptive::ErrorMap;
use super::clock::Stopwatch;
use super::guiding::Training;
use super::noise::Noise;
use super::rendering::Rendering;
use super::schedule::{Pass, Schedule};
use super::share::SAMPLE_BLOCK;
use super::statistics::PassOutcome;
use super::timeline;
use super::work::{PassWork, take_all, try_techniques};
use crate::film::{Film, MatteIds};
use std::time::Instant;

impl Rendering {
    /// Takes so many passes at most, until `is_due` asks to begin no more.
    pub(super) fn take_passes(
        &mut self,
        most: usize,
        is_due: &(dyn Fn() -> bool + Sync),
        stopwatch: &Stopwatch,
    ) -> PassOutcome {
        if self.has_converged() {
            return PassOutcome::Converged;
        }
        if !self.find_caustics() || !self.learn(stopwatch) || !self.choose_technique(stopwatch) {
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
            timeline::parallel("noise", || noise.observe(&self.film, self.schedule.next_sample()));
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

    /// The next passes, several where nothing has to look at the picture between them and nothing is tried any more.
    fn plan_passes(&mut self, most: usize, stopwatch: &Stopwatch) -> Vec<Pass> {
        let overlap = self.options.time_limit.is_none()
            && self.noise.is_none()
            && self.caustics.plan().is_none()
            && self.schedule.next_sample() >= SAMPLE_BLOCK;
        let most = if overlap { most } else { 1 };
        let mut passes = Vec::new();
        while passes.len() < most {
            // What is gone on from lies before a pass that ends within a block.
            if !passes.is_empty() && self.finishes_passes && self.ends_within_block() {
                break;
            }
            let Some(pass) = self.schedule.next(stopwatch.wall()) else { break };
            passes.push(pass);
        }
        passes
    }

    /// Decides whether caustics are found from the lamp. False if it was stopped.
    fn find_caustics(&mut self) -> bool {
        let stop = || self.cancel.is_cancelled();
        self.caustics.decide(&self.scene, &self.view, &self.options, &self.filter, &stop)
    }

    /// Tells how many samples the error that was asked for is likely to take.
    fn forecast(&self) {
        let Some((noise, wanted)) = self.noise.as_ref().zip(self.options.noise) else { return };
        let (least, taken) = (self.options.least_samples, self.options.taken());
        if let Some((error, samples)) = noise.error().zip(noise.samples_for(f64::from(wanted), least, taken))
        {
            let pixels = u64::from(self.film.width()) * u64::from(self.film.height());
            self.progress.expect(pixels * u64::from(samples), error);
        }
    }

    /// Is the picture as good as it was to be?
    fn has_converged(&self) -> bool {
        if self.schedule.next_sample() < self.options.least_samples {
            return false;
        }
        let error = self.noise.as_ref().and_then(Noise::error);
        error.zip(self.options.noise).is_some_and(|(error, wanted)| error <= f64::from(wanted))
    }

    /// Lets some paths train a guide, if that is asked for. False if it was stopped.
    fn learn(&mut self, stopwatch: &Stopwatch) -> bool {
        if self.schedule.is_complete() {
            return true;
        }
        let training = Training {
            scene: &self.scene,
            view: &self.view,
            options: &self.options,
            filter: &self.filter,
            caustics: self.caustics.plan(),
            mattes: MatteIds::default(),
            progress: &self.progress,
            listener: self.listener.as_deref(),
            stopwatch,
            // Nothing of a picture is lost by that.
            stop: &|| self.cancel.is_cancelled(),
        };
        self.guiding.decide(&training)
    }

    /// Decides by what the picture's first pass would show how to trace samples that come later, if none of these has been
    /// taken. False if it was stopped.
    fn choose_technique(&mut self, stopwatch: &Stopwatch) -> bool {
        let first = self.options.taken().start;
        if first == 0 || self.schedule.next_sample() > first || !self.choice.is_open() {
            return true;
        }
        let Some(pass) = Schedule::new(0..self.options.samples, None).next(stopwatch.wall()) else {
            return true;
        };
        self.trace(&[pass], Takes::TrialsOnly, &|| false, stopwatch).1
    }

    /// Takes passes that follow each other, until `is_due` asks to begin no more. How many were begun, and false if it was stopped.
    fn trace(
        &mut self,
        passes: &[Pass],
        takes: Takes,
        is_due: &(dyn Fn() -> bool + Sync),
        stopwatch: &Stopwatch,
    ) -> (usize, bool) {
        let layout = self.film.layout().clone();
        // Samples that only decide on a technique go nowhere.
        let mut film = Film::nowhere(&layout);
        if takes == Takes::All {
            std::mem::swap(&mut film, &mut self.film);
        }
        let film = film.into_shared();
        let stop = || {
            let is_over = || self.cancel.is_cancelled() || self.schedule.is_late(stopwatch.wall());
            !self.finishes_passes && is_over()
        };
        let work = |(number, &pass): (usize, &Pass)| PassWork {
            scene: &self.scene,
            view: &self.view,
            options: &self.options,
            labels: &self.labels,
            filter: &self.filter,
            pass,
            number,
            layout: &layout,
            film: &film,
            caustics: self.caustics.plan(),
            guide: self.guiding.guide(),
            allotment: self.allotment.as_ref(),
            progress: &self.progress,
            listener: self.listener.as_deref(),
            stopwatch,
            stop: &stop,
        };
        let works: Vec<PassWork<'_>> = passes.iter().enumerate().map(work).collect();
        let (mut choice, pass) = (self.choice, passes[0]);
        let mut errors = ErrorMap::wanted(&self.options, choice, pass);
        let is_due = || is_due() || self.cancel.is_cancelled();
        let taken = match takes {
            Takes::All => take_all(&works, &mut choice, &mut errors, &is_due),
            Takes::TrialsOnly => (1, try_techniques(&works[0], &mut choice, &mut errors).is_some()),
        };
        drop(works);
        let film = film.into_film();
        if takes == Takes::All {
            self.film = film;
        }
        self.choice = choice;
        if let Some(errors) = errors.filter(|_| choice.now.shape().is_none()) {
            self.allotment = errors.allot(&self.options, pass.samples);
        }
        taken
    }
}

/// What is taken of a pass.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Takes {
    All,
    /// What decides on the technique, and the picture gets nothing of it.
    TrialsOnly,
}
