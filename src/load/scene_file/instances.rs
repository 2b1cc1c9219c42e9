//! `instances` of `[[objects]]`: copies of an object at the places of a file.

use super::assets::Assets;
use super::builder::SceneFileBuilder;
use super::fields::Fields;
use crate::error::Warning;
use crate::load::mesh_tools::placed_shape;
use crate::load::{files, ply};
use crate::math::DAffine3;
use crate::sampling::hash::{hash32, unit};
use crate::scene::{Instance, Motion, ObjectInfo, Scene};
use ply::places::{Place, Places};
use std::ops::Range;

/// Files may not be larger, bytes.
const MAX_BYTES: u64 = 1 << 36;

/// Reads the places of an object's copies; `None` without the key or after a problem.
pub(super) fn read(build: &mut SceneFileBuilder, fields: &Fields, name: &str) -> Option<Vec<Place>> {
    let file = fields.string("instances")?;
    if fields.has("motion") {
        let message = "copies at the places of a file don't move";
        fields.problems.push_help(file.span.clone(), message, "leave 'motion' or 'instances' out");
    }
    let path = build.readable_path(file.value, file.span.clone())?;
    build.options.files.note(&path);
    let read = files::read(&path, MAX_BYTES).and_then(|bytes| {
        ply::places::read(&bytes, &build.options.gauge).map_err(|p| format!("{}: {}", p.place, p.message))
    });
    match read {
        Ok(Places { list, flat }) => {
            if flat > 0 {
                let message = format!("{flat} copies of '{name}' without a volume were left out");
                build.loaded.warnings.push(Warning::new(&path, "", message));
            }
            Some(list)
        }
        Err(message) => {
            fields.problems.push_of_file(file.span, &path, format!("'{}': {message}", file.value));
            None
        }
    }
}

/// Replaces what an object added to the scene, which had `[instances, quads, shapes]` before, by its copies.
pub(super) fn copy(
    build: &mut SceneFileBuilder,
    span: Range<usize>,
    [instances, quads, shapes]: [usize; 3],
    places: &[Place],
    assets: &mut Assets,
) {
    let scene = &mut build.loaded.scene;
    if scene.quads.len() > quads {
        let message = "quads have no 'instances': take a triangle, a box or a mesh";
        return build.problems.push(span, message);
    }
    let own = scene.instances.split_off(instances);
    assets.repeat_listed(instances, own.len(), places.len());
    scene.instances.reserve(own.len() * places.len());
    for (number, place) in places.iter().enumerate() {
        for instance in &own {
            let copied = copied(scene, instance, number, place);
            scene.instances.push(copied);
        }
    }
    let own = scene.shapes.split_off(shapes);
    scene.shapes.reserve(own.len() * places.len());
    for (number, place) in places.iter().enumerate() {
        for shape in &own {
            let Some(copy) = placed_shape(&place.world_from_object, shape.clone()) else {
                let message = format!("the scale of copy {number} would bend a shape that stays round");
                return build.problems.push_help(span, message, "scale copies of spheres and disks evenly");
            };
            let info = info(&copy.info, number, place);
            scene.shapes.push(crate::scene::Shape { info, ..copy });
        }
    }
}

/// A copy of an instance at a place.
fn copied(scene: &mut Scene, instance: &Instance, number: usize, place: &Place) -> Instance {
    let moved = |key: &DAffine3| place.world_from_object * *key;
    let motion = match instance.motion {
        Motion::Keyed(key) => {
            let moving = scene.motion.instances[key as usize].map(moved);
            scene.motion.instances.push(moving);
            Motion::Keyed(scene.motion.instances.len() as u32 - 1)
        }
        motion => motion,
    };
    let world_from_object = moved(&instance.world_from_object);
    Instance { world_from_object, motion, info: info(&instance.info, number, place), ..instance.clone() }
}

/// What nodes know of a copy: what its place says, else what the object says, and random numbers of their own.
fn info(of_object: &ObjectInfo, number: usize, place: &Place) -> ObjectInfo {
    ObjectInfo {
        color: place.color.unwrap_or(of_object.color),
        index: place.index.unwrap_or(of_object.index),
        random: place.random.or(of_object.random).or_else(|| Some(unit(hash32(number as u32)))),
    }
}
