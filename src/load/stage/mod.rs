//! The stage of bare models: a camera that frames the model, light, a ground with shadows, a default material. Scenes with a
//! camera only get light if they have none.

mod framing;
mod ground;
mod light;
mod options;

use super::Loaded;
use crate::error::{Choice, Warning};
use crate::math::DVec3;
use crate::scene::{Backdrop, ColorSlot, Environment, FloatSlot, Material, Model, PbrMaterial, Scene};
use framing::Outline;
pub use framing::Turntable;
use light::EmittedLight;
pub use options::ViewFrom;
pub use options::{Background, Ground, StageLight, StageOptions};

/// Radiance of the soft sky at nadir and zenith. The mean over the sphere of a gradient linear in y is the mean
/// of the two: (0.560, 0.6, 0.640), a luminance of 0.59. The dark nadir contrasts with pale models seen from above, and shades
/// their undersides. Faces that point up reflect (0.6 + 0.54 * 2 / 3) = 0.96 times their albedo: white isn't clipped in a PNG.
const SOFT_SKY: ([f32; 3], [f32; 3]) = ([0.064, 0.06, 0.056], [1.056, 1.14, 1.224]);

/// Completes a scene, with notes. A scene without a camera gets a camera that frames it, ground and material by
/// [`StageOptions`], and light unless it has lights or the caller has an environment. A scene with a camera gets light only if it has
/// none; its emissive surfaces count as light, unless it is a model ([`Loaded::is_model`]) whose surfaces only glow. A
/// light chosen by the caller replaces the environment.
pub fn complete(loaded: &mut Loaded, options: &StageOptions, overrides_environment: bool) {
    if options.is_dry_run {
        return dry_run(loaded, options, overrides_environment);
    }
    let scene = &loaded.scene;
    let has_surfaces = !(scene.instances.is_empty() && scene.shapes.is_empty() && scene.quads.is_empty());
    if !has_surfaces && scene.curves.is_empty() {
        let message = "there is nothing to see: no triangles, quads or other shapes";
        loaded.warnings.push(Warning::general(message));
    }
    let is_bare = scene.cameras.is_empty();
    let has_lights =
        scene.environment != Environment::Black || !scene.lights.is_empty() || loaded.has_area_lights;
    let is_chosen = options.is_light_chosen && options.light.is_stage();
    let is_lit = overrides_environment || has_lights && !is_chosen;
    if is_bare {
        add_stage(loaded, options, is_lit);
    } else {
        let emitted_light = light::classify_emission(&loaded.scene);
        let is_dark = !is_lit && (is_chosen || lacks_light(loaded, emitted_light));
        if is_dark {
            light_scene(loaded, options, emitted_light);
        }
        warn_of_unused(loaded, options, overrides_environment);
    }
    set_background(loaded, options);
}

/// Adds only cameras, but reports all additions.
fn dry_run(loaded: &mut Loaded, options: &StageOptions, overrides_environment: bool) {
    let scene = &loaded.scene;
    let (materials, default_materials) = (scene.materials.clone(), loaded.default_materials.clone());
    let (images, textures, shapes) = (scene.images.len(), scene.textures.len(), scene.shapes.len());
    let environment = (scene.environment.clone(), scene.environment_visible_to);
    let backdrop = scene.backdrop.clone();
    complete(loaded, &StageOptions { is_dry_run: false, ..options.clone() }, overrides_environment);
    let scene = &mut loaded.scene;
    (scene.environment, scene.environment_visible_to) = environment;
    (scene.backdrop, scene.materials, loaded.default_materials) = (backdrop, materials, default_materials);
    scene.images.truncate(images);
    scene.textures.truncate(textures);
    scene.shapes.truncate(shapes);
    loaded.is_stage_lit = false;
}

/// The centre of a scene, world space: that of the turntable, else of the bounds without outliers.
pub fn scene_center(loaded: &Loaded) -> DVec3 {
    match loaded.turntable {
        Some(table) => table.center(),
        None => Outline::of(&loaded.scene, loaded.offset).center() + loaded.offset,
    }
}

/// Whether a scene with a camera but without lights needs light; warns if its emissive surfaces are dim.
fn lacks_light(loaded: &mut Loaded, emitted_light: EmittedLight) -> bool {
    if emitted_light == EmittedLight::Dim && loaded.is_model {
        let message = format!(
            "the only lights are dim emissive surfaces: the picture will be dark ({} adds light)",
            Choice::Stage
        );
        loaded.warnings.push(Warning::general(("little-light", message)));
    }
    emitted_light == EmittedLight::None || emitted_light == EmittedLight::Glow && loaded.is_model
}

/// Adds the whole stage around a model without a camera.
fn add_stage(loaded: &mut Loaded, options: &StageOptions, is_lit: bool) {
    let outline = Outline::of(&loaded.scene, loaded.offset);
    if let Some(outliers) = &outline.outliers {
        let message = format!("the camera doesn't frame distant parts: {outliers}");
        loaded.warnings.push(Warning::general(message));
    }
    let framed = framing::frame(&outline, options, &loaded.scene.settings);
    let is_studio = !is_lit && options.light.is_stage();
    loaded.turntable = Some(Turntable::new(loaded.offset + framed.target, is_studio));
    loaded.is_stage_lit = is_studio;
    let mut camera = framed.camera;
    camera.world_from_camera.translation += loaded.offset;
    loaded.scene.cameras.push(camera);
    if options.light.is_stage() {
        apply_clay(loaded);
    }
    if is_lit || !options.light.is_stage() {
        let message = format!("no camera: shown from {} ({} decides)", options.view, Choice::ViewFrom);
        loaded.notes.push(Warning::general(message));
        if !is_lit {
            light_without_stage(loaded, options);
        }
    } else {
        let ground = options.ground_for(is_lit);
        let lights = light_description(&loaded.scene);
        loaded.scene.environment = light::environment(&mut loaded.scene, options);
        let message = format!(
            "no camera{}: shown from {}, {}{lights}{} ({}, {} and {} change that)",
            if lights.is_empty() { " and no light" } else { "" },
            options.view,
            options.light,
            ground.description(),
            Choice::ViewFrom,
            Choice::Stage,
            Choice::Ground
        );
        loaded.notes.push(Warning::general(("stage", message)));
    }
    ground::add(loaded, options, &outline, is_lit);
}

/// Lights a model without a stage: the soft sky, or no light.
fn light_without_stage(loaded: &mut Loaded, options: &StageOptions) {
    if options.light == StageLight::Soft {
        add_soft_sky(loaded);
    } else if light_description(&loaded.scene).is_empty()
        && light::classify_emission(&loaded.scene) == EmittedLight::None
    {
        let message =
            ("no-light", format!("no light: the picture will be black ({} adds light)", Choice::Stage));
        loaded.warnings.push(Warning::general(message));
    }
}

/// Adds only light, for a scene with a camera.
fn light_scene(loaded: &mut Loaded, options: &StageOptions, emitted_light: EmittedLight) {
    if options.is_light_chosen && options.light.is_stage() {
        let message = match (light_description(&loaded.scene), emitted_light) {
            ("", EmittedLight::None) => format!("no light: {}", options.light),
            ("", _) => format!("no light but emissive surfaces: added {}", options.light),
            (lights, _) => format!("{}{lights}", options.light),
        };
        loaded.scene.environment = light::environment(&mut loaded.scene, options);
        loaded.is_stage_lit = true;
        loaded.notes.push(Warning::general(("stage-light", message)));
    } else if options.light != StageLight::None {
        add_soft_sky(loaded);
    }
}

/// Description of the file's lights and environment for the note about the stage's light; empty without any.
fn light_description(scene: &Scene) -> &'static str {
    match (scene.environment == Environment::Black, scene.lights.is_empty()) {
        (true, true) => "",
        (true, false) => ", in addition to the lights of the file",
        (false, true) => ", instead of the environment of the file",
        (false, false) => ", instead of the environment of the file and in addition to its lights",
    }
}

/// Adds the soft sky, with a warning.
fn add_soft_sky(loaded: &mut Loaded) {
    let scene = &mut loaded.scene;
    let message = match light::classify_emission(scene) {
        EmittedLight::None => "no light: lit by a soft default sky of mean radiance 0.6".to_string(),
        _ => format!(
            "no light but emissive surfaces: added a soft default sky of mean radiance 0.6 ({} for none)",
            Choice::Environment
        ),
    };
    let (nadir, zenith) = SOFT_SKY;
    scene.environment = Environment::Gradient { nadir, zenith };
    loaded.warnings.push(Warning::general(("default-sky", message)));
}

/// Warns of stage options without effect, as the scene or the caller overrides them.
fn warn_of_unused(loaded: &mut Loaded, options: &StageOptions, overrides_environment: bool) {
    let mut warn_if = |is_unused: bool, option: Choice, why: &str| {
        if is_unused {
            let message = format!("{option} has no effect: {why}");
            loaded.warnings.push(Warning::general(("unused-option", message)));
        }
    };
    let own_camera = "the scene has its own camera";
    warn_if(
        options.is_light_chosen && overrides_environment,
        Choice::Stage,
        "another environment is requested",
    );
    warn_if(options.is_view_chosen, Choice::ViewFrom, own_camera);
    warn_if(options.ground.is_some_and(|g| g != Ground::None), Choice::Ground, own_camera);
    warn_if(options.zoom != 1.0, Choice::Zoom, own_camera);
}

/// Sets the background of the options.
fn set_background(loaded: &mut Loaded, options: &StageOptions) {
    match &options.background {
        None => {}
        Some(Background::Transparent) => ground::hide_environment(&mut loaded.scene),
        Some(Background::Color(color)) => {
            ground::hide_environment(&mut loaded.scene);
            loaded.scene.backdrop = Some(Backdrop::Color(*color));
        }
        Some(Background::Picture(picture)) => {
            ground::hide_environment(&mut loaded.scene);
            loaded.scene.backdrop = Some(Backdrop::Picture(picture.clone()));
        }
    }
}

// The material of models without one.

/// Linear albedo of clay: dark enough for visible shading, slightly warm.
const CLAY_COLOR: [f32; 3] = [0.60, 0.57, 0.53];
/// Roughness of clay: slightly glossy.
const CLAY_ROUGHNESS: f32 = 0.5;

/// Assigns a clay material to faces without one; vertex colours and textures replace its colour.
fn apply_clay(loaded: &mut Loaded) {
    for id in std::mem::take(&mut loaded.default_materials) {
        let Some(material) = loaded.scene.materials.get_mut(id.index()) else { continue };
        let base_color = match &material.model {
            Model::Lambert { albedo } if albedo.texture.is_some() || material.use_vertex_colors => *albedo,
            Model::Pbr(_) if material.use_vertex_colors => ColorSlot::constant([1.0; 3]),
            Model::Lambert { .. } | Model::Pbr(_) => ColorSlot::constant(CLAY_COLOR),
            // An override of the sidecar.
            _ => continue,
        };
        let clay = PbrMaterial {
            base_color,
            metallic: FloatSlot::constant(0.0),
            roughness: FloatSlot::constant(CLAY_ROUGHNESS),
            ..PbrMaterial::default()
        };
        *material = Material { model: Model::Pbr(Box::new(clay)), ..material.clone() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{DVec2, DVec3};
    use crate::sampling::hash::SplitMix64;
    use crate::scene::{Instance, Material, MaterialId, Mesh, MeshId, Motion, Projection, RayKinds, Shape};

    fn sphere_scene(center: DVec3, radius: f64, material: Material) -> Loaded {
        let mut loaded = Loaded::default();
        loaded.scene.materials.push(material);
        loaded.scene.shapes.push(Shape::sphere(center, radius, MaterialId(0)));
        loaded
    }

    fn grey() -> Material {
        Material::lambert("grey", [0.5; 3])
    }

    fn default_options() -> StageOptions {
        StageOptions::default()
    }

    /// A mesh of these points, three per triangle.
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

    /// Image coordinates of a point: -1 to 1 vertically, minus to plus the aspect ratio horizontally.
    fn projected(loaded: &Loaded, p: DVec3) -> DVec2 {
        let camera = &loaded.scene.cameras[0];
        let Projection::Perspective { vfov_rad } = camera.projection else { panic!("a perspective") };
        let local = camera.world_from_camera.inverse().transform_point3(p);
        assert!(local.z < 0.0, "{p} is behind the camera");
        DVec2::new(local.x, local.y) / (-local.z * (vfov_rad / 2.0).tan())
    }

    #[test]
    fn models_fill_the_picture_with_equal_margins_in_all_views() {
        let mut numbers = SplitMix64::new(1);
        let mut random = || numbers.next_unit();
        for (extent, aspect) in
            [([3.0, 1.0, 0.2], 1.0), ([0.3, 5.0, 1.0], 16.0 / 9.0), ([1.0, 1.0, 9.0], 0.5)]
        {
            for view in ["three-quarter", "front", "iso", "top", "-200,-35"] {
                let cloud: Vec<DVec3> = (0..300)
                    .map(|_| {
                        DVec3::new(random() * extent[0], random() * extent[1], 5.0 + random() * extent[2])
                    })
                    .collect();
                let mut loaded = points(&cloud);
                let view = view.parse().expect("a view");
                let options = StageOptions { view, aspect: Some(aspect), ..StageOptions::studio() };
                complete(&mut loaded, &options, false);
                let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
                for p in cloud.iter().map(|p| DVec3::from(p.as_vec3())) {
                    let at = projected(&loaded, p);
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

    /// A wavy sheet of a few hundred triangles within a metre of the centre.
    fn sheet() -> Vec<DVec3> {
        let corner = |i: u32, j: u32| {
            let (x, z) = (f64::from(i) * 0.1 - 0.9, f64::from(j) * 0.1 - 0.9);
            DVec3::new(x, 0.2 * (3.0 * x).sin(), z)
        };
        let cell = |i: u32, j: u32| [corner(i, j), corner(i, j + 1), corner(i + 1, j)];
        (0..18).flat_map(|i| (0..18).flat_map(move |j| cell(i, j))).collect()
    }

    #[test]
    fn outliers_are_not_framed_and_are_named() {
        let names =
            |loaded: &Loaded| loaded.warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
        // Another object, and triangles of the same one.
        let mut apart = points(&sheet());
        let mut crumb = points(&[1e6, 1e6 + 1.0, 1e6 + 2.0].map(|x| DVec3::new(x, 2.0, x * x % 1.0)));
        apart.scene.meshes.append(&mut crumb.scene.meshes);
        let crumb = Instance { mesh: MeshId(1), ..crumb.scene.instances[0].clone() };
        apart.scene.instances.push(Instance { name: "crumb".into(), ..crumb });
        let noise = [40.0, 41.0, 40.0].map(|x| DVec3::new(-x, x, 0.0));
        let mut inside = points(&[sheet(), noise.to_vec()].concat());
        inside.scene.instances[0].name = "scan".into();
        for (mut loaded, name) in
            [(apart, "'crumb', about 1000000 m away"), (inside, "parts of 'scan', about")]
        {
            complete(&mut loaded, &StageOptions::studio(), false);
            assert!(names(&loaded).contains(name), "{}", names(&loaded));
            let max =
                sheet().iter().fold(0.0, |max: f64, &p| max.max(projected(&loaded, p).abs().max_element()));
            assert!((0.5..2.0).contains(&max), "{max}");
            assert!(scene_center(&loaded).length() < 0.3);
        }
        // No outliers: nearer objects, a large ground, and the second of two equal objects.
        let near = [10.0, 11.0, 10.0].map(|x| DVec3::new(-x, x, 0.0));
        let ground = [[-1e4, 0.0, -1e4], [1e4, 0.0, -1e4], [0.0, 0.0, 1e4]].map(DVec3::from);
        let distant = sheet().iter().map(|&p| p + DVec3::X * 1e4).collect();
        for more in [near.to_vec(), ground.to_vec(), distant] {
            let mut loaded = points(&[sheet(), more.clone()].concat());
            complete(&mut loaded, &StageOptions::studio(), false);
            assert_eq!(names(&loaded), "");
            more.iter().for_each(|&p| assert!(projected(&loaded, p).abs().max_element() < 2.0));
        }
    }

    #[test]
    fn dry_runs_report_additions_and_add_only_cameras() {
        let mut loaded = sphere_scene(DVec3::ZERO, 1.0, grey());
        loaded.default_materials.push(MaterialId(0));
        complete(&mut loaded, &StageOptions { is_dry_run: true, ..StageOptions::studio() }, false);
        let scene = &loaded.scene;
        assert!(loaded.notes[0].code == "stage", "{:?}", loaded.notes);
        assert_eq!((scene.shapes.len(), scene.images.len(), scene.cameras.len()), (1, 0, 1));
        assert_eq!((scene.textures.len(), scene.materials.len()), (0, 1));
        assert_eq!((&scene.environment, &scene.materials[0]), (&Environment::Black, &grey()));
        assert!(scene.backdrop.is_none());
        assert!(scene.environment_visible_to.contains(RayKinds::CAMERA));
    }

    #[test]
    fn models_stay_in_view_of_orbiting_cameras() {
        let corners = [[-1.0, 0.0, -2.0], [1.0, 0.0, 2.0], [0.9, 1.0, -2.0]].map(DVec3::from);
        let mut loaded = points(&corners);
        let options = StageOptions { is_orbit: true, aspect: Some(1.0), ..StageOptions::studio() };
        complete(&mut loaded, &options, false);
        let table = loaded.turntable.expect("a turntable");
        let first = loaded.scene.cameras[0].clone();
        let mut max = 0.0f64;
        for step in 0..36 {
            loaded.scene.cameras[0] = table.camera(&first, f64::from(step) * 0.1745);
            corners.iter().for_each(|&p| max = max.max(projected(&loaded, p).abs().max_element()));
        }
        assert!(max < 0.83 && max > 0.7, "{max}");
    }

    #[test]
    fn emissive_surfaces_light_scenes_but_not_bare_models() {
        let emissive = || sphere_scene(DVec3::ZERO, 1.0, Material::emitter("lamp", [1.0; 3], false));
        let mut bare = emissive();
        complete(&mut bare, &default_options(), false);
        assert!(matches!(bare.scene.environment, Environment::Gradient { .. }));
        let codes: Vec<&str> = bare.warnings.iter().map(|w| w.code).collect();
        assert_eq!(codes, ["default-sky"]);
        let mut scene = emissive();
        scene.scene.cameras = bare.scene.cameras.clone();
        complete(&mut scene, &StageOptions::studio(), false);
        assert_eq!((&scene.scene.environment, scene.warnings.len()), (&Environment::Black, 0));
        let mut without = emissive();
        complete(&mut without, &default_options(), true);
        assert_eq!((&without.scene.environment, without.warnings.len()), (&Environment::Black, 0));
        assert_eq!(without.notes.len(), 1);
    }

    /// A scene of about 4 m with a camera and an emissive sphere of this radius, metres.
    fn glowing_sphere(radius: f64, radiance: f32) -> Loaded {
        let mut loaded = sphere_scene(DVec3::ZERO, radius, Material::emitter("led", [radiance; 3], false));
        loaded.scene.materials.push(grey());
        loaded.scene.shapes.push(Shape::sphere(DVec3::new(0.0, -2.0, 0.0), 2.0, MaterialId(1)));
        loaded.scene.cameras.push(crate::scene::Camera::look_at([0.0, 0.0, 5.0], [0.0; 3], 40.0));
        loaded.is_model = true;
        loaded
    }

    #[test]
    fn models_with_cameras_are_lit_unless_emissive_surfaces_light_them() {
        let outcome = |mut loaded: Loaded| {
            complete(&mut loaded, &StageOptions::studio(), false);
            let codes: Vec<&str> = loaded.warnings.iter().map(|w| w.code).collect();
            (loaded.scene.environment != Environment::Black, codes.join(" "))
        };
        assert_eq!(outcome(glowing_sphere(0.05, 1.0)), (true, "default-sky".to_string()));
        assert_eq!(outcome(glowing_sphere(0.05, 9.0)), (false, "little-light".to_string()));
        // Emitters that light the scene, large or strong.
        assert_eq!(outcome(glowing_sphere(0.7, 1.0)), (false, String::new()));
        assert_eq!(outcome(glowing_sphere(0.05, 300.0)), (false, String::new()));
        // Emitters in scene files are intended.
        assert_eq!(outcome(Loaded { is_model: false, ..glowing_sphere(0.05, 1.0) }), (false, String::new()));
    }

    #[test]
    fn emission_textures_count_with_their_mean() {
        for (value, expected) in [(0.0, EmittedLight::Glow), (1.0, EmittedLight::Light)] {
            let mut loaded = glowing_sphere(0.7, 1.0);
            let rgb = vec![value; 3 * 600 * 4];
            let image = loaded.scene.add_image(crate::image::Image::from_linear_rgb("glow", 600, 4, rgb));
            let texture = loaded.scene.add_texture(crate::scene::Texture::Image {
                image,
                wrap_u: Default::default(),
                wrap_v: Default::default(),
                interpolation: Default::default(),
                mapping: Default::default(),
            });
            loaded.scene.materials[0].emission.as_mut().unwrap().radiance.texture = Some(texture);
            assert_eq!(light::classify_emission(&loaded.scene), expected);
        }
    }

    #[test]
    fn a_chosen_light_is_added_to_scenes_with_a_camera() {
        let chosen = StageOptions { is_light_chosen: true, ..StageOptions::studio() };
        let lit = |mut loaded: Loaded, overrides_environment: bool| {
            complete(&mut loaded, &chosen, overrides_environment);
            let codes = loaded.notes.iter().chain(&loaded.warnings).map(|w| w.code).collect::<Vec<_>>();
            (matches!(loaded.scene.environment, Environment::Image { .. }), codes.join(" "))
        };
        for radius in [0.05, 0.7] {
            assert_eq!(lit(glowing_sphere(radius, 1.0), false), (true, "stage-light".to_string()));
        }
        let mut sunny = glowing_sphere(0.05, 1.0);
        sunny.scene.environment = Environment::Constant([1.0; 3]);
        assert_eq!(lit(sunny, false), (true, "stage-light".to_string()));
        assert_eq!(lit(glowing_sphere(0.05, 1.0), true), (false, "unused-option".to_string()));
    }

    #[test]
    fn only_bare_models_get_the_whole_studio() {
        let mut bare = sphere_scene(DVec3::ZERO, 1.0, grey());
        complete(&mut bare, &StageOptions::studio(), false);
        assert!(matches!(bare.scene.environment, Environment::Image { .. }));
        assert_eq!(bare.scene.shapes.len(), 2, "the ball and the ground");
        assert!(
            !bare.scene.environment_visible_to.contains(RayKinds::CAMERA) && bare.scene.backdrop.is_some()
        );
        assert_eq!((bare.warnings.len(), bare.notes.len()), (0, 1), "{:?}", bare.notes);
        assert!(bare.scene.validate().is_empty());
        // A scene with a camera but no light gets only light.
        let mut scene = sphere_scene(DVec3::ZERO, 1.0, grey());
        scene.scene.cameras = bare.scene.cameras.clone();
        complete(&mut scene, &StageOptions::studio(), false);
        assert!(matches!(scene.scene.environment, Environment::Gradient { .. }));
        assert_eq!((scene.scene.shapes.len(), scene.warnings.len()), (1, 1));
        // A scene with light gets only a camera.
        let mut lit = sphere_scene(DVec3::ZERO, 1.0, grey());
        lit.scene.environment = Environment::Constant([1.0; 3]);
        complete(&mut lit, &StageOptions::studio(), false);
        assert_eq!(lit.scene.environment, Environment::Constant([1.0; 3]));
        assert_eq!((lit.scene.shapes.len(), lit.scene.cameras.len()), (1, 1));
        assert!(lit.scene.environment_visible_to.contains(RayKinds::CAMERA) && lit.scene.backdrop.is_none());
    }

    /// Grounds are shadow catchers for backgrounds that no ground can match; floors, and grounds in an environment, fade out.
    #[test]
    fn grounds_blend_into_any_background() {
        let picture = crate::image::Image::from_linear_rgb("sky", 1, 1, vec![0.2; 3]);
        let none = StageOptions::studio;
        let with_background = |background| StageOptions { background: Some(background), ..none() };
        let with_ground = |ground, options| StageOptions { ground: Some(ground), ..options };
        for (options, is_lit, is_catcher, is_fading) in [
            (none(), false, false, false),
            (with_background(Background::Color([0.5, 0.01, 0.01])), false, false, false),
            (with_background(Background::Color([0.9; 3])), false, false, false),
            (with_background(Background::Color([1.5; 3])), false, true, false),
            (StageOptions { light: StageLight::White, ..none() }, false, true, false),
            (with_background(Background::Transparent), false, true, false),
            (with_background(Background::Picture(picture)), false, true, false),
            (with_ground(Ground::Floor, none()), false, false, true),
            (with_ground(Ground::Shadow, none()), true, false, true),
            (with_ground(Ground::Shadow, with_background(Background::Transparent)), true, true, false),
        ] {
            let mut loaded = sphere_scene(DVec3::ZERO, 1.0, grey());
            complete(&mut loaded, &options, is_lit);
            let ground = loaded.scene.shapes.last().expect("a ground");
            let material = &loaded.scene.materials[ground.material.index()];
            assert_eq!(ground.traits.is_shadow_catcher, is_catcher, "{options:?}");
            assert_eq!(material.alpha.texture.is_some(), is_fading, "{options:?}");
            assert!(loaded.scene.validate().is_empty());
        }
    }

    #[test]
    fn files_without_materials_get_clay() {
        let mut loaded = sphere_scene(DVec3::ZERO, 1.0, grey());
        loaded.default_materials.push(MaterialId(0));
        complete(&mut loaded, &StageOptions::studio(), false);
        assert!(loaded.scene.materials[0].model.pbr().is_some());
        let mut own = sphere_scene(DVec3::ZERO, 1.0, grey());
        complete(&mut own, &StageOptions::studio(), false);
        assert_eq!(own.scene.materials[0], grey());
    }

    #[test]
    fn a_caller_with_an_environment_gets_no_other_light() {
        for options in [default_options(), StageOptions::studio()] {
            let mut loaded = sphere_scene(DVec3::ZERO, 1.0, grey());
            complete(&mut loaded, &options, true);
            assert_eq!(loaded.scene.environment, Environment::Black);
            assert_eq!((loaded.warnings.len(), loaded.notes.len()), (0, 1), "{:?}", loaded.warnings);
        }
    }

    #[test]
    fn an_empty_scene_gets_a_finite_camera() {
        for options in [default_options(), StageOptions::studio()] {
            let mut loaded = Loaded::default();
            complete(&mut loaded, &options, false);
            assert!(loaded.scene.cameras[0].world_from_camera.is_finite());
            assert!(loaded.scene.validate().is_empty());
        }
    }
}
