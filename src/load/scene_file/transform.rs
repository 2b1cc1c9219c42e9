//! `transform = [...]`: steps applied in the order listed, each to the result of the one before, composed in f64.
//!
//! `{ translate = [x, y, z] }`, `{ rotate = { axis = [x, y, z], angle = degrees } }` (counter-clockwise seen from the
//! axis's tip), `{ euler = [x, y, z] }` (degrees; about the world's x, then y, then z axis),
//! `{ quaternion = [x, y, z, w] }`, `{ scale = s }` or `{ scale = [x, y, z] }`, and `{ matrix = [16 numbers] }` row by
//! row for column vectors: the translation is in places 4, 8 and 12, and the last row is 0 0 0 1.
//!
//! # motion
//!
//! `motion` of an object, of the camera or of a light: its motion relative to its placement (of an object its `transform`). Cameras and
//! lights can't be scaled; those at a node of a model move along with it. Times are in frames; 0 is the time of a
//! single picture, and N that of frame N of a sequence. With `shutter` of `[camera]` (`--shutter`) pictures show the motion blur
//! of the time that the shutter is open.
//!
//! | Key | Meaning |
//! |---|---|
//! | `translate` | `[x, y, z]`: metres per frame |
//! | `rotate` | `{ axis, angle, center = [0, 0, 0] }`: rotation by `angle` degrees per frame about an axis through a point of the world |
//! | `keys` | instead of both: a list of `{ frame, transform }` in the order of time; at such a time the steps of `transform` follow those of the object. In between, translation, rotation and scale are interpolated linearly; before the first and after the last key they are constant |

use super::builder::SceneFileBuilder;
use super::fields::{Fields, nearest, number};
use crate::error::Warning;
use crate::math::{DAffine3, DMat3, DQuat, DVec3, mix};
use crate::scene::Keyframes;

/// The composed transform of an object; the identity without one.
pub(super) fn read(object: &Fields) -> DAffine3 {
    let mut total = DAffine3::IDENTITY;
    let Some(steps) = object.list("transform") else { return total };
    for step in steps {
        let Some(table) = step.get_ref().as_table() else {
            object.problems.push_help(
                step.span(),
                "a step of 'transform' must be a table",
                "as in transform = [{ translate = [0, 1, 0] }]",
            );
            continue;
        };
        let fields = Fields::new("a step of 'transform'", table, step.span(), object.problems);
        total = read_step(&fields).unwrap_or(DAffine3::IDENTITY) * total;
    }
    let determinant = total.matrix3.determinant();
    // Meshes may become flat.
    let is_flat = determinant == 0.0 && !object.has("mesh");
    if !total.is_finite() || is_flat || !determinant.is_finite() {
        let span = object.raw("transform").map_or(object.span(), |t| t.span());
        object.problems.push(span, "the transform flattens the object or is not finite");
        return DAffine3::IDENTITY;
    }
    total
}

fn read_step(fields: &Fields) -> Option<DAffine3> {
    let keys = ["translate", "rotate", "euler", "quaternion", "scale", "matrix"];
    let given = keys.iter().filter(|k| fields.has(k)).count();
    let before = fields.entries().count();
    let step = if fields.has("translate") {
        fields.vector("translate").map(|t| DAffine3::from_translation(t.value))
    } else if fields.has("rotate") {
        fields.table("rotate").and_then(|r| axis_angle(&r))
    } else if fields.has("euler") {
        fields.vector("euler").map(|e| {
            let [x, y, z] = e.value.to_array().map(f64::to_radians);
            DAffine3::from_quat(
                DQuat::from_rotation_z(z) * DQuat::from_rotation_y(y) * DQuat::from_rotation_x(x),
            )
        })
    } else if fields.has("quaternion") {
        fields.numbers::<4>("quaternion").and_then(|q| {
            let quaternion = DQuat::from_array(q.value);
            if quaternion.length() < 1e-9 {
                fields.problems.push(q.span, "'quaternion' has length 0");
                return None;
            }
            Some(DAffine3::from_quat(quaternion.normalize()))
        })
    } else if let Some(value) = fields.raw("scale") {
        match number(value.get_ref()) {
            Some(s) => Some(DAffine3::from_scale(DVec3::splat(s))),
            None => fields.vector("scale").map(|s| DAffine3::from_scale(s.value)),
        }
    } else {
        fields.numbers::<16>("matrix").and_then(|m| matrix(fields, m.value))
    };
    if given != 1 && before == given {
        let message = format!("a step of 'transform' needs exactly one of {}", keys.join(", "));
        fields.problems.push(fields.span(), message);
    }
    fields.finish();
    step
}

fn axis_angle(fields: &Fields) -> Option<DAffine3> {
    let axis = fields.require("axis", fields.vector("axis"));
    let angle = fields.require("angle", fields.number("angle"));
    fields.finish();
    let axis = axis?;
    let Some(unit) = axis.value.try_normalize() else {
        fields.problems.push(axis.span, "'axis' has length 0");
        return None;
    };
    Some(DAffine3::from_axis_angle(unit, angle?.value.to_radians()))
}

fn matrix(fields: &Fields, m: [f64; 16]) -> Option<DAffine3> {
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        fields.problems.push_help(
            fields.span(),
            "the last row of 'matrix' must be 0, 0, 0, 1",
            "the 16 numbers go row by row",
        );
        return None;
    }
    let column = |c: usize| DVec3::new(m[c], m[4 + c], m[8 + c]);
    let linear = DMat3::from_cols(column(0), column(1), column(2));
    Some(DAffine3::from_mat3_translation(linear, column(3)))
}

/// The motion of an object.
enum Trajectory {
    /// At constant velocity.
    Even { per_frame: DVec3, axis: DVec3, rad_per_frame: f64, center: DVec3 },
    /// From key to key.
    Keys(Vec<(f64, DAffine3)>),
}

impl Trajectory {
    /// The motion's transform at a frame.
    fn at(&self, frame: f64) -> DAffine3 {
        match self {
            Trajectory::Even { per_frame, axis, rad_per_frame, center } => {
                let turn = DAffine3::from_axis_angle(*axis, rad_per_frame * frame);
                let to_center = DAffine3::from_translation(-*center);
                DAffine3::from_translation(*center + *per_frame * frame) * turn * to_center
            }
            Trajectory::Keys(keys) => between(keys, frame),
        }
    }
}

/// Interpolates keys by scale, rotation and translation; by the matrix where one of them shears.
fn between(keys: &[(f64, DAffine3)], frame: f64) -> DAffine3 {
    let (before, share) = segment(keys, frame);
    let Some(share) = share else { return keys.get(before).map_or(DAffine3::IDENTITY, |key| key.1) };
    let ((_, from), (_, to)) = (keys[before], keys[before + 1]);
    if shears(&from) || shears(&to) {
        return mix(&from, &to, share);
    }
    let (scale0, turn0, place0) = from.to_scale_rotation_translation();
    let (scale1, turn1, place1) = to.to_scale_rotation_translation();
    DAffine3::from_scale_rotation_translation(
        scale0.lerp(scale1, share),
        turn0.slerp(turn1, share),
        place0.lerp(place1, share),
    )
}

/// Is a transform more than a scale, a rotation and a translation?
fn shears(transform: &DAffine3) -> bool {
    let (scale, turn, place) = transform.to_scale_rotation_translation();
    let again = DAffine3::from_scale_rotation_translation(scale, turn, place);
    !again.matrix3.abs_diff_eq(transform.matrix3, 1e-6 * scale.abs().max_element())
}

/// A motion evaluated at the picture's time and around it.
pub(super) struct EvaluatedMotion {
    /// Relative to the object's transform.
    pub at_time: DAffine3,
    /// Relative to the picture's time, if other times are sampled.
    pub onwards: Option<Keyframes<DAffine3>>,
}

/// The motion of something that can't be scaled: a camera or a light.
pub(super) fn rigid_motion(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    name: &str,
) -> Option<EvaluatedMotion> {
    let moved = read_motion(build, fields, name)?;
    let is_rigid = |m: &DAffine3| {
        let m = m.matrix3;
        (m * m.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-6) && m.determinant() > 0.0
    };
    let others = moved.onwards.iter().flat_map(Keyframes::all);
    if std::iter::once(&moved.at_time).chain(others).all(is_rigid) {
        return Some(moved);
    }
    let message = "'motion' of cameras and lights must not scale or mirror";
    fields.problems.push(fields.span(), message);
    None
}

/// The motion of an object's table; none without the key.
pub(super) fn read_motion(
    build: &mut SceneFileBuilder,
    object: &Fields,
    name: &str,
) -> Option<EvaluatedMotion> {
    let fields = object.table("motion")?;
    let track = read_track(&fields);
    fields.finish();
    let track = track?;
    let now = build.frame();
    let at_time = track.at(now);
    let back = at_time.inverse();
    let moved = |frames: f64| track.at(now + frames) * back;
    let shutter = build.shutter;
    if !shutter.needs_motion() {
        warn_of_closed_shutter(build);
        return Some(EvaluatedMotion { at_time, onwards: None });
    }
    let (keys, is_enough) = shutter.keys_for(&mut |frames| vec![moved(frames)]);
    if !is_enough {
        let message = format!("'{name}' turns too far while the shutter is open for {keys} keys");
        build.loaded.warnings.push(Warning::new(build.file, "", message));
    }
    let keys = shutter.key_frames(keys).map(&moved).collect();
    let neighbours = shutter.vectors.then(|| [moved(-1.0), moved(1.0)]);
    Some(EvaluatedMotion { at_time, onwards: Some(Keyframes { keys, neighbours }) })
}

fn warn_of_closed_shutter(build: &mut SceneFileBuilder) {
    let message = "something moves, but the shutter is closed: 'shutter' of [camera] opens it";
    let note = Warning::new(build.file, "", message);
    if build.options.shutter.frames.is_none() && !build.loaded.notes.iter().any(|n| n.message == note.message)
    {
        build.loaded.notes.push(note);
    }
}

fn read_track(fields: &Fields) -> Option<Trajectory> {
    if fields.has("keys") {
        if fields.has("translate") || fields.has("rotate") {
            fields.problems.push(fields.span(), "'keys' can't be combined with 'translate' or 'rotate'");
            return None;
        }
        return read_keys(fields, "keys", "motion", |key| Some(read(key))).map(Trajectory::Keys);
    }
    let per_frame = fields.vector("translate").map(|t| t.value);
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
    let (axis, rad_per_frame, center) = turn;
    Some(Trajectory::Even { per_frame: per_frame.unwrap_or(DVec3::ZERO), axis, rad_per_frame, center })
}

/// Reads the list of keys `list` of a table: tables with a `frame`, which increases, and what `read` makes of the rest. Problems call them
/// keys of `owner`. `None` without the list or after a problem.
pub(super) fn read_keys<'a, T>(
    fields: &Fields<'a>,
    list: &'static str,
    owner: &str,
    mut read: impl FnMut(&Fields<'a>) -> Option<T>,
) -> Option<Vec<(f64, T)>> {
    let mut keys: Vec<(f64, T)> = Vec::new();
    let what = format!("a key of '{owner}'");
    for value in fields.list(list)? {
        let Some(table) = value.get_ref().as_table() else {
            fields.problems.push(value.span(), format!("{what} must be a table"));
            return None;
        };
        let key = Fields::new(&what, table, value.span(), fields.problems);
        let frame = key.require("frame", key.number("frame"));
        let rest = read(&key);
        key.finish();
        let (frame, rest) = (frame?, rest?);
        if keys.last().is_some_and(|(before, _)| *before >= frame.value) {
            let message = format!("the frames of '{list}' don't increase");
            fields.problems.push_help(frame.span, message, "each key must come after the one before it");
            return None;
        }
        keys.push((frame.value, rest));
    }
    if keys.is_empty() {
        let of = if list == owner { String::new() } else { format!(" of '{owner}'") };
        fields.problems.push(fields.span(), format!("'{list}'{of} is empty"));
        return None;
    }
    Some(keys)
}

/// The last key up to a frame, or the first one, and between two keys the share of the way to the next.
pub(super) fn segment<T>(keys: &[(f64, T)], frame: f64) -> (usize, Option<f64>) {
    let after = keys.partition_point(|(at, _)| *at <= frame);
    let before = after.saturating_sub(1);
    let is_between = after > 0 && after < keys.len();
    (before, is_between.then(|| (frame - keys[before].0) / (keys[after].0 - keys[before].0)))
}

/// The placement of a light, and its motion.
pub(super) struct MovingPlacement {
    /// At the picture's time.
    pub now: Placement,
    /// At other times, if it moves while the shutter is open.
    pub motion: Option<Keyframes<Placement>>,
}

/// The placement of a light.
#[derive(Clone, Copy)]
pub(super) struct Placement {
    /// Its center.
    pub center: DVec3,
    /// The direction of emission, of unit length.
    pub direction: DVec3,
    /// The axis of its width, of unit length, orthogonal to the direction.
    pub right: DVec3,
    /// Factors on width and height.
    pub scale: [f64; 2],
}

impl MovingPlacement {
    /// With the motion that its table gives it.
    pub fn moved(self, moved: Option<&EvaluatedMotion>) -> MovingPlacement {
        let Some(EvaluatedMotion { at_time, onwards }) = moved else { return self };
        let now = self.now.moved(at_time);
        MovingPlacement { now, motion: onwards.as_ref().map(|onwards| onwards.map(|by| now.moved(by))) }
    }
}

impl Placement {
    /// The placement of a light at a node; `None` if the node is flattened. Sheared axes are orthogonalized, so that the light stays a
    /// rectangle.
    fn of_node(m: &DAffine3) -> Option<Placement> {
        let (x, y, z) = (m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis);
        let direction = (-z).try_normalize()?;
        let right = -(x - direction * x.dot(direction)).try_normalize()?;
        let scale = [x.length(), y.length()];
        (scale[1] > 0.0).then_some(Placement { center: m.translation, direction, right, scale })
    }

    /// From a position and a direction.
    pub fn of_axis(center: DVec3, direction: DVec3) -> Placement {
        Placement { center, direction, right: direction.any_orthonormal_vector(), scale: [1.0; 2] }
    }

    /// The placement under a rigid motion.
    pub fn moved(&self, by: &DAffine3) -> Placement {
        let turned = |v: DVec3| by.transform_vector3(v).normalize_or(v);
        let (direction, right) = (turned(self.direction), turned(self.right));
        Placement { center: by.transform_point3(self.center), direction, right, scale: self.scale }
    }

    /// From the unit square around the origin in the xy plane, which emits along z.
    pub fn world_from_unit(&self) -> DAffine3 {
        let [width, height] = self.scale;
        let (u, v) = (self.right * width, self.direction.cross(self.right) * height);
        DAffine3::from_mat3_translation(DMat3::from_cols(u, v, self.direction), self.center)
    }
}

/// An area light that the table places.
pub(super) fn placed(fields: &Fields) -> Option<MovingPlacement> {
    let center = fields.require("center", fields.vector("center"));
    let up = fields.vector("up").map_or(DVec3::Y, |u| u.value);
    let center = center?.value;
    let direction = direction(fields, Some(center))?;
    // Lights that emit along `up`, as ceiling lights do, have their width along x.
    let sides = [up.normalize_or_zero(), DVec3::NEG_Z].map(|up| up.cross(direction));
    let right = sides.into_iter().find(|s| s.length() > 1e-6).map(DVec3::normalize);
    let right = right.unwrap_or_else(|| direction.any_orthonormal_vector());
    Some(MovingPlacement { now: Placement { center, direction, right, scale: [1.0; 2] }, motion: None })
}

/// A light at an empty node of the model: it emits along the node's -z, as glTF's lights do. Seen that way, x
/// goes to the right.
pub(super) fn at_node(build: &mut SceneFileBuilder, fields: &Fields) -> Option<MovingPlacement> {
    let name = fields.string("node")?;
    let empties = &build.loaded.empties;
    let Some(empty) = empties.iter().find(|empty| empty.name == name.value) else {
        let message = ("unknown-node", format!("the model has no empty node '{}'", name.value));
        let help = match nearest(name.value, empties.iter().map(|empty| empty.name.as_str())) {
            Some(near) => format!("did you mean '{near}'?"),
            None => format!("it has {} nodes that hold nothing", empties.len()),
        };
        fields.problems.push_help(name.span, message, help);
        return None;
    };
    let Some(now) = Placement::of_node(&empty.world_from_node) else {
        fields.problems.push(name.span, format!("the node '{}' is flattened to nothing", name.value));
        return None;
    };
    let motion = empty.motion.as_ref().map(|moving| moving.map(Placement::of_node));
    let is_flattened = motion.as_ref().is_some_and(|m| m.all().any(Option::is_none));
    if is_flattened {
        let message =
            "the node of a light is flattened to nothing while the shutter is open: it stands still";
        let place = format!("node '{}'", name.value);
        build.loaded.warnings.push(Warning::new(build.file, place, message));
    }
    let motion = motion.filter(|_| !is_flattened).map(|moving| moving.map(|then| then.unwrap_or(now)));
    Some(MovingPlacement { now, motion })
}

/// The names of the nodes at which a file places lights.
pub(super) fn nodes_of_lights(root: &Fields) -> Vec<String> {
    let list = root.raw("lights").and_then(|lights| lights.get_ref().as_array());
    let lights = list.into_iter().flat_map(|list| list.iter()).filter_map(|light| light.get_ref().as_table());
    let shapes = lights.flat_map(|light| light.iter()).filter_map(|(_, shape)| shape.get_ref().as_table());
    let nodes = shapes.filter_map(|shape| shape.get("node")?.get_ref().as_str());
    nodes.map(str::to_string).collect()
}

/// The direction of emission: `direction`, or from `position` to `target`.
pub(super) fn direction(fields: &Fields, position: Option<DVec3>) -> Option<DVec3> {
    let target = position.and_then(|p| fields.vector("target").map(|t| (t.value - p, t.span)));
    let direction = fields.vector("direction").map(|d| (d.value, d.span));
    let (vector, span) = match (target, direction) {
        (Some(one), None) | (None, Some(one)) => one,
        (Some(_), Some((_, span))) => {
            fields.problems.push(span, "'target' and 'direction' exclude each other: leave one out");
            return None;
        }
        (None, None) => {
            let keys = if position.is_some() { "'target' or 'direction'" } else { "'direction'" };
            fields.problems.push(fields.span(), format!("the light needs {keys}"));
            return None;
        }
    };
    let unit = vector.try_normalize();
    if unit.is_none() {
        fields.problems.push(span, "the light has no direction: its length is 0");
    }
    unit
}
