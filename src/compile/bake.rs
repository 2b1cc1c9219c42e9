//! Places meshes: those used once become part of the world's own geometry, large ones used again are shared.

use super::geometry::{Attributes, Geometries, Placement};
use super::material::CompiledMaterial;
use super::tangents::with_tangents;
use crate::accel::{self, AccelInstance};
use crate::error::Warning;
use crate::math::{DAffine3, DMat3, DVec3, Mat3};
use crate::scene::{Instance, Mapping, MaterialId, Mesh, Scene, Shape, ShapeKind, Texture};
use crate::shape::{Analytic, Disk, Quad, Sphere};

/// Meshes with fewer triangles are copied for each use: a copy costs less than the step into a shared one.
const MIN_SHARED_TRIANGLES: usize = 1024;

/// Meshes whose transform stretches less evenly than this are copied: rays that an f32 matrix takes to object space would
/// lose as much precision.
const MAX_SHARED_CONDITION: f64 = 1e3;

/// Where geometry ended up.
#[derive(Debug, Default)]
pub struct Baked {
    /// The arrays.
    pub geometries: Geometries,
    /// For the accelerator, in the order of the placements.
    pub instances: Vec<AccelInstance>,
}

/// What of a mesh the materials need.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Needs {
    normals: bool,
    uv: [bool; 2],
    tangents: bool,
    colors: bool,
}

/// Bakes a scene whose world's origin moves to `origin`.
pub fn bake(
    scene: &Scene,
    materials: &[CompiledMaterial],
    origin: DVec3,
    warnings: &mut Vec<Warning>,
    left_out: &mut Vec<String>,
) -> Baked {
    let uses = count_uses(scene);
    let mut baked = Baked::default();
    baked.geometries.shapes.push(accel::Geometry::default());
    baked.geometries.attributes.push(Attributes::default());
    let mut shared: Vec<Option<u32>> = vec![None; scene.meshes.len()];
    let mut tangents: Vec<Option<Mesh>> = vec![None; scene.meshes.len()];
    let mut placements = vec![0; scene.meshes.len()];
    let is_hidden = |id: MaterialId| materials[id.index()].is_invisible();
    let mut invisible = 0;
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh.index()];
        if part_materials(mesh, instance).all(is_hidden) {
            invisible += 1;
            continue;
        }
        let made = &mut tangents[instance.mesh.index()];
        if made.is_none()
            && let Some(uv_set) = normal_map_set(part_materials(mesh, instance), scene)
        {
            *made = with_tangents(mesh, uv_set);
        }
        let mesh = made.as_ref().unwrap_or(mesh);
        let world_from_object = moved(&instance.world_from_object, origin);
        if !is_invertible(&world_from_object.matrix3) {
            let message = "a transform that flattens it (or is not finite) hides it; it was left out";
            warnings.push(Warning { place: instance.name.clone(), ..Warning::general(message) });
            continue;
        }
        if flatness(&world_from_object.matrix3) < NEARLY_FLAT {
            let message = "a transform that nearly flattens it makes its position and normals imprecise";
            warnings.push(Warning { place: instance.name.clone(), ..Warning::general(message) });
        }
        let emits = part_materials(mesh, instance).any(|m| materials[m.index()].emission.is_some());
        let is_shared = uses[instance.mesh.index()] > 1
            && mesh.triangles.len() >= MIN_SHARED_TRIANGLES
            && !emits
            && condition(&world_from_object.matrix3) <= MAX_SHARED_CONDITION;
        if is_shared {
            let slot = &mut shared[instance.mesh.index()];
            let geometry = *slot.get_or_insert_with(|| baked.geometries.share(mesh, materials));
            baked.place(geometry, &world_from_object, instance.material);
            placements[instance.mesh.index()] += 1;
        } else {
            let needs = needs_of(part_materials(mesh, instance), materials);
            baked.geometries.append(mesh, instance.material, &world_from_object, needs, is_hidden);
        }
    }
    baked.geometries.append_shapes(scene, materials, origin);
    if invisible > 0 {
        left_out.push(format!("{invisible} placements whose materials are fully transparent"));
    }
    report(scene, &uses, &placements, left_out);
    baked
}

fn count_uses(scene: &Scene) -> Vec<usize> {
    let mut uses = vec![0; scene.meshes.len()];
    for instance in &scene.instances {
        uses[instance.mesh.index()] += 1;
    }
    uses
}

fn report(scene: &Scene, uses: &[usize], placements: &[usize], left_out: &mut Vec<String>) {
    let unused = || scene.meshes.iter().zip(uses).filter(|&(_, &n)| n == 0).map(|(mesh, _)| mesh);
    if unused().next().is_some() {
        let triangles: usize = unused().map(|m| m.triangles.len()).sum();
        left_out.push(format!("{} meshes that nothing places ({triangles} triangles)", unused().count()));
    }
    for (mesh, placed) in scene.meshes.iter().zip(placements).filter(|(_, placed)| **placed > 1) {
        let (n, copies) = (mesh.triangles.len(), placed - 1);
        left_out.push(format!("{copies} copies of mesh '{}' ({n} triangles): its uses share one", mesh.name));
    }
}

fn moved(world_from_object: &DAffine3, origin: DVec3) -> DAffine3 {
    DAffine3 { translation: world_from_object.translation - origin, ..*world_from_object }
}

fn is_invertible(m: &DMat3) -> bool {
    // Rounding of a flat matrix leaves about 1e-16.
    m.determinant().is_finite() && flatness(m) > 1e-14
}

/// Transforms below this [`flatness`] are warned of.
const NEARLY_FLAT: f64 = 1e-6;

/// The volume that the axes span, over that of a box with such edges: 1 where they are orthogonal, 0 in a plane.
fn flatness(m: &DMat3) -> f64 {
    m.determinant().abs() / (m.x_axis.length() * m.y_axis.length() * m.z_axis.length())
}

/// The condition number of a matrix in the Frobenius norm, over its least value: 1 for rotations and even scales.
fn condition(m: &DMat3) -> f64 {
    let norm = |m: &DMat3| DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length()).length();
    norm(m) * norm(&m.inverse()) / 3.0
}

fn part_materials<'a>(mesh: &'a Mesh, instance: &'a Instance) -> impl Iterator<Item = MaterialId> + 'a {
    mesh.parts.iter().map(|part| instance.material.unwrap_or(part.material))
}

/// The set of texture coordinates that the first normal map among materials uses.
fn normal_map_set(mut used: impl Iterator<Item = MaterialId>, scene: &Scene) -> Option<usize> {
    let map = used.find_map(|id| scene.materials[id.index()].normal_map)?;
    match scene.textures.get(map.texture.index())? {
        Texture::Image { mapping: Mapping::Uv { set, .. }, .. } => Some(*set as usize),
        _ => None,
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

impl Baked {
    fn place(&mut self, geometry: u32, world_from_object: &DAffine3, material: Option<MaterialId>) {
        self.instances.push(AccelInstance { geometry, world_from_object: *world_from_object });
        self.geometries.placements.push(Placement {
            geometry,
            linear: world_from_object.matrix3.as_mat3(),
            translation: world_from_object.translation.as_vec3(),
            normal_from_object: normal_matrix(&world_from_object.matrix3).as_mat3(),
            material: material.map(|m| m.0),
        });
    }
}

/// The inverse transpose, scaled so that its largest column has length 1.
fn normal_matrix(m: &DMat3) -> DMat3 {
    let n = m.inverse().transpose();
    let largest = n.x_axis.length().max(n.y_axis.length()).max(n.z_axis.length());
    n * (1.0 / largest)
}

impl Geometries {
    /// A geometry of its own for a mesh, in object space; its index.
    fn share(&mut self, mesh: &Mesh, materials: &[CompiledMaterial]) -> u32 {
        let mut own = Geometries {
            shapes: vec![accel::Geometry::default()],
            attributes: vec![Attributes::default()],
            placements: Vec::new(),
        };
        // Every use may bring its own material.
        let needs = Needs { normals: true, uv: [true; 2], tangents: true, colors: true };
        let any = |f: fn(&CompiledMaterial) -> bool| materials.iter().any(f);
        let needs = Needs {
            uv: needs.uv.map(|_| any(|m| m.uses_uv)),
            tangents: any(CompiledMaterial::uses_tangents),
            colors: any(|m| m.uses_vertex_colors),
            ..needs
        };
        own.append(mesh, None, &DAffine3::IDENTITY, needs, |_| false);
        self.shapes.append(&mut own.shapes);
        self.attributes.append(&mut own.attributes);
        (self.shapes.len() - 1) as u32
    }

    /// Appends a placed mesh to the world's own geometry.
    fn append(
        &mut self,
        mesh: &Mesh,
        material: Option<MaterialId>,
        placed: &DAffine3,
        needs: Needs,
        is_hidden: impl Fn(MaterialId) -> bool,
    ) {
        let (shapes, attributes) = (&mut self.shapes[0], &mut self.attributes[0]);
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
            if mirrors { [a + first, c + first, b + first] } else { [a + first, b + first, c + first] }
        };
        for part in &mesh.parts {
            let id = material.unwrap_or(part.material);
            if !is_hidden(id) {
                let triangles = mesh.triangles.iter().skip(part.first_triangle as usize);
                shapes.triangles.extend(triangles.take(part.triangle_count as usize).map(turned));
                attributes.materials.resize(shapes.triangles.len(), id.0);
            }
        }
        attributes.append(mesh, placed, needs, first as usize);
    }

    /// Appends quads and analytic shapes to the world's own geometry.
    fn append_shapes(&mut self, scene: &Scene, materials: &[CompiledMaterial], origin: DVec3) {
        let (shapes, attributes) = (&mut self.shapes[0], &mut self.attributes[0]);
        let is_seen = |id: MaterialId| !materials[id.index()].is_invisible();
        for quad in scene.quads.iter().filter(|quad| is_seen(quad.material)) {
            shapes.quads.push(Quad {
                corner: (quad.corner - origin).as_vec3(),
                edge_u: quad.edge_u.as_vec3(),
                edge_v: quad.edge_v.as_vec3(),
            });
            attributes.materials.push(quad.material.0);
        }
        let turns = scene.shapes.iter().any(|s| materials[s.material.index()].uses_uv);
        for shape in scene.shapes.iter().filter(|shape| is_seen(shape.material)) {
            shapes.analytic.push(analytic(shape, origin));
            attributes.materials.push(shape.material.0);
            if turns {
                attributes.object_from_world.push(Mat3::from_quat(shape.rotation.inverse().as_quat()));
            }
        }
    }
}

/// A shape of a scene whose world's origin moves to `origin`.
fn analytic(shape: &Shape, origin: DVec3) -> Analytic {
    let center = (shape.center - origin).as_vec3();
    match shape.kind {
        ShapeKind::Sphere => Analytic::Sphere(Sphere { center, radius: shape.radius as f32 }),
        ShapeKind::Disk => {
            Analytic::Disk(Disk { center, axis: (shape.rotation * (DVec3::Z * shape.radius)).as_vec3() })
        }
    }
}

impl Attributes {
    /// Appends what is needed of a mesh's attributes; `before` vertices precede it. A list starts, filled with zeros
    /// (white for colours), at the first mesh that needs it.
    fn append(&mut self, mesh: &Mesh, placed: &DAffine3, needs: Needs, before: usize) {
        let total = before + mesh.positions.len();
        let of_normals = normal_matrix(&placed.matrix3).as_mat3();
        let linear = placed.matrix3.as_mat3();
        let normals = mesh.normals.iter().map(|&n| (of_normals * glam(n)).normalize_or_zero().to_array());
        extend(&mut self.normals, needs.normals, [0.0; 3], before, total, normals);
        for set in 0..2 {
            let source = mesh.uv_sets.get(set).map_or(&[][..], Vec::as_slice);
            extend(&mut self.uv[set], needs.uv[set], [0.0; 2], before, total, source.iter().copied());
        }
        let handedness = if placed.matrix3.determinant() < 0.0 { -1.0 } else { 1.0 };
        let tangents = mesh.tangents.iter().map(|&[x, y, z, w]| {
            let [x, y, z] = (linear * glam([x, y, z])).normalize_or_zero().to_array();
            [x, y, z, w * handedness]
        });
        extend(&mut self.tangents, needs.tangents, [0.0; 4], before, total, tangents);
        extend(&mut self.colors, needs.colors, [1.0; 4], before, total, mesh.colors.iter().copied());
    }
}

fn glam(v: [f32; 3]) -> crate::math::Vec3 {
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
