//! Accuracy of the error estimate, and how closely `--noise` stops at the requested error.

use crate::measure::{Setup, Subject, to_image};
use oscura::error::Result;
use oscura::metrics::errors;
use oscura::render::PassOutcome;
use std::path::Path;

/// Minimum samples of pictures whose estimate is judged, and of the first possible stop. Before, a pass of eight samples changes
/// the error by more than a fifth.
const MIN_SAMPLES: u32 = 64;

/// Requested errors: each this fraction of the one before.
const STEP: f64 = 0.84;

/// A rendering of one scene with one seed.
pub struct Run {
    /// Name of the scene's file.
    scene: String,
    seed: u32,
    /// After each pass that has an estimate, by ascending samples.
    passes: Vec<Pass>,
}

/// Relative errors after a pass: sqrt(mean((x - r)^2 / (r^2 + 0.01))).
struct Pass {
    samples: u32,
    estimated: f64,
    /// Against the converged reference, with its own error subtracted.
    real: f64,
    /// Wall-clock time so far, seconds.
    render_s: f64,
}

/// Renders a scene with several seeds to the last step of the ladder.
pub fn calibrate(path: &Path, setup: &Setup, seeds: u32) -> Result<Vec<Run>> {
    let subject = Subject::new(path, setup)?;
    let (reference, own) = subject.reference(setup.reference)?;
    let most = setup.ladder.iter().copied().max().unwrap_or(MIN_SAMPLES);
    let run = |seed: u32| {
        // An error that is never reached.
        let mut rendering = subject.rendering(most, seed, Some(f32::MIN_POSITIVE))?;
        let mut passes = Vec::new();
        loop {
            let outcome = rendering.next_pass();
            let statistics = rendering.statistics();
            if let Some(estimated) = statistics.error {
                let squared = errors(&to_image(rendering.film()), &reference).rel_mse - own;
                passes.push(Pass {
                    samples: statistics.samples_per_pixel.round() as u32,
                    estimated,
                    real: squared.max(0.0).sqrt(),
                    render_s: statistics.render_s,
                });
            }
            if outcome != PassOutcome::Progressed {
                return Ok(Run { scene: subject.name.clone(), seed, passes });
            }
        }
    };
    (1..=seeds).map(run).collect()
}

impl Run {
    /// The pass at which a run with this requested error stops, unless it is the first.
    fn stop(&self, asked: f64) -> Option<&Pass> {
        self.passes.iter().find(|pass| pass.estimated <= asked).filter(|pass| pass.samples > MIN_SAMPLES)
    }

    /// True over requested errors of all stops.
    fn stops(&self) -> Vec<f64> {
        let asked = (0..64).map(|i| STEP.powi(i));
        asked.filter_map(|asked| Some(self.stop(asked)?.real / asked)).collect()
    }

    /// Estimated over true errors of the larger sample counts.
    fn estimates(&self) -> Vec<f64> {
        let judged = self.passes.iter().filter(|pass| pass.samples >= MIN_SAMPLES);
        judged.map(|pass| pass.estimated / pass.real.max(f64::MIN_POSITIVE)).collect()
    }
}

/// One line per pass.
pub fn csv(runs: &[Run]) -> String {
    let mut out = "scene,seed,samples,estimated,true,render_s\n".to_string();
    for run in runs {
        // Quotes double inside quotes.
        let scene = run.scene.replace('"', "\"\"");
        for p in &run.passes {
            out += &format!(
                "\"{scene}\",{},{},{},{},{}\n",
                run.seed, p.samples, p.estimated, p.real, p.render_s
            );
        }
    }
    out
}

/// One line per scene.
pub fn markdown(runs: &[Run]) -> String {
    let mut out = "| scene | true error at the last pass, % | estimated / true: mean | from | to | true / asked at the stop: mean | from | to | within 20 % |\n\
                   |---|---:|---:|---:|---:|---:|---:|---:|---:|\n"
        .to_string();
    for of_scene in runs.chunk_by(|a, b| a.scene == b.scene) {
        let collect = |of: fn(&Run) -> Vec<f64>| of_scene.iter().flat_map(of).collect::<Vec<f64>>();
        let (estimates, stops) = (collect(Run::estimates), collect(Run::stops));
        let last: Vec<f64> =
            of_scene.iter().filter_map(|run| Some(run.passes.last()?.real * 100.0)).collect();
        let within = stops.iter().filter(|&&ratio| (0.8..=1.25).contains(&ratio)).count();
        let [a, s] = [&estimates, &stops].map(|all| {
            let (least, most) = all.iter().fold((f64::INFINITY, 0.0f64), |(l, m), &v| (l.min(v), m.max(v)));
            format!("{:.2} | {least:.2} | {most:.2}", mean(all))
        });
        out += &format!(
            "| {} | {:.2} | {a} | {s} | {within} of {} |\n",
            of_scene[0].scene,
            mean(&last),
            stops.len()
        );
    }
    out
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
