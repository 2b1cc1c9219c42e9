//! A scene file, alone and as a sidecar; text after a line `#obj` is the mesh `a.obj` that it may reference.
#![no_main]

use libfuzzer_sys::fuzz_target;

const TRIANGLE: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fuzz_target!(|data: &[u8]| {
    let (toml, obj) = oscura_fuzz::split(data, b"#obj\n");
    let obj = if obj.is_empty() { TRIANGLE } else { obj };
    oscura_fuzz::check(&[("scene.toml", toml), ("a.obj", obj)]);
    oscura_fuzz::check(&[("b.obj", TRIANGLE), ("b.oscura.toml", toml), ("a.obj", obj)]);
});
