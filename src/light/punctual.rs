//! Lights without a surface (KHR_lights_punctual).

use super::{LightBounds, LightSample};
use crate::color::luminance;
use crate::math::{Bounds3, DVec3, Vec3, poly};
use crate::scene;
use std::f32::consts::PI;

/// A light without a surface, ready for rendering.
#[derive(Clone, Copy, Debug)]
pub struct PunctualLight {
    intensity: Vec3,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Point(Vec3),
    /// Angular attenuation is (scale cos + offset)^2, clamped to 0..1.
    Spot {
        position: Vec3,
        axis: Vec3,
        scale: f32,
        offset: f32,
    },
    Directional {
        to_light: Vec3,
    },
}

impl PunctualLight {
    /// Prepares a light; the world's origin moves to `world_origin`.
    pub fn new(light: &scene::Light, world_origin: DVec3) -> PunctualLight {
        let local = |p: DVec3| (p - world_origin).as_vec3();
        let kind = match light.kind {
            scene::LightKind::Point { position } => Kind::Point(local(position)),
            scene::LightKind::Spot { position, direction, inner_angle_rad, outer_angle_rad } => {
                // KHR_lights_punctual, "Inner and Outer Cone Angles".
                let scale = 1.0 / (inner_angle_rad.cos() - outer_angle_rad.cos()).max(1e-3);
                Kind::Spot {
                    position: local(position),
                    axis: direction.normalize().as_vec3(),
                    scale: scale as f32,
                    offset: (-outer_angle_rad.cos() * scale) as f32,
                }
            }
            scene::LightKind::Directional { direction } => {
                Kind::Directional { to_light: -direction.normalize().as_vec3() }
            }
        };
        PunctualLight { intensity: Vec3::from_array(light.intensity), kind }
    }

    /// Luminous power in relative units; a directional light's is what falls on a disk of the scene's radius.
    pub fn power(&self, scene_radius: f32) -> f32 {
        let solid_angle = match self.kind {
            Kind::Point(_) => 4.0 * PI,
            // Half lit on average between the cones: cos = (1 - 2 offset) / (2 scale).
            Kind::Spot { scale, offset, .. } => 2.0 * PI * (1.0 - (0.5 - offset) / scale).clamp(1e-4, 2.0),
            Kind::Directional { .. } => PI * scene_radius * scene_radius,
        };
        luminance(self.intensity.to_array()) * solid_angle
    }

    /// Where its light comes from and goes; `None` for one infinitely far away.
    pub fn bounds(&self) -> Option<LightBounds> {
        let (position, axis, normals_rad, emission_rad) = match self.kind {
            Kind::Directional { .. } => return None,
            Kind::Point(position) => (position, Vec3::Z, PI, 0.5 * PI),
            Kind::Spot { position, axis, scale, offset } => {
                let inner = poly::acos(((1.0 - offset) / scale).clamp(-1.0, 1.0));
                let outer = poly::acos((-offset / scale).clamp(-1.0, 1.0));
                // A little wider, for rounding.
                (position, axis, inner, (outer - inner + 1e-3).min(0.5 * PI))
            }
        };
        let weight = luminance(self.intensity.to_array());
        Some(LightBounds { bounds: Bounds3::of([position]), weight, axis, normals_rad, emission_rad })
    }

    /// What arrives at `reference`.
    #[inline]
    pub fn sample(&self, reference: Vec3) -> LightSample {
        let (position, attenuation) = match self.kind {
            Kind::Directional { to_light } => {
                return LightSample {
                    wi: to_light,
                    target: Vec3::ZERO,
                    is_infinite: true,
                    is_delta: true,
                    radiance: self.intensity,
                    pdf_solid_angle: 1.0,
                };
            }
            Kind::Point(position) => (position, 1.0),
            Kind::Spot { position, axis, scale, offset } => {
                let cosine = (reference - position).normalize_or_zero().dot(axis);
                let a = (cosine * scale + offset).clamp(0.0, 1.0);
                (position, a * a)
            }
        };
        let to_light = position - reference;
        let distance_squared = to_light.length_squared();
        if attenuation <= 0.0 || distance_squared <= 0.0 {
            return LightSample::NONE;
        }
        LightSample {
            wi: to_light / distance_squared.sqrt(),
            target: position,
            is_infinite: false,
            is_delta: true,
            radiance: self.intensity * (attenuation / distance_squared),
            pdf_solid_angle: 1.0,
        }
    }
}
