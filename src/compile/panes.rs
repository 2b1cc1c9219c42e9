//! Finds panes: closed bodies of clear smooth glass with two flat parallel faces, through which light samples reach (see
//! `integrator::panes`). They are found by their geometry, so that windows, double glazing and table tops need no option.

use super::material::CompiledMaterial;
use crate::bsdf::BsdfClass;
use crate::math::{DMat3, DVec3};
use crate::scene::{Instance, Mesh, Scene};
use std::collections::HashMap;

/// Least cosine between normals of the same face.
const FLAT_COSINE: f64 = 1.0 - 1e-6;

/// Largest area of the rim relative to one face: within this far from it, light that is reflected within the pane more than once would
/// leave through the rim. A square pane is then at most an eighth as thick as wide.
const MOST_RIM: f64 = 0.5;

/// Largest difference between the areas of the two faces, relative.
const MOST_DIFFERENCE: f64 = 0.02;

/// Directions in which a body is tried: those of a box.
const MOST_AXES: usize = 3;

/// Margin on the thickness, relative.
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
        let of_parts = || super::objects::part_materials(mesh, instance);
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
            let known = &mut materials[material.index()].pane_thickness;
            *known = known.max((thickness * MARGIN) as f32);
        }
    }
}

impl CompiledMaterial {
    /// Is it clear smooth glass without texture or other traits that a light sample could not pass?
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

/// A body with two flat parallel faces, in the mesh's space.
struct Slab {
    /// Unit normal of its faces.
    axis: DVec3,
    /// Distance of its faces.
    thickness: f64,
    /// Area of one face.
    area: f64,
    /// Normals of the triangles of its rim, as long as their areas.
    rim: Vec<DVec3>,
}

impl Slab {
    /// Metres where an instance places it; `None` if it is not flat there.
    fn thickness_in(&self, instance: &Instance) -> Option<f64> {
        let matrix: DMat3 = instance.world_from_object.matrix3;
        // Areas change with the cofactors of the matrix.
        let normals = matrix.inverse().transpose();
        let areas = normals * matrix.determinant().abs();
        let area = (areas * self.axis).length() * self.area;
        let rim: f64 = self.rim.iter().map(|&of_triangle| (areas * of_triangle).length()).sum();
        let thickness = self.thickness / (normals * self.axis).length();
        (thickness.is_finite() && thickness > 0.0 && rim <= MOST_RIM * area).then_some(thickness)
    }
}

/// The slabs among the bodies that some triangles form.
fn slabs_of(mesh: &Mesh, triangles: &[[u32; 3]]) -> Vec<Slab> {
    bodies_of(mesh, triangles).iter().flat_map(|body| slabs_of_body(mesh, triangles, body)).collect()
}

/// The triangles of each body: those that share vertices. Vertices at the same position are one.
fn bodies_of(mesh: &Mesh, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut first_at: HashMap<[u32; 3], u32> = HashMap::new();
    let mut parents: Vec<u32> = Vec::new();
    // What `first_at` says of each vertex, once it was asked.
    let mut known = vec![u32::MAX; mesh.positions.len()];
    let mut corners: Vec<u32> = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| {
            let vertex = &mut known[i as usize];
            if *vertex == u32::MAX {
                // Adding 0 makes -0 and 0 the same.
                let position = mesh.positions[i as usize].map(|c| (c + 0.0).to_bits());
                *vertex = *first_at.entry(position).or_insert_with(|| {
                    parents.push(parents.len() as u32);
                    parents.len() as u32 - 1
                });
            }
            root(&mut parents, *vertex)
        });
        parents[b as usize] = a;
        let c = root(&mut parents, c);
        parents[c as usize] = a;
        corners.push(a);
    }
    let mut numbers = vec![usize::MAX; parents.len()];
    let mut bodies: Vec<Vec<u32>> = Vec::new();
    for (triangle, corner) in corners.into_iter().enumerate() {
        let number = &mut numbers[root(&mut parents, corner) as usize];
        if *number == usize::MAX {
            *number = bodies.len();
            bodies.push(Vec::new());
        }
        bodies[*number].push(triangle as u32);
    }
    bodies
}

/// The representative of a vertex's set, by path halving.
fn root(parents: &mut [u32], mut vertex: u32) -> u32 {
    while parents[vertex as usize] != vertex {
        parents[vertex as usize] = parents[parents[vertex as usize] as usize];
        vertex = parents[vertex as usize];
    }
    vertex
}

/// A body as a slab along each of the [`MOST_AXES`] normals of its largest triangles: an instance may flatten it along any.
fn slabs_of_body(mesh: &Mesh, triangles: &[[u32; 3]], body: &[u32]) -> Vec<Slab> {
    let corners: Vec<[DVec3; 3]> = body
        .iter()
        .map(|&t| triangles[t as usize].map(|i| DVec3::from_array(mesh.positions[i as usize].map(f64::from))))
        .collect();
    let areas: Vec<DVec3> = corners.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a) * 0.5).collect();
    let mut axes: Vec<DVec3> = Vec::new();
    for _ in 0..MOST_AXES {
        let others = areas.iter().filter(|area| !axes.iter().any(|&axis| is_along(**area, axis)));
        let largest = others.max_by(|a, b| a.length().total_cmp(&b.length()));
        axes.extend(largest.and_then(|area| area.try_normalize()));
    }
    axes.into_iter().filter_map(|axis| slab_along(axis, &corners, &areas)).collect()
}

/// Is a vector parallel to an axis of unit length?
fn is_along(v: DVec3, axis: DVec3) -> bool {
    v.dot(axis).abs() >= FLAT_COSINE * v.length()
}

/// The slab with this normal that triangles form; `None` if they have not two flat faces of the same area there.
fn slab_along(axis: DVec3, corners: &[[DVec3; 3]], areas: &[DVec3]) -> Option<Slab> {
    let mut of_faces = [0.0; 2];
    let mut rim = Vec::new();
    let mut levels = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    for (corners, &area) in corners.iter().zip(areas) {
        if area == DVec3::ZERO {
            continue;
        }
        if !is_along(area, axis) {
            rim.push(area);
            continue;
        }
        let side = usize::from(area.dot(axis) < 0.0);
        of_faces[side] += area.length();
        for corner in corners {
            let level = corner.dot(axis);
            levels[side] = (levels[side].0.min(level), levels[side].1.max(level));
        }
    }
    let area = of_faces[0].min(of_faces[1]);
    let thickness = levels[0].0 - levels[1].1;
    let unevenness = (levels[0].1 - levels[0].0).max(levels[1].1 - levels[1].0);
    let is_slab = area > 0.0
        && (of_faces[0] - of_faces[1]).abs() <= MOST_DIFFERENCE * area
        && thickness > 0.0
        && unevenness <= 1e-3 * thickness;
    is_slab.then_some(Slab { axis, thickness, area, rim })
}

#[cfg(test)]
mod tests {
    use crate::load::load;

    /// The thickness of panes of each material of a scene file, in metres.
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
}
