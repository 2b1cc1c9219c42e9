//! Scenes from files.

use super::choices;
use super::errors::raised;
use super::scene::Scene;
use super::stage::{BackgroundArgument, Stage};
use super::watch::watched;
use oscura::load::LoadOptions;
use oscura::load::blender::{BlenderOptions, default_cache};
use oscura::load::gltf::GltfOptions;
use oscura::render::{CancelHandle, in_pool};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Loads a scene: .gltf, .glb, .obj, .ply, .toml or .blend.
#[pyfunction]
#[pyo3(signature = (
    path, *, allow_external=false, up="auto", stage="studio", ground=None, background=None, view_from=None, zoom=1.0,
    fov=30.0, point_radius=None, smooth=None, subdivide=None, sidecar=true, time=None, scene=None, node=None, variant=None, light_units="auto",
    glass="auto", force=false, blender=None, threads=None
))]
#[expect(clippy::too_many_arguments, reason = "they are named in Python")]
pub fn load(
    py: Python<'_>,
    path: PathBuf,
    allow_external: bool,
    up: &str,
    stage: &str,
    ground: Option<&str>,
    background: Option<BackgroundArgument>,
    view_from: Option<&str>,
    zoom: f64,
    fov: f64,
    point_radius: Option<f64>,
    smooth: Option<f64>,
    subdivide: Option<u32>,
    sidecar: bool,
    time: Option<f64>,
    scene: Option<String>,
    node: Option<String>,
    variant: Option<String>,
    light_units: &str,
    glass: &str,
    force: bool,
    blender: Option<PathBuf>,
    threads: Option<usize>,
) -> PyResult<Scene> {
    let stage = Stage { stage, ground, background, view_from, zoom, fov };
    let is_view_open = stage.is_view_open();
    let options = LoadOptions {
        allow_external,
        blender: BlenderOptions { program: blender, cache: default_cache(), ..BlenderOptions::default() },
        gltf: GltfOptions {
            time_s: time,
            scene,
            node,
            variant,
            light_units: choices::light_units(light_units)?,
            glass: choices::glass(glass)?,
            force,
        },
        point_radius,
        smooth_rad: choices::crease(smooth)?,
        subdivision: choices::subdivision(subdivide)?,
        up: choices::up(up)?,
        stage: stage.options()?,
        no_sidecar: !sidecar,
        ..LoadOptions::default()
    };
    let threads = choices::checked_threads(threads)?;
    let loaded = watched(py, &CancelHandle::new(), None, |_news| {
        in_pool(threads, || oscura::load::load(&path, &options)).and_then(|loaded| loaded)
    })?;
    Ok(Scene::of(loaded.map_err(raised)?, is_view_open))
}
