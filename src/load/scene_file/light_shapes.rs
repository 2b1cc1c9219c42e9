//! Lights of scene files that have a surface.

use super::build::Build;
use super::fields::{self, Fields};
use super::light_traits::{LightTraits, strength};
use super::placement::{Placed, Placement, at_node, placed};
use super::textures::read_image;
use crate::error::Warning;
use crate::load::image::Use;
use crate::math::{DAffine3, DMat3, DQuat, DVec3, Vec2};
use crate::scene::{
    Beam, Instance, Interpolation, Lamp, Mapping, Material, MaterialId, Mesh, MeshId, MeshPart, Motion,
    Moving, ObjectTraits, Quad, Shape, ShapeKind, Texture, TextureId, TextureTransform, Wrap,
};
use crate::shape::mesh_of;
use std::f64::consts::{FRAC_PI_4, PI};

/// Largest spread, degrees, that is a beam: beyond, and by default, light goes everywhere.
const WIDEST_BEAM: f64 = 179.9;

/// The surface of a light.
pub(super) enum Surface {
    /// A parallelogram that shines along edge_u x edge_v.
    Rectangle { corner: DVec3, edge_u: DVec3, edge_v: DVec3 },
    /// An ellipse by its half axes, that shines along their cross product.
    Ellipse { center: DVec3, axis_u: DVec3, axis_v: DVec3 },
    /// A sphere, a shell or a disk that faces what it lights.
    Ball { position: DVec3, radius: f64, kind: ShapeKind },
}

/// What a lamp with a radius is: a disk that faces what it lights if it has a soft falloff, and what rays pass shines inwards, too.
pub(super) fn ball_kind(is_soft: bool, is_obstacle: bool) -> ShapeKind {
    match is_obstacle {
        _ if is_soft => ShapeKind::FacingDisk,
        true => ShapeKind::Sphere,
        false => ShapeKind::Shell,
    }
}

/// Adds an area light.
pub(super) fn add_area(build: &mut Build, fields: &Fields, traits: LightTraits) {
    fields.know(&["power", "radiance"]);
    let size = fields.require("size", fields.numbers::<2>("size"));
    let is_ellipse = fields.choice("shape", &[("rectangle", false), ("ellipse", true)]).unwrap_or(false);
    let spread = fields.number_in("spread", 0.1..180.0, 180.0);
    let placement = if fields.has("node") { at_node(build, fields) } else { placed(fields) };
    let Some(size) = size else { return };
    if size.value.iter().any(|s| *s <= 0.0) {
        return fields.problems.push(size.span, "'size' of an area light must be above 0");
    }
    let placement = placement.map(|placed| placed.moved(traits.moved.as_ref()));
    let Some(Placed { now, motion }) = placement else { return };
    let Placement { center, direction, right, scale } = now;
    let [width, height] = [size.value[0] * scale[0], size.value[1] * scale[1]];
    let area = width * height * if is_ellipse { FRAC_PI_4 } else { 1.0 };
    let Some(radiance) = strength(fields, "radiance", 1.0 / (PI * area)) else { return };
    let (edge_u, edge_v) = (right * width, direction.cross(right) * height);
    let surface = match is_ellipse {
        true => Surface::Ellipse { center, axis_u: edge_u / 2.0, axis_v: edge_v / 2.0 },
        false => Surface::Rectangle { corner: center - (edge_u + edge_v) / 2.0, edge_u, edge_v },
    };
    let beam = match spread < WIDEST_BEAM {
        true => Beam::Grid { half_angle_rad: spread.to_radians() / 2.0 },
        false => Beam::Even,
    };
    let picture = fields.string("image").and_then(|image| picture(build, image, is_ellipse));
    let unit_from_world = now.world_from_unit().inverse();
    let motion = motion.map(|moving| moving.map(|then| then.world_from_unit() * unit_from_world));
    add(build, (surface, motion), traits, beam, (radiance, picture));
}

/// A picture that covers a light, upright for who looks at it. Rows of images go along v of rectangles, which runs upwards; disks have
/// their own coordinates.
fn picture(build: &mut Build, image: fields::Placed<&str>, is_ellipse: bool) -> Option<TextureId> {
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

/// How a ball moves on from its place at the picture's moment. A cone that turns would be another beam at each time: it is warned
/// about.
pub(super) fn ball_motion(
    build: &mut Build,
    name: &str,
    position: DVec3,
    beam: &Beam,
    moving: &Moving<Placement>,
) -> Moving<DAffine3> {
    if let Beam::Cone { direction, .. } = beam
        && moving.all().any(|then| then.direction.distance(*direction) > 1e-6)
    {
        let message = "the cone of a spot with a radius doesn't turn while the shutter is open: with radius = 0 it does";
        build.loaded.warnings.push(Warning::new(build.file, name, message));
    }
    moving.map(|then| DAffine3::from_translation(then.center - position))
}

/// Adds a light with a surface of a radiance, times a picture if it has one, which may move on from where it is.
pub(super) fn add(
    build: &mut Build,
    (surface, motion): (Surface, Option<Moving<DAffine3>>),
    traits: LightTraits,
    beam: Beam,
    (radiance, picture): (f64, Option<TextureId>),
) {
    let LightTraits { name, color, lamp, group, links, .. } = traits;
    let traits = ObjectTraits { links, ..ObjectTraits::default() };
    build.loaded.has_area_lights = true;
    let scene = &mut build.loaded.scene;
    let material = MaterialId(scene.materials.len() as u32);
    let is_ball = |of| matches!(surface, Surface::Ball { kind, .. } if kind == of);
    // What turns is in nothing's way.
    let is_obstacle = lamp.is_obstacle && !is_ball(ShapeKind::FacingDisk);
    let shines_inwards = is_ball(ShapeKind::Shell);
    let mut emitter = Material::emitter(&name, color.map(|c| c * radiance as f32), shines_inwards);
    if let Some(emission) = &mut emitter.emission {
        emission.radiance.texture = picture;
    }
    emitter.lamp = Some(Lamp { is_obstacle, beam, ..lamp }).filter(|lamp| *lamp != Lamp::default());
    emitter.light_group = group;
    scene.materials.push(emitter);
    match surface {
        Surface::Rectangle { corner, edge_u, edge_v } => {
            scene.motion.quads.extend(motion.map(|moving| (scene.quads.len(), moving)));
            scene.quads.push(Quad { name, traits, ..Quad::new(corner, edge_u, edge_v, material) });
        }
        Surface::Ball { position, radius, kind } => {
            scene.motion.shapes.extend(motion.map(|moving| (scene.shapes.len(), moving)));
            scene.shapes.push(Shape { name, kind, traits, ..Shape::sphere(position, radius, material) });
        }
        Surface::Ellipse { center, axis_u, axis_v } => {
            let (u, v) = (axis_u.length(), axis_v.length());
            // Rays to lights find no disks that move.
            if (u - v).abs() <= 1e-6 * u && motion.is_none() {
                let normal = axis_u.cross(axis_v).normalize_or_zero();
                let disk = Shape::disk(center, normal, u, material);
                let turned = DMat3::from_cols(axis_u / u, normal.cross(axis_u / u), normal);
                let rotation =
                    if picture.is_some() { DQuat::from_mat3(&turned).normalize() } else { disk.rotation };
                scene.shapes.push(Shape { name, rotation, traits, ..disk });
                return;
            }
            let mut mesh = Mesh { name: format!("{name} (ellipse)"), ..mesh_of(ShapeKind::Disk) };
            let triangle_count = mesh.triangles.len() as u32;
            mesh.parts.push(MeshPart { first_triangle: 0, triangle_count, material });
            scene.meshes.push(mesh);
            let mesh = MeshId(scene.meshes.len() as u32 - 1);
            let axes = DMat3::from_cols(axis_u, axis_v, axis_u.cross(axis_v).normalize_or_zero());
            let world_from_object = DAffine3::from_mat3_translation(axes, center);
            let mut instance = Instance { name, traits, ..Instance::new(mesh, world_from_object) };
            if let Some(moving) = motion {
                instance.motion = Motion::Keyed(scene.motion.instances.len() as u32);
                scene.motion.instances.push(moving.map(|key| *key * world_from_object));
            }
            scene.instances.push(instance);
        }
    }
}
