//! `transform = [...]`: steps, applied in the order listed.
//!
//! `{ translate = [x, y, z] }`, `{ rotate = { axis = [x, y, z], angle = degrees } }` (counter-clockwise seen from the
//! axis's tip), `{ euler = [x, y, z] }` (degrees; about the world's x, then y, then z axis),
//! `{ quaternion = [x, y, z, w] }`, `{ scale = s }` or `{ scale = [x, y, z] }`, and `{ matrix = [16 numbers] }` row by
//! row for column vectors: the translation is at positions 4, 8 and 12, and the last row is 0 0 0 1.
//!
//! It places objects and, instead of positions and directions, cameras, lights and portals, which without steps are at the origin, look or
//! emit along -z, and have y as up vector. Its scale applies to the size of area lights and portals; cameras and other lights ignore it.
//!
//! # motion
//!
//! `motion` of an object, of the camera or of a light: its motion in world space, after its placement (for an object its `transform`). Cameras and
//! lights can't be scaled by it, unless they have a `transform`; those at a node of a model follow the node. Times are in frames; 0 is the time of a
//! single picture, and N that of frame N of a sequence. `shutter` of `[camera]` (`--shutter`) adds motion blur.
//!
//! | Key | Meaning |
//! |---|---|
//! | `translate` | `[x, y, z]`: metres per frame |
//! | `rotate` | `{ axis, angle, center = [0, 0, 0] }`: rotation by `angle` degrees per frame about an axis through a world-space point |
//! | `keys` | instead of both: a list of `{ frame, transform }` in ascending order; at such a frame the steps of `transform` are applied after those of the object. In between, translation and scale are interpolated linearly and rotation spherically; before the first and after the last key they are constant |

use super::builder::SceneFileBuilder;
use super::fields::{Fields, number, suggestion};
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
        object.problems.push(span, "the transform is singular or not finite");
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
        let rotation = fields.table("rotate").and_then(|rotate| axis_and_angle(&rotate));
        rotation.map(|(axis, angle)| DAffine3::from_axis_angle(axis, angle))
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
        fields.report(format!("a step of 'transform' needs exactly one of {}", keys.join(", ")));
    }
    fields.finish();
    step
}

/// The unit axis and the angle, radians, of a rotation; no other keys are known after it.
fn axis_and_angle(fields: &Fields) -> Option<(DVec3, f64)> {
    let axis = fields.require("axis", fields.vector("axis"));
    let angle = fields.require("angle", fields.number("angle"));
    fields.finish();
    let axis = axis?;
    let Some(unit) = axis.value.try_normalize() else {
        fields.problems.push(axis.span, "'axis' has length 0");
        return None;
    };
    Some((unit, angle?.value.to_radians()))
}

fn matrix(fields: &Fields, m: [f64; 16]) -> Option<DAffine3> {
    if m[12..] != [0.0, 0.0, 0.0, 1.0] {
        fields.report_help(
            "the last row of 'matrix' must be 0, 0, 0, 1",
            "the 16 numbers are in row-major order",
        );
        return None;
    }
    let column = |c: usize| DVec3::new(m[c], m[4 + c], m[8 + c]);
    let linear = DMat3::from_cols(column(0), column(1), column(2));
    Some(DAffine3::from_mat3_translation(linear, column(3)))
}

/// The motion of an object as a function of time.
enum Trajectory {
    /// Constant velocity and angular velocity.
    Constant { translation_per_frame: DVec3, axis: DVec3, rad_per_frame: f64, center: DVec3 },
    /// Keys: frame and transform.
    Keys(Vec<(f64, DAffine3)>),
}

impl Trajectory {
    /// The motion's transform at a frame.
    fn at(&self, frame: f64) -> DAffine3 {
        match self {
            Trajectory::Constant { translation_per_frame, axis, rad_per_frame, center } => {
                let rotation = DAffine3::from_axis_angle(*axis, rad_per_frame * frame);
                let to_center = DAffine3::from_translation(-*center);
                DAffine3::from_translation(*center + *translation_per_frame * frame) * rotation * to_center
            }
            Trajectory::Keys(keys) => interpolate(keys, frame),
        }
    }
}

/// Interpolates keys by scale, rotation and translation; by the matrix if one of them shears.
fn interpolate(keys: &[(f64, DAffine3)], frame: f64) -> DAffine3 {
    let (before, t) = key_segment(keys, frame);
    let Some(t) = t else { return keys.get(before).map_or(DAffine3::IDENTITY, |key| key.1) };
    let ((_, from), (_, to)) = (keys[before], keys[before + 1]);
    if shears(&from) || shears(&to) {
        return mix(&from, &to, t);
    }
    let (scale0, rotation0, translation0) = from.to_scale_rotation_translation();
    let (scale1, rotation1, translation1) = to.to_scale_rotation_translation();
    DAffine3::from_scale_rotation_translation(
        scale0.lerp(scale1, t),
        rotation0.slerp(rotation1, t),
        translation0.lerp(translation1, t),
    )
}

/// Whether a transform is more than scale, rotation and translation.
fn shears(transform: &DAffine3) -> bool {
    let (scale, rotation, translation) = transform.to_scale_rotation_translation();
    let recomposed = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
    !recomposed.matrix3.abs_diff_eq(transform.matrix3, 1e-6 * scale.abs().max_element())
}

/// A motion evaluated for a frame.
pub(super) struct EvaluatedMotion {
    /// At the frame's time, after the object's transform.
    pub at_time: DAffine3,
    /// Relative to `at_time`, over the shutter interval; `None` if no other times are sampled.
    pub relative_keys: Option<Keyframes<DAffine3>>,
}

/// The motion of a camera or light, which can't be scaled.
pub(super) fn rigid_motion(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    name: &str,
) -> Option<EvaluatedMotion> {
    let motion = read_motion(build, fields, name)?;
    let is_rigid = |m: &DAffine3| {
        let m = m.matrix3;
        (m * m.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-6) && m.determinant() > 0.0
    };
    let others = motion.relative_keys.iter().flat_map(Keyframes::all);
    if std::iter::once(&motion.at_time).chain(others).all(is_rigid) {
        return Some(motion);
    }
    fields.report("'motion' of cameras and lights must not scale or mirror");
    None
}

/// The key `motion` of an object.
pub(super) fn read_motion(
    build: &mut SceneFileBuilder,
    object: &Fields,
    name: &str,
) -> Option<EvaluatedMotion> {
    let fields = object.table("motion")?;
    let trajectory = read_trajectory(&fields);
    fields.finish();
    let trajectory = trajectory?;
    let now = build.frame();
    let at_time = trajectory.at(now);
    let inverse = at_time.inverse();
    let relative = |frames: f64| trajectory.at(now + frames) * inverse;
    let shutter = build.shutter;
    if !shutter.needs_motion() {
        warn_of_closed_shutter(build);
        return Some(EvaluatedMotion { at_time, relative_keys: None });
    }
    let (keys, is_enough) = shutter.keys_for(&mut |frames| vec![relative(frames)]);
    if !is_enough {
        let message = format!("'{name}' rotates too far during the shutter interval for {keys} motion keys");
        build.loaded.warnings.push(Warning::new(build.file, "", message));
    }
    let keys = shutter.key_frames(keys).map(&relative).collect();
    let neighbours = shutter.vectors.then(|| [relative(-1.0), relative(1.0)]);
    Some(EvaluatedMotion { at_time, relative_keys: Some(Keyframes { keys, neighbours }) })
}

fn warn_of_closed_shutter(build: &mut SceneFileBuilder) {
    let message = "there is motion, but the shutter time is 0: 'shutter' of [camera] adds motion blur";
    let note = Warning::new(build.file, "", message);
    if build.options.shutter.frames.is_none() && !build.loaded.notes.iter().any(|n| n.message == note.message)
    {
        build.loaded.notes.push(note);
    }
}

fn read_trajectory(fields: &Fields) -> Option<Trajectory> {
    if fields.has("keys") {
        if fields.has("translate") || fields.has("rotate") {
            fields.report("'keys' can't be combined with 'translate' or 'rotate'");
            return None;
        }
        return read_keys(fields, "keys", "motion", |key| Some(read(key))).map(Trajectory::Keys);
    }
    let translation_per_frame = fields.vector("translate").map(|t| t.value);
    let mut rotation = (DVec3::Y, 0.0, DVec3::ZERO);
    if let Some(rotate) = fields.table("rotate") {
        let center = rotate.vector("center").map_or(DVec3::ZERO, |c| c.value);
        let (axis, angle) = axis_and_angle(&rotate)?;
        rotation = (axis, angle, center);
    } else if !fields.has("translate") {
        fields.report("'motion' needs 'translate', 'rotate' or 'keys'");
        return None;
    }
    let (axis, rad_per_frame, center) = rotation;
    Some(Trajectory::Constant {
        translation_per_frame: translation_per_frame.unwrap_or(DVec3::ZERO),
        axis,
        rad_per_frame,
        center,
    })
}

/// Reads a list of keys: tables with an ascending `frame` and a value that `read` reads. Messages call them keys of `owner`.
/// `None` without the list or after a problem.
pub(super) fn read_keys<'a, T>(
    fields: &Fields<'a>,
    list: &'static str,
    owner: &str,
    mut read: impl FnMut(&Fields<'a>) -> Option<T>,
) -> Option<Vec<(f64, T)>> {
    let mut keys: Vec<(f64, T)> = Vec::new();
    let description = format!("a key of '{owner}'");
    for value in fields.list(list)? {
        let key = Fields::of_value(&description, value, fields.problems)?;
        let frame = key.require("frame", key.number("frame"));
        let keyed = read(&key);
        key.finish();
        let (frame, keyed) = (frame?, keyed?);
        if keys.last().is_some_and(|(before, _)| *before >= frame.value) {
            let message = format!("the frames of '{list}' don't increase");
            fields.problems.push_help(frame.span, message, "each key must come after the one before it");
            return None;
        }
        keys.push((frame.value, keyed));
    }
    if keys.is_empty() {
        let of = if list == owner { String::new() } else { format!(" of '{owner}'") };
        fields.report(format!("'{list}'{of} is empty"));
        return None;
    }
    Some(keys)
}

/// The index of the last key up to a frame (or of the first key), and the interpolation weight of the next key; `None`
/// outside of the keys.
pub(super) fn key_segment<T>(keys: &[(f64, T)], frame: f64) -> (usize, Option<f64>) {
    let after = keys.partition_point(|(at, _)| *at <= frame);
    let before = after.saturating_sub(1);
    let is_between = after > 0 && after < keys.len();
    (before, is_between.then(|| (frame - keys[before].0) / (keys[after].0 - keys[before].0)))
}

/// The placement of a light, with its motion.
pub(super) struct MovingPlacement {
    /// At the frame's time.
    pub now: Placement,
    /// Keys over the shutter interval; `None` at rest.
    pub motion: Option<Keyframes<Placement>>,
}

/// The placement of a light.
#[derive(Clone, Copy)]
pub(super) struct Placement {
    /// World space, metres.
    pub center: DVec3,
    /// Unit vector of emission.
    pub direction: DVec3,
    /// Unit vector along the width, orthogonal to the direction.
    pub right: DVec3,
    /// Factors on width and height.
    pub scale: [f64; 2],
}

impl MovingPlacement {
    /// The placement of a light by its transforms; `None` if the one at the frame's time is singular. Motion with a singular
    /// key is ignored.
    fn from_transforms(now: &DAffine3, motion: Option<&Keyframes<DAffine3>>) -> Option<MovingPlacement> {
        let now = Placement::from_transform(now)?;
        let motion = motion.map(|keys| keys.map(Placement::from_transform));
        let motion = motion.filter(|keys| keys.all().all(Option::is_some));
        let motion = motion.map(|keys| keys.map(|key| key.unwrap_or(now)));
        Some(MovingPlacement { now, motion })
    }

    /// Applies the key `motion` of the light.
    pub fn with_motion(self, motion: Option<&EvaluatedMotion>) -> MovingPlacement {
        let Some(EvaluatedMotion { at_time, relative_keys }) = motion else { return self };
        let now = self.now.transformed(at_time);
        let motion = relative_keys.as_ref().map(|keys| keys.map(|key| now.transformed(key)));
        MovingPlacement { now, motion }
    }
}

impl Placement {
    /// The placement of a light by its transform; `None` if it is singular. Sheared axes are orthogonalized, so that the light
    /// stays a rectangle.
    fn from_transform(m: &DAffine3) -> Option<Placement> {
        let (x, y, z) = (m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis);
        let direction = (-z).try_normalize()?;
        let right = -(x - direction * x.dot(direction)).try_normalize()?;
        let scale = [x.length(), y.length()];
        (scale[1] > 0.0).then_some(Placement { center: m.translation, direction, right, scale })
    }

    /// A placement without a preferred `right`.
    pub fn along_axis(center: DVec3, direction: DVec3) -> Placement {
        Placement { center, direction, right: direction.any_orthonormal_vector(), scale: [1.0; 2] }
    }

    /// The placement after a rigid motion.
    fn transformed(&self, motion: &DAffine3) -> Placement {
        let rotated = |v: DVec3| motion.transform_vector3(v).normalize_or(v);
        let (direction, right) = (rotated(self.direction), rotated(self.right));
        Placement { center: motion.transform_point3(self.center), direction, right, scale: self.scale }
    }

    /// Transform from the unit square centred at the origin in the xy plane, emitting along z.
    pub fn world_from_unit(&self) -> DAffine3 {
        let [width, height] = self.scale;
        let (u, v) = (self.right * width, self.direction.cross(self.right) * height);
        DAffine3::from_mat3_translation(DMat3::from_cols(u, v, self.direction), self.center)
    }
}

/// The placement of an area light by `center`, `up` and `target` or `direction`.
pub(super) fn placement_by_target(fields: &Fields) -> Option<MovingPlacement> {
    let center = fields.require("center", fields.vector("center"));
    let up = fields.vector("up").map_or(DVec3::Y, |u| u.value);
    let center = center?.value;
    let direction = direction(fields, Some(center))?;
    // The width of lights that emit along `up`, such as ceiling lights, is along x.
    let sides = [up.normalize_or_zero(), DVec3::NEG_Z].map(|up| up.cross(direction));
    let right = sides.into_iter().find(|s| s.length() > 1e-6).map(DVec3::normalize);
    let right = right.unwrap_or_else(|| direction.any_orthonormal_vector());
    Some(MovingPlacement { now: Placement { center, direction, right, scale: [1.0; 2] }, motion: None })
}

/// The placement of a light at an empty node of the model; it emits along the node's -z, as glTF's lights do.
pub(super) fn placement_at_node(build: &mut SceneFileBuilder, fields: &Fields) -> Option<MovingPlacement> {
    let name = fields.string("node")?;
    let empties = &build.loaded.empties;
    let Some(empty) = empties.iter().find(|empty| empty.name == name.value) else {
        let message = ("unknown-node", format!("the model has no empty node '{}'", name.value));
        let names = empties.iter().map(|empty| empty.name.as_str());
        let help = suggestion(name.value, names, format!("it has {} empty nodes", empties.len()));
        fields.problems.push_help(name.span, message, help);
        return None;
    };
    let placement = MovingPlacement::from_transforms(&empty.world_from_node, empty.motion.as_ref());
    let Some(placement) = placement else {
        fields.problems.push(name.span, format!("the node '{}' has a scale of 0", name.value));
        return None;
    };
    if placement.motion.is_none() && empty.motion.is_some() {
        let place = format!("node '{}'", name.value);
        build.loaded.warnings.push(Warning::new(build.file, place, SINGULAR_MOTION));
    }
    Some(placement)
}

/// The warning about a light whose transform is singular at another time of the shutter interval.
const SINGULAR_MOTION: &str = "the light has a scale of 0 during the shutter interval: its motion is ignored";

/// The placement of a light or portal by the key `transform`, with a motion: it emits along -z, with its height along
/// y. `None` without the key, or if the transform is singular.
pub(super) fn placement_by_transform(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    motion: Option<&EvaluatedMotion>,
) -> Option<MovingPlacement> {
    let span = fields.raw("transform")?.span();
    let (world_from_light, keys) = with_motion(read(fields), motion);
    let placement = MovingPlacement::from_transforms(&world_from_light, keys.as_ref());
    match &placement {
        None => fields.problems.push(span, "the light has a scale of 0 at this frame"),
        Some(placement) if placement.motion.is_none() && keys.is_some() => {
            build.loaded.warnings.push(Warning::new(build.file, fields.description(), SINGULAR_MOTION));
        }
        Some(_) => {}
    }
    placement
}

/// A transform followed by a motion: at the frame's time, and its keys over the shutter interval.
pub(super) fn with_motion(
    transform: DAffine3,
    motion: Option<&EvaluatedMotion>,
) -> (DAffine3, Option<Keyframes<DAffine3>>) {
    let Some(EvaluatedMotion { at_time, relative_keys }) = motion else { return (transform, None) };
    let now = *at_time * transform;
    (now, relative_keys.as_ref().map(|keys| keys.map(|key| *key * now)))
}

/// The names of all nodes with lights of a file.
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
        (Some(given), None) | (None, Some(given)) => given,
        (Some(_), Some((_, span))) => {
            fields.problems.push(span, "'target' and 'direction' exclude each other: keep one");
            return None;
        }
        (None, None) => {
            let keys = if position.is_some() { "'target' or 'direction'" } else { "'direction'" };
            fields.report(format!("the light needs {keys}"));
            return None;
        }
    };
    let unit = vector.try_normalize();
    if unit.is_none() {
        fields.problems.push(span, "the light has no direction: its length is 0");
    }
    unit
}
