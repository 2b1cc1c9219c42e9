//! What is seen where nothing is hit.

use super::{ImageId, LightKind, Scene};
use crate::image::Image;
use crate::math::DQuat;

/// The environment, infinitely far away.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Environment {
    /// Nothing: black.
    #[default]
    Black,
    /// The same radiance from everywhere.
    Constant([f32; 3]),
    /// A vertical blend: `nadir` straight down to `zenith` straight up, linear in the unit direction's y
    /// (the sky of "Ray Tracing in One Weekend").
    Gradient {
        /// Radiance straight down.
        nadir: [f32; 3],
        /// Radiance straight up.
        zenith: [f32; 3],
    },
    /// An equirectangular image: direction d maps to u = 0.5 + atan2(d.z, d.x) / 2 pi, v = acos(d.y) / pi from the top
    /// row, texel centres at (i + 0.5) / width.
    Image {
        /// Which image.
        image: ImageId,
        /// Factor on its values.
        strength: f32,
        /// Turns the environment about the y axis, counter-clockwise seen from above.
        rotation_rad: f64,
    },
}

/// What pictures show where the environment is hidden from cameras and nothing else covers a pixel.
#[derive(Clone, Debug)]
pub enum Backdrop {
    /// A colour, linear Rec. 709.
    Color([f32; 3]),
    /// A picture, scaled evenly to cover the whole frame, its middle in the middle.
    Picture(Image),
}

impl Scene {
    /// Turns an environment's picture, and the sun that belongs to it, to an angle. Others have no angle.
    pub fn turn_environment(&mut self, to_rad: f64) {
        let Environment::Image { rotation_rad, .. } = &mut self.environment else { return };
        let by = DQuat::from_rotation_y(to_rad - *rotation_rad);
        *rotation_rad = to_rad;
        let sun = self.environment_sun.and_then(|sun| self.lights.get_mut(sun as usize));
        if let Some(LightKind::Sun { direction, .. }) = sun.map(|sun| &mut sun.kind) {
            *direction = by * *direction;
        }
    }

    /// Multiplies the light of the environment's sun, if it has one.
    pub fn scale_environment_sun(&mut self, factor: f32) {
        let sun = self.environment_sun.and_then(|sun| self.lights.get_mut(sun as usize));
        if let Some(sun) = sun {
            sun.intensity = sun.intensity.map(|v| v * factor);
        }
    }
}
