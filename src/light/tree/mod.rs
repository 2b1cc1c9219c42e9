//! A tree over many lights: one is chosen by an estimate of what it brings to a point, in a few steps.
//!
//! Nodes have eight children whose estimates are computed side by side. No estimate is 0 where light arrives, so the
//! choice is unbiased.

mod build;
mod node;
#[cfg(test)]
mod tests;

use super::bounds::LightBounds;
use crate::simd::prefetch_element;
use build::{Group, Item, split_into_groups};
pub use node::Receiver;
use node::{LEAF, Node, WIDTH, sum};

/// Bits of a place in a node.
const PLACE_BITS: u32 = 3;
/// From this depth on, groups are halved, so that the path to any light fits 64 bits.
const HALVING_DEPTH: u32 = 10;

/// A tree over lights, each known by its number in the list that the tree was built from.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// For each light the places to take from the root, the first in the lowest bits; `u64::MAX` for dark ones.
    trails: Vec<u64>,
}

/// A choice on its way from the root to a light.
#[derive(Clone, Copy, Debug)]
pub struct Descent {
    /// The next node, or the light with [`LEAF`].
    at: u32,
    /// What is left of the random number.
    u: f64,
    /// The probability of the way so far.
    pdf: f32,
}

impl Descent {
    /// Of a point that no light reaches. (No light has so high a number.)
    const NOWHERE: u32 = u32::MAX;
    /// One that has ended without a light.
    pub const ENDED: Descent = Descent { at: Descent::NOWHERE, u: 0.0, pdf: 0.0 };

    /// At the root, with a number in 0..1.
    #[inline(always)]
    pub fn new(u: f64) -> Descent {
        Descent { at: 0, u, pdf: 1.0 }
    }

    /// The light at its end, and the probability of choosing it.
    #[inline(always)]
    pub fn chosen(&self) -> Option<(u32, f32)> {
        (self.at & LEAF != 0 && self.at != Descent::NOWHERE).then_some((self.at & !LEAF, self.pdf))
    }
}

impl LightTree {
    /// Over lights with these bounds; those of weight 0 are never chosen.
    pub fn new(lights: &[LightBounds]) -> LightTree {
        let mut items: Vec<Item> =
            (lights.iter().enumerate()).map(|(i, l)| Item { light: i as u32, bounds: *l }).collect();
        items.retain(|i| i.bounds.weight > 0.0 && i.bounds.weight.is_finite());
        let mut tree = LightTree { nodes: Vec::new(), trails: vec![u64::MAX; lights.len()] };
        if !items.is_empty() {
            tree.add_node(&mut items, 0, 0);
        }
        tree
    }

    /// Chooses a light by a number in 0..1: it and its probability. `None` if no light reaches the point. What is left of the
    /// number after a step decides the next one, so it has more digits than other random numbers.
    #[inline(always)]
    pub fn sample(&self, receiver: &Receiver, u: f64) -> Option<(u32, f32)> {
        let mut descent = Descent::new(u);
        while self.step(receiver, &mut descent) {}
        descent.chosen()
    }

    /// [`LightTree::sample`] for many points side by side: while the next node of one is on its way from memory, the others take
    /// their steps, which depend on each other only along one descent.
    #[inline(always)]
    pub fn descend_together<const N: usize>(&self, receivers: &[Receiver; N], descents: &mut [Descent; N]) {
        let mut active: [usize; N] = std::array::from_fn(|i| i);
        let mut count = N;
        while count > 0 {
            let mut kept = 0;
            for k in 0..count {
                let i = active[k];
                let goes_on = self.step(&receivers[i], &mut descents[i]);
                active[kept] = i;
                kept += usize::from(goes_on);
            }
            count = kept;
        }
    }

    /// One node of a descent; is there another one?
    #[inline(always)]
    fn step(&self, receiver: &Receiver, descent: &mut Descent) -> bool {
        let Some(node) = self.nodes.get(descent.at as usize) else { return false };
        let estimates = node.estimates(receiver);
        let sum = sum(&estimates);
        if sum <= 0.0 || sum.is_nan() {
            descent.at = Descent::NOWHERE;
            return false;
        }
        let target = descent.u * f64::from(sum);
        // Where each begins; the one that is chosen is the last that begins at or before the target.
        let (mut starts, mut total) = ([0.0; WIDTH], 0.0);
        for i in 0..WIDTH {
            starts[i] = total;
            total += f64::from(estimates[i]);
        }
        let mut place = 0;
        for i in 0..WIDTH {
            let is_reached = (estimates[i] > 0.0) & (starts[i] <= target);
            place = if is_reached { i } else { place };
        }
        let before = starts[place];
        let chosen = estimates[place];
        descent.pdf *= chosen / sum;
        descent.u = ((target - before) / f64::from(chosen)).min(1.0f64.next_down());
        descent.at = node.child[place];
        let goes_on = descent.at & LEAF == 0;
        if goes_on {
            prefetch_element(&self.nodes, descent.at as usize);
        }
        goes_on
    }

    /// An estimate of the luminance of the irradiance that all lights bring to a point; 0 only where none reaches it.
    #[inline(always)]
    pub fn irradiance(&self, receiver: &Receiver) -> f32 {
        self.nodes.first().map_or(0.0, |root| sum(&root.estimates(receiver)))
    }

    /// The probability of choosing a light.
    #[inline(always)]
    pub fn pdf_discrete(&self, receiver: &Receiver, light: u32) -> f32 {
        let mut trail = self.trails[light as usize];
        if trail == u64::MAX {
            return 0.0;
        }
        let (mut at, mut pdf) = (0, 1.0);
        loop {
            let node = &self.nodes[at];
            let estimates = node.estimates(receiver);
            let sum = sum(&estimates);
            if sum <= 0.0 || sum.is_nan() {
                return 0.0;
            }
            let place = trail as usize & (WIDTH - 1);
            trail >>= PLACE_BITS;
            pdf *= estimates[place] / sum;
            let child = node.child[place];
            if child & LEAF != 0 {
                return pdf;
            }
            at = child as usize;
        }
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.trails.len() * 8
    }

    /// Adds a node over some lights, and those below it; its index.
    fn add_node(&mut self, items: &mut [Item], depth: u32, trail: u64) -> u32 {
        let index = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        let groups = split_into_groups(items, depth >= HALVING_DEPTH);
        let mut rest = items;
        for (place, Group { count, bounds, .. }) in groups.into_iter().enumerate() {
            let (group, others) = rest.split_at_mut(count);
            rest = others;
            let trail = trail | (place as u64) << (PLACE_BITS * depth);
            let child = match group {
                [item] => {
                    self.trails[item.light as usize] = trail;
                    LEAF | item.light
                }
                _ => self.add_node(group, depth + 1, trail),
            };
            self.nodes[index].set(place, &bounds, child);
        }
        index as u32
    }
}
