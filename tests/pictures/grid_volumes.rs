//! Grid volumes with arbitrary transforms and coloured coefficients, against closed forms and quadrature.

use crate::support::{assert_radiance, camera, grey_floor, material, options, picture, sphere, walls};
use oscura::compile::{CompileOptions, compile};
use oscura::math::{DAffine3, DMat3, DVec3};
use oscura::render::RenderOptions;
use oscura::scene::{
    Camera, Environment, Grid, Instance, Keyframes, Light, LightKind, Material, Medium, Mesh, Model, Motion,
    Projection, Scene,
};
use std::f64::consts::PI;
use std::sync::Arc;

/// Parallel rays along -z, next to each other.
fn beam(from: [f64; 3]) -> Camera {
    let from = DVec3::from(from);
    let mut view = camera(from, from - DVec3::Z, DVec3::Y, 1.0);
    view.projection = Projection::Orthographic { half_height: 1e-3 };
    view
}

/// A sphere of a medium around the origin, seen along one ray.
fn ball(medium: Medium, grid: Grid, radius: f64, environment: f32) -> Scene {
    let mut scene = Scene { environment: Environment::Constant([environment; 3]), ..Scene::default() };
    let medium = Some(Medium { grid: Some(scene.add_grid(grid)), ..medium });
    let filled = material(&mut scene, Material { medium, ..Material::new("body", Model::Boundary {}) });
    sphere(&mut scene, [0.0; 3], radius, filled);
    scene.cameras.push(beam([0.1, 0.2, 2.0 * radius]));
    scene
}

fn medium(extinction: [f32; 3], albedo: f32) -> Medium {
    Medium { albedo: [albedo; 3], anisotropy: 0.3, ..Medium::scattering(extinction) }
}

/// The mean of all pixels, by channel.
fn channels(scene: &Scene, options: &RenderOptions) -> [f64; 3] {
    let film = picture(scene, options);
    let count = options.width * options.height;
    let of_pixel = |i: u32| film.mean_rgba(i % options.width, i / options.width);
    [0, 1, 2].map(|c| (0..count).map(|i| f64::from(of_pixel(i)[c])).sum::<f64>() / f64::from(count))
}

fn assert_channels(what: &str, scene: &Scene, options: &RenderOptions, truth: [f64; 3], precision: f64) {
    let found = channels(scene, options);
    let is_close = |c: usize| (found[c] / truth[c] - 1.0).abs() < precision;
    assert!((0..3).all(is_close), "{what}: {found:?}, truth {truth:?}");
}

/// Rotated, sheared, scaled and mirrored grids: transmittance agrees with ray marching through the voxels.
#[test]
fn transformed_grids() {
    let (x, y, z) = (DVec3::new(0.3, -0.9, 1.1), DVec3::new(1.9, 0.5, 0.3), DVec3::new(0.4, 1.7, -0.8));
    for sign in [1.0, -1.0] {
        let turned = DMat3::from_cols(x * sign, y, z);
        let world_from_voxels = DAffine3::from_mat3_translation(turned, -turned * DVec3::new(1.0, 0.5, 0.5));
        let values = Arc::new(vec![0.5, 3.0]);
        let grid = Grid { name: "turned".into(), size: [2, 1, 1], values, world_from_voxels };
        let scene = ball(medium([0.7; 3], 0.0), grid, 4.0, 1.0);
        let (voxels_from_world, steps) = (world_from_voxels.inverse(), 100_000);
        let depth: f64 = (0..steps)
            .map(|i| {
                let height = 4.0 - 8.0 * (f64::from(i) + 0.5) / f64::from(steps);
                let at = voxels_from_world.transform_point3(DVec3::new(0.1, 0.2, height));
                let is_inside = at.min_element() >= 0.0 && at.y <= 1.0 && at.z <= 1.0 && at.x <= 2.0;
                let value = 0.5 + 2.5 * (at.x - 0.5).clamp(0.0, 1.0);
                if is_inside { 0.7 * value * 8.0 / f64::from(steps) } else { 0.0 }
            })
            .sum();
        assert!(depth > 0.3, "the ray meets the grid: {depth}");
        assert_radiance(&format!("sign {sign}"), &scene, &options(16, 256, 4), (-depth).exp(), 4e-3);
    }
}

/// Chromatic extinction: transmittance, single scattering of a light, and a white furnace.
#[test]
fn chromatic_grid_volumes() {
    let grid = |value: &dyn Fn(usize) -> f32| {
        let values = Arc::new((0..19 * 8 * 30).map(value).collect());
        Grid::in_box("smoke".into(), [19, 8, 30], values, DVec3::splat(-2.0), DVec3::splat(2.0))
    };
    let extinction = [0.1f32, 0.15, 0.02];
    let sigma = extinction.map(|x| 4.0 * f64::from(x));
    let half = (1.0f64 - 0.1 * 0.1 - 0.2 * 0.2).sqrt();

    let through = ball(medium(extinction, 0.0), grid(&|_| 4.0), 1.0, 1.0);
    let truth = sigma.map(|s| (-s * 2.0 * half).exp());
    assert_channels("through", &through, &options(32, 1024, 4), truth, 6e-3);

    let mut lit = ball(medium(extinction, 0.8), grid(&|_| 4.0), 1.0, 0.0);
    lit.lights.push(Light::new(LightKind::Directional { direction: DVec3::NEG_Y }, [3.0; 3]));
    let phase = (1.0 - 0.3f64 * 0.3) / (4.0 * PI * (1.0 + 0.3f64 * 0.3).powf(1.5));
    let steps = 20_000;
    let truth = sigma.map(|s| {
        let step = 2.0 * half / f64::from(steps);
        let at = |i: i32| {
            let t = (f64::from(i) + 0.5) * step;
            let up = (1.0 - 0.1 * 0.1 - (half - t) * (half - t)).sqrt() - 0.2;
            0.8 * s * (-s * (t + up)).exp() * phase * 3.0 * step
        };
        (0..steps).map(at).sum()
    });
    assert_channels("one scattering", &lit, &options(32, 1024, 1), truth, 1.5e-2);

    let uneven = grid(&|i| (i % 7) as f32 * 3.0);
    let furnace = ball(medium(extinction, 1.0), uneven, 1.0, 1.0);
    assert_channels("furnace", &furnace, &options(32, 128, 3000), [1.0; 3], 1e-2);
}

/// A sphere of a medium in a larger rotated grid, of emission 1 times the grid's values.
fn emissive_sphere(scene: &mut Scene, center: DVec3, radius: f64, values: [f32; 8], of: Medium) {
    let turned = DMat3::from_rotation_y(0.4) * DMat3::from_rotation_x(0.7) * (1.1 * radius);
    let world_from_voxels = DAffine3::from_mat3_translation(turned, center - turned * DVec3::ONE);
    let grid =
        Grid { name: "fire".into(), size: [2; 3], values: Arc::new(values.to_vec()), world_from_voxels };
    let medium = Some(Medium { grid: Some(scene.add_grid(grid)), emission: [1.0, 0.5, 0.25], ..of });
    let fire = material(scene, Material { medium, ..Material::new("fire", Model::Boundary {}) });
    sphere(scene, center.to_array(), radius, fire);
}

/// A uniformly emissive sphere without extinction lights a floor as a point light at its centre (Newton's shell theorem). Light
/// samples find it: the noise comes from the part of the grid outside of the sphere.
#[test]
fn emissive_volumes_are_sampled_as_lights() {
    for (what, center, radius) in [
        ("from afar", DVec3::new(2.0, 5.0, -1.0), 0.1),
        ("nearby", DVec3::new(0.3, 0.6, 0.2), 0.5),
        ("next to it", DVec3::new(0.1, 0.4, 0.1), 0.399),
    ] {
        let mut scene = grey_floor();
        emissive_sphere(&mut scene, center, radius, [2.0; 8], medium([0.0; 3], 0.0));
        let emitted = 2.0 * 4.0 / 3.0 * PI * radius.powi(3);
        let truth = 0.8 / PI * emitted * center.y / center.length().powi(3);
        assert_radiance(what, &scene, &options(16, 16, 1), 0.5 * truth, 8e-3);
        let Some(fire) = scene.materials.iter_mut().find(|m| m.name == "fire") else { panic!("it burns") };
        fire.medium = fire.medium.map(|medium| Medium { grid: None, emission: [2.0, 1.0, 0.5], ..medium });
        assert_radiance(&format!("{what}, homogeneous"), &scene, &options(16, 16, 1), 0.5 * truth, 8e-3);
    }
}

/// Kirchhoff: in a closed white room the radiance is that of a black body, whatever scatters and however the density varies,
/// since emission equals absorption.
#[test]
fn emissive_volume_in_a_closed_room_is_in_equilibrium() {
    for albedo in [0.0, 0.6] {
        let mut scene = Scene::default();
        let white = material(&mut scene, Material::lambert("white", [1.0; 3]));
        walls(&mut scene, [2.0; 3], |_, _| white);
        let extinction = [2.0, 1.0, 0.5].map(|e| e / (1.0 - albedo));
        let values = [3.0, 1.0, 0.5, 2.0, 1.0, 4.0, 2.0, 1.0];
        emissive_sphere(&mut scene, DVec3::new(-0.5, 0.2, 0.0), 1.2, values, medium(extinction, albedo));
        scene.cameras.push(camera(DVec3::new(1.5, -1.5, 1.0), DVec3::new(-1.0, 0.0, -1.0), DVec3::Y, 60.0));
        assert_radiance(&format!("albedo {albedo}"), &scene, &options(16, 16, 300), 0.5, 6e-3);
    }
}

/// A grid is fixed in world space; media that move relative to it are reported by name.
#[test]
fn objects_moving_relative_to_their_grid_are_reported() {
    let grid = || Grid::in_box("smoke".into(), [1; 3], Arc::new(vec![1.0]), DVec3::splat(-1.0), DVec3::ONE);
    let still = ball(medium([0.5; 3], 0.5), grid(), 1.0, 1.0);
    let places = [0.0, 0.5].map(|x| DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)));
    let keys = |keys: [DAffine3; 2]| Keyframes { keys: keys.to_vec(), neighbours: None };
    let mut of_shape = still.clone();
    of_shape.motion.shapes.insert(0, keys(places));
    let mut of_instance = still.clone();
    let body = of_instance.shapes.remove(0).material;
    let triangles = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let positions = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mesh = of_instance.add_mesh(Mesh::new("tetrahedron", positions, triangles, body));
    of_instance.motion.instances.push(keys(places));
    let instance = Instance::new(mesh, DAffine3::IDENTITY);
    of_instance.instances.push(Instance { name: "puff".into(), motion: Motion::Keyed(0), ..instance });
    let mut resting = of_instance.clone();
    resting.motion.instances[0] = keys([DAffine3::IDENTITY; 2]);
    let mut animated = of_instance.clone();
    animated.instances[0].motion = Motion::Moves;
    let mut homogeneous = of_instance.clone();
    homogeneous.materials[body.index()].medium = Some(medium([0.5; 3], 0.5));
    for (what, scene, name) in [
        ("still", still, None),
        ("a shape", of_shape, Some("sphere")),
        ("an instance", of_instance, Some("puff")),
        ("an animation", animated, Some("puff")),
        ("keys that are the same", resting, None),
        ("no grid", homogeneous, None),
    ] {
        let (_, report) = compile(&scene, &CompileOptions::default()).expect("the scene compiles");
        let reported = report.warnings.iter().map(ToString::to_string).find(|w| w.contains("is static"));
        assert_eq!(reported.is_some(), name.is_some(), "{what}: {reported:?}");
        if let (Some(reported), Some(name)) = (reported, name) {
            assert!(
                reported.contains(&format!("'{name}'")) && reported.contains("'body'"),
                "{what}: {reported}"
            );
        }
    }
}
