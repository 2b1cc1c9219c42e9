//! Light transport against closed forms.

use crate::support::{
    assert_radiance, camera, disk, grey_floor, material, measure, options, picture, quad, sphere, walls,
};
use oscura::math::DVec3;
use oscura::scene::{
    AlphaMode, ColorSlot, Environment, FloatSlot, FresnelModel, Light, LightKind, Material, Model,
    PbrMaterial, Projection, Scene,
};

fn lambert(albedo: f32) -> Material {
    Material::lambert("grey", [albedo; 3])
}

/// Furnace test: a convex object of albedo a in a uniform environment of radiance 1 has radiance a.
#[test]
fn sphere_in_a_white_furnace() {
    for albedo in [0.5, 1.0] {
        let mut scene = Scene { environment: Environment::Constant([1.0; 3]), ..Scene::default() };
        let grey = material(&mut scene, lambert(albedo));
        sphere(&mut scene, [0.0; 3], 1.0, grey);
        // Parallel rays over a square inside the sphere's outline, including grazing ones.
        let mut view = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1.0);
        view.projection = Projection::Orthographic { half_height: 0.7 };
        scene.cameras.push(view);
        let what = format!("furnace, albedo {albedo}");
        assert_radiance(&what, &scene, &options(16, 64, 100), f64::from(albedo), 1e-3);
    }
}

/// A planar emitter that also reflects receives nothing from itself: alone, its radiance is its emission.
#[test]
fn planar_emitter_does_not_light_itself() {
    // One light, and two to select from; rotated, so that points are off the plane by rounding.
    for lights in [1, 2] {
        for v in [[-0.3, 0.96, 0.7], [0.2, 0.9, -0.5]] {
            let mut scene = Scene::default();
            let mut lamp = Material::emitter("lamp", [3.0; 3], true);
            lamp.model = Model::Pbr(Box::new(PbrMaterial {
                metallic: FloatSlot::constant(0.0),
                roughness: FloatSlot::constant(0.5),
                ..PbrMaterial::default()
            }));
            lamp.double_sided = true;
            let lamp = material(&mut scene, lamp);
            // The second one in the same plane, beside the first.
            let u = [1.3, 0.2, 0.29];
            for k in 0..lights {
                let corner = [0, 1, 2].map(|i| [0.37, 0.11, 0.29][i] - f64::from(k) * (u[i] + v[i]));
                quad(&mut scene, corner, u, v, lamp);
            }
            let middle = DVec3::new(0.9, 0.6, 0.5);
            let mut view = camera(middle + DVec3::new(0.4, 0.5, 3.0), middle, DVec3::Y, 1.0);
            view.projection = Projection::Orthographic { half_height: 0.1 };
            scene.cameras.push(view);
            assert_radiance(&format!("lamp alone, {lights}"), &scene, &options(16, 64, 4), 3.0, 1e-5);
        }
    }
}

/// In a closed box that emits e and reflects p everywhere, L = e + p L.
#[test]
fn closed_emitting_box() {
    for albedo in [0.5f32, 0.9] {
        let mut scene = Scene::default();
        let mut shiny = Material::emitter("wall", [0.25; 3], false);
        shiny.model = Model::Lambert { albedo: ColorSlot::constant([albedo; 3]) };
        shiny.double_sided = true;
        let wall = material(&mut scene, shiny);
        walls(&mut scene, [1.0, 1.5, 2.0], |_, _| wall);
        let eye = DVec3::new(0.3, -0.2, 0.5);
        scene.cameras.push(camera(eye, eye + DVec3::new(0.5, 0.3, -1.0), DVec3::Y, 90.0));
        let truth = 0.25 / (1.0 - f64::from(albedo));
        // Depth 2000: what is cut off is below 1e-90.
        assert_radiance(&format!("closed box, albedo {albedo}"), &scene, &options(16, 64, 2000), truth, 2e-3);
    }
}

/// Irradiance of a parallel rectangle over the foot of one of its corners (Howell's catalogue, B-3).
#[test]
fn rectangle_light_on_a_plane() {
    for (a, b, height) in [(1.0f64, 0.5f64, 1.5f64), (4.0, 3.0, 0.5), (0.01, 0.02, 2.0)] {
        let mut scene = grey_floor();
        let light = material(&mut scene, Material::emitter("light", [3.0; 3], false));
        // u x v points down.
        quad(&mut scene, [0.0, height, 0.0], [a, 0.0, 0.0], [0.0, 0.0, b], light);
        let (x, y) = (a / height, b / height);
        let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
        let form_factor = (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / std::f64::consts::TAU;
        let what = format!("rectangle {a} x {b} at {height}");
        assert_radiance(&what, &scene, &options(8, 64, 1), 0.8 * 3.0 * form_factor, 2e-3);
    }
}

/// A light of alpha 0.25 gives a quarter of its light; one of alpha 0 gives none.
#[test]
fn partially_transparent_lights() {
    let form_factor = |x: f64, y: f64| {
        let (rx, ry) = ((1.0 + x * x).sqrt(), (1.0 + y * y).sqrt());
        (x / rx * (y / rx).atan() + y / ry * (x / ry).atan()) / std::f64::consts::TAU
    };
    let full = 0.8 * 3.0 * form_factor(4.0, 4.0);
    for (mode, truth) in [
        (AlphaMode::Blend, 0.25 * full),
        (AlphaMode::Mask { cutoff: 0.2 }, full),
        (AlphaMode::Mask { cutoff: 0.5 }, 0.0),
    ] {
        let mut scene = grey_floor();
        let lamp = Material::emitter("lamp", [3.0; 3], false);
        let lamp = Material { alpha_mode: mode, alpha: FloatSlot::constant(0.25), ..lamp };
        let lamp = material(&mut scene, lamp);
        quad(&mut scene, [0.0, 1.0, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, 4.0], lamp);
        let what = format!("lamp with alpha 0.25, {mode:?}");
        assert_radiance(&what, &scene, &options(16, 512, 1), truth, 4e-3);
    }
}

/// The sum over many lights of all types, below, above and across the floor's plane.
#[test]
fn many_lights_of_all_types() {
    let mut scene = grey_floor();
    let lamp = material(&mut scene, Material::emitter("lamp", [2.0; 3], false));
    let dim = material(&mut scene, Material::emitter("dim", [0.05; 3], true));
    let mut truth = 0.0;
    for i in 0..60 {
        let (s, c) = (f64::from(i) * 2.4).sin_cos();
        let distance = 0.4 + 0.1 * f64::from(i);
        let center = DVec3::new(distance * c, 0.2 + 0.05 * f64::from(i % 17), distance * s);
        let radius = 0.02 + 0.002 * f64::from(i % 7);
        let (which, radiance) = if i % 3 == 0 { (dim, 0.05) } else { (lamp, 2.0) };
        sphere(&mut scene, center.into(), radius, which);
        truth += 0.8 * radiance * radius * radius / center.length_squared() * center.y / center.length();
        // Its copy below the floor lights nothing.
        sphere(&mut scene, [center.x, -center.y, center.z], radius, lamp);
    }
    let point = |position: DVec3| Light::new(LightKind::Point { position }, [0.3; 3]);
    for i in 0..20 {
        let position = DVec3::new(f64::from(i) * 0.2 - 2.0, 1.0 + 0.1 * f64::from(i), 1.0);
        scene.lights.push(point(position));
        scene.lights.push(point(-position));
        truth += 0.8 / std::f64::consts::PI * 0.3 * position.y / position.length().powi(3);
    }
    let sun = LightKind::Directional { direction: DVec3::new(0.3, -1.0, 0.2) };
    scene.lights.push(Light::new(sun, [0.2; 3]));
    truth += 0.8 / std::f64::consts::PI * 0.2 / DVec3::new(0.3, -1.0, 0.2).length();
    scene.environment = Environment::Constant([0.1; 3]);
    truth += 0.8 * 0.1;
    // Lights occlude a little of the environment; each removes what a light of radiance 0.1 would give.
    let hidden: f64 = scene
        .shapes
        .iter()
        .filter(|s| s.center.y > 0.0)
        .map(|s| 0.8 * 0.1 * s.radius * s.radius / s.center.length_squared() * s.center.y / s.center.length())
        .sum();
    assert_radiance("many lights", &scene, &options(16, 256, 1), truth - hidden, 4e-3);
}

/// The same irradiance for parallelograms, which have no table entry, by their two triangles: Lambert's formula (1760), E = L /
/// 2 * sum of angle times cosine over the edges.
#[test]
fn triangle_and_parallelogram_lights_on_a_plane() {
    let polygon = |points: &[DVec3]| -> f64 {
        let edge = |i: usize| {
            let (p, q) = (points[i].normalize(), points[(i + 1) % points.len()].normalize());
            p.dot(q).acos() * p.cross(q).normalize().y
        };
        0.5 * (0..points.len()).map(edge).sum::<f64>().abs()
    };
    let corner = DVec3::new(-0.4, 1.0, 0.3);
    let (u, v) = (DVec3::new(1.2, 0.3, 0.0), DVec3::new(0.5, 0.1, 0.9));
    let mut scene = grey_floor();
    let light = material(&mut scene, Material::emitter("light", [2.0; 3], true));
    quad(&mut scene, corner.into(), u.into(), v.into(), light);
    let irradiance = 2.0 * polygon(&[corner, corner + u, corner + u + v, corner + v]);
    let truth = 0.8 / std::f64::consts::PI * irradiance;
    assert_radiance("parallelogram", &scene, &options(8, 64, 1), truth, 2e-3);

    let mut scene = grey_floor();
    let light = material(&mut scene, Material::emitter("light", [2.0; 3], true));
    let points = [corner, corner + u, corner + v];
    scene.meshes.push(oscura::scene::Mesh {
        name: "triangle".into(),
        positions: points.map(|p| p.as_vec3().to_array()).to_vec(),
        triangles: vec![[0, 1, 2]],
        parts: vec![oscura::scene::MeshPart { first_triangle: 0, triangle_count: 1, material: light }],
        ..oscura::scene::Mesh::default()
    });
    scene.instances.push(oscura::scene::Instance {
        name: "triangle".into(),
        ..oscura::scene::Instance::new(oscura::scene::MeshId(0), oscura::math::DAffine3::IDENTITY)
    });
    let truth = 0.8 / std::f64::consts::PI * 2.0 * polygon(&points);
    assert_radiance("triangle", &scene, &options(8, 64, 1), truth, 2e-3);
}

/// A sphere wholly above the horizon: E = pi L (r / d)^2 cos.
#[test]
fn sphere_light_on_a_plane() {
    for (center, radius) in [([0.0, 2.0, 0.0], 0.5), ([1.0, 1.0, -1.0], 0.9), ([3.0, 4.0, 0.0], 1e-3)] {
        let mut scene = grey_floor();
        let light = material(&mut scene, Material::emitter("light", [3.0; 3], false));
        sphere(&mut scene, center, radius, light);
        let c = DVec3::from(center);
        let truth = 0.8 * 3.0 * radius * radius / c.length_squared() * c.y / c.length();
        assert_radiance(&format!("sphere of radius {radius}"), &scene, &options(8, 64, 1), truth, 2e-3);
    }
}

/// A disk parallel to the plane, straight above and aside: E = pi L / 2 (1 - (h^2 + a^2 - r^2) / root), root^2 =
/// (h^2 + a^2 + r^2)^2 - 4 a^2 r^2 (Walsh 1958, "Photometry").
#[test]
fn disk_light_on_a_plane() {
    for (h, a, radius) in [(2.0, 0.0, 0.5), (1.0, 1.5, 0.9), (0.4, 0.3, 1.0), (5.0, 1.0, 1e-3f64)] {
        let mut scene = grey_floor();
        let light = material(&mut scene, Material::emitter("light", [3.0; 3], false));
        disk(&mut scene, [a, h, 0.0], [0.0, -1.0, 0.0], radius, light);
        let (h2, a2, r2) = (h * h, a * a, radius * radius);
        let root = ((h2 + a2 + r2).powi(2) - 4.0 * a2 * r2).sqrt();
        // 1 - x without cancellation where the disk is small: root^2 - (h^2 + a^2 - r^2)^2 = 4 h^2 r^2.
        let truth = 0.8 * 1.5 * 4.0 * h2 * r2 / (root * (root + h2 + a2 - r2));
        assert_radiance(&format!("disk of radius {radius}"), &scene, &options(8, 64, 1), truth, 4e-3);
    }
}

/// A disk emits from its front only, and its outline is a circle.
#[test]
fn disk_light_is_one_sided_and_round() {
    for (normal, seen) in [(1.0, std::f64::consts::FRAC_PI_4 * 0.81), (-1.0, 0.0)] {
        let mut scene = Scene::default();
        let light = material(&mut scene, Material::emitter("light", [1.0; 3], false));
        disk(&mut scene, [0.0; 3], [0.0, 0.0, normal], 0.9, light);
        let mut view = camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1.0);
        view.projection = Projection::Orthographic { half_height: 1.0 };
        scene.cameras.push(view);
        assert_radiance("disk", &scene, &options(32, 256, 0), seen, 2e-3);
    }
}

/// Point, spot and directional lights: inverse squares and cosines, without noise.
#[test]
fn punctual_lights_on_a_plane() {
    let albedo_over_pi = 0.8 / std::f64::consts::PI;
    let position = DVec3::new(1.0, 2.0, -0.5);
    let point = LightKind::Point { position };
    let of_point = position.y / position.length().powi(3);
    let direction = DVec3::new(0.3, -0.8, 0.1);
    let sun = LightKind::Directional { direction };
    for (what, kind, per_intensity) in
        [("point", point, of_point), ("directional", sun, -direction.normalize().y)]
    {
        let mut scene = grey_floor();
        scene.lights.push(Light::new(kind, [5.0; 3]));
        let truth = albedo_over_pi * 5.0 * per_intensity;
        assert_radiance(what, &scene, &options(4, 4, 1), truth, 1e-4);
    }
}

/// A smooth dielectric interface reflects an emitter by the Fresnel equations, also from the denser side.
#[test]
fn fresnel_reflectance() {
    let white = ColorSlot::constant([1.0; 3]);
    let dense = Model::Dielectric { ior: 1.5, tint: white, fresnel: FresnelModel::Exact };
    let transmission = FloatSlot::constant(1.0);
    let thin = PbrMaterial {
        base_color: white,
        ior: 0.7,
        metallic: FloatSlot::constant(0.0),
        roughness: FloatSlot::constant(0.0),
        transmission,
        has_volume: true,
        ..Default::default()
    };
    for (ior, model) in [(1.5f64, dense), (0.7, Model::Pbr(Box::new(thin)))] {
        for degrees in [0.5f64, 40.0, 45.0, 60.0, 80.0] {
            let mut scene = Scene::default();
            let glass = material(&mut scene, Material::new("glass", model.clone()));
            quad(&mut scene, [-9.0, 0.0, 9.0], [18.0, 0.0, 0.0], [0.0, 0.0, -18.0], glass);
            let light = material(&mut scene, Material::emitter("light", [1.0; 3], true));
            quad(&mut scene, [-2000.0, 40.0, -2000.0], [4000.0, 0.0, 0.0], [0.0, 0.0, 4000.0], light);
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let eye = DVec3::new(sine, cosine, 0.0) * 5.0;
            scene.cameras.push(camera(eye, DVec3::ZERO, DVec3::Z, 1e-3));
            let cos_t = (1.0 - (sine / ior).powi(2)).max(0.0).sqrt();
            let parallel = (ior * cosine - cos_t) / (ior * cosine + cos_t);
            let perpendicular = (cosine - ior * cos_t) / (cosine + ior * cos_t);
            let truth = if cos_t == 0.0 { 1.0 } else { 0.5 * (parallel.powi(2) + perpendicular.powi(2)) };
            // Paths are so well stratified that all pictures may have the same number of reflections: the expected one,
            // rounded.
            let (mean, error) = measure(&scene, &options(16, 256, 4));
            println!(
                "index of refraction {ior} at {degrees} degrees: {mean:.6} +- {error:.6}, truth {truth:.6}"
            );
            assert!((mean - truth).abs() <= 4.5 * error + 1.0 / 65_536.0, "{mean} +- {error}, not {truth}");
            assert!(error <= 5e-3 * truth, "{error}");
        }
    }
}

/// A black background is opaque where the camera sees it, and transparent where there is none.
#[test]
fn black_backgrounds_are_opaque() {
    let black = Environment::Constant([0.0; 3]);
    let grey = Some(Environment::Constant([0.5; 3]));
    for (environment, seen, alpha) in [
        (Environment::Black, None, 0.0),
        (black.clone(), None, 1.0),
        (Environment::Constant([0.5; 3]), Some(black.clone()), 1.0),
        (black, grey, 1.0),
    ] {
        let mut scene = Scene { environment, camera_environment: seen, ..Scene::default() };
        scene.cameras.push(camera(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 40.0));
        let film = picture(&scene, &options(4, 4, 4));
        assert!(film.rgba().iter().all(|pixel| pixel[3] == alpha), "{scene:?}");
    }
}
