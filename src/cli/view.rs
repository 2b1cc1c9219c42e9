//! `oscura view`: a page that shows a scene while it renders. One thread renders (on the pool's threads), one takes
//! requests and starts a thread for each ([`Page`]), one watches files and signals.

use super::args::RenderArgs;
use super::page::{
    Edits, Frame, LightInfo, Page, PageDisplay, Pose, RECORDED, RenderRequest, SceneInfo, Shared,
    ViewRequest, bind, own_command, strengthen,
};
use super::parsers::whole;
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
use oscura::load::{LoadOptions, Loaded, SavedFiles, Up, has_ambiguous_up};
use oscura::math::DVec3;
use oscura::output::PngOptions;
use oscura::render::{CancelHandle, Guiding, Labels, PassOutcome, Rendering, ResolvedOptions, in_pool};
use oscura::scene::{Camera, Environment, Light, Material, Scene, instance_extents, scene_extent};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How often signals and files are looked at.
const TICK: Duration = Duration::from_millis(50);
const WATCH: Duration = Duration::from_millis(500);

/// Serves the page until a signal ends it.
pub(crate) fn run(args: &ViewArgs) -> Result<Outcome> {
    let mut args = args.clone();
    args.picture.scene = args.picture.scenes.first().cloned().unwrap_or_default();
    let cancel = cancel_by_signals()?;
    let threads = args.picture.threads.map(usize::from);
    in_pool(threads, || show(&args, &cancel))?
}

fn show(args: &ViewArgs, cancel: &CancelHandle) -> Result<Outcome> {
    // A port in use is reported before the scene is loaded.
    let server = bind(args.port)?;
    let files = SavedFiles::default();
    let model = Model::load(args, &files, cancel)?;
    let (facts, poses) = (model.facts(args), model.poses(args));
    if !args.picture.quiet {
        facts.notes.iter().for_each(|note| say!("note: {note}"));
    }
    let wish = model.wish(args, &facts, &poses)?;
    let display = PageDisplay { denoise: !args.picture.picture.no_denoise, ..model.display() };
    let shared = Shared::new(wish, display, facts, poses);
    let page = Page::open(server, shared, &args.picture, !args.no_open);
    // Rendering stays on this thread, which belongs to the pool.
    std::thread::scope(|scope| {
        scope.spawn(|| watch_over(args.watch.then_some(&files), cancel, &page.shared));
        let done = render_wishes(args, model, &files, cancel, &page.shared);
        page.shared.end();
        done
    })?;
    Ok(Outcome::Done)
}

/// Ends all at a signal, and has the scene loaded again when one of these files was saved.
fn watch_over(files: Option<&SavedFiles>, cancel: &CancelHandle, shared: &Shared) {
    let mut looked = Instant::now();
    while !shared.lock().is_over {
        std::thread::sleep(TICK);
        if cancel.is_cancelled() {
            shared.end();
        }
        let Some(files) = files.filter(|_| looked.elapsed() >= WATCH) else { continue };
        looked = Instant::now();
        if files.have_changed() {
            shared.wish(|state| state.wish.loads += 1);
        }
    }
}

// The arguments of `oscura view`: those of `render`, but for what concerns files that are written.

/// Arguments of `render` that have no meaning here: they are about files, sequences and reports.
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
    pub picture: RenderArgs,
    /// Port of the local web server [default: a free one].
    #[arg(long, value_name = "N", value_parser = whole::<u16>(0, 65535), default_value = "0", hide_default_value = true)]
    pub port: u16,
    /// Print the page's address without opening a browser.
    #[arg(long)]
    pub no_open: bool,
    /// Reload the scene when one of its files changes.
    #[arg(long)]
    pub watch: bool,
}

/// Takes the unused arguments out of the command's help.
pub(crate) fn adapt(command: Command) -> Command {
    let command = command.mut_arg("scenes", |arg| {
        arg.num_args(1)
            .help("The scene: .gltf, .glb, .vrm, .obj, .ply, .spz, .stl, .3mf, .zip, .toml or .blend")
    });
    // Arguments that `render` requires are optional here.
    let output = Arg::new("output").short('o').long("output").action(ArgAction::Append);
    let command = command.mut_arg("output", |_| output.value_parser(value_parser!(PathBuf)));
    UNUSED.iter().fold(command, |command, id| command.mut_arg(id, |arg| arg.hide(true)))
}

/// Refuses unused arguments that were given.
///
/// # Errors
/// As clap reports unknown arguments.
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
    let message = format!("{argument} has no meaning for what is shown in a browser; 'oscura render' has it");
    Err(command.error(ErrorKind::UnknownArgument, message))
}

// The viewed scene: loaded, compiled, and adjusted to the requests of pages.

/// Samples of a finished picture, unless the arguments say so.
const SAMPLES: u32 = 1024;
/// Maximum number of pixels that a picture has at first, unless the arguments say so.
const PIXELS: u64 = 640_000;
/// Maximum number of lights that pages list.
const MOST_LIGHTS: usize = 512;

struct Model {
    pub loaded: Loaded,
    pub resolved: ResolvedOptions,
    pub compiled: Arc<CompiledScene>,
    /// Samples of a finished picture.
    pub samples: u32,
    pub png: PngOptions,
    /// Which wish for loading it follows.
    pub loads: u64,
    compiler: Compiler,
    triangles: u64,
    notes: Vec<String>,
    /// How the environment was turned when it was loaded, degrees.
    own_rotation: Option<f64>,
    rotation: Option<f64>,
    /// Strength of the environment as it was loaded, if it has one that could be another.
    own_strength: Option<f64>,
    strength: Option<f64>,
    /// The materials and lights as loaded, and their changes.
    own_materials: Arc<[Material]>,
    own_lights: Vec<Light>,
    light_infos: Arc<[LightInfo]>,
    edits: Edits,
}

impl Model {
    /// Loads and compiles the scene, and has its files watched in place of those before; where that fails, besides them.
    ///
    /// # Errors
    /// As `oscura render` does.
    pub fn load(args: &ViewArgs, files: &SavedFiles, cancel: &CancelHandle) -> Result<Model> {
        let newer = SavedFiles::default();
        let model = Model::read(&args.picture, &newer, cancel);
        files.replace_by(&newer, model.is_err());
        model
    }

    fn read(args: &RenderArgs, files: &SavedFiles, cancel: &CancelHandle) -> Result<Model> {
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
        compiler.expect_other_cameras();
        let wants = PictureUse { has_exr: true, keeps_uv: true, pictures: 1 };
        let prepared = prepare(
            &completed(args, &loaded.scene.settings),
            wants,
            Some(&environment),
            &mut loaded,
            start,
            &mut compiler,
        )?;
        let Prepared { scene, resolved, png, notes, warnings, build, .. } = prepared;
        let own_rotation = rotation(&loaded.scene.environment);
        let own_strength = strength(&loaded.scene.environment, args.env_strength);
        let own_materials = loaded.scene.materials.clone().into();
        let own_lights = loaded.scene.lights.clone();
        let light_infos = LightInfo::all(&loaded.scene).into_iter().take(MOST_LIGHTS).collect();
        Ok(Model {
            loaded,
            resolved,
            compiled: scene,
            samples: args.spp.unwrap_or(SAMPLES),
            png,
            loads: 0,
            compiler,
            triangles: build.triangles,
            notes: notes.iter().chain(&warnings).map(Warning::to_string).collect(),
            own_rotation,
            rotation: own_rotation,
            own_strength,
            strength: own_strength,
            own_materials,
            own_lights,
            light_infos,
            edits: Edits::default(),
        })
    }

    /// The initial settings.
    pub fn wish(&self, args: &ViewArgs, facts: &SceneInfo, poses: &[Pose]) -> Result<ViewRequest> {
        let fits = |&&(w, h): &&(u32, u32)| u64::from(w) * u64::from(h) <= PIXELS;
        let is_chosen = args.picture.width.or(args.picture.height).is_some();
        let whole = (self.resolved.options.width, self.resolved.options.height);
        let size = facts.sizes.iter().rev().find(fits).filter(|_| !is_chosen).copied().unwrap_or(whole);
        let camera = self.resolved.camera.unwrap_or(0);
        let pose =
            poses.get(camera).cloned().ok_or_else(|| Error::input(&args.picture.scene, "has no camera"))?;
        let rotation = self.own_rotation.and(args.picture.env_rotation);
        let strength = args.picture.env_strength.map(f64::from).filter(|_| self.own_strength.is_some());
        let stage = &args.picture.stage;
        let (up, stage) = (Some(stage.up).filter(|up| *up != Up::Auto), stage.stage);
        let (edits, loads) = (Edits::default(), self.loads);
        Ok(ViewRequest { pose, camera, size, rotation, strength, edits, aov: None, up, stage, loads })
    }

    pub fn display(&self) -> PageDisplay {
        PageDisplay::new(self.png.clone())
    }

    /// Facts about it for pages.
    pub fn facts(&self, args: &ViewArgs) -> SceneInfo {
        let (w, h) = (self.resolved.options.width, self.resolved.options.height);
        let part = |(n, of): (u64, u64)| [w, h].map(|v| (u64::from(v) * n / of).max(1) as u32).into();
        let has_stage = self.loaded.turntable.is_some() && args.picture.env.is_none();
        let name = args.picture.scene.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let camera = |(i, camera): (usize, &Camera)| match camera.name.as_str() {
            "" => format!("Camera {i}"),
            name => name.to_string(),
        };
        let scene = &args.picture.scene;
        let is_model = !scene.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        let sidecar = (is_model && !args.picture.no_sidecar).then(|| sidecar_path(scene));
        SceneInfo {
            name,
            cameras: self.loaded.scene.cameras.iter().enumerate().map(camera).collect(),
            triangles: self.triangles,
            sizes: [(1, 4), (1, 2), (3, 4), (1, 1)].map(part).to_vec(),
            rotation: self.own_rotation,
            strength: self.own_strength,
            sidecar: sidecar.as_ref().and_then(|path| Some(path.file_name()?.to_string_lossy().into_owned())),
            sidecar_path: sidecar,
            materials: self.own_materials.clone(),
            lights: self.light_infos.clone(),
            samples: self.samples,
            passes: self.passes(),
            up: has_ambiguous_up(&args.picture.scene).then(|| args.picture.stage.up.name()),
            stage: has_stage.then(|| args.picture.stage.stage.unwrap_or(StageArg::Studio).name()),
            ups: Up::ALL.map(Up::name).to_vec(),
            stages: StageArg::value_variants().iter().map(|stage| stage.name()).collect(),
            objects: objects(&self.loaded.scene),
            notes: self.notes.clone(),
            is_live: true,
            command: own_command(),
        }
    }

    /// Passes that can be shown. Motion is known only if it was asked for at loading.
    fn passes(&self) -> Vec<(&'static str, &'static str)> {
        let knows_motion = self.resolved.options.aovs.contains(Aov::Motion);
        let shown = Aov::ALL.iter().filter(|aov| knows_motion || **aov != Aov::Motion);
        shown.map(|aov| (aov.info().option, aov.info().about)).collect()
    }

    /// The scene's cameras.
    pub fn poses(&self, args: &ViewArgs) -> Vec<Pose> {
        let scene = &self.loaded.scene;
        let bounds = scene_extent(scene, &instance_extents(scene)).0;
        let (low, high) = bounds.unwrap_or((DVec3::NEG_ONE, DVec3::ONE));
        let chosen = self.resolved.camera.unwrap_or(0);
        let pose = |(number, camera): (usize, &Camera)| {
            let eye = camera.world_from_camera.translation;
            let ahead = camera.world_from_camera.transform_vector3(DVec3::NEG_Z);
            let distance = (0.5 * (low + high) - eye).dot(ahead);
            // A camera within the scene may look away from its middle.
            let distance = if distance > 0.0 { distance } else { 0.5 * low.distance(high).max(1e-3) };
            let pose = Pose::new(camera.clone(), distance);
            match number == chosen {
                true => pose.with_arguments(&args.picture.place, args.picture.stage.fov),
                false => pose,
            }
        };
        scene.cameras.iter().enumerate().map(pose).collect()
    }

    /// Loads the scene again, as the wish of a number asks for.
    ///
    /// # Errors
    /// As [`Model::load`]; the scene then stays as it was.
    pub fn reload(
        &mut self,
        args: &ViewArgs,
        files: &SavedFiles,
        cancel: &CancelHandle,
        loads: u64,
    ) -> Result<()> {
        // Also if it fails: it is tried once.
        self.loads = loads;
        *self = Model { loads, ..Model::load(args, files, cancel)? };
        Ok(())
    }

    /// Adjusts and compiles the scene for a request.
    ///
    /// # Errors
    /// Those of compiling; the scene then stays as it was.
    pub fn follow(&mut self, wish: &ViewRequest) -> Result<()> {
        let camera = wish.pose.camera();
        let wanted = wish.rotation.or(self.own_rotation);
        let strength = wish.strength.or(self.own_strength);
        let view = View::new(&self.compiled, camera, wish.size.0, wish.size.1);
        let is_same = wanted == self.rotation && strength == self.strength && wish.edits == self.edits;
        if is_same && !view.needs_new_anchor(&self.compiled) {
            return Ok(());
        }
        let before = (self.rotation, self.strength, self.edits.clone());
        self.change(wanted, strength, &wish.edits);
        let size = (self.resolved.options.width, self.resolved.options.height);
        match self.compiler.compile(&self.loaded.scene, self.resolved.shading, camera, size) {
            Ok((compiled, _)) => self.compiled = compiled,
            Err(error) => {
                self.change(before.0, before.1, &before.2);
                return Err(error);
            }
        }
        Ok(())
    }

    /// Changes the scene, which is not compiled yet.
    fn change(&mut self, rotation: Option<f64>, strength: Option<f64>, edits: &Edits) {
        turn(&mut self.loaded.scene, rotation);
        if let (Some(before), Some(wanted)) = (self.strength, strength) {
            strengthen(&mut self.loaded.scene, before, wanted);
        }
        if *edits != self.edits {
            self.loaded.scene.materials = edits.applied(&self.own_materials);
            edits.change_lights(&mut self.loaded.scene, &self.own_lights);
        }
        (self.rotation, self.strength, self.edits) = (rotation, strength, edits.clone());
    }
}

/// Turns an environment's picture to an angle, degrees.
fn turn(scene: &mut Scene, wanted: Option<f64>) {
    if let Some(degrees) = wanted {
        scene.turn_environment(degrees.to_radians());
    }
}

/// The names of a scene's objects by number, of the first million.
fn objects(scene: &Scene) -> Arc<[String]> {
    let all = ObjectId::all(scene).take(1_000_000);
    all.map(|object| object.name(scene).unwrap_or_default().to_string()).collect()
}

fn rotation(environment: &Environment) -> Option<f64> {
    match environment {
        Environment::Image { rotation_rad, .. } => Some(rotation_rad.to_degrees()),
        _ => None,
    }
}

/// The strength of an environment, as `--env-strength` has it; `None` where nothing could be stronger.
fn strength(environment: &Environment, given: Option<f32>) -> Option<f64> {
    let own = match environment {
        Environment::Image { strength, .. } => f64::from(*strength),
        Environment::Black => return None,
        _ => given.map_or(1.0, f64::from),
    };
    Some(own).filter(|strength| *strength > 0.0)
}

// Renders the requests of pages: a small picture first, then the full one, pass by pass.

/// How long a small first picture may take, seconds.
const PREVIEW_S: f64 = 0.06;
/// Samples a second assumed until the first picture is measured.
const FIRST_GUESS: f64 = 5e5;
/// Largest size of the finished picture over that of a first one.
const COARSEST: u32 = 8;

/// Fulfils wishes until all is over.
///
/// # Errors
/// If there is no memory for the first picture.
fn render_wishes(
    args: &ViewArgs,
    mut model: Model,
    files: &SavedFiles,
    cancel: &CancelHandle,
    shared: &Shared,
) -> Result<()> {
    let (mut done, mut speed) = (0, FIRST_GUESS);
    // Why the scene could not be loaded again; empty if it could.
    let mut broken = String::new();
    while let Some(mut order) = shared.next_order(done) {
        done = order.number;
        if order.wish.loads != model.loads {
            let args = &chosen(args, &order.wish);
            let loaded = model.reload(args, files, cancel, order.wish.loads);
            let taken = loaded.and_then(|()| replace_by(args, &model, &mut order.wish, shared));
            broken = taken.err().map_or(String::new(), |error| error.to_string());
        }
        // After an error the earlier scene stays and is rendered.
        let followed = model.follow(&order.wish);
        report_trouble(shared, followed.err().map_or(broken.clone(), |error| error.to_string()));
        if let Err(error) = render(&model, &order, shared, &mut speed) {
            if shared.lock().frame.is_none() {
                return Err(error);
            }
            report_trouble(shared, error.to_string());
        }
    }
    Ok(())
}

/// The arguments with the choices of pages.
fn chosen(args: &ViewArgs, wish: &ViewRequest) -> ViewArgs {
    let mut args = args.clone();
    args.picture.stage.up = wish.up.unwrap_or(args.picture.stage.up);
    args.picture.stage.stage = wish.stage.or(args.picture.stage.stage);
    args
}

/// Shows the facts of a scene that was loaded again, and adjusts the request to it.
fn replace_by(args: &ViewArgs, model: &Model, wish: &mut ViewRequest, shared: &Shared) -> Result<()> {
    let (facts, poses) = (model.facts(args), model.poses(args));
    let own = model.wish(args, &facts, &poses)?;
    shared.show(|state| {
        let before = std::mem::replace(&mut state.facts, facts).sizes;
        state.poses = poses;
        for wish in [&mut *wish, &mut state.wish] {
            wish.fit(&own, &before, &state.facts, &state.poses);
        }
    });
    Ok(())
}

/// Shows an error, unless it is shown already.
fn report_trouble(shared: &Shared, trouble: String) {
    if shared.lock().trouble != trouble {
        shared.show(|state| state.trouble = trouble);
    }
}

/// Renders until all samples are taken or something else is wanted.
fn render(model: &Model, order: &RenderRequest, shared: &Shared, speed: &mut f64) -> Result<()> {
    let (width, height) = order.wish.size;
    let pixels = f64::from(width) * f64::from(height);
    let takes_long = |scale: &u32| pixels / f64::from(scale * scale) / *speed > PREVIEW_S;
    let scale = [1, 2, 4].into_iter().find(|scale| !takes_long(scale)).unwrap_or(COARSEST);
    let steps = [(scale, Some(1)), (1, None)];
    for (scale, samples) in steps.into_iter().skip(usize::from(scale == 1)) {
        let is_last = samples.is_none();
        if !render_at(model, order, shared, speed, (scale, samples.unwrap_or(model.samples)), is_last)? {
            break;
        }
    }
    Ok(())
}

/// Renders at the size divided by a scale. Returns false if a newer request cancelled it.
fn render_at(
    model: &Model,
    order: &RenderRequest,
    shared: &Shared,
    speed: &mut f64,
    (scale, samples): (u32, u32),
    is_last: bool,
) -> Result<bool> {
    let (width, height) = order.wish.size;
    let aovs = order.wish.aov.map_or(RECORDED, |aov| RECORDED.with(aov));
    // A limit makes the first pass one of a single sample.
    let options = model
        .resolved
        .options
        .size((width / scale).max(1), (height / scale).max(1))
        .samples(samples)
        .aovs(aovs)
        .halves(true)
        .time_limit(Some(Duration::from_secs(1 << 30)))
        // The first picture can't wait until paths have learned.
        .guiding(Guiding::Off)
        // Estimated, but never low enough to stop.
        .noise(Some(f32::MIN_POSITIVE));
    let labels = Labels::of(&model.loaded.scene, &options);
    let camera = order.wish.pose.for_rendering();
    let rendering = Rendering::labelled(model.compiled.clone(), labels, &camera, options)?;
    let scene = &model.loaded;
    let mut rendering =
        rendering.with_cancel_handle(order.cancel.clone()).placed(scene.scene.backdrop.clone(), scene.offset);
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
        let frame = Frame { scale, ..Frame::of(&rendering, is_done && is_last, order.number) };
        // A late frame would replace a newer one.
        if order.cancel.is_cancelled() {
            return Ok(false);
        }
        shared.show(|state| state.frame = Some(frame.into()));
        if is_done {
            return Ok(true);
        }
    }
}
