//! Compilation of scenes: what is instanced, merged and culled, with unchanged pictures.

use crate::support::{assert_radiance, camera, gltf_glass, material, mean, measure, options, picture, quad};
use oscura::compile::{CompileOptions, CompileReport, compile};
use oscura::math::{DAffine3, DVec3, Ray, Vec3};
use oscura::scene::{
    AlphaMode, ColorSlot, Emission, Environment, FloatSlot, Instance, Material, MaterialId, Mesh, MeshId,
    MeshPart, Model, PbrMaterial, Scene,
};

fn report(scene: &Scene) -> CompileReport {
    compile(scene, &CompileOptions::default()).expect("compiles").1
}

fn look_down_z() -> oscura::scene::Camera {
    camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 20.0)
}

/// A unit square in the xy plane, facing +z, of n x n x 2 triangles.
pub fn square(n: u32, material: MaterialId) -> Mesh {
    let at = |i: u32| i as f32 / n as f32 - 0.5;
    let positions = (0..=n).flat_map(|y| (0..=n).map(move |x| [at(x), at(y), 0.0])).collect();
    let cell = |x: u32, y: u32| {
        let a = y * (n + 1) + x;
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    };
    let triangles: Vec<[u32; 3]> = (0..n).flat_map(|y| (0..n).flat_map(move |x| cell(x, y))).collect();
    let parts = vec![MeshPart { first_triangle: 0, triangle_count: triangles.len() as u32, material }];
    Mesh { name: "square".into(), positions, triangles, parts, ..Mesh::default() }
}

pub fn place(scene: &mut Scene, mesh: u32, world_from_object: DAffine3) {
    let name = format!("placement {}", scene.instances.len());
    scene.instances.push(Instance { name, ..Instance::new(MeshId(mesh), world_from_object) });
}

#[test]
fn unreferenced_meshes_are_culled() {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    scene.meshes.extend([square(1, grey), square(30, grey)]);
    place(&mut scene, 0, DAffine3::IDENTITY);
    scene.cameras.push(look_down_z());
    let report = report(&scene);
    assert_eq!(report.triangles, 2);
    assert!(report.left_out.iter().any(|l| l.contains("1800")), "{:?}", report.left_out);
}

/// 2,400 instances of 1,800 emissive triangles are not flattened into lights, and only BSDF samples find them: a grey floor
/// below two of them is lit as by these two alone.
#[test]
fn emissive_meshes_with_too_many_instances_stay_instanced() {
    let lit = |instances: usize| {
        let mut scene = Scene::default();
        let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
        let black = Material::new("lamp", Model::Black);
        let emission = Some(Emission { radiance: ColorSlot::constant([1.0; 3]), two_sided: true });
        let lamp = material(&mut scene, Material { emission, ..black });
        scene.meshes.extend([square(30, lamp), square(1, grey)]);
        let below = DAffine3::from_translation(DVec3::new(0.0, 0.0, -0.3));
        place(&mut scene, 1, below * DAffine3::from_scale(DVec3::splat(50.0)));
        for i in 0..instances {
            // All but two are behind the floor, which is seen from the front.
            let z = if i < 2 { 0.7 + i as f64 } else { -1.0 - i as f64 };
            place(&mut scene, 0, DAffine3::from_translation(DVec3::new(1.0, 0.0, z)));
        }
        scene.cameras.push(look_down_z());
        let report = report(&scene);
        let is_unsampled = report.warnings.iter().any(|w| w.code == "emitters-unsampled");
        (report.triangles, is_unsampled, mean(&picture(&scene, &options(8, 1024, 4))))
    };
    let (few, many) = (lit(2), lit(2400));
    assert!(!few.1 && many.1);
    assert_eq!(many.0, 1802, "shared");
    let relative = (many.2 / few.2 - 1.0).abs();
    assert!(few.2 > 1e-3 && relative < 0.05, "{} {}", few.2, many.2);
}

#[test]
fn fully_transparent_surfaces_are_culled() {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    let hidden = curtain(&mut scene, 0.0, AlphaMode::Mask { cutoff: 0.5 });
    let gone = curtain(&mut scene, 0.0, AlphaMode::Blend);
    // Alpha 0 is not below this cutoff.
    let seen = curtain(&mut scene, 0.0, AlphaMode::Mask { cutoff: 0.0 });
    let mut two_parts = square(2, grey);
    let half = |first_triangle, material| MeshPart { first_triangle, triangle_count: 4, material };
    two_parts.parts = vec![half(0, gone), half(4, grey)];
    scene.meshes.extend([square(30, hidden), square(1, seen), two_parts]);
    for mesh in 0..3 {
        place(&mut scene, mesh, DAffine3::IDENTITY);
    }
    quad(&mut scene, [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], gone);
    quad(&mut scene, [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], grey);
    scene.cameras.push(look_down_z());
    let report = report(&scene);
    assert_eq!((report.triangles, report.quads), (2 + 4, 1));
    assert!(report.left_out.iter().any(|l| l.starts_with("1 ")), "{:?}", report.left_out);
}

#[test]
fn culled_primitives_are_not_counted() {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    let mut mesh = square(1, grey);
    mesh.triangles[0] = [0, 0, 1];
    scene.meshes.push(mesh);
    place(&mut scene, 0, DAffine3::IDENTITY);
    quad(&mut scene, [0.0; 3], [0.0; 3], [0.0; 3], grey);
    scene.cameras.push(look_down_z());
    let report = report(&scene);
    assert_eq!((report.triangles, report.quads), (1, 0));
    let messages: Vec<&str> = report.notes.iter().map(|w| w.message.as_str()).collect();
    assert_eq!((messages, report.warnings.len()), (vec!["2 primitives without area were dropped"], 0));
    scene.quads.clear();
    let report = self::report(&scene);
    assert_eq!(report.notes[0].message, "1 primitive without area was dropped");
}

/// Triangles that degenerate by rounding are distinguished from those without area.
#[test]
fn triangles_degenerate_by_rounding_are_reported() {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    scene.meshes.push(square(1, grey));
    place(&mut scene, 0, DAffine3::from_translation(DVec3::new(1e9, 0.0, 0.0)));
    scene.cameras.push(look_down_z());
    let report = report(&scene);
    assert_eq!((report.triangles, report.notes.len()), (0, 0));
    let message = &report.warnings[0].message;
    assert!(message.starts_with("2 "), "{message}");
    // A pole whose vertices were computed, and differ by rounding.
    let mut pole = square(1, grey);
    pole.positions[1] = pole.positions[0];
    pole.positions[1][2] += 1e-16;
    scene.meshes[0] = pole;
    scene.instances[0].world_from_object = DAffine3::from_translation(DVec3::new(0.0, 0.0, -5.0));
    let report = self::report(&scene);
    assert!(report.notes.len() == 1 && report.warnings.is_empty(), "{:?}", report.warnings);
}

/// An f32 matrix would transform rays to object space with errors proportional to the anisotropy.
#[test]
fn nonuniformly_scaled_meshes_are_flattened() {
    let triangles = |stretch: f64| {
        let mut scene = Scene::default();
        let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
        scene.meshes.push(square(30, grey));
        for x in [0.0, 2.0, 4.0] {
            let scale = DVec3::new(1.0, 1.0, stretch);
            place(&mut scene, 0, DAffine3::from_translation(DVec3::X * x) * DAffine3::from_scale(scale));
        }
        scene.cameras.push(look_down_z());
        report(&scene).triangles
    };
    assert_eq!((triangles(10.0), triangles(1e5)), (1800, 3 * 1800));
}

#[test]
fn nearly_singular_transforms_are_reported() {
    let warnings = |height: f64| {
        let mut scene = Scene::default();
        let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
        scene.meshes.push(square(1, grey));
        let mut sheared = DAffine3::IDENTITY;
        sheared.matrix3.y_axis = DVec3::new(1.0, height, 0.0);
        place(&mut scene, 0, sheared);
        scene.cameras.push(look_down_z());
        let report = report(&scene);
        (report.triangles, report.warnings.len())
    };
    assert_eq!((warnings(0.5), warnings(1e-9), warnings(0.0)), ((2, 0), (2, 1), (0, 1)));
}

#[test]
fn singular_transforms_are_culled_with_a_warning() {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    scene.meshes.push(square(1, grey));
    place(&mut scene, 0, DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)));
    scene.cameras.push(look_down_z());
    let report = report(&scene);
    assert_eq!((report.triangles, report.warnings.len()), (0, 1));
    assert_eq!(report.warnings[0].place, "placement 0");
}

#[test]
fn coplanar_triangles_merge_to_one_light() {
    let mut scene = Scene::default();
    let light = material(&mut scene, Material::emitter("light", [1.0; 3], false));
    scene.meshes.push(square(1, light));
    place(&mut scene, 0, DAffine3::from_translation(DVec3::new(1e3, 0.1, 7.0)));
    scene.cameras.push(look_down_z());
    assert_eq!(report(&scene).lights, 1);
    scene.meshes[0].positions[0][0] -= 0.01;
    assert_eq!(report(&scene).lights, 2, "a trapezoid stays two triangles");
}

/// A large mesh used several times is instanced and looks as separate meshes would; rotated, scaled and mirrored.
#[test]
fn instanced_meshes_match_copies() {
    let build = |shared: bool| {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let grey = material(&mut scene, Material::lambert("grey", [0.7; 3]));
        let stretch = DAffine3::from_scale(DVec3::new(-1.0, 1.5, 0.7));
        let placements = [
            DAffine3::from_translation(DVec3::new(-0.4, 0.1, 0.0)) * DAffine3::from_rotation_y(0.7),
            DAffine3::from_translation(DVec3::new(0.4, -0.1, 0.1))
                * DAffine3::from_rotation_x(-0.5)
                * stretch,
            DAffine3::from_translation(DVec3::new(0.0, 0.0, -0.6)) * DAffine3::from_scale(DVec3::splat(3.0)),
        ];
        for (i, &placement) in placements.iter().enumerate() {
            if i == 0 || !shared {
                scene.meshes.push(square(24, grey));
            }
            place(&mut scene, if shared { 0 } else { i as u32 }, placement);
        }
        scene.cameras.push(look_down_z());
        scene
    };
    let (shared, copies) = (build(true), build(false));
    assert_eq!(report(&shared).triangles, 1152);
    assert_eq!(report(&copies).triangles, 3 * 1152);
    let ((a, ea), (b, eb)) = (measure(&shared, &options(24, 32, 8)), measure(&copies, &options(24, 32, 8)));
    assert!(ea < 2e-3 * a && (a - b).abs() < 4.5 * ea.hypot(eb) + 1e-5, "{a} +- {ea} and {b} +- {eb}");
}

/// glTF 2.0, 3.7.4: a mirroring transform flips the winding, so that front faces stay front faces.
#[test]
fn mirrored_emitters_emit_from_the_front() {
    for (mirror, front) in [(DVec3::new(-1.0, 1.0, 1.0), true), (DVec3::new(1.0, 1.0, -1.0), false)] {
        let mut scene = Scene::default();
        let light = material(&mut scene, Material::emitter("light", [1.0; 3], false));
        scene.meshes.push(square(4, light));
        place(&mut scene, 0, DAffine3::from_scale(mirror * 4.0));
        scene.cameras.push(look_down_z());
        let radiance = mean(&picture(&scene, &options(4, 1, 1)));
        assert_eq!(radiance, if front { 1.0 } else { 0.0 }, "{mirror}");
    }
}

fn curtain(scene: &mut Scene, alpha: f32, mode: AlphaMode) -> MaterialId {
    let mut curtain = Material::new("curtain", Model::Black);
    (curtain.alpha, curtain.alpha_mode) = (FloatSlot::constant(alpha), mode);
    material(scene, curtain)
}

#[test]
fn alpha_transmits_camera_rays() {
    for (alpha, mode, seen) in [
        (0.25, AlphaMode::Blend, 0.75 * 0.75),
        (0.4, AlphaMode::Mask { cutoff: 0.5 }, 1.0),
        (0.6, AlphaMode::Mask { cutoff: 0.5 }, 0.0),
        (0.1, AlphaMode::Opaque, 0.0),
    ] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let curtain = curtain(&mut scene, alpha, mode);
        for z in [0.0, -1.0] {
            quad(&mut scene, [-9.0, -9.0, z], [18.0, 0.0, 0.0], [0.0, 18.0, 0.0], curtain);
        }
        scene.cameras.push(look_down_z());
        if seen > 0.0 && seen < 1.0 {
            assert_radiance("two curtains", &scene, &options(32, 64, 1), seen, 2e-3);
        } else {
            assert_eq!(mean(&picture(&scene, &options(8, 4, 1))), seen);
        }
    }
}

/// A curtain of alpha 0.5 in front of a light halves the irradiance.
#[test]
fn alpha_transmits_shadow_rays() {
    let lit = |with_curtain: bool| {
        let mut scene = Scene::default();
        let grey = material(&mut scene, Material::lambert("grey", [0.8; 3]));
        quad(&mut scene, [-9.0, 0.0, 9.0], [18.0, 0.0, 0.0], [0.0, 0.0, -18.0], grey);
        let light = material(&mut scene, Material::emitter("light", [5.0; 3], false));
        quad(&mut scene, [-0.5, 2.0, -0.5], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], light);
        if with_curtain {
            let curtain = curtain(&mut scene, 0.5, AlphaMode::Blend);
            quad(&mut scene, [-9.0, 1.9, -9.0], [18.0, 0.0, 0.0], [0.0, 0.0, 18.0], curtain);
        }
        let eye = DVec3::new(3.0, 1.0, 2.0);
        scene.cameras.push(camera(eye, DVec3::ZERO, DVec3::Y, 0.1));
        scene
    };
    let (whole, _) = measure(&lit(false), &options(16, 64, 1));
    assert_radiance("half a curtain", &lit(true), &options(16, 64, 1), 0.5 * whole, 4e-3);
}

/// Beer's law through a slab without refraction: color^(thickness / distance).
#[test]
fn volumes_follow_beers_law() {
    let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
    let glass = Material::new(
        "tinted",
        Model::Pbr(Box::new(PbrMaterial {
            ior: 1.0,
            has_volume: true,
            attenuation_color: [0.5; 3],
            attenuation_distance: 2.0,
            ..gltf_glass(0.0)
        })),
    );
    let glass = material(&mut scene, glass);
    // Fronts outwards; 3 thick.
    quad(&mut scene, [-99.0, -99.0, 0.0], [198.0, 0.0, 0.0], [0.0, 198.0, 0.0], glass);
    quad(&mut scene, [-99.0, -99.0, -3.0], [0.0, 198.0, 0.0], [198.0, 0.0, 0.0], glass);
    scene.cameras.push(camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1e-3));
    assert_radiance("slab", &scene, &options(4, 4, 10), 0.5f64.powf(1.5), 1e-4);
}

/// Light through a slab of index 1 is tinted at both interfaces, or once where the tint is that of the whole solid.
#[test]
fn tint_of_solids() {
    for (tints_once, roughness, seen) in [(false, 0.0, 0.36), (true, 0.0, 0.6), (true, 0.3, 0.6)] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let pbr = PbrMaterial {
            base_color: ColorSlot::constant([0.6; 3]),
            ior: 1.0,
            has_volume: true,
            tints_once,
            ..gltf_glass(roughness)
        };
        let glass = material(&mut scene, Material::new("tinted", Model::Pbr(Box::new(pbr))));
        quad(&mut scene, [-99.0, -99.0, 0.0], [198.0, 0.0, 0.0], [0.0, 198.0, 0.0], glass);
        quad(&mut scene, [-99.0, -99.0, -3.0], [0.0, 198.0, 0.0], [198.0, 0.0, 0.0], glass);
        scene.cameras.push(camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1e-3));
        assert_radiance("slab", &scene, &options(4, 4, 10), seen, 1e-4);
    }
}

/// Seen from behind, a one-sided surface is absent: the sky of radiance 1 is visible through it.
#[test]
fn one_sided_surfaces_are_absent_from_behind() {
    for (from_front, seen) in [(true, 0.5), (false, 1.0)] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let mut wall = Material::lambert("wall", [0.5; 3]);
        wall.double_sided = false;
        wall.emission = Some(Emission { radiance: ColorSlot::constant([0.0; 3]), two_sided: false });
        let wall = material(&mut scene, wall);
        let (u, v) = ([18.0, 0.0, 0.0], [0.0, 18.0, 0.0]);
        let (u, v) = if from_front { (u, v) } else { (v, u) };
        quad(&mut scene, [-9.0, -9.0, 0.0], u, v, wall);
        scene.cameras.push(look_down_z());
        if from_front {
            assert_radiance("front", &scene, &options(16, 64, 4), seen, 2e-3);
        } else {
            assert_eq!(mean(&picture(&scene, &options(8, 4, 4))), seen);
        }
    }
}

#[test]
fn hits_know_their_objects() {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
    let red = material(&mut scene, Material::lambert("red", [0.5, 0.0, 0.0]));
    scene.meshes.extend([square(2, grey), square(30, red)]);
    let mut names = Vec::new();
    for (i, mesh) in [0, 1, 0, 1].into_iter().enumerate() {
        place(&mut scene, mesh, DAffine3::from_translation(DVec3::X * (3.0 * i as f64)));
        scene.instances[i].name = format!("square {i}");
        names.push((3.0 * i as f32 + 0.1, format!("square {i}"), mesh));
    }
    quad(&mut scene, [12.0, -0.5, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], red);
    crate::support::sphere(&mut scene, [15.0, 0.0, 0.0], 0.5, grey);
    crate::support::disk(&mut scene, [18.0, 0.0, 0.0], [0.0, 0.0, 1.0], 0.5, red);
    names.extend([(12.5, "quad".into(), 1), (15.1, "sphere".into(), 0), (18.1, "disk".into(), 1)]);
    let anchor = Some(DVec3::ZERO);
    let (compiled, _) = compile(&scene, &CompileOptions { anchor, ..Default::default() }).expect("compiles");
    assert_eq!(compiled.geometries.placements.len(), 2, "the large square is shared");
    for (x, name, material) in names {
        let hit = compiled.accel.closest_one(&Ray::new(Vec3::new(x, 0.13, 5.0), Vec3::NEG_Z));
        assert_eq!(compiled.object_at(&hit).name(&scene), Some(name.as_str()));
        assert_eq!(compiled.geometries.material(&hit), material);
    }
}
