//! `[[lights]]`: each has exactly one shape, and optionally a `name`, a `color` (1, 1, 1), a `group`, whose
//! light `--light-groups` keeps apart, a `motion` (see there), `visible_to_camera` and `obstacle` (both true), and
//! `visible_to`, the kinds of rays that it lights and that see it, as for objects (all), `light_link` and `shadow_link` (below).
//!
//! | Shape | Value |
//! |---|---|
//! | `area` | `{ center, target or direction, up = [0, 1, 0], size = [width, height], shape = "rectangle", spread = 180, image, power or radiance }`: a rectangle, or an `"ellipse"` of that size, that shines from its front, which faces the target; height is along `up`, or -z where the light shines along `up`. `spread` is the full angle in degrees of its beam, as slats in front of it would leave; the power stays. `image` is a file that covers the light, upright as seen from in front of it, and multiplies its radiance (power is that of a white one) |
//! | `point` | `{ position, radius = 0, soft_falloff = false, power or intensity }`: a sphere, if it has a radius; with `ies`, see below |
//! | `spot` | `{ position, target or direction, angle = 45, blend = 0.15, radius = 0, soft_falloff = false, power or intensity }`: a cone of the full angle, which fades over the outer share `blend` of it; with `ies`, see below |
//! | `sun` | `{ direction, angle = 0, irradiance }`: parallel light that travels that way, or that of a disk of a diameter of `angle` degrees, infinitely far away |
//!
//! With `soft_falloff` a lamp with a radius r is a disk that faces whatever it lights, so that what is near it, or in it, is lit more
//! softly: at a distance d it gives d^2 / (d^2 + r^2) of what a sphere gives. Blender's points and spots are so, unless that is switched
//! off. Such lamps stop no light.
//!
//! `ies = "lamp.ies"` gives points and spots the profile of a luminaire (IES LM-63, photometry of type C; the path is relative to
//! this file); with a radius each place of the sphere shines so, and shadows are soft. It shines along `direction` or to `target`, points without either down, and `turn`
//! turns it about that way by so many degrees; a spot's cone cuts it. Horizontal angles turn counter-clockwise as seen from behind
//! the lamp, with `clockwise = true` the other way, as Cycles has them. Without `power` and `intensity` it is as bright as the file says
//! (candela times its factors, by 683 lm/W), times `strength`; `intensity` is that of its brightest direction, `power` that of all
//! directions together, before a cone cuts it.
//!
//! Beside a model, `node = "NAME"` stands for position, centre and direction: the light takes the place of an empty node of
//! the model, and of area lights the scale, as Blender exports its lights; it shines along the node's -z, and moves along with
//! the node while the shutter is open.
//!
//! Power is in watts of the visible spectrum: an area light of area A has the radiance P / (pi A), a point the intensity
//! P / (4 pi), and so has a spot of the same power, as in Blender. Radiance is in W/sr/m2, intensity in W/sr,
//! irradiance in W/m2 across the light. Area lights, and points and spots with a radius, are surfaces. With
//! `visible_to_camera = false` the camera looks through them, and with `obstacle = false` they stop no light: rays pass and
//! take theirs along once, and spheres light what is within them. Blender's lamps are so. All other lights have no surface; mirrors show suns with an angle.

use super::build::Build;
use super::fields::Fields;
use super::light_shapes::{self, Surface, ball_kind};
use super::light_traits::{LightTraits, group, positive, strength};
use super::placement::{Placed, Placement, at_node, direction};
use super::visibility::visible_to;
use super::{linking, motion, profiled};
use crate::math::{DAffine3, DQuat, DVec3};
use crate::scene::{Beam, Lamp, Light, LightKind, LightProfile, Moving, RayKinds, SpotFade};
use std::f64::consts::PI;
use std::sync::Arc;

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
        let group = group(&fields, "group");
        let lamp = Lamp {
            visible_to: visible_to(&fields, RayKinds::ALL),
            is_obstacle: fields.flag("obstacle", true),
            beam: Beam::Even,
        };
        let links = linking::read(build, &fields).unwrap_or_default();
        let moved = motion::rigid(build, &fields, &name);
        let given: Vec<&'static str> = SHAPES.into_iter().filter(|s| fields.has(s)).collect();
        match given[..] {
            [shape] => {
                if let Some(shape_fields) = fields.table(shape) {
                    if moved.is_some() && shape_fields.has("node") {
                        let message = "a light at a node moves along with it: leave 'motion' out";
                        fields.problems.push(shape_fields.span(), message);
                    }
                    add(build, shape, &shape_fields, LightTraits { name, color, lamp, group, links, moved });
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

fn add(build: &mut Build, shape: &str, fields: &Fields, traits: LightTraits) {
    match shape {
        "area" => light_shapes::add_area(build, fields, traits),
        "sun" => add_sun(build, fields, traits),
        _ => add_local(build, shape == "spot", fields, traits),
    }
}

/// Adds a point or a spot.
fn add_local(build: &mut Build, is_spot: bool, fields: &Fields, traits: LightTraits) {
    let node = fields.has("node").then(|| at_node(build, fields));
    let position = match &node {
        Some(node) => node.as_ref().map(|n| n.now.center),
        None => fields.require("position", fields.vector("position")).map(|p| p.value),
    };
    let cone = is_spot.then(|| {
        let angle_rad = fields.number_in("angle", 0.1..180.0, 45.0).to_radians();
        let blend = fields.number_in("blend", 0.0..1.0, 0.15);
        let outer_angle_rad = angle_rad / 2.0;
        // An edge of no width has no slope.
        let inner_angle_rad = outer_angle_rad * (1.0 - blend).min(0.9999);
        let direction = match &node {
            Some(node) => node.as_ref().map(|n| n.now.direction),
            None => position.and_then(|p| direction(fields, Some(p))),
        };
        direction.map(|direction| (direction, inner_angle_rad, outer_angle_rad, SpotFade::Smooth))
    });
    if fields.has("ies") {
        let node = node.as_ref().and_then(Option::as_ref);
        return add_profiled(build, fields, traits, (position, node), cone);
    }
    let radius = fields.number_in("radius", 0.0..1e9, 0.0);
    let given = position.map(|position| {
        let axis = cone.flatten().map_or(DVec3::Y, |(axis, ..)| axis);
        Placed { now: Placement::of_axis(position, axis), motion: node.flatten().and_then(|n| n.motion) }
    });
    let given = given.map(|given| given.moved(traits.moved.as_ref()));
    let intensity = strength(fields, "intensity", 1.0 / (4.0 * PI));
    let (Some(Placed { now, motion }), Some(intensity)) = (given, intensity) else { return };
    let (position, direction) = (now.center, now.direction);
    let (kind, beam) = match cone {
        None => (LightKind::Point { position }, Beam::Even),
        Some(None) => return,
        Some(Some((_, inner_angle_rad, outer_angle_rad, fade))) => (
            LightKind::Spot { position, direction, inner_angle_rad, outer_angle_rad, fade },
            Beam::Cone { direction, inner_angle_rad, outer_angle_rad, fade },
        ),
    };
    let is_soft = fields.flag("soft_falloff", false);
    if radius > 0.0 {
        // A ball of a radiance has the intensity of the disk that it looks like.
        let radiance = intensity / (PI * radius * radius);
        let motion =
            motion.map(|moving| light_shapes::ball_motion(build, &traits.name, position, &beam, &moving));
        return light_shapes::add(
            build,
            (Surface::Ball { position, radius, kind: ball_kind(is_soft, traits.lamp.is_obstacle) }, motion),
            traits,
            beam,
            (radiance, None),
        );
    }
    let motion = motion.map(|moving| moving.map(|then| at(kind, then)));
    push(build, traits, (kind, motion), intensity, None);
}

/// Adds a point or a spot with a profile.
fn add_profiled(
    build: &mut Build,
    fields: &Fields,
    traits: LightTraits,
    (position, node): (Option<DVec3>, Option<&Placed>),
    cone: Option<Option<(DVec3, f64, f64, SpotFade)>>,
) {
    let profile = profiled::read(build, fields);
    let axis = cone.flatten().map(|(axis, ..)| axis);
    if cone.is_some() && axis.is_none() {
        return;
    }
    let Some(center) = position else { return };
    let angles = cone.flatten().map(|(_, inner, outer, _)| [inner, outer]);
    let local = profiled::local(fields, angles);
    let rotation = match node {
        Some(node) => Some(profiled::rotation(&node.now)),
        None => profiled::aimed(fields, center, axis),
    };
    let radius = fields.number_in("radius", 0.0..1e9, 0.0);
    let is_soft = fields.flag("soft_falloff", false);
    let (Some(rotation), Some((profile, intensity))) = (rotation, profile) else { return };
    let mut kind = turned(local, center, rotation);
    let motion = node.and_then(|node| node.motion.as_ref());
    let mut motion = motion.map(|moving| moving.map(|then| at(local, then)));
    if let Some(moved) = &traits.moved {
        kind = carried(kind, &moved.at_moment);
        motion = moved.onwards.as_ref().map(|onwards| onwards.map(|by| carried(kind, by)));
    }
    match kind {
        LightKind::Profiled { position, rotation, cone } if radius > 0.0 => {
            let motion = motion.map(|moving| profiled::ball_motion(build, &traits.name, &kind, &moving));
            let beam = Beam::Profile { profile: build.loaded.scene.add_profile(profile), rotation, cone };
            let radiance = intensity / (PI * radius * radius);
            let kind = ball_kind(is_soft, traits.lamp.is_obstacle);
            let surface = Surface::Ball { position, radius, kind };
            light_shapes::add(build, (surface, motion), traits, beam, (radiance, None));
        }
        _ => push(build, traits, (kind, motion), intensity, Some(profile)),
    }
}

fn add_sun(build: &mut Build, fields: &Fields, traits: LightTraits) {
    let node = fields.has("node").then(|| at_node(build, fields));
    let direction: Option<DVec3> = match &node {
        Some(node) => node.as_ref().map(|n| n.now.direction),
        None => direction(fields, None),
    };
    let angle_rad = fields.number_in("angle", 0.0..180.0, 0.0).to_radians();
    let irradiance = fields.require("irradiance", positive(fields, "irradiance"));
    let motion = node.flatten().and_then(|node| node.motion);
    let given = direction.map(|way| Placed { now: Placement::of_axis(DVec3::ZERO, way), motion });
    let given = given.map(|given| given.moved(traits.moved.as_ref()));
    if let (Some(Placed { now, motion }), Some(irradiance)) = (given, irradiance) {
        let direction = now.direction;
        // Smaller ones are points.
        let kind = match angle_rad > 1e-5 {
            true => LightKind::Sun { direction, angle_rad },
            false => LightKind::Directional { direction },
        };
        let motion = motion.map(|moving| moving.map(|then| at(kind, then)));
        push(build, traits, (kind, motion), irradiance, None);
    }
}

/// A kind of light at another place.
fn at(mut kind: LightKind, place: &Placement) -> LightKind {
    match &mut kind {
        LightKind::Point { position } => *position = place.center,
        LightKind::Spot { position, direction, .. } => {
            (*position, *direction) = (place.center, place.direction);
        }
        LightKind::Profiled { .. } => return turned(kind, place.center, profiled::rotation(place)),
        LightKind::Directional { direction } | LightKind::Sun { direction, .. } => {
            *direction = place.direction;
        }
    }
    kind
}

/// A light with a profile that a motion without scales moves.
fn carried(mut kind: LightKind, by: &DAffine3) -> LightKind {
    if let LightKind::Profiled { position, rotation, .. } = &mut kind {
        *position = by.transform_point3(*position);
        *rotation = (DQuat::from_mat3(&by.matrix3) * *rotation).normalize();
    }
    kind
}

/// A light with a profile that shines along -z, turned and moved.
fn turned(mut kind: LightKind, center: DVec3, by: DQuat) -> LightKind {
    if let LightKind::Profiled { position, rotation, .. } = &mut kind {
        (*position, *rotation) = (center, (by * *rotation).normalize());
    }
    kind
}

fn push(
    build: &mut Build,
    traits: LightTraits,
    (kind, motion): (LightKind, Option<Moving<LightKind>>),
    strength: f64,
    profile: Option<Arc<LightProfile>>,
) {
    let intensity = traits.color.map(|c| c * strength as f32);
    let LightTraits { name, group, lamp, links, .. } = traits;
    let visible_to = lamp.visible_to;
    build.loaded.scene.lights.push(Light {
        name,
        kind,
        intensity,
        profile,
        group,
        visible_to,
        links,
        motion,
    });
}
