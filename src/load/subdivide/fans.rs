//! Which faces meet at edges and around points.

use rayon::prelude::*;

/// No corner, edge.
pub(super) const NONE: u32 = u32::MAX;

/// The connectivity of one layer. The edge of a corner goes from it to the next corner of its face.
pub(super) struct Fans {
    /// The edge of each corner.
    pub edges: Vec<u32>,
    /// The corner on the other side of each corner's edge; `NONE` at sharp edges: those of one face, of more than two, and of two
    /// that run against each other.
    pub twins: Vec<u32>,
    /// The next corner of its face, and the one before.
    pub next: Vec<u32>,
    pub before: Vec<u32>,
    /// Some corner of each value; `NONE` without.
    pub first: Vec<u32>,
    /// Corners at each value.
    pub faces: Vec<u32>,
    /// Edges that are sharp at each value, and the sum of their other ends' numbers, of which up to two are kept.
    pub sharp: Vec<Sharp>,
    pub edge_count: usize,
}

/// The sharp edges at a value.
#[derive(Clone, Copy, Default)]
pub(super) struct Sharp {
    pub count: u32,
    pub ends: [u32; 2],
}

impl Fans {
    /// Of faces with numbers of corners, whose corners refer to `count` values.
    pub fn new(arities: &[u32], corners: &[u32], count: usize) -> Fans {
        let (next, before) = rings(arities);
        let mut uses: Vec<(u32, u32, u32)> = (0..corners.len() as u32)
            .into_par_iter()
            .map(|c| {
                let (a, b) = (corners[c as usize], corners[next[c as usize] as usize]);
                (a.min(b), a.max(b), c)
            })
            .collect();
        uses.par_sort_unstable();
        let mut fans = Fans {
            edges: vec![0; corners.len()],
            twins: vec![NONE; corners.len()],
            first: vec![NONE; count],
            faces: vec![0; count],
            sharp: vec![Sharp::default(); count],
            edge_count: 0,
            next,
            before,
        };
        for edge in uses.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
            for use_ in edge {
                fans.edges[use_.2 as usize] = fans.edge_count as u32;
            }
            fans.edge_count += 1;
            match edge {
                [(a, b, x), (_, _, y)] if corners[*x as usize] != corners[*y as usize] && a != b => {
                    (fans.twins[*x as usize], fans.twins[*y as usize]) = (*y, *x);
                }
                _ => {
                    let (a, b) = (edge[0].0, edge[0].1);
                    fans.sharp[a as usize].add(b);
                    fans.sharp[b as usize].add(a);
                }
            }
        }
        for (c, &value) in corners.iter().enumerate() {
            fans.first[value as usize] = c as u32;
            fans.faces[value as usize] += 1;
        }
        fans
    }

    /// The corner at the same value in the face on the left; `NONE` behind a sharp edge.
    pub fn left(&self, corner: u32) -> u32 {
        self.twins[self.before[corner as usize] as usize]
    }

    /// The corner at the same value in the face on the right; `NONE` behind a sharp edge.
    pub fn right(&self, corner: u32) -> u32 {
        match self.twins[corner as usize] {
            NONE => NONE,
            twin => self.next[twin as usize],
        }
    }

    /// The corners around a value from one on, to the left, until a sharp edge or once around.
    pub fn around(&self, start: u32) -> impl Iterator<Item = u32> + '_ {
        std::iter::successors(Some(start), move |&c| Some(self.left(c)).filter(|&c| c != NONE && c != start))
    }

    /// Is a value the middle of one closed ring of faces?
    pub fn is_inner(&self, value: usize) -> bool {
        self.sharp[value].count == 0
            && self.first[value] != NONE
            && self.around(self.first[value]).count() == self.faces[value] as usize
    }
}

impl Sharp {
    fn add(&mut self, end: u32) {
        if let Some(place) = self.ends.get_mut(self.count as usize) {
            *place = end;
        }
        self.count += 1;
    }
}

/// The next corner and the one before in each face.
fn rings(arities: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let (mut next, mut before, mut first) = (Vec::new(), Vec::new(), 0);
    for &arity in arities {
        next.extend((1..arity).map(|k| first + k).chain([first]));
        before.extend([first + arity - 1].into_iter().chain((0..arity - 1).map(|k| first + k)));
        first += arity;
    }
    (next, before)
}
