//! What bare assets lack: a camera that sees the whole model, and light.

use super::Loaded;
use crate::error::Warning;
use crate::math::{DAffine3, DMat3, DVec3};
use crate::scene::{Camera, Environment, Extent, Projection, Scene, instance_extents, scene_extent};

/// Full vertical field of view of the default camera, degrees.
const VFOV_DEGREES: f64 = 40.0;

/// Radiance of the default sky straight down and straight up. The mean over the sphere of a blend linear in y is that
/// of the two: (0.934, 1.0, 1.066), a luminance of 0.99. It is dark below, so that pale models stand out from what is
/// behind them when they are seen from above, and have a lit and a shaded side.
const DEFAULT_SKY: ([f32; 3], [f32; 3]) = ([0.107, 0.1, 0.093], [1.761, 1.9, 2.039]);

/// Adds a camera that frames the model where the scene has none, and a soft sky where nothing in it shines (unless the
/// caller brings an environment); each with a warning that says so.
pub fn complete(loaded: &mut Loaded, brings_environment: bool) {
    let scene = &mut loaded.scene;
    if scene.cameras.is_empty() {
        scene.cameras.push(framing_camera(scene));
        let message =
            "no camera: the whole model is shown from the front, right and above, field of view 40 degrees";
        loaded.warnings.push(Warning::general(message));
    }
    if !brings_environment && !has_light(scene) {
        let (nadir, zenith) = DEFAULT_SKY;
        scene.environment = Environment::Gradient { nadir, zenith };
        loaded.warnings.push(Warning::general("no light: lit by a soft default sky of mean radiance 1"));
    }
}

/// Does anything in the scene shine? Materials count only where something uses them.
fn has_light(scene: &Scene) -> bool {
    let shines = |id: crate::scene::MaterialId| {
        scene
            .materials
            .get(id.index())
            .and_then(|m| m.emission)
            .is_some_and(|e| e.radiance.factor != [0.0; 3])
    };
    // A black environment that a scene file asks for is a choice, and stays.
    scene.environment != Environment::Black
        || !scene.lights.is_empty()
        || scene.spheres.iter().any(|s| shines(s.material))
        || scene.quads.iter().any(|q| shines(q.material))
        || scene.instances.iter().any(|i| match i.material {
            Some(material) => shines(material),
            None => {
                scene.meshes.get(i.mesh.index()).is_some_and(|m| m.parts.iter().any(|p| shines(p.material)))
            }
        })
}

/// A camera in the direction (1, 0.7, 1.6) from the model's middle, far enough for its bounding sphere to fit.
fn framing_camera(scene: &Scene) -> Camera {
    let Extent(bounds) = scene_extent(scene, &instance_extents(scene));
    let (min, max) = bounds
        .filter(|(min, max)| min.is_finite() && max.is_finite())
        .unwrap_or((DVec3::splat(-1.0), DVec3::splat(1.0)));
    let center = (min + max) * 0.5;
    let radius = ((max - min).length() * 0.5).max(1e-6);
    let vfov_rad = VFOV_DEGREES.to_radians();
    // The narrower angle decides; a portrait picture sees `aspect` of the width that the height shows.
    let settings = &scene.settings;
    let aspect = match (settings.width, settings.height) {
        (Some(w), Some(h)) if w > 0 && h > 0 => f64::from(w) / f64::from(h),
        _ => 1.0,
    };
    let half_angle = ((vfov_rad / 2.0).tan() * aspect.min(1.0)).atan();
    let distance = 1.02 * radius / half_angle.sin();
    let eye = center + DVec3::new(1.0, 0.7, 1.6).normalize() * distance;
    Camera {
        name: "default".to_string(),
        world_from_camera: looking_at(eye, center, DVec3::Y),
        projection: Projection::Perspective { vfov_rad },
        aspect_ratio: None,
        lens: None,
    }
}

/// Placement of a camera at `eye` that looks at `target`. The three must not lie on a line.
pub(super) fn looking_at(eye: DVec3, target: DVec3, up: DVec3) -> DAffine3 {
    let back = (eye - target).normalize();
    let right = up.cross(back).normalize();
    DAffine3::from_mat3_translation(DMat3::from_cols(right, back.cross(right), back), eye)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DQuat;
    use crate::scene::{Material, MaterialId, Sphere};

    fn ball(center: DVec3, radius: f64, material: Material) -> Loaded {
        let mut loaded = Loaded::default();
        loaded.scene.materials.push(material);
        let rotation = DQuat::IDENTITY;
        loaded.scene.spheres.push(Sphere {
            name: "ball".into(),
            center,
            radius,
            rotation,
            material: MaterialId(0),
        });
        loaded
    }

    #[test]
    fn the_whole_model_is_in_view_and_lit() {
        let (center, radius) = (DVec3::new(100.0, -3.0, 7.0), 2.0);
        let mut loaded = ball(center, radius, Material::lambert("grey", [0.5; 3]));
        complete(&mut loaded, false);
        assert_eq!(loaded.warnings.len(), 2);
        let camera = &loaded.scene.cameras[0];
        let seen = camera.world_from_camera.inverse().transform_point3(center);
        assert!(seen.x.abs() < 1e-9 && seen.y.abs() < 1e-9 && seen.z < 0.0);
        assert!((radius / -seen.z).asin() < 20f64.to_radians());
        assert!(matches!(loaded.scene.environment, Environment::Gradient { .. }));
    }

    #[test]
    fn what_shines_needs_no_sky() {
        let mut loaded = ball(DVec3::ZERO, 1.0, Material::emitter("lamp", [1.0; 3], false));
        complete(&mut loaded, false);
        assert_eq!(loaded.scene.environment, Environment::Black);
        assert_eq!(loaded.warnings.len(), 1);
    }

    #[test]
    fn a_caller_with_an_environment_gets_no_sky() {
        let mut loaded = ball(DVec3::ZERO, 1.0, Material::lambert("grey", [0.5; 3]));
        complete(&mut loaded, true);
        assert_eq!(loaded.scene.environment, Environment::Black);
        assert_eq!(loaded.warnings.len(), 1, "{:?}", loaded.warnings);
    }

    #[test]
    fn an_empty_scene_gets_a_finite_camera() {
        let mut loaded = Loaded::default();
        complete(&mut loaded, false);
        assert!(loaded.scene.cameras[0].world_from_camera.is_finite());
    }
}
