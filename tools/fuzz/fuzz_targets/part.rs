//! Files of accumulated samples: checkpoints and partial renders.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| oscura_fuzz::check_part(data));
