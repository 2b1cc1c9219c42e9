//! Services of the operating system: signals, its own memory, and the exit
//! codes by which commands end.

use super::report;
use oscura::error::{Error, ErrorKind, Result};
use oscura::render::CancelHandle;
use std::ffi::OsString;
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Signals this soon after the first are the same request: `timeout` and job schedulers signal the process and its
/// group, so that it gets two.
const SAME_REQUEST: Duration = Duration::from_secs(1);

/// Handle that signals cancel; `None` until signals are watched for.
static WATCHED: Mutex<Option<Watched>> = Mutex::new(None);

struct Watched {
    cancel: CancelHandle,
    first: Option<Instant>,
}

impl Watched {
    /// Cancels at the first signal. True for a further one, a second or more later.
    fn signal(&mut self, now: Instant) -> bool {
        self.cancel.cancel();
        let first = *self.first.get_or_insert(now);
        now.duration_since(first) >= SAME_REQUEST
    }
}

/// Watches for Ctrl-C and SIGTERM. The first signal cancels the returned handle; another one, at least a second later,
/// ends the process with exit code 130.
///
/// # Errors
/// If the system refuses the handler. There is one for the whole process, which may run the program several times (Python).
pub(crate) fn cancel_by_signals() -> Result<CancelHandle> {
    let cancel = CancelHandle::new();
    let mut watched = WATCHED.lock().unwrap_or_else(PoisonError::into_inner);
    if watched.is_none() {
        ctrlc::set_handler(|| {
            let now = Instant::now();
            let mut watched = WATCHED.lock().unwrap_or_else(PoisonError::into_inner);
            if watched.as_mut().is_some_and(|watched| watched.signal(now)) {
                std::process::exit(130);
            }
        })
        .map_err(|e| Error::usage(format!("can't watch for signals: {e}")))?;
    }
    *watched = Some(Watched { cancel: cancel.clone(), first: None });
    Ok(cancel)
}

/// The command line that was read last: a process may run the program several times (Python).
static WORDS: Mutex<Vec<OsString>> = Mutex::new(Vec::new());

/// The words of the command line behind the program's name.
pub(crate) fn words() -> impl Iterator<Item = OsString> {
    WORDS.lock().unwrap_or_else(PoisonError::into_inner).clone().into_iter().skip(1)
}

/// Remembers the words of a command line for [`words`].
pub(crate) fn remember_words(words: &[OsString]) {
    WORDS.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&words.to_vec());
}

/// Peak memory of the process, bytes; where the system reports it (Linux).
pub(crate) fn peak_memory() -> Option<u64> {
    kib("/proc/self/status", "VmHWM:")
}

/// The memory that the process has now.
pub(crate) fn memory_now() -> Option<u64> {
    kib("/proc/self/status", "VmRSS:")
}

/// The memory that the process may have: the machine's, or less where its group of processes has a limit.
pub(crate) fn memory_of_machine() -> Option<u64> {
    let of_group = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
    let of_group = of_group.and_then(|text| text.trim().parse().ok());
    kib("/proc/meminfo", "MemTotal:").into_iter().chain(of_group).min()
}

/// Bytes of a file.
pub(crate) fn size_of(path: &Path) -> Option<u64> {
    std::fs::metadata(path).ok().map(|metadata| metadata.len())
}

/// A line of one of the system's files, kibibytes there and bytes here.
fn kib(file: &str, key: &str) -> Option<u64> {
    let status = std::fs::read_to_string(file).ok()?;
    let line = status.lines().find(|l| l.starts_with(key))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

// Limits of time and memory that end the process: files from anywhere become small pictures without anyone watching, and what
// takes long or much may be anywhere, also inside a decoder.

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
    /// Message about the limit that is reached.
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

/// How a command ended.
pub(crate) enum Outcome {
    /// As asked.
    Done,
    /// `compare` found that the pictures disagree.
    Disagreement,
    /// Stopped by a signal; partial results are written.
    Interrupted,
    /// Some of many failed, and the errors are printed; the exit code of the worst.
    Failed(u8),
}

/// The exit code of an error.
pub(crate) fn exit_code(error: &Error) -> u8 {
    match error.kind {
        ErrorKind::Usage => 2,
        ErrorKind::Input => 3,
        ErrorKind::Output => 4,
        ErrorKind::Interrupted => 130,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_run_of_a_process_has_a_handle_of_its_own() {
        let first = cancel_by_signals().expect("watched for");
        let second = cancel_by_signals().expect("watched for");
        first.cancel();
        assert!(!second.is_cancelled());
    }

    #[test]
    fn signals_within_a_second_are_one() {
        let mut watched = Watched { cancel: CancelHandle::new(), first: None };
        let start = Instant::now();
        let after = |ms| start + Duration::from_millis(ms);
        assert!(!watched.signal(start) && watched.cancel.is_cancelled());
        assert!(!watched.signal(after(1)) && !watched.signal(after(999)));
        assert!(watched.signal(after(1000)));
    }
}
