//! File readers: corner cases of each format, real and damaged files, and fuzzing regressions.

mod archives;
#[path = "../common/codes.rs"]
mod codes;
mod curves;
mod files;
mod gltf;
mod ies_profiles;
mod images;
mod instances;
mod linking;
mod obj_ply;
mod other_readers;
mod regressions;
mod scene_file;
mod scene_motion;
mod scene_reference;
mod sidecar;
#[path = "../common/skip.rs"]
mod skip;
mod subdivision;
mod three_mf;
mod unsupported;
