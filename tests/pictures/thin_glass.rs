//! Smooth thin glass: next-event estimation passes through it, and all techniques agree.

use crate::support::{assert_radiance, camera, gltf_glass, material, measure, options, quad, sphere};
use oscura::math::DVec3;
use oscura::scene::{
    AlphaMode, Clearcoat, ColorSlot, Environment, FloatSlot, Light, LightKind, Material, Model, PbrMaterial,
    Scene,
};

/// Transmittance of a thin sheet of index 1.5: 1 - 2 R / (1 + R).
fn clear_share(cosine: f64) -> f64 {
    let transmitted = (1.0 - (1.0 - cosine * cosine) / 2.25f64).sqrt();
    let parallel = (1.5 * cosine - transmitted) / (1.5 * cosine + transmitted);
    let perpendicular = (cosine - 1.5 * transmitted) / (cosine + 1.5 * transmitted);
    let r = 0.5 * (parallel * parallel + perpendicular * perpendicular);
    1.0 - 2.0 * r / (1.0 + r)
}

fn thin(tint: [f32; 3]) -> PbrMaterial {
    PbrMaterial { base_color: ColorSlot::constant(tint), ..gltf_glass(0.0) }
}

fn pbr(model: PbrMaterial) -> Material {
    Material::new("sheet", Model::Pbr(Box::new(model)))
}

/// Sun and point lights are attenuated by the transmittance of thin glass.
#[test]
fn point_and_directional_lights_through_thin_glass() {
    let direction = DVec3::new(0.6, -0.8, 0.0);
    let kinds = [
        ("sun", LightKind::Directional { direction }, 1.0),
        ("point", LightKind::Point { position: -5.0 * direction }, 1.0 / 25.0),
    ];
    for (what, kind, per_intensity) in kinds {
        for panes in [1, 2] {
            let mut scene = Scene::default();
            let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
            quad(&mut scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], grey);
            let glass = material(&mut scene, pbr(thin([0.9, 0.7, 0.5])));
            for i in 0..panes {
                let height = 1.0 + f64::from(i);
                quad(&mut scene, [-50.0, height, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], glass);
            }
            scene.lights.push(Light::new(kind, [5.0; 3]));
            scene.cameras.push(camera(DVec3::new(0.0, 0.5, 0.0), DVec3::ZERO, DVec3::X, 1e-3));
            let left = (0.7 * clear_share(0.8)).powi(panes);
            let truth = 0.8 / std::f64::consts::PI * 5.0 * 0.8 * per_intensity * left;
            assert_radiance(&format!("{what}, {panes} panes"), &scene, &options(4, 4, 1), truth, 1e-4);
        }
    }
}

/// Alpha transmission is tinted for lights, the sky and the camera.
#[test]
fn alpha_transmission_is_tinted() {
    let sun = Light::new(LightKind::Directional { direction: DVec3::new(0.6, -0.8, 0.0) }, [5.0; 3]);
    for (what, light, truth) in
        [("sun", Some(sun), 0.8 / std::f64::consts::PI * 5.0 * 0.8), ("sky", None, 0.8)]
    {
        let mut scene = Scene::default();
        let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
        quad(&mut scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], grey);
        let sheet = Material {
            alpha_mode: AlphaMode::Blend,
            alpha: FloatSlot::constant(0.25),
            transparent_color: ColorSlot::constant([0.9, 0.6, 0.3]),
            ..Material::new("sheet", Model::Black)
        };
        let sheet = material(&mut scene, sheet);
        quad(&mut scene, [-500.0, 1.0, 500.0], [1000.0, 0.0, 0.0], [0.0, 0.0, -1000.0], sheet);
        match light {
            Some(sun) => scene.lights.push(sun),
            None => scene.environment = Environment::Constant([1.0; 3]),
        }
        scene.cameras.push(camera(DVec3::new(0.0, 3.0, 0.0), DVec3::ZERO, DVec3::X, 1e-3));
        let left = (0.75f64 * 0.6).powi(2);
        assert_radiance(what, &scene, &options(16, 1024, 2), truth * left, 1e-2);
    }
}

/// White furnace: a white floor under clear thin glass loses nothing, whatever the sampling technique.
#[test]
fn thin_glass_conserves_energy() {
    for albedo in [1.0, 0.5] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let white = material(&mut scene, Material::lambert("white", [albedo; 3]));
        quad(&mut scene, [-5e3, 0.0, 5e3], [1e4, 0.0, 0.0], [0.0, 0.0, -1e4], white);
        let glass = material(&mut scene, pbr(thin([1.0; 3])));
        quad(&mut scene, [-5e3, 1.0, 5e3], [1e4, 0.0, 0.0], [0.0, 0.0, -1e4], glass);
        scene.cameras.push(camera(DVec3::new(0.0, 0.5, 0.0), DVec3::ZERO, DVec3::X, 1e-3));
        // Part of the floor's diffuse light is reflected back: the mean of R over the projected solid angle.
        let n = 100_000;
        let mean_passing: f64 =
            (0..n).map(|i| clear_share(((f64::from(i) + 0.5) / f64::from(n)).sqrt())).sum();
        let (passes, p) = (mean_passing / f64::from(n), f64::from(albedo));
        let truth = p * passes / (1.0 - p * (1.0 - passes));
        assert_radiance(&format!("albedo {albedo}"), &scene, &options(16, 256, 200), truth, 2e-3);
    }
}

/// Thin glass of all kinds between a light and glossy and diffuse objects.
fn behind_sheets(sheet: &Material, is_sampled: bool) -> Scene {
    let mut scene = Scene { environment: Environment::Constant([0.05; 3]), ..Scene::default() };
    let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
    let gloss = PbrMaterial {
        base_color: ColorSlot::constant([0.5; 3]),
        metallic: FloatSlot::constant(0.5),
        roughness: FloatSlot::constant(0.25),
        ..PbrMaterial::default()
    };
    let gloss = material(&mut scene, pbr(gloss));
    let mut lamp = Material::emitter("lamp", [4.0; 3], true);
    if !is_sampled {
        // An alpha that is 0 once in ten million rays disables next-event estimation.
        (lamp.alpha_mode, lamp.alpha) = (AlphaMode::Blend, FloatSlot::constant(1.0f32.next_down()));
    }
    let lamp = material(&mut scene, lamp);
    quad(&mut scene, [-3.0, 0.0, 3.0], [6.0, 0.0, 0.0], [0.0, 0.0, -6.0], gloss);
    sphere(&mut scene, [0.7, 0.5, 0.0], 0.5, grey);
    quad(&mut scene, [-2.0, 3.0, -2.0], [4.0, 0.0, 0.0], [0.0, 0.0, 4.0], lamp);
    let sheet = material(&mut scene, sheet.clone());
    quad(&mut scene, [-2.5, 2.0, -2.5], [4.0, 0.0, 0.0], [0.0, 0.3, 5.0], sheet);
    sphere(&mut scene, [-0.8, 0.8, 0.5], 0.6, sheet);
    scene.cameras.push(camera(DVec3::new(0.0, 1.5, 4.0), DVec3::new(0.0, 0.5, 0.0), DVec3::Y, 60.0));
    scene
}

/// MIS of light and BSDF samples through thin glass: the sum is that of BSDF samples alone.
#[test]
#[ignore = "means of many pictures, which take long"]
fn light_through_thin_glass_is_counted_once() {
    let half = PbrMaterial { transmission: FloatSlot::constant(0.6), ..thin([0.9, 0.5, 0.2]) };
    let coat =
        Clearcoat { factor: FloatSlot::constant(1.0), roughness: FloatSlot::constant(0.3), normal_map: None };
    let coated = PbrMaterial { clearcoat: Some(coat), ior: 1.8, ..thin([0.8; 3]) };
    let mut veil = pbr(thin([1.0, 0.8, 0.6]));
    (veil.alpha_mode, veil.alpha) = (AlphaMode::Blend, FloatSlot::constant(0.5));
    for (what, sheet) in
        [("clear", pbr(thin([1.0; 3]))), ("half", pbr(half)), ("coated", pbr(coated)), ("veil", veil)]
    {
        let options = options(10, 1024, 6);
        let (both, error) = measure(&behind_sheets(&sheet, true), &options);
        let (alone, error_alone) = measure(&behind_sheets(&sheet, false), &options);
        let combined = error.hypot(error_alone);
        println!("{what}: {both:.5} +- {error:.5}, by scattering alone {alone:.5} +- {error_alone:.5}");
        assert!(combined < 6e-3 * alone, "{what}: too uncertain to tell");
        assert!((both - alone).abs() < 4.5 * combined, "{what}: {both} is not {alone} +- {combined}");
    }
}
