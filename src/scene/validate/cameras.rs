//! Cameras.

use super::findings::{Findings, Place};
use crate::math::DAffine3;
use crate::scene::{Aperture, Camera, Panorama, Projection};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::RangeInclusive;

/// May a camera stand so?
fn is_placed(m: &DAffine3) -> bool {
    let axes = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|axis| axis.try_normalize());
    match axes {
        // Compared by angles: cameras may have any scale.
        [Some(x), Some(y), Some(z)] => m.translation.is_finite() && x.cross(y).dot(z).abs() > 1e-9,
        _ => false,
    }
}

pub(super) fn check(camera: &Camera, index: usize, findings: &mut Findings) {
    let place = Place { list: "cameras", index, name: &camera.name };
    let m = &camera.world_from_camera;
    let allowed = "finite, with three axes that lie in no plane";
    findings.require(is_placed(m), place, "world_from_camera", m, allowed);
    if let Some(moving) = &camera.motion {
        let is_met = moving.all().all(is_placed);
        findings.require(is_met, place, "motion", moving.keys.len(), allowed);
    }
    match camera.projection {
        Projection::Perspective { vfov_rad } => {
            let is_met = vfov_rad > 0.0 && vfov_rad < PI;
            findings.require(is_met, place, "vfov_rad", vfov_rad, "above 0 and below pi");
        }
        Projection::Orthographic { half_height } => {
            findings.require_length(half_height, place, "half_height", half_height);
        }
        Projection::Panorama(panorama) => check_panorama(&panorama, place, findings),
    }
    if let Some(aspect) = camera.aspect_ratio {
        findings.require_length(aspect, place, "aspect_ratio", aspect);
    }
    check_frame(camera, place, findings);
    check_lens(camera, place, findings);
}

/// What of the scene the picture shows.
fn check_frame(camera: &Camera, place: Place, findings: &mut Findings) {
    let pixel = camera.pixel_aspect;
    let is_square = pixel == 1.0 || !matches!(camera.projection, Projection::Panorama(_));
    let is_met = PIXELS.contains(&pixel) && is_square;
    findings.require(is_met, place, "pixel_aspect", pixel, "from 0.001 to 1000, and 1 for a panorama");
    let [x, y] = camera.shift;
    let is_met = x.abs() <= FARTHEST_SHIFT && y.abs() <= FARTHEST_SHIFT;
    findings.require(is_met, place, "shift", camera.shift, "at most 1000 heights of the picture");
    if let Some([near, far]) = camera.clip {
        let is_met = near >= 0.0 && far > near && far <= FARTHEST_FOCUS;
        findings.require(
            is_met,
            place,
            "clip",
            [near, far],
            "two distances from 0 to 1e18, the second beyond the first",
        );
    }
}

fn check_lens(camera: &Camera, place: Place, findings: &mut Findings) {
    let Some(lens) = camera.lens else { return };
    let angle = lens.defocus_angle_rad;
    let is_met = (0.0..PI).contains(&angle);
    findings.require(is_met, place, "defocus_angle_rad", angle, "from 0 to below pi");
    let distance = lens.focus_distance;
    let is_met = distance > 0.0 && distance <= FARTHEST_FOCUS;
    findings.require(is_met, place, "focus_distance", distance, "above 0 and at most 1e18");
    let Aperture { blades, rotation_rad, ratio } = lens.aperture;
    let is_met = blades == 0 || (3..=MOST_BLADES).contains(&blades);
    findings.require(is_met, place, "blades", blades, "0, or from 3 to 256");
    findings.require(rotation_rad.is_finite(), place, "rotation_rad", rotation_rad, "finite");
    let is_met = (1e-3..=1e3).contains(&ratio);
    findings.require(is_met, place, "ratio", ratio, "from 0.001 to 1000");
    if matches!(camera.projection, Projection::Panorama(_)) {
        findings.require(
            blades == 0 && ratio == 1.0,
            place,
            "aperture",
            lens.aperture,
            "round for a panorama",
        );
    }
}

fn check_panorama(panorama: &Panorama, place: Place, findings: &mut Findings) {
    match *panorama {
        Panorama::Equirectangular { longitude_rad, latitude_rad } => {
            for (field, [from, to], most, allowed) in [
                ("longitude_rad", longitude_rad, PI, "growing, from -pi to pi"),
                ("latitude_rad", latitude_rad, FRAC_PI_2, "growing, from -pi/2 to pi/2"),
            ] {
                let is_met = -most <= from && to <= most && to - from >= LEAST_ANGLE;
                findings.require(is_met, place, field, [from, to], allowed);
            }
        }
        Panorama::FisheyeEquidistant { fov_rad } => check_fov(fov_rad, place, findings),
        Panorama::FisheyeEquisolid { fov_rad, focal_length, sensor: [width, height] } => {
            check_fov(fov_rad, place, findings);
            findings.require_length(focal_length, place, "focal_length", focal_length);
            findings.require_length(width, place, "sensor", width);
            findings.require_length(height, place, "sensor", height);
        }
    }
}

fn check_fov(fov_rad: f64, place: Place, findings: &mut Findings) {
    let is_met = (LEAST_ANGLE..=TAU).contains(&fov_rad);
    findings.require(is_met, place, "fov_rad", fov_rad, "above 0 and at most 2 pi");
}

/// Narrowest view of a panorama, radians.
const LEAST_ANGLE: f64 = 1e-5;

/// Of more, an opening is round.
const MOST_BLADES: u32 = 256;

/// Width over height of pixels.
const PIXELS: RangeInclusive<f64> = 1e-3..=1e3;

/// Largest shift, in heights of the picture.
const FARTHEST_SHIFT: f64 = 1e3;

/// Nothing is seen beyond, metres.
const FARTHEST_FOCUS: f64 = 1e18;
