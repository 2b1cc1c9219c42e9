use super::*;
use crate::sampling::hash::SplitMix64;

const WIDTH: usize = 70;
const HEIGHT: usize = 45;

/// Numbers of mean 0 and variance 1.
fn noise(seed: u64) -> Vec<f32> {
    let mut random = SplitMix64::new(seed);
    let mut uniform = || random.next_unit() as f32;
    (0..WIDTH * HEIGHT).map(|_| (0..12).map(|_| uniform()).sum::<f32>() - 6.0).collect()
}

/// A chequered surface under light that falls off to the right.
struct Chequers {
    albedo: Vec<f32>,
    truth: Vec<f32>,
    halves: [[Vec<f32>; 3]; 2],
}

impl Chequers {
    fn new() -> Chequers {
        let places = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
        let albedo: Vec<f32> =
            places.clone().map(|(x, y)| if (x / 5 + y / 7) % 2 == 0 { 0.8 } else { 0.2 }).collect();
        let truth: Vec<f32> =
            places.zip(&albedo).map(|((x, _), a)| a * (1.0 - 0.5 * x as f32 / WIDTH as f32)).collect();
        let half = |seed: u64| {
            [0, 1, 2].map(|c| truth.iter().zip(noise(seed + c)).map(|(t, n)| t * (1.0 + 0.4 * n)).collect())
        };
        Chequers { halves: [half(1), half(11)], albedo, truth }
    }

    fn deviations(&self) -> [Vec<f32>; 3] {
        let [a, b] = &self.halves;
        [0, 1, 2].map(|c| a[c].iter().zip(&b[c]).map(|(a, b)| 0.5 * (a - b)).collect())
    }

    fn mean(&self) -> [Vec<f32>; 3] {
        let [a, b] = &self.halves;
        [0, 1, 2].map(|c| a[c].iter().zip(&b[c]).map(|(a, b)| 0.5 * (a + b)).collect())
    }

    fn error(&self, color: &[Vec<f32>; 3]) -> f64 {
        let squares = color.iter().flat_map(|plane| {
            plane.iter().zip(&self.truth).map(|(v, t)| f64::from((v - t) * (v - t) / (t * t)))
        });
        squares.sum::<f64>() / (3 * WIDTH * HEIGHT) as f64
    }
}

fn with<T>(chequers: &Chequers, color: &[Vec<f32>; 3], noise: Noise, then: impl Fn(Noisy) -> T) -> T {
    let guides = Guides { albedo: Some([&chequers.albedo; 3]), ..Guides::default() };
    then(Noisy { width: WIDTH, height: HEIGHT, color: slices(color), noise, guides, parts: vec![] })
}

#[test]
fn noise_goes_and_texture_stays() {
    let chequers = Chequers::new();
    let mean = chequers.mean();
    let before = chequers.error(&mean);
    let deviations = chequers.deviations();
    let variance: Vec<f32> = chequers.truth.iter().map(|t| 0.08 * t * t).collect();
    let cases = [
        (Noise::Deviations(slices(&deviations)), 100.0),
        (Noise::Variance([&variance; 3]), 100.0),
        (Noise::Unknown, 50.0),
    ];
    for (noise, factor) in cases {
        let after = chequers.error(&with(&chequers, &mean, noise, |noisy| denoise(&noisy)).color);
        assert!(after * factor < before, "{before} -> {after}");
    }
}

#[test]
fn results_are_the_same_at_any_number_of_threads() {
    let chequers = Chequers::new();
    let deviations = chequers.deviations();
    let noise = Noise::Deviations(slices(&deviations));
    let at = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| with(&chequers, &chequers.mean(), noise, |noisy| denoise(&noisy)))
    };
    assert!(at(1) == at(3));
}

#[test]
fn parts_add_up_to_the_picture() {
    let chequers = Chequers::new();
    let mean = chequers.mean();
    let shares = noise(77);
    let share = |sign: f32| {
        mean.each_ref().map(|plane| {
            plane.iter().zip(&shares).map(|(v, s)| v * (0.5 + sign * s * 0.1)).collect::<Vec<f32>>()
        })
    };
    let (a, b) = (share(1.0), share(-1.0));
    let deviations = chequers.deviations();
    let noise = Noise::Deviations(slices(&deviations));
    let result = with(&chequers, &mean, noise, |noisy| {
        denoise(&Noisy { parts: vec![slices(&a), slices(&b)], ..noisy })
    });
    for c in 0..3 {
        for i in 0..WIDTH * HEIGHT {
            let sum = result.parts[0][c][i] + result.parts[1][c][i];
            assert!((sum - result.color[c][i]).abs() < 2e-5, "{sum} {}", result.color[c][i]);
        }
    }
}

#[test]
fn fireflies_go_and_small_lights_stay() {
    let chequers = Chequers::new();
    let (mut halves, firefly, light) = (chequers.halves.clone(), 20 * WIDTH + 30, 30 * WIDTH + 40);
    for c in 0..3 {
        halves[0][c][firefly] = 1e4;
        halves.iter_mut().for_each(|half| half[c][light] = 50.0);
    }
    let both = Chequers { halves, ..chequers };
    let deviations = both.deviations();
    let noise = Noise::Deviations(slices(&deviations));
    let result = with(&both, &both.mean(), noise, |noisy| denoise(&noisy));
    let around = |at: usize| [at - 1, at, at + 1, at - WIDTH, at + WIDTH].map(|at| result.color[1][at]);
    assert!(around(firefly).iter().all(|&v| v < 1.5), "{:?}", around(firefly));
    assert!(result.color[1][light] > 25.0, "{:?}", around(light));
}

#[test]
fn what_is_not_finite_stays_where_it_is() {
    let chequers = Chequers::new();
    let mut mean = chequers.mean();
    mean[0][5 * WIDTH + 5] = f32::NAN;
    mean[1][9 * WIDTH + 9] = f32::INFINITY;
    let result = with(&chequers, &mean, Noise::Unknown, |noisy| denoise(&noisy));
    assert!(result.color.iter().flatten().all(|v| v.is_finite()));
    assert!(chequers.error(&result.color) < 0.01);
}

/// Where nothing is known of a pixel's noise, as where one half of its samples is empty, it is guessed; its light stays.
#[test]
fn pixels_of_unknown_noise_keep_their_light() {
    let chequers = Chequers::new();
    let (mean, mut deviations) = (chequers.mean(), chequers.deviations());
    deviations.iter_mut().for_each(|plane| plane.iter_mut().step_by(3).for_each(|v| *v = f32::NAN));
    let result = with(&chequers, &mean, Noise::Deviations(slices(&deviations)), |noisy| denoise(&noisy));
    let sum = |plane: &[f32]| plane.iter().map(|v| f64::from(*v)).sum::<f64>();
    assert!((sum(&result.color[0]) / sum(&mean[0]) - 1.0).abs() < 0.02);
    assert!(chequers.error(&result.color) * 20.0 < chequers.error(&mean));
    let infinite = vec![f32::INFINITY; WIDTH * HEIGHT];
    let guessed = with(&chequers, &mean, Noise::Variance([&infinite; 3]), |noisy| denoise(&noisy));
    assert!(chequers.error(&guessed.color) * 20.0 < chequers.error(&mean));
}

/// One pixel that is bright for certain is no firefly.
#[test]
fn a_light_of_one_pixel_stays() {
    let mut plane = vec![0.0; WIDTH * HEIGHT];
    plane[20 * WIDTH + 30] = 5.0;
    let (color, none) = ([plane.clone(), plane.clone(), plane], vec![0.0; WIDTH * HEIGHT]);
    let chequers = Chequers::new();
    let result = with(&chequers, &color, Noise::Variance([&none; 3]), |noisy| denoise(&noisy));
    assert!(result.color[0][20 * WIDTH + 30] > 4.0, "{}", result.color[0][20 * WIDTH + 30]);
}
