//! Lights without a surface.

use super::links::LightLinks;
use super::motion::Moving;
use super::profile::LightProfile;
use super::visibility::RayKinds;
use crate::math::{DQuat, DVec3};
use std::sync::Arc;

/// A light without a surface (KHR_lights_punctual).
#[derive(Clone, Debug)]
pub struct Light {
    /// For reports.
    pub name: String,
    /// Its kind, with position and direction in world space.
    pub kind: LightKind,
    /// Linear RGB: radiant intensity (W/sr) of point and spot lights, irradiance (W/m2) of
    /// directional ones and suns, on a surface that faces them.
    pub intensity: [f32; 3],
    /// What a [`LightKind::Profiled`] sends in which direction, in shares of the intensity.
    pub profile: Option<Arc<LightProfile>>,
    /// Its group, whose light pictures may hold apart; empty for the default one.
    pub group: String,
    /// What it lights, by the kind of ray that it stands for: [`RayKinds::DIFFUSE`] is diffuse reflection and so on.
    pub visible_to: RayKinds,
    /// What it lights, and what casts shadows in its light.
    pub links: LightLinks,
    /// Its kind at other times, if it moves while the picture is taken.
    pub motion: Option<Moving<LightKind>>,
}

/// Kinds of lights without a surface. Directions have unit length and point the way the light travels.
#[derive(Clone, Copy, Debug, PartialEq)]
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
        /// How it fades in between.
        fade: SpotFade,
    },
    /// A point that shines as [`Light::profile`] says.
    Profiled {
        /// Where it is.
        position: DVec3,
        /// Turns the profile into world space: it shines along -z, and its horizontal angles turn from x to y.
        rotation: DQuat,
        /// Half angles, radians, between which a cone about the way it shines fades by a smooth step, if there is one.
        cone: Option<[f64; 2]>,
    },
    /// Parallel light from infinitely far.
    Directional {
        /// The way the light travels.
        direction: DVec3,
    },
    /// A disk infinitely far away, as the sun is. Cameras don't see it; mirrors do.
    Sun {
        /// The way the light of its middle travels.
        direction: DVec3,
        /// Its diameter as an angle, radians, from 1e-5 to pi.
        angle_rad: f64,
    },
}

/// How a spot light fades from its inner cone to its outer one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum SpotFade {
    /// The square of a line in the cosine of the angle, from 1 at the inner cone to 0 at the outer
    /// (KHR_lights_punctual).
    #[default]
    Square,
    /// A smooth step in the cosine of the angle, as Blender fades; the inner cone stands for its blend, which is
    /// 1 - inner / outer of the cone's cap.
    Smooth,
}
