//! Panoramic cameras: they see around themselves.

use std::f64::consts::{FRAC_PI_2, PI};

/// Which of the directions around it a panoramic camera shows where, over the whole of its picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Panorama {
    /// Angles along the picture's edges.
    Equirectangular {
        /// At the left and the right edge, radians, from -pi to pi; 0 is ahead, what lies to the right is above it.
        longitude_rad: [f64; 2],
        /// At the lower and the upper edge, radians, from -pi/2 to pi/2; 0 is the camera's horizon.
        latitude_rad: [f64; 2],
    },
    /// A circle, or an ellipse that fits into the picture: angles with the axis grow evenly from the middle to the edge.
    FisheyeEquidistant {
        /// Full angle of view, radians, above 0 and at most 2 pi. What lies beyond is black.
        fov_rad: f64,
    },
    /// As of real lenses: the distance from the middle is `2 focal_length sin(angle / 2)`, and all parts of the picture see
    /// equal solid angles. With a sensor of four focal lengths it shows all directions, as a mirror ball does.
    FisheyeEquisolid {
        /// Full angle of view, radians, above 0 and at most 2 pi. What lies beyond is black.
        fov_rad: f64,
        /// Focal length, millimetres.
        focal_length: f64,
        /// Width and height of the sensor, millimetres.
        sensor: [f64; 2],
    },
}

impl Panorama {
    /// All that is around.
    pub const ALL_AROUND: Panorama =
        Panorama::Equirectangular { longitude_rad: [-PI, PI], latitude_rad: [-FRAC_PI_2, FRAC_PI_2] };

    /// Its kind in words.
    pub fn name(&self) -> &'static str {
        match self {
            Panorama::Equirectangular { .. } => "equirectangular",
            Panorama::FisheyeEquidistant { .. } => "fisheye_equidistant",
            Panorama::FisheyeEquisolid { .. } => "fisheye_equisolid",
        }
    }

    /// Width over height of a picture without distortion in its middle.
    pub fn aspect_ratio(&self) -> f64 {
        match self {
            Panorama::Equirectangular { longitude_rad: [left, right], latitude_rad: [low, high] } => {
                (right - left) / (high - low)
            }
            Panorama::FisheyeEquidistant { .. } => 1.0,
            Panorama::FisheyeEquisolid { sensor: [width, height], .. } => width / height,
        }
    }

    /// Full angle from the lower to the upper edge of its picture, radians, at most that of view.
    pub fn height_rad(&self) -> f64 {
        match *self {
            Panorama::Equirectangular { latitude_rad: [low, high], .. } => high - low,
            Panorama::FisheyeEquidistant { fov_rad } => fov_rad,
            Panorama::FisheyeEquisolid { fov_rad, focal_length, sensor: [_, height] } => {
                (4.0 * (0.25 * height / focal_length).clamp(-1.0, 1.0).asin()).min(fov_rad)
            }
        }
    }
}
