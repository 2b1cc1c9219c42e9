//! Light that goes some ways more than others: beams of lamps with a surface.

use super::cone::Cone;
use super::profiled::{Aim, mean_share};
use crate::color::Rgb;
use crate::math::Vec3;
use crate::scene::{self, LightProfile};
use crate::texture::CompiledTextures;
use std::f32::consts::PI;
use std::sync::Arc;

/// How the radiance of a surface depends on the direction; see [`scene::Beam`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Beam {
    /// It doesn't.
    Even,
    /// What slats hide: the factor is (`tan_half` - tan) times `scale`, of the angle to the normal.
    Grid {
        /// Tangent of the half angle.
        tan_half: f32,
        /// 1 / (tan a - a) of the half angle a: the power is that of an even beam, as the integral of
        /// (tan a - tan t) cos t over the directions is pi (tan a - a).
        scale: f32,
    },
    /// A cone about an axis.
    Cone(Cone),
    /// A measured profile.
    Profile {
        /// Its number among the scene's.
        number: u32,
        /// How it is turned.
        aim: Aim,
        /// Its mean share over all directions.
        mean: f32,
    },
}

impl Beam {
    /// Prepares a beam, by the scene's profiles. One that is not among them is even (`Scene::validate` reports it).
    pub fn new(beam: scene::Beam, profiles: &[Arc<LightProfile>]) -> Beam {
        match beam {
            scene::Beam::Even => Beam::Even,
            scene::Beam::Grid { half_angle_rad } => {
                let tan_half = half_angle_rad.tan();
                let scale = 1.0 / (tan_half - half_angle_rad);
                Beam::Grid { tan_half: tan_half as f32, scale: scale as f32 }
            }
            scene::Beam::Cone { direction, inner_angle_rad, outer_angle_rad, fade } => {
                Beam::Cone(Cone::new(direction, inner_angle_rad, outer_angle_rad, fade))
            }
            scene::Beam::Profile { profile, rotation, cone } => {
                profiles.get(profile.index()).map_or(Beam::Even, |of| Beam::Profile {
                    number: profile.0,
                    aim: Aim::new(rotation, cone),
                    mean: mean_share(of),
                })
            }
        }
    }

    /// What a surface of a radiance and a normal sends in a direction, both of unit length; profiles lie beside textures.
    #[inline(always)]
    pub fn of(&self, radiance: Rgb, normal: Vec3, direction: Vec3, textures: &CompiledTextures) -> Rgb {
        if matches!(self, Beam::Even) {
            return radiance;
        }
        radiance * self.factor(normal, direction, textures.profiles())
    }

    /// Factor on the radiance that leaves a surface of a normal in a direction; both of unit length.
    #[cold]
    pub fn factor(&self, normal: Vec3, direction: Vec3, profiles: &[Arc<LightProfile>]) -> f32 {
        match self {
            Beam::Even => 1.0,
            Beam::Grid { tan_half, scale } => {
                let cosine = normal.dot(direction).abs();
                let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
                ((tan_half - sine / cosine.max(1e-9)) * scale).max(0.0)
            }
            Beam::Cone(cone) => cone.attenuation(direction.dot(cone.axis)),
            Beam::Profile { number, aim, .. } => {
                aim.share(profiles.get(*number as usize).map(|profile| &**profile), direction)
            }
        }
    }

    /// The share of an even beam's power, roughly: what lights are chosen by.
    pub fn share_of_power(&self) -> f32 {
        match self {
            Beam::Even | Beam::Grid { .. } => 1.0,
            Beam::Cone(cone) => cone.solid_angle() / (4.0 * PI),
            Beam::Profile { mean, .. } => *mean,
        }
    }

    /// Axis and half angle of a cone that holds all of the light, if it isn't bound to a normal.
    pub fn cone(&self) -> Option<(Vec3, f32)> {
        match self {
            Beam::Even | Beam::Grid { .. } => None,
            // A little wider, for rounding.
            Beam::Cone(cone) => Some((cone.axis, (cone.angles_rad()[1] + 1e-3).min(0.5 * PI))),
            Beam::Profile { aim, .. } => {
                Some(aim.cone().map_or((Vec3::Z, PI), |(axis, angle)| (axis, (angle + 1e-3).min(0.5 * PI))))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_keeps_the_power() {
        for half_angle_rad in [0.1f64, 0.7, 1.4] {
            let beam = Beam::new(scene::Beam::Grid { half_angle_rad }, &[]);
            let n = 20_000;
            let sum: f64 = (0..n)
                .map(|i| {
                    let t = (f64::from(i) + 0.5) / f64::from(n) * half_angle_rad;
                    let direction = Vec3::new(t.sin() as f32, 0.0, t.cos() as f32);
                    f64::from(beam.factor(Vec3::Z, direction, &[])) * t.cos() * t.sin()
                })
                .sum();
            let power = 2.0 * sum * half_angle_rad / f64::from(n);
            assert!((power - 1.0).abs() < 2e-3, "{half_angle_rad}: {power}");
            assert_eq!(beam.factor(Vec3::Z, Vec3::X, &[]), 0.0);
        }
    }
}
