//! Lights with Blender's semantics, suns with an angular size, and environments hidden from the camera, against closed forms.

use crate::support::{assert_radiance, camera, disk, grey_floor, material, options, picture, quad, sphere};
use oscura::math::DVec3;
use oscura::scene::{
    Beam, ColorSlot, EmitterTraits, Environment, FloatSlot, Fog, Light, LightKind, Material, Medium, Model,
    RayKinds, Scene, SpotFalloff,
};
use std::f64::consts::PI;

/// Position of the camera that looks at the origin, a point of the floor.
const EYE: DVec3 = DVec3::new(-3.0, 1.0, -2.0);

/// All rays but camera rays.
fn unseen() -> RayKinds {
    RayKinds::ALL.without(RayKinds::CAMERA)
}

fn emitter_traits(
    scene: &mut Scene,
    radiance: f32,
    emitter_traits: EmitterTraits,
) -> oscura::scene::MaterialId {
    let emitter =
        Material { emitter_traits: Some(emitter_traits), ..Material::emitter("lamp", [radiance; 3], false) };
    material(scene, emitter)
}

/// Radiance at the origin of a floor of albedo 0.8 due to a spherical light above the horizon.
fn light_of_ball(radiance: f64, center: DVec3, radius: f64) -> f64 {
    0.8 * radiance * radius * radius / center.length_squared() * center.y / center.length()
}

/// A light doesn't occlude lights behind it, and one in front of the camera hides nothing.
#[test]
#[ignore = "means of many pictures, which take long"]
fn lights_do_not_occlude_other_lights() {
    let (high, low, near) = (DVec3::new(0.0, 3.0, 0.0), DVec3::new(0.0, 1.5, 0.0), 0.5 * EYE);
    let truth = light_of_ball(2.0, high, 0.5) + light_of_ball(1.0, low, 0.3) + light_of_ball(5.0, near, 0.1);
    for (what, visible_to, is_obstacle, truth) in [
        ("lamps that hide nothing", unseen(), false, truth),
        ("a emitter_traits that is seen through", RayKinds::ALL, false, truth + 5.0),
        ("an obstacle that is not seen", unseen(), true, truth),
    ] {
        let mut scene = grey_floor();
        let passed = EmitterTraits { visible_to: unseen(), is_obstacle: false, beam: Beam::Lambertian };
        let (a, b) = (emitter_traits(&mut scene, 2.0, passed), emitter_traits(&mut scene, 1.0, passed));
        let c = emitter_traits(
            &mut scene,
            5.0,
            EmitterTraits { visible_to, is_obstacle, beam: Beam::Lambertian },
        );
        sphere(&mut scene, high.into(), 0.5, a);
        sphere(&mut scene, low.into(), 0.3, b);
        sphere(&mut scene, near.into(), 0.1, c);
        assert_radiance(what, &scene, &options(16, 256, 1), truth, 4e-3);
    }
}

/// The noise of a light under a sky does not depend on the floor's size: light selection ignores the scene's size.
#[test]
fn light_selection_is_independent_of_scene_size() {
    let (center, radius, sky) = (DVec3::new(0.0, 3.0, 0.0), 0.5, 1.0);
    let hidden = radius * radius / center.length_squared();
    let truth = light_of_ball(30.0, center, radius) + 0.8 * sky * (1.0 - hidden);
    for half in [5.0, 500.0, 50_000.0] {
        let mut scene = Scene { environment: Environment::Constant([sky as f32; 3]), ..Scene::default() };
        let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
        quad(&mut scene, [-half, 0.0, half], [2.0 * half, 0.0, 0.0], [0.0, 0.0, -2.0 * half], grey);
        scene.cameras.push(camera(EYE, DVec3::ZERO, DVec3::Y, 1e-3));
        let bulb = emitter_traits(&mut scene, 30.0, EmitterTraits::default());
        sphere(&mut scene, center.into(), radius, bulb);
        assert_radiance(&format!("half width {half}"), &scene, &options(16, 64, 1), truth, 1e-3);
    }
}

/// Unbounded fog hides the sky, which takes no light samples from the light.
#[test]
fn unbounded_fog_leaves_light_samples_to_local_lights() {
    let mut scene = grey_floor();
    scene.environment = Environment::Constant([1000.0; 3]);
    let density = 0.05;
    let medium = Medium { albedo: [0.0; 3], ..Medium::scattering([density; 3]) };
    scene.fog = Some(Fog { medium, center: DVec3::ZERO, radius: f64::INFINITY });
    let (center, radius) = (DVec3::new(0.0, 3.0, 0.0), 0.05);
    let bulb = emitter_traits(&mut scene, 300.0, EmitterTraits::default());
    sphere(&mut scene, center.into(), radius, bulb);
    // The visible hemisphere of a distant sphere is two thirds of its radius nearer than the centre on average.
    let passed = (-f64::from(density) * (EYE.length() + center.y - 2.0 / 3.0 * radius)).exp();
    let truth = passed * light_of_ball(300.0, center, radius);
    assert_radiance("fog", &scene, &options(16, 64, 1), truth, 2e-3);
}

/// An occluder casts a shadow, visible to the camera or not.
#[test]
fn occluders_cast_shadows() {
    let mut scene = grey_floor();
    let far =
        emitter_traits(&mut scene, 2.0, EmitterTraits { visible_to: unseen(), ..EmitterTraits::default() });
    let dark =
        emitter_traits(&mut scene, 0.0, EmitterTraits { visible_to: unseen(), ..EmitterTraits::default() });
    sphere(&mut scene, [0.0, 3.0, 0.0], 0.2, far);
    quad(&mut scene, [-1.0, 1.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], dark);
    assert_radiance("shade", &scene, &options(8, 16, 1), 0.0, 1.0);
}

/// An area light with spread passes most light straight ahead, and none beyond its half angle: closed form.
#[test]
fn area_light_spread() {
    area_light_spread_of(0.6);
    // Light of a ninth of the disk reaches a point.
    area_light_spread_of(0.05);
}

fn area_light_spread_of(half_angle_rad: f64) {
    let (radius, height) = (0.3, 2.0);
    let beam = Beam::Grid { half_angle_rad };
    let scale = 1.0 / (half_angle_rad.tan() - half_angle_rad);
    // Over rings of the disk: cos^4 / h^2 is the density of projected solid angle.
    let n = 10_000;
    let ring = |i: i32| {
        let rho = radius * (f64::from(i) + 0.5) / f64::from(n);
        let cosine = height / rho.hypot(height);
        2.0 * rho * radius / f64::from(n) * cosine.powi(4) / (height * height)
            * (half_angle_rad.tan() - rho / height).max(0.0)
            * scale
    };
    let truth = 0.8 * 3.0 * (0..n).map(ring).sum::<f64>();
    for lights in [1, 2] {
        let mut scene = grey_floor();
        let emitter_traits =
            emitter_traits(&mut scene, 3.0, EmitterTraits { visible_to: unseen(), is_obstacle: false, beam });
        disk(&mut scene, [0.0, height, 0.0], [0.0, -1.0, 0.0], radius, emitter_traits);
        // The origin lies outside the second one's beam.
        for _ in 1..lights {
            disk(&mut scene, [4.0, height, 0.0], [0.0, -1.0, 0.0], radius, emitter_traits);
        }
        assert_radiance(&format!("grid, {lights}"), &scene, &options(16, 256, 1), truth, 4e-3);
    }
}

#[test]
fn area_light_spread_has_a_cutoff() {
    let beam = Beam::Grid { half_angle_rad: 0.6 };
    let mut scene = grey_floor();
    let emitter_traits = emitter_traits(&mut scene, 3.0, EmitterTraits { beam, ..EmitterTraits::default() });
    quad(&mut scene, [3.0, 2.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], emitter_traits);
    assert_radiance("outside the grid's beam", &scene, &options(8, 16, 1), 0.0, 1.0);
}

/// A spherical light with a cone lights as a spot light.
#[test]
fn spot_cone_of_a_sphere_light() {
    let center = DVec3::new(0.5, 2.0, 0.3);
    let shines = |towards: DVec3| {
        let direction = (towards - center).normalize();
        let (inner_angle_rad, outer_angle_rad, falloff) = (0.3, 0.6, SpotFalloff::Smooth);
        let beam = Beam::Cone { direction, inner_angle_rad, outer_angle_rad, falloff };
        let mut scene = grey_floor();
        let emitter_traits =
            emitter_traits(&mut scene, 3.0, EmitterTraits { visible_to: unseen(), is_obstacle: false, beam });
        sphere(&mut scene, center.into(), 0.1, emitter_traits);
        scene
    };
    let truth = light_of_ball(3.0, center, 0.1);
    assert_radiance("in the cone", &shines(DVec3::ZERO), &options(16, 64, 1), truth, 2e-3);
    let beside = shines(DVec3::new(3.0, 0.0, 0.0));
    assert_radiance("beside the cone", &beside, &options(8, 16, 1), 0.0, 1.0);
}

/// The irradiance of a sun equals that of a directional light, whatever its angular diameter; mirrors show it, cameras don't.
#[test]
fn suns_of_any_angular_diameter() {
    let direction = DVec3::new(0.3, -1.0, 0.2).normalize();
    for angle_rad in [0.0092, 0.5, 1.5] {
        let sun = Light::new(LightKind::Sun { direction, angle_rad }, [2.0; 3]);
        for lights in [1, 2] {
            let mut scene = grey_floor();
            scene.lights = vec![sun.clone(); lights];
            let truth = lights as f64 * 0.8 / PI * 2.0 * -direction.y;
            let what = format!("{lights} suns of {angle_rad}");
            assert_radiance(&what, &scene, &options(16, 256, 1), truth, 4e-3);
        }
        let mut scene = grey_floor();
        let (color, roughness) = (ColorSlot::constant([1.0; 3]), FloatSlot::constant(0.0));
        scene.materials[0].model = Model::SchlickMetal { color, roughness };
        let to_sun = -direction;
        let eye = DVec3::new(-to_sun.x, to_sun.y, -to_sun.z) * 4.0;
        scene.cameras = vec![camera(eye, DVec3::ZERO, DVec3::Y, 1e-3)];
        scene.lights.push(sun.clone());
        let radiance = 2.0 / (PI * (0.5 * angle_rad).sin().powi(2));
        assert_radiance("the sun in a mirror", &scene, &options(8, 16, 4), radiance, 1e-3);
        scene.cameras = vec![camera(DVec3::Y, DVec3::Y + to_sun, DVec3::Y, 1e-3)];
        assert_radiance("the sun in the sky", &scene, &options(8, 16, 4), 0.0, 1.0);
    }
}

/// An environment hidden from the camera lights the floor; pixels without another hit are transparent.
#[test]
fn environments_hidden_from_the_camera() {
    let mut scene = Scene { environment_visible_to: unseen(), ..grey_floor() };
    scene.environment = Environment::Constant([1.0; 3]);
    assert_radiance("floor in a hidden environment", &scene, &options(16, 256, 1), 0.8, 1e-3);
    scene.cameras = vec![camera(EYE, EYE + DVec3::Y, DVec3::X, 1.0)];
    let film = picture(&scene, &options(4, 4, 4));
    assert!(film.rgba().iter().all(|pixel| *pixel == [0.0; 4]));
    scene.environment_visible_to = RayKinds::ALL;
    let film = picture(&scene, &options(4, 4, 4));
    assert!(film.rgba().iter().all(|pixel| *pixel == [1.0; 4]));
}
