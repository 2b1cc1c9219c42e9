//! An offline renderer: glTF, OBJ, PLY and analytic shapes in, high dynamic range EXR and PNG out, by unbiased
//! path tracing on the CPU.
//!
//! ```no_run
//! use oscura::Renderer;
//! let scene = oscura::load("assets/cornell-box.gltf")?;
//! Renderer::new(scene).samples(64).render()?.save("cornell.exr")?;
//! # Ok::<(), oscura::Error>(())
//! ```
//!
//! | to | use |
//! |---|---|
//! | load a scene | [`load()`], [`load::load`] with options |
//! | build one in code, or change it | [`scene::Scene`] |
//! | light a scene by an environment map | [`load::image::load_environment`], [`scene::Environment::Image`] |
//! | render | [`Renderer`]; [`Renderer::start`] to render pass by pass |
//! | record depth, normals and the like (AOVs) | [`Renderer::aovs`], [`film::Aov`] |
//! | denoise | [`Renderer::denoise`]; [`render::Rendering::denoise`] between passes |
//! | read pixels | [`Picture::film`], [`film::Film`] |
//! | write EXR and PNG | [`Picture::save`], [`Picture::save_with`] |
//! | handle errors | [`Error`], [`Picture::warnings`] |
//!
//! `examples/` has example programs.
//!
//! ## In your `Cargo.toml`
//!
//! Without default features, the command line and the decoders of Draco, Basis Universal, TIFF and WebP
//! (`features = ["decoders"]`) are not built. Cargo ignores the profiles of dependencies, so repeat them: unoptimised,
//! rendering takes thirty times as long.
//!
//! ```toml
//! [dependencies]
//! oscura = { version = "0.1", default-features = false }
//!
//! [profile.dev.package."*"]
//! opt-level = 3
//!
//! [profile.release.package."*"]
//! codegen-units = 1
//! [profile.release.package.oscura]
//! codegen-units = 4
//! # Large, and not performance-critical.
//! [profile.release.package.image]
//! opt-level = 1
//! [profile.release.package.gltf]
//! opt-level = 0
//! [profile.release.package.gltf-json]
//! opt-level = 0
//! [profile.release.package.moxcms]
//! opt-level = 0
//! [profile.release.package.pxfm]
//! opt-level = 0
//! ```
//!
//! ## Conventions
//! - Metres, seconds, radians (names of angles end in `_rad` where ambiguous; scene files use degrees).
//! - Right-handed, y up; cameras look down -z, as in glTF.
//! - Colours are linear Rec. 709 and scene-referred; emission is radiance.
//! - Random numbers are a pure function of (pixel, sample, dimension, seed, planned samples). Rendering is deterministic for
//!   any number of threads and on every CPU level.
//! - Vectors and transforms are those of [`glam`].
//!
//! Undocumented public items are for the project's own tests and tools, and may change with any version.

// For developers:
//
//     files -> load -> scene -> compile -> integrator -> film -> output -> files
//              (I/O)   (plain    (BVH, lights, (radiance   (pixels,   (EXR, PNG)
//                       data)     textures)     per path)   AOVs)
//
// - `wo` points to the viewer, `wi` to the light; both point away from the surface. `f_cos` includes |cos|.
// - A pdf names its measure (`pdf_solid_angle`, `pdf_area`, `pdf_discrete`), a transform its spaces
//   (`world_from_object`).
// - Transforms compose in f64; `compile` moves the origin near the camera, so that f32 geometry is precise wherever the
//   scene is in the world.
// - Modules are layered; each imports lower layers only (`tests/structure/layering.rs`).

#![deny(unsafe_code)]

/// The README's example, as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[macro_use]
mod named;

pub mod error;
pub mod film;
#[cfg(doc)]
pub mod guide;
pub mod image;
pub mod load;
pub mod output;
pub mod render;
pub mod scene;
pub mod work_counter;

pub use error::{Error, Result};
pub use glam;
pub use render::{Picture, Renderer};

use std::path::Path;

/// Loads a scene from a `.gltf`, `.glb`, `.obj`, `.ply` or `.toml` file, identified by the extension; [`load::load`] takes
/// options.
///
/// # Errors
/// An input error with all problems of the file.
pub fn load(path: impl AsRef<Path>) -> Result<load::Loaded> {
    load::load(path, &load::LoadOptions::default())
}

// Modules of the program refer to the library by its crate name, since they are also compiled as part of the binary.
#[cfg(feature = "program")]
extern crate self as oscura;

#[doc(hidden)]
pub mod accel;
#[doc(hidden)]
pub mod bsdf;
#[doc(hidden)]
pub mod camera;
// The program must handle future variants of non-exhaustive enums, which are exhaustive within the library.
#[cfg(feature = "program")]
#[doc(hidden)]
#[allow(irrefutable_let_patterns, unreachable_patterns)]
pub mod cli;
#[doc(hidden)]
pub mod color;
#[doc(hidden)]
pub mod compile;
#[doc(hidden)]
pub mod denoise;
#[doc(hidden)]
pub mod integrator;
#[doc(hidden)]
pub mod light;
#[doc(hidden)]
pub mod math;
#[doc(hidden)]
pub mod metrics;
#[doc(hidden)]
pub mod sampling;
#[doc(hidden)]
pub mod shape;
#[doc(hidden)]
pub mod simd;
#[doc(hidden)]
pub mod texture;
