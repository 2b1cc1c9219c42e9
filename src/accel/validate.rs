//! A walk over the finished structure that checks what traversal relies on.

use super::layout::{
    ANALYTIC_LINES, AnalyticPacket, CurvePacket, DONE, INSTANCE_LINES, InstanceRecord, KIND_ANALYTIC,
    KIND_INSTANCE, KIND_TRIANGLES, LEAF, LEAVE_INSTANCE, MOVING_TRIANGLES, NODE_LINES, Node,
    PART_QUAD_SECOND, TRIANGLE_LINES, TrianglePacket, curves_at, kind_of, line_of, view,
};
use super::parts::Tree;
use super::structure::Accel;
use crate::math::{Bounds3, Vec3};
use crate::shape::triangle::LANES;
use std::collections::HashSet;

/// What a walk over a tree found.
#[derive(Default)]
struct Found {
    /// Primitive ids, quads by their first half.
    ids: Vec<u32>,
    instances: usize,
}

impl Accel {
    /// Checks that all references stay in the buffer, that each child's box holds what is below it, that each primitive
    /// and instance is reached exactly once, and that no path is deeper than the stacks allow.
    pub fn validate(&self) -> Result<(), String> {
        let roots: HashSet<u32> = self.expected.iter().map(|tree| tree.root).collect();
        self.expected.iter().try_for_each(|tree| self.validate_tree(tree, &roots))
    }

    fn validate_tree(&self, tree: &Tree, roots: &HashSet<u32>) -> Result<(), String> {
        let mut found = Found::default();
        let everywhere = Bounds3 { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
        let mut stack = vec![(tree.root, everywhere, 1)];
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
                    return Err(format!("node {reference}: the box of child {lane} sticks out"));
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

    /// Walks the packets of a leaf.
    fn validate_leaf(
        &self,
        first: u32,
        bounds: &Bounds3,
        roots: &HashSet<u32>,
        found: &mut Found,
    ) -> Result<(), String> {
        let mut reference = first;
        while reference != DONE {
            let outside = || format!("packet {reference:#x} lies outside of the buffer");
            let line = line_of(reference);
            reference = match kind_of(reference) {
                KIND_TRIANGLES => {
                    let packet =
                        view::<TrianglePacket, TRIANGLE_LINES>(&self.lines, line).ok_or_else(outside)?;
                    validate_triangles(packet, bounds, found)?;
                    packet.next()
                }
                KIND_ANALYTIC => {
                    let packet =
                        view::<AnalyticPacket, ANALYTIC_LINES>(&self.lines, line).ok_or_else(outside)?;
                    if packet.kind[0] == MOVING_TRIANGLES {
                        self.validate_moving(line, packet, bounds, found)?;
                    } else if let Some(curves) = curves_at(&self.lines, line, packet) {
                        validate_curves(curves, bounds, found)?;
                    } else {
                        found.ids.extend(packet.id.iter().filter(|id| **id != u32::MAX));
                    }
                    packet.next
                }
                KIND_INSTANCE if reference != LEAVE_INSTANCE => {
                    let record =
                        view::<InstanceRecord, INSTANCE_LINES>(&self.lines, line).ok_or_else(outside)?;
                    if !roots.contains(&record.root) {
                        return Err(format!("instance {} refers to no tree", record.instance));
                    }
                    found.instances += 1;
                    record.next
                }
                _ => return Err(format!("reference {reference:#x} is of no kind")),
            };
        }
        Ok(())
    }
}

impl Accel {
    /// The triangles of a packet whose vertices move, at each key.
    fn validate_moving(
        &self,
        line: usize,
        packet: &AnalyticPacket,
        bounds: &Bounds3,
        found: &mut Found,
    ) -> Result<(), String> {
        for key in 0..packet.id[0] as usize {
            let at = line + ANALYTIC_LINES + key * TRIANGLE_LINES;
            let triangles = view::<TrianglePacket, TRIANGLE_LINES>(&self.lines, at);
            let triangles = triangles.ok_or_else(|| format!("packet {line:#x} lacks its key {key}"))?;
            let mut seen = Found::default();
            validate_triangles(triangles, bounds, &mut seen)?;
            if key == 0 {
                found.ids.extend(seen.ids);
            }
        }
        Ok(())
    }
}

fn validate_curves(packet: &CurvePacket, bounds: &Bounds3, found: &mut Found) -> Result<(), String> {
    for lane in 0..packet.lanes() {
        if bounds.union(packet.segment(lane).bounds()) != *bounds {
            return Err(format!("primitive {} sticks out of its box", packet.id[lane]));
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
                return Err(format!("primitive {} sticks out of its box", packet.id(lane)));
            }
        }
        if packet.part(lane) != PART_QUAD_SECOND {
            found.ids.push(packet.id(lane));
        }
    }
    Ok(())
}
