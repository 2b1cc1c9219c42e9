//! Rendering.

use super::choices::{checked_threads, parsed};
use super::errors::{raised, usage};
use super::picture::Picture;
use super::scene::Scene;
use super::watch::{Progress, watched};
use oscura::Renderer;
use oscura::film::{Aov, AovSet};
use oscura::render::{CancelHandle, Event, in_pool};
use pyo3::prelude::*;
use std::sync::mpsc::Sender;
use std::time::Duration;

/// AOVs by name; `all` selects all.
fn aov_set(names: &[String]) -> PyResult<AovSet> {
    names.iter().try_fold(AovSet::NONE, |set, name| match name.as_str() {
        "all" => Ok(AovSet::all()),
        name => name.parse::<Aov>().map(|aov| set.with(aov)).map_err(raised),
    })
}

/// Renders until finished or stopped.
fn run(renderer: Renderer, news: Sender<Progress>) -> oscura::Result<oscura::Picture> {
    let renderer = renderer.on_event(move |event| {
        if let Event::Progress { samples_done, samples_total, elapsed, .. } = event {
            let share = (samples_done as f64 / samples_total.max(1) as f64).min(1.0);
            // The receiver lives as long as the renderer.
            let _ = news.send(Progress { share, elapsed });
        }
    });
    renderer.render()
}

/// Renders a picture of a scene.
#[pyfunction]
#[pyo3(signature = (
    scene, *, samples=None, width=None, height=None, max_depth=None, seed=None, camera=None, aovs=vec![],
    light_groups=false, crypto_levels=6, denoise=false, caustics="auto", guiding="auto", path_reuse="auto", splitting="auto",
    time_limit=None, exposure=None, threads=None, progress=None
))]
#[expect(clippy::too_many_arguments, reason = "they are named in Python")]
pub fn render(
    py: Python<'_>,
    scene: &Bound<'_, Scene>,
    samples: Option<u32>,
    width: Option<u32>,
    height: Option<u32>,
    max_depth: Option<u32>,
    seed: Option<u32>,
    camera: Option<Bound<'_, PyAny>>,
    aovs: Vec<String>,
    light_groups: bool,
    crypto_levels: u32,
    denoise: bool,
    caustics: &str,
    guiding: &str,
    path_reuse: &str,
    splitting: &str,
    time_limit: Option<f64>,
    exposure: Option<f32>,
    threads: Option<usize>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<Picture> {
    let (loaded, is_filmic) = {
        let scene = scene.borrow();
        (scene.shared(), scene.is_filmic())
    };
    if samples == Some(0) || !(1..=64).contains(&crypto_levels) {
        return Err(usage("samples must be 1 or more, crypto_levels 1 to 64"));
    }
    let threads = checked_threads(threads)?;
    if exposure.is_some_and(|stops| !(-100.0..=100.0).contains(&stops)) {
        return Err(usage("exposure must be -100 to 100 stops"));
    }
    let time_limit = time_limit.map(Duration::try_from_secs_f64).transpose();
    let time_limit = time_limit.map_err(|_| usage("time_limit must be seconds, 0 or more"))?;
    let cancel = CancelHandle::new();
    let mut renderer = Renderer::shared(loaded)
        .aovs(aov_set(&aovs)?)
        .denoise(denoise)
        .light_groups(light_groups)
        .matte_levels(crypto_levels)
        .caustics(parsed("caustics", caustics)?)
        .guiding(parsed("guiding", guiding)?)
        .path_reuse(parsed("path_reuse", path_reuse)?)
        .splitting(parsed("splitting", splitting)?)
        .time_limit(time_limit)
        .cancel_by(&cancel);
    renderer = chosen(renderer, samples, Renderer::samples);
    renderer = chosen(renderer, width, Renderer::width);
    renderer = chosen(renderer, height, Renderer::height);
    renderer = chosen(renderer, max_depth, Renderer::max_depth);
    renderer = chosen(renderer, seed, Renderer::seed);
    renderer = chosen(renderer, exposure, Renderer::exposure);
    if let Some(camera) = camera {
        renderer = renderer.camera(camera.str()?.to_cow()?);
    }
    let picture = watched(py, &cancel, progress.as_ref(), |news| {
        in_pool(threads, || run(renderer, news)).and_then(|picture| picture)
    })?;
    Ok(Picture::of(picture.map_err(raised)?, is_filmic))
}

/// Applies an optional choice.
fn chosen<T>(renderer: Renderer, choice: Option<T>, make: impl Fn(Renderer, T) -> Renderer) -> Renderer {
    match choice {
        Some(value) => make(renderer, value),
        None => renderer,
    }
}
