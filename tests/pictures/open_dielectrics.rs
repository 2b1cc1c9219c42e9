//! Open (non-closed) dielectric surfaces, which refract by the side of their normal and keep radiance: closed forms from the
//! camera and by light tracing, and the same expected value with all techniques.

use crate::support::differences::{assert_same_bits, assert_same_means};
use crate::support::{assert_radiance, camera, gltf_glass, material, options, quad};
use oscura::math::DVec3;
use oscura::render::{Caustics, Guiding, PathReuse, Splitting};
use oscura::scene::{
    ColorSlot, Environment, GlassReflection, Light, LightKind, Material, Model, PbrMaterial, Projection,
    Scene,
};
use std::f64::consts::PI;

const IOR: f64 = 1.5;

fn glass(roughness: f32) -> Material {
    colored(roughness, 1.0, GlassReflection::White)
}

/// Tints of transmission and reflection.
fn colored(roughness: f32, share: f32, glass_reflection: GlassReflection) -> Material {
    let pbr = PbrMaterial {
        base_color: ColorSlot::constant([share; 3]),
        glass_reflection,
        keeps_radiance: true,
        ..gltf_glass(roughness)
    };
    Material::new("sheet", Model::Pbr(Box::new(pbr)))
}

/// A square of glass through the origin; its normal is `front`.
fn sheet(scene: &mut Scene, front: DVec3, half: f64, of: Material) {
    let of = material(scene, of);
    let u = front.cross(DVec3::new(0.3, 0.2, 0.9)).normalize() * (2.0 * half);
    let v = front.cross(u);
    let corner = -(u + v) / 2.0;
    quad(scene, corner.to_array(), u.to_array(), v.to_array(), of);
}

/// Reflectance for light from a direction and the refracted direction; `eta` is the index behind the surface, whose normal is on
/// the side of `wo`.
fn fresnel(wo: DVec3, normal: DVec3, eta: f64) -> (f64, DVec3) {
    let c = wo.dot(normal);
    let squared = 1.0 - (1.0 - c * c) / (eta * eta);
    if squared <= 0.0 {
        return (1.0, DVec3::ZERO);
    }
    let t = squared.sqrt();
    let (s, p) = ((c - eta * t) / (c + eta * t), (eta * c - t) / (eta * c + t));
    ((s * s + p * p) / 2.0, -wo / eta + normal * (c / eta - t))
}

/// A directional environment shows where light is refracted from: Snell's law from both sides, with total internal reflection
/// behind; the radiance is that of the environment.
#[test]
fn open_dielectric_refracts_and_keeps_radiance() {
    assert_refracted(&glass(0.0), |reflectance| [reflectance, 1.0 - reflectance]);
}

/// A tinted reflection tints both alike; without reflection all light that can pass is transmitted.
#[test]
fn reflection_tint_of_open_dielectrics() {
    let tinted = colored(0.0, 0.6, GlassReflection::Tinted);
    assert_refracted(&tinted, |reflectance| [0.6 * reflectance, 0.6 * (1.0 - reflectance)]);
    let clear = colored(0.0, 0.6, GlassReflection::None);
    assert_refracted(&clear, |reflectance| [0.0, if reflectance < 1.0 { 0.6 } else { 0.0 }]);
}

/// Asserts what is seen of a directional environment, for given reflection and transmission tints.
fn assert_refracted(of: &Material, shares: impl Fn(f64) -> [f64; 2]) {
    let front = DVec3::new(0.6, 0.8, 0.0);
    for degrees in [0.0f64, 30.0, 75.0, 150.0, 120.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let wo = front * cos + DVec3::new(-0.8, 0.6, 0.0) * sin;
        let mut scene = Scene {
            environment: Environment::Gradient { nadir: [0.2; 3], zenith: [2.0; 3] },
            ..Scene::default()
        };
        sheet(&mut scene, front, 50.0, of.clone());
        let mut view = camera(wo * 5.0, DVec3::ZERO, DVec3::Z, 1.0);
        view.projection = Projection::Orthographic { half_height: 0.1 };
        scene.cameras.push(view);
        let (normal, eta) = if cos > 0.0 { (front, IOR) } else { (-front, 1.0 / IOR) };
        let (reflectance, refracted) = fresnel(wo, normal, eta);
        let sky = |d: DVec3| 1.1 + 0.9 * d.y;
        let mirrored = normal * (2.0 * wo.dot(normal)) - wo;
        let [mirrors, refracts] = shares(reflectance);
        let truth = mirrors * sky(mirrored) + refracts * sky(refracted);
        let what = format!("{degrees} degrees, {mirrors} and {refracts}");
        assert_radiance(&what, &scene, &options(16, 256, 4), truth, 2e-3);
    }
}

/// White furnace: the sheet is invisible, rough or smooth, from either side.
#[test]
fn open_dielectric_in_a_white_furnace() {
    for (roughness, side) in [(0.0, 1.0), (0.0, -1.0), (0.4, 1.0), (0.4, -1.0)] {
        let mut scene = Scene { environment: Environment::Constant([0.7; 3]), ..Scene::default() };
        sheet(&mut scene, DVec3::Y, 50.0, glass(roughness));
        scene.cameras.push(camera(DVec3::new(3.0, 4.0 * side, 1.0), DVec3::ZERO, DVec3::Z, 10.0));
        let what = format!("roughness {roughness}, side {side}");
        assert_radiance(&what, &scene, &options(16, 64, 20), 0.7, 2e-3);
    }
}

/// A floor 2 below a sheet in a black roof, seen where light from a direction through the sheet's middle arrives.
fn roofed(front: f64, towards_floor: DVec3, kind: LightKind) -> Scene {
    let mut scene = Scene::default();
    let of = material(&mut scene, glass(0.0));
    quad(&mut scene, [-1.0, 0.0, front], [2.0, 0.0, 0.0], [0.0, 0.0, -2.0 * front], of);
    let black = material(&mut scene, Material::lambert("black", [0.0; 3]));
    for (x, z, width, depth) in [
        (-30.0, -30.0, 29.0, 60.0),
        (1.0, -30.0, 29.0, 60.0),
        (-1.0, -30.0, 2.0, 29.0),
        (-1.0, 1.0, 2.0, 29.0),
    ] {
        quad(&mut scene, [x, 0.0, z], [width, 0.0, 0.0], [0.0, 0.0, depth], black);
    }
    let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
    quad(&mut scene, [-60.0, -2.0, 60.0], [120.0, 0.0, 0.0], [0.0, 0.0, -120.0], grey);
    let at = towards_floor * (-2.0 / towards_floor.y);
    let mut view = camera(at + DVec3::Y, at, DVec3::Z, 1.0);
    view.projection = Projection::Orthographic { half_height: 0.25 };
    scene.cameras.push(view);
    scene.lights.push(Light::new(kind, [3.0; 3]));
    scene
}

/// The sun through a sheet: camera paths see its disk in a cone that is narrower by the squared index where light comes from the
/// front, and wider from behind, at the same radiance. A directional light is equivalent, by light tracing.
#[test]
fn sun_through_an_open_dielectric() {
    sun_through_a_sheet(64, 3.0);
}

#[test]
#[ignore = "many samples, which take long"]
fn sun_through_an_open_dielectric_precisely() {
    sun_through_a_sheet(512, 1.0);
}

/// With a number of light-tracing samples, and a bound of the standard errors in percent.
fn sun_through_a_sheet(samples: u32, percent: f64) {
    let direction = DVec3::new(0.36, -0.96, 0.48).normalize();
    for front in [1.0, -1.0] {
        let eta = if front > 0.0 { IOR } else { 1.0 / IOR };
        let (reflectance, onward) = fresnel(-direction, DVec3::Y, eta);
        let truth = 0.8 / PI * 3.0 * -direction.y * (1.0 - reflectance) / (eta * eta);
        let small = roofed(front, onward, LightKind::Directional { direction });
        let options = options(16, samples, 2).path_reuse(PathReuse::Off).splitting(Splitting::OFF);
        let error = 0.01 * percent;
        assert_radiance("a small sun", &small, &options.caustics(Caustics::On), truth, error);
        let large = roofed(front, onward, LightKind::Sun { direction, angle_rad: 0.1 });
        assert_radiance("from the lamp", &large, &options.caustics(Caustics::On), truth, error);
        let many = options.samples(4 * samples);
        assert_radiance("from the camera", &large, &many.caustics(Caustics::Off), truth, 2.0 * error);
    }
}

/// A box whose only opening is a sheet in front of a light.
fn room(front: f64) -> Scene {
    let mut scene = Scene::default();
    let wall = material(&mut scene, Material::lambert("wall", [0.7, 0.6, 0.5]));
    quad(&mut scene, [-1.0, -1.0, 1.0], [2.0, 0.0, 0.0], [0.0, 0.0, -2.0], wall);
    quad(&mut scene, [-1.0, -1.0, -1.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], wall);
    quad(&mut scene, [-1.0, -1.0, 1.0], [0.0, 0.0, -2.0], [0.0, 2.0, 0.0], wall);
    quad(&mut scene, [-0.4, -1.0, -0.5], [0.6, 0.0, 0.3], [0.0, 0.8, 0.0], wall);
    // The normal of the sheet points outwards, or inwards.
    let of = material(&mut scene, glass(0.0));
    let (u, v) = ([0.0, 0.0, 2.0 * front], [0.0, 2.0, 0.0]);
    quad(&mut scene, [1.0, -1.0, -front], u, v, of);
    let shine = material(&mut scene, Material::emitter("lamp", [1.0; 3], true));
    quad(&mut scene, [1.6, -1.2, -1.4], [0.4, 2.4, 0.0], [0.0, 0.0, 2.8], shine);
    scene.cameras.push(camera(DVec3::new(0.0, 0.4, 3.2), DVec3::new(0.0, -0.1, 0.0), DVec3::Y, 40.0));
    scene
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn all_techniques_agree_behind_open_dielectrics() {
    let scene = room(1.0);
    let plain = options(32, 64, 12).path_reuse(PathReuse::Off).splitting(Splitting::OFF);
    let off = plain.caustics(Caustics::Off).guiding(Guiding::Off);
    for (what, other) in [
        ("caustics", off.caustics(Caustics::On)),
        ("guiding", off.guiding(Guiding::On)),
        ("sharing", off.path_reuse(PathReuse::Groups("2x2".parse().expect("a shape")))),
        ("splitting", off.splitting(Splitting::Into(4))),
    ] {
        assert_same_means(what, &scene, [&off, &other], 48);
    }
}

#[test]
fn open_dielectrics_are_deterministic() {
    let options = options(32, 9, 12).path_reuse(PathReuse::Off).caustics(Caustics::On);
    assert_same_bits("a sheet", &room(1.0), &options);
}
