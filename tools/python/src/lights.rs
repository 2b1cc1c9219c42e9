//! Lights, environments and cameras.

use super::arrays::image;
use super::errors::{raised, usage};
use super::scene::Scene;
use oscura::glam::DVec3;
use oscura::scene::{
    Aperture, Camera, Environment, Light, LightKind, Panorama as Around, Projection, ThinLens, looking_at,
};
use pyo3::prelude::*;
use std::path::PathBuf;

/// An environment image.
#[derive(FromPyObject)]
enum Panorama<'py> {
    File(PathBuf),
    Pixels(Bound<'py, PyAny>),
}

impl Scene {
    fn add_light(&mut self, light: Light, name: &str, group: &str) -> PyResult<()> {
        let (name, group) = (name.to_string(), group.to_string());
        self.scene_mut()?.lights.push(Light { name, group, ..light });
        Ok(())
    }
}

#[pymethods]
impl Scene {
    #[pyo3(signature = (position, intensity, *, name="", group=""))]
    fn add_point_light(
        &mut self,
        position: [f64; 3],
        intensity: [f32; 3],
        name: &str,
        group: &str,
    ) -> PyResult<()> {
        self.add_light(Light::point(position, intensity), name, group)
    }

    #[pyo3(signature = (position, direction, intensity, *, inner_angle=0.0, outer_angle=45.0, name="", group=""))]
    fn add_spot_light(
        &mut self,
        position: [f64; 3],
        direction: [f64; 3],
        intensity: [f32; 3],
        inner_angle: f64,
        outer_angle: f64,
        name: &str,
        group: &str,
    ) -> PyResult<()> {
        let angles = [inner_angle.to_radians(), outer_angle.to_radians()];
        self.add_light(Light::spot(position, direction, angles, intensity), name, group)
    }

    #[pyo3(signature = (direction, irradiance, *, angle=0.0, name="", group=""))]
    fn add_sun(
        &mut self,
        direction: [f64; 3],
        irradiance: [f32; 3],
        angle: f64,
        name: &str,
        group: &str,
    ) -> PyResult<()> {
        let light = match angle == 0.0 {
            true => Light::directional(direction, irradiance),
            false => {
                let direction = DVec3::from(direction).normalize_or(DVec3::NEG_Z);
                Light::new(LightKind::Sun { direction, angle_rad: angle.to_radians() }, irradiance)
            }
        };
        self.add_light(light, name, group)
    }

    /// A constant radiance, a gradient from straight down to straight up, or an image.
    #[pyo3(signature = (*, color=None, nadir=None, zenith=None, image=None, strength=1.0, rotation=0.0))]
    fn set_environment(
        &mut self,
        color: Option<[f32; 3]>,
        nadir: Option<[f32; 3]>,
        zenith: Option<[f32; 3]>,
        image: Option<Panorama<'_>>,
        strength: f32,
        rotation: f64,
    ) -> PyResult<()> {
        let environment = match (color, nadir, zenith, image) {
            (None, None, None, None) => Environment::Black,
            (Some(color), None, None, None) => Environment::Constant(color.map(|c| c * strength)),
            (None, Some(nadir), Some(zenith), None) => Environment::Gradient {
                nadir: nadir.map(|c| c * strength),
                zenith: zenith.map(|c| c * strength),
            },
            (None, None, None, Some(panorama)) => {
                let image = self.panorama(panorama)?;
                let rotation_rad = rotation.to_radians();
                Environment::Image { image, strength, rotation_rad }
            }
            _ => return Err(usage("an environment is a color, or nadir and zenith, or an image")),
        };
        self.scene_mut()?.environment = environment;
        Ok(())
    }

    #[pyo3(signature = (
        eye, target, *, fov=None, height=None, panorama=None, longitude=[-180.0, 180.0], latitude=[-90.0, 90.0],
        fisheye_lens=10.5, sensor=[36.0, 24.0], up=[0.0, 1.0, 0.0], focus=None, defocus=0.0, aspect_ratio=None, name=""
    ))]
    #[expect(clippy::too_many_arguments, reason = "they are named in Python")]
    fn add_camera(
        &mut self,
        eye: [f64; 3],
        target: [f64; 3],
        fov: Option<f64>,
        height: Option<f64>,
        panorama: Option<&str>,
        longitude: [f64; 2],
        latitude: [f64; 2],
        fisheye_lens: f64,
        sensor: [f64; 2],
        up: [f64; 3],
        focus: Option<f64>,
        defocus: f64,
        aspect_ratio: Option<f64>,
        name: &str,
    ) -> PyResult<()> {
        let (eye, target) = (DVec3::from(eye), DVec3::from(target));
        let placed = looking_at(eye, target, up.into());
        let world_from_camera = placed.ok_or_else(|| {
            usage("the camera's eye is its target, or up points along the view (give another up)")
        })?;
        let fov_rad = fov.unwrap_or(180.0).to_radians();
        let projection = match (panorama, height) {
            (Some(_), Some(_)) => return Err(usage("a camera has a panorama or a height, not both")),
            (None, Some(height)) => Projection::Orthographic { half_height: height / 2.0 },
            (None, None) => Projection::Perspective { vfov_rad: fov.unwrap_or(30.0).to_radians() },
            (Some("equirectangular"), None) => Projection::Panorama(Around::Equirectangular {
                longitude_rad: longitude.map(f64::to_radians),
                latitude_rad: latitude.map(f64::to_radians),
            }),
            (Some("fisheye_equidistant"), None) => {
                Projection::Panorama(Around::FisheyeEquidistant { fov_rad })
            }
            (Some("fisheye_equisolid"), None) => {
                Projection::Panorama(Around::FisheyeEquisolid { fov_rad, focal_length: fisheye_lens, sensor })
            }
            (Some(other), None) => {
                let kinds = "equirectangular, fisheye_equidistant or fisheye_equisolid";
                return Err(usage(format!("a panorama is {kinds}, not {other:?}")));
            }
        };
        let of_panorama = match &projection {
            Projection::Panorama(panorama) => Some(panorama.aspect_ratio()),
            _ => None,
        };
        let lens = (defocus > 0.0).then(|| ThinLens {
            defocus_angle_rad: defocus.to_radians(),
            focus_distance: focus.unwrap_or(eye.distance(target)),
            aperture: Aperture::default(),
        });
        let camera = Camera {
            name: name.to_string(),
            world_from_camera,
            projection,
            aspect_ratio: aspect_ratio.or(of_panorama),
            lens,
            ..Camera::look_at(eye, target, 30.0)
        };
        self.scene_mut()?.cameras.push(camera);
        Ok(())
    }
}

impl Scene {
    /// Loads and adds an environment image.
    fn panorama(&mut self, panorama: Panorama<'_>) -> PyResult<oscura::scene::ImageId> {
        let image = match panorama {
            Panorama::File(path) => {
                let warnings = &mut self.loaded_mut()?.warnings;
                oscura::load::image::load_environment(&path, warnings).map_err(raised)?
            }
            Panorama::Pixels(pixels) => image("environment", &pixels, None)?,
        };
        Ok(self.scene_mut()?.add_image(image))
    }
}
