use super::grid::{Grid, Numbers, parent};
use super::guide::{Guide, UNKNOWN};
use super::histogram::{BINS, Histogram, bin};
use super::training::{TrainedCells, TrainingSample};
use crate::math::{Frame, Vec3};
use crate::sampling::chi2::{Chi2, Random, Square};
use crate::sampling::warp;

/// Weights with some bins of hardly any.
fn weights(random: &mut Random) -> [f32; BINS] {
    std::array::from_fn(|k| if k % 5 == 0 { 1e-6 } else { random.next() + 0.01 })
}

#[test]
fn histograms_pass_chi_square() {
    let mut random = Random::new(4);
    for _ in 0..4 {
        let histogram = Histogram::new(&weights(&mut random), 0.0);
        let densities = histogram.densities();
        Chi2::new("histogram", 4).assert(
            |u| Some(histogram.sample([u[0], u[1]]).0.map(f64::from)),
            |p| f64::from(densities[bin(p.map(|x| x as f32)) as usize]),
        );
    }
}

/// Directions by a histogram have the density that is looked up for them.
#[test]
fn guided_directions_pass_chi_square() {
    let mut random = Random::new(5);
    let histogram = Histogram::new(&weights(&mut random), 0.0);
    let densities = histogram.densities();
    let frame = Frame::from_normal(Vec3::new(0.48, -0.6, 0.64));
    let of = |w: Vec3| densities[bin(warp::square_of_cosine_hemisphere(frame.to_local(w))) as usize];
    Chi2::new("guided directions", 1).assert_directions(
        &Square::sphere(),
        |u| Some(frame.to_world(warp::cosine_hemisphere(histogram.sample([u[0], u[1]]).0))),
        |w| warp::cosine_hemisphere_pdf_solid_angle(frame.to_local(w).z) * of(w),
    );
}

#[test]
fn samples_lie_in_the_bins_of_their_densities() {
    let mut random = Random::new(6);
    let histogram = Histogram::new(&weights(&mut random), 0.0);
    let densities = histogram.densities();
    let below_one = 1.0f32.next_down();
    let corners = [[0.0, 0.0], [below_one, below_one], [0.0, below_one], [0.5, 0.25]];
    let many = (0..20_000).map(|_| [random.next(), random.next()]);
    for u in corners.into_iter().chain(many) {
        let (point, density) = histogram.sample(u);
        assert!(point.iter().all(|x| (0.0..1.0).contains(x)), "{u:?} {point:?}");
        assert_eq!(densities[bin(point) as usize], density, "{u:?}");
    }
    assert!((densities.iter().sum::<f32>() / BINS as f32 - 1.0).abs() < 1e-5);
}

#[test]
fn keys_have_numbers_in_their_order() {
    let mut numbers = Numbers::default();
    assert_eq!(numbers.get(7), None);
    let keys: Vec<u64> = (1..5000u64).map(|k| k.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1).collect();
    for (number, &key) in keys.iter().enumerate() {
        assert_eq!(numbers.insert(key), number as u32);
        assert_eq!(numbers.insert(keys[number / 2]), (number / 2) as u32);
    }
    assert!(keys.iter().enumerate().all(|(number, &key)| numbers.get(key) == Some(number as u32)));
    assert_eq!(numbers.get(2), None);
}

fn training_sample(p: Vec3, n: Vec3, bin: u32, value: f32) -> TrainingSample {
    TrainingSample { p: p.to_array(), n: n.to_array(), bin, value }
}

#[test]
fn cells_are_as_large_as_samples_ask_for() {
    let mut random = Random::new(7);
    let floor = |random: &mut Random| Vec3::new(random.next() * 4.0 - 2.0, 0.0, random.next() * 4.0 - 2.0);
    let samples: Vec<TrainingSample> =
        (0..20_000).map(|_| training_sample(floor(&mut random), Vec3::Y, 0, 1.0)).collect();
    for wanted in [500.0, 2000.0] {
        let grid = Grid::suited_to(&samples, 320_000.0, wanted).expect("samples");
        let mut keys: Vec<u64> = samples.iter().map(|l| grid.key(l.p.into(), l.n.into())).collect();
        keys.sort_unstable();
        keys.dedup();
        let mean = 320_000.0 / keys.len() as f64;
        assert!((0.5 * wanted..4.0 * wanted).contains(&mean), "{wanted}: {mean}");
    }
    assert!(Grid::suited_to(&[], 1.0, 100.0).is_none());
    let grid = Grid::new(0.5);
    let (a, b) = (Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.9, 0.2, 0.3));
    assert_ne!(grid.key(a, Vec3::Y), grid.key(a, Vec3::X));
    assert_ne!(grid.key(a, Vec3::Y), grid.key(b, Vec3::Y));
    assert_eq!(parent(grid.key(a, Vec3::Y)), parent(grid.key(b, Vec3::Y)));
}

/// A guide leads to where light came from, and expects as much as came; of other places it knows nothing.
#[test]
fn guides_know_what_they_learned() {
    let (mut random, grid) = (Random::new(8), Grid::new(1.0));
    let here = Vec3::new(0.1, 0.0, 0.1);
    let found: Vec<TrainingSample> = (0..4000)
        .map(|_| {
            let bin = (random.next() * BINS as f32) as u32;
            training_sample(here, Vec3::Y, bin, if bin == 20 { 64.0 } else { 0.0 })
        })
        .collect();
    let mut trained = TrainedCells::new(grid);
    let cell_samples = grid.cell_samples(&found);
    for (share, cell_samples) in trained.shares.iter_mut().zip(&cell_samples) {
        share.learn(cell_samples);
    }
    let guide = Guide::new(&trained, 1.0);
    let key = grid.key(here, Vec3::Y);
    let cell = guide.find(key as u32, (key >> 32) as u32) as usize;
    assert_ne!(cell as u32, UNKNOWN);
    let densities = &guide.densities[cell * BINS..(cell + 1) * BINS];
    assert!(densities[20] > 20.0 && densities.iter().all(|d| *d > 0.2), "{densities:?}");
    let mean = guide.histograms[cell].mean;
    assert!((0.8..1.2).contains(&mean), "{mean}");
    let elsewhere = grid.key(Vec3::splat(50.0), Vec3::Y);
    assert_eq!(guide.find(elsewhere as u32, (elsewhere >> 32) as u32), UNKNOWN);
    // A neighbour's larger cell knows something.
    let beside = grid.key(Vec3::new(1.3, 0.0, 0.1), Vec3::Y);
    let found = guide.find(beside as u32, (beside >> 32) as u32);
    assert!(found != UNKNOWN && found as usize != cell);
    assert_eq!(guide.cells(), 2);
}

/// Values near the ends of the range of floats leave a guide that is of use: all that is beyond it says nothing.
#[test]
fn values_of_any_size_make_usable_guides() {
    let (mut random, grid) = (Random::new(9), Grid::new(1.0));
    let here = Vec3::new(0.1, 0.0, 0.1);
    for size in [1e-38, 1e-20, 1e20, 1e30, 1e38, f32::INFINITY] {
        let found: Vec<TrainingSample> = (0..4000)
            .map(|_| {
                let bin = (random.next() * BINS as f32) as u32;
                training_sample(here, Vec3::Y, bin, if bin == 20 { size } else { 0.0 })
            })
            .collect();
        let mut trained = TrainedCells::new(grid);
        for (share, samples) in trained.shares.iter_mut().zip(&grid.cell_samples(&found)) {
            share.learn(samples);
        }
        let guide = Guide::new(&trained, 1.0);
        let is_usable = |density: &f32| (0.2..=BINS as f32).contains(density);
        assert!(guide.densities.iter().all(is_usable), "{size}: {:?}", guide.densities);
        for densities in guide.densities.chunks(BINS) {
            assert!(
                (densities.iter().sum::<f32>() / BINS as f32 - 1.0).abs() < 1e-4,
                "{size}: {densities:?}"
            );
        }
        assert!(guide.histograms.iter().all(|h| h.mean.is_finite()), "{size}");
    }
}
