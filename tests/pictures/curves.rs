//! Curves and hair against closed forms.

use crate::support::{assert_radiance, camera, material, options, picture, sphere};
use oscura::film::{Aov, AovSet};
use oscura::math::{DAffine3, DVec3};
use oscura::render::in_pool;
use oscura::scene::{
    Camera, ColorSlot, CurveBasis, Curves, Environment, FloatSlot, Light, LightKind, Material, MaterialId,
    Model, ObjectTraits, Projection, Scene,
};
use std::f64::consts::PI;

/// Strands of constant radius.
fn curves(scene: &mut Scene, basis: CurveBasis, strands: &[&[[f32; 3]]], radius: f32, material: MaterialId) {
    let points = strands.concat();
    scene.curves.push(Curves {
        name: "curves".into(),
        basis,
        strands: strands.iter().map(|s| s.len() as u32).collect(),
        radii: vec![radius; points.len()],
        points,
        colors: Vec::new(),
        world_from_object: DAffine3::IDENTITY,
        material,
        traits: ObjectTraits::default(),
        info: Default::default(),
    });
}

/// Sees 2 x 2 metres along -z.
fn flat_camera() -> Camera {
    let view = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1.0);
    Camera { projection: Projection::Orthographic { half_height: 1.0 }, ..view }
}

fn hair(color: f32, roughness: f32, radial: f32) -> Material {
    let model = Model::Hair {
        color: ColorSlot::constant([color; 3]),
        roughness: FloatSlot::constant(roughness),
        radial_roughness: FloatSlot::constant(radial),
        ior: 1.55,
        tilt_rad: 0.05,
        coat: FloatSlot::constant(0.0),
    };
    Material::new("hair", model)
}

fn bright() -> Scene {
    Scene { environment: Environment::Constant([1.0; 3]), cameras: vec![flat_camera()], ..Scene::default() }
}

/// A black strand occludes its outline: a rectangle with round ends, however thin it is and however it is segmented.
#[test]
fn strand_coverage_matches_outline() {
    for (radius, [x, y]) in [(0.004f32, [0.7f32, 0.0]), (0.02, [0.6, 0.5]), (0.1, [0.3, -0.6])] {
        for basis in [CurveBasis::Linear, CurveBasis::Bezier, CurveBasis::CatmullRom] {
            let mut scene = bright();
            let black = material(&mut scene, Material::lambert("black", [0.0; 3]));
            let strand: Vec<[f32; 3]> = (0..4)
                .map(|i| (i as f32 / 1.5 - 1.0).clamp(-1.0, 1.0))
                .map(|t| [x * t, y * t, 0.3 * t])
                .collect();
            curves(&mut scene, basis, &[&strand], radius, black);
            let (r, length) = (f64::from(radius), 2.0 * f64::from(x).hypot(f64::from(y)));
            let covered = (2.0 * r * length + PI * r * r) / 4.0;
            // The ends tilt towards the camera and away from it, which the outline doesn't show.
            let what = format!("thread of {radius}, {}", basis.name());
            assert_radiance(&what, &scene, &options(64, 64, 2), 1.0 - covered, 2e-4);
        }
    }
}

/// With a light at the camera, a diffuse cylinder of albedo a has radiance a / pi cos, a / 4 on average over its width.
#[test]
fn diffuse_strand_is_shaded_as_a_cylinder() {
    let mut scene = Scene { cameras: vec![flat_camera()], ..Scene::default() };
    let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
    curves(&mut scene, CurveBasis::Linear, &[&[[-3.0, 0.1, 0.0], [3.0, 0.1, 0.0]]], 0.4, grey);
    scene.lights.push(Light::new(LightKind::Directional { direction: DVec3::NEG_Z }, [PI as f32; 3]));
    assert_radiance("cylinder", &scene, &options(64, 64, 1), 0.8 * PI / 4.0 * 0.4, 1e-3);
}

/// White furnace: hair without absorption is invisible, whatever its shape and roughness, including multiple scattering.
#[test]
fn hair_in_a_white_furnace() {
    for (roughness, radial) in [(0.1, 0.2), (0.4, 0.4), (0.9, 0.8)] {
        let mut scene = bright();
        let clear = material(&mut scene, hair(1.0, roughness, radial));
        let strand = |k: i32| {
            let k = k as f32;
            let at = |t: f32| [0.25 * k + 0.3 * (3.0 * t).sin(), t, 0.2 * (k + 2.0 * t).cos()];
            [-1.2, -0.8, -0.3, 0.1, 0.5, 0.9, 1.3].map(at)
        };
        let all: Vec<[[f32; 3]; 7]> = (-4..=4).map(strand).collect();
        let all: Vec<&[[f32; 3]]> = all.iter().map(|s| &s[..]).collect();
        curves(&mut scene, CurveBasis::BSpline, &all, 0.08, clear);
        let what = format!("clear hair {roughness} {radial}");
        assert_radiance(&what, &scene, &options(32, 64, 500), 1.0, 1e-3);
    }
}

/// Dense hair converges to its target colour apart from surface reflection: more melanin is darker, and no hair exceeds white.
#[test]
fn hair_darkens_with_melanin() {
    let brightness = |color: f32| {
        let mut scene = bright();
        let fur = material(&mut scene, hair(color, 0.3, 0.3));
        let strands: Vec<[[f32; 3]; 2]> = (0..600)
            .map(|i| {
                let (x, z) = (-1.2 + 2.4 * (i % 60) as f32 / 59.0, -0.2 * (i / 60) as f32);
                [[x + 0.02 * (z * 10.0).sin(), -1.3, z], [x, 1.3, z - 0.1]]
            })
            .collect();
        let strands: Vec<&[[f32; 3]]> = strands.iter().map(|s| &s[..]).collect();
        curves(&mut scene, CurveBasis::Linear, &strands, 0.03, fur);
        crate::support::mean(&picture(&scene, &options(24, 64, 200)))
    };
    let all = [0.02, 0.2, 0.6, 0.95, 1.0].map(brightness);
    assert!(all.windows(2).all(|w| w[0] < w[1]) && all[4] < 1.003 && all[0] > 0.02, "{all:?}");
}

/// Texture coordinates run from root to tip, normals face the camera, and objects have their own ids.
#[test]
fn aovs_of_curves() {
    let mut scene = bright();
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    sphere(&mut scene, [0.0, -0.8, 0.0], 0.1, grey);
    curves(&mut scene, CurveBasis::Linear, &[&[[-0.9, 0.0, 0.0], [0.9, 0.0, 0.0]]], 0.3, grey);
    let aovs = AovSet::default().with(Aov::Uv).with(Aov::Normal).with(Aov::ObjectId);
    let film = picture(&scene, &options(40, 16, 1).aovs(aovs));
    let plane = |aov, component: usize| film.aov(aov).expect("it is kept").remove(component).into_floats();
    let (u, z, object) = (plane(Aov::Uv, 0), plane(Aov::Normal, 2), plane(Aov::ObjectId, 0));
    // The middle row, at pixels of 5 cm: along the strand from -0.9 to 0.9.
    let at = |x: usize| 20 * 40 + x;
    for x in 3..37 {
        let expected = ((x as f32 + 0.5) / 20.0 - 1.0 + 0.9) / 1.8;
        assert!((u[at(x)] - expected).abs() < 0.02, "{x}: {} {expected}", u[at(x)]);
        assert!(z[at(x)] > 0.98, "{x}: {}", z[at(x)]);
    }
    assert!(object[at(20)] != object[36 * 40 + 20], "{} {}", object[at(20)], object[36 * 40 + 20]);
}

/// The same pixels at any number of threads.
#[test]
fn curves_are_deterministic() {
    let mut scene = bright();
    let fur = material(&mut scene, hair(0.6, 0.3, 0.3));
    let strands: Vec<[[f32; 3]; 3]> = (0..50)
        .map(|i| [[-1.0 + 0.04 * i as f32, -1.0, 0.0], [0.3 * (i as f32).sin(), 0.0, 0.2], [0.5, 1.0, 0.1]])
        .collect();
    let strands: Vec<&[[f32; 3]]> = strands.iter().map(|s| &s[..]).collect();
    curves(&mut scene, CurveBasis::CatmullRom, &strands, 0.02, fur);
    let of = |threads| in_pool(Some(threads), || picture(&scene, &options(48, 8, 20))).expect("a pool");
    let (one, three) = (of(1), of(3));
    assert!(one.rgba().iter().zip(three.rgba()).all(|(a, b)| a.map(f32::to_bits) == b.map(f32::to_bits)));
}
