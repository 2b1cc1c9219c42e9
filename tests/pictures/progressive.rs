//! Progressive rendering: the film is a picture after each pass, and after stopping.

use crate::support::{camera, material, options, picture, quad, rendering};
use oscura::compile::{CompileOptions, compile};
use oscura::film::{Aov, AovSet, Film};
use oscura::math::DVec3;
use oscura::render::{CancelHandle, Event, PassOutcome, PathReuse, Rendering};
use oscura::scene::{Material, Scene};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

fn cornell() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-quads.toml");
    oscura::load::load(&path, &Default::default()).expect("the scene loads").scene
}

fn all() -> AovSet {
    Aov::ALL.iter().copied().collect()
}

/// Every value of every plane, as bits.
fn bits(film: &Film) -> Vec<(String, Vec<u32>)> {
    let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect();
    film.planes().map(|plane| (plane.name.to_string(), bits(plane.values.into_floats()))).collect()
}

#[test]
fn film_after_each_pass_matches_a_render_of_that_many_samples() {
    let scene = cornell();
    let whole = options(40, 28, 100).aovs(all());
    let mut stepping = rendering(&scene, &whole);
    assert_eq!(stepping.film().unsampled_pixels(), 1600);
    let progressed = PassOutcome::Progressed;
    for (samples, outcome) in [(8, progressed), (16, progressed), (24, progressed), (28, PassOutcome::Done)] {
        assert_eq!(stepping.next_pass(), outcome);
        let statistics = stepping.statistics();
        assert_eq!((statistics.samples, statistics.samples_per_pixel), (1600 * samples, samples as f64));
        // Fewer samples than half the plan use another sequence.
        if samples > 16 {
            let fewer = picture(&scene, &whole.samples(samples as u32));
            assert!(bits(stepping.film()) == bits(&fewer), "{samples} samples");
        }
    }
    let rays = stepping.statistics().rays;
    assert_eq!(stepping.next_pass(), PassOutcome::Done);
    assert_eq!((stepping.statistics().rays, stepping.film().samples(0, 0)), (rays, 28));
    assert!(bits(stepping.film()) == bits(&picture(&scene, &whole)));
}

/// However many passes overlap, each pixel accumulates its samples in one order.
#[test]
fn overlapping_passes_match_sequential_ones() {
    let scene = cornell();
    for size in [5, 57] {
        let options = options(size, 60, 100).aovs(all()).halves(true);
        let mut stepping = rendering(&scene, &options);
        while stepping.next_pass() == PassOutcome::Progressed {}
        for threads in [1, 3, 40] {
            let whole = || {
                let mut whole = rendering(&scene, &options);
                assert_eq!(whole.run(), PassOutcome::Done);
                whole
            };
            let whole = oscura::render::in_pool(Some(threads), whole).expect("the threads start");
            assert!(bits(whole.film()) == bits(stepping.film()), "{size} pixels, {threads} threads");
            assert_eq!(whole.film().halves(), stepping.film().halves());
        }
    }
}

#[test]
fn pauses_between_passes() {
    let (scene, options) = (cornell(), options(57, 120, 100));
    for threads in [1, 40] {
        let paused = || {
            let mut rendering = rendering(&scene, &options);
            let mut samples = Vec::new();
            loop {
                let asked = AtomicU64::new(0);
                let outcome = rendering.run_until(|| asked.fetch_add(1, Ordering::Relaxed) >= 3);
                let film = rendering.film();
                let of = |i: u32| film.samples(i % 57, i / 57);
                assert!((0..57 * 57).all(|i| of(i) == of(0)), "all pixels have as many samples");
                samples.push(of(0));
                if outcome != PassOutcome::Progressed {
                    assert_eq!(outcome, PassOutcome::Done);
                    break (samples, bits(film));
                }
            }
        };
        let (samples, last) = oscura::render::in_pool(Some(threads), paused).expect("the threads start");
        assert!(samples.len() > 3 && samples[1] - samples[0] > 8, "{samples:?}");
        assert!(last == bits(&picture(&scene, &options)), "{threads} threads");
    }
}

#[test]
fn all_channels_are_deterministic() {
    let scene = cornell();
    let with = |threads| {
        let shot = || bits(&picture(&scene, &options(50, 20, 100).aovs(all())));
        oscura::render::in_pool(Some(threads), shot).expect("the threads start")
    };
    assert!(with(1) == with(5));
}

#[test]
fn handle_stops_between_and_within_passes() {
    let scene = cornell();
    let mut stopped = rendering(&scene, &options(40, 64, 100));
    let handle = stopped.cancel_handle();
    assert_eq!(stopped.next_pass(), PassOutcome::Progressed);
    std::thread::spawn(move || assert!(!handle.cancel())).join().expect("the thread ends");
    assert_eq!((stopped.next_pass(), stopped.run()), (PassOutcome::Cancelled, PassOutcome::Cancelled));
    assert!(stopped.statistics().interrupted && stopped.statistics().samples_per_pixel == 8.0);
    let mut one_pass = rendering(&scene, &options(40, 64, 100));
    one_pass.next_pass();
    assert!(bits(stopped.film()) == bits(one_pass.film()));

    // From the first progress event on (after the pilot), finished tiles stay.
    let handle = CancelHandle::new();
    let switch = handle.clone();
    let endless = options(256, 1 << 20, 100);
    let mut within = rendering(&scene, &endless).with_cancel_handle(handle).on_event(move |event| {
        let Event::Progress { samples_done, .. } = event else { return };
        if samples_done > 0 {
            switch.cancel();
        }
    });
    assert_eq!(within.run(), PassOutcome::Cancelled);
    let (film, statistics) = (within.film(), within.statistics());
    assert!(statistics.samples > 0 && statistics.interrupted && !statistics.timed_out);
    let counts = film.planes().count();
    assert_eq!(counts, 4);
    let sampled: u64 = (0..256 * 256).map(|i| u64::from(film.samples(i % 256, i / 256))).sum();
    assert_eq!(sampled, statistics.samples);
}

/// A large picture whose first pass is stopped after three of its eight samples.
#[test]
fn first_pass_soon_covers_all_pixels() {
    const EDGE: u32 = 1000;
    let (handle, scene) = (CancelHandle::new(), cornell());
    let switch = handle.clone();
    let options = options(EDGE, 64, 100).path_reuse(PathReuse::Off);
    let mut stopped = rendering(&scene, &options).with_cancel_handle(handle).on_event(move |event| {
        let Event::Progress { samples_done, .. } = event else { return };
        if samples_done >= 3 * u64::from(EDGE * EDGE) {
            switch.cancel();
        }
    });
    let outcome = oscura::render::in_pool(Some(1), || stopped.next_pass()).expect("the thread starts");
    assert_eq!(outcome, PassOutcome::Cancelled);
    let counts: Vec<u32> = (0..EDGE * EDGE).map(|i| stopped.film().samples(i % EDGE, i / EDGE)).collect();
    assert!(counts.iter().all(|count| *count == 2 || *count == 8), "samples of a part");
    assert!(counts.contains(&2), "it was stopped before its end");
}

#[test]
fn time_limit_covers_rendering_only() {
    let scene = cornell();
    let limit = Duration::from_millis(300);
    let mut limited = rendering(&scene, &options(16, u32::MAX, 100).time_limit(limit));
    assert_eq!(limited.next_pass(), PassOutcome::Progressed);
    std::thread::sleep(2 * limit);
    assert_eq!(limited.next_pass(), PassOutcome::Progressed, "the pause is not rendering");
    assert_eq!(limited.run(), PassOutcome::TimedOut);
    let statistics = limited.statistics();
    assert!(statistics.timed_out && !statistics.interrupted, "{statistics:?}");
}

#[test]
fn events_count_up_to_all_paths() {
    let seen = Arc::new(AtomicU64::new(0));
    let last = seen.clone();
    let mut reported = rendering(&cornell(), &options(32, 12, 100)).on_event(move |event| {
        let Event::Progress { samples_done, samples_total, .. } = event else { return };
        assert!(samples_done <= samples_total && samples_total == 32 * 32 * 12);
        last.fetch_max(samples_done, Ordering::Relaxed);
    });
    assert_eq!(reported.run(), PassOutcome::Done);
    assert_eq!(seen.load(Ordering::Relaxed), 32 * 32 * 12);
}

#[test]
fn renderers_share_a_scene() {
    let options = options(24, 8, 8);
    let scene = cornell();
    let (compiled, _) = compile(&scene, &CompileOptions::default()).expect("the scene compiles");
    let compiled = Arc::new(compiled);
    let shot = |seed| {
        let rendering = Rendering::new(compiled.clone(), &scene.cameras[0], options.seed(seed));
        let mut rendering = rendering.expect("the film fits");
        rendering.run();
        rendering.into_picture().into_film()
    };
    assert!(shot(1) == shot(1) && shot(1) != shot(2));
}

/// A floor, a thousand kilometres from the origin, seen obliquely from above: positions are in the scene's world space.
#[test]
fn positions_are_in_world_space() {
    let far = DVec3::new(1e6, -2e6, 5e5);
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    let corner = far + DVec3::new(-4.0, 0.0, -4.0);
    quad(&mut scene, corner.to_array(), [0.0, 0.0, 8.0], [8.0, 0.0, 0.0], grey);
    scene.cameras.push(camera(far + DVec3::new(0.0, 3.0, 2.0), far, DVec3::Y, 40.0));
    let film = picture(&scene, &options(17, 4, 1).aovs([Aov::Position, Aov::Depth, Aov::MaterialId]));
    let plane = |name: &str| film.plane(name).expect("it was asked for").into_floats();
    let [x, y, z] = ["P.X", "P.Y", "P.Z"].map(plane);
    // The centre of the picture looks at `far`, from 13^0.5 metres; f32 has steps of 0.06 m and 0.125 m there.
    let middle = 8 * 17 + 8;
    let off = [x[middle], y[middle], z[middle]].map(f64::from);
    assert!((DVec3::from_array(off) - far).abs().max_element() < 0.2, "{off:?}");
    assert!((plane("Z")[middle] - 13f32.sqrt()).abs() < 0.1);
    assert!(y.iter().all(|y| (f64::from(*y) - far.y).abs() < 0.2));
    assert!(x[middle + 5] > x[middle] + 0.4 && z[middle + 17 * 5] > z[middle] + 0.4);
    assert!(plane("material.id").iter().all(|id| *id == 1.0));
}

/// The first half of the samples are those of a picture of half as many, and storing it changes nothing else.
#[test]
fn half_buffers_are_kept_on_request() {
    let scene = cornell();
    for samples in [2, 6, 8, 16, 32] {
        let whole = options(40, 28, 100).samples(samples);
        let film = picture(&scene, &whole.halves(true));
        let plain = picture(&scene, &whole);
        assert!(bits(&film) == bits(&plain) && plain.halves().is_none(), "{samples}");
        let [first, second] = film.halves().expect("halves");
        let both = first.iter().zip(&second).map(|(a, b)| [0, 1, 2].map(|c| 0.5 * (a[c] + b[c])));
        for (both, all) in both.zip(film.rgba()) {
            assert!(
                (0..3).all(|c| (both[c] - all[c]).abs() <= 1e-5 * all[c].abs()),
                "{samples}: {both:?} {all:?}"
            );
        }
        assert!(first != second);
    }
    let mut stepping = rendering(&scene, &options(40, 28, 100).samples(16).halves(true));
    stepping.next_pass();
    let half: Vec<[f32; 3]> = stepping.film().rgba().iter().map(|p| [p[0], p[1], p[2]]).collect();
    stepping.next_pass();
    assert!(stepping.film().halves().expect("halves")[0] == half);
}
