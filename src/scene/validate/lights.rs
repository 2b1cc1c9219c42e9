//! Checks of lights, the environment, light groups and cameras.

use super::findings::{DECODED, Entry, Findings};
use crate::math::{DAffine3, DQuat, DVec3};
use crate::scene::{
    Aperture, Backdrop, Camera, Environment, LightKind, Panorama, Projection, Scene, is_group_name,
};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::mem::discriminant;
use std::ops::RangeInclusive;

pub(super) fn check_lights(scene: &Scene, findings: &mut Findings) {
    for (index, light) in scene.lights.iter().enumerate() {
        let place = Entry { list: "lights", index, name: &light.name };
        findings.require_color(&light.intensity, place, "intensity");
        check_kind(&light.kind, place, findings);
        let is_profiled = matches!(light.kind, LightKind::Profiled { .. });
        let is_valid = match &light.profile {
            Some(profile) => is_profiled && profile.is_valid(),
            None => !is_profiled,
        };
        findings.require(
            is_valid,
            place,
            "profile",
            light.profile.is_some(),
            "a valid one if the kind is Profiled, and none otherwise",
        );
        let Some(moving) = &light.motion else { continue };
        let is_same = moving.all().all(|key| discriminant(key) == discriminant(&light.kind));
        findings.require(is_same, place, "motion", moving.keys.len(), "lights of the same kind");
        moving.all().for_each(|kind| check_kind(kind, place, findings));
    }
    for (index, profile) in scene.profiles.iter().enumerate() {
        let place = Entry { list: "profiles", index, name: "" };
        findings.require(profile.is_valid(), place, "values", profile.values.len(), "a valid profile");
    }
}

fn check_kind(kind: &LightKind, place: Entry, findings: &mut Findings) {
    match *kind {
        LightKind::Point { position } => check_position(position, place, findings),
        LightKind::Spot { position, direction, inner_angle_rad, outer_angle_rad, .. } => {
            check_position(position, place, findings);
            check_direction(direction, place, findings);
            let (inner, outer) = (inner_angle_rad, outer_angle_rad);
            let is_cone = outer > 0.0 && outer <= PI;
            findings.require(is_cone, place, "outer_angle_rad", outer, "above 0 and at most pi");
            // Only one problem if the outer angle is invalid.
            let is_inside = (0.0..=if is_cone { outer } else { PI }).contains(&inner);
            findings.require(is_inside, place, "inner_angle_rad", inner, "from 0 to the outer angle");
        }
        LightKind::Profiled { position, rotation, cone } => {
            check_position(position, place, findings);
            check_profile_cone(rotation, cone, place, findings);
        }
        LightKind::Directional { direction } => check_direction(direction, place, findings),
        LightKind::Sun { direction, angle_rad } => {
            check_direction(direction, place, findings);
            let is_valid = (MIN_SUN_RAD..=PI).contains(&angle_rad);
            findings.require(is_valid, place, "angle_rad", angle_rad, "from 1e-5 to pi");
        }
    }
}

/// Checks the rotation and cone of a profile.
pub(super) fn check_profile_cone(
    rotation: DQuat,
    cone: Option<[f64; 2]>,
    place: Entry,
    findings: &mut Findings,
) {
    findings.require(rotation.is_normalized(), place, "rotation", rotation, "a unit quaternion");
    let [inner, outer] = cone.unwrap_or([0.0, 1.0]);
    let is_cone = 0.0 <= inner && inner <= outer && outer > 0.0 && outer <= PI;
    findings.require(is_cone, place, "cone", outer, "0 <= inner <= outer <= pi, with an outer angle above 0");
}

/// Smaller suns suffer from rounding errors, and look like directional lights.
const MIN_SUN_RAD: f64 = 1e-5;

fn check_position(position: DVec3, place: Entry, findings: &mut Findings) {
    findings.require(position.is_finite(), place, "position", position, "finite");
}

fn check_direction(direction: DVec3, place: Entry, findings: &mut Findings) {
    let is_valid = direction.try_normalize().is_some();
    findings.require(is_valid, place, "direction", direction, "a finite vector other than 0");
}

// The environment.

/// Maximum number of texels of an environment image: its sampling tables have 32-bit indices.
const MAX_TEXELS: u64 = 1 << 29;

/// Maximum distance of portals from the origin, and length of their edges, metres.
const MAX_DISTANCE: f64 = 1e18;

const PLACE: &str = "environment";

pub(super) fn check_environment(scene: &Scene, findings: &mut Findings) {
    if let Some(Backdrop::Color(rgb)) = &scene.backdrop {
        findings.require_color(rgb, "backdrop", "Color");
    }
    if let Some(sun) = scene.environment_sun {
        let kind = scene.lights.get(sun as usize).map(|light| light.kind);
        let is_valid = matches!(kind, Some(LightKind::Sun { .. }));
        findings.require(is_valid, PLACE, "sun", sun, "one of the scene's lights, a sun");
    }
    for (index, portal) in scene.portals.iter().enumerate() {
        let place = Entry { list: "portals", index, name: &portal.name };
        let [u, v] = [portal.edge_u, portal.edge_v];
        let is_finite = portal.corner.is_finite() && portal.corner.length() < MAX_DISTANCE;
        findings.require(is_finite, place, "corner", portal.corner, "a finite point");
        let is_rectangle = [u, v].iter().all(|e| (1e-9..MAX_DISTANCE).contains(&e.length()))
            && u.normalize_or_zero().dot(v.normalize_or_zero()).abs() < 1e-3;
        let allowed = "perpendicular and longer than 0";
        findings.require(is_rectangle, place, "edge_u, edge_v", [u, v], allowed);
    }
    check_radiance(scene, &scene.environment, PLACE, findings);
    if let Some(environment) = &scene.camera_environment {
        check_radiance(scene, environment, "camera_environment", findings);
    }
}

fn check_radiance(scene: &Scene, environment: &Environment, place: &'static str, findings: &mut Findings) {
    match environment {
        Environment::Black => {}
        Environment::Constant(rgb) => findings.require_color(rgb, place, "Constant"),
        Environment::Gradient { nadir, zenith } => {
            findings.require_color(nadir, place, "nadir");
            findings.require_color(zenith, place, "zenith");
        }
        Environment::Image { image, strength, rotation_rad } => {
            let is_valid = strength.is_finite() && *strength >= 0.0;
            findings.require(is_valid, place, "strength", strength, "a finite number from 0 up");
            let is_valid = rotation_rad.is_finite();
            findings.require(is_valid, place, "rotation_rad", rotation_rad, "a finite number");
            let Some(map) = scene.images.get(image.index()) else {
                return findings.reject(place, "image", image, "one of the scene's images");
            };
            let texels = u64::from(map.width) * u64::from(map.height);
            let is_valid = texels <= MAX_TEXELS;
            findings.require(is_valid, place, "texels of the image", texels, "at most 2^29");
            findings.require(!map.is_encoded(), place, "pixels of the image", "encoded", DECODED);
        }
    }
}

// Light groups, whose names are used in channel names.

/// Maximum number of light groups.
const MAX_GROUPS: usize = 1 << 15;

pub(super) fn check_groups(scene: &Scene, findings: &mut Findings) {
    let groups = scene.light_groups();
    for name in &groups {
        let allowed = "1 to 64 letters, digits, _ and -";
        findings.require(is_group_name(name), "light groups", "name", name, allowed);
    }
    findings.require(groups.len() <= MAX_GROUPS, "light groups", "number", groups.len(), "at most 32768");
}

// Cameras.

/// Whether it is a valid camera transform.
fn is_camera_transform(m: &DAffine3) -> bool {
    let axes = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|axis| axis.try_normalize());
    match axes {
        // By the angles between the axes: cameras may have any scale.
        [Some(x), Some(y), Some(z)] => m.translation.is_finite() && x.cross(y).dot(z).abs() > 1e-9,
        _ => false,
    }
}

pub(super) fn check_camera(camera: &Camera, index: usize, findings: &mut Findings) {
    let place = Entry { list: "cameras", index, name: &camera.name };
    let m = &camera.world_from_camera;
    let allowed = "finite, with three linearly independent axes";
    findings.require(is_camera_transform(m), place, "world_from_camera", m, allowed);
    if let Some(moving) = &camera.motion {
        let is_valid = moving.all().all(is_camera_transform);
        findings.require(is_valid, place, "motion", moving.keys.len(), allowed);
    }
    match camera.projection {
        Projection::Perspective { vfov_rad } => {
            let is_valid = vfov_rad > 0.0 && vfov_rad < PI;
            findings.require(is_valid, place, "vfov_rad", vfov_rad, "above 0 and below pi");
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

/// Checks pixel aspect, shift and clipping.
fn check_frame(camera: &Camera, place: Entry, findings: &mut Findings) {
    let pixel = camera.pixel_aspect;
    let is_square = pixel == 1.0 || !matches!(camera.projection, Projection::Panorama(_));
    let is_valid = PIXEL_ASPECTS.contains(&pixel) && is_square;
    findings.require(is_valid, place, "pixel_aspect", pixel, "from 0.001 to 1000, and 1 for a panorama");
    let [x, y] = camera.shift;
    let is_valid = x.abs() <= MAX_SHIFT && y.abs() <= MAX_SHIFT;
    findings.require(is_valid, place, "shift", camera.shift, "at most 1000 picture heights");
    if let Some([near, far]) = camera.clip {
        let is_valid = near >= 0.0 && far > near && far <= MAX_FOCUS;
        findings.require(
            is_valid,
            place,
            "clip",
            [near, far],
            "two distances from 0 to 1e18, the second above the first",
        );
    }
}

fn check_lens(camera: &Camera, place: Entry, findings: &mut Findings) {
    let Some(lens) = camera.lens else { return };
    let angle = lens.defocus_angle_rad;
    let is_valid = (0.0..PI).contains(&angle);
    findings.require(is_valid, place, "defocus_angle_rad", angle, "from 0 to below pi");
    let distance = lens.focus_distance;
    let is_valid = distance > 0.0 && distance <= MAX_FOCUS;
    findings.require(is_valid, place, "focus_distance", distance, "above 0 and at most 1e18");
    let Aperture { blades, rotation_rad, ratio } = lens.aperture;
    let is_valid = blades == 0 || (3..=MAX_BLADES).contains(&blades);
    findings.require(is_valid, place, "blades", blades, "0, or from 3 to 256");
    findings.require(rotation_rad.is_finite(), place, "rotation_rad", rotation_rad, "finite");
    let is_valid = (1e-3..=1e3).contains(&ratio);
    findings.require(is_valid, place, "ratio", ratio, "from 0.001 to 1000");
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

fn check_panorama(panorama: &Panorama, place: Entry, findings: &mut Findings) {
    match *panorama {
        Panorama::Equirectangular { longitude_rad, latitude_rad } => {
            for (field, [from, to], most, allowed) in [
                ("longitude_rad", longitude_rad, PI, "increasing, from -pi to pi"),
                ("latitude_rad", latitude_rad, FRAC_PI_2, "increasing, from -pi/2 to pi/2"),
            ] {
                let is_valid = -most <= from && to <= most && to - from >= MIN_ANGLE;
                findings.require(is_valid, place, field, [from, to], allowed);
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

fn check_fov(fov_rad: f64, place: Entry, findings: &mut Findings) {
    let is_valid = (MIN_ANGLE..=TAU).contains(&fov_rad);
    findings.require(is_valid, place, "fov_rad", fov_rad, "above 0 and at most 2 pi");
}

/// Minimum field of view of a panorama, radians.
const MIN_ANGLE: f64 = 1e-5;

/// Maximum number of aperture blades.
const MAX_BLADES: u32 = 256;

/// Range of pixel aspect ratios (width over height).
const PIXEL_ASPECTS: RangeInclusive<f64> = 1e-3..=1e3;

/// Maximum shift in picture heights.
const MAX_SHIFT: f64 = 1e3;

/// Maximum focus and clipping distance, metres.
const MAX_FOCUS: f64 = 1e18;
