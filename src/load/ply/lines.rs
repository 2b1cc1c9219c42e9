//! Lines of a file, and the problem of one that ends too early.

use crate::error::Problem;
use ply_rs::ply::ElementDef;

/// The line's content and the offset of the next line; ends are LF, CR LF or CR.
pub(super) fn split_line(bytes: &[u8]) -> (&[u8], usize) {
    match bytes.iter().position(|&b| b == b'\n' || b == b'\r') {
        None => (bytes, bytes.len()),
        Some(end) => {
            let pair = bytes[end] == b'\r' && bytes.get(end + 1) == Some(&b'\n');
            (&bytes[..end], end + if pair { 2 } else { 1 })
        }
    }
}

/// The file ends inside row `i` of an element.
pub(super) fn cut(definition: &ElementDef, i: usize) -> Problem {
    let message = format!("the file ends inside '{}' {i} of {}", definition.name, definition.count);
    Problem::new("", message).with_help("export or download the file again")
}
