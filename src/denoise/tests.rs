use super::*;
use crate::sampling::hash::SplitMix64;

const WIDTH: usize = 96;
const HEIGHT: usize = 64;

/// A chequered surface under light that falls off to the right, in two noisy halves.
struct Chequers {
    albedo: Vec<f32>,
    normal: Vec<f32>,
    truth: Vec<f32>,
    halves: [[Vec<f32>; 3]; 2],
}

impl Chequers {
    /// Halves whose values have a relative standard deviation of `noise`: rarely much light, mostly none if that is large.
    fn new(noise: f64) -> Chequers {
        let pixels = || (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
        let albedo: Vec<f32> =
            pixels().map(|(x, y)| if (x / 6 + y / 6) % 2 == 0 { 0.8 } else { 0.2 }).collect();
        let light = |(x, _): (usize, usize)| 2.0 * (-(x as f32) / 40.0).exp();
        let truth: Vec<f32> = pixels().zip(&albedo).map(|(p, albedo)| albedo * light(p)).collect();
        // A share of samples hit: their number has the wanted variance.
        let (share, tries) =
            if noise > 1.0 { (0.1, 9.0 / noise / noise) } else { (0.5, 1.0 / noise / noise) };
        let tries = (tries.round() as usize).max(1);
        let mut random = SplitMix64::new(5);
        let halves = [0, 1].map(|_| {
            [0, 1, 2].map(|_| {
                let mut hits = || (0..tries).filter(|_| random.next_unit() < share).count() as f64;
                truth.iter().map(|t| (f64::from(*t) * hits() / (share * tries as f64)) as f32).collect()
            })
        });
        Chequers { albedo, normal: vec![0.577; WIDTH * HEIGHT], truth, halves }
    }

    fn combined(&self, sign: f32) -> [Vec<f32>; 3] {
        let [a, b] = &self.halves;
        [0, 1, 2].map(|c| a[c].iter().zip(&b[c]).map(|(a, b)| 0.5 * (a + sign * b)).collect())
    }

    fn mean(&self) -> [Vec<f32>; 3] {
        self.combined(1.0)
    }

    fn deviations(&self) -> [Vec<f32>; 3] {
        self.combined(-1.0)
    }

    /// Mean squared error relative to the truth.
    fn error(&self, color: &[Vec<f32>; 3]) -> f64 {
        let squares = color.iter().flat_map(|plane| {
            plane.iter().zip(&self.truth).map(|(v, t)| f64::from((v - t) * (v - t) / (t * t)))
        });
        squares.sum::<f64>() / (3 * WIDTH * HEIGHT) as f64
    }

    fn denoised(&self, color: &[Vec<f32>; 3], noise: Noise, parts: Vec<Vec<Color>>) -> Denoised {
        let guides = Guides { albedo: Some([&self.albedo; 3]), normal: Some([&self.normal; 3]) };
        denoise(&Noisy { width: WIDTH, height: HEIGHT, color: slices(color), noise, guides, parts })
    }

    /// The noisy and the denoised picture.
    fn both(&self) -> ([Vec<f32>; 3], [Vec<f32>; 3]) {
        let (mean, deviations) = (self.mean(), self.deviations());
        let denoised = self.denoised(&mean, Noise::Deviations(slices(&deviations)), vec![]);
        (mean, denoised.color)
    }
}

#[test]
fn noise_goes_and_texture_stays() {
    let chequers = Chequers::new(1.0);
    let (mean, deviations) = (chequers.mean(), chequers.deviations());
    let before = chequers.error(&mean);
    let variance: Vec<f32> = chequers.truth.iter().map(|t| 0.5 * t * t).collect();
    let cases = [
        (Noise::Deviations(slices(&deviations)), 5.0),
        (Noise::Variance([&variance; 3]), 5.0),
        (Noise::Unknown, 5.0),
    ];
    for (noise, factor) in cases {
        let after = chequers.error(&chequers.denoised(&mean, noise, vec![]).color);
        println!("{before} -> {after}");
        assert!(after * factor < before, "{before} -> {after}");
    }
}

/// Whatever the noise, the error falls with it, and never exceeds that of the noisy picture.
#[test]
fn denoised_pictures_converge() {
    let mut last = f64::INFINITY;
    for noise in [3.0, 1.0, 0.3, 0.1, 0.03, 0.01] {
        let chequers = Chequers::new(noise);
        let (noisy, denoised) = chequers.both();
        let (before, after) = (chequers.error(&noisy), chequers.error(&denoised));
        println!("{noise}: {before} -> {after}");
        assert!(after < 1.1 * before, "{before} -> {after}");
        assert!(after < last, "{last} -> {after}");
        last = after;
    }
}

/// Means of blocks are those of the noisy picture within its noise, and that of the picture almost exactly.
#[test]
fn brightness_stays() {
    for noise in [3.0, 1.0, 0.3, 0.1] {
        let chequers = Chequers::new(noise);
        let deviations = chequers.deviations();
        let (noisy, denoised) = chequers.both();
        let sum = |plane: &[f32]| plane.iter().map(|v| f64::from(*v)).sum::<f64>();
        for c in 0..3 {
            let ratio = sum(&denoised[c]) / sum(&noisy[c]);
            assert!((ratio - 1.0).abs() < 2e-2, "{noise}: {ratio}");
            for (x0, y0) in (0..HEIGHT / 32).flat_map(|y| (0..WIDTH / 32).map(move |x| (32 * x, 32 * y))) {
                let of = |value: &dyn Fn(usize) -> f32| {
                    let places = (y0..y0 + 32).flat_map(|y| (x0..x0 + 32).map(move |x| y * WIDTH + x));
                    places.map(|i| f64::from(value(i))).sum::<f64>()
                };
                let difference = of(&|i| denoised[c][i] - noisy[c][i]);
                let deviation = of(&|i| deviations[c][i] * deviations[c][i]).sqrt();
                assert!(difference.abs() < 3.5 * deviation, "{noise}: {difference} +- {deviation}");
            }
        }
    }
}

#[test]
fn results_are_the_same_at_any_number_of_threads() {
    let chequers = Chequers::new(1.0);
    let at = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| chequers.both().1)
    };
    assert!(at(1) == at(3));
}

#[test]
fn parts_add_up_to_the_picture() {
    let chequers = Chequers::new(1.0);
    let (mean, deviations) = (chequers.mean(), chequers.deviations());
    let share = |in_left: f32, in_right: f32| {
        mean.each_ref().map(|plane| {
            let share = |i: usize| if i % WIDTH < WIDTH / 2 { in_left } else { in_right };
            plane.iter().enumerate().map(|(i, v)| v * share(i)).collect::<Vec<f32>>()
        })
    };
    let (a, b, other) = (share(0.7, 0.2), share(0.3, 0.8), share(0.5, 0.5));
    let noise = Noise::Deviations(slices(&deviations));
    let sets = vec![vec![slices(&a), slices(&b)], vec![slices(&other)]];
    let result = chequers.denoised(&mean, noise, sets);
    for c in 0..3 {
        for i in 0..WIDTH * HEIGHT {
            let sum = result.parts[0][0][c][i] + result.parts[0][1][c][i];
            assert!((sum - result.color[c][i]).abs() <= 1e-6 * sum, "{sum} {}", result.color[c][i]);
        }
    }
    // One that is half of the picture remains so.
    let total = |part: &[Vec<f32>; 3]| part.iter().flatten().map(|v| f64::from(*v)).sum::<f64>();
    let ratio = total(&result.parts[1][0]) / total(&result.color);
    assert!((ratio - 0.5).abs() < 0.01, "{ratio}");
}

#[test]
fn fireflies_go_and_small_lights_stay() {
    let mut chequers = Chequers::new(0.3);
    let (firefly, light) = (20 * WIDTH + 30, 30 * WIDTH + 40);
    for c in 0..3 {
        chequers.halves[0][c][firefly] = 1e4;
        chequers.halves.iter_mut().for_each(|half| half[c][light] = 50.0);
    }
    let (_, denoised) = chequers.both();
    let around = |at: usize| [at - 1, at, at + 1, at - WIDTH, at + WIDTH].map(|at| denoised[1][at]);
    println!("{:?} {:?}", around(firefly), around(light));
    assert!(around(firefly).iter().all(|&v| v < 2.5), "{:?}", around(firefly));
    assert!(denoised[1][light] > 25.0, "{:?}", around(light));
}

#[test]
fn what_is_not_finite_stays_where_it_is() {
    let chequers = Chequers::new(0.3);
    let mut mean = chequers.mean();
    mean[0][5 * WIDTH + 5] = f32::NAN;
    mean[1][9 * WIDTH + 9] = f32::INFINITY;
    let result = chequers.denoised(&mean, Noise::Unknown, vec![]);
    assert!(result.color.iter().flatten().all(|v| v.is_finite()));
    assert!(chequers.error(&result.color) < 0.02, "{}", chequers.error(&result.color));
}

/// Where nothing is known of a pixel's noise, as where one half of its samples is empty, it is guessed; its light stays.
#[test]
fn pixels_of_unknown_noise_keep_their_light() {
    let chequers = Chequers::new(1.0);
    let (mean, mut deviations) = (chequers.mean(), chequers.deviations());
    deviations.iter_mut().for_each(|plane| plane.iter_mut().step_by(3).for_each(|v| *v = f32::NAN));
    let result = chequers.denoised(&mean, Noise::Deviations(slices(&deviations)), vec![]);
    let sum = |plane: &[f32]| plane.iter().map(|v| f64::from(*v)).sum::<f64>();
    assert!((sum(&result.color[0]) / sum(&mean[0]) - 1.0).abs() < 0.01);
    assert!(chequers.error(&result.color) * 5.0 < chequers.error(&mean));
    let infinite = vec![f32::INFINITY; WIDTH * HEIGHT];
    let guessed = chequers.denoised(&mean, Noise::Variance([&infinite; 3]), vec![]);
    assert!(chequers.error(&guessed.color) * 5.0 < chequers.error(&mean));
}

/// One pixel that is bright for certain is no firefly.
#[test]
fn a_light_of_one_pixel_stays() {
    let mut plane = vec![0.0; WIDTH * HEIGHT];
    plane[20 * WIDTH + 30] = 5.0;
    let (color, none) = ([plane.clone(), plane.clone(), plane], vec![0.0; WIDTH * HEIGHT]);
    let result = Chequers::new(1.0).denoised(&color, Noise::Variance([&none; 3]), vec![]);
    assert!(result.color[0][20 * WIDTH + 30] > 4.0, "{}", result.color[0][20 * WIDTH + 30]);
}
