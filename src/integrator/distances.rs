//! Densities by which distances along a ray are drawn.

use crate::math::{Vec3, poly};
use crate::simd::map_each;

/// Angles in which a point sees a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Guide {
    /// Where on the ray the point is closest.
    closest: f32,
    /// How far it is from there.
    distance: f32,
    /// The angles between the way there and those to the ray's first and last point.
    angles: [f32; 2],
}

impl Guide {
    /// `None` where the numbers give no angle.
    #[inline]
    pub(super) fn new(origin: Vec3, direction: Vec3, extent: [f32; 2], lamp: Vec3) -> Option<Guide> {
        let to_lamp = lamp - origin;
        let closest = to_lamp.dot(direction);
        // A ray through the lamp itself would see nothing but its point.
        let least = 1e-3 * to_lamp.length();
        let distance = (to_lamp - direction * closest).length().max(least);
        let angle = |t: f32| {
            if t.is_finite() { poly::atan2(t - closest, distance) } else { 0.5 * std::f32::consts::PI }
        };
        let angles = map_each(extent, angle);
        let is_usable = distance > 0.0 && distance.is_finite() && angles[1] > angles[0];
        is_usable.then_some(Guide { closest, distance, angles })
    }

    /// A point of the ray.
    #[inline]
    pub(super) fn sample(&self, u: f32) -> f32 {
        let [first, last] = self.angles;
        let (sine, cosine) = poly::sin_cos(first + (last - first) * u);
        if cosine > 0.0 { self.closest + self.distance * sine / cosine } else { f32::INFINITY }
    }

    /// Density of its points, per metre.
    #[inline]
    pub(super) fn density(&self, t: f32) -> f32 {
        let [first, last] = self.angles;
        let along = t - self.closest;
        self.distance / ((last - first) * (self.distance * self.distance + along * along))
    }

    /// The probability of a point behind this one.
    #[inline]
    pub(super) fn beyond(&self, t: f32) -> f32 {
        let [first, last] = self.angles;
        if t == f32::INFINITY {
            return 0.0;
        }
        ((last - poly::atan2(t - self.closest, self.distance)) / (last - first)).clamp(0.0, 1.0)
    }
}

/// An exponential density on a way of finite length.
pub(super) struct Truncated {
    /// Per metre; 0 where it is even.
    rate: f32,
    length: f32,
    /// What lies on the way of the density without an end.
    whole: f32,
}

impl Truncated {
    #[inline(always)]
    pub(super) fn new(rate: f32, length: f32) -> Truncated {
        let depth = rate * length;
        // Hardly a slope, and differences of numbers near 1.
        if depth < 1e-3 {
            return Truncated { rate: 0.0, length, whole: 1.0 };
        }
        Truncated { rate, length, whole: 1.0 - falling(depth) }
    }

    #[inline(always)]
    pub(super) fn sample(&self, u: f32) -> f32 {
        let x = if self.rate > 0.0 { -poly::ln(1.0 - u * self.whole) / self.rate } else { u * self.length };
        x.clamp(0.0, self.length)
    }

    #[inline(always)]
    pub(super) fn density(&self, x: f32) -> f32 {
        if self.rate > 0.0 { self.rate * falling(self.rate * x) / self.whole } else { 1.0 / self.length }
    }
}

/// The exponential of minus a depth; the polynomial ends at the least normal number.
#[inline(always)]
fn falling(depth: f32) -> f32 {
    if depth < 87.0 { poly::exp(-depth) } else { 0.0 }
}
