//! Disk lights that face the shading point, and shell lights that also light their inside (Blender's soft falloff), against
//! closed forms.

use crate::support::differences::assert_same_means;
use crate::support::{assert_radiance, camera, dielectric, grey_floor, material, options, quad, sphere};
use oscura::math::{DAffine3, DVec3};
use oscura::render::{Caustics, Guiding, PathReuse, RenderOptions, Splitting};
use oscura::scene::{
    Beam, ColorSlot, EmitterTraits, FloatSlot, Keyframes, Material, Model, PbrMaterial, RayKinds, Scene,
    Shape, ShapeKind,
};

const RADIANCE: f32 = 3.0;

/// A light of some kind that rays pass, hidden from the camera.
fn emitter_traits(scene: &mut Scene, kind: ShapeKind, center: DVec3, radius: f64) {
    let visible_to = RayKinds::ALL.without(RayKinds::CAMERA);
    let emitter_traits = Some(EmitterTraits { visible_to, is_obstacle: false, beam: Beam::Lambertian });
    let shines_inwards = kind == ShapeKind::Shell;
    let shine = Material { emitter_traits, ..Material::emitter("lamp", [RADIANCE; 3], shines_inwards) };
    let shine = material(scene, shine);
    scene.shapes.push(Shape { kind, ..Shape::sphere(center, radius, shine) });
}

/// A facing disk of radius r at distance d gives an irradiance of pi L r^2 / (d^2 + r^2), times the cosine: at close range, and
/// when the floor is inside its sphere.
#[test]
fn irradiance_of_a_facing_disk() {
    for (center, radius) in [
        (DVec3::new(0.0, 3.0, 0.0), 0.5),
        (DVec3::new(1.0, 1.0, 0.5), 0.6),
        (DVec3::new(0.0, 0.4, 0.0), 0.5),
        (DVec3::new(0.0, 0.05, 0.0), 0.5),
    ] {
        let mut scene = grey_floor();
        emitter_traits(&mut scene, ShapeKind::FacingDisk, center, radius);
        let squared = center.length_squared();
        let share = radius * radius / (squared + radius * radius) * center.y / squared.sqrt();
        let truth = 0.8 * f64::from(RADIANCE) * share;
        assert_radiance(&format!("{center} {radius}"), &scene, &options(16, 256, 1), truth, 2e-3);
    }
}

/// Inside a shell the irradiance is constant; outside it acts as a sphere.
#[test]
fn irradiance_of_a_shell() {
    for center in [DVec3::ZERO, DVec3::new(0.7, 0.6, 0.0), DVec3::new(-0.4, -0.3, 0.2)] {
        let mut scene = grey_floor();
        emitter_traits(&mut scene, ShapeKind::Shell, center, 1.0);
        let truth = 0.8 * f64::from(RADIANCE);
        assert_radiance(&format!("within {center}"), &scene, &options(16, 256, 1), truth, 4e-3);
    }
    let mut scene = grey_floor();
    emitter_traits(&mut scene, ShapeKind::Shell, DVec3::new(0.0, 3.0, 0.0), 1.0);
    let truth = 0.8 * f64::from(RADIANCE) / 9.0;
    assert_radiance("outside", &scene, &options(16, 256, 1), truth, 2e-3);
}

/// A camera ray through a shell, or from its inside, intersects it once.
#[test]
fn a_shell_is_intersected_once() {
    for (what, center) in [("through", [-1.5, 0.5, -1.0]), ("from inside", [-3.0, 1.0, -2.0])] {
        let mut scene = Scene::default();
        scene.cameras.push(camera(DVec3::new(-3.0, 1.0, -2.0), DVec3::ZERO, DVec3::Y, 1.0));
        emitter_traits(&mut scene, ShapeKind::Shell, center.into(), 0.4);
        scene.materials.last_mut().and_then(|m| m.emitter_traits.as_mut()).expect("a lamp").visible_to =
            RayKinds::ALL;
        assert_radiance(what, &scene, &options(8, 4, 1), f64::from(RADIANCE), 1e-6);
    }
}

/// Moving lights without displacement match static ones.
#[test]
fn moving_lights_match_static_ones() {
    let center = DVec3::new(1.0, 1.0, 0.5);
    let squared = center.length_squared();
    for (kind, radius, share) in
        [(ShapeKind::FacingDisk, 0.6, 0.36 / (squared + 0.36)), (ShapeKind::Shell, 0.6, 0.36 / squared)]
    {
        let mut scene = grey_floor();
        emitter_traits(&mut scene, kind, center, radius);
        let keys = vec![DAffine3::IDENTITY; 2];
        scene.motion.shapes.insert(0, Keyframes { keys, neighbours: None });
        let truth = 0.8 * f64::from(RADIANCE) * share * center.y / squared.sqrt();
        assert_radiance(&format!("{kind:?}"), &scene, &options(16, 256, 1), truth, 4e-3);
    }
}

fn polished() -> Material {
    let pbr = PbrMaterial {
        base_color: ColorSlot::constant([1.0; 3]),
        metallic: FloatSlot::constant(1.0),
        roughness: FloatSlot::constant(0.2),
        ..PbrMaterial::default()
    };
    Material { double_sided: true, ..Material::new("metal", Model::Pbr(Box::new(pbr))) }
}

/// An object above a floor, partly inside a light.
fn beneath_lamp(kind: ShapeKind, thing: Material) -> Scene {
    let mut scene = Scene::default();
    let grey = material(&mut scene, Material::lambert("grey", [0.7, 0.6, 0.5]));
    quad(&mut scene, [-3.0, 0.0, 3.0], [6.0, 0.0, 0.0], [0.0, 0.0, -6.0], grey);
    let thing = material(&mut scene, thing);
    sphere(&mut scene, [0.1, 0.5, 0.1], 0.45, thing);
    emitter_traits(&mut scene, kind, DVec3::new(0.3, 1.3, 0.0), 0.6);
    scene.cameras.push(camera(DVec3::new(0.2, 2.2, 3.0), DVec3::new(0.0, 0.2, 0.0), DVec3::Y, 35.0));
    scene
}

fn plain(samples: u32) -> RenderOptions {
    let options = options(32, samples, 12).path_reuse(PathReuse::Off).splitting(Splitting::OFF);
    options.caustics(Caustics::Off).guiding(Guiding::Off)
}

/// Light tracing agrees with camera paths, also for objects partly inside a light, and from inside glass.
#[test]
#[ignore = "means of many pictures, which take long"]
fn caustics_keep_the_mean() {
    for kind in [ShapeKind::FacingDisk, ShapeKind::Shell] {
        // A bias of light starting inside glass only shows at this sample count.
        for (name, thing, seeds) in [("polished", polished(), 64), ("glass", dielectric(1.5), 256)] {
            let (scene, off) = (beneath_lamp(kind, thing), plain(32));
            let on = off.caustics(Caustics::On);
            assert_same_means(&format!("{kind:?}, {name}"), &scene, [&off, &on], seeds);
        }
    }
}

/// Splitting and guiding keep the mean.
#[test]
#[ignore = "means of many pictures, which take long"]
fn other_techniques_keep_the_mean() {
    for kind in [ShapeKind::FacingDisk, ShapeKind::Shell] {
        let scene = beneath_lamp(kind, Material::lambert("clay", [0.9, 0.7, 0.6]));
        let off = plain(64);
        for (name, way) in
            [("split", off.splitting(Splitting::Into(4))), ("guided", off.guiding(Guiding::On))]
        {
            assert_same_means(&format!("{kind:?}, {name}"), &scene, [&off, &way], 24);
        }
    }
}
