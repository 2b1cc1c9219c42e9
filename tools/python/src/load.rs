//! Scenes from files.

use super::choices;
use super::errors::{raised, usage};
use super::scene::Scene;
use super::watch::watched;
use oscura::load::LoadOptions;
use oscura::load::blender::{BlenderOptions, default_cache};
use oscura::load::gltf::GltfOptions;
use oscura::load::stage::{Background, StageOptions};
use oscura::render::{CancelHandle, in_pool};
use pyo3::prelude::*;
use std::path::PathBuf;

/// What is behind everything, from Python.
#[derive(FromPyObject)]
pub enum BackgroundArgument {
    Word(String),
    Color([f32; 3]),
}

/// How bare models are shown, by words.
pub struct Stage<'a> {
    pub stage: &'a str,
    pub ground: Option<&'a str>,
    pub background: Option<BackgroundArgument>,
    pub view_from: Option<&'a str>,
    pub zoom: f64,
    pub fov: f64,
}

impl Stage<'_> {
    pub fn options(self) -> PyResult<StageOptions> {
        let light = choices::stage(self.stage)?;
        if !(0.001..=1000.0).contains(&self.zoom) || !(0.1..=170.0).contains(&self.fov) {
            return Err(usage("zoom must be 0.001 to 1000 and fov 0.1 to 170 degrees"));
        }
        let background = match self.background {
            None => None,
            Some(BackgroundArgument::Color(color)) => Some(Background::Color(color)),
            Some(BackgroundArgument::Word(word)) if word == "transparent" => Some(Background::Transparent),
            Some(BackgroundArgument::Word(word)) => {
                let message = "is neither 'transparent' nor three numbers (linear red, green, blue)";
                return Err(usage(format!("background='{word}' {message}")));
            }
        };
        Ok(StageOptions {
            light,
            ground: self.ground.map(choices::ground).transpose()?,
            background,
            view: self.view_from.map(choices::view_from).transpose()?.unwrap_or_default(),
            is_view_chosen: self.view_from.is_some(),
            zoom: self.zoom,
            vfov_degrees: self.fov,
            ..StageOptions::default()
        })
    }
}

/// Loads a scene: .gltf, .glb, .obj, .ply, .toml or .blend.
#[pyfunction]
#[pyo3(signature = (
    path, *, allow_external=false, up="auto", stage="studio", ground=None, background=None, view_from=None, zoom=1.0,
    fov=30.0, point_radius=None, sidecar=true, time=None, scene=None, node=None, variant=None, light_units="auto",
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
    let is_view_open = stage != "white" && !matches!(background, Some(BackgroundArgument::Color(_)));
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
        up: choices::up(up)?,
        stage: Stage { stage, ground, background, view_from, zoom, fov }.options()?,
        no_sidecar: !sidecar,
        ..LoadOptions::default()
    };
    let threads = choices::checked_threads(threads)?;
    let loaded = watched(py, &CancelHandle::new(), None, |_news| {
        in_pool(threads, || oscura::load::load(&path, &options)).and_then(|loaded| loaded)
    })?;
    Ok(Scene::of(loaded.map_err(raised)?, is_view_open))
}
