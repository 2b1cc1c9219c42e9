//! `[[lights]]`: each has exactly one shape, and optionally a `name` and a `color` (1, 1, 1).
//!
//! | Shape | Value |
//! |---|---|
//! | `area` | `{ center, target or direction, up = [0, 1, 0], size = [width, height], power or radiance }`: a rectangle that shines from its front, which faces the target; height is along `up`, or -z where the light shines along `up`. Beside a model, `node = "NAME"` stands for centre and direction: the light takes the place and scale of an empty node, as Blender exports its area lights |
//! | `point` | `{ position, power or intensity }` |
//! | `spot` | `{ position, target or direction, angle = 45, blend = 0.15, power or intensity }`: a cone of the full angle, which fades over the outer share `blend` of it |
//! | `sun` | `{ direction, irradiance }`: parallel light that travels that way |
//!
//! Power is in watts of the visible spectrum: a rectangle of area A has the radiance P / (pi A), a point the intensity
//! P / (4 pi), and so has a spot of the same power, as in Blender. Radiance is in W/sr/m2, intensity in W/sr,
//! irradiance in W/m2 across the light. Area lights are quads that cameras see; all others have no surface.

use super::build::Build;
use super::fields::{Fields, nearest};
use crate::math::DVec3;
use crate::scene::{Light, LightKind, Material, MaterialId, Quad, SpotFade};
use std::f64::consts::PI;

const SHAPES: [&str; 4] = ["area", "point", "spot", "sun"];

/// Reads all lights.
pub(super) fn read(build: &mut Build, root: &Fields) {
    let Some(list) = root.list("lights") else { return };
    for (i, value) in list.iter().enumerate() {
        let Some(table) = value.get_ref().as_table() else {
            root.problems.push(value.span(), "a light must be a table");
            continue;
        };
        let number = format!("light {}", i + 1);
        let fields = Fields::new(&number, table, value.span(), root.problems);
        let name = fields.string("name").map_or(number, |n| n.value.to_string());
        let color = fields.color("color").map_or([1.0; 3], |c| c.value);
        let given: Vec<&'static str> = SHAPES.into_iter().filter(|s| fields.has(s)).collect();
        match given[..] {
            [shape] => {
                if let Some(shape_fields) = fields.table(shape) {
                    add(build, shape, &shape_fields, name, color);
                    shape_fields.finish();
                }
            }
            _ => {
                let message = format!("{name} needs exactly one of {}", SHAPES.join(", "));
                root.problems.push(value.span(), message);
            }
        }
        fields.finish();
    }
}

fn add(build: &mut Build, shape: &str, fields: &Fields, name: String, color: [f32; 3]) {
    if shape == "area" {
        return add_area(build, fields, name, color);
    }
    let (kind, strength) = match shape {
        "point" => {
            let position = fields.require("position", fields.vector("position"));
            let strength = strength(fields, "intensity", 1.0 / (4.0 * PI));
            (position.map(|p| LightKind::Point { position: p.value }), strength)
        }
        "spot" => (spot(fields), strength(fields, "intensity", 1.0 / (4.0 * PI))),
        _ => {
            let direction = direction(fields, None);
            let strength = fields.require("irradiance", positive(fields, "irradiance"));
            (direction.map(|direction| LightKind::Directional { direction }), strength)
        }
    };
    if let (Some(kind), Some(strength)) = (kind, strength) {
        let intensity = color.map(|c| c * strength as f32);
        build.loaded.scene.lights.push(Light { name, kind, intensity });
    }
}

fn spot(fields: &Fields) -> Option<LightKind> {
    let position = fields.require("position", fields.vector("position"));
    let angle_rad = fields.number_in("angle", 0.1..179.9, 45.0).to_radians();
    let blend = fields.number_in("blend", 0.0..1.0, 0.15);
    let position = position?.value;
    let outer_angle_rad = angle_rad / 2.0;
    // glTF wants the inner angle below the outer one.
    let inner_angle_rad = outer_angle_rad * (1.0 - blend).min(0.9999);
    let direction = direction(fields, Some(position))?;
    Some(LightKind::Spot { position, direction, inner_angle_rad, outer_angle_rad, fade: SpotFade::Smooth })
}

fn add_area(build: &mut Build, fields: &Fields, name: String, color: [f32; 3]) {
    let size = fields.require("size", fields.numbers::<2>("size"));
    let placement = if fields.has("node") { at_node(build, fields) } else { placed(fields) };
    let Some(size) = size else { return };
    if size.value.iter().any(|s| *s <= 0.0) {
        return fields.problems.push(size.span, "'size' of an area light must be above 0");
    }
    let Some((center, direction, right, scale)) = placement else { return };
    let [width, height] = [size.value[0] * scale[0], size.value[1] * scale[1]];
    let Some(strength) = strength(fields, "radiance", 1.0 / (PI * width * height)) else { return };
    let (edge_u, edge_v) = (right * width, direction.cross(right) * height);
    let scene = &mut build.loaded.scene;
    let material = MaterialId(scene.materials.len() as u32);
    scene.materials.push(Material::emitter(&name, color.map(|c| c * strength as f32), false));
    let corner = center - (edge_u + edge_v) / 2.0;
    scene.quads.push(Quad { name, corner, edge_u, edge_v, material });
}

/// Centre, direction, the side along which the width lies, and factors on width and height.
type AreaPlacement = (DVec3, DVec3, DVec3, [f64; 2]);

/// An area light that the table places.
fn placed(fields: &Fields) -> Option<AreaPlacement> {
    let center = fields.require("center", fields.vector("center"));
    let up = fields.vector("up").map_or(DVec3::Y, |u| u.value);
    let center = center?.value;
    let direction = direction(fields, Some(center))?;
    // Lights that shine along `up`, as those of ceilings do, have their width along x.
    let sides = [up.normalize_or_zero(), DVec3::NEG_Z].map(|up| up.cross(direction));
    let right = sides.into_iter().find(|s| s.length() > 1e-6).map(DVec3::normalize);
    Some((center, direction, right.unwrap_or_else(|| direction.any_orthonormal_vector()), [1.0; 2]))
}

/// An area light where the model has an empty node: it shines along the node's -z, as glTF's own lights do. Seen that
/// way, x goes to the right.
fn at_node(build: &Build, fields: &Fields) -> Option<AreaPlacement> {
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
        (Some(d), Some(r)) if y.length() > 0.0 => Some((m.translation, d, -r, [x.length(), y.length()])),
        _ => {
            fields.problems.push(name.span, format!("the node '{}' is flattened to nothing", name.value));
            None
        }
    }
}

/// The way the light travels: `direction`, or from `position` to `target`.
fn direction(fields: &Fields, position: Option<DVec3>) -> Option<DVec3> {
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

/// `power` times a factor, or the quantity itself.
fn strength(fields: &Fields, quantity: &'static str, per_watt: f64) -> Option<f64> {
    match (positive(fields, "power"), positive(fields, quantity)) {
        (Some(power), None) => Some(power * per_watt),
        (None, Some(own)) => Some(own),
        _ => {
            let message = format!("the light needs either 'power' or '{quantity}'");
            fields.problems.push(fields.span(), message);
            None
        }
    }
}

/// A number from 0 up.
fn positive(fields: &Fields, key: &'static str) -> Option<f64> {
    fields.has(key).then(|| fields.number_in(key, 0.0..f64::from(f32::MAX), 0.0))
}
