//! The shadow pass of first hits against closed forms, and passes in camera space.

use crate::support::{camera, floor, material, options, pbr, picture, quad, sphere};
use oscura::film::{Aov, AovSet, AovSpace, Film};
use oscura::math::DVec3;
use oscura::render::RenderOptions;
use oscura::scene::{
    ColorSlot, Environment, FloatSlot, Light, Material, Model, ObjectTraits, RayKinds, Scene,
};

fn grey() -> Material {
    Material::lambert("grey", [0.8, 0.5, 0.3])
}

/// An occluder 1 m above half of the floor.
fn sheet(scene: &mut Scene, of: Material) {
    let sheet = material(scene, of);
    quad(scene, [0.0, 1.0, -50.0], [50.0, 0.0, 0.0], [0.0, 0.0, 100.0], sheet);
    scene.quads[1].name = "sheet".into();
}

fn black() -> Material {
    Material::lambert("black", [0.0; 3])
}

fn plane(film: &Film, name: &str) -> Vec<f32> {
    film.plane(name).unwrap_or_else(|| panic!("no channel {name}")).into_floats()
}

fn with_shadow(samples: u32) -> RenderOptions {
    options(16, samples, 3).aovs(Aov::Shadow)
}

/// Asserts the mean of the shadow pass, within the standard error of its pixels.
fn assert_shadow(what: &str, scene: &Scene, samples: u32, truth: f64) {
    let shadow = plane(&picture(scene, &with_shadow(samples)), "shadow.V");
    let n = shadow.len() as f64;
    let mean = shadow.iter().map(|v| f64::from(*v)).sum::<f64>() / n;
    let error = (shadow.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
    println!("{what}: {mean:.5} +- {error:.5}, truth {truth:.5}");
    assert!(error < 6e-3, "{what}: the standard error {error} can't tell");
    assert!((mean - truth).abs() <= 4.0 * error + 1e-5, "{what}: {mean} +- {error}, not {truth}");
}

/// A point light on either side of the sheet's edge: the sheet hides the right one.
fn two_points(scene: &mut Scene, powers: [[f32; 3]; 2]) {
    for (x, power) in [-1.0, 1.0].into_iter().zip(powers) {
        scene.lights.push(Light::point([x, 2.0, 0.0], power));
    }
}

#[test]
fn shadow_is_the_blocked_fraction() {
    let luminance = |[r, g, b]: [f64; 3]| 0.212_639 * r + 0.715_169 * g + 0.072_192 * b;
    let (left, right) = ([1.0, 2.0, 3.0], [4.0, 1.0, 2.0]);
    let scattered = |light: [f64; 3]| luminance([0.8 * light[0], 0.5 * light[1], 0.3 * light[2]]);
    let truth = scattered(right) / (scattered(left) + scattered(right));
    let mut scene = floor(grey());
    sheet(&mut scene, black());
    two_points(&mut scene, [left, right].map(|light| light.map(|v| v as f32)));
    assert_shadow("two points", &scene, 64, truth);

    // No occlusion, full occlusion; and without light, there is no shadow.
    let mut open = floor(grey());
    two_points(&mut open, [[1.0; 3]; 2]);
    assert_shadow("no sheet", &open, 16, 0.0);
    let mut scene = floor(grey());
    sheet(&mut scene, black());
    two_points(&mut scene, [[0.0; 3], [1.0; 3]]);
    assert_shadow("all in shadow", &scene, 16, 1.0);
    assert_shadow("no light", &floor(grey()), 16, 0.0);

    // Half of an area light above the edge is hidden, also for BSDF samples and glossy surfaces.
    for ground in [grey(), pbr("plastic", [0.5; 3], 0.0, 0.4)] {
        let mut scene = floor(ground);
        sheet(&mut scene, black());
        let lamp = material(&mut scene, Material::emitter("lamp", [5.0; 3], false));
        sphere(&mut scene, [0.0, 3.0, 0.0], 0.5, lamp);
        scene.cameras = vec![camera(DVec3::new(0.0, 0.9, -2.0), DVec3::ZERO, DVec3::Y, 1e-3)];
        assert_shadow("half a lamp", &scene, 256, 0.5);
    }

    // And half of the sky; what lies below the sheet's far end, 50 m away, is negligible.
    let mut scene = floor(grey());
    sheet(&mut scene, black());
    scene.environment = Environment::Constant([1.0; 3]);
    assert_shadow("half the sky", &scene, 256, 0.5);
}

/// Transparent objects block partially; objects that cast no shadow block nothing.
#[test]
fn transparent_occluders_cast_partial_shadows() {
    let pane = Model::Glass {
        ior: 1.0,
        tint: ColorSlot::constant([0.25; 3]),
        roughness: FloatSlot::constant(0.0),
        is_thin: true,
    };
    let mut scene = floor(grey());
    sheet(&mut scene, Material::new("pane", pane));
    two_points(&mut scene, [[0.0; 3], [1.0; 3]]);
    assert_shadow("a pane", &scene, 16, 0.75);

    let mut scene = floor(grey());
    sheet(&mut scene, black());
    two_points(&mut scene, [[0.0; 3], [1.0; 3]]);
    let unseen =
        ObjectTraits { visible_to: RayKinds::ALL.without(RayKinds::SHADOW), ..ObjectTraits::default() };
    scene.set_object_traits("sheet", unseen);
    assert_shadow("no caster", &scene, 16, 0.0);
}

/// Requesting the shadow pass leaves the picture unchanged.
#[test]
fn shadow_pass_keeps_the_picture() {
    let mut scene = floor(pbr("plastic", [0.5; 3], 0.0, 0.4));
    sheet(&mut scene, black());
    two_points(&mut scene, [[1.0; 3]; 2]);
    scene.environment = Environment::Constant([0.5; 3]);
    let plain = picture(&scene, &options(16, 16, 3));
    assert_eq!(plain.rgba(), picture(&scene, &with_shadow(16)).rgba());
}

/// World-space passes rotated into camera space equal the camera-space passes.
#[test]
fn passes_in_camera_space() {
    let mut scene = floor(grey());
    let red = material(&mut scene, Material::lambert("red", [0.6, 0.2, 0.1]));
    sphere(&mut scene, [0.3, 0.5, 0.2], 0.5, red);
    let view = camera(DVec3::new(-3.0, 1.5, -2.0), DVec3::new(0.3, 0.4, 0.0), DVec3::Y, 30.0);
    let camera_from_world = view.world_from_camera.inverse();
    scene.cameras = vec![view];
    // One sample per pixel: mean directions rotate with the space, but empty pixels have no position.
    let aovs = AovSet::from([Aov::Position, Aov::Normal, Aov::GeometricNormal, Aov::Depth]);
    let of = |space| picture(&scene, &options(24, 1, 1).aovs(aovs).aov_space(space));
    let (world, own) = (of(AovSpace::World), of(AovSpace::Camera));
    assert_eq!(world.rgba(), own.rgba());
    let vectors = |film: &Film, layer: &str| -> Vec<DVec3> {
        let [x, y, z] = ["X", "Y", "Z"].map(|axis| plane(film, &format!("{layer}.{axis}")));
        (0..x.len()).map(|i| DVec3::new(x[i].into(), y[i].into(), z[i].into())).collect()
    };
    let depth = plane(&world, "Z");
    let mut seen = 0;
    for layer in ["N", "Ng", "P"] {
        for (i, (world, own)) in vectors(&world, layer).iter().zip(vectors(&own, layer)).enumerate() {
            if depth[i] > 1e9 {
                assert!(*world == DVec3::ZERO && own == DVec3::ZERO);
                continue;
            }
            seen += 1;
            let expected = match layer {
                "P" => camera_from_world.transform_point3(*world),
                _ => camera_from_world.transform_vector3(*world),
            };
            assert!((expected - own).length() < 1e-5 * (1.0 + expected.length()), "{layer}: {own}");
            let towards = if layer == "P" { -own.z - f64::from(depth[i]) } else { 0.0 };
            assert!(towards.abs() < 1e-4, "{layer}: {own} at {}", depth[i]);
        }
    }
    assert!(seen > 1000, "only {seen}");
}
