//! What the page asks for, and the answers.

use super::frame::Frame;
use super::pose::Move;
use super::state::{Shared, State};
use super::told;
use oscura::film::Aov;
use oscura::output::{Format, OutputOptions, encode};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;

/// How long a page waits for news before it asks again.
const PATIENCE: Duration = Duration::from_secs(20);

/// Why a page that looks on may not do something.
const LOOK_ON: &str =
    "this picture is rendered to the end as it was begun; 'oscura view' shows what can be turned";

const PAGE: [(&str, &str, &str); 4] = [
    ("/", "text/html; charset=utf-8", include_str!("index.html")),
    ("/page.css", "text/css; charset=utf-8", include_str!("page.css")),
    ("/page.js", "text/javascript; charset=utf-8", include_str!("page.js")),
    ("/hands.js", "text/javascript; charset=utf-8", include_str!("hands.js")),
];

pub(super) struct Answer {
    pub status: u16,
    pub kind: &'static str,
    pub body: Vec<u8>,
    /// A name to save it by.
    pub name: Option<&'static str>,
    /// The path to go to instead.
    pub place: Option<String>,
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
        Answer { status: 200, kind, body: Vec::new(), name: None, place: None }
    }
}

/// Answers a question.
pub(super) fn get(url: &str, shared: &Shared) -> Answer {
    let (path, query) = url.split_once('?').unwrap_or((url, ""));
    let number = |key: &str| {
        let value = query.split('&').find_map(|pair| pair.strip_prefix(key)?.strip_prefix('='));
        value.and_then(|value| value.parse::<f64>().ok())
    };
    if let Some((_, kind, text)) = PAGE.iter().find(|(own, ..)| *own == path) {
        return Answer { kind, ..Answer::text(200, text) };
    }
    match path {
        "/frame" => frame(number("after").map_or(0, |v| v as u64), shared),
        "/probe" => {
            let place = number("x").zip(number("y"));
            let frame = shared.lock().frame.clone();
            match place.zip(frame).and_then(|((x, y), frame)| frame.probe(x, y)) {
                Some(found) => Answer::json(&found),
                None => Answer::text(404, "there is no such pixel yet"),
            }
        }
        "/picture.exr" => picture(Format::Exr, "picture.exr", shared),
        "/picture.png" => picture(Format::Png, "picture.png", shared),
        _ => Answer::text(404, "there is no such page"),
    }
}

/// The state as JSON and the pixels behind it: the JSON's length as four bytes, the lowest first; the JSON; RGBA.
fn frame(version: u64, shared: &Shared) -> Answer {
    let state = shared.wait_for_news(version, PATIENCE);
    let (Some(frame), true) = (state.frame.clone(), state.version > version) else {
        return Answer { status: 204, ..Answer::bytes(Vec::new()) };
    };
    let (look, text) = (state.look.clone(), told::state(&state, &frame).to_string());
    drop(state);
    let pixels = frame.pixels(&look);
    let mut body = Vec::with_capacity(4 + text.len() + pixels.len());
    body.extend((text.len() as u32).to_le_bytes());
    body.extend(text.into_bytes());
    body.extend(pixels);
    Answer::bytes(body)
}

/// The picture so far as a file.
fn picture(format: Format, name: &'static str, shared: &Shared) -> Answer {
    let (frame, look) = {
        let state = shared.lock();
        (state.frame.clone(), state.look.clone())
    };
    let Some(frame) = frame else { return Answer::text(404, "there is no picture yet") };
    let options = OutputOptions { png: look.png, ..frame.output.clone() };
    match encode(&frame.film, format, &options, name) {
        Ok(encoded) => Answer { name: Some(name), ..Answer::bytes(encoded.bytes) },
        Err(error) => Answer::text(500, &error.to_string()),
    }
}

/// What a page may set; what it doesn't name stays.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Settings {
    exposure: Option<f32>,
    view: Option<String>,
    /// An AOV by its option; "" for colour.
    pass: Option<String>,
    rotation: Option<f64>,
    size: Option<(u32, u32)>,
    defocus: Option<f64>,
}

/// Does as it is told.
pub(super) fn post(url: &str, body: &str, shared: &Shared) -> Answer {
    if !shared.lock().facts.is_live && url != "/set" {
        return Answer::text(403, LOOK_ON);
    }
    let done = match url {
        "/move" => serde_json::from_str(body).map_err(|e| e.to_string()).map(|step| go(step, shared)),
        "/set" => serde_json::from_str(body).map_err(|e| e.to_string()).and_then(|s| set(s, shared)),
        "/focus" => serde_json::from_str(body).map_err(|e| e.to_string()).and_then(|p| focus(p, shared)),
        "/camera" => serde_json::from_str(body).map_err(|e| e.to_string()).and_then(|n| camera(n, shared)),
        "/reload" => {
            shared.wish(|state| state.wish.loads += 1);
            Ok(())
        }
        _ => return Answer::text(404, "there is no such page"),
    };
    match done {
        Ok(()) => Answer::json(&json!({})),
        Err(message) => Answer::text(400, &message),
    }
}

fn go(step: Move, shared: &Shared) {
    let depth = {
        let state = shared.lock();
        // A frame of an earlier wish may be another camera's.
        let fits = |frame: &&Arc<Frame>| frame.order == state.wishes && !state.wish.pose.is_changed();
        let frame = state.frame.as_ref().filter(fits).cloned();
        drop(state);
        frame.and_then(|frame| frame.depth(0.5, 0.5))
    };
    shared.wish(|state| {
        if let (Some(depth), false) = (depth, state.wish.pose.is_changed()) {
            state.wish.pose.set_target_distance(depth);
        }
        state.wish.pose.apply(step);
    });
}

/// Goes back to one of the scene's cameras.
fn camera(number: usize, shared: &Shared) -> Result<(), String> {
    let pose = shared.lock().poses.get(number).cloned().ok_or("there is no such camera")?;
    shared.wish(|state| {
        state.wish.pose = pose;
        state.wish.camera = number;
    });
    Ok(())
}

fn focus((x, y): (f64, f64), shared: &Shared) -> Result<(), String> {
    let frame = shared.lock().frame.clone();
    let depth = frame.and_then(|frame| frame.depth(x, y)).ok_or("there is no surface at this place")?;
    shared.wish(|state| state.wish.pose.focus(depth));
    Ok(())
}

fn set(settings: Settings, shared: &Shared) -> Result<(), String> {
    let aov = match settings.pass.as_deref() {
        None | Some("") => None,
        Some(name) => Some(Aov::from_option(name).ok_or("there is no such pass")?),
    };
    let look = shared.lock().look.clone();
    let view = settings.view.as_deref().map(|name| look.view(name).ok_or("there is no such view"));
    let view = view.transpose()?;
    let fits = |exposure: f32| (-100.0..=100.0).contains(&exposure);
    if !settings.exposure.is_none_or(fits) || !settings.rotation.is_none_or(f64::is_finite) {
        return Err("a number is out of range".to_string());
    }
    let is_wish = settings.rotation.is_some() || settings.size.is_some() || settings.defocus.is_some();
    if is_wish && !shared.lock().facts.is_live {
        return Err(LOOK_ON.to_string());
    }
    let sizes = shared.lock().facts.sizes.clone();
    if settings.size.is_some_and(|size| !sizes.contains(&size)) {
        return Err("there is no such size".to_string());
    }
    shared.show(|state| {
        state.look.png.exposure = settings.exposure.unwrap_or(state.look.png.exposure);
        state.look.png.view = view.unwrap_or(look.png.view);
        if settings.pass.is_some() {
            state.look.aov = aov;
        }
    });
    let is_recorded = |state: &State| state.wish.aov == aov || aov.is_none();
    let is_live = shared.lock().facts.is_live;
    if is_wish || (is_live && settings.pass.is_some() && !is_recorded(&shared.lock())) {
        shared.wish(|state| {
            state.wish.aov = aov.or(state.wish.aov);
            state.wish.rotation = settings.rotation.or(state.wish.rotation);
            state.wish.size = settings.size.unwrap_or(state.wish.size);
            settings.defocus.filter(|d| d.is_finite()).into_iter().for_each(|d| state.wish.pose.open(d));
        });
    }
    Ok(())
}
