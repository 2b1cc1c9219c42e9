//! Scene files: the scenes they build, and errors with line numbers.

use crate::codes::code_of;
use crate::files::{load_files, load_files_by, refused_copies};
use oscura::error::Error;
use oscura::load::{LoadOptions, Loaded, load};
use oscura::math::{DAffine3, DVec3};
use oscura::scene::nodes::{NodeInput, NodeKind};
use oscura::scene::{
    AlphaMode, ColorSlot, EnergyCompensation, FloatSlot, Material, Medium, Model, Projection, Texture,
};
use std::path::{Path, PathBuf};

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

fn load_text(text: &str) -> Result<Loaded, Error> {
    load_files(&[("scene.toml", text), ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")])
}

fn with_camera(rest: &str) -> String {
    format!(
        "camera = {{ look_from = [0, 0, 5], look_at = [0, 0, 0] }}\nenvironment.background = 1\n\
         materials.default = {{ type = \"lambert\" }}\n{rest}"
    )
}

#[test]
fn every_example_loads_without_warnings() {
    let mut seen = 0;
    for entry in std::fs::read_dir(scenes()).expect("scenes/ exists") {
        let path = entry.expect("an entry").path();
        if path.extension().is_some_and(|e| e == "toml") {
            let loaded = load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
            assert!(loaded.warnings.is_empty(), "{}: {:?}", path.display(), loaded.warnings);
            seen += 1;
        }
    }
    assert!(seen >= 4);
}

/// Objects of one file are faceted or smooth, each by its own crease angle; equal angles share a mesh.
#[test]
fn smoothing_by_crease_angle() {
    // Two triangles that meet at a right angle.
    let roof = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n";
    let object = |more: &str| format!("[[objects]]\nmesh = \"roof.obj\"\n{more}");
    let objects = ["", "smooth = 30\n", "smooth = 120\n", "smooth = 120\n"].map(object).concat();
    let files = [("scene.toml", with_camera(&objects)), ("roof.obj", roof.into())];
    let scene = load_files(&files).expect("it loads").scene;
    let vertices = |i: usize| {
        let mesh = &scene.meshes[scene.instances[i].mesh.index()];
        (mesh.positions.len(), mesh.normals.len())
    };
    assert_eq!([0, 1, 2].map(vertices), [(4, 0), (6, 6), (4, 4)]);
    assert_eq!(scene.instances[2].mesh, scene.instances[3].mesh);
    let error =
        load_text(&with_camera(&object("smooth = 190\n"))).expect_err("too wide an angle").to_string();
    assert!(error.contains("'smooth'"), "{error}");
    let of_ball = "[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nsmooth = 30\n";
    let error = load_text(&with_camera(of_ball)).expect_err("spheres are smooth").to_string();
    assert!(error.contains("smooth"), "{error}");
    // Models unchanged, if the caller asks for it.
    let options = LoadOptions { smooth_rad: Some(2.0), ..LoadOptions::default() };
    let loaded = load_files_by(&[("roof.obj", roof)], &options).expect("it loads");
    assert_eq!(loaded.scene.meshes[0].normals.len(), 4);
    let loaded = load_files_by(&files, &options).expect("it loads");
    assert!(loaded.warnings.iter().any(|w| w.code == "unused-option"), "{:?}", loaded.warnings);
}

#[test]
fn cornell_box_camera_and_light() {
    let scene = load(scenes().join("cornell-quads.toml"), &LoadOptions::default()).expect("it loads").scene;
    let camera = &scene.cameras[0];
    assert!(camera.world_from_camera.transform_vector3(-DVec3::Z).distance(DVec3::Z) < 1e-12);
    // Seen from the front, +x is on the left, where the red wall is.
    assert!(camera.world_from_camera.transform_vector3(DVec3::X).distance(-DVec3::X) < 1e-12);
    let Projection::Perspective { vfov_rad } = camera.projection else { panic!("not perspective") };
    assert!((vfov_rad - 2.0 * (12.5f64 / 35.0).atan()).abs() < 1e-9);
    let light = scene.quads.iter().find(|q| q.name == "light").expect("a light");
    let normal = light.edge_u.cross(light.edge_v);
    assert!(normal.normalize().distance(-DVec3::Y) < 1e-12);
    assert!((normal.length() - 0.13 * 0.105).abs() < 1e-12);
    let emission = scene.materials[light.material.index()].emission.expect("it emits");
    assert!(!emission.two_sided && emission.radiance.factor == [17.0, 12.0, 4.0]);
}

#[test]
fn transforms_apply_in_the_listed_order() {
    let text = with_camera(
        r#"
        [[objects]]
        sphere = { center = [1, 0, 0], radius = 1 }
        transform = [{ scale = 2 }, { rotate = { axis = [0, 1, 0], angle = 90 } }, { translate = [0, 0, 10] }]
        [[objects]]
        quad = { corner = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }
        transform = [{ matrix = [1, 0, 0, 5, 0, 2, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1] }]
        [[objects]]
        quad = { corner = [0, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }
        transform = [{ scale = [-1, 1, 1] }]
        [[objects]]
        quad = { corner = [1, 0, 0], u = [1, 0, 0], v = [0, 1, 0] }
        transform = [{ euler = [0, 0, 90] }, { quaternion = [0, 0.7071067811865476, 0, 0.7071067811865476] }]
        "#,
    );
    let scene = load_text(&text).unwrap_or_else(|e| panic!("{e}")).scene;
    // Scaled to (2, 0, 0), rotated to (0, 0, -2), moved to (0, 0, 8).
    assert!(scene.shapes[0].center.distance(DVec3::new(0.0, 0.0, 8.0)) < 1e-12);
    assert!((scene.shapes[0].radius - 2.0).abs() < 1e-12);
    assert!(scene.quads[0].corner.distance(DVec3::new(5.0, 6.0, 7.0)) < 1e-12);
    assert!(scene.quads[0].edge_v.distance(DVec3::Y * 2.0) < 1e-12);
    // Mirrored, its front still faces +z.
    assert!(scene.quads[1].edge_u.cross(scene.quads[1].edge_v).z > 0.0);
    assert!(scene.quads[2].corner.distance(DVec3::Y) < 1e-12);
}

#[test]
fn all_problems_are_reported_with_lines_and_suggestions() {
    let text = "camera = { look_from = [0, 0, 5], look_att = [0, 0, 0] }\n\
                [materials]\nglass = { type = \"dielectric\", ior = \"high\" }\n\
                [[objects]]\nsphere = { center = [0, 0, 0], radius = -1 }\nmaterial = \"glas\"\n\
                [[objects]]\nmesh = \"missing.glb\"\nmaterial = \"glass\"\n[rendr]\n";
    let error = load_text(text).expect_err("it is wrong");
    let shown = error.to_string();
    for part in [
        "line 1: 'camera' has no key 'look_att' (did you mean 'look_at'?)",
        "line 1: 'camera' needs 'look_at'",
        "line 3: 'ior' of material 'glass' must be a finite number",
        "line 5: 'radius' of a sphere must be above 0",
        "line 6: there is no material 'glas' (did you mean 'glass'?)",
        "line 8: 'missing.glb': ",
        "line 10: the scene file has no key 'rendr' (did you mean 'render'?)",
    ] {
        assert!(shown.contains(part), "'{part}' is not in:\n{shown}");
    }
    assert_eq!(error.problems.len(), 7, "{shown}");
    assert_eq!(error.source_text.as_deref(), Some(text));
}

#[test]
fn numbers_without_leading_zero_are_explained() {
    for (text, fraction) in
        [("[camera]\nvfov = .5\n", " 0.5"), ("[camera]\nlook_at = [0.1, .8, 0]\n", " 0.5")]
    {
        let messages = load_text(text).expect_err("not TOML").to_string();
        assert!(messages.contains("line 2") && messages.contains(fraction), "{messages}");
    }
    let messages = load_text("[camera]\nvfov = 5..5\n").expect_err("not TOML").to_string();
    assert!(messages.contains("line 2") && !messages.contains(" 0.5"), "{messages}");
}

#[test]
fn meshes_are_loaded_once_and_unreferenced_images_never() {
    let text = with_camera(
        "textures.wood = { type = \"image\", file = \"missing.png\" }\n\
         materials.floor = { type = \"lambert\", color = \"wood\" }\n\
         materials.red = { type = \"lambert\", color = [1, 0, 0] }\n\
         [[objects]]\nmesh = \"a.obj\"\n\
         [[objects]]\nmesh = \"./a.obj\"\nmaterial = \"red\"\ntransform = [{ translate = [0, 3, 0] }]\n",
    );
    let loaded = load_text(&text).unwrap_or_else(|e| panic!("{e}"));
    let scene = loaded.scene;
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
    let material = scene.instances[1].material.expect("an override");
    assert_eq!(scene.materials[material.index()].name, "red");
    assert_eq!(scene.instances[1].world_from_object.translation.y, 3.0);
    assert!(scene.textures.is_empty());
    // The texture, its material and the default one.
    assert_eq!(loaded.left_out.len(), 3);
}

/// Meshes of formats without names get the object's name, which Cryptomatte shows.
#[test]
fn unnamed_meshes_get_the_object_name() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/meshes");
    let text = format!("[[objects]]\nname = \"ring\"\nmesh = {:?}\n", folder.join("torus.ply"));
    let loaded = load_text(&with_camera(&text)).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(loaded.scene.instances[0].name, "ring");
}

#[test]
fn unreferenced_entries_are_checked_without_opening_files() {
    let ball = "[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\n";
    let text = with_camera(&format!(
        "textures.a = {{ type = \"image\", file = \"missing.png\", wrp = \"clamp\" }}\n\
         textures.b = {{ type = \"checker\", even = \"a\", odd = \"none\" }}\n\
         materials.c = {{ type = \"lambert\", colour = 1 }}\n\
         materials.d = {{ type = \"pbr\", base_color = \"bb\" }}\nmaterials.e = 3\n{ball}"
    ));
    let error = load_text(&text).expect_err("it is wrong");
    let shown = error.to_string();
    for part in [
        "texture 'a' has no key 'wrp' (did you mean 'wrap'?)",
        "there is no texture 'none'",
        "material 'c' has no key 'colour' (did you mean 'color'?)",
        "there is no texture 'bb'",
        "material 'e' must be a table",
    ] {
        assert!(shown.contains(part), "'{part}' is not in:\n{shown}");
    }
    assert_eq!(error.problems.len(), 5, "{shown}");
    let unused = "materials.c = { type = \"lambert\", color = \"b\" }\n\
                  textures.a = { type = \"image\", file = \"missing.png\" }\n\
                  textures.b = { type = \"checker\", even = \"a\", odd = [0, 0, 1] }\n";
    let loaded = load_text(&with_camera(&format!("{unused}{ball}"))).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((loaded.scene.materials.len(), loaded.scene.textures.len()), (1, 0));
    assert_eq!(loaded.left_out.len(), 3, "{:?}", loaded.left_out);
}

#[test]
fn texture_cycles_are_refused_and_scaled_spheres_become_meshes() {
    let cycle = with_camera(
        "textures.a = { type = \"checker\", even = \"b\", odd = 0 }\n\
         textures.b = { type = \"checker\", even = \"a\", odd = 1 }\n\
         materials.m = { type = \"lambert\", color = \"a\" }\n\
         [[objects]]\nmaterial = \"m\"\nsphere = { center = [0, 0, 0], radius = 1 }\n",
    );
    assert!(load_text(&cycle).expect_err("a cycle").problems[0].code == "texture-cycle");
    let bent =
        "[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\ntransform = [{ scale = [1, 2, 1] }]\n";
    let loaded = load_text(&with_camera(bent)).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((loaded.scene.shapes.len(), loaded.scene.meshes[0].triangles.len()), (0, 81_920));
    assert_eq!(loaded.warnings.len(), 1);
}

#[test]
fn damaged_scene_files_never_panic() {
    let original = std::fs::read(scenes().join("materials.toml")).expect("it exists");
    let refused = refused_copies(&original, b"[]{}=\"#.-9e\n,", 600, |bytes| {
        load_files(&[("scene.toml", bytes)]).is_err_and(|e| !e.problems.is_empty())
    });
    assert!(refused > 200, "only {refused} of 600 were refused");
}

#[test]
fn a_camera_may_look_straight_down() {
    let text = with_camera("objects = [{ mesh = \"a.obj\" }]").replace("[0, 0, 5]", "[0, 5, 0]");
    let loaded = load_text(&text).unwrap_or_else(|e| panic!("{e}"));
    // The top of the picture is towards -z.
    let up = loaded.scene.cameras[0].world_from_camera.matrix3.y_axis;
    assert!((up - DVec3::NEG_Z).length() < 1e-12, "{up}");
    let wrong = text.replace("look_at = [0, 0, 0]", "look_at = [0, 0, 0], view_up = [0, 1, 0]");
    let shown = load_text(&wrong).expect_err("the upright is lost").to_string();
    assert!(shown.contains("'view_up'"), "{shown}");
}

#[test]
fn key_names_of_other_renderers_get_suggestions() {
    let text = "camera = { position = [0, 0, 5], target = [0, 0, 0], fov = 40, up = [0, 1, 0] }\nrender = { spp = 4 }\n\
                [[objects]]\nsphere = { position = [0, 0, 0], radius = 1 }\ntranslate = [1, 0, 0]\nmaterial = \"m\"\n\
                [materials.m]\ntype = \"lambert\"\nalbedo = [1, 1, 1]\n";
    let shown = load_text(text).expect_err("other names").to_string();
    for (theirs, ours) in [
        ("position", "look_from"),
        ("target", "look_at"),
        ("fov", "vfov"),
        ("up", "view_up"),
        ("spp", "samples"),
        ("position", "center"),
        ("translate", "transform"),
        ("albedo", "color"),
    ] {
        let words = format!("has no key '{theirs}' (did you mean '{ours}'?)");
        assert!(shown.contains(&words), "'{words}' is not in:\n{shown}");
    }
}

/// Shapes are keys: given as a type, they are one problem.
#[test]
fn an_object_without_a_shape_is_one_problem() {
    let text = "camera = { look_from = [0, 0, 5], look_at = [0, 0, 0] }\nenvironment = { background = 1 }\n\
                materials.default = { type = \"lambert\" }\n[[objects]]\ntype = \"sphere\"\ncenter = [0, 0, 0]\nradius = 1\n";
    let error = load_text(text).expect_err("no shape");
    assert_eq!(error.problems.len(), 1, "{error}");
    assert!(error.to_string().contains("sphere = { center"), "{error}");
}

#[test]
fn errors_do_not_cause_unknown_key_errors() {
    let text = "camera = { look_form = [0, 0, 5], look_at = [0, 0, 0], f_stop = 2, focus_at = [0, 0, 0], blades = 5 }\n\
                [[lights]]\narea = { center = [0, 4, 0], direction = [0, -1, 0], size = [0, 1], power = 30 }\n";
    let shown = load_text(text).expect_err("two mistakes").to_string();
    for part in ["did you mean 'look_from'?", "needs 'look_from'", "'size' of an area light"] {
        assert!(shown.contains(part), "'{part}' is not in:\n{shown}");
    }
    for key in ["'f_stop'", "'focus_at'", "'blades'", "'power'"] {
        assert!(!shown.contains(&format!("no key {key}")), "{shown}");
    }
}

#[test]
fn byte_range_colours_are_reported() {
    let materials = "materials.red = { type = \"lambert\", color = [200, 10, 10] }\n\
                     materials.lamp = { type = \"emissive\", radiance = [200, 10, 10] }\n\
                     materials.white = { type = \"pbr\", base_color = 1 }\n";
    let objects = ["red", "lamp", "white"].map(|m| format!("{{ mesh = \"a.obj\", material = \"{m}\" }}"));
    let text = with_camera(&format!("{materials}objects = [{}]", objects.join(", ")));
    let loaded = load_text(&text).unwrap_or_else(|e| panic!("{e}"));
    let [warned] = &loaded.warnings[..] else { panic!("{:?}", loaded.warnings) };
    assert!(warned.code == "color-above-one" && warned.message.contains("'red'"), "{warned}");
}

#[test]
fn priorities_are_integers() {
    let with = |priority: &str| {
        load_text(&with_camera(&format!(
            "materials.liquid = {{ type = \"dielectric\", ior = 1.5, priority = {priority} }}\n\
             objects = [{{ mesh = \"a.obj\", material = \"liquid\" }}]"
        )))
    };
    let loaded = with("-3").expect("a whole number");
    assert!(loaded.scene.materials.iter().any(|m| m.name == "liquid" && m.priority == -3));
    for wrong in ["1.7", "1001", "true"] {
        let error = with(wrong).expect_err(wrong).to_string();
        assert!(error.contains("'priority'") && error.contains("-1000"), "{error}");
    }
}

/// Faces select a material of their object's list by number; equal lists share a mesh, and attributes that no node uses are
/// dropped.
#[test]
fn faces_select_materials_of_a_list() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let ply = "ply\nformat ascii 1.0\ncomment oscura attribute 0 1 rust\ncomment oscura attribute 1 1 other\nelement vertex 4\n\
               property float x\nproperty float y\nproperty float z\nproperty float a0_0\nproperty float a1_0\nelement face 2\n\
               property list uchar int vertex_indices\nproperty int material_index\nend_header\n\
               0 0 0 1 2\n1 0 0 1 2\n0 1 0 1 2\n1 1 0 1 2\n3 0 1 2 2\n3 2 1 3 0\n";
    std::fs::write(folder.path().join("a.ply"), ply).expect("written");
    let path = folder.path().join("scene.toml");
    let object = |list: &str| format!("[[objects]]\nmesh = \"a.ply\"\n{list}\n");
    let write = |lists: &[&str]| {
        let objects: String = lists.iter().map(|list| object(list)).collect();
        let text = format!(
            "camera = {{ look_from = [0, 0, 5], look_at = [0, 0, 0] }}\nenvironment.background = 1\n\
             textures.t = {{ type = \"nodes\", result = \"a.factor\", nodes = {{ a = {{ type = \"attribute\", name = \"rust\" }} }} }}\n\
             materials.red = {{ type = \"lambert\", color = [1, 0, 0] }}\n\
             materials.rusty = {{ type = \"lambert\", color = \"t\" }}\n{objects}"
        );
        std::fs::write(&path, text).expect("written");
        load(&path, &LoadOptions::default())
    };
    let both = "materials = [\"red\", \"red\", \"rusty\"]";
    let loaded = write(&[both, both, "material = \"red\"", "materials = [\"rusty\", \"red\", \"red\"]"]);
    let scene = loaded.unwrap_or_else(|e| panic!("{e}")).scene;
    let meshes: Vec<u32> = scene.instances.iter().map(|instance| instance.mesh.0).collect();
    assert!(meshes[0] == meshes[1] && meshes[2] != meshes[0] && meshes[3] != meshes[0], "{meshes:?}");
    let names = |i: usize| {
        let mesh = &scene.meshes[meshes[i] as usize];
        mesh.parts.iter().map(|part| scene.materials[part.material.index()].name.as_str()).collect::<Vec<_>>()
    };
    // The face of material 0 comes first.
    assert_eq!((names(0), names(3)), (vec!["red", "rusty"], vec!["rusty", "red"]));
    let attributes = &scene.meshes[meshes[0] as usize].attributes;
    assert_eq!(attributes.iter().map(|a| a.name.as_str()).collect::<Vec<_>>(), ["rust"]);
    let shown = write(&["materials = [\"red\", \"red\"]"]).expect_err("too few").to_string();
    assert!(shown.contains("2 names") && shown.contains("'material_index' 2"), "{shown}");
    // A mesh used by only one list is not copied.
    let alone = write(&[both]).unwrap_or_else(|e| panic!("{e}")).scene;
    assert_eq!(alone.meshes.len(), 1);
}

/// A node material on a sphere.
fn with_nodes(surface: &str, nodes: &str) -> String {
    with_camera(&format!(
        "[[objects]]\nsphere = {{ center = [0, 0, 0], radius = 1 }}\nmaterial = \"m\"\n[materials.m]\n\
         type = \"nodes\"\nsurface = \"{surface}\"\n[materials.m.nodes]\n{nodes}"
    ))
}

fn material_of_nodes(surface: &str, nodes: &str) -> Material {
    let loaded = load_text(&with_nodes(surface, nodes)).unwrap_or_else(|e| panic!("{e}"));
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    loaded.scene.materials.into_iter().find(|m| m.name == "m").expect("the material")
}

/// A colour graph records that another one reads the alpha of its image.
#[test]
fn graphs_record_alpha_use() {
    for (alpha, is_read) in [("\"i.alpha\"", true), ("1", false)] {
        let picture = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/references/nodes/picture.png");
        let nodes = format!(
            "i = {{ type = \"image_texture\", file = {picture:?}, extension = \"clip\" }}\n\
             d = {{ type = \"principled_bsdf\", base_color = \"i.color\", alpha = {alpha} }}\n"
        );
        let scene = load_text(&with_nodes("d", &nodes)).unwrap_or_else(|e| panic!("{e}")).scene;
        let colors = scene.textures.iter().filter_map(|texture| match texture {
            Texture::Nodes(graph) if matches!(graph.result, NodeInput::Link { output: 0, .. }) => {
                graph.nodes.iter().find(|node| matches!(node.kind, NodeKind::ImageTexture { .. }))
            }
            _ => None,
        });
        assert!(colors.clone().count() > 0);
        assert!(colors.into_iter().all(|node| node.reads_alpha == is_read), "{alpha}");
    }
}

/// A scale of 0 along one axis leaves a flat mesh, but no analytic shape.
#[test]
fn meshes_may_be_flat() {
    let placed = |shape: &str, scale: &str| {
        let object = format!(
            "[[objects]]\n{shape}\ntransform = [{{ scale = {scale} }}, {{ translate = [0, 0, 3] }}]\n"
        );
        load_text(&with_camera(&object))
    };
    let flat = placed("mesh = \"a.obj\"", "[2, 1, 0]").unwrap_or_else(|e| panic!("{e}")).scene;
    let instance = &flat.instances[0];
    assert_eq!(flat.meshes[instance.mesh.index()].positions, [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert_eq!(instance.world_from_object, DAffine3::from_translation(DVec3::new(0.0, 0.0, 3.0)));
    let line = placed("mesh = \"a.obj\"", "[2, 0, 0]").unwrap_or_else(|e| panic!("{e}"));
    assert!(line.scene.instances.is_empty() && line.warnings.iter().any(|w| w.code == "mesh-degenerate"));
    assert!(placed("sphere = { center = [0, 0, 0], radius = 1 }", "[2, 1, 0]").is_err());
}

#[test]
fn closures_simplify_to_materials() {
    let constant = |value: f32| ColorSlot::constant([value; 3]);
    // One closure of weight 1 is the material itself, whatever its graph.
    let nodes =
        "d = { type = \"diffuse_bsdf\", color = 0.5 }\nm = { type = \"mix_shader\", factor = 0, a = \"d\" }";
    assert_eq!(material_of_nodes("m", nodes).model, Model::Lambert { albedo: constant(0.5) });
    // Mixes of constants have constant weights.
    let nodes = "d = { type = \"diffuse_bsdf\", color = 0.5 }\ng = { type = \"glossy_bsdf\" }\n\
                 m = { type = \"mix_shader\", factor = 0.25, a = \"d\", b = \"g\" }";
    let mixed = material_of_nodes("m", nodes);
    let weights: Vec<ColorSlot> = mixed.model.components().iter().map(|c| c.weight).collect();
    assert_eq!(weights, [constant(0.75), constant(0.25)]);
    // Emission is added up, and a colour used as a shader is emission.
    let nodes = "e = { type = \"emission\", color = [1, 0.5, 0], strength = 2 }\n\
                 a = { type = \"add_shader\", a = \"e\", b = [1, 1, 1] }";
    let emissive = material_of_nodes("a", nodes);
    assert_eq!(emissive.model, Model::Black);
    assert_eq!(emissive.emission.map(|e| e.radiance), Some(ColorSlot::constant([3.0, 2.0, 1.0])));
    // The transparent weight is alpha, and the rest is normalised.
    let nodes = "d = { type = \"diffuse_bsdf\", color = 0.5 }\nt = { type = \"transparent_bsdf\" }\n\
                 m = { type = \"mix_shader\", factor = 0.25, a = \"t\", b = \"d\" }";
    let thin = material_of_nodes("m", nodes);
    assert_eq!((thin.alpha, thin.alpha_mode), (FloatSlot::constant(0.25), AlphaMode::Blend));
    assert_eq!(thin.model, Model::Lambert { albedo: constant(0.5) });
    // Fully transparent emissive closures add their emission.
    let nodes = "e = { type = \"emission\" }\nt = { type = \"transparent_bsdf\" }\na = { type = \"add_shader\", a = \"e\", b = \"t\" }";
    let glow = material_of_nodes("a", nodes);
    assert!(glow.emission.is_some() && glow.emitter_traits.is_some_and(|traits| !traits.is_obstacle));
}

/// Light enters the medium of a mix through refractive closures; subsurface scattering has its own medium.
#[test]
fn refractive_closures_enter_the_medium() {
    let nodes = "g = { type = \"glass_bsdf\" }\nd = { type = \"diffuse_bsdf\" }\n\
                 s = { type = \"subsurface_scattering\" }\n\
                 a = { type = \"add_shader\", a = \"g\", b = \"d\" }\n\
                 b = { type = \"add_shader\", a = \"a\", b = \"s\" }";
    let filled = with_nodes("b", nodes)
        .replace("surface = \"b\"", "surface = \"b\"\nvolume = true\nmedium = { density = 5 }");
    let scene = load_text(&filled).unwrap_or_else(|e| panic!("{e}")).scene;
    let mix = scene.materials.iter().find(|m| m.name == "m").expect("the material");
    let own = mix.medium.expect("the medium");
    let media: Vec<Option<Medium>> = mix.model.components().iter().map(|c| c.material.medium).collect();
    assert_eq!(media[..2], [Some(own), None]);
    assert!(media[2].is_some_and(|body| body != own), "{media:?}");
}

#[test]
fn tinted_transparent_closures() {
    // A surface without other closures passes all light; with another closure, the mean transparency.
    let sheet = material_of_nodes("t", "t = { type = \"transparent_bsdf\", color = [1, 0.5, 0.25] }");
    assert_eq!((sheet.alpha, sheet.alpha_mode), (FloatSlot::constant(0.0), AlphaMode::Blend));
    assert_eq!(sheet.transparent_color, ColorSlot::constant([1.0, 0.5, 0.25]));
    let nodes = "d = { type = \"diffuse_bsdf\", color = 0.5 }\nt = { type = \"transparent_bsdf\", color = [1, 0.5, 0] }\n\
                 m = { type = \"mix_shader\", factor = 0.5, a = \"t\", b = \"d\" }";
    let mixed = material_of_nodes("m", nodes);
    assert_eq!(mixed.alpha, FloatSlot::constant(0.75));
    assert_eq!(mixed.transparent_color, ColorSlot::constant([2.0, 1.0, 0.0]));
}

/// The microfacet distribution is an option of each node.
#[test]
fn nodes_select_the_microfacet_model() {
    let of = |value: &str| {
        let nodes = format!("p = {{ type = \"principled_bsdf\", roughness = 0.5{value} }}");
        material_of_nodes("p", &nodes).model.pbr().expect("a glTF material").energy_compensation
    };
    assert_eq!(of(""), None);
    assert_eq!(of(", multiscatter = 0"), Some(EnergyCompensation::Off));
    assert_eq!(of(", multiscatter = 1"), Some(EnergyCompensation::On));
}

/// Glass uses its specified distribution.
#[test]
fn glass_with_beckmann_distribution() {
    for (value, expected) in [("", false), (", beckmann = 1", true)] {
        for shader in ["glass_bsdf", "refraction_bsdf"] {
            let nodes = format!("p = {{ type = \"{shader}\", roughness = 0.5{value} }}");
            let material = material_of_nodes("p", &nodes);
            assert_eq!(
                material.model.pbr().expect("a glTF material").is_beckmann,
                expected,
                "{shader}{value}"
            );
        }
    }
}

/// The index of a transmissive medium may be below that of its surroundings.
#[test]
fn ior_below_one_for_transmission() {
    let of = |node: &str| {
        material_of_nodes("p", &format!("p = {{ {node}, ior = 0.7 }}")).model.pbr().map(|p| p.ior)
    };
    assert_eq!(of("type = \"glass_bsdf\""), Some(0.7));
    assert_eq!(of("type = \"refraction_bsdf\""), Some(0.7));
    assert_eq!(of("type = \"principled_bsdf\", transmission_weight = 0.5"), Some(0.7));
    let loaded =
        load_text(&with_nodes("p", "p = { type = \"principled_bsdf\", ior = 0.7 }")).expect("a scene");
    let warnings: Vec<String> = loaded.warnings.iter().map(ToString::to_string).collect();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("'m'"), "{warnings:?}");
}

/// An index of 0 reflects all light, as in Cycles; 1 reflects nothing.
#[test]
fn ior_of_zero_is_a_mirror() {
    for (ior, expected) in [("0.0", 0.0), ("1.0", 1.0)] {
        let material = material_of_nodes("p", &format!("p = {{ type = \"principled_bsdf\", ior = {ior} }}"));
        assert_eq!(material.model.pbr().expect("a glTF material").ior, expected, "{ior}");
    }
}

/// The Principled BSDF's base: an index of refraction by its specular level, a coat, emission.
#[test]
fn principled_bsdf_becomes_the_gltf_material() {
    let nodes = "p = { type = \"principled_bsdf\", base_color = [0.1, 0.2, 0.3], roughness = 0.25, coat_weight = 0.5, \
                 emission_color = [1, 0, 0], emission_strength = 3 }";
    let material = material_of_nodes("p", nodes);
    let pbr = material.model.pbr().expect("a glTF material");
    assert_eq!(pbr.base_color, ColorSlot::constant([0.1, 0.2, 0.3]));
    assert_eq!((pbr.roughness, pbr.metallic), (FloatSlot::constant(0.25), FloatSlot::constant(0.0)));
    assert!((pbr.ior - 1.5).abs() < 1e-6 && pbr.specular == FloatSlot::constant(1.0));
    assert_eq!(pbr.clearcoat.map(|c| c.factor), Some(FloatSlot::constant(0.5)));
    assert_eq!(material.emission.map(|e| e.radiance), Some(ColorSlot::constant([3.0, 0.0, 0.0])));
}

#[test]
fn invalid_closures_are_refused() {
    let refusal = |surface: &str, nodes: &str| load_text(&with_nodes(surface, nodes)).expect_err("wrong");
    let round = "a = { type = \"mix_shader\", a = \"b\" }\nb = { type = \"add_shader\", a = \"a\" }";
    assert_eq!(code_of(&refusal("a", round)), "shader-graph-invalid");
    let diffuse = "d = { type = \"diffuse_bsdf\", colour = 0.5 }";
    assert!(refusal("d", diffuse).to_string().contains("'colour'"));
    assert_eq!(code_of(&refusal("e", "d = { type = \"diffuse_bsdf\" }")), "unknown-shader");
    let mix = "[materials.a]\ntype = \"mix\"\ncomponents = [{ material = \"b\" }]\n[materials.b]\ntype = \"mix\"\n\
               components = [{ material = \"a\" }]\n[[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"a\"\n";
    assert_eq!(code_of(&load_text(&with_camera(mix)).expect_err("mixes in mixes")), "nested-mix");
}

#[test]
fn missing_files_name_their_script() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scene.toml");
    let text = "textures.t = { type = \"image\", file = \"made/t.png\" }\nmaterials.m = { type = \"lambert\", color = \"t\" }\n\
                [[objects]]\nmesh = \"made/a.ply\"\nmaterial = \"m\"\n[[curves]]\nfile = \"made/b.hair\"\nradius = 1\nmaterial = \"m\"\n";
    std::fs::write(&path, with_camera(text)).expect("written");
    let help = || {
        let error = load(&path, &LoadOptions::default()).expect_err("three files are missing");
        error.problems.iter().map(|p| p.help.clone().unwrap_or_default()).collect::<Vec<_>>()
    };
    assert_eq!(help(), ["paths are relative to the folder of the scene file"; 3]);
    std::fs::write(folder.path().join("build.py"), "").expect("written");
    let script = folder.path().join("build.py");
    let helps = help();
    assert!(
        helps.len() == 3 && helps.iter().all(|h| h.ends_with(&format!("python3 {}", script.display()))),
        "{helps:?}"
    );
}

#[test]
fn mix_components_count_as_used() {
    let mix = "materials.a = { type = \"lambert\" }\nmaterials.b = { type = \"lambert\" }\nmaterials.z = { type = \"lambert\" }\n\
               materials.both = { type = \"mix\", components = [{ material = \"a\" }, { material = \"b\" }] }\n\
               [[objects]]\nsphere = { center = [0, 0, 0], radius = 1 }\nmaterial = \"both\"\n";
    let loaded = load_text(&with_camera(mix)).expect("it loads");
    let unused: Vec<_> = loaded.left_out.iter().filter_map(|line| line.split('\'').nth(1)).collect();
    assert_eq!(unused, ["default", "z"], "{:?}", loaded.left_out);
}

/// Showcase scenes are valid except for files that their scripts build or fetch, which a fresh clone lacks.
#[test]
fn showcase_scenes_only_lack_generated_files() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut seen = 0;
    for entry in std::fs::read_dir(scenes().join("showcase")).expect("the showcase") {
        let from = entry.expect("an entry").path();
        if !from.join("scene.toml").is_file() {
            continue;
        }
        for file in ["scene.toml", "build.py"] {
            std::fs::copy(from.join(file), folder.path().join(file)).expect("copied");
        }
        let error = load(folder.path().join("scene.toml"), &LoadOptions::default()).expect_err("no meshes");
        for problem in &error.problems {
            let helps = problem.help.as_ref().is_some_and(|help| help.ends_with("build.py"));
            assert!(helps, "{}: {problem:?}", from.display());
        }
        seen += 1;
    }
    assert!(seen >= 6, "{seen}");
}
