//! The objects of a scene for programs.

use super::facts::instance_materials;
use oscura::scene::{Extent, MaterialId, Scene};
use serde::Serialize;

/// The least and the greatest coordinates.
pub type Bounds = [[f64; 3]; 2];

/// The bounds of what has any.
pub fn bounds(extent: Extent) -> Option<Bounds> {
    extent.0.map(|(low, high)| [low.to_array(), high.to_array()])
}

/// A placed mesh or a primitive.
#[derive(Serialize)]
#[serde(untagged)]
pub enum Object<'a> {
    Mesh {
        kind: &'static str,
        name: &'a str,
        mesh: &'a str,
        mesh_index: usize,
        vertices: usize,
        triangles: usize,
        normals: bool,
        uv_sets: usize,
        materials: Vec<&'a str>,
        extent: Option<Bounds>,
    },
    Shape {
        kind: &'static str,
        name: &'a str,
        center: [f64; 3],
        radius: f64,
        materials: [&'a str; 1],
    },
    Quad {
        kind: &'static str,
        name: &'a str,
        corner: [f64; 3],
        edge_u: [f64; 3],
        edge_v: [f64; 3],
        materials: [&'a str; 1],
    },
    Curves {
        kind: &'static str,
        name: &'a str,
        basis: &'static str,
        strands: usize,
        points: usize,
        materials: [&'a str; 1],
    },
}

/// All of them; `extents` are those of the instances.
pub fn objects<'a>(scene: &'a Scene, extents: &[Extent]) -> Vec<Object<'a>> {
    let named = |id: MaterialId| scene.materials[id.index()].name.as_str();
    let instances = scene.instances.iter().zip(extents).map(|(i, e)| {
        let mesh = &scene.meshes[i.mesh.index()];
        Object::Mesh {
            kind: "mesh",
            name: &i.name,
            mesh: &mesh.name,
            mesh_index: i.mesh.index(),
            vertices: mesh.positions.len(),
            triangles: mesh.triangles.len(),
            normals: !mesh.normals.is_empty(),
            uv_sets: mesh.uv_sets.len(),
            materials: instance_materials(scene, i).into_iter().map(named).collect(),
            extent: bounds(*e),
        }
    });
    let shapes = scene.shapes.iter().map(|s| Object::Shape {
        kind: s.kind.tag().name(),
        name: &s.name,
        center: s.center.to_array(),
        radius: s.radius,
        materials: [named(s.material)],
    });
    let quads = scene.quads.iter().map(|q| Object::Quad {
        kind: "quad",
        name: &q.name,
        corner: q.corner.to_array(),
        edge_u: q.edge_u.to_array(),
        edge_v: q.edge_v.to_array(),
        materials: [named(q.material)],
    });
    let curves = scene.curves.iter().map(|c| Object::Curves {
        kind: "curves",
        name: &c.name,
        basis: c.basis.name(),
        strands: c.strands.len(),
        points: c.points.len(),
        materials: [named(c.material)],
    });
    instances.chain(shapes).chain(quads).chain(curves).collect()
}
