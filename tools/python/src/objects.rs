//! Meshes, instances, and shapes.

use super::arrays::{rows, transform, triangles};
use super::errors::usage;
use super::scene::{Scene, checked};
use oscura::scene::{Instance, MaterialId, Mesh, MeshId, Quad, Shape};
use pyo3::prelude::*;

/// Refuses lists whose length is not the number of vertices.
fn one_each<T>(argument: &str, list: &[T], vertices: usize) -> PyResult<()> {
    match list.is_empty() || list.len() == vertices {
        true => Ok(()),
        false => Err(usage(format!("{argument} has {} rows for {vertices} positions", list.len()))),
    }
}

impl Scene {
    fn material(&mut self, id: u32) -> PyResult<MaterialId> {
        let count = self.scene_mut()?.materials.len();
        checked("material", id, count).map(MaterialId)
    }
}

#[pymethods]
impl Scene {
    /// Adds a mesh, visible through `add_instance`; returns its id.
    #[pyo3(signature = (positions, triangles, material, *, normals=None, uvs=None, colors=None, name=""))]
    fn add_mesh(
        &mut self,
        positions: &Bound<'_, PyAny>,
        triangles: &Bound<'_, PyAny>,
        material: u32,
        normals: Option<&Bound<'_, PyAny>>,
        uvs: Option<&Bound<'_, PyAny>>,
        colors: Option<&Bound<'_, PyAny>>,
        name: &str,
    ) -> PyResult<u32> {
        let material = self.material(material)?;
        let positions = rows::<3>("positions", positions)?;
        let count = positions.len();
        let triangles = self::triangles(triangles, count)?;
        let mut mesh = Mesh::new(name, positions, triangles, material);
        mesh.normals = normals.map_or(Ok(vec![]), |list| rows::<3>("normals", list))?;
        mesh.colors = colors.map_or(Ok(vec![]), rgba)?;
        one_each("normals", &mesh.normals, count)?;
        one_each("colors", &mesh.colors, count)?;
        if let Some(uvs) = uvs {
            mesh.uv_sets = vec![rows::<2>("uvs", uvs)?];
            one_each("uvs", &mesh.uv_sets[0], count)?;
        }
        Ok(self.scene_mut()?.add_mesh(mesh).0)
    }

    /// Adds an instance of a mesh.
    #[pyo3(signature = (mesh, transform=None, *, material=None, name=""))]
    fn add_instance(
        &mut self,
        mesh: u32,
        transform: Option<&Bound<'_, PyAny>>,
        material: Option<u32>,
        name: &str,
    ) -> PyResult<()> {
        let count = self.scene_mut()?.meshes.len();
        let mesh = MeshId(checked("mesh", mesh, count)?);
        let material = material.map(|id| self.material(id)).transpose()?;
        let placed = Instance::new(mesh, self::transform(transform)?);
        let name = name.to_string();
        self.scene_mut()?.instances.push(Instance { name, material, ..placed });
        Ok(())
    }

    #[pyo3(signature = (center, radius, material, *, name=""))]
    fn add_sphere(&mut self, center: [f64; 3], radius: f64, material: u32, name: &str) -> PyResult<()> {
        let sphere = Shape::sphere(center, radius, self.material(material)?);
        self.scene_mut()?.shapes.push(Shape { name: name.to_string(), ..sphere });
        Ok(())
    }

    #[pyo3(signature = (center, normal, radius, material, *, name=""))]
    fn add_disk(
        &mut self,
        center: [f64; 3],
        normal: [f64; 3],
        radius: f64,
        material: u32,
        name: &str,
    ) -> PyResult<()> {
        let disk = Shape::disk(center, normal, radius, self.material(material)?);
        self.scene_mut()?.shapes.push(Shape { name: name.to_string(), ..disk });
        Ok(())
    }

    #[pyo3(signature = (corner, edge_u, edge_v, material, *, name=""))]
    fn add_quad(
        &mut self,
        corner: [f64; 3],
        edge_u: [f64; 3],
        edge_v: [f64; 3],
        material: u32,
        name: &str,
    ) -> PyResult<()> {
        let quad = Quad::new(corner, edge_u, edge_v, self.material(material)?);
        self.scene_mut()?.quads.push(Quad { name: name.to_string(), ..quad });
        Ok(())
    }
}

/// Colours with or without alpha.
fn rgba(list: &Bound<'_, PyAny>) -> PyResult<Vec<[f32; 4]>> {
    rows::<4>("colors", list).or_else(|_| {
        let opaque = rows::<3>("colors", list)?;
        Ok(opaque.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect())
    })
}
