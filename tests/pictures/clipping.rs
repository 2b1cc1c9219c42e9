//! Near and far clipping of cameras.

use crate::support::{assert_radiance, camera, material, mean, options, picture, quad, sphere};
use oscura::film::{Aov, AovSet};
use oscura::math::DVec3;
use oscura::scene::{
    Aperture, Camera, Environment, Fog, Light, LightKind, Material, Medium, Model, Panorama, Projection,
    Scene, ThinLens,
};

const SKY: f32 = 8.0;

/// Sheets with emission 1, 2 and 4 at one, two and three metres in front of a sky.
fn sheets(seen_by: Camera) -> Scene {
    let mut scene = Scene { environment: Environment::Constant([SKY; 3]), ..Scene::default() };
    for (distance, radiance) in [(1.0, 1.0), (2.0, 2.0), (3.0, 4.0)] {
        let emissive = material(&mut scene, Material::emitter("sheet", [radiance; 3], true));
        quad(&mut scene, [-50.0, -50.0, -distance], [100.0, 0.0, 0.0], [0.0, 100.0, 0.0], emissive);
    }
    scene.cameras.push(seen_by);
    scene
}

#[test]
fn near_and_far_clipping_planes() {
    let ahead = camera(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 110.0);
    let lens = ThinLens { defocus_angle_rad: 0.1, focus_distance: 2.0, aperture: Aperture::default() };
    let cameras = [
        ("pinhole", ahead.clone()),
        ("shifted", Camera { shift: [0.4, -0.2], ..ahead.clone() }),
        ("lens", Camera { lens: Some(lens), ..ahead.clone() }),
        ("parallel", Camera { projection: Projection::Orthographic { half_height: 2.0 }, ..ahead }),
    ];
    for (name, camera) in cameras {
        for (clip, expected, depth) in [
            (None, 1.0, Some(1.0)),
            (Some([0.0, 1.5]), 1.0, Some(1.0)),
            (Some([1.5, 2.5]), 2.0, Some(2.0)),
            (Some([2.9, 1e18]), 4.0, Some(3.0)),
            (Some([1.5, 1.9]), f64::from(SKY), None),
            (Some([4.0, 5.0]), f64::from(SKY), None),
        ] {
            let scene = sheets(Camera { clip, ..camera.clone() });
            let film = picture(&scene, &options(16, 16, 4).aovs(AovSet::default().with(Aov::Depth)));
            // Every pixel: clipping is by planes, whatever the angle to the axis.
            for (x, y) in [(0, 0), (15, 3), (8, 8)] {
                let [value, ..] = film.mean_rgba(x, y);
                assert!((f64::from(value) - expected).abs() < 1e-4, "{name} {clip:?} {x} {y}: {value}");
            }
            let plane = film.plane("Z").expect("a depth").into_floats();
            if let Some(depth) = depth {
                assert!(plane.iter().all(|z| (z - depth).abs() < 1e-4), "{name} {clip:?}: {plane:?}");
            }
        }
    }
}

#[test]
fn panoramas_clip_by_distance() {
    for (clip, expected) in [(None, 1.0), (Some([1.5, 2.5]), 2.0), (Some([2.5, 3.0]), f64::from(SKY))] {
        let mut scene = Scene { environment: Environment::Constant([SKY; 3]), ..Scene::default() };
        for radius in [1.0, 2.0] {
            let emissive = material(&mut scene, Material::emitter("ball", [radius as f32; 3], true));
            sphere(&mut scene, [0.0; 3], radius, emissive);
        }
        let ahead = camera(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 40.0);
        let projection = Projection::Panorama(Panorama::ALL_AROUND);
        scene.cameras.push(Camera { clip, projection, ..ahead });
        let radiance = mean(&picture(&scene, &options(16, 16, 4)));
        assert!((radiance - expected).abs() < 1e-4, "{clip:?}: {radiance}");
    }
}

/// Clipped geometry still casts shadows.
#[test]
fn clipped_geometry_casts_shadows() {
    let lit_floor = |has_blocker: bool| {
        let mut scene = Scene::default();
        let white = material(&mut scene, Material::new("white", Model::Lambert { albedo: [0.5; 3].into() }));
        quad(&mut scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], white);
        if has_blocker {
            quad(&mut scene, [-5.0, 2.0, 5.0], [10.0, 0.0, 0.0], [0.0, 0.0, -10.0], white);
        }
        scene.lights.push(Light::new(LightKind::Directional { direction: DVec3::NEG_Y }, [1.0; 3]));
        let above = camera(DVec3::new(0.0, 4.0, 0.0), DVec3::ZERO, DVec3::X, 20.0);
        scene.cameras.push(Camera { clip: Some([3.0, 10.0]), ..above });
        scene
    };
    let truth = 0.5 / std::f64::consts::PI;
    assert_radiance("open", &lit_floor(false), &options(8, 16, 1), truth, 1e-4);
    assert!(mean(&picture(&lit_floor(true), &options(8, 16, 1))) == 0.0);
}

/// Camera rays clipped at the near end may start within a medium; surfaces beyond the far end aren't seen through one.
#[test]
fn rays_starting_inside_a_medium() {
    let around = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 0.1);
    // Media without scattering take another code path.
    let cases = [(1.0, 2.0), (5.0, 1.0), (5.5, 0.5), (6.5, 0.0)];
    for (albedo, (near, way)) in [0.0, 1e-6].into_iter().flat_map(|albedo| cases.map(|case| (albedo, case))) {
        let medium = Medium { albedo: [albedo; 3], ..Medium::scattering([0.7; 3]) };
        let before_wall = |mut scene: Scene, far: f64| {
            let wall = material(&mut scene, Material::emitter("wall", [5.0; 3], true));
            quad(&mut scene, [-50.0, -50.0, -3.0], [100.0, 0.0, 0.0], [0.0, 100.0, 0.0], wall);
            scene.cameras.push(Camera { clip: Some([near, far]), ..around.clone() });
            scene
        };
        let open = || Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let mut body = open();
        let filled = Material { medium: Some(medium), ..Material::new("body", Model::Boundary {}) };
        let filled = material(&mut body, filled);
        sphere(&mut body, [0.0; 3], 1.0, filled);
        let fog = Scene { fog: Some(Fog { medium, center: DVec3::ZERO, radius: 2.0 }), ..open() };
        for (name, scene, way) in [("body", body, way), ("fog", fog, (7.0 - near).min(4.0))] {
            let left = (-0.7f64 * way).exp();
            let name = format!("{name} of albedo {albedo} from {near}");
            assert_radiance(&name, &before_wall(scene.clone(), 7.5), &options(8, 256, 4), left, 3e-3);
            assert_radiance(&name, &before_wall(scene, 8.5), &options(8, 256, 4), 5.0 * left, 3e-3);
        }
    }
}

/// Camera rays whose exit from a medium is beyond the far clipping plane ignore the medium; rays that hit a surface before
/// don't.
#[test]
fn media_with_clipped_exit_are_ignored() {
    let ahead = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 0.1);
    for (albedo, clip) in
        [(0.0, [0.0, 5.5]), (1e-6, [0.0, 5.5]), (0.0, [4.9, 5.5]), (1e-6, [4.9, 5.5]), (1e-6, [5.1, 5.5])]
    {
        let medium = Medium { albedo: [albedo; 3], ..Medium::scattering([0.7; 3]) };
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let filled = Material { medium: Some(medium), ..Material::new("body", Model::Boundary {}) };
        let filled = material(&mut scene, filled);
        sphere(&mut scene, [0.0; 3], 1.0, filled);
        scene.cameras.push(Camera { clip: Some(clip), ..ahead.clone() });
        let of = |what: &str| format!("{what} within {clip:?} of albedo {albedo}");
        assert_radiance(&of("open"), &scene, &options(8, 256, 4), 1.0, 1e-3);
        let wall = material(&mut scene, Material::emitter("wall", [5.0; 3], true));
        quad(&mut scene, [-50.0, -50.0, -0.4], [100.0, 0.0, 0.0], [0.0, 100.0, 0.0], wall);
        let left = (-0.7 * (5.4 - clip[0].max(4.0))).exp();
        assert_radiance(&of("closed"), &scene, &options(8, 256, 4), 5.0 * left, 3e-3);
    }
}
