//! Files of sums (`.part`): a part of a picture, or one that is not finished. EXR can't hold them: sums are pairs of an f64
//! and an f32, and lists of ids, where EXR has no type above 32 bits.
//!
//! A file is: 16 bytes that tell what it is; the length of the head as a u64; the head, JSON; the film's sums; the picture
//! behind it, if any; what rendering needs to go on; and the CRC-32 of all that. Numbers are little-endian.

mod cover;
mod file;
mod header;

pub use cover::check_parts;
pub use file::{PartFile, read_header, read_part, write_part};
pub use header::{Behind, Channels, Effort, Finish, Identity, PRINT, PartHeader, Region, Way, differences};
