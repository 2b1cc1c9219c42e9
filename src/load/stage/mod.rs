//! What bare models lack: a camera that sees all of them, light, a ground that takes their shadow, a material. What a file
//! brings stays as it is: a scene with a camera is a scene, and only gets light where it has none at all.

mod clay;
mod direction;
mod ground;
mod light;
mod options;
mod orbit;
mod outline;
mod shine;
mod stray;
mod view;

pub use direction::ViewFrom;
pub use options::{Background, Ground, StageLight, StageOptions};
pub use orbit::Turntable;

use super::Loaded;
use crate::error::{Choice, Warning};
use crate::math::DVec3;
use crate::scene::{Backdrop, Environment, Scene};
use outline::Outline;
use shine::Shine;

/// Radiance of the soft sky straight down and straight up. The mean over the sphere of a blend linear in y is that
/// of the two: (0.560, 0.6, 0.640), a luminance of 0.59. It is dark below, so that pale models stand out from what is
/// behind them when they are seen from above, and have a lit and a shaded side. Faces that look straight up reflect
/// (0.6 + 0.54 * 2 / 3) = 0.96 times their albedo: white ones are not burnt out in a PNG.
const SOFT_SKY: ([f32; 3], [f32; 3]) = ([0.064, 0.06, 0.056], [1.056, 1.14, 1.224]);

/// Adds what a scene lacks, and says so: a camera that frames the model, unless there is one; light, unless anything
/// lights it or the caller brings an environment; ground and material by [`StageOptions`], where there is no camera either.
/// Parts that shine light a scene with a camera, unless it is a model ([`Loaded::is_model`]) whose parts only glow; a model
/// without a camera is to be looked at, and is lit, too. Light that the caller chose takes the place of an environment.
pub fn complete(loaded: &mut Loaded, options: &StageOptions, brings_environment: bool) {
    if options.is_foretold {
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
        let shine = shine::of(&loaded.scene);
        let is_dark = !is_lit && (is_chosen || lacks_light(loaded, shine));
        if is_dark {
            light_scene(loaded, options, shine);
        }
        say_unused(loaded, options, brings_environment);
    }
    background(loaded, options);
}

/// Says what would be added, and adds cameras alone.
fn foretell(loaded: &mut Loaded, options: &StageOptions, brings_environment: bool) {
    let scene = &loaded.scene;
    let (materials, stand_ins) = (scene.materials.clone(), loaded.stand_ins.clone());
    let (images, textures, shapes) = (scene.images.len(), scene.textures.len(), scene.shapes.len());
    let environment = (scene.environment.clone(), scene.environment_visible_to);
    let backdrop = scene.backdrop.clone();
    complete(loaded, &StageOptions { is_foretold: false, ..options.clone() }, brings_environment);
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

/// Does a scene with a camera but without lamps need light? One of little light says so.
fn lacks_light(loaded: &mut Loaded, shine: Shine) -> bool {
    if shine == Shine::Dim && loaded.is_model {
        let message = format!(
            "no light but parts that shine, of little power: the picture will be dark ({} adds light)",
            Choice::Stage
        );
        loaded.warnings.push(Warning::general(message));
    }
    shine == Shine::None || shine == Shine::Glow && loaded.is_model
}

/// The whole stage around a model without a camera.
fn set_up(loaded: &mut Loaded, options: &StageOptions, is_lit: bool) {
    let outline = Outline::of(&loaded.scene, loaded.offset);
    if let Some(stray) = &outline.stray {
        let message = format!("{stray}, would make all else a dot: the camera frames the rest");
        loaded.warnings.push(Warning::general(message));
    }
    let framed = view::frame(&outline, options, &loaded.scene.settings);
    let is_studio = !is_lit && options.light.is_stage();
    loaded.turntable = Some(Turntable::new(loaded.offset + framed.target, is_studio));
    loaded.is_stage_lit = is_studio;
    let mut camera = framed.camera;
    camera.world_from_camera.translation += loaded.offset;
    loaded.scene.cameras.push(camera);
    if options.light.is_stage() {
        clay::apply(loaded);
    }
    if is_lit || !options.light.is_stage() {
        let message = format!("no camera: the whole model is shown from {}", options.view);
        loaded.warnings.push(Warning::general(message));
        if !is_lit {
            light_plainly(loaded, options);
        }
    } else {
        let ground = options.ground_for(is_lit);
        let lamps = lamps_in_words(&loaded.scene);
        loaded.scene.environment = light::environment(&mut loaded.scene, options);
        let message = format!(
            "no camera{}: shown from {}, {}{lamps}{} ({} and the options beside it change that)",
            if lamps.is_empty() { " and no light" } else { "" },
            options.view,
            options.light,
            ground.in_words(),
            Choice::Stage
        );
        loaded.notes.push(Warning::general(message));
    }
    ground::add(loaded, options, &outline, is_lit);
}

/// The light of a model without a stage: the soft sky, or none at all.
fn light_plainly(loaded: &mut Loaded, options: &StageOptions) {
    if options.light == StageLight::Soft {
        soften(loaded);
    } else if lamps_in_words(&loaded.scene).is_empty() && shine::of(&loaded.scene) == Shine::None {
        let message = format!("no light at all: the picture will be black ({} adds light)", Choice::Stage);
        loaded.warnings.push(Warning::general(message));
    }
}

/// Light alone, for a scene that has a camera.
fn light_scene(loaded: &mut Loaded, options: &StageOptions, shine: Shine) {
    if options.is_light_chosen && options.light.is_stage() {
        let message = match (lamps_in_words(&loaded.scene), shine) {
            ("", Shine::None) => format!("no light: {}", options.light),
            ("", _) => format!("no light but parts that shine: {}, too", options.light),
            (lamps, _) => format!("{}{lamps}", options.light),
        };
        loaded.scene.environment = light::environment(&mut loaded.scene, options);
        loaded.is_stage_lit = true;
        loaded.notes.push(Warning::general(message));
    } else if options.light != StageLight::None {
        soften(loaded);
    }
}

/// What becomes of a scene's lamps where a stage lights it.
fn lamps_in_words(scene: &Scene) -> &'static str {
    match (scene.environment == Environment::Black, scene.lights.is_empty()) {
        (true, true) => "",
        (true, false) => ", beside the lamps of the file",
        (false, true) => ", in place of the environment of the file",
        (false, false) => ", in place of the environment of the file and beside its lamps",
    }
}

/// The soft sky, with a warning.
fn soften(loaded: &mut Loaded) {
    let scene = &mut loaded.scene;
    let message = match shine::of(scene) {
        Shine::None => "no light: lit by a soft default sky of mean radiance 0.6".to_string(),
        _ => format!(
            "no light but parts that shine: lit by a soft default sky of mean radiance 0.6, too ({} for none)",
            Choice::Environment
        ),
    };
    let (nadir, zenith) = SOFT_SKY;
    scene.environment = Environment::Gradient { nadir, zenith };
    loaded.warnings.push(Warning::general(message));
}

/// Says which choices about the stage change nothing, since the scene or the caller brings what they are about.
fn say_unused(loaded: &mut Loaded, options: &StageOptions, brings_environment: bool) {
    let mut say = |is_unused: bool, what: Choice, why: &str| {
        if is_unused {
            loaded.warnings.push(Warning::general(format!("{what} changes nothing: {why}")));
        }
    };
    let own_camera = "the scene has a camera of its own";
    say(options.is_light_chosen && brings_environment, Choice::Stage, "another environment is asked for");
    say(options.is_view_chosen, Choice::ViewFrom, own_camera);
    say(options.ground.is_some_and(|g| g != Ground::None), Choice::Ground, own_camera);
    say(options.zoom != 1.0, Choice::Zoom, own_camera);
}

/// What the camera sees behind everything.
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

#[cfg(test)]
mod tests;
