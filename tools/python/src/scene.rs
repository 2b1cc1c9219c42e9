//! The class of scenes; what is put into them stands in `materials.rs`, `objects.rs` and `lights.rs`.

use super::errors::{InputError, texts, usage};
use super::stage::{BackgroundArgument, Stage};
use oscura::load::{Loaded, stage};
use pyo3::prelude::*;
use std::sync::Arc;

/// A scene.
#[pyclass(module = "oscura")]
pub struct Scene {
    loaded: Arc<Loaded>,
    /// No colour of the background was chosen that would have to look as it was given.
    is_view_open: bool,
}

impl Scene {
    /// A scene that was loaded.
    pub fn of(loaded: Loaded, is_view_open: bool) -> Scene {
        Scene { loaded: Arc::new(loaded), is_view_open }
    }

    /// To render it.
    pub fn shared(&self) -> Arc<Loaded> {
        self.loaded.clone()
    }

    /// A stage lights it, and its pictures to look at are to have the filmic view.
    pub fn is_filmic(&self) -> bool {
        self.is_view_open && self.loaded.is_stage_lit
    }

    /// To change it.
    ///
    /// # Errors
    /// While another thread builds what a rendering needs of it.
    pub fn loaded_mut(&mut self) -> PyResult<&mut Loaded> {
        Arc::get_mut(&mut self.loaded).ok_or_else(|| {
            usage("another thread is loading the scene into the renderer; change it afterwards")
        })
    }

    /// To change what is in it.
    ///
    /// # Errors
    /// While another thread builds what a rendering needs of it.
    pub fn scene_mut(&mut self) -> PyResult<&mut oscura::scene::Scene> {
        Ok(&mut self.loaded_mut()?.scene)
    }
}

/// An id, if it is that of one of `count` things.
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

    /// Choices that were made.
    #[getter]
    fn notes(&self) -> Vec<String> {
        texts(&self.loaded.notes)
    }

    /// Names of the cameras; the first is used unless another is asked for.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        self.loaded.scene.cameras.iter().map(|camera| camera.name.clone()).collect()
    }

    /// Names of the materials, by their ids.
    #[getter]
    fn materials(&self) -> Vec<String> {
        self.loaded.scene.materials.iter().map(|material| material.name.clone()).collect()
    }

    /// Triangles as they are seen: those of all placed meshes.
    #[getter]
    fn triangles(&self) -> usize {
        let scene = &self.loaded.scene;
        let of = |instance: &oscura::scene::Instance| scene.meshes.get(instance.mesh.0 as usize);
        scene.instances.iter().filter_map(of).map(|mesh| mesh.triangles.len()).sum()
    }

    /// Adds what is missing: a camera that frames everything, light, a ground.
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

    /// Raises an error with all that is wrong with the scene.
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
