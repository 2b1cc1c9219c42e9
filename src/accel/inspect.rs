//! Traversals of a finished BVH outside of rendering: validation of its invariants, and the distance of a point from the geometry.

use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, CurvePacket, DONE, LEAF, LeafPacket, NODE_LINES, Node, PART_QUAD_SECOND,
    SplatPacket, TRIANGLE_LINES, TrianglePacket, leaf_packets, line_of, view,
};
use super::{Accel, TreeSummary};
use crate::math::{Bounds3, Vec3};
use crate::shape::triangle::LANES;
use crate::shape::{Analytic, Shape};
use std::collections::HashSet;

/// Primitives and instances found while validating a tree.
#[derive(Default)]
struct Found {
    /// Primitive ids; quads are counted by their first half.
    ids: Vec<u32>,
    instances: usize,
}

impl Accel {
    /// Checks that all references stay in the buffer, that boxes bound their subtrees, that each primitive and instance is
    /// referenced exactly once, and that no path exceeds the depth assumed for the traversal stacks.
    pub fn validate(&self) -> Result<(), String> {
        let roots: HashSet<u32> = self.expected.iter().map(|tree| tree.root).collect();
        self.expected.iter().try_for_each(|tree| self.validate_tree(tree, &roots))
    }

    fn validate_tree(&self, tree: &TreeSummary, roots: &HashSet<u32>) -> Result<(), String> {
        let mut found = Found::default();
        let unbounded = Bounds3 { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
        let mut stack = vec![(tree.root, unbounded, 1)];
        while let Some((reference, bounds, depth)) = stack.pop() {
            if reference & LEAF != 0 {
                self.validate_leaf(reference, &bounds, roots, &mut found)?;
                continue;
            }
            if depth > tree.depth.max(1) {
                return Err(format!("node {reference} is deeper than {}", tree.depth));
            }
            let node = view::<Node, NODE_LINES>(&self.lines, line_of(reference))
                .ok_or_else(|| format!("node {reference} lies outside of the buffer"))?;
            for lane in 0..8 {
                let at = |plane: usize| node.planes[plane][lane];
                let child =
                    Bounds3 { min: Vec3::new(at(0), at(2), at(4)), max: Vec3::new(at(1), at(3), at(5)) };
                if node.child[lane] == DONE {
                    if !child.is_empty() {
                        return Err(format!("node {reference}: unused child {lane} has a box"));
                    }
                    continue;
                }
                if bounds.union(child) != bounds {
                    return Err(format!(
                        "node {reference}: the box of child {lane} exceeds the box of its parent"
                    ));
                }
                stack.push((node.child[lane], child, depth + 1));
            }
        }
        found.ids.sort_unstable();
        let count = found.ids.len();
        found.ids.dedup();
        if (count, found.ids.len(), found.instances) != (tree.primitives, tree.primitives, tree.instances) {
            return Err(format!(
                "{count} primitives ({} distinct) and {} instances are reached, not {} and {}",
                found.ids.len(),
                found.instances,
                tree.primitives,
                tree.instances
            ));
        }
        Ok(())
    }

    /// Checks the packets of a leaf.
    fn validate_leaf(
        &self,
        first: u32,
        bounds: &Bounds3,
        roots: &HashSet<u32>,
        found: &mut Found,
    ) -> Result<(), String> {
        for packet in leaf_packets(&self.lines, first) {
            match packet.map_err(|reference| format!("reference {reference:#x} leads to no packet"))? {
                LeafPacket::Triangles(triangles) => validate_triangles(triangles, bounds, found)?,
                LeafPacket::MovingTriangles(line, keys) => self.validate_moving(line, keys, bounds, found)?,
                LeafPacket::Curves(curves) => validate_curves(curves, bounds, found)?,
                LeafPacket::Splats(splats) => validate_splats(splats, bounds, found)?,
                LeafPacket::Analytic(shapes) => {
                    found.ids.extend(shapes.id.iter().filter(|id| **id != u32::MAX));
                }
                LeafPacket::Instance(record) => {
                    if !roots.contains(&record.root) {
                        return Err(format!("instance {} refers to no tree", record.instance));
                    }
                    found.instances += 1;
                }
            }
        }
        Ok(())
    }

    /// Checks the triangles of a moving packet at each motion key.
    fn validate_moving(
        &self,
        line: usize,
        keys: usize,
        bounds: &Bounds3,
        found: &mut Found,
    ) -> Result<(), String> {
        for key in 0..keys {
            let at = line + ANALYTIC_LINES + key * TRIANGLE_LINES;
            let triangles = view::<TrianglePacket, TRIANGLE_LINES>(&self.lines, at);
            let triangles = triangles.ok_or_else(|| format!("packet {line:#x} lacks its key {key}"))?;
            let mut at_key = Found::default();
            validate_triangles(triangles, bounds, &mut at_key)?;
            if key == 0 {
                found.ids.extend(at_key.ids);
            }
        }
        Ok(())
    }
}

fn validate_curves(packet: &CurvePacket, bounds: &Bounds3, found: &mut Found) -> Result<(), String> {
    for lane in 0..packet.lanes() {
        if bounds.union(packet.segment(lane).bounds()) != *bounds {
            return Err(format!("primitive {} exceeds its box", packet.id[lane]));
        }
        found.ids.push(packet.id[lane]);
    }
    Ok(())
}

fn validate_splats(packet: &SplatPacket, bounds: &Bounds3, found: &mut Found) -> Result<(), String> {
    for lane in (0..LANES).filter(|lane| packet.id[*lane] != u32::MAX) {
        if bounds.with(packet.center(lane)) != *bounds {
            return Err(format!("primitive {} exceeds its box", packet.id[lane]));
        }
        found.ids.push(packet.id[lane]);
    }
    Ok(())
}

fn validate_triangles(packet: &TrianglePacket, bounds: &Bounds3, found: &mut Found) -> Result<(), String> {
    for lane in (0..LANES).filter(|lane| packet.id(*lane) != u32::MAX) {
        for vertex in 0..3 {
            let at = |axis: usize| packet.rows[4 * axis + vertex][lane];
            let point = Vec3::new(at(0), at(1), at(2));
            if bounds.with(point) != *bounds {
                return Err(format!("primitive {} exceeds its box", packet.id(lane)));
            }
        }
        if packet.part(lane) != PART_QUAD_SECOND {
            found.ids.push(packet.id(lane));
        }
    }
    Ok(())
}

/// A reference to visit and its distance bound (distance from its box), metres.
type Candidate = (u32, f32);

impl Accel {
    /// Distance of a point from the geometry, metres: exact for triangles and quads; a lower bound for other primitives (distance from
    /// the bounding sphere of an analytic shape, the box of an instance or splat). Infinite if the scene is empty.
    pub fn distance(&self, p: Vec3) -> f32 {
        let mut nearest = f32::INFINITY;
        let mut stack: Vec<Candidate> = vec![(self.root, box_distance(self.bounds.min, self.bounds.max, p))];
        while let Some((reference, bound)) = stack.pop() {
            if bound >= nearest || reference == DONE {
                continue;
            }
            if reference & LEAF != 0 {
                nearest = nearest.min(self.leaf_distance(reference, bound, p, &mut stack));
            } else if let Some(node) = view::<Node, NODE_LINES>(&self.lines, line_of(reference)) {
                push_children(node, p, nearest, &mut stack);
            }
        }
        nearest
    }

    /// The distance from the primitives of a leaf; `bound` is the distance from the leaf's box. The world's tree below a top tree is
    /// pushed to the stack.
    fn leaf_distance(&self, first: u32, bound: f32, p: Vec3, stack: &mut Vec<Candidate>) -> f32 {
        let mut nearest = f32::INFINITY;
        for packet in leaf_packets(&self.lines, first).map_while(Result::ok) {
            let distance = match packet {
                LeafPacket::Triangles(triangles) => triangles_distance(triangles, p),
                LeafPacket::Analytic(shapes) => analytic_distance(shapes, p),
                LeafPacket::Curves(curves) => curves_distance(curves, p),
                // Splats have no surface.
                LeafPacket::Splats(_) => bound,
                LeafPacket::Instance(record) if record.instance == 0 => {
                    stack.push((record.root, bound));
                    f32::INFINITY
                }
                LeafPacket::Instance(_) => bound,
                LeafPacket::MovingTriangles(..) => f32::INFINITY,
            };
            nearest = nearest.min(distance);
        }
        nearest
    }
}

/// The distance of a point from a box, 0 inside.
fn box_distance(min: Vec3, max: Vec3, p: Vec3) -> f32 {
    (min - p).max(p - max).max(Vec3::ZERO).length()
}

/// Pushes the children whose boxes are nearer than `nearest`, sorted with the nearest on top.
fn push_children(node: &Node, p: Vec3, nearest: f32, stack: &mut Vec<Candidate>) {
    let start = stack.len();
    for lane in (0..8).filter(|lane| node.child[*lane] != DONE) {
        let at = |plane: usize| node.planes[plane][lane];
        let (min, max) = (Vec3::new(at(0), at(2), at(4)), Vec3::new(at(1), at(3), at(5)));
        let bound = box_distance(min, max, p);
        if bound < nearest {
            stack.push((node.child[lane], bound));
        }
    }
    stack[start..].sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
}

/// The distance from curve segments, bounded by capsules of the larger radius.
fn curves_distance(packet: &CurvePacket, p: Vec3) -> f32 {
    let one = |lane: usize| {
        let segment = packet.segment(lane);
        let [a, b] = segment.ends;
        let along_segment = b - a;
        let along = ((p - a).dot(along_segment) / along_segment.length_squared().max(f32::MIN_POSITIVE))
            .clamp(0.0, 1.0);
        (p.distance(a + along_segment * along) - segment.radii[0].max(segment.radii[1])).max(0.0)
    };
    (0..packet.lanes()).map(one).fold(f32::INFINITY, f32::min)
}

fn analytic_distance(packet: &AnalyticPacket, p: Vec3) -> f32 {
    let shapes = (0..LANES).filter_map(|lane| Analytic::unpack(&packet.packed(lane)));
    let distances = shapes.map(|shape| {
        let (center, radius) = shape.center_and_radius();
        let outside = p.distance(center) - radius;
        // For flat shapes, within their bounding sphere, the distance from the plane is a bound too.
        let from_plane = || shape.normal().map_or(0.0, |normal| (p - center).dot(normal).abs());
        if shape.is_flat() { outside.max(from_plane()) } else { outside.abs() }
    });
    distances.fold(f32::INFINITY, f32::min)
}

/// The distance from four triangles; unused lanes are NaN, which `f32::min` ignores.
fn triangles_distance(packet: &TrianglePacket, p: Vec3) -> f32 {
    let one = |lane: usize| {
        let [a, b, c] =
            [0, 1, 2].map(|k| Vec3::from_array([0, 1, 2].map(|axis: usize| packet.rows[4 * axis + k][lane])));
        p.distance(nearest_of_triangle(p, [a, b, c]))
    };
    (0..LANES).map(one).fold(f32::INFINITY, f32::min)
}

/// The point of a triangle nearest to `p`: its projection where that is inside, else the nearest point of an edge.
fn nearest_of_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let normal = (b - a).cross(c - a);
    let is_inside = |from: Vec3, to: Vec3| (to - from).cross(p - from).dot(normal) >= 0.0;
    if normal.length_squared() > 0.0 && is_inside(a, b) && is_inside(b, c) && is_inside(c, a) {
        return p - normal * ((p - a).dot(normal) / normal.length_squared());
    }
    let on_edge = |from: Vec3, to: Vec3| {
        let (along, length) = (to - from, (to - from).length_squared());
        let t = if length > 0.0 { ((p - from).dot(along) / length).clamp(0.0, 1.0) } else { 0.0 };
        from + along * t
    };
    let edges = [on_edge(a, b), on_edge(b, c), on_edge(c, a)];
    let nearer = |x: Vec3, y: Vec3| if p.distance_squared(y) < p.distance_squared(x) { y } else { x };
    nearer(nearer(edges[0], edges[1]), edges[2])
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Rng, soup};
    use super::super::{AccelInstance, Geometry};
    use super::*;
    use crate::math::{DAffine3, DVec3};
    use crate::shape::Disk;

    /// Distance from a triangle by brute force over a fine barycentric grid, metres.
    fn grid_distance(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
        const STEPS: u32 = 60;
        let grid = (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |j| (i, j)));
        let at = |(i, j): (u32, u32)| {
            let (u, v) = (i as f32 / STEPS as f32, j as f32 / STEPS as f32);
            p.distance(a * (1.0 - u - v) + b * u + c * v)
        };
        grid.map(at).fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn distances_agree_with_brute_force() {
        let geometry = soup(60, 0.2, 5);
        let accel = Accel::build(std::slice::from_ref(&geometry), &[]);
        let mut rng = Rng::new(7);
        for _ in 0..100 {
            let p = rng.vector() * 1.5;
            let corners = |t: &[u32; 3]| t.map(|i| Vec3::from_array(geometry.positions[i as usize]));
            let triangles = geometry.triangles.iter().map(|t| grid_distance(p, corners(t)));
            let quads = geometry.quads.iter().flat_map(|q| {
                let (a, b, c, d) =
                    (q.corner, q.corner + q.edge_u, q.corner + q.edge_u + q.edge_v, q.corner + q.edge_v);
                [grid_distance(p, [a, b, c]), grid_distance(p, [a, c, d])]
            });
            let spheres = geometry.analytic.iter().map(|s| {
                let (center, radius) = s.center_and_radius();
                (p.distance(center) - radius).abs()
            });
            let truth = triangles.chain(quads).chain(spheres).fold(f32::INFINITY, f32::min);
            let found = accel.distance(p);
            // The grid's step is at most 0.4 / 60 m.
            assert!(found <= truth + 1e-6 && found >= truth - 0.01, "{p}: {found}, not {truth}");
        }
    }

    #[test]
    fn distance_from_a_wide_disk_is_that_from_its_plane() {
        let disk = Disk { center: Vec3::ZERO, axis: 100.0 * Vec3::Y };
        let ground = Geometry { analytic: vec![Analytic::Disk(disk)], ..Geometry::default() };
        let accel = Accel::build(&[ground], &[]);
        assert!((accel.distance(Vec3::new(3.0, 2.0, 5.0)) - 2.0).abs() < 1e-6);
        assert!((accel.distance(Vec3::new(102.0, 0.0, 0.0)) - 2.0).abs() < 1e-4, "beside it");
        assert_eq!(accel.distance(Vec3::new(50.0, 0.0, 0.0)), 0.0, "on it");
    }

    #[test]
    fn distance_is_bounded_by_instance_boxes_and_infinite_in_empty_scenes() {
        let geometries = [Geometry::default(), soup(20, 0.1, 3)];
        let world_from_object = DAffine3::from_translation(DVec3::X * 10.0);
        let placed = [AccelInstance { geometry: 1, world_from_object }];
        let accel = Accel::build(&geometries, &placed);
        let distance = accel.distance(Vec3::ZERO);
        assert!((8.8..10.0).contains(&distance), "{distance}");
        assert_eq!(accel.distance(Vec3::X * 10.0), 0.0);
        let empty = Accel::build(&[Geometry::default()], &[]);
        assert_eq!(empty.distance(Vec3::ZERO), f32::INFINITY);
    }
}
