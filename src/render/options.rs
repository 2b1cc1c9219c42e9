//! How to render.

use crate::film::AovSet;
use crate::scene::Filter;
use std::time::Duration;

/// How to render. Start from the default and change what should differ:
///
/// ```
/// use oscura::render::RenderOptions;
/// let options = RenderOptions::default().size(640, 360).samples(16).seed(7);
/// assert_eq!((options.width, options.max_depth), (640, 100));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RenderOptions {
    /// Picture width in pixels; that for which the scene was compiled. Default 1280.
    pub width: u32,
    /// Picture height in pixels; that for which the scene was compiled. Default 720.
    pub height: u32,
    /// Samples a pixel. Default 128.
    pub samples: u32,
    /// Seed of all randomness. Default 0.
    pub seed: u32,
    /// Largest number of scattering events; 0 shows emission only. Default 100.
    pub max_depth: u32,
    /// Reconstruction filter. Default Blackman-Harris.
    pub filter: Filter,
    /// What to record besides colour. Default nothing.
    pub aovs: AovSet,
    /// Soften the edges of self-shadowing on shapes with shading normals, which otherwise follow the triangles. Default
    /// yes.
    pub soft_terminator: bool,
    /// Stop after this time of rendering. The number of samples then depends on the machine. Default none.
    pub time_limit: Option<Duration>,
}

impl Default for RenderOptions {
    fn default() -> RenderOptions {
        RenderOptions {
            width: 1280,
            height: 720,
            samples: 128,
            seed: 0,
            max_depth: 100,
            filter: Filter::default(),
            aovs: AovSet::NONE,
            soft_terminator: true,
            time_limit: None,
        }
    }
}

impl RenderOptions {
    /// Sets width and height in pixels.
    #[must_use]
    pub fn size(self, width: u32, height: u32) -> RenderOptions {
        RenderOptions { width, height, ..self }
    }

    /// Sets the number of samples a pixel.
    #[must_use]
    pub fn samples(self, samples: u32) -> RenderOptions {
        RenderOptions { samples, ..self }
    }

    /// Sets the seed of all randomness.
    #[must_use]
    pub fn seed(self, seed: u32) -> RenderOptions {
        RenderOptions { seed, ..self }
    }

    /// Sets the largest number of scattering events.
    #[must_use]
    pub fn max_depth(self, max_depth: u32) -> RenderOptions {
        RenderOptions { max_depth, ..self }
    }

    /// Sets the reconstruction filter.
    #[must_use]
    pub fn filter(self, filter: Filter) -> RenderOptions {
        RenderOptions { filter, ..self }
    }

    /// Sets what to record besides colour.
    #[must_use]
    pub fn aovs(self, aovs: impl Into<AovSet>) -> RenderOptions {
        RenderOptions { aovs: aovs.into(), ..self }
    }

    /// Sets whether edges of self-shadowing are softened.
    #[must_use]
    pub fn soft_terminator(self, soft_terminator: bool) -> RenderOptions {
        RenderOptions { soft_terminator, ..self }
    }

    /// Sets or lifts the limit on rendering time.
    #[must_use]
    pub fn time_limit(self, time_limit: impl Into<Option<Duration>>) -> RenderOptions {
        RenderOptions { time_limit: time_limit.into(), ..self }
    }
}
