//! Cameras that move while the shutter is open.

use super::Camera;
use crate::math::{Vec3, segment};
use std::sync::Arc;

/// A camera at equal steps of time; between two of them the corners of its picture move along straight lines.
#[derive(Clone, Debug)]
pub struct MovingCamera(Arc<[Camera]>);

impl MovingCamera {
    /// From what it is at each step, two or more.
    pub fn new(keys: impl Iterator<Item = Camera>) -> MovingCamera {
        MovingCamera(keys.collect())
    }

    /// The camera at a time in 0..1.
    #[inline]
    pub fn at(&self, time: f32) -> Camera {
        let (key, share) = segment(self.0.len(), time);
        let (from, to) = (&self.0[key], &self.0[(key + 1).min(self.0.len() - 1)]);
        let mix = |a: Vec3, b: Vec3| a + (b - a) * share;
        Camera {
            origin: mix(from.origin, to.origin),
            corner: mix(from.corner, to.corner),
            step_x: mix(from.step_x, to.step_x),
            step_y: mix(from.step_y, to.step_y),
            forward: mix(from.forward, to.forward),
            right: mix(from.right, to.right),
            up: mix(from.up, to.up),
            ..*from
        }
    }
}
