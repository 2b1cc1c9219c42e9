//! Requested and shown pictures; shared by the threads that serve them and the one that renders.

use super::edits::{Edits, LightInfo, MaterialInfo, text};
use super::pose::Pose;
use crate::cli::process;
use crate::cli::scene_args::StageArg;
use oscura::film::{Aov, AovSet, Film, Values};
use oscura::load::Up;
use oscura::output::{OutputOptions, PngOptions, ViewTransform};
use oscura::render::{CancelHandle, Rendering};
use oscura::scene::Material;
use serde_json::{Map, Value, json};
use std::path::PathBuf;
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::Duration;

/// The settings of the next picture.
#[derive(Clone, Debug)]
pub(crate) struct ViewRequest {
    pub pose: Pose,
    /// Number of the scene's camera that the pose started at.
    pub camera: usize,
    /// Pixels.
    pub size: (u32, u32),
    /// How far the environment's picture is turned, degrees; without, as the scene has it.
    pub rotation: Option<f64>,
    /// The environment's strength, as `--env-strength` has it; without, as the scene has it.
    pub strength: Option<f64>,
    /// Changed materials and lights.
    pub edits: Edits,
    /// Further AOV to record, besides colour and depth.
    pub aov: Option<Aov>,
    /// The axis that points up, and what lights a model, if pages chose them.
    pub up: Option<Up>,
    pub stage: Option<StageArg>,
    /// How often the scene was to be loaded again.
    pub loads: u64,
}

impl ViewRequest {
    /// A view by the first camera, with the scene's own settings.
    pub fn new(pose: Pose, size: (u32, u32)) -> ViewRequest {
        ViewRequest {
            pose,
            camera: 0,
            size,
            rotation: None,
            strength: None,
            edits: Edits::default(),
            aov: None,
            up: None,
            stage: None,
            loads: 0,
        }
    }

    /// Adjusts the request to a scene that was loaded again: `own` is its initial request, `sizes_before` were the sizes to choose from.
    pub fn fit(&mut self, own: &ViewRequest, sizes_before: &[(u32, u32)], facts: &SceneInfo, poses: &[Pose]) {
        if !facts.sizes.contains(&self.size) {
            let place = sizes_before.iter().position(|size| *size == self.size);
            self.size = place.and_then(|at| facts.sizes.get(at)).copied().unwrap_or(own.size);
        }
        match poses.get(self.camera) {
            None => (self.camera, self.pose) = (own.camera, own.pose.clone()),
            // A camera that nobody has moved is the file's.
            Some(fresh) if !self.pose.is_changed() => self.pose = fresh.clone(),
            Some(_) => {}
        }
        self.rotation = facts.rotation.and(self.rotation.or(own.rotation));
        self.strength = facts.strength.and(self.strength.or(own.strength));
    }
}

/// Facts about the scene for the page.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub(crate) struct SceneInfo {
    pub name: String,
    pub cameras: Vec<String>,
    pub triangles: u64,
    /// Sizes that pictures may have.
    pub sizes: Vec<(u32, u32)>,
    /// Degrees; none without a picture as environment.
    pub rotation: Option<f64>,
    /// The environment's strength; none without an environment.
    pub strength: Option<f64>,
    /// The file beside the model that changes of materials and lights are written to; none where the scene's own file has them.
    pub sidecar: Option<String>,
    #[serde(skip)]
    pub sidecar_path: Option<PathBuf>,
    /// The materials as they were loaded, by number.
    #[serde(skip)]
    pub materials: Arc<[Material]>,
    /// The lights as they were loaded.
    #[serde(skip)]
    pub lights: Arc<[LightInfo]>,
    /// Samples of the finished picture.
    pub samples: u32,
    /// Passes that may be shown, with their descriptions.
    pub passes: Vec<(&'static str, &'static str)>,
    /// The axis that points up, where that may be chosen.
    pub up: Option<&'static str>,
    /// The stage of a model without a camera.
    pub stage: Option<String>,
    /// The names that both may have.
    pub ups: Vec<&'static str>,
    pub stages: Vec<String>,
    /// Notes and warnings.
    pub notes: Vec<String>,
    /// May pages move the camera and the like? Else they look on.
    pub is_live: bool,
    /// The start of a command that renders this scene; choices of pages follow.
    #[serde(skip)]
    pub command: Vec<String>,
    /// Names of the objects, by number.
    #[serde(skip)]
    pub objects: Arc<[String]>,
}

pub(crate) struct State {
    pub wish: ViewRequest,
    /// Counts wishes.
    pub wishes: u64,
    pub display: PageDisplay,
    pub facts: SceneInfo,
    /// The scene's cameras.
    pub poses: Vec<Pose>,
    /// Materials, lights and the environment's strength before each unsaved change.
    pub before: Vec<(Edits, Option<f64>)>,
    /// The latest picture.
    pub frame: Option<Arc<Frame>>,
    /// The latest one that was denoised.
    pub denoised: Option<Denoised>,
    /// The last error; empty if there was none.
    pub trouble: String,
    /// Counts all that pages show.
    pub version: u64,
    /// The version at which the pixels changed.
    pub pixels_version: u64,
    pub is_over: bool,
    /// Stops the rendering in progress.
    cancel: CancelHandle,
}

/// A wish to fulfil.
pub(crate) struct RenderRequest {
    pub wish: ViewRequest,
    /// Which one it is.
    pub number: u64,
    /// Used when a newer one comes.
    pub cancel: CancelHandle,
}

/// The state for many threads.
pub(crate) struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

impl Shared {
    pub fn new(wish: ViewRequest, display: PageDisplay, facts: SceneInfo, poses: Vec<Pose>) -> Shared {
        let state = State {
            wish,
            wishes: 1,
            display,
            facts,
            poses,
            before: Vec::new(),
            frame: None,
            denoised: None,
            trouble: String::new(),
            version: 0,
            pixels_version: 0,
            is_over: false,
            cancel: CancelHandle::new(),
        };
        Shared { state: Mutex::new(state), changed: Condvar::new() }
    }

    /// A thread that panicked leaves a state that is still whole: every change is made in one go.
    pub fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Changes the request and cancels the current rendering.
    pub fn wish(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.lock();
        change(&mut state);
        state.wishes += 1;
        state.version += 1;
        state.cancel.cancel();
        self.changed.notify_all();
    }

    /// Changes the displayed pass.
    pub fn show(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.lock();
        change(&mut state);
        state.version += 1;
        state.pixels_version = state.version;
        self.changed.notify_all();
    }

    /// Ends everything that waits.
    pub fn end(&self) {
        self.wish(|state| state.is_over = true);
    }

    /// Waits for a newer wish than one that was fulfilled; `None` when all is over.
    pub fn next_order(&self, done: u64) -> Option<RenderRequest> {
        let has_news = |state: &mut State| state.wishes <= done && !state.is_over;
        let state = self.changed.wait_while(self.lock(), has_news);
        let mut state = state.unwrap_or_else(|poisoned| poisoned.into_inner());
        if state.is_over {
            return None;
        }
        state.cancel = CancelHandle::new();
        Some(RenderRequest { wish: state.wish.clone(), number: state.wishes, cancel: state.cancel.clone() })
    }

    /// Waits for a frame of what is wanted that is due to be denoised; `None` when all is over.
    pub fn next_frame(&self, is_due: impl Fn(&Frame) -> bool) -> Option<Arc<Frame>> {
        let suits = |state: &State, frame: &Frame| frame.order == state.wishes && is_due(frame);
        let waits = |state: &mut State| {
            let due = state.display.denoise && state.frame.as_ref().is_some_and(|frame| suits(state, frame));
            !due && !state.is_over
        };
        let state = self.changed.wait_while(self.lock(), waits);
        let state = state.unwrap_or_else(|poisoned| poisoned.into_inner());
        state.frame.clone().filter(|_| !state.is_over)
    }

    /// Waits for a newer version than `version`, at most for `most`.
    pub fn wait_for_news(&self, version: u64, most: Duration) -> MutexGuard<'_, State> {
        let is_old =
            |state: &mut State| (state.version <= version || state.frame.is_none()) && !state.is_over;
        let waited = self.changed.wait_timeout_while(self.lock(), most, is_old);
        waited.unwrap_or_else(|poisoned| poisoned.into_inner()).0
    }
}

// The status that pages get, as JSON.

/// Everything but the pixels and their size.
pub(super) fn state_json(state: &State, frame: &Frame) -> Value {
    let png = &state.display.png;
    let pass = state.display.aov.filter(|&aov| frame.film.aov(aov).is_some());
    json!({
        "version": state.version,
        "samples": frame.samples,
        "seconds": frame.seconds,
        "error": frame.error,
        "finished": frame.is_finished && frame.order == state.wishes,
        "preview": frame.scale > 1,
        "order": frame.order,
        "denoise": state.display.denoise,
        "denoised": state.denoised_frame().map(|denoised| denoised.samples),
        "split": state.display.split,
        "trouble": state.trouble,
        "up": state.wish.up.map(Up::name).or(state.facts.up),
        "stage": state.wish.stage.map(StageArg::name).or(state.facts.stage.clone()),
        "facts": state.facts,
        "size": state.wish.size,
        "camera": state.wish.camera,
        "rotation": state.wish.rotation.or(state.facts.rotation),
        "strength": state.wish.strength.or(state.facts.strength),
        "edited": edited(state),
        "lights": state.wish.edits.light_infos(&state.facts.lights),
        "toml": text(&state.wish.edits.tables(&state.facts.materials, &state.facts.lights)),
        "undo": state.before.len(),
        "defocus": state.wish.pose.defocus(),
        "exposure": png.exposure,
        "view": png.view.name(),
        "views": state.display.views(),
        "pass": pass.map_or("", |aov| aov.info().option),
        "command": command(state),
    })
}

/// The materials that pages changed, as they are now.
fn edited(state: &State) -> Value {
    let all = state.wish.edits.applied(&state.facts.materials);
    let names = all.iter().filter(|material| state.wish.edits.has(&material.name));
    let infos = names.map(|material| (material.name.clone(), json!(MaterialInfo::of(material))));
    Value::Object(infos.collect::<Map<_, _>>())
}

impl State {
    /// The denoised picture of the displayed pass, if there is one and it is requested.
    pub fn denoised_frame(&self) -> Option<&Denoised> {
        let order = self.frame.as_ref()?.order;
        self.denoised.as_ref().filter(|denoised| self.display.denoise && denoised.order == order)
    }
}

/// The command that renders the displayed picture.
fn command(state: &State) -> String {
    let mut words = state.facts.command.clone();
    if !state.facts.is_live {
        return words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ");
    }
    let mut add = |option: &str, value: String| words.extend([option.to_string(), value]);
    let (width, height) = state.wish.size;
    add("--width", width.to_string());
    add("--height", height.to_string());
    if state.wish.camera > 0 {
        add("--camera", state.wish.camera.to_string());
    }
    if let Some(rotation) = state.wish.rotation {
        add("--env-rotation", rotation.to_string());
    }
    if let Some(strength) = state.wish.strength {
        add("--env-strength", strength.to_string());
    }
    if let Some(stage) = state.wish.stage {
        add("--stage", stage.name());
    }
    // The scene file may set other values.
    add("--exposure", state.display.png.exposure.to_string());
    add("--spp", state.facts.samples.to_string());
    add("--view", state.display.png.view.name().to_string());
    // An axis with a minus sign could be taken for an option.
    words.extend(state.wish.up.map(|up| format!("--up={}", up.name())));
    words.push(if state.display.denoise { "--denoise" } else { "--no-denoise" }.to_string());
    words.extend(state.wish.pose.arguments());
    words.extend(["-o".to_string(), "picture.exr".to_string(), "-o".to_string(), "picture.png".to_string()]);
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

/// The `render` command of this process, without the settings of pages.
pub(crate) fn own_command() -> Vec<String> {
    let words = ["oscura", "render"].map(str::to_string);
    words.into_iter().chain(given(arguments())).collect()
}

/// The arguments of this process.
pub(super) fn arguments() -> impl Iterator<Item = String> {
    process::words().map(|word| word.to_string_lossy().into_owned())
}

/// The arguments of this process that a render takes as well and that the page doesn't set.
fn given(arguments: impl Iterator<Item = String>) -> Vec<String> {
    const FLAGS: [&str; 4] = ["--no-open", "--watch", "--denoise", "--no-denoise"];
    const SET: [&str; 19] = [
        "--up",
        "--stage",
        "--size",
        "--resolution",
        "--camera",
        "--port",
        "--width",
        "--height",
        "--exposure",
        "--view",
        "--env-rotation",
        "--env-strength",
        "--eye",
        "--target",
        "--focus",
        "--defocus",
        "--view-height",
        "--fov",
        "--spp",
    ];
    let (mut kept, mut arguments) = (Vec::new(), arguments.skip_while(|a| a == "view"));
    while let Some(argument) = arguments.next() {
        let name = argument.split_once('=').map_or(argument.as_str(), |(name, _)| name);
        if FLAGS.contains(&name) {
            continue;
        }
        if SET.contains(&name) {
            if name.len() == argument.len() {
                arguments.next();
            }
            continue;
        }
        kept.push(argument);
    }
    kept
}

/// A word as shells take it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=+%@".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_string(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}

// A picture on its way, as pages show it.

/// How pictures are shown.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PageDisplay {
    pub png: PngOptions,
    /// The pass to show in place of colour.
    pub aov: Option<Aov>,
    /// A view besides those with names, to go back to.
    pub own_view: Option<ViewTransform>,
    /// Is the denoised picture shown, once there is one?
    pub denoise: bool,
    /// Share of the width, from the left, that shows the picture before denoising.
    pub split: f64,
}

impl PageDisplay {
    /// The colour setting.
    pub fn new(png: PngOptions) -> PageDisplay {
        let own_view = Some(png.view.clone()).filter(|view| matches!(view, ViewTransform::Table(_)));
        PageDisplay { png, aov: None, own_view, denoise: false, split: 0.0 }
    }

    /// The names of all views.
    pub fn views(&self) -> Vec<String> {
        let named = ViewTransform::NAMED.iter().map(|named| named.1.to_string());
        named.chain(self.own_view.iter().map(|view| view.name().into_owned())).collect()
    }

    /// The view of a name.
    pub fn view(&self, name: &str) -> Option<ViewTransform> {
        let own = self.own_view.as_ref().filter(|view| view.name() == name);
        own.cloned().or_else(|| ViewTransform::from_name(name))
    }
}

/// AOVs that `oscura view` always records: those for denoising, and those that are shown small or at once.
pub(crate) const RECORDED: AovSet = AovSet::NONE
    .with(Aov::Depth)
    .with(Aov::Normal)
    .with(Aov::Albedo)
    .with(Aov::ObjectId)
    .with(Aov::MaterialId)
    .with(Aov::DenoisingAlbedo)
    .with(Aov::DenoisingNormal);

/// A frame after denoising.
#[derive(Clone)]
pub(crate) struct Denoised {
    pub film: Arc<Film>,
    /// The denoiser and its guides.
    pub by: Arc<str>,
    // As the frame had them.
    pub samples: f64,
    pub scale: u32,
    pub is_finished: bool,
    pub order: u64,
}

/// A picture so far.
pub(crate) struct Frame {
    /// Colour, [`RECORDED`], and at most one more AOV; of a render in progress, what it records.
    pub film: Film,
    pub output: OutputOptions,
    pub samples: f64,
    pub seconds: f64,
    /// Estimated relative error of the whole picture, once there is an estimate.
    pub error: Option<f64>,
    /// Size of the finished picture over that of this one.
    pub scale: u32,
    pub is_finished: bool,
    /// The number of the wish that it fulfils.
    pub order: u64,
}

impl Frame {
    /// The picture so far, in full size, for the wish of a number.
    pub fn of(rendering: &Rendering, is_finished: bool, order: u64) -> Frame {
        let statistics = rendering.statistics();
        Frame {
            film: rendering.shown().into_owned(),
            output: rendering.output_options(),
            samples: statistics.samples_per_pixel,
            seconds: statistics.render_s,
            error: statistics.error,
            scale: 1,
            is_finished,
            order,
        }
    }

    /// Everything about the pixel at a place, as shares of width and height from the upper left corner.
    pub fn probe(&self, x: f64, y: f64) -> Option<Value> {
        let (x, y) = self.pixel(x, y)?;
        let mut values = Map::new();
        for plane in self.film.pixel(x, y).ok()?.planes() {
            let value = match &plane.values {
                Values::Float(values) => values.first().map(|v| json!(v)),
                Values::Uint(values) => values.first().map(|v| json!(v)),
                _ => None,
            };
            values.insert(plane.name.to_string(), value.unwrap_or(Value::Null));
        }
        let scale = self.scale;
        Some(json!({ "x": x * scale, "y": y * scale, "samples": self.film.samples(x, y), "values": values }))
    }

    /// Depth at a place, metres; `None` where nothing was hit.
    pub fn depth(&self, x: f64, y: f64) -> Option<f64> {
        let (x, y) = self.pixel(x, y)?;
        let depth = *self.film.pixel(x, y).ok()?.plane("Z")?.into_floats().first()?;
        (depth > 0.0 && depth < 0.5 * oscura::film::BACKGROUND_DEPTH).then_some(f64::from(depth))
    }

    pub(super) fn pixel(&self, x: f64, y: f64) -> Option<(u32, u32)> {
        let place = |share: f64, size: u32| {
            ((0.0..=1.0).contains(&share)).then_some(((share * f64::from(size)) as u32).min(size - 1))
        };
        Some((place(x, self.film.width())?, place(y, self.film.height())?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oscura::scene::Camera;

    #[test]
    fn wishes_fit_a_scene_that_has_changed() {
        let pose = |x: f64| Pose::new(Camera::look_at([x, 0.0, 5.0], [x, 0.0, 0.0], 30.0), 5.0);
        let eye = |wish: &ViewRequest| wish.pose.camera().world_from_camera.translation.x;
        let own = ViewRequest::new(pose(0.0), (40, 30));
        let facts =
            |width: u32| SceneInfo { sizes: vec![(width / 2, 30), (width, 60)], ..SceneInfo::default() };
        let before = facts(100).sizes;
        let mut wish =
            ViewRequest { pose: pose(1.0), camera: 1, size: (100, 60), rotation: Some(3.0), ..own.clone() };
        wish.fit(&own, &before, &facts(80), &[pose(7.0), pose(8.0)]);
        assert_eq!((wish.size, wish.camera, eye(&wish), wish.rotation), ((80, 60), 1, 8.0, None));
        wish.fit(&own, &before, &facts(80), &[pose(0.0)]);
        assert_eq!((wish.size, wish.camera, eye(&wish)), ((80, 60), 0, 0.0));
        wish.pose.open(1.0);
        wish.fit(&own, &[], &facts(20), &[pose(9.0)]);
        assert_eq!((wish.size, eye(&wish)), (own.size, 0.0), "what hands have done stays");
    }
}

#[cfg(test)]
mod status_tests {
    use super::*;

    #[test]
    fn the_page_replaces_what_it_sets() {
        let words = "view a.glb --no-open --port 80 --spp 64 --exposure=1 --env x.hdr --width 10 \
                     --view-height 3 --fov=30 --denoise --depth 4";
        let kept = given(words.split(' ').map(str::to_string));
        assert_eq!(kept.join(" "), "a.glb --env x.hdr --depth 4");
    }

    #[test]
    fn words_are_quoted_where_shells_need_it() {
        assert_eq!(
            [quoted("a-1.glb"), quoted("my scene.glb"), quoted("it's"), quoted("")],
            ["a-1.glb", "'my scene.glb'", "'it'\\''s'", "''"]
        );
    }
}
