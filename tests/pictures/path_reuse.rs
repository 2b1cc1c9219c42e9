//! Path sharing between pixels: the same expected value, less noise, and deterministic.

use crate::support::differences::{assert_same_bits, assert_same_means, bits, differences, noise};
use crate::support::sheet::{self, Variant};
use crate::support::{
    assert_radiance, block, camera, dielectric, material, mean, options, pbr, picture, quad, rendering,
    sphere, walls,
};
use oscura::math::{DAffine3, DVec3, Vec3};
use oscura::render::{GroupShape, PassOutcome, PathReuse, RenderOptions, Splitting};
use oscura::scene::{
    AlphaMode, BounceLimits, Clamp, ColorSlot, DiffuseTransmission, Environment, FloatSlot, Instance,
    Material, Medium, Mesh, MeshId, MeshPart, MixComponent, Model, PbrMaterial, Scene, SkippedCaustics,
    Texture,
};
use std::path::Path;

fn groups(shape: &str) -> PathReuse {
    shape.parse().expect("a shape of groups")
}

fn room_camera(scene: &mut Scene) {
    let eye = DVec3::new(0.2, 0.1, 0.95);
    scene.cameras.push(camera(eye, DVec3::new(0.0, -0.1, 0.0), DVec3::Y, 80.0));
}

/// A room of all vertex classes, lit by an area light that faces the ceiling: mostly indirect light.
fn room() -> Scene {
    let mut scene = Scene::default();
    let surfaces = [
        Material::lambert("red", [0.8, 0.2, 0.1]),
        pbr("plastic", [0.2, 0.7, 0.3], 0.0, 0.5),
        pbr("half metal", [0.8, 0.7, 0.6], 0.5, 0.4),
        Material::lambert("white", [0.8; 3]),
        pbr("gloss", [0.5, 0.5, 0.8], 0.0, 0.15),
        Material::lambert("black in green", [0.7, 0.0, 0.7]),
    ];
    walls(&mut scene, [1.0; 3], |scene, i| material(scene, surfaces[i].clone()));
    let metal = material(&mut scene, pbr("metal", [0.9, 0.6, 0.3], 1.0, 0.45));
    sphere(&mut scene, [-0.5, -0.7, -0.3], 0.3, metal);
    let glass = material(&mut scene, dielectric(1.5));
    sphere(&mut scene, [0.4, -0.6, 0.1], 0.25, glass);
    let lamp = material(&mut scene, Material::emitter("lamp", [20.0; 3], false));
    quad(&mut scene, [-0.3, 0.3, -0.3], [0.0, 0.0, 0.6], [0.6, 0.0, 0.0], lamp);
    room_camera(&mut scene);
    scene
}

/// A wavy, textured, normal-mapped plastic sheet over a floor, under a uniform sky.
fn waves() -> Scene {
    let mut scene = sheet::scene(&Variant::SMOOTH);
    let wall = material(&mut scene, pbr("wall", [0.9; 3], 0.0, 0.3));
    quad(&mut scene, [-2.0, -1.0, -0.5], [4.0, 0.0, 0.0], [0.0, 0.0, 1.5], wall);
    quad(&mut scene, [1.0, -1.0, -0.5], [0.0, 2.0, 0.0], [0.0, 0.0, 1.5], wall);
    scene.environment = Environment::Constant([1.0, 0.9, 0.7]);
    scene
}

/// A corner of rough plastic with shading normals tilted by up to 50 degrees, which many viewing directions make invalid.
fn steep() -> Scene {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let plastic = material(&mut scene, pbr("plastic", [0.8, 0.5, 0.3], 0.0, 0.6));
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    // Two sheets at a right angle: y = 0 and z = -1.
    for tall in [false, true] {
        let place = |[a, b]: [f32; 2]| if tall { [a, b + 1.0, -1.0] } else { [a, 0.0, b] };
        let lean = |[a, b]: [f32; 2]| {
            let (up, along) = (1.0f32, [0.9 * a, 0.8 * b]);
            let n = if tall { Vec3::new(along[0], along[1], up) } else { Vec3::new(along[0], up, along[1]) };
            n.normalize().to_array()
        };
        scene.meshes.push(Mesh {
            name: "sheet".into(),
            positions: corners.map(place).to_vec(),
            normals: corners.map(lean).to_vec(),
            triangles: if tall { vec![[0, 1, 2], [0, 2, 3]] } else { vec![[0, 2, 1], [0, 3, 2]] },
            parts: vec![MeshPart { first_triangle: 0, triangle_count: 2, material: plastic }],
            ..Mesh::default()
        });
        scene.instances.push(Instance {
            name: "sheet".into(),
            ..Instance::new(MeshId(scene.meshes.len() as u32 - 1), DAffine3::IDENTITY)
        });
    }
    scene.cameras.push(camera(DVec3::new(0.5, 1.0, 1.5), DVec3::new(0.0, 0.3, -0.6), DVec3::Y, 60.0));
    scene
}

const EDGE: u32 = 40;

/// Blocks of pictures with and without path sharing have the same means: differences match their standard errors. Blocks contain
/// whole groups, so that correlation within groups is in those errors.
#[test]
#[ignore = "means of many pictures, which take long"]
fn sharing_keeps_the_mean() {
    for (name, scene) in [("room", room()), ("waves", waves()), ("steep", steep())] {
        for (depth, shape) in [(100, "4x4/2"), (2, "2x2/1"), (4, "8x8/4"), (3, "2x1/1")] {
            let options = options(EDGE, 32, depth).path_reuse(PathReuse::Off);
            let what = format!("{name}, depth {depth}, {shape}");
            assert_same_means(&what, &scene, [&options, &options.path_reuse(groups(shape))], 16);
        }
    }
}

/// In a closed box of emission e and albedo p, L = e + p L, with and without sharing.
#[test]
#[ignore = "means of many pictures, which take long"]
fn closed_emitting_box() {
    for shape in ["1x2/1", "2x2/1", "4x4/4", "8x8/2"] {
        let mut scene = Scene::default();
        let albedo = 0.7f32;
        walls(&mut scene, [1.0; 3], |scene, _| {
            let mut wall = Material::emitter("wall", [0.25; 3], false);
            wall.model = Model::Lambert { albedo: ColorSlot::constant([albedo; 3]) };
            material(scene, wall)
        });
        room_camera(&mut scene);
        let truth = 0.25 / (1.0 - f64::from(albedo));
        let options = options(32, 32, 2000).path_reuse(groups(shape));
        assert_radiance(&format!("closed box, {shape}"), &scene, &options, truth, 2e-3);
    }
}

#[test]
fn sharing_lowers_the_noise_of_indirect_light() {
    let (scene, options) = (room(), options(64, 8, 100));
    let off = noise(&scene, &options.path_reuse(PathReuse::Off));
    let on = noise(&scene, &options.path_reuse(groups("4x4/4")));
    println!("variance / {:.2}", off / on);
    assert!(off > 2.0 * on, "{off} {on}");
}

#[test]
fn sharing_is_deterministic() {
    for (name, scene) in [("room", room()), ("waves", waves())] {
        for reuse in [groups("4x4/4"), groups("8x8/4"), PathReuse::Auto] {
            let options = options(80, 5, 100).path_reuse(reuse);
            assert_same_bits(&format!("{name}, {reuse:?}"), &scene, &options);
        }
    }
}

/// All picture sizes and passes get all their samples; the film after a pass equals a picture of that many samples.
#[test]
fn any_picture_size_and_pass_count() {
    let scene = room();
    for (width, height) in [(1, 1), (16, 16), (17, 33), (70, 5)] {
        for shape in ["2x1/1", "4x4/4", "8x8/4"] {
            let options = options(1, 21, 3).size(width, height).path_reuse(groups(shape));
            let [mut steps, mut fewer] = [21, 17].map(|samples| rendering(&scene, &options.samples(samples)));
            for _ in 0..2 {
                assert_eq!([steps.next_pass(), fewer.next_pass()], [PassOutcome::Progressed; 2]);
                assert!(bits(steps.film()) == bits(fewer.film()), "{width} {height} {shape}");
            }
            assert_eq!(steps.statistics().path_reuse, Some(shape.parse::<GroupShape>().unwrap()));
            assert_eq!([steps.next_pass(), fewer.next_pass()], [PassOutcome::Done; 2]);
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                assert_eq!((steps.film().samples(x, y), fewer.film().samples(x, y)), (21, 17));
            }
        }
    }
}

#[test]
fn sharing_without_indirect_light_is_reported() {
    let scene = room();
    for depth in [0, 1] {
        let mut forced = rendering(&scene, &options(20, 8, depth).path_reuse(groups("4x4")));
        forced.run();
        assert!(forced.warnings().iter().any(|w| w.code == "technique-unused"));
        let off = picture(&scene, &options(20, 8, depth).path_reuse(PathReuse::Off));
        assert!(bits(forced.film()) == bits(&off));
    }
}

/// Group sizes are chosen by a pilot: shared where it reduces noise.
#[test]
fn pilot_chooses_group_sizes() {
    let chosen = |scene: &Scene, options: &RenderOptions| {
        let mut rendering = rendering(scene, options);
        rendering.run();
        (rendering.statistics().path_reuse, rendering.statistics().rays)
    };
    let options = options(256, 4, 100);
    // Without glass and glossy surfaces.
    let mut room = Scene::default();
    walls(&mut room, [1.0; 3], |scene, _| material(scene, Material::lambert("white", [0.8; 3])));
    let lamp = material(&mut room, Material::emitter("lamp", [20.0; 3], false));
    quad(&mut room, [-0.3, 0.3, -0.3], [0.0, 0.0, 0.6], [0.6, 0.0, 0.0], lamp);
    room_camera(&mut room);
    let (shape, _) = chosen(&room, &options);
    println!("room: {shape:?}");
    assert!(shape.is_some());
    // A convex object under a uniform sky: no second hits.
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    sphere(&mut scene, [0.0; 3], 1.0, grey);
    scene.cameras.push(camera(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y, 60.0));
    let (shape, rays) = chosen(&scene, &options);
    let (_, rays_without) = chosen(&scene, &options.path_reuse(PathReuse::Off));
    assert_eq!((shape, rays), (None, rays_without));
}

/// What blocks connections in the room, or what they start at.
#[derive(Clone, Copy, Debug)]
enum Crowd {
    /// Paper of partial alpha, thin glass, a solid pane.
    Sheets,
    /// Mixes of three materials, with view-dependent or constant weights.
    Mixes,
    /// Unbounded fog, and a subsurface solid.
    Bodies,
}

/// The room with more obstacles.
fn crowded(crowd: Crowd) -> Scene {
    let mut scene = room();
    let constant = |w: f32| ColorSlot::constant([w; 3]);
    match crowd {
        Crowd::Sheets => {
            let mut paper = Material::lambert("paper", [0.7; 3]);
            (paper.alpha_mode, paper.alpha) = (AlphaMode::Blend, FloatSlot::constant(0.4));
            let paper = material(&mut scene, paper);
            quad(&mut scene, [-0.7, -0.6, -0.8], [0.7, 0.0, 0.2], [0.0, 0.9, 0.0], paper);
            let (none, whole) = (FloatSlot::constant(0.0), FloatSlot::constant(1.0));
            let clear = PbrMaterial {
                transmission: whole,
                roughness: none,
                metallic: none,
                ..PbrMaterial::default()
            };
            let thin = material(&mut scene, Material::gltf("thin", clear.clone()));
            quad(&mut scene, [-0.9, -0.9, 0.3], [0.8, 0.0, 0.0], [0.0, 1.2, 0.0], thin);
            let solid =
                material(&mut scene, Material::gltf("solid", PbrMaterial { has_volume: true, ..clear }));
            block(&mut scene, [0.2, -0.9, -0.5], [0.25, 0.6, 0.5], solid);
        }
        Crowd::Mixes => {
            let by_view = scene.add_texture(Texture::Facing([[0.1; 3], [0.8; 3]].into()));
            for (weight, x) in [(constant(0.4), -0.6), (ColorSlot::texture(by_view), 0.1)] {
                let parts = [
                    (weight, Material::lambert("matt", [0.9, 0.3, 0.2])),
                    (constant(0.3), pbr("plastic", [0.2, 0.6, 0.9], 0.0, 0.4)),
                    (constant(0.2), pbr("metal", [0.9, 0.9, 0.4], 1.0, 0.5)),
                ];
                let components =
                    parts.into_iter().map(|(weight, material)| MixComponent { weight, material }).collect();
                let mixed = material(&mut scene, Material::new("mix", Model::Mix { components }));
                block(&mut scene, [x, -0.98, -0.6], [x + 0.5, 0.1, -0.1], mixed);
            }
        }
        Crowd::Bodies => {
            let fog = Medium { albedo: [0.8; 3], ..Medium::scattering([1.5; 3]) };
            let fog = material(
                &mut scene,
                Material { medium: Some(fog), ..Material::new("fog", Model::Boundary {}) },
            );
            block(&mut scene, [-0.9, -0.9, -0.2], [0.0, 0.2, 0.5], fog);
            let (none, whole) = (FloatSlot::constant(0.0), FloatSlot::constant(1.0));
            let diffuse_transmission =
                Some(DiffuseTransmission { factor: whole, color: constant(1.0), subsurface: None });
            let wax = PbrMaterial {
                metallic: none,
                specular: none,
                ior: 1.0,
                has_volume: true,
                diffuse_transmission,
                ..PbrMaterial::default()
            };
            let medium = Some(Medium::subsurface([0.8, 0.5, 0.3], [0.05; 3], 0.0));
            let wax = material(&mut scene, Material { medium, ..Material::gltf("wax", wax) });
            sphere(&mut scene, [0.5, -0.5, -0.5], 0.35, wax);
        }
    }
    scene
}

/// Connections are blocked by stochastic transparency, refraction and media; paths through these stay with their pixels. The
/// mean is unchanged.
#[test]
fn sharing_keeps_the_mean_with_transparency_mixes_and_media() {
    for crowd in [Crowd::Sheets, Crowd::Mixes, Crowd::Bodies] {
        let scene = crowded(crowd);
        let options = options(EDGE, 16, 100).path_reuse(PathReuse::Off).splitting(Splitting::OFF);
        let shared = options.path_reuse(groups("4x4/2"));
        let ratio = noise(&scene, &options) / noise(&scene, &shared);
        println!("{crowd:?}: variance / {ratio:.2}");
        assert!(ratio > 1.2, "{crowd:?}: {ratio}");
        assert_same_means(&format!("{crowd:?}"), &scene, [&options, &shared], 16);
        assert_same_bits(&format!("{crowd:?}"), &scene, &options.samples(4).path_reuse(groups("4x4/2")));
    }
}

/// Disabled caustics and glossy filtering apply alike to all members of a group. Whether a bounce counts as diffuse or glossy is
/// sampled by the lobes' albedos: per channel where paths are shared, else averaged over channels, which differs by less than a
/// thousandth. Clamping uses the throughput of the path's owner: a picture loses the same as without sharing, except at object
/// borders.
#[test]
fn sharing_respects_path_limits() {
    let scene = room();
    let plain = options(EDGE, 32, 100).path_reuse(PathReuse::Off).splitting(Splitting::OFF);
    let bounces = BounceLimits { diffuse: 2, glossy: 2, transmission: 8, ..BounceLimits::NONE };
    let skipped = SkippedCaustics { reflective: true, refractive: true };
    for (what, options, least) in [
        ("bounces", plain.bounces(bounces), 1e-3),
        ("caustics", plain.skip_caustics(skipped), 0.0),
        ("filter", plain.filter_glossy(1.0), 0.0),
    ] {
        let shared = options.path_reuse(groups("4x4/2"));
        let found = differences(&scene, [&options, &shared], 16).whole;
        println!("{what}: {:.1e} +- {:.1e}", found.0, found.1);
        assert!(found.0.abs() < f64::max(4.5 * found.1, least) && found.1 < 2e-3, "{what}: {found:?}");
    }
    let clamped = plain.clamp(Clamp { direct: f32::INFINITY, indirect: 0.4 });
    let [free, alone, shared] = [plain, clamped, clamped.path_reuse(groups("4x4/2"))]
        .map(|options| (1..=4).map(|seed| mean(&picture(&scene, &options.seed(seed)))).sum::<f64>() / 4.0);
    println!("clamp: free {free:.4}, alone {alone:.4}, shared {shared:.4}");
    assert!(alone < 0.95 * free, "the clamp takes light: {alone} of {free}");
    assert!((shared - alone).abs() < 0.1 * (free - alone), "{shared} for {alone}, free {free}");
}

/// Branches of a split path are clamped as whole paths are.
#[test]
fn splitting_respects_clamping() {
    let scene = room();
    let plain = options(EDGE, 32, 100).path_reuse(PathReuse::Off).splitting(Splitting::OFF);
    let clamped = plain.clamp(Clamp { direct: f32::INFINITY, indirect: 0.4 });
    let split = clamped.splitting(Splitting::Into(4));
    assert_same_means("clamped, split", &scene, [&clamped, &split], 16);
}

#[test]
fn sharing_keeps_the_mean_of_a_scene_file() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/materials.toml");
    let scene = oscura::load::load(&path, &Default::default()).expect("the scene loads").scene;
    let options = options(EDGE, 64, 100).path_reuse(PathReuse::Off);
    let (mean, error) = differences(&scene, [&options, &options.path_reuse(groups("4x4/2"))], 8).whole;
    println!("materials: {mean:.1e} +- {error:.1e}");
    assert!(mean.abs() < 5.0 * error && error < 2e-3, "{mean} +- {error}");
}
