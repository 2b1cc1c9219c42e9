//! The XML of a 3MF package; the target wraps it in the package.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    oscura_fuzz::check(&[("a.3mf", &oscura_fuzz::stored("3D/3dmodel.model", data))]);
});
