//! `instances` of `[[objects]]`: instances of an object with the transforms of a PLY file.
//!
//! `mesh_keys` of objects: deforming meshes, from files with the same vertices at other frames.

use super::assets::Assets;
use super::builder::SceneFileBuilder;
use super::fields::Fields;
use super::transform::{key_segment, read_keys};
use crate::error::Warning;
use crate::load::mesh_tools::placed_shape;
use crate::load::{files, ply};
use crate::math::{DAffine3, DMat3, DVec3, Vec3};
use crate::sampling::hash::{hash32, unit};
use crate::scene::{Instance, Keyframes, MeshId, Motion, ObjectInfo, Scene, Vertices};
use ply::point_instances::{PointInstance, PointInstances};
use std::ops::Range;

/// Maximum size of a file of transforms, bytes.
const MAX_BYTES: u64 = 1 << 36;

/// Reads the instances of an object; `None` without the key or after a problem.
pub(super) fn read(build: &mut SceneFileBuilder, fields: &Fields, name: &str) -> Option<Vec<PointInstance>> {
    let file = fields.string("instances")?;
    if fields.has("motion") {
        let message = "instances from a file can't have a 'motion'";
        fields.problems.push_help(file.span.clone(), message, "leave 'motion' or 'instances' out");
    }
    let path = build.readable_path(file.value, file.span.clone())?;
    build.options.files.note(&path);
    let read = files::read(&path, MAX_BYTES).and_then(|bytes| {
        ply::point_instances::read(&bytes, &build.options.counter)
            .map_err(|p| format!("{}: {}", p.place, p.message))
    });
    match read {
        Ok(PointInstances { list, degenerate }) => {
            if degenerate > 0 {
                let message =
                    format!("{degenerate} instances of '{name}' with a singular transform were left out");
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

/// Replaces the instances and shapes of an object by copies for each point instance. `[instances, quads, shapes]` are the
/// scene's counts before the object was added.
pub(super) fn copy(
    build: &mut SceneFileBuilder,
    span: Range<usize>,
    [instances, quads, shapes]: [usize; 3],
    points: &[PointInstance],
    assets: &mut Assets,
) {
    let scene = &mut build.loaded.scene;
    if scene.quads.len() > quads {
        let message = "quads have no 'instances': use a triangle, a box or a mesh";
        return build.problems.push(span, message);
    }
    let originals = scene.instances.split_off(instances);
    assets.copy_listed_materials(instances, originals.len(), points.len());
    scene.instances.reserve(originals.len() * points.len());
    for (number, point) in points.iter().enumerate() {
        for instance in &originals {
            let copy = copy_instance(scene, instance, number, point);
            scene.instances.push(copy);
        }
    }
    let originals = scene.shapes.split_off(shapes);
    scene.shapes.reserve(originals.len() * points.len());
    for (number, point) in points.iter().enumerate() {
        for shape in &originals {
            let Some(copy) = placed_shape(&point.world_from_object, shape.clone()) else {
                let message =
                    format!("instance {number} has a non-uniform scale, but spheres and disks stay round");
                return build.problems.push_help(
                    span,
                    message,
                    "scale instances of spheres and disks uniformly",
                );
            };
            let info = copy_info(&copy.info, number, point);
            scene.shapes.push(crate::scene::Shape { info, ..copy });
        }
    }
}

/// A copy of an instance, transformed by a point instance.
fn copy_instance(scene: &mut Scene, instance: &Instance, number: usize, point: &PointInstance) -> Instance {
    let transformed = |key: &DAffine3| point.world_from_object * *key;
    let motion = match instance.motion {
        Motion::Keyed(key) => {
            let keys = scene.motion.instances[key as usize].map(transformed);
            scene.motion.add_instance(keys)
        }
        motion => motion,
    };
    let world_from_object = transformed(&instance.world_from_object);
    Instance { world_from_object, motion, info: copy_info(&instance.info, number, point), ..instance.clone() }
}

/// `object_info` outputs of a copy: those of the file, else those of the object; random numbers default to a hash of the
/// instance's number.
fn copy_info(object: &ObjectInfo, number: usize, point: &PointInstance) -> ObjectInfo {
    ObjectInfo {
        color: point.color.unwrap_or(object.color),
        index: point.index.unwrap_or(object.index),
        random: point.random.or(object.random).or_else(|| Some(unit(hash32(number as u32)))),
    }
}

/// Shape keys of a mesh, sorted by frame.
pub(super) struct MeshKeys {
    /// Frame and vertices.
    keys: Vec<(f64, Vertices)>,
    /// Frames and file names, to compare the keys of objects.
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

    /// Sets the vertices of a mesh at the frame's time and at the motion keys of the shutter interval. Returns the motion of
    /// the instance: deforming meshes need transform keys, too.
    ///
    /// # Errors
    /// A message, if the number of vertices differs from the mesh's.
    pub fn apply(
        &self,
        build: &mut SceneFileBuilder,
        assets: &mut Assets,
        (id, motion, world_from_object): (MeshId, Motion, DAffine3),
    ) -> Result<Motion, String> {
        let mesh = &build.loaded.scene.meshes[id.index()];
        let count = (mesh.positions.len(), mesh.normals.len());
        for (frame, key) in &self.keys {
            let found = (key.positions.len(), key.normals.len());
            if found != count {
                let counts = |(positions, normals)| format!("{positions} vertices and {normals} normals");
                let (found, own) = (counts(found), counts(count));
                return Err(format!("'mesh_keys' has {found} at frame {frame}, but the mesh has {own}"));
            }
        }
        let is_known = assets.has_mesh_keys(id, &self.label)?;
        let (now, shutter) = (build.frame(), build.shutter);
        if !is_known {
            let (keys, _) = shutter.keys_for(&mut |frames| self.key_weights(now + frames));
            let keys: Vec<Vertices> = shutter.key_frames(keys).map(|f| self.vertices_at(now + f)).collect();
            let neighbours =
                shutter.vectors.then(|| [self.vertices_at(now - 1.0), self.vertices_at(now + 1.0)]);
            let vertices = self.vertices_at(now);
            let scene = &mut build.loaded.scene;
            let mesh = &mut scene.meshes[id.index()];
            (mesh.positions, mesh.normals) = (vertices.positions, vertices.normals);
            if shutter.needs_motion() {
                scene.motion.meshes.insert(id.index(), Keyframes { keys, neighbours });
            }
        }
        if !shutter.needs_motion() || matches!(motion, Motion::Keyed(_)) {
            return Ok(motion);
        }
        let keys = Keyframes {
            keys: vec![world_from_object; 2],
            neighbours: shutter.vectors.then_some([world_from_object; 2]),
        };
        Ok(build.loaded.scene.motion.add_instance(keys))
    }

    /// The interpolation weight of each key at a frame, encoded as a shear, for [`ShutterOptions::keys_for`], which compares
    /// transforms.
    fn key_weights(&self, frame: f64) -> Vec<DAffine3> {
        let (before, weight) = key_segment(&self.keys, frame);
        let weight = weight.unwrap_or(0.0);
        let weight_of = |key: usize| match key {
            key if key == before => 1.0 - weight,
            key if key == before + 1 => weight,
            _ => 0.0,
        };
        let shear = |weight: f64| DMat3::from_cols(DVec3::new(1.0, weight, 0.0), DVec3::Y, DVec3::Z);
        (0..self.keys.len()).map(|key| DAffine3::from_mat3(shear(weight_of(key)))).collect()
    }

    /// The interpolated vertices at a frame.
    fn vertices_at(&self, frame: f64) -> Vertices {
        let (before, weight) = key_segment(&self.keys, frame);
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
