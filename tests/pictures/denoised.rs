//! The brightness of regions of denoised pictures of ten scenes.

use crate::support::options;
use oscura::compile::{CompileOptions, compile};
use oscura::film::{AovSet, Film};
use oscura::render::{PathReuse, RenderOptions, Rendering, denoise_film, denoising_guides};
use oscura::scene::Scene;
use std::path::Path;

/// Scenes of all kinds: diffuse light, glass and metal, hair, depth of field, motion, small lamps, plastics, light through a window,
/// media, light in a beam of fog.
const SCENES: [&str; 10] = [
    "thesis/cornell-box.toml",
    "cornell-spheres.toml",
    "fur.toml",
    "thesis/defocus-out.toml",
    "flying-balls.toml",
    "many-lights.toml",
    "plastics.toml",
    "window.toml",
    "smoke.toml",
    "cornell-beam.toml",
];
const WIDTH: u32 = 96;
const HEIGHT: u32 = 64;
const BLOCK: usize = 32;

type Planes = [Vec<f32>; 3];

fn load(name: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    oscura::load::load(&path, &Default::default()).expect("the scene loads").scene
}

fn settings(samples: u32, seed: u32) -> RenderOptions {
    let options = options(WIDTH, samples, 100).size(WIDTH, HEIGHT).seed(seed);
    options.path_reuse(PathReuse::Off).aovs(denoising_guides()).halves(true)
}

fn rendering(scene: &Scene, options: RenderOptions) -> Rendering {
    let (compiled, _) = compile(scene, &CompileOptions::default()).expect("the scene compiles");
    Rendering::new(compiled, &scene.cameras[0], options).expect("the film fits")
}

fn color(film: &Film) -> Planes {
    ["R", "G", "B"].map(|name| film.plane(name).expect("a colour").into_floats())
}

fn denoised(film: &Film) -> Planes {
    let mut film = film.clone();
    denoise_film(&mut film, AovSet::NONE);
    color(&film)
}

/// Differences between the sums over blocks of the denoised and the noisy picture, in standard deviations of the noise.
fn block_deviations(film: &Film) -> Vec<f32> {
    let (noisy, denoised) = (color(film), denoised(film));
    let noise = film.deviations().expect("half buffers");
    let (width, height) = (WIDTH as usize, HEIGHT as usize);
    let blocks = (0..height / BLOCK).flat_map(|y| (0..width / BLOCK).map(move |x| (BLOCK * x, BLOCK * y)));
    let blocks = blocks.flat_map(|block| (0..3).map(move |c| (block, c)));
    let of = |((x0, y0), c): ((usize, usize), usize)| {
        let places = || (y0..y0 + BLOCK).flat_map(|y| (x0..x0 + BLOCK).map(move |x| y * width + x));
        let difference: f32 = places().map(|i| denoised[c][i] - noisy[c][i]).sum();
        let all: f32 = places().map(|i| noisy[c][i]).sum();
        let deviation = places().map(|i| noise[c][i] * noise[c][i]).sum::<f32>().sqrt();
        difference / deviation.max(1e-3 * all)
    };
    blocks.map(of).collect()
}

/// The means of all blocks are those of the noisy picture within its noise, at every number of samples. Five standard deviations, since
/// there are 720 means, and the noise itself is estimated from two halves of the samples.
fn check_regions(sample_counts: &[u32]) {
    let mut off = Vec::new();
    for name in SCENES {
        let scene = load(name);
        for &samples in sample_counts {
            let mut rendering = rendering(&scene, settings(samples, 5));
            rendering.run();
            let mut found = block_deviations(rendering.film());
            found.sort_by(f32::total_cmp);
            let (least, most) = (found[0], found[found.len() - 1]);
            println!("{name} {samples}: {least:.1} to {most:.1}");
            if least <= -5.0 || most >= 5.0 {
                off.push(format!("{name} {samples}: {least} to {most}"));
            }
        }
    }
    assert!(off.is_empty(), "{off:?}");
}

#[test]
fn regions_keep_their_brightness() {
    check_regions(&[4, 16]);
}

#[test]
#[ignore = "many samples, which take long"]
fn regions_of_pictures_with_many_samples_keep_their_brightness() {
    check_regions(&[8, 64]);
}

/// Mean squared relative error of a picture by two references of other seeds.
fn relative_error(picture: &Planes, references: &[Planes; 2]) -> f64 {
    let values = (0..3).flat_map(|c| (0..picture[c].len()).map(move |i| (c, i)));
    let of = |(c, i): (usize, usize)| {
        let [value, a, b] = [picture, &references[0], &references[1]].map(|planes| f64::from(planes[c][i]));
        let mean = 0.5 * (a + b);
        (value - a) * (value - b) / (mean * mean + 0.01)
    };
    values.map(of).sum::<f64>() / (3 * picture[0].len()) as f64
}

/// A noise threshold bounds the error of the denoised picture. The bound has a margin of 1.5 standard errors, and the references have
/// noise of their own.
fn check_thresholds(names: &[&str], thresholds: &[f32]) {
    for name in names {
        let scene = load(name);
        let references = [77, 78].map(|seed| {
            let mut reference = rendering(&scene, settings(192, seed));
            reference.run();
            color(reference.film())
        });
        for &threshold in thresholds {
            let mut rendering = rendering(&scene, settings(512, 5).noise(threshold).denoises(true));
            rendering.run();
            let bound = rendering.statistics().error.expect("a measurement");
            let samples = rendering.statistics().samples_per_pixel;
            rendering.denoise(AovSet::NONE);
            let error = relative_error(&color(rendering.film()), &references).max(0.0).sqrt();
            println!("{name} {threshold}: {samples} samples, bound {bound:.4}, error {error:.4}");
            assert!(samples == 512.0 || bound <= f64::from(threshold), "{name}");
            assert!(error < 1.1 * bound, "{name}: {error}, bound {bound}");
        }
    }
}

#[test]
fn denoised_pictures_stop_below_the_threshold() {
    check_thresholds(&["thesis/defocus-out.toml", "plastics.toml"], &[0.08]);
}

#[test]
#[ignore = "five scenes, which take long"]
fn denoised_pictures_of_all_kinds_stop_below_the_threshold() {
    let names = [
        "thesis/cornell-box.toml",
        "fur.toml",
        "thesis/defocus-out.toml",
        "many-lights.toml",
        "plastics.toml",
    ];
    check_thresholds(&names, &[0.08, 0.04]);
}
