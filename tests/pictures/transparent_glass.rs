//! Transparent glass (film transparency): alpha against closed forms, and composites over the removed environment.

use crate::support::{camera, gltf_glass, material, options, picture, quad, sphere};
use oscura::film::Film;
use oscura::math::DVec3;
use oscura::render::{PathReuse, RenderOptions, Splitting, in_pool};
use oscura::scene::{
    ColorSlot, Environment, Light, LightKind, Material, MaterialId, Model, PbrMaterial, RayKinds, Scene,
};

/// Clear glass, solid or thin; `color` tints thin sheets, and is the transmittance per metre of a solid.
fn glass(scene: &mut Scene, color: [f32; 3], is_solid: bool, roughness: f32) -> MaterialId {
    let pbr = PbrMaterial {
        base_color: ColorSlot::constant(if is_solid { [1.0; 3] } else { color }),
        has_volume: is_solid,
        attenuation_color: color,
        attenuation_distance: 1.0,
        ..gltf_glass(roughness)
    };
    material(scene, Material::new("glass", Model::Pbr(Box::new(pbr))))
}

fn sky(color: [f32; 3], is_seen: bool) -> Scene {
    let mut scene = Scene { environment: Environment::Constant(color), ..Scene::default() };
    if !is_seen {
        scene.environment_visible_to = RayKinds::ALL.without(RayKinds::CAMERA);
    }
    scene
}

fn look(scene: &mut Scene, vfov_deg: f64) {
    scene.cameras.push(camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO, DVec3::Y, vfov_deg));
}

fn clear(size: u32, samples: u32, depth: u32) -> RenderOptions {
    options(size, samples, depth).transparent_glass(true)
}

fn mean_of(film: &Film, channel: usize) -> f64 {
    let rgba = film.rgba();
    rgba.iter().map(|pixel| f64::from(pixel[channel])).sum::<f64>() / rgba.len() as f64
}

/// Asserts a mean alpha over independent seeds, within 4.5 standard errors (Student's t with 11 degrees of freedom: a chance
/// of 1e-3).
fn assert_alpha(what: &str, scene: &Scene, options: &RenderOptions, truth: f64) {
    let means: Vec<f64> =
        (0..12).map(|seed| mean_of(&picture(scene, &options.seed(1 + 7919 * seed)), 3)).collect();
    let mean = means.iter().sum::<f64>() / 12.0;
    let error = (means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / 11.0 / 12.0).sqrt();
    println!("{what}: {mean:.6} +- {error:.6}, truth {truth:.6}");
    assert!(error < 3e-3, "{what}: the standard error {error} can't tell");
    assert!((mean - truth).abs() <= 4.5 * error + 1e-5, "{what}: {mean} +- {error}, not {truth}");
}

/// The reflectance of a face of index 1.5 at normal incidence is 4 %; a thin sheet reflects 2 R / (1 + R) in total.
const R: f64 = 0.04;

#[test]
fn alpha_is_one_minus_transmittance() {
    let color = [0.9, 0.6, 0.3];
    let mean = 0.6;
    let mut scene = sky([1.0; 3], false);
    let pane = glass(&mut scene, color, false, 0.0);
    quad(&mut scene, [-1.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], pane);
    look(&mut scene, 1e-3);
    let passes = 1.0 - 2.0 * R / (1.0 + R);
    assert_alpha("a pane", &scene, &clear(16, 64, 10), 1.0 - passes * mean);

    // From inside a glass sphere, through half a metre of it: radiance is scaled, but not the transmittance.
    let mut scene = sky([1.0; 3], false);
    let solid = glass(&mut scene, [0.64; 3], true, 0.0);
    sphere(&mut scene, [0.0, 0.0, 6.0], 0.5, solid);
    look(&mut scene, 1e-3);
    assert_alpha("from within", &scene, &clear(16, 256, 100), 1.0 - (1.0 - R) * 0.8);

    // Straight through the centre of a sphere of 2 m: internal reflections count as opaque.
    let mut scene = sky([1.0; 3], false);
    let solid = glass(&mut scene, color, true, 0.0);
    sphere(&mut scene, [0.0; 3], 1.0, solid);
    look(&mut scene, 1e-3);
    let left = (0.81 + 0.36 + 0.09) / 3.0;
    assert_alpha("a ball", &scene, &clear(16, 256, 100), 1.0 - (1.0 - R).powi(2) * left);

    // Two panes, one behind the other: inter-reflections count as reflected.
    let mut scene = sky([1.0; 3], false);
    let pane = glass(&mut scene, [1.0; 3], false, 0.0);
    for z in [0.0, 0.5] {
        quad(&mut scene, [-1.0, -1.0, z], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], pane);
    }
    look(&mut scene, 1e-3);
    assert_alpha("two panes", &scene, &clear(16, 256, 100), 1.0 - passes * passes);
}

/// Composited over the removed environment it equals the picture with it; sample by sample, up to rounding. Tinted glass has one
/// alpha for three channels: their mean is right.
#[test]
fn composite_over_the_sky_matches_the_render() {
    const SKY: f32 = 0.7;
    let of = |is_seen: bool, color: [f32; 3]| {
        let mut scene = sky([SKY; 3], is_seen);
        let solid = glass(&mut scene, color, true, 0.0);
        sphere(&mut scene, [-0.8, 0.0, 0.0], 1.0, solid);
        let pane = glass(&mut scene, color, false, 0.0);
        quad(&mut scene, [0.0, -1.0, 1.0], [1.5, 0.0, -0.5], [0.0, 2.0, 0.0], pane);
        let red = material(&mut scene, Material::lambert("red", [0.6, 0.2, 0.1]));
        sphere(&mut scene, [0.6, 0.0, -1.0], 0.5, red);
        look(&mut scene, 30.0);
        scene
    };
    let ways = [(Splitting::OFF, "off"), (Splitting::Into(4), "off"), (Splitting::OFF, "4x4")];
    for (color, is_grey) in [([0.8; 3], true), ([0.9, 0.6, 0.3], false)] {
        for (splitting, reuse) in ways {
            let reuse: PathReuse = reuse.parse().expect("a choice");
            let options = options(48, 16, 20).splitting(splitting).path_reuse(reuse);
            let full = picture(&of(true, color), &options).rgba();
            let film = picture(&of(false, color), &options.transparent_glass(true)).rgba();
            let mut seen = 0;
            for (full, own) in full.iter().zip(&film) {
                let over = |c: usize| f64::from(own[c]) + (1.0 - f64::from(own[3])) * f64::from(SKY);
                let mean = |of: &dyn Fn(usize) -> f64| (of(0) + of(1) + of(2)) / 3.0;
                let off = match is_grey {
                    true => (0..3).map(|c| (over(c) - f64::from(full[c])).abs()).fold(0.0, f64::max),
                    false => (mean(&over) - mean(&|c| f64::from(full[c]))).abs(),
                };
                assert!(off < 1e-5, "{splitting:?}, {reuse:?}: {off}: {own:?} for {full:?}");
                seen += usize::from(own[3] > 0.05 && own[3] < 0.95);
            }
            assert!(seen > 300, "{splitting:?}, {reuse:?}: only {seen} pixels are partly transparent");
        }
    }
}

/// By default nothing changes; reflections and other objects seen in glass are opaque; so is frosted glass, and suns are not
/// seen through transparent glass.
#[test]
fn everything_else_is_opaque() {
    let with = |roughness: f32, behind: bool| {
        let mut scene = sky([0.5; 3], false);
        let pane = glass(&mut scene, [1.0; 3], false, roughness);
        quad(&mut scene, [-1.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], pane);
        if behind {
            let wall = material(&mut scene, Material::lambert("wall", [0.5; 3]));
            quad(&mut scene, [-9.0, -9.0, -1.0], [18.0, 0.0, 0.0], [0.0, 18.0, 0.0], wall);
        }
        look(&mut scene, 5.0);
        scene
    };
    let alphas = |scene: &Scene, options: &RenderOptions| -> Vec<f32> {
        picture(scene, options).rgba().iter().map(|pixel| pixel[3]).collect()
    };
    let opaque = |alphas: Vec<f32>| alphas.iter().all(|alpha| *alpha == 1.0);
    assert!(opaque(alphas(&with(0.0, false), &options(8, 16, 10))));
    assert!(opaque(alphas(&with(0.4, false), &clear(8, 16, 10))));
    // Reflections towards the camera's side see the environment.
    assert!(opaque(alphas(&with(0.0, true), &clear(8, 16, 10))));
    assert!(!opaque(alphas(&with(0.0, false), &clear(8, 16, 10))));

    let mut scene = with(0.0, false);
    scene.environment = Environment::Black;
    scene.lights.push(Light::new(LightKind::Sun { direction: DVec3::Z, angle_rad: 0.6 }, [3.0; 3]));
    let film = picture(&scene, &clear(8, 64, 10));
    assert!(mean_of(&film, 1) == 0.0 && mean_of(&film, 3) < 0.2, "{:?}", film.mean_rgba(4, 4));
    assert!(mean_of(&picture(&scene, &options(8, 64, 10)), 1) > 1.0);
}

#[test]
fn alpha_is_independent_of_sample_order() {
    let mut scene = sky([0.5; 3], false);
    let solid = glass(&mut scene, [0.9, 0.6, 0.3], true, 0.0);
    sphere(&mut scene, [0.0; 3], 1.0, solid);
    look(&mut scene, 30.0);
    let options = clear(24, 21, 20);
    let of = |threads| in_pool(Some(threads), || picture(&scene, &options).rgba()).expect("threads");
    let one = of(1);
    assert_eq!(one, of(3));
    // Samples accumulated in any order have the same sum.
    let mut whole = picture(&scene, &clear(24, 8, 20).planned(16).sample_range((0, 8)));
    let rest = picture(&scene, &clear(24, 16, 20).sample_range((8, 16)));
    let mut other = rest.clone();
    other.merge_film(&whole);
    whole.merge_film(&rest);
    assert_eq!(whole.rgba(), other.rgba());
}
