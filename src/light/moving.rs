//! Lights that move while the shutter is open: a light for each of some moments, and between two of them one in between.

use super::{AreaLight, AreaShape, Edges, LightBounds, LightSample, PunctualLight};
use crate::math::{Vec3, gamma, offset_ray_origin, segment};
use crate::shape::{Analytic, Packed, Shape};
use crate::texture::CompiledTextures;
use std::collections::BTreeMap;

/// What a light is at equal steps of time: always of the same kind.
#[derive(Clone, Debug)]
pub struct MovingLight<T>(pub Vec<T>);

/// Those of a scene's lights that move, by their place in their lists.
#[derive(Clone, Debug, Default)]
pub struct LightMotions {
    /// Of lights with a surface.
    pub area: BTreeMap<usize, MovingLight<AreaLight>>,
    /// Of those without.
    pub punctual: BTreeMap<usize, MovingLight<PunctualLight>>,
}

impl LightMotions {
    /// Does none move?
    pub fn is_empty(&self) -> bool {
        self.area.is_empty() && self.punctual.is_empty()
    }
}

impl MovingLight<AreaLight> {
    /// The light at a time in 0..1.
    #[inline]
    pub fn at(&self, time: f32) -> AreaLight {
        let (key, share) = segment(self.0.len(), time);
        let (from, to) = (&self.0[key], &self.0[(key + 1).min(self.0.len() - 1)]);
        AreaLight::new(mix(&from.shape, &to.shape, share), from.two_sided, from.radiance).with_beam(from.beam)
    }

    /// [`AreaLight::sample`] at a time. Shadow rays end a little farther before it than before lights that stand still: they are
    /// taken to the space of what moves in single precision.
    pub fn sample(
        &self,
        textures: &CompiledTextures,
        reference: Vec3,
        u: [f32; 2],
        time: f32,
    ) -> LightSample {
        let light = self.at(time);
        let sample = light.sample(textures, reference, u);
        let error = (reference.abs() + sample.target.abs()) * gamma(8);
        let normal = light.normal_at(sample.target, reference);
        LightSample { target: offset_ray_origin(sample.target, error, normal, -sample.wi), ..sample }
    }

    /// Where its light comes from and goes at any time; as bright as it is on average.
    pub fn bounds(&self, textures: &CompiledTextures) -> LightBounds {
        of_all(self.0.iter().map(|light| light.bounds(textures)))
    }

    /// Its mean power.
    pub fn power(&self, textures: &CompiledTextures) -> f32 {
        self.0.iter().map(|light| light.power(textures)).sum::<f32>() / self.0.len() as f32
    }
}

impl MovingLight<PunctualLight> {
    /// The light at a time in 0..1.
    #[inline]
    pub fn at(&self, time: f32) -> PunctualLight {
        let (key, share) = segment(self.0.len(), time);
        self.0[key].towards(&self.0[(key + 1).min(self.0.len() - 1)], share)
    }

    /// Where its light comes from and goes at any time; `None` for one infinitely far away.
    pub fn bounds(&self) -> Option<LightBounds> {
        let all: Option<Vec<LightBounds>> = self.0.iter().map(PunctualLight::bounds).collect();
        all.map(|all| of_all(all.into_iter()))
    }
}

fn of_all(all: impl Iterator<Item = LightBounds>) -> LightBounds {
    let (mut count, mut sum) = (0.0, LightBounds::DARK);
    for bounds in all {
        sum = if count == 0.0 { bounds } else { sum.union(&bounds) };
        count += 1.0;
    }
    LightBounds { weight: sum.weight / f32::max(count, 1.0), ..sum }
}

/// Corners go along straight lines, as those of what is hit do.
fn mix(from: &AreaShape, to: &AreaShape, share: f32) -> AreaShape {
    let between = |a: Vec3, b: Vec3| a + (b - a) * share;
    let edges = |a: &Edges, b: &Edges| Edges {
        corner: between(a.corner, b.corner),
        edge_u: between(a.edge_u, b.edge_u),
        edge_v: between(a.edge_v, b.edge_v),
    };
    match (from, to) {
        (AreaShape::Rectangle(a), AreaShape::Rectangle(b)) => AreaShape::Rectangle(edges(a, b)),
        (AreaShape::Parallelogram(a), AreaShape::Parallelogram(b)) => AreaShape::Parallelogram(edges(a, b)),
        (AreaShape::Triangle(a), AreaShape::Triangle(b)) => AreaShape::Triangle(edges(a, b)),
        (AreaShape::Analytic(a), AreaShape::Analytic(b)) => {
            let (packed, other) = (a.pack(), b.numbers());
            let number = |i: usize| packed.numbers[i] + (other[i] - packed.numbers[i]) * share;
            let numbers = std::array::from_fn(number);
            AreaShape::Analytic(Analytic::unpack(&Packed { numbers, ..packed }).unwrap_or(*a))
        }
        _ => *from,
    }
}
