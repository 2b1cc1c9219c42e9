//! `[[lights]]`: each has exactly one shape, and optionally a `name`, a `color` (1, 1, 1), a light `group` (rendered separately by
//! `--light-groups`), a `motion` (see there), `visible_to_camera` and `obstacle` (both true),
//! `visible_to`, the kinds of rays that it lights and that hit it, as for objects (all), `light_link` and `shadow_link` (below).
//!
//! | Shape | Value |
//! |---|---|
//! | `area` | `{ center, target or direction, up = [0, 1, 0], size = [width, height], shape = "rectangle", spread = 180, image, power or radiance }`: a rectangle, or an `"ellipse"` of that size, that emits from its front, towards the target; height is along `up`, or -z if the light emits along `up`. `spread` is the full beam angle in degrees, as of a grid in front of it, at the same power. `image` is a texture over the light, upright as seen from its front, that multiplies its radiance (`power` is that of a white image) |
//! | `point` | `{ position, radius = 0, soft_falloff = false, power or intensity }`: a sphere, if it has a radius; with `ies`, see below |
//! | `spot` | `{ position, target or direction, angle = 45, blend = 0.15, radius = 0, soft_falloff = false, power or intensity }`: a cone of the full angle, which fades over the outer fraction `blend` of it; with `ies`, see below |
//! | `sun` | `{ direction, angle = 0, irradiance }`: light that travels in `direction`, from infinity: parallel, or from a disk of `angle` degrees diameter |
//!
//! With `soft_falloff` a light of radius r is a disk that faces each shading point, with a softer falloff near and inside it:
//! at a distance d its irradiance is d^2 / (d^2 + r^2) of a sphere's. This is the default of Blender's point and spot lights. Such
//! lights don't occlude rays.
//!
//! `ies = "lamp.ies"` gives points and spots the profile of a luminaire (IES LM-63, type C photometry; the path is relative to
//! this file); with a radius each point of the sphere emits with that profile, and shadows are soft. The axis is along `direction` or towards `target`, by default down for points; `turn`
//! rotates the profile about the axis, degrees; a spot's cone masks it. Horizontal angles are counter-clockwise as seen from behind
//! the light, with `clockwise = true` clockwise, as in Cycles. By default the intensity is that of the file
//! (candela times its factors, at 683 lm/W) times `strength`; `intensity` sets the maximum over all directions, `power` the total
//! power without the cone.
//!
//! `transform = [...]` of an entry (see `transform`) replaces position, centre, direction, target and up: its steps are applied to a
//! light at the origin that emits along -z, with its height along y. Only area lights are scaled by it.
//!
//! In a sidecar, `node = "NAME"` replaces position, centre and direction: the light is placed at an empty node of
//! the model, and area lights are scaled by it, as Blender exports its lights; it emits along the node's -z, and follows the
//! node's motion.
//!
//! An entry with a `name` and without a shape changes the lights of that name, of the model or of previous entries: `color`, and by light type
//! `radiance` (area lights, and others with a radius), `intensity` (points and spots) or `irradiance` (suns).
//!
//! Power is in watts of the visible spectrum: an area light of area A has the radiance P / (pi A), a point the intensity
//! P / (4 pi), and a spot of the same power, too, as in Blender. Radiance is in W/sr/m2, intensity in W/sr,
//! irradiance in W/m2, perpendicular to the light. Area lights, and points and spots with a radius, are surfaces. With
//! `visible_to_camera = false` camera rays pass through them. With `obstacle = false`, as in Blender, all rays pass through them and
//! add their radiance once, and spheres also emit inwards. All other lights have no surface, but suns with an angle are visible in mirrors.

use super::builder::SceneFileBuilder;
use super::fields::{Fields, suggestion};
use super::textures::read_image;
use super::traits::{LightTraits, group, non_negative, strength, visible_to};
use super::transform::{
    EvaluatedMotion, MovingPlacement, Placement, direction, placement_at_node, placement_by_target,
};
use super::{fields, traits, transform};
use crate::error::Warning;
use crate::load::image::Use;
use crate::load::{files, ies};
use crate::math::{DAffine3, DMat3, DQuat, DVec3, Vec2};
use crate::scene::{
    Beam, EmitterTraits, Instance, Interpolation, Keyframes, Light, LightKind, LightProfile, Mapping,
    Material, MaterialId, Mesh, MeshPart, ObjectTraits, Quad, RayKinds, Scene, Shape, ShapeKind, SpotFalloff,
    Texture, TextureId, TextureTransform, Wrap,
};
use crate::shape::mesh_of;
use std::f64::consts::{FRAC_PI_4, PI};
use std::sync::Arc;

const SHAPES: [&str; 4] = ["area", "point", "spot", "sun"];

/// Reads all lights.
pub(super) fn read(build: &mut SceneFileBuilder, root: &Fields) {
    let Some(list) = root.list("lights") else { return };
    for (i, value) in list.iter().enumerate() {
        let number = format!("light {}", i + 1);
        let Some(fields) = Fields::of_value(&number, value, root.problems) else { continue };
        if fields.has("name") && !SHAPES.iter().any(|shape| fields.is_given(shape)) {
            change_lights(build, &fields);
            continue;
        }
        let name = fields.string("name").map_or(number, |n| n.value.to_string());
        let color = fields.color("color").map_or([1.0; 3], |c| c.value);
        let group = group(&fields, "group");
        let emitter = EmitterTraits {
            visible_to: visible_to(&fields, RayKinds::ALL),
            is_obstacle: fields.flag("obstacle", true),
            beam: Beam::Lambertian,
        };
        let links = traits::read_links(build, &fields).unwrap_or_default();
        let (placement, motion) = match fields.has("transform") {
            true => {
                let motion = transform::read_motion(build, &fields, &name);
                (Some(transform::placement_by_transform(build, &fields, motion.as_ref())), None)
            }
            false => (None, transform::rigid_motion(build, &fields, &name)),
        };
        let shapes: Vec<&'static str> = SHAPES.into_iter().filter(|s| fields.has(s)).collect();
        match shapes[..] {
            [shape] => {
                if let Some(shape_fields) = fields.table(shape) {
                    check_node(&fields, &shape_fields);
                    let traits = LightTraits { name, color, emitter, group, links, placement, motion };
                    add(build, shape, &shape_fields, traits);
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

/// Reports the keys that contradict `node`.
fn check_node(fields: &Fields, shape: &Fields) {
    if !shape.has("node") {
        return;
    }
    if fields.has("transform") {
        fields.problems.push(shape.span(), "'transform' and 'node' exclude each other: keep one");
    } else if fields.has("motion") {
        fields.problems.push(shape.span(), "a light at a node follows its motion: leave 'motion' out");
    }
}

/// Changes existing lights of a name.
fn change_lights(build: &mut SceneFileBuilder, fields: &Fields) {
    let color = fields.color("color").map(|c| c.value);
    let strengths =
        ["radiance", "intensity", "irradiance"].map(|key| non_negative(fields, key).map(|v| v as f32));
    fields.mark_known(&SHAPES);
    if let Some(name) = fields.string("name")
        && !change_all(&mut build.loaded.scene, name.value, strengths, color)
    {
        let scene = &build.loaded.scene;
        let surfaces = scene.materials.iter().filter(|material| material.is_light).map(|m| m.name.as_str());
        let names = scene.lights.iter().map(|light| light.name.as_str()).chain(surfaces);
        let message = format!("there is no light '{}' to change", name.value);
        let default = format!("a new light needs one of {}", SHAPES.join(", "));
        let help = suggestion(name.value, names, default);
        fields.problems.push_help(name.span, message, help);
    }
    fields.finish();
}

/// Changes all lights of a name; false if there are none.
fn change_all(
    scene: &mut Scene,
    name: &str,
    [radiance, intensity, irradiance]: [Option<f32>; 3],
    color: Option<[f32; 3]>,
) -> bool {
    let mut has_any = false;
    for light in scene.lights.iter_mut().filter(|light| light.name == name) {
        let strength = if light.kind.position().is_some() { intensity } else { irradiance };
        light.intensity = changed_intensity(light.intensity, strength, color);
        has_any = true;
    }
    for material in scene.materials.iter_mut().filter(|m| m.is_light && m.name == name) {
        if let Some(emission) = &mut material.emission {
            emission.radiance.factor = changed_intensity(emission.radiance.factor, radiance, color);
            has_any = true;
        }
    }
    has_any
}

/// Replaces the largest component of a light's intensity, its hue, or both.
fn changed_intensity(intensity: [f32; 3], strength: Option<f32>, color: Option<[f32; 3]>) -> [f32; 3] {
    let largest = intensity.into_iter().fold(0.0, f32::max);
    let hue = color.unwrap_or(if largest > 0.0 { intensity.map(|v| v / largest) } else { [1.0; 3] });
    hue.map(|v| v * strength.unwrap_or(largest))
}

fn add(build: &mut SceneFileBuilder, shape: &str, fields: &Fields, traits: LightTraits) {
    match shape {
        "area" => add_area(build, fields, traits),
        "sun" => add_sun(build, fields, traits),
        _ => add_point_or_spot(build, shape == "spot", fields, traits),
    }
}

/// The placement of a light by `node` or `transform`; `None` without these keys, `Some(None)` after a problem.
fn read_placement(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    traits: &mut LightTraits,
) -> Option<Option<MovingPlacement>> {
    if fields.has("node") { Some(placement_at_node(build, fields)) } else { traits.placement.take() }
}

/// Adds a point or a spot.
fn add_point_or_spot(build: &mut SceneFileBuilder, is_spot: bool, fields: &Fields, mut traits: LightTraits) {
    let node = read_placement(build, fields, &mut traits);
    let position = match &node {
        Some(node) => node.as_ref().map(|n| n.now.center),
        None => fields.require("position", fields.vector("position")).map(|p| p.value),
    };
    let cone = is_spot.then(|| {
        let angle_rad = fields.number_in("angle", 0.1..180.0, 45.0).to_radians();
        let blend = fields.number_in("blend", 0.0..1.0, 0.15);
        let outer_angle_rad = angle_rad / 2.0;
        // Smoothstep needs a range above 0.
        let inner_angle_rad = outer_angle_rad * (1.0 - blend).min(0.9999);
        let direction = match &node {
            Some(node) => node.as_ref().map(|n| n.now.direction),
            None => position.and_then(|p| direction(fields, Some(p))),
        };
        direction.map(|direction| (direction, inner_angle_rad, outer_angle_rad, SpotFalloff::Smooth))
    });
    if fields.has("ies") {
        let node = node.as_ref().and_then(Option::as_ref);
        return add_profiled(build, fields, traits, (position, node), cone);
    }
    let radius = fields.number_in("radius", 0.0..1e9, 0.0);
    let placement = position.map(|position| {
        let axis = cone.flatten().map_or(DVec3::Y, |(axis, ..)| axis);
        MovingPlacement {
            now: Placement::along_axis(position, axis),
            motion: node.flatten().and_then(|n| n.motion),
        }
    });
    let placement = placement.map(|placement| placement.with_motion(traits.motion.as_ref()));
    let intensity = strength(fields, "intensity", 1.0 / (4.0 * PI));
    let (Some(MovingPlacement { now, motion }), Some(intensity)) = (placement, intensity) else { return };
    let (position, direction) = (now.center, now.direction);
    let (kind, beam) = match cone {
        None => (LightKind::Point { position }, Beam::Lambertian),
        Some(None) => return,
        Some(Some((_, inner_angle_rad, outer_angle_rad, falloff))) => (
            LightKind::Spot { position, direction, inner_angle_rad, outer_angle_rad, falloff },
            Beam::Cone { direction, inner_angle_rad, outer_angle_rad, falloff },
        ),
    };
    let is_soft = fields.flag("soft_falloff", false);
    if radius > 0.0 {
        // A sphere has the intensity of its projected disk: radiance times pi r^2.
        let radiance = intensity / (PI * radius * radius);
        let motion = motion.map(|keys| shape_motion(build, &traits.name, position, &beam, &keys));
        return add_surface(
            build,
            (
                Surface::Shape { position, radius, kind: shape_kind(is_soft, traits.emitter.is_obstacle) },
                motion,
            ),
            traits,
            beam,
            (radiance, None),
        );
    }
    let motion = motion.map(|keys| keys.map(|placement| placed_at(kind, placement)));
    push(build, traits, (kind, motion), intensity, None);
}

/// Adds a point or a spot with a profile.
fn add_profiled(
    build: &mut SceneFileBuilder,
    fields: &Fields,
    traits: LightTraits,
    (position, node): (Option<DVec3>, Option<&MovingPlacement>),
    cone: Option<Option<(DVec3, f64, f64, SpotFalloff)>>,
) {
    let profile = read_profile(build, fields);
    let axis = cone.flatten().map(|(axis, ..)| axis);
    if cone.is_some() && axis.is_none() {
        return;
    }
    let Some(center) = position else { return };
    let angles = cone.flatten().map(|(_, inner, outer, _)| [inner, outer]);
    let at_origin = profiled_at_origin(fields, angles);
    let rotation = match node {
        Some(node) => Some(placement_rotation(&node.now)),
        None => rotation_to_axis(fields, center, axis),
    };
    let radius = fields.number_in("radius", 0.0..1e9, 0.0);
    let is_soft = fields.flag("soft_falloff", false);
    let (Some(rotation), Some((profile, intensity))) = (rotation, profile) else { return };
    let mut kind = rotated(at_origin, center, rotation);
    let motion = node.and_then(|node| node.motion.as_ref());
    let mut motion = motion.map(|keys| keys.map(|placement| placed_at(at_origin, placement)));
    if let Some(EvaluatedMotion { at_time, relative_keys }) = &traits.motion {
        kind = transformed(kind, at_time);
        motion = relative_keys.as_ref().map(|keys| keys.map(|key| transformed(kind, key)));
    }
    match kind {
        LightKind::Profiled { position, rotation, cone } if radius > 0.0 => {
            let motion = motion.map(|keys| profiled_shape_motion(build, &traits.name, &kind, &keys));
            let beam = Beam::Profile { profile: build.loaded.scene.add_profile(profile), rotation, cone };
            let radiance = intensity / (PI * radius * radius);
            let kind = shape_kind(is_soft, traits.emitter.is_obstacle);
            let surface = Surface::Shape { position, radius, kind };
            add_surface(build, (surface, motion), traits, beam, (radiance, None));
        }
        _ => push(build, traits, (kind, motion), intensity, Some(profile)),
    }
}

fn add_sun(build: &mut SceneFileBuilder, fields: &Fields, mut traits: LightTraits) {
    let node = read_placement(build, fields, &mut traits);
    let direction: Option<DVec3> = match &node {
        Some(node) => node.as_ref().map(|n| n.now.direction),
        None => direction(fields, None),
    };
    let angle_rad = fields.number_in("angle", 0.0..180.0, 0.0).to_radians();
    let irradiance = fields.require("irradiance", non_negative(fields, "irradiance"));
    let motion = node.flatten().and_then(|node| node.motion);
    let placement =
        direction.map(|axis| MovingPlacement { now: Placement::along_axis(DVec3::ZERO, axis), motion });
    let placement = placement.map(|placement| placement.with_motion(traits.motion.as_ref()));
    if let (Some(MovingPlacement { now, motion }), Some(irradiance)) = (placement, irradiance) {
        let direction = now.direction;
        // Smaller suns are delta lights.
        let kind = match angle_rad > 1e-5 {
            true => LightKind::Sun { direction, angle_rad },
            false => LightKind::Directional { direction },
        };
        let motion = motion.map(|keys| keys.map(|placement| placed_at(kind, placement)));
        push(build, traits, (kind, motion), irradiance, None);
    }
}

/// A light at another placement.
fn placed_at(mut kind: LightKind, placement: &Placement) -> LightKind {
    match &mut kind {
        LightKind::Point { position } => *position = placement.center,
        LightKind::Spot { position, direction, .. } => {
            (*position, *direction) = (placement.center, placement.direction);
        }
        LightKind::Profiled { .. } => return rotated(kind, placement.center, placement_rotation(placement)),
        LightKind::Directional { direction } | LightKind::Sun { direction, .. } => {
            *direction = placement.direction;
        }
    }
    kind
}

/// A profiled light after a rigid motion.
fn transformed(mut kind: LightKind, motion: &DAffine3) -> LightKind {
    if let LightKind::Profiled { position, rotation, .. } = &mut kind {
        *position = motion.transform_point3(*position);
        *rotation = (DQuat::from_mat3(&motion.matrix3) * *rotation).normalize();
    }
    kind
}

/// A profiled light rotated from its axis -z, at `center`.
fn rotated(mut kind: LightKind, center: DVec3, by: DQuat) -> LightKind {
    if let LightKind::Profiled { position, rotation, .. } = &mut kind {
        (*position, *rotation) = (center, (by * *rotation).normalize());
    }
    kind
}

fn push(
    build: &mut SceneFileBuilder,
    traits: LightTraits,
    (kind, motion): (LightKind, Option<Keyframes<LightKind>>),
    strength: f64,
    profile: Option<Arc<LightProfile>>,
) {
    let intensity = traits.color.map(|c| c * strength as f32);
    let LightTraits { name, group, emitter, links, .. } = traits;
    let visible_to = emitter.visible_to;
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

/// Maximum spread of a beam, degrees; wider spreads, and the default, are diffuse emission.
const MAX_BEAM_DEGREES: f64 = 179.9;

/// The surface of a light.
enum Surface {
    /// Emits along edge_u x edge_v.
    Rectangle { corner: DVec3, edge_u: DVec3, edge_v: DVec3 },
    /// Ellipse with semi-axes axis_u and axis_v that emits along axis_u x axis_v.
    Ellipse { center: DVec3, axis_u: DVec3, axis_v: DVec3 },
    /// A sphere, a shell or a disk that faces the receiver.
    Shape { position: DVec3, radius: f64, kind: ShapeKind },
}

/// The shape of a light with a radius: with a soft falloff a disk that faces the receiver, else a sphere, or, if rays pass
/// through it, a shell, which also emits inwards.
fn shape_kind(is_soft: bool, is_obstacle: bool) -> ShapeKind {
    match is_obstacle {
        _ if is_soft => ShapeKind::FacingDisk,
        true => ShapeKind::Sphere,
        false => ShapeKind::Shell,
    }
}

fn add_area(build: &mut SceneFileBuilder, fields: &Fields, mut traits: LightTraits) {
    fields.mark_known(&["power", "radiance"]);
    let size = fields.require("size", fields.numbers::<2>("size"));
    let is_ellipse = fields.choice("shape", &[("rectangle", false), ("ellipse", true)]).unwrap_or(false);
    let spread = fields.number_in("spread", 0.1..180.0, 180.0);
    let placement = read_placement(build, fields, &mut traits).unwrap_or_else(|| placement_by_target(fields));
    let Some(size) = size else { return };
    if size.value.iter().any(|s| *s <= 0.0) {
        return fields.problems.push(size.span, "'size' of an area light must be above 0");
    }
    let placement = placement.map(|placement| placement.with_motion(traits.motion.as_ref()));
    let Some(MovingPlacement { now, motion }) = placement else { return };
    let Placement { center, direction, right, scale } = now;
    let [width, height] = [size.value[0] * scale[0], size.value[1] * scale[1]];
    let area = width * height * if is_ellipse { FRAC_PI_4 } else { 1.0 };
    let Some(radiance) = strength(fields, "radiance", 1.0 / (PI * area)) else { return };
    let (edge_u, edge_v) = (right * width, direction.cross(right) * height);
    let surface = match is_ellipse {
        true => Surface::Ellipse { center, axis_u: edge_u / 2.0, axis_v: edge_v / 2.0 },
        false => Surface::Rectangle { corner: center - (edge_u + edge_v) / 2.0, edge_u, edge_v },
    };
    let beam = match spread < MAX_BEAM_DEGREES {
        true => Beam::Grid { half_angle_rad: spread.to_radians() / 2.0 },
        false => Beam::Lambertian,
    };
    let texture = fields.string("image").and_then(|image| image_texture(build, image, is_ellipse));
    let unit_from_world = now.world_from_unit().inverse();
    let motion = motion.map(|keys| keys.map(|placement| placement.world_from_unit() * unit_from_world));
    add_surface(build, (surface, motion), traits, beam, (radiance, texture));
}

/// The image of an area light as a texture, upright as seen from its front: v of rectangles runs upwards and is flipped.
fn image_texture(
    build: &mut SceneFileBuilder,
    image: fields::Located<&str>,
    is_ellipse: bool,
) -> Option<TextureId> {
    let image = read_image(build, image.value, image.span, Use::Color)?;
    let transform = match is_ellipse {
        true => TextureTransform::default(),
        false => TextureTransform { offset: Vec2::Y, scale: Vec2::new(1.0, -1.0), ..Default::default() },
    };
    Some(build.loaded.scene.add_texture(Texture::Image {
        image,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        interpolation: Interpolation::Bilinear,
        mapping: Mapping::Uv { set: 0, transform },
    }))
}

/// The motion of a light with a radius, relative to the frame's time. Rotating spot cones aren't supported and cause a
/// warning.
fn shape_motion(
    build: &mut SceneFileBuilder,
    name: &str,
    position: DVec3,
    beam: &Beam,
    keys: &Keyframes<Placement>,
) -> Keyframes<DAffine3> {
    if let Beam::Cone { direction, .. } = beam
        && keys.all().any(|placement| placement.direction.distance(*direction) > 1e-6)
    {
        let message =
            "the cone of a spot with a radius doesn't rotate during the shutter interval: use radius = 0";
        build.loaded.warnings.push(Warning::new(build.file, name, message));
    }
    keys.map(|placement| DAffine3::from_translation(placement.center - position))
}

/// Adds a light with a surface: `motion` is relative to the frame's time, `radiance` in W/sr/m2 is multiplied by `texture`.
fn add_surface(
    build: &mut SceneFileBuilder,
    (surface, motion): (Surface, Option<Keyframes<DAffine3>>),
    traits: LightTraits,
    beam: Beam,
    (radiance, texture): (f64, Option<TextureId>),
) {
    let LightTraits { name, color, emitter: emitter_traits, group, links, .. } = traits;
    let traits = ObjectTraits { links, ..ObjectTraits::default() };
    build.loaded.has_area_lights = true;
    let scene = &mut build.loaded.scene;
    let material = MaterialId(scene.materials.len() as u32);
    let is_shape = |of| matches!(surface, Surface::Shape { kind, .. } if kind == of);
    let is_obstacle = emitter_traits.is_obstacle && !is_shape(ShapeKind::FacingDisk);
    let emits_inwards = is_shape(ShapeKind::Shell);
    let mut emitter = Material::emitter(&name, color.map(|c| c * radiance as f32), emits_inwards);
    if let Some(emission) = &mut emitter.emission {
        emission.radiance.texture = texture;
    }
    emitter.emitter_traits = Some(EmitterTraits { is_obstacle, beam, ..emitter_traits })
        .filter(|emitter_traits| *emitter_traits != EmitterTraits::default());
    (emitter.light_group, emitter.is_light) = (group, true);
    scene.materials.push(emitter);
    match surface {
        Surface::Rectangle { corner, edge_u, edge_v } => {
            scene.motion.quads.extend(motion.map(|keys| (scene.quads.len(), keys)));
            scene.quads.push(Quad { name, traits, ..Quad::new(corner, edge_u, edge_v, material) });
        }
        Surface::Shape { position, radius, kind } => {
            scene.motion.shapes.extend(motion.map(|keys| (scene.shapes.len(), keys)));
            scene.shapes.push(Shape { name, kind, traits, ..Shape::sphere(position, radius, material) });
        }
        Surface::Ellipse { center, axis_u, axis_v } => {
            let (u, v) = (axis_u.length(), axis_v.length());
            // Shadow rays don't support moving disks.
            if (u - v).abs() <= 1e-6 * u && motion.is_none() {
                let normal = axis_u.cross(axis_v).normalize_or_zero();
                let disk = Shape::disk(center, normal, u, material);
                let axes = DMat3::from_cols(axis_u / u, normal.cross(axis_u / u), normal);
                let rotation =
                    if texture.is_some() { DQuat::from_mat3(&axes).normalize() } else { disk.rotation };
                scene.shapes.push(Shape { name, rotation, traits, ..disk });
                return;
            }
            let mut mesh = Mesh { name: format!("{name} (ellipse)"), ..mesh_of(ShapeKind::Disk) };
            let triangle_count = mesh.triangles.len() as u32;
            mesh.parts.push(MeshPart { first_triangle: 0, triangle_count, material });
            let mesh = scene.add_mesh(mesh);
            let axes = DMat3::from_cols(axis_u, axis_v, axis_u.cross(axis_v).normalize_or_zero());
            let world_from_object = DAffine3::from_mat3_translation(axes, center);
            let mut instance = Instance { name, traits, ..Instance::new(mesh, world_from_object) };
            if let Some(keys) = motion {
                instance.motion = scene.motion.add_instance(keys.map(|key| *key * world_from_object));
            }
            scene.instances.push(instance);
        }
    }
}

/// Number of cos(theta) steps for the mean of a profile.
const COSINE_STEPS: u32 = 256;

/// The profile of a light normalized to a maximum of 1, and its maximum intensity, W/sr; `None` after a reported problem.
fn read_profile(build: &SceneFileBuilder, fields: &Fields) -> Option<(Arc<LightProfile>, f64)> {
    let file = fields.string("ies")?;
    let path = build.readable_path(file.value, file.span.clone())?;
    build.options.files.note(&path);
    let bytes = files::read(&path, files::MAX_TEXT);
    let profile = match bytes.and_then(|bytes| ies::parse(&bytes)) {
        Ok(profile) => Some(profile),
        Err(message) => {
            fields.problems.push(file.span, format!("{}: {message}", path.display()));
            None
        }
    };
    // Read before any return, so that the keys are known.
    let photometric = (non_negative(fields, "power"), non_negative(fields, "intensity"));
    let strength = non_negative(fields, "strength");
    if strength.is_some() && photometric != (None, None) {
        let message =
            "'strength' scales the intensity of the 'ies' file, which 'power' and 'intensity' replace";
        fields.report(message);
    }
    let is_clockwise = fields.flag("clockwise", false);
    let profile = if is_clockwise { profile.map(LightProfile::mirrored) } else { profile };
    let (profile, peak) = ies::normalized(profile?);
    let intensity = match photometric {
        (None, None) => strength.unwrap_or(1.0) * peak / ies::LUMENS_PER_WATT,
        (Some(power), None) => power / (4.0 * PI * f64::from(profile.mean(COSINE_STEPS)).max(1e-9)),
        (None, Some(intensity)) => intensity,
        (Some(_), Some(_)) => {
            fields.report("'power' and 'intensity' exclude each other: keep one, or with 'ies' none");
            return None;
        }
    };
    Some((Arc::new(profile), intensity))
}

/// A profiled light at the origin, with axis -z; `cone`: inner and outer half angle of a spot, radians.
fn profiled_at_origin(fields: &Fields, cone: Option<[f64; 2]>) -> LightKind {
    let turn_rad = fields.number_in("turn", -360.0..360.0, 0.0).to_radians();
    LightKind::Profiled { position: DVec3::ZERO, rotation: DQuat::from_rotation_z(turn_rad), cone }
}

/// The motion of a profiled light with a radius, relative to the frame's time. Rotating profiles aren't supported and cause
/// a warning.
fn profiled_shape_motion(
    build: &mut SceneFileBuilder,
    name: &str,
    now: &LightKind,
    keys: &Keyframes<LightKind>,
) -> Keyframes<DAffine3> {
    let pose = |kind: &LightKind| match *kind {
        LightKind::Profiled { position, rotation, .. } => (position, rotation),
        _ => (DVec3::ZERO, DQuat::IDENTITY),
    };
    let (from, rotation) = pose(now);
    if keys.all().any(|key| pose(key).1.dot(rotation).abs() < 1.0 - 1e-9) {
        let message =
            "the profile of a light with a radius doesn't rotate during the shutter interval: use radius = 0";
        build.loaded.warnings.push(Warning::new(build.file, name, message));
    }
    keys.map(|key| DAffine3::from_translation(pose(key).0 - from))
}

/// The rotation from -z to a light's axis; by default the keys `target` or `direction`, else down.
fn rotation_to_axis(fields: &Fields, position: DVec3, axis: Option<DVec3>) -> Option<DQuat> {
    let is_aimed = fields.has("target") || fields.has("direction");
    let axis = match axis {
        None if is_aimed => direction(fields, Some(position))?,
        axis => axis.unwrap_or(DVec3::NEG_Y),
    };
    Some(DQuat::from_rotation_arc(DVec3::NEG_Z, axis))
}

/// The rotation from -z and x to a placement's direction and right.
fn placement_rotation(placement: &Placement) -> DQuat {
    let back = -placement.direction;
    DQuat::from_mat3(&DMat3::from_cols(placement.right, back.cross(placement.right), back)).normalize()
}
