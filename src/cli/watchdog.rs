//! Limits of time and memory that end the process: files from anywhere become small pictures without anyone watching, and what
//! takes long or much may be anywhere, also inside a decoder.

use super::outcome::exit_code;
use super::process::memory_now;
use super::report;
use oscura::error::Error;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// How often the limits are looked at.
const INTERVAL: Duration = Duration::from_millis(20);

/// Limits of the work on one file; `None` is none.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limits {
    pub time: Option<Duration>,
    /// Bytes that the process may have.
    pub memory: Option<u64>,
}

/// Watches for as long as it lives.
pub(super) struct Watchdog {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Watchdog {
    /// Begins to watch. Of what is reached `error` makes the error that the process ends with.
    pub fn begin(limits: Limits, error: impl Fn(String) -> Error + Send + 'static) -> Watchdog {
        if limits.time.is_none() && limits.memory.is_none() {
            return Watchdog { stop: None, thread: None };
        }
        let (stop, stopped) = channel();
        let start = Instant::now();
        let watch = move || {
            while stopped.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Timeout) {
                if let Some(message) = limits.reached(start) {
                    let error = error(message);
                    report::error(&error);
                    std::process::exit(i32::from(exit_code(&error)));
                }
            }
        };
        // Without a thread for it nothing is watched; then little else would run either.
        Watchdog { stop: Some(stop), thread: thread::Builder::new().spawn(watch).ok() }
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Limits {
    /// What is to be said of the limit that is reached.
    fn reached(&self, start: Instant) -> Option<String> {
        if let Some(time) = self.time.filter(|time| start.elapsed() >= *time) {
            return Some(format!("takes longer than {} s (--time-limit)", time.as_secs_f64()));
        }
        let most = self.memory?;
        let taken = memory_now().filter(|taken| *taken > most)?;
        let mib = |bytes: u64| bytes >> 20;
        Some(format!("takes {} MiB of memory, more than {} MiB (--memory-limit)", mib(taken), mib(most)))
    }
}
