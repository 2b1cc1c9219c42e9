//! Progress while rendering: a bar on a terminal, plain lines elsewhere.

use indicatif::{ProgressBar, ProgressStyle};
use oscura::render::Event;
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::Duration;

/// Least time between two plain lines.
const PAUSE: Duration = Duration::from_secs(2);

/// Shows how far rendering is.
pub(crate) enum Progress {
    Silent,
    Bar(ProgressBar),
    Lines {
        /// When the last line was printed.
        last: Mutex<Duration>,
        /// When rendering ends at the latest.
        limit: Option<Duration>,
    },
}

impl Progress {
    /// Chooses by what standard error is. `limit` is the time that rendering may take.
    pub fn new(quiet: bool, limit: Option<Duration>) -> Progress {
        if quiet {
            return Progress::Silent;
        }
        if !std::io::stderr().is_terminal() {
            return Progress::Lines { last: Mutex::new(Duration::ZERO), limit };
        }
        let bar = ProgressBar::new(1000);
        let style = "{bar:40} {percent:>3} %  {elapsed} elapsed, {eta} left  {msg}";
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style);
        }
        Progress::Bar(bar)
    }

    /// Takes the renderer's news; may be called from any thread.
    pub fn show(&self, event: &Event) {
        let Event::Progress { samples_done, samples_total, rays, elapsed, .. } = *event else { return };
        let share = samples_done as f64 / samples_total.max(1) as f64;
        let seconds = elapsed.as_secs_f64().max(1e-9);
        let speed = rays as f64 / seconds / 1e6;
        match self {
            Progress::Silent => {}
            Progress::Bar(bar) => {
                bar.set_position((share * 1000.0) as u64);
                bar.set_message(format!("{speed:.1} M rays/s"));
            }
            Progress::Lines { last, limit } => {
                let mut last = last.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
                if elapsed < *last + PAUSE {
                    return;
                }
                *last = elapsed;
                let until = limit.map_or(f64::INFINITY, |limit| limit.saturating_sub(elapsed).as_secs_f64());
                let left = if share > 0.0 { (seconds / share - seconds).min(until) } else { 0.0 };
                eprintln!(
                    "{:.1} %  {seconds:.0} s elapsed, about {left:.0} s left, {speed:.1} M rays/s",
                    share * 100.0
                );
            }
        }
    }

    /// Takes the bar off the screen.
    pub fn finish(&self) {
        if let Progress::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}
