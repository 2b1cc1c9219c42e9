//! `[environment]`: what is seen where nothing is hit; black without it. Exactly one of
//!
//! - `background = [r, g, b]`: the same radiance from everywhere,
//! - `sky = { nadir = [r, g, b], zenith = [r, g, b] }`: a vertical blend (default: white below, `[.5, .7, 1]` above),
//! - `sky = { sun_elevation = 30 }`: a clear sky with its sun (Hosek, Wilkie 2012), see below,
//! - `image = "file"`: equirectangular, with `rotation` (degrees counter-clockwise seen from above; 0) and `strength` (1).
//!
//! The clear sky is given by `sun_elevation` (degrees above the horizon, 0 to 90) and, optionally, `sun_azimuth` (degrees clockwise
//! seen from above, from -z towards x; 0), `turbidity` (1 is the clearest air, 3 a clear day, 10 haze; 3), `ground_albedo` (a colour from 0 to
//! 1, also what is seen below the horizon; 0.2), `sun` (`false` leaves the disk out, not its glow), `sun_size` (its diameter in degrees; 0.5358;
//! larger ones soften shadows and bring as much light) and `strength` (1: W/sr/m2, 683 cd/m2 each). At strength 1 a white wall in
//! the sun has a radiance of some 50: `exposure = -5` in `[render]` suits it. The sun is a light of its own, which cameras and
//! mirrors see.
//!
//! `fog = { density = 0.1 }` fills the space around all solids (see `media`), and may stand alone.
//!
//! `seen = { background = [r, g, b] }` is what cameras see in place of it, which lights nothing: an even radiance, or an `image` with `rotation` and
//! `strength` as above.
//!
//! A `group` names the group of lights that it is in. With `visible_to_camera = false` it lights the scene, but cameras see nothing of it: the picture is transparent there;
//! `visible_to` lists the kinds of rays that see it, as for objects. With `sampled = false` only paths that leave the scene find its light,
//! as in Cycles that of an even world: what objects hide of it from others is what those see that are scattered there, not what
//! shadow rays see.
//!
//! # portals
//!
//! `[[portals]]`: windows and other rectangles through which light of the environment is looked for from within a room. They are no
//! surfaces and change no light, only the noise of it: what comes through no portal is still found, with more noise. A picture
//! around the scene that is seen through a window is where they help most.
//!
//! | Key | Value |
//! |---|---|
//! | `name` | for reports |
//! | `center`, `target` or `direction`, `up`, `size` | where the middle is, the way light comes in, and width and height, as of an area light |
//! | `corner`, `u`, `v` | or a corner and the edges from there, at right angles; light comes in along u x v |
//!
//! Beside a model, `node = "NAME"` and `size` place one at an empty node, where light comes in along the node's -z: as Blender's area lights
//! that are portals. In glTF itself, `portal` in the `extras` of a node is its size, `[width, height]`, or true for 1 x 1.

use super::builder::SceneFileBuilder;
use super::fields::Fields;
use super::media;
use super::textures::read_pixels;
use super::traits::{group, visible_to};
use super::transform::{MovingPlacement, Placement, at_node, placed};
use crate::load::image::Use;
use crate::load::sky::{PhysicalSky, SUN_ANGLE_RAD};
use crate::math::DVec3;
use crate::scene::{Environment, Portal, RayKinds};

pub(super) fn read(build: &mut SceneFileBuilder, fields: &Fields) {
    let sky = fields.table("sky");
    let given = [fields.has("background"), fields.has("sky"), fields.has("image")];
    let light = even_or_image(build, fields);
    if let Some(seen) = fields.table("seen") {
        build.loaded.scene.camera_environment = seen_by_camera(build, &seen);
    }
    build.loaded.scene.environment_visible_to = visible_to(fields, RayKinds::ALL);
    build.loaded.scene.environment_unsampled = !fields.flag("sampled", true);
    build.loaded.scene.environment_group = group(fields, "group");
    build.loaded.scene.fog = media::fog(fields);
    fields.finish();
    let count = given.iter().filter(|g| **g).count();
    if count == 0 && fields.has("fog") {
        return;
    }
    if count != 1 {
        let message = "'environment' needs exactly one of 'background', 'sky' and 'image', or 'fog' alone";
        return fields.problems.push(fields.span(), message);
    }
    if let Some(light) = light {
        build.loaded.scene.environment = light;
    } else if let Some(sky) = sky {
        let is_physical = PHYSICAL.into_iter().any(|key| sky.has(key));
        let nadir = sky.color("nadir").map_or([1.0; 3], |c| c.value);
        let zenith = sky.color("zenith").map_or([0.5, 0.7, 1.0], |c| c.value);
        if is_physical {
            add_physical(build, &sky);
        } else {
            build.loaded.scene.environment = Environment::Gradient { nadir, zenith };
        }
        sky.finish();
    }
}

/// The same radiance from everywhere, or an image.
fn even_or_image(build: &mut SceneFileBuilder, fields: &Fields) -> Option<Environment> {
    let background = fields.color("background");
    let image = fields.string("image");
    let rotation_rad = fields.number("rotation").map_or(0.0, |r| r.value.to_radians());
    let strength = fields.number_in("strength", 0.0..f64::from(f32::MAX), 1.0) as f32;
    if !fields.has("image") && (fields.has("rotation") || fields.has("strength")) {
        fields.problems.push(fields.span(), "'rotation' and 'strength' belong to an environment image");
    }
    if let Some(c) = background {
        return Some(Environment::Constant(c.value));
    }
    let file = image?;
    let image = read_pixels(build, file.value, file.span, Use::Environment)?;
    Some(Environment::Image { image, strength, rotation_rad })
}

fn seen_by_camera(build: &mut SceneFileBuilder, fields: &Fields) -> Option<Environment> {
    let seen = even_or_image(build, fields);
    fields.finish();
    if fields.has("background") == fields.has("image") {
        fields.problems.push(fields.span(), "'seen' needs exactly one of 'background' and 'image'");
    }
    seen
}

const PHYSICAL: [&str; 7] =
    ["sun_elevation", "sun_azimuth", "turbidity", "ground_albedo", "sun", "sun_size", "strength"];

/// A clear sky, as an image and a light.
fn add_physical(build: &mut SceneFileBuilder, sky: &Fields) {
    if sky.has("nadir") || sky.has("zenith") {
        let message =
            "'nadir' and 'zenith' make a blend, 'sun_elevation' and the like a clear sky: give one of both";
        sky.problems.push(sky.span(), message);
    }
    let elevation = sky.number_in("sun_elevation", 0.0..90.0, 45.0);
    sky.require("sun_elevation", sky.has("sun_elevation").then_some(()));
    let albedo = sky.color("ground_albedo");
    if let Some(color) = albedo.as_ref().filter(|c| c.value.iter().any(|v| *v > 1.0)) {
        sky.problems.push(color.span.clone(), "'ground_albedo' must be from 0 to 1");
    }
    let physical = PhysicalSky {
        sun_elevation_rad: elevation.to_radians(),
        sun_azimuth_rad: sky.number("sun_azimuth").map_or(0.0, |a| a.value.to_radians()),
        turbidity: sky.number_in("turbidity", 1.0..10.0, 3.0),
        ground_albedo: albedo.map_or([0.2; 3], |c| c.value.map(|v| f64::from(v.min(1.0)))),
        sun_angle_rad: sky.number_in("sun_size", 0.01..90.0, SUN_ANGLE_RAD.to_degrees()).to_radians(),
        has_sun: sky.flag("sun", true),
        strength: sky.number_in("strength", 0.0..1e9, 1.0),
    };
    if let Err(error) = physical.add_to(&mut build.loaded.scene) {
        sky.problems.push(sky.span(), error.to_string());
    }
}

pub(super) fn read_portals(build: &mut SceneFileBuilder, root: &Fields) {
    for (i, fields) in root.tables("portals").iter().enumerate() {
        let name = fields.string("name").map_or(format!("portal {}", i + 1), |n| n.value.to_string());
        let portal = match fields.has("corner") {
            true => by_corner(fields),
            false => by_middle(build, fields),
        };
        fields.finish();
        if let Some([corner, edge_u, edge_v]) = portal {
            build.loaded.scene.portals.push(Portal { name, corner, edge_u, edge_v });
        }
    }
}

fn by_corner(fields: &Fields) -> Option<[DVec3; 3]> {
    let [corner, u, v] = ["corner", "u", "v"].map(|key| fields.require(key, fields.vector(key)));
    let (corner, u, v) = (corner?, u?, v?);
    let (across, along) = (u.value.try_normalize(), v.value.try_normalize());
    let cosine = across.zip(along).map(|(a, b)| a.dot(b).abs());
    match cosine {
        Some(cosine) if cosine < 1e-3 => Some([corner.value, u.value, v.value]),
        _ => {
            let message = "the edges 'u' and 'v' of a portal must be longer than 0 and at right angles";
            fields.problems.push_help(v.span, message, "take a rectangle that covers the window");
            None
        }
    }
}

fn by_middle(build: &mut SceneFileBuilder, fields: &Fields) -> Option<[DVec3; 3]> {
    let size = fields.require("size", fields.numbers::<2>("size"));
    let placement = if fields.has("node") { at_node(build, fields) } else { placed(fields) };
    let MovingPlacement { now: Placement { center, direction, right, scale }, .. } = placement?;
    let size = size?;
    if size.value.iter().any(|s| *s <= 0.0) {
        fields.problems.push(size.span, "'size' of a portal must be above 0");
        return None;
    }
    let [width, height] = [size.value[0] * scale[0], size.value[1] * scale[1]];
    let (edge_u, edge_v) = (right * width, direction.cross(right) * height);
    Some([center - (edge_u + edge_v) / 2.0, edge_u, edge_v])
}
