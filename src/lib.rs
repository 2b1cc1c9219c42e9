//! # oscura
//!
//! An offline renderer: glTF, OBJ, PLY and analytic shapes in, high dynamic range EXR and PNG out, by unbiased
//! path tracing on the CPU.
//!
//! ```text
//! files -> load -> scene -> compile -> integrator -> film -> output -> files
//!          (I/O)   (plain    (BVH, lights, (radiance   (pixels,   (EXR, PNG)
//!                   data)     textures)     per path)   AOVs)
//! ```
//!
//! ## Conventions
//! - Metres, seconds, radians (names end in `_rad` where degrees could be meant; scene files use degrees).
//! - Right-handed, y up; cameras look down -z, as in glTF.
//! - Colours are linear Rec. 709 and scene-referred; emission is radiance.
//! - `wo` points to the viewer, `wi` to where the light comes from; both leave the surface. `f_cos` includes |cos|.
//! - A pdf names its measure (`pdf_solid_angle`, `pdf_area`, `pdf_discrete`), a transform its spaces
//!   (`world_from_object`).
//! - Transforms compose in f64; [`compile`] moves the origin near the camera, so that f32 geometry keeps its
//!   precision wherever in the world the scene stands.
//! - Randomness is a pure function of (pixel, sample, dimension, seed). The same command gives the same pixels at any
//!   number of threads and on every CPU level.
//!
//! Modules are ranked; each imports lower ranks only (`tests/structure/layering.rs` holds the table).

#![deny(unsafe_code)]

/// The README's example, as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod color;
pub mod error;
pub mod math;
pub mod simd;

pub mod image;
pub mod metrics;
pub mod sampling;

pub mod scene;

pub mod camera;

pub mod load;

pub mod bsdf;
pub mod shape;
pub mod texture;

pub mod light;

pub mod accel;

pub mod compile;
pub mod film;

pub mod integrator;

pub mod render;

pub mod output;
