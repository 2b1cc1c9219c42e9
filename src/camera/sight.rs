//! How a camera sees a point.

use crate::math::Vec3;

/// How a point of the scene is seen through a point of the lens.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Where on the film, in pixels from the top left corner.
    pub film: [f32; 2],
    /// The point of the lens, or of an orthographic camera's plane: where the ray of the camera starts.
    pub lens: Vec3,
    /// Unit vector from the point to there.
    pub direction: Vec3,
    /// How far it is.
    pub distance: f32,
    /// Film area, in square pixels, that a surface of one square metre at the point covers if it faces the ray. Times the
    /// filter of a pixel and the radiance along the ray it is the density per area of what the pixel shows.
    pub pixels_per_area: f32,
}
