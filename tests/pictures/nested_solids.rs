//! Emitters inside absorbing solids, and nested solids, against closed forms.

use crate::dielectric_priorities::glass;
use crate::support::{assert_radiance, camera, material, options, quad, sphere, tinted_solid};
use oscura::math::DVec3;
use oscura::scene::{Environment, Light, LightKind, Material, Scene};

fn look(scene: &mut Scene, from: [f64; 3], at: [f64; 3]) {
    scene.cameras.push(camera(from.into(), at.into(), DVec3::X, 1e-3));
}

/// Beer's law, from outside of the solid and from inside.
#[test]
fn emission_inside_a_solid_is_absorbed() {
    for (eye, way) in [(5.0, 1.5), (1.0, 0.5)] {
        let mut scene = Scene::default();
        let fog = glass(&mut scene, 1.0, 0.5, 0);
        sphere(&mut scene, [0.0; 3], 2.0, fog);
        let lamp = material(&mut scene, Material::emitter("lamp", [3.0; 3], false));
        sphere(&mut scene, [0.0; 3], 0.5, lamp);
        look(&mut scene, [0.0, 0.0, eye], [0.0; 3]);
        let truth = 3.0 * 0.5f64.powf(way);
        assert_radiance(&format!("lamp seen from {eye}"), &scene, &options(4, 4, 8), truth, 1e-4);
    }
}

/// Light samples are attenuated as well: on the way to the floor, then on the way to the camera.
#[test]
fn light_samples_are_absorbed() {
    let floor_in_a_solid = |scene: &mut Scene| {
        let fog = glass(scene, 1.0, 0.4, 0);
        sphere(scene, [0.0; 3], 4.0, fog);
        let grey = material(scene, Material::lambert("grey", [0.8; 3]));
        quad(scene, [-1.0, 0.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, -2.0], grey);
        look(scene, [0.0, 1.5, 0.0], [0.0; 3]);
    };
    let position = DVec3::new(0.6, 0.8, 0.0);
    let mut scene = Scene::default();
    floor_in_a_solid(&mut scene);
    let kind = LightKind::Point { position };
    scene.lights.push(Light::new(kind, [5.0; 3]));
    let of_point = 0.8 / std::f64::consts::PI * 5.0 * 0.8;
    assert_radiance("point light", &scene, &options(4, 4, 1), of_point * 0.4f64.powf(2.5), 1e-4);

    let mut scene = Scene::default();
    floor_in_a_solid(&mut scene);
    let radius = 1e-4;
    let lamp = material(&mut scene, Material::emitter("lamp", [1e8; 3], false));
    sphere(&mut scene, position.into(), radius, lamp);
    let of_sphere = 0.8 * 1e8 * radius * radius * 0.8;
    // Its visible points are on average two thirds of the radius nearer than its centre.
    let way = 2.5 - radius * 2.0 / 3.0;
    assert_radiance("sphere light", &scene, &options(8, 64, 1), of_sphere * 0.4f64.powf(way), 1e-3);
}

/// A ray through the centre of a glass sphere, whose faces reflect R and whose diameter transmits T: R + (1 - R)^2 T / (1 - R T)
/// of a white environment. A sphere of the same glass inside changes nothing.
#[test]
fn glass_inside_the_same_glass_is_invisible() {
    for inner in [None, Some(0.7)] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let green = glass(&mut scene, 1.5, 0.5, 0);
        sphere(&mut scene, [0.0; 3], 1.0, green);
        if let Some(radius) = inner {
            sphere(&mut scene, [0.0; 3], radius, green);
        }
        look(&mut scene, [0.0, 0.0, 6.0], [0.0; 3]);
        let (r, t) = (0.04f64, 0.25f64);
        let truth = r + (1.0 - r) * (1.0 - r) * t / (1.0 - r * t);
        assert_radiance(&format!("inner sphere {inner:?}"), &scene, &options(16, 256, 100), truth, 2e-3);
    }
}

/// The interface between two dielectrics reflects by the ratio of their indices, from either side; the camera is inside the
/// outer one, among white walls, and the inner one is black inside.
#[test]
#[ignore = "means of many pictures, which take long"]
fn reflectance_between_nested_dielectrics() {
    for (outer, inner, sine) in
        [(1.5f64, 2.4f64, 0.0f64), (2.4, 1.5, 0.0), (1.33, 2.0, 0.8), (2.0, 1.33, 0.6), (2.0, 1.33, 0.7)]
    {
        let mut scene = Scene::default();
        let around = glass(&mut scene, outer as f32, 1.0, 0);
        sphere(&mut scene, [0.0; 3], 100.0, around);
        let walls = material(&mut scene, Material::emitter("walls", [1.0; 3], true));
        sphere(&mut scene, [0.0; 3], 50.0, walls);
        let within = glass(&mut scene, inner as f32, 1e-30, 0);
        sphere(&mut scene, [0.0; 3], 10.0, within);
        // Towards a point of the inner sphere where the angle of incidence has that sine.
        let point = DVec3::new(10.0, 0.0, 0.0);
        let eye = point + DVec3::new((1.0 - sine * sine).sqrt(), sine, 0.0) * 5.0;
        scene.cameras.push(camera(eye, point, DVec3::Z, 1e-3));
        let eta = inner / outer;
        let cosine = (1.0 - sine * sine).sqrt();
        let truth = if sine >= eta {
            1.0
        } else {
            let transmitted = (1.0 - sine * sine / (eta * eta)).sqrt();
            let parallel = (eta * cosine - transmitted) / (eta * cosine + transmitted);
            let perpendicular = (cosine - eta * transmitted) / (cosine + eta * transmitted);
            0.5 * (parallel * parallel + perpendicular * perpendicular)
        };
        let what = format!("from index {outer} onto {inner}, sine {sine}");
        assert_radiance(&what, &scene, &options(16, 256, 4), truth, 1e-2);
    }
}

/// Where a liquid overlaps its vessel, rays from either side pass both interfaces: clear in clear stays white, and only the
/// medium entered last absorbs.
#[test]
fn overlap_belongs_to_the_last_entered_solid() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    // Two overlapping slabs of index 1, 1 m thick each, that overlap by 0.4 m. Going down: 0.6 m of the upper, then, from where
    // the lower begins, 1 m of that.
    let upper = glass(&mut scene, 1.0, 0.5, 0);
    let lower = glass(&mut scene, 1.0, 0.25, 0);
    for (top, bottom, of) in [(1.0, 0.0, upper), (0.4, -0.6, lower)] {
        quad(&mut scene, [-50.0, top, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], of);
        quad(&mut scene, [-50.0, bottom, 50.0], [0.0, 0.0, -100.0], [100.0, 0.0, 0.0], of);
    }
    look(&mut scene, [0.0, 3.0, 0.0], [0.0; 3]);
    let truth = 0.5f64.powf(0.6) * 0.25;
    assert_radiance("overlapping slabs", &scene, &options(16, 256, 8), truth, 2e-3);
}

/// A slab whose two faces have different materials is exited at the second one: what is behind is seen as through a slab of one
/// material, without absorption.
#[test]
fn solid_of_two_materials_is_exited() {
    let mut scene = Scene::default();
    let (front, back) = (glass(&mut scene, 1.5, 0.5, 0), glass(&mut scene, 1.5, 0.5, 0));
    quad(&mut scene, [-50.0, 1.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], front);
    quad(&mut scene, [-50.0, 0.0, 50.0], [0.0, 0.0, -100.0], [100.0, 0.0, 0.0], back);
    let walls = material(&mut scene, Material::emitter("walls", [1.0; 3], true));
    quad(&mut scene, [-50.0, -7.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], walls);
    quad(&mut scene, [-50.0, 7.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], walls);
    look(&mut scene, [0.0, 3.0, 0.0], [0.0; 3]);
    let (r, t) = (0.04f64, 0.5f64);
    // Both faces, and all inter-reflections; reflected and transmitted light is white.
    let truth = r + (1.0 - r) * (1.0 - r) * t / (1.0 - r * t);
    assert_radiance("slab of two materials", &scene, &options(16, 256, 100), truth, 2e-3);
}

/// A single sheet of clear solid glass acts as a window, not as the boundary of a solid that fills the room: a sphere of the
/// same glass behind it is visible.
#[test]
fn single_sheet_of_solid_glass_is_a_window() {
    let radiance = |with_ball: bool| {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let clear = glass(&mut scene, 1.5, 1.0, 0);
        quad(&mut scene, [-50.0, 1.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], clear);
        let black = material(&mut scene, Material::lambert("black", [0.0; 3]));
        quad(&mut scene, [-50.0, -9.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], black);
        if with_ball {
            sphere(&mut scene, [0.0, -2.0, 0.0], 1.0, clear);
        }
        // Towards the sphere's rim, where it reflects the sky against the black ground.
        look(&mut scene, [0.9, 3.0, 0.0], [0.9, -2.0, 0.0]);
        crate::support::mean(&crate::support::picture(&scene, &options(16, 64, 16)))
    };
    let (without, with) = (radiance(false), radiance(true));
    assert!(with > without + 0.05, "{without} {with}");
}

/// A liquid that slightly overlaps its glass has its full absorption, as alone or with a gap.
#[test]
fn liquid_overlapping_its_glass_keeps_its_colour() {
    for (what, top, bottom) in [("gap", 0.9, 0.1), ("overlap", 1.03, -0.03)] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let (wall, liquid) = (tinted_solid(&mut scene, 0.8), tinted_solid(&mut scene, 0.05));
        // The vessel's lid and floor are 0.1 m thick.
        for (top, bottom, of) in [(1.1, 1.0, wall), (0.0, -0.1, wall), (top, bottom, liquid)] {
            quad(&mut scene, [-50.0, top, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], of);
            quad(&mut scene, [-50.0, bottom, 50.0], [0.0, 0.0, -100.0], [100.0, 0.0, 0.0], of);
        }
        // As solids they are open at the sides; what closes them is out of sight.
        for of in [wall, liquid] {
            sphere(&mut scene, [900.0, 0.0, 0.0], 1.0, of);
        }
        look(&mut scene, [0.0, 3.0, 0.0], [0.0; 3]);
        assert_radiance(what, &scene, &options(16, 256, 16), 0.05 * 0.8 * 0.8, 1e-2);
    }
}
