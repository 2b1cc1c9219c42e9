//! What lies so far from all else that a picture of everything would show nothing.

use crate::math::DVec3;
use crate::scene::{Curves, Extent, Instance, Mesh, Scene, instance_extents};

/// What is this many times as far from the middle as all that is nearer, with nothing between, is stray.
const GAP: f64 = 20.0;
/// Share of the scene that must be nearer than a gap, by numbers of triangles; all other shapes weigh as much together as all
/// triangles.
const MOST: f64 = 0.9;
/// Triangles that are looked at; in larger scenes every second, third, ... one of each mesh stands for all.
const MOST_TRIANGLES: usize = 1 << 19;
/// Middles of triangles that the median is taken of, at most.
const MEDIAN: usize = 50_000;
/// Names in a message.
const LISTED: usize = 3;

/// A part of a scene.
#[derive(Clone, Copy)]
struct Item {
    min: DVec3,
    max: DVec3,
    weight: f64,
}

impl Item {
    fn middle(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Distance of its box from a point.
    fn near(&self, p: DVec3) -> f64 {
        (self.min - p).max(p - self.max).max(DVec3::ZERO).length()
    }

    /// Distance of its box's farthest corner.
    fn far(&self, p: DVec3) -> f64 {
        (self.min - p).abs().max((self.max - p).abs()).length()
    }
}

/// Where the scene ends, and what lies beyond.
pub(super) struct Limit {
    middle: DVec3,
    distance: f64,
    /// In words: what lies beyond, and how far.
    pub beyond: String,
}

impl Limit {
    /// Is a point part of the scene?
    pub fn holds(&self, p: DVec3) -> bool {
        p.distance(self.middle) <= self.distance
    }
}

/// Finds where a scene ends before a gap beyond which next to nothing lies; `None` where there is no such gap. The scene
/// need not be valid.
pub(super) fn limit(scene: &Scene) -> Option<Limit> {
    let extents = instance_extents(scene);
    let items = items(scene);
    let middle = median(&items)?;
    let all: f64 = items.iter().map(|item| item.weight).sum();
    let mut reach: Vec<(f64, f64, f64)> =
        items.iter().map(|i| (i.near(middle), i.far(middle), i.weight)).collect();
    reach.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let (mut far, mut weight) = (0.0f64, 0.0);
    for &(near, its_far, its_weight) in &reach {
        if near > GAP * far && far > 0.0 && weight >= MOST * all {
            let distance = 0.5 * (far + near);
            let beyond = beyond(scene, &extents, middle, distance, near);
            return Some(Limit { middle, distance, beyond });
        }
        far = far.max(its_far);
        weight += its_weight;
    }
    None
}

/// All parts of a scene that have a place.
fn items(scene: &Scene) -> Vec<Item> {
    let mesh_of = |i: &Instance| scene.meshes.get(i.mesh.index());
    let count = |i: &Instance| mesh_of(i).map_or(0, |mesh| mesh.triangles.len());
    let total = scene.instances.iter().fold(0usize, |sum, i| sum.saturating_add(count(i)));
    let step = total.div_ceil(MOST_TRIANGLES).max(1);
    let placed = scene.instances.iter().filter_map(|i| Some((i, mesh_of(i)?)));
    let mut items: Vec<Item> = placed.flat_map(|(i, mesh)| triangles(i, mesh, step)).collect();
    let others = scene.shapes.len() + scene.quads.len() + scene.curves.len();
    let weight = total.max(1) as f64 / others.max(1) as f64;
    items.extend(scene.shapes.iter().map(|s| {
        let half = s.half_extent();
        Item { min: s.center - half, max: s.center + half, weight }
    }));
    items.extend(scene.quads.iter().map(|q| {
        let (u, v) = (q.edge_u, q.edge_v);
        let (low, high) = (u.min(DVec3::ZERO) + v.min(DVec3::ZERO), u.max(DVec3::ZERO) + v.max(DVec3::ZERO));
        Item { min: q.corner + low, max: q.corner + high, weight }
    }));
    items.extend(scene.curves.iter().filter_map(|curves| {
        let (min, max) = around(curves)?;
        Some(Item { min, max, weight })
    }));
    items.retain(|item| item.min.is_finite() && item.max.is_finite());
    items
}

/// The box around the points of curves.
fn around(curves: &Curves) -> Option<(DVec3, DVec3)> {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    curves.visit(&mut |p, _| (min, max) = (min.min(p), max.max(p)));
    (min.x <= max.x).then_some((min, max))
}

/// Every so manieth triangle of a mesh that is placed.
fn triangles<'s>(
    instance: &'s Instance,
    mesh: &'s Mesh,
    step: usize,
) -> impl Iterator<Item = Item> + use<'s> {
    let corner = move |i: u32| {
        let p = mesh.positions.get(i as usize)?;
        Some(instance.world_from_object.transform_point3(DVec3::from(p.map(f64::from))))
    };
    mesh.triangles.iter().step_by(step).filter_map(move |&[a, b, c]| {
        let [a, b, c] = [corner(a)?, corner(b)?, corner(c)?];
        Some(Item { min: a.min(b).min(c), max: a.max(b).max(c), weight: step as f64 })
    })
}

/// The median of the middles, axis by axis.
fn median(items: &[Item]) -> Option<DVec3> {
    let step = items.len().div_ceil(MEDIAN).max(1);
    let mut picked: Vec<(DVec3, f64)> = items.iter().step_by(step).map(|i| (i.middle(), i.weight)).collect();
    let all: f64 = picked.iter().map(|(_, weight)| weight).sum();
    let mut along = |axis: usize| {
        picked.sort_unstable_by(|a, b| a.0[axis].total_cmp(&b.0[axis]));
        let mut sum = 0.0;
        let middle = picked.iter().find(|(_, weight)| {
            sum += weight;
            sum >= 0.5 * all
        });
        middle.map(|(p, _)| p[axis])
    };
    Some(DVec3::new(along(0)?, along(1)?, along(2)?))
}

/// Names what lies beyond a distance, of which the nearest is so far away.
fn beyond(scene: &Scene, extents: &[Extent], middle: DVec3, distance: f64, near: f64) -> String {
    let box_of = |(min, max)| Item { min, max, weight: 1.0 };
    let mut names: Vec<String> = Vec::new();
    let mut add = |name: &str, item: Item| {
        if item.far(middle) > distance {
            let part = if item.near(middle) < distance { "parts of " } else { "" };
            let name = if name.is_empty() { "an object".to_string() } else { format!("'{name}'") };
            names.push(format!("{part}{name}"));
        }
    };
    for (instance, extent) in scene.instances.iter().zip(extents) {
        extent.0.into_iter().for_each(|bounds| add(&instance.name, box_of(bounds)));
    }
    for shape in &scene.shapes {
        let half = shape.half_extent();
        add(&shape.name, box_of((shape.center - half, shape.center + half)));
    }
    for quad in &scene.quads {
        let far = quad.corner + quad.edge_u + quad.edge_v;
        add(&quad.name, box_of((quad.corner.min(far), quad.corner.max(far))));
    }
    for curves in &scene.curves {
        around(curves).into_iter().for_each(|bounds| add(&curves.name, box_of(bounds)));
    }
    let more = names.len().saturating_sub(LISTED);
    names.truncate(LISTED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    // Three digits tell how far.
    let unit = 10f64.powf(near.log10().floor() - 2.0);
    let meters = (near / unit).round() * unit;
    format!("{}{more}, some {meters} m away", names.join(", "))
}
