//! What the program asks of the operating system: signals and its own memory.

use oscura::error::{Error, Result};
use oscura::render::CancelHandle;

/// Watches for Ctrl-C and SIGTERM. The first uses the handle that comes back; a second one ends the program at once.
///
/// # Errors
/// If the system refuses the handler.
pub(crate) fn cancel_by_signals() -> Result<CancelHandle> {
    let cancel = CancelHandle::new();
    let handle = cancel.clone();
    ctrlc::set_handler(move || {
        if handle.cancel() {
            std::process::exit(130);
        }
    })
    .map_err(|e| Error::usage(format!("can't watch for signals: {e}")))?;
    Ok(cancel)
}

/// The most memory that the process had, bytes; where the system tells (Linux).
pub(crate) fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}
