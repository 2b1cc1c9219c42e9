//! Panoramic cameras: closed forms of their projections, and caustics seen by them.

use crate::support::differences::assert_same_means;
use crate::support::{assert_radiance, camera, dielectric, material, options, pbr, picture, quad, sphere};
use oscura::film::{Aov, AovSet};
use oscura::math::{DAffine3, DVec3};
use oscura::render::{Caustics, PathReuse, RenderOptions, Splitting};
use oscura::scene::{
    Camera, Environment, Keyframes, Light, LightKind, Material, Panorama, Projection, Scene, ThinLens,
};
use std::f64::consts::PI;

fn kinds() -> [Panorama; 3] {
    [
        Panorama::ALL_AROUND,
        Panorama::FisheyeEquidistant { fov_rad: 3.5 },
        Panorama::FisheyeEquisolid { fov_rad: 3.0, focal_length: 10.5, sensor: [36.0, 36.0] },
    ]
}

fn panorama(from: DVec3, at: DVec3, panorama: Panorama) -> Camera {
    let up = if (at - from).normalize().y.abs() > 0.9 { DVec3::Z } else { DVec3::Y };
    Camera { projection: Projection::Panorama(panorama), ..camera(from, at, up, 30.0) }
}

/// A uniform sky has its radiance wherever the projection is defined, and the rest is black.
#[test]
fn uniform_sky_is_uniform() {
    for kind in kinds() {
        let mut scene = Scene { environment: Environment::Constant([0.5, 0.25, 1.0]), ..Scene::default() };
        scene.cameras.push(panorama(DVec3::ZERO, DVec3::new(0.3, 0.2, -1.0), kind));
        let film = picture(&scene, &options(32, 16, 4));
        let mut shown = 0;
        for (x, y) in (0..32).flat_map(|y| (0..32).map(move |x| (x, y))) {
            let [r, g, b, _] = film.mean_rgba(x, y);
            let from_middle = (f64::from(x) - 15.5).hypot(f64::from(y) - 15.5) / 16.0;
            let is_in = match kind {
                Panorama::Equirectangular { .. } => true,
                Panorama::FisheyeEquidistant { .. } => from_middle < 0.95,
                // 21 mm sin(1.5 / 2) of 18.
                Panorama::FisheyeEquisolid { .. } => from_middle < 14.31 / 18.0 - 0.05,
            };
            let is_out =
                from_middle > if matches!(kind, Panorama::FisheyeEquisolid { .. }) { 0.85 } else { 1.05 };
            let expected = if is_in { [0.5, 0.25, 1.0] } else { [0.0; 3] };
            if is_in || is_out && !matches!(kind, Panorama::Equirectangular { .. }) {
                let near = [r, g, b].iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
                assert!(near, "{kind:?} {x} {y}: {r} {g} {b}");
            }
            shown += u32::from(is_in);
        }
        // The disks have areas of 0.90 and 0.56 of the square's pi / 4.
        assert!(shown > 400, "{kind:?}: {shown}");
    }
}

/// Depth is the distance from the camera in all directions; each pixel sees its direction.
#[test]
fn depth_is_the_distance() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    sphere(&mut scene, [0.0, 0.0, 0.0], 5.0, grey);
    for kind in kinds() {
        scene.cameras = vec![panorama(DVec3::ZERO, DVec3::new(0.3, 0.2, -1.0), kind)];
        let film = picture(&scene, &options(16, 4, 2).aovs(AovSet::default().with(Aov::Depth)));
        let plane = film.planes().find(|plane| plane.name == "Z").expect("depths");
        let depths = plane.values.into_floats();
        let seen = depths.iter().filter(|depth| (**depth - 5.0).abs() < 1e-3).count();
        assert!(seen > 120, "{kind:?}: {seen} {depths:?}");
    }
}

/// A camera that rotates by the same angle per frame: uniform motion vectors, also across the seam.
#[test]
fn motion_vectors_wrap_around_the_seam() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    sphere(&mut scene, [0.0, 0.0, 0.0], 5.0, grey);
    let mut view = panorama(DVec3::ZERO, DVec3::NEG_Z, Panorama::ALL_AROUND);
    let turned = |angle: f64| view.world_from_camera * DAffine3::from_rotation_y(angle);
    view.motion = Some(Keyframes { keys: Vec::new(), neighbours: Some([turned(0.3), turned(-0.3)]) });
    scene.cameras.push(view);
    let film = picture(&scene, &options(16, 4, 2).aovs(AovSet::default().with(Aov::Motion)));
    let planes: Vec<_> = film.planes().skip(4).collect();
    // A turn to the left moves everything right by the same number of pixels, also across the seam.
    let expected = 0.3 / (2.0 * PI) * 16.0;
    for (plane, sign) in planes.iter().zip([1.0, 0.0, -1.0, 0.0]) {
        let values = plane.values.clone().into_floats();
        assert!(
            values.iter().all(|v| (f64::from(*v) - sign * expected).abs() < 1e-2),
            "{}: {values:?}",
            plane.name
        );
    }
}

/// A mirror lights the floor as the mirrored light would, seen by an equidistant fisheye from above.
#[test]
fn a_point_and_its_image_in_a_mirror() {
    let mut scene = Scene::default();
    let polished = material(&mut scene, pbr("polished", [1.0; 3], 1.0, 0.0));
    quad(&mut scene, [1.5, 0.2, -0.6], [0.0, 0.0, 1.2], [0.0, 0.8, 0.0], polished);
    let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
    quad(&mut scene, [-20.0, 0.0, 20.0], [40.0, 0.0, 0.0], [0.0, 0.0, -40.0], grey);
    scene.lights.push(Light::new(LightKind::Point { position: DVec3::new(0.5, 1.0, 0.0) }, [5.0; 3]));
    // From 0.2 m, so that the mirror is out of view and all visible floor gets its reflection.
    let fov_rad = 1.0;
    let fisheye = Panorama::FisheyeEquidistant { fov_rad };
    scene.cameras.push(panorama(DVec3::new(0.0, 0.2, 0.0), DVec3::ZERO, fisheye));
    let from_point = |x: f64, z: f64, px: f64| {
        let squared = (px - x).powi(2) + 1.0 + z * z;
        1.0 / (squared * squared.sqrt())
    };
    let (mut sum, count) = (0.0, 200);
    for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
        let [a, b] = [i, j].map(|k| ((f64::from(k) + 0.5) / f64::from(count) - 0.5) * fov_rad);
        let angle = a.hypot(b);
        if angle < fov_rad / 2.0 {
            let out = 0.2 * angle.tan() / angle;
            sum += from_point(a * out, b * out, 0.5) + from_point(a * out, b * out, 2.5);
        }
    }
    let truth = 0.8 / PI * 5.0 * sum / f64::from(count * count);
    let options = options(16, 512, 4).caustics(Caustics::On);
    assert_radiance("mirror", &scene, &options, truth, 5e-3);
    scene.cameras[0].lens =
        Some(ThinLens { defocus_angle_rad: 0.02, focus_distance: 0.2, aperture: Default::default() });
    assert_radiance("mirror through a lens", &scene, &options, truth, 5e-3);
}

/// Options that differ in caustics only.
fn plain(options: RenderOptions) -> RenderOptions {
    options.path_reuse(PathReuse::Off).splitting(Splitting::OFF).filter(oscura::scene::Filter::BlackmanHarris)
}

/// A glass sphere on a floor, behind and below the camera: its caustic covers the seam and a pole of the picture.
fn stage(kind: Panorama) -> Scene {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.7, 0.6, 0.5]));
    quad(&mut scene, [-3.0, 0.0, 3.0], [6.0, 0.0, 0.0], [0.0, 0.0, -6.0], grey);
    let glass = material(&mut scene, dielectric(1.5));
    sphere(&mut scene, [0.1, 0.6, 0.1], 0.45, glass);
    let shine = material(&mut scene, Material::emitter("lamp", [3.0; 3], false));
    quad(&mut scene, [-1.6, 2.5, -1.6], [3.2, 0.0, 0.0], [0.0, 0.0, 3.2], shine);
    scene.cameras.push(panorama(DVec3::new(0.0, 0.6, 0.9), DVec3::new(0.0, 0.5, 3.0), kind));
    scene
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn light_tracing_matches_camera_paths() {
    for kind in kinds() {
        let mut scene = stage(kind);
        if kind != Panorama::ALL_AROUND {
            scene.cameras = vec![panorama(DVec3::new(0.0, 0.7, 1.2), DVec3::new(0.0, 0.0, 0.0), kind)];
        }
        // So many that camera paths often find the sphere's reflections at the edges of the floor: with 64 samples a block
        // there has one such path in all pictures, or none.
        let off = plain(options(32, 512, 12)).caustics(Caustics::Off);
        assert_same_means("panorama", &scene, [&off, &off.caustics(Caustics::On)], 32);
        scene.cameras[0].lens =
            Some(ThinLens { defocus_angle_rad: 0.2, focus_distance: 1.0, aperture: Default::default() });
        assert_same_means("through a lens", &scene, [&off, &off.caustics(Caustics::On)], 32);
    }
}
