//! Stress tests of media: extreme densities, nested and overlapping media, RGB and spectral: pictures stay finite, and no energy
//! is added.

use crate::support::{camera, material, options, pbr, sphere};
use oscura::color::luminance;
use oscura::compile::{CompileOptions, compile};
use oscura::math::DVec3;
use oscura::render::{PassOutcome, Rendering};
use oscura::scene::{
    EmissionGrid, Environment, Fog, Grid, Material, MaterialId, Medium, Model, Projection, Scene,
    ShadingModel,
};
use std::sync::Arc;

fn body(scene: &mut Scene, medium: Medium, priority: i32) -> MaterialId {
    let own = Material { medium: Some(medium), priority, ..Material::new("body", Model::Boundary {}) };
    material(scene, own)
}

fn lit() -> Scene {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let mut view = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1.0);
    view.projection = Projection::Orthographic { half_height: 1.2 };
    scene.cameras.push(view);
    scene
}

/// The largest channel mean; the luminance for spectral rendering: where a spectrum is 1 or 0, red, green or blue may exceed 1.
/// All samples are finite.
fn brightest(what: &str, scene: &Scene, spectral: bool) -> f64 {
    let shading = ShadingModel { spectral, ..ShadingModel::default() };
    let compiled = compile(scene, &CompileOptions { shading, ..CompileOptions::default() });
    let (compiled, _) = compiled.unwrap_or_else(|e| panic!("{what}: {e}"));
    let mut rendering =
        Rendering::new(compiled, &scene.cameras[0], options(16, 16, 40)).expect("the film fits");
    assert_eq!(rendering.run(), PassOutcome::Done);
    assert_eq!(rendering.statistics().invalid_samples, 0, "{what}");
    let pixels = rendering.film().rgba();
    let mean = |c: usize| pixels.iter().map(|p| f64::from(p[c])).sum::<f64>() / pixels.len() as f64;
    assert!(pixels.as_flattened().iter().all(|x| x.is_finite()), "{what}");
    let rgb = [0, 1, 2].map(mean);
    if spectral { luminance(rgb.map(|v| v as f32)).into() } else { rgb.into_iter().fold(0.0, f64::max) }
}

#[test]
fn extreme_densities_add_no_energy() {
    let all: [[f32; 3]; 7] = [
        [1e-38; 3],
        [1e-9; 3],
        [1e9; 3],
        [0.0, 1e-20, 1e9],
        [1e9, 1.0, 0.0],
        [0.0; 3],
        [f32::MIN_POSITIVE, 1e4, 1e-4],
    ];
    for (extinction, anisotropy) in all.into_iter().zip([0.0, 0.999, -0.999].into_iter().cycle()) {
        for albedo in [[1.0; 3], [0.0, 0.5, 1.0]] {
            let medium = Medium { albedo, anisotropy, ..Medium::scattering(extinction) };
            let mut solid = lit();
            let own = body(&mut solid, medium, 0);
            sphere(&mut solid, [0.0; 3], 1.0, own);
            let mut foggy = lit();
            foggy.fog = Some(Fog { medium, center: DVec3::ZERO, radius: 1.0 });
            for (kind, scene) in [("solid", &solid), ("fog", &foggy)] {
                for spectral in [false, true] {
                    let what = format!("{kind} {extinction:?} {albedo:?} {anisotropy} {spectral}");
                    // Some percent of spectral noise.
                    let most = brightest(&what, scene, spectral);
                    assert!(most < 1.15, "{what}: {most}");
                }
            }
        }
    }
}

#[test]
fn nested_and_overlapping_media_add_no_energy() {
    for priorities in [[0; 4], [3, 1, 2, 0]] {
        let mut scene = lit();
        let thick = Medium { anisotropy: 0.5, ..Medium::scattering([5.0, 1.0, 0.2]) };
        let dark = Medium { albedo: [0.9, 0.1, 0.0], ..Medium::scattering([0.1, 3.0, 30.0]) };
        let [a, b, c] = [thick, dark, Medium::scattering([1e6; 3])];
        let ids = [
            body(&mut scene, a, priorities[0]),
            body(&mut scene, b, priorities[1]),
            body(&mut scene, c, priorities[2]),
        ];
        sphere(&mut scene, [-0.3, 0.0, 0.0], 0.7, ids[0]);
        sphere(&mut scene, [0.3, 0.0, 0.0], 0.7, ids[1]);
        sphere(&mut scene, [0.0, 0.2, 0.1], 0.3, ids[2]);
        // Twice at the same position, and one that touches it from inside.
        sphere(&mut scene, [0.0, -0.5, 0.0], 0.3, ids[0]);
        sphere(&mut scene, [0.0, -0.5, 0.0], 0.3, ids[1]);
        sphere(&mut scene, [0.0, -0.6, 0.0], 0.2, ids[2]);
        let wax = Material { medium: Some(thick), ..pbr("plain", [0.8; 3], 0.0, 0.4) };
        let wax = material(&mut scene, wax);
        sphere(&mut scene, [0.4, 0.5, 0.4], 0.3, wax);
        for spectral in [false, true] {
            let what = format!("{priorities:?} {spectral}");
            let most = brightest(&what, &scene, spectral);
            assert!(most < 1.1, "{what}: {most}");
        }
    }
}

#[test]
fn emissive_grids_of_one_voxel_or_zeros() {
    for (density, heat) in [(0.0f32, 0.0f32), (1.0, 0.0), (0.0, 1.0), (1e4, 1e-30), (1.0, 1e4)] {
        let mut scene = lit();
        let (min, max) = (DVec3::splat(-0.5), DVec3::splat(0.5));
        let grid = |value: f32| Grid::in_box(String::new(), [1; 3], Arc::new(vec![value]), min, max);
        let [smoke, fire] = [density, heat].map(|value| scene.add_grid(grid(value)));
        for kelvin in [None, Some(1.0), Some(1e6)] {
            let emission_grid = Some(kelvin.map_or(EmissionGrid::Factors(fire), |kelvin| {
                EmissionGrid::Temperatures { grid: fire, kelvin, scales_with_power: false }
            }));
            let medium = Medium {
                grid: Some(smoke),
                emission_grid,
                emission: [1.0, 0.5, 0.2],
                ..Medium::scattering([1.0; 3])
            };
            let mut burning = scene.clone();
            let own = body(&mut burning, medium, 0);
            sphere(&mut burning, [0.0; 3], 1.0, own);
            for spectral in [false, true] {
                let what = format!("{density} {heat} {kelvin:?} {spectral}");
                let most = brightest(&what, &burning, spectral);
                assert!(heat > 0.0 || most < 1.1, "{what}: {most}");
            }
        }
    }
}
