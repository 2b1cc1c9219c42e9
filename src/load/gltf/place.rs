//! Puts what the nodes show into the scene: meshes, each shape once, cameras and lights.

use super::animation::{Pose, WeightsPose};
use super::document::Document;
use super::lights::{AreaLight, Profiles};
use super::materials::Materials;
use super::meshes::{MeshReader, Skipped};
use super::nodes::{Family, Hierarchy, Node};
use super::report::{Report, Sound};
use super::vertices::{Deformation, SkinPose};
use super::{lights, textures, vertices};
use crate::image::Image;
use crate::math::DAffine3;
use crate::scene::{Instance, Mesh, MeshId, Motion, Scene};
use serde_json::Value;
use std::collections::{HashMap, HashSet};

/// What makes two placed meshes the same mesh of the scene.
#[derive(PartialEq, Eq, Hash)]
struct Shape {
    mesh: usize,
    /// Weights of morph targets, as bits.
    weights: Vec<u32>,
    /// The skin, and the node whose transform holds for what the skin doesn't move.
    skin: Option<(usize, usize)>,
    /// The node with weights of its own at other moments.
    changing: Option<usize>,
}

impl Shape {
    /// Does it look the same at all moments?
    fn is_still(&self) -> bool {
        self.weights.is_empty() && self.skin.is_none() && self.changing.is_none()
    }
}

/// The scene being put together.
pub(super) struct Builder<'b, 'a> {
    doc: &'b Document<'a>,
    pose: &'b Pose,
    family: &'b Family<'b, 'a>,
    scene: Scene,
    kept: &'b mut Kept,
    /// Other moments of the scene are to be compared with this one.
    is_one_of_many: bool,
    shapes: HashMap<Shape, Vec<MeshId>>,
    /// Lights with a surface, whose materials come after all others.
    area_lights: Vec<AreaLight>,
}

impl<'b, 'a> Builder<'b, 'a> {
    /// An empty scene.
    pub fn new(
        doc: &'b Document<'a>,
        pose: &'b Pose,
        family: &'b Family<'b, 'a>,
        kept: &'b mut Kept,
    ) -> Builder<'b, 'a> {
        let (scene, shapes, area_lights) = (Scene::default(), HashMap::new(), Vec::new());
        Builder { doc, pose, family, scene, kept, is_one_of_many: false, shapes, area_lights }
    }

    /// The same for one of the moments of a shutter, in all of which nodes whose morph targets are animated have meshes of their own.
    pub fn one_of_many(self, is_one_of_many: bool) -> Builder<'b, 'a> {
        Builder { is_one_of_many, ..self }
    }

    /// Adds what all nodes show. What is wrong with one doesn't concern the others.
    pub fn add(&mut self, hierarchy: &Hierarchy, report: &mut Report) {
        for (entry, node) in hierarchy.nodes.iter().enumerate() {
            if let Some(mesh) = node.mesh {
                let _: Sound<()> = self.add_mesh(hierarchy, entry, node, mesh, report);
            }
            if let Some(index) = node.camera {
                self.scene.cameras.extend(lights::camera(self.doc, node, index, report));
            }
            if let Some(index) = node.light {
                self.scene.lights.extend(lights::punctual_light(self.doc, node, index, report));
            }
            self.scene.portals.extend(lights::portal(self.doc, node, report));
            if let Some(light) = lights::ies_light(self.doc, node, &mut self.kept.profiles, report) {
                self.scene.lights.extend(light);
            }
            let may_move = self.is_one_of_many && node.moves;
            self.area_lights.extend(lights::area_light(self.doc, node, may_move, report));
        }
        let punctual = self.scene.lights.iter().filter(|light| light.profile.is_none()).count();
        lights::note_units(self.doc, punctual + self.area_lights.len(), report);
        self.kept.skipped.warn(report);
    }

    fn add_mesh(
        &mut self,
        hierarchy: &Hierarchy,
        entry: usize,
        node: &Node,
        mesh: usize,
        report: &mut Report,
    ) -> Sound<()> {
        let skin = match node.skin {
            Some(index) => {
                let from = format!("{}/skin", node.pointer());
                let world = node.world_from_node;
                Some(vertices::skin_pose(self.doc, index, &from, world, self.family, report)?)
            }
            None if node.world_from_node.matrix3.determinant() == 0.0 => {
                return Err(report
                    .warn(node.pointer(), "flattens its mesh to nothing (a scale of 0); it is left out"));
            }
            None => None,
        };
        let weights = self.weights(node, mesh, report);
        let meshes = self.meshes(node, mesh, &weights, skin.as_ref(), report);
        let placements = match (&skin, &node.instances) {
            (Some(skin), instances) => {
                if instances.is_some() {
                    report.warn(
                        node.pointer(),
                        "has a skin and instances; instances of skinned meshes are one",
                    );
                }
                vec![DAffine3::from_translation(skin.origin)]
            }
            (None, None) => vec![node.world_from_node],
            (None, Some(instances)) => instances.iter().map(|i| node.world_from_node * *i).collect(),
        };
        let name = hierarchy.path(self.doc, entry);
        let motion = self.motion(node, mesh);
        let raw = self.doc.json.pointer(&node.pointer());
        let traits = raw.map(|raw| lights::object_traits(raw, &node.pointer(), report)).unwrap_or_default();
        let group = raw.and_then(|raw| lights::light_group(raw, &node.pointer(), report));
        for (i, &world_from_object) in placements.iter().enumerate() {
            for &mesh in &meshes {
                let name = if node.instances.is_some() { format!("{name}/{i}") } else { name.clone() };
                let (light_group, placed) = (group.clone(), Instance::new(mesh, world_from_object));
                self.scene.instances.push(Instance { name, motion, traits, light_group, ..placed });
            }
        }
        Ok(())
    }

    /// The meshes of the scene for a mesh of the file in a shape; read when first asked for.
    fn meshes(
        &mut self,
        node: &Node,
        mesh: usize,
        weights: &[f32],
        skin: Option<&SkinPose>,
        report: &mut Report,
    ) -> Vec<MeshId> {
        let shape = Shape {
            mesh,
            weights: weights.iter().map(|w| w.to_bits()).collect(),
            skin: node.skin.map(|skin| (skin, node.index)),
            changing: (self.is_one_of_many && self.has_moving_weights(node, mesh)).then_some(node.index),
        };
        if let Some(known) = self.shapes.get(&shape) {
            return known.clone();
        }
        let Kept { materials, skipped, still, .. } = &mut *self.kept;
        let (doc, from) = (self.doc, format!("{}/mesh", node.pointer()));
        let mut read = |report: &mut Report| {
            let deformation = Deformation { weights, skin };
            MeshReader { doc, materials, skipped, report, deformation }.read(mesh, &from)
        };
        let read = match shape.is_still() {
            true => still.remove(&mesh).unwrap_or_else(|| report.lasting(read)),
            false => read(report),
        };
        let first = self.scene.meshes.len() as u32;
        self.scene.meshes.extend(read);
        let ids: Vec<MeshId> = (first..self.scene.meshes.len() as u32).map(MeshId).collect();
        self.shapes.insert(shape, ids.clone());
        ids
    }

    /// What other moments make of a node's mesh.
    fn motion(&self, node: &Node, mesh: usize) -> Motion {
        if self.has_moving_weights(node, mesh) || node.skin.is_some() && self.pose.animations > 0 {
            Motion::Deforms
        } else if node.moves {
            Motion::Moves
        } else {
            Motion::Still
        }
    }

    /// Does an animation change the weights of a node's morph targets?
    fn has_moving_weights(&self, node: &Node, mesh: usize) -> bool {
        self.pose.node_weights(node.index).or(self.pose.mesh_weights(mesh)).is_some()
    }

    /// The weights of a node's morph targets: its own, else its mesh's, each as animations leave them. None if all are 0.
    fn weights(&self, node: &Node, mesh: usize, report: &mut Report) -> Vec<f32> {
        // What is no number, or no list of them, is found below.
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
        let told = animated.unwrap_or(weights.len());
        if told > targets || animated.is_some_and(|count| count < targets) {
            let message = format!(
                "has {told} weights for the {targets} morph targets of its mesh; missing ones are 0, surplus ones are left out"
            );
            report.warn(node.pointer(), message);
        }
        if weights.iter().any(|w| !w.is_finite()) {
            report.problem(node.pointer(), "shows morph targets with weights that are not finite numbers");
            return Vec::new();
        }
        while weights.last() == Some(&0.0) {
            weights.pop();
        }
        weights
    }

    /// Are there lights with a surface?
    pub fn has_area_lights(&self) -> bool {
        !self.area_lights.is_empty()
    }

    /// How many meshes of the file are shown.
    pub fn used_meshes(&self) -> usize {
        self.shapes.keys().map(|shape| shape.mesh).collect::<HashSet<_>>().len()
    }

    /// How many materials of the file are shown.
    pub fn used_materials(&self) -> usize {
        self.kept.materials.used()
    }

    /// The images of the file that are needed.
    pub fn images(&self) -> HashSet<usize> {
        self.kept.materials.textures.images.iter().map(|need| need.index).collect()
    }

    /// Decodes the images and gives the scene, with the places in it of the meshes that can be kept.
    pub fn finish(self, report: &mut Report) -> (Scene, Vec<StillMesh>) {
        let Builder { mut scene, kept, doc, shapes, area_lights, .. } = self;
        let needs = &kept.materials.textures.images;
        let further = &needs[kept.images.len()..];
        let (further, unreadable) = report.lasting(|report| textures::read_textures(doc, further, report));
        kept.images.extend(further);
        kept.lose_textures(unreadable);
        scene.images = kept.images.clone();
        kept.materials.settle_glass(&mut scene, doc.options.glass, report);
        scene.materials = kept.materials.list.clone();
        scene.textures = kept.materials.textures.list.clone();
        area_lights.into_iter().for_each(|light| light.add_to(&mut scene));
        let still = shapes.into_iter().filter(|(shape, _)| shape.is_still());
        (scene, still.map(|(shape, meshes)| StillMesh { mesh: shape.mesh, meshes }).collect())
    }
}

// What is read once for all moments of a file: materials, images, and the meshes that nothing deforms.

/// Everything that outlives a moment. Lists only grow, so that ids stay what they are.
#[derive(Default)]
pub(super) struct Kept {
    /// The materials and textures met so far.
    pub materials: Materials,
    /// The images that they need, in the order of the needs.
    pub images: Vec<Image>,
    /// Meshes of the file, by index, without the deformation by a skin or morph targets; absent while a scene has them.
    pub still: HashMap<usize, Vec<Mesh>>,
    /// The profiles of EXT_lights_ies met so far.
    pub profiles: Profiles,
    /// The picture of EXT_lights_image_based, once it was asked for.
    pub surroundings: Option<Sound<Image>>,
    /// What the meshes left out.
    pub skipped: Skipped,
    /// Images turned out to be none: materials that have been read refer to them.
    loses_textures: bool,
}

/// Where a scene has what became of a mesh of the file that nothing deforms.
pub(super) struct StillMesh {
    /// The mesh of the file.
    pub mesh: usize,
    /// The scene's meshes, in a row.
    pub meshes: Vec<MeshId>,
}

impl Kept {
    /// These images, with what is said of them, can't be read.
    pub fn lose_textures(&mut self, unreadable: Vec<(usize, String)>) {
        self.loses_textures |= !unreadable.is_empty();
        self.materials.textures.unreadable.extend(unreadable);
    }

    /// Forgets the materials if some refer to images that can't be read; then they are to be read again, without them.
    pub fn forget_lost_textures(&mut self) -> bool {
        let loses = std::mem::take(&mut self.loses_textures);
        if loses {
            self.forget_materials();
        }
        loses
    }

    /// Forgets the materials and the meshes, which refer to them by number. Images stay decoded.
    pub fn forget_materials(&mut self) {
        self.materials.forget();
        self.still.clear();
    }

    /// Takes meshes back from a scene that is not needed any more. Where it lacks any of them, they are read again.
    pub fn take_back(&mut self, scene: &mut Scene, still: Vec<StillMesh>) {
        for StillMesh { mesh, meshes } in still {
            let taken = meshes.iter().map(|id| scene.meshes.get_mut(id.index()).map(std::mem::take));
            if let Some(taken) = taken.collect() {
                self.still.insert(mesh, taken);
            }
        }
    }
}
