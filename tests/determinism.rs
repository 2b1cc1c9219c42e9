//! The same pixels whatever the number of threads; other pixels from another seed.

mod support;

use oscura::film::{AovSet, Film};
use oscura::render::{RenderOptions, in_pool};
use oscura::scene::Scene;
use oscura::simd::{Level, limit_level};
use std::path::Path;
use support::{options, picture};

fn scene(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    oscura::load::load(&path, &Default::default()).expect("the scene loads").scene
}

fn bits(film: &Film) -> Vec<[u32; 4]> {
    let pixels = (0..film.height()).flat_map(|y| (0..film.width()).map(move |x| (x, y)));
    pixels.map(|(x, y)| film.mean_rgba(x, y).map(f32::to_bits)).collect()
}

#[test]
fn any_number_of_threads_gives_the_same_pixels() {
    for name in ["cornell-quads.toml", "materials.toml"] {
        let scene = scene(name);
        let with = |threads| {
            in_pool(threads, || bits(&picture(&scene, &options(50, 20, 100)))).expect("the threads start")
        };
        let one = with(Some(1));
        assert!(one == with(Some(2)) && one == with(Some(7)) && one == with(None), "{name} differs");
    }
}

#[test]
fn every_cpu_level_gives_the_same_pixels() {
    let available: Vec<Level> = Level::ALL.into_iter().filter(|l| l.is_available()).collect();
    println!("levels: {:?}", available.iter().map(|l| l.name()).collect::<Vec<_>>());
    for name in ["cornell-quads.toml", "materials.toml"] {
        let scene = scene(name);
        let pictures = available.iter().map(|&level| {
            limit_level(level);
            bits(&picture(&scene, &options(40, 12, 100)))
        });
        let pictures: Vec<_> = pictures.collect();
        limit_level(Level::Avx512);
        for (level, picture) in available.iter().zip(&pictures) {
            assert!(*picture == pictures[0], "{name}: {} differs from scalar", level.name());
        }
    }
}

#[test]
fn other_outputs_do_not_change_the_picture() {
    let scene = scene("materials.toml");
    let all = AovSet { depth: true, normal: true, albedo: true };
    let plain = picture(&scene, &options(40, 8, 100));
    let with = picture(&scene, &RenderOptions { aovs: all, ..options(40, 8, 100) });
    assert!(bits(&plain) == bits(&with));
    assert!(with.depth(20, 39).is_some_and(|d| d > 0.0 && d < 1e4));
}

#[test]
fn seeds_are_independent() {
    let scene = scene("cornell-quads.toml");
    let with = |seed| picture(&scene, &RenderOptions { seed, ..options(48, 16, 100) });
    let (a, b, c) = (with(1), with(2), with(3));
    let value = |film: &Film, i: u32| f64::from(film.mean_rgba(i % 48, i / 48)[1]);
    // Differences of two pairs that share no picture are uncorrelated and have mean zero.
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
