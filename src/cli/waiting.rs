//! What is said while something takes a while before or after rendering: loading, building, taking out noise.

use super::json;
use super::progress::{MACHINE_PAUSE, ProgressArg};
use super::report::print_line;
use indicatif::{ProgressBar, ProgressStyle};
use oscura::gauge::Gauge;
use serde::Serialize;
use std::io::IsTerminal;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long something may take before it is said that it does.
const PATIENCE: Duration = Duration::from_secs(2);

/// Steps of a bar.
const STEPS: f64 = 1000.0;

/// To whom it is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Telling {
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

impl Telling {
    /// As the caller has it, and by what standard error is.
    pub fn of(quiet: bool, kind: Option<ProgressArg>) -> Telling {
        match kind {
            Some(ProgressArg::Json) => Telling::Json,
            Some(ProgressArg::Openjd) => Telling::Openjd,
            _ if quiet || kind == Some(ProgressArg::None) => Telling::Nobody,
            Some(ProgressArg::Plain) => Telling::Lines,
            _ if std::io::stderr().is_terminal() => Telling::Terminal,
            _ => Telling::Lines,
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
pub(super) struct Waiting {
    /// Hangs up when it is over.
    over: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Waiting {
    /// For what `label` names, which begins now; the gauge is that of the work.
    pub fn new(telling: Telling, label: &'static str, gauge: &Gauge) -> Waiting {
        if telling == Telling::Nobody {
            return Waiting { over: None, thread: None };
        }
        let (over, until) = channel();
        let gauge = gauge.clone();
        let thread = std::thread::spawn(move || wait(telling, label, &gauge, &until));
        Waiting { over: Some(over), thread: Some(thread) }
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.over = None;
        // It can't fail; if it did, a message would be missing.
        self.thread.take().map(JoinHandle::join);
    }
}

/// Tells until it is over, or nothing if that is soon.
fn wait(telling: Telling, label: &'static str, gauge: &Gauge, until: &Receiver<()>) {
    let start = Instant::now();
    let goes_on = |pause| until.recv_timeout(pause) == Err(RecvTimeoutError::Timeout);
    if !goes_on(PATIENCE) {
        return;
    }
    if telling == Telling::Terminal {
        return draw(label, gauge, goes_on);
    }
    let mut pause = if telling == Telling::Lines { PATIENCE } else { MACHINE_PAUSE };
    loop {
        let (elapsed_s, progress) = (start.elapsed().as_secs_f64(), gauge.share());
        let share = progress.map_or_else(String::new, |share| format!("{:.0} %, ", share * 100.0));
        match telling {
            Telling::Json => json::print(&WaitingLine { event: label, progress, elapsed_s }),
            Telling::Openjd => print_line(&format!("openjd_status: {label}, {share}{elapsed_s:.0} s")),
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
fn draw(label: &'static str, gauge: &Gauge, goes_on: impl Fn(Duration) -> bool) {
    let bar = ProgressBar::new(STEPS as u64).with_message(label).with_elapsed(PATIENCE);
    let style = |template| ProgressStyle::with_template(template).ok();
    let spinner = style("{spinner} {msg}  {elapsed}");
    let known = style("{msg:8} {bar:40} {percent:>3} %  {elapsed} elapsed");
    known.iter().for_each(|style| bar.set_style(style.clone()));
    let mut is_known = true;
    loop {
        let share = gauge.share();
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
