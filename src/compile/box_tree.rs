//! A bounding volume hierarchy of axis-aligned boxes with median splits along the longest axis, for overlap queries between
//! objects at compile time.

use crate::math::DVec3;

/// Maximum number of items per leaf.
const MAX_LEAF_ITEMS: usize = 8;

/// An axis-aligned box, world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub low: DVec3,
    pub high: DVec3,
}

impl Bounds {
    pub const EMPTY: Bounds = Bounds { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    pub fn union(self, other: Bounds) -> Bounds {
        Bounds { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Bounds {
        let with = |b: Bounds, p: DVec3| Bounds { low: b.low.min(p), high: b.high.max(p) };
        points.into_iter().fold(Bounds::EMPTY, with)
    }

    /// The box expanded by `by` on all sides.
    pub fn expanded(self, by: f64) -> Bounds {
        Bounds { low: self.low - by, high: self.high + by }
    }

    /// Do two boxes overlap?
    pub fn overlaps(&self, other: &Bounds) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// Does the box contain another one?
    pub fn contains(&self, other: &Bounds) -> bool {
        self.low.cmple(other.low).all() && other.high.cmple(self.high).all()
    }
}

/// An item of a [`BoxTree`].
pub(super) trait Boxed {
    fn bounds(&self) -> Bounds;

    /// Sort key along an axis, by default twice the centre.
    fn sort_key(&self, axis: usize) -> f64 {
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

/// A BVH node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub bounds: Bounds,
    /// Index of the second child; the first child follows this node. 0 for leaves.
    second: u32,
    /// First item of the subtree, and one past the last.
    range: [u32; 2],
}

impl Node {
    /// The indices of the subtree's items.
    pub fn items(&self) -> std::ops::Range<usize> {
        self.range[0] as usize..self.range[1] as usize
    }
}

/// A BVH over a list of items.
#[derive(Debug, Default)]
pub(super) struct BoxTree {
    pub nodes: Vec<Node>,
}

impl BoxTree {
    /// Builds the tree and sorts the items into leaf order.
    pub fn sort<T: Boxed>(items: &mut [T]) -> BoxTree {
        let mut nodes = Vec::new();
        if !items.is_empty() {
            build(items, 0, &mut nodes);
        }
        BoxTree { nodes }
    }

    /// Calls `is_found` with the items of leaves that overlap a box, until it returns true.
    pub fn any(&self, bounds: &Bounds, mut is_found: impl FnMut(usize) -> bool) -> bool {
        let mut found = false;
        self.walk(|_, node, is_leaf| {
            if found || !node.bounds.overlaps(bounds) {
                return false;
            }
            found = is_leaf && node.items().any(&mut is_found);
            true
        });
        found
    }

    /// Visits nodes depth first with their index and whether they are leaves; descends if `descend` returns true.
    pub fn walk(&self, mut descend: impl FnMut(usize, &Node, bool) -> bool) {
        if self.nodes.is_empty() {
            return;
        }
        let mut pending = vec![0u32];
        while let Some(at) = pending.pop() {
            let node = &self.nodes[at as usize];
            let is_leaf = node.second == 0;
            if descend(at as usize, node, is_leaf) && !is_leaf {
                pending.extend([node.second, at + 1]);
            }
        }
    }
}

/// Appends the subtree of items; the first one has the index `start`.
fn build<T: Boxed>(items: &mut [T], start: usize, nodes: &mut Vec<Node>) {
    let bounds = items.iter().fold(Bounds::EMPTY, |bounds, item| bounds.union(item.bounds()));
    let at = nodes.len();
    let range = [start as u32, (start + items.len()) as u32];
    nodes.push(Node { bounds, second: 0, range });
    if items.len() <= MAX_LEAF_ITEMS {
        return;
    }
    let size = bounds.high - bounds.low;
    let axis = (0..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    let half = items.len() / 2;
    items.select_nth_unstable_by(half, |a, b| a.sort_key(axis).total_cmp(&b.sort_key(axis)));
    let (first, second) = items.split_at_mut(half);
    build(first, start, nodes);
    nodes[at].second = nodes.len() as u32;
    build(second, start + half, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box that contains all others doesn't degrade queries.
    #[test]
    fn queries_test_few_boxes_despite_one_that_covers_all() {
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
        let mut tested = 0;
        for item in boxes.iter().filter(|item| item.number < 25_000) {
            let (mut others, inner) = (Vec::new(), item.bounds.expanded(-0.25));
            tree.any(&inner, |place| {
                tested += 1;
                others.extend(boxes[place].bounds.overlaps(&inner).then_some(boxes[place].number));
                false
            });
            others.sort_unstable();
            assert_eq!(others, [item.number, 25_000]);
        }
        assert!(tested < 100 * boxes.len(), "{tested}");
        assert!(!BoxTree::default().any(&Bounds::EMPTY, |_| true));
    }
}
