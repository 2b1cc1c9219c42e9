//! `motion` of an object, of the camera or of a light: how it moves on from the place that it has, an object by its `transform`. Cameras and
//! lights can't grow; those at a node of a model move along with it. Times are in frames; 0 is the moment of a
//! single picture, and N that of frame N of a sequence. With `shutter` of `[camera]` (`--shutter`) pictures show the way that it
//! takes while the shutter is open.
//!
//! | Key | Meaning |
//! |---|---|
//! | `translate` | `[x, y, z]`: so many metres a frame |
//! | `rotate` | `{ axis, angle, center = [0, 0, 0] }`: so many degrees a frame about an axis through a point of the world |
//! | `keys` | instead of both: a list of `{ frame, transform }` in the order of time; at such a time the steps of `transform` follow those of the object. In between, places, angles and sizes change evenly; before the first and after the last key it stands still |

use super::build::Build;
use super::fields::Fields;
use super::transform;
use crate::error::Warning;
use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::Moving;

/// How an object moves.
enum Track {
    /// Evenly.
    Even { a_frame: DVec3, axis: DVec3, rad_a_frame: f64, center: DVec3 },
    /// From key to key.
    Keys(Vec<(f64, DAffine3)>),
}

impl Track {
    /// Where it has moved to from the place of its transform.
    fn at(&self, frame: f64) -> DAffine3 {
        match self {
            Track::Even { a_frame, axis, rad_a_frame, center } => {
                let turn = DAffine3::from_axis_angle(*axis, rad_a_frame * frame);
                let to_center = DAffine3::from_translation(-*center);
                DAffine3::from_translation(*center + *a_frame * frame) * turn * to_center
            }
            Track::Keys(keys) => between(keys, frame),
        }
    }
}

/// Between two keys parts change evenly, not the matrix.
fn between(keys: &[(f64, DAffine3)], frame: f64) -> DAffine3 {
    let after = keys.partition_point(|(at, _)| *at <= frame);
    let nearest = |at: usize| keys.get(at).map_or(DAffine3::IDENTITY, |key| key.1);
    if after == 0 || after == keys.len() {
        return nearest(after.saturating_sub(1));
    }
    let ((start, from), (end, to)) = (keys[after - 1], keys[after]);
    let share = (frame - start) / (end - start);
    let (scale0, turn0, place0) = from.to_scale_rotation_translation();
    let (scale1, turn1, place1) = to.to_scale_rotation_translation();
    DAffine3::from_scale_rotation_translation(
        scale0.lerp(scale1, share),
        turn0.slerp(turn1, share),
        place0.lerp(place1, share),
    )
}

/// Where an object has moved to at the picture's moment, and on from there.
pub(super) struct Moved {
    /// From the place of its transform.
    pub at_moment: DAffine3,
    /// From where it is at the picture's moment, if anything is to be known of other moments.
    pub onwards: Option<Moving<DAffine3>>,
}

/// The motion of something that keeps its size: of the camera, of a light.
pub(super) fn rigid(build: &mut Build, fields: &Fields, name: &str) -> Option<Moved> {
    let moved = read(build, fields, name)?;
    let is_rigid = |m: &DAffine3| {
        let m = m.matrix3;
        (m * m.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-6) && m.determinant() > 0.0
    };
    let others = moved.onwards.iter().flat_map(Moving::all);
    if std::iter::once(&moved.at_moment).chain(others).all(is_rigid) {
        return Some(moved);
    }
    let message = "cameras and lights are moved and turned only: their 'motion' scales or mirrors";
    fields.problems.push(fields.span(), message);
    None
}

/// The motion of an object's table; none without the key.
pub(super) fn read(build: &mut Build, object: &Fields, name: &str) -> Option<Moved> {
    let fields = object.table("motion")?;
    let track = read_track(&fields);
    fields.finish();
    let track = track?;
    let now = build.frame();
    let at_moment = track.at(now);
    let back = at_moment.inverse();
    let moved = |frames: f64| track.at(now + frames) * back;
    let shutter = build.shutter;
    if !shutter.wants_motion() {
        say_closed(build);
        return Some(Moved { at_moment, onwards: None });
    }
    let (keys, is_enough) = shutter.keys_for(&mut |frames| vec![moved(frames)]);
    if !is_enough {
        let message = format!("'{name}' turns too far while the shutter is open for {keys} keys");
        build.loaded.warnings.push(Warning::new(build.file, "", message));
    }
    let keys = shutter.key_frames(keys).map(&moved).collect();
    let neighbours = shutter.vectors.then(|| [moved(-1.0), moved(1.0)]);
    Some(Moved { at_moment, onwards: Some(Moving { keys, neighbours }) })
}

fn say_closed(build: &mut Build) {
    let message = "something moves, but the shutter is closed: 'shutter' of [camera] opens it";
    let note = Warning::new(build.file, "", message);
    if build.options.shutter.frames.is_none() && !build.loaded.notes.iter().any(|n| n.message == note.message)
    {
        build.loaded.notes.push(note);
    }
}

fn read_track(fields: &Fields) -> Option<Track> {
    if fields.has("keys") {
        if fields.has("translate") || fields.has("rotate") {
            fields.problems.push(fields.span(), "'keys' say all: leave 'translate' and 'rotate' out");
            return None;
        }
        return read_keys(fields).map(Track::Keys);
    }
    let a_frame = fields.vector("translate").map(|t| t.value);
    let mut turn = (DVec3::Y, 0.0, DVec3::ZERO);
    if let Some(rotate) = fields.table("rotate") {
        let axis = rotate.require("axis", rotate.vector("axis"));
        let angle = rotate.require("angle", rotate.number("angle"));
        let center = rotate.vector("center").map_or(DVec3::ZERO, |c| c.value);
        rotate.finish();
        let axis = axis?;
        let Some(unit) = axis.value.try_normalize() else {
            fields.problems.push(axis.span, "'axis' has length 0");
            return None;
        };
        turn = (unit, angle?.value.to_radians(), center);
    } else if !fields.has("translate") {
        fields.problems.push(fields.span(), "'motion' needs 'translate', 'rotate' or 'keys'");
        return None;
    }
    let (axis, rad_a_frame, center) = turn;
    Some(Track::Even { a_frame: a_frame.unwrap_or(DVec3::ZERO), axis, rad_a_frame, center })
}

fn read_keys(fields: &Fields) -> Option<Vec<(f64, DAffine3)>> {
    let list = fields.list("keys")?;
    let mut keys: Vec<(f64, DAffine3)> = Vec::new();
    for value in list {
        let Some(table) = value.get_ref().as_table() else {
            fields.problems.push(value.span(), "a key of 'motion' must be a table");
            return None;
        };
        let key = Fields::new("a key of 'motion'", table, value.span(), fields.problems);
        let frame = key.require("frame", key.number("frame"));
        let place = transform::read(&key);
        key.finish();
        let frame = frame?;
        if keys.last().is_some_and(|(before, _)| *before >= frame.value) {
            let help = "each key must come after the one before it";
            fields.problems.push_help(frame.span, "the frames of 'keys' don't increase", help);
            return None;
        }
        keys.push((frame.value, place));
    }
    if keys.is_empty() {
        fields.problems.push(fields.span(), "'keys' of 'motion' is empty");
        return None;
    }
    Some(keys)
}
