//! The coarse polygons that are subdivided, and each of their attributes with a connectivity of its own.

use crate::scene::{MaterialId, Mesh};
use std::collections::HashMap;
use std::hash::Hash;

/// Values that corners of faces refer to: points, or texture coordinates, which may differ between the faces at a point.
#[derive(Clone, Debug, Default)]
pub(super) struct Layer<const N: usize> {
    pub values: Vec<[f64; N]>,
    /// The value of each corner.
    pub corners: Vec<u32>,
}

impl<const N: usize> Layer<N> {
    /// A layer of the values that `at` gives for vertices with keys; equal keys are one value.
    fn new<K: Hash + Eq>(corners: &[u32], at: impl Fn(u32) -> (K, [f32; N])) -> Layer<N> {
        let (mut known, mut layer) = (HashMap::new(), Layer::default());
        for &vertex in corners {
            let (key, value) = at(vertex);
            let next = layer.values.len() as u32;
            let number = *known.entry(key).or_insert(next);
            if number == next {
                layer.values.push(value.map(f64::from));
            }
            layer.corners.push(number);
        }
        layer
    }
}

/// Polygons of any size, as a file has them.
#[derive(Clone, Debug, Default)]
pub(in crate::load) struct Cage {
    /// Name, positions, texture coordinates and colours of vertices; nothing else.
    pub mesh: Mesh,
    /// The point that each vertex is at: faces hang together where they share points.
    pub points: Vec<u32>,
    /// The vertices of all corners.
    pub corners: Vec<u32>,
    /// Corners of each face.
    pub arities: Vec<u32>,
    /// The material of each face.
    pub materials: Vec<MaterialId>,
}

impl Cage {
    /// The triangles of a mesh as faces; they hang together where corners have the same position.
    pub fn of_triangles(mesh: &Mesh) -> Cage {
        let mut known: HashMap<[u32; 3], u32> = HashMap::new();
        let point = |p: &[f32; 3]| {
            let next = known.len() as u32;
            // Zero has two signs.
            *known.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(next)
        };
        let parts = mesh.parts.iter();
        Cage {
            points: mesh.positions.iter().map(point).collect(),
            corners: mesh.triangles.as_flattened().to_vec(),
            arities: vec![3; mesh.triangles.len()],
            materials: parts
                .flat_map(|part| std::iter::repeat_n(part.material, part.triangle_count as usize))
                .collect(),
            mesh: Mesh {
                name: mesh.name.clone(),
                positions: mesh.positions.clone(),
                uv_sets: mesh.uv_sets.clone(),
                colors: mesh.colors.clone(),
                ..Mesh::default()
            },
        }
    }

    /// Takes its name, and whether there are colours, from the mesh of its triangles.
    pub fn finish(&mut self, mesh: &Mesh) {
        self.mesh.name.clone_from(&mesh.name);
        if mesh.colors.is_empty() {
            self.mesh.colors = Vec::new();
        }
    }

    /// How many triangles `levels` steps make of it.
    pub fn triangles_after(&self, levels: u32) -> u64 {
        2 * (self.corners.len() as u64).saturating_mul(4u64.saturating_pow(levels.saturating_sub(1)))
    }

    /// Without faces whose corners are not finite, and with those of a material together, in the order in which materials first appear.
    pub fn sorted(&self) -> Cage {
        let mut order: HashMap<MaterialId, usize> = HashMap::new();
        for material in &self.materials {
            let next = order.len();
            order.entry(*material).or_insert(next);
        }
        let mut first = 0;
        let mut faces: Vec<(usize, usize, usize)> = Vec::with_capacity(self.arities.len());
        for (face, &arity) in self.arities.iter().enumerate() {
            let corners = first..first + arity as usize;
            first = corners.end;
            let is_finite = |&v: &u32| self.mesh.positions[v as usize].iter().all(|x| x.is_finite());
            if self.corners[corners.clone()].iter().all(is_finite) {
                faces.push((order[&self.materials[face]], face, corners.start));
            }
        }
        faces.sort_unstable();
        let mut sorted = Cage { mesh: self.mesh.clone(), points: self.points.clone(), ..Cage::default() };
        for (_, face, first) in faces {
            let arity = self.arities[face];
            sorted.corners.extend_from_slice(&self.corners[first..first + arity as usize]);
            sorted.arities.push(arity);
            sorted.materials.push(self.materials[face]);
        }
        sorted
    }

    /// The points of its corners.
    pub(super) fn point_layer(&self) -> Layer<3> {
        Layer::new(&self.corners, |v| (self.points[v as usize], self.mesh.positions[v as usize]))
    }

    /// Texture coordinates of its corners, which hang together where both point and coordinates are the same.
    pub(super) fn uv_layers(&self) -> Vec<Layer<2>> {
        let sets = self.mesh.uv_sets.iter().filter(|set| !set.is_empty());
        sets.map(|set| self.varying(set)).collect()
    }

    /// Colours, likewise.
    pub(super) fn color_layer(&self) -> Option<Layer<4>> {
        (!self.mesh.colors.is_empty()).then(|| self.varying(&self.mesh.colors))
    }

    fn varying<const N: usize>(&self, values: &[[f32; N]]) -> Layer<N> {
        Layer::new(&self.corners, |v| {
            let value = values[v as usize].map(|x| if x.is_finite() { x } else { 0.0 });
            ((self.points[v as usize], value.map(f32::to_bits)), value)
        })
    }
}
