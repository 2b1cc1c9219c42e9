//! Cameras: projections, thin lens, panoramas.

use super::geometry::Keyframes;
use crate::math::{DAffine3, DMat3, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// How points in front of the camera map to the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole with a vertical field of view.
    Perspective {
        /// Full vertical angle of view, radians, above 0 and below pi.
        vfov_rad: f64,
    },
    /// Parallel rays.
    Orthographic {
        /// Half the visible height, metres.
        half_height: f64,
    },
    /// All around, or much of it.
    Panorama(Panorama),
}

/// Depth of field by a thin lens. The lens of a panoramic camera faces each point of its picture, and what is in focus is a sphere
/// around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinLens {
    /// Full angle of the cone from a point on the focus plane to the lens's edge, radians. The lens's radius is
    /// `focus_distance * tan(defocus_angle_rad / 2)`.
    pub defocus_angle_rad: f64,
    /// Distance from the lens to the plane of perfect focus, metres.
    pub focus_distance: f64,
    /// The shape of its opening; round for panoramas.
    pub aperture: Aperture,
}

/// The opening of a lens, which is the shape of lights out of focus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aperture {
    /// How many blades bound it: a regular polygon whose corners lie on the lens's edge, of 3 to 256 of them; 0 is round.
    pub blades: u32,
    /// Turns the polygon counter-clockwise, seen from behind the camera, radians; without, the middle of a side lies to the
    /// right.
    pub rotation_rad: f64,
    /// Height over width: lenses for wide screens have openings of 2. The lens's edge is that of its height.
    pub ratio: f64,
}

impl Default for Aperture {
    /// Round.
    fn default() -> Aperture {
        Aperture { blades: 0, rotation_rad: 0.0, ratio: 1.0 }
    }
}

/// A camera; it looks down its own -z with y up.
#[derive(Clone, Debug)]
pub struct Camera {
    /// For choosing and reports.
    pub name: String,
    /// Placement: rotation and translation (scale is removed by loaders).
    pub world_from_camera: DAffine3,
    /// Its projection.
    pub projection: Projection,
    /// Width over height, if the file says so; used when the picture's size isn't given in full.
    pub aspect_ratio: Option<f64>,
    /// Width over height of a pixel, from 0.001 to 1000: 1, or that of television and anamorphic pictures. The view's height is kept;
    /// 1 of panoramas.
    pub pixel_aspect: f64,
    /// Depth of field; `None` is a pinhole.
    pub lens: Option<ThinLens>,
    /// How far the picture is moved to the right and up in its plane, in heights of the picture: the camera sees more of
    /// that side, and upright lines stay parallel.
    pub shift: [f64; 2],
    /// Distances from its plane (of panoramas from itself), metres, between which it sees things; all of them without. What lies
    /// outside still casts shadows and is seen in mirrors.
    pub clip: Option<[f64; 2]>,
    /// Its placement at other times, if it moves while the picture is taken.
    pub motion: Option<Keyframes<DAffine3>>,
}

/// Placement of a camera at `eye` that looks at `target`; `None` where the two coincide or `up` points along the view.
pub fn looking_at(eye: DVec3, target: DVec3, up: DVec3) -> Option<DAffine3> {
    let back = (eye - target).try_normalize()?;
    let right = up.cross(back).try_normalize()?;
    Some(DAffine3::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), eye))
}

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
