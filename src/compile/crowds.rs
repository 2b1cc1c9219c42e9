//! Places that many media fill together: paths know a few at a time.

use super::boxes::{Bounds, BoxTree, NumberedBox};
use super::material::CompiledMaterial;
use super::object_materials::part_materials;
use crate::error::Warning;
use crate::math::DVec3;
use crate::scene::{Instance, MaterialId, Quad, Scene, instance_extents};
use std::collections::BTreeMap;

/// Solids around a point that paths know.
pub const MOST_AROUND: usize = 8;

/// Tells of media without a surface of which more may overlap.
pub(super) fn warn(scene: &Scene, materials: &[CompiledMaterial], warnings: &mut Vec<Warning>) {
    let Some(place) = crowded_place(bodies(scene, materials), MOST_AROUND) else { return };
    warnings.push(Warning::general(format!(
        "more than {MOST_AROUND} media without a surface overlap, by the boxes around them, as at ({:.4}, {:.4}, {:.4}): paths know the \
         {MOST_AROUND} that they entered last, and what the others do is missing in such places; make bodies smaller, or one of several",
        place.x, place.y, place.z
    )));
}

/// The boxes around all bodies of media without a surface; none where there are few.
fn bodies(scene: &Scene, materials: &[CompiledMaterial]) -> Vec<Bounds> {
    let is_body = |id: MaterialId| {
        materials.get(id.index()).is_some_and(|material| material.is_boundary && material.medium_index != 0)
    };
    let has_body = |instance: &Instance| {
        let mesh = scene.meshes.get(instance.mesh.index());
        mesh.is_some_and(|mesh| part_materials(mesh, instance).any(is_body))
    };
    // Quads of one material belong together.
    let mut of_quads: BTreeMap<MaterialId, Bounds> = BTreeMap::new();
    for quad in scene.quads.iter().filter(|quad| is_body(quad.material)) {
        let bounds = of_quads.entry(quad.material).or_insert(Bounds::NONE);
        *bounds = bounds.around(Bounds::of(corners(quad)));
    }
    let shapes = scene.shapes.iter().filter(|shape| is_body(shape.material));
    let shapes = shapes.map(|s| Bounds { low: s.center - s.half_extent(), high: s.center + s.half_extent() });
    let mut found: Vec<Bounds> = of_quads.into_values().chain(shapes).collect();
    let placed: Vec<usize> = (0..scene.instances.len()).filter(|&i| has_body(&scene.instances[i])).collect();
    if found.len() + placed.len() > MOST_AROUND {
        let extents = instance_extents(scene);
        found.extend(placed.into_iter().filter_map(|i| extents[i].0).map(|(low, high)| Bounds { low, high }));
    }
    found
}

fn corners(quad: &Quad) -> [DVec3; 4] {
    let opposite = quad.corner + quad.edge_u + quad.edge_v;
    [quad.corner, quad.corner + quad.edge_u, quad.corner + quad.edge_v, opposite]
}

/// A point that lies in more than `most` boxes. If there is one, then such whose coordinates are those of least corners.
fn crowded_place(mut boxes: Vec<Bounds>, most: usize) -> Option<DVec3> {
    if boxes.len() <= most {
        return None;
    }
    boxes.sort_by(|a, b| a.low.x.total_cmp(&b.low.x));
    let numbered = |(number, &bounds): (usize, &Bounds)| NumberedBox { bounds, number: number as u32 };
    let mut numbered: Vec<NumberedBox> = boxes.iter().enumerate().map(numbered).collect();
    let tree = BoxTree::sort(&mut numbered);
    let holds = |b: &Bounds, axis: usize, at: f64| b.low[axis] <= at && at < b.high[axis];
    let meets =
        |a: &Bounds, b: &Bounds| [1, 2].into_iter().all(|k| a.low[k] < b.high[k] && b.low[k] < a.high[k]);
    for own in &boxes {
        let x = own.low.x;
        let side = Bounds { high: DVec3::new(x, own.high.y, own.high.z), ..*own };
        let mut near = Vec::new();
        tree.any(&side, |place| {
            let NumberedBox { bounds, number } = numbered[place];
            near.extend((holds(&bounds, 0, x) && meets(&bounds, own)).then_some(number));
            false
        });
        // In the order of the list: the first place that is found is told.
        near.sort_unstable();
        let near: Vec<&Bounds> = near.iter().map(|&number| &boxes[number as usize]).collect();
        if near.len() <= most {
            continue;
        }
        for y in near.iter().map(|b| b.low.y) {
            let row: Vec<&Bounds> = near.iter().copied().filter(|b| holds(b, 1, y)).collect();
            if row.len() <= most {
                continue;
            }
            let is_crowded = |&z: &f64| row.iter().filter(|b| holds(b, 2, z)).count() > most;
            if let Some(z) = row.iter().map(|b| b.low.z).find(is_crowded) {
                return Some(DVec3::new(x, y, z));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube([x, y, z]: [f64; 3], size: f64) -> Bounds {
        Bounds { low: DVec3::new(x, y, z), high: DVec3::new(x, y, z) + size }
    }

    #[test]
    fn crowds_are_at_one_point() {
        // Rows that overlap by pairs, around which is one large box.
        let row: Vec<Bounds> = (0..40).map(|k| cube([f64::from(k), 0.0, 0.0], 1.9)).collect();
        let around = [row.clone(), vec![cube([-1.0; 3], 50.0)]].concat();
        assert_eq!(crowded_place(row, 2), None);
        assert_eq!(crowded_place(around.clone(), 3), None);
        let place = crowded_place(around, 2).expect("three");
        assert!(place.x >= 1.0 && place.y == 0.0 && place.z == 0.0, "{place}");
        // Two bars across a third.
        let bars = vec![
            Bounds { low: DVec3::ZERO, high: DVec3::new(9.0, 1.0, 1.0) },
            Bounds { low: DVec3::ZERO, high: DVec3::new(1.0, 9.0, 1.0) },
            Bounds { low: DVec3::new(0.0, 2.0, 0.0), high: DVec3::new(9.0, 3.0, 1.0) },
        ];
        assert_eq!(crowded_place(bars, 2), None);
        let same = vec![cube([1.0, 2.0, 3.0], 4.0); 3];
        assert_eq!(crowded_place(same.clone(), 2), Some(DVec3::new(1.0, 2.0, 3.0)));
        assert_eq!(crowded_place(same, 3), None);
    }
}
