//! Named attributes of vertices, which graphs of nodes read.

/// Up to four numbers for each vertex of a mesh, by a name: further texture coordinates, colours, weights, vectors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VertexAttribute {
    /// By which nodes find it.
    pub name: String,
    /// Numbers a vertex, 1 to 4.
    pub width: u32,
    /// The numbers of all vertices, one vertex after the other.
    pub values: Vec<f32>,
}

impl VertexAttribute {
    /// Maximum number of values that a vertex may have.
    pub const MAX_WIDTH: u32 = 4;

    /// One without vertices.
    pub fn new(name: impl Into<String>, width: u32) -> VertexAttribute {
        VertexAttribute { name: name.into(), width, values: Vec::new() }
    }

    /// The numbers of a vertex.
    pub fn of(&self, vertex: usize) -> &[f32] {
        let width = self.width as usize;
        &self.values[vertex * width..(vertex + 1) * width]
    }

    /// Adds a vertex with the numbers of another.
    pub fn push_copy(&mut self, vertex: usize) {
        let width = self.width as usize;
        self.values.extend_from_within(vertex * width..(vertex + 1) * width);
    }

    /// Adds a vertex half way between two others.
    pub fn push_mean(&mut self, a: usize, b: usize) {
        let width = self.width as usize;
        for k in 0..width {
            self.values.push(0.5 * self.values[a * width + k] + 0.5 * self.values[b * width + k]);
        }
    }
}
