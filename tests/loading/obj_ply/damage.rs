//! Damaged files give errors, never a panic.

use super::binary_ply;
use oscura::load::{LoadOptions, load};
use oscura::sampling::hash::SplitMix64;

/// A number for damaging files: the same ones on every run.
fn random(stream: &mut SplitMix64) -> usize {
    (stream.next_bits() >> 1) as usize
}

#[test]
fn damaged_files_never_panic() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = b"o x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\ns 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf -1 -2 -3\n";
    let ascii = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let seeds = [
        ("a.obj", text.to_vec()),
        ("b.ply", ascii.to_vec()),
        ("c.ply", binary_ply(false)),
        ("d.ply", binary_ply(true)),
    ];
    let (mut stream, mut refused) = (SplitMix64::new(2), 0);
    for (name, original) in &seeds {
        let path = folder.path().join(name);
        for _ in 0..1500 {
            let mut bytes = original.clone();
            for _ in 0..1 + random(&mut stream) % 3 {
                let at = random(&mut stream) % bytes.len();
                let usual = b"-/ 0123456789.\n"[random(&mut stream) % 15];
                match random(&mut stream) % 4 {
                    0 => bytes[at] = random(&mut stream) as u8,
                    1 => bytes[at] = usual,
                    2 => bytes.insert(at, usual),
                    _ => bytes.truncate(at.max(1)),
                }
            }
            std::fs::write(&path, &bytes).expect("written");
            refused += usize::from(load(&path, &LoadOptions::default()).is_err());
        }
    }
    assert!(refused > 2000, "only {refused} of 6000 were refused");
}
