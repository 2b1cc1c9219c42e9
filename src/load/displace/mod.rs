//! Displacement: meshes whose materials have height maps are subdivided and moved along their normals when a scene is loaded, so that
//! what follows knows of triangles only.

mod heights;
mod lift;
mod subdivide;

use super::Loaded;
use crate::error::Warning;
use crate::math::{DAffine3, DVec3};
use crate::scene::{Displacement, Instance, MaterialId, Mesh, MeshId, Motion, Quad, Scene};
use heights::{Heights, Parts};
use std::collections::HashMap;

/// Most triangles that all displaced meshes of a scene may have together.
const MOST_TRIANGLES: usize = 16_000_000;
/// Edges of this share of a mesh's diagonal, where the material gives no length.
const DEFAULT_EDGE: f32 = 1.0 / 256.0;

/// Applies the displacement of all materials to what has them. None is left behind.
pub(super) fn apply(loaded: &mut Loaded) {
    if loaded.scene.materials.iter().all(|m| m.displacement.is_none()) {
        return;
    }
    let mut heights = HashMap::new();
    let scene = &loaded.scene;
    for (id, material) in (0..).map(MaterialId).zip(&scene.materials) {
        let Some(displacement) = material.displacement else { continue };
        match Heights::of(scene, displacement.texture) {
            Ok(found) => drop(heights.insert(id, (displacement, found))),
            Err(why) => warn(&mut loaded.warnings, &material.name, why),
        }
    }
    let Loaded { scene, warnings, .. } = loaded;
    tell_of_shapes(scene, &heights, warnings);
    quads_to_meshes(scene, &heights, warnings);
    instances(scene, &heights, warnings);
    loaded.scene.materials.iter_mut().for_each(|m| m.displacement = None);
}

type AllHeights = HashMap<MaterialId, (Displacement, Heights)>;

fn warn(warnings: &mut Vec<Warning>, name: &str, message: impl Into<String>) {
    warnings.push(Warning::general(format!("'{name}': {}", message.into())));
}

/// Analytic shapes have no triangles.
fn tell_of_shapes(scene: &Scene, heights: &AllHeights, warnings: &mut Vec<Warning>) {
    let shape = scene.shapes.iter().find(|shape| heights.contains_key(&shape.material));
    if let Some(shape) = shape {
        warn(warnings, &shape.name, "only meshes, boxes and quads are displaced, no spheres or disks");
    }
}

/// Makes meshes of the quads that are to be displaced.
fn quads_to_meshes(scene: &mut Scene, heights: &AllHeights, warnings: &mut Vec<Warning>) {
    let displaced = |quad: &Quad| heights.contains_key(&quad.material);
    let Some(first) = scene.quads.iter().find(|quad| displaced(quad)) else { return };
    if !scene.motion.quads.is_empty() {
        return warn(warnings, &first.name, "is not displaced where quads move: make a mesh of it");
    }
    let (wanted, rest) = std::mem::take(&mut scene.quads).into_iter().partition(displaced);
    scene.quads = rest;
    let wanted: Vec<Quad> = wanted;
    for quad in wanted {
        let corners = [DVec3::ZERO, quad.edge_u, quad.edge_u + quad.edge_v, quad.edge_v];
        let positions = corners.map(|corner| corner.as_vec3().to_array()).to_vec();
        let triangles = vec![[0, 1, 2], [0, 2, 3]];
        let uv_sets = vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]];
        let mesh = Mesh::new(&quad.name, positions, triangles, quad.material);
        let mesh = scene.add_mesh(Mesh { uv_sets, ..mesh });
        let placed = Instance::new(mesh, DAffine3::from_translation(quad.corner));
        scene.instances.push(Instance { name: quad.name, traits: quad.traits, ..placed });
    }
}

/// Gives all instances with displaced materials displaced meshes, each made once.
fn instances(scene: &mut Scene, heights: &AllHeights, warnings: &mut Vec<Warning>) {
    let mut made: HashMap<(MeshId, Option<MaterialId>), Option<MeshId>> = HashMap::new();
    let mut triangles = 0;
    for index in 0..scene.instances.len() {
        let Instance { mesh, material, motion, ref name, .. } = scene.instances[index];
        let Some(own) = scene.meshes.get(mesh.index()) else { continue };
        let over = |id: MaterialId| heights.get(&id).map(|(displacement, heights)| (displacement, heights));
        let parts: Parts = own.parts.iter().map(|part| over(material.unwrap_or(part.material))).collect();
        if parts.iter().all(Option::is_none) {
            continue;
        }
        let deforms = motion == Motion::Deforms || scene.motion.meshes.contains_key(&mesh.index());
        if deforms {
            warn(warnings, name, "is not displaced: its mesh changes its form");
            continue;
        }
        let key = (mesh, material.filter(|id| heights.contains_key(id)));
        let displaced = match made.get(&key) {
            Some(known) => *known,
            None => {
                let displaced = displaced(own, &parts, MOST_TRIANGLES - triangles, warnings);
                triangles += displaced.as_ref().map_or(0, |mesh| mesh.triangles.len());
                triangles = triangles.min(MOST_TRIANGLES);
                let id = displaced.map(|mesh| scene.add_mesh(mesh));
                made.insert(key, id);
                id
            }
        };
        if let Some(mesh) = displaced {
            scene.instances[index].mesh = mesh;
        }
    }
}

/// The mesh with its parts displaced; `None` where it can't be.
fn displaced(own: &Mesh, parts: &Parts, budget: usize, warnings: &mut Vec<Warning>) -> Option<Mesh> {
    let has_coordinates = parts
        .iter()
        .flatten()
        .all(|(_, heights)| own.uv_sets.get(heights.set()).is_some_and(|s| !s.is_empty()));
    if !has_coordinates {
        warn(warnings, &own.name, "is not displaced: it has no texture coordinates");
        return None;
    }
    let edges: Vec<Option<f32>> = parts
        .iter()
        .map(|part| part.map(|(d, _)| if d.edge > 0.0 { d.edge } else { DEFAULT_EDGE * diagonal(own) }))
        .collect();
    let edges = affordable(own, edges, budget, warnings);
    let (fine, longest) = subdivide::subdivided(own, &edges, budget);
    if let Some(longest) = longest {
        let message = format!(
            "is subdivided to edges of {longest:.3}, not finer: all displaced meshes together may have {MOST_TRIANGLES} triangles"
        );
        warn(warnings, &own.name, message);
    }
    Some(lift::lifted(fine, parts))
}

/// Edges that are not far too short: where so many triangles are out of reach, nothing is gained by cutting until the limit.
fn affordable(
    own: &Mesh,
    mut edges: Vec<Option<f32>>,
    budget: usize,
    warnings: &mut Vec<Warning>,
) -> Vec<Option<f32>> {
    /// Times as many triangles as may be.
    const FAR: f64 = 16.0;
    let least = subdivide::least_triangles(own, &edges);
    if least <= FAR * budget as f64 {
        return edges;
    }
    let default = DEFAULT_EDGE * diagonal(own);
    // Halves of edges make up to four times as many triangles as are needed.
    let shortest = (least * 4.0 / budget.max(1) as f64).sqrt();
    let wanted = edges.iter().flatten().copied().fold(f32::INFINITY, f32::min);
    let message = format!(
        "is subdivided to edges of {default:.3}, the default: edges of {wanted:e} would take at least {least:.1e} triangles, and all displaced \
         meshes together may have {MOST_TRIANGLES}; edge = {:.1e} is possible",
        f64::from(wanted) * shortest
    );
    warn(warnings, &own.name, message);
    edges.iter_mut().flatten().for_each(|edge| *edge = edge.max(default));
    edges
}

/// Of the box around a mesh.
fn diagonal(mesh: &Mesh) -> f32 {
    let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
    for p in &mesh.positions {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    (0..3).map(|k| (high[k] - low[k]).powi(2)).sum::<f32>().sqrt()
}

#[cfg(test)]
mod tests;
