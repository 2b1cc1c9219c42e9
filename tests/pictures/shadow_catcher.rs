//! Shadow catchers composited over a backplate, against renders of the full scene.

use crate::spectral::pixels;
use crate::support::{camera, material, options, picture, quad, rendering, sphere};
use oscura::film::AovSet;
use oscura::math::DVec3;
use oscura::render::{PassOutcome, RenderOptions, denoising_guides};
use oscura::scene::{CatcherOutput, Environment, Light, Material, ObjectTraits, Scene};

const SEEDS: u32 = 10;
const SIZE: u32 = 16;
const BLOCK: u32 = 4;

/// A coloured sphere on a floor with an area light, a small sun and the sky.
fn scene(has_ball: bool, glow: f32) -> Scene {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.6, 0.5, 0.4]));
    let red = material(&mut scene, Material::lambert("red", [0.8, 0.1, 0.1]));
    let lamp = material(&mut scene, Material::emitter("lamp", [6.0; 3], false));
    quad(&mut scene, [-40.0, 0.0, 40.0], [80.0, 0.0, 0.0], [0.0, 0.0, -80.0], grey);
    scene.quads[0].name = "floor".into();
    quad(&mut scene, [1.0, 4.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], lamp);
    scene.lights.push(Light::directional([0.5, -1.0, -0.2], [0.5, 0.6, 0.4]));
    scene.environment = Environment::Constant([0.2, 0.25, 0.3]);
    if has_ball {
        sphere(&mut scene, [0.0, 0.8, 0.0], 0.8, red);
        if glow > 0.0 {
            scene.materials[red.index()] = Material {
                emission: Material::emitter("glow", [glow; 3], true).emission,
                ..Material::lambert("red", [0.8, 0.1, 0.1])
            };
        }
    }
    scene.cameras.push(camera(DVec3::new(0.0, 2.5, 6.0), DVec3::new(0.0, 0.5, 0.0), DVec3::Y, 40.0));
    scene
}

/// Block means per channel over several seeds; `finish` maps a pixel's RGBA and index to its colour.
fn blocks(
    scene: &Scene,
    options: &RenderOptions,
    spectral: bool,
    finish: impl Fn([f32; 4], usize) -> [f32; 3],
) -> Vec<Vec<f64>> {
    let of_seed = |seed| {
        let pixels = pixels(scene, &options.seed(31 * seed + 7), spectral);
        let columns = SIZE / BLOCK;
        let mut sums = vec![0.0; (3 * columns * columns) as usize];
        for (i, rgba) in pixels.into_iter().enumerate() {
            let (x, y) = (i as u32 % SIZE / BLOCK, i as u32 / SIZE / BLOCK);
            for (c, v) in finish(rgba, i).into_iter().enumerate() {
                sums[3 * (y * columns + x) as usize + c] += f64::from(v) / f64::from(BLOCK * BLOCK);
            }
        }
        sums
    };
    (0..SEEDS).map(of_seed).collect()
}

fn mean_and_error(runs: &[Vec<f64>], i: usize) -> (f64, f64) {
    let n = f64::from(SEEDS);
    let mean = runs.iter().map(|run| run[i]).sum::<f64>() / n;
    let variance = runs.iter().map(|run| (run[i] - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

fn rgb([r, g, b, _]: [f32; 4], _: usize) -> [f32; 3] {
    [r, g, b]
}

#[test]
fn composite_over_plate_matches_full_render() {
    for (what, glow, spectral) in
        [("a red ball", 0.0, false), ("a ball that glows", 3.0, false), ("a ball by wavelength", 3.0, true)]
    {
        let plain = options(SIZE, 256, 4);
        let plate = pixels(&scene(false, 0.0), &options(SIZE, 4096, 4), spectral);
        let truth = blocks(&scene(true, glow), &plain, spectral, rgb);
        let mut caught = scene(true, glow);
        let traits = ObjectTraits { is_shadow_catcher: true, ..ObjectTraits::default() };
        caught.set_object_traits("floor", traits);
        let over = |[r, g, b, a]: [f32; 4], i: usize| {
            let behind = plate[i];
            [r + (1.0 - a) * behind[0], g + (1.0 - a) * behind[1], b + (1.0 - a) * behind[2]]
        };
        // Where there is no floor, the plate shows the sky.
        let hidden = Scene {
            environment_visible_to: oscura::scene::RayKinds::ALL.without(oscura::scene::RayKinds::CAMERA),
            ..caught
        };
        let found = blocks(&hidden, &plain.catchers(true), spectral, over);
        let (mut sum, mut worst) = (0.0, 0.0f64);
        for i in 0..truth[0].len() {
            let ((a, of_a), (b, of_b)) = (mean_and_error(&truth, i), mean_and_error(&found, i));
            // The plate's own noise is that of 4096 samples, at most a quarter of that of one seed of the reference.
            let plate = of_a * (256.0 * f64::from(SEEDS) / 4096.0).sqrt();
            let z = (a - b) / (of_a * of_a + of_b * of_b + plate * plate).sqrt().max(1e-4);
            sum += z * z;
            worst = worst.max(z.abs());
        }
        let rms = (sum / truth[0].len() as f64).sqrt();
        println!("{what}: z rms {rms:.2}, worst {worst:.2}");
        assert!(rms < 1.4 && worst < 5.0, "{what}: z rms {rms}, worst {worst}");
    }
}

/// Far from all objects the catcher is fully transparent without noise; under a sphere it has the shadow.
#[test]
fn catchers_are_transparent_without_shadows() {
    let mut scene = scene(true, 0.0);
    scene.environment = Environment::Black;
    let traits = ObjectTraits { is_shadow_catcher: true, ..ObjectTraits::default() };
    scene.set_object_traits("floor", traits);
    scene.cameras[0] = camera(DVec3::new(30.0, 2.0, 30.0), DVec3::new(30.0, 0.0, 30.0), DVec3::Z, 5.0);
    let film = picture(&scene, &options(4, 8, 1).catchers(true));
    assert!(film.rgba().iter().all(|pixel| *pixel == [0.0; 4]), "{:?}", film.rgba());
    scene.quads.remove(1);
    // In the shadow of the ball from the sun alone.
    scene.cameras[0] = camera(DVec3::new(0.4, 0.02, 1.6), DVec3::new(0.4, 0.0, -0.16), DVec3::Y, 0.01);
    let film = picture(&scene, &options(4, 8, 1).catchers(true));
    assert!(film.rgba().iter().all(|pixel| *pixel == [0.0, 0.0, 0.0, 1.0]), "{:?}", film.rgba());
}

/// Without indirect colour from objects, alpha is 1 minus the mean shadow ratio.
#[test]
fn shadows_without_indirect_light_are_colourless() {
    let mut scene = scene(true, 0.0);
    scene.set_object_traits("floor", ObjectTraits { is_shadow_catcher: true, ..ObjectTraits::default() });
    // The floor next to the sphere, partly in shadow.
    scene.cameras[0] = camera(DVec3::new(1.1, 1.0, 0.4), DVec3::new(1.1, 0.0, 0.4), DVec3::Z, 40.0);
    let options = options(8, 64, 4).catchers(true);
    let mut alone = options;
    alone.caught = CatcherOutput::Shadows;
    let (all, shadows) = (picture(&scene, &options), picture(&scene, &alone));
    let factors = ["R", "G", "B"].map(|channel| {
        let plane = shadows.plane(&format!("ShadowCatcher.{channel}"));
        plane.expect("the layer").into_floats()
    });
    for (i, (all, only)) in all.rgba().into_iter().zip(shadows.rgba()).enumerate() {
        let alpha = 1.0 - factors.iter().map(|of| of[i]).sum::<f32>() / 3.0;
        assert!(alpha > 0.01 && only[..3] == [0.0; 3] && (only[3] - alpha).abs() < 1e-5, "{only:?} {alpha}");
        // The ball is red.
        assert!(all[0] > 1e-3 && all[3] > only[3] + 1e-3, "{all:?} {only:?}");
    }
}

/// Denoising changes the light on catchers, not their alpha coverage.
#[test]
fn denoising_keeps_shadow_alpha() {
    let mut scene = scene(true, 0.0);
    scene.set_object_traits("floor", ObjectTraits { is_shadow_catcher: true, ..ObjectTraits::default() });
    scene.cameras[0] = camera(DVec3::new(1.1, 2.0, 0.4), DVec3::new(1.1, 0.0, 0.4), DVec3::Z, 50.0);
    let options = options(32, 64, 4).catchers(true).halves(true).aovs(denoising_guides());
    let alpha = |is_denoised: bool| {
        let mut rendering = rendering(&scene, &options);
        assert_eq!(rendering.run(), PassOutcome::Done);
        if is_denoised {
            rendering.denoise(AovSet::NONE);
        }
        let film = rendering.into_picture().into_film();
        film.rgba().iter().map(|pixel| f64::from(pixel[3])).sum::<f64>() / 1024.0
    };
    let (noisy, denoised) = (alpha(false), alpha(true));
    assert!(noisy > 0.05 && (denoised / noisy - 1.0).abs() < 0.05, "{noisy} {denoised}");
}
