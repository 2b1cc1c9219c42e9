//! What a bare model stands on.

use super::framing::{Outline, on_grid};
use super::light;
use super::options::{Background, Ground, StageOptions};
use super::undersides;
use crate::color::luminance;
use crate::error::{Choice, Warning};
use crate::image::Image;
use crate::load::Loaded;
use crate::math::{DVec3, Vec2};
use crate::scene::{
    AlphaMode, Backdrop, ColorSlot, FloatSlot, Interpolation, Mapping, Material, ObjectTraits, PbrMaterial,
    RayKinds, Scene, Shape, Texture, TextureTransform, Wrap,
};

/// Radius of the ground in radii of the model: its edge is a degree below the horizon.
const REACH: f64 = 60.0;
/// Distance of the ground below the lowest point, in radii of the model: avoids coplanar faces.
const GAP: f64 = 2e-4;
/// Roughness of the ground: slightly reflective.
const ROUGHNESS: f32 = 0.4;
/// Strength of its gloss: less than that of glass.
const SPECULAR: f32 = 0.45;
/// Luminance of grounds above which their gloss has its whole strength.
const GLOSSY: f32 = 0.3;
/// Where its gloss ends, in radii of the model: farther away it is seen at grazing angles, where it would mirror the lights
/// of the stage and so look unlike the background.
const GLOSS_REACH: f64 = 3.0;
/// Roughness and colour of a floor.
const FLOOR: (f32, [f32; 3]) = (0.12, [0.16, 0.16, 0.165]);
/// Where a ground ends that doesn't have the background's colour, in radii of the model: it becomes ever more transparent up
/// to there, so that no horizon is seen.
const FADE_REACH: f64 = 30.0;
/// Texels along each side of the picture by which something fades.
const FADE_TEXELS: u32 = 128;
/// Share of the way up to where something fades out on which nothing is lost.
const FADE_START: f64 = 0.2;
/// Maximum reflectance of a ground.
const WHITEST: f64 = 0.95;

/// The blending of a ground into the background.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Melting {
    /// It has the background's colour in the light of the stage.
    Color,
    /// It catches shadows, and is transparent else: behind it may be anything.
    Catcher,
    /// It becomes transparent far away.
    Fading,
}

/// Adds the ground that the options ask for, and gives the background the colour that it melts into.
pub(super) fn add(loaded: &mut Loaded, options: &StageOptions, outline: &Outline, is_lit: bool) {
    let ground = options.ground_for(is_lit);
    let is_stage = options.light.is_stage() && !is_lit;
    if is_stage && options.background.is_none() {
        hide_environment(&mut loaded.scene);
        loaded.scene.backdrop = Some(Backdrop::Color(options.light.background()));
    }
    if ground == Ground::None {
        return;
    }
    if options.view.elevation_degrees < 0.0 {
        let message = format!("the model is seen from below: {} is left out", Choice::Ground);
        return loaded.notes.push(Warning::general(message));
    }
    let size = outline.radius();
    let center = outline.center();
    let below = DVec3::new(center.x, outline.min.y - GAP * size, center.z);
    undersides::leave_out(loaded, outline.min.y + GAP * size);
    let (melting, color) = melting(options, ground, is_stage);
    let material = material(&mut loaded.scene, ground, melting, color);
    let material = loaded.scene.add_material(material);
    let center = on_grid(below, size) + loaded.offset;
    let mut disk = Shape::disk(center, DVec3::Y, REACH * size, material);
    disk.name = own_name(&loaded.scene);
    if melting == Melting::Catcher {
        disk.traits = ObjectTraits { is_shadow_catcher: true, ..ObjectTraits::default() };
    }
    loaded.scene.shapes.push(disk);
}

/// The blending of a ground into the background, and its colour.
///
/// Catchers cost more: what they catch is found by tracing paths twice, and techniques that need to know all of a picture
/// rest. So they are for backgrounds that no ground can look like: pictures, none, and those brighter than white in the
/// light of the stage.
fn melting(options: &StageOptions, ground: Ground, is_stage: bool) -> (Melting, [f32; 3]) {
    if ground == Ground::Floor {
        return (Melting::Fading, FLOOR.1);
    }
    let wanted = match (&options.background, is_stage) {
        (None, false) => return (Melting::Fading, [0.5; 3]),
        (Some(Background::Transparent | Background::Picture(_)), _) | (_, false) => {
            return (Melting::Catcher, [0.5; 3]);
        }
        _ => options.backdrop(),
    };
    let white = light::reflected(options.light, wanted, DVec3::Y);
    let color: [f64; 3] = std::array::from_fn(|c| f64::from(wanted[c]) / white[c].max(1e-3));
    let melting = match color.iter().any(|&v| v > WHITEST) {
        true => Melting::Catcher,
        false => Melting::Color,
    };
    (melting, color.map(|v| v.clamp(0.0, WHITEST) as f32))
}

/// The material of a ground.
fn material(scene: &mut Scene, ground: Ground, melting: Melting, color: [f32; 3]) -> Material {
    // White lights mirrored in a ground of a strong or dark colour would hide that colour.
    let gloss = SPECULAR * (luminance(color) / GLOSSY).min(1.0);
    let most = color.iter().copied().fold(1e-3, f32::max);
    let tint = ColorSlot::constant(color.map(|v| v / most));
    let (roughness, specular) = match ground {
        Ground::Floor => (FLOOR.0, FloatSlot::constant(1.0)),
        _ => (ROUGHNESS, FloatSlot { factor: gloss, ..fading(scene, GLOSS_REACH) }),
    };
    let parameters = PbrMaterial {
        base_color: ColorSlot::constant(color),
        metallic: FloatSlot::constant(0.0),
        roughness: FloatSlot::constant(roughness),
        specular,
        specular_color: if ground == Ground::Floor { ColorSlot::constant([1.0; 3]) } else { tint },
        ..PbrMaterial::default()
    };
    let mut material = Material::gltf("ground", parameters);
    if melting == Melting::Fading {
        (material.alpha_mode, material.alpha) = (AlphaMode::Blend, fading(scene, FADE_REACH));
    }
    material
}

/// A texture that is 1 in the middle of the ground and fades to 0 at `reach` radii of the model.
fn fading(scene: &mut Scene, reach: f64) -> FloatSlot {
    let place = |i: u32| (f64::from(i) + 0.5) / f64::from(FADE_TEXELS) * 2.0 - 1.0;
    let mut rgb = Vec::with_capacity((FADE_TEXELS * FADE_TEXELS * 3) as usize);
    for row in 0..FADE_TEXELS {
        for column in 0..FADE_TEXELS {
            let away = place(row).hypot(place(column));
            // The outermost texels continue for ever.
            let end = 1.0 - 2.0 / f64::from(FADE_TEXELS);
            rgb.extend([(1.0 - light::smooth(FADE_START, end, away)) as f32; 3]);
        }
    }
    let image = scene.add_image(Image::from_linear_rgb("fading", FADE_TEXELS, FADE_TEXELS, rgb));
    let scale = REACH / reach;
    let transform = TextureTransform {
        offset: Vec2::splat((0.5 - 0.5 * scale) as f32),
        scale: Vec2::splat(scale as f32),
        ..TextureTransform::default()
    };
    let texture = scene.add_texture(Texture::Image {
        image,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        interpolation: Interpolation::Bilinear,
        mapping: Mapping::Uv { set: 0, transform },
    });
    FloatSlot::texture(texture, 0)
}

/// A name that nothing else in the scene has.
fn own_name(scene: &Scene) -> String {
    let is_taken = |name: &str| scene.instances.iter().any(|i| i.name == name);
    let names = (1..).map(|n| if n == 1 { "ground".to_string() } else { format!("ground {n}") });
    names.into_iter().find(|name| !is_taken(name)).unwrap_or_default()
}

/// Lets cameras see nothing of the environment.
pub(super) fn hide_environment(scene: &mut Scene) {
    scene.environment_visible_to = scene.environment_visible_to.without(RayKinds::CAMERA);
}
