//! How lights are grouped into nodes.

use super::node::WIDTH;
use crate::light::bounds::LightBounds;
use crate::math::Bounds3;

/// Places where a group may be cut along an axis.
const BINS: usize = 12;
/// Larger groups are halved: looking for the best cut would take long and gain little.
const MOST_WEIGHED: usize = 16_384;

/// A light on its way into the tree.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub light: u32,
    pub bounds: LightBounds,
}

/// Lights that will share a place of a node.
pub(super) struct Group {
    /// How many.
    pub count: usize,
    pub bounds: LightBounds,
    /// Of looking here.
    cost: f32,
}

impl Group {
    fn of(items: &[Item]) -> Group {
        let bounds = items[1..].iter().fold(items[0].bounds, |sum, i| sum.union(&i.bounds));
        let extent = bounds.bounds.extent();
        let cost = bounds.cost(extent.max_element(), extent.max_position()).max(f32::MIN_POSITIVE);
        Group { count: items.len(), bounds, cost }
    }
}

/// Reorders lights into at most eight groups. The dearest group is cut first. Groups that fit a node stay whole, so that
/// nodes are full.
pub(super) fn split_into_groups(items: &mut [Item], halve: bool) -> Vec<Group> {
    let fits = if items.len() > WIDTH { WIDTH } else { 1 };
    let mut groups = vec![Group::of(items)];
    while groups.len() < WIDTH {
        let dearest = (0..groups.len()).filter(|&i| groups[i].count > fits).max_by(|&i, &k| {
            let (a, b) = (&groups[i], &groups[k]);
            a.cost.total_cmp(&b.cost).then(a.count.cmp(&b.count)).then(k.cmp(&i))
        });
        let Some(at) = dearest else { break };
        let start: usize = groups[..at].iter().map(|g| g.count).sum();
        let group = &mut items[start..start + groups[at].count];
        let left = cut(group, halve);
        let (a, b) = group.split_at(left);
        groups[at] = Group::of(a);
        groups.insert(at + 1, Group::of(b));
    }
    groups
}

/// Cuts lights in two by the smallest cost, or in halves: how many come first. Both parts have some.
fn cut(items: &mut [Item], halve: bool) -> usize {
    let middle = |i: &Item| i.bounds.bounds.center();
    let centers = Bounds3::of(items.iter().map(middle));
    let best = if halve || items.len() > MOST_WEIGHED { None } else { best_cut(items, &centers) };
    if let Some((axis, position)) = best {
        let mut left = 0;
        for i in 0..items.len() {
            if middle(&items[i])[axis] < position {
                items.swap(i, left);
                left += 1;
            }
        }
        if left > 0 && left < items.len() {
            return left;
        }
    }
    let axis = centers.extent().max_position();
    let half = items.len() / 2;
    items.select_nth_unstable_by(half, |a, b| {
        middle(a)[axis].total_cmp(&middle(b)[axis]).then(a.light.cmp(&b.light))
    });
    half
}

fn best_cut(items: &[Item], centers: &Bounds3) -> Option<(usize, f32)> {
    let extent = centers.extent();
    let longest = extent.max_element();
    let mut best: Option<(f32, usize, f32)> = None;
    for axis in (0..3).filter(|&a| extent[a] > 0.0) {
        let mut bins: [Option<LightBounds>; BINS] = [None; BINS];
        let scale = BINS as f32 / extent[axis];
        for item in items {
            let bin = (item.bounds.bounds.center()[axis] - centers.min[axis]) * scale;
            let bin = &mut bins[(bin as usize).min(BINS - 1)];
            *bin = Some(bin.map_or(item.bounds, |b| b.union(&item.bounds)));
        }
        // What lies before each cut and what behind it.
        let (mut before, mut behind) = (bins, bins);
        for k in 1..BINS {
            before[k] = union(before[k - 1], before[k]);
            behind[BINS - 1 - k] = union(behind[BINS - 1 - k], behind[BINS - k]);
        }
        for k in 1..BINS {
            let (Some(a), Some(b)) = (before[k - 1], behind[k]) else { continue };
            let cost = a.cost(longest, axis) + b.cost(longest, axis);
            if best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, centers.min[axis] + k as f32 / scale));
            }
        }
    }
    best.map(|(_, axis, position)| (axis, position))
}

fn union(a: Option<LightBounds>, b: Option<LightBounds>) -> Option<LightBounds> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        (a, b) => a.or(b),
    }
}
