//! Softened shadow terminators on coarse smooth meshes, where nothing else casts shadows.

use crate::support::{camera, material, mean, options, picture, place};
use oscura::film::{Aov, AovSet, Values};
use oscura::math::DVec3;
use oscura::scene::{Environment, Light, LightKind, Material, Mesh, Scene, ShadowTerminator};
use std::f64::consts::{PI, TAU};

/// A coarse smooth-shaded sphere that is diffuse.
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
    place(&mut scene, mesh);
    scene.cameras.push(camera(DVec3::new(7.0, 1.3, 0.9), DVec3::ZERO, DVec3::Z, 16.0));
    scene
}

/// With offset shadow rays, a coarse sphere in sunlight follows its shading normals, also where its triangles face away:
/// Lambert's law with the interpolated normal. Cut off or softened, parts of it would be darker.
#[test]
fn coarse_sphere_is_lit_by_shading_normals() {
    let direction = DVec3::new(-0.3, -1.0, -0.2).normalize();
    let mut scene = ball(8, 12);
    scene.lights.push(Light::new(LightKind::Sun { direction, angle_rad: 1e-4 }, [1.0; 3]));
    let off = |terminator| {
        let options = options(48, 64, 1).terminator(terminator).aovs(AovSet::default().with(Aov::Normal));
        let picture = picture(&scene, &options);
        let planes = picture.aov(Aov::Normal).expect("asked for");
        let planes: Vec<Vec<f32>> = planes.into_iter().map(Values::into_floats).collect();
        let (mut lit, mut dark) = (0, 0);
        for (i, color) in picture.rgba().iter().enumerate() {
            let n = DVec3::new(planes[0][i].into(), planes[1][i].into(), planes[2][i].into());
            // Pixels on the outline or the terminator mix light and shadow.
            let cosine = -n.normalize_or_zero().dot(direction);
            if color[3] < 1.0 || n.length() < 0.99 || cosine < 0.1 {
                continue;
            }
            lit += 1;
            let expected = 0.277 / PI * cosine;
            dark += i32::from((f64::from(color[1]) / expected - 1.0).abs() > 0.02);
        }
        assert!(lit > 300, "{lit}");
        f64::from(dark) / f64::from(lit)
    };
    let (lifted, soft, cut) =
        (off(ShadowTerminator::Lifted), off(ShadowTerminator::Soft), off(ShadowTerminator::Off));
    println!("{lifted:.3} lifted, {soft:.3} soft, {cut:.3} cut off");
    assert!(lifted == 0.0 && soft > 0.02 && cut > 0.02, "{lifted} lifted, {soft} soft, {cut} cut off");
}

/// In a uniform environment it changes nothing, neither in total nor locally.
#[test]
fn coarse_sphere_in_a_furnace() {
    for (rings, around) in [(5, 8), (8, 12)] {
        let scene = Scene { environment: Environment::Constant([1.0; 3]), ..ball(rings, around) };
        let shown = |terminator| picture(&scene, &options(24, 2048, 3).terminator(terminator));
        let (soft, sharp) = (shown(ShadowTerminator::Soft), shown(ShadowTerminator::Off));
        let change = mean(&soft) / mean(&sharp) - 1.0;
        let most =
            soft.rgba().iter().zip(sharp.rgba()).map(|(a, b)| (a[1] / b[1] - 1.0).abs()).fold(0.0, f32::max);
        println!("{rings} x {around}: {change:.5} in all, at most {most:.5}");
        assert!(change.abs() < 0.002 && most < 0.01, "{rings} x {around}: {change} in all, at most {most}");
    }
}
