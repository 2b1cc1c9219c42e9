//! Pictures of whole scenes: against closed forms, references and each other.

mod adaptive;
mod blur;
mod catcher;
mod caustics;
mod closed_form;
mod compile_scene;
mod converged;
mod determinism;
mod lamps;
mod media;
mod media_edges;
mod one_sided;
mod parts;
mod passes;
mod path_reuse;
mod references;
mod reuse;
mod sheets;
mod solids;
mod splitting;
mod stepping;
mod support;
mod textured;
mod trees;
mod validated;
mod visibility;
