//! Differences between the pictures of two techniques for one scene.

use super::{compiled, picture, shot};
use oscura::film::Film;
use oscura::render::{RenderOptions, in_pool};
use oscura::scene::Scene;
use oscura::simd::{Level, limit_level};

const BLOCK: u32 = 8;

/// The bits of a picture.
pub fn bits(film: &Film) -> Vec<[u32; 4]> {
    film.rgba().into_iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// Asserts that a picture has the same bits at any number of threads and at all CPU levels.
pub fn assert_same_bits(what: &str, scene: &Scene, options: &RenderOptions) {
    let with =
        |threads| in_pool(Some(threads), || bits(&picture(scene, options))).expect("the threads start");
    let one = with(1);
    for threads in [3, 40] {
        assert!(one == with(threads), "{what}: {threads} threads");
    }
    for level in Level::ALL.into_iter().filter(|l| l.is_available()) {
        limit_level(level);
        assert!(one == with(2), "{what}: {}", level.name());
    }
    limit_level(Level::HIGHEST);
}

/// Mean squared difference of two seeds.
pub fn noise(scene: &Scene, options: &RenderOptions) -> f64 {
    let [a, b] = [1, 2].map(|seed| picture(scene, &options.seed(seed)).rgba());
    let square = |(a, b): (&[f32; 4], &[f32; 4])| f64::from(a[1] - b[1]).powi(2);
    a.iter().zip(&b).map(square).sum::<f64>() / a.len() as f64
}

/// Means of square blocks, per channel.
fn blocks(film: &Film) -> Vec<f64> {
    let (columns, rows) = (film.width() / BLOCK, film.height() / BLOCK);
    let mut sums = vec![0.0; (3 * columns * rows) as usize];
    for (i, rgba) in film.rgba().iter().enumerate() {
        let (x, y) = (i as u32 % film.width() / BLOCK, i as u32 / film.width() / BLOCK);
        for c in 0..3 {
            sums[(3 * (y * columns + x)) as usize + c] += f64::from(rgba[c]) / f64::from(BLOCK * BLOCK);
        }
    }
    sums
}

/// How pictures of two techniques differ, over independent seeds.
pub struct Difference {
    /// Of each block: the mean difference, and its standard error.
    pub blocks: Vec<(f64, f64)>,
    /// Of the whole picture, relative to its mean.
    pub whole: (f64, f64),
}

/// Pictures of the second technique minus those of the first, seed by seed: where both trace the same paths, the differences are
/// smaller than the noise of either. Sizes are multiples of 8.
pub fn differences(scene: &Scene, ways: [&RenderOptions; 2], seeds: u32) -> Difference {
    let compiled = compiled(scene);
    let [off, on] = ways.map(|options| {
        let of_seed = |seed| blocks(&shot(&compiled, &scene.cameras[0], &options.seed(seed * 7919 + 3)));
        (0..seeds).map(of_seed).collect::<Vec<Vec<f64>>>()
    });
    let n = f64::from(seeds);
    let mean_and_error = |values: &[f64]| {
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, (variance / n).sqrt())
    };
    let of_block = |i: usize| {
        let values: Vec<f64> = off.iter().zip(&on).map(|(off, on)| on[i] - off[i]).collect();
        mean_and_error(&values)
    };
    let sum = |picture: &Vec<f64>| picture.iter().sum::<f64>();
    let total = off.iter().map(sum).sum::<f64>() / n;
    let whole: Vec<f64> = off.iter().zip(&on).map(|(off, on)| (sum(on) - sum(off)) / total).collect();
    Difference { blocks: (0..off[0].len()).map(of_block).collect(), whole: mean_and_error(&whole) }
}

/// Asserts that blocks of both pictures have the same means: differences match their standard errors. With 16 seeds.
pub fn assert_same_means(what: &str, scene: &Scene, ways: [&RenderOptions; 2], seeds: u32) {
    let found = differences(scene, ways, seeds);
    let z: Vec<f64> = found.blocks.iter().map(|(d, error)| d / error.max(1e-9)).collect();
    let rms = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
    let worst = z.iter().fold(0.0f64, |worst, z| worst.max(z.abs()));
    let (mean, error) = found.whole;
    println!("{what}: z rms {rms:.2}, worst {worst:.2}; whole {mean:.1e} +- {error:.1e}");
    // Student's t with 15 degrees of freedom has a deviation of 1.07; there are some hundred values.
    assert!(rms < 1.4, "{what}: z rms {rms}");
    assert!(worst < 5.5, "{what}: worst z {worst}");
    // Techniques that sample the same paths differ by single-precision rounding only, which is no noise.
    let rounded = error.max(1e-8);
    assert!(mean.abs() < 4.5 * rounded && error < 1e-3, "{what}: {mean} +- {error}");
}
