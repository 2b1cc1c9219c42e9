//! Caustics by light tracing: closed forms that no other technique samples, and the same expected value as camera paths.

use crate::support::differences::{assert_same_bits, assert_same_means, bits, noise};
use crate::support::{
    assert_radiance, camera, dielectric, material, mean, options, picture, place, quad, rendering, sphere,
};
use oscura::compile::{CompileOptions, compile};
use oscura::film::{Aov, AovSet, Source, Values};
use oscura::math::DVec3;
use oscura::output::part::Region;
use oscura::render::{Caustics, Labels, PathReuse, RenderOptions, Rendering, Splitting};
use oscura::scene::{
    Aperture, ColorSlot, Filter, FloatSlot, Light, LightKind, Material, MaterialId, Mesh, Model, PbrMaterial,
    Projection, Scene, ThinLens,
};
use std::f64::consts::PI;

fn pbr(metallic: f32, roughness: f32) -> Material {
    let pbr = PbrMaterial {
        base_color: ColorSlot::constant([1.0; 3]),
        metallic: FloatSlot::constant(metallic),
        roughness: FloatSlot::constant(roughness),
        ..PbrMaterial::default()
    };
    Material { double_sided: true, ..Material::new("metal", Model::Pbr(Box::new(pbr))) }
}

fn lamp(scene: &mut Scene, kind: LightKind, intensity: f32) {
    let light = Light::new(kind, [intensity; 3]);
    scene.lights.push(light);
}

/// A grey floor at y = 0, and a camera that looks straight down on a square of this half size around a point.
fn floor_from_above(scene: &mut Scene, from: DVec3, half_height: f64) {
    let grey = material(scene, Material::lambert("grey", [0.8; 3]));
    quad(scene, [-20.0, 0.0, 20.0], [40.0, 0.0, 0.0], [0.0, 0.0, -40.0], grey);
    let mut view = camera(from, DVec3::new(from.x, 0.0, from.z), DVec3::Z, 1.0);
    view.projection = Projection::Orthographic { half_height };
    scene.cameras.push(view);
}

/// The mean over a square about the origin.
fn mean_over_square(half: f64, f: impl Fn(f64, f64) -> f64) -> f64 {
    const N: u32 = 50;
    let at = |i: u32| ((f64::from(i) + 0.5) / f64::from(N) * 2.0 - 1.0) * half;
    let sum: f64 = (0..N).flat_map(|i| (0..N).map(move |j| (i, j))).map(|(i, j)| f(at(i), at(j))).sum();
    sum / f64::from(N * N)
}

/// Irradiance of a floor by a point light of intensity 1.
fn from_point(x: f64, z: f64, [px, py, pz]: [f64; 3]) -> f64 {
    let squared = (px - x).powi(2) + py * py + (pz - z).powi(2);
    py / squared / squared.sqrt()
}

/// A vertical mirror at x = 1.5 that faces -x.
fn mirror(scene: &mut Scene, mirror: MaterialId) {
    quad(scene, [1.5, 0.2, -0.6], [0.0, 0.0, 1.2], [0.0, 0.8, 0.0], mirror);
}

/// A mirror lights the floor as the mirrored light would.
#[test]
fn a_point_and_its_image_in_a_mirror() {
    let mut scene = Scene::default();
    let polished = material(&mut scene, pbr(1.0, 0.0));
    mirror(&mut scene, polished);
    floor_from_above(&mut scene, DVec3::new(0.0, 3.0, 0.0), 0.1);
    lamp(&mut scene, LightKind::Point { position: DVec3::new(0.5, 1.0, 0.0) }, 5.0);
    let direct = mean_over_square(0.1, |x, z| from_point(x, z, [0.5, 1.0, 0.0]));
    let image = mean_over_square(0.1, |x, z| from_point(x, z, [2.5, 1.0, 0.0]));
    let options = options(16, 256, 4).caustics(Caustics::Auto);
    let radiance = |irradiance: f64| 0.8 / PI * 5.0 * irradiance;
    assert_radiance("mirror", &scene, &options, radiance(direct + image), 5e-3);
    let off = mean(&picture(&scene, &options.caustics(Caustics::Off)));
    assert!((off / radiance(direct) - 1.0).abs() < 1e-3, "without: {off}");
}

/// The same for a sun: the mirrored direction.
#[test]
#[ignore = "means of many pictures, which take long"]
fn a_sun_and_its_image_in_a_mirror() {
    for angle_rad in [None, Some(0.01)] {
        let mut scene = Scene::default();
        let polished = material(&mut scene, pbr(1.0, 0.0));
        mirror(&mut scene, polished);
        floor_from_above(&mut scene, DVec3::new(0.7, 3.0, 0.0), 0.1);
        let direction = DVec3::new(1.0, -0.8, 0.0).normalize();
        let kind = match angle_rad {
            None => LightKind::Directional { direction },
            Some(angle_rad) => LightKind::Sun { direction, angle_rad },
        };
        lamp(&mut scene, kind, 2.0);
        let options = options(16, 256, 4).caustics(Caustics::On);
        // Directly, and by the mirror.
        let truth = 0.8 / PI * 2.0 * -direction.y * 2.0;
        assert_radiance(&format!("sun {angle_rad:?}"), &scene, &options, truth, 5e-3);
    }
}

/// Through a dielectric slab with all inter-reflections: images of the light raised by t (1 - 1 / n), and lowered by 2 t / n per
/// pair of reflections.
#[test]
#[ignore = "means of many pictures, which take long"]
fn a_point_seen_through_a_slab() {
    let (n, thickness) = (1.5, 0.2);
    let mut scene = Scene::default();
    let clear = material(&mut scene, dielectric(n as f32));
    let (low, high) = (0.5, 0.5 + thickness);
    quad(&mut scene, [-0.05, high, 0.05], [0.1, 0.0, 0.0], [0.0, 0.0, -0.1], clear);
    quad(&mut scene, [-0.05, low, -0.05], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1], clear);
    floor_from_above(&mut scene, DVec3::new(0.0, 0.4, 0.0), 0.02);
    lamp(&mut scene, LightKind::Point { position: DVec3::new(0.0, 1.0, 0.0) }, 5.0);
    let reflectance = ((n - 1.0) / (n + 1.0f64)).powi(2);
    let irradiance = |height: f64| mean_over_square(0.02, |x, z| from_point(x, z, [0.0, height, 0.0]));
    let orders = (0..6).map(|k| {
        let share = (1.0 - reflectance).powi(2) * reflectance.powi(2 * k);
        let height = 1.0 - thickness * (1.0 - 1.0 / n) + 2.0 * f64::from(k) * thickness / n;
        share * irradiance(height)
    });
    let truth = 0.8 / PI * 5.0 * orders.sum::<f64>();
    assert_radiance("slab", &scene, &options(16, 256, 10).caustics(Caustics::Auto), truth, 1e-2);
}

/// Spheres on a floor under an area light; `thing` adds the caustic casters.
fn stage(thing: impl Fn(&mut Scene)) -> Scene {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.7, 0.6, 0.5]));
    quad(&mut scene, [-3.0, 0.0, 3.0], [6.0, 0.0, 0.0], [0.0, 0.0, -6.0], grey);
    let plastic = material(&mut scene, pbr(0.0, 0.6));
    quad(&mut scene, [-1.2, 0.0, -1.5], [0.6, 0.0, 0.8], [0.0, 2.0, 0.0], plastic);
    thing(&mut scene);
    let shine = material(&mut scene, Material::emitter("lamp", [3.0; 3], false));
    quad(&mut scene, [-1.6, 2.5, -1.6], [3.2, 0.0, 0.0], [0.0, 0.0, 3.2], shine);
    scene.cameras.push(camera(DVec3::new(0.2, 2.2, 3.0), DVec3::new(0.0, 0.2, 0.0), DVec3::Y, 35.0));
    scene
}

fn ball(of: Material) -> impl Fn(&mut Scene) {
    move |scene| {
        let of = material(scene, of.clone());
        sphere(scene, [0.1, 0.5, 0.1], 0.45, of);
    }
}

/// A triangulated sphere with smooth normals.
fn smooth_ball(of: Material) -> impl Fn(&mut Scene) {
    move |scene| {
        let of = material(scene, of.clone());
        let (rows, columns) = (10u32, 16u32);
        let normal = |i: u32, j: u32| {
            let (a, b) = (PI * f64::from(i) / f64::from(rows), 2.0 * PI * f64::from(j) / f64::from(columns));
            DVec3::new(a.sin() * b.cos(), a.cos(), a.sin() * b.sin())
        };
        let all = (0..=rows).flat_map(|i| (0..=columns).map(move |j| normal(i, j)));
        let normals: Vec<DVec3> = all.collect();
        let positions = normals.iter().map(|n| (DVec3::new(0.1, 0.5, 0.1) + *n * 0.45).as_vec3().to_array());
        let at = |i: u32, j: u32| i * (columns + 1) + j;
        let cells = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
        let triangles = cells.flat_map(|(i, j)| {
            [[at(i, j), at(i, j + 1), at(i + 1, j)], [at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]]
        });
        let triangles = triangles.filter(|t| is_a_triangle(&normals, *t)).collect();
        let mut mesh = Mesh::new("ball", positions.collect(), triangles, of);
        mesh.normals = normals.iter().map(|n| n.as_vec3().to_array()).collect();
        place(scene, mesh);
    }
}

fn is_a_triangle(points: &[DVec3], t: [u32; 3]) -> bool {
    let [a, b, c] = t.map(|i| points[i as usize]);
    (b - a).cross(c - a).length() > 1e-9
}

/// Options that differ in caustics only.
fn plain(options: RenderOptions) -> RenderOptions {
    options.path_reuse(PathReuse::Off).splitting(Splitting::OFF)
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn caustics_keep_the_mean() {
    let things: [(&str, Scene); 6] = [
        ("glass", stage(ball(dielectric(1.5)))),
        ("mirror", stage(ball(pbr(1.0, 0.0)))),
        ("polished", stage(ball(pbr(1.0, 0.2)))),
        ("smooth mirror", stage(smooth_ball(pbr(1.0, 0.0)))),
        ("smooth glass", stage(smooth_ball(dielectric(1.5)))),
        ("smooth polished", stage(smooth_ball(pbr(1.0, 0.2)))),
    ];
    for (what, scene) in &things {
        let off = plain(options(32, 32, 12)).caustics(Caustics::Off);
        assert_same_means(what, scene, [&off, &off.caustics(Caustics::On)], 64);
    }
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn caustics_with_depth_of_field_and_pixel_filters() {
    let mut scene = stage(ball(dielectric(1.5)));
    scene.cameras[0].lens =
        Some(ThinLens { defocus_angle_rad: 0.06, focus_distance: 3.5, aperture: Aperture::default() });
    let off = plain(options(32, 128, 12)).caustics(Caustics::Off).filter(Filter::BlackmanHarris);
    assert_same_means("lens", &scene, [&off, &off.caustics(Caustics::On)], 16);
    let shared =
        |options: RenderOptions| options.path_reuse(PathReuse::Groups("2x2".parse().expect("a shape")));
    assert_same_means("shared", &scene, [&off, &shared(off.caustics(Caustics::On))], 16);
    let split = off.caustics(Caustics::On).splitting(Splitting::Into(4));
    assert_same_means("split", &scene, [&off, &split], 16);
}

#[test]
fn light_traced_caustics_reduce_noise() {
    let mut scene = stage(ball(dielectric(1.5)));
    // Replaces the large area light.
    let small = material(&mut scene, Material::emitter("small lamp", [12.0; 3], false));
    scene.quads.pop();
    quad(&mut scene, [-0.8, 2.5, -0.8], [1.6, 0.0, 0.0], [0.0, 0.0, 1.6], small);
    let options = plain(options(64, 16, 12));
    let [on, off] = [Caustics::On, Caustics::Off].map(|c| noise(&scene, &options.caustics(c)));
    assert!(on < 0.7 * off, "{on} {off}");
}

#[test]
fn caustics_are_deterministic() {
    assert_same_bits(
        "caustics",
        &stage(ball(dielectric(1.5))),
        &plain(options(48, 9, 12)).caustics(Caustics::On),
    );
}

/// No light paths are traced without glass, mirrors or lights.
#[test]
fn no_light_paths_without_caustic_casters() {
    let scene = stage(ball(Material::lambert("chalk", [0.8; 3])));
    let mut without = rendering(&scene, &options(32, 8, 12).caustics(Caustics::Auto));
    without.run();
    assert_eq!(without.statistics().light_paths, None);
    let mut with = rendering(&stage(ball(dielectric(1.5))), &options(32, 8, 12).caustics(Caustics::On));
    with.run();
    assert!(with.statistics().light_paths.is_some());
}

/// From ten million metres away directions lack precision: all lights are left to camera paths.
#[test]
fn distant_lights_are_left_to_camera_paths() {
    let paths_from_lamps = |height: f64| {
        let mut scene = stage(ball(dielectric(1.5)));
        let white = material(&mut scene, Material::emitter("far lamp", [1.0; 3], false));
        quad(&mut scene, [-1.0, height, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], white);
        let mut rendering = rendering(&scene, &options(32, 1, 12).caustics(Caustics::On));
        rendering.run();
        rendering.statistics().light_paths
    };
    assert!(paths_from_lamps(1e3).is_some());
    assert_eq!(paths_from_lamps(1e7), None);
}

/// Light passes and light groups contain caustics: they add up to the beauty pass, have the expected values of camera paths, and
/// leave the beauty pass unchanged.
#[test]
#[ignore = "means of many pictures, which take long"]
fn passes_and_groups_include_caustics() {
    let mut scene = stage(ball(dielectric(1.5)));
    // Its diffuse and its glossy part both show caustics.
    let plastic = material(&mut scene, pbr(0.0, 0.5));
    scene.quads[0].material = plastic;
    // A second light, in its own light group.
    let shine = Material::emitter("other lamp", [0.0, 2.0, 4.0], false);
    let other = material(&mut scene, Material { light_group: "other".into(), ..shine });
    quad(&mut scene, [2.6, 0.2, -1.0], [0.0, 0.0, 2.0], [0.0, 1.5, 0.0], other);
    let passes = AovSet::all().of(Source::PartOfColor);
    let plain = plain(options(32, 32, 12)).caustics(Caustics::On);
    let layered = plain.aovs(passes).light_groups(true);
    let planes = |options: &RenderOptions| -> (Vec<[f32; 4]>, Vec<(String, f64)>) {
        let (compiled, _) = compile(&scene, &CompileOptions::default()).expect("the scene compiles");
        let labels = Labels::of(&scene, options);
        let rendering = Rendering::labelled(compiled, labels, &scene.cameras[0], *options);
        let film = rendering
            .map(|mut r| {
                r.run();
                r.into_picture().into_film()
            })
            .expect("the film fits");
        let mean = |values: Values| {
            let values = values.into_floats();
            values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
        };
        let means = film.planes().skip(4).map(|plane| (plane.name.to_string(), mean(plane.values)));
        (film.rgba(), means.collect())
    };
    let (rgba, layers) = planes(&layered);
    assert!(rgba == picture(&scene, &plain).rgba(), "layers change the picture");
    let mean_of = |c: usize| rgba.iter().map(|p| f64::from(p[c])).sum::<f64>() / rgba.len() as f64;
    for (c, letter) in ["R", "G", "B"].iter().enumerate() {
        let (groups, passes): (Vec<_>, Vec<_>) = layers
            .iter()
            .filter(|(name, _)| name.ends_with(&format!(".{letter}")) && !name.contains("color"))
            .partition(|(name, _)| name.starts_with("RGBA_"));
        assert!(groups.len() == 2 && passes.len() > 6, "{layers:?}");
        for of in [groups, passes] {
            let sum: f64 = of.iter().map(|(_, mean)| mean).sum();
            assert!((sum / mean_of(c) - 1.0).abs() < 1e-5, "{letter}: {sum} of {}: {of:?}", mean_of(c));
        }
    }
    // By seeds: those of both ways.
    let seeds = 64;
    let of_seeds = |options: RenderOptions| -> Vec<Vec<(String, f64)>> {
        (0..seeds).map(|seed| planes(&options.seed(seed * 31 + 5)).1).collect()
    };
    let (on, off) = (of_seeds(layered), of_seeds(layered.caustics(Caustics::Off)));
    for at in 0..on[0].len() {
        let differences: Vec<f64> = on.iter().zip(&off).map(|(on, off)| on[at].1 - off[at].1).collect();
        let n = f64::from(seeds);
        let mean = differences.iter().sum::<f64>() / n;
        let error = (differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt();
        println!("{}: {:.5}, {mean:.1e} +- {error:.1e}", on[0][at].0, on[0][at].1);
        assert!(mean.abs() <= 4.5 * error + 1e-9, "{}: {mean} +- {error}", on[0][at].0);
    }
}

/// A floor from above, in the light of a point lamp through a glass sphere.
fn caustic_of_a_ball() -> Scene {
    let mut scene = Scene::default();
    let clear = material(&mut scene, dielectric(1.5));
    sphere(&mut scene, [0.0, 1.0, 0.0], 0.3, clear);
    floor_from_above(&mut scene, DVec3::new(0.0, 0.4, 0.0), 0.3);
    lamp(&mut scene, LightKind::Point { position: DVec3::new(0.0, 2.0, 0.0) }, 5.0);
    scene
}

/// The variance estimate includes light tracing, which is all the noise here.
#[test]
fn variance_includes_caustics() {
    let scene = caustic_of_a_ball();
    let options = options(32, 64, 4).caustics(Caustics::On).aovs(AovSet::from(Aov::Variance));
    let films = [1, 2].map(|seed| picture(&scene, &options.seed(seed)));
    let reported = films[0].aov(Aov::Variance).expect("it is kept").remove(0).into_floats();
    let reported = reported.iter().map(|v| f64::from(*v)).sum::<f64>() / reported.len() as f64;
    let [a, b] = films.map(|film| film.rgba());
    let square = |(a, b): (&[f32; 4], &[f32; 4])| f64::from(a[0] - b[0]).powi(2) / 2.0;
    let real = a.iter().zip(&b).map(square).sum::<f64>() / a.len() as f64;
    println!("told {reported:.2e}, real {real:.2e}");
    // Low-discrepancy points are better spread than independent ones.
    assert!(reported >= 0.7 * real && reported < 10.0 * real, "{reported} {real}");
}

/// Connections shared by several pixels correlate their noise, which denoisers mistake for detail; for denoising each connection
/// belongs to one pixel, with the same mean. (Light paths are stratified, so neighbours are rather anticorrelated.)
#[test]
fn caustic_noise_is_uncorrelated_for_denoisers() {
    let scene = caustic_of_a_ball();
    let plain = options(64, 16, 4).filter(Filter::BlackmanHarris).caustics(Caustics::On);
    let for_denoisers = plain.halves(true);
    let correlation = |options: &RenderOptions| {
        let [a, b] = [1, 2].map(|seed| picture(&scene, &options.seed(seed)).rgba());
        let noise: Vec<f64> = a.iter().zip(&b).map(|(a, b)| f64::from(a[0] - b[0])).collect();
        let rows = noise.chunks_exact(64);
        let products: f64 = rows.map(|row| row.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>()).sum();
        products / noise.iter().map(|v| v * v).sum::<f64>()
    };
    let [shared, own] = [correlation(&plain), correlation(&for_denoisers)];
    println!("correlation of neighbours: {shared:.3}, for denoisers {own:.3}");
    assert!(own < 0.03 && shared > own + 0.1, "{own} {shared}");
    assert_same_means("one pixel a connection", &scene, [&plain, &for_denoisers], 16);
}

/// Sample ranges and crops merge to the picture of a single run.
#[test]
fn partial_renders_include_caustics() {
    let scene = stage(ball(dielectric(1.5)));
    let whole = plain(options(32, 24, 12)).caustics(Caustics::On).halves(true);
    let film = |options: RenderOptions| picture(&scene, &options);
    let part = |options: RenderOptions| {
        let mut rendering = rendering(&scene, &options);
        rendering.run();
        rendering.into_picture().into_film()
    };
    let complete = film(whole);
    let mut of_ranges = part(whole.sample_range((0, 8)));
    of_ranges.merge_film(&part(whole.sample_range((8, 24))));
    assert!(bits(&of_ranges) == bits(&complete) && of_ranges.halves() == complete.halves());
    let mut of_regions = complete.clone();
    let regions = [(0, 0, 13, 32), (13, 0, 32, 9), (13, 9, 32, 32)];
    let films = regions.map(|(x0, y0, x1, y1)| part(whole.region(Region { x0, y0, x1, y1 })));
    for film in &films {
        for (x, y) in (0..film.height()).flat_map(|y| (0..film.width()).map(move |x| (x, y))) {
            let (x0, y0) = film.origin();
            assert_eq!(film.mean_rgba(x, y), complete.mean_rgba(x0 + x, y0 + y));
        }
    }
    of_regions.merge_film(&films[0]);
    assert!(of_regions.samples(0, 0) == 48 && of_regions.samples(20, 0) == 24);
}
