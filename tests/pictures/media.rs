//! Media that scatter, absorb and emit, against closed forms and quadrature.

use crate::support::differences::{assert_same_bits, assert_same_means, bits};
use crate::support::{
    assert_radiance, camera, material, measure, options, picture, sphere, translucent, walls,
};
use oscura::math::DVec3;
use oscura::scene::{
    BounceLimits, Camera, ColorSlot, Environment, Fog, FresnelModel, Grid, Light, LightKind, Material,
    MaterialId, Medium, Model, Projection, Scene,
};
use std::f64::consts::PI;

const NO_END: f64 = f64::INFINITY;

fn medium(extinction: f32, albedo: f32, anisotropy: f32) -> Medium {
    let (extinction, albedo) = ([extinction; 3], [albedo; 3]);
    Medium { albedo, anisotropy, ..Medium::scattering(extinction) }
}

fn fog(medium: Medium, radius: f64) -> Option<Fog> {
    Some(Fog { medium, center: DVec3::ZERO, radius })
}

/// A solid with an index-matched (null) interface.
fn body(scene: &mut Scene, medium: Medium) -> MaterialId {
    let filled = Material { medium: Some(medium), ..Material::new("body", Model::Boundary {}) };
    material(scene, filled)
}

/// Parallel rays along -z, next to each other.
fn beam(from: [f64; 3]) -> Camera {
    let from = DVec3::from(from);
    let mut view = camera(from, from - DVec3::Z, DVec3::Y, 1.0);
    view.projection = Projection::Orthographic { half_height: 1e-3 };
    view
}

fn lit_all_around() -> Scene {
    Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() }
}

/// The midpoint rule.
fn integral(from: f64, to: f64, steps: u32, f: impl Fn(f64) -> f64) -> f64 {
    let width = (to - from) / f64::from(steps);
    (0..steps).map(|i| f(from + (f64::from(i) + 0.5) * width) * width).sum()
}

fn henyey_greenstein(g: f64, cosine: f64) -> f64 {
    (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5))
}

/// Transmittance follows Beer-Lambert: in fog, in a solid, and in fog displaced by a clear solid.
#[test]
fn absorbing_media_follow_beers_law() {
    let absorbing = medium(0.7, 0.0, 0.0);
    let mut foggy = lit_all_around();
    foggy.fog = fog(absorbing, 2.0);
    let mut solid = lit_all_around();
    let filled = body(&mut solid, absorbing);
    sphere(&mut solid, [0.0; 3], 2.0, filled);
    let mut displaced = lit_all_around();
    displaced.fog = fog(absorbing, 2.0);
    let bubble = body(&mut displaced, medium(0.0, 0.0, 0.0));
    sphere(&mut displaced, [0.0; 3], 0.5, bubble);
    for (what, mut scene, way) in [("fog", foggy, 4.0), ("body", solid, 4.0), ("bubble", displaced, 3.0)] {
        scene.cameras.push(beam([0.0, 0.0, 5.0]));
        assert_radiance(what, &scene, &options(8, 4, 4), (-0.7f64 * way).exp(), 1e-4);
    }
}

/// Absorption and emission: saturates at the emission over the extinction. Also with scattering.
#[test]
fn emissive_media_saturate() {
    for (extinction, albedo) in [(0.8, 0.0), (0.0, 0.0)] {
        let mut scene = Scene::default();
        let emissive = Medium { emission: [0.4; 3], ..medium(extinction, albedo, 0.0) };
        let filled = body(&mut scene, emissive);
        sphere(&mut scene, [0.0; 3], 1.5, filled);
        scene.cameras.push(beam([0.0, 0.0, 5.0]));
        let truth = integral(0.0, 3.0, 4000, |t| 0.4 * (-f64::from(extinction) * t).exp());
        assert_radiance(&format!("emissive {extinction}"), &scene, &options(8, 64, 8), truth, 3e-3);
    }
    // In equilibrium: unbounded fog has its saturated radiance everywhere.
    let mut scene = Scene::default();
    let emissive = Medium { emission: [0.4; 3], ..medium(0.8, 0.5, 0.3) };
    scene.fog = fog(emissive, NO_END);
    scene.cameras.push(beam([0.0, 0.0, 5.0]));
    assert_radiance("emissive fog", &scene, &options(16, 64, 200), 0.4 / (0.8 * 0.5), 5e-3);
}

/// Constant grids match homogeneous media: transmittance, single scattering, and a white furnace; the furnace also with varying
/// grids.
#[test]
fn grids_agree_with_homogeneous_media() {
    let with_grid = |scene: &mut Scene, value: &dyn Fn(usize) -> f32, albedo: f32| {
        let size = [19, 8, 30];
        let values = std::sync::Arc::new((0..19 * 8 * 30).map(value).collect());
        let (name, min, max) = ("smoke".to_string(), DVec3::splat(-2.0), DVec3::splat(2.0));
        let grid = scene.add_grid(Grid::in_box(name, size, values, min, max));
        let filled = body(scene, Medium { grid: Some(grid), ..medium(0.25, albedo, 0.3) });
        sphere(scene, [0.0; 3], 1.0, filled);
    };
    let constant = |_: usize| 4.0;
    let mut through = lit_all_around();
    with_grid(&mut through, &constant, 0.0);
    through.cameras.push(beam([0.0, 0.0, 5.0]));
    assert_radiance("grid, through", &through, &options(16, 64, 4), (-2.0f64).exp(), 6e-3);

    let mut lit = Scene::default();
    with_grid(&mut lit, &constant, 0.8);
    let kind = LightKind::Directional { direction: DVec3::NEG_Y };
    lit.lights.push(Light::new(kind, [3.0; 3]));
    lit.cameras.push(beam([0.0, 0.0, 5.0]));
    let truth = integral(0.0, 2.0, 20_000, |t| {
        let way = (1.0 - (1.0 - t) * (1.0 - t)).sqrt();
        0.8 * (-t - way).exp() * henyey_greenstein(0.3, 0.0) * 3.0
    });
    assert_radiance("grid, one scattering", &lit, &options(16, 64, 1), truth, 6e-3);

    let mut furnace = lit_all_around();
    with_grid(&mut furnace, &|i| (i % 7) as f32 * 3.0, 1.0);
    furnace.cameras.push(beam([0.2, 0.1, 5.0]));
    assert_radiance("grid, furnace", &furnace, &options(16, 16, 3000), 1.0, 5e-3);
}

/// Emission scales with density: e / sigma (1 - exp(-sigma m)) for an optical length m, whatever the profile, and e m without
/// extinction. With scattering it is brighter.
#[test]
fn emissive_grids() {
    for (extinction, what) in [(0.0, "pure"), (0.7, "thin"), (40.0, "thick")] {
        let mut scene = Scene::default();
        let size = [3, 2, 40];
        // A ramp along the ray, and a gap.
        let value = |i: usize| if (20..25).contains(&(i / 6)) { 0.0 } else { (i / 6) as f32 * 0.1 };
        let values: Vec<f32> = (0..240).map(value).collect();
        let (name, min, max) = ("flame".to_string(), DVec3::splat(-2.0), DVec3::splat(2.0));
        // By the trapezoid rule between voxel centres, the outer halves constant.
        let along: Vec<f64> = (0..40).map(|z| f64::from(values[z * 6])).collect();
        let between: f64 = along.windows(2).map(|w| 0.5 * (w[0] + w[1])).sum();
        let mass = (between + 0.5 * (along[0] + along[39])) * 0.1;
        let grid = scene.add_grid(Grid::in_box(name, size, std::sync::Arc::new(values), min, max));
        let emissive =
            Medium { grid: Some(grid), emission: [0.6, 0.3, 0.15], ..medium(extinction, 0.0, 0.0) };
        let filled = body(&mut scene, emissive);
        sphere(&mut scene, [0.0; 3], 4.0, filled);
        scene.cameras.push(beam([0.1, 0.2, 6.0]));
        let sigma = f64::from(extinction);
        let filled_up = if sigma > 0.0 { (1.0 - (-sigma * mass).exp()) / sigma } else { mass };
        let options = &options(16, 256, 8);
        assert_radiance(&format!("emissive grid, {what}"), &scene, options, 0.3 * filled_up, 3e-3);
        // Red and green share the same sample points.
        let film = picture(&scene, options);
        let [red, green, blue, _] = film.mean_rgba(3, 4);
        assert!((red / green - 2.0).abs() < 1e-4 && (blue / green - 0.5).abs() < 1e-4);
    }
    let mut scene = Scene::default();
    let values = std::sync::Arc::new(vec![1.0; 8]);
    let (name, min, max) = (String::new(), DVec3::splat(-300.0), DVec3::splat(300.0));
    let grid = scene.add_grid(Grid::in_box(name, [2; 3], values, min, max));
    let emissive = Medium { grid: Some(grid), emission: [0.4; 3], ..medium(0.8, 0.5, 0.3) };
    let filled = body(&mut scene, emissive);
    sphere(&mut scene, [0.0; 3], 200.0, filled);
    scene.cameras.push(beam([0.0, 0.0, 250.0]));
    // Seen from outside, a half space is darker than from within: as for a homogeneous medium.
    let mut even = scene.clone();
    even.materials[0].medium = Some(Medium { grid: None, ..emissive });
    let [(a, of_a), (b, of_b)] = [&scene, &even].map(|scene| measure(scene, &options(16, 256, 200)));
    let error = of_a.hypot(of_b);
    assert!((a - b).abs() < 4.5 * error && error < 0.01 * b, "{a} {b} +- {error}");
}

/// Fire: smoke density and an emission grid of its own, as factors or temperatures, on a ray through both.
#[test]
fn emission_grids_separate_from_density() {
    use oscura::compile::BlackBodies;
    use oscura::scene::EmissionGrid;
    let grid = |values: [f32; 2], z: [f64; 2]| {
        let (min, max) = (DVec3::new(-2.0, -2.0, z[0]), DVec3::new(2.0, 2.0, z[1]));
        let values = std::sync::Arc::new(values.to_vec());
        Grid::in_box(String::new(), [1, 1, 2], values, min, max)
    };
    // Linear between voxel centres, at 1/4 and 3/4.
    let value = |[a, b]: [f32; 2], [from, to]: [f64; 2], z: f64| {
        let share = ((z - from) / (to - from) * 2.0 - 0.5).clamp(0.0, 1.0);
        if z < from || z > to { 0.0 } else { f64::from(a) * (1.0 - share) + f64::from(b) * share }
    };
    let (density, along) = ([0.5, 2.0], [-1.0, 1.0]);
    let (heat, hot) = ([0.2, 1.3], [-0.8, 1.6]);
    let bodies = BlackBodies::relative_to(EmissionGrid::REFERENCE_KELVIN);
    for (kelvin, scales_with_power) in [(None, false), (Some(1300.0), false), (Some(1300.0), true)] {
        let mut scene = Scene::default();
        let [smoke, fire] = [grid(density, along), grid(heat, hot)].map(|grid| scene.add_grid(grid));
        let emission_grid = Some(kelvin.map_or(EmissionGrid::Factors(fire), |kelvin| {
            EmissionGrid::Temperatures { grid: fire, kelvin, scales_with_power }
        }));
        let burning =
            Medium { grid: Some(smoke), emission_grid, emission: [0.6; 3], ..medium(0.7, 0.0, 0.0) };
        let filled = body(&mut scene, burning);
        sphere(&mut scene, [0.0; 3], 3.0, filled);
        scene.cameras.push(beam([0.1, 0.2, 6.0]));
        let (mut depth, mut truth, steps) = (0.0, [0.0; 3], 6000);
        let step = 6.0 / f64::from(steps);
        for k in 0..steps {
            let z = 3.0 - (f64::from(k) + 0.5) * step;
            let thickness = 0.7 * value(density, along, z) * step;
            let heat = value(heat, hot, z);
            let shines = match kelvin {
                None => [heat; 3],
                Some(kelvin) if scales_with_power => {
                    let kelvin = (heat * f64::from(kelvin)) as f32;
                    let color = bodies.rgb(kelvin.max(BlackBodies::MIN_KELVIN));
                    color.map(|c| f64::from(c * bodies.power_over_luminance(kelvin)))
                }
                Some(kelvin) => bodies.rgb((heat * f64::from(kelvin)) as f32).map(f64::from),
            };
            (0..3).for_each(|c| truth[c] += 0.6 * shines[c] * step * f64::exp(-depth - 0.5 * thickness));
            depth += thickness;
        }
        let film = picture(&scene, &options(32, 1024, 8));
        let of_pixel = |i: u32| film.mean_rgba(i % 32, i / 32).map(f64::from);
        let all = (0..1024).map(of_pixel).reduce(|a, b| std::array::from_fn(|c| a[c] + b[c]));
        let found = all.expect("pixels").map(|sum| sum / 1024.0);
        println!("{kelvin:?}, {scales_with_power}: {found:?}, truth {truth:?}");
        // A million paths: a quarter of a percent is about ten standard errors.
        let is_close = |c: usize| (found[c] - truth[c]).abs() < 4e-3 * truth[0];
        assert!((0..3).all(is_close) && truth[0] > 0.1, "{found:?} {truth:?}");
    }
}

/// Thick subsurface solids have the albedo that `subsurface` specifies, without a reflecting interface; steps of the walk do not
/// count as bounces.
#[test]
fn subsurface_has_the_specified_albedo() {
    for (color, anisotropy) in [(0.2, 0.0), (0.5, 0.5), (0.9, 0.0)] {
        let mut scene = lit_all_around();
        let wax = translucent(&mut scene, Medium::subsurface([color; 3], [0.01; 3], anisotropy));
        sphere(&mut scene, [0.0; 3], 1.0, wax);
        scene.cameras.push(beam([0.0, 0.0, 5.0]));
        let film = picture(&scene, &options(32, 64, 4));
        let mean = crate::support::mean(&film);
        println!("subsurface {color} {anisotropy}: {mean}");
        // Accuracy of van de Hulst's fit.
        assert!((mean - f64::from(color)).abs() < 0.02, "{color}: {mean}");
    }
}

/// Subsurface random walks intersect their own object only, as in Cycles: a black sphere inside is not hit.
#[test]
fn subsurface_walks_ignore_other_objects() {
    let mean = |is_filled: bool| {
        let mut scene = lit_all_around();
        let wax = translucent(&mut scene, Medium::subsurface([0.8; 3], [0.3; 3], 0.0));
        sphere(&mut scene, [0.0; 3], 1.0, wax);
        let black = material(&mut scene, Material::lambert("black", [0.0; 3]));
        if is_filled {
            sphere(&mut scene, [0.0; 3], 0.8, black);
        }
        scene.cameras.push(beam([0.0, 0.0, 5.0]));
        crate::support::mean(&picture(&scene, &options(32, 64, 8)))
    };
    let (empty, filled) = (mean(false), mean(true));
    println!("{empty}, {filled}");
    assert!(empty > 0.5 && (filled / empty - 1.0).abs() < 1e-3, "{empty}, {filled}");
}

/// White furnace: a white subsurface solid is invisible at any anisotropy and mean free path: walks of a few steps, of hundreds,
/// and guided ones.
#[test]
fn white_subsurface_in_a_white_furnace() {
    for (extinction, anisotropy) in [(0.5, 0.0), (20.0, 0.0), (20.0, 0.7), (5.0, -0.4)] {
        let mut scene = lit_all_around();
        let wax = translucent(&mut scene, medium(extinction, 1.0, anisotropy));
        sphere(&mut scene, [0.0; 3], 1.0, wax);
        scene.cameras.push(beam([0.0, 0.0, 5.0]));
        let what = format!("a white body of {extinction}, {anisotropy}");
        assert_radiance(&what, &scene, &options(16, 64, 4), 1.0, 0.01);
    }
}

/// A camera inside a white solid in a white furnace sees the furnace.
#[test]
fn camera_inside_a_subsurface_solid() {
    let mut scene = lit_all_around();
    let wax = translucent(&mut scene, medium(3.0, 1.0, 0.0));
    sphere(&mut scene, [0.0; 3], 1.0, wax);
    scene.cameras.push(camera(DVec3::new(0.1, 0.2, 0.3), DVec3::X, DVec3::Y, 60.0));
    assert_radiance("from within", &scene, &options(16, 64, 4), 1.0, 0.01);
}

/// Transmission of a Random Walk (Skin) slab, 0.2 m thick, of radius 0.5 m, against Cycles (Blender 5.0.1). Diffuse entry would
/// transmit a tenth less, and the mean free paths of Random Walk a seventieth of the blue.
#[test]
fn random_walk_skin_transmission_matches_cycles() {
    const SCENE: &str = "[camera]\nlook_from = [0, 0, 5]\nlook_at = [0, 0, 0]\nvfov = 1\nwidth = 16\nheight = 16\n\
        [materials.m]\ntype = \"nodes\"\nsurface = \"p\"\nvolume = true\n[materials.m.nodes.p]\ntype = \"principled_bsdf\"\n\
        base_color = [0.8, 0.5, 0.2]\nspecular_ior_level = 0\nsubsurface_weight = 1\nsubsurface_radius = [1, 1, 1]\n\
        subsurface_scale = 0.5\nsubsurface_skin_ior = 1.4\n[[lights]]\n\
        sun = { direction = [0, 0, 1], irradiance = 3.14159265 }\n[[objects]]\n\
        box = { min = [-20, -20, -0.1], max = [20, 20, 0.1] }\nmaterial = \"m\"\n";
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, SCENE).expect("written");
    let scene = oscura::load::load(&path, &Default::default()).unwrap_or_else(|e| panic!("{e}")).scene;
    let film = picture(&scene, &options(16, 512, 64));
    let pixels = (0..256).map(|i| film.mean_rgba(i % 16, i / 16));
    let sum = pixels.fold([0.0; 3], |sum: [f32; 3], p| std::array::from_fn(|c| sum[c] + p[c]));
    for (c, cycles) in [0.1760, 0.3993, 0.6055].into_iter().enumerate() {
        let ratio = sum[c] / 256.0 / cycles;
        println!("channel {c}: {ratio} of Cycles'");
        assert!((0.98..1.02).contains(&ratio), "channel {c}: {ratio}");
    }
}

/// A white furnace seen through a glass sphere of radius 1 and index 1, with a medium of density 0.5 inside.
fn through_filled_glass(alpha: f32, color: f32, bounces: BounceLimits) -> f64 {
    let text = format!(
        "[camera]\nlook_from = [0, 0, 5]\nlook_at = [0, 0, 0]\nvfov = 0.1\n\
         [environment]\nbackground = 1\n[materials.m]\ntype = \"nodes\"\nsurface = \"p\"\nvolume = true\n\
         medium = {{ density = 0.5, color = {color} }}\n[materials.m.nodes.p]\ntype = \"principled_bsdf\"\n\
         base_color = 1\nroughness = 0\nior = 1\ntransmission_weight = 1\nalpha = {alpha}\n[[objects]]\n\
         sphere = {{ center = [0, 0, 0], radius = 1 }}\nmaterial = \"m\"\n"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("written");
    let scene = oscura::load::load(&path, &Default::default()).unwrap_or_else(|e| panic!("{e}")).scene;
    crate::support::mean(&picture(&scene, &options(16, 256, 64).bounces(bounces)))
}

/// Rays that pass an interface by alpha enter and leave its medium, like refracted ones.
#[test]
fn alpha_passes_enter_and_leave_media() {
    for alpha in [0.01, 0.4, 1.0] {
        let absorbed = through_filled_glass(alpha, 0.0, BounceLimits::NONE);
        assert!((absorbed - (-1.0f64).exp()).abs() < 4e-3, "alpha {alpha}: {absorbed}");
        let scattered = through_filled_glass(alpha, 1.0, BounceLimits::NONE);
        assert!((scattered - 1.0).abs() < 1e-2, "alpha {alpha}: {scattered}");
    }
}

/// Volume bounce limit inside glass: limited to one event, the unscattered light is left.
#[test]
fn volume_bounce_limit_inside_glass() {
    let limited = through_filled_glass(1.0, 1.0, BounceLimits { volume: 1, ..BounceLimits::NONE });
    assert!((limited - (-1.0f64).exp()).abs() < 4e-3, "{limited}");
}

/// Single scattering of a point light, by quadrature along the ray.
#[test]
fn single_scattering_agrees_with_quadrature() {
    const SIGMA: f64 = 0.6;
    let lamp = DVec3::new(0.7, 0.2, -0.5);
    for g in [-0.4, 0.0, 0.7] {
        let mut scene = Scene { fog: fog(medium(SIGMA as f32, 0.8, g), NO_END), ..Scene::default() };
        let kind = LightKind::Point { position: lamp };
        scene.lights.push(Light::new(kind, [3.0; 3]));
        scene.cameras.push(beam([0.0, 0.0, 3.0]));
        let truth = integral(0.0, 60.0, 400_000, |t| {
            let x = DVec3::new(0.0, 0.0, 3.0 - t);
            let to_lamp = lamp - x;
            let r = to_lamp.length();
            // Light travels away from the light, then against the ray.
            let cosine = to_lamp.dot(DVec3::NEG_Z) / r;
            0.8 * SIGMA * (-SIGMA * (t + r)).exp() * henyey_greenstein(g.into(), cosine) * 3.0 / (r * r)
        });
        assert_radiance(&format!("point lamp, g {g}"), &scene, &options(16, 256, 1), truth, 5e-3);
    }
}

/// The same for a spherical light, found by both light and phase samples, and through the interface of a solid.
#[test]
fn single_scattering_of_a_sphere_light_agrees_with_quadrature() {
    const SIGMA: f64 = 0.5;
    let (middle, radius) = (DVec3::new(0.0, 1.0, 0.0), 0.4);
    let from_ball = |x: DVec3, left: &dyn Fn(f64) -> f64| {
        let d = middle.distance(x);
        let edge = (1.0 - (radius / d).powi(2)).sqrt();
        integral(edge, 1.0, 60, |c| {
            let way = d * c - (radius * radius - d * d * (1.0 - c * c)).max(0.0).sqrt();
            2.0 * PI / (4.0 * PI) * left(way)
        })
    };
    let with_lamp = |scene: &mut Scene| {
        let emissive = material(scene, Material::emitter("ball", [5.0; 3], false));
        sphere(scene, middle.to_array(), radius, emissive);
    };
    let mut foggy = Scene { fog: fog(medium(SIGMA as f32, 1.0, 0.0), NO_END), ..Scene::default() };
    with_lamp(&mut foggy);
    foggy.cameras.push(beam([0.0, 0.0, 2.0]));
    let truth = integral(0.0, 60.0, 20_000, |t| {
        let x = DVec3::new(0.0, 0.0, 2.0 - t);
        SIGMA * (-SIGMA * t).exp() * 5.0 * from_ball(x, &|way| (-SIGMA * way).exp())
    });
    assert_radiance("ball in fog", &foggy, &options(16, 256, 1), truth, 4e-3);

    // The light is outside the solid: the interface is crossed on the way in and towards the light.
    let (center, size) = (DVec3::new(0.0, -0.5, 0.0), 0.6);
    let mut scene = Scene::default();
    let filled = body(&mut scene, medium(SIGMA as f32, 1.0, 0.0));
    sphere(&mut scene, center.to_array(), size, filled);
    with_lamp(&mut scene);
    scene.cameras.push(beam([0.0, -0.3, 2.0]));
    let half = (size * size - 0.04f64).sqrt();
    let truth = integral(0.0, 2.0 * half, 600, |t| {
        let x = DVec3::new(0.0, -0.3, half - t);
        // The distance travelled in the solid depends on the direction: quadrature over the light's cone.
        let axis = middle - x;
        let d = axis.length();
        let (axis, edge) = (axis / d, (1.0 - (radius / d).powi(2)).sqrt());
        let side = axis.any_orthonormal_vector();
        let other = axis.cross(side);
        let arriving = integral(edge, 1.0, 24, |c| {
            integral(0.0, 2.0 * PI, 24, |phi| {
                let sine = (1.0 - c * c).sqrt();
                let w = axis * c + (side * phi.cos() + other * phi.sin()) * sine;
                let b = (x - center).dot(w);
                let way = -b + (b * b - (x - center).length_squared() + size * size).sqrt();
                (-SIGMA * way).exp() / (4.0 * PI)
            })
        });
        SIGMA * (-SIGMA * t).exp() * 5.0 * arriving
    });
    assert_radiance("ball beside a body", &scene, &options(16, 256, 1), truth, 4e-3);
}

/// White furnace: media without absorption are invisible: fog, coloured solids, milky glass, nested in each other.
#[test]
fn media_without_absorption_in_a_white_furnace() {
    let glass = |medium| {
        let (ior, tint, fresnel) = (1.5, ColorSlot::constant([1.0; 3]), FresnelModel::Exact);
        Material { medium: Some(medium), ..Material::new("milk", Model::Dielectric { ior, tint, fresnel }) }
    };
    let colored = Medium { extinction: [0.6, 1.0, 1.6], ..medium(1.0, 1.0, 0.5) };
    let mut foggy = lit_all_around();
    foggy.fog = fog(colored, 2.0);
    let mut solid = lit_all_around();
    let filled = body(&mut solid, colored);
    sphere(&mut solid, [0.0; 3], 1.0, filled);
    let mut milky = lit_all_around();
    let milk = material(&mut milky, glass(colored));
    sphere(&mut milky, [0.0; 3], 1.0, milk);
    let mut nested = lit_all_around();
    nested.fog = fog(medium(0.2, 1.0, 0.0), 4.0);
    let (outer, inner) = (body(&mut nested, colored), material(&mut nested, glass(medium(3.0, 1.0, -0.3))));
    let white = material(&mut nested, Material::lambert("white", [1.0; 3]));
    sphere(&mut nested, [0.0; 3], 1.0, outer);
    sphere(&mut nested, [0.1, 0.0, 0.2], 0.5, inner);
    sphere(&mut nested, [-0.2, 0.1, 1.0], 0.3, white);
    // Two that overlap partially.
    let overlapping = body(&mut nested, medium(1.0, 1.0, 0.0));
    sphere(&mut nested, [1.1, 0.5, 0.0], 0.5, overlapping);
    let scenes = [("fog", foggy), ("body", solid), ("milk", milky), ("nested", nested)];
    for (what, mut scene) in scenes {
        let mut view = camera(DVec3::new(0.0, 0.0, 6.0), DVec3::ZERO, DVec3::Y, 1.0);
        view.projection = Projection::Orthographic { half_height: 0.7 };
        scene.cameras.push(view);
        assert_radiance(&format!("furnace, {what}"), &scene, &options(16, 16, 3000), 1.0, 4e-3);
    }
}

/// In a closed box of emission e and albedo p, L = e + p L, whatever scatters in it without absorption, with light samples and
/// phase samples.
#[test]
fn closed_emitting_box_with_fog() {
    let mut scene = Scene::default();
    let mut shiny = Material::emitter("wall", [0.25; 3], false);
    shiny.model = Model::Lambert { albedo: ColorSlot::constant([0.5; 3]) };
    shiny.double_sided = true;
    let wall = material(&mut scene, shiny);
    walls(&mut scene, [1.0, 1.5, 2.0], |_, _| wall);
    scene.fog = fog(Medium { extinction: [0.5, 1.0, 2.0], ..medium(1.0, 1.0, 0.6) }, NO_END);
    let eye = DVec3::new(0.3, -0.2, 0.5);
    scene.cameras.push(camera(eye, eye + DVec3::new(0.5, 0.3, -1.0), DVec3::Y, 90.0));
    assert_radiance("closed box with fog", &scene, &options(16, 64, 2000), 0.5, 3e-3);
}

/// Fog, a null-interface solid, milk in glass, lights of both kinds and a sky.
pub fn everything() -> Scene {
    let mut scene = lit_all_around();
    scene.environment = Environment::Gradient { nadir: [0.1, 0.1, 0.1], zenith: [0.4, 0.6, 1.0] };
    scene.fog = fog(Medium { extinction: [0.1, 0.12, 0.2], ..medium(1.0, 0.9, 0.4) }, 5.0);
    let smoke = body(&mut scene, Medium { emission: [0.3, 0.1, 0.0], ..medium(2.0, 0.7, 0.2) });
    sphere(&mut scene, [-0.8, 0.0, 0.0], 0.7, smoke);
    let values = std::sync::Arc::new((0..9 * 5 * 4).map(|i| (i % 5) as f32).collect());
    let (min, max) = (DVec3::new(-0.5, 0.6, -0.6), DVec3::new(0.3, 1.1, 0.1));
    let grid = scene.add_grid(Grid::in_box("cloud".into(), [9, 5, 4], values, min, max));
    let cloud = body(&mut scene, Medium { grid: Some(grid), ..medium(2.0, 0.9, 0.2) });
    sphere(&mut scene, [-0.1, 0.9, -0.2], 0.6, cloud);
    let tint = ColorSlot::constant([1.0; 3]);
    let model = Model::Dielectric { ior: 1.33, tint, fresnel: FresnelModel::Exact };
    let milk = Material { medium: Some(medium(6.0, 0.99, 0.7)), ..Material::new("milk", model) };
    let milk = material(&mut scene, milk);
    sphere(&mut scene, [0.8, 0.0, 0.0], 0.6, milk);
    let clay = material(&mut scene, Material::lambert("clay", [0.6, 0.4, 0.3]));
    sphere(&mut scene, [0.0, -101.0, 0.0], 100.0, clay);
    let lamp = material(&mut scene, Material::emitter("lamp", [20.0; 3], false));
    sphere(&mut scene, [0.0, 1.2, 0.3], 0.15, lamp);
    let kind = LightKind::Point { position: DVec3::new(-1.5, 1.0, 1.5) };
    scene.lights.push(Light::new(kind, [2.0; 3]));
    scene.cameras.push(camera(DVec3::new(0.0, 0.5, 4.0), DVec3::ZERO, DVec3::Y, 45.0));
    scene
}

#[test]
fn media_are_deterministic() {
    assert_same_bits("media", &everything(), &options(32, 4, 20));
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn splitting_keeps_the_mean_of_media() {
    use oscura::render::Splitting;
    let mut scene = lit_all_around();
    scene.fog = fog(medium(0.3, 0.8, 0.4), 2.0);
    let clay = material(&mut scene, Material::lambert("clay", [0.6, 0.4, 0.3]));
    sphere(&mut scene, [0.0; 3], 0.5, clay);
    scene.cameras.push(camera(DVec3::new(0.0, 0.5, 4.0), DVec3::ZERO, DVec3::Y, 45.0));
    let alone = options(32, 32, 20).splitting(Splitting::OFF);
    let split = alone.splitting(Splitting::Into(4));
    assert!(bits(&picture(&scene, &alone)) != bits(&picture(&scene, &split)));
    assert_same_means("splitting", &scene, [&alone, &split], 16);
}

/// Opaque and nearly absent densities.
#[test]
fn extreme_densities_stay_finite() {
    for extinction in [0.0, 1e-30, 1e-9, 1e6, 1e9] {
        let mut scene = everything();
        let extreme = medium(extinction, 1.0, 0.99);
        scene.fog = fog(extreme, NO_END);
        for material in &mut scene.materials {
            material.medium = material.medium.map(|_| extreme);
        }
        // Counts NaN and infinite samples.
        picture(&scene, &options(16, 4, 30));
    }
}
