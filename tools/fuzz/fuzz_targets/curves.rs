//! Curve files, text and binary.
#![no_main]

use libfuzzer_sys::fuzz_target;

const SCENE: &[u8] = b"[materials.default]\ntype = \"hair\"\n[[curves]]\nfile = \"a.hair\"\nradius = 0.1\n";

fuzz_target!(|data: &[u8]| oscura_fuzz::check(&[("scene.toml", SCENE), ("a.hair", data)]));
