//! More samples where the picture is noisy: the same expected picture, less noise, the same bits whatever the machine.

use crate::support::differences::{assert_same_bits, assert_same_means, noise};
use crate::support::{camera, material, options, rendering, sphere};
use oscura::math::DVec3;
use oscura::render::{Adaptive, PathReuse, RenderOptions, Splitting};
use oscura::scene::{ColorSlot, Environment, FloatSlot, Material, Model, PbrMaterial, Scene};

/// Balls beside each other before an even sky, which has no noise, lit by a small bright lamp.
fn balls() -> Scene {
    let mut scene = Scene { environment: Environment::Constant([0.2; 3]), ..Scene::default() };
    let pbr = PbrMaterial {
        base_color: ColorSlot::constant([0.9, 0.6, 0.4]),
        metallic: FloatSlot::constant(1.0),
        roughness: FloatSlot::constant(0.5),
        ..PbrMaterial::default()
    };
    let metal = material(&mut scene, Material::new("metal", Model::Pbr(Box::new(pbr))));
    let chalk = material(&mut scene, Material::lambert("chalk", [0.8; 3]));
    sphere(&mut scene, [-0.5, 0.0, 0.0], 0.5, metal);
    sphere(&mut scene, [0.5, 0.0, 0.0], 0.5, chalk);
    let lamp = material(&mut scene, Material::emitter("lamp", [60.0; 3], false));
    sphere(&mut scene, [0.0, 1.6, 0.6], 0.25, lamp);
    scene.cameras.push(camera(DVec3::new(0.0, 0.3, 5.5), DVec3::ZERO, DVec3::Y, 45.0));
    scene
}

/// Nothing but adaptive sampling.
fn plain(samples: u32) -> RenderOptions {
    options(128, samples, 100).path_reuse(PathReuse::Off).splitting(Splitting::OFF).adaptive(Adaptive::Auto)
}

#[test]
fn samples_go_where_the_noise_is() {
    let (scene, options) = (balls(), plain(32));
    let mut adaptive = rendering(&scene, &options);
    adaptive.run();
    assert!(adaptive.statistics().is_adaptive);
    let film = adaptive.film();
    let of_pixel = |x, y| film.samples(x, y);
    println!("sky {}, ball {}", of_pixel(4, 4), of_pixel(44, 66));
    assert!(of_pixel(4, 4) >= 8 && of_pixel(44, 66) > 3 * of_pixel(4, 4));
    let pixels = u64::from(film.width()) * u64::from(film.height());
    let total: u64 =
        (0..128).flat_map(|y| (0..128).map(move |x| (x, y))).map(|(x, y)| u64::from(of_pixel(x, y))).sum();
    assert_eq!(total, adaptive.statistics().samples);
    assert!(total.abs_diff(32 * pixels) < pixels / 100, "{total}");
    let [on, off] = [Adaptive::Auto, Adaptive::Off].map(|a| noise(&scene, &options.adaptive(a)));
    println!("variance / {:.2}", off / on);
    assert!(off > 1.2 * on, "{off} {on}");
}

#[test]
fn limits_of_a_pixel_hold() {
    let scene = balls();
    let range = |options: &RenderOptions| {
        let mut rendering = rendering(&scene, options);
        rendering.run();
        let film = rendering.film();
        let counts = (0..128).flat_map(|y| (0..128).map(move |x| (x, y))).map(|(x, y)| film.samples(x, y));
        counts.fold((u32::MAX, 0), |(least, most), n| (least.min(n), most.max(n)))
    };
    let (least, most) = range(&plain(32));
    assert!(least < 20 && most > 60, "{least} {most}");
    let (least, most) = range(&plain(32).sample_limits(20, 60));
    assert!(least >= 20 && most <= 60, "{least} {most}");
}

#[test]
fn adaptive_sampling_changes_no_mean() {
    let (scene, options) = (balls(), plain(16));
    assert_same_means("adaptive", &scene, [&options.adaptive(Adaptive::Off), &options], 16);
}

#[test]
fn threads_and_cpu_levels_agree() {
    let (scene, options) = (balls(), plain(19).splitting(Splitting::Auto));
    assert_same_bits("adaptive", &scene, &options);
}

/// Few samples and small pictures are even.
#[test]
fn small_pictures_are_even() {
    let scene = balls();
    for options in [plain(15), plain(16).size(100, 100), plain(16).adaptive(Adaptive::Off)] {
        let mut rendering = rendering(&scene, &options);
        rendering.run();
        assert!(!rendering.statistics().is_adaptive);
        assert_eq!(rendering.film().samples(3, 3), options.samples);
    }
}
