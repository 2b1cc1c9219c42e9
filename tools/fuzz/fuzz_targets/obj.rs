//! An OBJ file; text after a line `#mtl` is its material library.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let (obj, mtl) = oscura_fuzz::split(data, b"#mtl\n");
    oscura_fuzz::check(&[("a.obj", obj), ("a.mtl", mtl)]);
});
