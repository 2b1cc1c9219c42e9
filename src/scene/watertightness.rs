//! Whether the surfaces of a material are closed, so that they bound a solid.

use super::{MaterialId, Mesh, Scene};
use crate::math::DVec3;
use crate::sampling::hash::mix64;
use std::collections::HashSet;

/// Properties of a material's surfaces together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watertightness {
    /// There are none.
    None,
    /// Some end at an edge.
    Open,
    /// They enclose bodies: each edge belongs to an even number of faces.
    Closed,
}

/// Which objects of a scene have each material, for all materials at once.
pub struct MaterialUses<'s> {
    scene: &'s Scene,
    /// By material.
    of_materials: Vec<Uses>,
}

/// The objects that have a material, by index; meshes once each, in order.
#[derive(Clone, Default)]
struct Uses {
    meshes: Vec<usize>,
    quads: Vec<usize>,
    shapes: Vec<usize>,
    has_curves: bool,
}

impl MaterialUses<'_> {
    /// The uses of a scene's materials. Objects of materials that don't exist are ignored.
    pub fn of(scene: &Scene) -> MaterialUses<'_> {
        let mut of_materials = vec![Uses::default(); scene.materials.len()];
        let mut add = |id: MaterialId, to: &mut dyn FnMut(&mut Uses)| {
            of_materials.get_mut(id.index()).map(to).unwrap_or_default();
        };
        let (mut is_placed, mut replaced) = (vec![false; scene.meshes.len()], HashSet::new());
        for instance in &scene.instances {
            match (instance.material, is_placed.get_mut(instance.mesh.index())) {
                (Some(own), _) => drop(replaced.insert((own, instance.mesh.index()))),
                (None, Some(is_placed)) => *is_placed = true,
                (None, None) => {}
            }
        }
        let of_parts = scene.meshes.iter().enumerate().filter(|(i, _)| is_placed[*i]);
        let of_parts = of_parts.flat_map(|(i, mesh)| mesh.parts.iter().map(move |part| (part.material, i)));
        for (id, mesh) in of_parts.chain(replaced.iter().copied()) {
            add(id, &mut |uses| uses.meshes.push(mesh));
        }
        scene.quads.iter().enumerate().for_each(|(i, q)| add(q.material, &mut |uses| uses.quads.push(i)));
        scene.shapes.iter().enumerate().for_each(|(i, s)| add(s.material, &mut |uses| uses.shapes.push(i)));
        scene.curves.iter().for_each(|curves| add(curves.material, &mut |uses| uses.has_curves = true));
        for uses in &mut of_materials {
            uses.meshes.sort_unstable();
            uses.meshes.dedup();
        }
        MaterialUses { scene, of_materials }
    }

    /// Whether all that has a material is watertight together. Meshes count as wholes, since a body may have several materials; quads of one
    /// material belong together, spheres are always closed.
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
        let are_closed = uses.shapes.iter().all(|&i| self.scene.shapes[i].kind.tag().is_closed());
        match count {
            0 if uses.shapes.is_empty() && !uses.has_curves => Watertightness::None,
            _ if edges.sum == 0 && are_closed && !uses.has_curves => Watertightness::Closed,
            _ => Watertightness::Open,
        }
    }
}

/// The largest opening of a body, over its surface.
const LARGEST_OPENING: f64 = 0.05;

/// Does a mesh enclose a volume, up to small holes? A bottle does, a window pane of one sheet or a bowl
/// without thickness does not. The openings are measured by the sum of the triangles' vector areas, which is zero for
/// closed meshes.
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

/// Does each edge of a mesh belong to several faces? They may be doubled, and run around in any way.
pub(crate) fn has_no_border(mesh: &Mesh) -> bool {
    let sides = mesh.triangles.iter().flat_map(|triangle| {
        let [a, b, c] = mesh.corners(*triangle).map(key);
        [(a, b), (b, c), (c, a)]
    });
    let mut edges: Vec<u64> = sides.filter(|(a, b)| a != b).map(|(a, b)| of_edge(a, b)).collect();
    edges.sort_unstable();
    !edges.is_empty() && edges.chunk_by(u64::eq).all(|faces| faces.len() > 1)
}

/// The exclusive or of a number for each edge: 0 if each belongs to an even number of faces (by chance once in 2^64).
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

    /// Edges go by the positions of their ends: vertices may be split for normals or texture coordinates.
    fn add_polygon(&mut self, corners: &[[f32; 3]]) {
        let Some(&last) = corners.last() else { return };
        let mut before = key(last);
        for &corner in corners {
            let at = key(corner);
            if at != before {
                self.sum ^= of_edge(at, before);
            }
            before = at;
        }
    }
}

/// A hash of an edge by those of its ends, the same in both directions.
fn of_edge(a: u64, b: u64) -> u64 {
    mix64(a.wrapping_add(b))
}

/// A hash of a position.
fn key(position: [f32; 3]) -> u64 {
    // Both zeros are one place.
    let [x, y, z] = position.map(|c| u64::from((c + 0.0).to_bits()));
    mix64(mix64(x | y << 32) ^ (z.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DAffine3, DVec3};
    use crate::scene::{Instance, Material, MeshId, MeshPart, Quad};

    /// A box of quads with some faces left out.
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
    fn boxes_are_closed_with_all_their_faces() {
        assert_eq!([0, 1, 5, 6].map(watertightness_of_box), {
            [Watertightness::None, Watertightness::Open, Watertightness::Open, Watertightness::Closed]
        });
    }

    /// The work for all materials together grows with the objects, not with their product with the materials.
    #[test]
    fn each_object_is_noted_for_its_own_materials_only() {
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
    fn a_hole_makes_no_sheet_of_a_body() {
        let n = 12;
        let at = |i: u32, j: u32| {
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
                mesh.positions.extend([at(i, j), at(i, j + 1), at(next, j + 1), at(next, j)]);
                mesh.triangles.extend([[start, start + 1, start + 2], [start, start + 2, start + 3]]);
            }
            mesh
        };
        assert!(encloses(&ball(1)) && !encloses(&ball(6)) && !encloses(&ball(11)));
    }

    #[test]
    fn the_order_of_ends_does_not_matter_but_the_pairing_does() {
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
        // A polygon of two corners has its edge twice.
        assert_eq!(sum(&[[a, b]]), 0);
    }
}
