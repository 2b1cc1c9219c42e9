//! `Scene::validate` makes `compile` total: any mutated scene is either refused with a list of problems, or renders. Nothing
//! panics, and what is refused is never rendered.
//!
//! Pictures hold finite numbers only. Samples beyond single precision (lights of 1e38 and the like) are discarded and counted;
//! where all numbers are below a million there are none.

mod bases;
mod dice;
mod motion;
mod mutate;
mod table;

use crate::support::options;
use dice::Dice;
use mutate::Mutate;
use oscura::compile::{CompileOptions, Compiler, View, compile};
use oscura::error::ErrorKind;
use oscura::film::{Aov, AovSet, Film};
use oscura::render::{RenderOptions, Rendering};
use oscura::scene::Scene;
use rayon::ThreadPoolBuilder;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// The result of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// `validate` finds problems, and `compile` agrees.
    Refused,
    /// It compiles, but has no camera.
    WithoutCamera,
    /// A picture, with the number of discarded samples.
    Picture { invalid: u64 },
}

/// A mutated scene: its mutations and the result.
struct Trial {
    mutation: String,
    result: Result<Outcome, String>,
    took: Duration,
}

/// Widths and heights; some pictures have no pixels.
const SIZES: [u32; 8] = [8, 8, 8, 8, 8, 5, 1, 0];

/// Frames of a few pixels, with everything that can be recorded.
fn picture_options(dice: &mut Dice) -> RenderOptions {
    let (width, height, depth) = (dice.pick(&SIZES), dice.pick(&SIZES), dice.pick(&[0, 1, 6, 6, 6]));
    let all: AovSet = Aov::ALL.iter().copied().collect();
    options(8, 2, depth).size(width, height).aovs(all).seed(dice.below(100) as u32)
}

/// Validates, compiles and renders; failures are returned, or panic.
fn outcome(scene: &Scene, before: &Scene, dice: &mut Dice) -> Result<Outcome, String> {
    let problems = scene.validate();
    let shading = scene.settings.shading();
    let as_sequence = dice.once_in(8);
    let anchor = dice.once_in(8).then(|| {
        let mut anchor = oscura::math::DVec3::ZERO;
        dice.at("anchor", |dice| anchor.mutate(dice));
        anchor
    });
    let compiled = match (scene.cameras.first(), before.cameras.first()) {
        (Some(camera), Some(earlier)) if as_sequence => {
            let mut compiler = Compiler::sequence();
            let base = compiler.compile(before, shading, earlier, (8, 8));
            // Some bases have features without spectral support.
            assert!(base.is_ok() || shading.spectral, "the base compiles");
            compiler.compile(scene, shading, camera, (8, 8)).map(|(compiled, ..)| compiled)
        }
        _ => compile(scene, &CompileOptions { shading, anchor, ..CompileOptions::default() })
            .map(|(compiled, _)| compiled.into()),
    };
    let compiled = match (compiled, problems.is_empty()) {
        (Ok(compiled), true) => compiled,
        (Err(_), true) if anchor.is_some_and(|anchor| !anchor.is_finite()) => return Ok(Outcome::Refused),
        (Err(error), false) if error.kind == ErrorKind::Input && error.problems == problems => {
            let reported: Vec<String> = problems.iter().map(ToString::to_string).collect();
            let is_short = reported.iter().all(|text| text.len() < 12_000) && reported.len() < 200;
            return if is_short {
                Ok(Outcome::Refused)
            } else {
                Err(format!("{} long problems", reported.len()))
            };
        }
        (Ok(_), false) => return Err(format!("compiles with problems: {problems:?}")),
        (Err(error), _) => return Err(format!("an error that validate doesn't tell: {error}")),
    };
    let Some(camera) = scene.cameras.first() else { return Ok(Outcome::WithoutCamera) };
    let options = picture_options(dice);
    let view = View::new(&compiled, camera, options.width, options.height);
    let _ = view.needs_new_anchor(&compiled);
    let mut rendering = Rendering::new(compiled, camera, options).map_err(|error| error.to_string())?;
    rendering.run();
    let invalid = rendering.statistics().invalid_samples;
    match is_finite(rendering.film()) {
        true if invalid == 0 || dice.is_wild => Ok(Outcome::Picture { invalid }),
        true => Err(format!("{invalid} invalid samples")),
        false => Err("pixels that are not finite".to_string()),
    }
}

fn is_finite(film: &Film) -> bool {
    film.rgba().as_flattened().iter().all(|x| x.is_finite())
}

/// Mutates a scene one to four times, and checks the result.
fn trial((name, base): &(String, Scene), seed: u64) -> Trial {
    let mut dice = Dice::new(seed);
    let mut scene = base.clone();
    for _ in 0..=dice.below(4) {
        // Materials have more fields than everything else together.
        match dice.once_in(2) {
            true => dice.at("scene", |dice| scene.mutate(dice)),
            false => dice.at("scene.materials", |dice| scene.materials.mutate(dice)),
        }
    }
    let begin = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| outcome(&scene, base, &mut dice)));
    let result = result.unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        Err(format!("panics: {}", text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("?")))
    });
    let mutation = format!("{name}, seed {seed}: {}", dice.trail.join("; "));
    Trial { mutation, result, took: begin.elapsed() }
}

/// Runs trials over all scenes in turn. Each runs on one thread: a thread waiting in a shared pool would start another trial,
/// whose time would be counted with its own.
fn trials(bases: &[(String, Scene)], count: u64) -> Vec<Trial> {
    // To repeat one trial: `OSCURA_SEED=68234 cargo test ... many_mutated -- --ignored --nocapture`.
    let only = std::env::var("OSCURA_SEED").ok().and_then(|seed| seed.parse::<u64>().ok());
    let (next, count) = (AtomicU64::new(only.unwrap_or(0)), only.map_or(count, |seed| seed + 1));
    let work = || {
        let alone = ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
        let mut own = Vec::new();
        loop {
            // A seed for each, so that mutations differ between scenes.
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= count {
                return own;
            }
            own.push(alone.install(|| trial(&bases[seed as usize % bases.len()], seed)));
        }
    };
    std::thread::scope(|scope| {
        let workers = std::thread::available_parallelism().map_or(1, usize::from);
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("trials catch panics")).collect()
    })
}

/// Mutates each scene so many times. Prints the results, and fails if one was neither refused nor rendered.
fn run(bases: &[(String, Scene)], times: u64) {
    let begin = Instant::now();
    let trials = trials(bases, times * bases.len() as u64);
    let failed: Vec<String> = trials
        .iter()
        .filter_map(|t| t.result.as_ref().err().map(|why| format!("{}\n    {why}", t.mutation)))
        .collect();
    let number = |is: fn(&Outcome) -> bool| trials.iter().flat_map(|t| &t.result).filter(|o| is(o)).count();
    let refused = number(|o| *o == Outcome::Refused);
    let pictures = number(|o| matches!(o, Outcome::Picture { .. }));
    let invalid = number(|o| matches!(o, Outcome::Picture { invalid: 1.. }));
    let slowest = trials.iter().max_by_key(|t| t.took).expect("some were made");
    println!(
        "{} scenes in {:.1} s: {refused} refused, {pictures} rendered, {invalid} of them with samples left out; the \
         slowest took {:.2} s ({:.300})",
        trials.len(),
        begin.elapsed().as_secs_f64(),
        slowest.took.as_secs_f64(),
        slowest.mutation,
    );
    let shown = failed.iter().take(20).map(|text| format!("{text:.1500}")).collect::<Vec<_>>().join("\n");
    assert!(
        failed.is_empty(),
        "{} of {} scenes are neither refused nor rendered:\n{shown}",
        failed.len(),
        trials.len()
    );
    // A single trial proves nothing.
    assert!(
        trials.len() == 1 || refused * 5 > trials.len() && pictures * 5 > trials.len(),
        "mutations are too wild or too tame"
    );
}

/// Small shipped scenes.
fn shipped() -> Vec<(String, Scene)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let names = [
        "assets/cornell-box.gltf",
        "scenes/cornell-quads.toml",
        "scenes/materials.toml",
        "scenes/plastics.toml",
        "scenes/sky.toml",
        "scenes/thesis/checker-pyramid.toml",
        "scenes/thesis/defocus-in.toml",
        "scenes/thesis/fuzzy-metal-lights.toml",
        "scenes/thesis/glass.toml",
        "scenes/thesis/perlin.toml",
        "scenes/thesis/world-map.toml",
    ];
    let load = |name: &str| {
        let mut scene =
            oscura::load::load(root.join(name), &Default::default()).expect("the scene loads").scene;
        // Sizes and pixels of images are mutated, too.
        for image in &mut scene.images {
            *image = image.decoded(&mut Vec::new()).expect("it is sound");
        }
        (name.to_string(), scene)
    };
    names.into_iter().map(load).collect()
}

#[test]
fn seed_scenes_are_valid() {
    for (name, scene) in bases::all().into_iter().chain(bases::splats()) {
        assert_eq!(scene.validate(), [], "{name}");
        let found = outcome(&scene, &scene, &mut Dice::new(1));
        assert_eq!(found, Ok(Outcome::Picture { invalid: 0 }), "{name}");
    }
}

#[test]
fn mutated_scenes_are_refused_or_rendered() {
    run(&bases::all(), 1000);
}

#[test]
fn mutated_splats_are_refused_or_rendered() {
    run(&bases::splats(), 1000);
}

#[test]
fn mutated_scenes_from_files_are_refused_or_rendered() {
    run(&shipped(), 40);
}

#[test]
#[ignore = "a hundred times as many: takes minutes"]
fn many_mutated_scenes_are_refused_or_rendered() {
    run(&bases::all(), 100_000);
    run(&shipped(), 4_000);
}
