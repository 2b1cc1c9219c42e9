//! What graphs of nodes know of an object.

/// Values of an object that graphs of nodes read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectInfo {
    /// Linear RGBA.
    pub color: [f32; 4],
    /// Any number.
    pub index: f32,
    /// A number 0..1 by which objects differ; `None` for one that follows from the name.
    pub random: Option<f32>,
}

impl Default for ObjectInfo {
    fn default() -> ObjectInfo {
        ObjectInfo { color: [1.0; 4], index: 0.0, random: None }
    }
}
