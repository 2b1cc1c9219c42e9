//! Primitives that have no area as they are in the scene, wherever they are seen from.

use super::plan::{Place, Plan};
use crate::math::DVec3;
use crate::scene::{Mesh, Quad, Scene};

/// Edges of this part of the longest one are none: corners that were computed to be the same differ by as much.
const ROUNDING: f64 = 4.0 * f32::EPSILON as f64;

/// How many of those that a plan builds.
pub(super) fn count(scene: &Scene, plan: &Plan) -> u64 {
    let copied = plan.steps.iter().filter(|step| step.place == Place::World);
    let copied = copied.map(|step| scene.instances[step.instance].mesh.index());
    let mut counts: Vec<Option<u64>> = vec![None; scene.meshes.len()];
    let of_meshes: u64 = copied
        .chain(plan.meshes.iter().copied())
        .map(|mesh| *counts[mesh].get_or_insert_with(|| triangles(&scene.meshes[mesh])))
        .sum();
    let round = scene.shapes.iter().filter(|shape| shape.radius <= 0.0).count() as u64;
    of_meshes + round + scene.quads.iter().filter(|quad| is_flat(quad)).count() as u64
}

/// Triangles that are lines or points but for rounding, as those at the poles of spheres.
fn triangles(mesh: &Mesh) -> u64 {
    let at = |i: u32| mesh.positions.get(i as usize).map_or(DVec3::NAN, |p| DVec3::from(p.map(f64::from)));
    let is_flat = |&&[a, b, c]: &&[u32; 3]| {
        let [a, b, c] = [at(a), at(b), at(c)];
        let edges = [a.distance(b), b.distance(c), c.distance(a)];
        let (shortest, longest) =
            edges.iter().fold((f64::INFINITY, 0.0f64), |(s, l), &e| (s.min(e), l.max(e)));
        shortest <= ROUNDING * longest
    };
    mesh.triangles.iter().filter(is_flat).count() as u64
}

/// Both halves have corners that are the same.
fn is_flat(quad: &Quad) -> bool {
    let Quad { edge_u: u, edge_v: v, .. } = *quad;
    u == DVec3::ZERO || v == DVec3::ZERO
}
