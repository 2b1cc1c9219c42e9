//! Caustics scattered by several surfaces before the first visible one: light tracing has the same expected value as camera
//! paths, and that of closed forms that camera paths cannot sample.

use crate::support::differences::{assert_same_bits, assert_same_means, noise};
use crate::support::sheet::{self, Variant};
use crate::support::{
    camera, dielectric, material, measure, options, pbr, place, quad, rendering, sphere, walls,
};
use oscura::math::DVec3;
use oscura::render::{Caustics, Guiding, PathReuse, RenderOptions, Splitting};
use oscura::scene::{
    AlphaMode, ColorSlot, FloatSlot, Light, LightKind, Material, Mesh, Model, NoiseKind, PbrMaterial,
    Projection, Scene, Texture, TextureId,
};

/// Options that differ in caustics only.
fn plain(options: RenderOptions) -> RenderOptions {
    options.path_reuse(PathReuse::Off).splitting(Splitting::OFF)
}

fn rough_diffuse(color: [f32; 3]) -> Material {
    let (color, roughness) = (ColorSlot::constant(color), FloatSlot::constant(0.8));
    Material::new("rough diffuse", Model::OrenNayar { color, roughness })
}

fn mirror() -> Material {
    Material { double_sided: true, ..pbr("mirror", [0.9, 0.9, 1.0], 1.0, 0.0) }
}

/// Walls of `of` around an area light and a sphere.
fn room(of: impl Fn([f32; 3]) -> Material, ball: Material) -> Scene {
    let mut scene = Scene::default();
    let colors = [[0.7, 0.4, 0.3], [0.6; 3], [0.5, 0.5, 0.7], [0.7; 3], [0.3, 0.6, 0.7], [0.6; 3]];
    walls(&mut scene, [1.0; 3], |scene, i| material(scene, of(colors[i])));
    let shine = material(&mut scene, Material::emitter("lamp", [3.0, 2.5, 2.0], true));
    quad(&mut scene, [-0.5, 0.9, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], shine);
    let ball = material(&mut scene, ball);
    sphere(&mut scene, [0.2, -0.5, -0.2], 0.45, ball);
    scene.cameras.push(camera(DVec3::new(-0.8, 0.5, 0.9), DVec3::new(0.1, -0.5, -0.2), DVec3::Y, 60.0));
    scene
}

fn lambert(color: [f32; 3]) -> Material {
    Material::lambert("wall", color)
}

/// A sheet in the room with shading normals tilted by up to 45 degrees.
fn lean(mut scene: Scene, of: Material) -> Scene {
    let of = material(&mut scene, of);
    let corners = [[-1.0f32, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let positions = corners.map(|[a, b]| [-0.5 + 0.3 * a, -0.4 + 0.5 * b, -0.7]).to_vec();
    let mut mesh = Mesh::new("sheet", positions, vec![[0, 1, 2], [0, 2, 3]], of);
    mesh.normals = corners
        .map(|[a, b]| DVec3::new(0.7 * f64::from(a), 0.6 * f64::from(b), 1.0).normalize())
        .map(|n| n.as_vec3().to_array())
        .to_vec();
    place(&mut scene, mesh);
    scene
}

/// A textured, bumpy sheet in a room.
fn painted() -> Scene {
    let mut scene = sheet::scene(&Variant::SMOOTH);
    scene.environment = Scene::default().environment;
    if let Model::Pbr(pbr) = &mut scene.materials[0].model {
        (pbr.roughness, pbr.metallic) = (FloatSlot::constant(0.6), FloatSlot::constant(0.0));
    }
    (scene.materials[0].emission, scene.materials[0].double_sided) = (None, true);
    let wall = material(&mut scene, Material::lambert("wall", [0.7; 3]));
    quad(&mut scene, [-1.0, -1.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], wall);
    let shine = material(&mut scene, Material::emitter("lamp", [3.0; 3], true));
    quad(&mut scene, [-1.0, 1.2, 0.3], [2.0, 0.0, 0.0], [0.0, 0.0, 1.2], shine);
    let clear = material(&mut scene, dielectric(1.5));
    sphere(&mut scene, [0.2, -0.1, 0.6], 0.35, clear);
    scene
}

/// One wall is a mirror. The floor has stripes narrower than a pixel group, alternating between a bright surface that stores
/// photons and a dark one that does so only at random: energy leaking between them would show.
fn striped() -> Scene {
    let mut scene = room(lambert, pbr("polished", [0.9, 0.8, 0.7], 1.0, 0.2));
    let silver = material(&mut scene, mirror());
    quad(&mut scene, [0.98, -1.0, -1.0], [0.0, 0.0, 2.0], [0.0, 2.0, 0.0], silver);
    let shiny = material(&mut scene, pbr("shiny", [0.05; 3], 0.0, 0.3));
    for i in 0..24 {
        let x = -1.0 + f64::from(i) / 12.0;
        quad(&mut scene, [x, -0.99, 1.0], [1.0 / 24.0, 0.0, 0.0], [0.0, 0.0, -2.0], shiny);
    }
    scene.cameras[0] = camera(DVec3::new(-0.4, 0.5, 0.2), DVec3::new(-0.4, -1.0, 0.2), DVec3::Z, 45.0);
    scene
}

/// With partly transparent paper, and a plastic too smooth to store photons.
fn cluttered() -> Scene {
    let mut scene = room(lambert, mirror());
    let mut paper = Material::lambert("paper", [0.7, 0.3, 0.3]);
    (paper.alpha_mode, paper.alpha) = (AlphaMode::Blend, FloatSlot::constant(0.5));
    let paper = material(&mut scene, Material { double_sided: true, ..paper });
    quad(&mut scene, [-0.9, -0.9, -0.5], [0.8, 0.0, 0.2], [0.0, 1.0, 0.0], paper);
    let smooth = material(&mut scene, pbr("smooth", [0.5, 0.6, 0.7], 0.0, 0.2));
    quad(&mut scene, [-0.3, -0.98, 0.9], [1.2, 0.0, 0.0], [0.0, 0.0, -0.6], smooth);
    let small = material(&mut scene, dielectric(1.5));
    sphere(&mut scene, [-0.5, -0.75, 0.3], 0.2, small);
    scene
}

/// With a sphere of polished metal with a textured colour.
fn colored_metal() -> Scene {
    let mut scene = room(lambert, dielectric(1.5));
    let kind = NoiseKind::Turbulence;
    let (low, high) = ([0.9, 0.3, 0.2], [0.3, 0.8, 0.9]);
    scene.textures.push(Texture::Noise { kind, frequency: 4.0, octaves: 2, low, high, seed: 0 });
    let pbr = PbrMaterial {
        base_color: ColorSlot::texture(TextureId(0)),
        roughness: FloatSlot::constant(0.1),
        ..PbrMaterial::default()
    };
    let metal = material(&mut scene, Material::new("colored metal", Model::Pbr(Box::new(pbr))));
    scene.shapes[0].material = metal;
    scene
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn caustics_keep_the_mean() {
    let polished = || pbr("polished", [0.9, 0.8, 0.7], 1.0, 0.2);
    let plastic = |color| pbr("plastic", color, 0.0, 0.45);
    let scenes = [
        ("diffuse", room(lambert, dielectric(1.5))),
        ("rough diffuse", room(rough_diffuse, mirror())),
        ("plastic", room(plastic, polished())),
        ("leaning", lean(room(lambert, dielectric(1.5)), lambert([0.8; 3]))),
        ("leaning plastic", lean(room(lambert, dielectric(1.5)), plastic([0.8; 3]))),
        ("cluttered", cluttered()),
        ("painted", painted()),
        ("colored metal", colored_metal()),
    ];
    for (what, scene) in &scenes {
        let mut first = rendering(scene, &options(8, 1, 10).caustics(Caustics::On));
        first.run();
        assert!(first.statistics().light_paths.is_some(), "{what}: there are caustics");
        let off = plain(options(32, 32, 10)).caustics(Caustics::Off);
        assert_same_means(what, scene, [&off, &off.caustics(Caustics::On)], 64);
    }
}

#[test]
fn caustics_keep_the_mean_at_every_depth() {
    let scene = room(lambert, dielectric(1.5));
    for depth in [2, 3, 4] {
        let off = plain(options(32, 32, depth)).caustics(Caustics::Off);
        assert_same_means(&format!("depth {depth}"), &scene, [&off, &off.caustics(Caustics::On)], 32);
    }
}

#[test]
#[ignore = "means of many pictures, which take long"]
fn caustics_keep_the_mean_with_all_techniques() {
    let scene = striped();
    let off = plain(options(64, 32, 10)).caustics(Caustics::Off);
    let on = off.caustics(Caustics::On);
    let shared = on.path_reuse(PathReuse::Groups("4x4/2".parse().expect("a shape")));
    let ways = [
        ("shared", shared),
        ("split", on.splitting(Splitting::Into(4))),
        ("guided", on.guiding(Guiding::On)),
        ("guided and shared", shared.guiding(Guiding::On)),
    ];
    for (what, on) in &ways {
        assert_same_means(what, &scene, [&off, on], 40);
    }
    // Energy that is lost or counted twice would be hidden by the noise of glass.
    let diffuse = room(lambert, mirror());
    assert_same_means("shared in a plain room", &diffuse, [&off, &shared], 24);
}

/// With a small area light.
fn dim_room() -> Scene {
    let mut scene = room(lambert, dielectric(1.5));
    let shine = material(&mut scene, Material::emitter("small lamp", [40.0, 30.0, 20.0], false));
    // The lamp is the last of the quads.
    scene.quads.pop();
    quad(&mut scene, [-0.1, 0.9, -0.1], [0.2, 0.0, 0.0], [0.0, 0.0, 0.2], shine);
    scene
}

#[test]
fn caustics_reduce_noise() {
    let options = plain(options(64, 32, 12));
    // Away from the sphere: what is seen in it is left to camera paths.
    let mut scene = dim_room();
    scene.cameras[0] = camera(DVec3::new(-0.8, 0.6, -0.8), DVec3::new(0.2, 0.4, 1.0), DVec3::Y, 40.0);
    let [auto, off] = [Caustics::Auto, Caustics::Off].map(|c| noise(&scene, &options.caustics(c)));
    println!("auto {auto:.2e}, off {off:.2e}");
    assert!(auto < 0.5 * off, "{auto} {off}");
}

#[test]
fn caustics_are_deterministic() {
    let shape = "2x2/1".parse().expect("a shape");
    let options = options(48, 9, 12).splitting(Splitting::OFF).path_reuse(PathReuse::Groups(shape));
    assert_same_bits("room", &cluttered(), &plain(options).caustics(Caustics::On));
    assert_same_bits("shared room", &striped(), &options.caustics(Caustics::On));
}

/// A point light between a mirror and a screen; the camera looks past the screen at light scattered by surfaces that store
/// photons and by one that does so only at random. `image` replaces the mirror by mirrored geometry.
fn behind_a_screen(image: bool) -> Scene {
    let mut scene = Scene::default();
    let floor = material(&mut scene, Material::lambert("floor", [0.8, 0.7, 0.6]));
    let wall = material(&mut scene, Material { double_sided: true, ..pbr("wall", [0.8; 3], 0.0, 0.5) });
    let shiny = material(&mut scene, Material { double_sided: true, ..pbr("shiny", [0.8; 3], 0.0, 0.3) });
    // The mirror is the plane x = 1.
    for flip in [1.0, -1.0].into_iter().take(if image { 2 } else { 1 }) {
        let x = |x: f64| 1.0 - flip * (1.0 - x);
        quad(&mut scene, [x(-3.0), 0.0, 3.0], [flip * 4.0, 0.0, 0.0], [0.0, 0.0, -6.0], floor);
        quad(&mut scene, [x(0.4), 0.0, 3.0], [0.0, 0.0, -6.0], [0.0, 0.4, 0.0], wall);
        quad(&mut scene, [x(-1.0), 0.0, 1.5], [0.0, 0.0, -3.0], [0.0, 2.0, 0.0], wall);
        quad(&mut scene, [x(-1.0), 0.0, -0.6], [flip * 2.0, 0.0, 0.0], [0.0, 1.5, 0.0], shiny);
        let position = DVec3::new(x(0.7), 0.3, 0.1);
        scene.lights.push(Light::new(LightKind::Point { position }, [4.0; 3]));
    }
    if !image {
        let mirror = Material { double_sided: true, ..pbr("mirror", [1.0; 3], 1.0, 0.0) };
        let mirror = material(&mut scene, mirror);
        quad(&mut scene, [1.0, -1.0, -9.0], [0.0, 0.0, 18.0], [0.0, 18.0, 0.0], mirror);
    }
    let mut view = camera(DVec3::new(-0.3, 1.8, 0.1), DVec3::new(-0.3, 0.0, 0.1), DVec3::Z, 1.0);
    view.projection = Projection::Orthographic { half_height: 0.3 };
    scene.cameras.push(view);
    scene
}

/// A point light reflected by a mirror around a room, over any surfaces: as if the mirrored light was there.
#[test]
#[ignore = "means of many pictures, which take long"]
fn mirror_equals_mirrored_light() {
    // The mirrored scene spends no bounce on the mirror; the energy beyond so many bounces is negligible.
    let plain = plain(options(16, 2048, 40));
    let (truth, error_of_truth) = measure(&behind_a_screen(true), &plain);
    let (found, error) = measure(&behind_a_screen(false), &plain);
    let (without, _) = measure(&behind_a_screen(false), &plain.caustics(Caustics::Off));
    let both = error.hypot(error_of_truth);
    println!("{found:.5} +- {error:.5}, truth {truth:.5} +- {error_of_truth:.5}, without {without:.5}");
    assert!(both < 4e-3 * truth && (found - truth).abs() < 4.5 * both, "{found} {truth} +- {both}");
    assert!(without < 0.9 * truth);
}

/// Fewer light paths than pixels suffice.
#[test]
fn few_light_paths_suffice() {
    let mut rendering = rendering(&dim_room(), &options(64, 8, 12));
    rendering.run();
    let paths = rendering.statistics().light_paths.expect("the picture gains");
    assert!(paths < 64 * 64, "{paths}");
}
