//! `instances` of `[[objects]]`: copies of an object at the transforms of a PLY file.
//!
//! `mesh_keys` of objects: meshes that deform, by files with the same vertices at other frames.

use super::assets::Assets;
use super::builder::SceneFileBuilder;
use super::fields::Fields;
use super::transform::{read_keys, segment};
use crate::error::Warning;
use crate::load::mesh_tools::placed_shape;
use crate::load::{files, ply};
use crate::math::{DAffine3, DMat3, DVec3, Vec3};
use crate::sampling::hash::{hash32, unit};
use crate::scene::{Instance, Keyframes, MeshId, Motion, ObjectInfo, Scene, Vertices};
use ply::places::{Place, Places};
use std::ops::Range;

/// Maximum size of a file of transforms, bytes.
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
        ply::places::read(&bytes, &build.options.counter).map_err(|p| format!("{}: {}", p.place, p.message))
    });
    match read {
        Ok(Places { list, flat }) => {
            if flat > 0 {
                let message = format!("{flat} copies of '{name}' without an area were left out");
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

/// Attributes of a copy for node graphs: those of its transform in the file, else those of the object, and random numbers of its own.
fn info(of_object: &ObjectInfo, number: usize, place: &Place) -> ObjectInfo {
    ObjectInfo {
        color: place.color.unwrap_or(of_object.color),
        index: place.index.unwrap_or(of_object.index),
        random: place.random.or(of_object.random).or_else(|| Some(unit(hash32(number as u32)))),
    }
}

/// The vertices of a mesh at frames, in the order of time.
pub(super) struct MeshKeys {
    keys: Vec<(f64, Vertices)>,
    /// Frames and files of the table, to compare the keys of objects.
    label: String,
}

impl MeshKeys {
    /// Reads the key `mesh_keys` of an object; `None` without it or after a problem.
    pub fn read(build: &mut SceneFileBuilder, object: &Fields, assets: &mut Assets) -> Option<MeshKeys> {
        let files =
            read_keys(object, "mesh_keys", "mesh_keys", |key| key.require("mesh", key.string("mesh")))?;
        let (mut keys, mut label) = (Vec::new(), String::new());
        for (frame, file) in files {
            label += &format!("{frame} {}\n", file.value);
            keys.push((frame, assets.vertices(build, file.value, file.span)?));
        }
        Some(MeshKeys { keys, label })
    }

    /// Sets the vertices of a mesh to those at the picture's time and at the keys of the shutter interval, and adds the keys of the
    /// transform that the instance of a deforming mesh needs.
    ///
    /// # Errors
    /// A message, if the number of vertices differs from the mesh's.
    pub fn give(
        &self,
        build: &mut SceneFileBuilder,
        assets: &mut Assets,
        (id, motion, place): (MeshId, Motion, DAffine3),
    ) -> Result<Motion, String> {
        let mesh = &build.loaded.scene.meshes[id.index()];
        let count = (mesh.positions.len(), mesh.normals.len());
        for (frame, key) in &self.keys {
            let found = (key.positions.len(), key.normals.len());
            if found != count {
                let what = |(positions, normals)| format!("{positions} vertices and {normals} normals");
                let (found, own) = (what(found), what(count));
                return Err(format!("'mesh_keys' has {found} at frame {frame}, but the mesh has {own}"));
            }
        }
        let is_known = assets.has_mesh_keys(id, &self.label)?;
        let (now, shutter) = (build.frame(), build.shutter);
        let still = Keyframes { keys: vec![place; 2], neighbours: shutter.vectors.then_some([place; 2]) };
        if !is_known {
            let (keys, _) = shutter.keys_for(&mut |frames| self.key_weights(now + frames));
            let keys: Vec<Vertices> = shutter.key_frames(keys).map(|f| self.at(now + f)).collect();
            let neighbours = shutter.vectors.then(|| [self.at(now - 1.0), self.at(now + 1.0)]);
            let shape = self.at(now);
            let scene = &mut build.loaded.scene;
            let mesh = &mut scene.meshes[id.index()];
            (mesh.positions, mesh.normals) = (shape.positions, shape.normals);
            if shutter.needs_motion() {
                scene.motion.meshes.insert(id.index(), Keyframes { keys, neighbours });
            }
        }
        if !shutter.needs_motion() || matches!(motion, Motion::Keyed(_)) {
            return Ok(motion);
        }
        let instances = &mut build.loaded.scene.motion.instances;
        instances.push(still);
        Ok(Motion::Keyed(instances.len() as u32 - 1))
    }

    /// The weight of each key at a frame, as shears, so that the tolerance of transforms applies to them.
    fn key_weights(&self, frame: f64) -> Vec<DAffine3> {
        let (before, weight) = segment(&self.keys, frame);
        let weight = weight.unwrap_or(0.0);
        let of = |key: usize| match key {
            key if key == before => 1.0 - weight,
            key if key == before + 1 => weight,
            _ => 0.0,
        };
        let shear = |weight: f64| DMat3::from_cols(DVec3::new(1.0, weight, 0.0), DVec3::Y, DVec3::Z);
        (0..self.keys.len()).map(|key| DAffine3::from_mat3(shear(of(key)))).collect()
    }

    /// The vertices at a frame.
    fn at(&self, frame: f64) -> Vertices {
        let (before, weight) = segment(&self.keys, frame);
        let from = &self.keys[before].1;
        let Some(weight) = weight.filter(|weight| *weight > 0.0) else { return from.clone() };
        let to = &self.keys[before + 1].1;
        let mix = |a: &[f32; 3], b: &[f32; 3]| Vec3::from(*a).lerp(Vec3::from(*b), weight as f32);
        let positions = from.positions.iter().zip(&to.positions).map(|(a, b)| mix(a, b).to_array());
        let normals = from.normals.iter().zip(&to.normals);
        let normals = normals.map(|(a, b)| mix(a, b).normalize_or(Vec3::from(*a)).to_array());
        Vertices { positions: positions.collect(), normals: normals.collect() }
    }
}
