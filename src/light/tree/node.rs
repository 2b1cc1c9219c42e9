//! Nodes of the tree over lights, and what their children are estimated to bring.

use crate::light::bounds::LightBounds;
use crate::math::{Vec3, poly};
use std::f32::consts::PI;

/// Children of a node.
pub(super) const WIDTH: usize = 8;
/// Marks a child that is a light; the rest is its number.
pub(super) const LEAF: u32 = 1 << 31;

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
pub(super) struct Node {
    center: [[f32; WIDTH]; 3],
    /// Of the sphere around the box.
    radius: [f32; WIDTH],
    weight: [f32; WIDTH],
    axis: [[f32; WIDTH]; 3],
    /// How far the box reaches beyond its centre along the axis.
    reach: [f32; WIDTH],
    cos_normals: [f32; WIDTH],
    /// Of the largest angle between the axis and a direction that is lit; below -1 where all are.
    cos_lit: [f32; WIDTH],
    /// Other nodes, or lights with [`LEAF`].
    pub child: [u32; WIDTH],
}

const _: () = assert!(size_of::<Node>() == 384);

/// In pairs: the same on every CPU, and shorter than one after the other.
#[inline(always)]
pub(super) fn sum(e: &[f32; WIDTH]) -> f32 {
    ((e[0] + e[1]) + (e[2] + e[3])) + ((e[4] + e[5]) + (e[6] + e[7]))
}

impl Node {
    pub const EMPTY: Node = Node {
        center: [[0.0; WIDTH]; 3],
        radius: [0.0; WIDTH],
        weight: [0.0; WIDTH],
        axis: [[0.0; WIDTH]; 3],
        reach: [0.0; WIDTH],
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
        self.reach[i] = 0.5 * extent.dot(b.axis.abs());
        self.weight[i] = b.weight;
        self.cos_normals[i] = poly::sin_cos(b.normals_rad).1;
        let lit_rad = b.normals_rad + b.emission_rad;
        // A little wider, for rounding: what is cut off must be dark.
        self.cos_lit[i] = if lit_rad < PI { poly::sin_cos(lit_rad).1 - ROUNDING } else { -2.0 };
        self.child[i] = child;
    }

    /// Estimates of what each child brings, 0 only where nothing arrives: weight times the cosines at the light and at the
    /// receiver over the squared distance (Conty Estevez, Kulla 2018, section 5.1). They take the largest cosines possible, which are
    /// near 1 wherever the sphere around the box takes up a large angle. Here it is at the light how high the receiver is above
    /// the end of the box that faces it (lamps in one plane bring little to a point just below it unless they are next to
    /// it), and at the receiver the mean of the largest one and that of the centre.
    #[inline(always)]
    pub fn estimates(&self, receiver: &Receiver) -> [f32; WIDTH] {
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
            // The sine of the angle that the lights take up.
            let size = radius * inverse;
            let height = x * self.axis[0][i] + y * self.axis[1][i] + z * self.axis[2][i];
            let cos_axis = height * inverse;
            let highest = (height + self.reach[i]) * inverse;
            let cos_receiver = -(x * n.x + y * n.y + z * n.z) * inverse;
            // Less another angle, an angle has at most its cosine and twice that one's sine; more than 0 only if the cosine and
            // once that sine are. Where nothing faces the receiver, all cosines are below half the highest, no light being more
            // than twice as far away as the centre.
            let cos_lit = self.cos_lit[i];
            let below = if cos_lit < -ROUNDING { cos_lit } else { -ROUNDING };
            let is_lit = (cos_axis + 2.0 * size > cos_lit) & (0.5 * highest > below);
            let largest = cos_receiver + size;
            let is_seen = (largest > -ROUNDING) | (any_side > 0.0);
            let cos_light = if is_inside { 1.0 } else { highest };
            let cos_light = less(cos_light, self.cos_normals[i]);
            let of_center = if cos_receiver > 0.0 { cos_receiver } else { 0.0 };
            let cos_surface = if is_inside { 1.0 } else { at_most_1(0.5 * (of_center + largest)) };
            let cos_surface = if any_side > cos_surface { any_side } else { cos_surface };
            // Where the cosines are all but 0 so is the light: a floor keeps the probability from vanishing first.
            let cosines = floor(cos_light) * floor(cos_surface);
            let brought = self.weight[i] * cosines * (inverse * inverse);
            *estimate = if is_lit & is_seen { brought } else { 0.0 };
        }
        estimates
    }
}

/// What rounding may change a cosine by.
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

/// The cosine of an angle less another one, which is at least 0.
#[inline(always)]
fn less(cos: f32, cos_other: f32) -> f32 {
    let c = cos * cos_other + sine(cos) * sine(cos_other);
    if cos >= cos_other { 1.0 } else { c }
}
