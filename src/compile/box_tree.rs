//! A tree of boxes, halved at the median of the longest side: what meets a box is found without asking all.

use crate::math::DVec3;

/// Most items of a leaf.
const LEAF: usize = 8;

/// A box: its least and its greatest corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub low: DVec3,
    pub high: DVec3,
}

impl Bounds {
    /// Around nothing.
    pub const NONE: Bounds = Bounds { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    /// Around two boxes.
    pub fn around(self, other: Bounds) -> Bounds {
        Bounds { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Around points.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Bounds {
        let with = |b: Bounds, p: DVec3| Bounds { low: b.low.min(p), high: b.high.max(p) };
        points.into_iter().fold(Bounds::NONE, with)
    }

    /// Larger by `by` on all sides.
    pub fn widened(self, by: f64) -> Bounds {
        Bounds { low: self.low - by, high: self.high + by }
    }

    /// Have two boxes a point in common?
    pub fn meets(&self, other: &Bounds) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// Does another box lie in this one?
    pub fn holds(&self, other: &Bounds) -> bool {
        self.low.cmple(other.low).all() && other.high.cmple(self.high).all()
    }
}

/// What trees are made over.
pub(super) trait Boxed {
    /// The box around it.
    fn bounds(&self) -> Bounds;

    /// Where it is along an axis, in any measure that grows along it.
    fn middle(&self, axis: usize) -> f64 {
        let Bounds { low, high } = self.bounds();
        low[axis] + high[axis]
    }
}

/// A box with the number of what it is around.
#[derive(Clone, Copy, Debug)]
pub(super) struct NumberedBox {
    pub bounds: Bounds,
    pub number: u32,
}

impl Boxed for NumberedBox {
    fn bounds(&self) -> Bounds {
        self.bounds
    }
}

/// A box with the two halves of its items, or with a few of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub bounds: Bounds,
    /// The number of the second half; the first one follows this node. 0 for leaves.
    second: u32,
    /// Where its items begin and end.
    range: [u32; 2],
}

impl Node {
    /// The places of its items.
    pub fn items(&self) -> std::ops::Range<usize> {
        self.range[0] as usize..self.range[1] as usize
    }
}

/// A tree over a list of items.
#[derive(Debug, Default)]
pub(super) struct BoxTree {
    pub nodes: Vec<Node>,
}

impl BoxTree {
    /// The tree of items, which it sorts.
    pub fn sort<T: Boxed>(items: &mut [T]) -> BoxTree {
        let mut nodes = Vec::new();
        if !items.is_empty() {
            build(items, 0, &mut nodes);
        }
        BoxTree { nodes }
    }

    /// Shows the places of items in leaves that meet a box, until one is found.
    pub fn any(&self, bounds: &Bounds, mut is_found: impl FnMut(usize) -> bool) -> bool {
        let mut is_one_found = false;
        self.walk(|_, node, is_leaf| {
            if is_one_found || !node.bounds.meets(bounds) {
                return false;
            }
            is_one_found = is_leaf && node.items().any(&mut is_found);
            true
        });
        is_one_found
    }

    /// Shows nodes from the root down by their numbers, those below each that `goes_down` agrees to; and whether they are leaves.
    pub fn walk(&self, mut goes_down: impl FnMut(usize, &Node, bool) -> bool) {
        if self.nodes.is_empty() {
            return;
        }
        let mut pending = vec![0u32];
        while let Some(at) = pending.pop() {
            let node = &self.nodes[at as usize];
            let is_leaf = node.second == 0;
            if goes_down(at as usize, node, is_leaf) && !is_leaf {
                pending.extend([node.second, at + 1]);
            }
        }
    }
}

/// Adds the tree of some items, which start at a place.
fn build<T: Boxed>(items: &mut [T], start: usize, nodes: &mut Vec<Node>) {
    let bounds = items.iter().fold(Bounds::NONE, |bounds, item| bounds.around(item.bounds()));
    let at = nodes.len();
    let range = [start as u32, (start + items.len()) as u32];
    nodes.push(Node { bounds, second: 0, range });
    if items.len() <= LEAF {
        return;
    }
    let size = bounds.high - bounds.low;
    let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    let half = items.len() / 2;
    items.select_nth_unstable_by(half, |a, b| a.middle(axis).total_cmp(&b.middle(axis)));
    let (first, second) = items.split_at_mut(half);
    build(first, start, nodes);
    nodes[at].second = nodes.len() as u32;
    build(second, start + half, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box that covers all others hides none of them from each other, and makes none ask all others.
    #[test]
    fn few_boxes_are_looked_into_beside_one_that_covers_all() {
        let cube = |k: u32| {
            let low = DVec3::new(f64::from(k % 50), f64::from(k / 50 % 50), f64::from(k / 2500));
            NumberedBox { bounds: Bounds { low, high: low + 1.0 }, number: k }
        };
        let mut boxes: Vec<NumberedBox> = (0..25_000).map(cube).collect();
        boxes.push(NumberedBox {
            bounds: Bounds { low: DVec3::ZERO, high: DVec3::splat(1e6) },
            number: 25_000,
        });
        let tree = BoxTree::sort(&mut boxes);
        let mut looked = 0;
        for item in boxes.iter().filter(|item| item.number < 25_000) {
            let (mut others, inner) = (Vec::new(), item.bounds.widened(-0.25));
            tree.any(&inner, |place| {
                looked += 1;
                others.extend(boxes[place].bounds.meets(&inner).then_some(boxes[place].number));
                false
            });
            others.sort_unstable();
            assert_eq!(others, [item.number, 25_000]);
        }
        assert!(looked < 100 * boxes.len(), "{looked}");
        assert!(!BoxTree::default().any(&Bounds::NONE, |_| true));
    }
}
