//! How commands end.

use oscura::error::{Error, ErrorKind};

/// How a command ended.
pub(crate) enum Outcome {
    /// As asked.
    Done,
    /// `compare` found that the pictures disagree.
    Disagreement,
    /// Stopped by a signal; what was there is written.
    Interrupted,
    /// Some of many failed, which has been said; the exit code of the worst.
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
