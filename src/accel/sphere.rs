//! Ray and sphere, solved without cancellation (Haines, Guenther, Akenine-Moeller, Ray Tracing Gems 2019, chapter 7) in
//! double precision.

use super::layout::SpherePacket;
use super::prepare::PreparedRay;

/// The smallest parameter in `t_min < t <= t_max` at which a ray meets the sphere of a lane.
#[inline(always)]
pub fn intersect(
    packet: &SpherePacket,
    lane: usize,
    ray: &PreparedRay,
    t_min: f32,
    t_max: f32,
) -> Option<f32> {
    let lane = lane & 3;
    let r = f64::from(packet.radius[lane]);
    let d = ray.direction.map(f64::from);
    let f: [f64; 3] = std::array::from_fn(|k| f64::from(ray.origin[k]) - f64::from(packet.center[k][lane]));
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let a = dot(d, d);
    let b = -dot(f, d);
    // The point of the line nearest to the centre, seen from it: equation 7.3's discriminant, r^2 - |l|^2.
    let l: [f64; 3] = std::array::from_fn(|k| f[k] + (b / a) * d[k]);
    let discriminant = r * r - dot(l, l);
    // NaN: an unused lane.
    if discriminant < 0.0 || discriminant.is_nan() {
        return None;
    }
    let c = power_of_point(packet, lane, ray, f);
    let q = b + (a * discriminant).sqrt().copysign(b);
    let (first, second) = (c / q, q / a);
    let (near, far) = if first < second { (first, second) } else { (second, first) };
    let accept = |t: f64| {
        let t = t as f32;
        (t > t_min && t <= t_max).then_some(t)
    };
    accept(near).or_else(|| accept(far))
}

/// `|f|^2 - r^2` for the origin seen from the centre, `f = o - c`, with about twice the precision of f64 (compensated
/// sums: Ogita, Rump, Oishi 2005, "Accurate Sum and Dot Product"): near the surface almost all of it cancels.
#[inline(always)]
fn power_of_point(packet: &SpherePacket, lane: usize, ray: &PreparedRay, f: [f64; 3]) -> f64 {
    let r = f64::from(packet.radius[lane]);
    let (mut sum, mut rest) = (-(r * r), 0.0);
    for (k, f) in f.into_iter().enumerate() {
        let (o, c) = (f64::from(ray.origin[k]), -f64::from(packet.center[k][lane]));
        let square = f * f;
        rest += f.mul_add(f, -square) + 2.0 * f * rounding_of_sum(o, c, f);
        let next = sum + square;
        rest += rounding_of_sum(sum, square, next);
        sum = next;
    }
    sum + rest
}

/// What `sum`, the rounded `a + b`, lacks (Knuth's two-sum).
#[inline(always)]
fn rounding_of_sum(a: f64, b: f64, sum: f64) -> f64 {
    let part = sum - a;
    (a - (sum - part)) + (b - part)
}
