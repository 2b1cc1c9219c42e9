//! Serves the page on the loopback interface.
//!
//! Requests must have a local host name (against DNS rebinding), must not come from other sites' pages (against cross-site
//! requests), and must have the page's secret key in their path (against other users of the machine).
//!
//! A thread denoises pictures while rendering continues.

use super::edits::{LightEdit, MaterialEdit, MaterialInfo, merged};
use super::http;
use super::http::{Handler, Request, Response};
use super::pixels::{Outline, of_frame};
use super::pose::Move;
use super::state::{Denoised, Frame, PAGE_AOVS, Shared, State, state_json};
use crate::cli::args::RenderArgs;
use crate::cli::pixels::{Pixels, downscaled};
use crate::cli::scene_args::StageArg;
use oscura::error::{Error, Result};
use oscura::film::{Aov, AovSet, Values};
use oscura::load::{Up, text_of};
use oscura::output::{Format, OutputOptions, encode, write_atomically};
use oscura::render::{denoise_film, denoising_guides, in_pool};
use serde::Deserialize;
use serde_json::{Value, json};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

const HEADERS: [(&str, &str); 5] = [
    ("Cache-Control", "no-store"),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    (
        "Content-Security-Policy",
        "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    ),
];

/// A bound port, and the key of the page.
pub(crate) struct Server {
    listener: TcpListener,
    address: SocketAddr,
    page_key: PageKey,
}

/// Binds a port; 0 for any free port.
///
/// # Errors
/// A usage error if the port can't be bound.
pub(crate) fn bind(port: u16) -> Result<Server> {
    let bound = TcpListener::bind((Ipv4Addr::LOCALHOST, port));
    let bound = bound.and_then(|listener| listener.local_addr().map(|address| (listener, address)));
    let (listener, address) = bound.map_err(|e| {
        Error::usage(format!("port {port} of this machine can't be used: {e}"))
            .with_help("set another --port, or leave it out for any free port")
    })?;
    Ok(Server { listener, address, page_key: PageKey::new()? })
}

/// A page that is served until it is dropped.
pub(crate) struct Page {
    address: SocketAddr,
    is_stopped: Arc<AtomicBool>,
    /// The shared state.
    pub shared: Arc<Shared>,
}

impl Page {
    /// Serves a page, prints its address, and opens it in a browser if `opens`.
    pub fn open(server: Server, shared: Shared, args: &RenderArgs, opens: bool) -> Page {
        let Server { listener, address, page_key } = server;
        let page = Page { address, is_stopped: Arc::default(), shared: Arc::new(shared) };
        let url = format!("http://{address}{}", page_key.page());
        if !args.quiet {
            say!("view     {url} (Ctrl-C ends it)");
        }
        let one_time_path = format!("http://{address}{}", page_key.one_time_path());
        let (is_stopped, shared) = (page.is_stopped.clone(), page.shared.clone());
        let (denoised, threads) = (shared.clone(), args.threads.map(usize::from));
        std::thread::spawn(move || denoise_frames(&denoised, threads));
        let answer = move |request: &Request| response(handle(request, address.port(), &page_key, &shared));
        let answer: Arc<Handler> = Arc::new(answer);
        std::thread::spawn(move || http::serve(&listener, &is_stopped, &answer));
        if opens && let Err(error) = open::that_detached(&one_time_path) {
            say!("no browser could be started ({error}): open {url} in a browser");
        }
        page
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.shared.end();
        self.is_stopped.store(true, Ordering::SeqCst);
        // The accepting thread checks the flag at the next connection.
        let _ = TcpStream::connect(self.address);
    }
}

fn handle(request: &Request, port: u16, page_key: &PageKey, shared: &Shared) -> Answer {
    if let Some(reason) = refusal(request, port) {
        return Answer::text(403, reason);
    }
    let url = match page_key.route(&request.target) {
        Route::Path(url) => url,
        Route::Redirect(path) => return Answer { location: Some(path), ..Answer::text(303, "") },
        Route::Forbidden => return Answer::text(403, "open the address that the program printed"),
    };
    match (request.method.as_str(), std::str::from_utf8(&request.body)) {
        ("GET", _) => get(url, shared),
        ("POST", Ok(body)) => post(url, body, shared),
        ("POST", Err(_)) => Answer::text(400, "the body is not UTF-8 text"),
        _ => Answer::text(405, "only GET and POST"),
    }
}

/// The reason to refuse a request, if any.
fn refusal(request: &Request, port: u16) -> Option<&'static str> {
    let [host, origin, site] = ["host", "origin", "sec-fetch-site"].map(|name| request.header(name));
    refusal_by_headers(host, origin, site, port)
}

fn refusal_by_headers(
    host: Option<&str>,
    origin: Option<&str>,
    site: Option<&str>,
    port: u16,
) -> Option<&'static str> {
    let is_own = |host: &str| {
        ["127.0.0.1", "localhost"].into_iter().any(|own| match host.strip_prefix(own) {
            // Browsers omit the default port.
            Some("") => port == 80,
            Some(rest) => rest.strip_prefix(':') == Some(port.to_string().as_str()),
            None => false,
        })
    };
    if !host.is_some_and(is_own) {
        return Some("this page is only available on this machine, as 127.0.0.1 or localhost");
    }
    let is_own_page = |origin: &str| origin.strip_prefix("http://").is_some_and(is_own);
    if origin.is_some_and(|origin| !is_own_page(origin)) || matches!(site, Some("cross-site" | "same-site")) {
        return Some("requests from pages of other sites are refused");
    }
    None
}

fn response(answer: Answer) -> Response {
    let mut headers: Vec<_> = HEADERS.iter().map(|(name, value)| (*name, value.to_string())).collect();
    headers.push(("Content-Type", answer.kind.to_string()));
    headers
        .extend(answer.name.map(|name| ("Content-Disposition", format!("attachment; filename=\"{name}\""))));
    headers.extend(answer.location.map(|path| ("Location", path)));
    Response { status: answer.status, headers, body: answer.body }
}

/// Timeout of the long polling of `/frame`.
const POLL_TIMEOUT: Duration = Duration::from_secs(20);

/// Message for changes on a read-only page.
const READ_ONLY: &str =
    "the settings of a render with --preview can't be changed; 'oscura view' is interactive";

const PAGE_FILES: [(&str, &str, &str); 7] = [
    ("/", "text/html; charset=utf-8", include_str!("index.html")),
    ("/page.css", "text/css; charset=utf-8", include_str!("page.css")),
    ("/page.js", "text/javascript; charset=utf-8", include_str!("page.js")),
    ("/gestures.js", "text/javascript; charset=utf-8", include_str!("gestures.js")),
    ("/materials.js", "text/javascript; charset=utf-8", include_str!("materials.js")),
    ("/picture.js", "text/javascript; charset=utf-8", include_str!("picture.js")),
    ("/icon.svg", "image/svg+xml", include_str!("icon.svg")),
];

pub(super) struct Answer {
    pub status: u16,
    pub kind: &'static str,
    pub body: Vec<u8>,
    /// File name for downloads.
    pub name: Option<&'static str>,
    /// Path of a redirection.
    pub location: Option<String>,
}

impl Answer {
    pub fn text(status: u16, text: &str) -> Answer {
        Answer { status, body: text.as_bytes().to_vec(), ..Answer::of("text/plain; charset=utf-8") }
    }

    fn json(value: &Value) -> Answer {
        Answer { body: value.to_string().into_bytes(), ..Answer::of("application/json") }
    }

    fn bytes(body: Vec<u8>) -> Answer {
        Answer { body, ..Answer::of("application/octet-stream") }
    }

    fn of(kind: &'static str) -> Answer {
        Answer { status: 200, kind, body: Vec::new(), name: None, location: None }
    }
}

/// Handles a GET request.
pub(super) fn get(url: &str, shared: &Shared) -> Answer {
    let (path, query) = url.split_once('?').unwrap_or((url, ""));
    let number = |key: &str| {
        let value = query.split('&').find_map(|pair| pair.strip_prefix(key)?.strip_prefix('='));
        value.and_then(|value| value.parse::<f64>().ok())
    };
    if let Some((_, kind, text)) = PAGE_FILES.iter().find(|(own, ..)| *own == path) {
        return Answer { kind, ..Answer::text(200, text) };
    }
    match path {
        "/frame" => frame(number("after").map_or(0, |v| v as u64), shared),
        "/probe" => {
            let position = number("x").zip(number("y"));
            let frame = shared.lock().frame.clone();
            match position.zip(frame).and_then(|((x, y), frame)| frame.probe(x, y)) {
                Some(found) => Answer::json(&found),
                None => Answer::text(404, "there is no such pixel yet"),
            }
        }
        "/outline" => {
            let position = number("x").zip(number("y"));
            let (frame, names) = {
                let state = shared.lock();
                (state.frame.clone(), state.scene_info.objects.clone())
            };
            match position.zip(frame).and_then(|(position, frame)| Outline::at(&frame, position, &names)) {
                Some(found) => Answer::json(&json!(found)),
                None => Answer::text(404, "there is no object here"),
            }
        }
        "/material" => {
            match number("x").zip(number("y")).and_then(|position| material_at(position, shared)) {
                Some(found) => Answer::json(&json!(found)),
                None => Answer::text(404, "there is no material here"),
            }
        }
        "/thumbnail" => thumbnail(query.strip_prefix("pass=").unwrap_or_default(), shared),
        "/picture.exr" => picture(Format::Exr, "picture.exr", shared),
        "/picture.png" => picture(Format::Png, "picture.png", shared),
        _ => Answer::text(404, "there is no such page"),
    }
}

/// The original material at a pixel.
fn material_at((x, y): (f64, f64), shared: &Shared) -> Option<MaterialInfo> {
    let (frame, materials) = {
        let state = shared.lock();
        (state.frame.clone()?, state.scene_info.materials.clone())
    };
    let (column, row) = frame.pixel(x, y)?;
    let Values::Uint(ids) = frame.film.aov(Aov::MaterialId)?.into_iter().next()? else { return None };
    let id = *ids.get((row * frame.film.width() + column) as usize)?;
    materials.get((id as usize).checked_sub(1)?).map(MaterialInfo::of)
}

/// The state and the pixels: length of the JSON (u32, little-endian), JSON, RGBA. Pixels are omitted if the page has them
/// already, as encoding takes longer than a first picture.
fn frame(version: u64, shared: &Shared) -> Answer {
    let state = shared.wait_for_change(version, POLL_TIMEOUT);
    let (Some(frame), true) = (state.frame.clone(), state.version > version) else {
        return Answer { status: 204, ..Answer::bytes(Vec::new()) };
    };
    let (display, denoised) = (state.display.clone(), state.denoised_frame().cloned());
    let text = state_json(&state, &frame);
    let has_pixels = version >= state.pixels_version;
    drop(state);
    if has_pixels {
        return text_and_pixels(text, &Pixels { size: (0, 0), rgba: Vec::new() });
    }
    text_and_pixels(text, &of_frame(&frame, denoised.as_ref(), &display))
}

/// Encodes JSON with the size of the pixels, and the pixels.
fn text_and_pixels(mut text: Value, pixels: &Pixels) -> Answer {
    (text["width"], text["height"]) = (pixels.size.0.into(), pixels.size.1.into());
    let text = text.to_string();
    let mut body = Vec::with_capacity(4 + text.len() + pixels.rgba.len());
    body.extend((text.len() as u32).to_le_bytes());
    body.extend(text.into_bytes());
    body.extend(&pixels.rgba);
    Answer::bytes(body)
}

/// Maximum width of thumbnails, pixels.
const MAX_THUMBNAIL_WIDTH: u32 = 160;

/// A thumbnail of a pass, encoded as in [`frame`]; "" is colour.
fn thumbnail(pass: &str, shared: &Shared) -> Answer {
    let (frame, mut display, denoised) = {
        let state = shared.lock();
        (state.frame.clone(), state.display.clone(), state.denoised_frame().cloned())
    };
    (display.aov, display.split) = (Aov::from_option(pass), 0.0);
    let has_pass = |frame: &Frame| display.aov.is_none_or(|aov| frame.film.aov(aov).is_some());
    match frame.filter(|frame| has_pass(frame) && (pass.is_empty() || display.aov.is_some())) {
        Some(frame) => {
            let small =
                downscaled(&of_frame(&frame, denoised.as_ref(), &display), (MAX_THUMBNAIL_WIDTH, u32::MAX));
            text_and_pixels(json!({ "pass": pass }), &small)
        }
        None => Answer::text(404, "there is no picture of this pass yet"),
    }
}

/// The picture so far as a file to download.
fn picture(format: Format, name: &'static str, shared: &Shared) -> Answer {
    let (frame, display, denoised) = {
        let state = shared.lock();
        (state.frame.clone(), state.display.clone(), state.denoised_frame().cloned())
    };
    let Some(frame) = frame else { return Answer::text(404, "there is no picture yet") };
    let mut options = OutputOptions { png: display.png, ..frame.output.clone() };
    let mut film = match denoised.filter(|denoised| denoised.scale == frame.scale) {
        Some(denoised) => {
            options.metadata.denoised = Some(denoised.by.to_string());
            options.metadata.samples = denoised.samples;
            (*denoised.film).clone()
        }
        None => frame.film.clone(),
    };
    film.remove_aovs(denoising_guides().iter());
    match encode(&film, format, &options, name) {
        Ok(encoded) => Answer { name: Some(name), ..Answer::bytes(encoded.bytes) },
        Err(error) => Answer::text(500, &error.to_string()),
    }
}

/// Settings to change; `None` keeps a setting.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Settings {
    exposure: Option<f32>,
    view: Option<String>,
    /// Option name of an AOV; "" for colour.
    pass: Option<String>,
    /// Rotation of the environment, degrees.
    rotation: Option<f64>,
    /// Strength of the environment.
    strength: Option<f64>,
    /// Name of a material, and its new values.
    material: Option<(String, MaterialEdit)>,
    /// Name of lights, and their new values.
    light: Option<(String, LightEdit)>,
    /// Merge this change with the previous one for undo, as while a slider is dragged.
    is_same: bool,
    size: Option<(u32, u32)>,
    defocus: Option<f64>,
    denoise: Option<bool>,
    /// Fraction of the width that shows the noisy picture.
    split: Option<f64>,
    /// Up axis.
    up: Option<String>,
    stage: Option<String>,
}

/// Handles a POST request.
pub(super) fn post(url: &str, body: &str, shared: &Shared) -> Answer {
    if !shared.lock().scene_info.is_live && url != "/set" {
        return Answer::text(403, READ_ONLY);
    }
    let done = match url {
        "/move" => {
            serde_json::from_str(body).map_err(|e| e.to_string()).map(|step| move_camera(step, shared))
        }
        "/set" => serde_json::from_str(body).map_err(|e| e.to_string()).and_then(|s| set(s, shared)),
        "/focus" => serde_json::from_str(body).map_err(|e| e.to_string()).and_then(|p| focus(p, shared)),
        "/camera" => serde_json::from_str(body).map_err(|e| e.to_string()).and_then(|n| camera(n, shared)),
        "/undo" => undo(shared),
        "/save" => save(shared),
        "/reload" => {
            shared.request(|state| state.request.loads += 1);
            Ok(())
        }
        _ => return Answer::text(404, "there is no such page"),
    };
    match done {
        Ok(()) => Answer::json(&json!({})),
        Err(message) => Answer::text(400, &message),
    }
}

fn move_camera(step: Move, shared: &Shared) {
    let depth = {
        let state = shared.lock();
        // Frames of earlier requests may be of another camera.
        let fits = |frame: &&Arc<Frame>| {
            frame.request_number == state.request_number && !state.request.pose.is_changed()
        };
        let frame = state.frame.as_ref().filter(fits).cloned();
        drop(state);
        frame.and_then(|frame| frame.depth(0.5, 0.5))
    };
    shared.request(|state| {
        if let (Some(depth), false) = (depth, state.request.pose.is_changed()) {
            state.request.pose.set_target_distance(depth);
        }
        state.request.pose.apply(step);
    });
}

/// Resets to one of the scene's cameras.
fn camera(number: usize, shared: &Shared) -> std::result::Result<(), String> {
    let pose = shared.lock().poses.get(number).cloned().ok_or("there is no such camera")?;
    shared.request(|state| {
        state.request.pose = pose;
        state.request.camera = number;
    });
    Ok(())
}

fn focus((x, y): (f64, f64), shared: &Shared) -> std::result::Result<(), String> {
    let frame = shared.lock().frame.clone();
    let depth = frame.and_then(|frame| frame.depth(x, y)).ok_or("there is no surface at this point")?;
    shared.request(|state| state.request.pose.focus(depth));
    Ok(())
}

fn set(settings: Settings, shared: &Shared) -> std::result::Result<(), String> {
    let pass = settings.pass.as_deref().filter(|name| !name.is_empty());
    let aov = pass.map(|name| Aov::from_option(name).ok_or("there is no such pass")).transpose()?;
    let display = shared.lock().display.clone();
    let view = settings.view.as_deref().map(|name| display.view(name).ok_or("there is no such view"));
    let view = view.transpose()?;
    check_numbers(&settings)?;
    let up_of = |name: &str| Up::from_name(name).ok_or("there is no such axis");
    let up = settings.up.as_deref().map(up_of).transpose()?;
    let stage = settings.stage.as_deref().map(|name| StageArg::of(name).ok_or("there is no such stage"));
    let stage = stage.transpose()?;
    let loads = up.is_some() || stage.is_some();
    let is_lens = settings.size.is_some() || settings.defocus.is_some();
    let is_edit = settings.strength.is_some() || settings.material.is_some() || settings.light.is_some();
    let needs_render = settings.rotation.is_some() || is_lens || loads || is_edit;
    if needs_render && !shared.lock().scene_info.is_live {
        return Err(READ_ONLY.to_string());
    }
    let sizes = shared.lock().scene_info.sizes.clone();
    if settings.size.is_some_and(|size| !sizes.contains(&size)) {
        return Err("there is no such size".to_string());
    }
    let is_look = settings.exposure.is_some() || view.is_some() || settings.pass.is_some();
    let is_look = is_look || settings.denoise.is_some() || settings.split.is_some();
    let look_changes = |state: &mut State| {
        state.display.png.exposure = settings.exposure.unwrap_or(state.display.png.exposure);
        state.display.png.view = view.unwrap_or(display.png.view);
        state.display.denoise = settings.denoise.unwrap_or(state.display.denoise);
        state.display.split = settings.split.unwrap_or(state.display.split);
        if settings.pass.is_some() {
            state.display.aov = aov;
        }
    };
    if is_look {
        shared.show(look_changes);
    }
    let is_recorded =
        |state: &State| aov.is_none_or(|a| PAGE_AOVS.contains(a) || state.request.aov == Some(a));
    let is_live = shared.lock().scene_info.is_live;
    if needs_render || (is_live && settings.pass.is_some() && !is_recorded(&shared.lock())) {
        shared.request(|state| {
            let is_new = !settings.is_same || state.before.is_empty();
            if is_edit && is_new {
                state.before.push((state.request.edits.clone(), state.request.strength));
            }
            state.request.strength = settings.strength.or(state.request.strength);
            settings.material.into_iter().for_each(|(name, edit)| state.request.edits.change(name, edit));
            settings.light.into_iter().for_each(|(name, edit)| state.request.edits.change_light(name, edit));
            state.request.up = up.or(state.request.up);
            state.request.stage = stage.or(state.request.stage);
            state.request.loads += u64::from(loads);
            state.request.aov = aov.filter(|aov| !PAGE_AOVS.contains(*aov)).or(state.request.aov);
            state.request.rotation = settings.rotation.or(state.request.rotation);
            state.request.size = settings.size.unwrap_or(state.request.size);
            let defocus = settings.defocus.filter(|defocus| defocus.is_finite());
            defocus.into_iter().for_each(|defocus| state.request.pose.set_defocus(defocus));
        });
    }
    Ok(())
}

/// Undoes the last change of materials, lights or the environment's strength.
fn undo(shared: &Shared) -> std::result::Result<(), String> {
    if shared.lock().before.is_empty() {
        return Err("there is nothing to undo".to_string());
    }
    shared.request(|state| {
        if let Some(before) = state.before.pop() {
            (state.request.edits, state.request.strength) = before;
        }
    });
    Ok(())
}

/// Merges the changes of materials and lights into the model's sidecar.
fn save(shared: &Shared) -> std::result::Result<(), String> {
    let (path, tables) = {
        let state = shared.lock();
        let path = state.scene_info.sidecar_path.clone();
        (
            path.ok_or("a scene file has no sidecar: copy the lines into the scene file")?,
            state.request.edits.tables(&state.scene_info.materials, &state.scene_info.lights),
        )
    };
    let before = text_of(&path).map_err(|error| error.to_string())?.unwrap_or_default();
    let after = merged(&before, &tables);
    if let Err(error) = toml::de::DeTable::parse(&after) {
        let message = error.message();
        return Err(format!(
            "{} defines these materials or lights in another form ({message}): copy the lines",
            path.display()
        ));
    }
    write_atomically(&path, after.as_bytes()).map_err(|error| error.to_string())?;
    shared.show(|state| state.before.clear());
    Ok(())
}

fn check_numbers(settings: &Settings) -> std::result::Result<(), String> {
    let fits = settings.exposure.is_none_or(|exposure| (-100.0..=100.0).contains(&exposure))
        && settings.rotation.is_none_or(f64::is_finite)
        && settings.strength.is_none_or(|strength| (1e-3..=1e4).contains(&strength))
        && settings.material.as_ref().is_none_or(|(_, edit)| edit.is_valid())
        && settings.light.as_ref().is_none_or(|(_, edit)| edit.is_valid())
        && settings.split.is_none_or(|split| (0.0..=1.0).contains(&split));
    fits.then_some(()).ok_or("a number is out of range".to_string())
}

/// Length of a key, bytes.
const KEY_BYTES: usize = 16;

/// The secret key in the page's path, which keeps out other users of the machine. Browsers are started with a one-time key, as
/// other users can see the arguments of processes.
struct PageKey {
    key: String,
    /// The one-time key; `None` after its use.
    once: Mutex<Option<String>>,
    one_time_key: String,
}

/// The route of a request.
#[derive(Debug, PartialEq)]
enum Route<'a> {
    /// A path of the page, with its query.
    Path(&'a str),
    /// Redirection to another path.
    Redirect(String),
    Forbidden,
}

impl PageKey {
    /// Generates random keys.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new() -> Result<PageKey> {
        let (key, one_time_key) = (random_key()?, random_key()?);
        Ok(PageKey { key, once: Mutex::new(Some(one_time_key.clone())), one_time_key })
    }

    /// The path of the page.
    pub fn page(&self) -> String {
        format!("/{}/", self.key)
    }

    /// The path that redirects to the page once.
    pub fn one_time_path(&self) -> String {
        format!("/open/{}", self.one_time_key)
    }

    pub fn route<'a>(&self, target: &'a str) -> Route<'a> {
        if let Some(key) = target.strip_prefix("/open/") {
            let mut once = self.once.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            return match once.take_if(|own| own == key) {
                Some(_) => Route::Redirect(self.page()),
                None => Route::Forbidden,
            };
        }
        match target.strip_prefix('/').and_then(|rest| rest.strip_prefix(self.key.as_str())) {
            Some("") => Route::Redirect(self.page()),
            Some(url) if url.starts_with('/') => Route::Path(url),
            _ => Route::Forbidden,
        }
    }
}

/// A random key in hexadecimal digits.
fn random_key() -> Result<String> {
    let mut bytes = [0; KEY_BYTES];
    getrandom::fill(&mut bytes)
        .map_err(|e| Error::usage(format!("the system has no random numbers for a page's key: {e}")))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod key_tests {
    use super::*;

    #[test]
    fn paths_without_the_key_are_forbidden() {
        let page_key = PageKey::new().expect("random numbers");
        let page = page_key.page();
        assert_eq!(page.len(), 2 * KEY_BYTES + 2);
        assert_eq!(page_key.route(&page), Route::Path("/"));
        assert_eq!(page_key.route(&format!("{page}frame?after=1")), Route::Path("/frame?after=1"));
        assert_eq!(page_key.route(page.trim_end_matches('/')), Route::Redirect(page.clone()));
        let other = PageKey::new().expect("random numbers").page();
        for target in ["/", "/frame", "/open/", &other, &format!("{}x/", page.trim_end_matches('/'))] {
            assert_eq!(page_key.route(target), Route::Forbidden, "{target}");
        }
    }

    #[test]
    fn the_one_time_path_redirects_once() {
        let page_key = PageKey::new().expect("random numbers");
        let one_time_path = page_key.one_time_path();
        assert_eq!(page_key.route(&format!("{one_time_path}0")), Route::Forbidden);
        assert_eq!(page_key.route(&one_time_path), Route::Redirect(page_key.page()));
        assert_eq!(page_key.route(&one_time_path), Route::Forbidden);
        assert_ne!(one_time_path.trim_start_matches("/open/"), page_key.page().trim_matches('/'));
    }
}

/// Denoises frames, if enabled, until the page is closed: the first of each size, then whenever the samples have doubled.
pub(super) fn denoise_frames(shared: &Shared, threads: Option<usize>) {
    let mut last: Option<Denoised> = None;
    while let Some(frame) = shared.next_frame(|frame| is_due(frame, last.as_ref())) {
        let mut film = frame.film.clone();
        let Ok(by) = in_pool(threads, || denoise_film(&mut film, AovSet::all())) else { return };
        let Frame { samples, scale, is_finished, request_number, .. } = *frame;
        let denoised =
            Denoised { film: film.into(), by: by.into(), samples, scale, is_finished, request_number };
        last = Some(denoised.clone());
        // Discard frames of earlier views.
        if shared.lock().frame.as_ref().is_some_and(|shown| shown.request_number == request_number) {
            shared.show(|state| state.denoised = Some(denoised));
        }
    }
}

fn is_due(frame: &Frame, last: Option<&Denoised>) -> bool {
    last.is_none_or(|last| {
        (frame.request_number, frame.scale) != (last.request_number, last.scale)
            || frame.samples >= 2.0 * last.samples
            || (frame.is_finished && !last.is_finished)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_of_other_sites_are_refused() {
        let own = Some("127.0.0.1:8080");
        assert_eq!(refusal_by_headers(own, None, None, 8080), None);
        let page = Some("http://localhost:8080");
        assert_eq!(refusal_by_headers(Some("localhost:8080"), page, Some("same-origin"), 8080), None);
        assert_eq!(refusal_by_headers(own, None, Some("none"), 8080), None);
        for host in [
            None,
            Some("evil.example"),
            Some("evil.example:8080"),
            Some("127.0.0.1:81"),
            Some("127.0.0.1"),
            Some("127.0.0.1:"),
            Some("127.0.0.1.evil.example:8080"),
        ] {
            assert!(refusal_by_headers(host, None, None, 8080).is_some(), "{host:?}");
        }
        for origin in ["http://evil.example", "null", "https://127.0.0.1:8080", "http://127.0.0.1:80"] {
            assert!(refusal_by_headers(own, Some(origin), None, 8080).is_some(), "{origin}");
        }
        assert!(refusal_by_headers(own, None, Some("cross-site"), 8080).is_some());
    }

    #[test]
    fn port_80_may_be_omitted() {
        for host in ["127.0.0.1", "localhost", "localhost:80"] {
            assert_eq!(
                refusal_by_headers(Some(host), Some(&format!("http://{host}")), None, 80),
                None,
                "{host}"
            );
        }
        for host in ["127.0.0.1:81", "localhost:", "evil.example"] {
            assert!(refusal_by_headers(Some(host), None, None, 80).is_some(), "{host}");
        }
    }
}
