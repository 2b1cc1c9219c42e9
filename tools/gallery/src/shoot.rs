//! Renders one scene with its own settings.

use oscura::compile::{CompileOptions, View, choose_camera, compile};
use oscura::error::{Error, Result};
use oscura::film::Film;
use oscura::load::{LoadOptions, load};
use oscura::output::{Format, Metadata, OutputOptions, PngOptions, ViewTransform, encode, write_atomically};
use oscura::render::{RenderOptions, Renderer, in_pool};
use oscura::scene::Scene;
use std::path::Path;
use std::time::Instant;

/// Smallest width that a picture is made narrower to.
const LEAST_WIDTH: u32 = 100;

/// How to render all scenes.
#[derive(Clone, Copy, Debug)]
pub struct Quality {
    /// Divides widths and heights, of large pictures.
    pub shrink: u32,
    /// Divides samples.
    pub fewer: u32,
    /// Threads; all cores without.
    pub threads: Option<usize>,
}

/// A picture with what it took.
pub struct Shot {
    /// The picture.
    pub film: Film,
    /// The settings it was made with.
    pub options: RenderOptions,
    /// Reading and compiling, seconds.
    pub load_s: f64,
    /// Rendering, seconds.
    pub render_s: f64,
    /// Rendering, seconds of all cores together.
    pub render_cpu_s: f64,
    /// Exposure of the PNG, stops.
    exposure: f32,
}

impl Shot {
    /// Reads, compiles and renders a scene.
    ///
    /// # Errors
    /// What loading and compiling report, and warnings too: the scenes of the gallery have none.
    pub fn take(path: &Path, quality: Quality) -> Result<Shot> {
        in_pool(quality.threads, || Shot::take_here(path, quality))?
    }

    fn take_here(path: &Path, quality: Quality) -> Result<Shot> {
        let start = Instant::now();
        let mut loaded = load(path, &LoadOptions::default())?;
        let options = options(&loaded.scene, quality, path)?;
        let compile_options =
            CompileOptions { shading: loaded.scene.settings.shading(), ..CompileOptions::default() };
        let (compiled, report) = compile(&loaded.scene, &compile_options)?;
        loaded.warnings.extend(report.warnings);
        if let Some(warning) = loaded.warnings.first() {
            return Err(Error::input(path, format!("renders with a warning: {warning}")));
        }
        let camera = choose_camera(&loaded.scene, None)?;
        let view = View::new(&compiled, camera, options.width, options.height);
        let load_s = start.elapsed().as_secs_f64();
        let mut renderer = Renderer::new(compiled, view, options)?;
        renderer.run();
        let statistics = renderer.statistics();
        if statistics.invalid_samples > 0 {
            let message = format!("{} samples were NaN or infinite", statistics.invalid_samples);
            return Err(Error::input(path, message));
        }
        Ok(Shot {
            film: renderer.into_film(),
            options,
            load_s,
            render_s: statistics.render_s,
            render_cpu_s: statistics.render_cpu_s,
            exposure: loaded.scene.settings.exposure.unwrap_or(0.0),
        })
    }

    /// Writes `NAME.exr` and `NAME.png` into a folder.
    ///
    /// # Errors
    /// Where a file can't be written.
    pub fn write(&self, folder: &Path, name: &str) -> Result<()> {
        let output = OutputOptions {
            png: PngOptions { exposure: self.exposure, ..PngOptions::default() },
            metadata: Metadata {
                samples: self.options.samples.into(),
                seed: self.options.seed,
                render_s: Some(self.render_s),
                ..Metadata::default()
            },
            ..OutputOptions::default()
        };
        for (format, extension) in [(Format::Exr, "exr"), (Format::Png, "png")] {
            let path = folder.join(format!("{name}.{extension}"));
            write_atomically(&path, &encode(&self.film, format, &output, &path)?.bytes)?;
        }
        Ok(())
    }

    /// The picture on black as linear RGB times its exposure.
    pub fn linear(&self, x: u32, y: u32) -> [f32; 3] {
        let [r, g, b, _] = self.film.mean_rgba(x, y);
        [r, g, b].map(|v| v * self.exposure.exp2())
    }
}

/// An 8-bit sRGB value.
pub fn srgb_byte(linear: f32) -> u8 {
    (ViewTransform::Srgb.encode(linear) * 255.0).round().clamp(0.0, 255.0) as u8
}

fn options(scene: &Scene, quality: Quality, path: &Path) -> Result<RenderOptions> {
    let settings = &scene.settings;
    let (Some(width), Some(height), Some(samples)) = (settings.width, settings.height, settings.samples)
    else {
        let message = "has no size and samples: give '[render]' with width, height and samples";
        return Err(Error::input(path, message));
    };
    let shrink = if width / quality.shrink < LEAST_WIDTH { 1 } else { quality.shrink };
    let default = RenderOptions::default();
    Ok(default
        .size(width / shrink, (height / shrink).max(1))
        .samples(samples.div_ceil(quality.fewer))
        .seed(settings.seed.unwrap_or(default.seed))
        .max_depth(settings.depth.unwrap_or(default.max_depth))
        .filter(settings.filter.unwrap_or_default()))
}
