//! What bare models lack: a camera that sees all of them, light, a ground that takes their shadow, a material. What a file
//! brings stays as it is: a scene with a camera is a scene, and only gets light where it has none at all.

mod clay;
mod direction;
mod ground;
mod light;
mod options;
mod orbit;
mod outline;
mod view;

pub use direction::ViewFrom;
pub use options::{Background, Ground, StageLight, StageOptions};
pub use orbit::Turntable;

use super::Loaded;
use crate::error::{Choice, Warning};
use crate::scene::{Backdrop, Environment, Scene};
use outline::Outline;

/// Radiance of the soft sky straight down and straight up. The mean over the sphere of a blend linear in y is that
/// of the two: (0.560, 0.6, 0.640), a luminance of 0.59. It is dark below, so that pale models stand out from what is
/// behind them when they are seen from above, and have a lit and a shaded side. Faces that look straight up reflect
/// (0.6 + 0.54 * 2 / 3) = 0.96 times their albedo: white ones are not burnt out in a PNG.
const SOFT_SKY: ([f32; 3], [f32; 3]) = ([0.064, 0.06, 0.056], [1.056, 1.14, 1.224]);

/// Adds what a scene lacks, and says so: a camera that frames the model, unless there is one; light, unless anything
/// lights it or the caller brings an environment (parts that shine light a scene with a camera; a model without one is to
/// be looked at, and is lit, too); ground and material by [`StageOptions`], where there is no camera either.
pub fn complete(loaded: &mut Loaded, options: &StageOptions, brings_environment: bool) {
    let scene = &loaded.scene;
    if scene.instances.is_empty() && scene.shapes.is_empty() && scene.quads.is_empty() {
        let message = "there is nothing to see: no triangles, quads or other shapes";
        loaded.warnings.push(Warning::general(message));
    }
    let is_bare = scene.cameras.is_empty();
    // A black environment that a scene file asks for is a choice, and stays.
    let has_lamps = scene.environment != Environment::Black || !scene.lights.is_empty();
    let is_lit = brings_environment || has_lamps;
    if is_bare {
        set_up(loaded, options, is_lit);
    } else {
        let is_lit = is_lit || has_shining_parts(&loaded.scene);
        if !is_lit {
            light_scene(loaded, options);
        }
        say_unused(loaded, options, is_lit);
    }
    background(loaded, options);
}

/// The whole stage around a model without a camera.
fn set_up(loaded: &mut Loaded, options: &StageOptions, is_lit: bool) {
    let outline = Outline::of(&loaded.scene, loaded.offset);
    let framed = view::frame(&outline, options, &loaded.scene.settings);
    let is_studio = !is_lit && options.light.is_stage();
    loaded.turntable = Some(Turntable::new(loaded.offset + framed.target, is_studio));
    let mut camera = framed.camera;
    camera.world_from_camera.translation += loaded.offset;
    loaded.scene.cameras.push(camera);
    if options.light.is_stage() {
        clay::apply(loaded);
    }
    if is_lit || options.light == StageLight::None {
        let message = format!("no camera: the whole model is shown from {}", options.view);
        loaded.warnings.push(Warning::general(message));
    } else if options.light == StageLight::Soft {
        let message = format!("no camera: the whole model is shown from {}", options.view);
        loaded.warnings.push(Warning::general(message));
        soften(loaded, true);
    } else {
        let ground = options.ground_for(is_lit);
        loaded.scene.environment = light::environment(&mut loaded.scene, options);
        let message = format!(
            "no camera and no light: shown from {}, {}{} ({} and the options beside it change that)",
            options.view,
            options.light,
            ground.in_words(),
            Choice::Stage
        );
        loaded.notes.push(Warning::general(message));
    }
    ground::add(loaded, options, &outline, is_lit);
}

/// Light alone, for a scene that has a camera.
fn light_scene(loaded: &mut Loaded, options: &StageOptions) {
    if options.is_light_chosen && options.light.is_stage() {
        loaded.scene.environment = light::environment(&mut loaded.scene, options);
        loaded.notes.push(Warning::general(format!("no light: {}", options.light)));
    } else if options.light != StageLight::None {
        soften(loaded, false);
    }
}

/// The soft sky, with a warning.
fn soften(loaded: &mut Loaded, is_bare: bool) {
    let scene = &mut loaded.scene;
    let message = match has_shining_parts(scene) && is_bare {
        false => "no light: lit by a soft default sky of mean radiance 0.6".to_string(),
        true => format!(
            "no light but parts that shine: lit by a soft default sky of mean radiance 0.6, too ({} for none)",
            Choice::Environment
        ),
    };
    let (nadir, zenith) = SOFT_SKY;
    scene.environment = Environment::Gradient { nadir, zenith };
    loaded.warnings.push(Warning::general(message));
}

/// Says which choices about the stage change nothing, since the scene brings what they are about.
fn say_unused(loaded: &mut Loaded, options: &StageOptions, is_lit: bool) {
    let mut say = |is_unused: bool, what: Choice, why: &str| {
        if is_unused {
            loaded.warnings.push(Warning::general(format!("{what} changes nothing: the scene has {why}")));
        }
    };
    say(options.is_light_chosen && is_lit, Choice::Stage, "light of its own");
    say(options.is_view_chosen, Choice::ViewFrom, "a camera of its own");
    say(options.ground.is_some_and(|g| g != Ground::None), Choice::Ground, "a camera of its own");
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

/// Does any part of the scene shine? Materials count only where something uses them.
fn has_shining_parts(scene: &Scene) -> bool {
    let shines = |id: crate::scene::MaterialId| {
        scene
            .materials
            .get(id.index())
            .and_then(|m| m.emission)
            .is_some_and(|e| e.radiance.factor != [0.0; 3])
    };
    scene.shapes.iter().any(|s| shines(s.material))
        || scene.quads.iter().any(|q| shines(q.material))
        || scene.instances.iter().any(|i| match i.material {
            Some(material) => shines(material),
            None => {
                scene.meshes.get(i.mesh.index()).is_some_and(|m| m.parts.iter().any(|p| shines(p.material)))
            }
        })
}

#[cfg(test)]
mod tests;
