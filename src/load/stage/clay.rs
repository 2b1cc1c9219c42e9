//! The material of models that bring none.

use crate::load::Loaded;
use crate::scene::{ColorSlot, FloatSlot, Material, Model, PbrMaterial};

/// Linear reflectance of clay: dark enough for light to model it, a little warm.
const COLOR: [f32; 3] = [0.60, 0.57, 0.53];
/// Perceptual roughness: a slight gloss.
const ROUGHNESS: f32 = 0.5;

/// Gives what the file left without a material the look of clay; vertex colours and pictures take the place of its colour.
pub(super) fn apply(loaded: &mut Loaded) {
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
