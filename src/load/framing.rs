//! What bare assets lack: a camera that sees the whole model, and light.

use super::Loaded;
use crate::error::{Choice, Warning};
use crate::math::{DAffine3, DVec3};
use crate::scene::{
    Camera, Environment, Extent, Projection, Scene, instance_extents, looking_at, scene_extent,
};

/// Full vertical field of view of the default camera, degrees.
const VFOV_DEGREES: f64 = 40.0;

/// Models with coordinates beyond this can't be framed: squares of them would be infinite.
const FARTHEST: f64 = 1e150;

/// Radiance of the default sky straight down and straight up. The mean over the sphere of a blend linear in y is that
/// of the two: (0.560, 0.6, 0.640), a luminance of 0.59. It is dark below, so that pale models stand out from what is
/// behind them when they are seen from above, and have a lit and a shaded side. Faces that look straight up reflect
/// (0.6 + 0.54 * 2 / 3) = 0.96 times their albedo: white ones are not burnt out in a PNG.
const DEFAULT_SKY: ([f32; 3], [f32; 3]) = ([0.064, 0.06, 0.056], [1.056, 1.14, 1.224]);

/// Adds a camera that frames the model where the scene has none, and a soft sky where nothing lights it (unless the
/// caller brings an environment); each with a warning that says so. Parts that shine light a scene with a camera; a model
/// without one is to be looked at, and is lit by the sky, too.
pub fn complete(loaded: &mut Loaded, brings_environment: bool) {
    let scene = &mut loaded.scene;
    if scene.instances.is_empty() && scene.shapes.is_empty() && scene.quads.is_empty() {
        let message = "there is nothing to see: no triangles, quads or other shapes";
        loaded.warnings.push(Warning::general(message));
    }
    let is_bare = scene.cameras.is_empty();
    if is_bare {
        scene.cameras.push(framing_camera(scene));
        let message =
            "no camera: the whole model is shown from the front, right and above, field of view 40 degrees";
        loaded.warnings.push(Warning::general(message));
    }
    // A black environment that a scene file asks for is a choice, and stays.
    let has_lamps = scene.environment != Environment::Black || !scene.lights.is_empty();
    if brings_environment || has_lamps {
        return;
    }
    let message = match has_shining_parts(scene) {
        false => "no light: lit by a soft default sky of mean radiance 0.6".to_string(),
        true if is_bare => format!(
            "no light but parts that shine: lit by a soft default sky of mean radiance 0.6, too ({} for none)",
            Choice::Environment
        ),
        true => return,
    };
    let (nadir, zenith) = DEFAULT_SKY;
    scene.environment = Environment::Gradient { nadir, zenith };
    loaded.warnings.push(Warning::general(message));
}

/// Does any part of the scene shine? Materials count only where something uses them.
fn has_shining_parts(scene: &Scene) -> bool {
    let shines = |id: crate::scene::MaterialId| {
        scene
            .materials
            .get(id.index())
            .and_then(|m| m.emission)
            .is_some_and(|e| e.radiance.factor != [0.0; 3])
    };
    scene.shapes.iter().any(|s| shines(s.material))
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
        .filter(|(min, max)| min.abs().max(max.abs()).max_element() < FARTHEST)
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
    let towards = DVec3::new(1.0, 0.7, 1.6).normalize();
    let eye = center + towards * distance;
    // So far from the origin that the eye's distance is lost in rounding, the direction is all there is.
    let world_from_camera = looking_at(eye, center, DVec3::Y).or_else(|| {
        let turned = looking_at(towards, DVec3::ZERO, DVec3::Y)?;
        Some(DAffine3 { translation: eye, ..turned })
    });
    Camera {
        name: "default".to_string(),
        world_from_camera: world_from_camera.unwrap_or(DAffine3::from_translation(eye)),
        projection: Projection::Perspective { vfov_rad },
        aspect_ratio: None,
        lens: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::DQuat;
    use crate::scene::{Material, MaterialId, Shape, ShapeKind};

    fn ball(center: DVec3, radius: f64, material: Material) -> Loaded {
        let mut loaded = Loaded::default();
        loaded.scene.materials.push(material);
        let rotation = DQuat::IDENTITY;
        loaded.scene.shapes.push(Shape {
            name: "ball".into(),
            kind: ShapeKind::Sphere,
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
    fn parts_that_shine_light_scenes_but_not_bare_models() {
        let shining = || ball(DVec3::ZERO, 1.0, Material::emitter("lamp", [1.0; 3], false));
        let mut scene = shining();
        scene.scene.cameras.push(framing_camera(&scene.scene));
        complete(&mut scene, false);
        assert_eq!((scene.scene.environment, scene.warnings.len()), (Environment::Black, 0));
        let mut bare = shining();
        complete(&mut bare, false);
        assert!(matches!(bare.scene.environment, Environment::Gradient { .. }));
        let said: Vec<String> = bare.warnings.iter().map(ToString::to_string).collect();
        assert!(said.len() == 2 && said[1].contains("parts that shine"), "{said:?}");
        let mut without = shining();
        complete(&mut without, true);
        assert_eq!((without.scene.environment, without.warnings.len()), (Environment::Black, 1));
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
