//! What pages are told about the state.

use super::frame::Frame;
use super::state::State;
use crate::cli::command_line;
use serde_json::{Value, json};

/// Everything but the pixels.
pub(super) fn state(state: &State, frame: &Frame) -> Value {
    let png = &state.look.png;
    let pass = state.look.aov.filter(|&aov| frame.film.aov(aov).is_some());
    json!({
        "version": state.version,
        "width": frame.film.width(),
        "height": frame.film.height(),
        "samples": frame.samples,
        "seconds": frame.seconds,
        "error": frame.error,
        "finished": frame.is_finished && frame.order == state.wishes,
        "preview": frame.scale > 1,
        "trouble": state.trouble,
        "facts": state.facts,
        "size": state.wish.size,
        "camera": state.wish.camera,
        "rotation": state.wish.rotation.or(state.facts.rotation),
        "defocus": state.wish.pose.defocus(),
        "exposure": png.exposure,
        "view": png.view.name(),
        "views": state.look.views(),
        "pass": pass.map_or("", |aov| aov.info().option),
        "command": command(state),
    })
}

/// The command that renders what is shown.
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
    // What the scene's file says of these may be something else.
    add("--exposure", state.look.png.exposure.to_string());
    add("--spp", state.facts.samples.to_string());
    add("--view", state.look.png.view.name().to_string());
    words.extend(state.wish.pose.arguments());
    words.extend(["-o".to_string(), "picture.exr".to_string(), "-o".to_string(), "picture.png".to_string()]);
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}

/// The command by which `render` does what this process does, but for what pages set.
pub(crate) fn own_command() -> Vec<String> {
    let words = ["oscura", "render"].map(str::to_string);
    words.into_iter().chain(given(arguments())).collect()
}

/// The arguments of this process.
pub(super) fn arguments() -> impl Iterator<Item = String> {
    command_line::words().map(|word| word.to_string_lossy().into_owned())
}

/// The arguments of this process that a render takes as well and that the page doesn't set.
fn given(arguments: impl Iterator<Item = String>) -> Vec<String> {
    const FLAGS: [&str; 2] = ["--no-open", "--watch"];
    const SET: [&str; 14] = [
        "--camera",
        "--port",
        "--width",
        "--height",
        "--exposure",
        "--view",
        "--env-rotation",
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_replaces_what_it_sets() {
        let words = "view a.glb --no-open --port 80 --spp 64 --exposure=1 --env x.hdr --width 10 \
                     --view-height 3 --fov=30 --depth 4";
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
