//! Signals, memory of the process, limits of time and memory, and exit codes.

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

/// Signals within this time of the first are ignored: `timeout` and job schedulers signal both the process and its process
/// group.
const REPEAT_WINDOW: Duration = Duration::from_secs(1);

/// `None` until the signal handler is installed.
static SIGNAL_STATE: Mutex<Option<SignalState>> = Mutex::new(None);

struct SignalState {
    cancel: CancelHandle,
    /// Time of the first signal.
    first: Option<Instant>,
}

impl SignalState {
    /// Cancels at the first signal. Returns true for another one, a second or more later.
    fn signal(&mut self, now: Instant) -> bool {
        self.cancel.cancel();
        let first = *self.first.get_or_insert(now);
        now.duration_since(first) >= REPEAT_WINDOW
    }
}

/// Handles Ctrl-C and SIGTERM. The first signal cancels the returned handle; another one, at least a second later, ends the
/// process with exit code 130. There is one handler per process, which may run the program several times (Python).
///
/// # Errors
/// The system refuses the handler.
pub(crate) fn cancel_by_signals() -> Result<CancelHandle> {
    let cancel = CancelHandle::new();
    let mut state = SIGNAL_STATE.lock().unwrap_or_else(PoisonError::into_inner);
    if state.is_none() {
        ctrlc::set_handler(|| {
            let now = Instant::now();
            let mut state = SIGNAL_STATE.lock().unwrap_or_else(PoisonError::into_inner);
            if state.as_mut().is_some_and(|state| state.signal(now)) {
                std::process::exit(130);
            }
        })
        .map_err(|e| Error::usage(format!("can't watch for signals: {e}")))?;
    }
    *state = Some(SignalState { cancel: cancel.clone(), first: None });
    Ok(cancel)
}

/// The last command line; a process may run the program several times (Python).
static COMMAND_LINE: Mutex<Vec<OsString>> = Mutex::new(Vec::new());

/// The arguments of the last command line, without the program's name.
pub(crate) fn arguments() -> impl Iterator<Item = OsString> {
    COMMAND_LINE.lock().unwrap_or_else(PoisonError::into_inner).clone().into_iter().skip(1)
}

/// Stores the command line for [`arguments`].
pub(crate) fn store_command_line(words: &[OsString]) {
    COMMAND_LINE.lock().unwrap_or_else(PoisonError::into_inner).clone_from(&words.to_vec());
}

/// Peak resident memory of the process, bytes; only on Linux.
pub(crate) fn peak_memory() -> Option<u64> {
    kib("/proc/self/status", "VmHWM:")
}

/// Resident memory of the process, bytes; only on Linux.
pub(crate) fn memory_now() -> Option<u64> {
    kib("/proc/self/status", "VmRSS:")
}

/// Memory of the machine, or the limit of the process's control group, bytes; only on Linux.
pub(crate) fn memory_of_machine() -> Option<u64> {
    let group_limit = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
    let group_limit = group_limit.and_then(|text| text.trim().parse().ok());
    kib("/proc/meminfo", "MemTotal:").into_iter().chain(group_limit).min()
}

/// Size of a file, bytes.
pub(crate) fn size_of(path: &Path) -> Option<u64> {
    std::fs::metadata(path).ok().map(|metadata| metadata.len())
}

/// A value in KiB from a file of `/proc`, as bytes.
fn kib(file: &str, key: &str) -> Option<u64> {
    let status = std::fs::read_to_string(file).ok()?;
    let line = status.lines().find(|l| l.starts_with(key))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

// Limits of time and memory for thumbnails, which end the process: thumbnailers handle untrusted files unattended, and any
// decoder may use too much.

/// Time between two checks of the limits.
const INTERVAL: Duration = Duration::from_millis(20);

/// Limits for one file; `None` for no limit.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limits {
    pub time: Option<Duration>,
    /// Resident memory of the process, bytes.
    pub memory: Option<u64>,
}

/// Enforces limits until it is dropped.
pub(super) struct Watchdog {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Watchdog {
    /// Starts the watchdog. If a limit is exceeded, the process ends with the error that `error` makes of the message.
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
        // Limits aren't enforced if no thread can be started.
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
    /// The message about an exceeded limit.
    fn reached(&self, start: Instant) -> Option<String> {
        if let Some(time) = self.time.filter(|time| start.elapsed() >= *time) {
            return Some(format!("takes longer than {} s (--time-limit)", time.as_secs_f64()));
        }
        let max = self.memory?;
        let used = memory_now().filter(|used| *used > max)?;
        let mib = |bytes: u64| bytes >> 20;
        Some(format!("takes {} MiB of memory, more than {} MiB (--memory-limit)", mib(used), mib(max)))
    }
}

/// Outcome of a command.
pub(crate) enum Outcome {
    Done,
    /// `compare`: the pictures disagree.
    Disagreement,
    /// Stopped by a signal; partial results were written.
    Interrupted,
    /// Some of several scenes failed, and the errors were printed; the highest exit code.
    Failed(u8),
}

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
    fn each_run_of_a_process_has_its_own_handle() {
        let first = cancel_by_signals().expect("a handler");
        let second = cancel_by_signals().expect("a handler");
        first.cancel();
        assert!(!second.is_cancelled());
    }

    #[test]
    fn further_signals_within_a_second_are_ignored() {
        let mut state = SignalState { cancel: CancelHandle::new(), first: None };
        let start = Instant::now();
        let after = |ms| start + Duration::from_millis(ms);
        assert!(!state.signal(start) && state.cancel.is_cancelled());
        assert!(!state.signal(after(1)) && !state.signal(after(999)));
        assert!(state.signal(after(1000)));
    }
}
