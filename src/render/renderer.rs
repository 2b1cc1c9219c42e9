//! From a scene to a picture in one line, or pass by pass.

use super::options::{Adaptive, Caustics, Guiding, PathReuse, Splitting, TreeChoice};
use super::picture::{Labels, Picture};
use super::progress::{CancelHandle, Event, Listener};
use super::rendering::Rendering;
use super::resolve_options::Choices;
use crate::compile::Compiler;
use crate::error::{Error, Result};
use crate::film::{Aov, AovSet, AovSpace};
use crate::load::Loaded;
use crate::scene::{EnergyCompensation, Filter, FresnelModel};
use std::sync::Arc;
use std::time::Duration;

/// A scene and how to render it. What is not chosen here is taken from the scene (its first camera, and all that a scene
/// file may set), else from the defaults of [`RenderOptions`](super::RenderOptions).
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
#[must_use = "it renders when told to: by `render` or `start`"]
pub struct Renderer {
    loaded: Arc<Loaded>,
    choices: Choices,
    cancel: CancelHandle,
    listener: Option<Box<Listener>>,
    texture_memory: Option<u64>,
}

impl Renderer {
    /// For a loaded scene, or a [`Scene`](crate::scene::Scene) built in code.
    ///
    /// A loaded scene's warnings become those of the picture; its notes are left behind. A scene needs a camera:
    /// loading adds one where a file has none, and [`stage::complete`](crate::load::stage::complete) does so for
    /// scenes built in code.
    pub fn new(scene: impl Into<Loaded>) -> Renderer {
        Renderer::shared(Arc::new(scene.into()))
    }

    /// The same for a scene that is rendered several times: nothing of it is copied.
    pub fn shared(loaded: Arc<Loaded>) -> Renderer {
        let (choices, cancel) = (Choices::default(), CancelHandle::new());
        Renderer { loaded, choices, cancel, listener: None, texture_memory: None }
    }

    /// Width and height in pixels.
    pub fn size(self, width: u32, height: u32) -> Renderer {
        self.width(width).height(height)
    }

    /// Width in pixels. The height, unless it is given as well, follows by the aspect ratio of the scene or its camera.
    pub fn width(mut self, width: u32) -> Renderer {
        self.choices.settings.width = Some(width);
        self
    }

    /// Height in pixels. The width, unless it is given as well, follows by the aspect ratio of the scene or its camera.
    pub fn height(mut self, height: u32) -> Renderer {
        self.choices.settings.height = Some(height);
        self
    }

    /// Bytes that the images of textures may take; what is beyond is decoded again when it is needed. The picture doesn't depend on
    /// it. By default any number.
    pub fn texture_memory(mut self, bytes: u64) -> Renderer {
        self.texture_memory = Some(bytes);
        self
    }

    /// Samples per pixel.
    pub fn samples(mut self, samples: u32) -> Renderer {
        self.choices.settings.samples = Some(samples);
        self
    }

    /// Seed of all randomness: the same seed gives the same picture at any number of threads.
    pub fn seed(mut self, seed: u32) -> Renderer {
        self.choices.settings.seed = Some(seed);
        self
    }

    /// Maximum number of scattering events of a path; 0 shows emission only.
    pub fn max_depth(mut self, max_depth: u32) -> Renderer {
        self.choices.settings.depth = Some(max_depth);
        self
    }

    /// Reconstruction filter.
    pub fn filter(mut self, filter: Filter) -> Renderer {
        self.choices.settings.filter = Some(filter);
        self
    }

    /// Whether rough surfaces get back the energy that single scattering between microfacets loses.
    pub fn energy_compensation(mut self, energy_compensation: EnergyCompensation) -> Renderer {
        self.choices.settings.energy_compensation = Some(energy_compensation);
        self
    }

    /// Fresnel term of the dielectric layers of glTF materials.
    pub fn fresnel(mut self, fresnel: FresnelModel) -> Renderer {
        self.choices.settings.fresnel = Some(fresnel);
        self
    }

    /// Whether paths carry wavelengths instead of red, green and blue: see [`crate::color::spectral`]. Default false.
    pub fn spectral(mut self, spectral: bool) -> Renderer {
        self.choices.settings.spectral = Some(spectral);
        self
    }

    /// Exposure of PNGs, stops: colours are multiplied by 2 to this power.
    pub fn exposure(mut self, stops: f32) -> Renderer {
        self.choices.settings.exposure = Some(stops);
        self
    }

    /// The scene's camera of this name, else of this number, from 0.
    pub fn camera(mut self, name_or_number: impl ToString) -> Renderer {
        self.choices.camera = Some(name_or_number.to_string());
        self
    }

    /// Which AOVs to record besides colour.
    pub fn aovs(mut self, aovs: impl Into<AovSet>) -> Renderer {
        self.choices.aovs = aovs.into();
        self
    }

    /// Which space AOVs of places and directions are in.
    pub fn aov_space(mut self, aov_space: AovSpace) -> Renderer {
        self.choices.aov_space = aov_space;
        self
    }

    /// Whether to record the light of each of the scene's groups of lights, in channels `RGBA_group.R` and so on.
    pub fn light_groups(mut self, light_groups: bool) -> Renderer {
        self.choices.light_groups = light_groups;
        self
    }

    /// How many ranks of ids the mattes among the AOVs have; two for each layer.
    pub fn matte_levels(mut self, matte_levels: u32) -> Renderer {
        self.choices.matte_levels = matte_levels;
        self
    }

    /// Whether smooth glass is transparent where nothing is behind it: see
    /// [`RenderOptions::transparent_glass`](super::RenderOptions::transparent_glass).
    pub fn transparent_glass(mut self, transparent_glass: bool) -> Renderer {
        self.choices.transparent_glass = transparent_glass;
        self
    }

    /// Whether to keep the halves of each pixel's samples apart, for [`Film::halves`](crate::film::Film::halves).
    pub fn halves(mut self, halves: bool) -> Renderer {
        self.choices.halves = halves;
        self
    }

    /// Whether the shadow terminator is softened on surfaces with shading normals.
    pub fn soft_terminator(mut self, soft_terminator: bool) -> Renderer {
        self.choices.soft_terminator = soft_terminator;
        self
    }

    /// Whether neighbouring pixels share the paths that they find.
    pub fn path_reuse(mut self, path_reuse: PathReuse) -> Renderer {
        self.choices.path_reuse = path_reuse;
        self
    }

    /// Sets into how many paths samples split. Default [`Splitting::Auto`].
    pub fn splitting(mut self, splitting: Splitting) -> Renderer {
        self.choices.splitting = splitting;
        self
    }

    /// Sets whether caustics are found from the lamp. Default [`Caustics::Auto`].
    pub fn caustics(mut self, caustics: Caustics) -> Renderer {
        self.choices.caustics = caustics;
        self
    }

    /// Sets whether paths are guided. Default [`Guiding::Auto`].
    pub fn guiding(mut self, guiding: Guiding) -> Renderer {
        self.choices.guiding = guiding;
        self
    }

    /// Sets whether noisy pixels get more samples. Default [`Adaptive::Off`].
    pub fn adaptive(mut self, adaptive: Adaptive) -> Renderer {
        self.choices.adaptive = adaptive;
        self
    }

    /// How good the tree over the scene's triangles is.
    pub fn tree(mut self, tree: TreeChoice) -> Renderer {
        self.choices.tree = tree;
        self
    }

    /// Stops after rendering for this time, or at the number of samples, whichever comes first; `None` removes the
    /// limit.
    pub fn time_limit(mut self, time_limit: impl Into<Option<Duration>>) -> Renderer {
        self.choices.time_limit = time_limit.into();
        self
    }

    /// Lets this handle, or a clone of it, stop rendering from any thread.
    pub fn cancel_by(mut self, cancel: &CancelHandle) -> Renderer {
        self.cancel = cancel.clone();
        self
    }

    /// Calls `listener` with the progress several times a second, from any thread.
    pub fn on_event(mut self, listener: impl Fn(Event) + Send + Sync + 'static) -> Renderer {
        self.listener = Some(Box::new(listener));
        self
    }

    /// Builds the BVH and whatever else rendering needs, but takes no sample yet: [`Rendering::next_pass`] does.
    ///
    /// # Errors
    /// A usage error for a camera that does not exist and for a picture with too many pixels; an input error for a scene
    /// without a camera, with broken references or with more triangles than can be addressed.
    pub fn start(self) -> Result<Rendering> {
        let Loaded { scene, warnings, offset, .. } = &*self.loaded;
        let mut warnings = warnings.clone();
        let settled = self.choices.settle(scene)?;
        let camera = settled.camera(scene)?;
        let size = (settled.options.width, settled.options.height);
        let mut compiler = Compiler::single();
        compiler.set_tree(settled.tree(1));
        compiler.keep_uv(settled.options.aovs.contains(Aov::Uv));
        compiler.set_texture_memory(self.texture_memory);
        let (compiled, mut report) = compiler.compile(scene, settled.shading, camera, size)?;
        warnings.append(&mut report.warnings);
        warnings.append(&mut report.notes);
        let labels = Labels::of(scene, &settled.options);
        let rendering = Rendering::labelled(compiled, labels, camera, settled.options)?;
        let rendering = rendering.placed(scene.backdrop.clone(), *offset);
        Ok(rendering.with(warnings, settled.look, self.cancel, self.listener))
    }

    /// Renders all samples.
    ///
    /// # Errors
    /// As for [`Renderer::start`]. Being stopped by a [`CancelHandle`] or the time limit is no error: the picture's
    /// statistics tell of it.
    pub fn render(self) -> Result<Picture> {
        let mut rendering = self.start()?;
        rendering.run();
        Ok(rendering.into_picture())
    }
}

// The threads that everything parallel runs on.

/// Stack of each thread, bytes: what a main thread usually has.
const STACK: usize = 8 << 20;

/// Runs `work` on a pool of its own with this many threads (`None`: one per core): loading and rendering inside it use
/// these threads only.
///
/// # Errors
/// A usage error if the system refuses the threads.
pub fn in_pool<R: Send>(threads: Option<usize>, work: impl FnOnce() -> R + Send) -> Result<R> {
    let builder = rayon::ThreadPoolBuilder::new().stack_size(STACK).num_threads(threads.unwrap_or(0));
    let pool = builder.build().map_err(|e| {
        let count = threads.map_or("the".to_string(), |n| n.to_string());
        Error::usage(format!("can't start {count} threads: {e}")).with_help("ask for fewer")
    })?;
    Ok(pool.install(work))
}
