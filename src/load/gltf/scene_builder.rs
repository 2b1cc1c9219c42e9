//! Builds the scene from the visible nodes: meshes, instances, cameras and lights.

use super::animation::{Pose, WeightsPose};
use super::document::Document;
use super::lights::{AreaLight, Profiles};
use super::materials::Materials;
use super::meshes::MeshReader;
use super::nodes::{Hierarchy, Node, NodeParents};
use super::points_lines::PointsAndLines;
use super::report::{Report, Valid};
use super::vertices::{Deformation, SkinPose};
use super::{lights, textures, vertices};
use crate::image::Image;
use crate::math::DAffine3;
use crate::scene::{Instance, Mesh, MeshId, Motion, Scene};
use serde_json::Value;
use std::collections::{HashMap, HashSet};

/// Identity of a mesh of the scene: nodes with equal keys are its instances.
#[derive(PartialEq, Eq, Hash)]
struct MeshKey {
    mesh: usize,
    /// Bits of the morph target weights.
    weights: Vec<u32>,
    /// Skin, and node whose transform applies to unskinned vertices.
    skin: Option<(usize, usize)>,
    /// The node, if its morph target weights are animated.
    morphing_node: Option<usize>,
}

impl MeshKey {
    /// Whether the mesh is free of deformation.
    fn is_static(&self) -> bool {
        self.weights.is_empty() && self.skin.is_none() && self.morphing_node.is_none()
    }
}

/// The scene under construction.
pub(super) struct SceneBuilder<'b, 'a> {
    doc: &'b Document<'a>,
    pose: &'b Pose,
    node_parents: &'b NodeParents<'b, 'a>,
    scene: Scene,
    shared: &'b mut SharedAssets,
    /// The scene is a time sample of the shutter.
    is_shutter_sample: bool,
    meshes_by_key: HashMap<MeshKey, Vec<MeshId>>,
    /// Area lights, added last so that their materials follow all others.
    area_lights: Vec<AreaLight>,
    /// Points and lines of the visible meshes.
    pub points_and_lines: PointsAndLines,
}

impl<'b, 'a> SceneBuilder<'b, 'a> {
    /// An empty scene.
    pub fn new(
        doc: &'b Document<'a>,
        pose: &'b Pose,
        node_parents: &'b NodeParents<'b, 'a>,
        shared: &'b mut SharedAssets,
    ) -> SceneBuilder<'b, 'a> {
        let (scene, meshes_by_key, area_lights) = (Scene::default(), HashMap::new(), Vec::new());
        SceneBuilder {
            doc,
            pose,
            node_parents,
            scene,
            shared,
            is_shutter_sample: false,
            meshes_by_key,
            area_lights,
            points_and_lines: PointsAndLines::default(),
        }
    }

    /// For a time sample of the shutter: nodes with animated morph targets don't share meshes.
    pub fn for_shutter(self, is_shutter_sample: bool) -> SceneBuilder<'b, 'a> {
        SceneBuilder { is_shutter_sample, ..self }
    }

    /// Adds the contents of all nodes; problems of one node don't affect the others.
    pub fn add(&mut self, hierarchy: &Hierarchy, report: &mut Report) {
        for (entry, node) in hierarchy.nodes.iter().enumerate() {
            if let Some(mesh) = node.mesh {
                let _: Valid<()> = self.add_mesh(hierarchy, entry, node, mesh, report);
            }
            if let Some(index) = node.camera {
                self.scene.cameras.extend(lights::camera(self.doc, node, index, report));
            }
            if let Some(index) = node.light {
                self.scene.lights.extend(lights::punctual_light(self.doc, node, index, report));
            }
            self.scene.portals.extend(lights::portal(self.doc, node, report));
            if let Some(light) = lights::ies_light(self.doc, node, &mut self.shared.profiles, report) {
                self.scene.lights.extend(light);
            }
            let may_move = self.is_shutter_sample && node.moves;
            self.area_lights.extend(lights::area_light(self.doc, node, may_move, report));
        }
        let punctual = self.scene.lights.iter().filter(|light| light.profile.is_none()).count();
        lights::note_units(self.doc, punctual + self.area_lights.len(), report);
    }

    fn add_mesh(
        &mut self,
        hierarchy: &Hierarchy,
        entry: usize,
        node: &Node,
        mesh: usize,
        report: &mut Report,
    ) -> Valid<()> {
        let skin = match node.skin {
            Some(index) => {
                let from = format!("{}/skin", node.pointer());
                let world = node.world_from_node;
                Some(vertices::skin_pose(self.doc, index, &from, world, self.node_parents, report)?)
            }
            None => None,
        };
        let weights = self.weights(node, mesh, report);
        let meshes = self.meshes(node, mesh, &weights, skin.as_ref(), report);
        let transforms = match (&skin, &node.instances) {
            (Some(skin), instances) => {
                if instances.is_some() {
                    report.warn(node.pointer(), "has a skin and instances; a skinned mesh gets one instance");
                }
                vec![DAffine3::from_translation(skin.origin)]
            }
            (None, None) => vec![node.world_from_node],
            (None, Some(instances)) => instances.iter().map(|i| node.world_from_node * *i).collect(),
        };
        let name = hierarchy.path(self.doc, entry);
        let is_flat = transforms.iter().any(|place| place.matrix3.determinant() == 0.0);
        let motion = match self.motion(node, mesh) {
            Motion::Moves if is_flat => Motion::Deforms,
            motion => motion,
        };
        let raw = self.doc.json.pointer(&node.pointer());
        let traits = raw.map(|raw| lights::object_traits(raw, &node.pointer(), report)).unwrap_or_default();
        let group = raw.and_then(|raw| lights::light_group(raw, &node.pointer(), report));
        for place in &transforms {
            let read = (self.doc, &mut self.shared.materials);
            self.points_and_lines.place(read, mesh, *place, &name, report);
        }
        for (i, &world_from_object) in transforms.iter().enumerate() {
            for &mesh in &meshes {
                let name = if node.instances.is_some() { format!("{name}/{i}") } else { name.clone() };
                let (light_group, placed) = (group.clone(), Instance::new(mesh, world_from_object));
                self.scene.instances.push(Instance { name, motion, traits, light_group, ..placed });
            }
        }
        Ok(())
    }

    /// The scene's meshes for a node's mesh, read on first use.
    fn meshes(
        &mut self,
        node: &Node,
        mesh: usize,
        weights: &[f32],
        skin: Option<&SkinPose>,
        report: &mut Report,
    ) -> Vec<MeshId> {
        let key = MeshKey {
            mesh,
            weights: weights.iter().map(|w| w.to_bits()).collect(),
            skin: node.skin.map(|skin| (skin, node.index)),
            morphing_node: (self.is_shutter_sample && self.has_moving_weights(node, mesh))
                .then_some(node.index),
        };
        if let Some(known) = self.meshes_by_key.get(&key) {
            return known.clone();
        }
        let SharedAssets { materials, static_meshes, .. } = &mut *self.shared;
        let (doc, from) = (self.doc, format!("{}/mesh", node.pointer()));
        let mut read = |report: &mut Report| {
            let deformation = Deformation { weights, skin };
            MeshReader { doc, materials, report, deformation }.read(mesh, &from)
        };
        let read = match key.is_static() {
            true => static_meshes.remove(&mesh).unwrap_or_else(|| report.lasting(read)),
            false => read(report),
        };
        let first = self.scene.meshes.len() as u32;
        self.scene.meshes.extend(read);
        let ids: Vec<MeshId> = (first..self.scene.meshes.len() as u32).map(MeshId).collect();
        self.meshes_by_key.insert(key, ids.clone());
        ids
    }

    /// Kind of motion of a node's mesh.
    fn motion(&self, node: &Node, mesh: usize) -> Motion {
        if self.has_moving_weights(node, mesh) || node.skin.is_some() && self.pose.animations > 0 {
            Motion::Deforms
        } else if node.moves {
            Motion::Moves
        } else {
            Motion::Still
        }
    }

    /// Whether the morph target weights of a node are animated.
    fn has_moving_weights(&self, node: &Node, mesh: usize) -> bool {
        self.pose.node_weights(node.index).or(self.pose.mesh_weights(mesh)).is_some()
    }

    /// The morph target weights of a node in the pose (its own, else those of its mesh), without trailing zeros.
    fn weights(&self, node: &Node, mesh: usize, report: &mut Report) -> Vec<f32> {
        // Invalid values become NaN, which is reported below.
        let number = |w: &Value| w.as_f64().unwrap_or(f64::NAN) as f32;
        let list = |pointer: String| {
            let list = self.doc.json.pointer(&pointer)?;
            Some(list.as_array().map_or(vec![f32::NAN], |list| list.iter().map(number).collect()))
        };
        let posed = |pose: Option<&WeightsPose>, of_file| match pose {
            Some(pose) => pose.over(of_file),
            None => of_file,
        };
        let of_mesh = || {
            let of_file = list(format!("/meshes/{mesh}/weights")).unwrap_or_default();
            posed(self.pose.mesh_weights(mesh), of_file)
        };
        let of_node = self.pose.node_weights(node.index);
        let mut weights = posed(of_node, list(format!("{}/weights", node.pointer())).unwrap_or_else(of_mesh));
        if weights.is_empty() {
            return weights;
        }
        let targets = self.doc.json.pointer(&format!("/meshes/{mesh}/primitives/0/targets"));
        let targets = targets.and_then(Value::as_array).map_or(0, Vec::len);
        let animated = of_node.and_then(WeightsPose::count);
        let count_given = animated.unwrap_or(weights.len());
        if count_given > targets || animated.is_some_and(|count| count < targets) {
            let message = format!(
                "has {count_given} weights for the {targets} morph targets of its mesh; missing ones are 0, excess ones are ignored"
            );
            report.warn(node.pointer(), ("morph-weight-count", message));
        }
        if weights.iter().any(|w| !w.is_finite()) {
            report.problem(node.pointer(), "has morph target weights that are not finite numbers");
            return Vec::new();
        }
        while weights.last() == Some(&0.0) {
            weights.pop();
        }
        weights
    }

    /// Whether there are area lights.
    pub fn has_area_lights(&self) -> bool {
        !self.area_lights.is_empty()
    }

    /// Number of meshes of the file in use.
    pub fn used_meshes(&self) -> usize {
        self.meshes_by_key.keys().map(|key| key.mesh).collect::<HashSet<_>>().len()
    }

    /// Number of materials of the file in use.
    pub fn used_materials(&self) -> usize {
        self.shared.materials.used()
    }

    /// Indices of the images that materials need.
    pub fn images(&self) -> HashSet<usize> {
        self.shared.materials.textures.images.iter().map(|need| need.index).collect()
    }

    /// Decodes the images; returns the scene and the meshes that later time samples may reuse.
    pub fn finish(self, report: &mut Report) -> (Scene, Vec<StaticMesh>) {
        let SceneBuilder { mut scene, shared, doc, meshes_by_key, area_lights, .. } = self;
        let needs = &shared.materials.textures.images;
        let further = &needs[shared.images.len()..];
        let (further, unreadable) = report.lasting(|report| textures::read_textures(doc, further, report));
        shared.images.extend(further);
        shared.add_unreadable_images(unreadable);
        scene.images = shared.images.clone();
        shared.materials.resolve_glass(&mut scene, doc.options.glass, report);
        scene.materials = shared.materials.list.clone();
        scene.textures = shared.materials.textures.list.clone();
        area_lights.into_iter().for_each(|light| light.add_to(&mut scene));
        let static_meshes = meshes_by_key.into_iter().filter(|(key, _)| key.is_static());
        (scene, static_meshes.map(|(key, meshes)| StaticMesh { mesh: key.mesh, meshes }).collect())
    }
}

/// Assets read once for all time samples. Lists only grow, so that ids stay valid.
#[derive(Default)]
pub(super) struct SharedAssets {
    /// The materials and textures read so far.
    pub materials: Materials,
    /// Images, in the order of `materials.textures.images`.
    pub images: Vec<Image>,
    /// Meshes without skin or morph targets, by index in the file; absent while a scene owns them.
    pub static_meshes: HashMap<usize, Vec<Mesh>>,
    /// The profiles of EXT_lights_ies read so far.
    pub profiles: Profiles,
    /// The equirectangular image of EXT_lights_image_based, once read.
    pub environment_image: Option<Valid<Image>>,
    /// Materials refer to images that could not be decoded.
    has_unreadable_images: bool,
}

/// Scene meshes of a mesh of the file without skin or morph targets.
pub(super) struct StaticMesh {
    /// Index in the file.
    pub mesh: usize,
    /// Consecutive ids in the scene.
    pub meshes: Vec<MeshId>,
}

impl SharedAssets {
    /// Registers images that can't be decoded: index and message.
    pub fn add_unreadable_images(&mut self, unreadable: Vec<(usize, String)>) {
        self.has_unreadable_images |= !unreadable.is_empty();
        self.materials.textures.unreadable.extend(unreadable);
    }

    /// Drops the materials if any refers to images that can't be decoded; true if the scene must be read again.
    pub fn forget_unreadable_images(&mut self) -> bool {
        let has_unreadable = std::mem::take(&mut self.has_unreadable_images);
        if has_unreadable {
            self.forget_materials();
        }
        has_unreadable
    }

    /// Drops the materials and the meshes, which refer to them by index. Decoded images are kept.
    pub fn forget_materials(&mut self) {
        self.materials.forget();
        self.static_meshes.clear();
    }

    /// Moves static meshes from a finished scene back into the cache.
    pub fn take_back(&mut self, scene: &mut Scene, static_meshes: Vec<StaticMesh>) {
        for StaticMesh { mesh, meshes } in static_meshes {
            let taken = meshes.iter().map(|id| scene.meshes.get_mut(id.index()).map(std::mem::take));
            if let Some(taken) = taken.collect() {
                self.static_meshes.insert(mesh, taken);
            }
        }
    }
}
