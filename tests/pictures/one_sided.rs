//! One-sided surfaces: absent from behind, for all techniques.

use crate::compile_scene::square;
use crate::support::{assert_radiance, camera, disk, material, mean, options, picture, quad, sphere, walls};
use oscura::math::{DAffine3, DVec3};
use oscura::render::PathReuse;
use oscura::scene::{
    ColorSlot, Environment, FloatSlot, Instance, Light, LightKind, Material, MaterialId, MeshId, Model,
    PbrMaterial, Scene, Texture,
};

fn one_sided(mut material: Material) -> Material {
    material.double_sided = false;
    material
}

fn plastic(color: ColorSlot) -> Material {
    let (metallic, roughness) = (FloatSlot::constant(0.0), FloatSlot::constant(0.3));
    let pbr = PbrMaterial { base_color: color, metallic, roughness, ..PbrMaterial::default() };
    Material::new("plastic", Model::Pbr(Box::new(pbr)))
}

/// A material for each shading loop: plain, general diffuse, textured, glTF, general.
fn materials(scene: &mut Scene) -> Vec<MaterialId> {
    let color = ColorSlot::texture(scene.add_texture(Texture::Normal));
    let painted = Material::new("painted", Model::Lambert { albedo: color });
    let rough =
        Model::OrenNayar { color: ColorSlot::constant([0.5; 3]), roughness: FloatSlot::constant(0.7) };
    [
        Material::lambert("plain", [0.5; 3]),
        painted,
        plastic(color),
        plastic(ColorSlot::constant([0.4; 3])),
        Material::new("rough", rough),
    ]
    .map(|m| material(scene, one_sided(m)))
    .to_vec()
}

/// A glossy floor and a diffuse block, which see the light above only through what `between` adds.
fn stage(light: &str, between: impl Fn(&mut Scene)) -> Scene {
    let mut scene = Scene::default();
    let shiny = material(&mut scene, plastic(ColorSlot::constant([0.6; 3])));
    let grey = material(&mut scene, Material::lambert("grey", [0.7; 3]));
    quad(&mut scene, [-4.0, 0.0, 4.0], [8.0, 0.0, 0.0], [0.0, 0.0, -8.0], shiny);
    sphere(&mut scene, [0.5, 0.4, 0.0], 0.4, grey);
    let lamp = material(&mut scene, Material::emitter("lamp", [5.0; 3], false));
    let has = |name: &str| light == name || light == "all";
    if has("lamp") {
        quad(&mut scene, [-1.0, 3.0, -1.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0], lamp);
    }
    if has("ball") {
        sphere(&mut scene, [1.0, 3.0, 1.0], 0.3, lamp);
    }
    if has("sky") {
        scene.environment = Environment::Gradient { nadir: [0.1; 3], zenith: [2.0; 3] };
    }
    if has("sun") {
        let kind = LightKind::Directional { direction: DVec3::new(0.2, -1.0, 0.1) };
        scene.lights.push(Light::new(kind, [2.0; 3]));
    }
    // All variants have the same bounds: light selection depends on them.
    for far in [-40.0, 40.0] {
        sphere(&mut scene, [far; 3], 0.01, grey);
    }
    between(&mut scene);
    scene.cameras.push(camera(DVec3::new(0.0, 1.0, 4.0), DVec3::new(0.0, 0.6, 0.0), DVec3::Y, 60.0));
    scene
}

/// A horizontal sheet of triangles facing up, from -5 to 5 in x and z.
fn sheet(scene: &mut Scene, cells: u32, material: MaterialId, height: f64) {
    scene.meshes.push(square(cells, material));
    let turn = DAffine3::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    let place =
        DAffine3::from_translation(DVec3::Y * height) * turn * DAffine3::from_scale(DVec3::splat(10.0));
    // Large meshes are instanced where they are placed twice.
    for lift in [0.0, 0.05] {
        scene.instances.push(Instance {
            name: "sheet".into(),
            ..Instance::new(
                MeshId(scene.meshes.len() as u32 - 1),
                DAffine3::from_translation(DVec3::Y * lift) * place,
            )
        });
    }
}

/// Sheets facing away from the scene change no bit of the picture: with any technique and any shading loop.
#[test]
fn back_faces_are_absent_for_all_techniques() {
    for light in ["lamp", "ball", "sky", "sun", "all"] {
        for reuse in [PathReuse::Off, "4x4".parse().expect("groups")] {
            let options = options(24, 8, 4).path_reuse(reuse);
            let bare = picture(&stage(light, |_| {}), &options);
            assert!(mean(&bare) > 0.003, "{light}");
            let covered = stage(light, |scene| {
                let all = materials(scene);
                for (i, &material) in all.iter().enumerate() {
                    let height = 1.6 + 0.2 * i as f64;
                    sheet(scene, if i % 2 == 0 { 1 } else { 30 }, material, height);
                    quad(scene, [-6.0, height + 0.1, 6.0], [12.0, 0.0, 0.0], [0.0, 0.0, -12.0], material);
                    disk(scene, [0.0, height + 0.15, 0.0], [0.0, 1.0, 0.0], 5.0, material);
                    // From inside.
                    sphere(scene, [0.0, 0.0, 0.0], 20.0 + i as f64, material);
                }
            });
            let covered = picture(&covered, &options);
            assert!(bare.rgba() == covered.rgba(), "{light}, {reuse:?}");
        }
    }
}

/// Their fronts cast shadows.
#[test]
fn front_faces_cast_shadows() {
    assert!(mean(&picture(&stage("sun", |_| {}), &options(16, 4, 3))) > 0.1);
    for index in 0..5 {
        for cells in [1, 30] {
            let scene = stage("sun", |scene| {
                let material = materials(scene)[index];
                scene.meshes.push(square(cells, material));
                let turn = DAffine3::from_rotation_x(std::f64::consts::FRAC_PI_2);
                let world_from_object = DAffine3::from_translation(DVec3::Y * 2.5)
                    * turn
                    * DAffine3::from_scale(DVec3::splat(50.0));
                let lid = Instance::new(MeshId(0), world_from_object);
                scene.instances.push(Instance { name: "lid".into(), ..lid });
            });
            assert_eq!(mean(&picture(&scene, &options(16, 4, 3))), 0.0);
        }
    }
}

/// Two coincident one-sided sheets of opposite orientation: each side shows its own material.
#[test]
fn coincident_opposite_sheets_show_their_fronts() {
    for (from, seen) in [(1.0, 0.25), (-1.0, 0.75)] {
        for swapped in [false, true] {
            let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
            let mut side = |radiance: f32| {
                let emitter = one_sided(Material::emitter("side", [radiance; 3], false));
                material(&mut scene, emitter)
            };
            let (up, down) = (side(0.25), side(0.75));
            let mut faces = [(DVec3::X, DVec3::Y, up), (DVec3::Y, DVec3::X, down)];
            if swapped {
                faces.reverse();
            }
            for (u, v, material) in faces {
                quad(&mut scene, [-9.0, -9.0, 0.3], (18.0 * u).into(), (18.0 * v).into(), material);
            }
            scene.cameras.push(camera(DVec3::new(0.3, 0.1, 3.0 * from), DVec3::ZERO, DVec3::Y, 60.0));
            assert_radiance("twins", &scene, &options(16, 4, 4), seen, 1e-6);
        }
    }
}

/// A room of one-sided walls facing inwards behaves as with two-sided ones; from outside the camera sees in.
#[test]
#[ignore = "means of many pictures, which take long"]
fn inward_facing_room_is_visible_from_outside() {
    let room = |is_one_sided: bool| {
        let mut scene = Scene::default();
        let wall = Material::emitter("wall", [0.25; 3], false);
        let model = Model::Lambert { albedo: ColorSlot::constant([0.5; 3]) };
        let wall = Material { model, double_sided: !is_one_sided, ..wall };
        let wall = material(&mut scene, wall);
        walls(&mut scene, [1.0; 3], |_, _| wall);
        scene
    };
    let mut within = [room(false), room(true)];
    for scene in &mut within {
        scene.cameras.push(camera(DVec3::new(0.2, 0.1, 0.3), DVec3::NEG_Z, DVec3::Y, 60.0));
    }
    let [two, one] = within.each_ref().map(|scene| picture(scene, &options(16, 16, 8)));
    assert!(two.rgba() == one.rgba());
    // The closed box seen from outside: L = e + p L.
    let mut scene = room(true);
    scene.cameras.push(camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 10.0));
    assert_radiance("from outside", &scene, &options(16, 256, 40), 0.5, 2e-3);
}

/// A one-sided surface with two-sided emission emits from its front only.
#[test]
fn one_sided_surfaces_emit_from_the_front_only() {
    let under_lamp = |faces_up: bool| {
        let mut scene = Scene::default();
        let grey = material(&mut scene, Material::lambert("grey", [0.5; 3]));
        quad(&mut scene, [-4.0, 0.0, 4.0], [8.0, 0.0, 0.0], [0.0, 0.0, -8.0], grey);
        let lamp = material(&mut scene, one_sided(Material::emitter("lamp", [5.0; 3], true)));
        let (u, v) = ([0.0, 0.0, 2.0], [2.0, 0.0, 0.0]);
        let (u, v) = if faces_up { (u, v) } else { (v, u) };
        quad(&mut scene, [-1.0, 2.0, -1.0], u, v, lamp);
        scene.cameras.push(camera(DVec3::new(0.0, 1.5, 3.0), DVec3::ZERO, DVec3::Y, 50.0));
        mean(&picture(&scene, &options(16, 4, 3)))
    };
    assert!(under_lamp(false) > 0.1);
    assert_eq!(under_lamp(true), 0.0);
}
