//! The network against what Open Image Denoise 2.5.1 makes of the same picture, and against itself.

use super::*;
use crate::sampling::hash::SplitMix64;
use crate::simd::{Level, best_level, limit_level};
use half::f16;

const WIDTH: usize = 75;
const HEIGHT: usize = 41;

/// Red, green and blue of each pixel of [`Scene::new`] after the library's filter `RT`: `hdr` with albedo and normal, and
/// without guides, in half precision.
const LIBRARY: &[u8] = include_bytes!("library.bin");

struct Scene {
    width: usize,
    height: usize,
    /// Color, albedo, normal.
    planes: [[Vec<f32>; 3]; 3],
}

impl Scene {
    /// Squares of eight pixels under noisy light that falls off to the right.
    fn new(width: usize, height: usize) -> Scene {
        let unit = |seed: u64, count: usize| -> Vec<f64> {
            let mut random = SplitMix64::new(seed);
            (0..count).map(|_| random.next_unit()).collect()
        };
        let (squares, noise) = (unit(1, 9 * 64 * 3), unit(2, width * height * 3));
        let mut planes = [0, 1, 2].map(|_| [0, 1, 2].map(|_| vec![0.0f32; width * height]));
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let (at, square) = (y * width + x, y / 8 % 8 * 8 + x / 8 % 8);
            let normal = [(x % 16) as f32 / 16.0 - 0.5, (y % 16) as f32 / 16.0 - 0.5, 0.7];
            let light = 4.0 * (-((x / 4) as f64) / 2.0).exp2();
            for c in 0..3 {
                let (albedo, noise) = (squares[3 * square + c], 2.0 * noise[3 * at + c]);
                planes[0][c][at] = (albedo * light * noise * noise) as f32;
                planes[1][c][at] = albedo as f32;
                planes[2][c][at] = normal[c];
            }
        }
        Scene { width, height, planes }
    }

    fn denoised(&self, has_guides: bool) -> [Vec<f32>; 3] {
        let [color, albedo, normal] = self.planes.each_ref().map(|p| p.each_ref().map(Vec::as_slice));
        let guides = has_guides.then_some([albedo, normal]);
        let ones = vec![1.0; self.width * self.height];
        Network::new(has_guides).run(self.width, self.height, color, &ones, guides)
    }
}

#[test]
fn the_network_equals_the_library() {
    let scene = Scene::new(WIDTH, HEIGHT);
    let expected: Vec<f32> =
        LIBRARY.chunks_exact(2).map(|two| f16::from_le_bytes([two[0], two[1]]).to_f32()).collect();
    for (has_guides, expected) in [true, false].into_iter().zip(expected.chunks_exact(WIDTH * HEIGHT * 3)) {
        let found = scene.denoised(has_guides);
        for (at, expected) in expected.chunks_exact(3).enumerate() {
            for c in 0..3 {
                let (a, b) = (found[c][at], expected[c]);
                // Half precision keeps eleven bits, fewer below 6e-5.
                assert!((a - b).abs() <= 6e-4 * b + 1e-6, "pixel {at}, {c}: {a}, library {b}");
            }
        }
    }
}

#[test]
fn strips_tiles_and_threads_change_nothing() {
    // More than one strip, more than one tile, uneven edges.
    let scene = Scene::new(141, STRIP + 27);
    let at = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| scene.denoised(true))
    };
    let whole = at(1);
    assert!(whole == at(3));
    assert!(whole.iter().flatten().all(|v| v.is_finite()));
}

#[test]
fn all_levels_have_the_same_bits() {
    let scene = Scene::new(33, 20);
    let best = best_level();
    let of = |level| {
        limit_level(level);
        scene.denoised(true)
    };
    let results: Vec<_> = Level::ALL.into_iter().map(of).collect();
    limit_level(best);
    assert!(results.iter().all(|result| *result == results[0]));
}
