//! A tree over many lights: one is chosen by an estimate of what it brings to a point, in a few steps.
//!
//! Nodes have eight children whose estimates are computed side by side. No estimate is 0 where light arrives, so the
//! choice is unbiased.

use super::bounds::LightBounds;
use crate::math::{Bounds3, Vec3, poly};

/// Children of a node.
const WIDTH: usize = 8;
/// Bits of a place in a node.
const PLACE_BITS: u32 = 3;
/// Marks a child that is a light; the rest is its number.
const LEAF: u32 = 1 << 31;
/// From this depth on, groups are halved, so that the path to any light fits 64 bits.
const HALVING_DEPTH: u32 = 10;
/// Places where a group may be cut along an axis.
const BINS: usize = 12;
/// Larger groups are halved: looking for the best cut would take long and gain little.
const MOST_WEIGHED: usize = 16_384;

/// A tree over lights, each known by its number in the list that the tree was built from.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// For each light the places to take from the root, the first in the lowest bits; `u64::MAX` for dark ones.
    trails: Vec<u64>,
}

/// What a point asks for: its position, and its normal if light from behind does nothing (else zero).
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// The point.
    pub p: Vec3,
    /// Unit normal on the side that light must come from, or zero.
    pub normal: Vec3,
}

/// Eight children, one number of each side by side; unused places have weight 0.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Node {
    center: [[f32; WIDTH]; 3],
    radius_squared: [f32; WIDTH],
    weight: [f32; WIDTH],
    axis: [[f32; WIDTH]; 3],
    cos_normals: [f32; WIDTH],
    sin_normals: [f32; WIDTH],
    cos_emission: [f32; WIDTH],
    child: [u32; WIDTH],
}

const _: () = assert!(size_of::<Node>() == 384);

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
        let (mut at, mut u, mut pdf) = (0, u, 1.0);
        loop {
            let node = self.nodes.get(at)?;
            let estimates = node.estimates(receiver);
            let sum = sum(&estimates);
            if sum <= 0.0 || sum.is_nan() {
                return None;
            }
            let target = u * f64::from(sum);
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
            pdf *= chosen / sum;
            u = ((target - before) / f64::from(chosen)).min(1.0f64.next_down());
            let child = node.child[place];
            if child & LEAF != 0 {
                return Some((child & !LEAF, pdf));
            }
            at = child as usize;
        }
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

/// In pairs: the same on every CPU, and shorter than one after the other.
#[inline(always)]
fn sum(e: &[f32; WIDTH]) -> f32 {
    ((e[0] + e[1]) + (e[2] + e[3])) + ((e[4] + e[5]) + (e[6] + e[7]))
}

impl Node {
    const EMPTY: Node = Node {
        center: [[0.0; WIDTH]; 3],
        radius_squared: [0.0; WIDTH],
        weight: [0.0; WIDTH],
        axis: [[0.0; WIDTH]; 3],
        cos_normals: [0.0; WIDTH],
        sin_normals: [0.0; WIDTH],
        cos_emission: [0.0; WIDTH],
        child: [LEAF; WIDTH],
    };

    fn set(&mut self, i: usize, b: &LightBounds, child: u32) {
        let center = b.bounds.center();
        let (sin, cos) = poly::sin_cos(b.normals_rad);
        for c in 0..3 {
            self.center[c][i] = center[c];
            self.axis[c][i] = b.axis[c];
        }
        self.radius_squared[i] = 0.25 * b.bounds.extent().length_squared();
        self.weight[i] = b.weight;
        (self.cos_normals[i], self.sin_normals[i]) = (cos, sin);
        // A little wider, for rounding: what is cut off must be dark.
        self.cos_emission[i] = poly::sin_cos(b.emission_rad).1 - 1e-5;
        self.child[i] = child;
    }

    /// Upper estimates of what each child brings: weight times the largest cosine at the light and at the receiver over
    /// the squared distance (their section 5.1, with the sphere around the box).
    #[inline(always)]
    fn estimates(&self, receiver: &Receiver) -> [f32; WIDTH] {
        let (p, n) = (receiver.p, receiver.normal);
        let any_side = if n == Vec3::ZERO { 1.0 } else { 0.0 };
        let mut estimates = [0.0; WIDTH];
        for (i, estimate) in estimates.iter_mut().enumerate() {
            let (x, y, z) = (p.x - self.center[0][i], p.y - self.center[1][i], p.z - self.center[2][i]);
            let distance_squared = x * x + y * y + z * z;
            let r2 = self.radius_squared[i];
            let is_inside = distance_squared <= r2;
            let safe = if distance_squared > 1e-30 { distance_squared } else { 1e-30 };
            let inverse = 1.0 / safe.sqrt();
            // The angle that the lights take up.
            let sin2_size = if is_inside { 0.0 } else { r2 / safe };
            let (sin_size, cos_size) = (sin2_size.sqrt(), (1.0 - sin2_size).sqrt());
            let cos_size = if is_inside { -1.0 } else { cos_size };
            // From the axis, less the normals' angle, less the lights' size.
            let cos_axis = (x * self.axis[0][i] + y * self.axis[1][i] + z * self.axis[2][i]) * inverse;
            let (cos, sin) = less(cos_axis, sine(cos_axis), self.cos_normals[i], self.sin_normals[i]);
            let (cos_light, _) = less(cos, sin, cos_size, sin_size);
            let cos_receiver = -(x * n.x + y * n.y + z * n.z) * inverse;
            let (cos_surface, _) = less(cos_receiver, sine(cos_receiver), cos_size, sin_size);
            let cos_surface = if any_side > cos_surface { any_side } else { cos_surface };
            let is_lit = (cos_light > self.cos_emission[i]) & (cos_surface > -1e-5);
            // Where the cosines are all but 0 so is the light: a floor keeps the probability from vanishing first.
            let cosines = floor(cos_light) * floor(cos_surface);
            let near = if safe > r2 { safe } else { r2 };
            *estimate = if is_lit { self.weight[i] * cosines / near } else { 0.0 };
        }
        estimates
    }
}

#[inline(always)]
fn floor(cosine: f32) -> f32 {
    if cosine > 1e-4 { cosine } else { 1e-4 }
}

#[inline(always)]
fn sine(cosine: f32) -> f32 {
    let squared = 1.0 - cosine * cosine;
    (if squared > 0.0 { squared } else { 0.0 }).sqrt()
}

/// Cosine and sine of an angle less another one, at least 0.
#[inline(always)]
fn less(cos: f32, sin: f32, cos_other: f32, sin_other: f32) -> (f32, f32) {
    let is_less = cos >= cos_other;
    let (c, s) = (cos * cos_other + sin * sin_other, sin * cos_other - cos * sin_other);
    (if is_less { 1.0 } else { c }, if is_less { 0.0 } else { s })
}

/// A light on its way into the tree.
#[derive(Clone, Copy, Debug)]
struct Item {
    light: u32,
    bounds: LightBounds,
}

/// Lights that will share a place of a node.
struct Group {
    /// How many.
    count: usize,
    bounds: LightBounds,
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
fn split_into_groups(items: &mut [Item], halve: bool) -> Vec<Group> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::chi2::Random;
    use crate::sampling::warp;
    use std::f32::consts::{FRAC_PI_2, PI};

    fn lamps(count: usize, random: &mut Random) -> Vec<LightBounds> {
        let mut light = |_| {
            let corner = Vec3::new(random.next(), random.next(), random.next()) * 10.0;
            let edges = Vec3::new(random.next(), random.next(), random.next()) * 0.2;
            let axis = warp::uniform_sphere([random.next(), random.next()]);
            LightBounds {
                bounds: Bounds3::of([corner, corner + edges]),
                weight: random.next().powi(4) + 1e-3,
                axis,
                normals_rad: if random.next() < 0.2 { PI } else { 0.0 },
                emission_rad: FRAC_PI_2,
            }
        };
        (0..count).map(&mut light).collect()
    }

    fn receivers(random: &mut Random) -> Vec<Receiver> {
        let receiver = |i: usize| {
            let p = Vec3::new(random.next(), random.next(), random.next()) * 14.0 - 2.0;
            let normal = warp::uniform_sphere([random.next(), random.next()]);
            Receiver { p, normal: if i.is_multiple_of(4) { Vec3::ZERO } else { normal } }
        };
        (0..40).map(receiver).collect()
    }

    #[test]
    fn chances_add_up_to_one_and_are_those_of_sampling() {
        let mut random = Random::new(4);
        for count in [1, 2, 7, 8, 9, 100, 3000] {
            let lights = lamps(count, &mut random);
            let tree = LightTree::new(&lights);
            for receiver in receivers(&mut random) {
                let probabilities: f64 =
                    (0..count).map(|i| f64::from(tree.pdf_discrete(&receiver, i as u32))).sum();
                // Less than 1 where bounds promised light that none of the lights in them gives.
                assert!(
                    probabilities < 1.0 + 1e-4 && (probabilities > 0.5 || count < 100),
                    "{count}: {probabilities}"
                );
                for k in 0..100 {
                    let u = (f64::from(k) + f64::from(random.next())) / 100.0;
                    let Some((light, pdf)) = tree.sample(&receiver, u) else {
                        assert!(probabilities < 1.0 - 1e-4);
                        continue;
                    };
                    let again = tree.pdf_discrete(&receiver, light);
                    assert!(pdf > 0.0 && (pdf - again).abs() <= 1e-5 * pdf, "{count}: {pdf} {again}");
                }
            }
        }
    }

    #[test]
    fn lights_that_reach_a_point_can_be_chosen() {
        let mut random = Random::new(8);
        let lights = lamps(500, &mut random);
        let tree = LightTree::new(&lights);
        for receiver in receivers(&mut random) {
            for (i, light) in lights.iter().enumerate() {
                let point = light.bounds.min
                    + light.bounds.extent() * Vec3::new(random.next(), random.next(), random.next());
                let to_light = (point - receiver.p).normalize();
                let faces = light.normals_rad > 0.0 || to_light.dot(light.axis) < 0.0;
                let lit = receiver.normal == Vec3::ZERO || to_light.dot(receiver.normal) > 0.0;
                if faces && lit {
                    assert!(tree.pdf_discrete(&receiver, i as u32) > 0.0, "{receiver:?} {light:?}");
                }
            }
        }
    }

    #[test]
    fn lights_in_one_place_and_dark_ones() {
        let one = LightBounds {
            bounds: Bounds3::of([Vec3::ONE]),
            weight: 1.0,
            axis: Vec3::Y,
            normals_rad: PI,
            emission_rad: FRAC_PI_2,
        };
        let mut lights = vec![one; 10_000];
        lights[17].weight = 0.0;
        let tree = LightTree::new(&lights);
        let receiver = Receiver { p: Vec3::ONE, normal: Vec3::ZERO };
        assert_eq!(tree.pdf_discrete(&receiver, 17), 0.0);
        let sum: f64 = (0..10_000).map(|i| f64::from(tree.pdf_discrete(&receiver, i))).sum();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
        assert!(tree.bytes() < 128 * lights.len(), "{}", tree.bytes());
        assert!(LightTree::new(&[]).sample(&receiver, 0.5).is_none());
    }
}
