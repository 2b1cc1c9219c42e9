//! A binary tree of axis-aligned boxes, split at the median along the longest side: overlap queries between objects at compile time.

use crate::math::DVec3;

/// Maximum number of items of a leaf.
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

    /// Do two boxes overlap?
    pub fn meets(&self, other: &Bounds) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// Does it contain another box?
    pub fn holds(&self, other: &Bounds) -> bool {
        self.low.cmple(other.low).all() && other.high.cmple(self.high).all()
    }
}

/// An item of a [`BoxTree`].
pub(super) trait Boxed {
    /// The box around it.
    fn bounds(&self) -> Bounds;

    /// Its sort key along an axis: twice the centre unless overridden.
    fn middle(&self, axis: usize) -> f64 {
        let Bounds { low, high } = self.bounds();
        low[axis] + high[axis]
    }
}

/// A box with the number of its object.
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

/// An inner node with two children, or a leaf with a range of items.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub bounds: Bounds,
    /// Index of the second child; the first child follows this node. 0 for leaves.
    second: u32,
    /// First item, and one past the last.
    range: [u32; 2],
}

impl Node {
    /// The indices of its items.
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
    /// Builds the tree and sorts the items into its order.
    pub fn sort<T: Boxed>(items: &mut [T]) -> BoxTree {
        let mut nodes = Vec::new();
        if !items.is_empty() {
            build(items, 0, &mut nodes);
        }
        BoxTree { nodes }
    }

    /// Calls `is_found` with the indices of items in leaves that overlap a box, until it returns true.
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

    /// Visits nodes depth first, with their indices and whether they are leaves; descends below a node if `goes_down` returns true.
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

/// Appends the subtree of the items that start at index `start`.
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
