//! Path limits: bounces per type, and clamping.

use crate::support::differences::{assert_same_bits, bits};
use crate::support::{
    assert_radiance, camera, dielectric, grey_floor, material, mean, measure, options, pbr, picture, quad,
    sphere, translucent, walls,
};
use oscura::Renderer;
use oscura::math::DVec3;
use oscura::render::{Caustics, Guiding, PathReuse, RenderOptions, Splitting};
use oscura::scene::{
    AlphaMode, BounceLimits, Clamp, Clearcoat, ColorSlot, Emission, EnergyCompensation, Environment,
    FloatSlot, Fog, FresnelModel, Light, LightKind, Material, Medium, Model, PbrMaterial, Scene,
    SkippedCaustics,
};
use std::f64::consts::PI;

const FREE: BounceLimits = BounceLimits::NONE;

/// Without techniques that limits disable.
fn plain(size: u32, samples: u32) -> RenderOptions {
    options(size, samples, 100).path_reuse(PathReuse::Off).splitting(Splitting::OFF).guiding(Guiding::Off)
}

/// A room whose walls have emission 1 and albedo 0.5.
fn glowing_room() -> Scene {
    let mut scene = Scene::default();
    let emission = Emission { radiance: ColorSlot::constant([1.0; 3]), two_sided: false };
    let wall = Material { emission: Some(emission), ..Material::lambert("wall", [0.5; 3]) };
    let wall = material(&mut scene, wall);
    walls(&mut scene, [1.0; 3], |_, _| wall);
    scene.cameras.push(camera(DVec3::new(0.3, 0.2, 0.5), DVec3::new(-1.0, 0.1, 0.0), DVec3::Y, 20.0));
    scene
}

/// Each bounce in an enclosure has half the radiance of the one before.
#[test]
fn diffuse_bounce_limit() {
    let scene = glowing_room();
    for diffuse in [1, 2, 4] {
        let truth = 2.0 - 0.5f64.powi(diffuse as i32);
        let limited = plain(8, 256).bounces(BounceLimits { diffuse, ..FREE });
        assert_radiance(&format!("{diffuse} diffuse"), &scene, &limited, truth, 3e-3);
        // There are no other bounces.
        let other = BounceLimits { glossy: diffuse, transmission: diffuse, volume: diffuse, ..FREE };
        let film = |o: RenderOptions| bits(&picture(&scene, &o));
        assert!(film(limited) == film(plain(8, 256).max_depth(diffuse)), "as few bounces in all");
        assert!(film(plain(8, 256).bounces(other)) == film(plain(8, 256)), "other kinds");
    }
}

/// A white translucent sphere of radius 1 in a white furnace, with Lambertian entry and exit: limited to one event, the
/// unscattered part of a chord 2 cos is left, the integral of 2 cos exp(-2 s cos) over the cosine; with many events all light.
#[test]
fn subsurface_bounce_limit() {
    for (extinction, subsurface) in [(0.5f64, 1), (2.0, 1), (2.0, 10_000)] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let medium = Medium { albedo: [1.0; 3], ..Medium::scattering([extinction as f32; 3]) };
        let wax = translucent(&mut scene, medium);
        sphere(&mut scene, [0.0; 3], 1.0, wax);
        scene.cameras.push(camera(DVec3::new(0.0, 0.0, 50.0), DVec3::ZERO, DVec3::Y, 1.0));
        let d = 2.0 * extinction;
        let truth = if subsurface == 1 { 2.0 * (1.0 - (-d).exp() * (1.0 + d)) / (d * d) } else { 1.0 };
        let limited = plain(16, 256).bounces(BounceLimits { subsurface, ..FREE });
        assert_radiance(&format!("{extinction}, {subsurface} events"), &scene, &limited, truth, 0.01);
    }
}

/// Sheets of alpha 0.5: camera rays pass up to the limit and end at the next surface; shadow rays pass one less.
#[test]
fn transparent_bounce_limit() {
    let stack = |scene: &mut Scene, sheets: u32| {
        let (alpha_mode, alpha) = (AlphaMode::Blend, FloatSlot::constant(0.5));
        let sheet = material(scene, Material { alpha_mode, alpha, ..Material::lambert("sheet", [0.0; 3]) });
        for y in (0..sheets).map(|k| 2.0 + f64::from(k)) {
            quad(scene, [-9.0, y, 9.0], [18.0, 0.0, 0.0], [0.0, 0.0, -18.0], sheet);
        }
    };
    for sheets in [2, 4] {
        let mut sky = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        stack(&mut sky, sheets);
        sky.cameras.push(camera(DVec3::ZERO, DVec3::Y, DVec3::X, 1.0));
        let mut lit = grey_floor();
        stack(&mut lit, sheets);
        lit.lights.push(Light::new(LightKind::Directional { direction: DVec3::NEG_Y }, [PI as f32; 3]));
        let left = 0.5f64.powi(sheets as i32);
        for (transparent, seen, shone) in
            [(sheets - 1, 0.0, 0.0), (sheets, left, 0.0), (sheets + 1, left, 0.8 * left)]
        {
            let limited = plain(16, 64).max_depth(1).bounces(BounceLimits { transparent, ..FREE });
            assert_radiance(&format!("{transparent} of {sheets}, seen"), &sky, &limited, seen, 0.02);
            assert_radiance(&format!("{transparent} of {sheets}, lit"), &lit, &limited, shone, 0.02);
        }
    }
}

/// Two perpendicular mirrors show a uniform sky after two reflections, two solids after four refractions.
#[test]
fn glossy_and_transmission_bounce_limits() {
    let sky = || Scene { environment: Environment::Constant([4.0, 1.0, 1.0]), ..Scene::default() };
    let mut corner = sky();
    let mirror = material(&mut corner, pbr("mirror", [1.0; 3], 1.0, 0.0));
    quad(&mut corner, [0.0, 0.0, 9.0], [9.0, 0.0, 0.0], [0.0, 0.0, -18.0], mirror);
    quad(&mut corner, [0.0, 0.0, -9.0], [0.0, 9.0, 0.0], [0.0, 0.0, 18.0], mirror);
    corner.cameras.push(camera(DVec3::new(3.0, 1.0, 0.0), DVec3::new(1.0, 0.0, 0.0), DVec3::Y, 1.0));
    let mut balls = sky();
    let glass = material(&mut balls, dielectric(1.0001));
    sphere(&mut balls, [0.0, 0.0, 2.0], 1.0, glass);
    sphere(&mut balls, [0.0, 0.0, -2.0], 1.0, glass);
    balls.cameras.push(camera(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, DVec3::Y, 1.0));
    let few = options(8, 16, 100);
    let seen = |scene: &Scene, bounces| mean(&picture(scene, &few.bounces(bounces)));
    for (limit, truth) in [(1, 0.0), (2, 1.0)] {
        let found = seen(&corner, BounceLimits { glossy: limit, ..FREE });
        assert!((found - truth).abs() < 1e-4, "{limit} reflections: {found}");
    }
    for (limit, truth) in [(3, 0.0), (4, 1.0)] {
        let found = seen(&balls, BounceLimits { transmission: limit, ..FREE });
        assert!((found - truth).abs() < 1e-4, "{limit} refractions: {found}");
    }
    // Clamping: the sum of the channels, 6, becomes three times the limit; two reflections count as indirect light.
    let clamped =
        |scene: &Scene, direct, indirect| mean(&picture(scene, &few.clamp(Clamp { direct, indirect })));
    for (direct, indirect, truth) in [(1.0, 9.0, 1.0), (9.0, 1.0, 0.5), (9.0, 2.0, 1.0)] {
        let found = clamped(&corner, direct, indirect);
        assert!((found - truth).abs() < 1e-4, "direct {direct}, indirect {indirect}: {found}");
    }
    corner.quads.truncate(1);
    for (direct, indirect, truth) in [(1.0, 9.0, 0.5), (9.0, 1.0, 1.0)] {
        let found = clamped(&corner, direct, indirect);
        assert!((found - truth).abs() < 1e-4, "one mirror, direct {direct}, indirect {indirect}: {found}");
    }
}

/// In dense fog the volume limit equals the total limit.
#[test]
fn volume_bounce_limit() {
    let mut scene = Scene::default();
    let (extinction, albedo) = ([0.4; 3], [0.9; 3]);
    let medium = Medium { albedo, anisotropy: 0.3, ..Medium::scattering(extinction) };
    scene.fog = Some(Fog { medium, center: DVec3::ZERO, radius: 5.0 });
    scene.lights.push(Light::point([0.5, 1.0, 0.0], [5.0; 3]));
    scene.cameras.push(camera(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, DVec3::Y, 50.0));
    let film = |o: RenderOptions| bits(&picture(&scene, &o));
    for volume in [1, 3] {
        let limited = film(plain(16, 16).bounces(BounceLimits { volume, ..FREE }));
        assert!(limited == film(plain(16, 16).max_depth(volume)), "{volume} bounces");
        assert!(limited != film(plain(16, 16)), "more light than of {volume} bounces");
    }
}

/// A room with all types of surfaces and a small light.
fn mixed_room() -> Scene {
    let mut scene = Scene::default();
    let surfaces = [
        Material::lambert("red", [0.8, 0.2, 0.1]),
        pbr("plastic", [0.2, 0.7, 0.3], 0.0, 0.3),
        pbr("half metal", [0.8, 0.7, 0.6], 0.5, 0.4),
        Material::lambert("white", [0.8; 3]),
        pbr("metal", [0.9, 0.8, 0.7], 1.0, 0.2),
        Material::lambert("green", [0.1, 0.7, 0.2]),
    ];
    walls(&mut scene, [1.0; 3], |scene, i| material(scene, surfaces[i].clone()));
    let lamp = material(&mut scene, Material::emitter("lamp", [20.0; 3], false));
    quad(&mut scene, [-0.3, 0.9, -0.3], [0.6, 0.0, 0.0], [0.0, 0.0, 0.6], lamp);
    scene.cameras.push(camera(DVec3::new(0.0, 0.0, 0.9), DVec3::ZERO, DVec3::Y, 70.0));
    scene
}

/// Limits hold for all techniques, deterministically.
#[test]
fn limits_hold_for_all_techniques() {
    let scene = mixed_room();
    let bounces = BounceLimits { diffuse: 2, glossy: 2, ..FREE };
    let limited = plain(32, 64).bounces(bounces);
    let (truth, error) = measure(&scene, &limited);
    for (what, with) in
        [("splitting", limited.splitting(Splitting::Into(4))), ("guiding", limited.guiding(Guiding::On))]
    {
        let (found, of_found) = measure(&scene, &with);
        let error = error.hypot(of_found);
        println!("{what}: {found} and {truth} without, +- {error}");
        assert!(error < 5e-3 * truth, "{what}: the standard error {error} tells nothing");
        assert!((found - truth).abs() < 4.5 * error, "{what}: {found} and {truth} without, +- {error}");
    }
    let clamp = Clamp { direct: 10.0, indirect: 0.5 };
    assert_same_bits("limits", &scene, &options(16, 8, 100).bounces(bounces).clamp(clamp));
    // Clamping only removes light.
    let [less, more] = [limited.clamp(clamp), limited].map(|o| mean(&picture(&scene, &o)));
    assert!(less < more, "{less} of {more}");
}

/// After a diffuse bounce, strong glossy filtering roughens all facets to a GGX alpha of 0.5.
#[test]
fn glossy_filter_roughens_after_diffuse_bounces() {
    let room = |wall: Material| {
        let mut scene = grey_floor();
        let wall = material(&mut scene, wall);
        quad(&mut scene, [1.0, 0.0, -2.0], [0.0, 0.0, 4.0], [0.0, 2.0, 0.0], wall);
        scene.lights.push(Light::point([-2.0, 3.0, 0.5], [50.0; 3]));
        scene
    };
    // With a clearcoat, so that all lobes are present.
    let coated = |roughness: f32| {
        let mut metal = PbrMaterial {
            base_color: ColorSlot::constant([0.9; 3]),
            roughness: FloatSlot::constant(roughness),
            ..PbrMaterial::default()
        };
        let (factor, roughness) = (FloatSlot::constant(1.0), FloatSlot::constant(roughness));
        metal.clearcoat = Some(Clearcoat { factor, roughness, normal_map: None });
        Material::gltf("coated", metal)
    };
    let conductor = |roughness: f32| {
        let roughness = FloatSlot::constant(roughness);
        Material::new("metal", Model::Conductor { metal: None, eta: [0.2; 3], k: [3.0; 3], roughness })
    };
    let rough = 0.5f32.sqrt();
    let lit = plain(8, 1024);
    for (what, [smooth, rough]) in [
        ("coated", [coated(0.3), coated(rough)]),
        ("conductor", [conductor(0.3), conductor(rough)]),
        ("mirror", [conductor(0.0), conductor(rough)]),
    ] {
        let (smooth, rough) = (room(smooth), room(rough));
        let (truth, error) = measure(&rough, &lit);
        let (other, _) = measure(&smooth, &lit);
        assert!((other - truth).abs() > 20.0 * error, "{what}: {other} is as bright as {truth}");
        let (found, of_found) = measure(&smooth, &lit.filter_glossy(1e9));
        let error = error.hypot(of_found);
        println!("{what}: {found}, {truth} where it is rough, {other} where smooth, +- {error}");
        assert!((found - truth).abs() < 4.5 * error, "{what}: {found} for {truth} +- {error}");
    }
    // Weights of vectorised closures are those of the smooth material, as in Cycles: energy lost by single scattering is not
    // compensated.
    let metal = |roughness: f32| {
        let mut scene = room(pbr("metal", [0.9; 3], 1.0, roughness));
        scene.settings.energy_compensation = Some(EnergyCompensation::Off);
        scene
    };
    let by = |scene: Scene, strength: f32| {
        let picture = Renderer::new(scene).size(8, 8).samples(4096).filter_glossy(strength);
        mean(&picture.render().expect("it renders").into_film())
    };
    let (smooth, filtered, rough) = (by(metal(0.3), 0.0), by(metal(0.3), 1e9), by(metal(rough), 0.0));
    println!("metal: {filtered}, {rough} where it is rough, {smooth} where smooth");
    assert!((filtered - rough).abs() < 0.03 * (smooth - rough).abs(), "{filtered} for {rough}, not {smooth}");
}

/// Smooth glass is roughened as well: next-event estimation of a light behind it succeeds.
#[test]
fn glossy_filter_roughens_smooth_glass() {
    let room = |model: Model| {
        let mut scene = grey_floor();
        scene.settings.energy_compensation = Some(EnergyCompensation::Off);
        let glass = material(&mut scene, Material::new("glass", model));
        sphere(&mut scene, [1.5, 0.7, 0.0], 0.6, glass);
        scene.lights.push(Light::point([3.0, 1.4, 0.0], [50.0; 3]));
        scene
    };
    let tint = ColorSlot::constant([0.9; 3]);
    let glass = |roughness: f32| {
        let roughness = FloatSlot::constant(roughness);
        Model::Glass { ior: 1.5, tint, roughness, is_thin: false }
    };
    let by = |model: Model, strength: f32| {
        let picture = Renderer::new(room(model)).size(8, 8).samples(4096).filter_glossy(strength);
        mean(&picture.caustics(Caustics::Off).render().expect("it renders").into_film())
    };
    // Filtered, all paths go through rough glass.
    let rough = by(glass(0.5f32.sqrt()), 0.0);
    let dielectric = Model::Dielectric { ior: 1.5, tint, fresnel: FresnelModel::Exact };
    for smooth in [glass(0.0), dielectric] {
        let (filtered, sharp) = (by(smooth.clone(), 1e9), by(smooth, 0.0));
        println!("{filtered}, {rough} where it is rough, {sharp} where smooth");
        assert!((filtered / rough - 1.0).abs() < 2e-3, "{filtered} for {rough}");
        assert!(sharp < 0.9 * rough, "{sharp} is as bright as {rough}");
    }
}

/// With caustics off, surfaces hit by diffuse rays have no glossy lobes, or no transmission.
#[test]
fn disabled_caustics_affect_diffuse_rays_only() {
    let room = |wall: Material| {
        let mut scene = grey_floor();
        scene.environment = Environment::Constant([0.5; 3]);
        let wall = material(&mut scene, wall);
        quad(&mut scene, [1.0, 0.0, -2.0], [0.0, 0.0, 4.0], [0.0, 2.0, 0.0], wall);
        scene.lights.push(Light::point([-2.0, 3.0, 0.5], [50.0; 3]));
        scene
    };
    let tint = ColorSlot::constant([0.9; 3]);
    let rough = FloatSlot::constant(0.3);
    let metal = Material::new(
        "metal",
        Model::Conductor { metal: None, eta: [0.2; 3], k: [3.0; 3], roughness: rough },
    );
    let glass = Material::new("glass", Model::Dielectric { ior: 1.5, tint, fresnel: FresnelModel::Exact });
    let black = || Material::new("black", Model::Black);
    let lit = plain(8, 1024);
    let [reflective, refractive] = [(true, false), (true, true)]
        .map(|(reflective, refractive)| lit.skip_caustics(SkippedCaustics { reflective, refractive }));
    let cases = [
        ("metal", metal, black(), reflective),
        ("paint", pbr("paint", [0.5; 3], 0.0, 0.3), Material::lambert("matt", [0.5; 3]), reflective),
        ("half metal", pbr("half", [0.5; 3], 0.5, 0.3), Material::lambert("dark", [0.25; 3]), reflective),
        ("glass", glass, black(), refractive),
    ];
    for (what, glossy, left, skipping) in cases {
        let (glossy, left) = (room(glossy), room(left));
        let (truth, error) = measure(&left, &lit);
        let (other, _) = measure(&glossy, &lit);
        assert!((other - truth).abs() > 8.0 * error, "{what}: {other} is as bright as {truth}");
        let (found, of_found) = measure(&glossy, &skipping);
        let error = error.hypot(of_found);
        println!("{what}: {found}, {truth} expected, {other} with caustics, +- {error}");
        assert!((found - truth).abs() < 4.5 * error, "{what}: {found} for {truth} +- {error}");
    }
}
