//! Spectral rendering of coloured media: against closed forms, and against monochromatic pictures.

use crate::spectral::{assert_means, means};
use crate::support::{camera, material, options, quad, sphere};
use oscura::color::Rgb;
use oscura::color::spectral::{Spectrum, rgb_of};
use oscura::math::DVec3;
use oscura::scene::{
    ColorSlot, DiffuseTransmission, Environment, FloatSlot, Fog, Grid, Material, Medium, Model, PbrMaterial,
    Projection, Scene,
};
use std::sync::Arc;

/// The value of an upsampled spectrum at a wavelength.
fn at(spectrum: &Spectrum, nm: f64) -> f64 {
    match spectrum {
        Spectrum::Grey(value) => f64::from(*value),
        Spectrum::Uplifted { scale, shape, .. } => f64::from(shape.at(nm as f32) * scale),
        Spectrum::Measured(curve) => f64::from(curve.at(nm as f32)),
    }
}

/// For coefficients, which are unbounded.
fn coefficient(rgb: [f32; 3]) -> impl Fn(f64) -> f64 {
    let spectrum = Spectrum::of_light(Rgb::from_array(rgb));
    move |nm| at(&spectrum, nm)
}

fn share(rgb: [f32; 3]) -> impl Fn(f64) -> f64 {
    let spectrum = Spectrum::of_reflectance(Rgb::from_array(rgb));
    move |nm| at(&spectrum, nm).min(1.0)
}

/// A sphere of radius 1 of a medium in a uniform environment, seen through its centre or whole.
fn ball(medium: Medium, environment: f32, half_height: f64) -> Scene {
    let mut scene = Scene { environment: Environment::Constant([environment; 3]), ..Scene::default() };
    let own = Material { medium: Some(medium), ..Material::new("own", Model::Boundary {}) };
    let own = material(&mut scene, own);
    sphere(&mut scene, [0.0; 3], 1.0, own);
    let mut view = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1.0);
    view.projection = Projection::Orthographic { half_height };
    scene.cameras.push(view);
    scene
}

const DENSE: [f32; 3] = [0.4, 1.5, 4.0];

/// White furnace: media without absorption are white, however scattering varies by wavelength.
#[test]
fn coloured_scattering_in_a_white_furnace() {
    let colored = Medium { anisotropy: 0.4, ..Medium::scattering(DENSE) };
    let scene = ball(colored, 1.0, 0.9);
    assert_means("ball", means(&scene, &options(16, 256, 200), true, 8), [1.0; 3], 4e-3);
    let mut foggy = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    foggy.fog = Some(Fog { medium: colored, center: DVec3::ZERO, radius: 1.5 });
    foggy.cameras.push(camera(DVec3::ZERO, -DVec3::Z, DVec3::Y, 60.0));
    assert_means("fog", means(&foggy, &options(16, 256, 200), true, 8), [1.0; 3], 4e-3);
}

/// Emission with self-absorption, by wavelength.
#[test]
fn emissive_media_integrate_over_wavelengths() {
    let emission = [0.5, 0.2, 0.05];
    for albedo in [0.0, 1e-6] {
        let emissive = Medium { albedo: [albedo; 3], emission, ..Medium::scattering(DENSE) };
        let scene = ball(emissive, 0.0, 1e-3);
        let (sigma, shines) = (coefficient(DENSE), coefficient(emission));
        let truth = rgb_of(|nm| shines(nm) * (1.0 - (-2.0 * sigma(nm)).exp()) / sigma(nm));
        let what = format!("albedo {albedo}");
        assert_means(&what, means(&scene, &options(16, 128, 20), true, 8), truth, 4e-3);
    }
    // A grid of two voxels, with densities from 1 to 3 between their centres.
    let mut scene = ball(Medium::scattering([1.0; 3]), 0.0, 1e-3);
    let (name, min, max) = (String::new(), DVec3::splat(-1.0), DVec3::splat(1.0));
    let values = Arc::new(vec![1.0, 3.0]);
    let grid = scene.add_grid(Grid::in_box(name, [1, 1, 2], values, min, max));
    let medium = Medium { albedo: [0.0; 3], emission, grid: Some(grid), ..Medium::scattering([0.7; 3]) };
    scene.materials[0].medium = Some(medium);
    let shines = coefficient(emission);
    // From the near end, z = 1: 3, then down to 1.
    let density = |t: f64| {
        if t < 0.5 {
            3.0
        } else if t < 1.5 {
            3.0 - 2.0 * (t - 0.5)
        } else {
            1.0
        }
    };
    let (mut thickness, mut sum) = (0.0, 0.0);
    for k in 0..4000 {
        let (t, step) = (f64::from(k) * 5e-4 + 2.5e-4, 5e-4);
        thickness += 0.7 * density(t) * step;
        sum += density(t) * (-thickness + 0.35 * density(t) * step).exp() * step;
    }
    let truth = rgb_of(|nm| shines(nm) * sum);
    assert_means("grid", means(&scene, &options(16, 128, 20), true, 8), truth, 4e-3);
}

/// The integral over many monochromatic grey pictures with the coefficients at each wavelength, with its standard error.
fn integrated(of: impl Fn(f64) -> (f64, f64)) -> ([f64; 3], f64) {
    let nodes: Vec<(f64, f64)> = (0..=20).map(|k| of(380.0 + 20.0 * f64::from(k))).collect();
    println!("{nodes:.4?}");
    let between = |nm: f64| {
        let at = ((nm - 380.0) / 20.0).clamp(0.0, 20.0 - 1e-9);
        let (k, share) = (at as usize, at.fract());
        nodes[k].0 * (1.0 - share) + nodes[k + 1].0 * share
    };
    (rgb_of(between), nodes.iter().map(|n| n.1).fold(0.0, f64::max))
}

/// Spectral rendering equals the integral of monochromatic pictures: grey media with the coefficients at each wavelength.
#[test]
fn spectral_media_match_integrated_monochromatic_pictures() {
    let albedo = [0.95, 0.7, 0.3];
    let scene = |extinction: [f32; 3], albedo: [f32; 3]| {
        let mut scene = ball(Medium { albedo, anisotropy: 0.3, ..Medium::scattering(extinction) }, 0.0, 0.9);
        let lamp = material(&mut scene, Material::emitter("lamp", [20.0; 3], true));
        quad(&mut scene, [-1.0, 2.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], lamp);
        scene
    };
    let (sigma, share) = (coefficient(DENSE), share(albedo));
    let (truth, error) = integrated(|nm| {
        let grey = scene([sigma(nm) as f32; 3], [share(nm) as f32; 3]);
        means(&grey, &options(16, 128, 60), false, 8)[0]
    });
    let found = means(&scene(DENSE, albedo), &options(16, 256, 60), true, 8);
    println!("{found:.5?}, truth {truth:.5?} +- {error:.5}");
    assert!(error < 2.5e-3, "{error}");
    for ((found, own), truth) in found.into_iter().zip(truth) {
        assert!((found - truth).abs() < 4.5 * own.hypot(error), "{found} {truth}");
    }
}

/// Grey media match RGB rendering, and a subsurface solid has about its specified albedo.
#[test]
fn subsurface_keeps_its_albedo() {
    let scene = |medium: Medium, color: [f32; 3]| {
        let mut scene = ball(medium, 1.0, 0.7);
        let pbr = PbrMaterial {
            metallic: FloatSlot::constant(0.0),
            specular: FloatSlot::constant(0.0),
            ior: 1.0,
            diffuse_transmission: Some(DiffuseTransmission {
                factor: FloatSlot::constant(1.0),
                color: ColorSlot::constant([1.0; 3]),
                subsurface: None,
            }),
            has_volume: true,
            base_color: ColorSlot::constant(color),
            ..PbrMaterial::default()
        };
        scene.materials[0].model = Model::Pbr(Box::new(pbr));
        scene
    };
    let options = options(16, 64, 300);
    for medium in
        [Medium::subsurface([0.6; 3], [0.02; 3], 0.0), Medium::subsurface([0.8, 0.4, 0.2], [0.02; 3], 0.0)]
    {
        let scene = scene(medium, [1.0; 3]);
        let [rgb, lanes] = [false, true].map(|spectral| means(&scene, &options, spectral, 8));
        println!("{rgb:.4?} {lanes:.4?}");
        for (rgb, lanes) in rgb.into_iter().zip(lanes) {
            assert!((rgb.0 - lanes.0).abs() < 0.01 + 4.5 * (rgb.1 + lanes.1), "{rgb:?} {lanes:?}");
        }
    }
}
