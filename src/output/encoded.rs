//! What encoders return.

use crate::error::Warning;

/// A picture as the bytes of its file, and what was lost on the way.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// The whole file.
    pub bytes: Vec<u8>,
    /// Values that the format can't hold.
    pub warnings: Vec<Warning>,
}
