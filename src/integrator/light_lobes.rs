//! Lobes of directions towards lights behind refractive bodies.

use super::interior::Interior;
use crate::color::Rgb;
use crate::math::{Frame, Vec3, poly};
use std::f32::consts::PI;

/// Maximum number of lobes of a vertex.
const MAX_LOBES: usize = 4;

/// Minimum and maximum GGX alpha of lobes.
const ALPHAS: [f32; 2] = [5e-4, 0.5];

/// Directions around an axis with the angular distribution of GGX normals.
#[derive(Clone, Copy, Debug)]
struct LightLobe {
    axis: Vec3,
    alpha: f32,
}

impl LightLobe {
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

/// The light lobes of a vertex, and the state of its path before BSDF sampling.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightLobes {
    pub vertex: u32,
    lobes: [LightLobe; MAX_LOBES],
    count: usize,
    /// Probability of sampling a lobe instead of the BSDF.
    pub probability: f32,
    pub throughput: Rgb,
    pub roulette_scale: f32,
    pub interior: Interior,
}

impl LightLobes {
    /// Without lobes.
    pub fn new(vertex: usize, throughput: Rgb, roulette_scale: f32, interior: Interior) -> LightLobes {
        let lobes = [LightLobe { axis: Vec3::Z, alpha: 1.0 }; MAX_LOBES];
        LightLobes {
            vertex: vertex as u32,
            lobes,
            count: 0,
            probability: 0.0,
            throughput,
            roulette_scale,
            interior,
        }
    }

    /// Number of lobes.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Are there no lobes?
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Adds a lobe of GGX alpha `width`; ignored if too wide or if there are [`MAX_LOBES`] already.
    pub fn add(&mut self, axis: Vec3, width: f32) {
        if self.count < MAX_LOBES && width <= ALPHAS[1] {
            self.lobes[self.count] = LightLobe { axis, alpha: width.max(ALPHAS[0]) };
            self.count += 1;
        }
    }

    /// Samples a direction of a lobe; the random number `choice` in 0..1 selects the lobe.
    pub fn sample(&self, choice: f32, u: [f32; 2]) -> Vec3 {
        self.lobes[((choice * self.count as f32) as usize).min(self.count - 1)].sample(u)
    }

    /// The pdf of [`LightLobes::sample`], 1/sr.
    pub fn pdf_solid_angle(&self, w: Vec3) -> f32 {
        let lobes = &self.lobes[..self.count];
        lobes.iter().map(|lobe| lobe.pdf_solid_angle(w)).sum::<f32>() / self.count as f32
    }
}
