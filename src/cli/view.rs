//! `oscura view`: a web page that shows a scene while it renders. One thread renders (with the pool's threads), one accepts HTTP
//! requests and starts a thread for each ([`Page`]), and one watches files and signals.

use super::args::RenderArgs;
use super::page::{
    Edits, Frame, LightInfo, PAGE_AOVS, Page, PageDisplay, Pose, RenderRequest, SceneInfo, Shared,
    ViewRequest, bind, own_command, set_environment_strength,
};
use super::parsers::integer;
use super::process::{Outcome, cancel_by_signals};
use super::render::{load_options, load_scene};
use super::scene_args::{BackgroundArg, StageArg, check_scene_path};
use super::settings::{
    EnvironmentOverride, PictureUse, Prepared, check_memory_before_loading, completed, prepare,
};
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Args, Command, ValueEnum, value_parser};
use oscura::compile::{CompiledScene, Compiler, ObjectId, View};
use oscura::error::{Error, Result, Warning};
use oscura::film::Aov;
use oscura::load::scene_file::sidecar_path;
use oscura::load::{LoadOptions, Loaded, Up, WatchedFiles, has_ambiguous_up};
use oscura::math::DVec3;
use oscura::output::PngOptions;
use oscura::render::{
    CancelHandle, Guiding, Labels, LightSelection, PassOutcome, Rendering, ResolvedOptions, in_pool,
};
use oscura::scene::{Camera, Environment, Light, Material, Scene, instance_extents, scene_extent};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Interval between tests for signals.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);
/// Interval between tests for changed files.
const WATCH_INTERVAL: Duration = Duration::from_millis(500);

/// Serves the page until a signal ends it.
pub(crate) fn run(args: &ViewArgs) -> Result<Outcome> {
    let mut args = args.clone();
    args.render.scene = args.render.scenes.first().cloned().unwrap_or_default();
    let cancel = cancel_by_signals()?;
    let threads = args.render.threads.map(usize::from);
    in_pool(threads, || serve(&args, &cancel))?
}

fn serve(args: &ViewArgs, cancel: &CancelHandle) -> Result<Outcome> {
    // Before loading, to report ports in use at once.
    let server = bind(args.port)?;
    let files = WatchedFiles::default();
    let model = Model::load(args, &files, cancel)?;
    let (scene_info, poses) = (model.scene_info(args), model.poses(args));
    if !args.render.quiet {
        scene_info.notes.iter().for_each(|note| say!("note: {note}"));
    }
    let request = model.request(args, &scene_info, &poses)?;
    let display = PageDisplay { denoise: !args.render.picture.no_denoise, ..model.display() };
    let shared = Shared::new(request, display, scene_info, poses);
    let page = Page::open(server, shared, &args.render, !args.no_open);
    // Rendering stays on this thread, which belongs to the pool.
    std::thread::scope(|scope| {
        scope.spawn(|| watch(args.watch.then_some(&files), cancel, &page.shared));
        let result = render_requests(args, model, &files, cancel, &page.shared);
        page.shared.end();
        result
    })?;
    Ok(Outcome::Done)
}

/// Stops all threads on a signal and requests reloading when one of the files changes.
fn watch(files: Option<&WatchedFiles>, cancel: &CancelHandle, shared: &Shared) {
    let mut last_check = Instant::now();
    while !shared.lock().is_stopped {
        std::thread::sleep(SIGNAL_INTERVAL);
        if cancel.is_cancelled() {
            shared.end();
        }
        let Some(files) = files.filter(|_| last_check.elapsed() >= WATCH_INTERVAL) else { continue };
        last_check = Instant::now();
        if files.have_changed() {
            shared.request(|state| state.request.loads += 1);
        }
    }
}

// Arguments of `oscura view`: those of `render` except for output files, sequences and reports.

/// Arguments of `render` that `view` doesn't support.
const UNUSED: [&str; 38] = [
    "output",
    "verbose",
    "frames",
    "fps",
    "resume",
    "orbit",
    "preview",
    "show",
    "time_limit",
    "save_every",
    "noise",
    "checkpoint",
    "checkpoint_interval",
    "plan",
    "sample_range",
    "region",
    "progress",
    "memory_limit",
    "denoiser",
    "oidn_library",
    "deep",
    "float",
    "exr_layout",
    "exr_compression",
    "exr_tiles",
    "working_space",
    "exr_half",
    "exr_float",
    "crop",
    "overscan",
    "aov",
    "aov_space",
    "light_groups",
    "crypto_levels",
    "strict",
    "explain",
    "reproducible",
    "json",
];

#[derive(Args, Clone, Debug)]
pub(crate) struct ViewArgs {
    #[command(flatten)]
    pub render: RenderArgs,
    /// Port of the local web server [default: a free one].
    #[arg(long, value_name = "N", value_parser = integer::<u16>(0, 65535), default_value = "0", hide_default_value = true)]
    pub port: u16,
    /// Print the page's address without opening a browser.
    #[arg(long)]
    pub no_open: bool,
    /// Reload the scene when one of its files changes.
    #[arg(long)]
    pub watch: bool,
}

/// Hides unused arguments from the command's help.
pub(crate) fn adapt(command: Command) -> Command {
    let command = command.mut_arg("scenes", |arg| {
        arg.num_args(1).help("Scene: .gltf, .glb, .vrm, .obj, .ply, .spz, .stl, .3mf, .zip, .toml or .blend")
    });
    // Required in `render`, optional here.
    let output = Arg::new("output").short('o').long("output").action(ArgAction::Append);
    let command = command.mut_arg("output", |_| output.value_parser(value_parser!(PathBuf)));
    UNUSED.iter().fold(command, |command, id| command.mut_arg(id, |arg| arg.hide(true)))
}

/// Refuses unused arguments.
///
/// # Errors
/// Like clap's for unknown arguments.
pub(crate) fn refuse_unused(
    command: &mut Command,
    matches: &ArgMatches,
) -> std::result::Result<(), clap::Error> {
    let is_given = |id: &&&str| matches.value_source(id) == Some(ValueSource::CommandLine);
    let Some(id) = UNUSED.iter().find(is_given) else { return Ok(()) };
    let argument = match *id {
        "output" => "-o".to_string(),
        id => format!("--{}", id.replace('_', "-")),
    };
    let message = format!("{argument} is not supported by 'oscura view', only by 'oscura render'");
    Err(command.error(ErrorKind::UnknownArgument, message))
}

/// Default number of samples per pixel.
const DEFAULT_SAMPLES: u32 = 1024;
/// Maximum number of pixels of the initial picture, without `--width` and `--height`.
const MAX_INITIAL_PIXELS: u64 = 640_000;
/// Maximum number of lights listed by pages.
const MAX_LIGHTS: usize = 512;

/// The viewed scene: loaded, compiled, and adjusted to requests of pages.
struct Model {
    pub loaded: Loaded,
    pub resolved: ResolvedOptions,
    pub compiled: Arc<CompiledScene>,
    /// Samples per pixel of a finished picture.
    pub samples: u32,
    pub png: PngOptions,
    /// Number of the reload request it was loaded for.
    pub loads: u64,
    compiler: Compiler,
    triangles: u64,
    notes: Vec<String>,
    /// Rotation of the environment as loaded, degrees.
    original_rotation: Option<f64>,
    rotation: Option<f64>,
    /// Strength of the environment as loaded; `None` if it can't be scaled.
    original_strength: Option<f64>,
    strength: Option<f64>,
    /// Materials and lights as loaded; `edits` are applied to them.
    original_materials: Arc<[Material]>,
    original_lights: Vec<Light>,
    light_infos: Arc<[LightInfo]>,
    edits: Edits,
}

impl Model {
    /// Loads and compiles the scene. Its files replace the watched files, or are added to them if loading fails.
    ///
    /// # Errors
    /// Those of `oscura render`.
    pub fn load(args: &ViewArgs, files: &WatchedFiles, cancel: &CancelHandle) -> Result<Model> {
        let new_files = WatchedFiles::default();
        let model = Model::read(&args.render, &new_files, cancel);
        files.replace_by(&new_files, model.is_err());
        model
    }

    fn read(args: &RenderArgs, files: &WatchedFiles, cancel: &CancelHandle) -> Result<Model> {
        let start = Instant::now();
        check_scene_path(&args.scene)?;
        check_memory_before_loading(args)?;
        args.env.iter().for_each(|path| files.note(path));
        if let Some(BackgroundArg::File(path)) = &args.stage.background {
            files.note(path);
        }
        let environment = EnvironmentOverride::load(args)?;
        let options = LoadOptions { files: files.clone(), ..load_options(args)? };
        let mut loaded = load_scene(args, cancel, &options)?;
        let mut compiler = Compiler::sequence();
        compiler.allow_camera_changes();
        let usage = PictureUse { has_exr: true, keeps_uv: true, pictures: 1 };
        let prepared = prepare(
            &completed(args, &loaded.scene.settings),
            usage,
            Some(&environment),
            &mut loaded,
            start,
            &mut compiler,
        )?;
        let Prepared { scene, resolved, png, notes, warnings, build, .. } = prepared;
        let original_rotation = rotation(&loaded.scene.environment);
        let original_strength = strength(&loaded.scene.environment, args.env_strength);
        let original_materials = loaded.scene.materials.clone().into();
        let original_lights = loaded.scene.lights.clone();
        let light_infos = LightInfo::all(&loaded.scene).into_iter().take(MAX_LIGHTS).collect();
        Ok(Model {
            loaded,
            resolved,
            compiled: scene,
            samples: args.spp.unwrap_or(DEFAULT_SAMPLES),
            png,
            loads: 0,
            compiler,
            triangles: build.triangles,
            notes: notes.iter().chain(&warnings).map(Warning::to_string).collect(),
            original_rotation,
            rotation: original_rotation,
            original_strength,
            strength: original_strength,
            original_materials,
            original_lights,
            light_infos,
            edits: Edits::default(),
        })
    }

    /// The initial request.
    pub fn request(&self, args: &ViewArgs, scene_info: &SceneInfo, poses: &[Pose]) -> Result<ViewRequest> {
        let fits = |&&(w, h): &&(u32, u32)| u64::from(w) * u64::from(h) <= MAX_INITIAL_PIXELS;
        let is_chosen = args.render.width.or(args.render.height).is_some();
        let full = (self.resolved.options.width, self.resolved.options.height);
        let size = scene_info.sizes.iter().rev().find(fits).filter(|_| !is_chosen).copied().unwrap_or(full);
        let camera = self.resolved.camera.unwrap_or(0);
        let pose =
            poses.get(camera).cloned().ok_or_else(|| Error::input(&args.render.scene, "has no camera"))?;
        let rotation = self.original_rotation.and(args.render.env_rotation);
        let strength = args.render.env_strength.map(f64::from).filter(|_| self.original_strength.is_some());
        let stage = &args.render.stage;
        let (up, stage) = (Some(stage.up).filter(|up| *up != Up::Auto), stage.stage);
        let (edits, loads) = (Edits::default(), self.loads);
        Ok(ViewRequest { pose, camera, size, rotation, strength, edits, aov: None, up, stage, loads })
    }

    pub fn display(&self) -> PageDisplay {
        PageDisplay::new(self.png.clone())
    }

    /// Information about the scene for pages.
    pub fn scene_info(&self, args: &ViewArgs) -> SceneInfo {
        let (w, h) = (self.resolved.options.width, self.resolved.options.height);
        let scaled = |(numerator, denominator): (u64, u64)| {
            [w, h].map(|v| (u64::from(v) * numerator / denominator).max(1) as u32).into()
        };
        let has_stage = self.loaded.turntable.is_some() && args.render.env.is_none();
        let name = args.render.scene.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let camera = |(i, camera): (usize, &Camera)| match camera.name.as_str() {
            "" => format!("Camera {i}"),
            name => name.to_string(),
        };
        let scene = &args.render.scene;
        let is_model = !scene.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        let sidecar = (is_model && !args.render.source.no_sidecar).then(|| sidecar_path(scene));
        SceneInfo {
            name,
            cameras: self.loaded.scene.cameras.iter().enumerate().map(camera).collect(),
            triangles: self.triangles,
            sizes: [(1, 4), (1, 2), (3, 4), (1, 1)].map(scaled).to_vec(),
            rotation: self.original_rotation,
            strength: self.original_strength,
            sidecar: sidecar.as_ref().and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned())),
            sidecar_path: sidecar,
            materials: self.original_materials.clone(),
            lights: self.light_infos.clone(),
            samples: self.samples,
            passes: self.passes(),
            up: has_ambiguous_up(&args.render.scene).then(|| args.render.stage.up.name()),
            stage: has_stage.then(|| args.render.stage.stage.unwrap_or(StageArg::Studio).name()),
            ups: Up::ALL.map(Up::name).to_vec(),
            stages: StageArg::value_variants().iter().map(|stage| stage.name()).collect(),
            objects: objects(&self.loaded.scene),
            notes: self.notes.clone(),
            is_live: true,
            command: own_command(),
        }
    }

    /// Option name and description of passes that can be shown. Motion must be requested at loading.
    fn passes(&self) -> Vec<(&'static str, &'static str)> {
        let has_motion = self.resolved.options.aovs.contains(Aov::Motion);
        let passes = Aov::ALL.iter().filter(|aov| has_motion || **aov != Aov::Motion);
        passes.map(|aov| (aov.info().option, aov.info().about)).collect()
    }

    /// Poses of the scene's cameras.
    pub fn poses(&self, args: &ViewArgs) -> Vec<Pose> {
        let scene = &self.loaded.scene;
        let bounds = scene_extent(scene, &instance_extents(scene)).0;
        let (low, high) = bounds.unwrap_or((DVec3::NEG_ONE, DVec3::ONE));
        let chosen = self.resolved.camera.unwrap_or(0);
        let pose = |(number, camera): (usize, &Camera)| {
            let eye = camera.world_from_camera.translation;
            let ahead = camera.world_from_camera.transform_vector3(DVec3::NEG_Z);
            let distance = (0.5 * (low + high) - eye).dot(ahead);
            // The centre may be behind cameras within the scene.
            let distance = if distance > 0.0 { distance } else { 0.5 * low.distance(high).max(1e-3) };
            let pose = Pose::new(camera.clone(), distance);
            match number == chosen {
                true => pose.with_arguments(&args.render.camera_args, args.render.stage.fov),
                false => pose,
            }
        };
        scene.cameras.iter().enumerate().map(pose).collect()
    }

    /// Reloads the scene for the reload request of a number.
    ///
    /// # Errors
    /// Those of [`Model::load`]; the scene is then unchanged.
    pub fn reload(
        &mut self,
        args: &ViewArgs,
        files: &WatchedFiles,
        cancel: &CancelHandle,
        loads: u64,
    ) -> Result<()> {
        // Set even if loading fails, which is not retried.
        self.loads = loads;
        *self = Model { loads, ..Model::load(args, files, cancel)? };
        Ok(())
    }

    /// Adjusts and compiles the scene for a request.
    ///
    /// # Errors
    /// Those of compiling; the scene is then unchanged.
    pub fn update(&mut self, request: &ViewRequest) -> Result<()> {
        let camera = request.pose.camera();
        let rotation = request.rotation.or(self.original_rotation);
        let strength = request.strength.or(self.original_strength);
        let view = View::new(&self.compiled, camera, request.size.0, request.size.1);
        let is_same = rotation == self.rotation && strength == self.strength && request.edits == self.edits;
        if is_same && !view.needs_new_anchor(&self.compiled) {
            return Ok(());
        }
        let before = (self.rotation, self.strength, self.edits.clone());
        self.apply(rotation, strength, &request.edits);
        let size = (self.resolved.options.width, self.resolved.options.height);
        match self.compiler.compile(&self.loaded.scene, self.resolved.shading, camera, size) {
            Ok((compiled, _)) => self.compiled = compiled,
            Err(error) => {
                self.apply(before.0, before.1, &before.2);
                return Err(error);
            }
        }
        Ok(())
    }

    /// Changes the scene without compiling it. `rotation` in degrees.
    fn apply(&mut self, rotation: Option<f64>, strength: Option<f64>, edits: &Edits) {
        if let Some(degrees) = rotation {
            self.loaded.scene.set_environment_rotation(degrees.to_radians());
        }
        if let (Some(old), Some(new)) = (self.strength, strength) {
            set_environment_strength(&mut self.loaded.scene, old, new);
        }
        if *edits != self.edits {
            self.loaded.scene.materials = edits.applied(&self.original_materials);
            edits.change_lights(&mut self.loaded.scene, &self.original_lights);
        }
        (self.rotation, self.strength, self.edits) = (rotation, strength, edits.clone());
    }
}

/// Names of the scene's objects by number, at most a million.
fn objects(scene: &Scene) -> Arc<[String]> {
    let all = ObjectId::all(scene).take(1_000_000);
    all.map(|object| object.name(scene).unwrap_or_default().to_string()).collect()
}

/// Rotation of an environment map, degrees.
fn rotation(environment: &Environment) -> Option<f64> {
    match environment {
        Environment::Image { rotation_rad, .. } => Some(rotation_rad.to_degrees()),
        _ => None,
    }
}

/// Strength of an environment, as for `--env-strength`; `None` if scaling has no effect.
fn strength(environment: &Environment, given: Option<f32>) -> Option<f64> {
    let own = match environment {
        Environment::Image { strength, .. } => f64::from(*strength),
        Environment::Black => return None,
        _ => given.map_or(1.0, f64::from),
    };
    Some(own).filter(|strength| *strength > 0.0)
}

// Rendering of requests: first a small preview, then the full picture, pass by pass.

/// Maximum time of a preview, seconds.
const PREVIEW_S: f64 = 0.06;
/// Samples per second assumed before the first measurement.
const INITIAL_SPEED: f64 = 5e5;
/// Maximum ratio of the full size to a preview's.
const MAX_PREVIEW_SCALE: u32 = 8;

/// Renders requests until stopped.
///
/// # Errors
/// There is not enough memory for the first picture.
fn render_requests(
    args: &ViewArgs,
    mut model: Model,
    files: &WatchedFiles,
    cancel: &CancelHandle,
    shared: &Shared,
) -> Result<()> {
    let (mut done, mut speed) = (0, INITIAL_SPEED);
    // Error of the last reload; empty if it succeeded.
    let mut reload_error = String::new();
    while let Some(mut render_request) = shared.next_request(done) {
        done = render_request.number;
        if render_request.request.loads != model.loads {
            let args = &with_choices(args, &render_request.request);
            let loaded = model.reload(args, files, cancel, render_request.request.loads);
            let result =
                loaded.and_then(|()| show_reloaded(args, &model, &mut render_request.request, shared));
            reload_error = result.err().map_or(String::new(), |error| error.to_string());
        }
        // After errors the previous scene is rendered.
        let updated = model.update(&render_request.request);
        show_error(shared, updated.err().map_or(reload_error.clone(), |error| error.to_string()));
        if let Err(error) = render(&model, &render_request, shared, &mut speed) {
            if shared.lock().frame.is_none() {
                return Err(error);
            }
            show_error(shared, error.to_string());
        }
    }
    Ok(())
}

/// The arguments with the choices of a request.
fn with_choices(args: &ViewArgs, request: &ViewRequest) -> ViewArgs {
    let mut args = args.clone();
    args.render.stage.up = request.up.unwrap_or(args.render.stage.up);
    args.render.stage.stage = request.stage.or(args.render.stage.stage);
    args
}

/// Shows the information of a reloaded scene and adjusts requests to it.
fn show_reloaded(args: &ViewArgs, model: &Model, request: &mut ViewRequest, shared: &Shared) -> Result<()> {
    let (scene_info, poses) = (model.scene_info(args), model.poses(args));
    let own = model.request(args, &scene_info, &poses)?;
    shared.show(|state| {
        let before = std::mem::replace(&mut state.scene_info, scene_info).sizes;
        state.poses = poses;
        for request in [&mut *request, &mut state.request] {
            request.fit(&own, &before, &state.scene_info, &state.poses);
        }
    });
    Ok(())
}

/// Shows an error on pages; empty for none.
fn show_error(shared: &Shared, error: String) {
    if shared.lock().error_message != error {
        shared.show(|state| state.error_message = error);
    }
}

/// Renders until finished or cancelled by a newer request.
fn render(model: &Model, render_request: &RenderRequest, shared: &Shared, speed: &mut f64) -> Result<()> {
    let (width, height) = render_request.request.size;
    let pixels = f64::from(width) * f64::from(height);
    let takes_long = |scale: &u32| pixels / f64::from(scale * scale) / *speed > PREVIEW_S;
    let scale = [1, 2, 4].into_iter().find(|scale| !takes_long(scale)).unwrap_or(MAX_PREVIEW_SCALE);
    let steps = [(scale, Some(1)), (1, None)];
    for (scale, samples) in steps.into_iter().skip(usize::from(scale == 1)) {
        let is_last = samples.is_none();
        if !render_at(
            model,
            render_request,
            shared,
            speed,
            (scale, samples.unwrap_or(model.samples)),
            is_last,
        )? {
            break;
        }
    }
    Ok(())
}

/// Renders at the size divided by `scale`. Returns false if cancelled by a newer request.
fn render_at(
    model: &Model,
    render_request: &RenderRequest,
    shared: &Shared,
    speed: &mut f64,
    (scale, samples): (u32, u32),
    is_last: bool,
) -> Result<bool> {
    let (width, height) = render_request.request.size;
    let aovs = render_request.request.aov.map_or(PAGE_AOVS, |aov| PAGE_AOVS.with(aov));
    // With a time limit, the first pass takes a single sample.
    let options = model
        .resolved
        .options
        .size((width / scale).max(1), (height / scale).max(1))
        .samples(samples)
        .aovs(aovs)
        .halves(true)
        .time_limit(Some(Duration::from_secs(1 << 30)))
        // Training would delay the first picture.
        .guiding(Guiding::Off)
        .light_selection(LightSelection::Estimated)
        // An unreachable threshold, so that the noise is estimated.
        .noise(Some(f32::MIN_POSITIVE));
    let labels = Labels::of(&model.loaded.scene, &options);
    let camera = render_request.request.pose.for_rendering();
    let rendering = Rendering::labelled(model.compiled.clone(), labels, &camera, options)?;
    let scene = &model.loaded;
    let mut rendering = rendering
        .with_cancel_handle(render_request.cancel.clone())
        .placed(scene.scene.backdrop.clone(), scene.offset);
    loop {
        let (start, before) = (Instant::now(), rendering.statistics().samples);
        let outcome = rendering.next_pass();
        if outcome == PassOutcome::Cancelled {
            return Ok(false);
        }
        let taken = rendering.statistics().samples - before;
        if taken > 0 {
            *speed = taken as f64 / start.elapsed().as_secs_f64().max(1e-4);
        }
        let is_done = outcome != PassOutcome::Progressed;
        let frame = Frame { scale, ..Frame::of(&rendering, is_done && is_last, render_request.number) };
        // A newer request must not be answered by this frame.
        if render_request.cancel.is_cancelled() {
            return Ok(false);
        }
        shared.show(|state| state.frame = Some(frame.into()));
        if is_done {
            return Ok(true);
        }
    }
}
