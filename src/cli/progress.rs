//! Progress while rendering: a bar on a terminal, plain lines elsewhere.

use super::json;
use super::report::print_line;
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use oscura::render::Event;
use oscura::work_counter::WorkCounter;
use serde::Serialize;
use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Minimum interval between machine-readable lines.
pub(super) const MACHINE_INTERVAL: Duration = Duration::from_millis(500);

/// Elapsed time at the first plain line; doubles for each further line.
const FIRST_LINE: Duration = Duration::from_secs(2);

/// Maximum interval between plain lines.
const MAX_INTERVAL: Duration = Duration::from_secs(600);

/// How progress is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProgressArg {
    /// Lines for people, on standard error.
    Plain,
    /// One JSON object per line, on standard output.
    Json,
    /// Open Job Description: openjd_progress and openjd_status, on standard output.
    Openjd,
    /// No progress reports.
    None,
}

/// A line of `--progress json`.
#[derive(Clone, Copy, Serialize)]
struct ProgressLine {
    event: &'static str,
    /// 0..1.
    progress: f64,
    samples_done: u64,
    samples_total: u64,
    elapsed_s: f64,
    rays: u64,
    /// Estimated relative error of the picture, with `--noise` and once there is an estimate.
    #[serde(skip_serializing_if = "Option::is_none")]
    estimated_error: Option<f64>,
}

impl ProgressLine {
    /// Prints the line with this progress.
    fn print(self, kind: ProgressArg, progress: f64) {
        if kind == ProgressArg::Openjd {
            let speed = self.rays as f64 / self.elapsed_s.max(1e-9) / 1e6;
            print_line(&format!("openjd_progress: {:.2}", progress * 100.0));
            print_line(&format!("openjd_status: rendering, {:.0} s, {speed:.1} M rays/s", self.elapsed_s));
        } else {
            json::print(&ProgressLine { progress, ..self });
        }
    }
}

/// The latest machine-readable progress.
#[derive(Default)]
pub(crate) struct LastLine {
    /// Elapsed time when a line was last printed.
    printed: Duration,
    /// The latest line, printed or not.
    latest: Option<ProgressLine>,
}

/// Reports the progress of rendering.
pub(crate) enum Progress {
    Silent,
    /// Machine-readable lines.
    Machine {
        kind: ProgressArg,
        last: Mutex<LastLine>,
    },
    Bar {
        bar: ProgressBar,
        criteria: StopCriteria,
    },
    Lines {
        /// Elapsed time at which the next line is due.
        next: Mutex<Duration>,
        criteria: StopCriteria,
        /// Prefix of lines: the frame of a sequence.
        label: String,
    },
}

/// Stop conditions other than the number of samples.
#[derive(Clone, Copy)]
pub(crate) struct StopCriteria {
    pub time_limit: Option<Duration>,
    /// There is a noise threshold.
    pub by_noise: bool,
}

impl Progress {
    /// Without `kind`, shows a bar if standard error is a terminal, else plain lines. `frame` names the frame of a sequence.
    pub fn new(
        quiet: bool,
        kind: Option<ProgressArg>,
        criteria: StopCriteria,
        frame: Option<&str>,
    ) -> Progress {
        let label = frame.map_or_else(String::new, |frame| format!("{frame}: "));
        if let Some(kind @ (ProgressArg::Json | ProgressArg::Openjd)) = kind {
            return Progress::Machine { kind, last: Mutex::default() };
        }
        if quiet || kind == Some(ProgressArg::None) {
            return Progress::Silent;
        }
        if kind == Some(ProgressArg::Plain) || !std::io::stderr().is_terminal() {
            return Progress::Lines { next: Mutex::new(FIRST_LINE), criteria, label };
        }
        let bar = ProgressBar::new(STEPS as u64);
        let style = "{prefix}{bar:40} {percent:>3} %  {elapsed} elapsed{msg}";
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style);
        }
        bar.set_prefix(label);
        Progress::Bar { bar, criteria }
    }

    /// Handles an event of the renderer; may be called from any thread.
    pub fn show(&self, event: &Event) {
        let Event::Progress { samples_done, samples_total, rays, elapsed, error, .. } = *event else {
            return;
        };
        let fraction = (samples_done as f64 / samples_total.max(1) as f64).min(1.0);
        let seconds = elapsed.as_secs_f64().max(1e-9);
        let speed = rays as f64 / seconds / 1e6;
        match self {
            Progress::Silent => {}
            Progress::Machine { kind, last } => {
                let mut last = last.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                let elapsed_s = elapsed.as_secs_f64();
                let (event, progress) = ("progress", fraction);
                let estimated_error = error;
                let line = ProgressLine {
                    event,
                    progress,
                    samples_done,
                    samples_total,
                    elapsed_s,
                    rays,
                    estimated_error,
                };
                last.latest = Some(line);
                if samples_done < samples_total && elapsed < last.printed + MACHINE_INTERVAL {
                    return;
                }
                last.printed = elapsed;
                line.print(*kind, fraction);
            }
            Progress::Bar { bar, criteria } => {
                bar.set_position((fraction * STEPS) as u64);
                let remaining = criteria.remaining(fraction, elapsed, error);
                let remaining = remaining.map_or_else(String::new, |time| format!(", about {time} left"));
                let error = error.map_or_else(String::new, |error| format!("  error {:.2} %", error * 100.0));
                bar.set_message(format!("{remaining}  {speed:.1} M rays/s{error}"));
            }
            Progress::Lines { next, criteria, label } => {
                let mut next = next.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                if elapsed < *next {
                    return;
                }
                *next = next_line(elapsed);
                let is_error_known = error.is_some();
                let remaining = criteria.remaining(fraction, elapsed, error);
                let remaining = remaining.map_or_else(String::new, |time| format!("about {time} left, "));
                let error = error.map_or_else(String::new, |error| format!(", error {:.2} %", error * 100.0));
                // With a noise threshold the progress is unknown until the noise is estimated.
                let done = match criteria.is_progress_known(is_error_known) {
                    true => format!("{:.1} %  ", fraction * 100.0),
                    false => String::new(),
                };
                say!("{label}{done}{seconds:.0} s elapsed, {remaining}{speed:.1} M rays/s{error}");
            }
        }
    }

    /// Clears the bar. For a complete picture, prints a last machine-readable line with progress 1 unless the latest had it.
    pub fn finish(&self, is_complete: bool) {
        match self {
            Progress::Bar { bar, .. } => bar.finish_and_clear(),
            Progress::Machine { kind, last } => {
                let last = last.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                if let Some(line) = last.latest.filter(|line| is_complete && line.progress < 1.0) {
                    line.print(*kind, 1.0);
                }
            }
            Progress::Silent | Progress::Lines { .. } => {}
        }
    }
}

/// Elapsed time at which the plain line after one at `elapsed` is due.
fn next_line(elapsed: Duration) -> Duration {
    elapsed + elapsed.min(MAX_INTERVAL)
}

/// Minimum elapsed time for estimates of the remaining time: rendering is slower at first, while memory is touched for the
/// first time.
const MIN_ESTIMATE: Duration = Duration::from_millis(500);

impl StopCriteria {
    /// Whether the fraction of samples taken is the progress.
    fn is_progress_known(self, is_error_known: bool) -> bool {
        is_error_known || !self.by_noise
    }

    /// Estimated remaining time, readable; `None` if too little is known.
    fn remaining(self, fraction: f64, elapsed: Duration, error: Option<f64>) -> Option<String> {
        if self.is_progress_known(error.is_some()) {
            remaining(fraction, elapsed, self.time_limit)
        } else {
            None
        }
    }
}

/// Estimated remaining time when a fraction is done, readable; `None` if too little is done.
fn remaining(fraction: f64, elapsed: Duration, limit: Option<Duration>) -> Option<String> {
    if elapsed < MIN_ESTIMATE || fraction <= 0.0 {
        return None;
    }
    let until_limit = limit.map_or(f64::INFINITY, |limit| limit.saturating_sub(elapsed).as_secs_f64());
    let seconds = (elapsed.as_secs_f64() * (1.0 / fraction - 1.0)).min(until_limit).max(0.0);
    Some(match seconds {
        ..90.0 => format!("{:.0} s", seconds.ceil()),
        ..5400.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    })
}

// Progress of the stages before and after rendering: loading, building, denoising.

/// Stages shorter than this are not reported.
const MIN_REPORTED: Duration = Duration::from_secs(2);

/// Resolution of progress bars.
const STEPS: f64 = 1000.0;

/// Destination and format of progress reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProgressTarget {
    None,
    /// A bar on standard error.
    Terminal,
    /// Lines on standard error.
    Lines,
    /// JSON on standard output.
    Json,
    /// Open Job Description on standard output.
    Openjd,
}

impl ProgressTarget {
    /// From the arguments; without them, a bar if standard error is a terminal, else lines.
    pub fn of(quiet: bool, kind: Option<ProgressArg>) -> ProgressTarget {
        match kind {
            Some(ProgressArg::Json) => ProgressTarget::Json,
            Some(ProgressArg::Openjd) => ProgressTarget::Openjd,
            _ if quiet || kind == Some(ProgressArg::None) => ProgressTarget::None,
            Some(ProgressArg::Plain) => ProgressTarget::Lines,
            _ if std::io::stderr().is_terminal() => ProgressTarget::Terminal,
            _ => ProgressTarget::Lines,
        }
    }
}

/// A line of `--progress json` for a stage.
#[derive(Serialize)]
struct StageLine {
    /// `load`, `build` or `denoise`.
    event: &'static str,
    /// 0..1, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    progress: Option<f64>,
    elapsed_s: f64,
}

/// Reports the progress of a stage on its own thread, from two seconds on until dropped.
pub(super) struct StageProgress {
    /// Dropped to stop the thread.
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl StageProgress {
    /// For a stage that starts now. `counter` counts its work.
    pub fn new(target: ProgressTarget, label: &'static str, counter: &WorkCounter) -> StageProgress {
        if target == ProgressTarget::None {
            return StageProgress { stop: None, thread: None };
        }
        let (stop, stopped) = channel();
        let counter = counter.clone();
        let thread = std::thread::spawn(move || report_stage(target, label, &counter, &stopped));
        StageProgress { stop: Some(stop), thread: Some(thread) }
    }
}

impl Drop for StageProgress {
    fn drop(&mut self) {
        self.stop = None;
        // A failure would only lose a message.
        self.thread.take().map(JoinHandle::join);
    }
}

/// Reports the progress of a stage until stopped.
fn report_stage(target: ProgressTarget, label: &'static str, counter: &WorkCounter, stopped: &Receiver<()>) {
    let start = Instant::now();
    // Waits; returns false if the stage ended.
    let is_running = |interval| stopped.recv_timeout(interval) == Err(RecvTimeoutError::Timeout);
    if !is_running(MIN_REPORTED) {
        return;
    }
    if target == ProgressTarget::Terminal {
        return draw_bar(label, counter, is_running);
    }
    let mut interval = if target == ProgressTarget::Lines { MIN_REPORTED } else { MACHINE_INTERVAL };
    loop {
        let (elapsed_s, progress) = (start.elapsed().as_secs_f64(), counter.share());
        let percent = progress.map_or_else(String::new, |fraction| format!("{:.0} %, ", fraction * 100.0));
        match target {
            ProgressTarget::Json => json::print(&StageLine { event: label, progress, elapsed_s }),
            ProgressTarget::Openjd => {
                print_line(&format!("openjd_status: {label}, {percent}{elapsed_s:.0} s"))
            }
            _ => {
                say!("{label:<8} {percent}{elapsed_s:.0} s so far");
                interval = Duration::from_secs_f64(elapsed_s);
            }
        }
        if !is_running(interval) {
            return;
        }
    }
}

/// Draws a bar on the terminal, or a spinner while the progress is unknown.
fn draw_bar(label: &'static str, counter: &WorkCounter, is_running: impl Fn(Duration) -> bool) {
    let bar = ProgressBar::new(STEPS as u64).with_message(label).with_elapsed(MIN_REPORTED);
    let style = |template| ProgressStyle::with_template(template).ok();
    let spinner_style = style("{spinner} {msg}  {elapsed}");
    let bar_style = style("{msg:8} {bar:40} {percent:>3} %  {elapsed} elapsed");
    bar_style.iter().for_each(|style| bar.set_style(style.clone()));
    let mut is_known = true;
    loop {
        let progress = counter.share();
        if progress.is_some() != is_known {
            is_known = progress.is_some();
            let style = if is_known { &bar_style } else { &spinner_style };
            style.iter().for_each(|style| bar.set_style(style.clone()));
        }
        bar.set_position((progress.unwrap_or(0.0) * STEPS) as u64);
        bar.tick();
        if !is_running(Duration::from_millis(100)) {
            return bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_between_lines_double() {
        let times = std::iter::successors(Some(FIRST_LINE), |&time| Some(next_line(time)));
        let seconds: Vec<u64> = times.take(11).map(|time| time.as_secs()).collect();
        assert_eq!(seconds, [2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 1624]);
    }

    #[test]
    fn remaining_time_is_estimated_from_the_fraction_done() {
        let (second, minute) = (Duration::from_secs(1), Duration::from_secs(60));
        assert_eq!(remaining(0.5, Duration::from_millis(100), None), None);
        assert_eq!(remaining(0.0, second, None), None);
        assert_eq!(remaining(0.25, second, None).as_deref(), Some("3 s"));
        assert_eq!(remaining(0.001, second, Some(minute)).as_deref(), Some("59 s"));
        assert_eq!(remaining(0.1, minute, None).as_deref(), Some("9 min"));
        assert_eq!(remaining(0.999, second, None).as_deref(), Some("1 s"));
    }
}
