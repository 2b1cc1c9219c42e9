//! Path guiding: the same expected value, less noise where light comes from few directions, and deterministic.

use crate::support::differences::{assert_same_bits, bits, differences, noise};
use crate::support::{
    assert_radiance, camera, dielectric, material, options, pbr, picture, quad, rendering, sphere, walls,
};
use oscura::math::DVec3;
use oscura::output::part::{Identity, OutputSettings, Region, read_header, read_part};
use oscura::render::{Guiding, PassOutcome, PathReuse, RenderOptions, Rendering, Splitting};
use oscura::scene::{AlphaMode, ColorSlot, Environment, FloatSlot, Material, Model, Scene};
use std::path::Path;

/// Options that differ in guiding only.
fn plain(options: RenderOptions) -> RenderOptions {
    options.path_reuse(PathReuse::Off).splitting(Splitting::OFF).guiding(Guiding::Off)
}

fn guided(options: RenderOptions) -> RenderOptions {
    options.guiding(Guiding::On)
}

/// A room lit through a slit by a light behind a wall.
fn room(things: bool) -> Scene {
    let mut scene = Scene::default();
    let colors = [[0.8, 0.5, 0.4], [0.7; 3], [0.6, 0.6, 0.7], [0.8; 3], [0.4, 0.6, 0.7], [0.75; 3]];
    walls(&mut scene, [1.0; 3], |scene, i| material(scene, Material::lambert("wall", colors[i])));
    let grey = material(&mut scene, Material::lambert("grey", [0.6; 3]));
    quad(&mut scene, [0.3, -1.0, -1.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.4], grey);
    let lamp = material(&mut scene, Material::emitter("lamp", [6.0, 5.0, 4.0], true));
    quad(&mut scene, [0.4, 0.2, -0.9], [0.5, 0.0, 0.0], [0.0, 0.0, 0.8], lamp);
    if things {
        let plastic = material(&mut scene, pbr("plastic", [0.3, 0.7, 0.4], 0.0, 0.4));
        sphere(&mut scene, [-0.5, -0.7, -0.4], 0.3, plastic);
        let metal = material(&mut scene, pbr("metal", [0.9, 0.7, 0.4], 1.0, 0.3));
        sphere(&mut scene, [-0.1, -0.75, 0.2], 0.25, metal);
        let glass = material(&mut scene, dielectric(1.5));
        sphere(&mut scene, [-0.6, -0.8, 0.3], 0.2, glass);
        let mut paper = Material::lambert("paper", [0.7, 0.3, 0.3]);
        (paper.alpha_mode, paper.alpha) = (AlphaMode::Blend, FloatSlot::constant(0.5));
        let paper = material(&mut scene, paper);
        quad(&mut scene, [-0.9, -0.5, -0.9], [0.8, 0.0, 0.2], [0.0, 0.9, 0.0], paper);
        scene.environment = Environment::Constant([0.3, 0.4, 0.5]);
        scene.quads.remove(3);
    }
    scene.cameras.push(camera(DVec3::new(-0.6, 0.2, 0.95), DVec3::new(-0.2, -0.3, -0.5), DVec3::Y, 75.0));
    scene
}

/// The same with walls of a glossy plastic.
fn glossy_room() -> Scene {
    let mut scene = room(false);
    for material in &mut scene.materials {
        if let Model::Lambert { albedo } = &material.model {
            let color = albedo.factor;
            material.model = pbr("wall", color, 0.0, 0.35).model;
        }
    }
    scene
}

fn cornell() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-quads.toml");
    oscura::load::load(&path, &Default::default()).expect("the scene loads").scene
}

/// As `assert_same_means`, for noisier pictures.
fn assert_alike(what: &str, scene: &Scene, options: &RenderOptions) {
    let found = differences(scene, [options, &guided(*options)], 16);
    let z: Vec<f64> = found.blocks.iter().map(|(d, error)| d / error.max(1e-9)).collect();
    let rms = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
    let (mean, error) = found.whole;
    println!("{what}: z rms {rms:.2}; whole {mean:.1e} +- {error:.1e}");
    // The three channels of some 25 blocks are strongly correlated.
    assert!(rms < 1.6, "{what}: z rms {rms}");
    assert!(mean.abs() < 4.5 * error && error < 5e-3, "{what}: {mean} +- {error}");
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn guiding_keeps_the_mean() {
    for (what, scene, samples) in [
        ("room", room(false), 64),
        ("things", room(true), 64),
        ("gloss", glossy_room(), 64),
        ("box", cornell(), 32),
    ] {
        let options = plain(options(40, samples, 100));
        assert!(finished(&scene, &guided(options)).statistics().guide_cells > Some(10), "{what}");
        assert_alike(what, &scene, &options);
        if what == "room" {
            assert_alike("depth 3", &scene, &options.max_depth(3));
        }
    }
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn guiding_with_splitting_or_path_sharing_keeps_the_mean() {
    for (what, scene) in [("room", room(false)), ("gloss", glossy_room())] {
        let options = plain(options(40, 64, 100));
        assert_alike(&format!("{what}, split"), &scene, &options.splitting(Splitting::Into(4)));
        for shape in ["4x4/2", "2x2/1"] {
            let shared = options.path_reuse(shape.parse().expect("a shape"));
            let rendering = finished(&scene, &guided(shared));
            let statistics = rendering.statistics();
            assert!(statistics.path_reuse.is_some() && statistics.guide_cells.is_some());
            assert_alike(&format!("{what}, {shape}"), &scene, &shared);
        }
    }
}

/// In a closed box of emission e and albedo p, L = e + p L, whatever the guiding distribution.
#[test]
#[ignore = "means of many pictures, which take long"]
fn closed_emitting_box() {
    let (emitted, albedo) = (0.3f32, 0.6f32);
    let mut scene = Scene::default();
    walls(&mut scene, [1.0; 3], |scene, _| {
        let mut wall = Material::emitter("wall", [emitted; 3], false);
        wall.model = Model::Lambert { albedo: ColorSlot::constant([albedo; 3]) };
        material(scene, wall)
    });
    scene.cameras.push(camera(DVec3::new(0.2, 0.1, 0.9), DVec3::ZERO, DVec3::Y, 80.0));
    let truth = f64::from(emitted) / (1.0 - f64::from(albedo));
    assert_radiance("closed box", &scene, &guided(plain(options(24, 128, 2000))), truth, 1e-3);
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn guiding_reduces_noise() {
    let options = plain(options(96, 64, 100));
    for (what, scene, most) in [("room", room(false), 0.4), ("gloss", glossy_room(), 0.5)] {
        let [off, on] = [options, guided(options)].map(|options| noise(&scene, &options));
        println!("{what}: noise {off:.2e}, guided {on:.2e}");
        assert!(on < most * off, "{what}: {on} {off}");
    }
}

#[test]
fn guiding_is_deterministic() {
    for (reuse, scene) in [("off", room(true)), ("4x4/2", room(false)), ("off", glossy_room())] {
        let options =
            options(40, 64, 100).splitting(Splitting::OFF).path_reuse(reuse.parse().expect("a way"));
        assert_same_bits(reuse, &scene, &guided(options));
    }
}

/// Guiding is enabled automatically: for a room lit through a slit, and not for a directly lit one.
#[test]
fn guiding_is_enabled_for_noisy_indirect_light() {
    let options = options(96, 64, 100).guiding(Guiding::Auto);
    for (what, scene, is_guided) in
        [("slit", room(false), true), ("gloss", glossy_room(), true), ("box", cornell(), false)]
    {
        for seed in [0, 1, 2] {
            let mut rendering = rendering(&scene, &options.seed(seed));
            rendering.next_pass();
            assert_eq!(rendering.statistics().guide_cells.is_some(), is_guided, "{what}, {seed}");
            assert!(rendering.warnings().is_empty(), "{what}: {:?}", rendering.warnings());
        }
    }
}

#[test]
fn automatic_guiding_is_deterministic() {
    let (scene, options) = (room(false), plain(options(72, 64, 8)).guiding(Guiding::Auto));
    assert_same_bits("chosen", &scene, &options);
    let whole = rendering(&scene, &options);
    let region = Region { x0: 8, y0: 24, x1: 40, y1: 56 };
    let part = finished(&scene, &options.region(region));
    assert!(part.statistics().guide_cells.is_some());
    let mut whole = whole.with_whole_passes();
    whole.run();
    for (x, y) in [(0, 0), (31, 0), (5, 17), (31, 31)] {
        assert_eq!(part.film().mean_rgba(x, y), whole.film().mean_rgba(x + 8, y + 24), "{x}, {y}");
    }
}

fn finished(scene: &Scene, options: &RenderOptions) -> Rendering {
    let mut rendering = rendering(scene, options).with_whole_passes();
    assert_eq!(rendering.run(), PassOutcome::Done);
    rendering
}

#[test]
fn partial_renders_match_the_full_guided_render() {
    let folder = tempfile::tempdir().expect("a folder");
    let (scene, options) = (room(false), guided(plain(options(48, 64, 100))));
    let whole = bits(&picture(&scene, &options));
    let left = Region { x0: 0, y0: 0, x1: 19, y1: 48 };
    let right = Region { x0: 19, y0: 0, x1: 48, y1: 48 };
    let parts = [(left, (0, 24)), (left, (24, 64)), (right, (0, 40)), (right, (40, 64))];
    let files: Vec<_> = (0..4).map(|i| folder.path().join(format!("{i}.part"))).collect();
    for (&(region, samples), file) in parts.iter().zip(&files) {
        let mut part = finished(&scene, &options.region(region).sample_range(samples));
        part.write_part(file, &Identity::new(), &OutputSettings::default(), None).expect("a file");
    }
    let header = read_header(&files[0]).expect("a head");
    let layout = header.channels.layout().expect("known channels");
    let mut film = oscura::film::Film::of_layout(48, 48, layout).expect("the film fits");
    files.iter().for_each(|file| film.merge_film(&read_part(file).expect("a part").film));
    assert!(bits(&film) == whole);
}

#[test]
fn resuming_matches_a_single_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("a.part");
    let (scene, options) = (room(false), guided(plain(options(32, 32, 100))));
    let mut first = rendering(&scene, &options).with_whole_passes();
    first.next_pass();
    first.write_part(&file, &Identity::new(), &OutputSettings::default(), None).expect("a file");
    // Resume to the same number of samples, and to more of the same sequence.
    for samples in [32, 30] {
        let options = options.samples(samples);
        let mut second = rendering(&scene, &options).with_whole_passes();
        second.resume(&file, read_part(&file).expect("a file"), &Identity::new()).expect("it goes on");
        second.run();
        assert!(bits(second.film()) == bits(&picture(&scene, &options)), "{samples}");
    }
}

#[test]
fn unsupported_guiding_is_reported() {
    let messages = |scene: &Scene, options: RenderOptions| {
        let rendering = finished(scene, &guided(plain(options)));
        assert_eq!(rendering.statistics().guide_cells, None);
        rendering.warnings().iter().map(ToString::to_string).collect::<String>()
    };
    assert!(messages(&room(false), options(8, 4, 100)).contains("too few samples"));
    assert!(messages(&room(false), options(40, 64, 1)).contains("few bounces"));
    let mut gold = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let metal = material(&mut gold, pbr("gold", [0.9, 0.7, 0.3], 1.0, 0.4));
    sphere(&mut gold, [0.0; 3], 1.0, metal);
    gold.cameras.push(camera(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y, 50.0));
    assert!(messages(&gold, options(40, 64, 100)).contains("no path found a diffuse surface"));
}
