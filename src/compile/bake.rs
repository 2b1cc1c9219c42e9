//! Makes the geometry that a plan asks for: the world's own, and a space of its own for each mesh that is not copied.

use super::blur::{self, MovingShape, moving_shapes};
use super::geometry::{Attributes, Geometries, Placement, Space, Transform};
use super::material::CompiledMaterial;
use super::object_materials::part_materials;
use super::objects::{Numbering, ObjectId, Owners};
use super::placement::normal_matrix;
use super::plan::{Place, Plan, Step, normal_map_set};
use super::tangents::with_tangents;
use crate::accel::{self, AccelInstance, MovingInstance};
use crate::math::{Bounds3, DAffine3, DVec3, Mat3, Vec3};
use crate::scene::{MaterialId, Mesh, Moving, Scene};
use crate::shape::{Analytic, CurveSegments, Quad, Shape as _};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Where geometry ended up.
#[derive(Debug)]
pub(super) struct Baked {
    /// All of it.
    pub geometries: Geometries,
    /// For the accelerator, in the order of the placements.
    pub instances: Vec<AccelInstance>,
    /// The first of these that moves.
    pub first_moving: usize,
    /// Those that move while the picture is taken.
    pub moving: Vec<MovingInstance>,
}

/// What of an earlier moment's geometry is used again.
#[derive(Debug, Default)]
pub(super) struct Kept {
    /// The world.
    pub world: Option<Arc<Space>>,
    /// The meshes that are not copied and don't change; all or none.
    pub shared: Vec<Arc<Space>>,
}

/// What of a mesh the materials need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Needs {
    normals: bool,
    uv: [bool; 2],
    tangents: bool,
    colors: bool,
}

/// Makes geometry for a scene whose world's origin moves to `origin`.
pub(super) fn bake(
    scene: &Scene,
    materials: &[CompiledMaterial],
    origin: DVec3,
    plan: &Plan,
    kept: Kept,
) -> Baked {
    let (numbering, any_needs) = (Numbering::of(scene), any_needs(materials, plan.keeps_uv));
    let mut shared: Vec<Option<Arc<Space>>> = kept.shared.into_iter().map(Some).collect();
    shared.resize(plan.meshes.len(), None);
    let mut world = Space::EMPTY;
    let mut tangents: Vec<Option<Mesh>> = vec![None; scene.meshes.len()];
    let is_hidden = |id: MaterialId| materials[id.index()].is_invisible();
    for step in &plan.steps {
        let is_there = match step.place {
            Place::World => kept.world.is_some(),
            _ => shared[step.geometry].is_some(),
        };
        if is_there {
            continue;
        }
        let instance = &scene.instances[step.instance];
        let mesh = &scene.meshes[instance.mesh.index()];
        let made = &mut tangents[instance.mesh.index()];
        // New tangents may come with new vertices, whose motion nobody knows: hits find their own then.
        if made.is_none()
            && !blur::deforms(scene, instance.mesh)
            && let Some(uv_set) = normal_map_set(part_materials(mesh, instance), scene)
        {
            *made = with_tangents(mesh, uv_set);
        }
        let mesh = made.as_ref().unwrap_or(mesh);
        if step.place == Place::World {
            let mut needs = needs_of(part_materials(mesh, instance), materials);
            needs.uv[0] |= plan.keeps_uv;
            let first = world.shapes.triangles.len();
            world.owners.begin(first, numbering.instance(step.instance));
            let number = |id: MaterialId| plan.numbers.number(id, &instance.traits);
            let placed = (&step.world_from_object, plan.is_inside_out(instance.mesh));
            world.append(mesh, (instance.material, number), placed, needs, is_hidden);
        } else {
            let number = |id: MaterialId| plan.numbers.number(id, &plan.mesh_traits[step.geometry]);
            let mut space = share((mesh, plan.is_inside_out(instance.mesh)), number, any_needs);
            if step.place == Place::Moving {
                space.take_keys(scene, instance.mesh);
            }
            shared[step.geometry] = Some(Arc::new(space));
        }
    }
    let world = kept.world.unwrap_or_else(|| {
        world.append_shapes(scene, materials, origin, &numbering, plan);
        world.append_curves(scene, materials, origin, &numbering, &plan.numbers);
        world.measure();
        Arc::new(world)
    });
    let shared = shared.into_iter().flatten().collect();
    let motions = plan.motions.clone();
    let geometries = Geometries { world, shared, placements: Vec::new(), motions, moves: false };
    let baked = place(scene, plan, &numbering, geometries);
    with_motion(baked, scene, materials, (origin, &numbering), plan)
}

/// With the shapes that move while the picture is taken.
fn with_motion(
    mut baked: Baked,
    scene: &Scene,
    materials: &[CompiledMaterial],
    (origin, numbering): (DVec3, &Numbering),
    plan: &Plan,
) -> Baked {
    let shapes = moving_shapes(scene, materials, origin, numbering, (&plan.numbers, plan.keeps_uv));
    shapes.into_iter().for_each(|shape| baked.add_shape(shape));
    baked.moving = moving(&baked.geometries);
    baked.geometries.moves = baked.geometries.placements.iter().any(|p| p.moves);
    baked
}

/// The placements that move while the picture is taken.
fn moving(geometries: &Geometries) -> Vec<MovingInstance> {
    let keys = |(instance, p): (usize, &Placement)| {
        Some(MovingInstance { instance, keys: geometries.motions[p.motion? as usize].clone() })
    };
    geometries.placements.iter().enumerate().filter_map(keys).collect()
}

/// Adds the placements: those that stand still, then those that move.
fn place(scene: &Scene, plan: &Plan, numbering: &Numbering, mut geometries: Geometries) -> Baked {
    let (mut instances, mut first_moving) = (Vec::new(), 0);
    for place in [Place::Still, Place::Moving] {
        first_moving = instances.len();
        for step in plan.steps.iter().filter(|s| s.place == place) {
            let instance = &scene.instances[step.instance];
            let material = plan.material_of(instance, &scene.meshes[instance.mesh.index()]);
            let mut placed = placement(step, material, numbering.instance(step.instance));
            let has_keys = |space: &Arc<Space>| !space.shapes.keys.is_empty();
            placed.moves |= geometries.shared.get(step.geometry).is_some_and(has_keys);
            geometries.placements.push(placed);
            instances.push(AccelInstance {
                // The accelerator counts the world, too.
                geometry: step.geometry as u32 + 1,
                world_from_object: step.world_from_object,
            });
        }
    }
    Baked { geometries, instances, first_moving, moving: Vec::new() }
}

fn placement(step: &Step, material: Option<u32>, object: ObjectId) -> Placement {
    Placement {
        geometry: step.geometry as u32,
        world_from_object: Transform::of(&step.world_from_object),
        material,
        object,
        moves: step.motion.is_some(),
        motion: step.motion,
    }
}

fn needs_of(used: impl Iterator<Item = MaterialId>, materials: &[CompiledMaterial]) -> Needs {
    let mut needs = Needs::default();
    for material in used.map(|id| &materials[id.index()]) {
        needs.normals |= material.uses_normals();
        needs.uv = needs.uv.map(|uv| uv | material.uses_uv);
        needs.tangents |= material.uses_tangents();
        needs.colors |= material.uses_vertex_colors;
    }
    needs
}

/// What any material needs of a mesh that placements share: every one may bring its own.
fn any_needs(materials: &[CompiledMaterial], keeps_uv: bool) -> Needs {
    let any = |f: fn(&CompiledMaterial) -> bool| materials.iter().any(f);
    Needs {
        normals: true,
        uv: [keeps_uv, false].map(|keeps| keeps || any(|m| m.uses_uv)),
        tangents: any(CompiledMaterial::uses_tangents),
        colors: any(|m| m.uses_vertex_colors),
    }
}

/// A mesh in a space of its own.
fn share((mesh, is_inside_out): (&Mesh, bool), number: impl Fn(MaterialId) -> u32, needs: Needs) -> Space {
    let mut space = Space::EMPTY;
    space.append(mesh, (None, number), (&DAffine3::IDENTITY, is_inside_out), needs, |_| false);
    space.measure();
    space
}

impl Baked {
    /// Adds a shape that moves, behind all other placements.
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
        });
        // The accelerator counts the world, too.
        self.instances
            .push(AccelInstance { geometry: geometry + 1, world_from_object: shape.world_from_object });
    }
}

impl Space {
    /// Nothing.
    pub(super) const EMPTY: Space = Space {
        shapes: accel::Geometry {
            positions: Vec::new(),
            triangles: Vec::new(),
            quads: Vec::new(),
            analytic: Vec::new(),
            curves: CurveSegments::EMPTY,
            keys: Vec::new(),
        },
        attributes: Attributes::EMPTY,
        bounds: Bounds3::EMPTY,
        neighbours: None,
        owners: Owners::EMPTY,
    };

    /// Finds the box around the shapes.
    pub(super) fn measure(&mut self) {
        let positions = self.shapes.positions.iter().chain(self.shapes.keys.iter().flatten());
        let positions = positions.map(|&p| Vec3::from_array(p));
        let mut bounds = Bounds3::of(positions.filter(|p| p.is_finite()));
        for quad in &self.shapes.quads {
            bounds = bounds.union(quad.bounds());
        }
        for shape in &self.shapes.analytic {
            bounds = bounds.union(shape.bounds());
        }
        self.bounds = bounds.union(self.shapes.curves.bounds());
    }

    /// Appends a placed mesh, which may be inside out, to the world's own geometry.
    fn append(
        &mut self,
        mesh: &Mesh,
        (material, number): (Option<MaterialId>, impl Fn(MaterialId) -> u32),
        (placed, is_inside_out): (&DAffine3, bool),
        needs: Needs,
        is_hidden: impl Fn(MaterialId) -> bool,
    ) {
        let (shapes, attributes) = (&mut self.shapes, &mut self.attributes);
        let first = shapes.positions.len() as u32;
        let as_is = *placed == DAffine3::IDENTITY;
        let position = |p: &[f32; 3]| {
            if as_is {
                *p
            } else {
                placed.transform_point3(DVec3::from(p.map(f64::from))).as_vec3().to_array()
            }
        };
        shapes.positions.extend(mesh.positions.iter().map(position));
        // Mirroring turns counter-clockwise into clockwise; the front stays the front.
        let mirrors = placed.matrix3.determinant() < 0.0;
        let turned = |&[a, b, c]: &[u32; 3]| {
            if mirrors != is_inside_out {
                [a + first, c + first, b + first]
            } else {
                [a + first, b + first, c + first]
            }
        };
        for part in &mesh.parts {
            let id = material.unwrap_or(part.material);
            if !is_hidden(id) {
                let triangles = mesh.triangles.iter().skip(part.first_triangle as usize);
                shapes.triangles.extend(triangles.take(part.triangle_count as usize).map(turned));
                attributes.materials.resize(shapes.triangles.len(), number(id));
            }
        }
        attributes.append(mesh, (placed, is_inside_out), needs, first as usize);
    }

    /// Appends quads and analytic shapes to the world's own geometry.
    fn append_shapes(
        &mut self,
        scene: &Scene,
        materials: &[CompiledMaterial],
        origin: DVec3,
        numbering: &Numbering,
        plan: &Plan,
    ) {
        let (shapes, attributes) = (&mut self.shapes, &mut self.attributes);
        let is_seen = |id: MaterialId| !materials[id.index()].is_invisible();
        let stays =
            |moving: &BTreeMap<usize, Moving<_>>, i: usize| !moving.get(&i).is_some_and(Moving::blurs);
        let (motion, quads) = (&scene.motion, scene.quads.iter().enumerate());
        for (i, quad) in quads.filter(|(i, quad)| is_seen(quad.material) && stays(&motion.quads, *i)) {
            self.owners.begin(attributes.materials.len(), numbering.quad(i));
            shapes.quads.push(Quad {
                corner: (quad.corner - origin).as_vec3(),
                edge_u: quad.edge_u.as_vec3(),
                edge_v: quad.edge_v.as_vec3(),
            });
            attributes.materials.push(plan.numbers.number(quad.material, &quad.traits));
        }
        let turns = plan.keeps_uv || scene.shapes.iter().any(|s| materials[s.material.index()].uses_uv);
        let shown = scene.shapes.iter().enumerate();
        for (i, shape) in shown.filter(|(i, s)| is_seen(s.material) && stays(&motion.shapes, *i)) {
            self.owners.begin(attributes.materials.len(), numbering.shape(i));
            shapes.analytic.push(Analytic::of_scene(shape, (shape.center - origin).as_vec3()));
            attributes.materials.push(plan.numbers.number(shape.material, &shape.traits));
            if turns {
                attributes.object_from_world.push(Mat3::from_quat(shape.rotation.inverse().as_quat()));
            }
        }
    }
}

impl Attributes {
    /// Appends what is needed of a mesh's attributes; `before` vertices precede it. A list starts, filled with zeros
    /// (white for colours), at the first mesh that needs it.
    fn append(
        &mut self,
        mesh: &Mesh,
        (placed, is_inside_out): (&DAffine3, bool),
        needs: Needs,
        before: usize,
    ) {
        let total = before + mesh.positions.len();
        let of_normals = normal_matrix(&placed.matrix3).as_mat3();
        let linear = placed.matrix3.as_mat3();
        let normals = mesh.normals.iter().map(|&n| (of_normals * glam(n)).normalize_or_zero().to_array());
        extend(&mut self.normals, needs.normals, [0.0; 3], before, total, normals);
        for set in 0..2 {
            let source = mesh.uv_sets.get(set).map_or(&[][..], Vec::as_slice);
            extend(&mut self.uv[set], needs.uv[set], [0.0; 2], before, total, source.iter().copied());
        }
        // Normals that are turned around turn the third axis of tangents.
        let is_turned = is_inside_out && has_normals_of_faces(mesh);
        let handedness = if (placed.matrix3.determinant() < 0.0) != is_turned { -1.0 } else { 1.0 };
        let tangents = mesh.tangents.iter().map(|&[x, y, z, w]| {
            let [x, y, z] = (linear * glam([x, y, z])).normalize_or_zero().to_array();
            [x, y, z, w * handedness]
        });
        extend(&mut self.tangents, needs.tangents, [0.0; 4], before, total, tangents);
        extend(&mut self.colors, needs.colors, [1.0; 4], before, total, mesh.colors.iter().copied());
    }
}

/// Do the normals of a mesh's vertices point where those of its faces do?
fn has_normals_of_faces(mesh: &Mesh) -> bool {
    let agreement = |&[a, b, c]: &[u32; 3]| {
        let [p, q, r] = [a, b, c].map(|i| glam(mesh.positions[i as usize]));
        mesh.normals.get(a as usize).map_or(0.0, |&normal| (q - p).cross(r - p).dot(glam(normal)))
    };
    mesh.triangles.iter().map(agreement).sum::<f32>() > 0.0
}

fn glam(v: [f32; 3]) -> Vec3 {
    v.into()
}

/// Brings a list to `total` entries: values if they are needed, fillers otherwise, nothing while nobody needed any.
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
    list.resize(before, filler);
    if has_values {
        list.extend(values);
    }
    list.resize(total, filler);
}
