//! Facing textures (lookup by the angle of view): closed forms, and the same mean with all techniques.

use crate::support::differences::{assert_same_bits, assert_same_means};
use crate::support::{
    assert_radiance, camera, material, measure, options, pbr, picture, quad, sphere, walls,
};
use oscura::math::DVec3;
use oscura::render::{Caustics, Guiding, PathReuse, RenderOptions, Splitting};
use oscura::scene::{
    AlphaMode, ColorSlot, Emission, Environment, FloatSlot, Light, LightKind, Mapping, Material, Model,
    PbrMaterial, Scene, Texture, TextureId,
};

/// Values at the cosines 0, 0.5 and 1.
const RAMP: [f32; 3] = [0.1, 0.9, 0.3];

fn ramp(scene: &mut Scene, values: &[f32]) -> TextureId {
    scene.add_texture(Texture::Facing(values.iter().map(|v| [*v; 3]).collect()))
}

/// A large sheet through the origin, seen at an angle of this cosine from its front or its back, in a uniform environment of
/// radiance 1.
fn sheet(cosine: f64, from_behind: bool, of: impl FnOnce(TextureId) -> Material) -> Scene {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let texture = ramp(&mut scene, &RAMP);
    let sheet = material(&mut scene, Material { double_sided: true, ..of(texture) });
    let side = if from_behind { -1.0 } else { 1.0 };
    quad(&mut scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], sheet);
    let sine = (1.0 - cosine * cosine).sqrt();
    scene.cameras.push(camera(DVec3::new(sine, side * cosine, 0.0), DVec3::ZERO, DVec3::Z, 0.01));
    scene
}

fn painted(texture: TextureId) -> Material {
    Material {
        model: Model::Lambert { albedo: ColorSlot::texture(texture) },
        ..Material::lambert("painted", [0.8; 3])
    }
}

fn emissive(texture: TextureId) -> Material {
    let emission = Some(Emission { radiance: ColorSlot::texture(texture), two_sided: true });
    Material { emission, ..Material::new("emissive", Model::Black) }
}

fn thin(texture: TextureId) -> Material {
    let alpha = FloatSlot::texture(texture, 0);
    Material { alpha, alpha_mode: AlphaMode::Blend, ..Material::new("thin", Model::Black) }
}

#[test]
fn tables_are_linear_in_the_cosine() {
    // Near a knot of the table, where the mean over a picture is not the value in the middle.
    for (cosine, truth) in [(0.25, 0.5), (0.75, 0.6), (0.1, 0.26)] {
        for from_behind in [false, true] {
            let side = if from_behind { "behind" } else { "front" };
            let few = options(8, 256, 4);
            // Uniform environment on a sheet: the albedo.
            assert_radiance(
                &format!("reflected, {cosine}, {side}"),
                &sheet(cosine, from_behind, painted),
                &few,
                truth,
                1e-3,
            );
            let lit = sheet(cosine, from_behind, emissive);
            assert_radiance(&format!("emitted, {cosine}, {side}"), &lit, &few, truth, 1e-3);
            // Transparency shows the environment.
            let clear = sheet(cosine, from_behind, thin);
            assert_radiance(
                &format!("absent, {cosine}, {side}"),
                &clear,
                &options(8, 1024, 4),
                1.0 - truth,
                1e-2,
            );
        }
    }
}

/// Two textures mixed by a facing table: the sheet's even cells are blended, the odd ones constant.
#[test]
fn facing_mixes_of_textures() {
    for (cosine, share) in [(0.25, 0.5), (0.75, 0.6)] {
        for (place, truth) in [(2.0, 0.2 + share * (0.6 - 0.2)), (7.0, 0.6)] {
            for (of, name) in [(painted as fn(TextureId) -> Material, "reflected"), (emissive, "emitted")] {
                let mut scene = sheet(cosine, false, |table| of(TextureId(table.0 + 4)));
                let solid = |value: f32| Texture::Solid([value; 3]);
                let cells =
                    |even, odd| Texture::Checker { even, odd, cell_size: 5.0, mapping: Mapping::World };
                let (a, b) = (scene.add_texture(solid(0.2)), scene.add_texture(solid(0.6)));
                let first = scene.add_texture(cells(a, b));
                let mix = scene.add_texture(Texture::Mix { a: first, b, factor: TextureId(0) });
                assert_eq!(mix, TextureId(4));
                let shift = DVec3::new(place, 0.0, 2.0);
                let sine = (1.0 - cosine * cosine).sqrt();
                scene.cameras = vec![camera(shift + DVec3::new(sine, cosine, 0.0), shift, DVec3::Z, 0.01)];
                let name = format!("{name}, {cosine}, at {place}");
                assert_radiance(&name, &scene, &options(8, 256, 4), truth, 1e-3);
            }
        }
    }
}

/// Shadow rays through such a sheet.
#[test]
fn shadows_depend_on_the_angle_of_the_shadow_ray() {
    let mut scene = Scene::default();
    let texture = ramp(&mut scene, &RAMP);
    let sheet = material(&mut scene, Material { double_sided: true, ..thin(texture) });
    let floor = material(&mut scene, Material::lambert("floor", [0.8; 3]));
    for (y, of) in [(0.0, sheet), (-1.0, floor)] {
        quad(&mut scene, [-50.0, y, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], of);
    }
    // 60 degrees from the normal, 4 m away.
    let position = DVec3::new(2.0 * 3.0f64.sqrt(), 1.0, 0.0);
    scene.lights.push(Light::new(LightKind::Point { position }, [16.0; 3]));
    scene.cameras.push(camera(DVec3::new(0.0, -0.5, 0.0), DVec3::new(0.0, -1.0, 0.0), DVec3::Z, 0.01));
    let truth = 0.8 * 0.5 * (1.0 - 0.9) / std::f64::consts::PI;
    let (mean, error) = measure(&scene, &options(4, 64, 4));
    // The rounding of the ramp's alpha of 0.9 counts ten times in the transmittance.
    assert!((mean / truth - 1.0).abs() < 1e-4, "through a sheet: {mean} +- {error}, truth {truth}");
}

/// A room with an area light, whose walls and sphere have tables of these values: diffuse, plastic, one metal.
fn room(values: &[f32], ball: impl FnOnce(TextureId) -> Material) -> Scene {
    let mut scene = Scene::default();
    let texture = ramp(&mut scene, values);
    let color = ColorSlot { factor: [0.8, 0.7, 0.6], texture: Some(texture) };
    let plastic = |roughness| {
        let roughness = FloatSlot::constant(roughness);
        let metallic = FloatSlot::constant(0.0);
        let model = PbrMaterial { base_color: color, roughness, metallic, ..PbrMaterial::default() };
        Material::new("plastic", Model::Pbr(Box::new(model)))
    };
    let lambert =
        || Material { model: Model::Lambert { albedo: color }, ..Material::lambert("paint", [0.8; 3]) };
    walls(&mut scene, [1.0; 3], |scene, i| {
        material(
            scene,
            match i {
                0 | 3 => lambert(),
                1 => plastic(0.5),
                2 => Material::lambert("plain", [0.6; 3]),
                4 => pbr("plain plastic", [0.3, 0.6, 0.7], 0.0, 0.4),
                _ => plastic(0.3),
            },
        )
    });
    let shine = material(&mut scene, Material::emitter("lamp", [3.0, 2.5, 2.0], true));
    quad(&mut scene, [-0.5, 0.9, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], shine);
    let ball = material(&mut scene, ball(texture));
    sphere(&mut scene, [0.2, -0.5, -0.2], 0.45, ball);
    scene.cameras.push(camera(DVec3::new(-0.8, 0.5, 0.9), DVec3::new(0.1, -0.5, -0.2), DVec3::Y, 60.0));
    scene
}

fn polished(texture: TextureId) -> Material {
    let base_color = ColorSlot::texture(texture);
    let roughness = FloatSlot::constant(0.1);
    Material::new(
        "polished",
        Model::Pbr(Box::new(PbrMaterial { base_color, roughness, ..PbrMaterial::default() })),
    )
}

fn mirror(_: TextureId) -> Material {
    Material { double_sided: true, ..pbr("mirror", [0.9, 0.9, 1.0], 1.0, 0.0) }
}

fn plain(depth: u32) -> RenderOptions {
    let plain = options(32, 32, depth).path_reuse(PathReuse::Off).splitting(Splitting::OFF);
    plain.caustics(Caustics::Off).guiding(Guiding::Off)
}

#[test]
fn facing_textures_are_deterministic() {
    assert_same_bits("facing", &room(&RAMP, polished), &options(24, 4, 6));
}

/// Path sharing and light tracing have the same expected value.
#[test]
fn techniques_keep_the_mean() {
    let off = plain(5);
    let shared = off.path_reuse(PathReuse::Groups("4x4/2".parse().expect("a shape")));
    for (what, scene) in [("polished", room(&RAMP, polished)), ("mirror", room(&RAMP, mirror))] {
        assert_same_means(&format!("{what}, shared"), &scene, [&off, &shared], 16);
        // Surfaces that aren't smooth enough cast no caustics.
        if what == "mirror" {
            assert_same_means(
                &format!("{what}, from lamps"),
                &scene,
                [&off, &off.caustics(Caustics::On)],
                32,
            );
        }
    }
}

/// A nearly constant table matches a constant, though other loops shade it.
#[test]
fn constant_tables_match_constants() {
    let options = plain(5).samples(64);
    let nearly = room(&[0.5, 0.500_001], polished);
    let mut even = nearly.clone();
    even.textures[0] = Texture::Solid([0.5; 3]);
    let sum = |scene: &Scene| -> Vec<f64> {
        (0..16u32)
            .map(|seed| {
                let pixels = picture(scene, &options.seed(seed * 7919 + 3)).rgba();
                pixels.iter().map(|p| f64::from(p[1])).sum::<f64>() / pixels.len() as f64
            })
            .collect()
    };
    let differences: Vec<f64> = sum(&nearly).iter().zip(&sum(&even)).map(|(a, b)| a - b).collect();
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
    let error = (variance / n).sqrt();
    println!("a table of one value: {mean:.2e} +- {error:.2e}");
    assert!(mean.abs() < 4.5 * error + 1e-6 && error < 1e-3, "{mean} +- {error}");
}

/// Angle-dependent emission lights a room as a constant of the same power.
#[test]
fn facing_emission_lights_rooms() {
    let emissive = |texture| Material { double_sided: true, ..emissive(texture) };
    let nearly = room(&[0.5, 0.500_001], emissive);
    let mut even = nearly.clone();
    even.textures[0] = Texture::Solid([0.5; 3]);
    let options = plain(4).samples(128);
    let truth: f64 =
        (0..16u32).map(|seed| crate::support::mean(&picture(&even, &options.seed(seed + 100)))).sum::<f64>()
            / 16.0;
    let (mean, error) = measure(&nearly, &options);
    println!("a lamp by a table: {mean:.5} +- {error:.5}, by light sampling {truth:.5}");
    assert!(error < 5e-3 * truth && (mean - truth).abs() < 4.5 * error * 1.2, "{mean} +- {error}, {truth}");
}

/// Next-event estimation covers lights with angle-dependent emission or partial alpha: a small square light of edge a, at a
/// distance d under an angle, gives the irradiance L a a cos cos / (d d), with the radiance L of that angle times alpha. With
/// BSDF sampling alone the errors of so few samples would be many times as large.
#[test]
fn lights_with_varying_emission_are_sampled() {
    for alpha in [1.0, 0.4] {
        for (cosine, radiance) in [(0.75f64, 0.6f64), (0.6, 0.78)] {
            let mut scene = Scene::default();
            let texture = ramp(&mut scene, &RAMP);
            let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
            quad(&mut scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], grey);
            let mode = if alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque };
            let of = Material { alpha: FloatSlot::constant(alpha), alpha_mode: mode, ..emissive(texture) };
            let of = material(&mut scene, of);
            let (height, edge) = (2.0, 0.005);
            let aside = height * (1.0 - cosine * cosine).sqrt() / cosine;
            let corner = [aside - 0.5 * edge, height, -0.5 * edge];
            quad(&mut scene, corner, [edge, 0.0, 0.0], [0.0, 0.0, edge], of);
            scene.cameras.push(camera(DVec3::new(0.1, 0.3, 0.2), DVec3::ZERO, DVec3::X, 1e-3));
            let irradiance =
                radiance * f64::from(alpha) * (edge * cosine).powi(2) / (height / cosine).powi(2);
            let truth = 0.8 / std::f64::consts::PI * irradiance;
            let options = options(4, 64, 1).splitting(Splitting::OFF);
            assert_radiance(&format!("{cosine}, alpha {alpha}"), &scene, &options, truth, 1e-3);
        }
    }
}
