//! Nodes of the tree over lights, and what their children are estimated to bring.

use crate::light::bounds::LightBounds;
use crate::math::{Vec3, poly};

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
    radius_squared: [f32; WIDTH],
    weight: [f32; WIDTH],
    axis: [[f32; WIDTH]; 3],
    cos_normals: [f32; WIDTH],
    sin_normals: [f32; WIDTH],
    cos_emission: [f32; WIDTH],
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
        radius_squared: [0.0; WIDTH],
        weight: [0.0; WIDTH],
        axis: [[0.0; WIDTH]; 3],
        cos_normals: [0.0; WIDTH],
        sin_normals: [0.0; WIDTH],
        cos_emission: [0.0; WIDTH],
        child: [LEAF; WIDTH],
    };

    pub fn set(&mut self, i: usize, b: &LightBounds, child: u32) {
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
    pub fn estimates(&self, receiver: &Receiver) -> [f32; WIDTH] {
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
