//! Light tree: an 8-wide BVH over lights (Conty Estevez, Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting").
//! A light is selected by stochastic descent, in proportion to an estimate of each child's irradiance. The estimate is above 0 wherever
//! light arrives, so the selection is unbiased.

use super::traits::LightBounds;
use crate::math::{Bounds3, Vec3, poly};
use crate::simd::prefetch_element;
use std::f32::consts::PI;

/// Bits of a child's position in its node.
const POSITION_BITS: u32 = 3;
/// Depth from which on groups are halved, so that the path to any light fits 64 bits.
const HALVING_DEPTH: u32 = 10;

/// A light tree; lights are identified by their index in the list from which the tree was built.
#[derive(Clone, Debug, Default)]
pub struct LightTree {
    nodes: Vec<Node>,
    /// Per child of the root: a light.
    first_lights: [u32; WIDTH],
    /// Per light: child positions on the path from the root, the first in the lowest bits; `u64::MAX` for dark lights.
    trails: Vec<u64>,
}

/// The state of a descent from the root to a light.
#[derive(Clone, Copy, Debug)]
pub struct Descent {
    /// Index of the next node, or of the light with [`LEAF`].
    at: u32,
    /// The remaining random number, 0..1.
    u: f64,
    /// Probability of the path so far.
    pdf: f32,
    level: Level,
}

/// The place of a node in the tree.
#[derive(Clone, Copy, Debug)]
struct Level {
    /// Depth, 0 for the root.
    depth: u32,
    /// Position of the child of the root that contains the node.
    child: u32,
}

impl Level {
    const ROOT: Level = Level { depth: 0, child: 0 };

    /// The level of the child at a position in a node of this level.
    #[inline(always)]
    fn below(self, position: usize) -> Level {
        Level { depth: self.depth + 1, child: if self.depth == 0 { position as u32 } else { self.child } }
    }
}

impl Descent {
    /// No light reaches the point. Not a valid index of a light.
    const NO_LIGHT: u32 = u32::MAX;
    /// A descent that ended without a light.
    pub const ENDED: Descent = Descent { at: Descent::NO_LIGHT, u: 0.0, pdf: 0.0, level: Level::ROOT };

    /// A descent at the root, with a random number in 0..1.
    #[inline(always)]
    pub fn new(u: f64) -> Descent {
        Descent { at: 0, u, pdf: 1.0, level: Level::ROOT }
    }

    /// The selected light and its probability. If the descent ended at a node none of whose lights reach the point: a light below the
    /// same child of the root, with probability 0.
    #[inline(always)]
    pub fn chosen(&self, tree: &LightTree) -> (u32, f32) {
        match self.at {
            at if at & LEAF != 0 && at != Descent::NO_LIGHT => (at & !LEAF, self.pdf),
            _ => (tree.first_lights[self.level.child as usize], 0.0),
        }
    }
}

impl LightTree {
    /// Builds a tree over lights with these bounds; lights of weight 0 are never selected.
    pub fn new(lights: &[LightBounds]) -> LightTree {
        let mut items: Vec<Item> =
            (lights.iter().enumerate()).map(|(i, l)| Item { light: i as u32, bounds: *l }).collect();
        items.retain(|i| i.bounds.weight > 0.0 && i.bounds.weight.is_finite());
        let trails = vec![u64::MAX; lights.len()];
        let mut tree = LightTree { nodes: Vec::new(), first_lights: [0; WIDTH], trails };
        if !items.is_empty() {
            tree.add_node(&mut items, 0, 0);
        }
        for light in (0..lights.len() as u32).rev() {
            if let Some(group) = tree.group(light) {
                tree.first_lights[group / WIDTH] = light;
            }
        }
        tree
    }

    /// Selects a light by a random number in 0..1; returns light and probability, 0 if no light reaches the point. The random number is
    /// rescaled and reused at each step, hence double precision.
    #[inline(always)]
    pub fn sample(&self, receiver: &Receiver<'_>, u: f64) -> (u32, f32) {
        let mut descent = Descent::new(u);
        while self.step(receiver, &mut descent) {}
        descent.chosen(self)
    }

    /// [`LightTree::sample`] for many points, interleaved to hide the latency of loading nodes.
    #[inline(always)]
    pub fn descend_many<const N: usize>(&self, receivers: &[Receiver<'_>; N], descents: &mut [Descent; N]) {
        let mut active: [usize; N] = std::array::from_fn(|i| i);
        let mut count = N;
        while count > 0 {
            let mut kept = 0;
            for k in 0..count {
                let i = active[k];
                let continues = self.step(&receivers[i], &mut descents[i]);
                active[kept] = i;
                kept += usize::from(continues);
            }
            count = kept;
        }
    }

    /// One step of a descent; returns whether it continues.
    #[inline(always)]
    fn step(&self, receiver: &Receiver<'_>, descent: &mut Descent) -> bool {
        let Some(node) = self.nodes.get(descent.at as usize) else { return false };
        let estimates = weighted(node.estimates(receiver), descent.level, receiver);
        let sum = sum(&estimates);
        if sum <= 0.0 || sum.is_nan() {
            descent.at = Descent::NO_LIGHT;
            return false;
        }
        let target = descent.u * f64::from(sum);
        // Prefix sums; the selected child is the last that starts at or before the target.
        let (mut starts, mut total) = ([0.0; WIDTH], 0.0);
        for i in 0..WIDTH {
            starts[i] = total;
            total += f64::from(estimates[i]);
        }
        let mut position = 0;
        for i in 0..WIDTH {
            let is_reached = (estimates[i] > 0.0) & (starts[i] <= target);
            position = if is_reached { i } else { position };
        }
        let before = starts[position];
        let chosen = estimates[position];
        descent.pdf *= chosen / sum;
        descent.u = ((target - before) / f64::from(chosen)).min(1.0f64.next_down());
        descent.at = node.child[position];
        descent.level = descent.level.below(position);
        let continues = descent.at & LEAF == 0;
        if continues {
            prefetch_element(&self.nodes, descent.at as usize);
        }
        continues
    }

    /// Estimated luminance of the irradiance of all lights at a point; 0 only where no light arrives.
    #[inline(always)]
    pub fn irradiance(&self, receiver: &Receiver<'_>) -> f32 {
        self.nodes.first().map_or(0.0, |root| sum(&weighted(root.estimates(receiver), Level::ROOT, receiver)))
    }

    /// The probability of selecting a light.
    #[inline(always)]
    pub fn pdf_discrete(&self, receiver: &Receiver<'_>, light: u32) -> f32 {
        let mut trail = self.trails[light as usize];
        if trail == u64::MAX {
            return 0.0;
        }
        let (mut at, mut pdf, mut level) = (0, 1.0, Level::ROOT);
        loop {
            let node = &self.nodes[at];
            let estimates = weighted(node.estimates(receiver), level, receiver);
            let sum = sum(&estimates);
            if sum <= 0.0 || sum.is_nan() {
                return 0.0;
            }
            let position = trail as usize & (WIDTH - 1);
            trail >>= POSITION_BITS;
            pdf *= estimates[position] / sum;
            let child = node.child[position];
            if child & LEAF != 0 {
                return pdf;
            }
            at = child as usize;
            level = level.below(position);
        }
    }

    /// The group of a light by its positions in the root and below; `None` for lights outside the tree.
    pub fn group(&self, light: u32) -> Option<usize> {
        let trail = *self.trails.get(light as usize)?;
        let position = |level: u32| (trail >> (POSITION_BITS * level)) as usize & (WIDTH - 1);
        (trail != u64::MAX).then(|| position(0) * WIDTH + position(1))
    }

    /// Memory, bytes.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.trails.len() * 8
    }

    /// Adds a node over some lights, and its children; returns the node's index.
    fn add_node(&mut self, items: &mut [Item], depth: u32, trail: u64) -> u32 {
        let index = self.nodes.len();
        self.nodes.push(Node::EMPTY);
        let groups = split_into_groups(items, depth >= HALVING_DEPTH);
        let mut rest = items;
        for (position, Group { count, bounds, .. }) in groups.into_iter().enumerate() {
            let (group, others) = rest.split_at_mut(count);
            rest = others;
            let trail = trail | (position as u64) << (POSITION_BITS * depth);
            let child = match group {
                [item] => {
                    self.trails[item.light as usize] = trail;
                    LEAF | item.light
                }
                _ => self.add_node(group, depth + 1, trail),
            };
            self.nodes[index].set(position, &bounds, child);
        }
        index as u32
    }
}

/// Bins along an axis for binned splits.
const BINS: usize = 12;
/// Maximum group size for binned splits; larger groups are split at the median, which is faster and hardly worse.
const MAX_BINNED: usize = 16_384;

/// A light of a tree under construction.
#[derive(Clone, Copy, Debug)]
struct Item {
    pub light: u32,
    pub bounds: LightBounds,
}

/// Lights below one child of a node.
struct Group {
    pub count: usize,
    pub bounds: LightBounds,
    /// Cost of visiting the node.
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

/// Reorders lights into at most eight groups, splitting the group of largest cost first. Groups that fit one node are not split, so that
/// nodes are full.
fn split_into_groups(items: &mut [Item], halve: bool) -> Vec<Group> {
    let fits = if items.len() > WIDTH { WIDTH } else { 1 };
    let mut groups = vec![Group::of(items)];
    while groups.len() < WIDTH {
        let costliest = (0..groups.len()).filter(|&i| groups[i].count > fits).max_by(|&i, &k| {
            let (a, b) = (&groups[i], &groups[k]);
            a.cost.total_cmp(&b.cost).then(a.count.cmp(&b.count)).then(k.cmp(&i))
        });
        let Some(at) = costliest else { break };
        let start: usize = groups[..at].iter().map(|g| g.count).sum();
        let group = &mut items[start..start + groups[at].count];
        let left = split(group, halve);
        let (a, b) = group.split_at(left);
        groups[at] = Group::of(a);
        groups.insert(at + 1, Group::of(b));
    }
    groups
}

/// Partitions lights into two non-empty groups at the split of least cost, or at the median; returns the size of the first.
fn split(items: &mut [Item], halve: bool) -> usize {
    let centroid = |i: &Item| i.bounds.bounds.center();
    let centers = Bounds3::of(items.iter().map(centroid));
    let best = if halve || items.len() > MAX_BINNED { None } else { best_split(items, &centers) };
    if let Some((axis, position)) = best {
        let mut left = 0;
        for i in 0..items.len() {
            if centroid(&items[i])[axis] < position {
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
        centroid(a)[axis].total_cmp(&centroid(b)[axis]).then(a.light.cmp(&b.light))
    });
    half
}

/// Axis and position of the binned split of least cost.
fn best_split(items: &[Item], centers: &Bounds3) -> Option<(usize, f32)> {
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
        // Bounds of the bins before and after each split.
        let (mut before, mut behind) = (bins, bins);
        for k in 1..BINS {
            before[k] = union(before[k - 1], before[k]);
            behind[BINS - 1 - k] = union(behind[BINS - 1 - k], behind[BINS - k]);
        }
        // A split after an empty bin equals the split before it.
        for k in (1..BINS).filter(|&k| bins[k - 1].is_some()) {
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

/// Children of a node.
const WIDTH: usize = 8;
/// Marks a child that is a light; the other bits are its index.
const LEAF: u32 = 1 << 31;

/// Number of groups of lights with learned weights: the children of the children of the tree's root, and the lights at infinity.
pub const LIGHT_GROUPS: usize = WIDTH * WIDTH + 1;

/// Factors on the estimates of groups of lights, above 0.
#[derive(Clone, Copy, Debug)]
pub struct LightWeights {
    /// By child of the tree's root.
    near: [f32; WIDTH],
    /// By child of the root, and child of that one.
    inner: [[f32; WIDTH]; WIDTH],
    /// Of the lights at infinity.
    pub far: f32,
}

impl LightWeights {
    /// Weights from factors by group; `counts` are the weights of groups in the mean over a child of the root.
    pub fn new(factors: &[f32; LIGHT_GROUPS], counts: &[f32; LIGHT_GROUPS]) -> LightWeights {
        let inner: [[f32; WIDTH]; WIDTH] =
            std::array::from_fn(|child| std::array::from_fn(|inner| factors[child * WIDTH + inner]));
        let near = std::array::from_fn(|child| {
            let groups = child * WIDTH..(child + 1) * WIDTH;
            let sum: f32 = groups.clone().map(|group| counts[group] * factors[group]).sum();
            let count: f32 = counts[groups].iter().sum();
            if count > 0.0 { sum / count } else { 1.0 }
        });
        LightWeights { near, inner, far: factors[LIGHT_GROUPS - 1] }
    }
}

/// A receiver of light: a point, and its normal if only light from one side contributes.
#[derive(Clone, Copy, Debug)]
pub struct Receiver<'a> {
    pub p: Vec3,
    /// Unit normal on the lit side; zero if light from both sides contributes.
    pub normal: Vec3,
    /// Learned factors on the estimates, which account for occlusion.
    pub weights: Option<&'a LightWeights>,
}

impl Receiver<'_> {
    /// A receiver without weights.
    #[inline(always)]
    pub fn new(p: Vec3, normal: Vec3) -> Receiver<'static> {
        Receiver { p, normal, weights: None }
    }
}

/// Eight children as a structure of arrays; unused ones have weight 0.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Node {
    center: [[f32; WIDTH]; 3],
    /// Radii of the bounding spheres of the boxes.
    radius: [f32; WIDTH],
    weight: [f32; WIDTH],
    axis: [[f32; WIDTH]; 3],
    /// Half extents of the boxes along the axis.
    half_extent: [f32; WIDTH],
    /// Cosines of the largest angle between the axis and a normal.
    cos_normals: [f32; WIDTH],
    /// Cosines of the largest angle between the axis and a lit direction; below -1 if all directions are lit.
    cos_lit: [f32; WIDTH],
    /// Indices of nodes, or of lights with [`LEAF`].
    pub child: [u32; WIDTH],
}

const _: () = assert!(size_of::<Node>() == 384);

/// Estimates of the children of a node times the receiver's weights for them.
#[inline(always)]
fn weighted(mut estimates: [f32; WIDTH], level: Level, receiver: &Receiver<'_>) -> [f32; WIDTH] {
    let Some(weights) = receiver.weights else { return estimates };
    let factors = match level.depth {
        0 => &weights.near,
        1 => &weights.inner[level.child as usize],
        _ => return estimates,
    };
    for i in 0..WIDTH {
        estimates[i] *= factors[i];
    }
    estimates
}

/// Pairwise sum: equal bits on every CPU, and a shorter dependency chain.
#[inline(always)]
fn sum(e: &[f32; WIDTH]) -> f32 {
    ((e[0] + e[1]) + (e[2] + e[3])) + ((e[4] + e[5]) + (e[6] + e[7]))
}

impl Node {
    pub const EMPTY: Node = Node {
        center: [[0.0; WIDTH]; 3],
        radius: [0.0; WIDTH],
        weight: [0.0; WIDTH],
        axis: [[0.0; WIDTH]; 3],
        half_extent: [0.0; WIDTH],
        cos_normals: [0.0; WIDTH],
        cos_lit: [0.0; WIDTH],
        child: [LEAF; WIDTH],
    };

    pub fn set(&mut self, i: usize, b: &LightBounds, child: u32) {
        let (center, extent) = (b.bounds.center(), b.bounds.extent());
        for c in 0..3 {
            self.center[c][i] = center[c];
            self.axis[c][i] = b.axis[c];
        }
        self.radius[i] = 0.5 * extent.length();
        self.half_extent[i] = 0.5 * extent.dot(b.axis.abs());
        self.weight[i] = b.weight;
        self.cos_normals[i] = poly::sin_cos(b.normals_rad).1;
        let lit_rad = b.normals_rad + b.emission_rad;
        // Slightly wider, for rounding: an estimate of 0 must imply that no light arrives.
        self.cos_lit[i] = if lit_rad < PI { poly::sin_cos(lit_rad).1 - ROUNDING } else { -2.0 };
        self.child[i] = child;
    }

    /// Estimated irradiance from each child, 0 only where no light arrives: weight times the cosines at the light and at the receiver over
    /// the squared distance (Conty Estevez, Kulla 2018, section 5.1). The paper uses the largest possible cosines, which are near 1 if the
    /// bounding sphere subtends a large angle. Here, the cosine at the light uses the distance of the receiver from the near end of the box
    /// along the axis (lights in a plane hardly light a point just below the plane unless they are close), and that at the receiver is the
    /// mean of the largest possible cosine and the center's.
    #[inline(always)]
    pub fn estimates(&self, receiver: &Receiver<'_>) -> [f32; WIDTH] {
        let (p, n) = (receiver.p, receiver.normal);
        let any_side = if n == Vec3::ZERO { 1.0 } else { 0.0 };
        let mut estimates = [0.0; WIDTH];
        for (i, estimate) in estimates.iter_mut().enumerate() {
            let (x, y, z) = (p.x - self.center[0][i], p.y - self.center[1][i], p.z - self.center[2][i]);
            let squared = x * x + y * y + z * z;
            let distance = (if squared > 1e-30 { squared } else { 1e-30 }).sqrt();
            let radius = self.radius[i];
            let is_inside = distance <= radius;
            let inverse = 1.0 / if is_inside { radius } else { distance };
            // Sine of the half angle subtended by the bounding sphere.
            let size = radius * inverse;
            let height = x * self.axis[0][i] + y * self.axis[1][i] + z * self.axis[2][i];
            let cos_axis = height * inverse;
            let highest = (height + self.half_extent[i]) * inverse;
            let cos_receiver = -(x * n.x + y * n.y + z * n.z) * inverse;
            // cos(a - b) <= cos a + 2 sin b, and cos(a - b) > 0 only if cos a + sin b > 0. If no light faces the receiver, all cosines are
            // below half the highest, since no light is more than twice as far away as the center.
            let cos_lit = self.cos_lit[i];
            let below = if cos_lit < -ROUNDING { cos_lit } else { -ROUNDING };
            let is_lit = (cos_axis + 2.0 * size > cos_lit) & (0.5 * highest > below);
            let largest = cos_receiver + size;
            let is_above_horizon = (largest > -ROUNDING) | (any_side > 0.0);
            let cos_light = if is_inside { 1.0 } else { highest };
            let cos_light = cos_difference(cos_light, self.cos_normals[i]);
            let of_center = if cos_receiver > 0.0 { cos_receiver } else { 0.0 };
            let cos_surface = if is_inside { 1.0 } else { at_most_1(0.5 * (of_center + largest)) };
            let cos_surface = if any_side > cos_surface { any_side } else { cos_surface };
            // A lower bound on the cosines keeps probabilities above 0 at grazing angles.
            let cosines = floor(cos_light) * floor(cos_surface);
            let irradiance = self.weight[i] * cosines * (inverse * inverse);
            *estimate = if is_lit & is_above_horizon { irradiance } else { 0.0 };
        }
        estimates
    }
}

/// Bound on the rounding error of a cosine.
const ROUNDING: f32 = 1e-5;

#[inline(always)]
fn at_most_1(cosine: f32) -> f32 {
    if cosine < 1.0 { cosine } else { 1.0 }
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

/// cos(max(a - b, 0)) of two angles given by their cosines.
#[inline(always)]
fn cos_difference(cos: f32, cos_other: f32) -> f32 {
    let c = cos * cos_other + sine(cos) * sine(cos_other);
    if cos >= cos_other { 1.0 } else { c }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Bounds3, Vec3};
    use crate::sampling::chi2::Random;
    use crate::sampling::warp;
    use std::f32::consts::{FRAC_PI_2, PI};

    fn random_lights(count: usize, random: &mut Random) -> Vec<LightBounds> {
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

    fn receivers(random: &mut Random) -> Vec<Receiver<'static>> {
        let receiver = |i: usize| {
            let p = Vec3::new(random.next(), random.next(), random.next()) * 14.0 - 2.0;
            let normal = warp::uniform_sphere([random.next(), random.next()]);
            Receiver::new(p, if i.is_multiple_of(4) { Vec3::ZERO } else { normal })
        };
        (0..40).map(receiver).collect()
    }

    #[test]
    fn probabilities_sum_to_one_and_match_sampling() {
        const SAMPLES: u32 = 1000;
        let mut random = Random::new(4);
        for count in [1, 2, 7, 8, 9, 100, 3000] {
            let lights = random_lights(count, &mut random);
            let tree = LightTree::new(&lights);
            let factors = std::array::from_fn(|_| random.next() + 0.01);
            let weights = LightWeights::new(&factors, &[1.0; LIGHT_GROUPS]);
            for (i, receiver) in receivers(&mut random).into_iter().enumerate() {
                let receiver = Receiver { weights: (i % 2 == 0).then_some(&weights), ..receiver };
                let probabilities: f64 =
                    (0..count).map(|i| f64::from(tree.pdf_discrete(&receiver, i as u32))).sum();
                assert!(probabilities < 1.0 + 1e-4, "{count}: {probabilities}");
                // Below 1 if a node's estimate is above 0 but all its children's are 0.
                let mut lost = 0;
                for k in 0..SAMPLES {
                    let u = (f64::from(k) + f64::from(random.next())) / f64::from(SAMPLES);
                    let (light, pdf) = tree.sample(&receiver, u);
                    if pdf == 0.0 {
                        assert!(probabilities < 1.0 - 1e-4);
                        lost += 1;
                        continue;
                    }
                    let again = tree.pdf_discrete(&receiver, light);
                    assert!(pdf > 0.0 && (pdf - again).abs() <= 1e-5 * pdf, "{count}: {pdf} {again}");
                }
                let sum = probabilities + f64::from(lost) / f64::from(SAMPLES);
                assert!(
                    (sum - 1.0).abs() < 0.03,
                    "{count}: {probabilities} and {lost} of {SAMPLES} without a light"
                );
            }
        }
    }

    #[test]
    fn lights_that_reach_a_point_have_positive_probability() {
        let mut random = Random::new(8);
        let lights = random_lights(500, &mut random);
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
    fn coincident_and_dark_lights_are_handled() {
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
        let receiver = Receiver::new(Vec3::ONE, Vec3::ZERO);
        assert_eq!(tree.pdf_discrete(&receiver, 17), 0.0);
        let sum: f64 = (0..10_000).map(|i| f64::from(tree.pdf_discrete(&receiver, i))).sum();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
        assert!(tree.bytes() < 128 * lights.len(), "{}", tree.bytes());
        assert_eq!(LightTree::new(&[]).sample(&receiver, 0.5).1, 0.0);
    }
}
