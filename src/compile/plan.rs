//! Decides how each instance is compiled: merged into the world, or as a static or moving placement of a shared mesh.

use super::emitters::Shifts;
use super::fingerprint::Fingerprint;
use super::material::CompiledMaterial;
use super::objects::{ObjectMaterials, only_material, part_materials};
use super::{fingerprint, motion};
use crate::accel::TreeQuality;
use crate::error::Warning;
use crate::math::{DAffine3, DMat3, DVec3, TransformKeys};
use crate::scene::{Instance, MaterialId, Mesh, MeshId, Motion, ObjectTraits, Quad, Scene, TextureId};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

/// Meshes with fewer triangles are merged: a copy costs less than the traversal of an instance.
const MIN_SHARED_TRIANGLES: usize = 1024;

/// Maximum total number of triangles of such copies, about 600 MB with their BVH; above it, smaller meshes are shared. (60,000
/// instances of meshes with 128 triangles take 132 MB instead of 1,027, and 5.7 s instead of 10.1 at 16 samples, although
/// tracing takes 4.4 s instead of 3.6.)
const MAX_COPIED_TRIANGLES: usize = 1 << 22;

/// Meshes with fewer triangles are never shared: copies take less memory than placements.
const MIN_INSTANCED_TRIANGLES: usize = 8;

/// Maximum condition number of the linear transform of a placement; other instances are merged. Rays transformed to object
/// space in single precision lose that much precision.
const MAX_SHARED_CONDITION: f64 = 1e3;

/// Frames of a sequence with fewer visible triangles are compiled from scratch: this takes milliseconds, and traversal is
/// faster without instances.
const MIN_KEPT_TRIANGLES: usize = 1 << 16;

/// Maximum number of triangles of all instances of an emissive mesh for light sampling, which needs copies: about 1 GB with the lights.
const MAX_COPIED_EMITTERS: usize = 1 << 22;

/// How an instance is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum InstanceMode {
    /// Its triangles are copied into the world.
    Merged,
    /// A static placement of a shared mesh.
    Shared,
    /// A moving placement, or one of a deforming mesh.
    Moving,
}

/// A visible instance and how it is compiled.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlannedInstance {
    /// Index in the scene.
    pub index: usize,
    pub mode: InstanceMode,
    /// Transform, relative to the anchor.
    pub world_from_object: DAffine3,
    /// Index into [`Plan::meshes`], unless merged.
    pub geometry: usize,
    /// Index into [`Plan::motions`] of its motion while the shutter is open.
    pub motion: Option<u32>,
}

/// All visible instances, in the scene's order.
#[derive(Debug, Default)]
pub(super) struct Plan {
    /// The visible instances.
    pub instances: Vec<PlannedInstance>,
    /// Shared meshes, by index in the scene; deforming ones last.
    pub meshes: Vec<usize>,
    /// Traits of the objects of each shared mesh, for its materials.
    pub mesh_traits: Vec<ObjectTraits>,
    /// Index of the first deforming mesh in `meshes`.
    pub first_deforming: usize,
    /// Motion of instances while the shutter is open.
    pub motions: Vec<TransformKeys>,
    /// Keep texture coordinates that no material uses.
    pub keeps_uv: bool,
    /// Names of the vertex attributes that node graphs read, by index.
    pub attributes: Arc<[String]>,
    /// Material indices of objects.
    pub object_materials: ObjectMaterials,
    /// Emissive meshes with too many instances for light sampling.
    pub unsampled: HashSet<MeshId>,
    /// By mesh: must its triangles be flipped? Empty if none must.
    pub inside_out: Vec<bool>,
    /// Offsets of flat lights that are coplanar with other surfaces.
    pub shifts: Shifts,
    /// Keys for the reuse of geometry by other frames; `None` if nothing is reused.
    pub keys: Option<GeometryKeys>,
}

/// Fingerprints of the inputs of geometry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct GeometryKeys {
    /// Shared meshes without deformation.
    pub shared: Vec<Fingerprint>,
    /// The world and all static placements.
    pub world: Fingerprint,
}

/// Makes the plan. Invisible instances are omitted and reported.
pub(super) fn plan(
    (scene, object_materials, attributes): (&Scene, ObjectMaterials, Arc<[String]>),
    materials: &[CompiledMaterial],
    origin: DVec3,
    is_sequence: bool,
    warnings: &mut Vec<Warning>,
    left_out: &mut Vec<String>,
) -> Plan {
    let uses = count_uses(scene);
    let min_shared = min_shared_triangles(scene, &uses);
    let is_hidden = |id: MaterialId| materials[id.index()].is_invisible();
    let is_visible = |i: &&Instance| !part_materials(&scene.meshes[i.mesh.index()], i).all(is_hidden);
    let triangles =
        || scene.instances.iter().filter(is_visible).map(|i| scene.meshes[i.mesh.index()].triangles.len());
    let keeps_geometry = is_sequence && triangles().sum::<usize>() >= MIN_KEPT_TRIANGLES;
    let mut plan = Plan { object_materials, attributes, ..Plan::default() };
    let mut invisible = 0;
    for (index, instance) in scene.instances.iter().enumerate() {
        if !is_visible(&instance) {
            invisible += 1;
            continue;
        }
        let world_from_object = moved(&instance.world_from_object, origin);
        if !is_usable(instance, &world_from_object.matrix3, warnings) {
            continue;
        }
        let mesh = &scene.meshes[instance.mesh.index()];
        let emits = part_materials(mesh, instance).any(|m| materials[m.index()].emission.is_some());
        let is_shared = uses[instance.mesh.index()] > 1 && mesh.triangles.len() >= min_shared;
        let copied = mesh.triangles.len().saturating_mul(uses[instance.mesh.index()]);
        let too_many = is_shared && copied > MAX_COPIED_EMITTERS;
        if emits && too_many && plan.unsampled.insert(instance.mesh) {
            warnings.push(Warning::general(unsampled_message(mesh, uses[instance.mesh.index()])));
        }
        let is_flat = condition(&world_from_object.matrix3) > MAX_SHARED_CONDITION;
        let can_be_placed = (!emits || too_many) && !is_flat;
        let motion = plan.add_motion(motion::keys(scene, instance, origin));
        let mode = match instance.motion {
            Motion::Keyed(_) if motion.is_some() || motion::deforms(scene, instance.mesh) => {
                InstanceMode::Moving
            }
            Motion::Moves | Motion::Deforms | Motion::Keyed(_) if keeps_geometry && can_be_placed => {
                InstanceMode::Moving
            }
            _ if is_shared && can_be_placed || mesh.splats.is_some() => InstanceMode::Shared,
            _ => InstanceMode::Merged,
        };
        plan.instances.push(PlannedInstance { index, mode, world_from_object, geometry: 0, motion });
    }
    if invisible > 0 {
        left_out.push(format!("{invisible} instances whose materials are fully transparent"));
    }
    plan.number_meshes(scene);
    plan.report(scene, &uses, left_out);
    if keeps_geometry {
        plan.keys = Some(plan.keys_of(scene, materials, origin));
    }
    plan
}

impl Plan {
    pub fn is_inside_out(&self, mesh: MeshId) -> bool {
        self.inside_out.get(mesh.index()).is_some_and(|&is| is)
    }

    /// Adds the motion of an instance; gives its index.
    fn add_motion(&mut self, keys: Option<TransformKeys>) -> Option<u32> {
        self.motions.push(keys?);
        Some(self.motions.len() as u32 - 1)
    }

    /// Assigns an index to each shared mesh, deforming ones last.
    fn number_meshes(&mut self, scene: &Scene) {
        for is_deforming in [false, true] {
            let mut indices: HashMap<(usize, ObjectTraits), usize> = HashMap::new();
            for planned in self.instances.iter_mut().filter(|s| s.mode != InstanceMode::Merged) {
                let instance = &scene.instances[planned.index];
                let deforms = instance.motion == Motion::Deforms || motion::changes(scene, instance.mesh);
                let changes = planned.mode == InstanceMode::Moving && deforms;
                if changes == is_deforming {
                    let next = self.meshes.len();
                    let traits = mesh_traits(instance, &scene.meshes[instance.mesh.index()]);
                    planned.geometry = *indices.entry((instance.mesh.index(), traits)).or_insert(next);
                    if planned.geometry == next {
                        self.meshes.push(instance.mesh.index());
                        self.mesh_traits.push(traits);
                    }
                }
            }
            if !is_deforming {
                self.first_deforming = self.meshes.len();
            }
        }
    }

    fn report(&self, scene: &Scene, uses: &[usize], left_out: &mut Vec<String>) {
        let unused = || scene.meshes.iter().zip(uses).filter(|&(_, &n)| n == 0).map(|(mesh, _)| mesh);
        if unused().next().is_some() {
            let triangles: usize = unused().map(|m| m.triangles.len()).sum();
            left_out.push(format!("{} meshes without instances ({triangles} triangles)", unused().count()));
        }
        let mut placements = vec![0; scene.meshes.len()];
        for planned in self.instances.iter().filter(|s| s.mode != InstanceMode::Merged) {
            placements[scene.instances[planned.index].mesh.index()] += 1;
        }
        for (mesh, placed) in scene.meshes.iter().zip(placements).filter(|(_, placed)| *placed > 1) {
            let (n, copies) = (mesh.triangles.len(), placed - 1);
            let name = &mesh.name;
            left_out.push(format!(
                "{copies} copies of mesh '{name}' ({n} triangles): its instances share a single copy"
            ));
        }
    }

    /// Index of the material that overrides those of a placement's mesh.
    pub fn material_of(&self, instance: &Instance, mesh: &Mesh) -> Option<u32> {
        let of_traits =
            || (instance.traits != ObjectTraits::default()).then(|| only_material(mesh)).flatten();
        instance.material.or_else(of_traits).map(|id| self.object_materials.index_of(id, &instance.traits))
    }

    fn keys_of(&self, scene: &Scene, materials: &[CompiledMaterial], origin: DVec3) -> GeometryKeys {
        let normal_sets: Vec<Option<usize>> = (0..scene.materials.len())
            .map(|m| normal_map_set([MaterialId(m as u32)].into_iter(), scene))
            .collect();
        let of_materials = fingerprint::of_materials(&materials[..scene.materials.len()], &normal_sets);
        let named = |sum: Fingerprint, name: &String| sum.with_all(name.as_bytes());
        let of_materials = self.attributes.iter().fold(of_materials, named);
        let mut is_used = vec![false; scene.meshes.len()];
        let is_merged = |s: &&PlannedInstance| s.mode == InstanceMode::Merged;
        let copied = self.instances.iter().filter(is_merged).map(|s| scene.instances[s.index].mesh.index());
        copied.chain(self.meshes[..self.first_deforming].iter().copied()).for_each(|m| is_used[m] = true);
        let of_meshes: Vec<Fingerprint> = (scene.meshes.par_iter().zip(&is_used))
            .map(|(mesh, used)| if *used { fingerprint::of_mesh(mesh) } else { Fingerprint::START })
            .collect();
        let shared = self.meshes[..self.first_deforming]
            .iter()
            .zip(&self.mesh_traits)
            .map(|(&m, traits)| {
                let used = scene.meshes[m]
                    .parts
                    .iter()
                    .map(|part| self.object_materials.index_of(part.material, traits));
                let sum = of_materials.with_fingerprint(of_meshes[m]);
                if self.object_materials.has_no_copies() {
                    sum
                } else {
                    used.fold(sum, |sum, n| sum.with(u64::from(n)))
                }
            })
            .collect();
        let mut world = of_materials.with_vector(origin);
        for planned in self.instances.iter().filter(|s| s.mode != InstanceMode::Moving) {
            let instance = &scene.instances[planned.index];
            let mesh = &scene.meshes[instance.mesh.index()];
            let number = |id| u64::from(self.object_materials.index_of(id, &instance.traits));
            world = world
                .with(planned.index as u64)
                .with(planned.geometry as u64)
                .with(u64::from(planned.mode == InstanceMode::Merged))
                .with(instance.material.map_or(u64::MAX, number))
                .with_transform(&planned.world_from_object)
                .with_fingerprint(of_meshes[instance.mesh.index()]);
            if !self.object_materials.has_no_copies() {
                world = mesh.parts.iter().fold(world, |sum, part| sum.with(number(part.material)));
            }
        }
        let quads =
            scene.quads.iter().map(|quad| self.object_materials.index_of(quad.material, &quad.traits));
        let shapes =
            scene.shapes.iter().map(|shape| self.object_materials.index_of(shape.material, &shape.traits));
        let curves = scene.curves.iter().map(|c| self.object_materials.index_of(c.material, &c.traits));
        world = quads.chain(shapes).chain(curves).fold(world, |sum, number| sum.with(u64::from(number)));
        GeometryKeys { shared, world: with_shapes(world, scene) }
    }
}

/// The traits for the materials of a placement's mesh: the default if the placement has its own material.
fn mesh_traits(instance: &Instance, mesh: &Mesh) -> ObjectTraits {
    let has_one = instance.material.is_some() || only_material(mesh).is_some();
    if has_one { ObjectTraits::default() } else { instance.traits }
}

/// Appends the quads, shapes and curves of a scene.
fn with_shapes(mut sum: Fingerprint, scene: &Scene) -> Fingerprint {
    for quad in &scene.quads {
        sum = sum.with_vector(quad.corner).with_vector(quad.edge_u).with_vector(quad.edge_v);
        sum = sum.with(u64::from(quad.material.0));
    }
    for shape in &scene.shapes {
        let rotation = shape.rotation.to_array();
        sum = sum.with_vector(shape.center).with(shape.radius.to_bits()).with(shape.kind as u64);
        sum = rotation.into_iter().fold(sum, |sum, x| sum.with(x.to_bits()));
        sum = sum.with(u64::from(shape.material.0));
    }
    sum = scene.curves.iter().fold(sum, |sum, curves| sum.with_fingerprint(fingerprint::of_curves(curves)));
    sum.with(scene.quads.len() as u64).with(scene.instances.len() as u64)
}

/// Is a transform invertible? Warns of singular and nearly singular ones.
fn is_usable(instance: &Instance, linear: &DMat3, warnings: &mut Vec<Warning>) -> bool {
    let message = if !is_invertible(linear) {
        "its transform is singular or not finite; it was dropped"
    } else if orthogonality(linear) < NEARLY_SINGULAR {
        "its transform is nearly singular; its positions and normals are imprecise"
    } else {
        return true;
    };
    warnings.push(Warning { place: instance.name.clone(), ..Warning::general(message) });
    is_invertible(linear)
}

/// The warning about an emissive mesh with too many instances for light sampling.
fn unsampled_message(mesh: &Mesh, instances: usize) -> (&'static str, String) {
    let (name, triangles) = (&mesh.name, mesh.triangles.len());
    let message = format!(
        "mesh '{name}' emits light and has {instances} instances of {triangles} triangles, too many for light sampling: its \
         light is only found by BSDF samples, with more noise"
    );
    ("emitters-unsampled", message)
}

fn count_uses(scene: &Scene) -> Vec<usize> {
    let mut uses = vec![0; scene.meshes.len()];
    for instance in &scene.instances {
        uses[instance.mesh.index()] += 1;
    }
    uses
}

/// Minimum number of triangles of meshes to be shared.
fn min_shared_triangles(scene: &Scene, uses: &[usize]) -> usize {
    let mut copied: BTreeMap<usize, usize> = BTreeMap::new();
    for (mesh, &uses) in scene.meshes.iter().zip(uses).filter(|&(_, &uses)| uses > 1) {
        *copied.entry(mesh.triangles.len()).or_default() += mesh.triangles.len().saturating_mul(uses);
    }
    let mut min = MIN_SHARED_TRIANGLES;
    let too_many =
        |min| copied.range(..min).fold(0usize, |sum, (_, n)| sum.saturating_add(*n)) > MAX_COPIED_TRIANGLES;
    while min > MIN_INSTANCED_TRIANGLES && too_many(min) {
        min /= 2;
    }
    min
}

fn moved(world_from_object: &DAffine3, origin: DVec3) -> DAffine3 {
    DAffine3 { translation: world_from_object.translation - origin, ..*world_from_object }
}

fn is_invertible(m: &DMat3) -> bool {
    // Rounding of a singular matrix leaves about 1e-16.
    m.determinant().is_finite() && orthogonality(m) > 1e-14
}

/// [`orthogonality`] below which there is a warning.
const NEARLY_SINGULAR: f64 = 1e-6;

/// The determinant relative to the product of the axes' lengths: 1 for orthogonal axes, 0 for coplanar ones.
fn orthogonality(m: &DMat3) -> f64 {
    m.determinant().abs() / (m.x_axis.length() * m.y_axis.length() * m.z_axis.length())
}

/// The condition number of a matrix in the Frobenius norm over its minimum 3: 1 for rotations and uniform scales.
fn condition(m: &DMat3) -> f64 {
    let norm = |m: &DMat3| DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length()).length();
    norm(m) * norm(&m.inverse()) / 3.0
}

/// The UV set of the first normal map among materials; 0 if a node graph reads tangents.
pub(super) fn normal_map_set(
    mut used: impl Iterator<Item = MaterialId> + Clone,
    scene: &Scene,
) -> Option<usize> {
    use crate::scene::{Mapping, Texture};
    let of_graph = |id: TextureId| match scene.textures.get(id.index()) {
        Some(Texture::Nodes(graph)) => graph.reads_tangents(),
        _ => false,
    };
    let mut textures = used.clone().flat_map(|id| scene.materials[id.index()].textures());
    if textures.any(of_graph) {
        return Some(0);
    }
    let map = used.find_map(|id| scene.materials[id.index()].normal_map)?;
    match scene.textures.get(map.texture.index())? {
        Texture::Image { mapping: Mapping::Uv { set, .. }, .. } => Some(*set as usize),
        _ => None,
    }
}

// Degenerate primitives of the scene description, as opposed to those that become degenerate in single precision.

/// Edges shorter than this fraction of the longest edge count as zero, for rounding of equal corners.
const ROUNDING: f64 = 4.0 * f32::EPSILON as f64;

/// The number of degenerate primitives that a plan builds.
pub(super) fn count_degenerate(scene: &Scene, plan: &Plan) -> u64 {
    let copied = plan.instances.iter().filter(|planned| planned.mode == InstanceMode::Merged);
    let copied = copied.map(|planned| scene.instances[planned.index].mesh.index());
    let mut counts: Vec<Option<u64>> = vec![None; scene.meshes.len()];
    let of_meshes: u64 = copied
        .chain(plan.meshes.iter().copied())
        .map(|mesh| *counts[mesh].get_or_insert_with(|| triangles(&scene.meshes[mesh])))
        .sum();
    let round = scene.shapes.iter().filter(|shape| shape.radius <= 0.0).count() as u64;
    of_meshes + round + scene.quads.iter().filter(|quad| is_flat(quad)).count() as u64
}

/// The number of degenerate triangles of a mesh, as at the poles of a tessellated sphere.
fn triangles(mesh: &Mesh) -> u64 {
    let at = |i: u32| mesh.positions.get(i as usize).map_or(DVec3::NAN, |p| DVec3::from(p.map(f64::from)));
    let is_flat = |&&[a, b, c]: &&[u32; 3]| {
        let [a, b, c] = [at(a), at(b), at(c)];
        let edges = [a.distance(b), b.distance(c), c.distance(a)];
        let (shortest, longest) =
            edges.iter().fold((f64::INFINITY, 0.0f64), |(s, l), &e| (s.min(e), l.max(e)));
        shortest <= ROUNDING * longest
    };
    mesh.triangles.iter().filter(is_flat).count() as u64
}

/// Is a quad degenerate?
fn is_flat(quad: &Quad) -> bool {
    let Quad { edge_u: u, edge_v: v, .. } = *quad;
    u == DVec3::ZERO || v == DVec3::ZERO
}

/// How the build quality of the BVH ([`TreeQuality`]) is chosen. Pictures don't depend on it: a full build takes longer and makes
/// traversal faster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BvhPolicy {
    /// The fastest build.
    Fast,
    /// The fastest traversal.
    #[default]
    Full,
    /// The quality with the lower total time, estimated from the numbers of camera rays and triangles, so that a command always
    /// builds the same tree.
    For {
        /// Number of camera rays: pixels times samples.
        camera_rays: u64,
    },
}

/// Scenes with fewer triangles get full builds, which take less than a third of a second.
const MIN_FAST_BUILD_TRIANGLES: u64 = 1 << 17;

/// Camera rays per triangle above which a full build pays. (Measured: see the README of `tools/rays`.)
const CAMERA_RAYS_PER_TRIANGLE: u64 = 4;

impl BvhPolicy {
    /// The quality for a number of triangles.
    pub fn quality(self, triangles: u64) -> TreeQuality {
        match self {
            BvhPolicy::Fast => TreeQuality::Fast,
            BvhPolicy::For { camera_rays }
                if triangles >= MIN_FAST_BUILD_TRIANGLES
                    && camera_rays < triangles.saturating_mul(CAMERA_RAYS_PER_TRIANGLE) =>
            {
                TreeQuality::Fast
            }
            _ => TreeQuality::Full,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_rays_for_many_triangles_get_a_fast_build() {
        let quality = |camera_rays, triangles| BvhPolicy::For { camera_rays }.quality(triangles);
        assert_eq!(quality(1, 100_000), TreeQuality::Full);
        assert_eq!(quality(7_999_999, 2_000_000), TreeQuality::Fast);
        assert_eq!(quality(8_000_000, 2_000_000), TreeQuality::Full);
        assert_eq!(quality(u64::MAX, u64::MAX), TreeQuality::Full);
        assert_eq!(BvhPolicy::Fast.quality(1), TreeQuality::Fast);
        assert_eq!(BvhPolicy::default().quality(u64::MAX), TreeQuality::Full);
    }

    #[test]
    fn small_meshes_are_shared_if_copies_need_too_much_memory() {
        let mut scene = Scene::default();
        let mesh_of = |n: usize| Mesh { triangles: vec![[0; 3]; n], ..Mesh::default() };
        scene.meshes = vec![mesh_of(1000), mesh_of(200), mesh_of(12), mesh_of(4)];
        let min_triangles = |uses: [usize; 4]| min_shared_triangles(&scene, &uses);
        assert_eq!(min_triangles([4000, 900, 1, 0]), MIN_SHARED_TRIANGLES, "4.18 million");
        assert_eq!(min_triangles([4000, 1000, 1, 0]), 512, "4.2 million");
        assert_eq!(min_triangles([0, 21_000, 1, 0]), 128);
        assert_eq!(min_triangles([1, 1, 1_000_000, 1]), 8);
        assert_eq!(min_triangles([1, 1, 1, 2_000_000]), MIN_INSTANCED_TRIANGLES, "left as copies");
    }
}
