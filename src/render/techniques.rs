//! The list of techniques, in the order of their trials, and running the trials.

use super::caustics::LightTracing;
use super::guiding::PathGuiding;
use super::light_selection::LearnedSelection;
use super::options::RenderOptions;
use super::path_strategy::StrategyTrials;
use super::progress::Statistics;
use super::schedule::Pass;
use super::technique::{LightPathCost, PassTrial, Request, Stopped, Target, Technique, Trial, warning};
use crate::error::Warning;
use crate::integrator::{Block, CausticPlan, IntegratorOptions};

/// Generates [`Techniques`] from a list in the order of trials: a technique's trial uses the configuration by the techniques before it. A
/// row: field, type and constructor.
macro_rules! techniques {
    ($($(#[$doc:meta])* $visibility:vis $name:ident: $technique:ty = $new:expr,)*) => {
        pub(super) struct Techniques {
            $($(#[$doc])* $visibility $name: $technique,)*
            are_prepared: bool,
        }

        impl Techniques {
            /// All techniques, before their trials.
            pub fn new(target: &Target<'_>) -> Techniques {
                Techniques { $($name: $new(target),)* are_prepared: false }
            }

            fn list(&self) -> Vec<&dyn Technique> {
                vec![$(&self.$name),*]
            }

            fn list_mut(&mut self) -> Vec<&mut dyn Technique> {
                vec![$(&mut self.$name),*]
            }
        }
    };
}

techniques! {
    light_selection: LearnedSelection = untried,
    /// Light tracing of caustics.
    light_tracing: LightTracing = untried,
    guiding: PathGuiding = untried,
    /// Path reuse or splitting.
    pub strategy: StrategyTrials = StrategyTrials::new,
}

fn untried<T: Default>(_: &Target<'_>) -> T {
    T::default()
}

impl Techniques {
    /// Runs the trials before the first pass, once.
    pub fn prepare(&mut self, trial: &Trial<'_>) -> Result<(), Stopped> {
        if self.are_prepared {
            return Ok(());
        }
        let mut list = self.list_mut();
        for i in 0..list.len() {
            let (earlier, rest) = list.split_at_mut(i);
            let mut paths = trial.paths.clone();
            earlier.iter().for_each(|technique| technique.configure(&mut paths));
            let technique = &mut *rest[0];
            let is_wanted = technique.request(trial.target.options) != Request::Off;
            if is_wanted && technique.prevented_by(&trial.target).is_none() {
                technique.try_before_first_pass(&Trial { paths, ..*trial })?;
            }
        }
        self.are_prepared = true;
        Ok(())
    }

    /// Configures the integrator for a picture.
    pub fn configure<'a>(&'a self, paths: &mut IntegratorOptions<'a>) {
        self.list().iter().for_each(|technique| technique.configure(paths));
    }

    /// Runs the trials within the first pass. Returns the squares that need not be rendered again; `None` if stopped.
    pub fn try_in_pass(&self, pass: &dyn PassTrial) -> Option<Vec<Block>> {
        let squares = self.list().into_iter().map(|technique| technique.try_in_pass(pass));
        squares.collect::<Option<Vec<_>>>().map(|squares| squares.concat())
    }

    /// Are trials within the first pass pending?
    pub fn have_pending_trials(&self) -> bool {
        self.list().iter().any(|technique| technique.has_pending_trial())
    }

    /// Configures the integrator for the camera paths of a pass.
    pub fn configure_pass(&self, pass: Pass, options: &RenderOptions, paths: &mut IntegratorOptions<'_>) {
        self.list().iter().for_each(|technique| technique.configure_pass(pass, options, paths));
    }

    /// Must the film be complete between passes?
    pub fn separate_passes(&self) -> bool {
        self.list().iter().any(|technique| technique.separates_passes())
    }

    /// The setup of light tracing, if in use.
    pub fn caustics(&self) -> Option<&CausticPlan> {
        self.light_tracing.plan()
    }

    /// Squared error and time of light paths, relative to camera paths.
    pub fn light_path_cost(&self) -> LightPathCost {
        self.light_tracing.light_path_cost()
    }

    /// Warnings about techniques that were requested and are not used.
    pub fn warnings(&self, target: &Target<'_>) -> Vec<Warning> {
        self.list().iter().filter_map(|technique| warning(*technique, target)).collect()
    }

    /// Adds the statistics of all techniques.
    pub fn report(&self, statistics: &mut Statistics) {
        self.list().iter().for_each(|technique| technique.report(statistics));
    }
}
