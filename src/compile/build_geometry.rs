//! Builds the geometry that a [`Plan`] describes: the world with merged meshes, and a separate space for each shared (instanced) mesh.

use super::geometry::{Attributes, Geometries, Placement, Space, Transform};
use super::material::CompiledMaterial;
use super::motion;
use super::motion::{MovingShape, moving_shapes};
use super::objects::{ObjectId, ObjectIds, Owners, part_materials};
use super::plan::{InstanceMode, Plan, PlannedInstance, normal_map_set};
use crate::accel;
use crate::accel::{AccelInstance, MovingInstance};
use crate::error::Result;
use crate::math::{Bounds3, DAffine3, DVec3, Mat3, Vec3, normal_matrix, poly};
use crate::scene::{Keyframes, MaterialId, Mesh, Scene, Splats};
use crate::shape::{Analytic, CurveSegments, Quad, Shape as _, SplatCloud};
use crate::simd::reserve_on_huge_pages;
use crate::texture::AttributeList;
use bevy_mikktspace::{Geometry, Ops, TangentSpace, generate_tangents};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// The geometry of a scene, and the instances for its BVH.
#[derive(Debug)]
pub(super) struct SceneGeometry {
    pub geometries: Geometries,
    /// Instances, in the order of the placements.
    pub instances: Vec<AccelInstance>,
    /// Index of the first moving instance.
    pub first_moving: usize,
    /// Motion of the instances that move while the shutter is open.
    pub moving: Vec<MovingInstance>,
}

/// Geometry of an earlier frame to be reused.
#[derive(Debug, Default)]
pub(super) struct ReusedSpaces {
    pub world: Option<Arc<Space>>,
    /// Shared meshes without deformation; all or none.
    pub shared: Vec<Arc<Space>>,
}

/// The attributes of a mesh that materials need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct AttributeNeeds {
    normals: bool,
    uv: [bool; 2],
    tangents: bool,
    colors: bool,
    attributes: bool,
}

/// Builds the geometry of a scene, relative to `origin` (world space).
///
/// # Errors
/// If the points of subdivided curves exceed 32-bit indices.
pub(super) fn build_geometry(
    scene: &Scene,
    materials: &[CompiledMaterial],
    origin: DVec3,
    plan: &Plan,
    reused: ReusedSpaces,
) -> Result<SceneGeometry> {
    let object_ids = ObjectIds::of(scene);
    let mut shared: Vec<Option<Arc<Space>>> = reused.shared.into_iter().map(Some).collect();
    shared.resize(plan.meshes.len(), None);
    let missing = missing_instances(plan, reused.world.is_some(), &shared);
    let tangents = tangents(scene, &missing);
    let mesh = |planned: &PlannedInstance| {
        let id = scene.instances[planned.index].mesh;
        let with_tangents = tangents.get(&id.index()).filter(|(first, _)| *first <= planned.index);
        with_tangents.map_or(&scene.meshes[id.index()], |(_, mesh)| mesh)
    };
    let of_shared = AttributeNeeds::of_shared(materials, plan.keeps_uv);
    let spaces = missing.par_iter().filter(|planned| planned.mode != InstanceMode::Merged).map(|planned| {
        let id = scene.instances[planned.index].mesh;
        let material_index =
            |id: MaterialId| plan.object_materials.index_of(id, &plan.mesh_traits[planned.geometry]);
        let mut space = shared_space(
            (mesh(planned), plan.is_inside_out(id)),
            material_index,
            (of_shared, &plan.attributes),
        );
        if planned.mode == InstanceMode::Moving {
            space.set_keys(scene, id);
        }
        (planned.geometry, Arc::new(space))
    });
    for (geometry, space) in spaces.collect::<Vec<_>>() {
        shared[geometry] = Some(space);
    }
    let world = match reused.world {
        Some(world) => world,
        None => Arc::new(build_world(scene, materials, (origin, &object_ids), plan, (&missing, mesh))?),
    };
    let shared = shared.into_iter().flatten().collect();
    let motions = plan.motions.clone();
    let geometries = Geometries { world, shared, placements: Vec::new(), motions, moves: false };
    let static_geometry = place(scene, plan, &object_ids, geometries);
    Ok(add_moving_shapes(static_geometry, scene, materials, (origin, &object_ids), plan))
}

/// The world: all merged instances, static shapes and curves. `mesh`: the mesh of an instance, with tangents.
fn build_world<'m>(
    scene: &Scene,
    materials: &[CompiledMaterial],
    (origin, object_ids): (DVec3, &ObjectIds),
    plan: &Plan,
    (planned, mesh): (&[&PlannedInstance], impl Fn(&PlannedInstance) -> &'m Mesh),
) -> Result<Space> {
    let mut world = Space::EMPTY;
    let is_hidden = |id: MaterialId| materials[id.index()].is_invisible();
    for planned in planned.iter().filter(|planned| planned.mode == InstanceMode::Merged) {
        let (instance, mesh) = (&scene.instances[planned.index], mesh(planned));
        let mut needs = needs_of(part_materials(mesh, instance), materials);
        needs.uv[0] |= plan.keeps_uv;
        world.owners.begin(world.shapes.triangles.len(), object_ids.instance(planned.index));
        let material_index = |id: MaterialId| plan.object_materials.index_of(id, &instance.traits);
        let placed = (&planned.world_from_object, plan.is_inside_out(instance.mesh));
        let (material, needs) = ((instance.material, material_index), (needs, &plan.attributes[..]));
        world.append(mesh, material, placed, needs, is_hidden);
    }
    world.append_shapes(scene, materials, origin, object_ids, plan);
    world.append_curves(scene, materials, origin, object_ids, &plan.object_materials)?;
    world.update_bounds();
    Ok(world)
}

/// Planned instances whose geometry must be built: all merged into the world, and the first of each shared mesh.
fn missing_instances<'a>(
    plan: &'a Plan,
    has_world: bool,
    shared: &[Option<Arc<Space>>],
) -> Vec<&'a PlannedInstance> {
    let mut exists: Vec<bool> = shared.iter().map(Option::is_some).collect();
    let is_missing = |planned: &&PlannedInstance| match planned.mode {
        InstanceMode::Merged => !has_world,
        _ => !std::mem::replace(&mut exists[planned.geometry], true),
    };
    plan.instances.iter().filter(is_missing).collect()
}

/// Meshes with generated tangents, by index, for meshes without tangents under normal maps; each with the index of the first
/// instance that uses it.
fn tangents(scene: &Scene, planned_instances: &[&PlannedInstance]) -> BTreeMap<usize, (usize, Mesh)> {
    let mut sets: BTreeMap<usize, Vec<(usize, usize)>> = BTreeMap::new();
    for planned in planned_instances {
        let instance = &scene.instances[planned.index];
        let mesh = &scene.meshes[instance.mesh.index()];
        // Tangents may split vertices, but a deforming mesh has no keys for the copies: tangents are computed at hits instead.
        if !motion::deforms(scene, instance.mesh)
            && let Some(set) = normal_map_set(part_materials(mesh, instance), scene)
        {
            let sets_of_mesh = sets.entry(instance.mesh.index()).or_default();
            if sets_of_mesh.iter().all(|(_, other)| *other != set) {
                sets_of_mesh.push((planned.index, set));
            }
        }
    }
    let generated = sets.into_par_iter().filter_map(|(mesh, sets)| {
        let with = |(first, set)| Some((first, with_tangents(&scene.meshes[mesh], set)?));
        Some((mesh, sets.into_iter().find_map(with)?))
    });
    generated.collect()
}

/// Adds the shapes that move while the shutter is open.
fn add_moving_shapes(
    mut scene_geometry: SceneGeometry,
    scene: &Scene,
    materials: &[CompiledMaterial],
    (origin, object_ids): (DVec3, &ObjectIds),
    plan: &Plan,
) -> SceneGeometry {
    let shapes = moving_shapes(scene, materials, origin, object_ids, (&plan.object_materials, plan.keeps_uv));
    shapes.into_iter().for_each(|shape| scene_geometry.add_shape(shape));
    scene_geometry.moving = moving(&scene_geometry.geometries);
    scene_geometry.geometries.moves = scene_geometry.geometries.placements.iter().any(|p| p.moves);
    scene_geometry
}

/// The motion of placements that move while the shutter is open.
fn moving(geometries: &Geometries) -> Vec<MovingInstance> {
    let keys = |(instance, p): (usize, &Placement)| {
        Some(MovingInstance { instance, keys: geometries.motions[p.motion? as usize].clone() })
    };
    geometries.placements.iter().enumerate().filter_map(keys).collect()
}

/// Adds the placements of shared meshes: static ones, then moving ones.
fn place(scene: &Scene, plan: &Plan, object_ids: &ObjectIds, mut geometries: Geometries) -> SceneGeometry {
    let (mut instances, mut first_moving) = (Vec::new(), 0);
    for mode in [InstanceMode::Shared, InstanceMode::Moving] {
        first_moving = instances.len();
        for planned in plan.instances.iter().filter(|s| s.mode == mode) {
            let instance = &scene.instances[planned.index];
            let material = plan.material_of(instance, &scene.meshes[instance.mesh.index()]);
            let mut placed = placement(planned, material, object_ids.instance(planned.index));
            let has_keys = |space: &Arc<Space>| !space.shapes.keys.is_empty();
            placed.moves |= geometries.shared.get(planned.geometry).is_some_and(has_keys);
            placed.is_unsampled = plan.unsampled.contains(&instance.mesh);
            geometries.placements.push(placed);
            instances.push(AccelInstance {
                // Geometry 0 of the BVH is the world.
                geometry: planned.geometry as u32 + 1,
                world_from_object: planned.world_from_object,
            });
        }
    }
    SceneGeometry { geometries, instances, first_moving, moving: Vec::new() }
}

fn placement(planned: &PlannedInstance, material: Option<u32>, object: ObjectId) -> Placement {
    Placement {
        geometry: planned.geometry as u32,
        world_from_object: Transform::of(&planned.world_from_object),
        material,
        object,
        moves: planned.motion.is_some(),
        motion: planned.motion,
        is_unsampled: false,
    }
}

fn needs_of(used: impl Iterator<Item = MaterialId>, materials: &[CompiledMaterial]) -> AttributeNeeds {
    let mut needs = AttributeNeeds::default();
    for material in used.map(|id| &materials[id.index()]) {
        needs.normals |= material.uses_normals();
        needs.uv = needs.uv.map(|uv| uv | material.uses_uv);
        needs.tangents |= material.uses_tangents();
        needs.colors |= material.uses_vertex_colors;
        needs.attributes |= material.reads_hit;
    }
    needs
}

impl AttributeNeeds {
    /// The attributes of a shared mesh: those of all materials, as any instance may have its own material.
    fn of_shared(materials: &[CompiledMaterial], keeps_uv: bool) -> AttributeNeeds {
        let any = |f: fn(&CompiledMaterial) -> bool| materials.iter().any(f);
        AttributeNeeds {
            normals: true,
            uv: [keeps_uv, false].map(|keeps| keeps || any(|m| m.uses_uv)),
            tangents: any(CompiledMaterial::uses_tangents),
            colors: any(|m| m.uses_vertex_colors),
            attributes: any(|m| m.reads_hit),
        }
    }
}

/// The separate space of a shared mesh.
fn shared_space(
    (mesh, is_inside_out): (&Mesh, bool),
    material_index: impl Fn(MaterialId) -> u32,
    needs: (AttributeNeeds, &[String]),
) -> Space {
    let mut space = Space::EMPTY;
    match &mesh.splats {
        Some(splats) => space.set_splats(mesh, splats, material_index),
        None => {
            space.append(mesh, (None, material_index), (&DAffine3::IDENTITY, is_inside_out), needs, |_| false)
        }
    }
    space.update_bounds();
    space
}

impl SceneGeometry {
    /// Adds a moving shape after all other placements.
    fn add_shape(&mut self, shape: MovingShape) {
        let geometries = &mut self.geometries;
        let (geometry, motion) = (geometries.shared.len() as u32, geometries.motions.len() as u32);
        geometries.shared.push(Arc::new(shape.space));
        geometries.motions.push(shape.keys);
        geometries.placements.push(Placement {
            geometry,
            world_from_object: Transform::of(&shape.world_from_object),
            material: None,
            object: shape.object,
            moves: true,
            motion: Some(motion),
            is_unsampled: false,
        });
        // Geometry 0 of the BVH is the world.
        self.instances
            .push(AccelInstance { geometry: geometry + 1, world_from_object: shape.world_from_object });
    }
}

impl Space {
    pub(super) const EMPTY: Space = Space {
        shapes: accel::Geometry {
            positions: Vec::new(),
            triangles: Vec::new(),
            quads: Vec::new(),
            analytic: Vec::new(),
            curves: CurveSegments::EMPTY,
            splats: SplatCloud::EMPTY,
            keys: Vec::new(),
        },
        attributes: Attributes::EMPTY,
        bounds: Bounds3::EMPTY,
        neighbours: None,
        owners: Owners::EMPTY,
    };

    /// Computes the bounds.
    pub(super) fn update_bounds(&mut self) {
        let positions = self.shapes.positions.iter().chain(self.shapes.keys.iter().flatten());
        let positions = positions.map(|&p| Vec3::from_array(p));
        let mut bounds = Bounds3::of(positions.filter(|p| p.is_finite()));
        for quad in &self.shapes.quads {
            bounds = bounds.union(quad.bounds());
        }
        for shape in &self.shapes.analytic {
            bounds = bounds.union(shape.bounds());
        }
        self.bounds = bounds.union(self.shapes.curves.bounds()).union(self.shapes.splats.bounds());
    }

    /// Sets the splats of a mesh as the only content.
    fn set_splats(&mut self, mesh: &Mesh, splats: &Arc<Splats>, material_index: impl Fn(MaterialId) -> u32) {
        let material = mesh.parts.first().map_or(0, |part| material_index(part.material));
        self.attributes.materials = vec![material; mesh.positions.len()];
        self.shapes.splats = SplatCloud { centers: mesh.positions.clone(), splats: Some(splats.clone()) };
    }

    /// Appends a mesh under a transform; `is_inside_out` reverses its triangles.
    fn append(
        &mut self,
        mesh: &Mesh,
        (material, material_index): (Option<MaterialId>, impl Fn(MaterialId) -> u32),
        (placed, is_inside_out): (&DAffine3, bool),
        (needs, names): (AttributeNeeds, &[String]),
        is_hidden: impl Fn(MaterialId) -> bool,
    ) {
        let (shapes, attributes) = (&mut self.shapes, &mut self.attributes);
        let first = shapes.positions.len() as u32;
        let is_identity = *placed == DAffine3::IDENTITY;
        let position = |p: &[f32; 3]| {
            if is_identity {
                *p
            } else {
                placed.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().to_array()
            }
        };
        reserve_on_huge_pages(&mut shapes.positions, mesh.positions.len());
        shapes.positions.extend(mesh.positions.iter().map(position));
        // Mirroring reverses the winding: swapping two vertices keeps the front side.
        let mirrors = placed.matrix3.determinant() < 0.0;
        let with_winding = |&[a, b, c]: &[u32; 3]| {
            if mirrors != is_inside_out {
                [a + first, c + first, b + first]
            } else {
                [a + first, b + first, c + first]
            }
        };
        reserve_on_huge_pages(&mut shapes.triangles, mesh.triangles.len());
        reserve_on_huge_pages(&mut attributes.materials, mesh.triangles.len());
        for part in &mesh.parts {
            let id = material.unwrap_or(part.material);
            if !is_hidden(id) {
                let triangles = mesh.triangles.iter().skip(part.first_triangle as usize);
                shapes.triangles.extend(triangles.take(part.triangle_count as usize).map(with_winding));
                attributes.materials.resize(shapes.triangles.len(), material_index(id));
            }
        }
        attributes.append(mesh, (placed, is_inside_out), needs, first as usize, names);
    }

    /// Appends static quads and analytic shapes to the world.
    fn append_shapes(
        &mut self,
        scene: &Scene,
        materials: &[CompiledMaterial],
        origin: DVec3,
        object_ids: &ObjectIds,
        plan: &Plan,
    ) {
        let (shapes, attributes) = (&mut self.shapes, &mut self.attributes);
        let is_visible = |id: MaterialId| !materials[id.index()].is_invisible();
        let is_static =
            |moving: &BTreeMap<usize, Keyframes<_>>, i: usize| !moving.get(&i).is_some_and(Keyframes::blurs);
        let shifted =
            |p: DVec3, shifts: &BTreeMap<usize, DVec3>, i: usize| shifts.get(&i).map_or(p, |by| p + *by);
        let (motion, quads) = (&scene.motion, scene.quads.iter().enumerate());
        for (i, quad) in quads.filter(|(i, quad)| is_visible(quad.material) && is_static(&motion.quads, *i)) {
            self.owners.begin(attributes.materials.len(), object_ids.quad(i));
            shapes.quads.push(Quad {
                corner: (shifted(quad.corner, &plan.shifts.quads, i) - origin).as_vec3(),
                edge_u: quad.edge_u.as_vec3(),
                edge_v: quad.edge_v.as_vec3(),
            });
            attributes.materials.push(plan.object_materials.index_of(quad.material, &quad.traits));
        }
        let needs_rotation =
            plan.keeps_uv || scene.shapes.iter().any(|s| materials[s.material.index()].uses_uv);
        let indexed = scene.shapes.iter().enumerate();
        for (i, shape) in indexed.filter(|(i, s)| is_visible(s.material) && is_static(&motion.shapes, *i)) {
            self.owners.begin(attributes.materials.len(), object_ids.shape(i));
            let center = shifted(shape.center, &plan.shifts.shapes, i) - origin;
            shapes.analytic.push(Analytic::of_scene(shape, center.as_vec3()));
            attributes.materials.push(plan.object_materials.index_of(shape.material, &shape.traits));
            if needs_rotation {
                attributes.object_from_world.push(Mat3::from_quat(shape.rotation.inverse().as_quat()));
            }
        }
    }
}

impl Attributes {
    /// Appends the needed attributes of a mesh; `before` vertices precede it. A list is empty until the first mesh that needs
    /// it, and filled with zeros (white for colours) for others.
    fn append(
        &mut self,
        mesh: &Mesh,
        (placed, is_inside_out): (&DAffine3, bool),
        needs: AttributeNeeds,
        before: usize,
        names: &[String],
    ) {
        self.named.resize_with(names.len(), AttributeList::default);
        let total = before + mesh.positions.len();
        let of_normals = normal_matrix(&placed.matrix3).as_mat3();
        let linear = placed.matrix3.as_mat3();
        let normals = mesh.normals.iter().map(|&n| (of_normals * vec3(n)).normalize_or_zero().to_array());
        extend(&mut self.normals, needs.normals, [0.0; 3], before, total, normals);
        for set in 0..2 {
            let source = mesh.uv_sets.get(set).map_or(&[][..], Vec::as_slice);
            extend(&mut self.uv[set], needs.uv[set], [0.0; 2], before, total, source.iter().copied());
        }
        // Flipped normals flip the bitangent.
        let is_flipped = is_inside_out && normals_agree_with_faces(mesh);
        let handedness = if (placed.matrix3.determinant() < 0.0) != is_flipped { -1.0 } else { 1.0 };
        let tangents = mesh.tangents.iter().map(|&[x, y, z, w]| {
            let [x, y, z] = (linear * vec3([x, y, z])).normalize_or_zero().to_array();
            [x, y, z, w * handedness]
        });
        extend(&mut self.tangents, needs.tangents, [0.0; 4], before, total, tangents);
        extend(&mut self.colors, needs.colors, [1.0; 4], before, total, mesh.colors.iter().copied());
        for (list, name) in self.named.iter_mut().zip(names) {
            let attribute = mesh.attributes.iter().find(|a| needs.attributes && a.name == *name);
            list.append(attribute.map(|a| (a.width as usize, &a.values[..])), before, total);
        }
    }
}

/// Do vertex normals agree with face normals?
fn normals_agree_with_faces(mesh: &Mesh) -> bool {
    let agreement = |&[a, b, c]: &[u32; 3]| {
        let [p, q, r] = [a, b, c].map(|i| vec3(mesh.positions[i as usize]));
        mesh.normals.get(a as usize).map_or(0.0, |&normal| (q - p).cross(r - p).dot(vec3(normal)))
    };
    mesh.triangles.iter().map(agreement).sum::<f32>() > 0.0
}

fn vec3(v: [f32; 3]) -> Vec3 {
    v.into()
}

/// Extends a list to `total` entries: with values if needed, else with `filler`; a list without values stays empty.
fn extend<T: Copy>(
    list: &mut Vec<T>,
    needed: bool,
    filler: T,
    before: usize,
    total: usize,
    values: impl ExactSizeIterator<Item = T>,
) {
    let has_values = needed && values.len() > 0;
    if list.is_empty() && !has_values {
        return;
    }
    reserve_on_huge_pages(list, total - list.len());
    list.resize(before, filler);
    if has_values {
        list.extend(values);
    }
    list.resize(total, filler);
}

// Tangents for normal maps by MikkTSpace (Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited"), as baking tools use.

/// The mesh with tangents by one of its UV sets; `None` if it has tangents, or lacks normals or the UV set. Vertices with
/// different tangents in adjacent triangles (at seams and mirror lines) are split.
pub(super) fn with_tangents(mesh: &Mesh, uv_set: usize) -> Option<Mesh> {
    let uv = mesh.uv_sets.get(uv_set)?;
    if uv.is_empty() || mesh.normals.is_empty() || !mesh.tangents.is_empty() {
        return None;
    }
    let mut corners = TangentMesh { mesh, uv, tangents: vec![[[0.0; 4]; 3]; mesh.triangles.len()] };
    // The error type has no values.
    generate_tangents(&mut corners).ok()?;
    Some(split(mesh, &corners.tangents))
}

/// Input and output of MikkTSpace.
struct TangentMesh<'a> {
    mesh: &'a Mesh,
    uv: &'a [[f32; 2]],
    tangents: Vec<[[f32; 4]; 3]>,
}

/// Functions of MikkTSpace with the same result on every machine.
struct PortableMath;

impl Ops for PortableMath {
    fn sqrt(x: f32) -> f32 {
        x.sqrt()
    }

    fn acos(x: f32) -> f32 {
        poly::acos(x)
    }
}

impl TangentMesh<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[face][corner] as usize
    }
}

impl Geometry<PortableMath> for TangentMesh<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)]
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, corner)]
    }

    /// MikkTSpace expects v to point up; here it points down.
    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        let [u, v] = self.uv[self.vertex(face, corner)];
        [u, -v]
    }

    /// Corners without a tangent, where texture coordinates have no area, get MikkTSpace's default: x, left-handed.
    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        self.tangents[face][corner] = space.unwrap_or_default().tangent_encoded();
    }
}

/// Assigns tangents to vertices; vertices with several tangents are split.
fn split(mesh: &Mesh, tangents: &[[[f32; 4]; 3]]) -> Mesh {
    let mut result = Mesh { tangents: vec![[0.0; 4]; mesh.positions.len()], ..mesh.clone() };
    let mut has_tangent = vec![false; mesh.positions.len()];
    let mut copies: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    for (triangle, of_corners) in result.triangles.iter_mut().zip(tangents) {
        for (index, &tangent) in triangle.iter_mut().zip(of_corners) {
            let vertex = *index as usize;
            if !has_tangent[vertex] {
                has_tangent[vertex] = true;
                result.tangents[vertex] = tangent;
            } else if result.tangents[vertex] != tangent {
                let next = result.positions.len() as u32;
                *index = *copies.entry((*index, tangent.map(f32::to_bits))).or_insert(next);
                if *index == next {
                    result.positions.push(result.positions[vertex]);
                    result.normals.push(result.normals[vertex]);
                    for set in result.uv_sets.iter_mut().filter(|s| !s.is_empty()) {
                        set.push(set[vertex]);
                    }
                    if !result.colors.is_empty() {
                        result.colors.push(result.colors[vertex]);
                    }
                    result.attributes.iter_mut().for_each(|attribute| attribute.push_copy(vertex));
                    result.tangents.push(tangent);
                }
            }
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles of a square; the texture is mirrored on the second.
    fn mirrored_halves() -> Mesh {
        Mesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2], [1, 3, 2]],
            normals: vec![[0.0, 0.0, 1.0]; 4],
            // Upright on the first triangle: u to the right, v down. Mirrored at the diagonal.
            uv_sets: vec![vec![[0.0, 1.0], [1.0, 1.0], [0.0, 0.0], [0.0, 1.0]]],
            colors: vec![[1.0; 4]; 4],
            ..Mesh::default()
        }
    }

    #[test]
    fn tangents_without_texture_area_are_those_of_mikktspace() {
        // On a line and at a point.
        for uv in [[[0.0, 0.5], [1.0, 0.5], [0.0, 0.5], [1.0, 0.5]], [[0.5; 2]; 4]] {
            let mesh = Mesh { uv_sets: vec![uv.to_vec()], ..mirrored_halves() };
            let found = with_tangents(&mesh, 0).expect("has all it needs");
            assert_eq!(found.tangents, [[1.0, 0.0, 0.0, -1.0]; 4]);
        }
    }

    #[test]
    fn tangents_point_along_u_and_bitangents_up_the_image() {
        let mesh = with_tangents(&mirrored_halves(), 0).expect("has all it needs");
        let [a, ..] = mesh.triangles[0];
        assert_eq!(mesh.tangents[a as usize], [1.0, 0.0, 0.0, 1.0]);
        // On the second u decreases to the right and v increases to the top: the handedness flips, and the diagonal is split.
        let [_, b, _] = mesh.triangles[1];
        assert_eq!(mesh.tangents[b as usize][3], -1.0);
        assert_eq!(mesh.positions.len(), 6);
        for list in [mesh.normals.len(), mesh.uv_sets[0].len(), mesh.colors.len(), mesh.tangents.len()] {
            assert_eq!(list, 6);
        }
        let place = |m: &Mesh, t: [u32; 3]| t.map(|i| m.positions[i as usize]);
        for (old, new) in mirrored_halves().triangles.iter().zip(&mesh.triangles) {
            assert_eq!(place(&mirrored_halves(), *old), place(&mesh, *new));
        }
    }

    #[test]
    fn tangents_need_normals_and_uv_and_are_not_replaced() {
        let whole = mirrored_halves();
        assert!(with_tangents(&whole, 1).is_none());
        assert!(with_tangents(&Mesh { normals: Vec::new(), ..whole.clone() }, 0).is_none());
        let given = Mesh { tangents: vec![[1.0, 0.0, 0.0, 1.0]; 4], ..whole };
        assert!(with_tangents(&given, 0).is_none());
    }
}
