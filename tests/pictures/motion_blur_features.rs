//! Motion blur combined with ray visibility, light groups, shadow catchers, media and caustics.

use crate::support::{assert_radiance, camera, material, mean, options, picture, quad, sphere};
use oscura::math::{DAffine3, DVec3};
use oscura::render::{Caustics, Renderer};
use oscura::scene::{Environment, Fog, Keyframes, Material, Medium, Model, ObjectTraits, RayKinds, Scene};

fn shift(by: [f64; 3]) -> DAffine3 {
    DAffine3::from_translation(by.into())
}

fn moving(keys: [DAffine3; 2]) -> Keyframes<DAffine3> {
    Keyframes { keys: keys.to_vec(), neighbours: None }
}

/// A floor and, above it, a small emissive sphere that moves by almost nothing if `way` is not 0.
fn glowing(traits: ObjectTraits, way: f64) -> Scene {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
    let red = Material::lambert("red", [0.8, 0.1, 0.1]);
    let glow = Material::emitter("glow", [20.0; 3], true).emission;
    let glow = material(&mut scene, Material { emission: glow, light_group: "zzz".into(), ..red });
    let other = Material { light_group: "aaa".into(), ..Material::emitter("other", [1.0; 3], true) };
    let other = material(&mut scene, other);
    quad(&mut scene, [-5.0, 0.0, 5.0], [10.0, 0.0, 0.0], [0.0, 0.0, -10.0], grey);
    scene.quads[0].name = "floor".into();
    sphere(&mut scene, [0.0, 1.0, 0.0], 0.2, glow);
    scene.shapes[0].name = "lamp".into();
    sphere(&mut scene, [2.0, 1.0, 0.0], 0.2, other);
    if way != 0.0 {
        scene.motion.shapes.insert(0, moving([shift([0.0; 3]), shift([way, 0.0, 0.0])]));
    }
    scene.set_object_traits("lamp", traits);
    scene.cameras.push(camera(DVec3::new(0.0, 4.0, 6.0), DVec3::ZERO, DVec3::Y, 30.0));
    scene
}

fn of_group(scene: Scene, name: &str) -> f64 {
    let picture = Renderer::new(scene).size(16, 16).samples(16).max_depth(2).light_groups(true).render();
    let plane = picture.expect("it renders").into_film().plane(name).expect("the group").into_floats();
    plane.iter().map(|v| f64::from(*v)).sum::<f64>() / plane.len() as f64
}

/// A moving light behaves as a still one: for ray visibility, light groups, and shadow catchers.
#[test]
fn nearly_still_lights_match_still_ones() {
    let unseen = ObjectTraits { visible_to: RayKinds::GLOSSY, ..ObjectTraits::default() };
    let [still, moves] = [0.0, 1e-3].map(|way| picture(&glowing(unseen, way), &options(16, 16, 2)));
    let (still, moves) = (mean(&still), mean(&moves));
    assert!((moves / still - 1.0).abs() < 1e-2, "visibility: {moves}, not {still}");

    let hidden =
        ObjectTraits { visible_to: RayKinds::ALL.without(RayKinds::CAMERA), ..ObjectTraits::default() };
    let [still, moves] = [0.0, 1e-3].map(|way| of_group(glowing(hidden, way), "RGBA_zzz.G"));
    assert!(still > 0.0 && (moves / still - 1.0).abs() < 1e-2, "group: {moves}, not {still}");

    let caught = |way| {
        let mut scene = glowing(ObjectTraits::default(), way);
        scene.set_object_traits("floor", ObjectTraits { is_shadow_catcher: true, ..ObjectTraits::default() });
        mean(&picture(&scene, &options(16, 64, 2).catchers(true)))
    };
    let (still, moves) = (caught(0.0), caught(1e-3));
    assert!((moves / still - 1.0).abs() < 2e-2, "caught: {moves}, not {still}");
}

/// Where nothing casts a shadow, catchers stay transparent, at any time and with any batch size.
#[test]
fn moving_lights_cast_no_shadow_on_catchers() {
    let mut scene = glowing(ObjectTraits::default(), 3.0);
    scene.shapes.truncate(1);
    scene.materials[1] = Material::emitter("lamp", [20.0; 3], true);
    let unseen =
        ObjectTraits { visible_to: RayKinds::ALL.without(RayKinds::CAMERA), ..ObjectTraits::default() };
    scene.set_object_traits("lamp", unseen);
    scene.set_object_traits("floor", ObjectTraits { is_shadow_catcher: true, ..ObjectTraits::default() });
    let film = picture(&scene, &options(0, 13, 2).size(63, 37).catchers(true));
    assert!(film.rgba().iter().all(|[.., alpha]| *alpha == 0.0));
}

/// An absorbing solid moves from behind the camera over it and past it: Beer's law integrated over time.
#[test]
fn absorbing_solid_moves_over_the_camera() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let medium = Medium { albedo: [0.0; 3], ..Medium::scattering([1.0; 3]) };
    let filled = Material { medium: Some(medium), ..Material::new("body", Model::Boundary {}) };
    let body = material(&mut scene, filled);
    quad(&mut scene, [-50.0, -50.0, 1.0], [100.0, 0.0, 0.0], [0.0, 100.0, 0.0], body);
    quad(&mut scene, [-50.0, -50.0, -1.0], [0.0, 100.0, 0.0], [100.0, 0.0, 0.0], body);
    for quad in [0, 1] {
        scene.motion.quads.insert(quad, moving([shift([0.0, 0.0, -4.0]), shift([0.0, 0.0, 4.0])]));
    }
    scene.cameras.push(camera(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 1e-3));
    // The centre is in front of the camera by more than 1 for three eighths of the time, then around it for two.
    let truth = 0.375 * (-2.0f64).exp() + 0.125 * (1.0 - (-2.0f64).exp()) + 0.375;
    assert_radiance("body", &scene, &options(8, 256, 0), truth, 5e-3);
}

/// Emission in front of a holdout is kept.
#[test]
fn emissive_fog_in_front_of_a_holdout() {
    let glowing = Medium { albedo: [0.0; 3], emission: [1.0; 3], ..Medium::scattering([0.1; 3]) };
    let fog = Some(Fog { medium: glowing, center: DVec3::ZERO, radius: 50.0 });
    let mut scene = Scene { fog, ..Scene::default() };
    let black = material(&mut scene, Material::lambert("black", [0.0; 3]));
    quad(&mut scene, [-5.0, -5.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 0.0], black);
    scene.quads[0].name = "wall".into();
    scene.cameras.push(camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1e-3));
    let before = mean(&picture(&scene, &options(8, 64, 0)));
    scene.set_object_traits("wall", ObjectTraits { is_holdout: true, ..ObjectTraits::default() });
    let film = picture(&scene, &options(8, 64, 0));
    assert!(before > 1.0 && (mean(&film) / before - 1.0).abs() < 1e-3, "{}, not {before}", mean(&film));
    assert!(film.rgba().iter().all(|[.., alpha]| *alpha == 0.0));
}

/// With a moving camera, caustics are left to camera paths.
#[test]
fn moving_camera_leaves_caustics_to_camera_paths() {
    let mut scene = glowing(ObjectTraits::default(), 0.0);
    let mirror = Model::SchlickMetal {
        color: oscura::scene::ColorSlot::constant([1.0; 3]),
        roughness: oscura::scene::FloatSlot::constant(0.0),
    };
    let mirror = material(&mut scene, Material::new("mirror", mirror));
    quad(&mut scene, [-1.0, 0.1, -1.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], mirror);
    let place = scene.cameras[0].world_from_camera;
    let keys = [place, shift([0.5, 0.0, 0.0]) * place];
    scene.cameras[0].motion = Some(moving(keys));
    let [off, on] =
        [Caustics::Off, Caustics::On].map(|caustics| picture(&scene, &options(8, 4, 3).caustics(caustics)));
    assert_eq!(off.rgba(), on.rgba());
}
