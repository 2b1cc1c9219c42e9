//! Learned light selection: the same expected value, less noise where lights are occluded, and deterministic.

use crate::support::differences::{assert_same_bits, differences, noise};
use crate::support::{camera, material, options, quad, rendering, sphere};
use oscura::math::DVec3;
use oscura::render::{Guiding, LightSelection, PathReuse, RenderOptions, Splitting};
use oscura::scene::{Environment, Light, LightKind, Material, Scene};

/// Options that differ in light selection only.
fn plain(options: RenderOptions) -> RenderOptions {
    options.path_reuse(PathReuse::Off).splitting(Splitting::OFF).guiding(Guiding::Off)
}

/// A grid of rooms of 4 x 4 x 3 metres, each with a light; the camera is in the second of the second row. `is_open`: without
/// walls.
fn rooms(count: u32, of_points: bool, is_open: bool) -> Scene {
    const SIZE: f64 = 4.0;
    let mut scene = Scene::default();
    let wall = material(&mut scene, Material::lambert("wall", [0.7; 3]));
    let floor = material(&mut scene, Material::lambert("floor", [0.5, 0.35, 0.2]));
    let lamp = material(&mut scene, Material::emitter("lamp", [30.0, 28.0, 25.0], false));
    let length = f64::from(count) * SIZE;
    quad(&mut scene, [0.0; 3], [length, 0.0, 0.0], [0.0, 0.0, length], floor);
    quad(&mut scene, [0.0, 3.0, 0.0], [length, 0.0, 0.0], [0.0, 0.0, length], wall);
    for i in (0..=count).filter(|_| !is_open) {
        let at = f64::from(i) * SIZE;
        quad(&mut scene, [at, 0.0, 0.0], [0.0, 0.0, length], [0.0, 3.0, 0.0], wall);
        quad(&mut scene, [0.0, 0.0, at], [length, 0.0, 0.0], [0.0, 3.0, 0.0], wall);
    }
    for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (f64::from(i), f64::from(j)))) {
        let (x, z) = (i * SIZE, j * SIZE);
        sphere(&mut scene, [x + 1.2, 0.5, z + 1.3], 0.5, floor);
        if of_points {
            let point = LightKind::Point { position: DVec3::new(x + 2.0, 2.5, z + 2.0) };
            scene.lights.push(Light::new(point, [(3.0 + i + 2.0 * j) as f32; 3]));
        } else {
            quad(&mut scene, [x + 1.7, 2.9, z + 1.7], [0.6, 0.0, 0.0], [0.0, 0.0, 0.6], lamp);
        }
    }
    let eye = DVec3::new(4.6, 1.5, 6.2);
    scene.cameras.push(camera(eye, DVec3::new(6.5, 1.0, 4.4), DVec3::Y, 75.0));
    scene
}

/// Rooms under an occluded sky.
fn rooms_under_a_sky() -> Scene {
    Scene { environment: Environment::Constant([3.0; 3]), ..rooms(3, false, false) }
}

#[test]
fn selection_is_learned_where_lights_are_occluded() {
    let cases = [
        ("lamps", rooms(4, false, false), true),
        ("points", rooms(8, true, false), true),
        ("hall", rooms(4, false, true), false),
        ("sky", rooms_under_a_sky(), true),
    ];
    for (what, scene, is_learned) in cases {
        for seed in [0, 1] {
            let mut rendering = rendering(&scene, &plain(options(96, 32, 8)).seed(seed));
            rendering.next_pass();
            assert_eq!(rendering.statistics().light_cells.is_some(), is_learned, "{what}, {seed}");
        }
    }
}

#[test]
fn learned_selection_reduces_noise_and_keeps_the_mean() {
    for (what, scene, most) in [
        ("lamps", rooms(4, false, false), 0.4),
        ("points", rooms(4, true, false), 0.8),
        ("sky", rooms_under_a_sky(), 0.8),
    ] {
        let options = plain(options(48, 64, 4));
        let estimated = options.light_selection(LightSelection::Estimated);
        let learned = options.light_selection(LightSelection::Learned);
        let [before, after] = [estimated, learned].map(|options| noise(&scene, &options));
        println!("{what}: noise {before:.2e}, learned {after:.2e}");
        assert!(after < most * before, "{what}: {after} {before}");
        let found = differences(&scene, [&estimated, &learned], 8);
        let (mean, error) = found.whole;
        println!("{what}: {mean:.1e} +- {error:.1e}");
        assert!(mean.abs() < 4.5 * error && error < 5e-3, "{what}: {mean} +- {error}");
    }
}

#[test]
fn learned_selection_is_deterministic() {
    let options = plain(options(40, 16, 8)).light_selection(LightSelection::Learned);
    assert_same_bits("lamps", &rooms(3, false, false), &options);
    assert_same_bits("sky", &rooms_under_a_sky(), &options);
}

#[test]
fn unsupported_learned_selection_is_reported() {
    let messages = |scene: &Scene, options: RenderOptions| {
        let mut rendering = rendering(scene, &options.light_selection(LightSelection::Learned));
        rendering.run();
        rendering.warnings().iter().map(ToString::to_string).collect::<String>()
    };
    assert!(messages(&rooms(1, false, false), plain(options(40, 16, 8))).contains("nothing to select"));
    assert!(messages(&rooms(2, false, false), plain(options(8, 2, 8))).contains("too few samples"));
}
