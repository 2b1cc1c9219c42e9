//! Which axis of a model points up, where its format leaves that open.

mod axis;
mod guess;

pub use axis::{Up, UpHint};

use super::{LoadOptions, Loaded};
use crate::error::{Choice, Warning};
use crate::math::{DAffine3, DQuat};
use crate::scene::{Environment, Scene};
use std::path::Path;

/// Turns a model as the caller says.
pub(super) fn stand(scene: &mut Scene, up: Up) {
    if matches!(up, Up::Auto | Up::Y) {
        return;
    }
    let rotation = up.rotation();
    let turn = DAffine3::from_mat3(rotation);
    for instance in &mut scene.instances {
        instance.world_from_object = turn * instance.world_from_object;
    }
    for curves in &mut scene.curves {
        curves.world_from_object = turn * curves.world_from_object;
    }
    let quaternion = DQuat::from_mat3(&rotation);
    for shape in &mut scene.shapes {
        shape.center = rotation * shape.center;
        shape.rotation = quaternion * shape.rotation;
    }
}

/// Turns a whole model with all that goes with it.
fn stand_all(loaded: &mut Loaded, up: Up) {
    stand(&mut loaded.scene, up);
    loaded.offset = up.rotation() * loaded.offset;
}

/// Turns a model of a format that leaves its axis open: before anything is put beside it where the caller says how
/// (`is_last` is false), else when all is there, and only where neither camera nor lights show what is meant.
pub(super) fn apply(path: &Path, options: &LoadOptions, loaded: &mut Loaded, is_last: bool) {
    if options.up != Up::Auto {
        if !is_last {
            stand_all(loaded, options.up);
        }
        return;
    }
    let scene = &loaded.scene;
    let is_bare = scene.cameras.is_empty() && scene.lights.is_empty();
    if !is_last || !is_bare || scene.environment != Environment::Black {
        return;
    }
    let (up, why) = guess::up(loaded);
    if up != Up::Y {
        let message = format!("{} points up, by {why} ({} decides)", up.name(), Choice::Up);
        loaded.notes.push(Warning::new(path, "", message));
        stand_all(loaded, up);
    } else if let Some(why) = Some(why).filter(|why| !why.is_empty()) {
        let message = format!("y points up, by {why} ({} decides)", Choice::Up);
        loaded.notes.push(Warning::new(path, "", message));
    }
}
