//! Simulated scaling to many threads: tasks of a render are timed on one thread and scheduled onto more, each thread taking the
//! next task when it is free.
//!
//! This measures idle time: for the last tiles of a pass, and in serial sections. Contention (memory, caches, clock frequency)
//! is not included.

use crate::measure::{Setup, Subject};
use oscura::error::Result;
use oscura::render::{TaskSpan, record_tasks, recorded_tasks};
use std::collections::BinaryHeap;
use std::path::Path;
use std::time::{Duration, Instant};

/// Simulated thread counts.
const THREADS: [usize; 5] = [2, 4, 16, 32, 64];

/// What was timed of a scene.
pub struct Timed {
    scene: String,
    size: [u32; 2],
    samples: u32,
    /// Seconds on one thread, and the serial part of them.
    total_s: f64,
    alone_s: f64,
    spans: Vec<TaskSpan>,
    /// Measured seconds on one and on two threads.
    real_s: Option<[f64; 2]>,
}

/// Synchronisation.
#[derive(Clone, Copy, PartialEq)]
enum Rule {
    /// A barrier at the end of each pass; noise estimation, the caustics trial and splatting are serial.
    Barriers,
    /// Passes overlap, and only untimed work is serial.
    Overlap,
}

/// Times a scene at the last step of the ladder, on the one thread of the current pool.
///
/// # Errors
/// If it can't be loaded.
pub fn time(path: &Path, setup: &Setup) -> Result<Vec<Timed>> {
    let subject = Subject::new(path, setup)?;
    let samples = setup.ladder.last().copied().unwrap_or(64);
    let mut rendering = subject.rendering(samples, 1, None)?;
    record_tasks();
    rendering.run();
    let (total, mut spans) = recorded_tasks();
    spans.sort_by_key(|span| span.start);
    let timed: Duration = spans.iter().map(|span| span.took).sum();
    let real = |threads: usize| -> Result<f64> {
        let mut rendering = subject.rendering(samples, 1, None)?;
        let start = Instant::now();
        oscura::render::in_pool(Some(threads), || rendering.run())?;
        Ok(start.elapsed().as_secs_f64())
    };
    let has_two = std::thread::available_parallelism().is_ok_and(|cores| cores.get() > 1);
    Ok(vec![Timed {
        scene: subject.name.clone(),
        size: subject.size(),
        samples,
        total_s: total.as_secs_f64(),
        alone_s: total.saturating_sub(timed).as_secs_f64(),
        spans,
        real_s: if has_two { Some([real(1)?, real(2)?]) } else { None },
    }])
}

impl Timed {
    /// Speed-up on a number of threads.
    fn speed_up(&self, threads: usize, rule: Rule) -> f64 {
        self.total_s / (self.alone_s + replayed(&self.spans, threads, rule))
    }
}

/// Simulated seconds on a number of threads.
fn replayed(spans: &[TaskSpan], threads: usize, rule: Rule) -> f64 {
    let is_alone = |span: &TaskSpan| {
        rule == Rule::Barriers && matches!(span.stage, "noise" | "splats" | "caustics" | "film")
    };
    let (mut sum, mut group, mut last) = (0.0, Vec::new(), None);
    for span in spans {
        let took = span.took.as_secs_f64();
        if is_alone(span) {
            sum += took;
        } else if let Some(number) = span.group {
            // Guiding and light paths merge neighbouring tasks, the more the more threads there are.
            let joined = match (rule, span.stage) {
                (Rule::Overlap, "tiles") => number.min(8),
                (Rule::Overlap, "guiding") => number / (2 * threads).div_ceil(16) as u32,
                _ => number,
            };
            // Tiles start while light tracing finishes.
            let begins = match (rule, span.stage, last) {
                (Rule::Overlap, "paths from lamps", Some(("paths from lamps", _))) => false,
                (Rule::Overlap, "trials" | "tiles", Some(("paths from lamps", _))) => false,
                _ => last != Some((span.stage, joined)),
            };
            if begins {
                sum += makespan(&std::mem::take(&mut group), threads);
            }
            last = Some((span.stage, joined));
            group.push(took);
        } else {
            sum += took / threads as f64;
        }
    }
    sum + makespan(&group, threads)
}

/// Makespan of list scheduling: each task is taken by the thread that is free first.
fn makespan(parts: &[f64], threads: usize) -> f64 {
    // Nanoseconds, the least first.
    let mut free: BinaryHeap<std::cmp::Reverse<u64>> = (0..threads).map(|_| std::cmp::Reverse(0)).collect();
    for part in parts {
        if let Some(mut first) = free.peek_mut() {
            first.0 += (part * 1e9) as u64;
        }
    }
    free.into_iter().map(|end| end.0).max().unwrap_or(0) as f64 * 1e-9
}

/// One line per scene and number of threads.
pub fn csv(all: &[Timed]) -> String {
    let mut out = "scene,width,height,samples,seconds,alone,threads,with_barriers,overlapping\n".to_string();
    for timed in all {
        let Timed { scene, size: [width, height], samples, total_s, alone_s, .. } = timed;
        for threads in THREADS {
            let [with, without] = [Rule::Barriers, Rule::Overlap].map(|rule| timed.speed_up(threads, rule));
            out += &format!(
                "{scene},{width},{height},{samples},{total_s:.3},{alone_s:.4},{threads},{with:.2},{without:.2}\n"
            );
        }
    }
    out
}

/// The same as a markdown table: speed-ups with a barrier after each pass, and with overlapping passes.
pub fn markdown(all: &[Timed]) -> String {
    let mut out = "| scene | size, samples | s on one thread | of them alone |".to_string();
    THREADS.iter().for_each(|threads| out += &format!(" {threads} threads |"));
    out += " 2 threads, measured |\n|---|---|---:|---:|";
    out += &"---:|".repeat(THREADS.len() + 1);
    for timed in all {
        let Timed { scene, size: [width, height], samples, total_s, alone_s, .. } = timed;
        out += &format!(
            "\n| {scene} | {width} x {height}, {samples} | {total_s:.2} | {:.2} % |",
            100.0 * alone_s / total_s
        );
        for threads in THREADS {
            let [with, without] = [Rule::Barriers, Rule::Overlap].map(|rule| timed.speed_up(threads, rule));
            out += &format!(" {with:.2} to {without:.2} |");
        }
        let real = timed.real_s.map_or("-".to_string(), |[one, two]| format!("{:.2}", one / two));
        out += &format!(" {real} |");
    }
    out + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn span(stage: &'static str, group: Option<u32>, seconds: f64) -> TaskSpan {
        TaskSpan { stage, group, start: Duration::ZERO, took: Duration::from_secs_f64(seconds) }
    }

    #[test]
    fn passes_that_overlap_wait_once() {
        let pass = |first| [3.0, 1.0, 1.0].map(|s| span("tiles", Some(first), s));
        let spans: Vec<TaskSpan> = [0, 8, 16].into_iter().flat_map(pass).collect();
        assert!((replayed(&spans, 2, Rule::Barriers) - 9.0).abs() < 1e-6);
        assert!((replayed(&spans, 2, Rule::Overlap) - 8.0).abs() < 1e-6);
        let noise = [span("noise", None, 4.0)];
        assert_eq!([Rule::Barriers, Rule::Overlap].map(|rule| replayed(&noise, 4, rule)), [4.0, 1.0]);
    }
}
