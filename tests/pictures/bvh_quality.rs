//! BVH quality changes no pixel.

use super::compile_scene::{place, square};
use super::support::{camera, material, options, quad, shot, sphere};
use oscura::accel::TreeQuality;
use oscura::compile::{BvhPolicy, CompileOptions, compile};
use oscura::math::{DAffine3, DVec3};
use oscura::render::{BvhQuality, RenderOptions, RequestedOptions};
use oscura::scene::{Environment, Material, Scene};
use std::sync::Arc;
use std::time::Duration;

/// Terrain of `2 n n` triangles under an area light and a bright sky, with a sphere above.
fn hills(n: u32) -> Scene {
    let mut scene = Scene { environment: Environment::Constant([0.3, 0.4, 0.5]), ..Scene::default() };
    let ground = material(&mut scene, Material::lambert("ground", [0.7, 0.6, 0.5]));
    let lamp = material(&mut scene, Material::emitter("lamp", [9.0; 3], true));
    let mut mesh = square(n, ground);
    for [x, y, z] in &mut mesh.positions {
        *z = 0.06 * (11.0 * *x).sin() * (13.0 * *y).cos() + 0.02 * (40.0 * *x + 31.0 * *y).sin();
    }
    scene.meshes.push(mesh);
    place(&mut scene, 0, DAffine3::IDENTITY);
    quad(&mut scene, [-0.1, -0.1, 0.6], [0.2, 0.0, 0.0], [0.0, 0.2, 0.0], lamp);
    sphere(&mut scene, [0.1, 0.05, 0.15], 0.08, ground);
    scene.cameras.push(camera(DVec3::new(0.0, -1.2, 0.9), DVec3::ZERO, DVec3::Z, 40.0));
    scene
}

#[test]
fn bvh_quality_keeps_pixels() {
    // The high-quality BVH is built whole, then in parts; the fast one in parts both times.
    for n in [120, 370] {
        let scene = hills(n);
        let [fast, full] = [(BvhPolicy::Fast, TreeQuality::Fast), (BvhPolicy::Full, TreeQuality::Full)].map(
            |(tree, quality)| {
                let options_of_tree = CompileOptions { bvh: tree, ..CompileOptions::default() };
                let (compiled, report) = compile(&scene, &options_of_tree).expect("the scene compiles");
                assert_eq!(report.bvh, quality);
                let film = shot(&Arc::new(compiled), &scene.cameras[0], &options(48, 8, 20));
                film.rgba().into_iter().map(|pixel| pixel.map(f32::to_bits)).collect::<Vec<_>>()
            },
        );
        assert!(fast == full, "{n}");
    }
}

#[test]
fn bvh_quality_depends_on_options_only() {
    let scene = hills(2);
    let tree = |requested: RequestedOptions, pictures: u64| {
        requested.resolve(&scene).expect("settled").bvh(pictures)
    };
    let camera_rays = 1280 * 720 * 128;
    assert_eq!(tree(RequestedOptions::default(), 1), BvhPolicy::For { camera_rays });
    assert_eq!(tree(RequestedOptions::default(), 10), BvhPolicy::For { camera_rays: 10 * camera_rays });
    let limited = RequestedOptions {
        options: RenderOptions::default().time_limit(Duration::from_secs(2)),
        ..RequestedOptions::default()
    };
    assert_eq!(tree(limited, 1), BvhPolicy::For { camera_rays: 2_000_000 });
    for (choice, expected) in [(BvhQuality::Fast, BvhPolicy::Fast), (BvhQuality::Full, BvhPolicy::Full)] {
        assert_eq!(tree(RequestedOptions { bvh: choice, ..RequestedOptions::default() }, 1), expected);
    }
}
