//! An environment and the sun that belongs to it, changed together.

use super::{Environment, LightKind, Scene};
use crate::math::DQuat;

impl Scene {
    /// Turns an environment's picture, what cameras see instead and the sun that belongs to it, to an angle. Others have no angle.
    pub fn turn_environment(&mut self, to_rad: f64) {
        let Environment::Image { rotation_rad, .. } = &mut self.environment else { return };
        let by = DQuat::from_rotation_y(to_rad - *rotation_rad);
        if let Some(Environment::Image { rotation_rad: seen, .. }) = &mut self.camera_environment {
            *seen += to_rad - *rotation_rad;
        }
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
