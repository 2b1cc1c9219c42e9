//! Lights without a surface.

use crate::math::DVec3;

/// A light without a surface (KHR_lights_punctual).
#[derive(Clone, Debug)]
pub struct Light {
    /// For reports.
    pub name: String,
    /// Its kind, with position and direction in world space.
    pub kind: LightKind,
    /// Linear RGB: radiant intensity (W/sr) of point and spot lights, irradiance (W/m2) of directional ones.
    pub intensity: [f32; 3],
}

/// Kinds of lights without a surface. Directions have unit length and point the way the light travels.
#[derive(Clone, Copy, Debug)]
pub enum LightKind {
    /// Shines equally in all directions.
    Point {
        /// Where it is.
        position: DVec3,
    },
    /// A cone that fades between two half angles.
    Spot {
        /// Where it is.
        position: DVec3,
        /// Its axis.
        direction: DVec3,
        /// Half angle of the fully lit cone, radians.
        inner_angle_rad: f64,
        /// Half angle where it ends, radians.
        outer_angle_rad: f64,
    },
    /// Parallel light from infinitely far.
    Directional {
        /// The way the light travels.
        direction: DVec3,
    },
}
