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

/// Minimum time between two progress lines for programs.
pub(super) const MACHINE_PAUSE: Duration = Duration::from_millis(500);

/// Time of the first plain line. The time of each further one is twice that of the line before.
const FIRST_LINE: Duration = Duration::from_secs(2);

/// Longest time between two plain lines: a log shows that the program is alive.
const LONGEST_PAUSE: Duration = Duration::from_secs(600);

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
    /// The picture's relative error, where --noise is given and it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    estimated_error: Option<f64>,
}

impl ProgressLine {
    /// Prints it with another share of the work done.
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

/// Progress that programs were sent.
#[derive(Default)]
pub(crate) struct LastLine {
    /// When the last line was printed.
    printed: Duration,
    /// The last line, printed or not.
    newest: Option<ProgressLine>,
}

/// Shows how far rendering is.
pub(crate) enum Progress {
    Silent,
    /// For other programs.
    Machine {
        kind: ProgressArg,
        last: Mutex<LastLine>,
    },
    Bar {
        bar: ProgressBar,
        ends: StopCriteria,
    },
    Lines {
        /// When the next line is printed.
        next: Mutex<Duration>,
        ends: StopCriteria,
        /// Prefix of lines: the frame of a sequence.
        label: String,
    },
}

/// Conditions that end rendering besides the number of samples.
#[derive(Clone, Copy)]
pub(crate) struct StopCriteria {
    /// The time that it may take.
    pub limit: Option<Duration>,
    /// The error decides.
    pub by_noise: bool,
}

impl Progress {
    /// Chooses by what standard error is. `frame` names the frame of a sequence.
    pub fn new(quiet: bool, kind: Option<ProgressArg>, ends: StopCriteria, frame: Option<&str>) -> Progress {
        let label = frame.map_or_else(String::new, |frame| format!("{frame}: "));
        if let Some(kind @ (ProgressArg::Json | ProgressArg::Openjd)) = kind {
            return Progress::Machine { kind, last: Mutex::default() };
        }
        if quiet || kind == Some(ProgressArg::None) {
            return Progress::Silent;
        }
        if kind == Some(ProgressArg::Plain) || !std::io::stderr().is_terminal() {
            return Progress::Lines { next: Mutex::new(FIRST_LINE), ends, label };
        }
        let bar = ProgressBar::new(1000);
        let style = "{prefix}{bar:40} {percent:>3} %  {elapsed} elapsed{msg}";
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style);
        }
        bar.set_prefix(label);
        Progress::Bar { bar, ends }
    }

    /// Takes the renderer's news; may be called from any thread.
    pub fn show(&self, event: &Event) {
        let Event::Progress { samples_done, samples_total, rays, elapsed, error, .. } = *event else {
            return;
        };
        let share = (samples_done as f64 / samples_total.max(1) as f64).min(1.0);
        let seconds = elapsed.as_secs_f64().max(1e-9);
        let speed = rays as f64 / seconds / 1e6;
        match self {
            Progress::Silent => {}
            Progress::Machine { kind, last } => {
                let mut last = last.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                let elapsed_s = elapsed.as_secs_f64();
                let (event, progress) = ("progress", share);
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
                last.newest = Some(line);
                if samples_done < samples_total && elapsed < last.printed + MACHINE_PAUSE {
                    return;
                }
                last.printed = elapsed;
                line.print(*kind, share);
            }
            Progress::Bar { bar, ends } => {
                bar.set_position((share * 1000.0) as u64);
                let left = ends.left(share, elapsed, error);
                let left = left.map_or_else(String::new, |left| format!(", about {left} left"));
                let error = error.map_or_else(String::new, |error| format!("  error {:.2} %", error * 100.0));
                bar.set_message(format!("{left}  {speed:.1} M rays/s{error}"));
            }
            Progress::Lines { next, ends, label } => {
                let mut next = next.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                if elapsed < *next {
                    return;
                }
                *next = next_line(elapsed);
                let error_known = error.is_some();
                let left = ends.left(share, elapsed, error);
                let left = left.map_or_else(String::new, |left| format!("about {left} left, "));
                let error = error.map_or_else(String::new, |error| format!(", error {:.2} %", error * 100.0));
                // Without an estimate of the noise nobody knows how far it is.
                let done = match ends.is_known(error_known) {
                    true => format!("{:.1} %  ", share * 100.0),
                    false => String::new(),
                };
                say!("{label}{done}{seconds:.0} s elapsed, {left}{speed:.1} M rays/s{error}");
            }
        }
    }

    /// Takes the bar off the screen. Programs get a last line: that all is done, if it is, however many samples that took.
    pub fn finish(&self, is_complete: bool) {
        match self {
            Progress::Bar { bar, .. } => bar.finish_and_clear(),
            Progress::Machine { kind, last } => {
                let last = last.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                if let Some(line) = last.newest.filter(|line| is_complete && line.progress < 1.0) {
                    line.print(*kind, 1.0);
                }
            }
            Progress::Silent | Progress::Lines { .. } => {}
        }
    }
}

/// When the plain line after one at this time is printed.
fn next_line(elapsed: Duration) -> Duration {
    elapsed + elapsed.min(LONGEST_PAUSE)
}

/// Shorter times say nothing about how long the rest takes: memory is being filled for the first time.
const MIN_KNOWN: Duration = Duration::from_millis(500);

impl StopCriteria {
    /// Does the share of the samples say how far rendering is?
    fn is_known(self, is_error_known: bool) -> bool {
        is_error_known || !self.by_noise
    }

    /// How long a picture will take of which a share is done and that has this error; `None` where too little is known.
    fn left(self, share: f64, elapsed: Duration, error: Option<f64>) -> Option<String> {
        if self.is_known(error.is_some()) { left(share, elapsed, self.limit) } else { None }
    }
}

/// How long a picture will take of which a share is done; `None` where too little of it is.
fn left(share: f64, elapsed: Duration, limit: Option<Duration>) -> Option<String> {
    if elapsed < MIN_KNOWN || share <= 0.0 {
        return None;
    }
    let until = limit.map_or(f64::INFINITY, |limit| limit.saturating_sub(elapsed).as_secs_f64());
    let seconds = (elapsed.as_secs_f64() * (1.0 / share - 1.0)).min(until).max(0.0);
    Some(match seconds {
        ..90.0 => format!("{:.0} s", seconds.ceil()),
        ..5400.0 => format!("{:.0} min", seconds / 60.0),
        _ => format!("{:.1} h", seconds / 3600.0),
    })
}

// Progress of steps before and after rendering: loading, building, denoising.

/// How long something may take before it is reported that it does.
const PATIENCE: Duration = Duration::from_secs(2);

/// Steps of a bar.
const STEPS: f64 = 1000.0;

/// To whom it is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProgressTarget {
    Nobody,
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
    /// As the caller has it, and by what standard error is.
    pub fn of(quiet: bool, kind: Option<ProgressArg>) -> ProgressTarget {
        match kind {
            Some(ProgressArg::Json) => ProgressTarget::Json,
            Some(ProgressArg::Openjd) => ProgressTarget::Openjd,
            _ if quiet || kind == Some(ProgressArg::None) => ProgressTarget::Nobody,
            Some(ProgressArg::Plain) => ProgressTarget::Lines,
            _ if std::io::stderr().is_terminal() => ProgressTarget::Terminal,
            _ => ProgressTarget::Lines,
        }
    }
}

/// A line for programs.
#[derive(Serialize)]
struct WaitingLine {
    /// `load`, `build` or `denoise`.
    event: &'static str,
    /// 0..1, where it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    progress: Option<f64>,
    elapsed_s: f64,
}

/// Says that something takes a while, from two seconds on and until it is dropped.
pub(super) struct StageProgress {
    /// Hangs up when it is over.
    over: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl StageProgress {
    /// For what `label` names, which begins now; the counter is that of the work.
    pub fn new(target: ProgressTarget, label: &'static str, counter: &WorkCounter) -> StageProgress {
        if target == ProgressTarget::Nobody {
            return StageProgress { over: None, thread: None };
        }
        let (over, until) = channel();
        let counter = counter.clone();
        let thread = std::thread::spawn(move || wait(target, label, &counter, &until));
        StageProgress { over: Some(over), thread: Some(thread) }
    }
}

impl Drop for StageProgress {
    fn drop(&mut self) {
        self.over = None;
        // It can't fail; if it did, a message would be missing.
        self.thread.take().map(JoinHandle::join);
    }
}

/// Reports until it is over, or nothing if that is soon.
fn wait(target: ProgressTarget, label: &'static str, counter: &WorkCounter, until: &Receiver<()>) {
    let start = Instant::now();
    let goes_on = |pause| until.recv_timeout(pause) == Err(RecvTimeoutError::Timeout);
    if !goes_on(PATIENCE) {
        return;
    }
    if target == ProgressTarget::Terminal {
        return draw(label, counter, goes_on);
    }
    let mut pause = if target == ProgressTarget::Lines { PATIENCE } else { MACHINE_PAUSE };
    loop {
        let (elapsed_s, progress) = (start.elapsed().as_secs_f64(), counter.share());
        let share = progress.map_or_else(String::new, |share| format!("{:.0} %, ", share * 100.0));
        match target {
            ProgressTarget::Json => json::print(&WaitingLine { event: label, progress, elapsed_s }),
            ProgressTarget::Openjd => print_line(&format!("openjd_status: {label}, {share}{elapsed_s:.0} s")),
            _ => {
                say!("{label:<8} {share}{elapsed_s:.0} s so far");
                pause = Duration::from_secs_f64(elapsed_s);
            }
        }
        if !goes_on(pause) {
            return;
        }
    }
}

/// A bar on the terminal; as long as nobody knows how much there is to do, a spinner.
fn draw(label: &'static str, counter: &WorkCounter, goes_on: impl Fn(Duration) -> bool) {
    let bar = ProgressBar::new(STEPS as u64).with_message(label).with_elapsed(PATIENCE);
    let style = |template| ProgressStyle::with_template(template).ok();
    let spinner = style("{spinner} {msg}  {elapsed}");
    let known = style("{msg:8} {bar:40} {percent:>3} %  {elapsed} elapsed");
    known.iter().for_each(|style| bar.set_style(style.clone()));
    let mut is_known = true;
    loop {
        let share = counter.share();
        if share.is_some() != is_known {
            is_known = share.is_some();
            let style = if is_known { &known } else { &spinner };
            style.iter().for_each(|style| bar.set_style(style.clone()));
        }
        bar.set_position((share.unwrap_or(0.0) * STEPS) as u64);
        bar.tick();
        if !goes_on(Duration::from_millis(100)) {
            return bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_between_lines_double() {
        let lines = std::iter::successors(Some(FIRST_LINE), |&last| Some(next_line(last)));
        let seconds: Vec<u64> = lines.take(11).map(|time| time.as_secs()).collect();
        assert_eq!(seconds, [2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 1624]);
    }

    #[test]
    fn nothing_is_reported_of_the_rest_before_something_is_known() {
        let (second, minute) = (Duration::from_secs(1), Duration::from_secs(60));
        assert_eq!(left(0.5, Duration::from_millis(100), None), None);
        assert_eq!(left(0.0, second, None), None);
        assert_eq!(left(0.25, second, None).as_deref(), Some("3 s"));
        assert_eq!(left(0.001, second, Some(minute)).as_deref(), Some("59 s"));
        assert_eq!(left(0.1, minute, None).as_deref(), Some("9 min"));
        assert_eq!(left(0.999, second, None).as_deref(), Some("1 s"));
    }
}
