//! Vertices of a mesh: each combination of position, texture coordinate and normal that its faces use, once.

use std::collections::HashMap;

/// Stands for "none" in every index of this module.
pub(super) const NONE: u32 = u32::MAX;

/// Longest chain that is searched link by link; a file may hang millions of combinations on one position.
const LONGEST_CHAIN: usize = 64;

/// What a corner of a face refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Corner {
    /// Index of its position in the file.
    pub position: u32,
    /// Index of its texture coordinates, or [`NONE`].
    pub uv: u32,
    /// Where its normal comes from.
    pub normal: NormalSource,
}

/// Where the normal of a corner comes from, in four bytes: an index of the file below [`NormalSource::SMOOTH`], a
/// smoothing group from there on, or [`NONE`] for the face's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct NormalSource(u32);

impl NormalSource {
    /// The normal of the face.
    pub const FLAT: NormalSource = NormalSource(NONE);
    const SMOOTH: u32 = 1 << 31;

    /// A normal of the file; flat beyond the 2^31 first.
    pub fn given(index: u32) -> NormalSource {
        if index < Self::SMOOTH { NormalSource(index) } else { Self::FLAT }
    }

    /// The mean over the faces of a smoothing group around the position. Groups are numbered from 0 as they appear.
    pub fn smooth(group: u32) -> NormalSource {
        NormalSource((Self::SMOOTH | group).min(NONE - 1))
    }

    /// The index of a given normal.
    pub fn index(self) -> Option<u32> {
        (self.0 < Self::SMOOTH).then_some(self.0)
    }

    /// The number of a smoothing group.
    pub fn group(self) -> Option<u32> {
        (self.0 >= Self::SMOOTH && self.0 != NONE).then(|| self.0 - Self::SMOOTH)
    }
}

/// The vertices of the mesh that is being read. Vertices of one position form a chain, so that finding one needs no
/// hashing.
#[derive(Default)]
pub(super) struct Vertices {
    /// The corners that the vertices stand for.
    pub corners: Vec<Corner>,
    /// The next vertex of the same position.
    next: Vec<u32>,
    /// For each position of the file, its first vertex in this mesh.
    first: Vec<u32>,
    /// What didn't go into chains.
    overflow: HashMap<Corner, u32>,
}

impl Vertices {
    /// The vertex of a corner, made now if there is none.
    #[inline]
    pub fn index(&mut self, corner: Corner) -> u32 {
        let position = corner.position as usize;
        if self.first.len() <= position {
            self.first.resize(position + 1, NONE);
        }
        let new = self.corners.len() as u32;
        let mut at = self.first[position];
        if at == NONE {
            self.first[position] = new;
            return self.push(corner);
        }
        for length in 1..=LONGEST_CHAIN {
            if self.corners[at as usize] == corner {
                return at;
            }
            let next = self.next[at as usize];
            if next == NONE && length < LONGEST_CHAIN {
                self.next[at as usize] = new;
                return self.push(corner);
            }
            at = next;
        }
        match self.overflow.get(&corner) {
            Some(&vertex) => vertex,
            None => {
                self.overflow.insert(corner, new);
                self.push(corner)
            }
        }
    }

    /// Adds a vertex that nothing else shares.
    pub fn push(&mut self, corner: Corner) -> u32 {
        self.corners.push(corner);
        self.next.push(NONE);
        self.corners.len() as u32 - 1
    }

    /// Takes all vertices out; the next mesh starts without any.
    pub fn take(&mut self) -> Vec<Corner> {
        for corner in &self.corners {
            self.first[corner.position as usize] = NONE;
        }
        self.next = Vec::new();
        self.overflow = HashMap::new();
        std::mem::take(&mut self.corners)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_is_one_vertex_however_many_there_are() {
        let mut vertices = Vertices::default();
        for _ in 0..2 {
            let corner = |i: u32| Corner { position: i % 3, uv: i / 3, normal: NormalSource::given(i / 900) };
            let made: Vec<u32> = (0..1800).map(|i| vertices.index(corner(i))).collect();
            assert!(made.iter().enumerate().all(|(i, &v)| v == i as u32));
            assert!((0..1800).all(|i| vertices.index(corner(i)) == made[i as usize]));
            assert_eq!(vertices.take().len(), 1800);
        }
    }

    #[test]
    fn sources_of_normals_keep_apart() {
        assert_eq!((NormalSource::given(7).index(), NormalSource::given(7).group()), (Some(7), None));
        assert_eq!((NormalSource::smooth(7).index(), NormalSource::smooth(7).group()), (None, Some(7)));
        assert_eq!((NormalSource::FLAT.index(), NormalSource::FLAT.group()), (None, None));
        assert_eq!(NormalSource::given(u32::MAX - 1), NormalSource::FLAT);
    }
}
