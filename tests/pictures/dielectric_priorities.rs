//! Nested dielectrics with priorities: overlapping solids against closed forms, and against models whose solids touch exactly.

use crate::support::{assert_radiance, block, camera, gltf_glass, material, measure, options, quad};
use oscura::math::DVec3;
use oscura::render::Caustics;
use oscura::scene::{
    Environment, Light, LightKind, Material, MaterialId, Medium, Model, PbrMaterial, Projection, Scene,
};
use std::f64::consts::PI;

/// Smooth clear glass that leaves a share of light after a metre.
pub fn glass(scene: &mut Scene, ior: f32, left: f32, priority: i32) -> MaterialId {
    let pbr = PbrMaterial {
        has_volume: true,
        ior,
        attenuation_color: [left; 3],
        attenuation_distance: 1.0,
        ..gltf_glass(0.0)
    };
    material(scene, Material { priority, ..Material::new("glass", Model::Pbr(Box::new(pbr))) })
}

/// A closed block, wide in x and z, between two heights.
fn slab(scene: &mut Scene, [low, high]: [f64; 2], half: f64, material: MaterialId) {
    block(scene, [-half, low, -half], [half, high, half], material);
}

/// Beer's law through two overlapping absorbing slabs of index 1, from above and from below: 3 m in all, of which 1 m belongs to
/// both.
#[test]
#[ignore = "means of many pictures, which take long"]
fn overlap_belongs_to_the_higher_priority() {
    for (upper, lower, truth) in
        [(1, 0, 0.5f64.powi(2) * 0.25), (0, 1, 0.5 * 0.25f64.powi(2)), (7, -7, 0.5f64.powi(2) * 0.25)]
    {
        for from_above in [true, false] {
            let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
            let half = glass(&mut scene, 1.0, 0.5, upper);
            let quarter = glass(&mut scene, 1.0, 0.25, lower);
            slab(&mut scene, [1.0, 3.0], 50.0, half);
            slab(&mut scene, [0.0, 2.0], 50.0, quarter);
            let eye = if from_above { 8.0 } else { -8.0 };
            scene.cameras.push(camera(DVec3::new(0.0, eye, 0.0), DVec3::ZERO, DVec3::X, 1e-3));
            let what = format!("priorities {upper} and {lower}, from above: {from_above}");
            assert_radiance(&what, &scene, &options(16, 256, 16), truth, 2e-3);
        }
    }
}

/// Beer's law through a slab of glass and one of a null-interface medium, 2 m each, overlapping by 1 m. Glass that keeps
/// radiance lets the medium continue there, unless its priority is higher.
#[test]
fn media_continue_within_glass_that_keeps_radiance() {
    let (glass_left, medium_left) = (0.5f64, 0.25f64);
    for (keeps_radiance, priority, share) in [(true, 0, 1.0), (true, 1, 0.0), (false, 1, 0.0)] {
        for (eye, [in_glass, alone, shared]) in
            [(8.0, [2.0, 1.0, 1.0]), (-8.0, [2.0, 1.0, 1.0]), (1.5, [1.5, 0.0, 0.5])]
        {
            let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
            let solid = glass(&mut scene, 1.0, glass_left as f32, priority);
            if let Model::Pbr(pbr) = &mut scene.materials[solid.0 as usize].model {
                pbr.keeps_radiance = keeps_radiance;
            }
            let fog = Medium { albedo: [0.0; 3], ..Medium::scattering([-medium_left.ln() as f32; 3]) };
            let fog = Material { medium: Some(fog), ..Material::new("fog", Model::Boundary {}) };
            let fog = material(&mut scene, fog);
            slab(&mut scene, [1.0, 3.0], 50.0, solid);
            slab(&mut scene, [0.0, 2.0], 50.0, fog);
            let target = if eye == 8.0 { DVec3::ZERO } else { DVec3::Y * 9.0 };
            scene.cameras.push(camera(DVec3::new(0.0, eye, 0.0), target, DVec3::X, 1e-3));
            let truth = glass_left.powf(in_glass) * medium_left.powf(alone + share * shared);
            let what = format!("{keeps_radiance}, priority {priority}, from {eye}");
            assert_radiance(&what, &scene, &options(16, 256, 16), truth, 2e-3);
        }
    }
}

/// Refractive glass, half of it in a medium without absorption, in a white furnace: neither half loses or gains light.
#[test]
fn glass_partly_in_a_white_medium_in_a_white_furnace() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let pbr = PbrMaterial { has_volume: true, keeps_radiance: true, ior: 1.5, ..gltf_glass(0.0) };
    let solid = material(&mut scene, Material::new("glass", Model::Pbr(Box::new(pbr))));
    let fog = Medium { albedo: [1.0; 3], ..Medium::scattering([0.5; 3]) };
    let fog =
        material(&mut scene, Material { medium: Some(fog), ..Material::new("fog", Model::Boundary {}) });
    block(&mut scene, [-1.0, 0.0, -1.0], [1.0, 2.0, 1.0], solid);
    block(&mut scene, [-2.0, -1.0, -2.0], [2.0, 1.0, 2.0], fog);
    scene.cameras.push(camera(DVec3::new(3.0, 4.0, 5.0), DVec3::Y, DVec3::Y, 0.4));
    assert_radiance("furnace", &scene, &options(16, 256, 2000), 1.0, 2e-3);
}

/// The camera is in the overlap.
#[test]
fn camera_in_an_overlap_uses_the_higher_priority() {
    for (upper, lower, truth) in [(1, 0, 0.5f64.powf(1.5)), (0, 1, 0.25f64.powf(0.5) * 0.5)] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let half = glass(&mut scene, 1.0, 0.5, upper);
        let quarter = glass(&mut scene, 1.0, 0.25, lower);
        slab(&mut scene, [1.0, 3.0], 50.0, half);
        slab(&mut scene, [0.0, 2.0], 50.0, quarter);
        scene.cameras.push(camera(DVec3::new(0.0, 1.5, 0.0), DVec3::Y * 9.0, DVec3::X, 1e-3));
        assert_radiance(&format!("inside {upper} {lower}"), &scene, &options(16, 64, 16), truth, 2e-3);
    }
}

/// Half the width of the block of glass and water.
const HALF: f64 = 4.0;
/// Indices, and transmittance per metre.
const GLASS: (f64, f64) = (1.52, 0.8);
const WATER: (f64, f64) = (1.33, 0.6);

/// Glass, 0.5 thick, over water, 0.8 deep, which extends into the glass by some depth.
fn glass_over_water(depth: f64, priority: i32) -> Scene {
    let mut scene = Scene::default();
    let pane = glass(&mut scene, GLASS.0 as f32, GLASS.1 as f32, priority);
    let water = glass(&mut scene, WATER.0 as f32, WATER.1 as f32, 0);
    slab(&mut scene, [1.0, 1.5], HALF, pane);
    slab(&mut scene, [0.2, 1.0 + depth], HALF, water);
    scene
}

/// Unpolarised reflectance between two indices for a ray whose sine in air is given.
pub fn reflectance(from: f64, to: f64, sine: f64) -> f64 {
    let cosine = |ior: f64| (1.0 - (sine / ior).powi(2)).sqrt();
    let (a, b) = (cosine(from), cosine(to));
    let parallel = (to * a - from * b) / (to * a + from * b);
    let perpendicular = (from * a - to * b) / (from * a + to * b);
    0.5 * (parallel * parallel + perpendicular * perpendicular)
}

/// Reflectance of glass over water that touch exactly, with all inter-reflections, in a white furnace.
fn closed_form(sine: f64) -> f64 {
    let way =
        |(ior, left): (f64, f64), thickness: f64| left.powf(thickness / (1.0 - (sine / ior).powi(2)).sqrt());
    let (glass, water) = (way(GLASS, 0.5), way(WATER, 0.8));
    let faces = [(1.0, GLASS.0), (GLASS.0, WATER.0), (WATER.0, 1.0)].map(|(a, b)| reflectance(a, b, sine));
    // Reflectance and transmittance of everything below a face, from the lowest up.
    let (mut back, mut through) = (faces[2], 1.0 - faces[2]);
    for (face, left) in [(faces[1], water), (faces[0], glass)] {
        let between = 1.0 / (1.0 - face * left * left * back);
        through *= (1.0 - face) * left * between;
        back = face + (1.0 - face) * (1.0 - face) * left * left * back * between;
    }
    back + through
}

/// At an oblique angle, with a small and a large overlap.
#[test]
fn overlapping_solids_match_touching_ones() {
    for sine in [0.0f64, 0.8] {
        for depth in [0.001, 0.4] {
            let mut scene =
                Scene { environment: Environment::Constant([1.0; 3]), ..glass_over_water(depth, 1) };
            let eye = DVec3::new(sine, (1.0 - sine * sine).sqrt(), 0.0) * 9.0;
            // The centre of the picture: where the ray arrives, far from the sides.
            let at = DVec3::new(0.0, 1.5, 0.0);
            scene.cameras.push(camera(at + eye, at, DVec3::Z, 1e-3));
            let what = format!("sine {sine}, {depth} deep");
            assert_radiance(&what, &scene, &options(16, 64, 40), closed_form(sine), 5e-3);
        }
    }
}

/// Without priorities the last entered medium applies.
#[test]
fn without_priorities_the_last_entered_medium_applies() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..glass_over_water(0.4, 0) };
    scene.cameras.push(camera(DVec3::new(0.0, 9.0, 0.0), DVec3::ZERO, DVec3::Z, 1e-3));
    let (mean, error) = measure(&scene, &options(16, 256, 40));
    assert!((mean - closed_form(0.0)).abs() > 20.0 * error, "{mean} {error}");
}

/// A floor under the water, seen from the gap between them.
fn with_floor(mut scene: Scene) -> Scene {
    let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
    quad(&mut scene, [-HALF, 0.0, HALF], [2.0 * HALF, 0.0, 0.0], [0.0, 0.0, -2.0 * HALF], grey);
    let mut view = camera(DVec3::new(0.0, 0.15, 0.0), DVec3::ZERO, DVec3::X, 1.0);
    view.projection = Projection::Orthographic { half_height: 2.0 };
    scene.cameras.push(view);
    scene
}

pub fn assert_same(what: &str, one: (f64, f64), other: (f64, f64), precision: f64) {
    println!("{what}: {one:?} {other:?}");
    let error = one.1.hypot(other.1);
    assert!(error < precision * one.0, "{what}: {error} is too large an error of {}", one.0);
    assert!((one.0 - other.0).abs() < 4.5 * error, "{what}: {one:?} {other:?}");
}

/// A point light reaches the floor by light tracing only, which is independent of the overlap's depth, too.
#[test]
#[ignore = "means of many pictures, which take long"]
fn light_tracing_agrees_in_overlaps() {
    let lit = |depth: f64| {
        let mut scene = with_floor(glass_over_water(depth, 1));
        let kind = LightKind::Point { position: DVec3::new(0.4, 3.0, 0.0) };
        scene.lights.push(Light::new(kind, [20.0 * PI as f32; 3]));
        measure(&scene, &options(32, 64, 12).caustics(Caustics::On))
    };
    assert_same("a point", lit(0.01), lit(0.4), 2e-2);
}

/// Camera paths that hit an area light, against light tracing.
#[test]
#[ignore = "means of many pictures, which take long"]
fn camera_paths_and_light_tracing_agree_in_overlaps() {
    let lit = |caustics: Caustics| {
        let mut scene = with_floor(glass_over_water(0.4, 1));
        let shine = material(&mut scene, Material::emitter("lamp", [10.0; 3], false));
        quad(&mut scene, [-1.0, 3.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], shine);
        measure(&scene, &options(32, 64, 12).caustics(caustics))
    };
    assert_same("both ways", lit(Caustics::On), lit(Caustics::Off), 1e-2);
}
