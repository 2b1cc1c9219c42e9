//! Turns a scene into what the renderer needs.

use crate::error::{Error, Result, Warning};
use crate::film::AovSet;
use crate::math::DMat4;
use crate::scene::{Microfacet, Scene};

/// What to compile for.
#[derive(Clone, Copy, Debug)]
pub struct CompileOptions {
    /// Microfacet model.
    pub microfacet: Microfacet,
    /// Which camera.
    pub camera: Option<usize>,
    /// Picture width.
    pub width: u32,
    /// Picture height.
    pub height: u32,
    /// AOVs that will be asked for.
    pub needs: AovSet,
}

/// What compiling did.
#[derive(Clone, Debug, Default)]
pub struct CompileReport {
    /// Seconds it took.
    pub build_s: f64,
    /// What was repaired or ignored.
    pub warnings: Vec<Warning>,
    /// What was left out.
    pub left_out: Vec<String>,
    /// Triangles.
    pub triangles: u64,
    /// Quads.
    pub quads: u64,
    /// Spheres.
    pub spheres: u64,
    /// Lights.
    pub lights: u64,
    /// Memory.
    pub bytes: u64,
    /// Camera matrix.
    pub world_to_camera: DMat4,
}

/// A scene ready to render.
#[derive(Debug)]
pub struct CompiledScene {}

/// Compiles.
pub fn compile(_scene: &Scene, _options: &CompileOptions) -> Result<(CompiledScene, CompileReport)> {
    Err(Error::usage("compile: not written yet"))
}
