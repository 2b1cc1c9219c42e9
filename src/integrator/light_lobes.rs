//! Lobes of directions towards refracted lights, and the vertices that have some.

use super::interior::Interior;
use crate::color::Rgb;
use crate::math::{Frame, Vec3, poly};
use std::f32::consts::PI;

/// Maximum number of lobes of a vertex.
const MAX_LOBES: usize = 4;

/// Narrowest and widest lobes, GGX alpha.
const WIDTHS: [f32; 2] = [5e-4, 0.5];

/// Directions around an axis: the tangent of their angle to it is distributed as that of GGX normals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lobe {
    axis: Vec3,
    alpha: f32,
}

impl Lobe {
    fn pdf_solid_angle(&self, w: Vec3) -> f32 {
        let cosine = w.dot(self.axis);
        let squared = self.alpha * self.alpha;
        let spread = w.cross(self.axis).length_squared() + squared * cosine * cosine;
        if cosine > 0.0 { squared * cosine / (PI * spread * spread) } else { 0.0 }
    }

    fn sample(&self, [a, b]: [f32; 2]) -> Vec3 {
        let tangent = self.alpha * (a / (1.0 - a).max(1e-7)).sqrt();
        let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
        let (sine, phi) = (tangent * cosine, 2.0 * PI * b);
        let (s, c) = poly::sin_cos(phi);
        Frame::from_normal(self.axis).to_world(Vec3::new(sine * c, sine * s, cosine))
    }
}

/// A vertex with lobes, and the state of its path before it scattered.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightLobes {
    pub vertex: u32,
    lobes: [Lobe; MAX_LOBES],
    count: usize,
    pub throughput: Rgb,
    pub roulette_scale: f32,
    pub interior: Interior,
}

impl LightLobes {
    /// None yet.
    pub fn new(vertex: usize, throughput: Rgb, roulette_scale: f32, interior: Interior) -> LightLobes {
        let lobes = [Lobe { axis: Vec3::Z, alpha: 1.0 }; MAX_LOBES];
        LightLobes { vertex: vertex as u32, lobes, count: 0, throughput, roulette_scale, interior }
    }

    /// Are there none?
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Adds one of a width, GGX alpha, if there is room and it is narrow enough.
    pub fn add(&mut self, axis: Vec3, width: f32) {
        if self.count < MAX_LOBES && width <= WIDTHS[1] {
            self.lobes[self.count] = Lobe { axis, alpha: width.max(WIDTHS[0]) };
            self.count += 1;
        }
    }

    /// A direction of one of them, which a number in 0..1 chooses.
    pub fn sample(&self, choice: f32, u: [f32; 2]) -> Vec3 {
        self.lobes[((choice * self.count as f32) as usize).min(self.count - 1)].sample(u)
    }

    /// The density of these directions.
    pub fn pdf_solid_angle(&self, w: Vec3) -> f32 {
        let lobes = &self.lobes[..self.count];
        lobes.iter().map(|lobe| lobe.pdf_solid_angle(w)).sum::<f32>() / self.count as f32
    }
}
