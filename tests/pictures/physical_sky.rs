//! The physical sky as a light: the irradiance of horizontal ground, and the visible sun disk.

use crate::support::{assert_radiance, camera, material, measure, options, quad};
use oscura::load::sky::PhysicalSky;
use oscura::math::DVec3;
use oscura::scene::{Material, Scene};
use std::f64::consts::PI;

fn sky(elevation: f64) -> PhysicalSky {
    PhysicalSky { sun_elevation_rad: elevation.to_radians(), turbidity: 4.0, ..PhysicalSky::default() }
}

/// Irradiance of the sky on horizontal ground by quadrature in the squared cosine.
fn irradiance(sky: &PhysicalSky) -> [f64; 3] {
    let (mut sum, n) = ([0.0; 3], 300);
    for row in 0..n {
        let y = ((f64::from(row) + 0.5) / f64::from(n)).sqrt();
        for column in 0..n {
            let (z, x) = ((f64::from(column) + 0.5) / f64::from(n) * 2.0 * PI).sin_cos();
            let sin = (1.0 - y * y).sqrt();
            let from = sky.radiance(DVec3::new(sin * x, y, sin * z));
            (0..3).for_each(|c| sum[c] += from[c] * PI / f64::from(n * n));
        }
    }
    sum
}

/// The channel that is measured.
fn green(rgb: [f64; 3]) -> f64 {
    rgb[1]
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn ground_reflects_the_irradiance_of_sun_and_sky() {
    for (elevation, has_sun) in [(50.0, true), (12.0, true), (50.0, false)] {
        let sky = PhysicalSky { has_sun, ..sky(elevation) };
        let mut scene = Scene::default();
        sky.add_to(&mut scene).unwrap();
        let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
        quad(&mut scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], grey);
        scene.cameras.push(camera(DVec3::new(-3.0, 1.0, -2.0), DVec3::ZERO, DVec3::Y, 1e-3));
        let direct = if has_sun { green(sky.sun_irradiance()) * sky.to_sun().y } else { 0.0 };
        let truth = 0.5 * (direct + green(irradiance(&sky))) / PI;
        let (mean, error) = measure(&scene, &options(16, 1024, 1));
        // The sky texture is bilinear between its texels.
        assert!(
            (mean / truth - 1.0).abs() < 1e-3 && error < 2e-4 * truth,
            "{elevation}: {mean} {error} {truth}"
        );
    }
}

/// The camera looks at the centre of the sun, and next to it.
#[test]
fn sun_disk_is_visible() {
    let sky = PhysicalSky { sun_angle_rad: 0.05, sun_azimuth_rad: 2.0, strength: 0.5, ..sky(30.0) };
    let mut scene = Scene::default();
    sky.add_to(&mut scene).unwrap();
    scene.cameras.push(camera(DVec3::ZERO, sky.to_sun(), DVec3::Y, 1e-3));
    let disk = green(sky.sun_irradiance()) / (PI * 0.025f64.sin().powi(2));
    let truth = 0.5 * (disk + green(sky.radiance(sky.to_sun())));
    // The aureole is bilinear between texels.
    assert_radiance("into the sun", &scene, &options(16, 16, 1), truth, 2e-3);
    let mut hidden = scene.clone();
    hidden.environment_sun = None;
    let aureole = measure(&hidden, &options(16, 16, 1)).0;
    assert!((aureole / (0.5 * green(sky.radiance(sky.to_sun()))) - 1.0).abs() < 0.03, "{aureole}");
    // Rotated away with the sky texture.
    scene.set_environment_rotation(1.0);
    let turned = oscura::math::DQuat::from_rotation_y(1.0) * sky.to_sun();
    scene.cameras[0] = camera(DVec3::ZERO, turned, DVec3::Y, 1e-3);
    assert_radiance("the sun turned", &scene, &options(16, 16, 1), truth, 2e-3);
}
