//! Damaged files give errors, never a panic.

use super::binary_ply;
use crate::files::{load_files, refused_copies};

#[test]
fn damaged_files_never_panic() {
    let text = b"o x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\ns 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -1 -2 -3\n";
    let ascii = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let seeds = [
        ("a.obj", text.to_vec()),
        ("b.ply", ascii.to_vec()),
        ("c.ply", binary_ply(false)),
        ("d.ply", binary_ply(true)),
    ];
    let refused: usize = seeds
        .iter()
        .map(|(name, original)| {
            let is_refused = |bytes: &[u8]| load_files(&[(name, bytes)]).is_err();
            refused_copies(original, b"-/ 0123456789.\n", 1500, is_refused)
        })
        .sum();
    assert!(refused > 2000, "only {refused} of 6000 were refused");
}
