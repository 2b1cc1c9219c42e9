//! How commands end.

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
