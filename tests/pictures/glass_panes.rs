//! Solid glass panes: next-event estimation passes through them, and all techniques agree.

use crate::support::{
    assert_radiance, block, camera, dielectric, material, measure, options, pbr, quad, sphere,
};
use oscura::math::DVec3;
use oscura::render::{Caustics, RenderOptions};
use oscura::scene::{
    AlphaMode, Clearcoat, ColorSlot, FloatSlot, Light, LightKind, Material, MaterialId, Model, PbrMaterial,
    Scene, Sheen,
};
use std::f64::consts::PI;

const IOR: f64 = 1.5;

/// Reflectance and refracted cosine at a face.
fn face(cosine: f64) -> (f64, f64) {
    let within = (1.0 - (1.0 - cosine * cosine) / (IOR * IOR)).sqrt();
    let parallel = (IOR * cosine - within) / (IOR * cosine + within);
    let perpendicular = (cosine - IOR * within) / (cosine + IOR * within);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), within)
}

/// Transmittance of a pane: T^2 / (1 - R^2).
fn clear_share(cosine: f64) -> f64 {
    let r = face(cosine).0;
    (1.0 - r) / (1.0 + r)
}

fn glass(scene: &mut Scene) -> MaterialId {
    material(scene, dielectric(IOR as f32))
}

/// Adds a pane between two heights.
fn pane(scene: &mut Scene, low: f64, high: f64, material: MaterialId) {
    block(scene, [-40.0, low, -40.0], [40.0, high, 40.0], material);
}

fn floor_seen_from_below(scene: &mut Scene, of: Material) {
    let ground = material(scene, of);
    quad(scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], ground);
    scene.cameras.push(camera(DVec3::new(0.1, 0.3, 0.2), DVec3::ZERO, DVec3::X, 1e-3));
}

/// Height of the light, and the total thickness of all panes.
const HEIGHT: f64 = 2.0;
const THICKNESS: f64 = 0.5;

/// The irradiance on the floor under a point light of intensity 1 at a horizontal distance, and the cosine there: Snell's law
/// gives the angle by bisection, and its derivative the divergence.
fn point_behind_pane(distance: f64) -> (f64, f64) {
    let end = |sine: f64| {
        let cosine = (1.0 - sine * sine).sqrt();
        let within = (IOR * IOR - sine * sine).sqrt();
        (HEIGHT - THICKNESS) * sine / cosine + THICKNESS * sine / within
    };
    let (mut low, mut high) = (0.0, 1.0 - 1e-12);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if end(middle) < distance { low = middle } else { high = middle }
    }
    let cosine = (1.0 - low * low).sqrt();
    let step = 1e-6;
    // d rho / d theta = (d rho / d sine) cosine; dA = rho d rho d phi, d omega = sine d theta d phi.
    let slope = (end(low + step) - end(low - step)) / (2.0 * step) * cosine;
    (low / (distance * slope), cosine)
}

#[test]
fn point_and_directional_lights_through_panes() {
    for panes in [1, 2] {
        let scene_of = |kind: LightKind| {
            let mut scene = Scene::default();
            floor_seen_from_below(&mut scene, Material::lambert("grey", [0.8; 3]));
            let glass = glass(&mut scene);
            let each = THICKNESS / f64::from(panes);
            for i in 0..panes {
                let low = 0.5 + 0.6 * f64::from(i);
                pane(&mut scene, low, low + each, glass);
            }
            scene.lights.push(Light::new(kind, [5.0; 3]));
            scene
        };
        let direction = DVec3::new(0.6, -0.8, 0.0);
        let sun = scene_of(LightKind::Directional { direction });
        let truth = 0.8 / PI * 5.0 * 0.8 * clear_share(0.8).powi(panes);
        assert_radiance(&format!("sun, {panes} panes"), &sun, &options(4, 4, 1), truth, 1e-4);
        let point = scene_of(LightKind::Point { position: DVec3::new(1.5, HEIGHT, 0.0) });
        let (irradiance, cosine) = point_behind_pane(1.5);
        let truth = 0.8 / PI * 5.0 * irradiance * clear_share(cosine).powi(panes);
        assert_radiance(&format!("point, {panes} panes"), &point, &options(4, 4, 1), truth, 1e-4);
    }
}

/// A floor under a pane and an area light, with or without next-event estimation through panes.
pub fn under_a_pane(of: Material, edge: DVec3, is_sampled: bool) -> Scene {
    let mut scene = Scene::default();
    floor_seen_from_below(&mut scene, of);
    let glass = glass(&mut scene);
    pane(&mut scene, 0.5, 0.7, glass);
    let mut lamp = Material::emitter("lamp", [4.0; 3], true);
    if !is_sampled {
        // An alpha that is 0 once in ten million rays disables next-event estimation.
        (lamp.alpha_mode, lamp.alpha) = (AlphaMode::Blend, FloatSlot::constant(1.0f32.next_down()));
    }
    let lamp = material(&mut scene, lamp);
    quad(&mut scene, [-0.4, 1.2, -0.3], [0.9, 0.0, 0.0], edge.to_array(), lamp);
    scene
}

fn with(model: impl FnOnce(&mut PbrMaterial)) -> Material {
    let mut pbr = PbrMaterial {
        base_color: ColorSlot::constant([0.6; 3]),
        metallic: FloatSlot::constant(0.0),
        ..PbrMaterial::default()
    };
    model(&mut pbr);
    Material::new("floor", Model::Pbr(Box::new(pbr)))
}

fn floors() -> Vec<(&'static str, Material)> {
    let coat =
        Clearcoat { factor: FloatSlot::constant(1.0), roughness: FloatSlot::constant(0.2), normal_map: None };
    let sheen = Sheen { color: ColorSlot::constant([0.8; 3]), roughness: FloatSlot::constant(0.5) };
    vec![
        ("diffuse", Material::lambert("grey", [0.8; 3])),
        ("0.05", pbr("gloss", [0.6; 3], 0.0, 0.05)),
        ("0.35", pbr("gloss", [0.6; 3], 0.0, 0.35)),
        ("1", pbr("gloss", [0.6; 3], 0.0, 1.0)),
        ("coat", with(|model| model.clearcoat = Some(coat))),
        ("sheen", with(|model| model.sheen = Some(sheen))),
    ]
}

/// MIS of light and BSDF samples through panes: the sum is that of BSDF samples alone.
fn assert_counts_once(floors: impl Iterator<Item = (&'static str, Material)>, samples: u32, precision: f64) {
    let edge = DVec3::new(0.0, 0.2, 0.8);
    for (what, floor) in floors {
        let options = options(8, samples, 3).caustics(Caustics::Off);
        let (both, error) = measure(&under_a_pane(floor.clone(), edge, true), &options);
        let (alone, error_alone) = measure(&under_a_pane(floor, edge, false), &options);
        let combined = error.hypot(error_alone);
        println!("{what}: {both:.5} +- {error:.5}, by scattering alone {alone:.5} +- {error_alone:.5}");
        assert!(combined < precision * alone, "{what}: too uncertain to tell");
        assert!((both - alone).abs() < 4.5 * combined, "{what}: {both} is not {alone} +- {combined}");
    }
}

#[test]
fn light_through_panes_is_counted_once() {
    assert_counts_once(floors().into_iter().filter(|(what, _)| ["0.35", "coat"].contains(what)), 256, 1e-2);
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn light_through_panes_is_counted_once_on_all_floors() {
    assert_counts_once(floors().into_iter(), 1024, 6e-3);
}

/// A room under a skylight with a light above it; a glass sphere casts a caustic.
fn room_with_skylight(floor: Material, has_ball: bool) -> Scene {
    let mut scene = Scene::default();
    let wall = material(&mut scene, Material::lambert("grey", [0.6; 3]));
    let floor = material(&mut scene, floor);
    let (x, z) = ([2.0, 0.0, 0.0], [0.0, 0.0, 2.0]);
    quad(&mut scene, [-1.0, 0.0, -1.0], z, x, floor);
    for (corner, u, v) in [([-1.0, 0.0, -1.0], x, [0.0, 1.2, 0.0]), ([-1.0, 0.0, -1.0], [0.0, 1.2, 0.0], z)] {
        quad(&mut scene, corner, u, v, wall);
    }
    let glass = glass(&mut scene);
    block(&mut scene, [-1.0, 1.2, -1.0], [1.0, 1.25, 1.0], glass);
    if has_ball {
        sphere(&mut scene, [-0.1, 0.4, -0.1], 0.3, glass);
    }
    let lamp = material(&mut scene, Material::emitter("lamp", [8.0; 3], true));
    quad(&mut scene, [-0.3, 1.8, -0.3], [0.8, 0.0, 0.0], [0.0, 0.1, 0.6], lamp);
    scene.cameras.push(camera(DVec3::new(0.9, 0.9, 0.9), DVec3::new(-0.3, 0.1, -0.3), DVec3::Y, 80.0));
    scene
}

/// Glossy filtering leaves panes smooth: a light behind a window is unaffected, unlike other glass.
#[test]
fn glossy_filter_keeps_panes_smooth() {
    let scene = room_with_skylight(Material::lambert("grey", [0.5; 3]), false);
    let by = |filter| {
        let options: RenderOptions = options(24, 256, 8).caustics(Caustics::Off).filter_glossy(filter);
        measure(&scene, &options)
    };
    let ((filtered, error), (plain, error_plain)) = (by(1.0), by(0.0));
    let combined = error.hypot(error_plain);
    println!("{filtered:.5} +- {error:.5}, without {plain:.5} +- {error_plain:.5}");
    assert!(combined < 1e-2 * plain, "too uncertain to tell");
    assert!((filtered - plain).abs() < 4.5 * combined, "{filtered} is not {plain} +- {combined}");
}

/// Light through panes on all kinds of floors, with or without light tracing, with or without a glass sphere.
#[test]
#[ignore = "means of many pictures, which take long"]
fn light_tracing_leaves_panes_to_next_event_estimation() {
    for (what, floor) in floors() {
        for has_ball in [false, true] {
            let scene = room_with_skylight(floor.clone(), has_ball);
            let by = |caustics| {
                let options: RenderOptions = options(24, 256, 8).caustics(caustics);
                measure(&scene, &options)
            };
            let ((on, error), (off, error_off)) = (by(Caustics::On), by(Caustics::Off));
            let combined = error.hypot(error_off);
            println!("{what}, ball {has_ball}: {on:.5} +- {error:.5}, without {off:.5} +- {error_off:.5}");
            assert!(on != off, "{what}: no paths from lights");
            assert!(combined < 1e-2 * off, "{what}: too uncertain to tell");
            assert!((on - off).abs() < 4.5 * combined, "{what}: {on} is not {off} +- {combined}");
        }
    }
}
