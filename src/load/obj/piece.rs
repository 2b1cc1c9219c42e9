//! What `tobj` gets as one model.

/// Consecutive faces that are alike, which `tobj` returns as one model.
pub(super) struct Piece {
    /// Index of its object's name.
    pub object: usize,
    /// Its corners have texture coordinates.
    pub has_uvs: bool,
    /// Its corners have normals.
    pub has_normals: bool,
    /// The smoothing group that its normals come from; `None` if they are given, or flat.
    pub group: Option<u32>,
    /// How many.
    pub faces: usize,
}

impl Piece {
    /// Are its normals those of its faces?
    pub fn is_flat(&self) -> bool {
        !self.has_normals && self.group.is_none()
    }

    /// Can faces of another one be part of it?
    pub fn is_like(&self, other: &Piece) -> bool {
        let key = |p: &Piece| (p.object, p.has_uvs, p.has_normals, p.group);
        key(self) == key(other)
    }
}
