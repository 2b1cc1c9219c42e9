//! Offset of shadow rays to the smooth surface against the shadow terminator artefact.
//!
//! A mesh with shading normals approximates a curved surface. At grazing light, a triangle shadows itself or its neighbours although the
//! smooth surface would not. So shadow rays start at the smooth surface described by the normals, above the triangle, and light is
//! clipped at the tangent plane of the smooth surface instead of that of the triangle. As in Cycles 5.0 with its default Geometry Offset
//! of 0.1; the height is bounded by the tangent planes at the corners (after Hanika 2021, "Hacking the Shadow Terminator", Ray Tracing
//! Gems II, chapter 4). Scattered rays start at the triangle and stay above it.

use super::Integrator;
use super::shading_groups::{ShadingGroup, SortedVertices};
use super::wave::{Vertices, get, set};
use super::workspace::Workspace;
use crate::math::Vec3;

/// Cosine of the light direction to a normal from which on shadow rays start at the triangle.
const CUTOFF: f32 = 0.1;

/// Offsets from a point of a triangle to the smooth surface, for shadow rays on the side of the normals and on the other side. `weights`
/// are the barycentric coordinates of the second and third corner.
fn lifts(positions: [Vec3; 3], normals: [Vec3; 3], weights: [f32; 2]) -> [Vec3; 2] {
    let [v, w] = weights;
    let u = 1.0 - v - w;
    let at = |of: [Vec3; 3]| of[0] * u + of[1] * v + of[2] * w;
    let (p, n) = (at(positions), at(normals));
    // Twice the height of the quadratic patch with the slopes of the normals at the corners.
    let bend = |i: usize, k: usize| (normals[i] - normals[k]).dot(positions[i] - positions[k]);
    let patch = bend(0, 1) * u * v + bend(0, 2) * u * w + bend(1, 2) * v * w;
    // Height of each corner's tangent plane above the point, after shifting the plane above (or below) the other corners.
    let envelope = |bound: fn(f32, f32) -> f32| {
        [0, 1, 2].map(|i: usize| {
            let others = [(i + 1) % 3, (i + 2) % 3].map(|k| (positions[k] - positions[i]).dot(normals[i]));
            bound((positions[i] - p).dot(normals[i]) + bound(bound(others[0], others[1]), 0.0), 0.0)
        })
    };
    let [above, below] = [envelope(f32::max), envelope(f32::min)];
    let front = above[0].min(above[1]).min(above[2]).max(0.5 * patch);
    let back = below[0].max(below[1]).max(below[2]).min(0.5 * patch);
    [n * front, n * back]
}

/// Fraction of the offset that applies, 0 to 1, by the cosines of the light direction to the triangle's and the smooth surface's normal.
fn offset_fraction(to_triangle: f32, to_surface: f32) -> f32 {
    let fraction = if to_surface < CUTOFF {
        2.0 - (to_triangle + to_surface) / CUTOFF
    } else {
        1.0 - to_triangle / CUTOFF
    };
    fraction.clamp(0.0, 1.0)
}

impl Integrator<'_> {
    /// Records the offset to the smooth surface for vertex `k`, hit by ray `i`.
    pub(super) fn record_lift(&self, i: usize, k: usize, w: &mut Workspace) {
        let (hit, time) = (&w.hits[i], w.time(i));
        let lanes = &mut w.wave.vertices.lifted;
        set(&mut lanes.normal, k, Vec3::ZERO);
        if w.groups[i] == ShadingGroup::Medium {
            return;
        }
        let Some([positions, normals]) = self.scene.geometries.smooth_corners(hit, time) else { return };
        if normals.contains(&Vec3::ZERO) || normals[0] == normals[1] && normals[0] == normals[2] {
            return;
        }
        let [above, below] = lifts(positions, normals, [hit.u, hit.v]);
        let normal = normals[0] * (1.0 - hit.u - hit.v) + normals[1] * hit.u + normals[2] * hit.v;
        set(&mut lanes.normal, k, normal.normalize_or_zero());
        set(&mut lanes.above, k, above);
        set(&mut lanes.below, k, below);
    }
}

/// Replaces the geometric normals of lit vertices by those of the smooth surface, on the same side, unless the viewer is on the other
/// side of either.
pub(super) fn use_smooth_normals(sorted: &SortedVertices, v: &mut Vertices) {
    let rough = sorted.rough();
    for i in sorted.lit() {
        let n = get(&v.lifted.normal, i);
        if n == Vec3::ZERO {
            continue;
        }
        let (ng, wo) = (get(&v.ng, i), get(&v.wo, i));
        let n = n * n.dot(ng).signum();
        if rough.contains(&i) && n.dot(wo) * ng.dot(wo) <= 0.0 {
            set(&mut v.lifted.normal, i, Vec3::ZERO);
            continue;
        }
        set(&mut v.lifted.ng, i, ng);
        set(&mut v.ng, i, n);
    }
}

/// Restores the geometric normals of lit vertices.
pub(super) fn restore_normals(sorted: &SortedVertices, v: &mut Vertices) {
    for i in sorted.lit() {
        if get(&v.lifted.normal, i) != Vec3::ZERO {
            let ng = get(&v.lifted.ng, i);
            set(&mut v.ng, i, ng);
        }
    }
}

/// Moves the origins of shadow rays to the smooth surface; call between [`use_smooth_normals`] and [`restore_normals`].
pub(super) fn lift_shadow_rays(sorted: &SortedVertices, v: &mut Vertices) {
    let Vertices { lifted, light, ng: of_surface, wo, .. } = v;
    for i in sorted.lit() {
        let normal = get(&lifted.normal, i);
        if normal == Vec3::ZERO {
            continue;
        }
        let (ng, wi) = (get(&lifted.ng, i), get(&light.wi, i));
        let side = ng.dot(get(wo, i)).signum();
        let to_surface = get(of_surface, i).dot(wi) * side;
        let towards_light = ng * if to_surface < 0.0 { -side } else { side };
        let is_above = normal.dot(towards_light) > 0.0;
        let lift = get(if is_above { &lifted.above } else { &lifted.below }, i);
        let lift = lift * offset_fraction(towards_light.dot(wi), to_surface);
        let origin = get(&light.origin, i) + lift;
        set(&mut light.origin, i, origin);
        if light.is_infinite[i] <= 0.0 {
            let to_light = get(&light.target, i) - origin;
            set(&mut light.direction, i, to_light);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of a triangle on a sphere around the origin, and the normals there.
    fn on_sphere(radius: f32) -> [[Vec3; 3]; 2] {
        let normals =
            [[0.0, 0.1, 1.0], [0.12, -0.1, 1.0], [-0.1, -0.08, 1.0]].map(|n| Vec3::from(n).normalize());
        [normals.map(|n| n * radius), normals]
    }

    /// Offset points are between the sphere and the tangent planes of the corners; corners have no offset.
    #[test]
    fn offset_points_are_near_the_sphere() {
        let [positions, normals] = on_sphere(2.0);
        for [v, w] in [[0.3, 0.3], [0.5, 0.0], [0.0, 0.5], [0.1, 0.8], [0.45, 0.5]] {
            let p = positions[0] * (1.0 - v - w) + positions[1] * v + positions[2] * w;
            let [above, below] = lifts(positions, normals, [v, w]);
            let height = (p + above).length() - 2.0;
            let missing = 2.0 - p.length();
            assert!(height > -0.02 * missing && height < 1.2 * missing, "{v} {w}: {height} over {missing}");
            // Flipped normals exchange the sides.
            let other = lifts(positions, normals.map(|n| -n), [v, w]);
            assert!(other[0].distance(below) < 1e-6 && other[1].distance(above) < 1e-6, "{other:?}");
            assert!(below.dot(p) <= 0.0, "{below} is above the triangle");
        }
        for weights in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]] {
            let [above, _] = lifts(positions, normals, weights);
            assert!(above.length() < 1e-6, "{weights:?}");
        }
    }

    #[test]
    fn only_grazing_light_is_offset() {
        assert_eq!(offset_fraction(0.2, 0.3), 0.0);
        assert_eq!(offset_fraction(-0.3, 0.2), 1.0);
        assert!((offset_fraction(0.05, 0.2) - 0.5).abs() < 1e-6);
        assert!((offset_fraction(0.04, 0.06) - 1.0).abs() < 1e-6);
    }
}
