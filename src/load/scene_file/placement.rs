//! Where lights of scene files stand and which way they shine.

use super::build::Build;
use super::fields::{Fields, nearest};
use super::motion::Moved;
use crate::error::Warning;
use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::Moving;

/// A light's place, and how it moves on from there.
pub(super) struct Placed {
    /// At the picture's moment.
    pub now: Placement,
    /// At other times, if it moves while the shutter is open.
    pub motion: Option<Moving<Placement>>,
}

/// The place of a light.
#[derive(Clone, Copy)]
pub(super) struct Placement {
    /// Its middle.
    pub center: DVec3,
    /// The way it shines, of unit length.
    pub direction: DVec3,
    /// The side along which its width lies, of unit length and across the direction.
    pub right: DVec3,
    /// Factors on width and height.
    pub scale: [f64; 2],
}

impl Placed {
    /// With the motion that its table gives it.
    pub fn moved(self, moved: Option<&Moved>) -> Placed {
        let Some(Moved { at_moment, onwards }) = moved else { return self };
        let now = self.now.moved(at_moment);
        Placed { now, motion: onwards.as_ref().map(|onwards| onwards.map(|by| now.moved(by))) }
    }
}

impl Placement {
    /// That of a light at a node; `None` if the node is flattened. Sheared axes are made square, so that the light stays a
    /// rectangle.
    fn of_node(m: &DAffine3) -> Option<Placement> {
        let (x, y, z) = (m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis);
        let direction = (-z).try_normalize()?;
        let right = -(x - direction * x.dot(direction)).try_normalize()?;
        let scale = [x.length(), y.length()];
        (scale[1] > 0.0).then_some(Placement { center: m.translation, direction, right, scale })
    }

    /// That of something that only has a place and a way that it shines.
    pub fn of_axis(center: DVec3, direction: DVec3) -> Placement {
        Placement { center, direction, right: direction.any_orthonormal_vector(), scale: [1.0; 2] }
    }

    /// Where a motion without scales brings it.
    pub fn moved(&self, by: &DAffine3) -> Placement {
        let turned = |v: DVec3| by.transform_vector3(v).normalize_or(v);
        let (direction, right) = (turned(self.direction), turned(self.right));
        Placement { center: by.transform_point3(self.center), direction, right, scale: self.scale }
    }

    /// From a rectangle of width and height 1 around the origin, in the plane of x and y, that shines along z.
    pub fn world_from_unit(&self) -> DAffine3 {
        let [width, height] = self.scale;
        let (u, v) = (self.right * width, self.direction.cross(self.right) * height);
        DAffine3::from_mat3_translation(DMat3::from_cols(u, v, self.direction), self.center)
    }
}

/// An area light that the table places.
pub(super) fn placed(fields: &Fields) -> Option<Placed> {
    let center = fields.require("center", fields.vector("center"));
    let up = fields.vector("up").map_or(DVec3::Y, |u| u.value);
    let center = center?.value;
    let direction = direction(fields, Some(center))?;
    // Lights that shine along `up`, as those of ceilings do, have their width along x.
    let sides = [up.normalize_or_zero(), DVec3::NEG_Z].map(|up| up.cross(direction));
    let right = sides.into_iter().find(|s| s.length() > 1e-6).map(DVec3::normalize);
    let right = right.unwrap_or_else(|| direction.any_orthonormal_vector());
    Some(Placed { now: Placement { center, direction, right, scale: [1.0; 2] }, motion: None })
}

/// A light where the model has an empty node: it shines along the node's -z, as glTF's own lights do. Seen that way, x
/// goes to the right.
pub(super) fn at_node(build: &mut Build, fields: &Fields) -> Option<Placed> {
    let name = fields.string("node")?;
    let empties = &build.loaded.empties;
    let Some(empty) = empties.iter().find(|empty| empty.name == name.value) else {
        let message = format!("the model has no empty node '{}'", name.value);
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
    Some(Placed { now, motion })
}

/// The names of the nodes at which a file places lights.
pub(super) fn nodes_of_lights(root: &Fields) -> Vec<String> {
    let list = root.raw("lights").and_then(|lights| lights.get_ref().as_array());
    let lights = list.into_iter().flat_map(|list| list.iter()).filter_map(|light| light.get_ref().as_table());
    let shapes = lights.flat_map(|light| light.iter()).filter_map(|(_, shape)| shape.get_ref().as_table());
    let nodes = shapes.filter_map(|shape| shape.get("node")?.get_ref().as_str());
    nodes.map(str::to_string).collect()
}

/// The way the light travels: `direction`, or from `position` to `target`.
pub(super) fn direction(fields: &Fields, position: Option<DVec3>) -> Option<DVec3> {
    let target = position.and_then(|p| fields.vector("target").map(|t| (t.value - p, t.span)));
    let direction = fields.vector("direction").map(|d| (d.value, d.span));
    let (vector, span) = match (target, direction) {
        (Some(one), None) | (None, Some(one)) => one,
        (Some(_), Some((_, span))) => {
            fields.problems.push(span, "'target' and 'direction' say the same: leave one out");
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
