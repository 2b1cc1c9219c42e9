//! Renders a scene at increasing sample counts and measures time and error.

use oscura::compile::{CompileOptions, CompiledScene, choose_camera, compile};
use oscura::error::Result;
use oscura::film::Film;
use oscura::image::Image;
use oscura::load::{LoadOptions, load};
use oscura::metrics::errors;
use oscura::render::{RenderOptions, Rendering};
use oscura::scene::{Camera, Filter};
use std::path::Path;
use std::sync::Arc;

/// Settings of the measurement.
pub struct Setup {
    /// Width of the pictures; the height follows the camera.
    pub width: u32,
    /// Samples per pixel to measure at.
    pub ladder: Vec<u32>,
    /// Samples per pixel of the reference.
    pub reference: u32,
    /// Maximum path length.
    pub depth: u32,
    /// Threads.
    pub threads: Option<usize>,
}

/// One measurement.
pub struct Point {
    /// Name of the scene's file.
    pub scene: String,
    /// Samples per pixel.
    pub samples: u32,
    /// Wall-clock time, seconds.
    pub render_s: f64,
    /// CPU time of all threads, seconds.
    pub render_cpu_s: f64,
    /// Rays traced.
    pub rays: u64,
    /// relMSE minus that of the reference.
    pub rel_mse: f64,
    /// relMSE of the reference.
    pub reference_rel_mse: f64,
}

/// A scene to be rendered many times.
pub struct Subject {
    /// Name of its file.
    pub name: String,
    scene: Arc<CompiledScene>,
    camera: Camera,
    size: [u32; 2],
    depth: u32,
}

impl Subject {
    /// Loads and compiles a scene.
    pub fn new(path: &Path, setup: &Setup) -> Result<Subject> {
        let scene = load(path, &LoadOptions::default())?.scene;
        let aspect = match (scene.settings.width, scene.settings.height) {
            (Some(w), Some(h)) => f64::from(w) / f64::from(h.max(1)),
            _ => scene.cameras.first().and_then(|c| c.aspect_ratio).unwrap_or(16.0 / 9.0),
        };
        let height = (f64::from(setup.width) / aspect).round().clamp(1.0, 65_536.0) as u32;
        let options = CompileOptions { shading: scene.settings.shading(), ..CompileOptions::default() };
        let (compiled, _) = compile(&scene, &options)?;
        Ok(Subject {
            name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            camera: choose_camera(&scene, None)?.clone(),
            scene: Arc::new(compiled),
            size: [setup.width, height],
            depth: setup.depth,
        })
    }

    /// Width and height of its pictures.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// A new rendering of it.
    pub fn rendering(&self, samples: u32, seed: u32, noise: Option<f32>) -> Result<Rendering> {
        self.rendering_with(samples, seed, |options| options.noise(noise))
    }

    /// The same with other options.
    pub fn rendering_with(
        &self,
        samples: u32,
        seed: u32,
        change: impl Fn(RenderOptions) -> RenderOptions,
    ) -> Result<Rendering> {
        let [width, height] = self.size;
        let options = RenderOptions::default().size(width, height).samples(samples).seed(seed);
        let options = change(options.max_depth(self.depth).filter(Filter::Box));
        Rendering::new(self.scene.clone(), &self.camera, options)
    }

    /// A converged picture of a number of samples, and its own relMSE.
    pub fn reference(&self, samples: u32) -> Result<(Image, f64)> {
        let half = |seed: u32| -> Result<Image> {
            let mut rendering = self.rendering(samples.div_ceil(2), seed, None)?;
            rendering.run();
            Ok(to_image(rendering.film()))
        };
        let halves = [half(1_000_001)?, half(1_000_002)?];
        let reference = mean(&halves[0], &halves[1]);
        // Each half differs from their mean by (a - b) / 2, whose square is also the variance of the mean.
        let own = errors(&halves[0], &reference).rel_mse;
        Ok((reference, own))
    }
}

/// Measures one scene at every step of the ladder.
pub fn measure(path: &Path, setup: &Setup) -> Result<Vec<Point>> {
    let subject = Subject::new(path, setup)?;
    let (reference, reference_rel_mse) = subject.reference(setup.reference)?;
    let point = |&samples: &u32| {
        let mut rendering = subject.rendering(samples, 1, None)?;
        rendering.run();
        let statistics = rendering.statistics();
        Ok(Point {
            scene: subject.name.clone(),
            samples,
            render_s: statistics.render_s,
            render_cpu_s: statistics.render_cpu_s,
            rays: statistics.rays,
            rel_mse: errors(&to_image(rendering.film()), &reference).rel_mse - reference_rel_mse,
            reference_rel_mse,
        })
    };
    setup.ladder.iter().map(point).collect()
}

/// The colour of a film.
pub fn to_image(film: &Film) -> Image {
    let rgb = film.rgba().into_iter().flat_map(|[r, g, b, _]| [r, g, b]).collect();
    Image::from_linear_rgb("render", film.width(), film.height(), rgb)
}

fn mean(a: &Image, b: &Image) -> Image {
    let pixels = (0..a.height).flat_map(|y| (0..a.width).map(move |x| (x, y)));
    let rgb = pixels.flat_map(|(x, y)| {
        let (p, q) = (a.rgba(x, y), b.rgba(x, y));
        [0, 1, 2].map(|c| 0.5 * (p[c] + q[c]))
    });
    Image::from_linear_rgb("reference", a.width, a.height, rgb.collect())
}
