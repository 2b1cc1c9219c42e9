//! What a bare model stands on.

use super::light;
use super::options::{Background, Ground, StageOptions};
use super::outline::{Outline, on_grid};
use crate::error::{Choice, Warning};
use crate::load::Loaded;
use crate::math::DVec3;
use crate::scene::{
    Backdrop, ColorSlot, FloatSlot, Material, ObjectTraits, PbrMaterial, RayKinds, Scene, Shape,
};

/// Radius of the ground in radii of the model: its edge lies a degree below the horizon.
const REACH: f64 = 60.0;
/// How far the ground lies below the lowest point, in radii of the model: no face of the model lies in it.
const GAP: f64 = 2e-4;
/// Roughness of the ground: it shows a trace of what stands on it.
const ROUGHNESS: f32 = 0.4;
/// Strength of its gloss: less than that of glass, so that it stays like the background where it is seen at grazing angles.
const SPECULAR: f32 = 0.45;
/// Share of the light that its gloss reflects where it is looked down upon at a middling angle.
const GLOSS: f64 = 0.03;
/// Roughness and colour of a floor.
const FLOOR: (f32, [f32; 3]) = (0.12, [0.16, 0.16, 0.165]);

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
    let (roughness, specular, color) = match ground {
        Ground::Floor => (FLOOR.0, 1.0, FLOOR.1),
        _ => (ROUGHNESS, SPECULAR, melting(loaded, options, is_stage)),
    };
    let parameters = PbrMaterial {
        base_color: ColorSlot::constant(color),
        metallic: FloatSlot::constant(0.0),
        roughness: FloatSlot::constant(roughness),
        specular: FloatSlot::constant(specular),
        ..PbrMaterial::default()
    };
    let material = loaded.scene.add_material(Material::gltf("ground", parameters));
    let center = on_grid(below, size) + loaded.offset;
    let mut disk = Shape::disk(center, DVec3::Y, REACH * size, material);
    disk.name = own_name(&loaded.scene);
    if ground == Ground::Shadow && matches!(options.background, Some(Background::Transparent)) {
        disk.traits = ObjectTraits { is_shadow_catcher: true, ..ObjectTraits::default() };
    }
    loaded.scene.shapes.push(disk);
}

/// A name that nothing else in the scene has.
fn own_name(scene: &Scene) -> String {
    let is_taken = |name: &str| scene.instances.iter().any(|i| i.name == name);
    let names = (1..).map(|n| if n == 1 { "ground".to_string() } else { format!("ground {n}") });
    names.into_iter().find(|name| !is_taken(name)).unwrap_or_default()
}

/// The ground's colour for which it looks like the background where nothing shades it.
fn melting(loaded: &mut Loaded, options: &StageOptions, is_stage: bool) -> [f32; 3] {
    if !is_stage {
        return [0.5; 3];
    }
    let wanted = options.backdrop();
    let white = light::reflected(options.light, wanted, DVec3::Y);
    let color: [f64; 3] =
        std::array::from_fn(|c| (f64::from(wanted[c]) / white[c].max(1e-3) - GLOSS) / (1.0 - GLOSS));
    if color.iter().any(|&v| v > 1.0) && options.background.is_some() {
        let message = format!("the light can't make the ground as bright as {}", Choice::Background);
        loaded.notes.push(Warning::general(message));
    }
    color.map(|v| v.clamp(0.0, 0.95) as f32)
}

/// Lets cameras see nothing of the environment.
pub(super) fn hide_environment(scene: &mut Scene) {
    scene.environment_visible_to = scene.environment_visible_to.without(RayKinds::CAMERA);
}
