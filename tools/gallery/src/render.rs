//! Renders one scene with its own settings.

use oscura::error::{Error, Result};
use oscura::output::ViewTransform;
use oscura::render::{Picture, Renderer, in_pool};
use oscura::scene::Scene;
use std::path::Path;
use std::time::Instant;

/// Minimum width of downscaled pictures.
const MIN_WIDTH: u32 = 100;

/// Settings for all scenes.
#[derive(Clone, Copy, Debug)]
pub struct Quality {
    /// Divisor of widths and heights, of large pictures.
    pub shrink: u32,
    /// Divisor of samples.
    pub fewer: u32,
    /// Threads; default all cores.
    pub threads: Option<usize>,
}

/// A picture with its statistics.
pub struct Shot {
    /// The picture.
    pub picture: Picture,
    /// Samples per pixel.
    pub samples: u32,
    /// Loading and compiling, seconds.
    pub load_s: f64,
    /// Rendering, seconds.
    pub render_s: f64,
    /// Rendering, CPU seconds of all threads.
    pub render_cpu_s: f64,
    /// Exposure of the PNG, stops.
    exposure: f32,
    /// View transform.
    view: ViewTransform,
}

impl Shot {
    /// Loads, compiles and renders a scene.
    ///
    /// # Errors
    /// Errors and warnings of loading and compiling: the scenes of the gallery have none.
    pub fn render(path: &Path, quality: Quality) -> Result<Shot> {
        in_pool(quality.threads, || Shot::render_in_pool(path, quality))?
    }

    fn render_in_pool(path: &Path, quality: Quality) -> Result<Shot> {
        let start = Instant::now();
        let loaded = oscura::load(path)?;
        let ([width, height], samples) = size_and_samples(&loaded.scene, quality, path)?;
        let exposure = loaded.scene.settings.exposure.unwrap_or(0.0);
        let view = loaded.scene.settings.view.clone();
        let mut rendering = Renderer::new(loaded).size(width, height).samples(samples).start()?;
        if let Some(warning) = rendering.warnings().first() {
            return Err(Error::input(path, format!("renders with a warning: {warning}")));
        }
        let load_s = start.elapsed().as_secs_f64();
        rendering.run();
        let statistics = rendering.statistics();
        if statistics.invalid_samples > 0 {
            let message = format!("{} samples were NaN or infinite", statistics.invalid_samples);
            return Err(Error::input(path, message));
        }
        Ok(Shot {
            picture: rendering.into_picture(),
            samples,
            load_s,
            render_s: statistics.render_s,
            render_cpu_s: statistics.render_cpu_s,
            exposure,
            view: view.unwrap_or(ViewTransform::Srgb),
        })
    }

    /// Writes `NAME.exr` and `NAME.png` into a folder.
    ///
    /// # Errors
    /// Where a file can't be written.
    pub fn write(&self, folder: &Path, name: &str) -> Result<()> {
        for extension in ["exr", "png"] {
            self.picture.save(folder.join(format!("{name}.{extension}")))?;
        }
        Ok(())
    }

    /// Linear RGB as 8-bit colours, by the picture's view transform.
    pub fn encode(&self, linear: [f32; 3]) -> [u8; 3] {
        self.view.encode(linear).map(|v| (v * 255.0).round().clamp(0.0, 255.0) as u8)
    }

    /// Luminance above the range of the view transform.
    pub fn most(&self) -> f32 {
        if self.view == ViewTransform::Srgb { 1.0 } else { 16.0 }
    }

    /// The picture over black as linear RGB times its exposure.
    pub fn linear(&self, x: u32, y: u32) -> [f32; 3] {
        let [r, g, b, _] = self.picture.film().mean_rgba(x, y);
        [r, g, b].map(|v| v * self.exposure.exp2())
    }
}

/// An 8-bit sRGB value.
pub fn srgb_byte(linear: f32) -> u8 {
    (ViewTransform::Srgb.encode([linear; 3])[0] * 255.0).round().clamp(0.0, 255.0) as u8
}

fn size_and_samples(scene: &Scene, quality: Quality, path: &Path) -> Result<([u32; 2], u32)> {
    let settings = &scene.settings;
    let (Some(width), Some(height), Some(samples)) = (settings.width, settings.height, settings.samples)
    else {
        let message = "has no size and samples: give '[render]' with width, height and samples";
        return Err(Error::input(path, message));
    };
    let shrink = if width / quality.shrink < MIN_WIDTH { 1 } else { quality.shrink };
    Ok(([width / shrink, (height / shrink).max(1)], samples.div_ceil(quality.fewer)))
}
