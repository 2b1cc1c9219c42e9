//! The cones of spot lights.

use crate::math::{DVec3, Vec3, poly};
use crate::scene::SpotFade;
use std::f32::consts::PI;

/// A cone that fades towards its edge: attenuation is `fade` of scale * cos + offset, clamped to 0..1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Which way it goes, unit length.
    pub axis: Vec3,
    scale: f32,
    offset: f32,
    fade: SpotFade,
}

impl Cone {
    /// The same about another axis, of unit length.
    pub fn about(self, axis: Vec3) -> Cone {
        Cone { axis, ..self }
    }

    /// A cone about an axis between two half angles, radians.
    pub fn new(direction: DVec3, inner_angle_rad: f64, outer_angle_rad: f64, fade: SpotFade) -> Cone {
        let range = match fade {
            // KHR_lights_punctual, "Inner and Outer Cone Angles".
            SpotFade::Square => inner_angle_rad.cos() - outer_angle_rad.cos(),
            SpotFade::Smooth => (1.0 - outer_angle_rad.cos()) * (1.0 - inner_angle_rad / outer_angle_rad),
        };
        let scale = 1.0 / range.max(1e-3);
        Cone {
            axis: direction.normalize().as_vec3(),
            scale: scale as f32,
            offset: (-outer_angle_rad.cos() * scale) as f32,
            fade,
        }
    }

    /// What is left of the light at an angle of this cosine to the axis.
    #[inline(always)]
    pub fn attenuation(&self, cosine: f32) -> f32 {
        let a = (cosine * self.scale + self.offset).clamp(0.0, 1.0);
        match self.fade {
            SpotFade::Square => a * a,
            SpotFade::Smooth => a * a * (3.0 - 2.0 * a),
        }
    }

    /// The solid angle of the cone: half lit on average between the two angles, where cos = (1 - 2 offset) / (2 scale).
    pub fn solid_angle(&self) -> f32 {
        2.0 * PI * (1.0 - (0.5 - self.offset) / self.scale).clamp(1e-4, 2.0)
    }

    /// The angles between which it fades, radians.
    pub fn angles_rad(&self) -> [f32; 2] {
        let angle = |cosine: f32| poly::acos(cosine.clamp(-1.0, 1.0));
        [angle((1.0 - self.offset) / self.scale), angle(-self.offset / self.scale)]
    }
}
