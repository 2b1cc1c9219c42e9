//! `[environment]`: the radiance of rays that hit nothing; black without this table. It has exactly one of
//!
//! - `background = [r, g, b]`: constant radiance, W/sr/m2,
//! - `sky = { nadir = [r, g, b], zenith = [r, g, b] }`: a vertical gradient (default: white below, `[.5, .7, 1]` above),
//! - `sky = { sun_elevation = 30 }`: a clear sky with sun (Hosek, Wilkie 2012), see below,
//! - `image = "file"`: an equirectangular image, with `rotation` (degrees counter-clockwise seen from above; 0) and `strength` (1),
//! - `texture = "NAME"`: a texture evaluated at the points of the unit sphere, such as one of `type = "nodes"`, with `rotation`, `strength` and
//!   `resolution`: width of the equirectangular image that it is baked to, 16 to 16384 texels (default: width of the texture's largest image, clamped to 2048 to 8192).
//!
//! Keys of the clear sky: `sun_elevation` (degrees above the horizon, 0 to 90) and, optionally, `sun_azimuth` (degrees clockwise
//! seen from above, from -z towards x; 0), `turbidity` (1 is the clearest air, 3 a clear day, 10 haze; 3), `ground_albedo` (a colour from 0 to
//! 1, also of the ground below the horizon; 0.2), `sun` (`false` removes the sun disk, but not its glow), `sun_size` (diameter in degrees; 0.5358;
//! larger suns soften shadows at the same irradiance) and `strength` (factor on the radiance in W/sr/m2, at 683 lm/W; 1). At strength 1 a white wall in
//! sunlight has a radiance of about 50 W/sr/m2: use `exposure = -5` in `[render]`. The sun is a separate light, visible to cameras and in
//! mirrors.
//!
//! `sun = { direction = [x, y, z], angle = 0.5358, irradiance = [r, g, b] }` adds a sun to a constant, image or texture environment: light
//! travels in `direction`, from a disk of `angle` degrees diameter, visible to cameras and in mirrors; `irradiance` is that of a surface perpendicular to the light, W/m2.
//!
//! `fog = { density = 0.1 }` fills the space around all solids (see `media`), and may stand alone.
//!
//! `seen = { background = [r, g, b] }` replaces the environment for camera rays only, without lighting the scene: a constant radiance, or an `image` or a `texture`
//! with `rotation` and `strength` as above.
//!
//! `group` is the environment's light group. With `visible_to_camera = false` it lights the scene, but the picture is transparent there;
//! `visible_to` lists the kinds of rays that see it, as for objects. With `sampled = false` it is reached by BSDF sampling only,
//! as in Cycles for a constant world: objects occlude it by their visibility to scattered rays instead of shadow rays.
//!
//! # portals
//!
//! `[[portals]]`: rectangles, such as windows, through which the environment is sampled from within a room. They are not
//! surfaces and only affect noise: light through other openings is still found, with more noise. They help most with an
//! environment image behind a window.
//!
//! | Key | Value |
//! |---|---|
//! | `name` | for reports |
//! | `center`, `target` or `direction`, `up`, `size` | the centre, the direction in which light enters, and width and height, as for area lights |
//! | `corner`, `u`, `v` | or a corner and the two edges from there, at right angles; light enters along u x v |
//! | `transform`, `size` | or steps as for objects (see `transform`), applied to a portal at the origin where light enters along -z, with its height along y |
//!
//! In a sidecar, `node = "NAME"` and `size` place a portal at an empty node of the model; light enters along the node's -z, as with Blender's
//! portal area lights. In glTF files, `portal` in the `extras` of a node is the portal's size, `[width, height]`, or true for 1 x 1.

use super::builder::SceneFileBuilder;
use super::fields::Fields;
use super::media;
use super::textures::{Textures, read_pixels};
use super::traits::{group, visible_to};
use super::transform::{
    MovingPlacement, Placement, placement_at_node, placement_by_target, placement_by_transform,
};
use crate::error::{Result, Warning};
use crate::image::Image;
use crate::load::image::Use;
use crate::load::sky::{PhysicalSky, SUN_ANGLE_RAD};
use crate::load::{Loaded, sky};
use crate::math::{DVec3, Vec3, poly};
use crate::scene::{Environment, Portal, RayKinds, Scene, Texture, TextureId};
use crate::texture::{CompiledTextures, PointReader, TexturePoint};
use rayon::prelude::*;
use std::ops::RangeInclusive;

pub(super) fn read<'a>(build: &mut SceneFileBuilder, fields: &Fields<'a>, textures: &mut Textures<'a>) {
    let sky = fields.table("sky");
    let sources = ["background", "sky", "image", "texture"].map(|key| fields.has(key));
    let environment = constant_or_image(build, fields, textures);
    if let Some(seen) = fields.table("seen") {
        build.loaded.scene.camera_environment = read_camera_background(build, &seen, textures);
    }
    build.loaded.scene.environment_visible_to = visible_to(fields, RayKinds::ALL);
    build.loaded.scene.environment_bsdf_only = !fields.flag("sampled", true);
    build.loaded.scene.environment_group = group(fields, "group");
    build.loaded.scene.fog = media::fog(fields);
    let sun = fields.table("sun");
    fields.finish();
    let count = sources.iter().filter(|is_given| **is_given).count();
    if count == 0 && fields.has("fog") {
        return;
    }
    if count != 1 {
        let message =
            "'environment' needs exactly one of 'background', 'sky', 'image' and 'texture', or 'fog' alone";
        return fields.report(message);
    }
    if let Some(sun) = sun {
        add_sun(build, &sun, fields.has("sky"));
    }
    if let Some(environment) = environment {
        build.loaded.scene.environment = environment;
    } else if let Some(sky) = sky {
        let is_physical = PHYSICAL_SKY_KEYS.into_iter().any(|key| sky.has(key));
        let nadir = sky.color("nadir").map_or([1.0; 3], |c| c.value);
        let zenith = sky.color("zenith").map_or([0.5, 0.7, 1.0], |c| c.value);
        if is_physical {
            add_physical_sky(build, &sky);
        } else {
            build.loaded.scene.environment = Environment::Gradient { nadir, zenith };
        }
        sky.finish();
    }
}

/// A constant environment, an image or a texture.
fn constant_or_image<'a>(
    build: &mut SceneFileBuilder,
    fields: &Fields<'a>,
    textures: &mut Textures<'a>,
) -> Option<Environment> {
    let background = fields.color("background");
    let image = fields.string("image");
    let texture = fields.string("texture");
    let rotation_rad = fields.number("rotation").map_or(0.0, |r| r.value.to_radians());
    let strength = fields.number_in("strength", 0.0..f64::from(f32::MAX), 1.0) as f32;
    let width = fields.has("resolution").then(|| {
        let (min, max) = WIDTH_RANGE.into_inner();
        fields.number_in("resolution", f64::from(min)..f64::from(max), f64::from(min)) as u32
    });
    let has_image = fields.has("image") || fields.has("texture");
    if !has_image && (fields.has("rotation") || fields.has("strength")) {
        fields.report("'rotation' and 'strength' need an environment image or texture");
    }
    if width.is_some() && !fields.has("texture") {
        fields.report("'resolution' needs an environment texture");
    }
    if let Some(c) = background {
        return Some(Environment::Constant(c.value));
    }
    if let Some(name) = texture {
        let id = textures.get(build, name.value, name.span.clone())?;
        let Loaded { scene, warnings, .. } = &mut build.loaded;
        let baked = bake(scene, id, width, strength, rotation_rad, warnings);
        return baked.map_err(|error| fields.problems.push(name.span, error.to_string())).ok();
    }
    let file = image?;
    let image = read_pixels(build, file.value, file.span, Use::Environment)?;
    Some(Environment::Image { image, strength, rotation_rad })
}

fn read_camera_background<'a>(
    build: &mut SceneFileBuilder,
    fields: &Fields<'a>,
    textures: &mut Textures<'a>,
) -> Option<Environment> {
    let background = constant_or_image(build, fields, textures);
    fields.finish();
    if ["background", "image", "texture"].iter().filter(|key| fields.has(key)).count() != 1 {
        fields.report("'seen' needs exactly one of 'background', 'image' and 'texture'");
    }
    background
}

const PHYSICAL_SKY_KEYS: [&str; 7] =
    ["sun_elevation", "sun_azimuth", "turbidity", "ground_albedo", "sun", "sun_size", "strength"];

/// Adds the sun of the key `sun`.
fn add_sun(build: &mut SceneFileBuilder, fields: &Fields, has_sky: bool) {
    let direction = fields.require("direction", fields.vector("direction"));
    let angle = fields.number_in("angle", 0.01..90.0, SUN_ANGLE_RAD.to_degrees());
    let irradiance = fields.require("irradiance", fields.color("irradiance"));
    fields.finish();
    let Some((direction, irradiance)) = direction.zip(irradiance) else { return };
    let Some(unit_direction) = direction.value.try_normalize() else {
        return fields.problems.push(direction.span, "'direction' must be longer than 0");
    };
    if has_sky {
        return fields.report("'sky' has its own sun: leave 'sun' out");
    }
    sky::add_sun(&mut build.loaded.scene, unit_direction, angle.to_radians(), irradiance.value);
}

/// Adds a clear sky: an image and a light.
fn add_physical_sky(build: &mut SceneFileBuilder, sky: &Fields) {
    if sky.has("nadir") || sky.has("zenith") {
        let message = "'nadir' and 'zenith' belong to a gradient, 'sun_elevation' and others to a clear sky: use one kind";
        sky.report(message);
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
        sky.report(error.to_string());
    }
}

pub(super) fn read_portals(build: &mut SceneFileBuilder, root: &Fields) {
    for (i, fields) in root.tables("portals").iter().enumerate() {
        let name = fields.string("name").map_or(format!("portal {}", i + 1), |n| n.value.to_string());
        let portal = match fields.has("corner") {
            true => portal_by_corner(fields),
            false => portal_by_center(build, fields),
        };
        fields.finish();
        if let Some([corner, edge_u, edge_v]) = portal {
            build.loaded.scene.portals.push(Portal { name, corner, edge_u, edge_v });
        }
    }
}

fn portal_by_corner(fields: &Fields) -> Option<[DVec3; 3]> {
    let [corner, u, v] = ["corner", "u", "v"].map(|key| fields.require(key, fields.vector(key)));
    let (corner, u, v) = (corner?, u?, v?);
    let (across, along) = (u.value.try_normalize(), v.value.try_normalize());
    let cosine = across.zip(along).map(|(a, b)| a.dot(b).abs());
    match cosine {
        Some(cosine) if cosine < 1e-3 => Some([corner.value, u.value, v.value]),
        _ => {
            let message = "the edges 'u' and 'v' of a portal must be longer than 0 and at right angles";
            fields.problems.push_help(v.span, message, "use a rectangle that covers the window");
            None
        }
    }
}

fn portal_by_center(build: &mut SceneFileBuilder, fields: &Fields) -> Option<[DVec3; 3]> {
    let size = fields.require("size", fields.numbers::<2>("size"));
    let placement = match () {
        () if fields.has("node") => placement_at_node(build, fields),
        () if fields.has("transform") => placement_by_transform(build, fields, None),
        () => placement_by_target(fields),
    };
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

/// Range of `resolution`, texels.
pub const WIDTH_RANGE: RangeInclusive<u32> = 16..=16384;

/// Default width for textures without images; the minimum for textures with images.
const DEFAULT_WIDTH: u32 = 2048;
/// Maximum default width for textures with images.
const MAX_DEFAULT_WIDTH: u32 = 8192;

/// Bakes a texture, evaluated at the points of the unit sphere, to an environment image, which is added to the scene. `width`
/// in texels is twice the height.
///
/// # Errors
/// An image of the texture is damaged.
pub fn bake(
    scene: &mut Scene,
    texture: TextureId,
    width: Option<u32>,
    strength: f32,
    rotation_rad: f64,
    warnings: &mut Vec<Warning>,
) -> Result<Environment> {
    let (textures, report) = CompiledTextures::of_subset(&scene.textures, &scene.images, &[texture])?;
    let image_ids = Texture::image_ids(&scene.textures, texture);
    warnings.extend(report.warnings);
    if let Some([r, g, b, _]) = textures.constant(texture) {
        return Ok(Environment::Constant([r, g, b].map(|c| c * strength)));
    }
    let widest =
        image_ids.iter().filter_map(|id| scene.images.get(id.index())).map(|image| image.width).max();
    let default = widest.unwrap_or(0).clamp(DEFAULT_WIDTH, MAX_DEFAULT_WIDTH);
    let width = width.unwrap_or(default);
    // Textures with images have no detail below their texels, and need no antialiasing.
    let image = scene.add_image(bake_image(&textures, texture, width, widest.is_none()));
    Ok(Environment::Image { image, strength, rotation_rad })
}

/// Bakes the texture at the centres of texels; if `is_antialiased`, with four samples per texel at edges.
fn bake_image(textures: &CompiledTextures, texture: TextureId, width: u32, is_antialiased: bool) -> Image {
    let height = (width / 2).max(1);
    let size = [width, height];
    let value = |x: f64, y: f64| {
        let direction = direction((x / f64::from(width)) as f32, (y / f64::from(height)) as f32);
        // The normal faces the centre of the sphere.
        let point =
            TexturePoint { world: direction, normal: -direction, cosine: 1.0, ..TexturePoint::default() };
        let [r, g, b, _] = PointReader::new(textures, point).eval(texture);
        [r, g, b]
    };
    let centres = evaluate_texels(size, |x, y| value(f64::from(x) + 0.5, f64::from(y) + 0.5));
    let values = match is_antialiased {
        false => centres,
        true => evaluate_texels(size, |x, y| match has_edge(&centres, size, [x, y]) {
            false => centres[(y * width + x) as usize],
            true => mean(
                [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
                    .map(|(s, t)| value(f64::from(x) + s, f64::from(y) + t)),
            ),
        }),
    };
    Image::from_linear_rgb("environment", width, height, values.into_flattened())
}

/// Values of all texels, row by row from the top.
fn evaluate_texels([width, height]: [u32; 2], value: impl Fn(u32, u32) -> [f32; 3] + Sync) -> Vec<[f32; 3]> {
    let mut values = vec![[0.0; 3]; width as usize * height as usize];
    values.par_chunks_exact_mut(width as usize).zip(0..height).for_each(|(row, y)| {
        (0..).zip(row).for_each(|(x, texel)| *texel = value(x, y));
    });
    values
}

/// Whether a texel differs from a neighbour by more than a fraction of the brighter of the two.
fn has_edge(values: &[[f32; 3]], [width, height]: [u32; 2], [x, y]: [u32; 2]) -> bool {
    /// Maximum relative difference of neighbours without antialiasing.
    const MAX_DIFFERENCE: f32 = 0.1;
    let at = |x: u32, y: u32| values[(y * width + x) as usize];
    let own = at(x, y);
    let neighbours = [
        at((x + 1) % width, y),
        at((x + width - 1) % width, y),
        at(x, (y + 1).min(height - 1)),
        at(x, y.saturating_sub(1)),
    ];
    neighbours
        .iter()
        .any(|other| (0..3).any(|c| (own[c] - other[c]).abs() > MAX_DIFFERENCE * own[c].max(other[c])))
}

fn mean(values: [[f32; 3]; 4]) -> [f32; 3] {
    std::array::from_fn(|c| values.iter().map(|value| value[c]).sum::<f32>() / 4.0)
}

/// The unit direction of equirectangular coordinates, in the convention of [`Environment::Image`].
fn direction(u: f32, v: f32) -> Vec3 {
    let ((sin_phi, cos_phi), (sin_theta, cos_theta)) =
        (poly::sin_cos_turns(u - 0.5), poly::sin_cos_turns(0.5 * v));
    Vec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mapping;
    use crate::scene::nodes::{Node, NodeGraph, NodeInput, NodeKind, SocketType};
    use std::sync::Arc;

    /// A world-space checker has one colour per octant of the sphere.
    #[test]
    fn directions_are_points_of_the_unit_sphere() {
        let mut scene = Scene::default();
        let [even, odd] = [[1.0, 0.5, 0.25], [0.0, 0.0, 2.0]].map(|c| scene.add_texture(Texture::Solid(c)));
        let checker =
            scene.add_texture(Texture::Checker { even, odd, cell_size: 2.0, mapping: Mapping::World });
        let baked = bake(&mut scene, checker, Some(64), 3.0, 0.5, &mut Vec::new()).unwrap();
        let Environment::Image { image, strength, rotation_rad } = baked else { panic!("{baked:?}") };
        assert_eq!((strength, rotation_rad), (3.0, 0.5));
        let image = &scene.images[image.index()];
        assert_eq!((image.width, image.height), (64, 32));
        for (x, y) in (0..32).flat_map(|y| (0..64).map(move |x| (x, y))) {
            let d = direction((x as f32 + 0.5) / 64.0, (y as f32 + 0.5) / 32.0);
            let negative = [d.x, d.y, d.z].iter().filter(|c| **c < 0.0).count();
            let expected = if negative % 2 == 0 { [1.0, 0.5, 0.25] } else { [0.0, 0.0, 2.0] };
            assert_eq!(&image.rgba(x, y)[..3], &expected, "{d}");
        }
    }

    #[test]
    fn constant_textures_become_constant_environments() {
        let mut scene = Scene::default();
        let grey = scene.add_texture(Texture::Solid([0.5; 3]));
        let baked = bake(&mut scene, grey, None, 2.0, 0.0, &mut Vec::new()).unwrap();
        assert_eq!(baked, Environment::Constant([1.0; 3]));
        assert!(scene.images.is_empty());
    }

    /// An environment texture node bakes to its own image, texel by texel.
    #[test]
    fn an_environment_image_passes_through_a_graph() {
        let mut scene = Scene::default();
        let rgb: Vec<f32> = (0..64 * 32 * 3).map(|i| (i % 97) as f32 / 7.0).collect();
        let image = scene.add_image(Image::from_linear_rgb("sky", 64, 32, rgb.clone()));
        let (wrap_u, wrap_v) = Default::default();
        let texture = Texture::Image {
            image,
            wrap_u,
            wrap_v,
            interpolation: Default::default(),
            mapping: Mapping::default(),
        };
        let read = scene.add_texture(texture);
        let kind = NodeKind::from_name("environment_texture").unwrap();
        assert_eq!(kind.outputs()[0].kind, SocketType::Color);
        let inputs = vec![NodeInput::Default; kind.inputs().len()];
        let nodes = vec![Node { kind, inputs, image: Some(read), reads_alpha: false }];
        let graph = NodeGraph { nodes, result: NodeInput::Link { node: 0, output: 0 }, is_z_up: true };
        let graph = scene.add_texture(Texture::Nodes(Arc::new(graph)));
        let baked = bake(&mut scene, graph, Some(64), 1.0, 0.0, &mut Vec::new()).unwrap();
        let Environment::Image { image, .. } = baked else { panic!("{baked:?}") };
        for (i, expected) in rgb.as_chunks::<3>().0.iter().enumerate() {
            let found = scene.images[image.index()].rgba(i as u32 % 64, i as u32 / 64);
            let distance = (0..3).map(|c| (found[c] - expected[c]).abs()).fold(0.0, f32::max);
            assert!(distance < 1e-3, "{i}: {found:?} {expected:?}");
        }
    }
}
