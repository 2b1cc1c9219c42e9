//! Rooms lit through windows by the environment: portals keep the mean and reduce noise.

use crate::support::differences::{assert_same_bits, noise};
use crate::support::{assert_radiance, camera, material, measure, options, quad};
use oscura::image::Image;
use oscura::math::DVec3;
use oscura::render::RenderOptions;
use oscura::scene::{Environment, Material, MaterialId, Portal, Scene};
use std::f64::consts::PI;

const WINDOW: [f64; 4] = [-0.5, 0.5, 0.8, 2.0];

fn portal(scene: &mut Scene) {
    let [x0, x1, y0, y1] = WINDOW;
    let corner = DVec3::new(x0, y0, -2.0);
    // Light enters along z.
    let (edge_u, edge_v) = (DVec3::X * (x1 - x0), DVec3::Y * (y1 - y0));
    scene.portals.push(Portal { name: "window".into(), corner, edge_u, edge_v });
}

/// A room of 4 x 3 x 4 metres with a window in its wall at z = -2, under a sky with a bright part.
fn room(wall: MaterialId, scene: &mut Scene) {
    let [x0, x1, y0, y1] = WINDOW;
    let mut side = |corner: [f64; 3], u: [f64; 3], v: [f64; 3]| quad(scene, corner, u, v, wall);
    side([-2.0, 0.0, 2.0], [4.0, 0.0, 0.0], [0.0, 0.0, -4.0]);
    side([-2.0, 3.0, -2.0], [4.0, 0.0, 0.0], [0.0, 0.0, 4.0]);
    side([-2.0, 0.0, 2.0], [0.0, 0.0, -4.0], [0.0, 3.0, 0.0]);
    side([2.0, 0.0, -2.0], [0.0, 0.0, 4.0], [0.0, 3.0, 0.0]);
    side([2.0, 0.0, 2.0], [-4.0, 0.0, 0.0], [0.0, 3.0, 0.0]);
    for [left, right, low, high] in
        [[-2.0, x0, 0.0, 3.0], [x1, 2.0, 0.0, 3.0], [x0, x1, 0.0, y0], [x0, x1, y1, 3.0]]
    {
        side([left, low, -2.0], [right - left, 0.0, 0.0], [0.0, high - low, 0.0]);
    }
}

fn sky(scene: &mut Scene) {
    let rgb = (0..64 * 32).flat_map(|i| {
        let (x, y) = (i % 64, i / 64);
        // Bright patches outside, some visible from the room.
        let value = if (12..15).contains(&x) && (9..12).contains(&y) { 60.0 } else { 1.0 - y as f32 / 40.0 };
        [value; 3]
    });
    let image = scene.add_image(Image::from_linear_rgb("sky", 64, 32, rgb.collect()));
    scene.environment = Environment::Image { image, strength: 1.0, rotation_rad: 0.3 };
}

fn lit_room(with_portal: bool) -> Scene {
    let mut scene = Scene::default();
    sky(&mut scene);
    let grey = material(&mut scene, Material::lambert("grey", [0.6; 3]));
    room(grey, &mut scene);
    if with_portal {
        portal(&mut scene);
    }
    scene.cameras.push(camera(DVec3::new(1.5, 1.6, 1.8), DVec3::new(-0.5, 1.0, -1.0), DVec3::Y, 60.0));
    scene
}

/// Irradiance of a floor point through the window from a sky of radiance 1, by quadrature over the window.
#[test]
fn a_floor_behind_a_window() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    room(grey, &mut scene);
    portal(&mut scene);
    let at = DVec3::new(0.3, 0.0, 0.4);
    scene.cameras.push(camera(at + DVec3::new(0.2, 1.0, 0.1), at, DVec3::Z, 1e-3));
    let [x0, x1, y0, y1] = WINDOW;
    let (mut form, n) = (0.0, 400);
    for k in 0..n * n {
        let u = f64::from(k % n) + 0.5;
        let v = f64::from(k / n) + 0.5;
        let q = DVec3::new(x0 + (x1 - x0) * u / f64::from(n), y0 + (y1 - y0) * v / f64::from(n), -2.0);
        let to = q - at;
        form += to.y * -to.z / to.length_squared().powi(2);
    }
    form *= (x1 - x0) * (y1 - y0) / f64::from(n * n) / PI;
    assert_radiance("through the window", &scene, &options(16, 64, 1), 0.5 * form, 2e-3);
}

/// Furnace test with portals that are no openings: the mean is unchanged.
#[test]
fn misplaced_portals_keep_the_mean() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let white = material(&mut scene, Material::lambert("white", [1.0; 3]));
    scene.shapes.push(oscura::scene::Shape::sphere([0.0; 3], 1.0, white));
    for (corner, u, v) in [
        ([-1.0, -1.0, 2.0], DVec3::Y * 2.0, DVec3::X * 2.0),
        ([1.5, -3.0, -3.0], DVec3::Z * 6.0, DVec3::Y * 6.0),
        ([-0.5, 2.0, -0.5], DVec3::X, DVec3::Z * 0.2),
    ] {
        scene.portals.push(Portal { name: "open".into(), corner: corner.into(), edge_u: u, edge_v: v });
    }
    scene.cameras.push(camera(DVec3::new(3.0, 2.0, 5.0), DVec3::ZERO, DVec3::Y, 30.0));
    assert_radiance("furnace", &scene, &options(16, 256, 4), 1.0, 5e-3);
}

/// The same mean and less noise of direct light; also with indirect light and path sharing.
#[test]
#[ignore = "means of many pictures, which take long"]
fn portals_reduce_noise_and_keep_the_mean() {
    for depth in [1, 6] {
        let options = options(24, 64, depth);
        let (off, on) = (measure(&lit_room(false), &options), measure(&lit_room(true), &options));
        println!("depth {depth}: {off:?} {on:?}");
        assert!((off.0 - on.0).abs() < 4.5 * off.1.hypot(on.1), "depth {depth}: {off:?} {on:?}");
        let options = options.samples(16);
        let ratio = noise(&lit_room(false), &options) / noise(&lit_room(true), &options);
        println!("depth {depth}: {ratio} times less variance");
        assert!(ratio > 3.0, "depth {depth}: {ratio} times less variance");
    }
}

#[test]
fn portals_are_deterministic() {
    let options: RenderOptions = options(16, 8, 4);
    assert_same_bits("portals", &lit_room(true), &options);
}
