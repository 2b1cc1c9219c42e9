//! What `[camera]` says about the shutter.

use super::fields::{Fields, number};
use crate::load::{LONGEST_SHUTTER, ShutterOptions, ShutterPosition};

/// What the user chose, else what the camera's table says. To be known before objects are read; what is wrong with it is noted
/// where the camera is.
pub(super) fn chosen(options: ShutterOptions, root: &Fields) -> ShutterOptions {
    let options = ShutterOptions { vectors: options.vectors || asks_for_vectors(root), ..options };
    let Some(camera) = root.raw("camera").map(|v| v.get_ref()) else { return options };
    let list = camera.as_array().into_iter().flat_map(|list| list.iter().map(|v| v.get_ref()));
    let tables = [camera].into_iter().chain(list).filter_map(|v| v.as_table());
    tables.fold(options, |options, table| {
        let frames = table.get("shutter").and_then(|v| number(v.get_ref()));
        let position = table.get("shutter_position").and_then(|v| v.get_ref().as_str());
        let named = position.and_then(|name| ShutterPosition::ALL.iter().find(|(known, _)| *known == name));
        let frames = frames.filter(|f| (0.0..=LONGEST_SHUTTER).contains(f));
        options.or(frames, named.map(|(_, position)| *position))
    })
}

/// Are motion vectors among the channels that `[render]` asks for?
fn asks_for_vectors(root: &Fields) -> bool {
    let aovs = root.raw("render").and_then(|v| v.get_ref().as_table()?.get("aovs")?.get_ref().as_array());
    let mut names = aovs.into_iter().flat_map(|list| list.iter()).filter_map(|v| v.get_ref().as_str());
    names.any(|name| name == "motion" || name == "all")
}

/// Notes what is wrong with it.
pub(super) fn check(camera: &Fields) {
    camera.number_in("shutter", 0.0..LONGEST_SHUTTER, 0.0);
    camera.choice("shutter_position", &ShutterPosition::ALL);
}
