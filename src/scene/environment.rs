//! The environment: what rays that hit nothing see, its sun, and portals.

use super::ImageId;
use crate::image::Image;
use crate::math::DVec3;

/// The environment, infinitely far away.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Environment {
    /// Nothing: black.
    #[default]
    Black,
    /// The same radiance from all directions.
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

/// A rectangle, such as a window, through which light of the environment is looked for. It is no surface, hides nothing and lets
/// no more light in than there is: it only makes rooms less noisy. It serves what lies in front of it, on the side of
/// `edge_u` x `edge_v`.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// For reports.
    pub name: String,
    /// One corner.
    pub corner: DVec3,
    /// To the next corner.
    pub edge_u: DVec3,
    /// To the corner before, at right angles to the other edge.
    pub edge_v: DVec3,
}
