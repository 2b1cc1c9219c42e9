//! Ray visibility of objects and lights, and holdouts.

use crate::support::{assert_radiance, camera, floor, material, mean, options, picture, quad, sphere};
use oscura::math::{DAffine3, DVec3};
use oscura::render::RenderOptions;
use oscura::scene::{
    ColorSlot, Environment, FloatSlot, Keyframes, Light, Material, Model, ObjectTraits, PbrMaterial,
    RayKinds, Scene,
};

const EYE: DVec3 = DVec3::new(-3.0, 1.0, -2.0);

fn seen_by(kinds: &[RayKinds]) -> ObjectTraits {
    let visible_to = kinds.iter().fold(RayKinds::NONE, |sum, kind| sum.with(*kind));
    ObjectTraits { visible_to, ..ObjectTraits::default() }
}

fn unseen_by(kinds: &[RayKinds]) -> ObjectTraits {
    let ObjectTraits { visible_to, .. } = seen_by(kinds);
    ObjectTraits { visible_to: RayKinds::ALL.without(visible_to), ..ObjectTraits::default() }
}

fn grey() -> Material {
    Material::lambert("grey", [0.8; 3])
}

fn with_lamp(mut scene: Scene) -> Scene {
    let lamp = material(&mut scene, Material::emitter("lamp", [2.0; 3], false));
    sphere(&mut scene, [0.0, 3.0, 0.0], 0.5, lamp);
    scene
}

/// A black sheet under the area light or the sky.
fn shaded(mut scene: Scene, sheet: ObjectTraits) -> Scene {
    let black = material(&mut scene, Material::lambert("black", [0.0; 3]));
    quad(&mut scene, [-20.0, 1.5, -20.0], [40.0, 0.0, 0.0], [0.0, 0.0, 40.0], black);
    scene.quads[1].name = "sheet".into();
    scene.set_object_traits("sheet", sheet);
    scene
}

/// Radiance at the middle of the floor due to the light.
const OF_LAMP: f64 = 0.8 * 2.0 * 0.25 / 9.0;

#[test]
fn lights_follow_ray_visibility() {
    for (kinds, truth) in [
        (vec![RayKinds::CAMERA], 1.0),
        (vec![RayKinds::GLOSSY, RayKinds::TRANSMISSION], 1.0),
        (vec![RayKinds::DIFFUSE], 0.0),
    ] {
        let mut scene = with_lamp(floor(grey()));
        scene.set_object_traits("sphere", unseen_by(&kinds));
        let what = format!("a lamp unseen by {kinds:?}");
        assert_radiance(&what, &scene, &options(16, 64, 1), OF_LAMP * truth, 4e-3);
    }
}

/// An environment found by BSDF samples only is occluded by objects visible to these rays, whether they cast shadows or not.
#[test]
fn bsdf_rays_occlude_unsampled_environments() {
    use RayKinds as K;
    for (what, ball, [sampled, found]) in [
        ("a ball that all see", ObjectTraits::default(), [0.75, 0.75]),
        ("a ball without shadow", unseen_by(&[K::SHADOW]), [1.0, 0.75]),
        ("a ball that is a shadow only", seen_by(&[K::SHADOW]), [0.75, 1.0]),
        ("a ball that is in mirrors only", seen_by(&[K::GLOSSY]), [1.0, 1.0]),
    ] {
        let mut scene = Scene { environment: Environment::Constant([1.5; 3]), ..floor(grey()) };
        let black = material(&mut scene, Material::lambert("black", [0.0; 3]));
        sphere(&mut scene, [0.0, 2.0, 0.0], 1.0, black);
        scene.set_object_traits("sphere", ball);
        assert_radiance(what, &scene, &options(16, 64, 2), 0.8 * 1.5 * sampled, 4e-3);
        scene.environment_bsdf_only = true;
        assert_radiance(&format!("{what}, found"), &scene, &options(16, 64, 2), 0.8 * 1.5 * found, 4e-3);
        // With a light for which both techniques agree: above the sphere, or next to it.
        let point = Light::point([30.0, 40.0, 0.0], [2e4; 3]);
        scene.lights.push(point);
        let of_point = 0.8 / std::f64::consts::PI * 2e4 * 0.8 / 2500.0;
        let truth = 0.8 * 1.5 * found + of_point;
        assert_radiance(&format!("{what}, and a lamp"), &scene, &options(16, 64, 2), truth, 4e-3);
    }
}

/// Objects without shadows don't occlude light samples, whichever technique finds the light.
#[test]
fn shadow_visibility_applies_to_diffuse_reflection() {
    use RayKinds as K;
    for (what, sheet, truth) in [
        ("a sheet that all see", ObjectTraits::default(), 0.0),
        ("a sheet without shadow", unseen_by(&[K::SHADOW]), 1.0),
        ("a sheet that is a shadow only", seen_by(&[K::SHADOW]), 0.0),
        ("a sheet that is in mirrors only", seen_by(&[K::GLOSSY]), 1.0),
    ] {
        let lit = shaded(with_lamp(floor(grey())), sheet);
        assert_radiance(what, &lit, &options(16, 64, 2), OF_LAMP * truth, 4e-3);
        let point = Light::point([0.0, 3.0, 0.0], [2.0; 3]);
        let mut lit = shaded(floor(grey()), sheet);
        lit.lights.push(point);
        let of_point = 0.8 / std::f64::consts::PI * 2.0 / 9.0;
        assert_radiance(what, &lit, &options(16, 64, 2), of_point * truth, 4e-3);
        let mut lit = shaded(floor(grey()), sheet);
        lit.environment = Environment::Constant([1.0; 3]);
        // The sheet ends where the sky is near the horizon.
        let film = picture(&lit, &options(16, 256, 2));
        assert!((mean(&film) - 0.8 * truth).abs() < 0.02, "{what}: {} under a sky", mean(&film));
    }
}

/// Rough plastic: diffuse and glossy light add up to the total.
#[test]
fn diffuse_and_glossy_visibility_add_up() {
    let plastic = PbrMaterial {
        base_color: ColorSlot::constant([0.6, 0.3, 0.2]),
        metallic: FloatSlot::constant(0.0),
        roughness: FloatSlot::constant(0.3),
        ..PbrMaterial::default()
    };
    let lit = |kinds: Option<RayKinds>, sheet: Option<ObjectTraits>| {
        let mut scene = floor(Material::gltf("plastic", plastic.clone()));
        let lamp = material(&mut scene, Material::emitter("lamp", [2.0; 3], false));
        sphere(&mut scene, [1.5, 1.0, 1.0], 0.5, lamp);
        if let Some(kind) = kinds {
            scene.set_object_traits("sphere", seen_by(&[kind]));
        }
        sheet.map_or(scene.clone(), |sheet| {
            let black = material(&mut scene, Material::lambert("black", [0.0; 3]));
            quad(&mut scene, [0.5, -1.0, -5.0], [0.0, 9.0, 0.0], [0.0, 0.0, 9.0], black);
            scene.quads[1].name = "sheet".into();
            scene.set_object_traits("sheet", sheet);
            scene
        })
    };
    let of = |scene: &Scene| {
        let options: RenderOptions = options(24, 256, 1);
        mean(&picture(scene, &options))
    };
    let whole = of(&lit(None, None));
    let parts = [RayKinds::DIFFUSE, RayKinds::GLOSSY].map(|kind| of(&lit(Some(kind), None)));
    assert!(parts.iter().all(|part| *part > 0.03 * whole), "{parts:?} of {whole}");
    assert!((parts[0] + parts[1] - whole).abs() < 4e-3 * whole, "{parts:?} of {whole}");
    // Behind a sheet invisible to one ray type, that type's light is left.
    use RayKinds as K;
    for (sheet, left) in [
        (unseen_by(&[K::GLOSSY]), parts[1]),
        (unseen_by(&[K::SHADOW]), parts[0]),
        (unseen_by(&[K::SHADOW, K::GLOSSY]), whole),
        (unseen_by(&[K::DIFFUSE]), 0.0),
    ] {
        let found = of(&lit(None, Some(sheet)));
        assert!((found - left).abs() < 6e-3 * whole, "{sheet:?}: {found}, not {left}, of {whole}");
    }
}

#[test]
fn camera_invisible_objects_keep_alpha() {
    use oscura::scene::AlphaMode;
    let mut scene = shaded(with_lamp(floor(grey())), unseen_by(&[RayKinds::CAMERA, RayKinds::SHADOW]));
    let black = scene.quads[1].material.index();
    scene.materials[black].alpha_mode = AlphaMode::Blend;
    scene.materials[black].alpha = FloatSlot::constant(0.5);
    scene.cameras = vec![camera(DVec3::new(0.1, 2.0, 0.0), DVec3::ZERO, DVec3::X, 1e-3)];
    assert_radiance("a veil that is not seen", &scene, &options(16, 64, 2), OF_LAMP, 4e-3);
}

/// A holdout is a hole in the picture, but visible in mirrors and a light source.
#[test]
fn holdouts() {
    let mut scene = with_lamp(floor(grey()));
    scene.cameras = vec![camera(DVec3::new(0.0, 3.0, 9.0), DVec3::new(0.0, 3.0, 0.0), DVec3::Y, 2.0)];
    scene.set_object_traits("sphere", ObjectTraits { is_holdout: true, ..ObjectTraits::default() });
    let film = picture(&scene, &options(4, 4, 2));
    assert!(film.rgba().iter().all(|pixel| *pixel == [0.0; 4]));
    scene.cameras = vec![camera(EYE, DVec3::ZERO, DVec3::Y, 1e-3)];
    assert_radiance("floor under a holdout", &scene, &options(16, 64, 1), OF_LAMP, 4e-3);
    let (color, roughness) = (ColorSlot::constant([1.0; 3]), FloatSlot::constant(0.0));
    scene.materials[0].model = Model::SchlickMetal { color, roughness };
    let eye = DVec3::new(0.0, 2.0, 0.1);
    scene.cameras = vec![camera(eye, DVec3::ZERO, DVec3::Z, 1e-3)];
    assert_radiance("a holdout in a mirror", &scene, &options(8, 4, 2), 2.0, 1e-3);
}

/// Moving objects keep their ray visibility.
#[test]
fn moving_objects_keep_their_visibility() {
    let moving = |shift: DVec3| Keyframes {
        keys: vec![DAffine3::IDENTITY, DAffine3::from_translation(shift)],
        neighbours: None,
    };
    for (traits, truth) in [(unseen_by(&[RayKinds::CAMERA]), 1.0), (ObjectTraits::default(), 0.0)] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let black = material(&mut scene, Material::lambert("black", [0.0; 3]));
        sphere(&mut scene, [0.0; 3], 1.0, black);
        quad(&mut scene, [-2.0, -2.0, 0.5], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], black);
        scene.shapes[0].name = "thing".into();
        scene.quads[0].name = "thing".into();
        scene.motion.shapes.insert(0, moving(DVec3::new(0.0, 0.0, -0.1)));
        scene.motion.quads.insert(0, moving(DVec3::new(0.0, 0.0, 0.1)));
        scene.set_object_traits("thing", traits);
        scene.cameras.push(camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1e-3));
        assert_radiance("behind what moves", &scene, &options(4, 4, 2), truth, 1e-6);
    }
}

/// Two objects of the same name are distinct.
#[test]
fn visibility_is_not_shared_by_name() {
    let mut scene = Scene::default();
    let light = material(&mut scene, Material::emitter("light", [1.0; 3], true));
    sphere(&mut scene, [-2.0, 0.0, 0.0], 1.0, light);
    sphere(&mut scene, [2.0, 0.0, 0.0], 1.0, light);
    scene.shapes[0].traits.is_holdout = true;
    for (x, truth) in [(-2.0, 0.0), (2.0, 1.0)] {
        scene.cameras = vec![camera(DVec3::new(x, 0.0, 5.0), DVec3::new(x, 0.0, 0.0), DVec3::Y, 1e-3)];
        let film = picture(&scene, &options(4, 4, 1));
        assert!(film.rgba().iter().all(|pixel| *pixel == [truth; 4]), "{x}: {:?}", film.rgba());
    }
}

/// Two coincident surfaces, each visible to other ray types: neither hides the other, in any order.
#[test]
fn coincident_surfaces_of_different_visibility() {
    let others = RayKinds::ALL.without(RayKinds::CAMERA);
    for order in [[RayKinds::CAMERA, others], [others, RayKinds::CAMERA]] {
        let mut scene = floor(grey());
        for (k, kinds) in order.into_iter().enumerate() {
            let radiance = if kinds == RayKinds::CAMERA { 7.0 } else { 2.0 };
            let lamp = material(&mut scene, Material::emitter("lamp", [radiance; 3], true));
            quad(&mut scene, [-1.0, 3.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], lamp);
            scene.quads[k + 1].name = format!("lamp {k}");
            scene.set_object_traits(&format!("lamp {k}"), seen_by(&[kinds]));
        }
        let mut alone = floor(grey());
        let lamp = material(&mut alone, Material::emitter("lamp", [2.0; 3], true));
        quad(&mut alone, [-1.0, 3.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], lamp);
        let of = |scene: &Scene| mean(&picture(scene, &options(16, 256, 1)));
        let (both, one) = (of(&scene), of(&alone));
        assert!((both / one - 1.0).abs() < 0.01, "{both} {one}");
    }
}

/// The camera sees a background that differs from the environment that lights the scene and is visible in mirrors.
#[test]
fn separate_camera_background() {
    let lit = |seen| Scene {
        environment: Environment::Constant([1.5; 3]),
        camera_environment: seen,
        ..floor(grey())
    };
    let sky = camera(EYE, EYE + DVec3::new(0.1, 1.0, 0.0), DVec3::X, 40.0);
    for (seen, color) in [
        (None, [1.5; 3]),
        (Some(Environment::Constant([0.2, 0.4, 3.0])), [0.2, 0.4, 3.0]),
        (Some(Environment::Black), [0.0; 3]),
    ] {
        let mut scene = lit(seen.clone());
        assert_radiance(&format!("{seen:?}, floor"), &scene, &options(16, 64, 2), 0.8 * 1.5, 4e-3);
        scene.cameras = vec![sky.clone()];
        for rgba in picture(&scene, &options(8, 4, 2)).rgba() {
            let alpha = if seen == Some(Environment::Black) { 0.0 } else { 1.0 };
            assert_eq!(
                rgba.map(|v| (v * 1e4).round()),
                [color[0], color[1], color[2], alpha].map(|v: f32| (v * 1e4).round())
            );
        }
    }
    // A mirror shows the environment that lights the scene; behind a light that rays pass the camera sees its background.
    let metal = PbrMaterial {
        metallic: FloatSlot::constant(1.0),
        roughness: FloatSlot::constant(0.0),
        ..PbrMaterial::default()
    };
    let mirror = Scene {
        environment: Environment::Constant([1.5; 3]),
        ..floor(Material::new("mirror", Model::Pbr(Box::new(metal))))
    };
    let other = Scene { camera_environment: Some(Environment::Constant([9.0; 3])), ..mirror.clone() };
    let [mirror, other] = [mirror, other].map(|scene| mean(&picture(&scene, &options(8, 64, 4))));
    assert_eq!(mirror, other);
}
