//! Finds closed meshes of transmissive solids with inward orientation, whose triangles are then flipped.
//!
//! Orientation determines which side of an interface is the medium. The signed volume of a closed mesh (Zhang and Chen 2001,
//! "Efficient Feature Extraction for 2D/3D Objects in Mesh Representation", section 2) is negative for clockwise triangles.
//! Inward orientation is intended for cavities: inverted meshes inside a solid of the same material are kept.

use super::box_tree::{Bounds, BoxTree, Boxed, NumberedBox};
use super::material::CompiledMaterial;
use super::objects::part_materials;
use crate::error::{Warning, listed};
use crate::math::{DAffine3, DVec3};
use crate::scene::{Instance, MaterialId, Mesh, Scene, Shape, encloses, has_no_border, instance_extents};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// Whether each mesh must be flipped; empty if none must.
pub(super) fn find(scene: &Scene, materials: &[CompiledMaterial], warnings: &mut Vec<Warning>) -> Vec<bool> {
    let is_solid = |id: MaterialId| materials[id.index()].medium_index != 0;
    if !materials.iter().any(|m| m.medium_index != 0) {
        return Vec::new();
    }
    let mut instances: Vec<Vec<usize>> = vec![Vec::new(); scene.meshes.len()];
    for (number, instance) in scene.instances.iter().enumerate() {
        instances[instance.mesh.index()].push(number);
    }
    let is_solid_throughout = |&i: &usize| part_materials_of(scene, &scene.instances[i]).all(is_solid);
    let is_suspect = |&index: &usize| {
        let mesh = &scene.meshes[index];
        let is_solid = !instances[index].is_empty() && instances[index].iter().all(is_solid_throughout);
        is_solid && is_inverted(mesh) && (encloses(mesh) || has_no_border(mesh))
    };
    let suspects: Vec<usize> = (0..scene.meshes.len()).into_par_iter().filter(is_suspect).collect();
    if suspects.is_empty() {
        return Vec::new();
    }
    let bodies = Bodies::of(scene);
    let is_inside_out = |&index: &usize| !instances[index].iter().any(|&i| bodies.is_cavity(i));
    let found: Vec<usize> = suspects.into_par_iter().filter(is_inside_out).collect();
    let names: Vec<&str> = found.iter().map(|&index| scene.meshes[index].name.as_str()).collect();
    warnings.extend(warning(&names));
    let mut by_mesh = vec![false; if found.is_empty() { 0 } else { scene.meshes.len() }];
    found.into_iter().for_each(|index| by_mesh[index] = true);
    by_mesh
}

fn warning(names: &[&str]) -> Option<Warning> {
    let message = match names {
        [] => return None,
        [name] => format!(
            "the normals of mesh '{name}' point inwards: it is a closed transmissive solid, and its faces were flipped; flip \
            them in the file"
        ),
        _ => format!(
            "the normals of {} meshes point inwards ({}): they are closed transmissive solids, and their faces were flipped; flip \
            them in the file",
            names.len(),
            listed(names)
        ),
    };
    Some(Warning::general(("inside-out", message)))
}

fn part_materials_of<'a>(scene: &'a Scene, instance: &'a Instance) -> impl Iterator<Item = MaterialId> + 'a {
    part_materials(&scene.meshes[instance.mesh.index()], instance)
}

/// Is the signed volume of a mesh negative, by more than the rounding error of sheets without thickness?
fn is_inverted(mesh: &Mesh) -> bool {
    /// Minimum volume relative to (surface area)^(3/2); a pane of 1 m with a thickness of 1 mm has 3.5e-4.
    const MIN_VOLUME: f64 = 1e-6;
    let corners = mesh.triangles.iter().map(|t| mesh.corners_f64(*t));
    // Tetrahedra to the centroid avoid cancellation far from the origin, and limit the effect of misoriented triangles.
    let count = 3 * mesh.triangles.len().max(1);
    let middle = corners.clone().flatten().sum::<DVec3>() / count as f64;
    let (mut volume, mut area) = (0.0, 0.0);
    for [a, b, c] in corners {
        let normal = (b - a).cross(c - a);
        volume += (a - middle).dot(normal) / 6.0;
        area += normal.length() / 2.0;
    }
    volume < -MIN_VOLUME * area * area.sqrt()
}

/// Solids that may contain others: instances, then closed shapes.
struct Bodies<'a> {
    scene: &'a Scene,
    boxes: Vec<NumberedBox>,
    tree: BoxTree,
    /// By instance, computed on demand.
    windings: Vec<OnceLock<Winding>>,
}

impl Bodies<'_> {
    fn of(scene: &Scene) -> Bodies<'_> {
        let extents = instance_extents(scene).into_iter().map(|extent| extent.0);
        let of_instances = extents.map(|extent| extent.map(|(low, high)| Bounds { low, high }));
        let of_shape = |shape: &Shape| {
            let point = Bounds { low: shape.center, high: shape.center };
            shape.kind.is_closed().then(|| point.expanded(shape.radius))
        };
        let all = of_instances.chain(scene.shapes.iter().map(of_shape));
        let numbered = |(number, bounds): (usize, Option<Bounds>)| {
            Some(NumberedBox { bounds: bounds?, number: number as u32 })
        };
        let mut boxes: Vec<NumberedBox> = all.enumerate().filter_map(numbered).collect();
        let tree = BoxTree::sort(&mut boxes);
        let windings = scene.instances.iter().map(|_| OnceLock::new()).collect();
        Bodies { scene, boxes, tree, windings }
    }

    /// Is an instance inside another solid with one of its materials? Then its inward orientation is that of a cavity.
    fn is_cavity(&self, number: usize) -> bool {
        /// Maximum number of vertices to test.
        const POINTS: usize = 16;
        let instance = &self.scene.instances[number];
        let mesh = &self.scene.meshes[instance.mesh.index()];
        let step = mesh.triangles.len().div_ceil(POINTS).max(1);
        let points = mesh.triangles.iter().step_by(step).map(|t| {
            let p = mesh.positions[t[0] as usize];
            instance.world_from_object.transform_point3(p.map(f64::from).into())
        });
        let points: Vec<DVec3> = points.collect();
        let mut own_materials: Vec<MaterialId> = part_materials(mesh, instance).collect();
        own_materials.sort_unstable();
        let around = Bounds::of(points.iter().copied());
        self.tree.any(&around, |place| {
            let body = &self.boxes[place];
            body.number as usize != number
                && body.bounds.contains(&around)
                && self.contains(body.number as usize, &points, &own_materials)
        })
    }

    /// Does a body contain all points and have one of the materials `own` (sorted)?
    fn contains(&self, number: usize, points: &[DVec3], own: &[MaterialId]) -> bool {
        let has_material = |id: MaterialId| own.binary_search(&id).is_ok();
        let Some(body) = self.scene.instances.get(number) else {
            let shape = &self.scene.shapes[number - self.scene.instances.len()];
            return has_material(shape.material)
                && points.iter().all(|p| p.distance(shape.center) < shape.radius);
        };
        if !part_materials_of(self.scene, body).any(has_material) {
            return false;
        }
        let mesh = &self.scene.meshes[body.mesh.index()];
        let winding = self.windings[number].get_or_init(|| Winding::of(mesh, &body.world_from_object));
        points.iter().all(|&p| winding.is_inside(p))
    }
}

// Winding numbers by a hierarchy of triangles: distant clusters are approximated by dipoles (Barill, Dickson, Schmidt, Levin,
// Jacobson 2018, "Fast Winding Numbers for Soups and Clouds", first term of equation 13). Uncertain results are recomputed
// exactly.

/// Distance, in multiples of its radius, beyond which a cluster of triangles is approximated by a dipole.
const DIPOLE_DISTANCE: f64 = 3.0;

/// Approximate winding numbers within this distance of 1/2 are recomputed exactly. (Errors on usual meshes are at most a
/// tenth of it.)
const UNCERTAINTY: f64 = 0.2;

/// A triangle of a body in world space.
struct WorldTriangle([DVec3; 3]);

impl Boxed for WorldTriangle {
    fn bounds(&self) -> Bounds {
        Bounds::of(self.0)
    }
}

/// A cluster of triangles as a dipole.
#[derive(Clone, Copy, Default)]
struct Dipole {
    center: DVec3,
    radius: f64,
    /// Sum of normals with the length of twice the area.
    normal: DVec3,
}

/// The surface of an instance, for winding numbers.
pub(super) struct Winding {
    faces: Vec<WorldTriangle>,
    tree: BoxTree,
    /// By node of the tree.
    dipoles: Vec<Dipole>,
}

impl Winding {
    pub fn of(mesh: &Mesh, world_from_object: &DAffine3) -> Winding {
        let placed = |t: &[u32; 3]| mesh.corners_f64(*t).map(|p| world_from_object.transform_point3(p));
        let mut faces: Vec<WorldTriangle> = mesh.triangles.iter().map(|t| WorldTriangle(placed(t))).collect();
        let tree = BoxTree::sort(&mut faces);
        let dipoles = tree.nodes.iter().map(|node| Dipole::of(&faces[node.items()], node.bounds)).collect();
        Winding { faces, tree, dipoles }
    }

    /// Is a point inside, by the winding number?
    pub fn is_inside(&self, p: DVec3) -> bool {
        let approximate = self.approximate(p, &mut |_| ()).abs();
        let winding = if (approximate - 0.5).abs() < UNCERTAINTY { self.exact(p).abs() } else { approximate };
        winding > 0.5
    }

    /// The approximate winding number; `each` is called with each visited node.
    fn approximate(&self, p: DVec3, each: &mut impl FnMut(usize)) -> f64 {
        let mut sum = 0.0;
        self.tree.walk(|at, node, is_leaf| {
            each(at);
            let Dipole { center, radius, normal } = self.dipoles[at];
            let away = center - p;
            let distance = away.length();
            if distance > DIPOLE_DISTANCE * radius {
                // Half of the solid angle, as for triangles.
                sum += away.dot(normal) / (4.0 * distance.powi(3));
                return false;
            }
            if is_leaf {
                sum += self.faces[node.items()].iter().map(|face| half_angle(face, p)).sum::<f64>();
            }
            true
        });
        sum / TAU
    }

    /// The exact winding number.
    fn exact(&self, p: DVec3) -> f64 {
        self.faces.iter().map(|face| half_angle(face, p)).sum::<f64>() / TAU
    }
}

impl Dipole {
    fn of(faces: &[WorldTriangle], bounds: Bounds) -> Dipole {
        let of_face = |WorldTriangle([a, b, c]): &WorldTriangle| (*b - *a).cross(*c - *a);
        let center = (bounds.low + bounds.high) * 0.5;
        Dipole { center, radius: center.distance(bounds.high), normal: faces.iter().map(of_face).sum() }
    }
}

/// Half of the solid angle of a triangle (van Oosterom, Strackee 1983, "The Solid Angle of a Plane Triangle", equation 8).
fn half_angle(WorldTriangle(corners): &WorldTriangle, p: DVec3) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - p);
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let below = la * lb * lc + a.dot(b) * lc + a.dot(c) * lb + b.dot(c) * la;
    a.dot(b.cross(c)).atan2(below)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DAffine3;
    use crate::scene::{Material, MeshId, MeshPart};

    /// A tetrahedron of a size whose faces point inwards.
    fn inverted(name: usize, size: f32) -> Mesh {
        let part = MeshPart { first_triangle: 0, triangle_count: 4, material: MaterialId(0) };
        Mesh {
            name: name.to_string(),
            positions: [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
                .map(|p| p.map(|x| x * size))
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
            parts: vec![part],
            ..Mesh::default()
        }
    }

    fn scene(places: &[([f64; 3], f32)]) -> Scene {
        let mut scene = Scene::default();
        scene.add_material(Material::lambert("glass", [0.5; 3]));
        for (k, (place, size)) in places.iter().enumerate() {
            scene.meshes.push(inverted(k, *size));
            let at = DAffine3::from_translation(DVec3::from(*place));
            scene.instances.push(Instance::new(MeshId(k as u32), at));
        }
        scene
    }

    /// Bodies with disjoint bounds need no winding numbers.
    #[test]
    fn disjoint_bodies_have_no_cavities() {
        let places: Vec<([f64; 3], f32)> = (0..1000).map(|k| ([f64::from(k) * 2.0, 0.0, 0.0], 1.0)).collect();
        let scene = scene(&places);
        let bodies = Bodies::of(&scene);
        assert!((0..1000).all(|i| !bodies.is_cavity(i)));
        assert!(bodies.windings.iter().all(|winding| winding.get().is_none()));
        assert!(is_inverted(&scene.meshes[0]) && encloses(&scene.meshes[0]));
    }

    #[test]
    fn cavities_lie_in_bodies_of_their_material() {
        let places = [([0.0; 3], 10.0), ([1.0; 3], 0.5), ([1.0, 5.0, 5.0], 0.5), ([-1.0; 3], 0.5)];
        let mut scene = scene(&places);
        let holes = |scene: &Scene| [0, 1, 2, 3].map(|i| Bodies::of(scene).is_cavity(i));
        // The third is inside the bounds of the first, not in its volume.
        assert_eq!(holes(&scene), [false, true, false, false]);
        scene.instances[1].material = Some(MaterialId(1));
        assert_eq!(holes(&scene), [false; 4]);
        scene.shapes.push(Shape::sphere([-1.0; 3], 2.0, MaterialId(0)));
        assert_eq!(holes(&scene), [false, false, false, true]);
    }

    /// The majority of triangles determines the orientation; sheets without thickness have none.
    #[test]
    fn bodies_may_have_some_misoriented_triangles() {
        let mut mesh = inverted(0, 1.0);
        assert!(is_inverted(&mesh));
        mesh.triangles[2].swap(0, 1);
        assert!(is_inverted(&mesh) && encloses(&mesh) && has_no_border(&mesh));
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert!(!is_inverted(&mesh));
        let open = Mesh { triangles: mesh.triangles[..3].to_vec(), ..mesh.clone() };
        assert!(!has_no_border(&open));
        let doubled = vec![[0, 1, 2], [0, 2, 1]];
        assert!(!is_inverted(&Mesh { triangles: doubled, ..mesh }));
    }

    #[test]
    fn many_meshes_are_one_warning() {
        assert!(warning(&[]).is_none());
        let messages = |names: &[&str]| warning(names).expect("one").message;
        assert!(messages(&["a"]).contains("'a'"));
        let many = messages(&["a", "b", "c", "d", "e"]);
        assert!(many.contains("5 meshes") && many.contains("'a', 'b', 'c' and 2 more"), "{many}");
    }
}

#[cfg(test)]
mod winding_tests {
    use super::*;
    use crate::sampling::hash::mix64;

    /// A sphere of `n` by `2 n` patches, without the first `without` rows at the top.
    fn sphere(n: u32, without: u32) -> Mesh {
        let at = |i: u32, j: u32| {
            let (theta, phi) =
                (f64::from(i) / f64::from(n) * TAU / 2.0, f64::from(j % (2 * n)) / f64::from(n) * TAU / 2.0);
            [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()].map(|x| x as f32)
        };
        let positions = (0..=n).flat_map(|i| (0..2 * n).map(move |j| at(i, j))).collect();
        let index = |i: u32, j: u32| i * 2 * n + j % (2 * n);
        let patch = |i: u32, j: u32| {
            let (a, b, c, d) = (index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1));
            [[a, b, c], [a, c, d]]
        };
        let triangles = (without..n).flat_map(|i| (0..2 * n).flat_map(move |j| patch(i, j))).collect();
        Mesh { positions, triangles, ..Mesh::default() }
    }

    /// A point in the box of side 3 around the origin.
    fn point(number: u64) -> DVec3 {
        let part = |k: u64| (mix64(number * 3 + k) >> 11) as f64 / (1u64 << 53) as f64 * 3.0 - 1.5;
        DVec3::new(part(0), part(1), part(2))
    }

    #[test]
    fn inside_tests_match_exact_winding_numbers() {
        for mesh in [sphere(40, 0), sphere(40, 8), sphere(40, 20)] {
            let winding = Winding::of(&mesh, &DAffine3::IDENTITY);
            for p in (0..500).map(point) {
                let (approximate, exact) = (winding.approximate(p, &mut |_| ()), winding.exact(p));
                assert!((approximate - exact).abs() < UNCERTAINTY / 4.0, "{approximate} {exact} at {p}");
                assert_eq!(winding.is_inside(p), exact.abs() > 0.5);
            }
        }
    }

    #[test]
    fn the_cost_of_a_point_grows_slowly_with_triangles() {
        let visited_nodes = |n: u32| {
            let winding = Winding::of(&sphere(n, 0), &DAffine3::IDENTITY);
            let mut count = 0;
            for p in (0..100).map(point) {
                winding.approximate(p, &mut |_| count += 1);
            }
            count
        };
        // Sixteen times the triangles.
        let (few, many) = (visited_nodes(20), visited_nodes(80));
        assert!(many < 4 * few, "{few} {many}");
    }
}
