//! Options that override the placement, projection, lens and shutter of the scene's camera.

use super::parsers::{integer, named, number};
use clap::Args;
use clap::builder::TypedValueParser;
use oscura::error::{Error, Result};
use oscura::load::{Loaded, MAX_SHUTTER_FRAMES, ShutterOptions, ShutterPosition};
use oscura::math::DVec3;
use oscura::scene::{Aperture, Camera, Projection, ThinLens};

/// Default focus distance without `--target`, metres.
const DEFAULT_FOCUS: f64 = 10.0;

#[derive(Args, Clone, Debug, Default)]
pub(crate) struct CameraArgs {
    /// Camera position X,Y,Z, metres.
    #[arg(long, value_name = "X,Y,Z", conflicts_with = "orbit", allow_hyphen_values = true, value_parser = point)]
    pub eye: Option<DVec3>,
    /// Look-at point X,Y,Z, metres; y is up [default: the centre of the scene].
    #[arg(long, value_name = "X,Y,Z", requires = "eye", allow_hyphen_values = true, value_parser = point)]
    pub target: Option<DVec3>,
    /// Height of the view of an orthographic camera, metres.
    #[arg(long, value_name = "M", value_parser = positive, allow_negative_numbers = true)]
    pub view_height: Option<f64>,
    /// Focus distance, metres.
    #[arg(long, value_name = "M", value_parser = positive, allow_negative_numbers = true)]
    pub focus: Option<f64>,
    /// Aperture of the thin lens: angle of its diameter seen from a point in focus, degrees; 0 is a pinhole camera.
    #[arg(long, value_name = "DEG", value_parser = defocus, allow_negative_numbers = true)]
    pub defocus: Option<f64>,
}

impl CameraArgs {
    /// Changes one of a scene's cameras. `fov`: vertical field of view, degrees; `center`: the default target.
    ///
    /// # Errors
    /// A usage error if eye and target coincide, or if an option doesn't fit the camera's projection.
    pub fn apply(
        &self,
        loaded: &mut Loaded,
        number: usize,
        fov: Option<f64>,
        center: impl Fn(&Loaded) -> DVec3,
    ) -> Result<()> {
        let target = self.eye.map(|_| self.target.unwrap_or_else(|| center(loaded)));
        let Some(camera) = loaded.scene.cameras.get_mut(number) else { return Ok(()) };
        if let Some((eye, target)) = self.eye.zip(target) {
            if eye == target {
                return Err(self.coincident_error());
            }
            camera.world_from_camera = Camera::look_at(eye, target, 30.0).world_from_camera;
            camera.motion = None;
        }
        match (&mut camera.projection, fov, self.view_height) {
            (_, None, None) => {}
            (Projection::Perspective { vfov_rad }, Some(fov), None) => *vfov_rad = fov.to_radians(),
            (Projection::Orthographic { half_height }, None, Some(height)) => *half_height = 0.5 * height,
            (Projection::Panorama(_), ..) => {
                let message =
                    format!("--fov and --view-height have no effect on '{}', a panorama", camera.name);
                return Err(Error::usage(message)
                    .with_help("set 'longitude' and 'latitude' or 'fov' in the scene file"));
            }
            (Projection::Perspective { .. }, ..) => {
                let message = format!(
                    "--view-height is for orthographic cameras, but '{}' is a perspective camera",
                    camera.name
                );
                return Err(Error::usage(message).with_help("use --fov"));
            }
            (Projection::Orthographic { .. }, ..) => {
                let message = format!("--fov has no effect on '{}', an orthographic camera", camera.name);
                return Err(Error::usage(message).with_help("use --view-height"));
            }
        }
        self.apply_lens(camera, target);
        Ok(())
    }

    /// The error for coincident eye and target.
    fn coincident_error(&self) -> Error {
        match self.target {
            Some(_) => Error::usage("--eye and --target are the same point"),
            None => Error::usage("--eye is the centre of the scene, which is also the default target")
                .with_help("set another --target"),
        }
    }

    fn apply_lens(&self, camera: &mut Camera, target: Option<DVec3>) {
        if self.focus.is_none() && self.defocus.is_none() {
            return;
        }
        let target = self.eye.zip(target).map(|(eye, target)| eye.distance(target));
        let pinhole = ThinLens {
            defocus_angle_rad: 0.0,
            focus_distance: target.unwrap_or(DEFAULT_FOCUS),
            aperture: Aperture::default(),
        };
        let mut lens = camera.lens.unwrap_or(pinhole);
        lens.focus_distance = self.focus.unwrap_or(lens.focus_distance);
        lens.defocus_angle_rad = self.defocus.map_or(lens.defocus_angle_rad, f64::to_radians);
        camera.lens = Some(lens).filter(|lens| lens.defocus_angle_rad > 0.0);
    }
}

/// Three comma-separated numbers.
fn point(text: &str) -> std::result::Result<DVec3, String> {
    let numbers: Vec<f64> =
        text.split(',').filter_map(|n| n.trim().parse().ok()).filter(|n: &f64| n.is_finite()).collect();
    match numbers[..] {
        [x, y, z] if text.split(',').count() == 3 => Ok(DVec3::new(x, y, z)),
        _ => Err("must be three numbers such as 1.5,0,-2".to_string()),
    }
}

fn positive(text: &str) -> std::result::Result<f64, String> {
    number(text, |v| (1e-6..=1e12).contains(&v), "a number of metres from 0.000001 to 1e12")
}

fn defocus(text: &str) -> std::result::Result<f64, String> {
    number(text, |v| (0.0..=90.0).contains(&v), "a number of degrees from 0 to 90")
}

/// Options of motion blur.
#[derive(Args, Clone, Debug)]
pub(crate) struct ShutterArgs {
    /// Motion blur: shutter time in frames [default: the scene's, else 0].
    #[arg(long, value_name = "FRAMES", value_parser = frames, allow_negative_numbers = true)]
    pub shutter: Option<f64>,
    /// Shutter position: open from the frame's time on (start), around it (centre) or until it (end) [default: the
    /// scene's, else centre].
    #[arg(long, value_name = "WHEN", value_parser = position(), hide_possible_values = true)]
    pub shutter_position: Option<ShutterPosition>,
    /// Motion blur steps: number of times at which moving objects are evaluated while the shutter is open, 2 or more
    /// [default: as many as their motion needs, at most 65].
    #[arg(long, value_name = "N", value_parser = integer::<u32>(2, 1000), allow_negative_numbers = true)]
    pub motion_keys: Option<u32>,
}

impl ShutterArgs {
    /// Options for the loader. `fps`: frame rate, frames per second; `vectors`: also sample the neighbour frames, for motion
    /// vectors.
    pub fn options(&self, fps: f64, vectors: bool) -> ShutterOptions {
        let ShutterArgs { shutter, shutter_position, motion_keys } = *self;
        ShutterOptions { frames: shutter, position: shutter_position, fps, keys: motion_keys, vectors }
    }
}

fn frames(text: &str) -> std::result::Result<f64, String> {
    number(text, |v| (0.0..=MAX_SHUTTER_FRAMES).contains(&v), "a number of frames from 0 to 1000")
}

fn position() -> impl TypedValueParser<Value = ShutterPosition> {
    named(&ShutterPosition::ALL, ShutterPosition::name, |_| "")
}

#[cfg(test)]
mod tests {
    use super::*;
    use oscura::scene::Scene;

    fn scene(camera: Camera) -> Loaded {
        let mut scene = Scene::default();
        scene.cameras.push(camera);
        scene.into()
    }

    #[test]
    fn points_are_three_numbers() {
        assert_eq!(point("1.5,0,-2"), Ok(DVec3::new(1.5, 0.0, -2.0)));
        for wrong in ["1,2", "1,2,3,4", "1,a,3", "1,,2,3", "1,2,inf", ""] {
            assert!(point(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn only_given_options_change_the_camera() {
        let own = Camera::look_at([0.0, 1.0, 5.0], [0.0; 3], 40.0);
        let mut scene = scene(own.clone());
        CameraArgs::default().apply(&mut scene, 0, None, |_| DVec3::Y).unwrap();
        assert_eq!(scene.scene.cameras[0].world_from_camera, own.world_from_camera);
        assert!(scene.scene.cameras[0].lens.is_none());
        let aimed = CameraArgs {
            eye: Some(DVec3::new(3.0, 0.0, 0.0)),
            target: Some(DVec3::ZERO),
            defocus: Some(2.0),
            ..CameraArgs::default()
        };
        aimed.apply(&mut scene, 0, None, |_| DVec3::Y).unwrap();
        let camera = &scene.scene.cameras[0];
        assert_eq!(camera.world_from_camera.translation, DVec3::new(3.0, 0.0, 0.0));
        assert_eq!(camera.projection, own.projection);
        assert_eq!(camera.lens.unwrap().focus_distance, 3.0);
        // Without a target, the camera is aimed at the centre.
        let placed = CameraArgs { eye: Some(DVec3::new(0.0, 1.0, 4.0)), ..CameraArgs::default() };
        placed.apply(&mut scene, 0, None, |_| DVec3::Y).unwrap();
        let back = scene.scene.cameras[0].world_from_camera.matrix3.z_axis;
        assert!(back.distance(DVec3::Z) < 1e-12, "{back}");
        let inside = CameraArgs { eye: Some(DVec3::Y), ..CameraArgs::default() };
        let error = inside.apply(&mut scene, 0, None, |_| DVec3::Y).unwrap_err();
        assert!(error.to_string().contains("--target"), "{error}");
    }

    #[test]
    fn a_field_of_view_needs_a_perspective() {
        let parallel = Camera {
            projection: Projection::Orthographic { half_height: 2.0 },
            ..Camera::look_at([0.0, 0.0, 5.0], [0.0; 3], 30.0)
        };
        let mut scene = scene(parallel);
        assert!(CameraArgs::default().apply(&mut scene, 0, Some(30.0), |_| DVec3::Y).is_err());
        let args = CameraArgs { view_height: Some(6.0), ..CameraArgs::default() };
        args.apply(&mut scene, 0, None, |_| DVec3::Y).unwrap();
        assert_eq!(scene.scene.cameras[0].projection, Projection::Orthographic { half_height: 3.0 });
    }
}
