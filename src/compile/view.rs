//! A camera's view of a compiled scene: all that depends on the camera, made in no time.

use super::scene::CompiledScene;
use crate::camera::{Camera, MovingCamera, ndc_from_world};
use crate::error::{Error, ErrorKind, Problem, Result};
use crate::math::{DMat4, gamma};
use crate::scene::{self, Scene};

/// A camera and the size of its picture, for a [`CompiledScene`].
#[derive(Clone, Debug)]
pub struct View {
    /// Camera rays, in the compiled scene's coordinates.
    pub camera: Camera,
    /// The same while the shutter is open, if it moves then.
    pub moving: Option<MovingCamera>,
    /// The same a frame before and a frame after, where that is known.
    pub neighbours: [Camera; 2],
    /// Picture width in pixels.
    pub width: u32,
    /// Picture height in pixels.
    pub height: u32,
    /// Width over height of a pixel.
    pub pixel_aspect: f64,
    /// From the scene's world to the camera's own space.
    pub camera_from_world: DMat4,
    /// From there to normalized device coordinates; panoramas have no such matrix.
    pub ndc_from_world: Option<DMat4>,
}

impl View {
    /// The view of a camera on a picture of `width` x `height` pixels. Takes no time to speak of: nothing is built.
    pub fn new(compiled: &CompiledScene, camera: &scene::Camera, width: u32, height: u32) -> View {
        let at = |world_from_camera| {
            let camera = scene::Camera { world_from_camera, ..camera.clone() };
            Camera::new(&camera, width, height, compiled.anchor)
        };
        let motion = camera.motion.as_ref();
        let blurring = motion.filter(|m| m.blurs());
        let neighbours = motion.and_then(|m| m.neighbours).unwrap_or([camera.world_from_camera; 2]);
        View {
            moving: blurring.map(|m| MovingCamera::new(m.keys.iter().copied().map(at))),
            neighbours: neighbours.map(at),
            camera: at(camera.world_from_camera),
            width,
            height,
            pixel_aspect: camera.pixel_aspect,
            camera_from_world: DMat4::from(camera.world_from_camera.inverse()),
            ndc_from_world: ndc_from_world(camera, width, height),
        }
    }

    /// Is single precision too coarse where the camera stands, so that the scene should be compiled around an anchor near
    /// it?
    ///
    /// Coordinates near a camera that is D away from the anchor are rounded by up to 2^-24 D, and points of surfaces,
    /// from which paths go on, lie within [`gamma`]`(7)` D, about 7 times as much, of where they should. That may be a
    /// quarter of a pixel at the nearest surface: with pixels of a thousandth of the distance, D may be 600 times the
    /// distance of the nearest surface.
    pub fn needs_new_anchor(&self, compiled: &CompiledScene) -> bool {
        let position = self.camera.position();
        let (width, spread) = self.camera.pixel_cone();
        let displacement = gamma(7) * position.length();
        let pixel = |distance: f32| 2.0 * (width + spread * distance);
        // NaN counts as too coarse.
        let suits = |distance: f32| displacement <= 0.25 * pixel(distance);
        displacement != 0.0 && !suits(compiled.accel.distance(position))
    }
}

/// The scene's camera of an index; the first without one.
///
/// # Errors
/// A usage error for a camera that does not exist, an input error for a scene without a camera.
pub fn choose_camera(scene: &Scene, index: Option<usize>) -> Result<&scene::Camera> {
    scene.cameras.get(index.unwrap_or(0)).ok_or_else(|| match index {
        Some(i) => Error::usage(format!("there is no camera {i}: the scene has {}", scene.cameras.len())),
        None => {
            let problems = vec![Problem::new("", "the scene has no camera")];
            Error { kind: ErrorKind::Input, file: None, problems, source_text: None }
        }
    })
}
