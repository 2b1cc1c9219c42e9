//! The class of scenes; methods that add to them are in `materials.rs`, `objects.rs` and `lights.rs`.

use super::errors::{InputError, texts, usage};
use super::stage::{BackgroundArgument, Stage};
use oscura::load::{Loaded, stage};
use pyo3::prelude::*;
use std::sync::Arc;

/// A scene.
#[pyclass(module = "oscura")]
pub struct Scene {
    loaded: Arc<Loaded>,
    /// No background colour was set, which would have to be displayed exactly.
    is_view_open: bool,
}

impl Scene {
    /// A loaded scene.
    pub fn of(loaded: Loaded, is_view_open: bool) -> Scene {
        Scene { loaded: Arc::new(loaded), is_view_open }
    }

    /// For rendering.
    pub fn shared(&self) -> Arc<Loaded> {
        self.loaded.clone()
    }

    /// Lit by the stage, and displayed with the filmic view transform.
    pub fn is_filmic(&self) -> bool {
        self.is_view_open && self.loaded.is_stage_lit
    }

    /// For changes.
    ///
    /// # Errors
    /// While another thread compiles the scene.
    pub fn loaded_mut(&mut self) -> PyResult<&mut Loaded> {
        Arc::get_mut(&mut self.loaded).ok_or_else(|| {
            usage("another thread is loading the scene into the renderer; change it afterwards")
        })
    }

    /// For changes of its contents.
    ///
    /// # Errors
    /// While another thread compiles the scene.
    pub fn scene_mut(&mut self) -> PyResult<&mut oscura::scene::Scene> {
        Ok(&mut self.loaded_mut()?.scene)
    }
}

/// An id, if it is below `count`.
pub fn checked(what: &str, id: u32, count: usize) -> PyResult<u32> {
    match (id as usize) < count {
        true => Ok(id),
        false => Err(usage(format!("there is no {what} {id}; the scene has {count}"))),
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (name=""))]
    fn new(name: &str) -> Scene {
        let scene = oscura::scene::Scene { name: name.to_string(), ..Default::default() };
        Scene::of(scene.into(), true)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.loaded.scene.name
    }

    /// What was ignored, approximated or repaired.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        texts(&self.loaded.warnings)
    }

    /// Automatic choices.
    #[getter]
    fn notes(&self) -> Vec<String> {
        texts(&self.loaded.notes)
    }

    /// Names of the cameras; the first is the default.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        self.loaded.scene.cameras.iter().map(|camera| camera.name.clone()).collect()
    }

    /// Names of the materials, by id.
    #[getter]
    fn materials(&self) -> Vec<String> {
        self.loaded.scene.materials.iter().map(|material| material.name.clone()).collect()
    }

    /// Number of triangles including instances.
    #[getter]
    fn triangles(&self) -> usize {
        let scene = &self.loaded.scene;
        let of = |instance: &oscura::scene::Instance| scene.meshes.get(instance.mesh.0 as usize);
        scene.instances.iter().filter_map(of).map(|mesh| mesh.triangles.len()).sum()
    }

    /// Adds what is missing: a camera that frames everything, lights, a ground.
    #[pyo3(signature = (*, stage="studio", ground=None, background=None, view_from=None, zoom=1.0, fov=30.0))]
    fn complete(
        &mut self,
        stage: &str,
        ground: Option<&str>,
        background: Option<BackgroundArgument>,
        view_from: Option<&str>,
        zoom: f64,
        fov: f64,
    ) -> PyResult<()> {
        let shown = Stage { stage, ground, background, view_from, zoom, fov };
        let is_view_open = shown.is_view_open();
        let options = shown.options()?;
        self.validate()?;
        stage::complete(self.loaded_mut()?, &options, false);
        self.is_view_open = is_view_open;
        Ok(())
    }

    /// Raises an error with all problems of the scene.
    fn validate(&self) -> PyResult<()> {
        let problems: Vec<String> =
            self.loaded.scene.validate().iter().map(|problem| problem.to_string()).collect();
        if problems.is_empty() { Ok(()) } else { Err(InputError::new_err(problems.join("\n"))) }
    }

    fn __repr__(&self) -> String {
        let scene = &self.loaded.scene;
        format!(
            "<oscura.Scene {:?}: {} triangles, {} shapes, {} quads, {} materials, {} lights, {} cameras>",
            scene.name,
            self.triangles(),
            scene.shapes.len(),
            scene.quads.len(),
            scene.materials.len(),
            scene.lights.len(),
            scene.cameras.len()
        )
    }
}
