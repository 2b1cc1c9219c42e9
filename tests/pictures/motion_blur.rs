//! Motion blur against closed forms, averages of still pictures, and the same motion described otherwise.

use crate::support::{assert_radiance, camera, grey_floor, material, mean, options, picture, quad, sphere};
use oscura::film::Film;
use oscura::math::{DAffine3, DVec3};
use oscura::output::part::Region;
use oscura::scene::{
    Instance, Keyframes, Light, Material, MaterialId, Mesh, Motion, Projection, Scene, Vertices,
};
use oscura::simd::{Level, limit_level};

const SIZE: u32 = 32;

/// An orthographic view of x and y from -1 to 1.
fn front_view(scene: &mut Scene) {
    let mut view = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1.0);
    view.projection = Projection::Orthographic { half_height: 1.0 };
    scene.cameras.push(view);
}

fn moving<T>(keys: Vec<T>) -> Keyframes<T> {
    Keyframes { keys, neighbours: None }
}

fn shift(x: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::X * x)
}

/// Means of the columns of a picture.
fn columns(film: &Film) -> Vec<f64> {
    let rgba = film.rgba();
    let column = |x: u32| (0..SIZE).map(|y| f64::from(rgba[(y * SIZE + x) as usize][1])).sum::<f64>();
    (0..SIZE).map(|x| column(x) / f64::from(SIZE)).collect()
}

fn assert_near(what: &str, found: &[f64], truth: &[f64], tolerance: f64) {
    for (x, (found, truth)) in found.iter().zip(truth).enumerate() {
        assert!((found - truth).abs() <= tolerance, "{what}, column {x}: {found}, not {truth}");
    }
}

fn emissive(scene: &mut Scene) -> MaterialId {
    material(scene, Material::emitter("light", [1.0; 3], true))
}

/// The fraction of time and width for which a bar covers a column: a bar of width `w` whose left edge moves from `x0` by `way`.
fn coverage(column: u32, x0: f64, w: f64, way: f64) -> f64 {
    const STEPS: usize = 20_000;
    let (left, width) = (-1.0 + f64::from(column) * 2.0 / f64::from(SIZE), 2.0 / f64::from(SIZE));
    let at = |step: usize| {
        let x = x0 + way * (step as f64 + 0.5) / STEPS as f64;
        ((x + w).min(left + width) - x.max(left)).max(0.0) / width
    };
    (0..STEPS).map(at).sum::<f64>() / STEPS as f64
}

/// A moving bar as a quad, as a mesh instance and as a mesh with moving vertices. All give the same ramp.
#[test]
fn moving_bar_gives_a_linear_ramp() {
    let (x0, w, way) = (-0.83, 0.3, 0.9);
    let truth: Vec<f64> = (0..SIZE).map(|x| coverage(x, x0, w, way)).collect();
    let positions =
        |x: f32| vec![[x, -2.0, 0.0], [x + w as f32, -2.0, 0.0], [x + w as f32, 2.0, 0.0], [x, 2.0, 0.0]];
    for kind in ["quad", "mesh", "vertices"] {
        let mut scene = Scene::default();
        let light = emissive(&mut scene);
        front_view(&mut scene);
        if kind == "quad" {
            quad(&mut scene, [x0, -2.0, 0.0], [w, 0.0, 0.0], [0.0, 4.0, 0.0], light);
            scene.motion.quads.insert(0, moving(vec![shift(0.0), shift(way)]));
        } else {
            let mesh = Mesh::new("bar", positions(x0 as f32), vec![[0, 1, 2], [0, 2, 3]], light);
            let mesh = scene.add_mesh(mesh);
            let keys = if kind == "mesh" { vec![shift(0.0), shift(way)] } else { Vec::new() };
            scene.instances.push(Instance { motion: Motion::Keyed(0), ..Instance::new(mesh, shift(0.0)) });
            scene.motion.instances.push(moving(keys));
            if kind == "vertices" {
                let key = |x: f64| Vertices { positions: positions(x as f32), normals: Vec::new() };
                let keys = vec![key(x0), key(x0 + 0.5 * way), key(x0 + way)];
                scene.motion.meshes.insert(0, moving(keys));
            }
        }
        let film = picture(&scene, &options(SIZE, 256, 0));
        assert_near(kind, &columns(&film), &truth, 4e-3);
    }
}

/// Motion blur is the average over time: a sphere that moves and rotates equals the mean of many still ones.
#[test]
fn moving_sphere_equals_mean_of_still_frames() {
    const STILL: usize = 64;
    let scene_at = |x: f64| {
        let mut scene = Scene::default();
        let light = emissive(&mut scene);
        front_view(&mut scene);
        sphere(&mut scene, [x, 0.1, 0.0], 0.3, light);
        scene
    };
    let mut blurred = scene_at(-0.5);
    blurred.motion.shapes.insert(0, moving(vec![shift(0.0), shift(1.0)]));
    let blurred = columns(&picture(&blurred, &options(SIZE, 256, 0)));
    let mut sum = vec![0.0; SIZE as usize];
    for k in 0..STILL {
        let still = scene_at(-0.5 + (k as f64 + 0.5) / STILL as f64);
        let still = columns(&picture(&still, &options(SIZE, 16, 0)));
        sum.iter_mut().zip(still).for_each(|(sum, v)| *sum += v / STILL as f64);
    }
    assert_near("ball", &blurred, &sum, 4e-3);
    let total = blurred.iter().sum::<f64>() / f64::from(SIZE);
    assert!((total - std::f64::consts::PI * 0.09 / 4.0).abs() < 1e-3, "{total}");
}

/// A sector that rotates once covers the same fraction of every ring.
#[test]
fn rotating_sector_covers_rings_uniformly() {
    let mut scene = Scene::default();
    let light = emissive(&mut scene);
    front_view(&mut scene);
    let positions = vec![[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
    let mesh = scene.add_mesh(Mesh::new("sector", positions, vec![[0, 1, 2]], light));
    let turn = |k: u32| DAffine3::from_rotation_z(f64::from(k) / 64.0 * std::f64::consts::TAU);
    scene.instances.push(Instance { motion: Motion::Keyed(0), ..Instance::new(mesh, turn(0)) });
    scene.motion.instances.push(moving((0..65).map(turn).collect()));
    let film = picture(&scene, &options(SIZE, 2048, 0));
    // Within the circle that the triangle's far edge leaves free: r < sqrt 2.
    assert!((mean(&film) - 0.25).abs() < 1e-3, "{}", mean(&film));
    let rgba = film.rgba();
    assert!(rgba.iter().all(|pixel| (pixel[1] - 0.25).abs() < 0.03), "every pixel has its quarter");
}

/// Irradiance of a parallel rectangle over the foot of one of its corners (Howell's catalogue, B-3).
fn form_factor(a: f64, b: f64, height: f64) -> f64 {
    let (x, y) = (a / height, b / height);
    let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
    (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / std::f64::consts::TAU
}

/// Lights are sampled at the time of the path: a rectangle that slides across a floor, as a quad and as a mesh, alone and with a
/// second light.
#[test]
fn moving_area_light_averages_over_its_path() {
    let (a, b, height, way) = (1.0, 0.8, 0.7, 2.0);
    let at = |x: f64| form_factor(x + a, b, height) - form_factor(x, b, height);
    let truth = (0..4000).map(|k| at(way * (f64::from(k) + 0.5) / 4000.0)).sum::<f64>() / 4000.0;
    for (is_mesh, others) in [(false, 0), (true, 0), (false, 1)] {
        let mut scene = grey_floor();
        let light = material(&mut scene, Material::emitter("light", [3.0; 3], false));
        let keys = moving(vec![shift(0.0), shift(0.5 * way), shift(way)]);
        if is_mesh {
            let corners = [[0.0, 0.0], [a, 0.0], [a, b], [0.0, b]];
            let positions = corners.map(|[x, z]| [x as f32, 0.0, z as f32]).to_vec();
            let mesh = scene.add_mesh(Mesh::new("lamp", positions, vec![[0, 1, 2], [0, 2, 3]], light));
            let place = DAffine3::from_translation(DVec3::Y * height);
            scene.instances.push(Instance { motion: Motion::Keyed(0), ..Instance::new(mesh, place) });
            scene.motion.instances.push(moving(keys.keys.iter().map(|key| *key * place).collect()));
        } else {
            quad(&mut scene, [0.0, height, 0.0], [a, 0.0, 0.0], [0.0, 0.0, b], light);
            scene.motion.quads.insert(1, keys);
        }
        for _ in 0..others {
            quad(&mut scene, [-1.0, 2.0, -1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], light);
        }
        let other = f64::from(others) * form_factor(1.0, 1.0, 2.0);
        let what = format!("moving lamp, mesh {is_mesh}, {others} others");
        assert_radiance(&what, &scene, &options(8, 64, 1), 0.8 * 3.0 * (truth + other), 4e-3);
    }
}

/// A point light that moves over the floor: the mean of 1 / d^2.
#[test]
fn moving_point_light_averages_over_its_path() {
    let mut scene = grey_floor();
    let place = |x: f64| Light::point([x, 1.0, 0.0], [2.0; 3]);
    let keys = vec![place(-1.0).kind, place(2.0).kind];
    scene.lights.push(Light { motion: Some(moving(keys)), ..place(0.5) });
    let at = |x: f64| 2.0 / (1.0 + x * x) / (1.0 + x * x).sqrt();
    let irradiance = (0..4000).map(|k| at(-1.0 + 3.0 * (f64::from(k) + 0.5) / 4000.0)).sum::<f64>() / 4000.0;
    let truth = 0.8 * irradiance / std::f64::consts::PI;
    assert_radiance("moving point", &scene, &options(8, 64, 1), truth, 2e-3);
}

/// Two point lights that start at the same position and move apart, and a static one there: each has its own motion.
#[test]
fn coincident_lights_keep_their_own_motion() {
    let place = |x: f64| Light::point([x, 1.0, 0.0], [2.0; 3]);
    let at = |x: f64| 2.0 / (1.0 + x * x) / (1.0 + x * x).sqrt();
    let mean_to = |way: f64| (0..4000).map(|k| at(way * (f64::from(k) + 0.5) / 4000.0)).sum::<f64>() / 4000.0;
    let mut scene = grey_floor();
    for way in [3.0, -1.0] {
        let keys = vec![place(0.0).kind, place(way).kind];
        scene.lights.push(Light { motion: Some(moving(keys)), ..place(0.0) });
    }
    scene.lights.push(place(0.0));
    let truth = 0.8 * (mean_to(3.0) + mean_to(-1.0) + at(0.0)) / std::f64::consts::PI;
    assert_radiance("three lights", &scene, &options(8, 64, 1), truth, 4e-3);
}

/// A moving camera sees what a still camera sees of a world that moves the other way.
#[test]
fn moving_camera_equals_world_moving_backwards() {
    let world = || {
        let mut scene = Scene::default();
        let light = emissive(&mut scene);
        quad(&mut scene, [-0.4, -0.5, 0.0], [0.5, 0.2, 0.0], [0.1, 0.9, 0.3], light);
        let view = camera(DVec3::new(0.2, 0.1, 3.0), DVec3::ZERO, DVec3::Y, 40.0);
        scene.cameras.push(view);
        scene
    };
    let (mut by_camera, mut by_world) = (world(), world());
    let place = by_camera.cameras[0].world_from_camera;
    let keys = vec![shift(-0.2) * place, shift(0.2) * place];
    by_camera.cameras[0].motion = Some(moving(keys));
    by_world.motion.quads.insert(0, moving(vec![shift(0.2), shift(-0.2)]));
    let [a, b] = [by_camera, by_world].map(|scene| columns(&picture(&scene, &options(SIZE, 64, 0))));
    assert_near("camera", &a, &b, 1e-3);
}

/// A lit scene with a rotating box that casts a moving shadow.
fn busy() -> Scene {
    let mut scene = grey_floor();
    let red = material(&mut scene, Material::lambert("red", [0.8, 0.2, 0.1]));
    let light = material(&mut scene, Material::emitter("light", [9.0; 3], false));
    quad(&mut scene, [-1.0, 3.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], light);
    sphere(&mut scene, [0.4, 0.5, 0.2], 0.4, red);
    scene.motion.shapes.insert(0, moving(vec![shift(-0.3), shift(0.1), shift(0.3)]));
    let positions = vec![[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 1.0, 0.3], [0.0, 0.2, 0.8]];
    let triangles = vec![[0, 1, 2], [1, 3, 2], [3, 0, 2], [0, 3, 1]];
    let mesh = scene.add_mesh(Mesh::new("body", positions, triangles, red));
    let turn = |k: u32| DAffine3::from_rotation_y(0.1 * f64::from(k)) * shift(-0.7);
    scene.instances.push(Instance { motion: Motion::Keyed(0), ..Instance::new(mesh, turn(0)) });
    scene.motion.instances.push(moving((0..5).map(turn).collect()));
    scene.cameras = vec![camera(DVec3::new(0.0, 2.0, 4.0), DVec3::Y * 0.4, DVec3::Y, 45.0)];
    scene
}

#[test]
fn crops_and_thread_counts_give_the_same_bits() {
    let (scene, options) = (busy(), options(SIZE, 8, 4));
    let whole = picture(&scene, &options);
    let region = Region { x0: 5, y0: 9, x1: 22, y1: 25 };
    let part = picture(&scene, &options.region(region));
    let pixels = whole.rgba();
    let rows = pixels.chunks(SIZE as usize).skip(9).take(16).flat_map(|row| row[5..22].to_vec());
    assert_eq!(part.rgba(), rows.collect::<Vec<_>>());
    for level in Level::ALL {
        limit_level(level);
        assert_eq!(picture(&scene, &options).rgba(), whole.rgba(), "{}", level.name());
    }
    limit_level(Level::HIGHEST);
    let alone = oscura::render::in_pool(Some(1), || picture(&scene, &options)).expect("a thread");
    assert_eq!(alone.rgba(), whole.rgba());
}

/// Equal keyframes mean no motion, for every primitive type.
#[test]
fn equal_keyframes_mean_no_motion() {
    let (mut still, mut keyed) = (busy(), busy());
    still.motion = Default::default();
    still.instances[0].motion = Motion::Still;
    let place = still.instances[0].world_from_object;
    keyed.motion.instances[0].keys = vec![place; 3];
    keyed.motion.shapes.insert(0, moving(vec![DAffine3::IDENTITY; 2]));
    let options = options(SIZE, 64, 3);
    let [a, b] = [&still, &keyed].map(|scene| mean(&picture(scene, &options)));
    assert!((a - b).abs() < 4e-3 * a, "{a} {b}");
    // A keyframe with a singular transform: the object is absent at that time, and nothing else changes.
    keyed.motion.instances[0].keys = vec![place, DAffine3::ZERO, place];
    assert!(mean(&picture(&keyed, &options)).is_finite());
}
