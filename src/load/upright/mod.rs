//! Which axis of a model points up, where its format leaves that open.

mod guess;

use super::{LoadOptions, Loaded};
use crate::error::{Choice, Warning};
use crate::math::{DAffine3, DMat3, DQuat, DVec3};
use crate::scene::{Environment, Scene};
use std::path::Path;

/// Which axis of the file points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// Guessed by what the file says about its origin and by the model's shape.
    Auto,
    /// x.
    X,
    /// y, as everywhere here.
    #[default]
    Y,
    /// z, as in Blender and most scans and CAD.
    Z,
    /// Against x.
    NegX,
    /// Against y.
    NegY,
    /// Against z.
    NegZ,
}

/// What a file tells about who wrote it and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UpHint {
    /// The axis that this writer's files have up.
    pub writer: Option<(Up, &'static str)>,
    /// Files of this format mostly have y up; else they have z up about as often.
    pub is_mostly_y: bool,
}

impl Up {
    /// All of them.
    pub const ALL: [Up; 7] = [Up::Auto, Up::X, Up::Y, Up::Z, Up::NegX, Up::NegY, Up::NegZ];

    /// As users write it.
    pub fn name(self) -> &'static str {
        match self {
            Up::Auto => "auto",
            Up::X => "x",
            Up::Y => "y",
            Up::Z => "z",
            Up::NegX => "-x",
            Up::NegY => "-y",
            Up::NegZ => "-z",
        }
    }

    /// The rotation that brings it up, exact in every number. The front stays where most programs have it: -y of models
    /// with z up comes to the front, z.
    fn rotation(self) -> DMat3 {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        let (x, y, z) = match self {
            Up::Auto | Up::Y => (x, y, z),
            Up::Z => (x, -z, y),
            Up::NegY => (x, -y, -z),
            Up::NegZ => (x, z, -y),
            Up::X => (y, -x, z),
            Up::NegX => (-y, x, z),
        };
        DMat3::from_cols(x, y, z)
    }
}

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
