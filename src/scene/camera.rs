//! Cameras: projections, thin lens, panoramas.

use super::geometry::Keyframes;
use crate::math::{DAffine3, DMat3, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Projection of a camera.
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
    /// Panoramic and fisheye projections.
    Panorama(Panorama),
}

/// Depth of field by a thin lens. The lens of a panoramic camera is perpendicular to each view direction, and its focus
/// surface is a sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinLens {
    /// Full angle of the cone from a point on the focus plane to the edge of the lens, radians. The lens radius is
    /// `focus_distance * tan(defocus_angle_rad / 2)`.
    pub defocus_angle_rad: f64,
    /// Distance from the lens to the focus plane, metres.
    pub focus_distance: f64,
    /// Shape of the aperture; round for panoramas.
    pub aperture: Aperture,
}

/// Shape of the aperture, which determines the bokeh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aperture {
    /// Number of blades, 3 to 256: a regular polygon inscribed in the lens; 0 for a round aperture.
    pub blades: u32,
    /// Rotation of the polygon, counter-clockwise as seen from behind the camera, radians; at 0 the centre of a side is on the
    /// right.
    pub rotation_rad: f64,
    /// Height over width: 2 for anamorphic lenses. The lens radius is that of the height.
    pub ratio: f64,
}

impl Default for Aperture {
    /// Round.
    fn default() -> Aperture {
        Aperture { blades: 0, rotation_rad: 0.0, ratio: 1.0 }
    }
}

/// A camera; it looks along its local -z axis with y up.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name, for selection and reports.
    pub name: String,
    /// Rotation and translation (loaders remove scale).
    pub world_from_camera: DAffine3,
    /// Projection.
    pub projection: Projection,
    /// Aspect ratio (width over height) stored in the file; used if the picture's size isn't given in full.
    pub aspect_ratio: Option<f64>,
    /// Width over height of a pixel, 0.001 to 1000. The vertical field of view is kept; must be 1 for panoramas.
    pub pixel_aspect: f64,
    /// Depth of field; `None` for a pinhole.
    pub lens: Option<ThinLens>,
    /// Lens shift to the right and up, in picture heights; vertical lines stay parallel.
    pub shift: [f64; 2],
    /// Near and far clip distances of camera rays, metres: from the camera plane, or for panoramas from the camera; `None` for no clipping.
    /// Clipped surfaces still cast shadows and are visible in mirrors.
    pub clip: Option<[f64; 2]>,
    /// Transforms at other times, if the camera moves.
    pub motion: Option<Keyframes<DAffine3>>,
}

/// The transform of a camera at `eye` that looks at `target`; `None` if both coincide or `up` is parallel to the view.
pub fn looking_at(eye: DVec3, target: DVec3, up: DVec3) -> Option<DAffine3> {
    let back = (eye - target).try_normalize()?;
    let right = up.cross(back).try_normalize()?;
    Some(DAffine3::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), eye))
}

/// The rotation and translation of a transform: axes orthonormalised in the order z, y, x, right-handed. `None` for
/// singular transforms.
pub fn without_scale(transform: &DAffine3) -> Option<DAffine3> {
    let m = transform.matrix3;
    let z = m.z_axis.try_normalize()?;
    let y = (m.y_axis - z * m.y_axis.dot(z)).try_normalize()?;
    let rotation = DMat3::from_cols(y.cross(z), y, z);
    let placed = DAffine3::from_mat3_translation(rotation, transform.translation);
    placed.is_finite().then_some(placed)
}

/// Panoramic projections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Panorama {
    /// Longitude along x, latitude along y.
    Equirectangular {
        /// Longitude at the left and right edge, radians, -pi to pi; 0 is forward, positive to the right.
        longitude_rad: [f64; 2],
        /// Latitude at the lower and upper edge, radians, -pi/2 to pi/2; 0 is the camera's horizon.
        latitude_rad: [f64; 2],
    },
    /// A circle, or an ellipse inscribed in the picture: the angle with the axis is proportional to the radius.
    FisheyeEquidistant {
        /// Full angle of view, radians, above 0 and at most 2 pi; black outside.
        fov_rad: f64,
    },
    /// Equal-area fisheye: the radius is `2 focal_length sin(angle / 2)`, and all pixels have equal solid angles. A sensor of
    /// four focal lengths shows all directions, as a mirror ball.
    FisheyeEquisolid {
        /// Full angle of view, radians, above 0 and at most 2 pi; black outside.
        fov_rad: f64,
        /// Focal length, millimetres.
        focal_length: f64,
        /// Width and height of the sensor, millimetres.
        sensor: [f64; 2],
    },
}

impl Panorama {
    /// All directions.
    pub const ALL_AROUND: Panorama =
        Panorama::Equirectangular { longitude_rad: [-PI, PI], latitude_rad: [-FRAC_PI_2, FRAC_PI_2] };

    /// Name of the projection in files.
    pub fn name(&self) -> &'static str {
        match self {
            Panorama::Equirectangular { .. } => "equirectangular",
            Panorama::FisheyeEquidistant { .. } => "fisheye_equidistant",
            Panorama::FisheyeEquisolid { .. } => "fisheye_equisolid",
        }
    }

    /// Width over height of a picture without distortion at its centre.
    pub fn aspect_ratio(&self) -> f64 {
        match self {
            Panorama::Equirectangular { longitude_rad: [left, right], latitude_rad: [low, high] } => {
                (right - left) / (high - low)
            }
            Panorama::FisheyeEquidistant { .. } => 1.0,
            Panorama::FisheyeEquisolid { sensor: [width, height], .. } => width / height,
        }
    }

    /// Full angle from the lower to the upper edge of the picture, radians, at most the angle of view.
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
