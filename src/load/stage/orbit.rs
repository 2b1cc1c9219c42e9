//! A camera that goes around a model.

use crate::math::{DAffine3, DQuat, DVec3};
use crate::scene::{Camera, Environment, Scene};

/// What frames of a turntable turn about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Turntable {
    /// A point of the vertical axis.
    middle: DVec3,
    /// The stage's light goes with the camera, as if the model turned.
    turns_light: bool,
}

impl Turntable {
    /// About the vertical axis through a point.
    pub fn new(middle: DVec3, turns_light: bool) -> Turntable {
        Turntable { middle, turns_light }
    }

    /// The middle of what is turned.
    pub fn middle(&self) -> DVec3 {
        self.middle
    }

    /// The camera after an angle, radians, counter-clockwise seen from above. It stands still there.
    pub fn camera(&self, camera: &Camera, angle_rad: f64) -> Camera {
        let turn = DAffine3::from_translation(self.middle)
            * DAffine3::from_quat(DQuat::from_rotation_y(angle_rad))
            * DAffine3::from_translation(-self.middle);
        Camera { world_from_camera: turn * camera.world_from_camera, motion: None, ..camera.clone() }
    }

    /// Sets the stage's light for the same angle.
    pub fn light(&self, scene: &mut Scene, angle_rad: f64) {
        if let Environment::Image { rotation_rad, .. } = &mut scene.environment
            && self.turns_light
        {
            *rotation_rad = angle_rad;
        }
    }
}
