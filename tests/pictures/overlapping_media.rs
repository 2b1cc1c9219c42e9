//! Overlapping media with null interfaces: their coefficients add up, against closed forms, quadrature, and single media of the
//! sums.

use crate::support::differences::assert_same_bits;
use crate::support::{block, camera, material, options, picture, quad, sphere};
use oscura::compile::{CompileOptions, compile};
use oscura::math::DVec3;
use oscura::render::{PassOutcome, RenderOptions, Rendering};
use oscura::scene::{
    EmissionGrid, Environment, Fog, Grid, GridId, Light, LightKind, Material, MaterialId, Medium, Model,
    Projection, Scene, ShadingModel,
};
use std::f64::consts::PI;
use std::sync::Arc;

/// How a medium is described: a grid that is two near the origin, homogeneous, or unbounded fog.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Grid,
    Even,
    Fog,
}

/// A sphere of a medium.
#[derive(Clone, Copy, Debug)]
struct Ball {
    kind: Kind,
    center: [f64; 3],
    radius: f64,
    medium: Medium,
}

const KINDS: [[Kind; 2]; 5] = [
    [Kind::Grid, Kind::Grid],
    [Kind::Grid, Kind::Even],
    [Kind::Even, Kind::Grid],
    [Kind::Grid, Kind::Fog],
    [Kind::Even, Kind::Fog],
];

const GREY: [[f32; 3]; 2] = [[0.4; 3], [0.3; 3]];
const COLORED: [[f32; 3]; 2] = [[0.4, 0.1, 0.2], [0.3, 0.9, 0.06]];

/// A few pairs of media with their extinction.
fn some_kinds() -> impl Iterator<Item = ([Kind; 2], [[f32; 3]; 2])> {
    all_kinds().step_by(5)
}

fn all_kinds() -> impl Iterator<Item = ([Kind; 2], [[f32; 3]; 2])> {
    KINDS.into_iter().flat_map(|kinds| [(kinds, GREY), (kinds, COLORED)])
}

/// Offset of the ray from the centre.
const BESIDE: [f64; 2] = [0.1, 0.2];

fn medium(extinction: [f32; 3], albedo: f32, anisotropy: f32) -> Medium {
    Medium { albedo: [albedo; 3], anisotropy, ..Medium::scattering(extinction) }
}

fn constant(scene: &mut Scene, value: f32, size: [u32; 3]) -> GridId {
    let count = size.iter().product::<u32>() as usize;
    let (low, high) = (DVec3::splat(-4.0), DVec3::splat(4.0));
    scene.add_grid(Grid::in_box("smoke".into(), size, Arc::new(vec![value; count]), low, high))
}

fn body(scene: &mut Scene, ball: &Ball, medium: Medium, priority: i32) {
    let filled = Material { medium: Some(medium), priority, ..Material::new("body", Model::Boundary {}) };
    let filled = material(scene, filled);
    sphere(scene, ball.center, ball.radius, filled);
}

fn add(scene: &mut Scene, ball: &Ball) {
    match ball.kind {
        Kind::Fog => {
            let center = DVec3::from(ball.center);
            scene.fog = Some(Fog { medium: ball.medium, center, radius: ball.radius });
        }
        Kind::Even => body(scene, ball, ball.medium, 0),
        Kind::Grid => {
            let half = |x: f32| 0.5 * x;
            let own = ball.medium;
            let grid = Some(constant(scene, 2.0, [3, 2, 17]));
            let (extinction, emission) = (own.extinction.map(half), own.emission.map(half));
            body(scene, ball, Medium { grid, extinction, emission, ..own }, 0);
        }
    }
}

/// Spheres around the origin that are seen along one ray.
fn beam(balls: &[Ball], environment: f32, height: f64) -> Scene {
    let mut scene = Scene { environment: Environment::Constant([environment; 3]), ..Scene::default() };
    balls.iter().for_each(|ball| add(&mut scene, ball));
    let from = DVec3::new(BESIDE[0], BESIDE[1], height);
    let mut view = camera(from, from - DVec3::Z, DVec3::Y, 1.0);
    view.projection = Projection::Orthographic { half_height: 1e-3 };
    scene.cameras.push(view);
    scene
}

/// Means of the channels over independent seeds with the standard errors.
fn channels(scene: &Scene, options: &RenderOptions, spectral: bool) -> [(f64, f64); 3] {
    const SEEDS: u32 = 12;
    let shading = ShadingModel { spectral, ..ShadingModel::default() };
    let compile_options = CompileOptions { shading, ..CompileOptions::default() };
    let (compiled, _) = compile(scene, &compile_options).expect("the scene compiles");
    let compiled = Arc::new(compiled);
    let found: Vec<[f64; 3]> = (0..SEEDS)
        .map(|seed| {
            let options = options.seed(seed * 7919 + 1);
            let mut rendering =
                Rendering::new(compiled.clone(), &scene.cameras[0], options).expect("the film fits");
            assert_eq!(rendering.run(), PassOutcome::Done);
            assert_eq!(rendering.statistics().invalid_samples, 0, "NaN or infinite samples");
            let pixels = rendering.film().rgba();
            [0, 1, 2].map(|c| pixels.iter().map(|p| f64::from(p[c])).sum::<f64>() / pixels.len() as f64)
        })
        .collect();
    let n = f64::from(SEEDS);
    [0, 1, 2].map(|c| {
        let mean = found.iter().map(|f| f[c]).sum::<f64>() / n;
        let variance = found.iter().map(|f| (f[c] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, (variance / n).sqrt())
    })
}

/// Within 4.7 standard errors (Student's t with 11 degrees of freedom: a chance of 7e-4 for each channel, of which a test has
/// some dozens; seeds are fixed), which are less than `precision`.
fn assert_channels(what: &str, found: [(f64, f64); 3], truth: [(f64, f64); 3], precision: f64) {
    println!("{what}: {found:.6?}, truth {truth:.6?}");
    for ((mean, error), (truth, own)) in found.into_iter().zip(truth) {
        let error = error.hypot(own);
        assert!(
            error <= precision * truth.abs().max(1e-3),
            "{what}: {error} is too large an error of {truth}"
        );
        assert!((mean - truth).abs() <= 4.7 * error + 2e-5 * truth, "{what}: {mean} +- {error}, not {truth}");
    }
}

fn exact(truth: [f64; 3]) -> [(f64, f64); 3] {
    truth.map(|x| (x, 0.0))
}

/// Intersection of a line along z with a sphere.
fn extent(ball: &Ball, x: f64, y: f64) -> Option<[f64; 2]> {
    let [cx, cy, cz] = ball.center;
    let square = ball.radius.powi(2) - (x - cx).powi(2) - (y - cy).powi(2);
    (square > 0.0).then(|| [cz - square.sqrt(), cz + square.sqrt()])
}

/// Optical depth between two heights along the camera's ray, by channel.
fn depth(balls: &[Ball], from: f64, to: f64) -> [f64; 3] {
    let of = |ball: &Ball, c: usize| {
        let way = extent(ball, BESIDE[0], BESIDE[1]).map_or(0.0, |[low, high]| high.min(from) - low.max(to));
        f64::from(ball.medium.extinction[c]) * way.max(0.0)
    };
    [0, 1, 2].map(|c| balls.iter().map(|ball| of(ball, c)).sum())
}

/// Pairs of spheres that are nested, overlap, and contain the camera.
fn places(media: [Medium; 2], kinds: [Kind; 2]) -> Vec<(&'static str, [Ball; 2], f64)> {
    let ball = |k: usize, z: f64, radius: f64| Ball {
        kind: kinds[k],
        center: [0.05, -0.1, z],
        radius,
        medium: media[k],
    };
    vec![
        ("within", [ball(0, 0.0, 1.0), ball(1, 0.0, 1.5)], 3.0),
        ("meet", [ball(0, 0.6, 1.0), ball(1, -0.4, 1.2)], 3.0),
        ("meet the other way", [ball(0, -0.6, 1.0), ball(1, 0.4, 1.2)], 3.0),
        ("around the camera", [ball(0, 0.0, 1.0), ball(1, 0.2, 1.5)], 0.3),
    ]
}

/// Transmittance: of absorbing media, and of scattering ones limited to zero events.
#[test]
fn extinction_of_overlapping_media_adds_up() {
    check_extinction(some_kinds());
}

#[test]
#[ignore = "all cases, which take long"]
fn extinction_of_all_kinds_of_media_adds_up() {
    check_extinction(all_kinds());
}

fn check_extinction(cases: impl Iterator<Item = ([Kind; 2], [[f32; 3]; 2])>) {
    for (kinds, extinction) in cases {
        for albedo in [[0.0, 0.0], [0.3, 0.9]] {
            let media = [0, 1].map(|k| medium(extinction[k], albedo[k], 0.2));
            for (what, balls, height) in places(media, kinds) {
                let scene = beam(&balls, 1.0, height);
                let truth = depth(&balls, height, -9.0).map(|depth| (-depth).exp());
                let what = format!("{what} {kinds:?} {albedo:?} {extinction:?}");
                let found = channels(&scene, &options(16, 64, 0), false);
                assert_channels(&what, found, exact(truth), 2e-2);
            }
        }
    }
}

fn henyey_greenstein(g: f64, cosine: f64) -> f64 {
    (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5))
}

/// Single scattering of a sun from above, where each medium has its own phase function.
#[test]
fn overlapping_media_scatter_by_their_phase_functions() {
    check_scattering(some_kinds());
}

#[test]
#[ignore = "all cases, which take long"]
fn all_kinds_of_media_scatter_by_their_phase_functions() {
    check_scattering(all_kinds());
}

fn check_scattering(cases: impl Iterator<Item = ([Kind; 2], [[f32; 3]; 2])>) {
    let (albedo, g) = ([0.8, 0.3], [0.5, -0.2]);
    for (kinds, extinction) in cases {
        let media = [0, 1].map(|k| medium(extinction[k], albedo[k], g[k]));
        for (what, balls, height) in places(media, kinds) {
            let mut scene = beam(&balls, 0.0, height);
            scene.lights.push(Light::new(LightKind::Directional { direction: DVec3::NEG_Y }, [3.0; 3]));
            let steps = 4000;
            let mut truth = [0.0; 3];
            for i in 0..steps {
                let step = (height + 2.5) / f64::from(steps);
                let z = height - (f64::from(i) + 0.5) * step;
                let way = depth(&balls, height, z);
                for ball in &balls {
                    let [cx, cy, cz] = ball.center;
                    let square = ball.radius.powi(2) - (BESIDE[0] - cx).powi(2) - (z - cz).powi(2);
                    let half = square.max(0.0).sqrt();
                    if (BESIDE[1] - cy).abs() > half {
                        continue;
                    }
                    let k = usize::from(ball.medium.anisotropy < 0.0);
                    let phase = henyey_greenstein(f64::from(ball.medium.anisotropy), 0.0);
                    for c in 0..3 {
                        let up: f64 =
                            balls.iter().map(|b| above(b, z) * f64::from(b.medium.extinction[c])).sum();
                        let scattered = f64::from(albedo[k] * ball.medium.extinction[c]);
                        truth[c] += scattered * phase * 3.0 * step * (-way[c] - up).exp();
                    }
                }
            }
            let what = format!("{what} {kinds:?} {extinction:?}");
            let found = channels(&scene, &options(16, 128, 1), false);
            assert_channels(&what, found, exact(truth), 2e-2);
        }
    }
}

/// Distance upwards out of a sphere, or through it, from a point of the ray.
fn above(ball: &Ball, z: f64) -> f64 {
    let [cx, cy, cz] = ball.center;
    let square = ball.radius.powi(2) - (BESIDE[0] - cx).powi(2) - (z - cz).powi(2);
    let half = square.max(0.0).sqrt();
    (cy + half - BESIDE[1].max(cy - half)).max(0.0)
}

/// Emission through each other: e / s of the light lost in each segment.
#[test]
fn overlapping_emissive_media() {
    check_emission(some_kinds());
}

#[test]
#[ignore = "all cases, which take long"]
fn overlapping_emissive_media_of_all_kinds() {
    check_emission(all_kinds());
}

fn check_emission(cases: impl Iterator<Item = ([Kind; 2], [[f32; 3]; 2])>) {
    for (kinds, extinction) in cases {
        for albedo in [[0.0, 0.7], [0.6, 0.7]] {
            let emission = [[0.5, 0.2, 0.1], [0.0, 0.3, 0.6]];
            let is_grey = kinds.map(|kind| kind == Kind::Grid);
            let media = [0, 1].map(|k| {
                // Emission grids have a grey extinction.
                let extinction = if is_grey[k] { [extinction[k][0]; 3] } else { extinction[k] };
                Medium { emission: emission[k], ..medium(extinction, albedo[k], 0.1) }
            });
            for (what, balls, height) in places(media, kinds) {
                let scene = beam(&balls, 0.0, height);
                let mut truth = [0.0; 3];
                let steps = 2000;
                for ball in &balls {
                    let Some([low, high]) = extent(ball, BESIDE[0], BESIDE[1]) else { continue };
                    let high = high.min(height);
                    let step = (high - low) / f64::from(steps);
                    for i in 0..steps {
                        let way = depth(&balls, height, low + (f64::from(i) + 0.5) * step);
                        for c in 0..3 {
                            truth[c] += f64::from(ball.medium.emission[c]) * step * (-way[c]).exp();
                        }
                    }
                }
                let what = format!("{what} {kinds:?} {albedo:?} {extinction:?}");
                let found = channels(&scene, &options(16, 64, 0), false);
                assert_channels(&what, found, exact(truth), 2e-2);
            }
        }
    }
}

/// White furnace: media without absorption are invisible.
#[test]
fn overlapping_media_in_a_white_furnace() {
    white_furnace((0..).zip(KINDS).step_by(2).map(|(i, kinds)| (kinds, i % 4 == 2)));
}

#[test]
#[ignore = "all cases, which take long"]
fn overlapping_media_in_a_white_furnace_in_all_kinds() {
    white_furnace(KINDS.into_iter().flat_map(|kinds| [(kinds, false), (kinds, true)]));
}

fn white_furnace(cases: impl Iterator<Item = ([Kind; 2], bool)>) {
    for (kinds, spectral) in cases {
        let media = [medium([0.6, 0.3, 0.45], 1.0, 0.6), medium([0.25, 0.5, 0.15], 1.0, -0.3)];
        for (what, balls, height) in places(media, kinds) {
            let scene = beam(&balls, 1.0, height);
            let what = format!("{what} {kinds:?} {spectral}");
            let found = channels(&scene, &options(16, 64, 3000), spectral);
            assert_channels(&what, found, exact([1.0; 3]), 1e-2);
        }
    }
}

/// Two lumps of smoke, seen whole, with an area light, a floor and a sky: emission and scattering.
fn lumps(shares: &[f32], with_fog: bool) -> Scene {
    let sky = Environment::Gradient { nadir: [0.1, 0.05, 0.0], zenith: [0.3, 0.4, 0.8] };
    let mut scene = Scene { environment: sky, ..Scene::default() };
    let size = [9, 7, 8];
    let value = |i: usize| ((i * 7 % 5) as f32 + (i % 3) as f32) * 0.6;
    let values: Vec<f32> = (0..size.iter().product::<u32>() as usize).map(value).collect();
    for &share in shares {
        let of_reflectance = Arc::new(values.iter().map(|v| v * share).collect());
        let (low, high) = (DVec3::splat(-1.0), DVec3::splat(1.0));
        let grid = scene.add_grid(Grid::in_box("smoke".into(), size, of_reflectance, low, high));
        let own = Medium { grid: Some(grid), emission: [0.3, 0.2, 0.1], ..medium([0.7; 3], 0.85, 0.3) };
        let ball = Ball { kind: Kind::Grid, center: [0.0; 3], radius: 1.8, medium: own };
        body(&mut scene, &ball, own, 0);
    }
    if with_fog {
        let thin = medium([0.05, 0.08, 0.2], 0.9, 0.4);
        scene.fog = Some(Fog { medium: thin, center: DVec3::ZERO, radius: 5.0 });
    }
    let clay = material(&mut scene, Material::lambert("clay", [0.6, 0.5, 0.3]));
    quad(&mut scene, [-4.0, -1.2, 4.0], [8.0, 0.0, 0.0], [0.0, 0.0, -8.0], clay);
    let lamp = material(&mut scene, Material::emitter("lamp", [15.0; 3], false));
    sphere(&mut scene, [0.8, 1.3, 0.2], 0.3, lamp);
    let point = LightKind::Point { position: DVec3::new(-1.5, 1.0, 1.5) };
    scene.lights.push(Light::new(point, [2.0; 3]));
    scene.cameras.push(camera(DVec3::new(0.0, 0.6, 4.0), DVec3::ZERO, DVec3::Y, 40.0));
    scene
}

/// Smoke split into two or three overlapping parts equals the whole, with all techniques.
#[test]
fn split_smoke_equals_the_whole() {
    for (spectral, with_fog) in [(false, false), (false, true), (true, false)] {
        let of = |shares: &[f32]| channels(&lumps(shares, with_fog), &options(16, 32, 20), spectral);
        let whole = of(&[1.0]);
        assert_channels("halves", of(&[0.5, 0.5]), whole, 1.5e-2);
        assert_channels("thirds", of(&[0.5, 0.3, 0.2]), whole, 1.5e-2);
    }
}

/// A cloud in fog equals a cloud that displaces the fog with the coefficients of both.
#[test]
fn fog_adds_to_clouds_inside_it() {
    let fog = medium([0.3, 0.5, 0.8], 0.9, 0.3);
    let with = |extinction: [f32; 3], priority: i32| {
        let mut scene = lumps(&[], false);
        scene.fog = Some(Fog { medium: fog, center: DVec3::ZERO, radius: 5.0 });
        let own = medium(extinction, 0.9, 0.3);
        let ball = Ball { kind: Kind::Even, center: [0.0; 3], radius: 0.9, medium: own };
        body(&mut scene, &ball, own, priority);
        channels(&scene, &options(16, 256, 20), false)
    };
    let alone = [0.4, 0.3, 0.2];
    let together = [0, 1, 2].map(|c| alone[c] + fog.extinction[c]);
    assert_channels("fog in a cloud", with(alone, 0), with(together, 1), 1.5e-2);
}

/// Media of a higher priority displace others, an empty one makes a hole, and solids of one material merge.
#[test]
fn priorities_displace_media() {
    let dense = |sigma: f32| medium([sigma; 3], 0.0, 0.0);
    let ball = |radius: f64, sigma: f32| Ball {
        kind: Kind::Even,
        center: [BESIDE[0], BESIDE[1], 0.0],
        radius,
        medium: dense(sigma),
    };
    let seen = |scene: &Scene| channels(scene, &options(8, 4, 0), false);
    for (what, priorities, inner, truth) in [
        ("add up", [0, 0], 0.5, 0.7 * 2.0 + 0.5 * 1.0),
        ("of one priority", [3, 3], 0.5, 0.7 * 2.0 + 0.5 * 1.0),
        ("the inner displaces", [0, 1], 0.5, 0.7 * 1.0 + 0.5 * 1.0),
        ("the outer displaces", [1, 0], 0.5, 0.7 * 2.0),
        ("a hole", [0, 0], 0.0, 0.7 * 1.0),
    ] {
        let mut scene = beam(&[], 1.0, 3.0);
        for (ball, priority) in [ball(1.0, 0.7), ball(0.5, inner)].iter().zip(priorities) {
            body(&mut scene, ball, ball.medium, priority);
        }
        assert_channels(what, seen(&scene), exact([f64::exp(-truth); 3]), 1e-3);
    }
    let mut scene = beam(&[], 1.0, 3.0);
    let own = Material { medium: Some(dense(0.7)), ..Material::new("one", Model::Boundary {}) };
    let own = material(&mut scene, own);
    sphere(&mut scene, [BESIDE[0], BESIDE[1], 0.5], 1.0, own);
    sphere(&mut scene, [BESIDE[0], BESIDE[1], -0.5], 1.0, own);
    assert_channels("one material", seen(&scene), exact([(-0.7f64 * 3.0).exp(); 3]), 1e-3);
}

/// Nested spheres, up to the number that paths can track.
#[test]
fn many_overlapping_media() {
    let count = 8;
    let mut scene = beam(&[], 1.0, 9.0);
    let mut truth = 0.0;
    for k in 0..count {
        let radius = 1.0 + 0.25 * f64::from(k);
        let sigma = 0.05 * (1.0 + k as f32);
        let own = medium([sigma; 3], 0.0, 0.0);
        let ball = Ball { kind: Kind::Even, center: [BESIDE[0], BESIDE[1], 0.0], radius, medium: own };
        add(&mut scene, &ball);
        truth += 2.0 * radius * f64::from(sigma);
    }
    let found = channels(&scene, &options(8, 4, 0), false);
    assert_channels("eight", found, exact([(-truth).exp(); 3]), 1e-3);
}

/// The warning about more media than paths can track.
#[test]
fn too_many_overlapping_media_are_reported() {
    let reported = |count: u32| {
        let mut scene = beam(&[], 1.0, 9.0);
        for k in 0..count {
            let center = [0.5 * f64::from(k), 0.0, 0.0];
            let ball = Ball { kind: Kind::Even, center, radius: 2.1, medium: medium([0.1; 3], 0.0, 0.0) };
            add(&mut scene, &ball);
        }
        warnings(&scene).iter().any(|w| w.contains("more than 8 media"))
    };
    assert!(!reported(8) && reported(9));
    // A row of many of which no nine overlap.
    let mut scene = beam(&[], 1.0, 9.0);
    for k in 0..40 {
        let center = [f64::from(k), 0.0, 0.0];
        add(&mut scene, &Ball { kind: Kind::Even, center, radius: 3.9, medium: medium([0.1; 3], 0.0, 0.0) });
    }
    assert!(warnings(&scene).is_empty());
}

fn warnings(scene: &Scene) -> Vec<String> {
    let (_, report) = compile(scene, &CompileOptions::default()).expect("the scene compiles");
    report.warnings.iter().map(ToString::to_string).collect()
}

/// Boxes with shared faces, on an emissive floor in the plane of their bottoms: each is entered and left once, and the floor is
/// hit.
#[test]
fn coincident_boxes_on_a_floor() {
    for count in [1, 3, 5] {
        for (is_first, is_inside) in [(true, false), (false, false), (true, true), (false, true)] {
            let mut scene = Scene::default();
            let emissive = material(&mut scene, Material::emitter("floor", [1.0; 3], true));
            let floor = |scene: &mut Scene| {
                quad(scene, [-20.0, -20.0, 0.0], [40.0, 0.0, 0.0], [0.0, 40.0, 0.0], emissive);
            };
            if is_first {
                floor(&mut scene);
            }
            for k in 0..count {
                let own = medium([0.1 * (1.0 + k as f32); 3], 0.5 * (k % 2) as f32, 0.0);
                let own = Material { medium: Some(own), ..Material::new("box", Model::Boundary {}) };
                let own = material(&mut scene, own);
                cube(&mut scene, own);
            }
            if !is_first {
                floor(&mut scene);
            }
            let from = DVec3::new(0.0, 0.0, if is_inside { 1.0 } else { 5.0 });
            let mut view = camera(from, DVec3::ZERO, DVec3::Y, 1.0);
            view.projection = Projection::Orthographic { half_height: 0.5 };
            scene.cameras.push(view);
            let way = if is_inside { 1.0 } else { 2.0 };
            let truth = (-0.1 * way * f64::from((1..=count).sum::<i32>())).exp();
            let found = channels(&scene, &options(16, 64, 0), false);
            let what = format!("{count} boxes, first {is_first}, inside {is_inside}");
            assert_channels(&what, found, exact([truth; 3]), 1e-2);
        }
    }
}

/// A box over the floor.
fn cube(scene: &mut Scene, material: MaterialId) {
    block(scene, [-1.0, -1.0, 0.0], [1.0, 1.0, 2.0], material);
}

/// Fire in coloured smoke in fog, at all thread counts and CPU levels.
#[test]
fn overlapping_media_are_deterministic() {
    let mut scene = lumps(&[0.5, 0.5], true);
    let flame = constant(&mut scene, 0.9, [3, 3, 3]);
    let emission_grid =
        Some(EmissionGrid::Temperatures { grid: flame, kelvin: 1900.0, scales_with_power: true });
    let fire = Medium { grid: Some(flame), emission_grid, emission: [0.4; 3], ..medium([0.5; 3], 0.5, 0.0) };
    let colored = medium([0.2, 0.5, 1.0], 0.8, 0.2);
    for (radius, own) in [(0.7, fire), (1.1, colored)] {
        let ball = Ball { kind: Kind::Even, center: [0.3, 0.1, 0.0], radius, medium: own };
        body(&mut scene, &ball, own, 0);
    }
    picture(&scene, &options(16, 4, 20));
    assert_same_bits("overlaps", &scene, &options(32, 4, 20));
}
