//! The camera of the page: orbit, pan, dolly and lens.

use crate::cli::camera_args::CameraArgs;
use oscura::math::{DAffine3, DVec3};
use oscura::scene::{Aperture, Camera, Projection, ThinLens};
use std::f64::consts::{FRAC_PI_2, PI};

/// Minimum angle between the view direction and the vertical, radians: at the poles the up vector is undefined.
const MIN_POLE_ANGLE: f64 = 0.002;

/// A camera that can be moved.
#[derive(Clone, Debug)]
pub(crate) struct Pose {
    camera: Camera,
    /// Centre of the orbit, on the camera's axis.
    target: DVec3,
    is_moved: bool,
    is_lens_changed: bool,
    /// The height of an orthographic view was changed.
    is_zoomed: bool,
    given: Given,
}

/// Camera options on the command line, to be repeated in the command that renders the view.
#[derive(Clone, Copy, Debug, Default)]
struct Given {
    eye: bool,
    height: bool,
    lens: bool,
    /// Vertical field of view, degrees.
    fov: Option<f64>,
}

/// A camera movement.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Move {
    /// Around the target, radians: to the right and up.
    pub orbit: [f64; 2],
    /// Translation in picture heights at the target's distance: to the right and up.
    pub pan: [f64; 2],
    /// Factor on the distance to the target.
    pub dolly: Option<f64>,
}

impl Pose {
    /// A scene's camera; `distance` to the target, metres.
    pub fn new(camera: Camera, distance: f64) -> Pose {
        let target = camera.world_from_camera.translation + distance * forward(&camera);
        let given = Given::default();
        Pose { camera, target, is_moved: false, is_lens_changed: false, is_zoomed: false, given }
    }

    /// Takes the target of the camera options, and remembers the given options. `fov`: vertical, degrees.
    #[must_use]
    pub fn with_arguments(self, args: &CameraArgs, fov: Option<f64>) -> Pose {
        let given = Given {
            eye: args.eye.is_some(),
            height: args.view_height.is_some(),
            lens: args.focus.or(args.defocus).is_some(),
            fov,
        };
        Pose { target: args.target.unwrap_or(self.target), given, ..self }
    }

    /// Whether the camera was moved or its lens changed.
    pub fn is_changed(&self) -> bool {
        self.is_moved || self.is_lens_changed
    }

    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Applies a movement; ignores values that aren't finite.
    pub fn apply(&mut self, step: Move) {
        let numbers = step.orbit.iter().chain(&step.pan).chain(&step.dolly);
        if !numbers.clone().all(|v| v.is_finite()) || step == Move::default() {
            return;
        }
        let eye = self.camera.world_from_camera.translation;
        let offset = eye - self.target;
        let distance = offset.length().max(1e-9);
        // Spherical coordinates of the direction from the target to the camera.
        let azimuth = offset.x.atan2(offset.z) + step.orbit[0] % (2.0 * PI);
        let highest = FRAC_PI_2 - MIN_POLE_ANGLE;
        let elevation =
            ((offset.y / distance).clamp(-1.0, 1.0).asin() + step.orbit[1]).clamp(-highest, highest);
        let back =
            DVec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
        let right = DVec3::Y.cross(back).normalize();
        let up = back.cross(right);
        let factor = step.dolly.unwrap_or(1.0).clamp(0.05, 20.0);
        let height = self.visible_height(distance);
        let is_orthographic = matches!(self.camera.projection, Projection::Orthographic { .. });
        self.target += height * (step.pan[0] * right + step.pan[1] * up);
        let distance = if is_orthographic { distance } else { (distance * factor).clamp(1e-6, 1e9) };
        if let Projection::Orthographic { half_height } = &mut self.camera.projection {
            *half_height = (*half_height * factor).clamp(1e-6, 1e9);
            self.is_zoomed |= factor != 1.0;
        }
        let rotation = oscura::math::DMat3::from_cols(right, up, back);
        self.camera.world_from_camera =
            DAffine3::from_mat3_translation(rotation, self.target + distance * back);
        // An animation doesn't apply to the new placement.
        self.camera.motion = None;
        self.is_moved = true;
    }

    /// Visible height at a distance, metres.
    fn visible_height(&self, distance: f64) -> f64 {
        match self.camera.projection {
            Projection::Perspective { vfov_rad } => 2.0 * distance * (0.5 * vfov_rad).tan(),
            Projection::Orthographic { half_height } => 2.0 * half_height,
            // The scale near the centre of the picture.
            Projection::Panorama(panorama) => 2.0 * distance * (0.5 * panorama.height_rad().min(2.0)).tan(),
        }
    }

    /// Moves the target to a distance from the camera, metres.
    pub fn set_target_distance(&mut self, distance: f64) {
        if distance.is_finite() && distance > 0.0 {
            self.target = self.camera.world_from_camera.translation + distance * forward(&self.camera);
        }
    }

    /// Focuses at a distance, metres.
    pub fn focus(&mut self, distance: f64) {
        self.change_lens(|lens| lens.focus_distance = distance);
    }

    /// Sets the angle of the lens's diameter seen from a point in focus, degrees; 0 is a pinhole.
    pub fn set_defocus(&mut self, degrees: f64) {
        self.change_lens(|lens| lens.defocus_angle_rad = degrees.clamp(0.0, 90.0).to_radians());
    }

    fn change_lens(&mut self, change: impl FnOnce(&mut ThinLens)) {
        let eye = self.camera.world_from_camera.translation;
        let mut lens = self.camera.lens.unwrap_or(ThinLens {
            defocus_angle_rad: 0.0,
            focus_distance: eye.distance(self.target),
            aperture: Aperture::default(),
        });
        change(&mut lens);
        self.camera.lens = Some(lens);
        self.is_lens_changed = true;
    }

    /// The angle of the lens's diameter seen from a point in focus, degrees.
    pub fn defocus(&self) -> f64 {
        self.camera.lens.map_or(0.0, |lens| lens.defocus_angle_rad.to_degrees())
    }

    /// The camera for rendering, without a lens of angle 0.
    pub fn for_rendering(&self) -> Camera {
        let mut camera = self.camera.clone();
        camera.lens = camera.lens.filter(|lens| lens.defocus_angle_rad > 0.0);
        camera
    }

    /// The arguments of `oscura render` for this camera.
    pub fn arguments(&self) -> Vec<String> {
        let point = |p: DVec3| format!("{},{},{}", short(p.x), short(p.y), short(p.z));
        let mut arguments = Vec::new();
        let mut add = |option: &str, value: String| arguments.extend([option.to_string(), value]);
        if self.is_moved || self.given.eye {
            add("--eye", point(self.camera.world_from_camera.translation));
            add("--target", point(self.target));
        }
        if let Some(degrees) = self.given.fov {
            add("--fov", degrees.to_string());
        }
        let has_height = self.is_zoomed || self.given.height;
        if let (Projection::Orthographic { half_height }, true) = (self.camera.projection, has_height) {
            add("--view-height", short(2.0 * half_height));
        }
        match (self.camera.lens, self.is_lens_changed || self.given.lens) {
            (_, false) => {}
            (Some(lens), true) => {
                add("--focus", short(lens.focus_distance));
                add("--defocus", short(lens.defocus_angle_rad.to_degrees()));
            }
            (None, true) => add("--defocus", "0".to_string()),
        }
        arguments
    }
}

fn forward(camera: &Camera) -> DVec3 {
    camera.world_from_camera.transform_vector3(DVec3::NEG_Z)
}

/// A number with seven significant digits.
fn short(v: f64) -> String {
    let digits = if v == 0.0 { 0 } else { (6 - v.abs().log10().floor() as i32).clamp(0, 12) };
    let text = format!("{v:.*}", digits as usize);
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose() -> Pose {
        Pose::new(Camera::look_at([0.0, 0.0, 5.0], [0.0; 3], 30.0), 5.0)
    }

    #[test]
    fn orbits_keep_the_distance_and_stop_at_the_poles() {
        let mut pose = pose();
        pose.apply(Move { orbit: [FRAC_PI_2, 0.0], ..Move::default() });
        let eye = pose.camera.world_from_camera.translation;
        assert!(eye.distance(DVec3::new(5.0, 0.0, 0.0)) < 1e-12, "{eye}");
        pose.apply(Move { orbit: [0.3, 9.0], ..Move::default() });
        let eye = pose.camera.world_from_camera.translation;
        assert!((eye.length() - 5.0).abs() < 1e-12 && eye.y > 4.99 && eye.y < 5.0);
        assert!((forward(&pose.camera) + eye / 5.0).length() < 1e-12, "the target stays on the axis");
    }

    #[test]
    fn pans_are_in_picture_heights_and_dollies_are_factors() {
        let mut pose = pose();
        pose.apply(Move { pan: [1.0, 0.0], dolly: Some(0.5), ..Move::default() });
        let width = 10.0 * 15f64.to_radians().tan();
        assert!((pose.target.x - width).abs() < 1e-12);
        let eye = pose.camera.world_from_camera.translation;
        assert!(eye.distance(pose.target + DVec3::Z * 2.5) < 1e-12);
        let before = pose.camera.world_from_camera;
        pose.apply(Move { pan: [f64::NAN, 0.0], ..Move::default() });
        assert_eq!(pose.camera.world_from_camera, before);
    }

    #[test]
    fn arguments_describe_changes_and_given_options() {
        let mut pose = pose();
        assert!(pose.arguments().is_empty());
        pose.apply(Move { dolly: Some(2.0), ..Move::default() });
        pose.set_defocus(1.5);
        let messages = pose.arguments().join(" ");
        assert_eq!(messages, "--eye 0,0,10 --target 0,0,0 --focus 10 --defocus 1.5");
        let place = CameraArgs { view_height: Some(3.0), defocus: Some(0.0), ..CameraArgs::default() };
        let mut orthographic = pose.camera.clone();
        orthographic.projection = Projection::Orthographic { half_height: 1.5 };
        orthographic.lens = None;
        let mut given = Pose::new(orthographic, 5.0).with_arguments(&place, None);
        assert_eq!(given.arguments().join(" "), "--view-height 3 --defocus 0");
        given.apply(Move { dolly: Some(0.5), ..Move::default() });
        let messages = given.arguments();
        assert_eq!(messages.iter().filter(|word| *word == "--view-height").count(), 1, "{messages:?}");
        assert_eq!([short(0.0), short(-1234567.89), short(1.0 / 3.0)], ["0", "-1234568", "0.3333333"]);
    }
}
