//! Detects coincident surfaces of transmissive solids. The integrator tests hits for them only if there are any.

use super::box_tree::{Bounds, BoxTree, Boxed, NumberedBox};
use super::geometry::Geometries;
use super::material::CompiledMaterial;
use super::objects::part_materials;
use crate::accel::Accel;
use crate::math::{DAffine3, DVec3, Ray, gamma};
use crate::scene::{MaterialId, Scene};
use rayon::prelude::*;

/// A transmissive solid.
struct Solid {
    /// World space.
    bounds: Bounds,
    /// Does it have several transmissive materials?
    has_several_materials: bool,
    surface: SolidSurface,
}

enum SolidSurface {
    Mesh {
        mesh: usize,
        world_from_object: DAffine3,
    },
    /// Corner and both edges.
    Quad([DVec3; 3]),
    /// An analytic shape: centre and radius.
    Shape(DVec3, f64),
}

/// Do surfaces of two solids coincide? Tested by rays where coplanar triangles of two solids overlap, and at the centres of
/// triangles inside the bounds of an analytic shape. With motion blur, solids with overlapping bounds count as coincident.
pub(super) fn exist(
    scene: &Scene,
    materials: &[CompiledMaterial],
    (geometries, accel, anchor): (&Geometries, &Accel, DVec3),
) -> bool {
    let solids = Solids::of(scene, materials);
    let query = SurfaceQuery { materials, geometries, accel, anchor };
    let mut triangles = Vec::new();
    for i in 0..solids.all.len() {
        if !solids.any_near(i, &solids.all[i].bounds, |_| true) {
            continue;
        }
        let candidates = solids.candidates(i, scene);
        if accel.is_moving() || solids.touches_shape(i, &candidates, &query) {
            return true;
        }
        triangles.extend(candidates);
    }
    let may_touch = |a: u32, b: u32| a != b || solids.all[a as usize].has_several_materials;
    any_overlap(triangles, may_touch, |point, normal| query.coincide_at(point, normal))
}

/// Compiled geometry for ray tests of coincidence.
struct SurfaceQuery<'a> {
    materials: &'a [CompiledMaterial],
    geometries: &'a Geometries,
    accel: &'a Accel,
    anchor: DVec3,
}

impl SurfaceQuery<'_> {
    /// Do surfaces of two solids coincide at a point with a given normal?
    fn coincide_at(&self, p: DVec3, normal: DVec3) -> bool {
        let reach = (p.abs().max_element() + (p - self.anchor).abs().max_element()) * f64::from(gamma(32));
        let origin = (p - self.anchor + normal * reach).as_vec3();
        let ray = Ray::segment(origin, (normal * (-2.0 * reach)).as_vec3());
        let first = self.accel.closest_one(&ray);
        if normal == DVec3::ZERO || !first.is_hit() {
            return false;
        }
        let second = self.accel.closest_one(&Ray { origin_primitive: (&first).into(), ..ray });
        if !second.is_hit() {
            return false;
        }
        let [a, b] = [&first, &second].map(|hit| &self.materials[self.geometries.material(hit) as usize]);
        let is_other_solid = a.medium_index != b.medium_index
            || self.geometries.object(&first) != self.geometries.object(&second);
        is_other_solid && is_solid(a) && is_solid(b)
    }
}

fn is_solid(material: &CompiledMaterial) -> bool {
    material.medium_index != 0 && !material.is_boundary
}

impl Solid {
    /// Bound on the rounding error of coordinates.
    fn rounding(&self) -> f64 {
        rounding(&self.bounds)
    }

    /// Do bounds, whose coordinates have the error `rounding`, overlap those of this solid?
    fn is_near(&self, bounds: &Bounds, rounding: f64) -> bool {
        let reach = rounding.max(self.rounding());
        bounds.overlaps(&self.bounds.expanded(reach))
    }
}

/// Bound on the rounding error of coordinates in a box.
fn rounding(bounds: &Bounds) -> f64 {
    bounds.low.abs().max(bounds.high.abs()).max_element() * f64::from(gamma(64))
}

/// All transmissive solids.
struct Solids {
    all: Vec<Solid>,
    /// Their bounds, expanded by rounding errors.
    boxes: Vec<NumberedBox>,
    tree: BoxTree,
}

impl Solids {
    fn of(scene: &Scene, materials: &[CompiledMaterial]) -> Solids {
        let mut all = solids(scene, materials);
        all.sort_by(|a, b| a.bounds.low.x.total_cmp(&b.bounds.low.x));
        let numbered = |(number, solid): (usize, &Solid)| NumberedBox {
            bounds: solid.bounds.expanded(solid.rounding()),
            number: number as u32,
        };
        let mut boxes: Vec<NumberedBox> = all.iter().enumerate().map(numbered).collect();
        let tree = BoxTree::sort(&mut boxes);
        Solids { all, boxes, tree }
    }

    /// Calls `is_found` with the solids that may touch the part of solid `i` inside `bounds`, until it returns true.
    fn any_near(&self, i: usize, bounds: &Bounds, mut is_found: impl FnMut(&Solid) -> bool) -> bool {
        let rounding = self.all[i].rounding();
        self.tree.any(&bounds.expanded(rounding), |item| {
            let k = self.boxes[item].number as usize;
            (k != i || self.all[i].has_several_materials)
                && self.all[k].is_near(bounds, rounding)
                && is_found(&self.all[k])
        })
    }

    /// The triangles of solid `i` that overlap the bounds of others.
    fn candidates(&self, i: usize, scene: &Scene) -> Vec<SolidTriangle> {
        /// Maximum number of candidates to test without the tree.
        const MAX_LINEAR_SEARCH: usize = 8;
        let (solid, mut few) = (&self.all[i], Vec::new());
        let has_many = self.any_near(i, &solid.bounds, |other| {
            few.push(other.bounds.expanded(solid.rounding().max(other.rounding())));
            few.len() > MAX_LINEAR_SEARCH
        });
        let typical_rounding = solid.typical_rounding(scene);
        let candidate = |corners: [DVec3; 3]| {
            let bounds = Bounds::of(corners);
            let is_near = match has_many {
                true => self.any_near(i, &bounds, |_| true),
                false => few.iter().any(|other| bounds.overlaps(other)),
            };
            is_near.then(|| SolidTriangle {
                corners,
                solid: i as u32,
                rounding: rounding(&bounds).max(typical_rounding),
            })
        };
        match solid.surface {
            SolidSurface::Mesh { mesh, world_from_object } => {
                let mesh = &scene.meshes[mesh];
                let corners =
                    |t: &[u32; 3]| mesh.corners_f64(*t).map(|p| world_from_object.transform_point3(p));
                mesh.triangles.par_iter().filter_map(|t| candidate(corners(t))).collect()
            }
            SolidSurface::Quad([a, u, v]) => {
                [[a, a + u, a + u + v], [a, a + u + v, a + v]].into_iter().filter_map(candidate).collect()
            }
            SolidSurface::Shape(..) => Vec::new(),
        }
    }

    /// Does an analytic shape coincide with the surface of solid `i`?
    fn touches_shape(&self, i: usize, triangles: &[SolidTriangle], query: &SurfaceQuery) -> bool {
        let solid = &self.all[i];
        if let SolidSurface::Shape(middle, size) = solid.surface {
            return self.any_near(i, &solid.bounds, |other| match other.surface {
                SolidSurface::Shape(center, radius) => {
                    center.distance(middle) <= solid.rounding() && (radius - size).abs() <= solid.rounding()
                }
                _ => false,
            });
        }
        let is_shape = |other: &Solid| matches!(other.surface, SolidSurface::Shape(..));
        self.any_near(i, &solid.bounds, is_shape)
            && triangles.par_iter().any(|triangle| {
                let [a, b, c] = triangle.corners;
                let middle = (a + b + c) / 3.0;
                let normal = (b - a).cross(c - a).normalize_or_zero();
                self.any_near(i, &Bounds { low: middle, high: middle }, is_shape)
                    && query.coincide_at(middle, normal)
            })
    }
}

impl Solid {
    /// Bound on the rounding error of 90 % of the vertices, which a few distant ones don't affect.
    fn typical_rounding(&self, scene: &Scene) -> f64 {
        let SolidSurface::Mesh { mesh, world_from_object } = self.surface else { return self.rounding() };
        let size =
            |p: &[f32; 3]| world_from_object.transform_point3(p.map(f64::from).into()).abs().max_element();
        let mut sizes: Vec<f64> = scene.meshes[mesh].positions.iter().map(size).collect();
        let percentile_90 = sizes.len() * 9 / 10;
        let (_, size, _) = sizes.select_nth_unstable_by(percentile_90, f64::total_cmp);
        *size * f64::from(gamma(64))
    }
}

fn solids(scene: &Scene, materials: &[CompiledMaterial]) -> Vec<Solid> {
    let is_solid = |id: MaterialId| is_solid(&materials[id.index()]);
    let meshes = scene.instances.par_iter().filter_map(|instance| {
        let mesh = &scene.meshes[instance.mesh.index()];
        let world_from_object = instance.world_from_object;
        let has_solid_material = part_materials(mesh, instance).any(is_solid) && !mesh.positions.is_empty();
        has_solid_material.then(|| {
            let points =
                mesh.positions.iter().map(|&p| world_from_object.transform_point3(p.map(f64::from).into()));
            let bounds = Bounds::of(points);
            let mut ids: Vec<MaterialId> =
                part_materials(mesh, instance).filter(|&id| is_solid(id)).collect();
            ids.sort_unstable();
            ids.dedup();
            let surface = SolidSurface::Mesh { mesh: instance.mesh.index(), world_from_object };
            Solid { bounds, has_several_materials: ids.len() > 1, surface }
        })
    });
    let quads = scene.quads.iter().filter(|quad| is_solid(quad.material)).map(|quad| {
        let (low, high) = (
            quad.edge_u.min(DVec3::ZERO) + quad.edge_v.min(DVec3::ZERO),
            quad.edge_u.max(DVec3::ZERO) + quad.edge_v.max(DVec3::ZERO),
        );
        let bounds = Bounds { low: quad.corner + low, high: quad.corner + high };
        Solid {
            bounds,
            has_several_materials: false,
            surface: SolidSurface::Quad([quad.corner, quad.edge_u, quad.edge_v]),
        }
    });
    let shapes = scene.shapes.iter().filter(|shape| is_solid(shape.material)).map(|shape| {
        let half = DVec3::splat(shape.radius);
        Solid {
            bounds: Bounds { low: shape.center - half, high: shape.center + half },
            has_several_materials: false,
            surface: SolidSurface::Shape(shape.center, shape.radius),
        }
    });
    meshes.collect::<Vec<Solid>>().into_iter().chain(quads).chain(shapes).collect()
}

// Overlapping coplanar triangles.

/// Minimum cosine between the normals of coplanar triangles.
const PARALLEL: f64 = 0.9999;

#[derive(Clone, Copy, Debug)]
struct SolidTriangle {
    pub corners: [DVec3; 3],
    /// Index of the solid.
    pub solid: u32,
    /// Bound on the rounding error of coordinates.
    pub rounding: f64,
}

impl Boxed for SolidTriangle {
    fn bounds(&self) -> Bounds {
        Bounds::of(self.corners).expanded(self.rounding)
    }

    fn sort_key(&self, axis: usize) -> f64 {
        self.corners.iter().map(|corner| corner[axis]).sum()
    }
}

impl SolidTriangle {
    /// The normal; its length is twice the area.
    fn normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a)
    }

    /// A point of the intersection of two coplanar triangles, and the normal; `None` if they don't overlap.
    pub fn overlap(&self, other: &SolidTriangle) -> Option<(DVec3, DVec3)> {
        let normal = self.normal().try_normalize()?;
        let is_parallel = other.normal().try_normalize()?.dot(normal).abs() >= PARALLEL;
        let reach = self.rounding + other.rounding;
        let height = |p: DVec3| (p - self.corners[0]).dot(normal);
        let heights = other.corners.map(height);
        let is_apart = heights.iter().all(|h| *h > reach) || heights.iter().all(|h| *h < -reach);
        if !is_parallel || is_apart {
            return None;
        }
        let common = self.clipped(normal, &other.corners);
        let (first, rest) = common.split_first()?;
        let area: DVec3 = rest.windows(2).map(|w| (w[0] - first).cross(w[1] - first)).sum();
        let longest = rest.iter().map(|p| p.distance(*first)).fold(0.0, f64::max);
        // An intersection as narrow as the rounding error is a shared edge.
        if area.length() <= 4.0 * reach * longest {
            return None;
        }
        let middle = common.iter().sum::<DVec3>() / common.len() as f64;
        (height(middle).abs() <= reach).then(|| (middle - normal * height(middle), normal))
    }

    /// A polygon clipped to the prism over the triangle (Sutherland and Hodgman 1974, "Reentrant Polygon Clipping").
    fn clipped(&self, normal: DVec3, polygon: &[DVec3]) -> Vec<DVec3> {
        let mut remaining = polygon.to_vec();
        for k in 0..3 {
            let (start, end) = (self.corners[k], self.corners[(k + 1) % 3]);
            let inwards = normal.cross(end - start);
            let depth = |p: DVec3| (p - start).dot(inwards);
            let mut within = Vec::with_capacity(remaining.len() + 1);
            for (i, &p) in remaining.iter().enumerate() {
                let q = remaining[(i + 1) % remaining.len()];
                let (at_p, at_q) = (depth(p), depth(q));
                if at_p >= 0.0 {
                    within.push(p);
                }
                if (at_p >= 0.0) != (at_q >= 0.0) {
                    within.push(p + (q - p) * (at_p / (at_p - at_q)));
                }
            }
            remaining = within;
        }
        remaining
    }
}

/// Do any triangles overlap whose solids pass `may_touch`, confirmed by `is_touched` at a point of the intersection with the
/// normal?
fn any_overlap(
    mut triangles: Vec<SolidTriangle>,
    may_touch: impl Fn(u32, u32) -> bool + Sync,
    is_touched: impl Fn(DVec3, DVec3) -> bool + Sync,
) -> bool {
    let tree = BoxTree::sort(&mut triangles);
    triangles.par_iter().enumerate().any(|(number, triangle)| {
        tree.any(&triangle.bounds(), |k| {
            let other = &triangles[k];
            k > number
                && may_touch(triangle.solid, other.solid)
                && triangle.overlap(other).is_some_and(|(point, normal)| is_touched(point, normal))
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;

    #[test]
    fn a_distant_vertex_does_not_increase_the_typical_rounding() {
        let mut scene = Scene::default();
        let positions = (0..100).map(|k| [k as f32 * 0.01, 1.0, 0.0]).collect();
        scene.meshes.push(Mesh { positions, ..Mesh::default() });
        let solid = |scene: &Scene| {
            let points = scene.meshes[0].positions.iter().map(|p| DVec3::from(p.map(f64::from)));
            let surface = SolidSurface::Mesh { mesh: 0, world_from_object: DAffine3::IDENTITY };
            Solid { bounds: Bounds::of(points), has_several_materials: false, surface }
        };
        let before = solid(&scene);
        assert_eq!(before.typical_rounding(&scene), before.rounding());
        scene.meshes[0].positions[7] = [1e6, 0.0, 0.0];
        let after = solid(&scene);
        assert_eq!(after.typical_rounding(&scene), before.rounding());
        assert!(after.rounding() > 1e5 * before.rounding());
    }
}

#[cfg(test)]
mod overlaps_tests {
    use super::*;
    use std::f64::consts::TAU;

    fn triangle(solid: u32, corners: [[f64; 3]; 3]) -> SolidTriangle {
        SolidTriangle { corners: corners.map(DVec3::from), solid, rounding: 1e-6 }
    }

    /// The two triangles of a square of side 2 around a point.
    fn square(solid: u32, [x, y, z]: [f64; 3]) -> Vec<SolidTriangle> {
        let at = |dx: f64, dy: f64| [x + dx, y + dy, z];
        let (a, b, c, d) = (at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0));
        vec![triangle(solid, [a, b, c]), triangle(solid, [a, c, d])]
    }

    /// A disk of `count` triangles around its centre, facing down.
    fn fan(solid: u32, count: u32, radius: f64, z: f64) -> Vec<SolidTriangle> {
        let rim = |i: u32| {
            let angle = TAU * f64::from(i) / f64::from(count);
            [radius * angle.cos(), radius * angle.sin(), z]
        };
        (0..count).map(|i| triangle(solid, [[0.0, 0.0, z], rim(i + 1), rim(i)])).collect()
    }

    fn touch(triangles: &[Vec<SolidTriangle>]) -> bool {
        any_overlap(triangles.concat(), |a, b| a != b, |_, _| true)
    }

    #[test]
    fn overlapping_coplanar_triangles_are_found() {
        for (first, second, expected) in [
            (square(0, [0.0; 3]), fan(1, 64, 0.3, 0.0), true),
            (fan(0, 64, 5.0, 0.0), square(1, [0.0; 3]), true),
            // No triangle's centroid lies on the other square.
            (square(0, [0.0; 3]), square(1, [1.9, 1.9, 0.0]), true),
            (square(0, [0.0; 3]), square(1, [1.95, 0.3, 0.0]), true),
            // Shared edge, shared corner, disjoint.
            (square(0, [0.0; 3]), square(1, [2.0, 0.3, 0.0]), false),
            (square(0, [0.0; 3]), square(1, [2.0, 2.0, 0.0]), false),
            (square(0, [0.0; 3]), square(1, [2.1, 0.0, 0.0]), false),
            // At a distance above each other.
            (square(0, [0.0; 3]), fan(1, 64, 0.3, 1e-4), false),
            // At a distance within the rounding error.
            (square(0, [0.0; 3]), fan(1, 64, 0.3, 1e-6), true),
        ] {
            assert_eq!(touch(&[first.clone(), second.clone()]), expected);
            assert_eq!(touch(&[second, first]), expected);
        }
        // Triangles of one solid, and crossing triangles, don't count.
        assert!(!touch(&[square(0, [0.0; 3]), square(0, [0.5, 0.5, 0.0])]));
        let upright = vec![triangle(1, [[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]])];
        assert!(!touch(&[square(0, [0.0; 3]), upright]));
    }

    /// Points passed to `is_touched` lie in both triangles.
    #[test]
    fn points_to_confirm_lie_in_both_triangles() {
        let both = [square(0, [0.0; 3]), square(1, [1.5, 1.5, 0.0])].concat();
        let queried = std::sync::Mutex::new(Vec::new());
        let found = any_overlap(
            both.clone(),
            |a, b| a != b,
            |point, normal| {
                queried.lock().expect("no panic").push((point, normal));
                false
            },
        );
        let queried = queried.into_inner().expect("no panic");
        assert!(!found && !queried.is_empty());
        for (point, normal) in queried {
            assert!((0.5..=1.0).contains(&point.x) && (0.5..=1.0).contains(&point.y), "{point}");
            assert!(point.z == 0.0 && normal.z.abs() == 1.0);
        }
    }

    /// In two coincident fine grids each triangle is tested against few others.
    #[test]
    fn queries_test_few_triangles() {
        let n = 60;
        let grid = |solid: u32, z: f64| -> Vec<SolidTriangle> {
            let at = |i: i32, j: i32| [f64::from(i), f64::from(j), z];
            (0..n * n)
                .flat_map(|k| {
                    let (i, j) = (k % n, k / n);
                    let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
                    [triangle(solid, [a, b, c]), triangle(solid, [a, c, d])]
                })
                .collect()
        };
        let mut triangles = [grid(0, 0.0), grid(1, 0.0)].concat();
        let count = triangles.len();
        let tree = BoxTree::sort(&mut triangles);
        let mut tested = 0;
        for triangle in &triangles {
            tree.any(&triangle.bounds(), |_| {
                tested += 1;
                false
            });
        }
        assert!(tested < 120 * count, "{tested} of {count}");
    }
}
