//! An OpenVDB file, as the medium of a box.
#![no_main]

use libfuzzer_sys::fuzz_target;

const SCENE: &[u8] = b"[materials]\na = { type = \"medium\", grid = \"a.vdb\" }\n[[objects]]\nbox = { min = [0, 0, 0], max = [1, 1, 1] }\nmaterial = \"a\"\n";

fuzz_target!(|data: &[u8]| {
    oscura_fuzz::check(&[("scene.toml", SCENE), ("a.vdb", data)]);
});
