use super::*;
use crate::math::{DVec2, DVec3};
use crate::scene::{Instance, Material, MaterialId, Mesh, MeshId, Motion, Projection, RayKinds, Shape};

fn ball(center: DVec3, radius: f64, material: Material) -> Loaded {
    let mut loaded = Loaded::default();
    loaded.scene.materials.push(material);
    loaded.scene.shapes.push(Shape::sphere(center, radius, MaterialId(0)));
    loaded
}

fn grey() -> Material {
    Material::lambert("grey", [0.5; 3])
}

fn soft() -> StageOptions {
    StageOptions::default()
}

/// A mesh of these points, three a triangle.
fn points(positions: &[DVec3]) -> Loaded {
    let mut loaded = Loaded::default();
    loaded.scene.materials.push(grey());
    let list = positions.iter().map(|p| p.as_vec3().to_array()).collect();
    let triangles = (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    loaded.scene.meshes.push(Mesh::new("points", list, triangles, MaterialId(0)));
    loaded.scene.instances.push(Instance {
        motion: Motion::Still,
        ..Instance::new(MeshId(0), crate::math::DAffine3::IDENTITY)
    });
    loaded
}

/// Where a point is in the picture: -1 to 1 over the height, times the aspect across.
fn seen(loaded: &Loaded, p: DVec3) -> DVec2 {
    let camera = &loaded.scene.cameras[0];
    let Projection::Perspective { vfov_rad } = camera.projection else { panic!("a perspective") };
    let local = camera.world_from_camera.inverse().transform_point3(p);
    assert!(local.z < 0.0, "{p} is behind the camera");
    DVec2::new(local.x, local.y) / (-local.z * (vfov_rad / 2.0).tan())
}

#[test]
fn models_fill_the_picture_with_even_margins_from_everywhere() {
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 40) as f64 / f64::from(1u32 << 24)
    };
    for (extent, aspect) in [([3.0, 1.0, 0.2], 1.0), ([0.3, 5.0, 1.0], 16.0 / 9.0), ([1.0, 1.0, 9.0], 0.5)] {
        for view in ["three-quarter", "front", "iso", "top", "-200,-35"] {
            let cloud: Vec<DVec3> = (0..300)
                .map(|_| DVec3::new(random() * extent[0], random() * extent[1], 5.0 + random() * extent[2]))
                .collect();
            let mut loaded = points(&cloud);
            let view = view.parse().expect("a view");
            let options = StageOptions { view, aspect: Some(aspect), ..StageOptions::studio() };
            complete(&mut loaded, &options, false);
            let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            for p in cloud.iter().map(|p| DVec3::from(p.as_vec3())) {
                let at = seen(&loaded, p);
                (low, high) = (low.min(at), high.max(at));
            }
            let free = 0.2 * aspect.min(1.0);
            let room = DVec2::new(aspect - free, 1.0 - free);
            assert!((low + high).abs().max_element() < 0.01, "{view}: {low} {high}");
            let fill = (high - low) / (2.0 * room);
            assert!(fill.max_element() > 0.97 && fill.max_element() < 1.01, "{view}: {fill}");
        }
    }
}

#[test]
fn a_model_that_turns_stays_in_view() {
    let corners = [[-1.0, 0.0, -2.0], [1.0, 0.0, 2.0], [0.9, 1.0, -2.0]].map(DVec3::from);
    let mut loaded = points(&corners);
    let options = StageOptions { is_orbit: true, aspect: Some(1.0), ..StageOptions::studio() };
    complete(&mut loaded, &options, false);
    let table = loaded.turntable.expect("a turntable");
    let first = loaded.scene.cameras[0].clone();
    let mut most = 0.0f64;
    for step in 0..36 {
        loaded.scene.cameras[0] = table.camera(&first, f64::from(step) * 0.1745);
        corners.iter().for_each(|&p| most = most.max(seen(&loaded, p).abs().max_element()));
    }
    assert!(most < 0.83 && most > 0.7, "{most}");
}

#[test]
fn parts_that_shine_light_scenes_but_not_bare_models() {
    let shining = || ball(DVec3::ZERO, 1.0, Material::emitter("lamp", [1.0; 3], false));
    let mut bare = shining();
    complete(&mut bare, &soft(), false);
    assert!(matches!(bare.scene.environment, Environment::Gradient { .. }));
    let said: Vec<String> = bare.warnings.iter().map(ToString::to_string).collect();
    assert!(said.len() == 2 && said[1].contains("parts that shine"), "{said:?}");
    let mut scene = shining();
    scene.scene.cameras = bare.scene.cameras.clone();
    complete(&mut scene, &StageOptions::studio(), false);
    assert_eq!((&scene.scene.environment, scene.warnings.len()), (&Environment::Black, 0));
    let mut without = shining();
    complete(&mut without, &soft(), true);
    assert_eq!((&without.scene.environment, without.warnings.len()), (&Environment::Black, 1));
}

#[test]
fn the_studio_is_for_bare_models_alone() {
    let mut bare = ball(DVec3::ZERO, 1.0, grey());
    complete(&mut bare, &StageOptions::studio(), false);
    assert!(matches!(bare.scene.environment, Environment::Image { .. }));
    assert_eq!(bare.scene.shapes.len(), 2, "the ball and the ground");
    assert!(!bare.scene.environment_visible_to.contains(RayKinds::CAMERA) && bare.scene.backdrop.is_some());
    assert_eq!((bare.warnings.len(), bare.notes.len()), (0, 1), "{:?}", bare.notes);
    assert!(bare.scene.validate().is_empty());
    // A camera of its own: only light, as it has none.
    let mut scene = ball(DVec3::ZERO, 1.0, grey());
    scene.scene.cameras = bare.scene.cameras.clone();
    complete(&mut scene, &StageOptions::studio(), false);
    assert!(matches!(scene.scene.environment, Environment::Gradient { .. }));
    assert_eq!((scene.scene.shapes.len(), scene.warnings.len()), (1, 1));
    // Light of its own: only a camera.
    let mut lit = ball(DVec3::ZERO, 1.0, grey());
    lit.scene.environment = Environment::Constant([1.0; 3]);
    complete(&mut lit, &StageOptions::studio(), false);
    assert_eq!(lit.scene.environment, Environment::Constant([1.0; 3]));
    assert_eq!((lit.scene.shapes.len(), lit.scene.cameras.len()), (1, 1));
    assert!(lit.scene.environment_visible_to.contains(RayKinds::CAMERA) && lit.scene.backdrop.is_none());
}

#[test]
fn files_without_materials_get_clay() {
    let mut loaded = ball(DVec3::ZERO, 1.0, grey());
    loaded.stand_ins.push(MaterialId(0));
    complete(&mut loaded, &StageOptions::studio(), false);
    assert!(loaded.scene.materials[0].model.pbr().is_some());
    let mut own = ball(DVec3::ZERO, 1.0, grey());
    complete(&mut own, &StageOptions::studio(), false);
    assert_eq!(own.scene.materials[0], grey());
}

#[test]
fn a_caller_with_an_environment_gets_no_other_light() {
    for options in [soft(), StageOptions::studio()] {
        let mut loaded = ball(DVec3::ZERO, 1.0, grey());
        complete(&mut loaded, &options, true);
        assert_eq!(loaded.scene.environment, Environment::Black);
        assert_eq!(loaded.warnings.len(), 1, "{:?}", loaded.warnings);
    }
}

#[test]
fn an_empty_scene_gets_a_finite_camera() {
    for options in [soft(), StageOptions::studio()] {
        let mut loaded = Loaded::default();
        complete(&mut loaded, &options, false);
        assert!(loaded.scene.cameras[0].world_from_camera.is_finite());
        assert!(loaded.scene.validate().is_empty());
    }
}
