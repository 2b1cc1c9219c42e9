//! Additions to bare models: a camera that sees all of them, light, a ground that takes their shadow, a material. What a file
//! contains stays as it is: a scene with a camera is a scene, and only gets light where it has none at all.

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

/// Radiance of the soft sky straight down and straight up. The mean over the sphere of a blend linear in y is that
/// of the two: (0.560, 0.6, 0.640), a luminance of 0.59. It is dark below, so that pale models stand out from what is
/// behind them when they are seen from above, and have a lit and a shaded side. Faces that look straight up reflect
/// (0.6 + 0.54 * 2 / 3) = 0.96 times their albedo: white ones are not burnt out in a PNG.
const SOFT_SKY: ([f32; 3], [f32; 3]) = ([0.064, 0.06, 0.056], [1.056, 1.14, 1.224]);

/// Completes a scene, with notes: a camera that frames the model, unless there is one; light, unless anything
/// lights it or the caller has an environment; ground and material by [`StageOptions`], where there is no camera either.
/// Emissive parts light a scene with a camera, unless it is a model ([`Loaded::is_model`]) whose parts only glow; a model
/// without a camera is to be looked at, and is lit, too. Light that the caller chose takes the place of an environment.
pub fn complete(loaded: &mut Loaded, options: &StageOptions, brings_environment: bool) {
    if options.is_dry_run {
        return foretell(loaded, options, brings_environment);
    }
    let scene = &loaded.scene;
    let has_bodies = !(scene.instances.is_empty() && scene.shapes.is_empty() && scene.quads.is_empty());
    if !has_bodies && scene.curves.is_empty() {
        let message = "there is nothing to see: no triangles, quads or other shapes";
        loaded.warnings.push(Warning::general(message));
    }
    let is_bare = scene.cameras.is_empty();
    // A black environment that a scene file asks for is a choice, and stays.
    let has_lamps =
        scene.environment != Environment::Black || !scene.lights.is_empty() || loaded.has_area_lights;
    let is_chosen = options.is_light_chosen && options.light.is_stage();
    let is_lit = brings_environment || has_lamps && !is_chosen;
    if is_bare {
        set_up(loaded, options, is_lit);
    } else {
        let emitted_light = light::of(&loaded.scene);
        let is_dark = !is_lit && (is_chosen || lacks_light(loaded, emitted_light));
        if is_dark {
            light_scene(loaded, options, emitted_light);
        }
        warn_of_unused(loaded, options, brings_environment);
    }
    background(loaded, options);
}

/// Reports additions, but adds only cameras.
fn foretell(loaded: &mut Loaded, options: &StageOptions, brings_environment: bool) {
    let scene = &loaded.scene;
    let (materials, stand_ins) = (scene.materials.clone(), loaded.stand_ins.clone());
    let (images, textures, shapes) = (scene.images.len(), scene.textures.len(), scene.shapes.len());
    let environment = (scene.environment.clone(), scene.environment_visible_to);
    let backdrop = scene.backdrop.clone();
    complete(loaded, &StageOptions { is_dry_run: false, ..options.clone() }, brings_environment);
    let scene = &mut loaded.scene;
    (scene.environment, scene.environment_visible_to) = environment;
    (scene.backdrop, scene.materials, loaded.stand_ins) = (backdrop, materials, stand_ins);
    scene.images.truncate(images);
    scene.textures.truncate(textures);
    scene.shapes.truncate(shapes);
    loaded.is_stage_lit = false;
}

/// The middle of a scene: what a camera that loading added goes around, else that of the box around everything but what
/// lies far away from all else.
pub fn middle(loaded: &Loaded) -> DVec3 {
    match loaded.turntable {
        Some(table) => table.middle(),
        None => Outline::of(&loaded.scene, loaded.offset).center() + loaded.offset,
    }
}

/// Does a scene with a camera but without lights need light? Warns where there is little.
fn lacks_light(loaded: &mut Loaded, emitted_light: EmittedLight) -> bool {
    if emitted_light == EmittedLight::Dim && loaded.is_model {
        let message = format!(
            "no light but emissive parts of little power: the picture will be dark ({} adds light)",
            Choice::Stage
        );
        loaded.warnings.push(Warning::general(("little-light", message)));
    }
    emitted_light == EmittedLight::None || emitted_light == EmittedLight::Glow && loaded.is_model
}

/// The whole stage around a model without a camera.
fn set_up(loaded: &mut Loaded, options: &StageOptions, is_lit: bool) {
    let outline = Outline::of(&loaded.scene, loaded.offset);
    if let Some(stray) = &outline.stray {
        let message = format!("{stray}, would make all else a dot: the camera frames the rest");
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
        apply(loaded);
    }
    if is_lit || !options.light.is_stage() {
        let message = format!("no camera: shown from {} ({} decides)", options.view, Choice::ViewFrom);
        loaded.notes.push(Warning::general(message));
        if !is_lit {
            light_plainly(loaded, options);
        }
    } else {
        let ground = options.ground_for(is_lit);
        let lights = lights_in_words(&loaded.scene);
        loaded.scene.environment = light::environment(&mut loaded.scene, options);
        let message = format!(
            "no camera{}: shown from {}, {}{lights}{} ({}, {} and {} change that)",
            if lights.is_empty() { " and no light" } else { "" },
            options.view,
            options.light,
            ground.in_words(),
            Choice::ViewFrom,
            Choice::Stage,
            Choice::Ground
        );
        loaded.notes.push(Warning::general(("stage", message)));
    }
    ground::add(loaded, options, &outline, is_lit);
}

/// The light of a model without a stage: the soft sky, or none at all.
fn light_plainly(loaded: &mut Loaded, options: &StageOptions) {
    if options.light == StageLight::Soft {
        soften(loaded);
    } else if lights_in_words(&loaded.scene).is_empty() && light::of(&loaded.scene) == EmittedLight::None {
        let message = (
            "no-light",
            format!("no light at all: the picture will be black ({} adds light)", Choice::Stage),
        );
        loaded.warnings.push(Warning::general(message));
    }
}

/// Light alone, for a scene that has a camera.
fn light_scene(loaded: &mut Loaded, options: &StageOptions, emitted_light: EmittedLight) {
    if options.is_light_chosen && options.light.is_stage() {
        let message = match (lights_in_words(&loaded.scene), emitted_light) {
            ("", EmittedLight::None) => format!("no light: {}", options.light),
            ("", _) => format!("no light but emissive parts: {}, too", options.light),
            (lights, _) => format!("{}{lights}", options.light),
        };
        loaded.scene.environment = light::environment(&mut loaded.scene, options);
        loaded.is_stage_lit = true;
        loaded.notes.push(Warning::general(("stage-light", message)));
    } else if options.light != StageLight::None {
        soften(loaded);
    }
}

/// The treatment of a scene's emissive surfaces under a stage's light.
fn lights_in_words(scene: &Scene) -> &'static str {
    match (scene.environment == Environment::Black, scene.lights.is_empty()) {
        (true, true) => "",
        (true, false) => ", beside the lights of the file",
        (false, true) => ", in place of the environment of the file",
        (false, false) => ", in place of the environment of the file and beside its lights",
    }
}

/// The soft sky, with a warning.
fn soften(loaded: &mut Loaded) {
    let scene = &mut loaded.scene;
    let message = match light::of(scene) {
        EmittedLight::None => "no light: lit by a soft default sky of mean radiance 0.6".to_string(),
        _ => format!(
            "no light but emissive parts: lit by a soft default sky of mean radiance 0.6, too ({} for none)",
            Choice::Environment
        ),
    };
    let (nadir, zenith) = SOFT_SKY;
    scene.environment = Environment::Gradient { nadir, zenith };
    loaded.warnings.push(Warning::general(("default-sky", message)));
}

/// Warns of stage options without effect, as the scene or the caller overrides them.
fn warn_of_unused(loaded: &mut Loaded, options: &StageOptions, brings_environment: bool) {
    let mut say = |is_unused: bool, what: Choice, why: &str| {
        if is_unused {
            loaded.warnings.push(Warning::general(("unused-option", format!("{what} has no effect: {why}"))));
        }
    };
    let own_camera = "the scene has a camera of its own";
    say(options.is_light_chosen && brings_environment, Choice::Stage, "another environment is asked for");
    say(options.is_view_chosen, Choice::ViewFrom, own_camera);
    say(options.ground.is_some_and(|g| g != Ground::None), Choice::Ground, own_camera);
    say(options.zoom != 1.0, Choice::Zoom, own_camera);
}

/// The background.
fn background(loaded: &mut Loaded, options: &StageOptions) {
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

/// Linear reflectance of clay: dark enough for light to model it, a little warm.
const COLOR: [f32; 3] = [0.60, 0.57, 0.53];
/// Perceptual roughness: a slight gloss.
const ROUGHNESS: f32 = 0.5;

/// Assigns a clay material to faces without one; vertex colours and textures replace its colour.
fn apply(loaded: &mut Loaded) {
    for id in std::mem::take(&mut loaded.stand_ins) {
        let Some(material) = loaded.scene.materials.get_mut(id.index()) else { continue };
        let base_color = match &material.model {
            Model::Lambert { albedo } if albedo.texture.is_some() || material.use_vertex_colors => *albedo,
            Model::Pbr(_) if material.use_vertex_colors => ColorSlot::constant([1.0; 3]),
            Model::Lambert { .. } | Model::Pbr(_) => ColorSlot::constant(COLOR),
            // Something has changed it since.
            _ => continue,
        };
        let clay = PbrMaterial {
            base_color,
            metallic: FloatSlot::constant(0.0),
            roughness: FloatSlot::constant(ROUGHNESS),
            ..PbrMaterial::default()
        };
        *material = Material { model: Model::Pbr(Box::new(clay)), ..material.clone() };
    }
}

#[cfg(test)]
mod tests {
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

    /// Image coordinates of a point: -1 to 1 over the height, times the aspect ratio horizontally.
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

    /// A wavy sheet of some hundred triangles within a metre of the middle.
    fn sheet() -> Vec<DVec3> {
        let corner = |i: u32, j: u32| {
            let (x, z) = (f64::from(i) * 0.1 - 0.9, f64::from(j) * 0.1 - 0.9);
            DVec3::new(x, 0.2 * (3.0 * x).sin(), z)
        };
        let cell = |i: u32, j: u32| [corner(i, j), corner(i, j + 1), corner(i + 1, j)];
        (0..18).flat_map(|i| (0..18).flat_map(move |j| cell(i, j))).collect()
    }

    #[test]
    fn what_lies_far_from_all_else_is_not_framed_and_is_named() {
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
        for (mut loaded, name) in [(apart, "'crumb', some 1000000 m away"), (inside, "parts of 'scan', some")]
        {
            complete(&mut loaded, &StageOptions::studio(), false);
            assert!(names(&loaded).contains(name), "{}", names(&loaded));
            let most =
                sheet().iter().fold(0.0, |most: f64, &p| most.max(seen(&loaded, p).abs().max_element()));
            assert!((0.5..2.0).contains(&most), "{most}");
            assert!(middle(&loaded).length() < 0.3);
        }
        // Nearer, it belongs to the picture; so does a ground that reaches far; and of two nobody knows which is stray.
        let near = [10.0, 11.0, 10.0].map(|x| DVec3::new(-x, x, 0.0));
        let ground = [[-1e4, 0.0, -1e4], [1e4, 0.0, -1e4], [0.0, 0.0, 1e4]].map(DVec3::from);
        let twin = sheet().iter().map(|&p| p + DVec3::X * 1e4).collect();
        for more in [near.to_vec(), ground.to_vec(), twin] {
            let mut loaded = points(&[sheet(), more.clone()].concat());
            complete(&mut loaded, &StageOptions::studio(), false);
            assert_eq!(names(&loaded), "");
            more.iter().for_each(|&p| assert!(seen(&loaded, p).abs().max_element() < 2.0));
        }
    }

    #[test]
    fn what_would_be_added_is_reported_and_left_out() {
        let mut loaded = ball(DVec3::ZERO, 1.0, grey());
        loaded.stand_ins.push(MaterialId(0));
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
    fn emissive_parts_light_scenes_but_not_bare_models() {
        let emissive = || ball(DVec3::ZERO, 1.0, Material::emitter("lamp", [1.0; 3], false));
        let mut bare = emissive();
        complete(&mut bare, &soft(), false);
        assert!(matches!(bare.scene.environment, Environment::Gradient { .. }));
        let codes: Vec<&str> = bare.warnings.iter().map(|w| w.code).collect();
        assert_eq!(codes, ["default-sky"]);
        let mut scene = emissive();
        scene.scene.cameras = bare.scene.cameras.clone();
        complete(&mut scene, &StageOptions::studio(), false);
        assert_eq!((&scene.scene.environment, scene.warnings.len()), (&Environment::Black, 0));
        let mut without = emissive();
        complete(&mut without, &soft(), true);
        assert_eq!((&without.scene.environment, without.warnings.len()), (&Environment::Black, 0));
        assert_eq!(without.notes.len(), 1);
    }

    /// A room of 4 m with a camera and a ball of this radius that emits light.
    fn glowing(radius: f64, radiance: f32) -> Loaded {
        let mut loaded = ball(DVec3::ZERO, radius, Material::emitter("led", [radiance; 3], false));
        loaded.scene.materials.push(grey());
        loaded.scene.shapes.push(Shape::sphere(DVec3::new(0.0, -2.0, 0.0), 2.0, MaterialId(1)));
        loaded.scene.cameras.push(crate::scene::Camera::look_at([0.0, 0.0, 5.0], [0.0; 3], 40.0));
        loaded.is_model = true;
        loaded
    }

    #[test]
    fn models_with_cameras_are_lit_unless_parts_of_them_are_lamps() {
        let outcome = |mut loaded: Loaded| {
            complete(&mut loaded, &StageOptions::studio(), false);
            let codes: Vec<&str> = loaded.warnings.iter().map(|w| w.code).collect();
            (loaded.scene.environment != Environment::Black, codes.join(" "))
        };
        assert_eq!(outcome(glowing(0.05, 1.0)), (true, "default-sky".to_string()));
        assert_eq!(outcome(glowing(0.05, 9.0)), (false, "little-light".to_string()));
        // A lamp that lights the room, whether it is large or strong.
        assert_eq!(outcome(glowing(0.7, 1.0)), (false, String::new()));
        assert_eq!(outcome(glowing(0.05, 300.0)), (false, String::new()));
        // Emitters in scene files are intended.
        assert_eq!(outcome(Loaded { is_model: false, ..glowing(0.05, 1.0) }), (false, String::new()));
    }

    #[test]
    fn the_mean_of_a_picture_tells_how_brightly_a_part_shines() {
        for (value, expected) in [(0.0, EmittedLight::Glow), (1.0, EmittedLight::Light)] {
            let mut loaded = glowing(0.7, 1.0);
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
            assert_eq!(light::of(&loaded.scene), expected);
        }
    }

    #[test]
    fn a_chosen_light_reaches_scenes_with_a_camera() {
        let chosen = StageOptions { is_light_chosen: true, ..StageOptions::studio() };
        let lit = |mut loaded: Loaded, brings: bool| {
            complete(&mut loaded, &chosen, brings);
            let codes = loaded.notes.iter().chain(&loaded.warnings).map(|w| w.code).collect::<Vec<_>>();
            (matches!(loaded.scene.environment, Environment::Image { .. }), codes.join(" "))
        };
        for radius in [0.05, 0.7] {
            assert_eq!(lit(glowing(radius, 1.0), false), (true, "stage-light".to_string()));
        }
        let mut sunny = glowing(0.05, 1.0);
        sunny.scene.environment = Environment::Constant([1.0; 3]);
        assert_eq!(lit(sunny, false), (true, "stage-light".to_string()));
        assert_eq!(lit(glowing(0.05, 1.0), true), (false, "unused-option".to_string()));
    }

    #[test]
    fn the_studio_is_for_bare_models_alone() {
        let mut bare = ball(DVec3::ZERO, 1.0, grey());
        complete(&mut bare, &StageOptions::studio(), false);
        assert!(matches!(bare.scene.environment, Environment::Image { .. }));
        assert_eq!(bare.scene.shapes.len(), 2, "the ball and the ground");
        assert!(
            !bare.scene.environment_visible_to.contains(RayKinds::CAMERA) && bare.scene.backdrop.is_some()
        );
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

    /// Behind what no ground can look like it catches shadows; floors and grounds before an environment fade.
    #[test]
    fn grounds_melt_into_whatever_is_behind_them() {
        let picture = crate::image::Image::from_linear_rgb("sky", 1, 1, vec![0.2; 3]);
        let none = StageOptions::studio;
        let before = |background| StageOptions { background: Some(background), ..none() };
        let on = |ground, options| StageOptions { ground: Some(ground), ..options };
        for (options, is_lit, is_catcher, is_fading) in [
            (none(), false, false, false),
            (before(Background::Color([0.5, 0.01, 0.01])), false, false, false),
            (before(Background::Color([0.9; 3])), false, false, false),
            (before(Background::Color([1.5; 3])), false, true, false),
            (StageOptions { light: StageLight::White, ..none() }, false, true, false),
            (before(Background::Transparent), false, true, false),
            (before(Background::Picture(picture)), false, true, false),
            (on(Ground::Floor, none()), false, false, true),
            (on(Ground::Shadow, none()), true, false, true),
            (on(Ground::Shadow, before(Background::Transparent)), true, true, false),
        ] {
            let mut loaded = ball(DVec3::ZERO, 1.0, grey());
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
            assert_eq!((loaded.warnings.len(), loaded.notes.len()), (0, 1), "{:?}", loaded.warnings);
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
}
