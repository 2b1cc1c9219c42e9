//! Displacement at load time: vertices move along their normals by a height map, after subdivision of the mesh, or by the vectors of a
//! node graph. Also converts height maps to normal maps.

mod flat_parts;
mod normal_maps;
mod offsets;
mod tessellate;

use super::Loaded;
use crate::error::{Error, Warning};
use crate::math::{DAffine3, DVec3, Vec3};
use crate::scene::{
    DisplacementKind, Instance, Keyframes, MaterialId, Mesh, MeshId, Motion, Quad, Scene, VertexAttribute,
    Vertices,
};
use crate::texture::ObjectData;
pub(super) use normal_maps::{BUMP_HEIGHT, holds_normals, normals_of_heights};
use offsets::{Displacer, Displacers, Parts, warn};
use std::collections::HashMap;
use tessellate::MAX_TRIANGLES;

/// Displaces all meshes whose materials have a displacement, then removes it from the materials.
///
/// # Errors
/// If the image of a displacement is damaged.
pub(super) fn apply(loaded: &mut Loaded) -> Result<(), Error> {
    if loaded.scene.materials.iter().all(|m| m.displacement.is_none()) {
        return Ok(());
    }
    let Loaded { scene, warnings, .. } = loaded;
    let displacers = Displacers::of(scene, warnings)?;
    warn_of_shapes(scene, &displacers, warnings);
    quads_to_meshes(scene, &displacers, warnings);
    displace_instances(scene, &displacers, warnings);
    loaded.scene.materials.iter_mut().for_each(|m| m.displacement = None);
    Ok(())
}

/// Warns of displaced analytic shapes, which have no triangles.
fn warn_of_shapes(scene: &Scene, displacers: &Displacers, warnings: &mut Vec<Warning>) {
    let shape = scene.shapes.iter().find(|shape| displacers.of_material(shape.material).is_some());
    if let Some(shape) = shape {
        warn(warnings, &shape.name, "spheres and disks can't be displaced: only meshes, boxes and quads can");
    }
}

/// Converts displaced quads to meshes.
fn quads_to_meshes(scene: &mut Scene, displacers: &Displacers, warnings: &mut Vec<Warning>) {
    let displaced = |quad: &Quad| displacers.of_material(quad.material).is_some();
    let Some(first) = scene.quads.iter().find(|quad| displaced(quad)) else { return };
    if !scene.motion.quads.is_empty() {
        return warn(
            warnings,
            &first.name,
            "is not displaced, because quads of the scene move: use a mesh instead",
        );
    }
    let (wanted, rest) = std::mem::take(&mut scene.quads).into_iter().partition(displaced);
    scene.quads = rest;
    let wanted: Vec<Quad> = wanted;
    for quad in wanted {
        let corners = [DVec3::ZERO, quad.edge_u, quad.edge_u + quad.edge_v, quad.edge_v];
        let positions = corners.map(|corner| corner.as_vec3().to_array()).to_vec();
        let triangles = vec![[0, 1, 2], [0, 2, 3]];
        let uv_sets = vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]];
        let mesh = Mesh::new(&quad.name, positions, triangles, quad.material);
        let mesh = scene.add_mesh(Mesh { uv_sets, ..mesh });
        let placed = Instance::new(mesh, DAffine3::from_translation(quad.corner));
        scene.instances.push(Instance { name: quad.name, traits: quad.traits, ..placed });
    }
}

/// Replaces the meshes of instances with displaced materials. Instances of one mesh share the result for the first of them.
fn displace_instances(scene: &mut Scene, displacers: &Displacers, warnings: &mut Vec<Warning>) {
    let mut displaced_meshes: HashMap<(MeshId, Option<MaterialId>), Option<MeshId>> = HashMap::new();
    let mut triangles = 0;
    for index in 0..scene.instances.len() {
        let Instance { mesh, material, .. } = scene.instances[index];
        let Some(base) = scene.meshes.get(mesh.index()) else { continue };
        let parts: Parts =
            base.parts.iter().map(|part| displacers.of_material(material.unwrap_or(part.material))).collect();
        if parts.iter().all(Option::is_none) {
            continue;
        }
        let key = (mesh, material.filter(|&id| displacers.of_material(id).is_some()));
        let displaced = match displaced_meshes.get(&key) {
            Some(known) => *known,
            None => {
                let budget = MAX_TRIANGLES - triangles;
                let id = displace_mesh(scene, index, (&parts, displacers), budget, warnings);
                triangles += id.map_or(0, |id| scene.meshes[id.index()].triangles.len());
                triangles = triangles.min(MAX_TRIANGLES);
                displaced_meshes.insert(key, id);
                id
            }
        };
        if let Some(mesh) = displaced {
            scene.instances[index].mesh = mesh;
        }
    }
}

/// Adds the displaced mesh of an instance; `None`, with a warning, if it can't be displaced.
fn displace_mesh(
    scene: &mut Scene,
    index: usize,
    (parts, displacers): (&Parts, &Displacers),
    budget: usize,
    warnings: &mut Vec<Warning>,
) -> Option<MeshId> {
    let instance = &scene.instances[index];
    let base = &scene.meshes[instance.mesh.index()];
    let keys = scene.motion.meshes.get(&instance.mesh.index());
    let is_subdivided = parts.iter().flatten().any(|displacer| displacer.edge().is_some());
    let deforms = keys.is_some() || instance.motion == Motion::Deforms;
    let reason = if is_subdivided && deforms {
        Some("its mesh deforms")
    } else if parts.iter().flatten().any(|displacer| displacer.lacks_coordinates(base)) {
        Some("it has no texture coordinates")
    } else if instance.world_from_object.matrix3.determinant() == 0.0 {
        Some("its scale is 0")
    } else {
        None
    };
    if let Some(reason) = reason {
        warn(warnings, &base.name, format!("is not displaced: {reason}"));
        return None;
    }
    let object = ObjectData::of_instance(instance, ObjectData::bounds_of_mesh(base), DVec3::ZERO);
    let fine = tessellate::tessellated(with_generated(base, displacers, &object), parts, budget, warnings);
    let displaced = |mesh: Mesh| displace_vertices(mesh, parts, displacers, &object);
    let keys: Option<Keyframes<Vertices>> = keys.map(|keys| {
        keys.map(|Vertices { positions, normals }| {
            let (positions, normals) = (positions.clone(), normals.clone());
            let Mesh { positions, normals, .. } = displaced(Mesh { positions, normals, ..fine.clone() });
            Vertices { positions, normals }
        })
    });
    let id = scene.add_mesh(displaced(fine));
    if let Some(keys) = keys {
        scene.motion.meshes.insert(id.index(), keys);
    }
    Some(id)
}

/// The mesh with the generated coordinates of its undisplaced vertices, if node graphs read them.
fn with_generated(base: &Mesh, displacers: &Displacers, object: &ObjectData) -> Mesh {
    /// The attribute's name in node graphs.
    const GENERATED: &str = "generated";
    let mut mesh = base.clone();
    let is_known = base.attributes.iter().any(|attribute| attribute.name == GENERATED);
    if !is_known && displacers.reads_attribute(GENERATED) {
        let [factor, offset] = object.generated;
        let coordinates = |p: &[f32; 3]| (Vec3::from_array(*p) * factor + offset).to_array();
        let values = base.positions.iter().flat_map(coordinates).collect();
        mesh.attributes.push(VertexAttribute { values, ..VertexAttribute::new(GENERATED, 3) });
    }
    mesh
}

// Displaces the vertices of a mesh and recomputes its normals.

/// The bits of a position, with -0 as +0.
type Key = [u32; 3];

fn key(p: [f32; 3]) -> Key {
    p.map(|x| (x + 0.0).to_bits())
}

/// Minimum length of the summed normals of a position, relative to the sum of their lengths, for a shared direction.
const MIN_COHERENCE: f32 = 0.1;

/// The mesh with displaced vertices. Vertices with the same position move together, as at UV seams and hard edges: by the mean of
/// their offsets.
fn displace_vertices(mut mesh: Mesh, parts: &Parts, displacers: &Displacers, object: &ObjectData) -> Mesh {
    let mut directions = directions(&mesh);
    let shading: Vec<Option<Shading>> = parts.iter().map(|part| part.map(shading_of)).collect();
    if mesh.normals.is_empty() && shading.contains(&Some(Shading::Kept)) {
        let stays_flat = |shading: &Option<Shading>| matches!(shading, None | Some(Shading::LikeMesh));
        let stays_flat: Vec<bool> = shading.iter().map(stays_flat).collect();
        let faces: Vec<Vec3> = face_normals(&mesh).collect();
        flat_parts::split(&mut mesh, &faces, &stays_flat, &mut directions);
    }
    let mut sums: HashMap<[Key; 2], (Vec3, f32)> = HashMap::new();
    let place = |vertex: usize| [key(mesh.positions[vertex]), key(directions[vertex].to_array())];
    for (vertex, offset) in displacers.offsets(&mesh, parts, &directions, object) {
        let (sum, count) = sums.entry(place(vertex as usize)).or_default();
        *sum += offset;
        *count += 1.0;
    }
    let offsets: Vec<Vec3> = (0..mesh.positions.len())
        .map(|vertex| sums.get(&place(vertex)).map_or(Vec3::ZERO, |(sum, count)| *sum / *count))
        .collect();
    let before = std::mem::take(&mut mesh.positions);
    let moved = |(position, offset): (&[f32; 3], &Vec3)| {
        let p = Vec3::from_array(*position) + *offset;
        if p.is_finite() { p.to_array() } else { *position }
    };
    mesh.positions = before.iter().zip(&offsets).map(moved).collect();
    set_normals(&mut mesh, parts, &directions, &before);
    mesh
}

/// The unit direction along which each vertex is displaced: that of the sum of all normals at its position, or its own normal where
/// these cancel, as on a two-sided card.
fn directions(mesh: &Mesh) -> Vec<Vec3> {
    let normals = vertex_normals(mesh);
    let mut places: HashMap<Key, (Vec3, f32)> = HashMap::new();
    for (position, normal) in mesh.positions.iter().zip(&normals) {
        let (sum, length) = places.entry(key(*position)).or_default();
        *sum += *normal;
        *length += normal.length();
    }
    let direction = |(position, normal): (&[f32; 3], &Vec3)| {
        let (sum, length) = places[&key(*position)];
        let is_shared = sum.length() > MIN_COHERENCE * length;
        if is_shared { sum.normalize_or_zero() } else { normal.normalize_or_zero() }
    };
    mesh.positions.iter().zip(&normals).map(direction).collect()
}

/// Vertex normals; without them the sums of adjacent face normals, weighted by the angles of the corners (Thürmer and Wüthrich 1998).
fn vertex_normals(mesh: &Mesh) -> Vec<Vec3> {
    if !mesh.normals.is_empty() {
        return mesh.normals.iter().map(|n| Vec3::from_array(*n)).collect();
    }
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for (triangle, normal) in mesh.triangles.iter().zip(face_normals(mesh)) {
        let corners = triangle.map(|v| Vec3::from_array(mesh.positions[v as usize]));
        for (k, &vertex) in triangle.iter().enumerate() {
            let [a, b] = [1, 2].map(|other| corners[(k + other) % 3] - corners[k]);
            let angle = a.cross(b).length().atan2(a.dot(b));
            sums[vertex as usize] += normal * angle;
        }
    }
    sums
}

/// Unit face normals; zero for triangles without area.
fn face_normals(mesh: &Mesh) -> impl Iterator<Item = Vec3> + '_ {
    mesh.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|v| Vec3::from_array(mesh.positions[v as usize]));
        (b - a).cross(c - a).normalize_or_zero()
    })
}

/// Normals of a displaced part.
#[derive(Clone, Copy, PartialEq)]
enum Shading {
    /// Those before displacement.
    Kept,
    /// Means of adjacent face normals, as in Cycles.
    Smooth,
    /// Flat if the mesh is flat-shaded; otherwise means of adjacent face normals.
    LikeMesh,
}

/// Sets the normals of displaced vertices; `before` are the positions before displacement. Flat-shaded meshes become smooth by height
/// maps.
fn set_normals(mesh: &mut Mesh, parts: &Parts, directions: &[Vec3], before: &[[f32; 3]]) {
    let shading = vertex_shading(mesh, parts);
    let is_flat = mesh.normals.is_empty();
    if is_flat && shading.iter().flatten().all(|shading| *shading == Shading::LikeMesh) {
        return;
    }
    // Vertices with the same position and normal share a normal after displacement.
    let normal = |v: usize| mesh.normals.get(v).map_or([0; 3], |n| key(*n));
    let smooth: Vec<(Key, Key)> = (0..before.len()).map(|v| (key(before[v]), normal(v))).collect();
    let mut sums: HashMap<(Key, Key), Vec3> = HashMap::new();
    for (triangle, normal) in mesh.triangles.iter().zip(face_normals(mesh)) {
        for vertex in triangle {
            *sums.entry(smooth[*vertex as usize]).or_default() += normal;
        }
    }
    let normals = (0..mesh.positions.len()).map(|vertex| {
        let sum = sums.get(&smooth[vertex]).and_then(|sum| sum.try_normalize());
        let before = mesh.normals.get(vertex).copied().unwrap_or(directions[vertex].to_array());
        match (shading[vertex], sum) {
            (Some(Shading::Kept), _) => before,
            (None, _) if !is_flat => before,
            (_, Some(sum)) => sum.to_array(),
            _ => before,
        }
    });
    mesh.normals = normals.collect();
}

/// The shading of a displaced part.
fn shading_of(displacer: &Displacer) -> Shading {
    match displacer.displacement.kind {
        DisplacementKind::Heights { .. } => Shading::Smooth,
        DisplacementKind::Vectors { keeps_normals: true } => Shading::Kept,
        DisplacementKind::Vectors { keeps_normals: false } => Shading::LikeMesh,
    }
}

/// The shading of the first displaced part with each vertex.
fn vertex_shading(mesh: &Mesh, parts: &Parts) -> Vec<Option<Shading>> {
    let mut shading = vec![None; mesh.positions.len()];
    for (part, displacer) in mesh.parts.iter().zip(parts) {
        let Some(of_part) = displacer.map(shading_of) else { continue };
        for vertex in mesh.triangles[part.triangles()].as_flattened() {
            shading[*vertex as usize].get_or_insert(of_part);
        }
    }
    shading
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{Encoding, Image, Pixels};
    use crate::scene::nodes::{Node, NodeGraph, NodeInput, NodeKind};
    use crate::scene::{
        Displacement, Interpolation, Mapping, Material, MeshPart, Shape, Texture, TextureId,
        TextureTransform, Wrap,
    };
    use std::sync::Arc;

    /// A displaced material with a height map of `n` by `n` texels.
    fn displaced_by(scene: &mut Scene, n: u32, edge: f32, height: impl Fn(u32, u32) -> f32) -> MaterialId {
        let texels = (0..n * n).map(|i| height(i % n, i / n)).collect();
        let image = scene.add_image(Image {
            name: "heights".into(),
            width: n,
            height: n,
            channels: 1,
            encoding: Encoding::Linear,
            pixels: Arc::new(Pixels::F32(texels)),
        });
        let transform = TextureTransform::default();
        scene.textures.push(Texture::Image {
            image,
            wrap_u: Wrap::Clamp,
            wrap_v: Wrap::Repeat,
            interpolation: Interpolation::Bilinear,
            mapping: Mapping::Uv { set: 0, transform },
        });
        let texture = (TextureId(scene.textures.len() as u32 - 1), 0);
        let kind = DisplacementKind::Heights { scale: 0.5, midlevel: 0.25, edge };
        let displacement = Some(Displacement { texture, kind });
        scene.add_material(Material { displacement, ..Material::lambert("rock", [0.5; 3]) })
    }

    fn applied(scene: Scene) -> Loaded {
        let mut loaded = Loaded::from(scene);
        apply(&mut loaded).expect("no image is damaged");
        assert!(loaded.scene.materials.iter().all(|m| m.displacement.is_none()));
        assert!(loaded.scene.validate().is_empty(), "{:?}", loaded.scene.validate());
        loaded
    }

    fn vertex(mesh: &Mesh, v: u32) -> Vec3 {
        Vec3::from_array(mesh.positions[v as usize])
    }

    /// A material displaced by a vector in world space, which a node makes of the world position's x.
    fn displaced_by_vectors(scene: &mut Scene, keeps_normals: bool) -> MaterialId {
        let node = |kind, inputs| Node { kind, inputs, image: None, reads_alpha: false };
        let link = |node, output| NodeInput::Link { node, output };
        let position = node(NodeKind::Geometry {}, Vec::new());
        let parts = node(NodeKind::SeparateXyz {}, vec![link(0, 0)]);
        let zero = NodeInput::Value([0.0; 3]);
        let vector = node(NodeKind::CombineXyz {}, vec![zero, link(1, 0), zero]);
        let graph = NodeGraph { nodes: vec![position, parts, vector], result: link(2, 0), is_z_up: false };
        scene.textures.push(Texture::Nodes(Arc::new(graph)));
        let texture = (TextureId(scene.textures.len() as u32 - 1), 0);
        let displacement = Some(Displacement { texture, kind: DisplacementKind::Vectors { keeps_normals } });
        scene.add_material(Material { displacement, ..Material::lambert("sheared", [0.5; 3]) })
    }

    /// A square of two triangles, flat, placed at twice its size at x = 3: (x, 0, z) moves up by the world's x.
    fn sheared(keeps_normals: bool, normals: Vec<[f32; 3]>) -> Mesh {
        let mut scene = Scene::default();
        let material = displaced_by_vectors(&mut scene, keeps_normals);
        let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 0.0, -1.0], [0.0, 0.0, -1.0]];
        let mesh = Mesh::new("square", positions, vec![[0, 1, 2], [0, 2, 3]], material);
        let id = scene.add_mesh(Mesh { normals, ..mesh });
        let placed =
            DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), Default::default(), 3.0 * DVec3::X);
        scene.instances.push(Instance::new(id, placed));
        let loaded = applied(scene);
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        loaded.scene.meshes[loaded.scene.instances[0].mesh.index()].clone()
    }

    #[test]
    fn vectors_are_in_world_space_and_flat_meshes_stay_flat() {
        let mesh = sheared(false, Vec::new());
        let heights: Vec<f32> = mesh.positions.iter().map(|p| p[1]).collect();
        assert_eq!(heights, [1.5, 2.5, 2.5, 1.5]);
        assert!(mesh.normals.is_empty() && mesh.triangles.len() == 2);
    }

    #[test]
    fn vectors_tilt_normals_or_keep_them() {
        let up = vec![[0.0, 1.0, 0.0]; 4];
        let tilted = Vec3::new(-1.0, 1.0, 0.0).normalize();
        assert!(
            sheared(false, up.clone()).normals.iter().all(|n| Vec3::from_array(*n).distance(tilted) < 1e-6)
        );
        assert_eq!(sheared(true, up.clone()).normals, up);
        // Flat meshes get the normals of their vertices.
        assert_eq!(sheared(true, Vec::new()).normals, up);
    }

    /// Two squares at a right angle with a common edge, flat; only the first is displaced, and it gets the normals of its vertices.
    #[test]
    fn parts_without_displacement_stay_flat() {
        let mut scene = Scene::default();
        let sheared = displaced_by_vectors(&mut scene, true);
        let plain = scene.add_material(Material::lambert("plain", [0.5; 3]));
        let positions = vec![
            [0.0; 3],
            [1.0, 0.0, 0.0],
            [1.0, 0.0, -1.0],
            [0.0, 0.0, -1.0],
            [1.0, 1.0, 0.0],
            [1.0, 1.0, -1.0],
        ];
        let triangles = vec![[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
        let mut mesh = Mesh::new("corner", positions, triangles, sheared);
        mesh.parts = vec![
            MeshPart { first_triangle: 0, triangle_count: 2, material: sheared },
            MeshPart { first_triangle: 2, triangle_count: 2, material: plain },
        ];
        let id = scene.add_mesh(mesh);
        scene.instances.push(Instance::new(id, DAffine3::IDENTITY));
        let loaded = applied(scene);
        let mesh = &loaded.scene.meshes[loaded.scene.instances[0].mesh.index()];
        let corners = |triangle: usize| mesh.triangles[triangle].map(|v| v as usize);
        for vertex in [2, 3].into_iter().flat_map(corners) {
            assert_eq!(mesh.normals[vertex], [-1.0, 0.0, 0.0]);
            let p = mesh.positions[vertex];
            // The common edge moves by its x.
            assert!(p[1] == 1.0, "{p:?}");
        }
        let tilted = corners(0).map(|vertex| mesh.normals[vertex][0]);
        assert!(tilted[0] == 0.0 && tilted[1] < -0.5 && tilted[2] < -0.5, "{tilted:?}");
    }

    /// A 2 x 1 quad with a linear ramp along u becomes an inclined plane between the centres of the outer texels.
    #[test]
    fn a_ramp_tilts_a_quad() {
        let mut scene = Scene::default();
        let n = 16;
        let rock = displaced_by(&mut scene, n, 0.05, |x, _| (x as f32 + 0.5) / 16.0);
        scene.quads.push(Quad::new([1.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, -1.0], rock));
        let loaded = applied(scene);
        assert!(loaded.warnings.is_empty() && loaded.scene.quads.is_empty());
        let instance = &loaded.scene.instances[0];
        let mesh = &loaded.scene.meshes[instance.mesh.index()];
        assert!(mesh.triangles.len() > 800, "{} triangles", mesh.triangles.len());
        let slope = Vec3::new(-0.25, 1.0, 0.0).normalize();
        for (v, (p, normal)) in mesh.positions.iter().zip(&mesh.normals).enumerate() {
            let u = f64::from(p[0]) / 2.0;
            let height = (u.clamp(0.5 / 16.0, 15.5 / 16.0) - 0.25) * 0.5;
            assert!((f64::from(p[1]) - height).abs() < 1e-6, "{p:?} {height}");
            let is_inner = (0.1..0.9).contains(&u) && (-0.95..-0.05).contains(&p[2]);
            let normal = Vec3::from_array(*normal);
            assert!(!is_inner || normal.distance(slope) < 1e-4, "{v}: {p:?} {normal}");
        }
    }

    #[test]
    fn edges_are_within_the_maximum_length_and_the_mesh_stays_watertight() {
        let mut scene = Scene::default();
        let rock = displaced_by(&mut scene, 32, 0.11, |x, y| ((x * 7 + y * 5) % 11) as f32 / 11.0);
        // A cube with hard edges: separate vertices per face.
        let (mut positions, mut normals, mut uv) = (Vec::new(), Vec::new(), Vec::new());
        let mut triangles = Vec::new();
        for axis in 0..3 {
            for side in [-1.0f32, 1.0] {
                let first = positions.len() as u32;
                for [a, b] in [[-1.0f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                    let mut p = [0.0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, a * side, b);
                    let mut normal = [0.0; 3];
                    normal[axis] = side;
                    positions.push(p);
                    normals.push(normal);
                    uv.push([0.5 * a + 0.5, 0.5 * b + 0.5]);
                }
                triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
        let mesh = Mesh { normals, uv_sets: vec![uv], ..Mesh::new("cube", positions, triangles, rock) };
        let (fine, longest) = tessellate::subdivided(&mesh, &[Some(0.11)], usize::MAX);
        assert!(longest.is_none());
        for t in &fine.triangles {
            for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
                assert!(vertex(&fine, a).distance(vertex(&fine, b)) <= 0.11001);
            }
        }
        let id = scene.add_mesh(mesh);
        scene.instances.push(Instance::new(id, DAffine3::IDENTITY));
        scene.instances.push(Instance::new(id, DAffine3::from_translation(DVec3::X * 5.0)));
        let loaded = applied(scene);
        assert_eq!(loaded.scene.instances[0].mesh, loaded.scene.instances[1].mesh, "made once");
        let mesh = &loaded.scene.meshes[loaded.scene.instances[0].mesh.index()];
        assert_eq!(mesh.triangles.len(), fine.triangles.len());
        // Watertight: every edge, by the positions of its ends, has an opposite edge.
        let mut open: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
        for t in &mesh.triangles {
            for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
                let [a, b] = [a, b].map(|v| vertex(mesh, v).to_array().map(f32::to_bits));
                *open.entry([a, b]).or_default() += 1;
                *open.entry([b, a]).or_default() -= 1;
            }
        }
        assert!(open.values().all(|&count| count == 0), "cracks");
    }

    #[test]
    fn the_triangle_limit_is_kept_and_reported() {
        let mut scene = Scene::default();
        let rock = displaced_by(&mut scene, 4, 0.1, |_, _| 1.0);
        let mesh =
            Mesh::new("sheet", vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]], rock);
        let (fine, longest) = tessellate::subdivided(&mesh, &[Some(1e-3)], 5000);
        assert!(fine.triangles.len() <= 5000 && fine.triangles.len() > 1000);
        assert!(longest.is_some_and(|longest| (0.01..0.1).contains(&longest)), "{longest:?}");
    }

    #[test]
    fn meshes_without_uv_and_shapes_are_reported() {
        let mut scene = Scene::default();
        let rock = displaced_by(&mut scene, 4, 0.1, |_, _| 1.0);
        let sheet =
            Mesh::new("sheet", vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]], rock);
        let id = scene.add_mesh(sheet);
        scene.instances.push(Instance::new(id, DAffine3::IDENTITY));
        scene.shapes.push(Shape::sphere([0.0; 3], 1.0, rock));
        let loaded = applied(scene);
        let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
        let all = warnings.join("\n");
        assert!(all.contains("no texture coordinates") && all.contains("spheres and disks"), "{all}");
        assert_eq!(loaded.scene.instances[0].mesh, id);
    }

    /// The spacing of f32 at 1e8 is 8: an edge of that length has no midpoint and isn't cut.
    #[test]
    fn edges_without_a_representable_midpoint_are_not_cut() {
        let positions = vec![[1e8, 0.0, 0.0], [1e8 + 32.0, 0.0, 0.0], [1e8, 0.0, 1e-3]];
        let rock = displaced_by(&mut Scene::default(), 4, 1.0, |_, _| 1.0);
        let mesh = Mesh::new("far", positions, vec![[0, 1, 2]], rock);
        let (fine, longest) = tessellate::subdivided(&mesh, &[Some(1.0)], 10_000);
        assert!(longest.is_none() && (4..100).contains(&fine.triangles.len()), "{}", fine.triangles.len());
        let steps = fine.positions.iter().map(|p| (p[0] - 1e8) / 8.0);
        assert_eq!(steps.clone().fold(0.0, f32::max), 4.0);
        assert!([0.0, 1.0, 2.0, 3.0].iter().all(|n| steps.clone().any(|step| step == *n)));
    }

    /// The sides of a card have the same positions and opposite normals: each is displaced along its own normal.
    #[test]
    fn both_sides_of_a_card_are_displaced() {
        let mut scene = Scene::default();
        let rock = displaced_by(&mut scene, 4, 10.0, |_, _| 1.0);
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let normals = [[0.0, 0.0, 1.0]; 4].into_iter().chain([[0.0, 0.0, -1.0]; 4]).collect();
        let uv = vec![[0.5, 0.5]; 8];
        let triangles = vec![[0, 1, 2], [0, 2, 3], [6, 5, 4], [7, 6, 4]];
        let mesh = Mesh::new("card", [square, square].concat(), triangles, rock);
        let id = scene.add_mesh(Mesh { normals, uv_sets: vec![uv], ..mesh });
        scene.instances.push(Instance::new(id, DAffine3::IDENTITY));
        let loaded = applied(scene);
        let mesh = &loaded.scene.meshes[loaded.scene.instances[0].mesh.index()];
        let heights: Vec<f32> = mesh.positions.iter().map(|p| p[2]).collect();
        assert_eq!(heights, [0.375, 0.375, 0.375, 0.375, -0.375, -0.375, -0.375, -0.375]);
    }

    #[test]
    fn edge_lengths_far_beyond_the_budget_are_reported() {
        let mut scene = Scene::default();
        let rock = displaced_by(&mut scene, 4, 1e-6, |x, _| x as f32 / 4.0);
        scene.quads.push(Quad::new([0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], rock));
        let loaded = applied(scene);
        let messages: Vec<String> = loaded.warnings.iter().map(|w| w.message.clone()).collect();
        assert!(messages.iter().any(|w| w.contains("at least") && w.contains("is possible")), "{messages:?}");
        let triangles: usize = loaded.scene.meshes.iter().map(|mesh| mesh.triangles.len()).max().unwrap_or(0);
        assert!((10_000..1_000_000).contains(&triangles), "{triangles}");
    }
}
