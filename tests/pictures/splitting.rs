//! Path splitting at the first hit: the same expected value, less noise, deterministic.

use crate::support::differences::{assert_same_bits, assert_same_means, noise};
use crate::support::{
    assert_radiance, camera, dielectric, material, options, pbr, quad, rendering, sphere, walls,
};
use oscura::math::DVec3;
use oscura::render::{PathReuse, RenderOptions, Splitting};
use oscura::scene::{AlphaMode, ColorSlot, Environment, FloatSlot, Material, Model, Scene};

fn metal(roughness: f32) -> Material {
    pbr("metal", [0.9, 0.8, 0.7], 1.0, roughness)
}

/// A floor under a uniform sky with objects of all vertex classes, and an area light.
fn yard() -> Scene {
    let mut scene = Scene { environment: Environment::Constant([0.5, 0.6, 0.8]), ..Scene::default() };
    let floor = material(&mut scene, metal(0.4));
    quad(&mut scene, [-2.0, 0.0, -2.0], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0], floor);
    let chalk = material(&mut scene, Material::lambert("chalk", [0.8, 0.7, 0.6]));
    sphere(&mut scene, [-0.6, 0.4, 0.0], 0.4, chalk);
    let glass = material(&mut scene, dielectric(1.5));
    sphere(&mut scene, [0.5, 0.3, 0.3], 0.3, glass);
    let mut paper = Material::lambert("paper", [0.7, 0.2, 0.2]);
    (paper.alpha_mode, paper.alpha) = (AlphaMode::Blend, FloatSlot::constant(0.4));
    let paper = material(&mut scene, paper);
    quad(&mut scene, [-0.2, 0.0, -0.8], [1.2, 0.0, 0.0], [0.0, 1.0, 0.0], paper);
    let lamp = material(&mut scene, Material::emitter("lamp", [8.0; 3], false));
    quad(&mut scene, [-0.3, 1.6, -0.3], [0.6, 0.0, 0.0], [0.0, 0.0, 0.6], lamp);
    scene.cameras.push(camera(DVec3::new(0.0, 1.2, 2.6), DVec3::new(0.0, 0.3, 0.0), DVec3::Y, 50.0));
    scene
}

/// Options that differ in splitting only.
fn plain(options: RenderOptions) -> RenderOptions {
    options.path_reuse(PathReuse::Off).splitting(Splitting::OFF)
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn splitting_keeps_the_mean() {
    let scene = yard();
    for (depth, branches) in [(100, 4), (1, 2), (2, 8), (3, 16)] {
        let options = plain(options(40, 64, depth));
        let what = format!("depth {depth}, {branches} branches");
        assert_same_means(&what, &scene, [&options, &options.splitting(Splitting::Into(branches))], 16);
    }
}

/// In a closed box of emission e and albedo p, L = e + p L, with and without splitting.
#[test]
fn closed_emitting_box() {
    for branches in [2, 8] {
        let mut scene = Scene::default();
        let albedo = 0.6f32;
        walls(&mut scene, [1.0; 3], |scene, _| {
            let mut wall = Material::emitter("wall", [0.3; 3], false);
            wall.model = Model::Lambert { albedo: ColorSlot::constant([albedo; 3]) };
            material(scene, wall)
        });
        scene.cameras.push(camera(DVec3::new(0.2, 0.1, 0.9), DVec3::ZERO, DVec3::Y, 80.0));
        let truth = 0.3 / (1.0 - f64::from(albedo));
        let options = options(32, 16, 2000).splitting(Splitting::Into(branches));
        assert_radiance(&format!("closed box, {branches} branches"), &scene, &options, truth, 2e-3);
    }
}

#[test]
fn splitting_reduces_indirect_noise() {
    let (scene, options) = (yard(), plain(options(64, 8, 100)));
    let [one, eight] = [1, 8].map(|n| noise(&scene, &options.splitting(Splitting::Into(n))));
    println!("variance / {:.2}", one / eight);
    assert!(one > 2.0 * eight, "{one} {eight}");
}

/// In the penumbra of a small light, which BSDF samples seldom hit, all noise is that of the light samples: one for four paths.
#[test]
fn split_paths_add_light_samples() {
    let mut scene = Scene::default();
    let chalk = material(&mut scene, Material::lambert("chalk", [0.8; 3]));
    quad(&mut scene, [-2.0, 0.0, -2.0], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0], chalk);
    let board = material(&mut scene, Material::lambert("board", [0.0; 3]));
    quad(&mut scene, [-3.0, 0.8, -3.0], [3.0, 0.0, 0.0], [0.0, 0.0, 6.0], board);
    let lamp = material(&mut scene, Material::emitter("lamp", [50.0; 3], false));
    quad(&mut scene, [-0.2, 2.0, -0.2], [0.4, 0.0, 0.0], [0.0, 0.0, 0.4], lamp);
    scene.cameras.push(camera(DVec3::new(0.0, 0.6, 0.0), DVec3::ZERO, DVec3::Z, 20.0));
    let options = plain(options(48, 8, 1));
    let [four, sixteen] = [4, 16].map(|n| noise(&scene, &options.splitting(Splitting::Into(n))));
    println!("variance / {:.2}", four / sixteen);
    assert!(sixteen > 0.0 && four > 2.5 * sixteen, "{four} {sixteen}");
}

/// BSDF samples find a uniform sky as well as light samples do, which stay one; an area light changes that.
#[test]
fn uniform_sky_uses_one_light_sample() {
    let mut scene = Scene { environment: Environment::Constant([0.5; 3]), ..Scene::default() };
    let chalk = material(&mut scene, Material::lambert("chalk", [0.8; 3]));
    quad(&mut scene, [-2.0, 0.0, -2.0], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0], chalk);
    scene.cameras.push(camera(DVec3::new(0.0, 1.0, 0.0), DVec3::ZERO, DVec3::Z, 20.0));
    // Rays of twelve additional paths, over those of two.
    let further = |scene: &Scene| {
        let [two, four, sixteen] = [2, 4, 16].map(|branches| {
            let mut rendering =
                rendering(scene, &plain(options(32, 8, 1)).splitting(Splitting::Into(branches)));
            rendering.run();
            rendering.statistics().rays as f64
        });
        (sixteen - four) / (four - two)
    };
    let of_sky = further(&scene);
    let lamp = material(&mut scene, Material::emitter("lamp", [50.0; 3], false));
    quad(&mut scene, [-0.2, 2.0, -0.2], [0.4, 0.0, 0.0], [0.0, 0.0, 0.4], lamp);
    let with_lamp = further(&scene);
    println!("{of_sky:.3} {with_lamp:.3}");
    assert!((5.8..6.2).contains(&of_sky), "{of_sky}");
    assert!(with_lamp > 6.4, "{with_lamp}");
}

#[test]
fn splitting_is_deterministic() {
    let scene = yard();
    for splitting in [Splitting::Auto, Splitting::Into(4), Splitting::Into(16)] {
        let options = options(100, 4, 100).splitting(splitting);
        assert_same_bits(&format!("{splitting:?}"), &scene, &options);
    }
}

/// A floor with three rough metal spheres that reflect a light onto it.
fn metal_balls() -> Scene {
    let mut scene = Scene { environment: Environment::Constant([0.1; 3]), ..Scene::default() };
    let chalk = material(&mut scene, Material::lambert("chalk", [0.8; 3]));
    quad(&mut scene, [-2.0, 0.0, -2.0], [0.0, 0.0, 4.0], [4.0, 0.0, 0.0], chalk);
    let metal = material(&mut scene, metal(0.4));
    for x in [-0.9, 0.0, 0.9] {
        sphere(&mut scene, [x, 0.4, -0.3], 0.4, metal);
    }
    let lamp = material(&mut scene, Material::emitter("lamp", [300.0; 3], false));
    sphere(&mut scene, [0.5, 2.0, 2.0], 0.1, lamp);
    scene.cameras.push(camera(DVec3::new(0.0, 1.5, 2.4), DVec3::new(0.0, 0.2, 0.0), DVec3::Y, 50.0));
    scene
}

/// Results of pilot tiles are kept only if they are hardly noisier than those of the chosen technique.
#[test]
fn noisy_pilot_tiles_are_rendered_again() {
    let scene = metal_balls();
    let options = options(256, 8, 100);
    let mut found = rendering(&scene, &options);
    found.run();
    let branches = found.statistics().branches;
    assert!(branches > 1, "{branches}");
    let mut given =
        rendering(&scene, &options.path_reuse(PathReuse::Off).splitting(Splitting::Into(branches)));
    given.run();
    assert_eq!(found.statistics().samples, given.statistics().samples);
    assert!(found.statistics().rays > given.statistics().rays);
    let is_other = |x: u32, y: u32| found.film().mean_rgba(x, y) != given.film().mean_rgba(x, y);
    let pixels = |s: u32| (0..1024).map(move |i| (s % 8 * 32 + i % 32, s / 8 * 32 + i / 32));
    let others = (0..64).filter(|&s| pixels(s).any(|(x, y)| is_other(x, y))).count();
    // Six tried splitting into four; nine or more tried path sharing, which gains nothing here.
    println!("{branches} branches, {others} squares are not as the others");
    assert!(others <= 6, "{others}");
}

/// The pilot splits where noise comes from beyond the first hit, and not where nothing lies there.
#[test]
fn pilot_chooses_splitting() {
    let branches = |scene: &Scene| {
        let mut rendering = rendering(scene, &options(256, 8, 100).path_reuse(PathReuse::Off));
        rendering.run();
        rendering.statistics().branches
    };
    let split = branches(&metal_balls());
    println!("{split} branches");
    assert!(split > 1);
    let mut ball = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let grey = material(&mut ball, Material::lambert("grey", [0.5; 3]));
    sphere(&mut ball, [0.0; 3], 1.0, grey);
    ball.cameras.push(camera(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y, 60.0));
    assert_eq!(branches(&ball), 1);
}
