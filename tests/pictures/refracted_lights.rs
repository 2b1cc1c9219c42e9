//! Small lights behind glass and water that next-event estimation can't pass: closed forms, and the same expected value with all
//! techniques.

use crate::support::{
    assert_radiance, block, camera, gltf_glass, material, measure, options, pbr, place, quad,
};
use oscura::math::DVec3;
use oscura::render::{Caustics, Guiding, RenderOptions, Splitting};
use oscura::scene::{
    AlphaMode, Clearcoat, ColorSlot, FloatSlot, Light, LightKind, Material, MaterialId, Mesh, Model,
    PbrMaterial, Scene,
};
use std::f64::consts::PI;

const IOR: f64 = 1.5;

/// Glass: solids, or open surfaces, which keep radiance. An alpha that is 0 once in ten million rays disables sampling of
/// refracted lights.
fn glass(roughness: f32, is_solid: bool, is_looked_through: bool) -> Material {
    let pbr = PbrMaterial { has_volume: is_solid, keeps_radiance: !is_solid, ..gltf_glass(roughness) };
    let mut glass = Material::new("glass", Model::Pbr(Box::new(pbr)));
    if !is_looked_through {
        (glass.alpha_mode, glass.alpha) = (AlphaMode::Blend, FloatSlot::constant(1.0f32.next_down()));
    }
    glass
}

/// Transmittance of a face.
fn transmittance(cosine: f64) -> f64 {
    let within = (1.0 - (1.0 - cosine * cosine) / (IOR * IOR)).sqrt();
    let parallel = (IOR * cosine - within) / (IOR * cosine + within);
    let perpendicular = (cosine - IOR * within) / (cosine + IOR * within);
    1.0 - 0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// A floor seen from just above it.
fn floor(scene: &mut Scene, of: Material) {
    let ground = material(scene, of);
    quad(scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], ground);
    scene.cameras.push(camera(DVec3::new(0.1, 0.3, 0.2), DVec3::ZERO, DVec3::X, 1e-3));
}

fn sun(scene: &mut Scene, irradiance: f32, degrees: f64) {
    let kind = LightKind::Sun { direction: DVec3::new(0.6, -0.8, 0.0), angle_rad: degrees.to_radians() };
    scene.lights.push(Light::new(kind, [irradiance; 3]));
}

/// The floor of a pool receives the sun's light transmitted by the flat surface.
#[test]
fn sun_into_flat_water() {
    let mut scene = Scene::default();
    floor(&mut scene, Material::lambert("grey", [0.8; 3]));
    let glass = material(&mut scene, glass(0.0, true, true));
    block(&mut scene, [-40.0, -1.0, -40.0], [40.0, 1.0, 40.0], glass);
    sun(&mut scene, 5.0, 0.5);
    let truth = 0.8 / PI * 5.0 * 0.8 * transmittance(0.8);
    let options: RenderOptions = options(8, 256, 2).caustics(Caustics::Off);
    assert_radiance("level water", &scene, &options, truth, 1e-2);
}

/// An open surface that keeps radiance spreads irradiance by the squared index.
#[test]
fn sun_through_an_open_surface() {
    let mut scene = Scene::default();
    floor(&mut scene, Material::lambert("grey", [0.8; 3]));
    let glass = material(&mut scene, glass(0.0, false, true));
    // Its front faces the sun.
    quad(&mut scene, [-40.0, 1.0, 40.0], [80.0, 0.0, 0.0], [0.0, 0.0, -80.0], glass);
    sun(&mut scene, 5.0, 0.5);
    let truth = 0.8 / PI * 5.0 * 0.8 * transmittance(0.8) / (IOR * IOR);
    let options: RenderOptions = options(8, 256, 2).caustics(Caustics::Off);
    assert_radiance("open sheet", &scene, &options, truth, 1e-2);
}

/// A closed solid over or around the floor with a wavy top.
fn wavy(scene: &mut Scene, low: f64, high: f64, of: MaterialId) {
    const N: usize = 24;
    let at = |k: usize| 6.0 * (2.0 * k as f64 / N as f64 - 1.0);
    let height = |x: f64, z: f64| high + 0.03 * (2.0 * x + 1.0).sin() * (3.0 * z).cos();
    let mut positions: Vec<[f32; 3]> = Vec::new();
    for is_top in [false, true] {
        for (i, k) in (0..=N).flat_map(|i| (0..=N).map(move |k| (i, k))) {
            let y = if is_top { height(at(i), at(k)) } else { low };
            positions.push([at(i) as f32, y as f32, at(k) as f32]);
        }
    }
    let index = |top: usize, i: usize, k: usize| (top * (N + 1) * (N + 1) + i * (N + 1) + k) as u32;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    let mut face = |a: u32, b: u32, c: u32, d: u32| triangles.extend([[a, b, c], [a, c, d]]);
    for (i, k) in (0..N).flat_map(|i| (0..N).map(move |k| (i, k))) {
        face(index(1, i, k), index(1, i, k + 1), index(1, i + 1, k + 1), index(1, i + 1, k));
        face(index(0, i, k), index(0, i + 1, k), index(0, i + 1, k + 1), index(0, i, k + 1));
    }
    for k in 0..N {
        face(index(0, k, 0), index(1, k, 0), index(1, k + 1, 0), index(0, k + 1, 0));
        face(index(0, k + 1, N), index(1, k + 1, N), index(1, k, N), index(0, k, N));
        face(index(0, 0, k + 1), index(1, 0, k + 1), index(1, 0, k), index(0, 0, k));
        face(index(0, N, k), index(1, N, k), index(1, N, k + 1), index(0, N, k + 1));
    }
    place(scene, Mesh::new("waves", positions, triangles, of));
}

/// What is between the floor and the light.
const BODIES: [&str; 5] = ["frosted pane", "frosted sheet", "level water", "waves", "frosted block around"];

pub fn scene_behind(what: &str, of: Material, has_lamp: bool, is_looked_through: bool) -> Scene {
    let mut scene = Scene::default();
    floor(&mut scene, of);
    let roughness = if what.starts_with("frosted") { 0.4 } else { 0.0 };
    let glass = material(&mut scene, glass(roughness, what != "frosted sheet", is_looked_through));
    match what {
        "frosted pane" => block(&mut scene, [-1.0, 0.5, -1.0], [2.0, 0.52, 1.0], glass),
        "frosted sheet" => {
            quad(&mut scene, [-1.0, 0.5, 1.0], [3.0, 0.0, 0.0], [0.0, 0.0, -2.0], glass);
        }
        "waves" => wavy(&mut scene, -0.5, 0.6, glass),
        _ => block(&mut scene, [-6.0, -0.5, -6.0], [6.0, 0.6, 6.0], glass),
    }
    if has_lamp {
        let lamp = material(&mut scene, Material::emitter("lamp", [20.0; 3], true));
        quad(&mut scene, [-0.6, 1.3, -0.2], [0.3, 0.0, 0.0], [0.0, 0.1, 0.3], lamp);
    } else {
        sun(&mut scene, 5.0, 25.0);
    }
    scene
}

fn floors() -> Vec<(&'static str, Material)> {
    let coat =
        Clearcoat { factor: FloatSlot::constant(1.0), roughness: FloatSlot::constant(0.2), normal_map: None };
    let coated = PbrMaterial {
        base_color: ColorSlot::constant([0.6; 3]),
        metallic: FloatSlot::constant(0.0),
        clearcoat: Some(coat),
        ..PbrMaterial::default()
    };
    vec![
        ("diffuse", Material::lambert("grey", [0.8; 3])),
        ("glossy", pbr("gloss", [0.6; 3], 0.0, 0.35)),
        ("coated", Material::new("coated", Model::Pbr(Box::new(coated)))),
    ]
}

/// Lobes that sample refracted lights keep the mean.
fn assert_counts_once(
    cases: impl Iterator<Item = (&'static str, &'static str, Material, bool)>,
    samples: u32,
    precision: f64,
    change: impl Fn(RenderOptions) -> RenderOptions,
) {
    for (what, on, floor, has_lamp) in cases {
        let options = change(options(8, samples, 5).caustics(Caustics::Off));
        let by = |is_looked_through| {
            measure(&scene_behind(what, floor.clone(), has_lamp, is_looked_through), &options)
        };
        let ((lobes, error), (plain, error_plain)) = (by(true), by(false));
        let combined = error.hypot(error_plain);
        println!(
            "{what}, {on}, lamp {has_lamp}: {lobes:.5} +- {error:.5}, without {plain:.5} +- {error_plain:.5}"
        );
        assert!(lobes != plain, "{what}, {on}: no lobes");
        assert!(combined < precision * plain, "{what}, {on}: too uncertain to tell");
        assert!((lobes - plain).abs() < 4.5 * combined, "{what}, {on}: {lobes} is not {plain} +- {combined}");
    }
}

/// One floor of each kind, over all solids.
fn some_cases() -> impl Iterator<Item = (&'static str, &'static str, Material, bool)> {
    let each = BODIES.into_iter().enumerate();
    each.map(|(k, what)| {
        let (on, floor) = floors().swap_remove(k % 3);
        (what, on, floor, k % 2 == 1)
    })
}

#[test]
fn light_behind_refracting_solids_is_counted_once() {
    assert_counts_once(some_cases(), 512, 1.5e-2, |options| options);
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn light_behind_refracting_solids_is_counted_once_in_all_cases() {
    let cases = || {
        BODIES.into_iter().flat_map(|what| {
            floors().into_iter().flat_map(move |(on, floor)| {
                [false, true].map(|has_lamp| (what, on, floor.clone(), has_lamp))
            })
        })
    };
    assert_counts_once(cases(), 4096, 7e-3, |options| options);
    assert_counts_once(cases(), 4096, 7e-3, |options| options.guiding(Guiding::On));
    assert_counts_once(cases(), 1024, 9e-3, |options| options.splitting(Splitting::Into(4)));
}
