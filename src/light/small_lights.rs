//! Small bright lights: in which direction, or where, most of the light of a scene starts.

use super::{AreaLight, AreaShape, EnvironmentLight, LightOrigin, LightSource, Lights, PunctualSource};
use crate::math::Vec3;
use crate::texture::CompiledTextures;
use std::f32::consts::PI;

/// Maximum number of lights of either kind.
const MAX_LIGHTS: usize = 4;

/// Samples along each axis by which the brightest spot of an environment is found.
const GRID: usize = 16;

/// Largest angle between directions of the same spot, as a cosine: 2 degrees.
const SPOT_COSINE: f32 = 0.9994;

/// Minimum share of an environment's light in a spot.
const MIN_SHARE: f32 = 0.1;

/// Where a light is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightPlace {
    /// At infinity, in a unit direction.
    Far(Vec3),
    /// Around a point.
    Near(Vec3),
}

/// A light that is small.
#[derive(Clone, Copy, Debug)]
pub struct SmallLight {
    /// Where it is.
    pub place: LightPlace,
    /// Radius, metres; at infinity half its angle, radians.
    pub size: f32,
}

impl Lights {
    /// The brightest small lights.
    pub fn small_lights(&self, textures: &CompiledTextures) -> Vec<SmallLight> {
        let mut far: Vec<(f32, SmallLight)> = Vec::new();
        let mut near: Vec<(f32, SmallLight)> = Vec::new();
        for light in self.punctual() {
            let place = match (light.origin(), light.sun()) {
                (LightOrigin::Point(position), _) => {
                    let power = light.bounds(textures).map_or(0.0, |bounds| bounds.weight);
                    near.push((power, SmallLight { place: LightPlace::Near(position), size: 0.0 }));
                    continue;
                }
                (LightOrigin::Direction(to), _) => (to, 0.0),
                (LightOrigin::Cone, Some(sun)) => (sun.center(), sun.half_angle()),
                (LightOrigin::Cone, None) => continue,
            };
            let small = SmallLight { place: LightPlace::Far(place.0), size: place.1 };
            far.push((light.irradiance().unwrap_or(0.0), small));
        }
        for light in self.area() {
            let power = light.bounds(textures).map_or(0.0, |bounds| bounds.weight);
            near.push((power, SmallLight { place: LightPlace::Near(light.middle()), size: radius(light) }));
        }
        if let Some((share, spot)) = self.environment().and_then(spot_of) {
            far.push((share, spot));
        }
        let brightest = |mut list: Vec<(f32, SmallLight)>| {
            list.retain(|(power, _)| *power > 0.0);
            list.sort_by(|(a, _), (b, _)| b.total_cmp(a));
            list.into_iter().take(MAX_LIGHTS).map(|(_, light)| light)
        };
        brightest(far).chain(brightest(near)).collect()
    }
}

/// Radius of a disk of the same size.
fn radius(light: &AreaLight) -> f32 {
    let sides = if matches!(light.shape, AreaShape::Analytic(_)) { 4.0 } else { 1.0 };
    (light.area() / (sides * PI)).sqrt()
}

/// The brightest spot of an environment, and the luminance of the irradiance that it gives.
fn spot_of(environment: &EnvironmentLight) -> Option<(f32, SmallLight)> {
    environment.image_map()?;
    let at = |k: usize| (k as f32 + 0.5) / GRID as f32;
    let directions: Vec<Vec3> =
        (0..GRID * GRID).map(|k| environment.sample([at(k % GRID), at(k / GRID)]).direction).collect();
    let near = |middle: Vec3| directions.iter().filter(move |d| d.dot(middle) >= SPOT_COSINE);
    let densest = *directions.iter().max_by_key(|middle| near(**middle).count())?;
    let mean: Vec3 = near(densest).sum();
    let (middle, count) = (mean.try_normalize()?, near(densest).count() as f32);
    let share = count / directions.len() as f32;
    let spread = near(densest).map(|d| (*d - middle).length_squared()).sum::<f32>() / count;
    // A uniform disk is wider than its root mean square by the root of two.
    let light = SmallLight { place: LightPlace::Far(middle), size: (2.0 * spread).sqrt() };
    (share >= MIN_SHARE).then_some((share * environment.mean_luminance() * 4.0 * PI, light))
}
