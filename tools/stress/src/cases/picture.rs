//! Whole pictures: the Cornell box under a parent node that scales and moves it together with its camera looks the same. (The
//! light is a radiance, which is invariant.)

use super::Row;
use oscura::compile::{CompileOptions, CompiledScene, compile};
use oscura::film::Film;
use oscura::image::Image;
use oscura::load::load;
use oscura::metrics::z_test;
use oscura::render::{RenderOptions, Rendering};
use oscura::scene::{Camera, Filter};
use serde_json::{Value, json};
use std::sync::Arc;

const ASSET: &str = include_str!("../../../../assets/cornell-box.gltf");
/// Edge of the pictures, pixels.
const SIZE: u32 = 64;
/// Samples per pixel of the full run.
const SAMPLES: f64 = 256.0;
/// Pictures of the original whose mean is the reference.
const REFERENCES: u32 = 8;
/// Offset of the box along each axis.
const FAR: f64 = 1e6;
/// Exponents of the powers of two that scale the box: about 1e-5 to 1e5.
const POWERS_OF_TWO: [i32; 7] = [-17, -10, -3, -1, 1, 9, 17];

pub fn run(effort: f64) -> Vec<Row> {
    let samples = (SAMPLES * effort).ceil().max(8.0) as u32;
    let original = scene(1.0, 0.0);
    vec![powers_of_two(&original, samples), scaled_and_moved(&original, samples)]
}

/// Scaling by powers of two changes no significand: each pixel has the same bits.
fn powers_of_two(original: &Scene, samples: u32) -> Row {
    let expected = picture(original, samples, 1);
    let mut wrong = 0;
    for exponent in POWERS_OF_TWO {
        wrong += differing(&expected, &picture(&scene(2f64.powi(exponent), 0.0), samples, 1));
    }
    Row {
        what: "pictures: Cornell box scaled by 2^-17 to 2^17: pixels equal to the bit".into(),
        tried: u64::from(SIZE * SIZE) * POWERS_OF_TWO.len() as u64,
        wrong,
        worst: "-".into(),
    }
}

/// All else agrees: with other random numbers within the noise, and with the same ones within the rounding of
/// coordinates, which sends few paths elsewhere.
fn scaled_and_moved(original: &Scene, samples: u32) -> Row {
    let references: Vec<Image> =
        (0..REFERENCES).map(|seed| picture(original, samples, 1000 + seed)).collect();
    let (mean, variance) = (mean(&references), variance_of_mean(&references));
    let (mut tried, mut wrong, mut worst) = (0, 0, Pair::default());
    let mut largest_z = 0.0f64;
    for power in -5..=5 {
        for far in [0.0, FAR] {
            let scene = scene(10f64.powi(power), far);
            let [a, b] = [2 * tried, 2 * tried + 1].map(|seed| picture(&scene, samples, seed));
            let test = z_test(&a, &b, &mean, &variance).expect("many blocks");
            let z = test.channels.iter().map(|c| c.z().abs()).fold(0.0, f64::max);
            let pair = Pair::of(&a, &picture(original, samples, 2 * tried));
            tried += 1;
            wrong += u64::from(!(z < 4.0 && pair.agrees()));
            largest_z = largest_z.max(z);
            worst = Pair {
                difference: worst.difference.max(pair.difference),
                elsewhere: worst.elsewhere.max(pair.elsewhere),
                ..worst
            };
        }
    }
    let Pair { difference, elsewhere, .. } = worst;
    Row {
        what: "pictures: Cornell box scaled by 1e-5 to 1e5, moved by 1e6 in each axis: z-tests".into(),
        tried: u64::from(tried),
        wrong,
        worst: format!(
            "z {largest_z:.1}; by the same seeds means off by {difference:.1e}, {:.1} % of the pixels by 1 %",
            100.0 * elsewhere
        ),
    }
}

/// Two pictures of the same seed.
#[derive(Clone, Copy, Debug, Default)]
struct Pair {
    /// Of the means, relative.
    difference: f64,
    /// The standard error of that, relative.
    sigma: f64,
    /// Fraction of the pixels that differ by more than 1 %.
    elsewhere: f64,
}

impl Pair {
    fn of(a: &Image, b: &Image) -> Pair {
        let n = f64::from(SIZE * SIZE);
        let green =
            |image: &Image| -> Vec<f64> { pixels().map(|(x, y)| image.rgba(x, y)[1].into()).collect() };
        let (p, q) = (green(a), green(b));
        let mean = q.iter().sum::<f64>() / n;
        let differences = || p.iter().zip(&q).map(|(p, q)| p - q);
        let off = differences().sum::<f64>() / n;
        let variance = differences().map(|d| (d - off).powi(2)).sum::<f64>() / (n - 1.0);
        let elsewhere = p.iter().zip(&q).filter(|(p, q)| (*p - *q).abs() > 0.01 * q.abs()).count();
        Pair {
            difference: (off / mean).abs(),
            sigma: (variance / n).sqrt() / mean,
            elsewhere: elsewhere as f64 / n,
        }
    }

    /// Within 4 standard errors and 16 roundings; at most 2 % of the pixels have diverging paths.
    fn agrees(&self) -> bool {
        self.difference <= 4.0 * self.sigma + 16.0 * f64::from(f32::EPSILON) && self.elsewhere <= 0.02
    }
}

/// A scene and its camera.
struct Scene {
    compiled: Arc<CompiledScene>,
    camera: Camera,
}

/// The asset with its scene under an additional root node.
fn scene(scale: f64, far: f64) -> Scene {
    let mut asset: Value = serde_json::from_str(ASSET).expect("the asset is JSON");
    let children = asset["scenes"][0]["nodes"].take();
    let nodes = asset["nodes"].as_array_mut().expect("the asset has nodes");
    let parent = nodes.len();
    let (s, t) = (scale, far);
    let matrix = [s, 0., 0., 0., 0., s, 0., 0., 0., 0., s, 0., t, t, t, 1.];
    nodes.push(json!({ "name": "parent", "children": children, "matrix": matrix }));
    asset["scenes"][0]["nodes"] = json!([parent]);

    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("box.gltf");
    std::fs::write(&path, asset.to_string()).expect("the temporary folder takes a file");
    let loaded = load(&path, &Default::default()).unwrap_or_else(|e| panic!("{e}"));
    let (compiled, report) =
        compile(&loaded.scene, &CompileOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    assert!(report.warnings.is_empty(), "scale {scale:e}, moved by {far:e}: {:?}", report.warnings);
    Scene { compiled: Arc::new(compiled), camera: loaded.scene.cameras[0].clone() }
}

fn picture(scene: &Scene, samples: u32, seed: u32) -> Image {
    let options = RenderOptions::default().size(SIZE, SIZE).samples(samples).seed(seed).filter(Filter::Box);
    let mut rendering =
        Rendering::new(scene.compiled.clone(), &scene.camera, options).expect("the film fits");
    rendering.run();
    assert_eq!(rendering.statistics().invalid_samples, 0, "NaN or infinite samples");
    to_image(rendering.film())
}

fn to_image(film: &Film) -> Image {
    from_pixels(|x, y| {
        let [r, g, b, _] = film.mean_rgba(x, y);
        [r, g, b]
    })
}

fn from_pixels(pixel: impl Fn(u32, u32) -> [f32; 3]) -> Image {
    let rgb = pixels().flat_map(|(x, y)| pixel(x, y));
    Image::from_linear_rgb("picture", SIZE, SIZE, rgb.collect())
}

fn pixels() -> impl Iterator<Item = (u32, u32)> {
    (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y)))
}

/// The number of pixels in which two pictures differ.
fn differing(a: &Image, b: &Image) -> u64 {
    pixels().filter(|&(x, y)| a.rgba(x, y).map(f32::to_bits) != b.rgba(x, y).map(f32::to_bits)).count() as u64
}

fn mean(images: &[Image]) -> Image {
    let n = images.len() as f32;
    from_pixels(|x, y| [0, 1, 2].map(|c| images.iter().map(|i| i.rgba(x, y)[c]).sum::<f32>() / n))
}

/// The variance of the mean of pictures that differ by seed only, per pixel.
fn variance_of_mean(images: &[Image]) -> Image {
    let (n, mean) = (images.len() as f32, mean(images));
    from_pixels(|x, y| {
        [0, 1, 2].map(|c| {
            let squares = images.iter().map(|i| (i.rgba(x, y)[c] - mean.rgba(x, y)[c]).powi(2));
            squares.sum::<f32>() / (n - 1.0) / n
        })
    })
}
