//! Light linking and shadow linking: lights restricted to receivers, and shadows restricted to blockers.

use crate::support::{assert_radiance, camera, material, mean, options, pbr, picture, quad, sphere};
use oscura::math::DVec3;
use oscura::render::RenderOptions;
use oscura::scene::{
    ColorSlot, Environment, FloatSlot, Fog, Light, LightKind, LightLinks, Link, Material, Medium, Model,
    ObjectSet, ObjectSets, ObjectTraits, Scene,
};

const EYE: DVec3 = DVec3::new(-3.0, 1.0, -2.0);

fn set(number: usize) -> ObjectSet {
    ObjectSet::new(number).expect("one of 64")
}

fn member_of(number: usize) -> ObjectTraits {
    ObjectTraits { sets: ObjectSets::NONE.with(set(number)), ..ObjectTraits::default() }
}

fn receivers(receivers: Link) -> LightLinks {
    LightLinks { receivers, ..LightLinks::ALL }
}

fn blockers(blockers: Link) -> LightLinks {
    LightLinks { blockers, ..LightLinks::ALL }
}

fn plastic(roughness: f32) -> Material {
    pbr("plastic", [0.6, 0.3, 0.2], 0.0, roughness)
}

/// A floor in set 0, and a camera that looks at its middle.
fn floor(of: Material) -> Scene {
    let mut scene = Scene::default();
    let ground = material(&mut scene, of);
    quad(&mut scene, [-50.0, 0.0, 50.0], [100.0, 0.0, 0.0], [0.0, 0.0, -100.0], ground);
    scene.quads[0].traits = member_of(0);
    scene.cameras.push(camera(EYE, DVec3::ZERO, DVec3::Y, 1e-3));
    scene
}

/// Adds an emissive sphere.
fn add_lamp(scene: &mut Scene, name: &str, center: [f64; 3], radiance: f32, links: LightLinks) {
    let lamp = material(scene, Material::emitter(name, [radiance; 3], false));
    sphere(scene, center, 0.5, lamp);
    let shape = scene.shapes.last_mut().expect("just added");
    (shape.name, shape.traits) = (name.into(), ObjectTraits { links, ..ObjectTraits::default() });
}

fn sun(links: LightLinks) -> Light {
    let direction = DVec3::new(0.3, -1.0, 0.2).normalize();
    Light { links, ..Light::new(LightKind::Sun { direction, angle_rad: 0.3 }, [0.4; 3]) }
}

fn of(scene: &Scene) -> f64 {
    let options: RenderOptions = options(24, 256, 1);
    mean(&picture(scene, &options))
}

/// All lights of the floor: two spheres, a point, a sun and a sky, each linked or removed.
fn lit_by(of_floor: Material, present: [bool; 5], links: Option<[LightLinks; 4]>) -> Scene {
    let mut scene = floor(of_floor);
    let links = links.unwrap_or([LightLinks::ALL; 4]);
    // Lights that are removed still occlude the sky.
    add_lamp(&mut scene, "a", [1.5, 1.0, 1.0], if present[0] { 2.0 } else { 0.0 }, links[0]);
    add_lamp(&mut scene, "b", [0.5, 2.0, -1.0], if present[1] { 3.0 } else { 0.0 }, links[1]);
    if present[2] {
        scene.lights.push(Light { links: links[2], ..Light::point([0.0, 3.0, 0.0], [1.0; 3]) });
    }
    if present[3] {
        scene.lights.push(sun(links[3]));
    }
    if present[4] {
        scene.environment = Environment::Constant([0.1; 3]);
    }
    scene
}

/// A light linked to other objects acts as an absent one, for next-event estimation and BSDF sampling, in rough surfaces and
/// mirrors.
#[test]
fn unlinked_lights_do_not_contribute() {
    let other = receivers(Link::Only(set(1)));
    let own = receivers(Link::Only(set(0)));
    let but = receivers(Link::AllBut(set(0)));
    let all = LightLinks::ALL;
    let mirror = || {
        Material::new(
            "mirror",
            Model::SchlickMetal { color: ColorSlot::constant([0.9; 3]), roughness: FloatSlot::constant(0.0) },
        )
    };
    for (links, present) in [
        ([other, all, own, all], [false, true, true, true, true]),
        ([all, but, other, other], [true, false, false, false, true]),
        ([own, other, all, but], [true, false, true, false, true]),
        ([other, but, other, but], [false, false, false, false, true]),
        ([own, own, own, own], [true; 5]),
    ] {
        for (what, of_floor) in [
            ("smooth plastic", plastic(0.1)),
            ("rough plastic", plastic(0.7)),
            ("mirror", mirror()),
            ("clay", Material::lambert("clay", [0.5; 3])),
        ] {
            let linked = of(&lit_by(of_floor.clone(), [true; 5], Some(links)));
            let truth = of(&lit_by(of_floor, present, None));
            let most = 6e-3 * truth + 1e-6;
            assert!((linked - truth).abs() < most, "{what}, {present:?}: {linked}, not {truth}");
        }
    }
}

/// Without a sky, an object without linked lights is black.
#[test]
fn object_without_linked_lights_is_black() {
    let none = receivers(Link::Only(set(1)));
    let dark = lit_by(plastic(0.5), [true, true, true, true, false], Some([none; 4]));
    assert_eq!(of(&dark), 0.0);
    let one = lit_by(plastic(0.5), [true, false, false, false, false], Some([none; 4]));
    assert_eq!(of(&one), 0.0, "a single light");
}

/// Linking applies to the last surface before the light only: a wall lit by a light reflects onto a floor not linked to it.
#[test]
fn linking_ignores_indirect_light() {
    let room = |links: Option<LightLinks>| {
        let mut scene = floor(Material::lambert("clay", [0.8; 3]));
        let white = material(&mut scene, Material::lambert("white", [0.8; 3]));
        quad(&mut scene, [2.0, 0.0, -20.0], [0.0, 9.0, 0.0], [0.0, 0.0, 40.0], white);
        scene.quads[1].traits = member_of(1);
        // It emits towards the wall only.
        let position = DVec3::new(0.5, 2.0, 0.0);
        let links = links.unwrap_or_default();
        let spot = Light::spot(position, DVec3::X, [0.6, 0.7], [5.0; 3]);
        scene.lights.push(Light { links, ..spot });
        scene
    };
    let options: RenderOptions = options(24, 1024, 2);
    let of = |links| mean(&picture(&room(links), &options));
    let (all, wall) = (of(None), of(Some(receivers(Link::Only(set(1))))));
    assert!(all > 0.0 && (wall - all).abs() < 6e-3 * all, "{wall}, not {all}");
    assert_eq!(of(Some(receivers(Link::Only(set(0))))), 0.0);
}

/// The camera sees a light linked to nothing.
#[test]
fn cameras_see_unlinked_lights() {
    let mut scene = floor(plastic(0.5));
    add_lamp(&mut scene, "lamp", [0.0; 3], 2.0, receivers(Link::Only(set(1))));
    assert_radiance("the lamp itself", &scene, &options(16, 16, 4), 2.0, 1e-6);
}

/// A light passes objects that are not among its blockers; microfacet surfaces get the same light from it.
#[test]
fn unlinked_blockers_cast_no_shadow() {
    for roughness in [0.05, 0.3, 0.8] {
        let lit = |sheet: Option<usize>, links: LightLinks, kind: usize| {
            let mut scene = floor(plastic(roughness));
            match kind {
                0 => add_lamp(&mut scene, "lamp", [1.5, 1.0, 1.0], 2.0, links),
                1 => scene.lights.push(Light { links, ..Light::point([1.5, 1.0, 1.0], [2.0; 3]) }),
                _ => scene.lights.push(sun(links)),
            }
            if let Some(number) = sheet {
                let black = material(&mut scene, Material::lambert("black", [0.0; 3]));
                quad(&mut scene, [0.5, -1.0, -9.0], [0.0, 9.0, 0.0], [0.0, 0.0, 19.0], black);
                quad(&mut scene, [-9.0, 0.8, -9.0], [0.0, 0.0, 19.0], [19.0, 0.0, 0.0], black);
                scene.quads[1..].iter_mut().for_each(|quad| quad.traits = member_of(number));
            }
            // Between the sheets.
            scene.cameras[0] = camera(DVec3::new(-3.0, 0.7, -2.0), DVec3::ZERO, DVec3::Y, 1e-3);
            of(&scene)
        };
        let (only, but) = (blockers(Link::Only(set(1))), blockers(Link::AllBut(set(2))));
        for kind in 0..3 {
            let free = lit(None, LightLinks::ALL, kind);
            let name = ["lamp", "point", "sun"][kind];
            assert!(free > 0.0, "{name}");
            assert_eq!(lit(Some(1), LightLinks::ALL, kind), 0.0, "{name} behind a sheet");
            assert_eq!(lit(Some(1), only, kind), 0.0, "{name} behind a sheet that blocks it");
            assert_eq!(lit(Some(1), but, kind), 0.0, "{name} behind a sheet of another set");
            for (links, number) in [(only, 2), (only, 0), (but, 2)] {
                let found = lit(Some(number), links, kind);
                let what = format!("{name}, roughness {roughness}, sheet {number} and {links:?}");
                assert!((found - free).abs() < 8e-3 * free, "{what}: {found}, not {free}");
            }
        }
    }
}

/// A medium attenuates light on its way to a surface, except from a light without shadows: Beer-Lambert over the distances to
/// the light and to the camera.
#[test]
fn shadowless_lights_are_not_attenuated_by_media() {
    let density = 0.2;
    let lit = |links: LightLinks, medium: Option<(Medium, bool)>| {
        let mut scene = floor(Material::lambert("white", [0.8; 3]));
        scene.lights.push(Light { links, ..Light::point([0.0, 3.0, 0.0], [2.0; 3]) });
        if let Some((medium, is_fog)) = medium {
            if is_fog {
                scene.fog = Some(Fog { medium, center: DVec3::ZERO, radius: 20.0 });
            } else {
                let body = Material { medium: Some(medium), ..Material::new("body", Model::Boundary {}) };
                let body = material(&mut scene, body);
                sphere(&mut scene, [0.0; 3], 20.0, body);
            }
        }
        of(&scene)
    };
    let free = lit(LightLinks::ALL, None);
    let to_camera = (-density * EYE.length()).exp();
    for (albedo, is_fog) in [(0.0, true), (1e-6, true), (0.0, false), (1e-6, false)] {
        let medium = Medium { albedo: [albedo; 3], ..Medium::scattering([density as f32; 3]) };
        for (links, to_light) in
            [(LightLinks::ALL, (-density * 3.0).exp()), (blockers(Link::Only(set(7))), 1.0)]
        {
            let (found, expected) = (lit(links, Some((medium, is_fog))), free * to_camera * to_light);
            let what = format!("albedo {albedo}, fog {is_fog}, {links:?}");
            // Scattering media are sampled by distance.
            let tolerance = if albedo == 0.0 { 1e-3 } else { 2e-2 };
            assert!((found - expected).abs() < tolerance * expected, "{what}: {found}, not {expected}");
        }
    }
}

/// Memory reused after a scene with many receiver classes: camera paths have none.
#[test]
fn linking_state_is_reset_between_scenes() {
    let sky = |scene: &mut Scene, links: LightLinks| {
        scene.environment = Environment::Constant([0.5; 3]);
        scene.cameras[0] = camera(DVec3::new(0.0, 1.0, 3.0), DVec3::new(0.0, 1.0, 0.0), DVec3::Y, 60.0);
        add_lamp(scene, "lamp", [0.0, 3.0, 0.0], 2.0, links);
    };
    let mut many = floor(plastic(0.5));
    sky(&mut many, receivers(Link::Only(set(0))));
    for number in 0..4 {
        let grey = material(&mut many, Material::lambert("grey", [0.5; 3]));
        sphere(&mut many, [f64::from(number) - 1.5, 0.5, 0.0], 0.4, grey);
        many.shapes.last_mut().expect("just added").traits = member_of(2 + number as usize);
    }
    let mut few = floor(plastic(0.5));
    few.quads[0].traits = ObjectTraits::default();
    sky(&mut few, receivers(Link::AllBut(set(0))));
    let options: RenderOptions = options(32, 16, 3);
    let first = picture(&few, &options).rgba();
    let _ = picture(&many, &options);
    assert_eq!(picture(&few, &options).rgba(), first);
}
