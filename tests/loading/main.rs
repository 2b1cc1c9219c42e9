//! Everything that reads files: each format's corners, real and damaged files, and what fuzzing found.

mod archives;
#[path = "../common/codes.rs"]
mod codes;
mod curves;
mod files;
mod gltf;
mod images;
mod instances;
mod left_out;
mod linking;
mod moving;
mod obj_ply;
mod oracles;
mod profiles;
mod regressions;
mod scene_file;
mod scene_reference;
mod sidecar;
#[path = "../common/skip.rs"]
mod skip;
mod subdivision;
mod threemf;
