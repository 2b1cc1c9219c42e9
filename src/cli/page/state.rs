//! The state of the page: requested and displayed pictures. Shared by the server's threads and the rendering thread.

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
    /// Index of the scene's camera that the pose is based on.
    pub camera: usize,
    /// Pixels.
    pub size: (u32, u32),
    /// Rotation of the environment image, degrees; `None`: the scene's.
    pub rotation: Option<f64>,
    /// Strength of the environment, as for `--env-strength`; `None`: the scene's.
    pub strength: Option<f64>,
    /// Edited materials and lights.
    pub edits: Edits,
    /// An AOV to record in addition to [`PAGE_AOVS`].
    pub aov: Option<Aov>,
    /// The up axis, if selected on the page.
    pub up: Option<Up>,
    /// The stage, if selected on the page.
    pub stage: Option<StageArg>,
    /// Number of requests to reload the scene.
    pub loads: u64,
}

impl ViewRequest {
    /// A view of the first camera with the scene's settings.
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

    /// Adjusts the request to a reloaded scene: `own` is its initial request, `sizes_before` the available sizes before.
    pub fn fit(
        &mut self,
        own: &ViewRequest,
        sizes_before: &[(u32, u32)],
        scene_info: &SceneInfo,
        poses: &[Pose],
    ) {
        if !scene_info.sizes.contains(&self.size) {
            let index = sizes_before.iter().position(|size| *size == self.size);
            self.size = index.and_then(|at| scene_info.sizes.get(at)).copied().unwrap_or(own.size);
        }
        match poses.get(self.camera) {
            None => (self.camera, self.pose) = (own.camera, own.pose.clone()),
            // An unmoved camera follows the file.
            Some(fresh) if !self.pose.is_changed() => self.pose = fresh.clone(),
            Some(_) => {}
        }
        self.rotation = scene_info.rotation.and(self.rotation.or(own.rotation));
        self.strength = scene_info.strength.and(self.strength.or(own.strength));
    }
}

/// Information about the scene for the page.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub(crate) struct SceneInfo {
    pub name: String,
    pub cameras: Vec<String>,
    pub triangles: u64,
    /// Available sizes of the picture, pixels.
    pub sizes: Vec<(u32, u32)>,
    /// Rotation of the environment image, degrees; `None` without an image.
    pub rotation: Option<f64>,
    /// Strength of the environment; `None` without an environment.
    pub strength: Option<f64>,
    /// The model's sidecar, which edits are saved to; `None` for scene files.
    pub sidecar: Option<String>,
    #[serde(skip)]
    pub sidecar_path: Option<PathBuf>,
    /// The original materials.
    #[serde(skip)]
    pub materials: Arc<[Material]>,
    /// The original lights.
    #[serde(skip)]
    pub lights: Arc<[LightInfo]>,
    /// Samples per pixel of the finished picture.
    pub samples: u32,
    /// Available passes with their descriptions.
    pub passes: Vec<(&'static str, &'static str)>,
    /// The up axis; `None` if it can't be selected.
    pub up: Option<&'static str>,
    /// The stage; `None` if it can't be selected.
    pub stage: Option<String>,
    /// Names of the up axes to select from.
    pub ups: Vec<&'static str>,
    /// Names of the stages to select from.
    pub stages: Vec<String>,
    /// Notes and warnings.
    pub notes: Vec<String>,
    /// The page is interactive, else read-only.
    pub is_live: bool,
    /// The start of a command that renders this scene, without the settings of the page.
    #[serde(skip)]
    pub command: Vec<String>,
    /// Names of the objects, by number.
    #[serde(skip)]
    pub objects: Arc<[String]>,
}

pub(crate) struct State {
    pub request: ViewRequest,
    /// Number of the current request.
    pub request_number: u64,
    pub display: PageDisplay,
    pub scene_info: SceneInfo,
    /// The scene's cameras.
    pub poses: Vec<Pose>,
    /// Undo stack: edits and strength of the environment before each unsaved change.
    pub before: Vec<(Edits, Option<f64>)>,
    /// The latest picture.
    pub frame: Option<Arc<Frame>>,
    /// The latest denoised picture.
    pub denoised: Option<Denoised>,
    /// The last error; empty if there was none.
    pub error_message: String,
    /// Counts changes of the displayed state.
    pub version: u64,
    /// The version of the last change of pixels.
    pub pixels_version: u64,
    pub is_stopped: bool,
    /// Stops the rendering in progress.
    cancel: CancelHandle,
}

/// A request for the rendering thread.
pub(crate) struct RenderRequest {
    pub request: ViewRequest,
    pub number: u64,
    /// Cancelled by the next request.
    pub cancel: CancelHandle,
}

/// The shared state.
pub(crate) struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

impl Shared {
    pub fn new(
        request: ViewRequest,
        display: PageDisplay,
        scene_info: SceneInfo,
        poses: Vec<Pose>,
    ) -> Shared {
        let state = State {
            request,
            request_number: 1,
            display,
            scene_info,
            poses,
            before: Vec::new(),
            frame: None,
            denoised: None,
            error_message: String::new(),
            version: 0,
            pixels_version: 0,
            is_stopped: false,
            cancel: CancelHandle::new(),
        };
        Shared { state: Mutex::new(state), changed: Condvar::new() }
    }

    /// Locks the state. After a panic it is still consistent, as every change is made at once.
    pub fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    /// Changes the request and cancels the current rendering.
    pub fn request(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.lock();
        change(&mut state);
        state.request_number += 1;
        state.version += 1;
        state.cancel.cancel();
        self.changed.notify_all();
    }

    /// Changes the displayed picture or display settings.
    pub fn show(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.lock();
        change(&mut state);
        state.version += 1;
        state.pixels_version = state.version;
        self.changed.notify_all();
    }

    /// Wakes and ends all waiting threads.
    pub fn end(&self) {
        self.request(|state| state.is_stopped = true);
    }

    /// Waits for a request after number `done`; `None` after [`Shared::end`].
    pub fn next_request(&self, done: u64) -> Option<RenderRequest> {
        let is_old = |state: &mut State| state.request_number <= done && !state.is_stopped;
        let state = self.changed.wait_while(self.lock(), is_old);
        let mut state = state.unwrap_or_else(|poisoned| poisoned.into_inner());
        if state.is_stopped {
            return None;
        }
        state.cancel = CancelHandle::new();
        Some(RenderRequest {
            request: state.request.clone(),
            number: state.request_number,
            cancel: state.cancel.clone(),
        })
    }

    /// Waits for a frame of the current request for which `is_due` holds, with denoising enabled; `None` after
    /// [`Shared::end`].
    pub fn next_frame(&self, is_due: impl Fn(&Frame) -> bool) -> Option<Arc<Frame>> {
        let matches =
            |state: &State, frame: &Frame| frame.request_number == state.request_number && is_due(frame);
        let waits = |state: &mut State| {
            let due =
                state.display.denoise && state.frame.as_ref().is_some_and(|frame| matches(state, frame));
            !due && !state.is_stopped
        };
        let state = self.changed.wait_while(self.lock(), waits);
        let state = state.unwrap_or_else(|poisoned| poisoned.into_inner());
        state.frame.clone().filter(|_| !state.is_stopped)
    }

    /// Waits for a version after `version`, at most for `timeout`.
    pub fn wait_for_change(&self, version: u64, timeout: Duration) -> MutexGuard<'_, State> {
        let is_old =
            |state: &mut State| (state.version <= version || state.frame.is_none()) && !state.is_stopped;
        let waited = self.changed.wait_timeout_while(self.lock(), timeout, is_old);
        waited.unwrap_or_else(|poisoned| poisoned.into_inner()).0
    }
}

/// The state for the page as JSON, without pixels and their size.
pub(super) fn state_json(state: &State, frame: &Frame) -> Value {
    let png = &state.display.png;
    let pass = state.display.aov.filter(|&aov| frame.film.aov(aov).is_some());
    json!({
        "version": state.version,
        "samples": frame.samples,
        "seconds": frame.seconds,
        "error": frame.error,
        "finished": frame.is_finished && frame.request_number == state.request_number,
        "preview": frame.scale > 1,
        "request_number": frame.request_number,
        "denoise": state.display.denoise,
        "denoised": state.denoised_frame().map(|denoised| denoised.samples),
        "split": state.display.split,
        "error_message": state.error_message,
        "up": state.request.up.map(Up::name).or(state.scene_info.up),
        "stage": state.request.stage.map(StageArg::name).or(state.scene_info.stage.clone()),
        "scene_info": state.scene_info,
        "size": state.request.size,
        "camera": state.request.camera,
        "rotation": state.request.rotation.or(state.scene_info.rotation),
        "strength": state.request.strength.or(state.scene_info.strength),
        "edited": edited(state),
        "lights": state.request.edits.light_infos(&state.scene_info.lights),
        "toml": text(&state.request.edits.tables(&state.scene_info.materials, &state.scene_info.lights)),
        "undo": state.before.len(),
        "defocus": state.request.pose.defocus(),
        "exposure": png.exposure,
        "view": png.view.name(),
        "views": state.display.views(),
        "pass": pass.map_or("", |aov| aov.info().option),
        "command": command(state),
    })
}

/// The edited materials.
fn edited(state: &State) -> Value {
    let all = state.request.edits.applied(&state.scene_info.materials);
    let names = all.iter().filter(|material| state.request.edits.has(&material.name));
    let infos = names.map(|material| (material.name.clone(), json!(MaterialInfo::of(material))));
    Value::Object(infos.collect::<Map<_, _>>())
}

impl State {
    /// The denoised picture of the displayed pass, if there is one and it is requested.
    pub fn denoised_frame(&self) -> Option<&Denoised> {
        let request_number = self.frame.as_ref()?.request_number;
        self.denoised
            .as_ref()
            .filter(|denoised| self.display.denoise && denoised.request_number == request_number)
    }
}

/// The command that renders the displayed picture.
fn command(state: &State) -> String {
    let mut words = state.scene_info.command.clone();
    if !state.scene_info.is_live {
        return words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ");
    }
    let mut add = |option: &str, value: String| words.extend([option.to_string(), value]);
    let (width, height) = state.request.size;
    add("--width", width.to_string());
    add("--height", height.to_string());
    if state.request.camera > 0 {
        add("--camera", state.request.camera.to_string());
    }
    if let Some(rotation) = state.request.rotation {
        add("--env-rotation", rotation.to_string());
    }
    if let Some(strength) = state.request.strength {
        add("--env-strength", strength.to_string());
    }
    if let Some(stage) = state.request.stage {
        add("--stage", stage.name());
    }
    // The scene file may have other values.
    add("--exposure", state.display.png.exposure.to_string());
    add("--spp", state.scene_info.samples.to_string());
    add("--view", state.display.png.view.name().to_string());
    // An axis such as -y could be parsed as an option.
    words.extend(state.request.up.map(|up| format!("--up={}", up.name())));
    words.push(if state.display.denoise { "--denoise" } else { "--no-denoise" }.to_string());
    words.extend(state.request.pose.arguments());
    words.extend(["-o".to_string(), "picture.exr".to_string(), "-o".to_string(), "picture.png".to_string()]);
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

/// The `render` command with the arguments of this process, without the settings of the page.
pub(crate) fn own_command() -> Vec<String> {
    let words = ["oscura", "render"].map(str::to_string);
    words.into_iter().chain(given(arguments())).collect()
}

/// The arguments of this process.
pub(super) fn arguments() -> impl Iterator<Item = String> {
    process::arguments().map(|word| word.to_string_lossy().into_owned())
}

/// The arguments that `render` also has and the page doesn't set.
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

/// A word quoted for POSIX shells.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=+%@".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_string(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}

/// Display settings.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PageDisplay {
    pub png: PngOptions,
    /// The displayed pass; `None` for colour.
    pub aov: Option<Aov>,
    /// The view transform from a lookup table, if the render has one.
    pub own_view: Option<ViewTransform>,
    /// Show the denoised picture.
    pub denoise: bool,
    /// Fraction of the width, from the left, that shows the noisy picture.
    pub split: f64,
}

impl PageDisplay {
    /// Displays colour without denoising.
    pub fn new(png: PngOptions) -> PageDisplay {
        let own_view = Some(png.view.clone()).filter(|view| matches!(view, ViewTransform::Table(_)));
        PageDisplay { png, aov: None, own_view, denoise: false, split: 0.0 }
    }

    /// The names of all view transforms.
    pub fn views(&self) -> Vec<String> {
        let named = ViewTransform::NAMED.iter().map(|named| named.1.to_string());
        named.chain(self.own_view.iter().map(|view| view.name().into_owned())).collect()
    }

    pub fn view(&self, name: &str) -> Option<ViewTransform> {
        let own = self.own_view.as_ref().filter(|view| view.name() == name);
        own.cloned().or_else(|| ViewTransform::from_name(name))
    }
}

/// AOVs that `oscura view` always records: the guides for denoising, and the passes with thumbnails.
pub(crate) const PAGE_AOVS: AovSet = AovSet::NONE
    .with(Aov::Depth)
    .with(Aov::Normal)
    .with(Aov::Albedo)
    .with(Aov::ObjectId)
    .with(Aov::MaterialId)
    .with(Aov::DenoisingAlbedo)
    .with(Aov::DenoisingNormal);

/// A denoised frame; the other fields are those of the noisy frame.
#[derive(Clone)]
pub(crate) struct Denoised {
    pub film: Arc<Film>,
    /// Description of the denoiser and its guides.
    pub by: Arc<str>,
    pub samples: f64,
    pub scale: u32,
    pub is_finished: bool,
    pub request_number: u64,
}

/// A picture in progress.
pub(crate) struct Frame {
    /// Colour and AOVs.
    pub film: Film,
    pub output: OutputOptions,
    /// Samples per pixel.
    pub samples: f64,
    /// Render time.
    pub seconds: f64,
    /// Estimated relative error of the picture, if there is an estimate.
    pub error: Option<f64>,
    /// Downsampling factor of previews: size of the finished picture over that of this one.
    pub scale: u32,
    pub is_finished: bool,
    /// Number of its request.
    pub request_number: u64,
}

impl Frame {
    /// The picture so far, in full size, for request number `request_number`.
    pub fn of(rendering: &Rendering, is_finished: bool, request_number: u64) -> Frame {
        let statistics = rendering.statistics();
        Frame {
            film: rendering.shown().into_owned(),
            output: rendering.output_options(),
            samples: statistics.samples_per_pixel,
            seconds: statistics.render_s,
            error: statistics.error,
            scale: 1,
            is_finished,
            request_number,
        }
    }

    /// All values of the pixel at fractions of width and height from the upper left corner.
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

    /// Depth at fractions of width and height, metres; `None` for the background.
    pub fn depth(&self, x: f64, y: f64) -> Option<f64> {
        let (x, y) = self.pixel(x, y)?;
        let depth = *self.film.pixel(x, y).ok()?.plane("Z")?.into_floats().first()?;
        (depth > 0.0 && depth < 0.5 * oscura::film::BACKGROUND_DEPTH).then_some(f64::from(depth))
    }

    /// The pixel at fractions of width and height; `None` outside of the picture.
    pub(super) fn pixel(&self, x: f64, y: f64) -> Option<(u32, u32)> {
        let index = |fraction: f64, size: u32| {
            ((0.0..=1.0).contains(&fraction)).then_some(((fraction * f64::from(size)) as u32).min(size - 1))
        };
        Some((index(x, self.film.width())?, index(y, self.film.height())?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oscura::scene::Camera;

    #[test]
    fn requests_are_adjusted_to_a_reloaded_scene() {
        let pose = |x: f64| Pose::new(Camera::look_at([x, 0.0, 5.0], [x, 0.0, 0.0], 30.0), 5.0);
        let eye = |request: &ViewRequest| request.pose.camera().world_from_camera.translation.x;
        let own = ViewRequest::new(pose(0.0), (40, 30));
        let scene_info =
            |width: u32| SceneInfo { sizes: vec![(width / 2, 30), (width, 60)], ..SceneInfo::default() };
        let before = scene_info(100).sizes;
        let mut request =
            ViewRequest { pose: pose(1.0), camera: 1, size: (100, 60), rotation: Some(3.0), ..own.clone() };
        request.fit(&own, &before, &scene_info(80), &[pose(7.0), pose(8.0)]);
        assert_eq!((request.size, request.camera, eye(&request), request.rotation), ((80, 60), 1, 8.0, None));
        request.fit(&own, &before, &scene_info(80), &[pose(0.0)]);
        assert_eq!((request.size, request.camera, eye(&request)), ((80, 60), 0, 0.0));
        request.pose.set_defocus(1.0);
        request.fit(&own, &[], &scene_info(20), &[pose(9.0)]);
        assert_eq!((request.size, eye(&request)), (own.size, 0.0), "changes of the camera are kept");
    }
}

#[cfg(test)]
mod status_tests {
    use super::*;

    #[test]
    fn options_set_by_the_page_are_dropped() {
        let words = "view a.glb --no-open --port 80 --spp 64 --exposure=1 --env x.hdr --width 10 \
                     --view-height 3 --fov=30 --denoise --depth 4";
        let kept = given(words.split(' ').map(str::to_string));
        assert_eq!(kept.join(" "), "a.glb --env x.hdr --depth 4");
    }

    #[test]
    fn words_are_quoted_for_shells() {
        assert_eq!(
            [quoted("a-1.glb"), quoted("my scene.glb"), quoted("it's"), quoted("")],
            ["a-1.glb", "'my scene.glb'", "'it'\\''s'", "''"]
        );
    }
}
