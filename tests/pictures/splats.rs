//! Gaussian splats against closed forms: opacity, order, view-dependent colour, shadows and illumination.

use crate::support::{assert_radiance, camera, disk, floor, material, options, picture, quad};
use oscura::film::Film;
use oscura::math::{DAffine3, DMat3, DQuat, DVec3};
use oscura::render::in_pool;
use oscura::scene::{
    ColorSlot, Emission, Environment, FloatSlot, Instance, Keyframes, Light, LightKind, Material, Mesh,
    MeshPart, Model, Motion, Projection, Scene, Splats, f16,
};
use std::f64::consts::PI;
use std::sync::Arc;

/// A splat of one linear colour.
#[derive(Clone, Copy)]
struct Ball {
    center: [f32; 3],
    scales: [f32; 3],
    rotation: DQuat,
    opacity: f32,
    color: f32,
}

const BALL: Ball =
    Ball { center: [0.0; 3], scales: [0.3; 3], rotation: DQuat::IDENTITY, opacity: 0.8, color: 0.5 };

/// The first harmonic.
const Y00: f32 = 0.282_094_8;

fn of_color(color: f32) -> f16 {
    f16::from_f32((color - 0.5) / Y00)
}

/// The colour after quantisation.
fn kept(color: f32) -> f64 {
    f64::from(of_color(color).to_f32() * Y00 + 0.5)
}

fn splats(balls: &[Ball]) -> Splats {
    Splats {
        scales: balls.iter().map(|b| b.scales).collect(),
        rotations: balls.iter().map(|b| b.rotation.as_quat().to_array()).collect(),
        opacities: balls.iter().map(|b| b.opacity).collect(),
        degree: 0,
        coefficients: balls.iter().map(|b| [of_color(b.color); 3]).collect(),
        is_linear: true,
    }
}

/// The material that splats of files have.
fn emissive() -> Material {
    let emission = Some(Emission { radiance: ColorSlot::constant([1.0; 3]), two_sided: true });
    Material { emission, use_vertex_colors: true, ..Material::new("splats", Model::Black) }
}

fn place(scene: &mut Scene, centers: Vec<[f32; 3]>, splats: Splats, world_from_object: DAffine3) {
    let material = material(scene, emissive());
    let parts = vec![MeshPart { first_triangle: 0, triangle_count: 0, material }];
    let mesh = Mesh { positions: centers, splats: Some(Arc::new(splats)), parts, ..Mesh::default() };
    let mesh = scene.add_mesh(mesh);
    scene.instances.push(Instance::new(mesh, world_from_object));
}

fn add(scene: &mut Scene, balls: &[Ball]) {
    place(scene, balls.iter().map(|b| b.center).collect(), splats(balls), DAffine3::IDENTITY);
}

/// Orthographic rays around one line, through `at` from `from`.
fn ray(from: DVec3, at: DVec3) -> oscura::scene::Camera {
    let up = if (from - at).normalize().y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    let mut view = camera(from, at, up, 1.0);
    view.projection = Projection::Orthographic { half_height: 1e-4 };
    view
}

/// The peak of a splat's opacity along a ray: position and opacity.
fn peak(ball: &Ball, origin: DVec3, direction: DVec3) -> (f64, f64) {
    let local = |v: DVec3| (ball.rotation.inverse() * v) / DVec3::from(ball.scales.map(f64::from));
    let (p, w) = (local(origin - DVec3::from(ball.center.map(f64::from))), local(direction));
    let t = -p.dot(w) / w.dot(w);
    (t, f64::from(ball.opacity) * (-0.5 * (p + w * t).length_squared()).exp())
}

/// Front-to-back compositing along a ray, over a background.
fn composite(balls: &[Ball], origin: DVec3, direction: DVec3, background: f64) -> f64 {
    let mut found: Vec<(f64, f64, f64)> = balls
        .iter()
        .map(|ball| (peak(ball, origin, direction), kept(ball.color)))
        .map(|((t, opacity), color)| (t, opacity, color))
        .filter(|(t, opacity, _)| *t > 0.0 && *opacity >= f64::from(Splats::MIN_OPACITY))
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let over = |(sum, left): (f64, f64), (_, opacity, color): &(f64, f64, f64)| {
        (sum + left * opacity * color, left * (1.0 - opacity))
    };
    let (sum, left) = found.iter().fold((0.0, 1.0), over);
    sum + left * background
}

/// With a diffuse material splats are lit: in a furnace of radiance 1 they have the radiance of their albedo.
#[test]
fn splats_of_a_diffuse_material_are_lit_by_the_scene() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let ball = Ball { scales: [0.5, 0.4, 0.001], color: 0.25, ..BALL };
    add(&mut scene, &[ball]);
    let white = Material { use_vertex_colors: true, ..Material::lambert("white", [1.0; 3]) };
    scene.instances[0].material = Some(material(&mut scene, white));
    let (from, at) = (DVec3::new(0.1, 0.1, 4.0), DVec3::new(0.1, 0.1, 0.0));
    scene.cameras.push(ray(from, at));
    let truth = composite(&[ball], from, at - from, 1.0);
    assert!(truth < 0.7, "{truth}");
    assert_radiance("a diffuse splat", &scene, &options(16, 256, 4), truth, 3e-3);
    scene.environment = Environment::Constant([0.0; 3]);
    assert_radiance("without light", &scene, &options(16, 64, 4), 0.0, 1e-9);
}

#[test]
fn one_splat_has_the_profile_of_a_gaussian() {
    let turned = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
    let long = Ball { scales: [0.5, 0.1, 0.2], rotation: turned, ..BALL };
    for ball in [BALL, long] {
        for offset in [0.0, 0.2, 0.45, 0.8] {
            let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
            add(&mut scene, &[ball]);
            let (from, at) = (DVec3::new(offset, 0.1, 4.0), DVec3::new(offset, 0.1, 0.0));
            scene.cameras.push(ray(from, at));
            let truth = composite(&[ball], from, at - from, 1.0);
            assert_radiance(&format!("splat at {offset}"), &scene, &options(16, 256, 2), truth, 3e-3);
            let film = picture(&scene, &options(16, 256, 2));
            assert_eq!(film.mean_rgba(3, 3)[3], 1.0, "the environment is seen behind it");
        }
    }
}

/// Alpha is the opacity of the splats.
#[test]
fn alpha_is_the_opacity_of_splats() {
    let mut scene = Scene::default();
    scene.environment_visible_to = oscura::scene::RayKinds::NONE;
    add(&mut scene, &[BALL]);
    let (from, at) = (DVec3::new(0.2, 0.0, 4.0), DVec3::new(0.2, 0.0, 0.0));
    scene.cameras.push(ray(from, at));
    let film = picture(&scene, &options(32, 256, 2));
    let count = 32 * 32;
    let alpha: f64 = film.rgba().iter().map(|p| f64::from(p[3])).sum::<f64>() / f64::from(count);
    let truth = peak(&BALL, from, at - from).1;
    let error = (truth * (1.0 - truth) / f64::from(count * 256)).sqrt();
    assert!((alpha - truth).abs() < 4.0 * error, "{alpha}, not {truth} +- {error}");
}

#[test]
fn overlapping_splats_are_composited_in_order() {
    let near = Ball { center: [0.1, 0.0, 0.2], color: 0.9, opacity: 0.6, ..BALL };
    let far = Ball { center: [-0.1, 0.1, -0.1], color: 0.2, opacity: 0.7, scales: [0.4, 0.2, 0.3], ..BALL };
    let mut truths = Vec::new();
    for side in [4.0, -4.0] {
        let mut scene = Scene { environment: Environment::Constant([0.4; 3]), ..Scene::default() };
        add(&mut scene, &[near, far]);
        let (from, at) = (DVec3::new(0.0, 0.05, side), DVec3::new(0.0, 0.05, 0.0));
        scene.cameras.push(ray(from, at));
        truths.push(composite(&[near, far], from, at - from, 0.4));
        assert_radiance(
            &format!("two from {side}"),
            &scene,
            &options(16, 256, 2),
            truths[truths.len() - 1],
            3e-3,
        );
    }
    assert!((truths[0] - truths[1]).abs() > 0.1, "the order matters: {truths:?}");
}

/// Numbers in 0..1.
fn random(state: &mut u64) -> f32 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f32 / (1u64 << 24) as f32
}

fn many(count: usize) -> Vec<Ball> {
    let mut state = 11;
    let mut next = |scale: f32| random(&mut state) * scale;
    (0..count)
        .map(|_| Ball {
            center: [next(2.0) - 1.0, next(2.0) - 1.0, next(2.0) - 1.0],
            scales: [0.02 + next(0.2), 0.02 + next(0.2), 0.01 + next(0.1)],
            rotation: DQuat::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), f64::from(next(6.0))),
            opacity: 0.02 + next(0.97),
            color: next(1.0),
        })
        .collect()
}

/// BVH traversal of many splats matches compositing in sorted order.
#[test]
fn many_splats_are_composited_in_order() {
    let balls = many(600);
    let mut scene = Scene { environment: Environment::Constant([0.7; 3]), ..Scene::default() };
    add(&mut scene, &balls);
    let mut state = 3;
    for k in 0..8 {
        let mut place = || DVec3::from([(); 3].map(|()| f64::from(random(&mut state)) - 0.5));
        let at = place();
        let from = at + place().normalize() * 6.0;
        scene.cameras = vec![ray(from, at)];
        let truth = composite(&balls, from, at - from, 0.7);
        assert_radiance(&format!("many, ray {k}"), &scene, &options(16, 128, 2), truth, 6e-3);
    }
}

/// Real spherical harmonics with the Condon-Shortley phase, by the recurrence of the associated Legendre functions.
fn harmonic(l: i32, m: i32, d: DVec3) -> f64 {
    let (a, z) = (m.abs(), d.z);
    let sine = (1.0 - z * z).max(0.0).sqrt();
    let mut diagonal = 1.0;
    (1..=a).for_each(|k| diagonal *= -f64::from(2 * k - 1) * sine);
    let (mut before, mut here) = (0.0, diagonal);
    for k in a + 1..=l {
        let next = (z * f64::from(2 * k - 1) * here - f64::from(k + a - 1) * before) / f64::from(k - a);
        (before, here) = (here, next);
    }
    let factorial = |n: i32| (1..=n).map(f64::from).product::<f64>();
    let norm = (f64::from(2 * l + 1) / (4.0 * PI) * factorial(l - a) / factorial(l + a)).sqrt();
    let phi = d.y.atan2(d.x) * f64::from(a);
    let turn = match m {
        0 => 1.0,
        m if m > 0 => std::f64::consts::SQRT_2 * phi.cos(),
        _ => std::f64::consts::SQRT_2 * phi.sin(),
    };
    norm * here * turn
}

/// Coefficients of degree 3, equal in all channels.
fn coefficients() -> [f16; 16] {
    let mut state = 5;
    std::array::from_fn(|i| f16::from_f32((random(&mut state) - 0.5) * if i == 0 { 0.5 } else { 0.6 }))
}

/// The colour along a direction in object space.
fn color_along(d: DVec3) -> f64 {
    let all = (0..4).flat_map(|l| (-l..=l).map(move |m| (l, m)));
    let sum: f64 = all.zip(coefficients()).map(|((l, m), c)| f64::from(c.to_f32()) * harmonic(l, m, d)).sum();
    (sum + 0.5).max(0.0)
}

fn with_harmonics() -> Splats {
    Splats {
        opacities: vec![1.0],
        degree: 3,
        coefficients: coefficients().map(|c| [c; 3]).to_vec(),
        ..splats(&[BALL])
    }
}

/// An opaque splat shows the colour for the direction in object space, under any rotation.
#[test]
fn harmonics_rotate_with_the_object() {
    let mut state = 8;
    let mut seen = Vec::new();
    for k in 0..10 {
        let mut vector = || DVec3::from([(); 3].map(|()| f64::from(random(&mut state)) - 0.5));
        let turn = DQuat::from_axis_angle(vector().normalize(), 2.0 * k as f64);
        let scale = DVec3::new(0.7, 1.5, 1.0 + 0.1 * f64::from(k));
        let world_from_object = DAffine3::from_scale_rotation_translation(scale, turn, vector());
        let mut scene = Scene::default();
        place(&mut scene, vec![[0.0; 3]], with_harmonics(), world_from_object);
        let at = world_from_object.translation;
        let from = at + vector().normalize() * 5.0;
        scene.cameras.push(ray(from, at));
        let along = (world_from_object.matrix3.inverse() * (at - from)).normalize();
        seen.push(color_along(along));
        assert_radiance(&format!("turned {k}"), &scene, &options(8, 64, 2), color_along(along), 1e-3);
    }
    let (least, most) = seen.iter().fold((9.0f64, 0.0f64), |(l, m), &v| (l.min(v), m.max(v)));
    assert!(most - least > 0.3, "the colours differ: {seen:?}");
}

fn mirror(reflectance: f32) -> Model {
    let color = ColorSlot::constant([reflectance; 3]);
    Model::SchlickMetal { color, roughness: FloatSlot::constant(0.0) }
}

/// In a mirror it has the colour for the reflected direction.
#[test]
fn a_mirror_shows_the_colour_of_the_reflected_direction() {
    let mut scene = Scene::default();
    let silver = mirror(1.0);
    let silver = material(&mut scene, Material::new("mirror", silver));
    disk(&mut scene, [0.0; 3], [0.0, 0.0, 1.0], 1.0, silver);
    place(&mut scene, vec![[1.0, 0.5, 2.0]], with_harmonics(), DAffine3::IDENTITY);
    let reflected = DVec3::new(1.0, 0.5, 2.0).normalize();
    let from = DVec3::new(-1.0, -0.5, 2.0) * 2.0;
    scene.cameras.push(ray(from, DVec3::ZERO));
    assert_radiance("mirror", &scene, &options(8, 64, 4), color_along(reflected), 1e-3);
}

/// A dark splat attenuates light by its opacity, and a second one the rest.
#[test]
fn shadows_follow_opacity() {
    let dark = Ball { center: [0.25, 4.0, 0.0], color: 0.0, ..BALL };
    let other = Ball { center: [0.0, 5.0, 0.1], color: 0.0, opacity: 0.5, ..BALL };
    let left = |balls: &[Ball]| balls.iter().map(|b| 1.0 - peak(b, DVec3::ZERO, DVec3::Y).1).product::<f64>();
    for balls in [vec![dark], vec![dark, other]] {
        let mut scene = floor(Material::lambert("white", [1.0; 3]));
        add(&mut scene, &balls);
        scene.lights.push(Light::new(LightKind::Directional { direction: -DVec3::Y }, [PI as f32; 3]));
        assert_radiance("shadow", &scene, &options(16, 256, 1), left(&balls), 4e-3);
    }
}

/// Irradiance below a splat in closed form: the squared distance from the centre of rays from a point at the height h is (h
/// sin)^2, so that E = 2 pi c o s^2 / h^2 (1 - 1 / (255 o)) for a splat of standard deviation s.
#[test]
fn splats_illuminate_surfaces() {
    let glowing = Ball { center: [0.0, 1.0, 0.0], scales: [0.1; 3], opacity: 0.9, color: 3.0, ..BALL };
    let mut scene = floor(Material::lambert("white", [0.8; 3]));
    add(&mut scene, &[glowing]);
    let end = 1.0 - f64::from(Splats::MIN_OPACITY) / 0.9;
    let irradiance = 2.0 * PI * kept(3.0) * 0.9 * 0.01 * end;
    assert_radiance("light of a splat", &scene, &options(16, 1024, 1), 0.8 / PI * irradiance, 1e-2);
}

/// A splat that crosses the ray has its opacity averaged over time.
#[test]
fn splats_have_motion_blur() {
    let mut scene = Scene { environment: Environment::Constant([0.0; 3]), ..Scene::default() };
    let ball = Ball { color: 1.0, scales: [0.2; 3], ..BALL };
    add(&mut scene, &[ball]);
    scene.instances[0].motion = Motion::Keyed(0);
    let keys = [-1.0, 1.0].map(|x| DAffine3::from_translation(DVec3::X * x)).to_vec();
    scene.motion.instances.push(Keyframes { keys, neighbours: None });
    scene.cameras.push(ray(DVec3::Z * 4.0, DVec3::ZERO));
    // The integral over |x| < 1 of the Gaussian where it is above 1/255, by the midpoint rule.
    let steps = 100_000;
    let opacity = |i: i32| {
        let x = (f64::from(i) + 0.5) / f64::from(steps) * 2.0 - 1.0;
        let opacity = 0.8 * (-0.5 * x * x / 0.04).exp();
        if opacity >= f64::from(Splats::MIN_OPACITY) { opacity } else { 0.0 }
    };
    let truth = (0..steps).map(opacity).sum::<f64>() / f64::from(steps) * kept(1.0);
    assert_radiance("moving", &scene, &options(16, 512, 2), truth, 1e-2);
}

/// Rows of a picture of many splats with a floor, a light and a mirror.
pub fn busy() -> Scene {
    let mut scene = floor(Material::lambert("white", [0.7; 3]));
    add(&mut scene, &many(300));
    let silver = mirror(0.9);
    let silver = material(&mut scene, Material::new("mirror", silver));
    disk(&mut scene, [1.5, 0.5, 0.0], [-1.0, 0.0, 0.3], 1.0, silver);
    let lamp = material(&mut scene, Material::emitter("lamp", [5.0; 3], true));
    quad(&mut scene, [-0.5, 3.0, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], lamp);
    scene.cameras = vec![camera(DVec3::new(-3.0, 1.0, 3.0), DVec3::new(0.3, 0.3, 0.0), DVec3::Y, 40.0)];
    scene
}

#[test]
fn splats_are_deterministic() {
    let scene = busy();
    let bits = |film: Film| film.rgba().iter().flatten().map(|x| x.to_bits()).collect::<Vec<u32>>();
    let with = |threads: usize| {
        bits(in_pool(Some(threads), || picture(&scene, &options(48, 16, 5))).expect("a pool"))
    };
    assert_eq!(with(1), with(2));
}

/// Rotating world and camera together changes nothing but noise.
#[test]
fn instanced_splats_match_untransformed_ones() {
    let (mut plain, mut turned) = (busy(), busy());
    let turn = DAffine3::from_mat3_translation(DMat3::from_rotation_y(2.2), DVec3::new(10.0, 3.0, -7.0));
    turned.instances[0].world_from_object = turn;
    let view = plain.cameras[0].world_from_camera;
    turned.cameras[0].world_from_camera = turn * view;
    for scene in [&mut plain, &mut turned] {
        scene.quads.clear();
        scene.shapes.clear();
        scene.environment = Environment::Constant([0.3; 3]);
    }
    let means = [plain, turned].map(|scene| crate::support::measure(&scene, &options(24, 64, 2)));
    let [(a, da), (b, db)] = means;
    assert!((a - b).abs() < 4.5 * (da * da + db * db).sqrt(), "{a} +- {da}, {b} +- {db}");
}
