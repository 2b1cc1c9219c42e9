//! Sidecars of models, lights of scene files, and materials that a scene file replaces.

use crate::files::load_files_by;
use oscura::error::Error;
use oscura::load::gltf::{Glass, GltfOptions};
use oscura::load::{LoadOptions, Loaded, load};
use oscura::math::DVec3;
use oscura::scene::{
    Environment, Filter, LightKind, Mapping, Model, ObjectTraits, RayKinds, Texture, TextureId,
};
use std::f64::consts::PI;

/// A triangle with a material whose image is missing, and two cameras; the second stands at z = 5 and looks at the origin.
const MODEL: &str = r#"{
    "asset": {"version": "2.0"}, "scene": 0,
    "scenes": [{"nodes": [0, 1, 2], "extras": {"width": 320, "bounces": 7}}],
    "nodes": [{"mesh": 0}, {"name": "left", "camera": 0}, {"name": "front", "camera": 0, "translation": [0, 0, 5]}],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    "textures": [{"source": 0}], "images": [{"uri": "IMAGE"}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]
}"#;

/// A PNG of one black pixel.
const PIXEL: &str = "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR4nGNgYGAAAAAEAAH2FzhVAAAAAElFTkSuQmCC";

fn with_sidecar(toml: &str) -> Result<Loaded, Error> {
    let model = MODEL.replace("IMAGE", PIXEL);
    load_files_by(&[("model.gltf", model.as_str()), ("model.oscura.toml", toml)], &LoadOptions::default())
}

const FULL: &str = r#"
[environment]
background = [1, 2, 3]
[camera]
name = "front"
f_stop = 2
focal_length = 40
focus_at = [7, 8, 1]
[render]
samples = 9
width = 640
filter = "box"
[[lights]]
name = "key"
area = { center = [0, 3, 0], direction = [0, -1, 0], size = [2, 0.5], power = 10 }
color = [1, 0.5, 0]
"#;

#[test]
fn sidecars_add_what_the_format_lacks() {
    let loaded = with_sidecar(FULL).unwrap_or_else(|e| panic!("{e}"));
    let scene = loaded.scene;
    assert_eq!(scene.environment, Environment::Constant([1.0, 2.0, 3.0]));
    assert_eq!((scene.settings.samples, scene.settings.filter), (Some(9), Some(Filter::Box)));
    // The sidecar's width overrides the model's; the height is the model's.
    assert_eq!((scene.settings.width, scene.settings.depth), (Some(640), Some(7)));
    assert_eq!(scene.instances.len(), 1);
    let lens = scene.cameras[1].lens.expect("depth of field");
    assert!((lens.focus_distance - 4.0).abs() < 1e-12);
    // 40 mm at f/2: a radius of 10 mm, seen from 4 m.
    assert!((lens.focus_distance * (lens.defocus_angle_rad / 2.0).tan() - 0.01).abs() < 1e-12);
    assert!(scene.cameras[0].lens.is_none());
    let messages: Vec<String> = loaded.notes.iter().map(ToString::to_string).collect();
    assert!(
        messages.iter().any(|w| w.contains("model.oscura.toml") && w.contains("environment")),
        "{messages:?}"
    );
    let warned = |words: &str| loaded.warnings.iter().any(|w| w.to_string().contains(words));
    assert!(!warned("oscura.toml") && !warned("no light"), "{:?}", loaded.warnings);
}

#[test]
fn area_light_faces_its_target() {
    let scene = with_sidecar(FULL).unwrap_or_else(|e| panic!("{e}")).scene;
    let quad = &scene.quads[0];
    let normal = quad.edge_u.cross(quad.edge_v);
    assert!(normal.distance(DVec3::NEG_Y) < 1e-12, "{normal}");
    assert!((quad.corner + (quad.edge_u + quad.edge_v) / 2.0).distance(DVec3::Y * 3.0) < 1e-12);
    assert_eq!((quad.edge_u.length(), quad.edge_v.length()), (2.0, 0.5));
    let emission = scene.materials[quad.material.index()].emission.expect("it emits");
    let radiance = (10.0 / PI) as f32;
    assert_eq!(emission.radiance.factor, [radiance, radiance * 0.5, 0.0]);
    assert!(!emission.two_sided);
}

#[test]
fn area_light_at_an_exported_empty_node() {
    // Rotated by 90 degrees about x, -z points down; scaled by 2.
    let node = r#"{"name": "Area", "translation": [1, 2, 3], "rotation": [-0.7071067811865476, 0, 0, 0.7071067811865476], "scale": [2, 2, 2]}"#;
    let model = MODEL
        .replace("IMAGE", PIXEL)
        .replace("[0, 1, 2]", "[0, 1, 2, 3]")
        .replace(r#""translation": [0, 0, 5]}"#, &format!(r#""translation": [0, 0, 5]}}, {node}"#));
    let with = |name: &str| {
        let toml = format!("[[lights]]\narea = {{ node = \"{name}\", size = [1, 0.5], power = 4 }}\n");
        let files = [("model.gltf", model.as_str()), ("model.oscura.toml", toml.as_str())];
        load_files_by(&files, &LoadOptions::default())
    };
    let scene = with("Area").unwrap_or_else(|e| panic!("{e}")).scene;
    let quad = &scene.quads[0];
    let normal = quad.edge_u.cross(quad.edge_v);
    assert!(normal.distance(DVec3::NEG_Y * 2.0) < 1e-12, "{normal}");
    assert!((quad.corner + (quad.edge_u + quad.edge_v) / 2.0).distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-12);
    // The width lies along x.
    assert!(quad.edge_u.x.abs() > 2.0 - 1e-12);
    let emission = scene.materials[quad.material.index()].emission.expect("it emits");
    assert!((f64::from(emission.radiance.factor[0]) - 4.0 / (PI * 2.0)).abs() < 1e-6);
    let error = with("Arae").expect_err("no such node").to_string();
    assert!(error.contains("'Arae'") && error.contains("'Area'"), "{error}");
    assert!(with("left").is_err(), "a camera is no empty node");
}

#[test]
fn lights_without_shape_modify_existing_ones() {
    let changed = |more: &str| with_sidecar(&format!("{FULL}[[lights]]\nname = \"key\"\n{more}"));
    let radiance = |more: &str| {
        let scene = changed(more).unwrap_or_else(|e| panic!("{e}")).scene;
        scene.materials[scene.quads[0].material.index()].emission.expect("it emits").radiance.factor
    };
    let own = (10.0 / PI) as f32;
    assert_eq!(radiance("radiance = 4"), [4.0, 2.0, 0.0]);
    assert_eq!(radiance("color = [0, 1, 1]"), [0.0, own, own]);
    assert_eq!(radiance("color = [0, 0.5, 1]\nradiance = 2"), [0.0, 1.0, 2.0]);
    assert_eq!(radiance("intensity = 2"), [own, own * 0.5, 0.0], "that of points");
    let sun = "[[lights]]\nname = \"sun\"\nsun = { direction = [0, -1, 0], irradiance = 3 }\n";
    let point = "[[lights]]\nname = \"sun\"\npoint = { position = [0, 1, 0], intensity = 3 }\n";
    let change = "[[lights]]\nname = \"sun\"\nirradiance = 5\n";
    let scene = with_sidecar(&format!("{sun}{point}{change}")).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!([scene.lights[0].intensity, scene.lights[1].intensity], [[5.0; 3], [3.0; 3]]);
    for (more, part) in [
        ("[[lights]]\nname = \"kye\"\ncolor = 1", "there is no light 'kye' to change (did you mean 'key'?)"),
        (
            "[[lights]]\nname = \"new\"",
            "there is no light 'new' to change (a new light needs one of area, point, spot, sun)",
        ),
        ("pont = {}", "has no key 'pont' (did you mean 'point'?)"),
        ("radiance = -1", "radiance"),
        ("group = \"a\"", "has no key 'group'"),
    ] {
        let error = changed(more).expect_err(part).to_string();
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn sidecars_can_be_ignored() {
    let model = MODEL.replace("IMAGE", PIXEL);
    let files = [("model.gltf", model.as_str()), ("model.oscura.toml", "this is no TOML")];
    assert!(load_files_by(&files, &LoadOptions::default()).is_err());
    let options = LoadOptions { no_sidecar: true, ..LoadOptions::default() };
    let loaded = load_files_by(&files, &options).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.scene.settings.width, Some(320));
}

#[test]
fn sidecar_problems_are_reported_with_file_and_lines() {
    let toml = "[camera]\nname = \"frnt\"\ndefocus_angle = 2\n[environmnt]\nbackground = 1\n[[lights]]\n\
                area = { center = [0, 0, 0], direction = [0, 0, 0], size = [1, 1], power = 1 }\n\
                [[lights]]\npoint = { position = [0, 0, 0] }\n[[lights]]\nspot = {}\nsun = {}\n\
                [[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\n";
    let error = with_sidecar(toml).expect_err("it is wrong");
    let shown = error.to_string();
    assert!(error.file.as_ref().is_some_and(|f| f.ends_with("model.oscura.toml")), "{shown}");
    for part in [
        "line 2: the model has no camera 'frnt' (did you mean 'front'?)",
        "line 4: the file has no key 'environmnt' (did you mean 'environment'?)",
        "line 7: the light has no direction",
        "line 9: the light needs either 'power' or 'intensity'",
        "line 10: light 3 needs exactly one of area, point, spot, sun",
        "line 13: object 1 needs 'material'",
    ] {
        assert!(shown.contains(part), "'{part}' is not in:\n{shown}");
    }
}

/// Explicit sidecar lights, however weak, disable default lights.
#[test]
fn sidecar_lights_disable_default_lights() {
    for lamp in [
        "area = { center = [0, 3, 0], direction = [0, -1, 0], size = [2, 2], power = 0.1 }\nvisible_to_camera = false",
        "point = { position = [0, 3, 0], radius = 0.5, power = 0.1 }",
        "spot = { position = [0, 3, 0], target = [0, 0, 0], radius = 0.5, power = 0.1 }",
    ] {
        let loaded = with_sidecar(&format!("[[lights]]\n{lamp}\n")).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(loaded.scene.environment, Environment::Black, "{lamp}: {:?}", loaded.warnings);
    }
}

#[test]
fn numbers_without_leading_zero_are_explained() {
    let error =
        with_sidecar("[[lights]]\npoint = { position = [1, .5, 0], power = 1 }\n").expect_err("no TOML");
    assert!(error.to_string().contains("0.5"), "{error}");
}

#[test]
fn incomplete_depth_of_field_is_reported() {
    let fails = |camera: &str, part: &str| {
        let shown = with_sidecar(&format!("[camera]\n{camera}\n")).expect_err(part).to_string();
        assert!(shown.contains(part), "'{part}' is not in: {shown}");
    };
    fails("f_stop = 2", "needs 'focus_distance' or 'focus_at'");
    fails("f_stop = 2\ndefocus_angle = 1\nfocus_distance = 3", "'defocus_angle' and 'f_stop'");
    fails("f_stop = 2\nfocus_at = [0, 0, -1]\nfocus_distance = 3", "'focus_distance' and 'focus_at'");
    fails("name = \"front\"\nf_stop = 2\nfocus_at = [0, 0, 9]", "behind the camera");
    fails("blades = 5", "'blades' needs a lens size");
    fails("f_stop = 2\nfocus_distance = 3\nblades = 2", "from 3 to 256");
}

#[test]
fn aperture_blades() {
    let toml =
        "[camera]\nf_stop = 2\nfocus_distance = 3\nblades = 6\nblade_rotation = 90\naperture_ratio = 2\n";
    let scene = with_sidecar(toml).unwrap_or_else(|e| panic!("{e}")).scene;
    let aperture = scene.cameras[0].lens.expect("a lens").aperture;
    assert_eq!((aperture.blades, aperture.ratio), (6, 2.0));
    assert!((aperture.rotation_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
}

#[test]
fn camera_visibility_of_materials() {
    let read = |more: &str| {
        let toml = format!("[materials.paint]\nvisible_to_camera = false\n{more}");
        let model = MODEL
            .replace("IMAGE", PIXEL)
            .replace("\"materials\": [{", "\"materials\": [{\"name\": \"paint\", ");
        let files = [("model.gltf", model.as_str()), ("model.oscura.toml", toml.as_str())];
        load_files_by(&files, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
    };
    for more in ["", "alpha = \"blend\"\n"] {
        let loaded = read(more);
        let paint = loaded.scene.materials.iter().find(|m| m.name == "paint").expect("the model's");
        let traits = paint.emitter_traits.expect("what it is to cameras");
        assert!(traits.visible_to == RayKinds::ALL.without(RayKinds::CAMERA) && traits.is_obstacle);
    }
}

#[test]
fn media_keep_the_surface_material() {
    let read = |extension: &str| {
        let toml = "[materials.skin]\nsubsurface = { color = 0.5, radius = 0.01 }\n";
        let named = format!("\"materials\": [{{\"name\": \"skin\", \"extensions\": {{{extension}}}, ");
        let model = MODEL.replace("IMAGE", PIXEL).replace("\"materials\": [{", &named);
        let files = [("model.gltf", model.as_str()), ("model.oscura.toml", toml)];
        let loaded = load_files_by(&files, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let skin = loaded.scene.materials.iter().find(|m| m.name == "skin").expect("the model's");
        assert!(skin.medium.is_some());
        let Model::Pbr(pbr) = &skin.model else { panic!("{:?}", skin.model) };
        let through = pbr.diffuse_transmission.expect("light enters");
        assert_eq!(through.factor.factor, 1.0);
        through.color.factor
    };
    assert_eq!(read(""), [1.0; 3]);
    let paint = "\"KHR_materials_diffuse_transmission\": {\"diffuseTransmissionFactor\": 1, \
                 \"diffuseTransmissionColorFactor\": [0.5, 0.25, 1]}";
    assert_eq!(read(paint), [0.5, 0.25, 1.0]);
}

#[test]
fn placed_cameras_precede_those_of_the_model() {
    let toml = "[camera]\nlook_from = [0, 0, 9]\nlook_at = [0, 0, 0]\ndefocus_angle = 2\n";
    let scene = with_sidecar(toml).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!(scene.cameras.len(), 3);
    assert_eq!(scene.cameras[0].world_from_camera.translation.z, 9.0);
    // By default it focuses on its target.
    assert_eq!(scene.cameras[0].lens.expect("a lens").focus_distance, 9.0);
}

#[test]
fn punctual_lights() {
    let toml = r#"
        [[lights]]
        point = { position = [1, 2, 3], power = 100 }
        [[lights]]
        spot = { position = [0, 4, 0], target = [0, 0, 0], angle = 60, blend = 0.5, intensity = 3 }
        [[lights]]
        sun = { direction = [0, -2, 0], irradiance = 5 }
        color = [1, 0.5, 0.25]
        "#;
    let lights = with_sidecar(toml).unwrap_or_else(|e| panic!("{e}")).scene.lights;
    assert!(matches!(lights[0].kind, LightKind::Point { position } if position == DVec3::new(1.0, 2.0, 3.0)));
    assert!((f64::from(lights[0].intensity[0]) - 100.0 / (4.0 * PI)).abs() < 1e-5);
    let LightKind::Spot { direction, inner_angle_rad, outer_angle_rad, .. } = lights[1].kind else {
        panic!("no spot")
    };
    assert_eq!((direction, lights[1].intensity), (DVec3::NEG_Y, [3.0; 3]));
    assert!((outer_angle_rad - PI / 6.0).abs() < 1e-12 && (inner_angle_rad - PI / 12.0).abs() < 1e-12);
    assert!(matches!(lights[2].kind, LightKind::Directional { direction } if direction == DVec3::NEG_Y));
    assert_eq!(lights[2].intensity, [5.0, 2.5, 1.25]);
}

/// A scene file with one object for each of `objects`, besides the model's file and an OBJ with a missing texture.
fn scene_of(objects: &str) -> Result<Loaded, Error> {
    let toml = format!(
        "environment.background = 1\nmaterials.own = {{ type = \"lambert\" }}\n\
         camera = {{ look_from = [0, 0, 5], look_at = [0, 0, 0] }}\n{objects}"
    );
    let files = [
        ("scene.toml", toml.as_str()),
        ("model.gltf", &MODEL.replace("IMAGE", "missing.png")),
        (
            "b.obj",
            "mtllib b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3\n",
        ),
        ("b.mtl", "newmtl m\nmap_Kd missing.png\n"),
    ];
    load_files_by(&files, &LoadOptions::default())
}

#[test]
fn replaced_materials_and_their_images_are_not_read() {
    for file in ["model.gltf", "b.obj"] {
        let object = format!("[[objects]]\nmesh = \"{file}\"\n");
        let replaced = format!("{object}material = \"own\"\n");
        let loaded = scene_of(&format!("{replaced}{replaced}")).unwrap_or_else(|e| panic!("{file}: {e}"));
        assert!(
            loaded.scene.images.is_empty() && loaded.warnings.is_empty(),
            "{file}: {:?}",
            loaded.warnings
        );
        assert!(loaded.left_out.iter().any(|l| l.contains(file)), "{file}: {:?}", loaded.left_out);
        // One object that uses them makes the missing image a problem.
        match scene_of(&format!("{replaced}{object}")) {
            Ok(loaded) => assert!(!loaded.warnings.is_empty(), "{file}"),
            Err(e) => assert!(e.to_string().contains("missing.png"), "{file}: {e}"),
        }
    }
}

#[test]
fn camera_only_files_add_no_meshes() {
    let toml = "environment.background = 1\nmaterials.default = { type = \"lambert\" }\n\
                camera = { from = \"model.gltf\", name = \"front\", defocus_angle = 1, focus_distance = 2 }\n\
                [[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\n";
    let files = [("scene.toml", toml), ("model.gltf", &MODEL.replace("IMAGE", "missing.png"))];
    let loaded = load_files_by(&files, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.scene.meshes.is_empty() && loaded.scene.images.is_empty());
    assert_eq!(loaded.scene.cameras[0].name, "front");
    assert_eq!(loaded.scene.cameras[0].lens.expect("a lens").focus_distance, 2.0);
}

#[test]
fn ray_visibility_of_objects() {
    let of = |line: &str| {
        let toml = format!("[objects.\"node 0\"]\n{line}\n");
        let scene = with_sidecar(&toml).map(|loaded| loaded.scene);
        scene.unwrap_or_else(|e| panic!("{e}")).instances[0].traits
    };
    let plain = with_sidecar("").unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!(plain.instances[0].traits, ObjectTraits::default());
    for (line, visible_to, is_holdout, is_shadow_catcher) in [
        ("visible_to = [\"camera\", \"shadow\"]", RayKinds::CAMERA.with(RayKinds::SHADOW), false, false),
        ("visible_to_camera = false", RayKinds::ALL.without(RayKinds::CAMERA), false, false),
        ("holdout = true", RayKinds::ALL, true, false),
        ("shadow_catcher = true", RayKinds::ALL, false, true),
    ] {
        let expected = ObjectTraits { visible_to, is_holdout, is_shadow_catcher, ..ObjectTraits::default() };
        assert_eq!(of(line), expected, "{line}");
    }
    let wrong = with_sidecar("[objects.\"node 0\"]\nvisible_to = [\"camra\"]\n").expect_err("no kind");
    assert!(wrong.to_string().contains("'visible_to'"), "{wrong}");
}

/// Blender's custom properties in glTF.
#[test]
fn node_extras_set_ray_visibility() {
    let of = |extras: &str| {
        let node = format!("{{\"mesh\": 0, \"extras\": {extras}}}");
        let model = MODEL.replace("IMAGE", PIXEL).replace("{\"mesh\": 0}", &node);
        load_files_by(&[("model.gltf", &model)], &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
    };
    let unseen = RayKinds::ALL.without(RayKinds::CAMERA).without(RayKinds::VOLUME);
    for (extras, visible_to, is_holdout, is_shadow_catcher) in [
        ("{\"visible_camera\": false, \"visible_volume_scatter\": 0}", unseen, false, false),
        ("{\"visible_to\": \"diffuse,glossy transmission, shadow\"}", unseen, false, false),
        ("{\"visible_to\": [\"camera\"], \"holdout\": 1}", RayKinds::CAMERA, true, false),
        ("{\"is_shadow_catcher\": true, \"visible_glossy\": true}", RayKinds::ALL, false, true),
    ] {
        let loaded = of(extras);
        let expected = ObjectTraits { visible_to, is_holdout, is_shadow_catcher, ..ObjectTraits::default() };
        assert_eq!(loaded.scene.instances[0].traits, expected, "{extras}: {:?}", loaded.warnings);
    }
    let loaded = of("{\"visible_to\": \"camra\", \"visible_shadow\": \"no\"}");
    assert_eq!(loaded.scene.instances[0].traits, ObjectTraits::default());
    let messages = |what: &str| loaded.warnings.iter().any(|w| w.place.contains(what));
    assert!(messages("extras/visible_to") && messages("extras/visible_shadow"), "{:?}", loaded.warnings);
}

/// Only the listed properties of an object change.
#[test]
fn linking_keeps_other_properties_of_a_model() {
    let model = MODEL.replace("IMAGE", PIXEL);
    let model = model.replace("{\"mesh\": 0}", "{\"mesh\": 0, \"extras\": {\"visible_camera\": false}}");
    let link = "light_link = { exclude = [\"it\"] }";
    let scene = format!("[[objects]]\nname = \"it\"\nmesh = \"model.gltf\"\n{link}\n");
    let beside = format!("[objects.\"node 0\"]\n{}\n", link.replace("it", "node 0"));
    for files in [
        [("scene.toml", scene.as_str()), ("model.gltf", &model)],
        [("model.gltf", &model), ("model.oscura.toml", &beside)],
    ] {
        let loaded = load_files_by(&files, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let traits = loaded.scene.instances[0].traits;
        assert_eq!(traits.visible_to, RayKinds::ALL.without(RayKinds::CAMERA), "{files:?}");
        assert!(!traits.links.receivers.includes(traits.sets), "{files:?}");
    }
}

/// The model's material, with its own texture and factors.
const PAINTED: &str = r#""materials": [{"name": "cloth", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1],
    "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [3, 2]}}}, "metallicFactor": 0.5,
    "metallicRoughnessTexture": {"index": 0}}}]"#;

fn with_painted(toml: &str) -> Result<Loaded, Error> {
    let plain = r#""materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]"#;
    let model = MODEL.replace(plain, PAINTED).replace("IMAGE", PIXEL);
    assert!(model.contains("cloth"));
    load_files_by(&[("model.gltf", model.as_str()), ("model.oscura.toml", toml)], &LoadOptions::default())
}

#[test]
fn facing_mixes_the_models_texture() {
    let toml = r#"
[materials.cloth]
base_color = "rim"
metallic = "rim"
roughness = "plain"
[textures.rim]
type = "mix"
a = "mine"
b = [0.1, 0.2, 0.3]
factor = "table"
[textures.mine]
type = "own"
[textures.table]
type = "facing"
colors = [1, 0]
[textures.plain]
type = "mix"
a = 0.25
b = "table"
factor = 0.5
"#;
    let scene = with_painted(toml).unwrap_or_else(|e| panic!("{e}")).scene;
    let Model::Pbr(model) = &scene.materials[0].model else { panic!("no glTF material") };
    let of = |id: TextureId| &scene.textures[id.index()];
    let mix = |id: TextureId| match *of(id) {
        Texture::Mix { a, b, factor } => [a, b, factor],
        ref other => panic!("{other:?}"),
    };
    // Factors and channels of the model are kept.
    let color = model.base_color.texture.expect("a texture");
    assert_eq!(model.base_color.factor, [0.5, 0.25, 1.0]);
    let [own, other, table] = mix(color);
    let Texture::Image { mapping: Mapping::Uv { transform, .. }, .. } = of(own) else { panic!("no picture") };
    assert_eq!(transform.scale.to_array(), [3.0, 2.0]);
    assert_eq!(*of(other), Texture::Solid([0.1, 0.2, 0.3]));
    assert_eq!(*of(table), Texture::Facing([[1.0; 3], [0.0; 3]].into()));
    let (metal, channel) = model.metallic.texture.expect("a texture");
    assert_eq!((model.metallic.factor, channel), (0.5, 2));
    let [own, _, same] = mix(metal);
    let Texture::Image { mapping: Mapping::Uv { transform, .. }, .. } = of(own) else { panic!("no picture") };
    assert_eq!((transform.scale.to_array(), same), ([1.0, 1.0], table));
    // A texture without reference to the model's replaces it.
    let (rough, channel) = model.roughness.texture.expect("a texture");
    assert_eq!((model.roughness.factor, channel), (1.0, 0));
    assert_eq!(*of(mix(rough)[0]), Texture::Solid([0.25; 3]));
}

#[test]
fn own_texture_defaults_to_white() {
    let mine = "[textures.mine]\ntype = \"own\"\n";
    let scene = with_painted(&format!("[materials.cloth]\nspecular_color = \"mine\"\n{mine}"));
    let scene = scene.unwrap_or_else(|e| panic!("{e}")).scene;
    let Model::Pbr(model) = &scene.materials[0].model else { panic!("no glTF material") };
    let own = model.specular_color.texture.expect("a texture");
    assert_eq!(scene.textures[own.index()], Texture::Solid([1.0; 3]));
    for (toml, part) in [
        ("[materials.cloth]\ntype = \"lambert\"\ncolor = \"mine\"\n", "has no model texture to refer to"),
        (
            "[materials.cloth]\nspecular_color = \"lies\"\n[textures.lies]\ntype = \"image\"\nfile = \"a.png\"\nmapping = \"own\"\n",
            "can't be read",
        ),
        (
            "[materials.cloth]\nbase_color = \"loop\"\n[textures.loop]\ntype = \"mix\"\na = \"mine\"\nb = \"loop\"\nfactor = 1\n",
            "contains itself",
        ),
        (
            "[materials.cloth]\nbase_color = \"half\"\n[textures.half]\ntype = \"mix\"\na = \"mine\"\n",
            "needs 'b'",
        ),
    ] {
        let shown = with_painted(&format!("{toml}{mine}")).expect_err("it is wrong").to_string();
        assert!(shown.contains(part), "'{part}' is not in:\n{shown}");
    }
}

/// An open glass surface exported by Blender refracts, unless thin glass is requested; then it has the tint of each interface.
#[test]
fn open_glass_refracts_unless_thin_glass_is_requested() {
    let toml =
        "[materials.pane]\nvolume = false\nkeeps_radiance = true\n[materials.ball]\nkeeps_radiance = true\n";
    let plain = r#""materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]"#;
    let glass = r#""pbrMetallicRoughness": {"baseColorFactor": [0.25, 1, 1, 1], "metallicFactor": 0},
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}"#;
    let materials = format!(r#""materials": [{{"name": "pane", {glass}}}, {{"name": "ball", {glass}}}]"#);
    let model = MODEL.replace(plain, &materials).replace("IMAGE", PIXEL);
    let generator = r#""asset": {"generator": "Khronos glTF Blender I/O v5.0", "version"#;
    let model = model.replace(r#""asset": {"version"#, generator);
    let both = r#""material": 0}, {"attributes": {"POSITION": 0}, "material": 1}"#;
    let model = model.replace(r#""material": 0}"#, both);
    for (glass, pane, ball) in [
        (Glass::Auto, (false, true, true, 0.25), (true, true, true, 0.25)),
        // The two triangles coincide: together they are closed, and thus a solid.
        (Glass::Panes, (false, false, false, 0.5), (true, true, true, 0.25)),
        (Glass::Thin, (false, false, false, 0.5), (false, false, false, 0.25)),
    ] {
        let options =
            LoadOptions { gltf: GltfOptions { glass, ..GltfOptions::default() }, ..LoadOptions::default() };
        let files = [("model.gltf", model.as_str()), ("model.oscura.toml", toml)];
        let scene = load_files_by(&files, &options).unwrap_or_else(|e| panic!("{e}")).scene;
        for (index, expected) in [pane, ball].into_iter().enumerate() {
            let Model::Pbr(p) = &scene.materials[index].model else { panic!("no glTF material") };
            let found = (p.has_volume, p.keeps_radiance, p.tints_once, p.base_color.factor[0]);
            assert_eq!(found, expected, "{glass:?} {index}");
        }
    }
}

/// Models may be untrusted, and so are their sidecars: these read regular files of the folder, not devices or pipes.
#[test]
fn sidecars_read_only_regular_files_of_the_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let inside = folder.path().join("model");
    std::fs::create_dir(&inside).expect("made");
    std::fs::write(inside.join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("written");
    std::fs::write(folder.path().join("secret.png"), b"?").expect("written");
    let refusal = |toml: &str, allow_external| {
        std::fs::write(inside.join("a.oscura.toml"), toml).expect("written");
        let options = LoadOptions { allow_external, ..LoadOptions::default() };
        let error = load(inside.join("a.obj"), &options).expect_err("it is refused");
        format!("{error} [{}]", error.problems[0].code)
    };
    let names = [
        "[environment]\nimage = \"NAME\"",
        "[[objects]]\nmesh = \"NAME\"",
        "[[lights]]\nname = \"a\"\npoint = { position = [0, 0, 0], ies = \"NAME\" }",
        "[[curves]]\nmaterial = \"default\"\nfile = \"NAME\"",
        "[render]\nview = \"NAME.csp\"",
        "[environment]\nfog = { density = 1 }\nbackground = [0, 0, 0]\n[materials.m]\ntype = \"dielectric\"\n\
         medium = { density = 1, grid = \"NAME\" }\n[[objects]]\nmaterial = \"m\"\nsphere = { center = [0, 0, 0], radius = 1 }",
    ];
    for text in names {
        for name in ["/dev/zero", "../secret.png", "//server/share/a.png"] {
            let error = refusal(&text.replace("NAME", name), false);
            assert!(error.contains("[path-outside]"), "{text}: {error}");
            assert!(error.contains("allow"), "{error}");
        }
    }
    if cfg!(unix) {
        let error = refusal(&names[0].replace("NAME", "/dev/zero"), true);
        assert!(error.contains("/dev/zero"), "{error}");
        let pipe = inside.join("pipe.obj");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.is_ok_and(|status| status.success()));
        let link = inside.join("link.png");
        std::os::unix::fs::symlink("/dev/zero", &link).expect("linked");
        for (text, name) in [(names[0], "pipe.obj"), (names[1], "pipe.obj"), (names[0], "link.png")] {
            let error = refusal(&text.replace("NAME", name), false);
            assert!(error.contains(name), "{name}: {error}");
        }
    }
}
