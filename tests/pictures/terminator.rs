//! The softened edge of self-shadowing on smooth shapes of few triangles, where there are no shadows.

use crate::support::{camera, material, mean, options, picture};
use oscura::math::{DAffine3, DVec3};
use oscura::scene::{Environment, Instance, Material, Mesh, Scene};
use std::f64::consts::{PI, TAU};

/// A ball of few triangles, shaded as a round one, that scatters evenly.
pub fn ball(rings: u32, around: u32) -> Scene {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.277; 3]));
    let row = around + 1;
    let at = |k: u32| {
        let (ring, step) = (k / row, k % row);
        let (polar, azimuth) =
            (f64::from(ring) / f64::from(rings) * PI, f64::from(step % around) / f64::from(around) * TAU);
        [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()].map(|x| x as f32)
    };
    let positions: Vec<[f32; 3]> = (0..(rings + 1) * row).map(at).collect();
    let faces = (0..rings).flat_map(|ring| (0..around).map(move |step| ring * row + step));
    let triangles = faces.flat_map(|a| [[a, a + row, a + row + 1], [a, a + row + 1, a + 1]]).collect();
    let mesh = Mesh { normals: positions.clone(), ..Mesh::new("ball", positions, triangles, grey) };
    let mesh = scene.add_mesh(mesh);
    scene.instances.push(Instance::new(mesh, DAffine3::IDENTITY));
    scene.cameras.push(camera(DVec3::new(7.0, 1.3, 0.9), DVec3::ZERO, DVec3::Z, 16.0));
    scene
}

/// In even light it changes nothing, neither in all nor in places.
#[test]
fn a_ball_of_few_triangles_keeps_even_light() {
    for (rings, around) in [(5, 8), (8, 12)] {
        let scene = Scene { environment: Environment::Constant([1.0; 3]), ..ball(rings, around) };
        let shown = |soft: bool| picture(&scene, &options(24, 2048, 3).soft_terminator(soft));
        let (soft, sharp) = (shown(true), shown(false));
        let change = mean(&soft) / mean(&sharp) - 1.0;
        let most =
            soft.rgba().iter().zip(sharp.rgba()).map(|(a, b)| (a[1] / b[1] - 1.0).abs()).fold(0.0, f32::max);
        println!("{rings} x {around}: {change:.5} in all, at most {most:.5}");
        assert!(change.abs() < 0.002 && most < 0.01, "{rings} x {around}: {change} in all, at most {most}");
    }
}
