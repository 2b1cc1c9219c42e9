//! Whether the surfaces of a material are watertight.

use super::{MaterialId, Mesh, Scene};
use crate::math::DVec3;
use crate::sampling::hash::mix64;
use std::collections::HashSet;

/// Watertightness of all surfaces of a material together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watertightness {
    /// No surfaces.
    None,
    /// Some surfaces have borders.
    Open,
    /// Every edge belongs to an even number of faces.
    Closed,
}

/// The objects that use each material of a scene.
pub struct MaterialUses<'s> {
    scene: &'s Scene,
    /// Indexed by material.
    of_materials: Vec<Uses>,
}

/// Indices of the objects that use a material; meshes are sorted and distinct.
#[derive(Clone, Default)]
struct Uses {
    meshes: Vec<usize>,
    quads: Vec<usize>,
    shapes: Vec<usize>,
    has_curves: bool,
}

impl MaterialUses<'_> {
    /// The uses of a scene's materials. Invalid references are ignored.
    pub fn of(scene: &Scene) -> MaterialUses<'_> {
        let mut of_materials = vec![Uses::default(); scene.materials.len()];
        let mut update = |id: MaterialId, change: &mut dyn FnMut(&mut Uses)| {
            of_materials.get_mut(id.index()).map(change).unwrap_or_default();
        };
        let (mut is_placed, mut replaced) = (vec![false; scene.meshes.len()], HashSet::new());
        for instance in &scene.instances {
            match (instance.material, is_placed.get_mut(instance.mesh.index())) {
                (Some(material), _) => drop(replaced.insert((material, instance.mesh.index()))),
                (None, Some(is_placed)) => *is_placed = true,
                (None, None) => {}
            }
        }
        let of_parts = scene.meshes.iter().enumerate().filter(|(i, _)| is_placed[*i]);
        let of_parts = of_parts.flat_map(|(i, mesh)| mesh.parts.iter().map(move |part| (part.material, i)));
        for (id, mesh) in of_parts.chain(replaced.iter().copied()) {
            update(id, &mut |uses| uses.meshes.push(mesh));
        }
        scene.quads.iter().enumerate().for_each(|(i, q)| update(q.material, &mut |uses| uses.quads.push(i)));
        scene
            .shapes
            .iter()
            .enumerate()
            .for_each(|(i, s)| update(s.material, &mut |uses| uses.shapes.push(i)));
        scene.curves.iter().for_each(|curves| update(curves.material, &mut |uses| uses.has_curves = true));
        for uses in &mut of_materials {
            uses.meshes.sort_unstable();
            uses.meshes.dedup();
        }
        MaterialUses { scene, of_materials }
    }

    /// Watertightness of a material. Whole meshes are tested, since a body may have several materials; all quads of the material are
    /// tested together; spheres are always closed.
    pub fn watertightness(&self, material: MaterialId) -> Watertightness {
        let Some(uses) = self.of_materials.get(material.index()) else { return Watertightness::None };
        let (mut edges, mut count) = (EdgeHash::default(), 0);
        for mesh in uses.meshes.iter().filter_map(|&i| self.scene.meshes.get(i)) {
            count += mesh.triangles.len();
            edges.add_mesh(mesh);
        }
        for quad in uses.quads.iter().map(|&i| &self.scene.quads[i]) {
            count += 1;
            let c = quad.corner;
            let corners = [c, c + quad.edge_u, c + quad.edge_u + quad.edge_v, c + quad.edge_v];
            edges.add_polygon(&corners.map(|p| p.as_vec3().to_array()));
        }
        let are_closed = uses.shapes.iter().all(|&i| self.scene.shapes[i].kind.is_closed());
        match count {
            0 if uses.shapes.is_empty() && !uses.has_curves => Watertightness::None,
            _ if edges.sum == 0 && are_closed && !uses.has_curves => Watertightness::Closed,
            _ => Watertightness::Open,
        }
    }
}

/// Maximum area of the openings of a solid over its surface area.
const LARGEST_OPENING: f64 = 0.05;

/// Whether a mesh encloses a volume up to small holes (like a bottle, unlike a single-sheet window or bowl). The area of the
/// openings is estimated by the sum of the triangles' vector areas, which is zero for closed meshes.
pub(crate) fn encloses(mesh: &Mesh) -> bool {
    let mut edges = EdgeHash::default();
    edges.add_mesh(mesh);
    if edges.sum == 0 {
        return true;
    }
    let (mut open, mut area) = (DVec3::ZERO, 0.0);
    for triangle in &mesh.triangles {
        let [a, b, c] = mesh.corners_f64(*triangle);
        let vector = (b - a).cross(c - a);
        open += vector;
        area += vector.length();
    }
    open.length() <= LARGEST_OPENING * area
}

/// Whether each edge of a mesh belongs to several faces, of any winding order.
pub(crate) fn has_no_border(mesh: &Mesh) -> bool {
    let directed_edges = mesh.triangles.iter().flat_map(|triangle| {
        let [a, b, c] = mesh.corners(*triangle).map(position_hash);
        [(a, b), (b, c), (c, a)]
    });
    let mut edges: Vec<u64> = directed_edges.filter(|(a, b)| a != b).map(|(a, b)| edge_hash(a, b)).collect();
    edges.sort_unstable();
    !edges.is_empty() && edges.chunk_by(u64::eq).all(|faces| faces.len() > 1)
}

/// XOR of the hashes of all face edges: 0 if every edge belongs to an even number of faces (false positives: 2^-64).
#[derive(Default)]
struct EdgeHash {
    sum: u64,
}

impl EdgeHash {
    fn add_mesh(&mut self, mesh: &Mesh) {
        for triangle in &mesh.triangles {
            self.add_polygon(&mesh.corners(*triangle));
        }
    }

    /// Vertices are identified by position: they may be split for normals or UVs.
    fn add_polygon(&mut self, corners: &[[f32; 3]]) {
        let Some(&last) = corners.last() else { return };
        let mut previous = position_hash(last);
        for &corner in corners {
            let point = position_hash(corner);
            if point != previous {
                self.sum ^= edge_hash(point, previous);
            }
            previous = point;
        }
    }
}

/// Hash of an undirected edge from those of its vertices.
fn edge_hash(a: u64, b: u64) -> u64 {
    mix64(a.wrapping_add(b))
}

fn position_hash(position: [f32; 3]) -> u64 {
    // Maps -0.0 to 0.0.
    let [x, y, z] = position.map(|c| u64::from((c + 0.0).to_bits()));
    mix64(mix64(x | y << 32) ^ (z.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DAffine3, DVec3};
    use crate::scene::{Instance, Material, MeshId, MeshPart, Quad};

    /// Watertightness of a box of which only the first `faces` quads exist.
    fn watertightness_of_box(faces: usize) -> Watertightness {
        let (x, y, z) = (DVec3::X, DVec3::Y * 2.0, DVec3::Z * 3.0);
        let all =
            [(DVec3::ZERO, y, x), (z, x, y), (DVec3::ZERO, x, z), (y, z, x), (DVec3::ZERO, z, y), (x, y, z)];
        let mut scene = Scene::default();
        for &(corner, edge_u, edge_v) in &all[..faces] {
            scene.quads.push(Quad::new(corner, edge_u, edge_v, MaterialId(3)));
        }
        for name in 0..4 {
            scene.add_material(Material::lambert(name.to_string(), [0.5; 3]));
        }
        MaterialUses::of(&scene).watertightness(MaterialId(3))
    }

    #[test]
    fn box_of_quads_is_closed_with_all_faces() {
        assert_eq!([0, 1, 5, 6].map(watertightness_of_box), {
            [Watertightness::None, Watertightness::Open, Watertightness::Open, Watertightness::Closed]
        });
    }

    /// Linear complexity in the number of objects, regardless of the number of materials.
    #[test]
    fn objects_are_listed_once_per_material() {
        let mut scene = Scene::default();
        for k in 0..100 {
            let material = scene.add_material(Material::lambert(k.to_string(), [0.5; 3]));
            let part = MeshPart { first_triangle: 0, triangle_count: 0, material };
            scene.meshes.push(Mesh { parts: vec![part], ..Mesh::default() });
            let placed = Instance::new(MeshId(k), DAffine3::IDENTITY);
            let other = Instance { material: Some(MaterialId(k / 2)), ..placed.clone() };
            scene.instances.extend([placed.clone(), placed, other]);
        }
        let uses = MaterialUses::of(&scene);
        assert_eq!(uses.of_materials.iter().map(|uses| uses.meshes.len()).sum::<usize>(), 100 + 99);
        assert_eq!(
            (&uses.of_materials[3].meshes[..], &uses.of_materials[0].meshes[..]),
            (&[3, 6, 7][..], &[0, 1][..])
        );
    }

    #[test]
    fn small_holes_are_ignored() {
        let n = 12;
        let point = |i: u32, j: u32| {
            let (theta, phi) =
                (f64::from(j) * std::f64::consts::PI / 12.0, f64::from(i) * std::f64::consts::TAU / 12.0);
            let p = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()];
            p.map(|c| c as f32)
        };
        let ball = |first_ring: u32| {
            let mut mesh = Mesh::default();
            for (i, j) in (first_ring..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
                let start = mesh.positions.len() as u32;
                let next = (i + 1) % n;
                mesh.positions.extend([point(i, j), point(i, j + 1), point(next, j + 1), point(next, j)]);
                mesh.triangles.extend([[start, start + 1, start + 2], [start, start + 2, start + 3]]);
            }
            mesh
        };
        assert!(encloses(&ball(1)) && !encloses(&ball(6)) && !encloses(&ball(11)));
    }

    #[test]
    fn edge_hash_ignores_direction() {
        let sum = |edges: &[[[f32; 3]; 2]]| {
            let mut e = EdgeHash::default();
            edges.iter().for_each(|edge| e.add_polygon(edge));
            e.sum
        };
        let (a, b, c, d) = ([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let mut e = EdgeHash::default();
        e.add_polygon(&[a, b, c]);
        e.add_polygon(&[c, b, a]);
        assert_eq!(e.sum, 0);
        e.add_polygon(&[a, b, d]);
        assert_ne!(e.sum, 0);
        // A polygon of two vertices has its edge twice.
        assert_eq!(sum(&[[a, b]]), 0);
    }
}
