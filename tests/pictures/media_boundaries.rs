//! Boundaries of media: rays past fog, floors, touching media, cameras inside, layers on top, and open meshes.

use crate::support::{assert_radiance, camera, material, mean, options, picture, quad, sphere};
use oscura::compile::{CompileOptions, compile};
use oscura::error::Warning;
use oscura::math::DVec3;
use oscura::scene::{
    Camera, Clearcoat, ColorSlot, DiffuseTransmission, Environment, FloatSlot, Fog, Light, LightKind,
    Material, MaterialId, Medium, Model, PbrMaterial, Projection, Scene,
};

fn medium(extinction: [f32; 3], albedo: f32) -> Medium {
    Medium { albedo: [albedo; 3], ..Medium::scattering(extinction) }
}

fn fog(medium: Medium, radius: f64) -> Option<Fog> {
    Some(Fog { medium, center: DVec3::ZERO, radius })
}

/// A solid with an index-matched (null) interface.
fn body(scene: &mut Scene, medium: Medium) -> MaterialId {
    let filled = Material { medium: Some(medium), ..Material::new("body", Model::Boundary {}) };
    material(scene, filled)
}

/// A box of six quads, fronts outwards.
fn block(scene: &mut Scene, [x, y, z]: [f64; 3], [a, b, c]: [f64; 3], material: MaterialId) {
    let (u, v, w) = ([a - x, 0.0, 0.0], [0.0, b - y, 0.0], [0.0, 0.0, c - z]);
    for (corner, first, second) in [
        ([x, y, z], w, v),
        ([a, y, z], v, w),
        ([x, y, z], u, w),
        ([x, b, z], w, u),
        ([x, y, z], v, u),
        ([x, y, c], u, v),
    ] {
        quad(scene, corner, first, second, material);
    }
}

/// Orthographic rays along -z within a square.
fn parallel(from: [f64; 3], half_height: f64) -> Camera {
    let from = DVec3::from(from);
    let mut view = camera(from, from - DVec3::Z, DVec3::Y, 1.0);
    view.projection = Projection::Orthographic { half_height };
    view
}

fn lit_all_around() -> Scene {
    Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() }
}

/// A plane of constant z, far beyond the scene, that emits 1 to both sides.
fn shining_plane(scene: &mut Scene, z: f64) {
    let emissive = material(scene, Material::emitter("plane", [1.0; 3], true));
    quad(scene, [-20.0, -20.0, z], [40.0, 0.0, 0.0], [0.0, 40.0, 0.0], emissive);
}

/// The midpoint rule.
fn integral(from: f64, to: f64, steps: u32, f: impl Fn(f64) -> f64) -> f64 {
    let width = (to - from) / f64::from(steps);
    (0..steps).map(|i| f(from + (f64::from(i) + 0.5) * width) * width).sum()
}

/// Subsurface scattering of an albedo under a layer that does nothing by itself.
fn subsurface(color: [f32; 3]) -> Material {
    let (factor, white) = (FloatSlot::constant(1.0), ColorSlot::constant([1.0; 3]));
    let diffuse_transmission = Some(DiffuseTransmission { factor, color: white, subsurface: None });
    let model = PbrMaterial { has_volume: true, diffuse_transmission, ..diffuse_base([1.0; 3]) };
    let medium = Some(Medium::subsurface(color, [0.01; 3], 0.0));
    Material { medium, ..Material::gltf("subsurface", model) }
}

/// A diffuse base under a layer that does nothing by itself.
fn diffuse_base(color: [f32; 3]) -> PbrMaterial {
    let none = FloatSlot::constant(0.0);
    let base_color = ColorSlot::constant(color);
    PbrMaterial { base_color, metallic: none, specular: none, ior: 1.0, ..PbrMaterial::default() }
}

#[test]
fn rays_missing_a_fog_sphere_see_the_background() {
    let mut scene = lit_all_around();
    scene.fog = fog(medium([0.5, 1.0, 1.6], 1.0), 1.0);
    scene.cameras.push(camera(DVec3::new(0.0, 0.0, 10.0), DVec3::ZERO, DVec3::Y, 40.0));
    assert_radiance("past fog", &scene, &options(16, 4, 1000), 1.0, 4e-3);
}

/// A medium on a floor and under a ceiling, two that touch, and two of one material.
#[test]
fn touching_media_and_surfaces() {
    let bodies = |scene: &mut Scene, extinctions: &[f32]| {
        for (i, &extinction) in extinctions.iter().enumerate() {
            let filled = body(scene, medium([extinction; 3], 0.0));
            let z = -(i as f64);
            block(scene, [-0.5, -0.5, z - 1.0], [0.5, 0.5, z], filled);
        }
    };
    for (what, is_first, extinctions) in [
        ("floor before body", true, &[0.5f32][..]),
        ("body before floor", false, &[0.5]),
        ("two bodies", false, &[0.5, 1.0]),
        ("two of one density", true, &[0.7, 0.7]),
    ] {
        let mut scene = Scene::default();
        let floor = -(extinctions.len() as f64);
        if is_first {
            shining_plane(&mut scene, floor);
        }
        bodies(&mut scene, extinctions);
        if !is_first {
            shining_plane(&mut scene, floor);
        }
        scene.cameras.push(parallel([0.03, 0.02, 5.0], 0.2));
        let truth = (-f64::from(extinctions.iter().sum::<f32>())).exp();
        assert_radiance(what, &scene, &options(8, 4, 2), truth, 1e-4);
    }
    // One material for both: the exit and the entry coincide.
    let mut scene = lit_all_around();
    let filled = body(&mut scene, medium([0.6; 3], 0.0));
    block(&mut scene, [-0.5, -0.5, -1.0], [0.5, 0.5, 0.0], filled);
    block(&mut scene, [-0.5, -0.5, 0.0], [0.5, 0.5, 1.0], filled);
    scene.cameras.push(parallel([0.03, 0.02, 5.0], 0.2));
    assert_radiance("one material", &scene, &options(8, 4, 2), (-1.2f64).exp(), 1e-4);
}

/// Light reaches a floor through a slab that lies on it, and leaves it through the slab, whichever was added first.
#[test]
fn floor_seen_through_a_medium_on_it() {
    const SIGMA: f64 = 0.5;
    let arriving = integral(0.0, 1.0, 4000, |cosine| 2.0 * cosine * (-SIGMA / cosine).exp());
    for is_first in [true, false] {
        let mut scene = lit_all_around();
        let white = material(&mut scene, Material::lambert("floor", [1.0; 3]));
        let filled = body(&mut scene, medium([SIGMA as f32; 3], 0.0));
        let floor = |scene: &mut Scene| {
            quad(scene, [-500.0, -500.0, 0.0], [1000.0, 0.0, 0.0], [0.0, 1000.0, 0.0], white);
        };
        if is_first {
            floor(&mut scene);
        }
        block(&mut scene, [-400.0, -400.0, 0.0], [400.0, 400.0, 1.0], filled);
        if !is_first {
            floor(&mut scene);
        }
        scene.cameras.push(parallel([0.0, 0.0, 2.0], 0.2));
        let truth = (-SIGMA).exp() * arriving;
        assert_radiance("slab on a floor", &scene, &options(16, 64, 1), truth, 4e-3);
    }
}

/// Emissive media with chromatic extinction, zero in one channel.
#[test]
fn chromatic_emissive_media() {
    let emissive = |red: f32| Medium { emission: [0.0, 0.4, 0.4], ..medium([red, 1.0, 3.0], 0.5) };
    for (red, has_lamp) in [(0.0, false), (1e-6, false), (1.0, false), (0.0, true)] {
        let mut scene = Scene { fog: fog(emissive(red), f64::INFINITY), ..Scene::default() };
        if has_lamp {
            let kind = LightKind::Point { position: DVec3::new(0.0, 0.3, -2.0) };
            scene.lights.push(Light::new(kind, [1e-9; 3]));
        }
        scene.cameras.push(parallel([0.0; 3], 0.1));
        assert_radiance(&format!("glow {red} {has_lamp}"), &scene, &options(16, 64, 0), 0.4, 1e-2);
    }
    let mut scene = Scene::default();
    let filled = body(&mut scene, Medium { emission: [0.4; 3], ..emissive(0.0) });
    sphere(&mut scene, [0.0; 3], 1.5, filled);
    scene.cameras.push(parallel([0.0, 0.0, 5.0], 1e-3));
    assert_radiance("glow of a body", &scene, &options(16, 64, 0), 0.4 * (1.0 - (-3.0f64).exp()), 1e-2);
}

#[test]
fn orthographic_camera_inside_a_medium() {
    let mut inside = Scene::default();
    let filled = body(&mut inside, medium([0.5; 3], 0.0));
    sphere(&mut inside, [0.0; 3], 50.0, filled);
    let mut partly = Scene::default();
    let filled = body(&mut partly, medium([0.5; 3], 0.0));
    block(&mut partly, [-9.0, -9.0, -9.0], [0.0, 9.0, 9.0], filled);
    let left = (-2.5f64).exp();
    for (what, mut scene, truth) in [("inside", inside, left), ("partly", partly, 0.5 * (1.0 + left))] {
        shining_plane(&mut scene, 0.0);
        scene.cameras.push(parallel([0.0, 0.0, 5.0], 1.5));
        assert_radiance(what, &scene, &options(16, 4, 2), truth, 1e-4);
    }
}

/// Layers over subsurface scattering act as those over a diffuse base: light that exits has passed the layers already.
#[test]
fn layers_on_subsurface_match_layers_on_diffuse() {
    let coated = |model: &PbrMaterial| {
        let clearcoat = Clearcoat {
            factor: FloatSlot::constant(1.0),
            roughness: FloatSlot::constant(0.3),
            normal_map: None,
        };
        PbrMaterial { clearcoat: Some(clearcoat), ..model.clone() }
    };
    let seen = |of: Material| {
        let mut scene = lit_all_around();
        let of = material(&mut scene, of);
        sphere(&mut scene, [0.0; 3], 1.0, of);
        scene.cameras.push(parallel([0.0, 0.0, 5.0], 1e-3));
        mean(&picture(&scene, &options(32, 64, 4)))
    };
    let subsurface = subsurface([0.5; 3]);
    let model = subsurface.model.pbr().map(coated).expect("a glTF material");
    let of_wax = seen(Material { model: Model::Pbr(Box::new(model)), ..subsurface });
    let of_clay = seen(Material::gltf("diffuse_base", coated(&diffuse_base([0.5; 3]))));
    println!("coated subsurface {of_wax}, diffuse_base {of_clay}");
    assert!((of_wax - of_clay).abs() < 0.01, "{of_wax} {of_clay}");
}

/// Random walks in a solid of a hundred mean free paths without absorption end outside.
#[test]
fn white_subsurface_in_a_white_furnace() {
    let mut scene = lit_all_around();
    let white = material(&mut scene, subsurface([1.0; 3]));
    sphere(&mut scene, [0.0; 3], 1.0, white);
    scene.cameras.push(parallel([0.0, 0.0, 5.0], 1e-3));
    assert_radiance("white subsurface", &scene, &options(8, 16, 4), 1.0, 4e-3);
}

#[test]
fn subsurface_on_open_meshes_is_diffuse() {
    let mut scene = lit_all_around();
    let sheet = material(&mut scene, subsurface([0.8, 0.25, 0.1]));
    quad(&mut scene, [-1.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], sheet);
    scene.cameras.push(parallel([0.0, 0.0, 5.0], 0.5));
    assert_radiance("sheet of subsurface", &scene, &options(8, 16, 4), 0.25, 4e-3);
    let (_, report) = compile(&scene, &CompileOptions::default()).expect("the scene compiles");
    let is_it = |w: &Warning| w.code == "subsurface-open" && w.message.contains("'subsurface'");
    assert!(report.warnings.iter().any(is_it), "{:?}", report.warnings);
}

/// An interface that was never entered exits no medium.
#[test]
fn back_faces_exit_no_medium_that_was_not_entered() {
    let mut scene = lit_all_around();
    let none = FloatSlot::constant(0.0);
    let glass = PbrMaterial {
        transmission: FloatSlot::constant(1.0),
        roughness: none,
        has_volume: true,
        attenuation_color: [0.5; 3],
        attenuation_distance: 1.0,
        ..diffuse_base([1.0; 3])
    };
    let glass = material(&mut scene, Material::gltf("glass", glass));
    sphere(&mut scene, [0.0; 3], 1.0, glass);
    let sheet = body(&mut scene, medium([1.0; 3], 0.0));
    quad(&mut scene, [-0.5, -0.5, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], sheet);
    scene.cameras.push(parallel([0.0, 0.0, 5.0], 1e-3));
    assert_radiance("glass around a sheet", &scene, &options(8, 4, 6), 0.25, 1e-3);
}
