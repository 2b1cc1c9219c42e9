//! Motion blur: the scene is sampled at several times while the shutter is open, and objects with different transforms or
//! vertices get keyframes.

use super::animation;
use super::document::Document;
use super::lights::world_from_quad;
use super::nodes;
use super::nodes::NodeParents;
use super::report::Report;
use super::scene_builder::{SceneBuilder, SharedAssets};
use super::vertices;
use crate::load::LoadOptions;
use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::{Camera, Instance, Keyframes, Light, LightKind, Mesh, Motion, Scene, Vertices};
use std::collections::{BTreeSet, HashMap};

/// The scene at one time of the shutter interval.
struct ShutterSample {
    /// World transforms and mesh indices of instances, by name and number of earlier instances of that name.
    instances: HashMap<(String, usize), (DAffine3, usize)>,
    /// Vertices of deformed meshes, by index.
    meshes: HashMap<usize, Vertices>,
    cameras: Vec<Camera>,
    lights: Vec<Light>,
    /// Quads: names and transforms from the unit square to world space.
    quads: Vec<(String, DAffine3)>,
    /// World transforms of empty nodes, by index.
    empties: HashMap<usize, DAffine3>,
}

/// Time samples of the scene.
pub(super) struct ShutterSamples {
    /// While the shutter is open.
    keys: Vec<ShutterSample>,
    /// One frame before and after, for motion vectors.
    neighbours: Option<[ShutterSample; 2]>,
}

impl ShutterSamples {
    /// Samples a file around a time, seconds; `None` if the shutter needs no samples.
    pub fn read(
        doc: &Document,
        time_s: Option<f64>,
        LoadOptions { shutter, lit_nodes: lit, .. }: &LoadOptions,
        shared: &mut SharedAssets,
        report: &mut Report,
    ) -> Option<ShutterSamples> {
        if !shutter.needs_motion() || doc.count("animations") == 0 {
            return None;
        }
        if time_s.is_none() && shutter.is_open() {
            let message = "no time is set: there is no motion blur";
            report.note("/animations", message);
        }
        let time_s = time_s?;
        let at = |frames: f64| time_s + frames / shutter.fps;
        let (keys, is_enough) = shutter.keys_for(&mut |frames| transforms_at(doc, at(frames), report, lit));
        let mut sample = |frames: f64| {
            report.begin_time();
            doc.begin_time();
            sample_at(doc, at(frames), shared, report)
        };
        let samples = ShutterSamples {
            keys: shutter.key_frames(keys).map(&mut sample).collect(),
            neighbours: shutter.vectors.then(|| [sample(-1.0), sample(1.0)]),
        };
        report.begin_time();
        doc.begin_time();
        if !is_enough {
            let message = format!(
                "{keys} motion keys are too few for the fastest rotation or motion while the shutter is open"
            );
            report.warn("/animations", message);
        }
        Some(samples)
    }

    /// A value at all times; `None` if it is missing at any time.
    fn all<T>(&self, of: impl Fn(&ShutterSample) -> Option<T>) -> Option<Keyframes<T>> {
        let neighbours = match &self.neighbours {
            Some([before, after]) => Some([of(before)?, of(after)?]),
            None => None,
        };
        Some(Keyframes { keys: self.keys.iter().map(of).collect::<Option<_>>()?, neighbours })
    }

    /// Adds the motion to the scene, which is at the time of the rendered frame.
    pub fn apply(&self, scene: &mut Scene, report: &mut Report) {
        let (mut absent, mut incompatible) = (0, 0);
        let names = unique_names(&scene.instances);
        for (i, name) in names.iter().enumerate() {
            let Some(placed) = self.all(|m| m.instances.get(name).copied()) else {
                absent += 1;
                continue;
            };
            let (place, mesh) = (scene.instances[i].world_from_object, scene.instances[i].mesh.index());
            let moving = Keyframes {
                keys: placed.keys.iter().map(|m| m.0).collect(),
                neighbours: placed.neighbours.map(|n| n.map(|m| m.0)),
            };
            let deformed = self.vertices(&placed, &scene.meshes[mesh]);
            incompatible += usize::from(deformed.is_none() && self.is_deformed(&placed));
            let deforms =
                deformed.as_ref().is_some_and(|moving| vertices_differ(moving, &scene.meshes[mesh]));
            if differs(&moving, &place) || deforms {
                scene.instances[i].motion = Motion::Keyed(scene.motion.instances.len() as u32);
                scene.motion.instances.push(moving);
            }
            if let Some(deformed) = deformed.filter(|_| deforms) {
                scene.motion.meshes.insert(mesh, deformed);
            }
        }
        if absent > 0 {
            let message = format!(
                "{absent} instances do not exist during the whole exposure: they have no motion blur"
            );
            report.warn("/animations", message);
        }
        if incompatible > 0 {
            let message = format!(
                "{incompatible} meshes change their number of vertices during the exposure: their deformation has no motion blur"
            );
            report.warn("/animations", message);
        }
        self.set_cameras(scene);
        self.set_lights(scene);
        self.set_quads(scene);
    }

    /// Whether an instance's mesh is deformed at some time.
    fn is_deformed(&self, placed: &Keyframes<(DAffine3, usize)>) -> bool {
        let mut keys = self.keys.iter().zip(&placed.keys);
        keys.any(|(sample, placed)| sample.meshes.contains_key(&placed.1))
    }

    /// Keyframes of an empty node; `None` if it is static.
    pub fn empty(&self, node: usize, now: &DAffine3) -> Option<Keyframes<DAffine3>> {
        self.all(|m| m.empties.get(&node).copied()).filter(|moving| differs(moving, now))
    }

    /// The vertices of an instance's mesh at all times; `None` if it isn't deformed or their number changes.
    fn vertices(&self, placed: &Keyframes<(DAffine3, usize)>, mesh: &Mesh) -> Option<Keyframes<Vertices>> {
        let counts = (mesh.positions.len(), mesh.normals.len());
        let vertices_of = |sample: &ShutterSample, mesh: usize| {
            sample.meshes.get(&mesh).filter(|v| (v.positions.len(), v.normals.len()) == counts).cloned()
        };
        let keys = self.keys.iter().zip(&placed.keys).map(|(sample, placed)| vertices_of(sample, placed.1));
        let neighbours = match (&self.neighbours, &placed.neighbours) {
            (Some([before, after]), Some([b, a])) => {
                Some([vertices_of(before, b.1)?, vertices_of(after, a.1)?])
            }
            _ => None,
        };
        Some(Keyframes { keys: keys.collect::<Option<_>>()?, neighbours })
    }

    fn set_cameras(&self, scene: &mut Scene) {
        for (i, camera) in scene.cameras.iter_mut().enumerate() {
            let place = |m: &ShutterSample| {
                m.cameras.get(i).filter(|c| c.name == camera.name).map(|c| c.world_from_camera)
            };
            camera.motion = self.all(place).filter(|moving| differs(moving, &camera.world_from_camera));
        }
    }

    fn set_lights(&self, scene: &mut Scene) {
        for (i, light) in scene.lights.iter_mut().enumerate() {
            let kind = |m: &ShutterSample| m.lights.get(i).filter(|l| l.name == light.name).map(|l| l.kind);
            let differs = |moving: &Keyframes<LightKind>| differs(moving, &light.kind);
            light.motion = self.all(kind).filter(differs);
        }
    }

    fn set_quads(&self, scene: &mut Scene) {
        for (i, quad) in scene.quads.iter().enumerate() {
            let now = world_from_quad(quad);
            let place = |m: &ShutterSample| {
                m.quads.get(i).filter(|(name, _)| *name == quad.name).map(|(_, place)| *place)
            };
            if let Some(moving) = self.all(place).filter(|moving| differs(moving, &now)) {
                scene.motion.quads.insert(i, moving.map(|then| *then * now.inverse()));
            }
        }
    }
}

/// Whether any key differs from the value at the time of the rendered frame.
fn differs<T: PartialEq>(moving: &Keyframes<T>, now: &T) -> bool {
    moving.all().any(|then| then != now)
}

/// Whether the vertices at any time differ from those at the time of the rendered frame.
fn vertices_differ(moving: &Keyframes<Vertices>, now: &Mesh) -> bool {
    moving.all().any(|then| then.positions != now.positions || then.normals != now.normals)
}

/// Names of instances, with an index that makes them unique.
fn unique_names(instances: &[Instance]) -> Vec<(String, usize)> {
    let mut counts: HashMap<&str, usize> = HashMap::new();
    let mut names = Vec::with_capacity(instances.len());
    for instance in instances {
        let count = counts.entry(&instance.name).or_default();
        names.push((instance.name.clone(), *count));
        *count += 1;
    }
    names
}

/// All transforms that may change over time, including empty nodes with lights of the sidecar.
fn transforms_at(doc: &Document, time_s: f64, report: &mut Report, lit: &BTreeSet<String>) -> Vec<DAffine3> {
    let pose = animation::pose(doc, time_s, report);
    let node_parents = NodeParents::new(doc, &pose);
    let hierarchy = nodes::walk(doc, &pose, &node_parents, report);
    let mut transforms = Vec::new();
    for node in &hierarchy.nodes {
        if node.has_content(doc) && node.moves {
            transforms.push(node.world_from_node);
        }
        if let Some(skin) = node.skin {
            transforms.extend(vertices::joint_transforms(doc, skin, &node_parents, report));
        }
        let Some(mesh) = node.mesh else { continue };
        let weights = [pose.node_weights(node.index), pose.mesh_weights(mesh)];
        let weights = weights.into_iter().flatten().flat_map(|weights| weights.over(Vec::new()));
        transforms.extend(weights.map(weight_as_transform));
    }
    let empties = hierarchy.empties(doc).into_iter().filter(|(_, name, _)| lit.contains(name));
    transforms.extend(empties.map(|(_, _, place)| place));
    transforms
}

/// A morph target weight as a shear: the tolerance of transforms then applies to weights, relative to 1.
fn weight_as_transform(weight: f32) -> DAffine3 {
    DAffine3::from_mat3(DMat3::from_cols(DVec3::new(1.0, f64::from(weight), 0.0), DVec3::Y, DVec3::Z))
}

/// The scene at a time.
fn sample_at(doc: &Document, time_s: f64, shared: &mut SharedAssets, report: &mut Report) -> ShutterSample {
    let pose = animation::pose(doc, time_s, report);
    let node_parents = NodeParents::new(doc, &pose);
    let hierarchy = nodes::walk(doc, &pose, &node_parents, report);
    let mut builder = SceneBuilder::new(doc, &pose, &node_parents, shared).for_shutter(true);
    builder.add(&hierarchy, report);
    let (mut scene, static_meshes) = builder.finish(report);
    shared.take_back(&mut scene, static_meshes);
    let transforms = scene.instances.iter().map(|i| (i.world_from_object, i.mesh.index()));
    let instances = unique_names(&scene.instances).into_iter().zip(transforms).collect();
    // Static meshes were moved back to the cache.
    let deformed = scene.meshes.into_iter().enumerate().filter(|(_, mesh)| !mesh.positions.is_empty());
    let vertices = deformed.map(|(i, m)| (i, Vertices { positions: m.positions, normals: m.normals }));
    let empties = hierarchy.empties(doc).into_iter().map(|(index, _, place)| (index, place));
    ShutterSample {
        instances,
        meshes: vertices.collect(),
        cameras: scene.cameras,
        lights: scene.lights,
        quads: scene.quads.iter().map(|quad| (quad.name.clone(), world_from_quad(quad))).collect(),
        empties: empties.collect(),
    }
}
