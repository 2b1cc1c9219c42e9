//! Bounding boxes of instances and of the scene.

use super::{Instance, Mesh, Quad, Scene, Splats};
use crate::math::DVec3;
use rayon::prelude::*;

/// Maximum number of vertices of all instances. Above it, the meshes with the most vertices are replaced by their bounding boxes.
const MAX_VERTICES: usize = 20_000_000;

/// A bounding box in world space, metres: minimum and maximum; `None` if empty.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extent(pub Option<(DVec3, DVec3)>);

impl Extent {
    fn grow(&mut self, p: DVec3) {
        let (low, high) = self.0.unwrap_or((p, p));
        self.0 = Some((low.min(p), high.max(p)));
    }

    fn join(&mut self, other: Extent) {
        if let Some((low, high)) = other.0 {
            self.grow(low);
            self.grow(high);
        }
    }
}

/// Points whose convex hull contains a mesh.
enum HullPoints<'m> {
    /// The vertices of a mesh whose flag is set.
    Vertices(&'m Mesh, Vec<bool>),
    /// The corners of its bounding box.
    BoxCorners(Vec<DVec3>),
}

impl HullPoints<'_> {
    /// Calls `each` with each point.
    fn visit(&self, mut each: impl FnMut(DVec3)) {
        match self {
            HullPoints::Vertices(mesh, used) => {
                let points = mesh.positions.iter().zip(used).filter(|(_, used)| **used);
                points.for_each(|(p, _)| each(DVec3::from(p.map(f64::from))));
            }
            HullPoints::BoxCorners(points) => points.iter().for_each(|&p| each(p)),
        }
    }

    /// The bounding box of the transformed points.
    fn extent(&self, place: impl Fn(DVec3) -> DVec3) -> Extent {
        let (mut low, mut high, mut is_empty) = (DVec3::INFINITY, DVec3::NEG_INFINITY, true);
        self.visit(|p| {
            let p = place(p);
            (low, high, is_empty) = (low.min(p), high.max(p), false);
        });
        Extent((!is_empty).then_some((low, high)))
    }
}

/// Points that bound the meshes of a scene, computed once for several queries. The scene may be invalid.
pub struct MeshHulls<'s> {
    scene: &'s Scene,
    points: Vec<HullPoints<'s>>,
}

impl<'s> MeshHulls<'s> {
    /// The hulls of a scene's meshes.
    pub fn of(scene: &'s Scene) -> MeshHulls<'s> {
        let mut instance_counts = vec![0usize; scene.meshes.len()];
        for instance in &scene.instances {
            if let Some(count) = instance_counts.get_mut(instance.mesh.index()) {
                *count += 1;
            }
        }
        let is_boxed = boxed_meshes(scene, &instance_counts);
        let points = |(mesh, &is_boxed): (_, &bool)| {
            let used = HullPoints::Vertices(mesh, used_vertices(mesh));
            if !is_boxed {
                return used;
            }
            let corners = |(low, high)| box_corners(low, high);
            HullPoints::BoxCorners(used.extent(|p| p).0.map_or(Vec::new(), corners))
        };
        MeshHulls { scene, points: scene.meshes.par_iter().zip(&is_boxed).map(points).collect() }
    }

    /// The bounding box of each instance, world space, without unused vertices; empty if the mesh doesn't exist.
    pub fn instance_extents(&self) -> Vec<Extent> {
        let extent_of = |i: &Instance| {
            let place = |p| i.world_from_object.transform_point3(p);
            self.points.get(i.mesh.index()).map_or(Extent::default(), |points| points.extent(place))
        };
        self.scene.instances.par_iter().map(extent_of).collect()
    }

    /// Calls `each` with points in world space whose convex hull contains all meshes, quads and axes of curves. Analytic shapes
    /// are not included.
    pub fn visit(&self, each: &mut dyn FnMut(DVec3)) {
        for instance in &self.scene.instances {
            if let Some(points) = self.points.get(instance.mesh.index()) {
                points.visit(|p| each(instance.world_from_object.transform_point3(p)));
            }
        }
        self.scene.quads.iter().flat_map(Quad::corners).for_each(&mut *each);
        self.scene.curves.iter().for_each(|curves| curves.visit(&mut |p, _| each(p)));
    }
}

/// The bounding box of each instance, by [`MeshHulls::instance_extents`].
pub fn instance_extents(scene: &Scene) -> Vec<Extent> {
    MeshHulls::of(scene).instance_extents()
}

/// Selects meshes to be replaced by their bounding boxes, so that at most [`MAX_VERTICES`] vertices of instances are left.
fn boxed_meshes(scene: &Scene, instance_counts: &[usize]) -> Vec<bool> {
    let placed = |i: usize| scene.meshes[i].positions.len().saturating_mul(instance_counts[i]);
    let mut remaining = (0..scene.meshes.len()).map(placed).fold(0, usize::saturating_add);
    let mut largest: Vec<usize> =
        (0..scene.meshes.len()).filter(|&i| scene.meshes[i].positions.len() > 8).collect();
    largest.sort_by_key(|&i| std::cmp::Reverse(placed(i)));
    let mut is_boxed = vec![false; scene.meshes.len()];
    for i in largest {
        if remaining <= MAX_VERTICES {
            break;
        }
        is_boxed[i] = true;
        remaining = remaining.saturating_sub(placed(i)).saturating_add(instance_counts[i].saturating_mul(8));
    }
    is_boxed
}

/// Whether each vertex is used by a triangle or a visible splat.
fn used_vertices(mesh: &Mesh) -> Vec<bool> {
    if let Some(splats) = &mesh.splats {
        return splats.opacities.iter().map(|opacity| *opacity >= Splats::MIN_OPACITY).collect();
    }
    let mut used = vec![false; mesh.positions.len()];
    for &i in mesh.triangles.as_flattened() {
        if let Some(used) = used.get_mut(i as usize) {
            *used = true;
        }
    }
    used
}

fn box_corners(low: DVec3, high: DVec3) -> Vec<DVec3> {
    let pick = |bits: u32, k: usize| if bits >> k & 1 == 0 { low[k] } else { high[k] };
    (0..8).map(|bits| DVec3::new(pick(bits, 0), pick(bits, 1), pick(bits, 2))).collect()
}

/// The bounding box of the scene, given the result of [`instance_extents`].
pub fn scene_extent(scene: &Scene, instances: &[Extent]) -> Extent {
    let mut all = Extent::default();
    instances.iter().for_each(|e| all.join(*e));
    for shape in &scene.shapes {
        all.grow(shape.center - shape.half_extent());
        all.grow(shape.center + shape.half_extent());
    }
    for q in &scene.quads {
        q.corners().into_iter().for_each(|p| all.grow(p));
    }
    for curves in &scene.curves {
        curves.visit(&mut |p, radius| {
            all.grow(p - radius);
            all.grow(p + radius);
        });
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DAffine3;
    use crate::scene::{MaterialId, MeshId, Shape};

    #[test]
    fn boxes_contain_instances_and_shapes_without_unused_vertices() {
        let mut scene = Scene::default();
        assert_eq!(scene_extent(&scene, &instance_extents(&scene)), Extent(None));
        scene.meshes.push(Mesh {
            // The last vertex is part of no triangle.
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [99.0; 3]],
            triangles: vec![[0, 1, 2]],
            ..Mesh::default()
        });
        scene.instances.push(Instance::new(MeshId(0), DAffine3::from_translation(DVec3::Z)));
        let boxes = instance_extents(&scene);
        assert_eq!(boxes, [Extent(Some((DVec3::Z, DVec3::new(1.0, 2.0, 1.0))))]);
        scene.shapes.push(Shape::sphere(DVec3::ZERO, 3.0, MaterialId(0)));
        assert_eq!(scene_extent(&scene, &boxes), Extent(Some((DVec3::splat(-3.0), DVec3::splat(3.0)))));
    }

    /// A thousand meshes of twenty thousand vertices with three instances each exceed the limit.
    #[test]
    fn meshes_with_many_placed_vertices_are_replaced_by_boxes() {
        let mut scene = Scene::default();
        let sheet = |n: usize, z: f32| Mesh { positions: vec![[1.0, 2.0, z]; n], ..Mesh::default() };
        scene.meshes = (0..1000).map(|i| sheet(20_000, i as f32)).collect();
        scene.meshes.push(sheet(5, -1.0));
        let is_boxed = boxed_meshes(&scene, &vec![3; 1001]);
        // 333 meshes of 60,000 vertices are 19.98 million, the corners of 667 boxes 16,008 more.
        assert_eq!(is_boxed.iter().filter(|is| **is).count(), 667);
        assert!(is_boxed[..667].iter().all(|is| *is) && !is_boxed[1000]);
        assert!(boxed_meshes(&scene, &vec![0; 1001]).iter().all(|is| !is));
    }
}
