//! glTF as text or binary, distinguished by the first bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let name = if data.starts_with(b"glTF") { "a.glb" } else { "a.gltf" };
    oscura_fuzz::check(&[(name, data)]);
});
