//! Gaussian splats: an SPZ file, or a PLY by its first bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let name = if data.starts_with(b"ply") { "a.ply" } else { "a.spz" };
    oscura_fuzz::check(&[(name, data)]);
});
