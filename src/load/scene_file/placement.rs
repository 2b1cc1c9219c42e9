//! Where lights of scene files stand and which way they shine.

use super::build::Build;
use super::fields::{Fields, nearest};
use crate::math::DVec3;

/// The place of a light.
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

/// An area light that the table places.
pub(super) fn placed(fields: &Fields) -> Option<Placement> {
    let center = fields.require("center", fields.vector("center"));
    let up = fields.vector("up").map_or(DVec3::Y, |u| u.value);
    let center = center?.value;
    let direction = direction(fields, Some(center))?;
    // Lights that shine along `up`, as those of ceilings do, have their width along x.
    let sides = [up.normalize_or_zero(), DVec3::NEG_Z].map(|up| up.cross(direction));
    let right = sides.into_iter().find(|s| s.length() > 1e-6).map(DVec3::normalize);
    let right = right.unwrap_or_else(|| direction.any_orthonormal_vector());
    Some(Placement { center, direction, right, scale: [1.0; 2] })
}

/// A light where the model has an empty node: it shines along the node's -z, as glTF's own lights do. Seen that way, x
/// goes to the right.
pub(super) fn at_node(build: &Build, fields: &Fields) -> Option<Placement> {
    let name = fields.string("node")?;
    let empties = &build.loaded.empties;
    let Some((_, m)) = empties.iter().find(|(n, _)| n == name.value) else {
        let message = format!("the model has no empty node '{}'", name.value);
        let help = match nearest(name.value, empties.iter().map(|e| e.0.as_str())) {
            Some(near) => format!("did you mean '{near}'?"),
            None => format!("it has {} nodes that hold nothing", empties.len()),
        };
        fields.problems.push_help(name.span, message, help);
        return None;
    };
    let (x, y, z) = (m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis);
    let direction = (-z).try_normalize();
    // Sheared axes are made square, so that the light stays a rectangle.
    let right = direction.and_then(|d| (x - d * x.dot(d)).try_normalize());
    match (direction, right) {
        (Some(direction), Some(r)) if y.length() > 0.0 => {
            let scale = [x.length(), y.length()];
            Some(Placement { center: m.translation, direction, right: -r, scale })
        }
        _ => {
            fields.problems.push(name.span, format!("the node '{}' is flattened to nothing", name.value));
            None
        }
    }
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
