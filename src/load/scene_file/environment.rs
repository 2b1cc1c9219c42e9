//! `[environment]`: what is seen where nothing is hit; black without it. Exactly one of
//!
//! - `background = [r, g, b]`: the same radiance from everywhere,
//! - `sky = { nadir = [r, g, b], zenith = [r, g, b] }`: a vertical blend (default: white below, `[.5, .7, 1]` above),
//! - `image = "file"`: equirectangular, with `rotation` (degrees counter-clockwise seen from above; 0) and `strength` (1).
//!
//! `fog = { density = 0.1 }` fills the space around all solids (see `media`), and may stand alone.
//!
//! A `group` names the group of lights that it is in. With `visible_to_camera = false` it lights the scene, but cameras see nothing of it: the picture is transparent there;
//! `visible_to` lists the kinds of rays that see it, as for objects.

use super::build::Build;
use super::fields::Fields;
use super::light_traits::group;
use super::media;
use super::textures::read_image;
use super::visibility::visible_to;
use crate::load::image::Use;
use crate::scene::{Environment, RayKinds};

pub(super) fn read(build: &mut Build, fields: &Fields) {
    let background = fields.color("background");
    let sky = fields.table("sky");
    let image = fields.string("image");
    let rotation_rad = fields.number("rotation").map_or(0.0, |r| r.value.to_radians());
    let strength = fields.number_in("strength", 0.0..f64::from(f32::MAX), 1.0) as f32;
    build.loaded.scene.environment_visible_to = visible_to(fields, RayKinds::ALL);
    build.loaded.scene.environment_group = group(fields, "group");
    build.loaded.scene.fog = media::fog(fields);
    fields.finish();
    let given = [fields.has("background"), fields.has("sky"), fields.has("image")];
    let count = given.iter().filter(|g| **g).count();
    if count == 0 && fields.has("fog") {
        return;
    }
    if count != 1 {
        let message = "'environment' needs exactly one of 'background', 'sky' and 'image', or 'fog' alone";
        return fields.problems.push(fields.span(), message);
    }
    if !given[2] && (fields.has("rotation") || fields.has("strength")) {
        fields.problems.push(fields.span(), "'rotation' and 'strength' belong to an environment image");
    }
    let environment = &mut build.loaded.scene.environment;
    if let Some(c) = background {
        *environment = Environment::Constant(c.value);
    } else if let Some(sky) = sky {
        let nadir = sky.color("nadir").map_or([1.0; 3], |c| c.value);
        let zenith = sky.color("zenith").map_or([0.5, 0.7, 1.0], |c| c.value);
        sky.finish();
        *environment = Environment::Gradient { nadir, zenith };
    } else if let Some(file) = image
        && let Some(image) = read_image(build, file.value, file.span, Use::Environment)
    {
        build.loaded.scene.environment = Environment::Image { image, strength, rotation_rad };
    }
}
