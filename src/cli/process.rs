//! What the program asks of the operating system: signals and its own memory.

use oscura::error::{Error, Result};
use oscura::render::CancelHandle;
use std::path::Path;

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
