//! Runs work in a thread of its own, without the GIL, while handling Python's signals.

use oscura::render::CancelHandle;
use pyo3::prelude::*;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

/// Interval between signal checks.
const PAUSE: Duration = Duration::from_millis(50);

/// Progress of the work.
#[derive(Clone, Copy)]
pub struct Progress {
    /// Fraction of all samples, 0..1.
    pub share: f64,
    pub elapsed: Duration,
}

/// Does the work, and calls `listener(share, seconds)` in the calling thread meanwhile. Ctrl-C and exceptions of the listener
/// stop it by the handle; they are raised when the work has ended.
pub fn watched<R: Send>(
    py: Python<'_>,
    cancel: &CancelHandle,
    listener: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(Sender<Progress>) -> R + Send,
) -> PyResult<R> {
    let (sender, mut progress) = channel();
    thread::scope(|scope| {
        let worker = scope.spawn(move || work(sender));
        let mut failure = None;
        loop {
            let (newest, is_over) = py.detach(|| newest(&mut progress));
            if let Err(error) = notify(py, listener, newest)
                && failure.is_none()
            {
                cancel.cancel();
                failure = Some(error);
            }
            if is_over {
                break;
            }
        }
        let result = py.detach(|| worker.join());
        let result = result.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        failure.map_or(Ok(result), Err)
    })
}

/// Waits for progress; returns the latest, and whether more can follow.
fn newest(progress: &mut Receiver<Progress>) -> (Option<Progress>, bool) {
    match progress.recv_timeout(PAUSE) {
        Ok(first) => (Some(progress.try_iter().last().unwrap_or(first)), false),
        Err(RecvTimeoutError::Timeout) => (None, false),
        Err(RecvTimeoutError::Disconnected) => (None, true),
    }
}

/// Calls the listener, and lets Python handle signals.
fn notify(py: Python<'_>, listener: Option<&Bound<'_, PyAny>>, progress: Option<Progress>) -> PyResult<()> {
    py.check_signals()?;
    if let Some((listener, Progress { share, elapsed })) = listener.zip(progress) {
        listener.call1((share, elapsed.as_secs_f64()))?;
    }
    Ok(())
}
