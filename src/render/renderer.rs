//! The builder of renderings: from a scene to a picture at once, or pass by pass.

use super::options::{
    BvhQuality, Caustics, Guiding, LightSelection, PathReuse, RenderOptions, RequestedOptions, Splitting,
    parameter, render_settings,
};
use super::picture::{Labels, Picture, denoising_guides};
use super::progress::{CancelHandle, Event, Listener};
use super::rendering::Rendering;
use crate::compile::Compiler;
use crate::error::{Error, Result};
use crate::film::{Aov, AovSet, AovSpace};
use crate::load::Loaded;
use crate::scene::{
    BounceLimits, Clamp, EnergyCompensation, Filter, FresnelModel, ShadowTerminator, SkippedCaustics,
};
use std::sync::Arc;
use std::time::Duration;

/// A scene and its render settings. Settings that are not given are taken from the scene (the first camera, and all settings of a scene
/// file), else from the defaults of [`RenderOptions`](super::RenderOptions).
///
/// Runs on the threads of the current [rayon](https://docs.rs/rayon) pool; [`in_pool`](super::in_pool) makes a pool of
/// another size.
///
/// ```
/// use oscura::{Renderer, film::Aov};
/// let scene = oscura::load("assets/cornell-box.gltf")?;
/// let picture = Renderer::new(scene).size(32, 32).samples(4).aovs([Aov::Depth, Aov::Normal]).render()?;
/// assert_eq!(picture.film().rgba().len(), 32 * 32);
/// # let folder = std::env::temp_dir();
/// # let path = folder.join(format!("oscura-renderer-{}.exr", std::process::id()));
/// picture.save(&path)?;
/// # std::fs::remove_file(&path).ok();
/// # Ok::<(), oscura::Error>(())
/// ```
#[must_use = "it renders when `render` or `start` is called"]
pub struct Renderer {
    loaded: Arc<Loaded>,
    requested: RequestedOptions,
    cancel: CancelHandle,
    listener: Option<Box<Listener>>,
    texture_memory: Option<u64>,
    denoises: bool,
}

/// The method of [`Renderer`] for a setting.
macro_rules! define_method {
    ($name:ident, $help:literal, $type:ty, internal) => {};
    ($name:ident, $help:literal, $type:ty, user $(, $into:ident)?) => {
        #[doc = concat!($help, ": see [`RenderOptions`](super::RenderOptions::", stringify!($name), ").")]
        pub fn $name(mut self, $name: parameter!($type $(, $into)?)) -> Renderer {
            self.requested.options.$name = $name.into();
            self
        }
    };
    ($name:ident, $help:literal, $type:ty, scene($field:ident)) => {
        #[doc = concat!($help, ": see [`RenderOptions`](super::RenderOptions::", stringify!($name), ").")]
        pub fn $name(mut self, $name: $type) -> Renderer {
            self.requested.settings.$field = Some($name);
            self
        }
    };
    ($name:ident, $help:literal, $type:ty, internal, $into:ident) => {};
}

macro_rules! define_methods {
    ($(
        $help:literal, $shown:literal => $(#[$more:meta])* $name:ident: $type:ty = $default:expr,
        $identity:ident $(($entry:literal))?, $source:ident $(($field:ident))? $([$into:ident])?;
    )*) => {
        /// Methods for the [render settings](super::RenderOptions).
        impl Renderer {
            $( define_method!($name, $help, $type, $source $(($field))? $(, $into)?); )*
        }
    };
}
render_settings!(define_methods);

impl Renderer {
    /// A renderer for a loaded scene, or a [`Scene`](crate::scene::Scene) built in code.
    ///
    /// Warnings of a loaded scene become warnings of the picture; its notes are dropped. A scene needs a camera: loading adds one if a file
    /// has none, and [`stage::complete`](crate::load::stage::complete) adds one to scenes built in code.
    pub fn new(scene: impl Into<Loaded>) -> Renderer {
        Renderer::shared(Arc::new(scene.into()))
    }

    /// A renderer for a scene that is rendered several times, without copies.
    pub fn shared(loaded: Arc<Loaded>) -> Renderer {
        let (requested, cancel) = (RequestedOptions::default(), CancelHandle::new());
        Renderer { loaded, requested, cancel, listener: None, texture_memory: None, denoises: false }
    }

    /// Width and height in pixels.
    pub fn size(self, width: u32, height: u32) -> Renderer {
        self.width(width).height(height)
    }

    /// Width in pixels. The height, if not given, follows from the aspect ratio of the scene or its camera.
    pub fn width(mut self, width: u32) -> Renderer {
        self.requested.settings.width = Some(width);
        self
    }

    /// Height in pixels. The width, if not given, follows from the aspect ratio of the scene or its camera.
    pub fn height(mut self, height: u32) -> Renderer {
        self.requested.settings.height = Some(height);
        self
    }

    /// Denoises the result of [`Renderer::render`] by the built-in network of Intel's Open Image Denoise. The picture keeps the requested
    /// AOVs; path reuse is off unless requested. With [`Renderer::start`], records the inputs of [`Rendering::denoise`].
    ///
    /// ```no_run
    /// # use oscura::Renderer;
    /// let scene = oscura::load("assets/cornell-box.gltf")?;
    /// Renderer::new(scene).samples(32).denoise(true).render()?.save("cornell.png")?;
    /// # Ok::<(), oscura::Error>(())
    /// ```
    pub fn denoise(mut self, denoise: bool) -> Renderer {
        self.denoises = denoise;
        self
    }

    /// Memory limit of texture images, bytes; beyond, they are compressed, in memory or in a temporary file. The picture doesn't depend on
    /// it. Default: [`texture_memory_for`](crate::compile::texture_memory_for) the picture.
    pub fn texture_memory(mut self, bytes: u64) -> Renderer {
        self.texture_memory = Some(bytes);
        self
    }

    /// Energy compensation of rough surfaces, for multiple scattering between microfacets.
    pub fn energy_compensation(mut self, energy_compensation: EnergyCompensation) -> Renderer {
        self.requested.settings.energy_compensation = Some(energy_compensation);
        self
    }

    /// Fresnel term of the dielectric layers of glTF materials.
    pub fn fresnel(mut self, fresnel: FresnelModel) -> Renderer {
        self.requested.settings.fresnel = Some(fresnel);
        self
    }

    /// Spectral rendering: see [`crate::color::spectral`]. Default false.
    pub fn spectral(mut self, spectral: bool) -> Renderer {
        self.requested.settings.spectral = Some(spectral);
        self
    }

    /// Exposure of PNGs, stops: colours are multiplied by 2 to this power.
    pub fn exposure(mut self, stops: f32) -> Renderer {
        self.requested.settings.exposure = Some(stops);
        self
    }

    /// The scene's camera by name, else by index from 0.
    pub fn camera(mut self, name_or_number: impl ToString) -> Renderer {
        self.requested.camera = Some(name_or_number.to_string());
        self
    }

    /// Build quality of the BVH.
    pub fn bvh(mut self, bvh: BvhQuality) -> Renderer {
        self.requested.bvh = bvh;
        self
    }

    /// The handle that cancels rendering from any thread.
    pub fn cancel_by(mut self, cancel: &CancelHandle) -> Renderer {
        self.cancel = cancel.clone();
        self
    }

    /// Calls `listener` with the progress several times per second, from any thread.
    pub fn on_event(mut self, listener: impl Fn(Event) + Send + Sync + 'static) -> Renderer {
        self.listener = Some(Box::new(listener));
        self
    }

    /// Compiles the scene, including its BVH, without rendering samples: [`Rendering::next_pass`] does.
    ///
    /// # Errors
    /// A usage error for a camera that does not exist and for a picture with too many pixels; an input error for a scene
    /// without a camera, with broken references or with more triangles than can be addressed.
    pub fn start(self) -> Result<Rendering> {
        Ok(self.begin()?.0)
    }

    /// [`Renderer::start`], which also returns the requested AOVs.
    fn begin(self) -> Result<(Rendering, AovSet)> {
        let Loaded { scene, warnings, offset, .. } = &*self.loaded;
        let mut warnings = warnings.clone();
        let mut resolved = self.requested.resolve(scene)?;
        let requested = resolved.options.aovs;
        if self.denoises {
            resolved.options = with_denoising(resolved.options);
        }
        let camera = resolved.camera(scene)?;
        let size = (resolved.options.width, resolved.options.height);
        let mut compiler = Compiler::single();
        compiler.set_bvh(resolved.bvh(1));
        compiler.keep_uv(resolved.options.aovs.contains(Aov::Uv));
        compiler.set_texture_memory(self.texture_memory);
        let (compiled, mut report) = compiler.compile(scene, resolved.shading, camera, size)?;
        warnings.append(&mut report.warnings);
        warnings.append(&mut report.notes);
        let labels = Labels::of(scene, &resolved.options);
        let rendering = Rendering::labelled(compiled, labels, camera, resolved.options)?;
        let rendering = rendering.placed(scene.backdrop.clone(), *offset);
        Ok((rendering.with(warnings, resolved.display, self.cancel, self.listener), requested))
    }

    /// Renders all samples.
    ///
    /// # Errors
    /// As for [`Renderer::start`]. Cancellation and the time limit are no errors, but reported in the picture's statistics.
    pub fn render(self) -> Result<Picture> {
        let denoises = self.denoises;
        let (mut rendering, requested) = self.begin()?;
        rendering.run();
        if denoises {
            rendering.denoise(requested);
        }
        Ok(rendering.into_picture())
    }
}

/// The options for a picture that will be denoised.
fn with_denoising(options: RenderOptions) -> RenderOptions {
    let path_reuse = match options.path_reuse {
        // Denoisers mistake noise correlated between pixels for detail.
        PathReuse::Auto => PathReuse::Off,
        chosen => chosen,
    };
    let aovs = options.aovs.union(denoising_guides());
    options.aovs(aovs).halves(true).path_reuse(path_reuse).denoises(true)
}

/// Stack size of threads, bytes: the usual size for main threads.
const STACK: usize = 8 << 20;

/// Runs `work` in a new thread pool with this many threads (`None`: one per core); loading and rendering inside use only these threads.
///
/// # Errors
/// A usage error if the threads can't be started.
pub fn in_pool<R: Send>(threads: Option<usize>, work: impl FnOnce() -> R + Send) -> Result<R> {
    let builder = rayon::ThreadPoolBuilder::new().stack_size(STACK).num_threads(threads.unwrap_or(0));
    let pool = builder.build().map_err(|e| {
        let count = threads.map_or("the".to_string(), |n| n.to_string());
        Error::usage(format!("can't start {count} threads: {e}"))
            .with_help("give a smaller number of threads")
    })?;
    Ok(pool.install(work))
}
