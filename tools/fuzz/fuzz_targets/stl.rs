//! STL files, binary and ASCII.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| oscura_fuzz::check(&[("a.stl", data)]));
