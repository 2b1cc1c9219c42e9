//! Finds panes: closed bodies of clear smooth glass with two flat parallel faces, which shadow rays pass (see
//! `integrator::panes`). They are detected by geometry, so that windows, double glazing and table tops need no option.
//!
//! [`RefractedLights`]: small lights, and refractive bodies that shadow rays don't pass: frosted glass, water with waves,
//! single sheets of glass. See `integrator::refracted_lights`.

use super::material::CompiledMaterial;
use super::objects;
use crate::bsdf::BsdfClass;
use crate::light::{Lights, SmallLight};
use crate::math::{Bounds3, DMat3, DVec3, Vec3};
use crate::scene::{Instance, Mesh, Scene};
use crate::texture::CompiledTextures;
use std::collections::HashMap;

/// Minimum cosine between normals of a flat face.
const FLAT_COSINE: f64 = 1.0 - 1e-6;

/// Maximum area of the rim relative to one face, so that multiple internal reflections rarely leave through the rim. The
/// thickness of a square pane is then at most 1/8 of its width.
const MAX_RIM: f64 = 0.5;

/// Maximum relative difference between the areas of the two faces.
const MAX_DIFFERENCE: f64 = 0.02;

/// Maximum number of axes to test per body: those of a box.
const MAX_AXES: usize = 3;

/// Relative margin of the thickness.
const MARGIN: f64 = 1.01;

/// Sets [`CompiledMaterial::pane_thickness`] of the materials of panes.
pub(super) fn mark(scene: &Scene, materials: &mut [CompiledMaterial]) {
    let is_candidate: Vec<bool> = materials.iter().map(CompiledMaterial::may_be_of_panes).collect();
    if !is_candidate.contains(&true) {
        return;
    }
    let mut found: HashMap<(usize, bool), Vec<Slab>> = HashMap::new();
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh.index()];
        let of_parts = || objects::part_materials(mesh, instance);
        if !of_parts().any(|material| is_candidate[material.index()]) {
            continue;
        }
        let key = (instance.mesh.index(), instance.material.is_some());
        let slabs = found.entry(key).or_insert_with(|| {
            let parts =
                mesh.parts.iter().zip(of_parts()).filter(|(_, material)| is_candidate[material.index()]);
            let triangles = parts.flat_map(|(part, _)| {
                let from = mesh.triangles.iter().skip(part.first_triangle as usize);
                from.take(part.triangle_count as usize).copied()
            });
            slabs_of(mesh, &triangles.collect::<Vec<[u32; 3]>>())
        });
        let thickness = slabs.iter().filter_map(|slab| slab.thickness_in(instance)).fold(0.0, f64::max);
        for material in of_parts().filter(|material| is_candidate[material.index()]) {
            let pane_thickness = &mut materials[material.index()].pane_thickness;
            *pane_thickness = pane_thickness.max((thickness * MARGIN) as f32);
        }
    }
}

impl CompiledMaterial {
    /// Is it clear smooth glass without textures or other properties that panes don't support?
    fn may_be_of_panes(&self) -> bool {
        let is_glass = matches!(self.class, BsdfClass::Dielectric | BsdfClass::RoughDielectric);
        let is_clear = self.medium.as_ref().is_some_and(|m| m.iors.is_some() && m.scattering.is_none());
        is_glass
            && is_clear
            && self.medium_index != 0
            && self.is_smooth_glass()
            && !self.is_boundary
            && self.alpha.is_none()
            && self.emission.is_none()
            && self.normal_map.is_none()
            && self.normal.is_none()
            && self.components.is_empty()
    }
}

/// A body with two flat parallel faces, object space.
struct Slab {
    /// Unit normal of its faces.
    axis: DVec3,
    /// Distance of its faces.
    thickness: f64,
    /// Area of one face.
    area: f64,
    /// Normals of the rim's triangles; their length is the area.
    rim: Vec<DVec3>,
}

impl Slab {
    /// Thickness under an instance's transform, metres; `None` if it is too thick there.
    fn thickness_in(&self, instance: &Instance) -> Option<f64> {
        let matrix: DMat3 = instance.world_from_object.matrix3;
        // Vector areas transform by the cofactor matrix.
        let normals = matrix.inverse().transpose();
        let areas = normals * matrix.determinant().abs();
        let area = (areas * self.axis).length() * self.area;
        let rim: f64 = self.rim.iter().map(|&of_triangle| (areas * of_triangle).length()).sum();
        let thickness = self.thickness / (normals * self.axis).length();
        (thickness.is_finite() && thickness > 0.0 && rim <= MAX_RIM * area).then_some(thickness)
    }
}

/// The slabs among the bodies of a set of triangles.
fn slabs_of(mesh: &Mesh, triangles: &[[u32; 3]]) -> Vec<Slab> {
    bodies_of(mesh, triangles).iter().flat_map(|body| slabs_of_body(mesh, triangles, body)).collect()
}

/// The triangles of each body (connected component). Vertices at the same position are connected.
fn bodies_of(mesh: &Mesh, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    // Union-find of vertices: representatives are their own parents, unused vertices have none.
    let mut parents = vec![u32::MAX; mesh.positions.len()];
    let mut sets = 0;
    for &[a, b, c] in triangles {
        for vertex in [a, b, c] {
            if parents[vertex as usize] == u32::MAX {
                parents[vertex as usize] = vertex;
                sets += 1;
            }
        }
        sets -= u32::from(union(&mut parents, a, b)) + u32::from(union(&mut parents, a, c));
    }
    if sets > 1 {
        let mut first_at: HashMap<[u32; 3], u32> = HashMap::new();
        for vertex in 0..parents.len() as u32 {
            if parents[vertex as usize] == u32::MAX {
                continue;
            }
            // Adding 0 turns -0 into 0.
            let position = mesh.positions[vertex as usize].map(|c| (c + 0.0).to_bits());
            let first = *first_at.entry(position).or_insert(vertex);
            union(&mut parents, first, vertex);
        }
    }
    let mut numbers = vec![usize::MAX; parents.len()];
    let mut bodies: Vec<Vec<u32>> = Vec::new();
    for (triangle, [corner, ..]) in triangles.iter().enumerate() {
        let number = &mut numbers[root(&mut parents, *corner) as usize];
        if *number == usize::MAX {
            *number = bodies.len();
            bodies.push(Vec::new());
        }
        bodies[*number].push(triangle as u32);
    }
    bodies
}

/// Merges the sets of two vertices (union-find); false if they were the same set.
fn union(parents: &mut [u32], a: u32, b: u32) -> bool {
    let (a, b) = (root(parents, a), root(parents, b));
    parents[b as usize] = a;
    a != b
}

/// The representative of a vertex's set, by path halving.
fn root(parents: &mut [u32], mut vertex: u32) -> u32 {
    while parents[vertex as usize] != vertex {
        parents[vertex as usize] = parents[parents[vertex as usize] as usize];
        vertex = parents[vertex as usize];
    }
    vertex
}

/// The slabs of a body along the normals of its largest triangles: an instance's scale may flatten it along any of them.
fn slabs_of_body(mesh: &Mesh, triangles: &[[u32; 3]], body: &[u32]) -> Vec<Slab> {
    let corners = |triangle: u32| mesh.corners_f64(triangles[triangle as usize]);
    let face = |&triangle: &u32| {
        let [a, b, c] = corners(triangle);
        let area = (b - a).cross(c - a) * 0.5;
        Face { triangle, area, size: area.length() }
    };
    let faces: Vec<Face> = body.iter().map(face).collect();
    let mut axes: Vec<DVec3> = Vec::new();
    for _ in 0..MAX_AXES {
        axes.extend(largest_off_axes(&axes, &faces).and_then(|face| face.area.try_normalize()));
    }
    axes.into_iter().filter_map(|axis| slab_along(axis, &faces, corners)).collect()
}

/// A triangle of a body.
struct Face {
    /// Index in the list of triangles.
    triangle: u32,
    /// Vector area.
    area: DVec3,
    /// Length of `area`.
    size: f64,
}

impl Face {
    /// Is the normal parallel to a unit vector?
    fn is_along(&self, axis: DVec3) -> bool {
        self.area.dot(axis).abs() >= FLAT_COSINE * self.size
    }
}

/// The largest face whose normal is parallel to none of the axes.
fn largest_off_axes<'a>(axes: &[DVec3], faces: &'a [Face]) -> Option<&'a Face> {
    let mut largest: Option<&Face> = None;
    for face in faces {
        if largest.is_none_or(|largest| face.size > largest.size)
            && !axes.iter().any(|&axis| face.is_along(axis))
        {
            largest = Some(face);
        }
    }
    largest
}

/// The slab of a body along an axis; `None` unless there are two flat faces of the same area.
fn slab_along(axis: DVec3, faces: &[Face], corners: impl Fn(u32) -> [DVec3; 3]) -> Option<Slab> {
    let mut of_faces = [0.0; 2];
    let mut levels = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    for face in faces.iter().filter(|face| face.is_along(axis) && face.size > 0.0) {
        let side = usize::from(face.area.dot(axis) < 0.0);
        of_faces[side] += face.size;
        for corner in corners(face.triangle) {
            let level = corner.dot(axis);
            levels[side] = (levels[side].0.min(level), levels[side].1.max(level));
        }
    }
    let area = of_faces[0].min(of_faces[1]);
    let thickness = levels[0].0 - levels[1].1;
    let unevenness = (levels[0].1 - levels[0].0).max(levels[1].1 - levels[1].0);
    let is_slab = area > 0.0
        && (of_faces[0] - of_faces[1]).abs() <= MAX_DIFFERENCE * area
        && thickness > 0.0
        && unevenness <= 1e-3 * thickness;
    is_slab.then(|| {
        let rim = faces.iter().filter(|face| !face.is_along(axis)).map(|face| face.area).collect();
        Slab { axis, thickness, area, rim }
    })
}

/// Maximum number of refractive bodies.
const MAX_BODIES: usize = 64;

/// Maximum number of sides of a body.
const MAX_SIDES: usize = 6;

/// Minimum cosine between the normals of triangles of one side.
const SIDE_COSINE: f64 = 0.75;

/// Minimum area of a side, as a fraction of the body's area.
const MIN_SHARE: f64 = 0.08;

/// Maximum root mean square of the angles between the normals of a side and their mean, radians.
const MAX_SPREAD: f64 = 0.25;

/// Maximum number of triangles tested to reject round bodies.
const MAX_PROBES: usize = 64;

/// Margin of bounding boxes, relative to their diagonal.
const BOUNDS_MARGIN: f32 = 0.01;

/// Small bright lights and the bodies that refract their light.
#[derive(Clone, Debug, Default)]
pub struct RefractedLights {
    pub lights: Vec<SmallLight>,
    /// Refracting bodies.
    pub bodies: Vec<Refractor>,
    /// Does any body refract light to points outside all solids?
    pub from_outside: bool,
}

/// A body that refracts light.
#[derive(Clone, Debug)]
pub struct Refractor {
    /// Bounds, relative to the anchor.
    pub bounds: Bounds3,
    /// Index of the medium inside; 0 for an open sheet.
    pub medium: u16,
    /// Is the GGX alpha above 0?
    pub is_rough: bool,
    /// Index of refraction.
    pub ior: f32,
    /// Flat and wavy sides.
    pub sides: Vec<Side>,
}

/// A side of a body.
#[derive(Clone, Copy, Debug)]
pub struct Side {
    /// Mean normal.
    pub normal: Vec3,
    /// Root mean square of the angles to the mean normal, radians.
    pub spread: f32,
}

impl RefractedLights {
    /// Finds the bodies and lights; empty if either is missing.
    pub(super) fn find(
        scene: &Scene,
        materials: &[CompiledMaterial],
        anchor: DVec3,
        (lights, textures): (&Lights, &CompiledTextures),
    ) -> RefractedLights {
        if !materials.iter().any(|material| material.refractor_interface().is_some()) {
            return RefractedLights::default();
        }
        let lights = lights.small_lights(textures);
        let mut bodies = Vec::new();
        for instance in scene.instances.iter().filter(|_| !lights.is_empty()) {
            let mesh = &scene.meshes[instance.mesh.index()];
            for (part, material) in mesh.parts.iter().zip(objects::part_materials(mesh, instance)) {
                let triangles = mesh.triangles.get(part.triangles());
                let place = PlacedMesh { mesh, instance, anchor };
                bodies.extend(triangles.and_then(|list| place.refractor(list, &materials[material.index()])));
            }
        }
        for quad in &scene.quads {
            let corner = quad.corner - anchor;
            let corners = [DVec3::ZERO, quad.edge_u, quad.edge_v, quad.edge_u + quad.edge_v];
            let bounds = Bounds3::of(corners.map(|edge| (corner + edge).as_vec3()));
            let face = RefractorFace::new(quad.edge_u.cross(quad.edge_v));
            bodies.extend(refractor(bounds, sides_of(&[face]), &materials[quad.material.index()]));
        }
        // With too many bodies the test rays don't pay.
        match bodies.is_empty() || bodies.len() > MAX_BODIES {
            true => RefractedLights::default(),
            false => {
                let from_outside = bodies.iter().any(|body| body.is_rough || body.medium == 0);
                RefractedLights { lights, bodies, from_outside }
            }
        }
    }

    /// Are there no refractive bodies?
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }
}

impl CompiledMaterial {
    /// Index of refraction and GGX alpha of refractive glass or water; `None` for other materials.
    pub fn refractor_interface(&self) -> Option<(f32, f32)> {
        let is_glass = matches!(self.class, BsdfClass::Dielectric | BsdfClass::RoughDielectric);
        let is_plain = is_glass
            && !self.is_boundary
            && self.alpha.is_none()
            && self.emission.is_none()
            && self.components.is_empty();
        self.uniform_bsdf().filter(|_| is_plain).and_then(|bsdf| bsdf.solid_ior_and_alpha())
    }
}

/// A refractor, if material and shape are suitable.
fn refractor(bounds: Bounds3, sides: Vec<Side>, material: &CompiledMaterial) -> Option<Refractor> {
    let (ior, alpha) = material.refractor_interface()?;
    let margin = Vec3::splat(BOUNDS_MARGIN * bounds.extent().length());
    let bounds = Bounds3 { min: bounds.min - margin, max: bounds.max + margin };
    let (medium, is_rough) = (material.medium_index, alpha > 0.0);
    // Smooth bodies need flat or wavy sides.
    (is_rough || !sides.is_empty()).then_some(Refractor { bounds, medium, is_rough, ior, sides })
}

/// An instance of a mesh, relative to the anchor.
struct PlacedMesh<'a> {
    mesh: &'a Mesh,
    instance: &'a Instance,
    anchor: DVec3,
}

impl PlacedMesh<'_> {
    fn refractor(&self, triangles: &[[u32; 3]], material: &CompiledMaterial) -> Option<Refractor> {
        let (_, alpha) = material.refractor_interface()?;
        // Most smooth bodies are round: reject them by a few triangles.
        let step = triangles.len().div_ceil(MAX_PROBES).max(1);
        let few: Vec<RefractorFace> =
            triangles.iter().step_by(step).map(|triangle| self.face(triangle)).collect();
        if alpha <= 0.0 && sides_of(&few).is_empty() {
            return None;
        }
        let place = &self.instance.world_from_object;
        let corners = triangles.iter().flat_map(|triangle| self.mesh.corners_f64(*triangle));
        let bounds = Bounds3::of(corners.map(|p| (place.transform_point3(p) - self.anchor).as_vec3()));
        let faces: Vec<RefractorFace> = triangles.iter().map(|triangle| self.face(triangle)).collect();
        refractor(bounds, sides_of(&faces), material)
    }

    fn face(&self, triangle: &[u32; 3]) -> RefractorFace {
        let matrix: DMat3 = self.instance.world_from_object.matrix3;
        let [a, b, c] = self.mesh.corners_f64(*triangle);
        RefractorFace::new((matrix * (b - a)).cross(matrix * (c - a)) * matrix.determinant().signum())
    }
}

/// A triangle of a body.
struct RefractorFace {
    normal: DVec3,
    /// Proportional to the area.
    size: f64,
}

impl RefractorFace {
    fn new(area: DVec3) -> RefractorFace {
        RefractorFace { normal: area.normalize_or_zero(), size: area.length() }
    }
}

/// The sides of a body.
fn sides_of(faces: &[RefractorFace]) -> Vec<Side> {
    let mut normals: Vec<DVec3> = Vec::new();
    while normals.len() < MAX_SIDES {
        let rest = faces.iter().filter(|face| !normals.iter().any(|n| face.normal.dot(*n) >= SIDE_COSINE));
        let Some(largest) = rest.max_by(|a, b| a.size.total_cmp(&b.size)).filter(|face| face.size > 0.0)
        else {
            break;
        };
        let side_faces = faces.iter().filter(|face| face.normal.dot(largest.normal) >= SIDE_COSINE);
        normals
            .push(side_faces.map(|face| face.normal * face.size).sum::<DVec3>().normalize_or(largest.normal));
    }
    let total: f64 = faces.iter().map(|face| face.size).sum();
    let side = |normal: &DVec3| {
        let side_faces = || faces.iter().filter(|face| face.normal.dot(*normal) >= SIDE_COSINE);
        let area: f64 = side_faces().map(|face| face.size).sum();
        let squares =
            side_faces().map(|face| (face.normal - *normal).length_squared() * face.size).sum::<f64>();
        let spread = (squares / area).sqrt();
        (area >= MIN_SHARE * total && spread <= MAX_SPREAD)
            .then(|| Side { normal: normal.as_vec3(), spread: spread as f32 })
    };
    normals.iter().filter_map(side).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::load;
    use crate::scene::MaterialId;

    /// Tetrahedra with shared vertices, or with separate vertices per triangle.
    fn tetrahedra(places: &[f32], are_shared: bool) -> Mesh {
        let corners = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0], [x, 0.0, 1.0]];
        let shared: Vec<[f32; 3]> = places.iter().flat_map(|&x| corners(x)).collect();
        let of_one = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let first = (0..places.len() as u32).map(|i| 4 * i);
        let triangles: Vec<[u32; 3]> = first.flat_map(|i| of_one.map(|t| t.map(|v| v + i))).collect();
        if are_shared {
            return Mesh::new("a", shared, triangles, MaterialId(0));
        }
        let positions = triangles.iter().flatten().map(|&v| shared[v as usize]).collect();
        Mesh::new(
            "a",
            positions,
            (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            MaterialId(0),
        )
    }

    #[test]
    fn bodies_are_connected_by_positions() {
        for are_shared in [true, false] {
            let bodies = |places: &[f32]| {
                let mesh = tetrahedra(places, are_shared);
                bodies_of(&mesh, &mesh.triangles)
            };
            assert_eq!(bodies(&[0.0]), [[0, 1, 2, 3]]);
            assert_eq!(bodies(&[0.0, 5.0]), [[0, 1, 2, 3], [4, 5, 6, 7]]);
            // The third touches the first at a corner.
            assert_eq!(bodies(&[0.0, 5.0, 1.0]), [vec![0, 1, 2, 3, 8, 9, 10, 11], vec![4, 5, 6, 7]]);
            assert_eq!(bodies(&[-1.0, -0.0, 0.0, 9.0]).len(), 2);
        }
    }

    /// Thickness of the panes of the glass in a scene file, metres.
    fn thickness(objects: &str) -> f32 {
        let text = format!("[materials]\nglass = {{ type = \"dielectric\" }}\n{objects}");
        let file =
            std::env::temp_dir().join(format!("oscura-panes-{}-{}.toml", std::process::id(), objects.len()));
        std::fs::write(&file, text).expect("the file is written");
        let scene = load(&file, &Default::default()).expect("it loads").scene;
        std::fs::remove_file(&file).expect("it is there");
        let (compiled, _) = crate::compile::compile(&scene, &Default::default()).expect("it is valid");
        compiled.materials[0].pane_thickness
    }

    #[test]
    fn flat_boxes_are_panes_and_cubes_are_not() {
        let of_box = |depth: f32| {
            thickness(&format!(
                "[[objects]]\nbox = {{ min = [0, 0, 0], max = [1, 1, {depth}] }}\nmaterial = \"glass\"\n"
            ))
        };
        assert!((of_box(0.01) - 0.0101).abs() < 1e-6);
        assert_eq!(of_box(0.5), 0.0);
        let flattened = "[[objects]]\nbox = { min = [0, 0, 0], max = [1, 1, 1] }\nmaterial = \"glass\"\ntransform = [{ scale = [2, 0.01, 1] }]\n";
        assert!((thickness(flattened) - 0.0101).abs() < 1e-6);
        let ball = "[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"glass\"\n";
        assert_eq!(thickness(ball), 0.0);
    }

    fn sides(normals: impl IntoIterator<Item = DVec3>) -> Vec<Side> {
        sides_of(&normals.into_iter().map(RefractorFace::new).collect::<Vec<RefractorFace>>())
    }

    #[test]
    fn flat_and_wavy_sides_are_found_and_round_ones_are_not() {
        let of_box = sides([DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|n| [n, -n]));
        assert_eq!((of_box.len(), of_box[0].spread), (6, 0.0));
        let slope = |k: i32| DVec3::new(0.1 * f64::from(k % 3 - 1), 1.0, 0.0);
        let waves = sides((0..30).map(slope));
        assert_eq!(waves.len(), 1);
        assert!((waves[0].spread - 0.1 * (2.0f32 / 3.0).sqrt()).abs() < 2e-3, "{waves:?}");
        let around = |k: i32| {
            let (z, turn) = (2.0 * (f64::from(k) + 0.5) / 500.0 - 1.0, 2.399963 * f64::from(k));
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * turn.cos(), r * turn.sin(), z)
        };
        assert!(sides((0..500).map(around)).is_empty());
    }
}
