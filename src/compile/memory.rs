//! What a compiled scene takes in memory, by part.

use super::geometry::{Attributes, Space};
use super::material::CompiledMaterial;
use super::scene::{CompiledScene, MemoryPart};
use crate::accel::Geometry;

impl CompiledScene {
    /// The bytes of each large part: lists by their lengths, without what few scenes have (tables of grids and profiles).
    pub fn memory(&self) -> Vec<MemoryPart> {
        let spaces = || std::iter::once(&self.geometries.world).chain(&self.geometries.shared);
        let of_spaces = |bytes: fn(&Space) -> usize| spaces().map(|space| bytes(space)).sum::<usize>();
        let placements = &self.geometries.placements;
        let parts = [
            ("BVH", self.accel.stats().bytes as usize),
            ("geometry", of_spaces(|space| of_shapes(&space.shapes))),
            ("attributes", of_spaces(|space| of_attributes(&space.attributes))),
            ("instances", size_of_val(&placements[..])),
            ("materials", self.materials.len() * size_of::<CompiledMaterial>()),
            ("textures", self.textures.bytes()),
            ("lights", self.lights.bytes()),
        ];
        parts.into_iter().map(|(name, bytes)| MemoryPart { name, bytes: bytes as u64 }).collect()
    }
}

fn of_keys<T>(keys: &[Vec<T>]) -> usize {
    keys.iter().map(|key| size_of_val(&key[..])).sum()
}

fn of_shapes(shapes: &Geometry) -> usize {
    let curves = &shapes.curves;
    size_of_val(&shapes.positions[..])
        + size_of_val(&shapes.triangles[..])
        + size_of_val(&shapes.quads[..])
        + size_of_val(&shapes.analytic[..])
        + size_of_val(&curves.points[..])
        + size_of_val(&curves.tangents[..])
        + size_of_val(&curves.segments[..])
        + of_keys(&shapes.keys)
}

fn of_attributes(attributes: &Attributes) -> usize {
    size_of_val(&attributes.normals[..])
        + of_keys(&attributes.normal_keys)
        + of_keys(&attributes.uv)
        + size_of_val(&attributes.tangents[..])
        + size_of_val(&attributes.colors[..])
        + size_of_val(&attributes.materials[..])
        + size_of_val(&attributes.object_from_world[..])
        + size_of_val(&attributes.curves.along[..])
        + size_of_val(&attributes.curves.colors[..])
}
