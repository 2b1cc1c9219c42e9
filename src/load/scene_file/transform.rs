//! `transform = [...]`: steps applied in the order listed, each to the result of the one before, composed in f64.
//!
//! `{ translate = [x, y, z] }`, `{ rotate = { axis = [x, y, z], angle = degrees } }` (counter-clockwise seen from the
//! axis's tip), `{ euler = [x, y, z] }` (degrees; about the world's x, then y, then z axis),
//! `{ quaternion = [x, y, z, w] }`, `{ scale = s }` or `{ scale = [x, y, z] }`, and `{ matrix = [16 numbers] }` row by
//! row for column vectors: the translation is in places 4, 8 and 12, and the last row is 0 0 0 1.

use super::fields::{Fields, number};
use crate::math::{DAffine3, DMat3, DQuat, DVec3};

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
    if !total.is_finite() || determinant == 0.0 || !determinant.is_finite() {
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
