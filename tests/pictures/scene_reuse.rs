//! Reuse of compiled scenes for other views and frames: the same pictures as compiled from scratch.

use crate::compile_scene::{place, square};
use crate::support::{camera, material, options, picture, quad};
use oscura::compile::{CompileOptions, Compiler, View, compile};
use oscura::film::Film;
use oscura::math::{DAffine3, DVec3};
use oscura::scene::{Environment, Material, MaterialId, Motion, Scene};
use std::sync::Arc;

/// A view of another camera of a scene compiled for the first.
#[test]
fn new_views_match_recompiled_scenes() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let grey = material(&mut scene, Material::lambert("grey", [0.6; 3]));
    quad(&mut scene, [-9.0, -1.0, 9.0], [18.0, 0.0, 0.0], [0.0, 0.0, -18.0], grey);
    crate::support::sphere(&mut scene, [0.0; 3], 1.0, grey);
    let at = |x: f64| camera(DVec3::new(x, 0.5, 5.0), DVec3::ZERO, DVec3::Y, 40.0);
    scene.cameras.extend([at(0.0), at(3.0)]);
    let options = options(24, 64, 8);
    let shot = |anchor: usize, camera: usize| {
        let anchor = Some(scene.cameras[anchor].world_from_camera.translation);
        let (compiled, _) =
            compile(&scene, &CompileOptions { anchor, ..CompileOptions::default() }).expect("compiles");
        let view = View::new(&compiled, &scene.cameras[camera], 24, 24);
        assert!(!view.needs_new_anchor(&compiled));
        crate::support::shot(&Arc::new(compiled), &scene.cameras[camera], &options)
    };
    let (own, others) = (shot(1, 1), shot(0, 1));
    let differing = |a: &Film, b: &Film| {
        let pixels = (0..24).flat_map(|y| (0..24).map(move |x| (x, y)));
        let far = |(p, q): ([f32; 4], [f32; 4])| (p[1] - q[1]).abs() > 1e-4;
        pixels.filter(|&(x, y)| far((a.mean_rgba(x, y), b.mean_rgba(x, y)))).count()
    };
    // Few paths diverge by rounding.
    assert!(differing(&own, &others) < 20, "{}", differing(&own, &others));
    assert!(differing(&own, &shot(0, 0)) > 200, "the cameras see different things");
}

#[test]
fn distant_cameras_need_a_new_anchor() {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    for x in [0.0, 1e4] {
        crate::support::sphere(&mut scene, [x, 0.0, 0.0], 1.0, grey);
    }
    let near = |x: f64, distance: f64| {
        let eye = DVec3::new(x, 0.0, 1.0 + distance);
        camera(eye, eye - DVec3::Z, DVec3::Y, 40.0)
    };
    scene.cameras.push(near(0.0, 3.0));
    let (compiled, _) = compile(&scene, &CompileOptions::default()).expect("compiles");
    let needs = |camera| View::new(&compiled, &camera, 1280, 720).needs_new_anchor(&compiled);
    assert!(!needs(near(0.0, 3.0)) && !needs(near(0.0, 0.01)) && !needs(near(100.0, 3.0)));
    // At ten kilometres: too far if the sphere is three metres away, acceptable at a hundred metres.
    assert!(needs(near(1e4, 3.0)) && !needs(near(1e4, 100.0)));
    let mut compiler = Compiler::sequence();
    for (camera, anchor) in [(near(0.0, 3.0), 0.0), (near(1e4, 3.0), 1e4)] {
        let shading = Default::default();
        let (compiled, _) = compiler.compile(&scene, shading, &camera, (64, 64)).expect("compiles");
        assert_eq!(compiled.anchor.x, anchor);
        assert!(!View::new(&compiled, &camera, 64, 64).needs_new_anchor(&compiled));
    }
}

/// Terrain of 80,000 triangles with a rotating wheel, and a flag with deformation.
fn moment(time: f64) -> Scene {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let grey = material(&mut scene, Material::lambert("grey", [0.6; 3]));
    let red = material(&mut scene, Material::lambert("red", [0.6, 0.1, 0.1]));
    scene.meshes.extend([square(200, grey), square(12, red), square(12, red)]);
    for p in &mut scene.meshes[2].positions {
        p[2] = 0.3 * (4.0 * p[0] + time as f32).sin();
    }
    place(&mut scene, 0, DAffine3::from_translation(-DVec3::Z) * DAffine3::from_scale(DVec3::splat(3.0)));
    let turn = DAffine3::from_rotation_z(time);
    place(&mut scene, 1, DAffine3::from_translation(DVec3::new(-0.6, 0.0, 0.2)) * turn);
    place(&mut scene, 2, DAffine3::from_translation(DVec3::new(0.6, 0.0, 0.3)));
    scene.instances[1].motion = Motion::Moves;
    scene.instances[2].motion = Motion::Deforms;
    scene.cameras.push(camera(DVec3::new(0.1 * time, 0.2, 4.0), DVec3::ZERO, DVec3::Y, 40.0));
    scene
}

#[test]
fn frames_reuse_static_geometry() {
    let mut compiler = Compiler::sequence();
    let mut world = None;
    for time in [0.0, 0.7, 1.4, 0.0] {
        let scene = moment(time);
        let camera = &scene.cameras[0];
        let (compiled, report) =
            compiler.compile(&scene, Default::default(), camera, (32, 32)).expect("compiles");
        compiled.accel.validate().expect("a sound structure");
        assert_eq!(report.triangles, 80_000 + 2 * 288);
        let kept = world.get_or_insert_with(|| compiled.geometries.world.clone());
        assert!(Arc::ptr_eq(kept, &compiled.geometries.world), "the world is built once");
        assert_eq!(compiled.geometries.placements.len(), 2);
        // Matches a single render: few paths diverge by rounding.
        let (a, b) = (
            crate::support::shot(&compiled, camera, &options(32, 16, 4)),
            picture(&scene, &options(32, 16, 4)),
        );
        let pixels = (0..32).flat_map(|y| (0..32).map(move |x| (x, y)));
        let far = |&(x, y): &(u32, u32)| (a.mean_rgba(x, y)[0] - b.mean_rgba(x, y)[0]).abs() > 1e-3;
        let elsewhere = pixels.filter(far).count();
        assert!(elsewhere < 40, "{elsewhere} of 1024 pixels differ at {time} s");
    }
    // A change of static geometry is detected.
    let mut scene = moment(0.0);
    scene.instances[0].world_from_object.translation.z -= 0.5;
    let camera = scene.cameras[0].clone();
    let (compiled, ..) = compiler.compile(&scene, Default::default(), &camera, (32, 32)).expect("compiles");
    assert!(!Arc::ptr_eq(&world.expect("a world"), &compiled.geometries.world));
    compiled.accel.validate().expect("a sound structure");
}

/// Sequences of few triangles are compiled as single pictures are.
#[test]
fn small_scenes_are_recompiled_each_frame() {
    let mut scene = moment(0.3);
    scene.meshes[0] = square(20, MaterialId(0));
    let mut compiler = Compiler::sequence();
    for x in [0.0, 0.5] {
        scene.cameras[0].world_from_camera.translation.x = x;
        let camera = scene.cameras[0].clone();
        let (compiled, _) =
            compiler.compile(&scene, Default::default(), &camera, (16, 16)).expect("compiles");
        assert!(compiled.geometries.placements.is_empty());
        let (a, b) = (
            crate::support::shot(&compiled, &camera, &options(16, 4, 4)),
            picture(&scene, &options(16, 4, 4)),
        );
        for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
            assert_eq!(a.mean_rgba(x, y), b.mean_rgba(x, y));
        }
    }
}
