//! Media that shine by a grid of their own: factors on their emission, or temperatures of black bodies.

use super::black_body::BlackBodies;
use super::density::{DensityGrid, GridRay};
use crate::color::Rgb;
use crate::color::spectral::Wavelengths;
use crate::math::Vec3;
use crate::scene::{self, Grid};
use std::sync::Arc;

/// Temperatures whose colours are known; between them colours are linear.
const COLORS: usize = 1024;

/// What the emission of a medium is taken times.
#[derive(Clone, Debug, PartialEq)]
pub struct Glow {
    grid: Arc<DensityGrid>,
    heat: Option<Heat>,
}

/// Values of the grid are temperatures.
#[derive(Clone, Debug, PartialEq)]
struct Heat {
    /// Kelvins where the grid is 1.
    kelvin: f32,
    bodies: BlackBodies,
    /// What they are taken times to go by their power, by the same steps as colours; none where they don't.
    powers: Vec<f32>,
    /// Their colours from 0 to the hottest, and how many of them lie between values that are 1 apart.
    colors: Vec<Rgb>,
    per_value: f32,
}

impl Glow {
    /// Of a medium, by the scene's grids.
    pub(super) fn new(glow: scene::Glow, grids: &[Grid], prepared: &[Arc<DensityGrid>]) -> Glow {
        let index = glow.grid.index();
        let hottest = grids[index].values.iter().fold(0.0f32, |most, x| most.max(*x));
        let heat = glow.kelvin.map(|kelvin| {
            let bodies = BlackBodies::relative_to(scene::Glow::REFERENCE_KELVIN);
            let last = (COLORS - 1) as f32;
            let heat = |i: usize| kelvin * hottest * (i as f32 / last);
            let steps = 0..if glow.goes_by_power { COLORS } else { 0 };
            let powers: Vec<f32> = steps.map(|i| bodies.power_over_luminance(heat(i))).collect();
            let color = |i: usize| match powers.get(i) {
                Some(power) => Rgb::from_array(bodies.rgb(heat(i).max(BlackBodies::COOLEST))) * *power,
                None => Rgb::from_array(bodies.rgb(heat(i))),
            };
            let colors = (0..COLORS).map(color).collect();
            let per_value = if hottest > 0.0 { last / hottest } else { 0.0 };
            Heat { kelvin, colors, powers, per_value, bodies }
        });
        Glow { grid: prepared[index].clone(), heat }
    }

    /// An estimate of the integral over metres of what emission is taken times, between two points of a ray; see
    /// [`DensityGrid::integral`].
    pub fn integral(
        &self,
        (origin, direction): (Vec3, Vec3),
        [from, to]: [f32; 2],
        salt: u32,
        waves: Option<&Wavelengths>,
    ) -> Rgb {
        let ray: GridRay = self.grid.ray(origin, direction, 1.0);
        match &self.heat {
            None => Rgb::splat(self.grid.integral(&ray, from, to, salt)),
            Some(heat) => {
                self.grid.integral_of(&ray, [from, to], salt, Rgb::ZERO, |value, _| heat.at(value, waves))
            }
        }
    }

    /// The same where what shines at a point of the ray is taken times something.
    pub fn integral_times(
        &self,
        (origin, direction): (Vec3, Vec3),
        way: [f32; 2],
        salt: u32,
        waves: Option<&Wavelengths>,
        factor: impl Fn(f32) -> Rgb,
    ) -> Rgb {
        let ray: GridRay = self.grid.ray(origin, direction, 1.0);
        match &self.heat {
            None => self.grid.integral_times(&ray, way, salt, factor),
            Some(heat) => {
                let at = |value: f32, t: f32| heat.at(value, waves) * factor(t);
                self.grid.integral_of(&ray, way, salt, Rgb::ZERO, at)
            }
        }
    }
}

impl Heat {
    #[inline]
    fn at(&self, value: f32, waves: Option<&Wavelengths>) -> Rgb {
        let at = (value * self.per_value).clamp(0.0, (COLORS - 1) as f32);
        let i = (at as usize).min(COLORS - 2);
        let share = at - i as f32;
        let Some(waves) = waves else {
            return self.colors[i] + (self.colors[i + 1] - self.colors[i]) * share;
        };
        let kelvin = value * self.kelvin;
        match self.powers.get(i..i + 2) {
            None => waves.map(|nm| self.bodies.at(nm, kelvin)),
            Some(powers) => {
                let power = powers[0] + (powers[1] - powers[0]) * share;
                waves.map(|nm| self.bodies.at(nm, kelvin.max(BlackBodies::COOLEST))) * power
            }
        }
    }
}
