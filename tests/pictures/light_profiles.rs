//! Point lights with photometric (IES) profiles, against closed forms.

use crate::support::{assert_radiance, camera, material, options, quad, sphere};
use oscura::math::{DQuat, DVec3};
use oscura::scene::{Beam, EmitterTraits, Light, LightKind, LightProfile, Material, RayKinds, Scene};
use std::f64::consts::PI;
use std::sync::Arc;

const ALBEDO: f64 = 0.8;

/// The intensity falls from 1 to 0 over the vertical angle, and to 0.25 of that over half a turn of the horizontal angle.
fn profile() -> LightProfile {
    LightProfile {
        vertical_deg: vec![0.0, 180.0],
        horizontal_deg: vec![0.0, 180.0],
        values: vec![1.0, 0.0, 0.25, 0.0],
    }
}

/// The relative intensity in a direction from the light, in light space.
fn share(local: DVec3) -> f64 {
    let vertical = (-local.z).acos() / PI;
    let horizontal = local.y.atan2(local.x).abs() / PI;
    (1.0 - vertical) * (1.0 - 0.75 * horizontal)
}

/// A floor seen at one point, the origin.
fn floor(lights: Vec<Light>) -> Scene {
    let mut scene = Scene { lights, ..Scene::default() };
    let grey = material(&mut scene, Material::lambert("grey", [ALBEDO as f32; 3]));
    quad(&mut scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], grey);
    scene.cameras.push(camera(DVec3::new(-3.0, 1.0, -2.0), DVec3::ZERO, DVec3::Y, 1e-3));
    scene
}

/// Irradiance at the origin of a rotated light of intensity 5.
fn expected(position: DVec3, rotation: DQuat) -> f64 {
    let way = -position.normalize();
    5.0 * share(rotation.inverse() * way) * -way.y / position.length_squared() * ALBEDO / PI
}

fn emitter_traits(position: DVec3, rotation: DQuat, cone: Option<[f64; 2]>) -> Light {
    let kind = LightKind::Profiled { position, rotation, cone };
    Light { profile: Some(Arc::new(profile())), ..Light::new(kind, [5.0; 3]) }
}

#[test]
fn profile_scales_irradiance() {
    let down = DQuat::from_rotation_arc(DVec3::NEG_Z, DVec3::NEG_Y);
    let askew = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-1.1);
    let mut all = (Vec::new(), 0.0);
    for position in [DVec3::new(0.5, 2.0, 1.0), DVec3::new(-1.0, 1.0, 0.3), DVec3::new(0.2, 3.0, -2.0)] {
        for rotation in [down, askew] {
            let truth = expected(position, rotation);
            let light = emitter_traits(position, rotation, None);
            let what = format!("a profile at {position}");
            assert_radiance(&what, &floor(vec![light.clone()]), &options(16, 64, 1), truth, 1e-3);
            all.0.push(light);
            all.1 += truth;
        }
    }
    assert_radiance("all of them", &floor(all.0), &options(16, 1024, 1), all.1, 4e-3);
}

/// The spot falloff from its axis to 60 degrees, multiplied by the profile.
#[test]
fn spot_cone_multiplies_the_profile() {
    let position = DVec3::new(1.0, 2.0, 0.5);
    let down = DQuat::from_rotation_arc(DVec3::NEG_Z, DVec3::NEG_Y);
    let outer = PI / 3.0;
    let cosine = position.y / position.length();
    let a = (cosine - outer.cos()) / (1.0 - outer.cos());
    let truth = expected(position, down) * a * a * (3.0 - 2.0 * a);
    let scene = floor(vec![emitter_traits(position, down, Some([0.0, outer]))]);
    assert_radiance("a cone", &scene, &options(16, 64, 1), truth, 1e-3);
    let beside = DVec3::new(4.0, 2.0, 0.0);
    let dark = floor(vec![emitter_traits(beside, down, Some([0.0, outer]))]);
    assert_radiance("beside the cone", &dark, &options(16, 64, 1), 0.0, 1e-3);
}

/// Spherical lights with a profile of the cosine of the vertical angle, below and beside them: over the cone of directions in
/// which the floor sees the sphere, E = L times the integral of that cosine and the floor's; and half of a sphere cut by a spot
/// cone.
#[test]
fn sphere_lights_with_profiles() {
    let vertical_deg: Vec<f32> = (0..=90).map(|k| k as f32).collect();
    let values = vertical_deg.iter().map(|degrees| degrees.to_radians().cos().max(0.0)).collect();
    let cosine = Arc::new(LightProfile { vertical_deg, horizontal_deg: vec![0.0], values });
    let down = DQuat::from_rotation_arc(DVec3::NEG_Z, DVec3::NEG_Y);
    for (position, radius) in [(DVec3::new(0.0, 2.0, 0.0), 0.8), (DVec3::new(1.2, 1.5, 0.4), 0.5)] {
        let mut scene = floor(Vec::new());
        let profile = scene.add_profile(cosine.clone());
        let bulb = Material {
            emitter_traits: Some(EmitterTraits {
                visible_to: RayKinds::ALL,
                is_obstacle: true,
                beam: Beam::Profile { profile, rotation: down, cone: None },
            }),
            ..Material::emitter("bulb", [3.0; 3], false)
        };
        let bulb = material(&mut scene, bulb);
        sphere(&mut scene, position.into(), radius, bulb);
        // The mean of the squared cosine over a cone around an axis: both are the height of the direction.
        let edge = (1.0 - radius * radius / position.length_squared()).sqrt();
        let (axis, solid) = (position.y / position.length(), 2.0 * PI * (1.0 - edge));
        let along = (1.0 + edge + edge * edge) / 3.0;
        let squared = along * axis * axis + 0.5 * (1.0 - along) * (1.0 - axis * axis);
        let truth = 3.0 * solid * squared * ALBEDO / PI;
        assert_radiance(&format!("a ball at {position}"), &scene, &options(16, 256, 1), truth, 3e-3);

        let halved = Beam::Profile { profile, rotation: down, cone: Some([1.2, 1.2001]) };
        scene.materials[bulb.index()].emitter_traits =
            Some(EmitterTraits { beam: halved, ..EmitterTraits::default() });
        assert_radiance("within a wide cone", &scene, &options(16, 256, 1), truth, 3e-3);
        let aside = DQuat::from_rotation_arc(DVec3::NEG_Z, DVec3::Y);
        let away = Beam::Profile { profile, rotation: aside, cone: None };
        scene.materials[bulb.index()].emitter_traits =
            Some(EmitterTraits { beam: away, ..EmitterTraits::default() });
        assert_radiance("turned away", &scene, &options(16, 256, 1), 0.0, 1e-3);
        scene.profiles.clear();
        let problems = scene.validate();
        assert!(problems.iter().any(|p| p.place.ends_with("profile")), "{problems:?}");
    }
}

#[test]
fn invalid_profiles_are_refused() {
    let place = DVec3::new(0.5, 2.0, 1.0);
    let good = emitter_traits(place, DQuat::IDENTITY, None);
    assert!(floor(vec![good.clone()]).validate().is_empty());
    let without = Light { profile: None, ..good.clone() };
    let elsewhere = Light { kind: LightKind::Point { position: place }, ..good.clone() };
    let unsound = LightProfile { values: vec![1.0], ..profile() };
    let unsound = Light { profile: Some(Arc::new(unsound)), ..good.clone() };
    for light in [without, elsewhere, unsound] {
        let problems = floor(vec![light]).validate();
        assert!(problems.iter().any(|p| p.to_string().contains("profile")), "{problems:?}");
    }
    let turned = emitter_traits(place, DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), None);
    assert!(!floor(vec![turned]).validate().is_empty());
}
