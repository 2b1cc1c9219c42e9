//! The same pixels at any number of threads; different pixels with another seed.

use crate::glass_panes::under_a_pane;
use crate::refracted_lights::scene_behind;
use crate::shader_nodes::ray_tracing_nodes_room;
use crate::support::sheet::{self, Variant};
use crate::support::{gltf_glass, material, options, picture, quad, sphere};
use oscura::film::{Aov, AovSet, Film, Values};
use oscura::image::Image;
use oscura::math::DVec3;
use oscura::render::in_pool;
use oscura::scene::{
    AlphaMode, ColorSlot, Environment, FloatSlot, ImageId, Interpolation, Material, Model, PbrMaterial, Scene,
};
use oscura::simd::{Level, limit_level};
use std::path::Path;

fn scene(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    oscura::load::load(&path, &Default::default()).expect("the scene loads").scene
}

/// Textures and normal maps, an image environment, paper of low alpha, and a solid of dispersive coloured glass that contains a
/// rough bubble and two lights.
fn everything() -> Scene {
    let interpolation = Interpolation::Trilinear;
    let (smooth, tangents) = (true, true);
    let variant = Variant { smooth, tangents, interpolation, ..Variant::SMOOTH };
    let mut scene = sheet::scene(&variant);
    let sky = (0..32 * 16).flat_map(|i| [0.3, 0.5, 1.0].map(|c| if i == 70 { 90.0 } else { c })).collect();
    scene.images.push(Image::from_linear_rgb("sky", 32, 16, sky));
    let image = ImageId(scene.images.len() as u32 - 1);
    scene.environment = Environment::Image { image, strength: 1.0, rotation_rad: 0.4 };
    let mut paper = Material::lambert("paper", [0.7; 3]);
    (paper.alpha_mode, paper.alpha) = (AlphaMode::Blend, FloatSlot::constant(0.4));
    let paper = material(&mut scene, paper);
    quad(&mut scene, [-1.5, -0.5, 0.6], [1.5, 0.0, 0.3], [0.0, 1.5, 0.0], paper);
    let glass = PbrMaterial {
        has_volume: true,
        attenuation_color: [0.4, 0.9, 0.8],
        attenuation_distance: 0.5,
        dispersion: 2.0,
        ..gltf_glass(0.0)
    };
    let glass = material(&mut scene, Material::new("glass", Model::Pbr(Box::new(glass))));
    sphere(&mut scene, [0.5, 0.1, 0.6], 0.5, glass);
    let tint = ColorSlot::constant([1.0; 3]);
    let air = Model::Glass { ior: 1.0, tint, roughness: FloatSlot::constant(0.4), is_thin: false };
    let air = material(&mut scene, Material::new("air", air));
    sphere(&mut scene, [0.55, 0.2, 0.7], 0.2, air);
    let lamp = material(&mut scene, Material::emitter("lamp", [6.0; 3], false));
    sphere(&mut scene, [0.3, -0.1, 0.6], 0.05, lamp);
    sphere(&mut scene, [0.55, 0.2, 0.7], 0.05, lamp);
    scene
}

/// Scenes that together use all shading loops.
fn scenes() -> [(&'static str, Scene); 6] {
    let named = |name| (name, scene(name));
    let behind = |what| (what, scene_behind(what, Material::lambert("grey", [0.5; 3]), false, true));
    let [cornell, materials] = [named("cornell-quads.toml"), named("materials.toml")];
    let dusty = ("dusty room", ray_tracing_nodes_room());
    [cornell, materials, ("everything", everything()), behind("frosted pane"), behind("waves"), dusty]
}

fn bits(film: &Film) -> Vec<[u32; 4]> {
    film.rgba().into_iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

#[test]
fn any_number_of_threads_gives_the_same_pixels() {
    for (name, scene) in scenes() {
        let with = |threads| {
            in_pool(threads, || bits(&picture(&scene, &options(50, 20, 100)))).expect("the threads start")
        };
        let one = with(Some(1));
        assert!(one == with(Some(2)) && one == with(Some(7)) && one == with(None), "{name} differs");
    }
}

/// Threads reuse their memory from scene to scene: stale state must not be read in the next.
#[test]
fn pictures_do_not_depend_on_previous_scenes() {
    let files = ["cornell-quads.toml", "lamp-in-fog.toml", "smoke.toml", "window.toml", "wax.toml"];
    let of_files = files.map(|name| (name, scene(name)));
    let pane = under_a_pane(Material::lambert("grey", [0.5; 3]), DVec3::new(0.0, 0.2, 0.8), true);
    let water = scene_behind("level water", Material::lambert("grey", [0.5; 3]), false, true);
    let others = [("everything", everything()), ("pane", pane), ("water", water)];
    let scenes: Vec<(&str, Scene)> = of_files.into_iter().chain(others).collect();
    // Light from surfaces that scatter once: many paths are still active when the last bounce ends.
    let take = |scene: &Scene| bits(&picture(scene, &options(8, 32, 1)));
    let by_one_thread = |scene: &Scene| in_pool(Some(1), || take(scene)).expect("the thread starts");
    let alone: Vec<_> = scenes.iter().map(|(_, scene)| by_one_thread(scene)).collect();
    let one_after_another = || {
        for (before, first) in &scenes {
            for ((name, second), alone) in scenes.iter().zip(&alone) {
                take(first);
                assert!(take(second) == *alone, "{name} differs after {before}");
            }
        }
    };
    in_pool(Some(1), one_after_another).expect("the thread starts");
}

#[test]
fn every_cpu_level_gives_the_same_pixels() {
    let available: Vec<Level> = Level::ALL.into_iter().filter(|l| l.is_available()).collect();
    println!("levels: {:?}", available.iter().map(|l| l.name()).collect::<Vec<_>>());
    for (name, scene) in scenes() {
        let pictures = available.iter().map(|&level| {
            limit_level(level);
            bits(&picture(&scene, &options(40, 12, 100)))
        });
        let pictures: Vec<_> = pictures.collect();
        limit_level(Level::HIGHEST);
        for (level, picture) in available.iter().zip(&pictures) {
            assert!(*picture == pictures[0], "{name}: {} differs from scalar", level.name());
        }
    }
}

#[test]
fn aovs_do_not_change_the_picture() {
    for (name, scene) in scenes() {
        let plain = picture(&scene, &options(40, 8, 100));
        let with = picture(&scene, &options(40, 8, 100).aovs(Aov::ALL.iter().copied().collect::<AovSet>()));
        assert!(bits(&plain) == bits(&with), "{name} differs");
        let Some(Values::Float(depth)) = with.plane("Z") else { panic!("{name}: no depth") };
        assert!(depth[20 * 40 + 20] > 0.0 && depth[20 * 40 + 20] < 1e4, "{name}");
    }
}

#[test]
fn seeds_are_independent() {
    let scene = scene("cornell-quads.toml");
    let with = |seed| picture(&scene, &options(48, 16, 100).seed(seed));
    let (a, b, c) = (with(1), with(2), with(3));
    let value = |film: &Film, i: u32| f64::from(film.mean_rgba(i % 48, i / 48)[1]);
    // Differences of two disjoint pairs of pictures are uncorrelated and have mean zero.
    let pairs = (0..48 * 48).map(|i| (value(&a, i) - value(&b, i), value(&c, i) - value(&b, i)));
    let pairs: Vec<(f64, f64)> = pairs.filter(|p| *p != (0.0, 0.0)).collect();
    let n = pairs.len() as f64;
    assert!(n > 1500.0, "only {n} pixels differ between seeds");
    let (mean, square) = pairs.iter().fold((0.0, 0.0), |(m, s), p| (m + p.0 / n, s + p.0 * p.0 / n));
    let error = (square / n).sqrt();
    assert!(mean.abs() < 4.0 * error, "mean difference {mean} with standard error {error}");
    // a - b and c - b share b: their correlation is a half.
    let product = pairs.iter().map(|p| p.0 * p.1).sum::<f64>() / n;
    let other_square = pairs.iter().map(|p| p.1 * p.1).sum::<f64>() / n;
    let correlation = product / (square * other_square).sqrt();
    assert!((correlation - 0.5).abs() < 0.15, "correlation {correlation}");
}
